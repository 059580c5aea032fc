//! Steps within one set of contacts, and the events between them.

use super::contacts::Contacts;
use super::model::{
    Acting, CarInputs, CarModel, CarState, CarTorques, MAX_PACKS, Part, SMALL_FREEDOMS, SMALL_PACKS, STATES,
    STATES_WITH_STROKE, states,
};
use crate::gear_train::{MAX_ELEMENTS, MAX_FREEDOMS, TrainError};
use crate::hybrid::root;
use crate::rosenbrock::{self, SHORTEST_STEP_S, StepSize, Tolerance, Trial};
use crate::{Contact, Direction};

/// Relative tolerance of a step, against the size of each state.
const RELATIVE_TOLERANCE: f64 = 2e-6;
/// Margins may fall this far below zero before the contacts change, so that rounding does not start another change.
const SLACK: f64 = 1e-9;
/// The same for torques, as a fraction of the torque that an element can hold.
const TORQUE_SLACK: f64 = 1e-8;
/// A pressure counts as this much per Pa among the margins.
const PER_PA: f64 = 1e-5;
/// Times closer than this are the same, s.
const SAME_INSTANT_S: f64 = 1e-12;
/// Changes of contact at one instant before the car is declared inconsistent.
const MAX_CHANGES: usize = 32;

/// Why a car could not be simulated on.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CarError {
    /// The gearbox cannot be simulated.
    #[error(transparent)]
    Train(#[from] TrainError),
    /// The step size fell below its floor or a state became infinite.
    #[error(
        "the simulation diverged at {time_s:.4} s\nhint: check inertias, stiffnesses and time constants of vehicle and gearbox file"
    )]
    Diverged {
        /// When.
        time_s: f64,
    },
    /// The elements found no consistent contact.
    #[error(
        "the elements change endlessly between sticking and slipping at {time_s:.4} s\nhint: check inertias and friction of the elements"
    )]
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

/// A step of a gearbox with `F` degrees of freedom and `P` friction elements.
#[derive(Debug)]
struct Step<'t, const N: usize, const F: usize, const P: usize>(&'t Trial<N, CarTorques>);

impl<const N: usize, const F: usize, const P: usize> DenseOutput for Step<'_, N, F, P> {
    fn state_at(&self, theta: f64) -> CarState {
        CarState::from_array::<N, F, P>(&self.0.at(theta))
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
    time_s: f64,
    state: CarState,
    contacts: Contacts,
    step_size: StepSize,
    relative_tolerance: f64,
    /// The right-hand side at the state, found at the end of the last step, and the inputs under which it holds.
    known: Option<(CarInputs, Rates<STATES_WITH_STROKE>)>,
    /// Torque of each dog that is to come out and is still held by its load, N m; zero of the others.
    held_dogs_n_m: [f64; MAX_ELEMENTS],
}

/// The right-hand side at one state: derivative, and the torques that make it but for those of the sticking elements.
type Rates<const N: usize> = ([f64; N], CarTorques);

/// The first `M` of `N` numbers; those beyond are zero.
fn resized<const N: usize, const M: usize>(x: &[f64; N]) -> [f64; M] {
    std::array::from_fn(|i| if i < N { x[i] } else { 0.0 })
}

impl CarIntegrator {
    /// Time, s.
    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    /// Continuous state.
    pub fn state(&self) -> &CarState {
        &self.state
    }

    /// Which elements stick.
    pub fn contacts(&self) -> &Contacts {
        &self.contacts
    }

