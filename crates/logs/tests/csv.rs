//! Tables whose numbers or names can be taken for something else.

use std::path::Path;
use std::sync::Arc;

use crate::common::{Folder, channel, read};
use logs::{OpenOptions, Quality, TimeColumn};

/// The values of a channel of a table, and what was said; the error where it cannot be read.
fn values(folder: &Folder, text: &str, name: &str) -> Result<(Vec<f64>, Vec<String>), String> {
    let (log, samples, notes) =
        read(&folder.write("log.csv", text), &OpenOptions::default()).map_err(|error| error.to_string())?;
    let good = |(_, value, quality)| (quality == Quality::Good).then_some(value);
    Ok((channel(&log, &samples, name).into_iter().filter_map(good).collect(), notes))
}

#[test]
fn commas_and_points_in_one_table_are_not_both_decimal() {
    let folder = Folder::new("two-signs");
    let head = "time_s;N [rpm];U [V]\n";
    // The time of the first row is whole: its comma alone could be decimal.
    let text = format!("{head}0;1,800;1\n0.01;1,801;1\n0.02;1,802;1\n");
    let error = values(&folder, &text, "N").unwrap_err();
    let said = "log.csv: line 3: some numbers have a comma (`1,800`) and some a point (`0.01`)\nhint: write all with one decimal sign, and without a sign between thousands";
    assert!(error.ends_with(said), "{error}");
    // Where every row has both, no comma is decimal, and there is no time.
    let text = "Zeit [s];N [1/min];U [V]\n0,00;1.800;1,5\n0,01;1.801;1,5\n";
    let error = values(&folder, text, "N").unwrap_err();
    assert!(error.contains("2 of 2 rows have no time, the first is `0,00`"), "{error}");
    // A point that comes late is no decimal sign either.
    let rows: String = (0..40_000).map(|i| format!("{i};8{:02},5;1\n", i % 100)).collect();
    let (found, notes) = values(&folder, &format!("{head}{rows}40000;1.800;1\n40001;0.5;1\n"), "N").unwrap();
    assert_eq!(found.len(), 40_000);
    let said = "2 cells are not numbers and count as missing, the first in line 40002: `1.800`\nhint: write numbers without a sign between their thousands";
    assert_eq!(notes, [said]);
    let (_, notes) = values(&folder, &format!("{head}{rows}40001;0.5;1\n"), "N").unwrap();
    assert!(notes[0].ends_with("`0.5`\nhint: the decimal sign of the other numbers is a comma"), "{notes:?}");
    // A comma in the lines before the names says nothing of the numbers.
    let (found, notes) = values(&folder, &format!("Factor;1,5\n{head}0.00;800.5;1\n0.01;801.5;1\n"), "N").unwrap();
    assert_eq!((found, notes), (vec![800.5, 801.5], vec![]));
}

#[test]
fn what_looks_like_another_table_is_said() {
    let folder = Folder::new("looks-like");
    let error = |text: &str| values(&folder, text, "N").unwrap_err();
    let quoted = error("\"time_s\",\"N\"\n\"0,01\",\"800,5\"\n\"0,02\",\"801,5\"\n");
    assert!(
        quoted.contains("numbers have commas, and commas separate the columns; the first is `0,01`\nhint: "),
        "{quoted}"
    );
    let open = error("time_s,\"N\n[rpm]\",U [V]\n0.00,800.5,1\n0.01,801.5,1\n");
    assert!(open.contains("line 2: a quotation mark among the names or units is not closed in its line"), "{open}");
    let returns = error("time_s,N\r0.00,800.5\r0.01,801.5\r");
    assert!(
        returns.ends_with("its lines end with a carriage return alone\nhint: save it with line feeds"),
        "{returns}"
    );
    let no_time = error("when,1,N\n0.00,1,800.5\n0.01,1,801.5\n");
    assert!(no_time.contains("no name may be a number, such as `1` or `Inf`"), "{no_time}");
}

