//! Everything that has to be fast, measured beside its rivals in one run, as the page `docs/performance.md`.
//!
//! `cargo bench -p study --bench performance` prints the page; `cargo bench -p study --bench performance -- --write` writes it. That takes about two minutes. Times are
//! the fastest of many runs. SciPy is a rival where `python3` has it.

#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark")]

mod rivals;
mod shared;
mod stages;

use std::fmt::Write as _;
use std::hint::black_box;
use std::process::Command;
use std::time::{Duration, Instant};

use config::{Experiment, GainMethod, ObserverKind};
use design::rigid::design_phase;
use design::{
    Model, Quantity, bounded, compliant_observer, design_compliant, design_discrete, design_discrete_phase,
    design_rigid, design_sliding, extended_filter, inversion, kalman_filter, requirement, rigid_observer,
    sliding_observer, super_twisting, unscented_filter,
};
use observer::{Estimator, Input, Phase, RigidGains};
use plant::{Powertrain, Simulation};
use shared::{SAMPLE_TIME_S, THREE, campaign, estimate, log_of, observer, root, samples, vehicle};
use study::{Campaign, StudyError, execute};

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    // Tests ask only whether it starts.
    if arguments.iter().any(|argument| argument == "--test") {
        return;
    }
    let (page, diagram) = page();
    if arguments.iter().any(|argument| argument == "--write") {
        std::fs::write(root().join("docs/performance.md"), &page).unwrap();
        std::fs::write(root().join("docs/figures/work_precision.svg"), diagram).unwrap();
    }
    println!("{page}");
}

