//! Whether the lock-up clutch was closed while a log says nothing of it.
//!
//! The converter's maps then give the turbine no torque, whatever the engine has: both speeds are alike. With a reported torque the engine
//! gives far more than the pump takes at these speeds; without one the speeds are alike for longer than a car without torque drives.

use car::Car;

use super::check::{Check, CheckedRow};
use crate::LogStep;

/// Speed ratio from which on the lock-up clutch may be closed or slip \[chosen\]: a slip-controlled one slips by some rad/s.
const MIN_SPEED_RATIO: f64 = 0.9;
/// What the reported torque is above that of the pump, N m and as a fraction of it \[chosen\]: more than the engine's inertia takes, and than both may err by.
const MORE_N_M: f64 = 25.0;
const MORE_FRACTION: f64 = 0.4;
/// Difference of speeds that are alike, rad/s, and for how long without a break, s \[chosen\]: a car that drives without torque soon pulls or coasts.
const ALIKE_RAD_S: f64 = 1.5;
const ALIKE_S: f64 = 10.0;
/// Speed of a turbine that is driven, rad/s, and the change of the engine speed that is slow, rad/s^2 \[chosen\].
const DRIVEN_RAD_S: f64 = 80.0;
const SLOW_RAD_S2: f64 = 40.0;
/// Time that is said, s \[chosen\].
const ENOUGH_S: f64 = 3.0;
/// Time without a break from which on more torque than the pump takes counts, s \[chosen\]: when the accelerator is pressed, the torque is above that of the
/// pump for some tenths of a second, and an hour has many of them.
const LASTING_S: f64 = 1.0;

/// The time in which it was closed, so far.
pub(crate) struct LockUpCheck<'c> {
    car: &'c Car,
    is_named: bool,
    /// The newest reported torque, N m, and when it came, s.
    reported_n_m: Option<[f64; 2]>,
    /// By the reported torque, s; by the speeds alone, and since the last break.
    by_torque_s: f64,
    alike_s: f64,
    since_s: [f64; 2],
    /// Engine speed, rad/s, when it was taken, s, and whether it changed slowly up to then.
    before: Option<(f64, f64)>,
    is_slow: bool,
}

impl<'c> LockUpCheck<'c> {
    pub(super) fn new(car: &'c Car) -> Self {
        Self {
            car,
            is_named: false,
            reported_n_m: None,
            by_torque_s: 0.0,
            alike_s: 0.0,
            since_s: [0.0; 2],
            before: None,
            is_slow: false,
        }
    }

    /// Takes a row with the newest speeds of engine and turbine, rad/s.
    fn push(&mut self, step: &LogStep, [engine, turbine]: [f64; 2]) {
        const RATE_S: f64 = 0.2;
        let Some(converter) = self.car.converter.as_ref() else { return };
        self.is_named |= step.input.lock_up_applied;
        if let Some(reported) = step.reported_n_m {
            self.reported_n_m = Some([reported.value, step.time_s]);
        }
        let (before, at_s) = self.before.unwrap_or((engine, step.time_s));
        let passed_s = step.time_s - at_s;
        if !(0.0..RATE_S).contains(&passed_s) || self.before.is_none() {
            self.is_slow = (engine - before).abs() <= SLOW_RAD_S2 * passed_s;
            self.before = Some((engine, step.time_s));
        }
        let dt_s = step.input.dt_s.clamp(0.0, 1.0);
        let is_driven = turbine > DRIVEN_RAD_S && turbine >= MIN_SPEED_RATIO * engine;
        let pump_n_m = converter.torques(engine, turbine).pump_n_m.max(0.0);
        let is_more = self.reported_n_m.is_some_and(|[n_m, at_s]| {
            step.time_s - at_s <= LASTING_S && n_m - pump_n_m > MORE_N_M + MORE_FRACTION * pump_n_m
        });
        let is_alike = is_driven && (engine - turbine).abs() <= ALIKE_RAD_S;
        let [by_torque_s, alike_s] = &mut self.since_s;
        self.by_torque_s += lasting_s(by_torque_s, is_driven && self.is_slow && is_more, dt_s, LASTING_S);
        self.alike_s += lasting_s(alike_s, is_alike, dt_s, ALIKE_S);
    }

    /// Leaves out what the torque shows: its sign is wrong.
    pub(crate) fn leave_out(&mut self) {
        self.reported_n_m = None;
    }

