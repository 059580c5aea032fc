//! Frequency weighting of the acceleration along the car: `W_d` of ISO 2631-1:1997, which stands for how much a seated person feels.
//!
//! ```text
//! H(s) = s^2 / (s^2 + sqrt(2) w_1 s + w_1^2)  *  (1 + s/w_3) / (1 + s/(Q_4 w_4) + (s/w_4)^2)
//! ```
//!
//! with 0.4 Hz, 2 Hz and 2 Hz for `w_1`, `w_3` and `w_4`, and `Q_4 = 0.63`. Left out is the band limit of 100 Hz: samples every 10 ms have
//! nothing there. Each factor is integrated by the trapezoidal rule, so that samples need not be even.

use std::f64::consts::{SQRT_2, TAU};

/// Corner frequencies, Hz, and quality of the weighting.
const HIGH_PASS_HZ: f64 = 0.4;
const TRANSITION_HZ: f64 = 2.0;
const TRANSITION_QUALITY: f64 = 0.63;

/// A factor `(b_0 + b_1 s + b_2 s^2) / (a_0 + a_1 s + s^2)` with its state.
#[derive(Debug, Clone, Copy)]
struct Section {
    a: [f64; 2],
    b: [f64; 3],
    x: [f64; 2],
    /// The last input.
    input: f64,
}

impl Section {
    /// At rest with this input.
    fn at_rest(a: [f64; 2], b: [f64; 3], input: f64) -> Self {
        Self { a, b, x: [input / a[0], 0.0], input }
    }

    /// The output after `step_s`, s, over which the input goes to this value in a line.
    fn step(&mut self, step_s: f64, input: f64) -> f64 {
        let ([a0, a1], [b0, b1, b2], [x, dx]) = (self.a, self.b, self.x);
        let half = 0.5 * step_s;
        let rest = [x + half * dx, dx - half * (a0 * x + a1 * dx) + half * (self.input + input)];
        let determinant = 1.0 + half * a1 + half * half * a0;
        self.x = [
            (rest[0] * (1.0 + half * a1) + half * rest[1]) / determinant,
            (rest[1] - half * a0 * rest[0]) / determinant,
        ];
        self.input = input;
        (b0 - b2 * a0) * self.x[0] + (b1 - b2 * a1) * self.x[1] + b2 * input
    }
}

/// The weighting on its way through samples.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Weighting {
    high_pass: Section,
    transition: Section,
}

impl Weighting {
    /// Of a car with this acceleration for a long time, m/s^2: the weighted one is zero.
    pub(crate) fn at_rest(acceleration_m_s2: f64) -> Self {
        let [w1, w4] = [HIGH_PASS_HZ, TRANSITION_HZ].map(|hz| TAU * hz);
        Self {
            high_pass: Section::at_rest([w1 * w1, SQRT_2 * w1], [0.0, 0.0, 1.0], acceleration_m_s2),
            transition: Section::at_rest([w4 * w4, w4 / TRANSITION_QUALITY], [w4 * w4, w4, 0.0], 0.0),
        }
    }

    /// The weighted acceleration, m/s^2, `step_s` after the last one, s.
    pub(crate) fn step(&mut self, step_s: f64, acceleration_m_s2: f64) -> f64 {
        let passed = self.high_pass.step(step_s, acceleration_m_s2);
        self.transition.step(step_s, passed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Factors of ISO 2631-1:1997, table 3, at nominal third-octave frequencies.
    #[test]
    fn a_sine_has_the_factor_of_the_standard() {
        const FACTORS: [(f64, f64); 10] = [
            (0.4, 0.713),
            (0.8, 0.992),
            (1.0, 1.011),
            (1.6, 0.968),
            (2.0, 0.890),
            (3.15, 0.642),
            (4.0, 0.512),
            (5.0, 0.409),
            (8.0, 0.253),
            (12.5, 0.161),
        ];
        for (hz, factor) in FACTORS {
            let mut weighting = Weighting::at_rest(0.0);
            let step_s = 5e-4;
            let (mut largest, settled_s) = (0.0f64, 8.0);
            for at in 1..((settled_s + 2.0 / hz) / step_s) as i32 {
                let time_s = step_s * f64::from(at);
                let weighted = weighting.step(step_s, (TAU * hz * time_s).sin());
                largest = if time_s > settled_s { largest.max(weighted.abs()) } else { 0.0 };
            }
            assert!((largest / factor - 1.0).abs() < 0.005, "{hz:.2} Hz: {largest:.4}, {factor}");
        }
    }

    #[test]
    fn a_constant_acceleration_is_not_felt_and_uneven_samples_say_the_same() {
        let mut constant = Weighting::at_rest(2.5);
        assert!((0..300).all(|_| constant.step(0.01, 2.5).abs() < 1e-12));
        let (mut even, mut uneven) = (Weighting::at_rest(0.0), Weighting::at_rest(0.0));
        let acceleration = |time_s: f64| (TAU * time_s).sin();
        let mut found = [Vec::new(), Vec::new()];
        for at in 1..1000 {
            let time_s = 0.002 * f64::from(at);
            let value = even.step(0.002, acceleration(time_s));
            // Steps of 2 ms and 4 ms in turn.
            let step = at % 3;
            if step != 1 {
                let length_s = if step == 2 { 0.004 } else { 0.002 };
                found[0].push(value);
                found[1].push(uneven.step(length_s, acceleration(time_s)));
            }
        }
        let [one, other] = found;
        assert!(one.iter().zip(&other).all(|(a, b)| (a - b).abs() < 2e-3));
    }
}
