//! What the speeds of a log show of a gearbox and a driveline that nobody has described: the ratios in which the car was driven, the
//! final ratio, and the wheel.

use drivetrain::Real;

use crate::{Reading, Role};

/// Bins of a factor of e, and the powers of e from 1 that are counted: ratios from 0.22 to 20.
const FINE: f64 = 500.0;
const LOWEST: f64 = -1.5;
const BINS: usize = 2_250;
/// Bins on either side that count as the same ratio: 1 %.
const SAME: usize = 5;
/// Bins on either side that are looked at for a slope: 3 %.
const NEAR: usize = 15;
/// Bins between two gears: 6 %.
const APART: usize = 30;
/// A gear is driven for so long, s, and for so many times the time in the ratios on both sides of it \[chosen\].
const DRIVEN_S: f64 = 1.5;
const SHARP: f64 = 2.0;
/// Slower shafts say nothing, rad/s, m/s.
const TURBINE_MIN_RAD_S: f64 = 40.0;
const OUTPUT_MIN_RAD_S: f64 = 15.0;
const VEHICLE_MIN_M_S: f64 = 3.0;
/// Readings that count as of one time, s.
const TOGETHER_S: f64 = 0.03;
/// Longest time that one reading stands for, s.
const STANDS_S: f64 = 0.2;
/// Readings of the turbine that wait for the next one of the output.
const WAITING: usize = 256;

/// A gear in which the car was driven.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeenGear {
    /// Turbine over output speed.
    pub ratio: f64,
    /// For how long, s.
    pub time_s: f64,
    /// Its number by the gear signal, if there is one.
    pub number: Option<u32>,
}

/// The readings of a log, as far as ratios follow from them.
#[derive(Debug, Clone)]
pub struct SeenGears {
    /// Time in each ratio, s, and that time multiplied by the number of the gear.
    time_s: Vec<f64>,
    gear_s: Vec<f64>,
    output_over_wheel: Middle,
    output_per_vehicle: Middle,
    vehicle_per_wheel: Middle,
    /// Time and value of the newest reading.
    newest: [(f64, f64); 5],
    /// Turbine speeds since the newest output speed.
    waiting: Vec<Waiting>,
    gear: Option<f64>,
    engine_torque_n_m: f64,
}

/// A turbine speed that waits for the output speed after it: with that before it alone, its ratio would be off while the car accelerates.
#[derive(Debug, Clone, Copy)]
struct Waiting {
    time_s: f64,
    turbine_rad_s: f64,
    /// For how long it stands, s.
    stands_s: f64,
    gear: Option<f64>,
}

/// The places of signals in [`SeenGears::newest`].
const ROLES: [Role; 5] =
    [Role::TurbineSpeed, Role::OutputSpeed, Role::WheelSpeed, Role::VehicleSpeed, Role::EngineTorque];
const TURBINE: usize = 0;
const OUTPUT: usize = 1;
const WHEEL: usize = 2;
const VEHICLE: usize = 3;

impl Default for SeenGears {
    fn default() -> Self {
        Self {
            time_s: vec![0.0; BINS],
            gear_s: vec![0.0; BINS],
            output_over_wheel: Middle::default(),
            output_per_vehicle: Middle::default(),
            vehicle_per_wheel: Middle::default(),
            newest: [(f64::NEG_INFINITY, f64::NAN); 5],
            waiting: Vec::new(),
            gear: None,
            engine_torque_n_m: f64::NEG_INFINITY,
        }
    }
}

impl SeenGears {
    /// Takes a reading.
    pub fn push(&mut self, reading: &Reading) {
        let Reading { role, time_s, value, .. } = *reading;
        if role == Role::Gear {
            self.gear = Some(value);
        }
        let Some(at) = ROLES.iter().position(|other| *other == role) else { return };
        if role == Role::EngineTorque {
            self.engine_torque_n_m = self.engine_torque_n_m.max(value);
        }
        let before = std::mem::replace(&mut self.newest[at], (time_s, value));
        let [output, wheel, vehicle] = [OUTPUT, WHEEL, VEHICLE].map(|other| {
            let (other_s, value) = self.newest[other];
            if time_s - other_s <= TOGETHER_S { value } else { f64::NAN }
        });
        let is_driven = output > OUTPUT_MIN_RAD_S;
        match at {
            // Neutral and reverse are no forward gears.
            TURBINE if value > TURBINE_MIN_RAD_S && self.gear.is_none_or(|gear| gear > 0.0) => {
                let stands_s = (time_s - before.0).clamp(0.0, STANDS_S);
                let now = Waiting { time_s, turbine_rad_s: value, stands_s, gear: self.gear };
                match self.newest[OUTPUT] {
                    (same_s, output) if same_s == time_s => self.take_ratio(now, output),
                    _ if self.waiting.len() < WAITING => self.waiting.push(now),
                    _ => {}
                }
            }
            OUTPUT => self.take_waiting(before, (time_s, value)),
            WHEEL if wheel > 0.0 && is_driven => self.output_over_wheel.push(output / wheel),
            VEHICLE if vehicle > VEHICLE_MIN_M_S => {
                self.output_per_vehicle.push(output / vehicle);
                self.vehicle_per_wheel.push(vehicle / wheel);
            }
            _ => {}
        }
    }

