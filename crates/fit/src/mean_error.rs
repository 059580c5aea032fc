//! Errors over a few shifts, and how far those over many may be from them.

use std::fmt;

use drivetrain::Real;

use crate::weights::NORMAL_95;

/// Shifts of which a mean has an interval.
const MIN_SHIFTS: usize = 3;

/// A mean error over shifts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeanError {
    /// Over these shifts.
    pub value: f64,
    /// Holds that over many such shifts in 95 %; none of fewer than three shifts, which say nothing useful of their scatter.
    pub interval: Option<[f64; 2]>,
}

impl MeanError {
    /// The mean of an error of each shift; none without shifts.
    pub(crate) fn of(errors: &[f64]) -> Option<Self> {
        let count = errors.len() as f64;
        let value = errors.iter().sum::<f64>() / count;
        let squares = errors.iter().map(|error| Real::powi(error - value, 2)).sum::<f64>();
        let std_dev = (squares / (count - 1.0) / count).sqrt();
        // Of the logarithm: an error is not below zero.
        let half = student_95(count - 1.0) * std_dev / value;
        let within = || if value > 0.0 { [-half, half].map(|side| value * Real::exp(side)) } else { [value; 2] };
        let interval = (errors.len() >= MIN_SHIFTS).then(within);
        (!errors.is_empty()).then_some(Self { value, interval })
    }

    /// The root of the mean of a squared error of each shift; none without shifts.
    pub(crate) fn rms(squares: &[f64]) -> Option<Self> {
        Self::of(squares).map(|square| square.map(f64::sqrt))
    }

    /// In another unit.
    pub fn map(self, unit: impl Fn(f64) -> f64) -> Self {
        Self { value: unit(self.value), interval: self.interval.map(|interval| interval.map(unit)) }
    }
}

/// `1.23 (95 % 1.01 to 1.50)`, with as many decimals as are asked for.
impl fmt::Display for MeanError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let decimals = f.precision().unwrap_or(2);
        write!(f, "{:.decimals$}", self.value)?;
        match self.interval {
            Some([low, high]) => write!(f, " (95 % {low:.decimals$} to {high:.decimals$})"),
            None => Ok(()),
        }
    }
}

/// Half of the interval that holds a value of Student's distribution in 95 %, with so many degrees of freedom: Cornish and Fisher's series, within
/// 4 % from two degrees on.
fn student_95(degrees: f64) -> f64 {
    let z = NORMAL_95;
    let polynomials = [
        (Real::powi(z, 3) + z) / 4.0,
        (5.0 * Real::powi(z, 5) + 16.0 * Real::powi(z, 3) + 3.0 * z) / 96.0,
        (3.0 * Real::powi(z, 7) + 19.0 * Real::powi(z, 5) + 17.0 * Real::powi(z, 3) - 15.0 * z) / 384.0,
    ];
    polynomials.iter().rev().fold(0.0, |sum, term| (sum + term) / degrees) + z
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_tables() {
        for (degrees, quantile) in [(2.0, 4.303), (3.0, 3.182), (5.0, 2.571), (10.0, 2.228), (60.0, 2.000)] {
            let found = student_95(degrees);
            assert!((found / quantile - 1.0).abs() < 0.04, "{degrees}: {found}");
        }
    }

    #[test]
    fn intervals_of_few_shifts_hold_the_error_of_many() {
        // Errors of shifts between 0.5 and 1.5 by Marsaglia's generator: their mean is 1.
        let mut bits = 88_172_645_463_325_252_u64;
        let mut draw = || {
            bits ^= bits << 13;
            bits ^= bits >> 7;
            bits ^= bits << 17;
            0.5 + (bits >> 11) as f64 / (1_u64 << 53) as f64
        };
        for count in [3, 5, 12] {
            let holds = (0..2000).filter(|_| {
                let errors: Vec<f64> = (0..count).map(|_| draw()).collect();
                let [low, high] = MeanError::of(&errors).unwrap().interval.unwrap();
                (low..=high).contains(&1.0)
            });
            let holds = holds.count();
            assert!((1840..=1990).contains(&holds), "{count}: {holds} of 2000");
        }
    }

    #[test]
    fn few_shifts_have_no_interval_and_none_has_no_error() {
        assert_eq!(MeanError::of(&[]), None);
        let rms = MeanError::rms(&[4.0]).unwrap();
        assert_eq!((rms.value, rms.interval, MeanError::rms(&[4.0, 5.0]).unwrap().interval), (2.0, None, None));
        assert_eq!(format!("{rms:.1}"), "2.0");
        assert_eq!(format!("{:.1}", MeanError::rms(&[4.0; 3]).unwrap()), "2.0 (95 % 2.0 to 2.0)");
        assert_eq!(format!("{:.1}", MeanError::rms(&[0.0; 3]).unwrap()), "0.0 (95 % 0.0 to 0.0)");
    }
}
