//! Car, valves and shift controller together, one control period after another.

use car::Car;

use super::controller::{CarCalibration, CarCommands, CarMeasured, CarShiftController};
use super::faults::Faults;
use super::integrate::{CarError, CarIntegrator, CarStep};
use super::model::{CarInputs, CarModel, CarState};
use super::sample::CarSample;
use super::start::idle_throttle;
use super::valves::CarValves;

/// Times closer than this are the same instant, s: sums of periods differ in their last bits.
const SAME_INSTANT_S: f64 = 1e-9;
/// Largest torque of the brakes over what the tyres can pass to the road.
pub(super) const BRAKE_OVER_TYRES: f64 = 1.0;

/// What the driver and the road do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Driver {
    /// Throttle, 0 to 1.
    pub throttle: f64,
    /// Brake, 0 to 1.
    pub brake: f64,
    /// Grade, rad, positive uphill.
    pub grade_rad: f64,
}

/// A car on its way.
#[derive(Debug, Clone)]
pub struct CarRun<'m> {
    model: &'m CarModel,
    controller: CarShiftController,
    valves: CarValves,
    faults: Faults,
    plant: CarIntegrator,
    commands: CarCommands,
    period_s: f64,
    periods: u64,
    sample_time_s: f64,
    samples: u64,
}

impl<'m> CarRun<'m> {
    /// Starts at time zero from this state, in the gear of the controller. `nominal` is the car of the controller's model.
    ///
    /// # Errors
    /// There is no such gear, or the state is not finite.
    pub fn new(
        model: &'m CarModel,
        nominal: &Car,
        calibration: CarCalibration,
        gear: usize,
        state: CarState,
        (driver, sample_time_s): (Driver, f64),
    ) -> Result<Self, CarError> {
        if sample_time_s.is_nan() || sample_time_s < 1e-4 {
            return Err(CarError::Request(format!(
                "the sample time is {sample_time_s} s, expected 1e-4 s or more\nhint: 0.01 is usual"
            )));
        }
        if !is_same_box(&model.car, nominal) {
            let message = "the controller's car has another gearbox than the simulated one".to_owned();
            return Err(CarError::Request(message));
        }
        let mut controller = CarShiftController::new(nominal, calibration, gear)?;
        let commands = controller.step(0.0, driver.throttle, &measure(model, &state, driver));
        let mut valves = CarValves::new(model, &commands.elements);
        let faults = Faults::default();
        let inputs = inputs(model, (&mut valves, &faults), &commands, driver, 0.0);
        let plant = CarIntegrator::new(model, 0.0, state, &inputs)?;
        let period_s = calibration.control_period_s;
        Ok(Self { model, controller, valves, faults, plant, commands, period_s, periods: 0, sample_time_s, samples: 0 })
    }

    /// The same with another relative tolerance of the integration.
    #[must_use]
    pub fn with_tolerance(mut self, relative: f64) -> Self {
        self.plant = self.plant.with_tolerance(relative);
        self
    }

    /// The same with these faults.
    #[must_use]
    pub(super) fn with_faults(self, faults: Faults) -> Self {
        Self { faults, ..self }
    }

    /// Goes on as this car, whose plates or valves have changed.
    pub(super) fn go_on_as(&mut self, model: &'m CarModel) {
        self.model = model;
    }

    /// Time reached, s.
    pub fn time_s(&self) -> f64 {
        self.periods as f64 * self.period_s
    }

    /// Control period, s.
    pub fn period_s(&self) -> f64 {
        self.period_s
    }

