//! Values of a car that fit logs.

mod gearbox;
mod one_shift;

use std::fmt;
use std::iter;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use car::Sensors;
use config::ConfigError;
use fit::{Channel, OneStep};
use report::adaptation_page::adaptation_parts;
use report::sheet::{Part, Sheet};
use trace::ShownPath as _;

pub use ::fit::gearbox::{Adaptation, Adaptations, Adapted, AdaptedShift, AdaptedValue, ShiftRole};
pub use ::fit::{ChangedChannel, ChangedMap, MapChange, MapKey, Measure, ReportRow, Verdict};

use crate::{Column, Error, LogInput, Notes, Table, Values, VehicleFile};

/// Fewer shifts are all fitted.
const MIN_FOR_HELD_OUT: usize = 8;
/// Minimum number of shifts that are held out.
const HELD_OUT_MIN: usize = 3;
/// Reasons that are reported one by one.
const REASONS_MAX: usize = 10;

/// Steps of the oil temperature in an adaptation table, K.
pub const OIL_STEPS_K: RangeInclusive<f64> = 2.0..=200.0;

/// How a car is fitted.
#[derive(Debug, Clone, Default)]
pub struct FitOptions {
    /// The sensors that the logs were recorded with.
    pub sensors: Option<Sensors>,
    /// Where the fitted file will be: it names its gearbox file from there. In the place of the given one if there is none.
    pub output: Option<PathBuf>,
    /// Whether to make the page of the fit.
    pub with_page: bool,
    /// Step of the oil temperature, K, in [`OIL_STEPS_K`], by which fill time, kiss point, lag and friction of each clutch of a gearbox are fitted
    /// too; none to leave that out.
    pub oil_step_k: Option<f64>,
    /// Set when the fit is to end with an error.
    pub interrupt: Option<Arc<AtomicBool>>,
}

impl FitOptions {
    fn is_interrupted(&self) -> bool {
        self.interrupt.as_ref().is_some_and(|flag| flag.load(Ordering::Relaxed))
    }
}

/// How far a fit is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FitProgress<'a> {
    /// A log is read, to this time, s, of its clock.
    Reading {
        /// The log.
        log: &'a Path,
        /// The time; none before its first row.
        time_s: Option<f64>,
    },
    /// So many shifts are fitted.
    Fitting {
        /// How many.
        shifts: usize,
        /// Iteration, from 1.
        iteration: u32,
    },
    /// A group of shifts by gears and oil temperature is fitted.
    Adapting {
        /// Shifts of the group.
        shifts: usize,
        /// Iteration, from 1.
        iteration: u32,
    },
    /// The fitted car is compared with shifts that were held out.
    Validating,
}

impl fmt::Display for FitProgress<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Reading { log, time_s: None } => write!(f, "reading {}", log.shown()),
            Self::Reading { log, time_s: Some(time_s) } => write!(f, "reading {}, {time_s:.0} s", log.shown()),
            Self::Fitting { shifts, iteration } => write!(f, "{shifts} shifts, iteration {iteration}"),
            Self::Adapting { shifts, iteration } => {
                write!(f, "adaptation table: {shifts} shifts, iteration {iteration}")
            }
            Self::Validating => f.write_str("checking on shifts that were held out"),
        }
    }
}

