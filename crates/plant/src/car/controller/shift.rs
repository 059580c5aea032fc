//! One shift: its stages and the pressures of both clutches.

mod slip;

use drivetrain::{PhaseOrder, Real};

use super::engine::EngineRequest;
use super::pressure::Controlled;
use super::target::{SlipCurve, SlipTarget};
use super::track::Track;
use super::{CarCalibration, CarMeasured};

/// Fraction of the fill after which the oncoming clutch is at its waiting pressure.
const FILLED_AT: f64 = 0.75;

/// A clutch that slips so long at line pressure is left at it, s \[chosen\]: nothing more can be commanded.
const GIVEN_UP_S: f64 = 3.0;

/// By how much the command of a clutch that has locked may fall from one period to the next, as a pressure, Pa \[chosen\].
const LOCK_FALL_PA: f64 = 50e3;

/// Ratios closer than this are one.
const SAME_RATIO: f64 = 1e-6;

/// Stage of a shift, as the controller runs it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ShiftStage {
    /// The oncoming clutch goes to its kiss point, the offgoing one to what it must hold.
    Fill,
    /// The load goes from the offgoing to the oncoming clutch in the old ratio.
    TorquePhase,
    /// Slip control.
    InertiaPhase,
    /// The load goes to the oncoming clutch at its synchronous speed (inertia phase first).
    HandOver,
    /// The oncoming clutch goes to line pressure.
    Lock,
    /// The new gear is engaged.
    Done,
}

/// What a shift knows of the vehicle around the gearbox.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct ShiftVehicle {
    /// Torque at the gearbox output for an acceleration by 1 m/s^2, N m.
    pub(super) output_n_m_per_m_s2: f64,
    /// Inertia of an engine that follows the turbine through a converter, kg m^2.
    pub(super) engine_kg_m2: f64,
    /// Inertia of an engine without converter as far as the slip controller counts it, kg m^2.
    pub(super) engine_at_turbine_kg_m2: f64,
}

/// A shift that is under way.
#[derive(Debug, Clone)]
pub(super) struct ActiveShift {
    pub(super) to: usize,
    pub(super) offgoing: Controlled,
    pub(super) oncoming: Controlled,
    pub(super) stage: ShiftStage,
    mass_kg_m2: [[f64; 2]; 2],
    line_pa: f64,
    /// Positive for an upshift of forward gears, and for a turbine that is slowed down from neutral.
    direction: f64,
    /// From neutral, or from the other direction at rest: the offgoing clutch opens first, and the turbine comes up.
    is_from_neutral: bool,
    /// Time for that, s.
    neutral_s: f64,
    begun_s: f64,
    since_s: f64,
    is_filled_by_plan: bool,
    /// Whether the inertia phase comes first, so that the offgoing clutch is lowered before the oncoming one is filled.
    lowers_first: bool,
    /// Fraction of the load that the oncoming clutch has taken in the torque phase.
    transferred: f64,
    has_flared: bool,
    /// Size of the torque that the offgoing clutch is to hold, N m at the turbine.
    held_n_m: f64,
    is_slipping: bool,
    vehicle: ShiftVehicle,
    /// Target of the inertia phase.
    target: SlipTarget,
    /// Oncoming slip at the start of the inertia phase, and its duration.
    from_rad_s: f64,
    duration_s: f64,
    slipping_since_s: f64,
    integral_rad: f64,
    /// Torque of the slip controller, N m at the turbine.
    controlled_n_m: f64,
    /// Torque with which the slip controller begins, N m at the turbine.
    taken_over_n_m: Option<f64>,
    locked_since_s: Option<f64>,
    /// Offgoing torque at the start of the hand-over, N m at the turbine.
    handed_n_m: f64,
    /// Offgoing and oncoming slip one period before, with the output speed of the wheels, rad/s.
    slips_before_rad_s: Option<[f64; 2]>,
    engine: EngineRequest,
    /// Engine torque that is added so that the engine drives while a dog changes, N m.
    driving_n_m: f64,
    /// Rate of the reference of the slip when the clutches answer, rad/s^2.
    reference_rad_s2: f64,
    /// Pressure at which the command of the oncoming clutch settles, Pa.
    oncoming_pa: f64,
}

