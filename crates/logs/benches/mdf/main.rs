//! Reading of MDF 4 and of Parquet, beside asammdf and pyarrow and beside the decompression of the blocks alone.
//!
//! `cargo bench -p logs --bench mdf -- LOG` reads all channels of a log; without a file, of an hour with nine channels that it writes as
//! MDF with transposed and deflated blocks, and as Parquet. Every time is the minimum of several in one process, with the file in the
//! memory of the system: of the processor on one thread, and by the clock on all processors. A rival is measured where `python3`, or the
//! Python of
//! `WETCLUTCH_PYTHON`, has it; what it decodes must have the same sums. `-- LOG --only columns` (or `arrays`, `merged`) reads once, for a
//! profiler.

#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark")]

mod hour;

use std::fs::File;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use libdeflater::Decompressor;
use logs::{Arrays, Column, Log, OpenOptions, Quality};
use parquet::file::reader::{FileReader, SerializedFileReader};

const TRIES: usize = 25;
const RIVAL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/mdf/rival.py");

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    // Tests ask only whether it starts.
    if arguments.iter().any(|argument| argument == "--test") {
        return;
    }
    match &arguments[..] {
        [path, only, job] if only == "--only" => println!("{:?}", job_of(job)(Path::new(path))),
        [path] => measure(Path::new(path)),
        _ => {
            for ending in ["mf4", "parquet"] {
                let path = std::env::temp_dir().join(format!("wetclutch-hour-{}.{ending}", std::process::id()));
                hour::write(&path);
                measure(&path);
                std::fs::remove_file(path).unwrap();
            }
        }
    }
}

fn job_of(name: &str) -> fn(&Path) -> usize {
    match name {
        "columns" => columns,
        "arrays" => |path| arrays(path, 1).blocks.len(),
        _ => merged,
    }
}

fn measure(path: &Path) {
    // The system's allocator keeps memory of this size from now on, so that no time below is one of taking it anew. The rival is told to keep
    // it, too.
    drop(black_box(vec![1_u8; 31 << 20]));
    let bytes = std::fs::read(path).unwrap();
    let blocks = deflated(&bytes);
    let unpacked: usize = blocks.iter().map(|(_, size)| size).sum();
    let (samples, columns_s) = fastest(|| columns(path));
    println!("{}: {} bytes, {samples} values", path.display(), bytes.len());
    let show = |what: &str, seconds: f64| {
        println!("{:9.2} ms {:7.1} million samples/s  {what}", 1e3 * seconds, 1e-6 * samples as f64 / seconds);
    };
    let mut floor_s = None;
    if !blocks.is_empty() {
        println!("{} deflated blocks, unpacked {unpacked} bytes", blocks.len());
        let mut memory = vec![0; blocks.iter().map(|(_, size)| *size).max().unwrap_or(0)];
        let (_, alone_s) = fastest(|| inflated(&blocks, &AtomicUsize::new(0), &mut memory));
        show("decompression of the blocks alone", alone_s);
        floor_s = Some(alone_s);
        let mut memories = vec![memory.clone(); processors()];
        show(
            "the same on all processors, by the clock",
            fastest_by(by_clock_s, || all_inflated(&blocks, &mut memories)).1,
        );
        let mut inflate = |(block, size): &(&[u8], usize)| {
            let finish = flate2::FlushDecompress::Finish;
            flate2::Decompress::new(true).decompress(block, &mut memory[..*size], finish).unwrap();
            usize::from(black_box(&memory)[0])
        };
        show("the same with flate2 (zlib-rs)", fastest(|| blocks.iter().map(&mut inflate).sum::<usize>()).1);
    }
    show("all channels in columns, some thousand records at once", columns_s);
    let (_, columns_by_clock_s) = fastest_by(by_clock_s, || columns_on(path, processors()));
    show("the same with blocks unpacked ahead on all processors, by the clock", columns_by_clock_s);
    let (read, arrays_s) = fastest(|| arrays(path, 1));
    show("all channels as whole arrays of times and of values", arrays_s);
    let (_, arrays_by_clock_s) = fastest_by(by_clock_s, || arrays(path, processors()));
    show("the same on all processors, by the clock", arrays_by_clock_s);
    let lengths = || read.blocks.iter().flat_map(|block| vec![block.times_s.len(); 1 + block.columns.len()]);
    let fresh = || black_box(lengths().map(|length| vec![1.0; length]).collect::<Vec<Vec<f64>>>()).len();
    show("memory for these arrays alone: fresh, and written once", fastest(fresh).1);
    if path.extension().is_some_and(|ending| ending == "parquet") {
        show("pages of all columns, read and unpacked alone", fastest(|| pages(path)).1);
    }
    let columns = || read.blocks.iter().flat_map(|block| &block.columns);
    let sum = columns().map(|column| column.values.iter().filter(|value| value.is_finite()).sum::<f64>()).sum();
    let (count_merged, merged_s) = fastest(|| merged(path));
    show("all channels, merged in time order", merged_s);
    assert_eq!(count_merged, samples);
    let Some([rival_s, rival_by_clock_s, rival_sum, inflate_s]) = rival(path) else {
        println!("no rival: no Python with asammdf and pyarrow (WETCLUTCH_PYTHON names one)");
        return;
    };
    assert!(is_same(sum, rival_sum), "{sum} {rival_sum}");
    if inflate_s > 0.0 {
        show("decompression of the blocks alone, with the library of the rival", inflate_s);
    }
    show("the rival (asammdf, pyarrow): all channels, each as an array of values, and the times", rival_s);
    show("the same on all processors, by the clock", rival_by_clock_s);
    let by_clock = [
        ("columns on all processors, by the clock", columns_by_clock_s, rival_by_clock_s),
        ("whole arrays on all processors, by the clock", arrays_by_clock_s, rival_by_clock_s),
    ];
    if let Some(floor_s) = floor_s {
        println!("the rival takes {:.2} times as long as our decompression of the blocks alone", rival_s / floor_s);
    }
    let on_one = [("columns", columns_s), ("whole arrays", arrays_s), ("merged", merged_s)];
    for (what, seconds, rival_s) in on_one.map(|(what, seconds)| (what, seconds, rival_s)).into_iter().chain(by_clock) {
        println!("the rival takes {:.2} times as long as {what}", rival_s / seconds);
    }
}

