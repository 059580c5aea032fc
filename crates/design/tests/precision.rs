//! Single precision beside double precision.

use crate::common::{Car, input, observer};
use car::GainMethod;
use config::VehicleFile;
use design::{
    Model, compliant_observer, design_compliant, design_discrete, inversion, kalman_filter, rigid_observer,
    super_twisting, unscented_filter,
};
use observer::{Estimator, Phase, Sample};

#[test]
fn single_precision_follows_double_precision() {
    let vehicle = VehicleFile::built_in().unwrap().vehicle;
    let compliant = compliant_observer(&vehicle, design_compliant(&vehicle).unwrap().gains());
    assert_single_follows_double(&observer(), &observer().cast::<f32>(), 1.0);
    assert_single_follows_double(&compliant, &compliant.cast::<f32>(), 1.0);
    // The certificates say how much rounding may cost.
    for method in &GainMethod::ALL[1..] {
        let design = design_discrete(&vehicle, Model::Rigid, *method, 0.01).unwrap();
        let observer = rigid_observer(&vehicle, design.rigid_gains());
        let rounding = design.inertia_phase.contributions.iter().find(|part| part.cause == "float32 rounding").unwrap();
        assert_single_follows_double(&observer, &observer.cast::<f32>(), rounding.bound_pa);
    }
    let (twisting, inverted) = (super_twisting(&vehicle), inversion(&vehicle));
    assert_single_follows_double(&twisting, &twisting.cast::<f32>(), 1.0);
    // These trust the speeds almost fully: a rounded speed, as an acceleration over 10 ms, is a torque of some 0.01 N m
    // and a pressure of some 20 Pa.
    let (filter, unscented) = (kalman_filter(&vehicle, None), unscented_filter(&vehicle, None));
    assert_single_follows_double(&inverted, &inverted.cast::<f32>(), 50.0);
    assert_single_follows_double(&filter, &filter.cast::<f32>(), 50.0);
    assert_single_follows_double(&unscented, &unscented.cast::<f32>(), 50.0);
}

/// A speed of 340 rad/s is rounded to 3e-5 rad/s, which a gain of 1527 Pa s/rad makes 0.05 Pa a sample;
/// pressures are rounded to 0.03 Pa.
fn assert_single_follows_double(double: &impl Estimator<f64>, single: &impl Estimator<f32>, tolerance_pa: f64) {
    let mut car = Car::start(Phase::InertiaPhase, 0.1e6);
    let shift = VehicleFile::built_in().unwrap().vehicle.shift;
    let (mut a, mut b) = (double.start(), single.start());
    for n in 0..500 {
        car.step([100.0, -200.0]);
        let dt = if n == 1 { 10.0 } else { 0.01 };
        let wheel_rad_s = (car.speeds[0] - 0.6 * car.speeds[1]) / 3.0;
        let x = Sample { wheel_rad_s, ..input(dt, car.speeds[0], car.speeds[1], car.command) };
        let y = Sample {
            dt_s: x.dt_s as f32,
            engine_rad_s: x.engine_rad_s as f32,
            turbine_rad_s: x.turbine_rad_s as f32,
            slip_rad_s: x.slip_rad_s as f32,
            wheel_rad_s: x.wheel_rad_s as f32,
            command: x.command as f32,
        };
        let (x, y) = (double.step(&mut a, &x.input(&shift)), single.step(&mut b, &y.input(&shift.cast())));
        assert_eq!(x.phase, y.phase);
        let difference = (x.pressure_pa - f64::from(y.pressure_pa)).abs();
        assert!(difference < tolerance_pa, "{n}: {} {}", x.pressure_pa, y.pressure_pa);
    }
}
