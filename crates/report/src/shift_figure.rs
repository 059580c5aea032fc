//! The figures of a shift and of the drive around it.

use config::ObserverKind;
use observer::Bounds;
use study::{Comparison, ObserverRun, ShiftQuality};
use trace::{Trace, signal, units};

use crate::figure::{Band, Figure, Panel, Series, Span, colour};

/// Colour of the torque phase.
const TORQUE_PHASE: &str = "#fdf0d5";
/// Colour of the inertia phase.
const INERTIA_PHASE: &str = "#e3eef7";
/// Colours of the observers in their order; the open loop has its own.
pub(crate) const OBSERVERS: [&str; 9] = [
    colour::BLUE,
    colour::GREEN,
    colour::ORANGE,
    colour::PURPLE,
    colour::SKY,
    colour::GREY,
    colour::BROWN,
    colour::PINK,
    colour::OLIVE,
];
/// How much is shown before the load transfer and after lock-up, s.
const MARGIN_S: f64 = 0.35;

/// Speeds, pressures, errors, torques and currents through the shift.
pub fn shift_figure(comparison: &Comparison) -> Figure {
    let t = Curves::of(comparison);
    let bound = t.bound();
    let panels = vec![
        t.speeds(130.0),
        t.pressure_panel().within(0.0, 0.5),
        Panel {
            band: (!bound.is_empty()).then(|| Band {
                label: "certified band of the rigid observer".into(),
                lower: bound.iter().map(|&(time, width)| (time, -width)).collect(),
                upper: bound,
            }),
            ..panel("error (MPa)", 150.0, t.pressure_errors()).within(-0.14, 0.14)
        },
        panel(
            "torque (N m)",
            150.0,
            vec![
                t.signal("clutch A", colour::PURPLE, signal::OFFGOING_TORQUE, |x| x),
                t.signal("clutch B, true", colour::BLACK, signal::ONCOMING_TORQUE, |x| x),
                t.clutch_torque(),
                t.signal("turbine", colour::GREEN, signal::TURBINE_TORQUE, |x| x),
            ],
        ),
        panel(
            "shaft torque (N m)",
            120.0,
            [vec![t.signal("true", colour::BLACK, signal::SHAFT_TORQUE, |x| x)], t.shaft_torques()].concat(),
        ),
        panel(
            "current (A), throttle",
            120.0,
            vec![
                t.signal("current A", colour::PURPLE, signal::OFFGOING_CURRENT, |x| x),
                t.signal("current B", colour::BLACK, signal::ONCOMING_CURRENT, |x| x),
                t.signal("throttle (0–1)", colour::ORANGE, signal::THROTTLE, |x| x),
            ],
        )
        .within(0.0, 1.0),
    ];
    t.around_shift(panels)
}

/// Pressures and errors through the shift: what an experiment with several observers is about.
pub fn observers_figure(comparison: &Comparison) -> Figure {
    observers_of(&comparison.runs, &comparison.trace, comparison.quality.as_ref())
}

/// As [`observers_figure`], of a run without the rest of a comparison.
pub fn observers_of(runs: &[ObserverRun], trace: &Trace, quality: Option<&ShiftQuality>) -> Figure {
    let t = Curves { runs, trace, quality, bound_pa: &[] };
    let highest = t.highest_pressure().max(0.4);
    let mut panels = vec![
        t.pressure_panel().within(0.0, 1.25 * highest),
        panel("error (MPa)", 190.0, t.pressure_errors()).within(-0.35 * highest, 0.35 * highest),
    ];
    let shaft = t.shaft_torques();
    if !shaft.is_empty() {
        let truth = t.signal("true", colour::BLACK, signal::SHAFT_TORQUE, |x| x);
        panels.push(panel("shaft torque (N m)", 150.0, [vec![truth], shaft].concat()));
    }
    t.around_shift(panels)
}

/// Speeds and acceleration from standstill to the end.
pub fn drive_figure(comparison: &Comparison) -> Figure {
    let t = Curves::of(comparison);
    let end = comparison.trace.time_s.last().copied().unwrap_or(1.0);
    let unnamed = |span: Span| Span { label: String::new(), ..span };
    Figure {
        x_label: "time (s)",
        x_range: (0.0, end),
        spans: t.spans().into_iter().map(unnamed).collect(),
        panels: vec![
            t.speeds(150.0),
            panel("vehicle (km/h)", 90.0, vec![t.signal("vehicle", colour::BLACK, signal::VEHICLE_SPEED, units::km_h)]),
            panel("accel. (m/s²)", 90.0, vec![t.signal("vehicle", colour::BLACK, signal::VEHICLE_ACCELERATION, |x| x)]),
        ],
    }
}

fn panel(y_label: &str, height: f64, series: Vec<Series>) -> Panel {
    Panel { y_label: y_label.to_owned(), height, series, band: None, y_range: None }
}

/// Colours of observers of these kinds: the open loop has its own, the others go by their place.
pub(crate) fn observer_colours(kinds: impl Iterator<Item = ObserverKind>) -> Vec<&'static str> {
    let mut others = OBSERVERS.iter().cycle();
    kinds
        .map(|kind| match kind {
            ObserverKind::OpenLoop => colour::VERMILION,
            _ => others.next().copied().unwrap_or(colour::GREY),
        })
        .collect()
}

struct Curves<'a> {
    runs: &'a [ObserverRun],
    trace: &'a Trace,
    quality: Option<&'a ShiftQuality>,
    bound_pa: &'a [Option<f64>],
}

