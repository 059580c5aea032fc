//! The valve models of all elements, which run through the whole drive, and the torque that a slipping element has by them.

use drivetrain::{Clutch, Real};

use super::believed::{Belief, Compared, LEFT, Seen, TURNS_S, UnheardTorque};
use super::pistons::Pistons;
use super::powertrain::ClutchTorque;
use super::tables::{FrictionElement, ShiftClutch};
use super::{ElementUncertainty, PIECE_S, pieces, square};
use crate::bound::{capacity_min_n_m, pressure_and_torque};
use crate::kalman::valve_model::Commands;
use crate::{ChannelHealth, LOST_S, PressureRange, Reading};

/// Distance from the pressure that the command ends at from which on the valve model rests there, Pa \[chosen\]: errors of a
/// pressure are thousands of this.
const RESTS_PA: f64 = 1.0;
/// Shortest step for which the rate of the pressure is taken, s \[chosen\]: of a shorter one rounding would make a rate without bound.
const RATE_S: f64 = 1e-5;

/// Minimum factor on the lag of a valve \[chosen\]: the bounds of the standard budget end at half the lag.
const LAG_MIN: f64 = 0.1;

/// What is known of the errors of an element's pressure and kiss point, in their standard deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PressureError<T> {
    pub(super) pressure: T,
    pub(super) kiss: T,
    /// Of both.
    pub(super) variance: [T; 2],
    pub(super) covariance: T,
}

impl<T: Real> PressureError<T> {
    /// Variance of the error of the pressure above the kiss point, Pa^2, with these standard deviations of kiss point and pressure.
    fn variance_pa(&self, [kiss_pa, moving_pa]: [T; 2]) -> T {
        square(moving_pa) * self.variance[0] + square(kiss_pa) * self.variance[1]
            - T::of(2.0) * moving_pa * kiss_pa * self.covariance
    }

    /// Nothing but what is learnt of the kiss point.
    pub(super) fn unseen(kiss: T) -> Self {
        Self { pressure: T::zero(), kiss, variance: [T::one(); 2], covariance: T::zero() }
    }
}

/// Mean of `max(x, 0)`, where `x` has this mean and variance, and its derivative by that mean: the probability that `x` is
/// positive. Of a uniform distribution, which has no tail far from its bounds.
pub(super) fn positive_part<T: Real>(mean: T, variance: T) -> (T, T) {
    let half = (T::of(3.0) * variance.max(T::zero())).sqrt();
    let above = mean + half;
    if mean >= half {
        (mean, T::one())
    } else if above > T::zero() {
        let slope = above / (half + half);
        (T::of(0.5) * slope * above, slope)
    } else {
        (T::zero(), T::zero())
    }
}

/// What presses the plates, Pa.
struct Pressing<T> {
    /// Mean of the pressure above the kiss point, where it is positive.
    pressed_pa: T,
    /// Its derivative by that pressure.
    slope: T,
    /// Mean of the error of the pressure above the kiss point.
    error_pa: T,
    /// Standard deviations of kiss point and pressure by the budget.
    kiss_pa: T,
    moving_pa: T,
    /// What it changes by the error of the fill, and per standard deviation of it.
    by_fill_pa: T,
    per_fill_pa: T,
}

impl<T: Real> Pressing<T> {
    /// Nothing presses the plates, and nothing of what is not known changes it.
    fn nothing() -> Self {
        let zero = T::zero();
        Self {
            pressed_pa: zero,
            slope: zero,
            error_pa: zero,
            kiss_pa: zero,
            moving_pa: zero,
            by_fill_pa: zero,
            per_fill_pa: zero,
        }
    }
}

/// What is learnt of lag and delay of a valve, in standard deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct ValveTiming<T> {
    pub(super) mean: [T; 2],
    /// Of all errors of both, also of those that are others in each shift.
    pub(super) variance: [T; 2],
}

impl<T: Real> ValveTiming<T> {
    pub(super) fn unlearnt() -> Self {
        Self { mean: [T::zero(); 2], variance: [T::one(); 2] }
    }
}

