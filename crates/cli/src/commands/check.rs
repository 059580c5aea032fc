//! `wetclutch check`.

use config::{Experiment, Kind, Source, Study, Vehicle};

use crate::args::Check;
use crate::failure::Failure;
use crate::output;

pub(crate) fn check(options: &Check) -> Result<(), Failure> {
    let source = Source::read(&options.file)?;
    match source.kind()? {
        Kind::Vehicle => describe(&Vehicle::from_source(source)?),
        Kind::Experiment => {
            let experiment = Experiment::from_source(source)?;
            let vehicle = Vehicle::read(&experiment.vehicle_path())?;
            describe_experiment(&experiment)?;
            describe(&vehicle)
        }
        Kind::Study => {
            let study = Study::read(&options.file)?;
            output::line(&format!(
                "study {} \"{}\": {} runs ({}) over {} factors",
                study.name,
                study.title,
                study.runs,
                study.plan.name(),
                study.factors.len()
            ))?;
            for factor in &study.factors {
                let [low, high] = factor.values.ends();
                output::line(&format!("  {} from {low} to {high} ({})", factor.name, factor.key))?;
            }
            describe_experiment(&study.experiment)?;
            describe(&study.vehicle)
        }
    }
}

fn describe_experiment(experiment: &Experiment) -> Result<(), Failure> {
    output::line(&format!(
        "experiment {} \"{}\": {} s, shift request at {} s, {} observers",
        experiment.name,
        experiment.title,
        experiment.duration_s,
        experiment.shift.request_s,
        experiment.observers.len()
    ))?;
    Ok(())
}

fn describe(vehicle: &Vehicle) -> Result<(), Failure> {
    output::line(&format!(
        "vehicle \"{}\": ratio {:.3} to {:.3}, {} kg, kiss point of the oncoming clutch {:.3} MPa",
        vehicle.name,
        vehicle.shift.ratio_offgoing(),
        vehicle.shift.ratio_oncoming(),
        vehicle.road.mass_kg,
        trace::units::mpa(vehicle.oncoming.clutch.kiss_pressure()),
    ))?;
    Ok(())
}
