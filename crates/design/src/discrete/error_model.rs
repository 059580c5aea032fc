//! The error system of a designed gain, for other tools: matrices with names and units.

use car::Vehicle;
use nalgebra::{DMatrix, DVector};
use observer::Phase;
use serde::Serialize;

use super::DiscreteCertificate;
use super::system::{Corner, ErrorSystem, READINGS, state_units};
use crate::Model;

/// How the error of an estimate follows from its causes at a corner of the polytope, from sample to sample:
///
/// ```text
/// x+ = A x + B w,    e = C x + D w
/// ```
///
/// Each cause `w` is one at its bound of the error budget, with either sign; `e` is the error of the estimate, and `x` differs from it by what the last
/// reading adds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ErrorModel {
    /// The corner: friction coefficient and lag of the valve.
    pub label: String,
    /// Friction coefficient.
    pub friction: f64,
    /// Names of the states and of the errors, each of which ends in its unit: the pressure is the last.
    pub states: &'static [&'static str],
    /// Names of the causes; a cause that acts in several ways is there for each.
    pub causes: Vec<&'static str>,
    /// `A`, by rows.
    pub a: Vec<Vec<f64>>,
    /// `B`, by rows, in the units of the states.
    pub b: Vec<Vec<f64>>,
    /// `C`, by rows.
    pub c: Vec<Vec<f64>>,
    /// `D`, by rows, in the units of the states.
    pub d: Vec<Vec<f64>>,
}

/// Names of the states, whose units are those of their names.
fn state_names(model: Model) -> &'static [&'static str] {
    match model {
        Model::Rigid => &["pressure_pa"],
        Model::Compliant => &["shaft_torque_n_m", "pressure_pa"],
    }
}

/// The error systems of a gain at the corners of its polytope.
pub fn error_models(vehicle: &Vehicle, phase: Phase, certificate: &DiscreteCertificate) -> Vec<ErrorModel> {
    let DiscreteCertificate { model, quantity, sample_time_s, .. } = *certificate;
    let system = ErrorSystem::of(vehicle, model, quantity, phase, sample_time_s);
    let matrix = |rows: &[Vec<f64>]| DMatrix::from_fn(rows.len(), system.h.nrows(), |i, j| rows[i][j]);
    let gains: Vec<DMatrix<f64>> = certificate.gains.iter().map(|at| matrix(&at.normalised)).collect();
    let units = DMatrix::from_diagonal(&DVector::from_column_slice(state_units(model)));
    let over_units = units.map(|unit| if unit == 0.0 { 0.0 } else { unit.recip() });
    let at_corner = |corner: &Corner| {
        let gain = system.gain_at(corner, &gains)?;
        let (causes, columns): (Vec<&'static str>, Vec<DVector<f64>>) =
            system.columns(corner, gain).into_iter().unzip();
        let states = system.states();
        let a = &units * corner.error_dynamics(gain) * &over_units;
        let b = &units * DMatrix::from_columns(&columns);
        // The readings are the first causes.
        let d = (&units * -gain * &system.readings).resize_horizontally(causes.len(), 0.0);
        Some(ErrorModel {
            label: corner.label.clone(),
            friction: corner.friction,
            states: state_names(model),
            causes,
            a: rows(&a),
            b: rows(&b),
            c: rows(&DMatrix::identity(states, states)),
            d: rows(&d),
        })
    };
    system.corners.iter().filter_map(at_corner).collect()
}

fn rows(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
}

impl ErrorSystem {
    /// The gain that an observer has at a corner: of a schedule, that of the corner's end.
    pub(super) fn gain_at<'g>(&self, corner: &Corner, gains: &'g [DMatrix<f64>]) -> Option<&'g DMatrix<f64>> {
        let least = self.corners.iter().map(|corner| corner.friction).fold(f64::INFINITY, f64::min);
        if corner.friction > least { gains.last() } else { gains.first() }
    }

    /// What each cause at its bound adds to the error from sample to sample at a corner, the readings first.
    pub(super) fn columns(&self, corner: &Corner, gain: &DMatrix<f64>) -> Vec<(&'static str, DVector<f64>)> {
        let a = corner.error_dynamics(gain);
        let of_readings = (DMatrix::identity(a.nrows(), a.ncols()) - &a) * gain * &self.readings;
        let of_readings = of_readings.column_iter().map(|column| (READINGS, column.into_owned()));
        let through = corner.through_gain.iter().map(|cause| (cause.name, -gain * &cause.column));
        let direct = corner.direct.iter().map(|cause| (cause.name, cause.column.clone()));
        of_readings.chain(through).chain(direct).collect()
    }
}

#[cfg(test)]
mod tests {
    use car::GainMethod;

    use super::*;
    use crate::{Quantity, design_discrete_phase};

    /// Largest sum over the causes of the error of the pressure that each of them can cause, Pa.
    fn worst_pa(models: &[ErrorModel]) -> f64 {
        let worst = |model: &ErrorModel| {
            let matrix = |rows: &[Vec<f64>]| DMatrix::from_fn(rows.len(), rows[0].len(), |i, j| rows[i][j]);
            let [a, b, c, d] = [&model.a, &model.b, &model.c, &model.d].map(|rows| matrix(rows));
            let last = c.nrows() - 1;
            let mut sum: f64 = d.row(last).abs().sum();
            let mut response = c;
            for _ in 0..5000 {
                sum += (response.row(last) * &b).abs().sum();
                response *= &a;
            }
            sum
        };
        models.iter().map(worst).fold(0.0, f64::max)
    }

    #[test]
    fn the_error_systems_have_the_contributions_of_the_certificate_and_keep_its_bound() {
        let vehicle = config::VehicleFile::built_in().unwrap().vehicle;
        for model in [Model::Rigid, Model::Compliant] {
            for method in [GainMethod::PeakToPeak, GainMethod::Scheduled] {
                let phase = Phase::InertiaPhase;
                let certificate =
                    design_discrete_phase(&vehicle, model, method, Quantity::ClutchTorque, phase, 0.01).unwrap();
                let worst_pa = worst_pa(&error_models(&vehicle, phase, &certificate));
                let contributed: f64 = certificate.contributions.iter().map(|part| part.bound_pa).sum();
                assert!((worst_pa / contributed - 1.0).abs() < 1e-6, "{worst_pa} {contributed}");
                assert!(worst_pa <= certificate.bound_pa, "{worst_pa} {}", certificate.bound_pa);
            }
        }
    }
}
