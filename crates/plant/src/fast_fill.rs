//! How the shift controller fills a clutch whose piston has a stroke.

use config::{FastFill, ShiftClutch};

use crate::delay::DelayLine;

/// Longest pulse, s [chosen]: oil so cold that it takes longer is not shifted with.
const LONGEST_PULSE_S: f64 = 5.0;
/// Step of the controller's model of the fill, s: a hundredth of a fill.
const STEP_S: f64 = 1e-3;

/// The fill of one clutch: a pulse well above the kiss point moves the piston for most of its stroke; a ramp and a hold just
/// above the kiss point bring the plates together gently.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FillPlan {
    kiss_pa: f64,
    calibration: FastFill,
    /// Length of the pulse, s.
    pub pulse_s: f64,
}

impl FillPlan {
    /// The plan for this clutch at the viscosity of its oil: the longest pulse, in periods of the controller, with which the
    /// modelled piston arrives gently. It arrives late rather than early: the hold moves it the rest of the way.
    pub fn new(clutch: &ShiftClutch, calibration: FastFill, period_s: f64) -> Self {
        let plan = |pulse_s: f64| Self { kiss_pa: clutch.clutch.kiss_pressure(), calibration, pulse_s };
        let mut longest = (LONGEST_PULSE_S / period_s).floor();
        let mut shortest = 0.0;
        while longest - shortest > 1.0 {
            let middle = (0.5 * (shortest + longest)).floor();
            if plan(middle * period_s).arrives_hard(clutch, period_s) { longest = middle } else { shortest = middle }
        }
        plan((shortest * period_s + calibration.offset_s).max(0.0))
    }

    /// Pressure to be commanded at this time after the fill began, Pa.
    pub fn pressure(&self, elapsed_s: f64) -> f64 {
        let c = &self.calibration;
        // Times are sums of periods; a rounding error must not cost a whole one.
        let after_pulse_s = elapsed_s - self.pulse_s + 1e-9;
        let share = if after_pulse_s < 0.0 { 0.0 } else { (after_pulse_s / c.ramp_s).min(1.0) };
        self.kiss_pa + c.over_kiss_pa + share * (c.stroke_over_kiss_pa - c.over_kiss_pa)
    }

    /// How long it takes, s.
    pub fn duration_s(&self) -> f64 {
        self.pulse_s + self.calibration.ramp_s + self.calibration.hold_s
    }

    /// Whether the modelled piston ends its stroke while the pressure of the valve, which lags behind the ramp, is still above
    /// the kiss point by more than twice the pressure of the hold. The model is the nominal valve and cylinder, the piston
    /// on its stop at first.
    fn arrives_hard(&self, clutch: &ShiftClutch, period_s: f64) -> bool {
        let cylinder = &clutch.cylinder;
        let (mut valve_pa, mut volume_m3) = (0.0, 0.0_f64);
        let (mut time_s, mut next_command_s) = (0.0, 0.0);
        let mut line = DelayLine::new(clutch.valve.command_for(0.0));
        let gentle_pa = self.kiss_pa + 2.0 * self.calibration.stroke_over_kiss_pa;
        while time_s < self.duration_s() {
            if time_s >= next_command_s - 1e-9 {
                let command = clutch.valve.command_for(self.pressure(next_command_s));
                line.send(time_s, clutch.valve.delay(command), command);
                next_command_s += period_s;
            }
            let settled_pa = clutch.valve.settled_pressure(line.arrive(time_s));
            volume_m3 = (volume_m3 + STEP_S * cylinder.volume_rate(volume_m3, valve_pa)).max(0.0);
            valve_pa += STEP_S * clutch.valve.pressure_rate(valve_pa, settled_pa);
            if volume_m3 >= cylinder.stroke_m3 {
                return valve_pa > gentle_pa;
            }
            time_s += STEP_S;
        }
        false
    }
}
