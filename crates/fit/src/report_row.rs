//! A row of the table of what a fit has found.

use crate::Verdict;

/// A row of the table of parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct ReportRow {
    /// The parameter or combination.
    pub name: String,
    /// What its numbers measure.
    pub measure: Measure,
    /// Its value.
    pub value: f64,
    /// Ends of its interval of 95 %.
    pub interval: [f64; 2],
    /// Standard deviation after the fit over that before.
    pub fraction: f64,
    /// What the logs tell of it.
    pub verdict: Verdict,
}

/// What a fitted number measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Measure {
    /// A factor of the value of the given file.
    Factor,
    /// A fraction of a value.
    Fraction,
    /// A delay, s.
    Delay,
    /// A pressure that is added, Pa.
    Offset,
    /// Half the width of a hysteresis, Pa.
    Width,
    /// A torque, N m.
    Torque,
}

impl Measure {
    /// The unit of its numbers.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Factor | Self::Fraction => "1",
            Self::Delay => "s",
            Self::Offset | Self::Width => "Pa",
            Self::Torque => "N m",
        }
    }

    /// A number for people, without its unit; with more digits than usual where it has to be told from another one.
    fn number(self, value: f64, more: usize) -> String {
        let (few, some) = (1 + more, 3 + more);
        match self {
            Self::Factor => format!("{value:.some$}"),
            Self::Fraction => format!("{:+.few$}", 100.0 * value),
            Self::Delay => format!("{:+.few$}", 1e3 * value),
            Self::Offset => format!("{:+.few$}", 1e-3 * value),
            Self::Width => format!("{:.few$}", 1e-3 * value),
            Self::Torque => format!("{value:+.few$}"),
        }
    }

    /// The unit of a number for people.
    fn unit_for_people(self) -> &'static str {
        match self {
            Self::Factor => "",
            Self::Fraction => " %",
            Self::Delay => " ms",
            Self::Offset | Self::Width => " kPa",
            Self::Torque => " N m",
        }
    }
}

impl ReportRow {
    /// The value for people: `x 1.042` or `+3.1 ms`.
    pub fn value_text(&self) -> String {
        let times = if self.measure == Measure::Factor { "x " } else { "" };
        format!("{times}{}{}", self.measure.number(self.value, self.more_digits()), self.measure.unit_for_people())
    }

    /// Digits beyond the usual ones with which the ends of the interval are two numbers.
    fn more_digits(&self) -> usize {
        const MOST: usize = 3;
        let [low, high] = self.interval;
        let is_told = |more: &usize| self.measure.number(low, *more) != self.measure.number(high, *more);
        (0..MOST).find(is_told).filter(|_| low < high).unwrap_or(0)
    }

    /// The interval for people: `1.012 to 1.073`.
    pub fn interval_text(&self) -> String {
        let [low, high] = self.interval.map(|end| self.measure.number(end, self.more_digits()));
        format!("{low} to {high}{}", self.measure.unit_for_people())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn people_read_milliseconds_kilopascal_and_per_cent() {
        let row = |measure, value, interval| {
            let row =
                ReportRow { name: "n".to_owned(), measure, value, interval, fraction: 0.5, verdict: Verdict::Partly };
            [row.value_text(), row.interval_text()]
        };
        assert_eq!(row(Measure::Factor, 1.0423, [1.01, 1.0734]), ["x 1.042", "1.010 to 1.073"]);
        assert_eq!(row(Measure::Factor, 1.00021, [1.0001, 1.0003]), ["x 1.0002", "1.0001 to 1.0003"]);
        assert_eq!(row(Measure::Factor, 1.0, [1.0, 1.0]), ["x 1.000", "1.000 to 1.000"]);
        assert_eq!(row(Measure::Delay, 0.0031, [-0.001, 0.01]), ["+3.1 ms", "-1.0 to +10.0 ms"]);
        assert_eq!(row(Measure::Offset, -2e3, [-3e3, -1e3]), ["-2.0 kPa", "-3.0 to -1.0 kPa"]);
        assert_eq!(row(Measure::Width, 2e3, [0.0, 4e3]), ["2.0 kPa", "0.0 to 4.0 kPa"]);
        assert_eq!(row(Measure::Fraction, 0.015, [0.0, 0.03]), ["+1.5 %", "+0.0 to +3.0 %"]);
        assert_eq!(row(Measure::Torque, 1.5, [0.5, 2.5]), ["+1.5 N m", "+0.5 to +2.5 N m"]);
    }
}
