//! The page of a log: the whole drive, the table of its shifts, each shift drawn.

use std::cmp::Ordering;
use std::path::Path;

use config::VehicleFile;
use drivetrain::CommandKind;
use minijinja::{Value, context};
use observer::Health;
use study::shift_estimates::{EstimatedShift, Ranged, thinned};
use study::{LogSample, Overview, ShiftEstimate};
use trace::ShownPath as _;
use trace::shown_units::convert_table;
use trace::units::{mpa, rpm};

use crate::figure::{Axis, Band, Figure, Panel, Series, Span, Stroke};
use crate::interactive::within_room;
use crate::motion::motion_panels;
use crate::page::{PageError, origin, render};
use crate::palette::{RANGE, Weight};
use crate::panels::{panel, with_values};
use crate::shift_figure::{INERTIA_PHASE, TORQUE_PHASE};
use crate::tables::{coverage, number};
use crate::words::found;

/// Shifts that are drawn.
pub const MAX_DRAWN: usize = 400;
/// Rows of the table on the page; the files beside it have them all.
const MAX_ROWS: usize = 1000;
/// Points of the curves of all drawn shifts together: a point takes about three bytes of the page.
const POINTS: usize = 800_000;
/// Curves in the figure of a shift, about.
const CURVES: usize = 12;

/// What a page is made from.
pub struct LogPage<'a> {
    /// The log.
    pub log: &'a Path,
    /// The vehicle.
    pub vehicle: &'a VehicleFile,
    /// The observer and how its gains were found, in words.
    pub observer: &'a str,
    /// The whole drive.
    pub overview: &'a Overview,
    /// The shifts that are shown.
    pub shifts: &'a [ShiftEstimate],
    /// How many shifts the log has.
    pub shifts_of_log: usize,
    /// What else was found, in sentences.
    pub findings: &'a [String],
}

impl LogPage<'_> {
    /// The page; it needs nothing but itself.
    ///
    /// # Errors
    /// None in a released program; the tests render the template.
    pub fn html(&self) -> Result<String, PageError> {
        let drawn: Vec<&ShiftEstimate> =
            self.shifts.iter().filter(|shift| !shift.samples.is_empty()).take(MAX_DRAWN).collect();
        let points = POINTS / CURVES / drawn.len().max(1);
        let figures = within_room(drawn.iter().map(|shift| shift_figure(shift, self.vehicle, points)));
        let figures = drawn.iter().zip(figures).map(|(shift, figure)| {
            context! {
                number => shift.number,
                title => format!("{}-{}, {}", shift.shift.from, shift.shift.to, shift.shift.kind_name()),
                at => format!("{:.2}", shift.begin_s()),
                remark => remark(shift),
                figure,
            }
        });
        let figures: Vec<Value> = figures.collect();
        let drawn = &drawn[..figures.len()];
        let mut order: Vec<usize> = (0..self.shifts.len().min(MAX_ROWS)).collect();
        order.sort_by(|a, b| by_need(&self.shifts[*a], &self.shifts[*b]).then(a.cmp(b)));
        let (titles, rows) = shift_rows(self.shifts, MAX_ROWS);
        let is_drawn = |at: usize| drawn.iter().any(|shift| shift.number == self.shifts[at].number);
        let opened = order.iter().copied().find(|at| is_drawn(*at)).map(|at| self.shifts[at].number);
        let file = self.log.file_name().unwrap_or(self.log.as_os_str()).to_string_lossy();
        render(
            "log.html",
            context! {
                name => file,
                title => "estimate",
                version => env!("CARGO_PKG_VERSION"),
                vehicle_name => &self.vehicle.name,
                observer => self.observer,
                log => self.log.shown().to_string(),
                shifts_of_log => self.shifts_of_log,
                shown => self.shifts.len(),
                undrawn => self.shifts.len() - drawn.len(),
                opened,
                found => found(self.findings),
                overview => overview_figure(self.overview, self.shifts).html(),
                titles => titles,
                left_out => self.shifts.len() - rows.len(),
                rows => order.iter().map(|&at| context! { cells => &rows[at], linked => is_drawn(at) }).collect::<Vec<_>>(),
                figures => figures,
                others => self.shifts.iter().filter(|shift| !shift.of_vehicle).count(),
                inputs => origin(&[&self.vehicle.source]),
            },
        )
    }
}

