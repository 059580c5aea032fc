//! From the gearbox output to the driven wheels.

use crate::{Real, RoadLoad};

/// Differential and the two elastic drive shafts, seen as one spring and damper at the wheel.
///
/// Sign: twist is gearbox side minus wheel side; a positive torque drives the wheels.
#[derive(Debug, Clone, Copy, PartialEq)]
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
