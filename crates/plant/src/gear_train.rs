//! Any gear train with all its clutches, between a torque at its input and an inertia at its output.
//!
//! With the motions `N` of the train, `w = N q`, and the slips `K q` of its elements:
//!
//! ```text
//! M dq/dt = N' (e_in T_t - e_out T_out) - K' T,     M = N' J N
//! ```
//!
//! A slipping element has the torque of its capacity in the direction of its slip, a sticking one the torque that keeps its
//! slip at zero. Steps are those of the classical Runge-Kutta method; a step ends where a slip reaches zero or a holding
//! torque its limit. There all elements without slip are solved together ([`ContactProblem`]). Left out: drag of open
//! elements, backlash of dogs, and the course of friction over slip.

use geartrain::GearTrain;

use crate::{Contact, ContactProblem, Direction, MAX_CONTACTS};

/// Most degrees of freedom of a train.
pub const MAX_FREEDOMS: usize = 8;
/// Most elements of a train.
pub const MAX_ELEMENTS: usize = 16;

/// Supplied, delivered and dissipated energy follow the motions in the state.
const STATES: usize = MAX_FREEDOMS + 3;
/// Longest step, s.
const STEP_S: f64 = 2e-3;
/// A slip below this is zero, rad/s.
const ZERO_SLIP_RAD_S: f64 = 1e-6;
/// A slip may pass zero by this, rad/s, and a holding torque its limit, N m, before the step ends.
const PASSED: f64 = 1e-7;
/// Halvings of a step in search of an event.
const HALVINGS: u32 = 50;
/// Events without progress after which the train is inconsistent.
const MOST_EVENTS: usize = 64;
/// Limit of a torque that is not limited, N m.
const UNLIMITED_N_M: f64 = 1e9;

/// Lowest and highest torque of an element, N m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits(f64, f64);

impl Limits {
    /// A clutch or brake that holds this torque in both directions; a negative one is none.
    pub fn capacity(capacity_n_m: f64) -> Self {
        let capacity_n_m = if capacity_n_m < 0.0 { 0.0 } else { capacity_n_m };
        Self(-capacity_n_m, capacity_n_m)
    }

    /// A one-way clutch: it holds any torque that drives its output side, and none in the other direction.
    pub const ONE_WAY: Self = Self(0.0, UNLIMITED_N_M);

    /// A dog that is in. It may be set at zero slip only.
    pub const DOG: Self = Self(-UNLIMITED_N_M, UNLIMITED_N_M);

    /// From the lowest to the highest torque, N m.
    pub(crate) fn between(lower_n_m: f64, upper_n_m: f64) -> Self {
        Self(lower_n_m, upper_n_m)
    }

    /// The torque at which an element slips in this direction.
    fn slipping(self, direction: Direction) -> f64 {
        match direction {
            Direction::Forward => self.1,
            Direction::Backward => self.0,
        }
    }
}

/// What acts on the train.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrainInputs {
    /// Turbine torque, N m.
    pub turbine_n_m: f64,
    /// Load at the output, N m.
    pub output_n_m: f64,
    /// Limits of each element; `None` for one that is open.
    pub limits: [Option<Limits>; MAX_ELEMENTS],
}

/// Why a run could not be made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum TrainError {
    /// More degrees of freedom, elements, or elements without slip than there is room for.
    #[error(
        "the train has more than {MAX_FREEDOMS} degrees of freedom, {MAX_ELEMENTS} elements or {MAX_CONTACTS} elements without slip"
    )]
    TooLarge,
    /// More elements with plates than a simulated car has room for.
    #[error(
        "the gearbox has {packs} clutches and brakes, and a simulated car has room for {room}\nhint: leave out those that no gear engages"
    )]
    TooManyPacks {
        /// Clutches and brakes of the gearbox.
        packs: usize,
        /// The most of a simulated car.
        room: usize,
    },
    /// A torque, speed or inertia is not a number, or the inertia is not positive.
    #[error("a torque, a speed or an inertia is not a finite number")]
    NotFinite,
    /// The gearbox is known by its ratios only.
    #[error(
        "the gearbox has no stick diagram: it can be estimated, and not simulated\nhint: describe it with level = \"stick-diagram\""
    )]
    NoDiagram,
    /// A clutch or brake is known by its name only.
    #[error("a clutch or brake of the gearbox has no `pack`")]
    NoPack,
    /// The elements find no consistent contact.
    #[error("the elements change endlessly between sticking and slipping")]
    Chatter,
}

