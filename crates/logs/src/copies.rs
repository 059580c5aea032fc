//! Channels that show the reading of another speed.
//!
//! A gateway that maps a signal wrongly for a while, or a logger that fills a gap, writes the value of one speed into the channel of another. Two
//! sensors of two shafts agree to the last digit where the shafts turn together, as behind a lock-up clutch, and then their speeds came together by
//! and by. A channel is a copy where three things hold. Both speeds agree to the last digit for [`SAMPLES`] samples. Before that they differed, and a
//! line through the last two differences does not reach zero: it misses it by [`SUDDEN`] times the usual error of such a line. And one of both speeds
//! jumped: it is the wrong one, until they differ again or for [`LONGEST_S`]. A difference that is closed within a tenth of a second anyway shows none. Where the difference has a noise much larger than its resolution,
//! two sensors hardly agree to the last digit, also while a clutch makes their shafts one: then it is enough that one of both leaves the line
//! through its own last values by [`SUDDEN`] times its usual error, and the other one by less than half of that. Where two shafts turn
//! together, turbine and output in the direct gear, engine and turbine behind a lock-up clutch, neither leaves its line. There the shaft behind them
//! tells ([`Behind`]): two such speeds have differed and then agree to the last digit. In the direct gear the turbine is the copy as long as the wheels
//! turn with the output, and the output else. Behind a lock-up clutch the engine is it as long as the output turns with the turbine; else it is one of
//! both, and neither is believed: the gear changes, or the turbine shows an engine that has parted from it. A control unit that sends one value for
//! both does so from the first row on in which they turn together, and is believed. Engine and output never turn together without the turbine: where
//! the wheels turn with the output the engine is the copy, else it is one of both. Such a copy is not found without a speed of the shaft behind, and
//! between speeds whose noise is not larger than their resolution.

use crate::Role;
use crate::frozen::NOISE_RAD_S;
use crate::speed_faults::{GONE_S, LONGEST_S};

/// So many equal samples show it.
const SAMPLES: u32 = 3;
/// How many times its usual error a difference that was to be expected closes by at once, with a size that is no rounding, rad/s \[chosen\].
const SUDDEN: (f64, f64) = (8.0, 1.0);
/// Of two speeds one jumps to the other by more than the difference over the first of these, and the other one by less than that over the second
/// \[chosen\].
const ONE: [f64; 2] = [1.5, 3.0];
/// A difference that goes to zero within this time, s, and by so many times its usual error in a sample, is closed by a clutch \[chosen\]: its plates
/// stick at once in the end, and a copy would be little off until then.
const CLOSING: (f64, f64) = (0.1, 2.0);
/// How many times its usual error the difference of two noisy speeds closes by at once \[chosen\].
const CLOSES: f64 = 4.0;
/// Samples in which the usual error is learnt, and weight of one in its mean.
const LEARNT: u32 = 20;
const LATEST: f64 = 0.125;
/// Samples after which a noise is known, and after which equal ones are hardly a chance \[chosen\].
const MANY: u32 = 200;
const SURE: u32 = 5;
/// Wrong readings in a row after which two speeds that agreed go on as before.
const WRONG: u32 = 2;
/// Of the changes of the difference of two fine speeds one in so many, and so many more, is that before, within this fraction of the speeds \[chosen\]: coarse
/// ones often are.
const FINE: u32 = 500;
const BY_CHANCE: u32 = 3;
const ALIKE: f64 = 1e-6;
/// Of the changes of a noise one in so many at least turns the difference the other way than the one before, by more than [`NOISE_RAD_S`] \[chosen\].
const TURNS: u32 = 3;
/// Two speeds whose difference is at most this fraction of them turn together: noise, and a shaft that twists \[chosen\]. After this time, s, it
/// is no passage.
const TOGETHER: f64 = 0.01;
const SETTLED_S: f64 = 1.0;
/// Difference at which engine and turbine are one shaft, rad/s \[chosen\]: a lock-up clutch that is to slip keeps more.
const LOCKED_RAD_S: f64 = 1.5;
/// By this fraction the wheels may leave the output, slip of the tyres and a curve, and the output the turbine, two readings that are 10 ms apart
/// \[chosen\]; and by so many times the usual error.
const WITH_OUTPUT: f64 = 0.05;
const WITH_TURBINE: f64 = 0.003;
const USUAL: f64 = 5.0;
/// A speed of the shaft behind that is older than this says nothing, s.
const FRESH_S: f64 = 0.25;
/// In slower samples a shift passes between two of them, s: an inertia phase takes longer. Rows at 20 Hz, whose times are rounded, are not slower.
const SLOWEST_S: f64 = 0.06;
/// Below this a shaft stands, rad/s.
const STANDS_RAD_S: f64 = 1.0;
/// Relative difference of one number in two units.
const ROUNDING: f64 = 1e-12;

