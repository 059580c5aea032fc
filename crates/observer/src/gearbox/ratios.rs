//! By how much turbine over output speed differs from the ratio of each gear, found while that gear holds.
//!
//! A vehicle file has ratios of a few digits, and a sensor may be described with a wrong scale. The slip in the gears shows by how much each ratio is off, beside
//! what the readings' ages make of it ([`super::slip_fit`]). Turbine readings are divided by one plus that, in a
//! shift by what lies between those of both gears, as far as the ratio has come. A gear that was not driven yet is taken to have the mean of the
//! others, as by a sensor's scale. A slip is distinguished by
//! its changes: one that is steady at a steady speed looks alike until one of both changes.

use car::ShiftCommand;
use drivetrain::Real;

use super::skew::WIDEST_S;
use super::slip_fit::{GEARS, InGear};
use super::{GearboxFilter, GearboxState, OUTPUT, ShiftInput, SlipFit, TURBINE, square};

/// Largest error of a ratio that is taken off, as a fraction \[chosen\]: two digits of a ratio of 0.5 have half of it.
const LARGEST: f64 = 0.02;
/// Standard deviations of it above which it is shown, and standard deviation below which it is known \[chosen\].
const SHOWN: f64 = 2.0;
const KNOWN: f64 = 2e-4;
/// Smallest error that is taken off \[chosen\]: at 300 rad/s 0.15 rad/s, half of what counts as a slip of noiseless speeds. One that is taken off is until it is
/// half of that.
const SMALLEST: f64 = 5e-4;
/// Change of an error that is known from which on it is taken anew \[chosen\].
const CHANGED: f64 = 2.5e-4;
/// Time for which the speeds have to be off a ratio with its error until that is forgotten, s \[chosen\].
const OFF_S: f64 = 1.0;
/// Time for which the speeds are those of a gear before they are compared, and how long they are until an error is known, s \[chosen\].
const SETTLED_S: f64 = 0.4;
const COMPARED_S: f64 = 0.5;
/// Multiple of its standard deviation from which on a rate counts \[chosen\]: the noise of the output speed is in rate and slip, and a weaker one would look
/// like a delay.
const RATE_SHOWN: f64 = 4.0;
/// Root mean square of what the error does not explain, in thresholds of a slip, above which an element slips \[chosen\].
const UNEXPLAINED: f64 = 0.5;
/// Time constant with which slip and output speed are low-passed twice before they are compared, s \[chosen\]: the noise of the output speed is in slip and
/// rate, and would look like a skew.
const SMOOTH_S: f64 = 0.1;
/// Time between two readings, and the longest one, s \[chosen\].
const READ_S: f64 = 0.01;
const LONGEST_S: f64 = 0.06;

/// What the readings in gears have shown.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct RatioErrors<T> {
    /// The speeds, as long as they are those of a gear.
    smooth: Option<Smooth<T>>,
    pub(super) slip: SlipFit<T>,
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

