//! What a car's sensors make of the truth.
//!
//! A speed sensor is a toothed wheel with a timer: it knows the times at which teeth passed, in steps of
//! the timer, and reads the speed as teeth per time over at least a given number of tooth periods. At low
//! speed its readings are old, at high speed coarse. A reading reaches the controller with its delay and
//! at its own rate.

use config::{CurrentSensor, SpeedSensor};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

/// Longest time without a tooth after which the wheel is taken to stand, s.
const STANDSTILL_S: f64 = 0.2;

/// Random numbers of one sensor; the same seed and name give the same numbers.
#[derive(Debug, Clone)]
pub struct Noise(Pcg64Mcg);

impl Noise {
    /// The noise of the sensor called `name` under this seed.
    pub fn new(seed: u64, name: &str) -> Self {
        // FNV-1a keeps the sensors' numbers apart whatever their order.
        let hash = name
            .bytes()
            .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3));
        Self(Pcg64Mcg::new((u128::from(seed) << 64) | u128::from(hash) | 1))
    }

    fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }
}

/// Readings of a speed sensor at the times `at_s`, from the true speed over rising `time_s`.
///
/// # Panics
/// If there are not as many speeds as times.
pub fn read_speed(
    sensor: &SpeedSensor,
    time_s: &[f64],
    speed_rad_s: &[f64],
    at_s: &[f64],
    mut noise: Noise,
) -> Vec<f64> {
    assert_eq!(time_s.len(), speed_rad_s.len(), "one speed for each time");
    let edges = tooth_times(sensor, time_s, speed_rad_s);
    let pitch = std::f64::consts::TAU / sensor.teeth;
    let mut latest: Option<(f64, f64)> = None;
    at_s.iter()
        .map(|&now| {
            // A new reading is taken at the sensor's own rate and held in between.
            let slot = (now / sensor.sample_time_s + 1e-9).floor() * sensor.sample_time_s;
            match latest {
                Some((taken, value)) if taken >= slot => value,
                _ => {
                    let speed = tooth_speed(sensor, &edges, slot - sensor.delay_s, pitch);
                    let value = speed + sensor.noise_rad_s * noise.normal();
                    latest = Some((slot, value));
                    value
                }
            }
        })
        .collect()
}

/// Times at which teeth pass, in steps of the timer.
fn tooth_times(sensor: &SpeedSensor, time_s: &[f64], speed_rad_s: &[f64]) -> Vec<f64> {
    let pitch = std::f64::consts::TAU / sensor.teeth;
    let ticks_per_s = if sensor.timer_s > 0.0 { 1.0 / sensor.timer_s } else { 0.0 };
    let tick = |time: f64| if ticks_per_s > 0.0 { (time * ticks_per_s).round() * sensor.timer_s } else { time };
    let mut edges = Vec::new();
    // How far the wheel has to turn until the next tooth passes.
    let mut to_go = pitch;
    for i in 1..time_s.len() {
        let (dt, from, to) = (time_s[i] - time_s[i - 1], speed_rad_s[i - 1].abs(), speed_rad_s[i].abs());
        let turned = 0.5 * (from + to) * dt;
        let mut next = to_go;
        while next <= turned {
            // Within the interval the speed changes linearly: the angle is a quadratic function of time.
            let bend = (to - from) / dt;
            let root = (from * from + 2.0 * bend * next).max(0.0).sqrt();
            edges.push(tick(time_s[i - 1] + 2.0 * next / (from + root)));
            next += pitch;
        }
        to_go = next - turned;
    }
    edges
}

/// Speed by the teeth that passed until `now`, rad/s.
fn tooth_speed(sensor: &SpeedSensor, edges: &[f64], now: f64, pitch: f64) -> f64 {
    let passed = edges.partition_point(|&edge| edge <= now);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked to be 1 to 100")]
    let periods = sensor.periods as usize;
    if passed <= periods {
        return 0.0;
    }
    let (last, first) = (edges[passed - 1], edges[passed - 1 - periods]);
    if now - last > STANDSTILL_S { 0.0 } else { sensor.periods * pitch / (last - first) }
}

