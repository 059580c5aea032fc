//! Speeds that come late by a stated time.
//!
//! ```text
//! filter      up to t - D      every reading of this time has come
//! ahead       from there to t  in each step anew, with the readings that have come
//! ```
//!
//! `D` is the longest delay of the four speeds and the acceleration. Each reading acts at its own time, among the commands of that time; the estimate for now is the
//! filter's state carried on by the commands since. It costs a step for each row within `D`. A reading compared with `w - age w'`
//! instead would be wrong by the swing of the drive shafts, which turns by 80 degrees in 20 ms.

use super::{GearboxFilter, GearboxState, LOST_S, MAX_ELEMENTS, Reading, SPEEDS, ShiftEstimate, ShiftInput};
use drivetrain::Real;

/// The longest delay that the gearbox filter takes off the readings, s; what is beyond stays their age.
pub const LONGEST_DELAY_S: f64 = 0.05;
/// Rows are put together until they are as long as this, s. A delay below it stays the age of its readings.
const SHORTEST_S: f64 = 0.00625;
/// Steps that are kept: those of the longest delay, one that is not yet full, and one more where a step begins within it.
const KEPT: usize = 10;
/// Times that differ by less are the same, s.
const SAME_S: f64 = 1e-6;

/// The steps that wait for their readings, newest first, and what is known of now.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Late<T> {
    steps: [Option<ShiftInput<T>>; KEPT],
    /// Lowest and highest pressure of the elements, Pa.
    pub(super) pressure_range_pa: [Option<[T; 2]>; MAX_ELEMENTS],
}

impl<T: Real> Late<T> {
    pub(super) fn nothing() -> Self {
        Self { steps: [None; KEPT], pressure_range_pa: [None; MAX_ELEMENTS] }
    }

    /// Whether steps wait for their readings.
    pub(super) fn waits(&self) -> bool {
        self.steps[0].is_some()
    }

    /// Takes the commands of a row, of whose speeds none is of now.
    fn push(&mut self, input: &ShiftInput<T>, dt_s: T) {
        let new = ShiftInput {
            dt_s,
            engine_rad_s: None,
            turbine_rad_s: None,
            output_rad_s: None,
            wheel_rad_s: None,
            acceleration_m_s2: None,
            ..*input
        };
        match &mut self.steps[0] {
            Some(newest) if newest.dt_s < T::of(SHORTEST_S) => *newest = together(newest, &new),
            _ => {
                self.steps.rotate_right(1);
                self.steps[0] = Some(new);
            }
        }
    }

    /// The step in which a reading was taken that is late by this time, and how long before its end, s.
    fn at(&mut self, delay_s: T) -> Option<(&mut ShiftInput<T>, T)> {
        let (mut place, mut end_s) = (0, T::zero());
        for (k, step) in self.steps.iter().enumerate() {
            let Some(step) = step else { break };
            place = k;
            if end_s + step.dt_s > delay_s + T::of(SAME_S) {
                break;
            }
            if self.steps.get(k + 1).is_some_and(Option::is_some) {
                end_s = end_s + step.dt_s;
            }
        }
        Some((self.steps.get_mut(place)?.as_mut()?, (delay_s - end_s).at_least(T::zero())))
    }

    /// Removes the oldest step if it ended this time ago or earlier.
    fn pop(&mut self, ago_s: T) -> Option<ShiftInput<T>> {
        let oldest = self.steps.iter().rposition(Option::is_some)?;
        let end_s = self.steps.iter().take(oldest).flatten().fold(T::zero(), |sum, step| sum + step.dt_s);
        if end_s + T::of(SAME_S) < ago_s { None } else { self.steps[oldest].take() }
    }
}

