//! The page of `wetclutch worst-case`: the search, the worst case, and what makes it.

use config::Study;
use report::figure::{Axis, Figure, Panel, Series, Stroke};
use report::palette::FAMILY;
use report::sheet::{Content, Part, Sheet};
use report::shift_figure::observers_of;
use report::tables::{capital, coverage, number, phase_name};
use study::campaign::{Metric, PHASES, Run};
use study::{Campaign, Target, WorstCase};
use trace::units::{mpa, of_key};

/// The worst case of a phase.
pub(super) struct Shown {
    /// What was searched.
    pub(super) target: Target,
    /// What was found.
    pub(super) found: WorstCase,
    /// Its run with all signals.
    pub(super) run: Run,
    /// The command that makes it again.
    pub(super) command: String,
}

/// The page of a study's worst cases.
pub(super) fn sheet<'a>(campaign: &'a Campaign, shown: &[Shown]) -> Sheet<'a> {
    let study = &campaign.study;
    let observer = shown.first().map_or("", |shown| campaign.layout.observers[shown.target.observer].as_str());
    Sheet {
        name: &study.title,
        title: "worst case",
        lead: format!(
            "{} \u{b7} worst case of \u{201c}{observer}\u{201d} within the factors of the study",
            study.vehicle.name
        ),
        sentences: shown.iter().map(|shown| sentence(campaign, shown)).collect(),
        parts: shown.iter().flat_map(|shown| parts(campaign, shown)).collect(),
        sources: vec![&study.source, &study.experiment.source, &study.vehicle.source],
    }
}

/// What was found, in a sentence.
pub(super) fn sentence(campaign: &Campaign, Shown { target, found, .. }: &Shown) -> String {
    format!(
        "{}, {}: RMS error {}; {} in the worst of the {} runs of the study ({} more runs from {} starts)",
        campaign.layout.observers[target.observer],
        phase_name(PHASES[target.phase]),
        super::worst_case::score(campaign, *target, &found.row),
        super::worst_case::score(campaign, *target, &found.study_worst),
        campaign.study.runs,
        found.evaluations,
        found.starts,
    )
}

fn parts(campaign: &Campaign, shown: &Shown) -> Vec<Part> {
    let phase = capital(phase_name(PHASES[shown.target.phase]));
    let part = |heading: Option<&str>, content, caption: &str| Part {
        heading: heading.map(|heading| format!("{phase}: {heading}")),
        content,
        caption: caption.to_owned(),
    };
    vec![
        part(
            Some("search"),
            Content::Figure(search_figure(campaign, shown)),
            "The largest RMS error of the pressure so far, after each run of each search. The searches start from the worst runs of the study. Below the same against \
             the mean width of the guaranteed range of the pressure in the worst case, in which the true pressure lies.",
        ),
        part(
            Some("worst case"),
            Content::Figure(observers_of(&shown.run.observers, &shown.run.trace, shown.run.quality.as_ref())),
            "The worst case that was found, with the estimates of all observers.",
        ),
        part(
            None,
            errors(campaign, shown),
            "Errors in this phase of the worst case; worst of the study: the same observer in the run that is its worst for the observer of the search.",
        ),
        part(
            Some("parameters"),
            factors(&campaign.study, shown),
            "What makes the worst case. Change: a value is set in the file, or scales the value there, or is added to it. In the range: 0 % is its lower end, 100 % its upper end.",
        ),
        part(Some("run it again"), Content::Lines(vec![shown.command.clone()]), ""),
    ]
}

