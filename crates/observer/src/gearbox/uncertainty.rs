//! What the filter does not know, as standard deviations: of each element, and of the rest of the car.

use drivetrain::Real;
use drivetrain::clutch::drag_torque;

use super::{FrictionElement, square};

/// What the filter does not know beside the elements: standard deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShiftUncertainty<T> {
    /// Time after which the part of the error of a clutch's torque that does not last is another, s.
    pub torque_fraction_s: T,
    /// Time after which an error of the pressure is another, s.
    pub pressure_s: T,
    /// Of the turbine torque beside what lasts, as a fraction.
    pub turbine_share: T,
    /// Time after which it is another, s.
    pub turbine_share_s: T,
    /// Of the turbine-side inertia `M11`, as a fraction.
    pub inertia_share: T,
    /// Of the stiffness of the drive shafts, as a fraction.
    pub stiffness_fraction: T,
    /// Of the scale of the wheel speed, as a fraction.
    pub wheel_scale: T,
    /// Its random walk, per root second.
    pub wheel_scale_walk: T,
    /// Of the rate of twist at the start, rad/s: what a scale leaves of the wheel speed's error.
    pub rate_rad_s: T,
    /// Its random walk, rad/s per root second.
    pub rate_walk: T,
    /// Largest skew of turbine and output speed, s.
    pub channel_skew_s: T,
    /// Random walk of the load at the wheels, N m per root second.
    pub load_walk: T,
    /// Output speed below which readings of toothed wheels are too old to be used, rad/s.
    pub output_least_rad_s: T,
}

/// What the filter does not know of an element: standard deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ElementUncertainty<T> {
    /// `rho`: of its torque, as a fraction: friction, valve gain and valve map.
    pub torque_fraction: T,
    /// The part of its square that lasts from shift to shift: friction and gain. The same part of the kiss point's.
    pub slow_part: T,
    /// Of the valve's gain, as a fraction: in `torque_fraction`, and in the kiss point.
    pub valve_gain: T,
    /// Of the kiss point beside the gain, Pa: what lasts.
    pub kiss_point_pa: T,
    /// Of the valve's lag, as a fraction.
    pub valve_lag_fraction: T,
    /// Of the valve's delay, s: the pressure errs by this much of its rate.
    pub valve_delay_s: T,
    /// Error of the pressure at rest that does not last, Pa.
    pub pressure_pa: T,
    /// Peak of the drag of its plates, N m ([`drivetrain::clutch::drag_torque`]).
    pub drag_n_m: T,
    /// How many times as wide as usual the bounds of its errors are: the wider of friction and gain, of hysteresis and command, of lag and delay.
    pub widths: [T; 3],
}

impl<T: Real> ShiftUncertainty<T> {
    /// Times in which the errors of turbine torque and pressure fade, s.
    pub(super) fn fading_s(&self) -> [T; 2] {
        [self.turbine_share_s, self.pressure_s]
    }

    /// The same in another precision.
    pub fn cast<U: Real>(&self) -> ShiftUncertainty<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        ShiftUncertainty {
            torque_fraction_s: to(self.torque_fraction_s),
            pressure_s: to(self.pressure_s),
            turbine_share: to(self.turbine_share),
            turbine_share_s: to(self.turbine_share_s),
            inertia_share: to(self.inertia_share),
            stiffness_fraction: to(self.stiffness_fraction),
            wheel_scale: to(self.wheel_scale),
            wheel_scale_walk: to(self.wheel_scale_walk),
            rate_rad_s: to(self.rate_rad_s),
            rate_walk: to(self.rate_walk),
            channel_skew_s: to(self.channel_skew_s),
            load_walk: to(self.load_walk),
            output_least_rad_s: to(self.output_least_rad_s),
        }
    }
}

impl<T: Real> ElementUncertainty<T> {
    /// The same in another precision.
    pub fn cast<U: Real>(&self) -> ElementUncertainty<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        ElementUncertainty {
            torque_fraction: to(self.torque_fraction),
            slow_part: to(self.slow_part),
            valve_gain: to(self.valve_gain),
            kiss_point_pa: to(self.kiss_point_pa),
            valve_lag_fraction: to(self.valve_lag_fraction),
            valve_delay_s: to(self.valve_delay_s),
            pressure_pa: to(self.pressure_pa),
            drag_n_m: to(self.drag_n_m),
            widths: self.widths.map(to),
        }
    }
}

