//! The statements in the settings that the chapter leaves open.
//!
//! Each setting is a run of a study: a car, a shift controller and sensors that the chapter may have had. The observers are
//! built for the car of the setting, as the chapter's authors built theirs; off-nominal experiments differ from that car.

use car::ObserverKind;
use config::{ExperimentFile, Study};
use serde::Serialize;

use super::rows::{NAMED, rows};
use super::statement::{Fractions, Statement};
use crate::campaign::{factor_values, in_order, run_seed};
use crate::comparison::compare_shift;
use crate::{Comparison, StudyError};

/// The settings that were tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Settings {
    /// How many were drawn.
    pub drawn: u64,
    /// Of those, with a whole shift in each experiment: the fractions are of these.
    pub whole: u64,
    /// Without a whole shift in one of the experiments.
    pub no_shift: u64,
    /// Without a gain that meets the requirements.
    pub no_gains: u64,
    /// Of which values do not go together.
    pub refused: u64,
}

/// What came out of one row in one setting, in the order of [`Fractions`].
type Outcome = [Option<bool>; 4];

/// One setting.
enum Setting {
    Whole(Vec<Outcome>),
    NoShift,
    NoGains,
    Refused,
}

/// Tests the statements in the first `count` settings of the study.
pub(super) fn fractions(
    study: &Study,
    experiments: &[ExperimentFile; 4],
    count: u64,
    threads: usize,
    mut progress: impl FnMut(),
) -> Result<(Settings, Vec<Fractions>), StudyError> {
    let experiments = experiments.each_ref().map(with_the_observers_that_count);
    let mut settings = Settings::default();
    let mut counts: Vec<[Count; 4]> = Vec::new();
    in_order(
        0..count.min(study.runs),
        threads,
        |run| setting(study, &experiments, run),
        |setting| -> Result<(), StudyError> {
            settings.drawn += 1;
            match setting? {
                Setting::Whole(outcomes) => {
                    settings.whole += 1;
                    counts.resize(outcomes.len(), [Count::default(); 4]);
                    for (counts, outcome) in counts.iter_mut().zip(outcomes) {
                        counts.iter_mut().zip(outcome).for_each(|(count, outcome)| count.add(outcome));
                    }
                }
                Setting::NoShift => settings.no_shift += 1,
                Setting::NoGains => settings.no_gains += 1,
                Setting::Refused => settings.refused += 1,
            }
            progress();
            Ok(())
        },
    )?;
    let fraction = |count: &[Count; 4]| {
        let [agrees, holds, holds_with_initial_error, holds_at_start] = count.map(Count::fraction);
        Fractions { agrees, holds, holds_with_initial_error, holds_at_start }
    };
    Ok((settings, counts.iter().map(fraction).collect()))
}

#[derive(Clone, Copy, Default)]
struct Count {
    tested: u32,
    yes: u32,
}

impl Count {
    fn add(&mut self, outcome: Option<bool>) {
        if let Some(yes) = outcome {
            self.tested += 1;
            self.yes += u32::from(yes);
        }
    }

    fn fraction(self) -> Option<f64> {
        (self.tested > 0).then(|| f64::from(self.yes) / f64::from(self.tested))
    }
}

/// The experiment without observers that no statement is about.
fn with_the_observers_that_count(experiment: &ExperimentFile) -> ExperimentFile {
    let mut experiment = experiment.clone();
    experiment.observers.retain(|entry| entry.kind == ObserverKind::OpenLoop || NAMED.contains(&entry.name.as_str()));
    experiment
}

fn setting(study: &Study, experiments: &[ExperimentFile; 4], run: u64) -> Result<Setting, StudyError> {
    match outcomes(study, experiments, run) {
        Ok(Some(outcomes)) => Ok(Setting::Whole(outcomes)),
        Ok(None) | Err(StudyError::Plant(_)) => Ok(Setting::NoShift),
        Err(StudyError::Design(_)) => Ok(Setting::NoGains),
        Err(StudyError::Config(_)) => Ok(Setting::Refused),
        Err(error) => Err(error),
    }
}

/// What comes out in a setting; `None` without a whole shift.
fn outcomes(study: &Study, experiments: &[ExperimentFile; 4], run: u64) -> Result<Option<Vec<Outcome>>, StudyError> {
    let values = factor_values(study, run);
    let vehicle = study.varied(&values)?.vehicle;
    let compared = |experiment: &ExperimentFile| -> Result<Comparison, StudyError> {
        let mut experiment = study.varied_experiment(experiment, &values)?;
        experiment.check_observers(&vehicle)?;
        if let Some(sensors) = &mut experiment.sensors {
            sensors.seed = run_seed(study, run);
        }
        compare_shift(&vehicle, &experiment)
    };
    let [e1, e2, e3, e4] = experiments;
    let experiments = [compared(e1)?, compared(e2)?, compared(e3)?, compared(e4)?];
    if experiments.iter().any(|comparison| comparison.quality.is_none()) {
        return Ok(None);
    }
    Ok(Some(rows(&vehicle, &experiments)?.iter().map(outcome).collect()))
}

fn outcome(row: &Statement) -> Outcome {
    let bound = row.bound.as_ref();
    [
        row.agrees,
        bound.and_then(|bound| bound.holds),
        bound.map(|bound| bound.holds_with_initial_error),
        bound.map(|bound| bound.holds_at_start),
    ]
}