/// What a step of the controller looks at.
#[derive(Clone, Copy)]
struct Now {
    time_s: f64,
    turbine_n_m: f64,
    /// Offgoing and oncoming slip at the turbine, rad/s.
    y: f64,
    z: f64,
    /// Oncoming slip with the output speed of the wheels, rad/s: free of the oscillation of the shafts.
    z_wheels: f64,
    output_rad_s2: f64,
}

impl ActiveShift {
    pub(super) fn new(
        to: usize,
        [offgoing, oncoming]: [Controlled; 2],
        mass_kg_m2: [[f64; 2]; 2],
        line_pa: f64,
        time_s: f64,
    ) -> Self {
        let fall = offgoing.ratio - oncoming.ratio;
        // Between gears of one ratio the turbine torque of a driven car comes first.
        let direction = if fall.abs() < SAME_RATIO { 1.0 } else { fall.signum() };
        Self {
            to,
            offgoing,
            oncoming,
            direction,
            is_from_neutral: false,
            neutral_s: 0.0,
            stage: ShiftStage::Fill,
            mass_kg_m2,
            line_pa,
            begun_s: time_s,
            since_s: time_s,
            is_filled_by_plan: false,
            lowers_first: false,
            transferred: 0.0,
            has_flared: false,
            held_n_m: 0.0,
            is_slipping: false,
            vehicle: ShiftVehicle::default(),
            target: SlipTarget::lasting(1.0, SlipCurve::HalfCosine),
            from_rad_s: 0.0,
            duration_s: 1.0,
            slipping_since_s: time_s,
            integral_rad: 0.0,
            controlled_n_m: 0.0,
            taken_over_n_m: None,
            locked_since_s: None,
            handed_n_m: 0.0,
            slips_before_rad_s: None,
            engine: EngineRequest { fraction: 1.0, added_n_m: 0.0 },
            driving_n_m: 0.0,
            reference_rad_s2: 0.0,
            oncoming_pa: 0.0,
        }
    }

    /// The same from neutral, where the offgoing clutch is open already, or from the other direction at rest, where it opens in
    /// the time `neutral_s`.
    pub(super) fn out_of_neutral(self, neutral_s: f64) -> Self {
        Self { is_from_neutral: true, neutral_s, direction: 1.0, ..self }
    }

    /// The same in this vehicle.
    pub(super) fn in_vehicle(self, vehicle: ShiftVehicle) -> Self {
        Self { vehicle, ..self }
    }

    /// Whether it begins in neutral.
    pub(super) fn is_from_neutral(&self) -> bool {
        self.is_from_neutral && self.neutral_s == 0.0
    }

