//! Certificates of the rigid observer in simulation.

use std::sync::Mutex;

use crate::common::sampled::{Disturbance, SampledCar, disturbance};
use crate::common::{Car, DISCRETISATION_PA, DT_S};
use car::GainMethod;
use config::VehicleFile;
use design::{DiscreteDesign, Model, design_discrete, design_rigid};
use observer::Phase;
use proptest::prelude::*;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Theorem 2.1 in simulation: from any initial error, under any error of the model within its bound.
    #[test]
    fn prop_the_certified_bound_holds_in_simulation(
        inertia in any::<bool>(),
        initial in -0.2e6..0.2e6_f64,
        errors in prop::collection::vec((0.0..1.0_f64, 0.0..6.3_f64), 15),
    ) {
        let vehicle = VehicleFile::built_in().unwrap().vehicle;
        let design = design_rigid(&vehicle).unwrap();
        let phase = if inertia { Phase::InertiaPhase } else { Phase::TorquePhase };
        let certificate = design.of(phase).unwrap();
        let mut car = Car::start(phase, initial);
        let mut held = 0;
        for n in 0..1500_u32 {
            let (size, angle) = errors[n as usize / 100];
            let w = size * certificate.model_error_max_rad_s2;
            // In the torque phase only the turbine speed is an output.
            let w = if inertia { [w * angle.cos(), w * angle.sin()] } else { [w * angle.cos(), 0.0] };
            let error = car.step(w);
            if !car.in_phase {
                break;
            }
            let bound = certificate.error_bound_pa(initial, f64::from(n + 1) * DT_S);
            prop_assert!(error.abs() <= bound + DISCRETISATION_PA, "{n}: {error} Pa, bound {bound} Pa");
            held += 1;
        }
        // With every error against it from the start the turbine is back in first gear, where clutch A grips, in 10 ms.
        prop_assert!(held >= if inertia { 100 } else { 1500 }, "held for {held} samples only");
    }
}

/// Sample times of the designs below, s.
const SAMPLE_TIMES_S: [f64; 3] = [0.01, 0.005, 0.001];

/// The rigid design by this method for one of [`SAMPLE_TIMES_S`]; each is made once.
fn designed(method: GainMethod, sample_time: usize) -> DiscreteDesign {
    type Designs = Mutex<Vec<((GainMethod, usize), DiscreteDesign)>>;
    static DESIGNS: Designs = Mutex::new(Vec::new());
    let mut designs = DESIGNS.lock().unwrap();
    let key = (method, sample_time);
    if let Some((_, design)) = designs.iter().find(|(of, _)| *of == key) {
        return design.clone();
    }
    let vehicle = VehicleFile::built_in().unwrap().vehicle;
    let design = design_discrete(&vehicle, Model::Rigid, method, SAMPLE_TIMES_S[sample_time]).unwrap();
    designs.push((key, design.clone()));
    design
}

/// The built-in car in this phase, with the rigid observer by this method.
fn errors(
    inertia: bool,
    method: GainMethod,
    sample_time: usize,
    initial_pa: f64,
    disturbances: &[Disturbance],
) -> Vec<[f64; 2]> {
    let vehicle = VehicleFile::built_in().unwrap().vehicle;
    let gains = designed(method, sample_time).rigid_gains();
    let phase = if inertia { Phase::InertiaPhase } else { Phase::TorquePhase };
    let speeds = if inertia { [340.0, 300.0] } else { [360.0, 360.0] };
    SampledCar { vehicle: &vehicle, gains, phase, sample_time_s: SAMPLE_TIMES_S[sample_time], command: 0.25, speeds }
        .errors(initial_pa, disturbances)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    /// The certificates for a sample time in simulation: whatever torques, readings and valve do within their bounds, the
    /// error stays below what is left of the first one and the certified bound.
    #[test]
    fn prop_the_sampled_bound_holds_in_simulation(
        inertia in any::<bool>(),
        method in prop::sample::select(GainMethod::ALL[1..].to_vec()),
        sample_time in 0..SAMPLE_TIMES_S.len(),
        initial_pa in -0.2e6..0.2e6_f64,
        disturbances in prop::collection::vec(disturbance(), 60),
    ) {
        let design = designed(method, sample_time);
        let certificate = if inertia { &design.inertia_phase } else { &design.torque_phase };
        let errors = errors(inertia, method, sample_time, initial_pa, &disturbances);
        for &[error, left] in &errors {
            // One pascal for rounding.
            prop_assert!(error <= left + certificate.bound_pa + 1.0, "{error} > {left} + {}", certificate.bound_pa);
        }
        // With every error at its limit and of the worst sign the inertia phase is over after 7 samples of 10 ms.
        let minimum = if inertia { (0.07 / SAMPLE_TIMES_S[sample_time]) as usize } else { 60 };
        prop_assert!(errors.len() >= minimum.min(60), "held for {} samples only", errors.len());
    }
}

/// Readings that turn from one end of their bound to the other at every sample, with and without all the rest at its limit.
#[test]
fn the_sampled_bound_holds_with_the_worst_noise() {
    for (sample_time, every) in (0..SAMPLE_TIMES_S.len()).flat_map(|t| [1, 2, 5].map(|every| (t, every))) {
        for (rest, sign) in [(0.0, 1.0), (1.0, 1.0), (1.0, -1.0)] {
            let disturbances = (0..60).map(|n| {
                let reading = if (n / every) % 2 == 0 { sign } else { -sign };
                Disturbance { turbine: rest, output: rest, readings: [reading; 2], age: -rest, valve: -rest }
            });
            let disturbances: Vec<_> = disturbances.collect();
            let bound = designed(GainMethod::PeakToPeak, sample_time).inertia_phase.bound_pa;
            let errors = errors(true, GainMethod::PeakToPeak, sample_time, 0.0, &disturbances);
            let largest = errors.iter().map(|[error, _]| *error).fold(0.0, f64::max);
            assert!(errors.len() >= 7 && largest <= bound + 1.0, "{sample_time} {every}: {largest} {bound}");
        }
    }
}

#[test]
fn without_model_error_the_estimate_decays_at_least_with_kappa2() {
    for phase in [Phase::TorquePhase, Phase::InertiaPhase] {
        let vehicle = VehicleFile::built_in().unwrap().vehicle;
        let kappa2 = design_rigid(&vehicle).unwrap().of(phase).unwrap().kappa2_per_s;
        let mut car = Car::start(phase, 0.1e6);
        for n in 1..=1000 {
            let bound = 0.1e6 * (-kappa2 * f64::from(n) * DT_S).exp();
            let error = car.step([0.0; 2]);
            assert!(car.in_phase, "{n}");
            assert!(error.abs() <= bound + DISCRETISATION_PA, "{n}: {error} Pa, bound {bound} Pa");
        }
    }
}
