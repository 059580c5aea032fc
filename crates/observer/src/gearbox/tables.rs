//! What the filter knows of a gearbox, made once at the start.
//!
//! With `U_c = alpha_c T_c`, the torque of an element referred to the turbine, every shift of every gear train is
//!
//! ```text
//! M11 w_t' + M12 w_o' =  T_t - U_off - U_on
//! M12 w_t' + M22 w_o' = -T_o + i_off U_off + i_on U_on          slip of element c = alpha_c (w_t - i_c w_o)
//! ```

use car::{Gear, ShiftCommand};
use drivetrain::{Clutch, Real, ReducedShift};

use super::ElementUncertainty;
use super::pistons::Piston;
use crate::{Budget, Reading, ValveModel};

/// Most clutches and brakes of a gearbox.
pub const MAX_ELEMENTS: usize = 8;

/// A clutch or brake with its valve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrictionElement<T> {
    /// Plates and piston.
    pub clutch: Clutch<T>,
    /// The valve as the filter knows it.
    pub valve: ValveModel<T>,
    /// What the valve can be commanded and can give.
    pub limits: ValveLimits<T>,
    /// Its piston, if that has a stroke; without one the pressure at the valve's outlet acts on the plates.
    pub piston: Option<Piston<T>>,
    /// Largest errors, for the guaranteed ranges; without it there are none.
    pub budget: Option<Budget<T>>,
    /// What the filter does not know of it.
    pub uncertainty: ElementUncertainty<T>,
}

/// Time from the request of a shift until the dog of its gear is in, s \[chosen\]: synchronisers take 0.1 to 0.2 s.
const DOG_S: f64 = 0.3;

/// What a valve can be commanded and can give.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ValveLimits<T> {
    /// Largest command, A or %; the smallest is zero.
    pub command_max: T,
    /// Maximum error of a reading of the command, A or %: a reading of no current may be below zero.
    pub command_error: T,
    /// Highest pressure, Pa; the lowest is zero.
    pub pressure_max_pa: T,
}

impl<T: Real> ValveLimits<T> {
    /// Whether the valve can have a command that is read as this, within its error.
    pub fn is_possible(&self, command: T) -> bool {
        // A comparison with NaN is false, so this refuses non-finite values too.
        (command - self.nearest(command)).abs() <= self.command_error
    }

    #[inline]
    fn nearest(&self, command: T) -> T {
        command.at_least(T::zero()).at_most(self.command_max)
    }

    /// A reading of the command as one that the valve can have; `None` if it is none within its error.
    #[inline]
    pub(super) fn usable(&self, reading: &Reading<T>) -> Option<Reading<T>> {
        let Reading { value, age_s } = *reading;
        (self.is_possible(value) && age_s >= T::zero() && age_s.is_finite())
            .then(|| Reading { value: self.nearest(value), age_s })
    }

    /// The nearest pressure that the valve can give, Pa.
    #[inline]
    pub(super) fn possible_pressure(&self, pressure_pa: T) -> T {
        pressure_pa.at_least(T::zero()).at_most(self.pressure_max_pa)
    }

    /// The same limits in another precision.
    pub fn cast<U: Real>(&self) -> ValveLimits<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        ValveLimits {
            command_max: to(self.command_max),
            command_error: to(self.command_error),
            pressure_max_pa: to(self.pressure_max_pa),
        }
    }
}

/// A gear.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GearRow<T> {
    /// Turbine speed over output speed; negative in reverse.
    pub ratio: T,
    /// Inertia of the gearbox in this gear, at its output, kg m^2.
    pub inertia_kg_m2: T,
    /// Torque of each element of [`GearboxTables::elements`] per turbine torque while the gear holds; zero of one that is not engaged.
    pub holding: [T; MAX_ELEMENTS],
}

