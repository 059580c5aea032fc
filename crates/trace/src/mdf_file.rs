//! Tables as ASAM MDF 4.10 files.
//!
//! One channel group: the time as its master channel, numbers as 64-bit floats (NaN is no value), words as bytes with a table of
//! texts. The records are one data block that grows to the end of the file; the counts, and the tables of words, which are known
//! only then, are set at the end.

use std::io::{self, Seek, SeekFrom, Write};

use crate::{Cell, ColumnKind, Unit, signal};

/// Different words that a column can have: a byte tells them apart.
const MAX_WORDS: usize = 255;

/// Places of links and counts that are set at the end, counted in the file's bytes.
struct Places {
    cycle_count: u64,
    data_length: u64,
    /// Of each channel after the time, its link to a conversion.
    conversions: Vec<u64>,
}

/// Writes an MDF file row by row.
pub struct MdfWriter<W: Write + Seek> {
    writer: W,
    places: Places,
    columns: Vec<Column>,
    /// The newest record.
    record: Vec<u8>,
    rows: u64,
}

enum Column {
    Number,
    /// The words so far, in the order of their numbers.
    Words(Vec<String>),
}

/// Bytes of a block with their links, before they have a place in the file.
fn block(id: &[u8; 4], links: &[u64], data: &[u8]) -> Vec<u8> {
    let length = 24 + 8 * links.len() + data.len();
    let mut bytes = Vec::with_capacity(length.next_multiple_of(8));
    bytes.extend_from_slice(b"##");
    bytes.extend_from_slice(&id[2..]);
    bytes.extend_from_slice(&[0; 4]);
    bytes.extend_from_slice(&(length as u64).to_le_bytes());
    bytes.extend_from_slice(&(links.len() as u64).to_le_bytes());
    links.iter().for_each(|link| bytes.extend_from_slice(&link.to_le_bytes()));
    bytes.extend_from_slice(data);
    bytes.resize(length.next_multiple_of(8), 0);
    bytes
}

/// A text block.
fn text(id: &[u8; 4], text: &str) -> Vec<u8> {
    let mut data = text.as_bytes().to_vec();
    data.push(0);
    data.resize(data.len().next_multiple_of(8), 0);
    block(id, &[], &data)
}

/// Name and unit of a column: `N_Eng [rpm]`, or by the end of its name.
fn name_and_unit(title: &str) -> (&str, Option<&str>) {
    match title.strip_suffix(']').and_then(|title| title.rsplit_once(" [")) {
        Some((name, unit)) => (name, Some(unit)),
        None => (title, Unit::of_name(title).map(|unit| unit.name)),
    }
}

/// Blocks one after the other, from the beginning of the file on.
struct Blocks {
    bytes: Vec<u8>,
    from: u64,
}

impl Blocks {
    /// Adds a block; its place in the file.
    fn add(&mut self, block: &[u8]) -> u64 {
        let at = self.from + self.bytes.len() as u64;
        self.bytes.extend_from_slice(block);
        at
    }
}

