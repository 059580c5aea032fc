//! The page of `wetclutch error-bound`: how large the errors of the observers' models are, and their causes.

use config::Study;
use report::figure::{Axis, Figure, Panel, Series, Stroke};
use report::palette::FAMILY;
use report::sheet::{Content, Part, Sheet};
use report::tables::{capital, number, phase_name};
use study::ErrorBound;
use study::campaign::PHASES;
use study::error_bound::{PARTS, PhaseErrors, Size};

/// Runs below which the quantiles of a [`Size`] lie, %; the largest is of all.
const FRACTIONS: [f64; 4] = [50.0, 95.0, 99.0, 100.0];

/// Every error of one phase with its name: the rigid model's size, channels and parts, the compliant model's channels.
pub(super) fn named(phase: &PhaseErrors) -> Vec<(String, &Size)> {
    let compliant: &[&str] =
        if phase.compliant_channels.len() == 3 { &["turbine", "slip", "wheel"] } else { &["turbine", "wheel"] };
    let channels = ["turbine", "slip"].iter().zip(&phase.rigid_channels);
    let mut rows = vec![("rigid model, |w|".to_owned(), &phase.rigid)];
    rows.extend(channels.map(|(name, size)| (format!("  {name} acceleration"), size)));
    rows.extend(PARTS.iter().zip(&phase.rigid_parts).map(|(part, size)| (format!("  due to {part}"), size)));
    let channels = compliant.iter().zip(&phase.compliant_channels);
    rows.extend(channels.map(|(name, size)| (format!("compliant model, {name} acceleration"), size)));
    rows
}

/// The page.
pub(super) fn sheet<'a>(found: &ErrorBound, study: &'a Study) -> Sheet<'a> {
    let phases = || PHASES.into_iter().zip(&found.phases);
    let mut parts = vec![Part {
        heading: Some("Error of the rigid model and its causes".to_owned()),
        content: Content::Figure(distributions(found)),
        caption: "The largest error of a run, below which 50, 95, 99 and 100 % of the runs stay. The error is the part w = dy/dt - F - G z of an \
                  acceleration that the model does not describe, with the true speeds, pressure and shaft torque, at every millisecond of a phase. The \
                  largest error of each cause is given by itself, so that the parts do not add up to the whole."
            .to_owned(),
    }];
    parts.extend(phases().map(|(phase, errors)| Part {
        heading: Some(capital(phase_name(phase))),
        content: table(errors),
        caption: format!(
            "Of {} runs. Settled: the largest error grew by no more than 2 % in the runs after that one.",
            errors.runs
        ),
    }));
    parts.push(Part {
        heading: Some("Values for the vehicle file".to_owned()),
        content: Content::Lines(found.toml(study).lines().map(str::to_owned).collect()),
        caption: String::new(),
    });
    let row = |factor: &config::Factor| {
        let [low, high] = factor.values.ends();
        vec![factor.name.clone(), low.to_string(), high.to_string()]
    };
    parts.push(Part {
        heading: Some("Factors of the study".to_owned()),
        content: Content::Table(
            ["factor", "from", "to"].map(str::to_owned).to_vec(),
            study.factors.iter().map(row).collect(),
        ),
        caption: String::new(),
    });
    Sheet {
        name: &study.title,
        title: "model errors",
        lead: format!(
            "{} \u{b7} {} runs, {} without a complete shift",
            study.vehicle.name, found.runs, found.unfinished
        ),
        sentences: Vec::new(),
        parts,
        sources: vec![&study.source, &study.experiment.source, &study.vehicle.source],
    }
}

fn sizes(size: &Size) -> [f64; 4] {
    let [half, most, nearly_all] = size.quantiles;
    [half, most, nearly_all, size.largest]
}

/// The rigid model's error and its parts, phase by phase.
fn distributions(found: &ErrorBound) -> Figure {
    let series = |label: &str, stroke: Stroke, size: &Size| Series {
        label: label.to_owned(),
        stroke,
        points: FRACTIONS.into_iter().zip(sizes(size)).collect(),
    };
    let panels = PHASES.into_iter().zip(&found.phases).map(|(phase, errors)| {
        let parts = PARTS.iter().zip(&errors.rigid_parts).zip(FAMILY);
        let parts = parts.map(|((name, size), stroke)| series(name, stroke, size));
        let whole = series("rigid model, |w|", Stroke::SIGNAL, &errors.rigid);
        Panel {
            y_label: format!("{} (rad/s\u{b2})", phase_name(phase)),
            height: 170.0,
            series: std::iter::once(whole).chain(parts).collect(),
            bands: Vec::new(),
            axis: Axis::All,
        }
    });
    Figure {
        x_label: "runs with a smaller error (%)".into(),
        x_range: (FRACTIONS[0], FRACTIONS[3]),
        spans: Vec::new(),
        panels: panels.collect(),
    }
}

fn table(errors: &PhaseErrors) -> Content {
    let titles =
        ["error", "largest rad/s^2", "50 % of runs below rad/s^2", "95 % rad/s^2", "99 % rad/s^2", "settled after run"];
    let row = |(name, size): (String, &Size)| {
        let [half, most, nearly_all, largest] = sizes(size).map(|value| number(value, 1));
        // What is a part of the line above stays behind it when the table is not sorted.
        let name = name.replace("  ", "\u{2003}");
        vec![name, largest, half, most, nearly_all, size.settled_after.to_string()]
    };
    Content::Table(titles.map(str::to_owned).to_vec(), named(errors).into_iter().map(row).collect())
}
