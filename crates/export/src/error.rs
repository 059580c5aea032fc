//! Why a car cannot be exported.

use thiserror::Error;

/// Why a car cannot be exported.
#[derive(Debug, Error)]
pub enum ExportError {
    /// There are more clutches than the filter has room for.
    #[error("the gearbox has {elements} clutches and brakes, and the filter has room for {most}")]
    TooManyElements {
        /// How many there are.
        elements: usize,
        /// How many may be.
        most: usize,
    },
    /// The car has no such shift.
    #[error("{0}")]
    Shift(String),
    /// No shift of the car has equations.
    #[error("the filter has no tables for {}\nhint: `wetclutch check` lists the shifts from one clutch to another", of_shift(.0.as_deref()))]
    NoShift(Option<String>),
    /// A number cannot be written in single precision.
    #[error(
        "`{name}` is {value} in single precision, which the controller would refuse\nhint: two breakpoints of a map may be too near to each other"
    )]
    Single {
        /// Name of the parameter.
        name: String,
        /// What it is.
        value: String,
    },
    /// A file is no linked program.
    #[error("not a program that can be read: {0}\nhint: give the linked program of the controller, an ELF file")]
    Program(String),
    /// The parameters are not in a program.
    #[error(
        "`{0}` is not in the program\nhint: link wetclutch_CAR_parameters.c of this car, and use it, so that the linker keeps it"
    )]
    NotInProgram(String),
    /// The parameters in a program are others.
    #[error(
        "`{0}` of the program is of another car or version: the first difference is `{1}`\nhint: export again into the folder that the program is built from"
    )]
    OtherParameters(String, String),
    /// A file is not the C of the observer, or that of another version.
    #[error(
        "not the C of the observer: {0}\nhint: wetclutch.c is in the archive of each release, and embedded/portable/build makes it from the sources of this version"
    )]
    CSource(String),
    /// A file is no library of a model.
    #[error(
        "not a shared library of a model: {0}\nhint: it is built from the sources of wetclutch: cargo build --release --locked --manifest-path embedded/fmu/Cargo.toml --target-dir target; that of the car by embedded/car_fmu/Cargo.toml"
    )]
    Library(String),
    /// Two libraries are for the same platform.
    #[error("two shared libraries of a model are for {0}\nhint: give one for each platform")]
    PlatformTwice(&'static str),
    /// The shift of the self-test cannot be simulated.
    #[error("the shift {shift} of the self-test cannot be simulated: {message}")]
    SelfTest {
        /// Which shift.
        shift: String,
        /// Why.
        message: String,
    },
}

fn of_shift(shift: Option<&str>) -> String {
    shift.map_or_else(|| "any shift of this car".to_owned(), |shift| format!("the shift {shift}"))
}
