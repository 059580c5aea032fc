//! The program itself, as a user runs it.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::shared::root;

/// What a run of the program took.
pub(crate) struct Ran {
    pub(crate) seconds: f64,
    /// Time of processors that it used, s; NaN where the system does not say.
    pub(crate) processor_s: f64,
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
    let (mut peak_mib, mut used_s) = (f64::NAN, f64::NAN);
    loop {
        // The kernel keeps peak and time; what comes after the last look is the end of the program.
        if let Some(kib) = peak_kib(child.id()) {
            peak_mib = kib / 1024.0;
        }
        used_s = processor_s(child.id()).unwrap_or(used_s);
        if let Some(status) = child.try_wait().unwrap() {
            assert!(status.success(), "wetclutch {}", arguments.join(" "));
            return Ran { seconds: began.elapsed().as_secs_f64(), processor_s: used_s, peak_mib };
        }
        std::thread::sleep(LOOK);
    }
}

/// Time of processors of a process so far, in itself and in the kernel, s.
fn processor_s(process: u32) -> Option<f64> {
    /// What the kernel counts in.
    const PER_S: f64 = 100.0;
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    // Behind the name, which may hold anything: state, ten numbers, and both times.
    let mut times = stat.rsplit_once(')')?.1.split_ascii_whitespace().skip(11);
    let [own, kernel] = [times.next()?, times.next()?].map(|time| time.parse::<f64>().ok());
    Some((own? + kernel?) / PER_S)
}

/// Peak of the resident memory of a process, KiB.
fn peak_kib(process: u32) -> Option<f64> {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix("kB")?.trim().parse().ok()
}