    /// Starts at this time and state. Elements without slip stick if they can hold.
    ///
    /// # Errors
    /// A number is not finite, or too many elements have no slip.
    pub fn new(model: &CarModel, time_s: f64, state: CarState, inputs: &CarInputs) -> Result<Self, CarError> {
        if !state.is_finite() {
            return Err(TrainError::NotFinite.into());
        }
        let (contacts, state) = Contacts::settle(model, &[None; MAX_ELEMENTS], None, &state, inputs)?;
        let (step_size, relative_tolerance) = (StepSize::FIRST, RELATIVE_TOLERANCE);
        Ok(Self {
            time_s,
            state,
            contacts,
            step_size,
            relative_tolerance,
            known: None,
            held_dogs_n_m: [0.0; MAX_ELEMENTS],
        })
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
        record: &mut dyn FnMut(&CarStep<'_>),
    ) -> Result<(), CarError> {
        let inputs = &self.with_loaded_dogs(model, inputs);
        self.resettle(model, inputs)?;
        const F: usize = SMALL_FREEDOMS;
        const P: usize = SMALL_PACKS;
        const N: usize = states(F, P);
        // The oil in the cylinders is integrated only where it matters, and a small gearbox without the room of a large one.
        match (model.is_small(), model.has_stroke()) {
            (true, false) => self.advance_states::<N, F, P, 1>(model, inputs, until_s, record),
            (true, true) => self.advance_states::<{ N + P }, F, P, { 1 + P }>(model, inputs, until_s, record),
            (false, false) => self.advance_states::<STATES, MAX_FREEDOMS, MAX_PACKS, 1>(model, inputs, until_s, record),
            (false, true) => self.advance_states::<STATES_WITH_STROKE, MAX_FREEDOMS, MAX_PACKS, { 1 + MAX_PACKS }>(
                model, inputs, until_s, record,
            ),
        }
    }

    /// As [`Self::advance`], for the `N` states of a gearbox with `F` degrees of freedom and `P` friction elements, with this number of stiff
    /// rows.
    fn advance_states<const N: usize, const F: usize, const P: usize, const ROWS: usize>(
        &mut self,
        model: &CarModel,
        inputs: &CarInputs,
        until_s: f64,
        record: &mut dyn FnMut(&CarStep<'_>),
    ) -> Result<(), CarError> {
        let acting = model.acting(inputs);
        let mut rates: Rates<N> = match self.known.take() {
            Some((same, (slope, applied))) if same == *inputs => (resized(&slope), applied),
            _ => model.rates::<N, F, P>(&self.contacts, &self.state.to_array::<N, F, P>(), &acting),
        };
        let mut changes = 0;
        while until_s - self.time_s > SAME_INSTANT_S {
            let mut size = self.step_size;
            let accepted =
                size.accepted(until_s - self.time_s, |h| self.trial::<N, F, P, ROWS>(model, &acting, &rates, h));
            self.step_size = size;
            // Looked at where it is: a trial is large, and a copy costs as much as a stage.
            let Some((step_s, trial)) = &accepted else { return Err(CarError::Diverged { time_s: self.time_s }) };
            let Some((theta, element)) = self.first_event::<N, F, P>(model, &acting, trial) else {
                self.take::<N, F, P>(trial, *step_s, inputs, record);
                rates = (trial.end_slope, trial.end_applied);
                changes = 0;
                continue;
            };
            // Repeat the step up to the event, so that its state has the accuracy of a step and not of the interpolant.
            let to_event = self.trial::<N, F, P, ROWS>(model, &acting, &rates, theta * step_s);
            changes = if theta * step_s > SHORTEST_STEP_S { 1 } else { changes + 1 };
            if changes > MAX_CHANGES {
                return Err(CarError::Chatter { time_s: self.time_s });
            }
            self.take::<N, F, P>(&to_event, theta * step_s, inputs, record);
            (self.contacts, self.state) =
                Contacts::settle(model, self.contacts.states(), element, &self.state, inputs)?;
            rates = model.rates::<N, F, P>(&self.contacts, &self.state.to_array::<N, F, P>(), &acting);
        }
        self.time_s = until_s;
        self.known = Some((*inputs, (resized(&rates.0), rates.1)));
        Ok(())
    }

    /// A dog cannot be taken out under load: these inputs with the dogs that stay in until their torque is small or has changed its sign.
    fn with_loaded_dogs(&mut self, model: &CarModel, inputs: &CarInputs) -> CarInputs {
        let loaded_from_n_m: [Option<f64>; MAX_ELEMENTS] =
            std::array::from_fn(|element| match model.parts.get(element) {
                Some(Part::Dog(limit_n_m))
                    if !inputs.dogs[element] && self.contacts.of(element) == Some(Contact::Stuck) =>
                {
                    Some(*limit_n_m)
                }
                _ => None,
            });
        let mut loaded = *inputs;
        if loaded_from_n_m.iter().flatten().all(|limit| limit.is_infinite()) {
            self.held_dogs_n_m = [0.0; MAX_ELEMENTS];
            return loaded;
        }
        let held_n_m = self.held_n_m(model, &model.applied(&self.contacts, &self.state, &model.acting(inputs)));
        for (element, limit_n_m) in loaded_from_n_m.into_iter().enumerate() {
            let (before, held) = (self.held_dogs_n_m[element], held_n_m[element]);
            let stays = limit_n_m.is_some_and(|limit_n_m| held.abs() > limit_n_m) && held * before >= 0.0;
            self.held_dogs_n_m[element] = if stays { held } else { 0.0 };
            loaded.dogs[element] |= stays;
        }
        loaded
    }

    /// Inputs that jump, such as a dog that is put in, change what elements can hold.
    fn resettle(&mut self, model: &CarModel, inputs: &CarInputs) -> Result<(), CarError> {
        let changed = (0..model.parts.len()).any(|element| match model.parts[element] {
            Part::Dog(_) | Part::LockUp => {
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

    fn take<const N: usize, const F: usize, const P: usize>(
        &mut self,
        trial: &Trial<N, CarTorques>,
        step_s: f64,
        inputs: &CarInputs,
        record: &mut dyn FnMut(&CarStep<'_>),
    ) {
        let end_s = self.time_s + step_s;
        record(&CarStep {
            start_s: self.time_s,
            end_s,
            contacts: &self.contacts,
            inputs,
            trial: &Step::<N, F, P>(trial),
        });
        self.time_s = end_s;
        self.state = CarState::from_array::<N, F, P>(&trial.end);
    }

    #[inline]
    fn trial<const N: usize, const F: usize, const P: usize, const ROWS: usize>(
        &self,
        model: &CarModel,
        acting: &Acting<'_>,
        (slope, applied): &Rates<N>,
        step_s: f64,
    ) -> Trial<N, CarTorques> {
        let f = |x: &[f64; N]| model.slope::<N, F, P>(&self.contacts, x, acting);
        let at_end = |x: &[f64; N]| model.rates::<N, F, P>(&self.contacts, x, acting);
        let rows: [_; ROWS] = model.stiff_rows::<N, F, P, ROWS>(&self.state, applied.tyre_n, acting);
        let tolerance = Tolerance { relative: self.relative_tolerance, scale: CarState::scale::<N, F, P>() };
        rosenbrock::step(&f, &at_end, &self.state.to_array::<N, F, P>(), slope, &rows, step_s, &tolerance)
    }

    /// Fraction of the step at which the first margin reaches zero, located on the dense output, and the element that has
    /// no slip there.
    fn first_event<const N: usize, const F: usize, const P: usize>(
        &self,
        model: &CarModel,
        acting: &Acting<'_>,
        trial: &Trial<N, CarTorques>,
    ) -> Option<(f64, Option<usize>)> {
        let end = CarState::from_array::<N, F, P>(&trial.end);
        let at_end = self.margins(model, acting.inputs, &end, &trial.end_applied);
        let used_up = (0..2 * MAX_ELEMENTS).filter(|&at| at_end[at] < 0.0);
        let margin = |at: usize, x: &CarState| match at.checked_sub(MAX_ELEMENTS) {
            Some(element) => self.kiss_margin(model, x, element),
            None if self.contacts.of(at) == Some(Contact::Stuck) => {
                let held = self.held_n_m(model, &model.applied(&self.contacts, x, acting));
                holding_margin(model, acting.inputs, x, at, held[at])
            }
            None => self.slip_margin(model, x, at),
        };
        let crossing = |at: usize| (root(|theta| margin(at, &CarState::from_array::<N, F, P>(&trial.at(theta)))), at);
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
            margins[element] = self.slip_margin(model, x, element);
            margins[MAX_ELEMENTS + element] = self.kiss_margin(model, x, element);
        }
        let held = self.held_n_m(model, applied);
        for &element in self.contacts.stuck() {
            margins[element] = holding_margin(model, inputs, x, element, held[element]);
        }
        margins
    }

    /// Slip of an element that slips, in its direction, rad/s.
    #[inline]
    fn slip_margin(&self, model: &CarModel, x: &CarState, element: usize) -> f64 {
        match self.contacts.of(element) {
            Some(Contact::Slipping(direction)) if !self.contacts.is_kept(element) => {
                Direction::sign(direction) * model.slip(x, element) + SLACK
            }
            _ => f64::INFINITY,
        }
    }

    /// Pressure of a friction element that does not stick from its kiss point, on the side on which it is.
    #[inline]
    fn kiss_margin(&self, model: &CarModel, x: &CarState, element: usize) -> f64 {
        let Part::Friction(slot, clutch) = &model.parts[element] else { return f64::INFINITY };
        let beyond_kiss_pa = CarModel::plates_pa(*slot, clutch, x) - clutch.clutch.kiss_pressure();
        let sign = if self.contacts.of(element).is_some() { 1.0 } else { -1.0 };
        sign * PER_PA * beyond_kiss_pa + SLACK
    }

    /// Torque of each sticking element under these torques of the others, N m.
    #[inline]
    fn held_n_m(&self, model: &CarModel, applied: &CarTorques) -> [f64; MAX_ELEMENTS] {
        self.contacts.holding_n_m(&model.ends_n_m(applied), &applied.elements_n_m)
    }
}

/// What a sticking element could hold beyond what it does, N m.
#[inline]
pub(super) fn holding_margin(model: &CarModel, inputs: &CarInputs, x: &CarState, element: usize, held_n_m: f64) -> f64 {
    let (lower, upper) = model.holding_limits(element, x, inputs).unwrap_or((0.0, 0.0));
    // The contact solver counts in fractions of the limits.
    let slack = |limit: f64| TORQUE_SLACK * (1.0 + limit.abs());
    (upper - held_n_m + slack(upper)).min(held_n_m - lower + slack(lower))
}
