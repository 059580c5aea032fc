//! Speeds over time that a driver follows.

/// Speeds over time, linear between the points, on a road of one grade.
#[derive(Debug, Clone, PartialEq)]
pub struct SpeedTrace {
    /// Rising times, s; the first is zero.
    time_s: Vec<f64>,
    /// A speed for each, m/s.
    speed_m_s: Vec<f64>,
    /// Grade, rad, positive uphill.
    pub grade_rad: f64,
}

impl SpeedTrace {
    /// The speeds at these times, s and m/s, on a road of this grade. `None` with fewer than two points, and where the times do not
    /// rise from zero.
    pub fn new(points: impl IntoIterator<Item = (f64, f64)>, grade_rad: f64) -> Option<Self> {
        let (time_s, speed_m_s): (Vec<f64>, Vec<f64>) = points.into_iter().unzip();
        let rises = time_s.len() >= 2 && time_s[0] == 0.0 && time_s.windows(2).all(|pair| pair[0] < pair[1]);
        rises.then_some(Self { time_s, speed_m_s, grade_rad })
    }

    /// Time of the last point, s.
    pub fn duration_s(&self) -> f64 {
        self.time_s.last().copied().unwrap_or(0.0)
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.time_s.len()
    }

    /// Speed at a time, m/s; before the first point and after the last one that of these.
    pub fn at_m_s(&self, time_s: f64) -> f64 {
        let after = self.time_s.partition_point(|&point| point <= time_s);
        match (after.checked_sub(1), self.time_s.get(after)) {
            (Some(before), Some(next)) => {
                let fraction = (time_s - self.time_s[before]) / (next - self.time_s[before]);
                self.speed_m_s[before] + fraction * (self.speed_m_s[after] - self.speed_m_s[before])
            }
            (Some(last), None) => self.speed_m_s[last],
            (None, _) => self.speed_m_s.first().copied().unwrap_or(0.0),
        }
    }

    /// Lowest and highest speed within this time before and after a time, m/s.
    pub fn range_m_s(&self, time_s: f64, around_s: f64) -> [f64; 2] {
        let ends = [self.at_m_s(time_s - around_s), self.at_m_s(time_s + around_s), self.at_m_s(time_s)];
        let first = self.time_s.partition_point(|&point| point <= time_s - around_s);
        let last = self.time_s.partition_point(|&point| point < time_s + around_s);
        let within = self.speed_m_s.get(first..last).unwrap_or_default();
        let all = || ends.iter().chain(within).copied();
        [all().fold(f64::INFINITY, f64::min), all().fold(0.0, f64::max)]
    }
}
