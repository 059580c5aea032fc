//! `wetclutch study --run`: one run again, with every signal.

use std::collections::BTreeMap;
use std::path::PathBuf;

use config::toml_number;
use report::shift_figure::observers_of;
use report::tables::{coverage, number, phase_name, quality_rows};
use serde_json::json;
use study::campaign::{Layout, Metric, PHASES, Run};
use study::{Campaign, Row, estimates_trace};
use trace::ShownPath as _;
use trace::units::mpa;

use crate::args::StudyOptions;
use crate::commands::{warn_without_effect, write_text, write_trace};
use crate::failure::Failure;
use crate::output;

/// Makes one run again, writes its signals, and says how it went.
pub(super) fn one_run(campaign: &Campaign, number: u64, options: &StudyOptions) -> Result<(), Failure> {
    if number >= campaign.study.runs {
        return Err(Failure::Input(format!(
            "the study has no run {number}\nhint: its runs are 0 to {}",
            campaign.study.runs - 1
        )));
    }
    if options.threads.is_given() {
        warn_without_effect("--threads", "one run is made");
    }
    let (run, row) = (campaign.run_in_full(number)?, campaign.row(number)?);
    let files = write(campaign, &run, &row, options)?;
    if options.json {
        return print_json(campaign, &row, &files);
    }
    output::line(&format!(
        "run {number} of 0 to {} of study {} \"{}\": {}, seed {}",
        campaign.study.runs - 1,
        campaign.study.name,
        campaign.study.title,
        row.status.name().replace('_', " "),
        row.seed
    ))?;
    factors(campaign, &row)?;
    if let Some(quality) = &run.quality {
        output::line("\nthe shift\n")?;
        let rows = quality_rows(quality).into_iter().map(|(name, value)| vec![name.to_owned(), value]);
        output::list(1, &rows.collect::<Vec<_>>())?;
    }
    if row.status.is_scored() {
        scores(&campaign.layout, &row)?;
    }
    output::line("\nfiles\n")?;
    let files = files.into_iter().map(|(path, what)| vec![path.shown().to_string(), what]);
    Ok(output::list(2, &files.collect::<Vec<_>>())?)
}

/// Prints the run as JSON: its factors, scores as in its row, and files.
fn print_json(campaign: &Campaign, row: &Row, files: &[(PathBuf, String)]) -> Result<(), Failure> {
    let is_number = |name: &String| !["run", "seed", "status"].contains(&name.as_str());
    let names = campaign.layout.header().into_iter().filter(is_number);
    let values: BTreeMap<_, _> = names.zip(&row.numbers).collect();
    output::json(&json!({
        "run": row.run,
        "seed": row.seed,
        "status": row.status.name(),
        "values": values,
        "files": files.iter().map(|(path, _)| path.shown().to_string()).collect::<Vec<_>>(),
    }))
}

/// The values that the study gave to this run.
fn factors(campaign: &Campaign, row: &Row) -> Result<(), Failure> {
    output::line("\nvaried\n")?;
    let titles = ["factor", "key", "value"].map(str::to_owned).to_vec();
    let mut rows = Vec::new();
    for (factor, value) in campaign.study.factors.iter().zip(&row.numbers) {
        rows.push(vec![factor.name.clone(), factor.key.clone(), toml_number(*value)]);
    }
    Ok(output::table(2, titles, rows)?)
}

/// The errors of each observer in both phases.
fn scores(layout: &Layout, row: &Row) -> Result<(), Failure> {
    output::line("\nerrors of the estimates\n")?;
    let head = ["phase", "observer", "pressure RMS MPa", "peak MPa", "torque RMS N m", "in range"];
    let mut rows = Vec::new();
    for (i, phase) in PHASES.into_iter().enumerate() {
        for (observer, name) in layout.observers.iter().enumerate() {
            let score = |metric: Metric| row.numbers[layout.score(observer, i, metric)];
            let inside = score(Metric::Coverage);
            rows.push(vec![
                phase_name(phase).to_owned(),
                name.clone(),
                number(mpa(score(Metric::PressureRms)), 4),
                number(mpa(score(Metric::PressurePeak)), 4),
                number(score(Metric::TorqueRms), 2),
                if inside.is_nan() { "\u{2013}".to_owned() } else { coverage(inside) },
            ]);
        }
    }
    Ok(output::table(2, head.map(str::to_owned).to_vec(), rows)?)
}

/// Writes the signals, the estimates, the figure and the row; the files, each with what is in it.
fn write(campaign: &Campaign, run: &Run, row: &Row, options: &StudyOptions) -> Result<Vec<(PathBuf, String)>, Failure> {
    let at = |name: &str| -> PathBuf { options.output.join(format!("run_{}{name}", row.run)) };
    let trace = at(".csv");
    write_trace(&trace, &run.trace)?;
    let mut files = vec![(trace, "every signal of the simulated shift".to_owned())];
    for observer in &run.observers {
        let estimates = at(&format!("_{}.csv", observer.entry.column()));
        write_trace(&estimates, &estimates_trace(&observer.time_s, &observer.estimates))?;
        files.push((estimates, format!("estimates of {}", observer.entry.name)));
    }
    let figure = at(".svg");
    write_text(&figure, &observers_of(&run.observers, &run.trace, run.quality.as_ref()).svg())?;
    files.push((figure, "truth and estimates, drawn".to_owned()));
    let line = at("_row.csv");
    let header = campaign.layout.header().join(",");
    write_text(&line, &format!("{header}\n{}\n", row.line(&campaign.layout)))?;
    files.push((line, "the row of this run, as runs.csv has it".to_owned()));
    Ok(files)
}
