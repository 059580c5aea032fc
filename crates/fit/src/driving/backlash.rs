//! The backlash of the driveline, from reversals of its torque in a gear.
//!
//! What the gearbox output turns ahead of the wheels is the twist of the shafts, beyond the backlash on the side to which the torque acts:
//!
//! ```text
//! integral of (w_o/i_df - w_w) = c + e integral of w_w + d w_w + T/K + (b/2) sign(T)
//! ```
//!
//! with the error `e` of the scale of the wheel speed, the delay `d` between both readings, the stiffness `K` of the shafts and the torque `T` of the
//! converter at the wheels. `b` is the backlash at the wheels. Least squares over the changes from one time to the next, whose errors are
//! independent as far as those of the speeds are; robust by Huber's weights. Times soon after a reversal, in which the teeth are on their way and
//! the shafts oscillate, are left out.

use nalgebra::{DMatrix, DVector};

use super::{DrivenCar, Driving};
use crate::fitted_file::SIDES;
use crate::intervals::cluster;
use crate::weights::{FACTOR, HUBER, correlation};
use crate::{Series, Verdict};

/// Length of a cell, s, and time between the points of its means, s.
const CELL_S: f64 = 0.1;
const POINT_S: f64 = 0.01;
/// A longer stretch is cut, s.
const LONGEST_S: f64 = 60.0;
/// Stretches with reversals that are kept: ten hours in 20 MB.
const STRETCHES: usize = 600;
/// Longest time without a reading, s.
const GAP_S: f64 = 0.1;
/// Torque at the turbine with which the teeth rest against each other, N m \[chosen: more than the drag of a gearbox\].
const RESTS_N_M: f64 = 5.0;
/// After a reversal shafts come to rest, s \[chosen: several periods of their oscillation, 3 to 8 Hz\].
const SETTLES_S: f64 = 0.5;
/// A longer time from rest to rest tells nothing, s: the noise of the speeds adds up in the angle.
const REVERSES_S: f64 = 3.0;
/// Fewest reversals: their scatter is part of the interval.
const REVERSALS: usize = 4;
/// Deviations before the fit of scale, delay, s, and stiffness, as a share \[chosen\].
const SCALE: f64 = 0.02;
const DELAY_S: f64 = 0.03;
const STIFFNESS: f64 = 0.15;
/// Error of the torque in overrun, as a share: the overrun half of a converter's map is rarely measured \[chosen\].
const OVERRUN_SHARE: f64 = 0.3;
/// Deviation of a backlash of which nothing is known but that it is anywhere between 0 and 0.1 rad at the wheels \[chosen\]. The fit itself has none: a
/// mean would pull.
const BEFORE_RAD: f64 = 0.1 / 3.464;
const FREE_RAD: f64 = 1.0;
const TURNS: u32 = 5;
/// Greatest backlash that the error budget of a file may have, rad.
pub(crate) const MOST_RAD: f64 = 0.2;
/// Scale, delay, compliance, backlash.
const UNKNOWNS: usize = 4;

/// Which drive tells it.
const BACKLASH_TOLD_BY: &str = "press and release the accelerator in a gear on a straight road, each for 2 s, with the speed of the driven wheels logged";

/// What was found of the backlash.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BacklashFit {
    /// Backlash at the wheels, rad.
    pub rad: f64,
    /// Its standard deviation as it is stated.
    pub sd_rad: f64,
    /// Reversals of the torque that were fitted.
    pub reversals: usize,
}

impl BacklashFit {
    /// What the logs tell of it.
    pub fn verdict(&self) -> Verdict {
        Verdict::of(self.sd_rad, BEFORE_RAD)
    }

    /// Whether it goes into the file.
    pub(crate) fn is_told(&self) -> bool {
        self.verdict() != Verdict::NotTold
    }

    /// What it says of itself in the file.
    pub(crate) fn comment(&self) -> String {
        format!(
            "95 % +- {:.4} rad, {} reversals of the torque, {}",
            SIDES * self.sd_rad,
            self.reversals,
            self.verdict().name()
        )
    }

    /// What a fit says of it, or of what the logs lack for it.
    pub(crate) fn statement(found: &Result<Self, String>) -> String {
        match found {
            Ok(found) if found.is_told() => format!(
                "backlash of the driveline: {:.4} rad at the wheels, +- {:.4} rad, from {} reversals of its torque in a gear. The speed of one wheel tells it on \
                 straight roads, that of both driven wheels on all",
                found.rad,
                SIDES * found.sd_rad,
                found.reversals
            ),
            Ok(found) => {
                format!("backlash of the driveline: not told, +- {:.3} rad; {BACKLASH_TOLD_BY}", SIDES * found.sd_rad)
            }
            Err(reason) => format!("backlash of the driveline: not told: {reason}"),
        }
    }
}

