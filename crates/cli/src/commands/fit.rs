//! `wetclutch fit`.

use std::path::{Path, PathBuf};

use config::{Kind, Source};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;
use trace::ShownPath as _;
use trace::shown_units::{sentence, with_unit};
use wetclutch::fitted::{MapChange, ReportRow};
use wetclutch::{FitOptions, FitProgress, Fitted, LogInput, VehicleFile, fit as fitted, read_sensors};

use crate::args::Fit;
use crate::commands::assumed::{detail_of_map, detail_of_vehicle};
use crate::commands::logs_of::logs_of;
use crate::commands::page::{check_page, write_html};
use crate::commands::written::{head, replaces_only};
use crate::commands::{channel_map_of_car, check_output, is_same_file, not_an_input, write_text};
use crate::failure::Failure;
use crate::output;

/// How the adaptation table begins.
const ADAPTATION_TITLES: &str = "element,from_gear,to_gear,role,oil_from_degc";
/// The first line of a channel map that a fit has written.
const MAP_MARK: &str = "# Written by `wetclutch fit`, with the delays, scales and zero offsets that it found: ";

pub(crate) fn fit(options: &Fit) -> Result<(), Failure> {
    check_output(Some(&options.output))?;
    let outputs = [Some(&options.output), options.adaptation_table.as_ref(), options.write_map.as_ref()];
    let log_files = logs_of(&options.logs, &outputs.into_iter().flatten().collect::<Vec<_>>())?;
    let inputs = || {
        let files = log_files.iter().chain(&options.sensors).chain([&options.vehicle]);
        files.chain(options.mapping.files())
    };
    not_an_input(Some(&options.output), inputs())?;
    check_page(&options.page, inputs())?;
    replaces_only("vehicle file", &options.output, is_vehicle_file)?;
    check_map(options, inputs())?;
    check_table(options, inputs())?;
    let vehicle = VehicleFile::read(&options.vehicle)?;
    let how = FitOptions {
        sensors: options.sensors.as_deref().map(read_sensors).transpose()?,
        output: Some(options.output.clone()),
        with_page: options.page.page.is_some(),
        oil_step_k: options.adaptation_table.as_ref().map(|_| options.oil_step),
        interrupt: None,
    };
    let map = channel_map_of_car(&options.mapping, vehicle.wheel_radius_m())?;
    let logs: Vec<LogInput<'_>> = log_files.iter().map(|path| LogInput { path, memory: None, map: &map }).collect();
    detail_of_vehicle(&vehicle);
    detail_of_map(&map);
    let bar = progress();
    let mut before = String::new();
    let mut show = |at: FitProgress<'_>| {
        let stage = stage(at);
        if stage != before {
            output::detail(|| stage.clone());
            before = stage;
        }
        bar.set_message(at.to_string());
        bar.tick();
    };
    let found = fitted(&vehicle, &logs, &how, &mut show, &mut |note| {
        bar.suspend(|| output::note(note));
    });
    bar.finish_and_clear();
    let found = found?;
    // Nobody has to read the report to its end.
    write_text(&options.output, found.vehicle.text())?;
    let left_out = write_map(options, &found)?;
    write_table(options, &found)?;
    if options.json {
        print_json(options, &found)?;
    } else {
        table(&found.parameters)?;
        found.channels.iter().chain(&found.statements).try_for_each(|line| output::line(&sentence(line)))?;
    }
    report_file(options, &found);
    report_map(options, &found, &left_out);
    report_table(options, &found);
    found.page.map_or(Ok(()), |page| write_html(&options.page, &page))
}

