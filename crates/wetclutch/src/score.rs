//! Estimates against the truth of a simulation.

use std::fmt;

use evaluate::{ClutchRow, ShiftScoreRow, SquaredErrors, TruePhase};
use observer::Health;
use trace::signal;

use crate::estimate::gearbox::columns::CLUTCH;
use crate::{Error, Table};

/// Slip below which a true clutch sticks, rad/s.
const STICKS_RAD_S: f64 = 0.05;
/// Rows of truth and estimate whose times differ by less than this belong together, s.
const SAME_S: f64 = 1e-6;

/// How good the estimates of the shifts of a drive are.
#[derive(Debug, Clone, PartialEq)]
pub struct Scores {
    /// By clutch and by what the true clutches do.
    pub phases: Vec<PhaseScore>,
    /// Pressures and torques that have a guaranteed range.
    pub ranged: usize,
    /// Those of them that are outside.
    pub outside: usize,
}

/// Root mean square errors of one clutch in one phase: of the estimate, and of the valve model alone (the open loop).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhaseScore {
    /// `offgoing` or `oncoming`.
    pub clutch: &'static str,
    /// `torque phase`: the other clutch holds; `inertia phase`: both slip.
    pub phase: &'static str,
    /// Rows in it.
    pub rows: usize,
    /// Of the pressure, Pa.
    pub pressure_pa: [f64; 2],
    /// Of the torque, N m.
    pub torque_n_m: [f64; 2],
}

/// Compares estimates of a car with a gearbox with the truth of the drive, while shifts are under way.
///
/// # Errors
/// A column is missing in one of the tables.
pub fn score(truth: &Table, estimates: &Table) -> Result<Scores, Error> {
    let rows = rows(truth, estimates)?;
    let mut phases = Vec::new();
    for (phase, phase_name) in [(TruePhase::Torque, "torque phase"), (TruePhase::Inertia, "inertia phase")] {
        for (at, clutch) in ["offgoing", "oncoming"].into_iter().enumerate() {
            let torque = SquaredErrors::of(&rows, phase, at);
            let (pressure_pa, torque_n_m) = (SquaredErrors::of_pressure(&rows, phase, at).rms_pa(), torque.rms_n_m());
            let rows = torque.rows as usize;
            phases.push(PhaseScore { clutch, phase: phase_name, rows, pressure_pa, torque_n_m });
        }
    }
    let clutches = || rows.iter().flat_map(|row| row.clutches);
    let ranged = clutches()
        .map(|of| usize::from(of.pressure_range_pa.is_some()) + usize::from(of.torque_range_n_m.is_some()))
        .sum();
    let outside = clutches().filter(|of| !of.in_range).count();
    Ok(Scores { phases, ranged, outside })
}

/// The rows of shifts in which both tables have both clutches.
fn rows(truth: &Table, estimates: &Table) -> Result<Vec<ShiftScoreRow>, Error> {
    let numbers = |table: &'_ Table, name: &str, which: &str| match table.numbers(name) {
        Some(numbers) => Ok(numbers.to_vec()),
        None => Err(Error::Input(format!(
            "the {which} has no column `{name}` of numbers\nhint: the truth is that of a simulation, the estimates are of a car with a gearbox, with \
             all columns"
        ))),
    };
    let true_of = |name: &str| numbers(truth, name, "truth");
    let found_of = |name: &str| numbers(estimates, name, "table of estimates");
    let truths = [
        [signal::OFFGOING_PRESSURE, signal::OFFGOING_TORQUE, signal::OFFGOING_SLIP],
        [signal::ONCOMING_PRESSURE, signal::ONCOMING_TORQUE, signal::ONCOMING_SLIP],
    ];
    let mut of_truth = Vec::new();
    for clutch in truths {
        of_truth.push([true_of(clutch[0])?, true_of(clutch[1])?, true_of(clutch[2])?]);
    }
    let mut of_estimates = Vec::new();
    for role in ["offgoing", "oncoming"] {
        let mut columns = Vec::new();
        for what in &CLUTCH[..8] {
            columns.push(found_of(&format!("{role}_{what}"))?);
        }
        of_estimates.push(columns);
    }
    let (true_s, found_s) = (true_of(signal::TIME)?, found_of(signal::TIME)?);
    let mut rows = Vec::new();
    let mut at = 0;
    for (row, time_s) in found_s.iter().enumerate() {
        while at < true_s.len() && true_s[at] < time_s - SAME_S {
            at += 1;
        }
        if true_s.get(at).is_none_or(|truth_s| (truth_s - time_s).abs() > SAME_S) {
            continue;
        }
        let clutch = |which: usize| {
            let truth = of_truth[which].each_ref().map(|column| column[at]);
            let found: Vec<f64> = of_estimates[which].iter().map(|column| column[row]).collect();
            clutch_row(truth, &found)
        };
        let (Some(offgoing), Some(oncoming)) = (clutch(0), clutch(1)) else { continue };
        rows.push(ShiftScoreRow {
            time_s: *time_s,
            clutches: [offgoing, oncoming],
            turbine_n_m: [f64::NAN; 2],
            at_turbine_n_m: None,
            speeds_rad_s: [f64::NAN; 4],
            flare_rad_s: f64::NAN,
            phase: "-",
            health: Health::Good,
        });
    }
    Ok(rows)
}

/// A clutch at one time; `None` where truth or estimate is not there.
fn clutch_row([pressure_pa, torque_n_m, slip_rad_s]: [f64; 3], found: &[f64]) -> Option<ClutchRow> {
    let &[estimate_pa, low_pa, high_pa, estimate_n_m, low_n_m, high_n_m, valve_pa, valve_n_m] = found else {
        return None;
    };
    if torque_n_m.is_nan() || estimate_n_m.is_nan() {
        return None;
    }
    let range = |low: f64, high: f64| (!low.is_nan() && !high.is_nan()).then_some([low, high]);
    let (pressure_range_pa, torque_range_n_m) = (range(low_pa, high_pa), range(low_n_m, high_n_m));
    let in_range = evaluate::score::within(pressure_range_pa, pressure_pa, evaluate::ROUNDING_PA)
        && evaluate::score::within(torque_range_n_m, torque_n_m, evaluate::ROUNDING_N_M);
    Some(ClutchRow {
        // The valve model knows no direction: it is given the true one.
        torque_n_m: [torque_n_m, estimate_n_m, valve_n_m.abs().copysign(torque_n_m)],
        torque_std_dev_n_m: f64::NAN,
        pressure_std_dev_pa: f64::NAN,
        pressure_pa: [pressure_pa, estimate_pa, valve_pa],
        slip_rad_s,
        slip_range_rad_s: None,
        alpha: f64::NAN,
        drag_n_m: 0.0,
        sticks: slip_rad_s.abs() < STICKS_RAD_S,
        torque_range_n_m,
        pressure_range_pa,
        hidden: false,
        in_range,
        has_pressure: !estimate_pa.is_nan(),
    })
}

impl fmt::Display for Scores {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "root mean square error, estimate (open loop):")?;
        for score in self.phases.iter().filter(|score| score.rows > 0) {
            let [pressure, valve_pressure] = score.pressure_pa.map(|error| 1e-3 * error);
            let [torque, valve_torque] = score.torque_n_m;
            writeln!(
                f,
                "  {}, {}: pressure {pressure:.1} ({valve_pressure:.1}) kPa, torque {torque:.1} ({valve_torque:.1}) N m, {} rows",
                score.phase, score.clutch, score.rows
            )?;
        }
        write!(f, "outside the guaranteed range: {} of {} rows of a clutch", self.outside, self.ranged / 2)
    }
}
