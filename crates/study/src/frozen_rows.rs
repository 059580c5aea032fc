//! Frozen speeds of the rows of a table.

use logs::{FrozenSpeed, NO_SPEEDS, Role, Speeds};
use observer::Reading;

/// The speeds of a row, in the order of [`WATCHED`].
pub(crate) type SpeedReadings<'a> = [&'a mut Option<Reading<f64>>; WATCHED.len()];

/// The speeds of the rows, of which frozen ones are taken out by the rules of [`logs::frozen`].
pub(crate) struct FrozenRows {
    watched: [FrozenSpeed; WATCHED.len()],
    newest: Speeds,
    /// The time at which the newest reading of each was measured, s, and whether it is frozen.
    newest_s: [(f64, bool); WATCHED.len()],
    /// Readings of each, and how many of them were frozen.
    counts: [(u64, u64); WATCHED.len()],
}

const WATCHED: [Role; 4] = [Role::EngineSpeed, Role::TurbineSpeed, Role::OutputSpeed, Role::WheelSpeed];

/// Times that differ by less are those of one reading, s: decimals of a table.
const SAME_S: f64 = 1e-6;

impl FrozenRows {
    pub(crate) fn new() -> Self {
        Self {
            watched: WATCHED.map(FrozenSpeed::new),
            newest: NO_SPEEDS,
            newest_s: [(f64::NEG_INFINITY, false); WATCHED.len()],
            counts: [(0, 0); WATCHED.len()],
        }
    }

    /// Takes the readings out of a row that are frozen.
    pub(crate) fn take_out(&mut self, speeds: SpeedReadings<'_>, time_s: f64) {
        for (i, speed) in speeds.into_iter().enumerate() {
            let Some(Reading { value, age_s }) = *speed else { continue };
            let measured_s = time_s - age_s;
            let (newest_s, was_frozen) = self.newest_s[i];
            // A reading that a table holds until the next one comes is one reading.
            let is_held = age_s > 0.0 && (measured_s - newest_s).abs() <= SAME_S;
            let frozen = if is_held { was_frozen } else { self.watched[i].is_frozen(value, measured_s, &self.newest) };
            self.newest_s[i] = (measured_s, frozen);
            self.counts[i].0 += 1;
            if frozen {
                self.counts[i].1 += 1;
                *speed = None;
            } else {
                self.newest[WATCHED[i] as usize] = value;
            }
        }
    }

    /// What was met, in sentences.
    ///
    /// # Errors
    /// Most readings of a speed were frozen; holds what to say of it.
    pub(crate) fn notes(&self) -> Result<Vec<String>, String> {
        let mut notes = Vec::new();
        for (role, (readings, frozen)) in WATCHED.iter().zip(self.counts).filter(|(_, (_, frozen))| *frozen > 0) {
            let name = role.name();
            notes.push(format!(
                "{frozen} of {readings} readings of {name} stand still while the car does not, and are not used"
            ));
            if 2 * frozen > readings {
                return Err(format!("{}\nhint: check the sensor of {name} and its column", notes.join(", ")));
            }
        }
        Ok(notes)
    }
}
