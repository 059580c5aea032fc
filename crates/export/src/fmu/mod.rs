//! A car's observer as a model for co-simulation: FMI 2.0 and 3.0.
//!
//! The shared library is the same for all cars (`embedded/fmu`); it reads the parameters of the car from the archive. A variable is a word of
//! input or estimate, and its reference is the place of the word.

mod description;
mod library;
mod variables;
mod zip;

use crate::{ExportError, ExportedFile, ExportedFilter, Image};

use description::Description;
use library::Library;

/// Name of the shared library in an archive, without its ending.
const LIBRARY: &str = "wetclutch_fmu";

/// Version of the standard.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Version {
    Two,
    Three,
}

/// The models of a filter, one for each version of the standard, with these shared libraries: each for another platform.
///
/// # Errors
/// A file is no such library, or two are for the same platform.
pub(crate) fn models(
    filter: &ExportedFilter,
    image: &Image,
    libraries: &[Vec<u8>],
) -> Result<Vec<ExportedFile>, ExportError> {
    let libraries = libraries.iter().map(|bytes| Library::of(bytes)).collect::<Result<Vec<_>, _>>()?;
    for (at, library) in libraries.iter().enumerate() {
        if libraries.iter().take(at).any(|other| other.platform == library.platform) {
            return Err(ExportError::PlatformTwice(library.platform.three));
        }
    }
    let description = Description::of_observer(filter, image);
    let model = |version, number| {
        let mut files = vec![("modelDescription.xml".to_owned(), description.xml(version).into_bytes())];
        files.extend(libraries.iter().map(|library| (library.place(version), library.bytes.to_vec())));
        files.push(("resources/parameters.bin".to_owned(), image.bytes()));
        ExportedFile { name: format!("wetclutch_{}_fmi{number}.fmu", filter.name), bytes: zip::archive(&files) }
    };
    Ok(vec![model(Version::Two, 2), model(Version::Three, 3)])
}
