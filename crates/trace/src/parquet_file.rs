//! Tables as Parquet files.

use std::io::{self, Write};
use std::path::Path;
use std::sync::Arc;

use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::column::writer::ColumnWriter;
use parquet::data_type::ByteArray;
use parquet::errors::ParquetError;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::{ColumnPath, Type};

use crate::{Cell, write_whole};

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColumnKind {
    /// Whole numbers from 0, 64 bits.
    Whole,
    /// Numbers; an empty cell is none.
    Number,
    /// Words.
    Word,
}

/// Rows that are held in memory before they are written.
const GROUP: usize = 1 << 16;

/// Writes a Parquet file row by row; some ten thousand rows are held in memory.
pub struct ParquetWriter<W: Write + Send> {
    file: SerializedFileWriter<W>,
    columns: Vec<Values>,
    rows: usize,
    /// Every word so far, so that it is held once.
    words: Vec<ByteArray>,
}

/// The cells of a column that wait to be written.
enum Values {
    Whole(Vec<i64>),
    /// The numbers, and for each cell whether it has one.
    Numbers(Vec<f64>, Vec<i16>),
    Words(Vec<ByteArray>),
}

impl<W: Write + Send> ParquetWriter<W> {
    /// Begins a file with these columns.
    ///
    /// # Errors
    /// What the writer meets.
    pub fn new<'a>(writer: W, columns: impl IntoIterator<Item = (&'a str, ColumnKind)>) -> io::Result<Self> {
        let (mut fields, mut values) = (Vec::new(), Vec::new());
        let mut properties = WriterProperties::builder().set_statistics_enabled(EnabledStatistics::Chunk);
        for (name, kind) in columns {
            // Hardly two numbers of a column are the same: a dictionary of them costs time and saves nothing.
            let path = ColumnPath::new(vec![name.to_owned()]);
            properties = properties.set_column_dictionary_enabled(path, kind == ColumnKind::Word);
            fields.push(field(name, kind).map_err(io::Error::other)?);
            values.push(match kind {
                ColumnKind::Whole => Values::Whole(Vec::new()),
                ColumnKind::Number => Values::Numbers(Vec::new(), Vec::new()),
                ColumnKind::Word => Values::Words(Vec::new()),
            });
        }
        let schema = Type::group_type_builder("rows").with_fields(fields).build().map_err(io::Error::other)?;
        let properties = Arc::new(properties.build());
        let file = SerializedFileWriter::new(writer, Arc::new(schema), properties).map_err(io::Error::other)?;
        Ok(Self { file, columns: values, rows: 0, words: Vec::new() })
    }

    /// Writes a row.
    ///
    /// # Errors
    /// What the writer meets, or a cell that is not of the kind of its column.
    pub fn row<'a>(&mut self, cells: impl IntoIterator<Item = Cell<'a>>) -> io::Result<()> {
        let mut cells = cells.into_iter();
        for column in &mut self.columns {
            match (column, cells.next()) {
                (Values::Whole(values), Some(Cell::Whole(value))) => values.push(value.cast_signed()),
                (Values::Numbers(values, present), Some(Cell::Number(value))) => {
                    present.push(i16::from(!value.is_nan()));
                    if !value.is_nan() {
                        values.push(value);
                    }
                }
                (Values::Words(values), Some(Cell::Word(word))) => {
                    let known = self.words.iter().find(|known| known.data() == word.as_bytes());
                    values.push(match known {
                        Some(known) => known.clone(),
                        None => {
                            let new = ByteArray::from(word);
                            // The words of a column are few; a column of texts is not searched for long.
                            if self.words.len() < 64 {
                                self.words.push(new.clone());
                            }
                            new
                        }
                    });
                }
                _ => return Err(io::Error::other("a cell is not of the kind of its column")),
            }
        }
        self.rows += 1;
        if self.rows == GROUP { self.write_group() } else { Ok(()) }
    }

    fn write_group(&mut self) -> io::Result<()> {
        if std::mem::take(&mut self.rows) == 0 {
            return Ok(());
        }
        let mut group = self.file.next_row_group().map_err(io::Error::other)?;
        for values in &mut self.columns {
            let Some(mut column) = group.next_column().map_err(io::Error::other)? else { break };
            match (column.untyped(), &mut *values) {
                (ColumnWriter::Int64ColumnWriter(writer), Values::Whole(values)) => {
                    writer.write_batch(values, None, None)
                }
                (ColumnWriter::DoubleColumnWriter(writer), Values::Numbers(values, present)) => {
                    writer.write_batch(values, Some(present), None)
                }
                (ColumnWriter::ByteArrayColumnWriter(writer), Values::Words(values)) => {
                    writer.write_batch(values, None, None)
                }
                _ => return Err(io::Error::other("a column is not of its kind")),
            }
            .map_err(io::Error::other)?;
            column.close().map_err(io::Error::other)?;
            match values {
                Values::Whole(values) => values.clear(),
                Values::Numbers(values, present) => {
                    values.clear();
                    present.clear();
                }
                Values::Words(values) => values.clear(),
            }
        }
        group.close().map_err(io::Error::other)?;
        Ok(())
    }

    /// Writes what is left and hands back the writer.
    ///
    /// # Errors
    /// What the writer meets.
    pub fn finish(mut self) -> io::Result<W> {
        self.write_group()?;
        self.file.into_inner().map_err(io::Error::other)
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
    let mut reader = csv::Reader::from_path(csv).map_err(io::Error::other)?;
    let names: Vec<String> = reader.headers().map_err(io::Error::other)?.iter().map(str::to_owned).collect();
    let kinds: Vec<ColumnKind> = names.iter().map(|name| kind(name)).collect();
    write_whole(path, |writer| {
        let columns = names.iter().map(String::as_str).zip(kinds.iter().copied());
        let mut file = ParquetWriter::new(writer, columns)?;
        let mut row = csv::StringRecord::new();
        while reader.read_record(&mut row).map_err(io::Error::other)? {
            let cells = row.iter().zip(&kinds).map(|(cell, kind)| match kind {
                ColumnKind::Whole => cell.parse().map(Cell::Whole).map_err(io::Error::other),
                ColumnKind::Number if cell.is_empty() => Ok(Cell::Number(f64::NAN)),
                ColumnKind::Number => cell.parse().map(Cell::Number).map_err(io::Error::other),
                ColumnKind::Word => Ok(Cell::Word(cell)),
            });
            file.row(cells.collect::<io::Result<Vec<Cell<'_>>>>()?)?;
        }
        file.finish().map(drop)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
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
}
