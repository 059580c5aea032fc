//! `wetclutch worst-case`.

use std::path::Path;

use config::Study;
use report::shift_figure::observers_of;
use report::tables::phase_name;
use study::campaign::{Metric, PHASES};
use study::{Campaign, Target, worst_case as search};
use trace::units::mpa;

use crate::args::{PhaseChoice, WorstCaseOptions};
use crate::commands::{progress, write_text};
use crate::failure::Failure;
use crate::output;

pub(crate) fn worst_case(options: &WorstCaseOptions) -> Result<(), Failure> {
    let campaign = Campaign::new(Study::read(&options.study)?)?;
    let names = &campaign.layout.observers;
    let observer = match &options.observer {
        None => 0,
        Some(name) => names.iter().position(|other| other == name).ok_or_else(|| {
            Failure::Input(format!("the study has no observer `{name}`\nhint: its observers are {}", names.join(", ")))
        })?,
    };
    let phases = match options.phase {
        PhaseChoice::Torque => vec![0],
        PhaseChoice::Inertia => vec![1],
        PhaseChoice::Both => vec![0, 1],
    };
    for phase in phases {
        one(&campaign, Target { observer, phase, metric: Metric::PressureRms }, options)?;
    }
    Ok(())
}

fn one(campaign: &Campaign, target: Target, options: &WorstCaseOptions) -> Result<(), Failure> {
    let bar = progress(campaign.study.runs + u64::from(options.starts), 0);
    let starts = usize::from(options.starts);
    let found = search(campaign, target, starts, options.iterations, options.threads.count(), || bar.inc(1))?;
    bar.finish_and_clear();
    let Some(found) = found else {
        return Err(Failure::Work("no run of the study had a whole shift to begin from".to_owned()));
    };
    let (name, phase) = (&campaign.layout.observers[target.observer], PHASES[target.phase]);
    output::line(&format!(
        "{name}, {}: RMS error {:.4} MPa, after {:.4} MPa in the worst of {} runs ({} more runs from {} starts)",
        phase_name(phase),
        mpa(score(campaign, target, &found.row.numbers)),
        mpa(score(campaign, target, &found.study_worst.numbers)),
        campaign.study.runs,
        found.evaluations,
        found.starts,
    ))?;
    for (other, name) in campaign.layout.observers.iter().enumerate().filter(|(other, _)| *other != target.observer) {
        let there = score(campaign, Target { observer: other, ..target }, &found.row.numbers);
        output::line(&format!("  {name} there: {:.4} MPa", mpa(there)))?;
    }
    for (factor, value) in campaign.layout.factors.iter().zip(&found.row.numbers) {
        output::line(&format!("  {factor} = {value:.5}"))?;
    }
    let start = options.output.join(format!("worst_{}", phase.name()));
    let (study, figure) = (start.with_extension("toml"), start.with_extension("svg"));
    let experiment = campaign.study.experiment.source.path.as_path();
    let experiment = std::fs::canonicalize(experiment).map_err(|error| Failure::writing(experiment, &error))?;
    write_text(&study, &found.study_file(campaign, &experiment.display().to_string()))?;
    let run = Campaign::new(Study::read(&study)?)?.run_in_full(0)?;
    write_text(&figure, &observers_of(&run.observers, &run.trace, run.quality.as_ref()).svg())?;
    print_places(&study, &figure)
}

fn score(campaign: &Campaign, target: Target, numbers: &[f64]) -> f64 {
    numbers[campaign.layout.score(target.observer, target.phase, target.metric)]
}

fn print_places(study: &Path, figure: &Path) -> Result<(), Failure> {
    output::line(&format!("figure: {}", figure.display()))?;
    output::line(&format!("again: wetclutch study {} --run 0\n", study.display()))?;
    Ok(())
}
