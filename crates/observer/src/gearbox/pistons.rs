//! The piston of an element, which has to close the clearance of the plates, and what is not known of it.
//!
//! Where the piston is cannot be measured, and until it has closed the clearance the element carries nothing, whatever
//! the pressure at its valve. What follows is no small error about a mean: the element carries all or nothing. So nine
//! pistons of equal probability are carried by the law of [`drivetrain::Cylinder`]. They differ by two independent errors: of
//! the time that a fill takes (volume and passages), and of the pressure at the valve against that of the return spring,
//! on which a slow stroke at low pressure depends. A tenth has no stroke to make, as that of a clutch that was open for too short a time
//! to empty, or of another car than the file says; its probability is what the readings of the fill show. From them follow the
//! probability that the plates touch, mean and standard deviation of what presses them, and how much of an error of it lasts from step
//! to step.

use drivetrain::{Cylinder, Real};

use super::square;

/// Pistons with a stroke that are carried.
const STROKES: usize = 9;
/// The same and one more, without a stroke.
const POINTS: usize = STROKES + 1;
/// Its stroke over that of the file: what is left of the clearance.
const CLOSED: f64 = 1e-3;
/// Probability before a fill that the piston has no stroke to make \[chosen\], and the minimum of it and of the opposite, whatever the
/// readings show.
const CLOSED_BEFORE: f64 = 0.1;
const CLOSED_MIN: f64 = 1e-3;
/// Largest logarithm of the ratio of two likelihoods in a step.
const LARGEST_LOG: f64 = 20.0;
/// Standard deviations of the fill's time and of the pressure of each piston: the middles of nine equal parts of a Gaussian, each once in
/// both columns, which are not correlated. The first piston is the nominal one.
const AWAY: [[f64; 2]; STROKES] = [
    [0.0, 0.0],
    [PARTS[0], PARTS[2]],
    [PARTS[1], -PARTS[3]],
    [PARTS[2], -PARTS[0]],
    [PARTS[3], PARTS[1]],
    [-PARTS[0], -PARTS[2]],
    [-PARTS[1], PARTS[3]],
    [-PARTS[2], PARTS[0]],
    [-PARTS[3], -PARTS[1]],
];
/// To three digits, scaled to a variance of one.
const PARTS: [f64; 4] = [0.303, 0.633, 1.039, 1.712];
/// Step of the pistons, s \[chosen\]: about the lag of a filled cylinder with warm oil.
const STEP_S: f64 = 2.5e-3;
const MAX_STEPS: usize = 128;
/// Change of the pressure over a step of the filter below which a piston that is not on its stroke rests, Pa.
const RESTS_PA: f64 = 1.0;

/// A piston with a stroke, as the filter knows it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Piston<T> {
    /// The nominal cylinder.
    pub cylinder: Cylinder<T>,
    /// Of each of the pistons that are carried the volume of the stroke, m^3, and the pressure in its standard deviations.
    pub each: [[T; 2]; STROKES],
}

impl Piston<f64> {
    /// A piston in this cylinder. `fill_fraction` is the standard deviation of the time that a fill takes, as a fraction: volume of the
    /// stroke and resistance of the passages.
    pub fn new(cylinder: Cylinder<f64>, fill_fraction: f64) -> Self {
        let each = AWAY.map(|[late, more]| {
            // A fill that is longer by a fraction has a longer stroke by it.
            let longer = 1.0 + late.abs() * fill_fraction;
            [cylinder.stroke_m3 * if late < 0.0 { longer.recip() } else { longer }, more]
        });
        Self { cylinder, each }
    }
}

impl<T: Real> Piston<T> {
    /// The cylinders of the pistons that are carried, and the errors of their pressures, Pa, with this standard deviation.
    fn cylinders(&self, error_pa: T) -> [(Cylinder<T>, T); POINTS] {
        core::array::from_fn(|k| {
            let [stroke_m3, more] =
                self.each.get(k).copied().unwrap_or([T::of(CLOSED) * self.cylinder.stroke_m3, T::zero()]);
            (Cylinder { stroke_m3, ..self.cylinder }, more * error_pa)
        })
    }

