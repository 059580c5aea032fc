//! MDF files that a test writes: the block compressions of MDF 4.3.

mod common;

use common::{Folder, channel, read};
use falcon_mdf::Mf4Writer;
use falcon_mdf::write::WriteCodec;
use logs::OpenOptions;

#[test]
fn blocks_of_every_compression_give_the_same_samples() {
    let folder = Folder::new("codecs");
    let times: Vec<f64> = (0..5000).map(|i| f64::from(i) * 0.01).collect();
    let speed: Vec<f64> = times.iter().map(|t| 200.0 + 50.0 * t.sin()).collect();
    let codecs = [
        WriteCodec::Deflate,
        WriteCodec::TransposedDeflate,
        WriteCodec::Zstd,
        WriteCodec::TransposedZstd,
        WriteCodec::Lz4,
        WriteCodec::TransposedLz4,
    ];
    let read_with = |codec: Option<WriteCodec>| {
        let mut writer = Mf4Writer::new();
        writer.set_compression(codec.is_some());
        writer.set_codec(codec.unwrap_or_default());
        writer.add_group(&times).unwrap().add_channel("speed", "rad/s", &speed).unwrap();
        let path = folder.0.join("log.mf4");
        writer.write_to_file(&path).unwrap();
        let (log, samples, notes) = read(&path, &OpenOptions::default()).unwrap();
        assert!(notes.is_empty(), "{codec:?}: {notes:?}");
        (channel(&log, &samples, "speed"), std::fs::metadata(&path).unwrap().len())
    };
    let (plain, size) = read_with(None);
    assert_eq!(plain.len(), 5000);
    for codec in codecs {
        let (samples, compressed) = read_with(Some(codec));
        assert_eq!(samples, plain, "{codec:?}");
        assert!(compressed < size, "{codec:?}: {compressed} of {size}");
    }
}