/// Speeds that are compared: those next to each other first.
const PAIRS: [[usize; 2]; 6] = [
    [Role::EngineSpeed as usize, Role::TurbineSpeed as usize],
    [Role::TurbineSpeed as usize, Role::OutputSpeed as usize],
    [Role::EngineSpeed as usize, Role::OutputSpeed as usize],
    [Role::OutputSpeed as usize, Role::WheelSpeed as usize],
    [Role::TurbineSpeed as usize, Role::WheelSpeed as usize],
    [Role::EngineSpeed as usize, Role::WheelSpeed as usize],
];

/// Of each speed the pairs that it is in, and whether it is the first or the second of them.
const PLACES: [[(usize, usize); 3]; 4] = [
    [(0, FIRST), (2, FIRST), (5, FIRST)],
    [(0, SECOND), (1, FIRST), (4, FIRST)],
    [(1, SECOND), (2, SECOND), (3, FIRST)],
    [(3, SECOND), (4, SECOND), (5, SECOND)],
];

/// Those whose shafts a clutch makes one while one of both fails: what is refused for another reason is not compared, but for noisy ones.
const MAY_JOIN: [[usize; 2]; 2] = [PAIRS[1], PAIRS[3]];

/// A reading: its value, rad/s, and its time, s.
pub(crate) type Stamped = [f64; 2];

/// Engine and turbine, which turn together behind a lock-up clutch, by their place in [`PAIRS`]. Turbine and output, which do in the direct gear,
/// come next; then engine and output, which turn together with the turbine alone.
const LOCKED: usize = 0;
const DIRECT: usize = 1;
const THROUGH: usize = 2;

/// The first and the second of a pair.
const FIRST: usize = 0;
const SECOND: usize = 1;

/// A speed that shows another one, and its last reading that is right.
pub(crate) type Copied = (Role, Stamped);

/// Watches the speeds of the four shafts.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Copies {
    pairs: [Pair; PAIRS.len()],
    /// Behind the first three pairs.
    behind: [Behind; 3],
    turbine: Option<Stamped>,
}

/// The shaft behind two that turn together, and its speed over that of the second of them.
#[derive(Debug, Clone, Copy)]
struct Behind {
    role: Role,
    /// Which of both is a copy where the second one does not turn with it: both, if either may be.
    parted: [bool; 2],
    /// Fraction by which its speed may leave the second one.
    within: f64,
    newest: Option<Stamped>,
    /// The ratio while both differ; not a number before. And the usual error of a reading by it, rad/s.
    ratio: f64,
    error_rad_s: f64,
}

