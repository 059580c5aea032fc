//! Driving in a gear, between shifts: mass and road load, and the reported engine torque beside a converter.
//!
//! Where the engine pulls, the readings of a stretch in one gear show two torque balances, of car and of engine:
//!
//! ```text
//! J w_o' = i (T_t - drag) - T_w/i_df - C_A R^3 w_o^2/i_df^3 - m g (R/i_df) sin(grade)      J = m R^2/i_df^2 + I_w/i_df^2 + J_gear
//! I_e w_e' = k T_reported(t - delay) - C(w_t/w_e) w_e^2
//! ```
//!
//! The grade is not measured: it is a disturbance that changes over the way ([`whitening`]), so that only what changes faster than a road does
//! tells of the car. A driver who pulls does not brake; what a brake takes in overrun is in no log, and overrun is not used.
//!
//! Both fits use it: that of a car with a gearbox, and that of one shift. What they call an unknown, the balances know as a [`Term`].

pub(crate) mod backlash;
mod car;
mod known;
mod lines;
mod model;
mod recorder;
mod skew;
mod stretch;
mod twist;
mod usable;
mod wheel;
mod whitening;

pub use backlash::BacklashFit;
pub(crate) use backlash::fit_backlash;
pub(crate) use car::DrivenCar;
pub use known::Known;
pub(crate) use known::{MIN_DELAY_S, MIN_SCALE, change_of_delay, said_of_delay};
pub(crate) use model::{Balance, DrivingModel, DrivingWeights, Evaluated};
pub(crate) use recorder::{DrivingRecorder, RowState};
pub use skew::SkewFit;
pub(crate) use skew::turns_by;
pub use stretch::Driving;
pub(crate) use twist::InputTorque;
pub(crate) use usable::{Usable, usable};
pub use wheel::WheelFit;
pub(crate) use wheel::fit_wheel;

/// What the torque at the gearbox input has beside its model: drag of the open elements, N m \[chosen\], and a fraction of the torque by the shape of the
/// converter's maps \[chosen, as in the filter\].
pub(crate) const DRAG_SD_N_M: f64 = 1.0;
pub(crate) const INPUT_SD_FRACTION: f64 = 0.03;
/// Unit of the unknown of a drag, N m.
pub(crate) const DRAG_UNIT_N_M: f64 = 1.0;
/// Step for the derivatives by a delay in its unit.
pub(crate) const DELAY_STEP: f64 = 0.1;
/// Errors, in the standard deviations that they are expected to have, beyond which a balance is not that of the car \[chosen\].
const MISFIT: f64 = 3.0;

/// Bounds of rolling resistance and air drag \[chosen\].
pub(crate) const ROLLING: f64 = 0.5;
pub(crate) const AIR: f64 = 0.3;
/// Minimum standard deviations of rolling resistance, as a mean grade over the weight, and of air drag, as a fraction \[chosen: a mean
/// wind\].
pub(crate) const MEAN_GRADE_RAD: f64 = 0.005;
pub(crate) const WIND: f64 = 0.1;

/// What an unknown of a fit is in the balances.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Term {
    /// Capacity of the converter; without a converter the reported engine torque.
    Input,
    /// Relative change of the capacity at a point of its shape.
    Capacity(usize),
    /// Torque ratio of the converter above 1.
    TorqueRatio,
    /// Without a converter the delay of the reported engine torque.
    InputDelay,
    /// Peak of the drag of an element.
    Drag(usize),
    /// A part of the inertia of a gear.
    Inertia(usize),
    /// Mass of the car.
    Mass,
    /// Rolling resistance.
    Rolling,
    /// Air drag.
    Air,
    /// Beside a converter: what the reported engine torque has to be multiplied with.
    ReportedScale,
    /// Its delay.
    ReportedDelay,
    /// Inertia of the engine in front of a converter.
    EngineInertia,
}

/// The place of a term among the unknowns of a fit; none where the fit does not have it.
pub(crate) type Places<'a> = &'a dyn Fn(Term) -> Option<usize>;

/// Why a balance with errors of this scale, in the standard deviations that they are expected to have, is not that of the car, if so.
pub(crate) fn misfit(name: &str, scale: f64) -> Option<String> {
    // What is not a number does not fit either.
    let fits = scale <= MISFIT;
    (!fits).then(|| {
        format!(
            "the torques on the {name} do not explain its speed: the errors are {scale:.1} times what grade and maps explain"
        )
    })
}

/// Minimum standard deviation of the logarithm of the rolling resistance of a car: a mean grade acts like it.
pub(crate) fn rolling_floor(road: &drivetrain::RoadLoad<f64>) -> f64 {
    let weight_n_m = road.mass_kg * drivetrain::road::GRAVITY_M_S2 * road.wheel_radius_m;
    MEAN_GRADE_RAD * weight_n_m / road.rolling_moment_n_m.max(f64::MIN_POSITIVE)
}
