//! Whether the speeds of a log are those of the vehicle file's car: ratios that a wrong scale changes.

use car::Vehicle;
use evaluate::checks::CameSpeed;
use evaluate::checks::ratio_histogram::RatioHistogram;
use evaluate::checks::swapped_speeds::SwappedSpeeds;
use observer::{Input, Reading};

use crate::Error;

/// Below this output speed a ratio says nothing, rad/s.
const OUTPUT_MIN_RAD_S: f64 = 8.0;
/// A ratio is that of a gear within this fraction.
const IN_GEAR: f64 = 0.05;
/// A car is in gear for most of the time; so little says that its gears are others.
const IN_GEAR_FRACTION: f64 = 0.1;
/// By the wheels it is in gear for so much of the time where the output speed alone is wrong.
const MOSTLY: f64 = 0.5;
/// Wheels differ by so much: tyres, scale and slip are a part of it.
const WHEEL: f64 = 0.15;
/// Fraction by which tyres slip besides.
const SLIPS: f64 = 0.02;
/// Bins of the ratios for a factor of e: of a hundredth.
const PER_CENT: u32 = 100;
/// Steps that are needed to judge, and time, s.
const STEPS: u64 = 200;
const TIME_S: f64 = 3.0;

/// Ratios of the speeds so far.
pub(crate) struct Ratios {
    gears: [f64; 2],
    final_ratio: f64,
    /// Bound on the scale of the wheel speed.
    wheel_scale: f64,
    /// Engine, turbine, output and wheel speed.
    came: [CameSpeed; 4],
    moving_s: f64,
    moving: u64,
    in_gear: u64,
    /// The same with the output speed that the wheels give.
    in_gear_by_wheel: u64,
    turbine_over_output: RatioHistogram<PER_CENT>,
    output_over_wheel: RatioHistogram<PER_CENT>,
    swapped: SwappedSpeeds,
}

impl Ratios {
    pub(crate) fn new(vehicle: &Vehicle) -> Self {
        Self {
            gears: [vehicle.shift.ratio_offgoing(), vehicle.shift.ratio_oncoming()],
            final_ratio: vehicle.driveline.final_ratio,
            wheel_scale: vehicle.error_bounds.wheel_scale,
            came: [CameSpeed::default(); 4],
            moving_s: 0.0,
            moving: 0,
            in_gear: 0,
            in_gear_by_wheel: 0,
            turbine_over_output: RatioHistogram::default(),
            output_over_wheel: RatioHistogram::default(),
            swapped: SwappedSpeeds::default(),
        }
    }

    /// What contradicts the channels of the speeds, in a sentence.
    pub(crate) fn contradiction(&self) -> Option<String> {
        self.swapped.contradiction()
    }

    /// Takes the speeds of a row; only where it is looked at, they are judged.
    pub(crate) fn push(&mut self, time_s: f64, input: &Input<f64>, is_looked_at: bool) {
        let readings = [input.engine_rad_s, input.turbine_rad_s, input.output_rad_s, input.wheel_rad_s];
        for (came, reading) in self.came.iter_mut().zip(readings) {
            if let Some(Reading { value, .. }) = reading.filter(|reading| reading.value.is_finite()) {
                came.push(time_s, value);
            }
        }
        let [engine, turbine, output, wheel] = self.came.each_ref().map(|came| came.at(time_s));
        if is_looked_at && output > OUTPUT_MIN_RAD_S && turbine.is_finite() {
            self.moving += 1;
            self.moving_s += input.dt_s.clamp(0.0, 1.0);
            self.swapped.push(engine, turbine, &self.gears.map(|gear| gear * output));
            let ratio = turbine / output;
            let fits = |ratio: f64| u64::from(self.gears.iter().any(|gear| (ratio / gear - 1.0).abs() < IN_GEAR));
            self.in_gear += fits(ratio);
            self.in_gear_by_wheel += fits(turbine / (wheel * self.final_ratio));
            self.turbine_over_output.push(ratio);
            self.output_over_wheel.push(output / wheel);
        }
    }

    /// Refuses speeds that are not of this car.
    ///
    /// # Errors
    /// The car is hardly ever in its gears, or its wheels do not turn with its output.
    pub(crate) fn check(&self) -> Result<(), Error> {
        if self.moving < STEPS || self.moving_s < TIME_S {
            return Ok(());
        }
        let fraction = |in_gear: u64| in_gear as f64 / self.moving as f64;
        if fraction(self.in_gear) < IN_GEAR_FRACTION {
            // Turbine and wheels fit each other: it is the output that is wrong.
            let (final_ratio, found) = (self.final_ratio, self.output_over_wheel.middle());
            if fraction(self.in_gear_by_wheel) > MOSTLY && check_wheel(found, final_ratio, self.wheel_scale).is_err() {
                return Err(Error::Input(format!(
                    "output_speed over wheel_speed is {found:.2} in the middle, and the final ratio of the vehicle file is {final_ratio:.2}; \
                     turbine_speed and wheel_speed fit the gears\nhint: output_speed is {:.3} times too large: check its unit and scale",
                    found / final_ratio
                )));
            }
            let [offgoing, oncoming] = self.gears;
            let hint = self.contradiction().unwrap_or_else(|| {
                "check unit and scale of turbine_speed and output_speed, and whether the vehicle file is of this car; for a log of more gears, a \
                 channel map with `gearbox.ratios` distinguishes them"
                    .to_owned()
            });
            return Err(Error::Input(format!(
                "turbine_speed over output_speed is {:.3} in the middle, and the gears of the vehicle file have {offgoing:.3} and \
                 {oncoming:.3}: the car is in them for {:.0} % of the time\nhint: {hint}",
                self.turbine_over_output.middle(),
                100.0 * fraction(self.in_gear),
            )));
        }
        check_wheel(self.output_over_wheel.middle(), self.final_ratio, self.wheel_scale)
    }
}

/// Refuses wheels that do not turn with the output: their middle ratio is far from that of the vehicle file, and their scale outside its bound.
pub(crate) fn check_wheel(output_over_wheel: f64, final_ratio: f64, wheel_scale: f64) -> Result<(), Error> {
    let is_far = (output_over_wheel / final_ratio - 1.0).abs() > WHEEL;
    let has_bound = (final_ratio / output_over_wheel - 1.0).abs() <= wheel_scale + SLIPS;
    if is_far && !has_bound {
        return Err(Error::Input(format!(
            "output_speed over wheel_speed is {output_over_wheel:.2} in the middle, and the final ratio of the vehicle file is {final_ratio:.2}\n\
             hint: check unit and scale of wheel_speed and output_speed, and `driveline.final_ratio`",
        )));
    }
    Ok(())
}
