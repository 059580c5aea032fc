//! A controller for shifts of all four kinds: one controller of the slip speed for the inertia phase, whose torque goes to
//! the clutch that slips in its direction.

use drivetrain::ShiftKind;

use crate::car::{Car, PERIOD_S, State};

/// What the controller believes: the nominal car.
pub struct Controller {
    pub nominal: Car,
    pub kind: ShiftKind,
    /// Torque at the turbine that each clutch is asked for at the last period, and pressure.
    asked_pa: [f64; 2],
    stage: Stage,
    request_s: f64,
    begun_s: f64,
    progress: f64,
    start_z: f64,
    integral: f64,
    wheel_output: f64,
    wheel_rate: f64,
    hold: [f64; 2],
    throttle: f64,
    slow_z_rate: f64,
    last_z: f64,
    pub done_s: Option<f64>,
}

#[derive(Clone, Copy, PartialEq, Debug)]
enum Stage {
    Gear,
    Fill,
    Torque,
    Inertia,
    HandOver,
    Lock,
}

const FILL_S: f64 = 0.3;
const TORQUE_S: f64 = 0.2;
const HAND_OVER_S: f64 = 0.15;
const BELOW_KISS_PA: f64 = 4e3;
/// Share of the pressure's own ramp that is led.
const LEAD: f64 = 0.8;
const LEAD_MOST_PA: f64 = 0.25e6;

impl Controller {
    pub fn new(nominal: Car, kind: ShiftKind, request_s: f64, state: &State) -> Self {
        Self {
            nominal,
            kind,
            asked_pa: state.pressure,
            stage: Stage::Gear,
            request_s,
            begun_s: 0.0,
            progress: 0.0,
            start_z: 0.0,
            integral: 0.0,
            wheel_output: state.output,
            wheel_rate: 0.0,
            hold: [0.0; 2],
            throttle: state.throttle,
            slow_z_rate: 0.0,
            last_z: 0.0,
            done_s: None,
        }
    }

    /// Pressure for a torque at the turbine.
    pub fn pressure(&self, c: usize, u: f64, slip: f64) -> f64 {
        let alpha = [self.nominal.shift.slip_offgoing, self.nominal.shift.slip_oncoming][c][0];
        self.nominal.clutches[c].pressure_for(u / alpha, slip)
    }

    fn ratios(&self) -> [f64; 2] {
        [self.nominal.shift.ratio_offgoing(), self.nominal.shift.ratio_oncoming()]
    }

    pub fn shifting(&self) -> bool {
        self.stage != Stage::Gear
    }

