//! The converter's maps against the torque that the engine's controller reports.
//!
//! With the lock-up clutch open the pump takes all of the engine's torque but what the engine's own inertia takes. Over the time in a
//! gear
//!
//! ```text
//! sum of (T_e dt - I_e dw_e) = (1 + c + q) sum of T_p dt          T_e: as reported, T_p: by the maps
//! ```
//!
//! with the error `c` of the converter's capacity and the error `q` of the reported torque, both as fractions. So the reported torque and
//! the maps together are known better than either. The sums need no acceleration of the engine, which a filter of its speed has late
//! and with noise; a reported torque that comes late errs at both ends of the time only. `q` is learnt beside `c`
//! ([`super::Learnt`]): the same error in the next gear is no news.

use drivetrain::Real;

use super::turbine::{InputSide, MIN_N_M, TurbineTorque};
use super::{GearboxFilter, Learnt, Running, square};

/// Torques that are compared, in the torque below which an error is no fraction of it: 20 N m; and speed ratios up to which the pump's
/// torque is well known \[chosen\].
const FROM: f64 = 2.0;
const MAX_SPEED_RATIO: f64 = 0.9;
/// Time that a comparison needs, s: a reported torque may be late by tenths of it. After the other one what is older counts half: the
/// speeds at which a car drives are others by then, and so are the errors of the maps \[chosen\].
const ENOUGH_S: f64 = 1.0;
const HALVED_S: f64 = 60.0;

/// What was compared in the gear up to now.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Compared<T> {
    time_s: T,
    /// What the engine has given to the pump, and what that takes by the maps, N m s.
    engine_n_m_s: T,
    pump_n_m_s: T,
    /// Engine speed and both torques at the step before, if it counted: rad/s, N m.
    before: Option<[T; 3]>,
}

impl<T: Real> Compared<T> {
    /// Nothing yet.
    pub(super) fn nothing() -> Self {
        Self { time_s: T::zero(), engine_n_m_s: T::zero(), pump_n_m_s: T::zero(), before: None }
    }

    /// Goes on by a step at whose end this is known, or by one in which nothing can be compared.
    pub(super) fn step(&mut self, turbine: &TurbineTorque<T>, side: Option<&InputSide<T>>, dt_s: T) {
        let now = side.and_then(|side| turbine.compared(side));
        if let (Some([engine, reported, pump]), Some([engine_before, reported_before, pump_before])) =
            (now, self.before)
        {
            let half_s = T::of(0.5) * dt_s;
            self.time_s = self.time_s + dt_s;
            self.pump_n_m_s = self.pump_n_m_s + half_s * (pump + pump_before);
            let by_inertia = turbine.engine_inertia_kg_m2 * (engine - engine_before);
            self.engine_n_m_s = self.engine_n_m_s + half_s * (reported + reported_before) - by_inertia;
        }
        self.before = now;
        if self.time_s > T::of(HALVED_S) {
            let half = T::of(0.5);
            (self.time_s, self.engine_n_m_s, self.pump_n_m_s) =
                (half * self.time_s, half * self.engine_n_m_s, half * self.pump_n_m_s);
        }
    }

    /// The sum of both errors, as a fraction, and the time that it is of, s.
    fn errors(&self) -> Option<(T, T)> {
        let fraction = self.engine_n_m_s / self.pump_n_m_s - T::one();
        (self.time_s >= T::of(ENOUGH_S) && fraction.is_finite()).then_some((fraction, self.time_s))
    }
}

impl<T: Real> TurbineTorque<T> {
    /// Engine speed, rad/s, reported torque and that of the pump by the maps, N m, where they can be compared.
    fn compared(&self, side: &InputSide<T>) -> Option<[T; 3]> {
        let converter = self.converter.as_ref().filter(|_| !side.lock_up_applied)?;
        let ([engine, ..], reported, turbine) = (side.engine?, side.reported_n_m?, side.turbine[0]);
        let pump = converter.torques(engine, turbine).pump_n_m;
        let minimum = T::of(FROM * MIN_N_M);
        let is_known = turbine <= T::of(MAX_SPEED_RATIO) * engine;
        (is_known && pump >= minimum && reported >= minimum).then_some([engine, reported, pump])
    }
}

impl<T: Real> GearboxFilter<'_, T> {
    /// Learns what the time in a gear has shown of the converter's capacity. The parts of both errors that do not last are another in
    /// [`super::ShiftUncertainty::turbine_share_s`], and their mean over a longer time is smaller.
    pub(super) fn learn_capacity(&self, running: &Running<T>, learnt: &mut Learnt<T>) {
        let Some((fraction, time_s)) = running.compared.errors() else { return };
        let u = &self.uncertainty;
        let lasting = [self.turbine.converter_share, self.turbine.engine_share];
        let two = T::of(2.0);
        let noise = two * square(u.turbine_share) / (T::one() + time_s / (two * u.turbine_share_s));
        learnt.take_capacity(fraction, lasting, noise);
    }
}

