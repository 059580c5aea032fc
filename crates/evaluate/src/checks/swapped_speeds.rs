//! Whether engine and turbine speed stand in each other's channel.
//!
//! In a gear the turbine turns with the gearbox output, times the ratio of that gear. The engine does so only where the converter
//! hardly slips, and then the turbine does too. Times at which the engine fits a gear and the turbine none contradict the channels.

use super::check::{Check, CheckedRow};

/// A speed fits a gear within this fraction: readings that are 20 ms apart differ by 1 % while the car accelerates, teeth are
/// counted to 1 % \[chosen\].
const FITS: f64 = 0.02;
/// And it does not fit beyond this fraction \[chosen\]: twice as much.
const DIFFERS: f64 = 0.04;
/// Samples that are needed to judge \[chosen\]: a second at 100 Hz.
const ENOUGH: u64 = 100;
/// So many times more samples have to speak for a swap than against it \[chosen\]. In a shift, where the turbine is between two gears, the
/// engine may pass one of them.
const TIMES: u64 = 4;
/// Of all samples, the engine speed fits a gear in so many at least \[chosen\]: what turns with the output does so except in shifts, while
/// an engine before a slipping converter only passes a gear.
const MAXIMUM: f64 = 0.5;

/// Samples for and against a swap.
#[derive(Debug, Clone, Copy, Default)]
pub struct SwappedSpeeds {
    turbine_alone: u64,
    engine_alone: u64,
    /// All samples, and those in which the engine fits a gear.
    engine: [u64; 2],
}

impl SwappedSpeeds {
    /// Takes the speeds at one time, rad/s: engine, turbine, and what the turbine would turn at in the gears that are possible.
    pub fn push(&mut self, engine_rad_s: f64, turbine_rad_s: f64, in_gears_rad_s: &[f64]) {
        let fits =
            |speed: f64, fraction: f64| in_gears_rad_s.iter().any(|gear| (speed - gear).abs() <= fraction * gear.abs());
        let (turbine, engine) = (fits(turbine_rad_s, FITS), fits(engine_rad_s, FITS));
        self.engine[0] += u64::from(engine_rad_s.is_finite());
        self.engine[1] += u64::from(engine);
        self.turbine_alone += u64::from(turbine && !fits(engine_rad_s, DIFFERS) && engine_rad_s.is_finite());
        self.engine_alone += u64::from(engine && !fits(turbine_rad_s, DIFFERS) && turbine_rad_s.is_finite());
    }

    /// What the log shows, if it contradicts the channels, in a sentence.
    pub fn contradiction(&self) -> Option<String> {
        let Self { turbine_alone, engine_alone, engine: [all, engine] } = *self;
        let is_in_gear = engine as f64 >= MAXIMUM * all as f64;
        (is_in_gear && engine_alone >= ENOUGH && engine_alone > TIMES * turbine_alone).then(|| {
            format!(
                "engine_speed and turbine_speed may be swapped: in a gear the turbine turns with the output, but in {engine_alone} samples \
                 engine_speed is the output speed times the ratio of a gear and turbine_speed is not; the other way round it is in {turbine_alone}"
            )
        })
    }
}

impl Check for SwappedSpeeds {
    fn row(&mut self, row: &CheckedRow<'_>) {
        if let Some(in_gear) = row.in_gear.as_ref().filter(|of| of.is_compared) {
            let [engine, turbine, output] = row.came_rad_s;
            self.push(engine, turbine, &[in_gear.ratio * output]);
        }
    }

    fn warnings(&self) -> Vec<String> {
        self.contradiction().map(|swapped| format!("warning: {swapped}")).into_iter().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(samples: &[(f64, f64)]) -> Option<String> {
        let mut swapped = SwappedSpeeds::default();
        samples.iter().for_each(|(engine, turbine)| swapped.push(*engine, *turbine, &[300.0, 200.0]));
        swapped.contradiction()
    }

    #[test]
    fn a_swap_is_found_where_the_converter_slips() {
        let good: Vec<(f64, f64)> = (0..200).map(|i| (310.0 + 0.2 * f64::from(i), 300.0)).collect();
        let swapped: Vec<_> = good.iter().map(|(engine, turbine)| (*turbine, *engine)).collect();
        assert_eq!(of(&good), None);
        assert!(of(&swapped).unwrap().contains("may be swapped"));
        // A converter that does not slip says nothing, nor does a shift in which the engine passes a gear.
        assert_eq!(of(&vec![(301.0, 300.0); 500]), None);
        let shift: Vec<(f64, f64)> = vec![(200.0, 250.0); 120];
        assert_eq!(of(&[good, shift].concat()), None);
        assert_eq!(of(&vec![(300.0, f64::NAN); 500]), None);
        // Nor does an output speed of a wrong scale: the turbine fits no gear, and the engine passes some.
        let wrong_output: Vec<(f64, f64)> = (0..900).map(|i| (260.0 + 0.2 * f64::from(i), 225.0)).collect();
        assert_eq!(of(&wrong_output), None);
    }
}
