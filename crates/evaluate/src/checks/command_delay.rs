//! Commands of a log that come late or early against its speeds, as by a logger's delay.
//!
//! Over a shift the turbine's balance gives the torque of its clutches, `U = T_t - M11 w_t' - M12 w_o'`, and the pressures by the valve
//! models give the torque that they can carry. Both are compared with the pressures moved by -300 to 300 ms: where both clutches slip, `U` is
//! the sum of what they can carry; where one holds, it carries the rest, up to what it can. The move with the minimum difference over the
//! shifts of the log is the delay of its commands. An error of friction, valve gain or turbine torque moves upshifts and downshifts in
//! opposite directions, a delay in the same one; where the shifts are slow, it may move both in the same one too. So that clutches that are
//! weaker or stronger, or a wrong scale or offset of the commands, are not taken for a delay, each move is tried with other torques and with
//! other offsets of the pressures, and it has to be better than all of them are without a move.

use std::collections::VecDeque;

use car::{ElementErrors, ErrorBudget, ShiftCommand};
use observer::ShiftTables;
use observer::gearbox::{MAX_ELEMENTS, ShiftRow};

use super::check::{Check, CheckedRow, EndedShift};

/// Time between two points of a shift, and between two moves, s.
const GRID_S: f64 = 0.02;
/// Moves to either side, and all of them.
const TO_ONE_SIDE: usize = 15;
const MOVES: usize = 2 * TO_ONE_SIDE + 1;
/// Points to either side over which the rate of a speed is taken.
const RATE: usize = 1;
/// Points that are needed before and after a shift.
const AROUND: usize = TO_ONE_SIDE + RATE;
/// Longest shift that is compared, s \[chosen\].
const LONGEST_S: f64 = 3.0;
/// Rows further apart show too little of a shift, s \[chosen\].
const SPARSE_S: f64 = 0.055;
/// Slip at the turbine below which a clutch holds, rad/s \[chosen\]: the noise of toothed wheels.
const HOLDS_RAD_S: f64 = 5.0;
/// Points of a shift with a slip that are needed.
const ENOUGH_POINTS: u32 = 5;
/// By how much the torques may differ in a car within its error budget, as a fraction and beside it, N m; a difference counts up to so many
/// times this \[chosen\].
const FRACTION: f64 = 0.15;
const BESIDE_N_M: f64 = 5.0;
const MAXIMUM: f64 = 3.0;
/// Shifts up and shifts down that are needed to judge, each \[chosen\]: an error of friction, gain or torque moves them in opposite directions.
const ENOUGH_SHIFTS: u32 = 2;
/// Delay from which on it is reported, s \[chosen\]: above what errors of friction, valves and strokes within the default bounds look like, as far
/// as the filter has not learnt lag and delay of the valves.
const REPORTED_S: f64 = 0.065;
/// Half of the range of the delay of a valve, s, and its relative error of the lag in the default bounds, and the lag of a usual valve at low pressure, s:
/// wider bounds report later by what they add.
const DEFAULT_DELAY_S: f64 = 0.015;
const DEFAULT_LAG: f64 = 0.5;
const LAG_S: f64 = 0.2;
/// Relative errors of friction and valve gain together in the default bounds, and the time in which a clutch takes its load, s \[chosen\]: a clutch that
/// is stronger by a fraction takes it earlier by about that fraction of this time.
const DEFAULT_STRENGTH: f64 = 0.25;
const LOAD_S: f64 = 0.3;
/// Fraction of the difference that the delay leaves at most \[chosen\].
const LEFT: f64 = 0.9;

/// Errors of the torque at the same pressure, over the bounds of friction and valve gain together, and offsets of the pressures, over the bound of
/// the hysteresis or half of what the error of the commands does, whichever is larger, that are tried \[chosen\]: old oil and worn plates take more
/// than new ones add. Both together stand for another scale of the commands.
const STRENGTHS: [f64; 6] = [-1.6, -1.0, -0.5, 0.0, 0.5, 1.0];
const OFFSETS: [f64; 3] = [-4.0, 0.0, 4.0];
/// Smallest factor of the torque that is tried.
const FACTOR_MIN: f64 = 0.2;
const VARIANTS: usize = STRENGTHS.len() * OFFSETS.len();

/// By factor of the torque and offset of the pressures, then by move.
type Differences = [[f64; MOVES]; VARIANTS];

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
    /// Between two points, at a fraction of the way to the other.
    fn between(&self, other: &Self, fraction: f64) -> Self {
        let mix = |a: f64, b: f64| a + fraction * (b - a);
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
    shift: ShiftCommand,
    begin_s: f64,
    end_s: f64,
}

/// The delays of a log's shifts, so far.
pub(crate) struct CommandDelay<'c> {
    tables: &'c ShiftTables<f64>,
    /// Factors of the torques by the valve models, and offsets of their pressures, Pa, that are tried.
    variants: [(f64, f64); VARIANTS],
    /// Delay from which on it is reported, s.
    reported_s: f64,
    /// The last rows, at least about [`GRID_S`] apart.
    rows: VecDeque<Point>,
    waiting: VecDeque<Waiting>,
    /// Maximum age that the commands of a row have had by themselves, s: so much of the delay the filter knows.
    age_s: f64,
    /// Shifts up and shifts down that were compared, and the sums of their mean differences.
    shifts: [u32; 2],
    differences: Box<Differences>,
    /// The delay, s, and whether it is beyond the last move, if the shifts show one.
    found: Option<(f64, bool)>,
}

