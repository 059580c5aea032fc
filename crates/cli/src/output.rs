//! What is printed: results and tables on standard output, and which messages are shown.
//!
//! Names of files, and names in files, are other people's. Whatever is written here for people has no character that controls a
//! terminal: see [`printable_lines`]. JSON and TOML have escapes of their own.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::Instant;

use indicatif::ProgressDrawTarget;
use serde::Serialize;
use serde_json::ser::{Formatter, PrettyFormatter};
use trace::{FileUse, ShownPath as _, is_unprintable, printable, shown_units};

use crate::failure::Failure;
pub(crate) use crate::message::{error, say};

/// Whether messages are errors and warnings alone.
static IS_QUIET: AtomicBool = AtomicBool::new(false);

/// Shows errors and warnings alone from now on.
pub(crate) fn be_quiet() {
    IS_QUIET.store(true, Ordering::Relaxed);
}

/// When the program began, if it says what it does.
static SINCE: OnceLock<Instant> = OnceLock::new();
/// The files that it has named.
static NAMED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// Says from now on what is done and assumed, each with the time since the start.
pub(crate) fn be_verbose() {
    SINCE.get_or_init(Instant::now);
    trace::watch_files(|how, path| match how {
        // A file may be read more than once: for its kind, and for its values.
        FileUse::Read => {
            if NAMED.lock().unwrap_or_else(PoisonError::into_inner).insert(path.to_owned()) {
                detail(|| format!("read {}", path.shown()));
            }
        }
        FileUse::Written => detail(|| format!("wrote {}", path.shown())),
    });
}

/// A message about what is done or assumed, for those who ask for it.
pub(crate) fn detail(message: impl FnOnce() -> String) {
    if let Some(since) = SINCE.get() {
        say(&format!("{:.3} s: {}", since.elapsed().as_secs_f64(), message()));
    }
}

/// Whether a message is shown: each, or only a warning.
pub(crate) fn is_shown(message: &str) -> bool {
    !IS_QUIET.load(Ordering::Relaxed) || message.starts_with("warning: ")
}

/// Where progress is shown.
pub(crate) fn progress_target() -> ProgressDrawTarget {
    if IS_QUIET.load(Ordering::Relaxed) { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() }
}

/// A message on standard error, if it is shown.
pub(crate) fn note(message: &str) {
    if is_shown(message) {
        say(message);
    }
}

/// A text whose characters are all printed, those that are not escaped. Only its own line breaks stay.
pub(crate) fn printable_lines(text: &str) -> Cow<'_, str> {
    if !text.chars().any(|c| c != '\n' && is_unprintable(c)) {
        return Cow::Borrowed(text);
    }
    Cow::Owned(text.split('\n').map(printable).collect::<Vec<_>>().join("\n"))
}

/// A table on standard output: the first `left` columns to the left, the others to the right. A column whose title says a unit is
/// shown in the one that the user wants.
pub(crate) fn table(left: usize, mut titles: Vec<String>, mut rows: Vec<Vec<String>>) -> io::Result<()> {
    shown_units::convert_table(&mut titles, &mut rows);
    rows.insert(0, titles);
    list(left, &rows)
}

/// A table without titles.
pub(crate) fn list(left: usize, rows: &[Vec<String>]) -> io::Result<()> {
    long_table(left, || rows.iter().cloned())
}

/// The same, of rows that may be very many: each is made twice, and none is kept.
pub(crate) fn long_table<R: Iterator<Item = Vec<String>>>(left: usize, rows: impl Fn() -> R) -> io::Result<()> {
    let rows = || rows().map(printable_cells);
    let mut widths = Vec::new();
    for row in rows() {
        widths.resize(row.len().max(widths.len()), 0);
        widths.iter_mut().zip(row).for_each(|(width, cell)| *width = cell.chars().count().max(*width));
    }
    rows().try_for_each(|row| self::line(&line_of(left, &row, &widths)))
}

/// The cells of a row, each on one line.
fn printable_cells(row: Vec<String>) -> Vec<String> {
    row.into_iter().map(|cell| if let Cow::Owned(escaped) = printable(&cell) { escaped } else { cell }).collect()
}

/// The lines of a table, as [`table`] has them, with its titles. A title that is wider than the cells of its
/// column takes several lines; what is wider than the terminal follows below, with the first columns once more.
pub(crate) fn titled_lines(left: usize, titles: &[String], rows: &[Vec<String>]) -> Vec<String> {
    let terminal = console::Term::stdout();
    let width = terminal.size_checked().filter(|_| terminal.is_term()).map(|(_, columns)| usize::from(columns));
    fitted_lines(left, titles, rows, width.unwrap_or(usize::MAX))
}

