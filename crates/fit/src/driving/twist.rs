//! What the gearbox output turns ahead of the wheels in a gear, and the torque that does it, in cells of a tenth of a second.
//!
//! ```text
//! integral of (w_o/i_df - w_w) = c + e integral of w_w + d w_w + T/K + (b/2) sign(T)
//! ```
//!
//! with the error `e` of the scale of the wheel speed, the delay `d` between both readings, the stiffness `K` of the shafts, the backlash `b` and the
//! torque `T` of the converter at the wheels, less what accelerates the gearbox. Least squares over the changes from one time of rest to
//! the next, whose errors are independent as far as those of the speeds are; robust by Huber's weights.

use super::DrivenCar;
use super::lines::{Identified, Line};
use crate::Series;

/// Length of a cell, s, and time between the points of its means, s.
pub(crate) const CELL_S: f64 = 0.1;
const POINT_S: f64 = 0.01;
/// A longer stretch is cut, s.
const LONGEST_S: f64 = 60.0;
/// Stretches that are kept: twenty hours in 60 MB.
const STRETCHES: usize = 1200;
/// Longest time without a reading, s.
const GAP_S: f64 = 0.1;
/// Torque at the turbine with which the teeth rest against each other, N m \[chosen: more than the drag of a gearbox\].
const RESTS_N_M: f64 = 5.0;
/// After a reversal shafts come to rest, s \[chosen: several periods of their oscillation, 3 to 8 Hz\].
const SETTLES_S: f64 = 0.5;
/// A longer time from rest to rest tells nothing, s: the noise of the speeds adds up in the angle.
const REVERSES_S: f64 = 3.0;
/// Standard deviations before a fit of scale and delay, s \[chosen\], and of a backlash, rad: a mean would pull.
pub(crate) const SCALE: f64 = 0.02;
pub(crate) const DELAY_S: f64 = 0.03;
const FREE_RAD: f64 = 1.0;
/// Scale, delay, compliance, backlash.
const UNKNOWNS: usize = 4;

/// A tenth of a second in a gear.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Cell {
    /// What the output turns ahead of the wheels, rad at the wheels, and what these turn.
    pub(crate) ahead_rad: f64,
    pub(crate) turned_rad: f64,
    pub(crate) wheel_rad_s: f64,
    /// At the turbine, and at the wheels, less what accelerates the gearbox.
    pub(crate) turbine_n_m: f64,
    pub(crate) wheels_n_m: f64,
    /// Parts of the torque at the wheels, N m: by the converter, and of that by the torque ratio above 1.
    pub(crate) converter_n_m: f64,
    pub(crate) above_one_n_m: f64,
}

/// Takes the speeds of a log, and reduces them to cells.
#[derive(Debug, Clone, Default)]
pub(crate) struct TwistRecorder {
    /// Gear, and time at which the stretch begins.
    open: Option<(usize, f64)>,
    /// Engine, turbine, output and wheels.
    speeds: [Series; 4],
    pub(crate) stretches: Vec<Vec<Cell>>,
}

impl TwistRecorder {
    /// Takes readings of engine, turbine, output and wheels, each with the time that it belongs to.
    pub(crate) fn push(&mut self, car: &DrivenCar, time_s: f64, speeds: [Option<(f64, f64)>; 4], gear: Option<usize>) {
        let goes_on = self
            .open
            .is_some_and(|(open, begin_s)| Some(open) == gear && (begin_s..begin_s + LONGEST_S).contains(&time_s));
        if !goes_on {
            self.close(car);
            self.open = gear.map(|gear| (gear, time_s));
        }
        if self.open.is_some() {
            let readings = self.speeds.iter_mut().zip(speeds);
            readings.filter_map(|(series, reading)| Some((series, reading?))).for_each(|(series, (time_s, value))| {
                series.push(time_s, value);
            });
        }
    }

    /// Ends a stretch.
    pub(crate) fn close(&mut self, car: &DrivenCar) {
        let speeds = std::mem::take(&mut self.speeds);
        let Some((gear, _)) = self.open.take() else { return };
        let ends = |end: fn(&Vec<f64>) -> Option<&f64>| speeds.each_ref().map(|series| end(&series.time_s).copied());
        let ([Some(a), Some(b), Some(c), Some(d)], [Some(e), Some(f), Some(g), Some(h)]) =
            (ends(|times| times.first()), ends(|times| times.last()))
        else {
            return;
        };
        let span = [a.max(b).max(c).max(d), e.min(f).min(g).min(h)];
        if speeds.iter().any(|series| series.longest_gap_s(span) > GAP_S) {
            return;
        }
        let count = ((span[1] - span[0]).max(0.0) / CELL_S) as usize;
        // What comes behind a cell without speeds is not its neighbour.
        let cells = (0..count).map_while(|at| cell(car, gear, &speeds, span[0] + CELL_S * at as f64));
        let cells: Vec<Cell> = cells.collect();
        if self.stretches.len() < STRETCHES && !cells.is_empty() {
            self.stretches.push(cells);
        }
    }
}

impl Cell {
    /// The direction of the torque.
    pub(crate) fn sign(&self) -> f64 {
        self.wheels_n_m.signum()
    }
}

