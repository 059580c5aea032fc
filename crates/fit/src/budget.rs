//! The error budget of a fitted file: what a fit leaves open, as ranges.

use drivetrain::Real;

use crate::verdict::SIDES;

/// Standard deviations in the error budget of a fitted file \[chosen: the ranges of `estimate` are to hold nearly always, not in 95 %
/// of the cars\].
pub(crate) const BUDGET_SIDES: f64 = 4.0;
/// Minimum error of a converter's maps, as a fraction \[chosen\].
pub(crate) const CONVERTER_FRACTION_MIN: f64 = 0.03;
/// What a line of the error budget says of itself.
pub(crate) const BUDGET_COMMENT: &str = "the interval of the fit, 4 standard deviations, and no wider than before";

/// The range of a factor on a fitted value. `value` is the fitted value over the given one, `sd` the standard deviation of its logarithm, and
/// `given` the range that was known around the given value: the fitted one lies elsewhere in it. The 95 % interval stays.
pub(crate) fn factors(sd: f64, value: f64, given: [f64; 2]) -> [f64; 2] {
    // No wider than the whole of what was known before, however much is open of it.
    let known = Real::ln(given[1] / given[0]);
    let half = (BUDGET_SIDES * sd).min(known);
    let [minimum, maximum] = given.map(|end| end / value);
    let stated = half * SIDES / BUDGET_SIDES;
    [Real::exp(-half).max(minimum.min(Real::exp(-stated))), Real::exp(half).min(maximum.max(Real::exp(stated)))]
}

/// Minimum and maximum delay of a fitted valve, s, from its delays at the ends of the command, with so much open to each side.
pub(crate) fn delays(at_ends_s: [f64; 2], half_s: f64) -> [f64; 2] {
    /// Longest delay of a valve that a file may have, s.
    const MAX_S: f64 = 0.5;
    let [one, other] = at_ends_s;
    [(one.min(other) - half_s).max(0.0), (one.max(other) + half_s).min(MAX_S)]
}

/// The same as a fraction on either side, of which `minimum` is always open.
pub(crate) fn fraction(sd: f64, value: f64, given: f64, minimum: f64) -> f64 {
    let known = given + (value - 1.0).abs();
    (BUDGET_SIDES * sd).clamp(minimum, known.max(minimum))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_is_no_wider_than_what_was_known_and_keeps_the_interval() {
        let around = |range: [f64; 2], expected: [f64; 2]| {
            range.iter().zip(expected).for_each(|(one, other)| assert!((one - other).abs() < 1e-3, "{range:?}"));
        };
        around(factors(0.01, 1.0, [0.5, 1.5]), [(-0.04_f64).exp(), 0.04_f64.exp()]);
        // The fitted value is near the end of what was known: beyond it only the 95 % interval.
        around(factors(0.05, 1.14, [0.85, 1.15]), [(-0.2_f64).exp(), 0.1_f64.exp()]);
        // What is not identified at all: the 95 % interval of a normal distribution over the same range.
        around(factors(1.0, 1.0, [0.5, 1.5]), [0.5, 3.0_f64.sqrt()]);
        assert_eq!(fraction(0.001, 1.0, 0.1, 0.03), 0.03);
        assert!((fraction(1.0, 0.9, 0.1, 0.03) - 0.2).abs() < 1e-12);
    }
}
