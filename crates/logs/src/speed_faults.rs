//! Speeds that no shaft has: of a sensor that times out and reads zero, and of a channel that shows another speed.
//!
//! A shaft passes every speed between two others, and it takes torque and time. A reading is a fault
//!
//! - if it is further from the last one that was believed than the shaft's largest acceleration allows in the time between them, or
//! - if it fell to a tenth of that and less while another speed shows that the shaft turns, or
//! - if it came by a jump to the value of another speed: two sensors of two shafts do not agree by a jump, or
//! - if output and wheel speed, which the final drive ties, part, or
//! - if it stays at zero while another speed shows for some time that the shaft turns fast, as where a sensor died at a standstill.
//!
//! A fault lasts until the readings are those of the shaft again, and for [`LONGEST_S`] at most: what lasts longer is how the log goes on,
//! as where two recordings are joined. A turbine that shows the output speed is believed again as soon as a shift into the direct gear may have
//! brought it there, in a gearbox that has one and from a ratio next to it. Only a zero stays a fault for as long as the other speeds contradict
//! it. The accelerations are bounds for every car, and a fall at low speed, where sensors of toothed wheels rightly read zero, is none.

use crate::Role;

/// A fault that the other speeds do not contradict ends after so long, s \[chosen\].
pub const LONGEST_S: f64 = 2.5;
/// A reading older than this is no evidence against another, s.
const FRESH_S: f64 = 0.25;
/// A table holds a slow channel for up to so long: the shaft may have changed since the value came, s.
const HELD_S: f64 = 0.1;
/// A speed that another one contradicts falls at once if it does so within this time, s: rows at 10 Hz.
const AT_ONCE_S: f64 = 0.15;
/// Fraction of the last believed speed below which a speed fell, and size below which it is zero, rad/s.
const FELL: f64 = 0.1;
const ZERO_RAD_S: f64 = 1.0;
/// Differences within which a reading is that of another speed, relative and rad/s: both channels may be one row apart, and a sensor has noise.
const ANOTHER: f64 = 0.01;
const ANOTHER_RAD_S: f64 = 0.5;
/// How many times as much they may differ as long as it lasts.
const STILL_ANOTHER: f64 = 4.0;
/// Engine and turbine that were one shaft not longer ago than this may be so again, s: behind a lock-up clutch, or without a converter.
const TOGETHER_S: f64 = 5.0;
/// Change by which a speed jumps to the value of another one: by rate, rad/s^2, and at once, rad/s \[chosen\]. A turbine that a clutch
/// brings to the speed of the output does so by some 1000 rad/s^2.
const TO_ANOTHER: (f64, f64) = (1000.0, 5.0);
/// A shift brings the turbine to the speed of the output, where the new gear is the direct one: at the lowest rate of an inertia phase, rad/s^2,
/// and the engine goes along by this fraction at least, for so long, s, after which the inertia phase is over \[chosen\].
const SHIFTS_RAD_S2: f64 = 300.0;
const GOES_ALONG: f64 = 0.5;
const GONE_S: f64 = 0.15;
/// By this fraction the ratio of two readings may differ from that of the gear: noise, and shafts that twist.
const BESIDE_GEAR: f64 = 0.02;
/// Factors beyond which output over wheel speed has parted from what it was: readings that are 50 ms apart differ by less.
const PARTED: std::ops::Range<f64> = 0.6..1.6;
/// The ratio of both is remembered so often, s: more rarely than readings are withdrawn afterwards.
const RATIO_S: f64 = 0.6;
/// Faster than any shaft of a car, rad/s: not taken as a speed at all.
const MAX_RAD_S: f64 = 1500.0;
/// How long another speed contradicts one that stands at zero before it is a fault, s, and by how many times the speed up to which a sensor may
/// read zero \[chosen\]: the sensor of a shaft that begins to turn wakes up late.
const STANDS_S: f64 = 0.3;
const AWAKE: f64 = 3.0;
/// Speed of an engine that runs, rad/s.
const RUNS_RAD_S: f64 = 50.0;

