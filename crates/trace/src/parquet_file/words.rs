//! A column of words, encoded while it grows.
//!
//! In a table of estimates a word is mostly the one of the row before. The column is kept as runs of the same word, which is what
//! Parquet's dictionary encoding makes of it: a page of the words that there are, and a page of runs of their numbers.

use std::collections::HashMap;

use bytes::Bytes;
use parquet::basic::Encoding;
use parquet::column::page::{CompressedPage, Page, PageWriter};
use parquet::column::writer::ColumnCloseResult;
use parquet::errors::{ParquetError, Result};
use parquet::file::metadata::ColumnChunkMetaData;
use parquet::file::writer::{SerializedPageWriter, TrackedWrite};
use parquet::schema::types::ColumnDescPtr;

/// The words of the rows of a group.
#[derive(Default)]
pub(super) struct Words {
    /// The words that there are, each once, and their numbers.
    words: Vec<Box<str>>,
    numbers: HashMap<Box<str>, u32>,
    /// Numbers of words, and in how many rows each stands.
    runs: Vec<(u32, u32)>,
    rows: u32,
    /// The word of the last row of the group before, until this one has a row.
    last: Option<Box<str>>,
}

impl Words {
    /// Takes the word of the next row.
    #[inline]
    pub(super) fn push(&mut self, word: &str) {
        self.rows += 1;
        if let Some((number, rows)) = self.runs.last_mut()
            && *self.words[*number as usize] == *word
        {
            *rows += 1;
            return;
        }
        self.begin_run(word);
    }

    /// Takes the word of the row before once more; false if there is none.
    #[inline]
    pub(super) fn repeat(&mut self) -> bool {
        let Some((_, rows)) = self.runs.last_mut() else { return self.repeat_last() };
        *rows += 1;
        self.rows += 1;
        true
    }

    /// The word of the row before, where that is of the group before.
    fn repeat_last(&mut self) -> bool {
        self.last.take().map(|word| self.push(&word)).is_some()
    }

    fn begin_run(&mut self, word: &str) {
        let number = self.numbers.get(word).copied().unwrap_or_else(|| {
            let number = self.words.len() as u32;
            self.words.push(word.into());
            self.numbers.insert(word.into(), number);
            number
        });
        self.runs.push((number, 1));
    }

    /// The column as it stands in a file, and what is said about it there.
    pub(super) fn encode(&self, column: ColumnDescPtr) -> Result<(Bytes, ColumnCloseResult)> {
        let size = |bytes: usize| i64::try_from(bytes).map_err(|error| ParquetError::General(error.to_string()));
        let count = |words: usize| u32::try_from(words).map_err(|error| ParquetError::General(error.to_string()));
        let mut dictionary = Vec::new();
        for word in &self.words {
            dictionary.extend_from_slice(&count(word.len())?.to_le_bytes());
            dictionary.extend_from_slice(word.as_bytes());
        }
        let mut file = TrackedWrite::new(Vec::new());
        let mut pages = SerializedPageWriter::new(&mut file);
        let mut write = |page: Page| {
            let bytes = page.buffer().len();
            pages.write_page(CompressedPage::new(page, bytes))
        };
        let num_values = count(self.words.len())?;
        let (buf, encoding) = (dictionary.into(), Encoding::PLAIN);
        let dictionary = write(Page::DictionaryPage { buf, num_values, encoding, is_sorted: false })?;
        let numbers = write(Page::DataPage {
            buf: self.numbers_page().into(),
            num_values: self.rows,
            encoding: Encoding::RLE_DICTIONARY,
            def_level_encoding: Encoding::RLE,
            rep_level_encoding: Encoding::RLE,
            statistics: None,
        })?;
        let bytes = file.into_inner()?;
        let metadata = ColumnChunkMetaData::builder(column)
            .set_encodings(vec![Encoding::PLAIN, Encoding::RLE, Encoding::RLE_DICTIONARY])
            .set_total_compressed_size(size(bytes.len())?)
            .set_total_uncompressed_size(size(dictionary.uncompressed_size + numbers.uncompressed_size)?)
            .set_num_values(i64::from(self.rows))
            .set_dictionary_page_offset(Some(0))
            .set_data_page_offset(size(dictionary.compressed_size)?)
            .build()?;
        let close = ColumnCloseResult {
            bytes_written: bytes.len() as u64,
            rows_written: u64::from(self.rows),
            metadata,
            bloom_filter: None,
            column_index: None,
            offset_index: None,
        };
        Ok((bytes.into(), close))
    }

    /// The width of a number in bits, then each run: twice its length in groups of seven bits, and its number in whole bytes.
    fn numbers_page(&self) -> Vec<u8> {
        let bits = usize::BITS - self.words.len().saturating_sub(1).leading_zeros();
        let width = bits.div_ceil(8) as usize;
        let mut page = vec![bits.to_le_bytes()[0]];
        for (number, rows) in &self.runs {
            let mut header = u64::from(*rows) << 1;
            while header >= 0x80 {
                page.push(header.to_le_bytes()[0] | 0x80);
                header >>= 7;
            }
            page.push(header.to_le_bytes()[0]);
            page.extend_from_slice(&number.to_le_bytes()[..width]);
        }
        page
    }

    /// Begins the next group: of the rows so far only the last word stays.
    pub(super) fn begin_anew(&mut self) {
        let last = self.runs.last().map(|(number, _)| self.words.swap_remove(*number as usize));
        *self = Self { last, ..Self::default() };
    }
}
