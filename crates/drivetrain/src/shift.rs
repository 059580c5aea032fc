//! The reduced shift: the model of the gearbox for plant and observers.
//!
//! During a shift between two clutches, any gear train has two degrees of freedom, turbine
//! speed `w_t` and output speed `w_0`. Its dynamics are
//!
//! ```text
//! M d/dt (w_t, w_0)' = (T_t, -T_out)' - k_off T_off - k_on T_on,     slip_x = k_x (w_t, w_0)'
//! ```
//!
//! and a sticking clutch adds the constraint `k d/dt (w_t, w_0)' = 0`, with its torque as multiplier.
//! Solved for the accelerations this gives the chapter's `C_ij` (both slip) and `c_ij` (offgoing sticks).

use crate::Real;

/// Torques that act on the gear train, N m.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ShiftTorques<T> {
    /// Turbine torque `T_t`, driving.
    pub turbine_n_m: T,
    /// Torque of the offgoing clutch `T_ca`, positive on its output side.
    pub offgoing_n_m: T,
    /// Torque of the oncoming clutch `T_cb`, positive on its output side.
    pub oncoming_n_m: T,
    /// Load at the gearbox output, positive when it resists.
    pub output_n_m: T,
}

/// An acceleration (rad/s^2) or a constraint torque (N m) as a combination of [`ShiftTorques`].
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct AccelerationRow<T> {
    /// Coefficient of the turbine torque, e.g. `C11`.
    pub per_turbine_torque: T,
    /// Coefficient of the offgoing clutch's torque, e.g. `C12`.
    pub per_offgoing_torque: T,
    /// Coefficient of the oncoming clutch's torque, e.g. `C13`.
    pub per_oncoming_torque: T,
    /// Coefficient of the load at the output, e.g. `C14`.
    pub per_output_torque: T,
}

impl<T: Real> AccelerationRow<T> {
    /// The combination at these torques.
    #[inline]
    pub fn at(&self, torques: &ShiftTorques<T>) -> T {
        self.per_turbine_torque * torques.turbine_n_m
            + self.per_offgoing_torque * torques.offgoing_n_m
            + self.per_oncoming_torque * torques.oncoming_n_m
            + self.per_output_torque * torques.output_n_m
    }

    fn from_columns(column: impl Fn(ShiftTorques<T>) -> T) -> Self {
        let (zero, one) = (T::zero(), T::one());
        let none = ShiftTorques { turbine_n_m: zero, offgoing_n_m: zero, oncoming_n_m: zero, output_n_m: zero };
        Self {
            per_turbine_torque: column(ShiftTorques { turbine_n_m: one, ..none }),
            per_offgoing_torque: column(ShiftTorques { offgoing_n_m: one, ..none }),
            per_oncoming_torque: column(ShiftTorques { oncoming_n_m: one, ..none }),
            per_output_torque: column(ShiftTorques { output_n_m: one, ..none }),
        }
    }
}

/// Which of the two shift clutches stick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Engagement {
    /// Both slip: the inertia phase.
    BothSlipping,
    /// The offgoing clutch sticks: the gear before the shift, and the torque phase.
    OffgoingStuck,
    /// The oncoming clutch sticks: the gear after the shift.
    OncomingStuck,
    /// Both stick: tie-up.
    BothStuck,
}

impl Engagement {
    /// The engagement in which the named clutches stick.
    pub fn of(offgoing_stuck: bool, oncoming_stuck: bool) -> Self {
        match (offgoing_stuck, oncoming_stuck) {
            (false, false) => Self::BothSlipping,
            (true, false) => Self::OffgoingStuck,
            (false, true) => Self::OncomingStuck,
            (true, true) => Self::BothStuck,
        }
    }
}

/// Accelerations and constraint torques in one engagement.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ShiftCoefficients<T> {
    /// Turbine acceleration.
    pub turbine: AccelerationRow<T>,
    /// Output acceleration.
    pub output: AccelerationRow<T>,
    /// Acceleration of the oncoming clutch's slip.
    pub slip_oncoming: AccelerationRow<T>,
    /// Torque by which the sticking offgoing clutch holds; zero row if it slips.
    pub holding_offgoing: AccelerationRow<T>,
    /// Torque by which the sticking oncoming clutch holds; zero row if it slips.
    pub holding_oncoming: AccelerationRow<T>,
}

