//! Output files that appear whole or not at all.
//!
//! The data are written to `NAME.PID.partial` in the same folder, under an advisory lock. The file gets its name when
//! it is complete. The lock distinguishes the partial file of a running program from the partial file of a killed
//! one: process ids are used again, but a lock ends with its process. The next program that writes to a file removes what a killed
//! one left of it; partial files of other names in the folder are not removed, but can be listed ([`left_by_killed`]). Only regular
//! files are replaced. Data for a device or pipe are written directly to it; a link stays, and the file behind the link is replaced.

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, BufWriter, ErrorKind, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::early_sync::EarlySync;
use crate::folders::{check_folder, create_folder, remove_with_folders};
use crate::watch::{FileUse, file_used};

/// A file under construction. If it is dropped before [`Self::finish`], the file at its path is unchanged, and folders that were made
/// for it go away.
#[derive(Debug)]
pub struct WholeFile {
    writer: BufWriter<File>,
    sync: EarlySync,
    /// None if the bytes are written directly.
    replaces: Option<Replacement>,
}

#[derive(Debug)]
struct Replacement {
    partial: PathBuf,
    target: PathBuf,
}

/// The partial files of this program.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn unfinished() -> MutexGuard<'static, Vec<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Partial files of killed programs in folders that this program wrote to.
static LEFT: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn left() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    LEFT.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The partial files that killed programs left in the folders of the files that this program wrote, under names that it did not
/// write. They are not removed: nothing replaces them.
pub fn left_by_killed() -> Vec<PathBuf> {
    // A file that was noted between its creation and its lock is locked now, or gone.
    let is_left =
        |path: &Path| File::open(path).is_ok_and(|file| !matches!(file.try_lock(), Err(TryLockError::WouldBlock)));
    left().iter().filter(|path| is_left(path)).cloned().collect()
}

/// Removes the partial files of this program, which is about to end on a signal. The files at their paths stay as they were.
pub fn remove_unfinished() {
    // The next run removes what cannot be removed now.
    unfinished().drain(..).for_each(|partial| remove_with_folders(&partial));
}

impl WholeFile {
    /// Creates a file. Missing folders are created, and partial files of killed programs are removed.
    ///
    /// # Errors
    /// The place is a folder, or cannot be written to.
    pub fn create(path: &Path) -> io::Result<Self> {
        let permissions = match check_target(path)? {
            Some(there) if !there.is_file() => {
                let file = OpenOptions::new().write(true).open(path)?;
                return Ok(Self { writer: BufWriter::new(file), sync: EarlySync::default(), replaces: None });
            }
            there => there.map(|there| there.permissions()),
        };
        let target = behind_links(path)?;
        let name = target
            .file_name()
            .ok_or_else(|| io::Error::new(ErrorKind::InvalidInput, "the path does not name a file"))?;
        let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        create_folder(folder)?;
        remove_dead(folder, name);
        let mut partial = name.to_owned();
        partial.push(format!(".{}.partial", std::process::id()));
        let partial = target.with_file_name(partial);
        let writer = BufWriter::new(locked(&partial)?);
        unfinished().push(partial.clone());
        let file = Self { writer, sync: EarlySync::default(), replaces: Some(Replacement { partial, target }) };
        if let Some(permissions) = permissions {
            file.writer.get_ref().set_permissions(permissions)?;
        }
        Ok(file)
    }

    /// Whether a regular file will have this content; otherwise the bytes go directly to a device or pipe.
    pub fn is_replacement(&self) -> bool {
        self.replaces.is_some()
    }

    /// Gives the file its name.
    ///
    /// # Errors
    /// Writing or renaming fails; the file at the path is then unchanged.
    pub fn finish(self) -> io::Result<()> {
        Self::finish_all([self])
    }

