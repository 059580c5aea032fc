//! Models of the car's sensors.
//!
//! A speed sensor is a toothed wheel with a timer: it measures the times at which teeth pass, in steps of
//! the timer, and the speed is the number of teeth per time over at least a given number of tooth periods.
//! Its readings are delayed at low speed and coarse at high speed. Each sensor has its own delay and its own
//! sample rate.

mod errors;
mod teeth;

use car::{AccelerationSensor, CurrentSensor, SpeedSensor};
use rand_distr::{Distribution, StandardNormal, StandardUniform};
use rand_pcg::Pcg64Mcg;
use teeth::Teeth;

/// Longest time without a tooth after which the wheel is taken to stand, s.
const STANDSTILL_S: f64 = 0.2;
/// What two times may differ by and still be one, s: rounding, far below the period of any bus.
const SAME_TIME_S: f64 = 1e-9;
/// Where the tails of the normal distribution begin in the tables of `rand_distr`.
const TAIL: f64 = 3.654_152_885_361_009;

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

    /// A standard normal number. In the tails `rand_distr` takes it from the platform's logarithm: its last digits, which are another
    /// platform's own, are rounded away.
    fn normal(&mut self) -> f64 {
        let x: f64 = StandardNormal.sample(&mut self.0);
        // Rounding is the purpose.
        let rounded = f64::from(x as f32);
        if x.abs() < TAIL { x } else { rounded }
    }

    /// A number from 0 to 1, less than 1.
    fn uniform(&mut self) -> f64 {
        StandardUniform.sample(&mut self.0)
    }

    /// A whole number below `count`.
    fn below(&mut self, count: usize) -> usize {
        let at = (self.uniform() * count as f64) as usize;
        at.min(count.saturating_sub(1))
    }
}

/// The true values of a channel.
#[derive(Debug, Clone, Copy)]
pub struct Channel<'a> {
    /// Its name, which keeps its random numbers apart from those of other channels.
    pub name: &'a str,
    /// Rising times, s.
    pub time_s: &'a [f64],
    /// One value for each.
    pub values: &'a [f64],
}

/// The rows that readings arrive in.
#[derive(Debug, Clone, Copy)]
pub struct Rows<'a> {
    /// Rising times, s.
    pub at_s: &'a [f64],
    /// Their offset from multiples of their period, s: that of the clocks of all channels.
    pub offset_s: f64,
    /// Begin and end of the shift, s, in which single errors of the readings lie.
    pub shift_s: [f64; 2],
    /// Seed of the random numbers.
    pub seed: u64,
}

/// The readings of a channel, one place for each row.
#[derive(Debug, Clone, PartialEq)]
pub struct Readings {
    /// The reading that arrived since the row before; NaN where none did.
    pub values: Vec<f64>,
    /// How long before its row it was taken, s; NaN where there is none. A delay of the sensor itself is not in it,
    /// because a log does not tell it.
    pub age_s: Vec<f64>,
}

impl Readings {
    /// Whether some reading was taken before the time of its row.
    pub fn have_ages(&self) -> bool {
        self.age_s.iter().any(|&age_s| age_s > 0.0)
    }
}

/// Readings of a speed sensor: each is the speed by the teeth that had passed when it was taken.
///
/// # Panics
/// If there are not as many speeds as times.
pub fn read_speed(sensor: &SpeedSensor, truth: Channel<'_>, rows: Rows<'_>) -> Readings {
    assert_eq!(truth.time_s.len(), truth.values.len(), "one speed for each time");
    let mut teeth = Teeth::new(sensor, truth);
    let pitch = std::f64::consts::TAU / sensor.teeth;
    let mut noise = Noise::new(rows.seed, truth.name);
    let mut readings = taken(rows, Some(sensor.sample_time_s), sensor.offset_s, |taken_s| {
        let speed = tooth_speed(sensor, &mut teeth, taken_s - sensor.delay_s, pitch);
        sensor.errors.scale * speed + sensor.noise_rad_s * noise.normal()
    });
    errors::disturb(&mut readings, &sensor.errors, sensor.outlier_rad_s, truth.name, rows);
    readings
}