/// The largest error so far of each search.
fn search_figure(campaign: &Campaign, Shown { target, found, .. }: &Shown) -> Figure {
    let longest = found.progress.iter().map(Vec::len).max().unwrap_or(1);
    let last = longest.max(2) as f64;
    let at = |metric| campaign.layout.score(target.observer, target.phase, metric);
    // A diverged estimate has no place on the axis.
    let shown = |pascal: f64| if pascal.is_finite() { mpa(pascal) } else { f64::NAN };
    let constant = |label: &str, stroke: Stroke, pascal: f64| Series {
        label: label.to_owned(),
        stroke,
        points: vec![(1.0, shown(pascal)), (last, shown(pascal))],
    };
    let searches =
        found.progress.iter().zip(FAMILY.iter().cycle()).enumerate().map(|(start, (progress, stroke))| Series {
            label: format!("start {}", start + 1),
            stroke: *stroke,
            points: progress.iter().enumerate().map(|(run, &pascal)| (run as f64 + 1.0, shown(pascal))).collect(),
        });
    let mut series: Vec<Series> = searches.collect();
    series.push(constant("worst of the study", Stroke::SIGNAL, found.study_worst.numbers[at(Metric::PressureRms)]));
    let so_far = |run: usize| found.progress.iter().filter_map(|of| of.get(run.min(of.len() - 1))).fold(0.0, pick_max);
    let bound = vec![
        Series {
            label: "worst of all searches".to_owned(),
            stroke: FAMILY[2],
            points: (0..longest).map(|run| (run as f64 + 1.0, shown(so_far(run)))).collect(),
        },
        constant("mean width of the guaranteed range", Stroke::THIRD, found.row.numbers[at(Metric::RangeWidth)]),
    ];
    let panel = |y_label: &str, height, mut series: Vec<Series>, axis| {
        series.retain(|series| series.points.iter().any(|(_, value)| value.is_finite()));
        Panel { y_label: y_label.to_owned(), height, series, bands: Vec::new(), axis }
    };
    let panels = vec![
        panel("RMS error (MPa)", 190.0, series, Axis::All),
        panel("RMS error and range (MPa)", 110.0, bound, Axis::All),
    ];
    Figure { x_label: "runs of the search".into(), x_range: (1.0, last), spans: Vec::new(), panels }
}

fn pick_max(a: f64, b: &f64) -> f64 {
    a.max(*b)
}

/// The errors of all observers in the phase.
fn errors(campaign: &Campaign, Shown { target, found, .. }: &Shown) -> Content {
    let titles =
        ["observer", "RMS MPa", "worst of the study MPa", "peak MPa", "clutch torque RMS N m", "in range", "range MPa"];
    let row = |(observer, name): (usize, &String)| {
        let at = |metric| campaign.layout.score(observer, target.phase, metric);
        let value = |metric| found.row.numbers[at(metric)];
        let inside = value(Metric::Coverage);
        vec![
            name.clone(),
            number(mpa(value(Metric::PressureRms)), 4),
            number(mpa(found.study_worst.numbers[at(Metric::PressureRms)]), 4),
            number(mpa(value(Metric::PressurePeak)), 4),
            number(value(Metric::TorqueRms), 1),
            if inside.is_nan() { "\u{2013}".to_owned() } else { coverage(inside) },
            number(mpa(value(Metric::RangeWidth)), 4),
        ]
    };
    let rows = campaign.layout.observers.iter().enumerate().map(row);
    Content::Table(titles.map(str::to_owned).to_vec(), rows.collect())
}

/// The factors of the worst case with their ranges.
fn factors(study: &Study, Shown { found, .. }: &Shown) -> Content {
    let titles = ["factor", "value", "unit", "change", "from", "to", "in the range", "worst of the study"];
    let values = found.row.numbers.iter().zip(&found.study_worst.numbers);
    let row = |(factor, (value, of_study)): (&config::Factor, (&f64, &f64))| {
        let [low, high] = factor.values.taken().ends();
        let place = 100.0 * (value - low) / (high - low);
        // What scales a value has no unit.
        let unit = of_key(&factor.key).filter(|_| factor.change_name() != "scale");
        vec![
            factor.name.clone(),
            short(*value),
            unit.unwrap_or_default().to_owned(),
            factor.change_name().to_owned(),
            short(low),
            short(high),
            if place.is_finite() { format!("{place:.0} %") } else { String::new() },
            short(*of_study),
        ]
    };
    let rows = study.factors.iter().zip(values).map(row);
    Content::Table(titles.map(str::to_owned).to_vec(), rows.collect())
}

/// A number with four significant digits.
fn short(value: f64) -> String {
    format!("{value:.3e}").parse::<f64>().map_or_else(|_| value.to_string(), |rounded| rounded.to_string())
}
