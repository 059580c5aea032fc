//! What the powertrain does over one step, as the filter knows it: mean and Jacobian.

use drivetrain::{AccelerationRow, Real, ValveStep};

use super::states::{FRACTION, FRICTION, GAIN, LOAD, N, OFFGOING, OUTPUT, PRESSURE, SPRING, TURBINE, WHEEL};

/// Number of the states that have a law of their own; the others stand or fade.
pub(super) const LAWS: usize = 5;
/// The states that these laws depend on are the first ones.
pub(super) const COLUMNS: usize = GAIN + 1;
const _: () = assert!(TURBINE < LAWS && OUTPUT < LAWS && WHEEL < LAWS && SPRING < LAWS && PRESSURE < LAWS);
const _: () = assert!(FRACTION < COLUMNS && OFFGOING < COLUMNS && LOAD < COLUMNS && FRICTION < COLUMNS);

/// One step of the powertrain with frozen coefficients.
///
/// ```text
/// a     = w_w + dt/(2 J) (T_k + C_s (w_0/i - w_w) - T_L)           wheel speed at the middle of the step
/// T_s   = T_k + (K_s dt/2 + C_s) ((w_0 + w_0+)/(2 i) - a)          T_k+ = T_k + K_s dt ((w_0 + w_0+)/(2 i) - a)
/// T     = (1 + e) (T_t + T_t' (w_t+ - w_t)/2)                      turbine torque, T_t' its slope by the turbine speed
/// w_t+  = w_t + dt (c_t1 T + ... + c_t4 T_s)                       implicit in w_t+ and w_0+
/// w_0+  = w_0 + dt (c_o1 T + ... + c_o4 T_s)                       w_w+ = w_w + dt/J (T_s - T_L)
/// p+    = phi p + drift + (1 - phi) g settled
/// ```
///
/// Near a speed ratio of one the turbine torque falls by as much as 10 N m per rad/s: with both clutches slipping an
/// explicit step of 10 ms would overshoot, and the correction of the next reading with it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Step<T> {
    pub(super) dt_s: T,
    /// Of turbine and output, for the clutches that slip.
    pub(super) rows: [AccelerationRow<T>; 2],
    /// Turbine torque by the maps at the start, with the engine speed of the middle, N m, and its slope, N m s/rad.
    pub(super) turbine: [T; 2],
    /// Whether the offgoing clutch holds the turbine to the vehicle: then an error of its speed does not fade by that slope,
    /// though the equations, in which both clutches slip, would have it so.
    pub(super) held: bool,
    /// Torque of the oncoming clutch per pressure above the kiss point, N m/Pa.
    pub(super) per_pressure: T,
    /// Mean pressure above the kiss point, Pa, and its derivative by the pressure at the start.
    pub(super) above_kiss: [T; 2],
    /// Mean of what the commands in effect end at, Pa.
    pub(super) settled_pa: T,
    /// The valve over the step.
    pub(super) valve: ValveStep<T>,
    /// `1/i`.
    pub(super) per_ratio: T,
    pub(super) stiffness: T,
    pub(super) damping: T,
    /// `dt/J` of wheels and vehicle, s/(kg m^2).
    pub(super) per_inertia: T,
    /// What is left of the relative turbine torque error, of the offgoing torque, and of friction and gain.
    pub(super) stay: T,
    pub(super) keep: T,
    pub(super) last: T,
}

impl<T: Real> Step<T> {
    /// Shaft torque per `(w_0 + w_0+)/(2 i) - a`.
    #[inline]
    fn shaft_per_twist(&self) -> T {
        T::of(0.5) * self.stiffness * self.dt_s + self.damping
    }

    /// Slope of the turbine torque with which a step is solved. Where the torque brings the turbine to its balance within the step,
    /// the mean of both ends would carry it to the other side, and back in the next step: the end is weighed so that it stays there.
    #[inline]
    fn slope_in_step(&self, slope_n_m_s: T) -> T {
        let step = (self.dt_s * self.rows[0].per_turbine_torque).recip();
        slope_n_m_s.at_most(T::of(2.0) * (slope_n_m_s + step))
    }

