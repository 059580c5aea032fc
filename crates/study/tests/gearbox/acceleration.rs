//! A longitudinal accelerometer: what it brings, and what one that is wrong costs.

use car::{AccelerationSensor, ErrorBudget, ReadingErrors};
use car::{Car, Drive, Sensors};
use config::{DriveFile, Source};
use drivetrain::ShiftKind;
use observer::gearbox::ShiftInput;
use observer::{ChannelHealth, Reading};
use observer::{ShiftTables, gearbox_filter};
use plant::car::{CarCalibration, CarModel, CarShift, simulate_car_drive};
use study::gearbox::drive::DriveScorer;
use study::gearbox::matrix::{
    ErrorsByPhase, Matrix, MatrixCounts, MatrixRow, Pooled, counts, drawn_car, errors_by_phase, neighbouring_shifts,
};
use study::gearbox::recording::Recording;
use study::gearbox::tour::drive_tour;
use study::gearbox::{inputs, score_samples, simulated};

use super::PHASES;
use super::cars::{cars, sensors};

/// The accelerometer of a car.
#[derive(Debug, Clone, Copy)]
struct Accelerometer {
    name: &'static str,
    sensor: Option<AccelerationSensor>,
    /// Its delay as the filter is given it, s.
    delay_s: f64,
    /// Changes a reading at a time since the start of the log, s; what is no number does not come.
    change: fn(f64, f64) -> f64,
}

const SENSOR: AccelerationSensor = AccelerationSensor { bias_m_s2: 0.3, ..AccelerationSensor::USUAL };
const LATE: AccelerationSensor = AccelerationSensor { delay_s: 0.02, ..SENSOR };

const fn with(name: &'static str, sensor: AccelerationSensor) -> Accelerometer {
    Accelerometer { name, sensor: Some(sensor), delay_s: 0.0, change: |value, _| value }
}

const fn changed(name: &'static str, change: fn(f64, f64) -> f64) -> Accelerometer {
    Accelerometer { change, ..with(name, SENSOR) }
}

/// A mass that is not that of the file shows as a scale.
const fn scaled(scale: f64) -> AccelerationSensor {
    AccelerationSensor { errors: ReadingErrors { scale, ..ReadingErrors::NONE }, ..SENSOR }
}

/// What is wrong with a sensor, and by how much it may be worse than none where it is not stated: in the torque phase and in the inertia phase.
const ALL: [(Accelerometer, [f64; 2]); 17] = [
    (Accelerometer { sensor: None, ..with("none", SENSOR) }, [1.0, 1.0]),
    (with("as it is", SENSOR), [0.9, 1.03]),
    (with("bias -1.5 m/s^2", AccelerationSensor { bias_m_s2: -1.5, ..SENSOR }), [0.9, 1.05]),
    (with("noise 0.2 m/s^2", AccelerationSensor { noise_m_s2: 0.2, ..SENSOR }), [0.95, 1.03]),
    (with("noise 0.5 m/s^2", AccelerationSensor { noise_m_s2: 0.5, ..SENSOR }), [1.0, 1.03]),
    (with("20 ms late", LATE), [0.85, 1.05]),
    (Accelerometer { delay_s: LATE.delay_s, ..with("20 ms late, stated", LATE) }, [0.85, 1.05]),
    (with("50 ms late", AccelerationSensor { delay_s: 0.05, ..SENSOR }), [0.95, 1.2]),
    (with("100 ms late", AccelerationSensor { delay_s: 0.1, ..SENSOR }), [1.4, 1.5]),
    (with("every 40 ms", AccelerationSensor { sample_time_s: 0.04, ..SENSOR }), [0.95, 1.03]),
    (with("steps of 0.1 m/s^2", AccelerationSensor { resolution_m_s2: 0.1, ..SENSOR }), [0.95, 1.03]),
    (with("car 20 % heavier", scaled(0.83)), [0.9, 1.1]),
    (with("car 20 % lighter", scaled(1.25)), [1.0, 1.03]),
    (
        changed("an outlier each 0.2 s", |value, time_s| if time_s % 0.2 < 0.009 { value + 2.0 } else { value }),
        [0.9, 1.03],
    ),
    (changed("lost 0.3 of each s", |value, time_s| if time_s % 1.0 > 0.3 { value } else { f64::NAN }), [0.95, 1.03]),
    (changed("other sign", |value, _| -value), [1.0, 1.0]),
    (changed("in g", |value, _| value / 9.81), [1.0, 1.0]),
];

