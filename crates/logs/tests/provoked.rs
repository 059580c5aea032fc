//! Errors of logs and channel maps that no other test provokes: each with its cause, and what is said.

use std::sync::Arc;

use crate::common::{Folder, data, read, with_dbc};
use parquet::data_type::{DoubleType, FixedLenByteArrayType};
use parquet::file::writer::SerializedFileWriter;

use logs::{ChannelMap, Log, OpenOptions, Readings};

/// What is said of a log: the error, or the notes.
fn said(folder: &Folder, name: &str, content: impl AsRef<[u8]>) -> String {
    match read(&folder.write(name, content), &with_dbc()) {
        Err(error) => error.to_string(),
        Ok((_, _, notes)) => notes.join("\n"),
    }
}

/// The bytes of a file with others in one place.
fn with(bytes: &[u8], at: usize, new: &[u8]) -> Vec<u8> {
    [&bytes[..at], new, &bytes[at + new.len()..]].concat()
}

/// The place of the first block of an MDF file with this name.
fn block(bytes: &[u8], name: &[u8]) -> usize {
    bytes.windows(name.len()).position(|window| window == name).unwrap()
}

fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap())
}

#[test]
fn damaged_blf_files() {
    let folder = Folder::new("blf");
    let whole = std::fs::read(data("bus.blf")).unwrap();
    // The head has 144 bytes; then comes a container: its head, the method of packing, the unpacked size, the packed objects.
    let (container, method, size, packed) = (144, 160, 168, 176);
    let object = [b"LOBJ\x10\0\x01\0\x64\0\0\0\x01\0\0\0".as_slice(), &[0; 40]].concat();
    let length = u32::try_from(32 + object.len()).unwrap().to_le_bytes();
    let half = [&with(&with(&whole[..packed], container + 8, &length), method, &[0, 0]), object.as_slice()].concat();
    for (bytes, words) in [
        (with(&whole, 4, &[0; 4]), "the head of the file is cut or has a wrong length"),
        (whole[..container].to_vec(), "there are no data frames"),
        (with(&whole, container, b"XXXX"), "there is no object where one should begin"),
        (with(&whole, container + 8, &[0; 4]), "an object has a stated size of 0 bytes, and 16 of them as its head"),
        (whole[..whole.len() / 2].to_vec(), "the object is cut: "),
        (with(&whole, size, &[0xff; 3]), "a container unpacks to "),
        (with(&whole, method, &[1, 0]), "a container is packed by method 1, known are 0 and 2 (deflate)"),
        (with(&whole, method, &[0, 0]), "there is no object where one should begin, in the container that ends here"),
        (half, "the last object is cut"),
    ] {
        let text = said(&folder, "bus.blf", bytes);
        assert!(text.contains(words), "{words}: {text}");
    }
}

#[test]
fn damaged_mdf_files() {
    let folder = Folder::new("mdf");
    // Behind the head of a packed block: kinds, the sizes of its content and of what is packed.
    let deflate = std::fs::read(data("deflate.mf4")).unwrap();
    let [size, packed] = [32, 40].map(|at| block(&deflate, b"##DZ") + at);
    let sized = |by: i64| with(&deflate, size, &u64_at(&deflate, size).wrapping_add_signed(by).to_le_bytes());
    for (bytes, words) in [
        (sized(8), "it unpacks to "),
        (sized(-8), "it unpacks to more than its stated size, "),
        (with(&deflate, packed, &u64::MAX.to_le_bytes()), "it ends beyond the end of the file, byte "),
    ] {
        let found = read(&folder.write("log.mf4", bytes), &OpenOptions::default());
        let text = found.map_or_else(|error| error.to_string(), |(_, _, notes)| notes.join("\n"));
        assert!(text.contains(words), "{words}: {text}");
    }
}

