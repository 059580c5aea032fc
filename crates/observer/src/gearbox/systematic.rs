//! What many shifts have wrong alike, and do not average out.
//!
//! The equations of a shift are not those of the car: a reading has an age, a valve has hysteresis, near the kiss point a clutch has the mean
//! torque of an uncertain pressure, open clutches drag. Such an error is much the same in all shifts, so a quantity `a` is shown as `a + u` with
//! one `u` of variance `beta`. For the next shift `a + u` is what counts, so the filter begins it with the mean `m` and the variance `P` by shifts
//! that are taken to err independently. What is said of the car itself is `a`, in units of the standard deviation unlearnt:
//!
//! ```text
//! mean s m     variance 1 - s (1 - P)     s = 1/(1 + beta (1 - P))
//! ```
//!
//! With nothing learnt `P = 1`, and nothing changes; however many shifts there are, the variance is not below `beta/(1 + beta)`. A covariance
//! `P_ij` becomes `s_i s_j P_ij`: the errors `u` of two quantities are independent.
//!
//! The scale of all torques that shifts show has such an error, too, of 7 to 9 %, as large as what is known of the torques of converter and engine
//! before any shift. These and the stiffness of the drive shafts are therefore considered in a shift and not estimated (Schmidt 1966): their
//! uncertainty counts in all that shifts show, and shifts do not correct them. What is learnt of both torques is what the time in the gears
//! shows.

use drivetrain::Real;

use super::learnt::{DELAY_AT, INERTIA_AT, KISS_AT, LAG_AT, LEARNT, Learnt, REPORTED_AT, STIFFNESS_AT, TURBINE_AT};

/// Variance of `u`, in that of the quantity unlearnt \[chosen, from cars of the whole budget: the example
/// `learnt_coverage` of `study`\]: of torque factors, kiss
/// points, inertias, lags and delays. The hysteresis of a valve shows as a delay, the age of the readings as an inertia.
const OF_FACTOR: f64 = 0.8;
const OF_KISS: f64 = 0.15;
const OF_INERTIA: f64 = 1.0;
const OF_LAG: f64 = 0.4;
const OF_DELAY: f64 = 2.0;

/// Variance of the error that all shifts have in common of what they show of a quantity.
pub(super) fn variance_in_common(k: usize) -> f64 {
    match k {
        0..KISS_AT => OF_FACTOR,
        KISS_AT..INERTIA_AT => OF_KISS,
        INERTIA_AT..TURBINE_AT => OF_INERTIA,
        LAG_AT..DELAY_AT => OF_LAG,
        DELAY_AT..LEARNT => OF_DELAY,
        _ => 0.0,
    }
}

/// Whether shifts do not correct a quantity.
pub(super) fn is_considered(k: usize) -> bool {
    matches!(k, TURBINE_AT | STIFFNESS_AT | REPORTED_AT)
}

impl<T: Real> Learnt<T> {
    /// The part of its mean that is left of a quantity with what shifts have in common.
    fn kept(&self, k: usize) -> T {
        let one = T::one();
        let known = (one - self.covariance[k.min(LEARNT - 1)][k.min(LEARNT - 1)]).max(T::zero());
        (one + T::of(variance_in_common(k)) * known).recip()
    }

    /// Mean of a quantity with what shifts have in common.
    pub(super) fn mean_of(&self, k: usize) -> T {
        self.kept(k) * self.mean[k.min(LEARNT - 1)]
    }

    /// Covariance of two quantities with what shifts have in common.
    pub(super) fn covariance_of(&self, i: usize, j: usize) -> T {
        let (i, j) = (i.min(LEARNT - 1), j.min(LEARNT - 1));
        let (covariance, kept) = (self.covariance[i][j], self.kept(i));
        if i == j {
            return (T::one() - kept * (T::one() - covariance)).max(covariance);
        }
        kept * self.kept(j) * covariance
    }
}
