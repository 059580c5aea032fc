//! What a filter learns of a car over a drive, against what the simulated car truly is.
//!
//! The car, its reported engine torque, its wheels and the inertia in the filter's tables are sampled within the bounds of the errors. Of each
//! learnt quantity there are the error and the standard deviation that the filter states.

use car::ErrorBudget;
use car::{Car, Drive, Sensors};
use drivetrain::Real;
use observer::Reading;
use observer::gearbox::{GearboxFilter, Learnt, ShiftInput};
use observer::{ShiftTables, gearbox_filter};
use plant::car::{CarCalibration, CarModel, simulate_car_drive};

use super::matrix::Random;
use super::recording::{Recording, reported_engine_n_m};
use evaluate::score::row;

use super::{EvaluateError, RECORD_S, ShiftDraw, TruePhase};

/// Standard deviations of a normal distribution within which 95 % lie.
const OF_95_PERCENT: f64 = 1.96;
/// Standard deviation below which a quantity counts as learnt, in that unlearnt \[chosen\].
const LEARNT_BELOW: f64 = 0.95;

/// A quantity that is learnt.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Quantity {
    /// Friction times valve gain of an element, relative.
    TorqueFactor,
    /// Gain of the valve of an element, relative.
    ValveGain,
    /// Kiss point of an element, Pa.
    KissPoint,
    /// Turbine-side inertia between two gears, relative.
    Inertia,
    /// Torque at the gearbox input, relative.
    InputTorque,
    /// Reported engine torque, relative.
    EngineTorque,
    /// Lag of the valve of an element, relative.
    Lag,
    /// Delay of the valve of an element, s.
    Delay,
    /// Scale of the wheel speed, relative.
    WheelScale,
}

impl Quantity {
    /// Its name and unit, and how many of the unit are one in SI units.
    pub fn name(self) -> (&'static str, f64) {
        match self {
            Self::TorqueFactor => ("torque factor, %", 100.0),
            Self::ValveGain => ("valve gain, %", 100.0),
            Self::KissPoint => ("kiss point, kPa", 1e-3),
            Self::Inertia => ("inertia, %", 100.0),
            Self::InputTorque => ("input torque, %", 100.0),
            Self::EngineTorque => ("engine torque, %", 100.0),
            Self::Lag => ("lag, %", 100.0),
            Self::Delay => ("delay, ms", 1e3),
            Self::WheelScale => ("wheel scale, %", 100.0),
        }
    }

    /// All of them.
    pub const ALL: [Self; 9] = [
        Self::TorqueFactor,
        Self::ValveGain,
        Self::KissPoint,
        Self::Inertia,
        Self::InputTorque,
        Self::EngineTorque,
        Self::Lag,
        Self::Delay,
        Self::WheelScale,
    ];
}

/// A learnt quantity against the truth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LearntError {
    /// What it is.
    pub quantity: Quantity,
    /// Place of its element, or of the pair of gears; zero of a quantity of the car.
    pub at: usize,
    /// The learnt value less the true one.
    pub error: f64,
    /// The true one.
    pub truth: f64,
    /// The standard deviation that the filter states.
    pub standard_deviation: f64,
    /// That of a filter that has learnt nothing.
    pub unlearnt: f64,
}

/// The errors of one quantity over many cars.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coverage {
    /// How many values there are.
    pub count: usize,
    /// Mean of the errors.
    pub mean: f64,
    /// Their root mean square.
    pub rms: f64,
    /// Mean of the standard deviations that the filter states.
    pub standard_deviation: f64,
    /// Fraction of the true values within 1.96 standard deviations.
    pub inside: f64,
}

impl Coverage {
    /// Of a quantity, as far as it was learnt: the standard deviation is at least 5 % below that of a filter that has learnt nothing. `None`
    /// if there are no such values.
    pub fn of<'e>(quantity: Quantity, errors: impl Iterator<Item = &'e LearntError>) -> Option<Self> {
        let is_learnt = |error: &&LearntError| error.standard_deviation < LEARNT_BELOW * error.unlearnt;
        let of: Vec<_> = errors.filter(|error| error.quantity == quantity).filter(is_learnt).collect();
        let count = of.len() as f64;
        let mean = |value: fn(&LearntError) -> f64| of.iter().map(|error| value(error)).sum::<f64>() / count;
        (!of.is_empty()).then(|| Self {
            count: of.len(),
            mean: mean(|error| error.error),
            rms: mean(|error| Real::powi(error.error, 2)).sqrt(),
            standard_deviation: mean(|error| error.standard_deviation),
            inside: mean(|error| f64::from(u8::from(error.is_inside()))),
        })
    }
}

