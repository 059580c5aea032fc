//! The observers' models against balances of power that are written down apart from them.
//!
//! Along any virtual motion `(w_t, w_0)` the torques do what the kinetic energy takes up: `T_t w_t - T_out w_0 -
//! T_cb dw = w' M a`. With both clutches slipping that holds along both motions; a clutch that sticks leaves one, along
//! which it does nothing.

use drivetrain::{Clutch, Converter, Driveline, ReducedShift, RoadLoad, Table1, Valve};
use observer::{CompliantModel, Phase, RigidModel};

/// The two-speed set with a sun of 40 and a ring of 60 teeth, and an output inertia of 0.15 kg m^2.
fn shift() -> ReducedShift<f64> {
    let (g, it, ir, io) = (2.0 / 3.0, 0.06, 0.01, OUTPUT_INERTIA);
    let off = -ir * g * (1.0 + g);
    ReducedShift {
        mass_kg_m2: [[it + g * g * ir, off], [off, io + (1.0 + g) * (1.0 + g) * ir]],
        slip_offgoing: [g, -(1.0 + g)],
        slip_oncoming: [1.0 + g, -(1.0 + g)],
    }
}

const OUTPUT_INERTIA: f64 = 0.15;
const FIRST_GEAR: f64 = 2.5;

fn rigid() -> RigidModel<f64> {
    let table = |x: &[f64], y: &[f64]| Table1::new(x, y).unwrap();
    RigidModel::new(
        shift(),
        OUTPUT_INERTIA,
        Converter {
            capacity_n_m_s2: table(&[0.0, 0.9, 1.0, 1.5], &[4e-3, 2e-3, 0.0, -2e-3]),
            torque_ratio: table(&[0.0, 0.9, 1.0], &[2.0, 1.0, 1.0]),
        },
        Clutch {
            mean_radius_m: 0.13,
            friction_faces: 3.0,
            piston_area_m2: 0.01,
            return_spring_n: 600.0,
            friction: table(&[0.0, 400.0], &[0.12, 0.16]),
            static_friction: 0.17,
        },
        Valve::Proportional { time_constant_s: 0.04, gain_pa_a: 1e6 },
        RoadLoad {
            mass_kg: 1500.0,
            wheel_radius_m: 0.3,
            front_area_m2: 2.0,
            drag_coefficient: 0.4,
            air_density_kg_m3: 1.25,
            rolling_moment_n_m: 60.0,
            grade_rad: 0.0,
        },
        Driveline {
            final_ratio: 3.0,
            shaft_stiffness_n_m_rad: 13e3,
            shaft_damping_n_m_s_rad: 20.0,
            wheel_inertia_kg_m2: 2.0,
        },
    )
}

const ENGINE: f64 = 380.0;
/// Pressures of clutch B, Pa: two, so that neither of `F` and `G z` makes up for the other.
const PRESSURES: [f64; 2] = [0.1e6, 0.3e6];

/// Torque of clutch B on its output side at a positive slip, N m.
fn clutch_torque(pressure: f64, slip: f64) -> f64 {
    (0.12 + 0.04 * slip / 400.0) * 0.13 * 3.0 * (0.01 * pressure - 600.0)
}

/// Turbine torque, N m, from the maps of [`rigid`] at a speed ratio between 0 and 0.9.
fn turbine_torque(turbine: f64) -> f64 {
    let fraction = turbine / ENGINE / 0.9;
    (4e-3 - 2e-3 * fraction) * (2.0 - fraction) * ENGINE * ENGINE
}

/// Slip of clutch B in first gear, where the output turns with the turbine over the ratio.
fn first_gear_slip(turbine: f64) -> f64 {
    shift().oncoming_slip(turbine, turbine / FIRST_GEAR)
}

/// What is left of the power along a motion when the kinetic energy has taken its part, W, for a mass matrix.
fn unbalanced(mass: [[f64; 2]; 2], motion: [f64; 2], rates: [f64; 2], torques: [f64; 3]) -> f64 {
    let [turbine, output, oncoming] = torques;
    let given = turbine * motion[0] - output * motion[1] - oncoming * shift().oncoming_slip(motion[0], motion[1]);
    given - (0..2).map(|i| motion[i] * (mass[i][0] * rates[0] + mass[i][1] * rates[1])).sum::<f64>()
}

/// Power, W, that rounding may leave of torques of some 100 N m.
const ROUNDING: f64 = 1e-8;

/// What the rigid model leaves of the power along a motion, W.
fn rigid_unbalanced(pressure: f64, phase: Phase, turbine: f64, slip: f64, motion: [f64; 2]) -> f64 {
    let model = rigid().speed_model(phase, ENGINE, turbine, slip);
    let rate = |i: usize| model.free_rad_s2[i] + model.per_pressure_rad_s2_pa[i] * pressure;
    let output = shift().output_speed(turbine, slip);
    let rates = match phase {
        Phase::InertiaPhase => [rate(0), shift().output_speed(rate(0), rate(1))],
        _ => [rate(0), rate(0) / FIRST_GEAR],
    };
    // The vehicle, m R^2/i^2, stands in place of the output shaft's inertia.
    let mut mass = shift().mass_kg_m2;
    mass[1][1] += 1500.0 * 0.09 / 9.0 - OUTPUT_INERTIA;
    let load = 60.0 / 3.0 + 0.5 * 0.027 * output * output / 27.0;
    unbalanced(mass, motion, rates, [turbine_torque(turbine), load, clutch_torque(pressure, slip)])
}

