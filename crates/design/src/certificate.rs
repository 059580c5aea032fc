//! What is promised about a gain, and the check of it that needs no solver.

use drivetrain::Real;
use nalgebra::DMatrix;
use observer::Phase;
use serde::Serialize;

use crate::lmi::largest_eigenvalue;
use crate::{IssRequirement, Polytope, Vertex};

/// What every certificate holds for. With backward slip `G` changes its sign on the pressure, and the observers change that of
/// the gain: `L G` is the same, or, with the shaft torque as a state, the same but for the sign of the pressure's error.
pub(crate) const BOTH_DIRECTIONS: &str = "forward and backward";

/// One vertex inequality of Eq. (2.50), evaluated.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VertexMargin {
    /// The vertex.
    pub vertex: Vertex,
    /// How fast the error decays there: `-lambda_max(sym(A22 - L G))`, 1/s.
    pub decay_per_s: f64,
    /// How far that exceeds `kappa1 + kappa2`, 1/s; not negative.
    pub margin_per_s: f64,
}

/// A gain with what is promised about it.
///
/// Assumes that speeds and accelerations obey the rigid model up to an error `|w|` within the bound, and
/// that the valve obeys its model exactly: the chapter's error model, Eq. (2.24), has no valve error.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Certificate {
    /// `L` on `(w_t, dw)`, Pa per rad/s.
    pub gain_pa_s_rad: [f64; 2],
    /// `kappa1`, 1/s.
    pub kappa1_per_s: f64,
    /// `kappa2`, 1/s: without model error the estimate's error decays at least as `e^(-kappa2 t)`.
    pub kappa2_per_s: f64,
    /// Bound on the model error `|w|`, rad/s^2.
    pub model_error_max_rad_s2: f64,
    /// Bound on the remaining error of the pressure, Pa, Eq. (2.42).
    pub offset_pa: f64,
    /// What was asked for, Pa.
    pub offset_max_pa: f64,
    /// Every vertex inequality.
    pub vertices: Vec<VertexMargin>,
    /// Directions of slip for which it holds: with backward slip the gain on the pressure changes its sign with `G`.
    pub slip_directions: &'static str,
    /// Iterations of the conic solver.
    pub solver_iterations: u32,
}

impl Certificate {
    /// Evaluates every inequality (2.50) for this gain, without the solver: the error dynamics
    /// `A22 - L G` of Eq. (2.31) must satisfy the condition (2.35) of Theorem 2.1 at every vertex.
    ///
    /// Returns `None` if one of them does not hold: there is nothing to certify.
    pub fn check(
        gain_pa_s_rad: [f64; 2],
        kappa1_per_s: f64,
        requirement: &IssRequirement,
        polytope: &Polytope,
    ) -> Option<Self> {
        let l = DMatrix::from_row_slice(1, 2, &gain_pa_s_rad);
        let vertices: Vec<VertexMargin> = (polytope.vertices.iter())
            .map(|vertex| {
                let g = DMatrix::from_column_slice(2, 1, &vertex.g_rad_s2_pa);
                let error_dynamics = DMatrix::from_element(1, 1, vertex.a22_per_s) - &l * g;
                let decay_per_s = -largest_eigenvalue(&error_dynamics);
                let margin_per_s = decay_per_s - kappa1_per_s - requirement.kappa2_per_s;
                VertexMargin { vertex: vertex.clone(), decay_per_s, margin_per_s }
            })
            .collect();
        let holds = |vertex: &VertexMargin| vertex.margin_per_s >= 0.0;
        if !vertices.iter().all(holds) {
            return None;
        }
        let gain_squared = largest_eigenvalue(&(l.transpose() * &l));
        let offset_squared = Real::powi(requirement.model_error_max_rad_s2, 2) * gain_squared
            / (4.0 * kappa1_per_s * requirement.kappa2_per_s);
        Some(Self {
            gain_pa_s_rad,
            kappa1_per_s,
            kappa2_per_s: requirement.kappa2_per_s,
            model_error_max_rad_s2: requirement.model_error_max_rad_s2,
            offset_pa: offset_squared.max(0.0).sqrt(),
            offset_max_pa: requirement.offset_max_pa,
            vertices,
            slip_directions: BOTH_DIRECTIONS,
            solver_iterations: 0,
        })
    }

    /// Bound on the error after `elapsed_s`, Pa, if it was `initial_error_pa` at first, Eq. (2.40).
    pub fn error_bound_pa(&self, initial_error_pa: f64, elapsed_s: f64) -> f64 {
        error_bound(self.offset_pa, self.kappa2_per_s, initial_error_pa, elapsed_s)
    }

