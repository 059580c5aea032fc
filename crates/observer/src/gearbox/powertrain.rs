//! What the powertrain does over one step, for any shift.
//!
//! ```text
//! (w_t', w_o') = G (X, Y)         X = (1 + b + c) T_t - m M11 w_t' - U_off - U_on - D_t,   Y = -T_o + i_off U_off + i_on U_on - D_o
//! T_o = (T_s + C_s (w_o/i_df - w_w + r))/i_df
//! w_w' = (i_df T_o - T_L)/J       T_s' = K_s (w_o/i_df - w_w + r)
//! ```
//!
//! `D_t` and `D_o` are the drag of all plates that slip or are open, each times its slip per turbine and output speed.
//!
//! `G` is the inverse of the mass while no clutch holds; while one holds with the ratio `i`, the torques of turbine and
//! output act on one inertia, and the torque of that clutch is left out.

use drivetrain::{Driveline, Real};

use super::covariance::Gaussian;
use super::timing::ByTiming;
use super::{
    FRACTION, FRICTION, INERTIA, KISS, LOAD, N, OUTPUT, PRESSURE, RATE, SLOW_FRACTION, SPEEDS, SPRING, TURBINE, WHEEL,
};

/// States with a law of their own.
pub(super) const CORE: usize = 4;
/// What drives them: torque on the turbine side, on the output side, load at the wheels, rate error of the twist.
const DRIVES: usize = 4;
const LOAD_DRIVES: usize = 2;
const RATE_DRIVES: usize = 3;
/// Terms of the series for the swing of the shafts: a step is at most [`super::PIECE_S`] long, which is less than a quarter of the
/// fastest one, so the terms left out are below 1e-9.
const TERMS: usize = 16;

/// Accelerations of turbine and output per torque on either side, rad/s^2 per N m.
pub(super) type Response<T> = [[T; 2]; 2];

/// The response while no clutch holds.
pub(super) fn free<T: Real>(mass: &[[T; 2]; 2]) -> Response<T> {
    let [[a, b], [c, d]] = *mass;
    let per = (a * d - b * c).recip();
    [[d * per, -b * per], [-c * per, a * per]]
}

/// The response while one clutch ties both speeds with a ratio; the inertia is that at the output.
pub(super) fn tied<T: Real>(ratio: T, inertia_kg_m2: T) -> Response<T> {
    let per = inertia_kg_m2.recip();
    [[ratio * ratio * per, ratio * per], [ratio * per, per]]
}

/// Torque of a shift clutch at the turbine: `U = base + f per_friction + k per_kiss + x per_pressure`, N m.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct ClutchTorque<T> {
    pub(super) ratio: T,
    pub(super) base_n_m: T,
    pub(super) per_friction_n_m: T,
    pub(super) per_kiss_n_m: T,
    pub(super) per_pressure_n_m: T,
    /// Pressure by a lag and a delay that are longer by one standard deviation, in standard deviations of the pressure's error.
    pub(super) by_timing: [T; 2],
    /// By the valve model and the budget's friction and kiss point alone, of full size also where the direction is uncertain.
    pub(super) open_loop_n_m: T,
}

impl<T: Real> ClutchTorque<T> {
    pub(super) fn none() -> Self {
        let zero = T::zero();
        Self {
            ratio: zero,
            base_n_m: zero,
            per_friction_n_m: zero,
            per_kiss_n_m: zero,
            per_pressure_n_m: zero,
            by_timing: [zero; 2],
            open_loop_n_m: zero,
        }
    }

    /// Variance of the torque with nothing learnt, with the correlation of torque factor and kiss point.
    pub(super) fn unlearnt_variance(&self, correlation: T) -> T {
        let square = |x: T| x * x;
        let both = self.per_friction_n_m * self.per_kiss_n_m * correlation;
        square(self.per_friction_n_m) + both + both + square(self.per_kiss_n_m) + square(self.per_pressure_n_m)
    }