const ENGINE: usize = Role::EngineSpeed as usize;
const TURBINE: usize = Role::TurbineSpeed as usize;
const OUTPUT: usize = Role::OutputSpeed as usize;
const WHEEL: usize = Role::WheelSpeed as usize;
const WATCHED: usize = 4;

/// Largest acceleration of each shaft, rad/s^2, and speed up to which its sensor may read zero or wake up, rad/s \[chosen\]. An engine or a
/// turbine of 0.1 kg m^2 has 3000 rad/s^2 by 300 N m; a locked brake stops a wheel of 2 kg m^2 by 1000 rad/s^2 with 2000 N m.
const SHAFTS: [(f64, f64); WATCHED] = [(3000.0, 40.0), (3000.0, 40.0), (1000.0, 10.0), (1000.0, 4.0)];

/// Watches engine, turbine, output and wheel speed.
#[derive(Debug, Clone, Copy)]
pub struct SpeedFaults {
    believed: [Option<Believed>; WATCHED],
    faults: [Option<Fault>; WATCHED],
    /// Output over wheel speed when both were last believed; not a number before.
    output_over_wheel: f64,
    /// The same at two earlier times.
    ratios: [Ratio; 2],
    /// When engine and turbine had the same speed last, s.
    together_s: f64,
    /// Since when a speed stands at zero against the others, s.
    stands_since_s: [Option<f64>; WATCHED],
    into_direct: IntoDirect,
}

/// The ratios of turbine over output speed that a shift into the direct gear passes: those between the gears next to it. Empty in a gearbox
/// without a direct gear.
#[derive(Debug, Clone, Copy)]
struct IntoDirect {
    from: f64,
    to: f64,
}

impl IntoDirect {
    /// Of a gearbox whose gears are not known.
    const ANY: Self = Self { from: 0.0, to: f64::INFINITY };

    /// Of a gearbox with gears of these ratios; without any they are not known.
    fn of(ratios: &[f64]) -> Self {
        if ratios.is_empty() {
            return Self::ANY;
        }
        if !ratios.iter().any(|ratio| is_direct(*ratio)) {
            return Self { from: f64::INFINITY, to: 0.0 };
        }
        let others = || ratios.iter().copied().filter(|ratio| *ratio > 0.0 && !is_direct(*ratio));
        let below = others().filter(|ratio| *ratio < 1.0).fold(Self::ANY.from, f64::max);
        let above = others().filter(|ratio| *ratio > 1.0).fold(Self::ANY.to, f64::min);
        Self { from: below * (1.0 - BESIDE_GEAR), to: above * (1.0 + BESIDE_GEAR) }
    }

    /// Whether a shift at this ratio may go there.
    fn contains(self, ratio: f64) -> bool {
        (self.from..=self.to).contains(&ratio)
    }
}

/// Whether turbine and output have one speed in a gear, as far as two readings tell.
fn is_direct(ratio: f64) -> bool {
    (ratio - 1.0).abs() <= STILL_ANOTHER * ANOTHER
}

/// A fault of a speed.
#[derive(Debug, Clone, Copy)]
struct Fault {
    since_s: f64,
    /// The speed whose value it began with, if it did.
    another: Option<usize>,
    /// The engine speed then, rad/s.
    engine_rad_s: Option<f64>,
    /// The last speed that was believed over the first reading that was not.
    ratio: f64,
    /// Since when a shift may have brought the turbine to the speed of the output, s; not a number before.
    shifted_since_s: f64,
}

/// Output over wheel speed, and when it was read, s.
#[derive(Debug, Clone, Copy)]
struct Ratio {
    value: f64,
    time_s: f64,
}

/// The last reading of a speed that was believed.
#[derive(Debug, Clone, Copy)]
struct Believed {
    rad_s: f64,
    /// When it came last, and when it came first with this value, s.
    time_s: f64,
    first_s: f64,
}

impl SpeedFaults {
    /// Before the first readings, of a gearbox whose gears are not known.
    pub fn new() -> Self {
        Self::with(IntoDirect::ANY)
    }

