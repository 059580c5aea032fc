//! The weights of a fit of shifts: of each channel, and of the driving between them.

use nalgebra::DVector;

use crate::driving::DrivingWeights;
use crate::shift_model::{Block, Channel, ShiftModel};
use crate::weights::ChannelWeights;

const CHANNELS: usize = Channel::ALL.len();

/// Weights of the channels and of driving.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ShiftWeights {
    channels: [ChannelWeights; CHANNELS],
    /// Of the driving of each log; where there is none, those of a start.
    pub(crate) drives: Vec<DrivingWeights>,
}

impl ShiftWeights {
    /// Where a fit starts: what is usual for each channel.
    pub(crate) const START: Self = Self {
        channels: [
            ChannelWeights::usual(0.3, 0.5),
            ChannelWeights::usual(0.03, 0.3),
            ChannelWeights::usual(0.03, 0.1),
            ChannelWeights::usual(0.3, 1.0),
            ChannelWeights::usual(0.3, 3e3),
        ],
        drives: Vec::new(),
    };

    /// Those of a channel.
    pub(crate) fn of(&self, channel: Channel) -> &ChannelWeights {
        &self.channels[channel as usize]
    }

    /// One-step errors of the residuals, or of a column of their derivatives, in scales.
    pub(crate) fn errors(&self, blocks: &[Block], column: &mut [f64]) {
        for block in blocks {
            self.of(block.channel).in_scales(&mut column[block.rows.clone()]);
        }
    }

    /// Gains and scales that the residuals of all shifts ask for; where a channel has none they stay.
    pub(crate) fn following(mut self, shifts: &[ShiftModel], residuals: &[DVector<f64>]) -> Self {
        for channel in Channel::ALL {
            let blocks: Vec<&[f64]> = (shifts.iter().zip(residuals))
                .flat_map(|(shift, rows)| {
                    let of_channel = shift.blocks.iter().filter(|block| block.channel == channel);
                    of_channel.map(|block| &rows.as_slice()[block.rows.clone()])
                })
                .collect();
            self.channels[channel as usize] = self.of(channel).following(&blocks);
        }
        self
    }
}