    /// Gives several files their names, once all of them are on the disk.
    ///
    /// # Errors
    /// Writing or renaming fails.
    pub fn finish_all(mut files: impl AsMut<[Self]>) -> io::Result<()> {
        let files = files.as_mut();
        for file in files.iter_mut() {
            file.complete()?;
        }
        for file in files {
            if let Some(Replacement { partial, target }) = &file.replaces {
                fs::rename(partial, target)?;
                unfinished().retain(|other| other != partial);
                file_used(FileUse::Written, target);
                file.replaces = None;
            }
        }
        Ok(())
    }

    fn complete(&mut self) -> io::Result<()> {
        self.writer.flush()?;
        // A device or pipe has no disk to reach.
        if self.replaces.is_none() {
            return Ok(());
        }
        self.sync.end()?;
        self.writer.get_ref().sync_all()
    }
}

impl Seek for WholeFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.writer.seek(to)
    }
}

impl Write for WholeFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.writer.write(bytes)?;
        if self.replaces.is_some() {
            self.sync.wrote(written, self.writer.get_ref());
        }
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.writer.flush()
    }
}

impl Drop for WholeFile {
    fn drop(&mut self) {
        if let Some(replaces) = &self.replaces {
            remove_with_folders(&replaces.partial);
            unfinished().retain(|other| *other != replaces.partial);
        }
    }
}

/// Writes a file, whole or not at all. Missing folders are made.
///
/// # Errors
/// Writing or renaming fails; the file at the path is then unchanged.
pub fn write_whole(path: &Path, write: impl FnOnce(&mut (dyn Write + Send)) -> io::Result<()>) -> io::Result<()> {
    let mut file = WholeFile::create(path)?;
    write(&mut file)?;
    file.finish()
}

/// The file that [`check_writable`] writes and removes.
const PROBE: &str = "wetclutch.probe";

/// Checks that a file can be written, before the work for it starts. Leaves nothing behind.
///
/// # Errors
/// The path is a folder or a write-protected file, or the first folder above it that exists cannot be written to.
pub fn check_writable(path: &Path) -> io::Result<()> {
    if check_target(path)?.is_some_and(|there| !there.is_file()) {
        return Ok(());
    }
    let target = behind_links(path)?;
    let there = target.ancestors().skip(1).find(|folder| folder.as_os_str().is_empty() || folder.exists());
    let folder = there.filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    check_folder(folder)?;
    // The name is that of the process: one of its threads after the other.
    static PROBING: Mutex<()> = Mutex::new(());
    let _one = PROBING.lock().unwrap_or_else(PoisonError::into_inner);
    remove_dead(folder, OsStr::new(PROBE));
    let probe = folder.join(format!("{PROBE}.{}.partial", std::process::id()));
    // It goes while it is locked: nobody else takes it for one of a killed program.
    let held = locked(&probe)?;
    let removed = fs::remove_file(probe);
    drop(held);
    removed
}

/// The metadata of the file at the path of an output, if there is one.
///
/// # Errors
/// The path is a folder or a write-protected file, or its metadata cannot be read.
pub fn check_target(path: &Path) -> io::Result<Option<fs::Metadata>> {
    let folder = || io::Error::new(ErrorKind::IsADirectory, "this is a folder\nhint: name a file in it");
    match fs::metadata(path) {
        Ok(there) if there.is_dir() => Err(folder()),
        // A rename would replace it all the same.
        Ok(there) if there.is_file() && there.permissions().readonly() => Err(io::Error::new(
            ErrorKind::PermissionDenied,
            "the file is write-protected\nhint: choose another name, or allow writing to it",
        )),
        Ok(there) => Ok(Some(there)),
        Err(_) if path.as_os_str().to_string_lossy().ends_with(std::path::is_separator) => Err(folder()),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(error) if error.kind() == ErrorKind::NotADirectory => {
            Err(path.ancestors().find(|part| part.exists()).and_then(|part| check_folder(part).err()).unwrap_or(error))
        }
        Err(error) => Err(error),
    }
}

/// Links that are followed: as many as Linux does.
const MAX_LINKS: usize = 40;