/// A tenth of a second in a gear.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Cell {
    /// What the output turns ahead of the wheels, rad at the wheels, and what these turn.
    ahead_rad: f64,
    turned_rad: f64,
    wheel_rad_s: f64,
    /// At the turbine and at the wheels, less what accelerates the gearbox.
    turbine_n_m: f64,
    wheels_n_m: f64,
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
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most a minute over a step")]
        let count = ((span[1] - span[0]).max(0.0) / CELL_S) as usize;
        // What comes behind a cell without speeds is not its neighbour.
        let cells = (0..count).map_while(|at| cell(car, gear, &speeds, span[0] + CELL_S * at as f64));
        let cells: Vec<Cell> = cells.collect();
        if self.stretches.len() < STRETCHES
            && rests(&cells).windows(2).any(|pair| cells[pair[0]].sign() != cells[pair[1]].sign())
        {
            self.stretches.push(cells);
        }
    }
}

impl Cell {
    fn sign(&self) -> f64 {
        self.wheels_n_m.signum()
    }
}

/// The cell that begins at a time.
fn cell(car: &DrivenCar, gear: usize, speeds: &[Series; 4], begin_s: f64) -> Option<Cell> {
    let (gear, converter) = (car.gears.get(gear)?, car.converter.as_ref()?);
    let final_ratio = car.driveline.final_ratio;
    let [engine, turbine, output, wheel] = speeds;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "constants")]
    let points = (CELL_S / POINT_S).round() as u32;
    let share = f64::from(points).recip();
    let mut cell = Cell::default();
    for point in 0..points {
        let time_s = begin_s + POINT_S * (f64::from(point) + 0.5);
        let wheel_rad_s = wheel.at(time_s);
        cell.wheel_rad_s += share * wheel_rad_s;
        cell.ahead_rad += POINT_S * (output.at(time_s) / final_ratio - wheel_rad_s);
        cell.turned_rad += POINT_S * wheel_rad_s;
        cell.turbine_n_m += share * converter.torques(engine.at(time_s), turbine.at(time_s)).turbine_n_m;
    }
    let rate = (output.at(begin_s + CELL_S) - output.at(begin_s)) / CELL_S;
    cell.wheels_n_m = final_ratio * (gear.ratio * cell.turbine_n_m - gear.inertia_kg_m2 * rate);
    [cell.ahead_rad, cell.wheels_n_m].iter().all(|value| value.is_finite()).then_some(cell)
}

/// Cells in which the teeth rest against each other, and the shafts too.
fn rests(cells: &[Cell]) -> Vec<usize> {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "constants")]
    let before = (SETTLES_S / CELL_S).round() as usize;
    let is_clear = |cell: &Cell, sign: f64| sign * cell.turbine_n_m > RESTS_N_M && cell.sign() == sign;
    let rests = |at: &usize| {
        let sign = cells[*at].sign();
        cells[at - before..=(at + 1).min(cells.len() - 1)].iter().all(|cell| is_clear(cell, sign))
    };
    (before..cells.len()).filter(rests).collect()
}

/// A change from one time of rest to the next.
struct Change {
    /// Derivatives by the unknowns, and the angle.
    row: [f64; UNKNOWNS],
    angle_rad: f64,
    span_s: f64,
    /// Reversals count as groups of their own.
    group: usize,
    is_reversal: bool,
}

/// The changes of the stretches. Angles are those at the middles of the cells.
fn changes(stretches: &[&Vec<Cell>]) -> Vec<Change> {
    let mut all = Vec::new();
    let mut group = 0;
    for cells in stretches {
        group += 1;
        for pair in rests(cells).windows(2) {
            let [from, to] = [&cells[pair[0]], &cells[pair[1]]];
            let span_s = CELL_S * (pair[1] - pair[0]) as f64;
            let between = &cells[pair[0] + 1..pair[1]];
            let sum = |of: fn(&Cell) -> f64| 0.5 * (of(from) + of(to)) + between.iter().map(of).sum::<f64>();
            let is_reversal = from.sign() != to.sign();
            if span_s > REVERSES_S {
                continue;
            }
            group += usize::from(is_reversal);
            all.push(Change {
                row: [
                    sum(|cell| cell.turned_rad),
                    to.wheel_rad_s - from.wheel_rad_s,
                    to.wheels_n_m - from.wheels_n_m,
                    0.5 * (to.sign() - from.sign()),
                ],
                angle_rad: sum(|cell| cell.ahead_rad),
                span_s,
                group,
                is_reversal,
            });
            group += usize::from(is_reversal);
        }
    }
    all
}

