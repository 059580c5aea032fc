//! The shared library in every FMU of a simulated car: one for all cars, which reads vehicle, gearbox and shift schedule of its car from the
//! files in `resources`. The functions of the standard are those of the FMU of an observer (`embedded/fmu`).

extern crate alloc;

mod driven_car;
#[path = "../../fmu/src/fmi2.rs"]
mod fmi2;
#[path = "../../fmu/src/fmi3.rs"]
mod fmi3;
#[path = "../../fmu/src/instance.rs"]
mod instance;
#[path = "../../fmu/src/log.rs"]
mod log;

/// The model of this library.
type Model = driven_car::DrivenCar;

/// By this name among its functions `wetclutch export` knows the model of the library.
#[unsafe(no_mangle)]
extern "C" fn wetclutch_car_fmu() {}
