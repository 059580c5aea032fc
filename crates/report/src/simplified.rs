//! Curves with fewer points that look the same.

/// The points of a curve that a drawing needs: none that is left out is further than `tolerance` from the line over it, in the unit
/// of the values. Gaps stay.
pub(crate) fn simplified(points: &[(f64, f64)], tolerance: f64) -> Vec<(f64, f64)> {
    let mut kept: Vec<(f64, f64)> = Vec::new();
    // The last point that would do as the end of the line from the last kept one, and the slopes of lines that pass all between.
    let mut end: Option<(f64, f64)> = None;
    let (mut lowest, mut highest) = (f64::NEG_INFINITY, f64::INFINITY);
    for &point in points {
        let is_on_line = |from: (f64, f64)| {
            let slope = (point.1 - from.1) / (point.0 - from.0);
            lowest <= slope && slope <= highest
        };
        if !kept.last().is_some_and(|&from| is_on_line(from)) {
            kept.extend(end);
            (lowest, highest) = (f64::NEG_INFINITY, f64::INFINITY);
        }
        match kept.last().filter(|from| point.0 > from.0 && from.1.is_finite() && point.1.is_finite()) {
            Some(from) => {
                let length = point.0 - from.0;
                lowest = lowest.max((point.1 - tolerance - from.1) / length);
                highest = highest.min((point.1 + tolerance - from.1) / length);
                end = Some(point);
            }
            None => {
                kept.push(point);
                end = None;
                (lowest, highest) = (f64::NEG_INFINITY, f64::INFINITY);
            }
        }
    }
    kept.extend(end);
    kept
}

/// Both ends of a range, which are at the same places: where either needs a point, both have one.
pub(crate) fn simplified_range(ends: [Vec<(f64, f64)>; 2], tolerance: f64) -> [Vec<(f64, f64)>; 2] {
    let [lower, upper] = [0, 1].map(|end| simplified(&ends[end], tolerance));
    let is_kept = |kept: &[(f64, f64)], x: f64| kept.binary_search_by(|point| point.0.total_cmp(&x)).is_ok();
    ends.map(|points| points.into_iter().filter(|(x, _)| is_kept(&lower, *x) || is_kept(&upper, *x)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The value of a curve at a place.
    fn at(points: &[(f64, f64)], x: f64) -> f64 {
        let next = points.partition_point(|point| point.0 < x).clamp(1, points.len() - 1);
        let ((x0, y0), (x1, y1)) = (points[next - 1], points[next]);
        y0 + (y1 - y0) * (x - x0) / (x1 - x0)
    }

    #[test]
    fn a_line_keeps_its_ends_and_a_corner_stays() {
        let line: Vec<_> = (0..100).map(|i| (f64::from(i), 2.0 * f64::from(i))).collect();
        assert_eq!(simplified(&line, 0.1), [(0.0, 0.0), (99.0, 198.0)]);
        let corner: Vec<_> = (0..100).map(|i| (f64::from(i), f64::from((i - 50).max(0)))).collect();
        let kept = simplified(&corner, 0.1);
        assert!(kept.len() <= 4 && (at(&kept, 50.0)).abs() <= 0.1, "{kept:?}");
    }

    #[test]
    fn no_point_is_further_from_the_curve_than_the_tolerance() {
        let curve: Vec<_> = (0..2000).map(|i| 0.01 * f64::from(i)).map(|x| (x, drivetrain::Real::sin(x))).collect();
        let kept = simplified(&curve, 0.01);
        assert!(kept.len() < 100, "{}", kept.len());
        assert!(curve.iter().all(|&(x, y)| (at(&kept, x) - y).abs() <= 0.01 + 1e-12));
    }

    #[test]
    fn both_ends_of_a_range_keep_the_same_places() {
        let end = |corner: i32| (0..100).map(|i| (f64::from(i), f64::from((i - corner).max(0)))).collect::<Vec<_>>();
        let [lower, upper] = simplified_range([end(30), end(70)], 0.1);
        assert!(lower.len() < 10 && lower.iter().zip(&upper).all(|(lower, upper)| lower.0 == upper.0), "{lower:?}");
        assert!((at(&lower, 30.0)).abs() <= 0.1 && (at(&upper, 70.0)).abs() <= 0.1);
    }

    #[test]
    fn gaps_steps_and_short_curves_stay() {
        let gap = [(0.0, 1.0), (1.0, 1.0), (2.0, f64::NAN), (3.0, 1.0), (4.0, 1.0)];
        let kept = simplified(&gap, 0.1);
        assert!(kept.len() == 5 && kept[2].1.is_nan(), "{kept:?}");
        let step = [(0.0, 0.0), (1.0, 0.0), (1.0, 5.0), (2.0, 5.0)];
        assert_eq!(simplified(&step, 0.1), step);
        assert_eq!(simplified(&[], 0.1), []);
        assert_eq!(simplified(&step[..1], 0.1), step[..1]);
    }
}
