//! The car with a whole gearbox: any gear train with all of its elements, in any gear and any shift.
//!
//! Engine, converter with lock-up clutch (or neither), gear train, drive shafts, tyres, vehicle, and a valve for each friction
//! element. Which elements stick is decided for all of them at once ([`crate::ContactProblem`]). Within one set of contacts
//! the equations are smooth; a step of the integration ends where a slip reaches zero, a holding torque its limit, or a
//! pressure the kiss point of its clutch.
//!
//! | file | holds |
//! |---|---|
//! | `model.rs` | the equations |
//! | `contacts.rs` | which elements stick, and what follows for accelerations and torques |
//! | `integrate.rs` | steps and events |
//! | `energy.rs` | where the energy goes |
//! | `faults.rs` | what breaks on a drive |
//! | `valves.rs` | commands on their way to the valves |
//! | `start.rs` | a car that runs steadily in a gear |
//! | `controller/` | the shift controller |
//! | `run.rs` | car, valves and controller together, period by period |
//! | `shift.rs` | one shift |
//! | `drive.rs` | a drive with all its shifts |
//! | `follow.rs` | a driver who follows a speed |

mod contacts;
mod controller;
mod drive;
mod energy;
mod faults;
mod follow;
mod integrate;
mod model;
mod run;
mod sample;
mod shift;
mod start;
mod valves;

pub use contacts::{ContactState, Contacts};
pub use controller::{
    CarCalibration, CarCommands, CarMeasured, CarShiftController, ShiftProgress, ShiftStage, SlipCurve, SlipTarget,
    SlipTargets,
};
pub use drive::{CarDriveSummary, OverSpeed, Shifting, simulate_car_drive, simulate_car_drive_while};
pub use energy::{CarPowers, stored_car_energy};
pub use follow::SpeedError;
pub use integrate::{CarError, CarIntegrator, CarStep};
pub use model::{CarInputs, CarModel, CarState, CarTorques, MAX_PACKS};
pub use run::{CarRun, Driver};
pub use sample::{CarSample, ElementSample, ShiftUnderWay};
pub use shift::{BeyondGears, CarShift, CarShiftQuality, CarShiftRating, simulate_car_shift};
pub use start::idle_throttle;
pub use valves::CarValves;
