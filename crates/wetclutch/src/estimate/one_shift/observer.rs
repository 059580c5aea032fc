//! Which observer estimates a log.

use car::{GainMethod, ObserverKind, Vehicle};
use design::{compliant_open_loop_phases, rigid_open_loop_phases};
use logs::Role;
use report::tables::phase_name;
use study::AnyObserver;

use super::measured::Measured;
use crate::estimate::input::EstimateOptions;
use crate::vehicle::learnt_without_effect;
use crate::{Error, Notes};

/// An observer for a log.
pub(crate) struct Chosen {
    pub(crate) observer: AnyObserver,
    pub(crate) kind: ObserverKind,
    /// The observer and how its gains were found, in words.
    pub(crate) name: String,
}

/// Refuses options that have no effect together.
pub(crate) fn check_options(options: &EstimateOptions) -> Result<(), Error> {
    if options.method.is_some() && !options.observer.is_some_and(has_gains) {
        return Err(Error::Input(
            "--method has no effect with this observer\n\
             hint: use it with `--observer rigid` or `--observer compliant`"
                .to_owned(),
        ));
    }
    if options.learnt.is_some() {
        return Err(learnt_without_effect());
    }
    // Without an engine speed the best observer is another; that is known when the log is known.
    if options.sensors.is_some() && options.observer.is_some_and(|kind| !is_filter(kind)) {
        return Err(sensors_without_effect());
    }
    Ok(())
}

fn sensors_without_effect() -> Error {
    Error::Input(
        "--sensors has no effect with this observer\nhint: use it with `--observer` gearbox, kalman, extended or unscented"
            .to_owned(),
    )
}

/// Whether its gains come from a design method that a caller may choose.
pub fn has_gains(kind: ObserverKind) -> bool {
    matches!(kind, ObserverKind::Rigid | ObserverKind::Compliant)
}

/// Whether it is a filter, which knows how the speeds are read.
pub fn is_filter(kind: ObserverKind) -> bool {
    [ObserverKind::Gearbox, ObserverKind::Kalman, ObserverKind::Extended, ObserverKind::Unscented].contains(&kind)
}

/// Whether it is a valve model alone, which reads no engine speed.
pub(crate) fn is_open_loop(kind: ObserverKind) -> bool {
    matches!(kind, ObserverKind::OpenLoop | ObserverKind::OpenLoopMaps)
}

/// The observer for a log, with what is to be said about it.
pub(crate) fn choose(
    options: &EstimateOptions,
    vehicle: &Vehicle,
    log: &Measured<'_>,
    say: Notes<'_>,
) -> Result<Chosen, Error> {
    let (has_engine, has_wheel) = (log.has_engine_speed(), log.has_wheel_speed());
    let (kind, method) = match options.observer {
        None if !has_engine => (ObserverKind::OpenLoopMaps, GainMethod::Iss),
        None => (best(has_wheel, options.sensors.is_some()), GainMethod::default()),
        Some(chosen) => (chosen, options.method.unwrap_or_default()),
    };
    if options.observer.is_none() {
        say(match (kind, has_wheel) {
            (ObserverKind::OpenLoopMaps, _) => {
                "observer: open-loop-maps, because the log has no engine speed, which all observers need but the open loops"
            }
            (ObserverKind::Kalman, _) => "observer: kalman, because the sensors are described",
            (_, true) => "observer: gearbox, because no --sensors are given",
            (_, false) => "observer: gearbox, because the log has no wheel_speed_rad_s",
        });
    }
    if options.sensors.is_some() && !is_filter(kind) {
        return Err(match options.observer {
            None => Error::Input(
                "the log has no engine speed: the best observer is then open-loop-maps, which does not use --sensors\n\
                 hint: leave --sensors out, or give the log an engine_speed_rad_s (in a channel map: engine_speed)"
                    .to_owned(),
            ),
            _ => sensors_without_effect(),
        });
    }
    let needs_wheel = is_filter(kind) && kind != ObserverKind::Gearbox;
    if needs_wheel || [ObserverKind::Compliant, ObserverKind::Inversion].contains(&kind) {
        log.require(Role::WheelSpeed)?;
    }
    if !is_open_loop(kind) {
        log.require(Role::EngineSpeed)?;
    }
    let step_s = log.median_step_s();
    let (observer, missed) = AnyObserver::best(vehicle, kind, method, step_s, options.sensors.as_ref())?;
    for missed in &missed {
        say(&format!("warning: continuing with the best certified gain\n{missed}"));
    }
    if step_s > observer.sample_max_s() && !is_open_loop(kind) {
        say(&format!(
            "the sample time is {:.0} ms, and this observer corrects over at most {:.0} ms: using the open loop\n\
             hint: `--observer rigid --method peak-to-peak` designs gains for the sample time of the log",
            1e3 * step_s,
            1e3 * observer.sample_max_s(),
        ));
    }
    open_loop_phases(vehicle, (&observer, kind, method), step_s).iter().for_each(|line| say(line));
    Ok(Chosen { observer, kind, name: name_of(kind, method) })
}

/// The phases in which the observer is the open loop, each with the reason.
fn open_loop_phases(
    vehicle: &Vehicle,
    (observer, kind, method): (&AnyObserver, ObserverKind, GainMethod),
    step_s: f64,
) -> Vec<String> {
    let phases = match observer {
        AnyObserver::Rigid(rigid) if kind == ObserverKind::Rigid => {
            rigid_open_loop_phases(vehicle, &rigid.gains, step_s)
        }
        AnyObserver::Compliant(compliant) => compliant_open_loop_phases(vehicle, &compliant.gains, step_s),
        _ => Vec::new(),
    };
    let why = match method {
        GainMethod::Iss => "the valve alone has the required decay",
        _ => "no gain reduces the bound",
    };
    phases.into_iter().map(|phase| format!("{}: the gain is the open loop: {why}", phase_name(phase))).collect()
}

/// The observer for a log with an engine speed, if the user names none: that with the smaller errors where all errors vary together
/// (`docs/explanation/results.md`).
pub fn best(has_wheel_speed: bool, has_sensors: bool) -> ObserverKind {
    if has_wheel_speed && has_sensors { ObserverKind::Kalman } else { ObserverKind::Gearbox }
}

/// An observer and how its gains were found.
fn name_of(kind: ObserverKind, method: GainMethod) -> String {
    match kind {
        ObserverKind::Rigid | ObserverKind::Compliant => {
            format!("{}, gains by the method {}", kind.name(), method.name())
        }
        _ => kind.name().to_owned(),
    }
}