    /// The simulated car.
    pub fn model(&self) -> &'m CarModel {
        self.model
    }

    /// The shift controller.
    pub fn controller(&self) -> &CarShiftController {
        &self.controller
    }

    /// The state.
    pub fn state(&self) -> &CarState {
        self.plant.state()
    }

    /// Asks for a gear; see [`CarShiftController::request`].
    ///
    /// # Errors
    /// The gear cannot be reached.
    pub fn request(&mut self, to: usize) -> Result<(), CarError> {
        self.controller.request(to, self.time_s())
    }

    /// Asks for neutral.
    ///
    /// # Errors
    /// A shift is under way, or the gear is neither the lowest nor reverse.
    pub fn request_neutral(&mut self) -> Result<(), CarError> {
        self.controller.request_neutral(self.time_s())
    }

    /// Starts in neutral: its clutch is open already.
    ///
    /// # Errors
    /// The gear is neither the lowest nor reverse.
    pub fn start_in_neutral(&mut self) -> Result<(), CarError> {
        self.controller.request_neutral(f64::NEG_INFINITY)
    }

    /// Puts in the dogs of a gear that is expected next.
    pub fn preselect(&mut self, gear: Option<usize>) {
        self.controller.preselect(gear);
    }

    /// Goes on by one control period. Below idle speed the idle control opens the throttle. `on_step` sees every step of the integration, `record` a sample at every multiple of the
    /// sample time.
    ///
    /// # Errors
    /// Divergence or chatter.
    pub fn advance(
        &mut self,
        driver: Driver,
        mut on_step: impl FnMut(&CarStep<'_>),
        mut record: impl FnMut(&CarSample),
    ) -> Result<(), CarError> {
        let (model, now_s) = (self.model, self.time_s());
        let [engine_rad_s, ..] = model.speeds(self.plant.state());
        let driver = Driver { throttle: driver.throttle.max(idle_throttle(engine_rad_s)), ..driver };
        self.commands = self.controller.step(now_s, driver.throttle, &measure(model, self.plant.state(), driver));
        self.valves.send(model, now_s, &self.faults.arriving(now_s, &self.commands.elements));
        self.periods += 1;
        let end_s = self.time_s();
        let shown = self.controller.shown(now_s);
        while self.plant.time_s() < end_s - SAME_INSTANT_S {
            let valves = (&mut self.valves, &self.faults);
            let inputs = inputs(model, valves, &self.commands, driver, self.plant.time_s() + SAME_INSTANT_S);
            let until_s = self.valves.next_arrival_s().map_or(end_s, |arrival| arrival.min(end_s));
            let (commands, samples, sample_time_s) = (&self.commands, &mut self.samples, self.sample_time_s);
            self.plant.advance(model, &inputs, until_s, &mut |step| {
                on_step(step);
                // A sample on the border of two steps belongs to the second: at the instant of a new command it shows it.
                while let time_s = sample_time(*samples, sample_time_s)
                    && time_s < step.end_s - SAME_INSTANT_S
                {
                    record(&CarSample::of(model, step, time_s, commands, driver, shown));
                    *samples += 1;
                }
            })?;
        }
        Ok(())
    }
}

fn sample_time(samples: u64, sample_time_s: f64) -> f64 {
    samples as f64 * sample_time_s
}

/// Whether gears and elements have the same places in both cars.
fn is_same_box(car: &Car, other: &Car) -> bool {
    let gears = |car: &Car| car.gearbox.gears.iter().map(|gear| gear.name.clone()).collect::<Vec<_>>();
    let elements = |car: &Car| car.gearbox.elements.iter().map(|element| element.name.clone()).collect::<Vec<_>>();
    let is_whole = other.clutches.len() == other.gearbox.elements.len();
    is_whole && gears(car) == gears(other) && elements(car) == elements(other)
}

fn measure(model: &CarModel, state: &CarState, driver: Driver) -> CarMeasured {
    let [engine_rad_s, turbine_rad_s, output_rad_s] = model.speeds(state);
    CarMeasured { engine_rad_s, turbine_rad_s, output_rad_s, wheel_rad_s: state.wheel_rad_s, brake: driver.brake }
}

/// Commands that have arrived, and what the driver does.
fn inputs(
    model: &CarModel,
    (valves, faults): (&mut CarValves, &Faults),
    commands: &CarCommands,
    driver: Driver,
    now_s: f64,
) -> CarInputs {
    let car = &model.car;
    CarInputs {
        throttle: driver.throttle.max(commands.engine_throttle),
        engine_share: commands.engine_share,
        brake_n_m: driver.brake * BRAKE_OVER_TYRES * car.tyre.max_force_n * car.road.wheel_radius_m,
        grade_rad: driver.grade_rad,
        settled_pa: faults.settled_pa(model, now_s, valves.settled_pa(model, now_s)),
        dogs: commands.dogs,
        lock_up_n_m: commands.lock_up_n_m,
    }
}
