//! Vehicle files.

use std::path::PathBuf;

use pyo3::prelude::*;
use wetclutch::{TemplateNumbers, VehicleFile};

use crate::error::exception;

/// Name, kind, text, text of the gearbox, names of the gears and of the elements.
pub(crate) type Described = (String, &'static str, String, Option<String>, Vec<String>, Vec<String>);

pub(crate) fn described(vehicle: &VehicleFile) -> Described {
    let (gears, elements) = match vehicle {
        VehicleFile::Gearbox(file) => (
            file.car.gearbox.gears.iter().map(|gear| gear.name.clone()).collect(),
            file.car.gearbox.elements.iter().map(|element| element.name.clone()).collect(),
        ),
        VehicleFile::OneShift(_) => (vec!["1".to_owned(), "2".to_owned()], Vec::new()),
    };
    let kind = if matches!(vehicle, VehicleFile::Gearbox(_)) { "gearbox" } else { "one-shift" };
    let gearbox = vehicle.gearbox_text().map(str::to_owned);
    (vehicle.name().to_owned(), kind, vehicle.text().to_owned(), gearbox, gears, elements)
}

/// Reads a vehicle file.
#[pyfunction]
pub(crate) fn read_car(py: Python<'_>, path: PathBuf) -> PyResult<Described> {
    let vehicle = VehicleFile::read(&path).map_err(|error| exception(py, &error))?;
    Ok(described(&vehicle))
}

/// Checks the text of a vehicle file, and that of its gearbox file where it has one.
#[pyfunction]
#[pyo3(signature = (name, text, gearbox=None))]
pub(crate) fn check_car(py: Python<'_>, name: &str, text: &str, gearbox: Option<&str>) -> PyResult<Described> {
    Ok(described(&parsed(py, name, text, gearbox)?))
}

/// The vehicle of these texts.
pub(crate) fn parsed(py: Python<'_>, name: &str, text: &str, gearbox: Option<&str>) -> PyResult<VehicleFile> {
    VehicleFile::from_texts(name, text, gearbox).map_err(|error| exception(py, &error))
}

/// A car of a few numbers with one of the gearboxes of the program.
#[pyfunction]
#[pyo3(signature = (gearbox, name, mass_kg, wheel_radius_m, final_ratio, engine_torque_n_m, has_converter, has_stroke))]
#[expect(clippy::too_many_arguments, reason = "each is a keyword of the function in Python")]
pub(crate) fn template_car(
    py: Python<'_>,
    gearbox: &str,
    name: String,
    mass_kg: f64,
    wheel_radius_m: Option<f64>,
    final_ratio: Option<f64>,
    engine_torque_n_m: Option<f64>,
    has_converter: Option<bool>,
    has_stroke: bool,
) -> PyResult<Described> {
    let usual = TemplateNumbers::of_mass(mass_kg);
    let numbers = TemplateNumbers {
        name,
        wheel_radius_m: wheel_radius_m.unwrap_or(usual.wheel_radius_m),
        engine_torque_n_m: engine_torque_n_m.unwrap_or(usual.engine_torque_n_m),
        final_ratio,
        has_converter,
        has_stroke,
        mass_kg,
    };
    let vehicle = VehicleFile::template(gearbox, &numbers).map_err(|error| exception(py, &error))?;
    Ok(described(&vehicle))
}

/// Names of the gearboxes of the program.
#[pyfunction]
pub(crate) fn gearboxes() -> Vec<&'static str> {
    wetclutch::gearboxes().to_vec()
}
