//! Searches a study's factors for the run with the largest error of an observer.

use std::sync::{Mutex, PoisonError};

use argmin::core::{CostFunction, Executor, State};
use argmin::solver::neldermead::NelderMead;
use config::toml_string;

use crate::campaign::plan::{place_of, value_at};
use crate::campaign::{Campaign, Metric, Row, run_seed};
use crate::{StudyError, execute};

/// Edge of the first simplex, in fractions of each factor's range.
const FIRST_STEP: f64 = 0.15;
/// The search ends when the simplex differs by less than this, Pa.
const FLAT_PA: f64 = 1.0;
/// How much a step out of the range of a factor costs, Pa for the whole range.
const OUTSIDE_PA: f64 = 1e6;

/// What is made as large as it can be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Target {
    /// The observer, by its place.
    pub observer: usize,
    /// The phase, by its place in [`crate::campaign::PHASES`].
    pub phase: usize,
    /// The score.
    pub metric: Metric,
}

/// What the search found.
#[derive(Debug, Clone, PartialEq)]
pub struct WorstCase {
    /// The worst of the study's runs that the search began from.
    pub study_worst: Row,
    /// The worst run that it found, made with the seed of run 0.
    pub row: Row,
    /// Runs that it took, those of the study not counted.
    pub evaluations: u64,
    /// Starts of the search.
    pub starts: usize,
    /// Of each start: the largest score so far after each of its runs, Pa.
    pub progress: Vec<Vec<f64>>,
}

struct Search<'a> {
    campaign: &'a Campaign,
    target: Target,
}

impl Search<'_> {
    fn values(&self, places: &[f64]) -> Vec<f64> {
        let factors = &self.campaign.study.factors;
        factors.iter().zip(places).map(|(factor, place)| value_at(&factor.values, place.clamp(0.0, 1.0))).collect()
    }

    /// The score, infinite where the observer diverged; nothing for a run without a whole shift.
    fn score(&self, row: &Row) -> f64 {
        let Target { observer, phase, metric } = self.target;
        let score = row.numbers[self.campaign.layout.score(observer, phase, metric)];
        if row.status.is_scored() && !score.is_nan() { score } else { 0.0 }
    }
}

/// A search from one start.
struct FromStart<'a> {
    search: &'a Search<'a>,
    /// The largest score so far after each run, Pa.
    progress: Mutex<Vec<f64>>,
}

impl CostFunction for &FromStart<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, places: &Vec<f64>) -> Result<f64, argmin::core::Error> {
        let search = self.search;
        let row = search.campaign.row_at(0, &search.values(places))?;
        let score = search.score(&row);
        let mut progress = self.progress.lock().unwrap_or_else(PoisonError::into_inner);
        let before = progress.last().copied().unwrap_or(0.0);
        progress.push(before.max(score));
        let outside: f64 = places.iter().map(|place| (place - place.clamp(0.0, 1.0)).abs()).sum();
        Ok(OUTSIDE_PA * outside - score)
    }
}

