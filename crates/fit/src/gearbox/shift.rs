//! The model of one shift while both of its clutches slip.

use config::Car;
use design::ShiftTables;
use drivetrain::{ClutchValve, ShiftKind};
use nalgebra::{DMatrix, DVector};
use observer::any_shift::ShiftRow;

use super::quantities::{DELAY_UNIT_S, DRAG_UNIT_N_M, KISS_UNIT_PA, Quantities, Quantity};
use super::shift_log::ShiftLog;
use crate::Series;
use crate::pressure::{Grid, pressures};

/// Step of the integrals, s.
const STEP_S: f64 = 0.002;
/// Own unknowns of a shift: the turbine speed at its begin, rad/s, and an error of the torque at the turbine, N m.
pub(crate) const OWN: usize = 2;
/// Deviation of the first, rad/s: nothing is known of it.
const START_SD_RAD_S: f64 = 50.0;
/// Deviation of the second: drag of the open elements from shift to shift, N m \[chosen\], and a share of the torque at the input by the shape of the
/// converter's maps \[chosen, as in the filter\].
const DRAG_SD_N_M: f64 = 1.0;
const INPUT_SD_SHARE: f64 = 0.03;
/// Steps for the derivatives by the logarithm of a lag and by a delay in its unit.
const LAG_STEP: f64 = 0.02;
const DELAY_STEP: f64 = 0.1;

/// A clutch of the shift.
#[derive(Debug, Clone)]
struct ClutchModel {
    place: usize,
    commands: Series,
    valve: ClutchValve<f64>,
    hysteresis_pa: f64,
    kiss_pa: f64,
    /// Torque at the turbine per pressure above the kiss point, at the points of the grid, N m/Pa.
    per_pa: Vec<f64>,
}

/// A shift with what does not change during a fit.
#[derive(Debug, Clone)]
pub(crate) struct ShiftModel {
    pub(crate) kind: Option<ShiftKind>,
    pub(crate) pair: usize,
    grid: Grid,
    clutches: [ClutchModel; 2],
    /// Torque at the input by the file, and the part of it by the torque ratio above 1, N m.
    input_n_m: Vec<f64>,
    above_one_n_m: Vec<f64>,
    /// `M11`, kg m^2.
    inertia_kg_m2: f64,
    /// By how much the output speed has slowed the turbine down until each reading by `M12/M11` of the file, rad/s. With another `M11`
    /// that ratio stays: with `M12` as it is, a greater common factor of all torques would be a smaller noise of this reading.
    by_output: Vec<f64>,
    pub(crate) time_s: Vec<f64>,
    pub(crate) reading: Vec<f64>,
    /// Deviations of its own unknowns.
    pub(crate) own_sd: [f64; OWN],
}

/// A shift about unknowns: residuals without its own unknowns, and derivatives of the predicted speed.
pub(crate) struct Linearised {
    pub(crate) residuals: DVector<f64>,
    pub(crate) by_parameter: DMatrix<f64>,
    pub(crate) by_own: DMatrix<f64>,
}

