//! Figures of a drive and of its shifts.

use car::{Car, Gear};
use observer::Health;
use study::gearbox::drive::{DriveState, ScoredDrive, ScoredShift};
use study::gearbox::{ClutchRow, ShiftScoreRow, TruePhase};
use trace::units::{km_h, mpa, rpm};

use super::{MAX_DRAWN, clutch_names};
use crate::figure::{Axis, Band, Figure, Panel, Series, Span, Stroke};
use crate::log_page::{ESTIMATE, health_panel};
use crate::motion::motion_panels;
use crate::palette::{RANGE, WIDE_RANGE, Weight};
use crate::panels::{panel, with_values};
use crate::shift_figure::{INERTIA_PHASE, TORQUE_PHASE};

/// Time before and after a shift that its figure shows, s.
const MARGIN_S: [f64; 2] = [0.15, 0.25];
/// Points of a curve over the whole drive.
const POINTS: usize = 3000;
/// Part of the drive that a step of the gear takes in its figure: a pixel.
const STEP: f64 = 900.0;
/// Shortest time axis, s.
const SHORTEST_S: f64 = 0.1;
/// Room above the pressures of a clutch that slips, and minimum height of their axis, MPa.
const PRESSURE_ROOM: f64 = 1.5;
const MIN_MPA: f64 = 0.2;
const OPEN_LOOP: Stroke = Stroke { colour: "#767676", weight: Weight::Rival, dash: Some("6 3") };

/// The gear as a number for an axis: its name where that is a number, else its place among the forward gears.
fn gear_number(car: &Car, gear: Gear) -> f64 {
    let place = car.gearbox.forward_gears().iter().position(|&forward| Gear::at(forward) == gear);
    let place = place.map_or(0.0, |place| place as f64 + 1.0);
    car.gear_name(gear).parse().unwrap_or(place)
}

/// The gear over time. A step takes `wide_s`, because a figure draws only one of points that lie closer.
fn gear_steps(drive: &ScoredDrive, car: &Car, wide_s: f64) -> Vec<(f64, f64)> {
    let mut steps: Vec<(f64, f64)> = Vec::new();
    let mut last = None;
    for state in &drive.states {
        if last.replace(state.gear) == Some(state.gear) {
            continue;
        }
        let gear = gear_number(car, state.gear);
        match steps.last() {
            Some(&(_, before)) if before == gear => {}
            Some(&(_, before)) => steps.extend([(state.time_s, before), (state.time_s + wide_s, gear)]),
            None => steps.push((state.time_s, gear)),
        }
    }
    let last_s = drive.states.last().map_or(0.0, |state| state.time_s);
    steps.extend(steps.last().copied().map(|(_, gear)| (last_s, gear)));
    steps
}

/// Room above the highest gear, so that its line is seen.
fn gear_axis(steps: &[(f64, f64)]) -> Axis {
    let gears = || steps.iter().map(|(_, gear)| *gear);
    Axis::Fixed(gears().fold(0.0, f64::min), gears().fold(1.0, f64::max) + 0.5)
}

/// Gear, speeds and pedals over the whole drive, and the quantities of which the log has no value.
pub(super) fn overview_figure(drive: &ScoredDrive, car: &Car) -> (Figure, Vec<String>) {
    let states = &drive.states;
    let every = states.len().div_ceil(POINTS).max(1);
    let thinned = || states.iter().step_by(every);
    let curve = |label: &str, stroke: Stroke, value: &dyn Fn(&DriveState) -> f64| Series {
        label: label.to_owned(),
        stroke: Stroke { weight: Weight::Rival, ..stroke },
        points: thinned().map(|state| (state.time_s, value(state))).collect(),
    };
    let [first_s, last_s] = [states.first(), states.last()].map(|state| state.map_or(0.0, |state| state.time_s));
    let gear = Series {
        label: "gear".to_owned(),
        stroke: Stroke::SIGNAL,
        points: gear_steps(drive, car, (last_s - first_s) / STEP),
    };
    let is = |state: &DriveState| Health::ALL.map(|health| health == state.health);
    let healths: Vec<_> = states.iter().map(|state| (state.time_s, is(state))).collect();
    let spans = drive.shifts.iter().map(|shift| Span {
        label: String::new(),
        start: shift.time_s[0],
        end: shift.time_s[1],
        colour: TORQUE_PHASE,
    });
    let speeds = ["engine", "turbine"].into_iter().zip([Stroke::THIRD, Stroke::SIGNAL]).enumerate();
    let speeds = speeds.map(|(i, (label, stroke))| curve(label, stroke, &|state| rpm(state.speeds_rad_s[i])));
    let pedals = ["throttle", "brake"].into_iter().zip([Stroke::SIGNAL, Stroke::THIRD]).enumerate();
    let pedals = pedals.map(|(i, (label, stroke))| curve(label, stroke, &|state| state.pedals[i]));
    let panels = vec![
        Panel { axis: gear_axis(&gear.points), ..panel("gear", 120.0, vec![gear]) },
        panel("speed (km/h)", 80.0, vec![curve("vehicle", Stroke::SIGNAL, &|state| km_h(state.vehicle_m_s))]),
        panel("speed (rpm)", 110.0, speeds.collect()),
        Panel { axis: Axis::Fixed(0.0, 1.0), ..panel("pedals (0\u{a0}to\u{a0}1)", 70.0, pedals.collect()) },
    ];
    let (panels, missing) = with_values(panels);
    let figure = Figure {
        x_label: "time (s)".into(),
        x_range: (first_s, last_s.max(first_s + SHORTEST_S)),
        spans: spans.take(MAX_DRAWN).collect(),
        panels: panels.into_iter().chain(health_panel(&healths)).collect(),
    };
    (figure, missing)
}

