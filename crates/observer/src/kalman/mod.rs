//! Kalman filter of the powertrain with elastic shafts, unknown torques, and sensors that are not exact.
//!
//! | state | law | meaning |
//! |---|---|---|
//! | `w_t`, `w_0`, `w_w` | momentum | speeds of turbine, output and driven wheels, rad/s |
//! | `T_k` | `K_s (w_0/i_df - w_w)` | torque of the shafts' spring, N m |
//! | `p` | the valve's maps, times `1 + g` | pressure of the oncoming clutch, Pa |
//! | `T_ca` | random walk; once released it fades | torque of the offgoing clutch, N m |
//! | `T_L` | random walk | all that the wheels' equation leaves out: road, grade, mass, tyre slip, N m |
//! | `e` | fades in seconds | fraction by which the turbine torque differs from the converter's maps |
//! | `f`, `g` | fade in tens of seconds | fraction by which the friction and the valve's gain differ from their maps |
//! | `s`, `d_w`, `d_o` | constant | scale of the wheel speed; delay of the wheel speed and of the output speed, both against the turbine speed, s |
//!
//! Every reading is a measurement of its own that may be absent; a step without one only predicts. A reading is compared
//! with the speed at the time at which it was measured, which lies between two steps or before both: the filter remembers the
//! speeds at two earlier times. The covariance has the newer ones, about one step ago; an older speed errs as the line through
//! the speed then and now does.
//!
//! Before the shift the gear ratio ties turbine to output speed: with it, scale and delays are found. A reading of one then
//! tells both; where both come in a step, they take turns. Scale and delays are kept from shift to shift; friction and gain are
//! kept for some shifts and then forgotten.
//!
//! Where a log has the command of the offgoing clutch, its valve model limits `T_ca`; where it has the torque that the engine's
//! controller reports, that is a second source of the turbine torque.
//!
//! A reading that contradicts all the others is refused once; one that goes on to do so is believed. The fraction `e` is
//! only corrected while both clutches slip (a consider state, S. F. Schmidt 1966): before, an error that shaft
//! and relative turbine torque error cancels in the clutch torque, and no speed shows it.
//!
//! The covariance is corrected in Joseph's form `P - K S' - S K' + K V K'`, which holds for any gain and keeps it
//! positive but for rounding. A filter whose variance is no number, or negative, begins anew and says so.

mod covariance;
pub(crate) mod engine;
mod engine_torque;
pub(crate) mod gate;
mod offgoing;
mod parameters;
mod past;
mod phases;
mod powertrain;
mod predict;
mod readings;
mod states;
pub(crate) mod valve_model;

use drivetrain::{Engagement, Real, ShiftCoefficients};

use crate::{
    ChannelHealth, Channels, CompliantModel, Estimate, Estimator, Health, Input, InputLimits, LOST_S, Phase, Reading,
    Supervisor, SupervisorState,
};
use covariance::{CONSIDERED, Covariance, Measured};
use engine::Engine;
use engine_torque::LastTorque;
use gate::Gate;
use offgoing::OffgoingPressure;
use past::Past;
use states::{FRICTION, LEARNT, N, OUTPUT, PIECE_S, PRESSURE, SPRING, TURBINE, WHEEL};
use valve_model::Commands;

pub use engine::EngineNoise;
pub use engine_torque::ReportedTorque;
pub use offgoing::OffgoingClutch;
pub use parameters::{SpeedReading, Uncertainty};
pub use states::STATES;
pub use valve_model::ValveModel;

