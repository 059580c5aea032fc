//! The wet multi-plate clutch.

use crate::{Real, Table1};

/// A hydraulically applied wet clutch with a return spring.
///
/// Sign: slip is input side minus output side; a positive torque drives the output side. Left out:
/// the drag of the open clutch ([`drag_torque`]), heat, and the time oil needs to leave the plates.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Clutch<T> {
    /// Effective radius `R` of the friction force, m.
    pub mean_radius_m: T,
    /// Number `N` of friction faces.
    pub friction_faces: T,
    /// Piston area `A`, m^2.
    pub piston_area_m2: T,
    /// Force `F_s` of the return spring, N.
    pub return_spring_n: T,
    /// Friction coefficient `mu` over slip speed `|dw|`, rad/s.
    pub friction: Table1<T>,
    /// Friction coefficient that holds the clutch while it sticks.
    pub static_friction: T,
}

/// The direction in which a clutch that slips drives its output side: the sign of the slip.
#[inline]
pub fn direction<T: Real>(slip_rad_s: T) -> T {
    if slip_rad_s < T::zero() { -T::one() } else { T::one() }
}

/// Slip speed at which the drag of an open clutch is largest, rad/s \[chosen\]: above it the oil film breaks.
pub const DRAG_PEAK_RAD_S: f64 = 60.0;

/// Drag of the oil between open plates, N m, with the sign of the slip: `2 T_pk x / (1 + x^2)`, `x = dw/w_pk`. Hot oil has a
/// peak `T_pk` of about 1 N m, oil of 20 degC about 8 N m.
#[inline]
pub fn drag_torque<T: Real>(peak_n_m: T, slip_rad_s: T) -> T {
    let x = slip_rad_s / T::of(DRAG_PEAK_RAD_S);
    T::of(2.0) * peak_n_m * x / (T::one() + x * x)
}

impl<T: Real> Clutch<T> {
    /// Pressure at which the plates touch, Pa: `F_s / A`.
    pub fn kiss_pressure(&self) -> T {
        self.return_spring_n / self.piston_area_m2
    }

    /// Torque per clamp force, m: `mu(|dw|) R N`.
    #[inline]
    pub fn torque_per_force(&self, slip_rad_s: T) -> T {
        self.friction.at(slip_rad_s.abs()) * self.lever()
    }

    /// Friction-free part of the torque law, m: `R N`.
    #[inline]
    pub fn lever(&self) -> T {
        self.mean_radius_m * self.friction_faces
    }

    /// Force that presses the plates together, N: `max(A p - F_s, 0)`.
    #[inline]
    pub fn clamp_force(&self, pressure_pa: T) -> T {
        (self.piston_area_m2 * pressure_pa - self.return_spring_n).at_least(T::zero())
    }

    /// Size of the torque the slipping clutch carries, N m: `mu(|dw|) R N max(A p - F_s, 0)`, Eq. (2.13).
    #[inline]
    pub fn torque_capacity(&self, pressure_pa: T, slip_rad_s: T) -> T {
        let clamp_force = self.clamp_force(pressure_pa);
        // An open clutch needs no look into the friction table; most of a drive one of them is open.
        if clamp_force > T::zero() { self.torque_per_force(slip_rad_s) * clamp_force } else { T::zero() }
    }

    /// Largest torque that the sticking clutch holds, N m.
    #[inline]
    pub fn static_capacity(&self, pressure_pa: T) -> T {
        self.static_friction * self.lever() * self.clamp_force(pressure_pa)
    }

    /// Pressure at which the slipping clutch carries `torque_n_m`, Pa: the inverse of Eq. (2.13).
    pub fn pressure_for(&self, torque_n_m: T, slip_rad_s: T) -> T {
        (torque_n_m.abs() / self.torque_per_force(slip_rad_s) + self.return_spring_n) / self.piston_area_m2
    }

    /// The same clutch in another precision.
    pub fn cast<U: Real>(&self) -> Clutch<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        Clutch {
            mean_radius_m: to(self.mean_radius_m),
            friction_faces: to(self.friction_faces),
            piston_area_m2: to(self.piston_area_m2),
            return_spring_n: to(self.return_spring_n),
            friction: self.friction.cast(),
            static_friction: to(self.static_friction),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clutch() -> Clutch<f64> {
        Clutch {
            mean_radius_m: 0.13,
            friction_faces: 3.0,
            piston_area_m2: 0.01,
            return_spring_n: 600.0,
            friction: Table1::constant(0.13),
            static_friction: 0.14,
        }
    }

    #[test]
    fn no_torque_below_the_kiss_point() {
        assert_eq!(clutch().kiss_pressure(), 60_000.0);
        assert_eq!(clutch().torque_capacity(59_000.0, 10.0), 0.0);
        assert!(clutch().torque_capacity(61_000.0, 10.0) > 0.0);
    }

    #[test]
    fn the_torque_is_friction_times_lever_times_clamp_force() {
        let friction = Table1::new(&[0.0, 100.0], &[0.12, 0.16]).unwrap();
        let clutch = Clutch { friction, ..clutch() };
        // 0.01 m^2 * 0.4 MPa - 600 N = 3400 N on 0.13 m * 3 faces, at a coefficient of 0.14 half way.
        for slip in [50.0, -50.0] {
            assert!((clutch.torque_capacity(0.4e6, slip) - 0.14 * 0.39 * 3400.0).abs() < 1e-9);
        }
    }

    #[test]
    fn the_drag_has_its_peak_where_it_is_said_and_opposes_the_slip() {
        assert_eq!((drag_torque(8.0, DRAG_PEAK_RAD_S), drag_torque(8.0, -DRAG_PEAK_RAD_S)), (8.0, -8.0));
        assert_eq!(drag_torque(8.0, 0.0), 0.0);
        assert!(drag_torque(8.0, 50.0) < 8.0 && drag_torque(8.0, 70.0) < 8.0);
    }

    #[test]
    fn pressure_for_inverts_the_torque_law() {
        let pressure = clutch().pressure_for(100.0, 50.0);
        assert!((clutch().torque_capacity(pressure, 50.0) - 100.0).abs() < 1e-12);
    }
}
