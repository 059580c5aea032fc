//! The gearbox filter as an observer of a vehicle of one shift, on the readings of the field.

use std::path::Path;

use car::{Experiment, Vehicle};
use config::ExperimentFile;
use design::open_loop_maps;
use observer::{ChannelHealth, Estimate, Estimator, Health, Input, OneShiftFilter, Phase, one_shift_filter};
use study::sampling::{sampled, through_sensors};
use study::{RunColumns, simulate_drive, true_phases};
use trace::{Trace, signal};

const SAMPLE_S: f64 = 0.01;
const SHIFT: [Phase; 2] = [Phase::TorquePhase, Phase::InertiaPhase];

struct Field {
    vehicle: Vehicle,
    experiment: Experiment,
    drive: Trace,
}

/// Readings, with the true phases, pressures and torques.
struct Log {
    inputs: Vec<Input<f64>>,
    phases: Vec<Phase>,
    truth: [Vec<f64>; 2],
}

impl Field {
    fn new() -> Self {
        Self::of_car(1.0, 1.0)
    }

    /// The drive of a car whose friction and valve gain are those of its file times these factors.
    fn of_car(friction: f64, gain: f64) -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../experiments/field.toml");
        let file = ExperimentFile::read(&path).unwrap();
        let vehicle = file.read_vehicle().unwrap().vehicle;
        let mut experiment = file.experiment;
        (experiment.off_nominal.friction_factor, experiment.off_nominal.valve_gain_factor) = (friction, gain);
        let drive = simulate_drive(&vehicle, &experiment).unwrap();
        Self { vehicle, experiment, drive }
    }

    fn log(&self, scenario: &str) -> Log {
        let scenario = self.experiment.scenarios.iter().find(|known| known.name == scenario).unwrap();
        let sensors = self.experiment.with_scenario(scenario).sensors.unwrap();
        Log::of(&through_sensors(&self.drive, SAMPLE_S, &sensors, &self.vehicle), &self.vehicle)
    }

    fn filter(&self) -> OneShiftFilter<f64> {
        one_shift_filter(&self.vehicle, self.experiment.sensors_given.as_ref())
    }
}

impl Log {
    fn of(trace: &Trace, vehicle: &Vehicle) -> Self {
        let columns = RunColumns::of(trace, vehicle).unwrap();
        let truth = [signal::ONCOMING_PRESSURE, signal::ONCOMING_TORQUE].map(|name| trace.get(name).unwrap().to_vec());
        let inputs = columns.samples().map(|sample| sample.unwrap().0).collect();
        Self { inputs, phases: true_phases(trace).unwrap(), truth }
    }

    fn estimates(&self, observer: &impl Estimator<f64>) -> Vec<Estimate<f64>> {
        let mut state = observer.start();
        self.inputs.iter().map(|input| observer.step(&mut state, input)).collect()
    }