    /// Before the first readings, of a gearbox with gears of these ratios, turbine over output speed; without any they are not known.
    pub fn of_gearbox(ratios: &[f64]) -> Self {
        Self::with(IntoDirect::of(ratios))
    }

    fn with(into_direct: IntoDirect) -> Self {
        Self {
            believed: [None; WATCHED],
            faults: [None; WATCHED],
            output_over_wheel: f64::NAN,
            ratios: [Ratio { value: f64::NAN, time_s: f64::NEG_INFINITY }; 2],
            together_s: f64::NEG_INFINITY,
            stands_since_s: [None; WATCHED],
            into_direct,
        }
    }

    /// Whether the next reading of a speed, in rad/s, is a fault; never of a role that is not watched.
    pub fn is_fault(&mut self, role: Role, rad_s: f64, time_s: f64) -> bool {
        let at = role as usize;
        // What is no number, or no speed at all, is refused elsewhere.
        if at >= WATCHED || rad_s.is_nan() || rad_s.abs() > MAX_RAD_S {
            return false;
        }
        if self.believed.iter().flatten().any(|believed| time_s < believed.time_s - FRESH_S) {
            // The clock began anew.
            *self = Self::with(self.into_direct);
        }
        let stands = self.stands(at, rad_s, time_s);
        let is_fault = self.believed[at].is_some_and(|before| match self.faults[at] {
            None => stands || self.begins(at, before, rad_s, time_s),
            Some(_) if stands => true,
            Some(fault) => self.lasts(at, before, rad_s, (fault, time_s)),
        });
        if is_fault {
            let another = self.another(at, rad_s, time_s);
            let engine_rad_s = self.turning(ENGINE, time_s);
            let ratio = self.believed[at].map_or(f64::NAN, |before| before.rad_s / rad_s);
            let begun = Fault { since_s: time_s, another, engine_rad_s, ratio, shifted_since_s: f64::NAN };
            let fault = *self.faults[at].get_or_insert(begun);
            let shifts = self.believed[at].is_some_and(|before| self.may_shift(before, rad_s, (fault, time_s)));
            let shifted_since_s = match fault.shifted_since_s {
                since_s if shifts && !since_s.is_nan() => since_s,
                _ if shifts => time_s,
                _ => f64::NAN,
            };
            self.faults[at] = Some(Fault { shifted_since_s, ..fault });
        } else {
            self.believe(at, rad_s, time_s);
        }
        is_fault
    }

    /// The readings of a speed after this one, which came at this time, s, turned out to be wrong.
    pub fn disbelieve_after(&mut self, role: Role, rad_s: f64, time_s: f64) {
        if let Some(believed) = self.believed.get_mut(role as usize) {
            *believed = Some(Believed { rad_s, time_s, first_s: time_s });
            self.faults[role as usize] = None;
        }
        if matches!(role, Role::OutputSpeed | Role::WheelSpeed) {
            // The ratio of both may be that of a wrong reading.
            let [before, latest] = &mut self.ratios;
            if latest.time_s > time_s {
                *latest = *before;
            }
            self.output_over_wheel = latest.value;
        }
    }

    fn believe(&mut self, at: usize, rad_s: f64, time_s: f64) {
        let before = self.believed[at].filter(|before| before.rad_s == rad_s);
        let first_s = before.map_or(time_s, |before| before.first_s);
        self.believed[at] = Some(Believed { rad_s, time_s, first_s });
        self.faults[at] = None;
        if (at == ENGINE && self.shows(TURBINE, rad_s, time_s)) || (at == TURBINE && self.shows(ENGINE, rad_s, time_s))
        {
            self.together_s = time_s;
        }
        if let (OUTPUT | WHEEL, Some(output), Some(wheel)) =
            (at, self.turning(OUTPUT, time_s), self.turning(WHEEL, time_s))
        {
            let value = output / wheel;
            self.output_over_wheel = value;
            if time_s - self.ratios[1].time_s > RATIO_S {
                self.ratios = [self.ratios[1], Ratio { value, time_s }];
            }
        }
    }

