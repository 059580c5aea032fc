//! What a step gives: commands, readings, and from them slip and torque at the gearbox input.

use super::{
    ChannelHealth, Channels, ElementState, Engine, FIRST_S, GearRow, GearboxFilter, GearboxState, InputSide, LOST_S,
    MAX_ELEMENTS, Newest, OUTPUT, Reading, Running, SPEEDS, ShiftElement, ShiftInput, Slip, SpeedReading, TURBINE,
    Verdict, WHEEL, pieces, square,
};
use car::ShiftCommand;
use drivetrain::Real;

/// Largest torque over the largest speed that is one of an engine, N m s \[chosen\]: far above all.
const MAX_TORQUE_S: f64 = 10.0;

/// Standard deviation of the angle by which a toothed wheel lags that is not described, rad \[chosen\]: half of the mean over six of sixty teeth.
const LAG_RAD: f64 = 0.3;

impl<T: Real> GearboxFilter<'_, T> {
    /// The input with negative output and wheel speeds in a reverse gear, where their sensors give no sign, as toothed wheels do not: while that gear holds,
    /// turbine and output do not both turn forward. A sensor that has given a negative speed has a sign.
    pub(super) fn with_signs(&self, state: &mut GearboxState<T>, input: &ShiftInput<T>) -> Option<ShiftInput<T>> {
        let speeds = [input.output_rad_s, input.wheel_rad_s].map(|reading| reading.map_or(T::zero(), |of| of.value));
        state.has_sign |= speeds.iter().any(|speed| *speed < -T::one());
        let is_reverse = |gear: &GearRow<T>| gear.ratio < T::zero();
        self.tables.gear(input.gear.from).filter(|gear| !state.has_sign && is_reverse(gear))?;
        let turbine = input.turbine_rad_s.map(|reading| reading.value);
        let turbine = turbine.or(state.newest[TURBINE].map(|newest| newest.value))?;
        (turbine > T::zero() && speeds.iter().any(|speed| *speed > T::zero())).then(|| {
            let backward = |reading: Reading<T>| Reading { value: -reading.value.abs(), ..reading };
            ShiftInput {
                output_rad_s: input.output_rad_s.map(backward),
                wheel_rad_s: input.wheel_rad_s.map(backward),
                ..*input
            }
        })
    }

    /// Lets the valve models go on and takes the commands. The health of each element's command.
    pub(super) fn pass_elements(
        &self,
        state: &mut GearboxState<T>,
        input: &ShiftInput<T>,
        dt_s: T,
    ) -> [ChannelHealth; MAX_ELEMENTS] {
        let mut health = [ChannelHealth::Unused; MAX_ELEMENTS];
        let elements = state.elements.iter_mut().zip(self.tables.elements).zip(&input.commands);
        for (health, ((memory, element), command)) in health.iter_mut().zip(elements) {
            if let Some(memory) = memory {
                *health = memory.step(element, *command, dt_s);
            }
        }
        if state.strokes {
            for (memory, element) in state.elements.iter_mut().flatten().zip(self.tables.elements) {
                memory.move_pistons(element, dt_s);
            }
        }
        health
    }

    /// The health of all commands together: a refused one first, then a lost one of an element that shifts, which is what the
    /// estimate rests on. One that the speeds have refuted counts in the shifts of its element alone.
    pub(super) fn of_commands(
        &self,
        each: &[ChannelHealth; MAX_ELEMENTS],
        elements: &[Option<ElementState<T>>; MAX_ELEMENTS],
        gear: ShiftCommand,
    ) -> ChannelHealth {
        let is = |health: ChannelHealth| each.contains(&health);
        let shifts = |which: ChannelHealth| {
            let shift = self.tables.commanded(gear);
            let elements = shift.map(|shift| shift.clutches.map(|clutch| clutch.element));
            let places = elements.into_iter().flatten().filter_map(ShiftElement::place);
            places.into_iter().any(|place| each.get(place) == Some(&which))
        };
        let refused = || {
            let impossible = |(health, memory): (&ChannelHealth, &Option<ElementState<T>>)| {
                *health == ChannelHealth::Refused && memory.as_ref().is_none_or(|memory| !memory.belief.is_wrong())
            };
            each.iter().zip(elements).any(impossible) || shifts(ChannelHealth::Refused)
        };
        if is(ChannelHealth::Refused) && refused() {
            ChannelHealth::Refused
        } else if is(ChannelHealth::Lost) && shifts(ChannelHealth::Lost) {
            ChannelHealth::Lost
        } else if is(ChannelHealth::Good) {
            ChannelHealth::Good
        } else {
            ChannelHealth::Absent
        }
    }

    /// Takes the engine torque that the engine's controller reports, if it comes.
    pub(super) fn take_reported(&self, state: &mut GearboxState<T>, input: &ShiftInput<T>, dt_s: T) -> ChannelHealth {
        let lost = T::of(LOST_S);
        if let Some((_, age_s)) = &mut state.reported {
            *age_s = *age_s + dt_s;
        }
        // A torque without sense is none.
        let torque_max = T::of(MAX_TORQUE_S) * self.limits.speed_max_rad_s;
        let usable = |reading: &Reading<T>| {
            reading.value.abs() <= torque_max && reading.age_s >= T::zero() && reading.age_s <= lost
        };
        let reading = input.engine_n_m.filter(usable);
        if let Some(reading) = reading {
            state.reported = Some((reading.value, reading.age_s));
        }
        state.reported = state.reported.filter(|(_, age_s)| *age_s <= lost);
        // Beside a converter it is a second source, and the filter does without it.
        let needed = self.turbine.converter.is_none() || input.lock_up_applied;
        match (input.engine_n_m, reading, state.reported) {
            (_, Some(_), _) => ChannelHealth::Good,
            (Some(_), None, _) => ChannelHealth::Refused,
            (None, None, Some(_)) => ChannelHealth::Absent,
            (None, None, None) if needed => ChannelHealth::Lost,
            (None, None, None) => ChannelHealth::Unused,
        }
    }

    pub(super) fn take_engine(&self, state: &mut GearboxState<T>, input: &ShiftInput<T>, dt_s: T) -> ChannelHealth {
        let (sensor, noise) = &self.engine;
        let lost = T::of(LOST_S);
        if let Some(engine) = &mut state.engine {
            let (pieces, piece_s) = pieces(dt_s);
            for _ in 0..pieces {
                engine.predict(noise, piece_s);
            }
            if engine.silent_s > lost {
                state.engine = None;
            }
        }
        let Some(reading) = input.engine_rad_s else {
            return if state.engine.is_some() { ChannelHealth::Absent } else { ChannelHealth::Lost };
        };
        if !(self.limits.speed_valid(reading.value) && reading.age_s >= T::zero() && reading.age_s <= lost) {
            return ChannelHealth::Refused;
        }
        let [age_s, _] = Self::age_and_late((sensor, self.uncertainty.output_least_rad_s), &reading);
        match &mut state.engine {
            None => state.engine = Some(Engine::new(reading.value, noise)),
            Some(engine) => {
                if engine.take(noise, reading.value, age_s) == Verdict::Refused {
                    return ChannelHealth::Refused;
                }
                if !engine.is_sound(&self.limits) {
                    state.engine = Some(Engine::new(reading.value, noise));
                }
            }
        }
        ChannelHealth::Good
    }

    /// Variances of the angles by which turbine and output speed lag beside what is stated, rad^2.
    pub(super) fn lag_variances(&self) -> [T; 2] {
        let of = |pitch_rad: T| if pitch_rad > T::zero() { T::zero() } else { square(T::of(LAG_RAD)) };
        [TURBINE, OUTPUT].map(|k| of(self.readings[k].pitch_rad))
    }

    /// Speed of turbine, output or wheel below which the teeth of its sensor are not waited for, rad/s: that of the output, at the wheels.
    pub(super) fn least_rad_s(&self, k: usize) -> T {
        let output = self.uncertainty.output_least_rad_s;
        if k == WHEEL { output / self.driveline.final_ratio } else { output }
    }

    /// Age of the middle of a reading of turbine, output or wheel, s.
    pub(super) fn age(&self, k: usize, reading: &Reading<T>) -> T {
        Self::age_and_late((&self.readings[k], self.least_rad_s(k)), reading)[0]
    }

    fn age_and_late((sensor, least_rad_s): (&SpeedReading<T>, T), reading: &Reading<T>) -> [T; 2] {
        let [lag_s, late_s] = sensor.lag_and_late(reading.value.abs(), least_rad_s);
        [reading.age_s + sensor.delay_s + lag_s, late_s]
    }

    /// Keeps the newest readings of turbine, output and wheel.
    pub(super) fn take_newest(
        &self,
        state: &mut GearboxState<T>,
        input: &ShiftInput<T>,
        dt_s: T,
        channels: &mut Channels<ChannelHealth>,
    ) {
        let given = [input.turbine_rad_s, input.output_rad_s, input.wheel_rad_s];
        let health = [&mut channels.turbine, &mut channels.output, &mut channels.wheel];
        for (k, ((newest, reading), health)) in state.newest.iter_mut().zip(given).zip(health).enumerate() {
            let sensor = &self.readings[k.min(SPEEDS - 1)];
            if let Some(newest) = newest {
                newest.pass(dt_s);
            }
            let Some(reading) = reading else {
                let lost = newest.is_none_or(|newest| newest.age_s > T::of(LOST_S));
                *health = if lost { ChannelHealth::Lost } else { ChannelHealth::Absent };
                continue;
            };
            let aged = reading.age_s >= T::zero() && reading.age_s <= T::of(LOST_S);
            let taken = self.limits.speed_valid(reading.value)
                && aged
                && Newest::take(
                    newest,
                    reading.value,
                    Self::age_and_late((sensor, self.least_rad_s(k)), &reading),
                    sensor.std_dev_rad_s,
                );
            *health = if taken { ChannelHealth::Good } else { ChannelHealth::Refused };
        }
        state.wheel_came |= input.wheel_rad_s.is_some();
        if !state.wheel_came {
            channels.wheel = ChannelHealth::Unused;
        }
    }

    /// Speeds of turbine and output at one time, that of the older reading. Where the readings of one do not reach back to the last one
    /// of the other, both are the estimates: two speeds of different times show a slip wherever the car accelerates.
    pub(super) fn measured(&self, newest: &[Option<Newest<T>>; SPEEDS], running: Option<&Running<T>>) -> [T; 2] {
        let fresh = |k: usize| newest[k].as_ref().filter(|newest| newest.age_s <= T::of(FIRST_S));
        let (turbine, output) = (fresh(TURBINE), fresh(OUTPUT));
        let age_s = |newest: Option<&Newest<T>>| newest.map_or(T::zero(), |newest| newest.age_s);
        let older_s = age_s(turbine).at_least(age_s(output));
        if let Some(running) = running {
            let reached = |newest: Option<&Newest<T>>| newest.and_then(|newest| newest.reached(older_s));
            return match (reached(turbine), reached(output)) {
                (Some(turbine), Some(output)) => [turbine, output],
                _ => [TURBINE, OUTPUT].map(|k| running.x.mean[k]),
            };
        }
        [turbine, output].map(|newest| newest.map_or(T::zero(), |newest| newest.at(older_s)))
    }

    /// Whether turbine and output have been read of late.
    pub(super) fn are_read(&self, newest: &[Option<Newest<T>>; SPEEDS]) -> bool {
        [TURBINE, OUTPUT].iter().all(|&k| newest[k].is_some_and(|newest| newest.age_s <= T::of(FIRST_S)))
    }

    /// Slip now at the turbine, and its error: `None` where the readings bound none. It errs by 7 standard deviations and 0.6 rad/s, by
    /// twice its change since the older reading, and by what readings of both speeds do not show ([`Newest::now`]).
    pub(super) fn bounded_slip(&self, ratio: T, newest: &[Option<Newest<T>>; SPEEDS]) -> Option<[T; 2]> {
        let now = |k: usize| newest[k].and_then(|newest| newest.now(self.readings[k].std_dev_rad_s, T::of(FIRST_S)));
        let (turbine, output) = (now(TURBINE)?, now(OUTPUT)?);
        let std_dev = (square(turbine.std_dev) + square(ratio * output.std_dev)).sqrt();
        let slip = Slip { value: turbine.value - ratio * output.value, std_dev };
        let changed = (slip.value - self.slip(ratio, self.measured(newest, None)).value).abs();
        let error = T::of(2.0) * (slip.threshold() + changed) + turbine.drift + ratio.abs() * output.drift;
        (slip.value.is_finite() && error.is_finite()).then_some([slip.value, error])
    }

    /// What is known in front of the gearbox now; none before the first turbine speed. A turbine speed that is refused, or that is not taken as a
    /// clutch that holds may have begun to slip, is not used: close to the coupling point of a converter 1 rad/s is 10 N m.
    pub(super) fn input_side(&self, state: &GearboxState<T>, input: &ShiftInput<T>, dt_s: T) -> Option<InputSide<T>> {
        let turbine = match (state.newest[TURBINE], &state.running) {
            (Some(newest), Some(running))
                if newest.refused || self.may_slip_unseen(running, self.measured(&state.newest, Some(running))) =>
            {
                running.x.mean[TURBINE] + dt_s * running.rates[TURBINE]
            }
            (Some(newest), _) if newest.age_s <= T::of(FIRST_S) => newest.at(T::zero()),
            (_, Some(running)) => running.x.mean[TURBINE],
            (Some(newest), None) => newest.value,
            (None, None) => return None,
        };
        let engine = state.engine.as_ref().map(|engine| {
            let now = engine.speed_before(T::zero());
            let (acceleration, std_dev) = engine.acceleration();
            [now, engine.variance(), acceleration, std_dev * std_dev]
        });
        let turbine = self.as_read(state, turbine);
        let std_dev = self.readings[TURBINE].std_dev_rad_s;
        let reported_n_m = state.reported.map(|(torque, _)| torque);
        let turbine = [turbine, std_dev * std_dev];
        Some(InputSide { engine, turbine, reported_n_m, lock_up_applied: input.lock_up_applied })
    }

    pub(super) fn slip(&self, ratio: T, [turbine, output]: [T; 2]) -> Slip<T> {
        let [turbine_std_dev, output_std_dev] = [TURBINE, OUTPUT].map(|k| self.readings[k].std_dev_rad_s);
        let std_dev = (square(turbine_std_dev) + square(ratio * output_std_dev)).sqrt();
        Slip { value: turbine - ratio * output, std_dev }
    }
}