#[test]
fn a_name_may_be_a_number_beside_a_time() {
    let folder = Folder::new("number-names");
    for name in ["1", "Inf", "nan"] {
        for title in ["time_s", "Zeit [s]"] {
            let text = format!("{title},{name},N [rpm]\n0.00,1,800.5\n0.01,1,801.5\n");
            assert_eq!(values(&folder, &text, "N"), Ok((vec![800.5, 801.5], vec![])), "{text}");
            assert_eq!(values(&folder, &text, name), Ok((vec![1.0, 1.0], vec![])), "{text}");
        }
    }
    // A value may be the letter that is a name of the time.
    assert_eq!(
        values(&folder, "time_s,N,on\n0.00,800.5,t\n0.01,801.5,t\n", "N").map(|(found, _)| found),
        Ok(vec![800.5, 801.5])
    );
}

#[test]
fn only_thousands_in_groups_are_hinted_at() {
    let folder = Folder::new("groups");
    for (cell, is_hinted) in [
        ("1,007.25", true),
        ("1 007", true),
        ("-1'007'000", true),
        ("1.007.000", true),
        ("2024-03-31", false),
        ("31.03.2024", false),
        ("2024.03.31", false),
        ("12.345.6", true),
        ("1.2.3", false),
        ("n/a", false),
    ] {
        let text = format!("time_s,N,M\n0,1,\"{cell}\"\n1,1,\"{cell}\"\n");
        let (_, notes) = values(&folder, &text, "N").unwrap();
        assert_eq!(notes.len(), 1, "{cell} {notes:?}");
        assert_eq!(notes[0].contains("between their thousands"), is_hinted, "{cell} {notes:?}");
    }
}

#[test]
fn thousands_in_groups_are_refused_with_a_hint_whatever_stands_between_them() {
    let folder = Folder::new("thousands-in-all-rows");
    for group in [".", "\u{a0}", "\u{2009}", "\u{202f}", " ", "'", "\u{2019}"] {
        let row = |i: u32| format!("0,0{i};1{group}50{i},5;1{group}40{i},25\r\n");
        let text = format!("Zeit [s];N_Mot [1/min];N_Turb [1/min]\r\n{}", (0..4).map(row).collect::<String>());
        let (found, notes) = values(&folder, &text, "N_Mot").unwrap_or_else(|error| panic!("{group:?} {error}"));
        assert_eq!(found, Vec::<f64>::new(), "{group:?}");
        assert!(
            notes[0].starts_with("8 cells are not numbers and count as missing, the first in line 2: "),
            "{notes:?}"
        );
        assert!(notes[0].ends_with("\nhint: write numbers without a sign between their thousands"), "{notes:?}");
    }
    // A comma of the time is a decimal sign, and not one between thousands.
    let error = values(&folder, "Zeit [s];N [1/min]\n0,000;1.800\n0,010;1.801\n", "N").unwrap_err();
    assert!(
        error.contains("the first is `0,000`\nhint: write all numbers with one decimal sign, and without"),
        "{error}"
    );
}

#[test]
fn rows_in_the_order_of_falling_times_are_refused_and_single_ones_are_not() {
    let folder = Folder::new("falling");
    let row = |i: i32| format!("{}.{:02},{}\n", i / 100, i % 100, 1500 + i);
    let table =
        |order: &mut dyn Iterator<Item = i32>| format!("Time [s],N [rpm]\n{}", order.map(row).collect::<String>());
    let error = values(&folder, &table(&mut (0..200).rev()), "N").unwrap_err();
    let said = "the rows are not in order of time: 199 of 200 have a time before that of the row before\nhint: sort them by the time";
    assert!(error.ends_with(said), "{error}");
    // Two records in the wrong place, and a clock that was reset.
    let mut swapped: Vec<i32> = (0..200).collect();
    swapped.swap(20, 21);
    swapped.swap(120, 121);
    assert_eq!(values(&folder, &table(&mut swapped.into_iter()), "N").unwrap().0.len(), 198);
    assert!(values(&folder, &table(&mut (100..200).chain(0..100)), "N").is_ok());
    assert!(values(&folder, "Time [s],N [rpm]\n0.5,1\n", "N").is_ok());
}

