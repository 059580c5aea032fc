//! Pages and figures of whole experiments.

#![expect(clippy::unwrap_used, reason = "a test may")]

use std::path::Path;

use car::ObserverKind;
use config::{ExperimentFile, Study, VehicleFile};
use observer::Estimate;
use report::StudyPage;
use report::figure::{Axis, Panel, Weight};
use report::shift_figure::{observers_figure, shift_figure};
use study::campaign::{Metric, PHASES, factor_values};
use study::{Comparison, Row, Status, Summary, compare};

fn e1() -> Comparison {
    compare(&VehicleFile::built_in().unwrap(), &ExperimentFile::e1().unwrap()).unwrap()
}

fn panel(panels: &[Panel], quantity: &str) -> Panel {
    panels.iter().find(|panel| panel.y_label.starts_with(quantity)).unwrap().clone()
}

#[test]
fn the_headline_figure_shows_every_observer_and_the_default_one_strongest() {
    let comparison = e1();
    let figure = shift_figure(&comparison);
    let names: Vec<&str> = comparison.runs.iter().map(|run| run.entry.name.as_str()).collect();
    for quantity in ["clutch pressure", "clutch torque"] {
        let panel = panel(&figure.panels, quantity);
        let labels: Vec<&str> = panel.series.iter().map(|series| series.label.as_str()).collect();
        assert_eq!(labels, [&["true"], names.as_slice()].concat(), "{quantity}");
        assert!(!panel.bands.is_empty(), "{quantity} has the guaranteed range");
        let strongest: Vec<&str> =
            panel.series.iter().filter(|s| s.stroke.weight == Weight::Main).map(|s| s.label.as_str()).collect();
        assert_eq!(strongest, ["Kalman, 100 Hz"], "{quantity}");
    }
}

#[test]
fn an_observer_has_one_colour_whatever_stands_beside_it() {
    let all = e1();
    let mut few = all.clone();
    few.runs.retain(|run| matches!(run.entry.kind, ObserverKind::Kalman | ObserverKind::OpenLoop));
    few.bound_pa.clear();
    let stroke = |comparison: &Comparison, name: &str| {
        let series = panel(&observers_figure(comparison).panels, "pressure error").series;
        series.into_iter().find(|series| series.label == name).unwrap().stroke
    };
    for name in ["Kalman, 100 Hz", "open loop"] {
        assert_eq!(stroke(&all, name), stroke(&few, name));
    }
}

#[test]
fn a_diverged_observer_leaves_the_axes_to_the_others() {
    let mut comparison = e1();
    let sound = shift_figure(&comparison);
    for estimate in &mut comparison.runs[2].estimates {
        *estimate = Estimate { pressure_pa: -1e16, clutch_torque_n_m: 1e16, ..*estimate };
    }
    let figure = shift_figure(&comparison);
    for quantity in ["clutch pressure", "pressure error", "clutch torque"] {
        let limits = |panels: &[Panel]| match panel(panels, quantity).axis {
            Axis::Within(low, high) => (low, high),
            axis => panic!("{quantity}: {axis:?}"),
        };
        assert_eq!(limits(&figure.panels), limits(&sound.panels), "{quantity}");
    }
    assert!(figure.svg().contains("1.0e16"), "the figure says what it leaves out");
}

#[test]
fn a_drive_without_a_shift_or_without_observers_has_a_figure() {
    let mut comparison = e1();
    comparison.quality = None;
    assert!(shift_figure(&comparison).svg().ends_with("</svg>"));
    comparison.runs.clear();
    assert!(shift_figure(&comparison).svg().ends_with("</svg>"));
}

#[test]
fn a_study_page_compares_both_errors_with_the_open_loop_and_says_which_factors_are_in_a_part_of_the_runs() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../experiments/combined.toml");
    let study = Study::read(&file).unwrap();
    let mut summary = Summary::new(&study);
    for run in 0..20 {
        let mut numbers = factor_values(&study, run);
        numbers.resize(summary.layout.width(), 1.0);
        for phase in 0..PHASES.len() {
            numbers[summary.layout.score(0, phase, Metric::PressureRms)] = 0.25;
            numbers[summary.layout.score(0, phase, Metric::TorqueRms)] = 0.75;
        }
        summary.push(&Row { run, seed: 0, status: Status::Ok, numbers });
    }
    let html = StudyPage::of(&summary, &study, &[], "wetclutch study").unwrap().html;
    // Two phases, with five ratios each. Quantiles are good to half a per cent.
    let relative = html.split("Relative to the open loop").nth(1).unwrap().split("</table>").next().unwrap();
    for ratio in ["<td>0.25</td>", "<td>0.75</td>"] {
        assert_eq!(relative.matches(ratio).count(), 10, "{ratio}");
    }
    let of_wheel = html.split("<code>experiment.sensors.wheel.scale</code>").nth(1).unwrap();
    assert!(of_wheel.starts_with("</td><td>0.98</td><td>1.02</td><td>50</td><td>1</td>"), "{of_wheel:.80}");
}

#[test]
fn a_study_without_runs_has_a_page() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../experiments/settings.toml");
    let study = Study::read(&file).unwrap();
    let page = StudyPage::of(&Summary::new(&study), &study, &[], "wetclutch study").unwrap();
    assert!(page.html.contains("0 runs"));
    // The script of the page stands behind it.
    let shown = page.html.split("<main>").nth(1).unwrap().split("</main>").next().unwrap();
    let at = shown.find("NaN");
    assert!(at.is_none(), "{}", &shown[at.unwrap().saturating_sub(200)..]);
}