impl<T: Real> SpeedReading<T> {
    /// How old the middle of a reading of this speed is by the lag, for speeds from the minimum on, and by how much it may be
    /// older or newer, s. The last tooth has passed up to a pitch ago, and the lag has half a pitch in it; a wheel that now turns
    /// at half the reading takes two pitches' time for that one. Below the minimum speed all teeth have taken longer.
    fn lag_and_late(&self, speed_rad_s: T, min_rad_s: T) -> [T; 2] {
        let zero = T::zero();
        let spent = |angle_rad: T, speed: T| if angle_rad > zero { angle_rad / speed } else { zero };
        let lag_s = spent(self.lag_rad, speed_rad_s.max(min_rad_s));
        let longer_s = spent(self.lag_rad, speed_rad_s) - lag_s;
        [lag_s, longer_s + spent(T::of(1.5) * self.pitch_rad, speed_rad_s)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PITCH: f64 = core::f64::consts::TAU / 60.0;
    const WHEEL: SpeedReading<f64> =
        SpeedReading { std_dev_rad_s: 0.1, lag_rad: 0.5 * 11.0 * PITCH, pitch_rad: PITCH, delay_s: 0.0 };

    #[test]
    fn a_toothed_wheel_that_slows_down_is_within_the_drift_of_its_readings() {
        // Over ten pitches, read every 10 ms, from 86 to 6 rad/s.
        let (start, slower) = (90.0_f64, 40.0_f64);
        let speed = |t: f64| start - slower * t;
        let turned = |t: f64| start * t - 0.5 * slower * t * t;
        let passed_s = |tooth: f64| (start - (start * start - 2.0 * slower * tooth * PITCH).sqrt()) / slower;
        let (mut newest, mut slow, mut known) = (None, 0, 0);
        for i in 10..210 {
            let t = 0.01 * f64::from(i);
            newest.iter_mut().for_each(|newest: &mut Newest<f64>| newest.pass(0.01));
            let last = (turned(t) / PITCH).floor();
            let value = 10.0 * PITCH / (passed_s(last) - passed_s(last - 10.0));
            let [lag_s, late_s] = WHEEL.lag_and_late(value, 15.0);
            slow += u32::from(value < 12.0);
            let middle_s = t - (start - value) / slower;
            assert!((middle_s - lag_s).abs() <= late_s, "{t}: {middle_s} {lag_s} {late_s}");
            assert!(Newest::take(&mut newest, value, [lag_s, late_s], 0.1));
            let Some(now) = newest.and_then(|newest| newest.now(0.0, f64::INFINITY)) else { continue };
            assert!((now.value - speed(t)).abs() <= now.drift, "{t}: {value} {now:?} {}", speed(t));
            known += 1;
        }
        assert!(slow > 5 && known > 100, "{slow} {known}");
    }

    #[test]
    fn a_reading_of_the_moment_is_never_late_and_a_wheel_that_stands_for_ever() {
        let moment = SpeedReading { lag_rad: 0.0, pitch_rad: 0.0, ..WHEEL };
        assert_eq!(moment.lag_and_late(0.0, 15.0), [0.0; 2]);
        assert_eq!(WHEEL.lag_and_late(0.0, 15.0), [WHEEL.lag_rad / 15.0, f64::INFINITY]);
        let [lag_s, late_s] = WHEEL.lag_and_late(10.0, 15.0);
        assert!((lag_s + late_s - (WHEEL.lag_rad + 1.5 * PITCH) / 10.0).abs() < 1e-12);
    }
}