    /// The same in another precision.
    pub fn cast<U: Real>(&self) -> Piston<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        Piston { cylinder: self.cylinder.cast(), each: self.each.map(|each| each.map(to)) }
    }
}

/// One of the pistons.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Point<T> {
    /// Oil beyond that with the piston on its stop, m^3.
    volume_m3: T,
    /// Pressure in the cylinder less its error, Pa.
    pressure_pa: T,
    /// The same above the kiss point, where the plates touch; else zero. Beside it that at the beginning of the step.
    pressed_pa: T,
    pressed_before_pa: T,
    touches: bool,
}

/// What presses the plates by the pistons, and the errors beside it, Pa.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Spread<T> {
    /// Probability that the plates touch.
    pub(super) touches: T,
    /// Standard deviation of what presses the plates by what is not known of the fill.
    pub(super) fill_pa: T,
    /// Standard deviation of it with that of the pressure, `moving_pa`, where the plates touch.
    pub(super) all_pa: T,
}

impl<T: Real> Spread<T> {
    fn of(points: &[Point<T>; POINTS], closed: T, moving_pa: T) -> Self {
        let touches = mean(points, closed, Point::touching);
        let fill = covariance(points, closed, |point| point.pressed_pa).at_least(T::zero());
        Self { touches, fill_pa: fill.sqrt(), all_pa: (fill + square(touches * moving_pa)).sqrt() }
    }
}

/// The pistons of an element.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Pistons<T> {
    points: [Point<T>; POINTS],
    /// Probability of the last of them, which has no stroke. The others are alike.
    closed: T,
    pub(super) spread: Spread<T>,
    /// Correlation of the error of what presses the plates with that at the beginning of the step.
    pub(super) lasts: T,
    /// Pressure at the valve, and its standard deviation, at the end of the last step, Pa.
    valve_pa: T,
    moving_pa: T,
    /// Whether they rest as long as the pressure at the valve does.
    rest: bool,
}

impl<T: Real> Pistons<T> {
    /// With the valve at this pressure for ever. `error_pa` is the standard deviation of the pressure against the return spring.
    pub(super) fn settled(piston: &Piston<T>, valve_pa: T, error_pa: T, moving_pa: T) -> Self {
        let points = piston.cylinders(error_pa).map(|(cylinder, away_pa)| {
            Point::new(&cylinder, cylinder.volume((valve_pa + away_pa).at_least(T::zero())), away_pa)
        });
        let closed = T::of(CLOSED_BEFORE);
        let spread = Spread::of(&points, closed, moving_pa);
        Self { points, closed, spread, lasts: T::one(), valve_pa, moving_pa, rest: false }
    }

    /// Carries the pistons over a step, at whose end the valve has this pressure. `error_pa` is the standard deviation of the pressure
    /// against the return spring, `moving_pa` that of the pressure.
    pub(super) fn step(&mut self, piston: &Piston<T>, valve_pa: T, [error_pa, moving_pa]: [T; 2], dt_s: T) {
        self.lasts = T::one();
        if dt_s <= T::zero() || self.rest && valve_pa == self.valve_pa {
            return;
        }
        self.points.iter_mut().for_each(|point| point.pressed_before_pa = point.pressed_pa);
        self.rest = self.advance(piston, [self.valve_pa, valve_pa], error_pa, dt_s);
        self.conclude(moving_pa);
        self.valve_pa = valve_pa;
    }