/// Whether two sums in different orders are of the same values.
fn is_same(one: f64, other: f64) -> bool {
    (one - other).abs() <= 1e-9 * one.abs().max(1.0)
}

fn processors() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// The result of a job and its minimum time of the processor, s.
fn fastest<T>(job: impl FnMut() -> T) -> (T, f64) {
    fastest_by(used_s, job)
}

/// The result of a job and its minimum time by a clock, s.
fn fastest_by<T>(clock: fn(Instant) -> f64, mut job: impl FnMut() -> T) -> (T, f64) {
    let start = Instant::now();
    let mut timed = || {
        let began_s = clock(start);
        let result = job();
        (result, clock(start) - began_s)
    };
    let first = timed();
    (1..TRIES).fold(first, |best, _| {
        let (result, seconds) = timed();
        (result, seconds.min(best.1))
    })
}

/// Time of the processor that the program has used, s, which others on the machine change little; where it is not known, the time
/// since `start`.
fn used_s(start: Instant) -> f64 {
    #[cfg(unix)]
    {
        let used = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
        let _ = start;
        used.tv_sec as f64 + 1e-9 * used.tv_nsec as f64
    }
    #[cfg(not(unix))]
    start.elapsed().as_secs_f64()
}

fn by_clock_s(start: Instant) -> f64 {
    start.elapsed().as_secs_f64()
}

fn opened(path: &Path) -> (Log, Vec<usize>) {
    let log = Log::open(path, &OpenOptions::default()).unwrap();
    let all = (0..log.channels().len()).collect();
    (log, all)
}

/// Reads all channels in columns, and counts their values.
fn columns(path: &Path) -> usize {
    columns_on(path, 1)
}

