//! Times that are written as clock times or dates.

use chrono::{DateTime, NaiveDateTime, NaiveTime, Timelike};

/// Forms with a date and a time. A year of two digits is tried first: one of four is more than its form takes.
const DATES: &[&str] = &[
    "%Y-%m-%d %H:%M:%S%.f",
    "%Y-%m-%dT%H:%M:%S%.f",
    "%Y/%m/%d %H:%M:%S%.f",
    "%Y-%m-%d %I:%M:%S%.f %p",
    "%Y/%m/%d %I:%M:%S%.f %p",
    "%d.%m.%y %H:%M:%S%.f",
    "%d.%m.%Y %H:%M:%S%.f",
    "%d-%b-%y %H:%M:%S%.f",
    "%d-%b-%Y %H:%M:%S%.f",
    "%d-%b-%Y %I:%M:%S%.f %p",
    "%d %b %Y %H:%M:%S%.f",
    "%d %b %Y %I:%M:%S%.f %p",
    "%a %b %d %H:%M:%S %Z %Y",
];
/// Forms with a date, a time and the difference from UTC, beside RFC 3339.
const ZONED: &[&str] = &["%a %b %d %H:%M:%S GMT%:z %Y"];
const WEEKDAYS: [&str; 7] = ["Mon ", "Tue ", "Wed ", "Thu ", "Fri ", "Sat ", "Sun "];
/// Forms in which the month may stand before the day or behind it.
const MONTH_OR_DAY_FIRST: &[[&str; 2]] = &[
    ["%m/%d/%y %H:%M:%S%.f", "%d/%m/%y %H:%M:%S%.f"],
    ["%m/%d/%y %I:%M:%S%.f %p", "%d/%m/%y %I:%M:%S%.f %p"],
    ["%m/%d/%Y %H:%M:%S%.f", "%d/%m/%Y %H:%M:%S%.f"],
    ["%m/%d/%Y %I:%M:%S%.f %p", "%d/%m/%Y %I:%M:%S%.f %p"],
    ["%m-%d-%Y %H:%M:%S%.f", "%d-%m-%Y %H:%M:%S%.f"],
    ["%m-%d-%Y %I:%M:%S%.f %p", "%d-%m-%Y %I:%M:%S%.f %p"],
];
/// Forms with the time of a day.
const CLOCKS: &[&str] = &["%H:%M:%S%.f", "%I:%M:%S%.f %p"];