/// The order of the table: the worst health first, of equal ones the larger fraction.
fn by_need(a: &ShiftEstimate, b: &ShiftEstimate) -> Ordering {
    let worst = |shift: &ShiftEstimate| shift.estimated.as_ref().and_then(|e| e.unhealthy.first().copied());
    let key = |shift: &ShiftEstimate| worst(shift).map_or((Health::Good, 0.0), |worst| worst);
    let ((a_health, a_fraction), (b_health, b_fraction)) = (key(a), key(b));
    b_health.cmp(&a_health).then(b_fraction.total_cmp(&a_fraction))
}

/// Titles of the table of shifts, and its first rows. Columns that no shift fills are left out.
pub fn shift_rows(shifts: &[ShiftEstimate], maximum: usize) -> (Vec<String>, Vec<Vec<String>>) {
    /// A title and its cell.
    type Column = (&'static str, fn(&ShiftEstimate) -> String);
    const COLUMNS: &[Column] = &[
        ("#", |s| s.number.to_string()),
        ("shift", |s| format!("{}-{}", s.shift.from, s.shift.to)),
        ("kind", |s| s.shift.kind_name().to_owned()),
        ("begin s", |s| format!("{:.2}", s.begin_s())),
        ("torque phase s", |s| of(s, |e| Some(number(e.torque_phase_s[1] - e.torque_phase_s[0], 2)))),
        ("inertia phase s", |s| match s.estimated.as_ref().and_then(|e| Some(e.lock_up_s? - e.torque_phase_s[1])) {
            Some(length_s) => number(length_s, 2),
            None => s.shift.inertia_s.map_or(String::new(), |[from_s, to_s]| number(to_s - from_s, 2)),
        }),
        ("pressure MPa", |s| of(s, |e| Some(ranged(&e.pressure_pa, 1e-6, 3)))),
        ("clutch torque N m", |s| of(s, |e| Some(ranged(&e.torque_n_m, 1.0, 0)))),
        ("friction work kJ", |s| of(s, |e| Some(ranged(&e.friction_work_j, 1e-3, 1)))),
        ("lowest shaft N m", |s| of(s, |e| Some(number(e.min_shaft_n_m?, 0)))),
        ("flare rpm", |s| s.shift.quality.flare_rad_s.map_or(String::new(), |rad_s| number(rpm(rad_s), 0))),
        ("jerk m/s^3", |s| s.shift.quality.jerk_m_s3.map_or(String::new(), |jerk| number(jerk, 1))),
        ("pressure RMS error kPa", |s| of(s, |e| Some(number(1e-3 * e.pressure_error_pa?.rms, 1)))),
        ("in range", |s| of(s, |e| Some(coverage(e.pressure_error_pa?.inside?)))),
        ("torque RMS error N m", |s| of(s, |e| Some(number(e.torque_error_n_m?.rms, 1)))),
        ("health", |s| of(s, |e| Some(health(e)))),
    ];
    let is_filled = |(_, cell): &&Column| shifts.iter().any(|shift| !cell(shift).is_empty());
    let columns: Vec<&Column> = COLUMNS.iter().filter(is_filled).collect();
    let row = |shift: &ShiftEstimate| columns.iter().map(|(_, cell)| cell(shift)).collect();
    let mut titles: Vec<String> = columns.iter().map(|(title, _)| (*title).to_owned()).collect();
    let mut rows: Vec<Vec<String>> = shifts.iter().take(maximum).map(row).collect();
    convert_table(&mut titles, &mut rows);
    (titles, rows)
}

/// A cell of an estimated shift; empty for others.
fn of(shift: &ShiftEstimate, cell: fn(&EstimatedShift) -> Option<String>) -> String {
    shift.estimated.as_ref().and_then(cell).unwrap_or_default()
}

/// A value with its range, in another unit.
fn ranged(ranged: &Ranged, unit: f64, decimals: usize) -> String {
    let text = |value: f64| number(unit * value, decimals);
    let value = text(ranged.value);
    ranged.range.map_or(value.clone(), |[low, high]| format!("{value} ({}–{})", text(low), text(high)))
}

/// The worst health and its fraction.
fn health(estimated: &EstimatedShift) -> String {
    estimated.unhealthy.first().map_or("good".to_owned(), |(health, fraction)| {
        format!("{} {:.0} %", health.name().replace('_', " "), (100.0 * fraction).max(1.0))
    })
}

/// Why a shift has no estimate.
fn remark(shift: &ShiftEstimate) -> &'static str {
    match (&shift.estimated, shift.of_vehicle) {
        (Some(_), _) => "",
        (None, true) => "The observer did not detect this shift: the valve command does not match it.",
        (None, false) => "This is not the shift of the vehicle file: no pressure is estimated.",
    }
}

