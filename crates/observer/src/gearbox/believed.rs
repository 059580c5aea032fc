//! Whether the command that comes for an element can be its own.
//!
//! A channel that has died or frozen gives a command for ever, and the speeds contradict it, but in the last row but one for all errors within the budget:
//!
//! | the element | with its command | for |
//! |---|---|---|
//! | holds torque in a gear | it can hold less than half of that | 0.1 s |
//! | is open in a gear: a shift from it would engage it | it would carry torque | 0.3 s |
//! | closes in a shift: it grips, or pulls the turbine against its torque | it carries nothing, and the command has not changed since the shift began | 0 |
//! | is released in a shift | it would hold, and the command has not changed since the shift began | 0 |
//! | is released in a shift and slips | it would hold half the torque of the gear by its maps, and the command has not changed since the shift began | 25 ms |
//! | the same | it would hold, and the command has not changed for 0.1 s | 25 ms |
//!
//! Such a command is not used until it has changed by more than its noise. The torque of an element without a command, of this kind or because none
//! comes, is by the speeds alone: a state, with a standard deviation by the turbine torque while it holds or closes.

use drivetrain::Real;

use super::{
    FrictionElement, GearboxFilter, GearboxState, OUTPUT, PRESSURE, Running, ShiftElement, ShiftEstimate, ShiftPhase,
    ShiftRow,
};
use car::ShiftCommand;

/// Time for which an element has to hold against its command, s \[chosen\]: longer than a valve needs.
const HOLDS_S: f64 = 0.1;
/// Time for which the gear has to hold against the command of an open element, s \[chosen\].
const OPEN_S: f64 = 0.3;
/// Time for which it has to slip, s: longer than wrong readings show it.
const SLIPS_S: f64 = 0.025;
/// Time since a change of gears in which commands and readings may be of both, s \[chosen\].
const SETTLES_S: f64 = 0.3;
/// Time for which a command of a clutch that is released does not stand, s \[chosen\].
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
/// been released.
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
    /// It closes in a shift: it grips, or nothing else can pull the turbine to the new gear.
    Closes,
    /// It is released in a shift, by the estimate; the torque that it held in the gear, N m.
    Released(T),
    /// It is released in a shift and slips by the readings; the torque that it held in the gear, N m.
    Slips(T),
    /// Nothing of its command.
    Nothing,
}

/// Memory of what contradicts a command.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Belief<T> {
    /// The pressure for which it asked before the shift began, Pa; none without a command then.
    begun_pa: Option<T>,
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

/// Whether two pressures for which a command asks, Pa, differ by more than the noise of one that stands.
fn is_another<T: Real>(element: &FrictionElement<T>, asked_pa: T, before_pa: T) -> bool {
    (asked_pa - before_pa).abs() > T::of(ALIVE) * element.limits.pressure_max_pa
}

impl<T: Real> Belief<T> {
    pub(super) fn new() -> Self {
        Self { begun_pa: None, contradicted_s: T::zero(), wrong_pa: None }
    }

    /// Whether the command is wrong.
    pub(super) fn is_wrong(&self) -> bool {
        self.wrong_pa.is_some()
    }

    /// A shift begins, before which the command asked for this pressure, Pa.
    pub(super) fn begin_shift(&mut self, asked_pa: Option<T>) {
        self.begun_pa = asked_pa;
    }

