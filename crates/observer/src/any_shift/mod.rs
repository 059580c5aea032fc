//! A Kalman filter for every shift of any automatic gearbox, over a whole drive.
//!
//! | state | law | meaning |
//! |---|---|---|
//! | `w_t`, `w_o`, `w_w` | momentum | speeds of turbine, output and driven wheels, rad/s |
//! | `T_s` | `K_s (w_o/i_df - w_w + r)` | torque of the shafts' spring, N m |
//! | `T_L` | random walk | load at the wheels: road, grade, mass, brake, tyre, N m |
//! | `r` | random walk | error of the rate of twist: the scale of the wheel speed, rad/s |
//! | `b` | random walk | share by which the turbine torque differs from its sources |
//! | `f_off`, `f_on` | fades in seconds, unit variance | error of the clutch's torque: friction and valve gain, which show as one |
//! | `x_off`, `x_on` | fades in 0.15 s, unit variance | error of the valve model's pressure: lag, delay, kiss point |
//!
//! Both clutches of a shift have the same equations, from [`GearboxTables`]; nothing is written for the oncoming one. A
//! clutch that slips has the torque of its valve model, corrected by `f` and `x`; one that holds has the torque that this
//! takes. Which of them hold, the measured slip decides ([`ShiftPhase`]). The shift command may change at any time: what
//! is known of an element that takes part in both shifts is kept, and nothing begins anew. The valve models of all
//! elements run all the time.
//!
//! Torque is estimated, and pressure follows: it is the valve model's, with the part of `f` that is the valve's gain.

mod covariance;
mod elements;
mod estimate;
mod newest;
mod phases;
mod powertrain;
mod tables;
mod turbine;

use drivetrain::{Driveline, Real};

use crate::kalman::engine::Engine;
use crate::kalman::gate::{Gate, Verdict};
use crate::{ChannelHealth, Channels, EngineNoise, Health, InputLimits, Reading, SpeedReading};
use covariance::{Gaussian, Measured};
use elements::ElementState;
use newest::Newest;
use phases::{Contact, PhaseMemory, Slip};
use powertrain::{CORE, ClutchTorque, Motion, Rates, Response, Torques, free, tied};
use turbine::InputSide;

pub use estimate::{ClutchEstimate, ShiftEstimate};
pub use phases::ShiftPhase;
pub use tables::{FrictionElement, GearRow, GearboxTables, MAX_ELEMENTS, ShiftClutch, ShiftRow};
pub use turbine::TurbineTorque;

const N: usize = 11;
const TURBINE: usize = 0;
const OUTPUT: usize = 1;
const WHEEL: usize = 2;
const SPEEDS: usize = 3;
const SPRING: usize = 3;
const LOAD: usize = 4;
const RATE: usize = 5;
const SHARE: usize = 6;
/// Of the offgoing and of the oncoming clutch.
const FRICTION: [usize; 2] = [7, 8];
const PRESSURE: [usize; 2] = [9, 10];

/// Longest time that is predicted at once, s; a longer one is cut.
const PIECE_S: f64 = 0.0125;
const MOST_PIECES: usize = 32;
/// Time without any speed after which the filter begins anew, s.
const LOST_S: f64 = 0.25;
/// How old the first readings may be, s.
const FIRST_S: f64 = 0.05;
/// Low-pass of the turbine torque that the share `b` multiplies, s.
const SHARE_S: f64 = 0.06;
/// Deviation of the age of the last tooth, in the time between two.
const TOOTH: f64 = 0.6;
/// Deviation of the model of the speeds over 10 ms, in deviations of a reading.
const MODEL_SHARE: f64 = 0.1;
/// Deviations of an innovation beyond which a reading is refused.
const GATE: u8 = 5;
/// Deviations at the start \[chosen\]: of the wheel speed about the output's, rad/s; of the shaft torque beside the share
/// `b`, and of the load about the shaft torque, each as a share and beside it, N m: the car may accelerate or brake.
const WHEEL_START_RAD_S: f64 = 0.3;
const SHAFT_START: (f64, f64) = (0.3, 100.0);
const LOAD_START: (f64, f64) = (1.0, 400.0);
/// Time over which the squared innovations are averaged, s, and their mean above which no phase of the shift explains the
/// speeds: five deviations that last.
const MISFIT_S: f64 = 0.05;
const MISFIT: f64 = 25.0;
/// Samples in a row with slip in a gear after which an element of the gear slips.
const SLIPS_IN_GEAR: u8 = 3;

/// What the filter does not know: standard deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShiftUncertainty<T> {
    /// `rho`: of a clutch's torque, as a share: friction, valve gain and valve map.
    pub torque_share: T,
    /// The part of its square that is the valve's gain.
    pub gain_part: T,
    /// Time after which that share is another, s.
    pub torque_share_s: T,
    /// Errors of the valve's lag and delay, s: the pressure errs by this much of its rate.
    pub valve_s: T,
    /// Error of the pressure at rest beside the gain: the kiss point, Pa.
    pub pressure_pa: T,
    /// Time after which an error of the pressure is another, s.
    pub pressure_s: T,
    /// Pressure below the kiss point from which on a clutch is open for sure, Pa.
    pub kiss_pa: T,
    /// Random walk of the share of the turbine torque, per root second.
    pub turbine_walk: T,
    /// Of the rate of twist at the start, rad/s.
    pub rate_rad_s: T,
    /// Its random walk, rad/s per root second.
    pub rate_walk: T,
    /// Random walk of the load at the wheels, N m per root second.
    pub load_walk: T,
    /// Output speed below which readings of toothed wheels are too old to be used, rad/s.
    pub output_least_rad_s: T,
}

