//! Driving between the shifts of the logs, in the fit of one shift.
//!
//! It adds the torque balance of the car in the gears before and after the shift ([`crate::driving`]) to the normal equations of the shifts. As each shift
//! has a mass of its own, so has each log: a deviation that is eliminated.

use car::{Shaft, Vehicle};
use drivetrain::Real;
use nalgebra::{DMatrix, DVector};

use crate::driving::{DrivenCar, Driving, DrivingModel, DrivingWeights, Evaluated, Term, misfit, usable};
use crate::parameters::{POSSIBLE, Prior};
use crate::shape::Map;
use crate::shift_model::MASS_FRACTION_SD;
use crate::{FitError, Parameter};

/// The balance of the car alone: the shifts have the reported engine torque.
const USES: [bool; 2] = [true, false];

/// The driving that is used of the logs, and why that of the others is not.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct UsedDriving<'a> {
    logs: Vec<&'a Driving>,
    /// Those of another car.
    others: Vec<&'a Driving>,
    pub(crate) left_out: Vec<String>,
}

impl<'a> UsedDriving<'a> {
    /// Of logs that are long enough. The same drive says what it has to say once.
    pub(crate) fn of(car: &DrivenCar, logs: &'a [Driving]) -> Self {
        let mut used = Self { logs: Vec::new(), others: Vec::new(), left_out: Vec::new() };
        for log in logs.iter().filter(|log| log.time_s() > 0.0) {
            match usable(car, log).car {
                Err(reason) => used.left_out.push(format!("{}{reason}", log.shown())),
                Ok(()) if used.logs.iter().any(|other| other.is_same(log)) => {
                    used.left_out.push(format!("{}the same drive again", log.shown()));
                }
                Ok(()) => used.logs.push(log),
            }
        }
        used
    }

    /// Time of it, s.
    pub(crate) fn time_s(&self) -> f64 {
        self.logs.iter().map(|log| log.time_s()).sum()
    }

    /// Whether a log has turned out to be of another car.
    pub(crate) fn is_of_other_car(&self, log: &Driving) -> bool {
        self.others.contains(&log)
    }

    /// Leaves out the logs that are not of the car of the shifts; whether there is one.
    pub(crate) fn leave_out(&mut self, errors: &[DriveErrors]) -> bool {
        let before = self.logs.len();
        let mut kept = Vec::new();
        for (log, errors) in self.logs.drain(..).zip(errors) {
            match errors.reason_against() {
                None => kept.push(log),
                Some(reason) => {
                    self.others.push(log);
                    self.left_out.push(format!("{}{reason}", log.shown()));
                }
            }
        }
        self.logs = kept;
        self.logs.len() < before
    }
}

/// How far a drive is from what is expected of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct DriveErrors {
    /// Scale of its errors: 1 where they are as large as expected.
    scale: f64,
    /// Deviation of the logarithm of its mass from that of the car.
    mass: f64,
}

impl DriveErrors {
    /// Why it is not that of the car, if so.
    fn reason_against(self) -> Option<String> {
        let mass = self.mass / MASS_FRACTION_SD;
        let other = || format!("its car has {:.2} times the mass of that of the shifts", Real::exp(self.mass));
        misfit("car", self.scale).or_else(|| (mass.abs() > POSSIBLE).then(other))
    }
}

/// The car of a vehicle file in the gears before and after its shift.
pub(crate) fn driven_car(vehicle: &Vehicle, shafts: &[Shaft]) -> DrivenCar {
    DrivenCar::of_shift(vehicle, &shafts.iter().map(|shaft| shaft.mass_kg_m2).collect::<Vec<_>>())
}

/// The driving of each log as a model.
pub(crate) struct Drives<'a>(Vec<DrivingModel<'a>>);

/// What a drive adds to the normal equations of the parameters, its own mass eliminated.
pub(crate) struct DriveNormal {
    pub(crate) information: DMatrix<f64>,
    /// Half the gradient.
    pub(crate) score: DVector<f64>,
    /// Information about its own mass and half the gradient by it; that about the mass and each parameter.
    own: [f64; 2],
    mixed: DVector<f64>,
}

impl DriveNormal {
    /// The deviation of the mass after a fraction of its own step and a step of the parameters.
    pub(crate) fn stepped(&self, deviation: f64, step: &DVector<f64>, fraction: f64) -> f64 {
        deviation - (fraction * self.own[1] + self.mixed.dot(step)) / self.own[0]
    }

    /// What its own step takes away of the cost.
    pub(crate) fn own_decrease(&self) -> f64 {
        0.5 * self.own[1] * self.own[1] / self.own[0]
    }
}

