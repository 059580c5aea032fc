//! Which speed of a log has a wrong scale, by the ratio of turbine and output speed in the gears that the log names.

use car::Car;

use crate::checks::ratio_histogram::RatioHistogram;

/// Rows that are needed to judge, and those of a gear that counts \[chosen\].
const ENOUGH: u64 = 200;
const ENOUGH_OF_GEAR: u64 = 50;
/// Fraction of the rows of a gear whose ratio is near the middle one of it, and fraction of all rows in gears whose middle ratios are the same
/// \[chosen\].
const MAXIMUM: f64 = 0.6;
/// Fraction by which two ratios are the same.
const SAME: f64 = 0.02;
/// Fraction by which the middle ratio is off before it is said \[chosen\]: gearbox files have ratios to three digits.
const OFF: f64 = 0.03;
/// Turbine over engine speed, in the middle, of a turbine speed with the right scale: a converter slips.
const TURBINE_OVER_ENGINE: std::ops::Range<f64> = 0.6..1.06;

/// Ratios in the gears, so far.
pub(crate) struct RatioScale {
    /// By gear, turbine speed over output speed times the ratio of the gear, and rows.
    gears: Vec<(RatioHistogram<300>, u64)>,
    /// Turbine speed over engine speed.
    engine: RatioHistogram<100>,
}

/// How many times too large the ratio of turbine and output speed is.
struct Factor {
    factor: f64,
    rows: u64,
    /// Gears in which it is.
    gears: usize,
}

impl RatioScale {
    pub(crate) fn new(car: &Car) -> Self {
        let gears = car.gearbox.gears.iter().map(|_| (RatioHistogram::default(), 0));
        Self { gears: gears.collect(), engine: RatioHistogram::default() }
    }

    /// Takes speeds of engine, turbine and output, rad/s, in a gear of this ratio.
    pub(crate) fn push(&mut self, gear: usize, ratio: f64, [engine, turbine, output]: [f64; 3]) {
        let Some((of_gear, rows)) = self.gears.get_mut(gear) else { return };
        of_gear.push(turbine / (ratio * output));
        *rows += 1;
        self.engine.push(turbine / engine);
    }

    /// The factor of the gear with the most rows, if most rows are in gears that have the same.
    fn factor(&self) -> Option<Factor> {
        let all: u64 = self.gears.iter().map(|(_, rows)| rows).sum();
        let (of_gear, _) = self.gears.iter().max_by_key(|(_, rows)| *rows)?;
        let factor = of_gear.middle();
        let is_alike = |(of_gear, rows): &&(RatioHistogram<300>, u64)| {
            *rows >= ENOUGH_OF_GEAR
                && is_same(of_gear.middle(), factor, SAME)
                && of_gear.fraction_near(factor, SAME) >= MAXIMUM
        };
        let alike: Vec<u64> = self.gears.iter().filter(is_alike).map(|(_, rows)| *rows).collect();
        let rows = alike.iter().sum();
        let is_common = rows >= ENOUGH && rows as f64 >= MAXIMUM * all as f64;
        (is_common && !is_same(factor, 1.0, OFF)).then_some(Factor { factor, rows, gears: alike.len() })
    }

    /// The speed whose scale is wrong, in a sentence; `over_final` is output over wheel speed over the final ratio, not a number without
    /// wheels.
    pub(crate) fn sentence(&self, car: &Car, over_final: f64) -> Option<WrongScale> {
        let Factor { factor, rows, gears } = self.factor()?;
        let is_output = is_same(over_final * factor, 1.0, SAME);
        // What is seen in one gear may be another gear.
        if gears < 2 && !is_output {
            return None;
        }
        let met = format!(
            "turbine_speed is {factor:.3} times output_speed times the ratio of the gear, in {rows} rows of {gears} gears alike"
        );
        let of_output = |because: &str| {
            let likely = likely(car, factor).map_or(String::new(), |likely| format!("; it looks like {likely}"));
            format!(
                "{met}{because}: check unit and scale of output_speed, which would fit with `scale` times {factor:.4}{likely}"
            )
        };
        let text = if is_output {
            of_output(", and output_speed is off against wheel_speed and the final ratio by the same")
        } else if is_same(over_final, 1.0, SAME) {
            format!(
                "{met}, and output_speed fits wheel_speed and the final ratio: check unit and scale of turbine_speed, which would fit with `scale` times \
                 {:.4}, and the ratios of the gearbox file",
                factor.recip()
            )
        } else if TURBINE_OVER_ENGINE.contains(&self.engine.middle()) {
            of_output(", and turbine_speed fits engine_speed")
        } else {
            format!(
                "{met}: check units and scales of output_speed and turbine_speed, and the ratios of the gearbox file"
            )
        };
        Some(WrongScale { text, is_output })
    }
}

