//! Whether the elements that are engaged in both gears of a shift hold, for all errors within the budget.
//!
//! Only while they hold is the slip of the offgoing and of the oncoming clutch `alpha (w_t - i w_o)`. With `h` the torque of such an
//! element per turbine torque in a gear, and the torques of the clutches referred to the turbine,
//!
//! ```text
//! T_held = h_from U_off + h_to U_on,       U_off + U_on = L = T_t - M11 w_t' - M12 w_o'
//! |T_held| <= max(|h_from|, |h_to|) |L| + |h_to - h_from| min(|U_off|, |U_on|)
//! ```
//!
//! It holds where the upper bound of this torque is below the lower bound of its capacity. The inertia of shafts inside the gearbox is left out.
//! An element whose command was never read is taken to hold.
//!
//! A one-way clutch that is engaged in both gears holds while `L > 0`, and overruns where the lower bound of `L` is not.

use car::ShiftCommand;
use drivetrain::Real;

use super::turbine::Found;
use super::{GearboxFilter, GearboxState, OUTPUT, ShiftRow, TURBINE};

/// A bound of a uniform distribution over its standard deviation.
const BOUND: f64 = 1.732_050_807_568_877_2;
/// Standard deviations of the noise of the turbine torque that count as its bound.
const NOISE: f64 = 3.0;

impl<T: Real> GearboxFilter<'_, T> {
    /// Follows whether an element that is engaged in both gears may slip. Once it may, it may until the gear holds: a slip that has begun does
    /// not end as soon as the torque is small enough.
    pub(super) fn follow_held(&self, state: &mut GearboxState<T>, command: ShiftCommand, torque: Option<&Found<T>>) {
        let may_slip = match self.tables.commanded(command) {
            None => false,
            Some(_) if state.held_may_slip || state.slips => true,
            Some(shift) => self.held_may_overrun(state, shift, torque) || !self.all_hold(state, shift, torque),
        };
        state.held_may_slip = may_slip;
    }

    fn all_hold(&self, state: &GearboxState<T>, shift: &ShiftRow<T>, torque: Option<&Found<T>>) -> bool {
        let holding = |gear: usize| self.tables.gears.get(gear).map(|gear| &gear.holding);
        let (Some(from), Some(to)) = (holding(shift.from), holding(shift.to)) else { return true };
        let mut load = None;
        self.tables.elements.iter().zip(&state.elements).zip(from.iter().zip(to)).all(
            |((element, memory), (from, to))| {
                if *from == T::zero() || *to == T::zero() {
                    return true;
                }
                let Some(capacity_n_m) = memory.as_ref().and_then(|memory| memory.capacity_min_n_m(element)) else {
                    return true;
                };
                let [all_n_m, smaller_n_m] = *load.get_or_insert_with(|| self.loads(state, shift, torque));
                let torque_max_n_m = from.abs().at_least(to.abs()) * all_n_m + (*to - *from).abs() * smaller_n_m;
                torque_max_n_m <= capacity_n_m
            },
        )
    }

    /// Upper bounds of the torque of both clutches together, and of the smaller one of both, at the turbine, N m.
    fn loads(&self, state: &GearboxState<T>, shift: &ShiftRow<T>, torque: Option<&Found<T>>) -> [T; 2] {
        let inertia_n_m = Self::inertia_n_m(state, shift);
        let turbine_n_m = torque.map_or(T::zero(), |found| {
            found.turbine_n_m.abs() * (T::one() + T::of(BOUND) * found.fraction) + T::of(NOISE) * found.noise.sqrt()
        });
        let [off, on] = shift.clutches.each_ref().map(|clutch| {
            let ranges = self
                .element(&state.elements, clutch.element)
                .and_then(|(memory, element)| memory.ranges(element, None));
            // A dog holds against the other clutch as well; a one-way clutch never does, and has no part in the second term.
            let without = if clutch.element.is_dog() { T::infinity() } else { T::zero() };
            ranges.map_or(without, |(_, [_, torque_max_n_m])| clutch.alpha.abs() * torque_max_n_m)
        });
        [turbine_n_m + inertia_n_m.abs(), off.at_most(on)]
    }

    /// Whether a one-way clutch that is engaged in both gears may overrun.
    fn held_may_overrun(&self, state: &GearboxState<T>, shift: &ShiftRow<T>, torque: Option<&Found<T>>) -> bool {
        let is_held = shift.clutches.iter().any(|clutch| clutch.element.is_one_sided());
        let load_min_n_m = |found: &Found<T>| {
            let error_n_m = found.turbine_n_m.abs() * T::of(BOUND) * found.fraction + T::of(NOISE) * found.noise.sqrt();
            found.turbine_n_m - error_n_m - Self::inertia_n_m(state, shift)
        };
        is_held && torque.is_none_or(|found| load_min_n_m(found) <= T::zero())
    }

    /// Torque of the turbine's inertia by the newest readings, N m.
    fn inertia_n_m(state: &GearboxState<T>, shift: &ShiftRow<T>) -> T {
        let [turbine, output] = [&state.newest[TURBINE], &state.newest[OUTPUT]]
            .map(|newest| newest.and_then(|newest| newest.rate()).map_or(T::zero(), |(rate, _)| rate));
        let [by_turbine, by_output] = shift.mass_kg_m2[0];
        by_turbine * turbine + by_output * output
    }
}
