//! `wetclutch simulate`.

use config::{Experiment, Vehicle};
use study::{ShiftQuality, simulate_drive};
use trace::signal;

use crate::args::Simulate;
use crate::commands::write_trace;
use crate::failure::Failure;
use crate::output;

pub(crate) fn simulate(options: &Simulate) -> Result<(), Failure> {
    let experiment = Experiment::read(&options.experiment)?;
    let vehicle = Vehicle::read(&experiment.vehicle_path())?;
    let trace = simulate_drive(&vehicle, &experiment)?;
    let name = experiment.name.to_lowercase();
    let whole = options.output.join(format!("{name}.csv"));
    let measured = options.output.join(format!("{name}_measured.csv"));
    write_trace(&whole, &trace)?;
    write_trace(&measured, &trace.filtered(|name| signal::MEASURABLE.contains(&name)))?;
    match ShiftQuality::of(&trace, &vehicle.shift) {
        Some(quality) => output::note(&format!(
            "shift: torque phase {:.3} to {:.3} s, inertia phase to {:.3} s, flare {:.1} rad/s, jerk {:.1} m/s^3",
            quality.torque_phase_start_s,
            quality.inertia_phase_start_s,
            quality.lock_up_s,
            quality.flare_rad_s,
            quality.jerk_peak_m_s3,
        )),
        None => output::note("the shift was not completed within the simulated time"),
    }
    output::line(&whole.display().to_string())?;
    output::line(&measured.display().to_string())?;
    Ok(())
}
