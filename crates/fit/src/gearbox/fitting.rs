//! The fit of a car to its shifts.

use std::ops::ControlFlow;

use car::Car;
use car::ErrorBudget;
use drivetrain::{Real, ShiftKind};
use nalgebra::{DMatrix, DVector};
use observer::ShiftTables;

use super::balances::Balances;
use super::channels::ChannelFits;
use super::command_delay::{common_delay_s, with_commands_earlier};
use super::contradicted::{contradicted, without_pressures};
use super::precision::stated;
use super::quantities::{DELAY_UNIT_S, KISS_UNIT_PA, Quantities, Quantity, std_dev_of};
use super::shift::ShiftModel;
use super::shift_log::ShiftLog;
use super::solver::{Models, Problem};
use super::unfitted::Unfitted;
use super::zero_offset::{without_offsets, zero_offsets};
use crate::driving::{BacklashFit, DrivenCar, Driving, DrivingModel, InputTorque, WheelFit, fit_backlash, fit_wheel};
use crate::fill::{FillFit, FillLog, Filling};
use crate::parameters::OFFSET_UNIT_PA;
use crate::pressure::Hydraulics;
use crate::verdict::SIDES;
use crate::{FitError, Known, OneStep, Verdict};

/// How far a fit is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Shifts that are fitted.
    pub shifts: usize,
    /// Iteration, from 0.
    pub iteration: u32,
}

/// A fitted car.
#[derive(Debug, Clone)]
pub struct GearboxFit {
    /// The quantities and what was known of them.
    pub quantities: Quantities,
    /// Their unknowns.
    pub unknowns: Vec<f64>,
    /// Covariance of the unknowns as it is stated.
    pub stated: DMatrix<f64>,
    /// How many shifts were fitted.
    pub shifts: usize,
    /// How many of each pair of gears, and by kind in the order of [`ShiftKind::ALL`].
    pub by_pair: Vec<[usize; 4]>,
    /// Elements that slipped in a fitted shift.
    pub elements_seen: Vec<bool>,
    /// One-step errors of the turbine speed, rad/s.
    pub one_step: OneStep,
    /// RMS over the shifts of the error of the torque at the turbine that each of them asks for, in what is held likely.
    pub torque_misfit: f64,
    /// Whether the last step was small; otherwise the iterations were used up.
    pub is_converged: bool,
    /// Time of driving in a gear with the engine pulling, s, and with a reported engine torque.
    pub driving_s: [f64; 2],
    /// Fill volumes of the elements, by their places; none where a piston has no stroke.
    pub fills: Vec<Option<FillFit>>,
    /// The backlash of the driveline, or what the logs lack for it.
    pub backlash: Result<BacklashFit, String>,
    /// Channel of the wheel speed and stiffness of the drive shafts, or what the logs lack for them.
    pub wheel: Result<WheelFit, String>,
    /// By how much the fit has moved all commands to earlier times, s, where the logs have them so late.
    pub(crate) commands_moved_s: Option<f64>,
    /// Places of the elements whose measured pressures contradict their commands, and are not used.
    pub(crate) contradicted: Vec<usize>,
    /// Zero offsets of the pressure sensors of the elements, Pa, by their places, where readings at rest show them; the others are quantities of
    /// the fit.
    pub zero_offsets: Vec<Option<Known>>,
    /// Channels of output and engine speed against the turbine speed.
    pub channels: ChannelFits,
    /// Part of the torque at the gearbox input that is by the torque ratio above 1, RMS over the fitted shifts.
    pub(crate) above_one_fraction: f64,
    /// Pairs of gears whose inertia is taken to be that of the file, and the unknown that the logs draw it to.
    pub(crate) drawn_off: Vec<(usize, f64)>,
    /// Which balances of it were fitted.
    pub(crate) balances: Balances,
    /// Names of the quantities that ended where nothing beyond is held possible.
    pub at_limit: Vec<String>,
}