/// The equations of motion of a train.
#[derive(Debug, Clone, PartialEq)]
pub struct TrainModel {
    pub(crate) freedoms: usize,
    pub(crate) elements: usize,
    /// `M^-1`.
    inverse_mass: [[f64; MAX_FREEDOMS]; MAX_FREEDOMS],
    mass: [[f64; MAX_FREEDOMS]; MAX_FREEDOMS],
    /// Speeds of input and output per motion.
    pub(crate) ends: [[f64; MAX_FREEDOMS]; 2],
    /// `K`.
    slips: [[f64; MAX_FREEDOMS]; MAX_ELEMENTS],
    /// `M^-1 K'`, a row for each element.
    pub(crate) responses: [[f64; MAX_FREEDOMS]; MAX_ELEMENTS],
}

/// The slice of a row that is in use, times another.
#[inline]
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

impl TrainModel {
    /// The train with an inertia on its output shaft.
    ///
    /// # Errors
    /// The train is too large, or its inertia cannot be inverted.
    pub fn new(train: &GearTrain, load_kg_m2: f64) -> Result<Self, TrainError> {
        Self::of(train, load_kg_m2, None)
    }

    /// The bare train with an engine of this inertia before its input. The speed of the engine is the last motion, and the
    /// clutch between engine and input (input side: the engine) the last element.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with_engine(train: &GearTrain, engine_kg_m2: f64) -> Result<Self, TrainError> {
        Self::of(train, 0.0, Some(engine_kg_m2))
    }

    fn of(train: &GearTrain, load_kg_m2: f64, engine_kg_m2: Option<f64>) -> Result<Self, TrainError> {
        let of_train = (train.degrees_of_freedom(), train.elements.len());
        let more = usize::from(engine_kg_m2.is_some());
        let (freedoms, elements) = (of_train.0 + more, of_train.1 + more);
        if freedoms > MAX_FREEDOMS || elements > MAX_ELEMENTS {
            return Err(TrainError::TooLarge);
        }
        let mut mass = train.mass_kg_m2(load_kg_m2).resize(freedoms, freedoms, 0.0);
        if let Some(engine_kg_m2) = engine_kg_m2 {
            mass[(of_train.0, of_train.0)] = engine_kg_m2;
        }
        let inverse = mass.clone().try_inverse().filter(|inverse| inverse.iter().all(|x| x.is_finite()));
        let inverse = inverse.ok_or(TrainError::NotFinite)?;
        let all: Vec<usize> = (0..of_train.1).collect();
        let slips = train.slips(&all);
        let mut model = Self {
            freedoms,
            elements,
            inverse_mass: [[0.0; MAX_FREEDOMS]; MAX_FREEDOMS],
            mass: [[0.0; MAX_FREEDOMS]; MAX_FREEDOMS],
            ends: [[0.0; MAX_FREEDOMS]; 2],
            slips: [[0.0; MAX_FREEDOMS]; MAX_ELEMENTS],
            responses: [[0.0; MAX_FREEDOMS]; MAX_ELEMENTS],
        };
        for j in 0..freedoms {
            for i in 0..freedoms {
                model.inverse_mass[i][j] = inverse[(i, j)];
                model.mass[i][j] = mass[(i, j)];
            }
        }
        for j in 0..of_train.0 {
            for (end, shaft) in [train.input, train.output].into_iter().enumerate() {
                model.ends[end][j] = train.basis()[(shaft, j)];
            }
            for element in 0..of_train.1 {
                model.slips[element][j] = slips[(element, j)];
            }
        }
        if engine_kg_m2.is_some() {
            model.slips[of_train.1] = model.ends[0].map(|input| -input);
            model.slips[of_train.1][of_train.0] = 1.0;
        }
        for element in 0..elements {
            model.responses[element] = model.accelerate(&model.slips[element]);
        }
        Ok(model)
    }

    /// `M^-1` times a generalised force.
    pub(crate) fn accelerate(&self, force: &[f64; MAX_FREEDOMS]) -> [f64; MAX_FREEDOMS] {
        let mut acceleration = [0.0; MAX_FREEDOMS];
        for (x, row) in acceleration.iter_mut().zip(&self.inverse_mass).take(self.freedoms) {
            *x = dot(row, force);
        }
        acceleration
    }

    /// Slip of an element, rad/s.
    #[inline]
    pub fn slip(&self, motion: &[f64; MAX_FREEDOMS], element: usize) -> f64 {
        dot(&self.slips[element], motion)
    }

    /// Speeds of input and output, rad/s.
    #[inline]
    pub fn ends(&self, motion: &[f64; MAX_FREEDOMS]) -> [f64; 2] {
        [dot(&self.ends[0], motion), dot(&self.ends[1], motion)]
    }

    /// Kinetic energy, load included, J.
    pub fn kinetic_energy(&self, motion: &[f64; MAX_FREEDOMS]) -> f64 {
        0.5 * (0..self.freedoms).map(|i| motion[i] * dot(&self.mass[i], motion)).sum::<f64>()
    }

    /// The nearest motion, in kinetic energy, at which these elements do not slip: what is left after an impulse of the
    /// elements, so that the momenta along the motions that stay free are conserved.
    pub(crate) fn without_slip(
        &self,
        mut motion: [f64; MAX_FREEDOMS],
        stuck: &[usize],
    ) -> Result<[f64; MAX_FREEDOMS], TrainError> {
        // Rows that depend on each other leave a rest, which the second pass removes.
        for _ in 0..2 {
            let problem = self.problem(stuck, |element| (self.slip(&motion, element), Limits::DOG))?;
            let impulses = problem.solve(&[]).torques_n_m;
            for (&element, impulse) in stuck.iter().zip(impulses) {
                for (x, response) in motion.iter_mut().zip(&self.responses[element]) {
                    *x -= impulse * response;
                }
            }
        }
        Ok(motion)
    }

    /// The contact problem of some elements, by what each has without the torques of the others, and by its limits.
    pub(crate) fn problem(
        &self,
        elements: &[usize],
        of: impl Fn(usize) -> (f64, Limits),
    ) -> Result<ContactProblem, TrainError> {
        if elements.len() > MAX_CONTACTS {
            return Err(TrainError::TooLarge);
        }
        let mut problem = ContactProblem::new();
        for (at, &element) in elements.iter().enumerate() {
            let (free, Limits(lower, upper)) = of(element);
            let mut row = [0.0; MAX_CONTACTS];
            for (entry, &other) in row.iter_mut().zip(&elements[..=at]) {
                *entry = dot(&self.slips[element], &self.responses[other]);
            }
            if !problem.add(free, &row[..=at], (lower, upper)) {
                return Err(TrainError::NotFinite);
            }
        }
        Ok(problem)
    }
}