/// The gear, or the shift, that the controller commands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GearCommand {
    /// The gear before, by its place in [`GearboxTables::gears`].
    pub from: usize,
    /// The gear after; the same gear while there is no shift.
    pub to: usize,
}

/// What came since the step before: of each channel the newest reading, or none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShiftInput<T> {
    /// Time since the step before, s. Ignored in the first step.
    pub dt_s: T,
    /// Engine speed, rad/s.
    pub engine_rad_s: Option<Reading<T>>,
    /// Turbine speed, rad/s.
    pub turbine_rad_s: Option<Reading<T>>,
    /// Speed of the gearbox output, rad/s.
    pub output_rad_s: Option<Reading<T>>,
    /// Speed of the driven wheels, rad/s.
    pub wheel_rad_s: Option<Reading<T>>,
    /// Engine torque as the engine's controller reports it, N m.
    pub engine_n_m: Option<Reading<T>>,
    /// Whether the lock-up clutch of the converter carries torque.
    pub lock_up_applied: bool,
    /// Commands of the valves, in the order of [`GearboxTables::elements`]: current in A, or duty cycle in %.
    pub commands: [Option<Reading<T>>; MAX_ELEMENTS],
    /// Gear or shift.
    pub gear: GearCommand,
}

/// The filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AnyShiftFilter<'a, T> {
    /// The gearbox.
    pub tables: GearboxTables<'a, T>,
    /// Differential, drive shafts and wheels.
    pub driveline: Driveline<T>,
    /// Inertia of wheels and car at the wheels, kg m^2.
    pub wheels_kg_m2: T,
    /// The torque at the gearbox input.
    pub turbine: TurbineTorque<T>,
    /// What it does not know.
    pub uncertainty: ShiftUncertainty<T>,
    /// How turbine, output and wheel speed are read.
    pub readings: [SpeedReading<T>; 3],
    /// How the engine speed is read.
    pub engine: (SpeedReading<T>, EngineNoise<T>),
    /// What counts as a measurement.
    pub limits: InputLimits<T>,
}

/// Memory of an [`AnyShiftFilter`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AnyShiftState<T> {
    started: bool,
    elements: [Option<ElementState<T>>; MAX_ELEMENTS],
    engine: Option<Engine<T>>,
    /// Newest reported engine torque, N m, and its age, s.
    reported: Option<(T, T)>,
    /// The newest readings of turbine, output and wheel.
    newest: [Option<Newest<T>>; SPEEDS],
    running: Option<Running<T>>,
    /// Whether it has run before and lost its state.
    lost: bool,
    /// Samples in a row in which the gear did not fit the speeds.
    unfit: u8,
    /// Whether an element of the gear has slipped, and no gear has fitted since.
    slips: bool,
    estimate: ShiftEstimate<T>,
}

/// The filter at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Running<T> {
    x: Gaussian<T>,
    /// The gear, while there is no shift.
    gear: usize,
    /// The shift.
    shift: Option<ShiftRow<T>>,
    phase: PhaseMemory<T>,
    /// The torques at the last step; none after a change of the shift, of which the one before had others.
    torques: Option<Torques<T>>,
    /// Turbine torque, low-passed, N m.
    slow_n_m: T,
    motion: Option<Motion<T>>,
    /// Rates of turbine, output and wheel speed, rad/s^2, now and at the step before.
    rates: [[T; SPEEDS]; 2],
    gates: [Gate; SPEEDS],
    /// Time since a reading was taken, s.
    silent_s: [T; SPEEDS],
    /// Mean squared innovation of turbine and output speed.
    misfit: T,
}

impl<T: Real> ShiftUncertainty<T> {
    /// The same in another precision.
    pub fn cast<U: Real>(&self) -> ShiftUncertainty<U> {
        let to = |x: T| U::of(x.to_f64_exact());
        ShiftUncertainty {
            torque_share: to(self.torque_share),
            gain_part: to(self.gain_part),
            torque_share_s: to(self.torque_share_s),
            valve_s: to(self.valve_s),
            pressure_pa: to(self.pressure_pa),
            pressure_s: to(self.pressure_s),
            kiss_pa: to(self.kiss_pa),
            turbine_walk: to(self.turbine_walk),
            rate_rad_s: to(self.rate_rad_s),
            rate_walk: to(self.rate_walk),
            load_walk: to(self.load_walk),
            output_least_rad_s: to(self.output_least_rad_s),
        }
    }
}

