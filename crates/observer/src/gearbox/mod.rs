//! A Kalman filter for every shift of any automatic gearbox, over a whole drive.
//!
//! | state | law | meaning |
//! |---|---|---|
//! | `w_t`, `w_o`, `w_w` | momentum | speeds of turbine, output and driven wheels, rad/s |
//! | `T_s` | `K_s (w_o/i_df - w_w + r)` | torque of the shafts' spring, N m |
//! | `T_L` | random walk | load at the wheels: road, grade, mass, brake, tyre, N m |
//! | `r` | random walk | error of the rate of twist: what a scale leaves of the wheel speed's error, rad/s |
//! | `s` | constant | error of the scale of the wheel speed, as a fraction: its reading is that of `(1 + s) w_w` |
//! | `b` | fades in seconds | fraction by which the turbine torque differs from its sources |
//! | `c` | fades in hours, unit variance | the part of that fraction that lasts |
//! | `f_off`, `f_on` | random walk, unit variance | error of the clutch's torque: friction and valve gain, which show as one |
//! | `k_off`, `k_on` | constant, unit variance | error of its kiss point |
//! | `x_off`, `x_on` | fades in 0.15 s, unit variance | error of the valve model's pressure: lag and delay; and of the fill, which ends with it |
//! | `m` | constant, unit variance | error of the turbine-side inertia `M11` |
//!
//! Both clutches of a shift have the same equations, from [`GearboxTables`]; nothing is written for the oncoming one. A
//! clutch that slips has the torque of its valve model, corrected by `f` and `x`; one that holds has the torque that this
//! takes. A one-way clutch holds any torque in one direction, and none in the other. Which of them hold, the measured slip decides ([`ShiftPhase`]);
//! while that may be a wrong reading, the filter goes on for both cases (`doubt.rs`). Where the speeds are noisier than stated, it takes them so (`noise.rs`). The shift command may change at any time: what
//! is known of an element that takes part in both shifts is kept, and nothing begins anew. The valve models of all
//! elements run all the time. Where pistons have a stroke, a clutch carries nothing before its plates touch; the
//! time is estimated by ten piston models for each element, each with its probability.
//!
//! A longitudinal acceleration, where one is read, has a bias apart from these states (`acceleration.rs`, `bias.rs`).
//!
//! Torque is estimated, and pressure follows: it is the valve model's, with the gain of the valve that `f` and `k` speak for.
//!
//! `s`, `c`, `f`, `k` and `m` last longer than a shift. What a shift or the time in a gear has shown of them is kept in [`Learnt`], which can be saved
//! and given to another filter of the same car ([`GearboxFilter::start_with`]), which believes it as far as its shifts show it.

mod acceleration;
mod at_turbine;
mod begin;
mod believed;
mod beyond_bounds;
mod bias;
mod correct;
mod covariance;
mod doubt;
mod elements;
mod estimate;
mod held;
mod information;
mod input_clutch;
mod late;
mod learnt;
mod newest;
mod noise;
mod one_shift;
mod phases;
mod pistons;
mod powertrain;
mod predict;
mod ratios;
mod readings;
mod reported;
mod running;
mod skew;
mod slip_fit;
mod systematic;
mod tables;
mod timing;
mod turbine;
mod uncertainty;

use car::{Gear, ShiftCommand};
use drivetrain::{Driveline, Real};

use crate::kalman::engine::Engine;
use crate::kalman::gate::{Gate, Verdict};
use crate::{ChannelHealth, Channels, EngineNoise, Health, InputLimits, LOST_S, Reading, SpeedReading};
use acceleration::{Acceleration, ByTorque, Felt};
use beyond_bounds::{Evidence, FINE_S};
use covariance::{Gaussian, Measured};
use doubt::Moment;
use elements::ElementState;
use late::Late;
use learnt::{ACTING, Acting, Correlations, Known, STATES_ACTING};
use newest::Newest;
use noise::ReadingNoise;
use phases::{Contact, PhaseMemory, Slip};
use powertrain::{CORE, ClutchTorque, Motion, Rates, Response, Torques, free, output_rate, tied};
use ratios::RatioErrors;
use reported::Compared;
use skew::Skew;
use slip_fit::SlipFit;
use timing::Timing;
use turbine::InputSide;

