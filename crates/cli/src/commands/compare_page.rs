//! The page of `wetclutch compare`.

use std::path::Path;

use config::Source;
use report::figure::{Axis, Band, Figure, Panel, Series, Stroke, Weight};
use report::sheet::{Content, Part, Sheet};
use trace::ShownPath as _;
use trace::units::rpm;
use wetclutch::compare::{Comparison, Curve, FileComparison, RunComparison, SIGNALS, ShiftPair, Signal};

use super::compare::{file_rows, files_sentence, pair_rows, quantity_rows, run_sentences};

/// Shifts that are drawn.
const DRAWN: usize = 8;
/// The strokes and the colours of the runs.
const A: Stroke = Stroke { colour: "#0072B2", weight: Weight::Equal, dash: None };
const B: Stroke = Stroke { colour: "#D55E00", weight: Weight::Equal, dash: Some("8 3") };

/// The page.
pub(super) fn sheet<'a>(found: &'a Comparison, paths: [&Path; 2]) -> Sheet<'a> {
    let [a, b] = paths.map(|path| path.shown().to_string());
    let (sentences, parts, sources) = match found {
        Comparison::Files(files) => (vec![files_sentence(files)], file_parts(files), sources(files)),
        Comparison::Runs(runs) => (run_sentences(runs), run_parts(runs), Vec::new()),
    };
    let name = match found {
        Comparison::Files(_) => "Two files over each other",
        Comparison::Runs(_) => "Two runs over each other",
    };
    let lead = format!("A: {a} \u{b7} B: {b} \u{b7} {}", sentences.join(" "));
    Sheet { name, title: "compare", lead, sentences: Vec::new(), parts, sources }
}

fn sources(files: &FileComparison) -> Vec<&Source> {
    files.sources.iter().flatten().collect()
}

fn file_parts(files: &FileComparison) -> Vec<Part> {
    let (titles, rows) = file_rows(files);
    if rows.is_empty() {
        return Vec::new();
    }
    let caption = "The largest relative difference first; words, and keys of one file alone, stand before them. B over A: the difference over the size of A; of a list \
                   that of the value that differs most, over the largest one of A. Default: a value that is not in the file.";
    vec![part(Some("Keys that differ"), Content::Table(titles, rows), caption)]
}

fn part(heading: Option<&str>, content: Content, caption: &str) -> Part {
    Part { heading: heading.map(str::to_owned), content, caption: caption.to_owned() }
}

fn run_parts(runs: &RunComparison) -> Vec<Part> {
    let mut parts = Vec::new();
    if let Some(figure) = over_shifts(runs) {
        parts.push(part(
            Some("Differences"),
            Content::Figure(figure),
            "Each shift of both runs by its number in A. Size: the largest difference of a quantity of the shift, over the largest value of this quantity in both runs.",
        ));
    }
    let (titles, rows) = quantity_rows(runs);
    parts.push(part(
        parts.is_empty().then_some("Differences"),
        Content::Table(titles, rows),
        "Means over the shifts of both runs, the largest difference first. Score: what the occupants feel, and times; error: of the estimates, where the true values are known; range: \
         widths of the ranges by the error budget; estimate: means of the inertia phase.",
    ));
    let (titles, rows) = pair_rows(runs);
    parts.push(part(
        Some("Shifts"),
        Content::Table(titles, rows),
        "The largest difference first. Rating and torque range: B less A, of the range that differs more. Curves: RMS difference of pressure and torque over the shift, of the clutch that differs \
         more.",
    ));
    let drawn: Vec<(&ShiftPair, Figure)> =
        runs.pairs.iter().filter_map(|pair| Some((pair, curves_figure(pair)?))).take(DRAWN).collect();
    let count = drawn.len();
    for (at, (pair, figure)) in drawn.into_iter().enumerate() {
        let [a, b] = &pair.shifts;
        let heading =
            format!("Shift {} of A and {} of B: {} {}", a.number, b.number, a.name(), a.kind.replace('_', " "));
        let caption = match at {
            0 if runs.pairs.len() > count => {
                format!("Time since the begin of the shift. Drawn are the {count} shifts with the largest differences.")
            }
            0 => "Time since the begin of the shift.".to_owned(),
            _ => String::new(),
        };
        parts.push(Part { heading: Some(heading.trim().to_owned()), content: Content::Figure(figure), caption });
    }
    parts
}

