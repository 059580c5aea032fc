//! All signals at one time, from readings that come when they come.

use drivetrain::{Real, ReducedShift};

use crate::{
    Aligned, ChannelHealth, Channels, CompliantObserver, Estimate, Estimator, ExtendedFilter, Health, Input,
    InputLimits, Inversion, LOST_S, Reading, RigidObserver, Sample, SampleEstimator, SlidingObserver, SuperTwisting,
    UnscentedFilter,
};

/// For how long a speed that does not come is carried on by its last change, s.
const CARRIED_S: f64 = 0.05;

/// The newest readings of a speed.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Speed<T> {
    last: Option<Reading<T>>,
    /// How much it changed from the reading before, and in which time: rad/s and s.
    change: [T; 2],
}

/// Memory of an [`Alignment`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AlignmentState<T> {
    engine: Speed<T>,
    turbine: Speed<T>,
    output: Speed<T>,
    wheel: Speed<T>,
    command: Option<Reading<T>>,
}

/// Brings all channels to the time of the step: a speed of which no reading came, or an old one, is carried on by a line
/// through its last two readings for up to 50 ms \[chosen\]. A command stands until the next one, for up to [`LOST_S`].
///
/// Readings of the moment pass unchanged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alignment<'a, T> {
    /// Kinematics of the shift.
    pub shift: &'a ReducedShift<T>,
    /// What counts as a measurement.
    pub limits: &'a InputLimits<T>,
}

impl<T: Real> AlignmentState<T> {
    /// Nothing has come yet.
    pub fn new() -> Self {
        let none = Speed { last: None, change: [T::zero(); 2] };
        Self { engine: none, turbine: none, output: none, wheel: none, command: None }
    }

    /// How far turbine and output speed now are from their last reading but one, rad/s; none before the second one of each.
    #[inline]
    pub(crate) fn since_the_one_before(&self) -> Option<[T; 2]> {
        Some([self.turbine.since_the_one_before()?, self.output.since_the_one_before()?])
    }
}

impl<T: Real> Default for AlignmentState<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Real> Speed<T> {
    /// How fast it changed between the last two readings, rad/s^2; none if they are far apart.
    #[inline]
    fn rate(&self) -> T {
        let [change, time_s] = self.change;
        if time_s > T::zero() && time_s <= T::of(CARRIED_S) { change / time_s } else { T::zero() }
    }

    #[inline]
    fn since_the_one_before(&self) -> Option<T> {
        let [change, time_s] = self.change;
        let last = self.last.filter(|_| time_s > T::zero())?;
        Some(change + last.age_s * self.rate())
    }

    /// Takes what came of it, `dt_s` after the step before. Returns its value now, NaN if there is none.
    #[inline]
    fn take(&mut self, dt_s: T, reading: Option<Reading<T>>, limits: &InputLimits<T>) -> (T, ChannelHealth) {
        let last = self.last.map(|last| Reading { age_s: last.age_s + dt_s, ..last });
        self.last = last;
        let mut health = ChannelHealth::Absent;
        if let Some(reading) = reading {
            // A reading from before the last one came too late to tell anything.
            let newer = last.is_none_or(|last| reading.age_s <= last.age_s);
            let usable = limits.speed_valid(reading.value) && reading.age_s >= T::zero() && newer;
            health = if usable { ChannelHealth::Good } else { ChannelHealth::Refused };
            if usable {
                self.change =
                    last.map_or([T::zero(); 2], |last| [reading.value - last.value, last.age_s - reading.age_s]);
                self.last = Some(reading);
            }
        }
        match self.last {
            Some(last) if last.age_s <= T::zero() => (last.value, health),
            Some(last) if last.age_s <= T::of(CARRIED_S) => (last.value + last.age_s * self.rate(), health),
            // A refused reading says more than that there is none.
            _ if health == ChannelHealth::Refused => (T::nan(), health),
            _ => (T::nan(), ChannelHealth::Lost),
        }
    }
}

