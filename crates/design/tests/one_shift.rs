//! Certificates for the shifts of gearboxes, in simulation: oncoming elements whose torque has the sign of the turbine's or the other one.

use std::sync::Mutex;

use crate::common::sampled::{Disturbance, SampledCar, disturbance};
use car::{GainMethod, Vehicle};
use design::{DiscreteDesign, Model, Quantity, design_discrete, design_discrete_phase};
use drivetrain::Valve;
use observer::Phase;
use proptest::prelude::*;

const SAMPLE_TIME_S: f64 = 0.01;

/// Vehicle file, shift, sign of `alpha` of the oncoming element.
const SHIFTS: [(&str, &str, f64); 6] = [
    ("eight_speed", "1-2", 1.0),
    ("eight_speed", "2-3", -1.0),
    ("eight_speed", "6-7", -1.0),
    ("eight_speed", "7-8", 1.0),
    ("six_speed", "4-5", -1.0),
    ("six_speed", "5-6", -1.0),
];
const METHODS: [GainMethod; 2] = [GainMethod::Interval, GainMethod::IssDiscrete];

fn vehicle((file, shift, sign): (&str, &str, f64)) -> Vehicle {
    let path = format!("{}/../../vehicles/{file}.toml", env!("CARGO_MANIFEST_DIR"));
    let car = config::CarFile::read(path.as_ref()).unwrap().car;
    let vehicle = car.of_shift(car.shift_named(shift).unwrap()).unwrap();
    assert!(sign * vehicle.shift.slip_oncoming[0] > 0.0, "{file} {shift}");
    vehicle
}

/// The rigid design of one of [`SHIFTS`]; each is made once.
fn designed(shift: usize, method: GainMethod) -> (Vehicle, DiscreteDesign) {
    type Designs = Mutex<Vec<((usize, GainMethod), (Vehicle, DiscreteDesign))>>;
    static DESIGNS: Designs = Mutex::new(Vec::new());
    let mut designs = DESIGNS.lock().unwrap();
    if let Some((_, found)) = designs.iter().find(|(of, _)| *of == (shift, method)) {
        return found.clone();
    }
    let vehicle = vehicle(SHIFTS[shift]);
    let design = design_discrete(&vehicle, Model::Rigid, method, SAMPLE_TIME_S).unwrap();
    designs.push(((shift, method), (vehicle.clone(), design.clone())));
    (vehicle, design)
}

