//! Tables that grow row by row over hours, and can be continued after the program was killed.
//!
//! While it grows, a table has `.partial` at the end of its name. An incomplete last row is dropped when the table is
//! continued.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, BufRead, BufReader, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

use crate::TraceError;
use crate::csv_file::LONGEST_ROW;
use crate::folders::create_folder;
use crate::text_file::open_regular;
use crate::watch::{FileUse, file_used};

/// The file that is locked.
const LOCK: &str = "wetclutch.lock";

/// A folder that one process writes to. The operating system ends the lock with the process, however that ends; the empty
/// file stays, and means nothing.
#[derive(Debug)]
pub struct FolderLock {
    _file: File,
    /// Whether the file system has locks; where it has none, nothing keeps another process out.
    pub is_held: bool,
}

impl FolderLock {
    /// Locks a folder; `None` if another process has. A missing folder is made.
    ///
    /// # Errors
    /// The folder cannot be made or written to.
    pub fn take(folder: &Path) -> io::Result<Option<Self>> {
        create_folder(folder)?;
        let file = OpenOptions::new().create(true).append(true).open(folder.join(LOCK))?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => Ok(None),
            locked => Ok(Some(Self { _file: file, is_held: locked.is_ok() })),
        }
    }
}

/// What ended the rows of a table before the end of the file.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Damage {
    /// Line, counted from 1.
    pub line: u64,
    /// What is wrong with it.
    pub message: String,
}

/// Passes the rows of a table to `row` until a row is incomplete, is not text, or `row` returns an error. Returns the
/// length of the good rows, bytes, and the error.
fn good_rows(
    file: File,
    header: &str,
    mut row: impl FnMut(&str) -> Result<(), String>,
) -> io::Result<(u64, Option<Damage>)> {
    let mut reader = BufReader::new(file);
    let (mut good, mut line, mut bytes) = (0, 0, Vec::new());
    loop {
        line += 1;
        bytes.clear();
        if reader.by_ref().take(LONGEST_ROW as u64).read_until(b'\n', &mut bytes)? == 0 {
            let missing = Damage { line, message: "the names of the columns are missing".to_owned() };
            return Ok((good, (line == 1).then_some(missing)));
        }
        let cut = if bytes.len() < LONGEST_ROW { "the line is incomplete" } else { "the line is longer than 32 MiB" };
        let text = bytes.strip_suffix(b"\n").ok_or(cut).map(std::str::from_utf8);
        let taken = match text {
            Err(cut) => Err(cut.to_owned()),
            Ok(Err(_)) => Err("the line is not UTF-8 text".to_owned()),
            Ok(Ok(text)) if text.ends_with('\r') => Err("the line ends with CR LF, expected LF".to_owned()),
            Ok(Ok(text)) if line > 1 => row(text),
            Ok(Ok(text)) if text == header => Ok(()),
            Ok(Ok(_)) => Err("the columns are not those of this study".to_owned()),
        };
        if let Err(message) = taken {
            return Ok((good, Some(Damage { line, message })));
        }
        good += bytes.len() as u64;
    }
}

/// A comma-separated table that is not complete.
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
            create_folder(folder)?;
        }
        let partial = partial_path(path);
        let mut writer = BufWriter::new(File::create(&partial)?);
        writeln!(writer, "{header}")?;
        writer.flush()?;
        Ok(Self { path: path.to_owned(), partial, writer })
    }

    /// Continues an unfinished table, and passes its complete rows to `row`. A wrong row and all rows after it are
    /// dropped and reported.
    ///
    /// # Errors
    /// The file cannot be read or written, or has other columns.
    pub fn resume(
        path: &Path,
        header: &str,
        row: impl FnMut(&str) -> Result<(), String>,
    ) -> Result<(Self, Option<Damage>), TraceError> {
        let partial = partial_path(path);
        let io = |source| TraceError::Io { path: partial.clone(), source };
        let (good, damage) = good_rows(open_regular(&partial).map_err(io)?, header, row).map_err(io)?;
        if good == 0 {
            if fs::metadata(&partial).map_err(io)?.len() > header.len() as u64 {
                return Err(damaged(&partial, damage));
            }
            // Killed before the names of the columns were written.
            return Ok((Self::create(path, header).map_err(io)?, None));
        }
        let file = OpenOptions::new().append(true).open(&partial).map_err(io)?;
        file.set_len(good).map_err(io)?;
        Ok((Self { path: path.to_owned(), partial: partial.clone(), writer: BufWriter::new(file) }, damage))
    }

    /// Appends a row.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn append(&mut self, row: &str) -> io::Result<()> {
        self.writer.write_all(row.as_bytes())?;
        self.writer.write_all(b"\n")
    }

    /// Writes all rows so far to the file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn flush(&mut self) -> io::Result<()> {
        self.writer.flush()
    }

    /// Deletes an unfinished table that cannot be used.
    pub fn discard(self) {
        // What cannot be removed is overwritten by the next one.
        let _ = fs::remove_file(&self.partial);
    }

    /// Gives the table its name.
    ///
    /// # Errors
    /// The file cannot be written or renamed.
    pub fn finish(mut self) -> io::Result<()> {
        self.writer.flush()?;
        self.writer.get_ref().sync_all()?;
        fs::rename(&self.partial, &self.path)?;
        file_used(FileUse::Written, &self.path);
        Ok(())
    }
}

