//! The native part of the Python package `wetclutch`: plain functions over the library; the classes are in Python.

mod arrow;
mod arrow_rows;
mod car;
mod check;
mod contents;
mod design;
mod error;
mod estimate;
mod export;
mod file;
mod fit;
mod hidden;
mod observer;
mod simulate;
mod step;
mod study;
mod table;
mod work;

use pyo3::prelude::*;

#[pymodule]
fn _wetclutch(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<table::Table>()?;
    module.add_class::<table::Numbers>()?;
    module.add_class::<observer::Observer>()?;
    module.add_function(wrap_pyfunction!(observer::restored_observer, module)?)?;
    module.add_class::<step::StepEstimate>()?;
    module.add_class::<step::ClutchStep>()?;
    module.add_function(wrap_pyfunction!(step::restored_step, module)?)?;
    module.add_function(wrap_pyfunction!(step::restored_clutch, module)?)?;
    module.add_function(wrap_pyfunction!(car::read_car, module)?)?;
    module.add_function(wrap_pyfunction!(car::check_car, module)?)?;
    module.add_function(wrap_pyfunction!(car::template_car, module)?)?;
    module.add_function(wrap_pyfunction!(car::gearboxes, module)?)?;
    module.add_function(wrap_pyfunction!(check::errors_of_file, module)?)?;
    module.add_function(wrap_pyfunction!(check::errors_of_texts, module)?)?;
    module.add_function(wrap_pyfunction!(contents::log_channels, module)?)?;
    module.add_function(wrap_pyfunction!(contents::log_map, module)?)?;
    module.add_function(wrap_pyfunction!(contents::shifts_of_log, module)?)?;
    module.add_function(wrap_pyfunction!(design::design, module)?)?;
    module.add_function(wrap_pyfunction!(export::export, module)?)?;
    module.add_function(wrap_pyfunction!(estimate::estimate, module)?)?;
    module.add_function(wrap_pyfunction!(fit::fit, module)?)?;
    module.add_function(wrap_pyfunction!(simulate::simulate, module)?)?;
    module.add_function(wrap_pyfunction!(simulate::check_drive, module)?)?;
    module.add_function(wrap_pyfunction!(simulate::check_sensors, module)?)?;
    module.add_function(wrap_pyfunction!(study::study_files, module)?)?;
    module.add_function(wrap_pyfunction!(study::study_rows, module)?)?;
    module.add_function(wrap_pyfunction!(study::study_table, module)?)?;
    Ok(())
}
