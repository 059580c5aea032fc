//! Any of the observers, built from a vehicle and an entry of an experiment file.

use car::{GainMethod, GivenGains, ObserverEntry, ObserverKind, Sensors, Vehicle};
use design::compliant::physical_gains;
use design::{
    DesignError, Model, OffsetMissed, best_compliant, best_rigid, bounded, compliant_observer, design_discrete,
    design_sliding, extended_filter, inversion, kalman_filter, open_loop_maps, range, rigid_observer, sliding_observer,
    super_twisting, unscented_filter,
};
use observer::{
    Bounds, CompliantObserver, Discretisation, Estimate, Estimator, ExtendedFilter, Input, Inversion, KalmanFilter,
    OneShiftFilter, RigidGains, RigidObserver, SlidingGains, SlidingObserver, SuperTwisting, Tracker, UnscentedFilter,
    one_shift_filter,
};

use crate::{EstimateColumns, RunColumns, run};

/// One of the observers.
#[derive(Debug, Clone, PartialEq)]
pub enum AnyObserver {
    /// Rigid reduced-order observer; with zero gains, the open loop.
    Rigid(RigidObserver<f64>),
    /// Reduced-order observer with elastic drive shafts.
    Compliant(Box<CompliantObserver<f64>>),
    /// Full-order sliding-mode observer.
    Sliding(SlidingObserver<f64>),
    /// Gearbox filter.
    Gearbox(Box<OneShiftFilter<f64>>),
    /// Kalman filter.
    Kalman(Box<KalmanFilter<f64>>),
    /// Extended Kalman filter in its textbook form.
    Extended(Box<ExtendedFilter<f64>>),
    /// Unscented Kalman filter.
    Unscented(Box<UnscentedFilter<f64>>),
    /// Super-twisting observer.
    SuperTwisting(Box<SuperTwisting<f64>>),
    /// Direct inversion.
    Inversion(Box<Inversion<f64>>),
}

