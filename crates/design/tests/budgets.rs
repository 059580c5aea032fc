//! Error budgets with no entry and with one: none may panic a design.

use car::{ErrorBounds, GainMethod, Vehicle};
use config::VehicleFile;
use design::{
    Model, Quantity, design_discrete_phase, extended_filter, kalman_filter, super_twisting, unscented_filter,
};
use drivetrain::{ClutchValve, Table1, ValveMaps};
use observer::Phase;

/// A budget without errors. The supply still has a highest pressure.
fn without_errors(vehicle: &Vehicle) -> ErrorBounds {
    ErrorBounds {
        turbine_torque_n_m: 0.0,
        turbine_torque_share: 0.0,
        inertia_torque_n_m: 0.0,
        engine_torque_share: 0.0,
        pressure_pa: 0.0,
        mass_kg: 0.0,
        grade_rad: 0.0,
        shaft_torque_n_m: 0.0,
        output_torque_n_m: 0.0,
        offgoing_torque_n_m: 0.0,
        offgoing_drain_s: 0.0,
        turbine_quantum_rad_s: 0.0,
        output_quantum_rad_s: 0.0,
        slip_quantum_rad_s: 0.0,
        wheel_quantum_rad_s: 0.0,
        sampling_delay_s: 0.0,
        float32_rounding: 0.0,
        shift_pressure_pa: 0.0,
        shift_ramp_pa_s: 0.0,
        valve_lag_factor: [1.0; 2],
        valve_gain_factor: [1.0; 2],
        valve_delay_s: [0.0; 2],
        valve_hysteresis_pa: 0.0,
        command_age_s: 0.0,
        line_pressure_pa: [vehicle.error_bounds.pressure_max_pa; 2],
        fill: None,
        friction_factor: [1.0; 2],
        command: 0.0,
        slip_rad_s: 0.0,
        pressure_max_pa: vehicle.error_bounds.pressure_max_pa,
        wheel_scale: 0.0,
        wheel_delay_s: 0.0,
        channel_skew_s: 0.0,
        shaft_stiffness_factor: [1.0; 2],
        backlash_rad: 0.0,
    }
}

const SAMPLE_TIMES_S: [f64; 4] = [1e-4, 0.001, 0.01, 0.05];
const METHODS: [GainMethod; 4] =
    [GainMethod::IssDiscrete, GainMethod::PeakToPeak, GainMethod::Scheduled, GainMethod::Interval];

