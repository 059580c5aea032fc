//! The phase of the shift, as the filter sees it.

use drivetrain::Real;

use super::predict::{OFFGOING_START, at_start};
use super::states::{OFFGOING, OUTPUT, SPRING, TURBINE};
use super::{KalmanFilter, KalmanState, Running};
use crate::Phase;

/// How old readings may be that show a slip, s: over this time the speeds change by less than the threshold of a release.
const FRESH_S: f64 = 0.025;

impl<T: Real> KalmanFilter<T> {
    /// The phase that a log begins in: a clutch without slip holds.
    pub(super) fn first_phase(&self, state: &KalmanState<T>, turbine: T, output: T) -> Phase {
        let (shift, supervisor) = (&self.model.shift, &self.supervisor);
        let oncoming = shift.oncoming_slip(turbine, output).abs() < supervisor.lock_slip_rad_s;
        let offgoing = shift.offgoing_slip(turbine, output).abs() < supervisor.lock_slip_rad_s;
        let filled = state.valve_pa > supervisor.kiss_pressure_pa;
        match (filled, offgoing, oncoming) {
            (true, false, true) => Phase::AfterShift,
            (true, false, false) => Phase::InertiaPhase,
            (true, true, _) => Phase::TorquePhase,
            (false, ..) => Phase::BeforeShift,
        }
    }

    /// Follows the phase by the speeds: those of the filter, and the readings where it does not run.
    #[inline]
    pub(super) fn find_phase(&self, state: &mut KalmanState<T>, dt_s: T) {
        let shift = &self.model.shift;
        let readings = match state.newest {
            [Some((turbine, a)), Some((output, b)), _] if a.at_least(b) < T::of(FRESH_S) => Some((turbine, output)),
            _ => None,
        };
        let filtered = state.running.as_ref().map(|running| (running.mean[TURBINE], running.mean[OUTPUT]));
        let phase = state.supervisor.phase;
        // While the filter ties the speeds to the gear's ratio, only the readings show another one.
        let Some((turbine, output)) = filtered.filter(|_| phase != Phase::BeforeShift).or(readings) else { return };
        let slip = shift.oncoming_slip(turbine, output);
        // A clutch lets go, or grips again, when readings and filter both say so: one wrong reading moves the former, a
        // wrong torque the latter.
        let sources = [filtered.unwrap_or((turbine, output)), readings.unwrap_or((turbine, output))];
        let [a, b] = sources.map(|(turbine, output)| shift.offgoing_slip(turbine, output));
        let smaller = a.abs() < b.abs();
        let offgoing_slip = if smaller == (phase != Phase::InertiaPhase) { a } else { b };
        let phase = self.supervisor.step(&mut state.supervisor, dt_s, state.valve_pa, offgoing_slip, slip);
        let Some(running) = &mut state.running else { return };
        let acting = self.acting_phase(running, phase, slip, dt_s);
        if running.acting == Phase::AfterShift && matches!(acting, Phase::BeforeShift | Phase::TorquePhase) {
            // The offgoing clutch takes part again.
            let engine = state.engine.map_or(turbine, |engine| engine.speed_before(T::zero()));
            let torque = self.model.rigid.converter.torques(engine, turbine).turbine_n_m;
            let holding = self.holding(torque, running.mean[SPRING]);
            running.mean[OFFGOING] = holding;
            running.covariance.renew(OFFGOING, at_start(OFFGOING_START, holding));
        }
        running.acting = acting;
        let engine = state.engine.map_or(turbine, |engine| engine.speed_before(T::zero()));
        let flares = [a, b].into_iter().all(|slip| self.flares(running, engine, slip));
        running.flares_s = if flares { running.flares_s + dt_s } else { T::zero() };
    }

    /// Whether a flare lasts for longer than one wrong reading can show it.
    #[inline]
    pub(super) fn is_flare(&self, running: &Running<T>) -> bool {
        self.supervisor.is_held_longer(running.flares_s, T::of(FRESH_S))
    }

    /// Whether the turbine runs away from the old gear in the direction of its torque.
    #[inline]
    fn flares(&self, running: &Running<T>, engine_rad_s: T, offgoing_slip: T) -> bool {
        // In overrun the torque is negative.
        let ahead = if running.mean[TURBINE] > engine_rad_s { -offgoing_slip } else { offgoing_slip };
        running.acting == Phase::InertiaPhase && ahead > self.supervisor.release_slip_rad_s
    }

    /// The phase whose equations hold. A clutch whose slip ends is locked. Only a slip the other way that lasts has turned
    /// round: one that the speeds show for a moment is an error of theirs.
    #[inline]
    fn acting_phase(&self, running: &mut Running<T>, phase: Phase, slip: T, dt_s: T) -> Phase {
        let forward = running.direction * slip;
        let minimum = self.supervisor.lock_slip_rad_s;
        running.turned_s = if forward < -minimum { running.turned_s + dt_s } else { T::zero() };
        if self.supervisor.is_held_longer(running.turned_s, T::zero())
            || phase == Phase::BeforeShift && forward < -minimum
        {
            running.direction = -running.direction;
            running.turned_s = T::zero();
        }
        let slips = running.direction * slip > minimum;
        if phase == Phase::InertiaPhase && !slips { Phase::AfterShift } else { phase }
    }
}