/// Makes the study's runs, then searches from the `starts` worst of them by the simplex method of Nelder and Mead,
/// with at most `iterations` steps each. `progress` hears of each run of the study and each finished search.
///
/// # Errors
/// See [`StudyError`]; there is no scored run to begin from.
pub fn worst_case(
    campaign: &Campaign,
    target: Target,
    starts: usize,
    iterations: u64,
    threads: usize,
    mut progress: impl FnMut(),
) -> Result<Option<WorstCase>, StudyError> {
    let search = Search { campaign, target };
    let mut worst: Vec<Row> = Vec::new();
    execute::<StudyError>(campaign, 0..campaign.study.runs, threads, |row| {
        let at = worst.iter().position(|other| search.score(row) > search.score(other)).unwrap_or(worst.len());
        if row.status.is_scored() && at < starts {
            worst.insert(at, row.clone());
            worst.truncate(starts);
        }
        progress();
        Ok(())
    })?;
    let Some(study_worst) = worst.first().cloned() else { return Ok(None) };
    let mut found: Vec<Found> = Vec::new();
    crate::campaign::in_order(
        0..worst.len() as u64,
        threads,
        |start| from(&search, &worst[usize::try_from(start).unwrap_or(0)], iterations),
        |result| -> Result<(), StudyError> {
            found.push(result?);
            progress();
            Ok(())
        },
    )?;
    let evaluations = found.iter().map(|found| found.progress.len() as u64).sum();
    let Some(best) = found.iter().max_by(|a, b| a.score.total_cmp(&b.score)) else { return Ok(None) };
    let row = campaign.row_at(0, &search.values(&best.places))?;
    debug_assert_eq!(row.seed, run_seed(&campaign.study, 0));
    let progress = found.into_iter().map(|found| found.progress).collect();
    Ok(Some(WorstCase { study_worst, row, evaluations, starts: worst.len(), progress }))
}

/// What was found from one start.
struct Found {
    /// The largest score, Pa, with what leaving the ranges costs.
    score: f64,
    /// Where.
    places: Vec<f64>,
    /// The largest score so far after each run, Pa.
    progress: Vec<f64>,
}

/// The search from one start.
fn from(search: &Search<'_>, start: &Row, iterations: u64) -> Result<Found, StudyError> {
    let factors = &search.campaign.study.factors;
    let origin: Vec<f64> =
        factors.iter().zip(&start.numbers).map(|(factor, &value)| place_of(&factor.values, value)).collect();
    let mut simplex = vec![origin.clone()];
    for i in 0..origin.len() {
        let mut corner = origin.clone();
        // Towards the middle, so that the first simplex lies within the ranges.
        corner[i] += if corner[i] > 0.5 { -FIRST_STEP } else { FIRST_STEP };
        simplex.push(corner);
    }
    let failed = |error: argmin::core::Error| match error.downcast::<StudyError>() {
        Ok(error) => error,
        Err(other) => StudyError::Search(other.to_string()),
    };
    let solver = NelderMead::new(simplex).with_sd_tolerance(FLAT_PA).map_err(failed)?;
    // A diverged estimate ends the search: argmin's target is a cost of minus infinity, and nothing is worse.
    let from_start = FromStart { search, progress: Mutex::new(Vec::new()) };
    let result =
        Executor::new(&from_start, solver).configure(|state| state.max_iters(iterations)).run().map_err(failed)?;
    let state = result.state();
    let places = state.get_best_param().cloned().unwrap_or(origin);
    let (score, progress) = (
        -state.get_best_cost(),
        std::mem::take(&mut *from_start.progress.lock().unwrap_or_else(PoisonError::into_inner)),
    );
    Ok(Found { score, places, progress })
}

impl WorstCase {
    /// A study file of this one run of the experiment at this path.
    pub fn study_file(&self, campaign: &Campaign, experiment: &str) -> String {
        let study = &campaign.study;
        let mut text = format!(
            "# The worst case that `wetclutch worst-case` found for {}.\n\nname = \"worst_case\"\ntitle = {}\nexperiment = {}\n\
             plan = \"full-factorial\"\nseed = {}\nrecord_before_s = {:?}\n",
            toml_string(&study.title),
            toml_string(&format!("Worst case of {}", study.title)),
            toml_string(experiment),
            study.seed,
            study.record_before_s,
        );
        let names: Vec<String> = campaign.layout.observers.iter().map(|name| toml_string(name)).collect();
        text += &format!("observers = [{}]\n", names.join(", "));
        for (factor, value) in study.factors.iter().zip(&self.row.numbers) {
            text += &format!(
                "\n[[factor]]\nname = {}\nkey = {}\nchange = \"{}\"\nvalues = [{value:?}]\n",
                toml_string(&factor.name),
                toml_string(&factor.key),
                factor.change_name(),
            );
        }
        text
    }
}
