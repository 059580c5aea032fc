//! What a fit begins with.

use car::{Shaft, Vehicle};

/// The vehicle that is given, and its file, whose text a fit changes.
#[derive(Debug, Clone, PartialEq)]
pub struct Given {
    /// The vehicle.
    pub vehicle: Vehicle,
    /// The shafts of its gear train, in the order of the file.
    pub shafts: Vec<Shaft>,
    /// The text of its file.
    pub text: String,
}
