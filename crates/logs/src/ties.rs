//! Output and wheel speeds that leave the ratios which tie them to the others.
//!
//! In a gear the output has the speed of the turbine over the ratio of the gear, and always that of the wheels times the final ratio, but for the
//! twist of the shafts. Both ratios are learnt while they stand. An output that leaves both, while turbine and wheels still agree with each other, is
//! wrong, also if it drifts away slowly; so is the one of output and wheels that moved more when both part in a shift, and a wheel that parts from an
//! output that the gear holds. It is refused until it is back, from the last reading on that agreed.

use crate::Role;
use crate::copies::Stamped;
use crate::speed_faults::{Fit, LONGEST_S};

/// Two readings of a tie agree that differ by less than this fraction, or by this, rad/s \[chosen\]: noise, and shafts that twist.
const AGREE: (f64, f64) = (0.01, 1.0);
/// Beyond this an output is off in a gear \[chosen\].
const OFF: (f64, f64) = (0.025, 2.5);
/// The same of output and wheels in a shift, where their shafts twist back, and of wheels in a gear: one wheel is faster than the mean of both in a
/// curve \[chosen\].
const OFF_IN_SHIFT: (f64, f64) = (0.08, 6.0);
const WHEEL_OFF: (f64, f64) = (0.2, 6.0);
/// And the output has turned by this angle more or less than the wheels since then, rad \[chosen\]: more than shafts twist, and many times that where
/// no gear shows it.
const TWIST_RAD: f64 = 0.6;
const TWIST_IN_SHIFT_RAD: f64 = 2.0;
/// In a shift both part within this time, s: in a curve one wheel does so in more.
const SHIFT_S: f64 = 1.5;
/// What moved so many times as much as the other one is the one that parted.
const MOVED: f64 = 2.0;
/// So many readings in a row show it.
const READINGS: u32 = 3;
/// A ratio is known that stood for so long, s, within this fraction; and it follows with this time constant, s.
const STANDS_S: f64 = 1.0;
const STANDS: f64 = 0.005;
const FOLLOWS_S: f64 = 2.0;
/// Another reading that is older than this is no evidence, s.
const FRESH_S: f64 = 0.11;
/// Below these speeds, rad/s, ratios say nothing: turbine, output, wheels.
const SLOWEST_RAD_S: [f64; 3] = [40.0, 20.0, 6.0];

/// Most gears whose ratios are known; of a gearbox with more, any ratio that stands counts.
const MAX_GEARS: usize = 16;
/// A ratio that stands is that of a gear within this fraction: a sensor of another number of teeth is a matter of the vehicle file.
const OF_GEAR: f64 = 0.02;

/// Watches output and wheel speed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ties {
    /// Ratios of the gears; not numbers where they are not known.
    ratios: [f64; MAX_GEARS],
    turbine: Option<Stamped>,
    output: Option<Stamped>,
    wheel: Option<Stamped>,
    /// Turbine over output, and output over wheel speed.
    gear: Tie,
    wheels: Tie,
    /// Output and wheel speed when they agreed last.
    right: Option<[Stamped; 2]>,
    /// By how much more the output has turned than the wheels since then, rad.
    turned_rad: f64,
    compared_s: f64,
    /// Readings in a row that show one of both to be off, and which one is known to be.
    shown: [u32; 2],
    off: Option<Off>,
}

/// A ratio of two speeds.
#[derive(Debug, Clone, Copy)]
struct Tie {
    /// Once it is known.
    known: Option<f64>,
    /// The newest one that stands, and since when, s.
    newest: f64,
    since_s: f64,
    last_s: f64,
}

/// A speed that is off.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Off {
    Output,
    Wheel,
}

impl Tie {
    const NEW: Self = Self { known: None, newest: f64::NAN, since_s: f64::NAN, last_s: f64::NAN };

    /// Takes the ratio of this time, s.
    fn learn(&mut self, ratio: f64, time_s: f64) {
        let stands = (ratio - self.newest).abs() <= STANDS * self.newest.abs();
        let passed_s = (time_s - self.last_s).max(0.0);
        self.last_s = time_s;
        if !stands {
            (self.newest, self.since_s) = (ratio, time_s);
            return;
        }
        self.newest += (passed_s * (1.0 / FOLLOWS_S)).min(1.0) * (ratio - self.newest);
        if time_s - self.since_s >= STANDS_S {
            self.known = Some(self.newest);
        }
    }
}

