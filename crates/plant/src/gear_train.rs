//! The equations of motion of any gear train with all its elements, behind an engine.
//!
//! With the motions `N` of the train, `w = N q`, and the slips `K q` of its elements:
//!
//! ```text
//! M dq/dt = N' (e_in T_t - e_out T_out) - K' T,     M = N' J N
//! ```
//!
//! The speed of the engine is the last motion; the clutch between engine and gearbox input is the last element.

use geartrain::GearTrain;

use crate::{ContactProblem, MAX_CONTACTS};

/// Most degrees of freedom of a train.
pub const MAX_FREEDOMS: usize = 8;
/// Most elements of a train.
pub const MAX_ELEMENTS: usize = 16;

/// Limit of a torque that is not limited, N m.
pub(crate) const UNLIMITED_N_M: f64 = 1e9;

/// Lowest and highest torque of an element, N m.
pub(crate) type Limits = (f64, f64);

/// Limits of an element that holds any torque.
pub(crate) const HOLDS_ANY: Limits = (-UNLIMITED_N_M, UNLIMITED_N_M);

/// Why a gear train cannot be simulated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum TrainError {
    /// More degrees of freedom, elements, or elements without slip than there is room for.
    #[error(
        "the train has more than {MAX_FREEDOMS} degrees of freedom, {MAX_ELEMENTS} elements or {MAX_CONTACTS} elements without slip\nhint: leave out shafts and elements that no gear needs"
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
    #[error(
        "a torque, a speed or an inertia is not a finite number\nhint: check the inertias of the shafts; each must be above zero"
    )]
    NotFinite,
    /// The gearbox is known by its ratios only.
    #[error(
        "the gearbox has no stick diagram: it can be estimated, and not simulated\nhint: describe it with level = \"stick-diagram\""
    )]
    NoDiagram,
    /// A clutch or brake is known by its name only.
    #[error(
        "a clutch or brake of the gearbox has no `pack`\nhint: give plates and piston of each as `pack` in the gearbox file"
    )]
    NoPack,
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
    /// The train with an engine of this inertia, kg m^2, before its input (input side of the clutch between them: the engine).
    ///
    /// # Errors
    /// The train is too large, or its inertia cannot be inverted.
    pub fn new(train: &GearTrain, engine_kg_m2: f64) -> Result<Self, TrainError> {
        let of_train = (train.degrees_of_freedom(), train.elements.len());
        let (freedoms, elements) = (of_train.0 + 1, of_train.1 + 1);
        if freedoms > MAX_FREEDOMS || elements > MAX_ELEMENTS {
            return Err(TrainError::TooLarge);
        }
        let mut mass = train.mass_kg_m2().resize(freedoms, freedoms, 0.0);
        mass[(of_train.0, of_train.0)] = engine_kg_m2;
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
        model.slips[of_train.1] = model.ends[0].map(|input| -input);
        model.slips[of_train.1][of_train.0] = 1.0;
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
        self.slip_of::<MAX_FREEDOMS>(motion, element)
    }

    /// The same, of `F` degrees of freedom.
    #[inline]
    pub(crate) fn slip_of<const F: usize>(&self, motion: &[f64], element: usize) -> f64 {
        dot(&self.slips[element][..F], &motion[..F])
    }

    /// Speeds of input and output, rad/s.
    #[inline]
    pub fn ends(&self, motion: &[f64; MAX_FREEDOMS]) -> [f64; 2] {
        self.ends_of::<MAX_FREEDOMS>(motion)
    }

    /// The same, of `F` degrees of freedom.
    #[inline]
    pub(crate) fn ends_of<const F: usize>(&self, motion: &[f64]) -> [f64; 2] {
        [dot(&self.ends[0][..F], &motion[..F]), dot(&self.ends[1][..F], &motion[..F])]
    }

    /// Kinetic energy, J.
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
            let problem = self.problem(stuck, |element| (self.slip(&motion, element), HOLDS_ANY))?;
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
            let (free, limits) = of(element);
            let mut row = [0.0; MAX_CONTACTS];
            for (entry, &other) in row.iter_mut().zip(&elements[..=at]) {
                *entry = dot(&self.slips[element], &self.responses[other]);
            }
            if !problem.add(free, &row[..=at], limits) {
                return Err(TrainError::NotFinite);
            }
        }
        Ok(problem)
    }
}
