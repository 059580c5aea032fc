//! The estimate for one step of the gearbox filter.

use std::collections::HashMap;
use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use serde::{Deserialize, Serialize};
use wetclutch::{Car, ClutchEstimate, Error, Estimator, Gear, ShiftElement, ShiftEstimate};

use crate::error::{defect, exception};

/// Of what is pickled.
const VERSION: &str = env!("CARGO_PKG_VERSION");
/// The gear in which no gear is engaged.
pub(crate) const NEUTRAL: &str = "N";

/// Names of a gearbox by place.
#[derive(Serialize, Deserialize)]
pub(crate) struct Names {
    pub(crate) gears: Vec<String>,
    /// Of the elements, with their places in the filter's tables.
    places: Vec<(usize, String)>,
}

impl Names {
    pub(crate) fn of(car: &Car, estimator: &Estimator) -> Self {
        let placed = |place: usize| Some((place, estimator.name_of(ShiftElement::at(place))?.to_owned()));
        Self {
            gears: car.gearbox.gears.iter().map(|gear| gear.name.clone()).collect(),
            places: (0..car.gearbox.elements.len()).filter_map(placed).collect(),
        }
    }
}

/// The estimate for one step of an :class:`Observer`.
#[pyclass(module = "wetclutch", frozen)]
pub(crate) struct StepEstimate {
    estimate: ShiftEstimate<f64>,
    names: Arc<Names>,
}

#[pymethods]
impl StepEstimate {
    /// The gear that the filter is in, before a shift; None while it has only the valve models.
    #[getter]
    fn gear(&self) -> Option<&str> {
        self.gear_named(self.estimate.gear?.from)
    }

    /// The gear after the shift; that of `gear` while there is no shift.
    #[getter]
    fn target_gear(&self) -> Option<&str> {
        self.gear_named(self.estimate.gear?.to)
    }

    /// Which clutches hold, in words; None where that is not known.
    #[getter]
    fn phase(&self) -> Option<&'static str> {
        self.estimate.phase.map(|phase| phase.name())
    }

    /// Whether the readings could be used, and whether the estimate can be believed: `"good"` if so.
    #[getter]
    fn health(&self) -> &'static str {
        self.estimate.health.name()
    }

    /// The clutch that opens in the shift; None in a gear.
    #[getter]
    fn offgoing(&self) -> Option<ClutchStep> {
        self.clutch(0)
    }

    /// The clutch that closes in the shift; None in a gear.
    #[getter]
    fn oncoming(&self) -> Option<ClutchStep> {
        self.clutch(1)
    }

    /// Torque at the gearbox input, N m.
    #[getter]
    fn turbine_torque_n_m(&self) -> Option<f64> {
        self.estimate.turbine_n_m
    }

    /// Torque of the drive shafts, N m.
    #[getter]
    fn shaft_torque_n_m(&self) -> Option<f64> {
        self.estimate.shaft_n_m
    }

    /// Slip of the offgoing clutch away from the new gear, at the turbine, rad/s: a flare.
    #[getter]
    fn flare_rad_s(&self) -> f64 {
        self.estimate.flare_rad_s
    }

    /// Pressures of all elements by the models of their valves and pistons, Pa.
    #[getter]
    fn valve_model_pressures_pa(&self) -> HashMap<&str, f64> {
        let pressure = |place: usize| self.estimate.valve_pa.get(place).copied().unwrap_or(f64::NAN);
        self.names.places.iter().map(|(place, name)| (name.as_str(), pressure(*place))).collect()
    }

    fn __eq__(&self, other: &Self) -> bool {
        // Bit by bit, so that an estimate equals itself where a number is missing.
        format!("{:?}", self.estimate) == format!("{:?}", other.estimate)
    }

    /// Pickled to the last bit, with the names of gears and elements.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Pickled<'py>> {
        pickled(py, "restored_step", &(VERSION, (&self.estimate, &*self.names)))
    }

    fn __repr__(&self) -> String {
        let gear = match (self.gear(), self.target_gear()) {
            (Some(from), Some(to)) if from != to => format!("{from}-{to}"),
            (Some(gear), _) => gear.to_owned(),
            _ => "no gear".to_owned(),
        };
        let phase = self.phase().map(|phase| format!(", {phase}")).unwrap_or_default();
        format!("StepEstimate({gear}{phase}, {})", self.health())
    }
}

impl StepEstimate {
    pub(crate) fn new(estimate: ShiftEstimate<f64>, names: &Arc<Names>) -> Self {
        Self { estimate, names: Arc::clone(names) }
    }

    fn gear_named(&self, gear: Gear) -> Option<&str> {
        Some(gear.place().and_then(|place| self.names.gears.get(place)).map_or(NEUTRAL, String::as_str))
    }

