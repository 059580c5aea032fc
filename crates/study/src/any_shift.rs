//! How well the filter for any shift estimates both clutches of a shift, beside the valve models alone.
//!
//! A shift is simulated in a car that differs from the one that filter and controller know; the filter sees it through
//! toothed wheels. Errors are counted by what the true clutches do: in the *torque phase* one of them holds and the other
//! carries torque while it slips; in the *inertia phase* both slip.

pub mod campaign;
pub mod car_log;
pub mod channels;
mod command_delay;
mod contradictions;
mod converter_check;
pub mod drive;
mod gear_signal;
mod held_commands;
mod in_gear;
pub mod influence;
pub mod learning_count;
pub mod learnt_coverage;
mod lock_up_check;
mod log_beside;
pub mod logged;
pub mod matrix;
pub mod measured;
mod nominal;
pub mod pressure_command;
mod ratio_scale;
pub mod recording;
pub mod sensitivity;
pub mod shift_summary;
mod still_commands;
mod thinned;
pub mod tour;
pub mod worth_a_look;

use car::{Car, Sensors, ShiftClutch};
use car::{ElementErrors, ErrorBudget};
use design::{ShiftTables, any_shift_filter};
use drivetrain::{Cylinder, Passage, Real};
use observer::Health;
use observer::any_shift::{AnyShiftFilter, AnyShiftState, MAX_ELEMENTS, ONE_WAY, ShiftEstimate, ShiftInput};
use plant::TrainError;
use plant::car::{CarCalibration, CarError, CarModel, CarSample, CarShift, simulate_car_shift};
use recording::{Recording, records_in_a_sample};
use thiserror::Error;

/// Sample time of the records that toothed wheels are read from, s.
pub const RECORD_S: f64 = 0.001;
/// Sample time of the filter, s.
pub const SAMPLE_S: f64 = 0.01;
/// Torque below which a clutch carries nothing but drag, N m.
const CARRIES_N_M: f64 = 2.0;
/// Pressure that counts as outside its range only beyond rounding, Pa.
const ROUNDING_PA: f64 = 1.0;
/// Drag of an open clutch, which the range leaves out, N m.
const DRAG_N_M: f64 = 1.2;

/// Why a shift could not be scored.
#[derive(Debug, Error)]
pub enum AnyShiftError {
    /// The simulation failed.
    #[error("the shift cannot be simulated: {0}")]
    Car(#[from] CarError),
    /// The car cannot be prepared.
    #[error("the car cannot be simulated: {0}")]
    Train(#[from] TrainError),
    /// There are more clutches than the filter has room for.
    #[error("the gearbox has {0} clutches and brakes, and the filter has room for {MAX_ELEMENTS}")]
    TooManyElements(usize),
    /// A shift is none from one clutch with plates and valve to another.
    #[error("the filter has no tables for {0}\nhint: `wetclutch check` lists the shifts from one clutch to another")]
    NoTables(String),
}

/// How a car differs from the one that is known.
#[derive(Debug, Clone, PartialEq)]
pub struct ShiftDraw {
    /// Factor on the friction of each element.
    pub friction: Vec<f64>,
    /// Factor on the gain of each element's valve.
    pub valve_gain: Vec<f64>,
    /// Factor on the converter's capacity.
    pub converter: f64,
    /// Lag, delay and hysteresis of each element's valve; none as in the known car.
    pub timing: Vec<Option<ValveTiming>>,
    /// Stroke of each element's piston; none as in the known car.
    pub strokes: Vec<Option<StrokeDraw>>,
}

/// How the stroke of a piston differs from that of the known car, each by a number from 0 to 1 between the limits of its budget.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StrokeDraw {
    /// Of the volume.
    pub volume: f64,
    /// Of the pressures at both ends of the stroke.
    pub plateau: f64,
    /// Of the resistance of both passages.
    pub resistance: f64,
    /// Of the viscosity of the oil, of all elements alike.
    pub viscosity: f64,
}

/// Lag, delay and hysteresis of a valve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ValveTiming {
    /// Factor on the lag.
    pub lag: f64,
    /// Delay, s.
    pub delay_s: f64,
    /// Half-width of the hysteresis, Pa.
    pub hysteresis_pa: f64,
}

