//! Which column of a table is the time, and its unit.

use std::borrow::Cow;
use std::path::Path;

use trace::{Quantity, Unit};

use crate::{LogError, TimeColumn, error};

/// Whether a name is that of the time.
pub(crate) fn is_time_name(name: &str) -> bool {
    const NAMES: &[&str] = &[
        "time",
        "t",
        "zeit",
        "timestamp",
        "timestamps",
        "times",
        "elapsed",
        "abszeit",
        "relzeit",
        "time_s",
        "time_ms",
        "time_us",
        "time_ns",
        "zeit_s",
        "zeit_ms",
        "t_s",
        "t_ms",
        "t_us",
        "t_ns",
        "epoch",
        "epoch_s",
        "epoch_ms",
        "epoch_us",
        "epoch_ns",
        "unix_time",
        "x_value",
        "timestamp_s",
        "timestamp_ms",
        "timestamp_us",
        "timestamp_ns",
        "time_stamp",
        "zeitstempel",
        "uhrzeit",
        "date_time",
        "date/time",
        "datetime",
        "seconds",
        "sekunden",
        "time_sec",
        "time_seconds",
        "elapsed_time",
        "elapsed_s",
        "elapsed_ms",
    ];
    NAMES.contains(&name.to_lowercase().replace([' ', '-'], "_").as_str())
}

/// A name of the time without the number that tells it from others of the same name: `Time.1`, `Time_2`, `t 3`, `Time (2)`; none if it is
/// no name of the time.
fn base_name(name: &str) -> Option<String> {
    let name = name.trim().to_lowercase();
    let plain = name.trim_end_matches(')').trim_end_matches(|c: char| c.is_ascii_digit());
    let plain = plain.trim_end_matches(['.', '_', ' ', '#', '-', '(']);
    [name.as_str(), plain].into_iter().find(|name| is_time_name(name)).map(|_| plain.to_owned())
}

/// Refuses a table with a time for each signal: another column has the name of the time and other values, or is named as a time and rises
/// at another rate. `size_s` is that of the unit of the time, and `rows` are some of its first rows, with their places in the file, which are called
/// `place`.
pub(crate) fn one_clock<'c>(
    path: &Path,
    names: &[(String, String)],
    (time, size_s): (usize, f64),
    place: &str,
    rows: impl Iterator<Item = (usize, Vec<Cow<'c, str>>)>,
) -> Result<(), LogError> {
    let others: Vec<(usize, bool)> = (0..names.len()).filter_map(|i| Some((i, may_be_time(names, time, i)?))).collect();
    if others.is_empty() {
        return Ok(());
    }
    let rows: Vec<_> = rows.collect();
    let time_s = |column: usize, cell: &str| {
        let own_s = Unit::parse(&names[column].1).map(|unit| unit.size).filter(|_| column != time);
        let size = own_s.unwrap_or(size_s);
        cell.replace(',', ".").parse::<f64>().ok().map(|number| number * size)
    };
    let cell = |row: usize, column: usize| rows[row].1.get(column).map_or("", |cell| cell);
    // The same time may have another unit, and other digits.
    let is_same = |row: usize, other: usize| {
        let both = time_s(other, cell(row, other)).zip(time_s(time, cell(row, time)));
        let is_close = |(one, own): (f64, f64)| (one - own).abs() <= 1e-9 * one.abs().max(own.abs());
        cell(row, other) == cell(row, time) || both.is_some_and(is_close)
    };
    // How long the first rows take by a column that rises with each of them, s.
    let span_s = |column: usize| {
        const FEWEST: usize = 3;
        let times: Option<Vec<f64>> = (0..rows.len()).map(|row| time_s(column, cell(row, column))).collect();
        let times = times.filter(|times| times.len() >= FEWEST && times.is_sorted_by(|one, next| one < next))?;
        Some(times.last()? - times.first()?)
    };
    let differs = |&(other, has_name): &(usize, bool)| {
        // Digits are few at the beginning of a log.
        const RATE: f64 = 0.05;
        let is_rate = |(one, own): (f64, f64)| (one - own).abs() > RATE * own;
        // `t_Shift [ms]` beside `t_Log [s]` may as well be a duration: a clock goes about as fast as another one.
        const LIKE_A_CLOCK: std::ops::RangeInclusive<f64> = 0.2..=5.0;
        let spans = span_s(other).zip(span_s(time));
        let is_other = match are_of_signals(names, time, other) {
            true => spans.is_some_and(|(one, own)| LIKE_A_CLOCK.contains(&(one / own))),
            false => has_name || spans.is_some_and(is_rate),
        };
        let row = (0..rows.len()).find(|&row| !is_same(row, other)).filter(|_| is_other)?;
        Some((row, other))
    };
    let Some((row, other)) = others.iter().find_map(differs) else { return Ok(()) };
    let [own, text] = [time, other].map(|column| error::shown(cell(row, column)));
    Err(LogError::damaged(
        path,
        format!("{place} {}", rows[row].0 + 1),
        format!(
            "columns {} `{}` and {} `{}` are both a time, and differ (`{own}` and `{text}`): a table is read over one time\n\
             hint: write a table for each of them, or all signals over one time",
            time + 1,
            error::shown(&names[time].0),
            other + 1,
            error::shown(&names[other].0),
        ),
    ))
}

