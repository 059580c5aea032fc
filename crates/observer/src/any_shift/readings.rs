//! What a step gives: commands, readings, and from them slip and torque at the gearbox input.

use super::{
    AnyShiftFilter, AnyShiftState, ChannelHealth, Channels, Engine, FIRST_S, GearCommand, InputSide, LOST_S,
    MAX_ELEMENTS, MOST_PIECES, Newest, OUTPUT, PIECE_S, Reading, Running, SPEEDS, ShiftInput, Slip, SpeedReading,
    TURBINE, Verdict, turbine,
};
use drivetrain::Real;

/// Largest torque over the largest speed that is one of an engine, N m s \[chosen\]: far above all.
const MOST_TORQUE_S: f64 = 10.0;

impl<T: Real> AnyShiftFilter<'_, T> {
    /// Lets the valve models go on and takes the commands. The health of each element's command.
    pub(super) fn pass_elements(
        &self,
        state: &mut AnyShiftState<T>,
        input: &ShiftInput<T>,
        dt_s: T,
    ) -> [ChannelHealth; MAX_ELEMENTS] {
        let mut health = [ChannelHealth::Unused; MAX_ELEMENTS];
        let elements = state.elements.iter_mut().zip(self.tables.elements).zip(&input.commands);
        for (health, ((memory, element), command)) in health.iter_mut().zip(elements) {
            if let Some(memory) = memory {
                *health = memory.step(element, &self.limits, *command, dt_s);
            }
        }
        health
    }

    /// The health of all commands together: a refused one first, then a lost one of an element that shifts, which is what the
    /// estimate rests on.
    pub(super) fn of_commands(&self, each: &[ChannelHealth; MAX_ELEMENTS], gear: GearCommand) -> ChannelHealth {
        let shifts = self.tables.shift(gear.from, gear.to).filter(|_| gear.from != gear.to);
        let lost = shifts.is_some_and(|shift| {
            shift.clutches.iter().any(|clutch| each.get(clutch.element) == Some(&ChannelHealth::Lost))
        });
        if each.contains(&ChannelHealth::Refused) {
            ChannelHealth::Refused
        } else if lost {
            ChannelHealth::Lost
        } else if each.contains(&ChannelHealth::Good) {
            ChannelHealth::Good
        } else {
            ChannelHealth::Absent
        }
    }

    /// Takes the engine torque that the engine's controller reports, if it comes.
    pub(super) fn take_reported(&self, state: &mut AnyShiftState<T>, input: &ShiftInput<T>, dt_s: T) -> ChannelHealth {
        let lost = T::of(LOST_S);
        if let Some((_, age_s)) = &mut state.reported {
            *age_s = *age_s + dt_s;
        }
        // A torque without sense is none.
        let torque_max = T::of(MOST_TORQUE_S) * self.limits.speed_max_rad_s;
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

    pub(super) fn take_engine(&self, state: &mut AnyShiftState<T>, input: &ShiftInput<T>, dt_s: T) -> ChannelHealth {
        let (sensor, noise) = &self.engine;
        let lost = T::of(LOST_S);
        if let Some(engine) = &mut state.engine {
            let pieces = (dt_s / T::of(PIECE_S)).ceil().whole().clamp(1, MOST_PIECES);
            for _ in 0..pieces {
                engine.predict(noise, dt_s / T::of(pieces as f64));
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
        let age_s = self.age(sensor, &reading);
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

    /// Age of the middle of a reading, s.
    pub(super) fn age(&self, sensor: &SpeedReading<T>, reading: &Reading<T>) -> T {
        let size = reading.value.abs().max(self.uncertainty.output_least_rad_s);
        reading.age_s + sensor.delay_s + sensor.lag_rad / size
    }

    /// Keeps the newest readings of turbine, output and wheel.
    pub(super) fn take_newest(
        &self,
        state: &mut AnyShiftState<T>,
        input: &ShiftInput<T>,
        dt_s: T,
        channels: &mut Channels<ChannelHealth>,
    ) {
        let given = [input.turbine_rad_s, input.output_rad_s, input.wheel_rad_s];
        let health = [&mut channels.turbine, &mut channels.output, &mut channels.wheel];
        for (((newest, reading), health), sensor) in state.newest.iter_mut().zip(given).zip(health).zip(&self.readings)
        {
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
                && Newest::take(newest, reading.value, self.age(sensor, &reading), sensor.deviation_rad_s);
            *health = if taken { ChannelHealth::Good } else { ChannelHealth::Refused };
        }
    }

    /// Speeds of turbine and output at one time, that of the older reading; where there are none the estimates.
    pub(super) fn measured(&self, newest: &[Option<Newest<T>>; SPEEDS], running: Option<&Running<T>>) -> [T; 2] {
        let fresh = |k: usize| newest[k].filter(|newest| newest.age_s <= T::of(FIRST_S));
        let older_s = |k: usize| fresh(k).map_or(T::zero(), |newest| newest.age_s);
        let age_s = older_s(TURBINE).max(older_s(OUTPUT));
        [TURBINE, OUTPUT].map(|k| match (fresh(k), running) {
            (Some(newest), _) => newest.at(age_s),
            (None, Some(running)) => running.x.mean[k],
            (None, None) => T::zero(),
        })
    }

    /// Speeds of turbine and output at the time of the older reading, and on the same lines now; `None` where one of them has
    /// not been read for long, or its last reading was refused: a clutch that grips hard looks so, and the lines do not show it.
    pub(super) fn then_and_now(&self, newest: &[Option<Newest<T>>; SPEEDS]) -> Option<[[T; 2]; 2]> {
        let fresh = |k: usize| newest[k].filter(|newest| newest.age_s <= T::of(FIRST_S) && !newest.refused);
        let (turbine, output) = (fresh(TURBINE)?, fresh(OUTPUT)?);
        Some([self.measured(newest, None), [turbine.at(T::zero()), output.at(T::zero())]])
    }

    /// The torque at the gearbox input now, if it is known.
    pub(super) fn input_torque(&self, state: &AnyShiftState<T>, input: &ShiftInput<T>) -> Option<turbine::Found<T>> {
        let turbine = match (state.newest[TURBINE], &state.running) {
            (Some(newest), _) if newest.age_s <= T::of(FIRST_S) => newest.at(T::zero()),
            (_, Some(running)) => running.x.mean[TURBINE],
            (Some(newest), None) => newest.value,
            (None, None) => return None,
        };
        let engine = state.engine.as_ref().map(|engine| {
            let now = engine.speed_before(T::zero());
            let (acceleration, deviation) = engine.acceleration();
            [now, engine.variance(), acceleration, deviation * deviation]
        });
        let deviation = self.readings[TURBINE].deviation_rad_s;
        let reported_n_m = state.reported.map(|(torque, _)| torque);
        let turbine = [turbine, deviation * deviation];
        self.turbine.at(&InputSide { engine, turbine, reported_n_m, lock_up_applied: input.lock_up_applied })
    }

    pub(super) fn slip(&self, ratio: T, [turbine, output]: [T; 2]) -> Slip<T> {
        let deviation = self.readings[TURBINE].deviation_rad_s.hypot(ratio * self.readings[OUTPUT].deviation_rad_s);
        Slip { value: turbine - ratio * output, deviation }
    }
}
