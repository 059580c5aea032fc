//! The same rows as a Parquet file, for tables of many runs.

use std::io::{self, Write};
use std::path::Path;
use std::sync::Arc;

use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;

use crate::write_whole;

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
const GROUP: usize = 4096;

/// Converts a comma-separated table to a Parquet file, whole or not at all. `kind` gives the kind of each column.
///
/// # Errors
/// A file cannot be read or written, or a cell does not hold what its column should.
pub fn write_parquet(csv: &Path, path: &Path, kind: impl Fn(&str) -> ColumnKind) -> io::Result<()> {
    let mut reader = csv::Reader::from_path(csv).map_err(io::Error::other)?;
    let names: Vec<String> = reader.headers().map_err(io::Error::other)?.iter().map(str::to_owned).collect();
    let kinds: Vec<ColumnKind> = names.iter().map(|name| kind(name)).collect();
    write_whole(path, |writer| {
        let fields = names.iter().zip(&kinds).map(|(name, &kind)| field(name, kind)).collect::<Result<_, _>>();
        let schema = Type::group_type_builder("rows").with_fields(fields.map_err(io::Error::other)?).build();
        let properties = Arc::new(WriterProperties::builder().build());
        let mut file = SerializedFileWriter::new(writer, Arc::new(schema.map_err(io::Error::other)?), properties)
            .map_err(io::Error::other)?;
        let mut rows: Vec<csv::StringRecord> = Vec::with_capacity(GROUP);
        for row in reader.records() {
            rows.push(row.map_err(io::Error::other)?);
            if rows.len() == GROUP {
                group(&mut file, &kinds, &rows)?;
                rows.clear();
            }
        }
        if !rows.is_empty() {
            group(&mut file, &kinds, &rows)?;
        }
        file.close().map_err(io::Error::other)?;
        Ok(())
    })
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

fn group<W: Write + Send>(
    file: &mut SerializedFileWriter<W>,
    kinds: &[ColumnKind],
    rows: &[csv::StringRecord],
) -> io::Result<()> {
    let mut group = file.next_row_group().map_err(io::Error::other)?;
    for (i, kind) in kinds.iter().enumerate() {
        let cells = || rows.iter().map(|row| row.get(i).unwrap_or_default());
        let Some(mut column) = group.next_column().map_err(io::Error::other)? else { break };
        match kind {
            ColumnKind::Whole => {
                let values: Vec<i64> = cells()
                    .map(|cell| cell.parse::<u64>().map(u64::cast_signed))
                    .collect::<Result<_, _>>()
                    .map_err(io::Error::other)?;
                column.typed::<Int64Type>().write_batch(&values, None, None)
            }
            ColumnKind::Number => {
                let values = cells().filter(|cell| !cell.is_empty()).map(str::parse);
                let values: Vec<f64> = values.collect::<Result<_, _>>().map_err(io::Error::other)?;
                let present: Vec<i16> = cells().map(|cell| i16::from(!cell.is_empty())).collect();
                column.typed::<DoubleType>().write_batch(&values, Some(&present), None)
            }
            ColumnKind::Word => {
                let values: Vec<ByteArray> = cells().map(ByteArray::from).collect();
                column.typed::<ByteArrayType>().write_batch(&values, None, None)
            }
        }
        .map_err(io::Error::other)?;
        column.close().map_err(io::Error::other)?;
    }
    group.close().map_err(io::Error::other)?;
    Ok(())
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
        let rows: String = (0..5000)
            .map(|i| format!("{i},ok,{}\n", if i == 4999 { String::new() } else { format!("{}", f64::from(i) / 3.0) }))
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
        assert_eq!(read.len(), 5000);
        assert_eq!((read[4998].get_ulong(0).unwrap(), read[4998].get_double(2).unwrap()), (4998, 1666.0));
        assert_eq!(read[7].get_string(1).unwrap(), "ok");
        assert!(read[4999].get_double(2).is_err());
        std::fs::remove_dir_all(folder).unwrap();
    }
}
