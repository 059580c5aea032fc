//! Shifts that were not fitted, with the given and with the fitted vehicle file.

use std::cmp::Ordering;

use car::Car;
use drivetrain::Real;
use observer::ShiftTables;

use super::command_delay::{said_of_commands, with_commands_earlier};
use super::fitting::GearboxFit;
use super::quantities::{DELAY_UNIT_S, Quantities, Quantity};
use super::shift::{Linearised, ShiftModel};
use super::shift_log::ShiftLog;
use crate::MeanError;
use crate::validation::reason_to_keep;
use crate::weights::NORMAL_95;

/// Errors over shifts that were held out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeldOut {
    /// How many.
    pub shifts: usize,
    /// Mean over the shifts of the RMS error of the turbine speed, rad/s, as torques and inertia of the given and of the fitted file make it
    /// run from its mean while both clutches slip.
    pub turbine_rad_s: [MeanError; 2],
    /// In how many of them the fitted file is the better one.
    pub better: usize,
    /// By how much the torques of the fitted file err, over what its error bounds say of friction and valves, from a third to 3.
    pub valve_error_scale: f64,
}

/// Shifts that would err as much as the bounds say, which count beside those that were held out \[chosen\]: a few shifts that agree by luck are no reason to
/// trust the valves.
const SHIFTS_BEFORE: f64 = 3.0;
/// Minimum scale \[chosen: friction is another by some 4 % with hot and cold oil and with wear, which no log of one drive shows; the
/// bounds of a car in series are three times that\]. The maximum is the same the other way.
const MIN_SCALE: f64 = 1.0 / 3.0;
const MAX_SCALE: f64 = 3.0;

impl HeldOut {
    /// Interval of the scale of the valve errors that holds it in 95 %: of a mean of as many squares as there are shifts, those before included.
    pub fn valve_error_interval(&self) -> [f64; 2] {
        let count = self.shifts as f64 + SHIFTS_BEFORE;
        // The logarithm of the root of a mean of n squares has a standard deviation of 1/sqrt(2 n).
        let half = NORMAL_95 / (2.0 * count).sqrt();
        [-half, half].map(|side| (self.valve_error_scale * Real::exp(side)).clamp(MIN_SCALE, MAX_SCALE))
    }

    /// What the scale of the valve errors says of itself in a file.
    pub(super) fn comment(&self) -> String {
        format!(
            "errors of the torques on {} shifts that were held out, over those that the bounds of friction and valves below allow",
            self.shifts
        )
    }
}

/// Scale of the one-step errors of the turbine speed, rad/s, above which the model is that of another car or log \[chosen\]: between two rows of a
/// shift the turbine itself changes by as much.
const MAX_ONE_STEP_RAD_S: f64 = 4.0;

impl GearboxFit {
    /// Why the fitted file is not to be used in place of the given one, if so.
    pub fn reason_against(&self, checked: Option<&HeldOut>) -> Option<String> {
        if let Some(late_s) = self.commands_late_s() {
            return Some(said_of_commands(late_s));
        }
        let one_step = self.one_step.scale;
        // An error that is not a number counts against the fit.
        if !matches!(one_step.partial_cmp(&MAX_ONE_STEP_RAD_S), Some(Ordering::Less | Ordering::Equal)) {
            return Some(format!(
                "the turbine does not turn as any car within the error bounds would, with a one-step error of {one_step:.1} rad/s: the commands of two \
                 elements may be exchanged, or be other signals (`wetclutch estimate` names those that contradict the gear), or the gearbox is another"
            ));
        }
        let checked = checked.map(|checked| (checked.shifts, checked.turbine_rad_s));
        reason_to_keep(&self.at_limit, checked, "the error of the turbine speed")
    }

