//! Vehicle files.

use std::path::Path;

use car::Sensors;
use config::{CarFile, Kind, Source};
use trace::ShownPath as _;

use crate::Error;

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

    /// The name of the car.
    pub fn name(&self) -> &str {
        match self {
            Self::Gearbox(file) => &file.car.name,
            Self::OneShift(file) => &file.vehicle.name,
        }
    }

    /// The text of the file.
    pub fn text(&self) -> &str {
        match self {
            Self::Gearbox(file) => &file.source.text,
            Self::OneShift(file) => &file.source.text,
        }
    }

    /// The rolling radius of its driven wheels, m.
    pub fn wheel_radius_m(&self) -> f64 {
        match self {
            Self::Gearbox(file) => file.car.road.wheel_radius_m,
            Self::OneShift(file) => file.vehicle.road.wheel_radius_m,
        }
    }
}

/// The sensors that a file describes.
///
/// # Errors
/// The file cannot be read, or has no such table.
pub fn read_sensors(path: &Path) -> Result<Sensors, Error> {
    config::read_sensors(path)?.ok_or_else(|| {
        let path = path.shown();
        Error::Input(format!("{path}: there is no [sensors] table\nhint: add one, as in experiments/bench.toml"))
    })
}
