//! The effect of the pressure, and of each error of the budget, on the speeds in each phase.
//!
//! Near an operating point the accelerations are `dy/dt = F + G p + sum of columns times errors`. An error whose column
//! is parallel to `G` has the same effect as a pressure: no observer of these speeds can distinguish them, with any gain.
//! The equivalent pressure error is the least-squares solution, the error of an observer that uses the speeds alone. An
//! observer that uses the valve model alone has the error of the valve model.

use car::Vehicle;
use design::budget::{grade_n_m, mass_n_m};
use design::compliant::compliant_model;
use design::rigid_model;
use design::{ValveErrors, shift_time_constant};
use drivetrain::Real;
use nalgebra::DVector;
use observer::Phase;
use serde::Serialize;

use crate::campaign::PHASES;

/// Which speeds and states a model has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum View {
    /// Turbine speed (and slip), vehicle rigid behind the gearbox.
    Rigid,
    /// The same speeds with the shaft torque known from the twist of the shafts.
    ShaftKnown,
}

impl View {
    /// For tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rigid => "rigid: turbine speed and slip",
            Self::ShaftKnown => "with the shaft torque known",
        }
    }
}

/// What one error does.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ErrorEffect {
    /// The error.
    pub error: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Its bound in the vehicle file, in that unit.
    pub bound: f64,
    /// Equivalent pressure error, Pa per unit.
    pub pressure_pa_per_unit: f64,
    /// Equivalent clutch torque error, N m per unit.
    pub clutch_n_m_per_unit: f64,
    /// Angle between its column and that of the pressure, degrees; near zero no observer can distinguish them. None
    /// if there is only one speed, where every error is equivalent to a pressure, and for an error without weight.
    pub angle_deg: Option<f64>,
}

impl ErrorEffect {
    /// The bound for people.
    pub fn bound_text(&self) -> String {
        if self.bound.abs() < 1e-3 {
            return format!("{:.1e}", self.bound);
        }
        format!("{:.3}", self.bound).trim_end_matches('0').trim_end_matches('.').to_owned()
    }
}

/// One phase seen by one model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PhaseSensitivity {
    /// The phase.
    pub phase: &'static str,
    /// The model.
    pub view: View,
    /// How strongly the accelerations answer the pressure, rad/s^2 per MPa.
    pub influence_rad_s2_mpa: f64,
    /// The errors.
    pub effects: Vec<ErrorEffect>,
}

/// What the speeds can tell in each phase, by this vehicle's models and error bounds.
pub fn sensitivity(vehicle: &Vehicle) -> Vec<PhaseSensitivity> {
    PHASES.into_iter().flat_map(|phase| [rigid(vehicle, phase), shaft_known(vehicle, phase)]).collect()
}

/// An error: name, unit, bound, its column in the accelerations of turbine and slip.
type Column = (&'static str, &'static str, f64, [f64; 2]);

fn rigid(vehicle: &Vehicle, phase: Phase) -> PhaseSensitivity {
    let model = rigid_model(vehicle);
    let rows = model.coefficients(phase);
    let (t, d, bounds) = (&rows.turbine, &rows.slip_oncoming, &vehicle.error_bounds);
    let pressure = model.influence(phase, friction(vehicle));
    let mut columns: Vec<Column> =
        vec![("turbine torque", "N m", bounds.turbine_torque_n_m, [t.per_turbine_torque, d.per_turbine_torque])];
    let output = [t.per_output_torque, d.per_output_torque];
    let final_ratio = vehicle.driveline.final_ratio;
    for (error, n_m) in [
        ("mass", mass_n_m(vehicle) / final_ratio),
        ("grade", grade_n_m(vehicle) / final_ratio),
        ("shaft torsion, tyre slip", bounds.output_torque_n_m),
    ] {
        columns.push((error, "N m at the output", n_m, output));
    }
    columns.extend(common(vehicle, phase, pressure, [t.per_offgoing_torque, d.per_offgoing_torque]));
    evaluate(vehicle, phase, View::Rigid, pressure, &columns)
}

