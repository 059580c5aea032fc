//! Where estimates are written.

use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use observer::{ChannelHealth, Channels, Estimate, Health, Phase};
use study::{EstimateColumns, OutputColumn};
use trace::{Cell, ColumnKind, CsvWriter, ShownPath as _, TableFormat, TableWriter};

use crate::args::{self, FormatChoice};
use crate::failure::Failure;

/// The columns of these names, or all.
pub(super) fn chosen(columns: EstimateColumns, names: &[String]) -> Result<Vec<OutputColumn>, Failure> {
    let all = columns.columns();
    if names.is_empty() {
        return Ok(all);
    }
    let mut chosen: Vec<OutputColumn> = Vec::new();
    for name in names.iter().map(|name| name.trim()).filter(|name| *name != trace::signal::TIME) {
        let Some(column) = all.iter().find(|column| column.name == name) else {
            let known: Vec<&str> = all.iter().map(|column| column.name).collect();
            return Err(Failure::Input(format!(
                "--columns: there is no column `{}` with this observer\nhint: the columns are {}; time_s is always there",
                name.escape_debug(),
                known.join(", ")
            )));
        };
        if chosen.iter().any(|earlier| earlier.name == name) {
            return Err(Failure::Input(format!("--columns: `{name}` is there twice\nhint: name each column once")));
        }
        chosen.push(*column);
    }
    Ok(chosen)
}

/// Endings of names whose files are CSV.
const TEXT: [&str; 4] = ["csv", "txt", "tsv", "dat"];

/// Refuses an output whose name asks for what is not written.
pub(super) fn check_name(options: &args::Estimate) -> Result<(), Failure> {
    let Some(output) = &options.output else {
        return match options.format {
            None | Some(FormatChoice::Csv) => Ok(()),
            Some(format) => {
                let ending = format.ending();
                let message =
                    format!("--format {ending} needs a file\nhint: name one with -o, such as estimate.{ending}");
                Err(Failure::Input(message))
            }
        };
    };
    if output == Path::new("-") {
        let message = "-o -: standard output is where an estimate goes without -o\nhint: leave -o out";
        return Err(Failure::Input(message.to_owned()));
    }
    // A folder gets files with the ending of their format; a device or pipe has no name of its own.
    if options.logs.len() > 1 || std::fs::metadata(output).is_ok_and(|there| !there.is_file()) {
        return Ok(());
    }
    let ending = output.extension().map(|ending| ending.to_string_lossy().to_lowercase());
    let by_name = TableFormat::of(output);
    if let Some(ending) = ending.filter(|ending| by_name == TableFormat::Csv && !TEXT.contains(&ending.as_str())) {
        return Err(Failure::Input(format!(
            "{}: no table is written as .{}\nhint: estimates are CSV (.csv), Parquet (.parquet) or MDF (.mf4)",
            output.shown(),
            ending.escape_debug()
        )));
    }
    match options.format {
        Some(format) if TableFormat::from(format) != by_name => Err(Failure::Input(format!(
            "{}: the name is not that of a file in --format {}\nhint: the ending says the format; leave --format out, or end the name in .{1}",
            output.shown(),
            format.ending()
        ))),
        _ => Ok(()),
    }
}

/// The table of the estimates.
pub(super) enum Output {
    File(TableWriter, PathBuf),
    Standard(Box<CsvWriter<BufWriter<io::Stdout>>>),
}

impl Output {
    /// Begins a file with these columns, or the table on standard output.
    pub(super) fn named<'a>(
        path: Option<&Path>,
        named: impl Iterator<Item = (&'a str, ColumnKind)>,
    ) -> Result<Self, Failure> {
        match path {
            Some(path) => {
                let writer = TableWriter::create(path, named).map_err(|error| Failure::writing(path, &error))?;
                Ok(Self::File(writer, path.to_owned()))
            }
            None => {
                let names = named.map(|(name, _)| name);
                Ok(Self::Standard(Box::new(CsvWriter::new(BufWriter::new(io::stdout()), names)?)))
            }
        }
    }

