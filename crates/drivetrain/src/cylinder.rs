//! The cylinder of a hydraulic clutch: stroke of the piston, flow through the passages, leak.

use crate::oil::{WARM_OIL_DEGC, viscosity_m2_s};
use crate::{Clutch, Real};

/// A passage with a laminar and an orifice part in series: `|d| = R_l nu Q + R_t Q^2`, `d` the pressure drop, `Q` the
/// flow and `nu` the viscosity.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Passage<T> {
    /// `R_l`, Pa s^2/m^5: laminar resistance over kinematic viscosity.
    pub laminar_pa_s2_m5: T,
    /// `R_t = rho/(2 (C_d a)^2)`, Pa s^2/m^6: an orifice of area `a`.
    pub orifice_pa_s2_m6: T,
}

impl<T: Real> Passage<T> {
    /// Flow through the passage, m^3/s, in the direction of the drop: the root of the law above, in a form that has no
    /// difference of near numbers.
    #[inline]
    pub fn flow(&self, drop_pa: T, viscosity_m2_s: T) -> T {
        let (laminar, root) = self.laminar_and_root(drop_pa, viscosity_m2_s);
        T::of(2.0) * drop_pa / (laminar + root)
    }

    /// Flow per pressure drop, m^3/(s Pa), at this drop: the derivative of [`Self::flow`].
    #[inline]
    pub fn flow_per_drop(&self, drop_pa: T, viscosity_m2_s: T) -> T {
        self.laminar_and_root(drop_pa, viscosity_m2_s).1.recip()
    }

    /// Flow over pressure drop, m^3/(s Pa), at this drop.
    #[inline]
    fn flow_over_drop(&self, drop_pa: T, viscosity_m2_s: T) -> T {
        let (laminar, root) = self.laminar_and_root(drop_pa, viscosity_m2_s);
        T::of(2.0) / (laminar + root)
    }

    /// The same passage with this factor on the flow at every pressure drop.
    #[must_use]
    pub fn with_flow_factor(self, factor: T) -> Self {
        Self {
            laminar_pa_s2_m5: self.laminar_pa_s2_m5 / factor,
            orifice_pa_s2_m6: self.orifice_pa_s2_m6 / (factor * factor),
        }
    }

    /// The same passage with this factor on the pressure drop at every flow.
    #[must_use]
    pub fn with_resistance_factor(self, factor: T) -> Self {
        Self { laminar_pa_s2_m5: self.laminar_pa_s2_m5 * factor, orifice_pa_s2_m6: self.orifice_pa_s2_m6 * factor }
    }

    /// `R_l nu` and `sqrt((R_l nu)^2 + 4 R_t |d|)`, Pa s/m^3.
    #[inline]
    fn laminar_and_root(&self, drop_pa: T, viscosity_m2_s: T) -> (T, T) {
        let laminar = self.laminar_pa_s2_m5 * viscosity_m2_s;
        (laminar, (laminar * laminar + T::of(4.0) * self.orifice_pa_s2_m6 * drop_pa.abs()).sqrt())
    }

    /// The same passage in another precision.
    pub fn cast<U: Real>(&self) -> Passage<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        Passage { laminar_pa_s2_m5: to(self.laminar_pa_s2_m5), orifice_pa_s2_m6: to(self.orifice_pa_s2_m6) }
    }
}

/// A clutch cylinder between the outlet of its valve, pressure `s`, and the plates. Its state is the oil `V` beyond that
/// which it holds with the piston on its stop, m^3:
///
/// ```text
/// dV/dt = Q(s - p) - k p,   p = max(P(V), 0)
/// P(V)  = p0 + V/C_0               V < 0          the piston is on its stop: oil, air and seals yield
///       = p0 + (p1 - p0) V/V_k     0 to V_k       the stroke: the return spring alone, a plateau
///       = p1 + (V - V_k)/C_h       V > V_k        the plates touch: pack, linings and oil yield
/// ```
///
/// `Q` is the flow of the supply passage, at most that of the pump, or that of the exhaust passage where `s < p`. The
/// clutch carries torque only above `p1`, its kiss pressure. A cylinder with `V_k = 0` whose capacities tend to zero has
/// `p = s`: the valve's pressure alone, as in Eq. (2.4).
///
/// Sign: flow into the cylinder is positive; pressures are gauge. Left out: air in the oil, the inertia of the oil (a
/// pressure spike where the piston stops), the centrifugal head of a rotating cylinder, seal friction, and the oil that
/// a parked clutch loses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cylinder<T> {
    /// Volume of the stroke to the kiss point `V_k`, m^3.
    pub stroke_m3: T,
    /// Pressure `p0` at which the piston leaves its stop, Pa.
    pub preload_pa: T,
    /// Pressure `p1` at which the plates touch, Pa: `F_s/A` of the clutch.
    pub kiss_pa: T,
    /// Hydraulic capacity `C_0` with the piston on its stop, m^3/Pa.
    pub home_capacity_m3_pa: T,
    /// Hydraulic capacity `C_h` beyond the kiss point, m^3/Pa.
    pub capacity_m3_pa: T,
    /// The passage from the valve.
    pub supply: Passage<T>,
    /// The passage back through the valve to the sump.
    pub exhaust: Passage<T>,
    /// Largest flow of the supply, m^3/s: the pump's.
    pub flow_max_m3_s: T,
    /// Leak `k` of the seals, m^3/(s Pa).
    pub leak_m3_s_pa: T,
    /// Kinematic viscosity of the oil, m^2/s.
    pub viscosity_m2_s: T,
}

