//! The page of a study of cars with a gearbox: errors by kind and class of shift.

use config::CarStudy;
use drivetrain::ShiftKind;
use report::figure::{Axis, Figure, Panel, Series};
use report::matrix_page::kind_rows;
use report::palette::FAMILY;
use report::sheet::{Content, Part, Sheet};
use study::gearbox::campaign::CarSummary;
use study::gearbox::matrix::{CLASSES, Matrix, Pooled};

/// The phases of the errors of a matrix.
const PHASES: [&str; 2] = ["torque phase", "inertia phase"];

/// The page; `sentences` are what the command says of the whole study.
pub(super) fn sheet<'a>(
    study: &'a CarStudy,
    matrix: &Matrix,
    summary: &CarSummary,
    sentences: Vec<String>,
) -> Sheet<'a> {
    let (titles, rows) = kind_rows(matrix);
    let parts = [
        figure(matrix).map(|figure| Part {
            heading: Some("Error over that of the open loop".to_owned()),
            content: Content::Figure(figure),
            caption: "RMS error of the torque of the clutch that controls the inertia phase, over that of the open loop, which is the valve model alone; without shifts in which the open loop errs by less than 2 N m. \
                      1/|i_off - i_on| gives by how much an error of the gearbox output torque shows in a clutch torque in the torque phase; here the lower end of each class."
                .to_owned(),
        }),
        Some(Part {
            heading: Some("Kinds of shift".to_owned()),
            content: Content::Table(titles, rows),
            caption: "Of the clutch that controls the inertia phase; other: of the clutch that does not. N m: RMS errors of filter / open loop. In brackets: the open loop errs by \
                      less than 2 N m. Above: phases in which the filter is above the open loop by more than 1 N m."
                .to_owned(),
        }),
    ];
    Sheet {
        name: &study.title,
        title: "study",
        lead: format!(
            "{} \u{b7} {} cars, {} shifts \u{b7} seed {}",
            study.car.name,
            summary.runs,
            summary.shifts(),
            study.seed
        ),
        sentences,
        parts: parts.into_iter().flatten().collect(),
        sources: vec![&study.source, &study.car.source, &study.car.gearbox_source],
    }
}

/// The ratio of the errors of each kind over the classes; none of a single class.
fn figure(matrix: &Matrix) -> Option<Figure> {
    let panels = PHASES.into_iter().enumerate().rev().map(|(phase, name)| {
        let series = ShiftKind::ALL.into_iter().zip(FAMILY).map(|(kind, stroke)| Series {
            label: kind.name().to_owned(),
            stroke,
            points: CLASSES
                .into_iter()
                .filter_map(|from| {
                    let of = Pooled::of(&matrix.rows, |shift| shift.kind == kind && shift.gain == from);
                    Some((from, of.torque[phase][0].ratio()?))
                })
                .collect(),
        });
        let series = series.filter(|series| !series.points.is_empty()).collect();
        Panel { y_label: name.to_owned(), height: 150.0, series, bands: Vec::new(), axis: Axis::All }
    });
    let classes = matrix.rows.iter().map(|row| row.shift.gain);
    let (first, last) = classes.fold((f64::INFINITY, 0.0), |(low, high), gain| (gain.min(low), gain.max(high)));
    (last > first).then(|| Figure {
        x_label: "1/|i_off - i_on|".into(),
        x_range: (first, last),
        spans: Vec::new(),
        panels: panels.collect(),
    })
}
