//! Tables as Parquet files.

mod words;

use std::fs::File;
use std::io::{self, Write};
use std::path::Path;
use std::sync::Arc;

use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::column::writer::ColumnWriter;
use parquet::errors::ParquetError;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::{ColumnDescPtr, ColumnPath, Type};

use crate::csv_file::number;
use crate::{Cell, ColumnKind, RecordError, Records, write_whole};
use words::Words;

/// Rows that are held in memory before they are written.
const GROUP: usize = 1 << 16;

/// Writes a Parquet file row by row; some ten thousand rows are held in memory.
pub struct ParquetWriter<W: Write + Send> {
    file: SerializedFileWriter<W>,
    columns: Vec<Values>,
    descriptions: Vec<ColumnDescPtr>,
    rows: usize,
}

/// The cells of a column that wait to be written.
enum Values {
    Whole(Vec<i64>),
    /// The numbers, and the rows without one.
    Numbers(Vec<f64>, Vec<usize>),
    Words(Words),
}

impl<W: Write + Send> ParquetWriter<W> {
    /// Begins a file with these columns.
    ///
    /// # Errors
    /// What the writer meets.
    pub fn new<'a>(writer: W, columns: impl IntoIterator<Item = (&'a str, ColumnKind)>) -> io::Result<Self> {
        let (mut fields, mut values) = (Vec::new(), Vec::new());
        // Hardly two numbers of a column are the same: a dictionary of them costs time and saves nothing. (Words make their own.)
        let mut properties =
            WriterProperties::builder().set_dictionary_enabled(false).set_statistics_enabled(EnabledStatistics::None);
        for (name, kind) in columns {
            if fields.is_empty() {
                // Readers find rows by the first column, the time or the number of the row.
                let first = ColumnPath::new(vec![name.to_owned()]);
                properties = properties.set_column_statistics_enabled(first, EnabledStatistics::Chunk);
            }
            fields.push(field(name, kind).map_err(of_writer)?);
            values.push(match kind {
                ColumnKind::Whole => Values::Whole(Vec::new()),
                ColumnKind::Number => Values::Numbers(Vec::new(), Vec::new()),
                ColumnKind::Word => Values::Words(Words::default()),
            });
        }
        let schema = Type::group_type_builder("rows").with_fields(fields).build().map_err(of_writer)?;
        let properties = Arc::new(properties.build());
        let file = SerializedFileWriter::new(writer, Arc::new(schema), properties).map_err(of_writer)?;
        let descriptions = file.schema_descr().columns().to_vec();
        Ok(Self { file, columns: values, descriptions, rows: 0 })
    }

    /// Writes a row.
    ///
    /// # Errors
    /// What the writer meets, or a cell that is not of the kind of its column.
    pub fn row<'a>(&mut self, cells: impl IntoIterator<Item = Cell<'a>>) -> io::Result<()> {
        let (mut columns, rows, mut is_of_kind) = (self.columns.iter_mut(), self.rows, true);
        // A chain of cells is faster from within.
        cells.into_iter().for_each(|cell| match (columns.next(), cell) {
            (Some(Values::Numbers(_, absent)), Cell::Number(value)) if value.is_nan() => absent.push(rows),
            (Some(Values::Numbers(values, _)), Cell::Number(value)) => values.push(value),
            (Some(Values::Words(words)), Cell::Word(word)) => words.push(word),
            (Some(Values::Words(words)), Cell::SameWord) => is_of_kind &= words.repeat(),
            (Some(first), Cell::SameWords) => {
                is_of_kind &= std::iter::once(first).chain(columns.by_ref()).all(|column| match column {
                    Values::Words(words) => words.repeat(),
                    Values::Whole(_) | Values::Numbers(..) => false,
                });
            }
            (Some(Values::Whole(values)), Cell::Whole(value)) => values.push(value.cast_signed()),
            _ => is_of_kind = false,
        });
        if !is_of_kind || columns.next().is_some() {
            return Err(io::Error::other("a row has not one cell of its kind for each column"));
        }
        self.rows += 1;
        if self.rows == GROUP { self.write_group() } else { Ok(()) }
    }

    fn write_group(&mut self) -> io::Result<()> {
        let rows = std::mem::take(&mut self.rows);
        if rows == 0 {
            return Ok(());
        }
        let mut group = self.file.next_row_group().map_err(of_writer)?;
        for (values, description) in self.columns.iter_mut().zip(&self.descriptions) {
            if let Values::Words(words) = values {
                let (bytes, close) = words.encode(description.clone()).map_err(of_writer)?;
                group.append_column(&bytes, close).map_err(of_writer)?;
                words.begin_anew();
                continue;
            }
            let Some(mut column) = group.next_column().map_err(of_writer)? else { break };
            match (column.untyped(), &mut *values) {
                (ColumnWriter::Int64ColumnWriter(writer), Values::Whole(values)) => {
                    writer.write_batch(values, None, None).map_err(of_writer)?;
                    values.clear();
                }
                (ColumnWriter::DoubleColumnWriter(writer), Values::Numbers(values, absent)) => {
                    let mut present = vec![1; rows];
                    absent.drain(..).for_each(|row| present[row] = 0);
                    writer.write_batch(values, Some(&present), None).map_err(of_writer)?;
                    values.clear();
                }
                _ => return Err(io::Error::other("a column is not of its kind")),
            }
            column.close().map_err(of_writer)?;
        }
        group.close().map_err(of_writer)?;
        Ok(())
    }

    /// Writes what is left and hands back the writer.
    ///
    /// # Errors
    /// What the writer meets.
    pub fn finish(mut self) -> io::Result<W> {
        self.write_group()?;
        self.file.into_inner().map_err(of_writer)
    }
}