    /// Compares both vehicle files on shifts that were not fitted; none if there are none.
    pub fn validate(
        &self,
        given: (&Car, &ShiftTables<f64>),
        fitted: (&Car, &ShiftTables<f64>),
        held_out: &[ShiftLog],
    ) -> Option<HeldOut> {
        let held_out = &self.channels.moved(held_out, fitted.1, DELAY_UNIT_S * self.unknown(Quantity::EngineDelay));
        let held_out = &with_commands_earlier(held_out, self.commands_moved_s.unwrap_or(0.0));
        let of_fitted = Quantities::of(fitted.0, fitted.1, held_out, [false; 2]);
        let compared: Vec<Compared> = (held_out.iter())
            .filter_map(|log| {
                let given = linearised(given, &self.quantities, log)?;
                let fitted = linearised(fitted, &of_fitted, log)?;
                Some(Compared {
                    given: variance(given.residuals.as_slice()),
                    fitted: variance(fitted.residuals.as_slice()),
                    expected: expected_variance(&of_fitted, &fitted),
                })
            })
            .collect();
        let mean = |of: fn(&Compared) -> f64| MeanError::of(&compared.iter().map(of).collect::<Vec<_>>());
        Some(HeldOut {
            shifts: compared.len(),
            turbine_rad_s: [mean(|one| one.given.sqrt())?, mean(|one| one.fitted.sqrt())?],
            better: compared.iter().filter(|one| one.fitted < one.given).count(),
            valve_error_scale: valve_error_scale(&compared),
        })
    }
}

/// Variances about the mean of the error of the turbine speed in a shift, (rad/s)^2: with the given and the fitted file, and by the error bounds of the
/// fitted one.
struct Compared {
    given: f64,
    fitted: f64,
    expected: f64,
}

/// A shift by a vehicle file as it is.
fn linearised((car, tables): (&Car, &ShiftTables<f64>), quantities: &Quantities, log: &ShiftLog) -> Option<Linearised> {
    let model = ShiftModel::new(car, tables, quantities, log)?;
    Some(model.linearised(quantities, &vec![0.0; quantities.all.len()]))
}

fn variance(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    values.iter().map(|value| Real::powi(value - mean, 2)).sum::<f64>() / values.len() as f64
}

/// Variance that the turbine speed has by what the bounds leave open of friction and valves of both clutches.
fn expected_variance(quantities: &Quantities, shift: &Linearised) -> f64 {
    use Quantity as Q;
    let of_valves = |quantity: &Q| matches!(quantity, Q::Torque(_) | Q::Kiss(_) | Q::Lag(_) | Q::Delay(_));
    let places = quantities.all.iter().enumerate().filter(|(_, quantity)| of_valves(quantity));
    let of_place = |place: usize| variance(shift.by_parameter.column(place).as_slice());
    places.map(|(place, _)| quantities.before[(place, place)] * of_place(place)).sum()
}

/// The scale of the errors: the mean of their squares over what is expected.
fn valve_error_scale(compared: &[Compared]) -> f64 {
    let ratios = compared.iter().map(|one| one.fitted / one.expected).filter(|ratio| ratio.is_finite());
    let (sum, count) = ratios.fold((SHIFTS_BEFORE, SHIFTS_BEFORE), |(sum, count), ratio| (sum + ratio, count + 1.0));
    (sum / count).sqrt().clamp(MIN_SCALE, MAX_SCALE)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shifts(ratio: f64, count: usize) -> Vec<Compared> {
        (0..count).map(|_| Compared { given: 1.0, fitted: 4.0 * ratio, expected: 4.0 }).collect()
    }

    #[test]
    fn valves_are_trusted_as_far_as_held_out_shifts_show_it() {
        let scale = |compared: &[Compared]| valve_error_scale(compared);
        assert_eq!(scale(&shifts(1.0, 6)), 1.0);
        // Six shifts without an error, beside three that err as much as is expected.
        assert!((scale(&shifts(0.0, 6)) - (3.0_f64 / 9.0).sqrt()).abs() < 1e-12);
        assert!((scale(&shifts(4.0, 60)) - (243.0_f64 / 63.0).sqrt()).abs() < 1e-12);
        assert_eq!((scale(&shifts(0.0, 1000)), scale(&shifts(1e9, 3))), (MIN_SCALE, MAX_SCALE));
        // A shift in which no clutch carries anything says nothing.
        let nothing = Compared { given: 1.0, fitted: 1.0, expected: 0.0 };
        assert_eq!(scale(&[nothing]), 1.0);
    }
}