/// Whether another column may be a time as well by its name and unit, and then whether it has the name of the time.
pub(crate) fn may_be_time(names: &[(String, String)], time: usize, other: usize) -> Option<bool> {
    let (name, unit) = &names[other];
    let in_time = unit.is_empty() || Unit::parse(unit).is_none_or(|unit| unit.quantity == Quantity::Time);
    if other == time || !in_time {
        return None;
    }
    let base = base_name(&names[time].0);
    // A `T` next to a `t` is a temperature.
    let has_name = match &base {
        Some(base) if base.len() == 1 => *name == names[time].0,
        Some(_) => base_name(name) == base,
        None => *name == names[time].0,
    };
    let has_name = has_name || are_of_signals(names, time, other);
    let name = name.to_lowercase();
    let is_named = ["time", "zeit", "stamp"].iter().any(|word| name.contains(word));
    (has_name || is_named).then_some(has_name)
}

/// Whether two columns are each called the time of a signal, in the same way.
fn are_of_signals(names: &[(String, String)], time: usize, other: usize) -> bool {
    time_of_signal(&names[time]).is_some_and(|word| time_of_signal(&names[other]) == Some(word))
}

/// The word for time before or after the name of a signal, as in `t_Eng [ms]` and `Eng_t [ms]`: the time of that signal alone; and whether it is before.
fn time_of_signal((name, unit): &(String, String)) -> Option<(String, bool)> {
    const SIGNS: [char; 4] = ['_', ' ', '.', '-'];
    Unit::parse(unit).filter(|unit| unit.quantity == Quantity::Time)?;
    let before = name.split_once(SIGNS).map(|(word, signal)| (word, signal, true));
    let after = name.rsplit_once(SIGNS).map(|(signal, word)| (word, signal, false));
    let words = [before, after].into_iter().flatten().filter(|(_, signal, _)| !signal.is_empty());
    let mut words = words.map(|(word, _, is_before)| (word.to_lowercase(), is_before));
    words.find(|(word, _)| ["t", "ts", "time", "zeit"].contains(&word.as_str()))
}

/// The column of the time: the one that is wanted, or has a usual name, or is the first one and in a unit of time.
pub(crate) fn time_column(
    path: &Path,
    names: &[(String, String)],
    titles: &[String],
    wanted: Option<&TimeColumn>,
) -> Result<usize, LogError> {
    let in_time = |(_, unit): &&(String, String)| Unit::parse(unit).is_some_and(|unit| unit.quantity == Quantity::Time);
    let found = match wanted {
        Some(TimeColumn { name, .. }) => (0..names.len()).find(|&i| names[i].0 == *name || titles[i] == *name),
        None => {
            let named = (0..names.len()).find(|&i| is_time_name(&names[i].0));
            named.or_else(|| names.first().filter(in_time).map(|_| 0))
        }
    };
    found.ok_or_else(|| LogError::file(path, without_time(names, wanted)))
}