    /// The way back to the gear `from` that is being left: offgoing and oncoming clutch change their roles. `None` where the new
    /// gear is nearly engaged, or a dog changes.
    pub(super) fn withdrawn(&self, c: &CarCalibration, from: usize, time_s: f64) -> Option<Self> {
        if self.is_from_neutral || self.changes_dog() {
            return None;
        }
        let clutches = [self.oncoming.clone(), self.offgoing.clone()];
        let mut back = Self::new(from, clutches, self.mass_kg_m2, self.line_pa, time_s).in_vehicle(self.vehicle);
        match self.stage {
            // The turbine has fallen behind the one-way clutch: the next step begins its inertia phase.
            ShiftStage::TorquePhase if self.oncoming.is_one_way() => back.since_s = f64::NEG_INFINITY,
            ShiftStage::TorquePhase => {
                // What the old gear has given up comes back as at the end of a shift.
                back.stage = ShiftStage::HandOver;
                back.since_s = time_s - (1.0 - self.transferred) * c.hand_over_s;
            }
            ShiftStage::InertiaPhase if self.is_slipping => {
                back.stage = ShiftStage::InertiaPhase;
                back.is_slipping = true;
                back.controlled_n_m = self.controlled_n_m;
                back.taken_over_n_m = Some(self.controlled_n_m);
                back.slips_before_rad_s = self.slips_before_rad_s.map(|[y, z]| [z, y]);
            }
            ShiftStage::Fill => {
                // The clutch that was to open goes back to line pressure from where it is.
                back.stage = ShiftStage::Lock;
                let lowering_s = if self.lowers_first { self.lowering_s(c) } else { self.fill_s(c) };
                let opened = ((time_s - self.since_s) / lowering_s).clamp(0.0, 1.0);
                back.since_s = time_s - (1.0 - opened) * c.lock_ramp_s;
            }
            ShiftStage::InertiaPhase => back.stage = ShiftStage::Lock,
            ShiftStage::HandOver | ShiftStage::Lock | ShiftStage::Done => return None,
        }
        Some(back)
    }

    /// Torque phase first where the turbine torque drives the speed change.
    fn order(&self, turbine_n_m: f64) -> PhaseOrder {
        if turbine_n_m * self.direction > 0.0 { PhaseOrder::TorqueFirst } else { PhaseOrder::InertiaFirst }
    }

    /// Pressures at which offgoing and oncoming valve are to settle, Pa.
    pub(super) fn step(
        &mut self,
        c: &CarCalibration,
        time_s: f64,
        turbine_n_m: f64,
        measured: &CarMeasured,
        output: &Track,
    ) -> [f64; 2] {
        let (turbine, out) = (measured.turbine_rad_s, measured.output_rad_s);
        let now = Now {
            time_s,
            turbine_n_m,
            y: self.offgoing.slip_at_turbine(turbine, out),
            z: self.oncoming.slip_at_turbine(turbine, out),
            z_wheels: self.oncoming.slip_at_turbine(turbine, output.speed_rad_s()),
            output_rad_s2: output.rate_rad_s2,
        };
        // A clutch that holds takes more at once and gives it up by and by: the torque may come back with the other sign.
        let kept = self.held_n_m * (1.0 - c.control_period_s / c.holding_s);
        self.held_n_m = now.turbine_n_m.abs().max(kept).max(c.lock_min_n_m);
        self.change_stage(c, &now);
        self.is_filled_by_plan = false;
        let torques = match self.stage {
            ShiftStage::Fill => self.fill(c, &now),
            ShiftStage::TorquePhase => self.transfer(c, &now),
            ShiftStage::InertiaPhase => self.slip_control(c, &now),
            ShiftStage::HandOver => self.hand_over(c, &now),
            ShiftStage::Lock => [0.0, self.locked_pa(c, &now)],
            // The ramp of the lock has ended.
            ShiftStage::Done => [0.0, self.line_pa],
        };
        let y_wheels = self.offgoing.slip_at_turbine(turbine, output.speed_rad_s());
        self.slips_before_rad_s = Some([y_wheels, now.z_wheels]);
        let [off_pa, on_pa] = if self.is_from_neutral { [self.opening_pa(&now), torques[1]] } else { torques };
        let on_pa = if self.is_filled_by_plan {
            self.oncoming.without_lead(c, on_pa, self.line_pa)
        } else {
            // A clutch that has just locked keeps about what it carried.
            let min_pa = if self.stage == ShiftStage::Lock { self.oncoming_pa - LOCK_FALL_PA } else { 0.0 };
            self.oncoming.lead(c, on_pa, self.line_pa, min_pa)
        };
        self.oncoming_pa = on_pa;
        [self.offgoing.lead(c, off_pa, self.line_pa, 0.0), on_pa]
    }

