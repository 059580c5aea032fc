//! A table with a time for each signal is refused.

use std::borrow::Cow;
use std::fs::File;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use parquet::column::reader::get_column_reader;
use parquet::file::reader::{FileReader, SerializedFileReader};

use super::pages::CheckedPages;
use super::{Form, not_built_in, numbers};
use crate::LogError;
use crate::time_column::{may_be_time, one_clock};

/// Rows that are compared, of the first row group.
const ROWS: usize = 64;

/// Refuses a table of which another column is a time with other values. `time` is the column of the time with the size of its unit in s.
pub(super) fn check(
    path: &Path,
    reader: &SerializedFileReader<File>,
    names: &[(String, String)],
    time: (usize, f64),
) -> Result<(), LogError> {
    let others = (0..names.len()).filter(|&other| may_be_time(names, time.0, other).is_some());
    // What cannot be decoded is an error when the table is read. The decoder may panic on a damaged page.
    let decoded = |column: usize| catch_unwind(AssertUnwindSafe(|| first_numbers(reader, column))).ok().flatten();
    let times: Vec<(usize, Vec<f64>)> = others.filter_map(|other| Some((other, decoded(other)?))).collect();
    let Some(own) = decoded(time.0).filter(|_| !times.is_empty()) else { return Ok(()) };
    // Of a column without numbers nothing is known.
    let is_known = |column: usize| column == time.0 || times.iter().any(|(other, _)| *other == column);
    let known =
        |(column, name): (usize, &(String, String))| if is_known(column) { name.clone() } else { Default::default() };
    let names: Vec<(String, String)> = names.iter().enumerate().map(known).collect();
    let cell = |column: usize, row: usize| {
        let values = if column == time.0 { Some(&own) } else { times.iter().find(|of| of.0 == column).map(|of| &of.1) };
        let value = values.and_then(|values| values.get(row)).filter(|value| value.is_finite());
        value.map_or(Cow::Borrowed(""), |value| Cow::Owned(value.to_string()))
    };
    let rows = (0..own.len()).map(|row| (row, (0..names.len()).map(|column| cell(column, row)).collect()));
    one_clock(path, &names, time, "row", rows)
}

/// The first numbers of a column, NaN where it has none; none if it holds no numbers.
fn first_numbers(reader: &SerializedFileReader<File>, column: usize) -> Option<Vec<f64>> {
    let leaf = reader.metadata().file_metadata().schema_descr().column(column);
    let form = Form::of(&leaf)?;
    let group = reader.get_row_group(0).ok()?;
    if not_built_in(group.metadata().column(column).compression()).is_some() {
        return None;
    }
    let pages = CheckedPages::new(group.get_column_page_reader(column).ok()?, leaf.clone());
    let mut values = Vec::new();
    numbers(&mut get_column_reader(leaf, Box::new(pages)), form, ROWS, &mut values).ok()?;
    Some(values)
}
