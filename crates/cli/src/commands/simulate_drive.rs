//! `wetclutch simulate` of a drive file.

use std::path::{Path, PathBuf};

use car::{Car, Sensors};
use config::DriveFile;
use evaluate::drive::ScoredShift;
use evaluate::measured::MeasuredRow;
use plant::car::{CarModel, OverSpeed};
use report::drive_page::simulated_shift_cells;
use serde_json::json;
use trace::quantity;
use trace::units::{km_h, rpm};
use trace::{CsvWriter, ShownPath as _, WholeFile};
use wetclutch::simulate::{DriveColumn, SimulatedShifts, drive_columns, measured_columns, sensors_of, simulate_rows};

use super::car::{describe_car, read_car, warn_of_slipping};
use super::simulate::{print, replaces_only_simulated, size_note};
use super::written::{head, replaces_only};
use super::{cells_file, not_an_input};
use crate::args::Simulate;
use crate::failure::Failure;
use crate::output;

/// Bytes that a row takes in both files: those of the eight-speed car in `drives/city.toml`.
const ROW_BYTES: f64 = 500.0;

pub(super) fn simulate_drive(options: &Simulate) -> Result<(), Failure> {
    let file = DriveFile::read(&options.experiment)?;
    let car = match &options.vehicle {
        Some(vehicle) => {
            let car = read_car(vehicle)?;
            file.check_names(&car.car)?;
            car
        }
        None => file.read_vehicle().inspect(warn_of_slipping)?,
    };
    if options.scenario.is_some() {
        let message = format!("{}: a drive has no scenarios\nhint: leave --scenario out", options.experiment.shown());
        return Err(Failure::Input(message));
    }
    let drive = &file.drive;
    if let Some(note) = size_note(drive.duration_s(), drive.sample_time_s, ROW_BYTES) {
        output::note(&note);
    }
    let name = drive.name.to_lowercase();
    let inputs = std::iter::once(&options.experiment).chain(&options.vehicle);
    let inputs = inputs.chain(&file.speeds);
    keeps_inputs(&options.output, &name, inputs.clone())?;
    let [whole, measured] = paths(&options.output, &name);
    let of_shifts = options.output.join(format!("{name}_shifts.csv"));
    not_an_input(Some(&of_shifts), inputs)?;
    replaces_only_simulated(&[whole, measured])?;
    replaces_only("table of shifts of a simulation", &of_shifts, is_of_simulation)?;
    let mut tables = DriveTables::create(&options.output, &name, &car, sensors_of(drive))?;
    let model = CarModel::new(car.car.clone()).map_err(|error| Failure::Input(error.to_string()))?;
    let mut shifts = SimulatedShifts::new(&car, &model);
    let summary = simulate_rows(&car, drive, |row| {
        shifts.push(&row.sample);
        tables.write(&car, row)
    })?;
    let shifts = shifts.finish();
    let cells: Vec<_> = shifts.iter().map(|shift| simulated_shift_cells(shift, &car)).collect();
    let titles = simulated_shift_cells(&ScoredShift::none(), &car);
    let titles = titles.iter().map(|(name, _)| name.as_str());
    let paths = tables.finish(&options.output, vec![(cells_file(&of_shifts, titles, &cells)?, of_shifts)])?;
    output::note(&format!(
        "drive: {:.0} s, {:.2} km{}, {} shifts, at most {}",
        summary.duration_s,
        1e-3 * summary.distance_m,
        backwards(1e-3 * summary.backwards_m),
        summary.shifts,
        quantity(km_h(summary.fastest_m_s), "km/h", 0),
    ));
    if let Some(error) = summary.speed_error {
        output::note(&format!(
            "speed: error {} (root mean square), at most {}; outside the tolerance of {} and 1 s for {:.2} % of the time",
            quantity(km_h(error.rms_m_s), "km/h", 2),
            quantity(km_h(error.largest_m_s), "km/h", 1),
            quantity(2.0, "km/h", 0),
            100.0 * error.beyond,
        ));
    }
    if let Some(over) = &summary.over_speed {
        output::note(&over_speed(over, &car));
    }
    let speed_error = summary.speed_error.map(|error| {
        json!({ "rms_m_s": error.rms_m_s, "largest_m_s": error.largest_m_s, "fraction_of_time_beyond": error.beyond })
    });
    let about = json!({
        "duration_s": summary.duration_s,
        "distance_m": summary.distance_m,
        "backwards_m": summary.backwards_m,
        "shifts": summary.shifts,
        "fastest_m_s": summary.fastest_m_s,
        "speed_error": speed_error,
    });
    print(options, &paths, &about)
}

/// Whether a table of shifts is of a simulation: it has no estimates.
fn is_of_simulation(path: &Path) -> bool {
    const TITLES: &str = ",acceleration_source,offgoing_friction_work_j,oncoming_friction_work_j";
    head(path).lines().next().is_some_and(|titles| titles.ends_with(TITLES))
}