impl ShiftDraw {
    /// The known car.
    pub fn none(car: &Car) -> Self {
        let ones = vec![1.0; car.clutches.len()];
        let (timing, strokes) = (vec![None; ones.len()], vec![None; ones.len()]);
        Self { timing, strokes, friction: ones.clone(), valve_gain: ones, converter: 1.0 }
    }

    /// Friction, gain and converter within the bounds of a budget, each by a number from 0 to 1.
    pub fn within(car: &Car, budget: &ErrorBudget, mut uniform: impl FnMut() -> f64) -> Self {
        let mut of_elements = |range: fn(&ElementErrors) -> [f64; 2]| {
            let elements = (0..car.clutches.len()).map(|at| budget.element(at));
            elements.map(|element| between(element.map_or([1.0; 2], range), uniform())).collect()
        };
        let friction = of_elements(|element| element.friction_factor);
        let valve_gain = of_elements(|element| element.valve_gain_factor);
        let converter = between([1.0 - budget.converter, 1.0 + budget.converter], uniform());
        Self { friction, valve_gain, converter, ..Self::none(car) }
    }

    /// The same with lag, delay and hysteresis of the valves within the bounds too.
    #[must_use]
    pub fn with_timing(mut self, budget: &ErrorBudget, mut uniform: impl FnMut() -> f64) -> Self {
        for (at, timing) in self.timing.iter_mut().enumerate() {
            let [lag, delay, hysteresis] = [uniform(), uniform(), uniform()];
            *timing = budget.element(at).map(|element| ValveTiming {
                lag: between(element.valve_lag_factor, lag),
                delay_s: between(element.valve_delay_s, delay),
                hysteresis_pa: between([0.0, element.valve_hysteresis_pa], hysteresis),
            });
        }
        self
    }

    /// The same with the strokes of the pistons of `car`, where they have one, within the budget of its cylinders too.
    #[must_use]
    pub fn with_strokes(mut self, car: &Car, mut uniform: impl FnMut() -> f64) -> Self {
        let mut viscosity = None;
        for (stroke, clutch) in self.strokes.iter_mut().zip(&car.clutches) {
            if clutch.as_ref().is_none_or(|clutch| !clutch.has_stroke) {
                continue;
            }
            let viscosity = *viscosity.get_or_insert_with(&mut uniform);
            *stroke = Some(StrokeDraw { volume: uniform(), plateau: uniform(), resistance: uniform(), viscosity });
        }
        self
    }

    /// The car that differs from this one so.
    pub fn car(&self, known: &Car) -> Car {
        let mut car = known.clone();
        for (clutch, stroke) in car.clutches.iter_mut().zip(&self.strokes) {
            if let (Some(clutch), Some(stroke)) = (clutch, stroke) {
                stroke.change(clutch, known.oil_temperature_degc);
            }
        }
        let factors = self.friction.iter().zip(&self.valve_gain).zip(&self.timing);
        for (clutch, ((friction, gain), timing)) in car.clutches.iter_mut().zip(factors) {
            let Some(clutch) = clutch else { continue };
            clutch.clutch.friction = clutch.clutch.friction.scaled(*friction);
            clutch.clutch.static_friction *= friction;
            clutch.valve = clutch.valve.changed(
                timing.map_or(1.0, |timing| timing.lag),
                *gain,
                timing.map(|timing| timing.delay_s),
            );
            if let Some(timing) = timing {
                clutch.hysteresis_pa = timing.hysteresis_pa;
            }
        }
        if let Some(converter) = &mut car.converter {
            converter.capacity_n_m_s2 = converter.capacity_n_m_s2.scaled(self.converter);
        }
        car
    }
}

