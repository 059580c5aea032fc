//! Whether a Kalman filter is as sure as it may be, and whether it gives the same in single precision.

use drivetrain::Real;
use observer::{Estimator, Health, KalmanFilter, Phase};
use serde::Serialize;
use trace::{Trace, TraceError, signal};

use crate::{RunColumns, true_phases};

/// Standard deviations that hold 95 % of a normal distribution.
const BAND_95: f64 = 1.96;
/// A difference between the precisions that nobody would see, Pa.
const SAME_PA: f64 = 1e3;
/// Position of the pressure in [`observer::kalman::STATES`].
const PRESSURE: usize = 4;

/// Sums over the samples of a shift, and of the time after it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Consistency {
    /// Samples in the torque and inertia phase.
    pub samples: u64,
    /// Of these, with the true pressure in the filter's own 95 % band.
    pub inside: u64,
    /// Sum over them of the squared error of the pressure over its variance, NEES: 1 for each is expected.
    pub squared_errors: f64,
    /// Readings of turbine, output and wheel speed that were taken in these phases.
    pub readings: [u64; 3],
    /// Sums of their squared innovations over their variances, NIS.
    pub squared_innovations: [f64; 3],
    /// Samples in the torque and inertia phase and after the shift.
    pub compared: u64,
    /// Of these, with less than 1 kPa between single and double precision.
    pub same: u64,
    /// Largest difference of the pressure between single and double precision, Pa.
    pub largest_pa: f64,
    /// Sums of the squared errors of the pressure over the shift in double and in single precision, Pa^2.
    pub squares_pa2: [f64; 2],
    /// Times that the filter began anew in single precision but not in double.
    pub restarts: u64,
}

impl Consistency {
    /// Runs the filter in both precisions over a drive behind sensors.
    ///
    /// # Errors
    /// A signal is missing.
    pub fn of(filter: &KalmanFilter<f64>, trace: &Trace, columns: &RunColumns<'_>) -> Result<Self, TraceError> {
        let truth = trace.require(signal::ONCOMING_PRESSURE)?;
        let phases = true_phases(trace).unwrap_or_default();
        let single = filter.cast::<f32>();
        let (mut double_state, mut single_state) = (filter.start(), single.start());
        let mut sums = Self::default();
        for ((sample, &truth), &phase) in columns.samples().zip(truth).zip(&phases) {
            let Ok((input, ())) = sample;
            let double = filter.step(&mut double_state, &input);
            let narrow = single.step(&mut single_state, &input.cast());
            sums.restarts += u64::from(narrow.health == Health::Restarted && double.health != Health::Restarted);
            if phase == Phase::BeforeShift {
                continue;
            }
            let difference = (f64::from(narrow.pressure_pa) - double.pressure_pa).abs();
            sums.compared += 1;
            sums.same += u64::from(difference < SAME_PA);
            sums.largest_pa = sums.largest_pa.max(difference);
            if phase == Phase::AfterShift {
                continue;
            }
            let errors = [double.pressure_pa - truth, f64::from(narrow.pressure_pa) - truth];
            for (sum, error) in sums.squares_pa2.iter_mut().zip(errors) {
                *sum += error * error;
            }
            let Some(states) = double_state.states() else { continue };
            let squared = Real::powi((double.pressure_pa - truth) / states[PRESSURE].1, 2);
            sums.samples += 1;
            sums.inside += u64::from(squared <= BAND_95 * BAND_95);
            sums.squared_errors += squared;
            for (k, innovation) in double_state.squared_innovations().into_iter().enumerate() {
                if let Some(innovation) = innovation {
                    sums.readings[k] += 1;
                    sums.squared_innovations[k] += innovation;
                }
            }
        }
        Ok(sums)
    }

    /// The sums of both.
    #[must_use]
    pub fn with(mut self, other: &Self) -> Self {
        self.samples += other.samples;
        self.inside += other.inside;
        self.squared_errors += other.squared_errors;
        for k in 0..self.readings.len() {
            self.readings[k] += other.readings[k];
            self.squared_innovations[k] += other.squared_innovations[k];
        }
        self.compared += other.compared;
        self.same += other.same;
        self.largest_pa = self.largest_pa.max(other.largest_pa);
        for (sum, other) in self.squares_pa2.iter_mut().zip(other.squares_pa2) {
            *sum += other;
        }
        self.restarts += other.restarts;
        self
    }

    /// Fraction of the samples with the truth in the filter's own 95 % band.
    pub fn inside_fraction(&self) -> f64 {
        self.inside as f64 / self.samples as f64
    }

    /// Mean of the squared error of the pressure over its variance.
    pub fn nees(&self) -> f64 {
        self.squared_errors / self.samples as f64
    }

    /// Mean of the squared innovations of turbine, output and wheel speed over their variances.
    pub fn nis(&self) -> [f64; 3] {
        core::array::from_fn(|k| self.squared_innovations[k] / self.readings[k] as f64)
    }

    /// Fraction of the samples with less than 1 kPa between single and double precision.
    pub fn same_fraction(&self) -> f64 {
        self.same as f64 / self.compared as f64
    }

    /// By how much the RMS error in single precision exceeds that in double, as a fraction.
    pub fn excess_in_single(&self) -> f64 {
        (self.squares_pa2[1] / self.squares_pa2[0]).sqrt() - 1.0
    }
}
