//! `wetclutch demo --vehicle`: a drive through all gears of any car, with the estimate of every shift.

use std::path::{Path, PathBuf};

use car::ErrorBudget;
use car::{Car, Drive};
use config::{DriveFile, Source};
use plant::car::{CarCalibration, CarModel, simulate_car_drive};
use report::drive_page::{DrivePage, findings, shift_cells, shift_rows, shift_words};
use report::matrix_page::{kind_rows, not_driven};
use serde_json::json;
use study::gearbox::drive::{ScoredDrive, score_drive};
use study::gearbox::matrix::{Matrix, Random};
use study::gearbox::measured::MeasuredRow;
use study::gearbox::recording::Recording;
use study::gearbox::tour::{self, LeftOut, drive_tour};
use study::gearbox::{RECORD_S, ShiftDraw};
use trace::quantity;
use trace::{Cell, ShownPath as _};
use wetclutch::studies::bench_sensors;

use super::demo::{EarlierDemo, shown};
use super::simulate_drive::{DriveTables, keeps_inputs};
use crate::args::Demo;
use crate::browser;
use crate::commands::{JsonObject, read_car, writable, write_cells, write_text};
use crate::failure::Failure;
use crate::output;

/// The names of the files beside those of the signals.
const PAGE: &str = "report.html";
const SHIFTS: &str = "shifts.csv";
/// The name of the signals' files.
const NAME: &str = "drive";

pub(super) fn demo(options: &Demo, vehicle: &Path) -> Result<(), Failure> {
    let car = read_car(vehicle)?;
    let drive = options.drive.as_deref().map(DriveFile::read).transpose()?;
    let folder = &options.output;
    writable(folder, &[PAGE, SHIFTS])?;
    keeps_inputs(folder, NAME, drive.iter().filter_map(|drive| drive.speeds.as_ref()))?;
    let earlier = EarlierDemo::in_folder(folder)?;
    let mut random = Random(options.seed);
    let draw = ShiftDraw::within(&car, &ErrorBudget::of_car(&car), || random.uniform());
    let model = CarModel::new(draw.car(&car)).map_err(|error| Failure::Input(error.to_string()))?;
    let mut recording = Recording::default();
    let name = match &drive {
        Some(drive) => {
            output::note(&format!("driving \"{}\", {:.0} s", drive.name, drive.duration_s()));
            let drive = Drive { sample_time_s: RECORD_S, ..drive.drive.clone() };
            simulate_car_drive(&model, &car, CarCalibration::of(drive.controller), &drive, |sample| {
                recording.push(sample)
            })?;
            drive.name
        }
        None => {
            output::note("driving through all gears, up and down, with power and without");
            let left_out = drive_tour(&model, &car, |sample| recording.push(sample), || ())?;
            say_left_out(&left_out, &car);
            let not_driven = not_driven(&tour::not_driven(&car)?, &car);
            not_driven.iter().for_each(|sentence| output::note(&format!("warning: {sentence}")));
            "Through all gears".to_owned()
        }
    };
    output::note("running the filter and the open loop");
    let scored = score_drive(&car, &model, &recording, &bench_sensors()?, options.seed)?;
    let signals = write_signals(folder, &car, &recording)?;
    let cells: Vec<Vec<(String, Cell<'_>)>> = scored.shifts.iter().map(|shift| shift_cells(shift, &car)).collect();
    write_cells(&folder.join(SHIFTS), &cells)?;
    let sources: Vec<&Source> = std::iter::once(&car.source).chain(drive.iter().map(|drive| &drive.source)).collect();
    let page =
        DrivePage { name: &name, car: &car, draw: Some((&draw, options.seed)), drive: &scored, sources: &sources };
    write_text(&folder.join(PAGE), &page.html()?)?;
    let written = [PAGE, SHIFTS].into_iter().chain(signals.iter().filter_map(|path| path.file_name()?.to_str()));
    earlier.remove_all_but(written)?;
    if options.json {
        let files = signals.into_iter().chain([PAGE, SHIFTS].map(|name| folder.join(name)));
        let shifts: Vec<_> = cells.into_iter().map(JsonObject::of).collect();
        output::json(&json!({ "files": shown(files), "shifts": shifts }))?;
    } else {
        print(&scored, &car, &folder.join(PAGE))?;
    }
    browser::open_if(options.open.is_wanted, &folder.join(PAGE));
    Ok(())
}

/// Says which shifts the car is too slow for.
fn say_left_out(left_out: &[LeftOut], car: &Car) {
    let name = |gear: usize| &car.gearbox.gears[gear].name;
    let shift = |left: &LeftOut| format!("{}-{}", name(left.leg.from), name(left.leg.to));
    let (mut said, mut behind) = (Vec::new(), Vec::new());
    for left in left_out {
        let sentence = match left.speeds_m_s {
            Some([wanted_m_s, reached_m_s]) => format!(
                "left out: {}, made at {}, which the car does not reach in gear {}: {} at full throttle",
                shift(left),
                quantity(3.6 * wanted_m_s, "km/h", 0),
                name(left.leg.from),
                quantity(3.6 * reached_m_s, "km/h", 0)
            ),
            None => {
                behind.push(shift(left));
                continue;
            }
        };
        if !said.contains(&sentence) {
            said.push(sentence);
        }
    }
    behind.sort_unstable();
    behind.dedup();
    if !behind.is_empty() {
        said.push(format!("left out with it: {}", behind.join(", ")));
    }
    if !said.is_empty() {
        said.push("hint: check mass, ratios, wheel radius, resistance and engine torque; `demo --drive` and `bench --vehicle` need no such speed".to_owned());
    }
    said.iter().for_each(|sentence| output::note(sentence));
}

/// The signals of the drive, as `simulate` writes them.
fn write_signals(folder: &Path, car: &Car, recording: &Recording) -> Result<Vec<PathBuf>, Failure> {
    let mut tables = DriveTables::create(folder, NAME, car, None)?;
    recording.samples.iter().try_for_each(|sample| tables.write(car, &MeasuredRow::exact(sample)))?;
    tables.finish(folder, Vec::new())
}

fn print(drive: &ScoredDrive, car: &Car, page: &Path) -> Result<(), Failure> {
    output::line(&format!(
        "RMS error of the clutch torque, relative to the open loop, and both errors: filter / open loop. Of the clutch that\n\
         controls the inertia phase; in brackets where the open loop errs by less than {}\n",
        quantity(2.0, "N m", 0)
    ))?;
    for (left, (titles, rows)) in [(3, shift_rows(drive, car)), (2, kind_rows(&Matrix::of_drive(drive, car)))] {
        output::titled_lines(left, &titles, &rows).iter().try_for_each(|line| output::line(line))?;
        output::line("")?;
    }
    for (word, meaning) in shift_words(drive, car) {
        output::line(&format!("{word}: {meaning}"))?;
    }
    output::line("")?;
    for sentence in findings(drive) {
        output::line(&sentence)?;
    }
    output::line(&format!("\nreport: {}", page.shown()))?;
    Ok(())
}