/// Two speeds.
#[derive(Debug, Clone, Copy)]
struct Pair {
    /// Readings since both were compared.
    newest: [Option<Stamped>; 2],
    /// Whether one of these is refused for another reason.
    is_fault: bool,
    /// The time of a reading that was left out, s: that of the other speed is no partner of the next one.
    left_out_s: f64,
    /// The readings at which they differed last.
    before: Option<[Stamped; 2]>,
    /// Change of the difference in the last sample, rad/s, and how many changes there were.
    change: f64,
    changes: u32,
    /// By how much a change differs from the one before: its mean and the last one, rad/s; and how often it did not.
    error: [f64; 2],
    alike: u32,
    /// How often it turned to the other side, and where it went last.
    turns: u32,
    is_more: bool,
    /// The same of each speed: its last change, and the mean by which a change differs from the one before, rad/s.
    own: [[f64; 2]; 2],
    /// Samples in which they are equal, and which of both jumped to the other, if one did.
    equal: u32,
    jumped: Option<usize>,
    /// Samples in which they are to be equal until it is believed.
    needed: u32,
    /// Largest difference at which they turn together: as a fraction, and rad/s.
    together: [f64; 2],
    /// Since when they have differed and turned together, s, and whether the equal samples followed that, or the difference closed at once: which is
    /// the copy is then for the shaft behind to tell.
    together_since_s: Option<f64>,
    was_together: bool,
    /// Since when the second one has turned with the shaft behind it while both are equal, s.
    is_with_since_s: Option<f64>,
    /// Samples in a row in which they agree to the last digit, and what was known of them when a wrong reading parted them, if one did.
    agree: u32,
    parted: Option<Parted>,
}

/// Two speeds that agreed for some time, until some samples ago.
#[derive(Debug, Clone, Copy)]
struct Parted {
    samples: u32,
    agree: u32,
    before: Option<[Stamped; 2]>,
    equal: u32,
    jumped: Option<usize>,
    needed: u32,
    was_together: bool,
}

/// Whether two readings of about the same time are of two speeds.
fn is_apart([one, one_s]: Stamped, [other, other_s]: Stamped) -> bool {
    (one_s - other_s).abs() <= FRESH_S && (one - other).abs() > TOGETHER * other.abs()
}

impl Behind {
    fn new(role: Role, within: f64, parted: [bool; 2]) -> Self {
        Self { role, parted, within, newest: None, ratio: f64::NAN, error_rad_s: 0.0 }
    }

    /// Its speed, if there is one of about this time, s.
    fn at(&self, time_s: f64) -> Option<f64> {
        self.newest.filter(|[_, then_s]| (time_s - then_s).abs() <= FRESH_S).map(|[rad_s, _]| rad_s)
    }

    /// Takes a speed of the second shaft that differs from that of the first.
    fn learn(&mut self, [second, time_s]: Stamped) {
        let Some(rad_s) = self.at(time_s).filter(|_| second.abs() > STANDS_RAD_S) else { return };
        if self.ratio.is_nan() {
            self.ratio = rad_s / second;
        }
        self.error_rad_s += LATEST * ((rad_s - self.ratio * second).abs() - self.error_rad_s);
        self.ratio += LATEST * (rad_s / second - self.ratio);
    }

    /// Whether the shaft behind has the speed that belongs to this one, as near as two readings agree.
    fn is_at(&self, [second, time_s]: Stamped) -> bool {
        self.at(time_s).is_some_and(|rad_s| (rad_s - self.ratio * second).abs() <= TOGETHER * rad_s.abs())
    }

    /// Which of two equal readings are copies, if a speed behind them says it.
    fn copies(&self, [second, time_s]: Stamped) -> Option<[bool; 2]> {
        let rad_s = self.at(time_s)?;
        let by = (rad_s - self.ratio * second).abs();
        // In a shift the ratio changes, and the usual error of a reading by it is large.
        let most = self.within.max(TOGETHER) * rad_s.abs();
        let is_with = by <= most.min(self.within * rad_s.abs() + USUAL * self.error_rad_s);
        (!by.is_nan()).then_some(if is_with { [true, false] } else { self.parted })
    }
}

impl Copies {
    pub(crate) fn new() -> Self {
        let pair = Pair {
            newest: [None; 2],
            is_fault: false,
            left_out_s: f64::NAN,
            before: None,
            change: 0.0,
            changes: 0,
            error: [0.0; 2],
            alike: 0,
            turns: 0,
            is_more: false,
            own: [[0.0; 2]; 2],
            equal: 0,
            jumped: None,
            needed: SAMPLES,
            together: [TOGETHER, f64::INFINITY],
            together_since_s: None,
            was_together: false,
            is_with_since_s: None,
            agree: 0,
            parted: None,
        };
        let mut pairs = [pair; PAIRS.len()];
        pairs[LOCKED].together = [f64::INFINITY, LOCKED_RAD_S];
        let turbine = Behind::new(Role::OutputSpeed, WITH_TURBINE, [true; 2]);
        let output = Behind::new(Role::WheelSpeed, WITH_OUTPUT, [false, true]);
        let through = Behind::new(Role::WheelSpeed, WITH_TURBINE, [true; 2]);
        Self { pairs, behind: [turbine, output, through], turbine: None }
    }

