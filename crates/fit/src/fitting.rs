//! The fit of a vehicle to shifts.

use config::Vehicle;
use nalgebra::DVector;

use crate::car::Car;
use crate::intervals::{self, Precision};
use crate::parameters::{self, Available, Prior};
use crate::record::OutputClock;
use crate::shift_model::ShiftModel;
use crate::solver::{Problem, Solved, Unknowns};
use crate::weights::Weights;
use crate::{Channel, FitError, Parameter, ReadingAges, ShiftRecord};

/// More shifts only shrink what is below the floor of the intervals.
pub const SHIFTS_MAX: usize = 30;
/// So many shifts are fitted first; the others start from their result.
const FIRST_SHIFTS: usize = 5;

/// A fitted vehicle.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The parameters and what was known of them.
    pub priors: Vec<Prior>,
    /// Their unknowns.
    pub unknowns: Vec<f64>,
    /// What is known of them now.
    pub precision: Precision,
    /// What the logs have.
    pub available: Available,
    /// How many shifts were fitted.
    pub shifts: usize,
    /// Shifts that could not be used, each with the reason.
    pub unusable: Vec<String>,
    /// One-step scale of each channel, and its gain `g`; zero for a channel without readings.
    pub channels: Vec<(Channel, f64, f64)>,
    /// Whether the last step was small; otherwise the iterations were used up.
    pub is_converged: bool,
    /// Names of the parameters that ended where nothing beyond is held possible.
    pub at_limit: Vec<String>,
    pub(crate) weights: Weights,
}

/// How far a fit is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Shifts in this stage.
    pub shifts: usize,
    /// Iteration, from 0.
    pub iteration: u32,
}

/// What the shifts have besides speeds and commands.
pub fn available(shifts: &[ShiftRecord]) -> Available {
    let some = |has: fn(&ShiftRecord) -> bool| shifts.iter().any(has);
    Available {
        wheel: some(|shift| !shift.wheel.is_empty()),
        pressure: some(|shift| !shift.pressure.is_empty()),
        engine_torque: some(|shift| !shift.engine_torque.is_empty()),
        offgoing: some(|shift| !shift.offgoing.is_empty()),
    }
}

/// Refuses a vehicle whose oncoming clutch the model of the fit leaves out.
///
/// # Errors
/// The piston of the oncoming clutch has a stroke.
pub fn check_vehicle(vehicle: &Vehicle) -> Result<(), FitError> {
    if vehicle.oncoming.has_stroke {
        return Err(FitError::input(format!(
            "{}: the piston of the oncoming clutch has a stroke, which the fit does not model\n\
             hint: set `enabled = false` in its `fill` table for the fit; a fill that has ended before the torque phase changes little",
            vehicle.source.path.display()
        )));
    }
    Ok(())
}

