//! Reading of a compressed MDF 4 file, beside asammdf and beside the decompression of its blocks alone.
//!
//! `cargo bench -p logs --bench mdf -- LOG.mf4` reads all channels of a file whose blocks are deflated; without a file, of an hour with
//! nine channels that it writes. Every time is the least of several in one process, of the processor and on one thread, with the file in the memory of
//! the system. asammdf is a rival where `python3`, or the Python of `WETCLUTCH_PYTHON`, has it.

#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark")]

mod hour;

use std::hint::black_box;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use logs::{Log, OpenOptions};

const TRIES: usize = 15;
const RIVAL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/mdf/rival.py");

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    // Tests ask only whether it starts.
    if arguments.iter().any(|argument| argument == "--test") {
        return;
    }
    let own = std::env::temp_dir().join(format!("wetclutch-mdf-{}.mf4", std::process::id()));
    let path = match arguments.first() {
        Some(path) => PathBuf::from(path),
        None => {
            hour::write(&own);
            own.clone()
        }
    };
    measure(&path);
    let _ = std::fs::remove_file(own);
}

fn measure(path: &Path) {
    let bytes = std::fs::read(path).unwrap();
    let blocks = deflated(&bytes);
    let unpacked: usize = blocks.iter().map(|block| inflate(block).len()).sum();
    println!("{} deflated blocks, {} bytes, unpacked {unpacked}", blocks.len(), bytes.len());
    let (samples, merged_s) = fastest(|| merged(path));
    println!("samples {samples}");
    let show = |what: &str, seconds: f64| {
        println!("{:9.2} ms {:6.1} million samples/s  {what}", 1e3 * seconds, 1e-6 * samples as f64 / seconds);
    };
    show("decompression of the blocks alone, with the library of the reader", {
        fastest(|| blocks.iter().map(|block| black_box(inflate(block)).len()).sum()).1
    });
    show("all channels, merged in time order, into vectors of times and of values", merged_s);
    match rival(path) {
        None => println!("asammdf was not measured: no Python with asammdf (WETCLUTCH_PYTHON names one)"),
        Some([select_s, inflate_s]) => {
            show("decompression of the blocks alone, with the library of asammdf", inflate_s);
            show("asammdf: all channels, each into arrays of times and of values", select_s);
            println!("asammdf takes {:.2} of the time of this reader", select_s / merged_s);
        }
    }
}

/// The result of a job and its least time, s.
fn fastest(mut job: impl FnMut() -> usize) -> (usize, f64) {
    let start = Instant::now();
    let mut best = (0, f64::INFINITY);
    for _ in 0..TRIES {
        let began = now_s(start);
        let result = job();
        best = (result, (now_s(start) - began).min(best.1));
    }
    best
}

/// Time of the processor that the program has used, s, which others on the machine do not change; where the system does not say it,
/// the time since `start`.
fn now_s(start: Instant) -> f64 {
    let of_system = std::fs::read_to_string("/proc/self/schedstat").ok();
    let used_ns = of_system.and_then(|text| text.split_whitespace().next()?.parse::<f64>().ok());
    used_ns.map_or(start.elapsed().as_secs_f64(), |ns| 1e-9 * ns)
}

/// Reads all samples of all channels.
fn merged(path: &Path) -> usize {
    let mut log = Log::open(path, &OpenOptions::default()).unwrap();
    let all: Vec<usize> = (0..log.channels().len()).collect();
    let mut channels = vec![(Vec::new(), Vec::new()); all.len()];
    for sample in log.samples(&all).unwrap() {
        let sample = sample.unwrap();
        let (times_s, values) = &mut channels[sample.channel];
        times_s.push(sample.time_s);
        values.push(sample.value);
    }
    black_box(&channels).iter().map(|(times_s, _)| times_s.len()).sum()
}

/// The contents of the deflated blocks of a file.
fn deflated(bytes: &[u8]) -> Vec<&[u8]> {
    const HEADER: usize = 48;
    let length = |at: usize| usize::try_from(u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap())).unwrap();
    let is_block = |at: &usize| bytes[*at..].starts_with(b"##DZ");
    let blocks = (0..bytes.len().saturating_sub(HEADER)).step_by(8).filter(is_block);
    blocks.map(|at| &bytes[at + HEADER..at + HEADER + length(at + 40)]).collect()
}

fn inflate(block: &[u8]) -> Vec<u8> {
    let mut unpacked = Vec::with_capacity(4 << 20);
    flate2::bufread::ZlibDecoder::new(block).read_to_end(&mut unpacked).unwrap();
    unpacked
}

/// Times of asammdf and of its decompression, s.
fn rival(path: &Path) -> Option<[f64; 2]> {
    let python = std::env::var_os("WETCLUTCH_PYTHON").unwrap_or_else(|| "python3".into());
    let output = Command::new(python).arg(RIVAL).arg(path).arg(TRIES.to_string()).output().ok()?;
    let text = String::from_utf8(output.stdout).ok().filter(|_| output.status.success())?;
    let mut times = text.split_whitespace().filter_map(|word| word.parse().ok());
    Some([times.next()?, times.next()?])
}
