//! What `wetclutch check --json` prints.

use std::path::Path;

use config::{CarFile, ConfigError, DefaultTaken, Kind, Source, VehicleFile};
use serde_json::{Value, json};
use trace::ShownPath as _;
use wetclutch::checks::errors_of;

use crate::args::Check;
use crate::failure::Failure;
use crate::output;

/// Checks the files, and prints the errors of all.
pub(super) fn check(options: &Check) -> Result<(), Failure> {
    let checked: Vec<Checked> = options.files.iter().map(|file| Checked::of(file)).collect();
    let files: Vec<Value> = options.files.iter().zip(&checked).map(|(file, checked)| checked.json(file)).collect();
    output::json(&json!({ "files": files }))?;
    match checked.iter().filter(|checked| !checked.errors.is_empty()).count() {
        0 => Ok(()),
        wrong => Err(Failure::Input(format!("{wrong} of {} files have errors", options.files.len()))),
    }
}

/// What is known of a file.
#[derive(Default)]
struct Checked {
    kind: Option<Kind>,
    errors: Vec<ConfigError>,
    warnings: Vec<String>,
    defaults: Vec<DefaultTaken>,
}

impl Checked {
    fn of(file: &Path) -> Self {
        let source = match Source::read(file) {
            Ok(source) => source,
            Err(error) => return Self { errors: vec![error], ..Self::default() },
        };
        let errors = errors_of(&source);
        let kind = source.kind().ok();
        match kind.filter(|_| errors.is_empty()) {
            Some(Kind::Vehicle) => VehicleFile::from_source(source).map(|vehicle| {
                let warnings = vehicle.implausible();
                Self { kind, warnings, defaults: vehicle.defaults_taken, ..Self::default() }
            }),
            Some(Kind::Car) => CarFile::from_source(source).map(|car| {
                let warnings = car.implausible().into_iter().chain(car.why_not_driven()).collect();
                Self { kind, warnings, defaults: car.defaults_taken, ..Self::default() }
            }),
            _ => Ok(Self { kind, errors, ..Self::default() }),
        }
        .unwrap_or_else(|error| Self { kind, errors: vec![error], ..Self::default() })
    }

    fn json(&self, file: &Path) -> Value {
        let default = |taken: &DefaultTaken| json!({ "key": taken.key, "value": taken.value });
        json!({
            "file": file.shown().to_string(),
            "describes": self.kind.map(Kind::words),
            "errors": self.errors.iter().map(of_error).collect::<Vec<_>>(),
            "warnings": self.warnings,
            "defaults": self.defaults.iter().map(default).collect::<Vec<_>>(),
        })
    }
}

/// An error with what it is about, as far as it has it.
fn of_error(error: &ConfigError) -> Value {
    let what = error.what();
    let (message, hint) = what.split_once("\nhint: ").map_or((what.as_str(), None), |(what, hint)| (what, Some(hint)));
    let (key, value, expected) = match error {
        ConfigError::Range { key, value, allowed, .. } => (Some(key), Some(*value), Some(allowed)),
        ConfigError::Meaning { key, .. } => (Some(key), None, None),
        ConfigError::Read { .. } | ConfigError::Syntax { .. } => (None, None, None),
    };
    json!({
        "file": error.path().shown().to_string(),
        "line": error.line(),
        "key": key,
        "value": value,
        "expected": expected,
        "message": message,
        "hint": hint,
    })
}