/// The newest command.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct NewestCommand<T> {
    command: T,
    /// The pressure that it ends at, Pa.
    settled_pa: T,
    age_s: T,
    /// Since when all commands have been this one, s.
    alike_s: T,
    /// For how long the valve has rested where this command ends, s; none while it moves. Meanwhile `commands` stands still.
    rests_s: Option<T>,
}

/// Memory of an element.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct ElementState<T> {
    commands: Commands<T>,
    /// Pressure by the valve model, Pa, and its rate over the last step, Pa/s.
    pub(super) valve_pa: T,
    rate_pa_s: T,
    /// Change of the pressure per fraction by which the lag is longer, Pa: `q' = -q/tau - p'`, with the other sign.
    per_lag_pa: T,
    /// What is learnt of lag and delay.
    timing: ValveTiming<T>,
    /// Factor on the lag, and delay, s, with it.
    lag: T,
    delay_s: T,
    newest: Option<NewestCommand<T>>,
    /// Whether its command can be its own.
    pub(super) belief: Belief<T>,
    /// Standard deviation of its torque while no command comes, N m.
    unheard_n_m: T,
    /// Whether none came or was used in the step before.
    was_unheard: bool,
    /// What is stated of that torque: that none ever comes is no fault then.
    stated: Option<UnheardTorque<T>>,
    /// Where the piston has a stroke, once a command has come.
    pistons: Option<Pistons<T>>,
    range: Option<PressureRange<T>>,
}

impl<T: Real> ElementState<T> {
    pub(super) fn new(element: &FrictionElement<T>) -> Self {
        Self {
            commands: Commands::new(),
            valve_pa: T::zero(),
            rate_pa_s: T::zero(),
            per_lag_pa: T::zero(),
            timing: ValveTiming::unlearnt(),
            lag: T::one(),
            delay_s: element.valve.delay_s,
            newest: None,
            belief: Belief::new(),
            unheard_n_m: T::zero(),
            was_unheard: true,
            stated: None,
            pistons: None,
            range: element.budget.as_ref().map(|budget| PressureRange::unknown(budget, element.limits.command_max)),
        }
    }

    /// Takes what is stated of its torque without commands.
    pub(super) fn take_unheard(&mut self, stated: &UnheardTorque<T>) {
        (self.unheard_n_m, self.stated) = (stated.holds_n_m, Some(*stated));
    }

    /// Compares its command with what is seen of it.
    pub(super) fn judge(&mut self, element: &FrictionElement<T>, seen: Seen<T>, dt_s: T) {
        let Some(newest) = &self.newest else { return };
        let compared = Compared { element, asked_pa: newest.settled_pa, since_s: newest.alike_s, seen };
        let (range, budget) = (&mut self.range, &element.budget);
        let capacity_n_m = || {
            let (range, budget) = (range.as_ref()?, budget.as_ref()?);
            let [_, max_n_m] = pressure_and_torque(&element.clutch, budget, range, None).1;
            Some([capacity_min_n_m(&element.clutch, budget, range), max_n_m])
        };
        if self.belief.is_refuted(&compared, capacity_n_m, dt_s)
            && let (Some(range), Some(budget)) = (range, budget)
        {
            range.forget(budget, element.limits.command_max);
        }
    }

    /// Follows the standard deviation of its torque without a command: to that of one that holds or closes, N m, or of one that is released.
    pub(super) fn follow_unheard(&mut self, full_n_m: T, is_released: bool, dt_s: T) {
        let (end_n_m, time_s) = match (&self.stated, is_released) {
            (Some(stated), true) => (stated.open_n_m, stated.release_s),
            (Some(stated), false) => return self.unheard_n_m = stated.holds_n_m,
            (None, true) => (T::of(LEFT) * full_n_m, T::of(TURNS_S)),
            (None, false) => (full_n_m, T::of(TURNS_S)),
        };
        self.unheard_n_m = end_n_m + (self.unheard_n_m - end_n_m) * (-dt_s / time_s).exp();
    }

    /// Whether it has no command from this step on, or has one again.
    pub(super) fn has_switched(&mut self) -> bool {
        let is_unheard = self.is_unheard();
        core::mem::replace(&mut self.was_unheard, is_unheard) != is_unheard
    }

