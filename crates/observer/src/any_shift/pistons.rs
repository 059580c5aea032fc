//! The piston of an element, which has to close the clearance of the plates, and what is not known of it.
//!
//! Where the piston is cannot be measured, and until it has closed the clearance the element carries nothing, whatever
//! the pressure at its valve. What follows is no small error about a mean: the element carries all or nothing. So nine
//! pistons of equal probability are carried by the law of [`drivetrain::Cylinder`]. They differ by two independent errors: of
//! the time that a fill takes (volume and passages), and of the pressure at the valve against that of the return spring,
//! on which a slow stroke at low pressure depends. From them follow the probability that the plates touch, mean
//! and deviation of what presses them, and how much of an error of it lasts from step to step.

use drivetrain::{Cylinder, Real};

use super::square;
use super::tables::Piston;

/// The nominal piston, one that fills late, one that fills early, one with more and one with less pressure.
const POINTS: usize = 9;
/// Deviations of the fill's time and of the pressure of each piston: the means of nine equal parts of a Gaussian, to
/// three digits, each once in both columns, which are not correlated. The first piston is the nominal one.
const AWAY: [[f64; 2]; POINTS] = [
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
/// With a variance of one.
const PARTS: [f64; 4] = [0.303, 0.633, 1.039, 1.712];
/// Step of the pistons, s \[chosen\]: about the lag of a filled cylinder with warm oil.
const STEP_S: f64 = 2.5e-3;
const MOST_STEPS: usize = 8;
/// Change of the pressure over a step of the filter below which a piston that is not on its stroke rests, Pa.
const RESTS_PA: f64 = 1.0;

/// One of the pistons.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Point<T> {
    /// Oil beyond that with the piston on its stop, m^3.
    volume_m3: T,
    /// Pressure in the cylinder less its error, Pa.
    pressure_pa: T,
    /// The same above the kiss point, where the plates touch; else zero.
    pressed_pa: T,
    touches: bool,
}

/// What presses the plates by the pistons, and the errors beside it, Pa.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Spread<T> {
    /// Probability that the plates touch.
    pub(super) touches: T,
    /// Standard deviation of what presses the plates by what is not known of the fill.
    pub(super) fill_pa: T,
    /// Standard deviation of it with that of the pressure, `moving_pa`, where the plates touch.
    pub(super) all_pa: T,
}

impl<T: Real> Spread<T> {
    fn of(points: &[Point<T>; POINTS], moving_pa: T) -> Self {
        let touches = mean(points, |point| if point.touches { T::one() } else { T::zero() });
        let fill = covariance(points, points).at_least(T::zero());
        Self { touches, fill_pa: fill.sqrt(), all_pa: (fill + square(touches * moving_pa)).sqrt() }
    }
}

/// The pistons of an element.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pistons<T> {
    points: [Point<T>; POINTS],
    pub(super) spread: Spread<T>,
    /// Correlation of the error of what presses the plates with that at the step before.
    pub(super) lasts: T,
    /// Deviation of the pressure at the last step, Pa.
    moving_pa: T,
}

impl<T: Real> Pistons<T> {
    /// With the valve at this pressure for ever. `error_pa` is the deviation of the pressure against the return spring.
    pub(super) fn settled(piston: &Piston<T>, valve_pa: T, error_pa: T, moving_pa: T) -> Self {
        let point = |k: usize| {
            let (cylinder, away_pa) = cylinder(piston, k, error_pa);
            Point::new(&cylinder, cylinder.volume((valve_pa + away_pa).at_least(T::zero())), away_pa)
        };
        let points = core::array::from_fn(point);
        Self { points, spread: Spread::of(&points, moving_pa), lasts: T::one(), moving_pa }
    }

