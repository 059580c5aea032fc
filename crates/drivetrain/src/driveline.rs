//! From the gearbox output to the driven wheels.

use crate::{Real, RoadLoad};

/// Differential and the two elastic drive shafts, seen as one spring and damper at the wheel.
///
/// Sign: twist is gearbox side minus wheel side; a positive torque drives the wheels.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Driveline<T> {
    /// Gear ratio `i_df` of the differential.
    pub final_ratio: T,
    /// Stiffness `K_s` of both shafts together, N m/rad.
    pub shaft_stiffness_n_m_rad: T,
    /// Damping `C_s` of both shafts together, N m s/rad.
    pub shaft_damping_n_m_s_rad: T,
    /// Inertia `I_w` of the driven wheels, kg m^2.
    pub wheel_inertia_kg_m2: T,
}

impl<T: Real> Driveline<T> {
    /// Rate of twist, rad/s: `w_0/i_df - w_w`.
    #[inline]
    pub fn twist_rate(&self, output_rad_s: T, wheel_rad_s: T) -> T {
        output_rad_s / self.final_ratio - wheel_rad_s
    }

    /// Torque of the drive shafts, N m: `T_s = K_s theta_s + C_s (w_0/i_df - w_w)`.
    #[inline]
    pub fn shaft_torque(&self, twist_rad: T, twist_rate_rad_s: T) -> T {
        self.shaft_stiffness_n_m_rad * twist_rad + self.shaft_damping_n_m_s_rad * twist_rate_rad_s
    }

    /// Twist of the springs where the shafts turn freely over a gap of `backlash_rad` at the wheel, rad, and `None` in the
    /// gap: the twist beyond its nearer edge. The gap lies evenly around zero.
    #[inline]
    pub fn spring_twist(twist_rad: T, backlash_rad: T) -> Option<T> {
        let beyond = twist_rad.abs() - T::of(0.5) * backlash_rad;
        (beyond >= T::zero()).then(|| beyond * twist_rad.signum())
    }

    /// Torque of the drive shafts with backlash, N m: none in the gap, and beyond it that of spring and damper, of which
    /// the damper cannot pull: teeth that part carry nothing. Without backlash it is [`Self::shaft_torque`].
    #[inline]
    pub fn shaft_torque_with_backlash(&self, twist_rad: T, twist_rate_rad_s: T, backlash_rad: T) -> T {
        if backlash_rad <= T::zero() {
            return self.shaft_torque(twist_rad, twist_rate_rad_s);
        }
        match Self::spring_twist(twist_rad, backlash_rad) {
            None => T::zero(),
            Some(twist) => {
                let torque = self.shaft_torque(twist, twist_rate_rad_s);
                if twist_rad > T::zero() { torque.at_least(T::zero()) } else { torque.at_most(T::zero()) }
            }
        }
    }

    /// Inertia of the vehicle body at the gearbox output, kg m^2: `I_ve = m R_w^2 / i_df^2`.
    pub fn vehicle_inertia_at_output(&self, road: &RoadLoad<T>) -> T {
        road.inertia_at_wheel() / (self.final_ratio * self.final_ratio)
    }

    /// Resisting torque at the gearbox output with rigid shafts and gripping tyres, N m, Eq. (2.16):
    /// `T_ve = T_w/R_df + C_A R_w^3 w_0^2 / R_df^3`.
    #[inline]
    pub fn rigid_output_load(&self, road: &RoadLoad<T>, output_rad_s: T) -> T {
        road.wheel_torque(output_rad_s / self.final_ratio) / self.final_ratio
    }

    /// The same driveline in another precision.
    pub fn cast<U: Real>(&self) -> Driveline<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        Driveline {
            final_ratio: to(self.final_ratio),
            shaft_stiffness_n_m_rad: to(self.shaft_stiffness_n_m_rad),
            shaft_damping_n_m_s_rad: to(self.shaft_damping_n_m_s_rad),
            wheel_inertia_kg_m2: to(self.wheel_inertia_kg_m2),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHAFTS: Driveline<f64> = Driveline {
        final_ratio: 3.0,
        shaft_stiffness_n_m_rad: 13e3,
        shaft_damping_n_m_s_rad: 20.0,
        wheel_inertia_kg_m2: 1.0,
    };

    #[test]
    fn shafts_carry_no_torque_in_the_gap_and_never_pull_beyond_it() {
        let torque = |twist, rate| SHAFTS.shaft_torque_with_backlash(twist, rate, 0.03);
        for rate in [-5.0, 0.0, 5.0] {
            assert_eq!([-0.0149, 0.0, 0.0149].map(|twist| torque(twist, rate)), [0.0; 3]);
        }
        assert!((torque(0.025, 0.0) - 130.0).abs() < 1e-9 && (torque(-0.025, 0.0) + 130.0).abs() < 1e-9);
        assert!((torque(0.025, 1.0) - 150.0).abs() < 1e-9);
        assert_eq!((torque(0.0151, -5.0), torque(-0.0151, 5.0)), (0.0, 0.0));
        // What the damper takes is never negative.
        for twist in [-0.02, -0.0151, 0.0151, 0.02] {
            for rate in [-7.0, -0.1, 0.1, 7.0] {
                let spring = SHAFTS.shaft_stiffness_n_m_rad * Driveline::spring_twist(twist, 0.03).unwrap();
                assert!((torque(twist, rate) - spring) * rate >= 0.0, "{twist} {rate}");
            }
        }
    }

    #[test]
    fn without_backlash_the_shafts_are_spring_and_damper() {
        for (twist, rate) in [(0.01, -9.0), (-0.003, 0.5), (0.0, 2.0)] {
            assert_eq!(SHAFTS.shaft_torque_with_backlash(twist, rate, 0.0), SHAFTS.shaft_torque(twist, rate));
        }
    }

    #[test]
    fn the_load_at_the_output_is_rolling_and_air_through_the_final_ratio() {
        let line = Driveline {
            final_ratio: 3.0,
            shaft_stiffness_n_m_rad: 1.0,
            shaft_damping_n_m_s_rad: 0.0,
            wheel_inertia_kg_m2: 1.0,
        };
        let road = RoadLoad {
            mass_kg: 1500.0,
            wheel_radius_m: 0.3,
            front_area_m2: 2.0,
            drag_coefficient: 0.4,
            air_density_kg_m3: 1.25,
            rolling_moment_n_m: 60.0,
            grade_rad: 0.0,
        };
        // C_A = 0.5 * 1.25 * 0.4 * 2 = 0.5 kg/m; T_w/i + C_A (R w_0/i)^2 R/i.
        let expected = 60.0 / 3.0 + 0.5 * 0.3_f64.powi(3) * 240.0 * 240.0 / 27.0;
        assert!((line.rigid_output_load(&road, 240.0) - expected).abs() < 1e-9);
    }
}