/// Readings of a current sensor, A; never negative, because the converter has no sign.
pub fn read_current(sensor: &CurrentSensor, truth: Channel<'_>, rows: Rows<'_>) -> Readings {
    let mut noise = Noise::new(rows.seed, truth.name);
    let mut readings = taken(rows, sensor.sample_time_s, sensor.offset_s, |taken_s| {
        // The command keeps its value until the next one.
        let commanded = truth.time_s.partition_point(|&time_s| time_s <= taken_s - sensor.delay_s + SAME_TIME_S);
        let current = truth.values[commanded.saturating_sub(1)];
        let analog = sensor.errors.scale * current + sensor.offset_a + sensor.noise_a * noise.normal();
        let step = sensor.resolution_a;
        if step > 0.0 { ((analog / step).round() * step).max(0.0) } else { analog.max(0.0) }
    });
    errors::disturb(&mut readings, &sensor.errors, sensor.outlier_a, truth.name, rows);
    readings
}

/// Readings of an accelerometer, m/s^2; between two records the acceleration is on the line through them.
pub fn read_acceleration(sensor: &AccelerationSensor, truth: Channel<'_>, rows: Rows<'_>) -> Readings {
    let mut noise = Noise::new(rows.seed, truth.name);
    let mut readings = taken(rows, Some(sensor.sample_time_s), sensor.offset_s, |taken_s| {
        let acceleration = on_line(truth, taken_s - sensor.delay_s);
        let analog = sensor.errors.scale * acceleration + sensor.bias_m_s2 + sensor.noise_m_s2 * noise.normal();
        let step = sensor.resolution_m_s2;
        if step > 0.0 { (analog / step).round() * step } else { analog }
    });
    errors::disturb(&mut readings, &sensor.errors, sensor.outlier_m_s2, truth.name, rows);
    readings
}

/// The value of a channel at a time, s, on the line between its records; beyond them the nearest one.
fn on_line(of: Channel<'_>, at_s: f64) -> f64 {
    let after = of.time_s.partition_point(|&time_s| time_s <= at_s).min(of.time_s.len().saturating_sub(1));
    let before = after.saturating_sub(1);
    let span_s = of.time_s[after] - of.time_s[before];
    let fraction = if span_s > 0.0 { ((at_s - of.time_s[before]) / span_s).clamp(0.0, 1.0) } else { 0.0 };
    of.values[before] + fraction * (of.values[after] - of.values[before])
}

/// Deals this many outliers out to `channels` channels, each to one drawn at random.
pub fn dealt(outliers: f64, channels: usize, seed: u64) -> Vec<f64> {
    let mut noise = Noise::new(seed, "outliers");
    let mut counts = vec![0.0; channels];
    for _ in 0..outliers as usize {
        counts[noise.below(channels)] += 1.0;
    }
    counts
}

/// The readings that a channel takes by its own clock, in the rows in which they arrive. Without a sample time there is
/// one in every row.
fn taken(rows: Rows<'_>, sample_time_s: Option<f64>, offset_s: f64, mut read: impl FnMut(f64) -> f64) -> Readings {
    let mut last_s = f64::NEG_INFINITY;
    let (values, age_s) = (rows.at_s.iter())
        .map(|&now_s| {
            let taken_s = sample_time_s.map_or(now_s, |period_s| {
                let first_s = rows.offset_s + offset_s;
                first_s + ((now_s - first_s) / period_s + SAME_TIME_S).floor() * period_s
            });
            if taken_s <= last_s + SAME_TIME_S {
                return (f64::NAN, f64::NAN);
            }
            last_s = taken_s;
            let age_s = now_s - taken_s;
            (read(taken_s), if age_s < SAME_TIME_S { 0.0 } else { age_s })
        })
        .unzip();
    Readings { values, age_s }
}

/// Speed by the teeth that passed until `now`, rad/s.
fn tooth_speed(sensor: &SpeedSensor, teeth: &mut Teeth<'_>, now: f64, pitch: f64) -> f64 {
    let Some(last) = teeth.last(now).filter(|last| now - last.time_s <= STANDSTILL_S) else { return 0.0 };
    let first_s = teeth.time_s(last.number - sensor.periods);
    first_s.map_or(0.0, |first_s| sensor.periods * pitch / (last.time_s - first_s))
}

#[cfg(test)]
mod tests {
    use car::ReadingErrors;

    use super::*;

    const SENSOR: SpeedSensor = SpeedSensor {
        teeth: 60.0,
        timer_s: 0.0,
        periods: 1.0,
        sample_time_s: 0.01,
        offset_s: 0.0,
        delay_s: 0.0,
        noise_rad_s: 0.0,
        errors: ReadingErrors::NONE,
        outlier_rad_s: 5.0,
    };

