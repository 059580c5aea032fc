//! Speeds that no shaft has: of a sensor that times out and reads zero, and of a channel that shows another speed.
//!
//! A shaft passes every speed between two others, and it takes torque and time. A reading is a fault
//!
//! - if it is further from the last one that was believed than the shaft's largest acceleration allows in the time between them, also for as long
//!   as the readings go on from there, until they jump back, or
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
use crate::copies::Stamped;

/// A fault that the other speeds do not contradict ends after so long, s \[chosen\].
pub const LONGEST_S: f64 = 2.5;
/// What jumped is back when it comes by this fraction of that at once.
const RETURNED: f64 = 0.5;
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
/// Time constant of an acceleration, s.
const RATE_S: f64 = 0.05;
pub(crate) const GONE_S: f64 = 0.15;
/// By this fraction the ratio of two readings may differ from that of the gear: noise, and shafts that twist.
const BESIDE_GEAR: f64 = 0.02;
/// Factors beyond which output over wheel speed has parted from what it was: readings that are 50 ms apart differ by less.
const PARTED: std::ops::Range<f64> = 0.6..1.6;
/// The ratio of both is remembered so often, s: more rarely than readings are withdrawn afterwards.
const RATIO_S: f64 = 0.6;
/// Faster than any shaft of a car, rad/s: not taken as a speed at all.
pub(crate) const MAX_RAD_S: f64 = 1500.0;
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
/// By so much two readings of a speed that turns may differ at once, rad/s: noise, and times that are rounded \[chosen\].
const AT_ONCE_RAD_S: [f64; WATCHED] = [20.0, 20.0, 6.0, 2.0];

/// Watches engine, turbine, output and wheel speed.
#[derive(Debug, Clone, Copy)]
pub struct SpeedFaults {
    believed: [Option<Latest>; WATCHED],
    /// The two readings that were believed before it.
    earlier: [[Option<Latest>; 2]; WATCHED],
    faults: [Option<Fault>; WATCHED],
    /// Whether a speed is believed again where its fault was: its next jump may be that to the right value.
    doubtful: [bool; WATCHED],
    /// Output over wheel speed when both were last believed; not a number before.
    output_over_wheel: f64,
    /// The same at two earlier times.
    ratios: [Ratio; 2],
    /// When engine and turbine had the same speed last, s.
    together_s: f64,
    /// Since when a speed stands at zero against the others, s.
    stands_since_s: [Option<f64>; WATCHED],
    into_direct: IntoDirect,
    turbine: TurbineWay,
}

/// Whether a speed has the ratio to another one that was learnt.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fit {
    /// It has.
    Known,
    /// A turbine speed may be in another gear.
    OtherGear,
    /// It has not, or the ratio is not known.
    None,
}

/// How the turbine speed that was believed last came there.
#[derive(Debug, Clone, Copy)]
struct TurbineWay {
    /// Whether it had the ratio of a gear.
    fits: bool,
    /// Its mean acceleration of late, rad/s^2.
    rad_s2: f64,
}

impl TurbineWay {
    const NEW: Self = Self { fits: false, rad_s2: 0.0 };

    fn next(self, before: Latest, [rad_s, time_s]: Stamped, fits: bool) -> Self {
        let passed_s = time_s - before.time_s;
        let weight = if passed_s > 0.0 { (passed_s / RATE_S).min(1.0) } else { 0.0 };
        let rad_s2 = if passed_s > 0.0 { (rad_s - before.rad_s) / passed_s } else { 0.0 };
        Self { fits, rad_s2: self.rad_s2 + weight * (rad_s2 - self.rad_s2) }
    }

    /// Whether it was out of the gear without a shift.
    fn was_off(self) -> bool {
        !self.fits && self.rad_s2.abs() < SHIFTS_RAD_S2
    }
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
    /// Whether it began by a jump of this speed alone: where others jump with it, another recording goes on.
    by_jump: bool,
    /// What it began with over the speed before, rad/s.
    jump_rad_s: f64,
    newest: Latest,
    /// Since when a shift may have brought the turbine to the speed of the output, or it has its ratio to other speeds again, s; not a number before.
    right_since_s: f64,
}

/// Output over wheel speed, and when it was read, s.
#[derive(Debug, Clone, Copy)]
struct Ratio {
    value: f64,
    time_s: f64,
}

