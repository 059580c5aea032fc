//! `wetclutch estimate` of a drive of a car with any gearbox.

mod checks;
mod columns;
mod learnt;
mod passing;
pub(in crate::commands) mod source;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use car::{Car, Sensors};
use config::CarFile;
use logs::ChannelMap;
use observer::ShiftTables;
use report::drive_page::{DrivePage, MOST_DRAWN, findings, shift_cells, shift_rows, shift_words};
use study::any_shift::drive::ScoredDrive;
use study::any_shift::logged::LoggedDrive;
use trace::{Cell, ShownPath as _};

use self::checks::{RowTimes, refused};
pub(super) use self::columns::is_car_column;
use self::columns::{Knows, Row, before_readings, chosen, columns};
use self::learnt::Kept;
use self::passing::Passing;
use self::source::{CarReading, CarSource};
use super::log_checks::{WITHOUT_SENSORS, slow_log};
use super::observer::sensors;
use super::outputs::{Output, beside, remove_old};
use super::ratios::check_wheel;
use super::selection::Selection;
use super::{Messages, said_of_origin, say_end_of_followed};
use crate::args::{Estimate, ObserverChoice};
use crate::commands::{JsonObject, channel_map_of_car, shown_from_s, write_cells, write_json_list, write_text};
use crate::failure::Failure;
use crate::output;

/// Rows of the table of shifts that a terminal shows.
const SHOWN: usize = 40;

/// Refuses options that have no effect with the filter for any shift.
pub(super) fn check_options(options: &Estimate) -> Result<(), Failure> {
    let refuse = |option: &str, hint: &str| {
        let message = format!("{option} has no effect with the vehicle file of a car with a gearbox\nhint: {hint}");
        Err(Failure::Input(message))
    };
    if options.observer != ObserverChoice::Best || options.method.is_some() {
        let hint = "leave it out; the filter for any shift also writes the estimate of the valve model alone";
        return refuse(if options.method.is_some() { "--method" } else { "--observer" }, hint);
    }
    Ok(())
}

/// What is common to all logs of a command.
pub(super) struct CarSetup<'a> {
    options: &'a Estimate,
    car: CarFile,
    tables: ShiftTables<f64>,
    sensors: Option<Sensors>,
    map: ChannelMap,
    /// Set when a log that is followed is to end.
    stop: Arc<AtomicBool>,
}

impl<'a> CarSetup<'a> {
    pub(super) fn new(options: &'a Estimate) -> Result<Self, Failure> {
        let car = CarFile::read(&options.vehicle)?;
        if options.learnt.is_some() && car.gearbox.has_ratios_alone() {
            let vehicle = options.vehicle.shown();
            let message = format!("--learnt has no effect with {vehicle}: the ratios alone are known of its gearbox");
            let hint =
                "leave it out; what is learnt is of clutches and valves, which such a gearbox file does not have";
            return Err(Failure::Input(format!("{message}\nhint: {hint}")));
        }
        let sensors = options.sensors.as_deref().map(sensors).transpose()?;
        let tables = LoggedDrive::tables(&car, sensors.as_ref())?;
        let map = channel_map_of_car(&options.mapping, car.road.wheel_radius_m)?;
        options.learnt.as_deref().map(|path| learnt::check(path, &car)).transpose()?;
        Ok(Self { options, car, tables, sensors, map, stop: super::stop(options)? })
    }
}

/// Estimates a log, and says what was found and where it is.
pub(super) fn estimate(
    setup: &CarSetup<'_>,
    path: &Path,
    output: Option<&Path>,
    say: &mut Messages,
) -> Result<(), Failure> {
    let CarSetup { options, car, tables, .. } = setup;
    let mut opened = None;
    let stop = options.follow.then_some(&setup.stop);
    let reading = CarReading { car, tables, map: &setup.map, stop, threads: options.threads_of_log() };
    let mut log = CarSource::open(reading, path, &mut opened)?;
    let before = options.learnt.as_deref().map(|path| learnt::read(path, car)).transpose()?.flatten();
    let mut drive = LoggedDrive::new(car, tables, setup.sensors.as_ref(), before.as_ref());
    // Places of the elements in the filter's tables, by name.
    let elements = car.gearbox.elements.iter().enumerate();
    let places: Vec<(usize, &str)> =
        elements.filter_map(|(at, element)| Some((tables.place(at)?, element.name.as_str()))).collect();
    let columns = chosen(columns(&places, Knows::of(car)), &options.columns)?;
    let (before_readings, mut said) = (before_readings(&columns), None);
    let named = columns.iter().map(|column| (column.name.as_str(), column.kind));
    let mut table = Output::named(output, named)?;
    let mut passing = Passing::new(Selection::of(options));
    let mut checks = log.columns(car, tables);
    let mut times = RowTimes::default();
    // Without a page no shift is drawn.
    let most_drawn = output.and_then(beside).map_or(0, |_| MOST_DRAWN);
    while let Some(step) = log.next_step()? {
        times.push(&step);
        if let Some(checks) = &mut checks {
            checks.push(&step);
        }
        let estimate = drive.push(&step);
        drive.draw_at_most(most_drawn, |shift| passing.wants(shift.number, car, [shift.from, shift.to]));
        let gears = [step.input.gear.from, step.input.gear.to];
        let row = Row { car, places: &places, gears, estimate, ranges_pa: drive.pressure_ranges_pa() };
        passing.push(step.time_s, row, |time_s, row| {
            let is_same = said.replace(row.said()) == Some(row.said());
            let new = if is_same { &columns[..before_readings] } else { &columns[..] };
            let same = (new.len() < columns.len()).then_some(Cell::SameWords);
            table.cells(time_s, new.iter().map(|column| column.value.cell(row)).chain(same))
        })?;
        if options.follow {
            table.flush()?;
        }
    }
    let origin_s = shown_from_s(times.first_s());
    let median_s = times.check(path, !setup.map.channels.is_empty())?;
    log.finish(say)?;
    say_end_of_followed(options, &setup.stop, path, say);
    checks.map_or(Ok(()), |checks| checks.check())?;
    check_speeds(&drive, setup, path, say)?;
    if let Some(warning) = slow_log(median_s) {
        say.note(&warning);
    }
    let kept = options.learnt.as_deref().map(|path| Kept::of(path, car, tables, &drive));
    let mut drive = drive.finish();
    passing.check()?;
    drive.shifts.retain(|shift| passing.wants(shift.number, car, [shift.from, shift.to]));
    table.finish()?;
    let places = output.and_then(beside).filter(|_| !drive.shifts.is_empty());
    if let Some([csv, json, _]) = &places {
        write_tables(&drive, car, csv, json)?;
    }
    drive = drive.earlier_by(origin_s);
    drive.warnings.splice(0..0, said_of_origin(origin_s));
    report(&drive, car, output.is_some(), say)?;
    if setup.sensors.is_none() && !car.gearbox.has_ratios_alone() {
        say.note(WITHOUT_SENSORS);
    }
    match (output, places) {
        (None, _) => say.note("estimate: on standard output"),
        (Some(output), places) => {
            say.note(&format!("estimate: {}", output.shown()));
            match places {
                Some(places) => write_page(&drive, car, path, &places, say)?,
                None => beside(output).map_or(Ok(()), |old| remove_old(&old, |note| say.note(note)))?,
            }
        }
    }
    kept.map_or(Ok(()), |kept| kept.write(say))
}