/// The filter.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct KalmanFilter<T> {
    /// The powertrain.
    pub model: CompliantModel<T>,
    /// Coefficients while both clutches slip; a clutch that holds does so with the torque that this takes.
    both: ShiftCoefficients<T>,
    /// Coefficients after lock-up.
    locked: ShiftCoefficients<T>,
    /// The valve.
    pub valve: ValveModel<T>,
    /// What it does not know.
    pub uncertainty: Uncertainty<T>,
    /// How turbine, output and wheel speed are read.
    pub readings: [SpeedReading<T>; 3],
    /// How the engine speed is read.
    pub engine: (SpeedReading<T>, EngineNoise<T>),
    /// The offgoing clutch, for logs with its command.
    pub offgoing: OffgoingClutch<T>,
    /// The reported engine torque, for logs with it.
    pub reported: ReportedTorque<T>,
    /// The phase supervisor.
    pub supervisor: Supervisor<T>,
    /// What counts as a measurement.
    pub limits: InputLimits<T>,
}

/// Memory of a [`KalmanFilter`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KalmanState<T> {
    started: bool,
    /// Pressure by the valve model alone, Pa.
    valve_pa: T,
    commands: Commands<T>,
    offgoing: OffgoingPressure<T>,
    reported: Option<LastTorque<T>>,
    supervisor: SupervisorState<T>,
    engine: Option<Engine<T>>,
    /// The newest readings of turbine, output and wheel: value, and age in s.
    newest: [Option<(T, T)>; 3],
    /// Which of turbine and output stood back when both came last. Every such step changes it, so that it is the same in any
    /// precision.
    turn: usize,
    running: Option<Running<T>>,
    /// Mean and covariance of what was learnt.
    learnt: Option<([T; LEARNT.len()], [[T; LEARNT.len()]; LEARNT.len()])>,
    /// Whether it has run before and lost its state.
    lost: bool,
    estimate: Estimate<T>,
}

/// The filter at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Running<T> {
    mean: [T; N],
    covariance: Covariance<T>,
    /// The speeds at earlier times, with which readings are compared that are older than this step.
    past: Past<T>,
    /// The earlier speeds from this one on have their covariance kept up to date.
    kept: usize,
    /// Time since the fractions that fade slowly have done so, s.
    unfaded_s: T,
    /// How fast the pressure moves or moved a while ago, Pa/s.
    motion_pa_s: T,
    /// Whether no command has come for long.
    is_unheard: bool,
    acting: Phase,
    /// Direction of the oncoming clutch's slip, 1 or -1, and for how long it has been the other one, s.
    direction: T,
    turned_s: T,
    /// For how long the turbine has run away from the old gear, s.
    flares_s: T,
    gates: [Gate; 3],
    /// Time since a reading of turbine, output or wheel was taken, s.
    silent_s: [T; 3],
    /// Squared innovations over their variances of the readings that were taken in the last step.
    squared_innovations: [Option<T>; 3],
}

impl<T: Real> KalmanFilter<T> {
    /// The filter of this powertrain.
    #[expect(clippy::too_many_arguments, reason = "the parts of the filter, each with a type of its own")]
    pub fn new(
        model: CompliantModel<T>,
        valve: ValveModel<T>,
        uncertainty: Uncertainty<T>,
        readings: [SpeedReading<T>; 3],
        engine: (SpeedReading<T>, EngineNoise<T>),
        offgoing: OffgoingClutch<T>,
        reported: ReportedTorque<T>,
        supervisor: Supervisor<T>,
        limits: InputLimits<T>,
    ) -> Self {
        let of = |engagement| model.shift.coefficients(engagement);
        let (both, locked) = (of(Engagement::BothSlipping), of(Engagement::OncomingStuck));
        Self { both, locked, model, valve, uncertainty, readings, engine, offgoing, reported, supervisor, limits }
    }
}

impl<T: Real> Estimator<T> for KalmanFilter<T> {
    type State = KalmanState<T>;

    fn start(&self) -> KalmanState<T> {
        KalmanState {
            started: false,
            valve_pa: T::zero(),
            commands: Commands::new(),
            offgoing: OffgoingPressure::new(),
            reported: None,
            supervisor: SupervisorState::new(),
            engine: None,
            newest: [None; 3],
            turn: TURBINE,
            running: None,
            learnt: None,
            lost: false,
            estimate: Estimate {
                pressure_pa: T::zero(),
                clutch_torque_n_m: T::zero(),
                shaft_torque_n_m: None,
                phase: Phase::BeforeShift,
                health: Health::Good,
                channels: Channels::all(ChannelHealth::Lost),
                bounds: None,
            },
        }
    }