/// The latest reading of a speed: of those that are believed, or of those of a fault.
#[derive(Debug, Clone, Copy)]
struct Latest {
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
            earlier: [[None; 2]; WATCHED],
            faults: [None; WATCHED],
            doubtful: [false; WATCHED],
            output_over_wheel: f64::NAN,
            ratios: [Ratio { value: f64::NAN, time_s: f64::NEG_INFINITY }; 2],
            together_s: f64::NEG_INFINITY,
            stands_since_s: [None; WATCHED],
            into_direct,
            turbine: TurbineWay::NEW,
        }
    }

    /// Whether the next reading of a speed, in rad/s, is a fault; never of a role that is not watched. `fit` says whether it has the ratio to the other
    /// speeds that was learnt.
    pub fn is_fault(&mut self, role: Role, [rad_s, time_s]: Stamped, fit: impl Fn() -> Fit) -> bool {
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
        match self.believed[at].filter(|_| is_fault) {
            Some(before) => self.goes_on(at, before, [rad_s, time_s], fit() == Fit::Known),
            None => {
                if let Some(before) = self.believed[TURBINE].filter(|_| at == TURBINE) {
                    self.turbine = self.turbine.next(before, [rad_s, time_s], fit() != Fit::None);
                }
                self.believe(at, rad_s, time_s);
            }
        }
        is_fault
    }

    /// Takes a reading that is a fault.
    fn goes_on(&mut self, at: usize, before: Latest, [rad_s, time_s]: Stamped, fits: bool) {
        let fault = self.faults[at].unwrap_or_else(|| self.fault(at, before, rad_s, time_s));
        let may_be_right = match at {
            TURBINE if fault.another == Some(OUTPUT) => self.may_shift(before, rad_s, (fault, time_s)),
            TURBINE => fits && self.turbine.was_off(),
            OUTPUT | WHEEL => fits || self.agrees(at, rad_s, time_s),
            _ => false,
        };
        let right_since_s = match fault.right_since_s {
            since_s if may_be_right && !since_s.is_nan() => since_s,
            _ if may_be_right => time_s,
            _ => f64::NAN,
        };
        self.faults[at] = Some(Fault { right_since_s, newest: fault.newest.then(rad_s, time_s), ..fault });
    }

    /// A fault that begins.
    fn fault(&mut self, at: usize, before: Latest, rad_s: f64, time_s: f64) -> Fault {
        let mut by_jump = jumps(at, before, rad_s, time_s) && !core::mem::take(&mut self.doubtful[at]);
        for other in self.faults.iter_mut().flatten().filter(|other| time_s - other.since_s <= AT_ONCE_S) {
            by_jump &= !core::mem::take(&mut other.by_jump);
        }
        Fault {
            since_s: time_s,
            another: self.another(at, rad_s, time_s),
            engine_rad_s: self.turning(ENGINE, time_s),
            ratio: before.rad_s / rad_s,
            by_jump,
            jump_rad_s: rad_s - before.rad_s,
            newest: Latest::first(rad_s, time_s),
            right_since_s: f64::NAN,
        }
    }

    /// The readings of a speed after this one, which came at this time, s, turned out to be wrong.
    pub fn disbelieve_after(&mut self, role: Role, rad_s: f64, time_s: f64) {
        if let Some(believed) = self.believed.get_mut(role as usize) {
            *believed = Some(Latest::first(rad_s, time_s));
            self.earlier[role as usize] = [None; 2];
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
        let first = Latest::first(rad_s, time_s);
        self.earlier[at] = [self.believed[at], self.earlier[at][0]];
        self.believed[at] = Some(self.believed[at].map_or(first, |before| before.then(rad_s, time_s)));
        if let Some(fault) = self.faults[at] {
            self.doubtful[at] = fault.goes_on(at, rad_s, time_s);
        }
        self.faults[at] = None;
        if (at == ENGINE && self.shows(TURBINE, rad_s, time_s)) || (at == TURBINE && self.shows(ENGINE, rad_s, time_s))
        {
            self.together_s = time_s;
        }
        if let (OUTPUT | WHEEL, Some(output), Some(wheel)) =
            (at, self.turning(OUTPUT, time_s), self.turning(WHEEL, time_s))
            && [OUTPUT, WHEEL].iter().all(|of| self.faults[*of].is_none())
        {
            let value = output / wheel;
            self.output_over_wheel = value;
            if time_s - self.ratios[1].time_s > RATIO_S {
                self.ratios = [self.ratios[1], Ratio { value, time_s }];
            }
        }
    }

    /// Whether a fault begins with a reading.
    fn begins(&self, at: usize, before: Latest, rad_s: f64, time_s: f64) -> bool {
        let (_, min_rad_s) = SHAFTS[at];
        let fell = rad_s.abs() <= FELL * before.rad_s.abs() && before.rad_s.abs() > min_rad_s;
        let is_sudden = time_s - before.time_s <= AT_ONCE_S && fell;
        let (rate, at_once) = TO_ANOTHER;
        let change = (rad_s - before.rad_s).abs();
        // From one or two wrong readings it comes back to where it was.
        let comes_back = || {
            self.earlier[at].into_iter().flatten().any(|earlier| {
                let left = (before.rad_s - earlier.rad_s).abs();
                time_s - earlier.time_s <= AT_ONCE_S && (rad_s - earlier.rad_s).abs() <= (1.0 - RETURNED) * left
            })
        };
        let to_another = change > rate * before.passed_s(time_s) + at_once
            && self.another(at, rad_s, time_s).is_some()
            && !comes_back();
        jumps(at, before, rad_s, time_s)
            || (is_sudden && self.is_contradicted(at, before, time_s))
            || to_another
            || self.parts(at, rad_s, time_s)
    }

    /// Whether a fault goes on with a reading.
    fn lasts(&self, at: usize, before: Latest, rad_s: f64, (fault, time_s): (Fault, f64)) -> bool {
        let fell = rad_s.abs() <= FELL * before.rad_s.abs();
        let is_short = time_s - fault.since_s <= LONGEST_S;
        let is_right = time_s - fault.right_since_s >= GONE_S;
        let shows_another = fault.another.is_some_and(|another| self.is_near(STILL_ANOTHER, another, rad_s, time_s));
        let is_wrong = || {
            let is_elsewhere = !is_right && (shows_another || fault.by_jump && fault.goes_on(at, rad_s, time_s));
            jumps(at, before, rad_s, time_s) || fell || is_elsewhere || self.parts(at, rad_s, time_s)
        };
        let is_dead = || rad_s.abs() <= ZERO_RAD_S && fell && self.is_contradicted(at, before, time_s);
        (is_short && is_wrong()) || is_dead()
    }

    /// Whether a shift may have brought the turbine to this speed since it was believed last: it was on the way to the direct gear, there was time
    /// for it, and the engine went along.
    fn may_shift(&self, before: Latest, rad_s: f64, (fault, time_s): (Fault, f64)) -> bool {
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
    fn is_contradicted(&self, at: usize, before: Latest, time_s: f64) -> bool {
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
        // Where this one crawls the other one may be the wrong one.
        let (_, min_rad_s) = SHAFTS[at];
        let turns = self.believed[at].is_none_or(|before| before.rad_s.abs().max(rad_s.abs()) > min_rad_s);
        turns && self.change_of_ratio(at, rad_s, time_s).is_some_and(|change| !PARTED.contains(&change))
    }

    /// Whether output and wheel speed have their ratio with a reading of one of them, as near as two readings agree.
    fn agrees(&self, at: usize, rad_s: f64, time_s: f64) -> bool {
        self.change_of_ratio(at, rad_s, time_s).is_some_and(|change| (change - 1.0).abs() <= ANOTHER)
    }

    /// By which factor the ratio of output and wheel speed changes with a reading of one of them.
    fn change_of_ratio(&self, at: usize, rad_s: f64, time_s: f64) -> Option<f64> {
        let ratio = match at {
            OUTPUT => rad_s / self.turning(WHEEL, time_s)?,
            WHEEL => self.turning(OUTPUT, time_s)? / rad_s,
            _ => return None,
        };
        Some(ratio / self.output_over_wheel).filter(|change| !change.is_nan())
    }
}

impl Fault {
    /// Whether a reading goes on from the newest one of the fault: it has not come back by half of what the fault began with, nor by a jump, nor
    /// left a value that stood still.
    fn goes_on(&self, at: usize, rad_s: f64, time_s: f64) -> bool {
        let back = (self.newest.rad_s - rad_s) * self.jump_rad_s.signum();
        let is_back = back >= RETURNED * self.jump_rad_s.abs() || back > 0.0 && jumps(at, self.newest, rad_s, time_s);
        let stood = self.newest.first_s < self.newest.time_s;
        let has_left = stood && (rad_s - self.newest.rad_s).abs() > AT_ONCE_RAD_S[at];
        !(is_back || has_left)
    }
}

impl Default for SpeedFaults {
    fn default() -> Self {
        Self::new()
    }
}

impl Latest {
    fn first(rad_s: f64, time_s: f64) -> Self {
        Self { rad_s, time_s, first_s: time_s }
    }

    /// The next one after it.
    fn then(self, rad_s: f64, time_s: f64) -> Self {
        let first_s = if rad_s == self.rad_s { self.first_s } else { time_s };
        Self { rad_s, time_s, first_s }
    }

    /// Time in which the shaft may have changed, s.
    fn passed_s(&self, time_s: f64) -> f64 {
        (time_s - self.first_s.max(self.time_s - HELD_S)).max(0.0)
    }
}

/// Whether a reading is further from the believed one before than its shaft can have come.
fn jumps(at: usize, before: Latest, rad_s: f64, time_s: f64) -> bool {
    let (rate, min_rad_s) = SHAFTS[at];
    // A sensor that falls asleep or wakes up jumps.
    let is_awake = before.rad_s.abs().min(rad_s.abs()) > min_rad_s;
    let at_once = if is_awake { AT_ONCE_RAD_S[at] } else { min_rad_s };
    (rad_s - before.rad_s).abs() > rate * before.passed_s(time_s) + at_once
}

#[cfg(test)]
mod tests;
