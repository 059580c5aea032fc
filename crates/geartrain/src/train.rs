//! A gear train: the kinematics and statics of checked shafts, sets, gear pairs and elements.
//!
//! With the shaft speeds `w`, each planetary set and each gear pair that is always in mesh is a row of `A w = 0`. The columns
//! of `N` are a basis of the motions that these rows leave, `w = N q`. The slip of element `c` is `k_c w`. In a gear the
//! slips of the engaged elements are zero, and what remains must turn input and output in one ratio.

use drivetrain::{Clutch, ReducedShift};
use nalgebra::{DMatrix, DVector, RowDVector};

use crate::description::{ElementKind, GearPair, PlanetarySet, Planets, Shaft};
use crate::linear::{min_norm, null_space};

/// A speed or a coefficient below this is zero; shaft speeds are of the order of the turbine speed.
pub(crate) const ZERO: f64 = 1e-9;

/// One side of an element, or a member of a planetary set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Member {
    /// The gearbox housing, at rest.
    Housing,
    /// A shaft, by its position in the list of shafts.
    Shaft(usize),
}

/// What an element connects.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Connection {
    /// Input and output side.
    Sides(Member, Member),
    /// The gear pair of this number: the loose gear with its shaft.
    Pair(usize),
}

/// An element between two members, or of a gear pair.
#[derive(Debug, Clone, PartialEq)]
pub struct TrainElement {
    /// Its name.
    pub name: String,
    /// What it is.
    pub kind: ElementKind,
    /// What it connects.
    pub connection: Connection,
    /// Its friction plates and piston.
    pub pack: Option<Clutch<f64>>,
}

/// A gear train.
#[derive(Debug, Clone, PartialEq)]
pub struct GearTrain {
    /// The shafts.
    pub shafts: Vec<Shaft>,
    /// Shaft of the turbine.
    pub input: usize,
    /// Shaft of the output.
    pub output: usize,
    /// The planetary sets.
    pub sets: Vec<PlanetarySet<Member>>,
    /// The gear pairs.
    pub pairs: Vec<GearPair<usize>>,
    /// The elements.
    pub elements: Vec<TrainElement>,
    /// `N`.
    basis: DMatrix<f64>,
}

/// How a gear turns.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct GearMotion {
    /// Turbine speed over output speed.
    pub(crate) ratio: f64,
    /// Speed of each shaft per turbine speed; `None` where the gear leaves it open, as for an idle shaft of a dual clutch.
    pub(crate) speeds: Vec<Option<f64>>,
}

/// Why elements make no gear.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum NoGear {
    /// Neither input nor output can turn.
    Locked,
    /// The input is held.
    InputHeld,
    /// The output is held.
    OutputHeld,
    /// Input and output turn independently.
    Open,
}

impl GearTrain {
    /// The train of these parts, whose members and sides are places in `shafts`. `None` if one set or pair follows from the others.
    pub fn new(
        shafts: Vec<Shaft>,
        [input, output]: [usize; 2],
        sets: Vec<PlanetarySet<Member>>,
        pairs: Vec<GearPair<usize>>,
        elements: Vec<TrainElement>,
    ) -> Option<Self> {
        let mut train = Self { shafts, input, output, sets, pairs, elements, basis: DMatrix::zeros(0, 0) };
        let sets = train.sets.iter().map(|set| train.set_row(set));
        let pairs = train.pairs.iter().filter(|pair| pair.dog.is_none()).map(|pair| train.pair_row(pair));
        let rows: Vec<_> = sets.chain(pairs).collect();
        train.basis = null_space(&matrix(&rows, train.shafts.len()));
        (train.degrees_of_freedom() + rows.len() == train.shafts.len()).then_some(train)
    }

    /// Degrees of freedom with all elements open.
    pub fn degrees_of_freedom(&self) -> usize {
        self.basis.ncols()
    }

    /// `N`: the shaft speeds (rows) of independent motions (columns) with all elements open.
    pub fn basis(&self) -> &DMatrix<f64> {
        &self.basis
    }

    /// The slip of an element as a combination of shaft speeds.
    ///
    /// The slip of the dog of a gear pair is the speed of the loose gear less that of its shaft.
    pub fn slip_row(&self, element: usize) -> RowDVector<f64> {
        match self.elements[element].connection {
            Connection::Sides(input, output) => self.row(&[(input, 1.0), (output, -1.0)]),
            Connection::Pair(pair) => self.pair_row(&self.pairs[pair]),
        }
    }

    /// Whether two elements connect the same members.
    pub(crate) fn is_beside(&self, a: usize, b: usize) -> bool {
        match (self.elements[a].connection, self.elements[b].connection) {
            (Connection::Sides(a, b), Connection::Sides(c, d)) => (a, b) == (c, d) || (a, b) == (d, c),
            _ => false,
        }
    }

    /// Sides of a member as a row over the shafts.
    fn row(&self, terms: &[(Member, f64)]) -> RowDVector<f64> {
        let mut row = RowDVector::zeros(self.shafts.len());
        for &(member, factor) in terms {
            if let Member::Shaft(shaft) = member {
                row[shaft] += factor;
            }
        }
        row
    }

    /// Eq. (2.5) over the teeth of sun and ring together.
    fn set_row(&self, set: &PlanetarySet<Member>) -> RowDVector<f64> {
        let sun = match set.planets {
            Planets::Single => f64::from(set.sun_teeth),
            Planets::Double => -f64::from(set.sun_teeth),
        };
        let ring = f64::from(set.ring_teeth);
        self.row(&[(set.sun, sun), (set.ring, ring), (set.carrier, -(sun + ring))]) / (sun.abs() + ring)
    }

