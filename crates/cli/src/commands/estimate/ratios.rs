//! Whether the speeds of a log are those of the vehicle file's car: ratios that a wrong scale changes.

use std::ops::Range;

use config::Vehicle;
use observer::{Input, Reading};
use study::swapped_speeds::SwappedSpeeds;

use crate::failure::Failure;

/// Below this output speed a ratio says nothing, rad/s.
const OUTPUT_MIN_RAD_S: f64 = 8.0;
/// A ratio is that of a gear within this share.
const IN_GEAR: f64 = 0.05;
/// A car is in gear for most of the time; so little says that its gears are others.
const IN_GEAR_SHARE: f64 = 0.1;
/// Wheels differ by so much: tyres, scale and slip are a part of it.
const WHEEL: f64 = 0.15;
/// Steps that are needed to judge, and time, s.
const STEPS: u64 = 200;
const TIME_S: f64 = 3.0;

/// Ratios of the speeds so far.
pub(super) struct Ratios {
    gears: [f64; 2],
    final_ratio: f64,
    /// Newest turbine, output and wheel speed, rad/s.
    newest_rad_s: [f64; 3],
    moving_s: f64,
    moving: u64,
    in_gear: u64,
    turbine_over_output: Histogram,
    output_over_wheel: Histogram,
    /// Newest engine speed, rad/s.
    engine_rad_s: f64,
    swapped: SwappedSpeeds,
}

impl Ratios {
    pub(super) fn new(vehicle: &Vehicle) -> Self {
        Self {
            gears: [vehicle.shift.ratio_offgoing(), vehicle.shift.ratio_oncoming()],
            final_ratio: vehicle.driveline.final_ratio,
            newest_rad_s: [f64::NAN; 3],
            moving_s: 0.0,
            moving: 0,
            in_gear: 0,
            turbine_over_output: Histogram::default(),
            output_over_wheel: Histogram::default(),
            engine_rad_s: f64::NAN,
            swapped: SwappedSpeeds::default(),
        }
    }

    /// What contradicts the channels of the speeds, in a sentence.
    pub(super) fn warning(&self) -> Option<String> {
        self.swapped.warning()
    }

    /// Takes the speeds of a row; only where it is looked at, they are judged.
    pub(super) fn push(&mut self, input: &Input<f64>, is_looked_at: bool) {
        let readings = [input.turbine_rad_s, input.output_rad_s, input.wheel_rad_s];
        for (newest, reading) in self.newest_rad_s.iter_mut().zip(readings) {
            if let Some(Reading { value, .. }) = reading.filter(|reading| reading.value.is_finite()) {
                *newest = value;
            }
        }
        if let Some(Reading { value, .. }) = input.engine_rad_s.filter(|reading| reading.value.is_finite()) {
            self.engine_rad_s = value;
        }
        let [turbine, output, wheel] = self.newest_rad_s;
        if is_looked_at && output > OUTPUT_MIN_RAD_S && turbine.is_finite() {
            self.moving += 1;
            self.moving_s += input.dt_s.clamp(0.0, 1.0);
            self.swapped.push(self.engine_rad_s, turbine, &self.gears.map(|gear| gear * output));
            let ratio = turbine / output;
            self.in_gear += u64::from(self.gears.iter().any(|gear| (ratio / gear - 1.0).abs() < IN_GEAR));
            self.turbine_over_output.push(ratio);
            self.output_over_wheel.push(output / wheel);
        }
    }

