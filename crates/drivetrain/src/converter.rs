//! The torque converter, in drive and in overrun.

use crate::{Engine, Real, Table1};

/// Below this engine speed, rad/s, the speed ratio is formed with this speed instead, so that it
/// stays finite for a stalled engine.
const SLOWEST_ENGINE_RAD_S: f64 = 1.0;
/// Halvings of the range in which a steady engine speed is sought: as many as the digits of the largest number type.
const HALVINGS: usize = 53;

/// Steady-state torque converter, Eq. (2.11) and (2.12).
///
/// `lambda = w_t / w_e`, pump torque `T_p = C(lambda) w_e^2`, turbine torque `T_t = t(lambda) T_p`.
/// In overrun (`lambda > 1`) the capacity factor is negative: the turbine drives the pump. Left out:
/// fluid inertia and the lock-up clutch.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Converter<T> {
    /// Capacity factor `C(lambda)`, N m s^2, positive below `lambda = 1` and negative above it.
    pub capacity_n_m_s2: Table1<T>,
    /// Torque ratio `t(lambda)`.
    pub torque_ratio: Table1<T>,
}

/// Torques at the two sides of the converter, N m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConverterTorques<T> {
    /// Torque the pump takes from the engine.
    pub pump_n_m: T,
    /// Torque the turbine gives to the gearbox.
    pub turbine_n_m: T,
}

impl<T: Real> Converter<T> {
    /// Pump and turbine torque at these speeds, Eq. (2.11).
    #[inline]
    pub fn torques(&self, engine_rad_s: T, turbine_rad_s: T) -> ConverterTorques<T> {
        let engine_rad_s = engine_rad_s.at_least(T::of(SLOWEST_ENGINE_RAD_S));
        let speed_ratio = turbine_rad_s / engine_rad_s;
        let pump_n_m = self.capacity_n_m_s2.at(speed_ratio) * engine_rad_s * engine_rad_s;
        ConverterTorques { pump_n_m, turbine_n_m: self.torque_ratio.at(speed_ratio) * pump_n_m }
    }

    /// Turbine torque, N m, and its derivative by the turbine speed, N m s/rad.
    #[inline]
    pub fn turbine_with_slope(&self, engine_rad_s: T, turbine_rad_s: T) -> (T, T) {
        let engine_rad_s = engine_rad_s.at_least(T::of(SLOWEST_ENGINE_RAD_S));
        let (capacity, capacity_slope) = self.capacity_n_m_s2.at_with_slope(turbine_rad_s / engine_rad_s);
        let (ratio, ratio_slope) = self.torque_ratio.at_with_slope(turbine_rad_s / engine_rad_s);
        let per_speed_ratio = ratio_slope * capacity + ratio * capacity_slope;
        (ratio * capacity * engine_rad_s * engine_rad_s, per_speed_ratio * engine_rad_s)
    }

    /// Derivative of the turbine torque by the engine speed, N m s/rad, where [`turbine_with_slope`](Self::turbine_with_slope) is this.
    #[inline]
    pub fn engine_slope((turbine_n_m, slope_n_m_s): (T, T), engine_rad_s: T, turbine_rad_s: T) -> T {
        // The torque is of second degree in both speeds (Euler's theorem).
        (T::of(2.0) * turbine_n_m - turbine_rad_s * slope_n_m_s) / engine_rad_s.at_least(T::one())
    }

    /// Minimum and maximum turbine torque with both speeds anywhere in these ranges, N m.
    pub fn turbine_range(&self, engine_rad_s: [T; 2], turbine_rad_s: [T; 2]) -> [T; 2] {
        let engine = engine_rad_s.map(|speed| speed.at_least(T::of(SLOWEST_ENGINE_RAD_S)));
        // A quotient is largest where the divisor is smallest, unless it is negative.
        let minimum = turbine_rad_s[0] / if turbine_rad_s[0] < T::zero() { engine[0] } else { engine[1] };
        let maximum = turbine_rad_s[1] / if turbine_rad_s[1] < T::zero() { engine[1] } else { engine[0] };
        let capacity = self.capacity_n_m_s2.range_within(minimum, maximum);
        let (lowest, highest) = self.torque_ratio.range_within(minimum, maximum);
        let (ratios, squares) = ([lowest, highest], engine.map(|speed| speed * speed));
        // In overrun the torque is negative, and least where its size is largest.
        let end = |capacity: T, drive: usize, overrun: usize| {
            let at = if capacity < T::zero() { overrun } else { drive };
            capacity * squares[at] * ratios[at]
        };
        [end(capacity.0, 0, 1), end(capacity.1, 1, 0)]
    }

    /// Turbine torque, N m, with this engine at full throttle and at a steady speed, and the turbine at this speed. The engine
    /// turns no slower than the turbine and no faster than its torque map goes.
    pub fn full_throttle_turbine_torque(&self, engine: &Engine<T>, turbine_rad_s: T) -> T {
        let surplus = |speed: T| {
            let pump_n_m = self.torques(speed, turbine_rad_s).pump_n_m;
            engine.torque(speed, T::one()) - engine.drag_n_m_s * speed - pump_n_m
        };
        let fastest = engine.torque_n_m.rows().last().map_or(turbine_rad_s, |last| last.at_least(turbine_rad_s));
        let (mut slow, mut fast) = (turbine_rad_s, fastest);
        for _ in 0..HALVINGS {
            let middle = T::of(0.5) * (slow + fast);
            if surplus(middle) > T::zero() { slow = middle } else { fast = middle }
        }
        self.torques(fast, turbine_rad_s).turbine_n_m
    }

