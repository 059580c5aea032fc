//! Why a shift between two gears is neither simulated nor estimated.

use geartrain::Change;

use crate::Car;

impl Car {
    /// Why the shift between two gears is neither simulated nor estimated, with the elements that change.
    pub fn why_no_shift(&self, [from, to]: [usize; 2]) -> String {
        let gearbox = &self.gearbox;
        let Some(shift) = gearbox.shift(from, to) else {
            return "there is no such shift in the gearbox file".to_owned();
        };
        match &shift.change {
            Change::Several { offgoing, oncoming } => format!(
                "{} transition, {} off and {} on: a shift needs one clutch or brake off and one on",
                shift.change.name(),
                self.names(offgoing),
                self.names(oncoming)
            ),
            Change::Interrupted { offgoing, oncoming } => format!(
                "only dogs change, {} off and {} on: no clutch takes the load over from another",
                self.names(offgoing),
                self.names(oncoming)
            ),
            Change::Single { .. } if gearbox.is_same_ratio(from, to) => "both gears have one ratio".to_owned(),
            Change::Single { offgoing, oncoming, .. } if !shift.changes_dog_under_power(gearbox) => format!(
                "{} off and {} on: a dog goes in only in a downshift, and comes out only in an upshift",
                self.names(&[*offgoing]),
                self.names(&[*oncoming])
            ),
            Change::Single { offgoing, oncoming, .. } => {
                let both = [*offgoing, *oncoming];
                match both.into_iter().find(|&element| !self.can_change(element)) {
                    Some(element) => format!("{} has no plates (`pack`) in the gearbox file", gearbox.elements[element].name),
                    None if !both.iter().any(|&element| self.has_valve(element)) => {
                        format!("{} have no pressure: nothing can be commanded", self.names(&both))
                    }
                    None => "turbine and output speed do not determine the speeds of the other shafts, or no inertia is given".to_owned(),
                }
            }
            Change::Unknown => "no inertia of it is given (`shift_mass`)".to_owned(),
        }
    }

    /// Whether an element can open or close in a shift: with plates and valve, as a one-way clutch, or as a dog.
    fn can_change(&self, element: usize) -> bool {
        self.has_valve(element) || self.gearbox.is_one_way(element) || self.gearbox.is_dog(element)
    }

    fn has_valve(&self, element: usize) -> bool {
        self.clutches.get(element).is_some_and(Option::is_some)
    }

    fn names(&self, elements: &[usize]) -> String {
        let name = |element: &usize| self.gearbox.elements.get(*element).map_or("?", |element| element.name.as_str());
        elements.iter().map(name).collect::<Vec<_>>().join(" ")
    }
}