    fn mean(&self, other: &Self) -> Self {
        let half = T::of(0.5);
        let [lag, delay] = self.by_timing;
        Self {
            by_timing: [half * (lag + other.by_timing[0]), half * (delay + other.by_timing[1])],
            ratio: self.ratio,
            base_n_m: half * (self.base_n_m + other.base_n_m),
            per_friction_n_m: half * (self.per_friction_n_m + other.per_friction_n_m),
            per_kiss_n_m: half * (self.per_kiss_n_m + other.per_kiss_n_m),
            per_pressure_n_m: half * (self.per_pressure_n_m + other.per_pressure_n_m),
            open_loop_n_m: half * (self.open_loop_n_m + other.open_loop_n_m),
        }
    }
}

/// Torques that act at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Torques<T> {
    /// Turbine torque by its sources, N m.
    pub(super) turbine_n_m: T,
    /// The same low-passed: what the fraction `b` multiplies. With the raw one the noise of the speeds would be in reading
    /// and factor, which pulls the fraction to one side.
    pub(super) fraction_n_m: T,
    /// The same times the standard deviation of the part of its error that lasts.
    pub(super) slow_fraction_n_m: T,
    /// On the turbine and on the output side, by the drag of the plates that slip or are open.
    pub(super) drag_n_m: [T; 2],
    /// `M11 w_t'` times the standard deviation of `M11`.
    pub(super) inertia_n_m: T,
    pub(super) clutches: [ClutchTorque<T>; 2],
}

impl<T: Real> Torques<T> {
    /// The mean of those at two times.
    pub(super) fn mean(&self, other: &Self) -> Self {
        let half = T::of(0.5);
        Self {
            turbine_n_m: half * (self.turbine_n_m + other.turbine_n_m),
            fraction_n_m: half * (self.fraction_n_m + other.fraction_n_m),
            slow_fraction_n_m: half * (self.slow_fraction_n_m + other.slow_fraction_n_m),
            drag_n_m: [0, 1].map(|side| half * (self.drag_n_m[side] + other.drag_n_m[side])),
            inertia_n_m: half * (self.inertia_n_m + other.inertia_n_m),
            clutches: [self.clutches[0].mean(&other.clutches[0]), self.clutches[1].mean(&other.clutches[1])],
        }
    }

    /// Pressure of both clutches by their timing.
    pub(super) fn by_timing(&self) -> ByTiming<T> {
        self.clutches.each_ref().map(|clutch| clutch.by_timing)
    }

    /// Without the torque of a clutch that holds.
    pub(super) fn without(mut self, holding: Option<usize>) -> Self {
        for (c, clutch) in self.clutches.iter_mut().enumerate() {
            if holding == Some(c) {
                *clutch = ClutchTorque { ratio: clutch.ratio, ..ClutchTorque::none() };
            }
        }
        self
    }

    /// A quantity that depends on the torques on either side by `per`, as a row over the states that these torques depend
    /// on, and what is left beside them.
    pub(super) fn row(&self, per: [T; 2]) -> ([T; N], T) {
        let mut row = [T::zero(); N];
        let mut rest = per[0] * (self.turbine_n_m + self.drag_n_m[0]) + per[1] * self.drag_n_m[1];
        row[FRACTION] = per[0] * self.fraction_n_m;
        row[SLOW_FRACTION] = per[0] * self.slow_fraction_n_m;
        row[INERTIA] = -per[0] * self.inertia_n_m;
        for (c, clutch) in self.clutches.iter().enumerate() {
            let per_clutch = clutch.ratio * per[1] - per[0];
            rest = rest + per_clutch * clutch.base_n_m;
            row[FRICTION[c]] = per_clutch * clutch.per_friction_n_m;
            row[KISS[c]] = per_clutch * clutch.per_kiss_n_m;
            row[PRESSURE[c]] = per_clutch * clutch.per_pressure_n_m;
        }
        (row, rest)
    }
}

/// The equations of the first states: `x' = A x + B d`, with what drives them `d`.
struct Equations<T> {
    a: [[T; CORE]; CORE],
    b: [[T; DRIVES]; CORE],
}

