//! By how much turbine over output speed differs from the ratio of each gear, found while that gear holds.
//!
//! A vehicle file has ratios of a few digits, and a sensor may be described with a wrong scale. In a gear whose ratio is `(1 + e) i`, with a turbine
//! speed that is late by `d` against the output,
//!
//! ```text
//! w_t - i w_o = e i w_o - d i w_o'
//! ```
//!
//! Least squares over the time in the gears give `e` of each, with one `d` of all as another unknown. Turbine readings are divided by `1 + e`, in a
//! shift by what lies between those of both gears, as far as the ratio has come. A gear that was not driven yet is taken to have the mean of the
//! others, as by a sensor's scale. A slip is distinguished by
//! its changes: one that is steady at a steady speed looks alike until one of both changes.

use car::ShiftCommand;
use drivetrain::Real;

use super::{GearboxFilter, GearboxState, OUTPUT, ShiftInput, TURBINE, square};

/// Gears whose ratios are followed \[chosen\]; those beyond are taken to have the mean of these.
const GEARS: usize = 12;
/// Largest error of a ratio that is taken off, as a fraction \[chosen\]: two digits of a ratio of 0.5 have half of it.
const LARGEST: f64 = 0.02;
/// Standard deviation of the error before the gear is driven, as a fraction \[chosen\].
const UNKNOWN: f64 = 0.005;
/// Standard deviations of it above which it is shown, and standard deviation below which it is known \[chosen\].
const SHOWN: f64 = 4.0;
const KNOWN: f64 = 2e-4;
/// Smallest error that is taken off \[chosen\]: at 300 rad/s 0.15 rad/s, half of what counts as a slip of noiseless speeds. One that is taken off is until it is
/// half of that.
const SMALLEST: f64 = 5e-4;
/// Change of an error that is known from which on it is taken anew \[chosen\].
const CHANGED: f64 = 2.5e-4;
/// The same from which on a skew that was found before is one of other speeds \[chosen\].
const OTHER: f64 = 1e-3;
/// Time for which the speeds have to be off a ratio with its error until that is forgotten, s \[chosen\].
const OFF_S: f64 = 1.0;
/// Time for which the speeds are those of a gear before they are compared, how long they are, and how long they count, s \[chosen\].
const SETTLED_S: f64 = 0.4;
const COMPARED_S: f64 = 0.5;
const MEMORY_S: f64 = 60.0;
/// Root mean square of what the error does not explain, in thresholds of a slip, above which an element slips \[chosen\].
const UNEXPLAINED: f64 = 0.5;
/// Time constant with which slip and output speed are low-passed twice before they are compared, s \[chosen\]: the noise of the output speed is in slip and
/// rate, and would look like a skew.
const SMOOTH_S: f64 = 0.1;
/// Time between two readings, and the longest one, s \[chosen\]: 20 readings a second are compared.
const READ_S: f64 = 0.01;
const LONGEST_S: f64 = 0.06;
/// Of a sensor without noise, rad^2/s^2 \[chosen\].
const SMALLEST_VARIANCE: f64 = 1e-6;

/// What the readings in gears have shown.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct RatioErrors<T> {
    /// The speeds, as long as they are those of a gear.
    smooth: Option<Smooth<T>>,
    gears: [Compared<T>; GEARS],
    /// The gear that was driven last, and what the others show of the skew.
    last: usize,
    skew_of_others: [T; 2],
    /// The skew `d` by all gears, s, and its standard deviation.
    skew_s: [T; 2],
    /// Since when the speeds are off the ratio with its error, s.
    off_s: T,
    /// The error of each gear, as a fraction, once it is known.
    found: [Option<T>; GEARS],
    /// That of the other gears.
    others: T,
    /// Whether one of them is not zero.
    differs: bool,
    /// Places of the gears between which the speeds are, and how far they have come from the first to the second, from 0 to 1.
    between: [Option<u8>; 2],
    way: T,
}

/// Output speed and slip of the gear, low-passed once and twice, rad/s, and for how long they are those of the gear, s.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Smooth<T> {
    output: [T; 2],
    slip: [T; 2],
    since_s: T,
}

/// Least squares for `slip = e x + d rate` in a gear.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Compared<T> {
    time_s: T,
    /// Sums of the weights, and of them times `x x`, `x rate`, `rate rate`, and the slip times `x`, `rate` and itself.
    weight: T,
    sums: [T; 6],
    /// Whether both explain the slip.
    explains: bool,
}