    /// Its torque begins without a command, with this standard deviation, N m, if none is stated. Returns that.
    pub(super) fn begin_unheard(&mut self, full_n_m: T) -> T {
        self.unheard_n_m = self.stated.as_ref().map_or(full_n_m, |stated| stated.holds_n_m);
        self.unheard_n_m
    }

    /// A shift begins, before the command of its first row.
    pub(super) fn begin_shift(&mut self) {
        self.belief.begin_shift(self.newest.map(|newest| newest.settled_pa));
    }

    /// Whether its command asks for pressure; none without a command.
    pub(super) fn asks(&self, element: &FrictionElement<T>) -> Option<bool> {
        let newest = self.newest.filter(|_| !self.is_unheard())?;
        Some(newest.settled_pa > element.clutch.kiss_pressure())
    }

    /// Goes on with what is learnt of lag and delay. A lag has a length, and no command arrives before it was sent.
    pub(super) fn take_timing(&mut self, element: &FrictionElement<T>, timing: &ValveTiming<T>) {
        let ([lag, delay], u) = (timing.mean, &element.uncertainty);
        self.timing = *timing;
        self.lag = (T::one() + u.valve_lag_fraction * lag).at_least(T::of(LAG_MIN));
        self.delay_s = (element.valve.delay_s + u.valve_delay_s * delay).at_least(T::zero());
    }

    /// The pressure that the clutch has or goes to, by the newest command, whichever is lower, Pa.
    pub(super) fn lower_pa(&self) -> T {
        self.newest.map_or(self.pressure_pa(), |newest| self.pressure_pa().min(newest.settled_pa))
    }

    /// The errors of lag and delay that the valve model has taken off, in standard deviations.
    pub(super) fn taken_off(&self) -> [T; 2] {
        self.timing.mean
    }

    /// Lets time pass, and takes a command if there is one.
    #[inline]
    pub(super) fn step(&mut self, element: &FrictionElement<T>, command: Option<Reading<T>>, dt_s: T) -> ChannelHealth {
        if dt_s > T::zero() {
            self.pass(element, dt_s);
        }
        let usable = command.and_then(|reading| element.limits.usable(&reading));
        let asked_pa = |reading: &Reading<T>| element.valve.valve.settled_pressure(reading.value);
        let usable = usable.filter(|reading| self.belief.takes(element, || asked_pa(reading)));
        if let (Some(range), Some(budget)) = (&mut self.range, &element.budget) {
            range.step(budget, dt_s, usable, element.limits.command_max);
        }
        match (command, usable) {
            (None, _) if self.newest.is_none() && self.stated.is_some() => ChannelHealth::Unused,
            (None, _) if self.newest.is_none_or(|newest| newest.age_s > T::of(LOST_S)) => ChannelHealth::Lost,
            (None, _) => ChannelHealth::Absent,
            (Some(_), None) => ChannelHealth::Refused,
            (Some(_), Some(reading)) => {
                self.take(element, &reading);
                ChannelHealth::Good
            }
        }
    }

    /// Carries the valve on, unless it rests.
    #[inline]
    fn pass(&mut self, element: &FrictionElement<T>, dt_s: T) {
        if let Some(newest) = &mut self.newest {
            (newest.age_s, newest.alike_s) = (newest.age_s + dt_s, newest.alike_s + dt_s);
            if let Some(rests_s) = &mut newest.rests_s {
                *rests_s = *rests_s + dt_s;
                return;
            }
        }
        self.move_valve(element, dt_s);
        if let Some(newest) = &mut self.newest {
            let end_pa = element.limits.possible_pressure(newest.settled_pa);
            let near = (self.valve_pa - end_pa).abs().at_least(self.per_lag_pa.abs()) <= T::of(RESTS_PA);
            if near && newest.alike_s - dt_s >= self.delay_s {
                (self.valve_pa, self.rate_pa_s, self.per_lag_pa) = (end_pa, T::zero(), T::zero());
                newest.rests_s = Some(T::zero());
            }
        }
    }

