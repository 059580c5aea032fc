//! One simulated drive: controller, valves, powertrain, recorder.

use car::{Experiment, Profile, ShiftClutch, Vehicle};
use drivetrain::Play;

use crate::delay::DelayLine;
use crate::{
    Commands, HybridIntegrator, Inputs, Measured, Mode, PlantError, Powertrain, Segment, ShiftController, Stage, State,
    Torques,
};

/// The plant at one instant: what a car measures, and the truth behind it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Time, s.
    pub time_s: f64,
    /// The states.
    pub state: State,
    /// Which clutches stick.
    pub mode: Mode,
    /// What the shift controller is about.
    pub stage: Stage,
    /// All torques.
    pub torques: Torques,
    /// What the controller commands: throttle and the valves' commands before their delay.
    pub commands: Commands,
    /// Slip of the offgoing clutch, rad/s.
    pub offgoing_slip_rad_s: f64,
    /// Slip of the oncoming clutch, rad/s.
    pub oncoming_slip_rad_s: f64,
    /// Pressure of the offgoing clutch, Pa.
    pub offgoing_pa: f64,
    /// Pressure of the oncoming clutch, Pa: what the observers look for.
    pub oncoming_pa: f64,
    /// Acceleration of the vehicle, m/s^2.
    pub vehicle_m_s2: f64,
}

/// The plant at the time of a sample. What does not stand here follows from it when it is asked for.
#[derive(Debug, Clone, Copy)]
pub struct Moment<'a> {
    /// Time, s.
    pub time_s: f64,
    /// The states.
    pub state: State,
    /// Which clutches stick.
    pub mode: Mode,
    /// What the shift controller is about.
    pub stage: Stage,
    /// What the controller commands.
    pub commands: &'a Commands,
    inputs: &'a Inputs,
    powertrain: &'a Powertrain,
}

impl Moment<'_> {
    /// Slip of the oncoming clutch, rad/s.
    pub fn oncoming_slip_rad_s(&self) -> f64 {
        self.powertrain.vehicle.shift.oncoming_slip(self.state.turbine_rad_s, self.state.output_rad_s)
    }

    /// Torque of the oncoming clutch, N m.
    pub fn oncoming_n_m(&self) -> f64 {
        self.powertrain.oncoming_torque(self.mode, &self.state, self.inputs)
    }

    /// Pressure of the oncoming clutch, Pa.
    pub fn oncoming_pa(&self) -> f64 {
        self.powertrain.pressures(&self.state)[1]
    }

    /// Drive-shaft torque, N m.
    pub fn shaft_n_m(&self) -> f64 {
        self.powertrain.shaft_torque(&self.state)
    }

    /// Acceleration of the vehicle, m/s^2.
    pub fn vehicle_m_s2(&self) -> f64 {
        self.powertrain.vehicle_acceleration(&self.state)
    }

    /// All of it.
    pub fn sample(&self) -> Sample {
        let (state, shift) = (self.state, &self.powertrain.vehicle.shift);
        let [offgoing_pa, oncoming_pa] = self.powertrain.pressures(&state);
        let torques = self.powertrain.torques(self.mode, &state, self.inputs);
        Sample {
            time_s: self.time_s,
            state,
            mode: self.mode,
            stage: self.stage,
            torques,
            commands: *self.commands,
            offgoing_slip_rad_s: shift.offgoing_slip(state.turbine_rad_s, state.output_rad_s),
            oncoming_slip_rad_s: self.oncoming_slip_rad_s(),
            offgoing_pa,
            oncoming_pa,
            vehicle_m_s2: self.powertrain.acceleration_under(&state, torques.tyre_n),
        }
    }
}

/// Simulates the experiment on the nominal `vehicle` with its differences applied, and shows a sample to
/// `record` at every multiple of the sample time, from zero to the duration.
///
/// # Errors
/// See [`PlantError`].
pub fn simulate(vehicle: &Vehicle, experiment: &Experiment, record: impl FnMut(&Sample)) -> Result<(), PlantError> {
    let powertrain = Powertrain::new(experiment.simulated_vehicle(vehicle));
    Simulation::new(&powertrain, vehicle, experiment)?.advance(experiment.duration_s, record)
}