#[test]
fn logs_without_what_is_needed() {
    let folder = Folder::new("without");
    let asc = "date Wed Sep 30 15:06:13.191 2017\nbase hex  timestamps absolute\n";
    assert!(said(&folder, "bus.asc", asc).contains("there are no data frames"));
    let dbc = "VERSION \"\"\n\nBU_: A\n\nBO_ 256 X: 8 A\n SG_ S : 0|16@1+ (1,0) [0|0] \"rpm\" A\n SG_ T : 16|16@1+ (1,0) [0|0] \"rpm\" A\n\nSIG_VALTYPE_ 256 S : 1;\n";
    let options = OpenOptions { dbc: Some(folder.write("bus.dbc", dbc)), ..OpenOptions::default() };
    let candump = "(0.0) can0 100#0102030405060708\n(0.1) can0 100#0102030405060708\n";
    let found = read(&folder.write("bus.log", candump), &options);
    let text = found.map_or_else(|error| error.to_string(), |(_, _, notes)| notes.join("\n"));
    assert!(text.contains("signal `S` of message `X` is a float of 16 bits, expected 32 or 64"), "{text}");
    // A time of five bytes.
    let schema = "message m { required fixed_len_byte_array(5) time_s; required double a; }";
    let schema = Arc::new(parquet::schema::parser::parse_message_type(schema).unwrap());
    let path = folder.0.join("log.parquet");
    let file = std::fs::File::create(&path).unwrap();
    let mut writer = SerializedFileWriter::new(file, schema, Arc::default()).unwrap();
    let mut group = writer.next_row_group().unwrap();
    let mut times = group.next_column().unwrap().unwrap();
    let five = |byte: u8| vec![byte; 5].into();
    times.typed::<FixedLenByteArrayType>().write_batch(&[five(0), five(1)], None, None).unwrap();
    times.close().unwrap();
    let mut values = group.next_column().unwrap().unwrap();
    values.typed::<DoubleType>().write_batch(&[1.0, 2.0], None, None).unwrap();
    values.close().unwrap();
    group.close().unwrap();
    writer.close().unwrap();
    let text = read(&path, &OpenOptions::default()).map(|_| ()).unwrap_err().to_string();
    assert!(text.contains("the time `time_s` holds ") && text.contains("\nhint: write it as a number"), "{text}");
    let text = said(&folder, "kg.csv", "time [kg],a\n0,1\n1,2\n");
    assert!(text.contains("the time `time` has the unit `kg`\nhint: it can be s, ms"), "{text}");
}

#[test]
fn a_log_is_read_once() {
    let folder = Folder::new("once");
    let car_scanner = "\"SECONDS\";\"PID\";\"VALUE\";\"UNITS\";\n\"0.0\";\"Speed\";\"1\";\"km/h\";\n\"0.1\";\"Speed\";\"2\";\"km/h\";\n";
    for path in [data("bus.log"), folder.write("log.csv", "time_s,a\n0,1\n1,2\n"), folder.write("app.csv", car_scanner)]
    {
        let mut log = Log::open(&path, &with_dbc()).unwrap();
        log.samples(&[0]).unwrap().for_each(drop);
        let error = log.samples(&[0]).map(|_| ()).unwrap_err().to_string();
        assert!(error.ends_with("the log was read already"), "{error}");
    }
}

#[test]
fn channel_maps() {
    let folder = Folder::new("maps");
    let channel = "[channel.engine_speed]\nname = \"N\"\n";
    for (text, words) in [
        (format!("{channel}valid_range = [3, 1]\n"), "is [3, 1], expected a smaller value first"),
        (
            "[gearbox]\nratios = [3, 1]\nwheel_radius_m = 0.001\n".to_owned(),
            "`gearbox.wheel_radius_m` is 0.001, expected 0.01 to 1000",
        ),
        ("[gearbox]\nratios = [300, 1]\n".to_owned(), "a ratio is 300, expected 0.1 to 30"),
    ] {
        let error = ChannelMap::read(&folder.write("map.toml", text)).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
    let map = "[channel.output_speed]\nnames = [\"left\", \"right\"]\ncombine = \"mean\"\n";
    let map = ChannelMap::read(&folder.write("map.toml", map)).unwrap();
    let log = folder.write("log.csv", "time_s,left [rpm],right [rad/s]\n0,1,2\n1,2,3\n");
    let mut log = Log::open(&log, &OpenOptions::default()).unwrap();
    let error = Readings::new(&mut log, &map).map(|_| ()).unwrap_err().to_string();
    assert!(
        error.starts_with(
            "the channels of output_speed have the units rpm and rad/s\nhint: set one in `channel.output_speed.unit`"
        ),
        "{error}"
    );
}
