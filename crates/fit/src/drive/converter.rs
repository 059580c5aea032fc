//! The capacity of a converter from engine torque and speeds.
//!
//! While the converter slips, the torque at the flywheel accelerates the engine and drives the pump:
//!
//! ```text
//! T_e(t - d) = J_e dw_e/dt + C(w_t/w_e) w_e^2
//! ```
//!
//! `C` is a line between knots over the speed ratio and zero at 1; `J_e` is the inertia of engine and pump, `d` the time by which
//! the torque signal is ahead of the torque. Least squares, robust by Huber's weights, `d` by search. The torque ratio of the converter
//! is not in these equations: it would need a torque on the output side.

use drivetrain::Real;
use nalgebra::{DMatrix, DVector};

use super::record::{DriveRecord, Moment};
use crate::Verdict;

/// Speed ratios between which the capacity is a line \[chosen: closer together where it falls\].
const KNOTS: [f64; 8] = [0.1, 0.3, 0.5, 0.7, 0.8, 0.85, 0.9, 0.95];
/// A knot needs so many moments around it.
const MOMENTS_AT_KNOT: f64 = 15.0;
/// Above this speed ratio the capacity is too small to be seen; the torque is that of the engine.
pub(crate) const COUPLED: f64 = 0.97;
/// Moments that are fitted; of more, every second, third, ... one.
const MAXIMUM: usize = 8_000;
/// Delays that are tried, s.
const DELAYS: std::ops::RangeInclusive<i32> = -20..=40;
const DELAY_STEP_S: f64 = 0.01;
const COARSE: usize = 4;
/// Errors beyond so many scales count less.
const HUBER: f64 = 2.0;
const ITERATIONS: u32 = 4;
/// Standard deviation of capacities and inertia by what the equations leave out, as a fraction \[chosen\]: rates over 20 ms, drag, one delay of the torque.
const MODEL: f64 = 0.015;
/// Standard deviation of the delay before the fit, s \[chosen\].
const DELAY_SD_S: f64 = 0.1;
/// Inertia that is expected, kg m^2, and its standard deviation \[chosen: passenger cars\]. It counts where the log has no change of speed.
const INERTIA: [f64; 2] = [0.2, 0.15];

/// The capacity at a speed ratio.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Knot {
    /// Turbine over engine speed.
    pub speed_ratio: f64,
    /// Capacity, N m s^2.
    pub capacity_n_m_s2: f64,
    /// Its standard deviation, N m s^2; the bend of the curve between knots is in it.
    pub sd_n_m_s2: f64,
    /// Time that the drive was near it, s.
    pub time_s: f64,
}

/// The converter of a drive.
#[derive(Debug, Clone, PartialEq)]
pub struct ConverterFit {
    /// The capacity at rising speed ratios; the last is 1, where it is zero.
    pub knots: Vec<Knot>,
    /// Inertia of engine and pump, kg m^2.
    pub inertia_kg_m2: f64,
    /// Its standard deviation.
    pub inertia_sd_kg_m2: f64,
    /// The torque comes so much later than its signal, s.
    pub delay_s: f64,
    /// Its standard deviation.
    pub delay_sd_s: f64,
    /// Scale of the residuals, N m: 1.48 times their median size.
    pub scale_n_m: f64,
    /// Time with a slipping converter that was fitted, s.
    pub fitted_s: f64,
}

