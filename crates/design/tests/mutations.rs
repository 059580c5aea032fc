//! Vehicle files with one thing changed that are accepted: their designs are made or refused, their observers run.

#[path = "../../config/tests/common/mod.rs"]
mod common;

use car::{GainMethod, Vehicle};
use config::{Source, VehicleFile};
use design::{
    Model, Quantity, best_compliant, best_rigid, bounded, compliant_observer, design_discrete_phase, design_sliding,
    extended_filter, inversion, kalman_filter, rigid_observer, sliding_observer, super_twisting, unscented_filter,
};
use observer::{Estimator, Phase, RigidGains, Sample, one_shift_filter};

/// A few samples through a shift; every estimate must be a number.
fn runs(observer: &impl Estimator<f64>, vehicle: &Vehicle, name: &str) {
    let mut state = observer.start();
    for n in 0..40_u32 {
        let turned = (f64::from(n) * 0.3).sin();
        let input = Sample {
            dt_s: 0.01,
            engine_rad_s: 420.0,
            turbine_rad_s: 330.0 - 3.0 * f64::from(n),
            slip_rad_s: 190.0 - 6.0 * f64::from(n),
            wheel_rad_s: 45.0 + turned,
            command: vehicle.settings.command_max * (0.3 + 0.2 * turned),
        };
        let estimate = observer.step(&mut state, &input.input(&vehicle.shift));
        assert!(estimate.pressure_pa.is_finite() && estimate.clutch_torque_n_m.is_finite(), "{name}: {n} {estimate:?}");
    }
}

fn observers_run(vehicle: &Vehicle, name: &str) {
    runs(&bounded(vehicle, rigid_observer(vehicle, RigidGains::open_loop())), vehicle, name);
    runs(&sliding_observer(vehicle, design_sliding(vehicle)), vehicle, name);
    runs(&super_twisting(vehicle), vehicle, name);
    runs(&inversion(vehicle), vehicle, name);
    runs(&kalman_filter(vehicle, None), vehicle, name);
    runs(&one_shift_filter(vehicle, None), vehicle, name);
    runs(&extended_filter(vehicle, None), vehicle, name);
    runs(&unscented_filter(vehicle, None), vehicle, name);
}

fn designs_are_made_or_refused(vehicle: &Vehicle, name: &str) {
    if let Ok((design, missed)) = best_rigid(vehicle) {
        assert!(design.torque_phase.smallest_margin_per_s() >= 0.0, "{name}");
        assert!(missed.iter().all(|missed| missed.to_string().contains("hint:")), "{name}");
        runs(&rigid_observer(vehicle, design.gains()), vehicle, name);
    }
    if let Ok((design, _)) = best_compliant(vehicle) {
        runs(&compliant_observer(vehicle, design.gains()), vehicle, name);
    }
}

#[test]
fn an_accepted_vehicle_stops_no_design_and_no_observer() {
    // Without optimisation a part of them; with it (`cargo test --release`) all.
    let (some, few) = if cfg!(debug_assertions) { (19, 199) } else { (1, 5) };
    let accepted = common::mutations(common::VEHICLE).into_iter().filter_map(|(name, text)| {
        let vehicle = VehicleFile::from_source(Source::built_in("v.toml", &text)).ok()?;
        Some((name, vehicle))
    });
    for (n, (name, vehicle)) in accepted.enumerate() {
        observers_run(&vehicle, &name);
        if n % some == 0 {
            designs_are_made_or_refused(&vehicle, &name);
        }
        if n % few == 0 {
            for method in GainMethod::ALL {
                for phase in [Phase::TorquePhase, Phase::InertiaPhase] {
                    for model in [Model::Rigid, Model::Compliant] {
                        let _ = design_discrete_phase(&vehicle, model, method, Quantity::ClutchTorque, phase, 0.01);
                    }
                }
            }
        }
    }
}