impl<W: Write + Seek> MdfWriter<W> {
    /// Begins a file with these columns beside the time. A column of whole numbers is written as numbers.
    ///
    /// # Errors
    /// What the writer meets.
    pub fn new<'a>(mut writer: W, columns: impl IntoIterator<Item = (&'a str, ColumnKind)>) -> io::Result<Self> {
        let columns: Vec<(&str, ColumnKind)> = columns.into_iter().collect();
        let mut blocks = Blocks { bytes: identification(), from: 0 };
        // The header stands right behind the identification, and points to blocks that come later: it is set at the end.
        let header_at = blocks.add(&header(0, 0));
        let comment = format!(
            "<FHcomment><TX>written</TX><tool_id>wetclutch</tool_id><tool_vendor>wetclutch</tool_vendor>\
             <tool_version>{}</tool_version></FHcomment>",
            env!("CARGO_PKG_VERSION")
        );
        let comment = blocks.add(&text(b"##MD", &comment));
        let history = blocks.add(&block(b"##FH", &[0, comment], &[0; 16]));
        let mut channels = Vec::new();
        let mut byte_offset = 0;
        let time = std::iter::once((signal::TIME, ColumnKind::Number));
        for (i, (name, kind)) in time.chain(columns.iter().copied()).enumerate() {
            let (name, unit) = name_and_unit(name);
            let name_at = blocks.add(&text(b"##TX", name));
            let unit = unit.filter(|unit| kind == ColumnKind::Number && !unit.is_empty());
            let unit_at = unit.map_or(0, |unit| blocks.add(&text(b"##TX", unit)));
            let bits: u32 = if kind == ColumnKind::Word { 8 } else { 64 };
            channels.push(channel(i == 0, name_at, unit_at, byte_offset, bits));
            byte_offset += bits / 8;
        }
        // Each channel points to the one after it.
        let first = blocks.from + blocks.bytes.len() as u64;
        let mut places = Places { cycle_count: 0, data_length: 0, conversions: Vec::new() };
        let count = channels.len();
        for (i, mut channel) in channels.into_iter().enumerate() {
            let at = first + (i * channel.len()) as u64;
            let next = if i + 1 == count { 0 } else { at + channel.len() as u64 };
            channel[24..32].copy_from_slice(&next.to_le_bytes());
            blocks.add(&channel);
            if i > 0 {
                // The fifth link.
                places.conversions.push(at + 24 + 4 * 8);
            }
        }
        let mut data = vec![0; 32];
        data[24..28].copy_from_slice(&byte_offset.to_le_bytes());
        let group = blocks.add(&block(b"##CG", &[0, first, 0, 0, 0, 0], &data));
        places.cycle_count = group + 24 + 6 * 8 + 8;
        let data_group_length = 24 + 4 * 8 + 8;
        let records = blocks.from + blocks.bytes.len() as u64 + data_group_length;
        let data_group = blocks.add(&block(b"##DG", &[0, group, records, 0], &[0; 8]));
        blocks.add(&block(b"##DT", &[], &[]));
        places.data_length = records + 8;
        let header = header(data_group, history);
        let at = usize::try_from(header_at).map_err(io::Error::other)?;
        blocks.bytes[at..at + header.len()].copy_from_slice(&header);
        writer.write_all(&blocks.bytes)?;
        let columns = columns.into_iter().map(|(_, kind)| match kind {
            ColumnKind::Word => Column::Words(Vec::new()),
            ColumnKind::Whole | ColumnKind::Number => Column::Number,
        });
        let record = vec![0; usize::try_from(byte_offset).map_err(io::Error::other)?];
        Ok(Self { writer, places, columns: columns.collect(), record, rows: 0 })
    }

    /// Writes a row.
    ///
    /// # Errors
    /// What the writer meets, a cell that is not of the kind of its column, or too many words.
    pub fn row<'a>(&mut self, time_s: f64, cells: impl IntoIterator<Item = Cell<'a>>) -> io::Result<()> {
        let (mut cells, mut record, mut words_are_same) = (cells.into_iter(), self.record.as_mut_slice(), false);
        set(&mut record, &time_s.to_le_bytes());
        for column in &mut self.columns {
            let cell = if words_are_same { Some(Cell::SameWord) } else { cells.next() };
            words_are_same |= cell == Some(Cell::SameWords);
            match (column, cell) {
                (Column::Number, Some(Cell::Number(number))) => set(&mut record, &number.to_le_bytes()),
                (Column::Number, Some(Cell::Whole(number))) => {
                    set(&mut record, &(number as f64).to_le_bytes());
                }
                (Column::Words(words), Some(Cell::SameWord | Cell::SameWords)) if !words.is_empty() => {
                    record.split_off_first_mut();
                }
                (Column::Words(words), Some(Cell::Word(word))) => {
                    let at = words.iter().position(|known| known == word).unwrap_or_else(|| {
                        words.push(word.to_owned());
                        words.len() - 1
                    });
                    let number = u8::try_from(at).ok().filter(|_| words.len() <= MAX_WORDS);
                    set(&mut record, &[number.ok_or_else(|| io::Error::other("a column has more than 255 words"))?]);
                }
                _ => return Err(io::Error::other("a cell is not of the kind of its column")),
            }
        }
        self.rows += 1;
        self.writer.write_all(&self.record)
    }

    /// Sets the counts and the tables of words, and hands back the writer.
    ///
    /// # Errors
    /// What the writer meets.
    pub fn finish(mut self) -> io::Result<W> {
        let end = self.writer.stream_position()?;
        let length = end - (self.places.data_length - 8);
        let padded = end.next_multiple_of(8);
        self.writer.write_all(&[0; 8][..(padded - end) as usize])?;
        let mut blocks = Blocks { bytes: Vec::new(), from: padded };
        let mut links = Vec::new();
        for (column, place) in self.columns.iter().zip(&self.places.conversions) {
            if let Column::Words(words) = column {
                let texts: Vec<u64> = words.iter().map(|word| blocks.add(&text(b"##TX", word))).collect();
                links.push((*place, blocks.add(&words_table(&texts))));
            }
        }
        self.writer.write_all(&blocks.bytes)?;
        links.extend([(self.places.cycle_count, self.rows), (self.places.data_length, length)]);
        for (place, value) in links {
            self.writer.seek(SeekFrom::Start(place))?;
            self.writer.write_all(&value.to_le_bytes())?;
        }
        self.writer.seek(SeekFrom::End(0))?;
        Ok(self.writer)
    }
}

/// Sets the next bytes of a record.
fn set(record: &mut &mut [u8], bytes: &[u8]) {
    if let Some(next) = record.split_off_mut(..bytes.len()) {
        next.copy_from_slice(bytes);
    }
}

fn identification() -> Vec<u8> {
    let mut bytes = b"MDF     4.10    wetclutc".to_vec();
    bytes.resize(64, 0);
    bytes[28..30].copy_from_slice(&410_u16.to_le_bytes());
    bytes
}

/// The header; its start of time is the beginning of 1970, because a table says no other.
fn header(data_group: u64, history: u64) -> Vec<u8> {
    block(b"##HD", &[data_group, history, 0, 0, 0, 0], &[0; 32])
}