    #[inline]
    fn step(&self, state: &mut KalmanState<T>, input: &Input<T>) -> Estimate<T> {
        let dt_s = if state.started { input.dt_s } else { T::zero() };
        if !(dt_s >= T::zero() && dt_s.is_finite()) {
            state.lose();
            state.newest = [None; 3];
            state.engine = None;
            state.estimate.health = Health::TimeRejected;
            state.estimate.channels = Channels::all(ChannelHealth::Refused);
            return state.estimate;
        }
        state.started = true;
        self.pass(state, dt_s);
        let mut channels = Channels::all(ChannelHealth::Absent);
        channels.command = self.take_command(state, input);
        channels.engine = self.take_engine(state, input);
        let speeds = self.take_speeds(state, input, dt_s);
        [channels.turbine, channels.output, channels.wheel] = speeds;
        channels.offgoing_command = state.offgoing.take(&self.offgoing, &self.limits, input.offgoing_command);
        channels.engine_torque = self.take_engine_torque(state, input, dt_s);
        if let Some(running) = &mut state.running {
            self.limit_offgoing(running, &state.offgoing);
        }
        let sound = self.settle(state);
        self.find_phase(state, dt_s);
        self.conclude(state, &channels, sound)
    }
}

impl<T: Real> KalmanFilter<T> {
    /// Lets time pass: valve, engine, powertrain.
    #[inline]
    fn pass(&self, state: &mut KalmanState<T>, dt_s: T) {
        if dt_s <= T::zero() {
            return;
        }
        for newest in state.newest.iter_mut().flatten() {
            newest.1 = newest.1 + dt_s;
        }
        if dt_s > T::of(LOST_S) {
            state.lose();
            state.engine = None;
        }
        let pieces = (dt_s / T::of(PIECE_S)).ceil().whole().clamp(1, 32);
        let piece_s = dt_s / T::of(pieces as f64);
        for _ in 0..pieces {
            state.commands.pass(piece_s);
            state.offgoing.pass(&self.offgoing, &self.limits, piece_s);
            let settled_pa = self.valve.target_pa(&state.commands, piece_s);
            state.valve_pa = self.limits.possible_pressure(self.valve.carried_pa(settled_pa, state.valve_pa, piece_s));
            if let Some(engine) = &mut state.engine {
                engine.predict(&self.engine.1, piece_s);
            }
            if let (Some(running), Some(engine)) = (&mut state.running, &state.engine) {
                running.is_unheard = !state.commands.is_fresh(T::of(predict::UNHEARD_S));
                self.predict(running, engine, settled_pa, piece_s);
            }
        }
    }

    #[inline]
    fn take_command(&self, state: &mut KalmanState<T>, input: &Input<T>) -> ChannelHealth {
        let Some(reading) = input.command else {
            return if state.commands.is_fresh(T::of(LOST_S)) { ChannelHealth::Absent } else { ChannelHealth::Lost };
        };
        let Some(reading) = self.limits.read_command(&reading) else { return ChannelHealth::Refused };
        let settled_pa = self.valve.valve.settled_pressure(reading.value);
        if state.commands.newest_pa().is_none() {
            // The first command is taken to have stood for long.
            state.valve_pa = self.limits.possible_pressure(settled_pa);
        }
        state.commands.send(reading.age_s, settled_pa, self.valve.needed_s(T::of(PIECE_S)));
        ChannelHealth::Good
    }

