//! Vehicle, experiment and study files.
//!
//! A file is read into raw types that mirror its keys, then checked and converted to types that need
//! no further checks. An error names file, line, key, value and allowed range, and gives a hint for a
//! likely mistake.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod all_errors;
mod car_study;
pub mod check;
pub mod drive;
mod entries;
pub mod error;
mod excerpt;
pub mod experiment;
mod faults;
pub mod gearbox;
pub mod learnt;
mod near;
pub mod source;
mod speed_trace;
pub mod study;
mod tree;
pub mod vehicle;

pub use all_errors::all_errors;
pub use car_study::{CarStudy, CarStudyRuns, SampledErrors};
pub use check::significant;
pub use drive::DriveFile;
pub use error::ConfigError;
pub use excerpt::Excerpt;
pub use experiment::{ExperimentFile, read_sensors, sensors_of, simulated_sensors_of};
pub use gearbox::GearboxFile;
pub use learnt::{check_learnt, read_learnt, write_learnt};
pub use source::{Kind, Source};
pub use study::{Factor, Plan, Sometimes, Study, Target, Values, Varied};
pub use trace::{toml_number, toml_string};
pub use tree::Change;
pub use vehicle::{CarFile, DefaultTaken, VehicleFile};

/// A file is used as what it describes.
macro_rules! file_of {
    ($file:ident, $field:ident: $described:ty) => {
        impl std::ops::Deref for $file {
            type Target = $described;

            fn deref(&self) -> &Self::Target {
                &self.$field
            }
        }

        impl std::ops::DerefMut for $file {
            fn deref_mut(&mut self) -> &mut Self::Target {
                &mut self.$field
            }
        }
    };
}
pub(crate) use file_of;
