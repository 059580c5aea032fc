//! `wetclutch check`.

use config::{Experiment, Kind, Source, Vehicle};

use crate::args::Check;
use crate::failure::Failure;
use crate::output;

pub(crate) fn check(options: &Check) -> Result<(), Failure> {
    let source = Source::read(&options.file)?;
    if source.kind()? == Kind::Experiment {
        let experiment = Experiment::from_source(source)?;
        let vehicle = Vehicle::read(&experiment.vehicle_path())?;
        output::line(&format!(
            "experiment {} \"{}\": {} s, shift request at {} s",
            experiment.name, experiment.title, experiment.duration_s, experiment.shift.request_s
        ))?;
        return describe(&vehicle);
    }
    describe(&Vehicle::from_source(source)?)
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
