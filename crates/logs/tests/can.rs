//! Frames of a bus that a test writes.

use crate::common::{Folder, channel, data, read, with_dbc};
use logs::{Log, OpenOptions, Quality};
use std::path::Path;

/// Values of the signals of a log with one message, by name.
fn values(folder: &Folder, log: &str, dbc: &str, name: &str) -> Vec<f64> {
    let options = OpenOptions { dbc: Some(folder.write("own.dbc", dbc)), ..OpenOptions::default() };
    let (log, samples, notes) = read(&folder.write("own.log", log), &options).unwrap();
    assert_eq!(notes, Vec::<String>::new());
    channel(&log, &samples, name).into_iter().map(|(_, value, _)| value).collect()
}

#[test]
fn a_multiplexor_in_another_one_has_its_ranges_however_it_is_marked() {
    let folder = Folder::new("nested-multiplexors");
    let signals = [" SG_ Deep m2 : 8|8@1+ (1,0) [0|0] \"\" A", " SG_ Range m0 : 24|8@1+ (1,0) [0|0] \"\" A"];
    let outer = " SG_ Outer M : 0|4@1+ (1,0) [0|15] \"\" A";
    let ranges = [
        "SG_MUL_VAL_ 768 Inner Outer 1-1;",
        "SG_MUL_VAL_ 768 Deep Inner 2-4, 7-7;",
        "SG_MUL_VAL_ 768 Range Outer 0-0, 3-5;",
    ];
    // The low four bits of the first byte are the outer multiplexor, the high ones the inner.
    let frame = |(i, multiplexors): (usize, &str)| format!("({i}.0) can0 300#{multiplexors}11002200000000\n");
    let log: String = ["21", "71", "51", "23", "00"].iter().enumerate().map(|(i, m)| frame((i, m))).collect();
    for mark in ["m1M", "M"] {
        let inner = format!(" SG_ Inner {mark} : 4|4@1+ (1,0) [0|15] \"\" A");
        for own in [[outer, &inner], [&inner, outer]] {
            let own = [own, signals].concat().join("\n");
            let dbc = format!("VERSION \"\"\n\nBU_: A\n\nBO_ 768 X: 8 A\n{own}\n\n{}\n", ranges.join("\n"));
            let of = |name: &str| values(&folder, &log, &dbc, name);
            assert_eq!(of("Outer"), [1.0, 1.0, 1.0, 3.0, 0.0], "{mark}");
            assert_eq!(of("Inner"), [2.0, 7.0, 5.0], "{mark}");
            assert_eq!(of("Deep"), [17.0, 17.0], "{mark}");
            assert_eq!(of("Range"), [34.0, 34.0], "{mark}");
            // Without a range of its own, a signal is in force by the multiplexor that is in no other.
            let dbc = dbc.replace(ranges[2], "");
            assert_eq!(values(&folder, &log, &dbc, "Range"), [34.0], "{mark}");
        }
    }
}

#[test]
fn a_last_frame_without_the_end_of_its_line_is_left_out() {
    let folder = Folder::new("cut-frame");
    let candump: String = (0..4).map(|i| format!("({i}.0) can0 100#400C000000000000\n")).collect();
    let asc = "date Sun Mar 31 12:00:00 2024\nbase hex  timestamps absolute\n".to_owned()
        + &(0..4).map(|i| format!("{i}.0 1 100 Rx d 8 40 0C 00 00 00 00 00 00\n")).collect::<String>();
    for (name, text) in [("candump", candump), ("asc", asc)] {
        let read = |text: &str| {
            let (log, samples, notes) = read(&folder.write("bus.log", text), &with_dbc()).unwrap();
            (channel(&log, &samples, "N_Eng").len(), notes)
        };
        assert_eq!(read(&text), (4, vec![]), "{name}");
        assert_eq!(read(&text.replace('\n', "\r\n")), (4, vec![]), "{name}");
        // Without the end alone, within the last byte, behind the last but one, and within the second.
        for cut in [1, 2, 3, 14] {
            let cut = &text[..text.len() - cut];
            assert_eq!(read(cut), (3, vec!["the last line has no end and is left out".to_owned()]), "{name} {cut}");
        }
        let one = &text[..text.find("00\n").unwrap() + 2];
        let error =
            crate::common::read(&folder.write("bus.log", one), &with_dbc()).map(|_| ()).unwrap_err().to_string();
        assert!(
            error.contains("the only data frame is in a last line without an end\nhint: the recording was cut"),
            "{name}: {error}"
        );
    }
}

