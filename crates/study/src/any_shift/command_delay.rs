//! Commands of a log that come late or early against its speeds, as by a logger's delay.
//!
//! Over a shift the turbine's balance gives the torque of its clutches, `U = T_t - M11 w_t' - M12 w_o'`, and the pressures by the valve
//! models give the torque that they can carry. Both are compared with the pressures moved by -300 to 300 ms: where both clutches slip, `U` is
//! the sum of what they can carry; where one holds, it carries the rest, up to what it can. The move with the least difference over the shifts
//! of the log is the delay of its commands. An error of friction, valve gain or turbine torque moves upshifts and downshifts in opposite
//! directions, a delay in the same one.

use std::collections::VecDeque;

use design::ShiftTables;
use observer::any_shift::{MAX_ELEMENTS, ShiftEstimate, ShiftRow};

use super::logged::LogStep;

/// Time between two points of a shift, and between two moves, s.
const GRID_S: f64 = 0.01;
/// Moves to either side, and all of them.
const TO_ONE_SIDE: usize = 30;
const MOVES: usize = 2 * TO_ONE_SIDE + 1;
/// Points to either side over which the rate of a speed is taken.
const RATE: usize = 3;
/// Points that are needed before and after a shift.
const AROUND: usize = TO_ONE_SIDE + RATE;
/// Longest shift that is compared, s \[chosen\].
const LONGEST_S: f64 = 3.0;
/// Rows further apart show too little of a shift, s \[chosen\].
const SPARSE_S: f64 = 0.055;
/// Slip at the turbine below which a clutch holds, rad/s \[chosen\]: the noise of toothed wheels.
const HOLDS_RAD_S: f64 = 5.0;
/// Points of a shift with a slip that are needed.
const ENOUGH_POINTS: u32 = 10;
/// By how much the torques may differ in a car within its error budget, as a share and beside it, N m; a difference counts up to so many
/// times this \[chosen\].
const SHARE: f64 = 0.15;
const BESIDE_N_M: f64 = 5.0;
const MOST: f64 = 3.0;
/// Shifts that are needed to judge \[chosen\].
const ENOUGH_SHIFTS: u32 = 4;
/// Delay from which on it is said, s \[chosen\]: above what errors of friction, valves and strokes within their bounds look like.
const SAID_S: f64 = 0.055;
/// Share of the difference that the delay leaves at most \[chosen\].
const LEFT: f64 = 0.9;

/// What a row says.
#[derive(Debug, Clone, Copy)]
struct Point {
    time_s: f64,
    turbine_rad_s: f64,
    output_rad_s: f64,
    turbine_n_m: f64,
    valve_pa: [f64; MAX_ELEMENTS],
}

impl Point {
    /// Between two points, at a share of the way to the other.
    fn between(&self, other: &Self, share: f64) -> Self {
        let mix = |a: f64, b: f64| a + share * (b - a);
        Self {
            time_s: mix(self.time_s, other.time_s),
            turbine_rad_s: mix(self.turbine_rad_s, other.turbine_rad_s),
            output_rad_s: mix(self.output_rad_s, other.output_rad_s),
            turbine_n_m: mix(self.turbine_n_m, other.turbine_n_m),
            valve_pa: std::array::from_fn(|at| mix(self.valve_pa[at], other.valve_pa[at])),
        }
    }
}

/// A completed shift that waits for the rows after it.
struct Waiting {
    from: usize,
    to: usize,
    begin_s: f64,
    end_s: f64,
}

/// The delays of a log's shifts, so far.
pub(super) struct CommandDelay<'c> {
    tables: &'c ShiftTables<f64>,
    /// The last rows, at least about [`GRID_S`] apart.
    rows: VecDeque<Point>,
    waiting: VecDeque<Waiting>,
    /// Greatest age that the commands of a row have had by themselves, s: so much of the delay the filter knows.
    age_s: f64,
    /// Shifts that were compared, and the sum of their mean differences at each move.
    shifts: u32,
    differences: [f64; MOVES],
    /// The delay, s, and whether it is beyond the last move, if the shifts show one.
    found: Option<(f64, bool)>,
}

