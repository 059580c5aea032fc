//! The torque at the gearbox input, from the converter's maps and from the torque that the engine's controller reports.
//!
//! ```text
//! by the maps       T_1 = t(lambda) C(lambda) w_e^2
//! by the engine     T_2 = T_e - I_e w_e' + (t - 1) T_p        whatever the lock-up clutch does
//! ```
//!
//! Where both are known the mean is taken, weighted by their variances; that of `T_2` has the variance of `I_e w_e'` in it, and
//! the maps' part of `(t - 1) T_p`. With the lock-up clutch applied only the second
//! holds. Without a converter the engine is on the input shaft: its inertia belongs to the mass of the shifts.

use drivetrain::{Converter, Real};

use super::square;

/// The torque below which an error is no longer a share of it, N m.
pub(super) const LEAST_N_M: f64 = 10.0;

/// What is known of the torque at the gearbox input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TurbineTorque<T> {
    /// The converter, if there is one.
    pub converter: Option<Converter<T>>,
    /// Inertia of engine and pump in front of the converter, kg m^2.
    pub engine_inertia_kg_m2: T,
    /// Standard deviation of the torque by the maps, as a share.
    pub converter_share: T,
    /// Standard deviation of the torque that the engine's controller reports, as a share.
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

/// The torque, N m, its variance from the noise of the speeds, and its deviation as a share.
pub(super) struct Found<T> {
    pub(super) turbine_n_m: T,
    pub(super) noise: T,
    pub(super) share: T,
}

impl<T: Real> TurbineTorque<T> {
    /// The torque at the gearbox input, if it is known.
    #[inline]
    pub(super) fn at(&self, side: &InputSide<T>) -> Option<Found<T>> {
        let (zero, one, least) = (T::zero(), T::one(), T::of(LEAST_N_M));
        let Some(converter) = &self.converter else {
            return side.reported_n_m.map(|turbine_n_m| Found { turbine_n_m, noise: zero, share: self.engine_share });
        };
        let [engine, engine_variance, acceleration, acceleration_variance] = side.engine?;
        let turbine = side.turbine[0];
        let (by_maps, noise) = by_maps(converter, [engine, engine_variance], side.turbine);
        let maps = Found { turbine_n_m: by_maps, noise, share: self.converter_share };
        let Some(reported) = side.reported_n_m else {
            return (!side.lock_up_applied).then_some(maps);
        };
        let torques = converter.torques(engine, turbine);
        let pump = if side.lock_up_applied { zero } else { torques.turbine_n_m - torques.pump_n_m };
        let by_engine = reported - self.engine_inertia_kg_m2 * acceleration + pump;
        let by_engine_noise = square(self.engine_inertia_kg_m2) * acceleration_variance;
        if side.lock_up_applied {
            return Some(Found { turbine_n_m: by_engine, noise: by_engine_noise, share: self.engine_share });
        }
        // Variances of what lasts: of the maps, and of the reported torque with the part that the maps have in it.
        let maps_variance = square(self.converter_share * by_maps.abs().max(least));
        let reported_variance =
            square(self.engine_share * reported.abs().max(least)) + square(self.converter_share * pump);
        let (by_maps_all, by_engine_all) = (maps_variance + noise, reported_variance + by_engine_noise);
        let weight = by_engine_all / (by_engine_all + by_maps_all);
        let rest = one - weight;
        let turbine_n_m = weight * by_maps + rest * by_engine;
        let lasting = square(weight) * maps_variance + square(rest) * reported_variance;
        let noise = square(weight) * noise + square(rest) * by_engine_noise;
        Some(Found { turbine_n_m, noise, share: lasting.sqrt() / turbine_n_m.abs().max(least) })
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
