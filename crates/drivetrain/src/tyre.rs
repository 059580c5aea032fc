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
        (rim_m_s - vehicle_m_s) / rim_m_s.abs().max(vehicle_m_s.abs()).max(self.floor_m_s)
    }

    /// Force on the vehicle, N, positive when it drives.
    #[inline]
    pub fn force(&self, rim_m_s: T, vehicle_m_s: T) -> T {
        self.max_force_n * (T::of(2.0) * self.slip(rim_m_s, vehicle_m_s) / self.slip_scale).tanh()
    }
}
