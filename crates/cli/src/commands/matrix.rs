//! `wetclutch bench --vehicle`: every shift of a gearbox in every kind.

use std::path::Path;

use car::{Car, Sensors};
use report::matrix_page::{failures, kind_rows, matrix_page, not_driven, shift_cells, shift_rows};
use serde_json::json;
use study::gearbox::matrix::{Matrix, MatrixPlan, Pooled, matrix, runs};
use trace::quantity;
use trace::{Cell, ShownPath as _};
use wetclutch::studies::bench_sensors;

use super::car::no_shift;
use crate::args::Bench;
use crate::browser;
use crate::commands::{JsonObject, progress, read_car, replaceable, write_cells, write_text};
use crate::failure::Failure;
use crate::output;

/// The names of the files.
const PAGE: &str = "bench.html";
const TABLE: &str = "bench.csv";

pub(super) fn bench(options: &Bench, vehicle: &Path) -> Result<(), Failure> {
    let car = read_car(vehicle)?;
    let sensors = sensors_or_bench(options.sensors.as_deref())?;
    options.output.as_deref().map(|folder| replaceable(folder, &[PAGE, TABLE])).transpose()?;
    let (draws, seed) = (u64::from(options.draws), options.seed);
    let all = runs(&car, draws)?;
    if all == 0 {
        return Err(Failure::Input(no_shift(&car, vehicle)));
    }
    output::note(&format!("running the filter and the open loop on {all} shifts"));
    let bar = progress(all, 0);
    let plan =
        MatrixPlan { draws, seed, sensors: &sensors, timing: false, change: |_| (), threads: options.threads.count() };
    let result = matrix(&car, &plan, || bar.inc(1))?;
    bar.finish_and_clear();
    let cells: Vec<Vec<(String, Cell<'_>)>> = result.rows.iter().map(|row| shift_cells(row, &car)).collect();
    if let Some(folder) = &options.output {
        write_text(&folder.join(PAGE), &matrix_page(&result, &car, seed)?)?;
        write_cells(&folder.join(TABLE), &cells)?;
    }
    if options.json {
        let objects: Vec<_> = cells.into_iter().map(JsonObject::of).collect();
        output::json(&json!({ "shifts": objects }))?;
    } else {
        print(&result, &car)?;
    }
    if let Some(folder) = &options.output {
        let page = folder.join(PAGE);
        if !options.json {
            output::line(&format!("\ntable: {}", folder.join(TABLE).shown()))?;
            output::line(&format!("page: {}", page.shown()))?;
        }
        browser::open_if(options.open.is_wanted, &page);
    }
    Ok(())
}

/// The sensors of a file, or those of the built-in bench.
pub(super) fn sensors_or_bench(path: Option<&Path>) -> Result<Sensors, Failure> {
    path.map_or_else(bench_sensors, wetclutch::read_sensors)
}

fn print(result: &Matrix, car: &Car) -> Result<(), Failure> {
    output::line(&format!(
        "RMS error of the clutch torque, relative to the open loop, and both errors: filter / open loop. Of the clutch that\n\
         controls the inertia phase; in brackets where the open loop errs by less than {}\n",
        quantity(2.0, "N m", 0)
    ))?;
    for (left, (titles, rows)) in [(2, shift_rows(result, car)), (2, kind_rows(result))] {
        output::table(left, titles, rows)?;
        output::line("")?;
    }
    let counts = Pooled::of(&result.rows, |_| true).counts;
    output::line(&format!(
        "above the open loop by more than {}: {} of {} shifts; by phases {} of {}\n\
         outside their guaranteed ranges: {} of {} pressures and torques of both clutches\n\
         a held element is reported to slip: {} of {} rows",
        quantity(1.0, "N m", 0),
        counts.runs_above,
        counts.compared_runs,
        counts.above,
        counts.compared,
        wetclutch::grouped(counts.outside),
        wetclutch::grouped(counts.values),
        wetclutch::grouped(counts.slips_said),
        wetclutch::grouped(counts.rows),
    ))?;
    for sentence in not_driven(&result.without_tables, car).into_iter().chain(failures(result, car)) {
        output::note(&format!("warning: {sentence}"));
    }
    Ok(())
}
