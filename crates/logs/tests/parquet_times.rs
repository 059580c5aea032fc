//! Parquet files with more than one time.

use std::path::Path;
use std::sync::Arc;

use crate::common::{Folder, read};
use logs::OpenOptions;
use parquet::data_type::DoubleType;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;

/// Writes a Parquet file of optional numbers.
fn write(path: &Path, columns: &[(&str, &[Option<f64>])]) {
    let titles: String = columns.iter().map(|(title, _)| format!("optional double {title}; ")).collect();
    let schema = parquet::schema::parser::parse_message_type(&format!("message m {{ {titles} }}")).unwrap();
    let file = std::fs::File::create(path).unwrap();
    let properties = Arc::new(WriterProperties::default());
    let mut writer = SerializedFileWriter::new(file, Arc::new(schema), properties).unwrap();
    let mut group = writer.next_row_group().unwrap();
    for (_, cells) in columns {
        let mut column = group.next_column().unwrap().unwrap();
        let levels: Vec<i16> = cells.iter().map(|cell| i16::from(cell.is_some())).collect();
        let values: Vec<f64> = cells.iter().copied().flatten().collect();
        column.typed::<DoubleType>().write_batch(&values, Some(&levels), None).unwrap();
        column.close().unwrap();
    }
    group.close().unwrap();
    writer.close().unwrap();
}

#[test]
fn a_parquet_table_with_a_time_for_each_signal_is_refused() {
    let folder = Folder::new("parquet-two-times");
    let path = folder.0.join("log.parquet");
    let rising = |step: f64| [0.0, 1.0, 2.0, 3.0].map(|row| Some(step * row));
    let refused = |one: &str, other: (&str, [Option<f64>; 4])| {
        let signal = rising(100.0);
        write(&path, &[(one, &rising(0.01)), ("N", &signal), (other.0, &other.1), ("M", &signal)]);
        read(&path, &OpenOptions::default()).err().map(|error| error.to_string()).unwrap_or_default()
    };
    for (one, other) in [("time_s", ("time_s_2", rising(0.005))), ("time", ("other_time", rising(0.005)))] {
        let error = refused(one, other);
        let said = format!(
            "row 2: columns 1 `{one}` and 3 `{}` are both a time, and differ (`0.01` and `0.005`): a table is read over one time\n\
             hint: write a table for each of them",
            other.0
        );
        assert!(error.contains(&said), "{error}");
    }
    let ends = refused("time_s", ("time_s_2", [Some(0.0), Some(0.01), None, None]));
    assert!(ends.contains("row 3: columns 1 `time_s` and 3 `time_s_2` are both a time"), "{ends}");
    // The same time in another unit, the time of another clock at the same rate, and no time.
    for other in [
        ("time_ms", rising(10.0)),
        ("gps_time_s", rising(0.01).map(|time_s| time_s.map(|time_s| 1.7e9 + time_s))),
        ("N_time_constant_rpm", rising(3.0)),
    ] {
        assert_eq!(refused("time_s", other), "", "{other:?}");
    }
}
