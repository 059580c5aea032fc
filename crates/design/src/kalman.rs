//! The Kalman filters of a vehicle: what it does not know, from the error budget and the sensors.

use car::{Sensors, SpeedSensor, Vehicle};
use drivetrain::{Real, ReducedShift};
use observer::{
    ExtendedFilter, FilterNoise, KalmanFilter, OffgoingClutch, Readings, ReportedTorque, Uncertainty, UnscentedFilter,
    ValveModel, phase_supervisor,
};

use observer::of_sensors::{ENGINE_KG_M2, SCALE_MIN, engine_noise, lag_rad, speed_reading, std_dev_of, std_dev_rad_s};

use crate::budget::{ValveErrors, shift_pressure, shift_time_constant};
use crate::compliant::compliant_model;
use crate::rigid::{input_limits, tracker};

/// Error of a reported engine torque beside its relative error, N m \[chosen\]: accessories, and friction that the temperature changes.
const ENGINE_BESIDE_N_M: f64 = 5.0;

/// Fraction of the budget's shaft torque by which the load of the wheels may change in a gear: mass, and slip of the
/// tyres \[chosen\].
const LOAD_IN_GEAR: f64 = 0.3;
/// Time of such a change, s \[chosen\].
const LOAD_IN_GEAR_S: f64 = 0.05;

/// Time after which friction and valve gain may be others, s \[chosen\]: a few shifts of city driving.
const CLUTCH_S: f64 = 20.0;

/// A delay is known no better than this, s \[chosen\].
const DELAY_MIN_S: f64 = 1.3e-3;

/// Half the width of a range, as the edge of a uniform distribution.
fn std_dev_within(range: [f64; 2]) -> f64 {
    std_dev_of(0.5 * (range[1] - range[0]))
}

/// An error for each unit of what it is weighed at; weighed at nothing there is none.
fn fraction(error: f64, weighed_at: f64) -> f64 {
    if weighed_at > 0.0 { error / weighed_at } else { 0.0 }
}

/// The Kalman filter of this vehicle, for signals from these sensors; without them the readings are taken to be of the
/// moment, with the noise of the error budget.
///
/// A bound of the budget counts as the edge of a uniform distribution.
///
/// With its guaranteed ranges, in single precision, for a controller (`docs/how-to/put-on-a-controller.md`):
///
/// ```
/// # use observer::{Estimator, Input, Reading};
/// # let path = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../vehicles/two_speed_at.toml"));
/// let vehicle = config::VehicleFile::read(path)?.vehicle;
/// let observer = design::kalman_filter(&vehicle, None).cast::<f32>();
/// let range = design::range(&vehicle).guaranteed().cast::<f32>();
/// let for_the_controller = observer::Bounded { observer, range };
///
/// // On the controller, in each sample: what came since the one before.
/// let mut state = for_the_controller.start();
/// let input = Input {
///     engine_rad_s: Some(Reading::now(250.0)),
///     turbine_rad_s: Some(Reading { value: 200.0, age_s: 0.004 }),
///     output_rad_s: Some(Reading { value: 80.0, age_s: 0.004 }),
///     command: Some(Reading::now(0.0)),
///     ..Input::none(0.01)
/// };
/// let estimate = for_the_controller.step(&mut state, &input);
/// assert!(estimate.bounds.is_some());
/// # Ok::<(), config::ConfigError>(())
/// ```
pub fn kalman_filter(vehicle: &Vehicle, sensors: Option<&Sensors>) -> KalmanFilter<f64> {
    let budget = &vehicle.error_bounds;
    let [delay_min_s, delay_max_s] = budget.valve_delay_s;
    let model = compliant_model(vehicle);
    let engine = engine_noise(sensors.map(|sensors| &sensors.engine), budget.turbine_quantum_rad_s);
    let valve_model = |valve| ValveModel { valve, delay_s: 0.5 * (delay_min_s + delay_max_s) };
    let offgoing = OffgoingClutch {
        valve: valve_model(vehicle.offgoing.valve),
        clutch: vehicle.offgoing.clutch,
        open_n_m: budget.offgoing_torque_n_m,
    };
    let reported = ReportedTorque {
        engine_kg_m2: vehicle.engine.inertia_kg_m2,
        fraction: std_dev_of(budget.engine_torque_share),
        beside_n_m: ENGINE_BESIDE_N_M * (vehicle.engine.inertia_kg_m2 / ENGINE_KG_M2),
    };
    KalmanFilter::new(
        model,
        valve_model(vehicle.oncoming.valve),
        uncertainty(vehicle, &model.shift),
        [
            speed_reading(sensors.map(|sensors| &sensors.turbine), budget.turbine_quantum_rad_s),
            speed_reading(sensors.map(|sensors| &sensors.output), budget.output_quantum_rad_s),
            speed_reading(sensors.map(|sensors| &sensors.wheel), budget.wheel_quantum_rad_s),
        ],
        (speed_reading(sensors.map(|sensors| &sensors.engine), budget.turbine_quantum_rad_s), engine),
        offgoing,
        reported,
        phase_supervisor(vehicle),
        input_limits(vehicle),
    )
}

