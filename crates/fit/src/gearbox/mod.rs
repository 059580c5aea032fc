//! Parameters of a car with a whole gearbox from measured drives.
//!
//! While both clutches of a shift slip, the speed of the turbine shows the torques that act on it:
//!
//! ```text
//! M11 w_t' + M12 w_o' = T_t - U_off - U_on        U_c = alpha_c mu(s_c) R N A (p_c - p_kiss)+
//! ```
//!
//! `T_t` is the converter's by engine and turbine speed, or without a converter the reported engine torque, and `p_c` that of the
//! valve's model; a one-way clutch overruns then, and its torque, or that of a clutch in series with it, is zero. The output speed is measured and is no unknown. Driving in a gear between shifts shows the torques on car and engine
//! ([`Driving`]). [`Recorder`] takes the steps of a log and keeps what belongs to its shifts and between them; [`fit`] finds the parameters that all shifts have in common ([`Quantity`]).

mod adaptation;
mod balances;
mod budget;
mod channels;
mod clutch;
mod command_delay;
mod contradicted;
mod file;
mod fitting;
mod monotone;
mod precision;
mod quantities;
mod recorder;
mod report;
mod shift;
mod shift_log;
mod solver;
mod unfitted;
mod validation;
mod zero_offset;

pub use crate::driving::Driving;
pub use adaptation::{Adaptation, Adaptations, Adapted, AdaptedShift, AdaptedValue, Fitted, ShiftRole, adaptations};
pub use channels::ChannelFits;
pub use file::{GivenFile, kept_text};
pub use fitting::{GearboxFit, Progress, fit};
pub use quantities::{Quantities, Quantity};
pub use recorder::{Recorded, Recorder};
pub use shift::{OpenLoop, open_loop};
pub use shift_log::ShiftLog;
pub use validation::HeldOut;