/// Contacts of all elements.
pub type Contacts = [Contact; MAX_ELEMENTS];

/// A train in motion.
#[derive(Debug, Clone)]
pub struct TrainRun<'m> {
    model: &'m TrainModel,
    /// Time, s.
    pub time_s: f64,
    /// The motion: speeds in the coordinates of [`GearTrain::basis`], rad/s.
    pub motion: [f64; MAX_FREEDOMS],
    /// Which elements stick, and how the others slip.
    pub contacts: Contacts,
    /// Energy from the turbine since the start, J.
    pub supplied_j: f64,
    /// Energy to the load since the start, J.
    pub delivered_j: f64,
    /// Heat of the elements since the start, J.
    pub dissipated_j: f64,
}

/// Accelerations and torques at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Balance {
    /// Acceleration of the motion, rad/s^2.
    pub motion_rad_s2: [f64; MAX_FREEDOMS],
    /// Torque of each element, N m.
    pub torques_n_m: [f64; MAX_ELEMENTS],
}

impl<'m> TrainRun<'m> {
    /// Starts with this motion. Elements without slip stick if they can hold.
    ///
    /// # Errors
    /// An input is not finite, or too many elements have no slip.
    pub fn new(model: &'m TrainModel, motion: [f64; MAX_FREEDOMS], inputs: &TrainInputs) -> Result<Self, TrainError> {
        let mut contacts = [Contact::Slipping(Direction::Forward); MAX_ELEMENTS];
        for (element, contact) in contacts.iter_mut().enumerate().take(model.elements) {
            *contact = Contact::Slipping(Direction::of(model.slip(&motion, element)));
        }
        let (supplied_j, delivered_j, dissipated_j) = (0.0, 0.0, 0.0);
        let mut run = Self { model, time_s: 0.0, motion, contacts, supplied_j, delivered_j, dissipated_j };
        run.settle(inputs)?;
        Ok(run)
    }