impl Accelerometer {
    fn sensors(&self) -> Sensors {
        Sensors { acceleration: self.sensor, ..sensors() }
    }

    /// What the filter knows: a usual sensor, or nothing of it.
    fn stated(&self, is_stated: bool) -> Sensors {
        let sensor = AccelerationSensor { delay_s: self.delay_s, ..AccelerationSensor::USUAL };
        Sensors { acceleration: Some(sensor).filter(|_| is_stated), ..sensors() }
    }

    fn read(&self, time_s: f64, input: &mut ShiftInput<f64>) {
        let change = |reading: Reading<f64>| Reading { value: (self.change)(reading.value, time_s), ..reading };
        input.acceleration_m_s2 = input.acceleration_m_s2.map(change).filter(|reading| !reading.value.is_nan());
    }
}

/// How many cars make each shift or drive.
fn draws(usual: u64) -> u64 {
    std::env::var("ACCELERATION_DRAWS").map_or(usual, |draws| draws.parse().unwrap())
}

/// All shifts of a car, each in a log of its own: a column for each accelerometer.
fn short_logs(known: &Car, draws: u64, is_stated: bool) -> Vec<Vec<MatrixRow>> {
    let budget = ErrorBudget::of_car(known);
    let tables = ShiftTables::of_car(known, &budget).unwrap();
    let mut columns = vec![Vec::new(); ALL.len()];
    for shift in neighbouring_shifts(known, &tables).0 {
        let usual = CarShift::usual(known, shift.from, shift.to, shift.throttle());
        let row = MatrixRow { shift, errors: ErrorsByPhase::default(), counts: MatrixCounts::default(), failure: None };
        let mut sums = vec![row; ALL.len()];
        for draw in 1..=draws {
            let truth = drawn_car(known, shift.from, shift.to, draw);
            let samples = simulated(known, &truth, &usual).unwrap();
            for (sum, (accelerometer, _)) in sums.iter_mut().zip(ALL) {
                let filter = gearbox_filter(known, &tables, &budget, Some(&accelerometer.stated(is_stated)));
                let mut inputs = inputs(known, &tables, &samples, &accelerometer.sensors(), shift.noise(draw));
                inputs.iter_mut().for_each(|(at, input)| accelerometer.read(0.001 * *at as f64, input));
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

/// A drive through all gears of a car.
fn tour(known: &Car, seed: u64) -> (CarModel, Recording) {
    let model = CarModel::new(drawn_car(known, 0, 0, seed)).unwrap();
    let mut recording = Recording::default();
    drive_tour(&model, known, |sample| recording.push(sample), || ()).unwrap();
    (model, recording)
}

/// A drive in town, with brakes and grades.
fn town(known: &Car, seed: u64) -> (CarModel, Recording) {
    let source = Source::built_in("city.toml", include_str!("../../../../drives/city.toml"));
    let drive = DriveFile::from_source(source).unwrap().drive;
    let model = CarModel::new(drawn_car(known, 0, 0, seed)).unwrap();
    let mut recording = Recording::default();
    let drive = Drive { sample_time_s: 0.001, repetitions: 1, ..drive };
    simulate_car_drive(&model, known, CarCalibration::STANDARD, &drive, |sample| recording.push(sample)).unwrap();
    (model, recording)
}

/// A drive of a car, with one filter for the whole drive.
fn driven(known: &Car, (model, recording): &(CarModel, Recording), seed: u64, is_stated: bool) -> Vec<Vec<MatrixRow>> {
    let budget = ErrorBudget::of_car(known);
    let tables = ShiftTables::of_car(known, &budget).unwrap();
    let drive = |(accelerometer, _): (Accelerometer, [f64; 2])| {
        let filter = gearbox_filter(known, &tables, &budget, Some(&accelerometer.stated(is_stated)));
        let mut scorer = DriveScorer::new(known, model, &tables, &filter);
        let sensors = accelerometer.sensors();
        let inputs = recording.inputs(known, &tables, &sensors, seed);
        for (sample, mut input) in recording.samples.iter().zip(inputs) {
            accelerometer.read(sample.time_s, &mut input);
            scorer.push(sample, &input);
        }
        Matrix::of_drive(&scorer.finish(), known).rows
    };
    ALL.into_iter().map(drive).collect()
}

/// Ratio of the errors of the controlling clutch in a phase to those of the valve model.
fn ratio(rows: &[MatrixRow], kind: Option<ShiftKind>, phase: usize) -> f64 {
    Pooled::of(rows, |shift| kind.is_none_or(|kind| shift.kind == kind)).torque[phase][0].ratio().unwrap_or(f64::NAN)
}

fn print(title: &str, columns: &[Vec<MatrixRow>]) {
    println!("{title}:");
    for (rows, (accelerometer, _)) in columns.iter().zip(ALL) {
        let of = |kind: Option<ShiftKind>| [0, 1].map(|phase| format!("{:.3}", ratio(rows, kind, phase))).join(" ");
        let MatrixCounts { above, compared, .. } = Pooled::of(rows, |_| true).counts;
        println!(
            "  {:22} {} (torque and inertia phase), power-on upshift {}, coast downshift {}; above by 1 N m {above} of {compared}",
            accelerometer.name,
            of(None),
            of(Some(ShiftKind::PowerOnUp)),
            of(Some(ShiftKind::CoastDown)),
        );
    }
}

/// Whatever the accelerometer reads, the guaranteed ranges hold: they do not rest on it.
fn are_in_range(columns: &[Vec<MatrixRow>]) {
    let counts = columns.iter().map(|rows| Pooled::of(rows, |_| true).counts);
    assert!(counts.into_iter().all(|counts| counts.outside == 0), "guaranteed");
}

/// A sensor that is stated, in all gearboxes.
#[test]
fn an_accelerometer_in_a_short_log() {
    let mut columns = vec![Vec::new(); ALL.len()];
    for car in &cars() {
        columns.iter_mut().zip(short_logs(car, draws(1), true)).for_each(|(all, more)| all.extend(more));
    }
    print("one shift in each log, stated", &columns);
    are_in_range(&columns);
    let up = |at: usize, phase: usize| ratio(&columns[at], Some(ShiftKind::PowerOnUp), phase);
    assert!(up(1, 0) < 0.9 * up(0, 0) && up(1, 1) < 1.02 * up(0, 1), "power-on upshift");
    assert!(up(6, 0) < 0.92 * up(0, 0) && up(6, 1) < 1.02 * up(0, 1), "20 ms late, stated");
    let all = |at: usize, phase: usize| ratio(&columns[at], None, phase);
    assert!(all(1, 0) < all(0, 0) && all(1, 1) < 1.02 * all(0, 1), "all kinds");
}

/// In a log of one shift nothing has shown that a sensor is one: unless it is stated, it is not used.
#[test]
fn without_a_statement_a_short_log_is_as_without_a_sensor() {
    let columns = short_logs(&cars()[0], 1, false);
    assert!(columns.iter().all(|rows| *rows == columns[0]));
}

/// A sensor that is not stated, over a drive with brakes and grades.
#[test]
fn an_accelerometer_in_town() {
    drives(("town", town), (&[false], 3), |columns| {
        for (rows, (Accelerometer { name, .. }, at_most)) in columns.iter().zip(ALL) {
            for (phase, maximum) in at_most.into_iter().enumerate() {
                let [found, none] = [rows, &columns[0]].map(|rows| ratio(rows, None, phase));
                assert!(found <= maximum * none + 1e-12, "{name}, {} phase: {found} {none}", PHASES[phase]);
            }
            let [coast, none] = [rows, &columns[0]].map(|rows| ratio(rows, Some(ShiftKind::CoastDown), 0));
            assert!(coast <= at_most[0].max(1.1) * none, "{name}: {coast} {none}");
        }
    });
}

/// The same in a drive through all gears without brakes.
#[test]
fn an_accelerometer_in_a_drive() {
    drives(("all gears", tour), (&[true, false], 1), |_| ());
}

/// A drive of a car with this seed.
type Drives = fn(&Car, u64) -> (CarModel, Recording);

/// As many drives of the first car, with a sensor that is stated or not; what `check` is given of each.
fn drives((title, drive): (&str, Drives), (stated, usual): (&[bool], u64), check: impl Fn(&[Vec<MatrixRow>])) {
    let known = &cars()[0];
    let drives: Vec<_> = (1..=draws(usual)).map(|seed| (drive(known, seed), seed)).collect();
    for &is_stated in stated {
        let mut columns = vec![Vec::new(); ALL.len()];
        for (drive, seed) in &drives {
            columns.iter_mut().zip(driven(known, drive, *seed, is_stated)).for_each(|(all, more)| all.extend(more));
        }
        print(&format!("{title}, {}", if is_stated { "stated" } else { "not stated" }), &columns);
        are_in_range(&columns);
        check(&columns);
    }
}

/// What the filter has learnt of the delay of the sensor over a drive in town, s.
fn late_s(known: &Car, (_, recording): &(CarModel, Recording), accelerometer: &Accelerometer) -> Option<f64> {
    let budget = ErrorBudget::of_car(known);
    let tables = ShiftTables::of_car(known, &budget).unwrap();
    let filter = gearbox_filter(known, &tables, &budget, Some(&accelerometer.stated(false)));
    let mut state = filter.start();
    let sensors = accelerometer.sensors();
    let inputs = recording.inputs(known, &tables, &sensors, 1);
    for (sample, mut input) in recording.samples.iter().zip(inputs) {
        accelerometer.read(sample.time_s, &mut input);
        filter.step(&mut state, &input);
    }
    state.acceleration_late_s().map(|[late_s, _]| late_s)
}

/// The filter follows late readings: what it finds of a delay is a lower limit.
#[test]
fn the_delay_of_the_sensor_is_found_in_part() {
    let known = &cars()[0];
    let drive = town(known, 1);
    let of = |name: &str| late_s(known, &drive, &ALL.iter().find(|(of, _)| of.name == name).unwrap().0);
    assert!(of("as it is").is_some_and(|late_s| late_s.abs() < 0.005));
    assert!(of("20 ms late").is_some_and(|late_s| (0.008..0.022).contains(&late_s)));
    assert_eq!([of("none"), of("other sign")], [None; 2]);
}

/// A sensor that stands is refused after a second, whatever it reads, and one that gives no number or the weight of the car in each row.
#[test]
fn a_dead_sensor_is_refused() {
    let known = &cars()[0];
    let (_, recording) = town(known, 1);
    let budget = ErrorBudget::of_car(known);
    let tables = ShiftTables::of_car(known, &budget).unwrap();
    let filter = gearbox_filter(known, &tables, &budget, Some(&ALL[1].0.stated(true)));
    let inputs: Vec<_> = recording.inputs(known, &tables, &ALL[0].0.sensors(), 1).collect();
    for value in [0.0, 0.7, -9.81, f64::NAN, 1e300, -16.0] {
        let (mut state, mut without) = (filter.start(), filter.start());
        for (at, input) in inputs.iter().enumerate() {
            let given = ShiftInput { acceleration_m_s2: Some(Reading::now(value)), ..*input };
            let estimate = filter.step(&mut state, &given);
            let other = filter.step(&mut without, input);
            let health = estimate.channels.acceleration;
            assert!(health == ChannelHealth::Refused || at <= 110, "{value} in row {at}: {health:?}");
            assert_eq!(other.channels.acceleration, ChannelHealth::Unused);
            if at > 1000 {
                let both = [&estimate, &other].map(|estimate| estimate.clutches.map(|of| of.map(|of| of.torque_n_m)));
                let [found, right] = both.map(|of| of.unwrap_or_default());
                assert!(found.iter().zip(&right).all(|(a, b)| (a - b).abs() < 1.0), "{value} in row {at}: {both:?}");
            }
        }
    }
}

#[test]
fn single_precision_gives_the_same_estimates() {
    let known = &cars()[0];
    let (_, recording) = town(known, 1);
    let budget = ErrorBudget::of_car(known);
    let tables = ShiftTables::of_car(known, &budget).unwrap();
    let filter = gearbox_filter(known, &tables, &budget, Some(&ALL[6].0.stated(true)));
    let single_tables = tables.cast::<f32>();
    let single = filter.cast(single_tables.tables());
    let (mut state, mut single_state) = (filter.start(), single.start());
    let mut worst = 0.0_f64;
    for input in recording.inputs(known, &tables, &ALL[6].0.sensors(), 1) {
        let estimate = filter.step(&mut state, &input);
        let rounded = single.step(&mut single_state, &input.cast());
        if let (Some(both), Some(single)) = (estimate.clutches, rounded.clutches) {
            for (a, b) in both.iter().zip(&single).filter(|(a, b)| a.holds == b.holds) {
                worst = worst.max((a.torque_n_m - f64::from(b.torque_n_m)).abs());
            }
        }
    }
    println!("single precision: {worst:.2} N m at worst");
    assert!(worst < 5.0, "{worst}");
}
