//! The lock-up clutch of the converter: open, closed by a ramp, or held at a slip.
//!
//! With the engine's torque `T_e` less its drag, the pump's `T_p`, and the slip `s = w_e - w_t`, a slip controller asks for
//!
//! ```text
//! T = T_e - T_p + I_e (k_p (s - s_ref) + k_i integral(s - s_ref))
//! ```
//!
//! The reference has the sign of `T_e - T_p`: in overrun the turbine turns faster than the engine.

use car::{Car, LockUp};

use super::{CarCalibration, CarMeasured};

/// State of its controller.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct LockUpControl {
    /// Fraction of its capacity that it may hold.
    fraction: f64,
    is_closed: bool,
    /// Integral of the slip error, rad.
    integral_rad: f64,
}

impl LockUpControl {
    /// Torque that the clutch is to hold, N m, in this gear; `None` in a shift, whose turbine torque is that of the converter.
    pub(super) fn torque_n_m(
        &mut self,
        (car, c): (&Car, &CarCalibration),
        gear: Option<usize>,
        engine_n_m: f64,
        measured: &CarMeasured,
    ) -> f64 {
        let Some(lock_up) = car.lock_up else { return 0.0 };
        let ratio = |gear: usize| car.gearbox.gears[gear].ratio;
        let is_high = gear.is_some_and(|gear| ratio(gear) > 0.0 && ratio(gear) <= ratio(lock_up.first_gear));
        let slowest = if self.is_closed { lock_up.off_rad_s } else { lock_up.on_rad_s };
        self.is_closed = is_high && measured.turbine_rad_s > slowest;
        let period_s = c.control_period_s;
        let step = if self.is_closed { period_s / lock_up.ramp_s } else { -period_s / c.unlock_s };
        self.fraction = (self.fraction + step).clamp(0.0, 1.0);
        let max_n_m = self.fraction * lock_up.capacity_n_m;
        if lock_up.slip_rad_s > 0.0 {
            self.slipping_n_m((car, c), &lock_up, max_n_m, engine_n_m, measured)
        } else {
            max_n_m
        }
    }

    /// The torque that keeps the slip, N m, at most `max_n_m`.
    fn slipping_n_m(
        &mut self,
        (car, c): (&Car, &CarCalibration),
        lock_up: &LockUp,
        max_n_m: f64,
        engine_n_m: f64,
        measured: &CarMeasured,
    ) -> f64 {
        let Some(converter) = &car.converter else { return 0.0 };
        let (engine, turbine) = (measured.engine_rad_s, measured.turbine_rad_s);
        let surplus = engine_n_m - converter.torques(engine, turbine).pump_n_m;
        let slip = engine - turbine;
        let error = slip - lock_up.slip_rad_s * surplus.signum();
        let inertia = car.engine.inertia_kg_m2;
        let wanted = surplus + inertia * (c.slip_per_s * error + c.slip_per_s2 * self.integral_rad);
        // Friction has the sign of the slip.
        let size = wanted * slip.signum();
        if !self.is_closed || max_n_m <= 0.0 {
            self.integral_rad = 0.0;
        } else if (0.0..max_n_m).contains(&size) {
            self.integral_rad += error * c.control_period_s;
        }
        size.clamp(0.0, max_n_m)
    }
}
