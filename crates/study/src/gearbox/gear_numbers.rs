//! Numbers of gears: 1 is the first forward gear, 0 none, -1 reverse, -2 a second reverse gear.

use car::{Car, Gear};

/// The gears of a car by their numbers.
#[derive(Debug, Clone)]
pub struct GearNumbers {
    forward: Vec<usize>,
    reverse: Vec<usize>,
}

impl GearNumbers {
    /// Those of a car.
    pub fn of(car: &Car) -> Self {
        let gears = car.gearbox.gears.iter().enumerate();
        let reverse = gears.filter(|(_, gear)| gear.ratio < 0.0).map(|(at, _)| at).collect();
        Self { forward: car.gearbox.forward_gears(), reverse }
    }

    /// The number of a gear.
    pub fn number(&self, gear: Gear) -> f64 {
        let place =
            |gears: &[usize]| gears.iter().position(|&known| Gear::at(known) == gear).map(|place| place as f64 + 1.0);
        place(&self.forward).or_else(|| place(&self.reverse).map(|place| -place)).unwrap_or(0.0)
    }

    /// The number of the highest forward gear.
    pub(super) fn highest(&self) -> usize {
        self.forward.len()
    }

    /// The gear with a number; none where the gearbox has no such gear. A negative number that no gear has is the first reverse gear.
    pub(super) fn gear(&self, number: f64) -> Option<Gear> {
        let whole = number.round();
        match whole {
            _ if !number.is_finite() || (number - whole).abs() > 0.01 => None,
            0.0 => Some(Gear::Neutral),
            _ if whole < 0.0 => {
                let named = self.reverse.get((-whole) as usize - 1);
                named.or_else(|| self.reverse.first()).copied().map(Gear::at)
            }
            _ => self.forward.get(whole as usize - 1).copied().map(Gear::at),
        }
    }
}

#[cfg(test)]
mod tests {
    use config::CarFile;

    use super::*;

    #[test]
    fn the_number_of_a_gear_gives_the_gear() {
        let car = CarFile::eight_speed().unwrap().car;
        let numbers = GearNumbers::of(&car);
        assert_eq!(numbers.gear(0.0), Some(Gear::Neutral));
        for gear in car.gearbox.forward_gears().into_iter().map(Gear::at) {
            assert_eq!(numbers.gear(numbers.number(gear)), Some(gear), "{}", car.gear_name(gear));
        }
        assert!(numbers.gear(-1.0).is_some_and(|gear| numbers.number(gear) == -1.0));
    }

    #[test]
    fn what_is_no_number_of_a_gear_gives_none() {
        let numbers = GearNumbers::of(&CarFile::eight_speed().unwrap().car);
        for number in [1.5, 9.0, 1e300, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(numbers.gear(number), None, "{number}");
        }
        assert_eq!(numbers.gear(-7.0), numbers.gear(-1.0));
    }
}
