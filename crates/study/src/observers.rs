//! Any of the observers, built from a vehicle and an entry of an experiment file.

use config::{GainMethod, GivenGains, ObserverEntry, ObserverKind, Sensors, Vehicle};
use design::compliant::physical_gains;
use design::{
    DesignError, Model, bounded, compliant_observer, design_compliant, design_discrete, design_rigid, design_sliding,
    extended_filter, inversion, kalman_filter, rigid_observer, sliding_observer, super_twisting, unscented_filter,
};
use drivetrain::Valve;
use observer::{
    CompliantObserver, Discretisation, Estimate, Estimator, Inversion, KalmanFilter, RigidGains, RigidObserver,
    SlidingObserver, SuperTwisting, Tracker, UnscentedFilter,
};

use crate::{RunColumns, run};

/// One of the observers.
#[derive(Debug, Clone, PartialEq)]
pub enum AnyObserver {
    /// Rigid reduced-order observer; with zero gains, the open loop.
    Rigid(RigidObserver<f64>),
    /// Reduced-order observer with elastic drive shafts.
    Compliant(Box<CompliantObserver<f64>>),
    /// Full-order sliding-mode observer.
    Sliding(SlidingObserver<f64>),
    /// Kalman filter.
    Kalman(Box<KalmanFilter<f64>>),
    /// Unscented Kalman filter.
    Unscented(Box<UnscentedFilter<f64>>),
    /// Super-twisting observer.
    SuperTwisting(Box<SuperTwisting<f64>>),
    /// Direct inversion.
    Inversion(Box<Inversion<f64>>),
}

impl AnyObserver {
    /// The observer of this kind for this sample time, with designed gains and exact discretisation. `sensors` are what
    /// it is told of the sensors that it sees through, if it does.
    ///
    /// # Errors
    /// There are no gains for what the vehicle file requires.
    pub fn designed(
        vehicle: &Vehicle,
        kind: ObserverKind,
        method: GainMethod,
        sample_time_s: f64,
        sensors: Option<&Sensors>,
    ) -> Result<Self, DesignError> {
        Ok(match kind {
            ObserverKind::OpenLoop => Self::Rigid(rigid_observer(vehicle, RigidGains::open_loop())),
            ObserverKind::Rigid if method == GainMethod::Iss => {
                Self::Rigid(rigid_observer(vehicle, design_rigid(vehicle)?.gains()))
            }
            ObserverKind::Compliant if method == GainMethod::Iss => {
                Self::Compliant(Box::new(compliant_observer(vehicle, design_compliant(vehicle)?.gains())))
            }
            // These gains are made for a sample time, and serve over one lost sample too.
            ObserverKind::Rigid => {
                let design = design_discrete(vehicle, Model::Rigid, method, sample_time_s)?;
                let mut observer = rigid_observer(vehicle, design.rigid_gains());
                observer.tracker.sample_max_s = 2.0 * sample_time_s;
                Self::Rigid(observer)
            }
            ObserverKind::Compliant => {
                let design = design_discrete(vehicle, Model::Compliant, method, sample_time_s)?;
                let mut observer = compliant_observer(vehicle, design.compliant_gains());
                observer.tracker.sample_max_s = 2.0 * sample_time_s;
                Self::Compliant(Box::new(observer))
            }
            ObserverKind::Kalman => Self::Kalman(Box::new(kalman_filter(vehicle, sensors))),
            ObserverKind::Extended => Self::Kalman(Box::new(extended_filter(vehicle, sensors))),
            ObserverKind::Unscented => Self::Unscented(Box::new(unscented_filter(vehicle, sensors))),
            ObserverKind::SuperTwisting => Self::SuperTwisting(Box::new(super_twisting(vehicle))),
            ObserverKind::Inversion => Self::Inversion(Box::new(inversion(vehicle))),
            ObserverKind::Sliding => Self::Sliding(sliding_observer(vehicle, design_sliding(vehicle))),
        })
    }

    /// The observer that an entry of an experiment file describes.
    ///
    /// # Errors
    /// Gains are to be designed, and there are none for what the vehicle file requires.
    pub fn of(vehicle: &Vehicle, entry: &ObserverEntry, sensors: Option<&Sensors>) -> Result<Self, DesignError> {
        let observer = match entry.gains {
            None => Self::designed(
                vehicle,
                entry.kind,
                entry.method,
                entry.sample_time_s,
                sensors.filter(|_| entry.real_sensors),
            )?,
            Some(GivenGains::Rigid(gains)) => Self::Rigid(rigid_observer(vehicle, gains)),
            Some(GivenGains::Sliding(gains)) => Self::Sliding(sliding_observer(vehicle, gains)),
            Some(GivenGains::CompliantNormalised(torque, inertia)) => {
                Self::Compliant(Box::new(compliant_observer(vehicle, physical_gains(&torque, &inertia))))
            }
        };
        Ok(observer.with_discretisation(entry.discretisation))
    }

    fn with_discretisation(mut self, discretisation: Discretisation) -> Self {
        self.tracker_mut().discretisation = discretisation;
        self
    }

    fn tracker_mut(&mut self) -> &mut Tracker<f64> {
        match self {
            Self::Rigid(observer) => &mut observer.tracker,
            Self::Compliant(observer) => &mut observer.tracker,
            Self::Sliding(observer) => &mut observer.tracker,
            Self::Kalman(observer) => &mut observer.tracker,
            Self::Unscented(observer) => &mut observer.filter.tracker,
            Self::SuperTwisting(observer) => &mut observer.tracker,
            Self::Inversion(observer) => &mut observer.tracker,
        }
    }

    /// Longest time between two samples over which the speeds correct its estimate, s.
    pub fn sample_max_s(&self) -> f64 {
        self.clone().tracker_mut().sample_max_s
    }

    /// Runs it over every sample; one estimate for each, with a guaranteed range where this vehicle's error budget
    /// gives one.
    pub fn run(&self, vehicle: &Vehicle, columns: &RunColumns<'_>) -> Vec<Estimate<f64>> {
        self.run_within(Some(vehicle), columns)
    }

    /// The same without a range.
    pub fn run_alone(&self, columns: &RunColumns<'_>) -> Vec<Estimate<f64>> {
        self.run_within(None, columns)
    }

    fn run_within(&self, budget: Option<&Vehicle>, columns: &RunColumns<'_>) -> Vec<Estimate<f64>> {
        match self {
            Self::Rigid(observer) => run_bounded(budget, columns, observer),
            Self::Compliant(observer) => run_bounded(budget, columns, observer.as_ref()),
            Self::Sliding(observer) => run_bounded(budget, columns, observer),
            Self::Kalman(observer) => run_bounded(budget, columns, observer.as_ref()),
            Self::Unscented(observer) => run_bounded(budget, columns, observer.as_ref()),
            Self::SuperTwisting(observer) => run_bounded(budget, columns, observer.as_ref()),
            Self::Inversion(observer) => run_bounded(budget, columns, observer.as_ref()),
        }
    }
}

fn run_bounded(
    budget: Option<&Vehicle>,
    columns: &RunColumns<'_>,
    observer: &impl Estimator<f64>,
) -> Vec<Estimate<f64>> {
    // The budget is of a valve that is commanded by a current.
    match budget.filter(|vehicle| matches!(vehicle.observer_valve, Valve::Proportional { .. })) {
        Some(vehicle) => run(columns, &bounded(vehicle, observer)),
        None => run(columns, observer),
    }
}
