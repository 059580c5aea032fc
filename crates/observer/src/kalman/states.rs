//! The states of the filter, and the times of its steps.

pub(super) const N: usize = 13;
pub(super) const TURBINE: usize = 0;
pub(super) const OUTPUT: usize = 1;
pub(super) const WHEEL: usize = 2;
pub(super) const SPRING: usize = 3;
pub(super) const PRESSURE: usize = 4;
pub(super) const OFFGOING: usize = 5;
pub(super) const LOAD: usize = 6;
pub(super) const FRACTION: usize = 7;
pub(super) const FRICTION: usize = 8;
pub(super) const GAIN: usize = 9;
pub(super) const SCALE: usize = 10;
pub(super) const DELAY: usize = 11;
pub(super) const SKEW: usize = 12;

/// What the filter learns and keeps from shift to shift.
pub(super) const LEARNT: [usize; 5] = [FRICTION, GAIN, SCALE, DELAY, SKEW];

/// Longest time that is predicted at once, s; a longer one is cut.
pub(super) const PIECE_S: f64 = 0.0125;
/// How old the first readings may be, s.
pub(super) const FIRST_S: f64 = 0.05;

/// Names and units of the filter's states, in their order.
pub const STATES: [(&str, &str); N] = [
    ("turbine speed", "rad/s"),
    ("output speed", "rad/s"),
    ("wheel speed", "rad/s"),
    ("spring torque of the shafts", "N m"),
    ("pressure", "Pa"),
    ("torque of the offgoing clutch", "N m"),
    ("load of the wheels", "N m"),
    ("relative error of the turbine torque", "1"),
    ("relative error of the friction", "1"),
    ("relative error of the valve gain", "1"),
    ("scale of the wheel speed", "1"),
    ("delay of the wheel speed", "s"),
    ("delay of the output speed against the turbine speed", "s"),
];
