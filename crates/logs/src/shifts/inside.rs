//! Whether a drive is in the gears of one shift.

use drivetrain::Real;

use crate::{Gearbox, Reading, Role};

/// Below this output speed a ratio says nothing, rad/s.
const OUTPUT_MIN_RAD_S: f64 = 8.0;
/// Part of the way to the next gear from which on the ratio belongs to another shift.
const LEFT: f64 = 0.25;
/// The gears are entered again where the ratio is within this part of the way to the next gear for [`STEADY_S`].
const ENTERED: f64 = 0.1;
/// Time for which a ratio is on one side before it counts, s.
const STEADY_S: f64 = 0.1;

/// Tells from the ratio of turbine and output speed whether a car is in one of two gears, or between them. At low speed, where the ratio says
/// nothing, it is where it was.
#[derive(Debug, Clone)]
pub struct GearsOfShift {
    /// Ratios beyond which the drive left the gears, and within which it is back; the lower one first.
    left: [f64; 2],
    entered: [f64; 2],
    output_rad_per_m: Option<f64>,
    has_output: bool,
    turbine_rad_s: f64,
    is_inside: bool,
    /// Since when the ratio says the opposite, s.
    other_since_s: Option<f64>,
}

impl GearsOfShift {
    /// The gears with these ratios, of a gearbox with more; none if it has no more.
    pub fn new(gearbox: &Gearbox, shift: [f64; 2]) -> Option<Self> {
        let [low, high] = [shift[0].min(shift[1]), shift[0].max(shift[1])];
        // A gear whose ratio is that of a shift's gear to some digits is that gear.
        const SAME: f64 = 1.03;
        let ratios = || gearbox.ratios.iter().copied();
        let below = ratios().filter(|ratio| ratio * SAME < low).reduce(f64::max);
        let above = ratios().filter(|ratio| *ratio > high * SAME).reduce(f64::min);
        if below.is_none() && above.is_none() {
            return None;
        }
        let ends = |part: f64| {
            [
                below.map_or(0.0, |next| low * Real::powf(next / low, part)),
                above.map_or(f64::INFINITY, |next| high * Real::powf(next / high, part)),
            ]
        };
        Some(Self {
            left: ends(LEFT),
            entered: ends(ENTERED),
            output_rad_per_m: gearbox.output_rad_per_m,
            has_output: false,
            turbine_rad_s: f64::NAN,
            is_inside: true,
            other_since_s: None,
        })
    }

    /// Whether the drive is in the gears or between them.
    pub fn is_inside(&self) -> bool {
        self.is_inside
    }

    /// Takes a reading.
    pub fn push(&mut self, reading: &Reading) {
        if reading.is_refused() {
            return;
        }
        let output_rad_s = match (reading.role, self.output_rad_per_m) {
            (Role::TurbineSpeed, _) => {
                self.turbine_rad_s = reading.value;
                return;
            }
            (Role::OutputSpeed, _) => {
                self.has_output = true;
                reading.value
            }
            (Role::VehicleSpeed, Some(rad_per_m)) if !self.has_output => reading.value * rad_per_m,
            _ => return,
        };
        let ratio = self.turbine_rad_s / output_rad_s;
        if output_rad_s < OUTPUT_MIN_RAD_S || ratio.is_nan() {
            return;
        }
        let [low, high] = if self.is_inside { self.left } else { self.entered };
        if (low..=high).contains(&ratio) == self.is_inside {
            self.other_since_s = None;
            return;
        }
        let since_s = *self.other_since_s.get_or_insert(reading.time_s);
        if reading.time_s - since_s >= STEADY_S {
            self.is_inside = !self.is_inside;
            self.other_since_s = None;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATIOS: [f64; 4] = [4.70, 3.13, 2.10, 1.67];

    /// Whether the drive is inside after a second at each of these ratios.
    fn inside(shift: [f64; 2], ratios: &[f64], output_rad_s: f64) -> Vec<bool> {
        let gearbox = Gearbox { ratios: RATIOS.to_vec(), ..Gearbox::default() };
        let mut gears = GearsOfShift::new(&gearbox, shift).unwrap();
        let mut time_s = 0.0;
        let mut after = |ratio: &f64| {
            for _ in 0..100 {
                time_s += 0.01;
                for (role, value) in [(Role::TurbineSpeed, ratio * output_rad_s), (Role::OutputSpeed, output_rad_s)] {
                    gears.push(&Reading { role, time_s, stamp_s: time_s, value });
                }
            }
            gears.is_inside()
        };
        ratios.iter().map(&mut after).collect()
    }

    #[test]
    fn other_gears_are_outside_and_every_ratio_between_the_two_is_inside() {
        let drive = [4.70, 4.0, 3.13, 3.05, 2.10, 1.67, 2.8, 3.12, 3.5, 4.70, 6.0];
        let expected = [true, true, true, true, false, false, false, true, true, true, true];
        assert_eq!(inside([4.70, 3.13], &drive, 50.0), expected);
        // Of the shift from 2nd to 3rd gear, 1st gear lies outside too.
        assert_eq!(
            inside([3.13, 2.10], &[3.13, 3.3, 4.70, 3.6, 3.15, 2.1, 1.67], 50.0),
            [true, true, false, false, true, true, false]
        );
        // At walking speed a ratio says nothing.
        assert_eq!(inside([4.70, 3.13], &drive, 5.0), [true; 11]);
    }

    #[test]
    fn a_gearbox_of_two_gears_has_no_other() {
        let gearbox = Gearbox { ratios: vec![4.70, 3.13], ..Gearbox::default() };
        assert!(GearsOfShift::new(&gearbox, [4.71, 3.12]).is_none());
    }

    #[test]
    fn a_wrong_reading_does_not_end_a_gear() {
        let gearbox = Gearbox { ratios: RATIOS.to_vec(), ..Gearbox::default() };
        let mut gears = GearsOfShift::new(&gearbox, [4.70, 3.13]).unwrap();
        for i in 0..100 {
            let time_s = 0.01 * f64::from(i);
            let turbine = if i % 9 == 0 { 80.0 } else { 235.0 };
            for (role, value) in [(Role::TurbineSpeed, turbine), (Role::OutputSpeed, 50.0)] {
                gears.push(&Reading { role, time_s, stamp_s: time_s, value });
            }
            assert!(gears.is_inside());
        }
    }
}