impl<T: Real> Compared<T> {
    fn nothing() -> Self {
        Self { time_s: T::zero(), weight: T::zero(), sums: [T::zero(); 6], explains: false }
    }

    /// Takes `x`, the rate and the slip over a step, with the variances of slip and rate.
    fn take(&mut self, [x, rate, slip]: [T; 3], dt_s: T, [variance, of_rate]: [T; 2]) {
        // A reading that is repeated in faster rows counts once.
        let weight = (dt_s / T::of(READ_S)).at_most(T::one()) / variance.at_least(T::of(SMALLEST_VARIANCE));
        let products = [x * x, x * rate, rate * rate - of_rate, x * slip, rate * slip, slip * slip];
        for (sum, product) in self.sums.iter_mut().zip(products) {
            *sum = *sum + weight * product;
        }
        self.weight = self.weight + weight;
        self.time_s = self.time_s + dt_s;
        let kept = T::of(MEMORY_S) / self.time_s;
        if kept < T::one() {
            self.sums = self.sums.map(|sum| kept * sum);
            self.weight = kept * self.weight;
            self.time_s = T::of(MEMORY_S);
        }
    }

    /// Information on the error.
    fn of_error(&self) -> T {
        self.sums[0] + T::of(1.0 / (UNKNOWN * UNKNOWN))
    }

    /// Information on the skew `d`, and that times its value.
    fn of_skew(&self) -> [T; 2] {
        let [_, mixed, rates, by_x, by_rate, _] = self.sums;
        let per = mixed / self.of_error();
        let information = rates - per * mixed;
        // Of slow changes the noise alone may be left.
        if information > T::zero() { [information, by_rate - per * by_x] } else { [T::zero(); 2] }
    }

    /// The skew `d` with what other gears show of it, s, and its standard deviation.
    fn skew_s(&self, others: [T; 2]) -> [T; 2] {
        let here = self.of_skew();
        let information = others[0] + here[0];
        [(others[1] + here[1]) / information, information.sqrt().recip()]
    }

    /// The error `e` once it is known, with this skew and its standard deviation, s; `largest_rad_s` bounds the root mean square of what both do not explain.
    fn error(&mut self, [skew_s, skew_std_dev_s]: [T; 2], largest_rad_s: T) -> Option<T> {
        let [_, mixed, _, by_x, by_rate, slips] = self.sums;
        let of_error = self.of_error();
        let error = (by_x - mixed * skew_s) / of_error;
        let std_dev = (of_error.recip() + square(mixed / of_error * skew_std_dev_s)).sqrt();
        let unexplained = (slips - error * by_x - skew_s * by_rate) / self.weight;
        // A comparison with NaN is false.
        self.explains = unexplained <= square(largest_rad_s);
        let is_known = self.explains
            && self.time_s >= T::of(COMPARED_S)
            && std_dev <= T::of(KNOWN).at_least(error.abs() / T::of(SHOWN))
            && error.abs() <= T::of(LARGEST);
        is_known.then_some(error)
    }
}

impl<T: Real> RatioErrors<T> {
    pub(super) fn nothing() -> Self {
        Self {
            smooth: None,
            gears: [Compared::nothing(); GEARS],
            last: GEARS,
            skew_of_others: [T::zero(); 2],
            skew_s: [T::zero(), T::infinity()],
            off_s: T::zero(),
            found: [None; GEARS],
            others: T::zero(),
            differs: false,
            between: [None; 2],
            way: T::zero(),
        }
    }

    /// Forgets the readings before a gap in them, and not what they have shown.
    pub(super) fn pause(&mut self) {
        self.smooth = None;
    }

    /// What the gears but this one show of the skew, which is at most so large, s.
    fn skew_of_others(&mut self, place: usize, max_s: T) -> [T; 2] {
        if place != self.last {
            self.last = place;
            // Of one that may be any up to the largest.
            let mut sum = [T::of(3.0) / square(max_s.at_least(T::of(1e-3))), T::zero()];
            for (_, gear) in self.gears.iter().enumerate().filter(|(other, gear)| *other != place && gear.explains) {
                sum = core::array::from_fn(|k| sum[k] + gear.of_skew()[k]);
            }
            self.skew_of_others = sum;
        }
        self.skew_of_others
    }

