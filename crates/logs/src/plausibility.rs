//! Units that are wrong by all appearances.

use drivetrain::Real;
use trace::Quantity;
use trace::units::{mpa, rpm};

use crate::Role;
use crate::frozen::{COUPLED, FROZEN_CHANGE_FROM_START};
use crate::readings::RoleSummary;

/// Minimum and maximum of some values, and the middle of their sizes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extremes {
    /// The minimum.
    pub minimum: f64,
    /// The maximum.
    pub maximum: f64,
    /// Values away from zero by their size: how many lie between two powers of the eighth root of two.
    sizes: [u32; SIZES],
    count: u64,
    /// Values above and below zero by more than `SMALL_RAD_S`.
    above: u64,
    below: u64,
}

/// A shaft that never turns faster says nothing about its sign, rad/s. A car in reverse is slower.
const SMALL_RAD_S: f64 = 60.0;

/// Wheels of a car that drives at all turn faster, rad/s: 4 m/s.
const MOVING_RAD_S: f64 = 13.0;

/// An engine that drives a car turns faster at times, rad/s: 1000 rpm.
const DRIVEN_RAD_S: f64 = 105.0;

/// An engine that is driven is mostly slower, rad/s: 6000 rpm.
const ENGINE_RAD_S: f64 = 630.0;

/// Powers of two from 2^-32 to 2^32, which hold every value in SI that a car has; and parts of each.
const OCTAVES: usize = 64;
const PARTS: usize = 8;
const SIZES: usize = OCTAVES * PARTS;

impl Default for Extremes {
    fn default() -> Self {
        Self { minimum: f64::INFINITY, maximum: f64::NEG_INFINITY, sizes: [0; SIZES], count: 0, above: 0, below: 0 }
    }
}

impl Extremes {
    /// Takes a value.
    pub fn push(&mut self, value: f64) {
        self.count += 1;
        self.above += u64::from(value > SMALL_RAD_S);
        self.below += u64::from(value < -SMALL_RAD_S);
        self.minimum = self.minimum.min(value);
        self.maximum = self.maximum.max(value);
        if value != 0.0 {
            let size = ((Real::log2(value.abs()) + 32.0) * PARTS as f64).clamp(0.0, (SIZES - 1) as f64) as usize;
            self.sizes[size] = self.sizes[size].saturating_add(1);
        }
    }

    /// The middle of the sizes of the values that are not zero, to 5 %; none without such values.
    pub fn middle(&self) -> Option<f64> {
        let all: u64 = self.sizes.iter().map(|count| u64::from(*count)).sum();
        let mut below = 0;
        for (size, count) in (0_u32..).zip(&self.sizes) {
            below += u64::from(*count);
            if 2 * below > all {
                return Some(Real::exp2((f64::from(size) + 0.5) / PARTS as f64 - 32.0));
            }
        }
        None
    }

    /// How many values lie between two powers of two.
    fn octaves(&self) -> [u64; OCTAVES] {
        let (octaves, _) = self.sizes.as_chunks::<PARTS>();
        std::array::from_fn(|at| octaves.get(at).map_or(0, |parts| parts.iter().map(|count| u64::from(*count)).sum()))
    }

    /// Whether it turns forward, but for a few readings that may be wrong.
    fn is_forward(&self) -> bool {
        self.above > 10 * self.below
    }

    /// Whether it turns backward, but for a few readings that may be wrong: in more than a hundredth of all.
    fn is_backward(&self) -> bool {
        self.below > 10 * self.above && 100 * self.below > self.count
    }

    /// Whether many values are all the same.
    fn stands_still(&self) -> bool {
        const MANY: u64 = 100;
        self.count >= MANY && self.minimum == self.maximum
    }

    /// The maximum magnitude, without the largest hundredth of the values where that is of another order: a few readings may be wrong.
    fn size(&self) -> f64 {
        let octaves = self.octaves();
        let (all, mut below) = (octaves.iter().sum::<u64>(), 0);
        let nearly_all = (0_i32..).zip(&octaves).find(|(_, count)| {
            below += **count;
            100 * below >= 99 * all
        });
        let limit = nearly_all.map_or(f64::INFINITY, |(size, _)| Real::exp2(f64::from(size - 31)));
        self.maximum.abs().max(self.minimum.abs()).min(limit)
    }