const SPEEDS: [(&str, Stroke); 3] =
    [("engine", Stroke::THIRD), ("turbine", Stroke::SIGNAL), ("gearbox output", Stroke::SECOND)];
pub(crate) const ESTIMATE: Stroke = Stroke { colour: RANGE, weight: Weight::Equal, dash: None };

/// The whole drive. Each interval gives its lowest and its highest value.
fn overview_figure(overview: &Overview, shifts: &[ShiftEstimate]) -> Figure {
    let both = |value: &dyn Fn(&study::overview::Interval) -> [f64; 2], unit: fn(f64) -> f64| -> Vec<(f64, f64)> {
        let points = |([from_s, to_s], interval): ([f64; 2], &study::overview::Interval)| {
            let [low, high] = value(interval).map(unit);
            [(from_s, low), (0.5 * (from_s + to_s), high)]
        };
        overview.intervals().flat_map(points).collect()
    };
    let speeds = SPEEDS.iter().enumerate().map(|(i, (label, stroke))| Series {
        label: (*label).to_owned(),
        stroke: Stroke { weight: Weight::Rival, ..*stroke },
        points: both(&|interval| interval.speeds_rad_s[i], rpm),
    });
    let pressure = Series {
        label: "estimate".to_owned(),
        stroke: Stroke { weight: Weight::Rival, ..ESTIMATE },
        points: both(&|interval| interval.pressure_pa, mpa),
    };
    let ends = |end: usize| overview.intervals().map(|([from_s, _], i)| (from_s, mpa(i.range_pa[end]))).collect();
    let band = Band { label: "range (error budget)".to_owned(), colour: RANGE, lower: ends(0), upper: ends(1) };
    let healths: Vec<(f64, [bool; HEALTHS])> =
        overview.intervals().flat_map(|([from_s, to_s], i)| [(from_s, i.healths), (to_s, i.healths)]).collect();
    let first_s = overview.intervals().next().map_or(0.0, |([from_s, _], _)| from_s);
    let last_s = overview.intervals().last().map_or(1.0, |([_, to_s], _)| to_s);
    let spans = shifts.iter().map(|shift| Span {
        label: String::new(),
        start: shift.begin_s(),
        end: shift.end_s(),
        colour: TORQUE_PHASE,
    });
    Figure {
        x_label: "time (s)".into(),
        x_range: (first_s, last_s),
        spans: spans.take(MAX_DRAWN).collect(),
        panels: [
            panel("speed (rpm)", 150.0, speeds.collect()),
            Panel { bands: vec![band], ..panel("clutch pressure (MPa)", 110.0, vec![pressure]) },
        ]
        .into_iter()
        .chain(health_panel(&healths))
        .collect(),
    }
}

/// Points of a curve, in time.
type Points = Vec<(f64, f64)>;

/// A shift with some time around it.
fn shift_figure(shift: &ShiftEstimate, vehicle: &VehicleFile, points: usize) -> Figure {
    let samples = thinned(&shift.samples, points);
    let samples = Samples(&samples);
    let readings = |i: usize| samples.measured(&|sample| read(sample.speeds_rad_s[i]).map(rpm));
    let speeds = SPEEDS.iter().enumerate().map(|(i, (label, stroke))| Series {
        label: (*label).to_owned(),
        stroke: *stroke,
        points: readings(i),
    });
    let mut panels = vec![panel("speed (rpm)", 110.0, speeds.collect())];
    if let Some(estimated) = &shift.estimated {
        // After lock-up the pressure rises to that of the line, which no speed tells.
        let until_s = estimated.lock_up_s.unwrap_or(f64::INFINITY);
        panels.extend([samples.pressure_panel(until_s), samples.torque_panel(until_s)]);
        let shaft = samples.measured(&|sample| sample.estimate.shaft_torque_n_m);
        if !shaft.is_empty() {
            panels.push(panel("shaft torque (N\u{a0}m)", 100.0, vec![estimate(shaft)]));
        }
        panels.push(samples.command_panel(vehicle.settings.valve.command_kind()));
        panels.push(samples.friction_power_panel(vehicle));
        let is = |sample: &LogSample| Health::ALL.map(|health| health == sample.estimate.health);
        let healths: Vec<_> = samples.0.iter().map(|sample| (sample.time_s, is(sample))).collect();
        panels.extend(health_panel(&healths));
    }
    let radius_m = vehicle.road.wheel_radius_m / vehicle.driveline.final_ratio;
    panels.extend(motion_panels(samples.0.iter().map(|sample| (sample.time_s, radius_m * sample.speeds_rad_s[2]))));
    let (panels, _) = with_values(panels);
    let [from_s, to_s] = shift.window_s;
    Figure { x_label: "time (s)".into(), x_range: (from_s, to_s), spans: phases(shift), panels }
}

