//! Jerk of the car in a shift: one definition for simulated and measured shifts.
//!
//! The jerk at a time is the second derivative of the parabola with the least squares of distances to the speed of the car over
//! 0.3 s around it, in m/s^3. That of a shift is its maximum magnitude from 0.3 s before the shift to some tenths of a second after it.
//! Where the acceleration is known, its integral stands for the speed. Speeds that come faster than every 10 ms are averaged over 10 ms
//! first.
//!
//! A longitudinal acceleration that swings with a frequency `f` and an amplitude `a` shows with a jerk of nearly `2 pi f a` up to
//! 1 Hz, of half of it at 3 Hz, and of nothing from 6 Hz on. Shorter windows follow the noise of speeds on a vehicle bus: the
//! rounding to 0.05 km/h at 50 Hz alone has a standard deviation of 4 m/s^3 over 0.1 s, and of 0.3 m/s^3 over 0.3 s.

/// Time over which a parabola is laid, s.
pub const WINDOW_S: f64 = 0.3;
/// Speeds that come faster are averaged over this time, s.
const BIN_S: f64 = 0.01;
/// Points that a parabola needs, and most that there are.
const MINIMUM: usize = 7;
const MAXIMUM: usize = 40;
/// Room for a window to move on.
const ROOM: usize = 2 * MAXIMUM;
/// Times are sums of periods, and differ in their last digits, s.
const ROUNDING_S: f64 = 1e-6;
/// Steps that differ by no more than this from the first of them are equal, s: in a window of them no time is further than forty times this
/// from even ones, which changes a jerk by less than 0.001 m/s^3 where the car
/// accelerates with 10 m/s^2.
const EVEN_S: f64 = 1e-9;
/// A window is whole if it is no shorter than this fraction: bins of uneven clocks.
const WHOLE: f64 = 0.95;

/// The maximum jerk of a motion that is shown time by time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PeakJerk {
    /// Times, s, and speeds, m/s: those of the window stand one after the other, the oldest first, and move on with it.
    points: [(f64, f64); ROOM],
    first: usize,
    count: usize,
    /// The newest steps that are equal: their length, s, and how many there are.
    even: (f64, usize),
    bin: Bin,
    /// Time, acceleration and speed of the integral.
    integral: Option<[f64; 3]>,
    peak_m_s3: Option<f64>,
}

/// Speeds that are averaged.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Bin {
    first_s: f64,
    times_s: f64,
    speeds_m_s: f64,
    count: f64,
}

impl Default for PeakJerk {
    fn default() -> Self {
        let points = [(0.0, 0.0); ROOM];
        Self { points, first: 0, count: 0, even: (f64::NAN, 0), bin: Bin::default(), integral: None, peak_m_s3: None }
    }
}

impl PeakJerk {
    /// Takes the speed of the car, m/s, at a time after the last one.
    pub fn speed(&mut self, time_s: f64, speed_m_s: f64) {
        if self.bin.count > 0.0 && time_s >= self.bin.first_s + BIN_S - ROUNDING_S {
            let Bin { times_s, speeds_m_s, count, .. } = core::mem::take(&mut self.bin);
            self.point(times_s / count, speeds_m_s / count);
        }
        if self.bin.count == 0.0 {
            self.bin.first_s = time_s;
        }
        self.bin.times_s += time_s;
        self.bin.speeds_m_s += speed_m_s;
        self.bin.count += 1.0;
    }

    /// Takes the acceleration of the car, m/s^2, in place of its speed.
    pub fn acceleration(&mut self, time_s: f64, acceleration_m_s2: f64) {
        let speed_m_s = self.integral.map_or(0.0, |[last_s, last_m_s2, speed_m_s]| {
            speed_m_s + 0.5 * (last_m_s2 + acceleration_m_s2) * (time_s - last_s)
        });
        self.integral = Some([time_s, acceleration_m_s2, speed_m_s]);
        self.speed(time_s, speed_m_s);
    }

    /// The maximum magnitude so far, m/s^3; none before there was a whole window of seven speeds.
    pub fn peak_m_s3(&self) -> Option<f64> {
        self.peak_m_s3
    }

