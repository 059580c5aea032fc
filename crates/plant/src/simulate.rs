//! One simulated drive: controller, valves, powertrain, recorder.

use config::{Experiment, Vehicle};

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
    /// What the controller commands: throttle and the currents before their delay.
    pub commands: Commands,
    /// Slip of the offgoing clutch, rad/s.
    pub offgoing_slip_rad_s: f64,
    /// Slip of the oncoming clutch, rad/s.
    pub oncoming_slip_rad_s: f64,
    /// Pressure of the oncoming clutch, Pa: what the observers look for.
    pub oncoming_pa: f64,
    /// Acceleration of the vehicle, m/s^2.
    pub vehicle_m_s2: f64,
}

/// Simulates the experiment on the nominal `vehicle` with its differences applied, and shows a sample to
/// `record` at every multiple of the sample time, from zero to the duration.
///
/// # Errors
/// See [`PlantError`].
pub fn simulate(vehicle: &Vehicle, experiment: &Experiment, mut record: impl FnMut(&Sample)) -> Result<(), PlantError> {
    let powertrain = Powertrain::new(experiment.simulated_vehicle(vehicle));
    simulate_powertrain(&powertrain, vehicle, experiment, crate::hybrid::RELATIVE_TOLERANCE, |_| {}, &mut record)
}

/// As [`simulate`], for a powertrain and tolerance of choice, and with every step shown to `on_step`.
///
/// # Errors
/// See [`PlantError`].
pub fn simulate_powertrain(
    powertrain: &Powertrain,
    nominal: &Vehicle,
    experiment: &Experiment,
    relative_tolerance: f64,
    mut on_step: impl FnMut(&Segment<'_>),
    mut record: impl FnMut(&Sample),
) -> Result<(), PlantError> {
    let calibration = experiment.shift;
    let mut controller = ShiftController::new(nominal, calibration);
    let state = initial_state(powertrain, experiment);
    let mut commands = controller.step(0.0, experiment.throttle.at(0.0), &measure(&state));
    let mut valves = [DelayLine::new(commands.offgoing_a), DelayLine::new(commands.oncoming_a)];
    let mut inputs = arrived(powertrain, &mut valves, 0.0, commands.throttle);
    let mut plant = HybridIntegrator::with_tolerance(powertrain, 0.0, state, &inputs, relative_tolerance)?;

    let mut recorder = Recorder { next: 0, experiment };
    let periods = (experiment.duration_s / calibration.control_period_s - 1e-9).ceil();
    let mut period = 0.0;
    while period < periods {
        let start_s = period * calibration.control_period_s;
        if period > 0.0 {
            commands = controller.step(start_s, experiment.throttle.at(start_s), &measure(&plant.state));
            let v = &powertrain.vehicle;
            let [offgoing, oncoming] = &mut valves;
            offgoing.send(start_s, v.offgoing.valve.delay_s.at(commands.offgoing_a), commands.offgoing_a);
            oncoming.send(start_s, v.oncoming.valve.delay_s.at(commands.oncoming_a), commands.oncoming_a);
        }
        period += 1.0;
        let stage = controller.stage();
        let end_s = (period * calibration.control_period_s).min(experiment.duration_s);
        while plant.time_s < end_s {
            inputs = arrived(powertrain, &mut valves, plant.time_s, commands.throttle);
            let arrival = valves.iter().filter_map(DelayLine::next_arrival_s).fold(end_s, f64::min);
            plant.advance(powertrain, &inputs, arrival, &mut |segment| {
                on_step(segment);
                recorder.step(powertrain, &commands, stage, segment, &mut record);
            })?;
        }
    }
    Ok(())
}

/// Currents that have arrived at the valves, and the throttle.
fn arrived(powertrain: &Powertrain, valves: &mut [DelayLine; 2], time_s: f64, throttle: f64) -> Inputs {
    let [offgoing, oncoming] = valves;
    Inputs::arrived(&powertrain.vehicle, throttle, offgoing.arrive(time_s), oncoming.arrive(time_s))
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
    State {
        engine_rad_s: experiment.initial_engine_rad_s,
        turbine_rad_s: turbine,
        output_rad_s: output,
        twist_rad: shaft_n_m / v.driveline.shaft_stiffness_n_m_rad,
        wheel_rad_s: wheel,
        vehicle_m_s: experiment.initial_vehicle_m_s,
        offgoing_pa: experiment.shift.line_pressure_pa,
        oncoming_pa: 0.0,
    }
}

/// Times closer than this are the same instant, s: sums of periods differ in their last bits.
const SAME_INSTANT_S: f64 = 1e-9;

/// Takes samples out of the steps.
struct Recorder<'a> {
    next: u32,
    experiment: &'a Experiment,
}

impl Recorder<'_> {
    fn step(
        &mut self,
        powertrain: &Powertrain,
        commands: &Commands,
        stage: Stage,
        segment: &Segment<'_>,
        record: &mut impl FnMut(&Sample),
    ) {
        // A sample on the border of two steps belongs to the second: at the instant of a new command it shows
        // that command, as the controller that gave it would log it. Only the very last has no second.
        let duration_s = self.experiment.duration_s;
        let last = segment.end_s > duration_s - SAME_INSTANT_S;
        let until_s = if last { duration_s + SAME_INSTANT_S } else { segment.end_s - SAME_INSTANT_S };
        loop {
            let time_s = f64::from(self.next) * self.experiment.sample_time_s;
            if time_s > until_s {
                return;
            }
            let state = segment.at(time_s.clamp(segment.start_s, segment.end_s));
            let torques = powertrain.torques(segment.mode, &state, segment.inputs);
            let shift = &powertrain.vehicle.shift;
            record(&Sample {
                time_s,
                state,
                mode: segment.mode,
                stage,
                torques,
                commands: *commands,
                offgoing_slip_rad_s: shift.offgoing_slip(state.turbine_rad_s, state.output_rad_s),
                oncoming_slip_rad_s: shift.oncoming_slip(state.turbine_rad_s, state.output_rad_s),
                oncoming_pa: state.oncoming_pa,
                vehicle_m_s2: powertrain.vehicle_acceleration(&state, &torques),
            });
            self.next += 1;
        }
    }
}
