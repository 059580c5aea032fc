//! The valve models of all elements, which run through the whole drive, and the torque that a slipping element has by them.

use drivetrain::Real;

use super::powertrain::ClutchTorque;
use super::tables::{FrictionElement, ShiftClutch};
use super::{PIECE_S, ShiftUncertainty, square};
use crate::bound::pressure_and_torque;
use crate::kalman::valve_model::Commands;
use crate::{ChannelHealth, InputLimits, LOST_S, PressureRange, Reading};

/// What is known of the errors of an element's pressure and kiss point, in their deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PressureError<T> {
    pub(super) pressure: T,
    pub(super) kiss: T,
    /// Of both.
    pub(super) variance: [T; 2],
    pub(super) covariance: T,
}

impl<T: Real> PressureError<T> {
    /// Nothing but what is learnt of the kiss point.
    pub(super) fn unseen(kiss: T) -> Self {
        Self { pressure: T::zero(), kiss, variance: [T::one(); 2], covariance: T::zero() }
    }
}

/// Mean of the pressure that presses the plates, Pa, and its derivative by the pressure above the kiss point, whose
/// mean and variance these are. The plates do not pull: near the kiss point the mean of `max(p, 0)` is more than that of the
/// mean. Of a uniform distribution, which has no tail far from its bounds.
fn pressed<T: Real>(mean_pa: T, variance: T) -> (T, T) {
    let half_pa = (T::of(3.0) * variance.max(T::zero())).sqrt();
    let above_pa = mean_pa + half_pa;
    if mean_pa >= half_pa {
        (mean_pa, T::one())
    } else if above_pa > T::zero() {
        let slope = above_pa / (half_pa + half_pa);
        (T::of(0.5) * slope * above_pa, slope)
    } else {
        (T::zero(), T::zero())
    }
}

/// Memory of an element.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ElementState<T> {
    commands: Commands<T>,
    /// Pressure by the valve model, Pa, and its rate over the last step, Pa/s.
    pub(super) valve_pa: T,
    rate_pa_s: T,
    /// Change of the pressure per share by which the lag is longer, Pa: `q' = -q/tau - p'`, with the other sign.
    per_lag_pa: T,
    range: Option<PressureRange<T>>,
}

impl<T: Real> ElementState<T> {
    pub(super) fn new(element: &FrictionElement<T>, limits: &InputLimits<T>) -> Self {
        Self {
            commands: Commands::new(),
            valve_pa: T::zero(),
            rate_pa_s: T::zero(),
            per_lag_pa: T::zero(),
            range: element.budget.as_ref().map(|budget| PressureRange::unknown(budget, limits.command_max)),
        }
    }

    /// Lets time pass, and takes a command if there is one.
    #[inline]
    pub(super) fn step(
        &mut self,
        element: &FrictionElement<T>,
        limits: &InputLimits<T>,
        command: Option<Reading<T>>,
        dt_s: T,
    ) -> ChannelHealth {
        if dt_s > T::zero() {
            let before_pa = self.valve_pa;
            let pieces = (dt_s / T::of(PIECE_S)).ceil().whole().clamp(1, super::MOST_PIECES);
            let piece_s = dt_s / T::of(pieces as f64);
            for _ in 0..pieces {
                self.commands.pass(piece_s);
                let settled_pa = element.valve.target_pa(&self.commands, piece_s);
                let step = element.valve.step(settled_pa, self.valve_pa, piece_s);
                let before_pa = self.valve_pa;
                self.valve_pa = limits.possible_pressure(step.phi * before_pa + step.drift_pa);
                self.per_lag_pa = step.phi * self.per_lag_pa + (self.valve_pa - before_pa);
            }
            self.rate_pa_s = (self.valve_pa - before_pa) / dt_s;
        }
        let usable = command.filter(|reading| limits.usable_command(reading));
        if let (Some(range), Some(budget)) = (&mut self.range, &element.budget) {
            range.step(budget, dt_s, usable, limits.command_max);
        }
        match (command, usable) {
            (None, _) if !self.commands.is_fresh(T::of(LOST_S)) => ChannelHealth::Lost,
            (None, _) => ChannelHealth::Absent,
            (Some(_), None) => ChannelHealth::Refused,
            (Some(_), Some(reading)) => {
                let settled_pa = element.valve.valve.settled_pressure(reading.value);
                if self.commands.newest_pa().is_none() {
                    // The first command is taken to have stood for long.
                    self.valve_pa = limits.possible_pressure(settled_pa);
                }
                self.commands.send(reading.age_s, settled_pa, element.valve.needed_s(T::of(PIECE_S)));
                ChannelHealth::Good
            }
        }
    }

