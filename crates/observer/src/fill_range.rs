//! The range of the cylinder pressure while the piston strokes.
//!
//! A clutch carries torque only after its piston has closed the clearance of the pack. Until then the pressure stays on
//! the plateau of the return spring, however high the pressure at the valve's outlet is. The range holds for this class
//! of cylinders; every parameter may be anywhere in its interval, and all but `p0`, `p1` and `V_k` may vary in time:
//!
//! ```text
//! dV/dt = Q - l      Q = 0 at s = p, does not fall with s - p, Q_lo(|s - p|) <= |Q| <= Q_hi(|s - p|);  0 <= l <= k p
//! p = P(V)           does not fall with V;  V < 0: piston on its stop, p <= p0
//!                    0 < V < V_k: stroke, p in [p0, p1];  V > V_k: the plates touch (kiss), p >= p1
//!                    off the stroke dV/dp <= C
//! Q_lo, Q_hi         flows of the passages of `drivetrain::Cylinder` with the maximum and the minimum resistance
//! ```
//!
//! where `s` is the outlet pressure, `V` the oil in the cylinder, `xi = V/V_k` the stroke. **Why it holds:** a larger
//! `s` never lowers `p` and a larger `V` never lowers `dV/dt` through another state (the system is quasi-monotone), and each
//! right-hand side does not rise with its own state. A solution of `dx/dt >= f` that starts above one of `dy/dt = f` then stays
//! above it, also where `f` is the largest value over all parameters at each instant. The volume is the right state
//! during the stroke, the pressure after it; gates join them:
//!
//! ```text
//! xi_hi  rises with Q_hi(s_hi - p0_lo)/V_lo, falls with Q_exh,lo(p0_lo - s_hi)/V_hi; held at 1 until F <= p1_lo
//! xi_lo  rises with (Q_lo(s_lo - p1_hi) - k p1_hi)/V_hi, falls with that over V_lo; held at 1 while m >= p1_hi
//! F      s_hi where it is above F, else decays to it by C/Q_exh,lo; at most p1_hi while xi_hi < 1; at least p0_hi when
//!        xi_hi comes to 0
//! m      s_lo (1 - leak fraction) where it is below m; else rises to it by C/Q_lo where the piston surely does not stroke:
//!        below p0_lo, with xi_lo = 1, or above p1_hi. Between them it is held. At least p1_lo when xi_lo comes to 1
//! upper: F if xi_hi = 0, p1_hi on the stroke, max(F, p1_hi) if xi_hi = 1        lower: m, at least p0_lo if xi_lo > 0
//! ```
//!
//! Over a time step the outlet pressures are the larger (smaller) of both ends and resistances those at its start, so that
//! each step errs to the outside. **Not in the class:** a pressure spike at the end of the fill, and `p0`, `p1` that change during a
//! shift by more than their intervals (seal friction, centrifugal pressure).

pub use car::FillBudget;
use drivetrain::Real;

/// Outlet pressure over a time step, Pa: the lowest of the lower and the highest of the upper limit at both ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Outlet<T> {
    pub(crate) lowest_pa: T,
    pub(crate) highest_pa: T,
    /// Highest that the supply can give.
    pub(crate) line_pa: T,
}

/// What is known of a piston and its cylinder.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PistonRange<T> {
    /// Minimum and maximum stroke over that to the kiss point, `xi_lo` and `xi_hi`.
    stroke: [T; 2],
    /// `m`, Pa.
    lowest_pa: T,
    /// `F`, Pa.
    highest_pa: T,
}

impl<T: Real> PistonRange<T> {
    /// Nothing is known, up to the highest pressure of the supply.
    pub fn unknown(line_pa: T) -> Self {
        Self { stroke: [T::zero(), T::one()], lowest_pa: T::zero(), highest_pa: line_pa }
    }

    /// Minimum and maximum stroke over that to the kiss point: 0 with the piston on its stop, 1 with the plates in contact.
    pub fn stroke(&self) -> [T; 2] {
        self.stroke
    }

