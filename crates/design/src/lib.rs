//! Observer gains by convex optimisation, with a certificate.
//!
//! The error of the rigid observer obeys `de/dt = (A22 - L G) e - L w`, Eq. (2.31). Where friction or the
//! valve vary, `(A22, G)` lies in a polytope, and a gain that satisfies
//!
//! ```text
//! A22_i - L G_i + kappa1 + kappa2 <= 0   at every vertex i                        (2.50)
//! ```
//!
//! makes the error decay with `kappa2` and stay, for `|w|` bounded, within an offset (2.42). Among those
//! gains the design takes the smallest, by a conic program (2.53).
//!
//! **Architecture invariant:** gains leave this crate only with their [`Certificate`], and every
//! inequality in it is evaluated again by eigenvalues, not taken from the solver.
//!
//! ```
//! use config::VehicleFile;
//! use design::design_rigid;
//!
//! let designed = design_rigid(&VehicleFile::built_in()?.vehicle)?;
//! let certificate = &designed.inertia_phase;
//! assert!((certificate.gain_pa_s_rad[0] + 783.7).abs() < 0.1);
//! assert!((certificate.offset_pa - 49.9e3).abs() < 0.1e3);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod budget;
pub mod certificate;
pub mod compliant;
pub mod discrete;
pub mod enclosing;
pub mod iss;
pub mod kalman;
pub mod lmi;
#[cfg(not(target_family = "wasm"))]
mod lmi_solver;
#[cfg(target_family = "wasm")]
mod no_solver;
pub mod open_loop;
pub mod polytope;
pub mod rigid;
pub mod rivals;
pub mod sliding;

pub use budget::{ValveErrors, shift_time_constant};
pub use certificate::{Certificate, VertexMargin, error_bound};
pub use compliant::{CompliantCertificate, CompliantDesign, best_compliant, compliant_observer, design_compliant};
pub use discrete::given::{UnstableCorner, longest_stable_step_s, longest_step_of, unstable_corners};
pub use discrete::{
    DiscreteCertificate, DiscreteDesign, ErrorModel, Model, Quantity, SolverRecord, design_discrete,
    design_discrete_phase, error_models,
};
pub use iss::{DesignError, IssRequirement, OffsetMissed, design_iss};
pub use kalman::{extended_filter, kalman_filter, open_loop_maps, unscented_filter};
pub use open_loop::{compliant_open_loop_phases, open_loop_bound_pa, rigid_open_loop_phases};
pub use polytope::{Polytope, Vertex};
pub use rigid::{
    RigidDesign, best_rigid, bounded, design_rigid, input_limits, range, requirement, rigid_model, rigid_observer,
    tracker,
};
pub use rivals::{inversion, super_twisting};
pub use sliding::{design_sliding, sliding_observer};
