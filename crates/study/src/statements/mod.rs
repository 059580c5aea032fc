//! The source chapter's statements, each compared with the result of this program, in numbers.
//!
//! `rows.rs` computes what is compared, `offsets.rs` the certified offsets, in any setting of car, controller and sensors;
//! `settings.rs` repeats this over the settings that the chapter leaves open; `because.rs` gives the reasons at the
//! setting of the files.

mod because;
mod offsets;
mod rows;
mod settings;

use car::Vehicle;
use config::{ExperimentFile, Study};
use serde::Serialize;

use crate::{Comparison, StudyError, compare};

pub use offsets::BoundCheck;
pub use settings::{Fractions, Settings};

/// The unit of a figure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Unit {
    /// Pa.
    #[serde(rename = "Pa")]
    Pascal,
    /// N m.
    #[serde(rename = "N m")]
    NewtonMetre,
    /// s.
    #[serde(rename = "s")]
    Second,
    /// A ratio.
    #[serde(rename = "1")]
    Ratio,
    /// A ratio less 1: negative where something became smaller.
    #[serde(rename = "1, change")]
    Change,
}

/// A number beside the one that is compared.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Figure {
    /// What it is.
    pub name: &'static str,
    /// Its value; NaN where there is none.
    pub value: f64,
    /// Its unit.
    pub unit: Unit,
}

/// With what a statement is tested, where the chapter leaves more than one possibility.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Case {
    /// With the torque-phase gain that is designed from the vehicle file.
    DesignedGain,
    /// With the chapter's torque-phase gain as it stands in the scan.
    ReadGain,
    /// With the chapter's torque-phase gain, if the scan lost a digit of it.
    LongerGain,
    /// With the error matrix of Eq. (2.86).
    ChapterErrors,
    /// With the errors of the vehicle file's budget.
    BudgetErrors,
}

impl Case {
    /// The readings of the torque-phase gain.
    pub const GAINS: [Self; 3] = [Self::DesignedGain, Self::ReadGain, Self::LongerGain];

    /// In words.
    pub fn label(self) -> &'static str {
        match self {
            Self::DesignedGain => "gain designed here",
            Self::ReadGain => "gain −5.02e4",
            Self::LongerGain => "gain −1.502e5",
            Self::ChapterErrors => "H of Eq. (2.86)",
            Self::BudgetErrors => "H of the error budget",
        }
    }
}

/// A statement with the chapter's figure and ours.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Statement {
    /// Its name in files.
    pub id: &'static str,
    /// The experiment.
    pub experiment: &'static str,
    /// What is claimed.
    pub claim: &'static str,
    /// With what it is tested, where there is more than one possibility.
    pub case: Option<Case>,
    /// What the chapter says.
    #[serde(skip)]
    pub chapter_says: &'static str,
    /// The chapter's number, if it gives one that can be read.
    pub chapter: Option<f64>,
    /// What is compared.
    pub quantity: &'static str,
    /// Our number.
    pub ours: f64,
    /// The unit of both.
    pub unit: Unit,
    /// When they agree.
    #[serde(skip)]
    pub criterion: &'static str,
    /// Whether they agree; `None` where there is nothing to compare with.
    pub agrees: Option<bool>,
    /// Other numbers that belong to it.
    pub figures: Vec<Figure>,
    /// Of a certified offset: whether the error respects it.
    pub bound: Option<BoundCheck>,
    /// In which fraction of the settings the same comes out.
    pub share_of_settings: Option<Fractions>,
    /// Why they differ, or what else the numbers say.
    #[serde(skip)]
    pub because: String,
}

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