fn shaft_known(vehicle: &Vehicle, phase: Phase) -> PhaseSensitivity {
    let model = compliant_model(vehicle);
    let rows = match phase {
        Phase::InertiaPhase => &model.inertia_phase,
        _ => &model.torque_phase,
    };
    let (t, d, bounds) = (&rows.turbine, &rows.slip_oncoming, &vehicle.error_bounds);
    let influence = model.influence(phase, friction(vehicle));
    let pressure = [influence[0][1], influence[1][1]];
    let final_ratio = vehicle.driveline.final_ratio;
    let shaft = [t.per_output_torque / final_ratio, d.per_output_torque / final_ratio];
    // Before the shift the shaft torque is found from the turbine torque, which makes them one error.
    let overall = vehicle.shift.ratio_offgoing() * final_ratio;
    let turbine = [t.per_turbine_torque, d.per_turbine_torque];
    let both = [0, 1].map(|i| turbine[i] + shaft[i] * overall);
    let mut columns: Vec<Column> = vec![
        ("turbine torque, error arising in the shift", "N m", bounds.turbine_torque_n_m, turbine),
        ("turbine torque, error before the shift", "N m", bounds.turbine_torque_n_m, both),
        ("shaft torque, drift in the shift", "N m", drift_n_m(vehicle), shaft),
    ];
    columns.extend(common(vehicle, phase, pressure, [t.per_offgoing_torque, d.per_offgoing_torque]));
    evaluate(vehicle, phase, View::ShaftKnown, pressure, &columns)
}

/// Errors that both models have: offgoing clutch, friction, readings.
fn common(vehicle: &Vehicle, phase: Phase, pressure: [f64; 2], offgoing: [f64; 2]) -> Vec<Column> {
    let bounds = &vehicle.error_bounds;
    let fraction = bounds.friction_factor.map(|factor| (factor - 1.0).abs()).into_iter().fold(0.0, f64::max);
    let mut columns: Vec<Column> = Vec::new();
    if phase == Phase::InertiaPhase {
        columns.push(("remaining torque of the offgoing clutch", "N m", bounds.offgoing_torque_n_m, offgoing));
    }
    columns.push(("friction", "%", 100.0 * fraction, pressure.map(|g| 0.01 * g * bounds.shift_pressure_pa)));
    // Old speeds tell what the pressure was.
    columns.push((
        "sampling delay",
        "ms",
        1e3 * bounds.sampling_delay_s,
        pressure.map(|g| 1e-3 * g * bounds.shift_ramp_pa_s),
    ));
    let sample_s = 0.01;
    columns.push(("turbine speed reading, over 10 ms", "rad/s", bounds.turbine_quantum_rad_s, [1.0 / sample_s, 0.0]));
    if phase == Phase::InertiaPhase {
        columns.push(("slip reading, over 10 ms", "rad/s", bounds.slip_quantum_rad_s, [0.0, 1.0 / sample_s]));
    }
    let rounding_rad_s = bounds.float32_rounding * vehicle.settings.speed_max_rad_s;
    columns.push(("float32 rounding of a speed, over 10 ms", "rad/s", rounding_rad_s, [1.0 / sample_s, 0.0]));
    columns
}

/// What an error of the valve does to the pressure of the open loop, which an observer replaces by a fraction of the others.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ValveEffect {
    /// The error.
    pub error: &'static str,
    /// Pressure by which it puts the open loop off in a shift, Pa.
    pub pressure_pa: f64,
}

/// What the valve's errors do to the open loop, by this vehicle's budget.
pub fn valve_alone(vehicle: &Vehicle) -> [ValveEffect; 3] {
    let errors = ValveErrors::of(vehicle);
    let time_constant_s = shift_time_constant(vehicle);
    [("lag", errors.lag_pa_s), ("gain", errors.gain_pa_s), ("delay", errors.delay_pa_s)]
        .map(|(error, rate_pa_s)| ValveEffect { error, pressure_pa: rate_pa_s * time_constant_s })
}

/// Effect of an error on the estimate of the shaft torque, whose level does not affect the speeds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ShaftEffect {
    /// The error.
    pub error: &'static str,
    /// Shaft torque by which it puts the estimate off, N m.
    pub torque_n_m: f64,
}

/// What puts the shaft torque off, by this vehicle's budget: the turbine torque that it is found from before the
/// shift, and the readings by which it is carried on.
pub fn shaft_level(vehicle: &Vehicle) -> [ShaftEffect; 2] {
    let overall = vehicle.shift.ratio_offgoing() * vehicle.driveline.final_ratio;
    let before = overall * vehicle.error_bounds.turbine_torque_n_m;
    [
        ShaftEffect { error: "turbine torque before the shift", torque_n_m: before },
        ShaftEffect {
            error: "drift of the readings in a shift, one standard deviation",
            torque_n_m: drift_n_m(vehicle),
        },
    ]
}

