//! By how much the readings of turbine, output and wheel speed are late against each other, found while a gear holds.
//!
//! Delay and lags of turbine and output speed are those of the slip in gears ([`super::slip_fit`]). But for the twist of the shafts `w_o = i_df w_w`. Readings that
//! are late by `d_o` and `d_w`, with a wheel speed that reads `1 + s` times the true one, differ by
//!
//! ```text
//! w_o/i_df - w_w = (d_w - d_o) w_w' - s w_w
//! ```
//!
//! Least squares over the time in gears give `d_w - d_o`. A delay that all have in common does not show, and a wheel speed that is earlier than
//! both others is taken to be of their time. A clutch that creeps with the torque looks like a skew.

use drivetrain::Real;

use super::{
    FIRST_S, GearboxFilter, GearboxState, LONGEST_DELAY_S, Newest, OUTPUT, SPEEDS, ShiftInput, SlipFit, TURBINE, WHEEL,
    square,
};

/// Smallest delays that are taken off, s \[chosen\]: of turbine against output, more than the lags of toothed wheels leave, and of the wheels.
const MIN_S: f64 = 3e-3;
const WHEEL_MIN_S: f64 = 6e-3;
/// Standard deviations of a delay by the noise of the readings below which it is none.
const SHOWN: f64 = 3.0;
/// Standard deviation from which on the delay of the wheel speed is taken off, s \[chosen\]: in the log of one shift a change just before the shift costs more
/// than the delay.
const WHEEL_STD_DEV_MAX_S: f64 = 0.02 / SHOWN;
/// Standard deviation below which a delay of turbine or output speed may be longer than the error budget has it, s \[chosen\].
const LONG_STD_DEV_S: f64 = 2e-3;
/// Change of a long delay from which on it is taken anew, s \[chosen\].
const CHANGED_S: f64 = 2e-3;
/// A delay is long from so much above the largest skew of the error budget on, and until it is so much below, as a fraction \[chosen\].
const APART: f64 = 0.25;
/// Standard deviation below which what came long ago counts less, s \[chosen\].
const WHEEL_KNOWN_S: f64 = 1e-3;
/// Longest time by which lags make a reading older, s \[chosen\]: an older one counts as missing ([`FIRST_S`]).
const LONGEST_LAG_S: f64 = 0.03;
/// Longest delay by which speeds may look like a slip and are those of the gear, s \[chosen\]: the longest that is taken off and a fifth of it.
pub(super) const WIDEST_S: f64 = 1.2 * LONGEST_DELAY_S;
/// Slip at the turbine below which speeds are near those of a gear, as a fraction of its speed \[chosen\].
const NEAR: f64 = 0.03;
/// Density of the rate of twist of the shafts, rad^2/s \[chosen\]: 0.1 rad/s for 0.3 s each way. It is noise here, as it changes its sign with each change of
/// torque.
const TWIST_RAD2_S: f64 = 6e-3;
/// Time constant with which differences and rate of the output speed are low-passed before they are compared, s \[chosen\].
const SMOOTH_S: f64 = 0.1;

/// What the readings in gears have shown.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Skew<T> {
    smooth: Option<Smooth<T>>,
    wheel: Delay<T>,
    /// By how much turbine, output and wheel speed are late against the earlier one of the first two, s: delays that are taken as ages of the readings.
    late_s: [T; SPEEDS],
    /// The angles by which turbine and output lag beside them, rad, once they have shown themselves.
    lags_rad: Option<[T; 2]>,
    /// What of both has been taken off the newest readings, s.
    taken_s: [T; SPEEDS],
    /// Longer ones, s, which are taken as delays of the sensors ([`super::late`]).
    delays_s: [T; SPEEDS],
}

/// Speed of the output, and slip of the output over the final ratio against the wheels, low-passed, rad/s.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Smooth<T> {
    output: T,
    twist: Option<T>,
}