#[test]
fn times_of_blf_are_those_that_their_digits_say() {
    for file in ["bus.blf", "fd.blf"] {
        let (_, samples, _) = read(&data(file), &with_dbc()).unwrap();
        assert!(!samples.is_empty());
        for sample in samples {
            let digits = format!("{:.9}", sample.time_s);
            assert_eq!(sample.time_s.to_bits(), digits.parse::<f64>().unwrap().to_bits(), "{file} {digits}");
        }
    }
}

const HEAD: &str = "VERSION \"\"\nNS_ :\nBS_:\nBU_: A\n";

#[test]
fn values_that_a_dbc_names_as_none_are_missing_and_states_stay() {
    let folder = Folder::new("named-values");
    let dbc = HEAD.to_owned()
        + "BO_ 290 M: 8 A\n SG_ N_Turb : 0|16@1+ (0.25,0) [0|16383] \"rpm\" A\n \
           SG_ Acc : 24|11@1+ (0.005,-7.22) [-7.22|3.005] \"m/s2\" A\n SG_ Gear : 40|4@1+ (1,0) [0|15] \"\" A\n\
           VAL_ 290 N_Turb 65533 \"Init\" 65534 \"Error\" 65535 \"SNA\" ;\nVAL_ 290 Acc 2046 \"Neutralwert\" 2047 \"Fehler\" ;\n\
           VAL_ 290 Gear 0 \"N\" 13 \"R\" 14 \"P\" 15 \"SNA\" ;\n";
    let frames = ["401F00A405030000", "FEFF00FE070F0000", "FDFF00FF070D0000", "FFFF00A4050E0000", "441F00A405030000"];
    let log: String = frames.iter().enumerate().map(|(i, data)| format!("(1.0{i}0000) can0 122#{data}\n")).collect();
    let options = OpenOptions { dbc: Some(folder.write("own.dbc", dbc)), ..OpenOptions::default() };
    let (log, samples, _) = read(&folder.write("own.log", log), &options).unwrap();
    let of = |name: &str| {
        let found = channel(&log, &samples, name);
        found
            .into_iter()
            .map(|(_, value, quality)| (quality == Quality::Good).then_some(value).ok_or(quality))
            .collect::<Vec<_>>()
    };
    let none = Err(Quality::Missing);
    assert_eq!(of("N_Turb"), [Ok(2000.0), none, none, none, Ok(2001.0)]);
    // 0x5a4 is 1444, and 1444 x 0.005 - 7.22 is zero.
    assert!(of("Acc").iter().map(Result::is_ok).eq([true, false, false, true, true]), "{:?}", of("Acc"));
    assert_eq!(of("Gear"), [Ok(3.0), none, Ok(13.0), Ok(14.0), Ok(3.0)]);
}