/// Fits the converter of a drive.
///
/// # Errors
/// What the drive lacks for it.
pub fn fit_converter(record: &DriveRecord, moments: &[Moment]) -> Result<ConverterFit, String> {
    if record.engine_torque.is_empty() {
        return Err("no engine torque is mapped".to_owned());
    }
    let slips = |moment: &&Moment| !moment.no_slip && (0.5 * KNOTS[0]..COUPLED).contains(&moment.speed_ratio());
    let slipping: Vec<Moment> = moments.iter().filter(slips).copied().collect();
    let every = slipping.len().div_ceil(MAXIMUM).max(1);
    let some: Vec<Moment> = slipping.iter().step_by(every).copied().collect();
    let knots = knots_with_data(&some);
    if knots.len() < 2 {
        return Err("the converter hardly slips in this drive".to_owned());
    }
    let best = |steps: &mut dyn Iterator<Item = i32>| {
        let solved = |step| Some((step, Solution::of(record, &some, &knots, DELAY_STEP_S * f64::from(step))?));
        steps.filter_map(solved).min_by(|one, other| one.1.cost.total_cmp(&other.1.cost))
    };
    // The cost has one minimum that is wide: about 0.1 s.
    let coarse = best(&mut DELAYS.step_by(COARSE));
    let fine = coarse.and_then(|(step, _)| best(&mut (step - 3..=step + 3)));
    let Some((step, solution)) = fine else { return Err("the speeds and torques do not fit together".to_owned()) };
    let delay_s = DELAY_STEP_S * f64::from(step);
    let Some(sd) = solution.std_devs(&some, &knots) else {
        return Err("the speeds and torques do not fit together".to_owned());
    };
    let bends = bends(&knots, solution.unknowns.as_slice());
    let per_moment_s = 0.02 * every as f64;
    let knot = |(i, &speed_ratio): (usize, &f64)| Knot {
        speed_ratio,
        capacity_n_m_s2: solution.unknowns[i],
        sd_n_m_s2: Real::hypot(Real::hypot(sd[i], bends[i]), MODEL * solution.unknowns[i].abs()),
        time_s: per_moment_s * fractions(&some, &knots, i),
    };
    let all: Vec<Knot> = knots.iter().enumerate().map(knot).collect();
    drives_no_engine(&all)?;
    let coupled = Knot { speed_ratio: 1.0, capacity_n_m_s2: 0.0, sd_n_m_s2: 0.0, time_s: 0.0 };
    Ok(ConverterFit {
        knots: all.into_iter().chain([coupled]).collect(),
        inertia_kg_m2: solution.unknowns[knots.len()],
        inertia_sd_kg_m2: Real::hypot(sd[knots.len()], MODEL * solution.unknowns[knots.len()].abs()),
        delay_s,
        // The delay is searched in steps.
        delay_sd_s: Real::hypot(sd[knots.len() + 1], DELAY_STEP_S / 12.0_f64.sqrt()),
        scale_n_m: solution.scale_n_m,
        fitted_s: 0.02 * slipping.len() as f64,
    })
}

/// Refuses capacities of which one is negative by more than its range, or the mean is: a converter that slips takes torque from the engine.
fn drives_no_engine(knots: &[Knot]) -> Result<(), String> {
    let is_negative = |knot: &Knot| knot.capacity_n_m_s2 + 2.0 * knot.sd_n_m_s2 < 0.0;
    let sum: f64 = knots.iter().map(|knot| knot.capacity_n_m_s2).sum();
    let minimum = knots.iter().min_by(|one, other| one.capacity_n_m_s2.total_cmp(&other.capacity_n_m_s2));
    match minimum.filter(|_| sum < 0.0 || knots.iter().any(is_negative)) {
        None => Ok(()),
        Some(minimum) => Err(format!(
            "engine_torque does not fit the speeds: by it the converter would drive the engine (capacity {:.2}e-3 N m s² at speed ratio {}); \
             check unit and scale of engine_torque, and whether its friction is subtracted once (engine_friction_torque)",
            1e3 * minimum.capacity_n_m_s2,
            minimum.speed_ratio
        )),
    }
}

impl ConverterFit {
    /// What the drive tells of the inertia.
    pub fn inertia_verdict(&self) -> Verdict {
        Verdict::of(self.inertia_sd_kg_m2, INERTIA[1])
    }

    /// What it tells of the delay: nothing where the best one is at an end of those that are tried.
    pub fn delay_verdict(&self) -> Verdict {
        let ends_s = [*DELAYS.start(), *DELAYS.end()].map(|step| DELAY_STEP_S * f64::from(step));
        let is_inside = ends_s[0] + DELAY_STEP_S / 2.0 < self.delay_s && self.delay_s < ends_s[1] - DELAY_STEP_S / 2.0;
        if is_inside { Verdict::of(self.delay_sd_s, DELAY_SD_S) } else { Verdict::NotIdentifiable }
    }

    /// Capacity and its standard deviation at a speed ratio, N m s^2; none below the fitted ones.
    pub fn capacity(&self, speed_ratio: f64) -> Option<[f64; 2]> {
        let after = self.knots.iter().position(|knot| knot.speed_ratio >= speed_ratio)?;
        let (low, high) = (&self.knots[after.checked_sub(1)?], &self.knots[after]);
        let fraction = (speed_ratio - low.speed_ratio) / (high.speed_ratio - low.speed_ratio);
        let line = |from: f64, to: f64| from + fraction * (to - from);
        Some([line(low.capacity_n_m_s2, high.capacity_n_m_s2), line(low.sd_n_m_s2, high.sd_n_m_s2)])
    }

