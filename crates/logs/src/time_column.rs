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

/// Refuses a table with a time for each signal: another column has the name of the time, and other values. `rows` are some of its first rows, with their lines.
pub(crate) fn one_clock<'c>(
    path: &Path,
    names: &[(String, String)],
    time: usize,
    mut rows: impl Iterator<Item = (usize, Vec<Cow<'c, str>>)>,
) -> Result<(), LogError> {
    let Some(base) = base_name(&names[time].0) else { return Ok(()) };
    let is_other = |&i: &usize| {
        let (name, unit) = &names[i];
        let may_be_time = unit.is_empty() || Unit::parse(unit).is_none_or(|unit| unit.quantity == Quantity::Time);
        // A `T` beside a `t` is a temperature.
        let is_same = || if base.len() == 1 { *name == names[time].0 } else { base_name(name).as_ref() == Some(&base) };
        i != time && may_be_time && is_same()
    };
    let others: Vec<usize> = (0..names.len()).filter(is_other).collect();
    if others.is_empty() {
        return Ok(());
    }
    // The same time may have another unit, and other digits.
    let time_s = |column: usize, cell: &str| {
        let size = Unit::parse(&names[column].1).map_or(1.0, |unit| unit.size);
        cell.replace(',', ".").parse::<f64>().ok().map(|number| number * size)
    };
    let is_same = |(at, cell): (usize, &str), own: &str| {
        let both = || time_s(at, cell).zip(time_s(time, own));
        cell == own || both().is_some_and(|(one, other)| (one - other).abs() <= 1e-9 * one.abs().max(other.abs()))
    };
    let differs = |(line, row): (usize, Vec<Cow<'c, str>>)| {
        let own = row.get(time)?.to_string();
        let cells = others.iter().filter_map(|&i| Some((i, row.get(i)?)));
        let (other, text) = cells.into_iter().find(|(i, cell)| !is_same((*i, cell), &own))?;
        Some((line, own, (other, text.to_string())))
    };
    let Some((line, own, (other, text))) = rows.find_map(differs) else { return Ok(()) };
    Err(LogError::damaged(
        path,
        format!("line {}", line + 1),
        format!(
            "columns {} and {} are both a time `{}`, and differ (`{}` and `{}`): a table is read over one time\n\
             hint: write a table for each of them, or all signals over one time",
            time + 1,
            other + 1,
            error::shown(&names[time].0),
            error::shown(&own),
            error::shown(&text)
        ),
    ))
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

/// What is said of a table without a time, with what to do.
fn without_time(names: &[(String, String)], wanted: Option<&TimeColumn>) -> String {
    let find =
        |words: &[&str]| names.iter().map(|(name, _)| name).find(|name| words.contains(&name.to_lowercase().as_str()));
    let parts =
        [&["hour", "hours", "stunde"][..], &["minute", "minutes", "min"], &["second", "seconds", "sec", "sekunde"]];
    if let ([Some(hour), Some(minute), Some(second)], None) = (parts.map(find), wanted) {
        return format!(
            "the time stands in several columns, such as `{hour}`, `{minute}` and `{second}`\n\
             hint: join them into one column of clock times, `18:16:50.010`, or of dates, `2024-05-16 18:16:50.010`"
        );
    }
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
                "the time `{}` has the unit `{}`\nhint: it can be s, ms, us, ns, min or h; say it in the channel map under [time]",
                error::shown(name),
                error::shown(&text)
            ),
        )),
    }
}