/// Takes how far a fit is.
pub type FitProgressTaker<'a> = &'a mut dyn FnMut(FitProgress<'_>);

/// A fitted car.
#[derive(Debug, Clone)]
pub struct Fitted {
    /// Its vehicle file: the given one with the reason in its first line where the given values are kept.
    pub vehicle: VehicleFile,
    /// What was fitted: each quantity with its value and its interval of 95 %.
    pub parameters: Vec<ReportRow>,
    /// One-step errors of the channels of a vehicle file of one shift, in words.
    pub channels: Vec<String>,
    /// What belongs into the channel map of the logs.
    pub map_changes: Vec<MapChange>,
    /// What else the logs show, in sentences.
    pub statements: Vec<String>,
    /// How many shifts were fitted.
    pub shifts: usize,
    /// Shifts that were not used or not fitted, and why.
    pub not_used: Vec<String>,
    /// Why the given values are kept, if they are.
    pub kept: Option<String>,
    /// Fill time, kiss point, lag and friction of each clutch by gears and temperature of the oil, if they were asked for.
    pub adaptations: Option<Adaptations>,
    /// The page of the fit, as HTML, if it was asked for.
    pub page: Option<String>,
}

/// Fits the values of a car to logs.
///
/// ```
/// use std::sync::Arc;
/// use wetclutch::{FitOptions, LogInput, TemplateNumbers, VehicleFile, fit, read_drive, simulate};
///
/// let car = VehicleFile::template("8hp", &TemplateNumbers::of_mass(1900.0))?;
/// let mut drive = read_drive("../../drives/city.toml".as_ref(), None)?;
/// (drive.repetitions, drive.segments) = (1, drive.segments[..8].to_vec());
/// let log = Arc::new(simulate(car.car().expect("it has a gearbox"), &drive)?.measured);
/// let logs = [LogInput::of_table("the drive", &log)];
/// let fitted = fit(&car, &logs, &FitOptions::default(), &mut |_| (), &mut |_| ())?;
/// assert!(fitted.shifts > 2 && !fitted.parameters.is_empty());
/// # Ok::<(), wetclutch::Error>(())
/// ```
///
/// # Errors
/// A log cannot be read or is not of this car, no shift can be fitted, the fit found no minimum, or it was interrupted.
pub fn fit(
    vehicle: &VehicleFile,
    logs: &[LogInput<'_>],
    options: &FitOptions,
    progress: FitProgressTaker<'_>,
    say: Notes<'_>,
) -> Result<Fitted, Error> {
    check_oil_step(vehicle, options)?;
    let (mut fitted, intervals) = match vehicle {
        VehicleFile::Gearbox(file) => gearbox::fit(file, logs, options, progress, say)?,
        VehicleFile::OneShift(file) => one_shift::fit(file, logs, options, progress, say)?,
    };
    if options.with_page {
        fitted.page = Some(fitted.page_with(intervals, vehicle, logs)?);
    }
    Ok(fitted)
}

fn check_oil_step(vehicle: &VehicleFile, options: &FitOptions) -> Result<(), Error> {
    match options.oil_step_k {
        Some(step_k) if !OIL_STEPS_K.contains(&step_k) => Err(Error::Input(format!(
            "the step of the oil temperature is {step_k} K\nhint: give one from {} to {} K",
            OIL_STEPS_K.start(),
            OIL_STEPS_K.end()
        ))),
        Some(_) if matches!(vehicle, VehicleFile::OneShift(_)) => Err(Error::Input(format!(
            "{}: an adaptation table is of a car with a gearbox\nhint: give a vehicle file with a gearbox, or leave the table out",
            vehicle.source().path.shown()
        ))),
        _ => Ok(()),
    }
}

impl Fitted {
    /// The fitted quantities, a row for each: value and interval of 95 % in the unit of the row; a factor is one on the value of the given file.
    pub fn intervals(&self) -> Table {
        let words = |word: fn(&ReportRow) -> &str| Values::Words(self.parameters.iter().map(word).collect());
        let numbers = |number: fn(&ReportRow) -> f64| Values::Numbers(self.parameters.iter().map(number).collect());
        let columns = [
            ("parameter", words(|row| &row.name)),
            ("unit", words(|row| row.measure.unit())),
            ("value", numbers(|row| row.value)),
            ("lower", numbers(|row| row.interval[0])),
            ("upper", numbers(|row| row.interval[1])),
            ("deviation_after_over_before", numbers(|row| row.fraction)),
            ("verdict", words(|row| row.verdict.name())),
        ];
        Table { columns: columns.map(|(name, values)| Column { name: name.to_owned(), values }).into() }
    }

    /// Fill time, kiss point, lag and friction by clutch, gears and temperature of the oil, a row for each: value and interval of 95 % in the unit of
    /// the row. Without rows where [`FitOptions::oil_step_k`] is none. Where no shift can be fitted the numbers are NaN, and `lacks` says what would
    /// help.
    pub fn adaptation_table(&self) -> Table {
        let rows = self.adaptations.as_ref().map_or(&[][..], |adaptations| &adaptations.rows);
        let words = |word: fn(&Adaptation) -> &str| Values::Words(rows.iter().map(word).collect());
        let numbers = |number: &dyn Fn(&Adaptation) -> f64| Values::Numbers(rows.iter().map(number).collect());
        let found = |of: fn(AdaptedValue) -> f64| numbers(&|row| row.found.map_or(f64::NAN, of));
        let oil = |end: usize| numbers(&|row| row.oil_degc.map_or(f64::NAN, |ends| ends[end]));
        let verdict = |row: &Adaptation| row.found.map_or(Verdict::NotIdentifiable, |found| found.verdict).name();
        let columns = [
            ("element", words(|row| &row.element)),
            ("from_gear", words(|row| row.shift.as_ref().map_or("all", |shift| &shift.gears[0]))),
            ("to_gear", words(|row| row.shift.as_ref().map_or("all", |shift| &shift.gears[1]))),
            ("role", words(|row| row.shift.as_ref().map_or("all", |shift| shift.role.name()))),
            ("oil_from_degc", oil(0)),
            ("oil_to_degc", oil(1)),
            ("shifts", numbers(&|row| row.shifts as f64)),
            ("quantity", words(|row| row.quantity.name())),
            ("unit", words(|row| row.quantity.unit())),
            ("value", found(|found| found.value)),
            ("lower", found(|found| found.interval[0])),
            ("upper", found(|found| found.interval[1])),
            ("value_alone", found(|found| found.alone)),
            ("deviation_after_over_before", found(|found| found.fraction)),
            ("verdict", words(verdict)),
            ("lacks", words(|row| &row.lacks)),
        ];
        Table { columns: columns.map(|(name, values)| Column { name: name.to_owned(), values }).into() }
    }

    /// What belongs into the channel map, a row for each change: s are added to `delay_s` and `late_s`, Pa to `offset`, and `scale` is multiplied. The
    /// signal `commands` is each command of a valve.
    pub fn channel_map(&self) -> Table {
        let words = |word: fn(&MapChange) -> &str| Values::Words(self.map_changes.iter().map(word).collect());
        let numbers = |number: fn(&MapChange) -> f64| Values::Numbers(self.map_changes.iter().map(number).collect());
        let columns = [
            ("signal", words(|change| change.channel.name())),
            ("key", words(|change| change.key.name())),
            ("unit", words(|change| change.key.unit())),
            ("value", numbers(|change| change.value)),
            ("standard_deviation", numbers(|change| change.sd)),
        ];
        Table { columns: columns.map(|(name, values)| Column { name: name.to_owned(), values }).into() }
    }

    /// The channel map at `path` with these changes, as it is to stand at `to`.
    ///
    /// # Errors
    /// The text is that of no channel map, or a changed value is outside of its range.
    pub fn changed_map(&self, path: &Path, text: &str, to: &Path) -> Result<ChangedMap, Error> {
        Ok(::fit::changed_map(path, text, to, &self.map_changes)?)
    }

    /// Names of the quantities that the logs do not identify: they are known no better than before.
    pub fn not_identifiable(&self) -> impl Iterator<Item = &str> {
        let open = self.parameters.iter().filter(|row| row.verdict == Verdict::NotIdentifiable);
        open.map(|row| row.name.as_str())
    }

    /// Intervals, adaptations, and what was found, as a page.
    fn page_with(&self, intervals: Part, given: &VehicleFile, logs: &[LogInput<'_>]) -> Result<String, Error> {
        let kept = self.kept.as_ref().map(|reason| format!("warning: the given values are kept: {reason}"));
        Ok(Sheet {
            name: given.name(),
            title: "fit",
            lead: format!("fitted to {}", names(logs)),
            sentences: self.statements.iter().cloned().chain(kept).collect(),
            parts: iter::once(intervals).chain(self.adaptations.iter().flat_map(adaptation_parts)).collect(),
            sources: vec![given.source(), self.vehicle.source()],
        }
        .html()?)
    }
}

/// The names of the logs.
fn names(logs: &[LogInput<'_>]) -> String {
    logs.iter().map(|log| log.path.shown().to_string()).collect::<Vec<_>>().join(", ")
}

/// Why a file with fitted values is none.
fn impossible(error: &ConfigError) -> Error {
    Error::Work(format!(
        "the fitted values are not those of a possible car: {error}\n\
         hint: check units and signs of the channels, and the map, with `wetclutch inspect`"
    ))
}

/// One-step errors and gain of a channel, in words.
fn said_of_channel(channel: Channel, errors: &OneStep) -> String {
    let (factor, unit) = if channel == Channel::Pressure { (1e-3, "kPa") } else { (1.0, "rad/s") };
    let [low, high] = errors.scale_interval.map(|side| factor * side);
    let [weakest, strongest] = errors.gain_interval;
    format!(
        "{}: one-step error {:.3} {unit} (95 % {low:.3} to {high:.3}), g {:.2} ({weakest:.2} to {strongest:.2})",
        channel.name(),
        factor * errors.scale,
        errors.gain
    )
}

/// What is said where nothing is held out.
fn nothing_held_out() -> String {
    format!("no shift is held out: fewer than {MIN_FOR_HELD_OUT} can be used, so nothing checks this fit")
}

/// Reports reasons, and how many more there are of many.
fn say_reasons(what: &str, reasons: &[String], say: Notes<'_>) {
    for reason in reasons.iter().take(REASONS_MAX) {
        say(&format!("{what}: {reason}"));
    }
    if let Some(more @ 1..) = reasons.len().checked_sub(REASONS_MAX) {
        say(&format!("{what}: {more} more"));
    }
}
