//! Steps within one set of contacts, and the events between them.

use super::contacts::Contacts;
use super::model::{CarInputs, CarModel, CarState, CarTorques, MAX_PACKS, Part, STATES, STATES_WITH_STROKE};
use crate::gear_train::{MAX_ELEMENTS, TrainError};
use crate::hybrid::root;
use crate::rosenbrock::{self, SHORTEST_STEP_S, StepSize, Tolerance, Trial};
use crate::{Contact, Direction};

/// Relative tolerance of a step, against the size of each state.
const RELATIVE_TOLERANCE: f64 = 2e-6;
/// Margins may fall this far below zero before the contacts change, so that rounding does not start another change.
const SLACK: f64 = 1e-9;
/// The same for torques, as a share of the torque that an element can hold.
const TORQUE_SLACK: f64 = 1e-8;
/// A pressure counts as this much per Pa among the margins.
const PER_PA: f64 = 1e-5;
/// Times closer than this are the same, s.
const SAME_INSTANT_S: f64 = 1e-12;
/// Changes of contact at one instant before the car is declared inconsistent.
const MOST_CHANGES: usize = 32;

/// Why a car could not be simulated on.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CarError {
    /// The gearbox cannot be simulated.
    #[error(transparent)]
    Train(#[from] TrainError),
    /// The step size fell below its floor or a state became infinite.
    #[error("the simulation diverged at {time_s:.4} s; check inertias, stiffnesses and time constants")]
    Diverged {
        /// When.
        time_s: f64,
    },
    /// The elements found no consistent contact.
    #[error("the elements change endlessly between sticking and slipping at {time_s:.4} s")]
    Chatter {
        /// When.
        time_s: f64,
    },
    /// The car cannot do what was asked of it.
    #[error("{0}")]
    Request(String),
}

/// Lengths to which a margin is evaluated: contact of each element, then its pressure.
type Margins = [f64; 2 * MAX_ELEMENTS];

/// One accepted step, for recording.
#[derive(Debug)]
pub struct CarStep<'a> {
    /// Time at the start, s.
    pub start_s: f64,
    /// Time at the end, s.
    pub end_s: f64,
    /// The contacts throughout.
    pub contacts: &'a Contacts,
    /// The inputs throughout.
    pub inputs: &'a CarInputs,
    trial: &'a dyn DenseOutput,
}

/// The state anywhere within a step.
trait DenseOutput: std::fmt::Debug {
    /// State at this fraction of the step.
    fn state_at(&self, theta: f64) -> CarState;
}

impl<const N: usize> DenseOutput for Trial<N, CarTorques> {
    fn state_at(&self, theta: f64) -> CarState {
        CarState::from_array(&self.at(theta))
    }
}

impl CarStep<'_> {
    /// State at a time within the step.
    pub fn at(&self, time_s: f64) -> CarState {
        self.trial.state_at((time_s - self.start_s) / (self.end_s - self.start_s))
    }
}

/// Time, state and contacts of the car, and how to carry them on.
#[derive(Debug, Clone)]
pub struct CarIntegrator {
    /// Time, s.
    pub time_s: f64,
    /// Continuous state.
    pub state: CarState,
    /// Which elements stick.
    pub contacts: Contacts,
    step_size: StepSize,
    relative_tolerance: f64,
}

impl CarIntegrator {
    /// Starts at this time and state. Elements without slip stick if they can hold.
    ///
    /// # Errors
    /// A number is not finite, or too many elements have no slip.
    pub fn new(model: &CarModel, time_s: f64, state: CarState, inputs: &CarInputs) -> Result<Self, CarError> {
        if !state.is_finite() {
            return Err(TrainError::NotFinite.into());
        }
        let (contacts, state) = Contacts::settle(model, &[None; MAX_ELEMENTS], None, &state, inputs)?;
        Ok(Self { time_s, state, contacts, step_size: StepSize::FIRST, relative_tolerance: RELATIVE_TOLERANCE })
    }

    /// The same with another relative tolerance of a step.
    #[must_use]
    pub fn with_tolerance(mut self, relative: f64) -> Self {
        self.relative_tolerance = relative;
        self
    }

