//! What each reading of a speed is worth, and which of those before it are not.

use crate::copies::Copies;
use crate::frozen::{FrozenSpeed, NO_SPEEDS, SPEEDS, Speeds};
use crate::held::HeldSpeed;
use crate::speed_faults::MAX_RAD_S;
use crate::ties::Ties;
use crate::{Quality, Role, SpeedFaults};

/// Readings of a speed that were taken as good and are not.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Withdrawn {
    /// The speed.
    pub role: Role,
    /// They came after this time, s.
    pub after_s: f64,
    /// Why they are refused.
    pub quality: Quality,
}

/// What a reading shows to be wrong: of two speeds at most.
pub type AllWithdrawn = [Option<Withdrawn>; 2];

/// A reading to be judged.
#[derive(Debug, Clone, Copy)]
pub struct SpeedReading {
    /// The speed.
    pub role: Role,
    /// Its value, rad/s, or m/s of the car.
    pub value: f64,
    /// When it was measured, s.
    pub time_s: f64,
    /// Whether a table may hold it until the next one comes: it has no age of its own.
    pub may_be_held: bool,
}

/// Watches the speeds of a log by the rules of [`crate::speed_faults`], [`crate::frozen`], [`crate::held`], and of channels that show another one.
#[derive(Debug, Clone, Copy)]
pub struct SpeedWatch {
    speeds: [(FrozenSpeed, HeldSpeed); SPEEDS],
    faults: SpeedFaults,
    copies: Copies,
    ties: Ties,
    newest: Speeds,
}

impl SpeedWatch {
    /// Before the first readings, of a gearbox whose gears are not known.
    pub fn new() -> Self {
        Self::with(SpeedFaults::new(), Ties::of(&[]))
    }

    /// Before the first readings, of a gearbox with gears of these ratios, turbine over output speed; without any they are not known.
    pub fn of_gearbox(ratios: &[f64]) -> Self {
        Self::with(SpeedFaults::of_gearbox(ratios), Ties::of(ratios))
    }

    fn with(faults: SpeedFaults, ties: Ties) -> Self {
        Self {
            speeds: Role::SPEEDS.map(|role| (FrozenSpeed::new(role), HeldSpeed::new())),
            faults,
            copies: Copies::new(),
            ties,
            newest: NO_SPEEDS,
        }
    }

    /// What the next reading is worth, and which are refused because of it: of its speed or of others, itself included.
    pub fn judge(&mut self, reading: SpeedReading) -> (Quality, AllWithdrawn) {
        let SpeedReading { role, value, time_s, may_be_held } = reading;
        let Some((frozen, held)) = self.speeds.get_mut(role as usize) else { return (Quality::Good, [None; 2]) };
        if value.abs() > MAX_RAD_S {
            // No speed, which is refused elsewhere: it is the start of nothing.
            return (Quality::Good, [None; 2]);
        }
        let is_fault = self.faults.is_fault(role, [value, time_s], || self.ties.fit(role, [value, time_s]));
        let was_frozen = frozen.is_known();
        let is_held = !is_fault && may_be_held && held.is_held(value);
        if !is_fault
            && frozen.is_frozen(value, time_s, &self.newest)
            && let Some([right, after_s]) = frozen.still()
        {
            self.faults.disbelieve_after(role, right, after_s);
            let withdrawn = Withdrawn { role, after_s, quality: Quality::Frozen };
            return (Quality::Frozen, [Some(withdrawn).filter(|_| !was_frozen), None]);
        }
        let copied = self.copies.push(role, [value, time_s], is_fault).map(|copied| {
            let (role, [right, after_s]) = copied?;
            self.faults.disbelieve_after(role, right, after_s);
            Some(Withdrawn { role, after_s, quality: Quality::Impossible })
        });
        if is_fault || copied.iter().flatten().any(|copied| copied.role == role) {
            return (Quality::Impossible, copied);
        }
        let mut withdrawn = copied;
        if let Some((off, [right, after_s])) = self.ties.push(role, [value, time_s]) {
            self.faults.disbelieve_after(off, right, after_s);
            withdrawn[0] = Some(Withdrawn { role: off, after_s, quality: Quality::Impossible });
            if off == role {
                return (Quality::Impossible, withdrawn);
            }
        }
        self.newest[role as usize] = value;
        (if is_held { Quality::Held } else { Quality::Good }, withdrawn)
    }
}

impl Default for SpeedWatch {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_that_is_no_speed_refuses_none_behind_it() {
        let mut watch = SpeedWatch::new();
        for row in 0..600_u32 {
            let time_s = 0.01 * f64::from(row);
            let value = if (300..310).contains(&row) { 6553.5 } else { 160.0 + 0.03 * (1.7 * f64::from(row)).sin() };
            let reading = SpeedReading { role: Role::TurbineSpeed, value, time_s, may_be_held: true };
            assert_eq!(watch.judge(reading), (Quality::Good, [None; 2]), "{row}");
        }
    }

