//! How the shift controller fills a clutch whose piston has a stroke.

use car::{FastFill, ShiftClutch};

use crate::delay::DelayLine;

/// Longest pulse, s [chosen]: oil so cold that it takes longer is not shifted with.
const LONGEST_PULSE_S: f64 = 5.0;
/// Time in which a valve has settled after a ramp, s.
const SETTLES_S: f64 = 1.0;
/// Step of the controller's model of the fill, s: a hundredth of a fill.
const STEP_S: f64 = 1e-3;

/// The fill of one clutch: a pulse well above the kiss point moves the piston for most of its stroke; a ramp and a hold just
/// above the kiss point bring the plates together gently.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FillPlan {
    kiss_pa: f64,
    calibration: FastFill,
    /// Length of the pulse, s; less than zero where the ramp is cut short too.
    pub pulse_s: f64,
    /// When the modelled piston ends its stroke, s after the fill began; zero if it does not within the hold and a second.
    pub arrival_s: f64,
}

impl FillPlan {
    /// The plan for this clutch with its piston on its stop; see [`Self::from_state`].
    pub fn new(clutch: &ShiftClutch, calibration: FastFill, period_s: f64) -> Self {
        Self::from_state(clutch, calibration, period_s, &StrokeModel::new(clutch, 0.0))
    }

    /// The plan for this clutch at the viscosity of its oil and in this state: the longest pulse, in periods of the
    /// controller, with which the modelled piston arrives gently. It arrives late rather than early: the hold moves it the
    /// rest of the way.
    pub fn from_state(clutch: &ShiftClutch, calibration: FastFill, period_s: f64, state: &StrokeModel) -> Self {
        let plan = |pulse_s: f64| Self { kiss_pa: clutch.clutch.kiss_pressure(), calibration, pulse_s, arrival_s: 0.0 };
        let mut longest = (LONGEST_PULSE_S / period_s).floor();
        let mut shortest = 0.0;
        while longest - shortest > 1.0 {
            let middle = (0.5 * (shortest + longest)).floor();
            if plan(middle * period_s).arrives_hard(clutch, period_s, state) {
                longest = middle
            } else {
                shortest = middle
            }
        }
        // A piston that is nearly there takes the hold alone.
        let hold_alone_s = -calibration.ramp_s;
        let needs_none = shortest < 1.0 && plan(0.0).arrives_hard(clutch, period_s, state);
        let pulse_s = if needs_none { hold_alone_s } else { shortest * period_s + calibration.offset_s };
        let mut plan = plan(pulse_s.max(hold_alone_s));
        plan.arrival_s = plan.arrival(clutch, period_s, state).map_or(0.0, |(time_s, _)| time_s);
        plan
    }

    /// Pressure to be commanded at this time after the fill began, Pa.
    pub fn pressure(&self, elapsed_s: f64) -> f64 {
        let c = &self.calibration;
        // Times are sums of periods; a rounding error must not cost a whole one.
        let after_pulse_s = elapsed_s - self.pulse_s + 1e-9;
        let fraction = if after_pulse_s < 0.0 { 0.0 } else { (after_pulse_s / c.ramp_s).min(1.0) };
        self.kiss_pa + c.over_kiss_pa + fraction * (c.stroke_over_kiss_pa - c.over_kiss_pa)
    }

    /// How long it takes, s.
    pub fn duration_s(&self) -> f64 {
        self.pulse_s + self.calibration.ramp_s + self.calibration.hold_s
    }

    /// When the modelled piston ends its stroke, s after the fill began, and the pressure of the valve then, Pa. `None` if it
    /// comes so late that the valve has settled at the pressure of the hold.
    fn arrival(&self, clutch: &ShiftClutch, period_s: f64, state: &StrokeModel) -> Option<(f64, f64)> {
        let mut model = state.clone();
        let begun_s = model.time_s;
        let mut next_command_s = 0.0;
        while model.time_s - begun_s < self.duration_s() + SETTLES_S {
            if model.time_s - begun_s >= next_command_s - 1e-9 {
                model.send(clutch, clutch.valve.command_for(self.pressure(next_command_s)));
                next_command_s += period_s;
            }
            model.step(clutch, STEP_S);
            if model.volume_m3 >= clutch.cylinder.stroke_m3 {
                return Some((model.time_s - begun_s, model.valve_pa));
            }
        }
        None
    }

