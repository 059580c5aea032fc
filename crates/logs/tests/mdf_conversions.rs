//! MDF channels whose conversions make text of some numbers, or cannot be read.

use crate::common::mdf::{HEAD, append, block, places, set};
use crate::common::{Folder, channel, read};
use falcon_mdf::write::WriteCodec;
use falcon_mdf::{Mf4Writer, SignalValues};
use logs::{OpenOptions, Quality, TimeColumn};

const LINEAR: u8 = 1;
const FORMULA: u8 = 3;
const VALUE_TO_TEXT: u8 = 7;
const RANGE_TO_TEXT: u8 = 8;
const UNKNOWN: u8 = 77;

/// A conversion that names these texts and conversions, behind the other blocks; its place.
fn conversion(bytes: &mut Vec<u8>, kind: u8, values: &[f64], named: &[usize]) -> usize {
    let count = |count: usize| u16::try_from(count).unwrap().to_le_bytes();
    let (named_count, value_count) = (count(named.len()), count(values.len()));
    let fields = [[kind, 0, 0, 0], [named_count[0], named_count[1], value_count[0], value_count[1]]].concat();
    let values = [0.0, 0.0].iter().chain(values).flat_map(|value| value.to_le_bytes());
    let content: Vec<u8> = fields.into_iter().chain(values).collect();
    let own = block(b"##CC", &[&[0; 4], named].concat(), &content);
    append(bytes, &own)
}

fn text(bytes: &mut Vec<u8>, text: &str) -> usize {
    append(bytes, &block(b"##TX", &[], format!("{text}\0").as_bytes()))
}

/// A file with a time and channels of the same numbers.
fn file(codec: Option<WriteCodec>, numbers: &[u16], names: &[&str]) -> Vec<u8> {
    let mut writer = Mf4Writer::new();
    writer.set_compression(codec.is_some());
    writer.set_codec(codec.unwrap_or_default());
    let times: Vec<f64> = (0..numbers.len()).map(|i| i as f64).collect();
    let group = writer.add_group(&times).unwrap();
    for name in names {
        group.add_channel_typed_with(name, "rpm", SignalValues::U16(numbers.to_vec()), None, None).unwrap();
    }
    let mut bytes = Vec::new();
    writer.write(&mut bytes).unwrap();
    bytes
}

/// Gives the nth channel a conversion; the first is the time.
fn convert(bytes: &mut [u8], nth: usize, conversion: usize) {
    const CONVERSION_LINK: usize = 4;
    let channel = places(bytes, b"##CN\0\0\0\0")[nth];
    set(bytes, channel + HEAD + 8 * CONVERSION_LINK, conversion);
}

#[test]
fn numbers_that_a_table_of_texts_scales_are_scaled_and_its_texts_are_missing() {
    let folder = Folder::new("partial");
    let numbers = [3200, 3204, 65534, 65535, 3208];
    let names = ["by value", "by range", "as they are", "texts alone"];
    // Blocks that the crate decodes, and such that the library does.
    for codec in [None, Some(WriteCodec::TransposedDeflate), Some(WriteCodec::Zstd)] {
        let mut bytes = file(codec, &numbers, &names);
        let texts = ["Error", "SNA", "other"].map(|name| text(&mut bytes, name));
        let of_rest = [[-40.0, 0.25], [0.0, 0.25], [0.0, 1.0]];
        let [below, scaled, same] = of_rest.map(|scale| conversion(&mut bytes, LINEAR, &scale, &[]));
        let (values, ranges) = ([65534.0, 65535.0], [65534.0, 65534.0, 65535.0, 65535.0]);
        for (nth, kind, keys, rest) in [
            (1, VALUE_TO_TEXT, values.as_slice(), below),
            (2, RANGE_TO_TEXT, ranges.as_slice(), scaled),
            (3, RANGE_TO_TEXT, ranges.as_slice(), same),
            (4, VALUE_TO_TEXT, values.as_slice(), texts[2]),
        ] {
            let table = conversion(&mut bytes, kind, keys, &[texts[0], texts[1], rest]);
            convert(&mut bytes, nth, table);
        }
        let (log, samples, notes) = read(&folder.write("log.mf4", bytes), &OpenOptions::default()).unwrap();
        assert_eq!(notes, Vec::<String>::new());
        let of = |name: &str| -> Vec<(Option<f64>, Quality)> {
            let all = channel(&log, &samples, name).into_iter();
            all.map(|(_, value, quality)| (Some(value).filter(|value| !value.is_nan()), quality)).collect()
        };
        let (good, missing) = (|value: f64| (Some(value), Quality::Good), (None, Quality::Missing));
        assert_eq!(of("by value"), [good(760.0), good(761.0), missing, missing, good(762.0)], "{codec:?}");
        assert_eq!(of("by range"), [good(800.0), good(801.0), missing, missing, good(802.0)], "{codec:?}");
        // A number whose text stands beside numbers of the same scale, or of which there are only texts, stays what it is.
        let raw = numbers.map(|number| good(f64::from(number)));
        assert_eq!(of("as they are"), raw, "{codec:?}");
        assert_eq!(of("texts alone"), raw, "{codec:?}");
    }
}