    /// The maximum magnitude of a speed. A shaft passes every speed between two others: a tenth or less of the values of a shaft that turns, parted from
    /// all others by a factor of two and more, are readings that are wrong, as of a sensor that says by a number that it has no value.
    fn speed(&self) -> f64 {
        // From 2^2 rad/s on. The noise of a shaft that stands, which it may do for most of a log, is no speed.
        const TURNS: usize = 34;

        let octaves = self.octaves();
        let turns: u64 = octaves.iter().skip(TURNS).sum();
        // A log that turns in no other octave than that of its largest values does not turn.
        let is_one = octaves.iter().skip(TURNS).filter(|count| **count > 0).count() <= 1;
        let all = if is_one { octaves.iter().sum() } else { turns };
        let (mut above, mut limit) = (0, f64::INFINITY);
        for (size, count) in (0_i32..64).zip(&octaves).rev() {
            if *count == 0 && above > 0 {
                limit = Real::exp2(f64::from(size - 32));
            }
            above += *count;
            if 10 * above > all {
                break;
            }
        }
        self.size().min(limit)
    }
}

/// A unit that cannot be right.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finding {
    /// The signal.
    pub role: Role,
    /// Its name in a channel map.
    pub name: String,
    /// What is wrong, with what is likely.
    pub message: String,
    /// What is likely.
    pub likely: Likely,
}

/// What is likely where a unit cannot be right.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Likely {
    /// A unit; may be several, or words.
    Unit(&'static str),
    /// The other sign.
    OtherSign,
    /// Another channel, or a sensor that has failed.
    OtherChannel,
}

/// How much of a log some values are of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Seen {
    /// Its beginning: what is small may become large.
    Beginning,
    /// All of it.
    All,
}

/// Rows of a car's log are so far apart, s \[chosen\]: speeds and commands are recorded every 1 ms to 100 ms, and one more decade on each side.
const ROWS_APART_S: std::ops::Range<f64> = 1e-4..1.0;