pub use acceleration::AccelerationReading;
pub use at_turbine::ClutchesAtTurbine;
pub use believed::UnheardTorque;
pub use beyond_bounds::{BeyondBounds, CarQuantity, Elements};
pub use estimate::{ClutchEstimate, ShiftEstimate};
pub use input_clutch::InputClutch;
pub use late::LONGEST_DELAY_S;
pub use learnt::{LEARNT, Learnt, LearntElement, MAX_PAIRS};
pub use one_shift::{OneShiftFilter, OneShiftState, OneShiftTables};
pub use phases::ShiftPhase;
pub use pistons::Piston;
pub use tables::{
    FrictionElement, GearRow, GearboxTables, MAX_ELEMENTS, ShiftClutch, ShiftElement, ShiftRow, ValveLimits,
};
pub use turbine::TurbineTorque;
pub use uncertainty::{ElementUncertainty, ShiftUncertainty};

const N: usize = 16;
/// The first of them are all that moves in a gear.
const IN_GEAR: usize = 9;
const TURBINE: usize = 0;
const OUTPUT: usize = 1;
const WHEEL: usize = 2;
const SPEEDS: usize = 3;
const SPRING: usize = 3;
const LOAD: usize = 4;
const RATE: usize = 5;
const SCALE: usize = 6;
const FRACTION: usize = 7;
const SLOW_FRACTION: usize = 8;
/// Of the offgoing and of the oncoming clutch.
const FRICTION: [usize; 2] = [9, 10];
const KISS: [usize; 2] = [11, 12];
const PRESSURE: [usize; 2] = [13, 14];
const INERTIA: usize = 15;
/// The states that are learnt. Lag and delay of the valves are learnt beside them, and are none.
const LASTING: [usize; STATES_ACTING] = [FRICTION[0], FRICTION[1], KISS[0], KISS[1], INERTIA, SLOW_FRACTION];

/// Longest time that is predicted at once, s; a longer one is cut.
const PIECE_S: f64 = 0.0125;
const MAX_PIECES: usize = 32;
/// Time without a reading of turbine or output speed in a shift after which it teaches nothing, s \[chosen\].
const GAP_S: f64 = 0.025;
/// Longest step, s \[chosen\]; a longer one counts as this.
const LONGEST_S: f64 = 1e6;
/// How old the first readings may be, s.
const FIRST_S: f64 = 0.05;
/// Low-pass of the turbine torque that the fraction `b` multiplies, s.
const FRACTION_S: f64 = 0.06;
/// How long the drive shafts twist in one direction, s: half a swing \[chosen\].
const TWIST_S: f64 = 0.1;
/// Time over which the wheel speed is compared with that of the output, s, and the largest twist of the drive shafts, rad \[chosen\].
const WHEEL_S: f64 = 1.0;
const TWIST_RAD: f64 = 0.3;
/// Standard deviation of the age of the last tooth, in the time between two.
const TOOTH: f64 = 0.6;
/// Standard deviation of the model of the speeds over 10 ms, in standard deviations of a reading.
const MODEL_FRACTION: f64 = 0.1;
/// Standard deviations of an innovation beyond which a reading is refused.
const GATE: u8 = 5;
/// Standard deviations at the start \[chosen\]: of the rate of twist, as an error of the wheel speed, rad/s; of the shaft torque beside
/// the fraction
/// `b`, and of the load about the shaft torque, each as a fraction and beside it, N m: the car may accelerate or brake.
const WHEEL_START_RAD_S: f64 = 0.3;
const SHAFT_START: (f64, f64) = (0.3, 100.0);
const LOAD_START: (f64, f64) = (1.0, 400.0);
/// Time over which the squared innovations are averaged, s, and their mean above which no phase of the shift explains the
/// speeds: five standard deviations that last.
const MISFIT_S: f64 = 0.05;
const MISFIT: f64 = 25.0;
/// Samples in a row with slip in a gear after which an element of the gear slips.
const SLIPS_IN_GEAR: u8 = 3;
/// The same after a shift to a gear whose one-way clutch has not caught the turbine \[chosen\]: half a second of a log at 100 Hz.
const NOT_CAUGHT: u8 = 50;

