//! Vehicle files.

use std::path::Path;

use car::{Car, CarSize, Drive, GainMethod, ObserverKind, Sensors};
use config::vehicle::short::{CarFacts, ENGINE_TORQUES_N_M, short_car_file, sized_gearbox};
use config::{CarFile, DriveFile, Kind, Source, read_learnt, write_learnt};
use observer::gearbox::Learnt;
use trace::ShownPath as _;

use crate::Error;

/// The gearboxes of the program, by their names.
pub fn gearboxes() -> [&'static str; config::gearbox::SHIPPED.len()] {
    config::gearbox::SHIPPED.map(|(name, _)| name)
}

/// The gearbox whose ratios contain that of the axle, and which has no converter.
const DUAL_CLUTCH: &str = "dual_clutch_7";

/// The numbers of a template. Nothing but the mass has to be known.
#[derive(Debug, Clone, PartialEq)]
pub struct TemplateNumbers {
    /// Name of the car.
    pub name: String,
    /// Mass with driver, kg.
    pub mass_kg: f64,
    /// Rolling radius of the driven wheels, m.
    pub wheel_radius_m: f64,
    /// Ratio from the gearbox output to the wheels; the usual one if none is given.
    pub final_ratio: Option<f64>,
    /// Maximum engine torque, N m.
    pub engine_torque_n_m: f64,
    /// Whether a torque converter connects engine and gearbox, and not a clutch; as usual with the gearbox if it is not given.
    pub has_converter: Option<bool>,
    /// Whether the pistons of the clutches have a stroke, so that the fill takes time.
    pub has_stroke: bool,
}

impl TemplateNumbers {
    /// Those of a usual car of this mass, kg: the engine torque grows with it.
    pub fn of_mass(mass_kg: f64) -> Self {
        let size = CarSize::of_mass(mass_kg);
        Self {
            name: "my car".to_owned(),
            mass_kg,
            wheel_radius_m: size.wheel_radius_m,
            final_ratio: None,
            // A vehicle file has no larger one.
            engine_torque_n_m: size.engine_torque_n_m.min(*ENGINE_TORQUES_N_M.end()),
            has_converter: None,
            has_stroke: false,
        }
    }
}

/// A vehicle file: of a car with its whole gearbox, or of one shift.
#[derive(Debug, Clone, PartialEq)]
pub enum VehicleFile {
    /// A car with a gearbox.
    Gearbox(Box<CarFile>),
    /// A car as one of its shifts sees it: the chapter's file.
    OneShift(Box<config::VehicleFile>),
}

impl VehicleFile {
    /// Reads a vehicle file.
    ///
    /// # Errors
    /// The file cannot be read, or something in it is wrong: the message names file, line and key.
    pub fn read(path: &Path) -> Result<Self, Error> {
        if Source::read(path)?.kind()? == Kind::Car {
            return Ok(Self::Gearbox(Box::new(CarFile::read(path)?)));
        }
        Ok(Self::OneShift(Box::new(config::VehicleFile::read(path)?)))
    }

    /// The vehicle file with this text, and with that of its gearbox file where it is of a car with a gearbox. `name` is what messages call
    /// it.
    ///
    /// # Errors
    /// Something in them is wrong: the message names line and key.
    pub fn from_texts(name: &str, text: &str, gearbox: Option<&str>) -> Result<Self, Error> {
        let source = Source::built_in(name, text);
        match (source.kind()?, gearbox) {
            (Kind::Car, None) => Ok(Self::Gearbox(Box::new(CarFile::from_source(source)?))),
            (Kind::Car, Some(gearbox)) => {
                Ok(Self::Gearbox(Box::new(CarFile::from_sources(source, gearbox_source(name, gearbox))?)))
            }
            _ => Ok(Self::OneShift(Box::new(config::VehicleFile::from_source(source)?))),
        }
    }

    /// A car of a few numbers with one of the gearboxes of the program ([`gearboxes`]), sized to its engine.
    ///
    /// # Errors
    /// There is no such gearbox, or a number cannot be right.
    pub fn template(gearbox: &str, numbers: &TemplateNumbers) -> Result<Self, Error> {
        let shipped = config::gearbox::SHIPPED.iter().find(|(name, _)| *name == gearbox);
        let Some((_, text)) = shipped else {
            let message =
                format!("gearbox: there is no `{gearbox}`\nhint: the gearboxes are {}", gearboxes().join(", "));
            return Err(Error::Input(message));
        };
        let file = format!("{gearbox}.toml");
        let text = sized_gearbox(&Source::built_in(&file, text), numbers.engine_torque_n_m)?;
        let source = Source::built_in(&file, &text);
        let facts = CarFacts {
            name: numbers.name.clone(),
            gearbox: file,
            // This one ships as a gearbox without a converter.
            has_converter: numbers.has_converter.unwrap_or(gearbox != DUAL_CLUTCH),
            converter: None,
            has_stroke: numbers.has_stroke,
            mass_kg: numbers.mass_kg,
            wheel_radius_m: numbers.wheel_radius_m,
            final_ratio: numbers.final_ratio.unwrap_or_else(|| match gearbox {
                DUAL_CLUTCH => 1.0,
                _ => CarSize::of_mass(numbers.mass_kg).final_ratio,
            }),
            engine_torque_n_m: numbers.engine_torque_n_m,
        };
        Self::from_texts(&numbers.name, &short_car_file(&facts, &source)?, Some(&source.text))
    }

