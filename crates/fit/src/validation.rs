//! Shifts that were not fitted, with the given and with the fitted vehicle.

use std::ops::ControlFlow;

use car::Vehicle;

use crate::car::Car;
use crate::drives::Drives;
use crate::fitting::DECREASE;
use crate::least_squares::Iterations;
use crate::parameters::{HYSTERESIS_UNIT_PA, Prior};
use crate::shift_model::ShiftModel;
use crate::solver::{Problem, Unknowns};
use crate::{Channel, Fit, FitError, Given, MeanError, Parameter, ReadingAges, ShiftRecord, open_loop};

/// Errors over shifts that were held out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeldOut {
    /// How many.
    pub shifts: usize,
    /// RMS of the one-step errors of the turbine speed, rad/s, with the given file and with the fitted one. Loads and starts are found
    /// anew with either; the delays of the channels are those of the fit.
    pub turbine_rad_s: [MeanError; 2],
    /// RMS error of the open loop's pressure where it was measured, Pa, with the zero offset of the sensor by the fit.
    pub pressure_pa: Option<[MeanError; 2]>,
}

impl Fit {
    /// Why the fitted file is not to be used in place of the given one, if so.
    pub fn reason_against(&self, checked: Option<&HeldOut>) -> Option<String> {
        let checked = checked.map(|checked| (checked.shifts, checked.turbine_rad_s));
        reason_to_keep(&self.at_limit, checked, "the one-step error of the turbine speed")
    }

    /// Compares both vehicles on shifts that were not fitted; none if there are none.
    ///
    /// # Errors
    /// A shift cannot be computed with either vehicle.
    pub fn validate(
        &self,
        given: &Given,
        fitted: &Given,
        held_out: &[ShiftRecord],
        ages: ReadingAges,
    ) -> Result<Option<HeldOut>, FitError> {
        if held_out.is_empty() {
            return Ok(None);
        }
        // Either car is what is written in its file; what is of the signals is that of the fit.
        let turbine_rad_s = [self.turbine_error(given, held_out, ages)?, self.turbine_error(fitted, held_out, ages)?];
        // Either file is compared with what the sensor reads less its zero offset.
        let offset_pa = self.value(Parameter::PressureOffset).unwrap_or(0.0);
        let pressure = |vehicle: &Vehicle| {
            let of_shifts = held_out.iter().filter_map(|record| {
                let [from_s, to_s] = [record.pressure.time_s.first(), record.pressure.time_s.last()]
                    .map(|time_s| time_s.copied().unwrap_or(f64::NAN));
                let points = open_loop(vehicle, record).into_iter();
                let measured = points.filter(|point| (from_s..=to_s).contains(&point.time_s));
                mean_square(measured.map(|point| point.pressure_pa - (record.pressure.at(point.time_s) - offset_pa)))
            });
            MeanError::rms(&of_shifts.collect::<Vec<_>>())
        };
        let pressure_pa =
            pressure(&given.vehicle).zip(pressure(&fitted.vehicle)).map(|(given, fitted)| [given, fitted]);
        let unknown = MeanError { value: f64::NAN, interval: None };
        let turbine_rad_s = turbine_rad_s.map(|error| error.unwrap_or(unknown));
        Ok(Some(HeldOut { shifts: held_out.len(), turbine_rad_s, pressure_pa }))
    }

    /// RMS of the one-step errors of the turbine speed with a vehicle file, and the fitted delays and scales of the signals.
    fn turbine_error(
        &self,
        Given { vehicle, shafts, .. }: &Given,
        held_out: &[ShiftRecord],
        ages: ReadingAges,
    ) -> Result<Option<MeanError>, FitError> {
        let file = Car::of_file(vehicle, ages);
        let of_file = |(prior, x): (&Prior, &f64)| match prior.parameter {
            parameter if parameter.is_of_signals() => *x,
            Parameter::Hysteresis => vehicle.oncoming.hysteresis_pa / HYSTERESIS_UNIT_PA,
            _ => 0.0,
        };
        let unknowns: Vec<f64> = self.priors.iter().zip(&self.unknowns).map(of_file).collect();
        let models: Vec<ShiftModel> = held_out.iter().map(|record| ShiftModel::new(record.clone(), &file)).collect();
        // No parameter is free, the own unknowns of the shifts are.
        let car = file.with(shafts, &self.priors, &unknowns);
        let problem = Problem { file: &car, shafts, priors: &[], drives: &Drives::NONE };
        let own = models.iter().map(ShiftModel::start).collect();
        let start = Unknowns { shared: Vec::new(), own, drives: Vec::new() };
        const STARTS: Iterations = Iterations { reweighted: 0, maximum: 6, decrease: DECREASE };
        let at = problem.solve(&models, start, self.weights.clone(), STARTS, &mut |_| ControlFlow::Continue(()))?.at;
        let residuals = problem.residuals(&models, &at);
        let scale = self.weights.of(Channel::Turbine).scale;
        let of_shifts = models.iter().zip(residuals).filter_map(|(model, mut rows)| {
            self.weights.errors(&model.blocks, rows.as_mut_slice());
            let turbine = model.blocks.iter().filter(|block| block.channel == Channel::Turbine);
            mean_square(turbine.flat_map(|block| &rows.as_slice()[block.rows.clone()]).map(|error| error * scale))
        });
        Ok(MeanError::rms(&of_shifts.collect::<Vec<_>>()))
    }
}

/// Why given values are kept, if so: names of values that ended at the limit of what is held possible, or errors, in rad/s, on so many
/// shifts that were held out, with the given and with the fitted file.
pub(crate) fn reason_to_keep(
    at_limit: &[String],
    checked: Option<(usize, [MeanError; 2])>,
    error: &str,
) -> Option<String> {
    if !at_limit.is_empty() {
        return Some(format!("at the limit of the prior (4 standard deviations): {}", at_limit.join(", ")));
    }
    let (shifts, [given, fitted]) = checked?;
    // An error that is not a number counts against the fit.
    let is_better = fitted.value < given.value;
    (!is_better).then(|| {
        format!(
            "on {shifts} shifts that were held out {error} is {given:.3} rad/s with the given file and {fitted:.3} rad/s with the fitted one"
        )
    })
}

fn mean_square(errors: impl Iterator<Item = f64>) -> Option<f64> {
    let (count, sum) = errors.fold((0.0, 0.0), |(count, sum), error| (count + 1.0, sum + error * error));
    (count > 0.0).then(|| sum / count)
}
