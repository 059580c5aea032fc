//! The bench: all observers of an experiment on all its scenarios, ranked.

use std::time::Instant;

use config::{Experiment, Vehicle};
use observer::{Estimate, Phase};
use serde::Serialize;

use crate::campaign::plan::mixed;
use crate::comparison::{observers, run_observers};
use crate::sampling::sampled;
use crate::{ObserverRun, PhaseScore, RangeScore, RunColumns, ShiftQuality, StudyError, simulate_drive};

/// How one observer did in one scenario.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BenchCell {
    /// The observer.
    pub observer: String,
    /// RMS error of the pressure in the torque phase, Pa.
    pub torque_phase_rms_pa: f64,
    /// RMS error of the pressure in the inertia phase, Pa.
    pub inertia_phase_rms_pa: f64,
    /// RMS error of the pressure over both phases, Pa.
    pub shift_rms_pa: f64,
    /// Chatter in both phases, Pa.
    pub chatter_pa: f64,
    /// RMS error of the drive-shaft torque over both phases, N m, if it estimates that.
    pub shaft_rms_n_m: Option<f64>,
    /// Share of the samples at which pressure and clutch torque lie in their guaranteed ranges, if there are any.
    pub range_coverage: Option<f64>,
    /// Mean width of the guaranteed range of the pressure over both phases, Pa.
    pub range_width_pa: Option<f64>,
    /// The same of the clutch torque, N m.
    pub torque_range_width_n_m: Option<f64>,
    /// The same of the drive-shaft torque, N m.
    pub shaft_range_width_n_m: Option<f64>,
}

/// One scenario.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BenchRow {
    /// Its name.
    pub scenario: String,
    /// Whether the shift passed all its phases within the simulated time; if not, there is nothing to score.
    pub completed: bool,
    /// The observers in the order of the ranking.
    pub cells: Vec<BenchCell>,
}

/// One observer over all completed scenarios. Ratios are to the open loop's error in the same scenario and phase.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BenchSummary {
    /// The observer.
    pub observer: String,
    /// Median ratio over both phases together, by which the observers are ranked.
    pub shift_median_ratio: f64,
    /// Median ratio in the torque phase.
    pub torque_phase_median_ratio: f64,
    /// The worst of these.
    pub torque_phase_worst_ratio: f64,
    /// Median ratio in the inertia phase.
    pub inertia_phase_median_ratio: f64,
    /// The worst of these.
    pub inertia_phase_worst_ratio: f64,
    /// Median chatter, Pa.
    pub chatter_median_pa: f64,
    /// Median RMS error of the drive-shaft torque, N m, if it estimates that.
    pub shaft_median_rms_n_m: Option<f64>,
    /// The largest of these.
    pub shaft_worst_rms_n_m: Option<f64>,
    /// Least coverage of the guaranteed range over the scenarios.
    pub range_least_coverage: Option<f64>,
    /// Median width of the guaranteed range of the pressure, Pa.
    pub range_median_width_pa: Option<f64>,
    /// Mean of that width over the width that would hold 95 % of normal errors with the observer's RMS over all scenarios.
    pub range_over_errors: Option<f64>,
    /// Median width of the range of the clutch torque, N m.
    pub torque_range_median_width_n_m: Option<f64>,
    /// Median width of the range of the drive-shaft torque, N m.
    pub shaft_range_median_width_n_m: Option<f64>,
    /// Time of one step, ns, on this machine: the fastest of several runs.
    pub step_ns: f64,
    /// The same with the guaranteed range.
    pub step_with_range_ns: f64,
}

/// The bench's result.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Bench {
    /// Every scenario.
    pub rows: Vec<BenchRow>,
    /// Every observer, the one with the least error over the shift first.
    pub ranking: Vec<BenchSummary>,
}

