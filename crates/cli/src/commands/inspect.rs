//! `wetclutch inspect`.

use std::path::Path;

use drivetrain::Real;
use fit::drive::{DriveRecord, converter_file};
use logs::plausibility::{likely_time_unit, too_fast_a_time};
use logs::{Channel, ChannelMap, ChannelSummary, Inspection, Log, Reading, Readings, RoleSummary, Shift, ShiftFinder};
use serde_json::{Value, json};
use trace::ShownPath as _;
use trace::units::rpm;

use crate::args::Inspect;
use crate::commands::inspect_drive::{Drive, has_command, page, write_converter};
use crate::commands::inspect_json;
use crate::commands::suggested::by_values;
use crate::commands::written::{head, is_page, replaces_only};
use crate::commands::{channel_map, check_output, not_an_input, or_own_names, shown_from_s};
use crate::failure::Failure;
use crate::output;

/// Longer names are cut in the table.
const LONGEST_NAME: usize = 40;

pub(crate) fn inspect(options: &Inspect) -> Result<(), Failure> {
    let [log] = options.logs.as_slice() else { return inspect_all(options) };
    let found = inspect_log(options, log)?;
    found.map_or(Ok(()), |found| output::json(&found))
}

/// Inspects several logs, one after the other; one that fails does not stop the others.
fn inspect_all(options: &Inspect) -> Result<(), Failure> {
    let of_one = [
        ("--suggest", options.suggest),
        ("-o", options.output.is_some()),
        ("--write-converter", options.write_converter.is_some()),
    ];
    if let Some((option, _)) = of_one.iter().find(|(_, is_given)| *is_given) {
        return Err(Failure::Input(format!("{option} takes one log\nhint: start the command once for each")));
    }
    let (mut found, mut failed) = (Vec::new(), Vec::new());
    for (at, log) in options.logs.iter().enumerate() {
        if at > 0 && !options.json {
            output::line("")?;
        }
        if options.shifts && !options.json {
            output::line(&format!("{}:", log.shown()))?;
        }
        match inspect_log(options, log) {
            Ok(of_log) => found.extend(of_log),
            Err(Failure::BrokenPipe) => return Err(Failure::BrokenPipe),
            Err(failure) => {
                output::error(&failure.to_string());
                failed.push(log.shown().to_string());
            }
        }
    }
    if options.json {
        output::json(&json!({ "logs": found }))?;
    }
    if failed.is_empty() {
        return Ok(());
    }
    let (count, all) = (failed.len(), options.logs.len());
    Err(Failure::Input(format!("{count} of {all} logs are not inspected: {}", failed.join(", "))))
}

