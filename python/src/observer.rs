//! The gearbox filter step by step.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use wetclutch::{
    ClutchEstimate, ElementId, Error, Estimator, Gear, GearId, Reading, ShiftCommand, ShiftElement, ShiftEstimate,
    ShiftId, Step, VehicleFile,
};

use crate::car::parsed;
use crate::error::exception;

/// A reading: its value, or value and age, s.
#[derive(FromPyObject)]
enum Given {
    Now(f64),
    Aged(f64, f64),
}

impl From<Given> for Reading {
    fn from(given: Given) -> Self {
        match given {
            Given::Now(value) => Self::now(value),
            Given::Aged(value, age_s) => Self { value, age_s },
        }
    }
}

/// Names of a gearbox by place.
struct Names {
    gears: Vec<String>,
    elements: HashMap<String, ElementId>,
    /// Of the places in the filter's tables.
    places: Vec<(usize, String)>,
}

/// The gearbox filter of a car step by step, for a loop, a test bench or a controller in hardware.
///
/// Args:
///     car: A car with a gearbox.
///     shift: Shift that is commanded in the steps without `gear`, such as "1-2".
///     sensors: File whose table `sensors` describes the sensors.
///     learnt: What was learnt of the car before: `Estimates.learnt`, or `learnt` of another observer.
///
/// Raises:
///     InputError: The car is one of a single shift or has more clutches than the filter, or there is no such shift.
#[pyclass(module = "wetclutch")]
#[derive(Clone)]
pub(crate) struct Observer {
    estimator: Estimator,
    /// Commanded where a step has no gear.
    shift: Option<ShiftCommand>,
    vehicle: Arc<VehicleFile>,
    names: Arc<Names>,
}

#[pymethods]
impl Observer {
    #[new]
    #[pyo3(signature = (car, *, shift=None, sensors=None, learnt=None))]
    fn new(
        car: &Bound<'_, PyAny>,
        shift: Option<&str>,
        sensors: Option<PathBuf>,
        learnt: Option<&str>,
    ) -> PyResult<Self> {
        let py = car.py();
        let (name, text, gearbox): (String, String, Option<String>) = car.getattr("_native")?.extract()?;
        let vehicle = parsed(py, &name, &text, gearbox.as_deref())?;
        let made = || -> Result<_, Error> {
            let Some(car) = vehicle.car() else {
                let message =
                    "car: an observer step by step needs a car with a gearbox, and this is one of a single shift";
                return Err(Error::Input(message.to_owned()));
            };
            let sensors = sensors.as_deref().map(wetclutch::read_sensors).transpose()?;
            let learnt = learnt.map(|text| vehicle.learnt_of(text)).transpose()?;
            let estimator = Estimator::new(car, sensors.as_ref(), learnt.as_ref())?;
            let named = |name: &String| Some((name.clone(), estimator.element(name)?));
            let elements = car.gearbox.elements.iter().filter_map(|element| named(&element.name)).collect();
            let places = (0..car.gearbox.elements.len())
                .filter_map(|place| Some((place, estimator.name_of(ShiftElement::at(place))?.to_owned())))
                .collect();
            let gears = car.gearbox.gears.iter().map(|gear| gear.name.clone()).collect();
            let shift = shift.map(|name| car.shift_named(name)).transpose()?;
            let shift = shift.and_then(|[from, to]| Some(ShiftId { from: GearId::new(from)?, to: GearId::new(to)? }));
            Ok((estimator, shift.map(ShiftCommand::from), Names { gears, elements, places }))
        };
        let (estimator, shift, names) = made().map_err(|error| exception(py, &error))?;
        Ok(Self { estimator, shift, vehicle: Arc::new(vehicle), names: Arc::new(names) })
    }

