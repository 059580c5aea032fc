//! Instructions of an observer's step on a controller: a Cortex-M4F in single precision.
//!
//! `cargo bench -p study --bench controller` builds the observers for `thumbv7em-none-eabihf`, runs them in QEMU over the
//! readings of a whole shift, from some seconds in gear to some after lock-up, and prints mean and worst instructions of a
//! step, code and state size. It fails where
//!
//! - the counting is off: a loop of known length is counted with the steps;
//! - an estimate on the controller is another than that of the same code here;
//! - a routine for double precision is in the program of a step (`embedded/src/bin`);
//! - a mean or a size is more than 5 % above that in `controller.toml`. After a change that is meant, or with a new compiler, `-- --write`
//!   renews the file.

#![expect(clippy::unwrap_used, clippy::print_stdout, clippy::print_stderr, reason = "a benchmark")]

mod cases;
#[path = "../counts/mod.rs"]
mod counts;
mod programs;

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use cases::{Case, cases};
use counts::Counts;

/// What is counted.
const INSTRUCTIONS: &str = "instructions";
const BYTES: &str = "bytes";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    // Tests ask only whether it starts.
    if arguments.iter().any(|argument| argument == "--test") {
        return ExitCode::SUCCESS;
    }
    match check(arguments.iter().any(|argument| argument == "--write")) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::FAILURE
        }
    }
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Runs a program and returns what it prints.
fn said(command: &mut Command) -> Result<String, String> {
    let program = command.get_program().to_string_lossy().into_owned();
    let output = command.output().map_err(|error| format!("{program}: {error}\nhint: install {program}"))?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    if output.status.success() {
        Ok(text)
    } else {
        Err(format!("{program} failed:\n{text}{}", String::from_utf8_lossy(&output.stderr)))
    }
}

fn check(write: bool) -> Result<bool, String> {
    let toolchain = said(Command::new("rustc").arg("--version"))?.trim().to_owned();
    let mut counts = Counts::new("controller", toolchain, write)?;
    let mut sound = programs::check(&mut counts)?;
    let program = programs::build("embedded/count/Cargo.toml")?.join("count");
    println!("\n{:>8} {:>8} {:>8}  instructions of a step: mean, worst, against the file", "mean", "worst", "");
    for case in cases() {
        let run = case.run(&program)?;
        println!(
            "{} ({} readings; parameters {} bytes, state {} bytes)",
            case.name,
            case.len(),
            run.bytes[0],
            run.bytes[1]
        );
        for (what, bytes) in ["parameters", "state"].into_iter().zip(run.bytes) {
            counts.take(BYTES, &format!("{}: {what}", case.name), bytes);
        }
        for (part, steps) in &run.parts {
            let change = counts.take(INSTRUCTIONS, &format!("{}: {part}", case.name), steps.mean);
            println!("{:>8} {:>8} {change:>8}  {part}", steps.mean, steps.worst);
        }
        sound &= faithful(&case, &run);
    }
    Ok(counts.conclude()? && sound)
}

/// Whether the counting is right and the estimates are those of the same code here.
fn faithful(case: &Case, run: &cases::Run) -> bool {
    let [expected, counted] = run.check_loop;
    if counted.abs_diff(expected) > expected / 1000 + 4 {
        println!("the counting is off: a loop of {expected} instructions counts as {counted}");
        return false;
    }
    let difference = run.difference_pa;
    println!("{:>26}  largest difference of an estimate from the same code here: {difference} Pa", "");
    if difference > 0.0 {
        println!("{}: the controller's estimates are others", case.name);
    }
    difference <= 0.0
}
