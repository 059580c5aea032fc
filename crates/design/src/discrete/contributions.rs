//! What each cause of the error budget does to an estimate.

use nalgebra::DMatrix;
use serde::Serialize;

use super::system::{Corner, ErrorSystem, READINGS};
use crate::compliant::PRESSURE_UNIT_PA;

/// Samples over which a response is followed at most.
const RESPONSE_SAMPLES: usize = 5000;

/// Part of an error that one cause makes up.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Contribution {
    /// The cause.
    pub cause: &'static str,
    /// Its part, Pa.
    pub bound_pa: f64,
}

/// What each cause does to the pressure at the corner where all of them together do most.
pub(super) fn contributions(system: &ErrorSystem, gains: &[DMatrix<f64>]) -> Vec<Contribution> {
    let at_corner = |corner: &Corner| -> Vec<Contribution> {
        let Some(gain) = system.gain_at(corner, gains) else { return Vec::new() };
        let a = corner.error_dynamics(gain);
        let columns = system.columns(corner, gain);
        let mut sums: Vec<Contribution> = Vec::new();
        for (cause, _) in &columns {
            if !sums.iter().any(|sum| sum.cause == *cause) {
                sums.push(Contribution { cause, bound_pa: 0.0 });
            }
        }
        if let Some(sum) = sums.iter_mut().find(|sum| sum.cause == READINGS) {
            sum.bound_pa += PRESSURE_UNIT_PA * system.last_reading(gain);
        }
        let mut response = DMatrix::zeros(1, system.states());
        response[(0, system.states() - 1)] = 1.0;
        for _ in 0..RESPONSE_SAMPLES {
            for (cause, column) in &columns {
                if let Some(sum) = sums.iter_mut().find(|sum| sum.cause == *cause) {
                    sum.bound_pa += PRESSURE_UNIT_PA * (&response * column)[0].abs();
                }
            }
            response *= &a;
            if response.norm() < 1e-12 {
                break;
            }
        }
        sums
    };
    let total = |sums: &Vec<Contribution>| sums.iter().map(|sum| sum.bound_pa).sum::<f64>();
    system.corners.iter().map(at_corner).max_by(|a, b| total(a).total_cmp(&total(b))).unwrap_or_default()
}
