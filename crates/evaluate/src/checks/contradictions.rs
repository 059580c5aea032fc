//! Commands of a log that contradict the gear: channels that stand in each other's place.
//!
//! In a gear that the speeds confirm, each clutch and brake that holds it presses its plates. A command below the kiss point of such an
//! element, with all errors of the valve in its favour, can hold nothing: then the channel is another signal. Which one, an element tells
//! that is open in that gear and whose command presses.

use car::ErrorBudget;
use car::{Car, Gear};
use observer::gearbox::MAX_ELEMENTS;
use observer::{ChannelHealth, ShiftTables};

use super::check::{Check, CheckedRow};
use super::pressing::Pressing;

/// A gear is steady after so long, s \[chosen\]: the clutches have been filled, and the shift controller is done.
const STEADY_S: f64 = 1.0;
/// The turbine fits the gear within this fraction \[chosen\]: readings that are 20 ms apart differ by 1 % while the car accelerates.
const FITS: f64 = 0.02;
/// Output speed below which an element may be left open, as in idle, rad/s.
const OUTPUT_MIN_RAD_S: f64 = 20.0;
/// Time without a reading at the end of a log after which a command has ended, s \[chosen\].
const ENDED_S: f64 = 5.0;
/// Rows in a gear that are needed to judge \[chosen\]: a second at 100 Hz. More than half of them have to contradict.
const ENOUGH: u64 = 100;

/// What the commands of a log say of each gear.
pub(crate) struct CommandCheck<'c> {
    car: &'c Car,
    pressing: Pressing,
    gear: Option<Gear>,
    since_s: f64,
    of_gears: Vec<OfGear>,
    /// The readings of each command, by its place.
    readings: [Readings; MAX_ELEMENTS],
}

/// The readings of a command: how many were used, when the last one was, s, and for how long there has been none, s.
#[derive(Debug, Clone, Copy, Default)]
struct Readings {
    count: u64,
    last_s: f64,
    without_s: f64,
}

/// Rows of a steady gear.
#[derive(Clone, Default)]
struct OfGear {
    rows: u64,
    /// Rows in which the element of each place does not press, and in which it does.
    opens: [u64; MAX_ELEMENTS],
    presses: [u64; MAX_ELEMENTS],
}

impl<'c> CommandCheck<'c> {
    pub(crate) fn new(car: &'c Car, tables: &ShiftTables<f64>, budget: &ErrorBudget) -> Self {
        let of_gears = vec![OfGear::default(); car.gearbox.gears.len()];
        Self {
            car,
            pressing: Pressing::new(car, tables, budget),
            gear: None,
            since_s: f64::NAN,
            of_gears,
            readings: Default::default(),
        }
    }

    /// A command that has no reading any more, in a sentence.
    fn ended(&self, element: usize, place: usize) -> Option<String> {
        let Readings { count, last_s, without_s } = *self.readings.get(place)?;
        let name = &self.car.gearbox.elements[element].name;
        (count >= ENOUGH && without_s >= ENDED_S).then(|| {
            format!(
                "warning: the command of {name} has no usable reading from {last_s:.1} s to the end of the log\nhint: check its channel; the torque of {name} is by \
                 the speeds alone then"
            )
        })
    }

    /// The gear in which the most rows contradict the command of this element, in a sentence.
    fn warning(&self, element: usize, place: usize) -> Option<String> {
        let holds = |gear: usize, element: usize| {
            self.car.gearbox.gears[gear].holding.iter().any(|holding| holding.element == element)
        };
        let contradicts = |gear: &usize| {
            let OfGear { rows, opens, .. } = &self.of_gears[*gear];
            *rows >= ENOUGH && 2 * opens[place] > *rows && holds(*gear, element)
        };
        let gears = (0..self.of_gears.len()).filter(contradicts);
        let gear = gears.max_by_key(|gear| self.of_gears[*gear].opens[place])?;
        let OfGear { rows, opens, presses } = &self.of_gears[gear];
        let name = |element: usize| self.car.gearbox.elements[element].name.as_str();
        let others =
            self.pressing.places().iter().filter(|(other, at)| !holds(gear, *other) && 2 * presses[*at] > *rows);
        let others: Vec<&str> = others.map(|(other, _)| name(*other)).collect();
        let what = match others.as_slice() {
            [] => "; its channel may be another signal, or its valve may work the other way round".to_owned(),
            others => {
                let others = others.join(", ");
                format!(
                    ", while that of {others}, open in this gear, is above: the channels of {} and {others} may be swapped",
                    name(element)
                )
            }
        };
        Some(format!(
            "warning: in gear {} the turbine follows the ratio of the gear, which {} holds, but the command of {1} is below its kiss point in {} of \
             {rows} samples{what}",
            self.car.gearbox.gears[gear].name,
            name(element),
            opens[place],
        ))
    }
}

impl Check for CommandCheck<'_> {
    fn row(&mut self, row: &CheckedRow<'_>) {
        let time_s = row.step.time_s;
        let gear = Some(row.step.input.gear).filter(|gear| gear.is_steady()).map(|gear| gear.from);
        self.pressing.push(row);
        for (readings, health) in self.readings.iter_mut().zip(&row.estimate.commands) {
            match health {
                ChannelHealth::Good => {
                    *readings = Readings { count: readings.count + 1, last_s: time_s, without_s: 0.0 };
                }
                ChannelHealth::Lost => readings.without_s += row.step.input.dt_s.clamp(0.0, 1.0),
                _ => {}
            }
        }
        let [_, turbine, output] = row.came_rad_s;
        let ratio = gear.and_then(|gear| self.car.ratio(gear)).unwrap_or(f64::NAN);
        let in_gear = ratio * output;
        let fits = output > OUTPUT_MIN_RAD_S && (turbine - in_gear).abs() <= FITS * in_gear.abs();
        if gear != self.gear || !fits {
            (self.gear, self.since_s) = (gear, time_s);
        }
        let is_steady = fits && time_s - self.since_s >= STEADY_S;
        let place = gear.and_then(Gear::place).filter(|_| is_steady);
        let Some(of_gear) = place.and_then(|place| self.of_gears.get_mut(place)) else { return };
        of_gear.rows += 1;
        for &(_, place) in self.pressing.places() {
            let presses = self.pressing.at(place, row);
            of_gear.opens[place] += u64::from(presses == Some(false));
            of_gear.presses[place] += u64::from(presses == Some(true));
        }
    }

    fn warnings(&self) -> Vec<String> {
        let places = self.pressing.places().iter();
        places
            .filter_map(|&(element, place)| self.ended(element, place).or_else(|| self.warning(element, place)))
            .collect()
    }
}