    /// Whether a fault begins with a reading.
    fn begins(&self, at: usize, before: Believed, rad_s: f64, time_s: f64) -> bool {
        let change = (rad_s - before.rad_s).abs();
        let (_, min_rad_s) = SHAFTS[at];
        let fell = rad_s.abs() <= FELL * before.rad_s.abs() && before.rad_s.abs() > min_rad_s;
        let is_sudden = time_s - before.time_s <= AT_ONCE_S && fell;
        let (rate, at_once) = TO_ANOTHER;
        let to_another = change > rate * before.passed_s(time_s) + at_once && self.another(at, rad_s, time_s).is_some();
        jumps(at, before, rad_s, time_s)
            || (is_sudden && self.is_contradicted(at, before, time_s))
            || to_another
            || self.parts(at, rad_s, time_s)
    }

    /// Whether a fault goes on with a reading.
    fn lasts(&self, at: usize, before: Believed, rad_s: f64, (fault, time_s): (Fault, f64)) -> bool {
        let fell = rad_s.abs() <= FELL * before.rad_s.abs();
        let is_short = time_s - fault.since_s <= LONGEST_S;
        let shows_another = fault.another.is_some_and(|another| self.is_near(STILL_ANOTHER, another, rad_s, time_s))
            && !((at, fault.another) == (TURBINE, Some(OUTPUT)) && time_s - fault.shifted_since_s >= GONE_S);
        let is_wrong = || jumps(at, before, rad_s, time_s) || fell || shows_another || self.parts(at, rad_s, time_s);
        let is_dead = || rad_s.abs() <= ZERO_RAD_S && fell && self.is_contradicted(at, before, time_s);
        (is_short && is_wrong()) || is_dead()
    }

    /// Whether a shift may have brought the turbine to this speed since it was believed last: it was on the way to the direct gear, there was time
    /// for it, and the engine went along.
    fn may_shift(&self, before: Believed, rad_s: f64, (fault, time_s): (Fault, f64)) -> bool {
        let change = rad_s - before.rad_s;
        let engine = fault.engine_rad_s.zip(self.turning(ENGINE, time_s)).map(|(then, now)| now - then);
        let goes_along = engine.is_some_and(|engine| engine * change.signum() > GOES_ALONG * change.abs());
        self.into_direct.contains(fault.ratio) && goes_along && SHIFTS_RAD_S2 * (time_s - before.time_s) > change.abs()
    }

    /// Whether a reading is zero, as those before it, while the others have shown for some time that the shaft turns.
    fn stands(&mut self, at: usize, rad_s: f64, time_s: f64) -> bool {
        let turns = |other: usize| {
            let (_, min_rad_s) = SHAFTS[other];
            self.turning(other, time_s).is_some_and(|speed| speed.abs() > AWAKE * min_rad_s)
        };
        let is_contradicted = match at {
            ENGINE => turns(TURBINE),
            TURBINE => turns(OUTPUT) && turns(ENGINE),
            OUTPUT => turns(WHEEL),
            _ => turns(OUTPUT),
        };
        let is_zero = rad_s.abs() <= ZERO_RAD_S && is_contradicted;
        self.stands_since_s[at] = is_zero.then(|| self.stands_since_s[at].unwrap_or(time_s));
        self.stands_since_s[at].is_some_and(|since_s| time_s - since_s >= STANDS_S)
    }

    /// A speed that was believed of late and is away from zero, rad/s.
    fn turning(&self, at: usize, time_s: f64) -> Option<f64> {
        let (_, min_rad_s) = SHAFTS[at];
        let fresh = self.believed[at].filter(|believed| time_s - believed.time_s <= FRESH_S)?;
        Some(fresh.rad_s).filter(|rad_s| rad_s.abs() > min_rad_s)
    }

