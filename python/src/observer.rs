//! The gearbox filter step by step.

use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyTuple};
use wetclutch::{ElementId, Error, Estimator, Gear, GearId, Reading, ShiftCommand, ShiftId, Source, Step, VehicleFile};

use crate::car::parsed;
use crate::error::exception;
use crate::file::GivenFile;
use crate::step::{NEUTRAL, Names, StepEstimate};

/// A reading: its value, or a pair of value and age, s.
struct Given(Reading);

impl<'a, 'py> FromPyObject<'a, 'py> for Given {
    type Error = PyErr;

    fn extract(given: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
        // To try one and then the other takes longer than the step of the filter: the error of the first is an exception.
        let reading = match given.cast::<PyTuple>() {
            Ok(pair) => {
                let (value, age_s) = pair.extract::<(f64, f64)>()?;
                Reading { value, age_s }
            }
            Err(_) => Reading::now(given.extract::<f64>()?),
        };
        Ok(Self(reading))
    }
}

impl From<Given> for Reading {
    fn from(given: Given) -> Self {
        given.0
    }
}

/// What an observer was made with, beside its car.
struct MadeWith {
    shift: Option<String>,
    /// File with the table of sensors, and its text.
    sensors: Option<Source>,
}

/// The same as Python has it in a pickle: name, text and gearbox of the car, shift, name and text of the file with the sensors.
type Texts = (String, String, Option<String>, Option<String>, Option<(String, String)>);

/// What makes an observer, its texts, and its memory.
type Pickled<'py> = (Bound<'py, PyAny>, (Texts, Bound<'py, PyBytes>));

/// The gearbox filter of a car step by step, for a loop, a test bench or a controller in hardware.
///
/// Args:
///     car: A car with a gearbox.
///     shift: Shift that is commanded in the steps without `gear`, such as "1-2".
///     sensors: `Sensors`, or a file whose table `sensors` describes them.
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
    made_with: Arc<MadeWith>,
    elements: Arc<[(String, ElementId)]>,
    names: Arc<Names>,
}

#[pymethods]
impl Observer {
    #[new]
    #[pyo3(signature = (car, *, shift=None, sensors=None, learnt=None))]
    fn new(
        car: &Bound<'_, PyAny>,
        shift: Option<&str>,
        sensors: Option<GivenFile>,
        learnt: Option<&str>,
    ) -> PyResult<Self> {
        let py = car.py();
        py.import("wetclutch._car")?.call_method1("check_car", (car,))?;
        let (name, text, gearbox): (String, String, Option<String>) = car.getattr("_native")?.extract()?;
        let vehicle = parsed(py, &name, &text, gearbox.as_deref())?;
        let sensors = sensors.map(GivenFile::source).transpose().map_err(|error| exception(py, &error))?;
        let made_with = MadeWith { shift: shift.map(str::to_owned), sensors };
        Self::made(vehicle, made_with, learnt).map_err(|error| exception(py, &error))
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
    ///     acceleration_m_s2: Longitudinal acceleration by an accelerometer, positive forward, m/s^2: with the part of gravity along the road.
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
        engine_torque_n_m=None, acceleration_m_s2=None, commands=None, gear=None, target_gear=None,
        lock_up_applied=false, oil_temperature_degc=None
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
        acceleration_m_s2: Option<Given>,
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
        step.acceleration_m_s2 = acceleration_m_s2.map(Reading::from);
        step.lock_up_applied = lock_up_applied;
        step.shift = self.shift(gear, target_gear).map_err(|error| exception(py, &error))?;
        for (name, command) in commands.into_iter().flatten() {
            let element = self.element(name.extract()?).map_err(|error| exception(py, &error))?;
            step.commands[element] = command.extract::<Option<Given>>()?.map(Reading::from);
        }
        if let Some(degc) = oil_temperature_degc {
            self.estimator.take_oil_temperature(degc);
        }
        Ok(StepEstimate::new(self.estimator.step(&step), &self.names))
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

    /// Pickled as the text of its car, what it was made with, and its memory: it goes on to the last bit.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Pickled<'py>> {
        let made = py.import("wetclutch._wetclutch")?.getattr("restored_observer")?;
        Ok((made, (self.texts(), PyBytes::new(py, &self.memory(py)?))))
    }

