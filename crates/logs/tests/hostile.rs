//! Broken files of every format: cut, with flipped bytes, with absurd lengths. Each gives an error or a readable part with a
//! note; none a panic, a hang or a large allocation.

use std::time::{Duration, Instant};

use crate::common::{Folder, data, read_on, with_dbc};
use logs::OpenOptions;
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::{Rng, SeedableRng};

/// The most memory that this process has held so far, bytes, where the system says it (Linux).
fn max_memory() -> Option<usize> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix(" kB")?.parse::<usize>().ok().map(|kilobytes| kilobytes << 10)
}

const FILES: [&str; 25] = [
    "plain_400.mf4",
    "plain_420.mf4",
    "deflate.mf4",
    "transposed.mf4",
    "blocks.mf4",
    "zstd.mf4",
    "lz4.mf4",
    "invalidation.mf4",
    "unsorted.mf4",
    "half.mf4",
    "remote.mf4",
    "bus.mf4",
    "bus.blf",
    "fd.blf",
    "bus.asc",
    "fd.asc",
    "bus.log",
    "snappy.parquet",
    "gzip.parquet",
    "zstd.parquet",
    "polars.parquet",
    "stamps.parquet",
    "types.parquet",
    "types_old.parquet",
    "made_with.txt",
];

/// Reads a broken file; its samples, if it can be read, and what was said.
fn attempt(folder: &Folder, name: &str, bytes: &[u8]) -> (usize, String) {
    const SLOWEST: Duration = Duration::from_secs(20);
    const LARGEST: usize = 256 << 20;
    let path = folder.write("broken", bytes);
    let options = if name.ends_with("f4") && !name.starts_with("bus") || name.ends_with("parquet") {
        OpenOptions::default()
    } else {
        with_dbc()
    };
    let start = Instant::now();
    let before = max_memory();
    let on_threads = |threads| match read_on(&path, &options, threads) {
        Ok((_, samples, notes)) => {
            assert!(samples.iter().all(|sample| sample.time_s.is_finite()), "{name}");
            (samples.len(), notes.join("\n"))
        }
        Err(error) => (0, error.to_string()),
    };
    let result = on_threads(1);
    if name == "blocks.mf4" {
        assert_eq!(on_threads(3), result);
    }
    assert!(start.elapsed() < SLOWEST, "{name}: {:?}", start.elapsed());
    if let (Some(before), Some(after)) = (before, max_memory()) {
        // The system counts by thread and joins the counts now and then.
        let more = after.saturating_sub(before);
        assert!(more < LARGEST, "{name}: {more} bytes: {}", result.1);
    }
    result
}

#[test]
fn broken_files_give_errors_or_what_can_be_read() {
    let folder = Folder::new("hostile");
    // More of them where there is time: `WETCLUTCH_FLIPS=20000 WETCLUTCH_ONLY=parquet cargo test -p logs --test tests hostile`.
    let flips = std::env::var("WETCLUTCH_FLIPS").ok().and_then(|flips| flips.parse().ok()).unwrap_or(100);
    let only = std::env::var("WETCLUTCH_ONLY").unwrap_or_default();
    for name in FILES.into_iter().filter(|name| name.contains(&only)) {
        let whole = std::fs::read(data(name)).unwrap();
        let binary = !matches!(name.rsplit_once('.'), Some((_, "asc" | "log" | "txt")));
        let (all, _) = attempt(&folder, name, &whole);
        for end in (0..whole.len()).step_by(64) {
            let (samples, said) = attempt(&folder, name, &whole[..end]);
            assert!(samples <= all, "{name} cut at {end}");
            // A text log that is cut between two lines is a shorter log.
            assert!(!binary || !said.is_empty(), "{name} cut at {end}: {samples} of {all} samples, nothing said");
        }
        let mut generator = Pcg64Mcg::seed_from_u64(13);
        for _ in 0..flips {
            let mut broken = whole.clone();
            for _ in 0..1 + generator.next_u32() % 8 {
                let at = generator.next_u64() as usize % broken.len();
                broken[at] = match generator.next_u32() % 4 {
                    0 => 0xff,
                    1 => 0,
                    2 => broken[at] ^ 1 << (generator.next_u32() % 8),
                    _ => generator.next_u32() as u8,
                };
            }
            // Some are cut besides.
            if generator.next_u32() % 4 == 0 {
                broken.truncate(generator.next_u64() as usize % broken.len());
            }
            attempt(&folder, name, &broken);
        }
        // Absurd lengths: every field of eight bytes in turn becomes huge.
        let fields = if binary { whole.len() - 8 } else { 0 };
        for (at, huge) in
            (0..fields).step_by(8).zip([u64::MAX, i64::MAX as u64, 1 << 40, 0xffff_ffff].into_iter().cycle())
        {
            let mut broken = whole.clone();
            broken[at..at + 8].copy_from_slice(&huge.to_le_bytes());
            attempt(&folder, name, &broken);
        }
    }
}

#[test]
fn a_broken_dbc_is_an_error() {
    let folder = Folder::new("dbc");
    let whole = std::fs::read(data("bus.dbc")).unwrap();
    let mut generator = Pcg64Mcg::seed_from_u64(13);
    for i in 0..400 {
        let mut broken = whole.clone();
        match i % 2 {
            0 => broken.truncate(generator.next_u64() as usize % whole.len()),
            _ => {
                let at = generator.next_u64() as usize % whole.len();
                broken[at] = generator.next_u32() as u8;
            }
        }
        let _ = logs::can::Database::read(&folder.write("broken.dbc", &broken));
    }
    let error = logs::can::Database::read(&folder.write("wrong.dbc", "hello")).unwrap_err().to_string();
    assert!(error.contains("this is no DBC that can be read"), "{error}");
}

#[test]
fn a_text_that_is_no_dbc_or_map_is_named_by_its_line_and_not_repeated() {
    let folder = Folder::new("named-by-line");
    let long = "x".repeat(1 << 20);
    for text in ["VERSION \"\"\nBO_ 1 \u{1b}[31mM: 8 X\n", &format!("VERSION \"\"\nBO_ 1 {long}")] {
        let path = folder.write("wrong.dbc", text);
        let error = logs::can::Database::read(&path).unwrap_err().to_string();
        assert!(
            error.starts_with(&format!("{}: line 2: this is no DBC that can be read: ", path.display())),
            "{error}"
        );
        assert!(error.len() < 1000 && !error.contains('\u{1b}'), "{error:?}");
    }
    for (line, text) in [
        (2, "[time]\nname = \u{1b}[31m\n"),
        (3, &format!("[time]\n\nname = {long}\n")),
        (3, "[time]\nname = \"t\"\n\"\\u001b[31m\" = 1\n"),
        (2, "[channel.engine_speed]\nname = [1]\n"),
    ] {
        let path = folder.write("map.toml", text);
        let error = logs::ChannelMap::read(&path).unwrap_err().to_string();
        assert!(error.starts_with(&format!("{}:{line}: ", path.display())), "{error}");
        assert!(error.len() < 1000 && !error.contains('\u{1b}'), "{error:?}");
    }
}