/// The columns of a time that stands in several: hours, minutes, seconds, and milliseconds if there are any.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ClockParts {
    pub(crate) hour: usize,
    pub(crate) minute: usize,
    pub(crate) second: usize,
    pub(crate) ms: Option<usize>,
}

impl ClockParts {
    /// Those of a table, if it has them and no other column with the name of a time.
    pub(crate) fn of(names: &[(String, String)]) -> Option<Self> {
        let find = |words: &[&str]| names.iter().position(|(name, _)| words.contains(&name.to_lowercase().as_str()));
        let parts = Self {
            hour: find(&["hour", "hours", "stunde", "stunden"])?,
            minute: find(&["minute", "minutes", "min", "minuten"])?,
            second: find(&["second", "seconds", "sec", "sekunde", "sekunden"])?,
            ms: find(&["ms", "msec", "millis", "millisecond", "milliseconds", "millisekunden"]),
        };
        let is_other = |(i, (name, _)): (usize, &(String, String))| !parts.contains(i) && is_time_name(name);
        (!names.iter().enumerate().any(is_other)).then_some(parts)
    }

    /// Whether a column is one of them.
    pub(crate) fn contains(self, column: usize) -> bool {
        [Some(self.hour), Some(self.minute), Some(self.second), self.ms].contains(&Some(column))
    }

    /// The time of the day, s; none where a part is none.
    pub(crate) fn seconds(self, mut number: impl FnMut(usize) -> Option<f64>) -> Option<f64> {
        let ms = self.ms.map_or(Some(0.0), &mut number)?;
        let [hour, minute, second] = [self.hour, self.minute, self.second].map(number);
        Some(3600.0 * hour? + 60.0 * minute? + second? + 1e-3 * ms).filter(|time_s| time_s.is_finite())
    }
}

/// The error of a table without a time, with what to do.
fn without_time(names: &[(String, String)], wanted: Option<&TimeColumn>) -> String {
    let some: Vec<String> = names.iter().take(12).map(|(name, _)| error::shown(name)).collect();
    let is_likely = |name: &&String| {
        let name = name.to_lowercase();
        ["time", "zeit", "stamp", "sec", "sek", "clock", "uhr", "date"].iter().any(|word| name.contains(word))
    };
    let likely = names.iter().map(|(name, _)| name).filter(|name| !name.is_empty());
    let likely = likely.clone().find(is_likely).or_else(|| likely.clone().next());
    format!(
        "there is no column {}; the first columns are {}\nhint: name it `time_s`, or in the channel map under [time], for example\n  \
         [time]\n  name = \"{}\"\n  unit = \"ms\"",
        wanted.map_or("for the time".to_owned(), |time| format!("`{}` for the time", error::shown(&time.name))),
        some.join(", "),
        likely.map_or("Time".to_owned(), |name| error::shown(name))
    )
}

/// The size of the unit of a column with times, s.
pub(crate) fn time_unit(
    path: &Path,
    (name, unit): &(String, String),
    wanted: Option<&TimeColumn>,
    notes: &mut Vec<String>,
) -> Result<f64, LogError> {
    let text = wanted.and_then(|time| time.unit.clone()).unwrap_or_else(|| unit.clone());
    if text.is_empty() {
        notes.push(format!("the column `{}` has no unit: taken as s", error::shown(name)));
        return Ok(1.0);
    }
    match Unit::parse(&text) {
        Some(Unit { quantity: Quantity::Time, size, .. }) => Ok(size),
        _ => Err(LogError::file(
            path,
            format!(
                "the time `{}` has the unit `{}`\nhint: it can be s, ms, us, ns, min or h; set it in the channel map under [time]",
                error::shown(name),
                error::shown(&text)
            ),
        )),
    }
}