    #[inline]
    fn take_engine(&self, state: &mut KalmanState<T>, input: &Input<T>) -> ChannelHealth {
        let (sensor, noise) = &self.engine;
        let lost = T::of(LOST_S);
        let Some(reading) = input.engine_rad_s else {
            let lost = state.engine.is_none_or(|engine| engine.silent_s > lost);
            // The valve maps alone do without.
            let is_needed = self.uncertainty.output_least_rad_s < T::infinity();
            return match lost {
                true if is_needed => ChannelHealth::Lost,
                true => ChannelHealth::Unused,
                false => ChannelHealth::Absent,
            };
        };
        if !(self.limits.speed_valid(reading.value) && reading.age_s >= T::zero() && reading.age_s <= lost) {
            return ChannelHealth::Refused;
        }
        let slowest = self.uncertainty.output_least_rad_s;
        let age_s = reading.age_s + sensor.delay_s + sensor.lag_rad / reading.value.abs().at_least(slowest);
        match &mut state.engine {
            None => state.engine = Some(Engine::new(reading.value, noise)),
            Some(engine) => {
                if engine.take(noise, reading.value, age_s) == gate::Verdict::Refused {
                    return ChannelHealth::Refused;
                }
                if !engine.is_sound(&self.limits) {
                    state.engine = Some(Engine::new(reading.value, noise));
                }
            }
        }
        ChannelHealth::Good
    }

    /// Takes the readings of turbine, output and wheel.
    #[inline]
    fn take_speeds(&self, state: &mut KalmanState<T>, input: &Input<T>, dt_s: T) -> [ChannelHealth; 3] {
        let mut health = [ChannelHealth::Absent; 3];
        if let Some(running) = &mut state.running {
            running.squared_innovations = [None; 3];
        }
        let skipped = self.skipped(state, input);
        health[TURBINE] = self.take_speed::<TURBINE>(state, input.turbine_rad_s, skipped != Some(TURBINE));
        health[OUTPUT] = self.take_speed::<OUTPUT>(state, input.output_rad_s, skipped != Some(OUTPUT));
        health[WHEEL] = self.take_speed::<WHEEL>(state, input.wheel_rad_s, true);
        if let Some(running) = &mut state.running {
            let lost = T::of(LOST_S);
            for (health, silent_s) in health.iter_mut().zip(running.silent_s) {
                if *health == ChannelHealth::Absent && silent_s > lost {
                    *health = ChannelHealth::Lost;
                }
            }
            if state.supervisor.phase == Phase::BeforeShift
                && holds_offgoing(&self.supervisor, &self.model, &state.newest)
            {
                self.tie(running, dt_s);
            }
            self.limit_learnt(running);
        } else {
            for (health, newest) in health.iter_mut().zip(&state.newest) {
                if *health == ChannelHealth::Absent && newest.is_none_or(|(_, age_s)| age_s > T::of(LOST_S)) {
                    *health = ChannelHealth::Lost;
                }
            }
            if self.uncertainty.output_least_rad_s == T::infinity() {
                health[WHEEL] = ChannelHealth::Unused;
            }
        }
        health
    }

    /// The speed of which a reading of this step does not correct the filter. Before the shift turbine and output are tied by the
    /// gear's ratio, and a reading of one tells both: where both come, they take turns.
    #[inline]
    fn skipped(&self, state: &mut KalmanState<T>, input: &Input<T>) -> Option<usize> {
        let comes = |reading: Option<Reading<T>>| reading.is_some_and(|reading| self.limits.speed_valid(reading.value));
        if !(comes(input.turbine_rad_s) && comes(input.output_rad_s)) {
            return None;
        }
        state.turn = if state.turn == TURBINE { OUTPUT } else { TURBINE };
        let tied = state.running.is_some() && state.supervisor.phase == Phase::BeforeShift;
        (tied && holds_offgoing(&self.supervisor, &self.model, &state.newest)).then_some(state.turn)
    }

