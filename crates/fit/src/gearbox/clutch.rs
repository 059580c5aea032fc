//! A clutch of a shift: the pressure on its plates from the commands of its valve.
//!
//! A piston with a stroke is carried from the commands that were kept from before the shift: an element that is applied again before it is empty has
//! oil left, and kisses earlier.

use car::Car;
use drivetrain::{Cylinder, Real};
use nalgebra::{DMatrix, DVector};
use observer::ShiftTables;
use observer::gearbox::ShiftRow;

use super::quantities::{DELAY_UNIT_S, KISS_UNIT_PA, Quantities, Quantity};
use super::shift::{MeasuredPressure, Unknowns};
use super::shift_log::ShiftLog;
use crate::Series;
use crate::driving::DELAY_STEP;
use crate::fill::FILL_DROP_PA;
use crate::parameters::OFFSET_UNIT_PA;
use crate::pressure::{Grid, Hydraulics, pressures};

/// Steps for the derivatives by the logarithms of lag and gain, and by a kiss point in its unit.
const LAG_STEP: f64 = 0.02;
const GAIN_STEP: f64 = 0.02;
const KISS_STEP: f64 = 0.02;
/// Standard deviations of what is known of a kiss point, and of an unknown zero offset, above which a reading is beyond it.
const SURELY: f64 = 3.0;
/// Step of the course of a pressure in a fill, and longest fill that is looked for, s \[chosen\].
const FILL_STEP_S: f64 = 0.002;
const LONGEST_FILL_S: f64 = 3.0;
/// Lags of a cylinder at the end of a fast fill after which the end is forgotten: 5 % are left.
const LAGS: f64 = 3.0;

/// A clutch of a shift.
#[derive(Debug, Clone)]
pub(super) struct ClutchModel {
    pub(super) place: usize,
    commands: Series,
    /// Measured pressure while both clutches slip, Pa; of a piston with a stroke where that has surely ended.
    measured: Series,
    hydraulics: Hydraulics,
    pub(super) kiss_pa: f64,
    /// Torque at the turbine per pressure above the kiss point, at the points of the grid, N m/Pa.
    pub(super) per_pa: Vec<f64>,
}

/// The unknowns that make the pressure.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct AtValve {
    pub(super) lag: f64,
    pub(super) gain: f64,
    pub(super) late: f64,
    pub(super) kiss: f64,
}

/// Pressures at the points of a grid, Pa, the kiss point, both by the gain of the file, and derivatives of the pressures.
pub(super) struct Pressures {
    pub(super) pressure_pa: Vec<f64>,
    pub(super) kiss_pa: f64,
    pub(super) by: Vec<(Quantity, Vec<f64>)>,
}

impl ClutchModel {
    /// The model of the offgoing (0) or oncoming (1) clutch.
    pub(super) fn new(
        (car, tables, quantities): (&Car, &ShiftTables<f64>, &Quantities),
        row: &ShiftRow<f64>,
        (log, which): (&ShiftLog, usize),
        grid: Grid,
    ) -> Option<Self> {
        let shift = row.clutches[which];
        let place = shift.element.place()?;
        let element = tables.element_at(place)?;
        let known = car.clutches[element].as_ref()?;
        let per_pa = (0..grid.points).map(|i| {
            let time_s = grid.time_s(i);
            let slip = log.turbine.at(time_s) - shift.ratio * log.output.at(time_s);
            let per_force = known.clutch.torque_per_force(shift.alpha * slip);
            slip.signum() * shift.alpha.abs() * per_force * known.clutch.piston_area_m2
        });
        let (hydraulics, kiss_pa) = (Hydraulics::of(known), known.clutch.kiss_pressure());
        let measured = log.pressure[which].part(log.slip_s);
        let measured = match &hydraulics.cylinder {
            Some(cylinder) => {
                let sd = |quantity| quantities.place(quantity).map_or(0.0, |at| quantities.sd_before(at));
                let [kiss, offset] = [Quantity::Kiss(place), Quantity::PressureOffset(place)].map(sd);
                let sd_pa = Real::hypot(KISS_UNIT_PA * kiss, OFFSET_UNIT_PA * offset);
                filled_part(&measured, kiss_pa + SURELY * sd_pa, cylinder)
            }
            None => measured,
        };
        Some(Self {
            place,
            commands: log.commands[which].clone(),
            measured,
            hydraulics,
            kiss_pa,
            per_pa: per_pa.collect(),
        })
    }

