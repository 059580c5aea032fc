//! Checked observers of an experiment file.

use car::{Discretisation, GivenGains, ObserverEntry, ObserverKind, SAMPLE_TIMES_S};
use toml::Spanned;

use super::raw::{RawDiscretisation, RawGains, RawObserver, RawSignals};
use crate::ConfigError;
use crate::check::{Check, Number, Numbers};

/// Sample time of an observer that gives none, s: the usual period of a transmission controller.
const SAMPLE_TIME_S: f64 = 0.01;

/// No two observers may have the same columns.
pub(super) fn distinct(
    check: &Check<'_>,
    raw: &[Spanned<RawObserver>],
    observers: &[ObserverEntry],
) -> Result<(), ConfigError> {
    for (i, observer) in observers.iter().enumerate() {
        if let Some(other) = observers[..i].iter().find(|other| other.column() == observer.column()) {
            let message = if other.name == observer.name {
                format!("two observers are called \"{}\"", observer.name)
            } else {
                let (other, name, column) = (&other.name, &observer.name, observer.column());
                format!("`{other}` and `{name}` have the same column name `{column}` in tables")
            };
            let hint = "give one of the observers another `name`".to_owned();
            return Err(check.meaning("observer.name", raw[i].get_ref().name.span().start, message, Some(hint)));
        }
    }
    Ok(())
}

pub(super) fn observer(
    check: &Check<'_>,
    raw: &Spanned<RawObserver>,
    has_sensors: bool,
) -> Result<ObserverEntry, ConfigError> {
    let at = raw.span().start;
    let raw = raw.get_ref();
    let name = check.name("observer.name", raw.name.get_ref(), raw.name.span().start)?;
    let wrong = |message: String, hint: String| check.meaning(format!("observer \"{name}\""), at, message, Some(hint));
    let real_sensors = raw.sensors == RawSignals::Real;
    if real_sensors && !has_sensors {
        let hint = "add a [sensors] table, or remove `sensors`".to_owned();
        return Err(wrong("has sensors = \"real\", but the file has no [sensors] table".to_owned(), hint));
    }
    let method = raw.method.unwrap_or_default();
    if raw.method.is_some()
        && (raw.gains.is_some() || !matches!(raw.kind, ObserverKind::Rigid | ObserverKind::Compliant))
    {
        let hint = "remove `method`; it is only for the kinds rigid and compliant without `gains`".to_owned();
        return Err(wrong("has a `method`, but no gains are designed for it".to_owned(), hint));
    }
    let gains = raw.gains.as_ref().map(|raw_gains| gains(check, &name, raw.kind, raw_gains)).transpose()?;
    Ok(ObserverEntry {
        kind: raw.kind,
        method,
        sample_time_s: match &raw.sample_time_s {
            Some(value) => check.number("observer.sample_time_s", value, SAMPLE_TIMES_S)?,
            None => SAMPLE_TIME_S,
        },
        discretisation: match raw.discretisation {
            RawDiscretisation::Exact => Discretisation::Exact,
            RawDiscretisation::Euler => Discretisation::Euler,
        },
        real_sensors,
        gains,
        name,
    })
}

/// The gains of an observer of this kind, and no others.
fn gains(
    check: &Check<'_>,
    observer: &str,
    kind: ObserverKind,
    spanned: &Spanned<RawGains>,
) -> Result<GivenGains, ConfigError> {
    let (at, raw) = (spanned.span().start, spanned.get_ref());
    let of = format!("observer \"{observer}\"");
    let key = |name: &str| format!("observer.gains.{name}");
    let number = |name: &str, value: &Option<Number>, range| {
        check.number(key(name), check.required(&of, at, name, value.as_ref())?, range)
    };
    let pair = |name: &str, value: &Option<Numbers>, range| -> Result<[f64; 2], ConfigError> {
        check.array(key(name), check.required(&of, at, name, value.as_ref())?, range)
    };
    let rigid = raw.torque_phase_pa_s_rad.is_some() || raw.inertia_phase_pa_s_rad.is_some();
    let sliding = raw.torque_speed_rad_s2.is_some()
        || raw.torque_pressure_pa_s.is_some()
        || raw.inertia_speed_rad_s2.is_some()
        || raw.inertia_pressure_pa_s.is_some();
    let compliant = raw.torque_phase_normalised.is_some() || raw.inertia_phase_normalised.is_some();
    match (kind, rigid, sliding, compliant) {
        (ObserverKind::Rigid, _, false, false) => Ok(GivenGains::Rigid {
            torque_phase_pa_s_rad: number("torque_phase_pa_s_rad", &raw.torque_phase_pa_s_rad, -1e8..=1e8)?,
            inertia_phase_pa_s_rad: pair("inertia_phase_pa_s_rad", &raw.inertia_phase_pa_s_rad, -1e8..=1e8)?,
        }),
        (ObserverKind::Sliding, false, _, false) => Ok(GivenGains::Sliding {
            torque_speed_rad_s2: number("torque_speed_rad_s2", &raw.torque_speed_rad_s2, 0.0..=1e6)?,
            torque_pressure_pa_s: number("torque_pressure_pa_s", &raw.torque_pressure_pa_s, -1e10..=1e10)?,
            inertia_speed_rad_s2: pair("inertia_speed_rad_s2", &raw.inertia_speed_rad_s2, 0.0..=1e6)?,
            inertia_pressure_pa_s: pair("inertia_pressure_pa_s", &raw.inertia_pressure_pa_s, -1e10..=1e10)?,
        }),
        (ObserverKind::Compliant, false, false, _) => {
            let rows = |name: &str, value| check.required(&of, at, name, Option::as_ref(value));
            let (torque, inertia) = ("torque_phase_normalised", "inertia_phase_normalised");
            Ok(GivenGains::CompliantNormalised(
                matrix(check, &key(torque), at, rows(torque, &raw.torque_phase_normalised)?)?,
                matrix(check, &key(inertia), at, rows(inertia, &raw.inertia_phase_normalised)?)?,
            ))
        }
        _ => {
            let hint = "give the gains of this kind, or remove `gains`: the gains are then designed".to_owned();
            Err(check.meaning(&of, at, "has gains of another kind of observer".to_owned(), Some(hint)))
        }
    }
}

/// A normalised gain, rows `(T_s, p)`.
fn matrix<const N: usize>(
    check: &Check<'_>,
    key: &str,
    at: usize,
    rows: &Vec<Numbers>,
) -> Result<[[f64; N]; 2], ConfigError> {
    match rows.as_slice() {
        [shaft, pressure] => {
            let row = |row| check.array(key, row, -1e6..=1e6);
            Ok([row(shaft)?, row(pressure)?])
        }
        _ => {
            let hint = Some("a gain has a row for the shaft torque and one for the pressure".to_owned());
            Err(check.meaning(key, at, format!("has {} rows, expected 2", rows.len()), hint))
        }
    }
}
