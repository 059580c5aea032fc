//! Delay and scale of the output speed and of the engine speed against the turbine speed, from driving in which they turn by a known ratio.
//!
//! In a gear `w_t = i w_o` as long as no clutch slips, and `w_t = w_e` with the lock-up clutch closed. A channel that is late by `d`, and that has to be
//! multiplied with `1 + e`, reads `r`:
//!
//! ```text
//! w_t = i (1 + e) (r + d r')
//! ```
//!
//! Means over tenths of a second, with the rate between the means before and after; robust least squares ([`Identified`]).

use super::known::{Known, MIN_DELAY_S, MIN_SCALE, change_of_delay, said_of_delay};
use super::lines::{Identified, Line};
use super::twist::{DELAY_S, SCALE};
use crate::Series;
use crate::verdict::SIDES;

/// Length of a cell, s, and time between the points of its means, s.
const CELL_S: f64 = 0.1;
const POINT_S: f64 = 0.01;
/// After a shift, and after the lock-up clutch is applied, clutches come to rest, s \[chosen\].
const SETTLES_S: f64 = 0.5;
/// A longer stretch is cut, s.
const LONGEST_S: f64 = 60.0;
/// Longest time without a reading, s.
const GAP_S: f64 = 0.1;
/// Output speed below which the readings of toothed wheels are too old, rad/s \[chosen, as in the filter\]. A shaft that turns by a higher ratio is faster.
const SLOWEST_RAD_S: f64 = 15.0;
/// Cells that are kept: two hours.
const CELLS: usize = 72_000;
/// Minimum time of driving, s, and fewest stretches: their scatter is part of the intervals.
const TIME_S: f64 = 20.0;
const GROUPS: usize = 4;
/// Minimum standard deviations that are stated, as in the one-shift fit: of scale and delay, s.
const FLOORS: [f64; 2] = [1e-4, 0.3e-3];

/// Fraction and speed, rad/s, by which the turbine may be off the ratio of the gear.
const RATIO_FRACTION: f64 = 0.03;
const RATIO_RAD_S: f64 = 2.0;

/// A reading at the time that it belongs to.
pub(crate) type Dated = Option<(f64, f64)>;

/// Means of the turbine speed and of what a channel says that it is, rad/s.
pub(crate) type Pair = [f64; 2];

/// A channel against the turbine speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SkewFit {
    /// What its readings have to be multiplied with, less 1, if those of the turbine speed are right.
    pub scale: Known,
    /// By how much they are late, s.
    pub late_s: Known,
    /// Time of driving that was used, s.
    pub time_s: f64,
}

impl SkewFit {
    /// By how much the readings are late, s, where it is identified and not small.
    pub(crate) fn identified_late_s(&self) -> Option<f64> {
        self.late_s.is_off_by(MIN_DELAY_S).then_some(self.late_s.value)
    }

    /// What a fit says of the channel with this role.
    pub(crate) fn statement(role: &str, found: &Result<Self, String>) -> String {
        let found = match found {
            Ok(found) => found,
            Err(reason) => return format!("{role} against the turbine speed: delay not identified: {reason}"),
        };
        const IDENTIFIED_BY: &str = "speeds that change in a gear would identify it";
        let change = change_of_delay(role, &found.late_s);
        let mut text = said_of_delay(role, "the turbine speed", &found.late_s, change.as_ref(), IDENTIFIED_BY);
        if found.scale.is_off_by(MIN_SCALE) {
            text += &format!(
                ". It has to be multiplied with {:.4} +- {:.4} to be that of the gear by the turbine speed: `scale` of one of both channels, or a ratio, is wrong",
                1.0 + found.scale.value,
                SIDES * found.scale.sd
            );
        }
        text
    }

    /// A channel by the pairs of its stretches; `of` says in which driving they are.
    ///
    /// # Errors
    /// What the logs lack for it.
    pub(crate) fn of(stretches: &[Vec<Pair>], of: &str) -> Result<Self, String> {
        let lines = lines(stretches);
        let mut groups: Vec<usize> = lines.iter().map(|line| line.group).collect();
        groups.dedup();
        let time_s = CELL_S * lines.len() as f64;
        if time_s < TIME_S || groups.len() < GROUPS {
            return Err(format!(
                "{time_s:.0} s of driving {of}, in {} stretches; {TIME_S:.0} s in {GROUPS} are needed",
                groups.len()
            ));
        }
        let found = Identified::of(&lines, [0.0; 2], [SCALE, DELAY_S]).ok_or("the speeds do not fit together")?;
        Ok(Self {
            scale: Known::of(found.value[0], found.sd[0], FLOORS[0], SCALE),
            late_s: Known::of(found.value[1], found.sd[1], FLOORS[1], DELAY_S),
            time_s,
        })
    }
}

