//! What the powertrain does over one interval, as the extended filter knows it: mean, derivative, covariance.

use drivetrain::{AccelerationRow, Real};

use super::{FRACTION, N, OFFGOING, OUTPUT, PRESSURE, SPRING, TURBINE};
use crate::Interval;

/// What the powertrain does over one interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Passage<T> {
    pub(super) interval: Interval<T>,
    /// Of turbine and output.
    pub(super) rows: [AccelerationRow<T>; 2],
    /// Acceleration of turbine and output per shaft torque.
    pub(super) shaft: [T; 2],
    pub(super) turbine_n_m: T,
    /// Clutch torque per pressure above the kiss point.
    pub(super) per_pressure: T,
    pub(super) kiss_pa: T,
    pub(super) wheel_rad_s: T,
    pub(super) h: T,
    pub(super) u: T,
    pub(super) turn: T,
    pub(super) twist: T,
    /// Solves the output speed at the end, on which the shaft torque depends.
    pub(super) solve: T,
    pub(super) stay: T,
    pub(super) keep: T,
    pub(super) released: bool,
    pub(super) shifting: bool,
}

impl<T: Real> Passage<T> {
    /// Mean pressure over the interval above the kiss point, Pa; none below it.
    #[inline]
    pub(crate) fn above_kiss(&self, pressure_pa: T) -> T {
        (self.interval.pressure_integral(pressure_pa) / self.interval.dt_s - self.kiss_pa).at_least(T::zero())
    }

    /// Pressure above the kiss point and its derivative by the pressure at the start, at the mean.
    #[inline]
    pub(super) fn tangent(&self, pressure_pa: T) -> (T, T) {
        let above = self.above_kiss(pressure_pa);
        (above, if above > T::zero() { self.interval.valve.psi / self.interval.dt_s } else { T::zero() })
    }

    /// The states at the end, with this mean pressure above the kiss point.
    #[inline]
    pub(crate) fn propagate(&self, x: &[T; N], above_kiss_pa: T) -> [T; N] {
        let dt = self.interval.dt_s;
        let oncoming = self.per_pressure * above_kiss_pa;
        let free = |row: &AccelerationRow<T>| {
            row.per_turbine_torque * self.turbine_n_m * (T::one() + x[FRACTION])
                + row.per_oncoming_torque * oncoming
                + row.per_offgoing_torque * x[OFFGOING]
        };
        let [shaft_t, shaft_o] = self.shaft;
        let held = x[SPRING] - self.u * self.wheel_rad_s;
        let output = self.solve
            * ((T::one() + dt * shaft_o * self.h) * x[OUTPUT] + dt * free(&self.rows[1]) + dt * shaft_o * held);
        let shaft = held + self.h * (x[OUTPUT] + output);
        [
            x[TURBINE] + dt * (free(&self.rows[0]) + shaft_t * shaft),
            output,
            x[SPRING] + self.turn * (x[OUTPUT] + output) - self.twist * self.wheel_rad_s,
            self.interval.pressure(x[PRESSURE]),
            self.stay * x[FRACTION],
            self.keep * x[OFFGOING],
        ]
    }

    /// Derivatives of the first three states at the end by all states; the others depend on themselves alone. `slope`
    /// is that of the mean pressure above the kiss point.
    #[inline]
    pub(super) fn derivative(&self, slope: T) -> [[T; N]; 3] {
        let (zero, one, dt) = (T::zero(), T::one(), self.interval.dt_s);
        let per_pressure = self.per_pressure * slope;
        let by = |row: &AccelerationRow<T>| {
            [row.per_oncoming_torque * per_pressure, row.per_turbine_torque * self.turbine_n_m, row.per_offgoing_torque]
        };
        let [shaft_t, shaft_o] = self.shaft;
        let mut f = [[zero; N]; 3];
        f[OUTPUT][OUTPUT] = self.solve * (one + dt * shaft_o * self.h);
        f[OUTPUT][SPRING] = self.solve * dt * shaft_o;
        for (k, by) in by(&self.rows[1]).into_iter().enumerate() {
            f[OUTPUT][PRESSURE + k] = self.solve * dt * by;
        }
        f[SPRING] = f[OUTPUT].map(|x| self.turn * x);
        f[TURBINE] = f[OUTPUT].map(|x| dt * shaft_t * self.h * x);
        f[SPRING][OUTPUT] = f[SPRING][OUTPUT] + self.turn;
        f[SPRING][SPRING] = f[SPRING][SPRING] + one;
        f[TURBINE][TURBINE] = one;
        f[TURBINE][OUTPUT] = f[TURBINE][OUTPUT] + dt * shaft_t * self.h;
        f[TURBINE][SPRING] = f[TURBINE][SPRING] + dt * shaft_t;
        for (k, by) in by(&self.rows[0]).into_iter().enumerate() {
            f[TURBINE][PRESSURE + k] = f[TURBINE][PRESSURE + k] + dt * by;
        }
        f
    }
}

/// `P = F P F'`, where `F` has three full rows, of which only the first has the turbine speed, and three of the
/// diagonal alone. Returns the first two columns of `F P`.
#[inline]
pub(super) fn spread<T: Real>(p: &mut [[T; N]; N], f: &[[T; N]; 3], diagonal: &[T; 3]) -> [[T; 2]; N] {
    let mut fp = [[T::zero(); N]; N];
    for (i, row) in f.iter().enumerate() {
        let first = if i == TURBINE { TURBINE } else { OUTPUT };
        for (weight, p) in row.iter().zip(p.iter()).skip(first) {
            for (sum, p) in fp[i].iter_mut().zip(p) {
                *sum = *sum + *weight * *p;
            }
        }
    }
    for i in 3..N {
        fp[i] = p[i].map(|p| diagonal[i - 3] * p);
    }
    for i in 0..N {
        for j in i..N {
            let value = if j < 3 {
                fp[i].iter().zip(&f[j]).fold(T::zero(), |sum, (a, b)| sum + *a * *b)
            } else {
                fp[i][j] * diagonal[j - 3]
            };
            p[i][j] = value;
            p[j][i] = value;
        }
    }
    fp.map(|row| [row[TURBINE], row[OUTPUT]])
}