impl StrokeDraw {
    /// Gives a clutch this stroke. With the pressure at its end the force of the return spring there is another.
    fn change(&self, clutch: &mut ShiftClutch, oil_degc: f64) {
        let Some(budget) = clutch.standard_fill_budget(oil_degc) else { return };
        let passage = |[wide, narrow]: [Passage<f64>; 2]| Passage {
            laminar_pa_s2_m5: between([wide.laminar_pa_s2_m5, narrow.laminar_pa_s2_m5], self.resistance),
            orifice_pa_s2_m6: between([wide.orifice_pa_s2_m6, narrow.orifice_pa_s2_m6], self.resistance),
        };
        let kiss_pa = between(budget.kiss_pressure_pa, self.plateau);
        clutch.cylinder = Cylinder {
            stroke_m3: between(budget.volume_m3, self.volume),
            preload_pa: between(budget.preload_pressure_pa, self.plateau),
            kiss_pa,
            supply: passage(budget.supply),
            exhaust: passage(budget.exhaust),
            viscosity_m2_s: between(budget.viscosity_m2_s, self.viscosity),
            ..clutch.cylinder
        };
        clutch.clutch.return_spring_n = kiss_pa * clutch.clutch.piston_area_m2;
    }
}

/// The value in a range at this fraction of it, from 0 to 1.
fn between([minimum, maximum]: [f64; 2], fraction: f64) -> f64 {
    minimum + fraction * (maximum - minimum)
}

/// Truth and estimates of one clutch at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClutchRow {
    /// Torque, N m: true (not a number where it is not known), estimated, by the valve model alone; in a simulation this in the true
    /// direction.
    pub torque_n_m: [f64; 3],
    /// Pressure, Pa: true (not a number where it is not known), estimated, by the valve model alone.
    pub pressure_pa: [f64; 3],
    /// Slip, rad/s; by the readings where the true one is not known.
    pub slip_rad_s: f64,
    /// Its slip per turbine speed, `alpha`: the turbine feels `alpha` times its torque.
    pub alpha: f64,
    /// Whether it truly sticks; by the estimate where that is not known.
    pub sticks: bool,
    /// The guaranteed range of the torque, N m.
    pub torque_range_n_m: Option<[f64; 2]>,
    /// The guaranteed range of the pressure, Pa.
    pub pressure_range_pa: Option<[f64; 2]>,
    /// Whether the speeds show nothing of its torque, so that the estimate is that of the valve model.
    pub hidden: bool,
    /// Whether the truth is within the guaranteed ranges.
    pub in_range: bool,
    /// Whether it is a one-way clutch, which has no pressure.
    pub is_one_way: bool,
}

/// A row of a shift.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShiftScoreRow {
    /// Time, s.
    pub time_s: f64,
    /// Offgoing and oncoming clutch.
    pub clutches: [ClutchRow; 2],
    /// Torque at the gearbox input, N m: true and estimated.
    pub turbine_n_m: [f64; 2],
    /// Of a gearbox by its ratios alone: torque of its clutches together as the turbine feels it, and its standard deviation, N m. Then
    /// nothing is known of each of them but whether it sticks.
    pub at_turbine_n_m: Option<[f64; 2]>,
    /// True speeds of engine, turbine, output and wheels, rad/s.
    pub speeds_rad_s: [f64; 4],
    /// Slip of the offgoing clutch away from the new gear by the filter, rad/s.
    pub flare_rad_s: f64,
    /// Phase by the filter.
    pub phase: &'static str,
    /// What the filter says of itself.
    pub health: Health,
}

/// What the clutches of a shift truly do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum TruePhase {
    /// One holds, the other carries torque while it slips.
    Torque,
    /// Both slip.
    Inertia,
}

impl ClutchRow {
    /// A clutch of which nothing is known but whether it sticks.
    fn unknown(sticks: bool) -> Self {
        Self {
            torque_n_m: [f64::NAN; 3],
            pressure_pa: [f64::NAN; 3],
            slip_rad_s: f64::NAN,
            alpha: f64::NAN,
            sticks,
            is_one_way: false,
            torque_range_n_m: None,
            pressure_range_pa: None,
            hidden: false,
            in_range: true,
        }
    }
}

impl ShiftScoreRow {
    /// What the clutches truly do, by the estimate where that is not known; `None` where neither phase is on.
    pub fn phase(&self) -> Option<TruePhase> {
        match self.clutches.map(|clutch| clutch.sticks) {
            [false, false] => Some(TruePhase::Inertia),
            [true, true] => None,
            [off, _] => {
                let [truth, estimate, _] = self.clutches[usize::from(off)].torque_n_m;
                let torque_n_m = if truth.is_nan() { estimate } else { truth };
                (torque_n_m.abs() > CARRIES_N_M).then_some(TruePhase::Torque)
            }
        }
    }
}

