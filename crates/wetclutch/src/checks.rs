//! All errors of a file, of any kind.

use std::collections::HashSet;
use std::path::Path;

use config::{
    CarFile, CarStudy, ConfigError, DriveFile, ExperimentFile, GearboxFile, Kind, Source, Study, VehicleFile,
    all_errors, check_learnt,
};
use logs::ChannelMap;
use trace::ShownPath as _;

use crate::Error;
use crate::vehicle::gearbox_source;

/// All errors of a file of any kind, and of those that it names; none if all of them can be used.
///
/// # Errors
/// The file cannot be read at all.
pub fn check(path: &Path) -> Result<Vec<Error>, Error> {
    Ok(errors_of(&Source::read(path)?).into_iter().map(Error::from).collect())
}

/// All errors of a file and of those that it names.
pub fn errors_of(source: &Source) -> Vec<ConfigError> {
    missing_database(source).into_iter().chain(errors_of_text(source)).collect()
}

/// The error of a channel map that names a database which cannot be read.
fn missing_database(source: &Source) -> Option<ConfigError> {
    if !matches!(source.kind(), Ok(Kind::ChannelMap)) {
        return None;
    }
    let dbc = ChannelMap::database(&source.path, &source.text)?;
    let error = std::fs::File::open(&dbc).err()?;
    let line = source.text.lines().position(|line| line.split('=').next().is_some_and(|key| key.trim() == "dbc"));
    Some(ConfigError::Meaning {
        path: source.path.clone(),
        line: line.map_or(1, |line| line + 1),
        key: "dbc".to_owned(),
        message: format!("{}: {error}", dbc.shown()),
        hint: Some("the path counts from the folder of the map; `--dbc` replaces it".to_owned()),
    })
}

/// The same, but for a log's database that a channel map names.
fn errors_of_text(source: &Source) -> Vec<ConfigError> {
    let mut errors = all_errors(source, &|source| read(source.kind().map_err(alone)?, source));
    // A wrong gearbox file, or none, ends the reading of the car that names it.
    let is_of_gearbox = |error: &ConfigError| match error {
        ConfigError::Meaning { key, .. } if key == "gearbox" => true,
        error => error.path() != source.path,
    };
    if matches!(source.kind(), Ok(Kind::Car)) && errors.iter().any(is_of_gearbox) {
        errors.extend(errors_in_any_gearbox(source));
    }
    let mut named = HashSet::new();
    errors.retain(|error| named.insert(error.to_string()));
    errors
}

/// The errors of a car's file that it has with any gearbox: keys, types and ranges.
fn errors_in_any_gearbox(source: &Source) -> Vec<ConfigError> {
    let Ok(CarFile { gearbox_source, .. }) = CarFile::eight_speed() else { return Vec::new() };
    let of_draft = |draft| CarFile::from_sources(draft, gearbox_source.clone()).map(drop).map_err(alone);
    let errors = all_errors(source, &of_draft);
    let is_of_any = |error: &ConfigError| matches!(error, ConfigError::Syntax { .. } | ConfigError::Range { .. });
    errors.into_iter().filter(is_of_any).collect()
}

/// All errors of the text of a file, and of the text of its gearbox file where it is one of a car whose gearbox file is given; `name` is what
/// messages call it. Those of the car are not looked for in a wrong gearbox.
pub fn errors_of_texts(name: &str, text: &str, gearbox: Option<&str>) -> Vec<Error> {
    let source = Source::built_in(name, text);
    let errors = match gearbox.map(|text| gearbox_source(name, text)) {
        None => errors_of_text(&source),
        Some(gearbox) => match errors_of_text(&gearbox) {
            errors if errors.is_empty() => all_errors(&source, &|draft| match draft.kind().map_err(alone)? {
                Kind::Car => CarFile::from_sources(draft, gearbox.clone()).map(drop).map_err(alone),
                kind => read(kind, draft),
            }),
            errors => errors,
        },
    };
    errors.into_iter().map(Error::from).collect()
}

/// The error of a reader that ends at the first one.
fn alone(error: ConfigError) -> Vec<ConfigError> {
    vec![error]
}

/// Reads a file of a kind, and the files that it names.
fn read(kind: Kind, source: Source) -> Result<(), Vec<ConfigError>> {
    match kind {
        Kind::Gearbox => return GearboxFile::checked(source).map(drop),
        Kind::ChannelMap => return read_map(&source),
        Kind::Car => CarFile::from_source(source).map(drop),
        Kind::CarStudy => CarStudy::from_source(source).map(drop),
        Kind::Drive => read_drive(source),
        Kind::Vehicle => VehicleFile::from_source(source).map(drop),
        Kind::Experiment => ExperimentFile::from_source(source).and_then(|file| file.read_vehicle().map(drop)),
        Kind::Overlay => VehicleFile::check_overlay(&source),
        Kind::Sensors => config::sensors_of(&source).map(drop),
        Kind::Study => Study::from_source(source).map(drop),
        Kind::Learnt => check_learnt(&source),
    }
    .map_err(alone)
}

/// Reads a drive file, and the vehicle file if it names one.
fn read_drive(source: Source) -> Result<(), ConfigError> {
    let drive = DriveFile::from_source(source)?;
    drive.vehicle.as_ref().map_or(Ok(()), |_| drive.read_vehicle().map(drop))
}

/// Reads a channel map; its errors have the form of those of the other files.
fn read_map(source: &Source) -> Result<(), Vec<ConfigError>> {
    let wrong = ChannelMap::all_wrong(&source.text);
    if !wrong.is_empty() {
        return Err(wrong.into_iter().map(|(line, message)| error_of_map(source, line, message)).collect());
    }
    let Err(error) = ChannelMap::of_text(&source.path, &source.text) else { return Ok(()) };
    let (path, text) = (source.path.clone(), error.to_string());
    let placed = text.strip_prefix(&format!("{}:", path.shown())).and_then(|rest| rest.split_once(": "));
    let (line, message) = placed.and_then(|(line, message)| Some((line.parse().ok()?, message))).unwrap_or((1, &text));
    Err(alone(error_of_map(source, line, message.to_owned())))
}

/// An error of a channel map in the form of those of the other files.
fn error_of_map(source: &Source, line: usize, message: String) -> ConfigError {
    let path = source.path.clone();
    let range = || -> Option<ConfigError> {
        let (key, rest) = message.strip_prefix('`')?.split_once("` is ")?;
        let (value, allowed) = rest.split_once(", expected ")?;
        let (allowed, hint) =
            allowed.split_once("\nhint: ").map_or((allowed, None), |(allowed, hint)| (allowed, Some(hint.to_owned())));
        let value = value.parse().ok().filter(|_| allowed.contains(" to "))?;
        Some(ConfigError::Range {
            path: path.clone(),
            line,
            key: key.to_owned(),
            value,
            allowed: allowed.to_owned(),
            hint,
        })
    };
    range().unwrap_or_else(|| ConfigError::Syntax { path: path.clone(), line, message: message.clone() })
}
