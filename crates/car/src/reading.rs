//! One reading of a channel.

use drivetrain::Real;

/// Time without a reading after which a channel is lost, and without any speed after which a filter begins anew, s.
pub const LOST_S: f64 = 0.25;

/// The newest value of a sensor or a controller, and how old it is.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Reading<T = f64> {
    /// The value, in the unit of its channel.
    pub value: T,
    /// Time from the moment it was measured until the step that takes it, s.
    pub age_s: T,
}

impl<T: Real> Reading<T> {
    /// A reading of the moment.
    #[inline]
    pub fn now(value: T) -> Self {
        Self { value, age_s: T::zero() }
    }

    /// The same reading in another precision.
    pub fn cast<U: Real>(&self) -> Reading<U> {
        Reading { value: U::of(self.value.to_f64_exact()), age_s: U::of(self.age_s.to_f64_exact()) }
    }
}