/// Least squares for `difference = a x + d rate`, in time.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Delay<T> {
    /// Integrals over `x x`, `x rate` and `rate rate`.
    squares: [T; 3],
    /// Over the difference times `x`, and times `rate`.
    products: [T; 2],
    /// The delay `d`, s, and its standard deviation; none before a rate has come.
    found: Option<[T; 2]>,
}

impl<T: Real> Delay<T> {
    fn nothing() -> Self {
        Self { squares: [T::zero(); 3], products: [T::zero(); 2], found: None }
    }

    /// Takes `x`, the rate and the difference over a step, with the density of the noise of the difference, rad^2/s, and the standard deviation of `a`. What came
    /// long ago counts less once the delay is known to `known_s`.
    fn take(&mut self, [x, rate, difference]: [T; 3], dt_s: T, (density, a): (T, T), known_s: T) {
        for (sum, product) in self.squares.iter_mut().zip([x * x, x * rate, rate * rate]) {
            *sum = *sum + product * dt_s;
        }
        for (sum, product) in self.products.iter_mut().zip([x, rate]) {
            *sum = *sum + product * difference * dt_s;
        }
        let [x, mixed, rates] = self.squares;
        let x = x + density / square(a);
        let determinant = x * rates - mixed * mixed;
        if determinant > T::zero() {
            let delay_s = (x * self.products[1] - mixed * self.products[0]) / determinant;
            let variance = density * x / determinant;
            self.found = Some([delay_s, variance.sqrt()]);
            let kept = variance / square(known_s);
            if kept < T::one() {
                self.squares = self.squares.map(|sum| kept * sum);
                self.products = self.products.map(|sum| kept * sum);
            }
        }
    }
}

/// The delay if it is known to this standard deviation, s; zero as long as it may be none or is smaller than the minimum.
fn shown<T: Real>([delay_s, std_dev_s]: [T; 2], min_s: f64, std_dev_max_s: f64) -> Option<T> {
    let is_shown = delay_s.abs() > (T::of(SHOWN) * std_dev_s).at_least(T::of(min_s));
    (std_dev_s <= T::of(std_dev_max_s)).then_some(if is_shown { delay_s } else { T::zero() })
}

impl<T: Real> Skew<T> {
    pub(super) fn nothing() -> Self {
        Self {
            smooth: None,
            wheel: Delay::nothing(),
            late_s: [T::zero(); SPEEDS],
            lags_rad: None,
            taken_s: [T::zero(); SPEEDS],
            delays_s: [T::zero(); SPEEDS],
        }
    }

    /// Forgets the readings before a gap in them, and not what they have shown.
    pub(super) fn pause(&mut self) {
        self.smooth = None;
    }

    /// The input with readings that are older by what was found, if something was. Those of toothed wheels are the older the slower these turn, down to a
    /// least speed.
    pub(super) fn taken_off(
        &mut self,
        input: &ShiftInput<T>,
        newest: &[Option<Newest<T>>; SPEEDS],
        least_rad_s: T,
    ) -> Option<ShiftInput<T>> {
        self.taken_s = self.late_s;
        if let Some(lags_rad) = self.lags_rad {
            let given = [input.turbine_rad_s, input.output_rad_s];
            let [turbine_s, output_s]: [T; 2] = core::array::from_fn(|k| {
                let value = given[k].map(|reading| reading.value).or(newest[k].map(|newest| newest.value));
                self.late_s[k] + lags_rad[k] / value.map_or(least_rad_s, T::abs).at_least(least_rad_s)
            });
            let earlier_s = turbine_s.min(output_s);
            let longest_s = self.late_s[TURBINE].at_least(self.late_s[OUTPUT]).at_least(T::of(LONGEST_LAG_S));
            [self.taken_s[TURBINE], self.taken_s[OUTPUT]] =
                [turbine_s, output_s].map(|late_s| (late_s - earlier_s).at_most(longest_s));
            // The delay of the wheels is one against the output as it is read.
            let moved_s = self.taken_s[OUTPUT] - self.late_s[OUTPUT];
            self.taken_s[WHEEL] = (self.late_s[WHEEL] + moved_s).at_least(T::zero()).at_most(T::of(LONGEST_DELAY_S));
        }
        if self.taken_s == [T::zero(); SPEEDS] {
            return None;
        }
        let mut input = *input;
        let speeds = [&mut input.turbine_rad_s, &mut input.output_rad_s, &mut input.wheel_rad_s];
        for (reading, late_s) in speeds.into_iter().zip(self.taken_s) {
            if let Some(reading) = reading {
                reading.age_s = reading.age_s + late_s;
            }
        }
        Some(input)
    }