    /// What the log leaves out, in a sentence.
    fn warning(&self) -> Option<String> {
        let closed_s = if self.reported_n_m.is_some() { self.by_torque_s } else { self.alike_s };
        let why = match self.reported_n_m {
            Some(_) => "the engine reports far more torque than the converter takes at these speeds",
            None => "engine and turbine turn alike",
        };
        (!self.is_named && closed_s >= ENOUGH_S).then(|| {
            format!(
                "warning: the lock-up clutch seems to be closed or to slip for {closed_s:.0} s, {why}, and the log does not record it: the estimates of those times \
                 take the torque of an open converter\nhint: give `lock_up_applied` (1 while the clutch carries, also while it slips) with \
                 `reported_engine_torque`, which is the torque at the gearbox input then"
            )
        })
    }
}

/// What a step adds to the time in which something lasts for `least_s` and longer; `since_s` is the time since its last break.
fn lasting_s(since_s: &mut f64, lasts: bool, dt_s: f64, least_s: f64) -> f64 {
    let before_s = *since_s;
    *since_s = if lasts { before_s + dt_s } else { 0.0 };
    match *since_s >= least_s {
        false => 0.0,
        // With the time up to now once.
        true if before_s < least_s => *since_s,
        true => dt_s,
    }
}

impl Check for LockUpCheck<'_> {
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
    use crate::SAMPLE_S;
    use car::ShiftCommand;
    use config::CarFile;
    use observer::Reading;
    use observer::gearbox::{MAX_ELEMENTS, ShiftInput};

    /// What is said of so long a log with this slip, rad/s, an engine that reports the pump's torque and more, N m, and a flag.
    fn said(seconds: u32, slip: f64, more_n_m: Option<f64>, lock_up_applied: bool) -> Option<String> {
        said_of(seconds, slip, &|_| more_n_m, lock_up_applied)
    }

    /// The same of a torque over time, s.
    fn said_of(
        seconds: u32,
        slip: f64,
        more_n_m: &dyn Fn(f64) -> Option<f64>,
        lock_up_applied: bool,
    ) -> Option<String> {
        let car = CarFile::eight_speed().unwrap();
        let mut check = LockUpCheck::new(&car);
        for row in 0..100 * seconds {
            let time_s = f64::from(row) * SAMPLE_S;
            let turbine = 150.0 + 20.0 * (0.3 * time_s).sin();
            let speeds = [turbine + slip + 0.2 * (57.0 * time_s).sin(), turbine];
            let input = ShiftInput {
                dt_s: SAMPLE_S,
                engine_rad_s: Some(Reading::now(speeds[0])),
                turbine_rad_s: Some(Reading::now(turbine)),
                output_rad_s: None,
                wheel_rad_s: None,
                engine_n_m: None,
                acceleration_m_s2: None,
                lock_up_applied,
                commands: [None; MAX_ELEMENTS],
                gear: ShiftCommand::between(1, 1),
            };
            let pump_n_m = car.converter.unwrap().torques(speeds[0], turbine).pump_n_m;
            let reported_n_m = more_n_m(time_s).map(|more_n_m| Reading::now(pump_n_m + more_n_m));
            check.push(&LogStep { reported_n_m, ..LogStep::of(time_s, input) }, speeds);
        }
        check.warning()
    }

    #[test]
    fn a_closed_or_slipping_lock_up_clutch_that_is_not_named_is_said() {
        for slip in [0.0, 4.0] {
            assert!(
                said(10, slip, Some(80.0), false).is_some_and(|text| text.contains("closed or to slip for")),
                "{slip}"
            );
            assert_eq!(said(10, slip, Some(80.0), true), None);
        }
        // Without a reported torque the speeds tell, after a while.
        assert!(said(30, 0.0, None, false).is_some_and(|text| text.contains("for 30 s")));
        assert_eq!((said(9, 0.0, None, false), said(30, 4.0, None, false)), (None, None));
    }

    #[test]
    fn of_an_open_converter_nothing_is_said() {
        for (slip, more_n_m) in [(10.0, 10.0), (40.0, 40.0), (0.0, 5.0), (0.0, -80.0)] {
            assert_eq!(said(60, slip, Some(more_n_m), false), None, "{slip} {more_n_m}");
        }
    }

    #[test]
    fn short_times_of_more_torque_than_the_pump_takes_do_not_add_up() {
        let pressed = |time_s: f64| Some(if time_s % 5.0 < 0.5 { 80.0 } else { 10.0 });
        assert_eq!(said_of(600, 8.0, &pressed, false), None);
        let closed = |time_s: f64| Some(if time_s % 5.0 < 2.0 { 80.0 } else { 10.0 });
        assert!(said_of(20, 8.0, &closed, false).is_some());
    }
}
