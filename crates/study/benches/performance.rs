//! Everything that has to be fast, measured beside its rivals in one run, as the page `docs/performance.md`.
//!
//! `cargo bench -p study` prints the page; `cargo bench -p study -- --write` writes it. Times are the fastest of many
//! runs. SciPy is a rival where `python3` has it.

#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark")]

mod rivals;

use std::fmt::Write as _;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use config::{Experiment, GainMethod, Study, Vehicle};
use design::rigid::design_phase;
use design::{
    Model, Quantity, bounded, compliant_observer, design_compliant, design_discrete_phase, design_rigid,
    design_sliding, extended_filter, inversion, kalman_filter, requirement, rigid_observer, sliding_observer,
    super_twisting, unscented_filter,
};
use observer::{Estimator, Input, Phase, RigidGains};
use plant::{Powertrain, Simulation};
use study::{Campaign, StudyError, execute};

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    // Tests ask only whether it starts.
    if arguments.iter().any(|argument| argument == "--test") {
        return;
    }
    let page = page();
    if arguments.iter().any(|argument| argument == "--write") {
        std::fs::write(root().join("docs/performance.md"), &page).unwrap();
    }
    println!("{page}");
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn page() -> String {
    let mut page = format!(
        "<!-- Written by `cargo bench -p study -- --write`; do not edit. -->\n# Performance\n\n\
         Measured by `cargo bench -p study` on {}.\nEach time is the fastest of many runs; rivals took turns with what \
         they are held against. Times on such a machine\nwander by half from one run to the next: compare within one.\n",
        machine()
    );
    observers(&mut page);
    simulation(&mut page);
    rivals::integrators(&mut page);
    studies(&mut page);
    page
}

/// What the page was measured on.
fn machine() -> String {
    let information = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = information.lines().find_map(|line| line.strip_prefix("model name"));
    let model = model.map_or(std::env::consts::ARCH, |rest| rest.trim_start_matches([' ', '\t', ':']));
    let compiler = Command::new("rustc").arg("--version").output().ok();
    let compiler = compiler.and_then(|output| String::from_utf8(output.stdout).ok()).unwrap_or_default();
    format!("{} cores of a shared server ({model}, {}, {})", threads(), std::env::consts::OS, compiler.trim())
}

fn threads() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
}

