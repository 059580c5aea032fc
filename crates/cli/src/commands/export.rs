//! `wetclutch export`.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde_json::json;
use trace::{ShownPath as _, WholeFile};
use wetclutch::{CSource, ExportOptions, ExportedFile, VehicleFile, read_sensors};

use super::{not_an_input, replaceable, warn_without_effect};
use crate::args::Export;
use crate::failure::Failure;
use crate::output;

pub(crate) fn export(options: &Export) -> Result<(), Failure> {
    if options.all {
        warn_without_effect("--all", "all shifts of the car are exported without it too");
    }
    let vehicle = VehicleFile::read(&options.vehicle)?;
    let sensors = options.sensors.as_deref().map(read_sensors).transpose()?;
    let program = options.check_elf.as_deref().map(read_program).transpose()?;
    let libraries = |paths: &[PathBuf]| paths.iter().map(|path| read_library(path)).collect::<Result<Vec<_>, _>>();
    let (fmu_libraries, car_fmu_libraries) = (libraries(&options.fmu)?, libraries(&options.car_fmu)?);
    let c_source = options.c.as_deref().map(read_c).transpose()?;
    let shift = options.shift.clone();
    let exported = ExportOptions { shift, sensors, program, c_source, fmu_libraries, car_fmu_libraries };
    let files = wetclutch::export(&vehicle, &exported).map_err(|error| named(&options.vehicle, error))?;
    let names: Vec<&str> = files.iter().map(|file| file.name.as_str()).collect();
    replaceable(&options.output, &names)?;
    for file in &files {
        not_an_input(
            Some(&options.output.join(&file.name)),
            [Some(&options.vehicle), options.c.as_ref()].into_iter().flatten(),
        )?;
    }
    write_all(&options.output, &files)?;
    if options.c.is_none() && options.output.join("wetclutch.c").exists() {
        output::note(
            "warning: wetclutch.c in the folder is of an earlier export, and the memory in the header is that of the library\n\
             hint: export again with --c to use it, or remove it with CMakeLists.txt",
        );
    }
    if options.json {
        let object = |file: &ExportedFile| json!({ "path": options.output.join(&file.name).shown().to_string(), "bytes": file.bytes.len() });
        return output::json(&json!({ "files": files.iter().map(object).collect::<Vec<_>>() }));
    }
    for file in &files {
        output::line(&format!("{:>9} bytes  {}", file.bytes.len(), options.output.join(&file.name).shown()))?;
    }
    Ok(())
}

/// An error of the car with the name of its file.
fn named(path: &Path, error: Failure) -> Failure {
    match error {
        Failure::Input(message) => Failure::Input(format!("{}: {message}", path.shown())),
        other => other,
    }
}

/// The largest program that is read, bytes: far above the memory of any controller.
const MOST_BYTES: u64 = 1 << 28;

/// The linked program of a controller.
fn read_program(path: &Path) -> Result<Vec<u8>, Failure> {
    read_linked(path, "linked program", "give the ELF file that the linker wrote")
}

/// The shared library of models for co-simulation.
fn read_library(path: &Path) -> Result<Vec<u8>, Failure> {
    let build = "cargo build --release --locked --manifest-path embedded/fmu/Cargo.toml --target-dir target";
    read_linked(path, "linked shared library", &format!("it is built from the sources of wetclutch: {build}"))
}

/// The C of the observer.
fn read_c(path: &Path) -> Result<CSource, Failure> {
    let hint = "it is in the archive of each release; embedded/portable/build makes it from the sources";
    let source = read_linked(path, "wetclutch.c", hint)?;
    CSource::new(source).map_err(|error| named(path, Failure::Input(error.to_string())))
}

/// What a linker wrote.
fn read_linked(path: &Path, what: &str, hint: &str) -> Result<Vec<u8>, Failure> {
    let failure = |message: String| Failure::Input(format!("{}: {message}", path.shown()));
    let there = std::fs::metadata(path).map_err(|error| failure(format!("{error}\nhint: {hint}")))?;
    if !there.is_file() || there.len() > MOST_BYTES {
        return Err(failure(format!(
            "no {what}: it is a regular file of at most {} MB\nhint: {hint}",
            MOST_BYTES >> 20
        )));
    }
    std::fs::read(path).map_err(|error| failure(error.to_string()))
}

/// Writes all of the files, or none.
fn write_all(folder: &Path, files: &[ExportedFile]) -> Result<(), Failure> {
    let mut written = Vec::new();
    for file in files {
        let path = folder.join(&file.name);
        let write = || {
            let mut whole = WholeFile::create(&path)?;
            whole.write_all(&file.bytes)?;
            Ok(whole)
        };
        written.push(write().map_err(|error| Failure::writing(&path, &error))?);
    }
    WholeFile::finish_all(written).map_err(|error| Failure::writing(folder, &error))
}
