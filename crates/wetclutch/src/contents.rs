//! What is in a log: its channels, a first map of them, and the shifts that its speeds show.

use logs::{Channel, ChannelMap, ChannelSummary, Quality, Readings, Shift, ShiftFinder};
use trace::Cell;

use crate::{Error, LogInput, Notes, Table};

/// The channels of a log, a row for each: samples and those that cannot be used, period, span, values and gaps.
///
/// # Errors
/// The log cannot be read.
pub fn channels(log: LogInput<'_>, say: Notes<'_>) -> Result<Table, Error> {
    let mut opened = log.open(None, 1)?;
    let found = logs::inspect(&mut opened)?;
    found.notes.iter().for_each(|note| say(&format!("warning: {note}")));
    Ok(Table::of_rows(opened.channels().iter().zip(&found.channels).map(channel_cells)))
}

fn channel_cells<'a>((channel, summary): (&'a Channel, &ChannelSummary)) -> Vec<(String, Cell<'a>)> {
    let counts = &summary.counts;
    let number = |value: Option<f64>| Cell::Number(value.unwrap_or(f64::NAN));
    let end = |ends: Option<[f64; 2]>, at: usize| number(ends.map(|ends| ends[at]));
    let cells = [
        ("channel", Cell::Word(&channel.name)),
        ("group", Cell::Word(&channel.group)),
        ("unit", Cell::Word(&channel.unit)),
        ("samples", Cell::Whole(counts.total())),
        ("not_usable", Cell::Whole(counts.total() - counts.of(Quality::Good))),
        ("period_s", number(summary.period_s)),
        ("from_s", end(summary.span_s, 0)),
        ("to_s", end(summary.span_s, 1)),
        ("minimum", end(summary.range, 0)),
        ("maximum", end(summary.range, 1)),
        ("gaps", Cell::Whole(summary.gaps)),
        ("longest_gap_s", number((summary.gaps > 0).then_some(summary.longest_s))),
    ];
    cells.map(|(name, cell)| (name.to_owned(), cell)).into()
}

/// A first channel map of a log by the names, units and values of its channels, as text. Every line of it has to be checked.
///
/// # Errors
/// The log cannot be read.
pub fn suggested_map(log: LogInput<'_>) -> Result<String, Error> {
    let mut opened = log.open(None, 1)?;
    let ranges = logs::inspect(&mut opened)?.ranges();
    let dbc = log.map.open.dbc.as_ref().map(|dbc| dbc.to_string_lossy().into_owned());
    Ok(logs::suggest(opened.channels(), &ranges, dbc.as_deref()))
}

/// The shifts that the speeds of a log show, a row for each, without a vehicle file: gears, kind, times, flare and jerk. Where no
/// gear is mapped the map needs the ratios of the gears. A log without a map has the names of the program.
///
/// # Errors
/// The log cannot be read, a channel that is needed is not in it, or nothing tells a shift.
pub fn log_shifts(log: LogInput<'_>, say: Notes<'_>) -> Result<Table, Error> {
    let mut opened = log.open(None, 1)?;
    let own;
    let map = if log.map.channels.is_empty() {
        own = ChannelMap { gearbox: log.map.gearbox.clone(), ..fit::own_names(&opened)? };
        &own
    } else {
        log.map
    };
    map.resolve(&opened)?;
    let mut finder = ShiftFinder::new(&map.gearbox, |role| map.has(role))?;
    let mut readings = Readings::new(&mut opened, map)?;
    let mut resets = 0;
    while let Some(reading) = readings.next_or_refused() {
        let reading = reading?;
        if readings.resets() > resets {
            resets = readings.resets();
            finder.restart();
        }
        finder.push(&reading);
    }
    readings.check()?;
    readings.notes().iter().for_each(|note| say(&format!("warning: {note}")));
    // The log ends here.
    finder.restart();
    let found: Vec<Shift> = finder.take_settled(f64::INFINITY);
    finder.notes().iter().for_each(|note| say(&format!("warning: {note}")));
    Ok(Table::of_rows(found.iter().map(shift_cells)))
}

fn shift_cells(shift: &Shift) -> Vec<(String, Cell<'_>)> {
    let number = |value: Option<f64>| Cell::Number(value.unwrap_or(f64::NAN));
    let quality = &shift.quality;
    let cells = [
        ("from", Cell::Whole(u64::from(shift.from))),
        ("to", Cell::Whole(u64::from(shift.to))),
        ("kind", Cell::Word(shift.kind_name())),
        ("command_s", number(shift.command_s)),
        ("gear_signal_s", number(shift.gear_s)),
        ("inertia_from_s", number(shift.inertia_s.map(|ends| ends[0]))),
        ("inertia_to_s", number(shift.inertia_s.map(|ends| ends[1]))),
        ("inertia_half_interval_s", number(quality.inertia_half_s)),
        ("flare_rad_s", number(quality.flare_rad_s)),
        ("flare_half_interval_rad_s", number(quality.flare_half_rad_s)),
        ("jerk_m_s3", number(quality.jerk_m_s3)),
        ("jerk_half_interval_m_s3", number(quality.jerk_half_m_s3)),
    ];
    cells.map(|(name, cell)| (name.to_owned(), cell)).into()
}