    /// Integrates to `until_s` under constant inputs and shows every accepted step to `record`.
    ///
    /// # Errors
    /// Divergence or chatter, see [`CarError`].
    pub fn advance(
        &mut self,
        model: &CarModel,
        inputs: &CarInputs,
        until_s: f64,
        record: &mut impl FnMut(&CarStep<'_>),
    ) -> Result<(), CarError> {
        self.resettle(model, inputs)?;
        // The oil in the cylinders is integrated only where it matters.
        if model.has_stroke() {
            self.advance_states::<STATES_WITH_STROKE, { 1 + MAX_PACKS }>(model, inputs, until_s, record)
        } else {
            self.advance_states::<STATES, 1>(model, inputs, until_s, record)
        }
    }

    /// As [`Self::advance`], for the first `N` states with this number of stiff rows.
    fn advance_states<const N: usize, const ROWS: usize>(
        &mut self,
        model: &CarModel,
        inputs: &CarInputs,
        until_s: f64,
        record: &mut impl FnMut(&CarStep<'_>),
    ) -> Result<(), CarError> {
        let mut slope = model.rates::<N>(&self.contacts, &self.state.to_array(), inputs);
        let mut changes = 0;
        while until_s - self.time_s > SAME_INSTANT_S {
            let mut size = self.step_size;
            let accepted = size.accepted(until_s - self.time_s, |h| self.trial::<N, ROWS>(model, inputs, &slope, h));
            self.step_size = size;
            let (step_s, trial) = accepted.ok_or(CarError::Diverged { time_s: self.time_s })?;
            let Some((theta, element)) = self.first_event(model, inputs, &trial) else {
                self.take(&trial, step_s, inputs, record);
                slope = (trial.end_slope, trial.end_applied);
                changes = 0;
                continue;
            };
            // Repeat the step up to the event, so that its state has the accuracy of a step and not of the interpolant.
            let to_event = self.trial::<N, ROWS>(model, inputs, &slope, theta * step_s);
            changes = if theta * step_s > SHORTEST_STEP_S { 1 } else { changes + 1 };
            if changes > MOST_CHANGES {
                return Err(CarError::Chatter { time_s: self.time_s });
            }
            self.take(&to_event, theta * step_s, inputs, record);
            (self.contacts, self.state) =
                Contacts::settle(model, self.contacts.states(), element, &self.state, inputs)?;
            slope = model.rates(&self.contacts, &self.state.to_array(), inputs);
        }
        self.time_s = until_s;
        Ok(())
    }

    /// Inputs that jump, such as a dog that is put in, change what elements can hold.
    fn resettle(&mut self, model: &CarModel, inputs: &CarInputs) -> Result<(), CarError> {
        let changed = (0..model.parts.len()).any(|element| match model.parts[element] {
            Part::Dog | Part::LockUp => {
                let holds = model.holding_limits(element, &self.state, inputs).is_some();
                holds != self.contacts.of(element).is_some()
            }
            _ => false,
        });
        if changed {
            (self.contacts, self.state) = Contacts::settle(model, self.contacts.states(), None, &self.state, inputs)?;
        }
        Ok(())
    }

    fn take<const N: usize>(
        &mut self,
        trial: &Trial<N, CarTorques>,
        step_s: f64,
        inputs: &CarInputs,
        record: &mut impl FnMut(&CarStep<'_>),
    ) {
        let end_s = self.time_s + step_s;
        record(&CarStep { start_s: self.time_s, end_s, contacts: &self.contacts, inputs, trial });
        self.time_s = end_s;
        self.state = CarState::from_array(&trial.end);
    }

    #[inline]
    fn trial<const N: usize, const ROWS: usize>(
        &self,
        model: &CarModel,
        inputs: &CarInputs,
        (slope, applied): &([f64; N], CarTorques),
        step_s: f64,
    ) -> Trial<N, CarTorques> {
        let f = |x: &[f64; N]| model.rates(&self.contacts, x, inputs).0;
        let at_end = |x: &[f64; N]| model.rates(&self.contacts, x, inputs);
        let rows: [_; ROWS] = model.stiff_rows(&self.state, applied.tyre_n, inputs);
        let tolerance = Tolerance { relative: self.relative_tolerance, scale: CarState::scale() };
        rosenbrock::step(&f, &at_end, &self.state.to_array(), slope, &rows, step_s, &tolerance)
    }

    /// Fraction of the step at which the first margin reaches zero, located on the dense output, and the element that has
    /// no slip there.
    fn first_event<const N: usize>(
        &self,
        model: &CarModel,
        inputs: &CarInputs,
        trial: &Trial<N, CarTorques>,
    ) -> Option<(f64, Option<usize>)> {
        let end = CarState::from_array(&trial.end);
        let at_end = self.margins(model, inputs, &end, &trial.end_applied);
        let used_up = (0..2 * MAX_ELEMENTS).filter(|&at| at_end[at] < 0.0);
        let crossing = |at: usize| {
            let margin = |theta: f64| {
                let state = CarState::from_array(&trial.at(theta));
                let applied = model.applied(&self.contacts, &state, inputs);
                self.margins(model, inputs, &state, &applied)[at]
            };
            (root(margin), at)
        };
        let (theta, at) = used_up.map(crossing).min_by(|a, b| a.0.total_cmp(&b.0))?;
        let slides = at < MAX_ELEMENTS && matches!(self.contacts.of(at), Some(Contact::Slipping(_)));
        Some((theta, slides.then_some(at)))
    }

    /// How far each element is from a change: slip in its direction, rad/s, or what it could hold beyond what it does, N m;
    /// then the pressure from the kiss point. Negative is beyond.
    #[inline]
    fn margins(&self, model: &CarModel, inputs: &CarInputs, x: &CarState, applied: &CarTorques) -> Margins {
        let mut margins = [f64::INFINITY; 2 * MAX_ELEMENTS];
        for &element in self.contacts.sliding() {
            if let Some(Contact::Slipping(direction)) = self.contacts.of(element)
                && !self.contacts.is_kept(element)
            {
                margins[element] = Direction::sign(direction) * model.slip(x, element) + SLACK;
            }
            if let Part::Friction(slot, clutch) = &model.parts[element] {
                let beyond_kiss_pa = CarModel::plates_pa(*slot, clutch, x) - clutch.clutch.kiss_pressure();
                let sign = if self.contacts.of(element).is_some() { 1.0 } else { -1.0 };
                margins[MAX_ELEMENTS + element] = sign * PER_PA * beyond_kiss_pa + SLACK;
            }
        }
        let held = self.contacts.holding_n_m(&model.ends_n_m(applied), &applied.elements_n_m);
        for &element in self.contacts.stuck() {
            let (lower, upper) = model.holding_limits(element, x, inputs).unwrap_or((0.0, 0.0));
            // The contact solver counts in shares of the limits.
            let slack = |limit: f64| TORQUE_SLACK * (1.0 + limit.abs());
            margins[element] = (upper - held[element] + slack(upper)).min(held[element] - lower + slack(lower));
        }
        margins
    }
}
