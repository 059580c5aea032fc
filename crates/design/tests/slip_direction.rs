//! Gains with backward slip.

use crate::common::{Car, observer};
use car::GainMethod;
use config::VehicleFile;
use design::{Model, compliant_observer, design_compliant, design_discrete, rigid_observer};
use observer::Phase;

/// With backward slip the clutch drives the turbine and not the output: `G` has the other sign, and so must have `L`.
#[test]
fn with_backward_slip_the_error_decays_as_with_forward_slip() {
    let vehicle = VehicleFile::built_in().unwrap().vehicle;
    let discrete = GainMethod::ALL[1..].iter().map(|method| {
        rigid_observer(&vehicle, design_discrete(&vehicle, Model::Rigid, *method, 0.01).unwrap().rigid_gains())
    });
    for observer in std::iter::once(observer()).chain(discrete) {
        let errors = |speeds| {
            let mut car = Car::start_at(observer, Phase::InertiaPhase, speeds, 0.1e6);
            let errors: Vec<f64> = (0..200).map(|_| car.step([0.0; 2])).collect();
            assert!(car.in_phase, "{speeds:?} {:?}", car.speeds);
            errors
        };
        let (forward, backward) = (errors([340.0, 300.0]), errors([200.0, -300.0]));
        // 20 ms of the valve alone leave 0.061 MPa.
        assert!(forward[199] < 0.060e6 && backward[199] < 0.060e6, "{} {}", forward[199], backward[199]);
        for (forward, backward) in forward.iter().zip(&backward) {
            // The same but for the discretisation of this test and the friction, which goes with the slip.
            assert!((forward - backward).abs() < 1.5e3, "{forward} {backward}");
        }
    }
}

/// The same of the compliant observer, of whose gain the pressure's row alone changes its sign.
#[test]
fn the_compliant_gain_is_mirrored_with_backward_slip() {
    let vehicle = VehicleFile::built_in().unwrap().vehicle;
    let design = design_compliant(&vehicle).unwrap();
    let model = compliant_observer(&vehicle, design.gains()).model;
    let gain = design.gains().inertia_phase;
    let product = |friction: f64| {
        let influence = model.influence(Phase::InertiaPhase, friction);
        let sign = friction.signum();
        let entry = |i: usize, j: usize| -> f64 {
            let row_sign = if i == 1 { sign } else { 1.0 };
            (0..3).map(|k| row_sign * gain[i][k] * influence[k][j]).sum()
        };
        [[entry(0, 0), entry(0, 1)], [entry(1, 0), entry(1, 1)]]
    };
    let ([[a, b], [c, d]], mirrored) = (product(0.13), product(-0.13));
    assert_eq!(mirrored, [[a, -b], [-c, d]]);
}
