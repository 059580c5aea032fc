//! Files that asammdf, python-can, cantools and pyarrow wrote. What must be in them follows from the formulas of
//! `tests/data/make.py`, which are stated again here.

use std::path::Path;

use crate::common::{Folder, channel, data, read, with_dbc};
use logs::{Log, LogError, OpenOptions, Quality};

const ROWS: u32 = 40;

/// Checks times and values of a channel; an invalid one is told by its quality alone.
fn check(found: &[(f64, f64, Quality)], expected: impl ExactSizeIterator<Item = (f64, f64, Quality)>, name: &str) {
    assert_eq!(found.len(), expected.len(), "{name}");
    for ((time_s, value, quality), (expected_s, expected, expected_quality)) in found.iter().zip(expected) {
        // BLF keeps whole nanoseconds, and its writer cuts off what is below; a double keeps 53 bits.
        let tolerance_s = 2e-9 + 2.0 * f64::EPSILON * expected_s.abs();
        assert!((time_s - expected_s).abs() < tolerance_s, "{name}: {time_s} {expected_s}");
        assert_eq!(*quality, expected_quality, "{name} at {time_s}");
        let same = (value - expected).abs() <= 1e-9 * expected.abs().max(1.0);
        assert!(same || *quality != Quality::Good, "{name}: {value} {expected}");
    }
}

fn good(time_s: f64, value: f64) -> (f64, f64, Quality) {
    (time_s, value, Quality::Good)
}

/// Rows of the fast group, from number to value.
fn fast(value: impl Fn(f64) -> f64) -> impl ExactSizeIterator<Item = (f64, f64, Quality)> {
    (0..ROWS).map(move |i| good(f64::from(i) * 0.01, value(f64::from(i))))
}

/// Rows of the slow group.
fn slow(value: impl Fn(f64) -> f64) -> impl ExactSizeIterator<Item = (f64, f64, Quality)> {
    (0..ROWS / 2).map(move |i| good(0.005 + f64::from(i) * 0.025, value(f64::from(i))))
}

#[test]
fn mdf_of_every_version_and_layout_gives_the_same_values() {
    for file in [
        "plain_400.mf4",
        "plain_410.mf4",
        "plain_420.mf4",
        "deflate.mf4",
        "transposed.mf4",
        "blocks.mf4",
        "zstd.mf4",
        "lz4.mf4",
        "unsorted.mf4",
    ] {
        let (log, samples, notes) = read(&data(file), &OpenOptions::default()).unwrap();
        assert_eq!(notes, Vec::<String>::new(), "{file}");
        check(&channel(&log, &samples, "N_Eng"), fast(|i| 800.0 + 10.0 * i), file);
        check(&channel(&log, &samples, "N_Turb"), slow(|i| 700.0 + 3.0 * i), file);
        if file != "unsorted.mf4" {
            check(&channel(&log, &samples, "Gear"), slow(|i| 1.0 + (i / 10.0).floor()), file);
        }
        assert!(
            samples.windows(2).all(|pair| pair[0].time_s <= pair[1].time_s),
            "{file}: the groups are merged by time"
        );
        let engine = &log.channels()[log.find("N_Eng", None).unwrap()];
        assert_eq!((engine.unit.as_str(), engine.group.as_str()), ("1/min", "fast"), "{file}");
        assert!(log.find("N_Eng", Some("slow")).is_err() && log.find("fast.N_Eng", None).is_ok(), "{file}");
    }
}

#[test]
fn mdf_conversions_give_physical_values() {
    for file in ["deflate.mf4", "transposed.mf4", "blocks.mf4", "zstd.mf4", "lz4.mf4"] {
        let (log, samples, _) = read(&data(file), &OpenOptions::default()).unwrap();
        let of = |name: &str| channel(&log, &samples, name);
        check(&of("Rational"), slow(|i| (2.0 * i + 6.0) / 4.0), "Rational");
        check(&of("Table"), slow(|i| if i <= 10.0 { 10.0 * i } else { 100.0 + 30.0 * (i - 10.0) }), "Table");
        check(&of("Signed"), slow(|i| i - 5.0), "Signed");
        check(&of("Single"), slow(|i| i / 8.0), "Single");
        check(&of("Lever"), slow(|i| i % 2.0), "Lever");
    }
}