    /// By how much turbine, output and wheel speed are taken to be late against the earlier one of the first two, s.
    pub(super) fn late_s(&self) -> [T; SPEEDS] {
        core::array::from_fn(|k| self.late_s[k] + self.delays_s[k])
    }

    /// Delays of turbine, output and wheel speed that are longer than those of the error budget, s, if there are some.
    pub(super) fn delays_s(&self) -> Option<[T; SPEEDS]> {
        (self.delays_s != [T::zero(); SPEEDS]).then_some(self.delays_s)
    }

    /// What is taken off the newest readings of turbine, output and wheel speed as an age, s.
    pub(super) fn ages_s(&self) -> [T; SPEEDS] {
        self.taken_s
    }

    /// All that is taken off the newest readings of turbine, output and wheel speed, s.
    pub(super) fn all_taken_s(&self) -> [T; SPEEDS] {
        core::array::from_fn(|k| self.taken_s[k] + self.delays_s[k])
    }

    /// Takes what the slip in the gear of this ratio and the wheels have shown off from now on. By the error budget turbine and output have at most this skew,
    /// s; it may be longer where it is known well.
    fn take_off(&mut self, slip: &SlipFit<T>, ratio: T, max_s: T) {
        let zero = T::zero();
        self.lags_rad = slip.shows_lag(ratio, self.lags_rad.is_some()).then(|| slip.lags_rad());
        let found = slip.delay_s();
        let is_long = found.is_some_and(|[delay_s, std_dev_s]| {
            std_dev_s <= T::of(LONG_STD_DEV_S) && delay_s.abs() > max_s && max_s > zero
        });
        let is_kept = self.delays_s != [zero; SPEEDS];
        let longest_s = if is_long || is_kept { T::of(LONGEST_DELAY_S).at_least(max_s) } else { max_s };
        // Beside lags that are taken off, a delay is what they leave.
        let min_s = if self.lags_rad.is_some() { 0.0 } else { MIN_S };
        let turbine = -found.and_then(|found| shown(found, min_s, f64::INFINITY)).unwrap_or(zero);
        let turbine = turbine.at_least(-longest_s).at_most(longest_s);
        let late_s = [turbine.at_least(zero), (-turbine).at_least(zero)];
        for ((late_s, as_age_s), delay_s) in late_s.into_iter().zip(&mut self.late_s).zip(&mut self.delays_s) {
            // Around the longest age it does not change from one to the other and back.
            let longest_age_s = T::of(if *delay_s > zero { 1.0 - APART } else { 1.0 + APART }) * max_s;
            let is_long = late_s > longest_age_s;
            *as_age_s = if is_long { zero } else { late_s.at_most(max_s) };
            if !is_long || (late_s - *delay_s).abs() >= T::of(CHANGED_S) {
                *delay_s = if is_long { late_s } else { zero };
            }
        }
        let wheel = self.wheel.found.and_then(|found| shown(found, WHEEL_MIN_S, WHEEL_STD_DEV_MAX_S));
        let wheel = wheel.map_or(zero, |wheel| wheel + late_s[1]);
        self.late_s[WHEEL] = wheel.at_least(zero).at_most(T::of(LONGEST_DELAY_S));
    }
}