impl ShiftModel {
    /// The model of a shift of a car; none if the car has no such shift.
    pub(crate) fn new(car: &Car, tables: &ShiftTables<f64>, quantities: &Quantities, log: &ShiftLog) -> Option<Self> {
        let rows = tables.tables();
        let row = rows.shift(log.gears[0], log.gears[1])?;
        let [begin_s, end_s] = log.slip_s;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "seconds over milliseconds")]
        let points = ((end_s - begin_s).max(0.0) / STEP_S).ceil() as usize + 2;
        let grid = Grid { begin_s, step_s: STEP_S, points };
        let times = || (0..points).map(|i| grid.time_s(i));
        let torques = times().map(|time_s| input(car, log, time_s));
        let (input_n_m, above_one_n_m): (Vec<f64>, Vec<f64>) = torques.unzip();
        let clutches = [0, 1].map(|which| clutch(car, tables, row, log, which, grid));
        let [Some(offgoing), Some(oncoming)] = clutches else { return None };
        let (time_s, reading): (Vec<f64>, Vec<f64>) = log.turbine.between(log.slip_s).unzip();
        let start = log.output.at(begin_s);
        let by_output = time_s
            .iter()
            .map(|time_s| row.mass_kg_m2[0][1] / row.mass_kg_m2[0][0] * (log.output.at(*time_s) - start))
            .collect();
        let mean = input_n_m.iter().sum::<f64>() / points as f64;
        Some(Self {
            kind: log.kind(car, mean),
            pair: quantities.pair(log.gears[0], log.gears[1])?,
            grid,
            clutches: [offgoing, oncoming],
            input_n_m,
            above_one_n_m,
            inertia_kg_m2: row.mass_kg_m2[0][0],
            by_output,
            own_sd: [START_SD_RAD_S, DRAG_SD_N_M.hypot(INPUT_SD_SHARE * mean)],
            time_s,
            reading,
        })
    }

    /// Places of its elements in the tables.
    pub(crate) fn elements(&self) -> [usize; 2] {
        self.clutches.each_ref().map(|clutch| clutch.place)
    }

    /// Residuals and derivatives at unknowns.
    pub(crate) fn linearised(&self, quantities: &Quantities, at: &[f64]) -> Linearised {
        let of = |quantity: Quantity| quantities.place(quantity).map_or(0.0, |place| at[place]);
        let inertia = self.inertia_kg_m2 * of(Quantity::Inertia(self.pair)).exp();
        let rows = self.reading.len();
        let mut by_parameter = DMatrix::zeros(rows, at.len());
        let mut put = |quantity: Quantity, momentum: &[f64]| {
            if let Some(place) = quantities.place(quantity) {
                let mut column = by_parameter.column_mut(place);
                column.iter_mut().zip(momentum).for_each(|(cell, value)| *cell += value / inertia);
            }
        };
        let capacity = of(Quantity::Input).exp();
        let ratio = of(Quantity::TorqueRatio).exp();
        let torques = self.input_n_m.iter().zip(&self.above_one_n_m);
        let input: Vec<f64> = torques.map(|(all, above)| capacity * (all + (ratio - 1.0) * above)).collect();
        let mut momentum = self.integral(&input);
        put(Quantity::Input, &momentum);
        let above: Vec<f64> = self.above_one_n_m.iter().map(|above| capacity * ratio * above).collect();
        put(Quantity::TorqueRatio, &self.integral(&above));
        let drag: Vec<f64> = self.integral(&vec![-DRAG_UNIT_N_M; input.len()]);
        put(Quantity::Drag, &drag);
        let braked = momentum.iter().zip(&drag).map(|(sum, drag)| sum + of(Quantity::Drag) * drag);
        momentum = braked.collect();
        for clutch in &self.clutches {
            let (torque, kiss) = (Quantity::Torque(clutch.place), Quantity::Kiss(clutch.place));
            let lag = Quantity::Lag(clutch.place);
            let late = of(Quantity::Delay);
            let (factor, kiss_pa) = (of(torque).exp(), clutch.kiss_pa + KISS_UNIT_PA * of(kiss));
            let pressure = clutch.pressures(self.grid, of(lag), late);
            let slope = |i: usize| if pressure[i] > kiss_pa { -factor * clutch.per_pa[i] } else { 0.0 };
            let scaled = |by: &dyn Fn(usize) -> f64| -> Vec<f64> {
                self.integral(&(0..pressure.len()).map(|i| slope(i) * by(i)).collect::<Vec<_>>())
            };
            let of_clutch = scaled(&|i| pressure[i] - kiss_pa);
            put(torque, &of_clutch);
            put(kiss, &scaled(&|_| -KISS_UNIT_PA));
            let slower = clutch.pressures(self.grid, of(lag) + LAG_STEP, late);
            put(lag, &scaled(&|i| (slower[i] - pressure[i]) / LAG_STEP));
            let later = clutch.pressures(self.grid, of(lag), late + DELAY_STEP);
            put(Quantity::Delay, &scaled(&|i| (later[i] - pressure[i]) / DELAY_STEP));
            momentum.iter_mut().zip(of_clutch).for_each(|(sum, more)| *sum += more);
        }
        let less: Vec<f64> = momentum.iter().map(|momentum| -momentum).collect();
        put(Quantity::Inertia(self.pair), &less);
        let speeds = momentum.iter().zip(&self.by_output).map(|(momentum, output)| momentum / inertia - output);
        let residuals = self.reading.iter().zip(speeds).map(|(reading, speed)| reading - speed);
        let by_own = DMatrix::from_fn(rows, OWN, |row, own| match own {
            0 => 1.0,
            _ => (self.time_s[row] - self.grid.begin_s) / inertia,
        });
        Linearised { residuals: DVector::from_iterator(rows, residuals), by_parameter, by_own }
    }

    /// The integral of values at the points of the grid until each reading.
    fn integral(&self, values: &[f64]) -> Vec<f64> {
        let mut sums = Vec::with_capacity(values.len());
        let mut sum = 0.0;
        sums.push(sum);
        for pair in values.windows(2) {
            sum += 0.5 * self.grid.step_s * (pair[0] + pair[1]);
            sums.push(sum);
        }
        let at = |time_s: &f64| {
            let place = (time_s - self.grid.begin_s) / self.grid.step_s;
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the grid")]
            let before = (place.max(0.0) as usize).min(sums.len().saturating_sub(2));
            sums[before] + (place - before as f64) * (sums[before + 1] - sums[before])
        };
        self.time_s.iter().map(at).collect()
    }
}