    /// The name of the car.
    pub fn name(&self) -> &str {
        match self {
            Self::Gearbox(file) => &file.car.name,
            Self::OneShift(file) => &file.vehicle.name,
        }
    }

    /// The car with its gearbox; `None` of a file of one shift.
    pub fn car(&self) -> Option<&Car> {
        match self {
            Self::Gearbox(file) => Some(&file.car),
            Self::OneShift(_) => None,
        }
    }

    /// The file.
    pub fn source(&self) -> &Source {
        match self {
            Self::Gearbox(file) => &file.source,
            Self::OneShift(file) => &file.source,
        }
    }

    /// The text of the file.
    pub fn text(&self) -> &str {
        &self.source().text
    }

    /// The text of its gearbox file; `None` of a file of one shift.
    pub fn gearbox_text(&self) -> Option<&str> {
        match self {
            Self::Gearbox(file) => Some(&file.gearbox_source.text),
            Self::OneShift(_) => None,
        }
    }

    /// What was learnt of it, from the text that [`Self::text_of_learnt`] made.
    ///
    /// # Errors
    /// The text is of another car, or this is a file of one shift.
    pub fn learnt_of(&self, text: &str) -> Result<Learnt<f64>, Error> {
        Ok(read_learnt(&self.car().ok_or_else(learnt_without_effect)?.gearbox, &Source::built_in("learnt", text))?)
    }

    /// What was learnt of it, as text.
    ///
    /// # Errors
    /// This is a file of one shift.
    pub fn text_of_learnt(&self, learnt: &Learnt<f64>) -> Result<String, Error> {
        Ok(write_learnt(&self.car().ok_or_else(learnt_without_effect)?.gearbox, learnt))
    }

    /// The rolling radius of its driven wheels, m.
    pub fn wheel_radius_m(&self) -> f64 {
        match self {
            Self::Gearbox(file) => file.car.road.wheel_radius_m,
            Self::OneShift(file) => file.vehicle.road.wheel_radius_m,
        }
    }
}

/// The text of a gearbox file, as messages call it beside the vehicle file of this name.
pub(crate) fn gearbox_source(name: &str, text: &str) -> Source {
    Source::built_in(&format!("gearbox of {name}"), text)
}

/// The sensors that a file describes.
///
/// # Errors
/// The file cannot be read, or has no such table.
pub fn read_sensors(path: &Path) -> Result<Sensors, Error> {
    sensors_of(&Source::read(path)?)
}

/// The sensors that the text of a file describes.
///
/// # Errors
/// It has no such table, or a value cannot be right.
pub fn sensors_of(source: &Source) -> Result<Sensors, Error> {
    config::sensors_of(source)?.ok_or_else(|| without_sensors(source))
}

/// The same with the errors of the readings, for a simulation.
///
/// # Errors
/// See [`sensors_of`].
pub fn simulated_sensors_of(source: &Source) -> Result<Sensors, Error> {
    config::simulated_sensors_of(source)?.ok_or_else(|| without_sensors(source))
}

fn without_sensors(source: &Source) -> Error {
    let path = source.path.shown();
    Error::Input(format!("{path}: there is no [sensors] table\nhint: add one, as in experiments/bench.toml"))
}

/// The drive that a file describes, its sensors with this seed in place of that of the file, if one is given.
///
/// # Errors
/// The file cannot be read, or something in it is wrong.
pub fn read_drive(path: &Path, seed: Option<u64>) -> Result<Drive, Error> {
    let mut drive = drive_of(Source::read(path)?)?;
    if let (Some(sensors), Some(seed)) = (&mut drive.sensors, seed) {
        sensors.seed = seed;
    }
    Ok(drive)
}

/// The drive that the text of a file describes.
///
/// # Errors
/// Something in it is wrong, or the file of speeds that it names cannot be read.
pub fn drive_of(source: Source) -> Result<Drive, Error> {
    Ok(DriveFile::from_source(source)?.drive)
}

/// The observer of this name.
///
/// # Errors
/// There is none.
pub fn observer_named(name: &str) -> Result<ObserverKind, Error> {
    let found = ObserverKind::ALL.into_iter().find(|kind| kind.name() == name);
    found.ok_or_else(|| unknown("observer", name, &ObserverKind::ALL.map(ObserverKind::name)))
}

/// The design method of this name.
///
/// # Errors
/// There is none.
pub fn method_named(name: &str) -> Result<GainMethod, Error> {
    let found = GainMethod::ALL.into_iter().find(|method| method.name() == name);
    found.ok_or_else(|| unknown("method", name, &GainMethod::ALL.map(GainMethod::name)))
}

pub(crate) fn unknown(what: &str, name: &str, known: &[&str]) -> Error {
    Error::Input(format!("{what}: there is no `{}`\nhint: expected one of {}", name.escape_debug(), known.join(", ")))
}

/// Refuses what was learnt with a vehicle file that does not use it.
pub(crate) fn learnt_without_effect() -> Error {
    Error::Input(
        "--learnt has no effect with the vehicle file of one shift\n\
         hint: leave it out; the filter of a car with a gearbox, such as vehicles/eight_speed.toml, keeps what it learns"
            .to_owned(),
    )
}
