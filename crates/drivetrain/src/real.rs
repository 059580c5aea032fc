//! The number type of the laws.

use core::fmt::Debug;
use core::ops::{Add, Div, Mul, Neg, Rem, Sub};

/// A real number: `f32` on a controller, `f64` on a desktop.
///
/// Its elementary functions have the same bits on every processor and system: they are those of the crate `libm`, and not of the
/// platform's library, which has another rounding on another system and with other instructions. The code of this project calls
/// `Real::exp(x)` in place of `x.exp()` wherever a result may reach an output; `clippy.toml` refuses the other.
pub trait Real:
    Copy
    + PartialEq
    + PartialOrd
    + Debug
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Rem<Output = Self>
    + Neg<Output = Self>
{
    /// The nearest value of this type.
    fn of(value: f64) -> Self;

    /// The value as `f64`, exactly.
    fn to_f64_exact(self) -> f64;

    /// The whole number below a value that is not negative; zero for NaN.
    fn whole(self) -> usize;

    /// 0.
    fn zero() -> Self;
    /// 1.
    fn one() -> Self;
    /// The distance from 1 to the next larger value.
    fn epsilon() -> Self;
    /// The smallest positive value with all digits.
    fn min_positive_value() -> Self;
    /// Infinity.
    fn infinity() -> Self;
    /// Minus infinity.
    fn neg_infinity() -> Self;
    /// Not a number.
    fn nan() -> Self;

    /// Neither infinite nor NaN.
    fn is_finite(self) -> bool;
    /// Not a number.
    fn is_nan(self) -> bool;
    /// The absolute value.
    #[must_use]
    fn abs(self) -> Self;
    /// 1 with the sign of this.
    #[must_use]
    fn signum(self) -> Self;
    /// This value with the sign of the other.
    #[must_use]
    fn copysign(self, sign: Self) -> Self;
    /// The smaller of two; the other if one is NaN.
    #[must_use]
    fn min(self, other: Self) -> Self;
    /// The larger of two; the other if one is NaN.
    #[must_use]
    fn max(self, other: Self) -> Self;
    /// The nearest value from `low` to `high`; NaN for NaN.
    #[must_use]
    fn clamp(self, low: Self, high: Self) -> Self;
    /// The next whole number that is not larger.
    #[must_use]
    fn floor(self) -> Self;
    /// The next whole number that is not smaller.
    #[must_use]
    fn ceil(self) -> Self;
    /// The square root, to the last digit.
    #[must_use]
    fn sqrt(self) -> Self;

    /// e to this power.
    #[must_use]
    fn exp(self) -> Self;
    /// 2 to this power.
    #[must_use]
    fn exp2(self) -> Self;
    /// e to this power less 1.
    #[must_use]
    fn exp_m1(self) -> Self;
    /// The natural logarithm.
    #[must_use]
    fn ln(self) -> Self;
    /// The natural logarithm of 1 more than this.
    #[must_use]
    fn ln_1p(self) -> Self;
    /// The logarithm to base 2.
    #[must_use]
    fn log2(self) -> Self;
    /// The logarithm to base 10.
    #[must_use]
    fn log10(self) -> Self;
    /// The power.
    #[must_use]
    fn powf(self, exponent: Self) -> Self;
    /// The cube root.
    #[must_use]
    fn cbrt(self) -> Self;
    /// The length of a vector of two.
    #[must_use]
    fn hypot(self, other: Self) -> Self;
    /// The sine of an angle in rad.
    #[must_use]
    fn sin(self) -> Self;
    /// The cosine of an angle in rad.
    #[must_use]
    fn cos(self) -> Self;
    /// The angle with this cosine, rad.
    #[must_use]
    fn acos(self) -> Self;
    /// The hyperbolic tangent.
    #[must_use]
    fn tanh(self) -> Self;
    /// The value with this hyperbolic tangent.
    #[must_use]
    fn atanh(self) -> Self;
    /// The complementary error function: twice the probability that a normal variable of variance 1/2 is above this.
    #[must_use]
    fn erfc(self) -> Self;

    /// Sine and cosine of an angle in rad.
    #[must_use]
    fn sin_cos(self) -> (Self, Self) {
        (self.sin(), self.cos())
    }

    /// The whole power, by squaring; its order of multiplications is that of the binary digits of the exponent, from the last.
    #[inline]
    #[must_use]
    fn powi(self, exponent: i32) -> Self {
        let (mut rest, mut square, mut power) = (exponent.unsigned_abs(), self, Self::one());
        while rest > 0 {
            if rest % 2 == 1 {
                power = power * square;
            }
            rest /= 2;
            square = square * square;
        }
        if exponent < 0 { Self::one() / power } else { power }
    }

    /// 1 over this.
    #[inline]
    #[must_use]
    fn recip(self) -> Self {
        Self::one() / self
    }

    /// An angle in degrees, in rad.
    #[inline]
    #[must_use]
    fn to_radians(self) -> Self {
        self * Self::of(core::f64::consts::PI / 180.0)
    }

    /// The larger of this and `minimum`; `minimum` if this is NaN. Unlike `max`, which is a call of the mathematical library on a
    /// controller, it says nothing for a `minimum` that is NaN.
    #[inline]
    #[must_use]
    fn at_least(self, minimum: Self) -> Self {
        if self > minimum { self } else { minimum }
    }

    /// The smaller of this and `maximum`; `maximum` if this is NaN.
    #[inline]
    #[must_use]
    fn at_most(self, maximum: Self) -> Self {
        if self < maximum { self } else { maximum }
    }
}

