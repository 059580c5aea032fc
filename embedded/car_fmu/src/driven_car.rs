//! The model: a car with its shift controller, on which driver and road act.

use car::{Gear, ShiftCommand};
use std::collections::HashMap;
use std::ffi::CStr;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Mutex;

use config::{CarFile, DriveFile, Source};
use plant::car::{CarCalibration, CarModel, CarRun, CarSample, CarTorques, Driver, Shifting};

use crate::instance::{Done, Simulated};

/// References: inputs, outputs of the car, whole outputs, and outputs of the elements, four of each.
const INPUTS: u32 = 1;
const OUTPUTS: u32 = 100;
const WHOLE: u32 = 200;
const ELEMENTS: u32 = 1000;
const OF_ELEMENT: usize = 4;
/// Times closer than this are the same instant, s.
const SAME_INSTANT_S: f64 = 1e-9;

const NO_FILE: &CStr = c"vehicle.toml, gearbox.toml or drive.toml in the resources cannot be read, or is not valid: export the model again";
const OTHER_TOKEN: &CStr =
    c"resources/vehicle.toml is not that of the model description: its guid or instantiationToken names another one";
const NO_START: &CStr = c"the car cannot start in its first gear with this accelerator, brake and grade";
const FAILED: &CStr = c"the simulation of the car failed: reset it";
const NOT_WRITTEN: &CStr = c"the state of a car is kept in memory only: it cannot be serialised";

/// What is the same in all instances of a car.
struct Parts {
    model: CarModel,
    drive: car::Drive,
}

impl Parts {
    /// Those of the files in a folder. They are kept until the program ends, once for each car.
    fn of(folder: &Path, token: &[u8]) -> Done<&'static Self> {
        static KEPT: Mutex<Option<HashMap<[String; 3], &'static Parts>>> = Mutex::new(None);
        let read = |name: &str| std::fs::read_to_string(folder.join(name)).map_err(|_| NO_FILE);
        let texts = [read("vehicle.toml")?, read("gearbox.toml")?, read("drive.toml")?];
        let [vehicle, gearbox, drive] = &texts;
        let vehicle = Source::built_in("vehicle.toml", vehicle);
        let is_named = token.iter().filter(|c| c.is_ascii_hexdigit()).eq(vehicle.sha256().as_bytes().iter().take(32));
        if !is_named {
            return Err(OTHER_TOKEN);
        }
        let mut kept = KEPT.lock().map_err(|_| FAILED)?;
        let kept = kept.get_or_insert_default();
        if let Some(parts) = kept.get(&texts) {
            return Ok(parts);
        }
        let file = CarFile::from_sources(vehicle, Source::built_in("gearbox.toml", gearbox)).map_err(|_| NO_FILE)?;
        let drive = DriveFile::from_source(Source::built_in("drive.toml", drive)).map_err(|_| NO_FILE)?.drive;
        let model = CarModel::new(file.car).map_err(|_| NO_FILE)?;
        let parts: &'static Self = Box::leak(Box::new(Self { model, drive }));
        kept.insert(texts, parts);
        Ok(parts)
    }
}

/// A car on its way, and what it shows.
#[derive(Clone)]
pub(crate) struct Running {
    run: CarRun<'static>,
    shifting: Shifting<'static>,
    /// Gear and commands.
    sample: CarSample,
    torques: CarTorques,
}

impl Running {
    /// At rest in the first gear.
    fn start(parts: &'static Parts, driver: Driver) -> Option<Self> {
        let Parts { model, drive } = parts;
        let shifting = Shifting::new(&model.car, drive).ok()?;
        let state = model.in_gear(shifting.gear(), None, 0.0, driver.throttle).ok()?;
        let start = (driver, CarCalibration::of(drive.controller).control_period_s);
        let calibration = CarCalibration::of(drive.controller);
        let run = CarRun::new(model, &model.car, calibration, shifting.gear(), state, start).ok()?;
        let mut first = None;
        // What is shown at the beginning of the first period.
        let mut ahead = run.clone();
        ahead.advance(driver, |_| {}, |sample| first = first.or(Some(*sample))).ok()?;
        let sample = first?;
        Some(Self { run, shifting, torques: sample.torques, sample })
    }

    /// Goes on by the control periods that end by this time, s.
    fn advance(&mut self, parts: &'static Parts, driver: Driver, until_s: f64) -> Option<()> {
        while self.run.time_s() + self.run.period_s() < until_s + SAME_INSTANT_S {
            self.shifting.step(&mut self.run, &driver).ok()?;
            let (torques, sample) = (&mut self.torques, &mut self.sample);
            let at_end = |step: &plant::car::CarStep<'_>| {
                *torques = parts.model.torques(step.contacts, &step.at(step.end_s), step.inputs);
            };
            self.run.advance(driver, at_end, |now| *sample = *now).ok()?;
        }
        Some(())
    }
}

/// What changes in a simulation.
#[derive(Clone)]
pub(crate) struct State {
    driver: Driver,
    /// Time since the start, s.
    time_s: f64,
    running: Option<Running>,
}

const AT_REST: State =
    State { driver: Driver { throttle: 0.0, brake: 0.0, grade_rad: 0.0 }, time_s: 0.0, running: None };

/// A car with its shift controller.
pub(crate) struct DrivenCar {
    parts: &'static Parts,
    state: State,
}

