//! Tables whose numbers or names can be taken for something else.

mod common;

use common::{Folder, channel, read};
use logs::{OpenOptions, Quality};

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
    assert!(quoted.contains("numbers have commas and stand between commas, the first is `0,01`\nhint: "), "{quoted}");
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
