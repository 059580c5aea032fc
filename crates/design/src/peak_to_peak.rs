//! The sampled rigid observer with the smallest bound on its error, valve error included.
//!
//! With `F`, `G` and the valve frozen over a sample of length `T`, the error of the rigid observer obeys
//!
//! ```text
//! e+ = (Phi - L G Psi) e - T L w - L n + v
//! ```
//!
//! for an error `w` of the acceleration model, `n` of the measured change of speed, and `v` of the valve
//! model over the sample. If `|Phi_i - L G_i Psi_i| <= rho < 1` at every vertex, then ultimately
//!
//! ```text
//! |e| <= (T |L h_T| dT + T |L h_o| dT_o + |L| q + v) / (1 - rho)
//! ```
//!
//! where the turbine-torque error `dT` and the output-torque error `dT_o` enter through the columns `h_T` and
//! `h_o`. For a given `rho` the least numerator is a linear program in `L`; the bound over `rho` has one
//! minimum, which a golden-section search finds. `L = 0` is the open loop with bound `v/(1 - Phi)`: where no gain
//! beats it, the design says so and returns it. With one state this is the exact peak-to-peak gain, with
//! no ellipsoid between.

use config::Vehicle;
use observer::Phase;
use serde::Serialize;

use crate::iss::DesignError;
use crate::lmi::{Block, Outcome, Problem};
use crate::rigid::rigid_model;
use crate::{Polytope, Vertex};

/// Steps of the golden-section search; each shrinks the interval of `rho` by 0.618.
const SEARCH_STEPS: usize = 40;
/// A bound must beat the open loop's by this factor; less is within what rounding the gain can cost.
const WORTH_A_GAIN: f64 = 0.999;

/// One vertex: by how much a sample multiplies the error there.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VertexFactor {
    /// The vertex.
    pub vertex: Vertex,
    /// `Phi - L G Psi`.
    pub factor: f64,
}

/// Part of the bound that one cause of error makes up.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Contribution {
    /// The cause.
    pub cause: &'static str,
    /// Its part, Pa.
    pub bound_pa: f64,
}

/// A gain of the sampled rigid observer with the bound on its error.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PeakToPeakCertificate {
    /// `L` on `(w_t, dw)`, Pa per rad/s, as rounded to single precision.
    pub gain_pa_s_rad: [f64; 2],
    /// The sample time, s.
    pub sample_time_s: f64,
    /// Largest size of the factor over all vertices.
    pub contraction: f64,
    /// Ultimate bound on the error, Pa.
    pub bound_pa: f64,
    /// The same for the open loop, Pa.
    pub open_loop_bound_pa: f64,
    /// Whether the open loop is used because no gain has a smaller bound.
    pub open_loop: bool,
    /// What the bound is made of.
    pub contributions: Vec<Contribution>,
    /// Every vertex.
    pub vertices: Vec<VertexFactor>,
    /// SHA-256 of the vehicle file.
    pub vehicle_sha256: String,
}