impl<'c> CommandDelay<'c> {
    pub(super) fn new(tables: &'c ShiftTables<f64>) -> Self {
        Self {
            tables,
            rows: VecDeque::new(),
            waiting: VecDeque::new(),
            age_s: 0.0,
            shifts: 0,
            differences: [0.0; MOVES],
            found: None,
        }
    }

    /// Whether the shifts so far show a delay.
    pub(super) fn is_found(&self) -> bool {
        self.found.is_some()
    }

    /// Takes a row with the newest speeds of turbine and output, rad/s.
    pub(super) fn push(&mut self, step: &LogStep, estimate: &ShiftEstimate<f64>, [turbine, output]: [f64; 2]) {
        let time_s = step.time_s;
        if self.rows.back().is_some_and(|row| time_s - row.time_s < 0.9 * GRID_S) {
            return;
        }
        let ages_s = step.input.commands.iter().flatten().map(|command| command.age_s);
        self.age_s = ages_s.fold(self.age_s, f64::max);
        self.rows.push_back(Point {
            time_s,
            turbine_rad_s: turbine,
            output_rad_s: output,
            turbine_n_m: estimate.turbine_n_m.unwrap_or(f64::NAN),
            valve_pa: estimate.valve_pa,
        });
        let after_s = span_s(AROUND + 2);
        while self.rows.front().is_some_and(|row| time_s - row.time_s > LONGEST_S + 2.0 * after_s) {
            self.rows.pop_front();
        }
        if self.waiting.front().is_some_and(|shift| time_s > shift.end_s + after_s)
            && let Some(shift) = self.waiting.pop_front()
        {
            self.judge(&shift);
        }
    }

    /// A shift between these gears is completed.
    pub(super) fn end(&mut self, [from, to]: [usize; 2], [begin_s, end_s]: [f64; 2]) {
        if end_s - begin_s <= LONGEST_S {
            self.waiting.push_back(Waiting { from, to, begin_s, end_s });
        }
    }

    fn judge(&mut self, waiting: &Waiting) {
        let Some(&shift) = self.tables.tables().shift(waiting.from, waiting.to) else { return };
        // A one-way clutch has no pressure.
        if shift.clutches.iter().any(|clutch| clutch.is_one_way()) {
            return;
        }
        let Some(points) = self.points(waiting) else { return };
        let Some(differences) = self.differences(&shift, &points) else { return };
        self.shifts += 1;
        self.differences.iter_mut().zip(differences).for_each(|(sum, difference)| *sum += difference);
        self.found = self.delay();
    }

    /// The rows of a shift and those around it, every [`GRID_S`]; none where rows are missing.
    fn points(&self, waiting: &Waiting) -> Option<Vec<Point>> {
        let (mut points, mut at) = (Vec::new(), 0);
        let mut time_s = waiting.begin_s - span_s(AROUND);
        while time_s <= waiting.end_s + span_s(AROUND) {
            while self.rows.get(at + 1).is_some_and(|row| row.time_s < time_s) {
                at += 1;
            }
            let (before, after) = (self.rows.get(at)?, self.rows.get(at + 1)?);
            let step_s = after.time_s - before.time_s;
            if step_s > SPARSE_S || before.time_s > time_s + GRID_S {
                return None;
            }
            points.push(before.between(after, ((time_s - before.time_s) / step_s).clamp(0.0, 1.0)));
            time_s += GRID_S;
        }
        Some(points)
    }

