//! What is kept from shift to shift.

use super::{ElementState, FRICTION, MAX_ELEMENTS, PRESSURE, PhaseMemory, Running, ShiftPhase, ShiftRow, Slip};
use drivetrain::Real;

impl<T: Real> Running<T> {
    /// Leaves with the elements of the shift what it has shown of them.
    pub(super) fn keep(&self, elements: &mut [Option<ElementState<T>>; MAX_ELEMENTS]) {
        let Some(shift) = &self.shift else { return };
        for (clutch, k) in shift.clutches.iter().zip(FRICTION) {
            let (mean, variance) = (self.x.mean[k], self.x.covariance[k][k]);
            if let Some(Some(memory)) = elements.get_mut(clutch.element)
                && mean.is_finite()
                && variance >= T::zero()
            {
                memory.friction = [mean, variance.min(T::one())];
            }
        }
    }

    /// The gear holds.
    pub(super) fn end_shift(&mut self, gear: usize, elements: &mut [Option<ElementState<T>>; MAX_ELEMENTS]) {
        self.keep(elements);
        for c in 0..2 {
            self.x.renew(FRICTION[c], T::zero(), T::one());
            self.x.renew(PRESSURE[c], T::zero(), T::one());
        }
        (self.gear, self.shift, self.torques) = (gear, None, None);
        self.phase = PhaseMemory::new(ShiftPhase::InGear);
    }

    /// Another shift: an element that takes part in both keeps what is known of it.
    pub(super) fn begin_shift(
        &mut self,
        shift: ShiftRow<T>,
        slips: [Slip<T>; 2],
        elements: &mut [Option<ElementState<T>>; MAX_ELEMENTS],
    ) {
        self.keep(elements);
        let mut before = self.shift.map(|shift| shift.clutches.map(|clutch| clutch.element));
        if let Some([off, on]) = &mut before
            && (*on == shift.clutches[0].element || *off == shift.clutches[1].element)
        {
            self.x.swap(FRICTION[0], FRICTION[1]);
            self.x.swap(PRESSURE[0], PRESSURE[1]);
            core::mem::swap(off, on);
        }
        for (c, clutch) in shift.clutches.iter().enumerate() {
            if before.is_some_and(|before| before[c.min(1)] == clutch.element) {
                continue;
            }
            let [mean, variance] =
                elements.get(clutch.element).copied().flatten().map_or([T::zero(), T::one()], |memory| memory.friction);
            self.x.renew(FRICTION[c.min(1)], mean, variance);
            self.x.renew(PRESSURE[c.min(1)], T::zero(), T::one());
        }
        let phase = match (self.shift.is_none(), slips[0].is_over(), slips[1].is_over()) {
            (true, _, _) | (false, false, _) => ShiftPhase::OffgoingHolds,
            (false, true, false) => ShiftPhase::OncomingHolds,
            (false, true, true) => ShiftPhase::BothSlip,
        };
        (self.shift, self.torques) = (Some(shift), None);
        self.phase = PhaseMemory::new(phase);
    }
}
