//! The polytope in which the observer's error dynamics lie, Eq. (2.46).

use car::{Uncertainty, ValveUncertainty};
use drivetrain::Valve;
use observer::{Phase, RigidModel};
use serde::Serialize;

/// One corner: what is extreme there, and the error dynamics.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Vertex {
    /// What is extreme, for people: `friction 0.1`.
    pub label: String,
    /// `A22`, 1/s.
    pub a22_per_s: f64,
    /// `G` on `(w_t, dw)`, rad/s^2 per Pa.
    pub g_rad_s2_pa: [f64; 2],
}

/// All corners.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Polytope {
    /// The corners.
    pub vertices: Vec<Vertex>,
}

impl Polytope {
    /// Every combination of the extremes of friction and valve in this phase.
    pub fn of(model: &RigidModel<f64>, uncertainty: &Uncertainty, phase: Phase) -> Self {
        let mut vertices = Vec::new();
        for (valve_label, a22_per_s) in valve_extremes(model, uncertainty) {
            for friction in distinct(uncertainty.friction) {
                vertices.push(Vertex {
                    label: format!("friction {friction}{valve_label}"),
                    a22_per_s,
                    g_rad_s2_pa: model.influence(phase, friction),
                });
            }
        }
        Self { vertices }
    }
}

/// `A22` at the extremes of the valve, with what is extreme there.
pub(crate) fn valve_extremes(model: &RigidModel<f64>, uncertainty: &Uncertainty) -> Vec<(String, f64)> {
    match (model.valve, uncertainty.valve) {
        (Valve::Proportional { gain_pa_a, .. }, ValveUncertainty::TimeConstant(range)) => (distinct(range).into_iter())
            .map(|time_constant_s| {
                let valve = Valve::Proportional { time_constant_s, gain_pa_a };
                (format!(", time constant {time_constant_s} s"), valve.linear(0.0, 0.0).a22_per_s)
            })
            .collect(),
        // `A22` of Remark 2.1 follows from the pressure drop alone.
        (Valve::PulseWidth(law), ValveUncertainty::PressureDrop(range)) => (distinct(range).into_iter())
            .map(|drop_pa| (format!(", pressure drop {} kPa", 1e-3 * drop_pa), -law.rate_per_drop(drop_pa)))
            .collect(),
        (valve, _) => vec![(String::new(), valve.linear(0.0, 0.0).a22_per_s)],
    }
}

/// The largest `A22` of the valve, 1/s, with which its own error decays slowest.
pub(crate) fn slowest_valve(model: &RigidModel<f64>, uncertainty: &Uncertainty) -> f64 {
    valve_extremes(model, uncertainty).into_iter().map(|(_, a22_per_s)| a22_per_s).fold(f64::NEG_INFINITY, f64::max)
}

// A range written as one number twice is one vertex.
pub(crate) fn distinct((minimum, maximum): (f64, f64)) -> Vec<f64> {
    if minimum == maximum { vec![minimum] } else { vec![minimum, maximum] }
}
