//! Which observer estimates a log.

use std::path::Path;

use car::{ObserverKind, Sensors, Vehicle};
use clap::ValueEnum;
use design::{compliant_open_loop_phases, rigid_open_loop_phases};
use logs::Role;
use report::tables::phase_name;
use study::AnyObserver;
use trace::ShownPath as _;

use super::Messages;
use super::measured::Measured;
use crate::args::{Estimate, MethodChoice, ObserverChoice};
use crate::failure::Failure;

/// An observer for a log.
pub(super) struct Chosen {
    pub(super) observer: AnyObserver,
    pub(super) kind: ObserverKind,
    /// The observer and how its gains were found, in words.
    pub(super) name: String,
}

/// Refuses options that have no effect together.
pub(super) fn check_options(options: &Estimate) -> Result<(), Failure> {
    let designed = matches!(options.observer, ObserverChoice::Rigid | ObserverChoice::Compliant);
    if options.method.is_some() && !designed {
        return Err(Failure::Input(
            "--method has no effect with this observer\n\
             hint: use it with `--observer rigid` or `--observer compliant`"
                .to_owned(),
        ));
    }
    if options.learnt.is_some() {
        return Err(Failure::Input(
            "--learnt has no effect with the vehicle file of one shift\n\
             hint: leave it out; the filter of a car with a gearbox, such as vehicles/eight_speed.toml, keeps what it learns"
                .to_owned(),
        ));
    }
    // Without a wheel speed the best observer is another; that is told when the log is known.
    if options.sensors.is_some() && options.observer != ObserverChoice::Best && !is_filter(kind(options.observer)) {
        return Err(sensors_without_effect());
    }
    Ok(())
}

fn sensors_without_effect() -> Failure {
    Failure::Input(
        "--sensors has no effect with this observer\nhint: use it with `--observer` kalman, extended or unscented"
            .to_owned(),
    )
}

fn is_filter(kind: ObserverKind) -> bool {
    [ObserverKind::Kalman, ObserverKind::Extended, ObserverKind::Unscented].contains(&kind)
}

/// Whether it is a valve model alone, which reads no engine speed.
pub(super) fn is_open_loop(kind: ObserverKind) -> bool {
    matches!(kind, ObserverKind::OpenLoop | ObserverKind::OpenLoopMaps)
}

/// The observer for a log, with what is to be said about it.
pub(super) fn choose(
    options: &Estimate,
    vehicle: &Vehicle,
    log: &Measured<'_>,
    say: &mut Messages,
) -> Result<Chosen, Failure> {
    let (has_engine, has_wheel) = (log.has_engine_speed(), log.has_wheel_speed());
    let (choice, method) = match options.observer {
        ObserverChoice::Best if !has_engine => (ObserverChoice::OpenLoopMaps, MethodChoice::Iss),
        ObserverChoice::Best => best(has_wheel),
        chosen => (chosen, options.method.unwrap_or(MethodChoice::Iss)),
    };
    if options.observer == ObserverChoice::Best {
        say.note(match (has_engine, has_wheel) {
            (false, _) => "observer: open-loop-maps, because the log has no engine speed, which all observers need but the open loops",
            (true, true) => "observer: kalman, because the log has a wheel speed",
            (true, false) => {
                "observer: rigid with peak-to-peak gains, because the log has no wheel_speed_rad_s, which kalman needs"
            }
        });
    }
    let kind = kind(choice);
    if options.sensors.is_some() && !is_filter(kind) {
        return Err(match options.observer {
            ObserverChoice::Best if !has_engine => Failure::Input(
                "the log has no engine speed: the best observer is then open-loop-maps, which does not use --sensors\n\
                 hint: leave --sensors out, or give the log an engine_speed_rad_s (in a channel map: engine_speed)"
                    .to_owned(),
            ),
            ObserverChoice::Best => Failure::Input(
                "the log has no wheel speed: the best observer is then rigid, which does not use --sensors\n\
                 hint: leave --sensors out, or give the log a wheel_speed_rad_s (in a channel map: wheel_speed), with which it is kalman"
                    .to_owned(),
            ),
            _ => sensors_without_effect(),
        });
    }
    if is_filter(kind) || [ObserverKind::Compliant, ObserverKind::Inversion].contains(&kind) {
        log.require(Role::WheelSpeed)?;
    }
    if !is_open_loop(kind) {
        log.require(Role::EngineSpeed)?;
    }
    let sensors = options.sensors.as_deref().map(sensors).transpose()?;
    let step_s = log.median_step_s();
    let (observer, missed) = AnyObserver::best(vehicle, kind, method.into(), step_s, sensors.as_ref())?;
    for missed in &missed {
        say.note(&format!("warning: continuing with the best certified gain\n{missed}"));
    }
    if step_s > observer.sample_max_s() && !is_open_loop(kind) {
        say.note(&format!(
            "the sample time is {:.0} ms, and this observer corrects over at most {:.0} ms: using the open loop\n\
             hint: `--observer rigid --method peak-to-peak` designs gains for the sample time of the log",
            1e3 * step_s,
            1e3 * observer.sample_max_s(),
        ));
    }
    open_loop_phases(vehicle, (&observer, kind, method), step_s).iter().for_each(|line| say.note(line));
    Ok(Chosen { observer, kind, name: name_of(choice, method) })
}

