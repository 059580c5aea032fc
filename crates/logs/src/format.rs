//! Formats of files, by their first bytes.

use crate::readings_table::is_of_readings;

/// Formats of files, as their first bytes tell them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// ASAM MDF 4.
    Mdf,
    /// Parquet.
    Parquet,
    /// Frames of a bus.
    Can(CanKind),
    /// A format that is known and not read: what it is, and what to do.
    NotRead(&'static str),
    /// A table as text with a reading in each row.
    Readings,
    /// Anything else: a table as text.
    Csv,
}

/// The kinds of CAN logs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CanKind {
    /// Text of candump.
    Candump,
    /// Vector's text.
    Asc,
    /// Vector's objects in containers.
    Blf,
    /// PCAN trace.
    Trc,
    /// Table of frames of SavvyCAN.
    Savvy,
    /// Table of frames of python-can.
    PythonCan,
}

/// First bytes of formats that are not read.
const NOT_READ: &[(&[u8], &str)] = &[
    (b"\x1f\x8b", "the file is packed with gzip\nhint: unpack it, for example with `gunzip`"),
    (b"PK\x03\x04", "this is a ZIP archive, or a workbook of a spreadsheet\nhint: unpack it; save a workbook as CSV"),
    (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "this is a workbook of a spreadsheet\nhint: save it as CSV"),
    (b"\x28\xb5\x2f\xfd", "the file is packed with zstd\nhint: unpack it, for example with `unzstd`"),
    (b"\xfd7zXZ\0", "the file is packed with xz\nhint: unpack it, for example with `unxz`"),
    (b"BZh", "the file is packed with bzip2\nhint: unpack it, for example with `bunzip2`"),
    (b"7z\xbc\xaf\x27\x1c", "this is a 7z archive\nhint: unpack it"),
    (b"Rar!\x1a\x07", "this is a RAR archive\nhint: unpack it"),
    (
        b"\x89HDF\r\n\x1a\n",
        "this is HDF5, or a MAT-file of version 7.3\nhint: save its channels as CSV, Parquet or MDF 4, or read the MAT-file by `wetclutch.read` of the Python package",
    ),
    (
        b"MATLAB 7.3 MAT-file",
        "this is a MAT-file of version 7.3\nhint: save its channels as CSV, Parquet or MDF 4, or read it by `wetclutch.read` of the Python package",
    ),
    (
        b"MATLAB 5.0 MAT-file",
        "this is a MAT-file\nhint: save its channels as CSV, Parquet or MDF 4, or read it by `wetclutch.read` of the Python package",
    ),
    (
        b"ARROW1",
        "this is an Arrow or Feather file\nhint: save it as Parquet; with pyarrow: `pq.write_table(feather.read_table(IN), OUT)`",
    ),
    (b"TDSm", "this is a TDMS file\nhint: save its channels as CSV, Parquet or MDF 4"),
    (b"%PDF", "this is a PDF"),
];
const OLD_MDF: &str = "this is MDF of version 2 or 3\nhint: convert it to version 4, for example with asammdf, or read it by `wetclutch.read` of the Python package";
const OTHER_FRAMES: &str = "these are frames of a bus in a form that is not read (a table of frames)\n\
                            hint: convert it, for example with python-can: `python -m can.logconvert IN OUT.log`";
const WITHOUT_STAMPS: &str =
    "these are frames as candump prints them, without time stamps\nhint: log with `candump -L`, or print with `-t a`";