#[test]
fn a_table_with_a_time_for_each_signal_is_refused() {
    let folder = Folder::new("two-times");
    for (one, other) in [
        ("Time [s]", "Time [s]"),
        ("Time", "time"),
        ("Time", "Time.1"),
        ("Zeit [s]", "Zeit_2 [s]"),
        ("timestamp", "timestamp (2)"),
        ("t [s]", "t [s]"),
        ("t_Eng [s]", "t_Turb [s]"),
        ("Eng_t [s]", "Turb_t [s]"),
    ] {
        let text = format!(
            "{one};N [rpm];{other};M [rpm]\n0.00;1500;0.000;1400\n0.01;1501;0.005;1401\n0.02;1502;0.010;1402\n"
        );
        let error = values(&folder, &text, "N").unwrap_err();
        assert!(error.contains("line 3: columns 1 `") && error.contains("` are both a time, and differ"), "{error}");
        assert!(
            error.contains(
                "and differ (`0.01` and `0.005`): a table is read over one time\nhint: write a table for each"
            ),
            "{error}"
        );
        // The same time twice is one clock, also with other digits.
        let same = format!("{one};N [rpm];{other};M [rpm]\n0.00;1500;0;1400\n0.01;1501;0.010;1401\n");
        assert_eq!(values(&folder, &same, "N").map(|found| found.0), Ok(vec![1500.0, 1501.0]), "{one} {other}");
    }
    // A duration with such a name is none.
    for shift_ms in [[200, 200, 200], [300, 301, 302]] {
        let row = |(i, ms): (usize, u32)| format!("0.0{i};1500;{ms};1400\n");
        let rows: String = shift_ms.into_iter().enumerate().map(row).collect();
        let text = format!("t_Log [s];N [rpm];t_Shift [ms];M [rpm]\n{rows}");
        assert_eq!(values(&folder, &text, "N").map(|found| found.0), Ok(vec![1500.0; 3]), "{text}");
    }
    let in_ms = "Time [s];N [rpm];Time [ms];M [rpm]\n0.00;1500;0;1400\n0.03;1501;30;1401\n";
    assert_eq!(values(&folder, in_ms, "N").map(|found| found.0), Ok(vec![1500.0, 1501.0]));
    // A signal of one clock ends before that of the other.
    let error = values(&folder, "Time [s];N [rpm];Time [s];M [rpm]\n0.00;1;0.00;1\n0.01;2;;\n", "N").unwrap_err();
    assert!(error.contains("line 3: columns 1 `Time` and 3 `Time` are both"), "{error}");
    // Names of the log's own.
    let by = |other: &dyn Fn(u32) -> String, title: &str| {
        let rows: String = (0..5).map(|i| format!("{};{};{};{}\n", 10 * i, 1500 + i, other(i), 1400 + i)).collect();
        let time = TimeColumn { name: "N_time".to_owned(), unit: Some("ms".to_owned()) };
        let options = OpenOptions { time: Some(time), ..OpenOptions::default() };
        let path = folder.write("log.csv", format!("N_time;N [rpm];{title};M [rpm]\n{rows}"));
        read(&path, &options).map(|_| ()).map_err(|error| error.to_string())
    };
    let error = by(&|i| format!("{}", 5 * i), "M_time").unwrap_err();
    assert!(
        error.contains("line 3: columns 1 `N_time` and 3 `M_time` are both a time, and differ (`10` and `5`)"),
        "{error}"
    );
    assert_eq!(by(&|i| format!("{}", 1.7e9 + 0.01 * f64::from(i)), "Unix time [s]"), Ok(()));
    assert_eq!(by(&|i| format!("{}", i / 3), "Engine run time [s]"), Ok(()));
    assert_eq!(by(&|i| format!("{}", 10 * i + 3), "M_time"), Ok(()));
    // No time: a temperature, a date, a time with another meaning.
    for other in ["T [degC]", "T1", "T", "time_ms", "Date", "Time at gear [rpm]", "Time to lock"] {
        let text = format!(
            "{};{other};N [rpm]\n0.00;80;1500\n0.01;81;1501\n",
            if other.starts_with("T1") { "t" } else { "t [s]" }
        );
        assert_eq!(values(&folder, &text, "N").map(|found| found.0), Ok(vec![1500.0, 1501.0]), "{other}");
    }
}

