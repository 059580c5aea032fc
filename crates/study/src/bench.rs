//! The bench: all observers of an experiment on all its scenarios, ranked.

use std::time::Instant;

use car::{Experiment, ObserverEntry, ObserverKind, Vehicle};
use config::{ConfigError, ExperimentFile};
use drivetrain::Real;
use observer::{Estimate, KalmanFilter, Phase};
use serde::Serialize;
use trace::Trace;

use crate::campaign::summary::over;
use crate::comparison::{measured, observers, run_observers};
use crate::consistency::Consistency;
use crate::observers::AnyObserver;
use crate::sampling::sampled;
use crate::{ObserverRun, PhaseScore, RangeScore, RunColumns, ShiftQuality, StudyError, simulate_drive};
use evaluate::mixed;

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
    /// Whether the estimate diverged. Its errors are infinite then; JSON, which has no infinity, holds null for them.
    pub diverged: bool,
    /// Chatter in both phases, Pa.
    pub chatter_pa: f64,
    /// RMS error of the drive-shaft torque over both phases, N m, if it estimates that.
    pub shaft_rms_n_m: Option<f64>,
    /// Fraction of the samples at which pressure and clutch torque lie in their guaranteed ranges, if there are any.
    pub range_coverage: Option<f64>,
    /// The same of the drive-shaft torque in its expected range.
    pub shaft_range_coverage: Option<f64>,
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
    /// Completed scenarios in which its estimate diverged. They count as infinite; JSON holds null for that.
    pub diverged: usize,
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
    /// Minimum coverage of the guaranteed range over the scenarios.
    pub range_least_coverage: Option<f64>,
    /// The same of the expected range of the drive-shaft torque.
    pub shaft_range_least_coverage: Option<f64>,
    /// Median width of the guaranteed range of the pressure, Pa.
    pub range_median_width_pa: Option<f64>,
    /// Mean of that width over the width that would hold 95 % of normal errors with the observer's RMS over all
    /// scenarios.
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
    /// Every observer, the one with the smallest error over the shift first.
    pub ranking: Vec<BenchSummary>,
    /// The first Kalman filter of the experiment against itself, if there is one.
    pub consistency: Option<BenchConsistency>,
}

/// How sure a Kalman filter is, and how it does in single precision, over all scenarios.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BenchConsistency {
    /// The observer.
    pub observer: String,
    /// Over the scenarios that were completed, each with one draw of the sensors' noise.
    pub all: Consistency,
    /// The scenario with the minimum fraction of samples in the filter's 95 % band, and this fraction.
    #[serde(rename = "least")]
    pub minimum: (String, f64),
}

impl BenchConsistency {
    fn of(observer: &str, scenarios: &[(String, Consistency)]) -> Option<Self> {
        let all = scenarios.iter().fold(Consistency::default(), |all, (_, one)| all.with(one));
        let fractions = scenarios.iter().map(|(name, one)| (name.clone(), one.inside_fraction()));
        let minimum = fractions.filter(|(_, fraction)| fraction.is_finite()).min_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(Self { observer: observer.to_owned(), all, minimum })
    }
}

impl Bench {
    /// Number of scenarios that are ranked.
    pub fn completed(&self) -> usize {
        self.rows.iter().filter(|row| row.completed).count()
    }
}

