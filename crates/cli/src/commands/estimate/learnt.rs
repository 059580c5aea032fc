//! The file of what the filter has learnt of a car, from one log to the next.

use std::io::ErrorKind;
use std::path::Path;

use car::Car;
use config::{ConfigError, Source, read_learnt, write_learnt};
use observer::gearbox::Learnt;
use trace::shown_units::with_unit;
use trace::{ShownPath as _, WholeFile};
use wetclutch::estimate::gearbox::LearntOfDrive;

use super::Messages;
use crate::commands::{check_output, write_text};
use crate::failure::Failure;

/// Checks that the file can be used, before anything is estimated.
pub(super) fn check(path: &Path, car: &Car) -> Result<(), Failure> {
    if path == Path::new("-") {
        let message =
            "--learnt -: what was learnt is read from a file and written to it\nhint: name one, such as learnt.toml";
        return Err(Failure::Input(message.to_owned()));
    }
    check_output(Some(&path.to_owned()))?;
    read(path, car)?;
    // A file that is created and dropped before it gets its name leaves nothing behind.
    WholeFile::create(path).map(drop).map_err(|error| Failure::writing(path, &error))
}

/// What was learnt before; none without the file.
pub(super) fn read(path: &Path, car: &Car) -> Result<Option<Learnt<f64>>, Failure> {
    match std::fs::metadata(path) {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        _ => Source::read(path).and_then(|source| read_learnt(&car.gearbox, &source)).map(Some).map_err(no_learnt),
    }
}

/// A file that is another one, or no such file at all, where the error has no hint of its own.
fn no_learnt(error: ConfigError) -> Failure {
    match Failure::from(error) {
        Failure::Input(message) if !message.contains("\nhint: ") => Failure::Input(format!(
            "{message}\nhint: --learnt takes a file that an earlier run wrote with this option, or the name of a new one"
        )),
        failure => failure,
    }
}

/// What becomes of the file after a log.
pub(super) struct Kept<'a> {
    path: &'a Path,
    /// The file; none after a log that teaches nothing.
    text: Option<String>,
    /// What is said once it is written.
    said: Vec<String>,
}

impl<'a> Kept<'a> {
    pub(super) fn of(path: &'a Path, car: &Car, of_drive: &LearntOfDrive) -> Self {
        let file = path.shown();
        let Some(learnt) = &of_drive.learnt else {
            let state = if path.exists() { "stays as it is" } else { "is not written" };
            let nothing = format!("learnt: nothing, no shift of this log could be learnt from; {file} {state}");
            return Self { path, text: None, said: vec![nothing] };
        };
        let mut said = Vec::new();
        if of_drive.was_forgotten {
            said.push(format!(
                "warning: shifts of this log contradict what was learnt before them, and it is forgotten\nhint: check that {file} is of this car"
            ));
        }
        let [taken, all] = of_drive.shifts;
        said.push(format!("learnt: {file}, after {taken} shifts of this log ({all} in all)"));
        said.extend(of_drive.sentences.iter().cloned().map(with_unit));
        Self { path, text: Some(write_learnt(&car.gearbox, learnt)), said }
    }

    /// Writes the file, whole or not at all, and says what it has.
    pub(super) fn write(self, say: &mut Messages) -> Result<(), Failure> {
        if let Some(text) = &self.text {
            write_text(self.path, text)?;
        }
        self.said.iter().for_each(|sentence| say.note(sentence));
        Ok(())
    }
}
