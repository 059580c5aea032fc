//! What a log of a car has beside the readings that the filter takes: measured pressures, and the speed of the car.

use std::collections::VecDeque;

use car::Car;
use drivetrain::ShiftKind;
use observer::ShiftTables;
use observer::gearbox::MAX_ELEMENTS;
use plant::car::CarShiftQuality;

use crate::LogStep;
use crate::score::within;
use crate::scored_shift::ScoredShift;
use crate::{ROUNDING_PA, ShiftScoreRow};

/// Measured pressures are compared up to this age, s.
const OLDEST_S: f64 = 0.25;
/// The jerk of a shift is that of the speeds from so long before it to so long after it, s, as in `logs::shifts`.
const AROUND_S: f64 = 0.45;
/// Speeds that are kept at most: those of a shift of ten minutes at 100 Hz.
const MAX_SPEEDS: usize = 60_000;
/// Rows of an element's measured pressure from which on, and fraction of them outside of the range above which, the log is doubted.
const MIN_ROWS: u64 = 50;
const DOUBTED: f64 = 0.1;

/// Measured pressures at the time of a row: a reading is older, and is carried on by what the models of the valves change since.
#[derive(Debug, Clone, Default)]
pub(crate) struct CarriedPressures {
    /// Times and pressures by the models of the valves, s and Pa, as far back as a reading may be.
    models: VecDeque<(f64, [f64; MAX_ELEMENTS])>,
}

impl CarriedPressures {
    /// Takes the pressures by the models of the valves after a row, Pa.
    pub(crate) fn push(&mut self, time_s: f64, valve_pa: &[f64; MAX_ELEMENTS]) {
        if self.models.back().is_some_and(|(last_s, _)| *last_s >= time_s) {
            self.models.clear();
        }
        self.models.push_back((time_s, *valve_pa));
        // One that is older than any reading stays, for a line to the next one.
        while self.models.get(1).is_some_and(|(second_s, _)| *second_s < time_s - OLDEST_S) {
            self.models.pop_front();
        }
    }

    /// Pressures of the offgoing and the oncoming clutch of the shift that is under way, Pa; not a number where the row brings none.
    pub(crate) fn pressures_pa(&self, step: &LogStep, tables: &ShiftTables<f64>) -> [f64; 2] {
        let row = tables.tables().commanded(step.input.gear).copied();
        let readings = step.shift_pressures(tables);
        [0, 1].map(|c| {
            let Some(reading) = readings[c].filter(|reading| reading.age_s <= OLDEST_S) else { return f64::NAN };
            let change =
                row.and_then(|row| self.change_pa(row.clutches[c].element.place()?, step.time_s - reading.age_s));
            reading.value + change.unwrap_or(0.0)
        })
    }

    /// What the model of a valve has changed since a time, Pa.
    fn change_pa(&self, element: usize, since_s: f64) -> Option<f64> {
        let of = |(_, models): &(f64, [f64; MAX_ELEMENTS])| models.get(element).copied();
        let now = of(self.models.back()?)?;
        let after = self.models.partition_point(|(time_s, _)| *time_s < since_s);
        let then = match (after.checked_sub(1).and_then(|before| self.models.get(before)), self.models.get(after)) {
            (Some(before), Some(next)) => {
                let fraction = (since_s - before.0) / (next.0 - before.0);
                of(before)? + fraction * (of(next)? - of(before)?)
            }
            (None, Some(first)) => of(first)?,
            _ => now,
        };
        Some(now - then).filter(|change| change.is_finite())
    }
}

/// How often the measured pressures of each element lie outside of their guaranteed ranges.
#[derive(Debug, Default)]
pub(crate) struct DoubtedPressures {
    /// Rows with a measured pressure, and those of them that are outside, by the place of the element among those of the gearbox.
    rows: Vec<[u64; 2]>,
}

impl DoubtedPressures {
    /// Takes a row of a shift between these elements.
    pub(crate) fn push(&mut self, elements: [Option<usize>; 2], row: &ShiftScoreRow) {
        for (element, clutch) in elements.into_iter().zip(row.clutches) {
            let [measured_pa, ..] = clutch.pressure_pa;
            let Some(element) = element.filter(|_| measured_pa.is_finite() && !clutch.torque_n_m[0].is_finite()) else {
                continue;
            };
            self.rows.resize(self.rows.len().max(element + 1), [0; 2]);
            let [all, outside] = &mut self.rows[element];
            *all += 1;
            *outside += u64::from(!within(clutch.pressure_range_pa, measured_pa, ROUNDING_PA));
        }
    }

    /// A warning that names the elements whose pressures contradict their commands.
    pub(crate) fn warning(&self, car: &Car) -> Option<String> {
        let doubted = self.rows.iter().enumerate().filter_map(|(element, [all, outside])| {
            let fraction = *outside as f64 / *all as f64;
            let name = &car.gearbox.elements.get(element)?.name;
            (*all >= MIN_ROWS && fraction > DOUBTED).then(|| format!("{name} ({:.0} %)", 100.0 * fraction))
        });
        let doubted: Vec<String> = doubted.collect();
        (!doubted.is_empty()).then(|| {
            format!(
                "warning: measured pressures lie outside of their guaranteed ranges in many rows of the shifts: {}. Either unit, sign, offset or delay \
                 of these channels are wrong, or they are of other elements, or the valve is beyond the error bounds of the vehicle file. A `fit` would \
                 believe them",
                doubted.join(", ")
            )
        })
    }
}

