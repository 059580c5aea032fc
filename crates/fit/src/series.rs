//! Readings of one signal.

/// Readings of one signal in the order of their times.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Series {
    /// Times, s, not falling.
    pub time_s: Vec<f64>,
    /// Values in the unit of the signal.
    pub value: Vec<f64>,
}

impl Series {
    /// Whether there is no reading.
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// How many readings there are.
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// Appends a reading. One that is older than the last is left out: an interpolation needs an order.
    pub fn push(&mut self, time_s: f64, value: f64) {
        if self.time_s.last().is_none_or(|last_s| time_s > *last_s) {
            self.time_s.push(time_s);
            self.value.push(value);
        }
    }

    /// The value at a time by a line between its neighbours, the end value outside; zero without readings.
    pub fn at(&self, time_s: f64) -> f64 {
        let after = self.time_s.partition_point(|other_s| *other_s < time_s);
        let end = |i: usize| self.value.get(i).copied().unwrap_or(0.0);
        if after == 0 {
            return end(0);
        }
        if after == self.len() {
            return end(after - 1);
        }
        let (t0, t1) = (self.time_s[after - 1], self.time_s[after]);
        self.value[after - 1] + (time_s - t0) / (t1 - t0) * (self.value[after] - self.value[after - 1])
    }

    /// The readings from one time to another.
    pub fn between(&self, [from_s, to_s]: [f64; 2]) -> impl Iterator<Item = (f64, f64)> + '_ {
        let first = self.time_s.partition_point(|time_s| *time_s < from_s);
        let points = self.time_s[first..].iter().zip(&self.value[first..]).map(|(time_s, value)| (*time_s, *value));
        points.take_while(move |(time_s, _)| *time_s <= to_s)
    }

    /// The same readings as a series.
    pub(crate) fn part(&self, span: [f64; 2]) -> Self {
        let (time_s, value) = self.between(span).unzip();
        Self { time_s, value }
    }

    /// The longest time between two readings from one time to another, the ends included, s.
    pub fn longest_gap_s(&self, [from_s, to_s]: [f64; 2]) -> f64 {
        let mut last_s = from_s;
        let mut longest_s = 0.0_f64;
        for (time_s, _) in self.between([from_s, to_s]) {
            longest_s = longest_s.max(time_s - last_s);
            last_s = time_s;
        }
        longest_s.max(to_s - last_s)
    }
}
