use std::path::PathBuf;

use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::Rng as _;

use super::records::READ_AT_ONCE;
use super::writer::put_number;
use super::*;
use crate::signal;

fn file(name: &str, text: &str) -> PathBuf {
    let path = std::env::temp_dir().join(format!("wetclutch-csv-{}-{name}.csv", std::process::id()));
    std::fs::write(&path, text).unwrap();
    path
}

fn error(name: &str, text: &str) -> String {
    let path = file(name, text);
    let message = read_csv(&path).unwrap_err().to_string();
    std::fs::remove_file(&path).unwrap();
    message.replace(path.to_str().unwrap(), "FILE")
}

#[test]
fn numbers_survive_a_round_trip_to_the_last_bit() {
    let mut trace = Trace::with_columns(&["a_pa", "b_rad_s"]);
    trace.push(0.1, &[1.0 / 3.0, f64::NAN]);
    trace.push(0.2, &[-1e-300, 6.02e23]);
    trace.add_words("phase", vec!["torque_phase".into(), "inertia_phase".into()]);
    let path = file("round", "");
    write_csv(&path, &trace).unwrap();
    let back = read_csv(&path).unwrap();
    assert_eq!(back.get("a_pa").unwrap(), trace.get("a_pa").unwrap());
    assert!(back.get("b_rad_s").unwrap()[0].is_nan());
    assert_eq!(back.columns[2], trace.columns[2]);
    std::fs::remove_file(path).unwrap();
}

#[test]
fn a_table_in_utf_16_or_with_a_mark_is_the_same_table() {
    let text = "time_s,a_pa\r\n0,1.5\r\n0.1,2.5\r\n";
    let wide = |mark: Option<u16>, order: fn(u16) -> [u8; 2]| -> Vec<u8> {
        mark.into_iter().chain(text.encode_utf16()).flat_map(order).collect()
    };
    let path = file("encodings", "");
    for bytes in [
        text.as_bytes().to_vec(),
        [&[0xef, 0xbb, 0xbf], text.as_bytes()].concat(),
        wide(Some(0xfeff), u16::to_le_bytes),
        wide(Some(0xfeff), u16::to_be_bytes),
        wide(None, u16::to_le_bytes),
    ] {
        std::fs::write(&path, &bytes).unwrap();
        assert_eq!(read_csv(&path).unwrap().get("a_pa"), Some([1.5, 2.5].as_slice()), "{:?}", &bytes[..4]);
    }
    std::fs::remove_file(path).unwrap();
}

#[test]
fn numbers_are_as_short_as_those_of_display_and_read_back_the_same() {
    let written = |number: f64| {
        let mut row = Vec::new();
        let end = put_number(&mut row, 0, number);
        String::from_utf8(row[..end].to_vec()).unwrap()
    };
    let some = [0.0, -0.0, 1.0, -1.5, 1e-5, 1.2e-5, 9e15, 1e16, 1.5e300, -5e-324, f64::INFINITY, f64::MIN_POSITIVE];
    // All sizes.
    let mut random = Pcg64Mcg::new(1);
    let random = std::iter::repeat_with(|| {
        let bits = random.next_u64();
        [f64::from_bits(bits), f64::from_bits(bits >> 12 | 0x3ff0_0000_0000_0000) * 1000.0]
    });
    for number in some.into_iter().chain(random.take(100_000).flatten()).filter(|number| !number.is_nan()) {
        let text = written(number);
        // Where two shortest numbers are equally near, the last digit may be the other one.
        let is_tiny = number != 0.0 && number.abs() < 1e-15;
        assert!(is_tiny || text.len() == number.to_string().len(), "{text} {number}");
        assert!(!is_tiny || text.len() <= 25, "{text}");
        assert_eq!(text.parse::<f64>().unwrap().to_bits(), number.to_bits(), "{text} {number}");
    }
    assert_eq!(written(f64::NAN), "");
    let plain = [
        (1e-7, "0.0000001"),
        (-1.25e-7, "-0.000000125"),
        (1.2e-5, "0.000012"),
        (1e-16, "1e-16"),
        (-1.25e-150, "-1.25e-150"),
        (1e16, "10000000000000000"),
        (-1.5e17, "-150000000000000000"),
        (5e22, "50000000000000000000000"),
        (f64::NEG_INFINITY, "-inf"),
    ];
    for (number, text) in plain {
        assert_eq!(written(number), text);
    }
}