#[test]
fn mdf_invalidation_bits_mark_samples() {
    let (log, samples, _) = read(&data("invalidation.mf4"), &OpenOptions::default()).unwrap();
    let expected = (0..ROWS).map(|i| {
        let quality = if i % 5 == 3 { Quality::Invalid } else { Quality::Good };
        (f64::from(i) * 0.01, 800.0 + 10.0 * f64::from(i), quality)
    });
    check(&channel(&log, &samples, "N_Eng"), expected, "N_Eng");
    check(&channel(&log, &samples, "N_Turb"), slow(|i| 700.0 + 3.0 * i), "N_Turb");
}

/// Times of a bus log count from its first frame, or from another time, as its format has it.
fn bus(file: &str, first_s: Option<f64>) {
    let (log, samples, notes) = read(&data(file), &with_dbc()).unwrap();
    let first_s = first_s.unwrap_or(samples[0].time_s);
    let rows = |shift_s: f64, value: fn(f64) -> f64| {
        (0..ROWS).map(move |i| good(first_s + f64::from(i) * 0.01 + shift_s, value(f64::from(i))))
    };
    let short = |name: &str| {
        let mut found = channel(&log, &samples, name);
        // The frame that ends before the signal.
        let (time_s, _, quality) = found.pop().unwrap();
        assert!((time_s - first_s - 1.01).abs() < 1e-6 && quality == Quality::Missing, "{file}: {name}");
        found
    };
    let mut engine = channel(&log, &samples, "N_Eng");
    // The short frame has this signal: 0x0400 times 0.25.
    assert_eq!(engine.pop().unwrap().1, 256.0, "{file}");
    check(&engine, rows(0.0, |i| 800.0 + 10.0 * i), "N_Eng");
    check(&short("Tq_Eng"), rows(0.0, |i| 2.5 * i - 20.0), "Tq_Eng");
    check(&short("Throttle"), rows(0.0, |i| 0.4 * i), "Throttle");
    check(&channel(&log, &samples, "N_Turb"), rows(0.002, |i| 700.0 + 3.0 * i), "N_Turb");
    check(&channel(&log, &samples, "Gear"), rows(0.002, |i| 1.0 + (i / 20.0).floor()), "Gear");
    check(&channel(&log, &samples, "P_Clutch"), rows(0.002, |i| i / 8.0), "P_Clutch");
    // Two signals in the same place, one in even and one in odd frames.
    let each_second =
        |from: u32, value: f64| (0..ROWS / 2).map(move |i| good(first_s + f64::from(2 * i + from) * 0.01, value));
    check(&channel(&log, &samples, "T_Oil"), each_second(0, 60.0), "T_Oil");
    check(&channel(&log, &samples, "T_Air"), each_second(1, 21.5), "T_Air");
    assert_eq!(notes.last().unwrap(), "1 of 82 frames, of 1 identifiers, are not in the DBC: 0x7DF", "{file}");
    assert_eq!(log.channels()[log.find("T_Oil", None).unwrap()].group, "Engine");
}

#[test]
fn can_logs_of_four_formats_give_the_same_signals() {
    bus("bus.log", Some(1000.0));
    bus("bus.asc", Some(0.0));
    bus("bus.blf", Some(0.0));
    // Its times count from when it was written.
    bus("bus.mf4", None);
}

#[test]
fn can_fd_frames_are_read() {
    for file in ["fd.asc", "fd.blf"] {
        let (log, samples, _) = read(&data(file), &with_dbc()).unwrap();
        let rows = (0..8_u32).map(|i| good(f64::from(i) * 0.01, 0.25 * f64::from(0x0c40 + i)));
        check(&channel(&log, &samples, "N_Eng"), rows, file);
    }
}

