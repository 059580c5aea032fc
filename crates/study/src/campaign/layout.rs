//! The columns of a study's table.

use car::{Experiment, ObserverEntry, ObserverKind};
use config::Study;
use config::study::QUALITY;
use observer::Phase;

use crate::ObserverRun;

/// The phases that are scored.
pub const PHASES: [Phase; 2] = [Phase::TorquePhase, Phase::InertiaPhase];

/// What is scored of each observer in each phase.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Metric {
    /// RMS error of the pressure, Pa.
    PressureRms,
    /// Largest error of the pressure, Pa.
    PressurePeak,
    /// Variation of the pressure estimate beyond that of the truth, Pa.
    Chatter,
    /// RMS error of the clutch torque, N m.
    TorqueRms,
    /// RMS error of the drive-shaft torque, N m.
    ShaftRms,
    /// Fraction of the samples at which the true pressure and clutch torque lie in their guaranteed ranges.
    Coverage,
    /// Mean width of the guaranteed range of the pressure, Pa.
    RangeWidth,
}

impl Metric {
    /// All of them, in the order of the table.
    pub const ALL: [Self; 7] = [
        Self::PressureRms,
        Self::PressurePeak,
        Self::Chatter,
        Self::TorqueRms,
        Self::ShaftRms,
        Self::Coverage,
        Self::RangeWidth,
    ];

    /// The end of its column's name, with the unit.
    pub fn name(self) -> &'static str {
        match self {
            Self::PressureRms => "pressure_rms_pa",
            Self::PressurePeak => "pressure_peak_pa",
            Self::Chatter => "chatter_pa",
            Self::TorqueRms => "clutch_torque_rms_n_m",
            Self::ShaftRms => "shaft_torque_rms_n_m",
            Self::Coverage => "range_coverage",
            Self::RangeWidth => "range_width_pa",
        }
    }

    fn of(self, run: &ObserverRun, phase: Phase) -> Option<f64> {
        let scores = match self {
            Self::PressureRms | Self::PressurePeak | Self::Chatter => &run.pressure,
            Self::TorqueRms => &run.torque,
            Self::ShaftRms => run.shaft.as_ref()?,
            Self::Coverage | Self::RangeWidth => {
                let range = run.ranges.iter().find(|range| range.phase == phase)?;
                let covered = range.inside();
                return Some(if self == Self::Coverage { covered } else { range.width_pa });
            }
        };
        let score = scores.iter().find(|score| score.phase == phase && score.samples > 0)?;
        Some(match self {
            Self::PressurePeak => score.peak,
            Self::Chatter => score.chatter,
            Self::PressureRms | Self::TorqueRms | Self::ShaftRms | Self::Coverage | Self::RangeWidth => score.rms,
        })
    }
}

/// Positions in a row of numbers: factors, shift quality, scores.
#[derive(Debug, Clone, PartialEq)]
pub struct Layout {
    /// Names of the factors.
    pub factors: Vec<String>,
    /// Names of the observers.
    pub observers: Vec<String>,
    /// How their columns begin.
    columns: Vec<String>,
    /// Position of the open loop among the observers, if it is there.
    pub open_loop: Option<usize>,
}

impl Layout {
    /// The layout of a study's rows.
    pub fn of(study: &Study) -> Self {
        let experiment: &Experiment = &study.experiment;
        Self {
            factors: study.factors.iter().map(|factor| factor.name.clone()).collect(),
            observers: experiment.observers.iter().map(|entry| entry.name.clone()).collect(),
            columns: experiment.observers.iter().map(ObserverEntry::column).collect(),
            open_loop: experiment.observers.iter().position(|entry| entry.kind == ObserverKind::OpenLoop),
        }
    }

    /// How many numbers a row has.
    pub fn width(&self) -> usize {
        self.scores_at() + self.observers.len() * PHASES.len() * Metric::ALL.len()
    }

    /// Position of an observer's score.
    pub fn score(&self, observer: usize, phase: usize, metric: Metric) -> usize {
        let at = Metric::ALL.iter().position(|&m| m == metric).unwrap_or(0);
        self.scores_at() + (observer * PHASES.len() + phase) * Metric::ALL.len() + at
    }

    /// The names of all columns: run, seed, factors, status, quality, scores.
    pub fn header(&self) -> Vec<String> {
        let mut names = vec!["run".to_owned(), "seed".to_owned()];
        names.extend(self.factors.iter().cloned());
        names.push("status".to_owned());
        names.extend(QUALITY.map(str::to_owned));
        for observer in &self.columns {
            for phase in PHASES {
                let start = format!("{observer}.{}", phase.name());
                names.extend(Metric::ALL.map(|metric| format!("{start}.{}", metric.name())));
            }
        }
        names
    }

    fn scores_at(&self) -> usize {
        self.factors.len() + QUALITY.len()
    }

    /// The scores of all observers.
    pub(super) fn scores(&self, runs: &[ObserverRun]) -> Vec<f64> {
        let mut scores = Vec::with_capacity(self.width() - self.scores_at());
        for run in runs {
            for phase in PHASES {
                scores.extend(Metric::ALL.map(|metric| metric.of(run, phase).unwrap_or(f64::NAN)));
            }
        }
        scores
    }
}
