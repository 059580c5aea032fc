//! What came from the car since the step before.

use core::ops::{Index, IndexMut};

use drivetrain::Real;

use crate::{ElementId, Gear, GearId, MAX_ELEMENTS, Reading, ShiftId};

/// What came since the step before: of each channel the newest reading, or none. Channels may come at any rate, in any
/// phase and in any order.
///
/// A simulated car and a measured log give the same steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step<T = f64> {
    /// Time since the step before, s. Ignored in the first step.
    pub dt_s: T,
    /// Speeds, rad/s.
    pub speeds: Speeds<Option<Reading<T>>>,
    /// Commands of the valves.
    pub commands: Commands<T>,
    /// The gear or the shift that the gearbox controller commands; `None` where no channel gives it.
    pub shift: Option<ShiftCommand>,
    /// Whether the lock-up clutch of the converter carries torque.
    pub lock_up_applied: bool,
    /// Torque of the engine as its controller reports it, N m: that of combustion less its friction, before the inertia.
    pub engine_torque_n_m: Option<Reading<T>>,
    /// Longitudinal acceleration of the car by an accelerometer, m/s^2, positive forward: with the part of gravity along the road.
    pub acceleration_m_s2: Option<Reading<T>>,
}

/// One value for each of the four speeds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Speeds<V> {
    /// Of the engine, `w_e`.
    pub engine: V,
    /// Of the turbine, `w_t`: of the gearbox input where there is no converter.
    pub turbine: V,
    /// Of the gearbox output, `w_0`.
    pub output: V,
    /// Of the driven wheels, `w_w`.
    pub wheel: V,
}

/// The newest command of the valve of each element: current in A, or duty cycle in %. By [`ElementId`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Commands<T = f64>([Option<Reading<T>>; MAX_ELEMENTS]);

/// The gear, or the shift, that the gearbox controller commands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ShiftCommand {
    /// The gear before.
    pub from: Gear,
    /// The gear after; that before while there is no shift.
    pub to: Gear,
}

impl<T: Real> Step<T> {
    /// A step of this time, s, in which nothing came.
    pub const fn none(dt_s: T) -> Self {
        Self {
            dt_s,
            speeds: Speeds { engine: None, turbine: None, output: None, wheel: None },
            commands: Commands::NONE,
            shift: None,
            lock_up_applied: false,
            engine_torque_n_m: None,
            acceleration_m_s2: None,
        }
    }

    /// The same step in another precision.
    pub fn cast<U: Real>(&self) -> Step<U> {
        let to = |reading: Option<Reading<T>>| reading.map(|reading| reading.cast());
        Step {
            dt_s: U::of(self.dt_s.to_f64_exact()),
            speeds: self.speeds.map(to),
            commands: Commands(self.commands.0.map(to)),
            shift: self.shift,
            lock_up_applied: self.lock_up_applied,
            engine_torque_n_m: to(self.engine_torque_n_m),
            acceleration_m_s2: to(self.acceleration_m_s2),
        }
    }
}

impl<V> Speeds<V> {
    /// The same of each speed.
    pub fn map<U>(self, mut to: impl FnMut(V) -> U) -> Speeds<U> {
        let Self { engine, turbine, output, wheel } = self;
        Speeds { engine: to(engine), turbine: to(turbine), output: to(output), wheel: to(wheel) }
    }
}

impl<T> Commands<T> {
    /// No command.
    pub const NONE: Self = Self([const { None }; MAX_ELEMENTS]);

    /// The elements whose command came, with it.
    pub fn given(&self) -> impl Iterator<Item = (ElementId, &Reading<T>)> {
        self.0.iter().enumerate().filter_map(|(place, command)| Some((ElementId::new(place)?, command.as_ref()?)))
    }
}

impl<T> Default for Commands<T> {
    fn default() -> Self {
        Self::NONE
    }
}

impl<T> Index<ElementId> for Commands<T> {
    type Output = Option<Reading<T>>;

    #[inline]
    fn index(&self, element: ElementId) -> &Self::Output {
        // An element has a place below `MAX_ELEMENTS`, which the mask shows to the compiler: it is a power of two.
        &self.0[element.place() % MAX_ELEMENTS]
    }
}

impl<T> IndexMut<ElementId> for Commands<T> {
    #[inline]
    fn index_mut(&mut self, element: ElementId) -> &mut Self::Output {
        &mut self.0[element.place() % MAX_ELEMENTS]
    }
}

impl ShiftCommand {
    /// Neutral, and no shift.
    pub const NEUTRAL: Self = Self { from: Gear::Neutral, to: Gear::Neutral };

    /// A gear, and no shift.
    pub const fn in_gear(gear: GearId) -> Self {
        Self { from: Gear::In(gear), to: Gear::In(gear) }
    }

    /// From one gear to another, each by its place among the gears of the gearbox.
    pub const fn between(from: usize, to: usize) -> Self {
        Self { from: Gear::at(from), to: Gear::at(to) }
    }

    /// Whether a gear or neutral is commanded, and no shift.
    #[inline]
    pub fn is_steady(self) -> bool {
        self.from == self.to
    }

    /// The shift between two gears; `None` while there is no shift, and from or to neutral.
    pub fn shift(self) -> Option<ShiftId> {
        let (from, to) = (self.from.id()?, self.to.id()?);
        (from != to).then_some(ShiftId { from, to })
    }
}

impl From<[usize; 2]> for ShiftCommand {
    /// From one gear to another, each by its place among the gears of the gearbox.
    fn from([from, to]: [usize; 2]) -> Self {
        Self::between(from, to)
    }
}

impl From<ShiftId> for ShiftCommand {
    fn from(ShiftId { from, to }: ShiftId) -> Self {
        Self { from: Gear::In(from), to: Gear::In(to) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_of_an_element_is_found_by_its_id() {
        let element = ElementId::new(3).unwrap();
        let mut step = Step::none(0.01);
        step.commands[element] = Some(Reading::now(0.5));
        let given: Vec<_> = step.commands.given().collect();
        assert_eq!(given, [(element, &Reading::now(0.5))]);
        assert_eq!(step.cast::<f32>().commands[element], Some(Reading::now(0.5)));
    }

    #[test]
    fn a_shift_is_between_two_gears() {
        let [first, second] = [0, 1].map(|place| GearId::new(place).unwrap());
        let up = ShiftId { from: first, to: second };
        assert_eq!(ShiftCommand::from(up).shift(), Some(up));
        assert_eq!(ShiftCommand::in_gear(first).shift(), None);
        assert_eq!(ShiftCommand { from: Gear::Neutral, to: Gear::In(first) }.shift(), None);
        assert_eq!(ShiftCommand::NEUTRAL.shift(), None);
    }
}