/// Which element changes in a shift.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ShiftElement {
    /// A clutch or brake, by its place in [`GearboxTables::elements`].
    Friction(u8),
    /// The same where a one-way clutch holds its gear too, as a sprag behind it: it holds the turbine in one direction alone, and carries nothing
    /// while the one-way clutch overruns.
    OneSided(u8),
    /// A one-way clutch, which has no pressure and is in no table.
    OneWay,
    /// A dog, which has none either: it holds any torque in both directions while it is in.
    Dog,
    /// Of the gearbox the ratios alone are known.
    Unknown,
}

impl ShiftElement {
    /// The clutch or brake at this place; unknown from [`MAX_ELEMENTS`] on.
    pub const fn at(place: usize) -> Self {
        // The place is below 8.
        if place < MAX_ELEMENTS { Self::Friction(place as u8) } else { Self::Unknown }
    }

    /// The same of one that holds the turbine in one direction alone.
    pub const fn one_sided(place: usize) -> Self {
        match Self::at(place) {
            Self::Friction(place) => Self::OneSided(place),
            other => other,
        }
    }

    /// The place of a clutch or brake in [`GearboxTables::elements`].
    #[inline]
    pub const fn place(self) -> Option<usize> {
        match self {
            Self::Friction(place) | Self::OneSided(place) => Some(place as usize),
            Self::OneWay | Self::Dog | Self::Unknown => None,
        }
    }

    /// Whether it is a one-way clutch.
    #[inline]
    pub const fn is_one_way(self) -> bool {
        matches!(self, Self::OneWay)
    }

    /// Whether it is a dog.
    #[inline]
    pub const fn is_dog(self) -> bool {
        matches!(self, Self::Dog)
    }

    /// Whether pressure makes it hold: not that of a one-way clutch or a dog.
    #[inline]
    pub const fn has_pressure(self) -> bool {
        !matches!(self, Self::OneWay | Self::Dog)
    }

    /// Whether it is a clutch or brake whose gear a one-way clutch holds too.
    #[inline]
    pub const fn is_one_sided(self) -> bool {
        matches!(self, Self::OneSided(_))
    }
}

/// An element that changes in a shift.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ShiftClutch<T> {
    /// Which one it is.
    pub element: ShiftElement,
    /// Its slip per turbine speed, `alpha`: the turbine feels `alpha` times its torque.
    pub alpha: T,
    /// The ratio `i` of the gear in which it holds.
    pub ratio: T,
}

impl<T> ShiftClutch<T> {
    /// Whether it is a one-way clutch: it holds any torque in one direction, and carries none while it overruns.
    pub fn is_one_way(&self) -> bool {
        self.element.is_one_way()
    }

    /// Whether pressure makes it hold: not that of a one-way clutch or a dog.
    pub fn has_pressure(&self) -> bool {
        self.element.has_pressure()
    }

    /// Whether a one-way clutch holds its gear, itself or beside it: the turbine may turn slower than in the gear.
    pub fn may_overrun(&self) -> bool {
        self.element.is_one_way() || self.element.is_one_sided()
    }
}

/// A shift between two elements.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ShiftRow<T> {
    /// The gear before, by its place in [`GearboxTables::gears`].
    pub from: usize,
    /// The gear after.
    pub to: usize,
    /// The element that opens, then the one that closes.
    pub clutches: [ShiftClutch<T>; 2],
    /// Mass `M` in turbine and output speed, kg m^2.
    pub mass_kg_m2: [[T; 2]; 2],
    /// Slip of each element, in the order of [`GearboxTables::elements`], per turbine and output speed; zero of one that is held.
    pub slips: [[T; 2]; MAX_ELEMENTS],
    /// Whether a dog that is held has to be put in, which is not in the gear before: until it is, the shaft of the oncoming clutch
    /// turns at another ratio.
    pub has_dog: bool,
}

/// The tables of a gearbox.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GearboxTables<'a, T> {
    /// Its clutches and brakes, at most [`MAX_ELEMENTS`]; more are not used.
    pub elements: &'a [FrictionElement<T>],
    /// Its gears.
    pub gears: &'a [GearRow<T>],
    /// Its shifts between two elements.
    pub shifts: &'a [ShiftRow<T>],
}

