//! The dialect of a comma-separated file: delimiter, decimal comma and the row of names, told from the first lines.

use std::borrow::Cow;
use std::path::Path;

use trace::Unit;

use crate::csv_log::{has_groups, split_unit};
use crate::time_column::is_time_name;
use crate::{LogError, error};

/// Rows of titles at most: names, units, descriptions and types.
const TITLES: usize = 4;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Dialect {
    pub(crate) delimiter: u8,
    pub(crate) decimal_comma: bool,
    /// Lines before the row of names.
    pub(crate) preamble: usize,
    /// Lines with something in them between the names and the first row: units, descriptions, marks of sections.
    pub(crate) between: usize,
    /// Which of them has the units.
    pub(crate) units: Option<usize>,
    /// Line of the first row.
    pub(crate) first: usize,
}

/// The first lines, divided by one delimiter.
struct Table<'a> {
    delimiter: u8,
    decimal_comma: bool,
    rows: Vec<Vec<Cow<'a, str>>>,
    /// The first row of numbers.
    first: usize,
    /// How many numbers there are from it on.
    numbers: usize,
}

impl Dialect {
    /// Tells the dialect from the first lines.
    pub(crate) fn of(path: &Path, head: &str) -> Result<Self, LogError> {
        let mut lines: Vec<&str> = head.lines().collect();
        // The head may end within a line.
        if !head.ends_with('\n') && lines.len() > 1 {
            lines.pop();
        }
        // Of the delimiters that divide lines into numbers, the one with the most numbers; a comma may be decimal.
        let tables = [b'\t', b';', b'|', b','].into_iter().filter_map(|delimiter| Table::of(&lines, delimiter));
        match tables.max_by_key(|table| (table.numbers, table.delimiter != b',')) {
            Some(table) => {
                table.check_decimals(path)?;
                table.dialect(path, &lines)
            }
            None => Err(LogError::file(path, no_table(head, &lines))),
        }
    }
}

