//! Plain types of a car, of what it is driven through, of its readings and of their errors.
//!
//! Every crate that computes with a car takes it from here. Nothing here reads a file or parses a text: `config` makes these types
//! from files.
//!
//! What an observer takes ([`Step`], [`Reading`], [`Gear`]) is there without the feature `std`: it is `no_std`, allocates
//! nothing and is generic over `f32` and `f64`.
#![cfg_attr(not(feature = "std"), no_std)]
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

#[cfg(feature = "std")]
mod capacity;
#[cfg(feature = "std")]
mod car;
#[cfg(feature = "std")]
mod clutch;
#[cfg(feature = "std")]
pub mod columns;
mod discretisation;
#[cfg(feature = "std")]
mod drive;
#[cfg(feature = "std")]
mod error_bounds;
#[cfg(feature = "std")]
pub mod error_budget;
#[cfg(feature = "std")]
mod experiment;
#[cfg(feature = "std")]
mod fault;
mod fill_budget;
mod ids;
mod input;
#[cfg(feature = "std")]
mod no_shift;
#[cfg(feature = "std")]
mod observers;
#[cfg(feature = "std")]
mod off_nominal;
#[cfg(feature = "std")]
pub mod one_shift;
#[cfg(feature = "std")]
pub mod ratios_alone;
mod reading;
#[cfg(feature = "std")]
mod sensors;
#[cfg(feature = "std")]
mod speed_trace;
mod step;
#[cfg(feature = "std")]
pub mod stroke;
#[cfg(feature = "std")]
pub mod template;
#[cfg(feature = "std")]
pub mod two_gears;
#[cfg(feature = "std")]
mod vehicle;

pub use discretisation::Discretisation;
pub use fill_budget::FillBudget;
pub use ids::{ElementId, Gear, GearId, MAX_ELEMENTS, ShiftId};
pub use input::Input;
pub use reading::{LOST_S, Reading};
pub use step::{Commands, ShiftCommand, Speeds, Step};

#[cfg(feature = "std")]
pub use self::{
    car::{Car, LockUp},
    clutch::ShiftClutch,
    drive::{ControllerCalibration, Drive, DriveSegment, ShiftPlan, ShiftSchedule},
    error_bounds::{CarErrorBounds, ElementErrorBounds, ErrorBounds},
    error_budget::{ElementErrors, ErrorBudget},
    experiment::{Experiment, FastFill, Profile, Scenario, ShiftCalibration},
    fault::{FailedReading, FailedSensor, Fault, FaultKind, GLAZED_RAD_S},
    observers::{GainMethod, GivenGains, ObserverEntry, ObserverKind, SAMPLE_TIMES_S},
    off_nominal::OffNominal,
    one_shift::OneShiftError,
    ratios_alone::TURBINE_SIDE_INERTIA_KG_M2,
    sensors::{AccelerationSensor, CurrentSensor, OUTLIER_A, ReadingErrors, Sensors, SpeedSensor},
    speed_trace::SpeedTrace,
    template::{CarSize, TemplateError},
    vehicle::{
        CompliantRequirement, DesignRequirement, FilterSettings, ObserverSettings, PhaseSlips, Requirements, Shaft,
        Uncertainty, ValveUncertainty, Vehicle,
    },
};

/// Temperatures of transmission oil, degC.
#[cfg(feature = "std")]
pub const OIL_TEMPERATURES_DEGC: core::ops::RangeInclusive<f64> = -40.0..=150.0;
