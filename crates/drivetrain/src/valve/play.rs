//! Hysteresis of a valve.

use crate::Real;

/// A play operator: the output rests until the input has moved by the half-width away from it, and then follows at
/// this distance.
///
/// It is the hysteresis of a valve's spool and armature: `w+ = clamp(w, u - r, u + r)`, `u` the settled pressure of the
/// command and `r` the half-width, Pa. The output is isotone in its state and in the input. Left out: minor loops that
/// depend on their size, and dither, which narrows them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Play<T> {
    half_width_pa: T,
    output_pa: T,
}

impl<T: Real> Play<T> {
    /// At rest at this output.
    pub fn new(half_width_pa: T, output_pa: T) -> Self {
        Self { half_width_pa, output_pa }
    }

    /// The output after the input has moved straight to `input_pa`. A valve gives no pressure below zero.
    #[inline]
    pub fn follow(&mut self, input_pa: T) -> T {
        let (minimum, maximum) = (input_pa - self.half_width_pa, input_pa + self.half_width_pa);
        self.output_pa = self.output_pa.at_least(minimum).at_most(maximum);
        self.output_pa.at_least(T::zero())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Inputs that turn often, without a random number generator.
    fn inputs() -> impl Iterator<Item = f64> {
        (1..400_u32).scan(0.0, |input: &mut f64, n| {
            *input = (*input + 4e4 * (f64::from(n * n % 97) / 48.0 - 1.0)).clamp(0.0, 5e5);
            Some(*input)
        })
    }

    #[test]
    fn without_width_the_output_is_the_input() {
        let mut play = Play::new(0.0, 0.0);
        assert!(inputs().all(|input| play.follow(input) == input));
    }

    #[test]
    fn the_output_rests_within_the_width_and_follows_at_its_edge() {
        let mut play = Play::new(1e4, 0.0);
        assert_eq!([5e3, 3e4, 2.5e4, 1e4, 0.0].map(|u| play.follow(u)), [0.0, 2e4, 2e4, 2e4, 1e4]);
        assert!(inputs().all(|input| (play.follow(input) - input).abs() <= 1e4));
    }

    #[test]
    fn a_larger_input_or_start_never_gives_a_smaller_output() {
        for (shift, start) in [(0.0, 1e4), (5e3, 0.0), (2e4, 8e3)] {
            let (mut low, mut high) = (Play::new(1e4, 0.0), Play::new(1e4, start));
            assert!(inputs().all(|input| low.follow(input) <= high.follow(input + shift)));
        }
    }
}