#[test]
fn the_rigid_model_balances_its_power_in_the_inertia_phase() {
    for (pressure, (turbine, slip)) in PRESSURES.into_iter().zip([(330.0, 280.0), (200.0, 40.0)]) {
        for motion in [[1.0, 0.0], [0.0, 1.0]] {
            let left = rigid_unbalanced(pressure, Phase::InertiaPhase, turbine, slip, motion);
            assert!(left.abs() < ROUNDING, "{motion:?}: {left} W");
        }
    }
}

#[test]
fn the_rigid_model_balances_its_power_in_the_torque_phase() {
    for (pressure, turbine) in PRESSURES.into_iter().zip([330.0, 200.0]) {
        let slip = first_gear_slip(turbine);
        let left = rigid_unbalanced(pressure, Phase::TorquePhase, turbine, slip, [FIRST_GEAR, 1.0]);
        assert!(left.abs() < ROUNDING, "{left} W");
    }
}

#[test]
fn the_slip_is_an_output_in_the_inertia_phase_alone() {
    let [torque, inertia] =
        [Phase::TorquePhase, Phase::InertiaPhase].map(|phase| rigid().speed_model(phase, ENGINE, 300.0, 300.0));
    assert_eq!((torque.free_rad_s2[1], torque.per_pressure_rad_s2_pa[1]), (0.0, 0.0));
    assert!(inertia.free_rad_s2[1] != 0.0 && inertia.per_pressure_rad_s2_pa[1] != 0.0);
}

const SHAFT: f64 = 600.0;
const WHEEL: f64 = 45.0;

fn compliant() -> CompliantModel<f64> {
    CompliantModel::new(rigid(), shift())
}

/// Accelerations of turbine, slip and wheel by the compliant model.
fn compliant_rates(pressure: f64, phase: Phase, turbine: f64, slip: f64) -> [f64; 3] {
    let model = compliant().speed_model(phase, ENGINE, turbine, slip, WHEEL);
    core::array::from_fn(|i| {
        let [per_shaft, per_pressure] = model.influence[i];
        model.free_rad_s2[i] + per_shaft * SHAFT + per_pressure * pressure
    })
}

#[test]
fn the_compliant_model_balances_its_power_in_the_inertia_phase() {
    for (pressure, (turbine, slip)) in PRESSURES.into_iter().zip([(330.0, 280.0), (200.0, 40.0)]) {
        let [a_t, a_slip, _] = compliant_rates(pressure, Phase::InertiaPhase, turbine, slip);
        let rates = [a_t, shift().output_speed(a_t, a_slip)];
        let torques = [turbine_torque(turbine), SHAFT / 3.0, clutch_torque(pressure, slip)];
        for motion in [[1.0, 0.0], [0.0, 1.0]] {
            let left = unbalanced(shift().mass_kg_m2, motion, rates, torques);
            assert!(left.abs() < ROUNDING, "{motion:?}: {left} W");
        }
    }
}

#[test]
fn the_compliant_model_balances_its_power_in_the_torque_phase() {
    for (pressure, turbine) in PRESSURES.into_iter().zip([330.0, 200.0]) {
        let slip = first_gear_slip(turbine);
        let [a_t, a_slip, _] = compliant_rates(pressure, Phase::TorquePhase, turbine, slip);
        let torques = [turbine_torque(turbine), SHAFT / 3.0, clutch_torque(pressure, slip)];
        let left = unbalanced(shift().mass_kg_m2, [FIRST_GEAR, 1.0], [a_t, a_t / FIRST_GEAR], torques);
        assert!(left.abs() < ROUNDING, "{left} W");
        assert_eq!(a_slip, 0.0);
    }
}

#[test]
fn shaft_torque_less_road_load_accelerates_the_vehicle_at_the_wheel() {
    let load = 60.0 + 0.5 * 0.027 * WHEEL * WHEEL;
    for phase in [Phase::TorquePhase, Phase::InertiaPhase] {
        let [_, _, wheel] = compliant_rates(PRESSURES[0], phase, 300.0, 300.0);
        assert!((wheel - (SHAFT - load) / (1500.0 * 0.09)).abs() < 1e-9);
    }
}

#[test]
fn the_shaft_torque_changes_with_the_rate_of_twist() {
    let output = 150.0;
    let slip = shift().oncoming_slip(300.0, output);
    // 13 kN m/rad times the output through the final ratio less the wheel.
    let expected = 13e3 * (output / 3.0 - WHEEL);
    assert!((compliant().shaft_rate(300.0, slip, WHEEL) - expected).abs() < 1e-6);
}
