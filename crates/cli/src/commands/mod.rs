//! One file for each subcommand.

mod assumed;
mod bench;
mod bench_page;
mod car;
mod check;
mod check_defaults;
mod check_json;
mod check_page;
mod compare;
mod compare_page;
mod convert;
mod demo;
mod demo_drive;
mod design;
mod design_car;
mod design_page;
mod error_bound;
mod error_bound_page;
mod estimate;
mod export;
mod fit;
mod gearbox;
mod init;
mod init_from_log;
mod inspect;
mod inspect_drive;
mod inspect_json;
mod logs_of;
mod matrix;
mod page;
mod reproduce;
mod sensitivity;
mod shell;
mod simulate;
mod simulate_drive;
mod study;
mod suggested;
mod watch;
mod worst_case;
mod worst_case_page;
mod written;

use car::read_car;

pub(crate) use bench::bench;
pub(crate) use check::check;
pub(crate) use compare::compare;
pub(crate) use convert::convert;
pub(crate) use demo::demo;
pub(crate) use design::design;
pub(crate) use error_bound::error_bound;
pub(crate) use estimate::estimate;
pub(crate) use export::export;
pub(crate) use fit::fit;
pub(crate) use init::init;
pub(crate) use inspect::inspect;
pub(crate) use reproduce::reproduce;
pub(crate) use sensitivity::sensitivity;
pub(crate) use shell::{completions, man};
pub(crate) use simulate::simulate;
pub(crate) use study::{merge, study};
pub(crate) use watch::watch;
pub(crate) use worst_case::worst_case;
pub(crate) use written::replace_any;

use std::io::{self, BufWriter, Write as _};
use std::path::{Path, PathBuf};

use config::{Kind, Source};
use indicatif::{ProgressBar, ProgressStyle};
use logs::{ChannelMap, Log};
use serde::{Serialize, Serializer};
use trace::{Cell, CsvWriter, ShownPath as _, Trace, WholeFile, signal};

use crate::args::Mapping;
use crate::failure::Failure;
use crate::output;

/// Writes a trace as a comma-separated file, whole or not at all.
fn write_trace(path: &Path, trace: &Trace) -> Result<(), Failure> {
    trace::write_csv(path, trace).map_err(|error| Failure::writing(path, &error))
}

/// Writes a text file, whole or not at all.
fn write_text(path: &Path, text: &str) -> Result<(), Failure> {
    trace::write_whole(path, |writer| writer.write_all(text.as_bytes())).map_err(|error| Failure::writing(path, &error))
}

/// Warns of an option that changes nothing here, and says why.
pub(crate) fn warn_without_effect(option: &str, why: &str) {
    output::note(&without_effect(option, why));
}

/// The warning of an option that changes nothing here.
fn without_effect(option: &str, why: &str) -> String {
    format!("warning: {option} has no effect: {why}\nhint: leave it out")
}

/// Warns of `--sensors` where nothing is read by sensors.
fn warn_of_sensors() {
    warn_without_effect("--sensors", "it is for the vehicle file of a car with a gearbox");
}

/// Writes rows of named cells as a comma-separated file, whole or not at all.
fn write_cells(path: &Path, rows: &[Vec<(String, Cell<'_>)>]) -> Result<(), Failure> {
    let names = rows.first().into_iter().flatten().map(|(name, _)| name.as_str());
    cells_file(path, names, rows)?.finish().map_err(|error| Failure::writing(path, &error))
}

/// A comma-separated file of rows of named cells, which has not got its name yet.
fn cells_file<'n>(
    path: &Path,
    names: impl Iterator<Item = &'n str>,
    rows: &[Vec<(String, Cell<'_>)>],
) -> Result<WholeFile, Failure> {
    let write = || -> std::io::Result<WholeFile> {
        let mut table = CsvWriter::without_time(WholeFile::create(path)?, names)?;
        for row in rows {
            table.cells(row.iter().map(|(_, cell)| *cell))?;
        }
        table.finish()
    };
    write().map_err(|error| Failure::writing(path, &error))
}

/// Writes objects as a list in JSON, one after the other: there may be many.
fn write_json_list<'a, N: AsRef<str> + 'a>(
    path: &Path,
    objects: impl Iterator<Item = JsonObject<'a, N>>,
) -> Result<(), Failure> {
    let write = |writer: &mut (dyn io::Write + Send)| {
        let mut writer = BufWriter::new(writer);
        serde_json::Serializer::with_formatter(&mut writer, output::Pretty::new()).collect_seq(objects)?;
        writer.write_all(b"\n")?;
        writer.flush()
    };
    trace::write_whole(path, write).map_err(|error| Failure::writing(path, &error))
}

/// Named cells as a JSON object, in the order of their names.
struct JsonObject<'a, N>(Vec<(N, Cell<'a>)>);

impl<'a, N: AsRef<str>> JsonObject<'a, N> {
    fn of(cells: impl IntoIterator<Item = (N, Cell<'a>)>) -> Self {
        let mut cells: Vec<_> = cells.into_iter().collect();
        cells.sort_by(|(one, _), (other, _)| one.as_ref().cmp(other.as_ref()));
        Self(cells)
    }
}

impl<N: AsRef<str>> Serialize for JsonObject<'_, N> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(name, cell)| (name.as_ref(), JsonCell(*cell))))
    }
}

