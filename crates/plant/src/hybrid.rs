//! The hybrid integrator: smooth steps within a mode, events between modes.

use drivetrain::Engagement;

use crate::mode::CLUTCHES;
use crate::powertrain::Acting;
use crate::rosenbrock::{self, LONGEST_STEP_S, SHORTEST_STEP_S, StepSize, Tolerance, Trial};
use crate::state::{STATES, STATES_WITH_STROKE, State};
use crate::{Contact, Direction, Inputs, Mode, Powertrain, Torques};

/// Relative tolerance of the integration, against the size of each state.
pub const RELATIVE_TOLERANCE: f64 = 1e-5;
/// Event functions (rad/s of slip, N m of holding torque) may fall this far below zero before the mode
/// changes, so that rounding at a fresh change does not start another.
const MARGIN_SLACK: f64 = 1e-9;
/// Accuracy to which the time of an event is located, s.
const EVENT_TIME_S: f64 = 1e-12;
/// Evaluations of an event function after which its zero is taken as found.
const MAX_EVALUATIONS: usize = 100;
/// Mode changes at one instant before the plant is declared inconsistent.
const MAX_CHANGES: usize = 8;

/// Why a simulation could not go on.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum PlantError {
    /// The step size fell below its floor or a state became infinite.
    #[error(
        "the simulation diverged at {time_s:.4} s\nhint: check inertias, stiffnesses and time constants of the vehicle file"
    )]
    Diverged {
        /// When.
        time_s: f64,
    },
    /// The clutches found no consistent mode.
    #[error(
        "the clutches change endlessly between sticking and slipping at {time_s:.4} s\nhint: check inertias and friction of the clutches"
    )]
    Chatter {
        /// When.
        time_s: f64,
    },
}

/// One accepted step, for recording.
#[derive(Debug)]
pub struct Segment<'a> {
    /// Time at the start, s.
    pub start_s: f64,
    /// Time at the end, s.
    pub end_s: f64,
    /// The mode throughout.
    pub mode: Mode,
    /// The inputs throughout.
    pub inputs: &'a Inputs,
    trial: &'a dyn DenseOutput,
}

/// The state anywhere within a step.
trait DenseOutput: std::fmt::Debug {
    /// State at this fraction of the step.
    fn state_at(&self, theta: f64) -> State;
}

impl<const N: usize> DenseOutput for Trial<N, Torques> {
    fn state_at(&self, theta: f64) -> State {
        State::from_array(self.at(theta))
    }
}

impl Segment<'_> {
    /// State at a time within the step.
    pub fn at(&self, time_s: f64) -> State {
        let length = self.end_s - self.start_s;
        self.trial.state_at((time_s - self.start_s) / length)
    }
}

/// Time, state and mode of the plant, and how to carry them on.
#[derive(Debug, Clone)]
pub struct HybridIntegrator {
    time_s: f64,
    state: State,
    mode: Mode,
    step_size: StepSize,
    relative_tolerance: f64,
    /// What the last step found at its end, where that still holds.
    known: Option<(Inputs, Rates<STATES_WITH_STROKE>)>,
}

/// The right-hand side at one state.
#[derive(Debug, Clone, Copy)]
struct Rates<const N: usize> {
    slope: [f64; N],
    applied: Torques,
}

impl<const N: usize> Rates<N> {
    fn of(powertrain: &Powertrain, mode: Mode, state: &State, acting: &Acting) -> Self {
        let (slope, applied) = powertrain.derivative_with_torques(mode, &state.to_vector(), acting);
        Self { slope, applied }
    }

    /// The same rates of more or fewer states.
    fn resized<const M: usize>(&self) -> Rates<M> {
        Rates { slope: State::from_array(self.slope).to_vector(), applied: self.applied }
    }
}

impl HybridIntegrator {
    /// Time, s.
    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    /// Continuous state.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Discrete state.
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// Starts at this time and state. A clutch without slip sticks if it can hold.
    pub fn new(powertrain: &Powertrain, time_s: f64, state: State, inputs: &Inputs) -> Result<Self, PlantError> {
        Self::with_tolerance(powertrain, time_s, state, inputs, RELATIVE_TOLERANCE)
    }

