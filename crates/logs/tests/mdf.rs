//! MDF files that a test writes: every compression, and blocks that end anywhere.

use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use crate::common::mdf::{HEAD, append, block, number, places, set};
use crate::common::{Folder, channel, data, read, read_of};
use falcon_mdf::Mf4Writer;
use falcon_mdf::write::WriteCodec;
use logs::{Log, OpenOptions, Quality, Sample};
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::{Rng, SeedableRng};

#[test]
fn blocks_of_every_compression_give_the_same_samples() {
    let folder = Folder::new("codecs");
    let times: Vec<f64> = (0..5000).map(|i| f64::from(i) * 0.01).collect();
    let speed: Vec<f64> = times.iter().map(|t| 200.0 + 50.0 * t.sin()).collect();
    let codecs = [
        WriteCodec::Deflate,
        WriteCodec::TransposedDeflate,
        WriteCodec::Zstd,
        WriteCodec::TransposedZstd,
        WriteCodec::Lz4,
        WriteCodec::TransposedLz4,
    ];
    let read_with = |codec: Option<WriteCodec>| {
        let mut writer = Mf4Writer::new();
        writer.set_compression(codec.is_some());
        writer.set_codec(codec.unwrap_or_default());
        writer.add_group(&times).unwrap().add_channel("speed", "rad/s", &speed).unwrap();
        let path = folder.0.join("log.mf4");
        writer.write_to_file(&path).unwrap();
        let (log, samples, notes) = read(&path, &OpenOptions::default()).unwrap();
        assert!(notes.is_empty(), "{codec:?}: {notes:?}");
        (channel(&log, &samples, "speed"), std::fs::metadata(&path).unwrap().len())
    };
    let (plain, size) = read_with(None);
    assert_eq!(plain.len(), 5000);
    for codec in codecs {
        let (samples, compressed) = read_with(Some(codec));
        assert_eq!(samples, plain, "{codec:?}");
        assert!(compressed < size, "{codec:?}: {compressed} of {size}");
    }
}

#[test]
fn frames_of_a_bus_without_a_dbc_and_a_dbc_without_frames_are_reported() {
    let dbc = OpenOptions { dbc: Some(data("bus.dbc")), ..OpenOptions::default() };
    let (log, _, notes) = read(&data("bus.mf4"), &OpenOptions::default()).unwrap();
    let said = "there are frames of a CAN bus, whose signals are not read\nhint: a DBC defines the signals in them: give it with --dbc";
    assert!(notes.iter().any(|note| note == said), "{notes:?}");
    let error = log.find("N_Eng", None).unwrap_err().to_string();
    assert!(
        error.ends_with("hint: the signals of its CAN frames are known only with a DBC: give it with --dbc"),
        "{error}"
    );
    let without_effect = logs::log::NO_FRAMES;
    let has_effect = |file: &str| !read(&data(file), &dbc).unwrap().2.iter().any(|note| note == without_effect);
    assert!(has_effect("bus.mf4") && has_effect("bus.log"));
    assert!(!has_effect("plain_410.mf4") && !has_effect("zstd.parquet"));
    let folder = Folder::new("dbc-for-a-table");
    let (_, _, notes) = read(&folder.write("log.csv", "time_s,N [rpm]\n0,1\n1,2\n"), &dbc).unwrap();
    assert_eq!(notes, [without_effect]);
}

/// How a block is stored.
#[derive(Debug, Clone, Copy)]
enum Packing {
    Plain,
    Deflated,
    /// Transposed, with rows of so many bytes.
    Transposed(usize),
}

fn packed(content: &[u8], packing: Packing, id: &[u8; 2]) -> Vec<u8> {
    let (kind, columns) = match packing {
        Packing::Plain => return block(&[b'#', b'#', id[0], id[1]], &[], content),
        Packing::Deflated => (0_u8, 0),
        Packing::Transposed(columns) => (1, columns),
    };
    let rows = content.len().checked_div(columns).unwrap_or(0);
    let (table, tail) = content.split_at(rows * columns);
    let transposed = (0..columns).flat_map(|column| table.iter().skip(column).step_by(columns)).chain(tail).copied();
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(&transposed.collect::<Vec<u8>>()).unwrap();
    let deflated = encoder.finish().unwrap();
    let columns = u32::try_from(columns).unwrap().to_le_bytes();
    let sizes = [content.len(), deflated.len()].map(|size| (size as u64).to_le_bytes()).concat();
    block(b"##DZ", &[], &[id, [kind, 0].as_slice(), &columns, &sizes, &deflated].concat())
}

