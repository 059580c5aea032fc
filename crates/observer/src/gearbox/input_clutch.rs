//! The clutch between the engine and the gearbox: the lock-up clutch of a converter, or the clutch that starts a car without one.
//!
//! ```text
//! lock-up clutch              T_lu = T_e - I_e w_e' - T_p                   T_p: pump torque by the converter's maps
//! clutch of the gear          alpha T_c = T_e - M11 w_t' - M12 w_o'         without a converter, while no other clutch carries
//! ```
//!
//! Both are the momentum balance of the engine's side, which holds whether the clutch slips or not. It needs the torque that the engine's
//! controller reports and no valve: the lock-up clutch's is not known.

use drivetrain::Real;

use super::turbine::{InputSide, MIN_N_M, TurbineTorque, by_maps};
use super::{GearboxFilter, GearboxState, OUTPUT, ShiftInput, TURBINE, square};

/// Torque of the clutch between engine and gearbox.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct InputClutch<T> {
    /// Torque, N m: positive when the engine drives.
    pub torque_n_m: T,
    /// Its standard deviation, N m: reported engine torque, converter maps, acceleration.
    pub std_dev_n_m: T,
}

impl<T: Real> TurbineTorque<T> {
    /// Variance of the reported engine torque, (N m)^2.
    fn reported_variance(&self, reported_n_m: T) -> T {
        square(self.engine_share * reported_n_m.abs().at_least(T::of(MIN_N_M)))
    }

    /// The lock-up clutch's torque while it is applied; none without engine speed and torque.
    fn lock_up(&self, side: &InputSide<T>) -> Option<InputClutch<T>> {
        let converter = self.converter.as_ref().filter(|_| side.lock_up_applied)?;
        let ([engine, engine_variance, acceleration, acceleration_variance], reported) =
            (side.engine?, side.reported_n_m?);
        let pump = converter.torques(engine, side.turbine[0]).pump_n_m;
        let inertia = self.engine_inertia_kg_m2;
        // The pump's torque over the speeds is about as steep as the turbine's.
        let (_, noise) = by_maps(converter, [engine, engine_variance], side.turbine);
        let variance = self.reported_variance(reported)
            + square(self.converter_share * pump)
            + square(inertia) * acceleration_variance
            + noise;
        let torque_n_m = reported - inertia * acceleration - pump;
        Some(InputClutch { torque_n_m, std_dev_n_m: variance.sqrt() })
    }
}

impl<T: Real> GearboxFilter<'_, T> {
    /// Torque of the lock-up clutch while it is applied; without a converter, that of the clutch of the gear while there is no shift.
    pub(super) fn input_clutch(
        &self,
        state: &GearboxState<T>,
        input: &ShiftInput<T>,
        side: &InputSide<T>,
    ) -> Option<InputClutch<T>> {
        if self.turbine.converter.is_some() {
            return self.turbine.lock_up(side);
        }
        if !input.gear.is_steady() {
            return None;
        }
        let shift = self.tables.out_of(input.gear.from)?;
        let reported = side.reported_n_m?;
        let (acceleration, acceleration_variance) = match side.engine {
            Some([_, _, acceleration, variance]) => (acceleration, variance),
            None => self.rate(state, TURBINE)?,
        };
        let [[m11, m12], _] = shift.mass_kg_m2;
        // Of a dual clutch it is zero.
        let (output_rate, output_variance) =
            if m12 == T::zero() { (T::zero(), T::zero()) } else { self.rate(state, OUTPUT)? };
        let variance = self.turbine.reported_variance(reported)
            + square(m11) * acceleration_variance
            + square(m12) * output_variance;
        let alpha = shift.clutches[0].alpha;
        let torque_n_m = (reported - m11 * acceleration - m12 * output_rate) / alpha;
        Some(InputClutch { torque_n_m, std_dev_n_m: variance.sqrt() / alpha.abs() })
    }

    /// Rate of a speed by its two newest readings, rad/s^2, and its variance.
    pub(super) fn rate(&self, state: &GearboxState<T>, speed: usize) -> Option<(T, T)> {
        let (rate, span_s) = state.newest[speed]?.rate()?;
        Some((rate, T::of(2.0) * square(self.readings[speed].std_dev_rad_s / span_s)))
    }
}
