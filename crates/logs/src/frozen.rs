//! Speeds that stand still while they cannot.
//!
//! A speed is frozen that stands still, to the last digit and away from zero, for [`FROZEN_S`] and [`FROZEN_SAMPLES`] samples and
//! three times as many samples as ever before, while a speed that it cannot part from changes by more than a tyre slips,
//! [`FROZEN_CHANGE`], and by more than [`FROZEN_QUANTA`] of its own quanta: it is not used until it changes. Its quantum is the
//! smallest change that was seen of it; before it has changed, [`FROZEN_FROM_START_S`] and [`FROZEN_CHANGE_FROM_START`] count. One that
//! changed by [`FROZEN_QUANTA`] of its quanta from sample to sample stands for [`STOPPED_S`] and [`STOPPED_SAMPLES`] only, and the other
//! changes by those quanta. Where a speed that changed by more than one of its quanta never had one value twice in a row, in [`MANY_CHANGES`]
//! changes, no other one has to show it; nor where a speed is noisy, one in [`NOISY`] of so many changes turns back, by [`FROZEN_QUANTA`] of its quanta
//! of late, and stands for three times as long as ever before, at rest too: noise does not stop.
//! Output, wheels and car cannot part from each other, nor the turbine from them, nor the engine from a turbine that is nearly as fast
//! or faster: below that the idle control may hold the engine while the car comes to rest. An engine that is faster than any idle control
//! holds it, [`IDLE_RAD_S`], parts from the turbine by the slip of the converter, but does not stand still to the last digit while the turbine
//! changes by [`FROZEN_CHANGE_CONVERTER`]. One that idles, read in steps of [`COARSE_RAD_S`] or more, may stand longer, until a faster turbine changes by
//! [`FROZEN_CHANGE_IDLE`].

use crate::Role;

/// A speed is frozen when it stood still for so long, s.
pub const FROZEN_S: f64 = 0.5;
/// When it has not changed since the log began, s: how coarse it is, is not known then.
pub const FROZEN_FROM_START_S: f64 = 5.0;
/// And for so many samples.
pub const FROZEN_SAMPLES: u32 = 10;
/// While a speed that it cannot part from changed by this fraction of its value: more than the slip of a tyre changes in ordinary
/// driving.
pub const FROZEN_CHANGE: f64 = 0.02;
/// The same when it has not changed since the log began.
pub const FROZEN_CHANGE_FROM_START: f64 = 0.1;
/// And by so many of its own quanta: a value may move by nearly one unseen, and a filter or a hysteresis may hide as much again.
pub const FROZEN_QUANTA: f64 = 3.0;
/// Weight of a change in the mean of the latest ones.
const LATEST: f64 = 0.125;
/// Fraction by which the other speed changes at least while one has stopped \[chosen\]: no noise.
const STOPPED_CHANGE: f64 = 0.002;
/// The same of an engine while the turbine changes behind a converter \[chosen\]: its load changes with the slip.
pub const FROZEN_CHANGE_CONVERTER: f64 = 0.05;
/// The same of an engine that idles while a coasting car turns the turbine faster, and that is read in steps of at least [`COARSE_RAD_S`]: an idle
/// control holds it within such a step \[chosen\].
pub const FROZEN_CHANGE_IDLE: f64 = 0.3;
/// A step that hides what an idle control leaves, rad/s \[chosen\]: 1 rpm.
pub const COARSE_RAD_S: f64 = 0.1;
/// Maximum speed that an idle control holds, of a cold engine, rad/s \[chosen\]: 1500 rpm.
pub const IDLE_RAD_S: f64 = 157.0;
/// A turbine above this fraction of the engine's speed takes the engine along when it changes.
pub const COUPLED: f64 = 0.95;

/// A speed that moved has stopped when it stood still for so long, s, and for so many samples \[chosen\].
pub const STOPPED_S: f64 = 0.05;
/// See [`STOPPED_S`].
pub const STOPPED_SAMPLES: u32 = 5;

/// Changes after which a speed is known never to have one value twice in a row \[chosen\].
pub const MANY_CHANGES: u32 = 200;

/// At least one in so many changes of a noisy speed goes in the other direction than the one before \[chosen\]: vibrations of a driveline turn more
/// slowly than its speed is read.
pub const NOISY: u32 = 5;

/// A smaller change is no noise, rad/s or m/s \[chosen\]: it may be the tolerance of a simulation.
pub const NOISE_RAD_S: f64 = 0.01;

/// Below this a shaft stands, rad/s.
const STANDS_RAD_S: f64 = 1.0;

/// Roles that are speeds: the first five.
pub const SPEEDS: usize = 5;

/// The newest value of each speed that is not frozen, rad/s, or m/s of the car; NaN before the first.
pub type Speeds = [f64; SPEEDS];

/// Before the first values.
pub const NO_SPEEDS: Speeds = [f64::NAN; SPEEDS];

/// Watches a speed.
#[derive(Debug, Clone, Copy)]
pub struct FrozenSpeed {
    role: Role,
    still: Option<Still>,
    /// Samples of the longest time so far in which the speed stood still and was not frozen: coarse signals do so often.
    longest_still: u32,
    /// The same with those at rest, but for a shaft that stands.
    longest_turning: u32,
    /// The smallest change so far.
    quantum: f64,
    /// Mean change from sample to sample, of late.
    moves: f64,
    /// How often it has changed, and how often in the other direction than before.
    changes: u32,
    turns: u32,
    is_rising: bool,
}