#[test]
fn words_with_signs_of_the_format_are_quoted_and_a_row_has_a_cell_for_each_name() {
    let mut writer = CsvWriter::new(Vec::new(), ["a, b", "c"]).unwrap();
    writer.row(0.5, [Cell::Word("say \"x\"\n"), Cell::Whole(7)]).unwrap();
    assert!(writer.row(1.0, [Cell::Number(1.0)]).is_err());
    writer.row(2.0, [Cell::Number(f64::NAN), Cell::Word("")]).unwrap();
    let text = String::from_utf8(writer.finish().unwrap()).unwrap();
    assert_eq!(text, "time_s,\"a, b\",c\n0.5,\"say \"\"x\"\"\n\",7\n2,,\n");
}

#[test]
fn cells_that_repeat_those_of_the_row_before_are_written_as_all_others() {
    // Some hundred kilobytes: many times what is handed on at once.
    let words = ["good", "", "a, b", "say \"x\""];
    let numbers = [0.5, f64::NAN, -0.0, 0.0, 1.0 / 3.0];
    let mut bits = Pcg64Mcg::new(1);
    let mut random = |below: usize| (bits.next_u64() >> 33) as usize % below;
    let names = ["w0", "x", "w1", "w2", "n", "w3"];
    let mut plain = CsvWriter::new(Vec::new(), names).unwrap();
    let mut repeating = CsvWriter::new(Vec::new(), names).unwrap();
    let mut before: Option<[usize; 4]> = None;
    for row in 0..20_000_u32 {
        let said = std::array::from_fn(|i| match before {
            Some(before) if random(4) > 0 => before[i],
            _ => random(words.len()),
        });
        let cells = |word: &dyn Fn(usize) -> Cell<'static>| {
            let number = Cell::Number(numbers[row as usize / 7 % numbers.len()]);
            [word(0), number, word(1), word(2), Cell::Whole(u64::from(row / 3)), word(3)]
        };
        let time_s = f64::from(row / 2);
        plain.row(time_s, cells(&|i| Cell::Word(words[said[i]]))).unwrap();
        let is_same = |i: usize| before.is_some_and(|before| before[i] == said[i]);
        let word = |i: usize| match is_same(i) {
            true if i == 3 && row % 2 == 0 => Cell::SameWords,
            true => Cell::SameWord,
            false => Cell::Word(words[said[i]]),
        };
        repeating.row(time_s, cells(&word)).unwrap();
        if row % 1000 == 7 {
            repeating.flush().unwrap();
        }
        // A row that is refused leaves nothing; after it, nothing can be repeated.
        before = (row % 500 != 3).then_some(said);
        if before.is_none() {
            assert!(repeating.row(0.0, [Cell::Number(9.0)]).is_err());
        }
    }
    let [plain, repeating] = [plain, repeating].map(|writer| String::from_utf8(writer.finish().unwrap()).unwrap());
    assert!(plain == repeating);
}

