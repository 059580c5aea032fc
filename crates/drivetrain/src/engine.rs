//! The engine: a torque map and a rotating mass.

use crate::{Real, Table2};

/// Engine with a steady-state torque map, `I_e dw_e/dt + C_e w_e = T_e(w_e, theta_th) - T_p`, Eq. (2.3).
///
/// Left out: manifold filling and combustion delay; the map answers a throttle change at once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Engine<T> {
    /// Inertia of crank and pump wheel, kg m^2.
    pub inertia_kg_m2: T,
    /// Viscous drag `C_e`, N m s/rad.
    pub drag_n_m_s: T,
    /// Torque over speed (rows, rad/s) and throttle (columns, 0 closed to 1 open), N m.
    pub torque_n_m: Table2<T>,
}

impl<T: Real> Engine<T> {
    /// Torque of combustion and pumping at the crank, N m.
    #[inline]
    pub fn torque(&self, speed_rad_s: T, throttle: T) -> T {
        self.torque_n_m.at(speed_rad_s, throttle)
    }

    /// Largest torque of the map, N m.
    pub fn largest_torque(&self) -> T {
        let (speeds, throttles) = (self.torque_n_m.rows(), self.torque_n_m.columns());
        let all = speeds.iter().flat_map(|speed| throttles.iter().map(|throttle| self.torque(*speed, *throttle)));
        all.fold(T::neg_infinity(), |largest, torque| largest.at_least(torque))
    }

    /// Angular acceleration against the pump torque, rad/s^2, Eq. (2.3).
    #[inline]
    pub fn acceleration(&self, speed_rad_s: T, torque_n_m: T, pump_torque_n_m: T) -> T {
        (torque_n_m - pump_torque_n_m - self.drag_n_m_s * speed_rad_s) / self.inertia_kg_m2
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn torque_less_pump_torque_and_drag_accelerates_the_inertia() {
        let torque_n_m = Table2::new(&[0.0, 400.0], &[0.0, 1.0], &[[0.0, 200.0], [0.0, 160.0]]).unwrap();
        let engine = Engine { inertia_kg_m2: 0.2, drag_n_m_s: 0.05, torque_n_m };
        let torque = engine.torque(100.0, 0.5);
        assert_eq!(torque, 95.0);
        assert_eq!(engine.largest_torque(), 200.0);
        // (95 - 40 - 5) N m on 0.2 kg m^2.
        assert_eq!(engine.acceleration(100.0, torque, 40.0), 250.0);
    }
}
