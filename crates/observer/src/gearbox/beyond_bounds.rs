//! Which quantity of the car is beyond the bound of its error, by what the shifts show.
//!
//! The measurements of each shift ([`super::information`]) are held against cars in which one quantity differs by any size `d`, and the others are
//! those of the error budget (generalised likelihood ratio, Willsky and Jones 1976). With the innovation `e` of a shift in independent directions
//! of variance one over all cars of the budget, and `w` what the quantity shows in these directions per standard deviation unlearnt, the size by
//! the shifts and its variance are
//!
//! ```text
//! d = sum(w e)/n      s^2 = 1/n + beta      n = sum(w w)
//! ```
//!
//! with the variance `beta` of what all shifts have wrong alike, as in [`super::systematic`], times the square of how much wider than usual those
//! bounds of the elements are that it follows from: hysteresis, offsets of commands and the curvature of the models are as large as these allow. A
//! quantity is beyond its bound where `d` exceeds it by
//! [`CERTAIN`] times `s`. The cause that is named is the most likely one of those with a size beyond their bounds, where sizes have the standard
//! deviation `c` ([`BEYOND`]) beforehand: so a cause that needs an unlikely size is none. By the logarithm of the likelihood that is
//!
//! ```text
//! L = (d^2 g/s^2 + ln(1 - g))/2      g = c^2/(c^2 + s^2)
//! ```

use drivetrain::Real;

use super::learnt::{
    ACTING, Acting, DELAY_AT, INERTIA_AT, KISS_AT, LAG_AT, LEARNT, STIFFNESS_AT, Shown, TURBINE_AT, edge,
};
use super::powertrain::dot;
use super::{FrictionElement, GearboxFilter, GearboxState, MAX_ELEMENTS};

/// Hypotheses beside the quantities themselves: torque factors, kiss points, lags and delays of all elements alike.
const ALIKE: [usize; 4] = [0, KISS_AT, LAG_AT, DELAY_AT];
const HYPOTHESES: usize = LEARNT + ALIKE.len();
/// Standard deviations beyond the bound \[chosen\]: by chance in one of 200 cases of a quantity that is at its bound.
const CERTAIN: f64 = 2.6;
/// Rows further apart are no evidence, s \[chosen\]: a command is read up to so much later than its valve has it, which is twice the standard deviation of
/// a delay.
pub(super) const FINE_S: f64 = 0.015;
/// Part of the evidence that is left after each further shift \[chosen\]: the last thirty count.
const KEPT: f64 = 0.97;
/// Shifts that are needed: one alone may be one with wrong readings.
const SHIFTS: u8 = 2;
/// Evidence below which nothing follows: with it the shifts alone know the size to two standard deviations of the quantity unlearnt. What less evidence
/// shows follows from the errors that shifts have alike, and is often larger than any car: a friction below zero.
const LEAST: f64 = 0.25;
/// Variance `beta` of what all shifts have wrong alike, in that of the quantity unlearnt \[chosen: none of thirty drives of cars within usual bounds is
/// beyond\]: smaller than what is said of a car allows, as the innovation has the whole budget. Of the scale of all torques 8 %.
const OF_FACTOR: f64 = 0.5;
const OF_KISS: f64 = 0.15;
const OF_INERTIA: f64 = 1.0;
const OF_LAG: f64 = 0.15;
const OF_DELAY: f64 = 0.8;
const OF_STIFFNESS: f64 = 0.5;
/// What wider bounds of command or hysteresis add to it, per variance of such an offset within usual bounds: uniform up to 12 mA, which are 13 kPa of
/// a usual valve and 13 ms of a ramp of 1 MPa/s, where the kiss point has 9.5 kPa and the delay 7.5 ms.
const KISS_BY_OFFSET: f64 = 0.65;
const DELAY_BY_OFFSET: f64 = 1.0;
/// Standard deviation of a quantity beyond its bound, in that within it \[chosen\].
const BEYOND: f64 = 4.0;

/// How many times as wide as usual the bounds of each element are ([`super::ElementUncertainty::widths`]).
pub(super) type Widths<T> = [[T; 3]; MAX_ELEMENTS];

/// A quantity of the car.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CarQuantity {
    /// Torque of a clutch at the same pressure, friction times valve gain, as a fraction.
    TorqueFactor(Elements),
    /// Kiss point, Pa.
    KissPoint(Elements),
    /// Lag of the valve, as a fraction.
    Lag(Elements),
    /// Delay of the valve, s.
    Delay(Elements),
    /// Turbine-side inertia of a pair of gears ([`super::GearboxTables::pair`]), as a fraction.
    Inertia(usize),
    /// Stiffness of the drive shafts, as a fraction.
    Stiffness,
}

/// Whose quantity it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Elements {
    /// Of one element, by its place in [`super::GearboxTables::elements`].
    One(usize),
    /// Of all elements alike.
    All,
}

