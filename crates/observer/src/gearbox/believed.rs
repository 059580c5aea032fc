//! Whether the command that comes for an element can be its own.
//!
//! A channel that has died or frozen gives a command for ever, and the speeds contradict it, for all errors within the budget:
//!
//! | the element | with its command | for |
//! |---|---|---|
//! | holds torque in a gear | it can hold less than half of that | 0.1 s |
//! | is open in a gear: a shift from it would engage it | it would carry torque | 0.3 s |
//! | is to close in a shift | it carries nothing, and the command has not changed since the shift began | 0.3 s |
//! | is let go in a shift | it would hold, and the command has not changed since the shift began | 0 |
//! | is let go in a shift and slips | it has pressure, and the command has not changed since the shift began | 25 ms |
//! | the same | it would hold, and the command has not changed for 0.1 s | 25 ms |
//!
//! Such a command is not used until it has changed by more than its noise. The torque of an element without a command, of this kind or because none
//! comes, is by the speeds alone: a state, with a standard deviation by the turbine torque while it holds or closes.

use drivetrain::Real;

use super::{FrictionElement, GearboxFilter, GearboxState, OUTPUT, ShiftElement, ShiftPhase, ShiftRow};
use car::ShiftCommand;

/// Time for which an element has to hold against its command, s \[chosen\]: longer than a valve needs.
const HOLDS_S: f64 = 0.1;
/// Time for which the gear has to hold against the command of an open element, s \[chosen\].
const OPEN_S: f64 = 0.3;
/// Time within which a clutch that is to close is filled, s \[chosen\].
const FILLS_S: f64 = 0.3;
/// Time for which it has to slip, s: longer than wrong readings show it.
const SLIPS_S: f64 = 0.025;
/// Time since a change of gears in which commands and readings may be of both, s \[chosen\].
const SETTLES_S: f64 = 0.3;
/// Time for which a command of a clutch that is let go does not stand, s \[chosen\].
const STANDS_S: f64 = 0.1;
/// Factors on the torque of an element in a gear, by errors of the turbine torque, below which it holds it and above which it does not \[chosen\].
const TORQUE: (f64, f64) = (0.5, 1.3);
/// Factors on what an element can hold where no budget is given \[chosen\].
const CAPACITY: (f64, f64) = (0.6, 1.5);
/// Change of the pressure that a command asks for, over the highest one, with which a channel is alive again \[chosen\]: no noise.
const ALIVE: f64 = 0.05;
/// Part of its largest torque for which nobody asks of an open element \[chosen\]: it is filled up to its kiss point before a shift.
const OPEN_PART: f64 = 0.2;
/// Torque that an element without pressure does not hold, N m \[chosen\]: beyond drag and what errs of the converter near equal speeds.
const HELD_N_M: f64 = 20.0;
/// Part of the turbine torque from which on an element carries torque in a gear.
const CARRIES: f64 = 0.05;

/// Standard deviation of the torque of an element without a command at the turbine, over the turbine torque, and beside it, N m \[chosen\]: a controller
/// asks for about what is needed. That of what is left of it when it is open, over this, and the time constant from the one to the other, s.
const UNHEARD: (f64, f64) = (0.5, 20.0);
pub(super) const LEFT: f64 = 0.02;
pub(super) const TURNS_S: f64 = 0.1;

/// What a vehicle file states of the torque of its offgoing clutch while no command of it comes: it walks while the clutch holds, and fades once it has
/// let go.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct UnheardTorque<T> {
    /// Standard deviation while it holds, N m.
    pub holds_n_m: T,
    /// The same of what is left when it is open, N m.
    pub open_n_m: T,
    /// Time constant from the one to the other, s.
    pub release_s: T,
}

impl<T: Real> UnheardTorque<T> {
    /// The same in another precision.
    pub(super) fn cast<U: Real>(&self) -> UnheardTorque<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        UnheardTorque { holds_n_m: to(self.holds_n_m), open_n_m: to(self.open_n_m), release_s: to(self.release_s) }
    }
}

/// What the speeds show of an element.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Seen<T> {
    /// It holds this torque in a gear, N m.
    Holds(T),
    /// It is open in a gear that holds.
    IsOpen,
    /// It is to close in a shift that has begun some time ago.
    Closes,
    /// It is let go in a shift, by the estimate, or by two readings of its slip; the torque that it held in the gear, N m.
    LetGo(T),
    /// It is let go in a shift and slips by the readings; the torque that it held in the gear, N m.
    Slips(T),
    /// Nothing of its command.
    Nothing,
}

/// Memory of what contradicts a command.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Belief<T> {
    /// Whether it has changed since the shift began.
    pub(super) has_changed: bool,
    contradicted_s: T,
    /// The pressure for which what is wrong asks, Pa; none while nothing is wrong.
    wrong_pa: Option<T>,
}

