//! The model of one shift while both of its elements slip.

use car::Car;
use drivetrain::clutch::drag_torque;
use drivetrain::{Real, ShiftKind};
use nalgebra::{DMatrix, DVector};
use observer::ShiftTables;

use super::clutch::{AtValve, ClutchModel};
use super::quantities::{DELAY_UNIT_S, KISS_UNIT_PA, Quantities, Quantity};
use super::shift_log::{ShiftLog, is_fitted, transmitting};
use crate::Series;
use crate::driving::{DELAY_STEP, DRAG_SD_N_M, DRAG_UNIT_N_M, INPUT_SD_FRACTION};
use crate::pressure::{Grid, Hydraulics};

/// Step of the integrals, s.
const STEP_S: f64 = 0.002;
/// Own unknowns of a shift: the turbine speed at its begin, rad/s, and an error of the torque at the turbine, N m, whose standard
/// deviation is that of the torque at the input.
pub(crate) const OWN: usize = 2;
/// Standard deviation of the first, rad/s: nothing is known of it.
const START_SD_RAD_S: f64 = 50.0;

/// A shift with what does not change during a fit.
#[derive(Debug, Clone)]
pub(crate) struct ShiftModel {
    pub(crate) kind: Option<ShiftKind>,
    pub(crate) pair: usize,
    grid: Grid,
    /// Of the offgoing and the oncoming element; none of one that transmits no torque while both slip.
    clutches: [Option<ClutchModel>; 2],
    /// Without a converter the reported engine torque, N m.
    reported: Option<Series>,
    /// Torque at the input by the file, and the part of it by the torque ratio above 1, N m.
    input_n_m: Vec<f64>,
    above_one_n_m: Vec<f64>,
    /// By how much both change with the unknown of the delay of the engine speed in front of a converter, N m.
    by_engine_delay_n_m: Vec<[f64; 2]>,
    /// Torque at the turbine by the drag of the elements that slip: by the file, and by each with a peak of 1 N m, N m.
    drag_n_m: Vec<f64>,
    drag_of_one_n_m: Vec<(usize, Vec<f64>)>,
    /// `M11`, kg m^2.
    inertia_kg_m2: f64,
    /// By how much the output speed has slowed the turbine down until each reading by `M12/M11` of the file, rad/s. With another `M11`
    /// that ratio stays: with `M12` as it is, a greater common factor of all torques would be a smaller noise of this reading.
    by_output: Vec<f64>,
    pub(crate) time_s: Vec<f64>,
    pub(crate) reading: Vec<f64>,
    /// Standard deviations of its own unknowns.
    pub(crate) own_sd: [f64; OWN],
}

/// A shift about unknowns: residuals without its own unknowns, and derivatives of the predicted speed.
pub(crate) struct Linearised {
    pub(crate) residuals: DVector<f64>,
    pub(crate) by_parameter: DMatrix<f64>,
    pub(crate) by_own: DMatrix<f64>,
    /// Of the clutches whose pressure is measured.
    pub(crate) pressure: Vec<MeasuredPressure>,
}

/// The measured pressure of a clutch about unknowns, Pa: residuals, and derivatives of the prediction.
pub(crate) struct MeasuredPressure {
    pub(crate) residuals: DVector<f64>,
    pub(crate) by_parameter: DMatrix<f64>,
}

/// The unknowns of a fit, and the derivatives of a shift's angular momentum by them.
pub(super) struct Unknowns<'a> {
    pub(super) quantities: &'a Quantities,
    pub(super) at: &'a [f64],
    by_momentum: DMatrix<f64>,
}

impl Unknowns<'_> {
    pub(super) fn of(&self, quantity: Quantity) -> f64 {
        self.quantities.place(quantity).map_or(0.0, |place| self.at[place])
    }

    /// Adds to the derivative by a quantity.
    fn put(&mut self, quantity: Quantity, momentum: &[f64]) {
        if let Some(place) = self.quantities.place(quantity) {
            let mut column = self.by_momentum.column_mut(place);
            column.iter_mut().zip(momentum).for_each(|(cell, value)| *cell += value);
        }
    }
}

