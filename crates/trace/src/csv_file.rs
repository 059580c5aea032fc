//! Comma-separated files: one row of names with units, then one row for each time.

use std::io::{self, Write};
use std::path::Path;

use crate::{Column, Trace, TraceError, Values, Word, signal, units, write_whole};

/// Reads a comma-separated file. The first row names the columns; `time_s` (or `time_ms`) must be among
/// them and rise. An empty cell is a lost sample and becomes NaN; a column with other text holds words.
///
/// # Errors
/// The file cannot be read, has no time, a row of another length, or times that do not rise.
pub fn read_csv(path: &Path) -> Result<Trace, TraceError> {
    let io = |source| TraceError::Io { path: path.to_owned(), source };
    let table = |message: String| TraceError::Table { path: path.to_owned(), message };
    let file = std::fs::File::open(path).map_err(io)?;
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(file);
    let headers = reader.headers().map_err(|error| table(error.to_string()))?.clone();
    let names: Vec<(String, f64)> = headers.iter().map(units::to_si).collect();
    let time_at = names.iter().position(|(name, _)| name == signal::TIME).ok_or_else(|| {
        table(format!(
            "there is no column `time_s`\nhint: the columns are {}",
            headers.iter().collect::<Vec<_>>().join(", ")
        ))
    })?;
    if let Some((i, (name, _))) =
        names.iter().enumerate().find(|(i, (name, _))| names[..*i].iter().any(|(earlier, _)| earlier == name))
    {
        return Err(table(format!("column {} repeats `{name}`", i + 1)));
    }

    let mut cells: Vec<Cells> = names.iter().map(|_| Cells::default()).collect();
    let mut lines: Vec<u64> = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|error| table(error.to_string()))?;
        lines.push(record.position().map_or(0, csv::Position::line));
        for (cells, text) in cells.iter_mut().zip(record.iter()) {
            cells.push(text);
        }
    }

    let mut columns: Vec<Column> = (names.into_iter().zip(cells))
        .map(|((name, factor), cells)| Column { name, values: cells.into_values(factor) })
        .collect();
    let Values::Numbers(time_s) = columns.remove(time_at).values else {
        return Err(table("column `time_s` holds words".to_owned()));
    };
    let trace = Trace { path: Some(path.to_owned()), time_s, columns };
    check_times(path, &trace, &lines)?;
    Ok(trace)
}

fn check_times(path: &Path, trace: &Trace, lines: &[u64]) -> Result<(), TraceError> {
    if trace.is_empty() {
        return Err(TraceError::Table { path: path.to_owned(), message: "there are no rows".to_owned() });
    }
    let row = |i: usize, message: String| TraceError::Row { path: path.to_owned(), line: lines[i], message };
    if let Some(i) = trace.time_s.iter().position(|time| !time.is_finite()) {
        return Err(row(i, "the time is missing".to_owned()));
    }
    if let Some(i) = trace.time_s.windows(2).position(|pair| pair[1] <= pair[0]) {
        let (before, time) = (trace.time_s[i], trace.time_s[i + 1]);
        return Err(row(i + 1, format!("the time {time} s does not come after {before} s")));
    }
    Ok(())
}

/// Writes a comma-separated file, whole or not at all. Numbers are written so that reading gives the very
/// same ones; NaN becomes an empty cell.
///
/// # Errors
/// The file cannot be written.
pub fn write_csv(path: &Path, trace: &Trace) -> Result<(), TraceError> {
    write_whole(path, |writer| write_rows(writer, trace))
        .map_err(|source| TraceError::Io { path: path.to_owned(), source })
}

/// Writes the rows of a comma-separated file.
///
/// # Errors
/// What the writer meets.
pub fn write_rows(writer: &mut dyn Write, trace: &Trace) -> io::Result<()> {
    let mut writer = csv::Writer::from_writer(writer);
    let names = std::iter::once(signal::TIME).chain(trace.columns.iter().map(|column| column.name.as_str()));
    writer.write_record(names).map_err(into_io)?;
    let number = |value: f64| if value.is_nan() { String::new() } else { value.to_string() };
    for (i, &time_s) in trace.time_s.iter().enumerate() {
        writer.write_field(number(time_s)).map_err(into_io)?;
        for column in &trace.columns {
            match &column.values {
                Values::Numbers(numbers) => writer.write_field(number(numbers[i])),
                Values::Words(words) => writer.write_field(words[i].as_ref()),
            }
            .map_err(into_io)?;
        }
        writer.write_record(None::<&[u8]>).map_err(into_io)?;
    }
    writer.flush()
}

/// The error of the writer below, with its kind: a broken pipe must stay one.
fn into_io(error: csv::Error) -> io::Error {
    match error.into_kind() {
        csv::ErrorKind::Io(error) => error,
        other => io::Error::other(format!("{other:?}")),
    }
}

/// Cells of one column while it is read: numbers as long as every cell is one.
#[derive(Default)]
struct Cells {
    numbers: Vec<f64>,
    words: Option<Vec<String>>,
}

impl Cells {
    fn push(&mut self, text: &str) {
        if let Some(words) = &mut self.words {
            words.push(text.to_owned());
            return;
        }
        match text.parse() {
            _ if text.is_empty() => self.numbers.push(f64::NAN),
            Ok(number) => self.numbers.push(number),
            Err(_) => {
                let blank = |number: &f64| if number.is_nan() { String::new() } else { number.to_string() };
                let mut words: Vec<String> = self.numbers.iter().map(blank).collect();
                words.push(text.to_owned());
                self.words = Some(words);
            }
        }
    }

    fn into_values(self, factor: f64) -> Values {
        match self.words {
            Some(words) => Values::Words(words.into_iter().map(Word::from).collect()),
            None => Values::Numbers(self.numbers.into_iter().map(|number| number * factor).collect()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

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
    fn other_units_are_converted_to_si() {
        let path = file("units", "time_ms, Turbine_Speed_rpm\n0, 300\n10, 600\n");
        let trace = read_csv(&path).unwrap();
        assert_eq!(trace.time_s, [0.0, 0.01]);
        assert!((trace.get("turbine_speed_rad_s").unwrap()[1] - 62.831_853).abs() < 1e-6);
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    fn a_broken_file_says_where_it_is_broken() {
        assert_eq!(error("back", "time_s,a\n0,1\n0.2,1\n0.1,1\n"), "FILE:4: the time 0.1 s does not come after 0.2 s");
        assert_eq!(error("blank", "time_s,a\n0,1\n,1\n"), "FILE:3: the time is missing");
        assert_eq!(error("none", "time_s,a\n"), "FILE: there are no rows");
        assert_eq!(error("untimed", "t,a\n0,1\n"), "FILE: there is no column `time_s`\nhint: the columns are t, a");
        assert!(error("ragged", "time_s,a\n0,1\n1\n").contains("line: 3"));
    }

    #[test]
    fn a_word_among_numbers_is_named_with_its_row() {
        let path = file("word", "time_s,turbine_speed_rad_s\n0,1\n1,\n2,n/a\n");
        let message = read_csv(&path).unwrap().require("turbine_speed_rad_s").unwrap_err().to_string();
        assert!(message.contains("column `turbine_speed_rad_s` holds `n/a` (row 3), which is no number"), "{message}");
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    fn a_missing_signal_names_the_one_that_looks_near() {
        let path = file("near", "time_s,turbine_speed\n0,1\n");
        let message = read_csv(&path).unwrap().require("turbine_speed_rad_s").unwrap_err().to_string();
        assert!(message.contains("`turbine_speed` looks near"), "{message}");
        std::fs::remove_file(path).unwrap();
    }
}