impl<T: Real> ShiftUncertainty<T> {
    /// Variance by which the error of a clutch's torque walks, of which this part lasts: after [`ShiftUncertainty::torque_fraction_s`] the rest
    /// is another.
    pub(super) fn friction_walk(&self, slow_part: T, dt_s: T) -> T {
        (T::one() - slow_part) * T::of(2.0) * dt_s / self.torque_fraction_s
    }
}

impl<T: Real> FrictionElement<T> {
    /// Drag of its plates at a slip, rad/s, with the sign of the slip, N m.
    #[inline]
    pub(super) fn drag_n_m(&self, slip_rad_s: T) -> T {
        drag_torque(self.uncertainty.drag_n_m, slip_rad_s)
    }

    /// Standard deviation of the kiss point, Pa: what lasts is an own one and that of the valve's gain.
    pub(super) fn kiss_std_dev_pa(&self) -> T {
        let u = &self.uncertainty;
        let by_gain_pa = u.valve_gain * self.clutch.kiss_pressure();
        ((square(u.kiss_point_pa) + square(by_gain_pa)) / u.slow_part).sqrt()
    }

    /// Standard deviation of the pressure at rest above the kiss point, Pa: what drives the piston of a slow fill.
    pub(super) fn above_kiss_pa(&self) -> T {
        (square(self.kiss_std_dev_pa()) + square(self.uncertainty.pressure_pa)).sqrt()
    }

    /// Error of the valve's gain, as a fraction, that the factor of the torque `f` and the kiss point `k` speak for.
    pub(super) fn gain_error(&self, f: T, k: T) -> T {
        let [by_f, by_k] = self.gain_by(self.uncertainty.slow_part.sqrt());
        by_f * f + by_k * k
    }

    /// Variance of the valve's gain, as a fraction, that is left where torque factor and kiss point are known.
    pub(super) fn gain_left(&self) -> T {
        let u = &self.uncertainty;
        let [with_f, with_k, both] = self.gain_with(u.slow_part.sqrt());
        let [by_f, by_k] = regression([with_f, with_k], both);
        (square(u.valve_gain) - by_f * with_f - by_k * with_k).at_least(T::zero())
    }

    /// Regression of the gain on torque factor and kiss point; `slow` is the deviation of what lasts of them in their own.
    pub(super) fn gain_by(&self, slow: T) -> [T; 2] {
        let [with_f, with_k, both] = self.gain_with(slow);
        regression([with_f, with_k], both)
    }

    /// Covariances of the gain with torque factor and kiss point, and of these two.
    fn gain_with(&self, slow: T) -> [T; 3] {
        let u = &self.uncertainty;
        let per = square(u.valve_gain) * slow / u.slow_part.sqrt();
        let with_k = -per * self.clutch.kiss_pressure() / self.kiss_std_dev_pa();
        [per / u.torque_fraction, with_k, slow * slow * self.correlation()]
    }

    /// Correlation of what lasts of torque factor and kiss point: a higher gain is more torque and an earlier kiss point.
    pub(super) fn correlation(&self) -> T {
        let u = &self.uncertainty;
        let slow = u.torque_fraction * u.slow_part.sqrt();
        let by_gain = u.valve_gain * u.valve_gain * self.clutch.kiss_pressure();
        -by_gain / (slow * u.slow_part.sqrt() * self.kiss_std_dev_pa())
    }

    /// The same of the states of a shift, of which a part does not last.
    pub(super) fn correlation_in_shift(&self) -> T {
        self.uncertainty.slow_part * self.correlation()
    }
}

/// Coefficients of the regression on two values of unit variance with this covariance, from the covariances with both.
fn regression<T: Real>([with_f, with_k]: [T; 2], both: T) -> [T; 2] {
    let left = T::one() - both * both;
    [(with_f - both * with_k) / left, (with_k - both * with_f) / left]
}
