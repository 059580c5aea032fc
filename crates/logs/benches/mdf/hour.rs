//! An hour of a drive as a recorder writes it.

use std::path::Path;

use falcon_mdf::write::WriteCodec;
use falcon_mdf::{Conversion, Mf4Writer, SignalValues};

/// Group: period of its clock, s; channels: name, and the size of their least step.
const GROUPS: [(f64, &[(&str, f64)]); 4] = [
    (0.005, &[("N_Turb", 0.25), ("N_Out", 0.25)]),
    (0.010, &[("I_E", 1.0), ("I_C", 1.0), ("N_Eng", 0.25)]),
    (0.020, &[("N_Whl", 0.125), ("Pedal", 0.4)]),
    (0.100, &[("Gear", 1.0), ("TargetGear", 1.0)]),
];
const LENGTH_S: f64 = 3600.0;

/// Writes it with transposed and deflated blocks; values are scaled whole numbers.
pub(crate) fn write(path: &Path) {
    let mut writer = Mf4Writer::new();
    writer.set_compression(true);
    writer.set_codec(WriteCodec::TransposedDeflate);
    for (number, (period_s, channels)) in GROUPS.iter().enumerate() {
        let times: Vec<f64> = (0..)
            .map(|row| 0.0013 * number as f64 + period_s * f64::from(row))
            .take_while(|time_s| *time_s < LENGTH_S)
            .collect();
        let group = writer.add_group(&times).unwrap();
        for (channel, (name, step)) in channels.iter().enumerate() {
            // Slow waves with the noise of the last digit.
            let raw = |(row, time_s): (usize, &f64)| {
                let wave = (0.05 * time_s + channel as f64).sin() + 0.3 * (0.31 * time_s).sin();
                (100.0 * wave / step) as i16 + (row.wrapping_mul(2_654_435_761) >> 7 & 1) as i16
            };
            let raw = SignalValues::I16(times.iter().enumerate().map(raw).collect());
            let scaled = Conversion::Linear { offset: 0.0, factor: *step };
            group.add_channel_typed_with(name, "", raw, None, Some(scaled)).unwrap();
        }
    }
    writer.write_to_file(path).unwrap();
}