/// Runs every scenario of the experiment; `progress` is told each one's name before it starts.
///
/// # Errors
/// Simulation, design, or signals; see [`StudyError`]. A shift that is not completed is a row, not an error.
pub fn bench(vehicle: &Vehicle, experiment: &Experiment, mut progress: impl FnMut(&str)) -> Result<Bench, StudyError> {
    let observers = self::observers(vehicle, experiment)?;
    let mut rows = Vec::new();
    let mut first_trace = None;
    for (number, scenario) in experiment.scenarios.iter().enumerate() {
        progress(&scenario.name);
        let mut varied = experiment.with_scenario(scenario);
        let trace = simulate_drive(vehicle, &varied)?;
        let told_otherwise = varied.sensors_told != experiment.sensors_told;
        let told_otherwise = told_otherwise.then(|| self::observers(vehicle, &varied)).transpose()?;
        let observers = told_otherwise.as_ref().unwrap_or(&observers);
        // One noise, the same for all, would decide between observers that are close.
        let seed = varied.sensors.map(|sensors| mixed(sensors.seed, number as u64));
        let mut draws = Vec::new();
        for draw in 0..if seed.is_some() { DRAWS } else { 1 } {
            if let (Some(sensors), Some(seed)) = (&mut varied.sensors, seed) {
                sensors.seed = mixed(seed, draw);
            }
            let runs = run_observers(vehicle, &varied, observers, &trace)?;
            draws.push(runs.iter().map(cell).collect::<Vec<BenchCell>>());
        }
        let completed = ShiftQuality::of(&trace, &vehicle.shift).is_some();
        let cells = (0..experiment.observers.len()).map(|at| over(draws.iter().map(|cells| &cells[at]))).collect();
        rows.push(BenchRow { scenario: scenario.name.clone(), completed, cells });
        first_trace.get_or_insert(trace);
    }
    let open_loop = experiment.observers.iter().position(|entry| entry.kind == config::ObserverKind::OpenLoop);
    let mut ranking = Vec::new();
    if let (Some(open_loop), Some(trace)) = (open_loop, first_trace) {
        for (at, (entry, observer)) in experiment.observers.iter().zip(&observers).enumerate() {
            let samples = sampled(&trace, entry.sample_time_s);
            let columns = RunColumns::of(&samples, vehicle)?;
            let step_ns = fastest_ns(|| observer.run_alone(&columns));
            let step_with_range_ns = fastest_ns(|| observer.run(vehicle, &columns));
            ranking.push(BenchSummary { step_ns, step_with_range_ns, ..summary(&entry.name, at, open_loop, &rows) });
        }
    }
    ranking.sort_by(|a, b| a.shift_median_ratio.total_cmp(&b.shift_median_ratio));
    let place = |cell: &BenchCell| ranking.iter().position(|s| s.observer == cell.observer);
    for row in &mut rows {
        row.cells.sort_by_key(place);
    }
    Ok(Bench { rows, ranking })
}

/// Draws of the sensors' noise in each scenario.
const DRAWS: u64 = 5;

/// Width that holds 95 % of normal errors, in standard deviations.
const ERRORS_95: f64 = 2.0 * 1.96;

/// Runs over which the fastest step is sought.
const TIMED_RUNS: usize = 20;

/// Time of one step, ns.
fn fastest_ns(run: impl Fn() -> Vec<Estimate<f64>>) -> f64 {
    let mut best = f64::INFINITY;
    let mut steps = 1;
    for _ in 0..TIMED_RUNS {
        let began = Instant::now();
        steps = std::hint::black_box(run()).len().max(1);
        best = best.min(began.elapsed().as_secs_f64());
    }
    1e9 * best / steps as f64
}

/// One observer's scores over several draws of the sensors' noise.
fn over<'a>(draws: impl Iterator<Item = &'a BenchCell>) -> BenchCell {
    let draws: Vec<&BenchCell> = draws.collect();
    let mean =
        |value: &dyn Fn(&BenchCell) -> f64| draws.iter().map(|cell| value(cell)).sum::<f64>() / draws.len() as f64;
    let rms = |value: &dyn Fn(&BenchCell) -> f64| mean(&|cell| value(cell).powi(2)).sqrt();
    let some = |value: fn(&BenchCell) -> Option<f64>| {
        let values: Option<Vec<f64>> = draws.iter().map(|cell| value(cell)).collect();
        values.filter(|values| !values.is_empty())
    };
    let mean_of = |values: Vec<f64>| values.iter().sum::<f64>() / values.len() as f64;
    BenchCell {
        observer: draws.first().map(|cell| cell.observer.clone()).unwrap_or_default(),
        torque_phase_rms_pa: rms(&|cell| cell.torque_phase_rms_pa),
        inertia_phase_rms_pa: rms(&|cell| cell.inertia_phase_rms_pa),
        shift_rms_pa: rms(&|cell| cell.shift_rms_pa),
        chatter_pa: mean(&|cell| cell.chatter_pa),
        shaft_rms_n_m: some(|cell| cell.shaft_rms_n_m.map(|rms| rms * rms)).map(|squares| mean_of(squares).sqrt()),
        range_coverage: some(|cell| cell.range_coverage).and_then(|shares| shares.into_iter().reduce(f64::min)),
        range_width_pa: some(|cell| cell.range_width_pa).map(mean_of),
        torque_range_width_n_m: some(|cell| cell.torque_range_width_n_m).map(mean_of),
        shaft_range_width_n_m: some(|cell| cell.shaft_range_width_n_m).map(mean_of),
    }
}

