//! Changes of a channel map that logs ask for: delays, scales and zero offsets of channels.

use std::path::Path;

use logs::{ChannelMap, Mapped, Role};
use trace::Unit;

use crate::moved::moved;
use crate::vehicle_text::{VehicleText, keys};
use crate::verdict::SIDES;
use crate::{FitError, Known};

/// The channels that a change is for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ChangedChannel {
    /// That of a signal, by its name in a channel map.
    Signal(String),
    /// Those of the commands of all valves.
    Commands,
}

impl ChangedChannel {
    /// The signal, or `commands`.
    pub fn name(&self) -> &str {
        match self {
            Self::Signal(name) => name,
            Self::Commands => "commands",
        }
    }

    /// Whether an entry of a map is changed.
    fn has(&self, entry: &Mapped) -> bool {
        match self {
            Self::Signal(name) => entry.key() == *name,
            Self::Commands => entry.role.is_command() || entry.role == Role::OncomingPressureCommand,
        }
    }
}

/// What is changed, and by which number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MapKey {
    /// Age of a value at its time stamp: s are added.
    Delay,
    /// Error of the time stamps: s are added.
    Late,
    /// Scale: multiplied.
    Scale,
    /// Zero offset: Pa are added.
    Offset,
}

impl MapKey {
    /// Its name in a channel map.
    pub fn name(self) -> &'static str {
        match self {
            Self::Delay => "delay_s",
            Self::Late => "late_s",
            Self::Scale => "scale",
            Self::Offset => "offset",
        }
    }

    /// The unit of the number.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Delay | Self::Late => "s",
            Self::Scale => "1",
            Self::Offset => "Pa",
        }
    }
}

/// A change of a channel map.
#[derive(Debug, Clone, PartialEq)]
pub struct MapChange {
    /// Of which channels.
    pub channel: ChangedChannel,
    /// Of which key.
    pub key: MapKey,
    /// What is added, in the unit of the key; the factor of a scale.
    pub value: f64,
    /// Its standard deviation.
    pub sd: f64,
}

impl MapChange {
    /// The change for a signal whose readings are late by this, s. Time stamps that come too early are moved: an age is not negative.
    pub(crate) fn of_delay(signal: &str, late_s: &Known) -> Self {
        let key = if late_s.value > 0.0 { MapKey::Delay } else { MapKey::Late };
        Self::of_signal(signal, key, late_s.value, late_s.sd)
    }

    pub(crate) fn of_signal(signal: &str, key: MapKey, value: f64, sd: f64) -> Self {
        Self { channel: ChangedChannel::Signal(signal.to_owned()), key, value, sd }
    }

    /// The change for commands that are late by this, s.
    pub(crate) fn of_commands(late_s: &Known) -> Self {
        Self { channel: ChangedChannel::Commands, key: MapKey::Late, value: late_s.value, sd: late_s.sd }
    }

    /// What is to be done to a channel map, in words.
    pub fn instruction(&self) -> String {
        let Self { channel, key, value, .. } = self;
        match (channel, key) {
            (ChangedChannel::Commands, key) => {
                format!("add {value:.3} to `{}` of the channel of each command in the channel map", key.name())
            }
            (_, MapKey::Scale) => format!("multiply `scale` of its channel in the channel map by {value:.4}"),
            (_, MapKey::Offset) => {
                let kpa = 1e-3 * value;
                format!("add {kpa:+.1} kPa to `offset` of its channel in the channel map, in the unit of the channel")
            }
            (_, key) if *value < 0.0 => {
                format!("take {:.4} off `{}` of its channel in the channel map", -value, key.name())
            }
            (_, key) => format!("add {value:.4} to `{}` of its channel in the channel map", key.name()),
        }
    }

    /// The number with its interval, for a comment.
    fn comment(&self) -> String {
        let (value, half) = (self.value, SIDES * self.sd);
        match self.key {
            MapKey::Delay | MapKey::Late => format!("{value:+.4} +- {half:.4} s"),
            MapKey::Scale => format!("x {value:.4} +- {half:.4}"),
            MapKey::Offset => format!("{value:+.0} +- {half:.0} Pa"),
        }
    }
}