    /// Pressure at the end per fraction of the valve's gain, Pa.
    #[inline]
    fn per_gain(&self) -> T {
        (T::one() - self.valve.phi) * self.settled_pa
    }

    /// Solves for how much turbine and output speed change, from what they would change by at the torques of the start.
    #[inline]
    fn implicit(&self, fraction: T, slope_n_m_s: T) -> Implicit<T> {
        let (one, half, dt) = (T::one(), T::of(0.5), self.dt_s);
        let per_turbine = half * dt * (one + fraction) * slope_n_m_s;
        let per_output = half * dt * self.shaft_per_twist() * self.per_ratio * self.per_ratio;
        let [t, o] = &self.rows;
        let matrix = [
            [one - per_turbine * t.per_turbine_torque, -per_output * t.per_output_torque],
            [-per_turbine * o.per_turbine_torque, one - per_output * o.per_output_torque],
        ];
        let determinant = matrix[0][0] * matrix[1][1] - matrix[0][1] * matrix[1][0];
        Implicit { matrix, per_determinant: determinant.recip() }
    }

    /// The states at the end.
    #[inline]
    pub(super) fn propagate(&self, x: &[T; N]) -> [T; N] {
        let (one, half, dt) = (T::one(), T::of(0.5), self.dt_s);
        let oncoming = (one + x[FRICTION]) * self.per_pressure * self.above_kiss[0];
        let twist = x[OUTPUT] * self.per_ratio - x[WHEEL];
        let middle = x[WHEEL] + half * self.per_inertia * (x[SPRING] + self.damping * twist - x[LOAD]);
        let (k, rate) = (self.shaft_per_twist(), x[OUTPUT] * self.per_ratio - middle);
        let held = x[SPRING] + k * rate;
        let explicit = |row: &AccelerationRow<T>| {
            dt * (row.per_turbine_torque * self.turbine[0] * (one + x[FRACTION])
                + row.per_oncoming_torque * oncoming
                + row.per_offgoing_torque * x[OFFGOING]
                + row.per_output_torque * self.per_ratio * held)
        };
        let implicit = self.implicit(x[FRACTION], self.slope_in_step(self.turbine[1]));
        let [turbine, output] = implicit.solve([explicit(&self.rows[0]), explicit(&self.rows[1])]);
        let mean_rate = rate + half * self.per_ratio * output;
        let shaft = x[SPRING] + k * mean_rate;
        let mut next = *x;
        next[TURBINE] = x[TURBINE] + turbine;
        next[OUTPUT] = x[OUTPUT] + output;
        next[WHEEL] = x[WHEEL] + self.per_inertia * (shaft - x[LOAD]);
        next[SPRING] = x[SPRING] + self.stiffness * dt * mean_rate;
        next[PRESSURE] = self.valve.phi * x[PRESSURE] + self.valve.drift_pa + self.per_gain() * x[GAIN];
        next[FRACTION] = self.stay * x[FRACTION];
        next[OFFGOING] = self.keep * x[OFFGOING];
        next[FRICTION] = self.last * x[FRICTION];
        next[GAIN] = self.last * x[GAIN];
        next
    }