/// The path behind the links. A link to a missing file gives the path of that file.
fn behind_links(path: &Path) -> io::Result<PathBuf> {
    let mut target = path.to_owned();
    for _ in 0..MAX_LINKS {
        match fs::symlink_metadata(&target) {
            Ok(there) if there.is_symlink() => {
                let link = fs::read_link(&target)?;
                target = target.parent().map_or_else(|| link.clone(), |folder| folder.join(&link));
            }
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(error),
            _ => return Ok(target),
        }
    }
    Err(io::Error::new(ErrorKind::InvalidInput, "too many symbolic links"))
}

/// Removes partial files of this name that no running program holds, and notes those of other names.
fn remove_dead(folder: &Path, name: &OsStr) {
    // A folder that cannot be listed may still be written to, and a file that is gone already needs no removing.
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let (file, path) = (entry.file_name(), entry.path());
        let Some(of) = name_of_partial(&file) else { continue };
        if !entry.file_type().is_ok_and(|kind| kind.is_file()) {
            continue;
        }
        let Ok(partial) = File::open(&path) else { continue };
        // The lock is held until the file is removed: no other program takes it for its own in between.
        match partial.try_lock() {
            Ok(()) if of == name.as_encoded_bytes() => {
                let _ = fs::remove_file(path);
            }
            // Without locks nothing tells whether its program still runs.
            Ok(()) | Err(TryLockError::Error(_)) => {
                left().insert(path);
            }
            Err(TryLockError::WouldBlock) => {}
        }
    }
}

/// The name of the file that a file called `NAME.PID.partial` becomes.
fn name_of_partial(file: &OsStr) -> Option<&[u8]> {
    let rest = file.as_encoded_bytes().strip_suffix(b".partial")?;
    let dot = rest.iter().rposition(|&byte| byte == b'.')?;
    let (name, digits) = (&rest[..dot], &rest[dot + 1..]);
    (!name.is_empty() && !digits.is_empty() && digits.iter().all(u8::is_ascii_digit)).then_some(name)
}

