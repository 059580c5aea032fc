//! The two-speed gear train of the source chapter against its printed tables and closed forms.

use drivetrain::{Engagement, ReducedShift};
use geartrain::Gearbox;

use crate::describe::{described, shaft, two_speed};

/// The chapter's shift with this inertia of the output shaft, kg m^2.
fn chapter_shift(output_kg_m2: f64) -> ReducedShift<f64> {
    let mut diagram = two_speed();
    diagram.shafts[2] = shaft("carrier", output_kg_m2);
    Gearbox::new(&described(diagram)).unwrap().shift(0, 1).unwrap().reduced.unwrap()
}

/// Equal when `value` rounds to `printed` at the number of digits that were printed.
fn assert_printed(value: f64, printed: f64, digits: i32) {
    let half = 0.5 * 10f64.powi(-digits) * 1.0001;
    assert!((value - printed).abs() <= half, "{value} does not print as {printed}");
}

#[test]
fn chapter_rigid_coefficients_of_table_2_2() {
    let shift = chapter_shift(15.0);
    let both = shift.coefficients(Engagement::BothSlipping);
    assert_printed(both.turbine.per_turbine_torque, 15.52, 2);
    assert_printed(both.turbine.per_oncoming_torque, -25.85, 2);
    assert_printed(both.turbine.per_output_torque, -0.01, 2);
    let ring = |f: fn(&drivetrain::AccelerationRow<f64>) -> f64| f(&both.turbine) - f(&both.slip_oncoming);
    assert_printed(ring(|r| r.per_turbine_torque), -10.33, 2);
    assert_printed(ring(|r| r.per_oncoming_torque), 17.38, 2);
    assert_printed(ring(|r| r.per_output_torque), -0.10, 2);
    let first = shift.coefficients(Engagement::OffgoingStuck);
    assert_printed(first.turbine.per_turbine_torque, 0.4065, 4);
    assert_printed(first.turbine.per_oncoming_torque, -0.4065, 4);
    assert_printed(first.turbine.per_output_torque, -0.163, 3);
}

#[test]
fn chapter_compliant_coefficients_of_table_2_4() {
    let shift = chapter_shift(0.15);
    let both = shift.coefficients(Engagement::BothSlipping);
    assert_printed(both.turbine.per_turbine_torque, 15.69, 2);
    assert_printed(both.turbine.per_oncoming_torque, -24.51, 2);
    assert_printed(both.turbine.per_output_torque, -0.98, 2);
    let ring = |f: fn(&drivetrain::AccelerationRow<f64>) -> f64| f(&both.turbine) - f(&both.slip_oncoming);
    assert_printed(ring(|r| r.per_turbine_torque), -8.82, 2);
    assert_printed(ring(|r| r.per_oncoming_torque), 29.41, 2);
    assert_printed(ring(|r| r.per_output_torque), -8.82, 2);
    let first = shift.coefficients(Engagement::OffgoingStuck);
    assert_printed(first.turbine.per_turbine_torque, 11.90, 2);
    assert_printed(first.turbine.per_oncoming_torque, -11.90, 2);
    assert_printed(first.turbine.per_output_torque, -4.76, 2);
}

#[test]
fn coefficients_equal_the_closed_forms_of_eq_2_10() {
    let (it, ir, io, rg) = (0.06, 0.01, 0.15, 2.5);
    let d = rg * rg * it * ir + (rg - 1.0) * (rg - 1.0) * it * io + ir * io;
    let both = chapter_shift(io).coefficients(Engagement::BothSlipping);
    let row = |r: &drivetrain::AccelerationRow<f64>| {
        [r.per_turbine_torque, r.per_offgoing_torque, r.per_oncoming_torque, r.per_output_torque]
    };
    let turbine = [
        (rg * rg * ir + (rg - 1.0) * (rg - 1.0) * io) / d,
        -(rg - 1.0) * io / d,
        -rg * ((rg - 1.0) * io + rg * ir) / d,
        -rg * ir / d,
    ];
    let output = [
        rg * ir / d,
        rg * (rg - 1.0) * it / d,
        rg * ((rg - 1.0) * it - ir) / d,
        -((rg - 1.0) * (rg - 1.0) * it + ir) / d,
    ];
    let (found_turbine, found_output, found_slip) = (row(&both.turbine), row(&both.output), row(&both.slip_oncoming));
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12 * b.abs(), "{a} {b}");
    for i in 0..4 {
        near(found_turbine[i], turbine[i]);
        near(found_output[i], output[i]);
        // The slip of clutch B is the turbine's speed less the ring's: rg/(rg - 1) (w_t - w_0).
        near(found_slip[i], rg / (rg - 1.0) * (turbine[i] - output[i]));
    }
}

#[test]
fn gear_ratios_follow_from_tooth_counts() {
    let shift = chapter_shift(0.15);
    assert!((shift.ratio_offgoing() - 2.5).abs() < 1e-14);
    assert!((shift.ratio_oncoming() - 1.0).abs() < 1e-14);
}