/// A command that is compared with what is seen.
#[derive(Debug, Clone, Copy)]
pub(super) struct Compared<'e, T> {
    pub(super) element: &'e FrictionElement<T>,
    /// The pressure for which it asks, Pa, and since when, s.
    pub(super) asked_pa: T,
    pub(super) since_s: T,
    pub(super) seen: Seen<T>,
}

impl<T: Real> Belief<T> {
    pub(super) fn new() -> Self {
        Self { has_changed: true, contradicted_s: T::zero(), wrong_pa: None }
    }

    /// Whether the command is wrong.
    pub(super) fn is_wrong(&self) -> bool {
        self.wrong_pa.is_some()
    }

    /// Whether a command that asks for this pressure, Pa, is used: not what has turned out to be wrong.
    pub(super) fn takes(&mut self, element: &FrictionElement<T>, asked_pa: impl FnOnce() -> T) -> bool {
        let Some(wrong_pa) = self.wrong_pa else { return true };
        let is_alive = (asked_pa() - wrong_pa).abs() > T::of(ALIVE) * element.limits.pressure_max_pa;
        if is_alive {
            self.wrong_pa = None;
        }
        is_alive
    }

    /// Compares a command with what is seen of its element over a step. Whether it is wrong from now on. `capacity_n_m` are the bounds of the torque up to
    /// which the element holds, where the budget gives some.
    pub(super) fn is_refuted(
        &mut self,
        Compared { element, asked_pa, since_s, seen }: &Compared<'_, T>,
        capacity_n_m: impl FnOnce() -> Option<[T; 2]>,
        dt_s: T,
    ) -> bool {
        let nominal = |pressure_pa: T| element.clutch.static_capacity(pressure_pa);
        let asks = *asked_pa > element.clutch.kiss_pressure();
        let may_be = match seen {
            Seen::Holds(torque_n_m) => !asks && *torque_n_m > T::of(HELD_N_M),
            Seen::IsOpen => asks && nominal(*asked_pa) > T::of(OPEN_PART) * nominal(element.limits.pressure_max_pa),
            Seen::Closes => !asks && !self.has_changed,
            Seen::LetGo(_) => asks && !self.has_changed,
            Seen::Slips(_) => asks && (!self.has_changed || *since_s > T::of(STANDS_S)),
            Seen::Nothing => false,
        };
        let (contradicts, longest_s) = if may_be {
            let by_nominal = [CAPACITY.0, CAPACITY.1].map(|factor| T::of(factor) * nominal(*asked_pa));
            let [min_n_m, max_n_m] = capacity_n_m().unwrap_or(by_nominal);
            let would_hold = |torque_n_m: T| min_n_m > T::of(HELD_N_M) + T::of(TORQUE.1) * torque_n_m;
            match *seen {
                Seen::Holds(torque_n_m) => (max_n_m < T::of(TORQUE.0) * torque_n_m, HOLDS_S),
                Seen::IsOpen => (min_n_m > T::of(HELD_N_M), OPEN_S),
                Seen::Closes => (max_n_m < T::of(HELD_N_M), 0.0),
                Seen::LetGo(torque_n_m) => (would_hold(torque_n_m), 0.0),
                Seen::Slips(torque_n_m) if self.has_changed => (would_hold(torque_n_m), SLIPS_S),
                Seen::Slips(torque_n_m) => (true, if would_hold(torque_n_m) { 0.0 } else { SLIPS_S }),
                Seen::Nothing => (false, 0.0),
            }
        } else {
            (false, 0.0)
        };
        self.contradicted_s = if contradicts { self.contradicted_s + dt_s } else { T::zero() };
        let is_refuted = self.contradicted_s > T::of(longest_s);
        if is_refuted {
            (self.contradicted_s, self.wrong_pa) = (T::zero(), Some(*asked_pa));
        }
        is_refuted
    }
}

/// What a step has shown, for each element.
struct Shown<'a, T> {
    turbine_n_m: T,
    /// The shift that is commanded, and since when, s.
    shift: Option<&'a ShiftRow<T>>,
    since_s: T,
    /// Whether the offgoing clutch of it has let go, by the estimate or by two readings, and slips by the readings.
    lets_go: bool,
    slips: bool,
    /// The place of the gear that holds.
    gear: Option<usize>,
}

