//! Cars whose pistons have a stroke, with other volumes, return springs, passages and oil than those that the filter knows.

use car::ErrorBudget;
use car::{Car, ShiftClutch};
use drivetrain::ShiftKind;
use observer::ShiftTables;
use observer::gearbox::{FrictionElement, GearboxFilter, GearboxTables, Learnt};
use plant::car::CarShift;
use study::gearbox::matrix::{MatrixShift, drawn_car, neighbouring_shifts};
use study::gearbox::{ShiftDraw, ShiftScoreRow, SquaredErrors, TruePhase, inputs, score_samples, simulated};
use study::shift_learning::{filter, tables_with_inertia};

use super::cars::{Random, cars_with_strokes, sensors};
use super::learning::{Drive, Errors, SHIFTS};
use super::{controlling, draws, is_not_worse_than_the_open_loop, print, rows};

/// The numbers of the documentation: `MATRIX_DRAWS=40 cargo test --release -p study --test tests strokes -- --nocapture`.
#[test]
fn matrix_of_cars_with_strokes() {
    for timing in [false, true] {
        let rows = rows(&cars_with_strokes(), draws(), timing);
        println!("strokes{}:", if timing { ", and lag, delay and hysteresis of the valves" } else { "" });
        print(&rows);
        is_not_worse_than_the_open_loop(&rows);
    }
}

/// Rows of a shift by the filter as it is, and by one that knows of no pistons.
fn with_and_without(known: &Car, shift: &MatrixShift, seed: u64) -> [Vec<ShiftScoreRow>; 2] {
    let truth = drawn_car(known, shift.from, shift.to, seed);
    let usual = CarShift::usual(known, shift.from, shift.to, shift.throttle());
    let (samples, sensors) = (simulated(known, &truth, &usual).unwrap(), sensors());
    let tables = tables_with_inertia(known, 1.0).unwrap();
    let filter = filter(known, &tables, &sensors);
    let inputs = inputs(known, &tables, &samples, &sensors, shift.noise(seed));
    let elements = filter.tables.elements.iter().map(|element| FrictionElement { piston: None, ..*element });
    let elements: Vec<_> = elements.collect();
    let without = GearboxFilter { tables: GearboxTables { elements: &elements, ..filter.tables }, ..filter };
    [&filter, &without].map(|filter| score_samples(&tables, filter, &samples, &inputs))
}

/// Errors of a clutch over all rows of a shift in which it slips, also while it carries nothing.
fn whole_shift(rows: &[ShiftScoreRow], clutch: usize) -> SquaredErrors {
    let mut sum = SquaredErrors::default();
    for row in rows.iter().map(|row| &row.clutches[clutch]).filter(|row| !row.sticks) {
        let [truth, estimate, open_loop] = row.torque_n_m;
        let [estimate, open_loop] = [estimate, open_loop].map(|found| (truth - found).powi(2));
        sum.add(&SquaredErrors { estimate, open_loop, size: truth.abs(), rows: 1.0 });
    }
    sum
}