/// A speed with a wrong scale.
pub struct WrongScale {
    /// Which one, in a sentence.
    pub text: String,
    /// Whether the wheels, too, say that it is the output speed.
    pub is_output: bool,
}

fn is_same(one: f64, other: f64, fraction: f64) -> bool {
    (one / other - 1.0).abs() <= fraction
}

/// What an output speed likely is that has to be multiplied by this factor.
fn likely(car: &Car, factor: f64) -> Option<&'static str> {
    const RPM: f64 = std::f64::consts::PI / 30.0;
    let kinds = [
        (RPM, "a speed in rpm that is taken as rad/s"),
        (RPM.recip(), "a speed in rad/s that is taken as rpm"),
        (std::f64::consts::TAU, "a speed in Hz that is taken as rad/s"),
        (std::f64::consts::TAU.recip(), "a speed in rad/s that is taken as Hz"),
        (car.driveline.final_ratio, "the speed of the wheels"),
    ];
    kinds.into_iter().find(|(size, _)| is_same(factor, *size, SAME)).map(|(_, what)| what)
}

#[cfg(test)]
mod tests {
    use super::*;
    use config::CarFile;

    /// What is said where output and turbine speed are so many times the true ones, and the turbine turns at this fraction of the engine.
    fn said(scales: [f64; 2], over_engine: f64, has_wheels: bool) -> Option<String> {
        let car = CarFile::eight_speed().unwrap();
        let mut scale = RatioScale::new(&CarFile::eight_speed().unwrap());
        for row in 0..400 {
            let (ratio, output) = ([4.7, 2.1, 1.0, 0.67][row / 100], 50.0 + 0.3 * row as f64);
            // One row in ten is on the way to another gear.
            let turbine = ratio * output * if row % 10 == 0 { 1.3 } else { 1.0 };
            let speeds = [turbine / over_engine, scales[1] * turbine, scales[0] * output];
            scale.push(1 + row / 100, ratio, speeds);
        }
        scale.sentence(&car, if has_wheels { scales[0] } else { f64::NAN }).map(|said| said.text)
    }

    #[test]
    fn the_speed_with_the_wrong_scale_is_named() {
        assert_eq!(said([1.0, 1.0], 0.9, true), None);
        assert_eq!(said([1.02, 1.0], 0.9, true), None);
        for (scales, wheels, words) in [
            ([3.6, 1.0], true, "check unit and scale of output_speed, which would fit with `scale` times 0.277"),
            ([1.0 / 3.0, 1.0], true, "it looks like the speed of the wheels"),
            ([0.104_72, 1.0], false, "it looks like a speed in rad/s that is taken as rpm"),
            ([9.549_3, 1.0], false, "it looks like a speed in rpm that is taken as rad/s"),
            ([0.5, 1.0], false, "and turbine_speed fits engine_speed: check unit and scale of output_speed"),
            ([1.0, 2.0], true, "check unit and scale of turbine_speed, which would fit with `scale` times 0."),
            ([1.0, 2.0], false, "check units and scales of output_speed and turbine_speed"),
        ] {
            let said = said(scales, 0.9, wheels).unwrap();
            assert!(said.contains(words), "{scales:?} {wheels}: {said}");
        }
    }

    #[test]
    fn ratios_that_are_off_by_another_factor_in_each_gear_are_no_scale() {
        let mut scale = RatioScale::new(&CarFile::eight_speed().unwrap());
        (0..400).for_each(|row| scale.push(1 + row / 100, [4.7, 2.1, 1.0, 0.67][row / 100], [200.0, 150.0, 100.0]));
        assert!(scale.sentence(&CarFile::eight_speed().unwrap(), 1.0).is_none());
        // Another gear than the log says, for long.
        let mut scale = RatioScale::new(&CarFile::eight_speed().unwrap());
        (0..4000).for_each(|_| scale.push(7, 0.84, [200.0, 67.0, 100.0]));
        assert!(scale.sentence(&CarFile::eight_speed().unwrap(), 1.0).is_none());
    }
}
