//! Which elements stick, and what follows for accelerations and holding torques.
//!
//! With the torques `s` on engine, input, output and of the elements that do not stick, the motion has the acceleration
//! `sum s_k a_k`, and each sticking element holds `sum s_k h_k`. The columns `a_k` and `h_k` are computed once for each set of
//! sticking elements.

use super::integrate::holding_margin;
use super::model::{CarInputs, CarModel, CarState, Part, end_responses};
use crate::gear_train::{HOLDS_ANY, MAX_ELEMENTS, MAX_FREEDOMS, TrainError};
use crate::{Contact, Direction, MAX_CONTACTS};

/// Torques on engine, input and output come before those of the elements.
const ENDS: usize = 3;

/// What an element does: `None` if it is open.
pub type ContactState = Option<Contact>;

/// Contacts of all elements with the columns that follow from them.
#[derive(Debug, Clone, PartialEq)]
pub struct Contacts {
    states: [ContactState; MAX_ELEMENTS],
    stuck: [usize; MAX_CONTACTS],
    stuck_count: usize,
    sliding: [usize; MAX_ELEMENTS],
    sliding_count: usize,
    /// Those that do not stick and may have a torque: all but open elements without drag.
    driven: [usize; MAX_ELEMENTS],
    driven_count: usize,
    /// Whether what sticks keeps the slip of an element as it is, as that of a one-way clutch beside a brake that holds.
    is_kept: [bool; MAX_ELEMENTS],
    /// `a_k`.
    accelerations: [[f64; MAX_FREEDOMS]; ENDS + MAX_ELEMENTS],
    /// `h_k` of each sticking element: ends, then elements.
    holding: [[f64; ENDS + MAX_ELEMENTS]; MAX_CONTACTS],
}

/// A slip below this is zero, rad/s.
const ZERO_SLIP_RAD_S: f64 = 1e-6;
/// A slip that changes by less than this fraction of what it would without the sticking elements is kept.
const KEPT: f64 = 1e-7;

impl Contacts {
    /// The columns of these contacts.
    ///
    /// # Errors
    /// Too many elements stick.
    pub(super) fn new(model: &CarModel, states: [ContactState; MAX_ELEMENTS]) -> Result<Self, TrainError> {
        let train = &model.train;
        let mut contacts = Self {
            states,
            stuck: [0; MAX_CONTACTS],
            stuck_count: 0,
            sliding: [0; MAX_ELEMENTS],
            sliding_count: 0,
            driven: [0; MAX_ELEMENTS],
            driven_count: 0,
            is_kept: [false; MAX_ELEMENTS],
            accelerations: [[0.0; MAX_FREEDOMS]; ENDS + MAX_ELEMENTS],
            holding: [[0.0; ENDS + MAX_ELEMENTS]; MAX_CONTACTS],
        };
        for (element, state) in states.iter().enumerate().take(model.parts.len()) {
            let (list, count) = match state {
                Some(Contact::Stuck) => (&mut contacts.stuck[..], &mut contacts.stuck_count),
                _ => (&mut contacts.sliding[..], &mut contacts.sliding_count),
            };
            *list.get_mut(*count).ok_or(TrainError::TooLarge)? = element;
            *count += 1;
            let drags = matches!(&model.parts[element], Part::Friction(_, clutch) if clutch.drag_n_m > 0.0);
            if matches!(state, Some(Contact::Slipping(_))) || (state.is_none() && drags) {
                contacts.driven[contacts.driven_count] = element;
                contacts.driven_count += 1;
            }
        }
        let sliding = contacts.sliding().to_vec();
        let ends = end_responses(train).into_iter().enumerate();
        // An element that drives its output side takes as much from its input side.
        let elements = sliding.iter().map(|&element| (ENDS + element, train.responses[element].map(|x| -x)));
        // The largest change of each slip with and without the sticking elements.
        let mut changes = [[0.0_f64; 2]; MAX_ELEMENTS];
        for (source, free) in ends.chain(elements) {
            let (stuck, count) = (contacts.stuck, contacts.stuck_count);
            let stuck = &stuck[..count];
            let problem = train.problem(stuck, |element| (train.slip(&free, element), HOLDS_ANY))?;
            let held = problem.solve(&[]).torques_n_m;
            let mut acceleration = free;
            for (at, (&element, held)) in stuck.iter().zip(held).enumerate() {
                for (x, response) in acceleration.iter_mut().zip(&train.responses[element]) {
                    *x -= held * response;
                }
                contacts.holding[at][source] = held;
            }
            for &element in &sliding {
                let [with, without] = &mut changes[element];
                *with = with.max(train.slip(&acceleration, element).abs());
                *without = without.max(train.slip(&free, element).abs());
            }
            contacts.accelerations[source] = acceleration;
        }
        for (kept, [with, without]) in contacts.is_kept.iter_mut().zip(changes) {
            *kept = with < KEPT * without;
        }
        Ok(contacts)
    }

