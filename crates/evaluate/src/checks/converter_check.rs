//! Whether the converter of the vehicle file takes the torque that the engine's controller reports.
//!
//! At a steady engine speed the pump takes all of it. The estimates of torque, and what is learnt, are in proportion to the converter's
//! capacity: where both differ by more than their bounds, one of them is not that of this car.

use car::{Car, ErrorBudget};

use super::check::{Check, CheckedRow};
use super::ratio_histogram::RatioHistogram;
use crate::LogStep;

/// Engine speed counts as steady if it has changed by no more than so much, rad/s, in so long, s \[chosen\]: the engine's inertia takes some 3 N m.
const STEADY_RAD_S: f64 = 10.0;
const STEADY_S: f64 = 0.5;
/// Torques that are compared, N m, and speed ratios up to which the pump's torque is well known \[chosen\].
const MIN_N_M: f64 = 20.0;
const MAX_SPEED_RATIO: f64 = 0.9;
/// Rows that are needed to judge, and their time, s \[chosen\].
const ENOUGH: (u64, f64) = (200, 3.0);
/// Difference beside the bounds of both: drag, auxiliaries, the time by which a signal comes late \[chosen\].
const MORE: f64 = 0.05;

/// Reported over pump torque, so far.
pub(crate) struct ConverterCheck<'c> {
    car: &'c Car,
    ratio: RatioHistogram<100>,
    rows: (u64, f64),
    /// Rows in which the reported torque has the other sign, and their time, s.
    opposite: (u64, f64),
    /// An engine speed, rad/s, and when it was read, s.
    before: Option<(f64, f64)>,
    is_steady: bool,
    reported_n_m: Option<f64>,
}

impl<'c> ConverterCheck<'c> {
    pub(super) fn new(car: &'c Car) -> Self {
        let ratio = RatioHistogram::default();
        Self { car, ratio, rows: (0, 0.0), opposite: (0, 0.0), before: None, is_steady: false, reported_n_m: None }
    }

    /// Takes a row with the newest speeds of engine and turbine, rad/s.
    fn push(&mut self, step: &LogStep, [engine, turbine]: [f64; 2]) {
        if let Some(reported) = step.reported_n_m {
            self.reported_n_m = Some(reported.value);
        }
        let Some(converter) = &self.car.converter else { return };
        match self.before {
            Some((before, at_s)) if step.time_s - at_s < STEADY_S && step.time_s >= at_s => {
                self.is_steady &= (engine - before).abs() <= STEADY_RAD_S;
            }
            before => {
                let was_near = before.is_some_and(|(before, _)| (engine - before).abs() <= STEADY_RAD_S);
                (self.is_steady, self.before) = (was_near, Some((engine, step.time_s)));
            }
        }
        let (Some(reported), true) = (self.reported_n_m, self.is_steady && !step.input.lock_up_applied) else { return };
        let pump = converter.torques(engine, turbine).pump_n_m;
        if pump > MIN_N_M && reported.abs() > MIN_N_M && turbine <= MAX_SPEED_RATIO * engine {
            let (rows, time_s) = if reported > 0.0 { &mut self.rows } else { &mut self.opposite };
            *rows += 1;
            *time_s += step.input.dt_s.clamp(0.0, 1.0);
            if reported > 0.0 {
                self.ratio.push(reported / pump);
            }
        }
    }

    /// Whether the reported torque has the other sign in most rows.
    pub(crate) fn has_other_sign(&self) -> bool {
        let (rows, time_s) = self.opposite;
        rows >= ENOUGH.0 && time_s >= ENOUGH.1 && rows > 2 * self.rows.0
    }