    /// As [`Self::new`], with a relative tolerance of its own.
    ///
    /// # Errors
    /// The clutches find no consistent mode.
    pub fn with_tolerance(
        powertrain: &Powertrain,
        time_s: f64,
        state: State,
        inputs: &Inputs,
        relative: f64,
    ) -> Result<Self, PlantError> {
        let shift = &powertrain.vehicle.shift;
        let slips = [
            shift.offgoing_slip(state.turbine_rad_s, state.output_rad_s),
            shift.oncoming_slip(state.turbine_rad_s, state.output_rad_s),
        ];
        let directions = slips.map(Direction::of);
        let mut start = Self {
            time_s,
            state,
            mode: Mode::of(directions.map(Contact::Slipping)),
            step_size: StepSize::FIRST,
            relative_tolerance: relative,
            known: None,
        };
        let capacities_n_m = powertrain.capacities_n_m(&state);
        let is_at_rest = slips.map(|slip| slip.abs() < MARGIN_SLACK);
        let without_slip = [0, 1].map(|clutch| is_at_rest[clutch].then_some(capacities_n_m[clutch]));
        let likely = start.sticking(powertrain, inputs, start.mode.contacts(), is_at_rest);
        start.settle(powertrain, inputs, likely, without_slip)?;
        Ok(start)
    }