    /// Whether nothing was taken yet.
    pub fn is_unused(&self) -> bool {
        self.count == 0 && self.bin.count == 0.0
    }

    fn point(&mut self, time_s: f64, speed_m_s: f64) {
        let points = &self.points[self.first..self.first + self.count];
        let old = points.iter().take_while(|(old_s, _)| *old_s < time_s - WINDOW_S - ROUNDING_S).count();
        let out = old.max((self.count + 1).saturating_sub(MAXIMUM));
        (self.first, self.count) = (self.first + out, self.count - out);
        if self.first + self.count == ROOM {
            self.points.copy_within(self.first.., 0);
            self.first = 0;
        }
        if let Some((last_s, _)) = self.points[self.first..self.first + self.count].last() {
            let step_s = time_s - last_s;
            self.even = match self.even {
                (even_s, steps) if (step_s - even_s).abs() <= EVEN_S => (even_s, steps + 1),
                _ => (step_s, 1),
            };
        }
        self.points[self.first + self.count] = (time_s, speed_m_s);
        self.count += 1;
        let points = &self.points[self.first..self.first + self.count];
        let derivative = if self.even.1 + 1 >= self.count { even_second_derivative } else { second_derivative };
        if points.len() >= MINIMUM
            && time_s - points[0].0 >= WHOLE * WINDOW_S
            && let Some(jerk) = derivative(points)
        {
            self.peak_m_s3 = Some(self.peak_m_s3.map_or(jerk.abs(), |peak| peak.max(jerk.abs())));
        }
    }
}

/// The second derivative of the parabola with the least squares of distances.
fn second_derivative(points: &[(f64, f64)]) -> Option<f64> {
    derivatives(points, points.first()?.0).map(|[_, second]| second)
}

/// First and second derivative at this time, s, of the parabola with the least squares of distances to these times and values; none where
/// three of the times are not different.
pub fn derivatives(points: &[(f64, f64)], at_s: f64) -> Option<[f64; 2]> {
    let ((first_s, first), (last_s, _)) = (*points.first()?, *points.last()?);
    let (middle_s, half_s) = (0.5 * (first_s + last_s), 0.5 * (last_s - first_s));
    // Normal equations in times from -1 to 1; with speeds over the first one their sums keep their digits.
    let (mut powers, mut values) = ([0.0; 5], [0.0; 3]);
    for (time_s, value) in points {
        let time = (time_s - middle_s) / half_s;
        let square = time * time;
        for (sum, power) in powers.iter_mut().zip([1.0, time, square, time * square, square * square]) {
            *sum += power;
        }
        for (sum, power) in values.iter_mut().zip([1.0, time, square]) {
            *sum += power * (value - first);
        }
    }
    let mut sums = [0, 1, 2].map(|i| [powers[i], powers[i + 1], powers[i + 2], values[i]]);
    // The matrix is symmetric and positive definite: no pivots are needed.
    for i in 0..2 {
        let pivot = sums[i];
        if pivot[i].abs() <= 1e-9 || pivot[i].is_nan() {
            return None;
        }
        for row in sums.iter_mut().skip(i + 1) {
            let factor = row[i] / pivot[i];
            for (cell, above) in row.iter_mut().zip(pivot) {
                *cell -= factor * above;
            }
        }
    }
    let quadratic = sums[2][3] / sums[2][2];
    let linear = (sums[1][3] - sums[1][2] * quadratic) / sums[1][1];
    let time = (at_s - middle_s) / half_s;
    let both = [(linear + 2.0 * quadratic * time) / half_s, 2.0 * quadratic / (half_s * half_s)];
    Some(both).filter(|both| both.iter().all(|derivative| derivative.is_finite()))
}