impl Format {
    /// The format of a file that begins with these bytes; a text is UTF-8 without a mark.
    pub fn of(head: &[u8]) -> Self {
        if head.starts_with(b"MDF     ") || head.starts_with(b"UnFinMF ") {
            return if matches!(head.get(8), Some(b'2' | b'3')) { Self::NotRead(OLD_MDF) } else { Self::Mdf };
        }
        if head.starts_with(b"PAR1") {
            return Self::Parquet;
        }
        if head.starts_with(b"LOGG") {
            return Self::Can(CanKind::Blf);
        }
        if let Some((_, why)) = NOT_READ.iter().find(|(first, _)| head.starts_with(first)) {
            return Self::NotRead(why);
        }
        // Long lines are those of tables.
        const FIRST: usize = 64 << 10;
        let text = String::from_utf8_lossy(&head[..head.len().min(FIRST)]);
        let first = text.lines().map(str::trim).find(|line| !line.is_empty() && !line.starts_with("//")).unwrap_or("");
        let words: Vec<&str> = first.split_whitespace().collect();
        let stamped = words.first().is_some_and(|word| word.starts_with('(')) && first.contains(')');
        if stamped && words.len() >= 3 {
            return Self::Can(CanKind::Candump);
        }
        if is_frame(&words) {
            return Self::NotRead(WITHOUT_STAMPS);
        }
        let lower = first.to_lowercase();
        // A trace of version 1.0 does not say its version.
        if lower.starts_with(";$fileversion") || lower.starts_with(';') && text.to_lowercase().contains("pcan") {
            return Self::Can(CanKind::Trc);
        }
        if lower.starts_with("time stamp,id,extended,") {
            return Self::Can(CanKind::Savvy);
        }
        if lower == "timestamp,arbitration_id,extended,remote,error,dlc,data" {
            return Self::Can(CanKind::PythonCan);
        }
        if lower.starts_with("timestamp,arbitration_id,") {
            return Self::NotRead(OTHER_FRAMES);
        }
        if lower.starts_with("date ") && !first.contains([',', ';', '\t'])
            || lower.starts_with("base hex")
            || lower.starts_with("base dec")
        {
            return Self::Can(CanKind::Asc);
        }
        if is_of_readings(first) { Self::Readings } else { Self::Csv }
    }
}

/// Whether words are a frame of candump without its time: `can0 100 [8] 40 0C ...` or `can0 100#400C`.
fn is_frame(words: &[&str]) -> bool {
    let is_hex = |word: &str| !word.is_empty() && word.bytes().all(|byte| byte.is_ascii_hexdigit());
    let is_id = |word: &str| word.len() <= 8 && is_hex(word);
    match words {
        [_, frame] => frame.split_once('#').is_some_and(|(id, data)| {
            let data = data.trim_start_matches('#');
            is_id(id) && (data.is_empty() || data.starts_with('R') || is_hex(data))
        }),
        // Direction and flags (-x) may stand before the identifier.
        [_, .., id, length, byte] | [_, .., id, length, byte, _] if is_length(length) => is_id(id) && is_hex(byte),
        [_, middle @ ..] => middle.windows(2).any(|pair| is_id(pair[0]) && is_length(pair[1])),
        [] => false,
    }
}

/// Whether a word is the length of a frame: `[8]`.
fn is_length(word: &str) -> bool {
    let inner = word.strip_prefix('[').and_then(|rest| rest.strip_suffix(']'));
    inner.is_some_and(|inner| !inner.is_empty() && inner.len() <= 2 && inner.bytes().all(|byte| byte.is_ascii_digit()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_without_its_time_is_no_row_of_names() {
        for frame in [
            "  vcan0  122   [8]  40 1F 80 0C 03 00 00 00",
            "can0 100#400C",
            "can0 00000100##1400C",
            "can0 100#R",
            "can0  RX - -  100   [2]  40 0C",
            "can0  100   [0] ",
            "can0 100 [1] 40",
        ] {
            assert_eq!(Format::of(frame.as_bytes()), Format::NotRead(WITHOUT_STAMPS), "{frame}");
        }
        for row in ["time_s,N [rpm]", "Time [s];N_Eng [rpm]", "a b [1] c,d", "N [8] x", "time value", "n# m#", ""] {
            assert_eq!(Format::of(row.as_bytes()), Format::Csv, "{row}");
        }
    }
}
