//! A quantity of the car that the shifts show beyond the bound of its error, in a sentence.

use car::{Car, Gear};
use observer::ShiftTables;
use observer::gearbox::{BeyondBounds, CarQuantity, Elements};

/// What the filter has found so far.
#[derive(Debug, Default)]
pub(crate) struct CarBeyondBounds {
    /// The time of the first row that says so, s, and what was found last.
    found: Option<(f64, BeyondBounds<f64>)>,
}

impl CarBeyondBounds {
    /// Takes what the filter finds at a time, s.
    pub(crate) fn push(&mut self, time_s: f64, found: Option<BeyondBounds<f64>>) {
        if let Some(found) = found {
            let since_s = self.found.map_or(time_s, |(since_s, _)| since_s);
            self.found = Some((since_s, found));
        }
    }

    /// What was found, in a sentence.
    pub(crate) fn warning(&self, car: &Car, tables: &ShiftTables<f64>) -> Option<String> {
        let (since_s, BeyondBounds { quantity, size, std_dev, bound }) = self.found?;
        let (name, cause) = words(quantity, car, tables);
        let (unit, per_unit) = match quantity {
            CarQuantity::KissPoint(_) => ("kPa", 1e-3),
            CarQuantity::Delay(_) => ("ms", 1e3),
            _ => ("%", 100.0),
        };
        let [size, std_dev, bound] = [size, std_dev, bound].map(|value| per_unit * value);
        let side = if size < 0.0 { "below" } else { "above" };
        let than =
            if matches!(quantity, CarQuantity::Delay(_)) { "the middle of its bounds" } else { "the vehicle file" };
        let about = about(size, std_dev, unit);
        Some(format!(
            "warning: by the shifts the car is outside its error budget, from {since_s:.1} s on: {name} is {about} {side} {than}, \
             and the budget allows {bound:.0} {unit}{cause}. The guaranteed ranges do not hold. `wetclutch fit` fits the file to the log; or widen the \
             error budget",
        ))
    }
}

/// The size of a difference with its standard deviation. A quantity that has nearly gone is beyond what the linear model measures.
fn about(size: f64, std_dev: f64, unit: &str) -> String {
    const NEARLY_GONE_PERCENT: f64 = -90.0;
    if unit == "%" && size < NEARLY_GONE_PERCENT {
        return format!("more than {:.0} %", -NEARLY_GONE_PERCENT);
    }
    format!("about {:.0} +-{std_dev:.0} {unit}", size.abs())
}

/// Name of a quantity, and what else may cause it.
fn words(quantity: CarQuantity, car: &Car, tables: &ShiftTables<f64>) -> (String, &'static str) {
    let elements = car.gearbox.elements.iter().enumerate();
    let of = |of: Elements| match of {
        Elements::All => "all elements".to_owned(),
        Elements::One(place) => {
            let mut elements = elements.clone().filter(|(at, _)| tables.place(*at) == Some(place));
            elements.next().map_or_else(String::new, |(_, element)| element.name.clone())
        }
    };
    let is_all = |of: Elements| of == Elements::All;
    match quantity {
        CarQuantity::TorqueFactor(one) => (
            format!("the torque of {} at the same pressure (friction times valve gain)", of(one)),
            if is_all(one) {
                "; another oil, or the scale of the commands or of the line pressure, has the same effect"
            } else {
                ""
            },
        ),
        CarQuantity::KissPoint(one) => (
            format!("the kiss point of {}", of(one)),
            if is_all(one) {
                "; an offset of all commands has the same effect"
            } else {
                "; an offset of its command has the same effect"
            },
        ),
        CarQuantity::Lag(one) => {
            (format!("the lag of the valve of {}", of(one)), "; late commands have the same effect")
        }
        CarQuantity::Delay(one) => {
            (format!("the delay of the valve of {}", of(one)), "; late commands have the same effect")
        }
        CarQuantity::Inertia(pair) => {
            let [low, high] = [pair, pair + 1].map(|place| car.gear_name(Gear::at(place)));
            (format!("the turbine-side inertia in the shifts between {low} and {high}"), "")
        }
        CarQuantity::Stiffness => ("the stiffness of the drive shafts".to_owned(), ""),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_more_than_a_hundred_per_cent_below() {
        assert_eq!(about(-117.0, 12.0, "%"), "more than 90 %");
        assert_eq!(about(-62.0, 9.0, "%"), "about 62 +-9 %");
        assert_eq!(about(110.0, 9.0, "%"), "about 110 +-9 %");
        assert_eq!(about(-117.0, 12.0, "kPa"), "about 117 +-12 kPa");
    }
}
