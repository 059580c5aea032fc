//! The middle of a ratio of two speeds, over a log of any length.

use std::ops::Range;

use drivetrain::Real;

/// Counts of ratios from 1/20 to 20 by their logarithm, in so many bins for a factor of e.
pub struct RatioHistogram<const FINE: u32> {
    counts: Vec<u32>,
    /// The bin of the ratio before, and ratios that are in it for certain: a car keeps its ratio for long.
    last: usize,
    within: Range<f64>,
}

impl<const FINE: u32> Default for RatioHistogram<FINE> {
    fn default() -> Self {
        Self { counts: vec![0; 6 * FINE as usize], last: 0, within: 0.0..0.0 }
    }
}

impl<const FINE: u32> RatioHistogram<FINE> {
    const FINE: f64 = FINE as f64;
    /// The place of a ratio of 1.
    const ONE: f64 = 3.0 * Self::FINE;

    /// Counts a ratio.
    pub fn push(&mut self, ratio: f64) {
        /// Fraction by which a ratio near the end of a bin may be taken for one in the next.
        const ROUNDING: f64 = 1e-9;
        if !self.within.contains(&ratio) {
            let place = Real::ln(ratio) * Self::FINE + Self::ONE;
            if !(0.0..2.0 * Self::ONE).contains(&place) {
                return;
            }
            // From the ratio to an end of the bin: of the exponential of less than a hundredth, these two powers stay within it.
            let factor = |way: f64| 1.0 + way + 0.5 * way * way;
            let [down, up] = [place.floor() - place, place.floor() + 1.0 - place].map(|way| factor(way / Self::FINE));
            self.within = ratio * down * (1.0 + ROUNDING)..ratio * up * (1.0 - ROUNDING);
            let bin = place as usize;
            self.last = bin;
        }
        self.counts[self.last] = self.counts[self.last].saturating_add(1);
    }

    /// Fraction of the ratios that are within this fraction of one.
    pub fn fraction_near(&self, ratio: f64, within: f64) -> f64 {
        let place = |ratio: f64| Real::ln(ratio) * Self::FINE + Self::ONE;
        let [minimum, maximum] = [1.0 - within, 1.0 + within].map(|factor| place(ratio * factor));
        let (mut all, mut near) = (0.0, 0.0);
        for (bin, count) in (0_u32..).zip(&self.counts) {
            all += f64::from(*count);
            if (minimum..maximum).contains(&(f64::from(bin) + 0.5)) {
                near += f64::from(*count);
            }
        }
        near / all
    }

    /// The middle ratio, to half a bin; not a number without any.
    pub fn middle(&self) -> f64 {
        let all: u64 = self.counts.iter().map(|count| u64::from(*count)).sum();
        let mut below = 0;
        for (place, count) in (0_u32..).zip(&self.counts) {
            below += u64::from(*count);
            if 2 * below > all {
                return Real::exp((f64::from(place) + 0.5 - Self::ONE) / Self::FINE);
            }
        }
        f64::NAN
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ratio_is_counted_in_the_bin_of_its_logarithm_whatever_the_one_before_was() {
        // Slow changes, jumps, and the ends of bins from both sides.
        let slow = (0..100_000).map(|i| 0.9 + 2e-6 * f64::from(i));
        let ends = (-310_i32..310).map(|bin| (f64::from(bin) / 100.0).exp());
        let near = ends.flat_map(|end| [end, end * (1.0 - 1e-12), end * (1.0 + 1e-12), end * (1.0 - 1e-15), 2.5]);
        let odd = [0.0, -1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e-300, 1e300];
        let mut histogram = RatioHistogram::<100>::default();
        let mut expected = vec![0_u32; 600];
        for ratio in slow.chain(near).chain(odd) {
            histogram.push(ratio);
            let place = ratio.ln() * 100.0 + 300.0;
            if (0.0..600.0).contains(&place) {
                expected[place as usize] += 1;
            }
        }
        assert_eq!(histogram.counts, expected);
    }

    #[test]
    fn the_middle_is_known_to_half_a_bin() {
        let mut histogram = RatioHistogram::<1000>::default();
        assert!(histogram.middle().is_nan());
        for (ratio, times) in [(0.3, 40), (2.8123, 100), (2.86, 50)] {
            (0..times).for_each(|_| histogram.push(ratio));
        }
        assert!((histogram.middle() / 2.8123 - 1.0).abs() < 0.0006, "{}", histogram.middle());
        assert!((histogram.fraction_near(2.8123, 0.01) - 100.0 / 190.0).abs() < 1e-9);
        assert!((histogram.fraction_near(2.8123, 0.03) - 150.0 / 190.0).abs() < 1e-9);
    }
}