/// The fastest time of each of several jobs that take turns for `budget` altogether.
fn fastest(budget: Duration, jobs: &mut [Box<dyn FnMut() + '_>]) -> Vec<f64> {
    let mut best = vec![f64::INFINITY; jobs.len()];
    let start = Instant::now();
    let mut rounds = 0;
    while rounds < 3 || start.elapsed() < budget {
        for (job, best) in jobs.iter_mut().zip(&mut best) {
            let began = Instant::now();
            job();
            *best = best.min(began.elapsed().as_secs_f64());
        }
        rounds += 1;
    }
    best
}

fn one(job: impl FnMut()) -> f64 {
    fastest(SHORT, &mut [Box::new(job)])[0]
}

const SHORT: Duration = Duration::from_millis(800);
const LONG: Duration = Duration::from_secs(4);

/// A time with three digits and its unit.
fn time(seconds: f64) -> String {
    let (value, unit) = match seconds {
        s if s < 1e-6 => (1e9 * s, "ns"),
        s if s < 1e-3 => (1e6 * s, "µs"),
        s if s < 1.0 => (1e3 * s, "ms"),
        s => (s, "s"),
    };
    let digits = if value < 9.995 { 2 } else { usize::from(value < 99.95) };
    format!("{value:.digits$} {unit}")
}

fn vehicle() -> Vehicle {
    Vehicle::two_speed_at().unwrap()
}

const STEPS: u32 = 1000;

/// Samples that keep an observer in its inertia phase, where a step costs most.
fn samples() -> Vec<Input<f64>> {
    let sample = |n: u32| {
        let (turbine, slip) = (340.0 - 0.01 * f64::from(n), 300.0 - 0.02 * f64::from(n));
        Input {
            dt_s: if n == 1 { 10.0 } else { 0.01 },
            engine_rad_s: 370.0,
            turbine_rad_s: turbine,
            slip_rad_s: slip,
            wheel_rad_s: (turbine - 0.6 * slip) / 3.0,
            command: 0.25,
        }
    };
    (0..STEPS).map(sample).collect()
}

fn steps<O: Estimator<f64>>(observer: O) -> impl FnMut() {
    let samples = samples();
    move || {
        let mut state = observer.start();
        black_box(samples.iter().fold(0.0, |sum, x| sum + observer.step(&mut state, black_box(x)).pressure_pa));
    }
}

fn observers(page: &mut String) {
    let vehicle = vehicle();
    let names = [
        "open loop",
        "rigid",
        "rigid, with its guaranteed range",
        "compliant",
        "sliding",
        "super-twisting",
        "inversion",
        "Kalman",
        "extended Kalman",
        "unscented",
    ];
    let rigid = rigid_observer(&vehicle, design_rigid(&vehicle).unwrap().gains());
    let mut jobs: Vec<Box<dyn FnMut()>> = vec![
        Box::new(steps(rigid_observer(&vehicle, RigidGains::open_loop()))),
        Box::new(steps(rigid)),
        Box::new(steps(bounded(&vehicle, rigid))),
        Box::new(steps(compliant_observer(&vehicle, design_compliant(&vehicle).unwrap().gains()))),
        Box::new(steps(sliding_observer(&vehicle, design_sliding(&vehicle)))),
        Box::new(steps(super_twisting(&vehicle))),
        Box::new(steps(inversion(&vehicle))),
        Box::new(steps(kalman_filter(&vehicle, None))),
        Box::new(steps(extended_filter(&vehicle, None))),
        Box::new(steps(unscented_filter(&vehicle, None))),
    ];
    let times = fastest(LONG, &mut jobs);
    page.push_str("\n## One step of an observer, f64\n\n| observer | time |\n|---|---|\n");
    for (name, seconds) in names.iter().zip(times) {
        let _ = writeln!(page, "| {name} | {} |", time(seconds / f64::from(STEPS)));
    }
}

fn simulation(page: &mut String) {
    let vehicle = vehicle();
    let required = requirement(&vehicle, Phase::InertiaPhase).into();
    let five_steps = one(|| {
        black_box(design_phase(black_box(&vehicle), Phase::InertiaPhase, &required).unwrap());
    });
    let peak_to_peak = one(|| {
        black_box(
            design_discrete_phase(
                black_box(&vehicle),
                Model::Rigid,
                GainMethod::PeakToPeak,
                Quantity::ClutchTorque,
                Phase::InertiaPhase,
                0.01,
            )
            .unwrap(),
        );
    });
    let drive = |sample_time_s: f64| {
        let experiment = Experiment { sample_time_s, ..Experiment::e1().unwrap() };
        one(|| {
            let mut sum = 0.0;
            plant::simulate(black_box(&vehicle), &experiment, |sample| sum += sample.oncoming_pa).unwrap();
            black_box(sum);
        })
    };
    let experiment = Experiment { sample_time_s: 0.01, ..Experiment::e1().unwrap() };
    let powertrain = Powertrain::new(vehicle.clone());
    let request_s = experiment.shift.request_s;
    let mut warm = Simulation::new(&powertrain, &vehicle, &experiment).unwrap();
    warm.advance(request_s, |_| {}).unwrap();
    let window = one(|| {
        let (mut shift, mut sum) = (black_box(&warm).clone(), 0.0);
        shift.advance(request_s + 1.5, |sample| sum += sample.oncoming_pa).unwrap();
        black_box(sum);
    });
    page.push_str("\n## Design and simulation\n\n| what | time | aim |\n|---|---|---|\n");
    let rows = [
        ("gain design of one phase, five steps", five_steps, "1 ms"),
        ("gain design of one phase, peak-to-peak", peak_to_peak, ""),
        ("a shift of 1.5 s from a warm state: 100 Hz controller, events, valve delays", window, "250 µs"),
        ("a launch and shift of 9.5 s, recorded every 10 ms", drive(0.01), "3 ms"),
        ("the same, recorded every 1 ms", drive(0.001), "3 ms"),
    ];
    for (name, seconds, aim) in rows {
        let _ = writeln!(page, "| {name} | {} | {aim} |", time(seconds));
    }
    page.push_str(
        "\nThe simulation keeps every state within 0.1 % of its range against a tolerance a hundred thousand times tighter:\n\
         `default_tolerance_is_good_to_a_thousandth_of_each_range` in `crates/plant/tests/shift.rs` checks that.\n",
    );
}

/// The line of the study file that names its observers.
const OBSERVERS: &str = r#"observers = ["Kalman", "peak-to-peak", "rigid", "compliant", "open loop"]"#;

fn campaign(runs: u64, observers: &[&str]) -> Campaign {
    let text = std::fs::read_to_string(root().join("experiments/settings.toml")).unwrap();
    let names: Vec<String> = observers.iter().map(|name| format!("{name:?}")).collect();
    let experiment = root().join("experiments/bench.toml");
    let text = text
        .replace("experiment = \"bench.toml\"", &format!("experiment = '{}'", experiment.display()))
        .replace("runs = 2000", &format!("runs = {runs}"))
        .replace(OBSERVERS, &format!("observers = [{}]", names.join(", ")));
    let path = std::env::temp_dir().join(format!("wetclutch-benchmark-{}.toml", std::process::id()));
    std::fs::write(&path, text).unwrap();
    let study = Study::read(&path);
    std::fs::remove_file(path).unwrap();
    Campaign::new(study.unwrap()).unwrap()
}

fn make(campaign: &Campaign, threads: usize) {
    execute::<StudyError>(campaign, 0..campaign.study.runs, threads, |row| {
        black_box(row);
        Ok(())
    })
    .unwrap();
}

fn studies(page: &mut String) {
    let three = ["rigid", "compliant", "open loop"];
    let all = ["rigid", "peak-to-peak", "compliant", "sliding", "open loop"];
    page.push_str(
        "\n## Studies\n\nRuns of `experiments/settings.toml`: files read anew, launch, shift, sensors, observers, scores.\n\n\
         | runs | observers | threads | time | runs per second |\n|---|---|---|---|---|\n",
    );
    let mut row = |runs: u64, observers: usize, threads: usize, seconds: f64| {
        let rate = runs as f64 / seconds;
        let _ = writeln!(page, "| {runs} | {observers} | {threads} | {} | {rate:.0} |", time(seconds));
    };
    let most = threads();
    for (runs, observers) in [(500, &all[4..]), (500, &three[..]), (500, &all[..]), (2000, &three[..])] {
        let campaign = campaign(runs, observers);
        let mut jobs: [Box<dyn FnMut()>; 2] = [Box::new(|| make(&campaign, 1)), Box::new(|| make(&campaign, most))];
        let best = fastest(LONG, &mut jobs);
        row(runs, observers.len(), 1, best[0]);
        row(runs, observers.len(), most, best[1]);
    }
    let long = campaign(10_000, &three);
    row(10_000, 3, most, one(|| make(&long, most)));
    let pair = campaign(1000, &three);
    let best = fastest(2 * LONG, &mut [Box::new(|| make(&pair, 1)), Box::new(|| make(&pair, 2))]);
    let _ = writeln!(
        page,
        "\nTwo threads make {:.2} times the runs of one (1000 runs, 3 observers; aim 1.8). The aim for 10,000 runs with\n\
         three observers is 10 s on two cores.",
        best[0] / best[1]
    );
}