/// What came since the step before: of each channel the newest reading, or none.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
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
    /// Longitudinal acceleration by an accelerometer, m/s^2, positive forward: with the part of gravity along the road.
    pub acceleration_m_s2: Option<Reading<T>>,
    /// Whether the lock-up clutch of the converter carries torque.
    pub lock_up_applied: bool,
    /// Commands of the valves, in the order of [`GearboxTables::elements`]: current in A, or duty cycle in %.
    pub commands: [Option<Reading<T>>; MAX_ELEMENTS],
    /// The gear, or the shift, that the controller commands, by places in [`GearboxTables::gears`].
    pub gear: ShiftCommand,
}

impl<T: Real> ShiftInput<T> {
    /// The same in another precision.
    pub fn cast<U: Real>(&self) -> ShiftInput<U> {
        let to = |reading: Option<Reading<T>>| reading.map(|reading| reading.cast());
        ShiftInput {
            dt_s: U::of(self.dt_s.to_f64_exact()),
            engine_rad_s: to(self.engine_rad_s),
            turbine_rad_s: to(self.turbine_rad_s),
            output_rad_s: to(self.output_rad_s),
            wheel_rad_s: to(self.wheel_rad_s),
            engine_n_m: to(self.engine_n_m),
            acceleration_m_s2: to(self.acceleration_m_s2),
            lock_up_applied: self.lock_up_applied,
            commands: self.commands.map(to),
            gear: self.gear,
        }
    }
}

/// The filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GearboxFilter<'a, T> {
    /// The gearbox.
    pub tables: GearboxTables<'a, T>,
    /// Differential, drive shafts and wheels.
    pub driveline: Driveline<T>,
    /// Inertia of wheels and car at the wheels, kg m^2.
    pub wheels_kg_m2: T,
    /// The torque at the gearbox input.
    pub turbine: TurbineTorque<T>,
    /// What it does not know beside the elements.
    pub uncertainty: ShiftUncertainty<T>,
    /// How turbine, output and wheel speed are read.
    pub readings: [SpeedReading<T>; 3],
    /// How the engine speed is read.
    pub engine: (SpeedReading<T>, EngineNoise<T>),
    /// How the longitudinal acceleration is read.
    pub acceleration: AccelerationReading<T>,
    /// What counts as a measurement.
    pub limits: InputLimits<T>,
}

/// Memory of an [`GearboxFilter`].
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct GearboxState<T> {
    started: bool,
    elements: [Option<ElementState<T>>; MAX_ELEMENTS],
    /// Whether the piston of an element has a stroke.
    strokes: bool,
    engine: Option<Engine<T>>,
    /// Newest reported engine torque, N m, and its age, s.
    reported: Option<(T, T)>,
    /// The newest readings of turbine, output and wheel.
    newest: [Option<Newest<T>>; SPEEDS],
    noise: ReadingNoise<T>,
    skew: Skew<T>,
    ratios: RatioErrors<T>,
    /// The steps whose readings are late, if the readings are.
    late: Late<T>,
    /// The longitudinal acceleration against the torque, once a reading came.
    by_torque: Option<ByTorque<T>>,
    /// What the filter knew of its readings when it lost its state.
    felt: Option<Felt<T>>,
    /// Whether output or wheel speed have ever been negative: their sensors give a sign.
    has_sign: bool,
    /// Whether a wheel speed ever came: a car without one has not lost it.
    wheel_came: bool,
    running: Option<Running<T>>,
    /// The same where the clutch that holds has begun to slip, until it is known whether it has.
    slipping: Option<Running<T>>,
    /// Whether it has run before and lost its state.
    lost: bool,
    /// Samples in a row in which the gear did not fit the speeds.
    unfit: u8,
    /// Whether an element of the gear has slipped, and no gear has fitted since.
    slips: bool,
    /// Whether an element that is engaged in both gears of the shift may slip by the bounds of the errors.
    held_may_slip: bool,
    /// Without a converter: whether the clutch of the gear was open, or the car slow, and no gear has fitted since.
    launches: bool,
    /// The gears of the newest step, and since when they have been these, s.
    gears: (ShiftCommand, T),
    learnt: Learnt<T>,
    evidence: Evidence<T>,
    /// Time since what is learnt was last let fade, s.
    fading_s: T,
    estimate: ShiftEstimate<T>,
}

