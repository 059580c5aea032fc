//! A table in memory as the text of a log, made while it is read.

use std::io::{self, Read};
use std::sync::Arc;

use trace::{CsvWriter, TableRows};

/// Rows that are made at a time.
const ROWS: usize = 256;

/// The text of a table, a piece at a time.
pub(crate) struct TableText {
    table: Arc<dyn TableRows>,
    columns: usize,
    /// Writes into what was made and not read yet.
    writer: CsvWriter<Vec<u8>>,
    /// The next row.
    row: usize,
    /// How much of what was made has been read.
    read: usize,
}

impl TableText {
    pub(crate) fn new(table: Arc<dyn TableRows>) -> io::Result<Self> {
        let names = table.names();
        let (columns, writer) = (names.len(), CsvWriter::without_time(Vec::new(), names)?);
        Ok(Self { table, columns, writer, row: 0, read: 0 })
    }

    fn write_rows(&mut self) -> io::Result<()> {
        let end = self.table.rows().min(self.row + ROWS);
        for row in self.row..end {
            self.writer.cells((0..self.columns).map(|column| self.table.cell(row, column)))?;
        }
        self.row = end;
        self.writer.flush()
    }
}

impl Read for TableText {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.read == self.writer.inner().len() {
            self.writer.inner().clear();
            self.read = 0;
            self.write_rows()?;
        }
        let rest = &self.writer.inner()[self.read..];
        let count = rest.len().min(buffer.len());
        buffer[..count].copy_from_slice(&rest[..count]);
        self.read += count;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Column, Table, Values, Words};

    #[test]
    fn the_text_of_a_table_has_every_row_and_its_numbers_exactly() {
        let numbers: Vec<f64> = (0..1000).map(|row| 1.0 / f64::from(row)).collect();
        let words = ["1", "", "a, \"b\""].into_iter().cycle().take(1000);
        let table = Table {
            columns: vec![
                Column { name: "turbine_speed_rad_s".to_owned(), values: Values::Numbers(numbers.clone()) },
                Column { name: "gear".to_owned(), values: Values::Words(words.collect::<Words>()) },
            ],
        };
        let mut text = String::new();
        TableText::new(Arc::new(table)).unwrap().read_to_string(&mut text).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 1001);
        assert_eq!(lines[0], "turbine_speed_rad_s,gear");
        for (line, number) in lines[1..].iter().zip(&numbers) {
            assert_eq!(line.split(',').next().unwrap().parse::<f64>().unwrap().to_bits(), number.to_bits());
        }
        assert!(lines[3].ends_with(",\"a, \"\"b\"\"\""), "{}", lines[3]);
    }
}