fn channel(is_time: bool, name: u64, unit: u64, byte_offset: u32, bits: u32) -> Vec<u8> {
    const UNSIGNED: u8 = 0;
    const FLOAT: u8 = 4;
    let mut data = vec![0; 72];
    // Master channel of type time.
    (data[0], data[1]) = if is_time { (2, 1) } else { (0, 0) };
    data[2] = if bits == 64 { FLOAT } else { UNSIGNED };
    data[4..8].copy_from_slice(&byte_offset.to_le_bytes());
    data[8..12].copy_from_slice(&bits.to_le_bytes());
    block(b"##CN", &[0, 0, name, 0, 0, 0, unit, 0], &data)
}

/// A conversion of numbers from 0 on to texts.
fn words_table(texts: &[u64]) -> Vec<u8> {
    const VALUE_TO_TEXT: u8 = 7;
    let mut links = vec![0; 4];
    links.extend_from_slice(texts);
    // No text for any other number.
    links.push(0);
    let mut data = vec![0; 24];
    data[0] = VALUE_TO_TEXT;
    // At most 255.
    let count = u16::try_from(texts.len()).unwrap_or(u16::MAX);
    data[4..6].copy_from_slice(&(count + 1).to_le_bytes());
    data[6..8].copy_from_slice(&count.to_le_bytes());
    (0..count).for_each(|number| data.extend_from_slice(&f64::from(number).to_le_bytes()));
    block(b"##CC", &links, &data)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    #[test]
    fn counts_and_lengths_are_set_at_the_end_and_blocks_follow_each_other() {
        let columns = [("pressure_pa", ColumnKind::Number), ("health", ColumnKind::Word)];
        let mut writer = MdfWriter::new(Cursor::new(Vec::new()), columns).unwrap();
        for (i, word) in (0..).map(f64::from).zip(["good", "bad", "good"]) {
            writer.row(i, [Cell::Number(1e5 * i), Cell::Word(word)]).unwrap();
        }
        let bytes = writer.finish().unwrap().into_inner();
        // From the header on, each block begins where the one before it ends.
        let mut at = 64;
        let mut seen = Vec::new();
        let number = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
        while at < bytes.len() {
            seen.push(String::from_utf8(bytes[at..at + 4].to_vec()).unwrap());
            if seen.last().unwrap() == "##DT" {
                assert_eq!(number(at + 8), 24 + 3 * 17);
            }
            if seen.last().unwrap() == "##CG" {
                assert_eq!(number(at + 24 + 48 + 8), 3);
            }
            at += usize::try_from(number(at + 8).next_multiple_of(8)).unwrap();
        }
        assert_eq!(at, bytes.len());
        let of = |id: &str| seen.iter().filter(|seen| *seen == id).count();
        assert_eq!((of("##HD"), of("##CN"), of("##CC"), of("##DT")), (1, 3, 1, 1));
        let mut writer = MdfWriter::new(Cursor::new(Vec::new()), columns).unwrap();
        assert!(writer.row(0.0, [Cell::Word("x"), Cell::Word("x")]).is_err());
    }

    #[test]
    fn a_word_that_repeats_that_of_the_row_before_is_the_same_in_the_file() {
        let columns = [("health", ColumnKind::Word), ("pressure_pa", ColumnKind::Number)];
        let written = |cells: [Cell<'_>; 4]| {
            let mut writer = MdfWriter::new(Cursor::new(Vec::new()), columns).unwrap();
            for (time_s, cell) in (0..).map(f64::from).zip(cells) {
                writer.row(time_s, [cell, Cell::Number(time_s)])?;
            }
            writer.finish().map(Cursor::into_inner)
        };
        let [good, bad] = ["good", "bad"].map(Cell::Word);
        assert_eq!(written([good, bad, Cell::SameWord, good]).unwrap(), written([good, bad, bad, good]).unwrap());
        assert!(written([Cell::SameWord, bad, bad, good]).is_err());
        // Behind the word is a number.
        assert!(written([good, bad, Cell::SameWords, good]).is_err());
    }

    #[test]
    fn words_up_to_the_end_of_a_row_that_repeat_those_before_are_the_same_in_the_file() {
        let columns = [("x", ColumnKind::Number), ("health", ColumnKind::Word), ("phase", ColumnKind::Word)];
        let (x, [good, fill]) = (Cell::Number(0.5), ["good", "fill"].map(Cell::Word));
        let written = |rows: [&[Cell<'_>]; 2]| {
            let mut writer = MdfWriter::new(Cursor::new(Vec::new()), columns).unwrap();
            rows.into_iter().try_for_each(|row| writer.row(0.0, row.iter().copied()))?;
            writer.finish().map(Cursor::into_inner)
        };
        let (row, repeated) = ([x, good, fill], [x, Cell::SameWords]);
        assert_eq!(written([&row, &repeated]).unwrap(), written([&row, &row]).unwrap());
        assert!(written([&repeated, &row]).is_err());
    }
}