/// What of a distance was driven backwards, in words; nothing where it is too short to be shown.
fn backwards(km: f64) -> String {
    if km < 0.005 { String::new() } else { format!(" ({km:.2} km of it backwards)") }
}

/// What a drive asks of the engine that it cannot do.
fn over_speed(over: &OverSpeed, car: &Car) -> String {
    let OverSpeed { time_s, engine_rad_s, map_rad_s, gears } = *over;
    let [from, to] = [gears.from, gears.to].map(|gear| car.gear_name(gear));
    let in_gear = if from == to { format!("in gear {from}") } else { format!("in the shift {from}-{to}") };
    format!(
        "warning: the engine turns at {} {in_gear} at {time_s:.2} s, and its torque map ends at {}: beyond, a \
         speed limiter takes its torque away\nhint: a gearbox controller would refuse such a shift; check [[shift]], the schedule and the grade",
        quantity(rpm(engine_rad_s), "rpm", 0),
        quantity(rpm(map_rad_s), "rpm", 0)
    )
}

/// The two files of a drive: every signal, and those that a car measures or commands.
pub(super) struct DriveTables {
    whole: Table,
    measured: Table,
}

/// The files of a drive of this name.
fn paths(folder: &Path, name: &str) -> [PathBuf; 2] {
    [format!("{name}.csv"), format!("{name}_measured.csv")].map(|name| folder.join(name))
}

/// Refuses to write the files of a drive over what it is made from, such as its speed cycle.
pub(super) fn keeps_inputs<'a>(
    folder: &Path,
    name: &str,
    inputs: impl Iterator<Item = &'a PathBuf> + Clone,
) -> Result<(), Failure> {
    paths(folder, name).iter().try_for_each(|path| not_an_input(Some(path), inputs.clone()))
}

impl DriveTables {
    /// Begins `NAME.csv` and `NAME_measured.csv`; the latter goes through sensors where there are some, with this time between rows.
    pub(super) fn create(
        folder: &Path,
        name: &str,
        car: &Car,
        sensors: Option<(&Sensors, f64)>,
    ) -> Result<Self, Failure> {
        let (columns, measured) = (drive_columns(car), measured_columns(car, sensors));
        let [whole_path, measured_path] = paths(folder, name);
        Ok(Self { whole: Table::create(whole_path, columns)?, measured: Table::create(measured_path, measured)? })
    }

    pub(super) fn write(&mut self, car: &Car, row: &MeasuredRow) -> Result<(), Failure> {
        self.whole.write(car, &MeasuredRow::exact(&row.sample))?;
        self.measured.write(car, row)
    }

    /// Gives both files their names, and these others with them.
    pub(super) fn finish(self, folder: &Path, others: Vec<(WholeFile, PathBuf)>) -> Result<Vec<PathBuf>, Failure> {
        let both = [self.whole.complete()?, self.measured.complete()?];
        let (files, paths): (Vec<_>, Vec<_>) = both.into_iter().chain(others).unzip();
        WholeFile::finish_all(files).map_err(|error| Failure::writing(folder, &error))?;
        Ok(paths)
    }
}

/// Some columns of the drive, written as it is simulated.
struct Table {
    path: PathBuf,
    columns: Vec<DriveColumn>,
    writer: CsvWriter<WholeFile>,
}

impl Table {
    fn create(path: PathBuf, columns: Vec<DriveColumn>) -> Result<Self, Failure> {
        let names = columns.iter().map(|column| column.name.as_str());
        let writer = WholeFile::create(&path).and_then(|file| CsvWriter::new(file, names));
        let writer = writer.map_err(|error| Failure::writing(&path, &error))?;
        Ok(Self { path, columns, writer })
    }

    fn write(&mut self, car: &Car, row: &MeasuredRow) -> Result<(), Failure> {
        let cells = self.columns.iter().map(|column| column.cell(car, row));
        self.writer.row(row.sample.time_s, cells).map_err(|error| Failure::writing(&self.path, &error))
    }

    /// The file, which contains every row, and its path.
    fn complete(self) -> Result<(WholeFile, PathBuf), Failure> {
        match self.writer.finish() {
            Ok(file) => Ok((file, self.path)),
            Err(error) => Err(Failure::writing(&self.path, &error)),
        }
    }
}

/// Prints what a drive file describes.
pub(super) fn describe_drive(drive: &DriveFile, path: &Path) -> Result<(), Failure> {
    let given = match &drive.trace {
        Some(trace) => format!("by {} speeds", trace.points()),
        None => format!("in {} segments", drive.segments.len()),
    };
    output::line(&format!(
        "drive {}: {:.0} s {given}, driven {} times",
        drive.name,
        drive.duration_s(),
        drive.repetitions
    ))?;
    match drive.vehicle {
        Some(_) => {
            let car = drive.read_vehicle()?;
            describe_car(&car)?;
            warn_of_slipping(&car);
            Ok(())
        }
        None => {
            output::line(&format!("use: wetclutch simulate {} --vehicle VEHICLE -o DIR", path.shown()))?;
            Ok(())
        }
    }
}
