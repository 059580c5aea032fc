//! Clutch-pressure observers that can run on a transmission controller.
//!
//! `no_std`, no allocation, generic over `f32` and `f64`. Tuning is `&self`, memory is `&mut State`, the
//! result is returned: `step(&self, &mut State, &Input) -> Estimate`. A step never panics; input that is
//! not finite or out of range gives an estimate with a flag.
//!
//! **Architecture invariant:** this crate does not depend on the simulated plant. An estimator has no access to the true
//! values.
#![no_std]

#[cfg(feature = "std")]
extern crate alloc;
#[cfg(feature = "std")]
extern crate std;

pub mod alignment;
pub mod bound;
mod bounds;
mod budget;
mod commands;
pub mod compliant;
pub mod compliant_model;
pub mod extended;
pub mod fill_range;
pub mod gearbox;
pub mod inversion;
pub mod kalman;
#[cfg(feature = "std")]
pub mod of_car;
#[cfg(feature = "std")]
pub mod of_sensors;
#[cfg(feature = "std")]
mod of_vehicle;
pub mod pressure_range;
pub mod rigid;
pub mod rigid_model;
mod sample_estimator;
pub mod schedule;
pub mod shaft_range;
pub mod signals;
pub mod sliding;
pub mod super_twisting;
pub mod supervisor;
pub mod tracker;
pub mod unscented;

pub use alignment::{AlignedState, Alignment, AlignmentState};
pub use bound::{Bounded, RangeEstimator, RangeState};
pub use bounds::Bounds;
pub use budget::Budget;
pub use compliant::{CompliantGains, CompliantObserver, CompliantState};
pub use compliant_model::{CompliantModel, CompliantSpeedModel};
pub use extended::{ExtendedFilter, ExtendedState, FilterNoise, Readings};
pub use fill_range::{FillBudget, PistonRange};
pub use gearbox::{
    GearboxFilter, GearboxState, GearboxTables, OneShiftFilter, OneShiftState, ShiftEstimate, ShiftInput,
};
pub use inversion::{Inversion, InversionState};
pub use kalman::{
    EngineNoise, KalmanFilter, KalmanState, OffgoingClutch, ReportedTorque, SpeedReading, Uncertainty, ValveModel,
};
#[cfg(feature = "std")]
pub use of_car::{ShiftTables, element_uncertainty, gearbox_filter};
#[cfg(feature = "std")]
pub use of_vehicle::{one_shift_filter, phase_supervisor};
pub use pressure_range::PressureRange;
pub use rigid::{RigidGains, RigidObserver, RigidSample, RigidState};
pub use rigid_model::{RigidModel, SpeedModel};
pub use sample_estimator::SampleEstimator;
pub use schedule::{Mix, Schedule};
pub use shaft_range::{ShaftErrors, ShaftMemory, ShaftRange};
pub use signals::{
    Aligned, ChannelHealth, Channels, Estimate, Estimator, Health, Input, InputLimits, LOST_S, Reading, Sample,
};
pub use sliding::{SlidingGains, SlidingObserver, SlidingSample, SlidingState};
pub use super_twisting::{SuperTwisting, SuperTwistingState, TwistingSample};
pub use supervisor::{Phase, Supervisor, SupervisorState};
pub use tracker::{Discretisation, Interval, Track, Tracker, TrackerState};
pub use unscented::UnscentedFilter;
