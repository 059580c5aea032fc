//! The page of a drive without a valve command: what speeds, torques and gears tell of shifts and converter, and what they cannot.

use std::path::Path;

use car::TURBINE_SIDE_INERTIA_KG_M2;
use config::Source;
use drivetrain::Real;
use fit::drive::{ConverterFit, DriveRecord, Moment, ShiftTorque};
use fit::{Series as Readings, Verdict};
use logs::Shift;
use minijinja::{Value, context};
use trace::ShownPath as _;
use trace::quantity;
use trace::shown_units::convert_table;
use trace::units::{km_h, rpm};

use crate::figure::{Axis, Band, Figure, Panel, Series, Span, Stroke};
use crate::interactive::within_room;
use crate::log_page::MAX_DRAWN;
use crate::motion::motion_panels;
use crate::page::{PageError, origin, render};
use crate::palette::{RANGE, Weight};
use crate::panels::{panel, with_values};
use crate::shift_figure::{INERTIA_PHASE, TORQUE_PHASE};
use crate::tables::number;
use crate::words::found;

/// Points of a curve over the whole drive, and of one over a shift.
const POINTS: usize = 3000;
const SHIFT_POINTS: usize = 300;
/// Width of the bins of measured capacities, speed ratio.
const BIN: f64 = 0.02;

/// What a page is made from.
pub struct SpeedsPage<'a> {
    /// The log.
    pub log: &'a Path,
    /// The channel map.
    pub map: Option<&'a Source>,
    /// The signals.
    pub record: &'a DriveRecord,
    /// Engine and turbine over time.
    pub moments: &'a [Moment],
    /// Ratios of the gears, 1st first.
    pub ratios: &'a [f64],
    /// The shifts.
    pub shifts: &'a [Shift],
    /// The converter, or what the drive lacks for it.
    pub converter: &'a Result<ConverterFit, String>,
    /// Whether a command of a valve is mapped.
    pub has_command: bool,
    /// What was met in the log, in sentences.
    pub faults: &'a [String],
}

/// Inertia of the engine and delay of its torque, each with its interval of 95 %.
fn inertia_and_delay(fit: &ConverterFit) -> String {
    let inertia = match fit.inertia_verdict() {
        Verdict::NotIdentifiable => {
            "not identifiable: the engine hardly changes its speed with the converter slipping".to_owned()
        }
        _ => format!("{:.3} ± {:.3} kg m²", fit.inertia_kg_m2, 2.0 * fit.inertia_sd_kg_m2),
    };
    let [late_ms, half_ms] = [fit.delay_s, 2.0 * fit.delay_sd_s].map(|time_s| 1e3 * time_s);
    let delay = match fit.delay_verdict() {
        Verdict::NotIdentifiable => {
            "The delay of the engine's torque against its signal is not identifiable".to_owned()
        }
        _ if late_ms < 0.0 => format!("The engine's torque comes {:.0} ± {half_ms:.0} ms before its signal", -late_ms),
        _ => format!("The engine's torque comes {late_ms:.0} ± {half_ms:.0} ms after its signal"),
    };
    format!("Inertia of engine and pump (95 %): {inertia}. {delay} (95 %).")
}

