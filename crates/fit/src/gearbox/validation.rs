//! Shifts that were not fitted, with the given and with the fitted vehicle file.

use config::Car;
use design::ShiftTables;

use super::fitting::GearboxFit;
use super::shift::ShiftModel;
use super::shift_log::ShiftLog;
use crate::validation::reason_to_keep;

/// Errors over shifts that were held out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeldOut {
    /// How many.
    pub shifts: usize,
    /// Mean over the shifts of the RMS error of the turbine speed, rad/s, as torques and inertia of the given and of the fitted file make it
    /// run from its mean while both clutches slip.
    pub turbine_rad_s: [f64; 2],
    /// In how many of them the fitted file is the better one.
    pub better: usize,
}

impl GearboxFit {
    /// Why the fitted file is not to be used in place of the given one, if so.
    pub fn reason_against(&self, checked: Option<&HeldOut>) -> Option<String> {
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
        let errors = |(car, tables): (&Car, &ShiftTables<f64>), log: &ShiftLog| {
            let model = ShiftModel::new(car, tables, &self.quantities, log)?;
            let residuals = model.linearised(&self.quantities, &vec![0.0; self.unknowns.len()]).residuals;
            let mean = residuals.mean();
            Some((residuals.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / residuals.len() as f64).sqrt())
        };
        let pairs: Vec<[f64; 2]> =
            held_out.iter().filter_map(|log| Some([errors(given, log)?, errors(fitted, log)?])).collect();
        if pairs.is_empty() {
            return None;
        }
        let mean = |which: usize| pairs.iter().map(|pair| pair[which]).sum::<f64>() / pairs.len() as f64;
        Some(HeldOut {
            shifts: pairs.len(),
            turbine_rad_s: [mean(0), mean(1)],
            better: pairs.iter().filter(|[given, fitted]| fitted < given).count(),
        })
    }
}