#[test]
fn exports_of_loggers_and_apps_are_read() {
    let folder = Folder::new("apps");
    let times = |text: &str, name: &str| {
        let (log, samples, _) =
            read(&folder.write("log.csv", text), &OpenOptions::default()).map_err(|error| error.to_string())?;
        Ok::<_, String>(channel(&log, &samples, name).into_iter().map(|(time_s, ..)| time_s).collect::<Vec<_>>())
    };
    // 2024-05-16 18:16:50 UTC is 1715883410 s after 1970.
    let hundredths = |first_s: f64, found: &[f64]| {
        assert_eq!(found.len(), 4, "{found:?}");
        // Doubles of seconds since 1970 are 0.24 us apart.
        found
            .iter()
            .zip([0.0, 0.01, 0.02, 0.03])
            .for_each(|(time_s, s)| assert!((time_s - first_s - s).abs() < 5e-7, "{found:?}"));
    };
    let table = |head: &str, stamp: &dyn Fn(u32) -> String| {
        format!("{head}\n{}", (0..4).map(|i| format!("{},{}.5,1400.25\n", stamp(i), 1500 + i)).collect::<String>())
    };
    let us = table("Date Time,N [rpm],M [rpm]", &|i| format!("5/16/2024 6:16:50.0{i}0 PM"));
    hundredths(1_715_883_410.0, &times(&us, "N").unwrap());
    let by_day = table("When,N [rpm],M [rpm]", &|i| format!("16/05/2024 18:16:50.0{i}0"));
    hundredths(1_715_883_410.0, &times(&by_day, "N").unwrap());
    let noon = table("Time,N [rpm],M [rpm]", &|i| format!("8:59:59.9{} AM", 6 + i));
    hundredths(32_399.96, &times(&noon, "N").unwrap());
    // The first of two times is no known form, and has whole seconds.
    let phone = table("GPS Time, Device Time, N [rpm], M [rpm]", &|i| {
        format!("Thu May 16 18:16:50 GMT+01:00 2024,16-May-2024 18:16:50.0{i}0")
    });
    hundredths(1_715_883_410.0, &times(&phone, "N").unwrap());
    let tuner = "HP Tuners CSV Log File\r\nVersion: 1.0\r\n\r\n[Log Information]\r\nCreation Time: 1/1/2024 10:00:00 AM\r\nNotes: \r\n\r\n\
                 [Channel Information]\r\n0,12,2112\r\nOffset,N,Trans Turbine RPM\r\ns,rpm,rpm\r\n\r\n[Channel Data]\r\n";
    let rows: String = (0..4).map(|i| format!("0.0{i},{}.5,1400.25\r\n", 1500 + i)).collect();
    hundredths(0.0, &times(&format!("{tuner}{rows}"), "N").unwrap());
    assert_eq!(values(&folder, &format!("{tuner}{rows}"), "N").unwrap().1, Vec::<String>::new());
    // Minutes and seconds, as a spreadsheet shows times, over the end of an hour.
    let minutes =
        table("Time,N [rpm],M [rpm]", &|i| ["59:59.8", "59:59.9", "00:00.0", "00:00.1"][i as usize].to_owned());
    let found = times(&minutes, "N").unwrap();
    found
        .iter()
        .zip([3599.8, 3599.9, 3600.0, 3600.1])
        .for_each(|(time_s, s)| assert!((time_s - s).abs() < 1e-9, "{found:?}"));
    let seconds = table("Time (sec),N [rpm],M [rpm]", &|i| format!("0.0{i}"));
    hundredths(0.0, &times(&seconds, "N").unwrap());
    let elapsed = table("Elapsed [ms],N [rpm],M [rpm]", &|i| format!("{i}0"));
    hundredths(0.0, &times(&elapsed, "N").unwrap());
}