/// A shift with some time around it.
pub(super) fn shift_figure(shift: &ScoredShift, drive: &ScoredDrive, car: &Car) -> Figure {
    let [from_s, to_s] = [shift.time_s[0] - MARGIN_S[0], shift.time_s[1] + MARGIN_S[1]];
    let first = drive.states.partition_point(|state| state.time_s < from_s);
    let last = drive.states.partition_point(|state| state.time_s <= to_s);
    let states = &drive.states[first..last];
    let speed = |label: String, stroke: Stroke, value: &dyn Fn(&DriveState) -> f64| Series {
        label,
        stroke,
        points: states.iter().map(|state| (state.time_s, rpm(value(state)))).collect(),
    };
    let in_gear = |gear: Gear, stroke: Stroke| {
        let ratio = car.ratio(gear).unwrap_or(f64::NAN);
        speed(format!("turbine in gear {}", car.gear_name(gear)), stroke, &|state| ratio * state.speeds_rad_s[2])
    };
    let dotted = |dash| Stroke { weight: Weight::Rival, dash: Some(dash), ..Stroke::SIGNAL };
    let speeds = vec![
        speed("engine".to_owned(), Stroke::THIRD, &|state| state.speeds_rad_s[0]),
        speed("turbine".to_owned(), Stroke::SIGNAL, &|state| state.speeds_rad_s[1]),
        in_gear(shift.gears.from, dotted("2.5 2")),
        in_gear(shift.gears.to, dotted("9 2.5 2 2.5")),
    ];
    let mut panels = vec![panel("speed (rpm)", 120.0, speeds)];
    let names = clutch_names(shift, car);
    if shift.rows.iter().any(|row| row.at_turbine_n_m.is_some()) {
        panels.push(at_turbine_panel(&shift.rows));
    } else if !shift.rows.is_empty() {
        let roles = || ["offgoing", "oncoming"].into_iter().zip(names).enumerate();
        panels.extend(roles().map(|(c, (role, name))| torque_panel(&shift.rows, c, format!("{name}, {role}"))));
        let with_pressure = roles().filter(|(c, _)| has_pressure(&shift.rows, *c));
        panels.extend(with_pressure.map(|(c, (role, name))| pressure_panel(&shift.rows, c, format!("{name}, {role}"))));
        panels.push(friction_power_panel(&shift.rows, names));
    }
    panels.extend(motion_panels(states.iter().map(|state| (state.time_s, state.vehicle_m_s))));
    let is = |row: &ShiftScoreRow| Health::ALL.map(|health| health == row.health);
    let healths: Vec<_> = shift.rows.iter().map(|row| (row.time_s, is(row))).collect();
    panels.extend(health_panel(&healths));
    let mut spans = phase_spans(shift, "torque phase", TruePhase::Torque, TORQUE_PHASE);
    spans.extend(phase_spans(shift, "inertia phase", TruePhase::Inertia, INERTIA_PHASE));
    spans.sort_by(|a, b| a.start.total_cmp(&b.start));
    Figure { x_label: "time (s)".into(), x_range: (from_s.max(0.0), to_s), spans, panels: with_values(panels).0 }
}

/// Estimated torque times slip of both clutches.
fn friction_power_panel(rows: &[ShiftScoreRow], names: [&str; 2]) -> Panel {
    let power = |clutch: &ClutchRow| 1e-3 * clutch.torque_n_m[1] * clutch.slip_rad_s;
    let curve = |(c, (role, stroke)): (usize, (&str, Stroke))| Series {
        label: format!("{}, {role}", names[c]),
        stroke,
        points: rows.iter().map(|row| (row.time_s, power(&row.clutches[c]))).collect(),
    };
    let roles = ["offgoing", "oncoming"].into_iter().zip([Stroke::SECOND, Stroke::SIGNAL]).enumerate();
    panel("friction power by the estimate (kW)", 90.0, roles.map(curve).collect())
}

/// Time between two points of a range, s: a page of an hour has more than three hundred shifts.
const RANGE_S: f64 = 0.04;

/// Whether pressure makes a clutch of the shift hold: a one-way clutch or a dog has none, and no valve model.
fn has_pressure(rows: &[ShiftScoreRow], c: usize) -> bool {
    rows.iter().all(|row| row.clutches[c].has_pressure)
}

