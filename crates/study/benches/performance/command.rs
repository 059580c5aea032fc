//! The program itself, as a user runs it.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::shared::root;

/// What a run of the program took.
pub(crate) struct Ran {
    pub(crate) seconds: f64,
    /// Most memory at a time, MiB; NaN where the system does not say.
    pub(crate) peak_mib: f64,
}

/// Builds the program.
pub(crate) fn program() -> PathBuf {
    let done = Command::new(env!("CARGO"))
        .args(["build", "--release", "--locked", "--quiet", "--bin", "wetclutch"])
        .current_dir(root())
        .status()
        .unwrap();
    assert!(done.success(), "the program does not build");
    root().join("target/release").join("wetclutch")
}

/// Runs the program, and looks at its memory while it runs.
pub(crate) fn run(program: &Path, arguments: &[&str]) -> Ran {
    const LOOK: Duration = Duration::from_millis(2);
    let began = Instant::now();
    let mut command = Command::new(program);
    let command = command.args(arguments).current_dir(root()).stdout(Stdio::null()).stderr(Stdio::null());
    let mut child = command.spawn().unwrap();
    let mut peak_mib = f64::NAN;
    loop {
        // The kernel keeps the peak; what comes after the last look is the end of the program.
        if let Some(kib) = peak_kib(child.id()) {
            peak_mib = kib / 1024.0;
        }
        if let Some(status) = child.try_wait().unwrap() {
            assert!(status.success(), "wetclutch {}", arguments.join(" "));
            return Ran { seconds: began.elapsed().as_secs_f64(), peak_mib };
        }
        std::thread::sleep(LOOK);
    }
}

/// Peak of the resident memory of a process, KiB.
fn peak_kib(process: u32) -> Option<f64> {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix("kB")?.trim().parse().ok()
}
