//! Commands that are recorded too rarely: a logger that repeats a slow message in each row, or that leaves the rows between empty.
//!
//! A repeated command may have changed up to one message before the row that shows it first, and the guaranteed range allows for one row alone.
//! Between two messages it may have changed and come back, and the range allows for no more than what lies between both.

use car::Car;
use drivetrain::Real;
use observer::Reading;
use observer::ShiftTables;
use observer::gearbox::MAX_ELEMENTS;

use super::check::{Check, CheckedRow};

/// Longest time between two changes that is one message, s \[chosen\]: what stands longer is a command that rests.
const LONGEST_S: f64 = 0.5;
/// Changes after repeated readings that are needed to judge, and the fraction of changes from one reading to the next that a message leaves
/// by chance \[chosen\].
const ENOUGH: u64 = 20;
const BY_CHANCE: f64 = 0.05;
/// Fewer changes, as those of a single shift, are enough if they all come in the period of one message, within one class of times, and if that
/// happens by chance with at most this probability \[chosen\]; so many are looked at.
const PERIOD_BY_CHANCE: f64 = 1e-3;
const FEW: usize = 64;
/// At least one in so many changes of a noise goes in the other direction than the one before \[chosen\].
const NOISE: usize = 3;
/// A change counts after repeated readings only if it is more than so many times the smallest one, or the resolution that the values show
/// \[chosen\]: a slow ramp stands still within the resolution of its reading.
const RESOLUTIONS: f64 = 3.0;
/// Rounding of a value, as a fraction of it.
const VALUE_ROUNDING: f64 = 1e-6;
/// Width of a class of times, s.
const CLASS_S: f64 = 0.01;
const CLASSES: usize = 51;
/// Longest time between two readings of a command that are not too rare, s \[chosen\]: a pulse that fills a clutch takes 0.1 to 0.2 s, and is
/// to be seen by two.
const APART_S: f64 = 0.05;
/// Fraction by which times of rows are rounded.
const ROUNDING: f64 = 1e-3;

/// When one command was read, and when it changed.
#[derive(Debug, Clone)]
pub struct CommandTimes {
    /// Rows, with a reading of the command or without.
    rows: u64,
    newest: Option<f64>,
    read_s: f64,
    changed_s: f64,
    /// Readings since the last change.
    repeated: u32,
    smallest: f64,
    /// Changes from one reading to the next, and those after repeated readings by the time since the change before.
    at_once: u64,
    later: [u64; CLASSES],
    /// The first changes, at once or not.
    few: Vec<Change>,
    /// Readings by the time since the one before.
    apart: [u64; CLASSES],
}

/// A change of a command.
#[derive(Debug, Clone, Copy)]
struct Change {
    size: f64,
    is_rise: bool,
    /// The larger of both values.
    of: f64,
    /// Time since the change before, s.
    since_s: f64,
}

/// The times of all commands of a log.
pub(crate) struct HeldCommands<'c> {
    car: &'c Car,
    tables: &'c ShiftTables<f64>,
    of_elements: [CommandTimes; MAX_ELEMENTS],
}

impl Default for CommandTimes {
    fn default() -> Self {
        Self {
            rows: 0,
            newest: None,
            read_s: f64::NEG_INFINITY,
            changed_s: f64::NEG_INFINITY,
            repeated: 0,
            smallest: f64::INFINITY,
            at_once: 0,
            later: [0; CLASSES],
            few: Vec::new(),
            apart: [0; CLASSES],
        }
    }
}

impl<'c> HeldCommands<'c> {
    pub(super) fn new(car: &'c Car, tables: &'c ShiftTables<f64>) -> Self {
        Self { car, tables, of_elements: std::array::from_fn(|_| CommandTimes::default()) }
    }
}

impl Check for HeldCommands<'_> {
    fn row(&mut self, row: &CheckedRow<'_>) {
        for (times, command) in self.of_elements.iter_mut().zip(&row.step.input.commands) {
            times.push(row.step.time_s, *command);
        }
    }

    fn warnings(&self) -> Vec<String> {
        let elements = self.car.gearbox.elements.iter().enumerate();
        let commands = elements.filter_map(|(element, described)| {
            Some((described.name.as_str(), &self.of_elements[self.tables.place(element)?]))
        });
        warnings_of(&commands.collect::<Vec<_>>())
    }
}