    /// RMS errors of pressure, Pa, and torque, N m, in the torque and the inertia phase.
    fn errors(&self, estimates: &[Estimate<f64>]) -> [[f64; 2]; 2] {
        let rms = |signal: usize, phase: Phase| {
            let of = |estimate: &Estimate<f64>| [estimate.pressure_pa, estimate.clutch_torque_n_m][signal];
            let errors =
                (estimates.iter().zip(&self.truth[signal]).zip(&self.phases)).filter(|(_, now)| **now == phase);
            let squares: Vec<f64> = errors.map(|((estimate, truth), _)| (of(estimate) - truth).powi(2)).collect();
            (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
        };
        [0, 1].map(|signal| SHIFT.map(|phase| rms(signal, phase)))
    }
}

#[test]
fn it_finds_the_gears_of_a_log_without_gears() {
    let field = Field::new();
    let log = field.log("nominal");
    let estimates = log.estimates(&field.filter());
    let mut phases: Vec<Phase> = estimates.iter().map(|estimate| estimate.phase).collect();
    phases.dedup();
    assert_eq!(phases, Phase::ALL);
    let within = |at: usize| SHIFT.contains(&log.phases[at]);
    let right = (0..estimates.len()).filter(|&at| within(at) && estimates[at].phase == log.phases[at]).count();
    let all = (0..estimates.len()).filter(|&at| within(at)).count();
    assert!(10 * right > 9 * all, "{right} of {all}");
    assert!((0..estimates.len()).filter(|&at| within(at)).all(|at| estimates[at].health == Health::Good));
}

#[test]
fn it_finds_the_torque_of_a_wrong_clutch_with_and_without_sensors_and_the_offgoing_command() {
    for (friction, gain) in [(0.85, 0.92), (1.15, 1.08)] {
        let field = Field::of_car(friction, gain);
        let mut log = field.log("nominal");
        let [_, maps] = log.errors(&log.estimates(&open_loop_maps(&field.vehicle)));
        let [_, told] = log.errors(&log.estimates(&field.filter()));
        let [_, untold] = log.errors(&log.estimates(&one_shift_filter(&field.vehicle, None)));
        log.inputs.iter_mut().for_each(|input| input.offgoing_command = None);
        let estimates = log.estimates(&field.filter());
        let [_, one_command] = log.errors(&estimates);
        // A command that a log does not have is no fault.
        assert!(estimates.iter().all(|of| of.channels.offgoing_command == ChannelHealth::Unused));
        let is_lost = |(phase, of): (&Phase, &Estimate<f64>)| SHIFT.contains(phase) && of.health == Health::ChannelLost;
        assert!(!log.phases.iter().zip(&estimates).any(is_lost));
        for (name, errors, limit) in [("told", told, 0.8), ("not told", untold, 0.8), ("one command", one_command, 1.0)]
        {
            assert!((0..2).all(|k| errors[k] < limit * maps[k]), "{name}: {errors:?} {maps:?} N m");
        }
    }
}

#[test]
fn a_late_turbine_speed_is_found_in_the_gear_before_the_shift() {
    let field = Field::new();
    let log = field.log("turbine 10 ms late");
    let mut punctual = field.vehicle.clone();
    punctual.error_bounds.channel_skew_s = 0.0;
    let sensors = field.experiment.sensors_given.as_ref();
    let [_, found] = log.errors(&log.estimates(&field.filter()));
    let [_, not_found] = log.errors(&log.estimates(&one_shift_filter(&punctual, sensors)));
    // It shows where the speeds change fast.
    assert!(found[1] < 0.5 * not_found[1], "{found:?} {not_found:?} N m");
}

#[test]
fn it_gives_the_same_in_single_precision() {
    let field = Field::new();
    let log = field.log("an ordinary car");
    let (double, single) = (field.filter(), field.filter().cast::<f32>());
    let (mut double_state, mut single_state) = (double.start(), single.start());
    for input in &log.inputs {
        let [wide, narrow] = [
            double.step(&mut double_state, input).pressure_pa,
            f64::from(single.step(&mut single_state, &input.cast()).pressure_pa),
        ];
        assert!((wide - narrow).abs() < 2e3, "{wide} {narrow}");
    }
}

#[test]
fn a_clutch_without_oil_shows_as_a_flare() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../experiments/fill.toml");
    let experiment = ExperimentFile::read(&path).unwrap();
    let vehicle = experiment.read_vehicle().unwrap();
    for (name, flares) in [("nominal", false), ("early fill", false), ("starved", true)] {
        let scenario = experiment.scenarios.iter().find(|known| known.name == name).unwrap();
        let varied = experiment.with_scenario(scenario);
        let log = Log::of(&sampled(&simulate_drive(&vehicle, &varied).unwrap(), SAMPLE_S), &vehicle);
        let estimates = log.estimates(&one_shift_filter(&vehicle, None));
        assert_eq!(estimates.iter().any(|estimate| estimate.health == Health::Flare), flares, "{name}");
    }
}

#[test]
fn nothing_that_comes_makes_it_panic_or_give_no_number() {
    let field = Field::new();
    let log = field.log("nominal");
    let filter = field.filter();
    for value in [f64::NAN, f64::INFINITY, -1e300, 0.0, 1e9] {
        let mut state = filter.start();
        for (at, input) in log.inputs.iter().enumerate() {
            let mut input = *input;
            match at % 7 {
                0 => input.dt_s = value,
                1 => input.turbine_rad_s = None,
                2 => input.output_rad_s.iter_mut().for_each(|reading| reading.value = value),
                3 => input.command.iter_mut().for_each(|reading| reading.value = value),
                4 => input.wheel_rad_s.iter_mut().for_each(|reading| reading.age_s = value),
                5 => input.offgoing_command.iter_mut().for_each(|reading| reading.value = value),
                _ => {}
            }
            let estimate = filter.step(&mut state, &input);
            assert!(estimate.pressure_pa >= 0.0 && estimate.pressure_pa <= field.vehicle.error_bounds.pressure_max_pa);
            assert!(estimate.clutch_torque_n_m.is_finite(), "{value} at {at}: {estimate:?}");
        }
    }
    assert_eq!(filter.step(&mut filter.start(), &Input::none(0.01)).pressure_pa, 0.0);
}
