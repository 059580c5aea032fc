//! `wetclutch estimate`.

use std::io::Write;
use std::path::Path;

use config::{GainMethod, ObserverKind, Sensors, Vehicle};
use observer::{Estimate as Sample, Health};
use report::tables::phase_name;
use study::{AnyObserver, RunColumns, estimates_trace, score, true_phases};
use trace::{Trace, read_csv, signal, units};

use crate::args::{Estimate, ObserverChoice};
use crate::commands::write_trace;
use crate::failure::Failure;
use crate::output;

pub(crate) fn estimate(options: &Estimate) -> Result<(), Failure> {
    let vehicle = Vehicle::read(&options.vehicle)?;
    let log = read_csv(&options.log)?;
    let columns = RunColumns::of(&log, &vehicle)?;
    let has_wheel = log.get(signal::WHEEL_SPEED).is_some();
    let kind = match options.observer {
        ObserverChoice::Best if has_wheel => ObserverKind::Kalman,
        ObserverChoice::Best | ObserverChoice::Rigid => ObserverKind::Rigid,
        ObserverChoice::Compliant => ObserverKind::Compliant,
        ObserverChoice::Sliding => ObserverKind::Sliding,
        ObserverChoice::Kalman => ObserverKind::Kalman,
        ObserverChoice::Extended => ObserverKind::Extended,
        ObserverChoice::Unscented => ObserverKind::Unscented,
        ObserverChoice::SuperTwisting => ObserverKind::SuperTwisting,
        ObserverChoice::Inversion => ObserverKind::Inversion,
        ObserverChoice::OpenLoop => ObserverKind::OpenLoop,
    };
    let designed = matches!(options.observer, ObserverChoice::Rigid | ObserverChoice::Compliant);
    if options.method.is_some() && !designed {
        return Err(Failure::Input(
            "--method says how the gains of an observer are designed\n\
             hint: it goes with `--observer rigid` and `--observer compliant`"
                .to_owned(),
        ));
    }
    let mut method = options.method.map_or(GainMethod::Iss, GainMethod::from);
    if options.observer == ObserverChoice::Best {
        output::note(if has_wheel {
            "observer: kalman, as there is a wheel speed"
        } else {
            method = GainMethod::PeakToPeak;
            "observer: rigid with peak-to-peak gains; with wheel_speed_rad_s in the log kalman would serve"
        });
    }
    let filters = [ObserverKind::Kalman, ObserverKind::Extended, ObserverKind::Unscented];
    if options.sensors.is_some() && !filters.contains(&kind) {
        return Err(Failure::Input(
            "--sensors is for the filters\nhint: it goes with `--observer` kalman, extended and unscented".to_owned(),
        ));
    }
    if filters.contains(&kind) || [ObserverKind::Compliant, ObserverKind::Inversion].contains(&kind) {
        log.require(signal::WHEEL_SPEED)?;
    }
    let sensors = options.sensors.as_deref().map(sensors).transpose()?;
    let observer = AnyObserver::designed(&vehicle, kind, method, log.median_step_s(), sensors.as_ref())?;
    if log.median_step_s() > observer.sample_max_s() && kind != ObserverKind::OpenLoop {
        output::note(&format!(
            "samples are {:.0} ms apart, and this observer corrects over at most {:.0} ms: the valve model alone serves\n\
             hint: `--observer rigid --method peak-to-peak` designs its gains for the log's own sample time",
            1e3 * log.median_step_s(),
            1e3 * observer.sample_max_s(),
        ));
    }
    let estimates = observer.run(&vehicle, &columns);
    let result = estimates_trace(&log.time_s, &estimates);
    match &options.output {
        Some(path) => write_trace(path, &result)?,
        None => trace::csv_file::write_rows(&mut std::io::stdout().lock() as &mut dyn Write, &result)?,
    }
    report_on(&log, &estimates);
    Ok(())
}

/// The sensors that a file describes.
fn sensors(path: &Path) -> Result<Sensors, Failure> {
    Sensors::read(path)?.ok_or_else(|| {
        let path = path.display();
        Failure::Input(format!(
            "{path}: describes no sensors\nhint: add a [sensors] table, as in experiments/bench.toml"
        ))
    })
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
    let outside = |e: &&Sample<f64>| {
        e.bounds.is_some_and(|bounds| {
            let [least, greatest] = bounds.pressure_pa;
            e.pressure_pa < least || e.pressure_pa > greatest
        })
    };
    let count = estimates.iter().filter(outside).count();
    // A few are as the cylinder fills, where the told valve runs ahead of the one of the maps.
    if 100 * count > estimates.len() {
        output::note(&format!(
            "{count} of {} estimates lie outside the guaranteed range: the observer errs there, or the car is beyond its budget",
            estimates.len()
        ));
    }
    let (Some(phases), Some(truth)) = (true_phases(log), log.get(signal::ONCOMING_PRESSURE)) else { return };
    let scores = score(&log.time_s, &phases, truth, 0.0, |i| estimates[i].pressure_pa);
    for score in scores.iter().filter(|score| score.samples > 0) {
        output::note(&format!(
            "error against the true pressure, {}: peak {:.4} MPa, RMS {:.4} MPa",
            phase_name(score.phase),
            units::mpa(score.peak),
            units::mpa(score.rms),
        ));
    }
}
