//! Bounds of the stroke of a piston.

use drivetrain::{Passage, Real};

/// Limits of the cylinder and its passages under which the range holds.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FillBudget<T> {
    /// Minimum and maximum volume of the stroke `V_k`, m^3.
    pub volume_m3: [T; 2],
    /// Minimum and maximum pressure `p0` at which the piston leaves its stop, Pa.
    pub preload_pressure_pa: [T; 2],
    /// Minimum and maximum pressure `p1` at which the plates touch, Pa.
    pub kiss_pressure_pa: [T; 2],
    /// The passage into the cylinder, of the minimum and the maximum resistance.
    pub supply: [Passage<T>; 2],
    /// The passage out of it, of the minimum and the maximum resistance.
    pub exhaust: [Passage<T>; 2],
    /// Minimum and maximum kinematic viscosity of the oil, m^2/s.
    pub viscosity_m2_s: [T; 2],
    /// Flow that the supply gives at least if the passage takes it, m^3/s.
    pub flow_max_m3_s: T,
    /// Largest leak over pressure `k`, m^3/(s Pa).
    pub leak_m3_s_pa: T,
    /// Largest hydraulic capacity `C` off the stroke, m^3/Pa.
    pub capacity_m3_pa: T,
}

impl<T: Real> FillBudget<T> {
    /// The same limits in another precision.
    pub fn cast<U: Real>(&self) -> FillBudget<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        FillBudget {
            volume_m3: self.volume_m3.map(to),
            preload_pressure_pa: self.preload_pressure_pa.map(to),
            kiss_pressure_pa: self.kiss_pressure_pa.map(to),
            supply: self.supply.map(|passage| passage.cast()),
            exhaust: self.exhaust.map(|passage| passage.cast()),
            viscosity_m2_s: self.viscosity_m2_s.map(to),
            flow_max_m3_s: to(self.flow_max_m3_s),
            leak_m3_s_pa: to(self.leak_m3_s_pa),
            capacity_m3_pa: to(self.capacity_m3_pa),
        }
    }

    /// Largest fraction of a pressure of at most `line_pa` that the leak takes, across the passage that feeds it.
    #[inline]
    pub fn leak_fraction(&self, line_pa: T) -> T {
        let ([_, passage], leak) = (&self.supply, self.leak_m3_s_pa);
        let laminar = passage.laminar_pa_s2_m5 * self.viscosity_m2_s[1];
        (leak * (laminar + passage.orifice_pa_s2_m6 * leak * line_pa)).at_most(T::one())
    }

    /// Maximum flow in at this pressure drop, m^3/s.
    #[inline]
    pub fn max_in(&self, drop_pa: T) -> T {
        self.supply[0].flow(drop_pa, self.viscosity_m2_s[0])
    }

    /// Minimum flow in at this pressure drop, m^3/s.
    #[inline]
    pub fn min_in(&self, drop_pa: T) -> T {
        self.supply[1].flow(drop_pa, self.viscosity_m2_s[1]).at_most(self.flow_max_m3_s)
    }

    /// Maximum flow out at this pressure drop, m^3/s.
    #[inline]
    pub fn max_out(&self, drop_pa: T) -> T {
        self.exhaust[0].flow(drop_pa, self.viscosity_m2_s[0])
    }

    /// Minimum flow out at this pressure drop, m^3/s.
    #[inline]
    pub fn min_out(&self, drop_pa: T) -> T {
        self.exhaust[1].flow(drop_pa, self.viscosity_m2_s[1])
    }
}
