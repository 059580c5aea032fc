//! The stages of an estimate in a browser, which has no threads: one after the other, for each item.

use std::marker::PhantomData;

use crate::Error;

/// Where stages run: here.
pub(crate) struct Stages;

/// Runs work stage by stage.
pub(crate) fn with_stages<R>(_: usize, work: impl FnOnce(&Stages) -> Result<R, Error>) -> Result<R, Error> {
    work(&Stages)
}

/// The items of a stage before this one.
pub(crate) struct ReadAhead<F>(F);

impl<T, F: FnMut() -> Result<Option<T>, Error>> ReadAhead<F> {
    /// `next` gives the next item, and none behind the last.
    pub(crate) fn new(_: &Stages, next: F) -> Self {
        Self(next)
    }
}

impl<T, F: FnMut() -> Result<Option<T>, Error>> Iterator for ReadAhead<F> {
    type Item = Result<T, Error>;

    fn next(&mut self) -> Option<Self::Item> {
        (self.0)().transpose()
    }
}

/// A stage behind this one.
pub(crate) struct WriteBehind<T, F>(F, PhantomData<T>);

impl<T, F: FnMut(&mut T) -> Result<(), Error>> WriteBehind<T, F> {
    /// `write` takes each item.
    pub(crate) fn new(_: &Stages, write: F) -> Self {
        Self(write, PhantomData)
    }

    /// Hands an item on.
    pub(crate) fn push(&mut self, mut item: T) -> Result<(), Error> {
        (self.0)(&mut item)
    }

    /// All items are taken.
    pub(crate) fn finish(self) -> Result<(), Error> {
        Ok(())
    }
}