    fn change_stage(&mut self, c: &CarCalibration, now: &Now) {
        // Times are sums of periods; a rounding error must not cost a whole one.
        let passed = |since_s: f64, duration_s: f64| now.time_s - since_s >= duration_s - 1e-9;
        let direction = self.direction;
        let locks = now.z.abs() < c.lock_slip_rad_s || now.z * direction < 0.0;
        self.locked_since_s =
            if now.z.abs() < c.lock_slip_rad_s { self.locked_since_s.or(Some(now.time_s)) } else { None };
        let holds = self.locked_since_s.is_some_and(|since_s| passed(since_s, c.lock_hold_s));
        let is_filled = passed(self.since_s, self.fill_s(c));
        let waits = self.waits_for_drive(c, now) && !passed(self.begun_s, c.longest_s);
        let next = match self.stage {
            ShiftStage::Fill if waits => ShiftStage::Fill,
            ShiftStage::Fill if is_filled && self.overruns(c, now) => ShiftStage::Lock,
            ShiftStage::InertiaPhase if self.overruns(c, now) => ShiftStage::Lock,
            ShiftStage::Fill if is_filled && self.is_free(c, now) => ShiftStage::InertiaPhase,
            ShiftStage::Fill => match self.order(now.turbine_n_m) {
                PhaseOrder::TorqueFirst if is_filled => ShiftStage::TorquePhase,
                PhaseOrder::InertiaFirst if passed(self.since_s, self.lowering_s(c)) => ShiftStage::InertiaPhase,
                _ => ShiftStage::Fill,
            },
            // The turbine torque has changed its sign: the other clutch will control the inertia phase.
            ShiftStage::TorquePhase if now.turbine_n_m * direction < -c.sign_n_m => ShiftStage::InertiaPhase,
            ShiftStage::InertiaPhase
                if !self.is_slipping && self.is_filled(c, now) && now.turbine_n_m * direction > c.sign_n_m =>
            {
                ShiftStage::TorquePhase
            }
            ShiftStage::TorquePhase if now.y * direction < -c.release_slip_rad_s => ShiftStage::InertiaPhase,
            // A one-way clutch does not bring the turbine up: it waits for it.
            ShiftStage::TorquePhase if self.transferred >= 1.0 && self.oncoming.is_one_way() => ShiftStage::Lock,
            ShiftStage::TorquePhase if self.transferred >= 1.0 => ShiftStage::InertiaPhase,
            ShiftStage::InertiaPhase if !self.is_slipping => ShiftStage::InertiaPhase,
            ShiftStage::InertiaPhase if self.oncoming.is_one_way() && now.turbine_n_m * direction > c.sign_n_m => {
                ShiftStage::Lock
            }
            ShiftStage::InertiaPhase => match self.order(self.controlled_n_m) {
                PhaseOrder::TorqueFirst if locks => ShiftStage::Lock,
                PhaseOrder::InertiaFirst if self.nears(c, now) => ShiftStage::HandOver,
                _ if passed(self.begun_s, c.longest_s) => ShiftStage::Lock,
                _ => ShiftStage::InertiaPhase,
            },
            ShiftStage::HandOver if passed(self.since_s, c.hand_over_s) => ShiftStage::Lock,
            ShiftStage::Lock if (holds || self.is_caught_later(now)) && passed(self.since_s, c.lock_ramp_s) => {
                ShiftStage::Done
            }
            ShiftStage::Lock if passed(self.since_s, GIVEN_UP_S) => ShiftStage::Done,
            same => same,
        };
        if next == self.stage {
            return;
        }
        self.stage = next;
        self.since_s = now.time_s;
        if next == ShiftStage::InertiaPhase {
            self.controlled_n_m = now.turbine_n_m;
            if self.is_free(c, now) {
                self.direction = now.z.signum();
            }
            if self.is_free(c, now) || self.order(now.turbine_n_m) == PhaseOrder::TorqueFirst {
                self.begin_slip(c, now);
            }
        }
        if next == ShiftStage::HandOver {
            self.handed_n_m = self.controlled_n_m;
        }
    }