impl<T: Real> Equations<T> {
    fn new(g: &Response<T>, line: &Driveline<T>, wheels_kg_m2: T) -> Self {
        let zero = T::zero();
        let (i, damping, stiffness) = (line.final_ratio, line.shaft_damping_n_m_s_rad, line.shaft_stiffness_n_m_rad);
        let mut equations = Self { a: [[zero; CORE]; CORE], b: [[zero; DRIVES]; CORE] };
        let Self { a, b } = &mut equations;
        for k in [TURBINE, OUTPUT] {
            let per_shaft_torque = -g[k][1] / i;
            a[k][SPRING] = per_shaft_torque;
            a[k][OUTPUT] = per_shaft_torque * damping / i;
            a[k][WHEEL] = -per_shaft_torque * damping;
            b[k] = [g[k][0], g[k][1], zero, per_shaft_torque * damping];
        }
        let per_wheel_torque = wheels_kg_m2.recip();
        a[WHEEL][SPRING] = per_wheel_torque;
        a[WHEEL][OUTPUT] = per_wheel_torque * damping / i;
        a[WHEEL][WHEEL] = -per_wheel_torque * damping;
        b[WHEEL] = [zero, zero, -per_wheel_torque, per_wheel_torque * damping];
        a[SPRING][OUTPUT] = stiffness / i;
        a[SPRING][WHEEL] = -stiffness;
        b[SPRING][RATE_DRIVES] = stiffness;
        equations
    }
}

/// The row over all states of something that depends on the first of them and on what drives them, and what is left beside it.
fn row<T: Real>(of: &[T; CORE], drives: &[T; DRIVES], torques: &Torques<T>) -> ([T; N], T) {
    let (mut row, rest) = torques.row([drives[0], drives[1]]);
    row[..CORE].copy_from_slice(of);
    row[LOAD] = drives[LOAD_DRIVES];
    row[RATE] = drives[RATE_DRIVES];
    (row, rest)
}

/// Rates of turbine, output and wheel speed as rows over the states, and what is left beside them, rad/s^2.
pub(super) struct Rates<T> {
    pub(super) rows: [[T; N]; SPEEDS],
    pub(super) rest: [T; SPEEDS],
}

impl<T: Real> Rates<T> {
    pub(super) fn new(g: &Response<T>, torques: &Torques<T>, line: &Driveline<T>, wheels_kg_m2: T) -> Self {
        let equations = Equations::new(g, line, wheels_kg_m2);
        let mut rates = Self { rows: [[T::zero(); N]; SPEEDS], rest: [T::zero(); SPEEDS] };
        for k in 0..SPEEDS {
            (rates.rows[k], rates.rest[k]) = row(&equations.a[k], &equations.b[k], torques);
        }
        rates
    }

    /// One of the rates at the mean of the states, rad/s^2.
    #[inline]
    pub(super) fn of(&self, k: usize, x: &Gaussian<T>) -> T {
        let k = k.min(SPEEDS - 1);
        x.value(&self.rows[k]) + self.rest[k]
    }
}

/// The rate of the output speed as a row over the states, and what is left beside it, rad/s^2.
pub(super) fn output_rate<T: Real>(
    g: &Response<T>,
    torques: &Torques<T>,
    line: &Driveline<T>,
    wheels_kg_m2: T,
) -> ([T; N], T) {
    let equations = Equations::new(g, line, wheels_kg_m2);
    row(&equations.a[OUTPUT], &equations.b[OUTPUT], torques)
}

/// The sum of the products of two rows.
#[inline]
pub(super) fn dot<T: Real, const L: usize>(a: &[T; L], b: &[T; L]) -> T {
    a.iter().zip(b).fold(T::zero(), |sum, (a, b)| sum + *a * *b)
}

