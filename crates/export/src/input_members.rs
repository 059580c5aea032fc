//! The members of an input, with their places in it, for descriptions of them. The time step is none: it is that of the caller.

use std::mem::offset_of;

use ecu::{Input, Reading};
use observer::gearbox::MAX_ELEMENTS;

use crate::estimate_members::{Kind, Member};

/// All of them, in their order.
pub(crate) fn input_members() -> Vec<Member> {
    let channels = [
        ("engine_rad_s", offset_of!(Input, engine_rad_s), "rad/s", "engine speed"),
        ("turbine_rad_s", offset_of!(Input, turbine_rad_s), "rad/s", "turbine speed"),
        ("output_rad_s", offset_of!(Input, output_rad_s), "rad/s", "speed of the gearbox output"),
        ("wheel_rad_s", offset_of!(Input, wheel_rad_s), "rad/s", "speed of the driven wheels"),
        ("engine_n_m", offset_of!(Input, engine_n_m), "N m", "engine torque as the engine's controller reports it"),
        (
            "acceleration_m_s2",
            offset_of!(Input, acceleration_m_s2),
            "m/s^2",
            "longitudinal acceleration by an accelerometer, with the part of gravity along the road",
        ),
        ("oil_degc", offset_of!(Input, oil_degc), "degC", "temperature of the oil in the gearbox"),
    ];
    let mut all: Vec<Member> =
        channels.into_iter().flat_map(|(name, offset, unit, meaning)| reading(name, offset, unit, meaning)).collect();
    let whole =
        |name: &str, offset, meaning| Member { name: name.to_owned(), offset, kind: Kind::Signed, unit: "1", meaning };
    all.extend([
        whole(
            "lock_up_applied",
            offset_of!(Input, lock_up_applied),
            "1 while the lock-up clutch of the converter carries torque",
        ),
        whole(
            "gear_from",
            offset_of!(Input, gear_from),
            "place of the gear before, -1 neutral; the gear itself while there is no shift",
        ),
        whole("gear_to", offset_of!(Input, gear_to), "place of the gear after, -1 neutral"),
    ]);
    let first = offset_of!(Input, commands);
    all.extend((0..MAX_ELEMENTS).flat_map(|at| {
        reading(
            &format!("command_{at}"),
            first + at * size_of::<Reading>(),
            "1",
            "command of the valve of an element, A or %",
        )
    }));
    all
}

/// The three members of a reading.
fn reading(name: &str, offset: usize, unit: &'static str, meaning: &'static str) -> [Member; 3] {
    let part = |part: &str, offset_in: usize, kind, unit, meaning| Member {
        name: format!("{name}.{part}"),
        offset: offset + offset_in,
        kind,
        unit,
        meaning,
    };
    [
        part("value", offset_of!(Reading, value), Kind::Float, unit, meaning),
        part("age_s", offset_of!(Reading, age_s), Kind::Float, "s", "time since it was measured"),
        part("came", offset_of!(Reading, came), Kind::Signed, "1", "1 if a reading comes in each step"),
    ]
}