fn columns_on(path: &Path, threads: usize) -> usize {
    let (log, all) = opened(path);
    let mut log = log.on_threads(threads);
    let mut columns = log.columns(&all).unwrap();
    let mut count = 0;
    while let Some(block) = columns.next_block().unwrap() {
        count += block.columns.iter().map(present).sum::<usize>();
        black_box(block);
    }
    count
}

fn present(column: &Column) -> usize {
    match column.qualities.len() {
        0 => column.values.len(),
        _ => column.qualities.iter().flatten().count(),
    }
}

/// Reads all channels as whole arrays.
fn arrays(path: &Path, threads: usize) -> Arrays {
    let (mut log, all) = opened(path);
    log.arrays(&all, threads).unwrap()
}

/// Reads and unpacks the pages of a Parquet file, without their numbers; how many bytes they have.
fn pages(path: &Path) -> usize {
    let file = SerializedFileReader::new(File::open(path).unwrap()).unwrap();
    let mut bytes = 0;
    for group in (0..file.num_row_groups()).map(|group| file.get_row_group(group).unwrap()) {
        for column in 0..group.num_columns() {
            let pages = group.get_column_page_reader(column).unwrap();
            bytes += pages.map(|page| black_box(page.unwrap()).buffer().len()).sum::<usize>();
        }
    }
    bytes
}

/// Reads all samples in time order, and counts them.
fn merged(path: &Path) -> usize {
    let (mut log, all) = opened(path);
    log.samples(&all)
        .unwrap()
        .map(|sample| black_box(sample.unwrap()))
        .filter(|sample| sample.quality == Quality::Good)
        .count()
}

/// Unpacks the blocks from `next` on; their bytes.
fn inflated(blocks: &[(&[u8], usize)], next: &AtomicUsize, memory: &mut [u8]) -> usize {
    let mut inflater = Decompressor::new();
    let mut bytes = 0;
    while let Some((block, size)) = blocks.get(next.fetch_add(1, Ordering::Relaxed)) {
        bytes += inflater.zlib_decompress(block, &mut memory[..*size]).unwrap() + usize::from(black_box(&*memory)[0]);
    }
    bytes
}

/// The same, on a thread for each memory.
fn all_inflated(blocks: &[(&[u8], usize)], memories: &mut [Vec<u8>]) -> usize {
    let next = AtomicUsize::new(0);
    let from_next = |memory: &mut Vec<u8>| inflated(blocks, &next, memory);
    let (own, others) = memories.split_first_mut().unwrap();
    std::thread::scope(|scope| {
        let others: Vec<_> = others.iter_mut().map(|memory| scope.spawn(|| from_next(memory))).collect();
        from_next(own) + others.into_iter().map(|other| other.join().unwrap()).sum::<usize>()
    })
}

/// The contents of the deflated blocks of an MDF file, and the bytes that they unpack to.
fn deflated(bytes: &[u8]) -> Vec<(&[u8], usize)> {
    const HEADER: usize = 48;
    let number = |at: usize| usize::try_from(u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap())).unwrap();
    // Some writers do not align their blocks.
    let is_block = |at: &usize| bytes[*at..].starts_with(b"##DZ\0\0\0\0");
    let blocks = (0..bytes.len().saturating_sub(HEADER)).filter(is_block);
    blocks.map(|at| (&bytes[at + HEADER..at + HEADER + number(at + 40)], number(at + 32))).collect()
}

/// Time of the rival on one thread, s, and on all by the clock, s, the sum of what it decoded, and the time of its decompression alone, s; that
/// is 0 where there is none.
fn rival(path: &Path) -> Option<[f64; 4]> {
    let python = std::env::var_os("WETCLUTCH_PYTHON").map_or_else(|| PathBuf::from("python3"), PathBuf::from);
    let mut command = Command::new(python);
    command.arg(RIVAL).arg(path).arg(TRIES.to_string());
    command.env("MALLOC_MMAP_THRESHOLD_", "1000000000").env("MALLOC_TRIM_THRESHOLD_", "4000000000");
    let output = command.output().ok()?;
    let text = String::from_utf8(output.stdout).ok().filter(|_| output.status.success())?;
    let numbers: Vec<f64> = text.split_whitespace().filter_map(|word| word.parse().ok()).collect();
    numbers.try_into().ok()
}
