//! Gains that depend on the friction coefficient.

use drivetrain::Real;

/// Gains that can be mixed.
pub trait Mix<T> {
    /// `(1 - fraction) self + fraction other`.
    fn mixed(&self, other: &Self, fraction: T) -> Self;
}

/// Gains at the ends of a range of friction coefficients, linear between them and constant beyond.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Schedule<T, G> {
    /// Minimum and maximum friction coefficient; of a constant gain, both the same.
    pub friction: [T; 2],
    /// The gains there.
    pub ends: [G; 2],
}

impl<T: Real, G: Clone> Schedule<T, G> {
    /// The same gains at any friction.
    pub fn constant(gains: G) -> Self {
        Self { friction: [T::zero(); 2], ends: [gains.clone(), gains] }
    }

    /// The same schedule in another precision, with gains cast by this.
    pub fn cast<U: Real, H>(&self, gains: impl Fn(&G) -> H) -> Schedule<U, H> {
        Schedule {
            friction: self.friction.map(|x| U::of(x.to_f64_exact())),
            ends: [gains(&self.ends[0]), gains(&self.ends[1])],
        }
    }
}

impl<T: Real, G: Mix<T> + Copy> Schedule<T, G> {
    /// The gains at a friction coefficient.
    #[inline]
    pub fn at(&self, friction: T) -> G {
        let [minimum, maximum] = self.friction;
        if maximum > minimum {
            let fraction = ((friction - minimum) / (maximum - minimum)).at_least(T::zero()).at_most(T::one());
            self.ends[0].mixed(&self.ends[1], fraction)
        } else {
            self.ends[0]
        }
    }
}

impl<T: Real, G: Clone> From<G> for Schedule<T, G> {
    fn from(gains: G) -> Self {
        Self::constant(gains)
    }
}

/// `(1 - fraction) a + fraction b`.
#[inline]
pub(crate) fn between<T: Real>(a: T, b: T, fraction: T) -> T {
    a + fraction * (b - a)
}