#[cfg(test)]
mod tests {
    use drivetrain::{Converter, Table1};

    use super::*;

    const DT_S: f64 = 0.01;

    fn turbine() -> TurbineTorque<f64> {
        let converter = Converter { capacity_n_m_s2: Table1::constant(2e-3), torque_ratio: Table1::constant(1.5) };
        let converter = Some(converter);
        TurbineTorque { converter, engine_inertia_kg_m2: 0.2, converter_share: 0.058, engine_share: 0.046 }
    }

    fn side(engine: f64, reported_n_m: Option<f64>, lock_up_applied: bool) -> InputSide<f64> {
        InputSide {
            engine: Some([engine, 0.0, f64::NAN, f64::NAN]),
            turbine: [100.0, 0.0],
            reported_n_m,
            lock_up_applied,
        }
    }

    /// The torque of an engine in front of a converter with 10 % more capacity; it swings, and is reported 5 % too low.
    fn swinging(time_s: f64) -> [f64; 2] {
        let engine = 200.0 + 40.0 * (2.0 * time_s).sin();
        let torque = 1.1 * 2e-3 * engine * engine + 0.2 * 80.0 * (2.0 * time_s).cos();
        [engine, 0.95 * torque]
    }

    fn compared(seconds: f64, report: impl Fn(f64) -> Option<f64>, locked: impl Fn(f64) -> bool) -> Option<(f64, f64)> {
        let (turbine, mut compared) = (turbine(), Compared::nothing());
        for step in 0..(seconds / DT_S) as u32 {
            let time_s = f64::from(step) * DT_S;
            let side = side(swinging(time_s)[0], report(time_s), locked(time_s));
            compared.step(&turbine, Some(&side), DT_S);
        }
        compared.errors()
    }

    #[test]
    fn a_swinging_engine_shows_both_errors_as_one() {
        let never = |_: f64| false;
        let reported = |time_s: f64| Some(swinging(time_s)[1]);
        // What the inertia takes is reported 5 % low too, and not at the ends of whole swings.
        let (fraction, time_s) = compared(10.0, reported, never).unwrap();
        assert!((fraction - (1.1 * 0.95 - 1.0)).abs() < 0.003 && (time_s - 10.0).abs() < 0.02, "{fraction} {time_s}");
        let (late, _) = compared(10.0, |time_s| reported(time_s - 0.03), never).unwrap();
        assert!((late - fraction).abs() < 0.003, "{late} {fraction}");
        // Without the inertia of the engine a single second would be off by a tenth.
        let (second, _) = compared(1.5, reported, never).unwrap();
        assert!((second - fraction).abs() < 0.01, "{second}");
    }

    #[test]
    fn holes_and_a_closed_lock_up_clutch_are_left_out() {
        let now_and_then = |time_s: f64| time_s % 1.0 > 0.3;
        let wrong =
            |time_s: f64| Some(if now_and_then(time_s) { 10.0 * swinging(time_s)[1] } else { swinging(time_s)[1] });
        let (fraction, time_s) = compared(20.0, wrong, now_and_then).unwrap();
        assert!((fraction - 0.045).abs() < 0.01 && (5.0..7.0).contains(&time_s), "{fraction} {time_s}");
        let holes = |time_s: f64| (!now_and_then(time_s)).then(|| swinging(time_s)[1]);
        assert_eq!(compared(20.0, holes, |_| false), compared(20.0, wrong, now_and_then));
        for nothing in [None, Some(f64::NAN), Some(5.0), Some(-100.0)] {
            assert_eq!(compared(5.0, |_| nothing, |_| false), None);
        }
        let huge = compared(5.0, |_| Some(f64::MAX), |_| false);
        assert!(huge.is_none_or(|(fraction, _)| fraction > 1e300), "{huge:?}");
        assert_eq!(compared(0.5, |time_s| Some(swinging(time_s)[1]), |_| false), None);
    }

    #[test]
    fn without_a_converter_or_near_its_synchronous_speed_there_is_nothing_to_compare() {
        let own = TurbineTorque { converter: None, ..turbine() };
        assert_eq!(own.compared(&side(200.0, Some(100.0), false)), None);
        assert!(turbine().compared(&side(112.0, Some(100.0), false)).is_some());
        assert_eq!(turbine().compared(&side(110.0, Some(100.0), false)), None);
    }
}
