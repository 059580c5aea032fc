//! What a drive tells without a vehicle file and without a valve command: converter, lock-up, torque at the turbine.

pub mod converter;
pub mod converter_file;
pub mod record;
pub mod torque;

pub use converter::{ConverterFit, Knot, fit_converter};
pub use record::{DriveRecord, Moment};
pub use torque::{ShiftTorque, TurbineTorque};