    fn move_valve(&mut self, element: &FrictionElement<T>, dt_s: T) {
        let start_pa = self.valve_pa;
        let (pieces, piece_s) = pieces(dt_s);
        for _ in 0..pieces {
            self.commands.pass(piece_s);
            let settled_pa = element.valve.target_after_pa(&self.commands, self.delay_s, piece_s);
            // A lag that is longer by a factor is a time that passes slower by it.
            let step = element.valve.step(settled_pa, self.valve_pa, piece_s / self.lag);
            let before_pa = self.valve_pa;
            self.valve_pa = element.limits.possible_pressure(step.phi * before_pa + step.drift_pa);
            self.per_lag_pa = step.phi * self.per_lag_pa + (self.valve_pa - before_pa);
        }
        self.rate_pa_s = (self.valve_pa - start_pa) / dt_s.at_least(T::of(RATE_S));
    }

    /// Lets time pass for the pistons, where they have a stroke, once there is a command: after [`Self::step`].
    pub(super) fn move_pistons(&mut self, element: &FrictionElement<T>, dt_s: T) {
        let Some(piston) = element.piston.as_ref().filter(|_| self.newest.is_some()) else { return };
        let (error_pa, moving_pa) = (element.above_kiss_pa(), self.std_dev_pa(&element.uncertainty));
        match &mut self.pistons {
            None => self.pistons = Some(Pistons::settled(piston, self.valve_pa, error_pa, moving_pa)),
            Some(pistons) => pistons.step(piston, self.valve_pa, [error_pa, moving_pa], dt_s),
        }
    }

    /// Takes a usable command.
    #[inline]
    fn take(&mut self, element: &FrictionElement<T>, reading: &Reading<T>) {
        let needed_s = self.delay_s.at_least(element.valve.delay_s) + T::of(PIECE_S);
        if let Some(newest) = &mut self.newest {
            // Commands arrive in their order.
            newest.age_s = newest.age_s.at_most(reading.age_s);
            if newest.command == reading.value {
                if newest.rests_s.is_none() {
                    self.commands.send(newest.age_s, newest.settled_pa, needed_s);
                }
                return;
            }
            if let Some(rests_s) = newest.rests_s {
                self.commands.pass(rests_s);
            }
        }
        let settled_pa = element.valve.valve.settled_pressure(reading.value);
        if self.newest.is_none() {
            // The first command is taken to have stood for long.
            self.valve_pa = element.limits.possible_pressure(settled_pa);
        }
        let age_s = self.newest.map_or(reading.age_s, |newest| newest.age_s);
        self.commands.send(age_s, settled_pa, needed_s);
        self.newest = Some(NewestCommand { command: reading.value, settled_pa, age_s, alike_s: age_s, rests_s: None });
    }

    /// Forgets the range and the rate: time was lost, and with it commands.
    pub(super) fn forget(&mut self, element: &FrictionElement<T>) {
        if let (Some(range), Some(budget)) = (&mut self.range, &element.budget) {
            range.forget(budget, element.limits.command_max);
        }
        (self.rate_pa_s, self.per_lag_pa) = (T::zero(), T::zero());
    }

    /// Pressure in the cylinder by the models of valve and piston, Pa.
    pub(super) fn pressure_pa(&self) -> T {
        self.pistons.as_ref().map_or(self.valve_pa, Pistons::nominal_pa)
    }

    /// The error of that pressure, Pa, where `x` is that of the pressure in its standard deviations.
    pub(super) fn error_pa(&self, element: &FrictionElement<T>, x: T) -> T {
        match &self.pistons {
            None => self.std_dev_pa(&element.uncertainty) * x,
            Some(pistons) => pistons.mean_pa() - pistons.nominal_pa() + pistons.spread.all_pa * x,
        }
    }

    /// Standard deviation of that error, Pa.
    pub(super) fn error_std_dev_pa(&self, element: &FrictionElement<T>) -> T {
        match &self.pistons {
            None => self.std_dev_pa(&element.uncertainty),
            Some(pistons) => pistons.spread.all_pa,
        }
    }

