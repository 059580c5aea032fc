//! By how much the readings of turbine, output and wheel speed are late against each other, found while a gear holds.
//!
//! In the gear `w_t = i w_o`, and but for the twist of the shafts `w_o = i_df w_w`. Readings that are late by `d_t`, `d_o` and `d_w`, with a wheel speed that
//! reads `1 + s` times the true one, differ by
//!
//! ```text
//! w_t - i w_o    = -(d_t - d_o) i w_o'
//! w_o/i_df - w_w = (d_w - d_o) w_w' - s w_w
//! ```
//!
//! Least squares over the time in gears give `d_t - d_o` and `d_w - d_o`. A delay that all have in common does not show.

use drivetrain::Real;

use super::{FIRST_S, GearboxFilter, GearboxState, Newest, OUTPUT, SPEEDS, ShiftInput, TURBINE, WHEEL, square};

/// Smallest skew that is taken off, s \[chosen\]: what the lags of toothed wheels leave is less.
const MIN_S: f64 = 3e-3;
/// Standard deviations of the skew by the noise of the readings below which it is none.
const SHOWN: f64 = 3.0;
/// Standard deviation by the noise of the readings below which what came long ago counts less, s \[chosen\].
const KNOWN_S: f64 = 2e-4;
/// Multiple of its standard deviation from which on a rate counts \[chosen\]: the noise of the output speed is in rate and slip, and a weaker one would look
/// like a skew.
const RATE_SHOWN: f64 = 4.0;
/// The same of the wheel speed \[chosen\]: smallest and largest delay that is taken off, s; the delay that would show from which on one is; and the standard
/// deviation below which what came long ago counts less.
const WHEEL_MIN_S: f64 = 6e-3;
const WHEEL_MAX_S: f64 = super::LONGEST_DELAY_S;
const WHEEL_SURE_S: f64 = 0.02;
const WHEEL_KNOWN_S: f64 = 1e-3;
/// Density of the rate of twist of the shafts, rad^2/s \[chosen\]: 0.1 rad/s for 0.3 s each way.
const TWIST_RAD2_S: f64 = 6e-3;
/// Time constant with which slip and rate of the output speed are low-passed before they are compared, s \[chosen\].
const SMOOTH_S: f64 = 0.1;

/// What the readings in gears have shown.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Skew<T> {
    smooth: Option<Smooth<T>>,
    /// Sums over `i w_o'` squared, and times the slip.
    squares: T,
    products: T,
    /// By how much the turbine speed is taken to be older than that of the output, s.
    found_s: T,
    wheel: WheelDelay<T>,
}

/// Speed of the output, slip of the turbine against it, and of the output over the final ratio against the wheels, low-passed, rad/s.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Smooth<T> {
    output: T,
    slip: T,
    twist: Option<T>,
}

impl<T: Real> Skew<T> {
    pub(super) fn nothing() -> Self {
        let zero = T::zero();
        Self { smooth: None, squares: zero, products: zero, found_s: zero, wheel: WheelDelay::nothing() }
    }

    /// The input with readings that are older by what was found, if something was; the earliest speed is taken to be of its time.
    pub(super) fn taken_off(&self, input: &ShiftInput<T>) -> Option<ShiftInput<T>> {
        if self.late_s() == [T::zero(); SPEEDS] {
            return None;
        }
        let mut input = *input;
        let speeds = [&mut input.turbine_rad_s, &mut input.output_rad_s, &mut input.wheel_rad_s];
        for (reading, late_s) in speeds.into_iter().zip(self.late_s()) {
            if let Some(reading) = reading {
                reading.age_s = reading.age_s + late_s;
            }
        }
        Some(input)
    }

    /// By how much turbine, output and wheel speed are taken to be older, s.
    pub(super) fn late_s(&self) -> [T; SPEEDS] {
        let zero = T::zero();
        [self.found_s.at_least(zero), (-self.found_s).at_least(zero), self.wheel.found_s]
    }

    fn take(&mut self, rate: T, slip: T, std_dev: T, max_s: T) {
        self.squares = self.squares + rate * rate;
        self.products = self.products + rate * slip;
        let skew_s = -self.products / self.squares;
        let enough = std_dev / T::of(KNOWN_S);
        let kept = enough * enough / self.squares;
        if kept < T::one() {
            (self.squares, self.products) = (kept * self.squares, kept * self.products);
        }
        let is_shown = skew_s.abs() > (T::of(SHOWN) * std_dev / self.squares.sqrt()).at_least(T::of(MIN_S));
        self.found_s = if is_shown { skew_s.at_least(-max_s).at_most(max_s) } else { T::zero() };
    }
}

/// By how much the wheel speed is late against that of the output. The rate of twist is noise here: it changes its sign with each change of torque.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct WheelDelay<T> {
    /// Integrals over `w_w` squared, `w_w w_w'` and `w_w'` squared.
    squares: [T; 3],
    /// Over the difference times `w_w`, and times `w_w'`.
    products: [T; 2],
    /// What is taken off, s.
    found_s: T,
}

impl<T: Real> WheelDelay<T> {
    fn nothing() -> Self {
        let zero = T::zero();
        Self { squares: [zero; 3], products: [zero; 2], found_s: zero }
    }

