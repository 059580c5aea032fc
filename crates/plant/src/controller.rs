//! The shift controller: commands for both valves and the throttle, from measured speeds.
//!
//! Fill B to its kiss point, by a fast fill if its piston has a stroke, move the load from A to B in coordinated ramps, let B track a falling slip
//! with less throttle, lock it, and bring it to line pressure. The controller knows the gear train, the
//! converter and the static characteristic of its valves, which is measured at the end of production; it
//! does not know pressures, torques, or the present delay and lag of the valves.

use car::{ShiftCalibration, ShiftClutch, Vehicle};
use drivetrain::{Engagement, Real, ShiftCoefficients, ShiftTorques};

use crate::FillPlan;

/// What the controller measures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// Engine speed, rad/s.
    pub engine_rad_s: f64,
    /// Turbine speed, rad/s.
    pub turbine_rad_s: f64,
    /// Gearbox output speed, rad/s.
    pub output_rad_s: f64,
}

/// What the controller commands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Commands {
    /// Throttle, 0 to 1.
    pub throttle: f64,
    /// Command of the offgoing clutch's valve: current in A, or duty cycle in %.
    pub offgoing: f64,
    /// Command of the oncoming clutch's valve: current in A, or duty cycle in %.
    pub oncoming: f64,
}

/// Stage of the shift, as the controller runs it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stage {
    /// In the gear before the shift.
    Before,
    /// The oncoming clutch is filled; holds the time it began, s.
    Fill(f64),
    /// Load transfer; holds the time it began, s.
    TorquePhase(f64),
    /// Slip control.
    InertiaPhase {
        /// Time it began, s.
        since_s: f64,
        /// Slip then, rad/s.
        from_rad_s: f64,
        /// Integral of the slip error, rad.
        error_integral_rad: f64,
        /// Feedforward torque of the period before, N m.
        feedforward_n_m: Option<f64>,
    },
    /// Locked; holds the time it began, s.
    Locked(f64),
}

/// The shift controller.
#[derive(Debug, Clone)]
pub struct ShiftController {
    calibration: ShiftCalibration,
    vehicle: Vehicle,
    torque_phase: ShiftCoefficients<f64>,
    inertia_phase: ShiftCoefficients<f64>,
    /// If the piston of the oncoming clutch has a stroke.
    fill_plan: Option<FillPlan>,
    stage: Stage,
    oncoming_pa: f64,
    throttle_fraction: f64,
}

impl ShiftController {
    /// A controller for this vehicle, in the gear before the shift.
    pub fn new(vehicle: &Vehicle, calibration: ShiftCalibration) -> Self {
        let body = vehicle.driveline.vehicle_inertia_at_output(&vehicle.road);
        let rigid = vehicle.shift.with_output_inertia(body);
        Self {
            calibration,
            torque_phase: rigid.coefficients(Engagement::OffgoingStuck),
            inertia_phase: rigid.coefficients(Engagement::BothSlipping),
            fill_plan: (vehicle.oncoming.has_stroke)
                .then(|| FillPlan::new(&vehicle.oncoming, calibration.fast_fill, calibration.control_period_s)),
            vehicle: vehicle.clone(),
            stage: Stage::Before,
            oncoming_pa: 0.0,
            throttle_fraction: 1.0,
        }
    }

    /// The stage now.
    pub fn stage(&self) -> Stage {
        self.stage
    }

    /// Commands for the period that begins at `time_s`.
    pub fn step(&mut self, time_s: f64, driver_throttle: f64, measured: &Measured) -> Commands {
        self.change_stage(time_s, measured);
        let known = self.known_torques(measured);
        let line_pa = self.calibration.line_pressure_pa;
        let (offgoing_pa, oncoming_pa) = match self.stage {
            Stage::Before => (line_pa, 0.0),
            Stage::Fill(since_s) => self.fill(time_s - since_s, &known),
            Stage::TorquePhase(since_s) => self.transfer(time_s - since_s, measured, &known),
            Stage::InertiaPhase { .. } => (0.0, self.slip_control(time_s, measured, &known)),
            Stage::Locked(since_s) => {
                let fraction = ((time_s - since_s) / self.calibration.lock_ramp_s).min(1.0);
                (0.0, self.oncoming_pa.max(fraction * line_pa))
            }
        };
        self.oncoming_pa = oncoming_pa;
        let command =
            |clutch: &ShiftClutch, pressure_pa: f64| clutch.valve.command_for(pressure_pa.clamp(0.0, line_pa));
        Commands {
            throttle: driver_throttle * self.throttle_fraction(measured),
            offgoing: command(&self.vehicle.offgoing, offgoing_pa),
            oncoming: command(&self.vehicle.oncoming, oncoming_pa),
        }
    }

