//! Blocks of MDF files.

/// Bytes of the head of a block.
pub(crate) const HEAD: usize = 24;

pub(crate) fn number(bytes: &[u8], at: usize) -> usize {
    usize::try_from(u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap())).unwrap()
}

/// A block with these links and what stands behind them.
pub(crate) fn block(id: &[u8; 4], links: &[usize], content: &[u8]) -> Vec<u8> {
    let length = HEAD + 8 * links.len() + content.len();
    let words = [length, links.len()].into_iter().chain(links.iter().copied());
    let words = words.flat_map(|word| (word as u64).to_le_bytes());
    [id.as_slice(), &[0; 4]].concat().into_iter().chain(words).chain(content.iter().copied()).collect()
}

/// The blocks of a file with this id.
pub(crate) fn places(bytes: &[u8], id: &[u8; 8]) -> Vec<usize> {
    (0..bytes.len() - HEAD).filter(|at| bytes[*at..].starts_with(id)).collect()
}

/// Puts a block behind the others; its place.
pub(crate) fn append(bytes: &mut Vec<u8>, block: &[u8]) -> usize {
    bytes.resize(bytes.len().next_multiple_of(8), 0);
    let at = bytes.len();
    bytes.extend_from_slice(block);
    at
}

/// Puts another number in place of the one at `at`.
pub(crate) fn set(bytes: &mut [u8], at: usize, number: usize) {
    bytes[at..at + 8].copy_from_slice(&(number as u64).to_le_bytes());
}