impl ShiftModel {
    /// The model of a shift of a car; none if the car has no such shift.
    pub(crate) fn new(car: &Car, tables: &ShiftTables<f64>, quantities: &Quantities, log: &ShiftLog) -> Option<Self> {
        let rows = tables.tables();
        let row = rows.shift(log.gears[0], log.gears[1])?;
        let [begin_s, end_s] = log.slip_s;
        let points = ((end_s - begin_s).max(0.0) / STEP_S).ceil() as usize + 2;
        let grid = Grid { begin_s, step_s: STEP_S, points };
        let times = || (0..points).map(|i| grid.time_s(i));
        let torques = times().map(|time_s| input(car, log, time_s));
        let (input_n_m, above_one_n_m): (Vec<f64>, Vec<f64>) = torques.unzip();
        let by_engine_delay_n_m = times().map(|time_s| by_engine_delay(car, log, time_s)).collect();
        let is_used = transmitting(row);
        let clutches = [0, 1].map(|which| {
            let model = || ClutchModel::new((car, tables, quantities), row, (log, which), grid);
            is_used[which].then(model).flatten()
        });
        if !is_fitted(row) || clutches.each_ref().map(Option::is_some) != is_used {
            return None;
        }
        let (time_s, reading): (Vec<f64>, Vec<f64>) = log.turbine.between(log.slip_s).unzip();
        let start = log.output.at(begin_s);
        let by_output = time_s
            .iter()
            .map(|time_s| row.mass_kg_m2[0][1] / row.mass_kg_m2[0][0] * (log.output.at(*time_s) - start))
            .collect();
        let (drag_n_m, drag_of_one_n_m) = drag(car, tables, log, grid)?;
        let mean = input_n_m.iter().sum::<f64>() / points as f64;
        Some(Self {
            kind: log.kind(car, mean),
            pair: quantities.pair(log.gears[0], log.gears[1])?,
            grid,
            clutches,
            reported: car.converter.is_none().then(|| log.engine_torque.clone()),
            input_n_m,
            above_one_n_m,
            by_engine_delay_n_m,
            drag_n_m,
            drag_of_one_n_m,
            inertia_kg_m2: row.mass_kg_m2[0][0],
            by_output,
            own_sd: [START_SD_RAD_S, Real::hypot(DRAG_SD_N_M, INPUT_SD_FRACTION * mean)],
            time_s,
            reading,
        })
    }

    /// Sums of the squares of the torque at the input, and of the part of it by the torque ratio above 1.
    pub(crate) fn input_squares(&self) -> [f64; 2] {
        [&self.input_n_m, &self.above_one_n_m].map(|torques| torques.iter().map(|torque| torque * torque).sum())
    }

    /// Places in the tables of its elements that transmit torque.
    pub(crate) fn elements(&self) -> impl Iterator<Item = usize> {
        self.clutches.iter().flatten().map(|clutch| clutch.place)
    }

    /// The same shift with another way to the pressure of an element; none where that element is not one of its clutches.
    pub(crate) fn with_hydraulics(&self, place: usize, change: impl Fn(&mut Hydraulics)) -> Option<Self> {
        let mut other = self.clone();
        other.clutches.iter_mut().flatten().find(|clutch| clutch.place == place)?.change(change);
        Some(other)
    }

    /// Measured pressures of both clutches, Pa, by their places, each beside that by the valve of the file.
    pub(super) fn pressures_beside(&self) -> Vec<(usize, [f64; 2])> {
        let of = |clutch: &ClutchModel| {
            clutch.beside(self.grid).into_iter().map(|both| (clutch.place, both)).collect::<Vec<_>>()
        };
        self.clutches.iter().flatten().flat_map(of).collect()
    }

    /// The same shift with all commands so much earlier.
    pub(crate) fn with_commands_earlier(&self, late_s: f64) -> Self {
        let mut other = self.clone();
        other.clutches.iter_mut().flatten().for_each(|clutch| clutch.move_commands(-late_s));
        other
    }

    /// Residuals and derivatives at unknowns.
    pub(crate) fn linearised(&self, quantities: &Quantities, at: &[f64]) -> Linearised {
        let rows = self.reading.len();
        let mut unknowns = Unknowns { quantities, at, by_momentum: DMatrix::zeros(rows, at.len()) };
        let mut momentum = self.input_momentum(&mut unknowns);
        let mut pressure = Vec::new();
        for clutch in self.clutches.iter().flatten() {
            let (of_clutch, measured) = self.clutch_momentum(clutch, &mut unknowns);
            momentum.iter_mut().zip(of_clutch).for_each(|(sum, more)| *sum += more);
            pressure.extend(measured);
        }
        let less: Vec<f64> = momentum.iter().map(|momentum| -momentum).collect();
        unknowns.put(Quantity::Inertia(self.pair), &less);
        let inertia = self.inertia_kg_m2 * Real::exp(unknowns.of(Quantity::Inertia(self.pair)));
        let speeds = momentum.iter().zip(&self.by_output).map(|(momentum, output)| momentum / inertia - output);
        let residuals = self.reading.iter().zip(speeds).map(|(reading, speed)| reading - speed);
        let by_own = DMatrix::from_fn(rows, OWN, |row, own| match own {
            0 => 1.0,
            _ => (self.time_s[row] - self.grid.begin_s) / inertia,
        });
        Linearised {
            residuals: DVector::from_iterator(rows, residuals),
            by_parameter: unknowns.by_momentum / inertia,
            by_own,
            pressure,
        }
    }

