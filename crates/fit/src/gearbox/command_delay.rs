//! Commands that a logger has stored much too late or too early.
//!
//! The delay of each valve is fitted near that of the file. Where all commands are late by a tenth of a second, as of another bus than the speeds or of a
//! time stamp of the whole message, the fit would end in a wrong minimum. So a common delay is looked for first: that with which shifts
//! have the minimum cost after one step of the fit from the values of the file.

use super::shift::ShiftModel;
use super::shift_log::ShiftLog;
use super::solver::Problem;
use crate::verdict::SIDES;
use crate::{Known, MapChange};

/// Step of the delays that are looked at first, s, and how many there are to each side; then those between, in quarters.
const STEP_S: f64 = 0.05;
const STEPS: i32 = 5;
const PART: f64 = 0.25;
const PARTS: i32 = 3;
/// Shifts that are looked at: more do not make a coarse search better.
const SHIFTS: usize = 16;
/// Minimum delay that is said, s \[chosen: with a valve anywhere within 0 to 30 ms, the fit finds it by itself\].
const MIN_S: f64 = 0.04;
/// Minimum cost with another delay over that without, above which it is not said \[chosen; in drawn cars with 100 ms it is 0.01\].
const LESS: f64 = 1.0 / 3.0;

/// The common delay of all commands, s, where it is so large that the fit would not find it.
pub(crate) fn common_delay_s(problem: &Problem<'_>, models: &[ShiftModel]) -> Option<f64> {
    let every = models.len().div_ceil(SHIFTS).max(1);
    let some: Vec<&ShiftModel> = models.iter().step_by(every).collect();
    let cost = |late_s: f64| {
        let moved: Vec<ShiftModel> = some.iter().map(|model| model.with_commands_earlier(late_s)).collect();
        problem.cost_after_a_step(&moved)
    };
    let near = |middle_s: f64, step_s: f64, steps: i32| {
        let all = (-steps..=steps).map(|step| middle_s + step_s * f64::from(step));
        all.map(|late_s| (late_s, cost(late_s))).min_by(|one, other| one.1.total_cmp(&other.1))
    };
    let (coarse_s, _) = near(0.0, STEP_S, STEPS)?;
    let (late_s, minimum) = near(coarse_s, PART * STEP_S, PARTS)?;
    if late_s.abs() < MIN_S || minimum >= LESS * cost(0.0) {
        return None;
    }
    // The parabola through the minimum and its neighbours.
    let [before, after] = [-1.0, 1.0].map(|side| cost(late_s + side * PART * STEP_S));
    let bend = before + after - 2.0 * minimum;
    let beside = if bend > 0.0 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 };
    Some(late_s + beside * PART * STEP_S)
}

/// The shifts with all commands so much earlier.
pub(crate) fn with_commands_earlier(shifts: &[ShiftLog], late_s: f64) -> Vec<ShiftLog> {
    let moved = |log: &ShiftLog| {
        let mut log = log.clone();
        log.commands.iter_mut().flat_map(|commands| &mut commands.time_s).for_each(|time_s| *time_s -= late_s);
        log
    };
    shifts.iter().map(moved).collect()
}

/// What a fit says of commands that are late by so much, s.
pub(crate) fn said_of_commands(late: Known) -> String {
    let Known { value: late_s, sd, .. } = late;
    let instruction = MapChange::of_commands(&late).instruction();
    let (late, or) = match late_s > 0.0 {
        true => ("late", ""),
        false => ("early", ", unless the valves react so much later than the vehicle file says"),
    };
    format!(
        "the commands of these logs are {:.0} +- {:.0} ms too {late} against the speeds: {instruction}{or}. Then fit again",
        1e3 * late_s.abs(),
        1e3 * SIDES * sd
    )
}
