//! What a package installs beside the program: completions for shells, and manual pages.

use clap::CommandFactory as _;

use super::{writable, write_text};
use crate::args::{Arguments, Completions, Man};
use crate::failure::Failure;
use crate::output;

/// Name of the program.
const PROGRAM: &str = "wetclutch";

/// Prints completions for a shell.
pub(crate) fn completions(options: &Completions) -> Result<(), Failure> {
    let mut text = Vec::new();
    clap_complete::generate(options.shell, &mut Arguments::command(), PROGRAM, &mut text);
    Ok(output::raw_line(String::from_utf8_lossy(&text).trim_end())?)
}

/// Writes the manual pages of the program and of its commands.
pub(crate) fn man(options: &Man) -> Result<(), Failure> {
    writable(&options.folder, &[])?;
    let mut program = Arguments::command().disable_help_subcommand(true);
    program.build();
    let shown = program.get_subcommands().filter(|command| !command.is_hide_set());
    for command in shown.cloned().chain([program.clone()]) {
        let name = command.get_display_name().unwrap_or(PROGRAM).replace(' ', "-");
        let mut page = Vec::new();
        clap_mangen::Man::new(command.version(env!("CARGO_PKG_VERSION"))).render(&mut page)?;
        write_text(&options.folder.join(format!("{name}.1")), &String::from_utf8_lossy(&page))?;
    }
    Ok(())
}
