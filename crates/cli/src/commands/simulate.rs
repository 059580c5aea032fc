//! `wetclutch simulate`.

use std::path::PathBuf;

use car::{Experiment, Sensors, Vehicle};
use config::{ExperimentFile, Kind, Source};
use serde_json::{Value, json};
use study::drive::{DriveColumns, DriveRow, Recording};
use study::sampling::through_sensors;
use study::{ShiftQuality, ShiftRating, ShiftSample};
use trace::quantity;
use trace::{CsvWriter, ShownPath as _, Trace, WholeFile, signal};

use super::simulate_drive::simulate_drive;
use crate::args::Simulate;
use crate::commands::not_an_input;
use crate::commands::written::{head, replaces_only};
use crate::failure::Failure;
use crate::output;

pub(crate) fn simulate(options: &Simulate) -> Result<(), Failure> {
    if Source::read(&options.experiment)?.kind()? == Kind::Drive {
        return simulate_drive(options);
    }
    if let Some(vehicle) = &options.vehicle {
        let message =
            format!("{}: an experiment names its vehicle file\nhint: --vehicle is for a drive file", vehicle.shown());
        return Err(Failure::Input(message));
    }
    let experiment = ExperimentFile::read(&options.experiment)?;
    let vehicle = experiment.read_vehicle()?;
    let (experiment, name) = chosen(experiment, options)?;
    for name in [format!("{name}.csv"), format!("{name}_measured.csv")] {
        not_an_input(Some(&options.output.join(name)), [&options.experiment, &vehicle.source.path])?;
    }
    replaces_only_simulated(&[".csv", "_measured.csv"].map(|ending| options.output.join(format!("{name}{ending}"))))?;
    let mut whole = Table::create(options.output.join(format!("{name}.csv")), &vehicle, |_| true)?;
    let path = options.output.join(format!("{name}_measured.csv"));
    let mut measured = Measured::create(path, &vehicle, &experiment)?;
    if let Some(note) = size_note(experiment.duration_s, experiment.sample_time_s, ROW_BYTES) {
        output::note(&note);
    }
    let mut rating = ShiftRating::new(&vehicle.shift);
    let mut written = Ok(());
    plant::simulate(&vehicle, &experiment, |sample| {
        // After a write error the simulation continues to its end without writing: this takes seconds.
        if written.is_ok() {
            rating.push(&ShiftSample::of(sample));
            let row = DriveRow::of(sample);
            written = whole.write(&row).and_then(|()| measured.take(sample, &row));
        }
    })?;
    written?;
    let ((whole_file, whole), (measured_file, measured)) = (whole.complete()?, measured.complete()?);
    WholeFile::finish_all([whole_file, measured_file]).map_err(|error| Failure::writing(&options.output, &error))?;
    let rated = rating.finish();
    match &rated {
        Some(quality) => output::note(&format!(
            "shift: torque phase {:.3} to {:.3} s, inertia phase to {:.3} s, flare {}, jerk {:.1} m/s^3",
            quality.torque_phase_start_s,
            quality.inertia_phase_start_s,
            quality.lock_up_s,
            quantity(quality.flare_rad_s, "rad/s", 1),
            quality.jerk_peak_m_s3,
        )),
        None => output::note("the shift was not completed within the simulated time"),
    }
    print(options, &[whole, measured], &json!({ "shift": rated.as_ref().map(of_shift) }))
}

/// Refuses to replace tables that no simulation wrote: the one with all signals has the true phase or stage, and the measured one stands beside it.
pub(super) fn replaces_only_simulated(paths: &[PathBuf]) -> Result<(), Failure> {
    const TRUTH: [&str; 2] = ["true_phase", "shift_stage"];
    let has_truth = |titles: &str| titles.split(',').any(|name| TRUTH.contains(&name));
    let is_simulated = paths.first().is_some_and(|path| head(path).lines().next().is_some_and(has_truth));
    paths.iter().try_for_each(|path| replaces_only("table of this simulation", path, |_| is_simulated))
}

/// The shift in SI.
fn of_shift(quality: &ShiftQuality) -> Value {
    json!({
        "torque_phase_start_s": quality.torque_phase_start_s,
        "inertia_phase_start_s": quality.inertia_phase_start_s,
        "lock_up_s": quality.lock_up_s,
        "flare_rad_s": quality.flare_rad_s,
        "least_shaft_torque_n_m": quality.least_shaft_torque_n_m,
        "jerk_peak_m_s3": quality.jerk_peak_m_s3,
        "vibration_dose_m_s1_75": quality.vibration_dose_m_s1_75,
        "friction_work_j": quality.friction_work_j,
    })
}

/// Prints the files, or with what is known of the drive as JSON.
pub(super) fn print(options: &Simulate, files: &[PathBuf], about: &Value) -> Result<(), Failure> {
    let mut files = files.iter().map(|path| path.shown().to_string());
    if options.json {
        return output::json(&json!({ "files": files.collect::<Vec<_>>(), "drive": about }));
    }
    Ok(files.try_for_each(|file| output::line(&file))?)
}

/// The signals that a car measures: exact ones as they come, or what its sensors read of the whole drive.
enum Measured<'a> {
    Exact(Box<Table>),
    Sensed { path: PathBuf, recording: Box<Recording>, sensors: &'a Sensors, row_s: f64, vehicle: &'a Vehicle },
}