impl<T: Real> AnyShiftFilter<'_, T> {
    /// The same filter in another precision, with the same tables in that precision.
    pub fn cast<'a, U: Real>(&self, tables: GearboxTables<'a, U>) -> AnyShiftFilter<'a, U> {
        AnyShiftFilter {
            tables,
            driveline: self.driveline.cast(),
            wheels_kg_m2: U::of(self.wheels_kg_m2.to_f64_exact()),
            turbine: self.turbine.cast(),
            uncertainty: self.uncertainty.cast(),
            readings: self.readings.map(|reading| reading.cast()),
            engine: (self.engine.0.cast(), self.engine.1.cast()),
            limits: self.limits.cast(),
        }
    }

    /// Its memory before the first step.
    pub fn start(&self) -> AnyShiftState<T> {
        let mut elements = [None; MAX_ELEMENTS];
        for (state, element) in elements.iter_mut().zip(self.tables.elements) {
            *state = Some(ElementState::new(element, &self.limits));
        }
        AnyShiftState {
            started: false,
            elements,
            engine: None,
            reported: None,
            newest: [None; SPEEDS],
            running: None,
            lost: false,
            unfit: 0,
            slips: false,
            estimate: ShiftEstimate::nothing(),
        }
    }

    /// Takes what came since the step before and returns the estimate for now. Never panics; allocates nothing.
    pub fn step(&self, state: &mut AnyShiftState<T>, input: &ShiftInput<T>) -> ShiftEstimate<T> {
        let dt_s = if state.started { input.dt_s } else { T::zero() };
        if !(dt_s >= T::zero() && dt_s.is_finite()) {
            self.reject_time(state);
            return state.estimate;
        }
        state.started = true;
        let mut health = Health::Good;
        let mut channels = Channels::all(ChannelHealth::Absent);
        channels.command = self.pass_elements(state, input, dt_s);
        channels.engine = self.take_engine(state, input, dt_s);
        self.take_newest(state, input, dt_s, &mut channels);
        health = health.max(self.take_gear(state, input.gear));
        let torque = self.input_torque(state, input);
        if let Some(running) = &mut state.running {
            match &torque {
                Some(torque) => {
                    let speeds = self.measured(&state.newest, Some(running));
                    self.advance(running, &state.elements, torque, speeds, dt_s);
                    [channels.turbine, channels.output, channels.wheel] =
                        self.take_speeds(running, input, &channels, speeds);
                }
                None => state.lose(),
            }
        }
        health = health.max(self.settle(state, input, torque.as_ref()));
        self.conclude(state, input, &channels, health)
    }

    fn reject_time(&self, state: &mut AnyShiftState<T>) {
        state.lose();
        state.newest = [None; SPEEDS];
        state.engine = None;
        state.reported = None;
        for (memory, element) in state.elements.iter_mut().zip(self.tables.elements) {
            if let Some(memory) = memory {
                memory.forget(element, &self.limits);
            }
        }
        state.estimate.health = Health::TimeRejected;
        state.estimate.channels = Channels::all(ChannelHealth::Refused);
    }

    /// Lets the valve models go on and takes the commands. The health of the worst of those that came.
    fn pass_elements(&self, state: &mut AnyShiftState<T>, input: &ShiftInput<T>, dt_s: T) -> ChannelHealth {
        let u = &self.uncertainty;
        let stay = (-dt_s / u.torque_share_s).exp();
        let (mut came, mut refused) = (false, false);
        let elements = state.elements.iter_mut().zip(self.tables.elements).zip(&input.commands);
        for ((memory, element), command) in elements {
            let Some(memory) = memory else { continue };
            let health = memory.step(element, &self.limits, *command, dt_s);
            came = came || health == ChannelHealth::Good;
            refused = refused || health == ChannelHealth::Refused;
            memory.friction = [stay * memory.friction[0], T::one() - stay * stay * (T::one() - memory.friction[1])];
        }
        match (refused, came) {
            (true, _) => ChannelHealth::Refused,
            (false, true) => ChannelHealth::Good,
            (false, false) => ChannelHealth::Absent,
        }
    }

    fn take_engine(&self, state: &mut AnyShiftState<T>, input: &ShiftInput<T>, dt_s: T) -> ChannelHealth {
        let (sensor, noise) = &self.engine;
        let lost = T::of(LOST_S);
        if let Some(engine) = &mut state.engine {
            let pieces = (dt_s / T::of(PIECE_S)).ceil().whole().clamp(1, MOST_PIECES);
            for _ in 0..pieces {
                engine.predict(noise, dt_s / T::of(pieces as f64));
            }
            if engine.silent_s > lost {
                state.engine = None;
            }
        }
        if let Some((_, age_s)) = &mut state.reported {
            *age_s = *age_s + dt_s;
        }
        let torque_max = T::of(10.0) * self.limits.speed_max_rad_s;
        if let Some(reading) = input.engine_n_m {
            // A torque without sense is none.
            let usable = reading.value.abs() <= torque_max && reading.age_s >= T::zero() && reading.age_s <= lost;
            if usable {
                state.reported = Some((reading.value, reading.age_s));
            }
        }
        state.reported = state.reported.filter(|(_, age_s)| *age_s <= lost);
        let Some(reading) = input.engine_rad_s else {
            return if state.engine.is_some() { ChannelHealth::Absent } else { ChannelHealth::Lost };
        };
        if !(self.limits.speed_valid(reading.value) && reading.age_s >= T::zero() && reading.age_s <= lost) {
            return ChannelHealth::Refused;
        }
        let age_s = self.age(sensor, &reading);
        match &mut state.engine {
            None => state.engine = Some(Engine::new(reading.value, noise)),
            Some(engine) => {
                if engine.take(noise, reading.value, age_s) == Verdict::Refused {
                    return ChannelHealth::Refused;
                }
                if !engine.is_sound(&self.limits) {
                    state.engine = Some(Engine::new(reading.value, noise));
                }
            }
        }
        ChannelHealth::Good
    }

    /// Age of the middle of a reading, s.
    fn age(&self, sensor: &SpeedReading<T>, reading: &Reading<T>) -> T {
        let size = reading.value.abs().max(self.uncertainty.output_least_rad_s);
        reading.age_s + sensor.delay_s + sensor.lag_rad / size
    }

    /// Keeps the newest readings of turbine, output and wheel.
    fn take_newest(
        &self,
        state: &mut AnyShiftState<T>,
        input: &ShiftInput<T>,
        dt_s: T,
        channels: &mut Channels<ChannelHealth>,
    ) {
        let given = [input.turbine_rad_s, input.output_rad_s, input.wheel_rad_s];
        let health = [&mut channels.turbine, &mut channels.output, &mut channels.wheel];
        for (((newest, reading), health), sensor) in state.newest.iter_mut().zip(given).zip(health).zip(&self.readings)
        {
            if let Some(newest) = newest {
                newest.pass(dt_s);
            }
            let Some(reading) = reading else {
                let lost = newest.is_none_or(|newest| newest.age_s > T::of(LOST_S));
                *health = if lost { ChannelHealth::Lost } else { ChannelHealth::Absent };
                continue;
            };
            let aged = reading.age_s >= T::zero() && reading.age_s <= T::of(LOST_S);
            let taken = self.limits.speed_valid(reading.value)
                && aged
                && Newest::take(newest, reading.value, self.age(sensor, &reading), sensor.deviation_rad_s);
            *health = if taken { ChannelHealth::Good } else { ChannelHealth::Refused };
        }
    }

    /// Speeds of turbine and output at one time, that of the older reading; where there are none the estimates.
    fn measured(&self, newest: &[Option<Newest<T>>; SPEEDS], running: Option<&Running<T>>) -> [T; 2] {
        let fresh = |k: usize| newest[k].filter(|newest| newest.age_s <= T::of(FIRST_S));
        let older_s = |k: usize| fresh(k).map_or(T::zero(), |newest| newest.age_s);
        let age_s = older_s(TURBINE).max(older_s(OUTPUT));
        [TURBINE, OUTPUT].map(|k| match (fresh(k), running) {
            (Some(newest), _) => newest.at(age_s),
            (None, Some(running)) => running.x.mean[k],
            (None, None) => T::zero(),
        })
    }

    /// Speeds of turbine and output at the time of the older reading, and on the same lines now.
    fn then_and_now(&self, newest: &[Option<Newest<T>>; SPEEDS], running: Option<&Running<T>>) -> [[T; 2]; 2] {
        let then = self.measured(newest, running);
        let fresh = |k: usize| newest[k].filter(|newest| newest.age_s <= T::of(FIRST_S));
        [then, [TURBINE, OUTPUT].map(|k| fresh(k).map_or(then[k], |newest| newest.at(T::zero())))]
    }

    /// The torque at the gearbox input now, if it is known.
    fn input_torque(&self, state: &AnyShiftState<T>, input: &ShiftInput<T>) -> Option<turbine::Found<T>> {
        let turbine = match (state.newest[TURBINE], &state.running) {
            (Some(newest), _) if newest.age_s <= T::of(FIRST_S) => newest.at(T::zero()),
            (_, Some(running)) => running.x.mean[TURBINE],
            (Some(newest), None) => newest.value,
            (None, None) => return None,
        };
        let engine = state.engine.as_ref().map(|engine| {
            let now = engine.speed_before(T::zero());
            [now, engine.variance(), now - engine.speed_before(T::one())]
        });
        let deviation = self.readings[TURBINE].deviation_rad_s;
        let reported_n_m = state.reported.map(|(torque, _)| torque);
        let turbine = [turbine, deviation * deviation];
        self.turbine.at(&InputSide { engine, turbine, reported_n_m, lock_up_applied: input.lock_up_applied })
    }

    fn slip(&self, ratio: T, [turbine, output]: [T; 2]) -> Slip<T> {
        let deviation = self.readings[TURBINE].deviation_rad_s.hypot(ratio * self.readings[OUTPUT].deviation_rad_s);
        Slip { value: turbine - ratio * output, deviation }
    }

    /// Follows the shift command.
    fn take_gear(&self, state: &mut AnyShiftState<T>, command: GearCommand) -> Health {
        let speeds = self.measured(&state.newest, state.running.as_ref());
        let Some(running) = &mut state.running else { return Health::Good };
        let in_gear = command.from == command.to;
        match running.shift {
            None if in_gear && command.to == running.gear => Health::Good,
            Some(shift) if !in_gear && (shift.from, shift.to) == (command.from, command.to) => Health::Good,
            Some(shift) if in_gear && (command.to == shift.to || command.to == shift.from) => {
                // The command may say so before the clutch holds.
                let ends = if command.to == shift.to { ShiftPhase::OncomingHolds } else { ShiftPhase::OffgoingHolds };
                if running.phase.phase == ends {
                    running.end_shift(command.to, &mut state.elements);
                }
                Health::Good
            }
            _ => match self.tables.shift(command.from, command.to).filter(|_| !in_gear) {
                Some(shift) => {
                    let slips = shift.clutches.map(|clutch| self.slip(clutch.ratio, speeds));
                    running.begin_shift(*shift, slips, &mut state.elements);
                    Health::Good
                }
                None => {
                    // No equations for this change: the valve models alone, until a gear fits.
                    state.lose();
                    state.lost = false;
                    Health::SpeedsRejected
                }
            },
        }
    }

    /// Response of turbine and output in the phase of the moment.
    fn response(&self, running: &Running<T>) -> Response<T> {
        match (&running.shift, running.phase.phase.holding()) {
            (Some(shift), None) => free(&shift.mass_kg_m2),
            (Some(shift), Some(held)) => {
                let ratio = shift.clutches[held.min(1)].ratio;
                tied(ratio, shift.inertia_at(ratio))
            }
            (None, _) => match self.tables.gears.get(running.gear) {
                Some(gear) => tied(gear.ratio, gear.inertia_kg_m2),
                None => [[T::zero(); 2]; 2],
            },
        }
    }

    /// The torques now.
    fn torques(
        &self,
        running: &Running<T>,
        elements: &[Option<ElementState<T>>; MAX_ELEMENTS],
        turbine_n_m: T,
        speeds: [T; 2],
    ) -> Torques<T> {
        let mut clutches = [ClutchTorque::none(); 2];
        if let Some(shift) = &running.shift {
            for (c, (torque, clutch)) in clutches.iter_mut().zip(&shift.clutches).enumerate() {
                let slip = self.slip(clutch.ratio, speeds);
                let direction = running.phase.direction(c, &slip);
                if let Some((memory, element)) = self.element(elements, clutch.element) {
                    *torque = memory.torque(element, clutch, &self.uncertainty, slip.value, direction);
                }
            }
        }
        Torques { turbine_n_m, share_n_m: running.slow_n_m, clutches }
    }

    fn element<'s>(
        &'s self,
        elements: &'s [Option<ElementState<T>>; MAX_ELEMENTS],
        at: usize,
    ) -> Option<(&'s ElementState<T>, &'s FrictionElement<T>)> {
        elements.get(at)?.as_ref().zip(self.tables.elements.get(at))
    }

    /// Predicts over the step, and decides which clutches hold.
    fn advance(
        &self,
        running: &mut Running<T>,
        elements: &[Option<ElementState<T>>; MAX_ELEMENTS],
        torque: &turbine::Found<T>,
        speeds: [T; 2],
        dt_s: T,
    ) {
        let share = dt_s / (dt_s + T::of(SHARE_S));
        running.slow_n_m = running.slow_n_m + share * (torque.turbine_n_m - running.slow_n_m);
        let now = self.torques(running, elements, torque.turbine_n_m, speeds);
        let mean = running.torques.map_or(now, |before| before.mean(&now)).without(running.phase.phase.holding());
        if dt_s > T::zero() {
            let pieces = (dt_s / T::of(PIECE_S)).ceil().whole().clamp(1, MOST_PIECES);
            for _ in 0..pieces {
                self.predict(running, &mean, torque.noise, dt_s / T::of(pieces as f64));
            }
        }
        for silent_s in &mut running.silent_s {
            *silent_s = *silent_s + dt_s;
        }
        self.find_phase(running, elements, &now, speeds);
        // The phase may have changed the direction of a torque.
        running.torques = Some(self.torques(running, elements, torque.turbine_n_m, speeds));
    }

    fn predict(&self, running: &mut Running<T>, torques: &Torques<T>, torque_noise: T, dt_s: T) {
        let (u, response) = (&self.uncertainty, self.response(running));
        let motion = match running.motion {
            Some(motion) if motion.of == (response, dt_s) => motion,
            _ => Motion::new(response, &self.driveline, self.wheels_kg_m2, dt_s),
        };
        running.motion = Some(motion);
        let (rows, rest) = motion.rows(torques);
        let mut stay = [T::one(); N];
        let (friction, pressure) = ((-dt_s / u.torque_share_s).exp(), (-dt_s / u.pressure_s).exp());
        for c in 0..2 {
            stay[FRICTION[c]] = friction;
            stay[PRESSURE[c]] = pressure;
        }
        let x = &mut running.x;
        x.pass(&rows, &rest, &stay);
        for c in 0..2 {
            x.add(FRICTION[c], FRICTION[c], T::one() - friction * friction);
            x.add(PRESSURE[c], PRESSURE[c], T::one() - pressure * pressure);
        }
        for (state, walk) in [(LOAD, u.load_walk), (RATE, u.rate_walk), (SHARE, u.turbine_walk)] {
            x.add(state, state, walk * walk * dt_s);
        }
        let by_torque = motion.per_turbine_torque();
        for i in 0..CORE {
            for j in i..CORE {
                x.add(i, j, torque_noise * by_torque[i] * by_torque[j]);
            }
        }
        // What the model leaves out moves both speeds alike while a clutch ties them.
        let model =
            |k: usize| T::of(MODEL_SHARE * MODEL_SHARE * 100.0) * dt_s * square(self.readings[k].deviation_rad_s);
        x.add(WHEEL, WHEEL, model(WHEEL));
        x.add(OUTPUT, OUTPUT, model(OUTPUT));
        match self.tied_ratio(running) {
            Some(ratio) => {
                running.x.add(TURBINE, TURBINE, ratio * ratio * model(OUTPUT));
                running.x.add(TURBINE, OUTPUT, ratio * model(OUTPUT));
            }
            None => running.x.add(TURBINE, TURBINE, model(TURBINE)),
        }
    }

    /// The ratio that ties turbine and output now.
    fn tied_ratio(&self, running: &Running<T>) -> Option<T> {
        match (&running.shift, running.phase.phase.holding()) {
            (Some(shift), held) => held.map(|held| shift.clutches[held.min(1)].ratio),
            (None, _) => self.tables.gears.get(running.gear).map(|gear| gear.ratio),
        }
    }

    /// Decides which clutches hold, and what follows for the speeds.
    fn find_phase(
        &self,
        running: &mut Running<T>,
        elements: &[Option<ElementState<T>>; MAX_ELEMENTS],
        torques: &Torques<T>,
        speeds: [T; 2],
    ) {
        let Some(shift) = running.shift else { return };
        let contact = |c: usize| {
            let clutch = &shift.clutches[c];
            let holds_n_m = self
                .element(elements, clutch.element)
                .map_or([T::zero(); 2], |(memory, element)| memory.holds(element, clutch, &self.uncertainty));
            let (row, rest) = self.held_torque(&shift, c, torques);
            let needed_n_m = powertrain::dot(&row, &running.x.mean) + rest;
            Contact { slip: self.slip(clutch.ratio, speeds), needed_n_m, holds_n_m }
        };
        let contacts = [contact(0), contact(1)];
        let before = running.phase.phase;
        running.phase.step(&contacts);
        let after = running.phase.phase;
        if before == after {
            return;
        }
        if let Some(held) = before.holding() {
            // The slip has begun unseen.
            let (y, ratio) = (contacts[held.min(1)].slip.value, shift.clutches[held.min(1)].ratio);
            running.x.add(TURBINE, TURBINE, y * y);
            running.x.add(OUTPUT, OUTPUT, square(y / ratio));
        }
        if let Some(held) = after.holding() {
            let held = held.min(1);
            self.tie(running, shift.clutches[held].ratio, contacts[held].slip.deviation);
        }
    }

    /// Makes turbine and output speed those of a ratio.
    fn tie(&self, running: &mut Running<T>, ratio: T, deviation: T) {
        let mut row = [T::zero(); N];
        (row[TURBINE], row[OUTPUT]) = (T::one(), -ratio);
        let tie = Measured { row, value: T::zero(), noise: square(T::of(MODEL_SHARE) * deviation) };
        let [slip, _] = running.x.innovation(&tie);
        // The slip that is left goes where the inertia is small.
        running.x.add(TURBINE, TURBINE, slip * slip);
        running.x.correct(&tie);
    }

    /// The torque at the turbine with which a clutch holds, as a row over the states and what is left beside them:
    /// `U = X - M11 w_t' - M12 w_o'`.
    fn held_torque(&self, shift: &ShiftRow<T>, held: usize, torques: &Torques<T>) -> ([T; N], T) {
        let ratio = shift.clutches[held.min(1)].ratio;
        let torques = torques.without(Some(held));
        let rates = Rates::new(&tied(ratio, shift.inertia_at(ratio)), &torques, &self.driveline, self.wheels_kg_m2);
        let (mut row, mut rest) = torques.row([T::one(), T::zero()]);
        for k in [TURBINE, OUTPUT] {
            let mass = shift.mass_kg_m2[0][k];
            rest = rest - mass * rates.rest[k];
            for (x, rate) in row.iter_mut().zip(&rates.rows[k]) {
                *x = *x - mass * *rate;
            }
        }
        (row, rest)
    }

    /// Takes the readings of turbine, output and wheel, each against the speed at its time.
    fn take_speeds(
        &self,
        running: &mut Running<T>,
        input: &ShiftInput<T>,
        channels: &Channels<ChannelHealth>,
        speeds: [T; 2],
    ) -> [ChannelHealth; SPEEDS] {
        let given = [input.turbine_rad_s, input.output_rad_s, input.wheel_rad_s];
        let mut health = [channels.turbine, channels.output, channels.wheel];
        let unseen = self.may_slip_unseen(running, speeds);
        let Some(torques) = running.torques else { return health };
        let torques = torques.without(running.phase.phase.holding());
        let rates = Rates::new(&self.response(running), &torques, &self.driveline, self.wheels_kg_m2);
        for k in 0..SPEEDS {
            let Some(reading) = given[k].filter(|_| health[k] == ChannelHealth::Good) else { continue };
            if unseen && k != WHEEL {
                running.silent_s[k] = T::zero();
                continue;
            }
            health[k] = self.correct(running, k, &reading, &rates);
        }
        running.rates = [rates.at(&running.x.mean), running.rates[0]];
        health
    }

    /// Whether a clutch that is taken to hold may have begun to slip.
    fn may_slip_unseen(&self, running: &Running<T>, speeds: [T; 2]) -> bool {
        match (&running.shift, running.phase.phase.holding()) {
            (Some(shift), Some(held)) => {
                let slip = self.slip(shift.clutches[held.min(1)].ratio, speeds);
                slip.may_be()
            }
            (None, _) => self.tied_ratio(running).is_some_and(|ratio| self.slip(ratio, speeds).is_over()),
            _ => false,
        }
    }

    fn correct(&self, running: &mut Running<T>, k: usize, reading: &Reading<T>, rates: &Rates<T>) -> ChannelHealth {
        let sensor = &self.readings[k];
        let age_s = self.age(sensor, reading);
        let pitch_s = sensor.pitch_rad / reading.value.abs().max(self.uncertainty.output_least_rad_s);
        let rate = rates.at(&running.x.mean)[k];
        // The speed at the time of the reading: `w - age w'`.
        let mut row = rates.rows[k].map(|x| -age_s * x);
        row[k] = row[k] + T::one();
        let bent = T::of(0.5) * age_s * (rate - running.rates[0][k]);
        let noise = square(sensor.deviation_rad_s) + square(T::of(TOOTH) * rate * pitch_s) + square(bent);
        let measured = Measured { row, value: reading.value + age_s * rates.rest[k], noise };
        let [innovation, variance] = running.x.innovation(&measured);
        if k != WHEEL {
            let share = running.silent_s[k] / (running.silent_s[k] + T::of(MISFIT_S));
            running.misfit = running.misfit + share * (innovation * innovation / variance - running.misfit);
        }
        match running.gates[k].judge(innovation, variance) {
            Verdict::Refused => return ChannelHealth::Refused,
            Verdict::Jumped => running.x.add(k, k, innovation * innovation),
            Verdict::Taken => {}
        }
        running.x.correct(&measured);
        running.silent_s[k] = T::zero();
        ChannelHealth::Good
    }

    /// Ends a filter whose state is not possible, or whose gear does not fit; begins one in a gear.
    fn settle(
        &self,
        state: &mut AnyShiftState<T>,
        input: &ShiftInput<T>,
        torque: Option<&turbine::Found<T>>,
    ) -> Health {
        let mut health = Health::Good;
        let speeds = self.measured(&state.newest, state.running.as_ref());
        if let Some(running) = &state.running {
            let lost = T::of(LOST_S);
            let blind = running.silent_s[TURBINE].min(running.silent_s[OUTPUT]) > lost;
            let slow = running.x.mean[OUTPUT].abs() <= self.uncertainty.output_least_rad_s;
            let possible = running.x.is_sound()
                && self.limits.shaft_torque_possible(running.x.mean[SPRING])
                && running.x.mean[..SPEEDS].iter().all(|&speed| self.limits.speed_valid(speed));
            let ratio = self.tied_ratio(running).filter(|_| running.shift.is_none());
            let unfit = ratio.is_some_and(|ratio| self.slip(ratio, speeds).is_over());
            state.unfit = if unfit { state.unfit.saturating_add(1) } else { 0 };
            if running.misfit > T::of(MISFIT) {
                health = Health::HeldClutchSlips;
            }
            let slips = state.unfit >= SLIPS_IN_GEAR;
            if blind || slow || !possible || slips {
                state.lose();
                state.lost = blind || !possible;
            }
        }
        if state.running.is_none() {
            let (running, slips) = self.begin(state, input, torque);
            state.running = running.filter(|running| running.x.is_sound());
            state.slips = state.running.is_none() && (state.slips || slips);
            if state.slips {
                health = Health::HeldClutchSlips;
            }
            if state.running.is_some() && core::mem::take(&mut state.lost) {
                health = Health::Restarted;
            }
        }
        health
    }

    /// The first state, once the speeds are known and are those of a gear; and whether they are known and no gear fits.
    fn begin(
        &self,
        state: &AnyShiftState<T>,
        input: &ShiftInput<T>,
        torque: Option<&turbine::Found<T>>,
    ) -> (Option<Running<T>>, bool) {
        let (u, line, gear) = (&self.uncertainty, &self.driveline, input.gear);
        let first =
            |k: usize| state.newest[k].filter(|newest| newest.age_s <= T::of(FIRST_S)).map(|newest| newest.value);
        let (Some(turbine), Some(output), Some(torque)) = (first(TURBINE), first(OUTPUT), torque) else {
            return (None, false);
        };
        if output.abs() <= u.output_least_rad_s {
            return (None, false);
        }
        let shift = self.tables.shift(gear.from, gear.to).copied().filter(|_| gear.from != gear.to);
        let held = [(gear.from, ShiftPhase::OffgoingHolds), (gear.to, ShiftPhase::OncomingHolds)].into_iter().find_map(
            |(gear, phase)| {
                let ratio = self.tables.gears.get(gear)?.ratio;
                (!self.slip(ratio, [turbine, output]).is_over()).then_some((ratio, phase))
            },
        );
        let Some((ratio, phase)) = held else { return (None, gear.from == gear.to) };
        if gear.from != gear.to && shift.is_none() {
            return (None, false);
        }
        let phase = if shift.is_some() { phase } else { ShiftPhase::InGear };
        let shaft = torque.turbine_n_m * ratio * line.final_ratio;
        let wheel = output / line.final_ratio;
        let mut mean = [T::zero(); N];
        (mean[TURBINE], mean[OUTPUT], mean[WHEEL]) = (ratio * output, output, first(WHEEL).unwrap_or(wheel));
        (mean[SPRING], mean[LOAD]) = (shaft, shaft);
        let mut deviations = [T::zero(); N];
        deviations[OUTPUT] = self.readings[OUTPUT].deviation_rad_s;
        deviations[WHEEL] = T::of(WHEEL_START_RAD_S);
        deviations[SPRING] = at_start(SHAFT_START, shaft);
        deviations[LOAD] = at_start(LOAD_START, shaft);
        deviations[RATE] = u.rate_rad_s;
        let share = self.turbine.share(state.reported.is_some());
        deviations[SHARE] = share;
        let mut x = Gaussian::of(mean, deviations);
        for c in 0..2 {
            x.renew(FRICTION[c], T::zero(), T::one());
            x.renew(PRESSURE[c], T::zero(), T::one());
        }
        // Turbine and output are tied.
        let output_variance = square(deviations[OUTPUT]);
        x.add(TURBINE, TURBINE, ratio * ratio * output_variance);
        x.add(TURBINE, OUTPUT, ratio * output_variance);
        // An error of the turbine torque is one of the shaft torque in balance with it.
        x.add(SPRING, SPRING, square(share * shaft));
        x.add(SPRING, SHARE, share * share * shaft);
        let mut running = Running {
            x,
            gear: gear.from,
            shift: None,
            phase: PhaseMemory::new(phase),
            torques: None,
            slow_n_m: torque.turbine_n_m,
            motion: None,
            rates: [[T::zero(); SPEEDS]; 2],
            gates: [Gate::new(GATE); SPEEDS],
            silent_s: [T::zero(); SPEEDS],
            misfit: T::one(),
        };
        running.shift = shift;
        (Some(running), false)
    }
}

