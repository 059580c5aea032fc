//! Speeds of the rows of a table that are no readings of their shaft: frozen and impossible ones, and those that the table holds.

use logs::{Quality, Role, SpeedReading, SpeedWatch, Withdrawn};
use observer::Reading;

/// The speeds of a row, in the order of [`WATCHED`].
pub(crate) type SpeedReadings<'a> = [&'a mut Option<Reading<f64>>; WATCHED.len()];

/// The speeds of the rows, of which frozen and impossible ones are refused by the rules of [`logs::speed_watch`], and held ones are left out.
pub(crate) struct FrozenRows {
    speeds: SpeedWatch,
    /// The time at which the newest reading of each was measured, s, and whether it is refused.
    newest_s: [(f64, Option<Quality>); WATCHED.len()],
    counts: [Counts; WATCHED.len()],
    withdrawn: Vec<Withdrawn>,
}

/// Readings of a speed, and those of them that are not used.
#[derive(Debug, Clone, Copy, Default)]
struct Counts {
    readings: u64,
    frozen: u64,
    impossible: u64,
    held: u64,
}

impl Counts {
    fn push(&mut self, quality: Quality) {
        self.readings += 1;
        match quality {
            Quality::Held => self.held += 1,
            quality => self.refuse(quality),
        }
    }

    fn refuse(&mut self, quality: Quality) {
        match quality {
            Quality::Frozen => self.frozen += 1,
            Quality::Impossible => self.impossible += 1,
            _ => {}
        }
    }
}

const WATCHED: [Role; 4] = [Role::EngineSpeed, Role::TurbineSpeed, Role::OutputSpeed, Role::WheelSpeed];

/// Times that differ by less are those of one reading, s: decimals of a table.
const SAME_S: f64 = 1e-6;

impl FrozenRows {
    /// Of a gearbox whose gears are not known.
    pub(crate) fn new() -> Self {
        Self::of_gearbox(&[])
    }

    /// Of a gearbox with gears of these ratios, turbine over output speed.
    pub(crate) fn of_gearbox(ratios: &[f64]) -> Self {
        Self {
            speeds: SpeedWatch::of_gearbox(ratios),
            newest_s: [(f64::NEG_INFINITY, None); WATCHED.len()],
            counts: [Counts::default(); WATCHED.len()],
            withdrawn: Vec::new(),
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
            let reading = SpeedReading { role: WATCHED[i], value, time_s: measured_s, may_be_held: age_s == 0.0 };
            let (quality, withdrawn) = match before {
                _ if !is_same => self.speeds.judge(reading),
                before => (before.unwrap_or(Quality::Good), [None; 2]),
            };
            let refused = Some(quality).filter(|quality| matches!(quality, Quality::Frozen | Quality::Impossible));
            self.newest_s[i] = (measured_s, refused);
            self.counts[i].push(quality);
            if refused.is_some() {
                *speed = Some(Reading { value: f64::NAN, age_s });
            } else if quality == Quality::Held {
                *speed = None;
            }
            self.withdrawn.extend(withdrawn.into_iter().flatten());
        }
    }

    /// Readings of earlier rows, and of the last one itself, which that shows to be wrong, for [`Self::withdraw`].
    pub(crate) fn withdrawn(&mut self) -> Vec<Withdrawn> {
        std::mem::take(&mut self.withdrawn)
    }

    /// Refuses a reading of a row at this time, s, if it is one of those that are withdrawn.
    pub(crate) fn withdraw(&mut self, withdrawn: Withdrawn, speeds: SpeedReadings<'_>, time_s: f64) {
        let Some(i) = WATCHED.iter().position(|role| *role == withdrawn.role) else { return };
        if let Some(Reading { value, age_s }) = speeds.into_iter().nth(i).and_then(Option::as_mut)
            && time_s - *age_s > withdrawn.after_s + SAME_S
            && !value.is_nan()
        {
            *value = f64::NAN;
            self.counts[i].refuse(withdrawn.quality);
        }
    }

    /// What was met, in sentences.
    pub(crate) fn notes(&self) -> Vec<String> {
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
                    "{frozen} of {readings} readings of {name} do not change while the car moves, and are not used"
                ));
            }
            if impossible > 0 {
                notes.push(format!(
                    "{impossible} of {readings} readings of {name} are impossible, as a zero while the car drives or a jump, and are not used"
                ));
            }
        }
        notes
    }

    /// Refuses a log of one shift without the speeds that show it. It goes on without output and wheel speed.
    ///
    /// # Errors
    /// Most readings of engine or turbine speed were frozen; holds what to say of it.
    pub(crate) fn check(&self) -> Result<(), String> {
        let frozen = WATCHED.iter().zip(self.counts).find(|(role, counts)| {
            2 * counts.frozen > counts.readings && matches!(role, Role::EngineSpeed | Role::TurbineSpeed)
        });
        frozen.map_or(Ok(()), |(role, _)| {
            Err(format!("{}\nhint: check the sensor of {} and its column", self.notes().join(", "), role.name()))
        })
    }
}