    /// Whether a dog takes or gives up the load.
    pub(super) fn changes_dog(&self) -> bool {
        self.offgoing.is_dog() || self.oncoming.is_dog()
    }

    /// Whether the dog of the old gear is to be in: it comes out when the torque phase has taken its load.
    pub(super) fn is_offgoing_in(&self) -> bool {
        self.stage == ShiftStage::Fill
    }

    /// Whether the dog of the new gear is to be in: from shortly before its synchronous speed on.
    pub(super) fn is_oncoming_in(&self) -> bool {
        matches!(self.stage, ShiftStage::HandOver | ShiftStage::Lock | ShiftStage::Done)
    }

    /// Whether the engine is to drive: until the dog of the old gear is out, or that of the new gear in.
    pub(super) fn needs_drive(&self) -> bool {
        let off = self.offgoing.is_dog() && matches!(self.stage, ShiftStage::Fill | ShiftStage::TorquePhase);
        let on = self.oncoming.is_dog() && !matches!(self.stage, ShiftStage::Lock | ShiftStage::Done);
        off || on
    }

    /// Whether a dog changes and the engine does not drive yet.
    fn waits_for_drive(&self, c: &CarCalibration, now: &Now) -> bool {
        self.changes_dog() && now.turbine_n_m < c.sign_n_m
    }

    /// Whether the old gear holds the turbine no longer: it is neutral, or its one-way clutch overruns.
    fn is_free(&self, c: &CarCalibration, now: &Now) -> bool {
        self.is_from_neutral || (self.offgoing.may_overrun() && now.y < -c.release_slip_rad_s)
    }

    /// Whether the one-way clutches of both gears let the turbine turn slower, so that neither gear brings it up: there is nothing to control.
    fn overruns(&self, c: &CarCalibration, now: &Now) -> bool {
        !self.is_from_neutral && self.is_free(c, now) && self.oncoming.may_overrun() && now.z < 0.0
    }

    /// Whether a one-way clutch holds the turbine in the new gear once it has come up.
    fn is_caught_later(&self, now: &Now) -> bool {
        self.oncoming.is_one_way() || (self.oncoming.may_overrun() && now.z < 0.0)
    }

    /// Pressure with which the oncoming clutch waits, Pa: just below its kiss point, or on the plan of its fill and then with
    /// the piston at the end of its stroke.
    fn waiting_pa(&mut self, c: &CarCalibration, now: &Now) -> f64 {
        let Some(plan) = self.oncoming.fill else { return (self.oncoming.kiss_pa() - c.below_kiss_pa).max(0.0) };
        let elapsed_s = now.time_s - self.begun_s;
        // The plan counts with the lag of the valve.
        self.is_filled_by_plan = elapsed_s < plan.duration_s();
        plan.pressure(elapsed_s)
    }

    /// Duration of the fill, s.
    fn fill_s(&self, c: &CarCalibration) -> f64 {
        let fill_s = self.oncoming.fill.map_or(c.fill_s, |plan| plan.duration_s().max(plan.arrival_s).max(c.fill_s));
        fill_s.max(self.neutral_s)
    }

    /// Time in which the offgoing clutch goes to what it must hold, s.
    fn lowering_s(&self, c: &CarCalibration) -> f64 {
        let fill_s = self.fill_s(c);
        if self.is_from_neutral { fill_s } else { fill_s.min(c.lowering_s) }
    }

    /// Whether the oncoming clutch is at its kiss point.
    fn is_filled(&self, c: &CarCalibration, now: &Now) -> bool {
        now.time_s - self.begun_s >= self.fill_s(c) - 1e-9
    }

    /// Pressure of a clutch that opens into neutral, Pa: its torque goes in the first third of the time.
    fn opening_pa(&self, now: &Now) -> f64 {
        let left = 1.0 - 3.0 * (now.time_s - self.begun_s) / self.neutral_s;
        if left > 0.0 { self.offgoing.pressure_for(left * now.turbine_n_m, 0.0) } else { 0.0 }
    }