/// Stroke of the piston to the kiss point, m \[chosen\]: pack clearances of car gearboxes are 0.4 to 1.3 mm, strokes 1.5 to
/// 2.3 mm.
pub const STROKE_M: f64 = 1.2e-3;
/// Preload of the return spring over its force at the kiss point \[chosen\].
pub const PRELOAD_FRACTION: f64 = 0.75;
/// `C_h` and `C_0`, m^3/Pa \[chosen\]: 4 cm^3/MPa, as a pack yields 0.1 to 0.2 mm over 1 MPa and a cushion plate more.
pub const CAPACITY_M3_PA: f64 = 4e-12;
/// `R_l` and `R_t`: fill times and volume of clutch K1 of a Mercedes-Benz 722.6 give 1.17e7 Pa s/m^3 per mm^2/s and
/// 2.1e13 Pa s^2/m^6, an orifice of 2.8 mm.
pub const PASSAGE: Passage<f64> = Passage { laminar_pa_s2_m5: 1.17e13, orifice_pa_s2_m6: 2.1e13 };
/// Largest flow of the pump, m^3/s \[chosen\]: 15 l/min, an idling engine; the default passage takes 4.9 l/min at 0.15 MPa.
pub const FLOW_MAX_M3_S: f64 = 2.5e-4;
/// Leak, m^3/(s Pa) \[chosen\]: 0.12 l/min per MPa; seal rings have 0.1 to 0.5 l/min.
pub const LEAK_M3_S_PA: f64 = 2e-12;

impl<T: Real> Cylinder<T> {
    /// The cylinder of this clutch where nothing more is known, with warm oil.
    pub fn of_clutch(clutch: &Clutch<T>) -> Self {
        let passage = PASSAGE.cast();
        Self {
            stroke_m3: clutch.piston_area_m2 * T::of(STROKE_M),
            preload_pa: T::of(PRELOAD_FRACTION) * clutch.kiss_pressure(),
            kiss_pa: clutch.kiss_pressure(),
            home_capacity_m3_pa: T::of(CAPACITY_M3_PA),
            capacity_m3_pa: T::of(CAPACITY_M3_PA),
            supply: passage,
            exhaust: passage,
            flow_max_m3_s: T::of(FLOW_MAX_M3_S),
            leak_m3_s_pa: T::of(LEAK_M3_S_PA),
            viscosity_m2_s: viscosity_m2_s(T::of(WARM_OIL_DEGC)),
        }
    }

    /// The same cylinder with oil of this temperature, degC.
    #[must_use]
    pub fn with_oil(self, temperature_degc: T) -> Self {
        Self { viscosity_m2_s: viscosity_m2_s(temperature_degc), ..self }
    }

    /// Pressure `p` of this volume, Pa.
    #[inline]
    pub fn pressure(&self, volume_m3: T) -> T {
        if volume_m3 < T::zero() {
            (self.preload_pa + volume_m3 / self.home_capacity_m3_pa).at_least(T::zero())
        } else if volume_m3 < self.stroke_m3 {
            self.preload_pa + (self.kiss_pa - self.preload_pa) * volume_m3 / self.stroke_m3
        } else {
            self.kiss_pa + (volume_m3 - self.stroke_m3) / self.capacity_m3_pa
        }
    }

    /// Volume at this pressure, m^3: the inverse of [`Self::pressure`]; of a plateau without slope its end.
    pub fn volume(&self, pressure_pa: T) -> T {
        if pressure_pa < self.preload_pa {
            (pressure_pa - self.preload_pa) * self.home_capacity_m3_pa
        } else if pressure_pa < self.kiss_pa {
            self.stroke_m3 * (pressure_pa - self.preload_pa) / (self.kiss_pa - self.preload_pa)
        } else {
            self.stroke_m3 + (pressure_pa - self.kiss_pa) * self.capacity_m3_pa
        }
    }

