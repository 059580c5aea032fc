//! The gearbox filter against the Kalman filter of one shift and the observers that a log without a wheel speed had, on the same readings.
//!
//! `cargo run -p study --example one_filter -- RUNS DRAWS`: errors of pressure and torque of the oncoming clutch in the torque and the
//! inertia phase, over so many runs of `experiments/combined.toml`, and in all scenarios of `experiments/field.toml` with so many draws of
//! the noise. Ratios of the combined runs are those of the 95 % quantiles, of the medians and of the RMS.

#![expect(clippy::print_stdout, reason = "an example prints")]

use std::error::Error;
use std::path::{Path, PathBuf};

use car::{Experiment, GainMethod, ObserverKind, Vehicle};
use config::{ExperimentFile, Study};
use observer::{Estimate, Phase};
use study::sampling::through_sensors;
use study::{AnyObserver, Campaign, RunColumns, simulate_drive, true_phases};
use trace::{Trace, signal};

const SAMPLE_S: f64 = 0.01;
const PHASES: [Phase; 2] = [Phase::TorquePhase, Phase::InertiaPhase];

/// An observer, with the sensors given or not, and a channel that the log does not have.
struct Compared {
    name: &'static str,
    kind: ObserverKind,
    has_sensors: bool,
    without: Option<&'static str>,
}

const fn compared(
    name: &'static str,
    kind: ObserverKind,
    has_sensors: bool,
    without: Option<&'static str>,
) -> Compared {
    Compared { name, kind, has_sensors, without }
}

const NO_OFFGOING: Option<&str> = Some(signal::OFFGOING_CURRENT);
const NO_WHEEL: Option<&str> = Some(signal::WHEEL_SPEED);

/// Each is compared with the one before.
const PAIRS: [[Compared; 2]; COUNT] = [
    [
        compared("kalman, sensors", ObserverKind::Kalman, true, None),
        compared("gearbox, sensors", ObserverKind::Gearbox, true, None),
    ],
    [
        compared("kalman", ObserverKind::Kalman, false, None),
        compared("gearbox over kalman", ObserverKind::Gearbox, false, None),
    ],
    [
        compared("kalman, sensors, one command", ObserverKind::Kalman, true, NO_OFFGOING),
        compared("gearbox, sensors, one command", ObserverKind::Gearbox, true, NO_OFFGOING),
    ],
    [
        compared("open loop with maps", ObserverKind::OpenLoopMaps, false, None),
        compared("gearbox over maps", ObserverKind::Gearbox, false, None),
    ],
    [
        compared("rigid, no wheel speed", ObserverKind::Rigid, false, NO_WHEEL),
        compared("gearbox over rigid, no wheel", ObserverKind::Gearbox, false, NO_WHEEL),
    ],
    [
        compared("kalman, one command", ObserverKind::Kalman, false, NO_OFFGOING),
        compared("gearbox, one command", ObserverKind::Gearbox, false, NO_OFFGOING),
    ],
];
const COUNT: usize = 6;

/// RMS errors of pressure, Pa, and torque, N m, each in torque and inertia phase; and samples outside the guaranteed ranges.
#[derive(Clone, Copy)]
struct Score {
    errors: [f64; 4],
    outside: usize,
}

/// Of errors in their order.
type Statistic<'a> = &'a dyn Fn(&[f64]) -> f64;

/// The scores of [`PAIRS`].
type Scores = [[Score; 2]; COUNT];

fn main() -> Result<(), Box<dyn Error>> {
    let argument = |at: usize, default: u64| std::env::args().nth(at).map_or(Ok(default), |text| text.parse());
    combined(argument(1, 100)?)?;
    field(argument(2, 3)?)
}

fn experiment(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../experiments").join(name)
}

/// The scores of all over a drive behind its sensors.
fn scores(vehicle: &Vehicle, experiment: &Experiment, drive: &Trace) -> Result<Scores, Box<dyn Error>> {
    let sensors = experiment.sensors.ok_or("the experiment has no sensors")?;
    let sample_s = experiment.observers.first().map_or(SAMPLE_S, |entry| entry.sample_time_s);
    let both = through_sensors(drive, sample_s, &sensors, vehicle);
    let mut scores = [[Score { errors: [0.0; 4], outside: 0 }; 2]; COUNT];
    for (of, score) in PAIRS.iter().flatten().zip(scores.iter_mut().flatten()) {
        let given = experiment.sensors_given.as_ref().filter(|_| of.has_sensors);
        let method = if of.kind == ObserverKind::Rigid { GainMethod::PeakToPeak } else { GainMethod::Iss };
        let observer = AnyObserver::best(vehicle, of.kind, method, SAMPLE_S, given)?.0;
        let left = both.filtered(|name| of.without != Some(name));
        let columns = RunColumns::of(&left, vehicle)?;
        *score = Score::of(&observer.run_alone(&columns), &observer.run(vehicle, &columns), &both)?;
    }
    Ok(scores)
}

