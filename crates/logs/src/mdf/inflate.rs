//! Deflated blocks are unpacked whole.

/// Why a block cannot be unpacked.
pub(super) enum NotInflated {
    Damaged,
    /// There is more than the room.
    TooLong,
}

/// Unpacks a block to the beginning of the room; its bytes.
#[cfg(not(target_family = "wasm"))]
pub(super) fn inflate(packed: &[u8], room: &mut [u8]) -> Result<usize, NotInflated> {
    libdeflater::Decompressor::new().zlib_decompress(packed, room).map_err(|error| match error {
        libdeflater::DecompressionError::BadData => NotInflated::Damaged,
        libdeflater::DecompressionError::InsufficientSpace => NotInflated::TooLong,
    })
}

/// Unpacks a block to the beginning of the room; its bytes.
#[cfg(target_family = "wasm")]
pub(super) fn inflate(packed: &[u8], room: &mut [u8]) -> Result<usize, NotInflated> {
    let mut inflater = flate2::Decompress::new(true);
    let status = inflater.decompress(packed, room, flate2::FlushDecompress::Finish);
    match status.map_err(|_| NotInflated::Damaged)? {
        flate2::Status::StreamEnd => Ok(inflater.total_out() as usize),
        _ if inflater.total_out() as usize == room.len() => Err(NotInflated::TooLong),
        _ => Err(NotInflated::Damaged),
    }
}
