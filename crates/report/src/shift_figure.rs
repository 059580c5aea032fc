//! The figures of a shift and of the drive around it.

use drivetrain::jerk::WINDOW_S;
use observer::{Bounds, Estimate};
use study::{Comparison, ObserverRun, ShiftQuality};
use trace::{Trace, signal, units};

use crate::figure::{Axis, Band, Figure, Panel, Series, Span, Stroke, extremes};
use crate::motion::motion_panels;
use crate::palette::{RANGE, main_observer, observer_strokes};
use crate::panels::{panel, with_values};

/// Colour of the torque phase.
pub(crate) const TORQUE_PHASE: &str = "#fbf0d0";
/// Colour of the inertia phase.
pub(crate) const INERTIA_PHASE: &str = "#ededed";
/// How much is shown before the load transfer and after lock-up, over the time between them.
const MARGIN: f64 = 0.55;
/// Smallest range of pressures that an axis is made for, MPa.
const MIN_MPA: f64 = 0.01;

/// Speeds, pressures, errors, torques and currents through the shift.
pub fn shift_figure(comparison: &Comparison) -> Figure {
    let t = Curves::of(comparison);
    let mut panels = vec![t.speeds(130.0)];
    panels.extend(t.observers());
    panels.extend(t.commands());
    t.around_shift(panels)
}

/// As [`shift_figure`], with friction power, acceleration and jerk.
pub(crate) fn page_figure(comparison: &Comparison) -> Figure {
    let t = Curves::of(comparison);
    let mut figure = shift_figure(comparison);
    figure.panels.push(t.friction_power());
    let (from_s, to_s) = figure.x_range;
    let speeds = comparison.trace.get(signal::VEHICLE_SPEED).unwrap_or_default();
    let speeds = comparison.trace.time_s.iter().copied().zip(speeds.iter().copied());
    // Windows at both ends of the figure reach beyond it.
    let around = speeds.filter(|(time_s, _)| (from_s - WINDOW_S..=to_s + WINDOW_S).contains(time_s));
    figure.panels.extend(motion_panels(around));
    (figure.panels, _) = with_values(figure.panels);
    figure
}

/// Pressures, torques and errors through the shift: what an experiment with several observers is about.
pub fn observers_figure(comparison: &Comparison) -> Figure {
    let t = Curves::of(comparison);
    t.around_shift(t.observers())
}

/// As [`observers_figure`], of a run without the rest of a comparison.
pub fn observers_of(runs: &[ObserverRun], trace: &Trace, quality: Option<&ShiftQuality>) -> Figure {
    let t = Curves { runs, trace, quality, bound_pa: &[] };
    t.around_shift(t.observers())
}