    pub(super) fn cells<'a>(&mut self, time_s: f64, cells: impl IntoIterator<Item = Cell<'a>>) -> Result<(), Failure> {
        match self {
            Self::File(writer, path) => writer.row(time_s, cells).map_err(|error| Failure::writing(path, &error)),
            Self::Standard(writer) => Ok(writer.row(time_s, cells)?),
        }
    }

    /// Writes a row of numbers, and behind them the words of the row before.
    fn numbers(&mut self, time_s: f64, numbers: &[f64]) -> Result<(), Failure> {
        match self {
            Self::File(writer, path) => writer.numbers(time_s, numbers).map_err(|error| Failure::writing(path, &error)),
            Self::Standard(writer) => Ok(writer.numbers(time_s, numbers)?),
        }
    }

    /// Hands the rows so far to their reader.
    pub(super) fn flush(&mut self) -> Result<(), Failure> {
        match self {
            Self::File(writer, path) => writer.flush().map_err(|error| Failure::writing(path, &error)),
            Self::Standard(writer) => Ok(writer.flush()?),
        }
    }

    /// Completes the table.
    pub(super) fn finish(self) -> Result<(), Failure> {
        match self {
            Self::File(writer, path) => writer.finish().map_err(|error| Failure::writing(&path, &error)),
            Self::Standard(writer) => Ok(writer.finish()?.flush()?),
        }
    }
}

/// The table of the estimates of one observer.
pub(super) struct EstimateTable {
    output: Output,
    columns: Vec<OutputColumn>,
    /// Whether all columns of numbers stand before all columns of words, of which there are some.
    is_in_order: bool,
    /// The numbers of a row.
    numbers: Vec<f64>,
    /// What the words of the row before say: they are mostly the same.
    said: Option<(Phase, Health, Channels<ChannelHealth>)>,
}

impl EstimateTable {
    /// Begins a file, or the table on standard output.
    pub(super) fn create(path: Option<&Path>, columns: Vec<OutputColumn>) -> Result<Self, Failure> {
        let output = Output::named(path, columns.iter().map(|column| (column.name, column.kind())))?;
        let is_word = |column: &OutputColumn| column.kind() == ColumnKind::Word;
        let is_in_order = columns.is_sorted_by_key(is_word) && columns.last().is_some_and(is_word);
        Ok(Self { output, columns, is_in_order, numbers: Vec::new(), said: None })
    }

    pub(super) fn row(&mut self, time_s: f64, estimate: &Estimate<f64>) -> Result<(), Failure> {
        let says = Some((estimate.phase, estimate.health, estimate.channels));
        let is_same = std::mem::replace(&mut self.said, says) == says;
        if is_same && self.is_in_order {
            self.numbers.clear();
            self.numbers.extend(self.columns.iter().map_while(|column| column.number(estimate)));
            return self.output.numbers(time_s, &self.numbers);
        }
        let cells = self.columns.iter().map(|column| match column.kind() {
            ColumnKind::Word if is_same => Cell::SameWord,
            _ => column.cell(estimate),
        });
        self.output.cells(time_s, cells)
    }

    /// A row without an estimate.
    pub(super) fn empty_row(&mut self, time_s: f64) -> Result<(), Failure> {
        self.said = None;
        let cells = self.columns.iter().map(|column| match column.kind() {
            ColumnKind::Word => Cell::Word(""),
            ColumnKind::Number | ColumnKind::Whole => Cell::Number(f64::NAN),
        });
        self.output.cells(time_s, cells)
    }

    /// Hands the rows so far to their reader.
    pub(super) fn flush(&mut self) -> Result<(), Failure> {
        self.output.flush()
    }

    /// Completes the table.
    pub(super) fn finish(self) -> Result<(), Failure> {
        self.output.finish()
    }
}

/// The files beside an output: the shifts as CSV and JSON, and the page. `drive.csv` has `drive_report.html`. None beside a
/// device or pipe.
pub(super) fn beside(output: &Path) -> Option<[PathBuf; 3]> {
    if std::fs::metadata(output).is_ok_and(|there| !there.is_file()) {
        return None;
    }
    let stem = output.file_stem()?;
    Some(["_shifts.csv", "_shifts.json", "_report.html"].map(|ending| {
        let mut name = stem.to_owned();
        name.push(ending);
        output.with_file_name(name)
    }))
}

/// Removes the files beside an output that an earlier estimate left: they are not of this one, which has no shift.
pub(super) fn remove_old(places: &[PathBuf; 3], mut note: impl FnMut(&str)) -> Result<(), Failure> {
    for old in places.iter().filter(|old| old.is_file()) {
        std::fs::remove_file(old).map_err(|error| Failure::writing(old, &error))?;
        note(&format!("removed: {}, of an earlier estimate", old.shown()));
    }
    Ok(())
}