    /// Takes what came since the step before and returns the estimate. What did not come is left out, or None.
    ///
    /// A reading is a number, or a pair of a number and its age in s. One that cannot be right is refused, and `health` of the estimate says so.
    ///
    /// Args:
    ///     dt_s: Time since the step before, s. Ignored in the first step.
    ///     engine_speed_rad_s: Engine speed, rad/s.
    ///     turbine_speed_rad_s: Turbine speed, rad/s: of the gearbox input where there is no converter.
    ///     output_speed_rad_s: Speed of the gearbox output, rad/s.
    ///     wheel_speed_rad_s: Speed of the driven wheels, rad/s.
    ///     engine_torque_n_m: Engine torque as its controller reports it, N m.
    ///     commands: Commands of the valves by the names of their elements: current, A, or duty cycle, %.
    ///     gear: The gear, or the gear before the shift; "N" in neutral.
    ///     target_gear: The gear after the shift, if there is one.
    ///     lock_up_applied: Whether the lock-up clutch of the converter carries torque.
    ///     oil_temperature_degc: Temperature of the oil in the gearbox, degC.
    ///
    /// Raises:
    ///     InputError: There is no such element or gear.
    #[pyo3(signature = (
        *, dt_s, engine_speed_rad_s=None, turbine_speed_rad_s=None, output_speed_rad_s=None, wheel_speed_rad_s=None,
        engine_torque_n_m=None, commands=None, gear=None, target_gear=None, lock_up_applied=false,
        oil_temperature_degc=None
    ))]
    #[expect(clippy::too_many_arguments, reason = "each is a keyword of the method in Python")]
    fn step(
        &mut self,
        py: Python<'_>,
        dt_s: f64,
        engine_speed_rad_s: Option<Given>,
        turbine_speed_rad_s: Option<Given>,
        output_speed_rad_s: Option<Given>,
        wheel_speed_rad_s: Option<Given>,
        engine_torque_n_m: Option<Given>,
        commands: Option<&Bound<'_, PyDict>>,
        gear: Option<&str>,
        target_gear: Option<&str>,
        lock_up_applied: bool,
        oil_temperature_degc: Option<f64>,
    ) -> PyResult<StepEstimate> {
        let mut step = Step::none(dt_s);
        step.speeds.engine = engine_speed_rad_s.map(Reading::from);
        step.speeds.turbine = turbine_speed_rad_s.map(Reading::from);
        step.speeds.output = output_speed_rad_s.map(Reading::from);
        step.speeds.wheel = wheel_speed_rad_s.map(Reading::from);
        step.engine_torque_n_m = engine_torque_n_m.map(Reading::from);
        step.lock_up_applied = lock_up_applied;
        step.shift = self.shift(gear, target_gear).map_err(|error| exception(py, &error))?;
        for (name, command) in commands.into_iter().flatten() {
            let element = self.element(name.extract()?).map_err(|error| exception(py, &error))?;
            step.commands[element] = command.extract::<Option<Given>>()?.map(Reading::from);
        }
        if let Some(degc) = oil_temperature_degc {
            self.estimator.take_oil_temperature(degc);
        }
        Ok(StepEstimate { estimate: self.estimator.step(&step), names: Arc::clone(&self.names) })
    }

    /// Guaranteed range of the pressure of an element after the last step, Pa; None where there is none.
    fn pressure_range_pa(&self, py: Python<'_>, element: &str) -> PyResult<Option<(f64, f64)>> {
        let element = self.element(element).map_err(|error| exception(py, &error))?;
        Ok(self.estimator.pressure_range_pa(element).map(|[low, high]| (low, high)))
    }

    /// What was learnt of the car so far, as text.
    #[getter]
    fn learnt(&self, py: Python<'_>) -> PyResult<String> {
        self.vehicle.text_of_learnt(self.estimator.learnt()).map_err(|error| exception(py, &error))
    }

    fn __copy__(&self) -> Self {
        self.clone()
    }

    fn __deepcopy__(&self, _memo: &Bound<'_, PyAny>) -> Self {
        self.clone()
    }

    fn __repr__(&self) -> String {
        format!("Observer({})", self.vehicle.name())
    }
}

impl Observer {
    fn element(&self, name: &str) -> Result<ElementId, Error> {
        self.names.elements.get(name).copied().ok_or_else(|| {
            let mut known: Vec<&str> = self.names.elements.keys().map(String::as_str).collect();
            known.sort_unstable();
            unknown("element", name, &known)
        })
    }

    /// The commanded gear or shift; where no gear is given, that of the observer.
    fn shift(&self, gear: Option<&str>, target: Option<&str>) -> Result<Option<ShiftCommand>, Error> {
        let Some(gear) = gear.or(target) else { return Ok(self.shift) };
        let [from, to] = [gear, target.unwrap_or(gear)].map(|name| self.gear(name));
        Ok(Some(ShiftCommand { from: from?, to: to? }))
    }

    fn gear(&self, name: &str) -> Result<Gear, Error> {
        if name.is_empty() || name == NEUTRAL {
            return Ok(Gear::Neutral);
        }
        let known = || self.names.gears.iter().map(String::as_str).chain([NEUTRAL]).collect::<Vec<_>>();
        self.estimator.gear(name).map(Gear::In).ok_or_else(|| unknown("gear", name, &known()))
    }
}

/// The gear in which no gear is engaged.
const NEUTRAL: &str = "N";

fn unknown(what: &str, name: &str, known: &[&str]) -> Error {
    Error::Input(format!("{what}: there is no `{}`\nhint: expected one of {}", name.escape_debug(), known.join(", ")))
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

    fn __repr__(&self) -> String {
        let element = self.element.as_deref().unwrap_or("one-way clutch");
        format!("ClutchStep({element}, {:.0} Pa, {:.1} N m)", self.clutch.pressure_pa, self.clutch.torque_n_m)
    }
}