impl AnyObserver {
    /// The observer of this kind for this sample time, with designed gains and exact discretisation. `sensors` are the
    /// sensors of its signals, if they are known.
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
        let (observer, missed) = Self::best(vehicle, kind, method, sample_time_s, sensors)?;
        match missed.into_iter().next() {
            None => Ok(observer),
            Some(missed) => Err(DesignError::OffsetUnreachable(Box::new(missed))),
        }
    }

    /// The same with the best certified gain where a required offset cannot be had, and what is missed.
    ///
    /// # Errors
    /// There is no certified gain.
    pub fn best(
        vehicle: &Vehicle,
        kind: ObserverKind,
        method: GainMethod,
        sample_time_s: f64,
        sensors: Option<&Sensors>,
    ) -> Result<(Self, Vec<OffsetMissed>), DesignError> {
        // Over a longer step than its certificate covers, an observer is its valve model.
        let mut missed = Vec::new();
        let observer = match kind {
            ObserverKind::OpenLoop => Self::Rigid(rigid_observer(vehicle, RigidGains::open_loop())),
            ObserverKind::Rigid if method == GainMethod::Iss => {
                let (design, not_met) = best_rigid(vehicle)?;
                missed = not_met;
                let mut observer = rigid_observer(vehicle, design.gains());
                observer.tracker.sample_max_s = design.longest_step_s(vehicle, Discretisation::Exact);
                Self::Rigid(observer)
            }
            ObserverKind::Compliant if method == GainMethod::Iss => {
                let (design, not_met) = best_compliant(vehicle)?;
                missed = not_met;
                let mut observer = compliant_observer(vehicle, design.gains());
                observer.tracker.sample_max_s = design.longest_step_s(vehicle, Discretisation::Exact);
                Self::Compliant(Box::new(observer))
            }
            ObserverKind::Rigid => {
                let design = design_discrete(vehicle, Model::Rigid, method, sample_time_s)?;
                let mut observer = rigid_observer(vehicle, design.rigid_gains());
                observer.tracker.sample_max_s = design.longest_step_s();
                Self::Rigid(observer)
            }
            ObserverKind::Compliant => {
                let design = design_discrete(vehicle, Model::Compliant, method, sample_time_s)?;
                let mut observer = compliant_observer(vehicle, design.compliant_gains());
                observer.tracker.sample_max_s = design.longest_step_s();
                Self::Compliant(Box::new(observer))
            }
            ObserverKind::OpenLoopMaps => Self::Kalman(Box::new(open_loop_maps(vehicle))),
            ObserverKind::Gearbox => Self::Gearbox(Box::new(one_shift_filter(vehicle, sensors))),
            ObserverKind::Kalman => Self::Kalman(Box::new(kalman_filter(vehicle, sensors))),
            ObserverKind::Extended => Self::Extended(Box::new(extended_filter(vehicle, sensors))),
            ObserverKind::Unscented => Self::Unscented(Box::new(unscented_filter(vehicle, sensors))),
            ObserverKind::SuperTwisting => Self::SuperTwisting(Box::new(super_twisting(vehicle))),
            ObserverKind::Inversion => Self::Inversion(Box::new(inversion(vehicle))),
            ObserverKind::Sliding => Self::Sliding(sliding_observer(vehicle, design_sliding(vehicle))),
        };
        Ok((observer, missed))
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
            Some(GivenGains::Rigid { torque_phase_pa_s_rad, inertia_phase_pa_s_rad }) => {
                let gains = RigidGains { torque_phase_pa_s_rad, inertia_phase_pa_s_rad };
                Self::Rigid(rigid_observer(vehicle, gains))
            }
            Some(GivenGains::Sliding {
                torque_speed_rad_s2,
                torque_pressure_pa_s,
                inertia_speed_rad_s2,
                inertia_pressure_pa_s,
            }) => {
                let gains = SlidingGains {
                    torque_speed_rad_s2,
                    torque_pressure_pa_s,
                    inertia_speed_rad_s2,
                    inertia_pressure_pa_s,
                };
                Self::Sliding(sliding_observer(vehicle, gains))
            }
            Some(GivenGains::CompliantNormalised(torque, inertia)) => {
                Self::Compliant(Box::new(compliant_observer(vehicle, physical_gains(&torque, &inertia))))
            }
        };
        Ok(observer.with_discretisation(entry.discretisation))
    }

    /// Takes the discretisation of an observer with a fixed sample time; the Kalman filters are always exact.
    fn with_discretisation(mut self, discretisation: Discretisation) -> Self {
        if let Some(tracker) = self.tracker_mut() {
            tracker.discretisation = discretisation;
        }
        self
    }

    fn tracker_mut(&mut self) -> Option<&mut Tracker<f64>> {
        match self {
            Self::Rigid(observer) => Some(&mut observer.tracker),
            Self::Compliant(observer) => Some(&mut observer.tracker),
            Self::Sliding(observer) => Some(&mut observer.tracker),
            Self::Gearbox(_) | Self::Kalman(_) => None,
            Self::Extended(observer) => Some(&mut observer.tracker),
            Self::Unscented(observer) => Some(&mut observer.filter.tracker),
            Self::SuperTwisting(observer) => Some(&mut observer.tracker),
            Self::Inversion(observer) => Some(&mut observer.tracker),
        }
    }

    /// Longest time between two samples over which the speeds correct its estimate, s.
    pub fn sample_max_s(&self) -> f64 {
        self.clone().tracker_mut().map_or(observer::LOST_S, |tracker| tracker.sample_max_s)
    }

    /// The columns of its estimates of a log. They follow from what it can estimate, before it has estimated anything.
    pub fn columns(&self, has_wheel_speed: bool) -> EstimateColumns {
        let shaft = match self {
            Self::Compliant(_)
            | Self::Gearbox(_)
            | Self::Kalman(_)
            | Self::Extended(_)
            | Self::Unscented(_)
            | Self::Inversion(_) => true,
            Self::Rigid(_) | Self::Sliding(_) | Self::SuperTwisting(_) => false,
        };
        EstimateColumns { shaft, range: true, shaft_range: has_wheel_speed }
    }

    /// Runs it over every sample; one estimate for each, with a guaranteed range where this vehicle's error budget
    /// gives one.
    pub fn run(&self, vehicle: &Vehicle, columns: &RunColumns<'_>) -> Vec<Estimate<f64>> {
        self.run_in_memory(Some(vehicle), columns)
    }

    /// The same without a range.
    pub fn run_alone(&self, columns: &RunColumns<'_>) -> Vec<Estimate<f64>> {
        self.run_in_memory(None, columns)
    }

    fn run_in_memory(&self, budget: Option<&Vehicle>, columns: &RunColumns<'_>) -> Vec<Estimate<f64>> {
        let samples = columns.samples();
        let mut estimates = Vec::with_capacity(samples.len());
        let Ok(()) = self.run_over(budget, samples, |(), estimate| {
            estimates.push(estimate);
            Ok(())
        });
        estimates
    }

    /// Runs it over samples from anywhere, see [`run()`], with a guaranteed range where the error budget of a vehicle
    /// gives one.
    ///
    /// # Errors
    /// Those of the samples and of `take`.
    pub fn run_over<S, E>(
        &self,
        budget: Option<&Vehicle>,
        samples: impl Iterator<Item = Result<(Input<f64>, S), E>>,
        take: impl FnMut(S, Estimate<f64>) -> Result<(), E>,
    ) -> Result<(), E> {
        run(samples, self.start(budget), take)
    }

    /// The observer before its first sample: a function that makes a step, and gives the guaranteed range with it where the error budget of a
    /// vehicle is given.
    fn start(&self, budget: Option<&Vehicle>) -> Stepping<'_> {
        match self {
            Self::Rigid(observer) => start(budget, observer),
            Self::Compliant(observer) => start(budget, observer.as_ref()),
            Self::Sliding(observer) => start(budget, observer),
            Self::Gearbox(observer) => start(budget, observer.as_ref()),
            Self::Kalman(observer) => start(budget, observer.as_ref()),
            Self::Extended(observer) => start(budget, observer.as_ref()),
            Self::Unscented(observer) => start(budget, observer.as_ref()),
            Self::SuperTwisting(observer) => start(budget, observer.as_ref()),
            Self::Inversion(observer) => start(budget, observer.as_ref()),
        }
    }
}

/// A step of an observer that runs. It has no type parameters, so that there is one copy of an observer's code whatever it is run over.
type Stepping<'a> = Box<dyn FnMut(&Input<f64>) -> Estimate<f64> + 'a>;

/// The ranges at every sample, the same for every observer.
pub fn ranges(vehicle: &Vehicle, columns: &RunColumns<'_>) -> Vec<Bounds<f64>> {
    let estimator = range(vehicle);
    let mut state = estimator.start();
    columns
        .samples()
        .map(|sample| {
            let Ok((input, ())) = sample;
            estimator.step(&mut state, &input)
        })
        .collect()
}

fn start<'a, O: Estimator<f64>>(budget: Option<&Vehicle>, observer: &'a O) -> Stepping<'a> {
    fn stepping<'a, O: Estimator<f64, State: 'a> + 'a>(observer: O) -> Stepping<'a> {
        let mut state = observer.start();
        Box::new(move |input| observer.step(&mut state, input))
    }
    match budget {
        Some(vehicle) => stepping(bounded(vehicle, observer)),
        None => stepping(observer),
    }
}
