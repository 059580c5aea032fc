//! The longest step over which the speeds may correct an estimate follows from the certificate of the car.

use car::{GainMethod, ObserverEntry, ObserverKind, SAMPLE_TIMES_S, Vehicle};
use config::{ExperimentFile, VehicleFile};
use design::{
    Model, design_compliant, design_discrete, design_rigid, longest_stable_step_s, longest_step_of, rigid_model,
};
use observer::{Discretisation, Phase};

fn vehicle() -> Vehicle {
    VehicleFile::built_in().unwrap().vehicle
}

/// What a gain on `(w_t, dw)` multiplies an error by over a step in the inertia phase, at this friction.
fn factor(vehicle: &Vehicle, gain: [f64; 2], friction: f64, step_s: f64) -> f64 {
    let model = rigid_model(vehicle);
    let a22 = model.valve.linear(0.0, 0.0).a22_per_s;
    let influence = model.influence(Phase::InertiaPhase, friction);
    let phi = (a22 * step_s).exp();
    phi - (gain[0] * influence[0] + gain[1] * influence[1]) * (phi - 1.0) / a22
}

#[test]
fn up_to_the_longest_step_an_error_decays_as_the_certificate_says_and_beyond_it_does_not() {
    let vehicle = vehicle();
    let certificate = design_rigid(&vehicle).unwrap().inertia_phase;
    let longest_s = certificate.longest_step_s(&vehicle, Phase::InertiaPhase, Discretisation::Exact);
    let decays = |step_s: f64| {
        let left = (-certificate.kappa2_per_s * step_s).exp();
        [0.10, 0.13, 0.16].iter().all(|&mu| factor(&vehicle, certificate.gain_pa_s_rad, mu, step_s).abs() <= left)
    };
    assert!((1..=100).all(|k| decays(0.01 * f64::from(k) * longest_s)), "{longest_s}");
    assert!(!decays(1.002 * longest_s), "{longest_s}");
}

#[test]
fn up_to_the_longest_step_a_sampled_gain_contracts_as_it_does_over_its_sample() {
    let vehicle = vehicle();
    for sample_s in [0.01, 0.001] {
        let design = design_discrete(&vehicle, Model::Rigid, GainMethod::IssDiscrete, sample_s).unwrap();
        let gain = design.rigid_gains().ends[0].inertia_phase_pa_s_rad;
        let rho = (-4.0 / vehicle.requirements.inertia_phase.settling_time_s * sample_s).exp();
        let longest_s = design.inertia_phase.longest_step_s;
        let contracts = |step_s: f64| [0.10, 0.16].iter().all(|&mu| factor(&vehicle, gain, mu, step_s).abs() <= rho);
        assert!(
            longest_s >= sample_s
                && (0..=100).all(|k| contracts(sample_s + 0.01 * f64::from(k) * (longest_s - sample_s)))
        );
        assert!(longest_s == *SAMPLE_TIMES_S.end() || !contracts(1.002 * longest_s), "{longest_s}");
        // In the torque phase the design is the open loop, which corrects nothing.
        assert!(design.torque_phase.uses_open_loop && design.longest_step_s() == longest_s);
    }
}

#[test]
fn the_longest_step_is_that_of_the_car() {
    let (car, mut grippy) = (vehicle(), vehicle());
    grippy.settings.uncertainty.friction.1 = 0.22;
    let longest = |vehicle: &Vehicle| {
        let rigid = design_rigid(vehicle).unwrap().longest_step_s(vehicle, Discretisation::Exact);
        let compliant = design_compliant(vehicle).unwrap().longest_step_s(vehicle, Discretisation::Exact);
        [rigid, compliant]
    };
    let ([rigid, compliant], [grippy_rigid, grippy_compliant]) = (longest(&car), longest(&grippy));
    assert!(
        grippy_rigid < 0.9 * rigid && grippy_compliant < compliant,
        "{rigid} {grippy_rigid} {compliant} {grippy_compliant}"
    );
    // Euler's rule goes wrong sooner.
    assert!(design_rigid(&car).unwrap().longest_step_s(&car, Discretisation::Euler) < rigid);
}

fn entry(kind: ObserverKind) -> ObserverEntry {
    let [_, _, e3, _] = ExperimentFile::built_in().unwrap();
    let mut entry = e3.experiment.observers.into_iter().find(|entry| entry.name == "ISS, Euler, lowered").unwrap();
    (entry.kind, entry.method, entry.gains) = (kind, GainMethod::Iss, None);
    (entry.discretisation, entry.sample_time_s) = (Discretisation::Exact, 0.01);
    entry
}

#[test]
fn an_observer_of_an_experiment_has_the_step_of_its_gains() {
    let vehicle = vehicle();
    let mut rigid = entry(ObserverKind::Rigid);
    let designed = design_rigid(&vehicle).unwrap();
    let of = |entry: &ObserverEntry| longest_step_of(&vehicle, entry).unwrap();
    assert_eq!(of(&rigid), Some(designed.longest_step_s(&vehicle, Discretisation::Exact)));
    assert_eq!(of(&entry(ObserverKind::Sliding)), None);
    assert_eq!(longest_stable_step_s(&vehicle, &rigid), None, "its gains are not given");
    // Given gains have no certificate. By Euler's rule the strong vertex with 73/s is unstable from 2/73 s on.
    rigid.gains =
        Some(car::GivenGains::Rigid { torque_phase_pa_s_rad: -1.892e5, inertia_phase_pa_s_rad: [-783.7, -1310.8] });
    rigid.discretisation = Discretisation::Euler;
    assert!((of(&rigid).unwrap() * 73.0 / 2.0 - 1.0).abs() < 2e-3, "{:?}", of(&rigid));
}