impl LearntError {
    /// Whether the truth lies in the interval that holds it in 95 % of the cars.
    pub fn is_inside(&self) -> bool {
        self.error.abs() <= OF_95_PERCENT * self.standard_deviation
    }
}

/// What is sampled of a car.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sampled {
    /// Nothing: the car is that of the file.
    Nothing,
    /// Friction, valve gains and converter.
    Torques,
    /// All errors of the budget that the filter learns.
    Budget,
}

/// A car that differs from its file, and what its sensors and the tables of its filter have wrong.
#[derive(Debug, Clone, PartialEq)]
pub struct SampledCar {
    /// The true car.
    pub car: Car,
    draw: ShiftDraw,
    /// Reported engine torque over the true one.
    pub engine: f64,
    /// Turbine-side inertia in the filter's tables over the true one.
    pub inertia: f64,
    /// Reading of the wheel speed over the true one.
    pub wheel: f64,
}

impl SampledCar {
    /// A car within the bounds.
    pub fn new(known: &Car, budget: &ErrorBudget, what: Sampled, seed: u64) -> Self {
        let mut random = Random(seed.wrapping_mul(7919));
        let mut draw = ShiftDraw::none(known);
        if what != Sampled::Nothing {
            draw = ShiftDraw::within(known, budget, || random.uniform());
        }
        if what == Sampled::Budget {
            draw = draw.with_timing(budget, || random.uniform());
        }
        let mut car = draw.car(known);
        let mut sampled = |bound: f64| 1.0 + bound * (2.0 * random.uniform() - 1.0);
        let [mut engine, mut inertia, mut wheel] = [1.0; 3];
        if what != Sampled::Nothing {
            engine = sampled(budget.engine);
        }
        if what == Sampled::Budget {
            inertia = sampled(budget.inertia);
            wheel = sampled(budget.wheel_scale);
            car.driveline.shaft_stiffness_n_m_rad *= sampled(budget.stiffness);
        }
        Self { car, draw, engine, inertia, wheel }
    }

    /// The errors of what a filter has learnt of it.
    pub fn errors(
        &self,
        known: &Car,
        tables: &ShiftTables<f64>,
        filter: &GearboxFilter<'_, f64>,
        learnt: &Learnt<f64>,
    ) -> Vec<LearntError> {
        let (mut errors, nothing) = (Vec::new(), filter.start());
        let mut push = |quantity, at, truth, [value, standard_deviation]: [f64; 2], [_, unlearnt]: [f64; 2]| {
            errors.push(LearntError { quantity, at, truth, error: value - truth, standard_deviation, unlearnt });
        };
        let nothing = nothing.learnt();
        for (at, clutch) in known.clutches.iter().enumerate() {
            let Some((place, clutch)) = tables.place(at).zip(clutch.as_ref()) else { continue };
            let of = |learnt| filter.learnt_element(learnt, place).zip(filter.learnt_timing(learnt, place));
            let Some(((of, [lag, delay]), (was, [lag_was, delay_was]))) = of(learnt).zip(of(nothing)) else { continue };
            let (friction, gain) = (self.draw.friction[at], self.draw.valve_gain[at]);
            push(Quantity::TorqueFactor, at, friction * gain - 1.0, of.torque_fraction, was.torque_fraction);
            push(Quantity::ValveGain, at, gain - 1.0, of.valve_gain, was.valve_gain);
            let kiss_pa = clutch.clutch.kiss_pressure() * (gain.recip() - 1.0);
            push(Quantity::KissPoint, at, kiss_pa, of.kiss_pa, was.kiss_pa);
            if let Some(timing) = self.draw.timing[at] {
                push(Quantity::Lag, at, timing.lag - 1.0, lag, lag_was);
                let middle_s = tables.tables().elements[place].valve.delay_s;
                push(Quantity::Delay, at, timing.delay_s - middle_s, delay, delay_was);
            }
        }
        let forward = known.gearbox.forward_gears();
        for (at, pair) in forward.windows(2).enumerate() {
            let of = |learnt| filter.learnt_inertia(learnt, pair[0], pair[1]);
            if let Some((of, was)) = of(learnt).zip(of(nothing)) {
                push(Quantity::Inertia, at, self.inertia.recip() - 1.0, of, was);
            }
        }
        let ([input, reported], [input_was, reported_was]) =
            (filter.learnt_sources(learnt), filter.learnt_sources(nothing));
        if known.converter.is_some() {
            push(Quantity::InputTorque, 0, self.draw.converter - 1.0, input, input_was);
            push(Quantity::EngineTorque, 0, self.engine - 1.0, reported, reported_was);
        } else {
            push(Quantity::InputTorque, 0, self.engine.recip() - 1.0, input, input_was);
        }
        push(
            Quantity::WheelScale,
            0,
            self.wheel - 1.0,
            filter.learnt_wheel_scale(learnt),
            filter.learnt_wheel_scale(nothing),
        );
        errors
    }
}

