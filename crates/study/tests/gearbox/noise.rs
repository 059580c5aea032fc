//! Speeds that are noisier than is stated.

use car::{Car, ErrorBudget};
use evaluate::errors::{NOTHING_N_M, controlling_of};
use evaluate::score::{SquaredErrors, TruePhase};
use observer::{ShiftTables, gearbox_filter};
use plant::car::CarShift;
use study::gearbox::matrix::{drawn_car, neighbouring_shifts};
use study::gearbox::{inputs, score_samples, simulated};

use super::cars::{cars, sensors};

/// Torque error of the controlling clutch over that of the open loop, in torque and inertia phase of all neighbouring shifts of a car
/// whose speeds have multiples of the stated noise: of turbine and output, and of engine and wheel.
fn ratios(known: &Car, [of_gearbox, of_others]: [f64; 2]) -> [f64; 2] {
    let stated = sensors();
    let mut noisy = sensors();
    for sensor in [&mut noisy.turbine, &mut noisy.output] {
        sensor.noise_rad_s *= of_gearbox;
    }
    for sensor in [&mut noisy.engine, &mut noisy.wheel] {
        sensor.noise_rad_s *= of_others;
    }
    let budget = ErrorBudget::of_car(known).read_by(known, Some(&stated));
    let tables = ShiftTables::of_car(known, &budget).unwrap();
    let filter = gearbox_filter(known, &tables, &budget, Some(&stated));
    let mut sums = [SquaredErrors::default(); 2];
    for shift in neighbouring_shifts(known, &tables).0 {
        for draw in 0..2 {
            let truth = drawn_car(known, shift.from, shift.to, draw);
            let usual = CarShift::usual(known, shift.from, shift.to, shift.throttle());
            let samples = simulated(known, &truth, &usual).unwrap();
            let inputs = inputs(known, &tables, &samples, &noisy, shift.noise(draw));
            let rows = score_samples(&tables, &filter, &samples, &inputs);
            let clutch = controlling_of(&rows, shift.kind);
            for (sum, phase) in sums.iter_mut().zip([TruePhase::Torque, TruePhase::Inertia]) {
                let errors = SquaredErrors::of(&rows, phase, clutch);
                if errors.rms_n_m()[1] > NOTHING_N_M {
                    sum.add(&errors);
                }
            }
        }
    }
    sums.map(|sum| sum.ratio().unwrap())
}

#[test]
fn three_times_the_stated_noise_of_turbine_and_output_costs_little() {
    for known in &cars()[..3] {
        let (stated, noisy) = (ratios(known, [1.0, 1.0]), ratios(known, [3.0, 1.0]));
        println!("{}: {stated:.3?} as stated, {noisy:.3?} with three times the noise", known.gearbox.gears.len());
        // With the stated deviations alone it is worse than the open loop, by a factor of up to 2.7.
        for (noisy, stated) in noisy.into_iter().zip(stated) {
            assert!(noisy < 1.0 && noisy < 1.25 * stated, "{noisy} {stated}");
        }
    }
}

#[test]
fn noise_of_engine_and_wheel_does_not_take_the_gain_of_the_inertia_phase() {
    let [_, inertia] = ratios(&cars()[0], [3.0, 3.0]);
    println!("inertia phase: {inertia:.3} with three times the noise of all speeds");
    assert!(inertia < 0.6, "{inertia}");
}
