//! Corrections by the readings of turbine, output and wheel speed.

use super::{
    ChannelHealth, GAP_S, GearboxFilter, INERTIA, MISFIT_S, Measured, Moment, OUTPUT, Rates, Reading, Running, SCALE,
    SPEEDS, TOOTH, TURBINE, TWIST_RAD, Verdict, WHEEL, WHEEL_S, square,
};
use crate::gearbox::learnt::EDGE;
use drivetrain::Real;

/// The least inertia at the turbine that is believed, as a fraction of that by the tables \[chosen\].
const LIGHTEST: f64 = 0.5;

impl<T: Real> GearboxFilter<'_, T> {
    /// Takes the readings of turbine, output and wheel, each against the speed at its time.
    pub(super) fn take_speeds(
        &self,
        running: &mut Running<T>,
        Moment { input, acceleration, channels, dt_s, .. }: &Moment<'_, T>,
        speeds: [T; 2],
    ) -> [ChannelHealth; SPEEDS + 1] {
        let given = [input.turbine_rad_s, input.output_rad_s, input.wheel_rad_s];
        let mut health = [channels.turbine, channels.output, channels.wheel, channels.acceleration];
        let unseen = self.may_slip_unseen(running, speeds);
        let Some(torques) = running.torques else { return health.map(unused) };
        let torques = torques.without(running.phase.phase.holding());
        let response = self.response(running);
        let rates = Rates::new(&response, &torques, &self.driveline, self.wheels_kg_m2);
        let by_timing = torques.by_timing();
        running.x.timing.add_pressure(&by_timing);
        for k in 0..SPEEDS {
            let Some(reading) = given[k].filter(|_| health[k] == ChannelHealth::Good) else { continue };
            if unseen && k != WHEEL {
                // The sensor is not silent, but its reading is not taken.
                (running.silent_s[k], health[k]) = (T::zero(), ChannelHealth::Absent);
                continue;
            }
            health[k] = self.correct(running, k, &reading, &rates);
        }
        health[SPEEDS] = self.take_acceleration(running, (acceleration.as_ref(), health[SPEEDS]), &rates, *dt_s);
        running.x.timing.add_pressure(&by_timing.map(|by| by.map(|by| -by)));
        running.rates = [TURBINE, OUTPUT, WHEEL].map(|k| rates.of(k, &running.x));
        if let Some(shift) = &running.shift {
            // The rate by the inertia as estimated, and not by that times the rate before: from step to step that would grow where the estimate is far off.
            let (error, row) = (running.x.mean[INERTIA], rates.rows[TURBINE][INERTIA]);
            let share = self.uncertainty.inertia_share * shift.mass_kg_m2[0][0] * response[0][0];
            let heavier = (T::one() + error * share).at_least(T::of(LIGHTEST));
            running.rates[TURBINE] = (running.rates[TURBINE] - error * row) / heavier;
        }
        if running.silent_s[TURBINE].max(running.silent_s[OUTPUT]) > T::of(GAP_S) {
            running.before = None;
        }
        health
    }

    /// Whether a clutch that is taken to hold may have begun to slip.
    pub(super) fn may_slip_unseen(&self, running: &Running<T>, speeds: [T; 2]) -> bool {
        match (&running.shift, running.phase.phase.holding()) {
            (Some(shift), Some(held)) => {
                let slip = self.slip(shift.clutches[held.min(1)].ratio, speeds);
                slip.may_be()
            }
            (None, _) => self.tied_ratio(running).is_some_and(|ratio| self.slip(ratio, speeds).is_over()),
            _ => false,
        }
    }

    pub(super) fn correct(
        &self,
        running: &mut Running<T>,
        k: usize,
        reading: &Reading<T>,
        rates: &Rates<T>,
    ) -> ChannelHealth {
        let sensor = &self.readings[k];
        let age_s = self.age(k, reading);
        let pitch_s = sensor.pitch_rad / reading.value.abs().max(self.least_rad_s(k));
        let rate = rates.of(k, &running.x);
        // The speed at the time of the reading: `w - age w'`, that of the wheels in its own scale.
        let scale = if k == WHEEL { T::one() + running.x.mean[SCALE] } else { T::one() };
        let then = running.x.mean[k] - age_s * rate;
        let mut row = rates.rows[k].map(|x| -age_s * scale * x);
        row[k] = row[k] + scale;
        if k == WHEEL {
            row[SCALE] = row[SCALE] + then;
        }
        let bent = T::of(0.5) * age_s * (rate - running.rates[k]);
        let noise = square(sensor.std_dev_rad_s) + square(T::of(TOOTH) * rate * pitch_s) + square(bent);
        let measured = Measured { row, innovation: reading.value - scale * then, noise };
        if k == WHEEL && !self.is_of_this_car(running, reading, age_s) {
            return ChannelHealth::Refused;
        }
        let mut innovation = running.x.innovation(&measured);
        if k != WHEEL {
            let fraction = running.silent_s[k] / (running.silent_s[k] + T::of(MISFIT_S));
            running.misfit =
                running.misfit + fraction * (square(innovation.value) / innovation.variance - running.misfit);
        }
        match running.gates[k].judge(innovation.value, innovation.variance) {
            Verdict::Refused => return ChannelHealth::Refused,
            Verdict::Jumped => {
                running.x.add(k, k, square(innovation.value));
                innovation = running.x.innovation(&measured);
            }
            Verdict::Taken => {}
        }
        running.x.correct(&innovation);
        running.silent_s[k] = T::zero();
        ChannelHealth::Good
    }

    /// Whether the wheel speed is that of the output within the bound of its scale, over more than a swing of the drive shafts. What is
    /// further off is no speed of these wheels: of others that slip, or of a car with another final ratio.
    fn is_of_this_car(&self, running: &mut Running<T>, reading: &Reading<T>, age_s: T) -> bool {
        let fraction = running.silent_s[WHEEL] / (running.silent_s[WHEEL] + T::of(WHEEL_S));
        running.silent_s[WHEEL] = T::zero();
        let by_output = (running.x.mean[OUTPUT] - age_s * running.rates[OUTPUT]) / self.driveline.final_ratio;
        let off = reading.value - by_output;
        running.wheel_off_rad_s = running.wheel_off_rad_s + fraction * (off - running.wheel_off_rad_s);
        let scale = T::of(EDGE) * self.uncertainty.wheel_scale * by_output.abs();
        running.wheel_off_rad_s.abs() <= scale + T::of(TWIST_RAD / WHEEL_S)
    }
}

/// What becomes of a reading that is not taken although it could be.
pub(super) fn unused(health: ChannelHealth) -> ChannelHealth {
    if health == ChannelHealth::Good { ChannelHealth::Absent } else { health }
}
