//! The number type of the laws.

/// A real number: `f32` on a controller, `f64` on a desktop.
pub trait Real: num_traits::Float + core::fmt::Debug + Send + Sync + 'static {
    /// The nearest value of this type.
    fn of(value: f64) -> Self;

    /// The value as `f64`, exactly.
    fn to_f64_exact(self) -> f64;

    /// The whole number below a value that is not negative; zero for NaN.
    fn whole(self) -> usize;

    /// The larger of this and `least`; `least` if this is NaN. Unlike `max`, which is a call of the mathematical library on a
    /// controller, it says nothing for a `least` that is NaN.
    #[inline]
    fn at_least(self, least: Self) -> Self {
        if self > least { self } else { least }
    }

    /// The smaller of this and `most`; `most` if this is NaN.
    #[inline]
    fn at_most(self, most: Self) -> Self {
        if self < most { self } else { most }
    }
}

impl Real for f64 {
    #[inline]
    fn of(value: f64) -> Self {
        value
    }

    #[inline]
    fn to_f64_exact(self) -> f64 {
        self
    }

    #[inline]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "rounding down is the purpose")]
    fn whole(self) -> usize {
        // Through i32, for which processors have an instruction; tables have few bins.
        self as i32 as usize
    }
}

impl Real for f32 {
    #[inline]
    #[expect(clippy::cast_possible_truncation, reason = "rounding to the controller's precision is the purpose")]
    fn of(value: f64) -> Self {
        value as Self
    }

    #[inline]
    fn to_f64_exact(self) -> f64 {
        f64::from(self)
    }

    #[inline]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "rounding down is the purpose")]
    fn whole(self) -> usize {
        // Through i32, for which processors have an instruction; tables have few bins.
        self as i32 as usize
    }
}