/// A cell as a JSON value; not a number becomes null.
struct JsonCell<'a>(Cell<'a>);

impl Serialize for JsonCell<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            Cell::Number(number) => serializer.serialize_f64(number),
            Cell::Whole(number) => serializer.serialize_u64(number),
            Cell::Word(word) => serializer.serialize_str(word),
            // An object has no row before it.
            Cell::SameWord | Cell::SameWords => serializer.serialize_unit(),
        }
    }
}

/// Checks that these files can be written into a folder, before the work starts. Creates a missing folder.
fn writable(folder: &Path, names: &[&str]) -> Result<(), Failure> {
    // A file that is created and dropped before it gets its name leaves nothing behind.
    trace::WholeFile::create(&folder.join("probe")).map_err(|error| {
        let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        Failure::writing(folder, &error)
    })?;
    names.iter().try_for_each(|name| check_output(Some(&folder.join(name))))
}

/// The same, and that files which are there were written by this program.
fn replaceable(folder: &Path, names: &[&str]) -> Result<(), Failure> {
    writable(folder, names)?;
    written::replaces_only_ours(folder, names)
}

/// Refuses to write an output over one of the files that it is made from.
fn not_an_input<'a>(output: Option<&PathBuf>, inputs: impl IntoIterator<Item = &'a PathBuf>) -> Result<(), Failure> {
    let Some(there) = output.and_then(|output| std::fs::canonicalize(output).ok()) else { return Ok(()) };
    match inputs.into_iter().find(|input| std::fs::canonicalize(input).is_ok_and(|input| input == there)) {
        None => Ok(()),
        Some(input) => Err(Failure::Input(format!(
            "{}: the output would replace this input\nhint: choose another name or folder after -o",
            input.shown()
        ))),
    }
}

/// Whether two paths, of files that may not be there yet, are of one file.
fn is_same_file(one: &Path, other: &Path) -> bool {
    let place = |path: &Path| {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        (folder.canonicalize().unwrap_or_else(|_| folder.to_owned()), path.file_name().map(ToOwned::to_owned))
    };
    place(one) == place(other)
}

/// The channel map of the options for a log of a car; a map without the radius of the wheels takes that of the car.
fn channel_map_of_car(options: &Mapping, wheel_radius_m: f64) -> Result<ChannelMap, Failure> {
    let mut map = channel_map(options)?;
    map.gearbox.wheel_radius_m.get_or_insert(wheel_radius_m);
    Ok(map)
}

/// This map, or where it maps nothing that of a table with the column names of the program.
fn or_own_names(map: ChannelMap, log: &Log) -> Result<ChannelMap, Failure> {
    let has = |name: &str| log.channels().iter().any(|channel| channel.name == name);
    if !map.channels.is_empty() || !has(signal::TURBINE_SPEED) || !has(signal::OUTPUT_SPEED) {
        return Ok(map);
    }
    let suggested = logs::suggest(log.channels(), &[], None);
    let own = ChannelMap::of_text(Path::new("the map of the column names"), &suggested)?;
    Ok(ChannelMap { channels: own.channels, ..map })
}

/// The channel map of the options.
fn channel_map(options: &Mapping) -> Result<ChannelMap, Failure> {
    let mut map = match options.map.as_deref() {
        Some(path) => ChannelMap::read(path).map_err(|error| match Source::read(path).and_then(|source| source.kind()) {
            Ok(kind) if kind != Kind::ChannelMap => Failure::Input(format!(
                "{}: this looks like {}, expected a channel map\nhint: `wetclutch inspect LOG --suggest` writes a first one",
                path.shown(),
                kind.words()
            )),
            _ => error.into(),
        })?,
        None => ChannelMap::default(),
    };
    for channel in &options.channel {
        map.set(channel)?;
    }
    if options.dbc.is_some() {
        map.open.dbc.clone_from(&options.dbc);
    } else if let (Some(path), Some(dbc)) = (&options.map, map.open.dbc.as_ref().filter(|dbc| !dbc.exists())) {
        return Err(Failure::Input(format!(
            "{}: `dbc` names {}, which does not exist\nhint: a path in a map counts from the folder of the map; --dbc replaces it",
            path.shown(),
            dbc.shown()
        )));
    }
    Ok(map)
}

/// Refuses an output that cannot be written, before the work starts.
fn check_output(path: Option<&PathBuf>) -> Result<(), Failure> {
    let Some(path) = path else { return Ok(()) };
    trace::check_writable(path).map_err(|error| Failure::writing(path, &error))
}

/// A bar on standard error with rate and time left; nothing if standard error is not a terminal.
fn progress(length: u64, done: u64) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(length), output::progress_target());
    // The template is a constant.
    if let Ok(style) = ProgressStyle::with_template("{bar:32} {pos}/{len} runs  {per_sec}  {eta} left") {
        bar.set_style(style);
    }
    bar.set_position(done);
    bar.reset_eta();
    bar
}

/// From which time on the times of a log are shown, s: times of a clock since 1970 from the first one on.
pub(crate) fn shown_from_s(first_s: f64) -> f64 {
    const LONGEST_S: f64 = 1e7;
    if first_s.abs() > LONGEST_S { first_s.floor() } else { 0.0 }
}
