//! Channels that show the reading of another speed.
//!
//! A gateway that maps a signal wrongly for a while, or a logger that fills a gap, writes the value of one speed into the channel of another. Two
//! sensors of two shafts agree to the last digit where the shafts turn together, as behind a lock-up clutch, and then their speeds came together by
//! and by. A channel is a copy where three things hold. Both speeds agree to the last digit for [`SAMPLES`] samples. Before that they differed, and a
//! line through the last two differences does not reach zero: it misses it by [`SUDDEN`] times the usual error of such a line. And one of both speeds
//! jumped: it is the wrong one, until they differ again or for [`LONGEST_S`]. Where the difference has a noise much larger than its resolution,
//! two sensors hardly agree to the last digit, also while a clutch makes their shafts one: then it is enough that one of both leaves the line
//! through its own last values by [`SUDDEN`] times its usual error, and the other one by less than half of that. In the direct gear
//! neither leaves its line. There a wheel speed tells: where two such speeds have differed in the gear and then agree to the last digit, the turbine
//! is the copy as long as the wheels turn with the output, and the output else. A control unit that sends one value for both in the direct gear does so
//! from its first row on, and is believed. A copy that begins behind a closed lock-up clutch, or without a wheel speed in the direct gear, is not found.

use crate::Role;
use crate::frozen::NOISE_RAD_S;
use crate::speed_faults::LONGEST_S;

/// So many equal samples show it.
const SAMPLES: u32 = 3;
/// How many times its usual error a difference that was to be expected closes by at once, with a size that is no rounding, rad/s \[chosen\].
const SUDDEN: (f64, f64) = (8.0, 1.0);
/// Samples in which the usual error is learnt, and weight of one in its mean.
const LEARNT: u32 = 20;
const LATEST: f64 = 0.125;
/// Samples after which a noise is known, and after which equal ones are hardly a chance \[chosen\].
const MANY: u32 = 200;
const SURE: u32 = 5;
/// Of the changes of the difference of two fine speeds one in so many at most is that before, within this fraction of the speeds \[chosen\]: coarse
/// ones often are.
const FINE: u32 = 500;
const ALIKE: f64 = 1e-6;
/// Of the changes of a noise one in so many at least turns the difference the other way than the one before, by more than [`NOISE_RAD_S`] \[chosen\].
const TURNS: u32 = 3;
/// Two speeds whose difference is at most this fraction of them turn together: noise, and a shaft that twists \[chosen\]. After this time, s, it
/// is no passage.
const TOGETHER: f64 = 0.01;
const SETTLED_S: f64 = 1.0;
/// By this fraction the wheels may leave the output: slip of the tyres, and a curve \[chosen\].
const WITH_OUTPUT: f64 = 0.05;
/// A wheel speed older than this says nothing, s.
const FRESH_S: f64 = 0.25;
/// In slower samples a shift passes between two of them, s: an inertia phase takes longer.
const SLOWEST_S: f64 = 0.05;
/// Below this a shaft stands, rad/s.
const STANDS_RAD_S: f64 = 1.0;
/// Relative difference of one number in two units.
const ROUNDING: f64 = 1e-12;

/// Speeds that are compared: those next to each other first.
const PAIRS: [[usize; 2]; 6] = [
    [Role::EngineSpeed as usize, Role::TurbineSpeed as usize],
    [Role::TurbineSpeed as usize, Role::OutputSpeed as usize],
    [Role::OutputSpeed as usize, Role::WheelSpeed as usize],
    [Role::EngineSpeed as usize, Role::OutputSpeed as usize],
    [Role::TurbineSpeed as usize, Role::WheelSpeed as usize],
    [Role::EngineSpeed as usize, Role::WheelSpeed as usize],
];

/// Those whose shafts a clutch makes one while one of both fails: what is refused for another reason is not compared, but for noisy ones.
const MAY_JOIN: [[usize; 2]; 2] = [PAIRS[1], PAIRS[2]];

/// A reading: its value, rad/s, and its time, s.
pub(crate) type Stamped = [f64; 2];

/// Those that turn together in the direct gear.
const DIRECT: [usize; 2] = PAIRS[1];
const TURBINE: usize = 0;
const OUTPUT: usize = 1;

