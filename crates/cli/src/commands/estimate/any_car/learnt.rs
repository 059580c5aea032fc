//! What the filter has learnt of a car, from one log to the next.

use std::io::ErrorKind;
use std::path::Path;

use car::Car;
use config::{ConfigError, Source, read_learnt, write_learnt};
use observer::ShiftTables;
use observer::any_shift::{Learnt, LearntElement};
use study::any_shift::logged::LoggedDrive;
use trace::{ShownPath as _, WholeFile};

use super::super::Messages;
use crate::commands::{check_output, write_text};
use crate::failure::Failure;

/// Part of the unlearnt deviation from which on nothing is said of a quantity \[chosen\]: the log has shown next to nothing of it.
const SHOWN: f64 = 0.9;

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

/// What is known after the last row of a log.
pub(super) struct Kept<'a> {
    path: &'a Path,
    /// The file; none after a log that teaches nothing. Each log begins in doubt of what was learnt before, and to write it again
    /// would wear it off.
    text: Option<String>,
    /// What is said once it is written.
    said: Vec<String>,
}

impl<'a> Kept<'a> {
    pub(super) fn of(path: &'a Path, car: &Car, tables: &ShiftTables<f64>, drive: &LoggedDrive<'_>) -> Self {
        let (_, learnt, count) = drive.learnt();
        let file = path.shown();
        if !count.has_changed() {
            let state = if path.exists() { "stays as it is" } else { "is not written" };
            let nothing = format!("learnt: nothing, no shift of this log could be learnt from; {file} {state}");
            return Self { path, text: None, said: vec![nothing] };
        }
        let mut said = Vec::new();
        if count.forgotten > 0 {
            said.push(format!(
                "warning: shifts of this log contradict what was learnt before them, and it is forgotten; was {file} of another car?"
            ));
        }
        said.push(format!("learnt: {file}, after {} shifts of this log ({} in all)", count.taken, learnt.shifts));
        said.extend(sentences(car, tables, drive));
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

/// What is known of the car beside its vehicle file, with standard deviations.
fn sentences(car: &Car, tables: &ShiftTables<f64>, drive: &LoggedDrive<'_>) -> Vec<String> {
    let (filter, learnt, _) = drive.learnt();
    let elements = car.gearbox.elements.iter().enumerate();
    let elements: Vec<_> = elements
        .filter_map(|(at, element)| Some((element.name.as_str(), filter.learnt_element(learnt, tables.place(at)?)?)))
        .collect();
    let list = |value: &dyn Fn(&LearntElement<f64>) -> [f64; 2], per_unit: f64| {
        let of = |(name, element): &(&str, _)| {
            let [error, deviation] = value(element).map(|value| per_unit * value);
            format!("{name} {error:+.1} +-{deviation:.1}")
        };
        elements.iter().map(of).collect::<Vec<_>>().join(", ")
    };
    let mut said = vec![
        format!(
            "learnt torque at the same pressure (friction times gain), % above the vehicle file: {}",
            list(&|of| of.torque_share, 100.0)
        ),
        format!("learnt kiss points, kPa above the vehicle file: {}", list(&|of| of.kiss_pa, 1e-3)),
    ];
    let timing = |which: usize, per_unit: f64| {
        let of = |(at, element): (usize, &geartrain::GearboxElement)| {
            let value = filter.learnt_timing(learnt, tables.place(at)?)?[which].map(|value| per_unit * value);
            Some(format!("{} {:+.0} +-{:.0}", element.name, value[0], value[1]))
        };
        let elements = car.gearbox.elements.iter().enumerate();
        elements.filter_map(of).collect::<Vec<_>>().join(", ")
    };
    said.push(format!("learnt lag of the valves, % above the vehicle file: {}", timing(0, 100.0)));
    said.push(format!("learnt delay of the valves, ms above the middle of its bounds: {}", timing(1, 1e3)));
    let [input, reported] = filter.learnt_sources(learnt).map(|of| of.map(|value| 100.0 * value));
    let source =
        if car.converter.is_some() { "by the converter of the vehicle file" } else { "that the engine reports" };
    said.push(format!(
        "learnt torque at the gearbox input: {:+.1} +-{:.1} % above the one {source}",
        input[0], input[1]
    ));
    let unlearnt = 100.0 * filter.turbine.engine_share;
    if car.converter.is_some() && reported[1] < SHOWN * unlearnt {
        said.push(format!(
            "learnt reported engine torque: {:+.1} +-{:.1} % above the true one",
            reported[0], reported[1]
        ));
    }
    let [scale, deviation] = filter.learnt_wheel_scale(learnt);
    if deviation < SHOWN * filter.uncertainty.wheel_scale {
        said.push(format!(
            "learnt scale of the wheel speed: it reads {:+.2} +-{:.2} % of the true one",
            100.0 * scale,
            100.0 * deviation
        ));
    }
    said
}
