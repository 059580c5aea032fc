//! The error bounds of a fitted file: what the fit leaves open of each quantity.

use car::{Car, ShiftClutch};
use car::{ElementErrors, ErrorBudget};
use drivetrain::Real;

use super::file::{Written, list};
use super::fitting::GearboxFit;
use super::quantities::{DELAY_UNIT_S, Quantity};
use super::validation::HeldOut;
use crate::FitError;
use crate::budget::{BUDGET_COMMENT, BUDGET_SIDES, delays, factors};
use crate::vehicle_text::number;
use crate::verdict::SIDES;

impl GearboxFit {
    /// Writes the bounds of the car and of the elements that slipped in a fitted shift; the others keep theirs.
    pub(super) fn write_budget(
        &self,
        text: &mut Written,
        car: &Car,
        checked: Option<&HeldOut>,
    ) -> Result<(), FitError> {
        let given = ErrorBudget::of_car(car);
        // The filter takes these as the edge of a uniform distribution.
        let edge = |sd: f64| 3.0_f64.sqrt() * sd;
        let comment = "what the fit leaves open: the edge of a uniform distribution of the stated deviation";
        if car.converter.is_some() {
            let fraction = edge(self.input_sd()).min(given.converter);
            text.put(&["error_bounds"], "converter_share", &number(fraction), comment)?;
        }
        if self.is_identifiable(Quantity::Mass) {
            let fraction = edge(self.sd(Quantity::Mass));
            text.put(&["error_bounds"], "mass_share", &number(fraction), comment)?;
        }
        if let Some(wheel) = self.wheel.as_ref().ok().filter(|wheel| wheel.tells_stiffness()) {
            let fraction = edge(wheel.stiffness.sd).min(given.stiffness);
            text.put(&["error_bounds"], "shaft_stiffness_share", &number(fraction), comment)?;
        }
        // One number for all shifts: that of the pair of gears that is known least.
        let inertias = (0..self.quantities.pairs.len()).map(|at| edge(self.sd(Quantity::Inertia(at))));
        let fraction = inertias.fold(0.0, f64::max).min(given.inertia);
        text.put(&["error_bounds"], "inertia_share", &number(fraction), comment)?;
        // Without a check the scale of an earlier fit is not that of this one.
        let unchecked =
            car.error_bounds.valve_error_scale.map(|_| (1.0, "not checked on shifts that were held out".to_owned()));
        let scale = checked.map(|checked| (checked.valve_error_scale, checked.comment())).or(unchecked);
        if let Some((scale, comment)) = scale {
            text.put(&["error_bounds"], "valve_error_scale", &number(scale), &comment)?;
        }
        for (place, name) in self.quantities.elements.iter().enumerate() {
            let element = car.gearbox.elements.iter().position(|element| element.name == *name);
            let seen = element.filter(|_| self.elements_seen[place]);
            if let Some((errors, known)) = seen.and_then(|at| given.element(at).zip(car.clutches[at].as_ref())) {
                self.write_element_budget(text, errors, known, place)?;
            }
        }
        Ok(())
    }

    fn write_element_budget(
        &self,
        text: &mut Written,
        given: &ElementErrors,
        known: &ShiftClutch,
        place: usize,
    ) -> Result<(), FitError> {
        let [friction, gain] = match self.quantities.measured[place] {
            true => [
                factors(self.friction_sd(place), self.friction_factor(place), given.friction_factor),
                factors(self.sd(Quantity::Gain(place)), self.gain_factor(place), given.valve_gain_factor),
            ],
            false => self.unidentified_friction_and_gain(place, [given.friction_factor, given.valve_gain_factor]),
        };
        let lag = Quantity::Lag(place);
        let lag = factors(self.sd(lag), Real::exp(self.unknown(lag)), given.valve_lag_factor);
        let delay_s = self.delay_s(known, place, given.valve_delay_s);
        let table = ["clutch", self.quantities.elements[place].as_str(), "error_bounds"];
        let all = [
            ("friction_factor", friction),
            ("valve_gain_factor", gain),
            ("valve_lag_factor", lag),
            ("valve_delay_s", delay_s),
        ];
        all.iter().try_for_each(|(key, range)| text.put(&table, key, &list(range), BUDGET_COMMENT))
    }

    /// Minimum and maximum delay of a valve, s: that of the fitted file over its commands, with what the fit leaves open of it and no more
    /// than was known before; the 95 % interval of their middle stays.
    fn delay_s(&self, known: &ShiftClutch, place: usize, given: [f64; 2]) -> [f64; 2] {
        let quantity = Quantity::Delay(place);
        let (late_s, sd_s) = (DELAY_UNIT_S * self.unknown(quantity), DELAY_UNIT_S * self.sd(quantity));
        let of_file = known.valve.delay_range().map(|delay_s| (delay_s + late_s).max(0.0));
        let middle = 0.5 * (of_file[0] + of_file[1]);
        let [minimum, maximum] = delays(of_file, BUDGET_SIDES * sd_s);
        let known = delays([given[0].min(middle - SIDES * sd_s), given[1].max(middle + SIDES * sd_s)], 0.0);
        // The file is within its own bounds.
        [minimum.max(known[0]).min(of_file[0]), maximum.min(known[1]).max(of_file[1])]
    }

    /// Ranges of friction and valve gain where only their product is identified, beside the file that has the product as friction: what the product
    /// leaves of one where the other is anywhere in its range, and no more than was known before. Both contain 1, so that the range of the
    /// torque contains that of the file.
    fn unidentified_friction_and_gain(&self, place: usize, [friction, gain]: [[f64; 2]; 2]) -> [[f64; 2]; 2] {
        let torque = Quantity::Torque(place);
        let value = Real::exp(self.unknown(torque));
        let product = factors(self.sd(torque), value, [friction[0] * gain[0], friction[1] * gain[1]]);
        let both = |minimum: [f64; 2], maximum: [f64; 2]| {
            [minimum[0].max(minimum[1]).min(1.0), maximum[0].min(maximum[1]).max(1.0)]
        };
        [
            both([product[0] / gain[1], friction[0] / value], [product[1] / gain[0], friction[1] / value]),
            both([value * product[0] / friction[1], gain[0]], [value * product[1] / friction[0], gain[1]]),
        ]
    }
}