    /// Carries the pistons over `dt_s`, in which the pressure of the valve goes from one to another value. Whether they rest then.
    fn advance(&mut self, piston: &Piston<T>, [from_pa, to_pa]: [T; 2], error_pa: T, dt_s: T) -> bool {
        let steps = (dt_s / T::of(STEP_S)).ceil().whole().clamp(1, MAX_STEPS);
        let step_s = dt_s / T::of(steps as f64);
        let rise_pa = (to_pa - from_pa) / T::of(steps as f64);
        let mut rest = true;
        for (point, (cylinder, away_pa)) in self.points.iter_mut().zip(piston.cylinders(error_pa)) {
            let before_pa = point.pressure_pa;
            let (mut volume_m3, mut valve_pa) = (point.volume_m3, from_pa + away_pa);
            for _ in 0..steps {
                valve_pa = valve_pa + rise_pa;
                volume_m3 = cylinder.carried(volume_m3, valve_pa.at_least(T::zero()), step_s);
            }
            let pressed_before_pa = point.pressed_before_pa;
            *point = Point { pressed_before_pa, ..Point::new(&cylinder, volume_m3, away_pa) };
            let on_stroke = volume_m3 > T::zero() && !point.touches;
            rest = rest && !on_stroke && (point.pressure_pa - before_pa).abs() <= T::of(RESTS_PA);
        }
        rest
    }

    /// What follows at the end of a step, with this standard deviation of the pressure.
    fn conclude(&mut self, moving_pa: T) {
        let then = self.spread;
        if self.points.iter().all(|point| !point.touches || point.pressed_pa <= T::zero()) {
            self.closed = T::of(CLOSED_BEFORE);
        }
        self.spread = Spread::of(&self.points, self.closed, moving_pa);
        let by_pressure = self.spread.touches * moving_pa * then.touches * self.moving_pa;
        let both = self.spread.all_pa * then.all_pa;
        let lasts = (covariance(&self.points, self.closed, |point| point.pressed_before_pa) + by_pressure) / both;
        self.lasts = if both > T::zero() { lasts.at_least(T::zero()).at_most(T::one()) } else { T::zero() };
        self.moving_pa = moving_pa;
    }

    /// Pressure of the nominal cylinder, Pa.
    pub(super) fn nominal_pa(&self) -> T {
        self.points[0].pressure_pa
    }

    /// Mean of the pressure, Pa.
    pub(super) fn mean_pa(&self) -> T {
        mean(&self.points, self.closed, |point| point.pressure_pa)
    }

    /// Takes what the readings of a step have shown of the error of what presses the plates, as mean and variance before and after them, in
    /// its standard deviations: whether there is a stroke to make. Factor of that error then, and what is added.
    pub(super) fn take_shown(&mut self, before: [T; 2], after: [T; 2]) -> Option<[T; 2]> {
        let all_pa = self.spread.all_pa;
        let precision = after[1].recip() - before[1].recip();
        if !(precision > T::zero() && precision.is_finite() && all_pa > T::of(RESTS_PA)) {
            return None;
        }
        let information = after[0] / after[1] - before[0] / before[1];
        let then_pa = self.pressed_pa(self.closed);
        let [strokes, none] = [T::zero(), T::one()].map(|closed| {
            let away = (self.pressed_pa(closed) - then_pa) / all_pa;
            let variance = square(Spread::of(&self.points, closed, self.moving_pa).all_pa / all_pa);
            log_likelihood([away, variance], [information, precision])
        });
        let (log_ratio, largest) = (none - strokes, T::of(LARGEST_LOG));
        if !log_ratio.is_finite() {
            return None;
        }
        let odds = self.closed / (T::one() - self.closed) * log_ratio.at_least(-largest).at_most(largest).exp();
        let minimum = T::of(CLOSED_MIN);
        self.closed = (odds / (T::one() + odds)).at_least(minimum).at_most(T::one() - minimum);
        self.spread = Spread::of(&self.points, self.closed, self.moving_pa);
        Some([all_pa, then_pa - self.pressed_pa(self.closed)].map(|of| of / self.spread.all_pa))
    }

