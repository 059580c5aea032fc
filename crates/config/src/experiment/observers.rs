//! The observers and sensors of an experiment file, checked.

use std::path::Path;

use observer::{Discretisation, RigidGains, SlidingGains};
use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::raw::{RawDiscretisation, RawGains, RawObserver, RawSensors, RawSensorsFile, RawSignals, RawSpeedSensor};
use crate::ConfigError;
use crate::Source;
use crate::check::Check;

/// Kinds of observers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ObserverKind {
    /// The valve model alone.
    OpenLoop,
    /// Rigid reduced-order observer.
    Rigid,
    /// Reduced-order observer with elastic drive shafts.
    Compliant,
    /// Full-order sliding-mode observer.
    Sliding,
    /// Extended Kalman filter with unknown torques as states, told how old the readings are.
    Kalman,
    /// The same as textbooks have it, every reading of the moment.
    Extended,
    /// Unscented Kalman filter on the same states.
    Unscented,
    /// Super-twisting observer with implicit discretisation.
    SuperTwisting,
    /// The pressure that explains the last change of the speeds.
    Inversion,
}

/// How the gains of a reduced-order observer are chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum GainMethod {
    /// The chapter's five steps, in continuous time: the smallest gain that decays as required.
    #[default]
    Iss,
    /// The smallest gain that decays as required over a sample; the rest are for a sample time too, with every error of
    /// the budget in their bounds, and are the open loop where no gain beats that.
    IssDiscrete,
    /// The smallest bound on the error.
    PeakToPeak,
    /// The same with a gain that follows the friction coefficient.
    Scheduled,
    /// The smallest width of a range that is carried along with the estimate.
    Interval,
}

impl GainMethod {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Iss, Self::IssDiscrete, Self::PeakToPeak, Self::Scheduled, Self::Interval];
}

/// Gains given in the file in place of designed ones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum GivenGains {
    /// Of the rigid observer.
    Rigid(RigidGains<f64>),
    /// Of the sliding-mode observer, such as Eq. (2.57), (2.58) and (2.60).
    Sliding(SlidingGains<f64>),
    /// Of the compliant observer, in the chapter's normalised units, such as Eq. (2.87) and (2.88): torque
    /// phase, inertia phase.
    CompliantNormalised([[f64; 2]; 2], [[f64; 3]; 2]),
}

/// Sample time of an observer that gives none, s: the usual period of a transmission controller.
const SAMPLE_TIME_S: f64 = 0.01;

/// One observer of an experiment.
#[derive(Debug, Clone, PartialEq)]
pub struct ObserverEntry {
    /// Its name in tables and figures.
    pub name: String,
    /// What it is.
    pub kind: ObserverKind,
    /// How its gains are chosen, if it is a reduced-order observer and they are designed.
    pub method: GainMethod,
    /// Its sample time, s.
    pub sample_time_s: f64,
    /// How it is carried over a sample.
    pub discretisation: Discretisation,
    /// Whether it sees the signals through the experiment's sensors.
    pub real_sensors: bool,
    /// Gains in place of designed ones.
    pub gains: Option<GivenGains>,
}

/// A toothed wheel read by a timer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpeedSensor {
    /// Teeth of the wheel.
    pub teeth: f64,
    /// Resolution of the timer, s.
    pub timer_s: f64,
    /// Tooth periods that one reading spans at least.
    pub periods: f64,
    /// Time between two readings on the bus, s.
    pub sample_time_s: f64,
    /// Age of a reading when it arrives, s.
    pub delay_s: f64,
    /// Standard deviation of a reading, rad/s.
    pub noise_rad_s: f64,
}

/// A current sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CurrentSensor {
    /// Standard deviation of a reading, A.
    pub noise_a: f64,
    /// Constant error, A.
    pub offset_a: f64,
    /// Step of the converter, A.
    pub resolution_a: f64,
}

/// The sensors of a car.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sensors {
    /// Seed of every random number.
    pub seed: u64,
    /// Engine speed.
    pub engine: SpeedSensor,
    /// Turbine speed.
    pub turbine: SpeedSensor,
    /// Gearbox output speed.
    pub output: SpeedSensor,
    /// Driven wheel speed.
    pub wheel: SpeedSensor,
    /// Current of the oncoming clutch's valve.
    pub current: CurrentSensor,
}

impl Sensors {
    /// Reads the `[sensors]` table of a file, whatever else it holds; `None` without one.
    ///
    /// # Errors
    /// The file cannot be read, or a value cannot be right.
    pub fn read(path: &Path) -> Result<Option<Self>, ConfigError> {
        let source = Source::read(path)?;
        let raw: RawSensorsFile = source.parse()?;
        raw.sensors.as_ref().map(|raw| sensors(&Check { source: &source }, raw)).transpose()
    }
}

