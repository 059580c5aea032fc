//! `wetclutch reproduce`.

use std::path::Path;

use config::{ExperimentFile, Study, VehicleFile};
use report::Reproduction;
use report::reproduction::{agreeing, ours};
use study::Chapter;
use study::statements::Case;
use trace::ShownPath as _;
use trace::shown_units::sentence;

use crate::args::Reproduce;
use crate::browser;
use crate::commands::{progress, replaceable, warn_without_effect, write_text};
use crate::failure::Failure;
use crate::output;

pub(crate) fn reproduce(options: &Reproduce) -> Result<(), Failure> {
    const FILES: [&str; 3] = ["reproduction.html", "reproduction.md", "reproduction.json"];
    replaceable(&options.output, &FILES)?;
    let (vehicle, study) = (VehicleFile::built_in()?, Study::plausible()?);
    let settings = options.settings.map_or(study.runs, |settings| u64::from(settings).min(study.runs));
    if options.settings.is_some_and(|wanted| u64::from(wanted) > study.runs) {
        warn_without_effect("--settings", &format!("there are {} settings, and all are run", study.runs));
    }
    output::note(&format!("running experiments E1 to E4, and again in {settings} settings"));
    let bar = progress(settings, 0);
    let experiments = ExperimentFile::built_in()?;
    let chapter = study::reproduce(&vehicle, &experiments, &study, settings, options.threads.count(), || bar.inc(1))?;
    bar.finish_and_clear();
    let reproduction = Reproduction::of(&chapter, &vehicle, &experiments, &study)?;
    let numbers = numbers(&chapter);
    let json = output::pretty_json(&numbers)? + "\n";
    let texts = [&reproduction.html, &reproduction.markdown, &json];
    for (name, text) in FILES.iter().zip(texts) {
        write_text(&options.output.join(name), text)?;
    }
    for (name, svg) in &reproduction.figures {
        write_text(&options.output.join(name), svg)?;
    }
    let page = options.output.join(FILES[0]);
    if options.json { output::json(&numbers) } else { print(&chapter, &page) }?;
    browser::open_if(options.open.is_wanted, &page);
    Ok(())
}

fn print(chapter: &Chapter, page: &Path) -> Result<(), Failure> {
    for row in &chapter.statements {
        let verdict = row.agrees.map_or("", |agrees| if agrees { "agrees" } else { "differs" });
        let case = row.case.map_or_else(String::new, |case| format!(" ({})", Case::label(case)));
        let line = format!("{verdict:7} {:7} {}{case}: {}", row.experiment, row.claim, sentence(&ours(row)));
        output::line(&line.replace('’', "'").replace('−', "-"))?;
    }
    output::line("")?;
    for line in agreeing(chapter) {
        output::line(&line.replace('−', "-"))?;
    }
    output::line(&format!("\nreport: {}", page.shown()))?;
    Ok(())
}

/// The statements and the settings as numbers.
fn numbers(chapter: &Chapter) -> serde_json::Value {
    serde_json::json!({
        "wetclutch": env!("CARGO_PKG_VERSION"),
        "settings": chapter.settings,
        "statements": chapter.statements,
    })
}