#[test]
fn a_row_cannot_repeat_what_no_row_has() {
    let mut writer = CsvWriter::new(Vec::new(), ["word", "x"]).unwrap();
    assert!(writer.row(0.0, [Cell::SameWord, Cell::Number(1.0)]).is_err());
    writer.row(1.0, [Cell::Word("good"), Cell::Number(1.0)]).unwrap();
    // A number is no word.
    assert!(writer.row(2.0, [Cell::SameWord, Cell::SameWord]).is_err());
    assert!(writer.row(2.0, [Cell::SameWords]).is_err());
    // The row that was refused is not the row before, nor is the one before it any more.
    assert!(writer.row(2.0, [Cell::SameWord, Cell::Number(1.0)]).is_err());
    assert_eq!(String::from_utf8(writer.finish().unwrap()).unwrap(), "time_s,word,x\n1,good,1\n");
    let mut both = CsvWriter::new(Vec::new(), ["x", "one", "other"]).unwrap();
    let row = [Cell::Number(0.5), Cell::SameWords];
    assert!(both.row(0.0, row).is_err());
    both.row(0.0, [Cell::Number(0.1), Cell::Word("a"), Cell::Word("b, c")]).unwrap();
    both.row(1.0, row).unwrap();
    both.row(1.0, row).unwrap();
    // Nothing comes after the words.
    assert!(both.row(2.0, [Cell::Number(0.5), Cell::SameWords, Cell::SameWord]).is_err());
    assert_eq!(both.finish().unwrap(), b"time_s,x,one,other\n0,0.1,a,\"b, c\"\n1,0.5,a,\"b, c\"\n1,0.5,a,\"b, c\"\n");
    let mut alone = CsvWriter::without_time(Vec::new(), ["word"]).unwrap();
    for cell in [Cell::Word(""), Cell::SameWord, Cell::Word("x"), Cell::SameWord] {
        alone.cells([cell]).unwrap();
    }
    assert_eq!(alone.finish().unwrap(), b"word\n\"\"\n\"\"\nx\nx\n");
}

#[test]
fn the_number_of_a_cell_is_the_one_nearest_to_its_text() {
    let mut bits = 0x2545_f491_4f6c_dd1d_u64;
    let mut random = move |below: u64| {
        bits ^= bits << 13;
        bits ^= bits >> 7;
        bits ^= bits << 17;
        (bits >> 20) % below
    };
    let expect = |text: &str| {
        let (read, expected) = (number(text.as_bytes()), text.parse::<f64>().ok());
        assert_eq!(read.map(f64::to_bits), expected.map(f64::to_bits), "{text}");
    };
    // Digits with a point anywhere, with some other signs among them.
    for _ in 0..100_000 {
        let length = 1 + random(20) as usize;
        let mut text: Vec<u8> = (0..length).map(|_| b'0' + random(10) as u8).collect();
        if random(4) > 0 {
            text.insert(random(length as u64 + 1) as usize, b'.');
        }
        if random(3) == 0 {
            text.insert(0, b'-');
        }
        if random(10) == 0 {
            let at = random(text.len() as u64) as usize;
            text[at] = b"x:/ e-+.\xb0"[random(9) as usize];
        }
        if let Ok(text) = std::str::from_utf8(&text)
            && text.trim() == text
        {
            expect(text);
        }
    }
    for text in
        ["0", "-0", "-0.0", ".5", "5.", "-.5", ".", "-", "-.", "--1", "+1", "1e5", "1.5e-3", "inf", "0.00000000000001"]
    {
        expect(text);
    }
}

#[test]
fn other_units_are_converted_to_si() {
    let path = file("units", "time_ms, Turbine_Speed_rpm\n0, 300\n10, 600\n");
    let trace = read_csv(&path).unwrap();
    assert_eq!(trace.time_s, [0.0, 0.01]);
    assert!((trace.get("turbine_speed_rad_s").unwrap()[1] - 62.831_853).abs() < 1e-6);
    std::fs::remove_file(path).unwrap();
}

#[test]
fn an_empty_cell_and_nan_are_readings_that_did_not_come() {
    let text = "time_ms,wheel_speed_rpm,wheel_speed_age_ms\n0,60,0\n10,,\n20, NaN ,nan\n30,-nan,\n40,120,7\n";
    let path = file("holes", text);
    let (whole, mut rows) = (read_csv(&path).unwrap(), CsvRows::open(&path).unwrap());
    for name in [signal::WHEEL_SPEED, signal::age_of(signal::WHEEL_SPEED).unwrap()] {
        let came: Vec<bool> = whole.get(name).unwrap().iter().map(|value| !value.is_nan()).collect();
        assert_eq!(came, [true, false, false, false, true], "{name}");
    }
    assert!((whole.get("wheel_speed_age_s").unwrap()[4] - 0.007).abs() < 1e-12);
    let column = rows.require(signal::WHEEL_SPEED).unwrap();
    for &expected in whole.get(signal::WHEEL_SPEED).unwrap() {
        assert!(rows.advance().unwrap());
        let number = rows.number(column).unwrap();
        assert!(number == expected || number.is_nan() && expected.is_nan());
    }
    std::fs::remove_file(path).unwrap();
}

