//! Driving in a gear, between shifts: mass and road load, and the reported engine torque beside a converter.
//!
//! Where the engine pulls, the readings of a stretch in one gear show two torque balances, of car and of engine:
//!
//! ```text
//! J w_o' = i (T_t - drag) - T_w/i_df - C_A R^3 w_o^2/i_df^3 - m g (R/i_df) sin(grade)      J = m R^2/i_df^2 + I_w/i_df^2 + J_gear
//! I_e w_e' = k T_reported(t - delay) - C(w_t/w_e) w_e^2
//! ```
//!
//! The grade is not measured: it is a disturbance that changes over the way ([`whitening`]), so that only what changes faster than a road does
//! tells of the car. A driver who pulls does not brake; what a brake takes in overrun is in no log, and overrun is not used.

mod model;
mod recorder;
mod stretch;
mod usable;
mod whitening;

pub(crate) use model::{Balance, DrivingModel, DrivingWeights, Evaluated};
pub(crate) use recorder::{DrivingRecorder, RowState};
pub use stretch::Driving;
pub(crate) use usable::{Usable, usable};
