//! `wetclutch error-bound`.

use config::Study;
use report::error_bound_page;
use report::error_bound_page::named;
use report::tables::phase_name;
use study::campaign::PHASES;
use study::error_bound as find;

use crate::args::ErrorBoundOptions;
use crate::commands::{progress, write_text};
use crate::failure::Failure;
use crate::output;

pub(crate) fn error_bound(options: &ErrorBoundOptions) -> Result<(), Failure> {
    let study = Study::read(&options.study)?;
    let bar = progress(study.runs, 0);
    let found = find(&study, options.threads.count(), || bar.inc(1))?;
    bar.finish_and_clear();
    if found.phases.iter().any(|phase| phase.runs == 0) {
        return Err(Failure::Work("no run had a whole shift: there is no error to measure".to_owned()));
    }
    if let Some(path) = &options.output {
        write_text(path, &found.toml(&study))?;
        write_text(&path.with_extension("html"), &error_bound_page(&found, &study)?)?;
    }
    if options.json {
        output::line(&serde_json::to_string_pretty(&found)?)?;
        return Ok(());
    }
    output::line(&format!("{} runs, {} without a whole shift\n", found.runs, found.unfinished))?;
    let head = ["phase", "model error, rad/s^2", "largest", "50 % of runs below", "95 %", "99 %", "settled after run"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    for (phase, found) in PHASES.into_iter().zip(&found.phases) {
        for (name, size) in named(found) {
            let [half, most, nearly_all] = size.quantiles;
            let numbers = [size.largest, half, most, nearly_all].map(|value| format!("{value:.1}"));
            let mut cells = vec![phase_name(phase).to_owned(), name];
            cells.extend(numbers);
            cells.push(size.settled_after.to_string());
            rows.push(cells);
        }
    }
    output::table(2, &rows)?;
    match &options.output {
        Some(path) => {
            let page = path.with_extension("html");
            output::line(&format!("\nbounds: {}\npage: {}", path.display(), page.display()))?;
        }
        None => output::line(&format!("\n{}", found.toml(&study)))?,
    }
    Ok(())
}
