//! The observer of a car for a controller.

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use wetclutch::{CSource, Error, ExportOptions};

use crate::car::parsed;
use crate::file::GivenFile;
use crate::work;

/// Names and bytes of files.
type Files<'py> = Vec<(String, Bound<'py, PyBytes>)>;

/// The files of a car's observer: name and bytes of each. Shared libraries are those of models for co-simulation, of the observer and of the car.
#[pyfunction]
#[pyo3(signature = (car, shift, sensors, program, c_source, fmu_libraries, car_fmu_libraries))]
#[expect(clippy::too_many_arguments, reason = "those of Python")]
pub(crate) fn export<'py>(
    py: Python<'py>,
    car: (String, String, Option<String>),
    shift: Option<String>,
    sensors: Option<GivenFile>,
    program: Option<Vec<u8>>,
    c_source: Option<Vec<u8>>,
    fmu_libraries: Vec<Vec<u8>>,
    car_fmu_libraries: Vec<Vec<u8>>,
) -> PyResult<Files<'py>> {
    let (name, text, gearbox) = car;
    let vehicle = parsed(py, &name, &text, gearbox.as_deref())?;
    let files = work::done(py, None, move |_| {
        let sensors = sensors.map(|sensors| wetclutch::sensors_of(&sensors.source()?)).transpose()?;
        let c_source = c_source.map(CSource::new).transpose().map_err(|error| Error::Input(format!("c: {error}")))?;
        let options = ExportOptions { shift, sensors, program, c_source, fmu_libraries, car_fmu_libraries };
        wetclutch::export(&vehicle, &options)
    })?;
    Ok(files.into_iter().map(|file| (file.name, PyBytes::new(py, &file.bytes))).collect())
}