impl<T: Real> GearboxFilter<'_, T> {
    /// Compares the commands with the speeds after a step, and follows the torques of elements without one.
    pub(super) fn follow_commands(&self, state: &mut GearboxState<T>, dt_s: T) {
        let (gears, since_s) = state.gears;
        let begins = since_s <= T::zero() && !gears.is_steady();
        let shown = self.shown(state);
        for (at, (memory, element)) in state.elements.iter_mut().zip(self.tables.elements).enumerate() {
            let Some(memory) = memory else { continue };
            memory.belief.has_changed &= !begins;
            let Some(shown) = &shown else { continue };
            let asks = memory.asks(element);
            let seen = self.seen(shown, at, asks);
            match asks {
                Some(_) => memory.judge(element, seen, dt_s),
                None => {
                    let lets_go = matches!(seen, Seen::LetGo(_) | Seen::Slips(_));
                    memory.follow_unheard(self.unheard_n_m(shown, gears, at), lets_go, dt_s);
                }
            }
        }
    }

    /// Standard deviation of the torque of the element at this place without a command, N m; zero of one that is open.
    fn unheard_n_m(&self, shown: &Shown<'_, T>, gears: ShiftCommand, at: usize) -> T {
        let at_turbine_n_m = T::of(UNHEARD.0) * shown.turbine_n_m.abs() + T::of(UNHEARD.1);
        if let Some(shift) = shown.shift {
            let own = shift.clutches.iter().find(|clutch| clutch.element.place() == Some(at));
            return own.map_or(T::zero(), |clutch| at_turbine_n_m / clutch.alpha.abs());
        }
        let gear = gears.from.place().and_then(|gear| self.tables.gears.get(gear));
        let holding = gear.and_then(|gear| gear.holding.get(at)).map_or(T::zero(), |holding| holding.abs());
        if holding > T::of(CARRIES) { holding * at_turbine_n_m } else { T::zero() }
    }

    fn shown(&self, state: &GearboxState<T>) -> Option<Shown<'_, T>> {
        let (gears, since_s) = state.gears;
        let (phase, turbine_n_m) = (state.estimate.phase?, state.estimate.turbine_n_m?);
        let shift = self.tables.commanded(gears);
        let slips = shift
            .filter(|_| phase == ShiftPhase::BothSlip && self.are_read(&state.newest))
            .is_some_and(|shift| self.slip(shift.clutches[0].ratio, self.measured(&state.newest, None)).is_over());
        let is_doubted = phase == ShiftPhase::OffgoingHolds
            && state.running.as_ref().is_some_and(|running| running.phase.is_doubted_again());
        let lets_go = phase == ShiftPhase::BothSlip || is_doubted;
        let moves = state.newest[OUTPUT].is_some_and(|output| output.value.abs() > self.uncertainty.output_least_rad_s);
        let is_settled = moves && self.are_read(&state.newest) && !state.slips && since_s > T::of(SETTLES_S);
        let gear = gears.from.place().filter(|_| phase == ShiftPhase::InGear && gears.is_steady() && is_settled);
        Some(Shown { turbine_n_m, shift, since_s, lets_go, slips, gear })
    }

    /// What is seen of the element at this place that its command, which asks for pressure or not, may contradict. Beside a one-way clutch nothing: that
    /// holds without it, and overruns with it.
    fn seen(&self, shown: &Shown<'_, T>, at: usize, asks: Option<bool>) -> Seen<T> {
        let torque_n_m = |gear: usize| {
            let holding = self.tables.gears.get(gear).and_then(|row| row.holding.get(at).copied());
            holding.unwrap_or(T::zero()).abs() * shown.turbine_n_m.abs()
        };
        let is_at = |element: ShiftElement| element.place() == Some(at) && !element.is_one_sided();
        if let Some(shift) = shown.shift {
            let [offgoing, oncoming] = shift.clutches.each_ref().map(|clutch| is_at(clutch.element));
            return match () {
                () if oncoming && shown.since_s > T::of(FILLS_S) => Seen::Closes,
                () if !(offgoing && shown.lets_go) => Seen::Nothing,
                () if shown.slips => Seen::Slips(torque_n_m(shift.from)),
                () => Seen::LetGo(torque_n_m(shift.from)),
            };
        }
        let (Some(gear), Some(asks)) = (shown.gear, asks) else { return Seen::Nothing };
        let torque_n_m = torque_n_m(gear);
        let holds = torque_n_m > T::of(CARRIES) * shown.turbine_n_m.abs();
        if asks == holds {
            return Seen::Nothing;
        }
        let mut clutches = self.tables.shifts.iter().flat_map(|shift| &shift.clutches);
        if clutches.any(|clutch| clutch.element.is_one_sided() && clutch.element.place() == Some(at)) {
            return Seen::Nothing;
        }
        let engages = |shift: &ShiftRow<T>| shift.from == gear && is_at(shift.clutches[1].element);
        match holds {
            true => Seen::Holds(torque_n_m),
            false if self.tables.shifts.iter().any(engages) => Seen::IsOpen,
            false => Seen::Nothing,
        }
    }
}