    /// Lowest and highest cylinder pressure, Pa.
    #[inline]
    pub fn pressure_pa(&self, fill: &FillBudget<T>) -> [T; 2] {
        let [minimum, maximum] = self.stroke;
        let (home, kiss) = (T::zero(), T::one());
        let lower = if minimum > home { self.lowest_pa.at_least(fill.preload_pressure_pa[0]) } else { self.lowest_pa };
        let upper = if maximum <= home {
            self.highest_pa
        } else if maximum < kiss {
            fill.kiss_pressure_pa[1]
        } else {
            self.highest_pa.at_least(fill.kiss_pressure_pa[1])
        };
        [lower, upper]
    }

    /// Carries the range over `dt_s`.
    #[inline]
    pub(crate) fn advance(&mut self, fill: &FillBudget<T>, outlet: &Outlet<T>, dt_s: T) {
        self.raise(fill, outlet.highest_pa, dt_s);
        self.lower(fill, outlet.lowest_pa, fill.leak_fraction(outlet.line_pa), dt_s);
    }

    /// Carries the upper limits over `dt_s`, with the outlet at most at `s`.
    #[inline]
    fn raise(&mut self, fill: &FillBudget<T>, s: T, dt_s: T) {
        let (zero, one) = (T::zero(), T::one());
        let (before, f, p0) = (self.stroke[1], self.highest_pa, fill.preload_pressure_pa);
        let rate = if s > p0[0] {
            fill.max_in(s - p0[0]) / fill.volume_m3[0]
        } else if before >= one && f > fill.kiss_pressure_pa[0] {
            zero
        } else {
            -fill.min_out(p0[0] - s) / fill.volume_m3[1]
        };
        // Rounded away from the truth, so that no flow is too small to count in single precision.
        let stroke = ((before + dt_s * rate) * (one + T::epsilon())).at_least(zero).at_most(one);
        let mut highest = if s >= f {
            s
        } else {
            let drop = f - s;
            s + drop * (-dt_s * fill.min_out(drop) / (fill.capacity_m3_pa * drop)).exp()
        };
        if stroke < one {
            highest = highest.at_most(fill.kiss_pressure_pa[1]);
        }
        if stroke <= zero && before > zero {
            highest = highest.at_least(p0[1]);
        }
        (self.stroke[1], self.highest_pa) = (stroke, highest);
    }

    /// Carries the lower limits over `dt_s`, with the outlet at least at `s`.
    #[inline]
    fn lower(&mut self, fill: &FillBudget<T>, s: T, leak_fraction: T, dt_s: T) {
        let (zero, one) = (T::zero(), T::one());
        let (before, m, leak) = (self.stroke[0], self.lowest_pa, fill.leak_m3_s_pa);
        let ([p0, _], [p1, kissed]) = (fill.preload_pressure_pa, fill.kiss_pressure_pa);
        let target = s * (one - leak_fraction);
        let fallen = m.at_most(target);
        let net = if s > kissed {
            fill.min_in(s - kissed) - leak * kissed
        } else {
            -fill.max_out(kissed - s) - leak * kissed
        };
        let stroke = if before >= one && (net >= zero || fallen >= kissed) {
            one
        } else {
            let volume = if net > zero { fill.volume_m3[1] } else { fill.volume_m3[0] };
            ((before + dt_s * net / volume) * (one - T::epsilon())).at_least(zero).at_most(one)
        };
        let ceiling = if before >= one && stroke >= one || m >= kissed {
            target
        } else if m < p0 {
            target.at_most(p0)
        } else {
            m
        };
        let mut lowest = fallen;
        if ceiling > m {
            // The net flow at a drop, less that of the leak, is concave in the drop and not below zero at the target: the
            // chord from there to the start of the step is below it.
            let (drop, inflow) = (target - m, fill.min_in(s - m) - leak * m);
            let fraction = (-dt_s * inflow.at_least(zero) / (fill.capacity_m3_pa * drop)).exp();
            lowest = (target - drop * fraction).at_most(ceiling);
        }
        if stroke >= one {
            lowest = lowest.at_least(p1);
        }
        (self.stroke[0], self.lowest_pa) = (stroke, lowest);
    }
}
