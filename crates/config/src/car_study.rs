//! Study files of cars with any gearbox: what is driven, and how the driven cars differ from the one that is known.

use std::path::{Path, PathBuf};

use car::{Car, Sensors};
use serde::Deserialize;
use toml::Spanned;

use crate::check::{Check, Number, Word};
use crate::experiment::raw::RawSensors;
use crate::experiment::sensors::sensors;
use crate::{CarFile, ConfigError, DriveFile, Kind, Source};

/// Most cars of a study.
const MAX_RUNS: f64 = 1e6;
/// Word for all shifts between neighbouring gears.
const NEIGHBOURING: &str = "neighbouring";

/// What every car of a study does.
#[derive(Debug, Clone, PartialEq)]
pub enum CarStudyRuns {
    /// A drive.
    Drive(Box<DriveFile>),
    /// Single shifts, each with power and without: the gears before and after.
    Shifts(Vec<[usize; 2]>),
}

/// Largest fraction by which a car differs from the one that is known, each drawn evenly within it; `None` is that of the error
/// budget of the filter.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SampledErrors {
    /// Of the friction of each clutch.
    pub friction: Option<f64>,
    /// Of the gain of each valve.
    pub valve_gain: Option<f64>,
    /// Of the converter's capacity.
    pub converter: Option<f64>,
}

/// A study of a car with any gearbox.
#[derive(Debug, Clone, PartialEq)]
pub struct CarStudy {
    /// The file.
    pub source: Source,
    /// Short name.
    pub name: String,
    /// Title for people.
    pub title: String,
    /// The car that filter and shift controller know.
    pub car: CarFile,
    /// What every drawn car does.
    pub what: CarStudyRuns,
    /// Number of cars.
    pub runs: u64,
    /// Seed of the cars and of their sensors.
    pub seed: u64,
    /// How far they differ.
    pub errors: SampledErrors,
    /// Their sensors: of this file, else of the drive file.
    pub sensors: Option<Sensors>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct RawCarStudy {
    name: Word,
    title: Spanned<String>,
    vehicle: Word,
    drive: Option<Word>,
    shifts: Option<Spanned<RawShifts>>,
    runs: Number,
    #[serde(default)]
    seed: u64,
    #[serde(default)]
    errors: RawErrors,
    sensors: Option<Spanned<RawSensors>>,
}

#[derive(Deserialize)]
#[serde(untagged, expecting = "invalid type, expected \"neighbouring\" or a list of shifts such as [\"1-2\", \"2-1\"]")]
enum RawShifts {
    All(String),
    Listed(Vec<String>),
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct RawErrors {
    friction: Option<Number>,
    valve_gain: Option<Number>,
    converter: Option<Number>,
}

impl CarStudy {
    /// Reads and checks a study file, with the vehicle and the drive that it names.
    ///
    /// # Errors
    /// A file cannot be read, or something in it is wrong.
    pub fn read(path: &Path) -> Result<Self, ConfigError> {
        Self::from_source(Source::read(path)?)
    }

    /// Checks the text of a study file; the files that it names are in its folder.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn from_source(source: Source) -> Result<Self, ConfigError> {
        let raw: RawCarStudy = source.parse_as(Kind::CarStudy)?;
        let check = Check::of(&source);
        let own = raw.sensors.as_ref().map(|raw| sensors(&check, "sensors", raw, None)).transpose()?;
        let runs = check.count("runs", &raw.runs, 1.0..=MAX_RUNS)? as u64;
        let errors = raw.errors.checked(&check)?;
        let beside = |name: &str| source.path.parent().map_or_else(|| PathBuf::from(name), |folder| folder.join(name));
        let of_file = |key: &str, word: &Word| (beside(word.get_ref()), key.to_owned(), word.span().start);
        let (path, key, at) = of_file("vehicle", &raw.vehicle);
        let car = CarFile::read(&path).map_err(|error| error.named_by(&source, &key, at))?;
        let drive = match &raw.drive {
            Some(word) => {
                let (path, key, at) = of_file("drive", word);
                Some(DriveFile::read(&path).map_err(|error| error.named_by(&source, &key, at))?)
            }
            None => None,
        };
        let of_drive = drive.as_ref().and_then(|drive| drive.sensors);
        Ok(Self {
            name: check.name("name", raw.name.get_ref(), raw.name.span().start)?,
            title: check.title("title", &raw.title)?,
            what: what(&check, &raw, drive, &car)?,
            runs,
            seed: raw.seed,
            errors,
            sensors: own.or(of_drive),
            car,
            source,
        })
    }