/// A speed that stands still.
#[derive(Debug, Clone, Copy)]
struct Still {
    value: f64,
    since_s: f64,
    samples: u32,
    /// The other speeds when it was first seen to stand.
    others: Speeds,
    frozen: bool,
}

impl FrozenSpeed {
    /// Watches the speed of this role.
    pub fn new(role: Role) -> Self {
        Self {
            role,
            still: None,
            longest_still: 0,
            longest_turning: 0,
            quantum: f64::INFINITY,
            moves: 0.0,
            changes: 0,
            turns: 0,
            is_rising: false,
        }
    }

    /// Whether the speed is known to be frozen since an earlier value.
    pub fn is_known(&self) -> bool {
        self.still.is_some_and(|still| still.frozen)
    }

    /// The value at which the speed stands, rad/s, and when it came first, s.
    pub fn still(&self) -> Option<[f64; 2]> {
        self.still.map(|still| [still.value, still.since_s])
    }

    /// Whether the speed is frozen, with its next value and the newest values of the others.
    pub fn is_frozen(&mut self, value: f64, time_s: f64, speeds: &Speeds) -> bool {
        let Some(still) = self.still.as_mut().filter(|still| still.value == value) else {
            if let Some(before) = self.still {
                let change = (value - before.value).abs();
                self.quantum = self.quantum.min(change);
                self.moves += LATEST * (change / f64::from(before.samples) - self.moves);
                self.changes = self.changes.saturating_add(1);
                if change > NOISE_RAD_S {
                    let was_rising = core::mem::replace(&mut self.is_rising, value > before.value);
                    self.turns = self.turns.saturating_add(u32::from(was_rising != self.is_rising));
                }
                if !before.frozen && before.value.abs() > STANDS_RAD_S {
                    self.longest_turning = self.longest_turning.max(before.samples);
                }
                if !before.frozen && before.value.abs() > rests_rad_s(self.role) {
                    self.longest_still = self.longest_still.max(before.samples);
                }
            }
            self.still = Some(Still { value, since_s: time_s, samples: 1, others: NO_SPEEDS, frozen: false });
            return false;
        };
        if still.samples == 1 {
            still.others = *speeds;
        }
        still.samples += 1;
        let (limit_s, fraction) = match self.longest_still {
            0 => (FROZEN_FROM_START_S, FROZEN_CHANGE_FROM_START),
            _ => (FROZEN_S, FROZEN_CHANGE),
        };
        let quantum = if self.quantum.is_finite() { FROZEN_QUANTA * self.quantum } else { 0.0 };
        let long = still.samples >= FROZEN_SAMPLES.max(3 * self.longest_still) && time_s - still.since_s >= limit_s;
        let stands = self.longest_still > 0
            && still.samples >= STOPPED_SAMPLES.max(3 * self.longest_still)
            && time_s - still.since_s >= STOPPED_S;
        let stopped = stands && self.moves > quantum;
        // A speed that never had one value twice does not have it for so long. The smallest change of a smooth speed may be far above its quantum.
        let never_stood = stands
            && self.longest_still == 1
            && self.changes >= MANY_CHANGES
            && self.quantum.is_finite()
            && self.moves > self.quantum;
        let is_noisy = self.changes >= MANY_CHANGES && self.turns >= self.changes / NOISY;
        let noise_stopped = is_noisy
            && self.longest_turning > 0
            && self.moves > quantum
            && still.samples >= STOPPED_SAMPLES.max(3 * self.longest_turning)
            && time_s - still.since_s >= STOPPED_S
            && value.abs() > STANDS_RAD_S;
        if noise_stopped || never_stood && value.abs() > rests_rad_s(self.role) {
            still.frozen = true;
        }
        if !still.frozen && value != 0.0 && (long || stopped) {
            let quanta = quantum / value.abs();
            let limit = if stopped { quanta.max(STOPPED_CHANGE) } else { fraction.max(quanta) };
            still.frozen = partners(self.role).iter().any(|partner| {
                // Without one of both nothing has changed.
                let (now, then) = (speeds[*partner as usize], still.others[*partner as usize]);
                let is_tied = self.role != Role::EngineSpeed || then.max(now) > COUPLED * value;
                let may_idle = self.role == Role::EngineSpeed && value <= IDLE_RAD_S && self.quantum >= COARSE_RAD_S;
                // Behind a lock-up clutch, or without a converter, both are equal.
                let idles = may_idle && COUPLED * then > value;
                let limit = match (is_tied, idles) {
                    (true, true) => limit.max(FROZEN_CHANGE_IDLE),
                    (true, false) => limit,
                    (false, _) => limit.max(FROZEN_CHANGE_CONVERTER),
                };
                (is_tied || value > IDLE_RAD_S) && (now - then).abs() > limit * then.abs().max(now.abs())
            });
        }
        still.frozen
    }
}

/// Up to this speed, rad/s, it may stand still to the last digit: a car that stands, and an engine that idles, say nothing of how coarse their
/// speeds are.
fn rests_rad_s(role: Role) -> f64 {
    if role == Role::EngineSpeed { IDLE_RAD_S } else { STANDS_RAD_S }
}

/// The speeds that one cannot part from.
fn partners(role: Role) -> &'static [Role] {
    match role {
        Role::EngineSpeed => &[Role::TurbineSpeed],
        Role::TurbineSpeed => &[Role::OutputSpeed, Role::WheelSpeed, Role::VehicleSpeed],
        Role::OutputSpeed => &[Role::WheelSpeed, Role::VehicleSpeed],
        Role::WheelSpeed => &[Role::OutputSpeed, Role::VehicleSpeed],
        _ => &[Role::OutputSpeed, Role::WheelSpeed],
    }
}