fn square<T: Real>(x: T) -> T {
    x * x
}

/// A deviation as a share of a value and beside it.
fn at_start<T: Real>((share, beside): (f64, f64), value: T) -> T {
    T::of(share) * value.abs() + T::of(beside)
}

impl<T: Real> AnyShiftState<T> {
    /// Ends the filter; what the elements have shown is kept.
    fn lose(&mut self) {
        if let Some(running) = self.running.take() {
            running.keep(&mut self.elements);
            self.lost = true;
        }
    }
}

impl<T: Real> Running<T> {
    /// Leaves with the elements of the shift what it has shown of them.
    fn keep(&self, elements: &mut [Option<ElementState<T>>; MAX_ELEMENTS]) {
        let Some(shift) = &self.shift else { return };
        for (clutch, k) in shift.clutches.iter().zip(FRICTION) {
            let (mean, variance) = (self.x.mean[k], self.x.covariance[k][k]);
            if let Some(Some(memory)) = elements.get_mut(clutch.element)
                && mean.is_finite()
                && variance >= T::zero()
            {
                memory.friction = [mean, variance.min(T::one())];
            }
        }
    }

    /// The gear holds.
    fn end_shift(&mut self, gear: usize, elements: &mut [Option<ElementState<T>>; MAX_ELEMENTS]) {
        self.keep(elements);
        for c in 0..2 {
            self.x.renew(FRICTION[c], T::zero(), T::one());
            self.x.renew(PRESSURE[c], T::zero(), T::one());
        }
        (self.gear, self.shift, self.torques) = (gear, None, None);
        self.phase = PhaseMemory::new(ShiftPhase::InGear);
    }

