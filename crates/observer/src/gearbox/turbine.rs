//! The torque at the gearbox input, from the converter's maps and from the torque that the engine's controller reports.
//!
//! ```text
//! by the maps       T_1 = t(lambda) C(lambda) w_e^2
//! by the engine     T_2 = T_e - I_e w_e'          with the lock-up clutch applied, when t is 1
//! ```
//!
//! With the lock-up clutch open the first one holds, and what the second one says of the converter's capacity is learnt
//! ([`super::reported`]): at each moment the second one has the error of `I_e w_e'`, which is large in a shift. With the lock-up clutch
//! applied only the second holds. Without a converter the engine is on the input shaft: its inertia belongs to the mass of the shifts.

use drivetrain::{Converter, Real};

use super::square;

/// The torque below which an error is no longer a fraction of it, N m.
pub(super) const MIN_N_M: f64 = 10.0;

/// What is known of the torque at the gearbox input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TurbineTorque<T> {
    /// The converter, if there is one.
    pub converter: Option<Converter<T>>,
    /// Inertia of engine and pump in front of the converter, kg m^2.
    pub engine_inertia_kg_m2: T,
    /// Standard deviation of the torque by the maps, as a fraction.
    pub converter_share: T,
    /// Standard deviation of the torque that the engine's controller reports, as a fraction.
    pub engine_share: T,
}

/// What is known at a time.
pub(super) struct InputSide<T> {
    /// Engine speed, rad/s, and its variance, its acceleration, rad/s^2, and its variance; none without a reading.
    pub(super) engine: Option<[T; 4]>,
    /// Turbine speed, rad/s, and its variance.
    pub(super) turbine: [T; 2],
    /// Reported engine torque, N m.
    pub(super) reported_n_m: Option<T>,
    pub(super) lock_up_applied: bool,
}

/// The torque, N m, its variance from the noise of the speeds, and its standard deviation as a fraction.
pub(super) struct Found<T> {
    pub(super) turbine_n_m: T,
    pub(super) noise: T,
    pub(super) fraction: T,
}

impl<T: Real> TurbineTorque<T> {
    /// The torque at the gearbox input, if it is known.
    #[inline]
    pub(super) fn at(&self, side: &InputSide<T>) -> Option<Found<T>> {
        let Some(converter) = &self.converter else {
            let found = |turbine_n_m| Found { turbine_n_m, noise: T::zero(), fraction: self.engine_share };
            return side.reported_n_m.map(found);
        };
        let [engine, engine_variance, acceleration, acceleration_variance] = side.engine?;
        if side.lock_up_applied {
            let turbine_n_m = side.reported_n_m? - self.engine_inertia_kg_m2 * acceleration;
            let noise = square(self.engine_inertia_kg_m2) * acceleration_variance;
            return Some(Found { turbine_n_m, noise, fraction: self.engine_share });
        }
        let (turbine_n_m, noise) = by_maps(converter, [engine, engine_variance], side.turbine);
        Some(Found { turbine_n_m, noise, fraction: self.converter_share })
    }

    /// The same in another precision.
    pub fn cast<U: Real>(&self) -> TurbineTorque<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        TurbineTorque {
            converter: self.converter.as_ref().map(Converter::cast),
            engine_inertia_kg_m2: to(self.engine_inertia_kg_m2),
            converter_share: to(self.converter_share),
            engine_share: to(self.engine_share),
        }
    }
}

/// The turbine torque by the maps, N m, and its variance from the noise of both speeds; each speed is given with its variance.
#[inline]
pub(super) fn by_maps<T: Real>(
    converter: &Converter<T>,
    [engine, engine_variance]: [T; 2],
    [turbine, turbine_variance]: [T; 2],
) -> (T, T) {
    let (torque, slope) = converter.turbine_with_slope(engine, turbine);
    let per_engine = Converter::engine_slope((torque, slope), engine, turbine);
    (torque, square(slope) * turbine_variance + square(per_engine) * engine_variance)
}
