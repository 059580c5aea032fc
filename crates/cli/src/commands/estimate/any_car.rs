//! `wetclutch estimate` of a drive of a car with any gearbox.

use std::io;
use std::path::Path;

use config::Car;
use observer::any_shift::{MAX_ELEMENTS, ShiftEstimate};
use report::drive_page::{DrivePage, findings, shift_cells, shift_rows};
use study::any_shift::drive::ScoredDrive;
use study::any_shift::logged::{CarLog, LoggedDrive, element_column};
use trace::{Cell, ColumnKind, CsvRows};

use super::observer::sensors;
use super::outputs::{Output, beside, remove_old};
use crate::args::{Estimate, ObserverChoice};
use crate::commands::{check_output, json_object, not_an_input, write_cells, write_text};
use crate::failure::Failure;
use crate::output;

/// Rows of the table of shifts that a terminal shows.
const SHOWN: usize = 40;

/// Refuses options that have no effect with the filter for any shift.
fn check_options(options: &Estimate) -> Result<(), Failure> {
    let refuse = |option: &str, hint: &str| {
        let message = format!("{option} has no effect with the vehicle file of a car with a gearbox\nhint: {hint}");
        Err(Failure::Input(message))
    };
    if options.observer != ObserverChoice::Best || options.method.is_some() {
        let hint = "leave it out; the filter for any shift also writes the estimate of the valve model alone";
        return refuse(if options.method.is_some() { "--method" } else { "--observer" }, hint);
    }
    let mapping = &options.mapping;
    if mapping.map.is_some() || mapping.dbc.is_some() || !mapping.channel.is_empty() {
        return refuse("a channel map", "convert the log to CSV with the columns that `wetclutch simulate` writes");
    }
    if options.follow {
        return refuse("--follow", "leave it out; `-` reads from a pipe until its end");
    }
    if options.shift.is_some() || !options.shifts.is_empty() {
        return refuse("a choice of shifts", "leave it out and choose rows by their gears");
    }
    if options.logs.len() > 1 {
        return refuse("a second log", "estimate them one by one");
    }
    Ok(())
}

pub(super) fn estimate(options: &Estimate) -> Result<(), Failure> {
    check_options(options)?;
    let Some(path) = options.logs.first() else { return Ok(()) };
    check_output(options.output.as_ref())?;
    let inputs = || options.sensors.iter().chain([&options.vehicle]);
    not_an_input(options.output.as_ref(), inputs())?;
    for beside in options.output.iter().filter_map(|output| beside(output)).flatten() {
        not_an_input(Some(&beside), inputs().chain([path]))?;
    }
    let car = Car::read(&options.vehicle)?;
    let sensors = options.sensors.as_deref().map(sensors).transpose()?;
    let tables = LoggedDrive::tables(&car)?;
    let rows = match path.as_os_str() == "-" {
        true => CsvRows::of(path, Box::new(io::stdin()))?,
        false => CsvRows::open(path)?,
    };
    let mut log = CarLog::of(rows, &car, &tables)?;
    let mut drive = LoggedDrive::new(&car, &tables, sensors.as_ref());
    // Places of the elements in the filter's tables, by name.
    let elements = car.gearbox.elements.iter().enumerate();
    let places: Vec<(usize, &str)> =
        elements.filter_map(|(at, element)| Some((tables.place(at)?, element.name.as_str()))).collect();
    let columns = chosen(columns(&places), &options.columns)?;
    let output = options.output.as_deref();
    let named = columns.iter().map(|column| (column.name.as_str(), column.kind));
    let mut table = Output::named(output, named)?;
    while let Some(step) = log.next_step()? {
        let estimate = drive.push(&step);
        let row = Row { car: &car, places: &places, gears: [step.input.gear.from, step.input.gear.to], estimate };
        table.cells(step.time_s, columns.iter().map(|column| column.value.cell(&row)))?;
    }
    check_ratios(drive.rows_in_gear(), &options.vehicle, path)?;
    table.finish()?;
    let drive = drive.finish();
    report(&drive, &car);
    let Some(output_path) = output else {
        output::note("estimate: on standard output");
        return Ok(());
    };
    output::note(&format!("estimate: {}", output_path.display()));
    write_beside(&drive, &car, path, output_path)
}

