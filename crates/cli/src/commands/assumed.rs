//! What a command assumes, for `-v`.

use logs::{ChannelMap, Mapped};
use wetclutch::VehicleFile;

use crate::output;

/// Says which values of a vehicle file are defaults.
pub(super) fn detail_of_vehicle(vehicle: &VehicleFile) {
    let taken = match vehicle {
        VehicleFile::Gearbox(file) => &file.defaults_taken,
        VehicleFile::OneShift(file) => &file.defaults_taken,
    };
    if !taken.is_empty() {
        let keys: Vec<&str> = taken.iter().map(|default| default.key.as_str()).collect();
        output::detail(|| format!("assumed: defaults of the vehicle file for {}", keys.join(", ")));
    }
}

/// Says which channels are which signals.
pub(super) fn detail_of_map(map: &ChannelMap) {
    if map.channels.is_empty() {
        output::detail(|| "assumed: columns with the names of signals, each in the unit at its end".to_owned());
    }
    map.channels.iter().for_each(|entry| output::detail(|| format!("{}: {}", entry.key(), described(entry))));
}

/// The channels of a signal, and what is done to their values and times.
fn described(entry: &Mapped) -> String {
    let mut text = entry.names.join(" and ");
    text += &entry.unit.as_ref().map_or_else(|| " in the unit of the log".to_owned(), |unit| format!(" in {unit}"));
    for (key, value, usual) in [
        ("scale", entry.scale, 1.0),
        ("offset", entry.offset, 0.0),
        ("delay_s", entry.delay_s, 0.0),
        ("late_s", entry.late_s, 0.0),
    ] {
        if value != usual {
            text += &format!(", {key} {value}");
        }
    }
    text
}
