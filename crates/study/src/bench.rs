//! The bench: all observers of an experiment on all its scenarios, ranked.

use config::{Experiment, Vehicle};
use observer::Phase;
use serde::Serialize;

use crate::{Comparison, StudyError, compare};

/// Errors of one observer in one scenario.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BenchCell {
    /// The observer.
    pub observer: String,
    /// RMS error of the pressure in the torque phase, Pa.
    pub torque_phase_rms_pa: f64,
    /// RMS error of the pressure in the inertia phase, Pa.
    pub inertia_phase_rms_pa: f64,
    /// Chatter in both phases, Pa.
    pub chatter_pa: f64,
}

/// One scenario.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BenchRow {
    /// Its name.
    pub scenario: String,
    /// Whether the shift passed all its phases within the simulated time; if not, there is nothing to score.
    pub completed: bool,
    /// The observers in the order of the experiment.
    pub cells: Vec<BenchCell>,
}

/// One observer over all completed scenarios.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BenchSummary {
    /// The observer.
    pub observer: String,
    /// Median over the scenarios of its torque-phase RMS over the open loop's.
    pub torque_phase_median_ratio: f64,
    /// The worst of these.
    pub torque_phase_worst_ratio: f64,
    /// Median over the scenarios of its inertia-phase RMS over the open loop's.
    pub inertia_phase_median_ratio: f64,
    /// The worst of these.
    pub inertia_phase_worst_ratio: f64,
    /// Median chatter, Pa.
    pub chatter_median_pa: f64,
}

/// The bench's result.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Bench {
    /// Every scenario.
    pub rows: Vec<BenchRow>,
    /// Every observer, the one with the least inertia-phase ratio first.
    pub ranking: Vec<BenchSummary>,
}

/// Runs every scenario of the experiment; `progress` is told each one's name before it starts.
///
/// # Errors
/// Simulation, design, or signals; see [`StudyError`]. A shift that is not completed is a row, not an error.
pub fn bench(vehicle: &Vehicle, experiment: &Experiment, mut progress: impl FnMut(&str)) -> Result<Bench, StudyError> {
    let mut rows = Vec::new();
    for scenario in &experiment.scenarios {
        progress(&scenario.name);
        let comparison = compare(vehicle, &experiment.with_scenario(scenario))?;
        rows.push(row(&scenario.name, &comparison));
    }
    let open_loop = experiment.observers.iter().position(|entry| entry.kind == config::ObserverKind::OpenLoop);
    let names = experiment.observers.iter().map(|entry| entry.name.as_str()).enumerate();
    let mut ranking: Vec<BenchSummary> =
        open_loop.map_or_else(Vec::new, |open| names.map(|(at, name)| summary(name, at, open, &rows)).collect());
    ranking.sort_by(|a, b| a.inertia_phase_median_ratio.total_cmp(&b.inertia_phase_median_ratio));
    Ok(Bench { rows, ranking })
}

fn row(scenario: &str, comparison: &Comparison) -> BenchRow {
    let cells = comparison.runs.iter().map(|run| {
        let score = |phase| run.pressure_in(phase);
        let rms = |phase| score(phase).map_or(f64::NAN, |score| score.rms);
        let chatter = [Phase::TorquePhase, Phase::InertiaPhase].into_iter().filter_map(score).map(|s| s.chatter).sum();
        BenchCell {
            observer: run.entry.name.clone(),
            torque_phase_rms_pa: rms(Phase::TorquePhase),
            inertia_phase_rms_pa: rms(Phase::InertiaPhase),
            chatter_pa: chatter,
        }
    });
    BenchRow { scenario: scenario.to_owned(), completed: comparison.quality.is_some(), cells: cells.collect() }
}

/// The observer at position `at` against the open loop at position `open`.
fn summary(name: &str, at: usize, open: usize, rows: &[BenchRow]) -> BenchSummary {
    let completed = || rows.iter().filter(|row| row.completed);
    let ratios = |rms: fn(&BenchCell) -> f64| -> Vec<f64> {
        sorted(completed().map(|row| rms(&row.cells[at]) / rms(&row.cells[open])).collect())
    };
    let torque = ratios(|cell| cell.torque_phase_rms_pa);
    let inertia = ratios(|cell| cell.inertia_phase_rms_pa);
    let last = |values: &[f64]| values.last().copied().unwrap_or(f64::NAN);
    BenchSummary {
        observer: name.to_owned(),
        torque_phase_median_ratio: median(&torque),
        torque_phase_worst_ratio: last(&torque),
        inertia_phase_median_ratio: median(&inertia),
        inertia_phase_worst_ratio: last(&inertia),
        chatter_median_pa: median(&sorted(completed().map(|row| row.cells[at].chatter_pa).collect())),
    }
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
