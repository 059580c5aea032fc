//! Where estimates are written.

use std::path::{Path, PathBuf};

use trace::{ShownPath as _, TableFormat};

use crate::args::{self, FormatChoice};
use crate::commands::warn_without_effect;
use crate::failure::Failure;

/// Endings of names whose files are CSV.
const TEXT: [&str; 4] = ["csv", "txt", "tsv", "dat"];

/// Refuses an output whose name asks for what is not written.
pub(super) fn check_name(options: &args::Estimate) -> Result<(), Failure> {
    let Some(output) = &options.output else {
        return match options.format {
            None | Some(FormatChoice::Csv) => Ok(()),
            Some(format) => {
                let ending = format.ending();
                let message =
                    format!("--format {ending} needs a file\nhint: name one with -o, such as estimate.{ending}");
                Err(Failure::Input(message))
            }
        };
    };
    if output == Path::new("-") {
        let message = "-o -: standard output is where an estimate goes without -o\nhint: leave -o out";
        return Err(Failure::Input(message.to_owned()));
    }
    // A folder gets files with the ending of their format; a device or pipe has no name of its own.
    if options.logs.len() > 1 || std::fs::metadata(output).is_ok_and(|there| !there.is_file()) {
        return Ok(());
    }
    let ending = output.extension().map(|ending| ending.to_string_lossy().to_lowercase());
    let by_name = TableFormat::of(output);
    if let Some(ending) = ending.filter(|ending| by_name == TableFormat::Csv && !TEXT.contains(&ending.as_str())) {
        return Err(Failure::Input(format!(
            "{}: no table is written as .{}\nhint: estimates are CSV (.csv), Parquet (.parquet) or MDF (.mf4)",
            output.shown(),
            ending.escape_debug()
        )));
    }
    match options.format {
        Some(format) if TableFormat::from(format) != by_name => Err(Failure::Input(format!(
            "{}: the name is not that of a file in --format {}\nhint: the ending sets the format; leave --format out, or end the name in .{1}",
            output.shown(),
            format.ending()
        ))),
        _ => Ok(()),
    }
}

/// Warns of a format that says what the name of the one output, or standard output, says already.
pub(super) fn warn_of_format(options: &args::Estimate) {
    let is_folder = options.output.as_ref().is_some_and(|output| options.logs.len() > 1 || output.is_dir());
    if options.format.is_some() && !is_folder {
        warn_without_effect("--format", "it is for files in a folder; the ending of a file gives its format");
    }
}

/// The files beside an output: the shifts as CSV and JSON, and the page. `drive.csv` has `drive_report.html`. None beside a
/// device or pipe.
pub(super) fn beside(output: &Path) -> Option<[PathBuf; 3]> {
    if std::fs::metadata(output).is_ok_and(|there| !there.is_file()) {
        return None;
    }
    let stem = output.file_stem()?;
    Some(["_shifts.csv", "_shifts.json", "_report.html"].map(|ending| {
        let mut name = stem.to_owned();
        name.push(ending);
        output.with_file_name(name)
    }))
}

/// Removes the files beside an output that an earlier estimate left: they are not of this one, which has no shift.
pub(super) fn remove_old(places: &[PathBuf; 3], mut note: impl FnMut(&str)) -> Result<(), Failure> {
    for old in places.iter().filter(|old| old.is_file()) {
        std::fs::remove_file(old).map_err(|error| Failure::writing(old, &error))?;
        note(&format!("removed: {}, of an earlier estimate", old.shown()));
    }
    Ok(())
}