    fn clutch(&self, which: usize) -> Option<ClutchStep> {
        let clutch = *self.estimate.clutches?.get(which)?;
        let named = self.names.places.iter().find(|(place, _)| clutch.element.place() == Some(*place));
        Some(ClutchStep { clutch, element: named.map(|(_, name)| name.clone()) })
    }
}

/// The estimate of one clutch of a shift.
#[pyclass(module = "wetclutch", frozen)]
pub(crate) struct ClutchStep {
    clutch: ClutchEstimate<f64>,
    element: Option<String>,
}

#[pymethods]
impl ClutchStep {
    /// Its name; None of a one-way clutch, which has a torque alone.
    #[getter]
    fn element(&self) -> Option<&str> {
        self.element.as_deref()
    }

    /// Cylinder pressure, Pa.
    #[getter]
    fn pressure_pa(&self) -> f64 {
        self.clutch.pressure_pa
    }

    /// Lowest and highest pressure, Pa, for errors within the budget.
    #[getter]
    fn pressure_range_pa(&self) -> Option<(f64, f64)> {
        self.clutch.pressure_range_pa.map(|[low, high]| (low, high))
    }

    /// Torque, N m, positive when it drives its output side.
    #[getter]
    fn torque_n_m(&self) -> f64 {
        self.clutch.torque_n_m
    }

    /// Lowest and highest torque, N m, for errors within the budget.
    #[getter]
    fn torque_range_n_m(&self) -> Option<(f64, f64)> {
        self.clutch.torque_range_n_m.map(|[low, high]| (low, high))
    }

    /// Standard deviation of the pressure, Pa.
    #[getter]
    fn pressure_deviation_pa(&self) -> f64 {
        self.clutch.pressure_std_dev_pa
    }

    /// Standard deviation of the torque, N m.
    #[getter]
    fn torque_deviation_n_m(&self) -> f64 {
        self.clutch.std_dev_n_m
    }

    /// Pressure by the models of valve and piston alone, Pa.
    #[getter]
    fn valve_model_pressure_pa(&self) -> f64 {
        self.clutch.valve_pa
    }

    /// Torque by these models and friction alone, N m.
    #[getter]
    fn valve_model_torque_n_m(&self) -> f64 {
        self.clutch.open_loop_n_m
    }

    /// Whether it holds.
    #[getter]
    fn holds(&self) -> bool {
        self.clutch.holds
    }

    /// Whether the torque is unobservable: the estimate is that of the valve model.
    #[getter]
    fn hidden(&self) -> bool {
        self.clutch.hidden
    }

    fn __eq__(&self, other: &Self) -> bool {
        // As of a step.
        (format!("{:?}", self.clutch), &self.element) == (format!("{:?}", other.clutch), &other.element)
    }

    /// Pickled to the last bit.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Pickled<'py>> {
        pickled(py, "restored_clutch", &(VERSION, (&self.clutch, &self.element)))
    }

    fn __repr__(&self) -> String {
        let element = self.element.as_deref().unwrap_or("one-way clutch");
        format!("ClutchStep({element}, {:.0} Pa, {:.1} N m)", self.clutch.pressure_pa, self.clutch.torque_n_m)
    }
}

/// What makes a value of its bytes, and the bytes.
type Pickled<'py> = (Bound<'py, PyAny>, (Bound<'py, PyBytes>,));

fn pickled<'py>(py: Python<'py>, made_by: &str, value: &impl Serialize) -> PyResult<Pickled<'py>> {
    let bytes = postcard::to_allocvec(value).map_err(|error| defect(&error.to_string()))?;
    Ok((py.import("wetclutch._wetclutch")?.getattr(made_by)?, (PyBytes::new(py, &bytes),)))
}

/// A value of [`pickled`] bytes of this version.
fn restored<'b, T: Deserialize<'b>>(py: Python<'_>, bytes: &'b [u8]) -> PyResult<T> {
    let read = || match postcard::take_from_bytes::<&str>(bytes) {
        Ok((VERSION, value)) => postcard::from_bytes(value).map_err(|_| "is damaged".to_owned()),
        Ok((version, _)) if version.starts_with(|c: char| c.is_ascii_digit()) => {
            Err(format!("is of version {version}, and this is {VERSION}"))
        }
        _ => Err("is damaged".to_owned()),
    };
    read().map_err(|why| exception(py, &Error::Input(format!("this pickled estimate {why}"))))
}

/// The estimate of a pickle.
#[pyfunction]
pub(crate) fn restored_step(py: Python<'_>, bytes: &[u8]) -> PyResult<StepEstimate> {
    let (estimate, names) = restored(py, bytes)?;
    Ok(StepEstimate { estimate, names: Arc::new(names) })
}

/// The estimate of a clutch of a pickle.
#[pyfunction]
pub(crate) fn restored_clutch(py: Python<'_>, bytes: &[u8]) -> PyResult<ClutchStep> {
    let (clutch, element) = restored(py, bytes)?;
    Ok(ClutchStep { clutch, element })
}