    /// Pressure per volume, Pa/m^3: the derivative of [`Self::pressure`], of its upper side at a kink.
    #[inline]
    fn pressure_per_volume(&self, volume_m3: T) -> T {
        if volume_m3 < -self.preload_pa * self.home_capacity_m3_pa {
            T::zero()
        } else if volume_m3 < T::zero() {
            self.home_capacity_m3_pa.recip()
        } else if volume_m3 < self.stroke_m3 {
            (self.kiss_pa - self.preload_pa) / self.stroke_m3
        } else {
            self.capacity_m3_pa.recip()
        }
    }

    /// Flow into the cylinder, m^3/s, at this pressure drop from the valve to it.
    #[inline]
    pub fn flow(&self, drop_pa: T) -> T {
        if drop_pa < T::zero() {
            self.exhaust.flow(drop_pa, self.viscosity_m2_s)
        } else {
            self.supply.flow(drop_pa, self.viscosity_m2_s).at_most(self.flow_max_m3_s)
        }
    }

    /// Flow per pressure drop, m^3/(s Pa): the derivative of [`Self::flow`].
    #[inline]
    fn flow_per_drop(&self, drop_pa: T) -> T {
        if drop_pa < T::zero() {
            self.exhaust.flow_per_drop(drop_pa, self.viscosity_m2_s)
        } else if self.supply.flow(drop_pa, self.viscosity_m2_s) < self.flow_max_m3_s {
            self.supply.flow_per_drop(drop_pa, self.viscosity_m2_s)
        } else {
            T::zero()
        }
    }

    /// Rate of the volume, m^3/s, while the valve's outlet has the pressure `valve_pa`: `Q(s - p) - k p`.
    #[inline]
    pub fn volume_rate(&self, volume_m3: T, valve_pa: T) -> T {
        let pressure_pa = self.pressure(volume_m3);
        self.flow(valve_pa - pressure_pa) - self.leak_m3_s_pa * pressure_pa
    }

    /// Derivatives of [`Self::volume_rate`] by the volume, 1/s, and by the valve's pressure, m^3/(s Pa).
    #[inline]
    pub fn volume_rate_slopes(&self, volume_m3: T, valve_pa: T) -> (T, T) {
        let by_drop = self.flow_per_drop(valve_pa - self.pressure(volume_m3));
        (-(by_drop + self.leak_m3_s_pa) * self.pressure_per_volume(volume_m3), by_drop)
    }

    /// The volume `dt_s` later under this pressure at the valve's outlet, m^3: a step of the implicit Euler method, with the
    /// resistance of the passage at the drop of its start. A step of any length is stable, and may end beyond a kink of the
    /// pressure.
    #[inline]
    pub fn carried(&self, volume_m3: T, valve_pa: T, dt_s: T) -> T {
        let (zero, drop_pa) = (T::zero(), valve_pa - self.pressure(volume_m3));
        let per_drop = if drop_pa < zero {
            self.exhaust.flow_over_drop(drop_pa, self.viscosity_m2_s)
        } else {
            self.supply.flow_over_drop(drop_pa, self.viscosity_m2_s).at_most(self.flow_max_m3_s / drop_pa)
        };
        let loss = dt_s * (per_drop + self.leak_m3_s_pa);
        let without_loss = volume_m3 + dt_s * per_drop * valve_pa;
        // The volume at the end with this pressure then; where it is more than that of the pressure, the volume is larger.
        let with = |pressure_pa: T| without_loss - loss * pressure_pa;
        // On a straight part of the pressure from here, with this slope.
        let along = |pressure_pa: T, from_m3: T, per_m3: T| {
            with((pressure_pa + per_m3 * (without_loss - from_m3)) / (T::one() + per_m3 * loss))
        };
        if with(self.kiss_pa) >= self.stroke_m3 {
            along(self.kiss_pa, self.stroke_m3, self.capacity_m3_pa.recip())
        } else if with(self.preload_pa) >= zero {
            along(self.preload_pa, zero, (self.kiss_pa - self.preload_pa) / self.stroke_m3)
        } else {
            let empty_m3 = -self.preload_pa * self.home_capacity_m3_pa;
            along(self.preload_pa, zero, self.home_capacity_m3_pa.recip()).at_least(empty_m3)
        }
    }