/// A channel map with changes.
#[derive(Debug, Clone, PartialEq)]
pub struct ChangedMap {
    /// Its text.
    pub text: String,
    /// Changes that it does not have, and why, in sentences.
    pub left_out: Vec<String>,
}

/// The channel map at `path` with changes, as it is to stand at `to`. Everything else in its text stays; a path of a DBC is that from the new folder.
///
/// # Errors
/// The text is that of no channel map, or the map with the changes is none.
pub fn changed_map(path: &Path, text: &str, to: &Path, changes: &[MapChange]) -> Result<ChangedMap, FitError> {
    let map = ChannelMap::of_text(path, text)?;
    let names = text.parse::<toml::Table>().ok().and_then(|mut table| table.remove("channel"));
    let names = names.iter().filter_map(toml::Value::as_table).flat_map(toml::Table::keys);
    let names: Vec<&str> = names.map(String::as_str).collect();
    let mut changed = VehicleText::new(text)?;
    let mut left_out = Vec::new();
    for change in changes {
        let entries = map.channels.iter().filter(|entry| change.channel.has(entry));
        for entry in entries {
            // The element of a command may be in capitals in the file.
            let Some(name) = names.iter().find(|name| name.eq_ignore_ascii_case(&entry.key())) else { continue };
            left_out.extend(put(&mut changed, name, entry, change)?);
        }
    }
    if let Some(dbc) = map.open.dbc.as_ref().and_then(|dbc| moved(dbc, path, to)) {
        changed.set_text(&keys(&["dbc"]), &dbc, "a path from the folder of this file")?;
    }
    let text = changed.finish();
    ChannelMap::of_text(to, &text)?;
    Ok(ChangedMap { text, left_out })
}