    /// The gain for people.
    pub fn gain_text(&self, phase: Phase) -> String {
        let [turbine, slip] = self.gain_pa_s_rad;
        match phase {
            Phase::TorquePhase => format!("L = {turbine:.1} Pa s/rad on the turbine speed"),
            _ => format!("L = ({turbine:.1}, {slip:.1}) Pa s/rad on turbine speed and slip"),
        }
    }

    /// The smallest margin of all vertices, 1/s.
    pub fn smallest_margin_per_s(&self) -> f64 {
        self.vertices.iter().map(|vertex| vertex.margin_per_s).fold(f64::INFINITY, f64::min)
    }
}

/// Bound on an error after `elapsed_s`, in its own unit, if it was `initial` at first and decays with `kappa2_per_s` to
/// `offset`, Eq. (2.40).
pub fn error_bound(offset: f64, kappa2_per_s: f64, initial: f64, elapsed_s: f64) -> f64 {
    let remains = Real::exp(-2.0 * kappa2_per_s * elapsed_s);
    (Real::powi(initial, 2) * remains + Real::powi(offset, 2) * (1.0 - remains)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polytope() -> Polytope {
        let vertex = |g: f64| Vertex { label: String::new(), a22_per_s: -25.0, g_rad_s2_pa: [g, 0.0] };
        Polytope { vertices: vec![vertex(-0.01), vertex(-0.016)] }
    }

    const REQUIREMENT: IssRequirement =
        IssRequirement { kappa1_per_s: None, kappa2_per_s: 40.0, model_error_max_rad_s2: 1600.0, offset_max_pa: 1e6 };

    #[test]
    fn a_gain_that_is_too_small_at_one_vertex_gets_no_certificate() {
        // 55/s at the weak vertex needs |L| = 3000; a hair less must fail, a hair more must hold.
        assert!(Certificate::check([-3000.0 * (1.0 - 1e-9), 0.0], 15.0, &REQUIREMENT, &polytope()).is_none());
        let certificate = Certificate::check([-3000.0 * (1.0 + 1e-9), 0.0], 15.0, &REQUIREMENT, &polytope()).unwrap();
        assert!(certificate.smallest_margin_per_s() < 1e-6);
        assert!((certificate.vertices[1].margin_per_s - 18.0).abs() < 1e-6);
    }

    #[test]
    fn the_error_bound_starts_at_the_initial_error_and_ends_at_the_offset() {
        let certificate = Certificate::check([-4000.0, 0.0], 15.0, &REQUIREMENT, &polytope()).unwrap();
        assert!((certificate.error_bound_pa(3e5, 0.0) - 3e5).abs() < 1e-6);
        assert!((certificate.error_bound_pa(3e5, 10.0) - certificate.offset_pa).abs() < 1e-6);
        // After 1/kappa2 the squares of both have changed by e^2.
        let left = (-2.0_f64).exp();
        let expected = (9e10 * left + certificate.offset_pa.powi(2) * (1.0 - left)).sqrt();
        assert!((certificate.error_bound_pa(3e5, 1.0 / 40.0) - expected).abs() < 1e-6);
    }

    /// With `kappa1 = kappa2 = k` and no margin, a constant model error leaves `|L| w / (2 k)`: the theorem's bound itself.
    #[test]
    fn with_equal_kappas_a_constant_model_error_reaches_the_offset() {
        let vertex = Vertex { label: String::new(), a22_per_s: -25.0, g_rad_s2_pa: [-0.006, -0.008] };
        let polytope = Polytope { vertices: vec![vertex] };
        let along = -(80.0 - 25.0) / 0.01 * (1.0 + 1e-9);
        let gain = [0.6 * along, 0.8 * along];
        let certificate = Certificate::check(gain, 40.0, &REQUIREMENT, &polytope).unwrap();
        assert!((certificate.vertices[0].decay_per_s - 80.0).abs() < 1e-6);
        let left = 5500.0 * 1600.0 / 80.0;
        assert!((certificate.offset_pa / left - 1.0).abs() < 1e-6, "{} {left}", certificate.offset_pa);
        // Less gain than both kappas ask for is not certified.
        let less = gain.map(|gain| gain * (1.0 - 1e-6));
        assert!(Certificate::check(less, 40.0, &REQUIREMENT, &polytope).is_none());
    }
}
