//! Instructions of an observer's step on a controller: a Cortex-M4F in single precision.
//!
//! `cargo bench -p study --bench controller` builds the observers for `thumbv7em-none-eabihf`, runs them in QEMU over the
//! readings of a whole shift, from some seconds in gear to some after lock-up, and prints mean and worst instructions of a
//! step, code and state size. It fails where
//!
//! - the counting is off: a loop of known length is counted with the steps;
//! - an estimate on the controller is another than that of the same code here;
//! - a routine for double precision is in the program of a step (`embedded/src/bin`);
//! - a mean is more than 5 % above that in `controller.toml`. After a change that is meant, or with a new compiler, `-- --write`
//!   renews the file.

#![expect(clippy::unwrap_used, clippy::print_stdout, clippy::print_stderr, reason = "a benchmark")]

mod cases;
mod programs;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use serde::Deserialize;

use cases::{Case, cases};

/// Growth of a mean beyond which the comparison fails.
const TOLERANCE: f64 = 0.05;
/// Largest difference of an estimate here and there, Pa: both are the same code in single precision, but for the routines of
/// the mathematical library.
const SAME_PA: f32 = 100.0;

/// The counts of a compiler.
#[derive(Deserialize)]
struct Counts {
    toolchain: String,
    instructions: BTreeMap<String, u64>,
}

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
    let file = root().join("crates/study/benches/controller.toml");
    let toolchain = said(Command::new("rustc").arg("--version"))?.trim().to_owned();
    let known: Option<Counts> = if write { None } else { Some(read(&file)?) };
    let same = known.as_ref().is_none_or(|known| known.toolchain == toolchain);
    let mut sound = programs::check()?;
    let program = programs::build("embedded/count/Cargo.toml")?.join("count");
    let mut counts = BTreeMap::new();
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
        for (part, steps) in &run.parts {
            let name = format!("{}: {part}", case.name);
            let before = known.as_ref().and_then(|known| known.instructions.get(&name));
            let change = before.map(|&before| steps.mean as f64 / before as f64 - 1.0);
            let beside = change.map_or_else(String::new, |change| format!("{:+.1} %", 100.0 * change));
            println!("{:>8} {:>8} {beside:>8}  {part}", steps.mean, steps.worst);
            if same && known.is_some() && change.is_none_or(|change| change > TOLERANCE) {
                println!("more than {:.0} % above the file, or not in it\n{RENEW}", 100.0 * TOLERANCE);
                sound = false;
            }
            counts.insert(name, steps.mean);
        }
        sound &= faithful(&case, &run);
    }
    if write {
        std::fs::write(&file, text(&toolchain, &counts)).map_err(|error| error.to_string())?;
    } else if let Some(known) = known.filter(|_| !same) {
        println!("not compared: the counts are of\n  {}\nand this is\n  {toolchain}\n{RENEW}", known.toolchain);
    }
    Ok(sound)
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
    if difference > SAME_PA {
        println!("{}: the controller's estimates are others", case.name);
    }
    difference <= SAME_PA
}

const RENEW: &str = "to renew the file: cargo bench -p study --bench controller -- --write";

fn read(file: &Path) -> Result<Counts, String> {
    let text = std::fs::read_to_string(file).map_err(|error| format!("{}: {error}\n{RENEW}", file.display()))?;
    toml::from_str(&text).map_err(|error| format!("{}: {error}\n{RENEW}", file.display()))
}

fn text(toolchain: &str, counts: &BTreeMap<String, u64>) -> String {
    let mut text = format!(
        "# Mean instructions of a step on a Cortex-M4F, see `benches/controller/main.rs`; do not edit.\n\
         toolchain = {toolchain:?}\n\n[instructions]\n"
    );
    for (name, count) in counts {
        let _ = writeln!(text, "{name:?} = {count}");
    }
    text
}
