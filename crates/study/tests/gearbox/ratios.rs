//! Torque errors over those of the open loop, of a car whose sensors may be other than stated.

use car::{Car, ErrorBudget, Sensors};
use evaluate::errors::{NOTHING_N_M, controlling_of};
use evaluate::score::{SquaredErrors, TruePhase};
use observer::{ShiftTables, gearbox_filter};
use plant::car::CarShift;
use study::gearbox::matrix::{drawn_car, neighbouring_shifts};
use study::gearbox::{inputs, score_samples, simulated};

/// Sampled cars of each shift: with six, the ratio of the inertia phase behind noisy speeds is off by 0.05 yet. So the tests take some seconds.
const DRAWS: u64 = 10;

/// The torque error of the controlling clutch over that of the open loop, in torque and inertia phase of all neighbouring shifts, with [`DRAWS`] sampled cars each;
/// and how many values are outside their guaranteed range. The filter knows the `stated` sensors, and the speeds come from the `true_ones`.
pub(crate) fn torque_ratios(known: &Car, stated: &Sensors, true_ones: &Sensors) -> ([f64; 2], usize) {
    let budget = ErrorBudget::of_car(known).read_by(known, Some(stated));
    let tables = ShiftTables::of_car(known, &budget).unwrap();
    let filter = gearbox_filter(known, &tables, &budget, Some(stated));
    let (mut sums, mut outside) = ([SquaredErrors::default(); 2], 0);
    for shift in neighbouring_shifts(known, &tables).0 {
        for draw in 0..DRAWS {
            let truth = drawn_car(known, shift.from, shift.to, draw);
            let usual = CarShift::usual(known, shift.from, shift.to, shift.throttle());
            let samples = simulated(known, &truth, &usual).unwrap();
            let inputs = inputs(known, &tables, &samples, true_ones, shift.noise(draw));
            let rows = score_samples(&tables, &filter, &samples, &inputs);
            outside += rows.iter().flat_map(|row| &row.clutches).filter(|clutch| !clutch.in_range).count();
            let clutch = controlling_of(&rows, shift.kind);
            for (sum, phase) in sums.iter_mut().zip([TruePhase::Torque, TruePhase::Inertia]) {
                let errors = SquaredErrors::of(&rows, phase, clutch);
                if errors.rms_n_m()[1] > NOTHING_N_M {
                    sum.add(&errors);
                }
            }
        }
    }
    (sums.map(|sum| sum.ratio().unwrap()), outside)
}
