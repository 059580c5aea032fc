//! `wetclutch reproduce`.

use config::{Experiment, Vehicle};
use report::Reproduction;
use report::reproduction::agreeing;

use crate::args::Reproduce;
use crate::commands::write_text;
use crate::failure::Failure;
use crate::output;

pub(crate) fn reproduce(options: &Reproduce) -> Result<(), Failure> {
    let vehicle = Vehicle::two_speed_at()?;
    output::note("running experiments E1 to E4");
    let chapter = study::reproduce(&vehicle, &Experiment::built_in()?)?;
    let reproduction = Reproduction::of(&chapter, &vehicle)?;
    let page = options.output.join("reproduction.html");
    write_text(&page, &reproduction.html)?;
    write_text(&options.output.join("reproduction.md"), &reproduction.markdown)?;
    for (name, svg) in &reproduction.figures {
        write_text(&options.output.join(name), svg)?;
    }
    if options.json {
        output::line(&serde_json::to_string_pretty(&chapter.statements)?)?;
        return Ok(());
    }
    for s in &chapter.statements {
        output::line(&format!("{:7} {:7} {}: {}", s.verdict.word(), s.experiment, s.claim, s.ours).replace('’', "'"))?;
    }
    output::line(&format!("\n{}\nreport: {}", agreeing(&chapter), page.display()))?;
    Ok(())
}