impl SpeedsPage<'_> {
    /// The page; it needs nothing but itself.
    ///
    /// # Errors
    /// None in a released program; the tests render the template.
    pub fn html(&self) -> Result<String, PageError> {
        let torques: Vec<Option<ShiftTorque>> = self.torques();
        let drawn = || self.shifts.iter().zip(&torques).take(MAX_DRAWN);
        let of_shifts = within_room(drawn().map(|(shift, torque)| self.shift_figure(shift, torque.as_ref())));
        let figures: Vec<Value> = drawn()
            .zip(of_shifts)
            .enumerate()
            .map(|(i, ((shift, torque), figure))| {
                context! {
                    number => i + 1,
                    title => format!("{}-{}, {}", shift.from, shift.to, shift.kind_name()),
                    at => number(shift.start_s(), 2),
                    remark => self.remark(torque.as_ref()),
                    figure,
                }
            })
            .collect();
        let drawn = figures.len();
        let (titles, rows) = self.table(&torques);
        let converter = self.converter.as_ref().ok();
        let file = self.log.file_name().unwrap_or(self.log.as_os_str()).to_string_lossy();
        let inputs: Vec<&Source> = self.map.into_iter().collect();
        render(
            "speeds.html",
            context! {
                name => file,
                title => "drive",
                version => env!("CARGO_PKG_VERSION"),
                log => self.log.shown().to_string(),
                shifts => self.shifts.len(),
                found => found(&self.findings(&torques)),
                cannot => self.cannot(),
                faults => found(self.faults),
                overview => self.overview().html(),
                titles, rows, figures,
                undrawn => self.shifts.len() - drawn,
                converter => converter.map(|fit| self.converter_figure(fit).html()),
                engine => converter.map(|fit| self.engine_figure(fit).html()),
                inputs => origin(&inputs),
            },
        )
    }

    /// The torques of the shifts; none without a fitted converter.
    pub fn torques(&self) -> Vec<Option<ShiftTorque>> {
        let of =
            |shift| self.converter.as_ref().ok().map(|fit| fit.shift(self.record, self.moments, shift, self.ratios));
        self.shifts.iter().map(of).collect()
    }

    /// What was found, in sentences.
    pub fn findings(&self, torques: &[Option<ShiftTorque>]) -> Vec<String> {
        let mut said = Vec::new();
        match self.converter {
            Err(reason) => said.push(format!("The converter could not be fitted: {reason}.")),
            Ok(fit) => {
                let [low, high] =
                    [fit.knots.first(), fit.knots.iter().rev().nth(1)].map(|k| k.map_or(0.0, |k| k.speed_ratio));
                said.push(format!(
                    "Converter: capacity from {:.1} s with slip, speed ratio {low:.2} to {high:.2}. The engine torque signal agrees with it to \
                     {} (1.48 times the median error).",
                    fit.fitted_s,
                    quantity(fit.scale_n_m, "N m", 1)
                ));
                let capacities = fit.knots.iter().filter(|knot| knot.speed_ratio < 1.0);
                let capacities = capacities.map(|knot| {
                    let [capacity, half] = [knot.capacity_n_m_s2, 2.0 * knot.sd_n_m_s2].map(|value| 1e3 * value);
                    format!("{capacity:.2} ± {half:.2} at {}", knot.speed_ratio)
                });
                said.push(format!("Capacity, 10⁻³ N m s² (95 %): {}.", capacities.collect::<Vec<_>>().join(", ")));
                said.push(inertia_and_delay(fit));
            }
        }
        let spans: Vec<String> = self.no_slip().iter().map(|span| self.no_slip_text(*span)).collect();
        if !spans.is_empty() {
            said.push(format!("No slip of the converter, {}.", first_of(&spans, "; ")));
        }
        let asked = self.shifts.iter().zip(torques).filter_map(|(shift, torque)| {
            let torque = torque.as_ref()?;
            let ([minimum, length_s], error) = (torque.reduction?, torque.reduction_error_n_m?);
            Some(format!(
                "{}-{} (to {} for {length_s:.2} s; the engine's torque was {} from it on average)",
                shift.from,
                shift.to,
                quantity(minimum, "N m", 0),
                quantity(error, "N m", 0)
            ))
        });
        let asked: Vec<String> = asked.collect();
        if !asked.is_empty() {
            said.push(format!("The gearbox requested less engine torque in {}.", first_of(&asked, ", ")));
        }
        said
    }

    /// What this log cannot tell.
    fn cannot(&self) -> Vec<String> {
        let [minimum, maximum] = TURBINE_SIDE_INERTIA_KG_M2;
        let converter = format!(
            "Torque ratio of the converter: the turbine torque is not measured. The ranges contain every torque ratio from 1 up to a line from 2.2 at stall to 1 at speed ratio 0.9, and every turbine-side inertia from {minimum:.2} to {maximum:.2} kg m²."
        );
        let mut said: Vec<&str> = Vec::new();
        if !self.has_command {
            said.push("No pressure: the log has no valve current, duty cycle or pressure command. With one of them and a vehicle file, the command estimate gives it with its range.");
        }
        said.push("Torque of a single clutch: ratios alone do not give the fraction of the turbine torque that a clutch holds. U is the torque of both at the turbine; the friction work does not depend on it.");
        said.push(
            "Division of U between offgoing and oncoming clutch while both carry torque: it needs the output torque.",
        );
        if self.converter.is_ok() {
            said.push(&converter);
        }
        if self.record.output_is_of_car {
            said.push(
                "The output speed is that of the car times a constant: slip of the tyres is part of the shift's slip.",
            );
        }
        said.into_iter().map(str::to_owned).collect()
    }

    /// Spans without slip of at least half a second.
    fn no_slip(&self) -> Vec<[f64; 2]> {
        const MIN_S: f64 = 0.5;
        let spans = self.moments.chunk_by(|a, b| a.no_slip == b.no_slip && b.time_s - a.time_s < MIN_S);
        let ends = |span: &[Moment]| Some([span.first()?.time_s, span.last()?.time_s]).filter(|_| span[0].no_slip);
        spans.filter_map(ends).filter(|[from_s, to_s]| to_s - from_s >= MIN_S).collect()
    }

    fn no_slip_text(&self, [from_s, to_s]: [f64; 2]) -> String {
        /// A converter without slip carries about as much as this, N m.
        const NOTHING_N_M: f64 = 15.0;
        let (count, sum) = self
            .record
            .engine_torque
            .between([from_s, to_s])
            .fold((0.0, 0.0), |(n, sum), (_, value)| (n + 1.0, sum + value));
        let span = format!("{from_s:.1} to {to_s:.1} s");
        match sum / count {
            mean if mean.abs() > NOTHING_N_M => {
                format!("{span}: lock-up clutch closed, at {} of the engine", quantity(mean, "N m", 0))
            }
            mean if mean.is_nan() => span,
            _ => format!("{span}: with nearly no torque, so the lock-up clutch may be open"),
        }
    }

    /// Titles and rows of the table of shifts. Columns that no shift fills are left out.
    fn table(&self, torques: &[Option<ShiftTorque>]) -> (Vec<String>, Vec<Vec<String>>) {
        let ranged = |value: [f64; 3], unit: f64, decimals: usize| {
            let [low, middle, high] = value.map(|value| number(unit * value, decimals));
            format!("{middle} ({low} to {high})")
        };
        let optional = |value: Option<f64>, decimals| value.map_or(String::new(), |value| number(value, decimals));
        let row = |(i, (shift, torque)): (usize, (&Shift, &Option<ShiftTorque>))| {
            let torque = torque.as_ref();
            vec![
                ("#", (i + 1).to_string()),
                ("shift", format!("{}-{}", shift.from, shift.to)),
                ("kind", shift.kind_name().to_owned()),
                ("begin s", number(shift.start_s(), 2)),
                ("command to gear s", optional(shift.gear_s.zip(shift.command_s).map(|(end, begin)| end - begin), 2)),
                ("inertia phase s", optional(shift.inertia_s.map(|[from_s, to_s]| to_s - from_s), 2)),
                ("flare rpm", optional(shift.quality.flare_rad_s.map(rpm), 0)),
                ("jerk m/s³", optional(shift.quality.jerk_m_s3, 1)),
                ("torque asked for N m", optional(torque.and_then(|t| Some(t.reduction?[0])), 0)),
                ("U, inertia phase N m", torque.and_then(|t| t.mean_n_m).map_or(String::new(), |u| ranged(u, 1.0, 0))),
                ("friction work kJ", torque.and_then(|t| t.work_j).map_or(String::new(), |work| ranged(work, 1e-3, 2))),
                (
                    "converter without slip",
                    optional(torque.filter(|t| t.mean_n_m.is_some()).map(|t| 100.0 * t.no_slip_fraction), 0),
                ),
            ]
        };
        let rows: Vec<Vec<(&str, String)>> = self.shifts.iter().zip(torques).enumerate().map(row).collect();
        let width = rows.first().map_or(0, Vec::len);
        let filled: Vec<usize> = (0..width).filter(|j| rows.iter().any(|row| !row[*j].1.is_empty())).collect();
        let mut titles: Vec<String> = filled.iter().map(|j| rows[0][*j].0.to_owned()).collect();
        let cells = |row: &Vec<(&str, String)>| filled.iter().map(|j| row[*j].1.clone()).collect();
        let mut rows: Vec<Vec<String>> = rows.iter().map(cells).collect();
        convert_table(&mut titles, &mut rows);
        (titles, rows)
    }

    fn remark(&self, torque: Option<&ShiftTorque>) -> &'static str {
        match torque {
            Some(torque) if torque.mean_n_m.is_none() => {
                "The speed ratio of the converter leaves what was fitted, or speeds are missing: the torque at the turbine is not known throughout."
            }
            Some(torque) if torque.no_slip_fraction > 0.5 => {
                "The converter does not slip in this shift: the engine's inertia is part of what the clutch brakes, and its torque signal gives the turbine's torque."
            }
            _ => "",
        }
    }

    fn overview(&self) -> Figure {
        let record = self.record;
        let span_s = |moments: &[Moment]| Some((moments.first()?.time_s, moments.last()?.time_s));
        let x_range = span_s(self.moments).unwrap_or((0.0, 1.0));
        let all = |series: &Readings, unit: fn(f64) -> f64| points(series, [x_range.0, x_range.1], POINTS, unit);
        let spans = self.shifts.iter().take(MAX_DRAWN).map(|shift| Span {
            label: String::new(),
            start: shift.start_s(),
            end: shift.gear_s.unwrap_or(shift.end_s()).max(shift.end_s()),
            colour: TORQUE_PHASE,
        });
        let slip = |moment: &Moment| (moment.time_s, rpm(moment.engine_rad_s - moment.turbine_rad_s));
        let every = self.moments.len().div_ceil(POINTS).max(1);
        let slips = self.moments.iter().step_by(every).map(slip).collect();
        let panels = vec![
            panel(
                "speed (rpm)",
                140.0,
                vec![
                    series("engine", Stroke::THIRD, all(&record.engine, rpm)),
                    series("turbine", Stroke::SIGNAL, all(&record.turbine, rpm)),
                ],
            ),
            panel("car (km/h)", 70.0, vec![series("car", Stroke::SIGNAL, all(&record.vehicle, km_h))]),
            self.gears([x_range.0, x_range.1], POINTS),
            Panel {
                axis: Axis::Within(-100.0, 500.0),
                ..panel("slip of the converter (rpm)", 70.0, vec![series("engine less turbine", Stroke::SIGNAL, slips)])
            },
            self.engine_torques([x_range.0, x_range.1], POINTS, 110.0),
        ];
        Figure { x_label: "time (s)".into(), x_range, spans: spans.collect(), panels: with_values(panels).0 }
    }

    fn gears(&self, span_s: [f64; 2], maximum: usize) -> Panel {
        /// Forward gears of a car whose ratios are not given: larger numbers are codes for reverse and neutral.
        const MAX_GEARS: usize = 10;
        let highest = if self.ratios.is_empty() { MAX_GEARS } else { self.ratios.len() };
        let highest = highest as f64;
        // Numbers beyond the forward gears stand for others.
        let gear = |series: &Readings| {
            let points = points(series, span_s, maximum, |gear| gear);
            points.into_iter().map(|(t, gear)| (t, if gear > highest { f64::NAN } else { gear })).collect()
        };
        panel(
            "gear",
            70.0,
            vec![
                series("commanded", Stroke::SECOND, gear(&self.record.target_gear)),
                series("reported", Stroke::SIGNAL, gear(&self.record.gear)),
            ],
        )
    }

    fn engine_torques(&self, span_s: [f64; 2], maximum: usize, height: f64) -> Panel {
        let record = self.record;
        let torque = points(&record.engine_torque, span_s, maximum, |n_m| n_m);
        // Requests come in pieces; between them nothing is asked for.
        let mut asked: Vec<(f64, f64)> = Vec::new();
        for (time_s, n_m) in points(&record.torque_request, span_s, maximum, |n_m| n_m) {
            if let Some((last_s, _)) = asked.last().filter(|(last_s, _)| time_s - last_s > 0.1).copied() {
                asked.push((last_s + 1e-6, f64::NAN));
            }
            asked.push((time_s, n_m - record.friction_torque.at(time_s)));
        }
        // Requests may begin or end far above what an engine gives.
        let torques = || torque.iter().map(|(_, n_m)| *n_m);
        let (minimum, maximum) = (torques().fold(0.0, f64::min), torques().fold(10.0, f64::max));
        Panel {
            axis: Axis::Within(1.2 * minimum, 1.2 * maximum),
            ..panel(
                "engine torque (N\u{a0}m)",
                height,
                vec![
                    series("at the flywheel", Stroke::SIGNAL, torque),
                    series("asked for by the gearbox", REQUEST, asked),
                ],
            )
        }
    }

    /// The capacity over the speed ratio, with what was measured.
    fn converter_figure(&self, fit: &ConverterFit) -> Figure {
        let milli = |value: f64| 1e3 * value;
        let line = |side: f64| {
            let point =
                |knot: &fit::drive::Knot| (knot.speed_ratio, milli(knot.capacity_n_m_s2 + side * knot.sd_n_m_s2));
            fit.knots.iter().map(point).collect::<Vec<_>>()
        };
        let mut bins: Vec<Vec<f64>> = vec![Vec::new(); 50];
        for moment in self.moments.iter().filter(|moment| !moment.no_slip) {
            let bin = (moment.speed_ratio().max(0.0) / BIN) as usize;
            if let Some(bin) = bins.get_mut(bin) {
                bin.push(fit.by_engine(self.record, moment) / Real::powi(moment.engine_rad_s, 2));
            }
        }
        let quantile = |bin: &mut Vec<f64>, fraction: f64| {
            bin.sort_by(f64::total_cmp);
            let place = (fraction * bin.len() as f64) as usize;
            if bin.len() < 10 { f64::NAN } else { milli(bin[place.min(bin.len() - 1)]) }
        };
        let mut of = |fraction: f64| -> Vec<(f64, f64)> {
            let at = |i: usize| (i as f64 + 0.5) * BIN;
            bins.iter_mut().enumerate().map(|(i, bin)| (at(i), quantile(bin, fraction))).collect()
        };
        let measured = [("measured: median", 0.5), ("a tenth is below", 0.1), ("a tenth is above", 0.9)];
        let strokes = [Stroke { weight: Weight::Rival, ..Stroke::SIGNAL }, Stroke::THIRD, Stroke::SECOND];
        let mut curves: Vec<Series> = measured
            .into_iter()
            .zip(strokes)
            .map(|((label, fraction), stroke)| series(label, stroke, of(fraction)))
            .collect();
        curves.push(series("fitted", FITTED, line(0.0)));
        let band = Band { label: "95 %".to_owned(), colour: RANGE, lower: line(-2.0), upper: line(2.0) };
        Figure {
            x_label: "turbine speed over engine speed".into(),
            x_range: (0.0, 1.0),
            spans: Vec::new(),
            panels: vec![Panel { bands: vec![band], ..panel("capacity (10⁻³ N\u{a0}m\u{a0}s²)", 210.0, curves) }],
        }
    }

    /// What the engine gives to the converter, by its signal and by the converter.
    fn engine_figure(&self, fit: &ConverterFit) -> Figure {
        let every = self.moments.len().div_ceil(POINTS).max(1);
        let moments = || self.moments.iter().step_by(every);
        let by_engine = moments().map(|moment| (moment.time_s, fit.by_engine(self.record, moment))).collect();
        let converter = |side: f64| {
            let value = |moment: &Moment| fit.by_converter(moment).map_or(f64::NAN, |[value, sd]| value + side * sd);
            moments().map(|moment| (moment.time_s, value(moment))).collect::<Vec<_>>()
        };
        let spans = self.no_slip().into_iter().map(|[start, end]| Span {
            label: String::new(),
            start,
            end,
            colour: INERTIA_PHASE,
        });
        let x_range = (self.moments.first().map_or(0.0, |m| m.time_s), self.moments.last().map_or(1.0, |m| m.time_s));
        let band = Band { label: "95 %".to_owned(), colour: RANGE, lower: converter(-2.0), upper: converter(2.0) };
        let curves = vec![
            series("by the engine's signal, less its inertia", Stroke::SIGNAL, by_engine),
            series("by the converter's capacity", FITTED, converter(0.0)),
        ];
        Figure {
            x_label: "time (s)".into(),
            x_range,
            spans: spans.collect(),
            panels: vec![Panel { bands: vec![band], ..panel("torque into the converter (N\u{a0}m)", 160.0, curves) }],
        }
    }

    fn shift_figure(&self, shift: &Shift, torque: Option<&ShiftTorque>) -> Figure {
        let record = self.record;
        let fallback = [shift.start_s() - 0.6, shift.gear_s.unwrap_or(shift.end_s()).max(shift.end_s()) + 0.9];
        let window_s = torque.map_or(fallback, |torque| torque.window_s);
        let of = |series: &Readings, unit: fn(f64) -> f64| points(series, window_s, SHIFT_POINTS, unit);
        let mut speeds = vec![
            series("engine", Stroke::THIRD, of(&record.engine, rpm)),
            series("turbine", Stroke::SIGNAL, of(&record.turbine, rpm)),
        ];
        for (gear, stroke) in [(shift.from, Stroke::SECOND), (shift.to, SYNCHRONOUS)] {
            let ratio = usize::try_from(gear).ok().and_then(|gear| self.ratios.get(gear.checked_sub(1)?));
            if let Some(ratio) = ratio {
                let output = points(&record.output, window_s, SHIFT_POINTS, rpm);
                let points = output.into_iter().map(|(t, output)| (t, ratio * output)).collect();
                speeds.push(series(&format!("turbine in gear {gear}"), stroke, points));
            }
        }
        let mut panels = vec![panel("speed (rpm)", 140.0, speeds)];
        if let Some(torque) = torque.filter(|torque| !torque.torques.is_empty()) {
            let end = |end: usize| torque.torques.iter().map(|t| (t.time_s, t.clutches_n_m[end])).collect::<Vec<_>>();
            let band = Band { label: "range".to_owned(), colour: RANGE, lower: end(0), upper: end(2) };
            panels.push(Panel {
                bands: vec![band],
                ..panel("U of both clutches (N\u{a0}m at the turbine)", 120.0, vec![series("U", FITTED, end(1))])
            });
        }
        panels.push(self.engine_torques(window_s, SHIFT_POINTS, 90.0));
        panels.push(self.gears(window_s, SHIFT_POINTS));
        panels.extend(motion_panels(record.vehicle.between(window_s)));
        let inertia = shift.inertia_s.map(|[start, end]| Span {
            label: "ratio changes".to_owned(),
            start,
            end,
            colour: INERTIA_PHASE,
        });
        Figure {
            x_label: "time (s)".into(),
            x_range: (window_s[0], window_s[1]),
            spans: inertia.into_iter().collect(),
            panels: with_values(panels).0,
        }
    }
}

