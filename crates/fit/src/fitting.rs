//! The fit of a vehicle to shifts.

use std::ops::ControlFlow;

use car::{Shaft, Vehicle};
use drivetrain::Real;
use nalgebra::DVector;

use crate::car::Car;
use crate::drives::{DriveErrors, Drives, UsedDriving, driven_car};
use crate::driving::{BacklashFit, Driving, fit_backlash};
use crate::fill::{FillFit, FillLog, Filling};
use crate::freeing::Misfit;
use crate::intervals::{self, Precision};
use crate::least_squares::Iterations;
use crate::parameters::{self, Available, DELAY_UNIT_S, Held, OFFSET_UNIT_PA, Prior};
use crate::pressure::Hydraulics;
use crate::record::OutputClock;
use crate::shape::Map;
use crate::shift_model::ShiftModel;
use crate::shift_weights::ShiftWeights;
use crate::solver::{Problem, Solved, Unknowns};
use crate::torque_change::TorqueChange;
use crate::{Channel, FitError, Given, OneStep, Parameter, ReadingAges, ShiftRecord, freeing};

/// More shifts only shrink what is below the floor of the intervals.
pub const SHIFTS_MAX: usize = 30;
/// So many shifts are fitted first, with the shapes of the file; the others start from their result. So few do not tell the shapes: with these
/// free, the first steps led to another minimum in some cars, with another friction and spring and much higher cost.
const FIRST_SHIFTS: usize = 5;

/// On these; on all shifts, with all shapes free; and with those bound that the shifts do not ask for.
const FIRST: Iterations = Iterations { reweighted: 3, maximum: 5, decrease: 0.5 };
const FREE: Iterations = Iterations { reweighted: 3, maximum: 14, decrease: 0.5 };
const BOUND: Iterations = Iterations { reweighted: 1, maximum: 14, decrease: DECREASE };
/// That with which a fit ends.
pub(crate) const DECREASE: f64 = 0.1;

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
    /// Time of driving between shifts that was fitted, s.
    pub driving_s: f64,
    /// Why driving of a log is not fitted.
    pub driving_left_out: Vec<String>,
    /// The backlash of the driveline, or what the logs lack for it.
    pub backlash: Result<BacklashFit, String>,
    /// One-step errors of each channel that has readings.
    pub channels: Vec<(Channel, OneStep)>,
    /// Whether the last step was small; otherwise the iterations were used up.
    pub is_converged: bool,
    /// Names of the parameters that ended where nothing beyond is held possible.
    pub at_limit: Vec<String>,
    /// Maps that were given another shape than that of the file, because the shifts ask for it.
    pub freed: Vec<Map>,
    /// Maps whose shape the shifts ask to be finer than the fit can give it, so much that it would move a value out of its interval: a misfit that
    /// stays.
    pub misfits: Vec<Map>,
    /// What the fit changes of the torque of the oncoming clutch in these shifts.
    pub torque_change: TorqueChange,
    /// The fill volume of the oncoming clutch; none where its piston has no stroke.
    pub fill: Option<FillFit>,
    pub(crate) weights: ShiftWeights,
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
        driving: false,
    }
}