/// The unit that a time is in by all appearances, where it was taken as s and this is the time between two rows.
pub fn likely_time_unit(step_s: f64) -> Option<&'static str> {
    let units = [("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)];
    let is_slow = step_s >= ROWS_APART_S.end;
    units.into_iter().find(|(_, size)| is_slow && ROWS_APART_S.contains(&(step_s * size))).map(|(unit, _)| unit)
}

/// What is wrong with a time whose rows are closer together than those of any car's log, all of them within less than a second: a shift
/// with what is needed before it takes longer. In a sentence with a hint.
pub fn too_fast_a_time(step_s: f64, span_s: f64) -> Option<String> {
    (step_s > 0.0 && step_s < ROWS_APART_S.start && span_s < 1.0).then(|| {
        format!(
            "the middle time between two rows is {step_s:.1e} s, and all of them lie within {span_s:.3} s\n\
             hint: the times suggest a larger unit than the one given; check it (`unit` under [time] in the channel map, or the \
             ending of the column's name)"
        )
    })
}

/// What cannot be right.
pub fn findings(summary: &[RoleSummary], seen: Seen) -> Vec<Finding> {
    // A turbine of a car that creeps is as slow.
    let creeps = |of: &RoleSummary, role: Role| role == Role::TurbineSpeed && of.extremes.speed() < DRIVEN_RAD_S;
    let is_turning = |entry: &&RoleSummary| entry.extremes.speed() > 1.0 && !entry.ended_early();
    let turning = |role: Role| summary.iter().find(|entry| entry.role == role).filter(is_turning);
    let mut findings: Vec<Finding> = summary.iter().filter_map(|entry| alone(entry, summary, seen)).collect();
    if !findings.is_empty() {
        return findings;
    }
    findings.extend(summary.iter().filter_map(|entry| stands_still(entry, summary)));
    // A turbine reaches nearly the speed of the engine; in another unit it is ten times off. Wheels are slower than the
    // gearbox output, and this is at most three times as fast as the turbine.
    let pairs: [(Role, Role, &str, f64, f64, &'static str); 4] = [
        (Role::EngineSpeed, Role::TurbineSpeed, "rpm", 0.08, 0.13, "rad/s"),
        (Role::EngineSpeed, Role::TurbineSpeed, "rad/s", 7.5, 12.5, "rpm"),
        (Role::TurbineSpeed, Role::OutputSpeed, "rad/s", 3.2, 20.0, "rpm"),
        (Role::OutputSpeed, Role::WheelSpeed, "rad/s", 1.7, 20.0, "rpm"),
    ];
    for (of, role, unit, minimum, maximum, likely) in pairs {
        let (Some(of), Some(entry)) = (turning(of), turning(role)) else { continue };
        let ratio = entry.extremes.speed() / of.extremes.speed();
        let is_small = maximum < 1.0;
        let may_be = is_small && (seen == Seen::Beginning || creeps(of, role));
        if entry.unit_name == unit && (minimum..maximum).contains(&ratio) && !may_be {
            if let Some(finding) = slow_output(of, entry, summary) {
                findings.push(finding);
                continue;
            }
            let reference = of.name.as_str();
            let why = format!("its maximum value is {ratio:.2} times that of {reference}; it looks like {likely}");
            findings.push(finding(entry, unit, &why, likely));
        }
        if of.extremes.is_forward() && entry.extremes.is_backward() {
            let (name, reference) = (entry.name.clone(), &of.name);
            let message = format!("{name} is negative and {reference} positive: its sign is the other way round");
            findings.push(Finding { role, name, message, likely: Likely::OtherSign });
        }
    }
    findings
}

/// An output speed that is too small, where the wheels seem too fast for it: the turbine, too, is faster than any gear makes it.
fn slow_output(output: &RoleSummary, wheel: &RoleSummary, summary: &[RoleSummary]) -> Option<Finding> {
    const MAX_RATIO: f64 = 6.0;
    let turbine = summary.iter().find(|entry| entry.role == Role::TurbineSpeed)?;
    let [by_wheel, by_turbine] = [wheel, turbine].map(|entry| entry.extremes.speed() / output.extremes.speed());
    let likely = if output.unit_name == "rpm" { "rad/s" } else { "another unit or scale" };
    let (of_wheel, of_turbine) = (&wheel.name, &turbine.name);
    let why = format!(
        "the maximum value of {of_wheel} is {by_wheel:.2} times its own, and that of {of_turbine} {by_turbine:.1} times; it looks like {likely}"
    );
    let is_slow = wheel.role == Role::WheelSpeed && by_turbine > MAX_RATIO;
    is_slow.then(|| finding(output, &output.unit_name, &why, likely))
}

/// A speed that is the same in all samples, while one changes that takes it along.
fn stands_still(entry: &RoleSummary, summary: &[RoleSummary]) -> Option<Finding> {
    let value = Some(entry.extremes.maximum).filter(|_| entry.extremes.stands_still())?;
    let takes_along: &[Role] = match entry.role {
        Role::EngineSpeed => &[Role::TurbineSpeed],
        Role::TurbineSpeed => &[Role::OutputSpeed, Role::WheelSpeed],
        Role::OutputSpeed => &[Role::WheelSpeed],
        Role::WheelSpeed => &[Role::OutputSpeed],
        _ => &[],
    };
    let changes = |other: &&RoleSummary| {
        let Extremes { minimum, maximum, .. } = other.extremes;
        let turns = takes_along.contains(&other.role) && maximum > MOVING_RAD_S;
        let is_coupled = entry.role != Role::EngineSpeed || maximum > COUPLED * value;
        turns && is_coupled && maximum - minimum > FROZEN_CHANGE_FROM_START * maximum
    };
    let other = summary.iter().find(changes)?;
    let (role, name) = (entry.role, entry.name.clone());
    let message = format!("{name} is {value:.3} rad/s in all samples, and {} changes", other.name);
    Some(Finding { role, name, message, likely: Likely::OtherChannel })
}

fn finding(entry: &RoleSummary, found: &str, why: &str, likely: &'static str) -> Finding {
    Finding {
        role: entry.role,
        name: entry.name.clone(),
        message: format!("{} cannot be in {found}: {why}", entry.name),
        likely: Likely::Unit(likely),
    }
}

/// What cannot be right by the values of the signal, and of those of its kind.
fn alone(entry: &RoleSummary, summary: &[RoleSummary], seen: Seen) -> Option<Finding> {
    let middle = entry.extremes.middle()?;
    if entry.role == Role::EngineSpeed && entry.extremes.is_backward() {
        let (role, name) = (entry.role, entry.name.clone());
        let message = format!("{name} is negative: an engine does not turn backwards");
        return Some(Finding { role, name, message, likely: Likely::OtherSign });
    }
    let (size, unit) = (entry.extremes.size(), entry.unit_name.as_str());
    let say = |text: String, likely| Some(finding(entry, unit, &format!("{text}; it looks like {likely}"), likely));
    match entry.role.quantity()? {
        Quantity::Current if unit == "A" && size > 10.0 => say(format!("its maximum value would be {size:.0} A"), "mA"),
        Quantity::Rotation
            if entry.extremes.speed() > 2000.0 || entry.role == Role::EngineSpeed && middle > ENGINE_RAD_S =>
        {
            say(format!("most values would be about {:.0} rpm", rpm(middle)), slower(unit, middle))
        }
        Quantity::Fraction if unit == "1" && size > 1.5 && !is_duty(entry.role) => {
            say(format!("its maximum value is {size:.1}"), "%")
        }
        Quantity::Fraction if unit == "1" && is_duty(entry.role) && size > 150.0 => {
            say(format!("its maximum value is {:.1}", size / 100.0), "%")
        }
        Quantity::Pressure if size > 20e6 => {
            say(format!("its maximum value would be {:.0} MPa", mpa(size)), "a smaller unit (bar, kPa or Pa)")
        }
        Quantity::Velocity if size > 120.0 => {
            say(format!("its maximum value would be {:.0} km/h", 3.6 * size), "a smaller unit (km/h)")
        }
        Quantity::Torque if size > 20e3 => {
            say(format!("its maximum value would be {size:.0} N m"), "a fraction or raw value; give `scale`")
        }
        // What follows is too small, or never of the right sign, which only a whole log shows.
        _ if seen == Seen::Beginning => None,
        // An offset of a command that is off is small.
        Quantity::Current | Quantity::Fraction
            if entry.role.is_command() && entry.extremes.maximum <= 0.0 && entry.extremes.minimum < -0.05 =>
        {
            let message = format!("{} is never positive: its sign is the other way round", entry.name);
            Some(Finding { role: entry.role, name: entry.name.clone(), message, likely: Likely::OtherSign })
        }
        Quantity::Rotation if unit == "rpm" && entry.role == Role::EngineSpeed && size > 2.0 && middle < 42.0 => {
            say(format!("most values would be about {:.0} rpm, below idle", rpm(middle)), "rad/s")
        }
        // That of an element which no shift applies is small in any unit, and the others of its kind tell.
        Quantity::Current | Quantity::Pressure if max_of_kind(entry, summary) > size => None,
        Quantity::Current if unit == "mA" && size < 0.003 => {
            say(format!("its maximum value would be {:.3} mA", 1e3 * size), "A")
        }
        // No other element is measured, and this one may not be applied.
        Quantity::Pressure if entry.role == Role::ElementPressure && !(0.3..100.0).contains(&size) => None,
        Quantity::Pressure if size < 5e3 => {
            say(format!("its maximum value would be {size:.0} Pa"), "a larger unit (kPa, bar or MPa)")
        }
        _ => None,
    }
}

/// The maximum magnitude of a value of this kind in this unit.
fn max_of_kind(entry: &RoleSummary, summary: &[RoleSummary]) -> f64 {
    let of_kind = summary.iter().filter(|other| other.role == entry.role && other.unit_name == entry.unit_name);
    of_kind.map(|other| other.extremes.size()).fold(0.0, f64::max)
}

/// What is likely where speeds are too fast for a car in this unit; of those in Hz the middle one tells, rad/s.
fn slower(unit: &str, middle_rad_s: f64) -> &'static str {
    match unit {
        "rad/s" => "rpm",
        "Hz" if middle_rad_s / std::f64::consts::TAU > ENGINE_RAD_S => "rpm",
        "Hz" => "rad/s",
        _ => "a raw value; give `scale`",
    }
}

fn is_duty(role: Role) -> bool {
    matches!(role, Role::OncomingDuty | Role::OffgoingDuty | Role::ElementDuty)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::QualityCounts;

    fn summary(role: Role, unit_name: &str, values: &[f64]) -> RoleSummary {
        let mut extremes = Extremes::default();
        values.iter().for_each(|value| extremes.push(*value));
        RoleSummary {
            role,
            name: role.name().to_owned(),
            counts: QualityCounts::default(),
            extremes,
            unit_name: unit_name.to_owned(),
            until: 1.0,
        }
    }

    #[test]
    fn what_is_small_may_become_large() {
        // An engine that is cranked, a valve without a command, a turbine that is held.
        let begin = [
            summary(Role::EngineSpeed, "rpm", &[11.3, 11.2]),
            summary(Role::OncomingCurrent, "mA", &[0.0, 0.002]),
            summary(Role::TurbineSpeed, "rpm", &[0.0, 1.2]),
        ];
        assert_eq!(findings(&begin, Seen::Beginning), Vec::new());
        assert_eq!(findings(&begin, Seen::All).len(), 2);
        let amperes = summary(Role::ElementCurrent, "A", &[0.0, 350.0]);
        assert_eq!(findings(&[amperes], Seen::Beginning).len(), 1);
        // 8 mA of noise.
        assert_eq!(findings(&[summary(Role::OncomingCurrent, "mA", &[0.0, 0.008])], Seen::All), Vec::new());
    }

    #[test]
    fn wrong_units_are_named_with_the_likely_one() {
        let cases = [
            // Idle to 4000 rpm, read as rad/s and the other way round.
            (Role::EngineSpeed, "rad/s", vec![800.0, 2000.0, 4000.0], "rpm"),
            (Role::EngineSpeed, "rpm", vec![8.4, 20.0, 44.0], "rad/s"),
            // 80 to 420 rad/s, and 800 to 4000 rpm, both as revolutions per second.
            (Role::EngineSpeed, "Hz", [80.0, 200.0, 420.0].map(|hz| hz * std::f64::consts::TAU).to_vec(), "rad/s"),
            (Role::EngineSpeed, "Hz", [800.0, 2000.0, 4000.0].map(|hz| hz * std::f64::consts::TAU).to_vec(), "rpm"),
            // Quarters of rpm without their scale.
            (Role::EngineSpeed, "rpm", vec![335.0, 838.0, 1676.0], "a raw value; give `scale`"),
            (Role::OncomingCurrent, "A", vec![0.0, 350.0, 900.0], "mA"),
            (Role::OncomingCurrent, "mA", vec![0.0, 0.35e-3, 0.9e-3], "A"),
            (Role::Throttle, "1", vec![0.0, 35.0], "%"),
            (Role::OncomingPressure, "bar", vec![1e5, 900e5 * 10.0], "a smaller unit"),
            (Role::OncomingPressure, "Pa", vec![0.2, 1.1], "a larger unit"),
        ];
        for (role, unit, values, likely) in cases {
            let found = findings(&[summary(role, unit, &values)], Seen::All);
            assert!(found.len() == 1 && found[0].message.contains(&format!("looks like {likely}")), "{found:?}");
        }
    }

    #[test]
    fn fast_slow_and_unused_signals_of_right_units_pass() {
        let of = |role: Role, unit: &str, values: std::ops::Range<u32>, size: f64| {
            summary(role, unit, &values.map(|i| size * f64::from(i)).collect::<Vec<_>>())
        };
        // Full throttle, 4900 to 5990 rpm; above 6000 rpm in the middle it is refused.
        let rpm = std::f64::consts::PI / 30.0;
        for unit in ["rpm", "rad/s"] {
            assert_eq!(findings(&[of(Role::EngineSpeed, unit, 490..599, 10.0 * rpm)], Seen::All), [], "{unit}");
            assert_eq!(findings(&[of(Role::EngineSpeed, unit, 640..700, 10.0 * rpm)], Seen::All).len(), 1, "{unit}");
        }
        // An element that no shift applies beside one that is; all of them together are too small.
        for (role, unit, used, idle) in
            [(Role::ElementCurrent, "mA", 0.8, 0.002), (Role::ElementPressureCommand, "bar", 6e5, 2e3)]
        {
            let log = |maximum: f64| [of(role, unit, 0..100, maximum / 99.0), of(role, unit, 0..100, idle / 99.0)];
            assert_eq!(findings(&log(used), Seen::All), []);
            assert!(!findings(&log(idle), Seen::All).is_empty(), "{role:?}");
        }
        // A car that creeps, 750 and 80 rpm; an accelerator that is hardly pressed.
        let creeping = [of(Role::EngineSpeed, "rpm", 70..79, 1.0), of(Role::TurbineSpeed, "rpm", 0..84, 0.1)];
        assert_eq!(findings(&creeping, Seen::All), []);
        assert_eq!(findings(&[of(Role::Throttle, "%", 0..80, 1e-4)], Seen::All), []);
    }

    #[test]
    fn the_speeds_of_a_car_that_mostly_stands_are_no_wrong_readings() {
        // The first reading of a toothed wheel that begins to turn is of a speed already.
        let log = |fastest: f64| {
            let standing = (0..9500).map(|i| 0.02 * f64::from(i % 11) - 0.1);
            standing.chain((0..500).map(move |i| 40.0 + (fastest - 40.0) * f64::from(i) / 500.0)).collect::<Vec<_>>()
        };
        let [turbine, output] = [(Role::TurbineSpeed, 194.0), (Role::OutputSpeed, 318.0)]
            .map(|(role, fastest)| summary(role, "rad/s", &log(fastest)));
        assert_eq!(findings(&[turbine, output], Seen::All), []);
    }

    #[test]
    fn a_few_wrong_readings_are_no_wrong_unit() {
        let mut speeds: Vec<f64> = (0..200).map(|i| 80.0 + f64::from(i)).collect();
        speeds.extend([2600.0, -4e5]);
        let mut currents = vec![0.0; 500];
        currents.extend((0..200).map(|i| 1e-3 * f64::from(i)));
        currents.extend([65.535, 65.535]);
        let right = [
            summary(Role::EngineSpeed, "rad/s", &speeds),
            summary(Role::TurbineSpeed, "rad/s", &speeds),
            summary(Role::OncomingCurrent, "A", &currents),
        ];
        assert_eq!(findings(&right, Seen::All), []);
        // A sensor that says by 65535 that it has no value, in one of fifty readings; in one of five nothing is known of the unit.
        for (every, are_right) in [(50, true), (5, false)] {
            let speeds: Vec<f64> =
                (0..1000_u32).map(|i| if i % every == 0 { 65535.0 } else { 80.0 + 0.4 * f64::from(i) }).collect();
            for (role, unit) in [Role::EngineSpeed, Role::TurbineSpeed, Role::WheelSpeed].map(|role| (role, "rad/s")) {
                assert_eq!(findings(&[summary(role, unit, &speeds)], Seen::All).is_empty(), are_right, "{role:?}");
            }
        }
        // One reading does not turn a sign, be the other ones large or small.
        for maximum in [20.0, 600.0] {
            let mut speeds: Vec<f64> = (0..400).map(|i| maximum * f64::from(i) / 400.0).collect();
            let good = speeds.clone();
            speeds[200] = -1e300;
            let of = |values: &[f64]| {
                [summary(Role::TurbineSpeed, "rad/s", &good), summary(Role::OutputSpeed, "rad/s", values)]
            };
            assert_eq!(findings(&of(&speeds), Seen::All), []);
            let backward: Vec<f64> = good.iter().map(|speed| -speed).collect();
            assert_eq!(findings(&of(&backward), Seen::All).len(), usize::from(maximum > SMALL_RAD_S));
        }
    }

    #[test]
    fn right_units_pass() {
        let fine = [
            summary(Role::EngineSpeed, "rad/s", &[70.0, 200.0, 680.0]),
            summary(Role::EngineSpeed, "rpm", &[60.0, 70.0, 90.0]),
            summary(Role::TurbineSpeed, "rpm", &[0.0, 10.0, 300.0]),
            summary(Role::OncomingCurrent, "A", &[0.0, 0.2, 1.1]),
            summary(Role::OncomingDuty, "%", &[0.0, 45.0]),
            summary(Role::Throttle, "%", &[0.0, 0.14]),
            summary(Role::OncomingPressure, "bar", &[0.0, 1.6e6]),
            summary(Role::OncomingCurrent, "A", &[0.0]),
            summary(Role::OncomingCurrent, "A", &[-0.002, -0.001]),
            summary(Role::Throttle, "1", &[-0.2]),
        ];
        for entry in fine {
            assert_eq!(findings(std::slice::from_ref(&entry), Seen::All), Vec::new());
        }
    }

    #[test]
    fn a_speed_that_never_changes_while_its_shaft_must_turn_is_found() {
        let log = |still: Option<Role>, value: f64| {
            let speeds = [Role::EngineSpeed, Role::TurbineSpeed, Role::OutputSpeed, Role::WheelSpeed].map(|role| {
                let values: Vec<f64> = (0..200_u32).map(|i| 100.0 + f64::from(i)).collect();
                let stands = [value; 200];
                summary(role, "rad/s", if still == Some(role) { &stands } else { &values })
            });
            findings(&speeds, Seen::All).into_iter().map(|found| (found.role, found.likely)).collect::<Vec<_>>()
        };
        assert_eq!(log(None, 0.0), Vec::new());
        for role in [Role::EngineSpeed, Role::TurbineSpeed, Role::OutputSpeed, Role::WheelSpeed] {
            assert!(log(Some(role), 180.0).contains(&(role, Likely::OtherChannel)), "{role:?}");
        }
        // An engine that turns faster than the turbine can do so at one speed.
        assert_eq!(log(Some(Role::EngineSpeed), 400.0), Vec::new());
        let few = [(Role::TurbineSpeed, [180.0; 3]), (Role::OutputSpeed, [100.0, 200.0, 300.0])];
        assert_eq!(findings(&few.map(|(role, values)| summary(role, "rad/s", &values)), Seen::All), Vec::new());
    }

    #[test]
    fn a_shaft_in_another_unit_than_the_one_before_it_is_found() {
        let speeds = [
            (Role::EngineSpeed, 400.0),
            (Role::TurbineSpeed, 390.0),
            (Role::OutputSpeed, 330.0),
            (Role::WheelSpeed, 100.0),
        ];
        let log = |unit: &str, wrong: Option<(Role, f64)>| {
            let value = |role, value| value * wrong.filter(|wrong| wrong.0 == role).map_or(1.0, |wrong| wrong.1);
            findings(
                &speeds.map(|(role, maximum)| {
                    summary(role, unit, &[0.0, 0.2 * value(role, maximum), value(role, maximum)])
                }),
                Seen::All,
            )
        };
        let rpm = 30.0 / std::f64::consts::PI;
        for (unit, role, factor, likely) in [
            ("rpm", Role::TurbineSpeed, 1.0 / rpm, "rad/s"),
            ("rad/s", Role::TurbineSpeed, 9.0, "rpm"),
            ("rad/s", Role::OutputSpeed, 6.0, "rpm"),
            ("rad/s", Role::WheelSpeed, rpm, "rpm"),
        ] {
            let found = log(unit, Some((role, factor)));
            assert!(
                found.iter().any(|found| found.role == role && found.likely == Likely::Unit(likely)),
                "{role:?}: {found:?}"
            );
        }
        assert_eq!((log("rad/s", None), log("rpm", None)), (Vec::new(), Vec::new()));
        let found = log("rad/s", Some((Role::OutputSpeed, -1.0)));
        assert_eq!((found[0].role, found[0].likely), (Role::OutputSpeed, Likely::OtherSign));
        let found = log("rad/s", Some((Role::EngineSpeed, -1.0)));
        assert_eq!((found[0].role, found[0].likely), (Role::EngineSpeed, Likely::OtherSign));
    }
}
