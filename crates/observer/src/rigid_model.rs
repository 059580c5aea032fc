//! Powertrain model of the rigid observers: rigid shafts, tyres without slip, Eq. (2.17)-(2.26).

use drivetrain::{
    Clutch, Converter, Driveline, Engagement, Real, ReducedShift, RoadLoad, ShiftCoefficients, ShiftTorques, Valve,
    clutch::direction,
};

use crate::Phase;

/// Powertrain with the vehicle as one rigid inertia behind the gearbox.
///
/// Left out, against the real car: torsion of the drive shafts, tyre slip, grade, the delay and the
/// varying lag and gain of the valve.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RigidModel<T> {
    /// Kinematics of the shift.
    pub shift: ReducedShift<T>,
    /// `c_ij`: the offgoing clutch sticks.
    pub torque_phase: ShiftCoefficients<T>,
    /// `C_ij`: both clutches slip.
    pub inertia_phase: ShiftCoefficients<T>,
    /// The oncoming clutch sticks.
    pub after_shift: ShiftCoefficients<T>,
    /// The torque converter's maps.
    pub converter: Converter<T>,
    /// The oncoming clutch.
    pub clutch: Clutch<T>,
    /// The oncoming clutch's valve.
    pub valve: Valve<T>,
    /// Road load; its grade is not used.
    pub road: RoadLoad<T>,
    /// Differential ratio.
    pub driveline: Driveline<T>,
}

/// `dy/dt = F + G z` with `y = (w_t, dw)` and `z` the pressure, Eq. (2.24a).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpeedModel<T> {
    /// `F`: acceleration without clutch pressure, rad/s^2.
    pub free_rad_s2: [T; 2],
    /// `G`: acceleration per pressure, rad/s^2/Pa.
    pub per_pressure_rad_s2_pa: [T; 2],
    /// Friction coefficient `mu` in both.
    pub friction: T,
    /// Direction of the slip, 1 or -1: `G` has its sign.
    pub direction: T,
}

impl<T: Real> RigidModel<T> {
    /// The model of this powertrain. `shift` is the bare gear train with output inertia `I_o`, in place
    /// of which the rigid model carries the whole vehicle, `I_ve = m R_w^2 / i_df^2`.
    pub fn new(
        shift: ReducedShift<T>,
        output_inertia_kg_m2: T,
        converter: Converter<T>,
        clutch: Clutch<T>,
        valve: Valve<T>,
        road: RoadLoad<T>,
        driveline: Driveline<T>,
    ) -> Self {
        let vehicle = driveline.vehicle_inertia_at_output(&road);
        let shift = shift.with_output_inertia(vehicle - output_inertia_kg_m2);
        Self {
            shift,
            torque_phase: shift.coefficients(Engagement::OffgoingStuck),
            inertia_phase: shift.coefficients(Engagement::BothSlipping),
            after_shift: shift.coefficients(Engagement::OncomingStuck),
            converter,
            clutch,
            valve,
            road,
            driveline,
        }
    }

    /// Coefficients of the phase; before the shift as in the torque phase.
    #[inline]
    pub fn coefficients(&self, phase: Phase) -> &ShiftCoefficients<T> {
        match phase {
            Phase::BeforeShift | Phase::TorquePhase => &self.torque_phase,
            Phase::InertiaPhase => &self.inertia_phase,
            Phase::AfterShift => &self.after_shift,
        }
    }

    /// `G` of Eq. (2.25b) and (2.26b) for a friction coefficient `mu`: rad/s^2 per Pa on `(w_t, dw)`.
    ///
    /// In the torque phase the slip is an input and not an output, so its entry is zero.
    #[inline]
    pub fn influence(&self, phase: Phase, friction: T) -> [T; 2] {
        let torque_per_pressure = friction * self.clutch.lever() * self.clutch.piston_area_m2;
        let rows = self.coefficients(phase);
        let slip = match phase {
            Phase::InertiaPhase => rows.slip_oncoming.per_oncoming_torque,
            _ => T::zero(),
        };
        [rows.turbine.per_oncoming_torque * torque_per_pressure, slip * torque_per_pressure]
    }

    /// Turbine torque and load at the gearbox output, N m, Eq. (2.11) and (2.16).
    #[inline]
    pub fn known_torques(&self, engine_rad_s: T, turbine_rad_s: T, slip_rad_s: T) -> ShiftTorques<T> {
        let output = self.shift.output_speed(turbine_rad_s, slip_rad_s);
        ShiftTorques {
            turbine_n_m: self.converter.torques(engine_rad_s, turbine_rad_s).turbine_n_m,
            offgoing_n_m: T::zero(),
            oncoming_n_m: T::zero(),
            output_n_m: self.driveline.rigid_output_load(&self.road, output),
        }
    }

    /// `F` and `G` at these speeds, Eq. (2.18), (2.23), (2.25), (2.26). The clutch drives its slower side,
    /// so both change sign with the slip.
    #[inline]
    pub fn speed_model(&self, phase: Phase, engine_rad_s: T, turbine_rad_s: T, slip_rad_s: T) -> SpeedModel<T> {
        let (coefficient, direction) = (self.clutch.friction.at(slip_rad_s.abs()), direction(slip_rad_s));
        let friction = coefficient * direction;
        let mut torques = self.known_torques(engine_rad_s, turbine_rad_s, slip_rad_s);
        torques.oncoming_n_m = -friction * self.clutch.lever() * self.clutch.return_spring_n;
        let rows = self.coefficients(phase);
        let slip = match phase {
            Phase::InertiaPhase => rows.slip_oncoming.at(&torques),
            _ => T::zero(),
        };
        SpeedModel {
            free_rad_s2: [rows.turbine.at(&torques), slip],
            per_pressure_rad_s2_pa: self.influence(phase, friction),
            friction: coefficient,
            direction,
        }
    }

    /// Torque of the oncoming clutch at this pressure, N m: Eq. (2.13) while it slips; once it is locked
    /// the torque the gear train asks of it, up to what it can hold.
    #[inline]
    pub fn clutch_torque(&self, phase: Phase, pressure_pa: T, engine_rad_s: T, turbine_rad_s: T, slip_rad_s: T) -> T {
        if phase == Phase::AfterShift {
            let known = self.known_torques(engine_rad_s, turbine_rad_s, slip_rad_s);
            let limit = self.clutch.static_capacity(pressure_pa);
            return self.after_shift.holding_oncoming.at(&known).at_least(-limit).at_most(limit);
        }
        self.clutch.torque_capacity(pressure_pa, slip_rad_s) * direction(slip_rad_s)
    }

    /// The same model in another precision.
    pub fn cast<U: Real>(&self) -> RigidModel<U> {
        let shift = self.shift.cast();
        RigidModel {
            shift,
            torque_phase: shift.coefficients(Engagement::OffgoingStuck),
            inertia_phase: shift.coefficients(Engagement::BothSlipping),
            after_shift: shift.coefficients(Engagement::OncomingStuck),
            converter: self.converter.cast(),
            clutch: self.clutch.cast(),
            valve: self.valve.cast(),
            road: self.road.cast(),
            driveline: self.driveline.cast(),
        }
    }
}
