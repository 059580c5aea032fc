//! Designs for a sample time: bounds that hold, and what they depend on.

use config::VehicleFile;

use super::*;

const SAMPLE_S: f64 = 0.01;
const METHODS: [GainMethod; 4] =
    [GainMethod::IssDiscrete, GainMethod::PeakToPeak, GainMethod::Scheduled, GainMethod::Interval];

fn vehicle() -> Vehicle {
    VehicleFile::built_in().expect("the built-in vehicle is valid").vehicle
}

fn inertia(method: GainMethod, model: Model) -> DiscreteCertificate {
    let quantity = Quantity::ClutchTorque;
    design_discrete_phase(&vehicle(), model, method, quantity, Phase::InertiaPhase, SAMPLE_S).unwrap()
}

/// Scalar output: `f(a) = (v + c a)/(1 - Phi + a)` with `a = L G_min Psi` is monotone, so the best is either the
/// open loop or the largest gain that still pays at the strong vertex.
#[test]
fn with_one_output_the_design_is_open_loop_exactly_where_the_closed_form_says() {
    let mut vehicle = vehicle();
    let phase = Phase::TorquePhase;
    for (delay_s, pays) in [(0.0, false), (0.03, false), (5.0, true)] {
        vehicle.error_bounds.valve_delay_s[1] = delay_s;
        let system = ErrorSystem::of(&vehicle, Model::Rigid, Quantity::ClutchTorque, phase, SAMPLE_S);
        let weak = &system.corners[0];
        let c = weak.columns.abs().sum() / weak.g_psi[0].abs();
        let valve = weak.direct_columns.abs().sum();
        assert_eq!(c * (1.0 - weak.phi[0]) < valve, pays, "the closed form itself");
        let certificate = design_discrete_phase(
            &vehicle,
            Model::Rigid,
            GainMethod::PeakToPeak,
            Quantity::ClutchTorque,
            phase,
            SAMPLE_S,
        )
        .unwrap();
        assert_eq!(certificate.uses_open_loop, !pays, "{certificate:?}");
        assert!(certificate.bound_pa <= certificate.open_loop_bound_pa);
    }
}

/// With one state the bound has a closed form, and no gain on a grid around and far from the design has a smaller
/// one.
#[test]
fn no_gain_of_a_grid_search_beats_the_rigid_design() {
    let system = ErrorSystem::of(&vehicle(), Model::Rigid, Quantity::ClutchTorque, Phase::InertiaPhase, SAMPLE_S);
    let bound = |gain: &DMatrix<f64>| {
        let reading = system.last_reading(gain);
        let at_corner = |corner: &system::Corner| {
            let contraction = (corner.phi[0] - (gain * &corner.g_psi)[0]).abs();
            let of_readings = (1.0 - corner.phi[0] + (gain * &corner.g_psi)[0]) * reading;
            let disturbed = of_readings + (gain * &corner.columns).abs().sum() + corner.direct_columns.abs().sum();
            if contraction < 1.0 { disturbed / (1.0 - contraction) } else { f64::INFINITY }
        };
        PRESSURE_UNIT_PA * (reading + system.corners.iter().map(at_corner).fold(0.0, f64::max))
    };
    let certificate = inertia(GainMethod::PeakToPeak, Model::Rigid);
    assert!(!certificate.uses_open_loop);
    let designed = DMatrix::from_row_slice(1, 2, &certificate.gains[0].normalised[0]);
    // What the reserve of the program costs, and one `lambda` for all corners.
    assert!(certificate.bound_pa >= bound(&designed) && certificate.bound_pa < 1.003 * bound(&designed));
    for i in -60..=60 {
        for j in -60..=60 {
            let gain = DMatrix::from_row_slice(1, 2, &[0.2 * f64::from(i), 0.2 * f64::from(j)]);
            assert!(bound(&gain) >= bound(&designed) * (1.0 - 3e-3), "{gain}");
        }
    }
}

#[test]
fn each_method_is_as_good_as_its_freedom_allows() {
    for model in [Model::Rigid, Model::Compliant] {
        let [iss, peak, scheduled, interval] = METHODS.map(|method| inertia(method, model).best_gain_bound_pa);
        assert!(scheduled < 0.99 * peak, "{model:?}: following the friction pays: {scheduled} {peak}");
        assert!(peak < interval && interval < iss, "{model:?}: {peak} {interval} {iss}");
    }
}

