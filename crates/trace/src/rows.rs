//! Tables that grow row by row over hours and survive being killed.
//!
//! While it grows, a table has `.partial` behind its name. A row that was not written to its end is dropped when the
//! table is taken up again.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufRead, BufReader, BufWriter, Write};
use std::path::{Path, PathBuf};

/// A comma-separated table under way.
#[derive(Debug)]
pub struct GrowingTable {
    path: PathBuf,
    partial: PathBuf,
    writer: BufWriter<File>,
}

/// The name of a table while it grows.
pub fn partial_path(path: &Path) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(".partial");
    path.with_file_name(name)
}

impl GrowingTable {
    /// A new table with this header. Missing folders are made.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn create(path: &Path, header: &str) -> io::Result<Self> {
        if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
            fs::create_dir_all(folder)?;
        }
        let partial = partial_path(path);
        let mut writer = BufWriter::new(File::create(&partial)?);
        writeln!(writer, "{header}")?;
        writer.flush()?;
        Ok(Self { path: path.to_owned(), partial, writer })
    }

    /// Takes up a table that was left unfinished, and shows its whole rows to `row`; a row that `row` refuses, and
    /// what follows it, is dropped.
    ///
    /// # Errors
    /// The file cannot be read or written, or has another header.
    pub fn resume(path: &Path, header: &str, mut row: impl FnMut(&str) -> bool) -> io::Result<Self> {
        let partial = partial_path(path);
        let mut reader = BufReader::new(File::open(&partial)?);
        let mut line = String::new();
        reader.read_line(&mut line)?;
        if line.trim_end() != header {
            return Err(io::Error::new(io::ErrorKind::InvalidData, "it holds another table"));
        }
        let mut whole = line.len() as u64;
        loop {
            line.clear();
            let length = reader.read_line(&mut line)?;
            if length == 0 || !line.ends_with('\n') || !row(line.trim_end()) {
                break;
            }
            whole += length as u64;
        }
        let file = OpenOptions::new().append(true).open(&partial)?;
        file.set_len(whole)?;
        Ok(Self { path: path.to_owned(), partial, writer: BufWriter::new(file) })
    }

    /// Appends a row.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn append(&mut self, row: &str) -> io::Result<()> {
        self.writer.write_all(row.as_bytes())?;
        self.writer.write_all(b"\n")
    }

    /// Makes sure that the rows so far outlive the program.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn flush(&mut self) -> io::Result<()> {
        self.writer.flush()
    }

    /// Gives the table its name.
    ///
    /// # Errors
    /// The file cannot be written or renamed.
    pub fn finish(mut self) -> io::Result<()> {
        self.writer.flush()?;
        self.writer.get_ref().sync_all()?;
        fs::rename(&self.partial, &self.path)
    }
}

/// Shows the rows of a finished table to `row`, after checking its header.
///
/// # Errors
/// The file cannot be read, has another header, or `row` refuses a row.
pub fn read_rows(path: &Path, header: &str, mut row: impl FnMut(&str) -> bool) -> io::Result<()> {
    let invalid = |message: &str| io::Error::new(io::ErrorKind::InvalidData, message.to_owned());
    let mut lines = BufReader::new(File::open(path)?).lines();
    if lines.next().transpose()?.as_deref() != Some(header) {
        return Err(invalid("it holds another table"));
    }
    for (i, line) in lines.enumerate() {
        if !row(&line?) {
            return Err(invalid(&format!("line {} is not the row that belongs there", i + 2)));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_that_was_cut_off_in_a_row_goes_on_after_the_last_whole_one() {
        let folder = std::env::temp_dir().join(format!("wetclutch-rows-{}", std::process::id()));
        let path = folder.join("runs.csv");
        let mut table = GrowingTable::create(&path, "run,x").unwrap();
        table.append("0,1.5").unwrap();
        table.append("1,2.5").unwrap();
        table.flush().unwrap();
        drop(table);
        let mut file = OpenOptions::new().append(true).open(partial_path(&path)).unwrap();
        file.write_all(b"2,3").unwrap();
        let mut seen = Vec::new();
        let resumed = GrowingTable::resume(&path, "run,x", |row| {
            seen.push(row.to_owned());
            true
        });
        let mut table = resumed.unwrap();
        table.append("2,3.5").unwrap();
        table.finish().unwrap();
        assert_eq!(seen, ["0,1.5", "1,2.5"]);
        assert_eq!(fs::read_to_string(&path).unwrap(), "run,x\n0,1.5\n1,2.5\n2,3.5\n");
        assert!(read_rows(&path, "run,y", |_| true).is_err() && read_rows(&path, "run,x", |_| false).is_err());
        fs::remove_dir_all(folder).unwrap();
    }
}