    fn change_stage(&mut self, time_s: f64, measured: &Measured) {
        let c = &self.calibration;
        let (turbine, output) = (measured.turbine_rad_s, measured.output_rad_s);
        let oncoming_slip = self.vehicle.shift.oncoming_slip(turbine, output);
        let offgoing_slip = self.vehicle.shift.offgoing_slip(turbine, output);
        let fill_s = self.fill_plan.map_or(c.boost_s + c.settle_s, |plan| plan.duration_s());
        // Times are sums of periods; a rounding error must not cost a whole one.
        let passed = |since_s: f64, duration_s: f64| time_s - since_s >= duration_s - 1e-9;
        self.stage = match self.stage {
            Stage::Before if passed(0.0, c.request_s) => Stage::Fill(time_s),
            Stage::Fill(since_s) if passed(since_s, fill_s) => Stage::TorquePhase(time_s),
            Stage::TorquePhase(_) if offgoing_slip.abs() > c.release_slip_rad_s => Stage::InertiaPhase {
                since_s: time_s,
                from_rad_s: oncoming_slip,
                error_integral_rad: 0.0,
                feedforward_n_m: None,
            },
            Stage::InertiaPhase { .. } if oncoming_slip.abs() < c.lock_slip_rad_s => Stage::Locked(time_s),
            same => same,
        };
    }

    /// Turbine torque from the converter's maps and what was learnt, and load of a level road, N m.
    fn known_torques(&self, measured: &Measured) -> ShiftTorques<f64> {
        let v = &self.vehicle;
        let mapped = v.converter.torques(measured.engine_rad_s, measured.turbine_rad_s).turbine_n_m;
        ShiftTorques {
            turbine_n_m: self.calibration.torque_factor * mapped,
            output_n_m: v.driveline.rigid_output_load(&v.road, measured.output_rad_s),
            ..ShiftTorques::default()
        }
    }

    /// Offgoing pressure that holds the gear while the oncoming clutch carries `oncoming_n_m`, Pa.
    fn holding_pressure(&self, known: &ShiftTorques<f64>, oncoming_n_m: f64, margin: f64) -> f64 {
        let torques = ShiftTorques { oncoming_n_m, ..*known };
        let holding = self.torque_phase.holding_offgoing.at(&torques).max(0.0);
        self.vehicle.offgoing.clutch.pressure_for(margin * holding, 0.0)
    }

    /// Pressures in the fill stage (offgoing, oncoming), Pa.
    fn fill(&self, elapsed_s: f64, known: &ShiftTorques<f64>) -> (f64, f64) {
        let c = &self.calibration;
        let oncoming = match &self.fill_plan {
            Some(plan) => plan.pressure(elapsed_s),
            None if elapsed_s < c.boost_s - 1e-9 => c.boost_pressure_pa,
            None => self.vehicle.oncoming.clutch.kiss_pressure(),
        };
        (self.holding_pressure(known, 0.0, c.fill_holding_margin), oncoming)
    }