/// Friction over time, as fractions of its range: held anywhere, or elsewhere from sample to sample; each sample at most `step`
/// from the one before.
fn frictions(step: f64) -> Vec<Vec<f64>> {
    let held = [0.0, 0.25, 0.5, 0.75, 1.0].map(|fraction| vec![fraction; SAMPLES]);
    let alternating = [1, 2, 3, 7].map(|n| (0..SAMPLES).map(|k| if (k / n) % 2 == 0 { 0.0 } else { 1.0 }).collect());
    let wandering = (0..SAMPLES).map(|k| (0.618 * k as f64).fract()).collect();
    let wanted = held.into_iter().chain(alternating).chain([wandering]);
    let reached = |wanted: Vec<f64>| {
        let mut fraction = wanted[0];
        let next = wanted.into_iter().map(|wanted| {
            fraction += (wanted - fraction).clamp(-step, step);
            fraction
        });
        next.collect()
    };
    wanted.map(reached).collect()
}

/// Samples of an adversary.
const SAMPLES: usize = 1500;

/// The largest error of the normalised pressure that an adversary who knows the gain reaches: friction over time as given, every
/// error at its bound with the sign that hurts most at the end, every reading within its bound. Backwards in time.
fn worst_error(system: &ErrorSystem, gain: &dyn Fn(usize) -> DMatrix<f64>, fractions: &[f64]) -> f64 {
    let states = system.states();
    let mixed = |a: &DMatrix<f64>, b: &DMatrix<f64>, fraction: f64| a * (1.0 - fraction) + b * fraction;
    let [weak, strong] = &system.corners[..] else { panic!("two corners") };
    let mut response = DMatrix::zeros(1, states);
    response[(0, states - 1)] = 1.0;
    let mut sum = 0.0;
    // How the reading at the end of a step shows in what came after it.
    let mut later = DMatrix::zeros(1, system.h.nrows());
    for &fraction in fractions {
        let gain = mixed(&gain(0), &gain(1), fraction);
        let a = mixed(&weak.phi, &strong.phi, fraction) - &gain * mixed(&weak.g_psi, &strong.g_psi, fraction);
        let through = mixed(&weak.columns, &strong.columns, fraction);
        let of_gain = &response * &gain;
        sum += ((&later - &of_gain) * &system.readings).abs().sum();
        sum += (&of_gain * through).abs().sum() + (&response * &weak.direct_columns).abs().sum();
        later = of_gain;
        response *= a;
    }
    sum + (later * &system.readings).abs().sum()
}

/// At 100 Hz, 200 Hz and 1 kHz; without optimisation a part of the cases.
#[test]
fn no_adversary_exceeds_the_bound() {
    let vehicle = vehicle();
    let cases = [Model::Rigid, Model::Compliant].into_iter().flat_map(|m| METHODS.map(|method| (m, method)));
    let cases: Vec<_> = cases.flat_map(|(m, method)| [0.01, 0.005, 0.001].map(|s| (m, method, s))).collect();
    let some = if cfg!(debug_assertions) { 5 } else { 1 };
    for (model, method, sample_s) in cases.into_iter().step_by(some) {
        let quantity = Quantity::ClutchTorque;
        let phase = Phase::InertiaPhase;
        let certificate = design_discrete_phase(&vehicle, model, method, quantity, phase, sample_s).unwrap();
        let system = ErrorSystem::of(&vehicle, model, quantity, phase, sample_s);
        let gain = |end: usize| {
            let rows = &certificate.end(end).normalised;
            DMatrix::from_fn(rows.len(), rows[0].len(), |i, j| rows[i][j])
        };
        // Only a gain that follows the friction depends on how fast that changes.
        let step = if method == GainMethod::Scheduled { system.friction_step } else { 1.0 };
        let worst = |fractions: Vec<f64>| worst_error(&system, &gain, &fractions);
        let largest = frictions(step).into_iter().map(worst).fold(0.0, f64::max);
        let bound = certificate.bound_pa / PRESSURE_UNIT_PA;
        let case = format!("{model:?} {method:?} {sample_s} s");
        assert!(largest <= bound * (1.0 + 1e-9), "{case}: {largest} beyond {bound}");
        let parts: f64 = certificate.contributions.iter().map(|part| part.bound_pa).sum();
        assert!(parts <= certificate.bound_pa * (1.0 + 1e-9) && parts > 0.5 * certificate.bound_pa, "{case}: {parts}");
        if [GainMethod::PeakToPeak, GainMethod::Scheduled].contains(&method) {
            assert!(largest > 0.98 * bound, "{case}: an adversary comes as far as {largest} of {bound}");
        }
    }
}

