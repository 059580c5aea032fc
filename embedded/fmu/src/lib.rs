//! The shared library in every FMU of an observer: one for all cars, which reads the parameters of its car from
//! `resources/parameters.bin`.
//!
//! A step of the co-simulation is a step of the observer with the inputs as they stand. Variables are the words of input and estimate: the
//! reference of a variable is [`observer::INPUTS`] or [`observer::ESTIMATES`] and the place of its word.
#![no_std]

extern crate alloc;

mod fmi2;
mod fmi3;
mod instance;
mod log;
mod observer;
mod system;

/// The model of this library.
type Model = observer::ObserverModel;

/// By this name among its functions `wetclutch export` knows the model of the library.
#[unsafe(no_mangle)]
extern "C" fn wetclutch_fmu() {}
