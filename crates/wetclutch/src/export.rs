//! The observer of a car for a transmission controller.

use ::export::{ExportError, ExportOptions, ExportedFile};

use crate::{Error, VehicleFile};

/// The files of a car's observer for a controller: names and bytes, the same for the same car.
///
/// # Errors
/// The file is of one shift and has no gearbox; there is no such shift; or the filter has no room for the gearbox.
pub fn export(vehicle: &VehicleFile, options: &ExportOptions) -> Result<Vec<ExportedFile>, Error> {
    let VehicleFile::Gearbox(file) = vehicle else {
        return Err(Error::Input(
            "the gearbox filter is exported of a car with a gearbox, and this is a vehicle file of one shift\n\
             hint: `wetclutch init` writes a file of a car with a gearbox"
                .to_owned(),
        ));
    };
    ::export::export(file, options).map_err(|error| match error {
        ExportError::SelfTest { .. } => Error::Work(error.to_string()),
        _ => Error::Input(error.to_string()),
    })
}