/// The car in this phase at the pressure of a shift: in the inertia phase half way.
fn car(vehicle: &Vehicle, design: &DiscreteDesign, phase: Phase) -> impl Fn(f64, &[Disturbance]) -> Vec<[f64; 2]> {
    let shift = vehicle.shift;
    let (off, on) = (shift.ratio_offgoing(), shift.ratio_oncoming());
    let turbine = 340.0;
    let ratio = if phase == Phase::InertiaPhase { 0.5 * (off + on) } else { off };
    let speeds = [turbine, shift.oncoming_slip(turbine, turbine / ratio)];
    let Valve::Proportional { gain_pa_a, .. } = vehicle.settings.valve else { panic!() };
    let kiss_pa = vehicle.oncoming.clutch.kiss_pressure();
    let command = (kiss_pa + vehicle.error_bounds.shift_pressure_pa) / gain_pa_a;
    let (vehicle, gains) = (vehicle.clone(), design.rigid_gains());
    move |initial_pa, disturbances| {
        SampledCar { vehicle: &vehicle, gains, phase, sample_time_s: SAMPLE_TIME_S, command, speeds }
            .errors(initial_pa, disturbances)
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    /// Whatever torques, readings and valve do within the budget of the car, the error stays below what is left of the first one and the
    /// certified bound.
    #[test]
    fn prop_the_bound_of_a_shift_of_a_gearbox_holds_in_simulation(
        shift in 0..SHIFTS.len(),
        inertia in any::<bool>(),
        method in prop::sample::select(METHODS.to_vec()),
        initial_fraction in -1.0..1.0_f64,
        disturbances in prop::collection::vec(disturbance(), 60),
    ) {
        let (vehicle, design) = designed(shift, method);
        let (phase, certificate) = match inertia {
            true => (Phase::InertiaPhase, &design.inertia_phase),
            false => (Phase::TorquePhase, &design.torque_phase),
        };
        let initial_pa = initial_fraction * vehicle.error_bounds.shift_pressure_pa;
        let errors = car(&vehicle, &design, phase)(initial_pa, &disturbances);
        for &[error, left] in &errors {
            // One pascal for rounding.
            prop_assert!(error <= left + certificate.bound_pa + 1.0, "{error} > {left} + {}", certificate.bound_pa);
        }
        // With every error of one sign, and the first one as large as the pressure, the inertia phase of 7-8 is over after 3 samples.
        prop_assert!(errors.len() >= 3, "held for {} samples only", errors.len());
    }
}

/// With every error at its limit and of the worst sign the error comes near the bound: it is not far above what happens.
#[test]
fn the_worst_errors_of_the_budget_come_near_the_bound() {
    for (shift, phase) in (0..SHIFTS.len()).flat_map(|s| [Phase::TorquePhase, Phase::InertiaPhase].map(|p| (s, p))) {
        let (vehicle, design) = designed(shift, GainMethod::Interval);
        let certificate = if phase == Phase::InertiaPhase { &design.inertia_phase } else { &design.torque_phase };
        let car = car(&vehicle, &design, phase);
        let largest =
            [1.0, -1.0].into_iter().flat_map(|valve| [1.0, -1.0].map(|rest| (valve, rest))).map(|(valve, rest)| {
                let all = |_| Disturbance { turbine: rest, output: rest, readings: [0.0; 2], age: rest, valve };
                let disturbances: Vec<_> = (0..60).map(all).collect();
                car(0.0, &disturbances).iter().map(|[error, _]| *error).fold(0.0, f64::max)
            });
        let largest = largest.fold(0.0, f64::max);
        assert!((0.3..=1.0 + 1e-9).contains(&(largest / certificate.bound_pa)), "{:?} {phase:?}", SHIFTS[shift]);
    }
}

/// The sides of an element are a matter of the file: taken the other way round, its torque and its slip change their signs and the bounds do not.
#[test]
fn the_bound_does_not_depend_on_the_sign_of_alpha() {
    for shift in [SHIFTS[1], SHIFTS[3]] {
        let vehicle = vehicle(shift);
        let mut mirrored = vehicle.clone();
        mirrored.shift.slip_oncoming = vehicle.shift.slip_oncoming.map(|slip| -slip);
        for (model, method) in [
            (Model::Rigid, GainMethod::Interval),
            (Model::Rigid, GainMethod::IssDiscrete),
            (Model::Compliant, GainMethod::Interval),
            (Model::Compliant, GainMethod::IssDiscrete),
        ] {
            let design = |vehicle: &Vehicle| {
                let phase = Phase::InertiaPhase;
                design_discrete_phase(vehicle, model, method, Quantity::ClutchTorque, phase, SAMPLE_TIME_S).unwrap()
            };
            let (own, other) = (design(&vehicle), design(&mirrored));
            assert!((own.open_loop_bound_pa / other.open_loop_bound_pa - 1.0).abs() < 1e-12);
            // The search for the best gain of an interval ends within 0.5 %.
            let change = own.best_gain_bound_pa / other.best_gain_bound_pa - 1.0;
            assert!(change.abs() < 0.01, "{shift:?} {model:?} {method:?}: {change}");
        }
    }
}

/// What is not known of the car is in the bound.
#[test]
fn the_errors_of_the_car_are_in_the_bound() {
    const C: usize = 2;
    let bounds = |change: fn(&mut car::Car)| {
        let mut car = config::CarFile::eight_speed().unwrap().car;
        change(&mut car);
        let vehicle = car.of_shift(car.shift_named("2-3").unwrap()).unwrap();
        let phase = Phase::InertiaPhase;
        let method = GainMethod::Interval;
        let found = design_discrete_phase(&vehicle, Model::Rigid, method, Quantity::ClutchTorque, phase, SAMPLE_TIME_S)
            .unwrap();
        [found.open_loop_bound_pa, found.best_gain_bound_pa]
    };
    let [open_loop, gain] = bounds(|_| {});
    // What the valve model knows less well makes the open loop worse, what the speeds show less well the gain alone.
    assert!(bounds(|car| car.error_bounds.elements[C].friction_factor = Some([0.7, 1.3]))[0] > 1.1 * open_loop);
    assert!(bounds(|car| car.error_bounds.elements[C].valve_gain_factor = Some([0.8, 1.2]))[0] > 1.1 * open_loop);
    for change in [
        |car: &mut car::Car| car.error_bounds.inertia_share = Some(0.05),
        |car: &mut car::Car| car.error_bounds.converter_share = Some(0.02),
    ] {
        let [alone, better] = bounds(change);
        assert!(alone == open_loop && better < 0.99 * gain, "{better} {gain}");
    }
}
