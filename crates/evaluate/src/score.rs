//! Truth and estimates of a shift row by row, and the errors over them.

use car::{Car, ErrorBudget, Sensors};
use drivetrain::Real;
use observer::gearbox::{GearboxFilter, GearboxState, ShiftEstimate, ShiftInput};
use observer::{Health, ShiftTables, gearbox_filter};
use plant::car::{CarCalibration, CarModel, CarSample, CarShift, ElementSample, simulate_car_shift};

use crate::recording::{Recording, records_in_a_sample};
use crate::{CARRIES_N_M, EvaluateError, RECORD_S, ROUNDING_N_M, ROUNDING_PA};

/// Truth and estimates of one clutch at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClutchRow {
    /// Torque, N m: true (not a number where it is not known), estimated, by the valve model alone; in a simulation this in the true
    /// direction.
    pub torque_n_m: [f64; 3],
    /// Standard deviation of the estimated torque by the filter, N m; not a number where it gives none.
    pub torque_std_dev_n_m: f64,
    /// The same of the pressure, Pa.
    pub pressure_std_dev_pa: f64,
    /// Pressure, Pa: true (not a number where it is not known), estimated, by the valve model alone.
    pub pressure_pa: [f64; 3],
    /// Slip, rad/s; by the readings where the true one is not known.
    pub slip_rad_s: f64,
    /// Where turbine or output speed has not come for a while: the slips that it can have; not numbers where nothing is known of them.
    pub slip_range_rad_s: Option<[f64; 2]>,
    /// Its slip per turbine speed, `alpha`: the turbine feels `alpha` times its torque.
    pub alpha: f64,
    /// What of the estimated torque is the drag of its plates, N m.
    pub drag_n_m: f64,
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
    /// Whether pressure makes it hold: not that of a one-way clutch or a dog.
    pub has_pressure: bool,
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

/// Two standard deviations to either side of an estimate.
fn band(estimate: f64, std_dev: f64) -> Option<[f64; 2]> {
    let half = 2.0 * std_dev;
    (estimate.is_finite() && half.is_finite()).then_some([estimate - half, estimate + half])
}

impl ClutchRow {
    /// Two standard deviations of the filter to either side of the torque, N m, where it gives one.
    pub fn torque_band_n_m(&self) -> Option<[f64; 2]> {
        band(self.torque_n_m[1], self.torque_std_dev_n_m)
    }

    /// The same of the pressure, Pa, which is never below zero.
    pub fn pressure_band_pa(&self) -> Option<[f64; 2]> {
        band(self.pressure_pa[1], self.pressure_std_dev_pa).map(|[low, high]| [low.max(0.0), high])
    }

