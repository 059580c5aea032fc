//! One run of a study.

use std::borrow::Cow;
use std::fmt::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, MutexGuard, PoisonError};

use config::study::QUALITY;
use config::{ConfigError, Study, Varied};
use design::DesignError;
use plant::PlantError;
use trace::Trace;

use super::layout::Layout;
use super::plan::{factor_values, run_seed};
use super::scored::scored_shift;
use crate::comparison::{ObserverRun, observers, run_observers};
use crate::{AnyObserver, ShiftQuality, StudyError, simulate_shift};

/// How a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Status {
    /// A shift with all its phases.
    Ok,
    /// A shift with all its phases, in which the clutches worked against one another until the car was braked.
    TieUp,
    /// The oncoming clutch did not lock within the experiment's time.
    NoLockUp,
    /// The simulation diverged.
    Diverged,
    /// The combination of the factors' values is refused.
    Refused,
    /// No gains exist for the requirements of the varied vehicle file.
    NoGains,
    /// An error in this program. The other runs continue; the message is on standard error.
    Crashed,
}

impl Status {
    /// All of them.
    pub const ALL: [Self; 7] =
        [Self::Ok, Self::TieUp, Self::NoLockUp, Self::Diverged, Self::Refused, Self::NoGains, Self::Crashed];

    /// A word for tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::TieUp => "tie_up",
            Self::NoLockUp => "no_lock_up",
            Self::Diverged => "diverged",
            Self::Refused => "refused",
            Self::NoGains => "no_gains",
            Self::Crashed => "crashed",
        }
    }

    /// The status that a word means.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|status| status.name() == name)
    }

    /// Whether the shift passed all its phases, so that its scores mean something.
    pub fn is_scored(self) -> bool {
        matches!(self, Self::Ok | Self::TieUp)
    }
}

/// One row of a study's table.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Number of the run.
    pub run: u64,
    /// Seed of its sensors.
    pub seed: u64,
    /// How it ended.
    pub status: Status,
    /// Factors, shift quality and scores as [`Layout`] places them; NaN where there is none.
    pub numbers: Vec<f64>,
}

/// A study made ready to run: gains are designed once where no factor changes what they follow from.
#[derive(Debug)]
pub struct Campaign {
    /// The study.
    pub study: Study,
    /// Positions in a row.
    pub layout: Layout,
    observers: Option<Vec<AnyObserver>>,
    /// Traces of runs that are scored: the memory of the next ones.
    spare: Mutex<Vec<Trace>>,
}

/// A run in full, for a closer look.
#[derive(Debug)]
pub struct Run {
    /// The files of the run.
    pub varied: Varied,
    /// The drive.
    pub trace: Trace,
    /// Its observers.
    pub observers: Vec<ObserverRun>,
    /// The shift, if it was completed.
    pub quality: Option<ShiftQuality>,
}

/// Why a run gave nothing to score.
enum RunError {
    Refused(ConfigError),
    Plant(PlantError),
    Design(DesignError),
    Other(StudyError),
}

impl Campaign {
    /// Makes a study ready.
    ///
    /// # Errors
    /// There are no gains for the study's vehicle.
    pub fn new(study: Study) -> Result<Self, DesignError> {
        let layout = Layout::of(&study);
        let observers = observers(&study.vehicle, &study.experiment)?;
        let observers = (!study.varies_vehicle()).then_some(observers);
        Ok(Self { observers, layout, study, spare: Mutex::default() })
    }

    /// Makes a run. What can go wrong in it is its status.
    ///
    /// # Errors
    /// The recorded drive lacks a signal, which no study file can cause.
    pub fn row(&self, run: u64) -> Result<Row, StudyError> {
        let values = factor_values(&self.study, run);
        self.row_at(run, &values)
    }

    /// As [`Self::row`], with values of its own.
    ///
    /// # Errors
    /// As [`Self::row`].
    pub fn row_at(&self, run: u64, values: &[f64]) -> Result<Row, StudyError> {
        let seed = run_seed(&self.study, run);
        let mut numbers = values.to_vec();
        let attempt = catch_unwind(AssertUnwindSafe(|| self.scored(values, seed)));
        let Ok(attempt) = attempt else {
            numbers.resize(self.layout.width(), f64::NAN);
            return Ok(Row { run, seed, status: Status::Crashed, numbers });
        };
        let status = match attempt {
            Ok(None) => Status::NoLockUp,
            Ok(Some((quality, observers))) => {
                numbers.extend(quality_numbers(&quality));
                numbers.extend(self.layout.scores(&observers));
                if quality.least_shaft_torque_n_m < 0.0 { Status::TieUp } else { Status::Ok }
            }
            Err(RunError::Refused(_)) => Status::Refused,
            Err(RunError::Plant(_)) => Status::Diverged,
            Err(RunError::Design(_)) => Status::NoGains,
            Err(RunError::Other(error)) => return Err(error),
        };
        numbers.resize(self.layout.width(), f64::NAN);
        Ok(Row { run, seed, status, numbers })
    }