    /// Speeds of turbine and output, rad/s.
    pub fn ends(&self) -> [f64; 2] {
        self.model.ends(&self.motion)
    }

    /// Decides anew about all elements without slip, as after a jump of the inputs or at an event.
    ///
    /// # Errors
    /// An input is not finite, or too many elements have no slip.
    pub fn settle(&mut self, inputs: &TrainInputs) -> Result<(), TrainError> {
        let mut at_zero = [0; MAX_ELEMENTS];
        let mut count = 0;
        for element in 0..self.model.elements {
            let is_stuck = self.contacts[element] == Contact::Stuck;
            let slip = self.model.slip(&self.motion, element);
            if inputs.limits[element].is_none() {
                self.contacts[element] = Contact::Slipping(Direction::of(slip));
            } else if is_stuck || slip.abs() < ZERO_SLIP_RAD_S {
                at_zero[count] = element;
                count += 1;
            } else {
                self.contacts[element] = Contact::Slipping(Direction::of(slip));
            }
        }
        let at_zero = &at_zero[..count];
        self.motion = self.model.without_slip(self.motion, at_zero)?;
        // What the torques of the slipping elements cause.
        for &element in at_zero {
            self.contacts[element] = Contact::Slipping(Direction::Forward);
        }
        let sliding = |element: usize| !at_zero.contains(&element);
        let free = self.model.accelerate(&self.force(inputs, &self.contacts, sliding));
        let of = |element: usize| {
            (dot(&self.model.slips[element], &free), inputs.limits[element].unwrap_or(Limits::capacity(0.0)))
        };
        let solution = self.model.problem(at_zero, of)?.solve(&[]);
        for (&element, contact) in at_zero.iter().zip(solution.contacts) {
            self.contacts[element] = contact;
        }
        Ok(())
    }

    /// The generalised force of turbine, load and those slipping elements that are `counted`.
    fn force(&self, inputs: &TrainInputs, contacts: &Contacts, counted: impl Fn(usize) -> bool) -> [f64; MAX_FREEDOMS] {
        let mut force = [0.0; MAX_FREEDOMS];
        for (x, (input, output)) in force.iter_mut().zip(self.model.ends[0].iter().zip(&self.model.ends[1])) {
            *x = input * inputs.turbine_n_m - output * inputs.output_n_m;
        }
        for element in (0..self.model.elements).filter(|&element| counted(element)) {
            if let (Contact::Slipping(direction), Some(limits)) = (contacts[element], inputs.limits[element]) {
                let torque = limits.slipping(direction);
                for (x, k) in force.iter_mut().zip(&self.model.slips[element]) {
                    *x -= torque * k;
                }
            }
        }
        force
    }

    /// Accelerations and torques with the contacts of the moment.
    ///
    /// # Errors
    /// An input is not finite, or too many elements stick.
    pub fn balance(&self, inputs: &TrainInputs) -> Result<Balance, TrainError> {
        let mut torques_n_m = [0.0; MAX_ELEMENTS];
        let mut stuck = [0; MAX_ELEMENTS];
        let mut count = 0;
        for (element, torque) in torques_n_m.iter_mut().enumerate().take(self.model.elements) {
            match (self.contacts[element], inputs.limits[element]) {
                (Contact::Slipping(direction), Some(limits)) => *torque = limits.slipping(direction),
                (Contact::Stuck, Some(_)) => {
                    stuck[count] = element;
                    count += 1;
                }
                (_, None) => (),
            }
        }
        let stuck = &stuck[..count];
        let mut motion_rad_s2 = self.model.accelerate(&self.force(inputs, &self.contacts, |_| true));
        let free = |element: usize| (dot(&self.model.slips[element], &motion_rad_s2), Limits::DOG);
        let holding = self.model.problem(stuck, free)?.solve(&[]).torques_n_m;
        for (&element, torque) in stuck.iter().zip(holding) {
            torques_n_m[element] = torque;
            for (x, response) in motion_rad_s2.iter_mut().zip(&self.model.responses[element]) {
                *x -= torque * response;
            }
        }
        if motion_rad_s2.iter().all(|x| x.is_finite()) {
            Ok(Balance { motion_rad_s2, torques_n_m })
        } else {
            Err(TrainError::NotFinite)
        }
    }