    /// Currents of both valves and throttle for the next period.
    pub fn step(&mut self, time_s: f64, s: &State) -> ([f64; 2], f64) {
        let [i_off, i_on] = self.ratios();
        let [y, z] = [s.turbine - i_off * s.output, s.turbine - i_on * s.output];
        let turbine = self.nominal.converter.torques(s.engine, s.turbine).turbine_n_m;
        let share = PERIOD_S / (PERIOD_S + 0.04);
        let before = self.wheel_output;
        self.wheel_output += share * (s.wheel * self.nominal.driveline.final_ratio - self.wheel_output);
        self.wheel_rate += share * ((self.wheel_output - before) / PERIOD_S - self.wheel_rate);
        self.slow_z_rate += 0.3 * ((z - self.last_z) / PERIOD_S - self.slow_z_rate);
        self.last_z = z;
        let first_torque = matches!(self.kind, ShiftKind::PowerOnUp | ShiftKind::CoastDown);
        let kiss = [0, 1].map(|c| self.nominal.clutches[c].kiss_pressure());
        let mut pressure = [0.0, 0.0];
        let mut throttle = self.throttle;
        match self.stage {
            Stage::Gear => {
                pressure[0] = self.pressure(0, 1.6 * turbine.abs().max(30.0), 0.0);
                if time_s >= self.request_s {
                    (self.stage, self.begun_s) = (Stage::Fill, time_s);
                }
            }
            Stage::Fill => {
                let along = ((time_s - self.begun_s) / FILL_S).min(1.0);
                pressure[0] = self.pressure(0, (1.6 - 0.4 * along) * turbine.abs().max(20.0), 0.0);
                pressure[1] = kiss[1] - BELOW_KISS_PA;
                if along >= 1.0 {
                    (self.stage, self.begun_s) =
                        (if first_torque { Stage::Torque } else { Stage::Inertia }, time_s);
                    self.begin_inertia(z);
                }
            }
            Stage::Torque => {
                // A flare is slip of the old gear in the direction of the turbine torque.
                let flares = y * turbine.signum() > 3.0;
                self.progress = (self.progress + PERIOD_S / TORQUE_S * if flares { 1.8 } else { 1.0 }).min(1.0);
                let p = self.progress;
                pressure[1] = self.pressure(1, turbine * p, z);
                let off = (1.10 * (1.0 - p)).max(if flares { 0.25 } else { 0.0 });
                pressure[0] = self.pressure(0, turbine * off, 0.0);
                let opened = y.abs() > 3.0 && y * turbine.signum() < 0.0;
                if p >= 1.0 || opened {
                    (self.stage, self.begun_s) = (Stage::Inertia, time_s);
                    self.begin_inertia(z);
                }
            }
            Stage::Inertia => {
                let longest = match self.kind {
                    ShiftKind::PowerOnUp | ShiftKind::CoastDown => 0.40,
                    ShiftKind::PowerOnDown => 0.65,
                    ShiftKind::PowerOffUp => 0.70,
                };
                let whole = longest * (self.start_z.abs() / 120.0).clamp(0.55, 1.3);
                let along = ((time_s - self.begun_s) / whole).min(1.0);
                let past = -2.5 * self.start_z.signum();
                let reference = past + (self.start_z - past) * 0.5 * (1.0 + (std::f64::consts::PI * along).cos());
                let rate = if along < 1.0 {
                    -(self.start_z - past) * 0.5 * std::f64::consts::PI / whole
                        * (std::f64::consts::PI * along).sin()
                } else {
                    0.0
                };
                let m11 = self.nominal.shift.mass_kg_m2[0][0];
                let error = s.turbine - i_on * self.wheel_output - reference;
                self.integral = (self.integral + 25.0 * m11 * error * PERIOD_S).clamp(-60.0, 60.0);
                let u = turbine - m11 * (rate + i_on * self.wheel_rate) + 9.0 * m11 * error + self.integral;
                let oncoming = u * (i_off - i_on) > 0.0;
                pressure[1] = if oncoming { self.pressure(1, u, z) } else { kiss[1] - BELOW_KISS_PA };
                pressure[0] = if oncoming { 0.0 } else { self.pressure(0, u, y) };
                self.hold = [if oncoming { 0.0 } else { u }, if oncoming { u } else { 0.0 }];
                if self.kind == ShiftKind::PowerOnUp {
                    let reduced = if along < 0.8 { 0.55 } else { 0.55 + 0.45 * (along - 0.8) / 0.2 };
                    // Over 80 ms: what an engine does.
                    let into = ((time_s - self.begun_s) / 0.08).min(1.0);
                    throttle = self.throttle * (1.0 + into * (reduced - 1.0));
                }
                let near = (z + 0.07 * self.slow_z_rate) * self.start_z.signum() <= 0.0;
                if first_torque && (z * self.start_z <= 0.0 || z.abs() < 1.0) {
                    (self.stage, self.begun_s) = (Stage::Lock, time_s);
                } else if !first_torque && near && along > 0.3 {
                    (self.stage, self.begun_s) = (Stage::HandOver, time_s);
                }
            }
            Stage::HandOver => {
                let along = ((time_s - self.begun_s) / HAND_OVER_S).min(1.0);
                pressure[1] = self.pressure(1, along * (1.25 * turbine.abs()).max(12.0), z);
                pressure[0] = self.pressure(0, self.hold[0] * (1.0 - along), y);
                if along >= 1.0 {
                    (self.stage, self.begun_s) = (Stage::Lock, time_s);
                }
            }
            Stage::Lock => {
                let along = ((time_s - self.begun_s) / 0.3).min(1.0);
                let least = (1.25 * turbine.abs()).max(12.0).max(self.hold[1].abs() * (1.0 - along));
                pressure[1] = self.pressure(1, least + along * turbine.abs(), 0.0);
                pressure[0] = 0.0;
                if along >= 1.0 {
                    self.done_s.get_or_insert(time_s);
                }
            }
        }
        let mut currents = [0.0; 2];
        for c in 0..2 {
            let rate = (pressure[c] - self.asked_pa[c]) / PERIOD_S;
            let lag = self.nominal.valves[c].time_constant_s.at(pressure[c].max(0.0));
            let lead = (LEAD * lag * rate).clamp(-LEAD_MOST_PA, LEAD_MOST_PA);
            self.asked_pa[c] = pressure[c];
            currents[c] = self.nominal.valves[c].current_for((pressure[c] + lead).clamp(0.0, 1.5e6));
        }
        (currents, throttle)
    }

    fn begin_inertia(&mut self, z: f64) {
        (self.start_z, self.integral) = (z, 0.0);
    }
}
