//! How often the true torque and pressure lie within two standard deviations of the filter.

use car::{Car, ErrorBudget};
use drivetrain::ShiftKind;
use evaluate::{ClutchRow, TruePhase};
use observer::{ShiftTables, gearbox_filter};
use plant::car::CarShift;
use study::gearbox::matrix::{MatrixShift, Random, neighbouring_shifts};
use study::gearbox::{ShiftDraw, inputs, score_samples, simulated};

use super::cars::{cars, sensors};

/// Sampled cars of each shift: `BAND_DRAWS=40 cargo test --release -p study --test tests band -- --nocapture`.
const DRAWS: u64 = 2;

/// Values, those in the band, and sums of the widths of band and guaranteed range, of torque and pressure.
#[derive(Debug, Clone, Copy, Default)]
struct Coverage {
    count: f64,
    inside: f64,
    widths: [f64; 2],
}

impl Coverage {
    fn push(&mut self, truth: f64, band: Option<[f64; 2]>, range: Option<[f64; 2]>) {
        let Some((band, range)) = band.zip(range).filter(|_| truth.is_finite()) else { return };
        self.count += 1.0;
        self.inside += f64::from(band[0] <= truth && truth <= band[1]);
        for (sum, [low, high]) in self.widths.iter_mut().zip([band, range]) {
            *sum += high - low;
        }
    }

    fn add(&mut self, more: &Self) {
        self.count += more.count;
        self.inside += more.inside;
        self.widths = [0, 1].map(|of| self.widths[of] + more.widths[of]);
    }
}

/// Of torque and pressure in torque and inertia phase.
type OfShift = [[Coverage; 2]; 2];

/// A car within the budget of the file: with other friction, valve gains and converter, and with other lags, delays and hysteresis of the
/// valves too.
fn sampled(known: &Car, budget: &ErrorBudget, shift: &MatrixShift, (draw, timing): (u64, bool)) -> Car {
    let mut random = Random(shift.noise(draw));
    let draw = ShiftDraw::within(known, budget, || random.uniform());
    if timing { draw.with_timing(budget, || random.uniform()) } else { draw }.car(known)
}

/// The clutches of a shift that slip; of one that holds no torque is estimated by its pressure.
fn coverage(known: &Car, tables: &ShiftTables<f64>, shift: &MatrixShift, draw: (u64, bool)) -> OfShift {
    let sensors = sensors();
    let budget = ErrorBudget::of_car(known).read_by(known, Some(&sensors));
    let filter = gearbox_filter(known, tables, &budget, Some(&sensors));
    let usual = CarShift::usual(known, shift.from, shift.to, shift.throttle());
    let samples = simulated(known, &sampled(known, &budget, shift, draw), &usual).unwrap();
    let inputs = inputs(known, tables, &samples, &sensors, shift.noise(draw.0));
    let mut all = OfShift::default();
    for row in score_samples(tables, &filter, &samples, &inputs) {
        let Some(phase) = row.phase() else { continue };
        let [torque, pressure] = &mut all[usize::from(phase == TruePhase::Inertia)];
        let is_compared = |clutch: &&ClutchRow| !clutch.sticks && clutch.has_pressure;
        for clutch in row.clutches.iter().filter(is_compared) {
            torque.push(clutch.torque_n_m[0], clutch.torque_band_n_m(), clutch.torque_range_n_m);
            pressure.push(clutch.pressure_pa[0], clutch.pressure_band_pa(), clutch.pressure_range_pa);
        }
    }
    all
}

/// Coverage by kind of shift, over all cars.
fn of_kinds(timing: bool) -> [OfShift; ShiftKind::ALL.len()] {
    let draws = std::env::var("BAND_DRAWS").map_or(DRAWS, |draws| draws.parse().unwrap());
    let mut all = [OfShift::default(); ShiftKind::ALL.len()];
    for known in &cars() {
        let budget = ErrorBudget::of_car(known).read_by(known, Some(&sensors()));
        let tables = ShiftTables::of_car(known, &budget).unwrap();
        for shift in neighbouring_shifts(known, &tables).0 {
            let sums = &mut all[ShiftKind::ALL.iter().position(|kind| *kind == shift.kind).unwrap()];
            for draw in 0..draws {
                let more = coverage(known, &tables, &shift, (draw, timing));
                for (sum, more) in sums.iter_mut().flatten().zip(more.iter().flatten()) {
                    sum.add(more);
                }
            }
        }
    }
    all
}

/// Kinds and phases in which fewer of the values are within two standard deviations, or these are more than half of the range.
fn wrong(timing: bool, lowest: f64) -> Vec<(&'static str, &'static str)> {
    let mut wrong = Vec::new();
    for (kind, [torque_phase, inertia_phase]) in ShiftKind::ALL.iter().zip(of_kinds(timing)) {
        for (phase, [torque, pressure]) in [("torque", torque_phase), ("inertia", inertia_phase)] {
            let [band, range] = torque.widths.map(|width| width / torque.count);
            let [of_torque, of_pressure] = [torque, pressure].map(|of| of.inside / of.count);
            println!(
                "{}, {phase} phase: torque {:.1} %, pressure {:.1} % of {} rows; torque {band:.1} N m wide, range {range:.1}",
                kind.name(),
                100.0 * of_torque,
                100.0 * of_pressure,
                torque.count
            );
            if of_torque < lowest || of_pressure < lowest || band > 0.5 * range {
                wrong.push((kind.name(), phase));
            }
        }
    }
    wrong
}

/// Of white errors 95 %; the lowest that was measured is 96 %, of power-off upshifts in the torque phase.
#[test]
fn two_standard_deviations_hold_the_truth_with_other_friction_gains_and_converter() {
    assert_eq!(wrong(false, 0.93), []);
}

/// The hard case: a lag, a delay and a hysteresis of a shift are the same throughout, and the filter takes the error of the pressure for one that
/// fades. The lowest that was measured is 77 %, of power-off upshifts in the torque phase.
#[test]
fn two_standard_deviations_hold_most_of_the_truth_in_cars_of_the_whole_budget() {
    assert_eq!(wrong(true, 0.75), []);
}