type Entry = (&'static str, fn(&mut ErrorBounds, &ErrorBounds));

/// Puts one entry back as the vehicle file has it; those that are weighed at a pressure or a ramp, with that.
const ENTRIES: [Entry; 22] = [
    ("turbine torque", |b, file| b.turbine_torque_n_m = file.turbine_torque_n_m),
    ("turbine share", |b, file| b.turbine_torque_share = file.turbine_torque_share),
    ("pressure", |b, file| b.pressure_pa = file.pressure_pa),
    ("mass", |b, file| (b.mass_kg, b.shaft_torque_n_m) = (file.mass_kg, file.shaft_torque_n_m)),
    ("grade", |b, file| b.grade_rad = file.grade_rad),
    ("shaft torque", |b, file| b.shaft_torque_n_m = file.shaft_torque_n_m),
    ("output torque", |b, file| b.output_torque_n_m = file.output_torque_n_m),
    ("offgoing torque", |b, file| b.offgoing_torque_n_m = file.offgoing_torque_n_m),
    ("offgoing drain", |b, file| b.offgoing_drain_s = file.offgoing_drain_s),
    ("turbine quantum", |b, file| b.turbine_quantum_rad_s = file.turbine_quantum_rad_s),
    ("output quantum", |b, file| b.output_quantum_rad_s = file.output_quantum_rad_s),
    ("slip quantum", |b, file| b.slip_quantum_rad_s = file.slip_quantum_rad_s),
    ("wheel quantum", |b, file| b.wheel_quantum_rad_s = file.wheel_quantum_rad_s),
    ("sampling delay", |b, file| {
        (b.sampling_delay_s, b.shift_ramp_pa_s) = (file.sampling_delay_s, file.shift_ramp_pa_s);
    }),
    ("rounding", |b, file| b.float32_rounding = file.float32_rounding),
    ("shift pressure", |b, file| b.shift_pressure_pa = file.shift_pressure_pa),
    ("shift ramp", |b, file| b.shift_ramp_pa_s = file.shift_ramp_pa_s),
    ("lag", |b, file| (b.valve_lag_factor, b.shift_ramp_pa_s) = (file.valve_lag_factor, file.shift_ramp_pa_s)),
    ("gain", |b, file| (b.valve_gain_factor, b.shift_pressure_pa) = (file.valve_gain_factor, file.shift_pressure_pa)),
    ("delay", |b, file| (b.valve_delay_s, b.shift_ramp_pa_s) = (file.valve_delay_s, file.shift_ramp_pa_s)),
    ("friction", |b, file| (b.friction_factor, b.shift_pressure_pa) = (file.friction_factor, file.shift_pressure_pa)),
    ("slip and current", |b, file| (b.slip_rad_s, b.command) = (file.slip_rad_s, file.command)),
];

/// The built-in car with a valve that is what the observers are told, so that nothing is left of its errors.
fn known_valve() -> Vehicle {
    let mut vehicle = VehicleFile::built_in().unwrap().vehicle;
    let drivetrain::Valve::Proportional { time_constant_s, gain_pa_a } = vehicle.settings.valve else { panic!() };
    vehicle.oncoming.valve = ClutchValve::Proportional(ValveMaps {
        time_constant_s: Table1::constant(time_constant_s),
        gain_pa_a: Table1::constant(gain_pa_a),
        delay_s: Table1::constant(0.0),
    });
    vehicle
}

/// Every method has a certificate whose numbers are numbers. Without optimisation phase, model, quantity and sample time
/// take turns; with it (`cargo test --release`) there are all of them, which takes two minutes.
fn designs_hold(vehicle: &Vehicle, turn: usize, name: &str) {
    let combinations = |phase| {
        [Model::Rigid, Model::Compliant].into_iter().flat_map(move |model| {
            [Quantity::ClutchTorque, Quantity::Pressure]
                .into_iter()
                .flat_map(move |quantity| SAMPLE_TIMES_S.map(|sample_time_s| (phase, model, quantity, sample_time_s)))
        })
    };
    let all: Vec<_> = [Phase::TorquePhase, Phase::InertiaPhase].into_iter().flat_map(combinations).collect();
    for (at, method) in METHODS.into_iter().enumerate() {
        // 7 and 32 have no common divisor: every combination comes.
        let one = 7 * (METHODS.len() * turn + at) % all.len();
        let taken = if cfg!(debug_assertions) { &all[one..=one] } else { &all[..] };
        for &(phase, model, quantity, sample_time_s) in taken {
            let case = format!("{name}, {method:?}, {model:?}, {quantity:?}, {phase:?}, {sample_time_s} s");
            let designed = design_discrete_phase(vehicle, model, method, quantity, phase, sample_time_s);
            let certificate = designed.unwrap_or_else(|error| panic!("{case}: {error}"));
            let numbers = certificate.gains.iter().flat_map(|gain| gain.normalised.iter().flatten().copied());
            let mut numbers = numbers.chain([certificate.bound_pa, certificate.best_gain_bound_pa]);
            assert!(numbers.all(f64::is_finite), "{case}: {certificate:?}");
            assert!(certificate.bound_pa <= certificate.open_loop_bound_pa, "{case}: {certificate:?}");
            assert!(certificate.margins.iter().all(|margin| margin.minimum >= 0.0), "{case}: {certificate:?}");
        }
    }
}

fn filters_are_finite(vehicle: &Vehicle, name: &str) {
    let (noise, unknown) = (extended_filter(vehicle, None).noise, kalman_filter(vehicle, None).uncertainty);
    let rates = super_twisting(vehicle).error_rate_rad_s3;
    let fractions = [unknown.valve_fraction, unknown.load_shifting_n_m, unknown.load_in_gear_n_m];
    let numbers = [&[noise.valve_moving, noise.valve_resting_per_s, rates[0], rates[1]][..], &fractions].concat();
    assert!(numbers.iter().all(|x| x.is_finite()), "{name}: {numbers:?}");
    let _ = unscented_filter(vehicle, None);
}

#[test]
fn without_errors_the_open_loop_serves_and_its_bound_is_zero() {
    let mut vehicle = known_valve();
    vehicle.error_bounds = without_errors(&vehicle);
    let method = GainMethod::PeakToPeak;
    let phase = Phase::InertiaPhase;
    let certificate =
        design_discrete_phase(&vehicle, Model::Rigid, method, Quantity::ClutchTorque, phase, 0.01).unwrap();
    // The valve's gain found by bisection is off in its last digits.
    assert!(certificate.uses_open_loop && certificate.bound_pa < 1e-6, "{certificate:?}");
}

#[test]
fn a_budget_without_errors_has_a_design() {
    for (turn, mut vehicle) in [VehicleFile::built_in().unwrap().vehicle, known_valve()].into_iter().enumerate() {
        vehicle.error_bounds = without_errors(&vehicle);
        filters_are_finite(&vehicle, "no entry");
        designs_hold(&vehicle, turn, "no entry");
    }
}

#[test]
fn a_budget_of_one_entry_has_a_design() {
    let file = VehicleFile::built_in().unwrap().vehicle;
    for (turn, (name, put)) in ENTRIES.into_iter().enumerate() {
        // A valve whose told gain is off leaves an error of its own.
        let mut vehicle = if turn % 2 == 0 { file.clone() } else { known_valve() };
        vehicle.error_bounds = without_errors(&vehicle);
        put(&mut vehicle.error_bounds, &file.error_bounds);
        filters_are_finite(&vehicle, name);
        designs_hold(&vehicle, turn, name);
    }
}
