//! What a speed cannot be predicted of: the errors of a torque balance that last.
//!
//! The error of a speed is noise of its reading and the integral of noise of the torques and of two disturbances: the grade, which changes
//! smoothly over the way, with the correlation `(1 + x) exp(-x)`, and the error of a torque, which changes over time, with `exp(-x)`. A Kalman
//! filter of these errors alone turns residuals, and each column of their derivatives, into independent numbers of variance 1: generalised
//! least squares.

use drivetrain::Real;
use nalgebra::{Matrix4, RowVector4, Vector4};

/// Standard deviation of the speed at the begin of a stretch, rad/s: nothing is known of it.
const START_RAD_S: f64 = 1e3;

/// How much of the disturbances passes: way and time, over those in which they change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Passing {
    pub(crate) grade: f64,
    pub(crate) torque: f64,
}

impl Passing {
    /// From one drive to another.
    pub(crate) const ALL: Self = Self { grade: 100.0, torque: 100.0 };

    /// The transition of speed, grade, its change, and torque, each in its standard deviation.
    fn transition(self) -> Matrix4<f64> {
        let (x, stays) = (self.grade, Real::exp(-self.grade));
        let mut transition = Matrix4::identity();
        transition[(1, 1)] = stays * (1.0 + x);
        transition[(1, 2)] = stays * x;
        transition[(2, 1)] = -stays * x;
        transition[(2, 2)] = stays * (1.0 - x);
        transition[(3, 3)] = Real::exp(-self.torque);
        transition
    }
}

/// How grade and torque act in a step, and what of them passes in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Step {
    pub(crate) step_s: f64,
    /// Standard deviations of grade and torque error, rad/s^2.
    pub(crate) sd_rad_s2: [f64; 2],
    /// That of noise, rad/s^2.
    pub(crate) white_rad_s2: f64,
    pub(crate) passing: Passing,
}

/// Makes the rows of columns independent of each other.
pub(crate) struct Whitening {
    /// Covariance of the error of the speed, rad/s, and of the disturbances in their standard deviations.
    covariance: Matrix4<f64>,
    /// Their estimates for each column.
    states: Vec<Vector4<f64>>,
    /// Variance of a reading.
    noise: f64,
    log_variance: f64,
}

impl Whitening {
    /// For so many columns, and readings of this standard deviation, rad/s.
    pub(crate) fn new(columns: usize, reading_rad_s: f64) -> Self {
        let states = vec![Vector4::zeros(); columns];
        Self { covariance: Matrix4::identity(), states, noise: reading_rad_s * reading_rad_s, log_variance: 0.0 }
    }

    /// Sum of the logarithms of the variances that the rows had.
    pub(crate) fn log_variance(&self) -> f64 {
        self.log_variance
    }

    /// Begins a stretch whose speed does not follow from what was before.
    pub(crate) fn begin(&mut self, passing: Passing) {
        self.disturb(passing);
        for other in 1..4 {
            self.covariance[(0, other)] = 0.0;
            self.covariance[(other, 0)] = 0.0;
        }
        self.covariance[(0, 0)] = START_RAD_S * START_RAD_S;
        self.states.iter_mut().for_each(|state| state[0] = 0.0);
    }

    /// Goes on by a step.
    pub(crate) fn step(&mut self, step: Step) {
        let mut motion = Matrix4::identity();
        motion[(0, 1)] = step.step_s * step.sd_rad_s2[0];
        motion[(0, 3)] = step.step_s * step.sd_rad_s2[1];
        self.covariance = motion * self.covariance * motion.transpose();
        self.covariance[(0, 0)] += Real::powi(step.step_s * step.white_rad_s2, 2);
        self.states.iter_mut().for_each(|state| *state = motion * *state);
        self.disturb(step.passing);
    }

    /// What passes of the disturbances: their variance stays 1.
    fn disturb(&mut self, passing: Passing) {
        let transition = passing.transition();
        let new = Matrix4::identity() - transition * transition.transpose();
        self.covariance = transition * self.covariance * transition.transpose() + new;
        self.states.iter_mut().for_each(|state| *state = transition * *state);
    }

    /// Turns a row, an entry for each column, into what was not to be predicted of it, in its standard deviations.
    pub(crate) fn take(&mut self, row: &mut [f64]) {
        let speed = RowVector4::new(1.0, 0.0, 0.0, 0.0);
        let with_speed = self.covariance.column(0).into_owned();
        let variance = with_speed[0] + self.noise;
        let gain = with_speed / variance;
        self.log_variance += Real::ln(variance);
        for (state, value) in self.states.iter_mut().zip(row) {
            let error = *value - state[0];
            *state += gain * error;
            *value = error / variance.sqrt();
        }
        // The symmetric form keeps the covariance positive.
        let left = Matrix4::identity() - gain * speed;
        self.covariance = left * self.covariance * left.transpose() + gain * gain.transpose() * self.noise;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const READING_RAD_S: f64 = 0.1;

    /// Speeds with the errors that the filter is made for become independent numbers of variance 1.
    #[test]
    fn errors_of_the_model_become_independent() {
        // A generator of its own: sums of twelve uniform numbers.
        let mut seed = 1_u64;
        let mut normal = move || {
            let uniform = (0..12).map(|_| {
                seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (seed >> 11) as f64 / (1_u64 << 53) as f64
            });
            uniform.sum::<f64>() - 6.0
        };
        let passing = Passing { grade: 0.05, torque: 0.1 };
        let step = Step { step_s: 0.1, sd_rad_s2: [2.0, 0.5], white_rad_s2: 0.5, passing };
        let transition = passing.transition();
        let new = (Matrix4::identity() - transition * transition.transpose()).view((1, 1), (3, 3)).into_owned();
        let new = new.cholesky().unwrap().l();
        let (mut whitening, mut errors) = (Whitening::new(1, READING_RAD_S), Vec::new());
        let mut state = Vector4::new(0.0, normal(), normal(), normal());
        for at in 0..20_000 {
            if at % 100 == 0 {
                whitening.begin(Passing { grade: 0.0, torque: 0.0 });
                state[0] = 100.0 * normal();
            } else {
                whitening.step(step);
                state[0] += 0.1 * (2.0 * state[1] + 0.5 * state[3] + 0.5 * normal());
                let more = &new * nalgebra::Vector3::new(normal(), normal(), normal());
                state = transition * state + Vector4::new(0.0, more[0], more[1], more[2]);
            }
            let speed = state[0];
            let mut row = [speed + READING_RAD_S * normal()];
            whitening.take(&mut row);
            errors.push(row[0]);
        }
        let mean = |lag: usize| {
            let count = (errors.len() - lag) as f64;
            errors.iter().zip(&errors[lag..]).map(|(a, b)| a * b).sum::<f64>() / count
        };
        assert!((mean(0) - 1.0).abs() < 0.05, "{}", mean(0));
        (1..6).for_each(|lag| assert!(mean(lag).abs() < 0.03, "{lag}: {}", mean(lag)));
    }
}