/// Runs every scenario of the experiment; `progress` is called with each name before the scenario starts.
///
/// # Errors
/// The experiment has no scenario, or no open loop to rank against; simulation, design, or signals, see [`StudyError`].
/// A shift that is not completed is a row, not an error.
pub fn bench(
    vehicle: &Vehicle,
    experiment: &ExperimentFile,
    mut progress: impl FnMut(&str),
) -> Result<Bench, StudyError> {
    let open_loop = open_loop(experiment)?;
    let observers = self::observers(vehicle, experiment)?;
    let mut rows = Vec::new();
    let mut consistency = Vec::new();
    let mut drives: Vec<(Experiment, Trace)> = Vec::new();
    for (number, scenario) in experiment.scenarios.iter().enumerate() {
        progress(&scenario.name);
        let mut varied = experiment.with_scenario(scenario);
        let trace = driven(vehicle, &varied, &mut drives)?;
        let given_otherwise =
            varied.sensors_given != experiment.sensors_given || varied.observers != experiment.observers;
        let given_otherwise = given_otherwise.then(|| self::observers(vehicle, &varied)).transpose()?;
        let observers = given_otherwise.as_ref().unwrap_or(&observers);
        // One noise, the same for all, would decide between observers that are close.
        let seed = varied.sensors.map(|sensors| mixed(sensors.seed, number as u64));
        let completed = ShiftQuality::of(trace, &vehicle.shift).is_some();
        if let (true, Some((entry, filter))) = (completed, first_filter(&varied, observers)) {
            let seen = measured(vehicle, &varied, entry, trace);
            let one = Consistency::of(filter, &seen, &RunColumns::of(&seen, vehicle)?)?;
            consistency.push((scenario.name.clone(), one));
        }
        let mut draws = Vec::new();
        for draw in 0..if seed.is_some() { experiment.draws } else { 1 } {
            if let (Some(sensors), Some(seed)) = (&mut varied.sensors, seed) {
                sensors.seed = mixed(seed, draw);
            }
            let runs = run_observers(vehicle, &varied, observers, trace)?;
            draws.push(runs.iter().map(cell).collect::<Vec<BenchCell>>());
        }
        let cells =
            (0..experiment.observers.len()).map(|at| over_draws(draws.iter().map(|cells| &cells[at]))).collect();
        rows.push(BenchRow { scenario: scenario.name.clone(), completed, cells });
    }
    let mut ranking = Vec::new();
    if let Some((_, trace)) = drives.first() {
        for (at, (entry, observer)) in experiment.observers.iter().zip(&observers).enumerate() {
            let samples = sampled(trace, entry.sample_time_s);
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
    let name = first_filter(experiment, &observers).map(|(entry, _)| entry.name.as_str());
    let consistency = name.and_then(|name| BenchConsistency::of(name, &consistency));
    Ok(Bench { rows, ranking, consistency })
}

/// The first Kalman filter of an experiment that believes its readings.
fn first_filter<'a>(
    experiment: &'a Experiment,
    observers: &'a [AnyObserver],
) -> Option<(&'a ObserverEntry, &'a KalmanFilter<f64>)> {
    experiment.observers.iter().zip(observers).find_map(|(entry, observer)| match observer {
        AnyObserver::Kalman(filter) if entry.kind == ObserverKind::Kalman => Some((entry, filter.as_ref())),
        _ => None,
    })
}

/// The drive of an experiment, simulated once for all scenarios that differ in their sensors alone.
fn driven<'a>(
    vehicle: &Vehicle,
    experiment: &Experiment,
    drives: &'a mut Vec<(Experiment, Trace)>,
) -> Result<&'a Trace, StudyError> {
    let same = |other: &Experiment| {
        let plant = |e: &Experiment| (e.off_nominal, e.throttle, e.shift);
        plant(other) == plant(experiment)
    };
    let at = match drives.iter().position(|(other, _)| same(other)) {
        Some(at) => at,
        None => {
            drives.push((experiment.clone(), simulate_drive(vehicle, experiment)?));
            drives.len() - 1
        }
    };
    Ok(&drives[at].1)
}

/// Position of the open loop, the reference of the ranking.
///
/// # Errors
/// The experiment has no scenario, or no open loop.
pub fn open_loop(experiment: &ExperimentFile) -> Result<usize, ConfigError> {
    let missing = |key: &str, at: usize, message: &str| ConfigError::Meaning {
        path: experiment.source.path.clone(),
        line: experiment.source.line(at),
        key: key.to_owned(),
        message: message.to_owned(),
        hint: Some("see experiments/bench.toml".to_owned()),
    };
    if experiment.scenarios.is_empty() {
        return Err(missing("scenario", 0, "there is no [[scenario]]\nhint: experiments/bench.toml shows some"));
    }
    let first_scenario = experiment.source.text.find("[[scenario]]").unwrap_or_default();
    let open_loop = experiment.observers.iter().position(|entry| entry.kind == ObserverKind::OpenLoop);
    open_loop.ok_or_else(|| {
        missing(
            "observer",
            first_scenario,
            "there is no observer of the kind \"open-loop\", which is the reference of the ranking",
        )
    })
}

/// Width that contains 95 % of normally distributed errors, in standard deviations.
const ERRORS_95: f64 = 2.0 * 1.96;

