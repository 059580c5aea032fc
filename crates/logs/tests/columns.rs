//! A log in columns has the samples that it has in time order.

#![expect(clippy::unwrap_used, reason = "a test may")]

mod common;

use common::{Folder, channel, data, read, with_dbc};
use logs::{Log, OpenOptions, Quality};

type Samples = Vec<(f64, f64, Quality)>;

/// Times, values and qualities of each channel, and the notes.
fn in_columns(log: &mut Log) -> (Vec<Samples>, Vec<String>) {
    let all: Vec<usize> = (0..log.channels().len()).collect();
    let mut channels = vec![Vec::new(); all.len()];
    let mut columns = log.columns(&all).unwrap();
    while let Some(block) = columns.next_block().unwrap() {
        for column in &block.columns {
            assert_eq!(column.values.len(), block.times_s.len());
            let records = (0..block.times_s.len()).filter_map(|i| Some((i, column.quality(i)?)));
            channels[column.channel].extend(records.map(|(i, quality)| (block.times_s[i], column.values[i], quality)));
        }
    }
    (channels, columns.notes().to_vec())
}

#[test]
fn columns_have_the_samples_that_are_merged() {
    let names = [
        "plain_400.mf4",
        "deflate.mf4",
        "transposed.mf4",
        "zstd.mf4",
        "lz4.mf4",
        "invalidation.mf4",
        "unsorted.mf4",
        "bus.mf4",
        "bus.blf",
        "bus.log",
        "snappy.parquet",
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