/// Length of a shift, s.
const SHIFT_S: f64 = 0.6;
/// Standard deviations of a reading in the budget's bound on a change: five of the difference of two readings.
const QUANTUM_STD_DEVS: f64 = 5.0 * std::f64::consts::SQRT_2;

/// Drift of the shaft torque by integrating noisy readings over a shift at 100 Hz, one standard deviation, N m.
fn drift_n_m(vehicle: &Vehicle) -> f64 {
    let (sample_s, bounds, line) = (0.01, &vehicle.error_bounds, &vehicle.driveline);
    let twist_rad_s = Real::hypot(bounds.output_quantum_rad_s / line.final_ratio, bounds.wheel_quantum_rad_s);
    line.shaft_stiffness_n_m_rad * twist_rad_s / QUANTUM_STD_DEVS * (SHIFT_S * sample_s).sqrt()
}

fn friction(vehicle: &Vehicle) -> f64 {
    0.5 * (vehicle.settings.uncertainty.friction.0 + vehicle.settings.uncertainty.friction.1)
}

fn evaluate(vehicle: &Vehicle, phase: Phase, view: View, pressure: [f64; 2], columns: &[Column]) -> PhaseSensitivity {
    let outputs = if phase == Phase::InertiaPhase { 2 } else { 1 };
    let cut = |column: &[f64; 2]| DVector::from_row_slice(&column[..outputs]);
    let g = cut(&pressure);
    let torque_per_pa = friction(vehicle) * vehicle.oncoming.clutch.lever() * vehicle.oncoming.clutch.piston_area_m2;
    let effects = columns.iter().map(|(error, unit, bound, column)| {
        let column = cut(column);
        let pressure_pa = g.dot(&column) / g.norm_squared();
        let cosine = (g.dot(&column) / (g.norm() * column.norm())).abs().min(1.0);
        ErrorEffect {
            error,
            unit,
            bound: *bound,
            pressure_pa_per_unit: pressure_pa,
            clutch_n_m_per_unit: pressure_pa * torque_per_pa,
            angle_deg: (outputs > 1 && column.norm() > 0.0).then(|| Real::acos(cosine).to_degrees()),
        }
    });
    PhaseSensitivity { phase: phase.name(), view, influence_rad_s2_mpa: 1e6 * g.norm(), effects: effects.collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use config::VehicleFile;

    fn effect<'a>(phases: &'a [PhaseSensitivity], phase: Phase, view: View, error: &str) -> &'a ErrorEffect {
        let one = phases.iter().find(|p| p.phase == phase.name() && p.view == view).unwrap();
        one.effects.iter().find(|effect| effect.error == error).unwrap()
    }

    #[test]
    fn the_known_facts_come_out() {
        let phases = sensitivity(&VehicleFile::built_in().unwrap());
        let influence = |phase: Phase| phases.iter().find(|p| p.phase == phase.name()).unwrap().influence_rad_s2_mpa;
        // The rigid model is nearly blind in the torque phase.
        assert!(influence(Phase::InertiaPhase) > 50.0 * influence(Phase::TorquePhase));
        // In the inertia phase a turbine torque looks like 0.6 N m of clutch torque for each N m.
        let turbine = effect(&phases, Phase::InertiaPhase, View::Rigid, "turbine torque");
        assert!((turbine.clutch_n_m_per_unit.abs() - 0.55).abs() < 0.1 && turbine.angle_deg.unwrap() < 10.0);
        // With the shaft torque found before the shift, an error of both cancels in the torque phase.
        let error = "turbine torque, error before the shift";
        let cancels = effect(&phases, Phase::TorquePhase, View::ShaftKnown, error);
        let came = effect(&phases, Phase::TorquePhase, View::ShaftKnown, "turbine torque, error arising in the shift");
        assert!(cancels.pressure_pa_per_unit.abs() < 1e-6 * came.pressure_pa_per_unit.abs());
        assert!((came.clutch_n_m_per_unit.abs() - 1.0).abs() < 0.01);
    }
}