impl<'c> CommandDelay<'c> {
    pub(crate) fn new(tables: &'c ShiftTables<f64>, budget: &ErrorBudget) -> Self {
        let most_off = |[minimum, maximum]: [f64; 2]| (maximum - 1.0).max(1.0 - minimum);
        let gain = budget.widest(|of| most_off(of.valve_gain_factor));
        let offsets = budget.elements.iter().enumerate().filter_map(|(at, errors)| {
            let (errors, element) = (errors.as_ref()?, tables.tables().elements.get(tables.place(at)?)?);
            let by_command_pa = errors.by_command_pa(&element.valve.valve, element.clutch.kiss_pressure());
            Some(errors.valve_hysteresis_pa.max(0.5 * by_command_pa))
        });
        let offset_pa = offsets.fold(0.0, f64::max);
        let more_delay_s = (budget.widest(ElementErrors::valve_delay) - DEFAULT_DELAY_S).max(0.0);
        let more_lag_s = LAG_S * (budget.widest(|of| most_off(of.valve_lag_factor)) - DEFAULT_LAG).max(0.0);
        let strength = gain + budget.widest(|of| most_off(of.friction_factor));
        let variants = std::array::from_fn(|at| {
            let (of_strength, of_offset) = (STRENGTHS[at / OFFSETS.len()], OFFSETS[at % OFFSETS.len()]);
            ((1.0 + of_strength * strength).max(FACTOR_MIN), of_offset * offset_pa)
        });
        let more_strength_s = LOAD_S * (strength - DEFAULT_STRENGTH).max(0.0);
        Self {
            tables,
            variants,
            reported_s: REPORTED_S + more_delay_s + more_lag_s + more_strength_s,
            rows: VecDeque::new(),
            waiting: VecDeque::new(),
            age_s: 0.0,
            shifts: [0; 2],
            differences: Box::new([[0.0; MOVES]; VARIANTS]),
            found: None,
        }
    }

    /// Whether the shifts so far show a delay.
    pub(crate) fn is_found(&self) -> bool {
        self.found.is_some()
    }

