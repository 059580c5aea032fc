//! MDF files that end within their data: `falcon_mdf` 0.7 refuses them, and is shown a file that names only what is there.
//!
//! A plain block of data that the end of the file cuts is shown with the length that is left; links to packed blocks and lists that are not
//! whole are shown as zero, and so are links of the head that are not used here. The file itself stays as it is.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::Arc;

use falcon_mdf::io::{ByteSlice, ByteSource, IoBackend};
use falcon_mdf::{Mf4Error, Mf4File, OpenOptions};

/// Bytes of a number, and of the head of a block, with its length and the number of its links.
const WORD: u64 = 8;
const HEAD: u64 = 24;
const LENGTH: u64 = 8;
const LINKS: u64 = 16;
/// The first block of a file; its links to changes, hierarchy, attachments, events and a comment.
const FIRST: u64 = 64;
const NOT_USED: Range<u64> = 1..6;
/// The link of a data group to its data.
const DATA_LINK: u64 = 2;
/// The flag of a list whose blocks have blocks of invalidation bits.
const IS_SPLIT: u64 = 1 << 31;

/// Opens a file of these bytes that is cut within its data; also the first place that is not whole, and what it lacks. None if what describes the data is cut.
pub(super) fn open(file: IoBackend, options: OpenOptions) -> Option<(Mf4File, String, String)> {
    let mut source = Mended { file, numbers: BTreeMap::new() };
    let first = source.mend()?;
    let end = source.file.len();
    let file = Mf4File::from_source_with_options(Arc::new(source), options).ok()?;
    Some((file, format!("block at byte {first}"), format!("it ends beyond the end of the file, byte {end}")))
}

/// A file of which some numbers are shown as others.
struct Mended {
    file: IoBackend,
    /// By their places.
    numbers: BTreeMap<u64, u64>,
}

/// The head of a block.
struct Head {
    id: [u8; 4],
    length: u64,
    links: u64,
}

impl ByteSource for Mended {
    fn len(&self) -> u64 {
        self.file.len()
    }

    fn read_bytes(&self, offset: u64, len: usize) -> Result<ByteSlice<'_>, Mf4Error> {
        let mut bytes = self.file.read_bytes(offset, len)?.into_owned();
        // One that begins before may reach into what was read.
        let places = offset.saturating_sub(WORD - 1)..offset.saturating_add(len as u64);
        for (place, number) in self.numbers.range(places) {
            for (at, shown) in (*place..).zip(number.to_le_bytes()) {
                let at = at.checked_sub(offset).and_then(|at| usize::try_from(at).ok());
                if let Some(byte) = at.and_then(|at| bytes.get_mut(at)) {
                    *byte = shown;
                }
            }
        }
        Ok(ByteSlice::owned(bytes))
    }
}

impl Mended {
    /// Mends what the data groups name; the first block that is not whole.
    fn mend(&mut self) -> Option<u64> {
        NOT_USED.for_each(|link| self.show(link_of(FIRST, link), 0));
        let (mut seen, mut first) = (BTreeSet::new(), None);
        let mut group = self.number(link_of(FIRST, 0))?;
        while group != 0 && seen.insert(group) {
            let cut = self.mend_data(link_of(group, DATA_LINK), &mut seen);
            first = [first, cut].into_iter().flatten().min();
            group = self.number(link_of(group, 0)).unwrap_or(0);
        }
        first
    }

    /// Mends the data to which a link leads: a block, a list of blocks, or what stands before such a list.
    fn mend_data(&mut self, link: u64, seen: &mut BTreeSet<u64>) -> Option<u64> {
        let at = self.number(link)?;
        match self.whole(at).map(|head| head.id).as_ref() {
            Some(b"##HL") => self.mend_lists(link_of(at, 0), seen),
            Some(b"##DL" | b"##LD") => self.mend_lists(link, seen),
            _ => self.mend_block(link),
        }
    }

    /// Mends the blocks of the lists that follow each other. Behind the first that is cut none is shown: its records would not follow those before.
    fn mend_lists(&mut self, mut link: u64, seen: &mut BTreeSet<u64>) -> Option<u64> {
        let mut cut = None;
        while cut.is_none() {
            let list = self.number(link).filter(|list| *list != 0 && seen.insert(*list))?;
            let Some(head) = self.whole(list) else { return self.mend_block(link) };
            // Blocks of invalidation bits are named behind the others, as many as these.
            let flags = self.number(link_of(list, head.links)).unwrap_or(0);
            let is_split = &head.id == b"##LD" && flags & IS_SPLIT != 0;
            let blocks = head.links.saturating_sub(1) / if is_split { 2 } else { 1 };
            for nth in 1..=blocks {
                let own = link_of(list, nth);
                let invalid = if is_split { self.number(link_of(list, nth + blocks)) } else { None };
                let without = invalid.filter(|invalid| *invalid != 0 && self.whole(*invalid).is_none());
                if cut.is_some() || without.is_some() {
                    self.show(own, 0);
                    cut = cut.or(without);
                } else {
                    cut = self.mend_block(own);
                }
            }
            link = link_of(list, 0);
        }
        self.show(link, 0);
        cut
    }

    /// Mends the block to which a link leads; its place, if it is not whole.
    fn mend_block(&mut self, link: u64) -> Option<u64> {
        let at = self.number(link).filter(|at| *at != 0 && self.whole(*at).is_none())?;
        let is_plain = |head: &Head| matches!(&head.id, b"##DT" | b"##DV" | b"##DI" | b"##SD" | b"##RD");
        match self.head(at).filter(|head| is_plain(head) && head.length >= HEAD) {
            Some(_) => self.show(at + LENGTH, self.file.len() - at),
            None => self.show(link, 0),
        }
        Some(at)
    }

    fn show(&mut self, place: u64, number: u64) {
        self.numbers.insert(place, number);
    }

    /// A number of the file itself.
    fn number(&self, place: u64) -> Option<u64> {
        let bytes = self.file.read_bytes(place, WORD as usize).ok()?;
        Some(u64::from_le_bytes(*bytes.first_chunk()?))
    }

    fn head(&self, at: u64) -> Option<Head> {
        let id = *self.file.read_bytes(at, HEAD as usize).ok()?.first_chunk()?;
        Some(Head { id, length: self.number(at + LENGTH)?, links: self.number(at + LINKS)? })
    }

    /// The head of a block that lies in the file whole, with no more links than it has space for.
    fn whole(&self, at: u64) -> Option<Head> {
        let head = self.head(at)?;
        let end = at.checked_add(head.length)?;
        let links = head.links.min(head.length.checked_sub(HEAD)? / WORD);
        (end <= self.file.len()).then_some(Head { links, ..head })
    }
}

/// The place of a link of a block.
fn link_of(block: u64, link: u64) -> u64 {
    block.saturating_add(HEAD + WORD * link)
}
