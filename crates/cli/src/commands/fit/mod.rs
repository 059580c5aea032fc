//! `wetclutch fit`.

mod gearbox;

use std::path::Path;

use car::Vehicle;
use config::{Kind, Source, VehicleFile};
use fit::{Collected, FitError, HeldOut, ReadingAges, ReportRow, SHIFTS_MAX, ShiftRecord};
use indicatif::{ProgressBar, ProgressStyle};
use report::sheet::{Part, Sheet};
use serde_json::json;
use trace::ShownPath as _;

use crate::args::Fit;
use crate::commands::page::{check_page, write_page};
use crate::commands::written::replaces_only;
use crate::commands::{channel_map_of_car, check_output, not_an_input, shell_quoted, write_text};
use crate::failure::Failure;
use crate::output;
use wetclutch::read_sensors as sensors;

/// Fewer shifts are all fitted.
const MIN_FOR_HELD_OUT: usize = 8;
/// Minimum number of shifts that are held out.
const HELD_OUT_MIN: usize = 3;
/// Reasons that are printed one by one.
const REASONS_MAX: usize = 10;

pub(crate) fn fit(options: &Fit) -> Result<(), Failure> {
    check_output(Some(&options.output))?;
    let inputs = || {
        let files = options.logs.iter().chain(&options.sensors).chain([&options.vehicle]);
        files.chain(options.mapping.files())
    };
    not_an_input(Some(&options.output), inputs())?;
    check_page(&options.page, inputs())?;
    replaces_only("vehicle file", &options.output, is_vehicle_file)?;
    let source = Source::read(&options.vehicle)?;
    if source.kind()? == Kind::Car {
        return gearbox::fit(options);
    }
    let vehicle = VehicleFile::from_source(source)?;
    let ages = match options.sensors.as_deref() {
        Some(path) => ReadingAges::of(&sensors(path)?),
        None => ReadingAges::default(),
    };
    let bar = progress();
    let collected = collect(options, &vehicle, &bar)?;
    for note in &collected.notes {
        output::note(&format!("warning: {note}"));
    }
    reasons("not used", &collected.skipped);
    let kinds = collected.kinds.statement();
    let (fitted_shifts, held_out) = divided(collected.shifts);
    if fitted_shifts.is_empty() {
        bar.finish_and_clear();
        return Err(no_shift(&vehicle, options, &kinds));
    }
    let found = fit::fit(&vehicle, &fitted_shifts, &collected.driving, ages, &mut |progress| {
        bar.set_message(format!("{} shifts, iteration {}", progress.shifts, progress.iteration + 1));
        bar.tick();
    })?;
    bar.set_message("checking on shifts that were held out");
    reasons("not fitted", &found.unusable);
    let names: Vec<String> = options.logs.iter().map(|log| log.shown().to_string()).collect();
    let fitted = found.vehicle_file(&vehicle, &names.join(", "))?;
    let checked = found.validate(&vehicle, &fitted, &held_out, ages)?;
    bar.finish_and_clear();
    let against = found.reason_against(checked.as_ref());
    let written = match &against {
        None => fitted,
        Some(reason) => found.kept_file(&vehicle, reason)?,
    };
    // Nobody has to read the report to its end.
    write_text(&options.output, &written.source.text)?;
    let checked = said_of(checked.as_ref());
    let sentences = [found.statements(), vec![kinds.clone(), checked.clone()]].concat();
    if options.json {
        print_json(options, &found.report(), &sentences, found.shifts, against.as_deref())?;
    } else {
        print(&found)?;
        output::line(&kinds)?;
        output::line(&checked)?;
    }
    said_of_file(options, found.shifts, against.as_deref());
    page(
        options,
        &vehicle.name,
        (report::fit_page::intervals(&found), sentences),
        against,
        &[&vehicle.source, &written.source],
    )
}

/// Writes the page, if one is wanted: intervals, and what was found.
fn page(
    options: &Fit,
    name: &str,
    (intervals, mut sentences): (Part, Vec<String>),
    against: Option<String>,
    sources: &[&Source],
) -> Result<(), Failure> {
    let kept = against.map(|reason| format!("warning: the given values are kept: {reason}"));
    sentences.extend(kept);
    write_page(&options.page, || Sheet {
        name,
        title: "fit",
        lead: format!(
            "fitted to {}",
            options.logs.iter().map(|log| log.shown().to_string()).collect::<Vec<_>>().join(", ")
        ),
        sentences,
        parts: vec![intervals],
        sources: sources.to_vec(),
    })
}

/// Prints what was found in JSON: numbers in SI units.
fn print_json(
    options: &Fit,
    rows: &[ReportRow],
    statements: &[String],
    shifts: usize,
    against: Option<&str>,
) -> Result<(), Failure> {
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
    output::json(&json!({
        "vehicle": options.vehicle.shown().to_string(),
        "fitted": options.output.shown().to_string(),
        "shifts": shifts,
        "given_values_kept_because": against,
        "parameters": rows.iter().map(parameter).collect::<Vec<_>>(),
        "statements": statements,
    }))
}

