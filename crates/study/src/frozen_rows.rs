//! Frozen speeds of the rows of a table, and those that it holds.

use logs::{FrozenSpeed, HeldSpeed, NO_SPEEDS, Role, Speeds};
use observer::Reading;

/// The speeds of a row, in the order of [`WATCHED`].
pub(crate) type SpeedReadings<'a> = [&'a mut Option<Reading<f64>>; WATCHED.len()];

/// The speeds of the rows, of which frozen ones are taken out by the rules of [`logs::frozen`], and held ones by those of [`logs::held`].
pub(crate) struct FrozenRows {
    watched: [(FrozenSpeed, HeldSpeed); WATCHED.len()],
    newest: Speeds,
    /// The time at which the newest reading of each was measured, s, and whether it is frozen.
    newest_s: [(f64, bool); WATCHED.len()],
    /// Readings of each, how many of them were frozen, and how many the one before, held.
    counts: [[u64; 3]; WATCHED.len()],
}

const WATCHED: [Role; 4] = [Role::EngineSpeed, Role::TurbineSpeed, Role::OutputSpeed, Role::WheelSpeed];

/// Times that differ by less are those of one reading, s: decimals of a table.
const SAME_S: f64 = 1e-6;

impl FrozenRows {
    pub(crate) fn new() -> Self {
        Self {
            watched: WATCHED.map(|role| (FrozenSpeed::new(role), HeldSpeed::new())),
            newest: NO_SPEEDS,
            newest_s: [(f64::NEG_INFINITY, false); WATCHED.len()],
            counts: [[0; 3]; WATCHED.len()],
        }
    }

    /// Takes the readings out of a row that are frozen, or those of a row before that a table holds.
    pub(crate) fn take_out(&mut self, speeds: SpeedReadings<'_>, time_s: f64) {
        for (i, speed) in speeds.into_iter().enumerate() {
            let Some(Reading { value, age_s }) = *speed else { continue };
            let measured_s = time_s - age_s;
            let (newest_s, was_frozen) = self.newest_s[i];
            let (watched, held) = &mut self.watched[i];
            // With its age a reading that a table holds until the next one comes is one reading.
            let is_same = age_s > 0.0 && (measured_s - newest_s).abs() <= SAME_S;
            let frozen = if is_same { was_frozen } else { watched.is_frozen(value, measured_s, &self.newest) };
            let held = age_s == 0.0 && held.is_held(value);
            self.newest_s[i] = (measured_s, frozen);
            let [readings, of_frozen, of_held] = &mut self.counts[i];
            *readings += 1;
            *of_frozen += u64::from(frozen);
            *of_held += u64::from(held && !frozen);
            if frozen || held {
                *speed = None;
            }
            if !frozen {
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
        for (role, [readings, frozen, held]) in WATCHED.iter().zip(self.counts) {
            let name = role.name();
            if held > 0 {
                notes.push(format!(
                    "{held} of {readings} readings of {name} are those of a row before, held until the next comes, and count once"
                ));
            }
            if frozen > 0 {
                notes.push(format!(
                    "{frozen} of {readings} readings of {name} stand still while the car does not, and are not used"
                ));
            }
            if 2 * frozen > readings {
                return Err(format!("{}\nhint: check the sensor of {name} and its column", notes.join(", ")));
            }
        }
        Ok(notes)
    }
}