#[test]
fn only_a_last_line_without_an_end_loses_what_may_be_cut() {
    // Names, rows and what is said, of a log that comes in pieces of each of these sizes.
    let rows = |text: &str, at_once: usize| {
        let input = Box::new(crate::slow::Slow(text.as_bytes().to_vec(), at_once));
        let mut rows = CsvRows::of_log(Path::new("log"), input).unwrap();
        let mut read = Vec::new();
        while rows.advance().unwrap() {
            read.push(
                [rows.time_s(), rows.number(0).unwrap(), rows.number(1).unwrap()]
                    .map(|number| if number.is_nan() { None } else { Some(number) }),
            );
        }
        (read, rows.cut().unwrap_or_default().contains("left out"), rows.cut().is_some())
    };
    let row = |time_s: f64, a: f64| [Some(time_s), Some(time_s), Some(a)];
    let first = row(1.0, 2.0);
    let emptied = [Some(3.0), Some(3.0), None];
    for at_once in [1, 3, 1000] {
        for (text, expected) in [
            ("time_s,a\n1,2\n3,4\n", (vec![first, row(3.0, 4.0)], false, false)),
            ("time_s,a\r\n1,2\r\n3,4\r", (vec![first, row(3.0, 4.0)], false, false)),
            ("time_s,a\n1,2\n3,4", (vec![first, emptied], false, true)),
            ("time_s,a\n1,2\n3,", (vec![first, emptied], false, true)),
            ("time_s,a\n1,2\n\"3\",\"4\"", (vec![first, emptied], false, true)),
            ("time_s,a\n1,2\n3", (vec![first], true, true)),
            // Digits of the time may be missing.
            ("a,time_s\n2,1\n4,3", (vec![[Some(1.0), Some(2.0), Some(1.0)]], true, true)),
        ] {
            assert_eq!(rows(text, at_once), expected, "{text:?} by {at_once}");
        }
    }
    let mut more = CsvRows::of_log(Path::new("log"), Box::new("time_s,a\n1,2\n3,4,5".as_bytes())).unwrap();
    assert!(more.advance().unwrap());
    assert!(more.advance().unwrap_err().to_string().contains("the row has 3 cells"));
    // A table that the program wrote is not taken for cut.
    let path = file("whole", "time_s,a\n1,2\n3,4");
    assert_eq!(read_csv(&path).unwrap().get("a").unwrap(), [2.0, 4.0]);
    std::fs::remove_file(path).unwrap();
}

#[test]
fn a_local_time_is_read_by_a_map() {
    for time in ["31.03.2024 01:59:30.000", "2024-03-31", "1:59:30"] {
        let text = format!("time_s,x\n{time},1\n");
        let mut rows = CsvRows::of_log(Path::new("log.csv"), Box::new(io::Cursor::new(text.into_bytes()))).unwrap();
        let message = rows.advance().unwrap_err().to_string();
        assert!(message.contains("which is not a number") && message.contains("--map map.toml"), "{message}");
    }
}

#[test]
fn a_broken_file_says_where_it_is_broken() {
    assert_eq!(
        error("back", "time_s,a\n0,1\n0.2,1\n0.1,1\n"),
        "FILE:4: the time 0.1 s is not after the time before it, 0.2 s\nhint: sort the rows by time, and remove repeated ones"
    );
    assert_eq!(error("blank", "time_s,a\n0,1\n,1\n"), "FILE:3: the time is missing");
    assert_eq!(error("windows", "time_s,a\r\n0,1\r\n\r\n,1\r\n"), "FILE:4: the time is missing");
    assert_eq!(error("none", "time_s,a\n"), "FILE: there are no rows");
    assert_eq!(error("untimed", "t,a\n0,1\n"), "FILE: there is no column `time_s`\nhint: the columns are t, a");
    assert_eq!(
        error("ragged", "time_s,a\n0,1\n1\n"),
        "FILE:3: the row has 1 cells, but the first line names 2 columns\nhint: write an empty cell where there is no value"
    );
    assert_eq!(
        error("comma", "time_s,a\n0,1,\n"),
        "FILE:2: the row has 3 cells, but the first line names 2 columns\nhint: write an empty cell where there is no value"
    );
    assert_eq!(error("empty", ""), "FILE: the file is empty");
    assert_eq!(error("endless", "time_s,a\n0,1\n1e400,1\n"), "FILE:3: the time is 1e400");
    assert_eq!(error("nan", "time_s,a\nNaN,1\n"), "FILE:2: the time is NaN");
    assert_eq!(
        error("time", "time_s,a\n0,1\nnoon,1\n"),
        "FILE:3: column `time_s` contains `noon`, which is not a number\nhint: leave a lost sample empty"
    );
}

