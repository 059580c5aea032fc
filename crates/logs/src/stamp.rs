//! Times that are written as clock times or dates.

use chrono::{DateTime, NaiveDateTime, NaiveTime, Timelike};

/// Forms with a date and a time.
const DATES: [&str; 4] =
    ["%Y-%m-%d %H:%M:%S%.f", "%Y-%m-%dT%H:%M:%S%.f", "%Y/%m/%d %H:%M:%S%.f", "%d.%m.%Y %H:%M:%S%.f"];
/// Forms with the time of a day.
const CLOCKS: [&str; 2] = ["%H:%M:%S%.f", "%I:%M:%S%.f %p"];

/// How a time is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum StampForm {
    /// A time of the day.
    Clock(&'static str),
    /// With a date; local, or without a zone.
    Date(&'static str),
    /// With a date and the difference from UTC: `2024-03-31T12:00:00+02:00`.
    Zoned,
}

impl StampForm {
    /// The form of a time, if it is written as one. Dates with the year at their end and `/` may begin with the day or with the month:
    /// they have none.
    pub(crate) fn of(text: &str) -> Option<Self> {
        let forms = CLOCKS.map(Self::Clock).into_iter().chain(DATES.map(Self::Date)).chain([Self::Zoned]);
        // A number is no time, and most of what is not is told by its first letter.
        if !text.trim_start().starts_with(|c: char| c.is_ascii_digit()) || !text.contains(':') {
            return None;
        }
        forms.into_iter().find(|form| form.seconds(text).is_some())
    }

    /// The seconds since midnight, or since 1970; none where the text has another form.
    pub(crate) fn seconds(self, text: &str) -> Option<f64> {
        let text = text.trim().replace(',', ".");
        let of = |seconds: i64, nanoseconds: u32| {
            #[expect(clippy::cast_precision_loss, reason = "2^53 s are beyond every date")]
            let whole = seconds as f64;
            whole + 1e-9 * f64::from(nanoseconds)
        };
        let since_1970 = |time: NaiveDateTime| of(time.and_utc().timestamp(), time.nanosecond());
        match self {
            Self::Clock(form) => {
                let time = NaiveTime::parse_from_str(&text, form).ok()?;
                Some(of(i64::from(time.num_seconds_from_midnight()), time.nanosecond()))
            }
            Self::Date(form) => NaiveDateTime::parse_from_str(&text, form).ok().map(since_1970),
            Self::Zoned => DateTime::parse_from_rfc3339(&text).ok().map(|time| since_1970(time.naive_utc())),
        }
    }
}

/// Times of a day that go on after midnight.
#[derive(Debug, Default)]
pub(crate) struct Midnight {
    newest_s: Option<f64>,
    days: f64,
}

impl Midnight {
    /// The time of a clock, s since the midnight before the first one. A step of more than half a day is one over midnight.
    pub(crate) fn unwrap(&mut self, of_day_s: f64) -> f64 {
        const DAY_S: f64 = 86_400.0;
        let step_s = of_day_s - self.newest_s.replace(of_day_s).unwrap_or(of_day_s);
        if 2.0 * step_s.abs() > DAY_S {
            self.days -= step_s.signum();
        }
        of_day_s + DAY_S * self.days
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_of_every_form_are_seconds() {
        // 2024-03-31 12:00 UTC is 1711886400 s after 1970.
        let noon_s = 1_711_886_400.0;
        for (text, seconds) in [
            ("12:00:00", 43_200.0),
            (" 12:00:01.25 ", 43_201.25),
            ("12:00:01,25", 43_201.25),
            ("01:02:03.5 PM", 46_923.5),
            ("2024-03-31 12:00:00", noon_s),
            ("2024-03-31T12:00:00.5", noon_s + 0.5),
            ("2024-03-31T12:00:00.5Z", noon_s + 0.5),
            ("2024-03-31T14:00:00+02:00", noon_s),
            ("2024/03/31 12:00:00.5", noon_s + 0.5),
            ("31.03.2024 12:00:00", noon_s),
        ] {
            let form = StampForm::of(text).unwrap_or_else(|| panic!("{text}"));
            assert_eq!(form.seconds(text), Some(seconds), "{text}");
        }
        for text in
            ["", "12", "12.5", "12:00", "3/31/2024 12:00:00", "2024-03-31", "25:00:00", "a:b:c", "1e300", "\u{e9}:"]
        {
            assert_eq!(StampForm::of(text), None, "{text}");
        }
    }

    #[test]
    fn a_clock_goes_on_after_midnight_and_comes_back_from_a_wrong_stamp() {
        let mut midnight = Midnight::default();
        assert_eq!(
            [86_399.0, 0.5, 1.0, 86_399.5, 1.5].map(|s| midnight.unwrap(s)),
            [86_399.0, 86_400.5, 86_401.0, 86_399.5, 86_401.5]
        );
    }
}