    /// Whether the modelled piston ends its stroke while the pressure of the valve, which lags behind the ramp, is still above
    /// the kiss point by more than twice the pressure of the hold.
    fn arrives_hard(&self, clutch: &ShiftClutch, period_s: f64, state: &StrokeModel) -> bool {
        let gentle_pa = self.kiss_pa + 2.0 * self.calibration.stroke_over_kiss_pa;
        self.arrival(clutch, period_s, state).is_some_and(|(_, valve_pa)| valve_pa > gentle_pa)
    }
}

/// What a controller knows of a clutch that fills or empties: the nominal valve and the oil of the stroke.
#[derive(Debug, Clone, PartialEq)]
pub struct StrokeModel {
    time_s: f64,
    line: DelayLine,
    valve_pa: f64,
    /// Oil beyond that of a piston on its stop.
    volume_m3: f64,
}

impl StrokeModel {
    /// A clutch whose valve has given this pressure for ever, at time zero.
    pub fn new(clutch: &ShiftClutch, settled_pa: f64) -> Self {
        let volume_m3 = clutch.cylinder.volume(settled_pa).max(0.0);
        let line = DelayLine::new(clutch.valve.command_for(settled_pa));
        Self { time_s: 0.0, line, valve_pa: settled_pa, volume_m3 }
    }

    /// Sends a command, A or %.
    pub fn send(&mut self, clutch: &ShiftClutch, command: f64) {
        self.line.send(self.time_s, clutch.valve.delay(command), command);
    }

    /// Goes on by this time, s, in steps of a hundredth of a fill.
    pub fn advance(&mut self, clutch: &ShiftClutch, duration_s: f64) {
        let end_s = self.time_s + duration_s;
        if self.rests(clutch) {
            self.time_s = end_s;
            return;
        }
        while self.time_s < end_s - 1e-9 {
            self.step(clutch, STEP_S.min(end_s - self.time_s));
        }
    }

    /// Whether nothing moves.
    fn rests(&self, clutch: &ShiftClutch) -> bool {
        const AT_REST_PA: f64 = 1.0;
        /// The leak keeps a full cylinder a little below its valve.
        const FULL_PA: f64 = 1e3;
        let settled_pa = clutch.valve.settled_pressure(self.line.arrived());
        let is_full = self.volume_m3 > clutch.cylinder.stroke_m3
            && (clutch.cylinder.pressure(self.volume_m3) - settled_pa).abs() < FULL_PA;
        let is_empty = self.volume_m3 <= 0.0 && settled_pa < clutch.cylinder.preload_pa;
        let is_settled = self.line.next_arrival_s().is_none() && (self.valve_pa - settled_pa).abs() < AT_REST_PA;
        is_settled && (is_full || is_empty)
    }

    fn step(&mut self, clutch: &ShiftClutch, step_s: f64) {
        let cylinder = &clutch.cylinder;
        let settled_pa = clutch.valve.settled_pressure(self.line.arrive(self.time_s));
        let rate = cylinder.volume_rate(self.volume_m3, self.valve_pa);
        // The oil of a filled cylinder follows the valve faster than the step.
        let is_filled = self.volume_m3 > cylinder.stroke_m3;
        let slope = if is_filled { cylinder.volume_rate_slopes(self.volume_m3, self.valve_pa).0 } else { 0.0 };
        self.volume_m3 = (self.volume_m3 + step_s * rate / (1.0 - step_s * slope)).max(0.0);
        self.valve_pa += step_s * clutch.valve.pressure_rate(self.valve_pa, settled_pa);
        self.time_s += step_s;
    }
}