    /// Integrates to `until_s` under constant inputs and shows every accepted step to `record`.
    ///
    /// # Errors
    /// Divergence or chatter, see [`PlantError`].
    pub fn advance(
        &mut self,
        powertrain: &Powertrain,
        inputs: &Inputs,
        until_s: f64,
        record: &mut dyn FnMut(&Segment<'_>),
    ) -> Result<(), PlantError> {
        // The oil in the cylinders is integrated only where it matters.
        if powertrain.has_stroke() {
            self.advance_states::<STATES_WITH_STROKE, 3>(powertrain, inputs, until_s, record)
        } else {
            self.advance_states::<STATES, 1>(powertrain, inputs, until_s, record)
        }
    }

    /// As [`Self::advance`], for the first `N` states with this number of stiff rows.
    fn advance_states<const N: usize, const ROWS: usize>(
        &mut self,
        powertrain: &Powertrain,
        inputs: &Inputs,
        until_s: f64,
        record: &mut dyn FnMut(&Segment<'_>),
    ) -> Result<(), PlantError> {
        // New inputs change pressures and speeds only by and by: the mode is still the right one.
        let acting = powertrain.acting(inputs);
        let mut rates: Rates<N> = match self.known.take() {
            Some((same, rates)) if same == *inputs => rates.resized(),
            _ => Rates::of(powertrain, self.mode, &self.state, &acting),
        };
        let mut changes = 0;
        while until_s - self.time_s > EVENT_TIME_S {
            let mut size = self.step_size;
            let accepted =
                size.accepted(until_s - self.time_s, |h| self.trial::<N, ROWS>(powertrain, &acting, &rates, h));
            self.step_size = size;
            // Looked at where it is: a trial is large, and a copy costs as much as a stage.
            let Some((step_s, trial)) = &accepted else { return Err(PlantError::Diverged { time_s: self.time_s }) };
            let Some(theta) = self.first_event(powertrain, inputs, trial) else {
                self.take(trial, self.time_s + step_s, inputs, record);
                rates = Rates { slope: trial.end_slope, applied: trial.end_applied };
                changes = 0;
                continue;
            };
            // Repeat the step up to the event, so that its state has the accuracy of a step and not of the interpolant.
            let to_event = self.trial::<N, ROWS>(powertrain, &acting, &rates, theta * step_s);
            changes = if theta * step_s > SHORTEST_STEP_S { 1 } else { changes + 1 };
            if changes > MAX_CHANGES {
                return Err(PlantError::Chatter { time_s: self.time_s });
            }
            self.take(&to_event, self.time_s + theta * step_s, inputs, record);
            self.change_mode(powertrain, inputs)?;
            rates = Rates::of(powertrain, self.mode, &self.state, &acting);
        }
        self.time_s = until_s;
        self.known = Some((*inputs, rates.resized()));
        Ok(())
    }

    fn take<const N: usize>(
        &mut self,
        trial: &Trial<N, Torques>,
        end_s: f64,
        inputs: &Inputs,
        record: &mut dyn FnMut(&Segment<'_>),
    ) {
        record(&Segment { start_s: self.time_s, end_s, mode: self.mode, inputs, trial });
        self.time_s = end_s;
        self.state = State::from_array(trial.end);
    }

    /// Tries a step of this length.
    #[inline]
    fn trial<const N: usize, const ROWS: usize>(
        &self,
        powertrain: &Powertrain,
        acting: &Acting,
        rates: &Rates<N>,
        step_s: f64,
    ) -> Trial<N, Torques> {
        let mode = self.mode;
        let f = |x: &[f64; N]| powertrain.derivative_with_torques(mode, x, acting).0;
        let at_end = |x: &[f64; N]| powertrain.derivative_with_torques(mode, x, acting);
        let rows: [_; ROWS] = powertrain.stiff_rows(&self.state, rates.applied.tyre_n);
        let tolerance = Tolerance { relative: self.relative_tolerance, scale: State::SCALE.to_vector() };
        rosenbrock::step(&f, &at_end, &self.state.to_vector(), &rates.slope, &rows, step_s, &tolerance)
    }

    /// Margins of offgoing and oncoming clutch, with the slack.
    fn margins(&self, powertrain: &Powertrain, inputs: &Inputs, x: &State) -> [f64; 2] {
        powertrain.margins(self.mode, x, inputs).map(|margin| margin + MARGIN_SLACK)
    }

    /// Fraction of the step at which the first margin reaches zero, located on the dense output.
    fn first_event<const N: usize>(
        &self,
        powertrain: &Powertrain,
        inputs: &Inputs,
        trial: &Trial<N, Torques>,
    ) -> Option<f64> {
        let slack = |margin: f64| margin + MARGIN_SLACK;
        let end = State::from_array(trial.end);
        let at_end = powertrain.margins_under(self.mode, &end, &trial.end_applied).map(slack);
        if at_end.iter().all(|&margin| margin >= 0.0) {
            return None;
        }
        (0..2)
            .filter(|&i| at_end[i] < 0.0)
            .map(|i| root(|theta| self.margins(powertrain, inputs, &trial.state_at(theta))[i]))
            .min_by(f64::total_cmp)
    }

    /// Changes the mode at an event: a slip has reached zero, or a sticking clutch can hold no more.
    fn change_mode(&mut self, powertrain: &Powertrain, inputs: &Inputs) -> Result<(), PlantError> {
        // The margin at the event is zero up to the accuracy of locating it: a clutch that can hold no more can hold what it does.
        const AT_EVENT: f64 = 1e-6;
        let holding = powertrain.torques(self.mode, &self.state, inputs).shift;
        let holding_n_m = [holding.offgoing_n_m, holding.oncoming_n_m];
        let margins = self.margins(powertrain, inputs, &self.state);
        let (capacities_n_m, mut likely) = (powertrain.capacities_n_m(&self.state), self.mode.contacts());
        let (mut without_slip, mut comes_to_rest) = ([None; CLUTCHES], [false; CLUTCHES]);
        for clutch in 0..CLUTCHES {
            let (capacity_n_m, holding_n_m) = (capacities_n_m[clutch], holding_n_m[clutch]);
            match (likely[clutch], margins[clutch] <= AT_EVENT) {
                (Contact::Slipping(_), is_used_up) => {
                    comes_to_rest[clutch] = is_used_up;
                    without_slip[clutch] = is_used_up.then_some(capacity_n_m);
                }
                (Contact::Stuck, true) => {
                    likely[clutch] = Contact::Slipping(Direction::of(holding_n_m));
                    without_slip[clutch] = Some(capacity_n_m.min(holding_n_m.abs()));
                }
                (Contact::Stuck, false) => without_slip[clutch] = Some(capacity_n_m),
            }
        }
        let likely = self.sticking(powertrain, inputs, likely, comes_to_rest);
        self.settle(powertrain, inputs, likely, without_slip)
    }

    /// These contacts, where clutches that come to rest stick if they can hold what they then must, and else give way to it.
    fn sticking(
        &self,
        powertrain: &Powertrain,
        inputs: &Inputs,
        mut contacts: [Contact; CLUTCHES],
        comes_to_rest: [bool; CLUTCHES],
    ) -> [Contact; CLUTCHES] {
        for (contact, _) in contacts.iter_mut().zip(comes_to_rest).filter(|(_, comes_to_rest)| *comes_to_rest) {
            *contact = Contact::Stuck;
        }
        let holding = powertrain.torques(Mode::of(contacts), &self.state, inputs).shift;
        let holding_n_m = [holding.offgoing_n_m, holding.oncoming_n_m];
        let capacities_n_m = powertrain.capacities_n_m(&self.state);
        for clutch in (0..CLUTCHES).filter(|&clutch| comes_to_rest[clutch]) {
            if holding_n_m[clutch].abs() > capacities_n_m[clutch] {
                contacts[clutch] = Contact::Slipping(Direction::of(holding_n_m[clutch]));
            }
        }
        contacts
    }

    /// Decides all clutches without slip together, those with a capacity, N m, from contacts that are likely, and makes the speeds
    /// agree with one that begins to stick.
    fn settle(
        &mut self,
        powertrain: &Powertrain,
        inputs: &Inputs,
        likely: [Contact; CLUTCHES],
        without_slip: [Option<f64>; CLUTCHES],
    ) -> Result<(), PlantError> {
        let problem = powertrain
            .contact_problem(self.mode, without_slip, &self.state, inputs)
            .ok_or(PlantError::Diverged { time_s: self.time_s })?;
        let asked: Vec<usize> = (0..CLUTCHES).filter(|&clutch| without_slip[clutch].is_some()).collect();
        let guess: Vec<Contact> = asked.iter().map(|&clutch| likely[clutch]).collect();
        let solution = problem.solve(&guess);
        let before = self.mode.contacts();
        let mut contacts = before;
        for (&clutch, contact) in asked.iter().zip(solution.contacts) {
            contacts[clutch] = contact;
        }
        self.mode = Mode::of(contacts);
        let begins = |clutch: usize| contacts[clutch] == Contact::Stuck && before[clutch] != Contact::Stuck;
        if (0..CLUTCHES).any(begins) {
            self.lock(powertrain);
        }
        Ok(())
    }

    /// Makes the speeds agree with the clutches that stick, conserving momentum.
    fn lock(&mut self, powertrain: &Powertrain) {
        let shift = &powertrain.vehicle.shift;
        let (turbine, output) = (self.state.turbine_rad_s, self.state.output_rad_s);
        (self.state.turbine_rad_s, self.state.output_rad_s) = match self.mode.engagement() {
            Engagement::BothStuck => (0.0, 0.0),
            Engagement::OffgoingStuck => shift.after_lock_up(shift.slip_offgoing, turbine, output),
            Engagement::OncomingStuck => shift.after_lock_up(shift.slip_oncoming, turbine, output),
            Engagement::BothSlipping => (turbine, output),
        };
    }
}

/// Where in `(0, 1]` a function that is not negative at 0 turns negative, by the Illinois variant of the false
/// position, which ends within [`EVENT_TIME_S`] on the negative side.
pub(crate) fn root(f: impl Fn(f64) -> f64) -> f64 {
    let mut not_negative = (0.0, f(0.0).max(0.0));
    let mut negative = (1.0, f(1.0));
    let close = EVENT_TIME_S / LONGEST_STEP_S;
    for evaluation in 0..MAX_EVALUATIONS {
        let (width, value) = (negative.0 - not_negative.0, not_negative.1 - negative.1);
        if width <= close {
            break;
        }
        // Aiming a little beyond the zero brings the other end in, too. Bisection ends what converges badly.
        let aim = not_negative.0 + width * (not_negative.1 / value) + 0.5 * close;
        let at = if evaluation < MAX_EVALUATIONS / 2 && aim < negative.0 { aim } else { not_negative.0 + 0.5 * width };
        let here = f(at);
        if here < 0.0 {
            negative = (at, here);
            not_negative.1 *= 0.5;
        } else {
            not_negative = (at, here);
            negative.1 *= 0.5;
        }
    }
    negative.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_root_is_found_from_the_negative_side() {
        let check = |f: &dyn Fn(f64) -> f64, exact: f64| {
            let found = root(f);
            assert!(f(found) < 0.0 && (found - exact).abs() < 1e-10, "{found} for {exact}");
        };
        check(&|x| 0.3 - x, 0.3);
        check(&|x| 1e-9 - x.powi(5), 1e-9_f64.powf(0.2));
        check(&|x| (0.7 - x) * (1.0 + 1e3 * x), 0.7);
        check(&|x| if x < 0.999 { 1e-12 } else { -1e3 }, 0.999);
    }
}