#[test]
fn parquet_gives_numbers_and_leaves_out_what_is_absent() {
    for file in ["snappy.parquet", "gzip.parquet", "lz4.parquet", "zstd.parquet", "polars.parquet", "stamps.parquet"] {
        let (log, samples, notes) = read(&data(file), &OpenOptions::default()).unwrap();
        let came: Vec<u32> = (0..ROWS).filter(|i| i % 7 != 2).collect();
        let engine = came.iter().map(|&i| good(f64::from(i) * 0.01, 800.0 + 10.0 * f64::from(i)));
        check(&channel(&log, &samples, "N_Eng"), engine, file);
        check(&channel(&log, &samples, "gear"), fast(|i| 1.0 + (i / 20.0).floor()), file);
        check(&channel(&log, &samples, "locked"), fast(|i| 1.0 - i % 2.0), file);
        check(&channel(&log, &samples, "turbine_speed_rpm"), fast(|i| 700.0 + 3.0 * i), file);
        let unit = |name: &str| log.channels()[log.find(name, None).unwrap()].unit.clone();
        assert_eq!((unit("N_Eng").as_str(), unit("turbine_speed_rpm").as_str()), ("rpm", "rpm"), "{file}");
        assert_eq!(notes, ["1 columns do not hold single numbers and are left out: note (text or bytes)"], "{file}");
    }
}

#[test]
fn tables_with_very_many_columns_are_read() {
    // The row of names alone is longer than what the form of a table is told from otherwise.
    let folder = Folder::new("wide");
    let names: String = (0..30_000).map(|i| format!(",c{i}")).collect();
    let row = |time_s: f64, value: &str| format!("{time_s}{}\n", format!(",{value}").repeat(30_000));
    let path = folder.write("wide.csv", format!("time_s{names}\n{}{}", row(0.0, "1"), row(0.01, "2")));
    let (log, samples, notes) = read(&path, &OpenOptions::default()).unwrap();
    assert_eq!(log.channels().len(), 30_000);
    check(&channel(&log, &samples, "c29999"), [good(0.0, 1.0), good(0.01, 2.0)].into_iter(), "wide");
    assert_eq!(notes, Vec::<String>::new());
}

#[test]
fn what_holds_nothing_is_named() {
    let folder = Folder::new("nothing");
    let message =
        |name: &str, bytes: &[u8]| read(&folder.write(name, bytes), &OpenOptions::default()).err().unwrap().to_string();
    assert!(message("zeros", &[0; 4096]).contains("this is no format that is known"));
    for mark in [&[][..], &[0xef, 0xbb, 0xbf], &[0xff, 0xfe]] {
        assert!(
            message("empty", mark).ends_with("the file is empty\nhint: copy it again from the recorder"),
            "{mark:?}"
        );
    }
    assert!(message("names", b"time_s,a\n").contains("there are no rows"));
    for (bytes, said) in [
        (&b"\x1f\x8b\x08\0"[..], "the file is packed with gzip\nhint: unpack it"),
        (
            b"PK\x03\x04\x14\0",
            "this is a ZIP archive, or a workbook of a spreadsheet\nhint: unpack it; save a workbook as CSV",
        ),
        (b"\xfd7zXZ\0\0\x04", "the file is packed with xz\nhint: "),
        (b"MATLAB 5.0 MAT-file, Platform", "this is a MAT-file\nhint: save its channels"),
        (b"MATLAB 7.3 MAT-file, Platform", "this is a MAT-file of version 7.3\nhint: save its channels"),
        (b"\x89HDF\r\n\x1a\n", "this is HDF5, or a MAT-file of version 7.3\nhint: "),
        (b"MDF     3.30    ", "this is MDF of version 2 or 3\nhint: convert it"),
        (b"  vcan0  122   [2]  40 1F\n  vcan0  122   [2]  44 1F\n", "without time stamps\nhint: log with `candump -L`"),
    ] {
        let error = message("packed", bytes);
        assert!(error.contains(said), "{error}");
        // A log without a map is refused for the same reason.
        let native = logs::needs_map(&folder.write("packed", bytes)).unwrap_err().to_string();
        assert_eq!(native, error);
    }
    let packed = std::fs::read(data("snappy.parquet")).unwrap().into();
    let in_memory = Log::of_bytes(Path::new("log.parquet"), &OpenOptions::default(), packed).map(|_| ()).unwrap_err();
    let said = "log.parquet: Parquet logs are not read from memory, as in a browser\nhint: save the channels as CSV";
    assert!(in_memory.to_string().starts_with(said), "{in_memory}");
    let no_rows = std::fs::read(data("no_rows.parquet")).unwrap();
    assert!(message("no_rows", &no_rows).contains("there are no rows"));
    let brotli = message("brotli", &std::fs::read(data("brotli.parquet")).unwrap());
    assert!(
        brotli.contains("` is packed with brotli, which is not read\nhint: write the file with zstd, snappy,"),
        "{brotli}"
    );
    let error = LogError::File { path: "-".into(), message: "the file is empty".to_owned() };
    assert_eq!(error.to_string(), "standard input: the file is empty");
}