    /// Correlation of the error of the pressure with that at the step before, beside its fading; `None` without a stroke: all of it
    /// lasts.
    pub(super) fn error_lasts(&self) -> Option<T> {
        self.pistons.as_ref().map(|pistons| pistons.lasts)
    }

    /// Takes what the readings have shown of the error of what presses the plates: factor of that error then, and what is added.
    pub(super) fn take_fill(&mut self, before: [T; 2], after: [T; 2]) -> Option<[T; 2]> {
        self.pistons.as_mut()?.take_shown(before, after)
    }

    /// Standard deviation of the pressure by the valve model beside what lasts, Pa: errors of lag and delay while it
    /// moves, and at rest.
    fn std_dev_pa(&self, u: &ElementUncertainty<T>) -> T {
        let [lag, delay] = self.timing.variance;
        let [by_lag_pa, by_delay_pa] = self.by_timing_pa(u);
        (lag * square(by_lag_pa) + delay * square(by_delay_pa) + square(u.pressure_pa)).sqrt()
    }

    /// Change of the pressure by a lag and a delay that are longer by one standard deviation, Pa.
    fn by_timing_pa(&self, u: &ElementUncertainty<T>) -> [T; 2] {
        [-u.valve_lag_fraction * self.per_lag_pa / self.lag, -u.valve_delay_s * self.rate_pa_s]
    }

    /// Whether its torque is known by the speeds alone, as no command comes: it walks, and only a slip shows that it no longer holds.
    pub(super) fn is_unheard(&self) -> bool {
        let is_lost = || self.newest.is_none_or(|newest| newest.age_s > T::of(LOST_S));
        self.belief.is_wrong() || is_lost()
    }

    /// The pressure on the plates, by what is known of its errors. The plates do not pull: near the kiss point the mean of the
    /// positive part is more than that of the mean.
    #[inline]
    fn pressing(&self, element: &FrictionElement<T>, wrong: &PressureError<T>) -> Pressing<T> {
        let clutch = &element.clutch;
        let (kiss_pa, moving_pa) = (element.kiss_std_dev_pa(), self.std_dev_pa(&element.uncertainty));
        if let Some(pistons) = &self.pistons {
            return pressing_of_pistons(pistons, clutch, [kiss_pa, moving_pa], wrong);
        }
        let error_pa = moving_pa * wrong.pressure - kiss_pa * wrong.kiss;
        let variance = wrong.variance_pa([kiss_pa, moving_pa]);
        let (pressed_pa, slope) = positive_part(self.valve_pa - clutch.kiss_pressure() + error_pa, variance);
        Pressing { pressed_pa, slope, error_pa, kiss_pa, moving_pa, ..Pressing::nothing() }
    }

    /// Torque at the turbine while the element slips. `slip_rad_s` is the slip at the turbine, `w_t - i w_o`; `direction`
    /// is its sign, less where it is uncertain.
    #[inline]
    pub(super) fn torque(
        &self,
        element: &FrictionElement<T>,
        shift: &ShiftClutch<T>,
        [slip_rad_s, direction]: [T; 2],
        wrong: &PressureError<T>,
    ) -> ClutchTorque<T> {
        if shift.element.is_one_sided() && direction <= T::zero() {
            // The one-way clutch of its gear overruns.
            return ClutchTorque { ratio: shift.ratio, ..ClutchTorque::none() };
        }
        let (clutch, u) = (&element.clutch, &element.uncertainty);
        let slip = shift.alpha * slip_rad_s;
        let size = shift.alpha.abs() * direction;
        if self.is_unheard() {
            return ClutchTorque {
                ratio: shift.ratio,
                per_pressure_n_m: size * self.unheard_n_m,
                ..ClutchTorque::none()
            };
        }
        let per_pa = size * clutch.torque_per_force(slip) * clutch.piston_area_m2;
        let pressing = self.pressing(element, wrong);
        let Pressing { pressed_pa, slope, error_pa, kiss_pa, moving_pa, by_fill_pa, per_fill_pa } = pressing;
        let per_pressure_pa = slope * moving_pa + per_fill_pa;
        let per_timing = if per_pressure_pa > T::zero() { slope / per_pressure_pa } else { T::zero() };
        ClutchTorque {
            ratio: shift.ratio,
            base_n_m: per_pa * (pressed_pa - slope * error_pa - by_fill_pa),
            per_friction_n_m: u.torque_fraction * per_pa * pressed_pa,
            per_kiss_n_m: -per_pa * slope * kiss_pa,
            per_pressure_n_m: per_pa * per_pressure_pa,
            by_timing: self.by_timing_pa(u).map(|by_pa| per_timing * by_pa),
            open_loop_n_m: shift.alpha.abs() * direction.signum() * clutch.torque_capacity(self.pressure_pa(), slip),
        }
    }