/// Readings of a current sensor, A; never negative, as the converter knows no sign.
pub fn read_current(sensor: &CurrentSensor, current_a: &[f64], mut noise: Noise) -> Vec<f64> {
    (current_a.iter())
        .map(|current| {
            let analog = current + sensor.offset_a + sensor.noise_a * noise.normal();
            let step = sensor.resolution_a;
            if step > 0.0 { ((analog / step).round() * step).max(0.0) } else { analog.max(0.0) }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SENSOR: SpeedSensor =
        SpeedSensor { teeth: 60.0, timer_s: 0.0, periods: 1.0, sample_time_s: 0.01, delay_s: 0.0, noise_rad_s: 0.0 };

    fn ramp() -> (Vec<f64>, Vec<f64>) {
        (0..=2000).map(|i| f64::from(i) * 1e-3).map(|t| (t, 100.0 + 50.0 * t)).unzip()
    }

    #[test]
    fn a_perfect_wheel_reads_the_speed_half_a_tooth_ago() {
        let (time, speed) = ramp();
        let reading = read_speed(&SENSOR, &time, &speed, &[1.0], Noise::new(1, "x"))[0];
        // A tooth passes every 0.7 ms, in which the speed rises by 0.035 rad/s.
        assert!((0.0..0.06).contains(&(150.0 - reading)), "{reading}");
    }

    #[test]
    fn a_coarse_timer_reads_in_steps() {
        let (time, speed) = ramp();
        let coarse = SpeedSensor { timer_s: 1e-5, ..SENSOR };
        let reading = read_speed(&coarse, &time, &speed, &[1.0], Noise::new(1, "x"))[0];
        let ticks = std::f64::consts::TAU / 60.0 / reading / 1e-5;
        assert!((ticks - ticks.round()).abs() < 1e-6 && (ticks - 70.0).abs() < 2.0, "{ticks}");
    }

    #[test]
    fn readings_are_delayed_and_held_between_their_slots() {
        let (time, speed) = ramp();
        let late = SpeedSensor { delay_s: 0.1, ..SENSOR };
        let at = [1.0, 1.004, 1.01];
        let readings = read_speed(&late, &time, &speed, &at, Noise::new(1, "x"));
        assert!((readings[0] - 145.0).abs() < 0.1, "{readings:?}");
        assert_eq!(readings[0], readings[1]);
        assert!(readings[2] > readings[1]);
    }

    #[test]
    fn a_standing_wheel_reads_zero() {
        let time: Vec<f64> = (0..1000).map(|i| f64::from(i) * 1e-3).collect();
        let speed: Vec<f64> = time.iter().map(|t| if *t < 0.5 { 50.0 } else { 0.0 }).collect();
        let readings = read_speed(&SENSOR, &time, &speed, &[0.0, 0.4, 0.9], Noise::new(1, "x"));
        assert!(readings[0] == 0.0 && (readings[1] - 50.0).abs() < 1e-6 && readings[2] == 0.0, "{readings:?}");
    }

    #[test]
    fn the_same_seed_gives_the_same_noise_and_another_sensor_other_noise() {
        let sensor = CurrentSensor { noise_a: 0.01, offset_a: 0.1, resolution_a: 0.0 };
        let current = vec![0.5; 4000];
        let read = |seed, name| read_current(&sensor, &current, Noise::new(seed, name));
        assert_eq!(read(7, "a"), read(7, "a"));
        assert!(read(7, "a") != read(7, "b") && read(7, "a") != read(8, "a"));
        let mean = read(7, "a").iter().sum::<f64>() / 4000.0;
        // Five standard errors of the mean.
        assert!((mean - 0.6).abs() < 5.0 * 0.01 / 4000.0_f64.sqrt());
    }
}
