//! What the offgoing clutch can carry at most, where the command of its valve is known.

use drivetrain::{Clutch, Real};

use super::covariance::CONSIDERED;
use super::past::SPEEDS;
use super::predict::hypot;
use super::states::{OFFGOING, PIECE_S};
use super::valve_model::Commands;
use super::{KalmanFilter, Running, ValveModel};
use crate::{ChannelHealth, InputLimits, LOST_S, Reading};

/// The offgoing clutch as the filter knows it.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct OffgoingClutch<T> {
    /// Its valve.
    pub valve: ValveModel<T>,
    /// Geometry and friction.
    pub clutch: Clutch<T>,
    /// Torque that it may carry open, N m.
    pub open_n_m: T,
}

/// Its pressure by the valve model, from the first command on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct OffgoingPressure<T> {
    commands: Commands<T>,
    /// Pressure now, and the one that the commands in effect end at, Pa.
    pressure_pa: T,
    settled_pa: T,
}

impl<T: Real> OffgoingPressure<T> {
    /// Before the first command.
    pub(super) fn new() -> Self {
        Self { commands: Commands::new(), pressure_pa: T::zero(), settled_pa: T::zero() }
    }

    /// Lets time pass.
    #[inline]
    pub(super) fn pass(&mut self, offgoing: &OffgoingClutch<T>, limits: &InputLimits<T>, dt_s: T) {
        if self.commands.newest_pa().is_none() {
            return;
        }
        self.commands.pass(dt_s);
        self.settled_pa = offgoing.valve.target_pa(&self.commands, dt_s);
        self.pressure_pa = limits.possible_pressure(offgoing.valve.carried_pa(self.settled_pa, self.pressure_pa, dt_s));
    }

    /// Takes a command.
    #[inline]
    pub(super) fn take(
        &mut self,
        offgoing: &OffgoingClutch<T>,
        limits: &InputLimits<T>,
        reading: Option<Reading<T>>,
    ) -> ChannelHealth {
        // A log without this channel misses nothing, and one command stands until the next.
        let Some(reading) = reading else {
            return match self.commands.newest_pa() {
                None => ChannelHealth::Unused,
                Some(_) if self.commands.is_fresh(T::of(LOST_S)) => ChannelHealth::Absent,
                Some(_) => ChannelHealth::Lost,
            };
        };
        let Some(reading) = limits.read_command(&reading) else { return ChannelHealth::Refused };
        let settled_pa = offgoing.valve.valve.settled_pressure(reading.value);
        if self.commands.newest_pa().is_none() {
            // The first command is taken to have stood for long.
            self.pressure_pa = limits.possible_pressure(settled_pa);
            self.settled_pa = self.pressure_pa;
        }
        self.commands.send(reading.age_s, settled_pa, offgoing.valve.needed_s(T::of(PIECE_S)));
        ChannelHealth::Good
    }
}

impl<T: Real> KalmanFilter<T> {
    /// Takes in that the offgoing clutch carries no more than its capacity. A capacity is a limit and no reading: only a
    /// torque that is beyond it by more than its own standard deviation is corrected, and towards that.
    #[inline]
    pub(super) fn limit_offgoing(&self, running: &mut Running<T>, offgoing: &OffgoingPressure<T>) {
        let u = &self.uncertainty;
        if !offgoing.commands.is_fresh(T::of(LOST_S)) {
            return;
        }
        let clutch = &self.offgoing.clutch;
        let pressure_pa = offgoing.pressure_pa;
        let (torque, capacity) = (running.mean[OFFGOING], clutch.static_capacity(pressure_pa));
        if torque.abs() <= capacity {
            return;
        }
        // Lag and delay err in proportion to what the pressure still has to go.
        let by_valve = hypot(u.valve_gain * pressure_pa, u.valve_fraction * (pressure_pa - offgoing.settled_pa));
        let per_pa = clutch.static_friction * clutch.lever() * clutch.piston_area_m2;
        let std_dev = hypot(u.friction * capacity, per_pa * by_valve) + self.offgoing.open_n_m;
        let maximum = capacity + std_dev;
        if torque.abs() <= maximum {
            return;
        }
        let mut measured = running.covariance.with_state::<OFFGOING>(T::one());
        measured.variance = measured.with[OFFGOING].at_least(T::zero()) + std_dev * std_dev;
        let beyond = if torque > T::zero() { maximum - torque } else { -maximum - torque };
        running.correct(&measured, beyond, &[T::one(); CONSIDERED], SPEEDS);
    }
}

impl<T: Real> OffgoingClutch<T> {
    /// The same clutch in another precision.
    pub fn cast<U: Real>(&self) -> OffgoingClutch<U> {
        OffgoingClutch {
            valve: self.valve.cast(),
            clutch: self.clutch.cast(),
            open_n_m: U::of(self.open_n_m.to_f64_exact()),
        }
    }
}