    /// Whether the other speeds show that this shaft turns.
    fn is_contradicted(&self, at: usize, before: Believed, time_s: f64) -> bool {
        let turns =
            |other: usize, from_rad_s: f64| self.turning(other, time_s).is_some_and(|speed| speed.abs() >= from_rad_s);
        match at {
            // The converter takes it along.
            ENGINE => turns(TURBINE, 0.5 * before.rad_s.abs()),
            // In a gear the car turns it, in neutral the engine.
            TURBINE => turns(OUTPUT, 0.0) && turns(ENGINE, RUNS_RAD_S),
            OUTPUT => turns(WHEEL, 0.0),
            _ => turns(OUTPUT, 0.0),
        }
    }

    /// The speed whose value a reading has, if they are not one shaft.
    fn another(&self, at: usize, rad_s: f64, time_s: f64) -> Option<usize> {
        let is_one_shaft = |other: usize| at.max(other) == TURBINE && time_s - self.together_s <= TOGETHER_S;
        (0..WATCHED).find(|&other| other != at && !is_one_shaft(other) && self.shows(other, rad_s, time_s))
    }

    /// Whether a reading has the value of this speed.
    fn shows(&self, other: usize, rad_s: f64, time_s: f64) -> bool {
        self.is_near(1.0, other, rad_s, time_s)
    }

    fn is_near(&self, times: f64, other: usize, rad_s: f64, time_s: f64) -> bool {
        let near = |other: f64| (rad_s - other).abs() <= times * ANOTHER_RAD_S.max(ANOTHER * other.abs());
        self.turning(other, time_s).is_some_and(near)
    }

    /// Whether output and wheel speed part by a reading of one of them.
    fn parts(&self, at: usize, rad_s: f64, time_s: f64) -> bool {
        let ratio = match at {
            OUTPUT => self.turning(WHEEL, time_s).map(|wheel| rad_s / wheel),
            WHEEL => self.turning(OUTPUT, time_s).map(|output| output / rad_s),
            _ => None,
        };
        ratio.is_some_and(|ratio| {
            let change = ratio / self.output_over_wheel;
            !change.is_nan() && !PARTED.contains(&change)
        })
    }
}

impl Default for SpeedFaults {
    fn default() -> Self {
        Self::new()
    }
}

impl Believed {
    /// Time in which the shaft may have changed, s.
    fn passed_s(&self, time_s: f64) -> f64 {
        (time_s - self.first_s.max(self.time_s - HELD_S)).max(0.0)
    }
}

