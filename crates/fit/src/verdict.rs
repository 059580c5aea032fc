//! What logs tell of a parameter.

use crate::{Fit, Parameter};

/// What logs tell of a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Its interval is less than a third of what it was.
    Measured,
    /// Its interval is less than 0.7 of what it was.
    Partly,
    /// It is what it was before.
    NotIdentifiable,
}

impl Verdict {
    /// Of standard deviations after and before.
    pub fn of(after: f64, before: f64) -> Self {
        match after / before {
            fraction if fraction < 1.0 / 3.0 => Self::Measured,
            fraction if fraction < 0.7 => Self::Partly,
            _ => Self::NotIdentifiable,
        }
    }

    /// Words for tables and comments.
    pub fn name(self) -> &'static str {
        match self {
            Self::Measured => "measured",
            Self::Partly => "partly told by these logs",
            Self::NotIdentifiable => "not told by these logs",
        }
    }
}

impl Fit {
    /// What the logs tell of a parameter.
    pub fn verdict(&self, parameter: Parameter) -> Verdict {
        let Some(place) = self.place(parameter) else { return Verdict::NotIdentifiable };
        Verdict::of(self.sd(parameter).unwrap_or(f64::INFINITY), self.priors[place].sd)
    }

    /// What the logs tell of the factor that all torques have in common: an engine torque signal is a measurement of it.
    pub fn torque_scale_verdict(&self) -> Verdict {
        if self.available.engine_torque { Verdict::Partly } else { Verdict::NotIdentifiable }
    }
}