/// Speeds and acceleration from standstill to the end.
pub fn drive_figure(comparison: &Comparison) -> Figure {
    let t = Curves::of(comparison);
    let end = comparison.trace.time_s.last().copied().unwrap_or(1.0);
    let unnamed = |span: Span| Span { label: String::new(), ..span };
    let vehicle = |name, unit: fn(f64) -> f64| vec![t.signal("vehicle", Stroke::SIGNAL, name, unit)];
    Figure {
        x_label: "time (s)".into(),
        x_range: (0.0, end),
        spans: t.spans().into_iter().map(unnamed).collect(),
        panels: vec![
            t.speeds(150.0),
            panel("speed (km/h)", 90.0, vehicle(signal::VEHICLE_SPEED, units::km_h)),
            panel("acceleration (m/s²)", 90.0, vehicle(signal::VEHICLE_ACCELERATION, |x| x)),
        ],
    }
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
        Figure { x_label: "time (s)".into(), x_range: self.shown_s(), spans: self.spans(), panels }
    }

    /// The shift and some time around it, s; the whole drive if there was none.
    fn shown_s(&self) -> (f64, f64) {
        let end_s = self.trace.time_s.last().copied().unwrap_or(1.0);
        self.quality.map_or((0.0, end_s), |quality| {
            let (from, to) = (quality.torque_phase_start_s, quality.lock_up_s);
            let margin = MARGIN * (to - from);
            ((from - margin).max(0.0), (to + margin).min(end_s))
        })
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
                self.signal("engine", Stroke::THIRD, signal::ENGINE_SPEED, units::rpm),
                self.signal("turbine", Stroke::SIGNAL, signal::TURBINE_SPEED, units::rpm),
                self.signal("gearbox output", Stroke::SECOND, signal::OUTPUT_SPEED, units::rpm),
            ],
        )
    }

    /// Pressure, its error, and both torques, as far as there are estimates.
    fn observers(&self) -> Vec<Panel> {
        let panels = [self.pressure(), self.pressure_error(), self.clutch_torque(), self.shaft_torque()];
        panels.into_iter().flatten().collect()
    }

    /// Pressures, with the guaranteed range.
    ///
    /// The axis follows the truth until lock-up: then the pressure rises to that of the line, and none of the observers
    /// sees it any more.
    fn pressure(&self) -> Option<Panel> {
        let truth = self.signal("true", Stroke::TRUTH, signal::ONCOMING_PRESSURE, units::mpa);
        let (low, high) = self.until_lock_up(&truth)?;
        let size = (high - low).max(MIN_MPA);
        Some(Panel {
            bands: self.range(|bounds| Some(bounds.pressure_pa.map(units::mpa))),
            axis: Axis::Within(low - 0.2 * size, high + 0.3 * size),
            ..panel(
                "clutch pressure (MPa)",
                215.0,
                [vec![truth], self.estimates(|e| units::mpa(e.pressure_pa))].concat(),
            )
        })
    }

    /// Errors of the pressure, with the band of the rigid observer's certificate.
    fn pressure_error(&self) -> Option<Panel> {
        let truth = self.signal("true", Stroke::TRUTH, signal::ONCOMING_PRESSURE, units::mpa);
        let (low, high) = self.until_lock_up(&truth)?;
        let maximum = 0.5 * (high - low).max(MIN_MPA);
        let errors = self.of_observers(|run, i| units::mpa(run.truth_pa[i] - run.estimates[i].pressure_pa));
        Some(Panel {
            bands: self.certified_band().into_iter().collect(),
            axis: Axis::Within(-maximum, maximum),
            ..panel("pressure error (MPa)", 165.0, errors)
        })
    }

    /// Torques of the oncoming clutch, with the guaranteed range.
    fn clutch_torque(&self) -> Option<Panel> {
        let truth = self.signal("true", Stroke::TRUTH, signal::ONCOMING_TORQUE, |x| x);
        let axis = self.around(&truth)?;
        let estimates = self.estimates(|e| e.clutch_torque_n_m);
        Some(Panel {
            bands: self.range(|bounds| Some(bounds.clutch_torque_n_m)),
            axis,
            ..panel("clutch torque (N\u{a0}m)", 190.0, [vec![truth], estimates].concat())
        })
    }

    /// Torques of the drive shafts, if an observer estimates them.
    fn shaft_torque(&self) -> Option<Panel> {
        let truth = self.signal("true", Stroke::TRUTH, signal::SHAFT_TORQUE, |x| x);
        let axis = self.around(&truth)?;
        let estimates = self.estimates(|e| e.shaft_torque_n_m.unwrap_or(f64::NAN));
        (!estimates.is_empty())
            .then(|| Panel { axis, ..panel("shaft torque (N\u{a0}m)", 150.0, [vec![truth], estimates].concat()) })
    }

    /// An axis around the whole of a curve, with room below and above for estimates of it.
    fn around(&self, truth: &Series) -> Option<Axis> {
        let (low, high) = within(truth, self.shown_s())?;
        let room = (high - low).max(1.0);
        Some(Axis::Within(low - room, high + room))
    }

    /// Lowest and highest value of a curve until lock-up.
    fn until_lock_up(&self, truth: &Series) -> Option<(f64, f64)> {
        let (from, to) = self.shown_s();
        within(truth, (from, self.quality.map_or(to, |quality| quality.lock_up_s)))
    }

    /// What the valves and the engine are commanded.
    fn commands(&self) -> [Panel; 2] {
        let (title, [oncoming, offgoing]) = if self.trace.get(signal::ONCOMING_DUTY).is_some() {
            ("duty cycle (%)", [signal::ONCOMING_DUTY, signal::OFFGOING_DUTY])
        } else {
            ("current (A)", [signal::ONCOMING_CURRENT, signal::OFFGOING_CURRENT])
        };
        let command = |label, stroke, column| self.signal(label, stroke, column, |x| x);
        let valves = vec![
            command("oncoming clutch", Stroke::SIGNAL, oncoming),
            command("offgoing clutch", Stroke::SECOND, offgoing),
        ];
        let throttle = vec![command("throttle", Stroke::SIGNAL, signal::THROTTLE)];
        [panel(title, 80.0, valves), panel("throttle (0\u{a0}to\u{a0}1)", 60.0, throttle)]
    }

    /// Torque times slip of both clutches.
    fn friction_power(&self) -> Panel {
        let power = |label: &str, stroke, torque, slip| {
            let [torque, slip] = [torque, slip].map(|name| self.trace.get(name).unwrap_or_default());
            let power = torque.iter().zip(slip).map(|(torque, slip)| 1e-3 * torque * slip);
            Series { label: label.to_owned(), stroke, points: self.trace.time_s.iter().copied().zip(power).collect() }
        };
        panel(
            "friction power (kW)",
            90.0,
            vec![
                power("oncoming clutch", Stroke::SIGNAL, signal::ONCOMING_TORQUE, signal::ONCOMING_SLIP),
                power("offgoing clutch", Stroke::SECOND, signal::OFFGOING_TORQUE, signal::OFFGOING_SLIP),
            ],
        )
    }

    /// A column of the trace, in the unit that people read.
    fn signal(&self, label: &str, stroke: Stroke, name: &str, unit: impl Fn(f64) -> f64) -> Series {
        let values = self.trace.get(name).unwrap_or_default();
        let points = self.trace.time_s.iter().zip(values).map(|(&t, &v)| (t, unit(v))).collect();
        Series { label: label.to_owned(), stroke, points }
    }

    /// A curve of each observer; those without a finite value are left out.
    fn of_observers(&self, value: impl Fn(&ObserverRun, usize) -> f64) -> Vec<Series> {
        let strokes = observer_strokes(self.runs.iter().map(|run| &run.entry));
        (self.runs.iter().zip(strokes))
            .map(|(run, stroke)| Series {
                label: run.entry.name.clone(),
                stroke,
                points: run.time_s.iter().enumerate().map(|(i, &t)| (t, value(run, i))).collect(),
            })
            .filter(|series| series.points.iter().any(|(_, value)| value.is_finite()))
            .collect()
    }

    fn estimates(&self, value: impl Fn(&Estimate<f64>) -> f64) -> Vec<Series> {
        self.of_observers(|run, i| value(&run.estimates[i]))
    }

    /// The guaranteed range, as the main observer carries it, if there is one.
    fn range(&self, of: impl Fn(&Bounds<f64>) -> Option<[f64; 2]>) -> Vec<Band> {
        let main = main_observer(self.runs.iter().map(|run| &run.entry));
        let Some(run) = self.runs.get(main) else { return Vec::new() };
        let ends = |end: usize| -> Vec<(f64, f64)> {
            let value = |bounds: &Bounds<f64>| of(bounds).map_or(f64::NAN, |ends| ends[end]);
            let estimates = run.time_s.iter().zip(&run.estimates);
            estimates.map(|(&time, e)| (time, e.bounds.as_ref().map_or(f64::NAN, value))).collect()
        };
        let band = Band { label: "guaranteed range".into(), colour: RANGE, lower: ends(0), upper: ends(1) };
        if band.upper.iter().any(|(_, value)| value.is_finite()) { vec![band] } else { Vec::new() }
    }

    /// The bound of the certificate of the first observer, where it is the rigid one.
    fn certified_band(&self) -> Option<Band> {
        let run = self.runs.first().filter(|_| !self.bound_pa.is_empty())?;
        let colour = observer_strokes(self.runs.iter().map(|run| &run.entry)).first()?.colour;
        let ends = |sign: f64| -> Vec<(f64, f64)> {
            let bounds = self.bound_pa.iter().map(|bound| bound.map_or(f64::NAN, |pa| sign * units::mpa(pa)));
            run.time_s.iter().copied().zip(bounds).collect()
        };
        Some(Band {
            label: format!("certified band of {}", run.entry.name),
            colour,
            lower: ends(-1.0),
            upper: ends(1.0),
        })
    }
}

/// Lowest and highest value of a curve over a part of the common axis.
fn within(series: &Series, (from, to): (f64, f64)) -> Option<(f64, f64)> {
    extremes(series.points.iter().filter(|(x, _)| (from..=to).contains(x)))
}