#[test]
fn parquet_numbers_of_every_kind_are_read() {
    for (file, first_s) in [("types.parquet", 1.7e9), ("types_old.parquet", 1.7e9), ("types_day.parquet", 0.0)] {
        let (log, samples, notes) = read(&data(file), &OpenOptions::default()).unwrap();
        let rows =
            |value: fn(f64) -> f64| (0..ROWS).map(move |i| good(first_s + f64::from(i) * 0.01, value(f64::from(i))));
        check(&channel(&log, &samples, "u8"), rows(|i| 6.0 * i), file);
        check(&channel(&log, &samples, "u32"), rows(|i| 4_294_967_295.0 - i), file);
        check(&channel(&log, &samples, "u64"), rows(|i| 2_f64.powi(63) + 4096.0 * i), file);
        check(&channel(&log, &samples, "half"), rows(|i| i / 4.0), file);
        check(&channel(&log, &samples, "single"), rows(|i| i / 8.0), file);
        check(&channel(&log, &samples, "cents"), rows(|i| 3.0 * i - 25.0), file);
        check(&channel(&log, &samples, "inner.x"), rows(|i| i), file);
        assert_eq!(notes.len(), 1, "{notes:?}");
        assert!(notes[0].starts_with("1 columns do not hold single numbers and are left out: list."), "{notes:?}");
        assert!(notes[0].ends_with("(lists)"), "{notes:?}");
    }
}

#[test]
fn mdf_floats_of_sixteen_bits_and_of_the_other_order_are_read() {
    let (log, samples, notes) = read(&data("half.mf4"), &OpenOptions::default()).unwrap();
    // 80 to 119 in steps of 1: sixteen bits hold them.
    check(&channel(&log, &samples, "Half"), fast(|i| 80.0 + i), "half");
    check(&channel(&log, &samples, "Big"), fast(|i| 800.0 + 10.0 * i), "big");
    assert_eq!(notes, Vec::<String>::new());
}

#[test]
fn mdf_channels_with_their_time_in_another_group_are_read() {
    let (log, samples, notes) = read(&data("remote.mf4"), &OpenOptions::default()).unwrap();
    check(&channel(&log, &samples, "N_Eng"), fast(|i| 800.0 + 10.0 * i), "remote");
    check(&channel(&log, &samples, "N_Turb"), fast(|i| 800.0 + 10.0 * i), "remote");
    assert_eq!(notes, Vec::<String>::new());
}