impl<'a> Drives<'a> {
    pub(crate) const NONE: Self = Self(Vec::new());

    pub(crate) fn of(car: &'a DrivenCar, used: &UsedDriving<'a>) -> Self {
        Self(used.logs.iter().map(|log| DrivingModel::new(car, log, USES)).collect())
    }

    /// Deviations of the mass where a fit starts.
    pub(crate) fn start(&self) -> Vec<f64> {
        vec![0.0; self.0.len()]
    }

    /// Each drive about unknowns.
    fn evaluated(&self, priors: &[Prior], at: [&[f64]; 2], weights: &[DrivingWeights]) -> Vec<Evaluated> {
        let weights = weights.iter().copied().chain(std::iter::repeat(DrivingWeights::START));
        let each = self.0.iter().zip(with_own_mass(priors, at)).zip(weights);
        each.map(|((drive, at), weights)| {
            drive.evaluated(&|term| place(priors, term), &at, [weights, DrivingWeights::START])
        })
        .collect()
    }

    /// Half the robust sum of squares at shared unknowns and deviations of the mass.
    pub(crate) fn cost(&self, priors: &[Prior], at: [&[f64]; 2], weights: &[DrivingWeights]) -> f64 {
        let drives = self.evaluated(priors, at, weights);
        let data = drives.iter().map(|drive| drive.cost).sum::<f64>();
        data + 0.5 * at[1].iter().map(|deviation| Real::powi(deviation / MASS_FRACTION_SD, 2)).sum::<f64>()
    }

    /// What each drive adds to the normal equations.
    ///
    /// # Errors
    /// The mass is no parameter.
    pub(crate) fn normal(
        &self,
        priors: &[Prior],
        at: [&[f64]; 2],
        weights: &[DrivingWeights],
    ) -> Result<Vec<DriveNormal>, FitError> {
        let drives = self.evaluated(priors, at, weights);
        let normal = |(drive, deviation): (&Evaluated, &f64)| {
            let mass = place(priors, Term::Mass).ok_or_else(|| FitError::Work("the mass is not fitted".to_owned()))?;
            let precision = Real::powi(MASS_FRACTION_SD, -2);
            let own = drive.information[(mass, mass)] + precision;
            let own_gradient = precision * deviation - drive.score[mass];
            let mixed = drive.information.column(mass).into_owned();
            Ok(DriveNormal {
                information: &drive.information - &mixed * mixed.transpose() / own,
                score: -&drive.score - &mixed * (own_gradient / own),
                own: [own, own_gradient],
                mixed,
            })
        };
        drives.iter().zip(at[1]).map(normal).collect()
    }

    /// Weights that the errors of each drive ask for.
    pub(crate) fn following(&self, priors: &[Prior], at: [&[f64]; 2]) -> Vec<DrivingWeights> {
        let each = self.0.iter().zip(with_own_mass(priors, at));
        each.map(|(drive, at)| drive.following(&|term| place(priors, term), &at)[0]).collect()
    }

    /// How far each drive is from what is expected of it.
    pub(crate) fn errors(&self, priors: &[Prior], at: [&[f64]; 2], weights: &[DrivingWeights]) -> Vec<DriveErrors> {
        let drives = self.evaluated(priors, at, weights);
        let errors = |(drive, mass): (&Evaluated, &f64)| DriveErrors { scale: drive.scales()[0], mass: *mass };
        drives.iter().zip(at[1]).map(errors).collect()
    }
}

/// The unknowns of each drive: the shared ones with its own mass.
fn with_own_mass<'b>(priors: &[Prior], [shared, own]: [&'b [f64]; 2]) -> impl Iterator<Item = Vec<f64>> + 'b {
    let mass = place(priors, Term::Mass);
    own.iter().map(move |deviation| {
        let mut at = shared.to_vec();
        if let Some(mass) = mass {
            at[mass] += deviation;
        }
        at
    })
}

/// The place of a term among the parameters.
fn place(priors: &[Prior], term: Term) -> Option<usize> {
    let parameter = match term {
        Term::Input => Parameter::Capacity,
        Term::Capacity(number) => Parameter::Shape(Map::Capacity, number),
        Term::TorqueRatio => Parameter::TorqueRatio,
        Term::Inertia(shaft) => Parameter::Inertia(shaft),
        Term::Mass => Parameter::Mass,
        Term::Rolling => Parameter::Rolling,
        Term::Air => Parameter::Air,
        Term::InputDelay | Term::Drag(_) | Term::ReportedScale | Term::ReportedDelay | Term::EngineInertia => {
            return None;
        }
    };
    priors.iter().position(|prior| prior.parameter == parameter)
}