    /// Takes the turbine speeds between two output speeds, each a time, s, and a value.
    fn take_waiting(&mut self, (from_s, from): (f64, f64), (to_s, to): (f64, f64)) {
        let between = from_s..=to_s;
        let is_near = to_s - from_s <= STANDS_S;
        let mut waiting = std::mem::take(&mut self.waiting);
        for one in waiting.drain(..) {
            if one.time_s == to_s {
                self.take_ratio(one, to);
            } else if is_near && between.contains(&one.time_s) {
                self.take_ratio(one, from + (to - from) * (one.time_s - from_s) / (to_s - from_s));
            }
        }
        self.waiting = waiting;
    }

    /// Takes the ratio of a turbine speed and the output speed at its time, rad/s.
    fn take_ratio(&mut self, Waiting { turbine_rad_s, stands_s, gear, .. }: Waiting, output_rad_s: f64) {
        let place = (Real::ln(turbine_rad_s / output_rad_s) - LOWEST) * FINE;
        if output_rad_s > OUTPUT_MIN_RAD_S && (0.0..BINS as f64).contains(&place) {
            self.time_s[place as usize] += stands_s;
            self.gear_s[place as usize] += stands_s * gear.unwrap_or(f64::NAN);
        }
    }

    /// The gears in which the car was driven, the lowest first.
    pub fn gears(&self) -> Vec<SeenGear> {
        let sum = |values: &[f64], at: usize, within: usize| -> f64 {
            values[at.saturating_sub(within)..(at + within + 1).min(BINS)].iter().sum()
        };
        let near_s: Vec<f64> = (0..BINS).map(|at| sum(&self.time_s, at, SAME)).collect();
        let mut order: Vec<usize> = (0..BINS).filter(|at| near_s[*at] >= DRIVEN_S).collect();
        order.sort_by(|one, other| near_s[*other].total_cmp(&near_s[*one]).then(one.cmp(other)));
        let mut peaks: Vec<usize> = Vec::new();
        for at in order {
            let is_sharp = near_s[at] >= SHARP * (sum(&self.time_s, at, NEAR) - near_s[at]);
            if is_sharp && peaks.iter().all(|peak| peak.abs_diff(at) > APART) {
                peaks.push(at);
            }
        }
        peaks.sort_unstable_by(|one, other| other.cmp(one));
        let gear = |at: usize| {
            let bins = at.saturating_sub(SAME)..(at + SAME + 1).min(BINS);
            let mean = bins.map(|bin| self.time_s[bin] * (bin as f64 + 0.5)).sum::<f64>() / near_s[at];
            let number = sum(&self.gear_s, at, SAME) / near_s[at];
            let is_number = (number - number.round()).abs() < 0.1 && number >= 0.5;
            SeenGear {
                ratio: Real::exp(mean / FINE + LOWEST),
                time_s: near_s[at],
                number: is_number.then_some(number.round() as u32),
            }
        };
        peaks.into_iter().map(gear).collect()
    }

    /// Gearbox output speed over wheel speed.
    pub fn final_ratio(&self) -> Option<f64> {
        self.output_over_wheel.of_many()
    }

    /// Gearbox output speed over the speed of the car, rad/m: final ratio over wheel radius.
    pub fn output_rad_per_m(&self) -> Option<f64> {
        self.output_per_vehicle.of_many()
    }

    /// Rolling radius of the wheels, m.
    pub fn wheel_radius_m(&self) -> Option<f64> {
        self.vehicle_per_wheel.of_many()
    }