/// Refuses a log whose speeds are not those of the gearbox in most rows.
fn check_ratios([all, unfit]: [u64; 2], vehicle: &Path, log: &Path) -> Result<(), Failure> {
    if 2 * unfit <= all {
        return Ok(());
    }
    Err(Failure::Input(format!(
        "{}: in {unfit} of {all} rows in a gear the turbine speed is not the output speed times the ratio of that gear in {}\n         hint: check the units of both speeds, the gear, and whether this is the vehicle file of the car",
        log.display(),
        vehicle.display()
    )))
}

/// The table of shifts and the page.
fn write_beside(drive: &ScoredDrive, car: &Car, log: &Path, output: &Path) -> Result<(), Failure> {
    let Some(places) = beside(output) else { return Ok(()) };
    if drive.shifts.is_empty() {
        return remove_old(&places, output::note);
    }
    let [csv, json, page] = places;
    let cells: Vec<Vec<(String, Cell<'_>)>> = drive.shifts.iter().map(|shift| shift_cells(shift, car)).collect();
    write_cells(&csv, &cells)?;
    let objects: Vec<_> = cells.into_iter().map(json_object).collect();
    write_text(&json, &(serde_json::to_string_pretty(&objects)? + "\n"))?;
    let name = log.file_name().unwrap_or(log.as_os_str()).to_string_lossy();
    let html = DrivePage { name: &name, car, draw: None, drive, sources: &[&car.source] }.html()?;
    write_text(&page, &html)?;
    output::note(&format!("table of shifts: {}, {}", csv.display(), json.display()));
    output::note(&format!("report: {}", page.display()));
    Ok(())
}

/// The shifts as a table, and what was found.
fn report(drive: &ScoredDrive, car: &Car) {
    let (titles, rows) = shift_rows(drive, car);
    let more = rows.len().saturating_sub(SHOWN);
    let head: Vec<String> = titles.into_iter().map(str::to_owned).collect();
    let table: Vec<Vec<String>> = std::iter::once(head).chain(rows.into_iter().take(SHOWN)).collect();
    if table.len() > 1 {
        output::lines(3, &table).iter().for_each(|line| output::note(line));
    }
    if more > 0 {
        output::note(&format!("and {more} more shifts"));
    }
    findings(drive).iter().for_each(|sentence| output::note(sentence));
}

/// What a row of the estimate is made from.
struct Row<'a> {
    car: &'a Car,
    places: &'a [(usize, &'a str)],
    gears: [usize; 2],
    estimate: ShiftEstimate<f64>,
}

impl<'a> Row<'a> {
    fn gear(&self, which: usize) -> Cell<'a> {
        Cell::Word(self.car.gearbox.gears.get(self.gears[which]).map_or("", |gear| gear.name.as_str()))
    }

    fn element(&self, which: usize) -> Cell<'a> {
        let place = self.estimate.clutches.map(|clutches| clutches[which].element);
        let named = self.places.iter().find(|(known, _)| Some(*known) == place);
        Cell::Word(named.map_or("", |(_, name)| *name))
    }

    /// Pressure, torque, their ranges, and both by the valve model, in the order of [`CLUTCH`].
    fn clutch(&self, which: usize, what: usize) -> f64 {
        let Some(clutch) = self.estimate.clutches.map(|clutches| clutches[which]) else { return f64::NAN };
        let end = |range: Option<[f64; 2]>, end: usize| range.map_or(f64::NAN, |range| range[end]);
        match what {
            0 => clutch.pressure_pa,
            1 => end(clutch.pressure_range_pa, 0),
            2 => end(clutch.pressure_range_pa, 1),
            3 => clutch.torque_n_m,
            4 => end(clutch.torque_range_n_m, 0),
            5 => end(clutch.torque_range_n_m, 1),
            6 => clutch.valve_pa,
            _ => clutch.open_loop_n_m,
        }
    }

    /// The same without the sign of a zero.
    fn clutch_cell(&self, which: usize, what: usize) -> Cell<'a> {
        Cell::Number(self.clutch(which, what) + 0.0)
    }
}