/// What stands in the plain block of data to which a link leads, itself or over a list of one.
fn content_of(bytes: &[u8], link: usize) -> Vec<u8> {
    let at = number(bytes, link);
    if bytes[at..].starts_with(b"##LD") {
        return content_of(bytes, at + HEAD + 8);
    }
    assert!(bytes[at..].starts_with(b"##DT") || bytes[at..].starts_with(b"##DV"));
    bytes[at + HEAD..at + number(bytes, at + 8)].to_vec()
}

/// The file with the data of each group, which must be one plain block, in several that are cut at these places, and in the other groups behind
/// them.
fn divided(mut bytes: Vec<u8>, cuts: &[usize], packing: impl Fn(usize) -> Packing) -> Vec<u8> {
    for (nth, group) in places(&bytes, b"##DG\0\0\0\0").into_iter().enumerate() {
        let link = group + HEAD + 16;
        let content = content_of(&bytes, link);
        let mut ends: Vec<usize> =
            cuts.iter().map(|cut| (cut + 61 * nth) % content.len()).chain([content.len()]).collect();
        ends.sort_unstable();
        // The list stands before its blocks, as recorders write it.
        let (mut from, mut links, mut offsets) = (0, vec![0], Vec::new());
        let count = u32::try_from(ends.len()).unwrap().to_le_bytes();
        let list_of = |links: &[usize], offsets: &[u8]| block(b"##DL", links, &[&[0; 4], &count, offsets].concat());
        let list = append(&mut bytes, &list_of(&vec![0; 1 + ends.len()], &vec![0; 8 * ends.len()]));
        for (i, end) in ends.into_iter().enumerate() {
            links.push(append(&mut bytes, &packed(&content[from..end], packing(i), b"DT")));
            offsets.extend((from as u64).to_le_bytes());
            from = end;
        }
        let filled = list_of(&links, &offsets);
        bytes[list..list + filled.len()].copy_from_slice(&filled);
        set(&mut bytes, link, list);
    }
    bytes
}

fn samples(path: &Path) -> (Vec<Sample>, Vec<String>) {
    let (_, samples, notes) = read(path, &OpenOptions::default()).unwrap();
    (samples, notes)
}

#[test]
fn records_lie_over_the_ends_of_blocks() {
    let folder = Folder::new("blocks");
    let mut generator = Pcg64Mcg::seed_from_u64(4);
    for name in ["plain_410.mf4", "invalidation.mf4", "unsorted.mf4"] {
        let (whole, _) = samples(&data(name));
        assert!(whole.len() > 40, "{name}");
        let bytes = std::fs::read(data(name)).unwrap();
        for case in 0..60 {
            let cuts: Vec<usize> = (0..case % 6).map(|_| generator.next_u32() as usize).collect();
            let columns = generator.next_u32() as usize % 30 + 1;
            let packing = |i: usize| match (case + i) % 3 {
                0 => Packing::Plain,
                1 => Packing::Deflated,
                _ => Packing::Transposed(columns),
            };
            let path = folder.write("divided.mf4", divided(bytes.clone(), &cuts, packing));
            let (found, notes) = samples(&path);
            // What cannot be a number is not the same as itself.
            assert_eq!(format!("{found:?}"), format!("{whole:?}"), "{name} {cuts:?} {columns}");
            assert_eq!(notes, Vec::<String>::new(), "{name} {cuts:?}");
        }
    }
}