/// The page, and its work-precision diagram.
fn page() -> (String, String) {
    let mut page = format!(
        "<!-- Written by `cargo bench -p study --bench performance -- --write`; do not edit. -->\n# Performance\n\n\
         Measured by `cargo bench -p study --bench performance` on {}.\nEach time is the fastest of many runs; what is compared was measured in \
         turns. Times on such a machine\nchange by half from one run of the benchmark to the next: compare within one.\n",
        machine()
    );
    observers(&mut page);
    simulation(&mut page);
    let diagram = rivals::integrators(&mut page);
    studies(&mut page);
    estimates(&mut page);
    (page, diagram)
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

/// An observer over a shift.
fn steps<'a, O: Estimator<f64> + 'a>(observer: O, samples: &'a [Input<f64>]) -> Box<dyn FnMut() + 'a> {
    Box::new(move || {
        let mut state = observer.start();
        black_box(samples.iter().fold(0.0, |sum, x| sum + observer.step(&mut state, black_box(x)).pressure_pa));
    })
}

fn observers(page: &mut String) {
    let (vehicle, samples) = (vehicle(), samples());
    let sensors = Experiment::bench().unwrap().sensors_told;
    let mut names = Vec::new();
    let mut jobs = Vec::new();
    // By itself and with its guaranteed range.
    macro_rules! observer {
        ($name:expr, $observer:expr) => {
            let observer = $observer;
            names.push($name);
            jobs.push(steps(observer, &samples));
            jobs.push(steps(bounded(&vehicle, observer), &samples));
        };
    }
    let peak_to_peak =
        design_discrete(&vehicle, Model::Rigid, GainMethod::PeakToPeak, SAMPLE_TIME_S).unwrap().rigid_gains();
    observer!("Kalman (the default)", kalman_filter(&vehicle, sensors.as_ref()));
    observer!("extended Kalman", extended_filter(&vehicle, sensors.as_ref()));
    observer!("unscented", unscented_filter(&vehicle, sensors.as_ref()));
    observer!("rigid", rigid_observer(&vehicle, design_rigid(&vehicle).unwrap().gains()));
    observer!("rigid, peak-to-peak", rigid_observer(&vehicle, peak_to_peak));
    observer!("compliant", compliant_observer(&vehicle, design_compliant(&vehicle).unwrap().gains()));
    observer!("sliding", sliding_observer(&vehicle, design_sliding(&vehicle)));
    observer!("super-twisting", super_twisting(&vehicle));
    observer!("inversion", inversion(&vehicle));
    observer!("open loop", rigid_observer(&vehicle, RigidGains::open_loop()));
    let times = fastest(2 * LONG, &mut jobs);
    page.push_str(
        "\n## One step of an observer, f64\n\nMean over the steps of a simulated shift of `experiments/bench.toml` at 100 Hz, through its sensors, from 1.2 s before the \
         request.\n\n| observer | by itself | with its guaranteed range |\n|---|---|---|\n",
    );
    for (name, times) in names.iter().zip(times.chunks(2)) {
        let [alone, with_range] = [times[0], times[1]].map(|seconds| time(seconds / samples.len() as f64));
        let _ = writeln!(page, "| {name} | {alone} | {with_range} |");
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
                SAMPLE_TIME_S,
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

fn make(campaign: &Campaign, threads: usize) {
    execute::<StudyError>(campaign, 0..campaign.study.runs, threads, |row| {
        black_box(row);
        Ok(())
    })
    .unwrap();
}

fn seconds(job: impl FnOnce()) -> f64 {
    let began = Instant::now();
    job();
    began.elapsed().as_secs_f64()
}

fn studies(page: &mut String) {
    page.push_str(
        "\n## Studies\n\nRuns of `experiments/settings.toml`: files checked with the factors in place, launch, shift, sensors, observers, \
         scores.\n\n| runs | observers | threads | time | runs per second |\n|---|---|---|---|---|\n",
    );
    let mut row = |campaign: &Campaign, threads: usize, seconds: f64| {
        let (runs, rate) = (campaign.study.runs, campaign.study.runs as f64 / seconds);
        let names = campaign.layout.observers.join(", ");
        let _ = writeln!(page, "| {runs} | {names} | {threads} | {} | {rate:.0} |", time(seconds));
    };
    let most = threads();
    let small = [
        campaign(500, |name| name == "open loop"),
        campaign(500, |name| name == "Kalman"),
        campaign(500, |name| THREE.contains(&name)),
        campaign(500, |_| true),
        campaign(2000, |_| true),
    ];
    for campaign in &small {
        let mut jobs: [Box<dyn FnMut()>; 2] = [Box::new(|| make(campaign, 1)), Box::new(|| make(campaign, most))];
        let best = fastest(LONG, &mut jobs);
        row(campaign, 1, best[0]);
        row(campaign, most, best[1]);
    }
    let long = campaign(10_000, |name| THREE.contains(&name));
    row(&long, most, one(|| make(&long, most)));
    page.push_str("\nThe aim is 10,000 runs with three observers in 10 s on two cores.\n");
    page.push_str(&speed_up(&small[3]));
    stages::of_a_run(page, &small[2]);
}

/// Rows of the log that is estimated.
const ROWS: u32 = 10_000;

fn estimates(page: &mut String) {
    let (vehicle, log) = (vehicle(), log_of(ROWS));
    let kinds =
        [("Kalman", ObserverKind::Kalman), ("rigid", ObserverKind::Rigid), ("open loop", ObserverKind::OpenLoop)];
    let observers = kinds.map(|(_, kind)| observer(kind));
    let (vehicle, log) = (&vehicle, &log);
    let mut jobs: Vec<Box<dyn FnMut() + '_>> = Vec::new();
    for observer in &observers {
        jobs.push(Box::new(move || estimate(observer, vehicle, log)));
    }
    let times = fastest(LONG, &mut jobs);
    page.push_str(
        "\n## Estimates of logs\n\nA log of 10,000 rows as CSV in memory: read, estimated with the guaranteed range, all columns written as CSV; one \
         core.\n\n| observer | rows per second |\n|---|---|\n",
    );
    for ((name, _), seconds) in kinds.iter().zip(times) {
        let _ = writeln!(page, "| {name} | {:.0} |", f64::from(ROWS) / seconds);
    }
}

/// Pairs of which each gives a ratio.
const PAIRS: usize = 9;

/// How much faster two threads are than one, in a sentence.
fn speed_up(campaign: &Campaign) -> String {
    const THREADS: usize = 2;
    let mut ratios: Vec<f64> = (0..PAIRS)
        .map(|_| {
            // In this order a steady change of the machine's speed cancels.
            let [a, b, c, d] = [1, THREADS, THREADS, 1].map(|threads| seconds(|| make(campaign, threads)));
            (a + d) / (b + c)
        })
        .collect();
    ratios.sort_by(f64::total_cmp);
    let median = ratios[PAIRS / 2];
    #[expect(clippy::cast_precision_loss, reason = "two threads")]
    let most = THREADS as f64;
    // Two threads cannot be more than twice as fast: what is beyond is noise.
    let found = if median > most {
        format!(
            "Two threads are twice as fast as one, within the noise of this measurement: the median of {PAIRS} ratios"
        )
    } else {
        format!("Two threads are {median:.2} times as fast as one: the median of {PAIRS} ratios")
    };
    format!(
        "\n{found}\nmeasured in turns, from {:.2} to {:.2} ({} runs; aim 1.8).\n",
        ratios[0],
        ratios[PAIRS - 1],
        campaign.study.runs,
    )
}