    /// Changes the way to the pressure.
    pub(super) fn change(&mut self, change: impl Fn(&mut Hydraulics)) {
        change(&mut self.hydraulics);
    }

    /// Moves the commands to later times.
    pub(super) fn move_commands(&mut self, later_s: f64) {
        self.commands.time_s.iter_mut().for_each(|time_s| *time_s += later_s);
    }

    /// Pressures on the plates at the points of a grid, by the gain of the file, Pa.
    pub(super) fn pressures(&self, grid: Grid, at: &AtValve) -> Vec<f64> {
        self.pressures_of(&self.hydraulics, grid, at)
    }

    /// By the gain of the file: the true pressures, at which the valve has its lag and the piston its stroke, over the factor of the gain.
    fn pressures_of(&self, hydraulics: &Hydraulics, grid: Grid, at: &AtValve) -> Vec<f64> {
        let mut of = hydraulics.with_valve(at.lag, at.gain);
        of.set_kiss(self.kiss_at(at) * Real::exp(at.gain));
        let mut pressures = pressures(&of, DELAY_UNIT_S * at.late, &self.commands, grid);
        pressures.iter_mut().for_each(|pressure| *pressure *= Real::exp(-at.gain));
        pressures
    }

    fn kiss_at(&self, at: &AtValve) -> f64 {
        self.kiss_pa + KISS_UNIT_PA * at.kiss
    }

    /// Pressures on the plates at unknowns, with derivatives.
    pub(super) fn with_derivatives(&self, grid: Grid, unknowns: &Unknowns<'_>) -> Pressures {
        self.derived(&self.hydraulics, grid, unknowns)
    }

    fn derived(&self, hydraulics: &Hydraulics, grid: Grid, unknowns: &Unknowns<'_>) -> Pressures {
        let place = self.place;
        let quantities = [Quantity::Lag(place), Quantity::Gain(place), Quantity::Delay(place), Quantity::Kiss(place)];
        let [lag, gain, late, kiss] = quantities.map(|quantity| unknowns.of(quantity));
        let here = AtValve { lag, gain, late, kiss };
        let moved = [
            (LAG_STEP, AtValve { lag: lag + LAG_STEP, ..here }),
            (GAIN_STEP, AtValve { gain: gain + GAIN_STEP, ..here }),
            (DELAY_STEP, AtValve { late: late + DELAY_STEP, ..here }),
            (KISS_STEP, AtValve { kiss: kiss + KISS_STEP, ..here }),
        ];
        let pressure_pa = self.pressures_of(hydraulics, grid, &here);
        let change = |(step, other): &(f64, AtValve)| -> Vec<f64> {
            let other = self.pressures_of(hydraulics, grid, other);
            other.iter().zip(&pressure_pa).map(|(other, pressure)| (other - pressure) / step).collect()
        };
        // Without a stroke the pressure does not depend on the kiss point.
        let count = if hydraulics.cylinder.is_some() { moved.len() } else { moved.len() - 1 };
        let by = quantities.into_iter().zip(&moved).take(count).map(|(quantity, moved)| (quantity, change(moved)));
        Pressures { kiss_pa: self.kiss_at(&here), by: by.collect(), pressure_pa }
    }

    /// Measured pressures, Pa, each beside that by the valve of the file.
    pub(super) fn beside(&self, grid: Grid) -> Vec<[f64; 2]> {
        let hydraulics = self.hydraulics.cylinder.map_or(self.hydraulics, |_| self.hydraulics.filled());
        let modelled = self.pressures_of(&hydraulics, grid, &AtValve::default());
        let readings = self.measured.time_s.iter().zip(&self.measured.value);
        readings.map(|(time_s, value)| [*value, grid.at(&modelled, *time_s)]).collect()
    }

