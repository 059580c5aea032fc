//! `wetclutch study` of a car with any gearbox.

use std::path::Path;

use car::ElementErrors;
use config::{CarStudy, CarStudyRuns, significant};
use report::matrix_page::{kind_rows, not_driven};
use serde_json::json;
use study::gearbox::campaign::{CarCampaign, CarSummary};
use study::gearbox::matrix::{Matrix, MatrixCounts, Pooled};
use study::gearbox::tour;
use trace::ShownPath as _;
use trace::quantity;
use wetclutch::studies::bench_sensors;

use super::cars_page::sheet;
use super::part::{Part, lock, merged};
use crate::args::{Merge, StudyOptions};
use crate::browser;
use crate::commands::car::{describe_car, warn_of_slipping};
use crate::commands::{warn_without_effect, writable, write_text};
use crate::failure::Failure;
use crate::output;

/// The name of the page.
const PAGE: &str = "study.html";

pub(super) fn study(options: &StudyOptions) -> Result<(), Failure> {
    if options.run.is_some() {
        let message = "--run is for a study of one shift\nhint: `wetclutch demo --vehicle CAR --drive DRIVE --seed N` shows one car with every shift";
        return Err(Failure::Input(message.to_owned()));
    }
    let _lock = lock(&options.output)?;
    writable(&options.output, &["runs.csv", "runs.parquet", PAGE])?;
    let campaign = CarCampaign::new(CarStudy::read(&options.study)?, &bench_sensors()?)?;
    warn_of_slipping(&campaign.study.car);
    warn_of_exceeded(&campaign);
    let not_driven = not_driven(&tour::not_driven(&campaign.study.car)?, &campaign.study.car);
    not_driven.iter().for_each(|sentence| output::note(&format!("warning: {sentence}")));
    let part = Part { campaign: &campaign, folder: &options.output, shard: options.shard };
    let mut summary = campaign.summary();
    part.make(options, |row| campaign.push(&mut summary, row))?;
    finish(&part, &summary, (options.json, options.open.is_wanted))
}

pub(super) fn merge(options: &Merge) -> Result<(), Failure> {
    let campaign = CarCampaign::new(CarStudy::read(&options.study)?, &bench_sensors()?)?;
    let mut summary = campaign.summary();
    let (whole, _lock) = merged(&campaign, options, |row| campaign.push(&mut summary, row))?;
    finish(&whole, &summary, (options.json, options.open.is_wanted))
}

/// Warns of sampled cars beyond the error bounds of the file.
fn warn_of_exceeded(campaign: &CarCampaign) {
    let exceeded = campaign.exceeded();
    if !exceeded.is_empty() {
        output::note(&format!(
            "warning: [errors] of the study exceeds the error bounds of the vehicle file: {}. The guaranteed ranges are those of the file and need \
             not hold for these cars\nhint: give the bounds under [clutch.NAME.error_bounds] of the vehicle file",
            exceeded.join("; ")
        ));
    }
}

/// Writes everything that is computed from the rows, and prints it, or as JSON; opens the page.
fn finish(part: &Part<'_, CarCampaign>, summary: &CarSummary, (json, opens): (bool, bool)) -> Result<(), Failure> {
    part.write_parquet()?;
    let matrix = part.campaign.matrix(summary);
    let counts = Pooled::of(&matrix.rows, |_| true).counts;
    let sentences = sentences(summary, &counts);
    let page = (summary.runs > 0).then(|| part.folder.join(PAGE));
    if let Some(page) = &page {
        let warning = summary.failure.as_ref().map(|failure| format!("warning: the first car that failed: {failure}"));
        let sentences = sentences.iter().cloned().chain(warning).collect();
        write_text(page, &sheet(&part.campaign.study, &matrix, summary, sentences).html()?)?;
    } else if opens {
        warn_without_effect("--open", "there is no page without a run");
    }
    if json {
        print_json(part, summary, &counts, page.as_deref())?;
    } else {
        print(part, summary, &matrix, &sentences)?;
        if let Some(page) = &page {
            output::line(&format!("page: {}", page.shown()))?;
        }
    }
    page.iter().for_each(|page| browser::open_if(opens, page));
    Ok(())
}

/// The whole study in sentences.
fn sentences(summary: &CarSummary, counts: &MatrixCounts) -> Vec<String> {
    vec![
        format!("{} cars, {} shifts, {} cars failed", summary.runs, summary.shifts(), summary.failed),
        format!(
            "above the open loop by more than {}: {} of {} shifts; by phases {} of {}",
            quantity(1.0, "N m", 0),
            counts.runs_above,
            counts.compared_runs,
            counts.above,
            counts.compared
        ),
        format!(
            "outside their guaranteed ranges: {} of {} pressures and torques of both clutches",
            wetclutch::grouped(counts.outside),
            wetclutch::grouped(counts.values)
        ),
    ]
}

fn print(
    part: &Part<'_, CarCampaign>,
    summary: &CarSummary,
    matrix: &Matrix,
    sentences: &[String],
) -> Result<(), Failure> {
    output::line(&format!("{}\n", sentences[0]))?;
    if let Some(failure) = &summary.failure {
        output::note(&format!("warning: the first car that failed: {failure}"));
    }
    output::line(&format!(
        "RMS error of the clutch torque, relative to the open loop, and both errors: filter / open loop. Of the clutch that\n\
         controls the inertia phase; left out where the open loop errs by less than {}\n",
        quantity(2.0, "N m", 0)
    ))?;
    let (titles, rows) = kind_rows(matrix);
    output::table(2, titles, rows)?;
    output::line(&format!("\n{}", sentences[1..].join("\n")))?;
    output::line(&format!("\ntable: {}", part.table().shown()))?;
    Ok(())
}

/// Prints cars, shifts and the table as JSON.
fn print_json(
    part: &Part<'_, CarCampaign>,
    summary: &CarSummary,
    counts: &MatrixCounts,
    page: Option<&Path>,
) -> Result<(), Failure> {
    output::json(&json!({
        "table": part.table().shown().to_string(),
        "page": page.map(|page| page.shown().to_string()),
        "cars": summary.runs,
        "cars_failed": summary.failed,
        "first_failure": summary.failure,
        "shifts": summary.shifts(),
        "shifts_compared": counts.compared_runs,
        "shifts_above_open_loop": counts.runs_above,
        "values": counts.values,
        "values_outside_range": counts.outside,
    }))
}

/// Prints what a study file of a car describes.
pub(crate) fn describe(path: &Path) -> Result<(), Failure> {
    let study = CarStudy::read(path)?;
    let what = match &study.what {
        CarStudyRuns::Drive(drive) => format!("the drive \"{}\", {:.0} s", drive.name, drive.duration_s()),
        CarStudyRuns::Shifts(pairs) => format!("{} shifts, with power and without", pairs.len()),
    };
    let campaign = CarCampaign::new(study, &bench_sensors()?)?;
    let (study, sampled) = (&campaign.study, campaign.sampled());
    output::line(&format!(
        "study {} \"{}\": {} cars, each {what}; friction within {} %, gain of the valves {} %, capacity of the converter {} %",
        study.name,
        study.title,
        study.runs,
        significant(100.0 * sampled.widest(ElementErrors::friction)),
        significant(100.0 * sampled.widest(ElementErrors::valve_gain)),
        significant(100.0 * sampled.converter),
    ))?;
    describe_car(&study.car)?;
    warn_of_slipping(&study.car);
    warn_of_exceeded(&campaign);
    Ok(())
}