/// Number of runs; the step time is that of the fastest.
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
fn over_draws<'a>(draws: impl Iterator<Item = &'a BenchCell>) -> BenchCell {
    let draws: Vec<&BenchCell> = draws.collect();
    let mean =
        |value: &dyn Fn(&BenchCell) -> f64| draws.iter().map(|cell| value(cell)).sum::<f64>() / draws.len() as f64;
    let rms = |value: &dyn Fn(&BenchCell) -> f64| mean(&|cell| Real::powi(value(cell), 2)).sqrt();
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
        diverged: draws.iter().any(|cell| cell.diverged),
        chatter_pa: mean(&|cell| cell.chatter_pa),
        shaft_rms_n_m: some(|cell| cell.shaft_rms_n_m.map(|rms| rms * rms)).map(|squares| mean_of(squares).sqrt()),
        range_coverage: some(|cell| cell.range_coverage).and_then(|fractions| fractions.into_iter().reduce(f64::min)),
        shaft_range_coverage: some(|cell| cell.shaft_range_coverage)
            .and_then(|fractions| fractions.into_iter().reduce(f64::min)),
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
    let shift_rms_pa = together(&pressure);
    BenchCell {
        observer: run.entry.name.clone(),
        torque_phase_rms_pa: rms(Phase::TorquePhase),
        inertia_phase_rms_pa: rms(Phase::InertiaPhase),
        shift_rms_pa,
        diverged: shift_rms_pa.is_infinite(),
        chatter_pa: pressure.iter().map(|score| score.chatter).sum(),
        shaft_rms_n_m: run.shaft.as_ref().map(|shaft| together(&of(shaft))).filter(|rms| !rms.is_nan()),
        range_coverage: coverage,
        shaft_range_coverage: ranges.iter().map(|range| range.shaft_inside).reduce(f64::min),
        range_width_pa: width(|range| range.width_pa),
        torque_range_width_n_m: width(|range| range.torque_width_n_m),
        shaft_range_width_n_m: width(|range| range.shaft_width_n_m),
    }
}

/// The observer at position `at` against the open loop at position `open`.
fn summary(name: &str, at: usize, open: usize, rows: &[BenchRow]) -> BenchSummary {
    let completed = || rows.iter().filter(|row| row.completed);
    let ratios = |rms: fn(&BenchCell) -> f64| -> Vec<f64> {
        let ratios = completed().map(|row| over(rms(&row.cells[at]), rms(&row.cells[open])));
        // A phase between two samples has no score.
        sorted(ratios.filter(|ratio| !ratio.is_nan()).collect())
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
        diverged: completed().filter(|row| row.cells[at].diverged).count(),
        shift_median_ratio: median(&ratios(|cell| cell.shift_rms_pa)),
        torque_phase_median_ratio: median(&torque),
        torque_phase_worst_ratio: last(&torque),
        inertia_phase_median_ratio: median(&inertia),
        inertia_phase_worst_ratio: last(&inertia),
        chatter_median_pa: median(&sorted(completed().map(|row| row.cells[at].chatter_pa).collect())),
        shaft_median_rms_n_m: (!shaft.is_empty()).then(|| median(&shaft)),
        shaft_worst_rms_n_m: shaft.last().copied(),
        range_least_coverage: some(|cell| cell.range_coverage).first().copied(),
        shaft_range_least_coverage: some(|cell| cell.shaft_range_coverage).first().copied(),
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
    (count > 0.0 && squares < f64::INFINITY).then(|| widths / count / (ERRORS_95 * (squares / count).sqrt()))
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

    #[test]
    fn an_observer_that_diverges_in_one_draw_counts_as_infinitely_wrong() {
        let cell = |rms: f64| BenchCell {
            observer: "one".to_owned(),
            torque_phase_rms_pa: rms,
            inertia_phase_rms_pa: rms,
            shift_rms_pa: rms,
            diverged: rms.is_infinite(),
            chatter_pa: 0.0,
            shaft_rms_n_m: None,
            range_coverage: None,
            shaft_range_coverage: None,
            range_width_pa: Some(1e5),
            torque_range_width_n_m: None,
            shaft_range_width_n_m: None,
        };
        let wild = over_draws([cell(1e3), cell(f64::INFINITY)].iter());
        assert!(wild.diverged && wild.shift_rms_pa.is_infinite());
        let rows = [BenchRow { scenario: "nominal".to_owned(), completed: true, cells: vec![wild, cell(1e3)] }];
        let [wild, open] = [0, 1].map(|at| summary("", at, 1, &rows));
        assert_eq!((wild.diverged, wild.shift_median_ratio, wild.range_over_errors), (1, f64::INFINITY, None));
        assert_eq!((open.diverged, open.shift_median_ratio), (0, 1.0));
    }
}