    /// Mean of what presses the plates where that probability is this one, Pa.
    fn pressed_pa(&self, closed: T) -> T {
        mean(&self.points, closed, |point| point.pressed_pa)
    }

    /// What presses the plates if they touch: the mean of `pressed`, which gives it and its derivative from the pressure
    /// in the cylinder, and the largest.
    pub(super) fn pressed(&self, pressed: impl Fn(T) -> (T, T)) -> ([T; 2], T) {
        let (mut sum, mut maximum) = ([T::zero(); 2], T::zero());
        for (point, weight) in self.points.iter().zip(weights(self.closed)).filter(|(point, _)| point.touches) {
            let (value, slope) = pressed(point.pressure_pa);
            sum = [sum[0] + weight * value, sum[1] + weight * slope];
            maximum = maximum.at_least(value);
        }
        (sum, maximum)
    }
}

impl<T: Real> Point<T> {
    fn touching(&self) -> T {
        if self.touches { T::one() } else { T::zero() }
    }

    fn new(cylinder: &Cylinder<T>, volume_m3: T, away_pa: T) -> Self {
        let touches = volume_m3 >= cylinder.stroke_m3;
        let in_cylinder_pa = cylinder.pressure(volume_m3);
        let on_stroke = volume_m3 > T::zero() && !touches;
        // On the stroke the return spring alone makes the pressure.
        let pressure_pa = if on_stroke { in_cylinder_pa } else { (in_cylinder_pa - away_pa).at_least(T::zero()) };
        let pressed_pa = if touches { (pressure_pa - cylinder.kiss_pa).at_least(T::zero()) } else { T::zero() };
        Self { volume_m3, pressure_pa, pressed_pa, pressed_before_pa: pressed_pa, touches }
    }
}

/// The probability of each point, where that of the one without a stroke is known.
fn weights<T: Real>(closed: T) -> [T; POINTS] {
    core::array::from_fn(|k| if k < STROKES { (T::one() - closed) / T::of(STROKES as f64) } else { closed })
}

/// Logarithm of the likelihood of readings that show this information and precision, for a Gaussian with this mean and variance: that of
/// `exp(information x - precision x^2/2)` over it.
fn log_likelihood<T: Real>([mean, variance]: [T; 2], [information, precision]: [T; 2]) -> T {
    let (one, half) = (T::one(), T::of(0.5));
    let spread = one + precision * variance;
    let exponent = (information - half * precision * mean) * mean + half * square(information) * variance;
    exponent / spread - half * spread.ln()
}

fn mean<T: Real>(points: &[Point<T>; POINTS], closed: T, of: impl Fn(&Point<T>) -> T) -> T {
    points.iter().zip(weights(closed)).fold(T::zero(), |sum, (point, weight)| sum + weight * of(point))
}

