//! The native part of the Python package `wetclutch`: plain functions over the library; the classes are in Python.

mod arrow;
mod car;
mod design;
mod error;
mod estimate;
mod hidden;
mod observer;
mod simulate;
mod table;
mod work;

use pyo3::prelude::*;

#[pymodule]
fn _wetclutch(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<table::Table>()?;
    module.add_class::<table::Numbers>()?;
    module.add_class::<observer::Observer>()?;
    module.add_class::<observer::StepEstimate>()?;
    module.add_class::<observer::ClutchStep>()?;
    module.add_function(wrap_pyfunction!(car::read_car, module)?)?;
    module.add_function(wrap_pyfunction!(car::check_car, module)?)?;
    module.add_function(wrap_pyfunction!(car::template_car, module)?)?;
    module.add_function(wrap_pyfunction!(car::gearboxes, module)?)?;
    module.add_function(wrap_pyfunction!(design::design, module)?)?;
    module.add_function(wrap_pyfunction!(estimate::estimate, module)?)?;
    module.add_function(wrap_pyfunction!(simulate::simulate, module)?)?;
    Ok(())
}