#[test]
fn all_bits_of_an_obd_percentage_are_a_hundred_per_cent() {
    let folder = Folder::new("obd");
    let dbc = |range: &str| {
        format!(
            "{HEAD}BO_ 290 M: 8 A\n SG_ Throttle : 0|8@1+ (0.39215686,0) {range} \"%\" A\n SG_ N : 8|16@1+ (0.25,0) [0|16383.75] \"rpm\" A\n"
        )
    };
    let frame = "(1.0) can0 122#FFFFFF0000000000\n";
    let quality = |range: &str, name: &str| {
        let options = OpenOptions { dbc: Some(folder.write("own.dbc", dbc(range))), ..OpenOptions::default() };
        let (log, samples, _) = read(&folder.write("own.log", frame), &options).unwrap();
        channel(&log, &samples, name)[0]
    };
    let (_, value, good) = quality("[0|100]", "Throttle");
    // Half of the last digit of the factor.
    assert!((value - 100.0).abs() < 255.0 * 0.5e-8 && good == Quality::Good, "{value} {good:?}");
    // Without a range, or for a speed, it may as well mean that there is no value.
    assert_eq!(quality("[0|0]", "Throttle").2, Quality::Saturated);
    assert_eq!(quality("[0|100]", "N").2, Quality::Saturated);
}

#[test]
fn messages_with_the_same_identifier_are_both_read_and_named() {
    let folder = Folder::new("same-identifier");
    let dbc = HEAD.to_owned()
        + "BO_ 256 Std: 8 A\n SG_ Std_Sig : 0|8@1+ (1,0) [0|0] \"\" A\nBO_ 2147483904 Ext: 8 A\n SG_ Ext_Sig : 0|8@1+ (2,0) [0|0] \"\" A\n\
           BO_ 257 Twice: 8 A\n SG_ First : 0|8@1+ (1,0) [0|0] \"\" A\nBO_ 257 TwiceB: 8 A\n SG_ Second : 8|8@1+ (1,0) [0|0] \"\" A\n";
    let log =
        "(1.0) can0 100#0506000000000000\n(1.1) can0 00000100#0709000000000000\n(1.2) can0 101#0B0C000000000000\n";
    let options = OpenOptions { dbc: Some(folder.write("own.dbc", dbc)), ..OpenOptions::default() };
    let (log, samples, notes) = read(&folder.write("own.log", log), &options).unwrap();
    let of = |name: &str| channel(&log, &samples, name).into_iter().map(|(_, value, _)| value).collect::<Vec<_>>();
    assert_eq!([of("Std_Sig"), of("Ext_Sig"), of("First"), of("Second")], [[5.0], [14.0], [11.0], [12.0]]);
    assert_eq!(
        notes,
        [
            "the messages `Twice`, `TwiceB` have the same identifier 0x101 in the DBC: each of its frames is read as all of them\nhint: delete those that are \
          not on this bus"
        ]
    );
}

#[test]
fn a_length_code_above_eight_is_eight_bytes() {
    let folder = Folder::new("length-codes");
    let count = |text: &str| {
        let (log, samples, notes) = read(&folder.write("bus.log", text), &with_dbc()).unwrap();
        assert_eq!(notes, Vec::<String>::new());
        channel(&log, &samples, "N_Eng").len()
    };
    let asc =
        |s: u32, code: &str| format!("{s}.0 1 100 Rx d {code} 40 0C 00 00 00 00 00 00  Length = 2 BitCount = 3\n");
    let head = "date Sun Mar 31 12:00:00 2024\nbase hex  timestamps absolute\n";
    assert_eq!(count(&format!("{head}{}", [asc(0, "8"), asc(1, "9"), asc(2, "a"), asc(3, "F")].concat())), 4);
    let (_, _, notes) =
        read(&folder.write("bus.log", format!("{head}{}{}", asc(0, "8"), asc(1, "16"))), &with_dbc()).unwrap();
    assert!(notes[0].starts_with("1 lines are no frames"), "{notes:?}");
    assert_eq!(
        count("(1.0)  can0  100   {F}  40 0C 00 00 00 00 00 00\n(1.1)  can0  100   [8]  40 0C 00 00 00 00 00 00\n"),
        2
    );
}

/// The head of a BLF file.
fn blf_head() -> Vec<u8> {
    [b"LOGG".as_slice(), &144_u32.to_le_bytes(), &[0; 136]].concat()
}