/// A drive during its simulation; a copy continues from the same state.
#[derive(Debug, Clone)]
pub struct Simulation<'a> {
    powertrain: &'a Powertrain,
    experiment: &'a Experiment,
    controller: ShiftController,
    commands: Commands,
    throttle: Profile,
    valves: [ValveInput; 2],
    plant: HybridIntegrator,
    /// Periods of the controller that have begun.
    periods: f64,
    recorder: Recorder,
}

impl<'a> Simulation<'a> {
    /// At time zero. `nominal` is the vehicle of the shift controller's model.
    ///
    /// # Errors
    /// See [`PlantError`].
    pub fn new(powertrain: &'a Powertrain, nominal: &Vehicle, experiment: &'a Experiment) -> Result<Self, PlantError> {
        Self::with_tolerance(powertrain, nominal, experiment, crate::hybrid::RELATIVE_TOLERANCE)
    }

    /// As [`Self::new`], with a relative tolerance of its own.
    ///
    /// # Errors
    /// See [`PlantError`].
    pub fn with_tolerance(
        powertrain: &'a Powertrain,
        nominal: &Vehicle,
        experiment: &'a Experiment,
        relative_tolerance: f64,
    ) -> Result<Self, PlantError> {
        let v = &powertrain.vehicle;
        let mut controller = ShiftController::new(&calibrated_for(nominal, v), experiment.shift);
        let state = initial_state(powertrain, experiment);
        let throttle = experiment.driver_throttle();
        let commands = controller.step(0.0, throttle.at(0.0), &measure(&state));
        let mut valves =
            [ValveInput::new(&v.offgoing, commands.offgoing), ValveInput::new(&v.oncoming, commands.oncoming)];
        let inputs = arrived(powertrain, &mut valves, 0.0, commands.throttle);
        let plant = HybridIntegrator::with_tolerance(powertrain, 0.0, state, &inputs, relative_tolerance)?;
        let recorder = Recorder { next: 0, sample_time_s: experiment.sample_time_s, duration_s: experiment.duration_s };
        Ok(Self { powertrain, experiment, controller, commands, throttle, valves, plant, periods: 1.0, recorder })
    }

    /// Time reached, s.
    pub fn time_s(&self) -> f64 {
        self.plant.time_s()
    }

    /// What the shift controller is about.
    pub fn stage(&self) -> Stage {
        self.controller.stage()
    }

    /// Records nothing before this time, s.
    pub fn record_from(&mut self, time_s: f64) {
        while f64::from(self.recorder.next) * self.recorder.sample_time_s < time_s - SAME_INSTANT_S {
            self.recorder.next += 1;
        }
    }

    /// Goes on to `until_s`, but not beyond the experiment's duration, and shows a sample to `record` at every
    /// multiple of the sample time.
    ///
    /// # Errors
    /// See [`PlantError`].
    pub fn advance(&mut self, until_s: f64, mut record: impl FnMut(&Sample)) -> Result<(), PlantError> {
        self.advance_over(until_s, |_| {}, |moment| record(&moment.sample()))
    }

