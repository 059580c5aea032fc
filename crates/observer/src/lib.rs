//! Clutch-pressure observers that can run on a transmission controller.
//!
//! `no_std`, no allocation, generic over `f32` and `f64`. Tuning is `&self`, memory is `&mut State`, the
//! result is returned: `step(&self, &mut State, &Input) -> Estimate`. A step never panics; input that is
//! not finite or out of range gives an estimate with a flag.
//!
//! **Architecture invariant:** nothing here knows the simulated plant. An estimator cannot see the truth.
#![no_std]

pub mod bound;
pub mod compliant;
pub mod compliant_model;
pub mod inversion;
pub mod kalman;
pub mod rigid;
pub mod rigid_model;
pub mod schedule;
pub mod shaft_range;
pub mod signals;
pub mod sliding;
pub mod super_twisting;
pub mod supervisor;
pub mod tracker;
pub mod unscented;

pub use bound::{Bounded, Bounds, Budget, Tube};
pub use compliant::{CompliantGains, CompliantObserver, CompliantState};
pub use compliant_model::{CompliantModel, CompliantSpeedModel};
pub use inversion::{Inversion, InversionState};
pub use kalman::{FilterNoise, KalmanFilter, KalmanState, Readings};
pub use rigid::{RigidGains, RigidObserver, RigidSample, RigidState};
pub use rigid_model::{RigidModel, SpeedModel};
pub use schedule::{Mix, Schedule};
pub use shaft_range::{ShaftErrors, ShaftMemory, ShaftRange};
pub use signals::{Estimate, Estimator, Health, Input, InputLimits};
pub use sliding::{SlidingGains, SlidingObserver, SlidingSample, SlidingState};
pub use super_twisting::{SuperTwisting, SuperTwistingState, TwistingSample};
pub use supervisor::{Phase, Supervisor, SupervisorState};
pub use tracker::{Discretisation, Interval, Track, Tracker, TrackerState};
pub use unscented::UnscentedFilter;