    fn of(&self, place: Option<u8>) -> T {
        place.and_then(|place| *self.found.get(usize::from(place))?).unwrap_or(self.others)
    }

    /// The error now.
    fn now(&self) -> T {
        let [from, to] = self.between.map(|place| self.of(place));
        from + self.way * (to - from)
    }

    /// The skew of turbine and output speed, s, once it is known.
    pub(super) fn skew_s(&self) -> Option<T> {
        let [skew_s, std_dev_s] = self.skew_s;
        (skew_s.abs() > T::of(3.0) * std_dev_s).then_some(skew_s)
    }

    /// Keeps what is known of a gear. By how much that changes what is taken off in it.
    fn keep(&mut self, place: usize, error: T) -> T {
        let Some(found) = self.found.get(place).copied() else { return T::zero() };
        let before = found.unwrap_or(self.others);
        let smallest = T::of(if before == T::zero() { SMALLEST } else { 0.5 * SMALLEST });
        let error = if error.abs() >= smallest { error } else { T::zero() };
        if found.is_some() && (error - before).abs() < T::of(CHANGED) {
            return T::zero();
        }
        self.set(place, Some(error));
        error - before
    }

    fn set(&mut self, place: usize, error: Option<T>) {
        if let Some(found) = self.found.get_mut(place) {
            *found = error;
        }
        let (mut sum, mut count) = (T::zero(), T::zero());
        for error in self.found.iter().flatten() {
            (sum, count) = (sum + *error, count + T::one());
        }
        self.others = if count > T::zero() { sum / count } else { T::zero() };
        self.differs = self.found.iter().flatten().any(|error| *error != T::zero());
    }

    /// Forgets an error that the speeds have been off for long: it was a slip.
    fn follow_off(&mut self, place: usize, rest: T, threshold: T, dt_s: T) {
        self.off_s = if rest.abs() > threshold { self.off_s + dt_s } else { T::zero() };
        if self.off_s >= T::of(OFF_S) {
            self.off_s = T::zero();
            self.gears[place.min(GEARS - 1)] = Compared::nothing();
            self.set(place, None);
        }
    }
}

impl<T: Real> GearboxState<T> {
    /// By how much turbine over output speed has shown to be above the ratio of the gear at this place, as a fraction; `None` where it is not known.
    pub fn ratio_error(&self, place: usize) -> Option<T> {
        self.ratios.found.get(place).copied().flatten()
    }
}