#[test]
fn a_time_that_is_not_found_is_named_with_a_map() {
    let folder = Folder::new("no-time");
    let error = |text: &str| values(&folder, text, "N").unwrap_err();
    let map = error("N [rpm];Messzeit;M\n1500.5;0.01;1\n1501.5;0.02;1\n");
    assert!(
        map.ends_with("\nhint: name it `time_s`, or in the channel map under [time], for example\n  [time]\n  name = \"Messzeit\"\n  unit = \"ms\""),
        "{map}"
    );
}

#[test]
fn a_time_in_several_columns_is_read() {
    let folder = Folder::new("time-parts");
    let times = |text: &str| -> Vec<f64> {
        let (log, samples, _) = read(&folder.write("log.csv", text), &OpenOptions::default()).unwrap();
        assert_eq!(log.channels().last().unwrap().name, "N");
        channel(&log, &samples, "N").into_iter().map(|(time_s, ..)| time_s).collect()
    };
    let head = "Year,Month,Day,Hour,Minute,Second,Ms,N\n";
    let rows = "2024,5,16,23,59,59,990,1500.5\n2024,5,17,0,0,0,0,1501.5\n2024,5,17,0,0,,10,1502.5\n";
    assert_eq!(times(&format!("{head}{rows}")), [86_399.99, 86_400.0]);
    assert_eq!(times("Hours;Minutes;Seconds;N\n1;2;3,25;1500,5\n1;2;3,50;1501,5\n"), [3723.25, 3723.5]);
    // A name of the time of its own comes first.
    assert_eq!(times("Time,Hour,Minute,Second,N\n0.5,1,2,3,1500.5\n0.6,1,2,3,1501.5\n"), [0.5, 0.6]);
}

#[test]
fn a_date_whose_month_may_be_either_number_counts_by_its_clock() {
    let folder = Folder::new("day-or-month");
    let text = "Date Time,N\n3/4/2024 11:59:59.750 PM,1500.5\n3/5/2024 12:00:00.000 AM,1501.5\n";
    let (log, samples, notes) = read(&folder.write("log.csv", text), &OpenOptions::default()).unwrap();
    let times: Vec<f64> = channel(&log, &samples, "N").into_iter().map(|(time_s, ..)| time_s).collect();
    assert_eq!(times, [86_399.75, 86_400.0]);
    let said = "the day and the month of `3/4/2024 11:59:59.750 PM` cannot be distinguished: the time of the day counts\nhint: ";
    assert!(notes[0].starts_with(said), "{notes:?}");
}

#[test]
fn a_file_without_line_breaks_is_refused_as_such() {
    let folder = Folder::new("one-line");
    let path = folder.write("log.csv", "1.5,".repeat(9 << 20));
    let said = "line 1: the row that begins here is longer than 32 MiB\nhint: the file has no line breaks, or a quotation mark is not closed";
    let error = read(&path, &OpenOptions::default()).map(|_| ()).unwrap_err().to_string();
    assert!(error.ends_with(said), "{error}");
    let error = logs::needs_map(&path).unwrap_err().to_string();
    assert!(error.ends_with(said), "{error}");
}

/// Writes a Parquet file with a time in `us`, a gear as text, and a remark.
fn parquet_of(path: &Path, time: &str, rows: &[(i64, Option<&str>, &str)]) {
    use parquet::data_type::{ByteArrayType, Int64Type};
    use parquet::file::properties::WriterProperties;
    use parquet::file::writer::SerializedFileWriter;
    let schema =
        format!("message m {{ required int64 {time}; optional binary gear (UTF8); required binary remark (UTF8); }}");
    let schema = Arc::new(parquet::schema::parser::parse_message_type(&schema).unwrap());
    let file = std::fs::File::create(path).unwrap();
    let mut writer = SerializedFileWriter::new(file, schema, Arc::new(WriterProperties::default())).unwrap();
    let mut group = writer.next_row_group().unwrap();
    let mut column = group.next_column().unwrap().unwrap();
    let times: Vec<i64> = rows.iter().map(|row| row.0).collect();
    column.typed::<Int64Type>().write_batch(&times, None, None).unwrap();
    column.close().unwrap();
    let mut column = group.next_column().unwrap().unwrap();
    let gears: Vec<_> = rows.iter().filter_map(|row| row.1.map(|gear| gear.as_bytes().to_vec().into())).collect();
    let levels: Vec<i16> = rows.iter().map(|row| i16::from(row.1.is_some())).collect();
    column.typed::<ByteArrayType>().write_batch(&gears, Some(&levels), None).unwrap();
    column.close().unwrap();
    let mut column = group.next_column().unwrap().unwrap();
    let remarks: Vec<_> = rows.iter().map(|row| row.2.as_bytes().to_vec().into()).collect();
    column.typed::<ByteArrayType>().write_batch(&remarks, None, None).unwrap();
    column.close().unwrap();
    group.close().unwrap();
    writer.close().unwrap();
}