/// Squared errors of the torques of slipping clutches, N^2 m^2, of both phases, with their numbers.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TorqueErrors {
    /// Sums over the torque and the inertia phase.
    pub squares: [f64; 2],
    /// Rows.
    pub rows: [f64; 2],
}

impl TorqueErrors {
    /// Adds those of more rows.
    pub fn add(&mut self, more: &Self) {
        for phase in 0..2 {
            self.squares[phase] += more.squares[phase];
            self.rows[phase] += more.rows[phase];
        }
    }

    /// Root mean square of both phases together, N m.
    pub fn rms_n_m(&self) -> f64 {
        (self.squares.iter().sum::<f64>() / self.rows.iter().sum::<f64>().max(1.0)).sqrt()
    }
}

/// What a filter has learnt after each part of a drive.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LearntDrive {
    /// The learnt quantities at the end of each part.
    pub learnt: Vec<Vec<LearntError>>,
    /// Errors of the torques in each part.
    pub torques: Vec<TorqueErrors>,
    /// Shifts that were learnt from.
    pub shifts: u32,
}

/// Simulates a drive of a sampled car and lets the filter learn; the drive counts in so many parts.
///
/// # Errors
/// The drive cannot be simulated, or there are too many clutches.
pub fn learn(
    known: &Car,
    sampled: &SampledCar,
    drive: &Drive,
    sensors: &Sensors,
    (parts, seed): (usize, u64),
) -> Result<LearntDrive, EvaluateError> {
    let budget = ErrorBudget::of_car(known).read_by(known, Some(sensors));
    let mut tables = ShiftTables::of_car(known, &budget).map_err(EvaluateError::TooManyElements)?;
    tables.scale_inertia(sampled.inertia);
    let filter = gearbox_filter(known, &tables, &budget, Some(sensors));
    let recording = record(known, sampled, drive)?;
    let mut state = filter.start();
    let mut result = LearntDrive::default();
    let in_part = recording.samples.len().div_ceil(parts.max(1)).max(1);
    let mut torques = TorqueErrors::default();
    for (at, input) in recording.inputs(known, &tables, sensors, seed).enumerate() {
        let sample = &recording.samples[at];
        let engine_n_m = Some(Reading::now(sampled.engine * reported_engine_n_m(&sampled.car, sample)));
        let wheel_rad_s = input.wheel_rad_s.map(|reading| Reading { value: sampled.wheel * reading.value, ..reading });
        let estimate = filter.step(&mut state, &ShiftInput { engine_n_m, wheel_rad_s, ..input });
        if let Some(row) = row(&tables, sample, &estimate)
            && let Some(phase) = row.phase()
        {
            let phase = usize::from(phase == TruePhase::Inertia);
            for clutch in row.clutches.iter().filter(|clutch| !clutch.sticks) {
                torques.squares[phase] += Real::powi(clutch.torque_n_m[1] - clutch.torque_n_m[0], 2);
                torques.rows[phase] += 1.0;
            }
        }
        if (at + 1) % in_part == 0 || at + 1 == recording.samples.len() {
            result.learnt.push(sampled.errors(known, &tables, &filter, state.learnt()));
            result.torques.push(std::mem::take(&mut torques));
        }
    }
    result.shifts = state.learnt().shifts;
    Ok(result)
}

fn record(known: &Car, sampled: &SampledCar, drive: &Drive) -> Result<Recording, EvaluateError> {
    let drive = Drive { sample_time_s: RECORD_S, ..drive.clone() };
    let model = CarModel::new(sampled.car.clone())?;
    let mut recording = Recording::default();
    simulate_car_drive(&model, known, CarCalibration::of(drive.controller), &drive, |sample| recording.push(sample))?;
    Ok(recording)
}