/// A gear train reduced to the shift between two clutches.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ReducedShift<T> {
    /// Mass matrix `M` in `(w_t, w_0)`, kg m^2.
    pub mass_kg_m2: [[T; 2]; 2],
    /// Slip of the offgoing clutch per `(w_t, w_0)`.
    pub slip_offgoing: [T; 2],
    /// Slip of the oncoming clutch per `(w_t, w_0)`.
    pub slip_oncoming: [T; 2],
}

impl<T: Real> ReducedShift<T> {
    /// Speed ratio `w_t / w_0` while the offgoing clutch sticks; for the two-speed set `1 + 1/gamma`, Eq. (2.1).
    pub fn ratio_offgoing(&self) -> T {
        -self.slip_offgoing[1] / self.slip_offgoing[0]
    }

    /// Speed ratio `w_t / w_0` while the oncoming clutch sticks; for the two-speed set 1, Eq. (2.2).
    pub fn ratio_oncoming(&self) -> T {
        -self.slip_oncoming[1] / self.slip_oncoming[0]
    }

    /// Slip of the offgoing clutch, rad/s.
    #[inline]
    pub fn offgoing_slip(&self, turbine_rad_s: T, output_rad_s: T) -> T {
        self.slip_offgoing[0] * turbine_rad_s + self.slip_offgoing[1] * output_rad_s
    }

    /// Slip of the oncoming clutch, rad/s, Eq. (2.14).
    #[inline]
    pub fn oncoming_slip(&self, turbine_rad_s: T, output_rad_s: T) -> T {
        self.slip_oncoming[0] * turbine_rad_s + self.slip_oncoming[1] * output_rad_s
    }

    /// Output speed that goes with this turbine speed and oncoming slip, rad/s, Eq. (2.5).
    #[inline]
    pub fn output_speed(&self, turbine_rad_s: T, slip_oncoming_rad_s: T) -> T {
        (slip_oncoming_rad_s - self.slip_oncoming[0] * turbine_rad_s) / self.slip_oncoming[1]
    }

    /// The same gear train with `inertia_kg_m2` added to its output shaft.
    #[must_use]
    pub fn with_output_inertia(mut self, inertia_kg_m2: T) -> Self {
        self.mass_kg_m2[1][1] = self.mass_kg_m2[1][1] + inertia_kg_m2;
        self
    }

    /// Kinetic energy, J.
    pub fn kinetic_energy(&self, turbine_rad_s: T, output_rad_s: T) -> T {
        let m = &self.mass_kg_m2;
        T::of(0.5)
            * (m[0][0] * turbine_rad_s * turbine_rad_s
                + (m[0][1] + m[1][0]) * turbine_rad_s * output_rad_s
                + m[1][1] * output_rad_s * output_rad_s)
    }

    /// Speeds `(w_t, w_0)` right after a clutch grips for good: the momenta along the motion that
    /// stays free are conserved, the slip `k (w_t, w_0)` becomes zero.
    pub fn after_lock_up(&self, slip_row: [T; 2], turbine_rad_s: T, output_rad_s: T) -> (T, T) {
        let direction = self.solve(slip_row);
        let slip = slip_row[0] * turbine_rad_s + slip_row[1] * output_rad_s;
        let impulse = slip / (slip_row[0] * direction[0] + slip_row[1] * direction[1]);
        (turbine_rad_s - impulse * direction[0], output_rad_s - impulse * direction[1])
    }

    /// The coefficients of this engagement. With both clutches slipping and an output inertia `I` they
    /// are `C_ij` of Eq. (2.10); with the offgoing clutch sticking they are `c_ij` of Eq. (2.20).
    pub fn coefficients(&self, engagement: Engagement) -> ShiftCoefficients<T> {
        let solve = |torques: ShiftTorques<T>| self.accelerate(engagement, &torques);
        let on = self.slip_oncoming;
        ShiftCoefficients {
            turbine: AccelerationRow::from_columns(|t| solve(t).0[0]),
            output: AccelerationRow::from_columns(|t| solve(t).0[1]),
            slip_oncoming: AccelerationRow::from_columns(|t| {
                let (acceleration, _) = solve(t);
                on[0] * acceleration[0] + on[1] * acceleration[1]
            }),
            holding_offgoing: AccelerationRow::from_columns(|t| solve(t).1[0]),
            holding_oncoming: AccelerationRow::from_columns(|t| solve(t).1[1]),
        }
    }