#[test]
fn parquet_times_of_the_day_go_on_after_midnight() {
    let folder = Folder::new("parquet-midnight");
    let path = folder.0.join("day.parquet");
    // 0.2 s before midnight and 0.2 s after it, in microseconds.
    let rows: Vec<_> = (0..40_i64).map(|i| ((86_399_800_000 + 10_000 * i) % 86_400_000_000, Some("3"), "")).collect();
    parquet_of(&path, "time (TIME(MICROS,true))", &rows);
    let (log, samples, _) = read(&path, &OpenOptions::default()).unwrap();
    let found = channel(&log, &samples, "gear");
    assert_eq!(found.len(), 40);
    for (i, (time_s, value, quality)) in (0_u32..).zip(found) {
        assert!((time_s - 86_399.8 - 0.01 * f64::from(i)).abs() < 1e-9, "{i} {time_s}");
        assert_eq!((value, quality), (3.0, Quality::Good));
    }
    // A number is no time of the day: the clock was reset.
    let rows: Vec<_> = (0..80_i64).map(|i| ((86_399_800_000 + 10_000 * i) % 86_400_000_000, Some("3"), "")).collect();
    parquet_of(&path, "time_us", &rows);
    let notes = read(&path, &OpenOptions::default()).unwrap().2;
    assert!(
        notes.contains(&"the clock was reset 1 times: the time continues one second later".to_owned()),
        "{notes:?}"
    );
}

#[test]
fn parquet_text_of_numbers_is_read_and_other_text_is_named() {
    let folder = Folder::new("parquet-text");
    let path = folder.0.join("text.parquet");
    let gears = [Some("3"), Some(" 4.0 "), None, Some("N"), Some(""), Some("5")];
    let rows: Vec<_> = (0_i64..).zip(gears).map(|(i, gear)| (10_000 * i, gear, "a remark")).collect();
    parquet_of(&path, "time_us", &rows);
    let (log, samples, notes) = read(&path, &OpenOptions::default()).unwrap();
    let found: Vec<_> =
        channel(&log, &samples, "gear").into_iter().map(|(_, value, quality)| (value, quality)).collect();
    // The letter is no gear.
    assert_eq!(found, [(3.0, Quality::Good), (4.0, Quality::Good), (0.0, Quality::Good), (5.0, Quality::Good)]);
    assert_eq!(notes, ["1 columns do not hold single numbers and are left out: remark (text or bytes)"]);
    // Names of gears are no numbers.
    parquet_of(&path, "time_us", &[(0, Some("D3"), ""), (10_000, Some("4"), ""), (20_000, Some("R"), "")]);
    let error = read(&path, &OpenOptions::default()).unwrap().2;
    assert_eq!(
        error,
        ["2 columns do not hold single numbers and are left out: gear (text or bytes), remark (text or bytes)"]
    );
}

#[test]
fn parquet_rows_in_the_order_of_falling_times_are_refused() {
    let folder = Folder::new("parquet-falling");
    let path = folder.0.join("falling.parquet");
    let rows: Vec<_> = (0..100_i64).rev().map(|i| (10_000 * i, Some("3"), "")).collect();
    parquet_of(&path, "time_us", &rows);
    let error = read(&path, &OpenOptions::default()).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("the rows are not in order of time: 99 of 100 have"), "{error}");
}
