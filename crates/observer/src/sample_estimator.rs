//! Observers with a fixed sample time.

use crate::{Estimate, Sample, Tracker};

/// An observer that needs all signals at one time. As a [`crate::Estimator`] it gets them from [`crate::Alignment`].
pub trait SampleEstimator<T> {
    /// What it remembers from one sample to the next.
    type SampleState;

    /// Whether it reads the speed of the driven wheels.
    const READS_WHEEL: bool;

    /// Whether it needs the engine speed. One that does not takes the turbine speed in its place where none comes: a converter that
    /// does not slip.
    #[inline]
    fn needs_engine(&self) -> bool {
        true
    }

    /// Its checks, valve and phase.
    fn tracker(&self) -> &Tracker<T>;

    /// Its memory before the first sample.
    fn start_sample(&self) -> Self::SampleState;

    /// Takes one sample and returns the estimate at its time. Never panics; allocates nothing.
    fn step_sample(&self, state: &mut Self::SampleState, sample: &Sample<T>) -> Estimate<T>;
}