/// Checks the new channel map before the work starts.
fn check_map<'a>(options: &'a Fit, inputs: impl Iterator<Item = &'a PathBuf>) -> Result<(), Failure> {
    let Some(new) = &options.write_map else { return Ok(()) };
    if [Some(&options.output), options.page.page.as_ref()].into_iter().flatten().any(|other| is_same_file(other, new)) {
        let message = format!(
            "{}: this is another output of this command\nhint: choose another name after --write-map",
            new.shown()
        );
        return Err(Failure::Input(message));
    }
    check_output(Some(new))?;
    not_an_input(Some(new), inputs)?;
    replaces_only("channel map of a fit", new, |path| head(path).starts_with(MAP_MARK))
}

/// Writes the channel map with what was found, and returns what it does not have.
fn write_map(options: &Fit, found: &Fitted) -> Result<Vec<String>, Failure> {
    let (Some(given), Some(new)) = (&options.mapping.map, &options.write_map) else { return Ok(Vec::new()) };
    let text = trace::read_text(given).map_err(|error| Failure::Input(format!("{}: {error}", given.shown())))?;
    // The line of an earlier fit.
    let text = text.strip_prefix(MAP_MARK).and_then(|text| text.split_once('\n')).map_or(&*text, |(_, below)| below);
    let changed = found.changed_map(given, text, new)?;
    write_text(new, &format!("{MAP_MARK}{}\n{}", given.shown(), changed.text))?;
    Ok(changed.left_out)
}

/// Reports what the new channel map has.
fn report_map(options: &Fit, found: &Fitted, left_out: &[String]) {
    let Some(new) = &options.write_map else { return };
    let has = match found.map_changes.len() {
        0 => "nothing to change in it",
        _ => "with the delays, scales and zero offsets that were found",
    };
    output::note(&format!("channel map, {has}: {}", new.shown()));
    left_out.iter().for_each(|reason| output::note(&format!("warning: {}: {reason}", new.shown())));
}

/// Checks the adaptation table before the work starts.
fn check_table<'a>(options: &'a Fit, inputs: impl Iterator<Item = &'a PathBuf>) -> Result<(), Failure> {
    let Some(table) = &options.adaptation_table else { return Ok(()) };
    let others = [Some(&options.output), options.page.page.as_ref(), options.write_map.as_ref()];
    if others.into_iter().flatten().any(|other| is_same_file(other, table)) {
        let message = format!(
            "{}: this is another output of this command\nhint: choose another name after --adaptation-table",
            table.shown()
        );
        return Err(Failure::Input(message));
    }
    check_output(Some(table))?;
    not_an_input(Some(table), inputs)?;
    replaces_only("adaptation table", table, |path| head(path).starts_with(ADAPTATION_TITLES))
}

/// Writes the adaptation table.
fn write_table(options: &Fit, found: &Fitted) -> Result<(), Failure> {
    let Some(table) = &options.adaptation_table else { return Ok(()) };
    let text = found.adaptation_table().csv()?;
    trace::write_whole(table, |writer| writer.write_all(&text)).map_err(|error| Failure::writing(table, &error))
}

/// Reports what the adaptation table has.
fn report_table(options: &Fit, found: &Fitted) {
    let (Some(table), Some(adaptations)) = (&options.adaptation_table, &found.adaptations) else { return };
    let rows = &adaptations.rows;
    let open = rows.iter().filter(|row| !row.lacks.is_empty()).count();
    let mut oil: Vec<[f64; 2]> = rows.iter().filter_map(|row| row.oil_degc).collect();
    oil.dedup();
    let is_without_oil = oil.is_empty();
    let oil = match oil.as_slice() {
        [] => "without oil temperatures".to_owned(),
        [one] => format!("oil of {}", degrees(*one)),
        [first, .., last] => format!("oil of {} in {} steps", degrees([first[0], last[1]]), oil.len()),
    };
    output::note(&format!(
        "adaptation table, {oil}: {}; {open} of {} rows lack data, as column `lacks` says",
        table.shown(),
        rows.len()
    ));
    let without = rows.iter().filter(|row| row.oil_degc.is_none() && row.shift.is_some()).map(|row| row.shifts).max();
    if let (Some(1..), false) = (without, is_without_oil) {
        output::note(&format!(
            "warning: {}: some shifts have no oil temperature between -60 and 200 degC, and rows of their own\nhint: check the channel `oil_temperature` and its unit",
            table.shown()
        ));
    }
    if found.kept.is_some() {
        output::note(&format!(
            "warning: {}: the fit of all shifts is not accepted, and its corrections of the channels are in this table\nhint: use it after the reason is known",
            table.shown()
        ));
    }
}