/// Two rows as one.
fn together<T: Real>(first: &ShiftInput<T>, second: &ShiftInput<T>) -> ShiftInput<T> {
    let older = |reading: Option<Reading<T>>| reading.map(|of| Reading { age_s: of.age_s + second.dt_s, ..of });
    let mut both = ShiftInput { dt_s: first.dt_s + second.dt_s, ..*second };
    for (both, first) in [
        (&mut both.engine_rad_s, first.engine_rad_s),
        (&mut both.turbine_rad_s, first.turbine_rad_s),
        (&mut both.output_rad_s, first.output_rad_s),
        (&mut both.wheel_rad_s, first.wheel_rad_s),
        (&mut both.engine_n_m, first.engine_n_m),
        (&mut both.acceleration_m_s2, first.acceleration_m_s2),
    ] {
        *both = both.or(older(first));
    }
    for (both, first) in both.commands.iter_mut().zip(first.commands) {
        *both = both.or(older(first));
    }
    both
}

impl<T: Real> GearboxFilter<'_, T> {
    /// The longest delay of a speed, s, as far as it is taken off; `None` where none is long.
    pub(super) fn longest_delay_s(&self) -> Option<T> {
        let [turbine, output, wheel] = &self.readings;
        let others = [turbine.delay_s, output.delay_s, wheel.delay_s, self.acceleration.delay_s];
        let longest = others.into_iter().fold(self.engine.0.delay_s, |longest, delay_s| longest.at_least(delay_s));
        (longest >= T::of(SHORTEST_S)).then(|| longest.at_most(T::of(LONGEST_DELAY_S)))
    }

    /// The same filter of turbine, output and wheel speeds that are later by these times, s.
    pub(super) fn later_by(&self, delays_s: [T; SPEEDS]) -> Self {
        let mut readings = self.readings;
        for (reading, delay_s) in readings.iter_mut().zip(delays_s) {
            reading.delay_s = reading.delay_s + delay_s;
        }
        Self { readings, ..*self }
    }

    /// The same filter of readings that are not late.
    fn on_time(&self) -> Self {
        let left = |delay_s: T| (delay_s - T::of(LONGEST_DELAY_S)).at_least(T::zero());
        let (mut readings, mut engine, mut acceleration) = (self.readings, self.engine, self.acceleration);
        for sensor in readings.iter_mut().chain([&mut engine.0]) {
            sensor.delay_s = left(sensor.delay_s);
        }
        acceleration.delay_s = left(acceleration.delay_s);
        Self { readings, engine, acceleration, ..*self }
    }

    /// Takes the steps that ended this time ago or earlier, s.
    pub(super) fn pass_waiting(&self, state: &mut GearboxState<T>, ago_s: T) {
        while let Some(step) = state.late.pop(ago_s) {
            self.step_on_time(state, &step);
        }
    }

    /// A step with readings that are late by up to this time, s.
    pub(super) fn step_late(
        &self,
        state: &mut GearboxState<T>,
        input: &ShiftInput<T>,
        longest_s: T,
    ) -> ShiftEstimate<T> {
        let on_time = self.on_time();
        let is_first = !state.started && state.late.steps[0].is_none();
        let dt_s = if is_first { T::zero() } else { input.dt_s };
        if !(dt_s >= T::zero() && dt_s <= T::of(LOST_S)) {
            state.late = Late::nothing();
            return on_time.step_on_time(state, input);
        }
        state.late.push(input, dt_s);
        let [turbine, output, wheel] = self.readings;
        for (reading, delay_s, channel) in [
            (input.engine_rad_s, self.engine.0.delay_s, 0),
            (input.turbine_rad_s, turbine.delay_s, 1),
            (input.output_rad_s, output.delay_s, 2),
            (input.wheel_rad_s, wheel.delay_s, 3),
            (input.acceleration_m_s2, self.acceleration.delay_s, 4),
        ] {
            let Some(reading) = reading else { continue };
            let delay_s = delay_s.at_most(T::of(LONGEST_DELAY_S));
            if let Some((step, before_s)) = state.late.at(delay_s) {
                let of = [
                    &mut step.engine_rad_s,
                    &mut step.turbine_rad_s,
                    &mut step.output_rad_s,
                    &mut step.wheel_rad_s,
                    &mut step.acceleration_m_s2,
                ];
                if let Some(place) = of.into_iter().nth(channel) {
                    *place = Some(Reading { age_s: reading.age_s + before_s, ..reading });
                }
            }
        }
        on_time.pass_waiting(state, longest_s);
        let mut ahead = *state;
        let mut estimate = state.estimate;
        for step in state.late.steps.iter().rev().flatten() {
            estimate = on_time.step_on_time(&mut ahead, step);
        }
        for (at, range) in state.late.pressure_range_pa.iter_mut().enumerate() {
            *range = on_time.range_of_element(&ahead, at);
        }
        let then = &state.estimate;
        let (now, of_then) = (&mut estimate.channels, &then.channels);
        (now.engine, now.turbine, now.output, now.wheel) =
            (of_then.engine, of_then.turbine, of_then.output, of_then.wheel);
        now.acceleration = of_then.acceleration;
        estimate.health = estimate.health.max(then.health);
        estimate
    }
}