/// Watches the speeds of the four shafts.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Copies {
    pairs: [Pair; PAIRS.len()],
    wheels: Wheels,
}

/// What the wheel speed says of the output speed.
#[derive(Debug, Clone, Copy)]
struct Wheels {
    newest: Option<Stamped>,
    /// Wheel over output speed while turbine and output differ; not a number before.
    over_output: f64,
}

/// Two speeds.
#[derive(Debug, Clone, Copy)]
struct Pair {
    /// Readings since both were compared.
    newest: [Option<Stamped>; 2],
    /// Whether one of these is refused for another reason.
    is_fault: bool,
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
    /// Since when they have differed and turned together, s, and whether the equal samples followed that: which is the copy is then for the wheels
    /// to tell.
    together_since_s: Option<f64>,
    is_of_direct: bool,
}

impl Wheels {
    /// Takes an output speed that differs from the turbine speed.
    fn learn(&mut self, [output, time_s]: Stamped) {
        let ratio =
            self.newest.filter(|[_, then_s]| (time_s - then_s).abs() <= FRESH_S).map(|[wheel, _]| wheel / output);
        if let Some(ratio) = ratio.filter(|_| output.abs() > STANDS_RAD_S) {
            self.over_output =
                if self.over_output.is_nan() { ratio } else { self.over_output + LATEST * (ratio - self.over_output) };
        }
    }

    /// Which of two equal readings of turbine and output is a copy, if a wheel speed says it.
    fn copy(&self, [output, time_s]: Stamped) -> Option<usize> {
        let [wheel, then_s] = self.newest?;
        let by = (wheel - self.over_output * output).abs();
        if (time_s - then_s).abs() > FRESH_S || by.is_nan() {
            return None;
        }
        Some(if by <= WITH_OUTPUT * wheel.abs() { TURBINE } else { OUTPUT })
    }
}

impl Copies {
    pub(crate) fn new() -> Self {
        let pair = Pair {
            newest: [None; 2],
            is_fault: false,
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
            together_since_s: None,
            is_of_direct: false,
        };
        Self { pairs: [pair; PAIRS.len()], wheels: Wheels { newest: None, over_output: f64::NAN } }
    }

    /// Takes a reading, and whether it is refused for another reason. Returns the speed whose channel shows another one, with its last
    /// reading that is right.
    pub(crate) fn push(&mut self, role: Role, reading: Stamped, is_fault: bool) -> Option<(Role, Stamped)> {
        let at = role as usize;
        let mut found = None;
        if role == Role::WheelSpeed && !is_fault {
            self.wheels.newest = Some(reading);
        }
        for (pair, of) in self.pairs.iter_mut().zip(PAIRS) {
            let Some(which) = of.iter().position(|speed| *speed == at) else { continue };
            if is_fault && MAY_JOIN.contains(&of) && !pair.is_fine() {
                continue;
            }
            pair.is_fault |= is_fault;
            pair.newest[which] = Some(reading);
            if let [Some(one), Some(other)] = pair.newest {
                pair.newest = [None; 2];
                let mut copy = pair.compare([one, other]);
                if of == DIRECT {
                    copy = copy.or_else(|| pair.compare_with_wheels(&mut self.wheels, [one, other]));
                }
                found = found.or(copy.map(|(which, before)| (Role::SPEEDS[of[which]], before, of)));
            }
        }
        let (copied, before, by) = found?;
        for (pair, of) in self.pairs.iter_mut().zip(PAIRS) {
            if of != by && of.contains(&(copied as usize)) {
                pair.before = None;
            }
        }
        Some((copied, before))
    }
}

