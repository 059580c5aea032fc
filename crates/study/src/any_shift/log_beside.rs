//! What a log of a car has beside the readings that the filter takes: measured pressures, and the speed of the car.

use design::ShiftTables;
use drivetrain::jerk::PeakJerk;
use observer::any_shift::{GearCommand, MAX_ELEMENTS};

use super::car_log::LogStep;

/// Measured pressures are compared up to this age, s.
const OLDEST_S: f64 = 0.05;
/// The jerk of a shift counts up to this time after its end, s, as in a simulation.
const RATED_AFTER_S: f64 = 0.5;
/// No car changes its speed faster, m/s^2, beside the error of one reading, m/s: what does is a wrong reading.
const FASTEST_M_S2: f64 = 20.0;
const READING_M_S: f64 = 0.3;

/// Measured pressures at the time of a row: a reading is older, and is carried on by what the models of the valves change since.
#[derive(Debug, Clone)]
pub(super) struct CarriedPressures {
    valve_pa: [f64; MAX_ELEMENTS],
    rate_pa_s: [f64; MAX_ELEMENTS],
}

impl Default for CarriedPressures {
    fn default() -> Self {
        Self { valve_pa: [f64::NAN; MAX_ELEMENTS], rate_pa_s: [0.0; MAX_ELEMENTS] }
    }
}

impl CarriedPressures {
    /// Takes the pressures by the models of the valves after a row, Pa.
    pub(super) fn push(&mut self, dt_s: f64, valve_pa: &[f64; MAX_ELEMENTS]) {
        for ((rate, last), now) in self.rate_pa_s.iter_mut().zip(&mut self.valve_pa).zip(valve_pa) {
            let change = (now - *last) / dt_s;
            (*rate, *last) = (if change.is_finite() { change } else { 0.0 }, *now);
        }
    }

    /// Pressures of the offgoing and the oncoming clutch of the shift that is under way, Pa; not a number where the row brings none.
    pub(super) fn pressures_pa(&self, step: &LogStep, tables: &ShiftTables<f64>) -> [f64; 2] {
        let GearCommand { from, to } = step.input.gear;
        let row = tables.tables().shift(from, to).copied();
        let readings = step.shift_pressures(tables);
        [0, 1].map(|c| {
            let Some(reading) = readings[c].filter(|reading| reading.age_s <= OLDEST_S) else { return f64::NAN };
            let rate_pa_s = row.and_then(|row| self.rate_pa_s.get(row.clutches[c].element)).copied().unwrap_or(0.0);
            reading.value + rate_pa_s * reading.age_s
        })
    }
}

/// The jerk of a shift, from its request to some tenths of a second after its end.
#[derive(Debug, Default)]
pub(super) struct ShiftJerk {
    of: Option<(PeakJerk, f64)>,
    /// Time, s, and speed, m/s, of the last reading that counted.
    last: Option<[f64; 2]>,
}

impl ShiftJerk {
    /// Takes a row.
    pub(super) fn push(&mut self, step: &LogStep) {
        self.of = self.of.filter(|(_, until_s)| step.time_s <= *until_s);
        let (Some((peak, _)), Some(speed)) = (&mut self.of, step.speed_m_s) else { return };
        let (time_s, speed_m_s) = (step.time_s - speed.age_s, speed.value);
        let can_be = |[last_s, last]: [f64; 2]| {
            time_s > last_s && (speed_m_s - last).abs() <= READING_M_S + FASTEST_M_S2 * (time_s - last_s)
        };
        if speed_m_s.is_finite() && self.last.is_none_or(can_be) {
            self.last = Some([time_s, speed_m_s]);
            peak.speed(time_s, speed_m_s);
        }
    }

    /// Begins a shift with this row.
    pub(super) fn begin(&mut self, step: &LogStep) {
        (self.of, self.last) = (Some((PeakJerk::default(), f64::INFINITY)), None);
        self.push(step);
    }

    /// The shift ends at this time, s; not a number where the rest of it is not seen.
    pub(super) fn end(&mut self, time_s: f64) {
        self.of = self.of.filter(|_| time_s.is_finite()).map(|(peak, _)| (peak, time_s + RATED_AFTER_S));
    }

    /// The jerk of a shift that has ended, m/s^3; none where there were too few speeds.
    pub(super) fn ended(&self) -> Option<f64> {
        let (peak, until_s) = self.of.as_ref()?;
        peak.peak_m_s3().filter(|_| until_s.is_finite())
    }
}
