//! Frames of a bus that a test writes.

#![expect(clippy::unwrap_used, reason = "a test may")]

mod common;

use common::{Folder, channel, data, read, with_dbc};
use logs::OpenOptions;

/// Values of the signals of a log with one message, by name.
fn values(folder: &Folder, log: &str, dbc: &str, name: &str) -> Vec<f64> {
    let options = OpenOptions { dbc: Some(folder.write("own.dbc", dbc)), time: None };
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
        let error = common::read(&folder.write("bus.log", one), &with_dbc()).map(|_| ()).unwrap_err().to_string();
        assert!(error.ends_with("the only data frame stands in a last line without an end"), "{name}: {error}");
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