#[test]
fn clock_times_dates_and_utf_16_are_read() {
    let folder = Folder::new("stamps");
    let noon_s = 1_711_886_400.0;
    let table = |head: &str, stamp: &dyn Fn(u32) -> String| {
        let rows = (0..ROWS).map(|i| format!("{};{};{}\n", stamp(i), 800 + 10 * i, 700 + 3 * i));
        format!("{head};N_Eng [rpm];N_Turb [rpm]\n{}", rows.collect::<String>())
    };
    // Hundredths of a second from `seconds` on.
    let clock = |seconds: u32, i: u32| {
        let at = seconds + i / 100;
        format!("{:02}:{:02}:{:02}.{:02}", at / 3600 % 24, at / 60 % 60, at % 60, i % 100)
    };
    let cases = [
        (table("Time", &|i| clock(43_200, i)), 43_200.0),
        (table("Uhrzeit", &|i| clock(43_200, i).replace('.', ",")), 43_200.0),
        // 0.2 s before midnight.
        (table("time [hh:mm:ss]", &|i| clock(86_399, i + 80)), 86_399.8),
        (table("timestamp", &|i| format!("2024-03-31T{}Z", clock(43_200, i))), noon_s),
        (table("Date/Time", &|i| format!("\"2024-03-31 {}\"", clock(43_200, i))), noon_s),
        (table("t", &|i| format!("31.03.2024 {}", clock(43_200, i))), noon_s),
        // The date stands in a column of its own.
        (table("Date;Time", &|i| format!("2024-03-31;{}", clock(43_200, i))), 43_200.0),
    ];
    for (text, first_s) in cases {
        for order in [None, Some(u16::to_le_bytes as fn(u16) -> [u8; 2]), Some(u16::to_be_bytes)] {
            let wide = |order: fn(u16) -> [u8; 2]| {
                std::iter::once(0xfeff).chain(text.encode_utf16()).flat_map(order).collect::<Vec<u8>>()
            };
            let path = folder.write("log.csv", order.map_or(text.clone().into_bytes(), wide));
            let (log, samples, _) =
                read(&path, &OpenOptions::default()).unwrap_or_else(|error| panic!("{error}\n{text}"));
            let engine = channel(&log, &samples, "N_Eng");
            assert_eq!(engine.len(), ROWS as usize, "{text}");
            for (i, (time_s, value, quality)) in (0_u32..).zip(engine) {
                // Doubles of seconds since 1970 are 0.24 us apart.
                assert!((time_s - first_s - 0.01 * f64::from(i)).abs() < 5e-7, "{time_s} {text}");
                assert_eq!((value, quality), (f64::from(800 + 10 * i), Quality::Good), "{text}");
            }
        }
    }
}

#[test]
fn thousands_in_groups_are_not_guessed() {
    let folder = Folder::new("thousands");
    let text = "time_s,a\n0,1\n1,\"1,007.25\"\n2,3\n";
    let (log, samples, notes) = read(&folder.write("log.csv", text), &OpenOptions::default()).unwrap();
    assert_eq!(channel(&log, &samples, "a")[1].2, Quality::Missing);
    assert!(
        notes[0].ends_with("line 3: `1,007.25`\nhint: write numbers without a sign between their thousands"),
        "{notes:?}"
    );
}