    /// Heat of the slipping elements with these torques, W.
    pub fn friction_w(&self, balance: &Balance) -> f64 {
        let slips = (0..self.model.elements).filter(|&element| self.contacts[element] != Contact::Stuck);
        slips.map(|element| balance.torques_n_m[element] * self.model.slip(&self.motion, element)).sum()
    }

    /// Carries the train on to `until_s` under inputs that depend smoothly on time and the speeds of turbine and output.
    ///
    /// # Errors
    /// An input is not finite, or the elements find no consistent contact.
    pub fn advance(
        &mut self,
        until_s: f64,
        inputs: &impl Fn(f64, [f64; 2]) -> TrainInputs,
        record: &mut impl FnMut(&Self),
    ) -> Result<(), TrainError> {
        let mut events = 0;
        while until_s - self.time_s > f64::EPSILON * until_s.abs() {
            let step_s = STEP_S.min(until_s - self.time_s);
            let whole = self.stepped(step_s, inputs)?;
            if !whole.is_over(inputs)? {
                *self = whole;
                events = 0;
                record(self);
                continue;
            }
            events += 1;
            if events > MOST_EVENTS {
                return Err(TrainError::Chatter);
            }
            let (mut before, mut after) = (0.0, step_s);
            for _ in 0..HALVINGS {
                let middle = 0.5 * (before + after);
                if self.stepped(middle, inputs)?.is_over(inputs)? { after = middle } else { before = middle }
            }
            *self = self.stepped(after, inputs)?;
            self.settle(&inputs(self.time_s, self.ends()))?;
            record(self);
        }
        Ok(())
    }

    /// Whether a slip has passed zero or a holding torque its limit.
    fn is_over(&self, inputs: &impl Fn(f64, [f64; 2]) -> TrainInputs) -> Result<bool, TrainError> {
        let inputs = inputs(self.time_s, self.ends());
        let balance = self.balance(&inputs)?;
        Ok((0..self.model.elements).any(|element| match (self.contacts[element], inputs.limits[element]) {
            (_, None) => false,
            (Contact::Slipping(direction), Some(_)) => {
                direction.sign() * self.model.slip(&self.motion, element) < -PASSED
            }
            (Contact::Stuck, Some(Limits(lower, upper))) => {
                let torque = balance.torques_n_m[element];
                torque > upper + PASSED * (1.0 + upper) || torque < lower - PASSED * (1.0 - lower)
            }
        }))
    }

    /// The run after one Runge-Kutta step with the contacts of the moment.
    fn stepped(&self, step_s: f64, inputs: &impl Fn(f64, [f64; 2]) -> TrainInputs) -> Result<Self, TrainError> {
        let rates = |run: &Self| -> Result<[f64; STATES], TrainError> {
            let ends = run.ends();
            let inputs = inputs(run.time_s, ends);
            let balance = run.balance(&inputs)?;
            let mut rates = [0.0; STATES];
            rates[..MAX_FREEDOMS].copy_from_slice(&balance.motion_rad_s2);
            rates[MAX_FREEDOMS] = inputs.turbine_n_m * ends[0];
            rates[MAX_FREEDOMS + 1] = inputs.output_n_m * ends[1];
            rates[MAX_FREEDOMS + 2] = run.friction_w(&balance);
            Ok(rates)
        };
        let first = rates(self)?;
        let second = rates(&self.moved(0.5 * step_s, &first))?;
        let third = rates(&self.moved(0.5 * step_s, &second))?;
        let fourth = rates(&self.moved(step_s, &third))?;
        let mut mean = [0.0; STATES];
        for (at, rate) in mean.iter_mut().enumerate() {
            *rate = (first[at] + 2.0 * second[at] + 2.0 * third[at] + fourth[at]) / 6.0;
        }
        let moved = self.moved(step_s, &mean);
        if moved.motion.iter().all(|x| x.is_finite()) { Ok(moved) } else { Err(TrainError::NotFinite) }
    }

    fn moved(&self, step_s: f64, rates: &[f64; STATES]) -> Self {
        let mut moved = self.clone();
        moved.time_s += step_s;
        for (x, rate) in moved.motion.iter_mut().zip(rates) {
            *x += step_s * rate;
        }
        moved.supplied_j += step_s * rates[MAX_FREEDOMS];
        moved.delivered_j += step_s * rates[MAX_FREEDOMS + 1];
        moved.dissipated_j += step_s * rates[MAX_FREEDOMS + 2];
        moved
    }
}