impl<'a> Table<'a> {
    /// None where the delimiter makes no rows of numbers.
    fn of(lines: &[&'a str], delimiter: u8) -> Option<Self> {
        let rows: Vec<Vec<Cow<str>>> = lines.iter().map(|line| cells(line, delimiter)).collect();
        let has_comma = |row: &Vec<Cow<str>>| {
            row.iter().any(|cell| has_decimal(cell, b',')) && !row.iter().any(|cell| has_decimal(cell, b'.'))
        };
        let decimal_comma = delimiter != b',' && rows.iter().any(has_comma);
        let numbers = |row: &Vec<Cow<str>>| row.iter().filter(|cell| is_number(cell, decimal_comma)).count();
        let filled = |row: &Vec<Cow<str>>| row.iter().filter(|cell| !cell.is_empty()).count();
        let is_data = |row: &Vec<Cow<str>>| {
            let are_most = 2 * numbers(row) >= filled(row) || !is_units(row);
            row.len() >= 2 && numbers(row) >= 1 && are_most && !has_time_name(row)
        };
        // Numbers of channels may stand above their names.
        let is_above_names = |at: usize| {
            let next = rows[at + 1..].iter().find(|row| filled(row) > 0);
            let is_text = |row: &&Vec<Cow<str>>| filled(row) == row.len() && numbers(row) == 0 && !is_units(row);
            next.filter(is_text).is_some_and(|row| row.len() == rows[at].len())
        };
        let is_first =
            |at: &usize| is_data(&rows[*at]) && rows_after_agree(&rows, rows[*at].len()) && !is_above_names(*at);
        let first = (0..rows.len()).find(is_first)?;
        // Numbers with either sign tell the delimiter, also those that are then refused.
        let is_of_either = |cell: &&Cow<str>| is_number(cell, delimiter != b',') || has_groups(cell);
        let of_either = |row: &Vec<Cow<str>>| row.iter().filter(is_of_either).count();
        let count = rows[first..].iter().map(of_either).sum();
        // One in the lines before says nothing of the numbers.
        let decimal_comma = decimal_comma && rows[first..].iter().any(has_comma);
        Some(Self { delimiter, decimal_comma, rows, first, numbers: count })
    }

    /// Where some commas are decimal, a point is not: one of them stands between thousands, or the file is of two kinds.
    fn check_decimals(&self, path: &Path) -> Result<(), LogError> {
        let first = |sign: u8| {
            let rows = self.rows.iter().enumerate().skip(self.first);
            rows.flat_map(|(line, row)| row.iter().map(move |cell| (line, cell)))
                .find(|(_, cell)| has_decimal(cell, sign))
        };
        match (first(b','), first(b'.').filter(|_| self.decimal_comma)) {
            (Some((with_comma, comma)), Some((with_point, point))) => Err(LogError::damaged(
                path,
                format!("line {}", with_comma.max(with_point) + 1),
                format!(
                    "some numbers have a comma (`{}`) and some a point (`{}`)\nhint: write all with one decimal sign, and without a sign between thousands",
                    error::shown(comma),
                    error::shown(point)
                ),
            )),
            _ => Ok(()),
        }
    }

    /// Finds names and units above the first row of numbers.
    fn dialect(&self, path: &Path, lines: &[&str]) -> Result<Dialect, LogError> {
        let Self { delimiter, decimal_comma, first, .. } = *self;
        let names = |row: &[Cow<str>]| {
            let has_number = || row.iter().any(|cell| is_number(cell, decimal_comma));
            row.len() >= 2 && row.iter().any(|cell| !cell.is_empty()) && (has_time_name(row) || !has_number())
        };
        let is_mark = |i: usize| self.rows[i].len() == 1 && lines[i].starts_with('[') && !lines[i].contains('"');
        let is_filled = |i: &usize| !lines[*i].trim().is_empty();
        let filled: Vec<usize> = (0..first).rev().filter(is_filled).filter(|&i| !is_mark(i)).collect();
        if let Some(&open) = filled.iter().take(TITLES).find(|&&i| lines[i].matches('"').count() % 2 == 1) {
            return Err(LogError::damaged(
                path,
                format!("line {}", open + 1),
                "a quotation mark among the names or units is not closed in its line\nhint: write names and units without line breaks",
            ));
        }
        let near = &filled[..filled.len().min(TITLES)];
        let has_names = |at: &&usize| names(&self.rows[**at]);
        // Descriptions and types may stand between the names and the numbers: the name of the time tells the names from them.
        let has_time = |at: &&usize| self.rows[**at].len() == self.rows[first].len() && has_time_name(&self.rows[**at]);
        let units = near.iter().find(|at| is_units(&self.rows[**at]));
        let below_names = match near {
            [units, names_at, ..] if is_units(&self.rows[*units]) => Some(names_at).filter(has_names),
            _ => None,
        };
        let nearest = near.first().filter(has_names);
        // A description of the time may begin with its name, too, and stands below the names.
        match near.iter().rev().find(has_time).or(below_names).or(nearest) {
            Some(&preamble) => {
                let between: Vec<usize> = (preamble + 1..first).filter(is_filled).collect();
                let units = units.and_then(|units| between.iter().position(|at| at == units));
                Ok(Dialect { delimiter, decimal_comma, preamble, between: between.len(), units, first })
            }
            None => Err(LogError::damaged(
                path,
                format!("line {}", first + 1),
                "there is no row of names above the first row of numbers\nhint: add one, with a time and a unit for each column; no name may be a number, such as `1` or `Inf`",
            )),
        }
    }
}

/// What is said of a file without rows of numbers.
fn no_table(head: &str, lines: &[&str]) -> String {
    if lines.iter().filter(|line| !line.trim().is_empty()).count() == 1 && !head.contains('\0') {
        let has_returns = head.trim_end().contains('\r');
        let why = if has_returns {
            "its lines end with a carriage return alone\nhint: save it with line feeds"
        } else {
            "there are no rows\nhint: check that the recorder has written samples"
        };
        return why.to_owned();
    }
    // A comma in a cell between commas was in quotation marks.
    let quoted = lines.iter().flat_map(|line| cells(line, b',')).find(|cell| has_decimal(cell, b','));
    quoted.map_or(
        "this is no format that is known\nhint: logs are CSV (with a row of names and at least two columns, `,` `;` `|` or a tab between them), Parquet, MDF 4, candump, ASC, BLF, PCAN or SavvyCAN".to_owned(),
        |cell| format!("numbers have commas, and commas separate the columns; the first is `{}`\nhint: write them with decimal points, or `;` between the columns", error::shown(&cell)),
    )
}

/// The cells of a line; quotation marks are respected.
pub(crate) fn cells(line: &str, delimiter: u8) -> Vec<Cow<'_, str>> {
    let mut quoted = false;
    let ends_cell = |c: char| {
        quoted ^= c == '"';
        c == char::from(delimiter) && !quoted
    };
    let without_marks = |cell: &str| Cow::Owned(cell.replace('"', "").trim().to_owned());
    let plain = |cell| if str::contains(cell, '"') { without_marks(cell) } else { Cow::Borrowed(cell.trim()) };
    line.split(ends_cell).map(plain).collect()
}

fn is_number(cell: &str, decimal_comma: bool) -> bool {
    let plain = if decimal_comma { cell.replacen(',', ".", 1) } else { cell.to_owned() };
    plain.parse::<f64>().is_ok()
}

/// Whether a cell is a number with this decimal sign.
fn has_decimal(cell: &str, sign: u8) -> bool {
    cell.bytes().filter(|byte| *byte == sign).count() == 1 && is_number(cell, sign == b',')
}

/// Whether a row has the name of a time: then it is the row of names, whatever else stands in it. A single letter may be a value.
fn has_time_name(row: &[Cow<str>]) -> bool {
    row.iter().any(|cell| cell.len() > 1 && is_time_name(&split_unit(cell).0))
}

/// Whether the cells are units, or most of them.
fn is_units(row: &[Cow<str>]) -> bool {
    let filled: Vec<&Cow<str>> = row.iter().filter(|cell| !cell.is_empty()).collect();
    let bracketed = |cell: &str| cell.starts_with('[') || cell.starts_with('(');
    let units = filled.iter().filter(|cell| bracketed(cell) || Unit::parse(cell).is_some()).count();
    !filled.is_empty() && 2 * units >= filled.len()
}

/// Whether most of the rows have this many cells.
fn rows_after_agree(rows: &[Vec<Cow<str>>], width: usize) -> bool {
    let filled = rows.iter().filter(|row| row.len() > 1 || row.iter().any(|cell| !cell.is_empty()));
    let (same, all) = filled.fold((0, 0), |(same, all), row| (same + usize::from(row.len() == width), all + 1));
    3 * same >= all
}