#[test]
fn a_damaged_block_is_told_by_its_place_and_what_is_before_it_is_read() {
    let folder = Folder::new("damaged-block");
    let whole = samples(&data("unsorted.mf4")).0.len();
    let bytes = std::fs::read(data("unsorted.mf4")).unwrap();
    // Somewhere in the middle of the only block of records, where one of them begins, its identifier is one that no group has.
    let two = divided(bytes.clone(), &[200], |_| Packing::Plain);
    let group = places(&two, b"##DG\0\0\0\0")[0];
    let second = number(&two, number(&two, group + HEAD + 16) + HEAD + 16);
    let mut said = 0;
    for at in 0..24 {
        let mut broken = two.clone();
        broken[second + HEAD + at] = 0xee;
        let (found, notes) = samples(&folder.write("broken.mf4", &broken));
        assert!(found.len() <= whole);
        // Other bytes are times and values.
        if let Some(note) =
            notes.iter().find(|note| note.contains("a record has the identifier 238, which no group has"))
        {
            said += 1;
            assert!(note.contains("group `") && note.ends_with("hint: the log is read up to this place"), "{note}");
        }
    }
    assert!(said > 0);

    // (Mixed records are unpacked when the file is opened.)
    let whole = samples(&data("plain_410.mf4")).0.len();
    let bytes = std::fs::read(data("plain_410.mf4")).unwrap();
    let mut huge = divided(bytes, &[200], |_| Packing::Deflated);
    let place = *places(&huge, b"##DZ\0\0\0\0").last().unwrap();
    huge[place + 32..place + 40].copy_from_slice(&(200_u64 << 20).to_le_bytes());
    let (found, notes) = samples(&folder.write("huge.mf4", &huge));
    assert!(!found.is_empty() && found.len() < whole);
    assert!(
        notes[0].contains(&format!("block at byte {place}: its stated unpacked size is 209715200 bytes")),
        "{notes:?}"
    );
}

/// The file with the data of each group, which must be one plain block, in two blocks of data and two of invalidation bits.
fn with_bits_apart(mut bytes: Vec<u8>, packing: impl Fn(usize, usize) -> Packing) -> Vec<u8> {
    const FLAGS: u32 = 0x8000_0001;
    for group in places(&bytes, b"##DG\0\0\0\0") {
        let (channels, link) = (number(&bytes, group + HEAD + 8), group + HEAD + 16);
        let content = content_of(&bytes, link);
        // Behind six links: identifier, number of records, flags; then the bytes of data and of invalidation bits.
        let sizes = channels + HEAD + 48 + 24;
        let size = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        let (data, bits) = (size(sizes), size(sizes + 4));
        if bits == 0 {
            continue;
        }
        let parts = |from: usize, to: usize| {
            content.chunks(data + bits).flat_map(|record| record[from..to].to_vec()).collect::<Vec<u8>>()
        };
        let equal = (content.len() / (data + bits) / 2 * data) as u64;
        let own = [FLAGS.to_le_bytes(), 2_u32.to_le_bytes()].concat();
        let list_of = |links: &[usize]| block(b"##LD", links, &[own.as_slice(), &equal.to_le_bytes()].concat());
        let list = append(&mut bytes, &list_of(&[0; 5]));
        let mut links = vec![0];
        for (nth, (part, width)) in [(parts(0, data), data), (parts(data, data + bits), bits)].into_iter().enumerate() {
            let cut = part.len() / width / 2 * width;
            for half in [&part[..cut], &part[cut..]] {
                let id = if nth == 0 { b"DV" } else { b"DI" };
                links.push(append(&mut bytes, &packed(half, packing(nth, width), id)));
            }
        }
        let filled = list_of(&links);
        bytes[list..list + filled.len()].copy_from_slice(&filled);
        set(&mut bytes, link, list);
    }
    bytes
}