/// Temperatures for people.
fn degrees([low, high]: [f64; 2]) -> String {
    format!("{low} to {high} degC")
}

/// The stage of the work, without how far it is.
fn stage(at: FitProgress<'_>) -> String {
    match at {
        FitProgress::Reading { log, .. } => format!("reading {}", log.shown()),
        FitProgress::Fitting { shifts, .. } => format!("fitting {shifts} shifts"),
        FitProgress::Adapting { .. } => "fitting the adaptation table".to_owned(),
        FitProgress::Validating => at.to_string(),
    }
}

/// Prints what was found in JSON: numbers in SI units.
fn print_json(options: &Fit, found: &Fitted) -> Result<(), Failure> {
    let parameter = |row: &ReportRow| {
        json!({
            "name": row.name,
            "unit": row.measure.unit(),
            "value": row.value,
            "lower": row.interval[0],
            "upper": row.interval[1],
            "deviation_after_over_before": row.fraction,
            "verdict": row.verdict.name(),
        })
    };
    let change = |change: &MapChange| {
        json!({
            "signal": change.channel.name(),
            "key": change.key.name(),
            "unit": change.key.unit(),
            "value": change.value,
            "standard_deviation": change.sd,
        })
    };
    output::json(&json!({
        "vehicle": options.vehicle.shown().to_string(),
        "fitted": options.output.shown().to_string(),
        "shifts": found.shifts,
        "not_used": found.not_used,
        "given_values_kept_because": found.kept,
        "adaptation_table": options.adaptation_table.as_ref().map(|table| table.shown().to_string()),
        "parameters": found.parameters.iter().map(parameter).collect::<Vec<_>>(),
        "channel_map": found.map_changes.iter().map(change).collect::<Vec<_>>(),
        "statements": found.statements,
    }))
}

/// Reports what the file has, and of how many shifts, or why it has the given values.
fn report_file(options: &Fit, found: &Fitted) {
    let output = options.output.shown();
    let shifts = if found.shifts == 1 { "1 shift".to_owned() } else { format!("{} shifts", found.shifts) };
    output::note(&match &found.kept {
        None => format!("fitted to {shifts}: {output}"),
        Some(reason) => format!(
            "warning: the given values are kept: {}. {output} is the given file with this reason in its first line; do not use other values \
             before the reason is known",
            sentence(reason)
        ),
    });
}

fn is_vehicle_file(path: &Path) -> bool {
    let kind = Source::read(path).and_then(|source| source.kind());
    kind.is_ok_and(|kind| matches!(kind, Kind::Vehicle | Kind::Car))
}

fn table(rows: &[ReportRow]) -> Result<(), Failure> {
    let titles = ["", "value", "95 %", "after / before", ""].map(str::to_owned).to_vec();
    let cells = rows.iter().map(|row| {
        let verdict = format!(" {}", row.verdict.name());
        let [value, interval] = [row.value_text(), row.interval_text()].map(with_unit);
        vec![row.name.clone(), value, interval, format!("{:.2}", row.fraction), verdict]
    });
    Ok(output::table(1, titles, cells.collect())?)
}

/// A line on standard error that says what is being done; nothing if standard error is not a terminal.
fn progress() -> ProgressBar {
    let bar = ProgressBar::with_draw_target(None, output::progress_target());
    // The template is a constant.
    if let Ok(style) = ProgressStyle::with_template("{spinner} fit: {msg}  {elapsed}") {
        bar.set_style(style);
    }
    bar
}