/// The columns of a clutch, after `offgoing_` or `oncoming_`.
const CLUTCH: [&str; 8] = [
    "pressure_estimate_pa",
    "pressure_least_pa",
    "pressure_greatest_pa",
    "torque_estimate_n_m",
    "torque_least_n_m",
    "torque_greatest_n_m",
    "valve_model_pressure_pa",
    "valve_model_torque_n_m",
];
const ROLES: [&str; 2] = ["offgoing", "oncoming"];

/// Where the cells of a column come from.
#[derive(Clone, Copy)]
enum Value {
    Of(for<'a> fn(&Row<'a>) -> Cell<'a>),
    Clutch(usize, usize),
    /// Pressure of an element by its valve model, by its place in the filter's tables.
    Valve(usize),
}

impl Value {
    fn cell<'a>(self, row: &Row<'a>) -> Cell<'a> {
        match self {
            Self::Of(value) => value(row),
            Self::Clutch(which, what) => row.clutch_cell(which, what),
            Self::Valve(place) => Cell::Number(row.estimate.valve_pa[place.min(MAX_ELEMENTS - 1)]),
        }
    }
}

struct Column {
    name: String,
    kind: ColumnKind,
    value: Value,
}

fn columns(places: &[(usize, &str)]) -> Vec<Column> {
    let word = |name: &str, value: for<'a> fn(&Row<'a>) -> Cell<'a>| Column {
        name: name.to_owned(),
        kind: ColumnKind::Word,
        value: Value::Of(value),
    };
    let number = |name: String, value: Value| Column { name, kind: ColumnKind::Number, value };
    let mut columns = vec![
        word(trace::signal::GEAR, |row| row.gear(0)),
        word(trace::signal::TARGET_GEAR, |row| row.gear(1)),
        word(trace::signal::PHASE, |row| Cell::Word(row.estimate.phase.map_or("", |phase| phase.name()))),
        word(ROLES[0], |row| row.element(0)),
        word(ROLES[1], |row| row.element(1)),
    ];
    for (which, role) in ROLES.iter().enumerate() {
        let named = CLUTCH.iter().enumerate();
        columns.extend(named.map(|(what, name)| number(format!("{role}_{name}"), Value::Clutch(which, what))));
    }
    columns.push(number("turbine_torque_estimate_n_m".to_owned(), Value::Of(|row| of(row.estimate.turbine_n_m))));
    columns.push(number(trace::signal::SHAFT_ESTIMATE.to_owned(), Value::Of(|row| of(row.estimate.shaft_n_m))));
    columns.extend(
        places
            .iter()
            .map(|(place, name)| number(format!("{}_{}", element_column(name), CLUTCH[6]), Value::Valve(*place))),
    );
    columns.push(word(trace::signal::HEALTH, |row| Cell::Word(row.estimate.health.name())));
    columns
}

fn of(value: Option<f64>) -> Cell<'static> {
    Cell::Number(value.unwrap_or(f64::NAN))
}

/// The columns of these names in their order, or all.
fn chosen(mut all: Vec<Column>, names: &[String]) -> Result<Vec<Column>, Failure> {
    if names.is_empty() {
        return Ok(all);
    }
    let mut chosen = Vec::new();
    for name in names.iter().map(|name| name.trim()).filter(|name| *name != trace::signal::TIME) {
        let Some(at) = all.iter().position(|column| column.name == name) else {
            let known: Vec<&str> = all.iter().map(|column| column.name.as_str()).collect();
            return Err(Failure::Input(format!(
                "--columns: there is no column `{}`, or it is there twice\nhint: the other columns are {}",
                name.escape_debug(),
                known.join(", ")
            )));
        };
        chosen.push(all.remove(at));
    }
    Ok(chosen)
}
