//! Simulates a drive of a car that stands in no file, estimates its log, and compares the estimates with the truth.

#![expect(clippy::print_stdout, reason = "an example")]

use std::path::Path;
use std::sync::Arc;

use wetclutch::{Drive, EstimateOptions, LogInput, TemplateNumbers, VehicleFile, estimate, score, simulate};

fn main() -> Result<(), wetclutch::Error> {
    let vehicle = VehicleFile::template("8hp", &TemplateNumbers::of_mass(1900.0))?;
    let drive = wetclutch::read_drive(Path::new("drives/city.toml"), None)?;
    let drive = Drive { repetitions: 1, ..drive };
    let run = simulate(vehicle.car().expect("a template has a gearbox"), &drive)?;
    let measured = Arc::new(run.measured);
    let log = LogInput::of_table("the drive", &measured);
    let found = estimate(&vehicle, log, &EstimateOptions::default())?;
    println!("{} shifts, {} rows", found.shifts.len(), found.rows.len());
    println!("{}", score(&run.truth, &found.rows)?);
    Ok(())
}
