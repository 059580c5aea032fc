//! A wheel speed that is not what the filter takes it to be: of another scale, as with a worn tyre, or later than is said.

use config::{Car, Sensors};
use design::{ShiftErrors, ShiftTables, any_shift_filter};
use observer::any_shift::ShiftInput;
use plant::car::{CarModel, CarShift};
use study::any_shift::drive::DriveScorer;
use study::any_shift::matrix::{
    ErrorsByPhase, MatrixCounts, MatrixRow, Pooled, counts, drawn_car, errors_by_phase, neighbouring_shifts,
};
use study::any_shift::recording::Recording;
use study::any_shift::tour::drive_tour;
use study::any_shift::{inputs, score_samples, simulated};

use crate::PHASES;
use crate::cars::{cars, sensors};

const ERRORS: ShiftErrors = ShiftErrors::STANDARD;

/// The wheel speed that the filter is given.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Wheel {
    /// None.
    Absent,
    /// Its scale, and by how much it is later than the filter is told, s.
    Wrong { scale: f64, late_s: f64 },
}

const fn scaled(scale: f64) -> Wheel {
    Wheel::Wrong { scale, late_s: 0.0 }
}

const fn late(late_s: f64) -> Wheel {
    Wheel::Wrong { scale: 1.0, late_s }
}

const ALL: [(&str, Wheel); 11] = [
    ("as it is", scaled(1.0)),
    ("none", Wheel::Absent),
    ("-2 %", scaled(0.98)),
    ("-1 %", scaled(0.99)),
    ("-0.3 %", scaled(0.997)),
    ("+0.3 %", scaled(1.003)),
    ("+1 %", scaled(1.01)),
    ("+2 %", scaled(1.02)),
    ("15 ms late", late(0.015)),
    ("30 ms late", late(0.03)),
    ("+2 %, 30 ms late", Wheel::Wrong { scale: 1.02, late_s: 0.03 }),
];

impl Wheel {
    fn sensors(self) -> Sensors {
        let mut sensors = sensors();
        if let Self::Wrong { scale, late_s } = self {
            sensors.wheel.errors.scale = scale;
            sensors.wheel.delay_s += late_s;
        }
        sensors
    }

    fn tell(self, input: &mut ShiftInput<f64>) {
        if self == Self::Absent {
            input.wheel_rad_s = None;
        }
    }
}

/// How many cars make each shift, of all gearboxes; else one, of the first.
fn draws() -> Option<u64> {
    std::env::var("WHEEL_DRAWS").ok().map(|draws| draws.parse().unwrap())
}

/// All shifts of a car, each in a log of its own: a column for each wheel speed.
fn short_logs(known: &Car, draws: u64) -> Vec<Vec<MatrixRow>> {
    let tables = ShiftTables::of_car(known, &ERRORS).unwrap();
    let filter = any_shift_filter(known, &tables, &ERRORS, Some(&sensors()));
    let mut columns = vec![Vec::new(); ALL.len()];
    for shift in neighbouring_shifts(known, &tables).0 {
        let usual = CarShift::usual(known, shift.from, shift.to, shift.throttle());
        let row = MatrixRow { shift, errors: ErrorsByPhase::default(), counts: MatrixCounts::default(), failure: None };
        let mut sums = vec![row; ALL.len()];
        for draw in 1..=draws {
            let truth = drawn_car(known, shift.from, shift.to, draw);
            let samples = simulated(known, &truth, &usual).unwrap();
            for (sum, (_, wheel)) in sums.iter_mut().zip(ALL) {
                let mut inputs = inputs(known, &tables, &samples, &wheel.sensors(), shift.noise(draw));
                inputs.iter_mut().for_each(|(_, input)| wheel.tell(input));
                let rows = score_samples(&tables, &filter, &samples, &inputs);
                let errors = errors_by_phase(&rows, shift.kind);
                sum.counts.add(&counts(&rows, &errors));
                sum.errors.iter_mut().flatten().zip(errors.iter().flatten()).for_each(|(sum, more)| sum.add(more));
            }
        }
        columns.iter_mut().zip(sums).for_each(|(column, sum)| column.push(sum));
    }
    columns
}

/// A drive through all gears of a car, with one filter for the whole drive.
fn driven(known: &Car, seed: u64) -> Vec<Vec<MatrixRow>> {
    let tables = ShiftTables::of_car(known, &ERRORS).unwrap();
    let filter = any_shift_filter(known, &tables, &ERRORS, Some(&sensors()));
    let model = CarModel::new(drawn_car(known, 0, 0, seed)).unwrap();
    let mut recording = Recording::default();
    drive_tour(&model, known, |sample| recording.push(sample), || ()).unwrap();
    let drive = |(_, wheel): (&str, Wheel)| {
        let mut scorer = DriveScorer::new(known, &model, &tables, &filter);
        let sensors = wheel.sensors();
        let inputs = recording.inputs(known, &tables, &sensors, seed);
        for (sample, mut input) in recording.samples.iter().zip(inputs) {
            wheel.tell(&mut input);
            scorer.push(sample, &input);
        }
        scorer.finish().matrix(known).rows
    };
    ALL.into_iter().map(drive).collect()
}

/// Errors of the controlling clutch in a phase, N m: by the filter, and by the valve model alone.
fn error_n_m(rows: &[MatrixRow], phase: usize) -> [f64; 2] {
    Pooled::of(rows, |_| true).torque[phase][0].rms_n_m()
}

fn print(columns: &[Vec<MatrixRow>]) {
    for (rows, (name, _)) in columns.iter().zip(ALL) {
        let of = |phase: usize| {
            let [estimate, open_loop] = error_n_m(rows, phase);
            format!("{} {:.3} ({estimate:.2}/{open_loop:.2})", PHASES[phase], estimate / open_loop)
        };
        let MatrixCounts { above, compared, outside, values, slips_said, .. } = Pooled::of(rows, |_| true).counts;
        println!(
            "{name:18} {}  {}  above by 1 N m {above} of {compared}, outside {outside} of {values}, slips {slips_said}",
            of(0),
            of(1)
        );
    }
}

/// The numbers of the documentation: `WHEEL_DRAWS=3 cargo test --release -p study --test any_shift wheel:: -- --nocapture`.
#[test]
fn a_wrong_wheel_speed_in_a_short_log() {
    let (cars, draws) = (cars(), draws());
    let mut columns = vec![Vec::new(); ALL.len()];
    for car in &cars[..if draws.is_some() { cars.len() } else { 1 }] {
        columns.iter_mut().zip(short_logs(car, draws.unwrap_or(1))).for_each(|(all, more)| all.extend(more));
    }
    println!("one shift in each log:");
    print(&columns);
}

/// The same for a drive through all gears of the first car.
#[test]
fn a_wrong_wheel_speed_in_a_drive() {
    let car = &cars()[0];
    let mut columns = vec![Vec::new(); ALL.len()];
    for seed in 1..=draws().unwrap_or(1) {
        columns.iter_mut().zip(driven(car, seed)).for_each(|(all, more)| all.extend(more));
    }
    println!("one drive through all gears:");
    print(&columns);
}