    /// Takes a reading, and whether it is refused for another reason. Returns the speeds whose channel shows another one.
    pub(crate) fn push(&mut self, role: Role, reading: Stamped, is_fault: bool) -> [Option<Copied>; 2] {
        let Some(places) = PLACES.get(role as usize) else { return [None; 2] };
        let (mut found, mut by) = ([None; 2], None);
        for behind in self.behind.iter_mut().filter(|behind| behind.role == role && !is_fault) {
            behind.newest = Some(reading);
        }
        if role == Role::TurbineSpeed && !is_fault {
            self.turbine = Some(reading);
        }
        for &(n, which) in places {
            let (pair, of) = (&mut self.pairs[n], PAIRS[n]);
            if is_fault && MAY_JOIN.contains(&of) && !pair.is_fine() {
                pair.leave_out(reading);
                continue;
            }
            if pair.left_out_s == reading[1] && pair.newest[1 - which].is_none() {
                continue;
            }
            pair.is_fault |= is_fault;
            let Some(other) = pair.newest[1 - which].take() else {
                pair.newest[which] = Some(reading);
                continue;
            };
            pair.newest[which] = None;
            let newest = if which == FIRST { [reading, other] } else { [other, reading] };
            if !pair.are_equal(newest) {
                if let Some(behind) = self.behind.get_mut(n).filter(|_| pair.before == Some(newest)) {
                    behind.learn(newest[SECOND]);
                }
                continue;
            }
            let mut copies = pair.copies(newest);
            if n == DIRECT && pair.turns_with(&self.behind[DIRECT], newest) {
                // A shift has brought the turbine to the output that showed it.
                copies[SECOND] = None;
            }
            if n == THROUGH {
                pair.was_together = pair.is_open() && self.turbine.is_some_and(|turbine| is_apart(turbine, other));
            }
            if copies == [None; 2]
                && let Some(behind) = self.behind.get(n)
            {
                copies = pair.copies_by(behind, newest);
            }
            if by.is_none() && copies != [None; 2] {
                by = Some(of);
                found = [FIRST, SECOND].map(|which| copies[which].map(|right| (Role::SPEEDS[of[which]], right)));
            }
        }
        for (copied, _) in found.into_iter().flatten() {
            for (pair, of) in self.pairs.iter_mut().zip(PAIRS) {
                if by != Some(of) && of.contains(&(copied as usize)) {
                    pair.before = None;
                }
            }
        }
        found
    }
}

impl Pair {
    /// Leaves a reading out, and that of the other speed at the same time.
    fn leave_out(&mut self, [_, time_s]: Stamped) {
        self.left_out_s = time_s;
        for newest in &mut self.newest {
            *newest = newest.filter(|[_, then_s]| *then_s != time_s);
        }
    }

    /// Takes two readings, and whether they are equal.
    fn are_equal(&mut self, newest: [Stamped; 2]) -> bool {
        let is_fault = std::mem::take(&mut self.is_fault);
        let [[one, _], [other, _]] = newest;
        if (one - other).abs() > ROUNDING * other.abs() || one.abs() < STANDS_RAD_S {
            self.part();
            // With a reading that is refused the difference says nothing.
            if is_fault {
                (self.equal, self.jumped) = (0, None);
            } else {
                self.differ(newest);
            }
            self.is_with_since_s = None;
            return false;
        }
        self.agree = self.agree.saturating_add(1);
        if self.join() {
            return true;
        }
        let Some(before) = self.before else { return true };
        if self.equal == 0 {
            let jumped = self.jump(before, newest);
            self.needed = if jumped.is_some() { SAMPLES } else { SURE };
            self.jumped = jumped.or_else(|| self.leaves(before, newest));
            let is_settled = self.together_since_s.is_some_and(|since_s| newest[SECOND][1] - since_s >= SETTLED_S);
            self.was_together = self.is_open() && (is_settled || self.closes_at_once(before, newest));
        }
        self.equal = self.equal.saturating_add(1);
        true
    }

