//! `wetclutch demo`.

use std::path::{Path, PathBuf};

use car::{GainMethod, Vehicle};
use config::{ExperimentFile, VehicleFile};
use report::Page;
use report::page::findings;
use report::tables::phase_name;
use serde_json::{Value, json};
use study::{AnyObserver, Comparison, ObserverRun, PhaseScore, RunColumns, compare, estimates_trace};
use trace::quantity;
use trace::{ShownPath as _, Trace, signal, units};
use wetclutch::estimate::one_shift::observer::best;

use crate::args::Demo;
use crate::browser;
use crate::commands::written::replaces_only_ours;
use crate::commands::{writable, write_text, write_trace};
use crate::failure::Failure;
use crate::output;

/// The names of the files, but for the figures.
const FILES: [&str; 4] = ["report.html", "trace.csv", "measured.csv", "estimate.csv"];
/// The names of all files that a demo of any car writes.
const OF_ANY: [&str; 9] = [
    "report.html",
    "trace.csv",
    "measured.csv",
    "estimate.csv",
    "shift.svg",
    "drive.svg",
    "shifts.csv",
    "drive.csv",
    "drive_measured.csv",
];

/// What an earlier demo left in a folder.
pub(super) struct EarlierDemo(Vec<PathBuf>);

impl EarlierDemo {
    /// Refuses to replace what no demo wrote.
    pub(super) fn in_folder(folder: &Path) -> Result<Self, Failure> {
        replaces_only_ours(folder, &OF_ANY)?;
        Ok(Self(OF_ANY.map(|name| folder.join(name)).into_iter().filter(|path| path.is_file()).collect()))
    }

    /// Removes the files that this demo has not written again: they are of another car.
    pub(super) fn remove_all_but<'n>(self, names: impl Iterator<Item = &'n str>) -> Result<(), Failure> {
        let written: Vec<&str> = names.collect();
        let is_old = |path: &&PathBuf| path.file_name().is_some_and(|name| !written.iter().any(|other| name == *other));
        for old in self.0.iter().filter(is_old) {
            std::fs::remove_file(old).map_err(|error| Failure::writing(old, &error))?;
            output::note(&format!("removed: {}, of an earlier demo", old.shown()));
        }
        Ok(())
    }
}

pub(crate) fn demo(options: &Demo) -> Result<(), Failure> {
    if let Some(vehicle) = &options.vehicle {
        return super::demo_drive::demo(options, vehicle);
    }
    let folder = &options.output;
    writable(folder, &FILES)?;
    let earlier = EarlierDemo::in_folder(folder)?;
    let [report, trace, measured_only, estimate] = FILES.map(|name| folder.join(name));
    let (vehicle, mut experiment) = (VehicleFile::built_in()?, ExperimentFile::e1()?);
    // The gains that E1 gives are the chapter's; the demo designs its own.
    experiment.observers.retain(|entry| entry.gains.is_none());
    output::note(&format!("simulating {} s of driving; designing and running the observers", experiment.duration_s));
    let comparison = compare(&vehicle, &experiment)?;
    let page = Page::of(&comparison, &vehicle, &experiment.source)?;

    write_text(&report, &page.html)?;
    for (name, svg) in &page.figures {
        write_text(&folder.join(name), svg)?;
    }
    let measured = comparison.trace.filtered(|name| signal::MEASURABLE.contains(&name));
    write_trace(&trace, &comparison.trace)?;
    write_trace(&measured_only, &measured)?;
    write_trace(&estimate, &default_estimate(&vehicle, &measured)?)?;

    earlier.remove_all_but(FILES.iter().copied().chain(page.figures.iter().map(|(name, _)| name.as_str())))?;
    if options.json {
        let figures = page.figures.iter().map(|(name, _)| folder.join(name));
        let files = [report.clone(), trace, measured_only, estimate].into_iter().chain(figures);
        output::json(&json!({ "files": shown(files), "runs": errors(&comparison) }))?;
    } else {
        print(&comparison, &report)?;
    }
    browser::open_if(options.open.is_wanted, &report);
    Ok(())
}

/// The default output of `estimate` for measured signals with a wheel speed.
fn default_estimate(vehicle: &Vehicle, measured: &Trace) -> Result<Trace, Failure> {
    let (kind, method) = (best(true, false), GainMethod::default());
    let observer = AnyObserver::designed(vehicle, kind, method, measured.median_step_s(), None)?;
    let estimates = observer.run(vehicle, &RunColumns::of(measured, vehicle)?);
    Ok(estimates_trace(&measured.time_s, &estimates))
}

/// The names of files in JSON.
pub(super) fn shown(files: impl IntoIterator<Item = PathBuf>) -> Vec<String> {
    files.into_iter().map(|file| file.shown().to_string()).collect()
}

/// Errors of the pressure of each observer by phase, Pa.
fn errors(comparison: &Comparison) -> Vec<Value> {
    let phase = |score: &PhaseScore| {
        let name = phase_name(score.phase);
        json!({ "phase": name, "peak_pa": score.peak, "rms_pa": score.rms, "mean_pa": score.mean })
    };
    let run = |run: &ObserverRun| json!({ "observer": run.entry.name, "phases": run.pressure.iter().map(phase).collect::<Vec<_>>() });
    comparison.runs.iter().map(run).collect()
}

fn print(comparison: &Comparison, report: &Path) -> Result<(), Failure> {
    let range_pa = comparison.experiment.shift.line_pressure_pa;
    let title = &comparison.experiment.title;
    output::line(&format!("{title} (error of the pressure; range {})\n", quantity(units::mpa(range_pa), "MPa", 2)))?;
    let head = ["phase", "observer", "peak MPa", "RMS MPa", "mean MPa", "RMS % of range"];
    let mut rows = Vec::new();
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
    output::table(2, head.map(str::to_owned).to_vec(), rows)?;
    output::line("")?;
    for sentence in findings(comparison) {
        output::line(&sentence.replace('’', "'"))?;
    }
    output::line(&format!("\nreport: {}", report.shown()))?;
    Ok(())
}
