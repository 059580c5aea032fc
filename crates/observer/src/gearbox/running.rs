//! Begin and end of a shift, and what is kept from shift to shift.

use super::beyond_bounds::Evidence;
use super::learnt::Shown;
use super::timing::ByTiming;
use super::{
    ACTING, Acting, Compared, Correlations, ElementState, ElementUncertainty, FRICTION, GearboxFilter, IN_GEAR,
    INERTIA, KISS, Known, LASTING, Learnt, LearntElement, MAX_ELEMENTS, MISFIT, N, PRESSURE, PhaseMemory, Running,
    SCALE, SLOW_FRACTION, STATES_ACTING, ShiftElement, ShiftPhase, ShiftRow, Slip,
};
use car::Gear;
use drivetrain::Real;

/// Place of the torque at the gearbox input among the lasting states.
pub(super) const TURBINE_ACTS: usize = STATES_ACTING - 1;
/// That of the inertia.
const INERTIA_ACTS: usize = 4;

impl<T: Real> Running<T> {
    /// The states of a shift, as they are where there is none.
    #[inline(never)]
    pub(super) fn renew_shift(&mut self) {
        for state in IN_GEAR..N {
            self.x.renew(state, T::zero(), T::one());
        }
        self.x.active = IN_GEAR;
    }

    /// The lasting states now, with the timing as the valve models have it.
    fn lasting(&self) -> Known<T> {
        let mut lasting = Known { mean: [T::zero(); ACTING], covariance: [[T::zero(); ACTING]; ACTING] };
        for ((mean, row), a) in lasting.mean.iter_mut().zip(&mut lasting.covariance).zip(LASTING) {
            *mean = self.x.mean[a];
            for (covariance, b) in row.iter_mut().zip(LASTING) {
                *covariance = self.x.covariance[a][b];
            }
        }
        lasting
    }
}

