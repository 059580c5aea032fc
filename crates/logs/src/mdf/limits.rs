//! How much is read at once, and how a group is found.

/// Records that are given at once: their columns stay in the second cache.
pub(super) const BATCH: usize = 8192;
/// Largest block of data that is unpacked, bytes. Writers use up to 4 MiB.
pub(super) const LARGEST_BLOCK: u64 = 256 << 20;
/// Memory that is taken on the word of the file, bytes.
pub(super) const ON_TRUST: usize = 16 << 20;

/// Data group and channel group.
pub(super) type GroupAt = (usize, usize);