    /// Refuses speeds that are not of this car.
    ///
    /// # Errors
    /// The car is hardly ever in its gears, or its wheels do not turn with its output.
    pub(super) fn check(&self) -> Result<(), Failure> {
        if self.moving < STEPS || self.moving_s < TIME_S {
            return Ok(());
        }
        #[expect(clippy::cast_precision_loss, reason = "a share")]
        let share = self.in_gear as f64 / self.moving as f64;
        if share < IN_GEAR_SHARE {
            let [offgoing, oncoming] = self.gears;
            let swapped = self.warning().map_or(String::new(), |warning| warning + "\n");
            return Err(Failure::Input(format!(
                "{swapped}turbine_speed over output_speed is {:.3} in the middle, and the gears of the vehicle file have {offgoing:.3} and \
                 {oncoming:.3}: the car is in them for {:.0} % of the time\nhint: check unit and scale of turbine_speed and output_speed, and \
                 whether the vehicle file is of this car; for a log of more gears, a channel map with `gearbox.ratios` tells them apart",
                self.turbine_over_output.middle(),
                100.0 * share,
            )));
        }
        let wheel = self.output_over_wheel.middle();
        if (wheel / self.final_ratio - 1.0).abs() > WHEEL {
            return Err(Failure::Input(format!(
                "output_speed over wheel_speed is {wheel:.2} in the middle, and the final ratio of the vehicle file is {:.2}\n\
                 hint: check unit and scale of wheel_speed and output_speed, and `driveline.final_ratio`",
                self.final_ratio,
            )));
        }
        Ok(())
    }
}

/// Counts of ratios from 1/20 to 20 by their logarithm.
struct Histogram {
    counts: Vec<u32>,
    /// The bin of the ratio before, and ratios that are in it for certain: a car keeps its ratio for long.
    last: usize,
    within: Range<f64>,
}

impl Default for Histogram {
    fn default() -> Self {
        Self { counts: vec![0; Self::BINS], last: 0, within: 0.0..0.0 }
    }
}

impl Histogram {
    const BINS: usize = 600;
    /// Bins for a factor of e.
    const FINE: f64 = 100.0;

    fn push(&mut self, ratio: f64) {
        /// Share by which a ratio near the end of a bin may be taken for one in the next.
        const ROUNDING: f64 = 1e-9;
        if !self.within.contains(&ratio) {
            let place = ratio.ln() * Self::FINE + 300.0;
            if !(0.0..600.0).contains(&place) {
                return;
            }
            // From the ratio to an end of the bin: of the exponential of less than a hundredth, these two powers stay within it.
            let factor = |way: f64| 1.0 + way + 0.5 * way * way;
            let [down, up] = [place.floor() - place, place.floor() + 1.0 - place].map(|way| factor(way / Self::FINE));
            self.within = ratio * down * (1.0 + ROUNDING)..ratio * up * (1.0 - ROUNDING);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a place among the bins")]
            let bin = place as usize;
            self.last = bin;
        }
        self.counts[self.last] = self.counts[self.last].saturating_add(1);
    }

    /// The middle ratio, to half a per cent; not a number without any.
    fn middle(&self) -> f64 {
        let all: u64 = self.counts.iter().map(|count| u64::from(*count)).sum();
        let mut below = 0;
        for (place, count) in (0_u32..).zip(&self.counts) {
            below += u64::from(*count);
            if 2 * below > all {
                return ((f64::from(place) + 0.5 - 300.0) / Self::FINE).exp();
            }
        }
        f64::NAN
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ratio_is_counted_in_the_bin_of_its_logarithm_whatever_the_one_before_was() {
        // Slow changes, jumps, and the ends of bins from both sides.
        let slow = (0..100_000).map(|i| 0.9 + 2e-6 * f64::from(i));
        let ends = (-310_i32..310).map(|bin| (f64::from(bin) / Histogram::FINE).exp());
        let near = ends.flat_map(|end| [end, end * (1.0 - 1e-12), end * (1.0 + 1e-12), end * (1.0 - 1e-15), 2.5]);
        let odd = [0.0, -1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e-300, 1e300];
        let mut histogram = Histogram::default();
        let mut expected = vec![0_u32; Histogram::BINS];
        for ratio in slow.chain(near).chain(odd) {
            histogram.push(ratio);
            let place = ratio.ln() * Histogram::FINE + 300.0;
            if (0.0..600.0).contains(&place) {
                expected[place as usize] += 1;
            }
        }
        assert_eq!(histogram.counts, expected);
    }
}