/// The functions that have the same name for both types, and those of `libm`, whose names of single precision end in `f`.
macro_rules! real {
    ($type:ident, $to_f64:expr, $from_f64:expr, { $($name:ident($($argument:ident),*) = $function:ident;)* }) => {
        impl Real for $type {
            #[inline]
            fn of(value: f64) -> Self {
                $from_f64(value)
            }

            #[inline]
            fn to_f64_exact(self) -> f64 {
                $to_f64(self)
            }

            #[inline]
            // Rounding down is the purpose.
            fn whole(self) -> usize {
                // Through i32, for which processors have an instruction; tables have few bins.
                self as i32 as usize
            }

            #[inline]
            fn zero() -> Self {
                0.0
            }

            #[inline]
            fn one() -> Self {
                1.0
            }

            #[inline]
            fn epsilon() -> Self {
                Self::EPSILON
            }

            #[inline]
            fn min_positive_value() -> Self {
                Self::MIN_POSITIVE
            }

            #[inline]
            fn infinity() -> Self {
                Self::INFINITY
            }

            #[inline]
            fn neg_infinity() -> Self {
                Self::NEG_INFINITY
            }

            #[inline]
            fn nan() -> Self {
                Self::NAN
            }

            #[inline]
            fn is_finite(self) -> bool {
                self.is_finite()
            }

            #[inline]
            fn is_nan(self) -> bool {
                self.is_nan()
            }

            #[inline]
            fn abs(self) -> Self {
                self.abs()
            }

            #[inline]
            fn signum(self) -> Self {
                self.signum()
            }

            #[inline]
            fn copysign(self, sign: Self) -> Self {
                self.copysign(sign)
            }

            #[inline]
            fn min(self, other: Self) -> Self {
                self.min(other)
            }

            #[inline]
            fn max(self, other: Self) -> Self {
                self.max(other)
            }

            #[inline]
            fn clamp(self, low: Self, high: Self) -> Self {
                // Without the assertion of `clamp`, which is a panic path.
                if self < low { low } else if self > high { high } else { self }
            }

            $(
                #[inline]
                fn $name(self, $($argument: Self),*) -> Self {
                    libm::$function(self, $($argument),*)
                }
            )*
        }
    };
}

real!(f64, |value| value, |value| value, {
    floor() = floor;
    ceil() = ceil;
    sqrt() = sqrt;
    exp() = exp;
    exp2() = exp2;
    exp_m1() = expm1;
    ln() = log;
    ln_1p() = log1p;
    log2() = log2;
    log10() = log10;
    powf(exponent) = pow;
    cbrt() = cbrt;
    hypot(other) = hypot;
    sin() = sin;
    cos() = cos;
    acos() = acos;
    tanh() = tanh;
    atanh() = atanh;
    erfc() = erfc;
});

// Rounding to the controller's precision is the purpose.
const fn single(value: f64) -> f32 {
    value as f32
}

real!(f32, f64::from, single, {
    floor() = floorf;
    ceil() = ceilf;
    sqrt() = sqrtf;
    exp() = expf;
    exp2() = exp2f;
    exp_m1() = expm1f;
    ln() = logf;
    ln_1p() = log1pf;
    log2() = log2f;
    log10() = log10f;
    powf(exponent) = powf;
    cbrt() = cbrtf;
    hypot(other) = hypotf;
    sin() = sinf;
    cos() = cosf;
    acos() = acosf;
    tanh() = tanhf;
    atanh() = atanhf;
    erfc() = erfcf;
});
