//! Columns of text that hold numbers, such as the gear of a table whose gears also have letters.

use std::fs::File;
use std::panic::{AssertUnwindSafe, catch_unwind};

use parquet::basic::{ConvertedType, LogicalType, Type as Physical};
use parquet::column::reader::{ColumnReader, get_column_reader};
use parquet::file::reader::{FileReader, SerializedFileReader};
use trace::csv_file;

use super::pages::CheckedPages;
use super::{not_built_in, records};
use crate::gear_letters::number_of_letter;

/// Texts that tell whether a column holds numbers: the first that are not empty, of so many rows.
const FIRST: usize = 256;
const ROWS: usize = 1 << 16;

/// Whether most of the first texts of a column are numbers.
pub(super) fn holds_numbers(reader: &SerializedFileReader<File>, column: usize) -> bool {
    // See `next_batch` of the table: the decoder may panic on a damaged page.
    catch_unwind(AssertUnwindSafe(|| first_texts(reader, column)))
        .ok()
        .flatten()
        .is_some_and(|(numbers, texts)| texts > 0 && 2 * numbers > texts)
}

/// How many of the first texts of a column are numbers, and how many there are; none if it holds no texts.
fn first_texts(reader: &SerializedFileReader<File>, column: usize) -> Option<(usize, usize)> {
    let leaf = reader.metadata().file_metadata().schema_descr().column(column);
    let is_text = leaf.converted_type() == ConvertedType::UTF8 || leaf.logical_type_ref() == Some(&LogicalType::String);
    if leaf.physical_type() != Physical::BYTE_ARRAY || leaf.max_rep_level() > 0 || !is_text {
        return None;
    }
    let (mut numbers, mut texts, mut rows) = (0, 0, 0);
    for group in 0..reader.num_row_groups() {
        let group = reader.get_row_group(group).ok()?;
        if not_built_in(group.metadata().column(column).compression()).is_some() {
            return None;
        }
        let pages = CheckedPages::new(group.get_column_page_reader(column).ok()?, leaf.clone());
        let ColumnReader::ByteArrayColumnReader(mut values) = get_column_reader(leaf.clone(), Box::new(pages)) else {
            return None;
        };
        loop {
            let (mut levels, mut some) = (Vec::new(), Vec::new());
            let read = records(&mut values, FIRST, &mut levels, &mut some).ok()?;
            if read == 0 {
                break;
            }
            rows += read;
            // Letters of gears say nothing: a log may begin in park.
            let others = some.iter().map(|text| text.data()).filter(|text| number_of_letter(text).is_none());
            for number in others.map(number_of).filter(|number| !number.is_nan()) {
                texts += 1;
                numbers += usize::from(number.is_finite());
            }
            if texts >= FIRST || rows >= ROWS {
                return Some((numbers, texts));
            }
        }
    }
    Some((numbers, texts))
}

/// The number in a text: NaN where it is empty, which is no value, that of the letter of a gear, which is a number as others, and infinite where it
/// holds something else, which is missing.
pub(super) fn number_of(text: &[u8]) -> f64 {
    csv_file::number(text).or_else(|| number_of_letter(text)).unwrap_or(f64::INFINITY)
}