/// What the writer met, as it was; other errors with their message.
fn of_writer(error: ParquetError) -> io::Error {
    match error {
        ParquetError::External(source) => match source.downcast::<io::Error>() {
            Ok(source) => *source,
            Err(source) => io::Error::other(source),
        },
        error => io::Error::other(error),
    }
}

fn field(name: &str, kind: ColumnKind) -> Result<Arc<Type>, ParquetError> {
    let (physical, logical, repetition) = match kind {
        ColumnKind::Whole => {
            let unsigned = LogicalType::integer(64, false);
            (Physical::INT64, Some(unsigned), Repetition::REQUIRED)
        }
        ColumnKind::Number => (Physical::DOUBLE, None, Repetition::OPTIONAL),
        ColumnKind::Word => (Physical::BYTE_ARRAY, Some(LogicalType::String), Repetition::REQUIRED),
    };
    let column = Type::primitive_type_builder(name, physical).with_logical_type(logical);
    Ok(Arc::new(column.with_repetition(repetition).build()?))
}

/// Converts a comma-separated table to a Parquet file, whole or not at all. `kind` gives the kind of each column.
///
/// # Errors
/// A file cannot be read or written, or a cell does not hold what its column should.
pub fn write_parquet(csv: &Path, path: &Path, kind: impl Fn(&str) -> ColumnKind) -> io::Result<()> {
    let mut records = Records::new(Box::new(File::open(csv)?), b',');
    let advance = |records: &mut Records| {
        records.advance().map_err(|error| match error {
            RecordError::Io(error) => error,
            RecordError::TooLong => io::Error::other("a row is too long"),
        })
    };
    let text = |cell: &[u8]| std::str::from_utf8(cell).map(str::to_owned).map_err(io::Error::other);
    advance(&mut records)?;
    let names = records.cells().map(text).collect::<io::Result<Vec<String>>>()?;
    let kinds: Vec<ColumnKind> = names.iter().map(|name| kind(name)).collect();
    write_whole(path, |writer| {
        let columns = names.iter().map(String::as_str).zip(kinds.iter().copied());
        let mut file = ParquetWriter::new(writer, columns)?;
        while advance(&mut records)? {
            if records.len() != kinds.len() {
                return Err(io::Error::other(format!("line {} has {} cells", records.line(), records.len())));
            }
            let cells = records.cells().zip(&kinds).map(|(cell, kind)| match kind {
                ColumnKind::Number => number(cell)
                    .map(Cell::Number)
                    .ok_or_else(|| io::Error::other(format!("line {}: a cell is not a number", records.line()))),
                _ => {
                    let text = std::str::from_utf8(cell).map_err(io::Error::other)?;
                    match kind {
                        ColumnKind::Whole => text.parse().map(Cell::Whole).map_err(io::Error::other),
                        _ => Ok(Cell::Word(text)),
                    }
                }
            });
            file.row(cells.collect::<io::Result<Vec<Cell<'_>>>>()?)?;
        }
        file.finish().map(drop)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytes::Bytes;
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::RowAccessor;

    #[test]
    fn a_parquet_file_holds_what_the_table_held() {
        let folder = std::env::temp_dir().join(format!("wetclutch-parquet-{}", std::process::id()));
        let (csv, path) = (folder.join("runs.csv"), folder.join("runs.parquet"));
        let last = GROUP + 10;
        let rows: String = (0..=last)
            .map(|i| format!("{i},ok,{}\n", if i == last { String::new() } else { format!("{}", i as f64 / 3.0) }))
            .collect();
        write_whole(&csv, |w| w.write_all(format!("run,status,x\n{rows}").as_bytes())).unwrap();
        let kind = |name: &str| match name {
            "run" => ColumnKind::Whole,
            "status" => ColumnKind::Word,
            _ => ColumnKind::Number,
        };
        write_parquet(&csv, &path, kind).unwrap();
        let reader = SerializedFileReader::new(std::fs::File::open(&path).unwrap()).unwrap();
        let read: Vec<_> = reader.get_row_iter(None).unwrap().map(Result::unwrap).collect();
        assert_eq!(read.len(), last + 1);
        assert_eq!((read[4998].get_ulong(0).unwrap(), read[4998].get_double(2).unwrap()), (4998, 1666.0));
        assert_eq!(read[GROUP + 2].get_ulong(0).unwrap(), (GROUP + 2) as u64);
        assert_eq!(read[7].get_string(1).unwrap(), "ok");
        assert!(read[last].get_double(2).is_err());
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn words_that_change_often_or_are_many_are_those_that_were_written() {
        let word = |row: usize| match row {
            0..10_000 => "good".to_owned(),
            10_000..20_000 => ["good", "flare", ""][row % 3].to_owned(),
            _ => format!("number {}", row % 700),
        };
        let columns = [
            ("run", ColumnKind::Whole),
            ("word", ColumnKind::Word),
            ("x", ColumnKind::Number),
            ("same", ColumnKind::Word),
        ];
        let mut writer = ParquetWriter::new(Vec::new(), columns).unwrap();
        let rows = 2 * GROUP + 5;
        let none = [Cell::Whole(0), Cell::SameWord, Cell::Number(0.0), Cell::Word("e")];
        assert!(ParquetWriter::new(Vec::new(), columns).unwrap().row(none).is_err());
        for row in 0..rows {
            let x = if row % 5 == 2 { f64::NAN } else { row as f64 };
            let same = match row % 3 {
                _ if row == 0 => Cell::Word("e"),
                1 => Cell::SameWords,
                _ => Cell::SameWord,
            };
            writer.row([Cell::Whole(row as u64), Cell::Word(&word(row)), Cell::Number(x), same]).unwrap();
        }
        let reader = SerializedFileReader::new(Bytes::from(writer.finish().unwrap())).unwrap();
        let mut read = 0;
        for (row, values) in reader.get_row_iter(None).unwrap().map(Result::unwrap).enumerate() {
            assert_eq!(values.get_ulong(0).unwrap(), row as u64);
            assert_eq!(values.get_string(1).unwrap(), &word(row));
            assert_eq!(values.get_double(2).ok(), (row % 5 != 2).then_some(row as f64));
            assert_eq!(values.get_string(3).unwrap(), "e");
            read += 1;
        }
        assert_eq!(read, rows);
    }
}