/// Fits the parameters of a vehicle to shifts, and to the driving between them, of each log.
///
/// # Errors
/// There is no shift, or no minimum was found.
pub fn fit(
    given: &Given,
    shifts: &[ShiftRecord],
    driving: &[Driving],
    ages: ReadingAges,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Fit, FitError> {
    let (shifts, left_out) = sound(shifts)?;
    let Given { vehicle, shafts, .. } = given;
    let driven = driven_car(vehicle, shafts);
    let mut used = UsedDriving::of(&driven, driving);
    loop {
        let drives = Drives::of(&driven, &used);
        let (mut fit, errors) = fit_with(vehicle, (&shifts, shafts), &drives, ages, progress)?;
        if used.leave_out(&errors) {
            continue;
        }
        fit.unusable = [left_out, fit.unusable].concat();
        fit.driving_s = used.time_s();
        fit.backlash = fit_backlash(&driven, driving.iter().filter(|log| !used.is_of_other_car(log)));
        fit.driving_left_out = used.left_out;
        return Ok(fit);
    }
}

/// The fit to shifts and drives, and how far the drives are from what is expected.
fn fit_with(
    vehicle: &Vehicle,
    (shifts, shafts): (&[ShiftRecord], &[Shaft]),
    drives: &Drives<'_>,
    ages: ReadingAges,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<(Fit, Vec<DriveErrors>), FitError> {
    let available = Available { driving: !drives.start().is_empty(), ..available(shifts) };
    let file = Car::of_file(vehicle, ages);
    let bound = parameters::priors(vehicle, shafts, available);
    let with_shapes = |freed: &[Map]| {
        let mut priors = parameters::with_shapes(vehicle, &file.knots, &bound, freed);
        let held = if available.pressure { Vec::new() } else { hold(&mut priors) };
        (priors, held)
    };
    let (few, _) = with_shapes(&[]);
    let first = fit_some(&Problem { file: &file, shafts, priors: &few, drives }, shifts, progress)?;
    // Now the delay of the output speed is known, and small slips of the offgoing clutch can be seen.
    let clock = OutputClock { delay_s: file.with(shafts, &few, &first.at.shared).output_delay_s, ages };
    let (models, unusable) = usable(vehicle, &file, shifts, clock)?;
    let own = models.iter().map(ShiftModel::start).collect();
    let (free, all_held) = with_shapes(file.knots.maps());
    let problem = Problem { file: &file, shafts, priors: &free, drives };
    let at = Unknowns { own, shared: taken_over(&few, &first.at.shared, &free), ..first.at };
    let mut say = |iteration| progress(Progress { shifts: models.len(), iteration });
    let solved = problem.solve(&models, at, first.weights, FREE, &mut say)?;
    let freed = freed(&problem, &solved, &all_held)?;
    let (mut priors, held) = with_shapes(&freed);
    let problem = Problem { file: &file, shafts, priors: &priors, drives };
    let at = Unknowns { shared: taken_over(&free, &solved.at.shared, &priors), ..solved.at };
    let solved = problem.solve(&models, at, solved.weights, BOUND, &mut say)?;
    let (mut precision, misfits) = found(vehicle, &problem, &models, &solved, &all_held)?;
    release(&mut priors, &held);
    misfits.iter().for_each(|misfit| precision.with_move(&misfit.moves, &priors));
    let errors = drives.errors(&priors, solved.at.of_driving(), &solved.weights.drives);
    let Solved { at, weights, is_converged, .. } = solved;
    let limited: Vec<usize> = (0..priors.len()).filter(|i| priors[*i].is_at_limit(at.shared[*i])).collect();
    if !limited.is_empty() {
        // The model is not that of the car, and nothing is known better than before.
        precision.forget_all(&priors);
    }
    let unknowns = scaled_by_priors(&priors, at.shared);
    let fill = fill_of(vehicle, &file.with(shafts, &priors, &unknowns), &models, &|parameter| {
        let place = priors.iter().position(|prior| prior.parameter == parameter)?;
        Some(precision.stated[(place, place)].sqrt())
    });
    let torque_change = TorqueChange::of(&file, shafts, &models, &priors, &unknowns, &precision);
    let fit = Fit {
        at_limit: limited.into_iter().map(|i| priors[i].name.clone()).collect(),
        channels: channels(&models, &weights),
        unknowns,
        precision,
        available,
        shifts: models.len(),
        unusable,
        driving_s: 0.0,
        driving_left_out: Vec::new(),
        backlash: Err(String::new()),
        is_converged,
        freed,
        misfits: grave(&misfits),
        torque_change,
        fill,
        weights,
        priors,
    };
    Ok((fit, errors))
}

/// The maps whose shape stays free after a fit with all shapes free.
fn freed(problem: &Problem<'_>, solved: &Solved, held: &[Held]) -> Result<Vec<Map>, FitError> {
    // Near a minimum the derivatives of the last step are those of its end.
    // What is held of a shape is no reason to free it.
    let of_maps: Vec<Held> = held.iter().copied().filter(|held| !held.parameter.is_shape()).collect();
    let precision =
        intervals::precision(problem.priors, &solved.normal.information, &solved.normal.all_scores(), &of_maps)
            .ok_or_else(singular)?;
    Ok(freeing::differing(problem.priors, &solved.at.shared, &precision.stated, solved.at.own.len()))
}

/// What is known of the unknowns at a minimum, and which shapes that are not fitted the shifts ask for. What is not fitted of the shapes is not known
/// either: the intervals contain what it may be.
fn found(
    vehicle: &Vehicle,
    problem: &Problem<'_>,
    models: &[ShiftModel],
    solved: &Solved,
    held: &[Held],
) -> Result<(Precision, Vec<Misfit>), FitError> {
    let knots = &problem.file.knots;
    let known = problem.priors.len();
    let is_free = |map: Map| problem.priors.iter().any(|prior| prior.parameter == map.parameters()[0]);
    let bound = knots.maps().iter().filter(|map| !is_free(**map)).map(|map| (*map, [0, 1]));
    let finer = knots.maps().iter().flat_map(|map| map.finer().iter().map(move |pair| (*map, *pair)));
    let pairs: Vec<(Map, [usize; 2])> = bound.chain(finer).collect();
    let shapes = pairs.iter().flat_map(|(map, pair)| parameters::shape_priors(vehicle, knots, *map, pair));
    let all: Vec<Prior> = problem.priors.iter().cloned().chain(shapes).collect();
    let mut at = solved.at.clone();
    at.shared.resize(all.len(), 0.0);
    let problem = Problem { priors: &all, ..*problem };
    let lines = problem.linearised(models, &at);
    let normal = problem.normal(models, &lines, &at, &solved.weights)?;
    let precision = intervals::precision(&all, &normal.information, &normal.all_scores(), held)
        .ok_or_else(singular)?
        .of_first(known);
    let maps: Vec<Map> = pairs.into_iter().map(|(map, _)| map).collect();
    let misfits = freeing::misfits(&all, &precision.stated, known, &maps, &normal, &at.shared).ok_or_else(singular)?;
    Ok((precision, misfits))
}

/// The fill volume of the oncoming clutch by the measured pressures of a fitted car, with the standard deviations of its parameters.
fn fill_of(
    vehicle: &Vehicle,
    car: &Car,
    models: &[ShiftModel],
    sd: &dyn Fn(Parameter) -> Option<f64>,
) -> Option<FillFit> {
    let (cylinder, budget) = (car.cylinder?, vehicle.error_bounds.fill.as_ref()?);
    let logs: Vec<FillLog<'_>> = models.iter().filter_map(ShiftModel::fill_log).collect();
    let filling = Filling {
        hydraulics: Hydraulics { cylinder: Some(cylinder), ..car.hydraulics },
        kiss_pa: car.clutch.kiss_pressure(),
        late_s: car.command_delay_s,
        sensor_scale: car.pressure_scale,
        sensor_offset_pa: car.pressure_offset_pa,
        sensor_late_s: car.pressure_delay_s,
    };
    let known = |parameter: Parameter| sd(parameter).unwrap_or(0.0);
    let [spring, gain, lag] = [Parameter::Spring, Parameter::Gain, Parameter::Lag].map(known);
    let late_s = Real::hypot(known(Parameter::CommandDelay), known(Parameter::PressureDelay)) * DELAY_UNIT_S;
    let moved = [
        Filling { kiss_pa: filling.kiss_pa * Real::exp(spring), ..filling },
        Filling { hydraulics: filling.hydraulics.with_valve(0.0, gain), ..filling },
        Filling { hydraulics: filling.hydraulics.with_valve(lag, 0.0), ..filling },
        Filling { late_s: filling.late_s + late_s, ..filling },
        Filling {
            sensor_offset_pa: filling.sensor_offset_pa + OFFSET_UNIT_PA * known(Parameter::PressureOffset),
            ..filling
        },
    ];
    Some(FillFit::of(&logs, &filling, &moved, budget))
}

/// The maps with a misfit that is worth a warning.
fn grave(misfits: &[Misfit]) -> Vec<Map> {
    let is_grave = |map: &Map| misfits.iter().any(|misfit| misfit.map == *map && misfit.is_grave);
    Map::ALL.into_iter().filter(is_grave).collect()
}

fn singular() -> FitError {
    FitError::Work("the information of the shifts is not finite\nhint: check units and signs of the channels, and the values of the vehicle file".to_owned())
}

/// Unknowns of some parameters by those of others.
fn taken_over(from: &[Prior], unknowns: &[f64], to: &[Prior]) -> Vec<f64> {
    let of = |prior: &Prior| from.iter().position(|other| other.parameter == prior.parameter).map(|i| unknowns[i]);
    to.iter().map(|prior| of(prior).unwrap_or(prior.mean)).collect()
}

/// The shifts without those that have readings which are no numbers, and without copies: a shift tells what it has to tell once.
///
/// # Errors
/// None is left.
fn sound(shifts: &[ShiftRecord]) -> Result<(Vec<ShiftRecord>, Vec<String>), FitError> {
    let (mut sound, mut left_out): (Vec<ShiftRecord>, Vec<String>) = (Vec::new(), Vec::new());
    for record in shifts {
        let first = record.copied_from(&sound);
        if let Some(role) = record.not_finite() {
            left_out.push(format!("{}: readings of {role} are not finite numbers", record.name));
        } else if let Some(first) = first {
            left_out.push(format!("{}: the same readings as {}", record.name, first.name));
        } else {
            sound.push(record.clone());
        }
    }
    if sound.is_empty() {
        let reasons = left_out.iter().map(|reason| format!("\n{reason}")).collect::<String>();
        return Err(FitError::input(format!("there is no shift to fit{reasons}")));
    }
    Ok((sound, left_out))
}

/// A fit of a few of the shifts, from the vehicle file.
fn fit_some(
    problem: &Problem<'_>,
    shifts: &[ShiftRecord],
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Solved, FitError> {
    let few: Vec<ShiftModel> =
        spread_over(shifts, FIRST_SHIFTS).map(|record| ShiftModel::new(record, problem.file)).collect();
    let shared: Vec<f64> = problem.priors.iter().map(|prior| prior.mean).collect();
    let own = few.iter().map(ShiftModel::start).collect();
    let start = Unknowns { shared, own, drives: problem.drives.start() };
    let mut say = |iteration| progress(Progress { shifts: few.len(), iteration });
    problem.solve(&few, start, ShiftWeights::START, FIRST, &mut say)
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

/// One-step errors of the channels that the shifts have.
fn channels(models: &[ShiftModel], weights: &ShiftWeights) -> Vec<(Channel, OneStep)> {
    let has = |channel| models.iter().any(|model| model.blocks.iter().any(|block| block.channel == channel));
    let channels = Channel::ALL.into_iter().filter(|channel| has(*channel));
    channels.map(|channel| (channel, weights.of(channel).one_step())).collect()
}

/// Without a pressure the gain of the valve cannot be told, nor, apart from the spring, its gain at the kiss point: what speeds seem to say of
/// them rests on the shape of the lag over pressure. They stay near those of the file, and the intervals get back what was known of them.
fn hold(priors: &mut [Prior]) -> Vec<Held> {
    /// Fraction of its standard deviation in which it is held; none would make it a constant, with which nothing is correlated.
    const HELD_FRACTION: f64 = 0.1;
    let unidentified = [Parameter::Gain, Parameter::Shape(Map::Gain, 0)];
    let hold = |prior: &mut Prior| {
        let held = Held { parameter: prior.parameter, sd: prior.sd };
        prior.sd *= HELD_FRACTION;
        held
    };
    priors.iter_mut().filter(|prior| unidentified.contains(&prior.parameter)).map(hold).collect()
}

/// Gives them back what was known of them.
fn release(priors: &mut [Prior], held: &[Held]) {
    for held in held {
        priors.iter_mut().filter(|prior| prior.parameter == held.parameter).for_each(|prior| prior.sd = held.sd);
    }
}

/// At most so many of the shifts, evenly over all.
fn spread_over(shifts: &[ShiftRecord], maximum: usize) -> impl Iterator<Item = ShiftRecord> + '_ {
    let count = maximum.min(shifts.len());
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
        let before: f64 = along.iter().zip(&self.priors).map(|(power, prior)| Real::powi(power * prior.sd, 2)).sum();
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