/// The cell that begins at a time.
fn cell(car: &DrivenCar, gear: usize, speeds: &[Series; 4], begin_s: f64) -> Option<Cell> {
    let (gear, converter) = (car.gears.get(gear)?, car.converter.as_ref()?);
    let final_ratio = car.driveline.final_ratio;
    let [engine, turbine, output, wheel] = speeds;
    let points = (CELL_S / POINT_S).round() as u32;
    let fraction = f64::from(points).recip();
    let mut cell = Cell::default();
    for point in 0..points {
        let time_s = begin_s + POINT_S * (f64::from(point) + 0.5);
        let wheel_rad_s = wheel.at(time_s);
        cell.wheel_rad_s += fraction * wheel_rad_s;
        cell.ahead_rad += POINT_S * (output.at(time_s) / final_ratio - wheel_rad_s);
        cell.turned_rad += POINT_S * wheel_rad_s;
        let torques = converter.torques(engine.at(time_s), turbine.at(time_s));
        cell.turbine_n_m += fraction * torques.turbine_n_m;
        cell.above_one_n_m += fraction * final_ratio * gear.ratio * (torques.turbine_n_m - torques.pump_n_m);
    }
    cell.converter_n_m = final_ratio * gear.ratio * cell.turbine_n_m;
    let rate = (output.at(begin_s + CELL_S) - output.at(begin_s)) / CELL_S;
    cell.wheels_n_m = cell.converter_n_m - final_ratio * gear.inertia_kg_m2 * rate;
    [cell.ahead_rad, cell.wheels_n_m].iter().all(|value| value.is_finite()).then_some(cell)
}

/// What is known besides of the torque at the gearbox input: factors on the capacity of the converter and on its torque ratio above 1, and the standard
/// standard deviation of the logarithm of the torque.
#[derive(Debug, Clone, Copy)]
pub(crate) struct InputTorque {
    pub(crate) capacity: f64,
    pub(crate) ratio: f64,
    pub(crate) sd: f64,
}

impl InputTorque {
    /// That of the file.
    pub(crate) const OF_FILE: Self = Self { capacity: 1.0, ratio: 1.0, sd: 0.0 };

    /// Torque of the shafts at the wheels in a cell, N m.
    fn at_wheels(&self, cell: &Cell) -> f64 {
        let more = (self.capacity - 1.0) * cell.converter_n_m + self.capacity * (self.ratio - 1.0) * cell.above_one_n_m;
        cell.wheels_n_m + more
    }
}

/// Cells in which the teeth rest against each other, and the shafts too.
pub(crate) fn rests(cells: &[Cell]) -> Vec<usize> {
    let before = (SETTLES_S / CELL_S).round() as usize;
    let is_clear = |cell: &Cell, sign: f64| sign * cell.turbine_n_m > RESTS_N_M && cell.sign() == sign;
    let rests = |at: &usize| {
        let sign = cells[*at].sign();
        cells[at - before..=(at + 1).min(cells.len() - 1)].iter().all(|cell| is_clear(cell, sign))
    };
    (before..cells.len()).filter(rests).collect()
}

/// The points of rest from which changes are taken: of those in a row every so many, and both ends.
fn points(cells: &[Cell], apart: usize, min_rad_s: f64) -> Vec<usize> {
    let rests: Vec<usize> = rests(cells).into_iter().filter(|at| cells[*at].wheel_rad_s > min_rad_s).collect();
    let mut first = 0;
    let mut points = Vec::new();
    for (i, at) in rests.iter().enumerate() {
        if i == 0 || at - rests[i - 1] > 1 {
            first = i;
        }
        let is_last = rests.get(i + 1).is_none_or(|next| next - at > 1);
        if is_last || (i - first).is_multiple_of(apart) {
            points.push(*at);
        }
    }
    points
}

/// The changes of the stretches from one time of rest to the next, and how many of them are reversals, which count as groups of their own. Angles are those
/// at the middles of the cells. In a row of cells they are so many of them long; slower wheels are left out.
pub(crate) fn changes(
    stretches: &[&Vec<Cell>],
    apart: usize,
    min_rad_s: f64,
    torque: &InputTorque,
) -> (Vec<Line<UNKNOWNS>>, usize) {
    let mut all = Vec::new();
    let (mut group, mut reversals) = (0, 0);
    for cells in stretches {
        group += 1;
        for pair in points(cells, apart, min_rad_s).windows(2) {
            let [from, to] = [&cells[pair[0]], &cells[pair[1]]];
            let span_s = CELL_S * (pair[1] - pair[0]) as f64;
            let between = &cells[pair[0] + 1..pair[1]];
            let sum = |of: fn(&Cell) -> f64| 0.5 * (of(from) + of(to)) + between.iter().map(of).sum::<f64>();
            let is_reversal = from.sign() != to.sign();
            if span_s > REVERSES_S {
                continue;
            }
            group += usize::from(is_reversal);
            reversals += usize::from(is_reversal);
            all.push(Line {
                row: [
                    sum(|cell| cell.turned_rad),
                    to.wheel_rad_s - from.wheel_rad_s,
                    torque.at_wheels(to) - torque.at_wheels(from),
                    0.5 * (to.sign() - from.sign()),
                ],
                value: sum(|cell| cell.ahead_rad),
                span_s,
                group,
            });
            group += usize::from(is_reversal);
        }
    }
    (all, reversals)
}

/// What changes tell of scale, delay, compliance and backlash, with the compliance of before and its standard deviation as a fraction;
/// none if the equations have no finite solution.
pub(crate) fn identified(changes: &[Line<UNKNOWNS>], compliance: f64, fraction: f64) -> Option<Identified<UNKNOWNS>> {
    Identified::of(changes, [0.0, 0.0, compliance, 0.0], [SCALE, DELAY_S, fraction * compliance, FREE_RAD])
}