    /// Forgets the range and the rate: time was lost, and with it commands.
    pub(super) fn forget(&mut self, element: &FrictionElement<T>, limits: &InputLimits<T>) {
        if let (Some(range), Some(budget)) = (&mut self.range, &element.budget) {
            range.forget(budget, limits.command_max);
        }
        (self.rate_pa_s, self.per_lag_pa) = (T::zero(), T::zero());
    }

    /// Standard deviation of the pressure by the valve model beside what lasts, Pa: errors of lag and delay while it
    /// moves, and at rest.
    pub(super) fn deviation_pa(&self, u: &ShiftUncertainty<T>) -> T {
        let moving = (u.valve_lag_share * self.per_lag_pa).hypot(u.valve_delay_s * self.rate_pa_s);
        moving.hypot(u.pressure_pa)
    }

    /// Torque at the turbine while the element slips. `slip_rad_s` is the slip at the turbine, `w_t - i w_o`; `direction`
    /// is its sign, less where it is uncertain.
    #[inline]
    pub(super) fn torque(
        &self,
        element: &FrictionElement<T>,
        shift: &ShiftClutch<T>,
        u: &ShiftUncertainty<T>,
        [slip_rad_s, direction]: [T; 2],
        wrong: &PressureError<T>,
    ) -> ClutchTorque<T> {
        let clutch = &element.clutch;
        let slip = shift.alpha * slip_rad_s;
        let size = shift.alpha.abs() * direction;
        let per_pa = size * clutch.torque_per_force(slip) * clutch.piston_area_m2;
        let (kiss_pa, moving_pa) = (u.kiss_deviation_pa(clutch), self.deviation_pa(u));
        let error_pa = moving_pa * wrong.pressure - kiss_pa * wrong.kiss;
        let variance = square(moving_pa) * wrong.variance[0] + square(kiss_pa) * wrong.variance[1]
            - T::of(2.0) * moving_pa * kiss_pa * wrong.covariance;
        let (pressed_pa, slope) = pressed(self.valve_pa - clutch.kiss_pressure() + error_pa, variance);
        ClutchTorque {
            ratio: shift.ratio,
            base_n_m: per_pa * (pressed_pa - slope * error_pa),
            per_friction_n_m: u.torque_share * per_pa * pressed_pa,
            per_kiss_n_m: -per_pa * slope * kiss_pa,
            per_pressure_n_m: per_pa * slope * moving_pa,
            open_loop_n_m: size * clutch.torque_capacity(self.valve_pa, slip),
        }
    }

    /// The torque at the turbine that the element can hold with an error of one deviation, and of three, N m.
    #[inline]
    pub(super) fn holds(
        &self,
        element: &FrictionElement<T>,
        shift: &ShiftClutch<T>,
        u: &ShiftUncertainty<T>,
    ) -> [T; 2] {
        let (clutch, one, three) = (&element.clutch, T::one(), T::of(3.0));
        let friction = clutch.static_friction.max(clutch.friction.at(T::zero()));
        let per_force = shift.alpha.abs() * friction * clutch.lever();
        let capacity = per_force * clutch.clamp_force(self.valve_pa);
        let wrong_pa = self.deviation_pa(u).hypot(u.kiss_deviation_pa(clutch));
        let wrong = per_force * clutch.piston_area_m2 * wrong_pa;
        [capacity * (one + u.torque_share), capacity * (one + three * u.torque_share) + three * wrong]
    }

    /// Guaranteed ranges of pressure and torque at the element, with its slip and the error of the slip if it is known.
    pub(super) fn ranges(&self, element: &FrictionElement<T>, slip_rad_s: Option<[T; 2]>) -> Option<([T; 2], [T; 2])> {
        let (range, budget) = (self.range.as_ref()?, element.budget.as_ref()?);
        Some(pressure_and_torque(&element.clutch, budget, range, slip_rad_s))
    }
}