    fn fill(&mut self, c: &CarCalibration, now: &Now) -> [f64; 2] {
        let elapsed_s = now.time_s - self.since_s + c.control_period_s;
        let fraction = (elapsed_s / self.fill_s(c)).min(1.0);
        self.lowers_first |= self.order(now.turbine_n_m) == PhaseOrder::InertiaFirst;
        let lowered = if self.lowers_first { (elapsed_s / self.lowering_s(c)).min(1.0) } else { fraction };
        let held = self.offgoing.pressure_for(c.holding_margin * self.held_n_m, 0.0);
        let offgoing_pa = self.line_pa.min(held + (1.0 - lowered) * (self.line_pa - held).max(0.0));
        if self.oncoming.fill.is_some() {
            return [offgoing_pa, self.waiting_pa(c, now)];
        }
        // Gently: a command that falls arrives later than the one that rises before it.
        let filled = Real::sin(std::f64::consts::FRAC_PI_2 * (fraction / FILLED_AT).min(1.0));
        [offgoing_pa, filled * self.waiting_pa(c, now)]
    }

    fn transfer(&mut self, c: &CarCalibration, now: &Now) -> [f64; 2] {
        // Where a one-way clutch is to catch the turbine later, it may go.
        let flare = now.y * self.direction > c.flare_slip_rad_s && !self.oncoming.is_one_way();
        self.has_flared |= flare;
        let speed = if self.has_flared { c.flare_ramp } else { 1.0 };
        self.transferred = (self.transferred + speed * c.control_period_s / c.torque_phase_s).min(1.0);
        let (taken, left) = (self.transferred, 1.0 - self.transferred);
        let held = c.holding_margin * left;
        let held = if flare { held.max(c.flare_holding) } else { held };
        let caught = if flare { c.flare_per_s * self.mass_kg_m2[0][0] * now.y } else { 0.0 };
        [
            self.offgoing.pressure_for(held * self.held_n_m, now.y),
            self.oncoming.pressure_for(c.taking_margin * taken * now.turbine_n_m + caught, now.z),
        ]
    }

    /// Torque of the closed oncoming clutch, N m at the turbine.
    fn closing_n_m(&self, c: &CarCalibration, now: &Now) -> f64 {
        (c.lock_margin * now.turbine_n_m.abs()).max(c.lock_min_n_m)
    }

    /// Torque of the oncoming clutch against a slip beyond synchronous speed, where both clutches hold the turbine, N m.
    fn beyond_n_m(&self, c: &CarCalibration, now: &Now) -> f64 {
        (-now.z * self.direction).max(0.0) * c.beyond_per_s * self.mass_kg_m2[0][0]
    }

    /// The oncoming clutch closes; what it cannot yet carry of the controlled torque stays with the offgoing one.
    fn hand_over(&mut self, c: &CarCalibration, now: &Now) -> [f64; 2] {
        let fraction = ((now.time_s - self.since_s + c.control_period_s) / c.hand_over_s).min(1.0);
        let taken = fraction * self.closing_n_m(c, now);
        let left = (-self.slip_controlled_n_m(c, now) * self.direction - taken).max(0.0);
        // The offgoing clutch is open at the end, whatever the slip.
        let left = left.min((1.0 - fraction) * c.holding_margin * self.handed_n_m.abs());
        let oncoming = taken + self.beyond_n_m(c, now);
        [self.offgoing.pressure_for(left, now.y), self.oncoming.pressure_for(oncoming, now.z)]
    }

    fn locked_pa(&self, c: &CarCalibration, now: &Now) -> f64 {
        let closing = self.oncoming.pressure_for(self.closing_n_m(c, now) + self.beyond_n_m(c, now), now.z);
        let fraction = ((now.time_s - self.since_s) / c.lock_ramp_s).min(1.0);
        closing + fraction * (self.line_pa - closing).max(0.0)
    }
}
