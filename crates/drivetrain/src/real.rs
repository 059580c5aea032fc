//! The number type of the laws.

/// A real number: `f32` on a controller, `f64` on a desktop.
pub trait Real: num_traits::Float + core::fmt::Debug + Send + Sync + 'static {
    /// The nearest value of this type.
    fn of(value: f64) -> Self;

    /// The value as `f64`, exactly.
    fn to_f64_exact(self) -> f64;

    /// The whole number below a value that is not negative; zero for NaN.
    fn whole(self) -> usize;
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
