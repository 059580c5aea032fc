//! Whether a log is one of this car: what its readings contradict, each rule in a file of its own.

mod came_speed;
pub(crate) mod command_delay;
pub(crate) mod contradictions;
pub(crate) mod converter_check;
pub mod held_commands;
pub(crate) mod in_gear;
pub(crate) mod lock_up_check;
pub(crate) mod log_beside;
pub mod ratio_histogram;
pub(crate) mod ratio_scale;
pub(crate) mod still_commands;
pub mod swapped_speeds;

pub use came_speed::CameSpeed;
pub use in_gear::Unusable;
pub use ratio_scale::WrongScale;