#[test]
fn a_conversion_that_cannot_be_read_leaves_out_its_channel_alone() {
    let folder = Folder::new("unread");
    for codec in [None, Some(WriteCodec::Zstd)] {
        let mut bytes = file(codec, &[1, 2, 3], &["formula", "unknown", "nested", "plain"]);
        let formula = text(&mut bytes, "foo(X)");
        let formula = conversion(&mut bytes, FORMULA, &[], &[formula]);
        let unknown = conversion(&mut bytes, UNKNOWN, &[1.0], &[]);
        let name = text(&mut bytes, "SNA");
        let nested = conversion(&mut bytes, VALUE_TO_TEXT, &[9.0], &[name, unknown]);
        for (nth, own) in [(1, formula), (2, unknown), (3, nested)] {
            convert(&mut bytes, nth, own);
        }
        let (log, samples, notes) = read(&folder.write("log.mf4", &bytes), &OpenOptions::default()).unwrap();
        let names: Vec<&str> = log.channels().iter().map(|channel| channel.name.as_str()).collect();
        assert_eq!(names, ["plain"]);
        assert_eq!(samples.iter().map(|sample| sample.value).collect::<Vec<_>>(), [1.0, 2.0, 3.0]);
        assert_eq!(notes.len(), 1, "{notes:?}");
        let said = "3 channels have a conversion that cannot be read and are left out: formula (";
        assert!(notes[0].starts_with(said) && notes[0].contains("unknown (unknown conversion type 77)"), "{notes:?}");

        // Nothing is over a time that cannot be read.
        convert(&mut bytes, 0, unknown);
        let (log, _, notes) = read(&folder.write("time.mf4", &bytes), &OpenOptions::default()).unwrap();
        assert!(log.channels().is_empty());
        assert!(notes[0].contains("its time has a conversion that cannot be read"), "{notes:?}");
    }
}

#[test]
fn the_unit_of_a_time_counts_wherever_the_file_says_it() {
    const UNIT_LINK: usize = 6;
    let folder = Folder::new("time-units");
    let numbers: Vec<u16> = (0..20).collect();
    let last_s = |bytes: &[u8], time: Option<(&str, &str)>| {
        let time = time.map(|(name, unit)| TimeColumn { name: name.to_owned(), unit: Some(unit.to_owned()) });
        let options = OpenOptions { time, ..OpenOptions::default() };
        let (log, samples, notes) =
            read(&folder.write("log.mf4", bytes), &options).map_err(|error| error.to_string())?;
        Ok::<_, String>((channel(&log, &samples, "N").last().unwrap().0, notes))
    };
    // Blocks that the crate decodes, and such that the library does.
    for codec in [None, Some(WriteCodec::TransposedDeflate), Some(WriteCodec::Zstd)] {
        let plain = file(codec, &numbers, &["N"]);
        let time = places(&plain, b"##CN\0\0\0\0")[0];
        let with_unit = |unit: &str| {
            let mut bytes = plain.clone();
            let unit = if unit.is_empty() { 0 } else { text(&mut bytes, unit) };
            set(&mut bytes, time + HEAD + 8 * UNIT_LINK, unit);
            bytes
        };
        for (unit, size_s) in [
            ("s", 1.0),
            ("", 1.0),
            ("ms", 1e-3),
            ("us", 1e-6),
            ("µs", 1e-6),
            ("ns", 1e-9),
            ("min", 60.0),
            ("h", 3600.0),
            (" ms ", 1e-3),
        ] {
            let (found_s, notes) = last_s(&with_unit(unit), None).unwrap();
            assert!((found_s - 19.0 * size_s).abs() < 1e-12 * size_s, "{unit} {found_s}");
            assert_eq!(notes, Vec::<String>::new(), "{unit}");
        }
        let (found_s, notes) = last_s(&with_unit("fortnight"), None).unwrap();
        assert_eq!((found_s, notes.len()), (19.0, 1));
        assert!(notes[0].ends_with("has the unit `fortnight`, which is not known: taken as s"), "{notes:?}");
        // That of its conversion, where the channel has none.
        let mut bytes = with_unit("");
        let scale = conversion(&mut bytes, LINEAR, &[0.0, 2.0], &[]);
        let unit = text(&mut bytes, "ms");
        set(&mut bytes, scale + HEAD + 8, unit);
        convert(&mut bytes, 0, scale);
        assert!((last_s(&bytes, None).unwrap().0 - 0.038).abs() < 1e-12);
        // That of a channel map, for the times with its name.
        let name = {
            let bytes = folder.write("log.mf4", with_unit("s"));
            falcon_mdf::Mf4File::open(&bytes).unwrap().data_groups()[0].channel_groups[0].channels[0].name.clone()
        };
        assert!((last_s(&with_unit("s"), Some((&name, "ms"))).unwrap().0 - 0.019).abs() < 1e-12);
        let error = last_s(&with_unit("s"), Some((&name, "rpm"))).unwrap_err();
        assert!(
            error.contains("has the unit `rpm` in the channel map\nhint: it can be s, ms, us, ns, min or h"),
            "{error}"
        );
        let (found_s, notes) = last_s(&with_unit("s"), Some(("other", "ms"))).unwrap();
        assert_eq!(found_s, 19.0);
        assert_eq!(
            notes,
            [format!(
                "[time] of the channel map names `other` and has no effect: the times of this log are `{name}`\nhint: leave `name` out, or give one of these"
            )]
        );
    }
}