/// The bound of the readings' noise does not grow with the sample rate: more samples in the same time do no harm.
#[test]
fn a_higher_sample_rate_does_not_raise_the_bound() {
    for method in [GainMethod::IssDiscrete, GainMethod::PeakToPeak, GainMethod::Interval] {
        let bound = |sample_s| {
            let (quantity, phase) = (Quantity::ClutchTorque, Phase::InertiaPhase);
            design_discrete_phase(&vehicle(), Model::Rigid, method, quantity, phase, sample_s)
                .unwrap()
                .best_gain_bound_pa
        };
        let bounds = [0.01, 0.005, 0.001].map(bound);
        assert!(bounds.windows(2).all(|pair| pair[1] < pair[0]), "{method:?}: {bounds:?}");
    }
}

#[test]
fn an_interval_gain_keeps_the_sign_of_an_error() {
    for model in [Model::Rigid, Model::Compliant] {
        let certificate = inertia(GainMethod::Interval, model);
        let system = ErrorSystem::of(&vehicle(), model, Quantity::ClutchTorque, Phase::InertiaPhase, SAMPLE_S);
        let rows = &certificate.gains[0].normalised;
        let gain = DMatrix::from_fn(rows.len(), rows[0].len(), |i, j| rows[i][j]);
        for corner in &system.corners {
            assert!((&corner.phi - &gain * &corner.g_psi).min() >= 0.0, "{model:?} {}", corner.label);
        }
    }
}

type Change<'a> = (&'a str, &'a dyn Fn(&mut car::ErrorBounds));

#[test]
fn every_entry_of_the_budget_is_in_a_bound() {
    let nominal = inertia(GainMethod::PeakToPeak, Model::Rigid);
    let bound_with = |change: &dyn Fn(&mut car::ErrorBounds)| {
        let mut vehicle = vehicle();
        change(&mut vehicle.error_bounds);
        let (model, method, quantity) = (Model::Rigid, GainMethod::PeakToPeak, Quantity::ClutchTorque);
        let of = |phase| design_discrete_phase(&vehicle, model, method, quantity, phase, SAMPLE_S).unwrap();
        of(Phase::InertiaPhase).best_gain_bound_pa
    };
    let changes: [Change<'_>; 9] = [
        ("turbine torque", &|b| b.turbine_torque_n_m *= 2.0),
        ("offgoing", &|b| b.offgoing_torque_n_m *= 2.0),
        ("friction", &|b| b.friction_factor = [0.6, 1.4]),
        ("lag", &|b| b.valve_lag_factor[1] = 2.0),
        ("gain", &|b| b.valve_gain_factor[0] = 0.7),
        ("delay", &|b| b.valve_delay_s[1] *= 2.0),
        // A gain on the turbine speed alone, to which the design turns, does without the slip.
        ("quanta", &|b| (b.turbine_quantum_rad_s, b.slip_quantum_rad_s) = (7.0, 17.0)),
        ("sampling delay", &|b| b.sampling_delay_s *= 2.0),
        ("float32", &|b| b.float32_rounding *= 1e3),
    ];
    for (name, change) in changes {
        assert!(bound_with(change) > 1.001 * nominal.best_gain_bound_pa, "{name}");
    }
    // The load hardly shows in the inertia phase; it does in a gain on the wheel's speed.
    let iss = |change: &dyn Fn(&mut car::ErrorBounds)| {
        let mut vehicle = vehicle();
        change(&mut vehicle.error_bounds);
        let quantity = Quantity::ClutchTorque;
        let (model, method, phase) = (Model::Compliant, GainMethod::IssDiscrete, Phase::TorquePhase);
        design_discrete_phase(&vehicle, model, method, quantity, phase, SAMPLE_S).unwrap().best_gain_bound_pa
    };
    let base = iss(&|_| ());
    let loads: [&dyn Fn(&mut car::ErrorBounds); 3] =
        [&|b| b.mass_kg *= 2.0, &|b| b.grade_rad *= 2.0, &|b| b.wheel_quantum_rad_s *= 2.0];
    assert!(loads.iter().all(|change| iss(change) > 1.001 * base));
}
