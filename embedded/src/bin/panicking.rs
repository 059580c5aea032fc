//! The control: an observer that panics for some input, which must not link.
#![no_std]
#![no_main]

use embedded::observer::{ChannelHealth, Channels, Estimate, Estimator, Health, Input, Phase};

/// Looks up the estimate by an index that the input gives.
pub struct Panicking([f32; 4]);

impl Estimator<f32> for Panicking {
    type State = ();

    fn start(&self) {}

    fn step(&self, (): &mut (), input: &Input<f32>) -> Estimate<f32> {
        let pressure_pa = self.0[input.command.map_or(0, |command| command.value as usize)];
        let (phase, health, channels) = (Phase::BeforeShift, Health::Good, Channels::all(ChannelHealth::Good));
        Estimate { pressure_pa, clutch_torque_n_m: 0.0, shaft_torque_n_m: None, phase, health, channels, bounds: None }
    }
}

embedded::controller!(Panicking);