/// Says what the file has, and of how many shifts, or why it has the given values.
fn said_of_file(options: &Fit, shifts: usize, against: Option<&str>) {
    let output = options.output.shown();
    let shifts = if shifts == 1 { "1 shift".to_owned() } else { format!("{shifts} shifts") };
    output::note(&match against {
        None => format!("fitted to {shifts}: {output}"),
        Some(reason) => format!(
            "warning: the given values are kept: {reason}. {output} is the given file with this reason in its first line; do not use other values \
             before the reason is known"
        ),
    });
}

/// The fitted values, the scatter of each channel, and what these logs tell.
fn print(found: &fit::Fit) -> Result<(), Failure> {
    table(&found.report())?;
    for (channel, scale, gain) in &found.channels {
        let (scale, unit) = if *channel == fit::Channel::Pressure { (1e-3 * scale, "kPa") } else { (*scale, "rad/s") };
        output::line(&format!("{}: one-step error {scale:.3} {unit}, g {gain:.2}", channel.name()))?;
    }
    for statement in found.statements() {
        output::line(&statement)?;
    }
    Ok(())
}

fn is_vehicle_file(path: &Path) -> bool {
    let kind = Source::read(path).and_then(|source| source.kind());
    kind.is_ok_and(|kind| matches!(kind, Kind::Vehicle | Kind::Car))
}

/// The shifts of all logs.
fn collect(options: &Fit, vehicle: &VehicleFile, bar: &ProgressBar) -> Result<Collected, Failure> {
    let map = channel_map_of_car(&options.mapping, vehicle.road.wheel_radius_m)?;
    let mut all = Collected::default();
    for log in &options.logs {
        bar.set_message(format!("reading {}", log.shown()));
        bar.tick();
        let mut one = fit::collect(log, &map, vehicle)?;
        one.notes.iter_mut().for_each(|note| *note = format!("{}: {note}", log.shown()));
        all.add(one);
    }
    Ok(all)
}

/// Shifts to fit, and shifts that are held out: the last fifth. Of more than a fit can use, some are left out evenly.
fn divided(mut shifts: Vec<ShiftRecord>) -> (Vec<ShiftRecord>, Vec<ShiftRecord>) {
    let count = shifts.len();
    let held_out =
        if count < MIN_FOR_HELD_OUT { Vec::new() } else { shifts.split_off(count - HELD_OUT_MIN.max(count / 5)) };
    let some = SHIFTS_MAX.min(shifts.len());
    ((0..some).map(|i| shifts[i * shifts.len() / some].clone()).collect(), held_out)
}

fn no_shift(vehicle: &Vehicle, options: &Fit, kinds: &str) -> Failure {
    let [from, to] = [vehicle.shift.ratio_offgoing(), vehicle.shift.ratio_oncoming()];
    FitError::Input(format!(
        "the logs have no power-on upshift from ratio {from:.3} to {to:.3} that can be fitted; {kinds}\n\
         hint: `wetclutch inspect {} --shifts --ratios {from:.3},{to:.3}` with the same map lists the shifts that it finds",
        options.logs.first().map(|log| shell_quoted(log)).unwrap_or_default()
    ))
    .into()
}

fn reasons(what: &str, reasons: &[String]) {
    for reason in reasons.iter().take(REASONS_MAX) {
        output::note(&format!("{what}: {reason}"));
    }
    if let Some(more @ 1..) = reasons.len().checked_sub(REASONS_MAX) {
        output::note(&format!("{what}: {more} more"));
    }
}

fn table(rows: &[ReportRow]) -> Result<(), Failure> {
    let titles = ["", "value", "95 %", "after / before", ""].map(str::to_owned).to_vec();
    let cells = rows.iter().map(|row| {
        let verdict = format!(" {}", row.verdict.name());
        vec![row.name.clone(), row.value_text(), row.interval_text(), format!("{:.2}", row.fraction), verdict]
    });
    Ok(output::table(1, &[titles].into_iter().chain(cells).collect::<Vec<_>>())?)
}

/// The result on held-out shifts, in words.
fn said_of(checked: Option<&HeldOut>) -> String {
    let Some(checked) = checked else { return nothing_held_out() };
    let [given, fitted] = checked.turbine_rad_s;
    let mut text = format!(
        "{} shifts held out: one-step error of the turbine speed {given:.3} rad/s with the given file, {fitted:.3} with the fitted one",
        checked.shifts
    );
    if let Some([given, fitted]) = checked.pressure_pa.map(|errors| errors.map(|error| 1e-3 * error)) {
        text += &format!("; pressure of the valve maps against the measured one {given:.2} kPa, {fitted:.2} kPa");
        if fitted > given {
            text += " (worse with the fitted file: check scale, unit and place of the pressure sensor)";
        }
    }
    text
}

fn nothing_held_out() -> String {
    format!("no shift is held out: fewer than {MIN_FOR_HELD_OUT} can be used, so nothing checks this fit")
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