#[test]
fn every_form_of_candump_is_read() {
    let folder = Folder::new("candump");
    let bytes = |i: u32| format!("{:02X}0C000000000000", 0x40 + i);
    let apart =
        |i: u32| bytes(i).as_bytes().chunks(2).map(|two| str::from_utf8(two).unwrap()).collect::<Vec<_>>().join(" ");
    let forms: [(&dyn Fn(u32) -> String, f64); 7] = [
        (&|i| format!("({}.{:02}0000) can0 100#{}", 1000, i, bytes(i)), 1000.0),
        (&|i| format!("({}.{:02}0000) can0 100#{}_9", 1000, i, bytes(i)), 1000.0),
        (&|i| format!("({}.{:02}0000) can0 100##1{}", 1000, i, bytes(i)), 1000.0),
        (&|i| format!(" (000.{i:02}0000)  can0  100   [8]  {}", apart(i)), 0.0),
        (&|i| format!(" (000.{i:02}0000)  can0  100   [8]  {}   '@.......'", apart(i)), 0.0),
        (&|i| format!(" (000.{i:02}0000)  can0  RX - -  100   [8]  {}", apart(i)), 0.0),
        (&|i| format!(" (2024-03-31 12:00:00.{i:02}0000)  can0  100   [8]  {}", apart(i)), 1_711_886_400.0),
    ];
    for (line, first_s) in forms {
        // Errors of the bus and requests for data are no frames with data, and nothing to warn of.
        let mut text: String = (0..8).map(|i| line(i) + "\n").collect();
        text += "(1000.08) can0 20000004#000C000000000000\n(1000.09) can0 100#R\n";
        if first_s == 1000.0 {
            text += "(1000.08)  can0  20000080   [8]  00 00 00 00 00 00 00 00   ERRORFRAME\n";
        }
        let (log, samples, notes) = read(&folder.write("bus.log", text), &with_dbc()).unwrap();
        let engine = channel(&log, &samples, "N_Eng");
        assert_eq!(engine.len(), 8, "{}", line(0));
        for (i, (time_s, value, quality)) in (0_u32..).zip(engine) {
            assert!((time_s - first_s - 0.01 * f64::from(i)).abs() < 5e-7, "{time_s} {}", line(i));
            assert_eq!((value, quality), (0.25 * f64::from(0x0c40 + i), Quality::Good), "{}", line(i));
        }
        assert_eq!(notes, Vec::<String>::new(), "{}", line(0));
    }
}

#[test]
fn times_between_frames_and_two_buses_are_told() {
    let folder = Folder::new("two-buses");
    let notes = |text: &str| read(&folder.write("bus.log", text), &with_dbc()).unwrap().2;
    let frame = |stamp: &str, bus: u32| format!("({stamp}) can{bus} 100#400C000000000000\n");
    let constant: String = (0..20).map(|_| frame("000.010000", 0)).collect();
    let changing: String = (0..20).map(|i| frame(&format!("000.0{:02}000", 7 * i % 19), 0)).collect();
    for text in [constant, changing] {
        let notes = notes(&text);
        assert!(notes.iter().any(|note| note.contains("candump -t d")), "{notes:?}");
    }
    let two: String = (0..20).map(|i| frame(&format!("{i}.0"), i % 2)).collect();
    assert_eq!(
        notes(&two),
        [
            "message 0x100 comes on two buses, whose values are mixed\nhint: write the frames of one bus to a file of their own"
        ]
    );
    assert_eq!(notes(&(0..20).map(|i| frame(&format!("{i}.0"), 1)).collect::<String>()), Vec::<String>::new());
}

