//! The range of an axis and its ticks.

use drivetrain::Real;

/// What an axis has to show.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Axis {
    /// Every value.
    All,
    /// Every value between these; the panel says what lies beyond.
    Within(f64, f64),
    /// From the first to the second value, whatever there is to show.
    Fixed(f64, f64),
    /// The same without ticks, where the height of a curve means nothing.
    Unmarked(f64, f64),
}

/// Room that a shaded range may take beyond the curves, as a fraction of their height.
const RANGE_ROOM: f64 = 0.35;

/// Part of a step by which a value may lie beyond the end of an axis: less than a stroke is wide.
const SLACK: f64 = 0.02;

/// No axis has more ticks.
const MAX_TICKS: f64 = 100.0;

/// Values from here on are written with an exponent.
const LARGE: f64 = 1e6;

/// An axis as drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Scale {
    /// Lowest value.
    pub low: f64,
    /// Highest value.
    pub high: f64,
    /// Distance of its ticks.
    pub step: f64,
}

impl Axis {
    /// The axis for curves of this lowest and highest value and a shaded range of those, with about `ticks` ticks.
    pub(crate) fn scale(self, curves: Option<(f64, f64)>, range: Option<(f64, f64)>, ticks: f64) -> Scale {
        let (low, high) = match (self, curves) {
            (Self::Fixed(low, high) | Self::Unmarked(low, high), _) => {
                return Scale { low, high, step: nice_step((high - low) / ticks) };
            }
            (Self::Within(low, high), None) => (low, high),
            (Self::Within(minimum, maximum), Some((low, high))) => {
                (low.clamp(minimum, maximum), high.clamp(minimum, maximum))
            }
            (Self::All, None) => (0.0, 1.0),
            (Self::All, Some(extremes)) => extremes,
        };
        let room = RANGE_ROOM * (high - low);
        let (low, high) = range
            .map_or((low, high), |(lower, upper)| (low.min(lower.max(low - room)), high.max(upper.min(high + room))));
        // A constant has a range around it.
        let margin = if high > low { 0.0 } else { if low == 0.0 { 1.0 } else { 0.1 * low.abs() } };
        let (low, high) = (low - margin, high + margin);
        let step = nice_step((high - low) / ticks);
        Scale { low: (low / step + SLACK).floor() * step, high: (high / step - SLACK).ceil() * step, step }
    }
}

impl Scale {
    /// Lowest and highest value that a curve shows: a value may lie a little beyond the end of the axis.
    pub(crate) fn shown(&self) -> (f64, f64) {
        (self.low - SLACK * self.step, self.high + SLACK * self.step)
    }

    /// What lies beyond the axis, in words.
    pub(crate) fn beyond(&self, extremes: Option<(f64, f64)>) -> Option<String> {
        let (low, high) = extremes?;
        let slack = SLACK * self.step;
        let beyond = [(low < self.low - slack, self.low, low), (high > self.high + slack, self.high, high)];
        let (ends, values): (Vec<String>, Vec<String>) = (beyond.into_iter().filter(|(beyond, ..)| *beyond))
            .map(|(_, end, value)| (self.text(end), short(value)))
            .unzip();
        (!ends.is_empty())
            .then(|| format!("axis ends at {}, values reach {}", ends.join(" and "), values.join(" and ")))
    }

    /// A value with the decimals of the ticks.
    pub(crate) fn text(&self, value: f64) -> String {
        // What rounding leaves of zero has no sign.
        let value = if value.abs() < SLACK * self.step { 0.0 } else { value };
        if self.low.abs().max(self.high.abs()) >= LARGE {
            return format!("{value:.1e}");
        }
        format!("{value:.*}", decimals(self.step))
    }
}

/// A value of any size with two or three digits.
fn short(value: f64) -> String {
    if value.abs() >= LARGE {
        return format!("{value:.1e}");
    }
    let digits = if value.abs() < 10.0 { 2 } else { 0 };
    format!("{value:.digits$}")
}

/// The next larger number of the form 1, 2 or 5 times a power of ten.
pub(crate) fn nice_step(minimum: f64) -> f64 {
    let power = Real::powf(10.0, Real::log10(minimum).floor());
    [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * power).find(|&step| step >= minimum * 0.999).unwrap_or(minimum)
}

/// The multiples of a step from `low` to `high`.
pub(crate) fn ticks(low: f64, high: f64, step: f64) -> Vec<f64> {
    let [first, last] = [(low / step - SLACK).ceil(), (high / step + SLACK).floor()];
    // None by a step of zero, or one that is far too short.
    let count = if last - first <= MAX_TICKS { (last - first) as usize + 1 } else { 0 };
    if last < first { Vec::new() } else { (0..count).map(|n| (first + n as f64) * step).collect() }
}

/// Decimals that tell multiples of a step apart.
pub(crate) fn decimals(step: f64) -> usize {
    (-Real::log10(step * 1.001).floor()).clamp(0.0, 6.0) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_one_two_or_five_times_a_power_of_ten() {
        assert_eq!([0.3, 0.11, 7.0, 1.0].map(nice_step), [0.5, 0.2, 10.0, 1.0]);
        assert_eq!([0.5, 0.02, 10.0].map(decimals), [1, 2, 0]);
    }

    #[test]
    fn an_axis_holds_all_values_between_round_ends() {
        let scale = Axis::All.scale(Some((-3.0, 104.0)), None, 5.0);
        assert_eq!((scale.low, scale.high, scale.step), (-50.0, 150.0, 50.0));
        let from_zero = Axis::All.scale(Some((0.0, 0.3)), None, 3.0);
        assert_eq!((from_zero.low, from_zero.step), (0.0, 0.1));
        let constant = Axis::All.scale(Some((0.13, 0.13)), None, 5.0);
        assert!(constant.low < 0.13 && 0.13 < constant.high && constant.high < 0.2);
    }

    #[test]
    fn ticks_have_the_decimals_that_they_need_and_large_ones_an_exponent() {
        let text = |high: f64, value: f64| Axis::All.scale(Some((0.0, high)), None, 5.0).text(value);
        assert_eq!(text(1.0, 0.4), "0.4");
        assert_eq!(text(1.0, -1e-17), "0.0");
        assert_eq!(text(4e21, 2e21), "2.0e21");
    }

    #[test]
    fn a_wide_range_takes_a_part_of_the_panel() {
        let scale = Axis::All.scale(Some((0.0, 100.0)), Some((-715.0, 120.0)), 5.0);
        assert_eq!((scale.low, scale.high), (-50.0, 150.0));
    }

    #[test]
    fn a_diverged_curve_does_not_squash_the_others_and_is_remarked() {
        let extremes = Some((-3.2e10, 0.6));
        let scale = Axis::Within(-0.5, 0.8).scale(extremes, None, 3.0);
        assert_eq!((scale.low, scale.high), (-0.5, 1.0));
        assert_eq!(scale.beyond(extremes).as_deref(), Some("axis ends at -0.5, values reach -3.2e10"));
        let both = "axis ends at -0.5 and 1.0, values reach -0.60 and 1.10";
        assert_eq!(scale.beyond(Some((-0.6, 1.1))).as_deref(), Some(both));
        assert_eq!(scale.beyond(Some((0.0, 0.6))), None);
    }
}