fn estimate(points: Points) -> Series {
    Series { label: "estimate".to_owned(), stroke: ESTIMATE, points }
}

/// What was read; NaN stands for nothing.
fn read(value: f64) -> Option<f64> {
    (!value.is_nan()).then_some(value)
}

/// The samples of a shift, as curves.
struct Samples<'a>(&'a [LogSample]);

impl Samples<'_> {
    fn all(&self, value: &dyn Fn(&LogSample) -> f64) -> Points {
        self.0.iter().map(|sample| (sample.time_s, value(sample))).collect()
    }

    /// A channel that is slower than the steps has readings with gaps between them.
    fn measured(&self, value: &dyn Fn(&LogSample) -> Option<f64>) -> Points {
        self.0.iter().filter_map(|sample| Some((sample.time_s, value(sample)?))).collect()
    }

    /// The estimate, with the measured values where there are any.
    fn beside_measured(&self, measured: Points, value: &dyn Fn(&LogSample) -> f64) -> Vec<Series> {
        let measured = Series { label: "measured".to_owned(), stroke: Stroke::TRUTH, points: measured };
        let measured = (!measured.points.is_empty()).then_some(measured);
        measured.into_iter().chain([estimate(self.all(value))]).collect()
    }

    fn bands(&self, range: &dyn Fn(&LogSample) -> Option<[f64; 2]>) -> Vec<Band> {
        let end = |end: usize| self.all(&|sample| range(sample).map_or(f64::NAN, |range| range[end]));
        vec![Band { label: "range (error budget)".to_owned(), colour: RANGE, lower: end(0), upper: end(1) }]
    }

    /// The largest value up to a time; at least zero.
    fn maximum(&self, until_s: f64, value: &dyn Fn(&LogSample) -> f64) -> f64 {
        let until = self.0.iter().filter(|sample| sample.time_s <= until_s);
        until.map(value).filter(|value| value.is_finite()).fold(0.0, f64::max)
    }

    fn pressure_panel(&self, until_s: f64) -> Panel {
        let maximum = self.maximum(until_s, &|sample| {
            let measured = sample.pressure_pa.map_or(0.0, |reading| reading.value);
            mpa(sample.estimate.bounds.map_or(sample.estimate.pressure_pa, |b| b.pressure_pa[1]).max(measured))
        });
        let measured = self.measured(&|sample| Some(mpa(sample.pressure_pa?.value)));
        let series = self.beside_measured(measured, &|sample| mpa(sample.estimate.pressure_pa));
        Panel {
            bands: self.bands(&|sample| Some(sample.estimate.bounds?.pressure_pa.map(mpa))),
            axis: Axis::Within(0.0, 1.1 * maximum.max(0.01)),
            ..panel("clutch pressure (MPa)", 150.0, series)
        }
    }

    fn torque_panel(&self, until_s: f64) -> Panel {
        let maximum = self.maximum(until_s, &|sample| {
            let measured = sample.torque_n_m.map_or(0.0, |reading| reading.value);
            let estimate = &sample.estimate;
            estimate.bounds.map_or(estimate.clutch_torque_n_m, |b| b.clutch_torque_n_m[1]).max(measured)
        });
        let measured = self.measured(&|sample| Some(sample.torque_n_m?.value));
        let series = self.beside_measured(measured, &|sample| sample.estimate.clutch_torque_n_m);
        Panel {
            bands: self.bands(&|sample| Some(sample.estimate.bounds?.clutch_torque_n_m)),
            axis: Axis::Within(-0.1 * maximum.max(1.0), 1.1 * maximum.max(1.0)),
            ..panel("clutch torque (N\u{a0}m)", 120.0, series)
        }
    }

    /// Estimated torque times slip of the oncoming clutch, from the kiss point on.
    fn friction_power_panel(&self, vehicle: &VehicleFile) -> Panel {
        let power = |sample: &LogSample| {
            let [_, turbine, output] = sample.speeds_rad_s;
            let slip_rad_s = vehicle.shift.oncoming_slip(turbine, output);
            read(1e-3 * sample.estimate.clutch_torque_n_m * slip_rad_s)
        };
        panel("friction power (kW)", 80.0, vec![estimate(self.measured(&power))])
    }

    fn command_panel(&self, command: CommandKind) -> Panel {
        let title = match command {
            CommandKind::Current => "current (A)",
            CommandKind::DutyCycle => "duty cycle (%)",
        };
        let points = self.measured(&|sample| read(sample.command));
        panel(title, 70.0, vec![Series { label: "oncoming valve".to_owned(), stroke: Stroke::SIGNAL, points }])
    }
}

