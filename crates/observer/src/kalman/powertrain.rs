//! What the powertrain does over one step, as the filter knows it: mean and Jacobian.

use drivetrain::{AccelerationRow, Real, ValveStep};

use super::{DELAY, FRICTION, GAIN, LOAD, N, OFFGOING, OUTPUT, PRESSURE, SHARE, SPRING, TURBINE, WHEEL};

/// Number of the states that have a law of their own; the others stand or fade.
pub(super) const LAWS: usize = 5;
/// The states that these laws depend on are the first ones.
pub(super) const COLUMNS: usize = GAIN + 1;
const _: () = assert!(TURBINE < LAWS && OUTPUT < LAWS && WHEEL < LAWS && SPRING < LAWS && PRESSURE < LAWS);
const _: () =
    assert!(SHARE < COLUMNS && OFFGOING < COLUMNS && LOAD < COLUMNS && FRICTION < COLUMNS && DELAY >= COLUMNS);

/// One step of the powertrain with frozen coefficients.
///
/// ```text
/// a     = w_w + dt/(2 J) (T_k + C_s (w_0/i - w_w) - T_L)           wheel speed at the middle of the step
/// T_k+  = T_k + K_s dt ((w_0 + w_0+)/(2 i) - a)                    T_s = T_k + (K_s dt/2 + C_s) ((w_0 + w_0+)/(2 i) - a)
/// w_0+  = w_0 + dt (free_o + c_o T_s)                              implicit in w_0+
/// w_t+  = w_t + dt (free_t + c_t T_s)                              w_w+ = w_w + dt/J (T_s - T_L)
/// p+    = phi p + drift + (1 - phi) g settled
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Step<T> {
    pub(super) dt_s: T,
    /// Of turbine and output, for the clutches that slip.
    pub(super) rows: [AccelerationRow<T>; 2],
    /// Turbine torque by the maps, at the middle of the step, N m.
    pub(super) turbine_n_m: T,
    /// Torque of the oncoming clutch per pressure above the kiss point, N m/Pa.
    pub(super) per_pressure: T,
    /// Mean pressure above the kiss point, Pa, and its derivative by the pressure at the start.
    pub(super) above_kiss: [T; 2],
    /// Mean of what the commands in effect end at, Pa.
    pub(super) settled_pa: T,
    /// The valve over the step.
    pub(super) valve: ValveStep<T>,
    pub(super) ratio: T,
    pub(super) stiffness: T,
    pub(super) damping: T,
    /// Of wheels and vehicle, kg m^2.
    pub(super) inertia: T,
    /// What is left of the turbine's share and of the offgoing torque.
    pub(super) stay: T,
    pub(super) keep: T,
}

impl<T: Real> Step<T> {
    /// Shaft torque per `(w_0 + w_0+)/(2 i) - a`.
    #[inline]
    fn shaft_per_twist(&self) -> T {
        T::of(0.5) * self.stiffness * self.dt_s + self.damping
    }

    /// Pressure at the end per share of the valve's gain, Pa.
    #[inline]
    fn per_gain(&self) -> T {
        (T::one() - self.valve.phi) * self.settled_pa
    }

    /// The states at the end.
    #[inline]
    pub(super) fn propagate(&self, x: &[T; N]) -> [T; N] {
        let (one, half, dt) = (T::one(), T::of(0.5), self.dt_s);
        let oncoming = (one + x[FRICTION]) * self.per_pressure * self.above_kiss[0];
        let free = |row: &AccelerationRow<T>| {
            row.per_turbine_torque * self.turbine_n_m * (one + x[SHARE])
                + row.per_oncoming_torque * oncoming
                + row.per_offgoing_torque * x[OFFGOING]
        };
        let twist = x[OUTPUT] / self.ratio - x[WHEEL];
        let middle = x[WHEEL] + half * dt / self.inertia * (x[SPRING] + self.damping * twist - x[LOAD]);
        let k = self.shaft_per_twist();
        let [c_t, c_o] = self.rows.map(|row| row.per_output_torque / self.ratio);
        let held = x[SPRING] + k * (half * x[OUTPUT] / self.ratio - middle);
        let output = (x[OUTPUT] + dt * (free(&self.rows[1]) + c_o * held)) / (one - half * dt * c_o * k / self.ratio);
        let mean_twist = half * (x[OUTPUT] + output) / self.ratio - middle;
        let shaft = x[SPRING] + k * mean_twist;
        let mut next = *x;
        next[TURBINE] = x[TURBINE] + dt * (free(&self.rows[0]) + c_t * shaft);
        next[OUTPUT] = output;
        next[WHEEL] = x[WHEEL] + dt / self.inertia * (shaft - x[LOAD]);
        next[SPRING] = x[SPRING] + self.stiffness * dt * mean_twist;
        next[PRESSURE] = self.valve.phi * x[PRESSURE] + self.valve.drift_pa + self.per_gain() * x[GAIN];
        next[SHARE] = self.stay * x[SHARE];
        next[OFFGOING] = self.keep * x[OFFGOING];
        next
    }