/// Covariance of what presses the plates with the same at this time, Pa^2.
fn covariance<T: Real>(points: &[Point<T>; POINTS], closed: T, then: impl Fn(&Point<T>) -> T) -> T {
    let means = [mean(points, closed, |point| point.pressed_pa), mean(points, closed, &then)];
    mean(points, closed, |point| (point.pressed_pa - means[0]) * (then(point) - means[1]))
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use drivetrain::{Clutch, Table1};
    use std::vec::Vec;

    const FILL_FRACTION: f64 = 0.16;
    const ERROR_PA: f64 = 11e3;

    fn piston() -> Piston<f64> {
        let clutch = Clutch {
            mean_radius_m: 0.13,
            friction_faces: 3.0,
            piston_area_m2: 0.01,
            return_spring_n: 600.0,
            friction: Table1::constant(0.13),
            static_friction: 0.14,
        };
        Piston::new(Cylinder::of_clutch(&clutch), FILL_FRACTION)
    }

    /// A pulse, a hold just above the kiss point, and a ramp: the pressure after so many steps of 10 ms, straight between them, Pa.
    fn valve_pa(step: usize) -> f64 {
        match step {
            0 => 0.0,
            1..=12 => 0.21e6,
            13..=40 => 0.075e6,
            _ => 0.075e6 + 5e3 * (step - 40) as f64,
        }
    }

    /// The pistons in the steps of that fill.
    fn filled<T: Real>(piston: &Piston<T>) -> Vec<Pistons<T>> {
        let of = |x: f64| T::of(x);
        let mut pistons = Pistons::settled(piston, T::zero(), of(ERROR_PA), of(7e3));
        (0..80)
            .map(|k| {
                pistons.step(piston, of(valve_pa(k + 1)), [of(ERROR_PA), of(7e3)], of(0.01));
                pistons
            })
            .collect()
    }

    #[test]
    fn the_parts_are_those_of_a_gaussian_and_not_correlated() {
        let sum = |of: fn(&[f64; 2]) -> f64| AWAY.iter().map(of).sum::<f64>() / 9.0;
        assert!(
            (sum(|away| away[0] * away[0]) - 1.0).abs() < 2e-3 && (sum(|away| away[1] * away[1]) - 1.0).abs() < 2e-3
        );
        let none = [sum(|away| away[0]), sum(|away| away[1]), sum(|away| away[0] * away[1])];
        assert!(none.iter().all(|sum| sum.abs() < 1e-12), "{none:?}");
    }

    /// Errors between their bounds, each as likely as the others, in their standard deviations.
    fn uniform_errors() -> Vec<[f64; 2]> {
        let of = |k: i32| 3.0_f64.sqrt() * f64::from(k) / 10.5;
        (-10..=10).flat_map(|late| (-10..=10).map(move |more| [of(late), of(more)])).collect()
    }

    /// By how much the fraction of nine pistons differs at most from that of all errors, on one side of any line through both.
    fn largest_error_of_a_fraction(all: &[[f64; 2]]) -> f64 {
        let mut maximum = 0.0_f64;
        for degrees in 0..180 {
            let (b, a) = f64::from(degrees).to_radians().sin_cos();
            let below = |of: &[[f64; 2]], line: f64| {
                of.iter().filter(|[late, more]| a * late + b * more < line).count() as f64 / of.len() as f64
            };
            for line in AWAY.iter().flat_map(|[late, more]| [-1e-9, 1e-9].map(|side| a * late + b * more + side)) {
                maximum = maximum.max((below(&AWAY, line) - below(all, line)).abs());
            }
        }
        maximum
    }

    /// Of pistons with other errors of the same standard deviations so many touch as nine can tell.
    #[test]
    fn as_many_pistons_touch_as_is_said() {
        let (piston, all) = (piston(), uniform_errors());
        let bound = largest_error_of_a_fraction(&all);
        assert!(bound < 0.18, "nine: {bound}");
        let mut touching = [0.0; 80];
        for [late, more] in &all {
            let cylinder =
                Cylinder { stroke_m3: (1.0 + FILL_FRACTION * late) * piston.cylinder.stroke_m3, ..piston.cylinder };
            let mut volume = 0.0;
            for (k, touching) in touching.iter_mut().enumerate() {
                for part in 1..=10 {
                    let [from_pa, to_pa] = [k, k + 1].map(valve_pa);
                    let at_valve_pa = from_pa + 0.1 * f64::from(part) * (to_pa - from_pa);
                    volume = cylinder.carried(volume, (at_valve_pa + ERROR_PA * more).max(0.0), 1e-3);
                }
                *touching += f64::from(u8::from(volume >= cylinder.stroke_m3)) / 441.0;
            }
        }
        let said = filled(&piston);
        for (k, (said, found)) in said.iter().zip(touching).enumerate() {
            assert!((said.spread.touches - found).abs() < bound, "{k}: {} {found}", said.spread.touches);
        }
        assert!((0.2..0.9).contains(&touching[20]), "a test of a fill that is not certain: {}", touching[20]);
    }

    #[test]
    fn what_is_not_known_of_the_fill_ends_with_it() {
        let steps = filled(&piston());
        let [empty, filling, full] = [5, 20, 79].map(|k| steps[k].spread);
        assert_eq!(empty.touches, CLOSED_BEFORE, "the one without a stroke");
        assert!(filling.fill_pa > 3e3, "{filling:?}");
        assert!(full.touches > 0.999 && full.fill_pa < 500.0 && (full.all_pa - 7e3).abs() < 50.0, "{full:?}");
        // Each piston that touches more makes it another, and at the end all of it lasts.
        assert!(steps.iter().all(|step| (0.0..=1.0).contains(&step.lasts)));
        assert!(steps[8..30].iter().any(|step| step.lasts < 0.9) && steps[79].lasts > 0.999);
    }

    /// The probability that there is no stroke, after ten readings in a fill of what presses the plates without one, or with one.
    fn closed_after_readings<T: Real>(without: bool, near_pa: f64) -> f64 {
        let of = |x: f64| T::of(x);
        let mut pistons = filled::<T>(&piston().cast())[11];
        let (mut x, then) = ([of(0.0), of(1.0)], pistons.pressed_pa(of(f64::from(u8::from(without)))));
        for _ in 0..10 {
            // A reading with a standard deviation of a third of the error's own.
            let (mean_pa, all_pa) = (pistons.pressed_pa(pistons.closed), pistons.spread.all_pa);
            let before = [of(0.9) * x[0], of(0.81) * x[1] + of(0.19)];
            let gain = before[1] / (before[1] + of(0.1));
            let after = [before[0] + gain * ((then - mean_pa) / all_pa - before[0]), (of(1.0) - gain) * before[1]];
            let [factor, added] = pistons.take_shown(before, after).unwrap();
            x = [factor * after[0] + added, (factor * factor * after[1]).at_most(of(1.0))];
            let kept_pa = pistons.pressed_pa(pistons.closed) + x[0] * pistons.spread.all_pa;
            assert!((kept_pa - mean_pa - after[0] * all_pa).abs() < of(near_pa), "the pressure stays");
        }
        pistons.closed.to_f64_exact()
    }

    #[test]
    fn readings_of_a_torque_in_the_fill_show_that_there_is_no_stroke() {
        for (without, with) in [
            (closed_after_readings::<f64>(true, 1e-6), closed_after_readings::<f64>(false, 1e-6)),
            (closed_after_readings::<f32>(true, 1.0), closed_after_readings::<f32>(false, 1.0)),
        ] {
            assert!(without > 0.9 && with < 0.1, "{without} {with}");
        }
    }

    #[test]
    fn what_shows_nothing_of_the_fill_changes_nothing() {
        let mut pistons = filled::<f64>(&piston())[79];
        let then = pistons;
        for after in [[0.0, 1.0], [0.3, 1.2], [f64::NAN, 0.5], [f64::INFINITY, 0.5], [0.0, f64::NAN], [0.0, 0.0]] {
            assert!(pistons.take_shown([0.0, 1.0], after).is_none() && pistons == then, "{after:?}");
        }
        // All touch: whatever is seen is no matter of the fill.
        let [factor, added] = pistons.take_shown([0.0, 1.0], [2.0, 0.1]).unwrap();
        assert!((factor - 1.0).abs() < 1e-3 && added.abs() < 1e-3, "{factor} {added}");
    }

    #[test]
    fn single_precision_tells_the_same() {
        let piston = piston();
        for (double, single) in filled(&piston).iter().zip(filled::<f32>(&piston.cast())) {
            assert!((double.mean_pa() - f64::from(single.mean_pa())).abs() < 50.0);
            assert!((double.spread.touches - f64::from(single.spread.touches)).abs() < 1e-6);
        }
    }
}
