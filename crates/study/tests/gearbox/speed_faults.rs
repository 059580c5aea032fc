//! Speeds that fail in a shift: which wrong readings are believed, and which right ones are refused.

use car::{Car, ErrorBudget};
use logs::{LOOK_AHEAD_S, Quality, Role, SpeedReading, SpeedWatch};
use observer::gearbox::ShiftInput;
use observer::{Reading, ShiftTables};
use plant::car::{CarModel, CarShift};
use study::gearbox::matrix::{Random, drawn_car, neighbouring_shifts};
use study::gearbox::recording::Recording;
use study::gearbox::tour::drive_tour;
use study::gearbox::{inputs, simulated};

use super::cars::{cars, sensors};

const SPEEDS: [Role; 4] = [Role::EngineSpeed, Role::TurbineSpeed, Role::OutputSpeed, Role::WheelSpeed];

/// A wrong reading nearer to the right one is none, rad/s: what a sensor may err by.
const NEAR_RAD_S: f64 = 2.0;

/// Faster than any shaft, rad/s.
const BEYOND_RAD_S: f64 = 1500.0;

/// Two speeds that are further apart do not turn together, rad/s.
const APART_RAD_S: f64 = 8.0;

/// A sensor rightly reads zero while the output is slower than this, rad/s.
const CRAWLS_RAD_S: f64 = 10.0;

/// A turbine that was at zero then is believed until the output is so fast, rad/s.
const AWAKE_RAD_S: f64 = 30.0;

/// Jumps of the speeds, rad/s.
const OFF_RAD_S: [[f64; 3]; 4] =
    [[80.0, -100.0, 250.0], [80.0, -100.0, 250.0], [30.0, -60.0, 60.0], [15.0, -20.0, 40.0]];

/// The shift is requested once a sensor is known, s.
const REQUEST_S: f64 = 4.0;

/// The readings of the four speeds in a row, each with its time, s.
type Row = [Option<[f64; 2]>; 4];

/// What a channel gives while it fails.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Fault {
    Zero,
    Stuck,
    Shows(usize),
    /// The speed and so much more, rad/s.
    Off(f64),
    /// The other direction.
    Turned,
    /// A number that is no speed.
    Beyond,
    /// The speed times a factor, to which it drifts in half a second.
    Drifts(f64),
}

/// Wrong readings that were believed and all of them, and right ones that were refused and all of them.
#[derive(Debug, Clone, Copy, Default)]
struct Counts {
    believed: [u64; 2],
    refused: [u64; 2],
}

impl Counts {
    fn add(&mut self, other: &Self) {
        for (sum, count) in [(&mut self.believed, other.believed), (&mut self.refused, other.refused)] {
            *sum = [sum[0] + count[0], sum[1] + count[1]];
        }
    }
}

fn rows<'i>(inputs: impl Iterator<Item = &'i ShiftInput<f64>>) -> Vec<Row> {
    let mut time_s = 0.0;
    let row = |input: &ShiftInput<f64>| {
        time_s += input.dt_s;
        let readings = [input.engine_rad_s, input.turbine_rad_s, input.output_rad_s, input.wheel_rad_s];
        readings.map(|reading| reading.map(|Reading { value, age_s }| [value, time_s - age_s]))
    };
    inputs.map(row).collect()
}

/// The rows with a fault of a speed from one time to another, s.
fn failing(right: &[Row], at: usize, fault: Fault, [from_s, to_s]: [f64; 2]) -> Vec<Row> {
    let mut newest = 0.0;
    let mut shown = right.to_vec();
    for (row, right) in shown.iter_mut().zip(right) {
        let Some([value, time_s]) = &mut row[at] else { continue };
        if *time_s <= from_s || *time_s > to_s {
            newest = *value;
            continue;
        }
        *value = match fault {
            Fault::Zero => 0.0,
            Fault::Stuck => newest,
            Fault::Shows(other) => right[other].map_or(*value, |[other, _]| other),
            Fault::Off(rad_s) => *value + rad_s,
            Fault::Turned => -*value,
            Fault::Beyond => 6553.5,
            Fault::Drifts(factor) => *value * (1.0 + (factor - 1.0) * ((*time_s - from_s) / 0.5).min(1.0)),
        };
    }
    shown
}