    /// Angular momentum of the turbine by the torque at the input and the drag, at the readings.
    fn input_momentum(&self, unknowns: &mut Unknowns<'_>) -> Vec<f64> {
        let [capacity, ratio] =
            [Quantity::Input, Quantity::TorqueRatio].map(|quantity| Real::exp(unknowns.of(quantity)));
        let late = unknowns.of(Quantity::InputDelay);
        let late_n_m = self.reported_n_m(late);
        let engine_late = unknowns.of(Quantity::EngineDelay);
        let torques = late_n_m.as_ref().unwrap_or(&self.input_n_m).iter().zip(&self.above_one_n_m);
        let (input, above): (Vec<f64>, Vec<f64>) = (torques.zip(&self.by_engine_delay_n_m))
            .map(|((all, above), by)| {
                let [all, above] = [all + engine_late * by[0], above + engine_late * by[1]];
                (capacity * (all + (ratio - 1.0) * above), capacity * ratio * above)
            })
            .unzip();
        let by_late = self.by_engine_delay_n_m.iter().map(|[all, above]| capacity * (all + (ratio - 1.0) * above));
        unknowns.put(Quantity::EngineDelay, &self.integral(&by_late.collect::<Vec<_>>()));
        let mut momentum = self.integral(&input);
        unknowns.put(Quantity::Input, &momentum);
        if let (Some(now), Some(later)) = (&late_n_m, self.reported_n_m(late + DELAY_STEP)) {
            let change = later.iter().zip(now).map(|(later, now)| capacity * (later - now) / DELAY_STEP);
            unknowns.put(Quantity::InputDelay, &self.integral(&change.collect::<Vec<_>>()));
        }
        unknowns.put(Quantity::TorqueRatio, &self.integral(&above));
        momentum.iter_mut().zip(self.integral(&self.drag_n_m)).for_each(|(sum, more)| *sum += more);
        for (place, of_one_n_m) in &self.drag_of_one_n_m {
            let by_drag: Vec<f64> = self.integral(of_one_n_m).into_iter().map(|by| DRAG_UNIT_N_M * by).collect();
            let peak = unknowns.of(Quantity::Drag(*place));
            momentum.iter_mut().zip(&by_drag).for_each(|(sum, by)| *sum += peak * by);
            unknowns.put(Quantity::Drag(*place), &by_drag);
        }
        momentum
    }

    /// The same by a clutch, and residuals of its measured pressure.
    fn clutch_momentum(
        &self,
        clutch: &ClutchModel,
        unknowns: &mut Unknowns<'_>,
    ) -> (Vec<f64>, Option<MeasuredPressure>) {
        let place = clutch.place;
        let found = clutch.with_derivatives(self.grid, unknowns);
        let (pressure, kiss_pa) = (&found.pressure_pa, found.kiss_pa);
        let factor = Real::exp(unknowns.of(Quantity::Torque(place)));
        let slope = |i: usize| if pressure[i] > kiss_pa { -factor * clutch.per_pa[i] } else { 0.0 };
        let scaled = |by: &dyn Fn(usize) -> f64| -> Vec<f64> {
            self.integral(&(0..pressure.len()).map(|i| slope(i) * by(i)).collect::<Vec<_>>())
        };
        let momentum = scaled(&|i| pressure[i] - kiss_pa);
        unknowns.put(Quantity::Torque(place), &momentum);
        unknowns.put(Quantity::Kiss(place), &scaled(&|_| -KISS_UNIT_PA));
        found.by.iter().for_each(|(quantity, change)| unknowns.put(*quantity, &scaled(&|i| change[i])));
        let measured = clutch.measured(self.grid, unknowns, &found);
        (momentum, measured)
    }

