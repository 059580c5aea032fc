//! An hour of a drive as recorders write it.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use falcon_mdf::write::WriteCodec;
use falcon_mdf::{Conversion, Mf4Writer, SignalValues};
use parquet::basic::Compression;
use parquet::data_type::DoubleType;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;

/// Group: period of its clock, s; channels: name, and the size of their smallest step.
const GROUPS: [(f64, &[(&str, f64)]); 4] = [
    (0.005, &[("N_Turb", 0.25), ("N_Out", 0.25)]),
    (0.010, &[("I_E", 1.0), ("I_C", 1.0), ("N_Eng", 0.25)]),
    (0.020, &[("N_Whl", 0.125), ("Pedal", 0.4)]),
    (0.100, &[("Gear", 1.0), ("TargetGear", 1.0)]),
];
const LENGTH_S: f64 = 3600.0;

/// Writes it as the ending of the file says.
pub(crate) fn write(path: &Path) {
    match path.extension() {
        Some(ending) if ending == "parquet" => write_parquet(path),
        _ => write_mdf(path),
    }
}

fn times(first_s: f64, period_s: f64) -> Vec<f64> {
    (0..).map(|row| first_s + period_s * f64::from(row)).take_while(|time_s| *time_s < LENGTH_S).collect()
}

/// Slow waves with the noise of the last digit, in smallest steps.
fn values(times: &[f64], channel: usize, step: f64) -> Vec<i16> {
    let raw = |(row, time_s): (usize, &f64)| {
        let wave = (0.05 * time_s + channel as f64).sin() + 0.3 * (0.31 * time_s).sin();
        (100.0 * wave / step) as i16 + (row.wrapping_mul(2_654_435_761) >> 7 & 1) as i16
    };
    times.iter().enumerate().map(raw).collect()
}

/// Each group with its clock, in transposed and deflated blocks; values are scaled whole numbers.
fn write_mdf(path: &Path) {
    let mut writer = Mf4Writer::new();
    writer.set_compression(true);
    writer.set_codec(WriteCodec::TransposedDeflate);
    for (number, (period_s, channels)) in GROUPS.iter().enumerate() {
        let times = times(0.0013 * number as f64, *period_s);
        let group = writer.add_group(&times).unwrap();
        for (channel, (name, step)) in channels.iter().enumerate() {
            let raw = SignalValues::I16(values(&times, channel, *step));
            let scaled = Conversion::Linear { offset: 0.0, factor: *step };
            group.add_channel_typed_with(name, "", raw, None, Some(scaled)).unwrap();
        }
    }
    writer.write_to_file(path).unwrap();
}

/// One table at 100 Hz, with the compression and the dictionaries that pandas takes.
fn write_parquet(path: &Path) {
    let times = times(0.0, 0.01);
    let channels = GROUPS.iter().flat_map(|(_, channels)| channels.iter().enumerate());
    let mut columns = vec![("time_s", times.clone())];
    for (channel, (name, step)) in channels {
        columns.push((name, values(&times, channel, *step).into_iter().map(|raw| f64::from(raw) * step).collect()));
    }
    let fields: String = columns.iter().map(|(name, _)| format!("optional double {name};")).collect();
    let schema = Arc::new(parse_message_type(&format!("message rows {{ {fields} }}")).unwrap());
    let properties = WriterProperties::builder().set_compression(Compression::SNAPPY).build();
    let mut file = SerializedFileWriter::new(File::create(path).unwrap(), schema, Arc::new(properties)).unwrap();
    let mut group = file.next_row_group().unwrap();
    for (_, values) in &columns {
        let mut column = group.next_column().unwrap().unwrap();
        let present = vec![1; values.len()];
        column.typed::<DoubleType>().write_batch(values, Some(&present), None).unwrap();
        column.close().unwrap();
    }
    group.close().unwrap();
    file.close().unwrap();
}