/// Which readings are refused, at last.
fn refused(ratios: &[f64], rows: &[Row]) -> Vec<[bool; 4]> {
    let mut watch = SpeedWatch::of_gearbox(ratios);
    let mut all = vec![[false; 4]; rows.len()];
    for (n, row) in rows.iter().enumerate() {
        for (at, reading) in row.iter().enumerate() {
            let Some([value, time_s]) = *reading else { continue };
            let reading = SpeedReading { role: SPEEDS[at], value, time_s, may_be_held: false };
            let (quality, withdrawn) = watch.judge(reading);
            all[n][at] = matches!(quality, Quality::Impossible | Quality::Frozen);
            for withdrawn in withdrawn.into_iter().flatten() {
                let of = withdrawn.role as usize;
                for (refused, row) in all.iter_mut().zip(rows).take(n + 1).rev() {
                    match row[of] {
                        Some([_, then_s]) if then_s > withdrawn.after_s && time_s - then_s <= LOOK_AHEAD_S => {
                            refused[of] = true;
                        }
                        Some([_, then_s]) if time_s - then_s > LOOK_AHEAD_S => break,
                        _ => {}
                    }
                }
            }
        }
    }
    all
}

fn count(ratios: &[f64], right: &[Row], shown: &[Row], at: usize) -> Counts {
    let mut counts = Counts::default();
    let mut stands = false;
    for ((right, shown), refused) in right.iter().zip(shown).zip(refused(ratios, shown)) {
        let output_rad_s = right[2].map_or(0.0, |[output, _]| output.abs());
        let is_zero = at == 1 && shown[1] != right[1] && shown[1].is_some_and(|[turbine, _]| turbine == 0.0);
        stands = is_zero && output_rad_s < if stands { AWAKE_RAD_S } else { CRAWLS_RAD_S };
        let crawls = stands || output_rad_s < CRAWLS_RAD_S;
        for speed in 0..4 {
            let (Some([right, _]), Some([value, _])) = (right[speed], shown[speed]) else { continue };
            if value.abs() > BEYOND_RAD_S {
                // Refused by its size.
                continue;
            }
            if speed == at && (value - right).abs() > NEAR_RAD_S {
                if crawls {
                    continue;
                }
                counts.believed[0] += u64::from(!refused[speed]);
                counts.believed[1] += 1;
            } else if value == right {
                counts.refused[0] += u64::from(refused[speed]);
                counts.refused[1] += 1;
            }
        }
    }
    counts
}

/// Of every neighbouring shift of a car, each speed with each fault of each length at random times: those that begin between two speeds that are
/// apart, and the others.
fn of_car(known: &Car) -> Vec<(usize, Fault, [Counts; 2])> {
    let sensors = sensors();
    let budget = ErrorBudget::of_car(known).read_by(known, Some(&sensors));
    let tables = ShiftTables::of_car(known, &budget).unwrap();
    let ratios = known.gearbox.ratios();
    let mut random = Random(1);
    let mut all: Vec<(usize, Fault, [Counts; 2])> = (0..4)
        .flat_map(|at| {
            let others = (0..4).filter(move |other| *other != at).map(Fault::Shows);
            let jumps = OFF_RAD_S[at].map(Fault::Off);
            let faults =
                [Fault::Zero, Fault::Stuck, Fault::Turned, Fault::Beyond].into_iter().chain(jumps).chain(others);
            let drifts = [Fault::Drifts(0.7), Fault::Drifts(1.3)].into_iter().filter(move |_| at >= 2);
            faults.chain(drifts).map(move |fault| (at, fault, Default::default()))
        })
        .collect();
    for shift in neighbouring_shifts(known, &tables).0 {
        let truth = drawn_car(known, shift.from, shift.to, 1);
        let usual = CarShift::usual(known, shift.from, shift.to, shift.throttle());
        let settled = CarShift { request_s: REQUEST_S, duration_s: REQUEST_S + 4.0, ..usual };
        let samples = simulated(known, &truth, &settled).unwrap();
        let right = inputs(known, &tables, &samples, &sensors, shift.noise(1));
        let right = rows(right.iter().map(|(_, input)| input));
        assert!(refused(&ratios, &right).iter().flatten().all(|refused| !refused), "{shift:?}");
        for (at, fault, counts) in &mut all {
            for length_s in [0.1, 0.5, 1.0, 2.0] {
                let from_s = REQUEST_S - 0.5 + 3.0 * random.uniform();
                let shown = failing(&right, *at, *fault, [from_s, from_s + length_s]);
                let together = begins_together(&right, *at, *fault, from_s);
                counts[usize::from(together)].add(&count(&ratios, &right, &shown, *at));
            }
        }
    }
    all
}