pub(super) fn sensors(check: &Check<'_>, raw: &RawSensors) -> Result<Sensors, ConfigError> {
    let speed = |name: &str, raw: &RawSpeedSensor| {
        let number = |key: &str, value, range| check.number(&format!("sensors.{name}.{key}"), value, range);
        Ok(SpeedSensor {
            teeth: number("teeth", &raw.teeth, 1.0..=1000.0)?,
            timer_s: number("timer_s", &raw.timer_s, 0.0..=1e-3)?,
            periods: number("periods", &raw.periods, 1.0..=100.0)?,
            sample_time_s: number("sample_time_s", &raw.sample_time_s, 1e-4..=0.2)?,
            delay_s: number("delay_s", &raw.delay_s, 0.0..=0.2)?,
            noise_rad_s: number("noise_rad_s", &raw.noise_rad_s, 0.0..=50.0)?,
        })
    };
    let current = |key: &str, value, range| check.number(&format!("sensors.current.{key}"), value, range);
    Ok(Sensors {
        seed: raw.seed,
        engine: speed("engine", &raw.engine)?,
        turbine: speed("turbine", &raw.turbine)?,
        output: speed("output", &raw.output)?,
        wheel: speed("wheel", &raw.wheel)?,
        current: CurrentSensor {
            noise_a: current("noise_a", &raw.current.noise_a, 0.0..=1.0)?,
            offset_a: current("offset_a", &raw.current.offset_a, -1.0..=1.0)?,
            resolution_a: current("resolution_a", &raw.current.resolution_a, 0.0..=0.5)?,
        },
    })
}

pub(super) fn observer(
    check: &Check<'_>,
    raw: &Spanned<RawObserver>,
    has_sensors: bool,
) -> Result<ObserverEntry, ConfigError> {
    let at = raw.span().start;
    let raw = raw.get_ref();
    let wrong =
        |message: String, hint: String| check.meaning(&format!("observer \"{}\"", raw.name), at, message, Some(hint));
    let real_sensors = raw.sensors == RawSignals::Real;
    if real_sensors && !has_sensors {
        let hint = "add a [sensors] table, or leave `sensors` out".to_owned();
        return Err(wrong("sees real sensors, and the file describes none".to_owned(), hint));
    }
    let method = raw.method.unwrap_or_default();
    if raw.method.is_some()
        && (raw.gains.is_some() || !matches!(raw.kind, ObserverKind::Rigid | ObserverKind::Compliant))
    {
        let hint = "leave `method` out; it says how gains of the kinds rigid and compliant are designed".to_owned();
        return Err(wrong("has a method and no gains to design".to_owned(), hint));
    }
    let gains = match (raw.gains.as_ref(), raw.kind) {
        (None, _) => None,
        (Some(&RawGains::Rigid { torque_phase_pa_s_rad, inertia_phase_pa_s_rad }), ObserverKind::Rigid) => {
            Some(GivenGains::Rigid(RigidGains { torque_phase_pa_s_rad, inertia_phase_pa_s_rad }))
        }
        (
            Some(&RawGains::Sliding {
                torque_speed_rad_s2,
                torque_pressure_pa_s,
                inertia_speed_rad_s2,
                inertia_pressure_pa_s,
            }),
            ObserverKind::Sliding,
        ) => Some(GivenGains::Sliding(SlidingGains {
            torque_speed_rad_s2,
            torque_pressure_pa_s,
            inertia_speed_rad_s2,
            inertia_pressure_pa_s,
        })),
        (Some(&RawGains::Compliant { torque_phase_normalised, inertia_phase_normalised }), ObserverKind::Compliant) => {
            Some(GivenGains::CompliantNormalised(torque_phase_normalised, inertia_phase_normalised))
        }
        (Some(_), _) => {
            let hint = "give the gains of its kind, or leave `gains` out to have them designed".to_owned();
            return Err(wrong("has gains of another kind".to_owned(), hint));
        }
    };
    Ok(ObserverEntry {
        name: raw.name.clone(),
        kind: raw.kind,
        method,
        sample_time_s: match &raw.sample_time_s {
            Some(value) => check.number("observer.sample_time_s", value, 1e-4..=0.2)?,
            None => SAMPLE_TIME_S,
        },
        discretisation: match raw.discretisation {
            RawDiscretisation::Exact => Discretisation::Exact,
            RawDiscretisation::Euler => Discretisation::Euler,
        },
        real_sensors,
        gains,
    })
}