/// Without pistons the filter takes what a clutch does not carry while it fills for an error of friction, and is above the
/// valve model where the clutch then carries. The valve model without pistons is right there by luck: while a clutch fills it
/// is not. So over a whole shift it is the worst.
#[test]
fn a_filter_that_knows_of_no_pistons_is_worse() {
    let car = cars_with_strokes().remove(0);
    let tables = ShiftTables::of_car(&car, &ErrorBudget::of_car(&car)).unwrap();
    let mut all = [[SquaredErrors::default(); 2]; 2];
    for kind in ShiftKind::ALL {
        let mut sums = [[SquaredErrors::default(); 2]; 2];
        let main = controlling(kind);
        for shift in neighbouring_shifts(&car, &tables).0.iter().filter(|shift| shift.kind == kind) {
            for seed in 1..=draws() {
                for (sums, rows) in sums.iter_mut().zip(with_and_without(&car, shift, seed)) {
                    sums[0].add(&SquaredErrors::of(&rows, TruePhase::Torque, main));
                    sums[1].add(&whole_shift(&rows, main));
                }
            }
        }
        for (all, sums) in all.iter_mut().flatten().zip(sums.iter().flatten()) {
            all.add(sums);
        }
        let [[phase, whole], [phase_without, whole_without]] = sums.map(|sums| sums.map(|sum| sum.rms_n_m()));
        println!("{kind:?} [filter, valve model]: torque phase {phase:.2?}, without pistons {phase_without:.2?}");
        println!("  whole shift {whole:.2?}, without pistons {whole_without:.2?}");
    }
    let [[phase, whole], [phase_without, whole_without]] = all.map(|sums| sums.map(|sum| sum.rms_n_m()));
    println!("all: torque phase {phase:.2?}, {phase_without:.2?}; whole shift {whole:.2?}, {whole_without:.2?}");
    assert!(phase_without[0] > phase_without[1], "it is what the matrix would show: {phase_without:?}");
    assert!(phase[0] < phase_without[0] && whole[0] < whole_without[0]);
    assert!(whole[0] < whole[1] && whole[0] < whole_without[1]);
}

/// Errors of the kiss points of all elements, by the valve model's pressure, that are left with what is learnt; and without, Pa.
fn kiss_errors_pa(known: &Car, truth: &Car, draw: &ShiftDraw, learnt: &Learnt<f64>) -> [f64; 2] {
    let tables = tables_with_inertia(known, 1.0).unwrap();
    let (sensors, mut sums) = (sensors(), [0.0; 2]);
    let filter = filter(known, &tables, &sensors);
    for (element, clutches) in known.clutches.iter().zip(&truth.clutches).enumerate() {
        let (Some(place), (Some(known), Some(truth))) = (tables.place(element), clutches) else { continue };
        let kiss_pa = |clutch: &ShiftClutch| clutch.clutch.kiss_pressure();
        let error_pa = kiss_pa(truth) / draw.valve_gain[element] - kiss_pa(known);
        let found_pa = filter.learnt_element(learnt, place).unwrap().kiss_pa[0];
        sums[0] += (error_pa - found_pa).powi(2);
        sums[1] += error_pa.powi(2);
    }
    sums
}

/// A fill that ends early or late is not learnt as another kiss point: what is learnt of it is nearer to the truth than nothing.
#[test]
fn kiss_points_are_learnt_in_cars_with_strokes() {
    let car = cars_with_strokes().remove(0);
    assert!(ShiftTables::of_car(&car, &ErrorBudget::of_car(&car)).unwrap().tables().elements[0].piston.is_some());
    let (mut sums, mut kiss) = ([Errors::default(), Errors::default()], [0.0; 2]);
    for seed in 1..=2 * super::learning::draws() {
        let mut random = Random(seed * 77);
        let draw = ShiftDraw::within(&car, &ErrorBudget::of_car(&car), || random.uniform());
        let draw = draw.with_strokes(&car, || random.uniform());
        let truth = draw.car(&car);
        let drive = Drive::of(&car, &truth, seed);
        sums[0].add(&drive.after(0, 1.0, seed).1);
        let (learnt, errors) = drive.after(SHIFTS, 1.0, seed);
        sums[1].add(&errors);
        let of_car = kiss_errors_pa(&car, &truth, &draw, &learnt);
        println!("car {seed}: kiss points {:.1} of {:.1} kPa", of_car[0].sqrt() / 1e3, of_car[1].sqrt() / 1e3);
        kiss = [kiss[0] + of_car[0], kiss[1] + of_car[1]];
    }
    println!("unlearnt {}\n  after {SHIFTS} shifts {}", sums[0].show(), sums[1].show());
    let [before, learnt] = sums.map(|sum| sum.all()[0]);
    assert!(learnt < before, "{learnt} {before}");
    assert!(kiss[0] < kiss[1], "{kiss:?}");
}