    /// Derivatives of the first five states at the end by those that they depend on.
    #[inline]
    pub(super) fn jacobian(&self, x: &[T; N]) -> [[T; COLUMNS]; LAWS] {
        let (zero, one, half, dt) = (T::zero(), T::one(), T::of(0.5), self.dt_s);
        let friction = one + x[FRICTION];
        let free = |row: &AccelerationRow<T>| {
            let mut by = [zero; COLUMNS];
            by[PRESSURE] = row.per_oncoming_torque * friction * self.per_pressure * self.above_kiss[1];
            by[FRICTION] = row.per_oncoming_torque * self.per_pressure * self.above_kiss[0];
            by[SHARE] = row.per_turbine_torque * self.turbine_n_m;
            by[OFFGOING] = row.per_offgoing_torque;
            by
        };
        let k = self.shaft_per_twist();
        let [c_t, c_o] = self.rows.map(|row| row.per_output_torque / self.ratio);
        // Of the wheel speed at the middle.
        let per_torque = half * dt / self.inertia;
        let mut middle = [zero; COLUMNS];
        middle[WHEEL] = one - per_torque * self.damping;
        middle[OUTPUT] = per_torque * self.damping / self.ratio;
        middle[SPRING] = per_torque;
        middle[LOAD] = -per_torque;
        let mut f = [[zero; COLUMNS]; LAWS];
        let solve = (one - half * dt * c_o * k / self.ratio).recip();
        let by_output = free(&self.rows[1]);
        for (c, by) in by_output.into_iter().enumerate() {
            f[OUTPUT][c] = solve * dt * (by - c_o * k * middle[c]);
        }
        f[OUTPUT][OUTPUT] = f[OUTPUT][OUTPUT] + solve * (one + half * dt * c_o * k / self.ratio);
        f[OUTPUT][SPRING] = f[OUTPUT][SPRING] + solve * dt * c_o;
        let by_turbine = free(&self.rows[0]);
        for c in 0..COLUMNS {
            let same = if c == OUTPUT { one } else { zero };
            let twist = half * (same + f[OUTPUT][c]) / self.ratio - middle[c];
            let shaft = k * twist + if c == SPRING { one } else { zero };
            f[TURBINE][c] = dt * (by_turbine[c] + c_t * shaft);
            f[SPRING][c] = self.stiffness * dt * twist;
            f[WHEEL][c] = dt / self.inertia * shaft;
        }
        f[TURBINE][TURBINE] = f[TURBINE][TURBINE] + one;
        f[SPRING][SPRING] = f[SPRING][SPRING] + one;
        f[WHEEL][WHEEL] = f[WHEEL][WHEEL] + one;
        f[WHEEL][LOAD] = f[WHEEL][LOAD] - dt / self.inertia;
        f[PRESSURE][PRESSURE] = self.valve.phi;
        f[PRESSURE][GAIN] = self.per_gain();
        f
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step() -> Step<f64> {
        let row = |a: [f64; 4]| AccelerationRow {
            per_turbine_torque: a[0],
            per_offgoing_torque: a[1],
            per_oncoming_torque: a[2],
            per_output_torque: a[3],
        };
        Step {
            dt_s: 0.01,
            rows: [row([15.2, -9.4, -15.5, 0.11]), row([0.5, 10.1, 0.16, -6.1])],
            turbine_n_m: 130.0,
            per_pressure: 5.1e-4,
            above_kiss: [0.15e6, 0.9],
            settled_pa: 0.23e6,
            valve: ValveStep { phi: 0.78, psi: 0.009, drift_pa: 0.05e6, drift_integral_pa_s: 300.0 },
            ratio: 3.0,
            stiffness: 13_000.0,
            damping: 20.0,
            inertia: 137.0,
            stay: 0.997,
            keep: 0.75,
        }
    }

    #[test]
    fn the_jacobian_is_the_derivative_of_the_step() {
        let step = step();
        let mut x = [0.0; N];
        x[..COLUMNS].copy_from_slice(&[300.0, 120.0, 40.5, 900.0, 0.2e6, 0.03, 60.0, 700.0, -0.1, 0.04]);
        let f = step.jacobian(&x);
        for c in 0..COLUMNS {
            let small = 1e-5 * x[c].abs().max(1e-2);
            let moved = |by: f64| {
                let mut x = x;
                x[c] += by;
                // The mean pressure above the kiss point belongs to the step.
                let mut step = step;
                if c == PRESSURE {
                    step.above_kiss[0] += by * step.above_kiss[1];
                }
                step.propagate(&x)
            };
            let (up, down) = (moved(small), moved(-small));
            for r in 0..LAWS {
                let slope = (up[r] - down[r]) / (2.0 * small);
                // The difference of two states near `up[r]` is rounded.
                let tolerance = 1e-6 * slope.abs() + 4.0 * f64::EPSILON * up[r].abs() / small;
                assert!((slope - f[r][c]).abs() <= tolerance, "{r} {c}: {slope} {}", f[r][c]);
            }
        }
    }

    #[test]
    fn a_balance_of_torques_stays() {
        let mut x = [0.0; N];
        let mut step = step();
        (x[OUTPUT], x[WHEEL], x[SPRING], x[LOAD]) = (120.0, 40.0, 900.0, 900.0);
        step.above_kiss = [0.0; 2];
        // The offgoing clutch balances the turbine, and the turbine torque the output.
        let [t, o] = step.rows;
        let output = 900.0 / 3.0;
        let determinant = t.per_turbine_torque * o.per_offgoing_torque - o.per_turbine_torque * t.per_offgoing_torque;
        step.turbine_n_m = -(t.per_output_torque * o.per_offgoing_torque - o.per_output_torque * t.per_offgoing_torque)
            * output
            / determinant;
        x[OFFGOING] = -(o.per_output_torque * t.per_turbine_torque - t.per_output_torque * o.per_turbine_torque)
            * output
            / determinant;
        let next = step.propagate(&x);
        for state in [TURBINE, OUTPUT, WHEEL, SPRING] {
            assert!((next[state] - x[state]).abs() < 1e-9, "{state}: {} {}", next[state], x[state]);
        }
    }
}