/// The backlash of a car in the gears of its logs.
///
/// # Errors
/// What the logs lack for it.
pub(crate) fn fit_backlash<'a>(
    car: &DrivenCar,
    logs: impl Iterator<Item = &'a Driving>,
) -> Result<BacklashFit, String> {
    if car.converter.is_none() {
        return Err("the torque of a car without converter is not computed for it".to_owned());
    }
    let mut stretches: Vec<&Vec<Cell>> = Vec::new();
    for stretch in logs.flat_map(|log| &log.twists) {
        // The same drive says what it has to say once.
        if !stretches.contains(&stretch) {
            stretches.push(stretch);
        }
    }
    let changes = changes(&stretches);
    let reversals = changes.iter().filter(|change| change.is_reversal).count();
    if reversals < REVERSALS {
        return Err(format!(
            "{reversals} reversals of the torque in a gear with a wheel speed, {REVERSALS} are needed; {BACKLASH_TOLD_BY}"
        ));
    }
    let stiffness = car.driveline.shaft_stiffness_n_m_rad;
    let found = Regression::of(&changes, stiffness).filter(|(value, sd)| value.is_finite() && sd.is_finite());
    let (rad, sd_rad) =
        found.ok_or_else(|| format!("the speeds of output and wheels do not fit together; {BACKLASH_TOLD_BY}"))?;
    if rad > MOST_RAD {
        return Err(format!("it would be {rad:.2} rad at the wheels, and more than {MOST_RAD} rad is none of a car"));
    }
    let torques = stretches.iter().copied().flatten().map(|cell| cell.wheels_n_m);
    let (count, sum) =
        torques.filter(|torque| *torque < 0.0).fold((0.0, 0.0), |(n, sum), torque| (n + 1.0, sum - torque));
    let by_overrun = OVERRUN_SHARE * sum / f64::max(count, 1.0) / stiffness;
    Ok(BacklashFit { rad: rad.max(0.0), sd_rad: sd_rad.hypot(by_overrun), reversals })
}

/// The changes, each over the root of its time, so that their errors are alike.
struct Regression {
    rows: DMatrix<f64>,
    angles: DVector<f64>,
    before: DVector<f64>,
    precision: DMatrix<f64>,
}

impl Regression {
    /// The backlash and its standard deviation: the larger of those with the correlation of the errors in sequence, and by the scatter of reversals and
    /// stretches.
    fn of(changes: &[Change], stiffness_n_m_rad: f64) -> Option<(f64, f64)> {
        let compliance = stiffness_n_m_rad.recip();
        let sd = [SCALE, DELAY_S, STIFFNESS * compliance, FREE_RAD].map(|sd| sd.powi(-2));
        let root = |i: usize| changes[i].span_s.sqrt();
        let problem = Self {
            rows: DMatrix::from_fn(changes.len(), UNKNOWNS, |i, j| changes[i].row[j] / root(i)),
            angles: DVector::from_fn(changes.len(), |i, _| changes[i].angle_rad / root(i)),
            before: DVector::from_row_slice(&[0.0, 0.0, compliance, 0.0]),
            precision: DMatrix::from_diagonal(&DVector::from_row_slice(&sd)),
        };
        let mut at = problem.before.clone();
        let mut covariance = problem.precision.clone();
        for _ in 0..TURNS {
            (at, covariance) = problem.step(&problem.weights(&at))?;
        }
        let weighed = problem.weights(&at).component_mul(&(&problem.angles - &problem.rows * &at));
        let mut scores = vec![DVector::zeros(UNKNOWNS); changes.last()?.group + 1];
        for (i, change) in changes.iter().enumerate() {
            scores[change.group] += problem.rows.row(i).transpose() * weighed[i];
        }
        let cluster = cluster(&covariance, &scores, &problem.precision);
        Some((at[3], covariance[(3, 3)].max(cluster[(3, 3)]).sqrt()))
    }

    /// Weights of the changes at unknowns.
    fn weights(&self, at: &DVector<f64>) -> DVector<f64> {
        let errors = &self.angles - &self.rows * at;
        let scale = scale_of(&errors);
        let in_scales: Vec<f64> = errors.iter().map(|error| error / scale).collect();
        let variance = scale * scale * FACTOR * FACTOR * correlation(&[&in_scales], 0.0, 1.0);
        errors.map(|error| (HUBER * scale / error.abs()).min(1.0) / variance)
    }

    /// The unknowns with these weights, and their covariance.
    fn step(&self, weights: &DVector<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let mut weighed = self.rows.clone();
        weighed.row_iter_mut().zip(weights.iter()).for_each(|(mut row, weight)| row *= *weight);
        let cholesky = (self.rows.tr_mul(&weighed) + &self.precision).cholesky()?;
        let right = weighed.tr_mul(&self.angles) + &self.precision * &self.before;
        Some((cholesky.solve(&right), cholesky.inverse()))
    }
}

/// Robust standard deviation.
fn scale_of(errors: &DVector<f64>) -> f64 {
    let mut sizes: Vec<f64> = errors.iter().map(|error| error.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    (1.4826 * sizes.get(sizes.len() / 2).copied().unwrap_or(0.0)).max(1e-9)
}
