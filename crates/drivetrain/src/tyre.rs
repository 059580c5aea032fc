//! The driven tyres.

use crate::Real;

/// Longitudinal tyre force `F_x = F_xmax tanh(2 S_x / ds_x)`.
///
/// `S_x = (R_w w_w - v) / max(|R_w w_w|, |v|, v_floor)`. Below the floor speed the slip is counted
/// against the floor, so that the force stays defined at standstill. Left out: the decline of the
/// force past its peak and the tyre's relaxation length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tyre<T> {
    /// Largest force `F_xmax` of the driven axle, N.
    pub max_force_n: T,
    /// Slip scale `ds_x`.
    pub slip_scale: T,
    /// Floor of the reference speed, m/s.
    pub floor_m_s: T,
}

impl<T: Real> Tyre<T> {
    /// Longitudinal slip `S_x` at this circumferential and vehicle speed.
    #[inline]
    pub fn slip(&self, rim_m_s: T, vehicle_m_s: T) -> T {
        (rim_m_s - vehicle_m_s) / rim_m_s.abs().at_least(vehicle_m_s.abs()).at_least(self.floor_m_s)
    }

    /// How fast the force rises with the speed of the rim, N s/m, at a constant reference speed, where it is
    /// `force_n`.
    pub fn damping(&self, rim_m_s: T, vehicle_m_s: T, force_n: T) -> T {
        let reference = rim_m_s.abs().at_least(vehicle_m_s.abs()).at_least(self.floor_m_s);
        let saturation = force_n / self.max_force_n;
        self.max_force_n * T::of(2.0) / (self.slip_scale * reference) * (T::one() - saturation * saturation)
    }

    /// Force on the vehicle, N, positive when it drives.
    #[inline]
    pub fn force(&self, rim_m_s: T, vehicle_m_s: T) -> T {
        let doubled = T::of(4.0) * self.slip(rim_m_s, vehicle_m_s) / self.slip_scale;
        // tanh(x) by exp(-2|x|), which costs half of the library's tanh; that one is exact to the last digit
        // for tiny x too, where there is no force to speak of.
        let decay = (-doubled.abs()).exp();
        self.max_force_n * ((T::one() - decay) / (T::one() + decay)).copysign(doubled)
    }

    /// Speed of the vehicle, m/s, at which a rim of this speed has this force; up to 95 % of the largest one.
    pub fn vehicle_speed(&self, rim_m_s: T, force_n: T) -> T {
        let most = T::of(0.95);
        let part = (force_n / self.max_force_n).max(-most).min(most);
        let slip = T::of(0.25) * self.slip_scale * ((T::one() + part) / (T::one() - part)).ln();
        let driven = rim_m_s - slip * rim_m_s.abs().at_least(self.floor_m_s);
        // Against a slower rim the slip is counted in the speed of the vehicle.
        let is_slower = rim_m_s * force_n < T::zero() && driven.abs() > self.floor_m_s;
        if is_slower { rim_m_s / (T::one() - slip.abs()) } else { driven }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TYRE: Tyre<f64> = Tyre { max_force_n: 13_200.0, slip_scale: 0.1, floor_m_s: 2.0 };

    #[test]
    fn the_force_saturates_and_brakes_as_it_drives() {
        assert!(TYRE.force(20.0, 10.0) > 0.999 * TYRE.max_force_n);
        assert_eq!(TYRE.force(9.9, 10.0), -TYRE.force(10.0, 9.9));
        assert_eq!(TYRE.force(0.0, 0.0), 0.0);
    }

    #[test]
    fn the_vehicle_speed_is_that_of_the_force() {
        for (rim, vehicle) in
            [(10.1, 10.0), (9.9, 10.0), (-10.1, -10.0), (-9.9, -10.0), (1.0, 0.95), (0.5, 0.55), (20.0, 20.0)]
        {
            let found = TYRE.vehicle_speed(rim, TYRE.force(rim, vehicle));
            assert!((found - vehicle).abs() < 1e-9, "{rim} {vehicle} {found}");
        }
        assert!(TYRE.vehicle_speed(10.0, 1e9).is_finite());
    }

    #[test]
    fn the_damping_is_the_slope_of_the_force() {
        // Below the floor and against a faster vehicle the reference does not depend on the rim.
        for (rim, vehicle) in [(0.5, 0.3), (9.7, 10.0)] {
            let slope = (TYRE.force(rim + 1e-6, vehicle) - TYRE.force(rim - 1e-6, vehicle)) / 2e-6;
            let damping = TYRE.damping(rim, vehicle, TYRE.force(rim, vehicle));
            assert!((damping / slope - 1.0).abs() < 1e-6);
        }
    }
}
