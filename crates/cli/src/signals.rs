//! Signals that end the program.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use signal_hook::low_level::emulate_default_handler;

use crate::args::Command;
use crate::failure::Failure;

/// Removes unfinished files when an interrupt or SIGTERM ends the program. A log that is followed ends on the first of them as if it
/// were complete, see [`stop_then_end`].
pub(crate) fn end_cleanly(command: &Command) -> Result<(), Failure> {
    if matches!(command, Command::Estimate(options) if options.follow) {
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

/// The first interrupt or SIGTERM sets `stop`, a second one ends the program.
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
    let taken = Signals::new([SIGINT, SIGTERM]);
    taken.map_err(|error| Failure::Work(format!("interrupts cannot be received: {error}")))
}

fn end(signal: i32) {
    trace::remove_unfinished();
    // A program that starts this one is told by which signal it ended.
    if emulate_default_handler(signal).is_err() {
        std::process::exit(128 + signal);
    }
}