    /// What an element does.
    #[inline]
    pub fn of(&self, element: usize) -> ContactState {
        self.states[element]
    }

    /// Whether what sticks keeps the slip of an element that does not.
    #[inline]
    pub(super) fn is_kept(&self, element: usize) -> bool {
        self.is_kept[element]
    }

    /// What all elements do.
    pub(super) fn states(&self) -> &[ContactState; MAX_ELEMENTS] {
        &self.states
    }

    /// The elements that stick.
    #[inline]
    pub fn stuck(&self) -> &[usize] {
        &self.stuck[..self.stuck_count]
    }

    /// The elements that slip or are open.
    #[inline]
    pub fn sliding(&self) -> &[usize] {
        &self.sliding[..self.sliding_count]
    }

    /// The elements that do not stick and may have a torque.
    #[inline]
    pub(super) fn driven(&self) -> &[usize] {
        &self.driven[..self.driven_count]
    }

    /// Accelerations under torques on engine, input and output, and those of the elements that do not stick.
    pub(super) fn accelerations_rad_s2(
        &self,
        ends_n_m: &[f64; ENDS],
        elements_n_m: &[f64; MAX_ELEMENTS],
    ) -> [f64; MAX_FREEDOMS] {
        let mut sum = self.by_ends(ends_n_m);
        for &element in self.sliding() {
            self.add_element(element, elements_n_m[element], &mut sum);
        }
        sum
    }

    /// Accelerations of the first `F` motions under torques on engine, input and output.
    #[inline]
    pub(super) fn by_ends<const F: usize>(&self, ends_n_m: &[f64; ENDS]) -> [f64; F] {
        let mut sum = [0.0; F];
        for (torque, column) in ends_n_m.iter().zip(&self.accelerations) {
            for (sum, x) in sum.iter_mut().zip(column) {
                *sum += torque * x;
            }
        }
        sum
    }

    /// Adds the accelerations of the first `F` motions under the torque of an element that does not stick.
    #[inline]
    pub(super) fn add_element<const F: usize>(&self, element: usize, torque_n_m: f64, sum: &mut [f64; F]) {
        if torque_n_m != 0.0 {
            for (sum, x) in sum.iter_mut().zip(&self.accelerations[ENDS + element]) {
                *sum += torque_n_m * x;
            }
        }
    }

    /// Torque of each sticking element, N m.
    #[inline]
    pub(super) fn holding_n_m(
        &self,
        ends_n_m: &[f64; ENDS],
        elements_n_m: &[f64; MAX_ELEMENTS],
    ) -> [f64; MAX_ELEMENTS] {
        let mut torques = [0.0; MAX_ELEMENTS];
        for (&stuck, row) in self.stuck().iter().zip(&self.holding) {
            let ends: f64 = ends_n_m.iter().zip(row).map(|(torque, h)| torque * h).sum();
            let others = self.sliding().iter().map(|&element| elements_n_m[element] * row[ENDS + element]);
            torques[stuck] = ends + others.sum::<f64>();
        }
        torques
    }