/// Passes the rows of a finished table to `row`, after checking its header.
///
/// # Errors
/// The file cannot be read, or a line is wrong; `row` returns what is wrong with a line.
pub fn read_rows(path: &Path, header: &str, row: impl FnMut(&str) -> Result<(), String>) -> Result<(), TraceError> {
    let io = |source| TraceError::Io { path: path.to_owned(), source };
    match good_rows(open_regular(path).map_err(io)?, header, row).map_err(io)? {
        (_, None) => Ok(()),
        (_, damage) => Err(damaged(path, damage)),
    }
}

fn damaged(path: &Path, damage: Option<Damage>) -> TraceError {
    let Damage { line, message } = damage.unwrap_or_default();
    TraceError::Row { path: path.to_owned(), line, message }
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
            Ok(())
        });
        let (mut table, damage) = resumed.unwrap();
        assert_eq!(damage.unwrap().line, 4);
        table.append("2,3.5").unwrap();
        table.finish().unwrap();
        assert_eq!(seen, ["0,1.5", "1,2.5"]);
        assert_eq!(fs::read_to_string(&path).unwrap(), "run,x\n0,1.5\n1,2.5\n2,3.5\n");
        fs::remove_dir_all(folder).unwrap();
    }

    /// What is said about a table with these bytes, as a finished one and as one to go on with, and how it goes on.
    fn said(name: &str, bytes: &[u8]) -> (String, String) {
        let folder = std::env::temp_dir().join(format!("wetclutch-{name}-{}", std::process::id()));
        let path = folder.join("runs.csv");
        fs::create_dir_all(&folder).unwrap();
        fs::write(&path, bytes).unwrap();
        fs::write(partial_path(&path), bytes).unwrap();
        let row = |row: &str| if row.contains('x') { Err("it is odd".to_owned()) } else { Ok(()) };
        let finished = read_rows(&path, "run,x", row).map_or_else(|error| error.to_string(), |()| "good".to_owned());
        let resumed = GrowingTable::resume(&path, "run,x", row).map(|(table, _)| table.finish().unwrap());
        let went_on = match resumed {
            Ok(()) => fs::read_to_string(&path).unwrap(),
            Err(error) => error.to_string(),
        };
        fs::remove_dir_all(&folder).unwrap();
        let file = |text: String| text.replace(path.to_str().unwrap(), "FILE");
        (file(finished), file(went_on))
    }

    #[test]
    fn a_damaged_table_says_its_line_and_goes_on_before_it() {
        let both = |finished: &str, went_on: &str| (finished.to_owned(), went_on.to_owned());
        assert_eq!(said("good", b"run,x\n0,1\n"), both("good", "run,x\n0,1\n"));
        assert_eq!(said("odd", b"run,x\n0,1\n1,x\n2,1\n"), both("FILE:3: it is odd", "run,x\n0,1\n"));
        assert_eq!(said("cut", b"run,x\n0,1\n1,2"), both("FILE:3: the line is incomplete", "run,x\n0,1\n"));
        assert_eq!(said("bytes", b"run,x\n0,1\n1,\xff\n"), both("FILE:3: the line is not UTF-8 text", "run,x\n0,1\n"));
        let windows = "FILE:3: the line ends with CR LF, expected LF";
        assert_eq!(said("windows", b"run,x\n0,1\n1,2\r\n"), both(windows, "run,x\n0,1\n"));
        assert_eq!(said("empty", b""), both("FILE:1: the names of the columns are missing", "run,x\n"));
        assert_eq!(said("begun", b"run,"), both("FILE:1: the line is incomplete", "run,x\n"));
        let other = "the columns are not those of this study";
        assert_eq!(
            said("other", b"run,y\n0,1\n"),
            both(&format!("FILE:1: {other}"), &format!("FILE.partial:1: {other}"))
        );
    }

    #[test]
    fn a_row_without_end_and_a_device_in_place_of_a_table_are_refused() {
        let folder = crate::scratch::Folder::new("endless-row");
        let path = folder.0.join("runs.csv");
        // A hole: it is read as zeros.
        File::create(&path).unwrap().set_len(LONGEST_ROW as u64 + 5).unwrap();
        let error = read_rows(&path, "run,x", |_| Ok(())).unwrap_err().to_string();
        assert!(error.ends_with(":1: the line is longer than 32 MiB"), "{error}");
        #[cfg(unix)]
        {
            fs::remove_file(&path).unwrap();
            std::os::unix::fs::symlink("/dev/zero", &path).unwrap();
            let error = read_rows(&path, "run,x", |_| Ok(())).unwrap_err().to_string();
            assert!(error.contains("this is a device or a pipe"), "{error}");
        }
    }

    #[test]
    fn a_folder_is_locked_once() {
        let folder = std::env::temp_dir().join(format!("wetclutch-lock-{}", std::process::id()));
        let first = FolderLock::take(&folder).unwrap();
        assert!(first.is_some() && FolderLock::take(&folder).unwrap().is_none());
        drop(first);
        assert!(FolderLock::take(&folder).unwrap().is_some());
        fs::remove_dir_all(folder).unwrap();
    }
}
