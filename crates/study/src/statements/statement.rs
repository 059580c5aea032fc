//! A statement of the chapter, and what comes out here.

use serde::Serialize;

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

/// Whether an error respects a certified offset.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BoundCheck {
    /// The offset, Pa.
    pub bound_pa: f64,
    /// Time from the start of the phase after which the initial error has decayed, s.
    pub decayed_after_s: f64,
    /// Largest error after that, Pa; NaN if the phase ends before.
    pub largest_after_decay_pa: f64,
    /// Whether it is within the offset; `None` if the phase ends before.
    pub holds: Option<bool>,
    /// Largest fraction of the bound with the initial error in it, Eq. (2.40), that the error has after the first sample,
    /// in which it is the initial error.
    pub largest_share_of_bound: f64,
    /// Whether the error is always within that bound.
    pub holds_with_initial_error: bool,
    /// Largest error from the start of the phase on, Pa.
    pub largest_from_start_pa: f64,
    /// Whether that is within the offset.
    pub holds_at_start: bool,
}

/// In which fraction of the settings something comes out; `None` where there is nothing to test.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Fractions {
    /// Our figure agrees with the chapter's.
    pub agrees: Option<f64>,
    /// The offset holds after the initial error has decayed.
    pub holds: Option<f64>,
    /// The bound with the initial error in it holds.
    pub holds_with_initial_error: Option<f64>,
    /// The offset holds from the start of the phase on.
    pub holds_at_start: Option<f64>,
}