/// An object of a BLF file, of this kind, without what pads it.
fn blf_object(kind: u32, head: &[u8], body: &[u8]) -> Vec<u8> {
    let heads = 16 + head.len();
    let [size, heads] = [heads + body.len(), heads].map(|size| u32::try_from(size).unwrap().to_le_bytes());
    [b"LOBJ", &heads[..2], &1_u16.to_le_bytes(), &size, &kind.to_le_bytes(), head, body].concat()
}

/// A frame with the identifier 0x100 in a BLF file.
fn blf_frame(ns: i64, data: [u8; 8]) -> Vec<u8> {
    let stamp = [2_u32.to_le_bytes().as_slice(), &[0; 4], &ns.to_le_bytes()].concat();
    let body = [1_u16.to_le_bytes().as_slice(), &[0, 8], &0x100_u32.to_le_bytes(), &data].concat();
    blf_object(1, &stamp, &body)
}

#[test]
fn frames_behind_padding_of_any_size_and_value_are_read() {
    let folder = Folder::new("padding");
    let frame = |i: i64| blf_frame(10_000_000 * i, [0x40, 0x0c, 0, 0, 0, 0, 0, 0]);
    for padding in [[].as_slice(), &[0; 3], &[0xcc; 3], &[0; 5], &[7; 8]] {
        for text in 103..107 {
            let other = [blf_object(66, &[0; 16], &vec![b'y'; text]), padding.to_vec()].concat();
            let objects = [frame(0), other.clone(), frame(1), frame(2), other].concat();
            let container = blf_object(10, &[], &[[0; 16].as_slice(), &objects].concat());
            for (place, objects) in [("file", objects), ("container", container)] {
                let name = format!("{padding:?} behind {text} bytes in a {place}");
                let bytes = [blf_head(), objects].concat();
                let (log, samples, notes) = read(&folder.write("bus.blf", bytes), &with_dbc()).expect(&name);
                assert_eq!((channel(&log, &samples, "N_Eng").len(), notes), (3, vec![]), "{name}");
            }
        }
    }
}

#[test]
fn frames_of_can_fd_without_their_last_bytes_have_the_others() {
    let folder = Folder::new("trimmed");
    let stamp = [2_u32.to_le_bytes().as_slice(), &[0; 4], &10_000_000_i64.to_le_bytes()].concat();
    let (id, data) = (0x100_u32.to_le_bytes(), [0x40, 0x0c, 0, 0]);
    // Twelve bytes are announced, and four are there.
    let plain = [[1, 0, 0, 9].as_slice(), &id, &[0; 6], &[12], &[0; 5], &data].concat();
    let newest = |more: u8| [[1, 9, 12, 0].as_slice(), &id, &[0; 27], &[more], &[0; 4], &data].concat();
    let behind = [newest(76), vec![0xff; 8]].concat();
    for (kind, body) in [(100, plain), (101, newest(0)), (101, behind)] {
        let bytes = [blf_head(), blf_object(kind, &stamp, &body)].concat();
        let (log, samples, notes) = read(&folder.write("fd.blf", bytes), &with_dbc()).unwrap();
        assert_eq!((channel(&log, &samples, "N_Eng").len(), notes), (1, vec![]), "{kind} {body:?}");
        // A signal of the bytes that are not there is missing.
        assert_eq!(channel(&log, &samples, "N_Eng")[0].2, Quality::Good);
    }
}

