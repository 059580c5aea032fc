//! Signals that end the program.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM};
use signal_hook::iterator::Signals;
use signal_hook::low_level::emulate_default_handler;

use crate::args::Command;
use crate::failure::Failure;

/// Removes unfinished files when an interrupt, SIGTERM, SIGQUIT or the end of its terminal (SIGHUP) ends the program. A log that is
/// followed ends on the first of them as if it were complete, see [`stop_then_end`].
pub(crate) fn end_cleanly(command: &Command) -> Result<(), Failure> {
    if matches!(command, Command::Estimate(options) if options.follow) || matches!(command, Command::Watch(_)) {
        return Ok(());
    }
    let mut signals = signals()?;
    thread::spawn(move || {
        if let Some(signal) = signals.forever().next() {
            end(signal);
        }
    });
    Ok(())
}

/// The first of these signals sets `stop`, a second one ends the program.
pub(crate) fn stop_then_end(stop: &Arc<AtomicBool>) -> Result<(), Failure> {
    let mut signals = signals()?;
    let stop = Arc::clone(stop);
    thread::spawn(move || {
        for signal in signals.forever() {
            if stop.swap(true, Ordering::Relaxed) {
                end(signal);
            }
        }
    });
    Ok(())
}

fn signals() -> Result<Signals, Failure> {
    let ignored = ignored();
    let is_ignored = |signal: i32| u32::try_from(signal - 1).is_ok_and(|bit| ignored >> bit & 1 == 1);
    // A program that was started by `nohup` is to go on when its terminal ends: a handler would end it.
    let optional = [SIGHUP, SIGQUIT].into_iter().filter(|&signal| !is_ignored(signal));
    let taken = Signals::new([SIGINT, SIGTERM].into_iter().chain(optional));
    taken.map_err(|error| Failure::Work(format!("interrupts cannot be received: {error}")))
}

/// The signals that the program was started to ignore: bit `n - 1` for signal `n`. All of them where the system does not tell.
fn ignored() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(u64::MAX)
}

fn end(signal: i32) {
    trace::remove_unfinished();
    // A program that starts this one is told by which signal it ended.
    if emulate_default_handler(signal).is_err() {
        std::process::exit(128 + signal);
    }
}