    /// Mean difference of the torques of a shift at each move; none of a shift without enough slip.
    fn differences(&self, shift: &ShiftRow<f64>, points: &[Point]) -> Option<[f64; MOVES]> {
        let clutches = shift.clutches.map(|of| (of, &self.tables.tables().elements[of.element].clutch));
        let forces: Vec<[f64; 2]> = (points.iter())
            .map(|point| clutches.map(|(of, clutch)| clutch.clamp_force(point.valve_pa[of.element])))
            .collect();
        let [m11, m12] = shift.mass_kg_m2[0];
        let (mut sums, mut used) = ([0.0; MOVES], 0);
        for at in AROUND..points.len().saturating_sub(AROUND) {
            let (point, before, after) = (&points[at], &points[at - RATE], &points[at + RATE]);
            let rate = |of: fn(&Point) -> f64| (of(after) - of(before)) / (2.0 * span_s(RATE));
            let needed = point.turbine_n_m - m11 * rate(|of| of.turbine_rad_s) - m12 * rate(|of| of.output_rad_s);
            let slips = clutches.map(|(of, _)| point.turbine_rad_s - of.ratio * point.output_rad_s);
            let holds = slips.map(|slip| slip.abs() < HOLDS_RAD_S);
            if !needed.is_finite() || holds == [true; 2] {
                continue;
            }
            used += 1;
            let per_force: [f64; 2] = std::array::from_fn(|c| {
                let (of, clutch) = clutches[c];
                of.alpha.abs() * clutch.torque_per_force(of.alpha * slips[c]) * slips[c].signum()
            });
            let scale = SHARE * needed.abs().max(point.turbine_n_m.abs()) + BESIDE_N_M;
            for (sum, forces) in sums.iter_mut().zip(&forces[at - TO_ONE_SIDE..]) {
                let carried = [per_force[0] * forces[0], per_force[1] * forces[1]];
                let beyond = |held: usize| ((needed - carried[1 - held]).abs() - carried[held].abs()).max(0.0);
                let difference = match holds {
                    [true, _] => beyond(0),
                    [_, true] => beyond(1),
                    _ => (needed - carried[0] - carried[1]).abs(),
                };
                *sum += (difference / scale).min(MOST);
            }
        }
        (used >= ENOUGH_POINTS).then(|| sums.map(|sum| sum / f64::from(used)))
    }

    /// The delay of the log, s, and whether it may be larger, if its shifts show one.
    fn delay(&self) -> Option<(f64, bool)> {
        let least = (0..MOVES).min_by(|a, b| self.differences[*a].total_cmp(&self.differences[*b]))?;
        let moved_s = moved_s(least);
        let delay_s = if moved_s > 0.0 { (moved_s - self.age_s).max(0.0) } else { moved_s };
        let is_explained = self.differences[least] <= LEFT * self.differences[TO_ONE_SIDE];
        let is_found = self.shifts >= ENOUGH_SHIFTS && delay_s.abs() >= SAID_S && is_explained;
        is_found.then_some((delay_s, least == 0 || least == MOVES - 1))
    }

    /// The delay of the log, in a sentence.
    pub(super) fn warning(&self) -> Option<String> {
        let (delay_s, is_at_end) = self.found?;
        let late = if delay_s > 0.0 { "late" } else { "early" };
        let or_more = if is_at_end { " or more" } else { "" };
        Some(format!(
            "warning: the commands of the valves come about {:.0} ms{or_more} too {late} against the speeds, by the turbine's torques in {} shifts: the \
             guaranteed ranges do not hold, and the estimates are worse. `late_s = {delay_s:.2}` in each `channel.element_NAME_...` of a channel map moves \
             them to their time (in those of gear and target_gear too if they have the same delay); `wetclutch inspect LOG --suggest` makes a map",
            1e3 * delay_s.abs(),
            self.shifts
        ))
    }
}

/// How far the pressures of a place among the moves are moved, s: positive for commands that come late.
#[expect(clippy::cast_precision_loss, reason = "a handful")]
fn moved_s(place: usize) -> f64 {
    (place as f64 - TO_ONE_SIDE as f64) * GRID_S
}

/// The time of so many points, s.
#[expect(clippy::cast_precision_loss, reason = "a handful")]
fn span_s(points: usize) -> f64 {
    points as f64 * GRID_S
}