/// Puts a change into an entry; why not, if it cannot.
fn put(text: &mut VehicleText, name: &str, entry: &Mapped, change: &MapChange) -> Result<Option<String>, FitError> {
    let mut to = |key: MapKey, value: f64| {
        let path = |key: &str| keys(&["channel", name, key]);
        if text.has(&path(key.name())) {
            return text.set(&path(key.name()), &[value], Some(&change.comment()));
        }
        let named = if text.has(&path("name")) { "name" } else { "names" };
        text.add_beside(&path(named), key.name(), value, &change.comment())
    };
    match change.key {
        MapKey::Delay => to(MapKey::Delay, entry.delay_s + change.value)?,
        MapKey::Late => to(MapKey::Late, entry.late_s + change.value)?,
        MapKey::Scale => {
            to(MapKey::Scale, entry.scale * change.value)?;
            if entry.offset != 0.0 {
                to(MapKey::Offset, entry.offset * change.value)?;
            }
        }
        MapKey::Offset => {
            let Some(unit) = entry.unit.as_deref().and_then(Unit::parse) else {
                return Ok(Some(format!(
                    "`offset` of {name} stays: its unit is that of the log. Say it in `channel.{name}.unit`, or {}",
                    change.instruction()
                )));
            };
            to(MapKey::Offset, entry.offset + change.value / unit.size)?;
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MAP: &str = "# my map\n[channel.engine_speed]\nname = \"N\" # of the engine\ndelay_s = 0.01\n\n\
        [channel.element_A_current]\nname = \"I_A\"\n\n[channel]\nelement_b_current = { name = \"I_B\", late_s = 0.02 }\n\
        wheel_speed.names = [\"L\", \"R\"]\nwheel_speed.combine = \"mean\"\n\
        element_a_pressure = { name = \"p_A\", unit = \"bar\" }\nelement_b_pressure = { name = \"p_B\" }\n";

    fn change(channel: ChangedChannel, key: MapKey, value: f64) -> MapChange {
        MapChange { channel, key, value, sd: 0.001 }
    }

    fn signal(name: &str) -> ChangedChannel {
        ChangedChannel::Signal(name.to_owned())
    }

    /// The entry of a signal.
    fn entry<'a>(map: &'a ChannelMap, key: &str) -> &'a Mapped {
        map.channels.iter().find(|entry| entry.key() == key).unwrap()
    }

    #[test]
    fn changes_go_into_the_entries_and_all_other_text_stays() {
        // A table may not be opened twice: entries of both kinds are in maps of their own.
        let (tables, inline) = MAP.split_once("[channel]\n").unwrap();
        let inline = format!("[channel]\n{inline}");
        let changes = [
            change(signal("engine_speed"), MapKey::Delay, 0.0023),
            change(signal("wheel_speed"), MapKey::Scale, 1.01),
            change(signal("wheel_speed"), MapKey::Late, -0.004),
            change(ChangedChannel::Commands, MapKey::Late, 0.12),
            change(signal("element_a_pressure"), MapKey::Offset, -5e3),
            change(signal("element_b_pressure"), MapKey::Offset, 1e3),
        ];
        let path = Path::new("map.toml");
        let first = changed_map(path, tables, path, &changes).unwrap();
        assert_eq!(
            first.text,
            "# my map\n[channel.engine_speed]\nname = \"N\" # of the engine\n# fit: +0.0023 +- 0.0020 s; before: 0.01\ndelay_s = 0.0123\n\n\
             [channel.element_A_current]\n# fit: +0.1200 +- 0.0020 s; the file had none\nlate_s = 0.12\nname = \"I_A\"\n\n"
        );
        let second = changed_map(path, &inline, path, &changes).unwrap();
        let map = ChannelMap::of_text(path, &second.text).unwrap();
        assert!((entry(&map, "element_b_current").late_s - 0.14).abs() < 1e-9, "{}", second.text);
        let wheel = entry(&map, "wheel_speed");
        assert_eq!((wheel.scale, wheel.late_s, wheel.names.len()), (1.01, -0.004, 2));
        assert!((entry(&map, "element_a_pressure").offset + 0.05).abs() < 1e-9);
        assert_eq!(entry(&map, "element_b_pressure").offset, 0.0);
        assert!(second.left_out.len() == 1 && second.left_out[0].contains("`channel.element_b_pressure.unit`"));
        // A second fit replaces its comment, and adds to the value.
        let again = changed_map(path, &first.text, path, &changes).unwrap().text;
        assert!(again.contains("# fit: +0.0023 +- 0.0020 s; before: 0.0123\ndelay_s = 0.0146\n"), "{again}");
        assert_eq!(again.matches("# fit: ").count(), 2, "{again}");
        // Nothing to change, and no map.
        assert_eq!(changed_map(path, MAP.split_once("[channel]").unwrap().0, path, &[]).unwrap().text, tables);
        assert!(changed_map(path, "[channel.x]\nname = 3\n", path, &[]).is_err());
    }

    #[test]
    fn the_path_of_a_dbc_is_that_from_the_new_folder() {
        let folder = std::env::temp_dir().join(format!("wetclutch-map-change-{}", std::process::id()));
        std::fs::create_dir_all(folder.join("new")).unwrap();
        std::fs::write(folder.join("bus.dbc"), "").unwrap();
        let map = "dbc = \"bus.dbc\" # of the bus\n[channel.engine_speed]\nname = \"N\"\n";
        let [given, beside, far] = ["map.toml", "other.toml", "new/map.toml"].map(|name| folder.join(name));
        let text = |to: &Path| changed_map(&given, map, to, &[]).unwrap().text;
        assert_eq!(text(&beside), map);
        assert!(text(&far).contains("\ndbc = \"../bus.dbc\" # of the bus\n"), "{}", text(&far));
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn what_is_written_is_what_the_instruction_says() {
        let delay = |value| MapChange::of_delay("engine_speed", &Known { value, sd: 1e-4, before: 0.01 });
        assert_eq!(delay(0.012).instruction(), "add 0.0120 to `delay_s` of its channel in the channel map");
        assert_eq!(delay(-0.012).instruction(), "take 0.0120 off `late_s` of its channel in the channel map");
        let map = "[channel.engine_speed]\nname = \"N\"\n";
        let path = Path::new("map.toml");
        let late = changed_map(path, map, path, &[delay(-0.012)]).unwrap();
        assert_eq!(entry(&ChannelMap::of_text(path, &late.text).unwrap(), "engine_speed").late_s, -0.012);
    }
}
