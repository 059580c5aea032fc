//! Launch and creep of a car without a converter: the clutch of the gear slips until the gearbox is as fast as the engine.
//!
//! With the engine's torque `T_e` and inertia `I_e`, the clutch takes what holds the engine near a speed `w*` that rises with
//! the throttle: `T = T_e - I_e k (w* - w_e)`. Without throttle it takes the creep torque, less with the brake.

use car::Car;

use super::pressure::Controlled;
use super::{CarCalibration, CarMeasured};
use crate::car::start::{IDLE_RAD_S, idle_throttle};
use crate::fast_fill::StrokeModel;

/// A clutch that slips between engine and gearbox.
#[derive(Debug, Clone)]
pub(super) struct Launch {
    clutch: Controlled,
    /// Torque that is asked of it, N m.
    torque_n_m: f64,
    /// When its fill began, s, while it is filled.
    filled_since_s: Option<f64>,
    /// Since when it has no slip, s.
    locked_since_s: Option<f64>,
}

impl Launch {
    /// The clutch of this gear, open. `None` if the gear has none.
    pub(super) fn of(car: &Car, gear: usize) -> Option<Self> {
        let gear = car.gearbox.gears.get(gear)?;
        let clutch = |holding: &geartrain::Holding| {
            let alpha = 1.0 / holding.per_turbine_torque;
            let clutch = car.clutches.get(holding.element).copied().flatten()?;
            Some(Controlled::new(holding.element, Some(clutch), [alpha, -alpha * gear.ratio], 0.0))
        };
        let clutch = gear.holding.iter().find_map(clutch)?;
        Some(Self { clutch, torque_n_m: 0.0, filled_since_s: None, locked_since_s: None })
    }

    /// Its place among the elements.
    pub(super) fn element(&self) -> usize {
        self.clutch.element
    }

    /// Its place among the elements, and the command of its valve, A or %.
    pub(super) fn step(
        &mut self,
        (car, c): (&Car, &CarCalibration),
        time_s: f64,
        throttle: f64,
        measured: &CarMeasured,
        piston: Option<&StrokeModel>,
    ) -> (usize, f64) {
        let engine_rad_s = measured.turbine_rad_s;
        let slip = self.clutch.slip_at_turbine(engine_rad_s, measured.output_rad_s);
        let pedal = if throttle > idle_throttle(engine_rad_s) { throttle } else { 0.0 };
        let free_n_m = car.engine.torque(engine_rad_s, throttle) - car.engine.drag_n_m_s * engine_rad_s;
        let wanted = if pedal > 0.0 {
            let target = IDLE_RAD_S + (c.launch_rad_s * pedal).min(c.launch_max_rad_s);
            free_n_m - car.engine.inertia_kg_m2 * c.launch_per_s * (target - engine_rad_s)
        } else {
            c.creep_n_m * (1.0 - measured.brake / c.creep_brake).max(0.0)
        };
        // An engine below its idle speed gives way.
        let maximum = c.stall_n_m_s_rad * (engine_rad_s - IDLE_RAD_S + c.stall_rad_s);
        let wanted = wanted.clamp(0.0, maximum.max(0.0));
        if let Some(pressure_pa) = self.filling_pa((car, c), time_s, wanted, piston) {
            return (self.clutch.element, self.clutch.valve_command(pressure_pa));
        }
        let step_n_m = c.launch_n_m_s * c.control_period_s;
        self.torque_n_m += (wanted - self.torque_n_m).clamp(-4.0 * step_n_m, step_n_m);
        self.locked_since_s = if slip.abs() < c.lock_slip_rad_s { self.locked_since_s.or(Some(time_s)) } else { None };
        let waiting_pa = (self.clutch.kiss_pa() - c.below_kiss_pa).max(0.0);
        let pressure_pa =
            if self.torque_n_m > 0.0 { self.clutch.pressure_for(self.torque_n_m, slip) } else { waiting_pa };
        let pressure_pa = self.clutch.lead(c, pressure_pa, car.line_pressure_pa, 0.0);
        (self.clutch.element, self.clutch.valve_command(pressure_pa))
    }

    /// Pressure while an open clutch whose piston has a stroke is filled for a torque that is wanted, Pa; else `None`.
    fn filling_pa(
        &mut self,
        (car, c): (&Car, &CarCalibration),
        time_s: f64,
        wanted_n_m: f64,
        piston: Option<&StrokeModel>,
    ) -> Option<f64> {
        if wanted_n_m <= 0.0 || self.torque_n_m > 0.0 {
            self.filled_since_s = None;
            return None;
        }
        let since_s = match self.filled_since_s {
            Some(since_s) => since_s,
            None => {
                self.clutch = self.clutch.clone().filled_from(Some(piston?), c);
                *self.filled_since_s.insert(time_s)
            }
        };
        let plan = self.clutch.fill?;
        let elapsed_s = time_s - since_s;
        let lasts_s = plan.duration_s().max(plan.arrival_s);
        (elapsed_s < lasts_s).then(|| self.clutch.without_lead(c, plan.pressure(elapsed_s), car.line_pressure_pa))
    }

    /// Whether it has had no slip for a while at a speed that the engine can turn at.
    pub(super) fn is_over(&self, c: &CarCalibration, time_s: f64, measured: &CarMeasured) -> bool {
        let holds = self.locked_since_s.is_some_and(|since_s| time_s - since_s >= c.launch_lock_s);
        holds && self.clutch.ratio * measured.output_rad_s > c.launch_open_rad_s
    }
}