#[test]
fn csv_of_every_dialect_gives_the_same_values() {
    let folder = Folder::new("dialects");
    let row = |i: u32, d: char, p: &str| {
        format!("{}{d}{}{d}{}", f64::from(i) * 0.01, 800.5 + 10.0 * f64::from(i), 700 + 3 * i).replace('.', p)
    };
    let table = |head: &str, d: char, p: &str| {
        let rows: Vec<String> = (0..ROWS).map(|i| row(i, d, p)).collect();
        format!("{head}\n{}\n", rows.join("\n"))
    };
    let dialects = [
        table("time_s,N_Eng [rpm],N_Turb [1/min]", ',', "."),
        table("time,N_Eng,N_Turb\ns,rpm,1/min", ',', "."),
        table("Zeit;N_Eng;N_Turb\n[s];[1/min];[1/min]", ';', ","),
        table("t [s]\tN_Eng [rpm]\tN_Turb [rpm]", '\t', "."),
        table("t [s]\tN_Eng [rpm]\tN_Turb [rpm]", '\t', ","),
        table("time_s|N_Eng (rpm)|N_Turb (rpm)", '|', "."),
        format!("\u{feff}{}", table("time_s,N_Eng [rpm],N_Turb [rpm]", ',', ".").replace('\n', "\r\n")),
        table("Recorder 7\nDriver: a name\n\ntime_s,N_Eng [rpm],N_Turb [rpm]", ',', "."),
        table("# a remark\nZeit [s];N_Eng [U/min];N_Turb [U/min]", ';', "."),
        table("\"time_s\",\"N_Eng [rpm]\",\"N_Turb [rpm]\"", ',', "."),
    ];
    for text in dialects {
        let path = folder.write("log.csv", &text);
        let (log, samples, notes) =
            read(&path, &OpenOptions::default()).unwrap_or_else(|error| panic!("{error}\n{text}"));
        check(&channel(&log, &samples, "N_Eng"), fast(|i| 800.5 + 10.0 * i), &text[..40]);
        check(&channel(&log, &samples, "N_Turb"), fast(|i| 700.0 + 3.0 * i), &text[..40]);
        assert_eq!(notes, Vec::<String>::new(), "{text}");
        for channel in log.channels() {
            assert_eq!(trace::Unit::parse(&channel.unit).unwrap().name, "rpm", "{text}");
        }
    }
}

#[test]
fn a_time_since_1970_has_the_unit_of_its_name() {
    let folder = Folder::new("epoch");
    for (name, per_s) in [("epoch_ns", 1e9), ("t_us", 1e6), ("timestamp_ms", 1e3), ("epoch_s", 1.0)] {
        let row = |i: i32| format!("{:.2},{}\n", (1.7e9 + 0.25 * f64::from(i)) * per_s, 100 + i);
        let text = format!("{name},a_rpm\n{}", (0..4).map(row).collect::<String>());
        let (log, samples, _) = read(&folder.write("log.csv", text), &OpenOptions::default()).unwrap();
        let expected = (0..4).map(|i| good(1.7e9 + 0.25 * f64::from(i), f64::from(100 + i)));
        check(&channel(&log, &samples, "a_rpm"), expected, name);
    }
}

#[test]
fn channels_with_one_name_are_told_apart_or_not() {
    let folder = Folder::new("twins");
    let log = Log::open(&folder.write("log.csv", "time_s,n,n,m\n0,1,2,3\n1,1,2,3\n"), &OpenOptions::default()).unwrap();
    let error = log.find("n", None).unwrap_err().to_string();
    assert!(
        error.ends_with("there are 2 channels `n`\nhint: the log has nothing to distinguish them: rename one of them"),
        "{error}"
    );
}

#[test]
fn csv_that_is_not_clean_says_so() {
    let folder = Folder::new("unclean");
    let text = "time_ms,a_rpm,b\n0,1,2\n10,,n/a\n,3,3\n20,nan,x\n30,5,6\n40,7";
    let (log, samples, notes) = read(&folder.write("log.csv", text), &OpenOptions::default()).unwrap();
    let missing = |time_s: f64| (time_s, f64::NAN, Quality::Missing);
    // The last line ends within its second cell: `7` may have been `70`.
    check(&channel(&log, &samples, "a_rpm"), [good(0.0, 1.0), good(0.03, 5.0)].into_iter(), "a");
    check(
        &channel(&log, &samples, "b"),
        [good(0.0, 2.0), missing(0.01), missing(0.02), good(0.03, 6.0)].into_iter(),
        "b",
    );
    assert_eq!(
        notes,
        [
            "1 of 6 rows have no time and are left out",
            "the last line has no end and is left out",
            "2 cells are not numbers and count as missing, the first in line 3: `n/a`",
        ]
    );
}

