//! The gears that a log names.

use observer::any_shift::GearCommand;
use plant::car::NO_GEAR;

/// Values that a message names.
const NAMED: usize = 5;

/// Samples of a gear signal, and those of a gear that the gearbox does not have: after such a one the gear before stands.
struct GearSignal {
    /// Its name.
    name: &'static str,
    samples: u64,
    unknown: u64,
    /// The first unknown values.
    values: Vec<String>,
}

impl GearSignal {
    fn new(name: &'static str) -> Self {
        Self { name, samples: 0, unknown: 0, values: Vec::new() }
    }

    /// Takes a sample: the gear if the gearbox has it, and the value as the log has it.
    fn take(&mut self, found: Option<usize>, value: impl FnOnce() -> String) -> Option<usize> {
        self.samples += 1;
        if found.is_none() {
            self.unknown += 1;
            if self.values.len() < NAMED {
                let value = value();
                if !self.values.contains(&value) {
                    self.values.push(value);
                }
            }
        }
        found
    }

    /// What was met, in a sentence.
    ///
    /// # Errors
    /// Most samples are unknown; holds what to say of it, with `gears` as a hint.
    fn note(&self, gears: &str) -> Result<Option<String>, String> {
        let Self { name, samples, unknown, values } = self;
        if *unknown == 0 {
            return Ok(None);
        }
        let met = format!(
            "{unknown} of {samples} samples of {name} are no gear of this gearbox ({}) and are not used",
            values.join(", ")
        );
        if 2 * unknown > *samples {
            return Err(format!("{met}\nhint: {gears}"));
        }
        Ok(Some(format!(
            "{met}: the gear before stands\nhint: if these values stand for no gear, leave them out with `valid_range` of `channel.{name}` in a \
             channel map"
        )))
    }
}

/// What a log says of gear and target gear, up to a row.
pub(super) struct Gears {
    /// Of `gear` and `target_gear`.
    signals: [GearSignal; 2],
    /// The newest gear and target gear that the gearbox has.
    newest: [Option<usize>; 2],
}

impl Gears {
    pub(super) fn new(names: [&'static str; 2]) -> Self {
        Self { signals: names.map(GearSignal::new), newest: [None; 2] }
    }

    /// Takes a sample of `gear` (0) or `target_gear` (1): the gear if the gearbox has it, and the value as the log has it.
    pub(super) fn take(&mut self, which: usize, found: Option<usize>, value: impl FnOnce() -> String) {
        self.newest[which] = self.signals[which].take(found, value).or(self.newest[which]);
    }

    /// Whether `gear` has had no sample.
    pub(super) fn is_without_gear(&self) -> bool {
        self.signals[0].samples == 0
    }

    /// Gear and target gear by the newest samples. Before the first gear there is none, before the first target gear it is the gear.
    pub(super) fn command(&self) -> GearCommand {
        let [gear, target] = self.newest;
        gear.map_or(GearCommand { from: NO_GEAR, to: NO_GEAR }, |from| GearCommand { from, to: target.unwrap_or(from) })
    }

    /// What was met in both signals, in sentences.
    ///
    /// # Errors
    /// Most samples of one are unknown; holds what to say of it, with `gears` as a hint.
    pub(super) fn notes(&self, gears: &str) -> Result<Vec<String>, String> {
        let notes = self.signals.iter().map(|signal| signal.note(gears));
        Ok(notes.collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_gears_are_counted_with_their_first_values() {
        let mut signal = GearSignal::new("gear");
        for value in [1, 1, 1, 1, 255, 1, 255] {
            let found = signal.take(Some(0).filter(|_| value == 1), || value.to_string());
            assert_eq!(found.is_some(), value == 1);
        }
        let note = signal.note("").unwrap().unwrap();
        assert!(
            note.starts_with("2 of 7 samples of gear are no gear of this gearbox (255) and are not used"),
            "{note}"
        );
        for value in 20..40 {
            signal.take(None, || value.to_string());
        }
        let error = signal.note("use others").unwrap_err();
        assert!(error.contains("22 of 27") && error.contains("(255, 20, 21, 22, 23)"), "{error}");
        assert!(error.ends_with("hint: use others"), "{error}");
        assert_eq!(GearSignal::new("gear").note(""), Ok(None));
    }
}