/// Whether the fault begins between two speeds that turn together.
fn begins_together(right: &[Row], at: usize, fault: Fault, from_s: f64) -> bool {
    let Fault::Shows(other) = fault else { return false };
    let begins = right.iter().find(|row| row[at].is_some_and(|[_, time_s]| time_s > from_s));
    let speeds = begins.and_then(|row| row[at].zip(row[other]));
    speeds.is_some_and(|([one, _], [other, _])| (one - other).abs() < APART_RAD_S)
}

#[test]
fn a_speed_that_fails_in_a_shift_is_refused() {
    // Engine and turbine, and the other pairs.
    let mut copies = [Counts::default(); 2];
    let mut drifts = Counts::default();
    for (n, known) in cars().iter().enumerate() {
        for (at, fault, [apart, together]) in of_car(known) {
            let is_locked = matches!((at, fault), (0, Fault::Shows(1)) | (1, Fault::Shows(0)));
            copies[usize::from(!is_locked)].add(&together);
            let name = SPEEDS[at].name();
            if matches!(fault, Fault::Drifts(_)) {
                drifts.add(&apart);
                continue;
            }
            assert_eq!(apart.believed[0], 0, "car {n}, {name} {fault:?}: {apart:?}");
            assert!(apart.refused[0] * 2000 <= apart.refused[1], "car {n}, {name} {fault:?}: {apart:?}");
        }
    }
    println!(
        "copies that begin while both speeds turn together: engine and turbine {:?}, others {:?}",
        copies[0], copies[1]
    );
    println!("output and wheels that drift away in half a second: {drifts:?}");
    // Where the turbine crosses the output a clutch that closes looks like a copy for one row, and where engine and turbine cross a control unit
    // may send one value from there on.
    let [locked, others] = copies.map(|counts| counts.believed);
    assert!(others[0] * 1000 <= others[1] && locked[0] * 5 <= locked[1], "{copies:?}");
    // The begin of a drift looks like noise and twist of the shafts, and at low speed ratios say nothing.
    assert!(drifts.believed[0] * 5 <= drifts.believed[1] && drifts.refused[0] * 200 <= drifts.refused[1], "{drifts:?}");
}

/// The rows with speeds of this resolution, rad/s.
fn coarse(right: &[Row], resolution_rad_s: f64) -> Vec<Row> {
    let of = |[value, time_s]: [f64; 2]| [(value / resolution_rad_s).round() * resolution_rad_s, time_s];
    right.iter().map(|row| row.map(|reading| reading.map(of))).collect()
}

/// Drives through all gears, with the speeds as they are and in steps of a half, one and two revolutions a minute: where two shafts turn together,
/// coarse readings are often equal.
#[test]
fn healthy_drives_lose_no_speed() {
    const RPM: f64 = core::f64::consts::PI / 30.0;
    let mut readings = 0;
    for (n, known) in cars().iter().enumerate() {
        let (sensors, truth) = (sensors(), drawn_car(known, 0, 0, 3));
        let budget = ErrorBudget::of_car(known).read_by(known, Some(&sensors));
        let tables = ShiftTables::of_car(known, &budget).unwrap();
        let mut recording = Recording::default();
        drive_tour(&CarModel::new(truth).unwrap(), known, |sample| recording.push(sample), || {}).unwrap();
        let inputs: Vec<_> = recording.inputs(known, &tables, &sensors, 3).collect();
        let right = rows(inputs.iter());
        for resolution_rad_s in [1e-9, 0.5 * RPM, RPM, 2.0 * RPM] {
            let shown = coarse(&right, resolution_rad_s);
            let refused = refused(&known.gearbox.ratios(), &shown);
            let count = |at: usize| refused.iter().filter(|row| row[at]).count();
            assert_eq!([0, 1, 2, 3].map(count), [0; 4], "car {n}, {resolution_rad_s} rad/s");
            readings += shown.iter().flatten().flatten().count();
        }
    }
    println!("{readings} readings");
    assert!(readings > 500_000, "{readings}");
}