/// The swing of the drive shafts over one step.
///
/// The torque of the shafts `q = T_s + C_s v`, with the rate of their twist `v = w_o/i_df - w_w + r`, is all that ties the states to each
/// other: `T_s' = K_s v`, `v' = m q + d`. So `T_s` and `v` are two states by themselves, and the exponential of their matrix is
/// `a I + b M` with `b'' = m C_s b' + m K_s b`, `b(0) = 0`, `b'(0) = 1` (Cayley and Hamilton).
struct Swing<T> {
    /// `b` at the end of the step, its integral over the step, and the integral of that.
    b: T,
    integral: T,
    twice: T,
}

impl<T: Real> Swing<T> {
    /// By the series of `b`; `m` is the change of `v'` per torque of the shafts, 1/(kg m^2).
    fn new(line: &Driveline<T>, m: T, dt_s: T) -> Self {
        let damped = m * line.shaft_damping_n_m_s_rad * dt_s;
        let sprung = m * line.shaft_stiffness_n_m_rad * dt_s * dt_s;
        let (mut before, mut term) = (T::zero(), T::one());
        let mut sums = [T::zero(); 3];
        // 1/n!, 1/(n+1)!, 1/(n+2)!, and n + 2.
        let (mut per, mut last) = ([T::one(), T::of(1.0 / 2.0), T::of(1.0 / 6.0)], T::of(3.0));
        for _ in 0..TERMS {
            for (sum, per) in sums.iter_mut().zip(&per) {
                *sum = *sum + term * *per;
            }
            (before, term) = (term, damped * term + sprung * before);
            last = last + T::one();
            per = [per[1], per[2], per[2] / last];
        }
        let [b, integral, twice] = sums;
        Self { b: dt_s * b, integral: dt_s * dt_s * integral, twice: dt_s * dt_s * dt_s * twice }
    }
}

/// The solution over one step under constant torques.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Motion<T> {
    /// The response and the step that it was made for, s.
    pub(super) of: (Response<T>, T),
    phi: [[T; CORE]; CORE],
    /// Its integral times what drives the states.
    gamma: [[T; DRIVES]; CORE],
    /// What is left after the step of errors that fade: of turbine torque and pressure.
    pub(super) stay: [T; 2],
}

impl<T: Real> Motion<T> {
    /// Exact but for the end of the series of [`Swing`].
    pub(super) fn new(g: Response<T>, line: &Driveline<T>, wheels_kg_m2: T, dt_s: T, fading_s: [T; 2]) -> Self {
        let (zero, one) = (T::zero(), T::one());
        let (i, damping, stiffness) = (line.final_ratio, line.shaft_damping_n_m_s_rad, line.shaft_stiffness_n_m_rad);
        let per_wheel_torque = wheels_kg_m2.recip();
        // Rates of the speeds per torque of the shafts, and of the rate of their twist per torque and load.
        let per_shaft_torque = [-g[TURBINE][1] / i, -g[OUTPUT][1] / i, per_wheel_torque];
        let m = per_shaft_torque[OUTPUT] / i - per_shaft_torque[WHEEL];
        let Swing { b, integral, twice } = Swing::new(line, m, dt_s);
        let twist = [g[OUTPUT][0] / i, g[OUTPUT][1] / i, per_wheel_torque];
        // The integral of the torque of the shafts per rate of twist at the beginning, and per what drives that rate.
        let (by_rate, by_drive) = (stiffness * integral + damping * b, stiffness * twice + damping * integral);
        let (mut phi, mut gamma) = ([[zero; CORE]; CORE], [[zero; DRIVES]; CORE]);
        for (k, per) in per_shaft_torque.into_iter().enumerate() {
            phi[k][k] = one;
            phi[k][OUTPUT] = phi[k][OUTPUT] + per * by_rate / i;
            phi[k][WHEEL] = phi[k][WHEEL] - per * by_rate;
            phi[k][SPRING] = per * b;
            let own = if k == WHEEL { [zero, zero, -per_wheel_torque] } else { [g[k][0], g[k][1], zero] };
            for ((gamma, own), twist) in gamma[k].iter_mut().zip(own).zip(twist) {
                *gamma = dt_s * own + per * by_drive * twist;
            }
            gamma[k][RATE_DRIVES] = per * by_rate;
        }
        let per_rate = stiffness * b;
        phi[SPRING] = [zero, per_rate / i, -per_rate, one + m * stiffness * integral];
        for (gamma, twist) in gamma[SPRING].iter_mut().zip(twist) {
            *gamma = stiffness * integral * twist;
        }
        gamma[SPRING][RATE_DRIVES] = per_rate;
        Self { of: (g, dt_s), phi, gamma, stay: fading_s.map(|time_s| (-dt_s / time_s).exp()) }
    }