/// Whether two speeds differ by more than a fraction of them, and than a speed.
fn differ(one: f64, other: f64, (fraction, rad_s): (f64, f64)) -> bool {
    (one - other).abs() > rad_s.max(fraction * other.abs())
}

impl Ties {
    /// Before the first readings, of a gearbox with gears of these ratios, turbine over output speed; without any they are not known.
    pub(crate) fn of(gears: &[f64]) -> Self {
        let mut ratios = [f64::NAN; MAX_GEARS];
        if gears.len() <= MAX_GEARS {
            ratios[..gears.len()].copy_from_slice(gears);
        }
        Self::with(ratios)
    }

    fn with(ratios: [f64; MAX_GEARS]) -> Self {
        Self {
            ratios,
            turbine: None,
            output: None,
            wheel: None,
            gear: Tie::NEW,
            wheels: Tie::NEW,
            right: None,
            turned_rad: 0.0,
            compared_s: f64::NAN,
            shown: [0; 2],
            off: None,
        }
    }

    /// Takes a reading that is not refused for another reason. Returns the speed that is off, with its last reading that is right.
    pub(crate) fn push(&mut self, role: Role, reading: Stamped) -> Option<(Role, Stamped)> {
        let [_, time_s] = reading;
        if self.right.is_some_and(|[_, [_, right_s]]| time_s < right_s - FRESH_S) {
            // The clock began anew.
            *self = Self::with(self.ratios);
        }
        match role {
            Role::TurbineSpeed => self.turbine = Some(reading),
            Role::WheelSpeed => {
                self.wheel = Some(reading);
                if self.off == Some(Off::Wheel) && self.fit(role, reading) == Fit::Known {
                    self.off = None;
                }
            }
            Role::OutputSpeed => {
                self.output = Some(reading);
                self.compare(reading);
            }
            _ => return None,
        }
        let [output, wheel] = self.right?;
        match (self.off?, role) {
            (Off::Output, Role::OutputSpeed) => Some((role, output)),
            (Off::Wheel, Role::WheelSpeed | Role::OutputSpeed) => Some((Role::WheelSpeed, wheel)),
            _ => None,
        }
    }

    /// Whether a reading of turbine, output or wheel speed has the ratio to the others that is known.
    pub(crate) fn fit(&self, role: Role, [rad_s, time_s]: Stamped) -> Fit {
        let fresh = |other: Option<Stamped>| {
            other.filter(|[_, then_s]| (time_s - then_s).abs() <= FRESH_S).map(|[rad_s, _]| rad_s)
        };
        let (output, wheel) = (fresh(self.output), fresh(self.wheel));
        let expected = match role {
            Role::TurbineSpeed => output.zip(self.gear.known).map(|(output, ratio)| ratio * output),
            Role::OutputSpeed => wheel.zip(self.wheels.known).map(|(wheel, ratio)| ratio * wheel),
            Role::WheelSpeed => output.zip(self.wheels.known).map(|(output, ratio)| output / ratio),
            _ => None,
        };
        if expected.is_some_and(|expected| !differ(rad_s, expected, AGREE)) {
            return Fit::Known;
        }
        let of_gear = output.filter(|_| role == Role::TurbineSpeed).map(|output| rad_s / output);
        if of_gear.is_some_and(|ratio| self.is_of_gear(ratio)) { Fit::OtherGear } else { Fit::None }
    }

    /// Whether a ratio is that of a gear, in a gearbox whose gears are known.
    fn is_of_gear(&self, ratio: f64) -> bool {
        self.ratios.iter().any(|gear| (ratio - gear).abs() <= OF_GEAR * gear.abs())
    }

