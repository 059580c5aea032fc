//! The members of an estimate, with their places in it, for descriptions of them.

use std::mem::offset_of;

use ecu::{Clutch, Estimate};
use observer::gearbox::MAX_ELEMENTS;

/// What a member is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// A number.
    Float,
    /// A place, or -1.
    Signed,
    /// Bits.
    Unsigned,
    /// The phase of a shift.
    Phase,
    /// The health of the estimate.
    Health,
    /// What became of a channel.
    Channel,
}

/// A member of an estimate.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Member {
    /// Its name; of an array with its place.
    pub(crate) name: String,
    /// Its place in the estimate, bytes.
    pub(crate) offset: usize,
    pub(crate) kind: Kind,
    pub(crate) unit: &'static str,
    pub(crate) meaning: &'static str,
}

/// All of them, in their order.
pub(crate) fn members() -> Vec<Member> {
    let one = |name: &str, offset, kind, unit, meaning| Member { name: name.to_owned(), offset, kind, unit, meaning };
    let array = |name: &str, count: usize, offset: usize, (kind, unit, meaning): (Kind, &'static str, &'static str)| {
        let name = name.to_owned();
        (0..count).map(move |at| Member { name: format!("{name}_{at}"), offset: offset + 4 * at, kind, unit, meaning })
    };
    use Kind::{Channel, Float, Health, Phase, Signed, Unsigned};
    let mut all = vec![
        one("status", offset_of!(Estimate, status), Unsigned, "1", "status, 0 if everything is right"),
        one("given", offset_of!(Estimate, given), Unsigned, "1", "bits of what is given"),
        one("health", offset_of!(Estimate, health), Health, "1", "health of the estimate"),
        one("gear_from", offset_of!(Estimate, gear_from), Signed, "1", "place of the gear before"),
        one("gear_to", offset_of!(Estimate, gear_to), Signed, "1", "place of the gear after"),
        one("phase", offset_of!(Estimate, phase), Phase, "1", "phase of the shift"),
    ];
    for (clutch, at) in [("offgoing", offset_of!(Estimate, offgoing)), ("oncoming", offset_of!(Estimate, oncoming))] {
        let of_clutch = [
            ("element", offset_of!(Clutch, element), Signed, "1", "place of the element"),
            ("flags", offset_of!(Clutch, flags), Unsigned, "1", "bits: holds 1, hidden 2, range 4"),
            ("pressure_pa", offset_of!(Clutch, pressure_pa), Float, "Pa", "cylinder pressure"),
            ("torque_n_m", offset_of!(Clutch, torque_n_m), Float, "N m", "torque"),
            ("std_dev_n_m", offset_of!(Clutch, std_dev_n_m), Float, "N m", "standard deviation of the torque"),
            (
                "pressure_std_dev_pa",
                offset_of!(Clutch, pressure_std_dev_pa),
                Float,
                "Pa",
                "standard deviation of the pressure",
            ),
            ("valve_pa", offset_of!(Clutch, valve_pa), Float, "Pa", "pressure by valve and piston alone"),
            (
                "open_loop_n_m",
                offset_of!(Clutch, open_loop_n_m),
                Float,
                "N m",
                "torque by valve, piston and friction alone",
            ),
        ];
        all.extend(of_clutch.map(|(name, offset, kind, unit, meaning)| {
            one(&format!("{clutch}_{name}"), at + offset, kind, unit, meaning)
        }));
        let range = |name: &str, offset, unit| {
            array(&format!("{clutch}_{name}"), 2, at + offset, (Float, unit, "guaranteed range"))
        };
        all.extend(range("pressure_range_pa", offset_of!(Clutch, pressure_range_pa), "Pa"));
        all.extend(range("torque_range_n_m", offset_of!(Clutch, torque_range_n_m), "N m"));
    }
    all.extend([
        one("flare_rad_s", offset_of!(Estimate, flare_rad_s), Float, "rad/s", "flare at the turbine"),
        one("turbine_n_m", offset_of!(Estimate, turbine_n_m), Float, "N m", "torque at the gearbox input"),
        one("shaft_n_m", offset_of!(Estimate, shaft_n_m), Float, "N m", "torque of the drive shafts"),
    ]);
    for (name, count, offset, what) in [
        (
            "input_clutch_n_m",
            2,
            offset_of!(Estimate, input_clutch_n_m),
            (Float, "N m", "clutch at the engine: torque, standard deviation"),
        ),
        (
            "at_turbine_n_m",
            2,
            offset_of!(Estimate, at_turbine_n_m),
            (Float, "N m", "all clutches at the turbine: torque, standard deviation"),
        ),
        ("element_pa", MAX_ELEMENTS, offset_of!(Estimate, element_pa), (Float, "Pa", "pressure by valve and piston")),
        (
            "element_range_pa",
            2 * MAX_ELEMENTS,
            offset_of!(Estimate, element_range_pa),
            (Float, "Pa", "guaranteed range of the pressure"),
        ),
        (
            "channels",
            6,
            offset_of!(Estimate, channels),
            (Channel, "1", "engine, turbine, output, wheel, engine torque, acceleration"),
        ),
        ("commands", MAX_ELEMENTS, offset_of!(Estimate, commands), (Channel, "1", "command of an element")),
    ] {
        all.extend(array(name, count, offset, what));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_members_fill_the_estimate() {
        let places: Vec<usize> = members().iter().map(|member| member.offset).collect();
        assert_eq!(places, (0..size_of::<Estimate>()).step_by(4).collect::<Vec<_>>());
    }
}
