//! The engine torque that the engine controller reports, as a second source of the turbine torque.
//!
//! What the engine gives and does not need for its own acceleration the pump takes; times the torque ratio of the converter
//! it is the turbine torque. The converter's capacity has no part in it; its torque ratio is in both.

use drivetrain::Real;

use super::covariance::CONSIDERED;
use super::engine::Engine;
use super::past::SPEEDS;
use super::states::{FRACTION, TURBINE};
use super::{KalmanFilter, KalmanState};
use crate::{ChannelHealth, Input, LOST_S, Reading};

/// Time within which the filter of the engine speed finds a new acceleration, s \[chosen\].
const SETTLED_S: f64 = 0.05;
/// A torque above this many times the largest that accelerates the engine is none.
const IMPOSSIBLE: f64 = 4.0;

/// What is known of the reported torque.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ReportedTorque<T> {
    /// Inertia of engine and pump, kg m^2.
    pub engine_kg_m2: T,
    /// Standard deviation of the reported torque, as a fraction of it.
    pub fraction: T,
    /// The same beside it, N m.
    pub beside_n_m: T,
}

/// The last reading of the torque.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LastTorque<T> {
    torque_n_m: T,
    since_s: T,
    /// How fast the torque changes or changed a while ago, N m/s.
    rate_n_m_s: T,
}

impl<T: Real> KalmanFilter<T> {
    /// Takes the reported torque of a step.
    #[inline]
    pub(super) fn take_engine_torque(&self, state: &mut KalmanState<T>, input: &Input<T>, dt_s: T) -> ChannelHealth {
        let (zero, lost) = (T::zero(), T::of(LOST_S));
        let last = state.reported.map(|last| LastTorque { since_s: last.since_s + dt_s, ..last });
        state.reported = last;
        let Some(reading) = input.engine_torque_n_m else {
            // A log without this channel misses nothing.
            return last.map_or(ChannelHealth::Unused, |last| {
                if last.since_s > lost { ChannelHealth::Lost } else { ChannelHealth::Absent }
            });
        };
        let maximum = T::of(IMPOSSIBLE) * self.engine.1.acceleration_max_rad_s2 * self.reported.engine_kg_m2;
        if !(reading.value.abs() <= maximum && reading.age_s >= zero && reading.age_s <= lost) {
            return ChannelHealth::Refused;
        }
        let new = LastTorque { torque_n_m: reading.value, since_s: zero, rate_n_m_s: zero };
        state.reported = Some(new);
        let Some(last) = last.filter(|last| last.since_s > zero) else { return ChannelHealth::Good };
        let since_s = last.since_s.at_most(lost);
        let fade = T::of(SETTLED_S) / (T::of(SETTLED_S) + since_s);
        let rate_n_m_s = ((reading.value - last.torque_n_m) / since_s).abs().at_least(fade * last.rate_n_m_s);
        state.reported = Some(LastTorque { rate_n_m_s, ..new });
        if let Some(engine) = state.engine {
            self.correct_fraction(state, &engine, reading, since_s, rate_n_m_s);
        }
        ChannelHealth::Good
    }

    #[inline]
    fn correct_fraction(
        &self,
        state: &mut KalmanState<T>,
        engine: &Engine<T>,
        reading: Reading<T>,
        since_s: T,
        rate_n_m_s: T,
    ) {
        let Some(running) = &mut state.running else { return };
        let (one, reported) = (T::one(), &self.reported);
        let (acceleration, acceleration_std_dev) = engine.acceleration();
        let (speed, turbine) = (engine.speed_before(reading.age_s), running.mean[TURBINE]);
        let by_map = self.model.rigid.converter.torques(speed, turbine);
        let ratio = self.model.rigid.converter.torque_ratio.at(turbine / speed.at_least(one));
        let found = ratio * (reading.value - reported.engine_kg_m2 * acceleration);
        let square = |x: T| x * x;
        // Its error lasts as long as that of the maps: readings within this time count as one.
        let alike = (T::of(2.0) * self.uncertainty.turbine_share_s / since_s).at_least(one);
        // It is old, and compared with an acceleration that is found late.
        let changed = rate_n_m_s * (reading.age_s + T::of(SETTLED_S));
        let own = alike * (square(reported.fraction * reading.value.abs() + reported.beside_n_m) + square(changed));
        let noise = square(ratio) * (own + square(reported.engine_kg_m2 * acceleration_std_dev));
        let mut measured = running.covariance.with_state::<FRACTION>(by_map.turbine_n_m);
        measured.variance = (by_map.turbine_n_m * measured.with[FRACTION]).at_least(T::zero()) + noise;
        let innovation = found - by_map.turbine_n_m * (one + running.mean[FRACTION]);
        if !(measured.variance.is_finite() && innovation.is_finite()) {
            return;
        }
        running.correct(&measured, innovation, &[one; CONSIDERED], SPEEDS);
    }
}

impl<T: Real> ReportedTorque<T> {
    /// The same in another precision.
    pub fn cast<U: Real>(&self) -> ReportedTorque<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        ReportedTorque {
            engine_kg_m2: to(self.engine_kg_m2),
            fraction: to(self.fraction),
            beside_n_m: to(self.beside_n_m),
        }
    }
}
