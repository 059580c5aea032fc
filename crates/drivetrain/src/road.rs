//! Road load of the vehicle.

use crate::Real;

/// Standard gravity, m/s^2.
pub const GRAVITY_M_S2: f64 = 9.806_65;
/// Speed, rad/s at the wheel, over which the rolling resistance turns around at standstill.
const ROLLING_TURN_RAD_S: f64 = 0.5;

/// Aerodynamic drag, grade and rolling resistance of the vehicle.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RoadLoad<T> {
    /// Mass `m` of the vehicle, kg.
    pub mass_kg: T,
    /// Rolling radius `R_w`, m.
    pub wheel_radius_m: T,
    /// Front area `A_A`, m^2.
    pub front_area_m2: T,
    /// Drag coefficient `C_D`.
    pub drag_coefficient: T,
    /// Density of air, kg/m^3.
    pub air_density_kg_m3: T,
    /// Rolling resistance moment `T_w` of the tyres, N m.
    pub rolling_moment_n_m: T,
    /// Road grade `theta_g`, rad, positive uphill.
    pub grade_rad: T,
}

impl<T: Real> RoadLoad<T> {
    /// `C_A = 0.5 rho C_D A_A`, kg/m.
    #[inline]
    pub fn drag_factor(&self) -> T {
        T::of(0.5) * self.air_density_kg_m3 * self.drag_coefficient * self.front_area_m2
    }

    /// Aerodynamic drag `F_A`, N, against the motion.
    #[inline]
    pub fn drag_force(&self, vehicle_m_s: T) -> T {
        self.drag_factor() * vehicle_m_s * vehicle_m_s.abs()
    }

    /// Grade force `F_G = m g sin(theta_g)`, N.
    pub fn grade_force(&self) -> T {
        self.mass_kg * T::of(GRAVITY_M_S2) * self.grade_rad.sin()
    }

    /// Rolling moment at the wheel, N m: `T_w`, turned around smoothly at standstill.
    ///
    /// The rolling resistance is no dry contact that could hold a car on a hill, so it passes through
    /// zero with the speed instead of sticking.
    #[inline]
    pub fn rolling_moment(&self, wheel_rad_s: T) -> T {
        let turned = wheel_rad_s / T::of(ROLLING_TURN_RAD_S);
        // Beyond 20 the hyperbolic tangent is 1 to the last bit of a double.
        let fraction = if turned.abs() > T::of(20.0) { turned.signum() } else { turned.tanh() };
        self.rolling_moment_n_m * fraction
    }

    /// Resisting torque at the wheel on a level road with a gripping tyre, N m, Eq. (2.62b):
    /// `T_l = T_w + C_A R_w^3 w_w^2`.
    #[inline]
    pub fn wheel_torque(&self, wheel_rad_s: T) -> T {
        let radius = self.wheel_radius_m;
        self.rolling_moment(wheel_rad_s) + self.drag_force(radius * wheel_rad_s) * radius
    }

    /// The vehicle's mass as an inertia at the wheel, kg m^2: `m R_w^2`.
    pub fn inertia_at_wheel(&self) -> T {
        self.mass_kg * self.wheel_radius_m * self.wheel_radius_m
    }

    /// The same load in another precision.
    pub fn cast<U: Real>(&self) -> RoadLoad<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        RoadLoad {
            mass_kg: to(self.mass_kg),
            wheel_radius_m: to(self.wheel_radius_m),
            front_area_m2: to(self.front_area_m2),
            drag_coefficient: to(self.drag_coefficient),
            air_density_kg_m3: to(self.air_density_kg_m3),
            rolling_moment_n_m: to(self.rolling_moment_n_m),
            grade_rad: to(self.grade_rad),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rolling_and_air_resist_at_the_wheel_and_turn_with_the_motion() {
        let road = RoadLoad {
            mass_kg: 1500.0,
            wheel_radius_m: 0.3,
            front_area_m2: 2.0,
            drag_coefficient: 0.4,
            air_density_kg_m3: 1.25,
            rolling_moment_n_m: 60.0,
            grade_rad: 0.1,
        };
        // 60 N m + 0.5 kg/m * (0.3 m)^3 * (80 rad/s)^2; the grade has no part in it.
        let expected = 60.0 + 0.5 * 0.027 * 6400.0;
        assert!((road.wheel_torque(80.0_f64) - expected).abs() < 1e-9);
        assert!((road.wheel_torque(-80.0_f64) + expected).abs() < 1e-9);
    }
}