impl<T: Real> ShiftRow<T> {
    /// The shift between two gears with these offgoing and oncoming elements, without dogs, and without the slips of all others.
    pub fn new(gears: [usize; 2], elements: [ShiftElement; 2], reduced: &ReducedShift<T>) -> Self {
        let clutch = |element, slip: [T; 2]| ShiftClutch { element, alpha: slip[0], ratio: -slip[1] / slip[0] };
        let [offgoing, oncoming] = [reduced.slip_offgoing, reduced.slip_oncoming];
        let mut slips = [[T::zero(); 2]; MAX_ELEMENTS];
        for (element, slip) in elements.iter().zip([offgoing, oncoming]) {
            if let Some(of) = element.place().and_then(|place| slips.get_mut(place)) {
                *of = slip;
            }
        }
        Self {
            from: gears[0],
            to: gears[1],
            clutches: [clutch(elements[0], offgoing), clutch(elements[1], oncoming)],
            mass_kg_m2: reduced.mass_kg_m2,
            slips,
            has_dog: false,
        }
    }

    /// As the controller commands it.
    #[inline]
    pub fn command(&self) -> ShiftCommand {
        ShiftCommand::between(self.from, self.to)
    }

    /// Whether the slip of its offgoing (0) or oncoming clutch (1) is that of the speeds, so long after the request.
    pub(super) fn is_tied(&self, clutch: usize, since_s: T) -> bool {
        clutch == 0 || !self.has_dog || since_s >= T::of(DOG_S)
    }

    /// Inertia at the output while both speeds are tied by a ratio, kg m^2.
    pub fn inertia_at(&self, ratio: T) -> T {
        let m = &self.mass_kg_m2;
        m[1][1] + ratio * (m[0][1] + m[1][0]) + ratio * ratio * m[0][0]
    }

    /// The same in another precision.
    pub fn cast<U: Real>(&self) -> ShiftRow<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        ShiftRow {
            from: self.from,
            to: self.to,
            clutches: self.clutches.map(|clutch| ShiftClutch {
                element: clutch.element,
                alpha: to(clutch.alpha),
                ratio: to(clutch.ratio),
            }),
            mass_kg_m2: self.mass_kg_m2.map(|row| row.map(to)),
            slips: self.slips.map(|slip| slip.map(to)),
            has_dog: self.has_dog,
        }
    }
}

impl<T: Real> GearRow<T> {
    /// The same in another precision.
    pub fn cast<U: Real>(&self) -> GearRow<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        GearRow { ratio: to(self.ratio), inertia_kg_m2: to(self.inertia_kg_m2), holding: self.holding.map(to) }
    }
}

impl<T: Real> FrictionElement<T> {
    /// The most that it holds, N m.
    pub(super) fn most_n_m(&self) -> T {
        self.clutch.static_capacity(self.limits.pressure_max_pa)
    }

    /// The same in another precision.
    pub fn cast<U: Real>(&self) -> FrictionElement<U> {
        FrictionElement {
            clutch: self.clutch.cast(),
            valve: self.valve.cast(),
            limits: self.limits.cast(),
            piston: self.piston.as_ref().map(Piston::cast),
            budget: self.budget.as_ref().map(Budget::cast),
            uncertainty: self.uncertainty.cast(),
        }
    }
}