    /// The torque at the turbine up to which the element holds, N m, by what is known of its errors: `factor` is that of its torque,
    /// in standard deviations.
    #[inline]
    pub(super) fn holds(
        &self,
        element: &FrictionElement<T>,
        shift: &ShiftClutch<T>,
        factor: T,
        wrong: &PressureError<T>,
    ) -> T {
        if self.is_unheard() {
            return T::infinity();
        }
        let clutch = &element.clutch;
        let friction = clutch.static_friction.max(clutch.friction.at(T::zero()));
        let per_pa = shift.alpha.abs() * friction * clutch.lever() * clutch.piston_area_m2;
        per_pa * self.pressing(element, wrong).pressed_pa * (T::one() + element.uncertainty.torque_fraction * factor)
    }

    /// Guaranteed range of the pressure, Pa.
    pub(super) fn pressure_range_pa(&self, element: &FrictionElement<T>) -> Option<[T; 2]> {
        Some(self.range.as_ref()?.pressure_pa(element.budget.as_ref()?))
    }

    /// Lower bound of the torque up to which the element holds, N m; `None` without a budget, or before the first command.
    pub(super) fn capacity_min_n_m(&self, element: &FrictionElement<T>) -> Option<T> {
        self.newest?;
        Some(capacity_min_n_m(&element.clutch, element.budget.as_ref()?, self.range.as_ref()?))
    }

    /// Guaranteed ranges of pressure and torque at the element, with its minimum and maximum slip if they are known.
    pub(super) fn ranges(&self, element: &FrictionElement<T>, slip_rad_s: Option<[T; 2]>) -> Option<([T; 2], [T; 2])> {
        let (range, budget) = (self.range.as_ref()?, element.budget.as_ref()?);
        Some(pressure_and_torque(&element.clutch, budget, range, slip_rad_s))
    }
}

/// The pressure on the plates where the piston has a stroke. The error `x` of what presses them is one of the pressure, where they touch,
/// and one of the fill: the parts that each has of its variance are those that each has of its mean.
#[inline(never)]
fn pressing_of_pistons<T: Real>(
    pistons: &Pistons<T>,
    clutch: &Clutch<T>,
    [kiss_pa, moving_pa]: [T; 2],
    wrong: &PressureError<T>,
) -> Pressing<T> {
    let spread = &pistons.spread;
    if spread.all_pa <= T::zero() {
        // No plates touch.
        return Pressing::nothing();
    }
    let part = spread.touches * moving_pa / spread.all_pa;
    let seen_pa = part * moving_pa;
    let error_pa = seen_pa * wrong.pressure - kiss_pa * wrong.kiss;
    let unseen = square(moving_pa) * (T::one() - square(part)).at_least(T::zero());
    let variance = wrong.variance_pa([kiss_pa, seen_pa]) + unseen;
    let kissed_pa = clutch.kiss_pressure();
    let ([mean_pa, slope], max_pa) =
        pistons.pressed(|pressure_pa| positive_part(pressure_pa - kissed_pa + error_pa, variance));
    let per_fill_pa = square(spread.fill_pa) / spread.all_pa;
    let by_fill_pa = per_fill_pa * wrong.pressure;
    Pressing {
        pressed_pa: (mean_pa + by_fill_pa).at_least(T::zero()).at_most(max_pa),
        slope,
        error_pa,
        kiss_pa,
        moving_pa: seen_pa,
        by_fill_pa,
        per_fill_pa,
    }
}

#[cfg(test)]
mod tests;