    /// Torque that the engine gives to the converter by its signal, N m: less what accelerates it.
    pub fn by_engine(&self, record: &DriveRecord, moment: &Moment) -> f64 {
        record.engine_torque.at(moment.time_s - self.delay_s) - self.inertia_kg_m2 * moment.engine_rad_s2
    }

    /// The same by the capacity of the converter, N m, with its standard deviation; none where it says nothing.
    pub fn by_converter(&self, moment: &Moment) -> Option<[f64; 2]> {
        let capacity = self.capacity(moment.speed_ratio()).filter(|_| !moment.no_slip)?;
        (moment.speed_ratio() < COUPLED).then(|| capacity.map(|value| value * Real::powi(moment.engine_rad_s, 2)))
    }
}

/// How far lines between knots lie from a curve through them, at each knot: of a curve with the second derivative `c`, the lines with the
/// least squares of distances pass its points at a spacing `h` by `c h^2 / 12`.
fn bends(knots: &[f64], capacities: &[f64]) -> Vec<f64> {
    let at = |i: usize| knots.get(i).map_or((1.0, 0.0), |ratio| (*ratio, capacities[i]));
    let bend = |i: usize| {
        let ((x0, y0), (x1, y1), (x2, y2)) = (at(i - 1), at(i), at(i + 1));
        let second = 2.0 * ((y2 - y1) / (x2 - x1) - (y1 - y0) / (x1 - x0)) / (x2 - x0);
        second.abs() * Real::powi(0.5 * (x2 - x0), 2) / 12.0
    };
    // The first knot has a line on one side only: the bend of the next.
    (0..knots.len()).map(|i| bend(i.max(1))).collect()
}

/// The knots that the drive was near to.
fn knots_with_data(moments: &[Moment]) -> Vec<f64> {
    let mut knots = KNOTS.to_vec();
    // A knot without data takes its part of its neighbours', so they are looked at again.
    while let Some(without) = (0..knots.len()).find(|i| fractions(moments, &knots, *i) < MOMENTS_AT_KNOT) {
        knots.remove(without);
    }
    knots
}

/// Parts of the moments that belong to a knot.
fn fractions(moments: &[Moment], knots: &[f64], knot: usize) -> f64 {
    moments.iter().map(|moment| fraction(knots, moment.speed_ratio(), knot)).sum()
}

/// How much a knot counts at a speed ratio, 0 to 1. Below the first knot the capacity stays.
fn fraction(knots: &[f64], speed_ratio: f64, knot: usize) -> f64 {
    let here = knots[knot];
    if speed_ratio <= here {
        match knot.checked_sub(1) {
            None => 1.0,
            Some(before) => ((speed_ratio - knots[before]) / (here - knots[before])).max(0.0),
        }
    } else {
        let next = knots.get(knot + 1).copied().unwrap_or(1.0);
        ((next - speed_ratio) / (next - here)).max(0.0)
    }
}

/// Unknowns for one delay: capacities at the knots, then the inertia.
struct Solution {
    unknowns: DVector<f64>,
    residuals: DVector<f64>,
    weights: DVector<f64>,
    scale_n_m: f64,
    cost: f64,
}

/// How a moment depends on the unknowns.
fn row(knots: &[f64], moment: &Moment, j: usize) -> f64 {
    if j < knots.len() {
        fraction(knots, moment.speed_ratio(), j) * Real::powi(moment.engine_rad_s, 2)
    } else {
        moment.engine_rad_s2
    }
}

fn weighted(rows: &DMatrix<f64>, weights: &DVector<f64>) -> DMatrix<f64> {
    let mut weighted = rows.clone();
    for (mut row, weight) in weighted.row_iter_mut().zip(weights.iter()) {
        row *= *weight;
    }
    weighted
}