/// Whether a reading is further from the believed one before than its shaft can have come.
fn jumps(at: usize, before: Believed, rad_s: f64, time_s: f64) -> bool {
    let (rate, at_once) = SHAFTS[at];
    (rad_s - before.rad_s).abs() > rate * before.passed_s(time_s) + at_once
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROLES: [Role; WATCHED] = [Role::EngineSpeed, Role::TurbineSpeed, Role::OutputSpeed, Role::WheelSpeed];

    /// The speeds of a car that accelerates in a gear of ratio 1.6, with a slipping converter and a final ratio of 3.5.
    fn in_gear(time_s: f64) -> [f64; WATCHED] {
        let output = 100.0 + 8.0 * time_s;
        [1.7 * output, 1.6 * output, output, output / 3.5]
    }

    /// Times of the rows in which a speed is a fault, by speed, of six seconds with this time between rows.
    fn faults(step_s: f64, speeds: impl Fn(f64) -> [f64; WATCHED]) -> [Vec<f64>; WATCHED] {
        let mut watch = SpeedFaults::new();
        let mut rows: [Vec<f64>; WATCHED] = Default::default();
        for row in (0_u32..).take_while(|row| f64::from(*row) * step_s < 6.0) {
            let time_s = f64::from(row) * step_s;
            for (at, speed) in speeds(time_s).into_iter().enumerate() {
                if watch.is_fault(ROLES[at], speed, time_s) {
                    rows[at].push(time_s);
                }
            }
        }
        rows
    }

    #[test]
    fn a_speed_that_reads_zero_while_the_car_drives_is_a_fault_until_it_is_back() {
        for step_s in [0.001, 0.01, 0.02, 0.05, 0.1] {
            for (at, length_s) in (0..WATCHED).flat_map(|at| [0.1, 0.5, 2.0].map(|length_s| (at, length_s))) {
                let is_out = |time_s: f64| time_s > 1.0 && time_s < 1.0 + length_s;
                for zero in [0.0, 0.5, -0.3] {
                    let found = faults(step_s, |time_s| {
                        let mut speeds = in_gear(time_s);
                        if is_out(time_s) {
                            speeds[at] = zero;
                        }
                        speeds
                    });
                    for (other, rows) in found.iter().enumerate() {
                        assert!(
                            rows.iter().all(|time_s| other == at && is_out(*time_s)),
                            "{at} {other} {step_s}: {rows:?}"
                        );
                    }
                    let all = (0..).map(|i| step_s * f64::from(i)).take_while(|time_s| *time_s < 6.0);
                    let all = all.filter(|time_s| is_out(*time_s)).count();
                    assert_eq!(found[at].len(), all, "{at} {step_s} {length_s}");
                }
            }
        }
    }

    #[test]
    fn a_sensor_that_is_dead_from_a_standstill_on_is_a_fault_once_the_car_drives() {
        for at in 0..WATCHED {
            for step_s in [0.01, 0.05] {
                let found = faults(step_s, |time_s| {
                    // From rest, after half a second of idling.
                    let output = 40.0 * (time_s - 0.5).max(0.0);
                    let mut speeds = [80.0_f64.max(1.7 * output), 1.6 * output, output, output / 3.5];
                    speeds[at] = 0.0;
                    speeds
                });
                let first_s = found[at].first().copied().unwrap_or(f64::INFINITY);
                assert!(first_s < 3.0, "{at} {step_s}: {first_s}");
                // And from then on without a gap.
                let count = found[at].len() as f64;
                assert!((count * step_s - (6.0 - first_s)).abs() < 2.0 * step_s, "{at} {step_s}: {count}");
                assert!((0..WATCHED).all(|speed| speed == at || found[speed].is_empty()), "{at}: {found:?}");
            }
        }
    }

    #[test]
    fn a_speed_that_was_zero_is_believed_again_in_the_direct_gear() {
        for at in [TURBINE, OUTPUT] {
            let found = faults(0.01, |time_s| {
                let mut speeds = in_gear(time_s);
                if time_s > 2.0 {
                    speeds[TURBINE] = speeds[OUTPUT];
                }
                if time_s > 1.0 && time_s < 2.5 {
                    speeds[at] = 0.0;
                }
                speeds
            });
            assert!(
                found[at].len() >= 149 && found[at].iter().all(|time_s| *time_s < 2.5),
                "{at}: {:?}",
                found[at].last()
            );
        }
    }

    #[test]
    fn a_turbine_that_showed_the_output_is_believed_where_it_turns_with_the_engine() {
        let found = faults(0.01, |time_s| {
            let [_, turbine, output, wheel] = in_gear(time_s);
            // The converter is locked, or there is none.
            [turbine, if time_s > 1.0 && time_s < 1.5 { output } else { turbine }, output, wheel]
        });
        assert!((48..=50).contains(&found[TURBINE].len()), "{:?}", found[TURBINE].last());
    }

    #[test]
    fn a_fall_over_some_rows_is_a_fault_as_a_fall_at_once() {
        for at in 0..WATCHED {
            let found = faults(0.01, |time_s| {
                let mut speeds = in_gear(time_s);
                let rows = ((time_s - 1.0) / 0.01).round();
                speeds[at] *= match rows {
                    0.0 => 0.5,
                    1.0 => 0.2,
                    rows if (2.0..100.0).contains(&rows) => 0.0,
                    _ => 1.0,
                };
                speeds
            });
            assert!(found[at].len() >= 100, "{at}: {}", found[at].len());
        }
    }

    #[test]
    fn a_channel_that_shows_the_speed_next_to_it_is_a_fault() {
        for (at, other) in [(ENGINE, OUTPUT), (TURBINE, OUTPUT), (OUTPUT, TURBINE), (OUTPUT, WHEEL), (WHEEL, OUTPUT)] {
            for step_s in [0.001, 0.01, 0.02] {
                let found = faults(step_s, |time_s| {
                    let mut speeds = in_gear(time_s);
                    if time_s > 1.0 && time_s < 2.5 {
                        speeds[at] = speeds[other];
                    }
                    speeds
                });
                let rows = 1.5 / step_s;
                let count = found[at].len() as f64;
                assert!(count >= rows - 2.0 && count <= rows, "{at} {other} {step_s}: {count}");
                assert!((0..WATCHED).all(|speed| speed == at || found[speed].is_empty()), "{at} {other}: {found:?}");
            }
        }
    }

    #[test]
    fn a_turbine_that_shows_the_output_is_believed_once_a_shift_into_the_direct_gear_may_have_brought_it_there() {
        let shift = |begin_s: f64, end_s: f64| {
            faults(0.01, |time_s| {
                let [_, _, output, wheel] = in_gear(time_s);
                let slips = 1.0 - ((time_s - begin_s) / (end_s - begin_s)).clamp(0.0, 1.0);
                let turbine = output * (1.0 + 1.5 * slips);
                let is_wrong = time_s > 2.0 && time_s < 2.5;
                [turbine + 30.0, if is_wrong { output } else { turbine }, output, wheel]
            })
        };
        // The shift ends while the turbine is wrong: what it reads at the end and afterwards is right.
        let [engine, turbine, output, wheel] = shift(1.9, 2.3);
        assert!(engine.is_empty() && output.is_empty() && wheel.is_empty());
        assert!(turbine.len() >= 30 && turbine.iter().all(|time_s| *time_s < 2.51 + GONE_S), "{turbine:?}");
        // No shift: the engine does not go along.
        let [_, turbine, ..] = shift(5.0, 5.5);
        assert!((48..=50).contains(&turbine.len()), "{turbine:?}");
    }

    #[test]
    fn a_turbine_that_shows_the_output_in_a_shift_is_believed_again_only_where_the_shift_goes_to_the_direct_gear() {
        // The engine goes along, and the shift is over before the turbine is right again.
        let rows = |ratios: &[f64], [before, after]: [f64; 2]| {
            let mut watch = SpeedFaults::of_gearbox(ratios);
            let is_fault = |row: u32| {
                let time_s = 0.01 * f64::from(row);
                let output = 100.0 + 5.0 * time_s;
                let shifted = ((time_s - 1.0) / 0.5).clamp(0.0, 1.0);
                let turbine = output * (before + (after - before) * shifted);
                let shown = if time_s > 1.05 && time_s < 3.0 { output } else { turbine };
                let speeds = ROLES.into_iter().zip([turbine + 20.0, shown, output, output / 3.5]);
                speeds.filter(|(role, speed)| watch.is_fault(*role, *speed, time_s)).count()
            };
            (0..500).map(is_fault).sum::<usize>()
        };
        let (without, with) = ([4.17, 2.34, 1.52, 1.14, 0.87, 0.69], [4.7, 3.13, 2.1, 1.67, 1.28, 1.0, 0.84, 0.67]);
        assert_eq!(rows(&without, [2.34, 1.52]), 194);
        assert_eq!(rows(&with, [2.1, 1.67]), 194);
        assert!(rows(&with, [1.28, 1.0]) < 60);
        assert!(rows(&[], [2.34, 1.52]) < 194);
    }

    #[test]
    fn a_turbine_without_a_converter_that_shows_a_slow_output_is_a_fault_and_so_are_no_right_readings() {
        let noise = |factor: f64, time_s: f64| 0.3 * (factor * time_s).sin();
        let found = faults(0.01, |time_s| {
            let [engine, turbine, output] = [731.0, 517.0, 977.0].map(|factor| noise(factor, time_s));
            let shown = if time_s > 1.0 && time_s < 1.2 { 21.0 + output } else { 97.0 + turbine };
            [97.0 + engine, shown, 21.0 + output, 21.0 / 3.5]
        });
        assert!((18..=20).contains(&found[TURBINE].len()), "{:?}", found[TURBINE]);
        assert!([ENGINE, OUTPUT, WHEEL].iter().all(|at| found[*at].is_empty()), "{found:?}");
    }

    #[test]
    fn a_zero_without_end_is_a_fault_while_the_other_speeds_contradict_it() {
        for at in [TURBINE, OUTPUT, WHEEL] {
            let found = faults(0.01, |time_s| {
                let mut speeds = in_gear(time_s);
                if time_s > 1.0 {
                    speeds[at] = 0.0;
                }
                speeds
            });
            assert!(found[at].len() >= 498, "{at}: {}", found[at].len());
        }
    }

    #[test]
    fn a_car_that_stops_an_engine_that_stalls_and_a_hard_shift_are_no_faults() {
        let stops = |time_s: f64| {
            // 11 m/s^2 on the wheels of 0.3 m; sensors read zero below 2 rad/s of the wheel.
            let wheel = (70.0 - 37.0 * time_s).max(0.0);
            let wheel = if wheel < 2.0 { 0.0 } else { wheel };
            let turbine = 3.5 * 4.7 * wheel;
            [turbine.max(80.0), turbine, 3.5 * wheel, wheel]
        };
        let stalls = |time_s: f64| {
            let engine = (90.0 - 900.0 * (time_s - 1.0).max(0.0)).max(0.0);
            [engine, 0.0, 0.0, 0.0]
        };
        // Down in 60 ms, with slip zero in one row.
        let grips = |time_s: f64| {
            let output = 100.0 + 5.0 * time_s;
            let slip = (1.6 * output - output) * (1.0 - (time_s - 1.0).clamp(0.0, 0.06) / 0.06);
            [1.7 * output, output + slip, output, output / 3.5]
        };
        let locks = |time_s: f64| {
            let locked = (time_s - 1.0).clamp(0.0, 0.07) / 0.07;
            let wheel = if time_s < 2.0 { 60.0 * (1.0 - locked) } else { 60.0 };
            [200.0, 200.0, 3.5 * wheel, wheel]
        };
        let neutral = |time_s: f64| [80.0, if time_s > 1.0 { 80.0 } else { 0.0_f64.max(80.0 * time_s) }, 0.0, 0.0];
        for step_s in [0.001, 0.005, 0.01, 0.02] {
            assert!(faults(step_s, stops).iter().all(Vec::is_empty), "stops {step_s}");
            assert!(faults(step_s, stalls).iter().all(Vec::is_empty), "stalls {step_s}");
            assert!(faults(step_s, grips).iter().all(Vec::is_empty), "grips {step_s}");
            assert!(faults(step_s, neutral).iter().all(Vec::is_empty), "neutral {step_s}");
            let [engine, turbine, ..] = faults(step_s, locks);
            assert!(engine.is_empty() && turbine.is_empty(), "locks {step_s}");
        }
    }

    #[test]
    fn two_recordings_that_are_joined_go_on_after_the_longest_fault() {
        let joined = |time_s: f64| if time_s < 1.0 { in_gear(time_s) } else { [80.0, 0.0, 0.0, 0.0] };
        for (at, rows) in faults(0.01, joined).iter().enumerate() {
            assert!(rows.last().is_none_or(|last_s| *last_s < 1.0 + LONGEST_S + 0.02), "{at}: {:?}", rows.last());
        }
        // A clock that begins anew is another log.
        let mut watch = SpeedFaults::new();
        assert!(!watch.is_fault(Role::OutputSpeed, 100.0, 10.0));
        assert!(!watch.is_fault(Role::OutputSpeed, 0.0, 0.0));
    }

    #[test]
    fn what_is_no_speed_is_left_to_others_and_believed_by_none() {
        let mut watch = SpeedFaults::new();
        for (row, value) in (0_u32..).zip([16_383.75, f64::NAN, f64::INFINITY, 100.0, 100.5, 16_383.75, 101.0]) {
            assert!(!watch.is_fault(Role::TurbineSpeed, value, 0.01 * f64::from(row)), "{value}");
        }
        assert!(!watch.is_fault(Role::VehicleSpeed, 0.0, 0.1) && !watch.is_fault(Role::Gear, 5.0, 0.1));
    }
}