/// The same in lines of this width, as far as the first columns and one more are no wider.
fn fitted_lines(left: usize, titles: &[String], rows: &[Vec<String>], width: usize) -> Vec<String> {
    /// Columns that say which row it is.
    const KEYS: usize = 2;
    let (mut titles, mut rows) = (titles.to_vec(), rows.to_vec());
    shown_units::convert_table(&mut titles, &mut rows);
    let rows: Vec<Vec<String>> = rows.into_iter().map(printable_cells).collect();
    let widths = widths_of(&titles, &rows);
    let keys: Vec<usize> = (0..left.min(KEYS)).collect();
    let length =
        |columns: &[usize]| columns.iter().map(|&column| widths[column] + GAP.len()).sum::<usize>() - GAP.len();
    let (mut blocks, mut block) = (Vec::new(), Vec::new());
    for column in 0..titles.len() {
        block.push(column);
        if length(&block) > width && block.len() > keys.len() + 1 {
            block.pop();
            blocks.push(std::mem::replace(&mut block, [&keys[..], &[column]].concat()));
        }
    }
    blocks.push(block);
    let of_block = |columns: &Vec<usize>| {
        let own =
            |cells: &[String]| -> Vec<String> { columns.iter().filter_map(|&at| cells.get(at).cloned()).collect() };
        let rows: Vec<Vec<String>> = rows.iter().map(|row| own(row)).collect();
        block_lines(columns.iter().filter(|&&column| column < left).count(), &own(&titles), &rows)
    };
    blocks.iter().map(of_block).collect::<Vec<_>>().join(&String::new())
}

/// The widths of the columns: those of their cells, and of the longest words of their titles.
fn widths_of(titles: &[String], rows: &[Vec<String>]) -> Vec<usize> {
    let length = |text: &str| text.chars().count();
    let widest = |j: usize| rows.iter().filter_map(|row| row.get(j)).map(|cell| length(cell)).max().unwrap_or(0);
    let word = |title: &str| words(title).map(|word| length(&word)).max().unwrap_or(0);
    titles.iter().enumerate().map(|(j, title)| widest(j).max(word(title))).collect()
}

/// The lines of columns that stand side by side.
fn block_lines(left: usize, titles: &[String], rows: &[Vec<String>]) -> Vec<String> {
    let widths = widths_of(titles, rows);
    let titles: Vec<Vec<String>> = titles.iter().zip(&widths).map(|(title, &width)| wrapped(title, width)).collect();
    let height = titles.iter().map(Vec::len).max().unwrap_or(0);
    // The last lines of all titles stand on one line.
    let title_line = |at: usize| {
        let of =
            |title: &Vec<String>| (at + title.len()).checked_sub(height).map_or(String::new(), |at| title[at].clone());
        titles.iter().map(of).collect::<Vec<_>>()
    };
    let titles: Vec<Vec<String>> = (0..height).map(title_line).collect();
    titles.iter().chain(rows).map(|row| line_of(left, row, &widths)).collect()
}

/// A text in lines of at most this width, as far as its words are no wider. The two words of a unit stay together.
fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in words(text) {
        match lines.last_mut().filter(|line| line.chars().count() + 1 + word.chars().count() <= width) {
            Some(line) => *line = format!("{line} {word}"),
            None => lines.push(word),
        }
    }
    lines
}

/// The words of a title; `N m` is one.
fn words(title: &str) -> impl Iterator<Item = String> {
    const JOINED: char = '\u{a0}';
    let joined = title.replace("N m", &format!("N{JOINED}m"));
    joined.split(' ').map(|word| word.replace(JOINED, " ")).collect::<Vec<_>>().into_iter()
}

/// What stands between two columns.
const GAP: &str = "  ";

/// A line of a table with columns of these widths.
fn line_of(left: usize, row: &[String], widths: &[usize]) -> String {
    let cells = row.iter().zip(widths).enumerate().map(|(j, (cell, &width))| match j < left {
        true => format!("{cell:<width$}"),
        false => format!("{cell:>width$}"),
    });
    cells.collect::<Vec<_>>().join(GAP).trim_end().to_owned()
}

/// A line on standard output. A reader that has closed it, such as `head`, misses the rest: that is no error, and the files of the
/// command are still written.
pub(crate) fn line(text: &str) -> io::Result<()> {
    raw_line(&printable_lines(text))
}

