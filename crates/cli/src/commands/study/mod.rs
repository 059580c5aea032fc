//! `wetclutch study` and `wetclutch merge`.

mod cars;
mod cars_page;
mod manifest;
mod one_run;
mod part;

use std::collections::BTreeMap;
use std::path::Path;

use config::{Kind, Source, Study};
use report::StudyPage;
use report::study_page::diverged;
use report::tables::{COMPARED_NAMES, number, phase_name};
use serde_json::json;
use study::campaign::PHASES;
use study::{Campaign, Summary};
use trace::{ShownPath as _, units};
use wetclutch::shell_quoted;

pub(super) use self::cars::describe as describe_cars;
use self::one_run::one_run;
use self::part::{Part, lock, merged};
use crate::args::{Merge, StudyOptions};
use crate::browser;
use crate::commands::{warn_without_effect, writable, write_text};
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
    finish(&part, &summary, &Wanted { file: &options.study, json: options.json, opens: options.open.is_wanted })
}

pub(crate) fn merge(options: &Merge) -> Result<(), Failure> {
    if Source::read(&options.study)?.kind()? == Kind::CarStudy {
        return cars::merge(options);
    }
    let campaign = Campaign::new(Study::read(&options.study)?)?;
    let mut summary = Summary::new(&campaign.study);
    let (whole, _lock) = merged(&campaign, options, |row| summary.push(row))?;
    finish(&whole, &summary, &Wanted { file: &options.study, json: options.json, opens: options.open.is_wanted })
}

/// What is shown of a finished study.
struct Wanted<'a> {
    /// Its file.
    file: &'a Path,
    /// Whether JSON is printed.
    json: bool,
    /// Whether the page is opened.
    opens: bool,
}

/// Writes everything that is computed from the rows, and prints it, or as JSON.
fn finish(part: &Part<'_, Campaign>, summary: &Summary, wanted: &Wanted<'_>) -> Result<(), Failure> {
    let campaign = part.campaign;
    part.write_parquet()?;
    if summary.runs() == 0 {
        output::note("this shard has no runs: the table is empty, and no page is written");
        if wanted.opens {
            warn_without_effect("--open", "there is no page without a run");
        }
        return if wanted.json { print_json(part, summary, None) } else { Ok(()) };
    }
    let worst = summary.worst.iter().map(|row| campaign.run_in_full(row.run)).collect::<Result<Vec<_>, _>>()?;
    let command = format!("wetclutch study {}", shell_quoted(wanted.file));
    let page = StudyPage::of(summary, &campaign.study, &worst, &command)?;
    let html = part.folder.join("study.html");
    write_text(&html, &page.html)?;
    for (name, svg) in &page.figures {
        write_text(&part.folder.join("figures").join(name), svg)?;
    }
    if wanted.json { print_json(part, summary, Some(&html)) } else { print(summary, &html) }?;
    browser::open_if(wanted.opens, &html);
    Ok(())
}

/// Prints runs, files and errors as JSON.
fn print_json(part: &Part<'_, Campaign>, summary: &Summary, page: Option<&Path>) -> Result<(), Failure> {
    let statuses: BTreeMap<_, _> = summary.statuses.iter().map(|(status, count)| (status.name(), count)).collect();
    let error = |observer: usize, phase: usize| {
        let rms = summary.rms(observer, phase);
        let over_open_loop = summary.relative(0, observer, phase).map(
            |relative| json!({ "median": relative.median, "quantile_95": relative.high, "maximum": relative.largest }),
        );
        json!({
            "observer": summary.layout.observers[observer],
            "phase": phase_name(PHASES[phase]),
            "rms_pa": { "median": rms.quantile(0.5), "quantile_95": rms.quantile(0.95), "maximum": rms.largest() },
            "over_open_loop": over_open_loop,
        })
    };
    let of_observer = |observer| (0..PHASES.len()).map(move |phase| error(observer, phase));
    output::json(&json!({
        "table": part.table().shown().to_string(),
        "page": page.map(|page| page.shown().to_string()),
        "runs": summary.runs(),
        "statuses": statuses,
        "errors": (0..summary.layout.observers.len()).flat_map(of_observer).collect::<Vec<_>>(),
    }))
}

fn print(summary: &Summary, page: &Path) -> Result<(), Failure> {
    let statuses = summary.statuses.iter().map(|(status, count)| format!("{count} {}", status.name()));
    output::line(&format!("{}\n", statuses.collect::<Vec<_>>().join(", ")))?;
    let titles = ["phase", "observer", "median RMS, MPa", "95 %, MPa", "worst, MPa"].map(str::to_owned).to_vec();
    let mut rows = Vec::new();
    for (i, phase) in PHASES.into_iter().enumerate() {
        for (observer, name) in summary.layout.observers.iter().enumerate() {
            let rms = summary.rms(observer, i);
            let mpa = |pascal: f64| number(units::mpa(pascal), 4);
            let mut row = vec![phase_name(phase).to_owned(), name.clone()];
            row.extend([mpa(rms.quantile(0.5)), mpa(rms.quantile(0.95)), mpa(rms.largest())]);
            rows.push(row);
        }
    }
    output::table(2, titles, rows)?;
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
        let mut rows = Vec::new();
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
                rows.push(row);
            }
        }
        if !rows.is_empty() {
            output::line(&format!("\nRMS error of the {name}, relative to that of the open loop\n"))?;
            output::table(2, head.map(str::to_owned).to_vec(), rows)?;
        }
    }
    Ok(())
}
