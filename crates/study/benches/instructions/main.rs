//! Instructions of the hot paths, against those in `instructions.toml`.
//!
//! `cargo bench -p study --bench instructions` counts them with Valgrind's callgrind and fails where one has grown by more than 5 %.
//! Counts repeat on one toolchain; where the compiler, the C library or Valgrind is another than that of the file, the program
//! says so and compares nothing. After a change that is meant, or with a new toolchain, `-- --write` renews the file.

#![expect(clippy::unwrap_used, clippy::print_stdout, clippy::print_stderr, reason = "a benchmark")]

#[path = "../counts/mod.rs"]
mod counts;
mod drive;
mod paths;
#[path = "../shared/mod.rs"]
mod shared;

use std::process::{Command, ExitCode};

use counts::Counts;
use paths::{HotPath, PATHS};

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let has = |option: &str| arguments.iter().any(|argument| argument == option);
    // Tests ask only whether it starts.
    if has("--test") {
        return ExitCode::SUCCESS;
    }
    if let Some(at) = arguments.iter().position(|argument| argument == "--only") {
        let path = PATHS.iter().find(|path| Some(path.name) == arguments.get(at + 1).map(String::as_str));
        counted(&mut *(path.unwrap().prepare)());
        return ExitCode::SUCCESS;
    }
    match check(has("--write")) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::FAILURE
        }
    }
}

/// What is counted: callgrind looks at this function alone.
#[inline(never)]
fn counted(job: &mut dyn FnMut()) {
    job();
}

fn check(write: bool) -> Result<bool, String> {
    let mut counts = Counts::new("instructions", toolchain()?, write)?;
    for path in PATHS {
        let count = count(path)?;
        let change = counts.take("instructions", path.name, count);
        println!("{count:>12} {change:>12}  {}", path.name);
    }
    counts.conclude()
}

/// Compiler, C library and Valgrind: all that the counts depend on beside the program.
fn toolchain() -> Result<String, String> {
    let version = |program: &str| {
        let output = Command::new(program).arg("--version").output();
        let output = output.map_err(|error| format!("{program}: {error}\nhint: install {program}"))?;
        let text = String::from_utf8_lossy(&output.stdout).lines().next().unwrap_or_default().to_owned();
        Ok::<_, String>(text)
    };
    // The mathematical library chooses its routines by the processor.
    let processors = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = processors.lines().find_map(|line| line.strip_prefix("model name")).unwrap_or_default();
    let processor = model.trim_start_matches([' ', '\t', ':']).to_owned();
    Ok([version("rustc")?, version("ldd")?, version("valgrind")?, processor].join("; "))
}

/// Instructions of a path for one of its units.
fn count(path: &HotPath) -> Result<u64, String> {
    let program = std::env::current_exe().map_err(|error| error.to_string())?;
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null", "--toggle-collect=*instructions::counted*"])
        .arg(program)
        .args(["--only", path.name])
        .output()
        .map_err(|error| format!("valgrind: {error}"))?;
    let said = String::from_utf8_lossy(&output.stderr);
    let collected = said.lines().find_map(|line| line.split_once("Collected :")?.1.trim().parse::<u64>().ok());
    match collected {
        Some(collected) if output.status.success() && collected > 0 => Ok(collected / path.units),
        _ => Err(format!("callgrind counted nothing of \"{}\":\n{said}", path.name)),
    }
}
