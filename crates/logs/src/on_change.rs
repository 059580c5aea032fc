//! Commands that are sent when they change.
//!
//! A controller may send a command when it changes, and a recorder may write only that: between two samples the command stands. By its
//! samples alone it could as well be lost, as one that is sampled at a rate and stops. A channel map says it by `sent_on_change`. Without a
//! map a log shows it: two samples that come soon after each other never have the same value, and for most of the time none comes,
//! more than once.

use car::{LOST_S, Reading};

/// Pauses that are needed, so that one loss of a channel is none, and samples soon after each other \[chosen\].
const PAUSES: u32 = 2;
const SOON: u32 = 3;
/// Fraction of the time in which no sample comes, from which on a command is sent on change \[chosen\]. One that is sampled at a rate and
/// lost for so long is no log of shifts.
const MOSTLY: f64 = 0.5;

/// A command on its way through a log, and whether it is sent on change.
#[derive(Debug, Clone, Copy, Default)]
pub struct OnChange {
    is_on_change: bool,
    /// How much earlier than its time stamp a sample was measured, s.
    delay_s: f64,
    newest: Option<f64>,
    /// Time without a sample up to now, s, and that of all pauses.
    silent_s: f64,
    paused_s: f64,
    all_s: f64,
    pauses: u32,
    soon: u32,
    again: u32,
}

impl OnChange {
    /// A command of which a channel map says that it is sent on change, with the delay of its samples, s.
    pub fn by_map(delay_s: f64) -> Self {
        Self { is_on_change: true, delay_s, ..Self::default() }
    }

    /// Looks at the next step of the log, `dt_s` after the one before, with a sample or without, before the first is used.
    pub fn look(&mut self, dt_s: f64, sample: Option<f64>) {
        // A hole in the recording says nothing of one channel.
        let dt_s = dt_s.clamp(0.0, LOST_S);
        self.all_s += dt_s;
        self.silent_s += dt_s;
        let Some(value) = sample.filter(|value| !value.is_nan()) else { return };
        if self.newest.is_some() && self.silent_s <= LOST_S {
            self.soon += 1;
            self.again += u32::from(self.newest == Some(value));
        }
        self.end_pause();
        self.newest = Some(value);
    }

    fn end_pause(&mut self) {
        if self.newest.is_some() && self.silent_s > LOST_S {
            self.pauses += 1;
            self.paused_s += self.silent_s;
        }
        self.silent_s = 0.0;
    }

    /// Ends the look: whether the log shows that the command is sent on change.
    pub fn is_shown(&mut self) -> bool {
        self.end_pause();
        let Self { pauses, paused_s, all_s, soon, again, .. } = *self;
        let is_shown = pauses >= PAUSES && soon >= SOON && again == 0 && paused_s > MOSTLY * all_s;
        let is_new = is_shown && !self.is_on_change;
        self.is_on_change |= is_shown;
        self.newest = None;
        is_new
    }

    /// Takes the reading of a step; where none came, a command that is sent on change stands.
    pub fn stand(&mut self, reading: &mut Option<Reading<f64>>) {
        match reading {
            Some(reading) => self.newest = Some(reading.value),
            None if self.is_on_change => {
                *reading = self.newest.map(|value| Reading { value, age_s: self.delay_s });
            }
            None => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether the samples of a command, by row at 100 Hz, show that it is sent on change.
    fn is_shown(rows: impl Iterator<Item = Option<f64>>) -> bool {
        let mut command = OnChange::default();
        rows.for_each(|sample| command.look(0.01, sample));
        command.is_shown()
    }

    /// A command that stands but for a ramp of a second.
    fn command(row: u32) -> f64 {
        f64::from(row.clamp(300, 400) - 300) * 0.01
    }

    fn on_change(row: u32) -> Option<f64> {
        (row == 0 || command(row) != command(row - 1)).then(|| command(row))
    }

    #[test]
    fn a_command_that_is_sent_on_change_is_shown_by_its_samples() {
        assert!(is_shown((0..900).map(on_change)));
        // With one sample in each second as well.
        assert!(is_shown((0..900).map(|row| if row % 100 == 0 { Some(command(row)) } else { on_change(row) })));
        // Sampled at a rate: every row, every second one, and lost once or in a shift.
        assert!(!is_shown((0..900).map(|row| Some(command(row)))));
        assert!(!is_shown((0..900).map(|row| (row % 2 == 0).then(|| command(row)))));
        assert!(!is_shown((0..900).map(|row| (row < 100).then(|| f64::from(row)))), "noise, then nothing");
        assert!(!is_shown((0..900).map(|row| (!(300..400).contains(&row)).then(|| f64::from(row)))));
        assert!(!is_shown((0..900).map(|row| (row % 50 == 0).then(|| f64::from(row)))), "sampled at 2 Hz");
        assert!(!is_shown(std::iter::empty()) && !is_shown((0..900).map(|_| None)));
    }

    #[test]
    fn a_command_that_is_sent_on_change_stands_until_the_next_one() {
        let reading = |value: f64| Some(Reading { value, age_s: 0.004 });
        let stands = |mut command: OnChange| {
            [None, reading(0.3), None, None, reading(0.5), None].map(|mut sample| {
                command.stand(&mut sample);
                sample.map(|reading| (reading.value, reading.age_s))
            })
        };
        let (first, next) = (Some((0.3, 0.004)), Some((0.5, 0.004)));
        let held = [None, first, Some((0.3, 0.02)), Some((0.3, 0.02)), next, Some((0.5, 0.02))];
        assert_eq!(stands(OnChange::by_map(0.02)), held);
        assert_eq!(stands(OnChange::default()), [None, first, None, None, next, None]);
    }

    #[test]
    fn what_was_looked_at_does_not_stand_before_the_first_sample() {
        let mut command = OnChange::default();
        (0..900).for_each(|row| command.look(0.01, on_change(row)));
        assert!(command.is_shown());
        let mut none = None;
        command.stand(&mut none);
        assert_eq!(none, None);
    }
}