    /// Whether a command that asks for this pressure, Pa, is used: not what has turned out to be wrong.
    pub(super) fn takes(&mut self, element: &FrictionElement<T>, asked_pa: impl FnOnce() -> T) -> bool {
        let Some(wrong_pa) = self.wrong_pa else { return true };
        let is_alive = is_another(element, asked_pa(), wrong_pa);
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
        let has_changed = self.begun_pa.is_none_or(|begun_pa| is_another(element, *asked_pa, begun_pa));
        let may_be = match seen {
            Seen::Holds(torque_n_m) => !asks && *torque_n_m > T::of(HELD_N_M),
            Seen::IsOpen => asks && nominal(*asked_pa) > T::of(OPEN_PART) * nominal(element.limits.pressure_max_pa),
            Seen::Closes => !asks && !has_changed,
            Seen::Released(_) => asks && !has_changed,
            Seen::Slips(_) => asks && (!has_changed || *since_s > T::of(STANDS_S)),
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
                Seen::Released(torque_n_m) => (would_hold(torque_n_m), 0.0),
                Seen::Slips(torque_n_m) if has_changed => (would_hold(torque_n_m), SLIPS_S),
                Seen::Slips(torque_n_m) if would_hold(torque_n_m) => (true, 0.0),
                Seen::Slips(torque_n_m) => (nominal(*asked_pa) > T::of(TORQUE.0) * torque_n_m, SLIPS_S),
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
    /// The shift that is commanded.
    shift: Option<&'a ShiftRow<T>>,
    /// Whether the offgoing clutch of it has been released, by the estimate, and slips by the readings.
    is_released: bool,
    slips: bool,
    /// Whether the oncoming clutch of it holds, or pulls the turbine to the new gear against its torque.
    is_pulled: bool,
    /// The place of the gear that holds.
    gear: Option<usize>,
    /// Whether an element that a shift from this gear engages asks for pressure.
    fills: bool,
}

impl<T: Real> GearboxFilter<'_, T> {
    /// Compares the commands with the speeds after a step, and follows the torques of elements without one.
    pub(super) fn follow_commands(&self, state: &mut GearboxState<T>, dt_s: T) {
        let (gears, _) = state.gears;
        let Some(shown) = self.shown(state) else { return };
        for (at, (memory, element)) in state.elements.iter_mut().zip(self.tables.elements).enumerate() {
            let Some(memory) = memory else { continue };
            let asks = memory.asks(element);
            let seen = self.seen(&shown, at, asks);
            match asks {
                Some(_) => memory.judge(element, seen, dt_s),
                None => {
                    let is_released = matches!(seen, Seen::Released(_) | Seen::Slips(_));
                    memory.follow_unheard(self.unheard_n_m(&shown, gears, at), is_released, dt_s);
                }
            }
            if memory.has_switched() {
                let full_n_m = self.unheard_n_m(&shown, gears, at);
                let full_n_m = memory.is_unheard().then(|| memory.begin_unheard(full_n_m));
                take_switch(&mut state.running, &state.estimate, (at, full_n_m));
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
        let is_read = self.are_read(&state.newest);
        let slipping = shift.filter(|_| phase == ShiftPhase::BothSlip && is_read).map(|shift| {
            let speeds = self.measured(&state.newest, None);
            let [from, to] = shift.clutches.each_ref().map(|clutch| clutch.ratio);
            // Towards the new gear, and against a torque that drives the turbine the other way.
            let way = (to - from) * speeds[OUTPUT];
            let slip = self.slip(from, speeds);
            let is_against = turbine_n_m.abs() > T::of(HELD_N_M) && turbine_n_m * way < T::zero();
            [slip.is_over(), slip.is_over() && slip.value * way > T::zero() && is_against]
        });
        let [slips, pulls] = slipping.unwrap_or([false; 2]);
        let holds = phase == ShiftPhase::OncomingHolds;
        let (is_released, is_pulled) = (phase == ShiftPhase::BothSlip || holds, pulls || holds);
        let moves = state.newest[OUTPUT].is_some_and(|output| output.value.abs() > self.uncertainty.output_least_rad_s);
        let is_settled = moves && is_read && !state.slips && since_s > T::of(SETTLES_S);
        let gear = gears.from.place().filter(|_| phase == ShiftPhase::InGear && gears.is_steady() && is_settled);
        let fills = gear.filter(|&gear| self.is_held_without_pressure(state, gear)).is_some_and(|gear| {
            let mut from = self.tables.shifts.iter().filter(|shift| shift.from == gear);
            from.any(|shift| {
                let found = self.element(&state.elements, shift.clutches[1].element);
                found.and_then(|(memory, element)| memory.asks(element)) == Some(true)
            })
        });
        Some(Shown { turbine_n_m, shift, is_released, slips, is_pulled, gear, fills })
    }

    /// Whether an element carries torque in a gear whose command asks for no pressure.
    fn is_held_without_pressure(&self, state: &GearboxState<T>, gear: usize) -> bool {
        let Some(row) = self.tables.gears.get(gear) else { return false };
        let of_elements = state.elements.iter().zip(self.tables.elements).zip(&row.holding);
        of_elements.into_iter().any(|((memory, element), holding)| {
            holding.abs() > T::of(CARRIES) && memory.as_ref().and_then(|memory| memory.asks(element)) == Some(false)
        })
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
            if oncoming && shown.is_pulled {
                return Seen::Closes;
            }
            return match (offgoing && shown.is_released, shown.slips) {
                (false, _) => Seen::Nothing,
                (true, true) => Seen::Slips(torque_n_m(shift.from)),
                (true, false) => Seen::Released(torque_n_m(shift.from)),
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
            // The log may say too late that a shift has begun.
            true if shown.fills => Seen::Nothing,
            true => Seen::Holds(torque_n_m),
            false if self.tables.shifts.iter().any(engages) => Seen::IsOpen,
            false => Seen::Nothing,
        }
    }
}

/// Begins the state of the pressure of an element of a shift anew where its command goes or comes back: it is then the torque over the standard
/// deviation of that, N m, or the error of the pressure.
fn take_switch<T: Real>(
    running: &mut Option<Running<T>>,
    estimate: &ShiftEstimate<T>,
    (at, full_n_m): (usize, Option<T>),
) {
    let Some(running) = running else { return };
    let Some(shift) = &running.shift else { return };
    let Some(c) = shift.clutches.iter().position(|clutch| clutch.element.place() == Some(at)) else { return };
    let torque_n_m = estimate.clutches.map_or(T::zero(), |clutches| clutches[c.min(1)].torque_n_m.abs());
    let mean = full_n_m.filter(|full_n_m| *full_n_m > T::zero()).map_or(T::zero(), |full_n_m| torque_n_m / full_n_m);
    running.x.renew(PRESSURE[c.min(1)], mean, T::one());
}
