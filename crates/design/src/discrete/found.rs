//! What a method finds, and what it is compared with.

use nalgebra::DMatrix;
use serde::Serialize;

use super::norm::Norm;
use super::system::{Corner, ErrorSystem};

/// A bound must beat the open loop's by this factor.
pub(crate) const WORTH_A_GAIN: f64 = 0.999;

/// One inequality, evaluated.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DiscreteMargin {
    /// Which.
    pub label: String,
    /// Its minimum eigenvalue; of an interval gain, the minimum entry of the matrix that must have no negative one.
    #[serde(rename = "least")]
    pub minimum: f64,
}

/// What a method found: gains (one, or two at the ends of the friction), bound of the normalised pressure, inequalities.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Found {
    pub(super) gains: Vec<DMatrix<f64>>,
    pub(super) bound: f64,
    pub(super) margins: Vec<DiscreteMargin>,
    /// The norm in which an error shrinks, and by which factor in a sample.
    pub(super) norm: Norm,
    pub(super) contraction: f64,
}

/// Steady-state bound on the normalised pressure in open loop.
pub(crate) fn open_loop_bound(system: &ErrorSystem) -> f64 {
    let pressure = system.states() - 1;
    let at_corner = |corner: &Corner| {
        let valve: f64 = corner.direct.iter().map(|cause| cause.column[pressure].abs()).sum();
        valve / (1.0 - corner.phi[(pressure, pressure)])
    };
    system.corners.iter().map(at_corner).fold(0.0, f64::max)
}

/// The largest fraction of an error of the pressure that is left after a sample of the valve alone.
pub(crate) fn slowest(system: &ErrorSystem) -> f64 {
    let pressure = system.states() - 1;
    system.corners.iter().map(|corner| corner.phi[(pressure, pressure)]).fold(0.0, f64::max)
}
