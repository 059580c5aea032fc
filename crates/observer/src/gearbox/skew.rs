//! By how much the readings of turbine and output speed are late against each other, found while a gear holds.
//!
//! In the gear `w_t = i w_o`. Readings that are late by `d_t` and `d_o` differ by
//!
//! ```text
//! w_t - i w_o = -(d_t - d_o) i w_o'
//! ```
//!
//! Least squares over the time in the gear give `d_t - d_o`. A delay that both have in common does not show.

use drivetrain::Real;

use super::{FIRST_S, GearboxFilter, Newest, OUTPUT, SPEEDS, ShiftInput, TURBINE};

/// Smallest skew that is taken off, s \[chosen\]: what the lags of toothed wheels leave is less.
const MIN_S: f64 = 3e-3;
/// Standard deviations of the skew by the noise of the readings below which it is none.
const SHOWN: f64 = 3.0;
/// Time constant with which slip and rate of the output speed are low-passed before they are compared, s \[chosen\].
const SMOOTH_S: f64 = 0.1;

/// What the readings in gears have shown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Skew<T> {
    smooth: Option<Smooth<T>>,
    /// Sums over `i w_o'` squared, and times the slip.
    squares: T,
    products: T,
    /// By how much the turbine speed is taken to be older than that of the output, s.
    pub(super) found_s: T,
}

/// Speed of the output and slip of the turbine against it, low-passed, rad/s.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Smooth<T> {
    output: T,
    slip: T,
}

impl<T: Real> Skew<T> {
    pub(super) fn nothing() -> Self {
        let zero = T::zero();
        Self { smooth: None, squares: zero, products: zero, found_s: zero }
    }

    /// The input with readings that are older by what was found; the earlier of both speeds is taken to be of its time.
    pub(super) fn taken_off(&self, input: &ShiftInput<T>) -> ShiftInput<T> {
        let mut input = *input;
        let speeds = [(&mut input.turbine_rad_s, self.found_s), (&mut input.output_rad_s, -self.found_s)];
        for (reading, older_s) in speeds {
            if let Some(reading) = reading {
                reading.age_s = reading.age_s + older_s.at_least(T::zero());
            }
        }
        input
    }

    fn take(&mut self, rate: T, slip: T, std_dev: T, max_s: T) {
        self.squares = self.squares + rate * rate;
        self.products = self.products + rate * slip;
        let skew_s = -self.products / self.squares;
        let is_shown = skew_s.abs() > (T::of(SHOWN) * std_dev / self.squares.sqrt()).at_least(T::of(MIN_S));
        self.found_s = if is_shown { skew_s.at_least(-max_s).at_most(max_s) } else { T::zero() };
    }
}

impl<T: Real> GearboxFilter<'_, T> {
    /// Takes what a step of this time, s, has shown of the skew in a gear with this ratio, up to the maximum, s. The filter may not run
    /// yet: late readings look like a slip.
    pub(super) fn take_skew(
        &self,
        skew: &mut Skew<T>,
        newest: &[Option<Newest<T>>; SPEEDS],
        (ratio, dt_s): (T, T),
        max_s: T,
    ) {
        skew.smooth = self.smoothed(skew, newest, (ratio, dt_s), max_s);
    }

    fn smoothed(
        &self,
        skew: &mut Skew<T>,
        newest: &[Option<Newest<T>>; SPEEDS],
        (ratio, dt_s): (T, T),
        max_s: T,
    ) -> Option<Smooth<T>> {
        let fresh = |k: usize| newest[k].filter(|newest| newest.age_s <= T::of(FIRST_S) && !newest.refused);
        let (turbine, output) = (fresh(TURBINE)?, fresh(OUTPUT)?);
        let now = output.value;
        if now.abs() <= self.uncertainty.output_least_rad_s {
            return None;
        }
        let older_s = turbine.age_s.at_least(output.age_s);
        let slip = self.slip(ratio, [turbine.reached(older_s)?, output.reached(older_s)?]);
        let before = skew.smooth.unwrap_or(Smooth { output: now, slip: T::zero() });
        let fraction = dt_s / (dt_s + T::of(SMOOTH_S));
        let output = before.output + fraction * (now - before.output);
        let rate = ratio * (now - output) / T::of(SMOOTH_S);
        // As it would be with nothing taken off.
        let value = slip.value - skew.found_s * rate;
        // A clutch that slips, or another gear. A comparison with NaN is false.
        let is_gear = value.abs() <= slip.threshold() + T::of(2.0) * max_s * rate.abs();
        let smooth = Smooth { output, slip: before.slip + fraction * (value - before.slip) };
        is_gear.then(|| {
            skew.take(rate, smooth.slip, slip.std_dev, max_s);
            smooth
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The skew after two seconds in a gear, in which the turbine speed is late by this time, s.
    fn found_s(late_s: f64) -> f64 {
        let (rate, mut skew) = (60.0, Skew::nothing());
        for _ in 0..200 {
            skew.take(rate, -late_s * rate, 0.3, 0.01);
        }
        skew.found_s
    }

    #[test]
    fn a_late_turbine_or_output_speed_is_found_within_its_limit() {
        for late_s in [0.004, -0.004, 0.009] {
            assert!((found_s(late_s) - late_s).abs() < 1e-12);
        }
        assert_eq!((found_s(0.002), found_s(0.03), found_s(-0.03)), (0.0, 0.01, -0.01));
    }

    #[test]
    fn without_an_acceleration_no_skew_is_found() {
        let mut skew = Skew::nothing();
        for rate in [0.0, 1e-3, -1e-3] {
            skew.take(rate, 0.3, 0.3, 0.01);
            assert_eq!(skew.found_s, 0.0);
        }
    }
}
