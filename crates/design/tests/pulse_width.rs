//! The rigid observer of a car with pulse-width valves.

use crate::common::input;
use car::ValveUncertainty;
use config::VehicleFile;
use design::{design_rigid, rigid_observer};
use drivetrain::{PulseWidth, Valve};
use observer::{RigidGains, SampleEstimator};

/// The valve of Remark 2.1, linearised along its own way, is the nonlinear law itself where nothing else is wrong.
#[test]
fn the_open_loop_of_a_pulse_width_valve_is_its_law() {
    let mut vehicle = VehicleFile::built_in().unwrap().vehicle;
    let law = PulseWidth { flow_sqrt_pa_s: 6000.0, line_pressure_pa: 1e6 };
    vehicle.settings.valve = Valve::PulseWidth(law);
    vehicle.settings.command_max = 100.0;
    let observer = rigid_observer(&vehicle, RigidGains::open_loop());
    let mut state = observer.start_sample();
    let (mut truth, mut last) = (0.0_f64, 0.0);
    for n in 0..200 {
        let estimate = observer.step_sample(&mut state, &input(0.01, 300.0, 300.0, last));
        assert!((truth - estimate.pressure_pa).abs() < 20.0, "{n}: {truth} {}", estimate.pressure_pa);
        // Fill, ramp, hold, release.
        last = [30.0, 30.0 + f64::from(n) * 0.2, 40.0, 0.0][n as usize / 50];
        observer.step_sample(&mut state, &input(0.0, 300.0, 300.0, last));
        for _ in 0..1000 {
            truth += 1e-5 * law.pressure_rate(truth, law.settled_pressure(last));
        }
    }
}

#[test]
fn a_pulse_width_valve_adds_its_operating_points_as_vertices() {
    let mut vehicle = VehicleFile::built_in().unwrap().vehicle;
    let law = PulseWidth { flow_sqrt_pa_s: 12e3, line_pressure_pa: 1e6 };
    vehicle.settings.valve = Valve::PulseWidth(law);
    vehicle.settings.uncertainty.valve = ValveUncertainty::PressureDrop((0.0, 0.09e6));
    vehicle.requirements.torque_phase.offset_max_pa = 1e6;
    vehicle.requirements.inertia_phase.offset_max_pa = 1e6;
    let certificate = design_rigid(&vehicle).unwrap().inertia_phase;
    let mut a22: Vec<f64> = certificate.vertices.iter().map(|vertex| vertex.vertex.a22_per_s).collect();
    a22.dedup();
    assert_eq!(certificate.vertices.len(), 4);
    let expected = [-12e3 / PulseWidth::<f64>::LAMINAR_DROP_PA.sqrt(), -12e3 / (2.0 * 0.09e6_f64.sqrt())];
    assert!(a22.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9 * b.abs()), "{a22:?} {expected:?}");
}