/// Prints what is in a log, or returns it for JSON.
fn inspect_log(options: &Inspect, path: &Path) -> Result<Option<Value>, Failure> {
    let mut map = channel_map(&options.mapping)?;
    if !options.ratios.is_empty() {
        map.gearbox.ratios.clone_from(&options.ratios);
    }
    let mut log = Log::open(path, &map.open)?.on_threads(wetclutch::available_threads());
    if log.channels().is_empty() {
        return Err(nothing_in(path, "channels"));
    }
    if options.suggest {
        let has_frames = !["CSV", "Parquet"].iter().any(|format| log.format().starts_with(format));
        if options.mapping.dbc.is_some() && !has_frames {
            output::note(&format!("warning: {}", logs::log::NO_FRAMES));
        }
        // The map may be put into any folder.
        let dbc = options.mapping.dbc.as_ref().filter(|_| has_frames);
        let dbc =
            dbc.map(|dbc| std::path::absolute(dbc).unwrap_or_else(|_| dbc.clone()).to_string_lossy().into_owned());
        // The values of standard input are gone after they are read.
        let from_pipe = path == Path::new("-");
        let inspection = if from_pipe { None } else { logs::inspect(&mut log).ok() };
        let ranges = inspection.map_or(Vec::new(), |inspection| inspection.ranges());
        let by_names = logs::suggest(log.channels(), &ranges, dbc.as_deref());
        let by_values = by_values(path, &by_names, log.channels(), &ranges);
        let suggested = format!("{by_names}{by_values}");
        if options.json {
            return Ok(Some(json!({ "log": path.shown().to_string(), "channel_map": suggested })));
        }
        output::toml(suggested.trim_end())?;
        return Ok(None);
    }
    if options.shifts {
        map = or_own_names(map, &log)?;
        if map.channels.is_empty() {
            return Err(Failure::Input(
                "--shifts needs the channels of the signals\nhint: give --map MAP.toml (`inspect --suggest` writes a first one) or --channel"
                    .to_owned(),
            ));
        }
        for output in [&options.output, &options.write_converter] {
            check_output(output.as_ref())?;
            not_an_input(output.as_ref(), options.mapping.files().chain(&options.logs))?;
        }
        let is_converter = |path: &Path| head(path).starts_with(converter_file::BEGIN);
        let converter = options.write_converter.as_deref();
        converter.map(|path| replaces_only("table of a converter", path, is_converter)).transpose()?;
        options.output.as_deref().map(|page| replaces_only("page in HTML", page, is_page)).transpose()?;
        return shifts(options, path, &mut log, &map);
    }
    let inspection = logs::inspect(&mut log)?;
    if inspection.channels.iter().all(|summary| summary.counts.total() == 0) {
        return Err(match inspection.notes.iter().find(|note| note.contains(logs::can::NOT_IN_DBC)) {
            Some(unknown) => Failure::Input(format!(
                "{}: none of its frames is of a message of the DBC; {unknown}\nhint: give the DBC of this bus with --dbc",
                path.shown()
            )),
            None => nothing_in(path, "samples"),
        });
    }
    if options.json {
        return Ok(Some(inspect_json::channels(path, &log, &inspection)));
    }
    output::line(&format!("{}: {}, {} channels", path.shown(), log.format(), log.channels().len()))?;
    channels(&log, &inspection)?;
    remarks(&inspection.notes);
    let steps_s = inspection.channels.iter().filter_map(|summary| summary.period_s);
    let spans_s = || inspection.channels.iter().filter_map(|summary| summary.span_s);
    let first_s = spans_s().map(|[first_s, _]| first_s).fold(f64::INFINITY, f64::min);
    let last_s = spans_s().map(|[_, last_s]| last_s).fold(f64::NEG_INFINITY, f64::max);
    remarks(wrong_time(steps_s.fold(f64::INFINITY, f64::min), last_s - first_s).as_slice());
    if !map.channels.is_empty() {
        check_map(path, &log, &map)?;
    }
    Ok(None)
}

/// A log without channels or samples.
fn nothing_in(log: &Path, what: &str) -> Failure {
    let shown = log.shown();
    Failure::Input(format!(
        "{shown}: there are no {what} in it\nhint: check that the recorder had channels to write, and has written them"
    ))
}

/// Refuses a map that does not fit the log, or by whose units its values cannot be right, as an estimate does.
fn check_map(path: &Path, log: &Log, map: &ChannelMap) -> Result<(), Failure> {
    map.resolve(log)?;
    if path == Path::new("-") {
        output::note(
            "the channel map fits the names and units of the log; values of standard input are not compared with them",
        );
        return Ok(());
    }
    // A log is read once.
    let mut log = Log::open(path, &map.open)?.on_threads(wetclutch::available_threads());
    let mut readings = Readings::new(&mut log, map)?;
    readings.by_ref().try_for_each(|reading| reading.map(drop))?;
    readings.check()?;
    output::note("the channel map fits the log");
    Ok(())
}

/// What is wrong with the unit of the time, of a log with this time between rows and from the first to the last, s.
fn wrong_time(step_s: f64, span_s: f64) -> Option<String> {
    let too_slow = likely_time_unit(step_s).map(|unit| {
        format!(
            "no channel has a sample more often than once in a second: the times suggest {unit}\n\
             hint: set its `name` and `unit = \"{unit}\"` under [time] in the channel map"
        )
    });
    too_slow.or_else(|| too_fast_a_time(step_s, span_s))
}

/// The middle time between the first readings of each entry of a map.
#[derive(Default)]
struct Rates(Vec<(f64, Vec<f64>)>);

impl Rates {
    /// Takes the time stamp of a reading of an entry.
    fn push(&mut self, entry: usize, stamp_s: f64) {
        const FIRST: usize = 512;
        if self.0.len() <= entry {
            self.0.resize(entry + 1, (f64::NAN, Vec::new()));
        }
        let (last_s, steps_s) = &mut self.0[entry];
        if steps_s.len() < FIRST && last_s.is_finite() {
            steps_s.push(stamp_s - *last_s);
        }
        *last_s = stamp_s;
    }

