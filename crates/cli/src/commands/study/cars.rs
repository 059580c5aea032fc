//! `wetclutch study` of a car with any gearbox.

use std::path::Path;

use car::ElementErrors;
use config::{CarStudy, CarStudyRuns, significant};
use report::matrix_page::{kind_rows, not_driven};
use serde_json::json;
use study::gearbox::campaign::{CarCampaign, CarSummary};
use study::gearbox::matrix::{MatrixCounts, Pooled};
use study::gearbox::tour;
use trace::ShownPath as _;
use trace::quantity;
use wetclutch::studies::bench_sensors;

use super::part::{Part, lock, merged};
use crate::args::{Merge, StudyOptions};
use crate::commands::car::{describe_car, warn_of_slipping};
use crate::commands::{warn_without_effect, writable};
use crate::failure::Failure;
use crate::output;

pub(super) fn study(options: &StudyOptions) -> Result<(), Failure> {
    if options.run.is_some() {
        let message = "--run has no effect on a study of a car with a gearbox\nhint: `wetclutch demo --vehicle CAR --drive DRIVE --seed N` shows one car with every shift";
        return Err(Failure::Input(message.to_owned()));
    }
    warn_of_open(options.open.is_wanted);
    let _lock = lock(&options.output)?;
    writable(&options.output, &["runs.csv", "runs.parquet"])?;
    let campaign = CarCampaign::new(CarStudy::read(&options.study)?, &bench_sensors()?)?;
    warn_of_slipping(&campaign.study.car);
    warn_of_exceeded(&campaign);
    let not_driven = not_driven(&tour::not_driven(&campaign.study.car)?, &campaign.study.car);
    not_driven.iter().for_each(|sentence| output::note(&format!("warning: {sentence}")));
    let part = Part { campaign: &campaign, folder: &options.output, shard: options.shard };
    let mut summary = campaign.summary();
    part.make(options, |row| campaign.push(&mut summary, row))?;
    finish(&part, &summary, options.json)
}

pub(super) fn merge(options: &Merge) -> Result<(), Failure> {
    warn_of_open(options.open.is_wanted);
    let campaign = CarCampaign::new(CarStudy::read(&options.study)?, &bench_sensors()?)?;
    let mut summary = campaign.summary();
    let (whole, _lock) = merged(&campaign, options, |row| campaign.push(&mut summary, row))?;
    finish(&whole, &summary, options.json)
}

fn warn_of_open(is_wanted: bool) {
    if is_wanted {
        warn_without_effect("--open", "a study of a car with a gearbox has a table and no page");
    }
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

fn finish(part: &Part<'_, CarCampaign>, summary: &CarSummary, json: bool) -> Result<(), Failure> {
    part.write_parquet()?;
    let matrix = part.campaign.matrix(summary);
    let counts = Pooled::of(&matrix.rows, |_| true).counts;
    if json {
        return print_json(part, summary, &counts);
    }
    output::line(&format!("{} cars, {} shifts, {} cars failed\n", summary.runs, summary.shifts(), summary.failed))?;
    if let Some(failure) = &summary.failure {
        output::note(&format!("warning: the first car that failed: {failure}"));
    }
    output::line(&format!(
        "RMS error of the clutch torque, relative to the open loop, and both errors: filter / open loop. Of the clutch that\n\
         controls the inertia phase; left out where the open loop errs by less than {}\n",
        quantity(2.0, "N m", 0)
    ))?;
    let (titles, rows) = kind_rows(&matrix);
    output::table(2, titles, rows)?;
    output::line(&format!(
        "\nabove the open loop by more than {}: {} of {} shifts; by phases {} of {}\n\
         outside their guaranteed ranges: {} of {} pressures and torques of both clutches",
        quantity(1.0, "N m", 0),
        counts.runs_above,
        counts.compared_runs,
        counts.above,
        counts.compared,
        wetclutch::grouped(counts.outside),
        wetclutch::grouped(counts.values),
    ))?;
    output::line(&format!("\ntable: {}", part.table().shown()))?;
    Ok(())
}

/// Prints cars, shifts and the table as JSON.
fn print_json(part: &Part<'_, CarCampaign>, summary: &CarSummary, counts: &MatrixCounts) -> Result<(), Failure> {
    output::json(&json!({
        "table": part.table().shown().to_string(),
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
