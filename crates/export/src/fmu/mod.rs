//! A car's observer, and the simulated car, as models for co-simulation: FMI 2.0 and 3.0.
//!
//! The shared libraries are the same for all cars (`embedded/fmu`, `embedded/car_fmu`); they read the car from the archive.

mod car;
mod description;
mod library;
mod variables;
mod zip;

pub(crate) use car::of_car;

use crate::{ExportError, ExportedFile, ExportedFilter, Image};

use description::Description;
use library::Library;

/// Version of the standard.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Version {
    Two,
    Three,
}

/// A model: its description, and the files that its library reads.
pub(crate) struct Model {
    description: Description,
    resources: Vec<(&'static str, Vec<u8>)>,
}

/// The model of an observer.
pub(crate) fn of_observer(filter: &ExportedFilter, image: &Image) -> Model {
    let description = Description::of_observer(filter, image);
    Model { description, resources: vec![("parameters.bin", image.bytes())] }
}

/// The files of a model, one for each version of the standard, with these shared libraries: each for another platform.
///
/// # Errors
/// A file is not the library of this model, or two are for the same platform.
pub(crate) fn models(model: &Model, libraries: &[Vec<u8>]) -> Result<Vec<ExportedFile>, ExportError> {
    let name = model.description.library;
    let libraries = libraries.iter().map(|bytes| Library::of(bytes, name)).collect::<Result<Vec<_>, _>>()?;
    for (at, library) in libraries.iter().enumerate() {
        if libraries.iter().take(at).any(|other| other.platform == library.platform) {
            return Err(ExportError::PlatformTwice(library.platform.three));
        }
    }
    let file = |version, number| {
        let mut files = vec![("modelDescription.xml".to_owned(), model.description.xml(version).into_bytes())];
        files.extend(libraries.iter().map(|library| (library.place(version), library.bytes.to_vec())));
        files.extend(model.resources.iter().map(|(name, bytes)| (format!("resources/{name}"), bytes.clone())));
        ExportedFile { name: format!("{}_fmi{number}.fmu", model.description.name), bytes: zip::archive(&files) }
    };
    Ok(vec![file(Version::Two, 2), file(Version::Three, 3)])
}