    /// Takes a reading of the speed `K`, if there is one. It corrects the filter if it is its `turn`.
    #[inline]
    fn take_speed<const K: usize>(
        &self,
        state: &mut KalmanState<T>,
        reading: Option<Reading<T>>,
        turn: bool,
    ) -> ChannelHealth {
        let Some(reading) = reading else { return ChannelHealth::Absent };
        let aged = reading.age_s >= T::zero() && reading.age_s <= T::of(LOST_S);
        // One that comes too late, after a newer one, is refused as well.
        let late = state.newest[K].is_some_and(|(_, age_s)| age_s < reading.age_s);
        if !(self.limits.speed_valid(reading.value) && aged) || late {
            return ChannelHealth::Refused;
        }
        let health = match &mut state.running {
            Some(running) if turn => self.correct::<K>(running, reading),
            Some(_) | None => ChannelHealth::Good,
        };
        // What the filter refuses shows no slip either.
        if health == ChannelHealth::Good {
            state.newest[K] = Some((reading.value, reading.age_s));
        }
        health
    }

    /// Keeps the state within what is possible; begins or ends the filter. Whether the estimate is sound.
    #[inline]
    fn settle(&self, state: &mut KalmanState<T>) -> Health {
        let mut health = Health::Good;
        if let Some(running) = &mut state.running {
            let blind = running.silent_s[TURBINE].at_most(running.silent_s[OUTPUT]) > T::of(LOST_S);
            let slow = running.mean[OUTPUT] <= self.uncertainty.output_least_rad_s;
            let possible = running.is_sound() && self.limits.shaft_torque_possible(running.mean[SPRING]);
            let limited = self.limits.possible_pressure(running.mean[PRESSURE]);
            if limited != running.mean[PRESSURE] && possible {
                health = Health::PressureLimited;
                running.mean[PRESSURE] = limited;
            }
            if blind || slow || !possible {
                state.lose();
                // At low speed a new start is no loss; and what was learnt with an impossible state is not kept.
                state.lost = blind || !possible;
                if !possible {
                    state.learnt = None;
                }
            }
        }
        if state.running.is_none() {
            // From readings without sense nothing begins.
            state.running = self
                .begin(state)
                .filter(|running| running.is_sound() && self.limits.shaft_torque_possible(running.mean[SPRING]));
            if let Some(running) = &state.running {
                // A log may begin in any phase.
                state.supervisor.phase = running.acting;
            }
            if state.running.is_some() && core::mem::take(&mut state.lost) {
                health = Health::Restarted;
            }
        }
        health
    }

    /// The estimate at the end of a step.
    #[inline]
    fn conclude(&self, state: &mut KalmanState<T>, channels: &Channels<ChannelHealth>, sound: Health) -> Estimate<T> {
        let clutch = &self.model.rigid.clutch;
        let mut health = sound;
        for channel in channels.each() {
            health = health.max(match channel {
                ChannelHealth::Unused | ChannelHealth::Good | ChannelHealth::Absent => Health::Good,
                ChannelHealth::Refused => Health::ReadingRefused,
                ChannelHealth::Lost => Health::ChannelLost,
            });
        }
        if matches!(channels.command, ChannelHealth::Refused | ChannelHealth::Lost) {
            health = health.max(Health::CommandRejected);
        }
        let estimate = &mut state.estimate;
        estimate.phase = state.supervisor.phase;
        estimate.channels = *channels;
        match &state.running {
            Some(running) => {
                let x = &running.mean;
                let line = &self.model.rigid.driveline;
                let limit = self.limits.shaft_torque_max_n_m;
                let shaft = x[SPRING] + line.shaft_damping_n_m_s_rad * line.twist_rate(x[OUTPUT], x[WHEEL]);
                let slip = self.model.shift.oncoming_slip(x[TURBINE], x[OUTPUT]);
                let engine = state.engine.map_or(x[TURBINE], |engine| engine.speed_before(T::zero()));
                if self.is_flare(running) {
                    health = health.max(Health::Flare);
                }
                estimate.pressure_pa = x[PRESSURE];
                estimate.shaft_torque_n_m = Some(shaft.at_least(-limit).at_most(limit));
                estimate.clutch_torque_n_m = if running.acting == Phase::AfterShift {
                    self.model.rigid.clutch_torque(running.acting, x[PRESSURE], engine, x[TURBINE], slip)
                } else {
                    (T::one() + x[FRICTION]) * running.direction * clutch.torque_capacity(x[PRESSURE], slip)
                };
            }
            None => {
                // The valve model alone.
                estimate.pressure_pa = state.valve_pa;
                estimate.shaft_torque_n_m = None;
                let (turbine, slip) = match state.newest {
                    [Some((turbine, _)), Some((output, _)), _] => {
                        (turbine, self.model.shift.oncoming_slip(turbine, output))
                    }
                    _ => (T::zero(), T::zero()),
                };
                let engine = state.engine.map_or(turbine, |engine| engine.speed_before(T::zero()));
                let acting = self.supervisor.acting_phase(estimate.phase, slip);
                estimate.clutch_torque_n_m =
                    self.model.rigid.clutch_torque(acting, state.valve_pa, engine, turbine, slip);
                health = health.max(if state.lost { Health::SpeedsRejected } else { Health::Good });
            }
        }
        estimate.health = health;
        *estimate
    }