/// A text in TOML on standard output.
pub(crate) fn toml(text: &str) -> io::Result<()> {
    raw_line(text)
}

/// Version of the JSON on standard output: it rises when a key goes or gets another meaning, and not with a new key.
const JSON_VERSION: u32 = 1;

/// A result with the version of its keys.
#[derive(Serialize)]
struct Versioned<'a, R> {
    json_version: u32,
    #[serde(flatten)]
    result: &'a R,
}

impl<'a, R> Versioned<'a, R> {
    fn of(result: &'a R) -> Self {
        Self { json_version: JSON_VERSION, result }
    }
}

/// A result in JSON on standard output: an object, with the version of its keys.
pub(crate) fn json(result: &impl Serialize) -> Result<(), Failure> {
    Ok(raw_line(&escaped_json(&pretty_json(&Versioned::of(result))?))?)
}

/// The same with all digits of each number, as gains and certificates need them.
pub(crate) fn exact_json(result: &impl Serialize) -> Result<(), Failure> {
    Ok(raw_line(&escaped_json(&serde_json::to_string_pretty(&Versioned::of(result))?))?)
}

/// JSON with a line for each value, and numbers as people write them: 0.89, not 0.8900000000000001.
pub(crate) fn pretty_json(result: &impl Serialize) -> Result<String, serde_json::Error> {
    let mut json = Vec::new();
    result.serialize(&mut serde_json::Serializer::with_formatter(&mut json, Pretty::new()))?;
    Ok(String::from_utf8_lossy(&json).into_owned())
}