#[test]
fn one_signal_in_two_columns_is_refused_by_their_places() {
    assert_eq!(
        error("twins", "time_s,turbine_speed_rpm,a,turbine_speed_rad_s\n0,1,1,1\n"),
        "FILE: columns 2 `turbine_speed_rpm` and 4 `turbine_speed_rad_s` are the same signal\nhint: remove one of them"
    );
}

#[test]
fn a_million_columns_are_read_and_the_hint_names_a_few() {
    let names: Vec<String> = (0..1_000_000).map(|i| format!("c{i}")).collect();
    let message = error("wide", &format!("{}\n0\n", names.join(",")));
    assert!(message.contains("there is no column `time_s`") && message.len() < 1000, "{message}");
    assert!(message.contains("c19 and 999980 more"), "{message}");
}

#[test]
fn what_spreadsheets_write_is_read() {
    let path = file("spreadsheet", "\u{feff}\"time_s\",a,,\r\n\"0\", 1 ,,\r\n\r\n0.5,\"2\",x,\r\n");
    let trace = read_csv(&path).unwrap();
    std::fs::remove_file(path).unwrap();
    assert_eq!((trace.time_s.as_slice(), trace.columns.len()), (&[0.0, 0.5][..], 1));
    assert_eq!(trace.get("a").unwrap(), [1.0, 2.0]);
}

#[test]
fn a_row_without_an_end_does_not_fill_the_memory() {
    // An open quotation mark takes in every line that follows. What the reader holds of the row before is not
    // counted.
    let text = format!("time_s\n0\n\"{}", "x\n".repeat((LONGEST_ROW + READ_AT_ONCE) / 2));
    assert!(error("quote", &text).starts_with("FILE:3: the row that begins here is longer than 32 MiB\nhint: "));
}

#[test]
fn what_is_no_text_is_named_without_harm_to_the_terminal() {
    let path = file("binary", "");
    std::fs::write(&path, [0x1b, b'[', b'2', b'J', 0xff, 0x00, b',', 0xfe, b'\n', 1, b',', 2]).unwrap();
    let message = read_csv(&path).unwrap_err().to_string();
    std::fs::remove_file(path).unwrap();
    assert!(message.contains("there is no column `time_s`"), "{message}");
    assert!(message.chars().all(|c| c == '\n' || !c.is_control()), "{message:?}");
}

#[test]
fn a_folder_is_no_file() {
    assert!(matches!(read_csv(&std::env::temp_dir()), Err(TraceError::Io { .. })));
}

#[test]
fn a_word_among_numbers_is_named_with_its_row() {
    let path = file("word", "time_s,turbine_speed_rad_s\n0,1\n1,\n2,n/a\n");
    let message = read_csv(&path).unwrap().require("turbine_speed_rad_s").unwrap_err().to_string();
    assert!(
        message.contains("column `turbine_speed_rad_s` contains `n/a` (row 3), which is not a number"),
        "{message}"
    );
    std::fs::remove_file(path).unwrap();
}

#[test]
fn a_missing_signal_names_the_one_that_looks_near() {
    let path = file("near", "time_s,turbine_speed\n0,1\n");
    let message = read_csv(&path).unwrap().require("turbine_speed_rad_s").unwrap_err().to_string();
    assert!(message.contains("`turbine_speed` has a similar name"), "{message}");
    std::fs::remove_file(path).unwrap();
}