#[cfg(test)]
mod tests {
    use car::ShiftCommand;

    use super::*;

    fn input(dt_s: f64, command: f64) -> ShiftInput<f64> {
        let mut commands = [None; MAX_ELEMENTS];
        commands[0] = Some(Reading { value: command, age_s: 0.0 });
        ShiftInput {
            dt_s,
            engine_rad_s: None,
            turbine_rad_s: Some(Reading { value: 100.0, age_s: 0.0 }),
            output_rad_s: None,
            wheel_rad_s: None,
            engine_n_m: None,
            acceleration_m_s2: None,
            lock_up_applied: false,
            commands,
            gear: ShiftCommand::between(0, 0),
        }
    }

    #[test]
    fn a_reading_acts_in_the_row_of_its_time() {
        let mut late = Late::nothing();
        for k in 0..5_u8 {
            late.push(&input(0.01, f64::from(k)), 0.01);
        }
        // The newest row, with the command 4, ends now and the one before 10 ms ago.
        for (delay_s, command, before_s) in [
            (0.0, 4.0, 0.0),
            (0.004, 4.0, 0.004),
            (0.01, 3.0, 0.0),
            (0.02, 2.0, 0.0),
            (0.035, 1.0, 0.005),
            (0.09, 0.0, 0.05),
        ] {
            let (step, before) = late.at(delay_s).unwrap();
            assert_eq!(step.commands[0].unwrap().value, command, "{delay_s}");
            assert!((before - before_s).abs() < 1e-12 && step.turbine_rad_s.is_none(), "{delay_s}: {before}");
        }
        assert!(late.pop(0.045).is_none());
        let order: [_; 3] = core::array::from_fn(|_| late.pop(0.02).map(|step| step.commands[0].unwrap().value));
        assert_eq!(order, [Some(0.0), Some(1.0), Some(2.0)]);
        assert!(late.pop(0.02).is_none());
    }

    #[test]
    fn fast_rows_are_put_together_and_never_more_than_there_is_room_for() {
        for dt_s in [1e-4, 1e-3, 0.004, 0.00624, 0.0063, 0.01, 0.05] {
            let (mut late, mut taken_s, mut given_s) = (Late::nothing(), 0.0, 0.0);
            for k in 0..2000_u16 {
                late.push(&input(dt_s, f64::from(k)), dt_s);
                given_s += dt_s;
                while let Some(step) = late.pop(LONGEST_DELAY_S) {
                    taken_s += step.dt_s;
                }
                assert!(late.steps[KEPT - 1].is_none(), "{dt_s}: no step is pushed out");
            }
            let waiting_s: f64 = late.steps.iter().flatten().map(|step| step.dt_s).sum();
            assert!((taken_s + waiting_s - given_s).abs() < 1e-6, "{dt_s}: {taken_s} {waiting_s} {given_s}");
            assert!(waiting_s < LONGEST_DELAY_S + 2.0 * dt_s.max(SHORTEST_S) + 1e-9, "{dt_s}: {waiting_s}");
        }
    }

    #[test]
    fn two_rows_as_one_have_the_newer_readings() {
        let second = ShiftInput { turbine_rad_s: None, ..input(0.002, 7.0) };
        let both = together(&input(0.003, 5.0), &second);
        assert_eq!(both.commands[0], Some(Reading { value: 7.0, age_s: 0.0 }));
        assert_eq!(both.turbine_rad_s, Some(Reading { value: 100.0, age_s: 0.002 }));
        assert!((both.dt_s - 0.005).abs() < 1e-12);
    }
}