    /// SHA-256 of everything that determines the runs.
    pub fn fingerprint(&self) -> String {
        let drive = match &self.what {
            CarStudyRuns::Drive(drive) => format!("{}{:?}", drive.source.text, drive.drive),
            CarStudyRuns::Shifts(_) => String::new(),
        };
        // The gearbox is a file of its own: the car as a whole says it.
        let car = format!("{}{:?}", self.car.source.text, self.car.car);
        let text = [self.source.text.as_str(), &car, &drive].join("\u{0}");
        Source { path: PathBuf::new(), text }.sha256()
    }
}

/// Largest relative error of a friction or a gain: a clutch without friction or pressure cannot be simulated.
const FACTOR_MAX: f64 = 0.95;

impl RawErrors {
    fn checked(&self, check: &Check<'_>) -> Result<SampledErrors, ConfigError> {
        let fraction = |key: &str, value: &Option<Number>, max: f64| {
            value.as_ref().map(|value| check.number(format_args!("errors.{key}"), value, 0.0..=max)).transpose()
        };
        Ok(SampledErrors {
            friction: fraction("friction", &self.friction, FACTOR_MAX)?,
            valve_gain: fraction("valve_gain", &self.valve_gain, FACTOR_MAX)?,
            converter: fraction("converter", &self.converter, 0.5)?,
        })
    }
}

fn what(
    check: &Check<'_>,
    raw: &RawCarStudy,
    drive: Option<DriveFile>,
    car: &Car,
) -> Result<CarStudyRuns, ConfigError> {
    let shifts = match (drive, &raw.shifts) {
        (Some(drive), None) => return Ok(CarStudyRuns::Drive(Box::new(drive))),
        (None, Some(shifts)) => shifts,
        (_, both) => {
            let at = both.as_ref().map_or(0, |shifts| shifts.span().start);
            let hint =
                "drive = \"../drives/city.toml\", or shifts = \"neighbouring\" or a list such as [\"1-2\", \"2-1\"]";
            return Err(check.meaning(
                "drive",
                at,
                "expected either `drive` or `shifts`".to_owned(),
                Some(hint.to_owned()),
            ));
        }
    };
    let wrong = |message: String, hint: String| check.meaning("shifts", shifts.span().start, message, Some(hint));
    let names = || car.gearbox.gears.iter().map(|gear| gear.name.as_str()).collect::<Vec<_>>().join(", ");
    let pair = |text: &String| {
        let gears = text.split_once('-').and_then(|(from, to)| {
            Some([car.gearbox.gear(from.trim())?, car.gearbox.gear(to.trim())?]).filter(|[from, to]| from != to)
        });
        gears.ok_or_else(|| wrong(format!("`{text}` is no shift of the gearbox"), format!("its gears are {}", names())))
    };
    let pairs = match shifts.get_ref() {
        RawShifts::All(word) if word == NEIGHBOURING => {
            let forward = car.gearbox.forward_gears();
            forward.windows(2).flat_map(|pair| [[pair[0], pair[1]], [pair[1], pair[0]]]).collect()
        }
        RawShifts::All(word) => {
            return Err(wrong(format!("`{word}` is unknown"), format!("\"{NEIGHBOURING}\", or a list of shifts")));
        }
        RawShifts::Listed(list) => list.iter().map(pair).collect::<Result<Vec<_>, _>>()?,
    };
    if pairs.is_empty() {
        return Err(wrong("there is no shift".to_owned(), "name at least one, such as \"1-2\"".to_owned()));
    }
    Ok(CarStudyRuns::Shifts(pairs))
}