    /// A clutch of which nothing is known but whether it sticks.
    pub(crate) fn unknown(sticks: bool) -> Self {
        Self {
            torque_n_m: [f64::NAN; 3],
            torque_std_dev_n_m: f64::NAN,
            pressure_std_dev_pa: f64::NAN,
            pressure_pa: [f64::NAN; 3],
            slip_rad_s: f64::NAN,
            slip_range_rad_s: None,
            alpha: f64::NAN,
            drag_n_m: 0.0,
            sticks,
            has_pressure: true,
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
                let clutch = &self.clutches[usize::from(off)];
                let [truth, estimate, _] = clutch.torque_n_m;
                let torque_n_m = if truth.is_nan() { estimate - clutch.drag_n_m } else { truth };
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
) -> Result<Vec<ShiftScoreRow>, EvaluateError> {
    let samples = simulated(known, truth, shift)?;
    let budget = ErrorBudget::of_car(known).read_by(known, Some(sensors));
    let tables = ShiftTables::of_car(known, &budget).map_err(EvaluateError::TooManyElements)?;
    let filter = gearbox_filter(known, &tables, &budget, Some(sensors));
    let inputs = inputs(known, &tables, &samples, sensors, seed);
    Ok(score_samples(&tables, &filter, &samples, &inputs))
}

/// A shift of the car `known` that truly is `truth`, recorded as [`inputs`] needs it.
///
/// # Errors
/// The gears have no shift between two clutches, or the simulation fails.
pub fn simulated(known: &Car, truth: &Car, shift: &CarShift) -> Result<Vec<CarSample>, EvaluateError> {
    let model = CarModel::new(truth.clone())?;
    let mut samples = Vec::new();
    let shift = CarShift { sample_time_s: RECORD_S, ..*shift };
    simulate_car_shift(&model, known, CarCalibration::STANDARD, &shift, |sample| samples.push(*sample))?;
    Ok(samples)
}

/// What the filter reads of a drive that was recorded every [`RECORD_S`], every [`SAMPLE_S`](crate::SAMPLE_S); each with the place of its sample.
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
    filter: &GearboxFilter<'_, f64>,
    samples: &[CarSample],
    inputs: &[(usize, ShiftInput<f64>)],
) -> Vec<ShiftScoreRow> {
    score_from(tables, filter, &mut filter.start(), samples, inputs)
}

/// The same by a filter that goes on from a state: with what it has learnt.
pub fn score_from(
    tables: &ShiftTables<f64>,
    filter: &GearboxFilter<'_, f64>,
    state: &mut GearboxState<f64>,
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
pub fn within(range: Option<[f64; 2]>, value: f64, tolerance: f64) -> bool {
    value.is_nan() || range.is_none_or(|[low, high]| low - tolerance <= value && value <= high + tolerance)
}

/// The truth of a shift in the place of its estimate; `None` outside of shifts.
pub(crate) fn true_row(sample: &CarSample) -> Option<ShiftScoreRow> {
    let under_way = sample.shift.as_ref()?;
    let of = |truth: &ElementSample| ClutchRow {
        torque_n_m: [truth.torque_n_m; 3],
        torque_std_dev_n_m: f64::NAN,
        pressure_std_dev_pa: f64::NAN,
        pressure_pa: [truth.pressure_pa; 3],
        slip_rad_s: truth.slip_rad_s,
        slip_range_rad_s: None,
        alpha: f64::NAN,
        drag_n_m: 0.0,
        sticks: truth.sticks,
        torque_range_n_m: None,
        pressure_range_pa: None,
        hidden: false,
        has_pressure: true,
        in_range: true,
    };
    Some(ShiftScoreRow {
        time_s: sample.time_s,
        clutches: [of(&under_way.offgoing), of(&under_way.oncoming)],
        turbine_n_m: [sample.turbine_n_m; 2],
        at_turbine_n_m: None,
        speeds_rad_s: [
            sample.torques.engine_rad_s,
            sample.torques.turbine_rad_s,
            sample.torques.output_rad_s,
            sample.wheel_rad_s,
        ],
        flare_rad_s: f64::NAN,
        phase: "-",
        health: Health::Good,
    })
}

/// The row of a shift at a sample, with its estimate; `None` where no shift is under way or the filter has none.
pub fn row(tables: &ShiftTables<f64>, sample: &CarSample, estimate: &ShiftEstimate<f64>) -> Option<ShiftScoreRow> {
    let under_way = sample.shift.as_ref()?;
    let clutches = estimate.clutches.as_ref()?;
    let alphas = tables.tables().shift(under_way.from, under_way.to).map(|row| row.clutches.map(|clutch| clutch.alpha));
    let of = |c: usize| {
        let (truth, found) = ([&under_way.offgoing, &under_way.oncoming][c], &clutches[c]);
        (found.element.place() == tables.place(truth.element)).then(|| {
            ClutchRow {
                // A valve model knows no direction: it is told the true one. Else noise of a slip that is not yet seen would be its error.
                torque_n_m: [truth.torque_n_m, found.torque_n_m, found.open_loop_n_m.abs().copysign(truth.torque_n_m)],
                torque_std_dev_n_m: found.std_dev_n_m,
                pressure_std_dev_pa: found.pressure_std_dev_pa,
                pressure_pa: [truth.pressure_pa, found.pressure_pa, found.valve_pa],
                slip_rad_s: truth.slip_rad_s,
                slip_range_rad_s: None,
                alpha: alphas.map_or(f64::NAN, |alphas| alphas[c]),
                drag_n_m: 0.0,
                sticks: truth.sticks,
                torque_range_n_m: found.torque_range_n_m,
                pressure_range_pa: found.pressure_range_pa,
                hidden: found.hidden,
                has_pressure: found.element.has_pressure(),
                in_range: within(found.pressure_range_pa, truth.pressure_pa, ROUNDING_PA)
                    && within(found.torque_range_n_m, truth.torque_n_m, ROUNDING_N_M),
            }
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