/// The equations of cells whose neighbours turn together too.
fn lines(stretches: &[Vec<Pair>]) -> Vec<Line<2>> {
    let turn_together = |[turbine, other]: &Pair| turns_by(1.0, *turbine, *other);
    let of_stretch = |(group, cells): (usize, &Vec<Pair>)| -> Vec<Line<2>> {
        let all = cells.windows(3).filter(|cells| cells.iter().all(turn_together));
        let line = |cells: &[Pair]| {
            let rate = (cells[2][1] - cells[0][1]) / (2.0 * CELL_S);
            let [turbine, other] = cells[1];
            Line { row: [other, rate], value: turbine - other, span_s: CELL_S, group }
        };
        all.map(line).collect()
    };
    stretches.iter().enumerate().flat_map(of_stretch).collect()
}

/// Takes the readings of the turbine speed and of a channel, and reduces them to cells.
#[derive(Debug, Clone, Default)]
pub(crate) struct SkewRecorder {
    /// Gear, ratio of turbine speed and channel in it, and time at which the stretch begins.
    open: Option<(usize, f64, f64)>,
    speeds: [Series; 2],
    pub(crate) stretches: Vec<Vec<Pair>>,
    cells: usize,
}

impl SkewRecorder {
    /// Takes readings, each with the time that it belongs to, while the shafts turn by a ratio in a gear.
    pub(crate) fn push(&mut self, time_s: f64, speeds: [Dated; 2], gear: Option<(usize, f64)>) {
        match self.open {
            Some((open, ratio, begin_s)) if Some((open, ratio)) == gear && time_s >= begin_s - SETTLES_S => {
                if time_s >= begin_s + LONGEST_S {
                    self.close();
                    self.open = Some((open, ratio, time_s));
                }
            }
            _ => {
                self.close();
                self.open = gear.map(|(gear, ratio)| (gear, ratio, time_s + SETTLES_S));
            }
        }
        if self.open.is_some() {
            for (series, reading) in self.speeds.iter_mut().zip(speeds) {
                reading.into_iter().for_each(|(time_s, value)| series.push(time_s, value));
            }
        }
    }

    /// Ends a stretch.
    pub(crate) fn close(&mut self) {
        let speeds = std::mem::take(&mut self.speeds);
        let Some((_, ratio, begin_s)) = self.open.take() else { return };
        let mut span = [begin_s, f64::INFINITY];
        for series in &speeds {
            let (Some(first_s), Some(last_s)) = (series.time_s.first(), series.time_s.last()) else { return };
            span = [span[0].max(*first_s), span[1].min(*last_s)];
        }
        if self.cells >= CELLS || speeds.iter().any(|series| series.longest_gap_s(span) > GAP_S) {
            return;
        }
        let count = ((span[1] - span[0]).max(0.0) / CELL_S) as usize;
        let cells = (0..count).map(|at| {
            let [turbine, other] = speeds.each_ref().map(|series| mean(series, span[0] + CELL_S * at as f64));
            // What is not a number turns together with nothing.
            if other > SLOWEST_RAD_S { [turbine, ratio * other] } else { [f64::NAN; 2] }
        });
        let cells: Vec<Pair> = cells.collect();
        // A line needs a cell with two neighbours.
        if cells.len() > 2 {
            self.cells += cells.len();
            self.stretches.push(cells);
        }
    }
}

/// Mean of readings over the cell that begins at a time.
fn mean(series: &Series, begin_s: f64) -> f64 {
    let points = (CELL_S / POINT_S).round() as u32;
    let at = (0..points).map(|point| series.at(begin_s + POINT_S * (f64::from(point) + 0.5)));
    at.sum::<f64>() / f64::from(points)
}

/// Whether turbine and output turn by a ratio.
pub(crate) fn turns_by(ratio: f64, turbine_rad_s: f64, output_rad_s: f64) -> bool {
    let by_output = ratio * output_rad_s;
    (turbine_rad_s - by_output).abs() <= RATIO_RAD_S + RATIO_FRACTION * by_output.abs()
}