    /// The first states at the end as rows over all states, and what is left beside them.
    pub(super) fn rows(&self, torques: &Torques<T>) -> ([[T; N]; CORE], [T; CORE]) {
        let mut rows = [[T::zero(); N]; CORE];
        let mut rest = [T::zero(); CORE];
        for k in 0..CORE {
            (rows[k], rest[k]) = row(&self.phi[k], &self.gamma[k], torques);
        }
        (rows, rest)
    }

    /// Change of the first states per torque on the turbine side, each per N m.
    pub(super) fn per_turbine_torque(&self) -> [T; CORE] {
        self.gamma.map(|row| row[0])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gearbox::PIECE_S;

    const LINE: Driveline<f64> = Driveline {
        final_ratio: 3.0,
        shaft_stiffness_n_m_rad: 13_000.0,
        shaft_damping_n_m_s_rad: 20.0,
        wheel_inertia_kg_m2: 2.4,
    };
    const WHEELS_KG_M2: f64 = 137.4;
    const MASS: [[f64; 2]; 2] = [[0.08, 0.009], [0.009, 0.289]];

    fn torques() -> Torques<f64> {
        let clutch = |ratio, base_n_m| ClutchTorque {
            ratio,
            base_n_m,
            per_friction_n_m: 0.12 * base_n_m,
            per_kiss_n_m: -2.0,
            per_pressure_n_m: 3.0,
            by_timing: [0.0; 2],
            open_loop_n_m: base_n_m,
        };
        let (slow_fraction_n_m, inertia_n_m) = (6.0, -3.0);
        Torques {
            turbine_n_m: 120.0,
            fraction_n_m: 115.0,
            slow_fraction_n_m,
            drag_n_m: [0.0; 2],
            inertia_n_m,
            clutches: [clutch(4.7, -20.0), clutch(3.13, 90.0)],
        }
    }

    fn state() -> [f64; N] {
        [300.0, 70.0, 23.2, 900.0, 700.0, 0.05, 0.01, -0.04, 0.4, 0.5, -0.7, 0.2, -0.3, 0.3, 1.1, 0.6]
    }

    /// A step as a whole is what many small ones by the rates are.
    #[test]
    fn a_step_is_the_solution_of_the_rates() {
        for g in [free(&MASS), tied(4.7, MASS[1][1] + 2.0 * 4.7 * MASS[0][1] + 4.7 * 4.7 * MASS[0][0])] {
            let torques = torques();
            let (rows, rest) = Motion::new(g, &LINE, WHEELS_KG_M2, 0.01, [1.0; 2]).rows(&torques);
            let rates = Rates::new(&g, &torques, &LINE, WHEELS_KG_M2);
            let mut x = Gaussian::of(state(), [0.0; N]);
            for _ in 0..100_000 {
                let speeds: [f64; SPEEDS] = core::array::from_fn(|k| rates.of(k, &x));
                let x = &mut x.mean;
                let twist = x[OUTPUT] / LINE.final_ratio - x[WHEEL] + x[RATE];
                for k in 0..SPEEDS {
                    x[k] += 1e-7 * speeds[k];
                }
                x[SPRING] += 1e-7 * LINE.shaft_stiffness_n_m_rad * twist;
            }
            for k in 0..CORE {
                let whole = dot(&rows[k], &state()) + rest[k];
                let small = x.mean[k];
                assert!((whole - small).abs() < 2e-4 * (1.0 + small.abs()), "{k}: {whole} {small}");
            }
        }
    }

    #[test]
    fn a_step_is_two_of_half_its_length() {
        for (stiffness, damping) in [(13_000.0, 20.0), (13_000.0, 0.0), (6_000.0, 150.0), (40_000.0, 20.0)] {
            let line = Driveline { shaft_stiffness_n_m_rad: stiffness, shaft_damping_n_m_s_rad: damping, ..LINE };
            for g in [free(&MASS), tied(1.0, MASS[1][1] + 2.0 * MASS[0][1] + MASS[0][0])] {
                let motion = |dt_s: f64| Motion::new(g, &line, WHEELS_KG_M2, dt_s, [1.0; 2]);
                let (whole, half) = (motion(PIECE_S), motion(0.5 * PIECE_S));
                for (k, row) in half.phi.iter().enumerate() {
                    let near = |one: f64, other: f64| (one - other).abs() <= 1e-9 * (1.0 + one.abs());
                    for j in 0..CORE {
                        let twice: f64 = (0..CORE).map(|l| row[l] * half.phi[l][j]).sum();
                        assert!(near(whole.phi[k][j], twice), "{stiffness} {k} {j}: {} {twice}", whole.phi[k][j]);
                        let driven: f64 = (0..CORE).map(|l| row[l] * half.gamma[l][j]).sum();
                        let twice = driven + half.gamma[k][j];
                        assert!(near(whole.gamma[k][j], twice), "{stiffness} {k} {j}: {} {twice}", whole.gamma[k][j]);
                    }
                }
            }
        }
    }

    #[test]
    fn tied_speeds_accelerate_in_their_ratio() {
        let g = tied(2.5_f64, 0.7);
        assert!((g[0][0] - 2.5 * g[1][0]).abs() < 1e-12 && (g[0][1] - 2.5 * g[1][1]).abs() < 1e-12);
        // Turbine torque times ratio on the inertia at the output.
        assert!((g[1][0] - 2.5 / 0.7).abs() < 1e-12 && (g[1][1] - 1.0 / 0.7).abs() < 1e-12);
    }

    #[test]
    fn power_is_conserved_while_both_slip() {
        let (torques, g) = (torques(), free(&MASS));
        let rates = Rates::new(&g, &torques, &LINE, WHEELS_KG_M2);
        let states = Gaussian::of(state(), [0.0; N]);
        let [turbine, output, wheel] = [TURBINE, OUTPUT, WHEEL].map(|k| rates.of(k, &states));
        let x = states.mean;
        let kinetic = x[TURBINE] * (MASS[0][0] * turbine + MASS[0][1] * output)
            + x[OUTPUT] * (MASS[1][0] * turbine + MASS[1][1] * output);
        let shaft = x[SPRING] + LINE.shaft_damping_n_m_s_rad * (x[OUTPUT] / LINE.final_ratio - x[WHEEL] + x[RATE]);
        let input =
            torques.turbine_n_m + x[FRACTION] * torques.fraction_n_m + x[SLOW_FRACTION] * torques.slow_fraction_n_m;
        let input = (input - x[INERTIA] * torques.inertia_n_m) * x[TURBINE];
        let heat: f64 = (0..2)
            .map(|c| {
                let clutch = &torques.clutches[c];
                let torque = clutch.base_n_m
                    + x[FRICTION[c]] * clutch.per_friction_n_m
                    + x[KISS[c]] * clutch.per_kiss_n_m
                    + x[PRESSURE[c]] * clutch.per_pressure_n_m;
                torque * (x[TURBINE] - clutch.ratio * x[OUTPUT])
            })
            .sum();
        assert!((input - shaft / LINE.final_ratio * x[OUTPUT] - heat - kinetic).abs() < 1e-6);
        assert!((shaft - x[LOAD] - WHEELS_KG_M2 * wheel).abs() < 1e-6);
    }
}