#[test]
fn invalidation_bits_in_blocks_of_their_own_are_read() {
    let folder = Folder::new("bits-apart");
    let whole = samples(&data("invalidation.mf4"));
    assert!(whole.0.iter().any(|sample| sample.quality == Quality::Invalid));
    let bytes = std::fs::read(data("invalidation.mf4")).unwrap();
    let packings: [fn(usize, usize) -> Packing; 3] = [
        |_, _| Packing::Plain,
        |nth, _| if nth == 0 { Packing::Deflated } else { Packing::Plain },
        |_, width| Packing::Transposed(width),
    ];
    for packing in packings {
        let found = samples(&folder.write("apart.mf4", with_bits_apart(bytes.clone(), packing)));
        assert_eq!(format!("{found:?}"), format!("{whole:?}"));
    }
}

#[test]
fn records_of_groups_with_one_time_lie_over_the_ends_of_blocks_differently() {
    let folder = Folder::new("remote-blocks");
    let whole = samples(&data("remote.mf4"));
    assert_eq!(whole.0.len(), 80);
    let bytes = std::fs::read(data("remote.mf4")).unwrap();
    for cut in 1..40 {
        let found = samples(&folder.write(
            "remote.mf4",
            divided(bytes.clone(), &[cut * 37], |i| match i {
                0 => Packing::Deflated,
                _ => Packing::Transposed(cut % 9 + 1),
            }),
        ));
        assert_eq!(format!("{found:?}"), format!("{whole:?}"), "{cut}");
    }
}

#[test]
fn channels_that_are_not_over_time_are_named_with_their_group() {
    let folder = Folder::new("over-an-angle");
    let patched = |name: &str, kind: u8, at: usize, value: u8| {
        let mut bytes = std::fs::read(data(name)).unwrap();
        // Of a channel: eight links, then what it is and what it is over.
        for channel in places(&bytes, b"##CN\0\0\0\0").into_iter().map(|at| at + HEAD + 64) {
            if bytes[channel] == kind {
                bytes[channel + at] = value;
            }
        }
        let (log, _, notes) = read(&folder.write("patched.mf4", bytes), &OpenOptions::default()).unwrap();
        assert_eq!(log.channels(), []);
        notes
    };
    let notes = patched("plain_410.mf4", 2, 1, 2);
    assert!(
        notes[0].starts_with("3 channels are not over time and are left out: N_Eng (group `fast`, over an angle), "),
        "{notes:?}"
    );
    // Its master is an ordinary channel now.
    let notes = patched("remote.mf4", 2, 0, 0);
    assert!(notes[0].contains("N_Eng (group `") && notes[0].contains("`, no time)"), "{notes:?}");
}

/// The records of a group, as a writer divides them that fills blocks: in many, each with a number of whole records.
fn in_many_blocks(bytes: Vec<u8>, record: usize, packing: impl Fn(usize) -> Packing) -> Vec<u8> {
    let cuts: Vec<usize> = (1..40).map(|i| i * 16 * record).collect();
    divided(bytes, &cuts, packing)
}

/// Everything that is read of a log on so many threads, in every way.
fn in_every_way(path: &Path, threads: usize) -> String {
    let open = || Log::open(path, &OpenOptions::default()).unwrap().on_threads(threads);
    let mut log = open();
    let all: Vec<usize> = (0..log.channels().len()).collect();
    let mut samples = log.samples(&all).unwrap();
    let read: Vec<_> = samples.by_ref().map(|sample| format!("{sample:?}")).collect();
    let merged = format!("{read:?} {:?}", samples.notes());
    let mut log = open();
    let mut columns = log.columns(&all).unwrap();
    let mut read = Vec::new();
    while let Some(block) = columns.next_block().unwrap() {
        read.push(format!("{block:?}"));
    }
    let in_columns = format!("{read:?} {:?}", columns.notes());
    format!("{merged} {in_columns} {:?}", open().arrays(&all, threads).unwrap())
}

/// Two clocks with 1500 records each of 24 bytes, which are not packed.
fn two_clocks(folder: &Folder) -> Vec<u8> {
    let mut writer = Mf4Writer::new();
    writer.set_compression(false);
    for step_s in [0.01, 0.013] {
        let times: Vec<f64> = (0..1500).map(|i| f64::from(i) * step_s).collect();
        let group = writer.add_group(&times).unwrap();
        for name in ["one", "two"] {
            let values: Vec<f64> = times.iter().map(|time_s| (time_s * 3.0).sin() * 100.0).collect();
            group.add_channel(name, "", &values).unwrap();
        }
    }
    let path = folder.0.join("two.mf4");
    writer.write_to_file(&path).unwrap();
    std::fs::read(path).unwrap()
}

