//! `wetclutch estimate`.

use std::io::Write;

use config::Vehicle;
use design::{design_rigid, rigid_observer};
use observer::{Estimate as Sample, Health, RigidGains};
use report::page::phase_name;
use study::score::pressure_scores;
use study::{RunColumns, estimates_trace, run};
use trace::{Trace, read_csv, units, write_csv};

use crate::args::{Estimate, ObserverChoice};
use crate::failure::Failure;
use crate::output;

pub(crate) fn estimate(options: &Estimate) -> Result<(), Failure> {
    let vehicle = Vehicle::read(&options.vehicle)?;
    let log = read_csv(&options.log)?;
    let columns = RunColumns::of(&log, &vehicle)?;
    let gains = match options.observer {
        ObserverChoice::Iss => design_rigid(&vehicle)?.gains(),
        ObserverChoice::OpenLoop => RigidGains::open_loop(),
    };
    let estimates = run(&columns, &rigid_observer(&vehicle, gains));
    let result = estimates_trace(&log.time_s, &estimates);
    match &options.output {
        Some(path) => write_csv(path, &result)?,
        None => trace::csv_file::write_rows(&mut std::io::stdout().lock() as &mut dyn Write, &result)?,
    }
    report_on(&log, &estimates);
    Ok(())
}

/// What a user should know about the estimate, on standard error.
fn report_on(log: &Trace, estimates: &[Sample<f64>]) {
    let count = |health: Health| estimates.iter().filter(|estimate| estimate.health == health).count();
    for (health, meaning) in [
        (Health::SpeedsRejected, "an unusable speed: the valve model carried the estimate"),
        (Health::CommandRejected, "an unusable current: the last usable one was taken"),
    ] {
        if count(health) > 0 {
            output::note(&format!("{} of {} samples have {meaning}", count(health), estimates.len()));
        }
    }
    for score in pressure_scores(log, estimates).unwrap_or_default().iter().filter(|score| score.samples > 0) {
        output::note(&format!(
            "error against the true pressure, {}: peak {:.4} MPa, RMS {:.4} MPa",
            phase_name(score.phase),
            units::mpa(score.peak),
            units::mpa(score.rms),
        ));
    }
}