impl<'a> Curves<'a> {
    fn of(comparison: &'a Comparison) -> Self {
        Self {
            runs: &comparison.runs,
            trace: &comparison.trace,
            quality: comparison.quality.as_ref(),
            bound_pa: &comparison.bound_pa,
        }
    }

    /// Panels around the shift, its phases shaded.
    fn around_shift(&self, panels: Vec<Panel>) -> Figure {
        let spans = self.spans();
        let whole = (0.0, self.trace.time_s.last().copied().unwrap_or(1.0));
        let x_range = match (spans.first(), spans.last()) {
            (Some(first), Some(last)) => ((first.start - MARGIN_S).max(whole.0), (last.end + MARGIN_S).min(whole.1)),
            _ => whole,
        };
        Figure { x_label: "time (s)", x_range, spans, panels }
    }

    /// Torque and inertia phase as shaded spans.
    fn spans(&self) -> Vec<Span> {
        let Some(quality) = self.quality else { return Vec::new() };
        let span = |label: &str, start, end, colour| Span { label: label.to_owned(), start, end, colour };
        let middle = quality.inertia_phase_start_s;
        vec![
            span("torque phase", quality.torque_phase_start_s, middle, TORQUE_PHASE),
            span("inertia phase", middle, quality.lock_up_s, INERTIA_PHASE),
        ]
    }

    fn speeds(&self, height: f64) -> Panel {
        panel(
            "speed (rpm)",
            height,
            vec![
                self.signal("engine", colour::GREEN, signal::ENGINE_SPEED, units::rpm),
                self.signal("turbine", colour::BLACK, signal::TURBINE_SPEED, units::rpm),
                self.signal("output", colour::PURPLE, signal::OUTPUT_SPEED, units::rpm),
            ],
        )
    }

    /// Pressures, the true one with its guaranteed range.
    fn pressure_panel(&self) -> Panel {
        let truth = self.signal("true", colour::BLACK, signal::ONCOMING_PRESSURE, units::mpa);
        let ends = |end: usize| -> Vec<(f64, f64)> {
            self.runs.first().map_or_else(Vec::new, |run| {
                let value = |bounds: &Option<Bounds<f64>>| bounds.map_or(f64::NAN, |b| units::mpa(b.pressure_pa[end]));
                run.time_s.iter().zip(&run.estimates).map(|(&time, e)| (time, value(&e.bounds))).collect()
            })
        };
        let band = Band { label: String::new(), lower: ends(0), upper: ends(1) };
        Panel { band: Some(band), ..panel("pressure of B (MPa)", 190.0, [vec![truth], self.pressures()].concat()) }
    }

    /// Highest true pressure until lock-up, MPa.
    fn highest_pressure(&self) -> f64 {
        let end_s = self.quality.map_or(f64::INFINITY, |quality| quality.lock_up_s);
        let pressures = self.trace.get(signal::ONCOMING_PRESSURE).unwrap_or_default();
        let samples = self.trace.time_s.iter().zip(pressures).take_while(|(time, _)| **time < end_s);
        samples.map(|(_, &pressure)| units::mpa(pressure)).fold(0.0, f64::max)
    }

    /// A column of the trace, in the unit that people read.
    fn signal(&self, label: &str, colour: &'static str, name: &str, unit: impl Fn(f64) -> f64) -> Series {
        let values = self.trace.get(name).unwrap_or_default();
        let points = self.trace.time_s.iter().zip(values).map(|(&t, &v)| (t, unit(v))).collect();
        Series { label: label.to_owned(), colour, dashed: false, points }
    }

    /// A curve of each observer; those without a finite value are left out.
    fn of_observers(&self, value: impl Fn(&ObserverRun, usize) -> f64) -> Vec<Series> {
        let colours = observer_colours(self.runs.iter().map(|run| run.entry.kind));
        (self.runs.iter().zip(colours))
            .map(|(run, colour)| Series {
                label: run.entry.name.clone(),
                colour,
                dashed: run.entry.kind == ObserverKind::OpenLoop,
                points: run.time_s.iter().enumerate().map(|(i, &t)| (t, value(run, i))).collect(),
            })
            .filter(|series| series.points.iter().any(|(_, value)| value.is_finite()))
            .collect()
    }

    fn pressures(&self) -> Vec<Series> {
        self.of_observers(|run, i| units::mpa(run.estimates[i].pressure_pa))
    }

    fn pressure_errors(&self) -> Vec<Series> {
        self.of_observers(|run, i| units::mpa(run.truth_pa[i] - run.estimates[i].pressure_pa))
    }

    fn shaft_torques(&self) -> Vec<Series> {
        self.of_observers(|run, i| run.estimates[i].shaft_torque_n_m.unwrap_or(f64::NAN))
    }

    /// Clutch torque as the first observer estimates it.
    fn clutch_torque(&self) -> Series {
        let points = self.runs.first().map(|run| {
            run.time_s.iter().zip(&run.estimates).map(|(&t, estimate)| (t, estimate.clutch_torque_n_m)).collect()
        });
        let name = self.runs.first().map_or("", |run| &run.entry.name);
        Series {
            label: format!("clutch B, {name}"),
            colour: colour::BLUE,
            dashed: false,
            points: points.unwrap_or_default(),
        }
    }

    fn bound(&self) -> Vec<(f64, f64)> {
        let Some(run) = self.runs.first() else { return Vec::new() };
        let bounds = self.bound_pa.iter().map(|bound| bound.map_or(f64::NAN, units::mpa));
        run.time_s.iter().copied().zip(bounds).collect()
    }
}