impl Solution {
    fn of(record: &DriveRecord, moments: &[Moment], knots: &[f64], delay_s: f64) -> Option<Self> {
        let count = knots.len() + 1;
        let rows = DMatrix::from_fn(moments.len(), count, |i, j| row(knots, &moments[i], j));
        let torques = moments.iter().map(|moment| record.engine_torque.at(moment.time_s - delay_s));
        let torques = DVector::from_iterator(moments.len(), torques);
        let mut weights = DVector::from_element(moments.len(), 1.0);
        let (mut unknowns, mut residuals, mut scale_n_m) = (DVector::zeros(count), torques.clone(), 10.0);
        for _ in 0..ITERATIONS {
            let by_weight = weighted(&rows, &weights);
            let mut matrix = rows.tr_mul(&by_weight);
            let mut right = by_weight.tr_mul(&torques);
            let prior = Real::powi(scale_n_m / INERTIA[1], 2);
            matrix[(count - 1, count - 1)] += prior;
            right[count - 1] += prior * INERTIA[0];
            unknowns = matrix.cholesky()?.solve(&right);
            residuals = &torques - &rows * &unknowns;
            scale_n_m = scale_of(&residuals);
            weights = residuals.map(|e| (HUBER * scale_n_m / e.abs()).min(1.0));
        }
        let cost = residuals.iter().zip(weights.iter()).map(|(e, weight)| weight * e * e).sum();
        Some(Self { unknowns, residuals, weights, scale_n_m, cost })
    }

    /// Standard deviations of the unknowns, then that of the delay, which is unknown too: the larger of those with the correlation of the residuals in time, and of
    /// those from the scatter of blocks of a second.
    fn std_devs(&self, moments: &[Moment], knots: &[f64]) -> Option<Vec<f64>> {
        const BLOCK: usize = 50;
        /// Moments further apart are not joined by a line, s.
        const APART_S: f64 = 0.5;
        let count = knots.len() + 1;
        // The rate of the fitted torque: that of the signal has the rate of its noise, which would make the delay seem better known.
        let torque = |i: usize| (0..count).map(|j| row(knots, &moments[i], j) * self.unknowns[j]).sum::<f64>();
        let by_delay = |i: usize| {
            let (before, after) = (i.saturating_sub(1), (i + 1).min(moments.len() - 1));
            let span_s = moments[after].time_s - moments[before].time_s;
            if (f64::MIN_POSITIVE..APART_S).contains(&span_s) { (torque(after) - torque(before)) / span_s } else { 0.0 }
        };
        let cell = |i: usize, j: usize| if j < count { row(knots, &moments[i], j) } else { by_delay(i) };
        let rows = DMatrix::from_fn(moments.len(), count + 1, cell);
        let by_weight = weighted(&rows, &self.weights);
        let mut matrix = rows.tr_mul(&by_weight);
        matrix[(count - 1, count - 1)] += Real::powi(self.scale_n_m / INERTIA[1], 2);
        matrix[(count, count)] += Real::powi(self.scale_n_m / DELAY_SD_S, 2);
        let inverse = matrix.cholesky()?.inverse();
        let mut scatter = DMatrix::zeros(count + 1, count + 1);
        for first in (0..moments.len()).step_by(BLOCK) {
            let length = BLOCK.min(moments.len() - first);
            let score = by_weight.rows(first, length).tr_mul(&self.residuals.rows(first, length));
            scatter += &score * score.transpose();
        }
        let clustered = &inverse * scatter * &inverse;
        let inflation = Real::powi(self.scale_n_m, 2) * correlation(&self.residuals);
        Some((0..=count).map(|j| (inflation * inverse[(j, j)]).max(clustered[(j, j)]).sqrt()).collect())
    }
}

/// 1.48 times the median size.
fn scale_of(residuals: &DVector<f64>) -> f64 {
    let mut sizes: Vec<f64> = residuals.iter().map(|e| e.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    1.48 * sizes.get(sizes.len() / 2).copied().unwrap_or(0.0).max(1e-6)
}

/// By how much residuals that follow each other say less than independent ones: `1 + 2 sum rho_k`, as long as `rho_k` is positive.
fn correlation(residuals: &DVector<f64>) -> f64 {
    const LONGEST: usize = 100;
    let count = residuals.len();
    let of = |lag: usize| -> f64 { (lag..count).map(|i| residuals[i] * residuals[i - lag]).sum() };
    let all = of(0);
    let positive = (1..LONGEST.min(count)).map(|lag| of(lag) / all).take_while(|rho| *rho > 0.0);
    1.0 + 2.0 * positive.sum::<f64>()
}
