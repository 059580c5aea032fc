//! Everything that has to be fast, measured beside its rivals in one run, as the page `docs/reference/performance.md`.
//!
//! `cargo bench -p study --bench performance` prints the page; `cargo bench -p study --bench performance -- --write` writes it with
//! its figures. That takes about five minutes. Times are the fastest of many runs. CVODE is a rival where `cc` has SUNDIALS, SciPy
//! where `python3` has it. `-- --rivals` only checks that both are there and have the same equations, and fails where one is not.

#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark")]

mod bars;
mod command;
mod controller;
mod estimates;
mod observers;
mod rivals;
#[path = "../shared/mod.rs"]
mod shared;
mod simulation;
mod stages;
mod studies;

use std::process::{Command, ExitCode};
use std::time::{Duration, Instant};

use shared::root;

/// A figure of the page: its name in `docs/figures`, and the SVG.
type Figure = (&'static str, String);

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().collect();
    // Tests ask only whether it starts.
    if arguments.iter().any(|argument| argument == "--test") {
        return ExitCode::SUCCESS;
    }
    if arguments.iter().any(|argument| argument == "--rivals") {
        return if rivals::check() { ExitCode::SUCCESS } else { ExitCode::FAILURE };
    }
    let (page, figures) = page();
    if arguments.iter().any(|argument| argument == "--write") {
        std::fs::write(root().join("docs/reference/performance.md"), &page).unwrap();
        for (name, svg) in figures {
            std::fs::write(root().join("docs/figures").join(name), svg).unwrap();
        }
    }
    println!("{page}");
    ExitCode::SUCCESS
}

/// The page with its figures.
fn page() -> (String, Vec<Figure>) {
    let mut page = format!(
        "<!-- Written by `cargo bench -p study --bench performance -- --write`; do not edit. -->\n# Performance\n\n\
         Measured by `cargo bench -p study --bench performance` on {}.\nEach time is the fastest of many runs; what is compared was measured in \
         turns. Times on such a machine\nchange by half from one run of the benchmark to the next: compare within one. Our code was built {}; libraries in C \
         are\nthose of the system, which serve every processor.\n",
        machine(),
        instructions()
    );
    let mut figures = vec![observers::steps(&mut page)];
    controller::counts(&mut page);
    simulation::designs_and_shifts(&mut page);
    figures.push(rivals::integrators(&mut page));
    figures.push(studies::studies(&mut page));
    figures.push(estimates::commands(&mut page));
    (page, figures)
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

/// The instructions that the compiler was allowed to use.
fn instructions() -> &'static str {
    if cfg!(all(target_feature = "avx2", target_feature = "fma")) {
        "with AVX2 and FMA"
    } else {
        "without AVX2 and FMA"
    }
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