    /// Another shift: an element that takes part in both keeps what is known of it.
    fn begin_shift(
        &mut self,
        shift: ShiftRow<T>,
        slips: [Slip<T>; 2],
        elements: &mut [Option<ElementState<T>>; MAX_ELEMENTS],
    ) {
        self.keep(elements);
        let mut before = self.shift.map(|shift| shift.clutches.map(|clutch| clutch.element));
        if let Some([off, on]) = &mut before
            && (*on == shift.clutches[0].element || *off == shift.clutches[1].element)
        {
            self.x.swap(FRICTION[0], FRICTION[1]);
            self.x.swap(PRESSURE[0], PRESSURE[1]);
            core::mem::swap(off, on);
        }
        for (c, clutch) in shift.clutches.iter().enumerate() {
            if before.is_some_and(|before| before[c.min(1)] == clutch.element) {
                continue;
            }
            let [mean, variance] =
                elements.get(clutch.element).copied().flatten().map_or([T::zero(), T::one()], |memory| memory.friction);
            self.x.renew(FRICTION[c.min(1)], mean, variance);
            self.x.renew(PRESSURE[c.min(1)], T::zero(), T::one());
        }
        let phase = match (self.shift.is_none(), slips[0].is_over(), slips[1].is_over()) {
            (true, _, _) | (false, false, _) => ShiftPhase::OffgoingHolds,
            (false, true, false) => ShiftPhase::OncomingHolds,
            (false, true, true) => ShiftPhase::BothSlip,
        };
        (self.shift, self.torques) = (Some(shift), None);
        self.phase = PhaseMemory::new(phase);
    }
}