/// What `act` gives; a panic in it is a failure.
fn guarded<T>(act: impl FnOnce() -> Option<T>) -> Option<T> {
    catch_unwind(AssertUnwindSafe(act)).ok().flatten()
}

impl DrivenCar {
    /// Outputs of the car, by their references from [`OUTPUTS`] on.
    fn outputs(&self, running: &Running) -> [f64; 8] {
        let model = &self.parts.model;
        let (state, torques) = (running.run.state(), &running.torques);
        let [engine_rad_s, turbine_rad_s, output_rad_s] = model.speeds(state);
        let turbine_n_m = torques.turbine_n_m(model);
        let speeds = [engine_rad_s, turbine_rad_s, output_rad_s, state.wheel_rad_s, state.vehicle_m_s];
        let [s0, s1, s2, s3, s4] = speeds;
        [s0, s1, s2, s3, s4, torques.engine_n_m, turbine_n_m, torques.shaft_n_m]
    }

    /// An output of an element: command, pressure, torque, slip.
    fn of_element(&self, running: &Running, at: usize) -> Option<f64> {
        let (element, part) = (at / OF_ELEMENT, at % OF_ELEMENT);
        let model = &self.parts.model;
        let state = running.run.state();
        (element < model.car.gearbox.elements.len()).then_some(())?;
        [
            running.sample.commands.get(element).copied()?,
            model.pressure_pa(state, element),
            running.torques.elements_n_m.get(element).copied()?,
            model.slip(state, element),
        ]
        .get(part)
        .copied()
    }

    fn input(&mut self, reference: u32) -> Option<&mut f64> {
        let Driver { throttle, brake, grade_rad } = &mut self.state.driver;
        [throttle, brake, grade_rad].into_iter().nth(reference.checked_sub(INPUTS)? as usize)
    }
}

impl Simulated for DrivenCar {
    type State = State;

    fn new(resources: &[u8], token: &[u8]) -> Done<Self> {
        let folder = std::str::from_utf8(resources).map_err(|_| NO_FILE)?;
        let parts = catch_unwind(|| Parts::of(Path::new(folder), token)).map_err(|_| NO_FILE)??;
        Ok(Self { parts, state: AT_REST })
    }

    fn reset(&mut self) -> Done {
        self.state = AT_REST;
        Ok(())
    }

    fn start(&mut self) -> Done {
        let (parts, driver) = (self.parts, self.state.driver);
        self.state.running = Some(guarded(|| Running::start(parts, driver)).ok_or(NO_START)?);
        Ok(())
    }

    fn step(&mut self, length_s: f64) -> Done {
        let (parts, driver) = (self.parts, self.state.driver);
        let until_s = self.state.time_s + length_s;
        let mut running = self.state.running.take().ok_or(FAILED)?;
        let done = guarded(|| running.advance(parts, driver, until_s).map(|()| running));
        self.state.running = Some(done.ok_or(FAILED)?);
        self.state.time_s = until_s;
        Ok(())
    }

    fn real(&self, reference: u32) -> Option<f64> {
        let Driver { throttle, brake, grade_rad } = self.state.driver;
        if let Some(input) =
            reference.checked_sub(INPUTS).and_then(|at| [throttle, brake, grade_rad].get(at as usize).copied())
        {
            return Some(input);
        }
        let is_there = (OUTPUTS..OUTPUTS + 8).contains(&reference)
            || (reference.checked_sub(ELEMENTS)? as usize) < OF_ELEMENT * self.parts.model.car.gearbox.elements.len();
        // Before the start everything is at rest.
        let Some(running) = self.state.running.as_ref() else { return is_there.then_some(0.0) };
        match reference.checked_sub(ELEMENTS) {
            Some(at) => self.of_element(running, at as usize),
            None => self.outputs(running).get(reference.checked_sub(OUTPUTS)? as usize).copied(),
        }
    }

    /// Accelerator and brake from 0 to 1, the grade within 45 degrees.
    fn set_real(&mut self, reference: u32, value: f64) -> Option<()> {
        let most = if reference == INPUTS + 2 { std::f64::consts::FRAC_PI_4 } else { 1.0 };
        let least = if reference == INPUTS + 2 { -most } else { 0.0 };
        (least..=most).contains(&value).then_some(())?;
        *self.input(reference)? = value;
        Some(())
    }

    fn whole(&self, reference: u32) -> Option<i32> {
        let place = |gear: Gear| gear.place().map_or(-1, |place| place as i32);
        let sample = self.state.running.as_ref().map(|running| &running.sample);
        let ShiftCommand { from, to } = sample.map_or(ShiftCommand::NEUTRAL, CarSample::gears);
        let is_shifting = sample.is_some_and(|sample| sample.shift.is_some());
        [place(from), place(to), i32::from(is_shifting)].get(reference.checked_sub(WHOLE)? as usize).copied()
    }

    fn set_whole(&mut self, _: u32, _: i32) -> Option<()> {
        None
    }

    fn state(&self) -> Done<State> {
        Ok(self.state.clone())
    }

    fn restore(&mut self, state: &State) {
        self.state = state.clone();
    }

    fn serialised(&self, _: &State) -> Done<Vec<u8>> {
        Err(NOT_WRITTEN)
    }

    fn deserialised(&self, _: &[u8]) -> Done<State> {
        Err(NOT_WRITTEN)
    }
}