#[test]
fn a_last_line_without_an_end_is_never_used_silently() {
    let folder = Folder::new("cut-line");
    let rows = "time_s,a,b\n0,1,2\n1,3,4\n";
    let of = |tail: &str| {
        let (log, samples, notes) =
            read(&folder.write("log.csv", format!("{rows}{tail}")), &OpenOptions::default()).unwrap();
        (channel(&log, &samples, "a").len(), channel(&log, &samples, "b").len(), notes)
    };
    let (out, without) = (
        "the last line has no end and is left out".to_owned(),
        "the last line has no end and counts without its last cell, of which digits may be missing".to_owned(),
    );
    assert_eq!(of(""), (2, 2, vec![]));
    assert_eq!(of("2,5,6\n"), (3, 3, vec![]));
    assert_eq!(of("2,5,6\r\n"), (3, 3, vec![]));
    assert_eq!(of("2,5,6"), (3, 2, vec![without]));
    assert_eq!(of("2,5"), (2, 2, vec![out.clone()]));
    assert_eq!(of("2"), (2, 2, vec![out]));
    // A row with too few cells that has its end is a row.
    assert_eq!(of("2,5\n"), (3, 2, vec!["1 of 3 rows have fewer cells than there are columns".to_owned()]));
}

#[test]
fn what_is_no_log_is_refused_with_what_to_do() {
    let folder = Folder::new("refused");
    let cases: [(&[u8], &str); 11] = [
        (b"", ": the file is empty"),
        (b"hello", ": there are no rows"),
        (b"hello\nworld\n", ": this is no format that is known\nhint: logs are CSV"),
        (b"time_s,a\n", ": there are no rows"),
        (b"1,2\n3,4\n5,6\n", ": line 1: there is no row of names above the first row of numbers\nhint: "),
        (b"a,b\n1,2\n3,4\n", ": there is no column for the time; the first columns are a, b\nhint: "),
        (b"time,b\nfurlong,rpm\n3,4\n5,6\n", "hint: "),
        (
            b";$FILEVERSION=2.1\n;$STARTTIME=4\n 1 0.1 DT 0100 Rx 1 00\n",
            ": a CAN log has frames; a DBC defines the signals in them\nhint: give it with --dbc",
        ),
        (b"timestamp,arbitration_id,extended\n1.0,0x100,0\n", ": these are frames of a bus in a form that is not read"),
        (b"MDF     3.30    ", ": this is MDF of version 2 or 3\nhint: "),
        (b"(1.0) can0 123#00\n", ": a CAN log has frames; a DBC defines the signals in them\nhint: give it with --dbc"),
    ];
    for (bytes, message) in cases {
        let error = read(&folder.write("log", bytes), &OpenOptions::default()).map(|_| ()).unwrap_err().to_string();
        assert!(error.contains(message), "{error} | {message}");
    }
    assert!(matches!(Log::open(&folder.0.join("none"), &OpenOptions::default()), Err(logs::LogError::Io { .. })));
    let of_folder = read(&folder.0, &OpenOptions::default()).map(|_| ()).unwrap_err().to_string();
    assert!(of_folder.contains("this is a folder and no log\nhint: give the log itself"), "{of_folder}");
}

#[test]
fn a_cut_container_gives_the_frames_before_the_cut() {
    let folder = Folder::new("cut");
    let whole = std::fs::read(data("bus.blf")).unwrap();
    let path = folder.write("cut.blf", &whole[..whole.len() / 2]);
    let (log, samples, notes) = read(&path, &with_dbc()).unwrap();
    let engine = channel(&log, &samples, "N_Eng");
    assert!((5..40).contains(&engine.len()), "{}", engine.len());
    check(
        &engine,
        (0..u32::try_from(engine.len()).unwrap()).map(|i| good(f64::from(i) * 0.01, 800.0 + 10.0 * f64::from(i))),
        "N_Eng",
    );
    assert!(notes.last().unwrap().contains("byte 144: the object is cut"), "{notes:?}");
    assert!(notes.last().unwrap().ends_with("hint: the log is read up to this place"), "{notes:?}");
}
