//! An instance of the model: which functions may be called when, and what they do, in both versions of the standard.

use alloc::vec::Vec;
use core::ffi::CStr;

use crate::Model;
use crate::log::Log;

/// Success, or the message of an error.
pub(crate) type Done<T = ()> = Result<T, &'static CStr>;

/// What is behind the functions of the standard.
pub(crate) trait Simulated: Sized {
    /// What changes in a simulation.
    type State: Clone;

    /// The model of the files in the folder `resources`, if they are those of the token.
    fn new(resources: &[u8], token: &[u8]) -> Done<Self>;
    /// Begins anew, with the start values.
    fn reset(&mut self) -> Done;
    /// Ends the initialisation: the inputs are those of the start.
    fn start(&mut self) -> Done;
    /// Steps by a positive finite time, s.
    fn step(&mut self, length_s: f64) -> Done;
    /// The variable of this reference, if it is a real one.
    fn real(&self, reference: u32) -> Option<f64>;
    /// Sets an input that is a real number.
    fn set_real(&mut self, reference: u32, value: f64) -> Option<()>;
    /// The variable of this reference, if it is a whole number.
    fn whole(&self, reference: u32) -> Option<i32>;
    /// Sets an input that is a whole number.
    fn set_whole(&mut self, reference: u32, value: i32) -> Option<()>;
    /// What has changed since the beginning.
    fn state(&self) -> Done<Self::State>;
    /// Takes a state of this model.
    fn restore(&mut self, state: &Self::State);
    /// A state as bytes.
    fn serialised(&self, state: &Self::State) -> Done<Vec<u8>>;
    /// A state of these bytes.
    fn deserialised(&self, bytes: &[u8]) -> Done<Self::State>;
}

/// Where an instance is in its life.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    Instantiated,
    Initialising,
    Stepping,
    Terminated,
}

/// A state with the place in the life of its instance.
#[derive(Clone)]
pub(crate) struct State {
    phase: Phase,
    time_s: f64,
    of_model: <Model as Simulated>::State,
}

/// An instance of the model.
pub(crate) struct Instance {
    model: Model,
    phase: Phase,
    /// Time, s.
    pub(crate) time_s: f64,
    pub(crate) log: Log,
}

const NOT_NOW: &CStr =
    c"the function may not be called now: the order is instantiate, enter and exit initialization, steps, terminate";
const NO_VARIABLE: &CStr = c"no such variable, or one of another type";
const NO_INPUT: &CStr = c"no such input, one of another type, or a value out of its range";
const NO_STEP: &CStr = c"time and length of a step must be finite, and the length above zero";
const DAMAGED: &CStr = c"the bytes are no state of this model, or damaged";

impl Instance {
    pub(crate) fn new(resources: &[u8], token: &[u8]) -> Done<Self> {
        let model = Model::new(resources, token)?;
        Ok(Self { model, phase: Phase::Instantiated, time_s: 0.0, log: Log::None })
    }

    fn is_in(&self, phases: &[Phase]) -> Done {
        if phases.contains(&self.phase) { Ok(()) } else { Err(NOT_NOW) }
    }

    /// Sets the time of the start, before the initialisation.
    pub(crate) fn begin_at(&mut self, time_s: f64) -> Done {
        self.is_in(&[Phase::Instantiated])?;
        if !time_s.is_finite() {
            return Err(NO_STEP);
        }
        self.time_s = time_s;
        Ok(())
    }

    pub(crate) fn enter_initialisation(&mut self) -> Done {
        self.is_in(&[Phase::Instantiated])?;
        self.phase = Phase::Initialising;
        Ok(())
    }

    pub(crate) fn exit_initialisation(&mut self) -> Done {
        self.is_in(&[Phase::Initialising])?;
        self.model.start()?;
        self.phase = Phase::Stepping;
        Ok(())
    }

    pub(crate) fn step(&mut self, time_s: f64, length_s: f64) -> Done {
        self.is_in(&[Phase::Stepping])?;
        if !(time_s.is_finite() && length_s.is_finite() && length_s > 0.0) {
            return Err(NO_STEP);
        }
        self.model.step(length_s)?;
        self.time_s = time_s + length_s;
        Ok(())
    }

    pub(crate) fn terminate(&mut self) -> Done {
        self.is_in(&[Phase::Initialising, Phase::Stepping])?;
        self.phase = Phase::Terminated;
        Ok(())
    }

    pub(crate) fn reset(&mut self) -> Done {
        self.model.reset()?;
        self.phase = Phase::Instantiated;
        self.time_s = 0.0;
        Ok(())
    }

    pub(crate) fn real(&self, reference: u32) -> Done<f64> {
        self.model.real(reference).ok_or(NO_VARIABLE)
    }

    pub(crate) fn whole(&self, reference: u32) -> Done<i32> {
        self.model.whole(reference).ok_or(NO_VARIABLE)
    }

    pub(crate) fn set_real(&mut self, reference: u32, value: f64) -> Done {
        self.is_in(&[Phase::Instantiated, Phase::Initialising, Phase::Stepping])?;
        self.model.set_real(reference, value).ok_or(NO_INPUT)
    }

    pub(crate) fn set_whole(&mut self, reference: u32, value: i32) -> Done {
        self.is_in(&[Phase::Instantiated, Phase::Initialising, Phase::Stepping])?;
        self.model.set_whole(reference, value).ok_or(NO_INPUT)
    }

    pub(crate) fn state(&self) -> Done<State> {
        Ok(State { phase: self.phase, time_s: self.time_s, of_model: self.model.state()? })
    }

    pub(crate) fn restore(&mut self, state: &State) {
        self.phase = state.phase;
        self.time_s = state.time_s;
        self.model.restore(&state.of_model);
    }

    pub(crate) fn serialised(&self, state: &State) -> Done<Vec<u8>> {
        let mut bytes = [state.phase as u64, state.time_s.to_bits()].map(u64::to_le_bytes).concat();
        bytes.extend(self.model.serialised(&state.of_model)?);
        Ok(bytes)
    }

    pub(crate) fn deserialised(&self, bytes: &[u8]) -> Done<State> {
        let phases = [Phase::Instantiated, Phase::Initialising, Phase::Stepping, Phase::Terminated];
        let (phase, rest) = bytes.split_first_chunk::<8>().ok_or(DAMAGED)?;
        let (time_s, rest) = rest.split_first_chunk::<8>().ok_or(DAMAGED)?;
        let phase = phases.into_iter().find(|of| *of as u64 == u64::from_le_bytes(*phase)).ok_or(DAMAGED)?;
        let of_model = self.model.deserialised(rest)?;
        Ok(State { phase, time_s: f64::from_le_bytes(*time_s), of_model })
    }
}