impl Pair {
    /// Which of both is the other's value, with its last reading that is right.
    fn compare(&mut self, newest: [Stamped; 2]) -> Option<(usize, Stamped)> {
        let is_fault = std::mem::take(&mut self.is_fault);
        let [[one, _], [other, _]] = newest;
        if (one - other).abs() > ROUNDING * other.abs() || one.abs() < STANDS_RAD_S {
            // With a reading that is refused the difference says nothing.
            if is_fault {
                (self.equal, self.jumped) = (0, None);
            } else {
                self.differ(newest);
            }
            return None;
        }
        let before = self.before?;
        if self.equal == 0 {
            let jumped = self.jump(before, newest);
            self.needed = if jumped.is_some() { SAMPLES } else { SURE };
            self.jumped = jumped.or_else(|| self.leaves(before, newest));
            let is_settled = self.together_since_s.is_some_and(|since_s| newest[OUTPUT][1] - since_s >= SETTLED_S);
            self.is_of_direct = self.jumped.is_none() && is_settled && self.is_fine();
        }
        self.equal = self.equal.saturating_add(1);
        let which = self.jumped.filter(|_| self.equal >= self.needed)?;
        let is_short = newest[which][1] - before[which][1] <= LONGEST_S;
        is_short.then_some((which, before[which]))
    }

    /// The same of turbine and output in the direct gear.
    fn compare_with_wheels(&self, wheels: &mut Wheels, newest: [Stamped; 2]) -> Option<(usize, Stamped)> {
        if self.equal == 0 {
            wheels.learn(newest[OUTPUT]);
            return None;
        }
        let before = self.before.filter(|_| self.is_of_direct && self.equal >= SURE)?;
        let which = wheels.copy(newest[OUTPUT])?;
        let is_short = newest[which][1] - before[which][1] <= LONGEST_S;
        is_short.then_some((which, before[which]))
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
        let is_together = (one - other).abs() <= TOGETHER * one.abs().max(other.abs());
        self.together_since_s = is_together.then(|| self.together_since_s.unwrap_or(time_s));
        (self.before, self.equal, self.jumped) = (Some(newest), 0, None);
    }

    /// Whether two sensors hardly agree to the last digit by chance: their noise is known, and far larger than their resolution.
    fn is_fine(&self) -> bool {
        self.changes >= MANY && self.turns >= self.changes / TURNS && self.alike <= 1 + self.changes / FINE
    }

    /// Which of two noisy speeds left its own way to the other.
    fn leaves(&self, before: [Stamped; 2], newest: [Stamped; 2]) -> Option<usize> {
        let (times, _) = SUDDEN;
        let by = [0, 1].map(|which| (newest[which][0] - before[which][0] - self.own[which][0]).abs());
        let which = usize::from(by[1] > by[0]);
        let passed_s = newest[which][1] - before[which][1];
        let is_clear = by[which] > times * self.own[which][1] && by[which] > 2.0 * by[1 - which];
        (self.is_fine() && is_clear && (0.0..=SLOWEST_S).contains(&passed_s)).then_some(which)
    }

