//! Measured pressures of a log at the times of its rows.

use std::collections::VecDeque;

use observer::ShiftTables;
use observer::gearbox::MAX_ELEMENTS;

use crate::LogStep;

/// Measured pressures are compared up to this age, s.
const OLDEST_S: f64 = 0.25;

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