    /// Whether both have the same car and sensors and will give the same estimates.
    fn __eq__(&self, py: Python<'_>, other: &Self) -> PyResult<bool> {
        Ok(self.texts() == other.texts() && self.memory(py)? == other.memory(py)?)
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
    fn made(vehicle: VehicleFile, made_with: MadeWith, learnt: Option<&str>) -> Result<Self, Error> {
        let Some(car) = vehicle.car() else {
            let message = "car: an observer step by step needs a car with a gearbox, and this is one of a single shift";
            return Err(Error::Input(message.to_owned()));
        };
        let sensors = made_with.sensors.as_ref().map(wetclutch::sensors_of).transpose()?;
        let learnt = learnt.map(|text| vehicle.learnt_of(text)).transpose()?;
        let estimator = Estimator::new(car, sensors.as_ref(), learnt.as_ref())?;
        let named = |name: &String| Some((name.clone(), estimator.element(name)?));
        let elements = car.gearbox.elements.iter().filter_map(|element| named(&element.name)).collect();
        let names = Names::of(car, &estimator);
        let shift = made_with.shift.as_deref().map(|name| car.shift_named(name)).transpose()?;
        let shift = shift.and_then(|[from, to]| Some(ShiftId { from: GearId::new(from)?, to: GearId::new(to)? }));
        Ok(Self {
            estimator,
            shift: shift.map(ShiftCommand::from),
            vehicle: Arc::new(vehicle),
            made_with: Arc::new(made_with),
            elements,
            names: Arc::new(names),
        })
    }

    fn texts(&self) -> Texts {
        let MadeWith { shift, sensors } = &*self.made_with;
        let sensors = sensors.as_ref().map(|file| (file.path.to_string_lossy().into_owned(), file.text.clone()));
        let vehicle = &self.vehicle;
        let gearbox = vehicle.gearbox_text().map(str::to_owned);
        (vehicle.name().to_owned(), vehicle.text().to_owned(), gearbox, shift.clone(), sensors)
    }

    fn memory(&self, py: Python<'_>) -> PyResult<Vec<u8>> {
        self.estimator.memory().map_err(|error| exception(py, &error.into()))
    }

    fn element(&self, name: &str) -> Result<ElementId, Error> {
        // There are few of them.
        let found = self.elements.iter().find(|(element, _)| element == name);
        found.map(|(_, element)| *element).ok_or_else(|| {
            let known: Vec<&str> = self.elements.iter().map(|(element, _)| element.as_str()).collect();
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

/// The observer of a pickle.
#[pyfunction]
pub(crate) fn restored_observer(py: Python<'_>, texts: Texts, memory: &[u8]) -> PyResult<Observer> {
    let made = || -> Result<_, Error> {
        // First, since another version may have other keys.
        Estimator::check_version(memory)?;
        let (name, text, gearbox, shift, sensors) = texts;
        let vehicle = VehicleFile::from_texts(&name, &text, gearbox.as_deref())?;
        let sensors = sensors.map(|(name, text)| Source::built_in(&name, &text));
        let mut observer = Observer::made(vehicle, MadeWith { shift, sensors }, None)?;
        observer.estimator.go_on_from(memory)?;
        Ok(observer)
    };
    made().map_err(|error| exception(py, &error))
}

fn unknown(what: &str, name: &str, known: &[&str]) -> Error {
    Error::Input(format!("{what}: there is no `{}`\nhint: expected one of {}", name.escape_debug(), known.join(", ")))
}
