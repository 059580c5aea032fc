//! Speeds of the rows of a table that are no readings of their shaft: frozen and impossible ones, and those that the table holds.

use logs::{FrozenSpeed, HeldSpeed, NO_SPEEDS, Role, SpeedFaults, Speeds};
use observer::Reading;

/// The speeds of a row, in the order of [`WATCHED`].
pub(crate) type SpeedReadings<'a> = [&'a mut Option<Reading<f64>>; WATCHED.len()];

/// The speeds of the rows, of which frozen and impossible ones are refused by the rules of [`logs::frozen`] and [`logs::speed_faults`], and
/// held ones are left out by those of [`logs::held`].
pub(crate) struct FrozenRows {
    watched: [(FrozenSpeed, HeldSpeed); WATCHED.len()],
    faults: SpeedFaults,
    newest: Speeds,
    /// The time at which the newest reading of each was measured, s, and whether it is refused.
    newest_s: [(f64, Option<Refused>); WATCHED.len()],
    counts: [Counts; WATCHED.len()],
}

/// Why a reading is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Refused {
    Frozen,
    Impossible,
}

/// Readings of a speed, and those of them that are not used.
#[derive(Debug, Clone, Copy, Default)]
struct Counts {
    readings: u64,
    frozen: u64,
    impossible: u64,
    held: u64,
}

const WATCHED: [Role; 4] = [Role::EngineSpeed, Role::TurbineSpeed, Role::OutputSpeed, Role::WheelSpeed];

/// Times that differ by less are those of one reading, s: decimals of a table.
const SAME_S: f64 = 1e-6;

impl FrozenRows {
    pub(crate) fn new() -> Self {
        Self {
            watched: WATCHED.map(|role| (FrozenSpeed::new(role), HeldSpeed::new())),
            faults: SpeedFaults::new(),
            newest: NO_SPEEDS,
            newest_s: [(f64::NEG_INFINITY, None); WATCHED.len()],
            counts: [Counts::default(); WATCHED.len()],
        }
    }

    /// Refuses the readings of a row that are frozen or impossible, by a value that is not a number, and leaves out those of a row before
    /// that a table holds.
    pub(crate) fn take_out(&mut self, speeds: SpeedReadings<'_>, time_s: f64) {
        for (i, speed) in speeds.into_iter().enumerate() {
            let Some(Reading { value, age_s }) = *speed else { continue };
            let measured_s = time_s - age_s;
            let (newest_s, before) = self.newest_s[i];
            // With its age a reading that a table holds until the next one comes is one reading.
            let is_same = age_s > 0.0 && (measured_s - newest_s).abs() <= SAME_S;
            let refused = if is_same { before } else { self.refused(i, value, measured_s) };
            let held = age_s == 0.0 && refused != Some(Refused::Impossible) && self.watched[i].1.is_held(value);
            self.newest_s[i] = (measured_s, refused);
            let counts = &mut self.counts[i];
            counts.readings += 1;
            match refused {
                Some(Refused::Frozen) => counts.frozen += 1,
                Some(Refused::Impossible) => counts.impossible += 1,
                None => {
                    counts.held += u64::from(held);
                    self.newest[WATCHED[i] as usize] = value;
                }
            }
            if refused.is_some() {
                *speed = Some(Reading { value: f64::NAN, age_s });
            } else if held {
                *speed = None;
            }
        }
    }

    /// Why the next reading of a speed is refused, if it is.
    fn refused(&mut self, i: usize, value: f64, measured_s: f64) -> Option<Refused> {
        if self.faults.is_fault(WATCHED[i], value, measured_s) {
            return Some(Refused::Impossible);
        }
        self.watched[i].0.is_frozen(value, measured_s, &self.newest).then_some(Refused::Frozen)
    }

    /// What was met, in sentences.
    ///
    /// # Errors
    /// Most readings of engine or turbine speed were frozen; holds what to say of it. A log goes on without output and wheel speed.
    pub(crate) fn notes(&self) -> Result<Vec<String>, String> {
        let mut notes = Vec::new();
        for (role, counts) in WATCHED.iter().zip(self.counts) {
            let Counts { readings, frozen, impossible, held } = counts;
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
            if impossible > 0 {
                notes.push(format!(
                    "{impossible} of {readings} readings of {name} are impossible, as a zero while the car drives or a jump, and are not used"
                ));
            }
            if 2 * frozen > readings && matches!(role, Role::EngineSpeed | Role::TurbineSpeed) {
                return Err(format!("{}\nhint: check the sensor of {name} and its column", notes.join(", ")));
            }
        }
        Ok(notes)
    }
}
