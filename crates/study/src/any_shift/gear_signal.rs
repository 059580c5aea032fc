//! The gears that a log names.

/// Values that a message names.
const NAMED: usize = 5;

/// Samples of a gear signal, and those of a gear that the gearbox does not have: after such a one the gear before stands.
pub(super) struct GearSignal {
    /// Its name.
    name: &'static str,
    samples: u64,
    unknown: u64,
    /// The first unknown values.
    values: Vec<String>,
}

impl GearSignal {
    pub(super) fn new(name: &'static str) -> Self {
        Self { name, samples: 0, unknown: 0, values: Vec::new() }
    }

    /// Takes a sample: the gear if the gearbox has it, and the value as the log has it.
    pub(super) fn take(&mut self, found: Option<usize>, value: impl FnOnce() -> String) -> Option<usize> {
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
    pub(super) fn note(&self, gears: &str) -> Result<Option<String>, String> {
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
