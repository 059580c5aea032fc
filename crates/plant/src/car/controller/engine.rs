//! The engine in a shift: what is let through of the torque that the driver asks for, and what comes of it at the turbine when the
//! clutches answer.
//!
//! A clutch answers to its command after the delays of reading, controller and valve. A torque that rises faster than that makes the
//! turbine run away. So a pedal that is moved in a shift is followed at a limited rate, and the clutches are commanded for the torque
//! that will be there when they answer:
//!
//! ```text
//! T_t(t + lead) = T_t(t) + T_e(t + lead) - T_e(t)
//! ```
//!
//! with the engine torque `T_e` that the limited rate allows.

use car::Car;

use super::{CarCalibration, CarMeasured};

/// What a shift asks of the engine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct EngineRequest {
    /// Fraction of the torque that the driver asks for.
    pub(super) fraction: f64,
    /// Torque in addition to that, N m: negative in an upshift, positive in a downshift.
    pub(super) added_n_m: f64,
}

/// What the engine is to do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct EngineCommand {
    /// Fraction of the torque that the driver asks for.
    pub(super) fraction: f64,
    /// Throttle at least, 0 to 1: more than the driver's for more torque than he asks for.
    pub(super) throttle: f64,
}

/// The engine as the shift controller asks for it.
#[derive(Debug, Clone)]
pub(super) struct EngineControl {
    /// Fraction of the torque by the stage of the shift.
    stage_fraction: f64,
    /// Torque in addition, N m.
    added_n_m: f64,
    /// Torque that is let through, N m, and that it will be.
    passed_n_m: f64,
    expected_n_m: f64,
    is_limited: bool,
}

impl EngineControl {
    pub(super) fn new() -> Self {
        Self { stage_fraction: 1.0, added_n_m: 0.0, passed_n_m: 0.0, expected_n_m: 0.0, is_limited: false }
    }

    /// The command for the next period; `request` is what the stage of the shift wants, `None` without a shift.
    pub(super) fn step(
        &mut self,
        (car, c): (&Car, &CarCalibration),
        throttle: f64,
        request: Option<EngineRequest>,
        measured: &CarMeasured,
    ) -> EngineCommand {
        let period_s = c.control_period_s;
        let step = period_s / c.engine_ramp_s;
        let fraction = request.map_or(1.0, |request| request.fraction);
        self.stage_fraction += (fraction - self.stage_fraction).clamp(-step, step);
        let driver_n_m = car.engine.torque(measured.engine_rad_s, throttle);
        let fullest_n_m = car.engine.torque(measured.engine_rad_s, 1.0);
        let asked_n_m = if driver_n_m > 0.0 { driver_n_m * self.stage_fraction } else { driver_n_m };
        let added_n_m = request.map_or(0.0, |request| request.added_n_m);
        let added_step_n_m = step * fullest_n_m.max(0.0);
        self.added_n_m += (added_n_m - self.added_n_m).clamp(-added_step_n_m, added_step_n_m);
        let asked_n_m = match self.added_n_m {
            more if more > 0.0 => (asked_n_m + more).min(fullest_n_m.max(asked_n_m)),
            less if less < 0.0 => (asked_n_m + less).max((c.up_engine_fraction * driver_n_m).min(asked_n_m)),
            _ => asked_n_m,
        };
        let rise_n_m_s = fullest_n_m.max(0.0) / c.tip_in_s;
        let max_n_m = |after_s: f64, from_n_m: f64| from_n_m.max(0.0) + rise_n_m_s * after_s;
        let at_once_n_m = max_n_m(period_s, self.passed_n_m);
        // After the shift until the driver has what he asks for.
        self.is_limited = request.is_some() || (self.is_limited && asked_n_m > at_once_n_m);
        self.passed_n_m = if self.is_limited { asked_n_m.min(at_once_n_m) } else { asked_n_m };
        self.expected_n_m = asked_n_m.min(max_n_m(c.lead_s, self.passed_n_m));
        if self.passed_n_m > driver_n_m {
            let throttle = throttle_for(car, measured.engine_rad_s, self.passed_n_m, throttle);
            return EngineCommand { fraction: 1.0, throttle };
        }
        let fraction = if driver_n_m > 0.0 { self.passed_n_m / driver_n_m } else { 1.0 };
        EngineCommand { fraction, throttle: 0.0 }
    }

    /// Torque of the engine less its drag, N m.
    pub(super) fn torque_n_m(&self, car: &Car, measured: &CarMeasured) -> f64 {
        self.passed_n_m - car.engine.drag_n_m_s * measured.engine_rad_s
    }

    /// Torque on the gearbox input when a clutch answers to a command of now, N m, by the nominal maps.
    pub(super) fn turbine_n_m(&self, car: &Car, measured: &CarMeasured) -> f64 {
        let (engine, turbine) = (measured.engine_rad_s, measured.turbine_rad_s);
        let Some(converter) = &car.converter else {
            return self.expected_n_m - car.engine.drag_n_m_s * turbine;
        };
        converter.torques(engine, turbine).turbine_n_m + self.expected_n_m - self.passed_n_m
    }
}

/// Throttle at which the engine has a torque, N m, from the driver's throttle on.
fn throttle_for(car: &Car, engine_rad_s: f64, torque_n_m: f64, throttle: f64) -> f64 {
    /// Halves the range of the throttle to less than 1e-4.
    const HALVINGS: u32 = 14;
    let halved = |[low, high]: [f64; 2], _| {
        let middle = 0.5 * (low + high);
        if car.engine.torque(engine_rad_s, middle) < torque_n_m { [middle, high] } else { [low, middle] }
    };
    let [low, high] = (0..HALVINGS).fold([throttle.min(1.0), 1.0], halved);
    0.5 * (low + high)
}