    #[test]
    fn an_output_that_shows_the_turbine_is_believed_once_a_shift_has_brought_the_turbine_to_it() {
        for noise_rad_s in [0.0, 0.2] {
            let noise = |row: u32, of: f64| noise_rad_s * (f64::from(row) * of).sin();
            let mut watch = SpeedWatch::of_gearbox(&[2.5, 1.0]);
            let mut refused = Vec::new();
            for row in 0..900_u32 {
                let time_s = 0.01 * f64::from(row);
                let output = 120.0 + 4.0 * time_s + noise(row, 1.37);
                let turbine = output * (2.5 - 1.5 * ((time_s - 4.5) / 0.4).clamp(0.0, 1.0)) + noise(row, 2.11);
                let shows = (4.0..6.0).contains(&time_s);
                let speeds =
                    [turbine + 12.0, turbine, if shows { turbine } else { output }, output / 3.0 + noise(row, 0.91)];
                for (role, value) in Role::SPEEDS.into_iter().zip(speeds) {
                    let (quality, _) = watch.judge(SpeedReading { role, value, time_s, may_be_held: false });
                    if quality == Quality::Impossible {
                        refused.push((role, time_s));
                    }
                }
            }
            assert!(refused.iter().all(|(role, _)| *role == Role::OutputSpeed), "{noise_rad_s}: {refused:?}");
            let [first, last] = [refused.first(), refused.last()].map(|found| found.map(|(_, time_s)| *time_s));
            assert!(first.is_some_and(|time_s| time_s < 4.03), "{noise_rad_s}: {first:?}");
            assert!(last.is_some_and(|time_s| time_s > 4.8 && time_s < 5.1), "{noise_rad_s}: {last:?}");
        }
    }

    /// Of a simulation, or of coarse channels: turbine and output agree to the last digit in the direct gear. Before, the turbine was refused until it
    /// left the output.
    #[test]
    fn a_wrong_reading_in_the_direct_gear_is_no_end_of_a_copy() {
        for (which, error_rad_s) in [(1, -20.0), (1, 20.0), (1, 2.0), (2, -20.0), (2, 3.0)] {
            for count in [1, 2] {
                let mut watch = SpeedWatch::of_gearbox(&[1.5, 1.0]);
                let mut refused = Vec::new();
                for row in 0..900_u32 {
                    let time_s = 0.01 * f64::from(row);
                    let output = 120.0 + 4.0 * (0.7 * time_s).sin();
                    let turbine = output * (1.5 - 0.5 * ((time_s - 2.0) / 0.4).clamp(0.0, 1.0));
                    let mut speeds = [turbine + 12.0, turbine, output, output / 3.0];
                    if row >= 400 && row % 97 < count {
                        speeds[which] += error_rad_s;
                    }
                    for (role, value) in Role::SPEEDS.into_iter().zip(speeds) {
                        let (quality, _) = watch.judge(SpeedReading { role, value, time_s, may_be_held: false });
                        if quality == Quality::Impossible {
                            refused.push((row, role));
                        }
                    }
                }
                assert!(refused.iter().all(|(row, _)| row % 97 < count + 2), "{error_rad_s} {count}: {refused:?}");
            }
        }
    }

    /// Read in steps of 2 rpm it stands to the last digit, and the car turns the turbine faster; in fine ones it would not.
    #[test]
    fn an_idle_control_holds_an_engine_that_is_read_in_coarse_steps() {
        for (step_rpm, expected) in [(2.0, false), (0.01, true)] {
            let mut watch = SpeedWatch::of_gearbox(&[2.5, 1.0]);
            let mut is_frozen = false;
            for row in 0..900_u32 {
                let time_s = 0.01 * f64::from(row);
                let turbine = (220.0 - 8.0 * (time_s - 1.0).max(0.0).powi(2)).max(75.0);
                let engine = (turbine - 16.0).max(84.8);
                let step_rad_s = step_rpm * std::f64::consts::PI / 30.0;
                let engine = (engine / step_rad_s).round() * step_rad_s;
                let speeds = [engine, turbine, turbine, turbine / 3.0];
                for (role, value) in Role::SPEEDS.into_iter().zip(speeds) {
                    let (quality, _) = watch.judge(SpeedReading { role, value, time_s, may_be_held: false });
                    is_frozen |= role == Role::EngineSpeed && quality == Quality::Frozen;
                }
            }
            assert_eq!(is_frozen, expected, "{step_rpm} rpm");
        }
    }
}
