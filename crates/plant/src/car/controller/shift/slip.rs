//! The inertia phase of a shift: the slip follows its target, and the engine takes part of the torque for it.

use drivetrain::{PhaseOrder, ShiftKind};

use super::{ActiveShift, Now, ShiftStage};
use crate::car::controller::engine::EngineRequest;
use crate::car::controller::target::SlipTarget;
use crate::car::controller::{CarCalibration, CarMeasured};

/// Turbine torque beyond that which speeds up the turbine, that the engine is asked for while a dog changes, N m \[chosen\].
const DRIVING_N_M: f64 = 15.0;

/// Rate at which the engine torque is raised to it, 1/s \[chosen\].
const DRIVING_PER_S: f64 = 8.0;

impl ActiveShift {
    /// The old gear slips: from now on the slip follows its reference.
    pub(super) fn begin_slip(&mut self, c: &CarCalibration, now: &Now) {
        self.is_slipping = true;
        self.from_rad_s = now.z_wheels;
        self.slipping_since_s = now.time_s;
        self.target = self.target(c, now.turbine_n_m);
        let at_full = self.target.duration_s;
        // A slip that still grows, after a change of mind, has further to go: with a cubic reference of the same start, end and
        // duration by 4/27 of rate and duration.
        let growth = (self.slip_rate(c, now) * self.from_rad_s.signum()).max(0.0) * 4.0 / 27.0 * at_full;
        let growth = if self.taken_over_n_m.is_some() { growth } else { 0.0 };
        let way_rad_s = self.from_rad_s.abs() + growth;
        let [shortest_s, longest_s] = self.target.within_s;
        let gentle_s = self.gentle_s(way_rad_s, now.turbine_n_m);
        self.duration_s = (at_full * (way_rad_s / 120.0)).max(gentle_s).clamp(shortest_s, longest_s);
    }

    /// Inertia at the turbine with the output at rest, kg m^2.
    fn inertia_kg_m2(&self) -> f64 {
        self.mass_kg_m2[0][0] + self.vehicle.engine_at_turbine_kg_m2
    }

    /// The target of this kind of shift.
    fn target(&self, c: &CarCalibration, turbine_n_m: f64) -> SlipTarget {
        let kind = match (self.order(turbine_n_m), self.direction > 0.0) {
            _ if self.is_from_neutral => return c.targets.from_neutral,
            (PhaseOrder::TorqueFirst, true) => ShiftKind::PowerOnUp,
            (PhaseOrder::TorqueFirst, false) => ShiftKind::CoastDown,
            (PhaseOrder::InertiaFirst, true) => ShiftKind::PowerOffUp,
            (PhaseOrder::InertiaFirst, false) => ShiftKind::PowerOnDown,
        };
        *c.targets.of(kind)
    }

    /// Duration in which the torque of the clutches for a change of the slip stays below that of the target, s.
    fn gentle_s(&self, way_rad_s: f64, turbine_n_m: f64) -> f64 {
        let target = &self.target;
        let controlling = match self.order(turbine_n_m) {
            PhaseOrder::TorqueFirst => &self.oncoming,
            PhaseOrder::InertiaFirst => &self.offgoing,
        };
        let felt_n_m = target.inertia_m_s2 * self.vehicle.output_n_m_per_m_s2 / controlling.ratio.abs();
        let accepted_n_m = felt_n_m.max(target.inertia_fraction * turbine_n_m.abs());
        self.target.curve.peak() * way_rad_s * (self.inertia_kg_m2() + self.vehicle.engine_kg_m2) / accepted_n_m
    }

    /// The same, with this torque of the slip controller, N m at the turbine.
    pub(super) fn begin_slip_with(&mut self, c: &CarCalibration, now: &Now, torque_n_m: f64) {
        self.begin_slip(c, now);
        let without = self.slip_controlled_n_m(c, now);
        self.integral_rad = (torque_n_m - without) / (c.integral_per_s2 * self.inertia_kg_m2());
    }

    /// Whether the slip reaches zero soon.
    pub(super) fn nears(&self, c: &CarCalibration, now: &Now) -> bool {
        (now.z + c.hand_over_lead_s * self.slip_rate(c, now)) * self.direction <= 0.0
    }

    /// Rate of the oncoming slip, rad/s^2; zero in the first period.
    pub(super) fn slip_rate(&self, c: &CarCalibration, now: &Now) -> f64 {
        self.slips_before_rad_s.map_or(0.0, |[_, before]| (now.z_wheels - before) / c.control_period_s)
    }