    /// The same filter in another precision.
    pub fn cast<U: Real>(&self) -> KalmanFilter<U> {
        let (sensor, noise) = &self.engine;
        KalmanFilter::new(
            self.model.cast(),
            self.valve.cast(),
            self.uncertainty.cast(),
            self.readings.map(|reading| reading.cast()),
            (sensor.cast(), noise.cast()),
            self.offgoing.cast(),
            self.reported.cast(),
            self.supervisor.cast(),
            self.limits.cast(),
        )
    }
}

/// Whether the newest readings say that the offgoing clutch holds.
#[inline]
fn holds_offgoing<T: Real>(
    supervisor: &Supervisor<T>,
    model: &CompliantModel<T>,
    newest: &[Option<(T, T)>; 3],
) -> bool {
    match newest {
        [Some((turbine, _)), Some((output, _)), _] => {
            let slip = model.shift.offgoing_slip(*turbine, *output);
            slip.abs() <= supervisor.release_slip_rad_s.at_least(T::of(0.02) * turbine.abs())
        }
        _ => false,
    }
}

impl<T: Real> Running<T> {
    /// Corrects mean, covariance and remembered speeds for a measurement; of the considered states' best gains these fractions. The
    /// readings of the speeds from `next` on are still to come in this step.
    fn correct(&mut self, measured: &Measured<T>, innovation: T, fractions: &[T; CONSIDERED], next: usize) {
        // The next step remembers other speeds if it is due.
        if self.past.is_due() {
            self.kept = self.kept.max(next);
        }
        let moves = self.covariance.correct(measured, fractions, self.kept, innovation);
        for (x, by) in self.mean.iter_mut().zip(&moves.states) {
            *x = *x + *by;
        }
        self.past.correct(&moves);
    }

    /// Whether mean and covariance are numbers, and no variance is negative.
    #[inline]
    fn is_sound(&self) -> bool {
        // A sum with a number that is not finite is not finite.
        let sum = self.mean.iter().fold(T::zero(), |sum, x| sum + *x);
        sum.is_finite() && self.covariance.is_sound()
    }
}

impl<T: Real> KalmanState<T> {
    /// Mean and standard deviation of each of the [`STATES`], while the filter runs.
    pub fn states(&self) -> Option<[(T, T); N]> {
        let running = self.running.as_ref()?;
        Some(core::array::from_fn(|i| (running.mean[i], running.covariance.at(i, i).at_least(T::zero()).sqrt())))
    }

    /// Squared innovations over their variances of the readings of turbine, output and wheel speed that were taken in the last
    /// step: 1 on average for a filter that is as sure as it may be.
    pub fn squared_innovations(&self) -> [Option<T>; 3] {
        self.running.as_ref().map_or([None; 3], |running| running.squared_innovations)
    }

    /// Ends the filter; what it has learnt is kept.
    fn lose(&mut self) {
        if let Some(running) = self.running.take() {
            self.learnt = Some((LEARNT.map(|i| running.mean[i]), running.covariance.block(LEARNT)));
            self.lost = true;
        }
    }
}