/// What the filter does not know.
fn uncertainty(vehicle: &Vehicle, shift: &ReducedShift<f64>) -> Uncertainty<f64> {
    let (budget, given) = (&vehicle.error_bounds, &vehicle.settings.filter);
    let line = &vehicle.driveline;
    let wheels = vehicle.road.inertia_at_wheel() + line.wheel_inertia_kg_m2;
    // A quarter of a swing of the shafts between the gearbox, with the gear's part of the turbine, and the wheels.
    let gearbox = shift.mass_kg_m2[1][1] * Real::powi(line.final_ratio, 2);
    let swing_rad_s = (line.shaft_stiffness_n_m_rad * (gearbox.recip() + wheels.recip())).sqrt();
    let quarter_swing_s = 0.5 * std::f64::consts::PI / swing_rad_s;
    let [delay_min_s, delay_max_s] = budget.valve_delay_s;
    let lag = std_dev_of(budget.valve_lag_factor.map(|factor| (factor - 1.0).abs()).into_iter().fold(0.0, f64::max));
    let delay = std_dev_of(0.5 * (delay_max_s - delay_min_s)) / shift_time_constant(vehicle);
    Uncertainty {
        turbine_share: std_dev_of(budget.turbine_torque_share),
        turbine_share_s: given.turbine_share_s,
        stiffness_fraction: std_dev_within(budget.shaft_stiffness_factor),
        backlash_n_m: budget.backlash_rad * line.shaft_stiffness_n_m_rad,
        valve_fraction: Real::hypot(lag, delay),
        valve_gain: std_dev_within(budget.valve_gain_factor),
        rate_s: given.valve_rate_s,
        friction: std_dev_within(budget.friction_factor),
        clutch_s: CLUTCH_S,
        offgoing_n_m: given.offgoing_n_m,
        offgoing_release_s: given.offgoing_release_s,
        load_shifting_n_m: budget.shaft_torque_n_m / quarter_swing_s.sqrt(),
        load_in_gear_n_m: LOAD_IN_GEAR * budget.shaft_torque_n_m / LOAD_IN_GEAR_S.sqrt(),
        wheel_scale: std_dev_of(budget.wheel_scale),
        wheel_delay_s: [-budget.channel_skew_s, budget.wheel_delay_s],
        skew_s: budget.channel_skew_s,
        scale_min: SCALE_MIN.min(std_dev_of(budget.wheel_scale)),
        delay_min_s: DELAY_MIN_S,
        output_least_rad_s: given.output_least_rad_s,
    }
}

/// The valve model of [`kalman_filter`] alone: the filter that believes no speed.
pub fn open_loop_maps(vehicle: &Vehicle) -> KalmanFilter<f64> {
    let mut filter = kalman_filter(vehicle, None);
    filter.uncertainty.output_least_rad_s = f64::INFINITY;
    filter
}

/// The extended Kalman filter in its textbook form, on six states with the wheel speed as an input: it takes its readings
/// to be of the moment.
pub fn extended_filter(vehicle: &Vehicle, sensors: Option<&Sensors>) -> ExtendedFilter<f64> {
    let readings = Readings { turbine_rad: 0.0, output_rad: 0.0, wheel_rad: 0.0 };
    ExtendedFilter { readings, ..aged_filter(vehicle, sensors) }
}

/// The unscented filter of this vehicle, with the same states and noises, and with the lag of the readings.
pub fn unscented_filter(vehicle: &Vehicle, sensors: Option<&Sensors>) -> UnscentedFilter<f64> {
    UnscentedFilter { filter: aged_filter(vehicle, sensors) }
}

fn aged_filter(vehicle: &Vehicle, sensors: Option<&Sensors>) -> ExtendedFilter<f64> {
    let (budget, given) = (&vehicle.error_bounds, &vehicle.settings.filter);
    let valve = ValveErrors::of(vehicle);
    let noise = FilterNoise {
        turbine_rad_s: std_dev_rad_s(sensors.map(|sensors| &sensors.turbine), budget.turbine_quantum_rad_s),
        output_rad_s: std_dev_rad_s(sensors.map(|sensors| &sensors.output), budget.output_quantum_rad_s),
        wheel_rad_s: std_dev_rad_s(sensors.map(|sensors| &sensors.wheel), budget.wheel_quantum_rad_s),
        turbine_share: given.turbine_share,
        turbine_share_s: given.turbine_share_s,
        twist_rate_rad_s: given.twist_rate_rad_s,
        output_least_rad_s: given.output_least_rad_s,
        valve_moving: fraction(std_dev_of(Real::hypot(valve.lag_pa_s, valve.delay_pa_s)), budget.shift_ramp_pa_s),
        valve_resting_per_s: fraction(std_dev_of(valve.gain_pa_s), shift_pressure(vehicle)),
        valve_rate_s: given.valve_rate_s,
        offgoing_n_m: given.offgoing_n_m,
        offgoing_release_s: given.offgoing_release_s,
    };
    let lag = |sensor: fn(&Sensors) -> &SpeedSensor| sensors.map_or(0.0, |sensors| lag_rad(sensor(sensors)));
    let readings = Readings {
        turbine_rad: lag(|sensors| &sensors.turbine),
        output_rad: lag(|sensors| &sensors.output),
        wheel_rad: lag(|sensors| &sensors.wheel),
    };
    ExtendedFilter::new(compliant_model(vehicle), noise, readings, tracker(vehicle))
}
