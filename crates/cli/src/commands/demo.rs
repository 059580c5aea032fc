//! `wetclutch demo`.

use std::io::Write;
use std::path::Path;

use config::{Experiment, Vehicle};
use report::{Page, page};
use study::{Comparison, compare, estimates_trace};
use trace::{signal, units, write_csv, write_whole};

use crate::args::Demo;
use crate::failure::Failure;
use crate::output;

pub(crate) fn demo(options: &Demo) -> Result<(), Failure> {
    let (vehicle, experiment) = (Vehicle::two_speed_at()?, Experiment::e1()?);
    output::note(&format!("simulating {} s of driving, designing and running the observers", experiment.duration_s));
    let comparison = compare(&vehicle, &experiment)?;
    let page = Page::of(&comparison, &vehicle, &experiment)?;

    let folder = &options.output;
    let text = |name: &str, text: &str| -> Result<(), Failure> {
        let path = folder.join(name);
        write_whole(&path, |writer: &mut dyn Write| writer.write_all(text.as_bytes()))
            .map_err(|error| Failure::writing(&path, &error))
    };
    text("report.html", &page.html)?;
    for (name, svg) in &page.figures {
        text(name, svg)?;
    }
    let trace = &comparison.trace;
    write_csv(&folder.join("trace.csv"), trace)?;
    write_csv(&folder.join("measured.csv"), &trace.filtered(|name| signal::MEASURABLE.contains(&name)))?;
    write_csv(&folder.join("estimate.csv"), &estimates_trace(&trace.time_s, &comparison.runs[0].estimates))?;

    print(&comparison, &experiment, &folder.join("report.html"))
}

fn print(comparison: &Comparison, experiment: &Experiment, report: &Path) -> Result<(), Failure> {
    let range_pa = experiment.shift.line_pressure_pa;
    output::line(&format!("{} (error of the pressure; range {} MPa)\n", experiment.title, units::mpa(range_pa)))?;
    let head = ["phase", "observer", "peak MPa", "RMS MPa", "mean MPa", "RMS % of range"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    for i in 0..comparison.runs[0].pressure.len() {
        for run in &comparison.runs {
            let score = &run.pressure[i];
            rows.push(vec![
                page::phase_name(score.phase).to_owned(),
                run.name.to_owned(),
                format!("{:.4}", units::mpa(score.peak)),
                format!("{:.4}", units::mpa(score.rms)),
                format!("{:.4}", units::mpa(score.mean)),
                format!("{:.1}", 100.0 * score.rms / range_pa),
            ]);
        }
    }
    output::table(2, &rows)?;
    output::line("")?;
    for sentence in page::findings(comparison) {
        output::line(&sentence.replace('’', "'"))?;
    }
    output::line(&format!("\nreport: {}", report.display()))?;
    Ok(())
}
