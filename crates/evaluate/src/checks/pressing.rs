//! Which elements press their plates by their commands, with all errors of their valves.

use car::{Car, ErrorBudget};
use observer::gearbox::MAX_ELEMENTS;
use observer::{ChannelHealth, ShiftTables};

use super::check::CheckedRow;

/// What the commands of a log ask of each element.
pub(super) struct Pressing {
    /// Element of the gearbox and place in the filter's tables.
    places: Vec<(usize, usize)>,
    /// Pressures by the valve model, Pa, below which an element presses by no means, and above which it does, by their place.
    limits_pa: Vec<[f64; 2]>,
    /// Whether a command of each has come.
    heard: [bool; MAX_ELEMENTS],
}

impl Pressing {
    pub(super) fn new(car: &Car, tables: &ShiftTables<f64>, budget: &ErrorBudget) -> Self {
        let places = (0..car.gearbox.elements.len()).filter_map(|element| Some((element, tables.place(element)?)));
        let places: Vec<(usize, usize)> = places.collect();
        let mut limits_pa = vec![[f64::NEG_INFINITY, f64::INFINITY]; places.len()];
        for &(element, place) in &places {
            let (Some(errors), Some(limits_pa)) = (budget.element(element), limits_pa.get_mut(place)) else { continue };
            let of_tables = &tables.tables().elements[place];
            let kiss_pa = of_tables.clutch.kiss_pressure();
            let by_command_pa = errors.by_command_pa(&of_tables.valve.valve, kiss_pa);
            let ([weakest, strongest], hysteresis_pa) = (errors.valve_gain_factor, errors.valve_hysteresis_pa);
            *limits_pa = [
                (kiss_pa - hysteresis_pa) / strongest - by_command_pa,
                (kiss_pa + hysteresis_pa) / weakest + by_command_pa,
            ];
        }
        Self { places, limits_pa, heard: [false; MAX_ELEMENTS] }
    }

    /// Takes the commands of a row.
    pub(super) fn push(&mut self, row: &CheckedRow<'_>) {
        for (heard, command) in self.heard.iter_mut().zip(&row.step.input.commands) {
            *heard |= command.is_some();
        }
    }

    /// The elements with their places.
    pub(super) fn places(&self) -> &[(usize, usize)] {
        &self.places
    }

    /// Whether the element at this place presses in a row; none where it may, or no command of it has come, or comes any more.
    pub(super) fn at(&self, place: usize, row: &CheckedRow<'_>) -> Option<bool> {
        if row.estimate.commands.get(place) == Some(&ChannelHealth::Lost) {
            return None;
        }
        let [opens_pa, presses_pa] = *self.limits_pa.get(place).filter(|_| self.heard[place])?;
        let valve_pa = row.estimate.valve_pa[place];
        if valve_pa < opens_pa { Some(false) } else { (valve_pa > presses_pa).then_some(true) }
    }

    /// Whether an element of the gearbox presses.
    pub(super) fn of(&self, element: usize, row: &CheckedRow<'_>) -> Option<bool> {
        let (_, place) = self.places.iter().find(|(of, _)| *of == element)?;
        self.at(*place, row)
    }
}