impl<'a> Measured<'a> {
    fn create(path: PathBuf, vehicle: &'a Vehicle, experiment: &'a ExperimentFile) -> Result<Self, Failure> {
        let Some(sensors) = &experiment.sensors else {
            let table = Table::create(path, vehicle, |name| signal::MEASURABLE.contains(&name))?;
            return Ok(Self::Exact(Box::new(table)));
        };
        // Teeth are counted in the whole drive.
        experiment.check_size()?;
        let recording = Box::new(Recording::new(vehicle, Trace::default()));
        Ok(Self::Sensed { path, recording, sensors, row_s: row_s(experiment, sensors), vehicle })
    }

    fn take(&mut self, sample: &plant::Sample, row: &DriveRow) -> Result<(), Failure> {
        match self {
            Self::Exact(table) => table.write(row)?,
            Self::Sensed { recording, .. } => recording.take(sample),
        }
        Ok(())
    }

    fn complete(self) -> Result<(WholeFile, PathBuf), Failure> {
        match self {
            Self::Exact(table) => table.complete(),
            Self::Sensed { path, recording, sensors, row_s, vehicle } => {
                let read = through_sensors(&recording.finish(), row_s, sensors, vehicle);
                let is_age = |name: &str| signal::AGES.iter().any(|(_, age)| *age == name);
                let read = read.filtered(|name| signal::MEASURABLE.contains(&name) || is_age(name));
                let file = trace::csv_written(&path, &read).map_err(|error| Failure::writing(&path, &error))?;
                Ok((file, path))
            }
        }
    }
}

/// Time between two rows of readings, s: that of the observers that read them, else of the fastest channel.
fn row_s(experiment: &Experiment, sensors: &Sensors) -> f64 {
    let observers = experiment.observers.iter().filter(|entry| entry.real_sensors).map(|entry| entry.sample_time_s);
    let channels = [&sensors.engine, &sensors.turbine, &sensors.output, &sensors.wheel].map(|of| of.sample_time_s);
    let fastest_s = channels.into_iter().fold(f64::INFINITY, f64::min);
    observers.reduce(f64::min).unwrap_or(fastest_s).max(experiment.sample_time_s)
}

/// Some columns of the drive, written as it is simulated.
struct Table {
    path: PathBuf,
    columns: DriveColumns,
    writer: CsvWriter<WholeFile>,
}

impl Table {
    fn create(path: PathBuf, vehicle: &Vehicle, keep: impl Fn(&str) -> bool) -> Result<Self, Failure> {
        let columns = DriveColumns::those(vehicle, keep);
        let writer = WholeFile::create(&path).and_then(|file| CsvWriter::new(file, columns.names()));
        let writer = writer.map_err(|error| Failure::writing(&path, &error))?;
        Ok(Self { path, columns, writer })
    }

    fn write(&mut self, row: &DriveRow) -> Result<(), Failure> {
        let written = self.writer.row(row.time_s, self.columns.cells(row));
        written.map_err(|error| Failure::writing(&self.path, &error))
    }

    /// The file, which contains every row, and its path.
    fn complete(self) -> Result<(WholeFile, PathBuf), Failure> {
        match self.writer.finish() {
            Ok(file) => Ok((file, self.path)),
            Err(error) => Err(Failure::writing(&self.path, &error)),
        }
    }
}

/// Bytes that a row takes in both files: those of experiment E1.
const ROW_BYTES: f64 = 456.0;
/// Size above which the size is printed before the simulation, bytes.
const LARGE_BYTES: f64 = 1e9;

/// The size of the files, if they will be large.
pub(super) fn size_note(duration_s: f64, step_s: f64, row_bytes: f64) -> Option<String> {
    let rows = (duration_s / step_s).round();
    let bytes = rows * row_bytes;
    (bytes > LARGE_BYTES).then(|| {
        let giga = (1e-9 * bytes).round();
        format!(
            "{duration_s} s with a sample time of {step_s} s are {} rows, about {giga} GB in two files",
            wetclutch::grouped(rows as u64)
        )
    })
}

/// The selected drive, and the name of its files.
fn chosen(mut experiment: ExperimentFile, options: &Simulate) -> Result<(ExperimentFile, String), Failure> {
    let name = experiment.name.to_lowercase();
    let names = || experiment.scenarios.iter().map(|scenario| scenario.name.as_str()).collect::<Vec<_>>().join("\n  ");
    let Some(wanted) = &options.scenario else {
        if !experiment.scenarios.is_empty() {
            output::note(&format!("simulating without a scenario; the values of `--scenario` are\n  {}", names()));
        }
        return Ok((experiment, name));
    };
    match experiment.scenarios.iter().find(|scenario| scenario.name == *wanted) {
        Some(scenario) => {
            // With a dot, a scenario called `measured` has files of its own.
            let name = format!("{name}.{}", scenario.file_name());
            experiment.experiment = experiment.with_scenario(scenario);
            Ok((experiment, name))
        }
        None => {
            let path = experiment.source.path.shown();
            let hint = match experiment.scenarios.is_empty() {
                true => "the experiment has no scenarios".to_owned(),
                false => format!("the scenarios are\n  {}", names()),
            };
            Err(Failure::Input(format!("{path}: there is no scenario \"{wanted}\"\nhint: {hint}")))
        }
    }
}
