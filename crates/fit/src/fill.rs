//! The fill volume of a clutch whose piston has a stroke, from its measured pressure.
//!
//! While the piston moves, the pressure stays near that of the return spring, and it rises to that of the valve as the plates touch. A fit of torques and
//! speeds does not depend on it: a fill is over before both clutches slip. So the volume is found after it, with the valve and the kiss point of the
//! fit: the one with which the course of the pressure until then differs least from the measured one, as an area. An area grows in
//! proportion to the time by which a rise is off, however far off it is.
//!
//! The pressure shows how long the piston moves: the volume over the flow of the passages. Both multiplied by one number give the same pressures, so
//! passages and oil are those of the file, and the volume is the one by their flow.

use drivetrain::{Cylinder, Real};
use observer::FillBudget;

use crate::parameters::between;
use crate::pressure::{Grid, Hydraulics, pressures};
use crate::weights::FACTOR;
use crate::{Series, Verdict};

/// Pressure drop over the passages in a fast fill at which flows are compared, Pa \[chosen: as production gearboxes command it\].
pub(crate) const FILL_DROP_PA: f64 = 0.15e6;
/// Minimum standard deviation of a fitted fill volume: of slow and of fast flows, as passages and oil may be, one law has not both. Within
/// 10 % of an orifice's area and 15 K the ratio of the flows at 20 and at 150 kPa has a standard deviation of 2 and of 4 %.
const FILL_FLOOR: f64 = 0.04;
/// What the preload of the spring may be off beside the kiss point, as a fraction \[chosen, as in the error budget\].
const PRELOAD: f64 = 0.1;
/// Standard deviations of what is known before within which a volume is looked for \[chosen: a value anywhere in a range is at most 1.7 away\].
const SIDES: f64 = 3.0;
/// Shifts that are looked at: one tells nearly what ten tell.
const SHIFTS_MAX: usize = 5;
/// Difference of the courses in the mean over that of the maximum and minimum reading, above which the pressure is not that of this clutch
/// \[chosen\].
const MISFIT: f64 = 0.1;
const STEP_S: f64 = 0.002;
/// Which measurement would tell a fill volume.
pub(crate) const FILL_IDENTIFIED_BY: &str =
    "measure the pressure of the clutch in one shift, from its first command on until both clutches slip";

/// What is known of a fill volume after a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FillFit {
    /// Logarithm of the volume over that of the file, by the flow of the file's passages.
    pub log_volume: f64,
    /// Its standard deviation as it is stated, and before.
    pub sd: [f64; 2],
    /// Factor on the preload of the spring beside the kiss point that goes with this volume.
    pub preload: f64,
    /// How many shifts show it.
    pub shifts: usize,
    /// Whether pressures were measured that do not follow the model.
    pub is_misfit: bool,
}

/// What a shift shows of a fill.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FillLog<'a> {
    pub(crate) commands: &'a Series,
    pub(crate) pressure: &'a Series,
    /// When both clutches slip, s.
    pub(crate) until_s: f64,
}

/// What makes the pressure of a fill besides its volume.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Filling {
    pub(crate) hydraulics: Hydraulics,
    pub(crate) kiss_pa: f64,
    pub(crate) late_s: f64,
    pub(crate) sensor_scale: f64,
    pub(crate) sensor_offset_pa: f64,
    pub(crate) sensor_late_s: f64,
}

impl FillFit {
    /// Of shifts whose pressure may be measured, and of what a standard deviation of each other quantity does.
    pub(crate) fn of(logs: &[FillLog<'_>], filling: &Filling, moved: &[Filling], budget: &FillBudget<f64>) -> Self {
        let before = filling.hydraulics.cylinder.map_or(0.0, |cylinder| fill_sd(&cylinder, budget));
        let some: Vec<&FillLog<'_>> = logs.iter().filter(|log| log.shows_a_fill(filling)).collect();
        let count = some.len().min(SHIFTS_MAX);
        let chosen: Vec<&FillLog<'_>> = (0..count).map(|i| some[i * some.len() / count]).collect();
        let found: Vec<Found> = chosen.iter().map(|log| log.search(filling, before)).collect();
        let is_misfit = found.iter().any(|found| found.difference > MISFIT);
        if found.is_empty() || is_misfit {
            return Self { log_volume: 0.0, sd: [before; 2], preload: 1.0, shifts: 0, is_misfit };
        }
        let of = |found: &[Found]| found.iter().map(|found| found.log_volume).sum::<f64>() / found.len() as f64;
        let log_volume = of(&found);
        let scatter = found.iter().map(|found| Real::powi(found.log_volume - log_volume, 2)).sum::<f64>();
        let scatter = FACTOR * FACTOR * scatter / (count * count.saturating_sub(1).max(1)) as f64;
        let by_others = moved.iter().map(|other| {
            let moved: Vec<Found> = chosen.iter().map(|log| log.search(other, before)).collect();
            Real::powi(of(&moved) - log_volume, 2)
        });
        let variance = FILL_FLOOR * FILL_FLOOR + scatter + by_others.sum::<f64>();
        let preload = found.iter().map(|found| found.preload).sum::<f64>() / count as f64;
        Self { log_volume, sd: [variance.sqrt().min(before), before], preload, shifts: count, is_misfit }
    }

    /// How far the logs identify it.
    pub fn verdict(&self) -> Verdict {
        if self.shifts == 0 { Verdict::NotIdentifiable } else { Verdict::of(self.sd[0], self.sd[1]) }
    }

    /// Factor on the volume in the fitted file: that of the given file where it is not identified.
    pub(crate) fn factor(&self) -> f64 {
        if self.verdict() == Verdict::NotIdentifiable { 1.0 } else { Real::exp(self.log_volume) }
    }

    /// Factor on the preload of its spring beside the fitted kiss point: volume and preload were found together, and are written together.
    pub(crate) fn preload_factor(&self) -> f64 {
        if self.verdict() == Verdict::NotIdentifiable { 1.0 } else { self.preload }
    }

    /// A warning about pressures that do not follow the model.
    pub(crate) fn misfit(&self, clutch: &str) -> Option<String> {
        self.is_misfit.then(|| {
            format!(
                "warning: the measured pressure of {clutch} before both clutches slip is not that of a fill by its commands: its fill volume is not \
                 identified\nhint: the channel may be frozen, late, of another clutch or in another unit, or passages and oil differ from the file"
            )
        })
    }
}

/// A volume with the minimum difference of the courses, and that difference over the range of the readings.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Found {
    log_volume: f64,
    preload: f64,
    difference: f64,
}