/// One of the tests with threads at a time, so that one can count its own.
static ALONE: Mutex<()> = Mutex::new(());

#[test]
fn what_is_read_is_the_same_on_any_number_of_threads() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = Folder::new("threads");
    let plain = two_clocks(&folder);
    let whole = samples(&folder.write("plain.mf4", &plain));
    assert_eq!(whole.0.len(), 6_000);
    let packings: [fn(usize) -> Packing; 4] = [
        |_| Packing::Deflated,
        |_| Packing::Transposed(24),
        |_| Packing::Transposed(7),
        |i| [Packing::Plain, Packing::Deflated, Packing::Transposed(24)][i % 3],
    ];
    for (at, packing) in packings.into_iter().enumerate() {
        let mut bytes = in_many_blocks(plain.clone(), 24, packing);
        let good = folder.write("good.mf4", &bytes);
        assert_eq!(format!("{:?}", samples(&good)), format!("{whole:?}"), "{at}");
        // One block in the middle, whose contents, size, or place is wrong; or the file ends in it.
        let deflated = places(&bytes, b"##DZ\0\0\0\0");
        let middle = deflated[deflated.len() / 2];
        let mut broken = vec![(folder.write("cut.mf4", &bytes[..middle + 60]), false)];
        let damages: [(&str, usize, u64); 4] =
            [("contents", 56, u64::MAX), ("long", 32, 100), ("huge", 32, 1 << 60), ("packed-huge", 40, 1 << 60)];
        for (name, field, value) in damages {
            let own = number(&bytes, middle + field).to_le_bytes();
            bytes[middle + field..middle + field + 8].copy_from_slice(&value.to_le_bytes());
            broken.push((folder.write(name, &bytes), true));
            bytes[middle + field..middle + field + 8].copy_from_slice(&own);
        }
        for (path, is_noted) in broken.iter().chain([&(good, false)]) {
            if let Err(error) = Log::open(path, &OpenOptions::default()) {
                assert!(!is_noted, "{path:?}: {error}");
                continue;
            }
            let alone = in_every_way(path, 1);
            assert!(!is_noted || alone.contains("the log is read up to this place"), "{path:?}");
            for threads in [0, 2, 3, 8] {
                assert_eq!(in_every_way(path, threads), alone, "{path:?} {threads}");
            }
        }
    }
}

/// Waits until so many threads of this process unpack blocks, where the system says it; false if that does not come.
fn threads_become(count: usize) -> bool {
    let start = Instant::now();
    let is_own = |task: std::io::Result<std::fs::DirEntry>| {
        let name = std::fs::read_to_string(task.ok()?.path().join("comm")).ok()?;
        (name.trim() == "unpacking").then_some(())
    };
    while let Ok(tasks) = std::fs::read_dir("/proc/self/task") {
        if tasks.filter_map(is_own).count() == count {
            return true;
        }
        if start.elapsed() > Duration::from_secs(20) {
            return false;
        }
        std::thread::yield_now();
    }
    true
}

#[test]
fn a_log_that_is_left_in_the_middle_ends_its_threads() {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = Folder::new("left");
    let path = folder.write("left.mf4", in_many_blocks(two_clocks(&folder), 24, |_| Packing::Deflated));
    for taken in [0, 1, 1000] {
        let mut log = Log::open(&path, &OpenOptions::default()).unwrap().on_threads(3);
        let all: Vec<usize> = (0..log.channels().len()).collect();
        assert!(threads_become(0));
        assert_eq!(log.samples(&all).unwrap().take(taken).filter(Result::is_ok).count(), taken);
        assert!(threads_become(2));
        // The same log again, from its beginning.
        assert_eq!(log.samples(&all).unwrap().count(), 6_000);
        assert!(threads_become(2));
    }
    assert!(threads_become(0));
}