    /// Contacts and motion at a start or at an event: all elements without slip are decided together. `touched` has no slip
    /// whatever its rounding error.
    ///
    /// # Errors
    /// Too many elements have no slip, or a number is not finite.
    pub(super) fn settle(
        model: &CarModel,
        before: &[ContactState; MAX_ELEMENTS],
        touched: Option<usize>,
        state: &CarState,
        inputs: &CarInputs,
    ) -> Result<(Self, CarState), TrainError> {
        let train = &model.train;
        let mut states = *before;
        let mut at_zero = [0; MAX_CONTACTS];
        let mut count = 0;
        for element in 0..model.parts.len() {
            let slip = model.slip(state, element);
            // A one-way clutch has no slip in the direction in which it holds, whatever its rounding error.
            let catches = slip > 0.0 && matches!(model.parts[element], Part::OneWay);
            let sticks = before[element] == Some(Contact::Stuck) || touched == Some(element) || catches;
            if model.holding_limits(element, state, inputs).is_none() {
                states[element] = None;
            } else if sticks || slip.abs() < ZERO_SLIP_RAD_S {
                *at_zero.get_mut(count).ok_or(TrainError::TooLarge)? = element;
                count += 1;
                // Its torque is left out of what the others cause.
                states[element] = None;
            } else {
                states[element] = Some(Contact::Slipping(Direction::of(slip)));
            }
        }
        let at_zero = &at_zero[..count];
        let state = CarState { motion: train.without_slip(state.motion, at_zero)?, ..*state };
        let others = Self::new(model, states)?;
        let torques = model.applied(&others, &state, &model.acting(inputs));
        let free = others.accelerations_rad_s2(&model.ends_n_m(&torques), &torques.elements_n_m);
        // Elements that begin to slip have less friction than they held with, and the others must hold without it.
        let mut slides = [false; MAX_ELEMENTS];
        let solution = loop {
            let problem = train.problem(at_zero, |element| {
                let limits = if slides[element] {
                    model.sliding_limits(element, &state, inputs)
                } else {
                    model.holding_limits(element, &state, inputs)
                };
                (train.slip(&free, element), limits.unwrap_or((0.0, 0.0)))
            })?;
            let solution = problem.solve(&[]);
            let mut is_last = true;
            for (&element, contact) in at_zero.iter().zip(solution.contacts) {
                let begins = matches!(contact, Contact::Slipping(_)) && !slides[element];
                slides[element] |= begins;
                is_last &= !(begins && model.friction(element).is_some());
            }
            if is_last {
                break solution;
            }
        };
        for (&element, contact) in at_zero.iter().zip(solution.contacts) {
            states[element] = Some(contact);
        }
        let contacts = Self::new(model, states)?.without_sharing(model, at_zero, &state, inputs)?;
        let contacts = contacts.within_limits(model, at_zero.len(), &state, inputs)?;
        Ok((contacts, state))
    }

    /// The same where each sticking element can hold its torque. In a gearbox that is tied up more elements stick than its freedoms need: how
    /// they share the torque is not determined, and the smallest torques may be more than one of them can hold. That one then gives what
    /// it can, without slip, and the others hold the rest.
    fn within_limits(
        self,
        model: &CarModel,
        at_most: usize,
        state: &CarState,
        inputs: &CarInputs,
    ) -> Result<Self, TrainError> {
        let mut contacts = self;
        for _ in 0..at_most {
            let held = model.torques(&contacts, state, inputs).elements_n_m;
            let margin = |&at: &usize| holding_margin(model, inputs, state, at, held[at]);
            let over = contacts.stuck().iter().copied().filter(|at| margin(at) < 0.0);
            let Some(element) = over.min_by(|a, b| margin(a).total_cmp(&margin(b))) else { break };
            let mut states = contacts.states;
            states[element] = Some(Contact::Slipping(Direction::of(held[element])));
            let with = Self::new(model, states)?;
            if !with.is_kept(element) {
                break;
            }
            contacts = with;
        }
        Ok(contacts)
    }

    /// The same where no one-way clutch shares its slip with another sticking element, as with a brake beside it: how the two share a
    /// torque is not determined, and a rounding error would change the contacts again and again. The other one holds alone if it
    /// can; else it gives what it can, and the one-way clutch holds the rest.
    fn without_sharing(
        self,
        model: &CarModel,
        at_zero: &[usize],
        state: &CarState,
        inputs: &CarInputs,
    ) -> Result<Self, TrainError> {
        let mut contacts = self;
        for &element in at_zero {
            if contacts.of(element) != Some(Contact::Stuck) || !matches!(model.parts[element], Part::OneWay) {
                continue;
            }
            let mut states = contacts.states;
            states[element] = Some(Contact::Slipping(Direction::Backward));
            let without = Self::new(model, states)?;
            if !without.is_kept(element) {
                continue;
            }
            let Some((other, direction)) = without.overloaded(model, state, inputs) else {
                contacts = without;
                continue;
            };
            let mut states = contacts.states;
            states[other] = Some(Contact::Slipping(direction));
            let with = Self::new(model, states)?;
            if with.is_kept(other) && with.overloaded(model, state, inputs).is_none() {
                contacts = with;
            }
        }
        Ok(contacts)
    }

    /// A sticking element that cannot hold what it must, and in which direction it would slip.
    fn overloaded(&self, model: &CarModel, state: &CarState, inputs: &CarInputs) -> Option<(usize, Direction)> {
        let torques = model.torques(self, state, inputs).elements_n_m;
        self.stuck().iter().copied().find_map(|element| {
            let (lower, upper) = model.holding_limits(element, state, inputs).unwrap_or((0.0, 0.0));
            let is_over = !(lower..=upper).contains(&torques[element]);
            is_over.then_some((element, Direction::of(torques[element])))
        })
    }
}

#[cfg(test)]
mod tests;
