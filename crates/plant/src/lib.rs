//! The simulated car: a hybrid simulation of the whole powertrain during launch and shift.
//!
//! Engine, converter, gear train with two shift clutches, drive shafts, tyres, vehicle and two valves
//! have eight states; where the pistons have a stroke, the oil in the two cylinders is added. Sticking and slipping of the clutches are modes. Within a mode the equations are smooth; a mode
//! ends where a slip reaches zero or a holding torque reaches its limit. This instant is located on the dense
//! output of the integrator. Friction is not regularised.
//!
//! [`car`] is the same for a car with a whole gearbox, in any gear and any shift.
//!
//! ```
//! use config::{ExperimentFile, VehicleFile};
//! use plant::simulate;
//!
//! let experiment = ExperimentFile::e1()?.experiment;
//! let vehicle = VehicleFile::built_in()?.vehicle;
//! let mut highest_pa = 0.0_f64;
//! simulate(&vehicle, &experiment, |sample| highest_pa = highest_pa.max(sample.oncoming_pa))?;
//! assert!(highest_pa > 0.5e6);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod car;
pub mod contact;
pub mod controller;
pub mod delay;
pub mod energy;
pub mod fast_fill;
pub mod gear_train;
pub mod hybrid;
pub mod mode;
pub mod powertrain;
pub mod rosenbrock;
pub mod sensors;
pub mod simulate;
pub mod state;

pub use contact::{ContactProblem, ContactSolution, MAX_CONTACTS};
pub use controller::{Commands, Measured, ShiftController, Stage};
pub use energy::{PowerBalance, stored_energy};
pub use fast_fill::FillPlan;
pub use gear_train::{TrainError, TrainModel};
pub use hybrid::{HybridIntegrator, PlantError, Segment};
pub use mode::{Contact, Direction, Mode};
pub use powertrain::{Inputs, Powertrain, Torques};
pub use simulate::{Moment, Sample, Simulation, simulate};
pub use state::State;
