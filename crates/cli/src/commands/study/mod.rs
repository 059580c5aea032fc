//! `wetclutch study` and `wetclutch merge`.

mod cars;
mod manifest;
mod one_run;
mod part;

use std::path::Path;

use config::{Kind, Source, Study};
use report::StudyPage;
use report::study_page::diverged;
use report::tables::{COMPARED_NAMES, number, phase_name};
use study::campaign::PHASES;
use study::{Campaign, Summary};
use trace::{ShownPath as _, units};
use wetclutch::shell_quoted;

pub(super) use self::cars::describe as describe_cars;
use self::one_run::one_run;
use self::part::{Part, lock, merged};
use crate::args::{Merge, StudyOptions};
use crate::commands::{writable, write_text};
use crate::failure::Failure;
use crate::output;

pub(crate) fn study(options: &StudyOptions) -> Result<(), Failure> {
    if Source::read(&options.study)?.kind()? == Kind::CarStudy {
        return cars::study(options);
    }
    let study = Study::read(&options.study)?;
    if let Some(run) = options.run {
        return one_run(&Campaign::new(study)?, run, options);
    }
    let _lock = lock(&options.output)?;
    writable(&options.output, &["runs.csv", "runs.parquet", "study.html"])?;
    let figures = options.output.join("figures");
    if figures.exists() {
        writable(&figures, &[])?;
    }
    let campaign = Campaign::new(study)?;
    let part = Part { campaign: &campaign, folder: &options.output, shard: options.shard };
    let mut summary = Summary::new(&campaign.study);
    part.make(options, |row| summary.push(row))?;
    finish(&part, &summary, &options.study)
}

pub(crate) fn merge(options: &Merge) -> Result<(), Failure> {
    if Source::read(&options.study)?.kind()? == Kind::CarStudy {
        return cars::merge(options);
    }
    let campaign = Campaign::new(Study::read(&options.study)?)?;
    let mut summary = Summary::new(&campaign.study);
    let (whole, _lock) = merged(&campaign, options, |row| summary.push(row))?;
    finish(&whole, &summary, &options.study)
}

/// Writes everything that is computed from the rows.
fn finish(part: &Part<'_, Campaign>, summary: &Summary, file: &Path) -> Result<(), Failure> {
    let campaign = part.campaign;
    part.write_parquet()?;
    if summary.runs() == 0 {
        output::note("this shard has no runs: the table is empty, and no page is written");
        return Ok(());
    }
    let worst = summary.worst.iter().map(|row| campaign.run_in_full(row.run)).collect::<Result<Vec<_>, _>>()?;
    let command = format!("wetclutch study {}", shell_quoted(file));
    let page = StudyPage::of(summary, &campaign.study, &worst, &command)?;
    let html = part.folder.join("study.html");
    write_text(&html, &page.html)?;
    for (name, svg) in &page.figures {
        write_text(&part.folder.join("figures").join(name), svg)?;
    }
    print(summary, &html)
}

fn print(summary: &Summary, page: &Path) -> Result<(), Failure> {
    let statuses = summary.statuses.iter().map(|(status, count)| format!("{count} {}", status.name()));
    output::line(&format!("{}\n", statuses.collect::<Vec<_>>().join(", ")))?;
    let mut table = vec![["phase", "observer", "RMS MPa: median", "95 %", "worst"].map(str::to_owned).to_vec()];
    for (i, phase) in PHASES.into_iter().enumerate() {
        for (observer, name) in summary.layout.observers.iter().enumerate() {
            let rms = summary.rms(observer, i);
            let mpa = |pascal: f64| number(units::mpa(pascal), 4);
            let mut row = vec![phase_name(phase).to_owned(), name.clone()];
            row.extend([mpa(rms.quantile(0.5)), mpa(rms.quantile(0.95)), mpa(rms.largest())]);
            table.push(row);
        }
    }
    output::table(2, &table)?;
    print_relative(summary)?;
    if let Some(diverged) = diverged(summary) {
        output::line(&format!("\ndiverged: {diverged}"))?;
    }
    output::line(&format!("\npage: {}", page.shown()))?;
    Ok(())
}

/// Prints the errors over those of the open loop, if the study has one.
fn print_relative(summary: &Summary) -> Result<(), Failure> {
    for (compared, name) in COMPARED_NAMES.into_iter().enumerate() {
        let head =
            ["phase", "observer", "in a run: median", "95 %", "worst", "95 % over 95 %", "worst over worst", "better"];
        let mut table = vec![head.map(str::to_owned).to_vec()];
        for (i, phase) in PHASES.into_iter().enumerate() {
            for (observer, name) in summary.layout.observers.iter().enumerate() {
                let Some(relative) = summary.relative(compared, observer, i) else { continue };
                let ratios = [
                    relative.median,
                    relative.high,
                    relative.largest,
                    relative.high_over_high,
                    relative.worst_over_worst,
                ];
                let mut row = vec![phase_name(phase).to_owned(), name.clone()];
                row.extend(ratios.map(|ratio| number(ratio, 2)));
                row.push(format!("{:.0} %", (100.0 * relative.better).floor()));
                table.push(row);
            }
        }
        if table.len() > 1 {
            output::line(&format!("\nRMS error of the {name}, relative to that of the open loop\n"))?;
            output::table(2, &table)?;
        }
    }
    Ok(())
}