/// The filter at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Running<T> {
    x: Gaussian<T>,
    /// The gear, while there is no shift.
    gear: Gear,
    /// The shift.
    shift: Option<ShiftRow<T>>,
    phase: PhaseMemory<T>,
    /// The torques at the last step; none after a change of the shift, of which the one before had others.
    torques: Option<Torques<T>>,
    /// Turbine torque, low-passed, N m.
    slow_n_m: T,
    motion: Option<Motion<T>>,
    /// Rates of turbine, output and wheel speed, rad/s^2.
    rates: [T; SPEEDS],
    /// Mean and variance of the errors of both pressures before the newest readings.
    pressures_before: [[T; 2]; 2],
    gates: [Gate; SPEEDS],
    /// Time since a reading was taken, s; of the wheel speed since one came.
    silent_s: [T; SPEEDS],
    /// By how much the wheel speed is above that of the output, low-passed, rad/s.
    wheel_off_rad_s: T,
    /// Mean squared innovation of turbine and output speed.
    misfit: T,
    /// What was known of the lasting states when the shift began; none if it cannot be learnt from.
    before: Option<Known<T>>,
    /// The converter's maps against the reported engine torque, in this gear.
    compared: Compared<T>,
    /// The readings of the longitudinal acceleration, once one came.
    felt: Option<Felt<T>>,
}