/// Fits the parameters of a vehicle to shifts.
///
/// # Errors
/// There is no shift, the vehicle cannot be fitted, or no minimum was found.
pub fn fit(
    vehicle: &Vehicle,
    shifts: &[ShiftRecord],
    ages: ReadingAges,
    progress: &mut dyn FnMut(Progress),
) -> Result<Fit, FitError> {
    check_vehicle(vehicle)?;
    if shifts.is_empty() {
        return Err(FitError::input("there is no shift to fit"));
    }
    let available = available(shifts);
    let shafts = parameters::shafts(vehicle)?;
    let priors = parameters::priors(vehicle, &shafts, available);
    let file = Car::of_file(vehicle, ages);
    let problem = Problem { file: &file, shafts: &shafts, priors: &priors };
    let few: Vec<ShiftModel> = spread_over(shifts, FIRST_SHIFTS).map(|record| ShiftModel::new(record, &file)).collect();
    let shared: Vec<f64> = priors.iter().map(|prior| prior.mean).collect();
    let start = Unknowns { shared, own: few.iter().map(ShiftModel::start).collect() };
    let mut say = |iteration| progress(Progress { shifts: few.len(), iteration });
    let Solved { at: first, weights, .. } = problem.solve(&few, start, Weights::START, (3, 5), &mut say)?;
    // Now the delay of the output speed is known, and small slips of the offgoing clutch can be seen.
    let clock = OutputClock { delay_s: file.with(&shafts, &priors, &first.shared).output_delay_s, ages };
    let mut unusable = Vec::new();
    let mut models = Vec::new();
    for mut record in shifts.iter().cloned() {
        match record.find_by(&vehicle.shift, Some(clock)) {
            Ok(()) => models.push(ShiftModel::new(record, &file)),
            Err(reason) => unusable.push(format!("{}: {reason}", record.name)),
        }
    }
    if models.is_empty() {
        return Err(FitError::input(format!("no shift can be used\n{}", unusable.join("\n"))));
    }
    let at = Unknowns { shared: first.shared, own: models.iter().map(ShiftModel::start).collect() };
    let mut say = |iteration| progress(Progress { shifts: models.len(), iteration });
    let Solved { at, weights, is_converged } = problem.solve(&models, at, weights, (4, 12), &mut say)?;
    let precision = intervals::precision(&problem, &models, &at, &weights, available.pressure)?;
    let at_limit = priors.iter().zip(&at.shared).filter(|(prior, x)| prior.is_at_limit(**x));
    let at_limit = at_limit.map(|(prior, _)| prior.name.clone()).collect();
    let unknowns = scaled_by_priors(&priors, at.shared);
    let has = |channel| models.iter().any(|model| model.blocks.iter().any(|block| block.channel == channel));
    let channels = Channel::ALL.into_iter().filter(|channel| has(*channel));
    let channels = channels.map(|c| (c, weights.scale[c as usize], weights.gain[c as usize])).collect();
    Ok(Fit {
        unknowns,
        precision,
        available,
        shifts: models.len(),
        unusable,
        channels,
        is_converged,
        at_limit,
        weights,
        priors,
    })
}

/// At most so many of the shifts, evenly over all.
fn spread_over(shifts: &[ShiftRecord], most: usize) -> impl Iterator<Item = ShiftRecord> + '_ {
    let count = most.min(shifts.len());
    (0..count).map(move |i| shifts[i * shifts.len() / count].clone())
}

impl Fit {
    /// Place of a parameter.
    pub fn place(&self, parameter: Parameter) -> Option<usize> {
        self.priors.iter().position(|prior| prior.parameter == parameter)
    }

    /// The value of a parameter in its own unit: a factor, a delay in s, or a relative change.
    pub fn value(&self, parameter: Parameter) -> Option<f64> {
        self.place(parameter).map(|i| parameter.value(self.unknowns[i]))
    }

    /// Standard deviation of the unknown of a parameter as it is stated.
    pub fn sd(&self, parameter: Parameter) -> Option<f64> {
        self.place(parameter).map(|i| self.precision.stated[(i, i)].sqrt())
    }

    /// Standard deviation of the logarithm of a product of powers of factors: what is known before, and now.
    pub fn combination_sd(&self, powers: &[(Parameter, f64)]) -> [f64; 2] {
        let mut along = DVector::zeros(self.priors.len());
        for (parameter, power) in powers {
            if let Some(i) = self.place(*parameter) {
                along[i] = *power;
            }
        }
        let before: f64 = along.iter().zip(&self.priors).map(|(power, prior)| (power * prior.sd).powi(2)).sum();
        [before.sqrt(), self.precision.combination_sd(&along)]
    }

    /// Standard deviation of the logarithm of the factor that all torques have in common.
    pub fn torque_scale_sd(&self) -> f64 {
        intervals::torque_scale(&self.priors).1.sqrt().recip()
    }
}

/// Moves the unknowns along the factor of all torques to where the priors want it. What data seem to say of it rests on
/// loads that the file takes as exact, see [`intervals`].
fn scaled_by_priors(priors: &[Prior], unknowns: Vec<f64>) -> Vec<f64> {
    let (weights, _) = intervals::torque_scale(priors);
    let off: f64 = (priors.iter().zip(&unknowns).zip(weights.iter())).map(|((p, x), w)| w * (x - p.mean)).sum();
    (priors.iter().zip(unknowns)).map(|(prior, x)| x - off * prior.parameter.power_of_torque()).collect()
}
