//! A slip of a clutch that holds, which may be a wrong reading.
//!
//! Until it is believed or refuted, at the third reading at the latest ([`super::phases`]), the filter goes on for both cases: in one the clutch holds and
//! no reading of the speeds is taken, in the other it slips since the first reading. So a wrong reading changes nothing, and a slip is not
//! seen late.

use super::phases::PhaseMemory;
use super::{
    Acceleration, ChannelHealth, Channels, ElementState, GearboxFilter, MAX_ELEMENTS, Newest, Running, SPEEDS,
    ShiftInput, ShiftPhase, turbine,
};
use drivetrain::Real;

/// What a step goes on with.
pub(super) struct Moment<'m, T> {
    pub(super) elements: &'m [Option<ElementState<T>>; MAX_ELEMENTS],
    pub(super) newest: &'m [Option<Newest<T>>; SPEEDS],
    pub(super) torque: &'m turbine::Found<T>,
    /// For how long the noise of the torque has been one error, s.
    pub(super) same_s: Option<T>,
    pub(super) input: &'m ShiftInput<T>,
    /// The reading of the acceleration, if it can be taken.
    pub(super) acceleration: Option<Acceleration<T>>,
    pub(super) channels: Channels<ChannelHealth>,
    pub(super) dt_s: T,
}

impl<T: Real> GearboxFilter<'_, T> {
    /// Moves the filter over a step, and the other one for which the clutch that holds has begun to slip. The health of turbine, output and wheel
    /// speed.
    pub(super) fn go_on(
        &self,
        running: &mut Running<T>,
        slipping: &mut Option<Running<T>>,
        at: &Moment<'_, T>,
    ) -> [ChannelHealth; SPEEDS + 1] {
        if slipping.as_ref().is_some_and(|other| (other.shift, other.gear) != (running.shift, running.gear)) {
            *slipping = None;
        }
        let speeds = self.predict_at(running, at);
        if let Some(other) = slipping {
            let speeds = self.predict_at(other, at);
            let health = self.take_speeds(other, at, speeds);
            if running.phase.phase == ShiftPhase::BothSlip {
                *running = *other;
                *slipping = None;
                return health;
            }
        }
        if !running.phase.is_in_doubt() {
            *slipping = None;
        } else if slipping.is_none() {
            *slipping = self.slipping(running, at, speeds);
        }
        self.take_speeds(running, at, speeds)
    }

    /// Predicts over the step, and decides which clutches hold. The speeds by the readings.
    fn predict_at(&self, running: &mut Running<T>, at: &Moment<'_, T>) -> [T; 2] {
        let speeds = self.measured(at.newest, Some(running));
        let read = [at.channels.turbine, at.channels.output].map(|health| health == ChannelHealth::Good);
        self.advance(running, at.elements, (at.torque, at.same_s), (speeds, read), at.dt_s);
        speeds
    }

    /// The filter for which the clutch that holds slips from now on.
    fn slipping(&self, running: &Running<T>, at: &Moment<'_, T>, speeds: [T; 2]) -> Option<Running<T>> {
        let held = running.phase.phase.holding()?.min(1);
        let ratio = running.shift.as_ref()?.clutches[held].ratio;
        let mut other = *running;
        other.phase = PhaseMemory::new(ShiftPhase::BothSlip);
        Self::untie(&mut other, ratio, self.slip(ratio, speeds).value);
        other.torques = Some(self.torques(&other, at.elements, at.torque, speeds));
        self.take_speeds(&mut other, at, speeds);
        Some(other)
    }
}