/// The same of points at even times. From the middle, in half steps, their squares less the mean square are the weights: two points that
/// are as far from it have the same one.
fn even_second_derivative(points: &[(f64, f64)]) -> Option<f64> {
    let ((first_s, _), (last_s, _)) = (*points.first()?, *points.last()?);
    let count = points.len() as f64;
    let squares = count * count - 1.0;
    let mean = squares / 3.0;
    let (mut sum, mut from_middle) = (0.0, count - 1.0);
    for ((_, early), (_, late)) in points.iter().zip(points.iter().rev()).take(points.len() / 2) {
        sum += (from_middle * from_middle - mean) * (early + late);
        from_middle -= 2.0;
    }
    if points.len() % 2 == 1 {
        sum -= mean * points[points.len() / 2].1;
    }
    // The sum of the weights' squares.
    let weights = count * squares * (3.0 * count * count - 7.0) / 15.0 - count * mean * mean;
    let step_s = (last_s - first_s) / (count - 1.0);
    Some(8.0 * sum / (weights * step_s * step_s)).filter(|jerk| jerk.is_finite())
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use std::vec::Vec;

    fn peak(step_s: f64, count: i32, speed: impl Fn(f64) -> f64) -> Option<f64> {
        let mut jerk = PeakJerk::default();
        (0..count).map(|i| f64::from(i) * step_s).for_each(|time_s| jerk.speed(time_s, speed(time_s)));
        jerk.peak_m_s3()
    }

    #[test]
    fn the_jerk_of_a_parabola_is_its_second_derivative_at_every_rate() {
        for (step_s, count) in [(0.001, 500), (0.003, 200), (0.01, 50), (0.02, 30), (0.05, 12)] {
            let found = peak(step_s, count, |t| 30.0 - 2.0 * t + 7.0 * t * t).unwrap();
            assert!((found - 14.0).abs() < 1e-6, "{step_s}: {found}");
        }
        // Too few speeds, and too short a time.
        assert_eq!((peak(0.1, 100, |t| t * t), peak(0.01, 28, |t| t * t)), (None, None));
    }

    #[test]
    fn even_times_have_the_parabola_of_any_times() {
        for count in MINIMUM..=MAXIMUM {
            let speed = |i: usize| 30.0 + (0.7 * i as f64).sin() + 1e-3 * (i * i % 17) as f64;
            let points: Vec<(f64, f64)> = (0..count).map(|i| (100.0 + 0.01 * i as f64, speed(i))).collect();
            let [even, any] =
                [even_second_derivative, second_derivative].map(|derivative| derivative(&points).unwrap());
            assert!((even - any).abs() < 1e-8 * any.abs().max(1.0), "{count}: {even} {any}");
        }
        // One step that is longer.
        let jerk = |late_s: f64| {
            let mut jerk = PeakJerk::default();
            let time_s = |i: i32| 0.01 * f64::from(i) + if i > 20 { late_s } else { 0.0 };
            (0..40).map(time_s).for_each(|t| jerk.speed(t, 3.0 * t * t));
            jerk.peak_m_s3().unwrap()
        };
        assert!([0.0, 1e-3, 5e-3, 8e-8].into_iter().all(|late_s| (jerk(late_s) - 6.0).abs() < 1e-6));
    }

    #[test]
    fn an_acceleration_gives_the_jerk_of_its_speed() {
        let mut jerk = PeakJerk::default();
        assert!(jerk.is_unused());
        (0..500).map(|i| f64::from(i) * 1e-3).for_each(|t| jerk.acceleration(t, 5.0 * t));
        assert!((jerk.peak_m_s3().unwrap() - 5.0).abs() < 1e-3, "{jerk:?}");
        // A jump of the acceleration by 1 m/s^2 in the middle of a parabola of continuous time: 15 / 8 over its length. 31 bins of 10 ms
        // are 0.31 s.
        let step = peak(0.001, 1000, |t| (t - 0.5).max(0.0)).unwrap();
        assert!((step - 15.0 / 8.0 / (WINDOW_S + BIN_S)).abs() < 0.005 * step, "{step}");
    }

    #[test]
    fn what_cannot_be_is_no_jerk() {
        assert_eq!(peak(0.0, 100, |_| 1.0), None);
        assert_eq!(peak(0.01, 100, |_| f64::NAN), None);
        assert!(peak(0.01, 100, |t| if t > 0.5 { f64::INFINITY } else { t }).unwrap() < 1e-6);
    }
}
