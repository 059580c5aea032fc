//! Small text files: vehicles, studies, channel maps and the like.
//!
//! Every such file is read here. Only a regular file is read: a device may never end, a pipe may never begin, and both
//! can be read only once. The size is limited, because a parsed text takes many times its size in memory.

use std::fs::{self, File, Metadata};
use std::io::{self, ErrorKind, Read};
use std::path::Path;

use crate::text::unicode_of;
use crate::watch::{FileUse, file_used};

/// Largest text in TOML or JSON, bytes \[chosen\]: a hundred times the longest file that a person writes.
pub const LARGEST_TEXT: u64 = 4 << 20;
/// Largest text of one entry in each line, such as a speed cycle or a DBC, bytes \[chosen\].
pub const LARGEST_LIST: u64 = 32 << 20;

/// Reads a text file of at most [`LARGEST_TEXT`].
///
/// # Errors
/// See [`read_small`]; the file is neither UTF-8 nor UTF-16 (`InvalidData`).
pub fn read_text(path: &Path) -> io::Result<String> {
    read_text_of(path, LARGEST_TEXT)
}

/// Reads a text file of at most this size.
///
/// # Errors
/// See [`read_small`]; the file is neither UTF-8 nor UTF-16 (`InvalidData`).
pub fn read_text_of(path: &Path, largest_bytes: u64) -> io::Result<String> {
    let bytes = read_small(path, largest_bytes)?;
    unicode_of(&bytes).ok_or_else(|| {
        io::Error::new(ErrorKind::InvalidData, "the file is not text in UTF-8 or UTF-16\nhint: save it as UTF-8")
    })
}

/// Reads a regular file of at most this size.
///
/// # Errors
/// The file is missing, cannot be read, is larger (`FileTooLarge`), or is a folder, device or pipe.
pub fn read_small(path: &Path, largest_bytes: u64) -> io::Result<Vec<u8>> {
    let file = open_regular(path)?;
    let size = file.metadata()?.len();
    check_size(size, largest_bytes)?;
    let mut bytes = Vec::with_capacity(usize::try_from(size).unwrap_or(0));
    // One byte more than allowed: the file may have grown, and files of the kernel report no size.
    let read = file.take(largest_bytes.saturating_add(1)).read_to_end(&mut bytes)?;
    check_size(read as u64, largest_bytes)?;
    Ok(bytes)
}

/// Opens a regular file.
///
/// # Errors
/// The file is missing, cannot be read, or is a folder, device or pipe.
pub(crate) fn open_regular(path: &Path) -> io::Result<File> {
    // Before the file is opened: to open a pipe waits for its writer.
    check_kind(&fs::metadata(path)?)?;
    let file = File::open(path)?;
    file_used(FileUse::Read, path);
    Ok(file)
}

fn check_kind(there: &Metadata) -> io::Result<()> {
    if there.is_file() {
        return Ok(());
    }
    Err(match there.is_dir() {
        true => io::Error::new(ErrorKind::IsADirectory, "this is a folder, expected a file\nhint: name a file in it"),
        false => io::Error::new(
            ErrorKind::InvalidInput,
            "this is a device or a pipe, expected a file\n\
             hint: write the text to a file first: it may be read more than once, and paths in it count from its folder",
        ),
    })
}

fn check_size(bytes: u64, largest_bytes: u64) -> io::Result<()> {
    if bytes <= largest_bytes {
        return Ok(());
    }
    let message = format!(
        "the file is larger than {} MiB, the maximum for a file of this kind\nhint: check which file this is, and the order of the files",
        largest_bytes >> 20
    );
    Err(io::Error::new(ErrorKind::FileTooLarge, message))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scratch::Folder;

    #[test]
    fn a_text_is_read_up_to_its_largest_size_and_not_beyond() {
        let folder = Folder::new("text-size");
        let path = folder.0.join("a.toml");
        let full = "#".repeat(1 << 20);
        fs::write(&path, &full).unwrap();
        assert_eq!(read_text_of(&path, 1 << 20).unwrap(), full);
        fs::write(&path, full + "#").unwrap();
        let error = read_text_of(&path, 1 << 20).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::FileTooLarge);
        assert!(error.to_string().starts_with("the file is larger than 1 MiB"), "{error}");
        // A file that is nearly all hole is refused by its size, before memory is taken for it.
        File::create(&path).unwrap().set_len(1 << 40).unwrap();
        assert_eq!(read_text(&path).unwrap_err().kind(), ErrorKind::FileTooLarge);
        fs::write(&path, [b'a', 0xff]).unwrap();
        let error = read_text(&path).unwrap_err();
        assert_eq!(
            (error.kind(), &*error.to_string()),
            (ErrorKind::InvalidData, "the file is not text in UTF-8 or UTF-16\nhint: save it as UTF-8")
        );
        assert_eq!(read_small(&path, 2).unwrap(), [b'a', 0xff]);
        assert_eq!(read_text(&folder.0.join("none")).unwrap_err().kind(), ErrorKind::NotFound);
    }

    #[test]
    fn a_folder_is_no_text() {
        let folder = Folder::new("text-folder");
        let error = read_text(&folder.0).unwrap_err();
        assert!(error.to_string().starts_with("this is a folder, expected a file"), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn devices_and_pipes_are_refused_without_opening_them() {
        use std::os::unix::fs::symlink;
        let folder = Folder::new("text-pipe");
        let [pipe, link] = ["pipe", "link"].map(|name| folder.0.join(name));
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        symlink("/dev/zero", &link).unwrap();
        for path in [&pipe, &link, Path::new("/dev/zero"), Path::new("/dev/null")] {
            let error = read_text(path).unwrap_err();
            assert!(error.to_string().starts_with("this is a device or a pipe, expected a file"), "{error}");
        }
        // A link to a file is a file, and a file of the kernel has no size.
        fs::write(folder.0.join("file"), "text").unwrap();
        fs::remove_file(&link).unwrap();
        symlink("file", &link).unwrap();
        assert_eq!(read_text(&link).unwrap(), "text");
        if cfg!(target_os = "linux") {
            assert!(!read_text(Path::new("/proc/self/status")).unwrap().is_empty());
        }
    }
}