    /// Accelerations `(w_t, w_0)` and holding torques `(offgoing, oncoming)`: what Eq. (2.6) to (2.9) say of
    /// the two-speed set, for any gear train. The torque of a sticking
    /// clutch is an unknown here, so its entry in `torques` has no effect.
    fn accelerate(&self, engagement: Engagement, torques: &ShiftTorques<T>) -> ([T; 2], [T; 2]) {
        let zero = T::zero();
        let (off, on) = (self.slip_offgoing, self.slip_oncoming);
        let given = |stuck: bool, torque: T| if stuck { zero } else { torque };
        let (off_stuck, on_stuck) = match engagement {
            Engagement::BothSlipping => (false, false),
            Engagement::OffgoingStuck => (true, false),
            Engagement::OncomingStuck => (false, true),
            Engagement::BothStuck => (true, true),
        };
        let (t_off, t_on) = (given(off_stuck, torques.offgoing_n_m), given(on_stuck, torques.oncoming_n_m));
        let force =
            [torques.turbine_n_m - off[0] * t_off - on[0] * t_on, -torques.output_n_m - off[1] * t_off - on[1] * t_on];
        let dot = |a: [T; 2], b: [T; 2]| a[0] * b[0] + a[1] * b[1];
        let free = self.solve(force);
        let held = |k: [T; 2]| {
            let direction = self.solve(k);
            let holding = dot(k, free) / dot(k, direction);
            ([free[0] - holding * direction[0], free[1] - holding * direction[1]], holding)
        };
        match engagement {
            Engagement::BothSlipping => (free, [zero, zero]),
            Engagement::OffgoingStuck => {
                let (acceleration, holding) = held(off);
                (acceleration, [holding, zero])
            }
            Engagement::OncomingStuck => {
                let (acceleration, holding) = held(on);
                (acceleration, [zero, holding])
            }
            Engagement::BothStuck => {
                // Nothing moves: off' T_off + on' T_on = force.
                let det = off[0] * on[1] - off[1] * on[0];
                let t_off = (force[0] * on[1] - force[1] * on[0]) / det;
                let t_on = (off[0] * force[1] - off[1] * force[0]) / det;
                ([zero, zero], [t_off, t_on])
            }
        }
    }

    /// `M^-1 x`.
    fn solve(&self, x: [T; 2]) -> [T; 2] {
        let m = &self.mass_kg_m2;
        let det = m[0][0] * m[1][1] - m[0][1] * m[1][0];
        [(m[1][1] * x[0] - m[0][1] * x[1]) / det, (m[0][0] * x[1] - m[1][0] * x[0]) / det]
    }

