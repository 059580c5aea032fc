//! Designs against the chapter's numbers, the closed form, and random polytopes.

use car::{Experiment, GivenGains, ValveUncertainty, Vehicle};
use config::{ExperimentFile, VehicleFile};
use design::compliant::{CompliantRequirement, compliant_model, design_compliant_phase};
use design::rigid::design_phase;
use design::{
    Certificate, DesignError, IssRequirement, Polytope, Vertex, design_compliant, design_iss, design_rigid, rigid_model,
};
use observer::Phase;
use proptest::prelude::*;

fn vehicle() -> Vehicle {
    VehicleFile::built_in().unwrap().vehicle
}

fn requirement(kappa1_per_s: Option<f64>) -> IssRequirement {
    IssRequirement { kappa1_per_s, kappa2_per_s: 40.0, model_error_max_rad_s2: 1600.0, offset_max_pa: 1e9 }
}

fn chapter(phase: Phase, kappa1: f64) -> Certificate {
    design_phase(&vehicle(), phase, &requirement(Some(kappa1))).unwrap()
}

/// The references have five digits; the solver's reserve changes the sixth.
fn assert_five_digits(value: f64, reference: f64) {
    assert!((value / reference - 1.0).abs() < 1e-4, "{value} is not {reference}");
}

#[test]
fn chapter_inertia_phase_gain_and_offset() {
    let certificate = chapter(Phase::InertiaPhase, 15.0);
    assert_five_digits(certificate.gain_pa_s_rad[0], -783.7);
    assert_five_digits(certificate.gain_pa_s_rad[1], -1310.8);
    assert!((certificate.offset_pa - 0.0499e6).abs() < 50.0, "{}", certificate.offset_pa);
}

#[test]
fn chapter_inertia_phase_with_the_first_kappa1() {
    let certificate = chapter(Phase::InertiaPhase, 1.0);
    assert!((certificate.gain_pa_s_rad[0] + 418.0).abs() < 0.05);
    assert!((certificate.gain_pa_s_rad[1] + 699.1).abs() < 0.05);
    assert!((certificate.offset_pa - 0.103e6).abs() < 500.0);
}

#[test]
fn chapter_torque_phase_gain() {
    let certificate = chapter(Phase::TorquePhase, 15.0);
    assert!((certificate.gain_pa_s_rad[0] + 1.892e5).abs() < 0.0005e5, "{}", certificate.gain_pa_s_rad[0]);
    assert_eq!(certificate.gain_pa_s_rad[1], 0.0);
}

#[test]
fn the_loop_raises_kappa1_until_the_offset_is_acceptable() {
    let wanted = IssRequirement { offset_max_pa: 0.05e6, ..requirement(None) };
    let certificate = design_phase(&vehicle(), Phase::InertiaPhase, &wanted).unwrap();
    assert!(certificate.offset_pa <= 0.05e6);
    let one_less = chapter(Phase::InertiaPhase, certificate.kappa1_per_s - 1.0);
    assert!(one_less.offset_pa > 0.05e6);
}

#[test]
fn an_offset_below_the_minimum_reachable_names_that_requirement() {
    let wanted = IssRequirement { offset_max_pa: 0.04e6, ..requirement(None) };
    let error = design_phase(&vehicle(), Phase::InertiaPhase, &wanted).unwrap_err();
    let DesignError::OffsetUnreachable(missed) = error else { panic!("{error}") };
    // The minimum lies at kappa1 = kappa2 + A22 = 40 - 25.
    assert!((missed.kappa1_per_s - 15.0).abs() <= 1.0 && (missed.offset_pa - 0.0499e6).abs() < 50.0);
}