/// The commands that are repeated, and those that are read too rarely, in a sentence each; every command with the name of its clutch.
pub fn warnings_of(commands: &[(&str, &CommandTimes)]) -> Vec<String> {
    let named = |period_s: fn(&CommandTimes) -> Option<f64>| {
        let named =
            commands.iter().filter_map(|(name, times)| Some(format!("{name} (every {:.2} s)", period_s(times)?)));
        named.collect::<Vec<_>>().join(", ")
    };
    let held = named(CommandTimes::held_s);
    let held = (!held.is_empty()).then(|| {
        format!(
            "warning: commands that change more rarely than the rows come: {held}. If the log repeats a slow message, a command was sent up to that \
             long before the row that shows it, and the guaranteed ranges do not hold\nhint: leave repeated cells empty, or record the commands more often"
        )
    });
    let rare = named(CommandTimes::too_rarely_read_s);
    let rare = (!rare.is_empty()).then(|| {
        format!(
            "warning: commands that are recorded more rarely than every {APART_S} s: {rare}. A change between two readings, such as the \
             pulse that fills a clutch, is not known, and the guaranteed ranges do not hold\nhint: record the commands at the rate at which they are sent"
        )
    });
    held.into_iter().chain(rare).collect()
}

impl CommandTimes {
    /// Takes a row, with the reading of the command that came with it.
    pub fn push(&mut self, time_s: f64, reading: Option<Reading<f64>>) {
        self.rows += 1;
        if let Some(reading) = reading {
            self.read(time_s - reading.age_s, reading.value);
        }
    }

    fn read(&mut self, time_s: f64, value: f64) {
        let apart_s = time_s - core::mem::replace(&mut self.read_s, time_s);
        let Some(before) = self.newest.replace(value) else { return };
        self.apart[class(apart_s)] += 1;
        if before == value {
            self.repeated += 1;
            return;
        }
        let change = (value - before).abs();
        self.smallest = self.smallest.min(change);
        let since_s = time_s - self.changed_s;
        if self.few.len() < FEW {
            self.few.push(Change { size: change, is_rise: value > before, of: value.abs().max(before.abs()), since_s });
        }
        if self.repeated == 0 {
            self.at_once += 1;
        } else if since_s <= LONGEST_S && change > RESOLUTIONS * self.smallest {
            self.later[class(since_s)] += 1;
        }
        (self.changed_s, self.repeated) = (time_s, 0);
    }

    /// The usual time between two changes, s, if they come more rarely than the readings.
    fn held_s(&self) -> Option<f64> {
        let later: u64 = self.later.iter().sum();
        let are_many = later >= ENOUGH && self.at_once as f64 <= BY_CHANCE * later as f64;
        if are_many { Some(middle_s(&self.later)) } else { self.period_s() }
    }

    /// The time of which all times between two changes are multiples, s, where that is no chance.
    fn period_s(&self) -> Option<f64> {
        if self.at_once > 0 {
            return None;
        }
        let resolution = resolution(&self.few);
        // A slow ramp goes one way; noise turns.
        let turns = self.few.windows(2).filter(|pair| pair[0].is_rise != pair[1].is_rise).count();
        let is_noise = NOISE * turns >= self.few.len();
        let counts =
            |change: &&Change| change.since_s <= LONGEST_S && (is_noise || change.size > RESOLUTIONS * resolution);
        let classes: Vec<usize> = self.few.iter().filter(counts).map(|change| class(change.since_s)).collect();
        let period = *classes.iter().min()?;
        let beyond = |class: &usize| {
            let beyond = class % period.max(1);
            beyond.min(period - beyond)
        };
        // How far the times are from multiples, in classes: a message may come in the row before or after.
        let off = classes.iter().map(beyond).max().filter(|off| *off <= 1)?;
        let others = i32::try_from(classes.len() - 1).unwrap_or(i32::MAX);
        let by_chance = Real::powi(((1 + 2 * off) as f64 / period as f64).min(1.0), others);
        (by_chance <= PERIOD_BY_CHANCE).then_some(period as f64 * CLASS_S)
    }

    /// The usual time between two readings, s, if it is too long for the range of the pressure and rows come without a reading.
    fn too_rarely_read_s(&self) -> Option<f64> {
        let readings: u64 = self.apart.iter().sum();
        let is_known = readings >= ENOUGH && self.rows > 2 * readings;
        Some(middle_s(&self.apart)).filter(|period_s| is_known && *period_s > APART_S * (1.0 + ROUNDING))
    }
}

/// The largest step of which the values between these changes are multiples, as far as they are rounded.
fn resolution(changes: &[Change]) -> f64 {
    changes.iter().fold(0.0, |found, change| {
        let (mut larger, mut rest) = (found, change.size);
        while rest > VALUE_ROUNDING * change.of {
            let steps = larger / rest;
            (larger, rest) = (rest, (steps - steps.round()).abs() * rest);
        }
        larger
    })
}

/// The class of a time.
fn class(time_s: f64) -> usize {
    ((time_s / CLASS_S).round().max(0.0) as usize).min(CLASSES - 1)
}

