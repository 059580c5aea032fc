//! Text that is still being written: a growing file or a pipe.

use std::fs::File;
use std::io::{self, ErrorKind, Read, Seek};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::Duration;

/// How often a file is looked at for more, and the stop for whether it was set.
const LOOK: Duration = Duration::from_millis(50);
/// Bytes that are read at once.
const READ_AT_ONCE: usize = 64 << 10;

/// Gives the lines of a text as they come. Only whole lines are given: when it is stopped, a line that was not complete is left
/// out; at the end of a pipe the last line needs no end. A file ends where it became shorter, or where another file has its path: its
/// recorder began a new one.
pub struct Following {
    source: Source,
    stop: Arc<AtomicBool>,
    /// Bytes that came: those before `given` were given, those before `whole` are of whole lines.
    bytes: Vec<u8>,
    given: usize,
    whole: usize,
    ended: bool,
}

enum Source {
    /// With its path.
    File(File, PathBuf),
    /// Chunks from a thread that waits for a pipe, so that a stop is seen while nothing comes.
    Pipe(Receiver<io::Result<Vec<u8>>>),
}

impl Following {
    /// Follows a file, `-` or a pipe until `stop` is set; a pipe also until it ends.
    ///
    /// # Errors
    /// The file cannot be opened.
    pub fn open(path: &Path, stop: Arc<AtomicBool>) -> io::Result<Self> {
        let source = if path == Path::new("-") {
            Source::Pipe(chunks(io::stdin()))
        } else {
            let file = File::open(path)?;
            if file.metadata()?.is_file() { Source::File(file, path.to_owned()) } else { Source::Pipe(chunks(file)) }
        };
        Ok(Self { source, stop, bytes: Vec::new(), given: 0, whole: 0, ended: false })
    }

    /// Waits for more bytes; none at the end or when it is stopped.
    fn more(&mut self) -> io::Result<Option<Vec<u8>>> {
        loop {
            if self.stop.load(Ordering::Relaxed) {
                self.bytes.truncate(self.whole);
                return Ok(None);
            }
            match &mut self.source {
                Source::File(file, path) => {
                    let mut chunk = vec![0; READ_AT_ONCE];
                    let read = match file.read(&mut chunk) {
                        Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                        read => read?,
                    };
                    if read > 0 {
                        chunk.truncate(read);
                        return Ok(Some(chunk));
                    }
                    if file.metadata()?.len() < file.stream_position()? || is_replaced(file, path)? {
                        self.bytes.truncate(self.whole);
                        return Ok(None);
                    }
                    std::thread::sleep(LOOK);
                }
                Source::Pipe(chunks) => match chunks.recv_timeout(LOOK) {
                    Ok(chunk) => return chunk.map(Some),
                    Err(RecvTimeoutError::Timeout) => {}
                    Err(RecvTimeoutError::Disconnected) => return Ok(None),
                },
            }
        }
    }
}

/// Whether another file has the path now: the recorder began a new one.
#[cfg(unix)]
fn is_replaced(file: &File, path: &Path) -> io::Result<bool> {
    use std::os::unix::fs::MetadataExt;
    // Where nothing has the path, the recorder may still write to this file.
    let Ok(there) = std::fs::metadata(path) else { return Ok(false) };
    let own = file.metadata()?;
    Ok((there.dev(), there.ino()) != (own.dev(), own.ino()))
}

#[cfg(not(unix))]
fn is_replaced(_: &File, _: &Path) -> io::Result<bool> {
    Ok(false)
}

/// Reads in a thread of its own.
fn chunks(mut input: impl Read + Send + 'static) -> Receiver<io::Result<Vec<u8>>> {
    let (sender, receiver) = sync_channel(4);
    std::thread::spawn(move || {
        loop {
            let mut chunk = vec![0; READ_AT_ONCE];
            let chunk = match input.read(&mut chunk) {
                Ok(0) => return,
                Ok(read) => {
                    chunk.truncate(read);
                    Ok(chunk)
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(error) => Err(error),
            };
            let failed = chunk.is_err();
            // Nobody takes what comes after a stop.
            if sender.send(chunk).is_err() || failed {
                return;
            }
        }
    });
    receiver
}

impl Read for Following {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while self.given == self.whole && !self.ended {
            self.bytes.drain(..self.given);
            (self.given, self.whole) = (0, 0);
            match self.more()? {
                None => {
                    self.ended = true;
                    self.whole = self.bytes.len();
                }
                Some(chunk) => {
                    let end = chunk.iter().rposition(|byte| *byte == b'\n');
                    self.whole = end.map_or(0, |end| self.bytes.len() + end + 1);
                    self.bytes.extend_from_slice(&chunk);
                    // A text without ends of lines does not fill the memory.
                    if self.bytes.len() > 32 << 20 {
                        self.whole = self.bytes.len();
                    }
                }
            }
        }
        let count = buffer.len().min(self.whole - self.given);
        buffer[..count].copy_from_slice(&self.bytes[self.given..self.given + count]);
        self.given += count;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn a_growing_file_is_given_in_whole_lines_until_the_stop() {
        let path = std::env::temp_dir().join(format!("wetclutch-follow-{}", std::process::id()));
        let mut file = File::create(&path).unwrap();
        let stop = Arc::new(AtomicBool::new(false));
        let mut following = Following::open(&path, Arc::clone(&stop)).unwrap();
        file.write_all(b"a,b\n1,").unwrap();
        let mut buffer = [0; 64];
        let read = following.read(&mut buffer).unwrap();
        assert_eq!(&buffer[..read], b"a,b\n");
        file.write_all(b"2\n3,4\n5").unwrap();
        let read = following.read(&mut buffer).unwrap();
        assert_eq!(&buffer[..read], b"1,2\n3,4\n");
        stop.store(true, Ordering::Relaxed);
        assert_eq!(following.read(&mut buffer).unwrap(), 0);
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    fn a_file_ends_where_it_becomes_shorter_or_is_replaced() {
        let path = std::env::temp_dir().join(format!("wetclutch-follow-cut-{}", std::process::id()));
        std::fs::write(&path, "a\nb\n").unwrap();
        let mut following = Following::open(&path, Arc::new(AtomicBool::new(false))).unwrap();
        let mut buffer = [0; 64];
        assert_eq!(following.read(&mut buffer).unwrap(), 4);
        std::fs::write(&path, "a\n").unwrap();
        assert_eq!(following.read(&mut buffer).unwrap(), 0);

        let mut following = Following::open(&path, Arc::new(AtomicBool::new(false))).unwrap();
        let moved = path.with_extension("old");
        std::fs::rename(&path, &moved).unwrap();
        // What the recorder writes until it begins the new file belongs to the old one.
        std::fs::write(&moved, "a\nb\nc").unwrap();
        std::fs::write(&path, "x\n").unwrap();
        assert_eq!(following.read(&mut buffer).unwrap(), 4);
        assert_eq!(following.read(&mut buffer).unwrap(), 0);
        std::fs::remove_file(path).unwrap();
        std::fs::remove_file(moved).unwrap();
    }
}