    /// That of the entry with the highest rate, s; infinite without two readings of one.
    fn step_s(self) -> f64 {
        let steps_s = self.0.into_iter().map(|(_, steps_s)| steps_s).filter(|steps_s| !steps_s.is_empty());
        steps_s.map(trace::median_step_s).fold(f64::INFINITY, f64::min)
    }
}

fn remarks(notes: &[String]) {
    for note in notes {
        output::note(&format!("warning: {note}"));
    }
}

fn say_origin(origin_s: f64) -> Result<(), Failure> {
    if origin_s != 0.0 {
        output::line(&format!("times from {origin_s:.0} s of the log's clock on"))?;
    }
    Ok(())
}

/// A name as the table shows it.
fn cut(name: &str) -> String {
    if name.chars().count() <= LONGEST_NAME {
        return name.escape_debug().to_string();
    }
    name.chars().take(LONGEST_NAME - 3).flat_map(char::escape_debug).collect::<String>() + "..."
}

/// A number with about four digits.
fn short(number: f64) -> String {
    let size = number.abs();
    match () {
        () if size != 0.0 && !(1e-3..1e7).contains(&size) => format!("{number:.2e}"),
        () if size >= 1000.0 || number.fract() == 0.0 => format!("{number:.0}"),
        () if size >= 10.0 => format!("{number:.1}"),
        () => format!("{number:.3}"),
    }
}

fn channels(log: &Log, inspection: &Inspection) -> Result<(), Failure> {
    let first_s = inspection
        .channels
        .iter()
        .filter_map(|channel| channel.span_s)
        .map(|[first_s, _]| first_s)
        .fold(f64::INFINITY, f64::min);
    let origin_s = shown_from_s(if first_s.is_finite() { first_s } else { 0.0 });
    say_origin(origin_s)?;
    let grouped = log.channels().iter().any(|channel| !channel.group.is_empty());
    let faulty = inspection.channels.iter().any(|summary| !summary.counts.faults().is_empty());
    let cells = |group: &str, rest: [String; 9], faults: String| {
        let group = grouped.then(|| group.to_owned());
        let [name, unit, rest @ ..] = rest;
        [Some(name), group, Some(unit)]
            .into_iter()
            .flatten()
            .chain(rest)
            .chain(faulty.then_some(faults))
            .collect::<Vec<_>>()
    };
    let titles = ["channel", "unit", "samples", "Hz", "from s", "to s", "minimum", "maximum", "longest gap s"];
    let row = |(channel, summary): (&Channel, &ChannelSummary)| {
        let span = |i: usize| summary.span_s.map_or(String::new(), |span_s| format!("{:.2}", span_s[i] - origin_s));
        let range = |i: usize| summary.range.map_or(String::new(), |range| short(range[i]));
        let gap = match summary.gaps {
            0 => String::new(),
            gaps => format!("{:.2} ({gaps})", summary.longest_s),
        };
        let numbers = [
            cut(&channel.name),
            cut(&channel.unit),
            wetclutch::grouped(summary.counts.total()),
            summary.period_s.map_or(String::new(), |period_s| short((1.0 / period_s * 100.0).round() / 100.0)),
            span(0),
            span(1),
            range(0),
            range(1),
            gap,
        ];
        cells(&cut(&channel.group), numbers, summary.counts.faults())
    };
    let rows = || {
        let head = cells("group", titles.map(str::to_owned), "not usable".to_owned());
        std::iter::once(head).chain(log.channels().iter().zip(&inspection.channels).map(row))
    };
    Ok(output::long_table(if grouped { 3 } else { 2 }, rows)?)
}