    /// The same converter in another precision.
    pub fn cast<U: Real>(&self) -> Converter<U> {
        Converter { capacity_n_m_s2: self.capacity_n_m_s2.cast(), torque_ratio: self.torque_ratio.cast() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn converter() -> Converter<f64> {
        Converter {
            capacity_n_m_s2: Table1::new(&[0.0, 0.9, 1.0, 1.5], &[4e-3, 2e-3, 0.0, -2e-3]).unwrap(),
            torque_ratio: Table1::new(&[0.0, 0.9, 1.0], &[2.0, 1.0, 1.0]).unwrap(),
        }
    }

    #[test]
    fn stall_multiplies_torque_and_coupling_does_not() {
        let stall = converter().torques(200.0, 0.0);
        assert_eq!((stall.pump_n_m, stall.turbine_n_m), (160.0, 320.0));
        let coupling = converter().torques(200.0, 180.0);
        assert_eq!((coupling.pump_n_m, coupling.turbine_n_m), (80.0, 80.0));
        // Half way between them both maps are.
        let between = converter().torques(200.0, 90.0);
        assert!((between.pump_n_m - 120.0).abs() < 1e-9 && (between.turbine_n_m - 180.0).abs() < 1e-9);
    }

    #[test]
    fn the_fluid_never_creates_power_in_drive_or_overrun() {
        for percent in 0..200 {
            let (engine, turbine) = (200.0, 2.0 * f64::from(percent));
            let torques = converter().torques(engine, turbine);
            assert!(torques.pump_n_m * engine - torques.turbine_n_m * turbine >= -1e-9);
        }
    }

    #[test]
    fn overrun_turns_the_flow_of_torque_around() {
        let torques = converter().torques(100.0, 130.0);
        assert!(torques.pump_n_m < 0.0 && torques.turbine_n_m < 0.0);
    }

    #[test]
    fn the_slope_is_the_derivative_of_the_turbine_torque() {
        let converter = converter();
        for turbine in [60.0, 150.0, 190.0, 199.0, 230.0, 500.0] {
            let (torque, slope) = converter.turbine_with_slope(200.0, turbine);
            assert!((torque - converter.torques(200.0, turbine).turbine_n_m).abs() < 1e-9);
            let at = |by: f64| converter.torques(200.0, turbine + by).turbine_n_m;
            let difference = (at(1e-4) - at(-1e-4)) / 2e-4;
            assert!((slope - difference).abs() < 1e-5, "{turbine}: {slope} {difference}");
        }
    }

    #[test]
    fn the_range_of_the_turbine_torque_holds_it_and_ends_at_it() {
        for (engine, turbine) in
            [([180.0, 220.0], [60.0, 120.0]), ([90.0, 110.0], [95.0, 130.0]), ([0.0, 5.0], [0.0, 3.0])]
        {
            let [low, high] = converter().turbine_range(engine, turbine);
            let (mut minimum, mut maximum) = (f64::INFINITY, f64::NEG_INFINITY);
            for i in 0..=40 {
                for j in 0..=40 {
                    let between = |[a, b]: [f64; 2], k: i32| a + (b - a) * f64::from(k) / 40.0;
                    let torque = converter().torques(between(engine, i), between(turbine, j)).turbine_n_m;
                    (minimum, maximum) = (minimum.min(torque), maximum.max(torque));
                }
            }
            assert!(low <= minimum && maximum <= high, "{low} {minimum} {maximum} {high}");
            // Beside a stalled engine speed ratio and engine speed are hardly one from the other, and it is wider.
            let stalled = engine[0] < 1.0;
            assert!(stalled || high - low < 1.2 * (maximum - minimum), "{low} {minimum} {maximum} {high}");
        }
    }

    #[test]
    fn at_full_throttle_the_pump_takes_what_the_engine_gives() {
        let map =
            |maximum: f64| crate::Table2::new(&[0.0, 400.0], &[0.0, 1.0], &[[0.0, maximum], [0.0, maximum]]).unwrap();
        let engine = |maximum: f64| Engine { inertia_kg_m2: 0.2, drag_n_m_s: 0.0, torque_n_m: map(maximum) };
        // 160 N m are 4e-3 N m s^2 times the square of 200 rad/s; at rest the turbine has twice that.
        let stall = converter().full_throttle_turbine_torque(&engine(160.0), 0.0);
        assert!((stall - 320.0).abs() < 1e-9, "{stall}");
        // At the coupling point 80 N m are 2e-3 N m s^2 times that square.
        let coupling = converter().full_throttle_turbine_torque(&engine(80.0), 180.0);
        assert!((coupling - 80.0).abs() < 1e-9, "{coupling}");
        // At the end of its map, 400 rad/s, a stronger engine has more than the pump takes, 640 N m.
        assert!((converter().full_throttle_turbine_torque(&engine(1e3), 0.0) - 1280.0).abs() < 1e-9);
        // Where the turbine turns faster than the engine can, there is no drive.
        assert_eq!(converter().full_throttle_turbine_torque(&engine(160.0), 500.0), 0.0);
    }

    #[test]
    fn a_stalled_engine_gives_finite_torques() {
        let torques = converter().torques(0.0, 50.0);
        assert!(torques.pump_n_m.is_finite() && torques.turbine_n_m.is_finite());
    }
}
