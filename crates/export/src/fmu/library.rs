//! The shared library of a model: for which platform it is, and where it is in the archive.

use object::{Architecture, BinaryFormat, Object as _};

use super::Version;
use crate::ExportError;

/// A platform as the versions of the standard name it, and the ending of a shared library on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Platform {
    two: &'static str,
    pub(crate) three: &'static str,
    ending: &'static str,
}

impl Platform {
    /// `None` for one that the standard does not name.
    fn of(format: BinaryFormat, architecture: Architecture) -> Option<Self> {
        let (two, three, ending) = match (format, architecture) {
            (BinaryFormat::Elf, Architecture::X86_64) => ("linux64", "x86_64-linux", "so"),
            (BinaryFormat::Elf, Architecture::Aarch64) => ("aarch64-linux", "aarch64-linux", "so"),
            (BinaryFormat::Pe, Architecture::X86_64) => ("win64", "x86_64-windows", "dll"),
            (BinaryFormat::MachO, Architecture::X86_64) => ("darwin64", "x86_64-darwin", "dylib"),
            (BinaryFormat::MachO, Architecture::Aarch64) => ("aarch64-darwin", "aarch64-darwin", "dylib"),
            _ => return None,
        };
        Some(Self { two, three, ending })
    }
}

/// A shared library for a platform.
#[derive(Debug)]
pub(crate) struct Library<'b> {
    /// Its name, without an ending.
    name: &'static str,
    pub(crate) bytes: &'b [u8],
    pub(crate) platform: Platform,
}

impl<'b> Library<'b> {
    /// # Errors
    /// The file is no shared library of a platform, has not the functions of both versions, or is that of another model.
    pub(crate) fn of(bytes: &'b [u8], name: &'static str) -> Result<Self, ExportError> {
        let file = object::File::parse(bytes).map_err(|error| ExportError::Library(error.to_string()))?;
        let exported = file.exports().map_err(|error| ExportError::Library(error.to_string()))?;
        // On macOS names begin with an underscore.
        let has = |name: &str| exported.iter().any(|of| of.name().ends_with(name.as_bytes()));
        if !(has("fmi2DoStep") && has("fmi3DoStep")) {
            return Err(ExportError::Library("it lacks the functions of FMI 2.0 and 3.0\nhint: give the shared library that embedded/fmu or embedded/car_fmu builds".to_owned()));
        }
        if !has(name) {
            return Err(ExportError::Library(format!(
                "it is not {name}, but that of another model\nhint: --fmu takes the library of embedded/fmu, --car-fmu that of embedded/car_fmu"
            )));
        }
        let platform = Platform::of(file.format(), file.architecture());
        let unnamed = || {
            ExportError::Library(format!("it is for {:?}\nhint: build it for x86-64 or AArch64", file.architecture()))
        };
        Ok(Self { name, bytes, platform: platform.ok_or_else(unnamed)? })
    }

    /// Its place in an archive.
    pub(crate) fn place(&self, version: Version) -> String {
        let folder = match version {
            Version::Two => self.platform.two,
            Version::Three => self.platform.three,
        };
        format!("binaries/{folder}/{}.{}", self.name, self.platform.ending)
    }
}