/// Sizes, ratings and errors of the shifts; none of a single shift.
fn over_shifts(runs: &RunComparison) -> Option<Figure> {
    let mut pairs: Vec<&ShiftPair> = runs.pairs.iter().collect();
    pairs.sort_by_key(|pair| pair.shifts[0].number);
    let number = |pair: &ShiftPair| pair.shifts[0].number as f64;
    let [first, last] = [pairs.first()?, pairs.last()?].map(|pair| number(pair));
    let both = |name: &str, size: f64| -> Vec<Series> {
        let run = |(at, (label, stroke)): (usize, (&str, Stroke))| Series {
            label: label.to_owned(),
            stroke,
            points: pairs
                .iter()
                .filter_map(|pair| {
                    Some((number(pair), size * pair.differences.iter().find(|of| of.name == name)?.values[at]))
                })
                .collect(),
        };
        [("A", A), ("B", B)].into_iter().enumerate().map(run).collect()
    };
    let sizes = Series {
        label: "largest difference".to_owned(),
        stroke: Stroke::SIGNAL,
        points: pairs.iter().map(|pair| (number(pair), 100.0 * pair.size())).collect(),
    };
    let panels = [
        ("size (%)", vec![sizes]),
        ("rating", both("rating", 1.0)),
        ("error of the torque in the inertia phase (N\u{a0}m)", both("inertia_phase_controlling_rms_n_m", 1.0)),
        ("error of the torque (N\u{a0}m)", both("torque_error_rms_n_m", 1.0)),
        ("range of the torque of the oncoming clutch (N\u{a0}m)", both("oncoming_torque_range_n_m", 1.0)),
        ("range of the pressure of the oncoming clutch (MPa)", both("oncoming_pressure_range_pa", 1e-6)),
    ];
    let panels = panels.into_iter().filter(|(_, series)| series.iter().any(|series| !series.points.is_empty()));
    let panels = panels.map(|(y_label, series)| panel(y_label.to_owned(), series, Vec::new())).collect();
    (last > first).then(|| Figure {
        x_label: "number of the shift".into(),
        x_range: (first, last),
        spans: Vec::new(),
        panels,
    })
}

fn panel(y_label: String, series: Vec<Series>, bands: Vec<Band>) -> Panel {
    Panel { y_label, height: 110.0, series, bands, axis: Axis::All }
}

/// The signals of a shift in both runs; none where they are not there.
fn curves_figure(pair: &ShiftPair) -> Option<Figure> {
    let [a, b] = pair.curves.as_ref()?;
    let panels: Vec<Panel> = SIGNALS
        .iter()
        .enumerate()
        .filter(|(at, _)| a[*at].points.len() > 1 || b[*at].points.len() > 1)
        .map(|(at, signal)| signal_panel(signal, &a[at], &b[at]))
        .collect();
    let times =
        panels.iter().flat_map(|panel| &panel.series).flat_map(|series| &series.points).map(|(time_s, _)| *time_s);
    let (first, last) =
        times.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), time_s| (low.min(time_s), high.max(time_s)));
    (last > first).then(|| Figure { x_label: "time (s)".into(), x_range: (first, last), spans: Vec::new(), panels })
}

fn signal_panel(signal: &Signal, a: &Curve, b: &Curve) -> Panel {
    let (unit, convert): (&str, fn(f64) -> f64) = match signal.unit {
        "Pa" => ("MPa", |pascal| 1e-6 * pascal),
        "rad/s" => ("rpm", rpm),
        "N m" => ("N\u{a0}m", |value| value),
        _ => ("m/s\u{b2}", |value| value),
    };
    let points =
        |points: &[(f64, f64)]| points.iter().map(|(time_s, value)| (*time_s, convert(*value))).collect::<Vec<_>>();
    let both = || [("A", a, A), ("B", b, B)].into_iter();
    let series =
        both().map(|(label, curve, stroke)| Series { label: label.to_owned(), stroke, points: points(&curve.points) });
    let bands = both().filter(|(_, curve, _)| !curve.lower.is_empty() && curve.lower.len() == curve.upper.len());
    let bands = bands.map(|(label, curve, stroke)| Band {
        label: format!("range of {label}"),
        colour: stroke.colour,
        lower: points(&curve.lower),
        upper: points(&curve.upper),
    });
    panel(format!("{} ({unit})", signal.title), series.collect(), bands.collect())
}