/// Refuses a log whose speeds are not those of the car, or of which no estimate can be used.
fn check_speeds(drive: &LoggedDrive<'_>, setup: &CarSetup<'_>, path: &Path, say: &mut Messages) -> Result<(), Failure> {
    if let Some(swapped) = drive.swapped_speeds().filter(|_| does_not_fit(drive.rows_in_gear())) {
        say.note(&format!("warning: {swapped}"));
    }
    let wrong_scale = drive.wrong_scale().map(|wrong| wrong.text);
    check_ratios(drive.rows_in_gear(), wrong_scale.as_deref(), &setup.options.vehicle, path)?;
    check_wheel(drive.output_over_wheel(), setup.car.driveline.final_ratio)?;
    drive.unusable().map_or(Ok(()), |unusable| Err(refused(unusable, path)))
}

/// Whether the speeds of most rows in a gear are not those of that gear.
fn does_not_fit([all, unfit]: [u64; 2]) -> bool {
    2 * unfit > all
}

/// Refuses a log whose speeds are not those of the gearbox in most rows; `wrong_scale` says which speed has a wrong scale, if it is known.
pub(in crate::commands) fn check_ratios(
    rows: [u64; 2],
    wrong_scale: Option<&str>,
    vehicle: &Path,
    log: &Path,
) -> Result<(), Failure> {
    if !does_not_fit(rows) {
        return Ok(());
    }
    let [all, unfit] = rows;
    Err(Failure::Input(format!(
        "{}: in {unfit} of {all} rows in a gear the turbine speed is not the output speed times the ratio of that gear in {}\nhint: {}",
        log.shown(),
        vehicle.shown(),
        wrong_scale
            .unwrap_or("check the units of both speeds, the gear, and whether this is the vehicle file of the car")
    )))
}

/// The table of shifts.
fn write_tables(drive: &ScoredDrive, car: &Car, csv: &Path, json: &Path) -> Result<(), Failure> {
    let cells: Vec<Vec<(String, Cell<'_>)>> = drive.shifts.iter().map(|shift| shift_cells(shift, car)).collect();
    write_cells(csv, &cells)?;
    write_json_list(json, cells.into_iter().map(JsonObject::of))
}

/// The page, beside the table of shifts.
fn write_page(
    drive: &ScoredDrive,
    car: &CarFile,
    log: &Path,
    [csv, json, page]: &[PathBuf; 3],
    say: &mut Messages,
) -> Result<(), Failure> {
    let name = log.file_name().unwrap_or(log.as_os_str()).to_string_lossy();
    let html = DrivePage { name: &name, car, draw: None, drive, sources: &[&car.source] }.html()?;
    write_text(page, &html)?;
    say.note(&format!("table of shifts: {}, {}", csv.shown(), json.shown()));
    say.note(&format!("report: {}", page.shown()));
    Ok(())
}

/// The shifts as a table, and what was found; `has_file` says whether standard output is free for the table.
fn report(drive: &ScoredDrive, car: &Car, has_file: bool, say: &mut Messages) -> Result<(), Failure> {
    let (titles, mut rows) = shift_rows(drive, car);
    let more = rows.len().saturating_sub(SHOWN);
    rows.truncate(SHOWN);
    let titles: Vec<String> = titles.into_iter().map(str::to_owned).collect();
    if !rows.is_empty() {
        let mut lines = output::titled_lines(3, &titles, &rows);
        lines.extend((more > 0).then(|| format!("and {more} more shifts")));
        say.table(&lines, has_file)?;
    }
    shift_words(drive, car).iter().for_each(|(word, meaning)| say.note(&format!("{word}: {meaning}")));
    findings(drive).iter().for_each(|sentence| say.note(sentence));
    Ok(())
}