impl<T: Real> GearboxFilter<'_, T> {
    /// The same filter in another precision, with the same tables in that precision.
    pub fn cast<'a, U: Real>(&self, tables: GearboxTables<'a, U>) -> GearboxFilter<'a, U> {
        GearboxFilter {
            tables,
            driveline: self.driveline.cast(),
            wheels_kg_m2: U::of(self.wheels_kg_m2.to_f64_exact()),
            turbine: self.turbine.cast(),
            uncertainty: self.uncertainty.cast(),
            readings: self.readings.map(|reading| reading.cast()),
            engine: (self.engine.0.cast(), self.engine.1.cast()),
            acceleration: self.acceleration.cast(),
            limits: self.limits.cast(),
        }
    }

    /// Its memory before the first step, with nothing learnt.
    pub fn start(&self) -> GearboxState<T> {
        self.go_on_with(&Learnt::nothing(&self.correlations()))
    }

    /// Its memory before the first step of a new drive, with what was learnt in another one. That may have been another car, or a
    /// bad log: it is believed with even odds, until shifts of this drive have shown it.
    pub fn start_with(&self, learnt: &Learnt<T>) -> GearboxState<T> {
        self.go_on_with(&learnt.doubted(&self.correlations()))
    }

    /// Its memory before the next step of the same drive, with what was learnt in it.
    pub fn go_on_with(&self, learnt: &Learnt<T>) -> GearboxState<T> {
        let mut elements = [None; MAX_ELEMENTS];
        for (state, element) in elements.iter_mut().zip(self.tables.elements) {
            *state = Some(ElementState::new(element));
        }
        self.take_timing(&mut elements, learnt);
        GearboxState {
            started: false,
            elements,
            strokes: self.tables.elements.iter().any(|element| element.piston.is_some()),
            engine: None,
            reported: None,
            newest: [None; SPEEDS],
            noise: ReadingNoise::stated(),
            skew: Skew::nothing(),
            ratios: RatioErrors::nothing(self.lag_variances()),
            late: Late::nothing(),
            by_torque: None,
            felt: None,
            has_sign: false,
            wheel_came: false,
            running: None,
            slipping: None,
            lost: false,
            unfit: 0,
            slips: false,
            held_may_slip: false,
            launches: false,
            gears: (ShiftCommand::NEUTRAL, T::zero()),
            learnt: *learnt,
            evidence: Evidence::nothing(),
            fading_s: T::zero(),
            estimate: ShiftEstimate::nothing(),
        }
    }

    /// Takes what came since the step before and returns the estimate for now. Never panics; allocates nothing.
    pub fn step(&self, state: &mut GearboxState<T>, input: &ShiftInput<T>) -> ShiftEstimate<T> {
        let signed = self.with_signs(state, input);
        let input = signed.as_ref().unwrap_or(input);
        match state.skew.delays_s() {
            Some(delays_s) => self.later_by(delays_s).step_stated(state, input),
            None => self.step_stated(state, input),
        }
    }

    /// The step with readings as late as is stated.
    fn step_stated(&self, state: &mut GearboxState<T>, input: &ShiftInput<T>) -> ShiftEstimate<T> {
        match self.longest_delay_s() {
            Some(longest_s) => self.step_late(state, input, longest_s),
            None => {
                // A delay that was found is none any more: the steps that wait have all readings that they will get.
                if state.late.waits() {
                    self.pass_waiting(state, -T::one());
                }
                self.step_on_time(state, input)
            }
        }
    }

    /// The step with the noise of the readings as it was found.
    fn step_on_time(&self, state: &mut GearboxState<T>, input: &ShiftInput<T>) -> ShiftEstimate<T> {
        let estimate = match self.noisier(&state.noise) {
            Some(noisier) => noisier.step_as_is(state, input),
            None => self.step_as_is(state, input),
        };
        self.take_noise(state, input);
        estimate
    }

    /// The step with the noise of the readings as it stands in the filter.
    fn step_as_is(&self, state: &mut GearboxState<T>, input: &ShiftInput<T>) -> ShiftEstimate<T> {
        let dt_s = if state.started { input.dt_s } else { T::zero() };
        if !(dt_s >= T::zero() && dt_s.is_finite()) {
            self.reject_time(state);
            return state.estimate;
        }
        state.started = true;
        // All that fades has done so, and larger numbers have no square in single precision.
        let dt_s = dt_s.at_most(T::of(LONGEST_S));
        let of_one_time = state.skew.taken_off(input, &state.newest, self.uncertainty.output_least_rad_s);
        let input = of_one_time.as_ref().unwrap_or(input);
        let at_ratios = self.at_ratios(state, input);
        let input = at_ratios.as_ref().unwrap_or(input);
        if dt_s > T::of(LOST_S) {
            // Too long to be predicted.
            state.lose();
        }
        state.fading_s = state.fading_s + dt_s;
        let since_s = if state.gears.0 == input.gear { state.gears.1 + dt_s } else { T::zero() };
        // After a change of mind the offgoing clutch has not held the gear before: a shift that is withdrawn, or goes to another gear, begins nothing.
        let before = state.gears.0;
        let is_withdrawn = input.gear.from == before.to && input.gear.to == before.from;
        let goes_on = !before.is_steady() && (is_withdrawn || input.gear.from == before.from) && dt_s <= T::of(LOST_S);
        if before != input.gear && !input.gear.is_steady() && !goes_on {
            state.elements.iter_mut().flatten().for_each(ElementState::begin_shift);
        }
        state.gears = (input.gear, since_s);
        let mut health = Health::Good;
        let mut channels = Channels::all(ChannelHealth::Absent);
        // Each element has a command of its own.
        channels.offgoing_command = ChannelHealth::Unused;
        self.take_fills(state);
        let commands = self.pass_elements(state, input, dt_s);
        channels.command = self.of_commands(&commands, &state.elements, input.gear);
        channels.engine_torque = self.take_reported(state, input, dt_s);
        channels.engine = self.take_engine(state, input, dt_s);
        channels.acceleration = self.judge_acceleration(state, input, dt_s);
        self.take_newest(state, input, dt_s, &mut channels);
        self.take_skew(state, input, dt_s);
        self.take_ratio(state, input, dt_s);
        health = health.max(self.take_gear(state, input.gear, dt_s));
        let side = self.input_side(state, input, dt_s);
        let torque = side.as_ref().and_then(|side| self.turbine.at(side));
        let input_clutch = side.as_ref().and_then(|side| self.input_clutch(state, input, side));
        let at_turbine = torque.as_ref().and_then(|torque| self.at_turbine(state, input.gear, torque));
        let acceleration = self.acceleration(state, input, channels.acceleration);
        if let Some(running) = &mut state.running {
            running.compared.step(&self.turbine, side.as_ref().filter(|_| running.shift.is_none()), dt_s);
            match &torque {
                Some(torque) => {
                    let moment = Moment {
                        elements: &state.elements,
                        newest: &state.newest,
                        torque,
                        same_s: state.engine.and_then(|engine| engine.same_error_s()),
                        input,
                        acceleration,
                        channels,
                        dt_s,
                    };
                    [channels.turbine, channels.output, channels.wheel, channels.acceleration] =
                        self.go_on(running, &mut state.slipping, &moment);
                }
                None => state.lose(),
            }
        }
        health = health.max(self.settle(state, input, torque.as_ref()));
        self.follow_held(state, input.gear, torque.as_ref());
        let turbine_n_m = torque.map(|torque| torque.turbine_n_m);
        self.conclude(state, input, (&channels, &commands), health, turbine_n_m);
        state.estimate.input_clutch = input_clutch.filter(|clutch| clutch.torque_n_m.is_finite());
        state.estimate.at_turbine = at_turbine;
        self.follow_commands(state, dt_s);
        state.estimate
    }

    fn reject_time(&self, state: &mut GearboxState<T>) {
        state.lose();
        state.newest = [None; SPEEDS];
        state.noise.pause();
        state.skew.pause();
        state.ratios.pause();
        state.engine = None;
        state.reported = None;
        if let Some(by_torque) = &mut state.by_torque {
            by_torque.pause();
        }
        for (memory, element) in state.elements.iter_mut().zip(self.tables.elements) {
            if let Some(memory) = memory {
                memory.forget(element);
            }
        }
        for clutch in state.estimate.clutches.iter_mut().flatten() {
            (clutch.pressure_range_pa, clutch.torque_range_n_m) = (None, None);
        }
        (state.estimate.input_clutch, state.estimate.at_turbine) = (None, None);
        state.estimate.health = Health::TimeRejected;
        state.estimate.channels = Channels::all(ChannelHealth::Refused);
        state.estimate.commands = [ChannelHealth::Refused; MAX_ELEMENTS];
    }

    /// Follows the shift command.
    fn take_gear(&self, state: &mut GearboxState<T>, command: ShiftCommand, dt_s: T) -> Health {
        let opens = self.is_open(state, command);
        let has_wheels = state.newest[WHEEL].is_some_and(|newest| newest.age_s <= T::of(LOST_S));
        let evidence = (Some(&mut state.evidence).filter(|_| dt_s <= T::of(FINE_S)), has_wheels);
        let (learnt, fading_s, elements) = (&mut state.learnt, &mut state.fading_s, &mut state.elements);
        let Some(running) = &mut state.running else { return Health::Good };
        let in_gear = command.is_steady();
        match running.shift {
            None if in_gear && command.to == running.gear => Health::Good,
            Some(shift) if !in_gear && shift.command() == command => Health::Good,
            Some(shift) if in_gear && [shift.command().from, shift.command().to].contains(&command.to) => {
                // The command may say so before the clutch holds.
                let ends = if command.to == shift.command().to {
                    ShiftPhase::OncomingHolds
                } else {
                    ShiftPhase::OffgoingHolds
                };
                if running.phase.phase == ends {
                    self.end_shift(running, command.to, (learnt, evidence));
                }
                Health::Good
            }
            _ => match self.tables.commanded(command) {
                Some(shift) => {
                    let speeds = self.measured(&state.newest, Some(running));
                    let slips = shift.clutches.map(|clutch| self.slip(clutch.ratio, speeds));
                    learnt.pass(core::mem::replace(fading_s, T::zero()), &self.correlations());
                    self.begin_shift(running, *shift, slips, learnt);
                    self.take_timing(elements, learnt);
                    running.x.timing = Timing::nothing(self.taken_off(elements, shift));
                    Health::Good
                }
                None => {
                    // No equations for this change: the valve models alone, until a gear fits.
                    state.lose();
                    state.lost = false;
                    match (opens, self.is_at_turbine(command)) {
                        (true, _) => Health::ClutchOpen,
                        (_, true) => Health::Good,
                        _ if in_gear => Health::SpeedsRejected,
                        _ => Health::ShiftNotModelled,
                    }
                }
            },
        }
    }
}