/// How a time is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum StampForm {
    /// A time of the day.
    Clock(&'static str),
    /// The same with milliseconds behind another colon: `12:00:01:250`.
    ClockWithMs,
    /// Minutes and seconds with a fraction, as spreadsheets show times: `59:59.9`.
    Minutes,
    /// With a date; local, or without a zone.
    Date(&'static str),
    /// With a date and the difference from UTC.
    Zoned(&'static str),
    /// The same by RFC 3339: `2024-03-31T12:00:00+02:00`.
    Rfc3339,
    /// With a date such as `3/4/2024`, whose month may be either number: the time of the day.
    ClockOfDate(&'static [&'static str; 2]),
}

impl StampForm {
    /// The form of a time, if it is written as one.
    pub(crate) fn of(text: &str) -> Option<Self> {
        // A number is no time, and most of what is not is known by its first letter.
        let text = text.trim();
        let begins = text.starts_with(|c: char| c.is_ascii_digit()) || WEEKDAYS.iter().any(|day| text.starts_with(day));
        if !begins || !text.contains(':') {
            return None;
        }
        let is = |form: &Self| form.seconds(text).is_some();
        let clocks = CLOCKS.iter().map(|form| Self::Clock(form)).chain([Self::ClockWithMs, Self::Minutes]);
        let zoned = ZONED.iter().map(|form| Self::Zoned(form)).chain([Self::Rfc3339]);
        let forms = clocks.chain(zoned).chain(DATES.iter().map(|form| Self::Date(form)));
        forms.into_iter().find(is).or_else(|| Self::of_date_in_either_order(text))
    }

    /// The seconds since midnight, the hour or 1970; none where the text has another form.
    pub(crate) fn seconds(self, text: &str) -> Option<f64> {
        let text = text.trim().replace(',', ".");
        let of = |seconds: i64, nanoseconds: u32| {
            // 2^53 s are beyond every date.
            let whole = seconds as f64;
            whole + 1e-9 * f64::from(nanoseconds)
        };
        let since_1970 = |time: NaiveDateTime| of(time.and_utc().timestamp(), time.nanosecond());
        let of_day = |time: NaiveTime| of(i64::from(time.num_seconds_from_midnight()), time.nanosecond());
        match self {
            Self::Clock(form) => NaiveTime::parse_from_str(&text, form).ok().map(of_day),
            Self::ClockWithMs => {
                let (clock, ms) = text.rsplit_once(':').filter(|(_, ms)| ms.len() == 3)?;
                let ms: u16 = ms.bytes().all(|byte| byte.is_ascii_digit()).then(|| ms.parse().ok()).flatten()?;
                NaiveTime::parse_from_str(clock, "%H:%M:%S").ok().map(|time| of_day(time) + 1e-3 * f64::from(ms))
            }
            Self::Minutes => {
                let (minutes, seconds) = text.split_once(':')?;
                let (whole, decimals) = seconds.split_once('.')?;
                let are_digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
                let is_form = whole.len() == 2 && [minutes, whole, decimals].into_iter().all(are_digits);
                let (minutes, seconds): (u16, f64) = (minutes.parse().ok()?, seconds.parse().ok()?);
                (is_form && seconds < 60.0).then(|| 60.0 * f64::from(minutes) + seconds)
            }
            Self::Date(form) => NaiveDateTime::parse_from_str(&text, form).ok().map(since_1970),
            Self::Zoned(form) => DateTime::parse_from_str(&text, form).ok().map(|time| since_1970(time.naive_utc())),
            Self::ClockOfDate(forms) => {
                let time = forms.iter().find_map(|form| NaiveDateTime::parse_from_str(&text, form).ok());
                time.map(|time| of_day(time.time()))
            }
            Self::Rfc3339 => DateTime::parse_from_rfc3339(&text).ok().map(|time| since_1970(time.naive_utc())),
        }
    }

    /// How its times go on: those without a date begin anew.
    pub(crate) fn turns(self) -> Midnight {
        match self {
            Self::Minutes => Midnight { turn_s: 3600.0, ..Midnight::default() },
            _ => Midnight::default(),
        }
    }

    /// Whether its times begin anew after a day or an hour.
    pub(crate) fn has_turns(self) -> bool {
        matches!(self, Self::Clock(_) | Self::ClockWithMs | Self::Minutes | Self::ClockOfDate(_))
    }

    /// The form of a date that begins with the month or with the day; none where it is no such date.
    fn of_date_in_either_order(text: &str) -> Option<Self> {
        MONTH_OR_DAY_FIRST.iter().find_map(|pair| {
            let is = |form: &Self| form.seconds(text).is_some();
            match pair.map(|form| Some(Self::Date(form)).filter(is)) {
                [Some(_), Some(_)] => Some(Self::ClockOfDate(pair)),
                [one, other] => one.or(other),
            }
        })
    }

    /// Whether nothing in a date tells its day from its month: `3/4/2024 12:00:00`.
    pub(crate) fn is_ambiguous(self) -> bool {
        matches!(self, Self::ClockOfDate(_))
    }
}

/// Times of a day, or of an hour, that go on after its end.
#[derive(Debug)]
pub(crate) struct Midnight {
    newest_s: Option<f64>,
    turn_s: f64,
    turns: f64,
}

impl Default for Midnight {
    fn default() -> Self {
        Self { newest_s: None, turn_s: 86_400.0, turns: 0.0 }
    }
}

impl Midnight {
    /// The time of a clock, s since the midnight (the full hour) before the first one. A step of more than half a turn is one over its end.
    pub(crate) fn unwrap(&mut self, of_turn_s: f64) -> f64 {
        let step_s = of_turn_s - self.newest_s.replace(of_turn_s).unwrap_or(of_turn_s);
        if 2.0 * step_s.abs() > self.turn_s {
            self.turns -= step_s.signum();
        }
        of_turn_s + self.turn_s * self.turns
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
            ("31.03.24 12:00:00", noon_s),
            ("31-Mar-2024 12:00:00.500", noon_s + 0.5),
            ("2024-03-31 12:00:00.5 PM", noon_s + 0.5),
            ("3/31/2024 12:00:00.5 PM", noon_s + 0.5),
            ("3/31/24 12:00:00", noon_s),
            ("31/3/2024 12:00:00", noon_s),
            ("31-03-2024 12:00:00", noon_s),
            ("Sun Mar 31 13:00:00 GMT+01:00 2024", noon_s),
            ("Sun Mar 31 12:00:00 CET 2024", noon_s),
            ("3/4/2024 12:00:01.25", 43_201.25),
            ("12:00:01:250", 43_201.25),
            ("00:01.5", 1.5),
            ("59:59,9", 3599.9),
            ("75:00.0", 4500.0),
        ] {
            let form = StampForm::of(text).unwrap_or_else(|| panic!("{text}"));
            assert_eq!(form.seconds(text), Some(seconds), "{text}");
        }
        for text in [
            "",
            "12",
            "12.5",
            "12:00",
            "2024-03-31",
            "25:00:00",
            "a:b:c",
            "1e300",
            "\u{e9}:",
            "1:2.5",
            "00:61.5",
            "12:00:01:25",
            "12:00:01:+25",
            "31/31/2024 12:00:00",
            "00:+1.5",
        ] {
            assert_eq!(StampForm::of(text), None, "{text}");
        }
    }

    #[test]
    fn only_a_date_that_has_two_meanings_is_ambiguous() {
        let is_ambiguous = |text: &str| StampForm::of(text).unwrap().is_ambiguous();
        assert!(is_ambiguous("3/4/2024 12:00:00") && is_ambiguous("03-04-2024 12:00:00 PM"));
        assert!(!is_ambiguous("3/31/2024 12:00:00") && !is_ambiguous("2024/03/04 12:00:00"));
        // A day later there is one order.
        let form = StampForm::of("12/12/2024 23:59:59").unwrap();
        assert_eq!(form.seconds("12/13/2024 00:00:01"), Some(1.0));
    }

    #[test]
    fn minutes_go_on_after_the_hour() {
        let mut turns = StampForm::Minutes.turns();
        assert_eq!([3599.5, 0.5, 1.0].map(|s| turns.unwrap(s)), [3599.5, 3600.5, 3601.0]);
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