    /// Compares an output speed with the newest others.
    fn compare(&mut self, output: Stamped) {
        let [rad_s, time_s] = output;
        let [turbine_min, output_min, wheel_min] = SLOWEST_RAD_S;
        let fresh = |other: Option<Stamped>, min_rad_s: f64| {
            other.filter(|[rad_s, then_s]| (time_s - then_s).abs() <= FRESH_S && *rad_s > min_rad_s)
        };
        let Some(wheel) = fresh(self.wheel, wheel_min).filter(|_| rad_s > output_min) else {
            (self.off, self.shown, self.turned_rad) = (None, [0; 2], 0.0);
            return;
        };
        let turbine = fresh(self.turbine, turbine_min);
        let by_turbine = turbine.zip(self.gear.known).map(|([turbine, _], ratio)| turbine / ratio);
        let Some(by_wheel) = self.wheels.known.map(|ratio| ratio * wheel[0]) else {
            self.learn(output, wheel, turbine);
            return;
        };
        if !differ(rad_s, by_wheel, AGREE) {
            (self.off, self.shown, self.turned_rad) = (None, [0; 2], 0.0);
            (self.right, self.compared_s) = (Some([output, wheel]), time_s);
            self.learn(output, wheel, turbine);
            return;
        }
        let passed_s = (time_s - self.compared_s).clamp(0.0, FRESH_S);
        self.turned_rad += if passed_s.is_nan() { 0.0 } else { (rad_s - by_wheel) * passed_s };
        self.compared_s = time_s;
        let is_shown = self.shown_by(output, wheel, (by_turbine, by_wheel));
        for (count, is_shown) in self.shown.iter_mut().zip(is_shown) {
            *count = if is_shown { count.saturating_add(1) } else { 0 };
        }
        let is_long = self.right.is_none_or(|[[_, right_s], _]| time_s - right_s > LONGEST_S);
        self.off = match self.shown.map(|count| count >= READINGS) {
            [true, _] => Some(Off::Output),
            [_, true] => Some(Off::Wheel),
            // Until both agree again, also where no gear shows it any longer.
            _ => self.off.filter(|_| !is_long),
        };
        if self.off.is_none() {
            self.learn(output, wheel, turbine);
        }
    }

    /// Whether the output, and whether the wheels, are shown to be off.
    fn shown_by(&self, output: Stamped, [wheel, _]: Stamped, by: (Option<f64>, f64)) -> [bool; 2] {
        let (by_turbine, by_wheel) = by;
        let [output, time_s] = output;
        let Some([[output_then, right_s], [wheel_then, _]]) = self.right else { return [false; 2] };
        let [output_moved, wheel_moved] = [output / output_then - 1.0, wheel / wheel_then - 1.0].map(f64::abs);
        // A copy of the turbine is in the direct gear for all that both show.
        let is_held = by_turbine.is_some_and(|by_turbine| !differ(output, by_turbine, AGREE) && by_turbine != output);
        let parted = differ(output, by_wheel, OFF_IN_SHIFT) && self.turned_rad.abs() > TWIST_IN_SHIFT_RAD;
        if is_held {
            return [false, parted && differ(output, by_wheel, WHEEL_OFF)];
        }
        let leaves_both = by_turbine.is_some_and(|by_turbine| {
            let is_off = differ(output, by_turbine, OFF) && differ(output, by_wheel, OFF);
            is_off && !differ(by_turbine, by_wheel, AGREE) && self.turned_rad.abs() > TWIST_RAD
        });
        let parts_in_shift = parted && time_s - right_s <= SHIFT_S;
        [
            leaves_both || parts_in_shift && output_moved > MOVED * wheel_moved,
            parts_in_shift && wheel_moved > MOVED * output_moved,
        ]
    }