fn square<T: Real>(x: T) -> T {
    x * x
}

/// The pieces in which a time step is predicted, and the length of one, s.
fn pieces<T: Real>(dt_s: T) -> (usize, T) {
    if dt_s <= T::of(PIECE_S) {
        return (1, dt_s);
    }
    let pieces = (dt_s / T::of(PIECE_S)).ceil().whole().clamp(1, MAX_PIECES);
    (pieces, dt_s / T::of(pieces as f64))
}

/// A standard deviation as a fraction of a value and beside it.
fn at_start<T: Real>((fraction, beside): (f64, f64), value: T) -> T {
    T::of(fraction) * value.abs() + T::of(beside)
}

impl<T: Real> GearboxState<T> {
    /// What was learnt up to now.
    pub fn learnt(&self) -> &Learnt<T> {
        &self.learnt
    }

    /// By how much the readings of turbine, output and wheel speed have shown to be late against the earlier one of turbine and output, beyond
    /// what is stated, s; they are taken to be so.
    pub fn speeds_late_s(&self) -> [T; 3] {
        self.skew.late_s()
    }

    /// By how much the readings of the longitudinal acceleration have shown to be late beyond what is stated, s, with its standard deviation;
    /// they are taken to be so. `None` if none was taken.
    pub fn acceleration_late_s(&self) -> Option<[T; 2]> {
        let felt = self.running.as_ref().and_then(|running| running.felt).or(self.felt)?;
        let [late_s, variance] = felt.late;
        Some([late_s, variance.sqrt()])
    }

    /// Whether it can be the memory of the filter of a gearbox with these tables.
    pub fn fits(&self, tables: &GearboxTables<'_, T>) -> bool {
        self.elements.iter().flatten().count() == tables.elements.len()
    }

    /// Takes a reading of the oil's temperature, degC: what depends on it is forgotten with its changes, from the next shift on. A car
    /// without this sensor leaves it out, and time alone makes forget.
    pub fn take_oil_temperature(&mut self, degc: T) {
        self.fading_s = self.fading_s + self.learnt.take_oil(degc);
    }

    /// Ends the filter. What a shift has shown up to then is not learnt: it is not known what went wrong.
    fn lose(&mut self) {
        let running = self.running.take();
        self.felt = running.as_ref().and_then(|running| running.felt).or(self.felt);
        self.lost = self.lost || running.is_some();
        self.slipping = None;
    }
}