/// The samples of each channel, as text: what is no number is not the same as itself.
fn by_channel(samples: &[Sample]) -> BTreeMap<usize, Vec<String>> {
    let mut channels: BTreeMap<usize, Vec<String>> = BTreeMap::new();
    samples.iter().for_each(|sample| channels.entry(sample.channel).or_default().push(format!("{sample:?}")));
    channels
}

#[test]
fn a_file_that_is_cut_within_its_data_is_read_up_to_that_place() {
    let folder = Folder::new("cut-data");
    let packings: [fn(usize, usize) -> Packing; 2] = [|_, _| Packing::Plain, |_, width| Packing::Transposed(width)];
    for (name, is_apart) in
        [("plain_410.mf4", false), ("unsorted.mf4", false), ("remote.mf4", false), ("invalidation.mf4", true)]
    {
        let own = std::fs::read(data(name)).unwrap();
        for packing in packings {
            let whole = match is_apart {
                true => with_bits_apart(own.clone(), packing),
                false => divided(own.clone(), &[100, 300, 500], |i| packing(i, 9)),
            };
            let (all, notes) = samples(&folder.write("whole.mf4", &whole));
            assert_eq!(notes, Vec::<String>::new());
            let by_channel_of_all = by_channel(&all);
            let mut maximum = 0;
            for end in (own.len()..whole.len()).step_by(7).chain([whole.len() - 1]) {
                let said = format!("it ends beyond the end of the file, byte {end}");
                let found = match read(&folder.write("cut.mf4", &whole[..end]), &OpenOptions::default()) {
                    Ok((_, found, notes)) => {
                        assert!(notes.iter().any(|note| note.contains(&said)), "{name} {end}: {notes:?}");
                        found
                    }
                    Err(error) => {
                        assert!(error.to_string().contains(&said), "{name} {end}: {error}");
                        Vec::new()
                    }
                };
                for (channel, own) in by_channel(&found) {
                    assert_eq!(own, by_channel_of_all[&channel][..own.len()], "{name} {end}");
                }
                assert!(
                    found.len() >= maximum && found.len() < all.len(),
                    "{name} {end}: {} of {}",
                    found.len(),
                    all.len()
                );
                maximum = found.len();
            }
            assert!(2 * maximum > all.len(), "{name}: {maximum} of {}", all.len());
        }
    }
}

#[test]
fn a_file_whose_description_is_cut_is_refused_with_the_place() {
    let folder = Folder::new("cut-description");
    let bytes = std::fs::read(data("plain_410.mf4")).unwrap();
    let cut = *places(&bytes, b"##CN\0\0\0\0").last().unwrap() + 30;
    let error = read(&folder.write("cut.mf4", &bytes[..cut]), &OpenOptions::default()).map(|_| ()).unwrap_err();
    assert!(error.to_string().contains("its structure: File is truncated: expected"), "{error}");
}

#[test]
fn bytes_in_memory_are_read_as_those_of_a_file() {
    let folder = Folder::new("mdf-in-memory");
    let names = ["plain_400.mf4", "deflate.mf4", "transposed.mf4", "unsorted.mf4", "lz4.mf4", "bus.mf4", "blocks.mf4"];
    let options = OpenOptions { dbc: Some(data("bus.dbc")), ..OpenOptions::default() };
    for name in names {
        let own = std::fs::read(data(name)).unwrap();
        for length in [own.len(), own.len() - 40, own.len() / 2, 200, 70] {
            let path = folder.write(name, &own[..length]);
            let bytes = own[..length].into();
            let said = |found: Result<(Log, Vec<Sample>, Vec<String>), logs::LogError>| match found {
                Ok((log, samples, notes)) => Ok((log.channels().to_vec(), format!("{samples:?}"), notes)),
                Err(error) => Err(error.to_string()),
            };
            let of_file = said(read(&path, &options));
            assert_eq!(said(Log::of_bytes(&path, &options, bytes).and_then(read_of)), of_file, "{name} {length}");
            assert!(length < own.len() || of_file.is_ok(), "{name}: {of_file:?}");
        }
    }
}