    /// Takes the speed, its rate and the difference over a step, with the density of the noise of the difference, rad^2/s, and the standard deviation of the
    /// scale.
    fn take(&mut self, [speed, rate, difference]: [T; 3], dt_s: T, density: T, scale: T) {
        for (sum, product) in self.squares.iter_mut().zip([speed * speed, speed * rate, rate * rate]) {
            *sum = *sum + product * dt_s;
        }
        for (sum, product) in self.products.iter_mut().zip([speed, rate]) {
            *sum = *sum + product * difference * dt_s;
        }
        let [speeds, mixed, rates] = self.squares;
        let speeds = speeds + density / (scale * scale);
        let determinant = speeds * rates - mixed * mixed;
        if determinant <= T::zero() {
            return;
        }
        let delay_s = (speeds * self.products[1] - mixed * self.products[0]) / determinant;
        let variance = density * speeds / determinant;
        let kept = variance / square(T::of(WHEEL_KNOWN_S));
        if kept < T::one() {
            self.squares = self.squares.map(|sum| kept * sum);
            self.products = self.products.map(|sum| kept * sum);
        }
        // In a short log a change just before the shift costs more than the delay.
        let shown_s = T::of(SHOWN) * variance.sqrt();
        let is_shown = shown_s <= T::of(WHEEL_SURE_S) && delay_s > shown_s.at_least(T::of(WHEEL_MIN_S));
        self.found_s = if is_shown { delay_s.at_most(T::of(WHEEL_MAX_S)) } else { T::zero() };
    }
}

impl<T: Real> GearboxFilter<'_, T> {
    /// Takes what a step of this time, s, has shown of the skew in a gear. The filter may not run yet: late readings look like a slip.
    pub(super) fn take_skew(&self, state: &mut GearboxState<T>, input: &ShiftInput<T>, dt_s: T) {
        let gear = self.tables.gear(input.gear.to).filter(|_| input.gear.is_steady());
        let (skew, newest) = (&mut state.skew, &state.newest);
        skew.smooth = gear.and_then(|gear| self.smoothed(skew, newest, (gear.ratio, dt_s)));
    }

    fn smoothed(
        &self,
        skew: &mut Skew<T>,
        newest: &[Option<Newest<T>>; SPEEDS],
        (ratio, dt_s): (T, T),
    ) -> Option<Smooth<T>> {
        let max_s = self.uncertainty.channel_skew_s;
        let fresh = |k: usize| newest[k].filter(|newest| newest.age_s <= T::of(FIRST_S) && !newest.refused);
        let (turbine, output_reading) = (fresh(TURBINE)?, fresh(OUTPUT)?);
        let now = output_reading.value;
        if now.abs() <= self.uncertainty.output_least_rad_s {
            return None;
        }
        let older_s = turbine.age_s.at_least(output_reading.age_s);
        let slip = self.slip(ratio, [turbine.reached(older_s)?, output_reading.reached(older_s)?]);
        let before = skew.smooth.unwrap_or(Smooth { output: now, slip: T::zero(), twist: None });
        let fraction = dt_s / (dt_s + T::of(SMOOTH_S));
        let output = before.output + fraction * (now - before.output);
        let rate = ratio * (now - output) / T::of(SMOOTH_S);
        // As it would be with nothing taken off.
        let value = slip.value - skew.found_s * rate;
        // A clutch that slips, or another gear. A comparison with NaN is false.
        let is_gear = value.abs() <= slip.threshold() + T::of(2.0) * max_s * rate.abs();
        let final_ratio = self.driveline.final_ratio;
        let wheel_rate = (now - output) / T::of(SMOOTH_S) / final_ratio;
        let twist = fresh(WHEEL).and_then(|wheel| {
            let older_s = wheel.age_s.at_least(output_reading.age_s);
            let [output, wheel] = [output_reading.reached(older_s)? / final_ratio, wheel.reached(older_s)?];
            let value = output - wheel + skew.wheel.found_s * wheel_rate;
            let before = before.twist.unwrap_or(value);
            Some(before + fraction * (value - before))
        });
        let smooth = Smooth { output, slip: before.slip + fraction * (value - before.slip), twist };
        let noise = ratio.abs() * self.readings[OUTPUT].std_dev_rad_s / T::of(SMOOTH_S);
        is_gear.then(|| {
            if rate.abs() > T::of(RATE_SHOWN) * noise {
                skew.take(rate, smooth.slip, slip.std_dev, max_s);
            }
            if let Some(twist) = smooth.twist.filter(|_| before.twist.is_some()) {
                let sensors = square(self.readings[OUTPUT].std_dev_rad_s / final_ratio)
                    + square(self.readings[WHEEL].std_dev_rad_s);
                let density = sensors * dt_s + T::of(TWIST_RAD2_S);
                skew.wheel.take([output / final_ratio, wheel_rate, twist], dt_s, density, self.uncertainty.wheel_scale);
            }
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

    /// The delay of the wheel speed after so many seconds of pulling away and coasting by turns, in which it is late by this time, s, and reads 1 % too little.
    fn found_of_wheel_s(late_s: f64, seconds: u32) -> f64 {
        let mut wheel = WheelDelay::nothing();
        for row in 0..100 * seconds {
            let time_s = 0.01 * f64::from(row);
            let (speed, rate) = (30.0 + 8.0 * (0.5 * time_s).sin(), 4.0 * (0.5 * time_s).cos());
            wheel.take([speed, rate, 0.01 * speed + late_s * rate], 0.01, TWIST_RAD2_S, 0.01);
        }
        wheel.found_s
    }

    #[test]
    fn a_late_wheel_speed_is_found_in_a_drive_beside_the_error_of_its_scale() {
        for late_s in [0.01, 0.03, 0.049] {
            assert!((found_of_wheel_s(late_s, 120) - late_s).abs() < 1e-3, "{}", found_of_wheel_s(late_s, 120));
        }
        assert_eq!([0.004, -0.02].map(|late_s| found_of_wheel_s(late_s, 120)), [0.0; 2]);
        assert_eq!(found_of_wheel_s(0.2, 120), WHEEL_MAX_S);
        // A few seconds say too little.
        assert_eq!(found_of_wheel_s(0.03, 4), 0.0);
    }
}