impl Score {
    /// Of estimates as they are, and of those with their ranges.
    fn of(alone: &[Estimate<f64>], ranged: &[Estimate<f64>], truth: &Trace) -> Result<Self, Box<dyn Error>> {
        let phases = true_phases(truth).ok_or("the drive has no shift")?;
        let (pressure, torque) = (truth.require(signal::ONCOMING_PRESSURE)?, truth.require(signal::ONCOMING_TORQUE)?);
        let rms = |phase: Phase, error: &dyn Fn(usize) -> f64| {
            let within = (0..phases.len()).filter(|&at| phases[at] == phase);
            let (sum, count) = within.fold((0.0, 0.0), |(sum, count), at| (sum + error(at).powi(2), count + 1.0));
            f64::sqrt(sum / count)
        };
        let is_outside = |at: &usize| {
            let is_in = |range: [f64; 2], value: f64| (range[0]..=range[1]).contains(&value);
            ranged[*at]
                .bounds
                .is_some_and(|of| !is_in(of.pressure_pa, pressure[*at]) || !is_in(of.clutch_torque_n_m, torque[*at]))
        };
        let [a, b] = PHASES.map(|phase| rms(phase, &|at| alone[at].pressure_pa - pressure[at]));
        let [c, d] = PHASES.map(|phase| rms(phase, &|at| alone[at].clutch_torque_n_m - torque[at]));
        let outside = (0..phases.len()).filter(|at| PHASES.contains(&phases[*at])).filter(is_outside).count();
        Ok(Self { errors: [a, b, c, d], outside })
    }
}

fn combined(runs: u64) -> Result<(), Box<dyn Error>> {
    let campaign = Campaign::new(Study::read(&experiment("combined.toml"))?)?;
    let mut all = Vec::new();
    for run in 0..runs {
        let Ok(full) = campaign.run_in_full(run) else { continue };
        if full.quality.is_some() {
            let has_stroke = full.varied.experiment.off_nominal.piston_stroke == Some(true);
            all.push((has_stroke, scores(&full.varied.vehicle, &full.varied.experiment, &full.trace)?));
        }
    }
    print_ratios("all", &all.iter().map(|(_, scores)| scores).collect::<Vec<_>>());
    for (name, wanted) in [("with strokes", true), ("without strokes", false)] {
        let of = all.iter().filter(|(has_stroke, _)| *has_stroke == wanted).map(|(_, scores)| scores);
        print_ratios(name, &of.collect::<Vec<_>>());
    }
    Ok(())
}

fn print_ratios(name: &str, runs: &[&Scores]) {
    println!(
        "{name}, {} runs: pressure in torque and inertia phase, torque in both, over the observer before",
        runs.len()
    );
    for (pair, [_, own]) in PAIRS.iter().enumerate() {
        let sorted = |observer: usize, k: usize| {
            let mut errors: Vec<f64> = runs.iter().map(|scores| scores[pair][observer].errors[k]).collect();
            errors.sort_by(f64::total_cmp);
            errors
        };
        let at = |errors: &[f64], percent: usize| errors.get(errors.len() * percent / 100).copied().unwrap_or(f64::NAN);
        let rms = |errors: &[f64]| (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt();
        let statistics: [Statistic<'_>; 3] = [&|errors| at(errors, 95), &|errors| at(errors, 50), &rms];
        let ratios = statistics
            .map(|of| [0, 1, 2, 3].map(|k| format!("{:.3}", of(&sorted(1, k)) / of(&sorted(0, k)))).join(" "));
        let outside: usize = runs.iter().map(|scores| scores[pair][1].outside).sum();
        println!("{:30}  {}  outside {outside}", own.name, ratios.join("  "));
    }
}

fn field(draws: u64) -> Result<(), Box<dyn Error>> {
    let file = ExperimentFile::read(&experiment("field.toml"))?;
    let vehicle = file.read_vehicle()?.vehicle;
    let drive = simulate_drive(&vehicle, &file)?;
    println!("field: kPa and N m, over the own nominal errors");
    let mut nominal = None;
    for scenario in &file.scenarios {
        let mut varied = file.experiment.with_scenario(scenario);
        let seed = varied.sensors.map_or(0, |sensors| sensors.seed);
        let mut squares = [[[0.0; 4]; 2]; COUNT];
        for draw in 0..draws {
            if let Some(sensors) = &mut varied.sensors {
                sensors.seed = seed + 1000 * draw;
            }
            let all = scores(&vehicle, &varied, &drive)?;
            for (sums, score) in squares.iter_mut().flatten().zip(all.iter().flatten()) {
                for (sum, error) in sums.iter_mut().zip(score.errors) {
                    *sum += error * error / draws as f64;
                }
            }
        }
        let errors = squares.map(|pair| pair.map(|sums| sums.map(f64::sqrt)));
        let first = nominal.get_or_insert(errors);
        println!("{}", scenario.name);
        for (at, of) in PAIRS.iter().enumerate() {
            for (k, of) in of.iter().enumerate() {
                let ([a, b, c, d], first) = (errors[at][k], first[at][k]);
                let over = [0, 1, 2, 3].map(|i| format!("{:.2}", errors[at][k][i] / first[i])).join(" ");
                println!("  {:30} {:6.2} {:6.2} {c:6.2} {d:6.2}   {over}", of.name, a / 1e3, b / 1e3);
            }
        }
    }
    Ok(())
}
