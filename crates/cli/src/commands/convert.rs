//! `wetclutch convert`.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use logs::convert::{Converted, map_of_converted};
use logs::{ChannelMap, Log};
use serde_json::{Value, json};
use trace::{Cell, ColumnKind, ShownPath as _, TableFormat, TableWriter};

use crate::args::{Convert, FormatChoice};
use crate::commands::written::{head, holds_something, is_forced, replaces_only};
use crate::commands::{channel_map, check_output, not_an_input, warn_without_effect, writable, write_text};
use crate::failure::Failure;
use crate::output;

/// The first line of the map beside a table.
const MARK: &str = "# Written by `wetclutch convert`: the channels of ";

pub(crate) fn convert(options: &Convert) -> Result<(), Failure> {
    let map = channel_map(&options.mapping)?;
    let outputs = outputs(options)?;
    for output in &outputs {
        let map_place = map_beside(output);
        for written in [output, &map_place] {
            not_an_input(Some(written), options.logs.iter().chain(options.mapping.files()))?;
            check_output(Some(written))?;
        }
        replaces_nothing(output)?;
        if !map.channels.is_empty() {
            replaces_only("channel map of a converted log", &map_place, |path| head(path).starts_with(MARK))?;
        }
    }
    let logs = options.logs.iter().zip(&outputs);
    let results: Vec<Value> = logs.map(|(log, output)| convert_log(log, output, &map)).collect::<Result<_, _>>()?;
    if options.json { output::json(&json!({ "logs": results })) } else { Ok(()) }
}

/// Writes the table of a log, and the map for it.
fn convert_log(path: &Path, output: &Path, map: &ChannelMap) -> Result<Value, Failure> {
    let mut log = Log::open(path, &map.open)?.on_threads(wetclutch::available_threads());
    let is_mapped = !map.channels.is_empty();
    let map_text = is_mapped.then(|| map_of_converted(&log, map)).transpose()?;
    let mut rows = if is_mapped { Converted::by_map(&mut log, map)? } else { Converted::of_log(&mut log)? };
    let titles: Vec<String> =
        rows.columns().iter().map(|column| if is_mapped { column.name.clone() } else { column.title() }).collect();
    let failure = |error: std::io::Error| Failure::writing(output, &error);
    let columns = titles.iter().map(|title| (title.as_str(), ColumnKind::Number));
    let mut table = TableWriter::create(output, columns).map_err(failure)?;
    let mut count = 0_u64;
    while let Some((time_s, values)) = rows.next_row()? {
        table.row(time_s, values.iter().map(|value| Cell::Number(*value))).map_err(failure)?;
        count += 1;
    }
    if count == 0 {
        let message = format!("{}: there are no values in it\nhint: check it with `wetclutch inspect`", path.shown());
        return Err(Failure::Input(message));
    }
    table.finish().map_err(failure)?;
    rows.notes().iter().for_each(|note| output::note(&format!("warning: {}: {note}", path.shown())));
    output::note(&format!("{}: {count} rows of {} channels: {}", path.shown(), titles.len(), output.shown()));
    if rows.left_out() > 0 {
        output::note(&format!("{}: {} samples that are not good are left out", path.shown(), rows.left_out()));
    }
    let map_place = map_text.is_some().then(|| map_beside(output));
    if let (Some(text), Some(place)) = (&map_text, &map_place) {
        let name = output.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        write_text(place, &format!("{MARK}{}.\n\n{text}", trace::printable(&name)))?;
        output::note(&format!("channel map of it: {}", place.shown()));
    }
    Ok(json!({
        "log": path.shown().to_string(),
        "output": output.shown().to_string(),
        "map": map_place.map(|place| place.shown().to_string()),
        "rows": count,
        "channels": titles,
        "left_out": rows.left_out(),
    }))
}

/// The table of each log.
fn outputs(options: &Convert) -> Result<Vec<PathBuf>, Failure> {
    if let ([_], false) = (options.logs.as_slice(), options.output.is_dir()) {
        check_ending(options)?;
        if options.format.is_some() {
            warn_without_effect("--format", "it is for files in a folder; the ending of a file gives its format");
        }
        return Ok(vec![options.output.clone()]);
    }
    writable(&options.output, &[])?;
    let ending = options.format.unwrap_or(FormatChoice::Csv).ending();
    let mut taken = HashSet::new();
    options
        .logs
        .iter()
        .map(|log| {
            let stem = log.file_stem().filter(|_| log.as_path() != Path::new("-"));
            let stem = stem.ok_or_else(|| {
                Failure::Input(format!(
                    "{}: this is no file\nhint: name a file after -o for standard input",
                    log.shown()
                ))
            })?;
            let mut name = stem.to_owned();
            name.push(format!(".{ending}"));
            let output = options.output.join(name);
            if taken.insert(output.clone()) {
                return Ok(output);
            }
            Err(Failure::Input(format!(
                "{}: two logs would give this file\nhint: convert them one by one",
                output.shown()
            )))
        })
        .collect()
}

/// Refuses a name whose ending is that of no table, or of another than `--format` says.
fn check_ending(options: &Convert) -> Result<(), Failure> {
    let (output, by_name) = (&options.output, TableFormat::of(&options.output));
    let ending = output.extension().map(|ending| ending.to_string_lossy().to_lowercase());
    let is_known = ending.is_some_and(|ending| ["csv", "parquet", "mf4"].contains(&ending.as_str()));
    if is_known && options.format.is_none_or(|format| TableFormat::from(format) == by_name) {
        return Ok(());
    }
    let asked = options.format.map_or(String::new(), |format| format!(" in --format {}", format.ending()));
    Err(Failure::Input(format!(
        "{}: this is no name of a table{asked}\nhint: end it in .csv, .parquet or .mf4, or name an existing folder",
        output.shown()
    )))
}

/// Refuses to replace any table: it may be a measurement.
fn replaces_nothing(output: &Path) -> Result<(), Failure> {
    if is_forced() || !holds_something(output) {
        return Ok(());
    }
    let message =
        "exists, and a log is never replaced\nhint: choose another name after -o, or remove it; --force replaces it";
    Err(Failure::Input(format!("{}: {message}", output.shown())))
}

/// The channel map beside a table: `drive.csv` has `drive_map.toml`.
fn map_beside(output: &Path) -> PathBuf {
    let mut name = output.file_stem().unwrap_or_default().to_owned();
    name.push("_map.toml");
    output.with_file_name(name)
}