    /// What contradicts the vehicle file, in a sentence.
    fn warning(&self) -> Option<String> {
        if self.has_other_sign() {
            return Some(format!(
                "warning: reported_engine_torque is negative in {} rows with a steady engine speed in which the converter takes torque: its sign is the other way \
                 round, and where the lock-up clutch is applied the estimates are wrong by twice that torque\nhint: multiply its column with -1, or give \
                 `scale = -1` in `[channel.engine_torque]` of a channel map",
                self.opposite.0
            ));
        }
        let (rows, time_s) = self.rows;
        let errors = ErrorBudget::of_logged_car(self.car);
        let ratio = self.ratio.middle();
        let maximum = (1.0 + errors.converter) * (1.0 + errors.engine) + MORE;
        if rows < ENOUGH.0 || time_s < ENOUGH.1 || (maximum.recip()..=maximum).contains(&ratio) {
            return None;
        }
        Some(format!(
            "warning: reported_engine_torque is {ratio:.2} of what the converter of the vehicle file takes, in the middle of {rows} rows with a steady engine \
             speed: the torques of the estimate are off by as much if the signal is right. `converter.capacity_n_m_s2` times {ratio:.2} would agree; \
             `wetclutch inspect LOG --shifts -o PAGE.html` fits it. Or the signal is no torque at the crankshaft, or in percent"
        ))
    }
}

impl Check for ConverterCheck<'_> {
    fn row(&mut self, row: &CheckedRow<'_>) {
        if row.step.input.gear.is_steady() {
            let [engine, turbine, _] = row.came_rad_s;
            self.push(row.step, [engine, turbine]);
        }
    }

    fn warnings(&self) -> Vec<String> {
        self.warning().into_iter().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{LogStep, SAMPLE_S};
    use car::ShiftCommand;
    use config::CarFile;
    use observer::Reading;
    use observer::gearbox::{MAX_ELEMENTS, ShiftInput};

    /// A log in which the engine has this fraction of the torque that the converter takes; its speed changes at this rate, rad/s^2.
    fn said(fraction: f64, rate: f64, lock_up_applied: bool, rows: u32) -> Option<String> {
        let car = CarFile::eight_speed().unwrap();
        let mut check = ConverterCheck::new(&car);
        for row in 0..rows {
            let time_s = f64::from(row) * SAMPLE_S;
            let [engine, turbine] = [200.0 + rate * time_s, 150.0];
            let torque = car.converter.unwrap().torques(engine, turbine).pump_n_m;
            let input = ShiftInput {
                dt_s: SAMPLE_S,
                engine_rad_s: Some(Reading::now(engine)),
                turbine_rad_s: Some(Reading::now(turbine)),
                output_rad_s: None,
                wheel_rad_s: None,
                engine_n_m: None,
                acceleration_m_s2: None,
                lock_up_applied,
                commands: [None; MAX_ELEMENTS],
                gear: ShiftCommand::between(1, 1),
            };
            let reported_n_m = (row % 4 == 0).then(|| Reading::now(fraction * torque));
            let step = LogStep { reported_n_m, ..LogStep::of(time_s, input) };
            check.push(&step, [engine, turbine]);
        }
        check.warning()
    }

    #[test]
    fn a_converter_that_does_not_take_the_reported_torque_is_named() {
        for fraction in [0.55, 0.75, 1.35, 2.0] {
            let said = said(fraction, 0.0, false, 1000).unwrap();
            let (_, found) = said.split_once("reported_engine_torque is ").unwrap();
            let found: f64 = found.split_once(' ').unwrap().0.parse().unwrap();
            assert!((found / fraction - 1.0).abs() < 0.015, "{said}");
        }
        let other_sign = said(-1.0, 0.0, false, 1000).unwrap();
        assert!(other_sign.contains("the other way round") && other_sign.contains("`scale = -1`"), "{other_sign}");
        for fraction in [0.85, 1.0, 1.18] {
            assert_eq!(said(fraction, 0.0, false, 1000), None);
        }
    }

    #[test]
    fn of_a_closed_lock_up_clutch_an_engine_that_accelerates_and_a_short_log_nothing_is_said() {
        assert_eq!(said(2.0, 0.0, true, 1000), None);
        assert_eq!(said(2.0, 60.0, false, 400), None);
        assert_eq!(said(2.0, 0.0, false, 200), None);
    }
}