/// Squared errors of a clutch's torque or pressure over the rows of a phase, in N m or Pa.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SquaredErrors {
    /// Sum of the squares of the estimate's errors.
    pub estimate: f64,
    /// The same by the valve model alone.
    pub open_loop: f64,
    /// Sum of the true value's size.
    pub size: f64,
    /// Number of rows.
    pub rows: f64,
}

impl SquaredErrors {
    /// Adds those of more rows.
    pub fn add(&mut self, more: &Self) {
        self.estimate += more.estimate;
        self.open_loop += more.open_loop;
        self.size += more.size;
        self.rows += more.rows;
    }

    /// Root mean square errors of a torque, N m: of the estimate, and of the valve model alone.
    pub fn rms_n_m(&self) -> [f64; 2] {
        self.rms()
    }

    /// Root mean square errors of a pressure, Pa: of the estimate, and of the valve model alone.
    pub fn rms_pa(&self) -> [f64; 2] {
        self.rms()
    }

    fn rms(&self) -> [f64; 2] {
        [self.estimate, self.open_loop].map(|sum| (sum / self.rows.max(1.0)).sqrt())
    }

    /// The error of the estimate over that of the valve model alone; `None` without rows.
    pub fn ratio(&self) -> Option<f64> {
        let [estimate, open_loop] = self.rms();
        (self.rows > 0.0 && open_loop > 0.0).then(|| estimate / open_loop)
    }

    /// The errors of one clutch's torque in one phase, over the rows in which the truth is known.
    pub fn of(rows: &[ShiftScoreRow], phase: TruePhase, clutch: usize) -> Self {
        Self::over(rows, phase, clutch, |clutch| clutch.torque_n_m)
    }

    /// The errors of one clutch's pressure in one phase, over the rows in which the truth is known.
    pub fn of_pressure(rows: &[ShiftScoreRow], phase: TruePhase, clutch: usize) -> Self {
        Self::over(rows, phase, clutch, |clutch| clutch.pressure_pa)
    }

    fn over(rows: &[ShiftScoreRow], phase: TruePhase, clutch: usize, values: fn(&ClutchRow) -> [f64; 3]) -> Self {
        let mut sum = Self::default();
        for row in rows.iter().filter(|row| row.phase() == Some(phase) && !row.clutches[clutch].sticks) {
            let [truth, estimate, open_loop] = values(&row.clutches[clutch]);
            if truth.is_nan() {
                continue;
            }
            sum.estimate += Real::powi(truth - estimate, 2);
            sum.open_loop += Real::powi(truth - open_loop, 2);
            sum.size += truth.abs();
            sum.rows += 1.0;
        }
        sum
    }
}

/// Simulates a shift of the car `known` that truly is `truth`, and lets the filter estimate it.
///
/// # Errors
/// The gears have no shift between two clutches, or the simulation fails.
pub fn score_shift(
    known: &Car,
    truth: &Car,
    shift: &CarShift,
    sensors: &Sensors,
    seed: u64,
) -> Result<Vec<ShiftScoreRow>, AnyShiftError> {
    let samples = simulated(known, truth, shift)?;
    let budget = ErrorBudget::of_car(known).read_by(known, Some(sensors));
    let tables = ShiftTables::of_car(known, &budget).map_err(AnyShiftError::TooManyElements)?;
    let filter = any_shift_filter(known, &tables, &budget, Some(sensors));
    let inputs = inputs(known, &tables, &samples, sensors, seed);
    Ok(score_samples(&tables, &filter, &samples, &inputs))
}

/// A shift of the car `known` that truly is `truth`, recorded as [`inputs`] needs it.
///
/// # Errors
/// The gears have no shift between two clutches, or the simulation fails.
pub fn simulated(known: &Car, truth: &Car, shift: &CarShift) -> Result<Vec<CarSample>, AnyShiftError> {
    let model = CarModel::new(truth.clone())?;
    let mut samples = Vec::new();
    let shift = CarShift { sample_time_s: RECORD_S, ..*shift };
    simulate_car_shift(&model, known, CarCalibration::STANDARD, &shift, |sample| samples.push(*sample))?;
    Ok(samples)
}

