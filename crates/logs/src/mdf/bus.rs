//! The frames of a bus that an MDF file holds.

use falcon_mdf::CanFrames;

use super::limits::BATCH;
use crate::LogError;
use crate::can::{Decoder, Frame};
use crate::columns::{Batch, Stream};

/// The frames of a bus that an MDF file holds.
pub(super) struct Bus<'a> {
    frames: CanFrames,
    /// The size of the unit of its times, s.
    unit_s: f64,
    at: usize,
    decoder: Decoder<'a>,
    /// Channels before those of the database.
    own: usize,
}

impl<'a> Bus<'a> {
    pub(super) fn new(frames: CanFrames, unit_s: f64, decoder: Decoder<'a>, own: usize) -> Self {
        Self { frames, unit_s, at: 0, decoder, own }
    }
}

impl Stream for Bus<'_> {
    fn next_batch(&mut self, batch: &mut Batch) -> Result<bool, LogError> {
        let batch = &mut batch.samples;
        let end = (self.at + BATCH).min(self.frames.len());
        if self.at == end {
            return Ok(false);
        }
        let before = batch.len();
        for i in self.at..end {
            let Some(frame) = self.frames.get(i).filter(|frame| frame.timestamp.is_finite()) else { continue };
            let extended = frame.extended.unwrap_or(frame.id > 0x7ff);
            let own = Frame::new(frame.timestamp * self.unit_s, frame.id, extended, frame.data);
            self.decoder.decode(&own.on(u32::from(frame.bus_channel)), batch);
        }
        self.at = end;
        for sample in &mut batch[before..] {
            sample.channel += self.own;
        }
        Ok(true)
    }

    fn notes(&self) -> Vec<String> {
        self.decoder.notes()
    }
}
