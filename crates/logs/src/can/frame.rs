//! A frame on a CAN bus.

use crate::LogError;

/// Largest payload, bytes: that of CAN FD.
pub(super) const PAYLOAD: usize = 64;

/// A frame on the bus.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Frame {
    pub(crate) time_s: f64,
    pub(crate) id: u32,
    pub(crate) extended: bool,
    /// The number of its bus, where a log has several.
    pub(crate) bus: u32,
    data: [u8; PAYLOAD],
    length: usize,
}

impl Frame {
    /// A frame of the first bus; of a longer payload the first 64 bytes count.
    pub(crate) fn new(time_s: f64, id: u32, extended: bool, payload: &[u8]) -> Self {
        let mut data = [0; PAYLOAD];
        let length = payload.len().min(PAYLOAD);
        data[..length].copy_from_slice(&payload[..length]);
        Self { time_s, id, extended, bus: 0, data, length }
    }

    /// The same frame on this bus.
    pub(crate) fn on(self, bus: u32) -> Self {
        Self { bus, ..self }
    }

    pub(crate) fn data(&self) -> &[u8] {
        &self.data[..self.length]
    }
}

/// Something that gives frames.
pub(crate) trait Frames: Send {
    /// The next data frame; none at the end.
    fn next_frame(&mut self) -> Result<Option<Frame>, LogError>;

    /// What else is to be said.
    fn notes(&self) -> Vec<String>;
}
