//! Pages whose heads are checked.

use parquet::basic::{Encoding, Type as Physical};
use parquet::column::page::{Page, PageMetadata, PageReader};
use parquet::errors::ParquetError;
use parquet::schema::types::ColumnDescPtr;

/// The pages of a column. What their heads say is checked, because the decoder takes it on trust: that a dictionary stands
/// before the pages that need it and has as many values as it says, and that levels lie within their page.
pub(super) struct CheckedPages {
    pages: Box<dyn PageReader + Send>,
    column: ColumnDescPtr,
    dictionary: bool,
}

impl CheckedPages {
    pub(super) fn new(pages: Box<dyn PageReader + Send>, column: ColumnDescPtr) -> Self {
        Self { pages, column, dictionary: false }
    }

    fn check(&mut self, page: &Page) -> Result<(), &'static str> {
        let length = page.buffer().len();
        if let Page::DictionaryPage { num_values, .. } = page {
            let size = match self.column.physical_type() {
                // A text begins with its length.
                Physical::INT32 | Physical::FLOAT | Physical::BYTE_ARRAY => 4,
                Physical::INT96 => 12,
                Physical::FIXED_LEN_BYTE_ARRAY => usize::try_from(self.column.type_length()).unwrap_or(1).max(1),
                _ => 8,
            };
            self.dictionary = true;
            return if *num_values as usize <= length / size {
                Ok(())
            } else {
                Err("a dictionary is shorter than its stated size")
            };
        }
        if matches!(page.encoding(), Encoding::RLE_DICTIONARY | Encoding::PLAIN_DICTIONARY) && !self.dictionary {
            return Err("a page needs a dictionary, and there is none");
        }
        let levels = match page {
            // Run lengths begin with their size, which the decoder checks; the older form has none. One bit is enough for the
            // levels of a table.
            Page::DataPage { num_values, def_level_encoding, .. }
                if *def_level_encoding != Encoding::RLE && self.column.max_def_level() > 0 =>
            {
                (*num_values as usize).div_ceil(8) * usize::from(self.column.max_def_level().unsigned_abs())
            }
            Page::DataPageV2 { def_levels_byte_len, rep_levels_byte_len, .. } => {
                *def_levels_byte_len as usize + *rep_levels_byte_len as usize
            }
            _ => 0,
        };
        if levels > length { Err("the levels of a page are longer than the page") } else { Ok(()) }
    }
}

impl PageReader for CheckedPages {
    fn get_next_page(&mut self) -> Result<Option<Page>, ParquetError> {
        let page = self.pages.get_next_page()?;
        if let Some(page) = &page {
            self.check(page).map_err(|message| ParquetError::General(message.to_owned()))?;
        }
        Ok(page)
    }

    fn peek_next_page(&mut self) -> Result<Option<PageMetadata>, ParquetError> {
        self.pages.peek_next_page()
    }

    fn skip_next_page(&mut self) -> Result<(), ParquetError> {
        self.pages.skip_next_page()
    }
}

impl Iterator for CheckedPages {
    type Item = Result<Page, ParquetError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.get_next_page().transpose()
    }
}