/// What the filter is shown of a drive that was recorded every [`RECORD_S`], every [`SAMPLE_S`]; each with the place of its sample.
pub fn inputs(
    car: &Car,
    tables: &ShiftTables<f64>,
    samples: &[CarSample],
    sensors: &Sensors,
    seed: u64,
) -> Vec<(usize, ShiftInput<f64>)> {
    let mut recording = Recording::default();
    samples.iter().for_each(|sample| recording.push(sample));
    let inputs = recording.inputs(car, tables, sensors, seed);
    inputs.enumerate().map(|(row, input)| (row * records_in_a_sample(), input)).collect()
}

/// Truth and estimates of a recorded drive while its shifts are under way.
pub fn score_samples(
    tables: &ShiftTables<f64>,
    filter: &AnyShiftFilter<'_, f64>,
    samples: &[CarSample],
    inputs: &[(usize, ShiftInput<f64>)],
) -> Vec<ShiftScoreRow> {
    score_from(tables, filter, &mut filter.start(), samples, inputs)
}

/// The same by a filter that goes on from a state: with what it has learnt.
pub fn score_from(
    tables: &ShiftTables<f64>,
    filter: &AnyShiftFilter<'_, f64>,
    state: &mut AnyShiftState<f64>,
    samples: &[CarSample],
    inputs: &[(usize, ShiftInput<f64>)],
) -> Vec<ShiftScoreRow> {
    let mut rows = Vec::new();
    for (at, input) in inputs {
        let estimate = filter.step(state, input);
        rows.extend(row(tables, &samples[*at], &estimate));
    }
    rows
}

/// Whether a value lies in a range up to a tolerance; what is not known lies in it.
fn within(range: Option<[f64; 2]>, value: f64, tolerance: f64) -> bool {
    value.is_nan() || range.is_none_or(|[low, high]| low - tolerance <= value && value <= high + tolerance)
}

fn row(tables: &ShiftTables<f64>, sample: &CarSample, estimate: &ShiftEstimate<f64>) -> Option<ShiftScoreRow> {
    let under_way = sample.shift.as_ref()?;
    let clutches = estimate.clutches.as_ref()?;
    let alphas = tables.tables().shift(under_way.from, under_way.to).map(|row| row.clutches.map(|clutch| clutch.alpha));
    let of = |c: usize| {
        let (truth, found) = ([&under_way.offgoing, &under_way.oncoming][c], &clutches[c]);
        (found.element == tables.place(truth.element).unwrap_or(ONE_WAY)).then(|| ClutchRow {
            // A valve model knows no direction: it is told the true one. Else noise of a slip that is not yet seen would be its error.
            torque_n_m: [truth.torque_n_m, found.torque_n_m, found.open_loop_n_m.abs().copysign(truth.torque_n_m)],
            pressure_pa: [truth.pressure_pa, found.pressure_pa, found.valve_pa],
            slip_rad_s: truth.slip_rad_s,
            alpha: alphas.map_or(f64::NAN, |alphas| alphas[c]),
            sticks: truth.sticks,
            torque_range_n_m: found.torque_range_n_m,
            pressure_range_pa: found.pressure_range_pa,
            hidden: found.hidden,
            is_one_way: found.element == ONE_WAY,
            in_range: within(found.pressure_range_pa, truth.pressure_pa, ROUNDING_PA)
                && within(found.torque_range_n_m, truth.torque_n_m, DRAG_N_M),
        })
    };
    Some(ShiftScoreRow {
        time_s: sample.time_s,
        clutches: [of(0)?, of(1)?],
        turbine_n_m: [sample.turbine_n_m, estimate.turbine_n_m.unwrap_or(f64::NAN)],
        at_turbine_n_m: None,
        speeds_rad_s: [
            sample.torques.engine_rad_s,
            sample.torques.turbine_rad_s,
            sample.torques.output_rad_s,
            sample.wheel_rad_s,
        ],
        flare_rad_s: estimate.flare_rad_s,
        phase: estimate.phase.map_or("-", |phase| phase.name()),
        health: estimate.health,
    })
}