    /// Carries the pistons over `dt_s`, in which the pressure of the valve goes from one to another value. Whether they rest then.
    pub(super) fn advance(&mut self, piston: &Piston<T>, [from_pa, to_pa]: [T; 2], error_pa: T, dt_s: T) -> bool {
        let steps = (dt_s / T::of(STEP_S)).ceil().whole().clamp(1, MOST_STEPS);
        let step_s = dt_s / T::of(steps as f64);
        let rise_pa = (to_pa - from_pa) / T::of(steps as f64);
        let mut rest = true;
        for (k, point) in self.points.iter_mut().enumerate() {
            let (cylinder, away_pa) = cylinder(piston, k, error_pa);
            let before_pa = point.pressure_pa;
            let (mut volume_m3, mut valve_pa) = (point.volume_m3, from_pa + away_pa);
            for _ in 0..steps {
                valve_pa = valve_pa + rise_pa;
                volume_m3 = cylinder.carried(volume_m3, valve_pa.at_least(T::zero()), step_s);
            }
            *point = Point::new(&cylinder, volume_m3, away_pa);
            let on_stroke = volume_m3 > T::zero() && !point.touches;
            rest = rest && !on_stroke && (point.pressure_pa - before_pa).abs() <= T::of(RESTS_PA);
        }
        rest
    }

    /// What follows at the end of a step that began with these pistons, with this deviation of the pressure.
    pub(super) fn conclude(&mut self, before: &Self, moving_pa: T) {
        self.spread = Spread::of(&self.points, moving_pa);
        let (now, then) = (&self.spread, &before.spread);
        let by_pressure = now.touches * moving_pa * then.touches * before.moving_pa;
        let both = now.all_pa * then.all_pa;
        let lasts = (covariance(&self.points, &before.points) + by_pressure) / both;
        self.lasts = if both > T::zero() { lasts.at_least(T::zero()).at_most(T::one()) } else { T::zero() };
        self.moving_pa = moving_pa;
    }

    /// Nothing moves in this step.
    pub(super) fn rest(&mut self) {
        self.lasts = T::one();
    }

    /// Pressure of the nominal cylinder, Pa.
    pub(super) fn nominal_pa(&self) -> T {
        self.points[0].pressure_pa
    }

    /// Mean of the pressure, Pa.
    pub(super) fn mean_pa(&self) -> T {
        mean(&self.points, |point| point.pressure_pa)
    }

    /// What presses the plates if they touch: the mean of `pressed`, which gives it and its derivative from the pressure
    /// in the cylinder, and the largest.
    pub(super) fn pressed(&self, pressed: impl Fn(T) -> (T, T)) -> ([T; 2], T) {
        let (mut sum, mut most) = ([T::zero(); 2], T::zero());
        for point in self.points.iter().filter(|point| point.touches) {
            let (value, slope) = pressed(point.pressure_pa);
            sum = [sum[0] + value, sum[1] + slope];
            most = most.at_least(value);
        }
        (sum.map(|sum| sum / T::of(POINTS as f64)), most)
    }
}

impl<T: Real> Point<T> {
    fn new(cylinder: &Cylinder<T>, volume_m3: T, away_pa: T) -> Self {
        let touches = volume_m3 >= cylinder.stroke_m3;
        let in_cylinder_pa = cylinder.pressure(volume_m3);
        let on_stroke = volume_m3 > T::zero() && !touches;
        // On the stroke the return spring alone makes the pressure.
        let pressure_pa = if on_stroke { in_cylinder_pa } else { (in_cylinder_pa - away_pa).at_least(T::zero()) };
        let pressed_pa = if touches { (pressure_pa - cylinder.kiss_pa).at_least(T::zero()) } else { T::zero() };
        Self { volume_m3, pressure_pa, pressed_pa, touches }
    }
}

/// The cylinder of a point, and the error of its pressure, Pa. A fill that is longer by a share has a longer stroke by it.
fn cylinder<T: Real>(piston: &Piston<T>, k: usize, error_pa: T) -> (Cylinder<T>, T) {
    let [late, more] = AWAY.get(k).copied().unwrap_or_default();
    let longer = T::one() + T::of(late.abs()) * piston.fill_share;
    let factor = if late < 0.0 { longer.recip() } else { longer };
    (Cylinder { stroke_m3: factor * piston.cylinder.stroke_m3, ..piston.cylinder }, T::of(more) * error_pa)
}

fn mean<T: Real>(points: &[Point<T>; POINTS], of: impl Fn(&Point<T>) -> T) -> T {
    points.iter().fold(T::zero(), |sum, point| sum + of(point)) / T::of(POINTS as f64)
}

