//! The fit of a vehicle to shifts.

use config::Vehicle;
use nalgebra::DVector;

use crate::car::Car;
use crate::freeing::Freed;
use crate::intervals::{self, Precision};
use crate::parameters::{self, Available, Prior};
use crate::record::OutputClock;
use crate::shape::Map;
use crate::shift_model::ShiftModel;
use crate::solver::{Problem, Solved, Unknowns};
use crate::weights::Weights;
use crate::{Channel, FitError, Parameter, ReadingAges, ShiftRecord, freeing};

/// More shifts only shrink what is below the floor of the intervals.
pub const SHIFTS_MAX: usize = 30;
/// So many shifts are fitted first; the others start from their result.
const FIRST_SHIFTS: usize = 5;

/// Iterations with new scales, and all of them, on these, and then on all shifts until near a minimum.
const FIRST_ITERATIONS: (u32, u32) = (3, 5);
const NEAR_ITERATIONS: (u32, u32) = (4, 5);

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
    /// Maps that were given another shape than that of the file, because the residuals ask for it.
    pub freed: Vec<Map>,
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
    let (shifts, mut left_out) = sound(shifts);
    if shifts.is_empty() {
        let reasons = left_out.iter().map(|reason| format!("\n{reason}")).collect::<String>();
        return Err(FitError::input(format!("there is no shift to fit{reasons}")));
    }
    let available = available(&shifts);
    let shafts = parameters::shafts(vehicle)?;
    let mut priors = parameters::priors(vehicle, &shafts, available);
    let untold_gain_sd = if available.pressure { None } else { hold_gain(&mut priors) };
    let file = Car::of_file(vehicle, ages);
    let problem = Problem { file: &file, shafts: &shafts, priors: &priors };
    let first = fit_some(&problem, &shifts, progress)?;
    // Now the delay of the output speed is known, and small slips of the offgoing clutch can be seen.
    let clock = OutputClock { delay_s: file.with(&shafts, &priors, &first.at.shared).output_delay_s, ages };
    let (models, unusable) = usable(vehicle, &file, &shifts, clock)?;
    left_out.extend(unusable);
    let at = Unknowns { shared: first.at.shared, own: models.iter().map(ShiftModel::start).collect() };
    let mut say = |iteration| progress(Progress { shifts: models.len(), iteration });
    let near = problem.solve(&models, at, first.weights, NEAR_ITERATIONS, &mut say)?;
    let before = near.at.shared.clone();
    let Freed { priors: all, solved, lines, freed } =
        freeing::with_freed_maps(vehicle, &file, &shafts, priors, &models, near, &mut say)?;
    let Solved { mut at, weights, is_converged } = solved;
    let problem = Problem { file: &file, shafts: &shafts, priors: &all };
    let known = all.len() - 2 * (file.knots.maps().len() - freed.len());
    // What is not freed is not known either: the intervals contain what it may be.
    let mut precision = intervals::precision(&problem, &models, &lines, &at, &weights, untold_gain_sd)?.of_first(known);
    let mut priors = all[..known].to_vec();
    release_gain(&mut priors, untold_gain_sd);
    at.shared.truncate(known);
    if !freed.is_empty() {
        precision.with_moved(&freeing::moved(&priors, &before, &at.shared), &priors);
    }
    let at_limit = priors.iter().zip(&at.shared).filter(|(prior, x)| prior.is_at_limit(**x));
    Ok(Fit {
        at_limit: at_limit.map(|(prior, _)| prior.name.clone()).collect(),
        unknowns: scaled_by_priors(&priors, at.shared),
        channels: channels(&models, &weights),
        precision,
        available,
        shifts: models.len(),
        unusable: left_out,
        is_converged,
        freed,
        weights,
        priors,
    })
}