    /// The same cylinder in another precision.
    pub fn cast<U: Real>(&self) -> Cylinder<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        Cylinder {
            stroke_m3: to(self.stroke_m3),
            preload_pa: to(self.preload_pa),
            kiss_pa: to(self.kiss_pa),
            home_capacity_m3_pa: to(self.home_capacity_m3_pa),
            capacity_m3_pa: to(self.capacity_m3_pa),
            supply: self.supply.cast(),
            exhaust: self.exhaust.cast(),
            flow_max_m3_s: to(self.flow_max_m3_s),
            leak_m3_s_pa: to(self.leak_m3_s_pa),
            viscosity_m2_s: to(self.viscosity_m2_s),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Table1;

    /// Clutch B of the built-in car.
    fn cylinder() -> Cylinder<f64> {
        let clutch = Clutch {
            mean_radius_m: 0.13,
            friction_faces: 3.0,
            piston_area_m2: 0.01,
            return_spring_n: 600.0,
            friction: Table1::constant(0.13),
            static_friction: 0.14,
        };
        Cylinder::of_clutch(&clutch)
    }

    /// Time from `from_m3` to `to_m3` under a constant valve pressure, s, in steps that the result does not depend on.
    fn time_between(c: &Cylinder<f64>, from_m3: f64, to_m3: f64, valve_pa: f64) -> f64 {
        let (mut volume, mut time, h) = (from_m3, 0.0, 2e-5);
        while (volume < to_m3) == (from_m3 < to_m3) {
            volume += h * c.volume_rate(volume, valve_pa);
            time += h;
            assert!(time < 10.0);
        }
        time
    }

    #[test]
    fn the_defaults_are_those_of_a_clutch_of_100_cm2() {
        let c = cylinder();
        assert!((c.stroke_m3 - 12e-6).abs() < 1e-12);
        assert_eq!((c.kiss_pa, c.preload_pa), (60e3, 45e3));
        // 4.9 l/min at 0.15 MPa with warm oil.
        assert!((6e4 * c.flow(0.15e6) - 4.9).abs() < 0.05, "{}", 6e4 * c.flow(0.15e6));
    }

    /// Fill times at 0.21 MPa at the valve from the separate calculation that gave the defaults. `R_t` is known to 2.4 %
    /// and has a weight of a half in a hot time, `R_l` to 0.4 %.
    #[test]
    fn the_fill_takes_the_time_that_the_resistances_were_found_from() {
        let c = Cylinder { leak_m3_s_pa: 0.0, ..cylinder() };
        for (degc, expected) in [(80.0, 0.143), (25.0, 0.168), (5.0, 0.229), (-20.0, 0.814)] {
            let found = time_between(&c.with_oil(degc), 0.0, c.stroke_m3, 0.21e6);
            assert!((found / expected - 1.0).abs() < 0.012, "{degc} degC: {found}");
        }
    }

    /// Fill, contact, release and a short pulse, hot and cold: the error is below the flow of one step at the steepest place,
    /// and falls with the step.
    #[test]
    fn a_long_step_follows_the_law() {
        let valve_pa = |time_s: f64| match time_s {
            t if t < 0.3 => 0.21e6,
            t if t < 0.5 => 0.21e6 + 2e6 * (t - 0.3),
            t if t < 0.8 => 0.0,
            t if t < 0.85 => 0.3e6,
            _ => 0.02e6,
        };
        for degc in [80.0, 0.0] {
            let c = cylinder().with_oil(degc);
            let apart = |steps: usize| {
                let step_s = 1.2 / steps as f64;
                let (mut long, mut short, mut apart) = (0.0_f64, 0.0_f64, 0.0_f64);
                for k in 0..steps {
                    let (begin_s, parts) = (k as f64 * step_s, 240_000 / steps);
                    for part in 1..=parts {
                        let at_s = begin_s + step_s * part as f64 / parts as f64;
                        short += 5e-6 * c.volume_rate(short, valve_pa(at_s));
                    }
                    long = c.carried(long, valve_pa(begin_s + step_s), step_s);
                    apart = apart.max((long - short).abs());
                }
                apart
            };
            let [long, half] = [480, 960].map(apart);
            assert!(long < 2.5e-3 * c.flow(0.61e6) && half < 0.7 * long, "{degc} degC: {long} {half}");
            // A step of any length rests where the flow is that of the leak.
            let settled = (0..1000).fold(0.0, |volume, _| c.carried(volume, 0.4e6, 0.1));
            assert!(c.volume_rate(settled, 0.4e6).abs() < 1e-12, "{degc} degC");
            let empty_m3 = -c.preload_pa * c.home_capacity_m3_pa;
            assert!((c.carried(0.0, 0.0, 1e3) / empty_m3 - 1.0).abs() < 1e-4, "{degc} degC");
        }
    }

    #[test]
    fn the_spring_empties_the_cylinder_in_the_time_given_for_each_temperature() {
        let c = cylinder();
        for (degc, expected, digits) in [(80.0, 0.26, 0.005), (5.0, 0.55, 0.01), (-20.0, 2.4, 0.05)] {
            let found = time_between(&c.with_oil(degc), c.stroke_m3, 0.0, 0.0);
            assert!((found - expected).abs() < digits, "{degc} degC: {found}");
        }
        // 59 % of a hot cylinder are still there after 100 ms, at most at the preload of the plateau.
        let (mut volume, h) = (c.stroke_m3, 1e-5);
        for _ in 0..10_000 {
            volume += h * c.volume_rate(volume, 0.0);
        }
        assert!((volume / c.stroke_m3 - 0.59).abs() < 0.005, "{}", volume / c.stroke_m3);
        assert!((c.preload_pa..c.kiss_pa).contains(&c.pressure(volume)));
    }

    #[test]
    fn volume_inverts_pressure_which_rises_through_its_kinks() {
        let c = cylinder();
        let mut before = -1.0;
        for n in 0..200 {
            let volume = -0.17e-6 + 0.08e-6 * f64::from(n);
            let pressure = c.pressure(volume);
            assert!(pressure > before && (c.volume(pressure) - volume).abs() < 1e-18, "{volume}");
            before = pressure;
        }
        assert_eq!(c.pressure(-1.0), 0.0);
        for kink in [0.0, c.stroke_m3] {
            assert!((c.pressure(kink + 1e-15) - c.pressure(kink - 1e-15)).abs() < 1.0);
        }
    }

    #[test]
    fn the_flow_satisfies_its_law_in_both_directions() {
        let c = Cylinder { exhaust: PASSAGE.with_resistance_factor(1.5), ..cylinder() };
        for (drop, passage) in [(1e3, c.supply), (0.2e6, c.supply), (-1e3, c.exhaust), (-0.3e6, c.exhaust)] {
            let q: f64 = c.flow(drop).abs();
            let back = passage.laminar_pa_s2_m5 * c.viscosity_m2_s * q + passage.orifice_pa_s2_m6 * q * q;
            assert!((back / drop.abs() - 1.0).abs() < 1e-12 && c.flow(drop) * drop > 0.0);
        }
        assert_eq!(c.flow(0.0), 0.0);
        assert_eq!(c.flow(50e6), c.flow_max_m3_s);
        let starved = c.supply.with_flow_factor(0.5);
        let (full, half) = (c.supply.flow(0.1e6, c.viscosity_m2_s), starved.flow(0.1e6, c.viscosity_m2_s));
        assert!((half / full - 0.5).abs() < 1e-12);
    }

    #[test]
    fn the_slopes_are_those_of_the_rate() {
        let c = cylinder();
        for (volume, valve) in [(-0.05e-6, 0.2e6), (5e-6, 0.2e6), (5e-6, 0.01e6), (12.8e-6, 0.4e6), (13e-6, 0.1e6)] {
            let (by_volume, by_valve) = c.volume_rate_slopes(volume, valve);
            let (dv, dp) = (1e-12, 1.0);
            let numeric = |h: f64, k: f64| c.volume_rate(volume + h, valve + k) - c.volume_rate(volume - h, valve - k);
            assert!((by_volume * 2.0 * dv / numeric(dv, 0.0) - 1.0).abs() < 1e-4, "{volume} {valve}");
            assert!((by_valve * 2.0 * dp / numeric(0.0, dp) - 1.0).abs() < 1e-4, "{volume} {valve}");
        }
    }

    #[test]
    fn without_stroke_and_capacity_the_pressure_is_the_valves() {
        let lag_at = |capacity: f64| {
            let c = Cylinder {
                stroke_m3: 0.0,
                capacity_m3_pa: capacity,
                home_capacity_m3_pa: capacity,
                leak_m3_s_pa: 0.0,
                ..cylinder()
            };
            // The lag near rest: capacity times the laminar resistance.
            let (by_volume, _) = c.volume_rate_slopes(c.volume(0.3e6), 0.3e6);
            -1.0 / by_volume
        };
        let laminar = PASSAGE.laminar_pa_s2_m5 * viscosity_m2_s::<f64>(WARM_OIL_DEGC);
        for capacity in [4e-12, 4e-15, 4e-18] {
            assert!((lag_at(capacity) / (capacity * laminar) - 1.0).abs() < 1e-9);
        }
    }
}