    /// Reads a line of the table as the row of a run. The number of the run determines seed and factors, so a line with
    /// other values, or in the wrong place, is refused.
    ///
    /// # Errors
    /// What is wrong with the line.
    pub fn row_of_line(&self, run: u64, line: &str) -> Result<Row, String> {
        let row = Row::from_cells(line.split(','), &self.layout);
        let row = row.ok_or_else(|| format!("the line is not a row of {} cells", self.layout.header().len()))?;
        if row.run != run {
            return Err(format!("the row is of run {}, expected run {run}", row.run));
        }
        let seed = run_seed(&self.study, run);
        if row.seed != seed {
            return Err(format!("the seed of run {run} is {}, expected {seed}", row.seed));
        }
        let factors = factor_values(&self.study, run).into_iter().zip(&row.numbers).zip(&self.layout.factors);
        for ((value, &written), name) in factors {
            if value.to_bits() != written.to_bits() {
                return Err(format!("`{name}` of run {run} is {written}, expected {value}"));
            }
        }
        if row.line(&self.layout) != line {
            return Err("the numbers of the row have been changed".to_owned());
        }
        let (quality, scores) = row.numbers[self.layout.factors.len()..].split_at(QUALITY.len());
        let is_scored = quality.iter().chain(scores).any(|number| !number.is_nan());
        if is_scored != row.status.is_scored() || scores.iter().any(|&score| score < 0.0) {
            return Err(format!("the scores of run {run} do not go with its status `{}`", row.status.name()));
        }
        Ok(row)
    }

    /// Makes a run and keeps all of it.
    ///
    /// # Errors
    /// The values do not go together; see [`StudyError`] for the rest.
    pub fn run_in_full(&self, run: u64) -> Result<Run, StudyError> {
        self.full(&factor_values(&self.study, run), run_seed(&self.study, run)).map_err(|error| match error {
            RunError::Refused(error) => StudyError::Config(error),
            RunError::Plant(error) => StudyError::Plant(error),
            RunError::Design(error) => StudyError::Design(error),
            RunError::Other(error) => error,
        })
    }

    /// What the row of a run holds; nothing if the shift was not completed.
    fn scored(&self, values: &[f64], seed: u64) -> Result<Option<(ShiftQuality, Vec<ObserverRun>)>, RunError> {
        let spare = self.spare().pop().unwrap_or_default();
        let (varied, ready) = self.prepared(values, seed)?;
        let Varied { car, vehicle, experiment } = &varied;
        let before_s = self.study.record_before_s;
        let shift = scored_shift(spare, car, vehicle, experiment, before_s).map_err(RunError::Plant)?;
        let scored = match shift.quality {
            None => None,
            Some(quality) => Some((quality, observed(&varied, &ready, &shift.trace)?)),
        };
        self.spare().push(shift.trace);
        Ok(scored)
    }

    /// The whole of a run.
    fn full(&self, values: &[f64], seed: u64) -> Result<Run, RunError> {
        let (varied, ready) = self.prepared(values, seed)?;
        let Varied { car, vehicle, experiment } = &varied;
        let before_s = self.study.record_before_s;
        let trace = simulate_shift(car, vehicle, experiment, before_s).map_err(RunError::Plant)?;
        let quality = ShiftQuality::of(&trace, &varied.vehicle.shift);
        Ok(Run { observers: observed(&varied, &ready, &trace)?, trace, quality, varied })
    }

    /// The files of a run, and its observers.
    fn prepared(&self, values: &[f64], seed: u64) -> Result<(Varied, Cow<'_, [AnyObserver]>), RunError> {
        let mut varied = self.study.varied(values).map_err(RunError::Refused)?;
        if let Some(sensors) = &mut varied.experiment.sensors {
            sensors.seed = seed;
        }
        varied.experiment.adapt_controller();
        let ready = match &self.observers {
            Some(ready) => Cow::Borrowed(ready.as_slice()),
            None => Cow::Owned(observers(&varied.vehicle, &varied.experiment).map_err(RunError::Design)?),
        };
        Ok((varied, ready))
    }

    fn spare(&self) -> MutexGuard<'_, Vec<Trace>> {
        self.spare.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The observers over a recorded shift.
fn observed(varied: &Varied, ready: &[AnyObserver], trace: &Trace) -> Result<Vec<ObserverRun>, RunError> {
    run_observers(&varied.vehicle, &varied.experiment, ready, trace).map_err(|error| RunError::Other(error.into()))
}

/// In the order of [`QUALITY`].
fn quality_numbers(quality: &ShiftQuality) -> [f64; QUALITY.len()] {
    [
        quality.inertia_phase_start_s - quality.torque_phase_start_s,
        quality.lock_up_s - quality.inertia_phase_start_s,
        quality.flare_rad_s,
        quality.least_shaft_torque_n_m,
        quality.jerk_peak_m_s3,
        quality.vibration_dose_m_s1_75,
        quality.friction_work_j,
    ]
}

impl Row {
    /// The row as the cells of a table with the layout's header.
    pub fn line(&self, layout: &Layout) -> String {
        let mut line = format!("{},{}", self.run, self.seed);
        let number = |line: &mut String, value: f64| {
            // Writing to a string cannot fail.
            let _ = if value.is_nan() { write!(line, ",") } else { write!(line, ",{value}") };
        };
        let (factors, rest) = self.numbers.split_at(layout.factors.len());
        for &value in factors {
            number(&mut line, value);
        }
        let _ = write!(line, ",{}", self.status.name());
        for &value in rest {
            number(&mut line, value);
        }
        line
    }

    /// The row that these cells hold, if they are one.
    pub fn from_cells<'a>(cells: impl Iterator<Item = &'a str>, layout: &Layout) -> Option<Self> {
        let mut cells = cells;
        let (run, seed) = (cells.next()?.parse().ok()?, cells.next()?.parse().ok()?);
        let number = |cell: &str| if cell.is_empty() { Some(f64::NAN) } else { cell.parse().ok() };
        let mut numbers = Vec::with_capacity(layout.width());
        for _ in 0..layout.factors.len() {
            numbers.push(number(cells.next()?)?);
        }
        let status = Status::from_name(cells.next()?)?;
        for cell in cells {
            numbers.push(number(cell)?);
        }
        (numbers.len() == layout.width()).then_some(Self { run, seed, status, numbers })
    }
}