/// The shifts without those that have readings which are no numbers, and without copies: a shift tells what it has to tell once.
fn sound(shifts: &[ShiftRecord]) -> (Vec<ShiftRecord>, Vec<String>) {
    let (mut sound, mut left_out): (Vec<ShiftRecord>, Vec<String>) = (Vec::new(), Vec::new());
    for record in shifts {
        let first = sound.iter().find(|other| other.engine == record.engine && other.turbine == record.turbine);
        if let Some(role) = record.not_finite() {
            left_out.push(format!("{}: readings of {role} are not finite numbers", record.name));
        } else if let Some(first) = first {
            left_out.push(format!("{}: the same readings as {}", record.name, first.name));
        } else {
            sound.push(record.clone());
        }
    }
    (sound, left_out)
}

/// A fit of a few of the shifts, from the vehicle file.
fn fit_some(
    problem: &Problem<'_>,
    shifts: &[ShiftRecord],
    progress: &mut dyn FnMut(Progress),
) -> Result<Solved, FitError> {
    let few: Vec<ShiftModel> =
        spread_over(shifts, FIRST_SHIFTS).map(|record| ShiftModel::new(record, problem.file)).collect();
    let shared: Vec<f64> = problem.priors.iter().map(|prior| prior.mean).collect();
    let start = Unknowns { shared, own: few.iter().map(ShiftModel::start).collect() };
    let mut say = |iteration| progress(Progress { shifts: few.len(), iteration });
    problem.solve(&few, start, Weights::START, FIRST_ITERATIONS, &mut say)
}

/// The shifts that can be used now that the clock of the output speed is known, and why the others cannot.
fn usable(
    vehicle: &Vehicle,
    file: &Car,
    shifts: &[ShiftRecord],
    clock: OutputClock,
) -> Result<(Vec<ShiftModel>, Vec<String>), FitError> {
    let (mut models, mut unusable) = (Vec::new(), Vec::new());
    for mut record in shifts.iter().cloned() {
        match record.find_by(&vehicle.shift, Some(clock)) {
            Ok(()) => models.push(ShiftModel::new(record, file)),
            Err(reason) => unusable.push(format!("{}: {reason}", record.name)),
        }
    }
    if models.is_empty() {
        return Err(FitError::input(format!("no shift can be used\n{}", unusable.join("\n"))));
    }
    Ok((models, unusable))
}

/// Scale and gain of the channels that the shifts have.
fn channels(models: &[ShiftModel], weights: &Weights) -> Vec<(Channel, f64, f64)> {
    let has = |channel| models.iter().any(|model| model.blocks.iter().any(|block| block.channel == channel));
    let channels = Channel::ALL.into_iter().filter(|channel| has(*channel));
    channels.map(|c| (c, weights.scale[c as usize], weights.gain[c as usize])).collect()
}

/// Without a pressure the gain of the valve cannot be told: what speeds seem to say of it rests on the shape of the lag over pressure. It
/// stays near that of the file, and the intervals get back what was known of it, which is returned.
fn hold_gain(priors: &mut [Prior]) -> Option<f64> {
    /// Share of its standard deviation in which it is held; none would make it a constant, with which nothing is correlated.
    const HELD_SHARE: f64 = 0.1;
    let gain = priors.iter_mut().find(|prior| prior.parameter == Parameter::Gain)?;
    let sd = gain.sd;
    gain.sd *= HELD_SHARE;
    Some(sd)
}

/// Gives the gain back what was known of it.
fn release_gain(priors: &mut [Prior], sd: Option<f64>) {
    for prior in priors.iter_mut().filter(|prior| prior.parameter == Parameter::Gain) {
        prior.sd = sd.unwrap_or(prior.sd);
    }
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
pub(crate) fn scaled_by_priors(priors: &[Prior], unknowns: Vec<f64>) -> Vec<f64> {
    let (weights, _) = intervals::torque_scale(priors);
    let off: f64 = (priors.iter().zip(&unknowns).zip(weights.iter())).map(|((p, x), w)| w * (x - p.mean)).sum();
    (priors.iter().zip(unknowns)).map(|(prior, x)| x - off * prior.parameter.power_of_torque()).collect()
}