    /// They differ in this sample: two that agreed for some time keep what was known of them for as long as it may be a wrong reading.
    fn part(&mut self) {
        let agree = core::mem::take(&mut self.agree);
        if let Some(parted) = &mut self.parted {
            parted.samples += 1;
        } else if agree >= SURE {
            let Self { before, equal, jumped, needed, was_together, .. } = *self;
            self.parted = Some(Parted { samples: 1, agree, before, equal, jumped, needed, was_together });
        }
        self.parted = self.parted.filter(|parted| parted.samples <= WRONG);
    }

    /// They agree in this sample. Whether they did before some wrong readings, and go on as if these had not come.
    fn join(&mut self) -> bool {
        let Some(parted) = self.parted.take() else { return false };
        let Parted { agree, before, equal, jumped, needed, was_together, .. } = parted;
        self.agree = agree.saturating_add(1);
        (self.before, self.equal, self.jumped) = (before, equal, jumped);
        (self.needed, self.was_together) = (needed, was_together);
        self.equal = if before.is_some() { equal.saturating_add(1) } else { equal };
        true
    }

    /// Of the one that jumped to the other's value, its last reading that is right.
    fn copies(&self, newest: [Stamped; 2]) -> [Option<Stamped>; 2] {
        let jumped = self.before.zip(self.jumped.filter(|_| self.equal >= self.needed));
        let is_short = |before: Stamped, which: usize| newest[which][1] - before[1] <= LONGEST_S;
        [FIRST, SECOND].map(|which| {
            let (before, _) = jumped.filter(|(_, jumped)| *jumped == which)?;
            Some(before[which]).filter(|before| is_short(*before, which))
        })
    }

    /// Whether the second one, which is the first one's value, has turned with the shaft behind it for some time.
    fn turns_with(&mut self, behind: &Behind, newest: [Stamped; 2]) -> bool {
        let [_, time_s] = newest[SECOND];
        let is_with = self.equal > 0 && behind.is_at(newest[SECOND]);
        self.is_with_since_s = is_with.then(|| self.is_with_since_s.unwrap_or(time_s));
        self.is_with_since_s.is_some_and(|since_s| time_s - since_s >= GONE_S)
    }

    /// The same of two that turned together, by the shaft behind them.
    fn copies_by(&self, behind: &Behind, newest: [Stamped; 2]) -> [Option<Stamped>; 2] {
        let before = self.before.filter(|_| self.was_together && self.equal >= SURE);
        let Some((before, copies)) = before.zip(behind.copies(newest[SECOND])) else { return [None; 2] };
        let is_short = newest[SECOND][1] - before[SECOND][1] <= LONGEST_S;
        [FIRST, SECOND].map(|which| Some(before[which]).filter(|_| copies[which] && is_short))
    }

    fn differ(&mut self, newest: [Stamped; 2]) {
        let difference = |[[one, _], [other, _]]: [Stamped; 2]| one - other;
        if let Some(before) = self.before.filter(|_| self.equal == 0) {
            let change = difference(newest) - difference(before);
            let turn = change - self.change;
            let error = turn.abs();
            if error > NOISE_RAD_S {
                let was_more = core::mem::replace(&mut self.is_more, turn > 0.0);
                self.turns = self.turns.saturating_add(u32::from(was_more != self.is_more));
            }
            self.change = change;
            self.error = [self.error[0] + LATEST * (error - self.error[0]), error];
            let size = newest[0][0].abs().max(newest[1][0].abs());
            self.alike = self.alike.saturating_add(u32::from(error <= ALIKE * size));
            for ([change, mean], which) in self.own.iter_mut().zip(0..) {
                let now = newest[which][0] - before[which][0];
                *mean += LATEST * ((now - *change).abs() - *mean);
                *change = now;
            }
            self.changes = self.changes.saturating_add(1);
        }
        let [[one, _], [other, time_s]] = newest;
        let [fraction, rad_s] = self.together;
        let is_together = (one - other).abs() <= rad_s.min(fraction * one.abs().max(other.abs()));
        self.together_since_s = is_together.then(|| self.together_since_s.unwrap_or(time_s));
        (self.before, self.equal, self.jumped) = (Some(newest), 0, None);
    }