    /// The reported engine torque at the points of the grid with this unknown of its delay.
    fn reported_n_m(&self, late: f64) -> Option<Vec<f64>> {
        let reported = self.reported.as_ref()?;
        Some((0..self.grid.points).map(|i| reported.at(self.grid.time_s(i) - DELAY_UNIT_S * late)).collect())
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
        self.time_s.iter().map(|time_s| self.grid.at(&sums, *time_s)).collect()
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

/// By how much both change with the unknown of a delay of the engine speed: a reading that is late belongs to an earlier time.
fn by_engine_delay(car: &Car, log: &ShiftLog, time_s: f64) -> [f64; 2] {
    let Some(converter) = &car.converter else { return [0.0; 2] };
    // A unit to each side, so that the noise of single readings counts less.
    let [later, earlier] = [DELAY_UNIT_S, -DELAY_UNIT_S].map(|late_s| {
        let torques = converter.torques(log.engine.at(time_s + late_s), log.turbine.at(time_s));
        [torques.turbine_n_m, torques.turbine_n_m - torques.pump_n_m]
    });
    [0, 1].map(|part| 0.5 * (later[part] - earlier[part]))
}

/// Torque at the turbine by the drag of the elements that are not held, at the points of the grid: of all by the file, and of each with a peak of
/// 1 N m, by its place in the tables. An element brakes the turbine by as much of its drag as its slip changes with the turbine speed.
#[expect(clippy::type_complexity, reason = "a value over time, and one of each element")]
fn drag(
    car: &Car,
    tables: &ShiftTables<f64>,
    log: &ShiftLog,
    grid: Grid,
) -> Option<(Vec<f64>, Vec<(usize, Vec<f64>)>)> {
    let slips = car.gearbox.slips_in_shift(car.gearbox.shift(log.gears[0], log.gears[1])?)?;
    let (mut file_n_m, mut each) = (vec![0.0; grid.points], Vec::new());
    for (at, (clutch, slip)) in car.clutches.iter().zip(slips).enumerate().filter(|(_, (_, slip))| *slip != [0.0; 2]) {
        let Some(clutch) = clutch else { continue };
        let of_one = |time_s: f64| {
            let slip_rad_s = slip[0] * log.turbine.at(time_s) + slip[1] * log.output.at(time_s);
            -slip[0] * drag_torque(1.0, slip_rad_s)
        };
        let of_one: Vec<f64> = (0..grid.points).map(|i| of_one(grid.time_s(i))).collect();
        file_n_m.iter_mut().zip(&of_one).for_each(|(sum, of_one)| *sum += clutch.drag_n_m * of_one);
        each.extend(tables.place(at).map(|place| (place, of_one)));
    }
    Some((file_n_m, each))
}

/// Torque of both clutches of a shift by the valve models of a file alone; zero of one that transmits none, as its one-way clutch overruns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OpenLoop {
    /// Time in the log, s.
    pub time_s: f64,
    /// Size of the torque of offgoing and oncoming clutch at the clutch by pressure and friction, N m.
    pub torque_n_m: [f64; 2],
    /// Their pressures, Pa.
    pub pressure_pa: [f64; 2],
}

/// What the valves and the friction of a vehicle file say of a shift while both clutches slip, at each reading of the turbine speed.
pub fn open_loop(car: &Car, tables: &ShiftTables<f64>, log: &ShiftLog) -> Vec<OpenLoop> {
    let quantities = Quantities::of(car, tables, std::slice::from_ref(log), [false; 2]);
    let rows = tables.tables();
    let row = rows.shift(log.gears[0], log.gears[1]);
    let (Some(model), Some(row)) = (ShiftModel::new(car, tables, &quantities, log), row) else { return Vec::new() };
    let clutches = model.clutches.each_ref().map(Option::as_ref);
    let pressure = clutches.map(|clutch| clutch.map(|clutch| clutch.pressures(model.grid, &AtValve::default())));
    let of_reading = |time_s: &f64| {
        let i = ((time_s - model.grid.begin_s) / model.grid.step_s).round() as usize;
        let pressure_pa = pressure.each_ref().map(|pressure| pressure.as_ref().map_or(0.0, |pressure| pressure[i]));
        let torque = |which: usize| {
            let Some(clutch) = clutches[which] else { return 0.0 };
            clutch.per_pa[i].abs() * (pressure_pa[which] - clutch.kiss_pa).max(0.0) / row.clutches[which].alpha.abs()
        };
        OpenLoop { time_s: *time_s, torque_n_m: [0, 1].map(torque), pressure_pa }
    };
    model.time_s.iter().map(of_reading).collect()
}