#[test]
fn frames_before_the_start_of_a_recording_have_negative_times() {
    let folder = Folder::new("negative-times");
    let frames: Vec<u8> =
        (0..500_i64).flat_map(|i| blf_frame(-1_000_000_000 + 10_000_000 * i, [0x40, 0x0c, 0, 0, 0, 0, 0, 0])).collect();
    let asc: String =
        (0..500).map(|i| format!("{:.6} 1 100 Rx d 8 40 0C 00 00 00 00 00 00\n", -1.0 + 0.01 * f64::from(i))).collect();
    let candump: String =
        (0..500).map(|i| format!("({:.6}) can0 100#400C000000000000\n", -1.0 + 0.01 * f64::from(i))).collect();
    for (name, bytes) in [
        ("blf", [blf_head(), frames].concat()),
        ("asc", format!("date Sun Mar 31 12:00:00 2024\nbase hex  timestamps absolute\n{asc}").into_bytes()),
        ("candump", candump.into_bytes()),
    ] {
        let (log, samples, notes) = read(&folder.write("bus.log", bytes), &with_dbc()).unwrap();
        let found = channel(&log, &samples, "N_Eng");
        assert_eq!((found.len(), notes), (500, vec![]), "{name}");
        for (i, (time_s, _, quality)) in (0_u32..).zip(found) {
            assert!(
                (time_s + 1.0 - 0.01 * f64::from(i)).abs() < 1e-9 && quality == Quality::Good,
                "{name} {time_s} {quality:?}"
            );
        }
    }
}

#[test]
fn a_text_in_any_encoding_is_the_same_bus_log() {
    type Encode<'e> = &'e dyn Fn(&str) -> Vec<u8>;
    let folder = Folder::new("encodings");
    let wide = |text: &str, mark: bool, order: fn(u16) -> [u8; 2]| {
        let mark = mark.then_some(0xfeff);
        mark.into_iter().chain(text.encode_utf16()).flat_map(order).collect::<Vec<u8>>()
    };
    let dbc = std::fs::read_to_string(data("bus.dbc")).unwrap();
    let candump: String = (0..4).map(|i| format!("({i}.0) can0 100#400C000000000000\n")).collect();
    let asc = "date Sun Mar 31 12:00:00 2024\nbase hex  timestamps absolute\n".to_owned()
        + &(0..4).map(|i| format!("{i}.0 1 100 Rx d 8 40 0C 00 00 00 00 00 00\n")).collect::<String>();
    let encodings: [Encode<'_>; 5] = [
        &|text| [&[0xef, 0xbb, 0xbf], text.as_bytes()].concat(),
        &|text| wide(text, true, u16::to_le_bytes),
        &|text| wide(text, true, u16::to_be_bytes),
        &|text| wide(text, false, u16::to_le_bytes),
        &|text| wide(text, false, u16::to_be_bytes),
    ];
    for (i, encoded) in encodings.iter().enumerate() {
        for text in [&candump, &asc] {
            let options = OpenOptions { dbc: Some(folder.write("own.dbc", encoded(&dbc))), ..OpenOptions::default() };
            let (log, samples, notes) =
                read(&folder.write("bus.log", encoded(text)), &options).unwrap_or_else(|error| panic!("{i} {error}"));
            assert_eq!((channel(&log, &samples, "N_Eng").len(), notes), (4, vec![]), "{i}");
        }
        let map = folder.write("map.toml", encoded("[channel.engine_speed]\r\nname = \"Größe\"\r\n"));
        let map = logs::ChannelMap::read(&map).unwrap_or_else(|error| panic!("{i} {error}"));
        assert_eq!(map.channels[0].names, ["Größe"]);
    }
}

#[test]
fn a_dbc_in_memory_is_read_as_its_file_and_has_a_largest_size() {
    let bytes = std::fs::read(data("bus.dbc")).unwrap();
    let log = std::fs::read(data("bus.log")).unwrap();
    let of_text = OpenOptions { dbc: Some("bus.dbc".into()), dbc_text: Some(bytes.into()), ..OpenOptions::default() };
    let opened = Log::of_bytes(Path::new("bus.log"), &of_text, log.into()).unwrap();
    assert_eq!(opened.channels(), Log::open(&data("bus.log"), &with_dbc()).unwrap().channels());
    let huge = vec![b' '; 33 << 20];
    let error = logs::can::Database::of_text(Path::new("huge.dbc"), &huge).unwrap_err();
    assert!(error.to_string().contains("huge.dbc: this is larger than any DBC"), "{error}");
}
