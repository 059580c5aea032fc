//! Powertrain model of the compliant observer: elastic drive shafts, tyres without slip, Eq. (2.61)-(2.67).

use drivetrain::{Engagement, Real, ReducedShift, ShiftCoefficients, ShiftTorques, clutch::direction};

use crate::{Phase, RigidModel};

/// Powertrain with the gearbox output and the vehicle joined by elastic shafts.
///
/// Left out, against the real car: tyre slip, damping of the shafts, wheel inertia, grade, the delay and
/// the varying lag and gain of the valve.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CompliantModel<T> {
    /// Converter, clutch, valve, road load, and the torque of the locked clutch.
    pub rigid: RigidModel<T>,
    /// The bare gear train with its output inertia `I_o`.
    pub shift: ReducedShift<T>,
    /// `c_ij`: the offgoing clutch sticks.
    pub torque_phase: ShiftCoefficients<T>,
    /// `C_ij`: both clutches slip.
    pub inertia_phase: ShiftCoefficients<T>,
    /// The oncoming clutch sticks.
    pub after_shift: ShiftCoefficients<T>,
    /// `c34 = -c35 = 1/(m R_w^2)`: acceleration of the wheel per torque, rad/s^2 per N m.
    pub wheel_per_torque: T,
}

/// Number of measured speeds: `(w_t, dw, w_w)`.
pub const OUTPUTS: usize = 3;

/// `dy/dt = F + G z` with `y = (w_t, dw, w_w)` and `z = (T_s, p)`, Eq. (2.68).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CompliantSpeedModel<T> {
    /// `F`: acceleration without shaft torque and clutch pressure, rad/s^2.
    pub free_rad_s2: [T; OUTPUTS],
    /// `G`: acceleration per shaft torque (rad/s^2 per N m) and per pressure (rad/s^2 per Pa).
    pub influence: [[T; 2]; OUTPUTS],
    /// Friction coefficient `mu` in both.
    pub friction: T,
    /// Direction of the slip, 1 or -1: the pressure's part of `G` has its sign.
    pub direction: T,
}

impl<T: Real> CompliantModel<T> {
    /// The model of this powertrain, of which `rigid` holds the parts that both models share. `shift` is
    /// the bare gear train.
    pub fn new(rigid: RigidModel<T>, shift: ReducedShift<T>) -> Self {
        Self {
            torque_phase: shift.coefficients(Engagement::OffgoingStuck),
            inertia_phase: shift.coefficients(Engagement::BothSlipping),
            after_shift: shift.coefficients(Engagement::OncomingStuck),
            wheel_per_torque: rigid.road.inertia_at_wheel().recip(),
            shift,
            rigid,
        }
    }

    fn coefficients(&self, phase: Phase) -> &ShiftCoefficients<T> {
        match phase {
            Phase::BeforeShift | Phase::TorquePhase => &self.torque_phase,
            Phase::InertiaPhase => &self.inertia_phase,
            Phase::AfterShift => &self.after_shift,
        }
    }

    /// `G` of Eq. (2.69c) and (2.70b) for a friction coefficient `mu`, in physical units. In the torque phase
    /// the slip is an input and not an output, so its row is zero.
    #[inline]
    pub fn influence(&self, phase: Phase, friction: T) -> [[T; 2]; OUTPUTS] {
        let rows = self.coefficients(phase);
        let clutch = &self.rigid.clutch;
        let torque_per_pressure = friction * clutch.lever() * clutch.piston_area_m2;
        let final_ratio = self.rigid.driveline.final_ratio;
        let row = |per_output: T, per_oncoming: T| [per_output / final_ratio, per_oncoming * torque_per_pressure];
        let zero = T::zero();
        let slip = match phase {
            Phase::InertiaPhase => row(rows.slip_oncoming.per_output_torque, rows.slip_oncoming.per_oncoming_torque),
            _ => [zero; 2],
        };
        [row(rows.turbine.per_output_torque, rows.turbine.per_oncoming_torque), slip, [self.wheel_per_torque, zero]]
    }

    /// `F` and `G` at these speeds, Eq. (2.65), (2.67), (2.69), (2.70).
    #[inline]
    pub fn speed_model(&self, phase: Phase, engine: T, turbine: T, slip: T, wheel: T) -> CompliantSpeedModel<T> {
        let clutch = &self.rigid.clutch;
        let (coefficient, direction) = (clutch.friction.at(slip.abs()), direction(slip));
        let friction = coefficient * direction;
        let known = ShiftTorques {
            turbine_n_m: self.rigid.converter.torques(engine, turbine).turbine_n_m,
            offgoing_n_m: T::zero(),
            oncoming_n_m: -friction * clutch.lever() * clutch.return_spring_n,
            output_n_m: T::zero(),
        };
        let rows = self.coefficients(phase);
        let slip_free = match phase {
            Phase::InertiaPhase => rows.slip_oncoming.at(&known),
            _ => T::zero(),
        };
        let load = self.rigid.road.wheel_torque(wheel);
        CompliantSpeedModel {
            free_rad_s2: [rows.turbine.at(&known), slip_free, -self.wheel_per_torque * load],
            influence: self.influence(phase, friction),
            friction: coefficient,
            direction,
        }
    }

    /// Rate of the shaft torque, N m/s, Eq. (2.61c) and (2.63d): `K_s (w_0/i_df - w_w)`.
    #[inline]
    pub fn shaft_rate(&self, turbine: T, slip: T, wheel: T) -> T {
        let line = &self.rigid.driveline;
        line.shaft_stiffness_n_m_rad * line.twist_rate(self.shift.output_speed(turbine, slip), wheel)
    }

    /// Shaft torque in a steady gear, N m: the torque at which gearbox and vehicle accelerate alike. Its
    /// offset cannot be seen from the speeds, which only tell how the twist changes; before a shift it
    /// follows from turbine torque and ratio.
    #[inline]
    pub fn steady_shaft_torque(&self, phase: Phase, engine: T, turbine: T, wheel: T) -> T {
        let rows = self.coefficients(phase);
        let ratio = match phase {
            Phase::AfterShift => self.shift.ratio_oncoming(),
            _ => self.shift.ratio_offgoing(),
        };
        let final_ratio = self.rigid.driveline.final_ratio;
        let overall = ratio * final_ratio;
        let turbine_n_m = self.rigid.converter.torques(engine, turbine).turbine_n_m;
        let load = self.rigid.road.wheel_torque(wheel);
        (rows.turbine.per_turbine_torque * turbine_n_m + overall * self.wheel_per_torque * load)
            / (overall * self.wheel_per_torque - rows.turbine.per_output_torque / final_ratio)
    }

    /// The same model in another precision.
    pub fn cast<U: Real>(&self) -> CompliantModel<U> {
        CompliantModel::new(self.rigid.cast(), self.shift.cast())
    }
}