/// The sampled error dynamics at the vertices and what disturbs them.
struct Sampled {
    /// `(Phi, G Psi)` at each vertex.
    vertices: Vec<(Vertex, f64, [f64; 2])>,
    /// Cause, and the size it has on each output over a sample, rad/s: `T h dT`.
    columns: [(&'static str, [f64; 2]); 2],
    /// Errors of the measured changes, rad/s.
    change_rad_s: [f64; 2],
    /// Error of the valve model over a sample, Pa.
    valve_pa: f64,
    /// Outputs in use: 1 or 2.
    outputs: usize,
    sample_time_s: f64,
}

impl Sampled {
    fn of(vehicle: &Vehicle, phase: Phase, sample_time_s: f64) -> Self {
        let model = rigid_model(vehicle);
        let bounds = &vehicle.error_bounds;
        let polytope = Polytope::of(&model, &vehicle.uncertainty, phase);
        let hold = |a22: f64| {
            let phi = (a22 * sample_time_s).exp();
            (phi, (phi - 1.0) / a22)
        };
        let vertices = polytope.vertices.into_iter().map(|vertex| {
            let (phi, psi) = hold(vertex.a22_per_s);
            let influence = vertex.g_rad_s2_pa.map(|g| g * psi);
            (vertex, phi, influence)
        });
        let vertices: Vec<_> = vertices.collect();
        let rows = model.coefficients(phase);
        let (outputs, slip) = if phase == Phase::InertiaPhase { (2, 1.0) } else { (1, 0.0) };
        let column =
            |turbine: f64, on_slip: f64, size: f64| [turbine, slip * on_slip].map(|c| sample_time_s * c * size);
        let (turbine, on_slip) = (&rows.turbine, &rows.slip_oncoming);
        let slowest = vertices.iter().map(|(vertex, ..)| hold(vertex.a22_per_s).1).fold(0.0, f64::max);
        Self {
            columns: [
                (
                    "turbine torque",
                    column(turbine.per_turbine_torque, on_slip.per_turbine_torque, bounds.turbine_torque_n_m),
                ),
                (
                    "output torque",
                    column(turbine.per_output_torque, on_slip.per_output_torque, bounds.output_torque_n_m),
                ),
            ],
            change_rad_s: [bounds.turbine_change_rad_s, slip * bounds.slip_change_rad_s],
            valve_pa: slowest * bounds.valve_rate_pa_s,
            outputs,
            sample_time_s,
            vertices,
        }
    }

    fn dot(&self, a: &[f64; 2], b: &[f64; 2]) -> f64 {
        (0..self.outputs).map(|i| a[i] * b[i]).sum()
    }

    /// What disturbs the error over a sample under this gain, Pa, by cause.
    fn disturbances(&self, gain: &[f64; 2]) -> Vec<(&'static str, f64)> {
        let mut causes: Vec<_> =
            self.columns.iter().map(|(cause, column)| (*cause, self.dot(gain, column).abs())).collect();
        causes.push(("measured speeds", self.dot(&gain.map(f64::abs), &self.change_rad_s)));
        causes.push(("valve model", self.valve_pa));
        causes
    }

    /// Largest size of the factor over all vertices.
    fn contraction(&self, gain: &[f64; 2]) -> f64 {
        self.vertices.iter().map(|(_, phi, influence)| (phi - self.dot(gain, influence)).abs()).fold(0.0, f64::max)
    }

    /// Ultimate bound on the error, Pa; infinite where the error does not contract.
    fn bound(&self, gain: &[f64; 2]) -> f64 {
        let contraction = self.contraction(gain);
        if contraction >= 1.0 {
            return f64::INFINITY;
        }
        self.disturbances(gain).iter().map(|(_, pascal)| pascal).sum::<f64>() / (1.0 - contraction)
    }

    /// The gain with the least disturbance that contracts by `rho`, if there is one.
    fn best_at(&self, rho: f64) -> Result<Option<[f64; 2]>, DesignError> {
        // Unknowns: the gains in units that make each move the weakest vertex by 1, then the absolute values of
        // L h for each column and of each gain.
        let n = self.outputs;
        let sizes = self.vertices.iter().map(|(_, _, influence)| self.dot(influence, influence).sqrt());
        let unit = 1.0 / sizes.fold(f64::INFINITY, f64::min);
        let unknowns = n + self.columns.len() + n;
        let row = |entries: &[(usize, f64)]| {
            let mut row = vec![0.0; unknowns];
            for &(k, value) in entries {
                row[k] += value;
            }
            row
        };
        let gain_entries = |weights: &[f64; 2], sign: f64| -> Vec<(usize, f64)> {
            (0..n).map(|i| (i, sign * weights[i] * unit)).collect()
        };
        let mut blocks = Vec::new();
        for (_, phi, influence) in &self.vertices {
            blocks.push(Block::linear(rho - phi, &row(&gain_entries(influence, 1.0))));
            blocks.push(Block::linear(rho + phi, &row(&gain_entries(influence, -1.0))));
        }
        let mut objective = vec![0.0; unknowns];
        let scale = self.valve_pa.max(1.0);
        let mut absolute = |at: usize, weights: &[f64; 2]| {
            objective[at] = 1.0;
            for sign in [1.0, -1.0] {
                let scaled = weights.map(|w| w / scale);
                let mut entries = gain_entries(&scaled, sign);
                entries.push((at, 1.0));
                blocks.push(Block::linear(0.0, &row(&entries)));
            }
        };
        for (k, (_, column)) in self.columns.iter().enumerate() {
            absolute(n + k, column);
        }
        for i in 0..n {
            let mut weights = [0.0; 2];
            weights[i] = self.change_rad_s[i];
            absolute(n + self.columns.len() + i, &weights);
        }
        match (Problem { objective, blocks }).solve() {
            Outcome::Solved { unknowns, .. } => {
                let mut gain = [0.0; 2];
                for i in 0..n {
                    gain[i] = unit * unknowns[i];
                }
                Ok(Some(gain))
            }
            Outcome::Infeasible => Ok(None),
            Outcome::Failed(word) => Err(DesignError::Solver(word)),
        }
    }
}

/// Designs the gain of one phase for this sample time.
///
/// # Errors
/// The solver ended without an answer.
pub fn design_peak_to_peak(
    vehicle: &Vehicle,
    phase: Phase,
    sample_time_s: f64,
) -> Result<PeakToPeakCertificate, DesignError> {
    let sampled = Sampled::of(vehicle, phase, sample_time_s);
    let open_loop_bound_pa = sampled.bound(&[0.0; 2]);
    let best_at = |rho: f64| -> Result<(f64, [f64; 2]), DesignError> {
        Ok(sampled.best_at(rho)?.map_or((f64::INFINITY, [0.0; 2]), |gain| (sampled.bound(&gain), gain)))
    };
    // Golden-section search for the rho with the least bound, between dead beat and the open loop.
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut low, mut high) = (0.0, sampled.contraction(&[0.0; 2]));
    let mut inner = (high - golden * (high - low), low + golden * (high - low));
    let mut values = (best_at(inner.0)?, best_at(inner.1)?);
    for _ in 0..SEARCH_STEPS {
        if values.0.0 < values.1.0 {
            high = inner.1;
            inner = (high - golden * (high - low), inner.0);
            values = (best_at(inner.0)?, values.0);
        } else {
            low = inner.0;
            inner = (inner.1, low + golden * (high - low));
            values = (values.1, best_at(inner.1)?);
        }
    }
    let best = if values.0.0 < values.1.0 { values.0.1 } else { values.1.1 };
    #[expect(clippy::cast_possible_truncation, reason = "the certificate is for the gain a controller holds")]
    let best = best.map(|gain| f64::from(gain as f32));
    let open_loop = sampled.bound(&best) > WORTH_A_GAIN * open_loop_bound_pa;
    let gain = if open_loop { [0.0; 2] } else { best };
    Ok(certificate(vehicle, &sampled, gain, open_loop, open_loop_bound_pa))
}

fn certificate(
    vehicle: &Vehicle,
    sampled: &Sampled,
    gain: [f64; 2],
    open_loop: bool,
    open_loop_bound_pa: f64,
) -> PeakToPeakCertificate {
    let contraction = sampled.contraction(&gain);
    let contributions = sampled.disturbances(&gain).into_iter();
    let vertices = sampled.vertices.iter().map(|(vertex, phi, influence)| VertexFactor {
        vertex: vertex.clone(),
        factor: phi - sampled.dot(&gain, influence),
    });
    PeakToPeakCertificate {
        gain_pa_s_rad: gain,
        sample_time_s: sampled.sample_time_s,
        contraction,
        bound_pa: sampled.bound(&gain),
        open_loop_bound_pa,
        open_loop,
        contributions: contributions
            .map(|(cause, pascal)| Contribution { cause, bound_pa: pascal / (1.0 - contraction) })
            .collect(),
        vertices: vertices.collect(),
        vehicle_sha256: vehicle.source.sha256(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vehicle() -> Vehicle {
        Vehicle::two_speed_at().expect("the built-in vehicle is valid")
    }

    /// Scalar output: `f(a) = (v + c a)/(1 - Phi + a)` with `a = L G_min Psi` is monotone, so the best is either the
    /// open loop or the largest gain that still pays at the strong vertex.
    #[test]
    fn with_one_output_the_design_is_open_loop_exactly_where_the_closed_form_says() {
        let mut vehicle = vehicle();
        for (valve_rate, pays) in [(1e5, false), (1e6, false), (1e8, true)] {
            vehicle.error_bounds.valve_rate_pa_s = valve_rate;
            let sampled = Sampled::of(&vehicle, Phase::TorquePhase, 0.01);
            let (_, phi, weak) = &sampled.vertices[0];
            let size: f64 = sampled.columns.iter().map(|(_, column)| column[0].abs()).sum();
            let c = (size + sampled.change_rad_s[0]) / weak[0].abs();
            assert_eq!(c * (1.0 - phi) < sampled.valve_pa, pays, "the closed form itself");
            let certificate = design_peak_to_peak(&vehicle, Phase::TorquePhase, 0.01).unwrap();
            assert_eq!(certificate.open_loop, !pays, "{certificate:?}");
            assert!(certificate.bound_pa <= certificate.open_loop_bound_pa);
        }
    }

    /// No gain on a fine grid around and far from the design has a smaller bound.
    #[test]
    fn no_gain_of_a_grid_search_beats_the_design() {
        let vehicle = vehicle();
        let certificate = design_peak_to_peak(&vehicle, Phase::InertiaPhase, 0.01).unwrap();
        let sampled = Sampled::of(&vehicle, Phase::InertiaPhase, 0.01);
        assert!(!certificate.open_loop && certificate.bound_pa < certificate.open_loop_bound_pa);
        for i in -60..=60 {
            for j in -60..=60 {
                let gain = [f64::from(i) * 100.0, f64::from(j) * 100.0];
                // The rounding to single precision may cost a few parts in ten million.
                assert!(sampled.bound(&gain) >= certificate.bound_pa * (1.0 - 1e-5), "{gain:?}");
            }
        }
    }

    #[test]
    fn the_contributions_add_up_to_the_bound() {
        for phase in [Phase::TorquePhase, Phase::InertiaPhase] {
            let certificate = design_peak_to_peak(&vehicle(), phase, 0.01).unwrap();
            let sum: f64 = certificate.contributions.iter().map(|part| part.bound_pa).sum();
            assert!((sum / certificate.bound_pa - 1.0).abs() < 1e-12);
            assert!(certificate.vertices.iter().all(|v| v.factor.abs() <= certificate.contraction));
        }
    }
}