impl FillLog<'_> {
    fn readings(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let from_s = self.commands.time_s.first().copied().unwrap_or(f64::INFINITY);
        self.pressure.between([from_s, self.until_s])
    }

    /// Whether the pressure was measured from the begin of the fill on until both clutches slip.
    fn shows_a_fill(&self, filling: &Filling) -> bool {
        /// Longest time without a reading, s.
        const GAP_S: f64 = 0.05;
        let begin = filling.hydraulics.cylinder.and_then(|c| fill_begin_s(&filling.hydraulics, &c, self.commands));
        begin.is_some_and(|begin_s| {
            begin_s < self.until_s && self.pressure.longest_gap_s([begin_s, self.until_s]) <= GAP_S
        })
    }

    /// The volume within what is held possible, with the preload that suits it best.
    fn search(&self, filling: &Filling, before: f64) -> Found {
        const COARSE: i32 = 12;
        const FINE: i32 = 4;
        const PRELOADS: i32 = 2;
        let preloads = || (-PRELOADS..=PRELOADS).map(|i| 1.0 + PRELOAD * f64::from(i) / f64::from(PRELOADS));
        let best = |volumes: &[f64]| {
            let all = volumes.iter().flat_map(|volume| preloads().map(move |preload| (*volume, preload)));
            let found = all.map(|(log_volume, preload)| Found {
                log_volume,
                preload,
                difference: self.difference(filling, log_volume, preload),
            });
            let none = Found { log_volume: 0.0, preload: 1.0, difference: f64::INFINITY };
            found.min_by(|one, other| one.difference.total_cmp(&other.difference)).unwrap_or(none)
        };
        let around = |middle: f64, count: i32, step: f64| -> Vec<f64> {
            (-count..=count).map(|i| middle + step * f64::from(i)).collect()
        };
        let mut step = SIDES * before / f64::from(COARSE);
        let mut found = best(&around(0.0, COARSE, step));
        for _ in 0..2 {
            step /= f64::from(FINE);
            found = best(&around(found.log_volume, FINE, step));
        }
        let ends = self.readings().fold([f64::INFINITY, f64::NEG_INFINITY], |[minimum, maximum], (_, pressure)| {
            [minimum.min(pressure), maximum.max(pressure)]
        });
        Found { difference: found.difference / (ends[1] - ends[0]).max(f64::MIN_POSITIVE), ..found }
    }

    /// Mean size of the difference of measured and computed pressures, Pa.
    fn difference(&self, filling: &Filling, log_volume: f64, preload: f64) -> f64 {
        let mut of = filling.hydraulics;
        of.set_kiss(filling.kiss_pa);
        of.scale_preload(preload);
        of.scale_stroke(Real::exp(log_volume));
        let begin_s = self.readings().next().map_or(self.until_s, |(time_s, _)| time_s) - filling.sensor_late_s;
        let points = ((self.until_s - begin_s).max(0.0) / STEP_S) as usize + 2;
        let grid = Grid { begin_s, step_s: STEP_S, points };
        let computed = pressures(&of, filling.late_s, self.commands, grid);
        let (count, sum) = self.readings().fold((0.0, 0.0), |(count, sum), (time_s, measured)| {
            let computed_pa = grid.at(&computed, time_s - filling.sensor_late_s);
            let error = measured - filling.sensor_offset_pa - filling.sensor_scale * computed_pa;
            (count + 1.0, sum + error.abs())
        });
        sum / count
    }
}

/// Standard deviation of the logarithm of the volume of a stroke by the flow of the file: limits of volume, of passages and of the oil's
/// viscosity, as uniform distributions.
pub(crate) fn fill_sd(cylinder: &Cylinder<f64>, budget: &FillBudget<f64>) -> f64 {
    let volume = budget.volume_m3.map(|volume_m3| volume_m3 / cylinder.stroke_m3);
    let [wide, narrow] = budget.supply;
    let [thin, thick] = budget.viscosity_m2_s;
    let flows = [narrow.flow(FILL_DROP_PA, thick), wide.flow(FILL_DROP_PA, thin)];
    Real::hypot(between(volume), between(flows))
}

/// When the fill of a clutch begins: the first command that asks for half of the preload or more, with the next one; none where the commands begin within
/// it.
pub(crate) fn fill_begin_s(hydraulics: &Hydraulics, cylinder: &Cylinder<f64>, commands: &Series) -> Option<f64> {
    let min_pa = 0.5 * cylinder.preload_pa;
    let asks: Vec<bool> =
        commands.value.iter().map(|command| hydraulics.valve.settled_pressure(*command) >= min_pa).collect();
    // One reading alone is noise.
    let first = asks.windows(2).position(|pair| pair[0] && pair[1])?;
    (first > 0).then(|| commands.time_s[first])
}