    /// What the step makes of a small change of the states, of which `x` became `next`.
    #[inline]
    pub(super) fn tangent(&self, x: &[T; N], next: &[T; N]) -> Tangent<T> {
        let (zero, one, half, dt) = (T::zero(), T::one(), T::of(0.5), self.dt_s);
        let slope_n_m_s = if self.held { zero } else { self.turbine[1] };
        let in_step = self.slope_in_step(self.turbine[1]);
        let mean_turbine_n_m = self.turbine[0] + half * in_step * (next[TURBINE] - x[TURBINE]);
        let implicit = self.implicit(x[FRACTION], self.slope_in_step(slope_n_m_s));
        let [t, o] = &self.rows;
        let per = |t: T, o: T| implicit.solve([dt * t, dt * o]);
        let Self { per_ratio, per_inertia, .. } = *self;
        let half_per_inertia = half * per_inertia;
        Tangent {
            per_ratio,
            half_per_ratio: half * per_ratio,
            damped: one - half_per_inertia * self.damping,
            per_inertia,
            half_per_inertia,
            shaft_per_twist: self.shaft_per_twist(),
            spring_per_twist: self.stiffness * dt,
            per_turbine_torque: per(t.per_turbine_torque, o.per_turbine_torque),
            per_oncoming_torque: per(t.per_oncoming_torque, o.per_oncoming_torque),
            per_offgoing_torque: per(t.per_offgoing_torque, o.per_offgoing_torque),
            per_shaft_torque: per(t.per_output_torque * per_ratio, o.per_output_torque * per_ratio),
            turbine_per_fraction: mean_turbine_n_m,
            turbine_per_speed: (one + x[FRACTION]) * slope_n_m_s,
            oncoming_per_pressure: self.per_pressure * (one + x[FRICTION]) * self.above_kiss[1],
            oncoming_per_friction: self.per_pressure * self.above_kiss[0],
            phi: self.valve.phi,
            per_gain: self.per_gain(),
            stay: self.stay,
            keep: self.keep,
            last: self.last,
        }
    }
}

/// A step's derivative, as what it makes of a small change of the states: a change of a torque first, then of the speeds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Tangent<T> {
    per_ratio: T,
    half_per_ratio: T,
    /// What the damping leaves of a twist rate until the middle of the step.
    damped: T,
    per_inertia: T,
    half_per_inertia: T,
    shaft_per_twist: T,
    spring_per_twist: T,
    /// Changes of turbine and output speed per torque.
    per_turbine_torque: [T; 2],
    per_oncoming_torque: [T; 2],
    per_offgoing_torque: [T; 2],
    per_shaft_torque: [T; 2],
    /// Torques per state.
    turbine_per_fraction: T,
    turbine_per_speed: T,
    oncoming_per_pressure: T,
    oncoming_per_friction: T,
    /// Of the pressure.
    phi: T,
    per_gain: T,
    /// What is left of the relative turbine torque error, of the offgoing torque, and of friction and gain.
    pub(super) stay: T,
    pub(super) keep: T,
    pub(super) last: T,
}

impl<T: Real> Tangent<T> {
    /// Changes of the states that have a law at the end, of changes of the states that it depends on.
    #[inline(always)]
    pub(super) fn of(&self, x: &[T; COLUMNS]) -> [T; LAWS] {
        let (output, wheel, spring) = (x[OUTPUT], x[WHEEL], x[SPRING]);
        let driving = spring - x[LOAD];
        // The twist rate with the output speed of the start, and the shaft torque with it.
        let rate = self.damped * (self.per_ratio * output - wheel) - self.half_per_inertia * driving;
        let held = spring + self.shaft_per_twist * rate;
        let turbine_torque = self.turbine_per_fraction * x[FRACTION] + self.turbine_per_speed * x[TURBINE];
        let oncoming = self.oncoming_per_pressure * x[PRESSURE] + self.oncoming_per_friction * x[FRICTION];
        let by = |end: usize| {
            self.per_turbine_torque[end] * turbine_torque
                + self.per_oncoming_torque[end] * oncoming
                + self.per_offgoing_torque[end] * x[OFFGOING]
                + self.per_shaft_torque[end] * held
        };
        let (by_turbine, by_output) = (by(0), by(1));
        let mean_rate = rate + self.half_per_ratio * by_output;
        let mut next = [T::zero(); LAWS];
        next[TURBINE] = x[TURBINE] + by_turbine;
        next[OUTPUT] = output + by_output;
        next[WHEEL] = wheel + self.per_inertia * (driving + self.shaft_per_twist * mean_rate);
        next[SPRING] = spring + self.spring_per_twist * mean_rate;
        next[PRESSURE] = self.pressure(x[PRESSURE], x[GAIN]);
        next
    }

    /// Change of the pressure at the end, of changes of the pressure and of the valve's gain.
    #[inline(always)]
    pub(super) fn pressure(&self, pressure: T, gain: T) -> T {
        self.phi * pressure + self.per_gain * gain
    }
}