/// The jerk of the shifts: speeds around the shift that is under way, or was the last one.
#[derive(Debug, Default)]
pub(crate) struct ShiftJerk {
    /// Times, s, and speeds, m/s: of the last tenths of a second, from the request of a shift on all of them.
    speeds: VecDeque<(f64, f64)>,
    /// Whether a shift is under way or has just ended, and until when its speeds count, s.
    until_s: Option<f64>,
}

impl ShiftJerk {
    /// Takes a row.
    pub(crate) fn push(&mut self, step: &LogStep) {
        if let Some(speed) = step.speed_m_s.filter(|speed| speed.value.is_finite()) {
            let time_s = step.time_s - speed.age_s;
            match self.speeds.back() {
                Some((last_s, _)) if *last_s > time_s + 1.0 => self.speeds.clear(),
                Some((last_s, _)) if *last_s >= time_s => return,
                _ => {}
            }
            self.speeds.push_back((time_s, speed.value));
        }
        let keeps = |(time_s, _): &(f64, f64)| *time_s >= step.time_s - AROUND_S;
        while self.speeds.len() > MAX_SPEEDS || self.until_s.is_none() && self.speeds.front().is_some_and(|s| !keeps(s))
        {
            self.speeds.pop_front();
        }
    }

    /// Begins a shift; the jerk of the one before, if it was still under way.
    pub(crate) fn begin(&mut self, time_s: f64) -> Option<f64> {
        let before = self.until_s.filter(|until_s| until_s.is_finite()).and_then(|_| self.jerk_m_s3());
        self.speeds.retain(|(speed_s, _)| *speed_s >= time_s - AROUND_S);
        self.until_s = Some(f64::INFINITY);
        before
    }

    /// The shift ends at this time, s; `None` where the rest of it is not seen.
    pub(crate) fn end(&mut self, time_s: Option<f64>) {
        self.until_s = time_s.map(|time_s| time_s + AROUND_S);
    }

    /// The jerk of the shift that has ended, m/s^3, once its speeds are all there, or at the end of the log.
    pub(crate) fn ended(&mut self, time_s: f64) -> Option<f64> {
        self.until_s.filter(|until_s| until_s.is_finite() && time_s >= *until_s)?;
        self.until_s = None;
        self.jerk_m_s3()
    }

    fn jerk_m_s3(&self) -> Option<f64> {
        // A car that moves has no speed that stays to the last digit.
        let first = self.speeds.front()?.1;
        let stands = self.speeds.iter().all(|(_, speed)| *speed == first);
        if stands { None } else { drivetrain::jerk_of_readings::peak_jerk_m_s3(self.speeds.iter().copied()) }
    }
}

/// How far below the speeds of both gears the turbine has those of another shift, rad/s \[chosen\]: a flare is above them.
const OTHER_SHIFT_RAD_S: f64 = 30.0;
/// Shifts that last longer have other gear signals than theirs, s \[chosen\].
const LONGEST_S: f64 = 10.0;

/// Whether the gear signals can be those of a shift by its length, s, and the speeds of the turbine.
pub(crate) fn is_of_its_gears(kind: Option<ShiftKind>, quality: &CarShiftQuality, length_s: f64) -> bool {
    let below_rad_s = match kind {
        Some(ShiftKind::PowerOnUp | ShiftKind::PowerOffUp) => quality.past_synchronous_rad_s,
        Some(ShiftKind::PowerOnDown | ShiftKind::CoastDown) => quality.flare_rad_s,
        None => 0.0,
    };
    length_s <= LONGEST_S && (below_rad_s.is_nan() || below_rad_s <= OTHER_SHIFT_RAD_S)
}

/// A warning of shifts whose gear signals are not theirs.
pub(crate) fn not_of_their_gears(shifts: &[ScoredShift]) -> Option<String> {
    /// Shifts that are named.
    const NAMED: usize = 10;
    let is_other = |shift: &&ScoredShift| {
        let [begin_s, end_s] = shift.time_s;
        !shift.is_garage && shift.is_estimated() && !is_of_its_gears(shift.kind, &shift.quality, end_s - begin_s)
    };
    let others: Vec<String> = shifts.iter().filter(is_other).map(|shift| shift.number.to_string()).collect();
    let more = if others.len() > NAMED { ", ..." } else { "" };
    (!others.is_empty()).then(|| {
        format!(
            "warning: {} of the shifts take longer than {LONGEST_S:.0} s, or the turbine is {OTHER_SHIFT_RAD_S:.0} rad/s and more below the speeds of both gears (number {}{more}): \
             either `gear` and `target_gear` are missing, late or wrong there, and what the table says of these shifts is not of them, or neither clutch held \
             the turbine; the table gives no friction work of them",
            others.len(),
            others[..others.len().min(NAMED)].join(", ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reading_is_carried_on_by_what_the_model_changed_since() {
        let mut carried = CarriedPressures::default();
        // A parabola, so that its slope now is not that of a moment ago.
        for row in 0..60_u32 {
            let time_s = 0.01 * f64::from(row);
            let mut models = [f64::NAN; MAX_ELEMENTS];
            models[2] = 1e6 * time_s * time_s;
            carried.push(time_s, &models);
        }
        for age_s in [0.0, 0.004, 0.013, 0.1, 0.2] {
            let expected = 1e6 * (0.59_f64.powi(2) - (0.59_f64 - age_s).powi(2));
            let change = carried.change_pa(2, 0.59 - age_s).unwrap();
            assert!((change - expected).abs() < 30.0, "{age_s}: {change} {expected}");
        }
        assert_eq!(carried.change_pa(1, 0.5), None);
        assert!(carried.models.len() < 30, "{}", carried.models.len());
    }
}