    /// Pressures in the torque phase (offgoing, oncoming), Pa.
    fn transfer(&self, elapsed_s: f64, measured: &Measured, known: &ShiftTorques<f64>) -> (f64, f64) {
        let c = &self.calibration;
        let v = &self.vehicle;
        let slip = v.shift.oncoming_slip(measured.turbine_rad_s, measured.output_rad_s);
        // The oncoming torque at which nothing is left for the offgoing clutch to hold.
        let row = &self.torque_phase.holding_offgoing;
        let relief_n_m = -row.at(known) / row.per_oncoming_torque;
        let oncoming_at = |fraction: f64| v.oncoming.clutch.pressure_for(fraction * relief_n_m, slip);
        let offgoing_at =
            |fraction: f64| self.holding_pressure(known, fraction * relief_n_m, c.transfer_holding_margin);
        // Both ramps are led by the lag that their valve has at the pressure of the moment.
        let fraction = (elapsed_s + c.lead_s) / c.torque_phase_s;
        let led = |clutch: &ShiftClutch, pressure: &dyn Fn(f64) -> f64| {
            let ahead = fraction + c.control_period_s / c.torque_phase_s;
            let rate = (pressure(ahead) - pressure(fraction)) / c.control_period_s;
            pressure(fraction) + clutch.valve.lag(pressure(fraction), rate) * rate
        };
        (led(&v.offgoing, &offgoing_at), led(&v.oncoming, &oncoming_at))
    }

    /// Oncoming pressure that makes the slip follow its reference, Pa.
    fn slip_control(&mut self, time_s: f64, measured: &Measured, known: &ShiftTorques<f64>) -> f64 {
        let c = &self.calibration;
        let Stage::InertiaPhase { since_s, from_rad_s, error_integral_rad, feedforward_n_m: before } = &mut self.stage
        else {
            return 0.0;
        };
        let slip = self.vehicle.shift.oncoming_slip(measured.turbine_rad_s, measured.output_rad_s);
        let elapsed_s = time_s - *since_s;
        let (reference, _) = falling(*from_rad_s, elapsed_s, c.inertia_phase_s);
        let (_, rate) = falling(*from_rad_s, elapsed_s + c.lead_s, c.inertia_phase_s);
        let error = slip - reference;
        *error_integral_rad += error * c.control_period_s;

        let row = &self.inertia_phase.slip_oncoming;
        let feedforward_n_m = (rate - row.at(known)) / row.per_oncoming_torque;
        // The feedforward is led by the lag of the valve: the turbine torque rises fast when the throttle returns.
        let rate = (feedforward_n_m - before.replace(feedforward_n_m).unwrap_or(feedforward_n_m)) / c.control_period_s;
        let ShiftClutch { clutch, valve, .. } = &self.vehicle.oncoming;
        let lag_s = valve.lag(self.oncoming_pa, rate / (clutch.torque_per_force(slip) * clutch.piston_area_m2));
        let torque_n_m = feedforward_n_m
            + lag_s * rate
            + c.proportional_n_m_s_rad * error
            + c.integral_n_m_rad * *error_integral_rad;
        clutch.pressure_for(torque_n_m.max(0.0), slip)
    }

    /// Fraction of the driver's throttle: reduced in the inertia phase, back before lock-up.
    fn throttle_fraction(&mut self, measured: &Measured) -> f64 {
        let c = &self.calibration;
        let slip = self.vehicle.shift.oncoming_slip(measured.turbine_rad_s, measured.output_rad_s);
        let reduced = matches!(self.stage, Stage::InertiaPhase { .. }) && slip > c.throttle_return_slip_rad_s;
        let target = if reduced { c.throttle_factor } else { 1.0 };
        let largest_change = (1.0 - c.throttle_factor) * c.control_period_s / c.throttle_ramp_s;
        self.throttle_fraction += (target - self.throttle_fraction).clamp(-largest_change, largest_change);
        self.throttle_fraction
    }
}

/// Half a cosine from `from` to zero: value and rate after `elapsed_s` of `duration_s`.
fn falling(from: f64, elapsed_s: f64, duration_s: f64) -> (f64, f64) {
    let fraction = (elapsed_s / duration_s).clamp(0.0, 1.0);
    let angle = std::f64::consts::PI * fraction;
    let running = if fraction < 1.0 { 1.0 } else { 0.0 };
    (
        0.5 * from * (1.0 + Real::cos(angle)),
        -0.5 * from * std::f64::consts::PI / duration_s * Real::sin(angle) * running,
    )
}