    fn judge(&mut self, waiting: &Waiting) {
        let Some(&shift) = self.tables.tables().commanded(waiting.shift) else { return };
        // A one-way clutch or a dog has no pressure.
        if shift.clutches.iter().any(|clutch| !clutch.has_pressure()) {
            return;
        }
        let Some(points) = self.points(waiting) else { return };
        let Some(differences) = self.differences(&shift, &points) else { return };
        let [off, on] = shift.clutches.map(|clutch| clutch.ratio);
        self.shifts[usize::from(on > off)] += 1;
        let sums = self.differences.iter_mut().flatten().zip(differences.iter().flatten());
        sums.for_each(|(sum, difference)| *sum += difference);
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

    /// Mean differences of the torques of a shift; none of one without enough slip.
    fn differences(&self, shift: &ShiftRow<f64>, points: &[Point]) -> Option<Differences> {
        let elements = self.tables.tables().elements;
        let [Some(off), Some(on)] = shift.clutches.map(|of| Some((of, of.element.place()?))) else { return None };
        let clutches = [off, on].map(|(of, place)| (of, place, &elements[place].clutch));
        let force = |point: &Point, (factor, offset_pa): (f64, f64)| {
            clutches.map(|(_, place, clutch)| factor * clutch.clamp_force(point.valve_pa[place] + offset_pa))
        };
        let forces: Vec<Vec<[f64; 2]>> =
            self.variants.iter().map(|&variant| points.iter().map(|point| force(point, variant)).collect()).collect();
        let [m11, m12] = shift.mass_kg_m2[0];
        let (mut sums, mut used) = ([[0.0; MOVES]; VARIANTS], 0);
        for at in AROUND..points.len().saturating_sub(AROUND) {
            let (point, before, after) = (&points[at], &points[at - RATE], &points[at + RATE]);
            let rate = |of: fn(&Point) -> f64| (of(after) - of(before)) / (2.0 * span_s(RATE));
            let needed_n_m = point.turbine_n_m - m11 * rate(|of| of.turbine_rad_s) - m12 * rate(|of| of.output_rad_s);
            let slips = clutches.map(|(of, ..)| point.turbine_rad_s - of.ratio * point.output_rad_s);
            let holds = slips.map(|slip| slip.abs() < HOLDS_RAD_S);
            if !needed_n_m.is_finite() || holds == [true; 2] {
                continue;
            }
            used += 1;
            let per_force = [0, 1].map(|c| {
                let (of, _, clutch) = clutches[c];
                of.alpha.abs() * clutch.torque_per_force(of.alpha * slips[c]) * slips[c].signum()
            });
            let balance = Balance { needed_n_m, per_force, holds };
            let scale = (FRACTION * needed_n_m.abs().max(point.turbine_n_m.abs()) + BESIDE_N_M).recip();
            for (sums, forces) in sums.iter_mut().zip(&forces) {
                for (sum, forces) in sums.iter_mut().zip(&forces[at - TO_ONE_SIDE..]) {
                    *sum += (scale * balance.difference_n_m(*forces)).min(MAXIMUM);
                }
            }
        }
        (used >= ENOUGH_POINTS).then(|| sums.map(|sums| sums.map(|sum| sum / f64::from(used))))
    }

    /// The delay of the log, s, and whether it may be larger, if its shifts show one.
    fn delay(&self) -> Option<(f64, bool)> {
        let minimum =
            |sums: &[f64; MOVES]| (0..MOVES).min_by(|a, b| sums[*a].total_cmp(&sums[*b])).unwrap_or(TO_ONE_SIDE);
        let best =
            self.differences.iter().map(|sums| (sums, minimum(sums))).min_by(|(a, i), (b, j)| a[*i].total_cmp(&b[*j]));
        let (sums, place) = best?;
        let unmoved = self.differences.iter().map(|sums| sums[TO_ONE_SIDE]).fold(f64::INFINITY, f64::min);
        let moved_s = moved_s(place) + GRID_S * between(sums, place);
        let delay_s = if moved_s > 0.0 { (moved_s - self.age_s).max(0.0) } else { moved_s };
        let is_enough = self.shifts.iter().all(|shifts| *shifts >= ENOUGH_SHIFTS);
        let is_found = is_enough && delay_s.abs() >= self.reported_s && sums[place] <= LEFT * unmoved;
        is_found.then_some((delay_s, place == 0 || place == MOVES - 1))
    }

    /// The delay of the log, in a sentence.
    fn warning(&self) -> Option<String> {
        let (delay_s, is_at_end) = self.found?;
        // It is not known to the millisecond.
        let delay_s = 0.01 * (delay_s / 0.01).round();
        let (late, cause) = if delay_s > 0.0 { ("late", "") } else { ("early", ", as by air in the oil,") };
        let or_more = if is_at_end { " or more" } else { "" };
        Some(format!(
            "warning: the commands of the valves come about {:.0} ms{or_more} too {late} against the speeds, by the turbine's torques in {} shifts: then the \
             guaranteed ranges do not hold, and the estimates are worse. `late_s = {delay_s:.2}` in each `channel.element_NAME_...` of a channel map moves \
             them to their time (in those of gear and target_gear too if they have the same delay); `wetclutch inspect LOG --suggest` makes a map. An \
             offset of all commands looks alike, and valves that are further off than their bounds{cause} do: check both first, as the ranges do not hold either where \
             commands are moved that were in time",
            1e3 * delay_s.abs(),
            self.shifts.iter().sum::<u32>()
        ))
    }
}

impl Check for CommandDelay<'_> {
    fn row(&mut self, row: &CheckedRow<'_>) {
        let (step, estimate, [_, turbine, output]) = (row.step, row.estimate, row.used_rad_s);
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

    fn end(&mut self, ended: &EndedShift<'_>) {
        let Some((_, [begin_s, end_s])) = ended.completed else { return };
        let shift = ended.shift.gears;
        if end_s - begin_s <= LONGEST_S {
            self.waiting.push_back(Waiting { shift, begin_s, end_s });
        }
    }

    fn warnings(&self) -> Vec<String> {
        self.warning().into_iter().collect()
    }
}

/// What the turbine's balance says at one time.
struct Balance {
    /// Torque of both clutches together at the turbine, N m.
    needed_n_m: f64,
    /// Torque at the turbine per force that presses the plates, in the direction of the slip, m.
    per_force: [f64; 2],
    holds: [bool; 2],
}

impl Balance {
    /// How far the clutches with these forces, N, are from it, N m.
    #[inline]
    fn difference_n_m(&self, forces: [f64; 2]) -> f64 {
        let carried = [self.per_force[0] * forces[0], self.per_force[1] * forces[1]];
        let beyond = |held: usize| ((self.needed_n_m - carried[1 - held]).abs() - carried[held].abs()).max(0.0);
        match self.holds {
            [true, _] => beyond(0),
            [_, true] => beyond(1),
            _ => (self.needed_n_m - carried[0] - carried[1]).abs(),
        }
    }
}

/// Where the minimum of a parabola through the smallest sum and its neighbours is, in moves from it.
fn between(sums: &[f64; MOVES], place: usize) -> f64 {
    if place == 0 || place + 1 == MOVES {
        return 0.0;
    }
    let [before, minimum, after] = [sums[place - 1], sums[place], sums[place + 1]];
    let bend = before - 2.0 * minimum + after;
    if bend > 0.0 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 }
}

/// How far the pressures of a place among the moves are moved, s: positive for commands that come late.
fn moved_s(place: usize) -> f64 {
    (place as f64 - TO_ONE_SIDE as f64) * GRID_S
}

/// The time of so many points, s.
fn span_s(points: usize) -> f64 {
    points as f64 * GRID_S
}