impl<T: Real> GearboxFilter<'_, T> {
    /// Correlation of torque factor and kiss point of each element unlearnt.
    pub(super) fn correlations(&self) -> Correlations<T> {
        let mut correlations = [T::zero(); MAX_ELEMENTS];
        for (correlation, element) in correlations.iter_mut().zip(self.tables.elements) {
            *correlation = element.correlation();
        }
        correlations
    }

    /// What is learnt of an element, by its place in [`super::GearboxTables::elements`]; `None` if there is no such element.
    pub fn learnt_element(&self, learnt: &Learnt<T>, at: usize) -> Option<LearntElement<T>> {
        let element = self.tables.elements.get(at).filter(|_| at < MAX_ELEMENTS)?;
        let u = &element.uncertainty;
        let ([s, k], [[s_s, s_k], [_, k_k]]) = learnt.of_element(at)?;
        let torque = u.torque_fraction * u.slow_part.sqrt();
        let kiss_pa = element.kiss_std_dev_pa() * u.slow_part.sqrt();
        let [by_s, by_k] = element.gain_by(T::one());
        // Unlearnt both vary by one, with their correlation.
        let both = element.correlation();
        let seen = by_s * by_s * (T::one() - s_s)
            + (by_s * by_k + by_s * by_k) * (both - s_k)
            + by_k * by_k * (T::one() - k_k);
        let gain = (u.valve_gain * u.valve_gain - seen).max(T::zero()).sqrt();
        Some(LearntElement {
            torque_fraction: [torque * s, torque * s_s.sqrt()],
            kiss_pa: [kiss_pa * k, kiss_pa * k_k.sqrt()],
            valve_gain: [by_s * s + by_k * k, gain],
        })
    }

    /// What is learnt of the turbine-side inertia between two gears: its error as a fraction, and the standard deviation; `None` if it is
    /// not learnt.
    pub fn learnt_inertia(&self, learnt: &Learnt<T>, from: usize, to: usize) -> Option<[T; 2]> {
        let of = learnt.of_pair(self.tables.pair(from, to)?)?;
        Some(of.map(|value| self.uncertainty.inertia_share * value))
    }

    /// What is learnt of the torque at the gearbox input, as a fraction of that by the converter's maps (without a converter, of the reported one);
    /// and of the reported engine torque beside a converter, as a fraction of the true one: error and standard deviation.
    pub fn learnt_sources(&self, learnt: &Learnt<T>) -> [[T; 2]; 2] {
        let (of, shares) = (learnt.of_sources(), [self.input_share(), self.turbine.engine_share]);
        [of[0].map(|x| shares[0] * x), of[1].map(|x| shares[1] * x)]
    }

    /// What is learnt of the valve of an element: error of its lag as a fraction, and of its delay beside that of the tables, s, each with its
    /// standard deviation; `None` if there is no such element.
    pub fn learnt_timing(&self, learnt: &Learnt<T>, at: usize) -> Option<[[T; 2]; 2]> {
        let ([lag, delay], [lag_variance, delay_variance]) = learnt.of_timing(at)?;
        let u = &self.tables.elements.get(at)?.uncertainty;
        let [per_lag, per_delay] = [u.valve_lag_fraction, u.valve_delay_s].map(|std_dev| u.slow_part.sqrt() * std_dev);
        let of = |per: T, mean: T, variance: T| [per * mean, per * variance.sqrt()];
        Some([of(per_lag, lag, lag_variance), of(per_delay, delay, delay_variance)])
    }

    /// What is learnt of the scale of the wheel speed: its error as a fraction, and the standard deviation.
    pub fn learnt_wheel_scale(&self, learnt: &Learnt<T>) -> [T; 2] {
        let [mean, variance] = learnt.of_wheel();
        [mean, variance.sqrt()].map(|value| self.uncertainty.wheel_scale * value)
    }

    /// Keeps what the readings have shown of the scale of the wheel speed.
    pub(super) fn keep_wheel_scale(&self, running: &Running<T>, learnt: &mut Learnt<T>) {
        let per = self.uncertainty.wheel_scale.recip();
        if per.is_finite() {
            learnt.keep_wheel(per * running.x.mean[SCALE], per * per * running.x.covariance[SCALE][SCALE]);
        }
    }

    /// What is learnt and acts in a shift.
    pub(super) fn acting(&self, shift: &ShiftRow<T>) -> Acting<T> {
        let elements = shift.clutches.map(|clutch| clutch.element);
        let pair = self.tables.pair(shift.from, shift.to);
        let slow_parts = self.of_elements(elements, |u| u.slow_part);
        Acting::new(elements, pair, slow_parts, self.by_stiffness(elements))
    }

    /// The same in a gear.
    pub(super) fn acting_in_gear(&self) -> Acting<T> {
        Acting::turbine(self.by_stiffness([ShiftElement::Unknown; 2]))
    }

    /// A value of what is not known of two elements; infinite for one that is not in the tables, as a one-way clutch.
    fn of_elements(&self, elements: [ShiftElement; 2], of: impl Fn(&ElementUncertainty<T>) -> T) -> [T; 2] {
        elements.map(|element| self.tables.element(element).map_or(T::infinity(), |element| of(&element.uncertainty)))
    }

    /// Standard deviation of the torque at the gearbox input unlearnt, as a fraction.
    pub(super) fn input_share(&self) -> T {
        if self.turbine.converter.is_some() { self.turbine.converter_share } else { self.turbine.engine_share }
    }

    /// How an error of the stiffness of the drive shafts shows in the lasting states, per standard deviation of it: as one of all
    /// torques alike, and of no kiss point and no timing.
    fn by_stiffness(&self, elements: [ShiftElement; 2]) -> [T; ACTING] {
        let u = &self.uncertainty;
        let [off, on] = self.of_elements(elements, |u| u.torque_fraction);
        let in_fractions = [off, on, T::infinity(), T::infinity(), u.inertia_share, self.input_share()];
        let mut by = [T::zero(); ACTING];
        for (by, fraction) in by.iter_mut().zip(in_fractions).filter(|(_, fraction)| *fraction > T::zero()) {
            *by = u.stiffness_fraction / fraction;
        }
        by
    }

    /// Lets the valve models go on with what is learnt of lag and delay.
    pub(super) fn take_timing(&self, elements: &mut [Option<ElementState<T>>; MAX_ELEMENTS], learnt: &Learnt<T>) {
        for (at, (memory, element)) in elements.iter_mut().zip(self.tables.elements).enumerate() {
            if let Some(memory) = memory {
                memory.take_timing(element, &learnt.known_timing(at, element.uncertainty.slow_part));
            }
        }
    }

    /// The errors of the timing that the valve models of a shift have taken off.
    pub(super) fn taken_off(
        &self,
        elements: &[Option<ElementState<T>>; MAX_ELEMENTS],
        shift: &ShiftRow<T>,
    ) -> ByTiming<T> {
        let of = |element| self.element(elements, element).map_or([T::zero(); 2], |(memory, _)| memory.taken_off());
        shift.clutches.map(|clutch| of(clutch.element))
    }

    /// What is known before a shift, or in a gear.
    pub(super) fn known(&self, learnt: &Learnt<T>, acting: &Acting<T>) -> Known<T> {
        learnt.known(acting, &self.correlations())
    }

    /// Puts what is learnt into the states of a shift.
    pub(super) fn enter_shift(&self, running: &mut Running<T>, shift: ShiftRow<T>, learnt: &Learnt<T>) {
        let known = self.known(learnt, &self.acting(&shift));
        let x = &mut running.x;
        x.active = N;
        let turbine = x.covariance[SLOW_FRACTION][SLOW_FRACTION];
        for (a, state) in LASTING.into_iter().enumerate().take(TURBINE_ACTS) {
            x.renew(state, known.mean[a], known.covariance[a][a]);
            // What goes with the turbine torque goes with all that the speeds have shown of it.
            let fraction = known.covariance[a][TURBINE_ACTS] / turbine;
            for core in 0..IN_GEAR {
                let covariance = fraction * x.covariance[SLOW_FRACTION][core];
                x.add(state, core, covariance);
            }
            if let Some(bias) = &mut x.bias {
                bias.take_fraction(state, fraction, SLOW_FRACTION);
            }
            for (b, other) in LASTING.into_iter().enumerate().take(a) {
                x.add(state, other, known.covariance[a][b]);
            }
        }
        for state in PRESSURE {
            x.renew(state, T::zero(), T::one());
        }
        running.shift = Some(shift);
    }

    /// The gear holds, and the shift is learnt from. With the evidence, where it can be taken, comes whether there is a wheel speed.
    pub(super) fn end_shift(
        &self,
        running: &mut Running<T>,
        gear: Gear,
        (learnt, (evidence, has_wheels)): (&mut Learnt<T>, (Option<&mut Evidence<T>>, bool)),
    ) {
        if let Some((before, shift)) = running.before.take().zip(running.shift) {
            let (correlations, acting) = (self.correlations(), self.acting(&shift));
            let both = running.x.timing.together(before, running.lasting()).filter(|_| running.x.is_sound());
            let shown = both.and_then(|(before, after)| Shown::of(&acting, &before, &after, &correlations));
            let taken = shown.is_some_and(|shown| {
                if let Some(evidence) = evidence {
                    evidence.take(&acting, &shown, &self.widths(), has_wheels);
                }
                learnt.take_shown(&acting, shown, &correlations)
            });
            learnt.count(taken, &correlations);
        }
        self.take_turbine(running, learnt);
        running.renew_shift();
        running.compared = Compared::nothing();
        (running.gear, running.shift, running.torques) = (gear, None, None);
        running.phase = PhaseMemory::new(ShiftPhase::InGear);
    }

    /// Makes the lasting part of the turbine torque's error what is learnt of it.
    fn take_turbine(&self, running: &mut Running<T>, learnt: &Learnt<T>) {
        let known = self.known(learnt, &self.acting_in_gear());
        running.x.replace(SLOW_FRACTION, known.mean[TURBINE_ACTS], known.covariance[TURBINE_ACTS][TURBINE_ACTS]);
    }

    /// Another shift. From a gear it begins with what is learnt; an element that takes part in both this shift and the one
    /// before keeps what is known of it.
    pub(super) fn begin_shift(
        &self,
        running: &mut Running<T>,
        shift: ShiftRow<T>,
        slips: [Slip<T>; 2],
        learnt: &mut Learnt<T>,
    ) {
        let from_gear = running.shift.is_none();
        if from_gear {
            self.learn_turbine(running, learnt);
            self.learn_capacity(running, learnt);
            self.take_turbine(running, learnt);
            if running.misfit <= T::of(MISFIT) {
                self.keep_wheel_scale(running, learnt);
            }
            self.enter_shift(running, shift, learnt);
            running.before = (running.misfit <= T::of(MISFIT)).then(|| self.known(learnt, &self.acting(&shift)));
        } else {
            self.change_shift(running, shift, learnt);
            running.before = None;
        }
        let phase = match (from_gear, slips[0].is_over(), slips[1].is_over()) {
            (true, _, _) | (false, false, _) => ShiftPhase::OffgoingHolds,
            (false, true, false) => ShiftPhase::OncomingHolds,
            (false, true, true) => ShiftPhase::BothSlip,
        };
        running.torques = None;
        running.phase = PhaseMemory::new(phase);
    }

    /// Learns what the time in a gear has shown of the turbine torque.
    fn learn_turbine(&self, running: &mut Running<T>, learnt: &mut Learnt<T>) {
        let acting = self.acting_in_gear();
        let before = self.known(learnt, &acting);
        let mut after = before;
        after.mean[TURBINE_ACTS] = running.x.mean[SLOW_FRACTION];
        after.covariance[TURBINE_ACTS][TURBINE_ACTS] = running.x.covariance[SLOW_FRACTION][SLOW_FRACTION];
        learnt.take(&acting, &before, &after, &self.correlations());
    }

    /// Another shift before the one under way has ended: a change of mind.
    fn change_shift(&self, running: &mut Running<T>, shift: ShiftRow<T>, learnt: &Learnt<T>) {
        let mut before = running.shift.map(|shift| shift.clutches.map(|clutch| clutch.element));
        if let Some([off, on]) = &mut before
            && (*on == shift.clutches[0].element || *off == shift.clutches[1].element)
        {
            for [a, b] in [FRICTION, KISS, PRESSURE] {
                running.x.swap(a, b);
            }
            core::mem::swap(off, on);
        }
        let known = self.known(learnt, &self.acting(&shift));
        for (c, clutch) in shift.clutches.iter().enumerate() {
            let c = c.min(1);
            if before.is_some_and(|before| before[c] == clutch.element) {
                continue;
            }
            running.x.renew(FRICTION[c], known.mean[c], known.covariance[c][c]);
            running.x.renew(KISS[c], known.mean[c + 2], known.covariance[c + 2][c + 2]);
            running.x.renew(PRESSURE[c], T::zero(), T::one());
        }
        let pair = |from, to| self.tables.pair(from, to);
        if running.shift.is_none_or(|under_way| pair(under_way.from, under_way.to) != pair(shift.from, shift.to)) {
            running.x.renew(INERTIA, known.mean[INERTIA_ACTS], known.covariance[INERTIA_ACTS][INERTIA_ACTS]);
        }
        running.shift = Some(shift);
    }
}
