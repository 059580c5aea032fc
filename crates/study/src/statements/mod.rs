//! The source chapter's statements, each compared with the result of this program, in numbers.
//!
//! `rows.rs` computes what is compared, `offsets.rs` the certified offsets, in any setting of car, controller and sensors;
//! `settings.rs` repeats this over the settings that the chapter leaves open; `because.rs` gives the reasons at the
//! setting of the files.

mod because;
mod offsets;
mod rows;
mod settings;
mod statement;

use car::Vehicle;
use config::{ExperimentFile, Study};

use crate::{Comparison, StudyError, compare};

pub use settings::Settings;
pub use statement::{BoundCheck, Case, Figure, Fractions, Statement, Unit};

/// The experiments, run, and the statements about them.
#[derive(Debug, Clone, PartialEq)]
pub struct Chapter {
    /// E1 to E4.
    pub experiments: [Comparison; 4],
    /// The statements in the order of the chapter; cases of one statement follow one another.
    pub statements: Vec<Statement>,
    /// The settings in which they were tested besides that of the files.
    pub settings: Settings,
}

impl Chapter {
    /// How many statements agree, of those with something to compare with; of statements with several gains, by this one.
    pub fn agreeing(&self, gain: Case) -> (usize, usize) {
        let counted = |row: &&Statement| row.case.is_none_or(|case| case == gain || !Case::GAINS.contains(&case));
        let verdicts: Vec<bool> = self.statements.iter().filter(counted).filter_map(|row| row.agrees).collect();
        (verdicts.iter().filter(|agrees| **agrees).count(), verdicts.len())
    }
}

/// Runs E1 to E4 on this vehicle, checks the chapter's statements, and repeats this in the first `count` settings of a
/// study; `progress` hears of each.
///
/// # Errors
/// Simulation, design, or signals; see [`StudyError`]. A setting that fails is counted.
pub fn reproduce(
    vehicle: &Vehicle,
    experiments: &[ExperimentFile; 4],
    study: &Study,
    count: u64,
    threads: usize,
    progress: impl FnMut(),
) -> Result<Chapter, StudyError> {
    let [e1, e2, e3, e4] = experiments;
    let compared = [compare(vehicle, e1)?, compare(vehicle, e2)?, compare(vehicle, e3)?, compare(vehicle, e4)?];
    let mut statements = rows::rows(vehicle, &compared)?;
    because::explain(&mut statements, vehicle, experiments, &compared)?;
    let (settings, fractions) = settings::fractions(study, experiments, count, threads, progress)?;
    for (statement, fraction) in statements.iter_mut().zip(fractions) {
        statement.share_of_settings = Some(fraction);
    }
    Ok(Chapter { experiments: compared, statements, settings })
}
