//! Values that logs tell, and the words for those of a channel.

use drivetrain::Real;

use crate::verdict::SIDES;
use crate::{MapChange, Verdict};

/// Errors of scale, and delays, s, that are nothing to correct \[chosen\].
pub(crate) const MIN_SCALE: f64 = 1e-3;
pub(crate) const MIN_DELAY_S: f64 = 1e-3;

/// A value with its standard deviation as it is stated, and before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Known {
    /// The value.
    pub value: f64,
    /// Its standard deviation.
    pub sd: f64,
    /// That of before.
    pub before: f64,
}

impl Known {
    /// How far the logs identify it.
    pub fn verdict(&self) -> Verdict {
        Verdict::of(self.sd, self.before)
    }

    /// With a floor for what the model leaves out, and not less known than before.
    pub(super) fn of(value: f64, sd: f64, floor: f64, before: f64) -> Self {
        Self { value, sd: Real::hypot(sd, floor).min(before), before }
    }

    /// Whether it is identified, and more than this and its interval away from zero.
    pub(crate) fn is_off_by(&self, minimum: f64) -> bool {
        self.verdict() != Verdict::NotIdentifiable && self.value.abs() > (SIDES * self.sd).max(minimum)
    }
}

/// The change of the channel map for a signal that is late by this, s, where it is identified and not about zero.
pub(crate) fn change_of_delay(signal: &str, late_s: &Known) -> Option<MapChange> {
    late_s.is_off_by(MIN_DELAY_S).then(|| MapChange::of_delay(signal, late_s))
}

/// What is said of the delay of a channel against another one, and where it belongs: `change` is that of the channel map.
pub(crate) fn said_of_delay(
    role: &str,
    against: &str,
    late_s: &Known,
    change: Option<&MapChange>,
    identified_by: &str,
) -> String {
    let [late_ms, half_ms] = [late_s.value, SIDES * late_s.sd].map(|time_s| 1e3 * time_s);
    let found = format!("{role} is {late_ms:+.1} +- {half_ms:.1} ms behind {against}");
    if late_s.verdict() == Verdict::NotIdentifiable {
        return format!("{found}: its delay is not identified by these logs; {identified_by}");
    }
    let ahead = if late_s.is_off_by(MIN_DELAY_S) && late_ms < 0.0 { ", ahead of it" } else { "" };
    match change {
        None if late_s.is_off_by(MIN_DELAY_S) => format!("{found}{ahead}: its channel stays as it is"),
        None => format!("{found}: they belong together"),
        Some(change) => format!("{found}{ahead}: {}", change.instruction()),
    }
}
