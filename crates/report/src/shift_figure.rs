//! The figures of a shift and of the drive around it.

use study::Comparison;
use trace::{signal, units};

use crate::figure::{Band, Figure, Panel, Series, Span, colour};

/// Colour of the torque phase.
const TORQUE_PHASE: &str = "#fdf0d5";
/// Colour of the inertia phase.
const INERTIA_PHASE: &str = "#e3eef7";

/// Speeds, pressures, torques, shaft torque, currents and errors through the shift.
pub fn shift_figure(comparison: &Comparison) -> Figure {
    let spans = spans(comparison);
    let from = spans.first().map_or(0.0, |span| span.start_s - 0.35);
    let to = spans.last().map_or(1.0, |span| span.end_s + 0.35);
    let t = Curves { comparison };
    Figure {
        time_range_s: (from.max(0.0), to),
        panels: vec![
            Panel {
                y_label: "speed (rpm)".into(),
                height: 130.0,
                series: vec![
                    t.signal("engine", colour::GREEN, signal::ENGINE_SPEED, units::rpm),
                    t.signal("turbine", colour::BLACK, signal::TURBINE_SPEED, units::rpm),
                    t.signal("output", colour::PURPLE, signal::OUTPUT_SPEED, units::rpm),
                ],
                band: None,
                y_range: None,
            },
            Panel {
                y_label: "pressure of B (MPa)".into(),
                height: 190.0,
                series: [
                    vec![t.signal("true", colour::BLACK, signal::ONCOMING_PRESSURE, units::mpa)],
                    t.pressure_estimates(),
                ]
                .concat(),
                band: None,
                y_range: Some((0.0, 0.5)),
            },
            Panel {
                y_label: "error (MPa)".into(),
                height: 150.0,
                series: t.pressure_errors(),
                band: Some(Band { label: "certified band of ISS".into(), half_width: t.bound() }),
                y_range: Some((-0.14, 0.14)),
            },
            Panel {
                y_label: "torque (N m)".into(),
                height: 150.0,
                series: vec![
                    t.signal("clutch A", colour::PURPLE, signal::OFFGOING_TORQUE, |x| x),
                    t.signal("clutch B, true", colour::BLACK, signal::ONCOMING_TORQUE, |x| x),
                    t.torque_estimate("clutch B, ISS"),
                    t.signal("turbine", colour::GREEN, signal::TURBINE_TORQUE, |x| x),
                ],
                band: None,
                y_range: None,
            },
            Panel {
                y_label: "shaft (N m)".into(),
                height: 90.0,
                series: vec![t.signal("drive shafts", colour::BLACK, signal::SHAFT_TORQUE, |x| x)],
                band: None,
                y_range: None,
            },
            Panel {
                y_label: "current (A), throttle".into(),
                height: 120.0,
                series: vec![
                    t.signal("current A", colour::PURPLE, signal::OFFGOING_CURRENT, |x| x),
                    t.signal("current B", colour::BLACK, signal::ONCOMING_CURRENT, |x| x),
                    t.signal("throttle (0–1)", colour::ORANGE, signal::THROTTLE, |x| x),
                ],
                band: None,
                y_range: Some((0.0, 1.0)),
            },
        ],
        spans,
    }
}

/// Speeds and acceleration from standstill to the end.
pub fn drive_figure(comparison: &Comparison) -> Figure {
    let t = Curves { comparison };
    let end = comparison.trace.time_s.last().copied().unwrap_or(1.0);
    Figure {
        time_range_s: (0.0, end),
        spans: spans(comparison).into_iter().map(|span| Span { label: String::new(), ..span }).collect(),
        panels: vec![
            Panel {
                y_label: "speed (rpm)".into(),
                height: 150.0,
                series: vec![
                    t.signal("engine", colour::GREEN, signal::ENGINE_SPEED, units::rpm),
                    t.signal("turbine", colour::BLACK, signal::TURBINE_SPEED, units::rpm),
                    t.signal("output", colour::PURPLE, signal::OUTPUT_SPEED, units::rpm),
                ],
                band: None,
                y_range: None,
            },
            Panel {
                y_label: "vehicle (km/h)".into(),
                height: 90.0,
                series: vec![t.signal("vehicle", colour::BLACK, signal::VEHICLE_SPEED, units::km_h)],
                band: None,
                y_range: None,
            },
            Panel {
                y_label: "accel. (m/s²)".into(),
                height: 90.0,
                series: vec![t.signal("vehicle", colour::BLACK, signal::VEHICLE_ACCELERATION, |x| x)],
                band: None,
                y_range: None,
            },
        ],
    }
}

/// Torque and inertia phase as shaded spans.
fn spans(comparison: &Comparison) -> Vec<Span> {
    let Some(quality) = &comparison.quality else { return Vec::new() };
    vec![
        Span {
            label: "torque phase".into(),
            start_s: quality.torque_phase_start_s,
            end_s: quality.inertia_phase_start_s,
            colour: TORQUE_PHASE,
        },
        Span {
            label: "inertia phase".into(),
            start_s: quality.inertia_phase_start_s,
            end_s: quality.lock_up_s,
            colour: INERTIA_PHASE,
        },
    ]
}

struct Curves<'a> {
    comparison: &'a Comparison,
}

impl Curves<'_> {
    fn points(&self, value: impl Fn(usize) -> f64) -> Vec<(f64, f64)> {
        self.comparison.trace.time_s.iter().enumerate().map(|(i, &t)| (t, value(i))).collect()
    }

    /// A column of the trace, in the unit that people read.
    fn signal(&self, label: &str, colour: &'static str, name: &str, unit: impl Fn(f64) -> f64) -> Series {
        let values = self.comparison.trace.get(name).unwrap_or_default();
        let points = self.points(|i| values.get(i).map_or(f64::NAN, |&v| unit(v)));
        Series { label: label.to_owned(), colour, dashed: false, points }
    }

    fn estimate_series(&self, value: impl Fn(usize, usize) -> f64) -> Vec<Series> {
        (self.comparison.runs.iter().zip([colour::BLUE, colour::VERMILION]).enumerate())
            .map(|(run, (observer, colour))| Series {
                label: observer.name.to_owned(),
                colour,
                dashed: observer.name == study::comparison::OPEN_LOOP,
                points: self.points(|i| value(run, i)),
            })
            .collect()
    }

    fn pressure_estimates(&self) -> Vec<Series> {
        self.estimate_series(|run, i| units::mpa(self.comparison.runs[run].estimates[i].pressure_pa))
    }

    fn pressure_errors(&self) -> Vec<Series> {
        let truth = self.comparison.trace.get(signal::ONCOMING_PRESSURE).unwrap_or_default();
        self.estimate_series(|run, i| units::mpa(truth[i] - self.comparison.runs[run].estimates[i].pressure_pa))
    }

    fn torque_estimate(&self, label: &str) -> Series {
        let estimates = &self.comparison.runs[0].estimates;
        let points = self.points(|i| estimates[i].clutch_torque_n_m);
        Series { label: label.to_owned(), colour: colour::BLUE, dashed: false, points }
    }

    fn bound(&self) -> Vec<(f64, f64)> {
        self.points(|i| self.comparison.bound_pa[i].map_or(f64::NAN, units::mpa))
    }
}