impl<T: Real> GearboxFilter<'_, T> {
    /// The input with a turbine speed as the ratios of the tables would have it, if those are known to be others.
    pub(super) fn at_ratios(&self, state: &mut GearboxState<T>, input: &ShiftInput<T>) -> Option<ShiftInput<T>> {
        if !state.ratios.differs {
            return None;
        }
        self.follow_ratio(state, input);
        let mut input = *input;
        if let Some(turbine) = &mut input.turbine_rad_s {
            turbine.value = turbine.value / (T::one() + state.ratios.now());
        }
        Some(input)
    }

    /// A turbine speed as it was read, for what is in front of the gearbox: but for the mean error of all gears, which is taken to be one of a sensor.
    pub(super) fn as_read(&self, state: &GearboxState<T>, turbine_rad_s: T) -> T {
        let ratios = &state.ratios;
        if ratios.differs {
            turbine_rad_s * (T::one() + ratios.now()) / (T::one() + ratios.others)
        } else {
            turbine_rad_s
        }
    }

    /// Follows between which gears the speeds are, and how far they have come.
    fn follow_ratio(&self, state: &mut GearboxState<T>, input: &ShiftInput<T>) {
        let output = input.output_rad_s.map(|reading| reading.value);
        let newest = state.newest[OUTPUT].filter(|newest| newest.age_s <= T::of(LONGEST_S)).map(|newest| newest.value);
        let ratios = &mut state.ratios;
        let ShiftCommand { from, to } = input.gear;
        let [from, to] = [from, to].map(|gear| gear.place().and_then(|place| u8::try_from(place).ok()));
        // Out of neutral and into it there is one ratio.
        let between = [from.or(to), to.or(from)];
        if (!input.gear.is_steady() || !ratios.between.contains(&to)) && ratios.between != between {
            (ratios.between, ratios.way) = (between, T::zero());
        }
        let ratio = |place: Option<u8>| self.tables.gears.get(usize::from(place?)).map(|gear| gear.ratio);
        let ([Some(from), Some(to)], Some(turbine), Some(output)) =
            (ratios.between.map(ratio), input.turbine_rad_s, output.or(newest))
        else {
            return;
        };
        let way = (turbine.value - from * output) / ((to - from) * output);
        // In one gear, and at rest, it is no number.
        ratios.way = if way.is_finite() { way.at_least(T::zero()).at_most(T::one()) } else { T::zero() };
    }

    /// Takes what a step of this time, s, has shown of the ratio of a gear. The filter may not run yet: another ratio looks like a slip.
    pub(super) fn take_ratio(&self, state: &mut GearboxState<T>, input: &ShiftInput<T>, dt_s: T) {
        let is_in_gear = input.gear.is_steady() && dt_s <= T::of(LONGEST_S);
        let gear = input.gear.to.place().filter(|place| is_in_gear && *place < GEARS);
        let Some((place, row)) = gear.and_then(|place| Some((place, self.tables.gears.get(place)?))) else {
            state.ratios.pause();
            return;
        };
        let before = state.ratios.now();
        let found = self.compared(state, (place, row.ratio), dt_s);
        let change = found.map_or(T::zero(), |error| state.ratios.keep(place, error));
        if !state.ratios.differs && before == T::zero() {
            return;
        }
        self.follow_ratio(state, input);
        let now = state.ratios.now();
        if let Some(turbine) = state.newest[TURBINE].as_mut().filter(|_| now != before) {
            turbine.scale((T::one() + before) / (T::one() + now));
        }
        if change.abs() >= T::of(OTHER) {
            state.skew.forget_turbine();
        }
    }

    fn compared(&self, state: &mut GearboxState<T>, (place, ratio): (usize, T), dt_s: T) -> Option<T> {
        let before = state.ratios.smooth.take();
        let fresh = |k: usize| {
            let newest = state.newest[k].as_ref()?;
            (!newest.refused && newest.age_s <= T::of(LONGEST_S)).then_some(newest)
        };
        let (turbine, output) = (fresh(TURBINE)?, fresh(OUTPUT)?);
        if output.value.abs() <= self.uncertainty.output_least_rad_s {
            return None;
        }
        let older_s = turbine.age_s.at_least(output.age_s);
        let (turbine, now) = (turbine.reached(older_s)?, output.reached(older_s)?);
        let slip = self.slip(ratio, [turbine, now]);
        // As it would be with nothing taken off.
        let value = slip.value + state.ratios.now() * turbine;
        let mut smooth = before.unwrap_or(Smooth { output: [now; 2], slip: [value; 2], since_s: T::zero() });
        let fraction = dt_s / (dt_s + T::of(SMOOTH_S));
        let pass = |of: &mut [T; 2], now: T| {
            of[0] = of[0] + fraction * (now - of[0]);
            of[1] = of[1] + fraction * (of[0] - of[1]);
        };
        pass(&mut smooth.output, now);
        let rate = ratio * (smooth.output[0] - smooth.output[1]) / T::of(SMOOTH_S);
        let [late, earlier, _] = state.skew.late_s();
        let (value, max_s) = (value - (late - earlier) * rate, self.uncertainty.channel_skew_s);
        let x = ratio * smooth.output[1];
        let largest = slip.threshold() + T::of(2.0) * max_s * rate.abs() + T::of(LARGEST) * x.abs();
        // A comparison with NaN is false.
        if value.abs() <= largest {
            pass(&mut smooth.slip, value);
            smooth.since_s = smooth.since_s + dt_s;
            state.ratios.smooth = Some(smooth);
            if smooth.since_s < T::of(SETTLED_S) {
                return None;
            }
            let others = state.ratios.skew_of_others(place, max_s);
            let of_rate =
                T::of(0.25) * fraction * square(ratio * self.readings[OUTPUT].std_dev_rad_s / T::of(SMOOTH_S));
            let gear = state.ratios.gears.get_mut(place)?;
            gear.take([x, rate, smooth.slip[1]], dt_s, [square(slip.std_dev), of_rate]);
            let skew_s = gear.skew_s(others);
            let error = gear.error(skew_s, T::of(UNEXPLAINED) * slip.threshold());
            state.ratios.skew_s = skew_s;
            let taken = state.ratios.of(u8::try_from(place).ok());
            let rest = smooth.slip[1] - taken * x - skew_s[0] * rate;
            if taken != T::zero() {
                state.ratios.follow_off(place, rest, slip.threshold(), dt_s);
            }
            return error;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What 20 s of pulling away and coasting by turns show of a slip, rad/s, of speed and rate.
    fn found(slip: impl Fn(f64, f64, f64) -> f64) -> Option<f64> {
        let mut compared = Compared::nothing();
        for row in 0..2000 {
            let time_s = 0.01 * f64::from(row);
            let (speed, rate) = (200.0 + 60.0 * (0.5 * time_s).sin(), 30.0 * (0.5 * time_s).cos());
            compared.take([speed, rate, slip(time_s, speed, rate)], 0.01, [0.15 * 0.15, 0.0]);
        }
        let skew_s = compared.skew_s([3e4, 0.0]);
        compared.error(skew_s, 0.4)
    }

    #[test]
    fn an_error_in_proportion_to_the_speed_is_one_of_the_ratio() {
        for error in [-0.01, -0.003, 0.003, 0.01] {
            for skew_s in [-0.01, 0.0, 0.01] {
                let of = found(|_, speed, rate| error * speed - skew_s * rate).unwrap();
                assert!((of - error).abs() < 1e-4, "{error} {skew_s}: {of}");
            }
        }
        assert!(found(|_, _, rate| -0.01 * rate).is_some_and(|error| error.abs() < 1e-4));
    }

    #[test]
    fn a_slip_is_none() {
        // That grows with the torque, that comes and goes, and a large one.
        assert_eq!(found(|_, speed, _| 2.0 - 0.01 * (speed - 200.0) - 0.008 * speed), None);
        assert_eq!(found(|time_s, _, _| if time_s % 4.0 < 2.0 { 2.0 } else { 0.0 }), None);
        assert_eq!(found(|_, speed, _| 0.03 * speed), None);
    }

    #[test]
    fn a_gear_that_was_not_driven_has_the_mean_of_the_others() {
        let mut ratios = RatioErrors::nothing();
        assert_eq!(
            [(0, 0.004), (1, 0.002), (1, 0.0021)].map(|(place, error)| ratios.keep(place, error)),
            [0.004, -0.002, 0.0]
        );
        assert_eq!([0, 1, 2, 99].map(|place| ratios.of(Some(place))), [0.004, 0.002, 0.003, 0.003]);
        assert_eq!([(2, 0.0), (99, 0.01)].map(|(place, error)| ratios.keep(place, error)), [-0.003, 0.0]);
        (ratios.between, ratios.way) = ([Some(0), Some(1)], 0.25);
        assert_eq!(ratios.now(), 0.0035);
    }

    #[test]
    fn sensors_without_noise_show_it_too() {
        let mut compared = Compared::nothing();
        (0..200).for_each(|_| compared.take([200.0_f32, 0.0, 0.8], 0.01, [0.0; 2]));
        let skew_s = compared.skew_s([3e4, 0.0]);
        assert!(compared.error(skew_s, 0.4).is_some_and(|error| (error - 0.004).abs() < 1e-4));
    }

    #[test]
    fn an_error_about_the_smallest_does_not_come_and_go() {
        let mut ratios = RatioErrors::nothing();
        let kept = [4.9e-4, 5.1e-4, 4.9e-4, 5.1e-4, 3e-4, 2e-4, 4e-4].map(|error| {
            ratios.keep(0, error);
            ratios.of(Some(0))
        });
        assert_eq!(kept, [0.0, 5.1e-4, 5.1e-4, 5.1e-4, 5.1e-4, 0.0, 0.0]);
    }

    #[test]
    fn an_error_that_was_a_slip_is_forgotten() {
        let mut ratios = RatioErrors::nothing();
        ratios.keep(3, 0.01);
        for (rest, is_kept) in [(0.1, true), (2.0, true), (0.1, true), (2.0, false)] {
            (0..99).for_each(|_| ratios.follow_off(3, rest, 0.8, 0.01));
            ratios.follow_off(3, rest, 0.8, if is_kept { 0.0 } else { 0.02 });
            assert_eq!(ratios.differs, is_kept, "{rest}");
        }
        assert_eq!(ratios.of(Some(3)), 0.0);
    }
}