const FITTED: Stroke = Stroke { colour: RANGE, weight: Weight::Equal, dash: None };
const REQUEST: Stroke = Stroke { colour: "#D55E00", weight: Weight::Equal, dash: None };
const SYNCHRONOUS: Stroke = Stroke { colour: "#009E73", weight: Weight::Equal, dash: Some("2 2.5") };

fn series(label: &str, stroke: Stroke, points: Vec<(f64, f64)>) -> Series {
    Series { label: label.to_owned(), stroke, points }
}

/// At most so many readings of a span, evenly.
fn points(readings: &Readings, span_s: [f64; 2], maximum: usize, unit: fn(f64) -> f64) -> Vec<(f64, f64)> {
    let count = readings.between(span_s).count();
    let every = count.div_ceil(maximum).max(1);
    readings.between(span_s).step_by(every).map(|(time_s, value)| (time_s, unit(value))).collect()
}

/// The first of these in one line, with the number of the others: a long drive has hundreds.
fn first_of(items: &[String], between: &str) -> String {
    const SAID: usize = 8;
    let said = items[..items.len().min(SAID)].join(between);
    match items.len().saturating_sub(SAID) {
        0 => said,
        more => format!("{said}{between}and {more} more"),
    }
}

#[cfg(test)]
mod tests {
    use super::first_of;

    #[test]
    fn a_long_list_is_cut_and_counted() {
        let items: Vec<String> = (1..=11).map(|item| item.to_string()).collect();
        assert_eq!(first_of(&items, "; "), "1; 2; 3; 4; 5; 6; 7; 8; and 3 more");
        assert_eq!(first_of(&items[..8], ", "), "1, 2, 3, 4, 5, 6, 7, 8");
        assert_eq!(first_of(&items[..1], ", "), "1");
    }
}
