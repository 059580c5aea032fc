//! Values that do not rise from one group to the next.

/// Values and intervals that do not rise, from values that were found each by itself: the closest ones by the widths of their intervals, and what remains
/// of each interval by the others. None where the intervals exclude it.
pub(super) fn not_rising(found: &[(f64, [f64; 2])]) -> Option<Vec<(f64, [f64; 2])>> {
    let mut intervals: Vec<[f64; 2]> = found.iter().map(|(_, interval)| *interval).collect();
    for i in 1..intervals.len() {
        intervals[i][1] = intervals[i][1].min(intervals[i - 1][1]);
    }
    for i in (1..intervals.len()).rev() {
        intervals[i - 1][0] = intervals[i - 1][0].max(intervals[i][0]);
    }
    if intervals.iter().any(|[low, high]| low > high) {
        return None;
    }
    // Neighbours that rise become their weighted mean, until none does.
    let mut pools: Vec<(f64, f64, usize)> = Vec::new();
    for (value, [low, high]) in found {
        let width = (high - low).max(f64::MIN_POSITIVE);
        let mut pool = (*value, (width * width).recip(), 1);
        while let Some((before, weight, count)) = pools.pop_if(|(before, ..)| *before < pool.0) {
            let sum = weight + pool.1;
            // Equal weights that are infinite have an equal part.
            let part = if sum.is_finite() { pool.1 / sum } else { 0.5 };
            pool = (before + part * (pool.0 - before), sum, count + pool.2);
        }
        pools.push(pool);
    }
    let values = pools.into_iter().flat_map(|(value, _, count)| std::iter::repeat_n(value, count));
    Some(values.zip(intervals).map(|(value, [low, high])| (value.clamp(low, high), [low, high])).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_falls_stays() {
        let found = [(0.2, [0.1, 0.3]), (0.15, [0.1, 0.2]), (0.1, [0.0, 0.2])];
        assert_eq!(not_rising(&found).unwrap(), [(0.2, [0.1, 0.3]), (0.15, [0.1, 0.2]), (0.1, [0.0, 0.2])]);
        assert_eq!(not_rising(&found[..1]).unwrap(), found[..1]);
        assert_eq!(not_rising(&[]).unwrap(), []);
    }

    #[test]
    fn what_rises_is_pooled_by_its_widths() {
        let wide_and_narrow = [(0.10, [0.0, 0.4]), (0.20, [0.15, 0.25])];
        let falling = not_rising(&wide_and_narrow).unwrap();
        // Widths of 0.4 and 0.1: weights of 1 to 16.
        let mean = 0.10 + 16.0 / 17.0 * 0.10;
        assert!((falling[0].0 - mean).abs() < 1e-12 && (falling[1].0 - mean).abs() < 1e-12);
        // The colder one is no less than the lower end of the warmer one.
        assert_eq!([falling[0].1, falling[1].1], [[0.15, 0.4], [0.15, 0.25]]);
    }

    #[test]
    fn intervals_that_exclude_it_are_said() {
        assert_eq!(not_rising(&[(0.1, [0.09, 0.11]), (0.2, [0.19, 0.21])]), None);
        assert_eq!(not_rising(&[(0.1, [0.1, 0.1]), (0.1, [0.1, 0.1])]).unwrap(), [(0.1, [0.1, 0.1]); 2]);
    }
}
