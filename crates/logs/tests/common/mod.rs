//! What the tests of this crate share.

#![allow(dead_code, clippy::unwrap_used, reason = "a test may unwrap, and not every test uses all of it")]

pub(crate) mod mdf;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use logs::{Log, LogError, OpenOptions, Quality, Sample};

/// A file that `tests/data/make.py` made.
pub(crate) fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name)
}

pub(crate) fn with_dbc() -> OpenOptions {
    OpenOptions { dbc: Some(data("bus.dbc")), ..OpenOptions::default() }
}

/// Every sample of a log, and its notes.
pub(crate) fn read(path: &Path, options: &OpenOptions) -> Result<(Log, Vec<Sample>, Vec<String>), LogError> {
    read_on(path, options, 1)
}

/// The same, read on so many threads.
pub(crate) fn read_on(
    path: &Path,
    options: &OpenOptions,
    threads: usize,
) -> Result<(Log, Vec<Sample>, Vec<String>), LogError> {
    read_of(Log::open(path, options)?.on_threads(threads))
}

/// The samples of all channels of a log, and its notes.
pub(crate) fn read_of(mut log: Log) -> Result<(Log, Vec<Sample>, Vec<String>), LogError> {
    let all: Vec<usize> = (0..log.channels().len()).collect();
    let mut samples = log.samples(&all)?;
    let mut read = Vec::new();
    for sample in &mut samples {
        read.push(sample?);
    }
    let notes = samples.notes().to_vec();
    drop(samples);
    Ok((log, read, notes))
}

/// Times, values and qualities of a channel.
pub(crate) fn channel(log: &Log, samples: &[Sample], name: &str) -> Vec<(f64, f64, Quality)> {
    let wanted = log.find(name, None).unwrap();
    let own = samples.iter().filter(|sample| sample.channel == wanted);
    own.map(|sample| (sample.time_s, sample.value, sample.quality)).collect()
}

/// A folder that goes away with the test.
pub(crate) struct Folder(pub(crate) PathBuf);

impl Folder {
    pub(crate) fn new(name: &str) -> Self {
        static COUNT: AtomicUsize = AtomicUsize::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("wetclutch-logs-crate-{name}-{}-{count}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    pub(crate) fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