    /// As [`Self::advance`], with every step of the integrator shown to `on_step`.
    ///
    /// # Errors
    /// See [`PlantError`].
    pub fn advance_with_steps(
        &mut self,
        until_s: f64,
        on_step: impl FnMut(&Segment<'_>),
        mut record: impl FnMut(&Sample),
    ) -> Result<(), PlantError> {
        self.advance_over(until_s, on_step, |moment| record(&moment.sample()))
    }

    /// As [`Self::advance`], where `record` takes of each sample only what it needs.
    ///
    /// # Errors
    /// See [`PlantError`].
    pub fn advance_to(&mut self, until_s: f64, record: impl FnMut(&Moment<'_>)) -> Result<(), PlantError> {
        self.advance_over(until_s, |_| {}, record)
    }

    fn advance_over(
        &mut self,
        until_s: f64,
        mut on_step: impl FnMut(&Segment<'_>),
        mut record: impl FnMut(&Moment<'_>),
    ) -> Result<(), PlantError> {
        let period_s = self.experiment.shift.control_period_s;
        let until_s = until_s.min(self.experiment.duration_s);
        while self.plant.time_s() < until_s - SAME_INSTANT_S {
            if self.plant.time_s() >= self.periods * period_s {
                self.control(self.periods * period_s);
                self.periods = self.next_change(self.periods);
            }
            let stage = self.controller.stage();
            let end_s = (self.periods * period_s).min(until_s);
            while self.plant.time_s() < end_s {
                let inputs = arrived(self.powertrain, &mut self.valves, self.plant.time_s(), self.commands.throttle);
                let arrival = self.valves.iter().filter_map(|valve| valve.line.next_arrival_s()).fold(end_s, f64::min);
                let (powertrain, commands, recorder) = (self.powertrain, &self.commands, &mut self.recorder);
                self.plant.advance(powertrain, &inputs, arrival, &mut |segment| {
                    on_step(segment);
                    recorder.step(powertrain, commands, stage, segment, &mut record);
                })?;
            }
        }
        Ok(())
    }

    /// The next period in which the commands of the controller may change. Before a shift they depend on the time
    /// alone, so no step has to end while the throttle is constant.
    fn next_change(&self, period: f64) -> f64 {
        let now_s = self.plant.time_s();
        let next = period + 1.0;
        let Stage::Before = self.controller.stage() else { return next };
        let throttle = &self.throttle;
        let points = throttle.axis().iter().zip(throttle.values());
        let here = throttle.at(now_s);
        // It rests until the last point before the first one of another value.
        let rests = points.clone().filter(|(time, _)| **time >= now_s).take_while(|(_, value)| **value == here);
        let another = points.clone().any(|(time, value)| *time > now_s && *value != here);
        let resting_s = if another { rests.last().map_or(now_s, |(time, _)| *time) } else { f64::INFINITY };
        let calm_s = resting_s.min(self.experiment.shift.request_s);
        next.max((calm_s / self.experiment.shift.control_period_s).floor())
    }

    /// One step of the shift controller, whose commands set out to the valves.
    fn control(&mut self, now_s: f64) {
        self.commands = self.controller.step(now_s, self.throttle.at(now_s), &measure(self.plant.state()));
        let v = &self.powertrain.vehicle;
        let [offgoing, oncoming] = &mut self.valves;
        let commands = &self.commands;
        offgoing.line.send(now_s, v.offgoing.valve.delay(commands.offgoing), commands.offgoing);
        oncoming.line.send(now_s, v.oncoming.valve.delay(commands.oncoming), commands.oncoming);
    }
}

/// Commands that have arrived at the valves, and the throttle.
fn arrived(powertrain: &Powertrain, valves: &mut [ValveInput; 2], time_s: f64, throttle: f64) -> Inputs {
    let v = &powertrain.vehicle;
    let [offgoing, oncoming] = valves;
    Inputs {
        throttle,
        offgoing_settled_pa: offgoing.settled_pressure(&v.offgoing, time_s),
        oncoming_settled_pa: oncoming.settled_pressure(&v.oncoming, time_s),
    }
}

/// What lies between the controller and a valve's pressure: the delay of its command, then its hysteresis.
#[derive(Debug, Clone)]
struct ValveInput {
    line: DelayLine,
    play: Play<f64>,
}

impl ValveInput {
    /// Where this command has stood for ever.
    fn new(clutch: &ShiftClutch, command: f64) -> Self {
        let play = Play::new(clutch.hysteresis_pa, clutch.valve.settled_pressure(command));
        Self { line: DelayLine::new(command), play }
    }

    /// Pressure at which the command that has arrived by now settles, Pa.
    fn settled_pressure(&mut self, clutch: &ShiftClutch, now_s: f64) -> f64 {
        self.play.follow(clutch.valve.settled_pressure(self.line.arrive(now_s)))
    }
}

/// The car that the shift controller is calibrated for: the nominal one with pistons that have a stroke if those of the
/// simulated car have one, and with its oil temperature, which every controller measures.
fn calibrated_for(nominal: &Vehicle, simulated: &Vehicle) -> Vehicle {
    let mut vehicle = nominal.clone();
    vehicle.oil_temperature_degc = simulated.oil_temperature_degc;
    for (clutch, real) in [(&mut vehicle.offgoing, &simulated.offgoing), (&mut vehicle.oncoming, &simulated.oncoming)] {
        clutch.has_stroke = real.has_stroke;
        clutch.cylinder = clutch.cylinder.with_oil(simulated.oil_temperature_degc);
    }
    vehicle
}

fn measure(state: &State) -> Measured {
    Measured { engine_rad_s: state.engine_rad_s, turbine_rad_s: state.turbine_rad_s, output_rad_s: state.output_rad_s }
}

/// In the gear before the shift, offgoing clutch at line pressure, oncoming empty. The shafts are twisted
/// by what the turbine gives: a standing car has been held by its brake, which lets go at time zero.
fn initial_state(powertrain: &Powertrain, experiment: &Experiment) -> State {
    let v = &powertrain.vehicle;
    let wheel = experiment.initial_vehicle_m_s / v.road.wheel_radius_m;
    let output = wheel * v.driveline.final_ratio;
    let turbine = v.shift.ratio_offgoing() * output;
    let turbine_n_m = v.converter.torques(experiment.initial_engine_rad_s, turbine).turbine_n_m;
    let shaft_n_m = turbine_n_m * v.shift.ratio_offgoing() * v.driveline.final_ratio;
    let line_pa = experiment.shift.line_pressure_pa;
    State {
        engine_rad_s: experiment.initial_engine_rad_s,
        turbine_rad_s: turbine,
        output_rad_s: output,
        twist_rad: shaft_n_m / v.driveline.shaft_stiffness_n_m_rad + 0.5 * v.backlash_rad * shaft_n_m.signum(),
        wheel_rad_s: wheel,
        vehicle_m_s: experiment.initial_vehicle_m_s,
        offgoing_valve_pa: line_pa,
        oncoming_valve_pa: 0.0,
        offgoing_m3: v.offgoing.cylinder.volume(line_pa),
        oncoming_m3: v.oncoming.cylinder.volume(0.0),
    }
}

/// Times closer than this are the same instant, s: sums of periods differ in their last bits.
const SAME_INSTANT_S: f64 = 1e-9;

/// Takes samples out of the steps.
#[derive(Debug, Clone)]
struct Recorder {
    next: u32,
    sample_time_s: f64,
    duration_s: f64,
}

impl Recorder {
    fn step(
        &mut self,
        powertrain: &Powertrain,
        commands: &Commands,
        stage: Stage,
        segment: &Segment<'_>,
        record: &mut impl FnMut(&Moment<'_>),
    ) {
        // A sample on the border of two steps belongs to the second: at the instant of a new command it shows
        // that command, as the controller that gave it would log it. Only the very last has no second.
        let last = segment.end_s > self.duration_s - SAME_INSTANT_S;
        let until_s = if last { self.duration_s + SAME_INSTANT_S } else { segment.end_s - SAME_INSTANT_S };
        loop {
            let time_s = f64::from(self.next) * self.sample_time_s;
            if time_s > until_s {
                return;
            }
            let state = segment.at(time_s.clamp(segment.start_s, segment.end_s));
            let Segment { mode, inputs, .. } = *segment;
            record(&Moment { time_s, state, mode, stage, commands, inputs, powertrain });
            self.next += 1;
        }
    }
}
