//! `wetclutch error-bound`.

use std::path::{Path, PathBuf};

use config::{Kind, Source, Study};
use report::tables::phase_name;
use study::campaign::PHASES;
use study::{ErrorBound, error_bound as find};
use trace::ShownPath as _;

use super::error_bound_page::{named, sheet};
use crate::args::ErrorBoundOptions;
use crate::browser;
use crate::commands::written::{is_page, replaces_only};
use crate::commands::{check_output, not_an_input, progress, warn_without_effect, write_text};
use crate::failure::Failure;
use crate::output;

pub(crate) fn error_bound(options: &ErrorBoundOptions) -> Result<(), Failure> {
    check_output(options.output.as_ref())?;
    let study = Study::read(&options.study)?;
    let inputs = [&options.study, &study.experiment.source.path, &study.vehicle.source.path];
    not_an_input(options.output.as_ref(), inputs)?;
    if let Some(path) = &options.output {
        let page = path.with_extension("html");
        if page == *path {
            let path = path.shown();
            return Err(Failure::Input(format!(
                "{path}: the bounds cannot have the name of their page\nhint: for example bounds.toml, whose page is bounds.html"
            )));
        }
        replaces_only("file of bounds", path, is_overlay)?;
        if let Some(page) = page_beside(path) {
            check_output(Some(&page))?;
            replaces_only("page in HTML", &page, is_page)?;
        }
    }
    let bar = progress(study.runs, 0);
    let found = find(&study, options.threads.count(), || bar.inc(1))?;
    bar.finish_and_clear();
    if found.phases.iter().any(|phase| phase.runs == 0) {
        return Err(Failure::Work("no run has a complete shift: there is no model error to compute\nhint: let the experiment record longer, or narrow the factors of the study".to_owned()));
    }
    if found.phases.iter().any(|phase| phase.rigid.largest.is_infinite()) {
        return Err(Failure::Work(
            "the model error has no bound: an acceleration is not finite\nhint: narrow the factors of the study"
                .to_owned(),
        ));
    }
    if let Some(path) = &options.output {
        write_text(path, &found.toml(&study))?;
        if let Some(page) = page_beside(path) {
            write_text(&page, &sheet(&found, &study).html()?)?;
        }
    }
    if options.json { output::json(&found) } else { print(&found, &study, options) }?;
    match options.output.as_deref().map(page_beside) {
        Some(Some(page)) => browser::open_if(options.open.is_wanted, &page),
        Some(None) if options.open.is_wanted => {
            warn_without_effect("--open", "the bounds go to a device or a pipe, and there is no page");
        }
        _ => (),
    }
    Ok(())
}

fn print(found: &ErrorBound, study: &Study, options: &ErrorBoundOptions) -> Result<(), Failure> {
    output::line(&format!("{} runs, {} without a complete shift\n", found.runs, found.unfinished))?;
    let head = ["phase", "model error, rad/s^2", "largest", "50 % of runs below", "95 %", "99 %", "settled after run"];
    let mut rows = Vec::new();
    for (phase, found) in PHASES.into_iter().zip(&found.phases) {
        for (name, size) in named(found) {
            let [half, maximum, nearly_all] = size.quantiles;
            let numbers = [size.largest, half, maximum, nearly_all].map(|value| format!("{value:.1}"));
            let mut cells = vec![phase_name(phase).to_owned(), name];
            cells.extend(numbers);
            cells.push(size.settled_after.to_string());
            rows.push(cells);
        }
    }
    output::table(2, head.map(str::to_owned).to_vec(), rows)?;
    match &options.output {
        Some(path) => {
            output::line(&format!("\nbounds: {}", path.shown()))?;
            if let Some(page) = page_beside(path) {
                output::line(&format!("page: {}", page.shown()))?;
            }
        }
        None => output::toml(&format!("\n{}", found.toml(study)))?,
    }
    Ok(())
}

fn is_overlay(path: &Path) -> bool {
    Source::read(path).and_then(|source| source.kind()).is_ok_and(|kind| kind == Kind::Overlay)
}

/// The page beside a file of bounds; there is none beside a device or a pipe.
fn page_beside(bounds: &Path) -> Option<PathBuf> {
    let is_file = std::fs::metadata(bounds).map_or(true, |there| there.is_file());
    is_file.then(|| bounds.with_extension("html"))
}