impl ClutchModel {
    fn pressures(&self, grid: Grid, log_lag: f64, late: f64) -> Vec<f64> {
        let valve = self.valve.changed(log_lag.exp(), 1.0, None);
        pressures(&valve, self.hysteresis_pa, DELAY_UNIT_S * late, &self.commands, grid)
    }
}

/// Torque at the gearbox input, N m, and the part of it by the torque ratio above 1.
fn input(car: &Car, log: &ShiftLog, time_s: f64) -> (f64, f64) {
    match &car.converter {
        Some(converter) => {
            let torques = converter.torques(log.engine.at(time_s), log.turbine.at(time_s));
            (torques.turbine_n_m, torques.turbine_n_m - torques.pump_n_m)
        }
        None => (log.engine_torque.at(time_s), 0.0),
    }
}

/// The model of the offgoing (0) or oncoming (1) clutch.
fn clutch(
    car: &Car,
    tables: &ShiftTables<f64>,
    row: &ShiftRow<f64>,
    log: &ShiftLog,
    which: usize,
    grid: Grid,
) -> Option<ClutchModel> {
    let shift = row.clutches[which];
    let element = (0..car.clutches.len()).find(|at| tables.place(*at) == Some(shift.element))?;
    let known = car.clutches[element].as_ref()?;
    let per_pa = (0..grid.points).map(|i| {
        let time_s = grid.time_s(i);
        let slip = log.turbine.at(time_s) - shift.ratio * log.output.at(time_s);
        let per_force = known.clutch.torque_per_force(shift.alpha * slip);
        slip.signum() * shift.alpha.abs() * per_force * known.clutch.piston_area_m2
    });
    Some(ClutchModel {
        place: shift.element,
        commands: log.commands[which].clone(),
        valve: known.valve,
        hysteresis_pa: known.hysteresis_pa,
        kiss_pa: known.clutch.kiss_pressure(),
        per_pa: per_pa.collect(),
    })
}

/// Torque of both clutches of a shift by the valve models of a file alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OpenLoop {
    /// Time in the log, s.
    pub time_s: f64,
    /// Size of the torque of offgoing and oncoming clutch at the clutch, N m.
    pub torque_n_m: [f64; 2],
    /// Their pressures, Pa.
    pub pressure_pa: [f64; 2],
}

/// What the valves and the friction of a vehicle file say of a shift while both clutches slip, at each reading of the turbine speed.
pub fn open_loop(car: &Car, tables: &ShiftTables<f64>, log: &ShiftLog) -> Vec<OpenLoop> {
    let quantities = Quantities::of(car, tables, std::slice::from_ref(log));
    let rows = tables.tables();
    let row = rows.shift(log.gears[0], log.gears[1]);
    let (Some(model), Some(row)) = (ShiftModel::new(car, tables, &quantities, log), row) else { return Vec::new() };
    let pressure = model.clutches.each_ref().map(|clutch| clutch.pressures(model.grid, 0.0, 0.0));
    let of_reading = |time_s: &f64| {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the grid")]
        let i = ((time_s - model.grid.begin_s) / model.grid.step_s).round() as usize;
        let torque = |which: usize| {
            let clutch = &model.clutches[which];
            clutch.per_pa[i].abs() * (pressure[which][i] - clutch.kiss_pa).max(0.0) / row.clutches[which].alpha.abs()
        };
        OpenLoop { time_s: *time_s, torque_n_m: [0, 1].map(torque), pressure_pa: [0, 1].map(|c| pressure[c][i]) }
    };
    model.time_s.iter().map(of_reading).collect()
}