/// The phases, as the observer saw them or else as the ratio shows them.
fn phases(shift: &ShiftEstimate) -> Vec<Span> {
    let span = |label: &str, [start, end]: [f64; 2], colour| Span { label: label.to_owned(), start, end, colour };
    let seen =
        shift.estimated.as_ref().filter(|estimated| estimated.torque_phase_s.iter().all(|time_s| time_s.is_finite()));
    match seen {
        Some(estimated) => {
            let [begin_s, inertia_s] = estimated.torque_phase_s;
            vec![
                span("torque phase", [begin_s, inertia_s], TORQUE_PHASE),
                span("inertia phase", [inertia_s, shift.end_s()], INERTIA_PHASE),
            ]
        }
        None => {
            let inertia_s = shift.shift.inertia_s.into_iter();
            inertia_s.map(|inertia_s| span("ratio changes", inertia_s, INERTIA_PHASE)).collect()
        }
    }
}

/// Kinds of health.
pub(crate) const HEALTHS: usize = Health::ALL.len();

/// A line for each health that was met: where it holds. None if all is good.
pub(crate) fn health_panel(healths: &[(f64, [bool; HEALTHS])]) -> Option<Panel> {
    const COLOURS: [&str; HEALTHS] = [
        "#009E73", "#E69F00", "#B8A50A", "#56B4E9", "#0072B2", "#CC79A7", "#6699CC", "#332288", "#CC79A7", "#D55E00",
        "#767676", "#767676", "#999933", "#117733", "#882255", "#AA4499", "#D55E00", "#000000",
    ];
    let met = |wanted: &Health| healths.iter().any(|(_, healths)| healths[*wanted as usize]);
    let met: Vec<Health> = Health::ALL.into_iter().filter(met).collect();
    if met.iter().all(|health| *health == Health::Good) {
        return None;
    }
    let series = met.iter().enumerate().map(|(line, health)| Series {
        label: health.name().replace('_', " "),
        stroke: Stroke { colour: COLOURS[*health as usize], weight: Weight::Main, dash: None },
        points: held(healths, *health, -(line as f64)),
    });
    let series: Vec<Series> = series.collect();
    let lines = series.len() as f64;
    let axis = Axis::Unmarked(0.5 - lines, 0.5);
    Some(Panel { y_label: "health".to_owned(), height: 18.0 * lines + 8.0, series, bands: Vec::new(), axis })
}

/// A line at this height where a health holds. One sample of it is drawn until the next, and so wide that it is seen.
fn held(healths: &[(f64, [bool; HEALTHS])], wanted: Health, height: f64) -> Vec<(f64, f64)> {
    /// Minimum part of the axis: two or three pixels.
    const MINIMUM: f64 = 1.0 / 300.0;
    let [first_s, last_s] = [healths.first(), healths.last()].map(|sample| sample.map_or(0.0, |(time_s, _)| *time_s));
    let mut until_s = f64::NEG_INFINITY;
    let point = |(at, (time_s, healths_then)): (usize, &(f64, [bool; HEALTHS]))| {
        if healths_then[wanted as usize] {
            let next_s = healths.get(at + 1).map_or(*time_s, |(next_s, _)| *next_s);
            until_s = next_s.max(time_s + MINIMUM * (last_s - first_s));
        }
        (*time_s, if *time_s <= until_s { height } else { f64::NAN })
    };
    healths.iter().enumerate().map(point).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_of_a_health_is_wide_enough_to_be_seen() {
        let one = |count: u32, at: u32| -> Vec<(f64, [bool; HEALTHS])> {
            let is = |i: u32| Health::ALL.map(|health| (health == Health::Flare) == (i == at));
            (0..count).map(|i| (f64::from(i) * 0.01, is(i))).collect()
        };
        let drawn = |count: u32, at: u32| {
            held(&one(count, at), Health::Flare, 1.0).iter().filter(|(_, height)| !height.is_nan()).count()
        };
        // Until the next sample, and of a long drive for a part of it.
        assert_eq!((drawn(100, 50), drawn(30_000, 50), drawn(100, 99)), (2, 100, 1));
    }
}
