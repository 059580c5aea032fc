//! Whether the speeds of a log have the scales of the car: by the ratios of the gears and by the final ratio.

use car::{Car, ErrorBudget};
use observer::Reading;

use super::check::{Check, CheckedRow};
use super::ratio_histogram::RatioHistogram;
use super::ratio_scale::{RatioScale, WrongScale};

/// Rows that are needed to judge, and their time, s \[chosen\].
const ENOUGH: (u64, f64) = (200, 3.0);

/// Ratios of the speeds in the gears, so far.
pub(crate) struct Scales<'c> {
    car: &'c Car,
    ratios: RatioScale,
    /// Output over wheel speed in the rows that have both; how many there are, and how long they are, s.
    output_over_wheel: RatioHistogram<1000>,
    wheel_rows: (u64, f64),
}

impl<'c> Scales<'c> {
    pub(super) fn new(car: &'c Car) -> Self {
        let output_over_wheel = RatioHistogram::default();
        Self { car, ratios: RatioScale::new(car), output_over_wheel, wheel_rows: (0, 0.0) }
    }

    /// Output over wheel speed in the middle; not a number where too few rows have both.
    pub(crate) fn output_over_wheel(&self) -> f64 {
        let (rows, time_s) = self.wheel_rows;
        if rows < ENOUGH.0 || time_s < ENOUGH.1 { f64::NAN } else { self.output_over_wheel.middle() }
    }

    /// A speed whose scale is wrong by the ratios in the gears.
    pub(crate) fn wrong_scale(&self) -> Option<WrongScale> {
        self.ratios.sentence(self.car, self.output_over_wheel() / self.car.driveline.final_ratio)
    }

    /// A wheel speed that is off the output speed and the final ratio.
    fn wheel_warning(&self, wrong: Option<&WrongScale>) -> Option<String> {
        let final_ratio = self.car.driveline.final_ratio;
        let (off, bound) = (self.output_over_wheel() / final_ratio - 1.0, ErrorBudget::of_car(self.car).wheel_scale);
        (off.abs() > bound && wrong.is_none_or(|wrong| !wrong.is_output)).then(|| {
            format!(
                "warning: output_speed over wheel_speed is {:.3} in the middle, {:+.1} % from the final ratio {final_ratio:.3}: the filter learns the \
                 scale of wheel_speed within {:.1} % and refuses a speed that is further off\nhint: correct the scale of wheel_speed or `driveline.final_ratio`, or \
                 give its bound as `error_bounds.wheel_scale_share`",
                self.output_over_wheel(),
                100.0 * off,
                100.0 * bound
            )
        })
    }
}

impl Check for Scales<'_> {
    fn row(&mut self, row: &CheckedRow<'_>) {
        let Some(in_gear) = row.in_gear.as_ref().filter(|of| of.is_compared) else { return };
        self.ratios.push(in_gear.gear, in_gear.ratio, row.came_rad_s);
        let input = &row.step.input;
        let read = |reading: Option<Reading<f64>>| reading.map(|of| of.value).filter(|value| value.is_finite());
        if let (Some(output), Some(wheel)) = (read(input.output_rad_s), read(input.wheel_rad_s)) {
            self.output_over_wheel.push(output / wheel);
            self.wheel_rows.0 += 1;
            self.wheel_rows.1 += input.dt_s.clamp(0.0, 1.0);
        }
    }

    fn warnings(&self) -> Vec<String> {
        let wrong = self.wrong_scale();
        let wheel = self.wheel_warning(wrong.as_ref());
        wrong.map(|wrong| format!("warning: {}", wrong.text)).into_iter().chain(wheel).collect()
    }
}