/// The phases in which the observer is the open loop, each with the reason.
fn open_loop_phases(
    vehicle: &Vehicle,
    (observer, kind, method): (&AnyObserver, ObserverKind, MethodChoice),
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
        MethodChoice::Iss => "the valve alone has the required decay",
        _ => "no gain reduces the bound",
    };
    phases.into_iter().map(|phase| format!("{}: the gain is the open loop: {why}", phase_name(phase))).collect()
}

/// The observer for a log, if the user names none.
pub(in crate::commands) fn best(has_wheel_speed: bool) -> (ObserverChoice, MethodChoice) {
    if has_wheel_speed {
        (ObserverChoice::Kalman, MethodChoice::Iss)
    } else {
        (ObserverChoice::Rigid, MethodChoice::PeakToPeak)
    }
}

/// The kind of observer of a choice; the best is that of a log with a wheel speed.
pub(in crate::commands) fn kind(choice: ObserverChoice) -> ObserverKind {
    match choice {
        ObserverChoice::Best | ObserverChoice::Kalman => ObserverKind::Kalman,
        ObserverChoice::Rigid => ObserverKind::Rigid,
        ObserverChoice::Compliant => ObserverKind::Compliant,
        ObserverChoice::Sliding => ObserverKind::Sliding,
        ObserverChoice::Extended => ObserverKind::Extended,
        ObserverChoice::Unscented => ObserverKind::Unscented,
        ObserverChoice::SuperTwisting => ObserverKind::SuperTwisting,
        ObserverChoice::Inversion => ObserverKind::Inversion,
        ObserverChoice::OpenLoop => ObserverKind::OpenLoop,
        ObserverChoice::OpenLoopMaps => ObserverKind::OpenLoopMaps,
    }
}

/// An observer and how its gains were found.
fn name_of(choice: ObserverChoice, method: MethodChoice) -> String {
    let name = |value: Option<clap::builder::PossibleValue>| value.map(|value| value.get_name().to_owned());
    let observer = name(choice.to_possible_value()).unwrap_or_default();
    match choice {
        ObserverChoice::Rigid | ObserverChoice::Compliant => {
            format!("{observer}, gains by the method {}", name(method.to_possible_value()).unwrap_or_default())
        }
        _ => observer,
    }
}

/// The sensors that a file describes.
pub(in crate::commands) fn sensors(path: &Path) -> Result<Sensors, Failure> {
    config::read_sensors(path)?.ok_or_else(|| {
        let path = path.shown();
        Failure::Input(format!("{path}: there is no [sensors] table\nhint: add one, as in experiments/bench.toml"))
    })
}
