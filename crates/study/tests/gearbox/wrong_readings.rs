//! One reading of a speed that is wrong, by a little or by much.

use car::{Car, ErrorBudget};
use observer::gearbox::ShiftInput;
use observer::{ShiftTables, gearbox_filter};
use plant::car::CarShift;
use study::gearbox::matrix::{drawn_car, neighbouring_shifts};
use study::gearbox::{inputs, score_samples, simulated};

use super::cars::{cars, sensors};

/// Errors of the readings, rad/s.
const SIZES_RAD_S: [f64; 6] = [0.2, 0.6, 1.2, 2.0, 5.0, 20.0];

/// Adds to the reading of turbine or output in a row.
fn wrong(inputs: &[(usize, ShiftInput<f64>)], is_output: bool, size: f64, row: usize) -> Vec<(usize, ShiftInput<f64>)> {
    let mut inputs = inputs.to_vec();
    let input = &mut inputs[row].1;
    let reading = if is_output { &mut input.output_rad_s } else { &mut input.turbine_rad_s };
    reading.iter_mut().for_each(|reading| reading.value += size);
    inputs
}

/// Of all neighbouring shifts of a car: how often a wrong reading makes the torque error of a clutch larger by a third and by 1 N m, of how many, and the
/// largest error over that without, N m.
fn harm(known: &Car) -> (usize, usize, [f64; 2]) {
    let sensors = sensors();
    let budget = ErrorBudget::of_car(known).read_by(known, Some(&sensors));
    let tables = ShiftTables::of_car(known, &budget).unwrap();
    let filter = gearbox_filter(known, &tables, &budget, Some(&sensors));
    let (mut larger, mut cases, mut worst) = (0, 0, [0.0; 2]);
    for shift in neighbouring_shifts(known, &tables).0 {
        let truth = drawn_car(known, shift.from, shift.to, 1);
        let usual = CarShift::usual(known, shift.from, shift.to, shift.throttle());
        let samples = simulated(known, &truth, &usual).unwrap();
        let right = inputs(known, &tables, &samples, &sensors, shift.noise(1));
        let errors = |inputs: &[(usize, ShiftInput<f64>)]| {
            let rows = score_samples(&tables, &filter, &samples, inputs);
            [0, 1].map(|clutch| {
                let squares = rows.iter().map(|row| &row.clutches[clutch]).filter(|of| of.torque_n_m[0].is_finite());
                let squares: Vec<f64> = squares.map(|of| (of.torque_n_m[1] - of.torque_n_m[0]).powi(2)).collect();
                (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
            })
        };
        let clean = errors(&right);
        let begins = right.iter().position(|(_, input)| !input.gear.is_steady()).unwrap();
        let ends = right.iter().rposition(|(_, input)| !input.gear.is_steady()).unwrap();
        for row in (begins + 2..ends).step_by(11) {
            for (n, size) in SIZES_RAD_S.into_iter().enumerate() {
                let size = if (row + n) % 2 == 0 { size } else { -size };
                for is_output in [false, true] {
                    let found = errors(&wrong(&right, is_output, size, row));
                    for (found, clean) in found.into_iter().zip(clean) {
                        cases += 1;
                        larger += usize::from(found > clean * 4.0 / 3.0 && found > clean + 1.0);
                        if found - clean > worst[0] - worst[1] {
                            worst = [found, clean];
                        }
                    }
                }
            }
        }
    }
    (larger, cases, worst)
}

#[test]
fn one_wrong_reading_changes_little() {
    let (larger, cases, [found, clean]) = harm(&cars()[0]);
    println!(
        "{larger} of {cases} errors are larger by a third and 1 N m; at worst {found:.1} in place of {clean:.1} N m"
    );
    assert!(larger * 40 < cases, "{larger} of {cases}");
    assert!(found < 40.0, "{found} N m");
}