    /// The same reduction in another precision.
    pub fn cast<U: Real>(&self) -> ReducedShift<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        ReducedShift {
            mass_kg_m2: self.mass_kg_m2.map(|row| row.map(to)),
            slip_offgoing: self.slip_offgoing.map(to),
            slip_oncoming: self.slip_oncoming.map(to),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shift() -> ReducedShift<f64> {
        // gamma = 2/3: w_r = (1 + gamma) w_0 - gamma w_t, I_t = 0.06, I_r = 0.01, I_o = 0.15.
        let (g, it, ir, io) = (2.0 / 3.0, 0.06, 0.01, 0.15);
        let off = -ir * g * (1.0 + g);
        ReducedShift {
            mass_kg_m2: [[it + g * g * ir, off], [off, io + (1.0 + g) * (1.0 + g) * ir]],
            slip_offgoing: [g, -(1.0 + g)],
            slip_oncoming: [1.0 + g, -(1.0 + g)],
        }
    }

    const TORQUES: ShiftTorques<f64> =
        ShiftTorques { turbine_n_m: 120.0, offgoing_n_m: 33.0, oncoming_n_m: 71.0, output_n_m: 200.0 };

    #[test]
    fn a_sticking_clutch_keeps_its_slip_and_balances_the_torques() {
        let stuck = shift().coefficients(Engagement::OffgoingStuck);
        let holding = stuck.holding_offgoing.at(&TORQUES);
        let slipping = shift().coefficients(Engagement::BothSlipping);
        let same = ShiftTorques { offgoing_n_m: holding, ..TORQUES };
        assert!((slipping.turbine.at(&same) - stuck.turbine.at(&TORQUES)).abs() < 1e-9);
        let slip_rate = shift().offgoing_slip(stuck.turbine.at(&TORQUES), stuck.output.at(&TORQUES));
        assert!(slip_rate.abs() < 1e-9);
    }

    /// Virtual power: along any motion the torques do what kinetic energy and friction take up, whichever clutches
    /// stick. That is every equation of the set at once.
    #[test]
    fn the_power_of_the_torques_becomes_kinetic_energy_or_friction_in_every_engagement() {
        let shift = shift();
        let m = shift.mass_kg_m2;
        for (off_stuck, on_stuck) in [(false, false), (true, false), (false, true), (true, true)] {
            let rows = shift.coefficients(Engagement::of(off_stuck, on_stuck));
            let (a_t, a_0) = (rows.turbine.at(&TORQUES), rows.output.at(&TORQUES));
            let offgoing = if off_stuck { rows.holding_offgoing.at(&TORQUES) } else { TORQUES.offgoing_n_m };
            let oncoming = if on_stuck { rows.holding_oncoming.at(&TORQUES) } else { TORQUES.oncoming_n_m };
            for [w_t, w_0] in [[1.0, 0.0], [0.0, 1.0]] {
                let given = TORQUES.turbine_n_m * w_t - TORQUES.output_n_m * w_0;
                let lost = offgoing * shift.offgoing_slip(w_t, w_0) + oncoming * shift.oncoming_slip(w_t, w_0);
                let kinetic = w_t * (m[0][0] * a_t + m[0][1] * a_0) + w_0 * (m[1][0] * a_t + m[1][1] * a_0);
                assert!((given - lost - kinetic).abs() < 1e-9, "{off_stuck} {on_stuck}: {given} {lost} {kinetic}");
            }
            assert!(!off_stuck || shift.offgoing_slip(a_t, a_0).abs() < 1e-9);
            assert!(!on_stuck || shift.oncoming_slip(a_t, a_0).abs() < 1e-9);
        }
    }

    #[test]
    fn first_gear_reaction_at_rest_is_half_again_the_turbine_torque() {
        let tied = shift().coefficients(Engagement::BothStuck);
        let balance = ShiftTorques { output_n_m: 300.0, oncoming_n_m: 0.0, ..TORQUES };
        let offgoing = tied.holding_offgoing.at(&balance);
        let oncoming = tied.holding_oncoming.at(&balance);
        // T_t = T_on + T_sun, T_ring = 1.5 T_sun, T_out = 2.5 T_sun: 120 N m in, 300 N m out leaves B idle.
        assert!((offgoing - 180.0).abs() < 1e-9 && oncoming.abs() < 1e-9);
    }

    #[test]
    fn lock_up_conserves_momentum_along_the_free_motion() {
        let shift = shift();
        let (before, k) = ([300.0, 90.0], shift.slip_oncoming);
        let after = shift.after_lock_up(k, before[0], before[1]);
        assert!(shift.oncoming_slip(after.0, after.1).abs() < 1e-10);
        // The impulse acts along k, so M dw has no part along a motion that does not slip the clutch.
        let dw = [after.0 - before[0], after.1 - before[1]];
        let m = shift.mass_kg_m2;
        let dp = [m[0][0] * dw[0] + m[0][1] * dw[1], m[1][0] * dw[0] + m[1][1] * dw[1]];
        let free = [-k[1], k[0]];
        assert!((dp[0] * free[0] + dp[1] * free[1]).abs() < 1e-10);
        assert!(shift.kinetic_energy(after.0, after.1) < shift.kinetic_energy(before[0], before[1]));
    }

    #[test]
    fn output_speed_undoes_the_slip() {
        let slip = shift().oncoming_slip(300.0, 120.0);
        assert!((shift().output_speed(300.0, slip) - 120.0).abs() < 1e-12);
    }
}
