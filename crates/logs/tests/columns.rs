//! A log in columns has the samples that it has in time order.

use crate::common::{Folder, channel, data, read, with_dbc};
use falcon_mdf::Mf4Writer;
use logs::{Block, Log, OpenOptions, Quality};

type Samples = Vec<(f64, f64, Quality)>;

fn all_of(log: &Log) -> Vec<usize> {
    (0..log.channels().len()).collect()
}

/// Appends times, values and qualities of a block to those of each channel.
fn append(channels: &mut [Samples], block: &Block) {
    for column in &block.columns {
        assert_eq!(column.values.len(), block.times_s.len());
        assert!(column.qualities.is_empty() || column.qualities.len() == block.times_s.len());
        let records = (0..block.times_s.len()).filter_map(|i| Some((i, column.quality(i)?)));
        channels[column.channel].extend(records.map(|(i, quality)| (block.times_s[i], column.values[i], quality)));
    }
}

/// Times, values and qualities of each channel, and the notes.
fn in_columns(log: &mut Log) -> (Vec<Samples>, Vec<String>) {
    let all = all_of(log);
    let mut channels = vec![Vec::new(); all.len()];
    let mut columns = log.columns(&all).unwrap();
    while let Some(block) = columns.next_block().unwrap() {
        append(&mut channels, block);
    }
    (channels, columns.notes().to_vec())
}

/// The same as whole arrays.
fn in_arrays(log: &mut Log, threads: usize) -> (Vec<Samples>, Vec<String>) {
    let all = all_of(log);
    let mut channels = vec![Vec::new(); all.len()];
    let arrays = log.arrays(&all, threads).unwrap();
    arrays.blocks.iter().for_each(|block| append(&mut channels, block));
    (channels, arrays.notes)
}

#[test]
fn columns_have_the_samples_that_are_merged() {
    let names = [
        "plain_400.mf4",
        "deflate.mf4",
        "transposed.mf4",
        "blocks.mf4",
        "zstd.mf4",
        "lz4.mf4",
        "invalidation.mf4",
        "unsorted.mf4",
        "remote.mf4",
        "bus.mf4",
        "bus.blf",
        "bus.log",
        "snappy.parquet",
        "zstd.parquet",
        "stamps.parquet",
    ];
    for name in names {
        let options = if name.starts_with("bus") { with_dbc() } else { OpenOptions::default() };
        let (log, samples, mut notes) = read(&data(name), &options).unwrap();
        let (columns, mut said) = in_columns(&mut Log::open(&data(name), &options).unwrap());
        // Streams end one after the other, or as their times do.
        notes.sort();
        said.sort();
        assert_eq!(said, notes, "{name}");
        for threads in [1, 3] {
            let (arrays, mut said) = in_arrays(&mut Log::open(&data(name), &options).unwrap(), threads);
            said.sort();
            assert_eq!(said, notes, "{name}");
            assert_eq!(format!("{arrays:?}"), format!("{columns:?}"), "{name}");
        }
        assert_eq!(columns.len(), log.channels().len());
        let mut count = 0;
        for (i, found) in columns.iter().enumerate() {
            let own = samples.iter().filter(|sample| sample.channel == i);
            let own: Samples = own.map(|sample| (sample.time_s, sample.value, sample.quality)).collect();
            // What cannot be a number is not the same as itself.
            assert_eq!(format!("{found:?}"), format!("{own:?}"), "{name} {}", log.channels()[i].name);
            count += own.len();
        }
        assert!(count > 40, "{name}");
    }
}

#[test]
fn columns_keep_the_stamps_of_the_file_and_leave_out_rows_without_a_time() {
    let folder = Folder::new("columns");
    let path = folder.write("log.csv", "time_s,a\n0,1\n2,2\n1,3\n,4\n3,5\n");
    let (columns, notes) = in_columns(&mut Log::open(&path, &OpenOptions::default()).unwrap());
    assert_eq!(columns[0].iter().map(|(time_s, ..)| *time_s).collect::<Vec<_>>(), [0.0, 2.0, 1.0, 3.0]);
    assert_eq!(notes, ["1 of 5 rows have no time and are left out"]);
    let (log, samples, _) = read(&path, &OpenOptions::default()).unwrap();
    assert_eq!(channel(&log, &samples, "a")[2].2, Quality::Backward);
}

#[test]
fn what_is_bad_in_a_later_batch_is_bad_in_whole_arrays_too() {
    let folder = Folder::new("later");
    let path = folder.0.join("log.mf4");
    let times: Vec<f64> = (0..30_000).map(|i| f64::from(i) * 0.01).collect();
    let mut speed: Vec<f64> = times.iter().map(|t| 400.0 + t).collect();
    speed[9_000] = f64::INFINITY;
    // No sample at all.
    speed[9_500] = f64::NAN;
    let mut writer = Mf4Writer::new();
    let group = writer.add_group(&times).unwrap();
    group.add_channel("speed", "rad/s", &speed).unwrap();
    group.add_channel("good", "", &vec![1.0; times.len()]).unwrap();
    writer.set_compression(false);
    writer.write_to_file(&path).unwrap();
    // The writer refuses a time that is none.
    let mut bytes = std::fs::read(&path).unwrap();
    let places: Vec<usize> =
        (0..bytes.len() - 8).filter(|&i| bytes[i..].starts_with(&times[20_000].to_le_bytes())).collect();
    assert_eq!(places.len(), 1);
    bytes[places[0]..places[0] + 8].copy_from_slice(&f64::NAN.to_le_bytes());
    std::fs::write(&path, bytes).unwrap();
    let open = || Log::open(&path, &OpenOptions::default()).unwrap();
    let (columns, notes) = in_columns(&mut open());
    let (arrays, said) = in_arrays(&mut open(), 2);
    assert_eq!(format!("{arrays:?}"), format!("{columns:?}"));
    assert_eq!(said, notes);
    assert_eq!(arrays[0].len(), 29_998);
    let bad: Vec<usize> = (0..29_998).filter(|&i| arrays[0][i].2 != Quality::Good).collect();
    assert_eq!(bad, [9_000]);
    assert_eq!(arrays[1].iter().filter(|(.., quality)| *quality == Quality::Good).count(), 29_999);
}

#[test]
fn a_damaged_log_in_columns_is_an_error_or_a_note() {
    let folder = Folder::new("damaged-columns");
    let whole = std::fs::read(data("transposed.mf4")).unwrap();
    let place = whole.windows(4).position(|bytes| bytes == b"##DZ").unwrap();
    let mut broken = whole.clone();
    broken[place + 48..place + 60].fill(0xff);
    let mut log = Log::open(&folder.write("broken.mf4", &broken), &OpenOptions::default()).unwrap();
    let (columns, notes) = in_columns(&mut log);
    let message = format!("block at byte {place}: what is packed in it is damaged");
    assert!(notes.iter().any(|note| note.contains(&message) && note.contains("group `")), "{notes:?}");
    // The other group is whole.
    assert!(columns.iter().any(|column| !column.is_empty()) && columns.iter().any(Vec::is_empty));
}
