//! Which clutches stick, and in which direction the others slip.

use drivetrain::Engagement;

/// Direction of slip.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// The input side is faster: the clutch torque is positive.
    Forward,
    /// The output side is faster: the clutch torque is negative.
    Backward,
}

impl Direction {
    /// The sign of the slip and of the clutch torque.
    #[inline]
    pub fn sign(self) -> f64 {
        match self {
            Self::Forward => 1.0,
            Self::Backward => -1.0,
        }
    }

    /// The direction in which a clutch gives way to this torque or slips at this speed.
    pub fn of(value: f64) -> Self {
        if value < 0.0 { Self::Backward } else { Self::Forward }
    }
}

/// How the two sides of a clutch meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Contact {
    /// They turn alike; the torque follows from that.
    Stuck,
    /// They turn differently; the torque follows from pressure and friction. An open clutch slips with
    /// no torque.
    Slipping(Direction),
}

/// The discrete state of the plant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Mode {
    /// The offgoing clutch.
    pub offgoing: Contact,
    /// The oncoming clutch.
    pub oncoming: Contact,
}

/// Clutches of a shift: the offgoing and the oncoming one.
pub(crate) const CLUTCHES: usize = 2;

impl Mode {
    /// The mode with these contacts of offgoing and oncoming clutch.
    pub(crate) fn of([offgoing, oncoming]: [Contact; CLUTCHES]) -> Self {
        Self { offgoing, oncoming }
    }

    /// Contacts of offgoing and oncoming clutch.
    pub(crate) fn contacts(self) -> [Contact; CLUTCHES] {
        [self.offgoing, self.oncoming]
    }

    /// Which clutches stick.
    #[inline]
    pub fn engagement(self) -> Engagement {
        Engagement::of(self.offgoing == Contact::Stuck, self.oncoming == Contact::Stuck)
    }
}
