//! What the values of a log add to the channel map that its names suggest: ratios in which the car was driven, and ranges without values that no car has.

use std::fmt::Write as _;
use std::path::Path;

use config::significant;
use logs::{Channel, ChannelMap, Log, Mapped, Readings, Role, SeenGears};
use trace::{Quantity, Unit};

/// Lines of comments for a suggested map, by the ranges of the values of the channels; none where the log shows nothing, or cannot be read again.
pub(super) fn by_values(path: &Path, suggested: &str, channels: &[Channel], of: &[Option<[f64; 2]>]) -> String {
    let map = ChannelMap::of_text(Path::new("map.toml"), suggested).ok().filter(|_| !of.is_empty());
    map.map_or(String::new(), |map| {
        ranges(&map, channels, of).unwrap_or_default() + &ratios(path, &map).unwrap_or_default()
    })
}

fn opened(path: &Path, map: &ChannelMap) -> Option<Log> {
    Some(Log::open(path, &map.open).ok()?.on_threads(wetclutch::available_threads()))
}

/// The ratios of turbine and output speed in which the car was driven.
fn ratios(path: &Path, map: &ChannelMap) -> Option<String> {
    /// Fewer say nothing of a gearbox.
    const FEWEST: usize = 2;
    if !(map.has(Role::TurbineSpeed) && map.has(Role::OutputSpeed)) {
        return None;
    }
    let mut log = opened(path, map)?;
    let mut seen = SeenGears::default();
    let mut readings = Readings::new(&mut log, map).ok()?;
    while let Some(reading) = readings.next_or_refused() {
        seen.push(&reading.ok()?);
    }
    let gears: Vec<String> = seen.gears().iter().map(|gear| format!("{:.3}", gear.ratio)).collect();
    (gears.len() >= FEWEST).then(|| {
        format!(
            "\n# Ratios in which the car was driven. To use them, add the gears that are missing, 1st first, and remove the number signs.\n\
             # [gearbox]\n# ratios = [{}]\n",
            gears.join(", ")
        )
    })
}

/// Ranges for the channels with values that no car has, such as those that mean that there is none.
fn ranges(map: &ChannelMap, channels: &[Channel], of: &[Option<[f64; 2]>]) -> Option<String> {
    let mut text = String::new();
    for mapped in &map.channels {
        let [name] = &mapped.names[..] else { continue };
        let is_it = |channel: &Channel| {
            channel.name == *name && mapped.group.as_ref().is_none_or(|group| *group == channel.group)
        };
        let Some(at) = channels.iter().position(is_it) else { continue };
        let found = valid(mapped, &channels[at]).zip(of.get(at).copied().flatten());
        let Some(([low, high], [minimum, maximum])) =
            found.filter(|([low, high], [minimum, maximum])| minimum < low || maximum > high)
        else {
            continue;
        };
        // Writing to a string does not fail.
        let _ = writeln!(
            text,
            "# [channel.{}] has {} to {}; to leave out what no car has, add: valid_range = [{low:.0}, {high:.0}]",
            mapped.key(),
            significant(minimum),
            significant(maximum)
        );
    }
    Some(text).filter(|text| !text.is_empty()).map(|text| format!("\n{text}"))
}

/// The values of a signal that a car has \[chosen\], in the unit of its channel.
fn valid(mapped: &Mapped, channel: &Channel) -> Option<[f64; 2]> {
    let (range, unit) = match mapped.role {
        Role::EngineSpeed | Role::TurbineSpeed => ([-100.0, 10_000.0], "rpm"),
        Role::OutputSpeed => ([-5_000.0, 10_000.0], "rpm"),
        Role::WheelSpeed => ([-500.0, 4_000.0], "rpm"),
        Role::VehicleSpeed => ([-50.0, 400.0], "km/h"),
        Role::EngineTorque => ([-1_000.0, 3_000.0], "N m"),
        Role::OilTemperature => ([-60.0, 200.0], "degC"),
        role if role.quantity() == Some(Quantity::Current) => ([-1.0, 10.0], "A"),
        _ => return None,
    };
    let of = Unit::parse(unit)?;
    let to = Unit::parse(mapped.unit.as_deref().unwrap_or(&channel.unit)).filter(|to| to.quantity == of.quantity)?;
    Some(range.map(|value| (of.to_si(value) - to.zero) / to.size))
}