#[test]
fn a_missed_offset_says_who_requires_it_and_with_which_settling_time_it_can_be_had() {
    let wanted = IssRequirement { offset_max_pa: 0.04e6, ..requirement(None) };
    let DesignError::OffsetUnreachable(missed) = design_phase(&vehicle(), Phase::InertiaPhase, &wanted).unwrap_err()
    else {
        panic!("the offset is missed")
    };
    let text = missed.to_string();
    for part in [
        "inertia phase: `design.inertia_phase.offset_max_pa` of ",
        "requires an offset of at most 0.04000 MPa; with a settling time of 0.100 s the smallest offset of a certified gain is 0.0498",
        "the best certified gain: L = (",
        "hint: use a settling time of 0.1",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let offset = |time_s: f64| {
        let wanted = IssRequirement { kappa2_per_s: 4.0 / time_s, ..wanted };
        design::rigid::best_phase(&vehicle(), Phase::InertiaPhase, &wanted).unwrap().0.offset_pa
    };
    let reached = missed.reached_with_s.unwrap();
    // The last of six halvings of a step by the root of 2 is half a per cent.
    assert!(offset(reached) <= 0.04e6 && offset(reached / 1.006) > 0.04e6, "{reached} s");
}

#[test]
fn the_best_certified_gain_is_there_where_the_offset_is_missed() {
    let mut vehicle = vehicle();
    vehicle.requirements.torque_phase.model_error_max_rad_s2 = 84.5;
    let (design, missed) = design::best_rigid(&vehicle).unwrap();
    assert!(design.torque_phase.smallest_margin_per_s() >= 0.0 && design.torque_phase.offset_pa > 0.06e6);
    assert_eq!(missed.iter().map(|missed| missed.phase).collect::<Vec<_>>(), [Phase::TorquePhase]);
    assert!(design::design_rigid(&vehicle).is_err());
}

/// The chapter lowered its gains for 100 Hz because those of continuous time do not hold there by Euler's rule.
#[test]
fn given_gains_that_let_an_error_grow_are_found() {
    let vehicle = vehicle();
    for experiment in config::ExperimentFile::built_in().unwrap() {
        for entry in &experiment.observers {
            assert!(design::unstable_corners(&vehicle, entry).is_empty(), "{}", entry.name);
        }
    }
    let [_, _, e3, _] = config::ExperimentFile::built_in().unwrap();
    let mut entry = e3.experiment.observers.into_iter().find(|entry| entry.name == "ISS, Euler, lowered").unwrap();
    entry.gains =
        Some(car::GivenGains::Rigid { torque_phase_pa_s_rad: -1.892e5, inertia_phase_pa_s_rad: [-783.7, -1310.8] });
    assert!(design::unstable_corners(&vehicle, &entry).is_empty());
    // At the strong vertex of the inertia phase the error decays with 73/s: by Euler's rule it grows from 2/73 s on.
    for (sample_time_s, grows) in [(0.027, false), (0.028, true)] {
        entry.sample_time_s = sample_time_s;
        let corners = design::unstable_corners(&vehicle, &entry);
        let strong = corners.iter().any(|c| c.phase == Phase::InertiaPhase && c.label == "friction 0.16");
        assert_eq!(strong, grows, "{corners:?}");
    }
}

#[test]
fn vertices_on_both_sides_of_zero_are_infeasible() {
    let vertex = |g: f64| Vertex { label: String::new(), a22_per_s: -25.0, g_rad_s2_pa: [g, 2.0 * g] };
    let polytope = Polytope { vertices: vec![vertex(0.01), vertex(-0.01)] };
    let error = design_iss(&requirement(Some(15.0)), &polytope).unwrap_err();
    assert_eq!(error, DesignError::DecayUnreachable { decay_per_s: 55.0 });
}

#[test]
fn a_valve_that_is_fast_enough_alone_needs_no_gain() {
    let vertex = Vertex { label: String::new(), a22_per_s: -100.0, g_rad_s2_pa: [0.01, 0.0] };
    let certificate = design_iss(&requirement(Some(15.0)), &Polytope { vertices: vec![vertex] }).unwrap();
    assert_eq!((certificate.gain_pa_s_rad, certificate.offset_pa), ([0.0, 0.0], 0.0));
}

#[test]
fn a_varying_valve_adds_its_vertices() {
    let mut vehicle = vehicle();
    vehicle.settings.uncertainty.valve = ValveUncertainty::TimeConstant((0.02, 0.2));
    let certificate = design_phase(&vehicle, Phase::InertiaPhase, &requirement(Some(15.0))).unwrap();
    assert_eq!(certificate.vertices.len(), 4);
    // The slow valve asks for 55 - 5 = 50/s from the gain in place of 30/s.
    assert_five_digits(certificate.gain_pa_s_rad[0], -783.7 * 50.0 / 30.0);
}

proptest! {
    /// One scalar output: `|L| = (kappa1 + kappa2 + A22)/|G_min|`.
    #[test]
    fn prop_scalar_designs_have_the_closed_form(
        a22 in 1.0..30.0_f64, weak in 1e-4..1e-1_f64, ratio in 1.0..3.0_f64, kappa1 in 0.1..60.0_f64,
    ) {
        let vertex = |g: f64| Vertex { label: String::new(), a22_per_s: -a22, g_rad_s2_pa: [-g, 0.0] };
        let polytope = Polytope { vertices: vec![vertex(weak), vertex(weak * ratio)] };
        let certificate = design_iss(&requirement(Some(kappa1)), &polytope).unwrap();
        let expected = -(kappa1 + 40.0 - a22).max(0.0) / weak;
        prop_assert!((certificate.gain_pa_s_rad[0] - expected).abs() <= 1e-5 * expected.abs());
    }

    /// Two outputs and one vertex: the smallest gain lies along its influence, `L = -(kappa1 + kappa2 + A22) G/|G|^2`.
    #[test]
    fn prop_the_smallest_gain_lies_along_the_influence(
        a22 in 1.0..30.0_f64, size in 1e-4..1e-1_f64, angle in -3.1..3.1_f64, kappa1 in 0.1..60.0_f64,
    ) {
        let g = [size * angle.cos(), size * angle.sin()];
        let vertex = Vertex { label: String::new(), a22_per_s: -a22, g_rad_s2_pa: g };
        let certificate = design_iss(&requirement(Some(kappa1)), &Polytope { vertices: vec![vertex] }).unwrap();
        let needed = (kappa1 + 40.0 - a22) / size;
        for (gain, g) in certificate.gain_pa_s_rad.iter().zip(g) {
            // The solver finds the objective, which is flat across the influence, to some 1e-8.
            prop_assert!((gain - needed * g / size).abs() <= 1e-3 * needed, "{gain}");
        }
    }

    /// Vertices in a half plane are feasible, and the gain then holds at every one of them and inside.
    #[test]
    fn prop_random_polytopes_are_certified_and_hold_inside(
        corners in prop::collection::vec((5.0..40.0_f64, 1e-3..1e-1_f64, -0.7..0.7_f64), 1..6),
        weights in prop::collection::vec(0.01..1.0_f64, 6),
    ) {
        let vertices: Vec<Vertex> = corners.iter().map(|&(a22, size, angle)| Vertex {
            label: String::new(),
            a22_per_s: -a22,
            g_rad_s2_pa: [size * angle.cos(), size * angle.sin()],
        }).collect();
        let certificate = design_iss(&requirement(Some(10.0)), &Polytope { vertices: vertices.clone() }).unwrap();
        prop_assert!(certificate.smallest_margin_per_s() >= 0.0);
        let total: f64 = weights[..vertices.len()].iter().sum();
        let mix = |f: &dyn Fn(&Vertex) -> f64| vertices.iter().zip(&weights).map(|(v, w)| f(v) * w / total).sum::<f64>();
        let l = certificate.gain_pa_s_rad;
        let rate = mix(&|v| v.a22_per_s - l[0] * v.g_rad_s2_pa[0] - l[1] * v.g_rad_s2_pa[1]);
        prop_assert!(rate <= -50.0 + 1e-9);
    }
}

#[test]
fn chapter_compliant_torque_phase_gain_and_offset() {
    let wanted = CompliantRequirement {
        kappa1_per_s: Some(15.0),
        kappa2_per_s: 40.0,
        h: nalgebra::DMatrix::from_row_slice(2, 2, &[2.38, 0.0, 0.0, 0.13]),
        w_max: 1.0,
        offset_max_pa: 1e9,
    };
    let certificate = design_compliant_phase(&vehicle(), Phase::TorquePhase, &wanted).unwrap();
    let printed = [[-2.10, 30.0], [-6.46, -151.4]];
    for (row, expected) in certificate.gain_normalised.iter().zip(printed) {
        for (value, expected) in row.iter().zip(expected) {
            assert!((value - expected).abs() < 0.002 * expected.abs() + 0.005, "{value} {expected}");
        }
    }
    assert!((certificate.offset_normalised - 0.51).abs() < 0.005, "{}", certificate.offset_normalised);
}

#[test]
fn chapter_error_matrix_follows_from_a_turbine_torque_error_of_15_percent() {
    let h = design::compliant::error_matrix(&vehicle(), Phase::TorquePhase);
    assert!((h[(0, 0)] - 2.38).abs() < 0.005, "{h}");
    // Mass and grade: 1/(m R^2) (m g R sin 5 deg + 15 % of 800 N m) / 10 rad/s.
    let expected = (1500.0 * 9.806_65 * 0.3 * 0.0873_f64.sin() + 0.15 * 800.0) / 135.0 / 10.0;
    assert!((h[(1, 1)] / expected - 1.0).abs() < 1e-12 && h[(0, 1)] == 0.0);
    // In the inertia phase 20 N m act through C11 and C11 - C21 of Table 2.4.
    let h = design::compliant::error_matrix(&vehicle(), Phase::InertiaPhase);
    assert!((h[(0, 0)] - 0.2 * 15.69).abs() < 0.001 && (h[(1, 0)] - 0.2 * (15.69 + 8.82)).abs() < 0.002, "{h}");
    assert!((h[(2, 1)] / expected - 1.0).abs() < 1e-12);
    assert!([(0, 1), (1, 1), (2, 0)].iter().all(|&at| h[at] == 0.0));
}

#[test]
fn chapter_sliding_condition_of_eq_2_56() {
    let gains = design::design_sliding(&vehicle());
    let [first, second] = gains.inertia_speed_rad_s2;
    // The chapter prints 1920 and 3180; its bounds are not given, ours come within 1.5 %.
    assert!((first / 1920.0 - 1.0).abs() < 0.015 && (second / 3180.0 - 1.0).abs() < 0.015, "{first} {second}");
    assert!(gains.inertia_pressure_pa_s.iter().all(|&gain| gain < 0.0) && gains.torque_pressure_pa_s < 0.0);
}

#[test]
fn sliding_gains_add_the_decay_that_the_settling_time_asks_for() {
    let vehicle = vehicle();
    let (gains, model) = (design::design_sliding(&vehicle), design::rigid_model(&vehicle));
    let g = model.influence(Phase::InertiaPhase, 0.10);
    let [ks1, ks2] = gains.inertia_speed_rad_s2;
    let [ks3, ks4] = gains.inertia_pressure_pa_s;
    let added = ks3 * g[0] / ks1 + ks4 * g[1] / ks2;
    // 4/0.1 s, of which the valve gives 25/s.
    assert!((added - 15.0).abs() < 1e-9, "{added}");
}

/// Largest eigenvalue of `[a b; b d]`.
fn largest_of_two(a: f64, b: f64, d: f64) -> f64 {
    0.5 * (a + d) + (0.5 * (a - d)).hypot(b)
}

/// Two states and two causes of error: both eigenvalue problems of the certificate have closed forms.
#[test]
fn a_compliant_certificate_is_what_the_closed_forms_say() {
    let vehicle = vehicle();
    let (model, design) = (compliant_model(&vehicle), design_compliant(&vehicle).unwrap());
    let (weak, strong) = vehicle.settings.uncertainty.friction;
    let a22 = model.rigid.valve.linear(0.0, 0.0).a22_per_s;
    for (phase, outputs) in [(Phase::TorquePhase, &[0, 2][..]), (Phase::InertiaPhase, &[0, 1, 2][..])] {
        let certificate = design.of(phase).unwrap();
        let l = &certificate.gain_normalised;
        assert_eq!(certificate.vertices.len(), 2);
        for (vertex, friction) in certificate.vertices.iter().zip([weak, strong]) {
            // In units of 1000 N m, 0.1 MPa, 100 rad/s and, of the wheel, 10 rad/s.
            let g = model.influence(phase, friction);
            let lg = |i: usize, j: usize| -> f64 {
                let part = |(k, &output): (usize, &usize)| l[i][k] * g[output][j] / [100.0, 100.0, 10.0][output];
                [1e3, 1e5][j] * outputs.iter().enumerate().map(part).sum::<f64>()
            };
            let decay = -largest_of_two(-lg(0, 0), -0.5 * (lg(0, 1) + lg(1, 0)), a22 - lg(1, 1));
            assert!((vertex.decay_per_s / decay - 1.0).abs() < 1e-9, "{phase:?}: {} {decay}", vertex.decay_per_s);
            let margin = decay - certificate.kappa1_per_s - certificate.kappa2_per_s;
            assert!((vertex.margin_per_s - margin).abs() < 1e-6 && margin >= 0.0);
        }
        let h = &certificate.h_normalised;
        let lh = |i: usize, cause: usize| l[i].iter().zip(h).map(|(l, row)| l * row[cause]).sum::<f64>();
        let square = |a: usize, b: usize| lh(0, a) * lh(0, b) + lh(1, a) * lh(1, b);
        let size = largest_of_two(square(0, 0), square(0, 1), square(1, 1)).sqrt();
        // Both causes may be at their limit at once.
        let offset = 2.0_f64.sqrt() * size / (4.0 * certificate.kappa1_per_s * certificate.kappa2_per_s).sqrt();
        assert!((certificate.offset_normalised / offset - 1.0).abs() < 1e-9);
        assert!((certificate.offset_pa - 1e5 * offset).abs() < 1e-3);
    }
}

fn given_gains(experiment: &Experiment, name: &str) -> GivenGains {
    experiment.observers.iter().find(|entry| entry.name == name).unwrap().gains.unwrap()
}

#[test]
fn chapter_gains_of_the_sliding_observer_are_those_of_e3() {
    let [_, _, e3, _] = &ExperimentFile::built_in().unwrap();
    let expected = GivenGains::Sliding {
        torque_speed_rad_s2: 100.0,
        torque_pressure_pa_s: -7.5e6,
        inertia_speed_rad_s2: [2000.0, 3200.0],
        inertia_pressure_pa_s: [-4.2e6, -7.0e6],
    };
    assert_eq!(given_gains(e3, "Sliding, continuous gains"), expected);
}

#[test]
fn chapter_gains_of_the_compliant_observer_are_those_of_e4() {
    let [_, _, _, e4] = &ExperimentFile::built_in().unwrap();
    let torque = [[-2.08, 30.49], [-6.46, -152.48]];
    let inertia = [[-0.023, 0.22, 56.9], [-1.74, -0.23, 1.73]];
    assert_eq!(given_gains(e4, "compliant, chapter's gains"), GivenGains::CompliantNormalised(torque, inertia));
}

/// The inequalities (2.50) at the vertices of backward slip, for the gain that the observer uses there.
#[test]
fn the_certificate_holds_for_backward_slip_too() {
    let vehicle = vehicle();
    for phase in [Phase::TorquePhase, Phase::InertiaPhase] {
        let certificate = design_rigid(&vehicle).unwrap().of(phase).unwrap().clone();
        let model = rigid_model(&vehicle);
        let (minimum, maximum) = vehicle.settings.uncertainty.friction;
        for (friction, vertex) in [minimum, maximum].into_iter().zip(&certificate.vertices) {
            // The direction of the slip goes with the friction.
            let backward = model.influence(phase, -friction);
            let gain = certificate.gain_pa_s_rad.map(|l| -l);
            let decay = gain[0] * backward[0] + gain[1] * backward[1] - vertex.vertex.a22_per_s;
            assert!((decay - vertex.decay_per_s).abs() < 1e-9 * decay && vertex.margin_per_s >= 0.0, "{phase:?}");
        }
    }
}