/// The implicit part of a step: the changes of turbine and output speed depend on each other.
struct Implicit<T> {
    matrix: [[T; 2]; 2],
    per_determinant: T,
}

impl<T: Real> Implicit<T> {
    #[inline]
    fn solve(&self, [turbine, output]: [T; 2]) -> [T; 2] {
        let [[tt, to], [ot, oo]] = self.matrix;
        [(oo * turbine - to * output) * self.per_determinant, (tt * output - ot * turbine) * self.per_determinant]
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub(in crate::kalman) fn step() -> Step<f64> {
        let row = |a: [f64; 4]| AccelerationRow {
            per_turbine_torque: a[0],
            per_offgoing_torque: a[1],
            per_oncoming_torque: a[2],
            per_output_torque: a[3],
        };
        Step {
            dt_s: 0.01,
            rows: [row([15.2, -9.4, -15.5, 0.11]), row([0.5, 10.1, 0.16, -6.1])],
            turbine: [130.0, -6.0],
            held: false,
            per_pressure: 5.1e-4,
            above_kiss: [0.15e6, 0.9],
            settled_pa: 0.23e6,
            valve: ValveStep { phi: 0.78, psi: 0.009, drift_pa: 0.05e6, drift_integral_pa_s: 300.0 },
            per_ratio: 3.0_f64.recip(),
            stiffness: 13_000.0,
            damping: 20.0,
            per_inertia: 0.01 / 137.0,
            stay: 0.997,
            keep: 0.75,
            last: 0.999,
        }
    }

    #[test]
    fn the_tangent_is_the_derivative_of_the_step() {
        // From -13 N m s on a step carries the turbine beyond its balance.
        for slope_n_m_s in [-6.0, -40.0] {
            let mut step = step();
            step.turbine[1] = slope_n_m_s;
            assert_tangent_is_derivative(step);
        }
    }

    /// An error of the turbine speed fades to the same side of its balance, however fast the turbine torque falls with the speed.
    #[test]
    fn a_stiff_turbine_torque_does_not_make_the_speed_alternate() {
        for slope_n_m_s in [-1.0, -6.0, -13.0, -20.0, -100.0, -1e4] {
            let mut step = step();
            step.turbine[1] = slope_n_m_s;
            let x = [0.0; N];
            let mut other = x;
            other[TURBINE] = 1.0;
            let at_balance = step.propagate(&x)[TURBINE];
            step.turbine[0] += slope_n_m_s;
            let left = step.propagate(&other)[TURBINE] - at_balance;
            // The output speed takes some of it along.
            assert!((-0.05..1.0).contains(&left), "{slope_n_m_s}: {left}");
        }
    }

    fn assert_tangent_is_derivative(step: Step<f64>) {
        let mut x = [0.0; N];
        for (state, value) in [
            (TURBINE, 300.0),
            (OUTPUT, 120.0),
            (WHEEL, 40.5),
            (SPRING, 900.0),
            (PRESSURE, 0.2e6),
            (FRACTION, 0.03),
            (OFFGOING, 60.0),
            (LOAD, 700.0),
            (FRICTION, -0.1),
            (GAIN, 0.04),
        ] {
            x[state] = value;
        }
        let tangent = step.tangent(&x, &step.propagate(&x));
        let unit = |c: usize| core::array::from_fn(|i| if i == c { 1.0 } else { 0.0 });
        let columns: [[f64; LAWS]; COLUMNS] = core::array::from_fn(|c| tangent.of(&unit(c)));
        for c in 0..COLUMNS {
            let small = 1e-5 * x[c].abs().max(1e-2);
            let moved = |by: f64| {
                let mut x = x;
                x[c] += by;
                // The mean pressure above the kiss point and the turbine torque at the start belong to the step.
                let mut step = step;
                if c == TURBINE {
                    step.turbine[0] += by * step.turbine[1];
                }
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
                assert!((slope - columns[c][r]).abs() <= tolerance, "{r} {c}: {slope} {}", columns[c][r]);
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
        step.turbine[0] = -(t.per_output_torque * o.per_offgoing_torque - o.per_output_torque * t.per_offgoing_torque)
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