fn shifts(options: &Inspect, path: &Path, log: &mut Log, map: &ChannelMap) -> Result<Option<Value>, Failure> {
    // A channel that is not there is the reason for what the finder would miss.
    map.resolve(log)?;
    let mut finder = ShiftFinder::new(&map.gearbox, |role| map.has(role))?;
    let mut record = DriveRecord::default();
    let mut readings = Readings::new(log, map)?;
    let (mut first_s, mut last_s, mut origin_s, mut resets) = (f64::NAN, f64::NAN, None, 0);
    let mut rates = Rates::default();
    while let Some(reading) = readings.next_or_refused() {
        let reading = reading?;
        if readings.resets() > resets {
            resets = readings.resets();
            finder.restart();
        }
        if reading.is_refused() {
            finder.push(&reading);
            continue;
        }
        first_s = first_s.min(reading.time_s);
        last_s = reading.time_s;
        rates.push(readings.entry(), reading.stamp_s);
        finder.push(&reading);
        let origin_s = *origin_s.get_or_insert_with(|| shown_from_s(first_s));
        if options.output.is_some() || options.write_converter.is_some() {
            record.push(&Reading { time_s: reading.time_s - origin_s, ..reading });
        }
    }
    readings.check()?;
    let origin_s = origin_s.filter(|_| !options.json).unwrap_or(0.0);
    let mut notes = notes(&readings);
    notes.extend(wrong_time(rates.step_s(), last_s - first_s));
    // The log ends here.
    finder.restart();
    let found: Vec<Shift> = finder.take_settled(f64::INFINITY).iter().map(|shift| shift.earlier_by(origin_s)).collect();
    notes.extend(finder.notes());
    let drive = Drive::of(record, map);
    if let Some(converter) = &options.write_converter {
        write_converter(converter, path, &drive)?;
    }
    if options.json {
        return Ok(Some(inspect_json::shifts(path, [first_s, last_s], &found, &notes)));
    }
    remarks(&notes);
    say_origin(origin_s)?;
    let shifts = if found.len() == 1 { "shift" } else { "shifts" };
    output::line(&format!("{} {shifts} from {:.2} to {:.2} s", found.len(), first_s - origin_s, last_s - origin_s))?;
    if !found.is_empty() {
        let titles = [
            "shift",
            "kind",
            "phases, s each",
            "command s",
            "gear signal s",
            "inertia phase s, 95 %",
            "flare rpm, 95 %",
            "jerk m/s^3, 95 %",
        ];
        output::table(3, titles.map(str::to_owned).to_vec(), found.iter().map(row).collect())?;
        output::line(
            "command and gear signal: to one row; phases: as uncertain as begin and end of the inertia phase",
        )?;
    }
    if found.iter().any(|shift| shift.quality.jerk_m_s3.is_none()) {
        output::note(
            "jerk: none without vehicle_acceleration, vehicle_speed, or output_speed with `gearbox.output_rad_per_m`, in all of a shift",
        );
    }
    if !has_command(map) {
        output::note("no valve command is mapped: shifts and speeds can be studied, a pressure cannot be estimated");
    }
    if let Some(output) = &options.output {
        page((output, path), options, map, &found, &drive, notes)?;
    }
    Ok(None)
}

/// What was met in the log, in sentences.
fn notes(readings: &Readings<'_>) -> Vec<String> {
    let faulty = readings.summary().into_iter().filter(|summary| !summary.counts.faults().is_empty());
    let of = |summary: RoleSummary| {
        format!(
            "of {} samples of {} some are not used: {}",
            wetclutch::grouped(summary.counts.total()),
            summary.name,
            summary.counts.faults()
        )
    };
    faulty.map(of).chain(readings.notes().iter().cloned()).collect()
}

/// Half of an interval of 95 % behind its value, rounded up; that there is none where readings do not show it.
fn with_half(half: Option<f64>, digits: i32) -> String {
    let unit = Real::powi(10.0, digits);
    let digits = usize::try_from(digits).unwrap_or(0);
    half.map_or(" (interval not identifiable)".to_owned(), |half| {
        format!(" +- {:.digits$}", (unit * half).ceil() / unit)
    })
}

fn row(shift: &Shift) -> Vec<String> {
    let time = |time_s: Option<f64>| time_s.map_or(String::new(), |time_s| format!("{time_s:.2}"));
    let phases: Vec<String> =
        shift.phases().iter().map(|(phase, [from_s, to_s])| format!("{} {:.2}", phase.name(), to_s - from_s)).collect();
    vec![
        format!("{}-{}", shift.from, shift.to),
        shift.kind_name().to_owned(),
        phases.join(", "),
        time(shift.command_s),
        time(shift.gear_s),
        shift.inertia_s.map_or(String::new(), |[from_s, to_s]| {
            format!("{from_s:.2} to {to_s:.2}{}", with_half(shift.quality.inertia_half_s, 2))
        }),
        shift.quality.flare_rad_s.map_or(String::new(), |flare| {
            format!("{:.0}{}", rpm(flare), with_half(shift.quality.flare_half_rad_s.map(rpm), 0))
        }),
        shift
            .quality
            .jerk_m_s3
            .map_or(String::new(), |jerk| format!("{jerk:.1}{}", with_half(shift.quality.jerk_half_m_s3, 1))),
    ]
}