/// A quantity beyond its bound, in the unit of [`CarQuantity`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BeyondBounds<T> {
    /// The quantity.
    pub quantity: CarQuantity,
    /// By how much it differs from that of the vehicle file, positive if it is larger.
    pub size: T,
    /// Standard deviation of this size.
    pub std_dev: T,
    /// The bound of its difference.
    pub bound: T,
}

/// What the shifts of a drive show of each quantity alone.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Evidence<T> {
    /// Sums of `w e`.
    #[cfg_attr(feature = "serde", serde(with = "serde_big_array::BigArray"))]
    products: [T; HYPOTHESES],
    /// Sums of `w w`.
    #[cfg_attr(feature = "serde", serde(with = "serde_big_array::BigArray"))]
    squares: [T; HYPOTHESES],
    /// Shifts that have shown something of each.
    #[cfg_attr(feature = "serde", serde(with = "serde_big_array::BigArray"))]
    shifts: [u8; HYPOTHESES],
    /// The quantity that is beyond its bound, by its place among the hypotheses; its size and standard deviation, in that unlearnt.
    found: Option<(usize, [T; 2])>,
}

impl<T: Real> Evidence<T> {
    pub(super) fn nothing() -> Self {
        let zeros = [T::zero(); HYPOTHESES];
        Self { products: zeros, squares: zeros, shifts: [0; HYPOTHESES], found: None }
    }

    /// Whether a quantity is beyond its bound.
    pub(super) fn is_found(&self) -> bool {
        self.found.is_some()
    }

    /// Takes what a shift has shown of elements whose bounds have these widths, with a wheel speed or without. Without one the load of the road and
    /// the stiffness of the drive shafts look alike.
    pub(super) fn take(&mut self, acting: &Acting<T>, shown: &Shown<T>, widths: &Widths<T>, has_wheels: bool) {
        let mut add = |at: usize, column: &[T; ACTING]| {
            let w = shown.per_quantity(column);
            let square_now = dot(&w, &w);
            let sums = self.products.get_mut(at).zip(self.squares.get_mut(at)).zip(self.shifts.get_mut(at));
            if let Some(((product, square), shifts)) = sums.filter(|_| square_now > T::zero()) {
                *product = T::of(KEPT) * *product + dot(&w, &shown.by_budget.innovation);
                *square = T::of(KEPT) * *square + square_now;
                *shifts = shifts.saturating_add(1);
            }
        };
        let mut alike = [[T::zero(); ACTING]; ALIKE.len()];
        for a in 0..ACTING {
            // Shifts do not tell the torque at the gearbox input: a scale of all torques looks alike.
            let Some(place) = acting.place(a).filter(|place| *place != TURBINE_AT) else { continue };
            let mut column = [T::zero(); ACTING];
            column[a] = acting.per_unit(a).0;
            add(place, &column);
            for (sum, first) in alike.iter_mut().zip(ALIKE) {
                if (first..first + MAX_ELEMENTS).contains(&place) {
                    sum[a] = column[a];
                }
            }
        }
        if has_wheels {
            add(STIFFNESS_AT, acting.by_stiffness());
        }
        for (k, column) in alike.iter().enumerate() {
            add(LEARNT + k, column);
        }
        self.found = self.beyond(widths).map(|k| (k, self.size(k, widths)));
    }

    /// The most likely one of the quantities beyond their bounds, if one is for certain.
    fn beyond(&self, widths: &Widths<T>) -> Option<usize> {
        let (mut is_certain, mut found) = (false, (None, T::zero()));
        let sums = self.products.iter().zip(&self.squares).zip(&self.shifts).enumerate();
        for (k, ((product, n), shifts)) in sums.filter(|(_, ((_, n), _))| **n > T::of(LEAST)) {
            let (edge, variance) = (T::of(edge(place(k))), *n * (T::one() + in_common(k, widths) * *n));
            let above = product.abs() - edge * *n;
            is_certain |= *shifts >= SHIFTS && above > T::of(CERTAIN) * variance.sqrt();
            let likelihood = self.likelihood(k, widths);
            if above > T::zero() && (found.0.is_none() || likelihood > found.1) {
                found = (Some(k), likelihood);
            }
        }
        found.0.filter(|_| is_certain)
    }

    /// Size of a quantity by the shifts alone and its variance, in the standard deviation unlearnt, and the part of the size that is left with
    /// what sizes beyond a bound are likely.
    fn by_shifts(&self, k: usize, widths: &Widths<T>) -> [T; 3] {
        let k = k.min(HYPOTHESES - 1);
        let (n, beyond) = (self.squares[k], T::of(BEYOND * BEYOND));
        let variance = n.recip() + in_common(k, widths);
        [self.products[k] / n, variance, beyond / (beyond + variance)]
    }

    /// Size of a quantity beyond its bound and its standard deviation, in that unlearnt.
    fn size(&self, k: usize, widths: &Widths<T>) -> [T; 2] {
        let [size, variance, weight] = self.by_shifts(k, widths);
        [weight * size, (weight * variance).sqrt()]
    }