/// The pieces of a phase; the longest has its name.
fn phase_spans(shift: &ScoredShift, label: &str, phase: TruePhase, colour: &'static str) -> Vec<Span> {
    let pieces = shift.spans_s(phase);
    let longest = pieces.iter().map(|[start, end]| end - start).fold(0.0, f64::max);
    let label = |[start, end]: [f64; 2]| if end - start >= longest { label.to_owned() } else { String::new() };
    pieces.into_iter().map(|piece| Span { label: label(piece), start: piece[0], end: piece[1], colour }).collect()
}

/// Torque of the clutches together at the turbine, with two standard deviations.
fn at_turbine_panel(rows: &[ShiftScoreRow]) -> Panel {
    let points = |of: fn([f64; 2]) -> f64| -> Vec<(f64, f64)> {
        rows.iter().map(|row| (row.time_s, row.at_turbine_n_m.map_or(f64::NAN, of))).collect()
    };
    let curve = |label: &str, stroke: Stroke, points| Series { label: label.to_owned(), stroke, points };
    let turbine = rows.iter().map(|row| (row.time_s, row.turbine_n_m[1])).collect();
    let series = vec![
        curve("clutches together", ESTIMATE, points(|[torque, _]| torque)),
        curve("turbine", Stroke::THIRD, turbine),
    ];
    let band = Band {
        label: "two standard deviations".to_owned(),
        colour: RANGE,
        lower: points(|[torque, sd]| torque - 2.0 * sd),
        upper: points(|[torque, sd]| torque + 2.0 * sd),
    };
    Panel { bands: vec![band], ..panel("torque at the turbine (N\u{a0}m)", 170.0, series) }
}

/// Truth, estimate and valve model of a clutch's torque. One that holds has no torque by its valve model, and its range is all
/// that it can hold: neither is drawn.
fn torque_panel(rows: &[ShiftScoreRow], c: usize, clutch: String) -> Panel {
    let held = |clutch: &ClutchRow, value: f64| if clutch.sticks { f64::NAN } else { value };
    let of = |clutch: &ClutchRow| {
        let [truth, estimate, valve] = clutch.torque_n_m;
        let range = clutch.torque_range_n_m.map(|range| range.map(|end| held(clutch, end)));
        ([truth, estimate, held(clutch, valve)], [range, clutch.torque_band_n_m()])
    };
    clutch_panel(rows, c, (format!("torque of {clutch} (N\u{a0}m)"), 125.0, Axis::All), of)
}

/// Truth, estimate and valve model of a clutch's pressure. The axis follows the pressures at which it slips: of one that holds the
/// speeds show nothing.
fn pressure_panel(rows: &[ShiftScoreRow], c: usize, clutch: String) -> Panel {
    let slipping = rows.iter().map(|row| &row.clutches[c]).filter(|clutch| !clutch.sticks);
    let maximum = slipping.flat_map(|clutch| clutch.pressure_pa).map(mpa).fold(MIN_MPA, f64::max);
    let of = |clutch: &ClutchRow| {
        let ranges = [clutch.pressure_range_pa, clutch.pressure_band_pa()];
        (clutch.pressure_pa.map(mpa), ranges.map(|range| range.map(|ends| ends.map(mpa))))
    };
    let axis = Axis::Within(0.0, PRESSURE_ROOM * maximum);
    clutch_panel(rows, c, (format!("pressure of {clutch} (MPa)"), 110.0, axis), of)
}

fn clutch_panel(
    rows: &[ShiftScoreRow],
    c: usize,
    (y_label, height, axis): (String, f64, Axis),
    of: impl Fn(&ClutchRow) -> ([f64; 3], [Option<[f64; 2]>; 2]),
) -> Panel {
    let curve = |which: usize, label: &str, stroke: Stroke| Series {
        label: label.to_owned(),
        stroke,
        points: rows.iter().map(|row| (row.time_s, of(&row.clutches[c]).0[which])).collect(),
    };
    let length_s = rows.last().map_or(0.0, |last| last.time_s - rows[0].time_s);
    let every = ((RANGE_S * rows.len() as f64 / length_s).round() as usize).clamp(1, 100);
    let ends = |which: usize, end: usize| {
        let value = |row: &ShiftScoreRow| of(&row.clutches[c]).1[which].map_or(f64::NAN, |range| range[end]);
        rows.iter().step_by(every).map(|row| (row.time_s, value(row))).collect()
    };
    // A log may have a measured pressure, and then no torque.
    let known = if rows.iter().any(|row| row.clutches[c].torque_n_m[0].is_finite()) { "true" } else { "measured" };
    let mut series = vec![curve(0, known, Stroke::TRUTH), curve(1, "filter", ESTIMATE)];
    if has_pressure(rows, c) {
        series.push(curve(2, "valve model", OPEN_LOOP));
    }
    let bands = [("range (error budget)", WIDE_RANGE), ("two standard deviations", RANGE)];
    let bands = bands.into_iter().enumerate().map(|(which, (label, colour))| Band {
        label: label.to_owned(),
        colour,
        lower: ends(which, 0),
        upper: ends(which, 1),
    });
    Panel { y_label, height, series, bands: bands.collect(), axis }
}
