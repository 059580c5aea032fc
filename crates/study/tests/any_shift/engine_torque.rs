//! The torque that the engine's controller reports, beside the maps of an open converter.

use config::Car;
use design::{ShiftErrors, ShiftTables, any_shift_filter};
use drivetrain::ShiftKind;
use observer::Reading;
use observer::any_shift::ShiftInput;
use plant::car::{CarSample, CarShift};
use study::any_shift::matrix::{
    CLASSES, ErrorsByPhase, MatrixCounts, MatrixRow, MatrixShift, Pooled, class, counts, drawn_car, errors_by_phase,
    neighbouring_shifts,
};
use study::any_shift::recording::reported_engine_n_m;
use study::any_shift::{RECORD_S, inputs, score_samples, simulated};

use crate::PHASES;
use crate::cars::{Random, cars, sensors};

/// Where the filter has the torque at the gearbox input from.
#[derive(Debug, Clone, Copy, PartialEq)]
enum With {
    /// The converter's maps.
    Maps,
    /// These and the reported torque at each moment, which comes so late, s.
    Fused(f64),
    /// The maps with a capacity that was found before, in steady driving, from maps and reported torque by their bounds.
    Calibrated,
    /// The true converter, known within 5 %.
    Exact,
}

const ALL: [(With, &str); 5] = [
    (With::Maps, "maps"),
    (With::Fused(0.0), "fused"),
    (With::Fused(0.03), "late"),
    (With::Calibrated, "calib"),
    (With::Exact, "exact"),
];

/// The runs of one shift, a row for each source.
fn runs(known: &Car, shift: MatrixShift, draws: u64) -> Vec<MatrixRow> {
    let row = MatrixRow { shift, errors: ErrorsByPhase::default(), counts: MatrixCounts::default(), failure: None };
    let mut sums = vec![row; ALL.len()];
    let usual = CarShift::usual(known, shift.from, shift.to, shift.throttle());
    let errors = ShiftErrors::STANDARD;
    for draw in 1..=draws {
        let truth = drawn_car(known, shift.from, shift.to, draw);
        let samples = simulated(known, &truth, &usual).unwrap();
        let mut random = Random(shift.noise(draw));
        let reported = 1.0 + errors.engine * (2.0 * random.uniform() - 1.0);
        let capacity = |car: &Car| car.converter.as_ref().unwrap().capacity_n_m_s2.range().1;
        let true_factor = capacity(&truth) / capacity(known);
        for (sum, (with, _)) in sums.iter_mut().zip(ALL) {
            let (mut car, mut errors) = (known.clone(), errors);
            if with == With::Calibrated {
                let (c, r) = (errors.converter.powi(2), errors.engine.powi(2));
                let factor = 1.0 + (true_factor * reported - 1.0) * c / (c + r);
                errors.converter = (c * r / (c + r)).sqrt();
                let converter = car.converter.as_mut().unwrap();
                converter.capacity_n_m_s2 = converter.capacity_n_m_s2.scaled(factor);
            }
            if with == With::Exact {
                errors.converter = 0.05;
                car.converter = truth.converter;
            }
            let tables = ShiftTables::of_car(&car, &errors).unwrap();
            let filter = any_shift_filter(&car, &tables, &errors, Some(&sensors()));
            let mut inputs = inputs(known, &tables, &samples, &sensors(), shift.noise(draw));
            if let With::Fused(late_s) = with {
                let tell = |(at, input): &mut (usize, ShiftInput<f64>)| {
                    let sample: &CarSample = &samples[at.saturating_sub((late_s / RECORD_S) as usize)];
                    input.engine_n_m = Some(Reading::now(reported * reported_engine_n_m(&truth, sample)));
                };
                inputs.iter_mut().for_each(tell);
            }
            let rows = score_samples(&tables, &filter, &samples, &inputs);
            let errors = errors_by_phase(&rows, shift.kind);
            sum.counts.add(&counts(&rows, &errors));
            sum.errors.iter_mut().flatten().zip(errors.iter().flatten()).for_each(|(sum, more)| sum.add(more));
        }
    }
    sums
}

/// The numbers of the documentation: `LIMITS_DRAWS=10 cargo test --release -p study --test any_shift engine_torque -- --nocapture`.
#[test]
fn reported_engine_torque_beside_an_open_converter() {
    let draws = std::env::var("LIMITS_DRAWS").map_or(1_u64, |draws| draws.parse().unwrap());
    let mut columns = vec![Vec::new(); ALL.len()];
    for car in cars().iter().filter(|car| car.converter.is_some()) {
        let tables = ShiftTables::of_car(car, &ShiftErrors::STANDARD).unwrap();
        for shift in neighbouring_shifts(car, &tables).0 {
            columns.iter_mut().zip(runs(car, shift, draws)).for_each(|(column, row)| column.push(row));
        }
    }
    println!("{:32}{}", "", ALL.map(|(_, name)| format!("{name:>9}")).concat());
    let line = |name: String, of: &dyn Fn(&Vec<MatrixRow>) -> f64| {
        println!("{name:32}{}", columns.iter().map(|rows| format!("{:9.3}", of(rows))).collect::<String>());
    };
    for kind in ShiftKind::ALL {
        for (p, phase) in PHASES.iter().enumerate() {
            for at in 0..CLASSES.len() {
                let of = |shift: &MatrixShift| shift.kind == kind && class(shift.gain) == at;
                line(format!("{kind:?} {phase} class {at}"), &|rows| {
                    Pooled::of(rows, of).torque[p][0].ratio().unwrap_or(f64::NAN)
                });
            }
            line(format!("{kind:?} {phase} N m"), &|rows| {
                Pooled::of(rows, |shift| shift.kind == kind).torque[p][0].rms_n_m()[0]
            });
        }
    }
    for (p, phase) in PHASES.iter().enumerate() {
        line(format!("{phase} N m"), &|rows| Pooled::of(rows, |_| true).torque[p][0].rms_n_m()[0]);
    }
    line("above by 1 N m, %".to_owned(), &|rows| {
        let MatrixCounts { above, compared, .. } = Pooled::of(rows, |_| true).counts;
        100.0 * above as f64 / compared as f64
    });
    let inertia = |at: usize| Pooled::of(&columns[at], |_| true).torque[1][0].rms_n_m()[0];
    assert!(inertia(3) < inertia(0), "{} {}", inertia(3), inertia(0));
}
