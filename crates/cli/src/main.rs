//! The `wetclutch` command.
//!
//! **Architecture invariant:** this is the only crate that prints. Data goes to standard output, messages
//! and progress to standard error.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod args;
mod browser;
mod commands;
mod failure;
mod message;
mod output;
mod signals;

use std::process::ExitCode;

use clap::Parser;
use trace::{ShownPath as _, printable};

use args::{Arguments, Command};
use failure::Failure;
use message::Colors;

fn main() -> ExitCode {
    let command = match Arguments::try_parse() {
        Ok(arguments) => {
            arguments.color.hold();
            let typed: Vec<String> = std::env::args_os().map(|of| of.to_string_lossy().into_owned()).collect();
            let unused = arguments.without_effect(&typed);
            if arguments.quiet {
                output::be_quiet();
            }
            if arguments.force {
                commands::replace_any();
            }
            if let Some(units) = arguments.units {
                units.hold();
            }
            if arguments.verbose {
                output::be_verbose();
            }
            unused.into_iter().for_each(|(option, why)| commands::warn_without_effect(option, why));
            arguments.command
        }
        // The message repeats what was typed, and a shell may have completed the name of a file.
        Err(error) if error.use_stderr() => {
            Colors::of_arguments(std::env::args_os().map(|of| of.to_string_lossy().into_owned())).hold();
            let shown = std::env::args_os().map(|of| printable(&of.to_string_lossy()).into_owned());
            Arguments::try_parse_from(shown).err().unwrap_or(error).exit()
        }
        Err(error) => error.exit(),
    };
    let result = signals::end_cleanly(&command).and_then(|()| run(command));
    output::detail(|| "end".to_owned());
    for left in trace::left_by_killed() {
        output::note(&format!(
            "{}: an unfinished file of a run that was killed\nhint: remove it if no other run still writes it",
            left.shown()
        ));
    }
    match result {
        Ok(()) => ExitCode::SUCCESS,
        // The reader of standard output, such as `head`, has closed it: this is not an error.
        Err(Failure::BrokenPipe) => ExitCode::SUCCESS,
        Err(failure) => {
            output::error(&failure.to_string());
            failure::exit_code(&failure)
        }
    }
}

fn run(command: Command) -> Result<(), Failure> {
    match command {
        Command::Demo(options) => commands::demo(&options),
        Command::Simulate(options) => commands::simulate(&options),
        Command::Design(options) => commands::design(&options),
        Command::Inspect(options) => commands::inspect(&options),
        Command::Convert(options) => commands::convert(&options),
        Command::Estimate(options) => commands::estimate(&options),
        Command::Watch(options) => commands::watch(&options),
        Command::Fit(options) => commands::fit(&options),
        Command::Init(options) => commands::init(&options),
        Command::Reproduce(options) => commands::reproduce(&options),
        Command::Bench(options) => commands::bench(&options),
        Command::Study(options) => commands::study(&options),
        Command::Merge(options) => commands::merge(&options),
        Command::ErrorBound(options) => commands::error_bound(&options),
        Command::Sensitivity(options) => commands::sensitivity(&options),
        Command::WorstCase(options) => commands::worst_case(&options),
        Command::Compare(options) => commands::compare(&options),
        Command::Check(options) => commands::check(&options),
        Command::Export(options) => commands::export(&options),
        Command::Completions(options) => commands::completions(&options),
        Command::Man(options) => commands::man(&options),
    }
}
