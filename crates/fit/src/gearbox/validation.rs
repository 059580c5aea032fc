//! Shifts that were not fitted, with the given and with the fitted vehicle file.

use config::Car;
use design::ShiftTables;

use super::fitting::GearboxFit;
use super::shift::ShiftModel;
use super::shift_log::ShiftLog;

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
        if !self.at_limit.is_empty() {
            return Some(format!("at the end of what is held possible: {}", self.at_limit.join(", ")));
        }
        let checked = checked?;
        let [given, fitted] = checked.turbine_rad_s;
        // An error that is not a number counts against the fit.
        let is_better = fitted < given;
        (!is_better).then(|| {
            format!(
                "on {} shifts that were held out the turbine speed is off by {given:.2} rad/s with the given file and by {fitted:.2} with the \
                 fitted one",
                checked.shifts
            )
        })
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