/// Covariance of what presses the plates at two times, Pa^2.
fn covariance<T: Real>(now: &[Point<T>; POINTS], then: &[Point<T>; POINTS]) -> T {
    let [mean_now, mean_then] = [now, then].map(|points| mean(points, |point| point.pressed_pa));
    let products = now.iter().zip(then).map(|(now, then)| (now.pressed_pa - mean_now) * (then.pressed_pa - mean_then));
    products.fold(T::zero(), |sum, product| sum + product) / T::of(POINTS as f64)
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use drivetrain::{Clutch, Table1};
    use std::vec::Vec;

    const FILL_SHARE: f64 = 0.16;
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
        Piston { cylinder: Cylinder::of_clutch(&clutch), fill_share: FILL_SHARE }
    }

    /// A pulse, a hold just above the kiss point, and a ramp, Pa.
    fn valve_pa(time_s: f64) -> f64 {
        match time_s {
            t if t < 0.12 => 0.21e6,
            t if t < 0.4 => 0.075e6,
            t => 0.075e6 + 0.5e6 * (t - 0.4),
        }
    }

    /// The pistons in the steps of that fill.
    fn filled<T: Real>(piston: &Piston<T>) -> Vec<Pistons<T>> {
        let of = |x: f64| T::of(x);
        let mut pistons = Pistons::settled(piston, T::zero(), of(ERROR_PA), of(7e3));
        (0..80)
            .map(|k| {
                let before = pistons;
                let ends = [k, k + 1].map(|k| of(valve_pa(0.01 * f64::from(k) - 1e-9)));
                pistons.advance(piston, ends, of(ERROR_PA), of(0.01));
                pistons.conclude(&before, of(7e3));
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

    /// Errors between their bounds, each as likely as the others, in their deviations.
    fn uniform_errors() -> Vec<[f64; 2]> {
        let of = |k: i32| 3.0_f64.sqrt() * f64::from(k) / 10.5;
        (-10..=10).flat_map(|late| (-10..=10).map(move |more| [of(late), of(more)])).collect()
    }

    /// By how much the share of nine pistons differs at most from that of all errors, on one side of any line through both.
    fn largest_error_of_a_share(all: &[[f64; 2]]) -> f64 {
        let mut most = 0.0_f64;
        for degrees in 0..180 {
            let (b, a) = f64::from(degrees).to_radians().sin_cos();
            let below = |of: &[[f64; 2]], line: f64| {
                of.iter().filter(|[late, more]| a * late + b * more < line).count() as f64 / of.len() as f64
            };
            for line in AWAY.iter().flat_map(|[late, more]| [-1e-9, 1e-9].map(|side| a * late + b * more + side)) {
                most = most.max((below(&AWAY, line) - below(all, line)).abs());
            }
        }
        most
    }

    /// Of pistons with other errors of the same deviations so many touch as nine can tell.
    #[test]
    fn as_many_pistons_touch_as_is_said() {
        let (piston, all) = (piston(), uniform_errors());
        let bound = largest_error_of_a_share(&all);
        assert!(bound < 0.18, "nine: {bound}");
        let mut touching = [0.0; 80];
        for [late, more] in &all {
            let cylinder =
                Cylinder { stroke_m3: (1.0 + FILL_SHARE * late) * piston.cylinder.stroke_m3, ..piston.cylinder };
            let mut volume = 0.0;
            for (k, touching) in touching.iter_mut().enumerate() {
                for part in 1..=10 {
                    let time_s = 0.01 * k as f64 + 1e-3 * f64::from(part) - 1e-9;
                    volume = cylinder.carried(volume, (valve_pa(time_s) + ERROR_PA * more).max(0.0), 1e-3);
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
        assert_eq!((empty.touches, empty.fill_pa, empty.all_pa), (0.0, 0.0, 0.0));
        assert!(filling.fill_pa > 3e3, "{filling:?}");
        assert!(full.touches > 0.999 && full.fill_pa < 500.0 && (full.all_pa - 7e3).abs() < 50.0, "{full:?}");
        // Each piston that touches more makes it another, and at the end all of it lasts.
        assert!(steps.iter().all(|step| (0.0..=1.0).contains(&step.lasts)));
        assert!(steps[8..30].iter().any(|step| step.lasts < 0.9) && steps[79].lasts > 0.999);
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