    /// `L` of a quantity.
    fn likelihood(&self, k: usize, widths: &Widths<T>) -> T {
        let [size, variance, weight] = self.by_shifts(k, widths);
        T::of(0.5) * (weight * size * size / variance + (T::one() - weight).ln())
    }
}

/// The place among the quantities of one of those that a hypothesis is of.
fn place(k: usize) -> usize {
    k.checked_sub(LEARNT).map_or(k, |alike| ALIKE[alike.min(ALIKE.len() - 1)])
}

/// Variance of the error that all shifts have in common of what they show of it: of one element by its own bounds, of others by the widest.
fn in_common<T: Real>(k: usize, widths: &Widths<T>) -> T {
    let variance = match place(k) {
        0..KISS_AT => OF_FACTOR,
        KISS_AT..INERTIA_AT => OF_KISS,
        STIFFNESS_AT => OF_STIFFNESS,
        INERTIA_AT..LAG_AT => OF_INERTIA,
        LAG_AT..DELAY_AT => OF_LAG,
        _ => OF_DELAY,
    };
    let of_one = ALIKE.into_iter().find(|first| (*first..first + MAX_ELEMENTS).contains(&k));
    let own = of_one.and_then(|first| widths.get(k - first).copied());
    let larger = |one: [T; 3], other: [T; 3]| core::array::from_fn(|i| one[i].max(other[i]));
    let [torque, offset, timing] = own.unwrap_or_else(|| widths.iter().copied().fold([T::one(); 3], larger));
    // A torque that is off moves no pressure in time.
    let width = if place(k) >= LAG_AT { offset.max(timing) } else { torque.max(offset).max(timing) };
    let by_offset = match place(k) {
        KISS_AT..INERTIA_AT => KISS_BY_OFFSET,
        DELAY_AT.. => DELAY_BY_OFFSET,
        _ => 0.0,
    };
    T::of(variance) * width * width + T::of(by_offset) * (offset * offset - T::one())
}

impl<T: Real> GearboxFilter<'_, T> {
    /// The widths of the bounds of all elements.
    pub(super) fn widths(&self) -> Widths<T> {
        core::array::from_fn(|at| {
            self.tables.elements.get(at).map_or([T::one(); 3], |element| element.uncertainty.widths)
        })
    }

    /// The quantity of the car that is beyond the bound of its error by the shifts of this drive, if one is: then the guaranteed ranges do not
    /// hold.
    pub fn beyond_bounds(&self, state: &GearboxState<T>) -> Option<BeyondBounds<T>> {
        let (k, size) = state.evidence.found?;
        let of = place(k);
        let elements = |first: usize| if k < LEARNT { Elements::One(of - first) } else { Elements::All };
        let quantity = match of {
            0..KISS_AT => CarQuantity::TorqueFactor(elements(0)),
            KISS_AT..INERTIA_AT => CarQuantity::KissPoint(elements(KISS_AT)),
            STIFFNESS_AT => CarQuantity::Stiffness,
            INERTIA_AT..LAG_AT => CarQuantity::Inertia(of - INERTIA_AT),
            LAG_AT..DELAY_AT => CarQuantity::Lag(elements(LAG_AT)),
            _ => CarQuantity::Delay(elements(DELAY_AT)),
        };
        let unit = self.unlearnt(quantity);
        let [mut size, std_dev] = size.map(|size| unit * size);
        if quantity == CarQuantity::Stiffness {
            // A softer shaft shows larger torques.
            size = -size;
        }
        Some(BeyondBounds { quantity, size, std_dev, bound: unit * T::of(edge(of)) })
    }
    /// Standard deviation of a quantity unlearnt; of several elements the mean.
    fn unlearnt(&self, quantity: CarQuantity) -> T {
        let mean = |elements: Elements, of: fn(&FrictionElement<T>) -> T| {
            let all = self.tables.elements;
            let lasting = |element: &FrictionElement<T>| element.uncertainty.slow_part.sqrt() * of(element);
            match elements {
                Elements::One(at) => all.get(at).map_or(T::zero(), lasting),
                Elements::All => {
                    all.iter().fold(T::zero(), |sum, element| sum + lasting(element)) / T::of(all.len().max(1) as f64)
                }
            }
        };
        match quantity {
            CarQuantity::TorqueFactor(of) => mean(of, |element| element.uncertainty.torque_fraction),
            CarQuantity::KissPoint(of) => mean(of, FrictionElement::kiss_std_dev_pa),
            CarQuantity::Lag(of) => mean(of, |element| element.uncertainty.valve_lag_fraction),
            CarQuantity::Delay(of) => mean(of, |element| element.uncertainty.valve_delay_s),
            CarQuantity::Inertia(_) => self.uncertainty.inertia_share,
            CarQuantity::Stiffness => self.uncertainty.stiffness_fraction,
        }
    }
}