    /// Which of both jumped to the other, where the difference closed at once: it was to be expected on its side of zero. What a clutch takes
    /// to zero would have gone beyond.
    fn jump(&self, before: [Stamped; 2], newest: [Stamped; 2]) -> Option<usize> {
        let (times, min_rad_s) = SUDDEN;
        let [mean, last] = self.error;
        let difference = before[0][0] - before[1][0];
        let expected = difference + self.change;
        let moved = [0, 1].map(|which| (newest[which][0] - before[which][0]).abs());
        let passed_s = newest[0][1].max(newest[1][1]) - before[0][1].min(before[1][1]);
        let is_sudden = expected.abs() > times * mean.max(last) + min_rad_s
            && expected * difference > 0.0
            && (0.0..=SLOWEST_S).contains(&passed_s);
        let which = usize::from(moved[1] > moved[0]);
        let closed = difference.abs();
        let is_one = 2.0 * moved[which] > closed && 2.0 * moved[1 - which] < closed;
        (is_sudden && is_one && self.changes >= LEARNT).then_some(which)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rows in which a speed is withdrawn, of engine and turbine every 10 ms.
    fn found(speeds: impl Fn(u32) -> [f64; 2]) -> Vec<(u32, Role, f64)> {
        let mut copies = Copies::new();
        let mut all = Vec::new();
        for row in 0..600 {
            let (time_s, [engine, turbine]) = (0.01 * f64::from(row), speeds(row));
            assert_eq!(copies.push(Role::EngineSpeed, [engine, time_s], false), None);
            let copy = copies.push(Role::TurbineSpeed, [turbine, time_s], false);
            all.extend(copy.map(|(role, [right, _])| (row, role, right)));
        }
        all
    }

    /// With noise of two sensors, 12 rad/s apart.
    fn apart(row: u32) -> [f64; 2] {
        let noise = |factor: f64| 0.1 * (factor * f64::from(row)).sin();
        [200.0 + 0.1 * f64::from(row) + noise(7.3), 188.0 + 0.1 * f64::from(row) + noise(5.1)]
    }

    #[test]
    fn a_channel_that_shows_the_speed_next_to_it_is_found_by_its_digits() {
        for (which, role) in [(0, Role::EngineSpeed), (1, Role::TurbineSpeed)] {
            let rows = found(|row| {
                let mut speeds = apart(row);
                if (200..300).contains(&row) {
                    speeds[which] = speeds[1 - which];
                }
                speeds
            });
            assert_eq!(rows.iter().map(|(row, ..)| *row).collect::<Vec<_>>(), (202..300).collect::<Vec<_>>());
            assert!(rows.iter().all(|(_, found, right)| *found == role && *right == apart(199)[which]), "{rows:?}");
        }
    }

    #[test]
    fn shafts_that_come_together_are_no_copies() {
        // A lock-up clutch closes in 0.2 s and opens at once; both are then one shaft.
        let locks = |row: u32| {
            let [engine, _] = apart(row);
            let slip = if row < 400 { (12.0 - 0.6 * f64::from(row.max(200) - 200)).max(0.0) } else { 12.0 };
            [engine, engine - slip]
        };
        assert_eq!(found(locks), []);
        // Whole revolutions a minute, 1 rpm a row; and the speeds of a car that stands.
        assert_eq!(found(|row| [900.0, f64::from(600 + row.min(300))]), []);
        assert_eq!(found(|row| if row < 200 { apart(row) } else { [0.0, 0.0] }), []);
        // One jump of both, as where a recording goes on elsewhere.
        assert_eq!(found(|row| if row < 200 { apart(row) } else { [120.0, 120.0 + f64::from(row % 2)] }), []);
    }

    #[test]
    fn a_copy_in_an_inertia_phase_is_found() {
        // The turbine falls by 3 rad/s a row, ever faster, away from the engine.
        let shifts = |row: u32| {
            let (time, [engine, turbine]) = (f64::from(row.max(200) - 200), apart(row));
            [engine, turbine - (3.0 * time + 0.02 * time * time).min(80.0)]
        };
        let rows = found(|row| {
            let [engine, turbine] = shifts(row);
            [engine, if (206..226).contains(&row) { engine } else { turbine }]
        });
        assert_eq!(rows.iter().map(|(row, ..)| *row).collect::<Vec<_>>(), (208..226).collect::<Vec<_>>());
        assert_eq!(found(shifts), []);
    }

    #[test]
    fn a_clutch_that_grips_hard_makes_no_copy() {
        // The slip falls ever faster, and ends within a row.
        for per_row in [5.0, 9.0, 17.0] {
            let grips = |row: u32| {
                let [engine, _] = apart(row);
                let time = f64::from(row.max(200) - 200);
                [engine, engine - (100.0 - per_row * time - 0.3 * time * time).max(0.0)]
            };
            assert_eq!(found(grips), [], "{per_row}");
        }
    }

    #[test]
    fn coarse_readings_of_two_noisy_speeds_agree_by_chance() {
        let noise = |row: u32, factor: u32| f64::from(row * row % 1009 * factor % 1009) / 1009.0 - 0.5;
        for resolution in [0.026, 0.1, 0.5] {
            let coarse = |speed: f64| (speed / resolution).round() * resolution;
            let speeds = |row: u32| {
                // They come together and part every 40 rows.
                let slip = if (row / 40).is_multiple_of(2) { 0.0 } else { 6.0 };
                let engine = 200.0 + 0.02 * f64::from(row) + noise(row, 7);
                [coarse(engine), coarse(200.0 - slip + 0.02 * f64::from(row) + noise(row, 11))]
            };
            assert!(found(speeds).len() <= 3, "{resolution}: {:?}", found(speeds));
        }
    }

    #[test]
    fn a_channel_that_shows_the_speed_of_any_other_shaft_is_found() {
        let mut copies = Copies::new();
        let mut rows = Vec::new();
        for row in 0..300_u32 {
            let (time_s, [engine, turbine]) = (0.01 * f64::from(row), apart(row));
            let wheel = 0.1 * turbine + 0.01 * (2.1 * f64::from(row)).sin();
            let shown = if (200..250).contains(&row) { wheel } else { engine };
            let speeds = [shown, turbine, 0.4 * turbine, wheel];
            for (role, speed) in Role::SPEEDS.into_iter().zip(speeds) {
                rows.extend(copies.push(role, [speed, time_s], false).map(|(role, _)| (row, role)));
            }
        }
        assert_eq!(rows, (202..250).map(|row| (row, Role::EngineSpeed)).collect::<Vec<_>>());
    }

    /// The rows in which turbine or output speed is withdrawn; both turn together until the turbine falls by 1 rad/s a row from row 320 on.
    fn found_in_direct_gear(shown: impl Fn(u32, [f64; 3]) -> [f64; 3]) -> Vec<(u32, Role)> {
        let mut copies = Copies::new();
        let mut all = Vec::new();
        for row in 0..500_u32 {
            let noise = |factor: f64| 0.1 * (factor * f64::from(row)).sin();
            let output = 150.0 + 0.02 * f64::from(row);
            let turbine = output - f64::from(row.clamp(320, 370) - 320);
            let speeds = shown(row, [turbine + noise(7.3), output + noise(5.1), 0.3 * output + noise(3.7)]);
            let roles = [Role::TurbineSpeed, Role::OutputSpeed, Role::WheelSpeed];
            for (role, speed) in roles.into_iter().zip(speeds) {
                all.extend(copies.push(role, [speed, 0.01 * f64::from(row)], false).map(|(role, _)| (row, role)));
            }
        }
        all
    }

    #[test]
    fn wheels_tell_which_of_two_equal_speeds_is_a_copy_in_the_direct_gear() {
        let fails = |row: u32| (300..400).contains(&row);
        assert_eq!(found_in_direct_gear(|_, right| right), []);
        // The turbine shows the output: found at the fifth equal reading.
        let rows = found_in_direct_gear(|row, [t, o, w]| [if fails(row) { o } else { t }, o, w]);
        assert_eq!(rows, (304..400).map(|row| (row, Role::TurbineSpeed)).collect::<Vec<_>>());
        // The output shows the turbine: which of both it is shows when they leave the wheels by more than tyres slip.
        let rows = found_in_direct_gear(|row, [t, o, w]| [t, if fails(row) { t } else { o }, w]);
        let output =
            rows.iter().filter(|(_, role)| *role == Role::OutputSpeed).map(|(row, _)| *row).collect::<Vec<_>>();
        assert_eq!(output, (output[0]..400).collect::<Vec<_>>());
        assert!((322..332).contains(&output[0]), "{}", output[0]);
    }

    #[test]
    fn a_control_unit_may_send_one_value_in_the_direct_gear() {
        // From the first row in the gear on: what comes before it is a passage.
        let one =
            |row: u32, [t, o, w]: [f64; 3]| if row < 60 { [t - 0.5 * f64::from(60 - row), o, w] } else { [o, o, w] };
        assert_eq!(found_in_direct_gear(one), []);
        // Without a wheel speed nothing tells which of both is wrong.
        let copies = |row: u32, [t, o, _]: [f64; 3]| [if row < 300 { t } else { o }, o, f64::NAN];
        assert_eq!(found_in_direct_gear(copies), []);
    }

    #[test]
    fn a_copy_is_believed_in_the_end() {
        let rows = found(|row| if row < 200 { apart(row) } else { [apart(row)[0]; 2] });
        let last = rows.last().map(|(row, ..)| 0.01 * f64::from(*row - 200)).unwrap_or_default();
        assert!((LONGEST_S - 0.03..=LONGEST_S).contains(&last), "{last}");
    }
}