    /// Speed of the driven gear, from its mesh, less that of its shaft.
    fn pair_row(&self, pair: &GearPair<usize>) -> RowDVector<f64> {
        let ratio = f64::from(pair.driver_teeth) / f64::from(pair.driven_teeth);
        let sign = if pair.idler { 1.0 } else { -1.0 };
        self.row(&[(Member::Shaft(pair.driver), sign * ratio), (Member::Shaft(pair.driven), -1.0)])
    }

    /// The slips of these elements per motion, one row each: `K = [k_c N]`.
    pub fn slips(&self, elements: &[usize]) -> DMatrix<f64> {
        let rows: Vec<_> = elements.iter().map(|&element| self.slip_row(element)).collect();
        matrix(&rows, self.shafts.len()) * &self.basis
    }

    /// Inertia of the motions, `M = N' J N`.
    pub fn mass_kg_m2(&self) -> DMatrix<f64> {
        self.basis.transpose() * DMatrix::from_diagonal(&self.inertia()) * &self.basis
    }

    fn inertia(&self) -> DVector<f64> {
        DVector::from_iterator(self.shafts.len(), self.shafts.iter().map(|shaft| shaft.inertia_kg_m2))
    }

    /// A basis of the shaft speeds at which these elements do not slip.
    fn motions(&self, stuck: &[usize]) -> DMatrix<f64> {
        &self.basis * null_space(&self.slips(stuck))
    }

    /// How the train turns with these elements engaged.
    pub(crate) fn gear(&self, engaged: &[usize]) -> Result<GearMotion, NoGear> {
        let motions = self.motions(engaged);
        let (input, output) = (motions.row(self.input), motions.row(self.output));
        match (input.amax() < ZERO, output.amax() < ZERO) {
            (true, true) => return Err(NoGear::Locked),
            (true, false) => return Err(NoGear::InputHeld),
            (false, true) => return Err(NoGear::OutputHeld),
            (false, false) => (),
        }
        let multiple = |row: &DMatrix<f64>, of: &DMatrix<f64>| {
            let factor = row.dot(of) / of.norm_squared();
            ((row - of * factor).amax() < ZERO * (1.0 + factor.abs())).then_some(factor)
        };
        let of = |row: usize| motions.rows(row, 1).into_owned();
        let turbine = of(self.input);
        let ratio = multiple(&turbine, &of(self.output)).ok_or(NoGear::Open)?;
        let speeds = (0..self.shafts.len()).map(|shaft| multiple(&of(shaft), &turbine)).collect();
        Ok(GearMotion { ratio, speeds })
    }

    /// Static torque of each engaged element per turbine torque in a gear of this ratio, the smallest that are possible, and
    /// whether they are the only ones. `None` if the elements make no gear of this ratio.
    ///
    /// For every motion `N` the power is zero: `N' (e_in - i e_out - K' T) = 0`.
    pub fn holding_torques(&self, engaged: &[usize], ratio: f64) -> Option<(Vec<f64>, bool)> {
        let force = self.basis.row(self.input) - self.basis.row(self.output) * ratio;
        let (torques, only) = min_norm(&self.slips(engaged).transpose(), &force.transpose())?;
        Some((torques.as_slice().to_vec(), only))
    }

    /// Shaft speeds (rows) per turbine and output speed (columns) while these elements are held. `None` if the two do not
    /// determine all the others.
    pub fn speeds_in_shift(&self, held: &[usize]) -> Option<DMatrix<f64>> {
        let motions = self.motions(held);
        if motions.ncols() != 2 {
            return None;
        }
        let ends = DMatrix::from_rows(&[motions.row(self.input).into_owned(), motions.row(self.output).into_owned()]);
        if ends.determinant().abs() < ZERO {
            return None;
        }
        Some(motions * ends.try_inverse()?)
    }

    /// The motion `q` whose shaft speeds `N q` are nearest to these. `None` if there is not one speed for each shaft.
    pub fn motion(&self, shaft_speeds: &[f64]) -> Option<Vec<f64>> {
        if shaft_speeds.len() != self.shafts.len() {
            return None;
        }
        let right = self.basis.transpose() * DVector::from_row_slice(shaft_speeds);
        let motion = (self.basis.transpose() * &self.basis).cholesky()?.solve(&right);
        Some(motion.as_slice().to_vec())
    }

    /// The shift from one element to another while others are held. `None` if turbine and output speed do not determine
    /// all shaft speeds, or if an element's slip does not depend on both.
    ///
    /// With `w = P (w_t, w_0)`: `M = P' J P`, and the slip of a shift element is `k P = alpha (1, -i)`.
    pub fn reduce(&self, held: &[usize], offgoing: usize, oncoming: usize) -> Option<ReducedShift<f64>> {
        let speeds = self.speeds_in_shift(held)?;
        let mass = speeds.transpose() * DMatrix::from_diagonal(&self.inertia()) * &speeds;
        let slip = |element: usize| {
            let row = self.slip_row(element) * &speeds;
            (row[0].abs() > ZERO && row[1].abs() > ZERO).then_some([row[0], row[1]])
        };
        Some(ReducedShift {
            mass_kg_m2: [[mass[(0, 0)], mass[(0, 1)]], [mass[(1, 0)], mass[(1, 1)]]],
            slip_offgoing: slip(offgoing)?,
            slip_oncoming: slip(oncoming)?,
        })
    }
}

fn matrix(rows: &[RowDVector<f64>], columns: usize) -> DMatrix<f64> {
    if rows.is_empty() { DMatrix::zeros(0, columns) } else { DMatrix::from_rows(rows) }
}
