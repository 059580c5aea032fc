//! The program as a test runs it, and a folder for its files.

use std::path::PathBuf;
use std::process::{Command, Output};
use std::sync::atomic::{AtomicUsize, Ordering};

/// The folder of the repository.
pub(crate) const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../");
/// The two-speed car.
pub(crate) const VEHICLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../vehicles/two_speed_at.toml");
/// Its first experiment.
pub(crate) const EXPERIMENT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../experiments/e1.toml");
/// The experiment of the bench, with its sensors.
pub(crate) const BENCH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../experiments/bench.toml");

/// Runs the program.
pub(crate) fn wetclutch(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_wetclutch")).args(arguments).output().unwrap()
}

pub(crate) fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

pub(crate) fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// The standard output of a command that must succeed.
pub(crate) fn printed(output: &Output) -> String {
    assert!(output.status.success(), "{}", stderr(output));
    stdout(output)
}

/// The standard error of a command that must succeed.
pub(crate) fn said(output: &Output) -> String {
    assert!(output.status.success(), "{}", stderr(output));
    stderr(output)
}

/// What a command that must succeed has printed and said.
pub(crate) fn shown(output: &Output) -> String {
    said(output) + &stdout(output)
}

/// The standard error of a command whose input must be refused.
pub(crate) fn refused(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(2), "{}{}", stdout(output), stderr(output));
    stderr(output)
}

/// Messages without the lines of files that they show.
pub(crate) fn without_excerpts(text: &str) -> String {
    let is_of_excerpt = |line: &str| {
        let rest = line.trim_start_matches(|c: char| c == ' ' || c.is_ascii_digit());
        rest.len() < line.len() && (rest.starts_with("--> ") || rest.starts_with('|'))
    };
    text.lines().filter(|line| !is_of_excerpt(line)).map(|line| line.to_owned() + "\n").collect()
}

/// A folder that goes away with the test, unless `WETCLUTCH_KEEP` is set.
pub(crate) struct Folder(PathBuf);

impl Folder {
    /// A new and empty one.
    pub(crate) fn new(name: &str) -> Self {
        static COUNT: AtomicUsize = AtomicUsize::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("wetclutch-{name}-{}-{count}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    /// A path in it.
    pub(crate) fn path(&self, name: &str) -> String {
        self.0.join(name).to_str().unwrap().to_owned()
    }

    /// Writes a file in it and returns its path.
    pub(crate) fn write(&self, name: &str, text: impl AsRef<[u8]>) -> String {
        std::fs::write(self.0.join(name), text).unwrap();
        self.path(name)
    }

    /// The text of a file in it.
    pub(crate) fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.0.join(name)).unwrap()
    }

    /// The names of its files, sorted.
    pub(crate) fn names(&self) -> Vec<String> {
        let names = std::fs::read_dir(&self.0).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<String> = names.collect();
        names.sort();
        names
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        if std::env::var_os("WETCLUTCH_KEEP").is_none() {
            let _ = std::fs::remove_dir_all(&self.0);
        }
    }
}
