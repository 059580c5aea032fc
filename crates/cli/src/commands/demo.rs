//! `wetclutch demo`.

use std::path::Path;

use config::{Experiment, Vehicle};
use report::Page;
use report::page::findings;
use report::tables::phase_name;
use study::{Comparison, compare, estimates_trace};
use trace::{signal, units};

use crate::args::Demo;
use crate::commands::{write_text, write_trace};
use crate::failure::Failure;
use crate::output;

pub(crate) fn demo(options: &Demo) -> Result<(), Failure> {
    let (vehicle, experiment) = (Vehicle::two_speed_at()?, Experiment::e1()?);
    output::note(&format!("simulating {} s of driving, designing and running the observers", experiment.duration_s));
    let comparison = compare(&vehicle, &experiment)?;
    let page = Page::of(&comparison, &vehicle)?;

    let folder = &options.output;
    write_text(&folder.join("report.html"), &page.html)?;
    for (name, svg) in &page.figures {
        write_text(&folder.join(name), svg)?;
    }
    let trace = &comparison.trace;
    write_trace(&folder.join("trace.csv"), trace)?;
    write_trace(&folder.join("measured.csv"), &trace.filtered(|name| signal::MEASURABLE.contains(&name)))?;
    let rigid = &comparison.runs[0];
    write_trace(&folder.join("estimate.csv"), &estimates_trace(&rigid.time_s, &rigid.estimates))?;

    print(&comparison, &folder.join("report.html"))
}

fn print(comparison: &Comparison, report: &Path) -> Result<(), Failure> {
    let range_pa = comparison.experiment.shift.line_pressure_pa;
    let title = &comparison.experiment.title;
    output::line(&format!("{title} (error of the pressure; range {} MPa)\n", units::mpa(range_pa)))?;
    let head = ["phase", "observer", "peak MPa", "RMS MPa", "mean MPa", "RMS % of range"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    for i in 0..comparison.runs[0].pressure.len() {
        for run in &comparison.runs {
            let score = &run.pressure[i];
            rows.push(vec![
                phase_name(score.phase).to_owned(),
                run.entry.name.clone(),
                format!("{:.4}", units::mpa(score.peak)),
                format!("{:.4}", units::mpa(score.rms)),
                format!("{:.4}", units::mpa(score.mean)),
                format!("{:.1}", 100.0 * score.rms / range_pa),
            ]);
        }
    }
    output::table(2, &rows)?;
    output::line("")?;
    for sentence in findings(comparison) {
        output::line(&sentence.replace('’', "'"))?;
    }
    output::line(&format!("\nreport: {}", report.display()))?;
    Ok(())
}