    /// Takes ratios of speeds that are right as far as they show.
    fn learn(&mut self, [output, time_s]: Stamped, [wheel, _]: Stamped, turbine: Option<Stamped>) {
        if let Some([turbine, _]) = turbine {
            let ratio = turbine / output;
            if self.ratios[0].is_nan() || self.is_of_gear(ratio) {
                self.gear.learn(ratio, time_s);
            }
        }
        let holds =
            turbine.zip(self.gear.known).is_some_and(|([turbine, _], ratio)| !differ(output, turbine / ratio, AGREE));
        if holds || self.wheels.known.is_none() {
            self.wheels.learn(output / wheel, time_s);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The speeds that are off with each reading, and since when, of a car in gear 2 of three with these factors of its speeds.
    fn off(factors: impl Fn(f64) -> [f64; 3]) -> Vec<(Role, f64, f64)> {
        let mut ties = Ties::of(&[4.0, 2.0, 1.0]);
        let mut found = Vec::new();
        for row in 0..2000_u32 {
            let time_s = 0.01 * f64::from(row);
            let noise = |of: f64| 0.2 * (f64::from(row) * of).sin();
            let output = 120.0 + 2.0 * time_s;
            let [turbine, shown, wheel] = factors(time_s);
            let speeds = [
                (Role::TurbineSpeed, 2.0 * output * turbine + noise(1.3)),
                (Role::OutputSpeed, output * shown + noise(2.1)),
                (Role::WheelSpeed, output / 3.0 * wheel + 0.3 * noise(1.7)),
            ];
            for (role, value) in speeds {
                found.extend(ties.push(role, [value, time_s]).map(|(role, [_, right_s])| (role, time_s, right_s)));
            }
        }
        found
    }

    fn ramp(time_s: f64, [from_s, to_s]: [f64; 2], factor: f64) -> f64 {
        1.0 + (factor - 1.0) * ((time_s - from_s) / (to_s - from_s)).clamp(0.0, 1.0)
    }

    #[test]
    fn an_output_that_drifts_is_refused_from_where_it_left_until_it_is_back() {
        for (factor, lasts_s) in [(0.7, 0.3), (1.3, 1.0), (0.9, 2.0)] {
            let out = |time_s: f64| (10.0..14.0).contains(&time_s);
            let found =
                off(|time_s| [1.0, if out(time_s) { ramp(time_s, [10.0, 10.0 + lasts_s], factor) } else { 1.0 }, 1.0]);
            let begins_s = 10.0 + lasts_s * 0.03 / (factor - 1.0_f64).abs();
            let first = found.first().copied().unwrap_or((Role::WheelSpeed, 0.0, 0.0));
            assert!(first.0 == Role::OutputSpeed && first.1 < begins_s + 0.4, "{factor}: {first:?}");
            assert!(
                found.iter().all(|(role, time_s, right_s)| *role == first.0 && *time_s < 14.0 && *right_s < begins_s),
                "{factor}"
            );
            assert!(found.last().is_some_and(|(_, time_s, _)| *time_s > 13.98), "{factor}: {:?}", found.last());
        }
    }

    #[test]
    fn a_shift_in_which_output_or_wheels_drift_names_the_one_that_moved() {
        for (at, role) in [(1, Role::OutputSpeed), (2, Role::WheelSpeed)] {
            let found = off(|time_s| {
                // From gear 2 to 3.
                let mut factors = [ramp(time_s, [10.0, 10.6], 0.5), 1.0, 1.0];
                factors[at] = if time_s < 11.0 { ramp(time_s, [10.1, 10.5], 0.7) } else { 1.0 };
                factors
            });
            assert!(
                found.len() > 30 && found.iter().all(|(of, time_s, _)| *of == role && *time_s < 11.005),
                "{at}: {found:?}"
            );
        }
    }

    #[test]
    fn a_wheel_in_a_curve_a_shift_and_other_tyres_are_not_off() {
        // One wheel is 12 % faster than the mean for some seconds, while the car gets slower, too.
        assert_eq!(off(|time_s| [1.0, 1.0, 1.0 + 0.12 * (1.2 * (time_s - 8.0)).sin().max(0.0)]), []);
        let slows = |time_s: f64| ramp(time_s, [8.0, 9.5], 0.88);
        assert_eq!(off(|time_s| [slows(time_s), slows(time_s), 1.0]), []);
        assert_eq!(off(|time_s| [ramp(time_s, [8.0, 8.5], 0.5), 1.0, 1.0]), []);
        assert_eq!(off(|_| [1.0, 1.0, 0.9]), []);
        // Shafts twist back.
        assert_eq!(
            off(|time_s| [
                ramp(time_s, [8.0, 8.5], 0.5),
                1.0 + 0.1 * ((time_s - 8.0) * 60.0).sin() * f64::from(u8::from(time_s > 8.0 && time_s < 8.4)),
                1.0
            ]),
            []
        );
    }

    #[test]
    fn a_speed_that_has_its_ratio_again_fits() {
        let mut ties = Ties::of(&[4.0, 2.0, 1.0]);
        for row in 0..300_u32 {
            let time_s = 0.01 * f64::from(row);
            for (role, value) in [(Role::TurbineSpeed, 240.0), (Role::OutputSpeed, 120.0), (Role::WheelSpeed, 40.0)] {
                ties.push(role, [value, time_s]);
            }
        }
        assert_eq!(ties.fit(Role::TurbineSpeed, [241.0, 3.0]), Fit::Known);
        assert_eq!(ties.fit(Role::TurbineSpeed, [121.0, 3.0]), Fit::OtherGear);
        assert_eq!(ties.fit(Role::TurbineSpeed, [200.0, 3.0]), Fit::None);
        assert_eq!([119.5, 110.0].map(|output| ties.fit(Role::OutputSpeed, [output, 3.0])), [Fit::Known, Fit::None]);
        assert_eq!([40.2, 45.0].map(|wheel| ties.fit(Role::WheelSpeed, [wheel, 3.0])), [Fit::Known, Fit::None]);
        assert_eq!(ties.fit(Role::EngineSpeed, [240.0, 3.0]), Fit::None);
        assert_eq!(ties.fit(Role::TurbineSpeed, [241.0, 4.0]), Fit::None, "the output is too old");
    }
}