impl<T: Real> GearboxFilter<'_, T> {
    /// The longest delays of turbine, output and wheel speed that are found, s.
    pub fn longest_found_s(&self) -> [T; SPEEDS] {
        let of_gearbox = T::of(LONGEST_DELAY_S).at_least(self.uncertainty.channel_skew_s);
        [of_gearbox, of_gearbox, T::of(LONGEST_DELAY_S)]
    }

    /// Takes what a step of this time, s, has shown of the skew in a gear. The filter may not run yet: late readings look like a slip.
    pub(super) fn take_skew(&self, state: &mut GearboxState<T>, input: &ShiftInput<T>, dt_s: T) {
        let gear = self.tables.gear(input.gear.to).filter(|_| input.gear.is_steady() && dt_s <= T::of(FIRST_S));
        let (skew, slip, newest) = (&mut state.skew, &state.ratios.slip, &state.newest);
        skew.smooth = gear.and_then(|gear| self.smoothed((skew, slip), newest, (gear.ratio, dt_s)));
    }

    fn smoothed(
        &self,
        (skew, of_slip): (&mut Skew<T>, &SlipFit<T>),
        newest: &[Option<Newest<T>>; SPEEDS],
        (ratio, dt_s): (T, T),
    ) -> Option<Smooth<T>> {
        let (max_s, final_ratio) = (self.uncertainty.channel_skew_s, self.driveline.final_ratio);
        let (late_s, all_s) = (skew.taken_s, skew.all_taken_s());
        // A reading, and its age with nothing taken off.
        let fresh = |k: usize| {
            let newest = newest[k].filter(|newest| !newest.refused)?;
            let age_s = newest.age_s - late_s[k];
            (age_s <= T::of(FIRST_S)).then_some((newest, age_s))
        };
        let at = |k: usize, newest: &Newest<T>, age_s: T| newest.reached(age_s + late_s[k]);
        let ((turbine, _), (output_speed, output_s)) = (fresh(TURBINE)?, fresh(OUTPUT)?);
        let now = output_speed.value;
        if now.abs() <= self.uncertainty.output_least_rad_s {
            return None;
        }
        let older_s = turbine.age_s.at_least(output_speed.age_s);
        let slip = self.slip(ratio, [turbine.reached(older_s)?, output_speed.reached(older_s)?]);
        let before = skew.smooth.unwrap_or(Smooth { output: now, twist: None });
        let fraction = dt_s / (dt_s + T::of(SMOOTH_S));
        let output = before.output + fraction * (now - before.output);
        let output_rate = (now - output) / T::of(SMOOTH_S);
        let rate = ratio * output_rate;
        // As it would be with nothing taken off.
        let value = slip.value - (all_s[TURBINE] - all_s[OUTPUT]) * rate;
        // A clutch that slips, or another gear. A comparison with NaN is false.
        let widest_s = (T::of(2.0) * max_s).at_least(T::of(WIDEST_S));
        let is_gear = value.abs() <= slip.threshold() + widest_s * rate.abs();
        let twist = fresh(WHEEL).and_then(|(wheel, wheel_s)| {
            let older_s = wheel_s.at_least(output_s);
            let twist = at(OUTPUT, &output_speed, older_s)? / final_ratio - at(WHEEL, &wheel, older_s)?;
            let value = twist - skew.delays_s[OUTPUT] * output_rate / final_ratio;
            let before = before.twist.unwrap_or(value);
            Some(before + fraction * (value - before))
        });
        let smooth = Smooth { output, twist };
        if !is_gear {
            // Speeds near those of the gear may be as late as this once their rate is known.
            let is_near = value.abs() <= slip.threshold() + T::of(NEAR) * (ratio * now).abs();
            return is_near.then_some(smooth);
        }
        if let Some(twist) = smooth.twist.filter(|_| before.twist.is_some()) {
            let sensors =
                square(self.readings[OUTPUT].std_dev_rad_s / final_ratio) + square(self.readings[WHEEL].std_dev_rad_s);
            let noise = (sensors * dt_s + T::of(TWIST_RAD2_S), self.uncertainty.wheel_scale);
            let row = [output / final_ratio, output_rate / final_ratio, twist];
            skew.wheel.take(row, dt_s, noise, T::of(WHEEL_KNOWN_S));
        }
        skew.take_off(of_slip, ratio, max_s);
        Some(smooth)
    }
}