/// As the pretty format, with numbers as people write them.
pub(crate) struct Pretty(PrettyFormatter<'static>);

impl Pretty {
    pub(crate) fn new() -> Self {
        Self(PrettyFormatter::new())
    }
}

/// The number with few digits that the last bits of this one have missed: 0.89 of 0.8900000000000001. Other numbers stay as they are.
fn without_noise(number: f64) -> f64 {
    const FEW: usize = 8;
    let rounded = format!("{number:.13e}");
    let digits = rounded.split('e').next().unwrap_or_default().trim_end_matches('0');
    let count = digits.chars().filter(char::is_ascii_digit).count();
    if count <= FEW { rounded.parse().unwrap_or(number) } else { number }
}

impl Formatter for Pretty {
    fn write_f64<W: io::Write + ?Sized>(&mut self, writer: &mut W, value: f64) -> io::Result<()> {
        self.0.write_f64(writer, without_noise(value))
    }

    fn begin_array<W: io::Write + ?Sized>(&mut self, writer: &mut W) -> io::Result<()> {
        self.0.begin_array(writer)
    }

    fn end_array<W: io::Write + ?Sized>(&mut self, writer: &mut W) -> io::Result<()> {
        self.0.end_array(writer)
    }

    fn begin_array_value<W: io::Write + ?Sized>(&mut self, writer: &mut W, first: bool) -> io::Result<()> {
        self.0.begin_array_value(writer, first)
    }

    fn end_array_value<W: io::Write + ?Sized>(&mut self, writer: &mut W) -> io::Result<()> {
        self.0.end_array_value(writer)
    }

    fn begin_object<W: io::Write + ?Sized>(&mut self, writer: &mut W) -> io::Result<()> {
        self.0.begin_object(writer)
    }

    fn end_object<W: io::Write + ?Sized>(&mut self, writer: &mut W) -> io::Result<()> {
        self.0.end_object(writer)
    }

    fn begin_object_key<W: io::Write + ?Sized>(&mut self, writer: &mut W, first: bool) -> io::Result<()> {
        self.0.begin_object_key(writer, first)
    }

    fn begin_object_value<W: io::Write + ?Sized>(&mut self, writer: &mut W) -> io::Result<()> {
        self.0.begin_object_value(writer)
    }

    fn end_object_value<W: io::Write + ?Sized>(&mut self, writer: &mut W) -> io::Result<()> {
        self.0.end_object_value(writer)
    }
}

/// JSON without characters that are not printed: they stand in strings alone.
fn escaped_json(json: &str) -> String {
    let mut escaped = String::with_capacity(json.len());
    for c in json.chars() {
        if c == '\n' || !is_unprintable(c) {
            escaped.push(c);
            continue;
        }
        for unit in c.encode_utf16(&mut [0; 2]) {
            // A string takes everything.
            let _ = write!(escaped, "\\u{unit:04x}");
        }
    }
    escaped
}

pub(crate) fn raw_line(text: &str) -> io::Result<()> {
    match writeln!(io::stdout().lock(), "{text}") {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        written => written,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_json_are_as_people_write_them() {
        let json = pretty_json(
            &serde_json::json!({ "a": [0.890_000_000_000_000_1, 19.999999999999996, 1e300, -0.1, 5], "b": 1760000.0000000002 }),
        );
        let values = ["0.89", "20.0", "1e+300", "-0.1", "5"].map(|value| format!("    {value}")).join(",\n");
        assert_eq!(json.unwrap(), format!("{{\n  \"a\": [\n{values}\n  ],\n  \"b\": 1760000.0\n}}"));
        // What has more digits keeps all of them.
        for exact in [1.2582709347451813, 0.1 + 0.2 + 1e-9, f64::MIN_POSITIVE, 1.0 / 3.0, 123_456_789.0] {
            assert_eq!(without_noise(exact).to_bits(), exact.to_bits(), "{exact}");
        }
        assert_eq!([0.1 + 0.2, 0.40000000000000363].map(without_noise), [0.3, 0.4]);
    }

    #[test]
    fn a_title_that_is_wider_than_its_cells_takes_several_lines() {
        let cells = |cells: &[&str]| cells.iter().map(|&cell| cell.to_owned()).collect::<Vec<_>>();
        let titles = cells(&["shift", "past new gear rad/s", "torque N m"]);
        let rows = [cells(&["1-2", "0.5", "62 (23 to 102)"]), cells(&["2-1", "11.5", "1"])];
        let of_unit = titled_lines(1, &cells(&["at the turbine N m"]), &[cells(&["1"])]);
        assert_eq!(of_unit, ["at the", "turbine", "N m", "1"]);
        let expected = ["        past", "         new", "        gear", "shift  rad/s      torque N m"];
        assert_eq!(titled_lines(1, &titles, &rows)[..4], expected);
        assert_eq!(
            titled_lines(1, &titles, &rows)[4..],
            ["1-2      0.5  62 (23 to 102)", "2-1     11.5               1"]
        );
        assert_eq!(titled_lines(1, &titles, &[]).len(), 4);
        assert!(titled_lines(1, &[], &[]).is_empty());
    }

    #[test]
    fn a_table_that_is_wider_than_the_terminal_goes_on_below_with_its_first_columns() {
        let cells = |cells: &[&str]| cells.iter().map(|&cell| cell.to_owned()).collect::<Vec<_>>();
        let titles = cells(&["#", "shift", "kind", "begin s", "time s", "health"]);
        let rows = [cells(&["1", "1-2", "power-on", "8.68", "0.80", "good"])];
        let lines = |width: usize| fitted_lines(3, &titles, &rows, width);
        assert_eq!(lines(usize::MAX), titled_lines(3, &titles, &rows));
        let expected = [
            "                    begin",
            "#  shift  kind          s",
            "1  1-2    power-on   8.68",
            "",
            "          time",
            "#  shift     s  health",
            "1  1-2    0.80    good",
        ];
        assert_eq!(lines(25), expected);
        // A column that is too wide alone stands in a block of its own.
        assert!(lines(3).iter().filter(|line| line.starts_with("#  shift")).count() == 4);
    }

    #[test]
    fn no_message_or_table_has_a_character_that_controls_a_terminal() {
        let hostile = "a\u{1b}]0;x\u{7}\u{9b}2J\u{202e}\tb\nhint: c";
        assert_eq!(printable_lines(hostile), "a\\u{1b}]0;x\\u{7}\\u{9b}2J\\u{202e}\\tb\nhint: c");
        assert!(matches!(printable_lines("two lines\nof ü"), Cow::Borrowed(_)));
        let row = vec![hostile.to_owned(), "1".to_owned()];
        let escaped = "a\\u{1b}]0;x\\u{7}\\u{9b}2J\\u{202e}\\tb\\nhint: c";
        assert_eq!(printable_cells(row.clone()), [escaped, "1"]);
        let lines = titled_lines(1, &["name".to_owned(), "x".to_owned()], &[row]);
        assert_eq!(lines[1..], [format!("{escaped}  1")]);
    }

    #[test]
    fn json_without_unprintable_characters_is_the_same_value() {
        let value = serde_json::json!({ "a\u{9b}b": ["\u{1b}[2J\n", "\u{e0041}\u{202e}ü", "plain \\ \"quoted\""] });
        let text = escaped_json(&serde_json::to_string_pretty(&value).unwrap());
        assert!(!text.chars().any(|c| c != '\n' && is_unprintable(c)), "{text:?}");
        assert_eq!(serde_json::from_str::<serde_json::Value>(&text).unwrap(), value);
    }
}