impl<'a, T: Real> GearboxTables<'a, T> {
    /// A gear; `None` in neutral, and of a gear that is not in the tables.
    #[inline]
    pub fn gear(&self, gear: Gear) -> Option<&'a GearRow<T>> {
        self.gears.get(gear.place()?)
    }

    /// A clutch or brake that changes in a shift; `None` of an element that is not in the tables.
    #[inline]
    pub fn element(&self, of: ShiftElement) -> Option<&'a FrictionElement<T>> {
        self.elements.get(of.place()?)
    }

    /// The place of two neighbouring gears among the pairs of gears: up or down, the same elements hold, and so the inertia
    /// is the same. `None` for a shift that skips a gear.
    pub fn pair(&self, from: usize, to: usize) -> Option<usize> {
        (from.abs_diff(to) == 1).then_some(from.min(to))
    }

    /// Torque on the turbine and on the output side by the drag of all plates that slip or are open in a shift, at these speeds of both, N m.
    pub(super) fn drag_n_m(&self, shift: &ShiftRow<T>, [turbine, output]: [T; 2]) -> [T; 2] {
        let mut sum = [T::zero(); 2];
        for (slip, element) in shift.slips.iter().zip(self.elements) {
            let drag = element.drag_n_m(slip[0] * turbine + slip[1] * output);
            for (sum, per) in sum.iter_mut().zip(slip) {
                *sum = *sum - *per * drag;
            }
        }
        sum
    }

    /// A shift out of a gear: in the gear its balance of the turbine holds with the offgoing clutch alone.
    pub(super) fn out_of(&self, gear: Gear) -> Option<&ShiftRow<T>> {
        let gear = gear.place()?;
        self.shifts.iter().find(|shift| shift.from == gear)
    }

    /// Mass of turbine and output speed in a gear or in a shift, kg m^2.
    pub(super) fn mass(&self, command: ShiftCommand) -> Option<&[[T; 2]; 2]> {
        let [from, to] = [command.from.place()?, command.to.place()?];
        let of_shift = |row: &&ShiftRow<T>| row.from == from && row.to == to;
        let row = if command.is_steady() { self.out_of(command.from) } else { self.shifts.iter().find(of_shift) };
        row.map(|row| &row.mass_kg_m2)
    }

    /// Whether a one-way clutch holds a gear.
    pub(super) fn is_one_way(&self, gear: Gear) -> bool {
        let holds = |gear| {
            self.shifts.iter().any(|row| {
                let [off, on] = &row.clutches;
                (row.from == gear && off.may_overrun()) || (row.to == gear && on.may_overrun())
            })
        };
        gear.place().is_some_and(holds)
    }

    /// The shift between two gears, if it is one between two known elements.
    pub fn shift(&self, from: usize, to: usize) -> Option<&ShiftRow<T>> {
        let elements = self.elements.len().min(MAX_ELEMENTS);
        let is_known = |clutch: &ShiftClutch<T>| {
            !clutch.has_pressure() || clutch.element.place().is_some_and(|place| place < elements)
        };
        let known = |row: &&ShiftRow<T>| row.from == from && row.to == to && row.clutches.iter().all(is_known);
        self.shifts.iter().find(known)
    }

    /// The shift that is commanded, if it is one between two known elements; `None` in a gear.
    #[inline(never)]
    pub fn commanded(&self, command: ShiftCommand) -> Option<&ShiftRow<T>> {
        if command.is_steady() {
            return None;
        }
        self.shift(command.from.place()?, command.to.place()?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_element_has_a_place_if_the_tables_can_have_it() {
        assert_eq!(ShiftElement::at(MAX_ELEMENTS - 1).place(), Some(MAX_ELEMENTS - 1));
        assert_eq!([MAX_ELEMENTS, 256, usize::MAX].map(ShiftElement::at), [ShiftElement::Unknown; 3]);
        let others = [ShiftElement::OneWay, ShiftElement::Dog, ShiftElement::Unknown];
        assert_eq!(others.map(ShiftElement::place), [None; 3]);
        assert_eq!(others.map(ShiftElement::has_pressure), [false, false, true]);
        assert_eq!([3, MAX_ELEMENTS].map(|place| ShiftElement::one_sided(place).place()), [Some(3), None]);
        // As small as the number of a place: the tables have two for each shift.
        assert!(size_of::<ShiftClutch<f32>>() <= 12);
    }
}