/// The middle one of the times that are counted in classes, s.
fn middle_s(counts: &[u64; CLASSES]) -> f64 {
    let all: u64 = counts.iter().sum();
    let mut below = 0;
    let middle = counts.iter().position(|count| {
        below += count;
        2 * below >= all
    });
    middle.map_or(0.0, |class| class as f64 * CLASS_S)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ramps of 0.2 A/s up and down through a minute, sent so often and read every 10 ms with this resolution.
    fn period_s(sent_s: f64, resolution: f64) -> Option<f64> {
        let mut changes = CommandTimes::default();
        for row in 0..6000 {
            let time_s = 0.01 * f64::from(row);
            let at_s = (time_s / sent_s + 1e-6).floor() * sent_s;
            let command = 0.4 * (0.5 * at_s).rem_euclid(1.0);
            changes.read(time_s, (command / resolution).round() * resolution);
        }
        changes.held_s()
    }

    #[test]
    fn a_repeated_command_differs_from_one_that_rests_or_creeps() {
        for sent_s in [0.05, 0.1, 0.2, 0.4] {
            let found_s = period_s(sent_s, 0.001).unwrap();
            assert!((found_s - sent_s).abs() < 0.011, "{sent_s}: {found_s}");
        }
        assert_eq!(period_s(0.01, 0.001), None);
        // Within the resolution of its reading a ramp stands still for two rows.
        assert_eq!(period_s(0.01, 0.005), None);
    }

    #[test]
    fn the_few_changes_of_one_shift_are_enough_where_they_come_in_one_period() {
        // At rest, a pulse that fills the clutch, a ramp, and its end.
        let shift = |at_s: f64| match at_s {
            _ if at_s < 2.0 => 0.1,
            _ if at_s < 2.15 => 0.7,
            _ if at_s < 4.0 => 0.2 + 0.17 * (at_s - 2.15),
            _ => 1.0,
        };
        let period_s = |sent_s: f64, resolution: f64| {
            let mut changes = CommandTimes::default();
            for row in 0..800 {
                let time_s = 0.01 * f64::from(row);
                let at_s = (time_s / sent_s + 1e-6).floor() * sent_s;
                changes.read(time_s, (shift(at_s) / resolution).round() * resolution);
            }
            changes.held_s()
        };
        for sent_s in [0.05, 0.1, 0.2] {
            for resolution in [1e-3, 1e-5, 1e-9] {
                let found_s = period_s(sent_s, resolution);
                assert!(found_s.is_some_and(|found_s| (found_s - sent_s).abs() < 0.011), "{sent_s}: {found_s:?}");
            }
        }
        // Sent in each row; and a ramp within the resolution of its reading, which changes every 0.1 s.
        assert_eq!([1e-9, 1e-3, 0.015].map(|resolution| period_s(0.01, resolution)), [None; 3]);
        // A current that is measured at 10 Hz, with a noise of two steps of its resolution.
        let mut measured = CommandTimes::default();
        for row in 0..400_i32 {
            measured.read(0.01 * f64::from(row), 0.001 * f64::from((row / 10).pow(2) % 7 % 3));
        }
        assert_eq!(measured.held_s(), Some(0.1));
        let [warning] = <[String; 1]>::try_from(warnings_of(&[("C", &measured)])).unwrap();
        assert!(
            warning.starts_with("warning: commands that change more rarely than the rows come: C (every 0.10 s)"),
            "{warning}"
        );
        // Three steps, as of a valve that is switched.
        let mut steps = CommandTimes::default();
        for row in 0..800 {
            steps.read(0.01 * f64::from(row), [0.0, 0.8, 0.3, 1.0][usize::try_from(row / 20).unwrap().min(3)]);
        }
        assert_eq!(steps.held_s(), None);
    }

    #[test]
    fn a_command_that_is_read_too_rarely_is_one_whether_it_changes_or_not() {
        let read = |every: u32, rows: u32| {
            let mut times = CommandTimes::default();
            let reading = |row| Reading { value: f64::from(row / every % 7), age_s: 0.0 };
            (0..rows).for_each(|row| times.push(0.01 * f64::from(row), (row % every == 0).then(|| reading(row))));
            let said = warnings_of(&[("C", &times)]).join("\n");
            let is_said = said.contains("warning: commands that are recorded more rarely than every 0.05 s: C (every ");
            assert_eq!(is_said, times.too_rarely_read_s().is_some(), "{said}");
            times.too_rarely_read_s()
        };
        assert_eq!([1, 5].map(|every| read(every, 10_000)), [None; 2]);
        assert_eq!([6, 20].map(|every| read(every, 10_000)), [Some(0.06), Some(0.2)]);
        // Of a few readings nothing is said, nor of none.
        assert_eq!([0, 1, 400].map(|rows| read(20, rows)), [None; 3]);
    }

    #[test]
    fn a_command_that_never_changes_has_no_period() {
        let mut changes = CommandTimes::default();
        assert_eq!(changes.held_s(), None);
        (0..1000).for_each(|row| changes.read(0.01 * f64::from(row), 0.3));
        assert_eq!(changes.held_s(), None);
    }
}