    /// Two seconds of a rising speed.
    fn ramp() -> (Vec<f64>, Vec<f64>) {
        (0..=2000).map(|i| f64::from(i) * 1e-3).map(|t| (t, 100.0 + 50.0 * t)).unzip()
    }

    fn rows(at_s: &[f64]) -> Rows<'_> {
        Rows { at_s, offset_s: 0.0, shift_s: [0.5, 1.0], seed: 1 }
    }

    /// What the sensor reads of the ramp in these rows.
    fn of_ramp(sensor: &SpeedSensor, rows: Rows<'_>) -> Readings {
        let (time_s, values) = ramp();
        read_speed(sensor, Channel { name: "x", time_s: &time_s, values: &values }, rows)
    }

    /// Rows at 100 Hz.
    fn hundred_hz() -> Vec<f64> {
        (0..200).map(|i| f64::from(i) * 0.01).collect()
    }

    /// Numbers of the rows in which two sensors read otherwise.
    fn differ(a: &Readings, b: &Readings) -> Vec<usize> {
        (0..a.values.len()).filter(|&i| a.values[i].to_bits() != b.values[i].to_bits()).collect()
    }

    #[test]
    fn a_perfect_wheel_reads_the_speed_half_a_tooth_ago() {
        let reading = of_ramp(&SENSOR, rows(&[1.0])).values[0];
        // A tooth passes every 0.7 ms, in which the speed rises by 0.035 rad/s.
        assert!((0.0..0.06).contains(&(150.0 - reading)), "{reading}");
    }

    #[test]
    fn a_coarse_timer_reads_in_steps() {
        let coarse = SpeedSensor { timer_s: 1e-5, ..SENSOR };
        let reading = of_ramp(&coarse, rows(&[1.0])).values[0];
        let ticks = std::f64::consts::TAU / 60.0 / reading / 1e-5;
        assert!((ticks - ticks.round()).abs() < 1e-6 && (ticks - 70.0).abs() < 2.0, "{ticks}");
    }

    #[test]
    fn readings_are_delayed_and_a_row_without_a_new_one_has_none() {
        let late = SpeedSensor { delay_s: 0.1, ..SENSOR };
        let readings = of_ramp(&late, rows(&[1.0, 1.004, 1.01]));
        assert!((readings.values[0] - 145.0).abs() < 0.1, "{readings:?}");
        assert!(readings.values[1].is_nan() && readings.age_s[1].is_nan());
        assert!(readings.values[2] > readings.values[0]);
        // The log does not tell the delay.
        assert!(!readings.have_ages());
    }

    #[test]
    fn a_channel_at_half_rate_has_a_reading_in_every_second_row() {
        let at_s = hundred_hz();
        let (whole, half) =
            (of_ramp(&SENSOR, rows(&at_s)), of_ramp(&SpeedSensor { sample_time_s: 0.02, ..SENSOR }, rows(&at_s)));
        for (i, (whole, half)) in whole.values.iter().zip(&half.values).enumerate() {
            assert!(if i % 2 == 0 { whole == half } else { half.is_nan() }, "row {i}: {whole} {half}");
        }
    }

    #[test]
    fn readings_of_a_channel_with_a_clock_of_its_own_are_as_old_as_their_age_says() {
        let beside = SpeedSensor { offset_s: 0.003, ..SENSOR };
        let at_s = hundred_hz();
        let readings = of_ramp(&beside, rows(&at_s));
        for (at, (value, age)) in at_s.iter().zip(readings.values.iter().zip(&readings.age_s)).skip(1) {
            assert!((age - 0.007).abs() < 1e-9, "{age}");
            // The last tooth passed up to one pitch before, and the reading is the mean over the pitch before it: up to
            // 1.6 ms.
            assert!((0.0..0.08).contains(&(100.0 + 50.0 * (at - age) - value)), "{value}");
        }
        // Rows that are late by as much see the readings when they are taken.
        let late: Vec<f64> = at_s.iter().map(|at| at + 0.003).collect();
        let with_rows = of_ramp(&SENSOR, Rows { offset_s: 0.003, ..rows(&late) });
        assert!(!with_rows.have_ages());
        let same = with_rows.values.iter().zip(&readings.values[1..]).all(|(a, b)| (a - b).abs() < 1e-9);
        assert!(same);
    }

    #[test]
    fn a_worn_tyre_reads_fast() {
        let at_s = hundred_hz();
        let worn = SpeedSensor { errors: ReadingErrors { scale: 1.02, ..ReadingErrors::NONE }, ..SENSOR };
        let (right, fast) = (of_ramp(&SENSOR, rows(&at_s)), of_ramp(&worn, rows(&at_s)));
        assert!(right.values.iter().zip(&fast.values).all(|(right, fast)| (fast / right - 1.02).abs() < 1e-12));
    }

    #[test]
    fn readings_are_lost_by_chance_and_the_rest_stay_as_they_are() {
        let at_s: Vec<f64> = (0..20_000).map(|i| f64::from(i) * 1e-4).collect();
        let noisy = SpeedSensor { sample_time_s: 1e-4, noise_rad_s: 0.1, ..SENSOR };
        let errors = ReadingErrors { missing_share: 0.03, ..ReadingErrors::NONE };
        let (all, some) = (of_ramp(&noisy, rows(&at_s)), of_ramp(&SpeedSensor { errors, ..noisy }, rows(&at_s)));
        let lost = differ(&all, &some);
        assert!(lost.iter().all(|&i| some.values[i].is_nan() && some.age_s[i].is_nan()));
        // Five standard deviations of a binomial count: 600 with a variance of 582.
        assert!(lost.len().abs_diff(600) < 5 * 24, "{}", lost.len());
    }

    #[test]
    fn a_burst_loses_every_reading_of_a_time_in_the_shift() {
        let at_s = hundred_hz();
        let with = |burst_s| SpeedSensor { errors: ReadingErrors { burst_s, ..ReadingErrors::NONE }, ..SENSOR };
        for (burst_s, count) in [(0.01, 1), (0.08, 8)] {
            for seed in 0..50 {
                let lost = of_ramp(&with(burst_s), Rows { seed, ..rows(&at_s) }).values;
                let lost: Vec<usize> = (0..200).filter(|&i| lost[i].is_nan()).collect();
                assert!(lost.len().abs_diff(count) <= 1 && lost.windows(2).all(|pair| pair[1] == pair[0] + 1));
                assert!(lost.iter().all(|i| (50..=100).contains(i)), "{lost:?}");
            }
        }
    }

    #[test]
    fn a_frozen_channel_repeats_its_last_reading_and_goes_on() {
        let at_s = hundred_hz();
        let errors = ReadingErrors { frozen_s: 0.1, ..ReadingErrors::NONE };
        let (moving, frozen) = (of_ramp(&SENSOR, rows(&at_s)), of_ramp(&SpeedSensor { errors, ..SENSOR }, rows(&at_s)));
        let held = differ(&moving, &frozen);
        assert!((9..=11).contains(&held.len()), "{held:?}");
        assert!(held.iter().all(|&i| frozen.values[i] == moving.values[held[0] - 1]));
        assert!(held[0] >= 50 && held[held.len() - 1] <= 100);
    }

    #[test]
    fn outliers_are_as_many_and_as_large_as_asked_and_lie_in_the_shift() {
        let at_s = hundred_hz();
        let errors = ReadingErrors { outliers: 3.0, missing_share: 0.2, ..ReadingErrors::NONE };
        let lossy = ReadingErrors { outliers: 0.0, ..errors };
        let mut signs = 0.0;
        for seed in 0..50 {
            let of = |errors| of_ramp(&SpeedSensor { errors, ..SENSOR }, Rows { seed, ..rows(&at_s) });
            let (right, wrong) = (of(lossy), of(errors));
            let off = differ(&right, &wrong);
            assert_eq!(off.len(), 3);
            for i in off {
                let by = wrong.values[i] - right.values[i];
                assert!((by.abs() - 5.0).abs() < 1e-9 && (50..=100).contains(&i), "{by} in row {i}");
                signs += by.signum();
            }
        }
        // Five standard deviations of a sum of 150 signs.
        assert!(signs.abs() < 5.0 * 150.0_f64.sqrt(), "{signs}");
        assert_eq!(dealt(3.0, 4, 1).iter().sum::<f64>(), 3.0);
        let first = (0..400).filter(|&seed| dealt(1.0, 4, seed)[0] > 0.0).count();
        assert!(first.abs_diff(100) < 5 * 9, "{first}");
    }

    #[test]
    fn errors_follow_from_seed_and_channel_and_one_kind_leaves_the_others_and_the_noise_alone() {
        let at_s = hundred_hz();
        let (time_s, values) = ramp();
        let of = |errors, seed, name| {
            let noisy = SpeedSensor { errors, noise_rad_s: 0.1, ..SENSOR };
            let truth = Channel { name, time_s: &time_s, values: &values };
            read_speed(&noisy, truth, Rows { seed, ..rows(&at_s) })
        };
        let none = ReadingErrors::NONE;
        let kinds = [
            ReadingErrors { missing_share: 0.1, ..none },
            ReadingErrors { burst_s: 0.05, ..none },
            ReadingErrors { frozen_s: 0.05, ..none },
            ReadingErrors { outliers: 3.0, ..none },
        ];
        // The rows that an error touches.
        let rows = |errors, seed, name| differ(&of(none, seed, name), &of(errors, seed, name));
        for errors in kinds {
            assert_eq!(rows(errors, 1, "x"), rows(errors, 1, "x"));
            assert_ne!(rows(errors, 1, "x"), rows(errors, 2, "x"));
            assert_ne!(rows(errors, 1, "x"), rows(errors, 1, "y"));
        }
        let both = ReadingErrors { outliers: 3.0, burst_s: 0.05, ..none };
        let lost: Vec<usize> = (0..200).filter(|&i| of(both, 1, "x").values[i].is_nan()).collect();
        assert_eq!(lost, rows(kinds[1], 1, "x"));
        assert_eq!(rows(both, 1, "x").len(), lost.len() + 3);
    }

    #[test]
    fn a_standing_wheel_reads_zero() {
        let time_s: Vec<f64> = (0..1000).map(|i| f64::from(i) * 1e-3).collect();
        let values: Vec<f64> = time_s.iter().map(|t| if *t < 0.5 { 50.0 } else { 0.0 }).collect();
        let readings = read_speed(&SENSOR, Channel { name: "x", time_s: &time_s, values: &values }, rows(&[0.4, 0.9]));
        assert!((readings.values[0] - 50.0).abs() < 1e-6 && readings.values[1] == 0.0, "{readings:?}");
        let standing = vec![0.0; 1000];
        let readings =
            read_speed(&SENSOR, Channel { name: "x", time_s: &time_s, values: &standing }, rows(&[0.0, 0.9]));
        assert_eq!(readings.values, [0.0, 0.0]);
    }

    #[test]
    fn a_record_that_begins_in_motion_has_readings_from_its_first_row() {
        let late = SpeedSensor { delay_s: 0.03, periods: 10.0, ..SENSOR };
        let at_s = hundred_hz();
        let readings = of_ramp(&late, rows(&at_s));
        assert!(readings.values[..3].iter().all(|value| (value - 100.0).abs() < 0.1), "{:?}", &readings.values[..3]);
    }

    #[test]
    fn the_same_seed_gives_the_same_noise_and_another_sensor_other_noise() {
        let sensor = CurrentSensor { noise_a: 0.01, offset_a: 0.1, ..CurrentSensor::EXACT };
        let time_s: Vec<f64> = (0..4000).map(|i| f64::from(i) * 1e-3).collect();
        let values = vec![0.5; 4000];
        let read = |seed, name| {
            read_current(&sensor, Channel { name, time_s: &time_s, values: &values }, Rows { seed, ..rows(&time_s) })
                .values
        };
        assert_eq!(read(7, "a"), read(7, "a"));
        assert!(read(7, "a") != read(7, "b") && read(7, "a") != read(8, "a"));
        let mean = read(7, "a").iter().sum::<f64>() / 4000.0;
        // Five standard errors of the mean.
        assert!((mean - 0.6).abs() < 5.0 * 0.01 / 4000.0_f64.sqrt());
    }

    #[test]
    fn a_command_that_is_late_or_slow_is_the_one_of_its_time() {
        let time_s: Vec<f64> = (0..100).map(|i| f64::from(i) * 1e-3).collect();
        // The command changes every 10 ms.
        let values: Vec<f64> = (0..100).map(|i| 0.1 * f64::from(i / 10)).collect();
        let read = |sensor: CurrentSensor| {
            let at_s: Vec<f64> = (0..10).map(|i| f64::from(i) * 0.01).collect();
            read_current(&sensor, Channel { name: "x", time_s: &time_s, values: &values }, rows(&at_s))
        };
        let (exact, late) = (read(CurrentSensor::EXACT), read(CurrentSensor { delay_s: 0.01, ..CurrentSensor::EXACT }));
        assert_eq!(exact.values[1..9], late.values[2..]);
        let slow = read(CurrentSensor { sample_time_s: Some(0.02), offset_s: 0.01, ..CurrentSensor::EXACT });
        assert!(slow.values[1] == exact.values[1] && slow.values[2].is_nan() && slow.values[3] == exact.values[3]);
    }
}