impl<T: Real> RatioErrors<T> {
    /// Before anything was read, with the variances of the lags of turbine and output, rad^2.
    pub(super) fn nothing(lag_variances: [T; 2]) -> Self {
        Self {
            smooth: None,
            slip: SlipFit::nothing(lag_variances),
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

    fn of(&self, place: Option<u8>) -> T {
        place.and_then(|place| *self.found.get(usize::from(place))?).unwrap_or(self.others)
    }

    /// The error now.
    fn now(&self) -> T {
        let [from, to] = self.between.map(|place| self.of(place));
        from + self.way * (to - from)
    }

    /// The error of the ratio of the gear at hand once it is known, and from then on; `largest_rad_s` bounds the root mean square of what it does not explain
    /// of the slip.
    fn known(&mut self, place: usize, largest_rad_s: T) -> Option<T> {
        let ([error, std_dev], time_s, unexplained) = self.slip.ratio()?;
        let is_found = self.found.get(place).is_some_and(Option::is_some);
        // A comparison with NaN is false.
        let explains = unexplained <= square(largest_rad_s);
        self.slip.set_explains(explains);
        let is_known = explains
            && time_s >= T::of(COMPARED_S)
            && (is_found || std_dev <= T::of(KNOWN).at_least(error.abs() / T::of(SHOWN)))
            && error.abs() <= T::of(LARGEST);
        is_known.then_some(error)
    }

    /// Keeps what is known of a gear.
    fn keep(&mut self, place: usize, error: T) {
        let Some(found) = self.found.get(place).copied() else { return };
        let before = found.unwrap_or(self.others);
        let smallest = T::of(if before == T::zero() { SMALLEST } else { 0.5 * SMALLEST });
        let error = if error.abs() >= smallest { error } else { T::zero() };
        if found.is_none() || (error - before).abs() >= T::of(CHANGED) {
            self.set(place, Some(error));
        }
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
            self.slip.forget(place);
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
        // A clutch that takes up the load of a car that starts slips, which looks like a lag.
        let is_in_gear = input.gear.is_steady() && dt_s <= T::of(LONGEST_S) && !state.launches;
        let gear = input.gear.to.place().filter(|place| is_in_gear && *place < GEARS);
        let Some((place, row)) = gear.and_then(|place| Some((place, self.tables.gears.get(place)?))) else {
            state.ratios.pause();
            return;
        };
        let before = state.ratios.now();
        let found = self.compared(state, (place, row.ratio), dt_s);
        if let Some(error) = found {
            state.ratios.keep(place, error);
        }
        if !state.ratios.differs && before == T::zero() {
            return;
        }
        self.follow_ratio(state, input);
        let now = state.ratios.now();
        if let Some(turbine) = state.newest[TURBINE].as_mut().filter(|_| now != before) {
            turbine.scale((T::one() + before) / (T::one() + now));
        }
    }

    fn compared(&self, state: &mut GearboxState<T>, (place, ratio): (usize, T), dt_s: T) -> Option<T> {
        let before = state.ratios.smooth.take();
        let taken_s = state.skew.ages_s();
        let fresh = |k: usize| {
            let newest = state.newest[k].as_ref()?;
            (!newest.refused && newest.age_s - taken_s[k] <= T::of(LONGEST_S)).then_some(newest)
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
        let [late, earlier, _] = state.skew.all_taken_s();
        let value = value - (late - earlier) * rate;
        let widest_s = (T::of(2.0) * self.uncertainty.channel_skew_s).at_least(T::of(WIDEST_S));
        let x = ratio * smooth.output[1];
        let largest = slip.threshold() + widest_s * rate.abs() + T::of(LARGEST) * x.abs();
        // A comparison with NaN is false.
        if value.abs() <= largest {
            pass(&mut smooth.slip, value);
            smooth.since_s = smooth.since_s + dt_s;
            state.ratios.smooth = Some(smooth);
            if smooth.since_s < T::of(SETTLED_S) {
                return None;
            }
            let of_output = self.readings[OUTPUT].std_dev_rad_s / T::of(SMOOTH_S);
            let of_rate = T::of(0.5) * fraction.sqrt() * of_output;
            let is_shown = rate.abs() > T::of(RATE_SHOWN) * ratio.abs() * of_rate;
            let at = InGear {
                slip: smooth.slip[1],
                variance: square(slip.std_dev),
                ratio,
                output_rad_s: smooth.output[1],
                rate_rad_s2: if is_shown { rate / ratio } else { T::zero() },
            };
            // A reading that is repeated in faster rows counts once.
            let counts = (dt_s / T::of(READ_S)).at_most(T::one());
            let ratios = &mut state.ratios;
            ratios.slip.take(place, &at, (dt_s, counts));
            let error = ratios.known(place, T::of(UNEXPLAINED) * slip.threshold());
            let taken = ratios.of(u8::try_from(place).ok());
            let rest = at.slip - taken * x - ratios.slip.late_rad_s(&at);
            if taken != T::zero() {
                ratios.follow_off(place, rest, slip.threshold(), dt_s);
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
        let mut ratios = RatioErrors::nothing([0.0; 2]);
        for row in 0..2000 {
            let time_s = 0.01 * f64::from(row);
            let (speed, rate) = (200.0 + 60.0 * (0.5 * time_s).sin(), 30.0 * (0.5 * time_s).cos());
            let slip = slip(time_s, speed, rate);
            let at = InGear { slip, variance: 0.15 * 0.15, ratio: 1.0, output_rad_s: speed, rate_rad_s2: rate };
            ratios.slip.take(0, &at, (0.01, 1.0));
        }
        ratios.known(0, 0.4)
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
        let mut ratios = RatioErrors::nothing([0.0; 2]);
        [(0, 0.004), (1, 0.002), (1, 0.0021)].into_iter().for_each(|(place, error)| ratios.keep(place, error));
        assert_eq!([0, 1, 2, 99].map(|place| ratios.of(Some(place))), [0.004, 0.002, 0.003, 0.003]);
        [(2, 0.0), (99, 0.01)].into_iter().for_each(|(place, error)| ratios.keep(place, error));
        assert_eq!(ratios.others, 0.002);
        (ratios.between, ratios.way) = ([Some(0), Some(1)], 0.25);
        assert_eq!(ratios.now(), 0.0035);
    }

    #[test]
    fn sensors_without_noise_show_it_too() {
        let mut ratios = RatioErrors::nothing([0.0_f32; 2]);
        let at = InGear { slip: 0.8, variance: 0.0, ratio: 1.0, output_rad_s: 200.0, rate_rad_s2: 0.0 };
        (0..200).for_each(|_| ratios.slip.take(0, &at, (0.01, 1.0)));
        assert!(ratios.known(0, 0.4).is_some_and(|error| (error - 0.004).abs() < 1e-4));
    }

    #[test]
    fn an_error_about_the_smallest_does_not_come_and_go() {
        let mut ratios = RatioErrors::nothing([0.0; 2]);
        let kept = [4.9e-4, 5.1e-4, 4.9e-4, 5.1e-4, 3e-4, 2e-4, 4e-4].map(|error| {
            ratios.keep(0, error);
            ratios.of(Some(0))
        });
        assert_eq!(kept, [0.0, 5.1e-4, 5.1e-4, 5.1e-4, 5.1e-4, 0.0, 0.0]);
    }

    #[test]
    fn an_error_that_was_a_slip_is_forgotten() {
        let mut ratios = RatioErrors::nothing([0.0; 2]);
        ratios.keep(3, 0.01);
        for (rest, is_kept) in [(0.1, true), (2.0, true), (0.1, true), (2.0, false)] {
            (0..99).for_each(|_| ratios.follow_off(3, rest, 0.8, 0.01));
            ratios.follow_off(3, rest, 0.8, if is_kept { 0.0 } else { 0.02 });
            assert_eq!(ratios.differs, is_kept, "{rest}");
        }
        assert_eq!(ratios.of(Some(3)), 0.0);
    }
}