    /// Whether two sensors hardly agree to the last digit by chance: their noise is known, and far larger than their resolution.
    fn is_fine(&self) -> bool {
        self.changes >= MANY && self.turns >= self.changes / TURNS && self.alike <= BY_CHANCE + self.changes / FINE
    }

    /// Whether neither jumped to the other, and they hardly agree by chance.
    fn is_open(&self) -> bool {
        self.jumped.is_none() && self.is_fine()
    }

    /// By how much each speed leaves the line through its last values, rad/s.
    fn off_their_lines(&self, before: [Stamped; 2], newest: [Stamped; 2]) -> [f64; 2] {
        [FIRST, SECOND].map(|which| (newest[which][0] - before[which][0] - self.own[which][0]).abs())
    }

    /// Which of two noisy speeds left its own line to the other.
    fn leaves(&self, before: [Stamped; 2], newest: [Stamped; 2]) -> Option<usize> {
        let (times, _) = SUDDEN;
        let by = self.off_their_lines(before, newest);
        let which = usize::from(by[1] > by[0]);
        let passed_s = newest[which][1] - before[which][1];
        // A clutch that closes stops a speed by a kink in its line, and the difference is small before.
        let difference = before[FIRST][0] - before[SECOND][0];
        let is_of_difference = 2.0 * difference.abs() > by[which];
        let is_clear = is_of_difference && by[which] > times * self.own[which][1] && by[which] > 2.0 * by[1 - which];
        (self.is_fine() && is_clear && (0.0..=SLOWEST_S).contains(&passed_s)).then_some(which)
    }

    /// Whether the difference of two noisy speeds closed at once.
    fn closes_at_once(&self, before: [Stamped; 2], newest: [Stamped; 2]) -> bool {
        let difference = before[FIRST][0] - before[SECOND][0];
        let expected = difference + self.change;
        let passed_s = newest[SECOND][1] - before[SECOND][1];
        let [mean, _] = self.error;
        expected.abs().min(difference.abs()) > CLOSES * mean
            && expected * difference > 0.0
            && (0.0..=SLOWEST_S).contains(&passed_s)
    }

    /// Which of both jumped to the other, where the difference closed at once: it was to be expected on its side of zero, and not to be there soon. What a
    /// clutch takes to zero would have gone beyond.
    fn jump(&self, before: [Stamped; 2], newest: [Stamped; 2]) -> Option<usize> {
        let (times, min_rad_s) = SUDDEN;
        let [mean, last] = self.error;
        let difference = before[0][0] - before[1][0];
        let expected = difference + self.change;
        let by = self.off_their_lines(before, newest);
        let passed_s = newest[0][1].max(newest[1][1]) - before[0][1].min(before[1][1]);
        let is_sudden = expected.abs() > times * mean.max(last) + min_rad_s
            && expected * difference > 0.0
            && (0.0..=SLOWEST_S).contains(&passed_s);
        let which = usize::from(by[1] > by[0]);
        let closed = difference.abs();
        // A clutch that sticks takes the speeds of both its shafts to each other.
        let [jumps, stays] = ONE;
        let is_one = jumps * by[which] > closed && stays * by[1 - which] < closed;
        let (soon_s, clearly) = CLOSING;
        let closing = -self.change * difference.signum();
        let is_closing = closing > clearly * mean && expected.abs() * passed_s <= soon_s * closing;
        (is_sudden && is_one && !is_closing && self.changes >= LEARNT).then_some(which)
    }
}

#[cfg(test)]
mod tests;