    /// The sum of the torques of both clutches that makes the slip follow its reference, N m at the turbine.
    pub(super) fn slip_controlled_n_m(&mut self, c: &CarCalibration, now: &Now) -> f64 {
        let end = -c.past_synchronous_rad_s * self.direction;
        let elapsed_s = now.time_s - self.slipping_since_s;
        let (reference, _) = self.target.curve.at(self.from_rad_s, end, elapsed_s, self.duration_s);
        let (_, rate) = self.target.curve.at(self.from_rad_s, end, elapsed_s + c.lead_s, self.duration_s);
        self.reference_rad_s2 = rate;
        let error = now.z_wheels - reference;
        self.integral_rad += error * c.control_period_s;
        let (m11, m12) = (self.inertia_kg_m2(), self.mass_kg_m2[0][1]);
        let wanted_rad_s2 = rate + self.oncoming.ratio * now.output_rad_s2;
        self.controlled_n_m = now.turbine_n_m - m11 * wanted_rad_s2 - m12 * now.output_rad_s2
            + m11 * (c.proportional_per_s * error + c.integral_per_s2 * self.integral_rad);
        self.controlled_n_m
    }

    pub(super) fn slip_control(&mut self, c: &CarCalibration, now: &Now) -> [f64; 2] {
        if !self.is_slipping {
            // Inertia phase first: the offgoing clutch gives way by and by until the old gear slips.
            let margin = (c.holding_margin - (now.time_s - self.since_s) / c.release_s).max(0.0);
            self.controlled_n_m = margin * now.turbine_n_m;
            if now.y * self.direction < -c.release_slip_rad_s || margin <= 0.0 {
                // What slipped tells the friction: the controller begins with the torque at which it did.
                let fallen_n_m = c.release_seen_s / c.release_s * now.turbine_n_m;
                self.begin_slip_with(c, now, self.controlled_n_m + fallen_n_m);
            } else {
                return [self.offgoing.pressure_for(self.controlled_n_m, 0.0), self.waiting_pa(c, now)];
            }
        }
        if let Some(torque_n_m) = self.taken_over_n_m {
            self.begin_slip_with(c, now, torque_n_m);
            self.taken_over_n_m = None;
        }
        let u = self.slip_controlled_n_m(c, now);
        if u * self.direction > 0.0 {
            // Beyond the old gear the offgoing clutch brings the turbine back too.
            let beyond = (now.y * self.direction - c.release_slip_rad_s).max(0.0);
            let caught_n_m = c.flare_per_s * self.mass_kg_m2[0][0] * beyond;
            let offgoing_pa = if beyond > 0.0 { self.offgoing.pressure_for(caught_n_m, now.y) } else { 0.0 };
            [offgoing_pa, self.oncoming.pressure_for(u, now.z)]
        } else {
            [self.offgoing.pressure_for(u, now.y), self.waiting_pa(c, now)]
        }
    }

    /// What suits the stage.
    pub(in super::super) fn engine(&self) -> EngineRequest {
        self.engine
    }

    pub(in super::super) fn choose_engine(&mut self, c: &CarCalibration, turbine_n_m: f64, measured: &CarMeasured) {
        let fraction = self.suitable_engine_fraction(c, turbine_n_m, measured);
        let changes = self.is_slipping && matches!(self.stage, ShiftStage::InertiaPhase | ShiftStage::HandOver);
        let inertia_kg_m2 = self.inertia_kg_m2() + self.vehicle.engine_kg_m2;
        let added_n_m = if changes { self.target.engine * inertia_kg_m2 * self.reference_rad_s2 } else { 0.0 };
        if self.needs_drive() {
            // What is left for a clutch while the turbine comes up.
            let left_n_m = if self.is_slipping { self.controlled_n_m } else { turbine_n_m };
            let missing_n_m = DRIVING_N_M - left_n_m;
            self.driving_n_m = (self.driving_n_m + DRIVING_PER_S * c.control_period_s * missing_n_m).max(0.0);
        } else {
            self.driving_n_m = 0.0;
        }
        self.engine = EngineRequest { fraction, added_n_m: added_n_m + self.driving_n_m };
    }

    fn suitable_engine_fraction(&self, c: &CarCalibration, turbine_n_m: f64, measured: &CarMeasured) -> f64 {
        if !self.is_slipping || self.is_from_neutral {
            return 1.0;
        }
        let z = self.oncoming.slip_at_turbine(measured.turbine_rad_s, measured.output_rad_s);
        let way = 1.0 - z / self.from_rad_s;
        match self.stage {
            ShiftStage::InertiaPhase
                if turbine_n_m > 0.0 && self.direction > 0.0 && way < c.engine_way && self.target.engine == 0.0 =>
            {
                c.up_engine_fraction
            }
            ShiftStage::InertiaPhase | ShiftStage::HandOver
                if turbine_n_m > 0.0 && self.direction < 0.0 && way > c.engine_way =>
            {
                c.down_engine_fraction
            }
            _ => 1.0,
        }
    }
}