#[cfg(test)]
mod tests {
    use super::super::slip_fit::InGear;
    use super::*;

    /// The skew after pulling away and coasting by turns for so many seconds, with these delays of turbine and wheel speed against the output,
    /// s, and a wheel speed that reads 1 % too little.
    fn found_s([turbine_s, wheel_s]: [f64; 2], seconds: u32) -> [f64; SPEEDS] {
        let (mut skew, mut fit) = (Skew::nothing(), SlipFit::nothing([0.0; 2]));
        for row in 0..100 * seconds {
            let time_s = 0.01 * f64::from(row);
            let (speed, rate) = (30.0 + 8.0 * (0.5 * time_s).sin(), 4.0 * (0.5 * time_s).cos());
            let slip = -turbine_s * 10.0 * rate;
            let at = InGear { slip, variance: 0.1 * 0.1, ratio: 10.0, output_rad_s: speed, rate_rad_s2: rate };
            fit.take(0, &at, (0.01, 1.0));
            fit.set_explains(true);
            let twist = 0.01 * speed + wheel_s * rate;
            skew.wheel.take([speed, rate, twist], 0.01, (TWIST_RAD2_S, 0.01), WHEEL_KNOWN_S);
            skew.take_off(&fit, 10.0, 0.02);
        }
        skew.late_s()
    }

    fn assert_found(delays_s: [f64; 2], expected_s: [f64; SPEEDS]) {
        let found_s = found_s(delays_s, 120);
        let is_near = found_s.iter().zip(expected_s).all(|(found, expected)| (found - expected).abs() < 1e-3);
        assert!(is_near, "{delays_s:?}: {found_s:?}");
    }

    #[test]
    fn late_speeds_are_found_within_their_limits() {
        for (delays_s, expected_s) in [
            ([0.004, 0.0], [0.004, 0.0, 0.0]),
            ([-0.009, 0.0], [0.0, 0.009, 0.009]),
            ([0.002, 0.004], [0.0, 0.0, 0.0]),
            ([0.03, 0.03], [0.03, 0.0, 0.03]),
            ([-0.08, 0.0], [0.0, 0.05, 0.05]),
            ([-0.01, 0.03], [0.0, 0.01, 0.04]),
            ([0.0, 0.2], [0.0, 0.0, 0.05]),
            ([0.0, -0.02], [0.0, 0.0, 0.0]),
        ] {
            assert_found(delays_s, expected_s);
        }
    }

    #[test]
    fn a_few_seconds_say_too_little_of_the_wheels() {
        assert_eq!(found_s([0.0, 0.03], 4)[WHEEL], 0.0);
    }

    #[test]
    fn without_an_acceleration_nothing_is_found() {
        let (mut skew, mut fit) = (Skew::nothing(), SlipFit::nothing([0.0; 2]));
        for rate in [0.0, 1e-3, -1e-3] {
            let at = InGear { slip: 0.3, variance: 0.1, ratio: 1.0, output_rad_s: 30.0, rate_rad_s2: rate };
            fit.take(0, &at, (0.01, 1.0));
            fit.set_explains(true);
            skew.wheel.take([30.0, rate, 0.3], 0.01, (TWIST_RAD2_S, 0.01), WHEEL_KNOWN_S);
            skew.take_off(&fit, 1.0, 0.01);
            assert_eq!(skew.late_s(), [0.0; SPEEDS]);
        }
    }
}