/// Fits the quantities of a car to its shifts and to the driving between them.
///
/// # Errors
/// There is no shift, the car cannot be fitted, or no minimum was found.
pub fn fit(
    car: &Car,
    tables: &ShiftTables<f64>,
    shifts: &[ShiftLog],
    driving: &Driving,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<GearboxFit, FitError> {
    let channels = ChannelFits::of(car, driving);
    let shifts = &channels.moved(shifts, tables, 0.0);
    let commands_late_s = commands_late_s(car, tables, shifts)?;
    let moved = commands_late_s.map(|late_s| with_commands_earlier(shifts, late_s));
    let shifts = moved.as_ref().unwrap_or(shifts);
    let zero_offsets = zero_offsets(car, tables, shifts);
    let shifts = &without_offsets(shifts, tables, &zero_offsets);
    let contradicted = contradicted(car, tables, shifts);
    let without = (!contradicted.is_empty()).then(|| without_pressures(shifts, tables, &contradicted));
    let shifts = without.as_deref().unwrap_or(shifts);
    let mut balances = Balances::of(&DrivenCar::with_gearbox(car, tables, &|_, _| None), driving);
    loop {
        let (mut fit, scales) = fit_with(car, tables, shifts, (driving, &balances), progress)?;
        if !balances.leave_out(scales) {
            fit.channels = channels;
            fit.commands_moved_s = commands_late_s;
            fit.zero_offsets = zero_offsets;
            contradicted.iter().for_each(|place| fit.zero_offsets[*place] = None);
            fit.contradicted = contradicted;
            return Ok(fit);
        }
    }
}

/// The common delay of all commands, where it is much larger than that of a valve, s.
fn commands_late_s(car: &Car, tables: &ShiftTables<f64>, shifts: &[ShiftLog]) -> Result<Option<f64>, FitError> {
    let quantities = Quantities::of(car, tables, shifts, [false; 2]);
    let models: Vec<ShiftModel> =
        shifts.iter().filter_map(|log| ShiftModel::new(car, tables, &quantities, log)).collect();
    Ok(common_delay_s(&Problem::new(&quantities)?, &models))
}

/// The fit with some balances, and the scales of their errors.
pub(super) fn fit_with(
    car: &Car,
    tables: &ShiftTables<f64>,
    shifts: &[ShiftLog],
    (driving, balances): (&Driving, &Balances),
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<(GearboxFit, [f64; 2]), FitError> {
    let quantities = Quantities::of(car, tables, shifts, balances.used());
    let models: Vec<ShiftModel> =
        shifts.iter().filter_map(|log| ShiftModel::new(car, tables, &quantities, log)).collect();
    if models.is_empty() {
        return Err(FitError::input(
            "there is no shift to fit\nhint: record shifts from one clutch to another between forward gears; `estimate` lists the shifts of a log",
        ));
    }
    let problem = Problem::new(&quantities)?;
    let driven = DrivenCar::with_gearbox(car, tables, &|from, to| quantities.pair(from, to));
    let of_driving = DrivingModel::new(&driven, driving, balances.used());
    let all = Models { shifts: &models, driving: of_driving };
    let solved = problem.solve(&all, &mut |iteration| progress(Progress { shifts: models.len(), iteration }))?;
    let mut stated = stated(&problem, &models, &solved, &Unfitted::of(car, tables))?;
    let at_limit = problem.at_limit(&solved.point.at);
    let mut unknowns = solved.point.at;
    let drawn_off = drawn_off(&quantities, &mut unknowns, &mut stated);
    let mut by_pair = vec![[0; 4]; quantities.pairs.len()];
    let mut elements_seen = vec![false; quantities.elements.len()];
    for model in &models {
        let kind = ShiftKind::ALL.iter().position(|kind| Some(*kind) == model.kind);
        by_pair[model.pair][kind.unwrap_or(0)] += 1;
        model.elements().for_each(|at| elements_seen[at] = true);
    }
    let scales = solved.point.driving.scales();
    let squares = solved.point.shifts.iter().map(|shift| Real::powi(shift.torque_error, 2)).sum::<f64>();
    let mut fit = GearboxFit {
        fills: Vec::new(),
        torque_misfit: (squares / models.len() as f64).sqrt(),
        above_one_fraction: above_one_fraction(&models),
        at_limit,
        unknowns,
        drawn_off,
        stated,
        shifts: models.len(),
        by_pair,
        elements_seen,
        one_step: solved.weights.turbine.one_step(),
        is_converged: solved.is_converged,
        driving_s: [driving.time_s(), driving.reported_s()],
        backlash: fit_backlash(&driven, std::iter::once(driving)),
        wheel: Err(String::new()),
        commands_moved_s: None,
        contradicted: Vec::new(),
        zero_offsets: Vec::new(),
        channels: ChannelFits { output: Err(String::new()), engine: None },
        balances: balances.clone(),
        quantities,
    };
    let input = InputTorque {
        capacity: Real::exp(fit.unknown(Quantity::Input)),
        ratio: Real::exp(fit.unknown(Quantity::TorqueRatio)),
        sd: fit.input_sd(),
    };
    let stiffness_sd = std_dev_of(ErrorBudget::of_car(car).stiffness);
    fit.wheel = fit_wheel(&driven, driving, &input, stiffness_sd);
    fit.fills = (0..fit.quantities.elements.len()).map(|place| fit.fill_of(car, tables, shifts, place)).collect();
    Ok((fit, scales))
}

/// Takes the inertias that the logs do not tell and draw out of the 95 % known before to be those of the file, with what was known before; says which these are.
/// Where the turbine changes its speed slowly the inertia is what small errors of large torques leave, such as those of a hysteresis. All else stays: an
/// inertia that is held in the fit would take these errors to the common factor of all torques.
fn drawn_off(quantities: &Quantities, at: &mut [f64], stated: &mut DMatrix<f64>) -> Vec<(usize, f64)> {
    let mut found = Vec::new();
    for pair in 0..quantities.pairs.len() {
        let Some(place) = quantities.place(Quantity::Inertia(pair)) else { continue };
        let before = quantities.sd_before(place);
        let verdict = Verdict::of(stated[(place, place)].sqrt(), before);
        if verdict == Verdict::NotIdentifiable && at[place].abs() > SIDES * before {
            found.push((pair, at[place]));
            at[place] = 0.0;
            stated.row_mut(place).fill(0.0);
            stated.column_mut(place).fill(0.0);
            stated[(place, place)] = before * before;
        }
    }
    found
}

/// Part of the torque at the gearbox input that is by the torque ratio above 1, RMS over the shifts.
fn above_one_fraction(models: &[ShiftModel]) -> f64 {
    let squares = models.iter().map(|model| model.input_squares());
    let [all, above] = squares.fold([0.0; 2], |[all, above], more| [all + more[0], above + more[1]]);
    if all > 0.0 { (above / all).sqrt() } else { 0.0 }
}

impl GearboxFit {
    /// The fill volume of an element by the measured pressures of the shifts in which it is the oncoming one.
    fn fill_of(&self, car: &Car, tables: &ShiftTables<f64>, shifts: &[ShiftLog], place: usize) -> Option<FillFit> {
        let element = tables.element_at(place)?;
        let known = car.clutches[element].as_ref()?;
        let budget = known.standard_fill_budget(car.oil_temperature_degc)?;
        let rows = tables.tables();
        let is_oncoming = |log: &&ShiftLog| {
            rows.shift(log.gears[0], log.gears[1]).is_some_and(|row| row.clutches[1].element.place() == Some(place))
        };
        let measured = shifts.iter().filter(|log| self.quantities.measured[place] && is_oncoming(log));
        let logs: Vec<FillLog<'_>> = (measured.map(|log| FillLog {
            commands: &log.commands[1],
            pressure: &log.pressure[1],
            until_s: log.slip_s[0],
        }))
        .collect();
        let [lag, gain, kiss, late] = [Quantity::Lag, Quantity::Gain, Quantity::Kiss, Quantity::Delay]
            .map(|quantity: fn(usize) -> Quantity| [self.unknown(quantity(place)), self.sd(quantity(place))]);
        let kiss_pa = |more: f64| (known.clutch.kiss_pressure() + KISS_UNIT_PA * (kiss[0] + more)) * Real::exp(gain[0]);
        let hydraulics = Hydraulics::of(known).with_valve(lag[0], gain[0]);
        let offset = Quantity::PressureOffset(place);
        let offset_sd = self.quantities.place(offset).map_or(0.0, |_| self.sd(offset));
        let filling = Filling {
            hydraulics,
            kiss_pa: kiss_pa(0.0),
            late_s: DELAY_UNIT_S * late[0],
            sensor_scale: Real::exp(self.unknown(Quantity::PressureScale)),
            sensor_offset_pa: OFFSET_UNIT_PA * self.unknown(offset),
            sensor_late_s: 0.0,
        };
        let moved = [
            Filling { kiss_pa: kiss_pa(kiss[1]), ..filling },
            Filling { hydraulics: hydraulics.with_valve(lag[1], 0.0), ..filling },
            Filling { hydraulics: hydraulics.with_valve(0.0, gain[1]), ..filling },
            Filling { late_s: filling.late_s + DELAY_UNIT_S * late[1], ..filling },
            Filling { sensor_offset_pa: filling.sensor_offset_pa + OFFSET_UNIT_PA * offset_sd, ..filling },
        ];
        Some(FillFit::of(&logs, &filling, &moved, &budget))
    }

    /// Zero offset of the pressure sensor of an element, Pa; none where its pressure is not measured or contradicts its commands.
    pub fn zero_offset_pa(&self, place: usize) -> Option<Known> {
        let offset = Quantity::PressureOffset(place);
        let by_fit = self.quantities.place(offset).map(|at| {
            let pa = [self.unknowns[at], self.sd(offset), self.quantities.sd_before(at)].map(|x| OFFSET_UNIT_PA * x);
            Known { value: pa[0], sd: pa[1], before: pa[2] }
        });
        by_fit.or(self.zero_offsets.get(place).copied().flatten().filter(|_| self.quantities.measured[place]))
    }

    /// The unknown of a quantity; zero, the file's value, for one that the car does not have.
    pub fn unknown(&self, quantity: Quantity) -> f64 {
        self.quantities.place(quantity).map_or(0.0, |place| self.unknowns[place])
    }

    /// Standard deviation of the unknown of a quantity as it is stated.
    pub fn sd(&self, quantity: Quantity) -> f64 {
        self.quantities.place(quantity).map_or(f64::INFINITY, |place| self.stated[(place, place)].sqrt())
    }

    /// By how much all commands of the logs are late, s, where it is so much that the fit has moved them: with the mean of the delays that it has found besides.
    pub fn commands_late_s(&self) -> Option<Known> {
        let seen = (0..self.elements_seen.len()).filter(|at| self.elements_seen[*at]).map(Quantity::Delay);
        let places: Vec<usize> = seen.filter_map(|delay| self.quantities.place(delay)).collect();
        let mut along = DVector::zeros(self.unknowns.len());
        places.iter().for_each(|place| along[*place] = self.stated[(*place, *place)].recip());
        let sum = along.sum();
        along /= sum;
        let mean: f64 = places.iter().map(|place| along[*place] * self.unknowns[*place]).sum();
        let sd = |covariance: &DMatrix<f64>| DELAY_UNIT_S * along.dot(&(covariance * &along)).max(0.0).sqrt();
        let moved_s = self.commands_moved_s.filter(|_| sum > 0.0)?;
        let value = moved_s + DELAY_UNIT_S * mean;
        Some(Known { value, sd: sd(&self.stated), before: sd(&self.quantities.before) })
    }

    /// By how much the engine speed is late against the turbine speed in front of a converter, s.
    pub fn engine_late_s(&self) -> Option<Known> {
        let place = self.quantities.place(Quantity::EngineDelay)?;
        let [value, sd, before] =
            [self.unknowns[place], self.sd(Quantity::EngineDelay), self.quantities.sd_before(place)]
                .map(|unknown| DELAY_UNIT_S * unknown);
        Some(Known { value: self.channels.late_s()[1] + value, sd, before })
    }

    /// Standard deviation of the logarithm of the torque at the gearbox input in shifts: the torque ratio acts on what is above 1 alone.
    pub(crate) fn input_sd(&self) -> f64 {
        let mut along = DVector::zeros(self.unknowns.len());
        for (quantity, weight) in [(Quantity::Input, 1.0), (Quantity::TorqueRatio, self.above_one_fraction)] {
            self.quantities.place(quantity).into_iter().for_each(|place| along[place] = weight);
        }
        along.dot(&(&self.stated * &along)).max(0.0).sqrt()
    }

    /// How far the logs identify a quantity.
    pub fn verdict(&self, quantity: Quantity) -> Verdict {
        let Some(place) = self.quantities.place(quantity) else { return Verdict::NotIdentifiable };
        Verdict::of(self.sd(quantity), self.quantities.sd_before(place))
    }

    /// Factor on the gain of an element's valve in the fitted file: that of the given file where no pressure shows another.
    pub(crate) fn gain_factor(&self, place: usize) -> f64 {
        if self.quantities.measured[place] { Real::exp(self.unknown(Quantity::Gain(place))) } else { 1.0 }
    }

    /// Factor on the friction of an element in the fitted file.
    pub(crate) fn friction_factor(&self, place: usize) -> f64 {
        Real::exp(self.unknown(Quantity::Torque(place))) / self.gain_factor(place)
    }

    /// Standard deviation of the logarithm of the friction of an element whose pressure is measured.
    pub(crate) fn friction_sd(&self, place: usize) -> f64 {
        self.friction_sd_of(place, &self.stated)
    }

    fn friction_sd_of(&self, place: usize, covariance: &DMatrix<f64>) -> f64 {
        let both = [Quantity::Torque(place), Quantity::Gain(place)].map(|quantity| self.quantities.place(quantity));
        let [Some(torque), Some(gain)] = both else { return f64::INFINITY };
        let of = |i: usize, j: usize| covariance[(i, j)];
        (of(torque, torque) + of(gain, gain) - 2.0 * of(torque, gain)).max(0.0).sqrt()
    }

    /// How far the logs identify it.
    pub(crate) fn friction_verdict(&self, place: usize) -> Verdict {
        Verdict::of(self.friction_sd(place), self.friction_sd_of(place, &self.quantities.before))
    }

    /// The weights with which the quantities make the logarithm of the factor that all torques have in common.
    fn torque_scale_weights(&self) -> DVector<f64> {
        let powers = DVector::from_vec(self.quantities.powers_of_torque());
        let solved = self.quantities.before.clone().cholesky().map(|cholesky| cholesky.solve(&powers));
        solved.map_or_else(|| powers.clone(), |weights| &weights / powers.dot(&weights))
    }

    /// The logarithm of the factor that all torques have in common.
    pub(crate) fn torque_scale(&self) -> f64 {
        self.torque_scale_weights().iter().zip(&self.unknowns).map(|(weight, x)| weight * x).sum()
    }

    /// Standard deviation of the unknown of a quantity that has the common factor of all torques, beside that factor.
    pub fn sd_beside_scale(&self, quantity: Quantity) -> f64 {
        let mut along = -self.torque_scale_weights();
        if let Some(place) = self.quantities.place(quantity) {
            along[place] += 1.0;
        }
        along.dot(&(&self.stated * &along)).max(0.0).sqrt()
    }

    /// Standard deviation of the logarithm of the factor that all torques of the shifts have in common, which the speeds do not tell: it comes
    /// from what was known before.
    pub fn torque_scale_sd(&self) -> f64 {
        let weights = self.torque_scale_weights();
        weights.dot(&(&self.stated * &weights)).max(0.0).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use car::ErrorBudget;
    use config::CarFile;

    #[test]
    fn an_inertia_that_is_far_off_and_not_identifiable_is_that_of_the_file() {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let car = CarFile::read(&root.join("vehicles/eight_speed.toml")).unwrap();
        let tables = ShiftTables::of_car(&car, &ErrorBudget::of_car(&car)).unwrap();
        let quantities = Quantities::of(&car, &tables, &[], [false; 2]);
        let place = quantities.place(Quantity::Inertia(3)).unwrap();
        let before = quantities.sd_before(place);
        // The unknown, and its standard deviation after the fit, in standard deviations of before.
        let found = |x: f64, after: f64| {
            let (mut at, mut stated) = (vec![0.1; quantities.all.len()], quantities.before.clone());
            at[place] = x * before;
            stated[(place, place)] *= after * after;
            let found = drawn_off(&quantities, &mut at, &mut stated);
            assert_eq!(at[place + 1], 0.1);
            (found, at[place], stated)
        };
        let (drawn_off, x, stated) = found(3.4, 0.9);
        assert_eq!((drawn_off, x), (vec![(3, 3.4 * before)], 0.0));
        assert_eq!(stated[(place, place)], before * before);
        assert_eq!(stated.column(place).iter().filter(|value| **value != 0.0).count(), 1);
        // What is identified, and what lies within what was known before, stays.
        for (x, after) in [(3.4, 0.5), (1.9, 1.0), (-1.9, 1.0)] {
            assert_eq!((found(x, after).0, found(x, after).1), (Vec::new(), x * before));
        }
        assert_eq!(found(-2.1, 1.0).0.len(), 1);
    }
}
