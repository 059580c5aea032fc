//! `wetclutch worst-case`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use config::Study;
use report::shift_figure::observers_of;
use report::tables::phase_name;
use serde_json::{Value, json};
use study::campaign::{Metric, PHASES};
use study::{Campaign, Row, Target, worst_case as search};
use trace::ShownPath as _;
use trace::quantity;
use trace::units::mpa;

use super::worst_case_page::{Shown, sentence, sheet};
use crate::args::{PhaseChoice, WorstCaseOptions};
use crate::browser;
use crate::commands::written::{head, replaces_only};
use crate::commands::{not_an_input, progress, replaceable, write_text};
use crate::failure::Failure;
use crate::output;
use wetclutch::shell_quoted;

/// The name of the page.
const PAGE: &str = "worst_case.html";

pub(crate) fn worst_case(options: &WorstCaseOptions) -> Result<(), Failure> {
    let study = Study::read(&options.study)?;
    let experiment = experiment_path(&study)?;
    let names: Vec<&str> = study.experiment.observers.iter().map(|entry| entry.name.as_str()).collect();
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
    replaceable(&options.output, &[PAGE])?;
    let inputs = [&options.study, &study.experiment.source.path, &study.vehicle.source.path];
    for &phase in &phases {
        let [study, figure] = places(options, phase);
        not_an_input(Some(&study), inputs)?;
        not_an_input(Some(&figure), inputs)?;
        replaces_only("study file of a worst case", &study, |path| head(path).contains("`wetclutch worst-case`"))?;
    }
    let campaign = Campaign::new(study)?;
    let target = |phase| Target { observer, phase, metric: Metric::PressureRms };
    let found = phases.into_iter().map(|phase| one(&campaign, &experiment, target(phase), options));
    let found: Vec<Shown> = found.collect::<Result<_, _>>()?;
    let page = options.output.join(PAGE);
    write_text(&page, &sheet(&campaign, &found).html()?)?;
    if options.json {
        let cases: Vec<Value> = found.iter().map(|shown| json_of(&campaign, shown, options)).collect();
        output::json(&json!({ "worst_cases": cases, "page": page.shown().to_string() }))?;
    } else {
        output::line(&format!("page: {}", page.shown()))?;
    }
    browser::open_if(options.open.is_wanted, &page);
    Ok(())
}

/// The absolute path of the study's experiment, for a study file in any folder.
fn experiment_path(study: &Study) -> Result<String, Failure> {
    let path = &study.experiment.source.path;
    let whole = std::fs::canonicalize(path).map_err(|error| Failure::Input(format!("{}: {error}", path.shown())))?;
    whole.into_os_string().into_string().map_err(|whole| {
        let path = Path::new(&whole).shown();
        Failure::Input(format!(
            "{path}: the path is not UTF-8, so that a study file cannot contain it\nhint: rename the folder"
        ))
    })
}

/// Searches the worst case of a phase, and writes and prints it.
fn one(campaign: &Campaign, experiment: &str, target: Target, options: &WorstCaseOptions) -> Result<Shown, Failure> {
    let bar = progress(campaign.study.runs + u64::from(options.starts), 0);
    let starts = usize::from(options.starts);
    let found = search(campaign, target, starts, options.iterations, options.threads.count(), || bar.inc(1))?;
    bar.finish_and_clear();
    let Some(found) = found else {
        return Err(Failure::Work("no run of the study has a complete shift to start from\nhint: let the experiment record longer, or narrow the factors of the study".to_owned()));
    };
    let [study, figure] = &places(options, target.phase);
    write_text(study, &found.study_file(campaign, experiment))?;
    let run = Campaign::new(Study::read(study)?)?.run_in_full(0)?;
    write_text(figure, &observers_of(&run.observers, &run.trace, run.quality.as_ref()).svg())?;
    let command = format!("wetclutch study {} --run 0", shell_quoted(study));
    let shown = Shown { target, found, run, command };
    if !options.json {
        print(campaign, &shown)?;
        output::line(&format!("figure: {}", figure.shown()))?;
        output::line(&format!("to repeat: {}\n", shown.command))?;
    }
    Ok(shown)
}

/// The worst case in SI.
fn json_of(campaign: &Campaign, Shown { target, found, .. }: &Shown, options: &WorstCaseOptions) -> Value {
    let score = |row: &Row| row.numbers[campaign.layout.score(target.observer, target.phase, target.metric)];
    let factors: BTreeMap<_, _> = campaign.layout.factors.iter().zip(&found.row.numbers).collect();
    json!({
        "observer": campaign.layout.observers[target.observer],
        "phase": phase_name(PHASES[target.phase]),
        "rms_pa": score(&found.row),
        "study_rms_pa": score(&found.study_worst),
        "more_runs": found.evaluations,
        "factors": factors,
        "files": places(options, target.phase).iter().map(|path| path.shown().to_string()).collect::<Vec<_>>(),
    })
}

fn print(campaign: &Campaign, shown: &Shown) -> Result<(), Failure> {
    let Shown { target, found, .. } = shown;
    output::line(&sentence(campaign, shown))?;
    for (other, name) in campaign.layout.observers.iter().enumerate().filter(|(other, _)| *other != target.observer) {
        let there = score(campaign, Target { observer: other, ..*target }, &found.row);
        output::line(&format!("  {name} in this run: {there}"))?;
    }
    for (factor, value) in campaign.layout.factors.iter().zip(&found.row.numbers) {
        output::line(&format!("  {factor} = {value:.5}"))?;
    }
    Ok(())
}

/// The study file and the figure of the worst case of a phase.
fn places(options: &WorstCaseOptions, phase: usize) -> [PathBuf; 2] {
    let start = options.output.join(format!("worst_{}", PHASES[phase].name()));
    [start.with_extension("toml"), start.with_extension("svg")]
}

/// The score of a run, with its unit.
pub(super) fn score(campaign: &Campaign, target: Target, row: &Row) -> String {
    match mpa(row.numbers[campaign.layout.score(target.observer, target.phase, target.metric)]) {
        f64::INFINITY => "infinite (it diverged)".to_owned(),
        score => quantity(score, "MPa", 4),
    }
}
