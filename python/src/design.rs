//! Gains and certificates.

use pyo3::prelude::*;
use wetclutch::gains::{design as designed, quantity_named};
use wetclutch::{DesignObserver, DesignOptions, Error};

use crate::car::parsed;
use crate::work;

/// What Python gives of how gains are designed.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Given {
    observer: String,
    method: Option<String>,
    quantity: Option<String>,
    sample_time_s: Option<f64>,
    kappa1_per_s: Option<f64>,
    kappa2_per_s: Option<f64>,
    error_bound: Option<f64>,
    offset_max_pa: Option<f64>,
}

impl Given {
    fn options(self) -> Result<DesignOptions, Error> {
        Ok(DesignOptions {
            observer: DesignObserver::named(&self.observer)?,
            method: self.method.as_deref().map(wetclutch::method_named).transpose()?,
            quantity: self.quantity.as_deref().map(quantity_named).transpose()?,
            sample_time_s: self.sample_time_s,
            kappa1_per_s: self.kappa1_per_s,
            kappa2_per_s: self.kappa2_per_s,
            error_bound: self.error_bound,
            offset_max_pa: self.offset_max_pa,
        })
    }
}

/// Designs gains: the object that the command prints as JSON, required offsets that are not reached, in words, and the error systems by phase as JSON.
#[pyfunction]
pub(crate) fn design(
    py: Python<'_>,
    car: (String, String, Option<String>),
    shift: Option<String>,
    given: &Bound<'_, PyAny>,
) -> PyResult<(String, Vec<String>, String)> {
    let (name, text, gearbox) = car;
    let vehicle = parsed(py, &name, &text, gearbox.as_deref())?;
    let given: Given = given.extract()?;
    work::done(py, None, move |_| {
        let found = designed(&vehicle, shift.as_deref(), &given.options()?)?;
        let missed = found.missed.iter().map(ToString::to_string).collect();
        let models: Vec<_> = found.error_models.iter().map(|(phase, model)| (phase.name(), model)).collect();
        Ok((serde_json::to_string(&found.json(vehicle.source())?)?, missed, serde_json::to_string(&models)?))
    })
}