    /// The largest engine torque, N m.
    pub fn engine_torque_n_m(&self) -> Option<f64> {
        Some(self.engine_torque_n_m).filter(|torque| torque.is_finite())
    }
}

/// The middle of numbers, in bins of 0.02 %.
#[derive(Debug, Clone, Default)]
struct Middle {
    counts: std::collections::BTreeMap<i64, u64>,
    all: u64,
}

impl Middle {
    const FINE: f64 = 5_000.0;
    /// Fewer say nothing.
    const MANY: u64 = 100;

    fn push(&mut self, value: f64) {
        if value.is_finite() && value > 0.0 {
            *self.counts.entry((Real::ln(value) * Self::FINE).round() as i64).or_default() += 1;
            self.all += 1;
        }
    }

    fn of_many(&self) -> Option<f64> {
        let mut below = 0;
        let middle = self.counts.iter().find(|(_, count)| {
            below += **count;
            2 * below > self.all
        });
        middle.filter(|_| self.all >= Self::MANY).map(|(place, _)| Real::exp(*place as f64 / Self::FINE))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Takes speeds every 10 ms.
    fn drive(seen: &mut SeenGears, span_s: [f64; 2], speeds: impl Fn(f64) -> Vec<(Role, f64)>) {
        for step in 0..((span_s[1] - span_s[0]) * 100.0) as u32 {
            let time_s = span_s[0] + 0.01 * f64::from(step);
            for (role, value) in speeds(time_s) {
                seen.push(&Reading { role, time_s, stamp_s: time_s, value });
            }
        }
    }

    #[test]
    fn ratios_that_are_driven_are_gears_and_those_of_a_shift_are_none() {
        let mut seen = SeenGears::default();
        let speeds = |ratio: f64, time_s: f64| {
            // Noise of half a per cent.
            let noise = 1.0 + 0.005 * Real::sin(731.0 * time_s);
            vec![(Role::OutputSpeed, 80.0), (Role::TurbineSpeed, 80.0 * ratio * noise)]
        };
        drive(&mut seen, [0.0, 10.0], |time_s| speeds(3.0, time_s));
        drive(&mut seen, [10.0, 14.0], |time_s| speeds(3.0 - 0.25 * (time_s - 10.0), time_s));
        drive(&mut seen, [14.0, 17.0], |time_s| speeds(2.0, time_s));
        // Too short for a gear.
        drive(&mut seen, [17.0, 18.0], |time_s| speeds(1.2, time_s));
        let gears = seen.gears();
        assert_eq!(gears.len(), 2, "{gears:?}");
        for (gear, ratio) in gears.iter().zip([3.0, 2.0]) {
            assert!((gear.ratio / ratio - 1.0).abs() < 0.003 && gear.number.is_none(), "{gear:?}");
        }
    }

    #[test]
    fn gears_have_the_numbers_of_the_signal_and_reverse_is_none() {
        let mut seen = SeenGears::default();
        let speeds = |gear: f64, ratio: f64| {
            move |_| vec![(Role::Gear, gear), (Role::OutputSpeed, 50.0), (Role::TurbineSpeed, 50.0 * ratio)]
        };
        drive(&mut seen, [0.0, 5.0], speeds(-1.0, 3.3));
        drive(&mut seen, [5.0, 10.0], speeds(2.0, 2.5));
        drive(&mut seen, [10.0, 15.0], speeds(4.0, 1.0));
        let found: Vec<_> = seen.gears().into_iter().map(|gear| gear.number).collect();
        assert_eq!(found, [Some(2), Some(4)]);
    }

    #[test]
    fn final_ratio_and_wheel_follow_from_output_wheel_and_car() {
        let mut seen = SeenGears::default();
        drive(&mut seen, [0.0, 5.0], |_| {
            vec![(Role::OutputSpeed, 90.0), (Role::WheelSpeed, 30.0), (Role::VehicleSpeed, 9.3)]
        });
        let close = |found: Option<f64>, value: f64| (found.unwrap() / value - 1.0).abs() < 3e-4;
        assert!(close(seen.final_ratio(), 3.0) && close(seen.wheel_radius_m(), 0.31));
        assert!(close(seen.output_rad_per_m(), 90.0 / 9.3) && seen.engine_torque_n_m().is_none());
        let nothing = SeenGears::default();
        assert!(nothing.final_ratio().is_none() && nothing.gears().is_empty());
    }
}
