//! How far logs identify a parameter.

/// Standard deviations on either side of a stated interval.
pub(crate) const SIDES: f64 = 2.0;

/// How far logs identify a parameter.
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
            Self::Partly => "partly identified by these logs",
            Self::NotIdentifiable => "not identified by these logs",
        }
    }
}