impl<T: Real> Alignment<'_, T> {
    /// All signals at the time of a step.
    #[inline]
    pub fn step(&self, state: &mut AlignmentState<T>, input: &Input<T>) -> Aligned<T> {
        let zero = T::zero();
        let possible = input.dt_s >= zero && input.dt_s.is_finite();
        let dt_s = if possible { input.dt_s } else { T::infinity() };
        let limits = self.limits;
        let (engine_rad_s, engine) = state.engine.take(dt_s, input.engine_rad_s, limits);
        // What has never come is in no channel, and an observer may do without.
        let has_come = state.engine.last.is_some() || input.engine_rad_s.is_some();
        let engine = if has_come { engine } else { ChannelHealth::Unused };
        let (turbine_rad_s, turbine) = state.turbine.take(dt_s, input.turbine_rad_s, limits);
        let (output_rad_s, output) = state.output.take(dt_s, input.output_rad_s, limits);
        let (wheel_rad_s, wheel) = state.wheel.take(dt_s, input.wheel_rad_s, limits);
        let standing = state.command.map(|last| Reading { age_s: last.age_s + dt_s, ..last });
        state.command = standing.filter(|last| last.age_s <= T::of(LOST_S));
        let command = match input.command {
            Some(reading) => match limits.possible_command(reading.value) {
                Some(value) => {
                    state.command = Some(Reading { value, ..reading });
                    ChannelHealth::Good
                }
                None => ChannelHealth::Refused,
            },
            None if state.command.is_some() => ChannelHealth::Absent,
            None => ChannelHealth::Lost,
        };
        let taken = state.command.filter(|_| command != ChannelHealth::Refused);
        let sample = Sample {
            dt_s: input.dt_s,
            engine_rad_s,
            turbine_rad_s,
            slip_rad_s: self.shift.oncoming_slip(turbine_rad_s, output_rad_s),
            wheel_rad_s,
            command: taken.map_or_else(T::nan, |reading| reading.value),
        };
        let unused = ChannelHealth::Unused;
        let channels = Channels {
            engine,
            turbine,
            output,
            wheel,
            command,
            offgoing_command: unused,
            engine_torque: unused,
            acceleration: unused,
        };
        Aligned { sample, channels }
    }
}

/// Memory of a [`SampleEstimator`] that is used as an [`Estimator`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AlignedState<T, S> {
    alignment: AlignmentState<T>,
    observer: S,
}

/// A step of an observer that needs all signals at one time.
#[inline]
fn step_observer<T: Real, O: SampleEstimator<T>>(
    observer: &O,
    state: &mut O::SampleState,
    aligned: &Aligned<T>,
) -> Estimate<T> {
    let Aligned { mut sample, mut channels } = *aligned;
    if !observer.needs_engine() {
        if sample.engine_rad_s.is_nan() {
            sample.engine_rad_s = sample.turbine_rad_s;
        }
    } else if channels.engine == ChannelHealth::Unused {
        channels.engine = ChannelHealth::Lost;
    }
    let mut estimate = observer.step_sample(state, &sample);
    estimate.channels = channels;
    if !O::READS_WHEEL {
        estimate.channels.wheel = ChannelHealth::Unused;
    }
    if estimate.channels.each().contains(&ChannelHealth::Refused) {
        estimate.health = estimate.health.max(Health::ReadingRefused);
    }
    estimate
}

macro_rules! estimators {
    ($($observer:ident),*) => {$(
        impl<T: Real> Estimator<T> for $observer<T> {
            type State = AlignedState<T, <Self as SampleEstimator<T>>::SampleState>;

            fn start(&self) -> Self::State {
                AlignedState { alignment: AlignmentState::new(), observer: self.start_sample() }
            }

            #[inline]
            fn step(&self, state: &mut Self::State, input: &Input<T>) -> Estimate<T> {
                let tracker = self.tracker();
                let alignment = Alignment { shift: &tracker.shift, limits: &tracker.limits };
                let aligned = alignment.step(&mut state.alignment, input);
                step_observer(self, &mut state.observer, &aligned)
            }

            #[inline]
            fn step_aligned(&self, state: &mut Self::State, _input: &Input<T>, aligned: &Aligned<T>) -> Estimate<T> {
                step_observer(self, &mut state.observer, aligned)
            }
        }
    )*};
}

estimators!(
    RigidObserver,
    CompliantObserver,
    SlidingObserver,
    ExtendedFilter,
    UnscentedFilter,
    SuperTwisting,
    Inversion
);