/// A new file that is locked until it is closed.
fn locked(path: &Path) -> io::Result<File> {
    loop {
        let file = OpenOptions::new().write(true).create_new(true).open(path).map_err(|error| match error.kind() {
            ErrorKind::AlreadyExists => io::Error::new(
                ErrorKind::AlreadyExists,
                "another program is writing this file\nhint: wait until it ends, or choose another name",
            ),
            _ => error,
        })?;
        // Who looks for files of killed programs can hold the lock for a moment, and remove the file then.
        match file.lock() {
            Ok(()) if path.exists() => return Ok(file),
            Ok(()) => {}
            // A file system without locks: nobody can take the file for dead there.
            Err(_) => return Ok(file),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scratch::Folder;

    fn write(path: &Path, text: &str) -> io::Result<()> {
        write_whole(path, |w| w.write_all(text.as_bytes()))
    }

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = Folder::new("failed");
        let path = folder.0.join("out.txt");
        write(&path, "old").unwrap();
        let failed = write_whole(&path, |w| {
            w.write_all(b"half of the new")?;
            Err(io::Error::other("no more"))
        });
        assert!(failed.is_err());
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(folder.names(), ["out.txt"]);
        let files = ["new/deep/a", "new/deep/b"].map(|name| WholeFile::create(&folder.0.join(name)).unwrap());
        assert!(folder.0.join("new/deep").is_dir());
        drop(files);
        assert_eq!(folder.names(), ["out.txt"]);
        let [left, whole] = ["new/deep/a", "new/b"].map(|name| WholeFile::create(&folder.0.join(name)).unwrap());
        whole.finish().unwrap();
        drop(left);
        assert_eq!(Folder(folder.0.join("new")).names(), ["b"]);
    }

    #[test]
    fn a_file_that_goes_to_the_disk_while_it_grows_is_whole_or_not_there() {
        let folder = Folder::new("large");
        let path = folder.0.join("large.bin");
        let piece: Vec<u8> = (0..=255).cycle().take(1 << 20).collect();
        let pieces = |w: &mut (dyn Write + Send), count: usize| (0..count).try_for_each(|_| w.write_all(&piece));
        write_whole(&path, |w| pieces(w, 40)).unwrap();
        assert!(fs::read(&path).unwrap() == piece.repeat(40));
        let failed = write_whole(&path, |w| pieces(w, 35).and(Err(io::Error::other("no more"))));
        assert!(failed.is_err() && fs::metadata(&path).unwrap().len() == 40 << 20);
        assert_eq!(folder.names(), ["large.bin"]);
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_and_the_file_it_leads_to_is_replaced_or_made() {
        use std::os::unix::fs::symlink;
        let folder = Folder::new("link");
        let [link, chain, target, far] = ["link", "chain", "target", "far/target"].map(|name| folder.0.join(name));
        symlink("target", &link).unwrap();
        symlink("link", &chain).unwrap();
        write(&link, "made").unwrap();
        assert_eq!(fs::read_to_string(&target).unwrap(), "made");
        write(&chain, "replaced").unwrap();
        assert_eq!(fs::read_to_string(&target).unwrap(), "replaced");
        fs::remove_file(&link).unwrap();
        symlink(&far, &link).unwrap();
        write(&link, "elsewhere").unwrap();
        assert_eq!(fs::read_to_string(&far).unwrap(), "elsewhere");
        assert!([&link, &chain].iter().all(|path| path.is_symlink()));
        assert_eq!(folder.names(), ["chain", "far", "link", "target"]);
    }

    #[cfg(unix)]
    #[test]
    fn links_in_a_circle_are_an_error() {
        let folder = Folder::new("circle");
        let path = folder.0.join("itself");
        std::os::unix::fs::symlink("itself", &path).unwrap();
        assert!(write(&path, "x").is_err());
        assert_eq!(folder.names(), ["itself"]);
    }

    #[cfg(unix)]
    #[test]
    fn a_pipe_is_written_through_and_stays() {
        use std::os::unix::fs::FileTypeExt;
        let folder = Folder::new("pipe");
        let path = folder.0.join("pipe");
        assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
        let reader = std::thread::spawn({
            let path = path.clone();
            move || fs::read_to_string(path).unwrap()
        });
        write(&path, "through").unwrap();
        assert_eq!(reader.join().unwrap(), "through");
        assert!(fs::metadata(&path).unwrap().file_type().is_fifo());
        assert_eq!(folder.names(), ["pipe"]);
    }

    #[cfg(unix)]
    #[test]
    fn a_file_keeps_its_permissions() {
        use std::os::unix::fs::PermissionsExt;
        let folder = Folder::new("mode");
        let path = folder.0.join("secret");
        write(&path, "old").unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o600)).unwrap();
        write(&path, "new").unwrap();
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
    }

    #[test]
    fn a_folder_is_refused_before_anything_is_written() {
        let folder = Folder::new("folder");
        for path in [folder.0.clone(), folder.0.join("none/")] {
            let error = WholeFile::create(&path).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::IsADirectory);
            assert!(error.to_string().contains("hint: name a file in it"));
        }
        assert!(folder.names().is_empty());
    }

    #[test]
    fn what_a_killed_program_left_goes_and_what_a_running_one_writes_stays() {
        let folder = Folder::new("dead");
        let path = folder.0.join("out.csv");
        // Process 1 always runs, and it holds no lock: its id was used again.
        let [reused, running] = ["out.csv.1.partial", "out.csv.2.partial"].map(|name| folder.0.join(name));
        fs::write(&reused, "dead").unwrap();
        let held = File::create(&running).unwrap();
        held.lock().unwrap();
        let others = ["out.csv.partial", "out.csv.x.partial", "other.csv.1.partial"];
        for name in others {
            fs::write(folder.0.join(name), "not ours").unwrap();
        }
        // One that this very process id left.
        fs::write(folder.0.join(format!("out.csv.{}.partial", std::process::id())), "dead").unwrap();
        write(&path, "new").unwrap();
        assert_eq!(
            folder.names(),
            ["other.csv.1.partial", "out.csv", "out.csv.2.partial", "out.csv.partial", "out.csv.x.partial"]
        );
        // What stays of a killed program is listed; what a running one holds is not.
        let here: Vec<PathBuf> = left_by_killed().into_iter().filter(|path| path.starts_with(&folder.0)).collect();
        assert_eq!(here, [folder.0.join("other.csv.1.partial")]);
    }

    #[test]
    fn a_file_in_place_of_a_folder_is_named_and_nothing_is_made() {
        let folder = Folder::new("no-folder");
        let file = folder.0.join("file");
        fs::write(&file, "kept").unwrap();
        let what = format!("{} is a file, expected a folder\nhint: choose another name after -o", file.display());
        for path in [file.join("out.csv"), file.join("sub/out.csv"), folder.0.join("file/../file/out.csv")] {
            assert!(
                check_writable(&path).unwrap_err().to_string().ends_with(&what[what.find(" is a file").unwrap()..])
            );
            assert!(WholeFile::create(&path).unwrap_err().to_string().contains(" is a file, expected a folder"));
        }
        assert!(create_folder(&file.join("sub")).unwrap_err().to_string() == what);
        assert_eq!((folder.names(), fs::read_to_string(&file).unwrap()), (vec!["file".to_owned()], "kept".to_owned()));
    }

    #[test]
    fn a_file_that_can_be_written_is_checked_without_a_trace() {
        let folder = Folder::new("writable");
        for path in [folder.0.join("out.csv"), folder.0.join("not/there/yet/out.csv")] {
            check_writable(&path).unwrap();
        }
        assert!(folder.names().is_empty());
        let error = check_writable(&folder.0).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::IsADirectory);
    }

    /// The super-user may write to it all the same, and a rename asks the folder alone.
    #[test]
    fn a_write_protected_file_is_not_replaced() {
        let folder = Folder::new("protected");
        let path = folder.0.join("log.csv");
        fs::write(&path, "measured").unwrap();
        let mut permissions = fs::metadata(&path).unwrap().permissions();
        permissions.set_readonly(true);
        fs::set_permissions(&path, permissions).unwrap();
        let error = write(&path, "new").unwrap_err();
        assert!(error.to_string().starts_with("the file is write-protected\nhint: "), "{error}");
        assert_eq!(fs::read_to_string(&path).unwrap(), "measured");
        assert_eq!(folder.names(), ["log.csv"]);
    }

    #[test]
    fn threads_that_write_beside_each_other_do_not_take_files_for_those_of_killed_programs() {
        let folder = Folder::new("threads");
        std::thread::scope(|scope| {
            for thread in 0..4 {
                let folder = &folder;
                scope.spawn(move || {
                    for file in 0..200 {
                        let path = folder.0.join(format!("{thread}_{file}.csv"));
                        check_writable(&path).unwrap();
                        WholeFile::create(&path).unwrap().finish().unwrap();
                    }
                });
            }
        });
        assert_eq!(folder.names().len(), 4 * 200);
        assert!(left_by_killed().iter().all(|path| !path.starts_with(&folder.0)));
    }

    #[test]
    fn the_same_file_twice_at_once_is_refused() {
        let folder = Folder::new("twice");
        let path = folder.0.join("out.csv");
        let first = WholeFile::create(&path).unwrap();
        let second = WholeFile::create(&path).unwrap_err();
        assert!(
            second
                .to_string()
                .contains("another program is writing this file\nhint: wait until it ends, or choose another name"),
            "{second}"
        );
        first.finish().unwrap();
        assert_eq!(folder.names(), ["out.csv"]);
    }
}