    /// Residuals of the measured pressure, and derivatives of its prediction; `found` is what acts on the plates at the same unknowns.
    pub(super) fn measured(&self, grid: Grid, unknowns: &Unknowns<'_>, found: &Pressures) -> Option<MeasuredPressure> {
        let Unknowns { quantities, at, .. } = unknowns;
        let rows = self.measured.len();
        let scale = quantities.place(Quantity::PressureScale).filter(|_| rows > 0)?;
        let gain = quantities.place(Quantity::Gain(self.place))?;
        // The readings are of an ended stroke, whenever the model ends it.
        let filled = self.hydraulics.cylinder.map(|_| self.derived(&self.hydraulics.filled(), grid, unknowns));
        let found = filled.as_ref().unwrap_or(found);
        let factor = Real::exp(at[scale] + at[gain]);
        let predicted = |values: &[f64]| -> DVector<f64> {
            let times = self.measured.time_s.iter();
            DVector::from_iterator(rows, times.map(|time_s| factor * grid.at(values, *time_s)))
        };
        let all = predicted(&found.pressure_pa);
        let mut by_parameter = DMatrix::zeros(rows, at.len());
        by_parameter.column_mut(scale).copy_from(&all);
        by_parameter.column_mut(gain).copy_from(&all);
        for (quantity, change) in &found.by {
            if let Some(place) = quantities.place(*quantity) {
                let mut column = by_parameter.column_mut(place);
                column += predicted(change);
            }
        }
        let mut residuals = DVector::from_column_slice(&self.measured.value) - all;
        if let Some(offset) = quantities.place(Quantity::PressureOffset(self.place)) {
            residuals.add_scalar_mut(-OFFSET_UNIT_PA * at[offset]);
            by_parameter.column_mut(offset).fill(OFFSET_UNIT_PA);
        }
        Some(MeasuredPressure { residuals, by_parameter })
    }
}

/// Time from a step of the command, from no pressure to [`FILL_DROP_PA`] above the kiss point, until the plates of a clutch touch, s, with this factor on
/// the volume of its stroke; none where they do not.
pub(super) fn fill_time_s(known: &car::ShiftClutch, at: &AtValve, stroke: f64) -> Option<f64> {
    let mut of = Hydraulics::of(known).with_valve(at.lag, at.gain);
    let kiss_pa = (known.clutch.kiss_pressure() + KISS_UNIT_PA * at.kiss) * Real::exp(at.gain);
    of.set_kiss(kiss_pa);
    of.scale_stroke(stroke);
    let mut commands = Series::default();
    commands.push(-1.0, of.valve.command_for(0.0));
    commands.push(0.0, of.valve.command_for(kiss_pa + FILL_DROP_PA));
    let grid = Grid { begin_s: 0.0, step_s: FILL_STEP_S, points: (LONGEST_FILL_S / FILL_STEP_S) as usize };
    let pressures = pressures(&of, DELAY_UNIT_S * at.late, &commands, grid);
    let after = pressures.iter().position(|pressure_pa| *pressure_pa >= kiss_pa).filter(|after| *after > 0)?;
    let [before_pa, after_pa] = [pressures[after - 1], pressures[after]];
    Some(FILL_STEP_S * (after as f64 - (after_pa - kiss_pa) / (after_pa - before_pa)))
}

/// The readings at which a piston has surely ended its stroke: above any kiss point that is held possible, and for so long that the pressure is that of
/// the valve again.
fn filled_part(readings: &Series, kiss_max_pa: f64, cylinder: &Cylinder<f64>) -> Series {
    let (by_volume, _) = cylinder.volume_rate_slopes(cylinder.stroke_m3, cylinder.kiss_pa + FILL_DROP_PA);
    let forgotten_s = -LAGS / by_volume;
    let (mut filled, mut since_s) = (Series::default(), None);
    for (time_s, pressure_pa) in readings.time_s.iter().zip(&readings.value) {
        if *pressure_pa < kiss_max_pa {
            since_s = None;
        } else if time_s - *since_s.get_or_insert(*time_s) >= forgotten_s {
            filled.push(*time_s, *pressure_pa);
        }
    }
    filled
}
