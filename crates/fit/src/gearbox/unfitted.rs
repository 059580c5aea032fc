//! What a fit takes from the file of the way to a pressure, and what its error does to the quantities.
//!
//! Delays of the channels are fitted or found before, here is what stays. Hysteresis of a valve and volume of a piston's stroke are not fitted: the speeds hardly show them, and what they seem to say of a hysteresis comes
//! from the noise of the command. An error of one standard deviation changes the gradients at the minimum, and the step of the fit by that
//! change is what it does to the quantities: `H^-1 (s(file + std_dev) - s(file))`. The standard deviation is taken whole, not as a
//! derivative: the noise of a command hides a small hysteresis.
//!
//! Of a hysteresis this is not all. Rising pressures are too low by it and falling ones too high, and where an element has both, the model of the fit
//! makes less of it for the kiss point; but the model follows a command with noise, whose play is narrower than that of the true one. So the
//! kiss point, a pressure, has at least the standard deviation of the hysteresis itself.

use car::Car;
use car::ErrorBudget;
use drivetrain::Real;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use observer::ShiftTables;

use super::quantities::{KISS_UNIT_PA, Quantity};
use super::shift::ShiftModel;
use super::solver::{Problem, Solved};
use crate::fill::fill_sd;
use crate::pressure::Hydraulics;

/// What may be off by one standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Error {
    /// The logarithm of the volume of the stroke.
    Stroke(f64),
    /// The half-width of the hysteresis, Pa.
    Hysteresis(f64),
}

/// What is not fitted of an element.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Unfitted {
    /// The place of the element in the tables.
    place: usize,
    error: Error,
}

impl Unfitted {
    /// All of a car within its error bounds.
    pub(crate) fn of(car: &Car, tables: &ShiftTables<f64>) -> Vec<Self> {
        let (mut all, budget) = (Vec::new(), ErrorBudget::of_car(car));
        for (element, clutch) in car.clutches.iter().enumerate() {
            let (Some(place), Some(clutch)) = (tables.place(element), clutch) else { continue };
            if let Some(fill) = clutch.standard_fill_budget(car.oil_temperature_degc) {
                all.push(Self { place, error: Error::Stroke(fill_sd(&clutch.cylinder, &fill)) });
            }
            let max_pa = budget.element(element).map_or(clutch.hysteresis_pa, |errors| errors.valve_hysteresis_pa);
            let std_dev_pa = std_dev_of_width(clutch.hysteresis_pa, max_pa);
            if std_dev_pa > 0.0 {
                all.push(Self { place, error: Error::Hysteresis(std_dev_pa) });
            }
        }
        all
    }

    /// Adds to the covariance of the unknowns at the end of a fit what an error of one standard deviation does.
    pub(crate) fn add_to(
        &self,
        covariance: &mut DMatrix<f64>,
        problem: &Problem<'_>,
        models: &[ShiftModel],
        solved: &Solved,
        curvature: &Cholesky<f64, Dyn>,
    ) {
        let mut change = DVector::zeros(solved.point.at.len());
        let mut is_seen = false;
        for (model, shift) in models.iter().zip(&solved.point.shifts) {
            if let Some(other) = model.with_hydraulics(self.place, |of| self.change(of)) {
                change += problem.score(&other, &solved.point.at, solved.weights) - &shift.score;
                is_seen = true;
            }
        }
        let moved = curvature.solve(&change);
        *covariance += &moved * moved.transpose();
        if let (Error::Hysteresis(more_pa), Some(kiss), true) =
            (self.error, problem.quantities.place(Quantity::Kiss(self.place)), is_seen)
        {
            let minimum = more_pa / KISS_UNIT_PA;
            covariance[(kiss, kiss)] += (minimum * minimum - moved[kiss] * moved[kiss]).max(0.0);
        }
    }

    fn change(&self, of: &mut Hydraulics) {
        match self.error {
            Error::Stroke(log_factor) => of.scale_stroke(Real::exp(log_factor)),
            Error::Hysteresis(more_pa) => of.hysteresis_pa += more_pa,
        }
    }
}

/// Standard deviation from the width of the file of one that is anywhere between none and the maximum, Pa.
fn std_dev_of_width(file_pa: f64, max_pa: f64) -> f64 {
    if max_pa <= 0.0 {
        return 0.0;
    }
    let square = (Real::powi((max_pa - file_pa).max(0.0), 3) + Real::powi(file_pa, 3)) / (3.0 * max_pa.max(file_pa));
    square.sqrt()
}