fn cell(run: &ObserverRun) -> BenchCell {
    let both = [Phase::TorquePhase, Phase::InertiaPhase];
    let of = |scores: &[PhaseScore]| -> Vec<PhaseScore> {
        scores.iter().filter(|score| both.contains(&score.phase) && score.samples > 0).copied().collect()
    };
    let together = |scores: &[PhaseScore]| {
        let count: f64 = scores.iter().map(|score| score.samples as f64).sum();
        (scores.iter().map(|score| score.samples as f64 * score.rms * score.rms).sum::<f64>() / count).sqrt()
    };
    let pressure = of(&run.pressure);
    let rms = |phase| pressure.iter().find(|score| score.phase == phase).map_or(f64::NAN, |score| score.rms);
    let ranges: Vec<_> = run.ranges.iter().filter(|range| both.contains(&range.phase)).collect();
    let width = |of: fn(&RangeScore) -> f64| {
        let mean = ranges.iter().map(|range| of(range)).sum::<f64>() / ranges.len() as f64;
        mean.is_finite().then_some(mean)
    };
    let coverage = ranges.iter().map(|range| range.inside()).reduce(f64::min);
    BenchCell {
        observer: run.entry.name.clone(),
        torque_phase_rms_pa: rms(Phase::TorquePhase),
        inertia_phase_rms_pa: rms(Phase::InertiaPhase),
        shift_rms_pa: together(&pressure),
        chatter_pa: pressure.iter().map(|score| score.chatter).sum(),
        shaft_rms_n_m: run.shaft.as_ref().map(|shaft| together(&of(shaft))),
        range_coverage: coverage,
        range_width_pa: width(|range| range.width_pa),
        torque_range_width_n_m: width(|range| range.torque_width_n_m),
        shaft_range_width_n_m: width(|range| range.shaft_width_n_m),
    }
}

/// The observer at position `at` against the open loop at position `open`.
fn summary(name: &str, at: usize, open: usize, rows: &[BenchRow]) -> BenchSummary {
    let completed = || rows.iter().filter(|row| row.completed);
    let ratios = |rms: fn(&BenchCell) -> f64| -> Vec<f64> {
        sorted(completed().map(|row| rms(&row.cells[at]) / rms(&row.cells[open])).collect())
    };
    let some = |value: fn(&BenchCell) -> Option<f64>| -> Vec<f64> {
        sorted(completed().filter_map(|row| value(&row.cells[at])).collect())
    };
    let torque = ratios(|cell| cell.torque_phase_rms_pa);
    let inertia = ratios(|cell| cell.inertia_phase_rms_pa);
    let last = |values: &[f64]| values.last().copied().unwrap_or(f64::NAN);
    let shaft = some(|cell| cell.shaft_rms_n_m);
    let middle = |values: Vec<f64>| (!values.is_empty()).then(|| median(&values));
    BenchSummary {
        observer: name.to_owned(),
        shift_median_ratio: median(&ratios(|cell| cell.shift_rms_pa)),
        torque_phase_median_ratio: median(&torque),
        torque_phase_worst_ratio: last(&torque),
        inertia_phase_median_ratio: median(&inertia),
        inertia_phase_worst_ratio: last(&inertia),
        chatter_median_pa: median(&sorted(completed().map(|row| row.cells[at].chatter_pa).collect())),
        shaft_median_rms_n_m: (!shaft.is_empty()).then(|| median(&shaft)),
        shaft_worst_rms_n_m: shaft.last().copied(),
        range_least_coverage: some(|cell| cell.range_coverage).first().copied(),
        range_median_width_pa: middle(some(|cell| cell.range_width_pa)),
        range_over_errors: over_errors(completed().map(|row| &row.cells[at])),
        torque_range_median_width_n_m: middle(some(|cell| cell.torque_range_width_n_m)),
        shaft_range_median_width_n_m: middle(some(|cell| cell.shaft_range_width_n_m)),
        step_ns: f64::NAN,
        step_with_range_ns: f64::NAN,
    }
}

fn over_errors<'a>(cells: impl Iterator<Item = &'a BenchCell>) -> Option<f64> {
    let (mut widths, mut squares, mut count) = (0.0, 0.0, 0.0);
    for cell in cells {
        widths += cell.range_width_pa?;
        squares += cell.shift_rms_pa * cell.shift_rms_pa;
        count += 1.0;
    }
    (count > 0.0).then(|| widths / count / (ERRORS_95 * (squares / count).sqrt()))
}

fn sorted(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    values
}

/// Middle of rising values; the mean of the two middle ones where their number is even.
fn median(values: &[f64]) -> f64 {
    let (half, odd) = (values.len() / 2, values.len() % 2 == 1);
    match values.len() {
        0 => f64::NAN,
        _ if odd => values[half],
        _ => 0.5 * (values[half - 1] + values[half]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_of_an_even_number_lies_between_the_middle_ones() {
        assert_eq!((median(&[1.0, 2.0, 9.0]), median(&[1.0, 2.0, 4.0, 9.0])), (2.0, 3.0));
        assert!(median(&[]).is_nan());
    }
}
