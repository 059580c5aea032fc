//! Channel maps: which channel of a log is which signal.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use trace::units::Scale;
use trace::{Quantity, ShownPath as _, Unit};

use crate::{Log, LogError, OpenOptions, Role, TimeColumn, csv_log, error};

/// How several channels become one signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Combine {
    /// Their mean, as for two driven wheels.
    Mean,
    /// Their sum, as for a value in two parts.
    Sum,
}

/// The channels of one signal.
#[derive(Debug, Clone, PartialEq)]
pub struct Mapped {
    /// What they are.
    pub role: Role,
    /// The element of the gearbox, in small letters, where the role is the command or the pressure of one.
    pub element: Option<String>,
    /// Their names.
    pub names: Vec<String>,
    /// The group of them all; needed where a name stands in several.
    pub group: Option<String>,
    /// How several become one.
    pub combine: Combine,
    /// The unit, if not that of the log.
    pub unit: Option<String>,
    /// What a value is multiplied by, before it is converted.
    pub scale: f64,
    /// What is added after that, in the unit.
    pub offset: f64,
    /// How much earlier than its time stamp a value was measured, s.
    pub delay_s: f64,
    /// By how much its time stamps are too late against those of the other channels, s; negative: too early.
    pub late_s: f64,
    /// Whether a command is sent when it changes: it stands until the next sample.
    pub sent_on_change: bool,
    /// Minimum and maximum value in the unit; others are not used.
    pub valid_range: Option<[f64; 2]>,
}

impl Mapped {
    /// One channel with the unit of the log.
    pub fn new(role: Role, name: &str) -> Self {
        Self {
            role,
            element: None,
            names: vec![name.to_owned()],
            group: None,
            combine: Combine::Mean,
            unit: None,
            scale: 1.0,
            offset: 0.0,
            delay_s: 0.0,
            late_s: 0.0,
            sent_on_change: false,
            valid_range: None,
        }
    }

    /// Its name in a map.
    pub fn key(&self) -> String {
        match (&self.element, self.role) {
            (Some(element), role) => role.name().replace("NAME", element),
            (None, role) => role.name().to_owned(),
        }
    }
}

/// What is known of the gearbox without a vehicle file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Gearbox {
    /// Ratios of the forward gears, 1st first.
    pub ratios: Vec<f64>,
    /// Speed of the gearbox output per speed of the car, rad/m: final ratio over wheel radius.
    pub output_rad_per_m: Option<f64>,
    /// Rolling radius of the driven wheels, m.
    pub wheel_radius_m: Option<f64>,
}

/// Which channel of a log is which signal.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ChannelMap {
    /// The channels, one entry for each role.
    pub channels: Vec<Mapped>,
    /// What is needed to open the log.
    pub open: OpenOptions,
    /// What is known of the gearbox.
    pub gearbox: Gearbox,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMap {
    dbc: Option<PathBuf>,
    time: Option<RawTime>,
    gearbox: Option<RawGearbox>,
    #[serde(default)]
    channel: BTreeMap<String, RawChannel>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawTime {
    name: String,
    unit: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawGearbox {
    ratios: Option<Vec<f64>>,
    output_rad_per_m: Option<f64>,
    wheel_radius_m: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawChannel {
    name: Option<String>,
    names: Option<Vec<String>>,
    group: Option<String>,
    combine: Option<Combine>,
    unit: Option<String>,
    #[serde(default = "one")]
    scale: f64,
    #[serde(default)]
    offset: f64,
    #[serde(default)]
    delay_s: f64,
    #[serde(default)]
    late_s: f64,
    #[serde(default)]
    sent_on_change: bool,
    valid_range: Option<[f64; 2]>,
}

fn one() -> f64 {
    1.0
}

impl ChannelMap {
    /// Reads a map. The path of a DBC in it counts from the folder of the map.
    ///
    /// # Errors
    /// The file cannot be read, or something in it is wrong; the message has the line.
    pub fn read(path: &Path) -> Result<Self, LogError> {
        Self::of_text(path, &trace::read_text(path).map_err(LogError::io(path))?)
    }

    /// The same of the text of a file.
    ///
    /// # Errors
    /// Something in it is wrong; the message begins with file and line.
    pub fn of_text(path: &Path, text: &str) -> Result<Self, LogError> {
        let at = |(line, message): (usize, String)| LogError::map(format!("{}:{line}: {message}", path.shown()));
        let raw = raw_map(text).map_err(at)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        if let Some(wrong) = wrong_values(text, &raw).into_iter().next() {
            return Err(at(wrong));
        }
        let channels = raw.channel.into_iter().map(|(role, raw)| mapped(&role, raw));
        Ok(Self {
            channels: channels.collect::<Result<_, _>>().map_err(LogError::map)?,
            open: OpenOptions {
                dbc: raw.dbc.map(|dbc| folder.join(dbc)),
                dbc_text: None,
                time: raw.time.map(|time| TimeColumn { name: time.name, unit: time.unit }),
            },
            gearbox: raw.gearbox.map_or_else(Gearbox::default, Gearbox::from),
        })
    }

    /// The DBC that the text of a map names, also where something else in it is wrong.
    pub fn database(path: &Path, text: &str) -> Option<PathBuf> {
        let table: toml::Table = toml::from_str(text).ok()?;
        Some(path.parent().unwrap_or(Path::new("")).join(table.get("dbc")?.as_str()?))
    }

    /// All values that are wrong in the text of a map, and its units that are not known or not of their roles: lines, counted from 1, and messages.
    /// None of a text that is no TOML, or has other keys or types.
    pub fn all_wrong(text: &str) -> Vec<(usize, String)> {
        let Ok(raw) = raw_map(text) else { return Vec::new() };
        let mut wrong = wrong_values(text, &raw);
        if let Some(message) = raw.time.as_ref().and_then(|time| wrong_time(time.unit.as_deref()?)) {
            wrong.push((line_of(text, "time", "`time.unit`"), message));
        }
        let gearbox = raw.gearbox.map_or_else(Gearbox::default, Gearbox::from);
        let channels = raw.channel.into_iter().filter_map(|(role, raw)| mapped(&role, raw).ok());
        wrong.extend(channels.filter_map(|entry| {
            let message = wrong_unit(&entry, entry.unit.as_deref()?, &gearbox)?;
            let table = format!("channel.{}", entry.key());
            Some((line_of(text, &table, &format!("`{table}.unit`")), message))
        }));
        wrong.sort();
        wrong
    }

    /// Takes `SIGNAL=NAME` or `SIGNAL=NAME [UNIT]`, in place of an entry with this role.
    ///
    /// # Errors
    /// There is no such role, or no name.
    pub fn set(&mut self, text: &str) -> Result<(), LogError> {
        let wrong = || {
            LogError::map(format!(
                "`{}` is not SIGNAL=NAME\nhint: for example engine_speed=\"N_Eng [rpm]\"",
                error::shown(text)
            ))
        };
        let (role, name) = text.split_once('=').ok_or_else(wrong)?;
        let (name, unit) = csv_log::split_unit(name.trim());
        if name.is_empty() {
            return Err(wrong());
        }
        let (role, element) = known_role(role.trim()).map_err(LogError::map)?;
        let unit = Some(unit).filter(|unit| !unit.is_empty());
        self.channels.retain(|entry| entry.role != role || entry.element != element);
        self.channels.push(Mapped { unit, element, ..Mapped::new(role, &name) });
        Ok(())
    }

    /// Whether there is a channel for a role.
    pub fn has(&self, role: Role) -> bool {
        self.channels.iter().any(|entry| entry.role == role)
    }

    /// Finds the channels in a log and their units.
    ///
    /// # Errors
    /// A channel is not there or there twice, or is the speed of two shafts, or its unit is not known, or not of its role.
    pub fn resolve(&self, log: &Log) -> Result<Vec<Resolved>, LogError> {
        let resolved: Vec<Resolved> =
            self.channels.iter().map(|entry| Resolved::of(entry, log, &self.gearbox)).collect::<Result<_, _>>()?;
        one_shaft_each(&resolved, log)?;
        Ok(resolved)
    }
}

/// The line of the key that a message about a table names first, or that of the table, from 1.
fn line_of(text: &str, table: &str, message: &str) -> usize {
    let header = format!("[{table}]");
    let Some(first) = text.lines().position(|line| line.trim_start().starts_with(&header)) else { return 1 };
    let key = message.split('`').nth(1).and_then(|key| key.strip_prefix(table)?.strip_prefix('.'));
    let own = || text.lines().skip(first + 1).take_while(|line| !line.trim_start().starts_with('['));
    let is_of_key = |line: &str| key.is_some_and(|key| line.split('=').next().is_some_and(|name| name.trim() == key));
    first + 1 + own().position(is_of_key).map_or(0, |at| at + 1)
}

/// The role of a name in a map, and the element of the gearbox that it is about.
fn known_role(name: &str) -> Result<(Role, Option<String>), String> {
    let names = || Role::all().map(Role::name).collect::<Vec<_>>().join(", ");
    let of_element = Role::of_element(name).map(|(role, element)| (role, Some(element.to_lowercase())));
    of_element
        .or_else(|| Role::parse(name).map(|role| (role, None)))
        .ok_or_else(|| format!("there is no signal `{}`\nhint: the signals are {}", error::shown(name), names()))
}

/// The text of a map as TOML; or the line, counted from 1, and the message.
fn raw_map(text: &str) -> Result<RawMap, (usize, String)> {
    toml::from_str(text).map_err(|error: toml::de::Error| {
        let begin = error.span().map_or(0, |span| span.start);
        let line = 1 + text.bytes().take(begin).filter(|byte| *byte == b'\n').count();
        (line, trace::plain_type(error.message()))
    })
}

/// All values of a map that are wrong, whatever the log is: lines, counted from 1, and messages.
fn wrong_values(text: &str, raw: &RawMap) -> Vec<(usize, String)> {
    let of_channels = raw.channel.iter().flat_map(|(role, raw)| {
        let table = format!("channel.{role}");
        wrong_channel(role, raw).into_iter().map(move |message| (line_of(text, &table, &message), message))
    });
    let of_gearbox = raw.gearbox.iter().flat_map(wrong_gearbox);
    of_channels.chain(of_gearbox.map(|message| (line_of(text, "gearbox", &message), message))).collect()
}

/// All that is wrong with an entry.
fn wrong_channel(role_name: &str, raw: &RawChannel) -> Vec<String> {
    let role = match known_role(role_name) {
        Ok((role, _)) => role,
        Err(message) => return vec![message],
    };
    let key = |key: &str| format!("`channel.{role_name}.{key}`");
    let mut wrong = Vec::new();
    let names = match (&raw.name, &raw.names) {
        (Some(name), None) => std::slice::from_ref(name),
        (None, Some(names)) => names,
        _ => &[],
    };
    if names.is_empty() || names.iter().any(String::is_empty) {
        wrong.push(format!(
            "{} or {} must name the channel\nhint: name = \"N_Eng\", or names = [...] with combine = \"mean\" or \"sum\"",
            key("name"),
            key("names")
        ));
    }
    if names.len() > 1 && raw.combine.is_none() {
        wrong.push(format!(
            "{} is missing\nhint: \"mean\", as for two wheels, or \"sum\", as for a value in two parts",
            key("combine")
        ));
    }
    if raw.scale == 0.0 {
        wrong.push(format!("{} is 0", key("scale")));
    }
    let infinite = [("scale", raw.scale), ("offset", raw.offset)].into_iter().filter(|(_, value)| !value.is_finite());
    wrong.extend(infinite.map(|(name, value)| format!("{} is {value}", key(name))));
    if !(0.0..=10.0).contains(&raw.delay_s) {
        let delay = key("delay_s");
        wrong.push(format!("{delay} is {}, expected 0 to 10\nhint: it is in s: 20 ms is 0.02", raw.delay_s));
    }
    if !(-10.0..=10.0).contains(&raw.late_s) {
        let late = key("late_s");
        wrong.push(format!("{late} is {}, expected -10 to 10\nhint: it is in s: 100 ms is 0.1", raw.late_s));
    }
    if raw.sent_on_change && !(role.is_command() || role == Role::OncomingPressureCommand) {
        wrong.push(format!(
            "{} is for the commands of valves: another signal between two samples is not known\nhint: leave it out",
            key("sent_on_change")
        ));
    }
    if let Some([minimum, maximum]) = raw.valid_range
        && (minimum >= maximum || minimum.is_nan() || maximum.is_nan())
    {
        wrong.push(format!(
            "{} is [{minimum}, {maximum}], expected a smaller value first\nhint: [minimum, maximum] in the unit of the channel",
            key("valid_range")
        ));
    }
    wrong
}

/// An entry; its values are for [`wrong_channel`] to check.
fn mapped(role: &str, raw: RawChannel) -> Result<Mapped, String> {
    let (role, element) = known_role(role)?;
    Ok(Mapped {
        role,
        element,
        names: raw.name.into_iter().chain(raw.names.into_iter().flatten()).collect(),
        group: raw.group,
        combine: raw.combine.unwrap_or(Combine::Mean),
        unit: raw.unit,
        scale: raw.scale,
        offset: raw.offset,
        delay_s: raw.delay_s,
        late_s: raw.late_s,
        sent_on_change: raw.sent_on_change,
        valid_range: raw.valid_range,
    })
}

/// All that is wrong with what a map says of the gearbox.
fn wrong_gearbox(raw: &RawGearbox) -> Vec<String> {
    let ratios = match raw.ratios.as_deref() {
        Some([]) => Err("is empty\nhint: turbine speed over output speed, of the forward gears".to_owned()),
        Some(ratios) => check_ratios(ratios),
        None => Ok(()),
    };
    let of_ratios = ratios.err().map(|message| format!("`gearbox.ratios`: {message}"));
    let numbers = [("output_rad_per_m", raw.output_rad_per_m), ("wheel_radius_m", raw.wheel_radius_m)];
    let of_numbers = numbers.into_iter().filter_map(|(name, value)| {
        let value = value.filter(|value| !(0.01..=1000.0).contains(value))?;
        Some(format!(
            "`gearbox.{name}` is {value}, expected 0.01 to 1000\nhint: `output_rad_per_m` is final ratio over wheel radius, such as 12.8; `wheel_radius_m` is in m, such as 0.31"
        ))
    });
    of_ratios.into_iter().chain(of_numbers).collect()
}

/// What is wrong with a unit of the time.
fn wrong_time(unit: &str) -> Option<String> {
    let is_time = Unit::parse(unit).is_some_and(|unit| unit.quantity == Quantity::Time);
    (!is_time).then(|| format!("`time.unit` is `{}`, expected s, ms, us, ns, min or h", error::shown(unit)))
}

impl From<RawGearbox> for Gearbox {
    fn from(RawGearbox { ratios, output_rad_per_m, wheel_radius_m }: RawGearbox) -> Self {
        Self { ratios: ratios.unwrap_or_default(), output_rad_per_m, wheel_radius_m }
    }
}

/// Checks ratios of forward gears: positive, falling, told apart by at least 2 %.
///
/// # Errors
/// What is wrong with them.
pub fn check_ratios(ratios: &[f64]) -> Result<(), String> {
    if let Some(wrong) = ratios.iter().find(|ratio| !(0.1..=30.0).contains(*ratio)) {
        return Err(format!(
            "a ratio is {wrong}, expected 0.1 to 30\nhint: turbine speed over output speed, of the forward gears only"
        ));
    }
    match ratios.windows(2).find(|pair| pair[0] < 1.02 * pair[1]) {
        Some(pair) => Err(format!(
            "{} is followed by {}, expected falling ratios, lowest gear first\nhint: 1st gear has the largest ratio, such as [4.70, 3.13, 2.10]",
            pair[0], pair[1]
        )),
        None => Ok(()),
    }
}

/// An entry of a map with the channels of a log.
#[derive(Debug, Clone, PartialEq)]
pub struct Resolved {
    /// The entry.
    pub entry: Mapped,
    /// Its channels.
    pub channels: Vec<usize>,
    /// The unit as it is used, for messages.
    pub unit_name: String,
    /// What a value in the unit is multiplied by.
    size: Scale,
    /// What is added after that.
    zero: f64,
}

impl Resolved {
    fn of(entry: &Mapped, log: &Log, gearbox: &Gearbox) -> Result<Self, LogError> {
        // The message names the entry of the map, before its hint.
        let named = |error| match error {
            LogError::Map { message } => {
                LogError::map(message.replacen('\n', &format!(" for `channel.{}`\n", entry.key()), 1))
            }
            other => other,
        };
        let found = entry.names.iter().map(|name| log.find(name, entry.group.as_deref()).map_err(named));
        let channels = found.collect::<Result<Vec<_>, _>>()?;
        let units: Vec<&str> = channels.iter().map(|&i| log.channels()[i].unit.as_str()).collect();
        let text = match &entry.unit {
            Some(unit) => unit.clone(),
            None if units.windows(2).all(|pair| pair[0] == pair[1]) => units[0].to_owned(),
            None => {
                return Err(LogError::map(format!(
                    "the channels of {} have the units {}\nhint: set one in `channel.{}.unit`",
                    entry.key(),
                    units.join(" and "),
                    entry.key()
                )));
            }
        };
        let (unit_name, size, zero) =
            conversion(entry, &text, &log.channels()[channels[0]].name, gearbox).map_err(LogError::map)?;
        Ok(Self { entry: entry.clone(), channels, unit_name, size: Scale::of(size), zero })
    }

    /// A value in the channel's unit, scale and offset applied.
    pub fn in_unit(&self, value: f64) -> f64 {
        value * self.entry.scale + self.entry.offset
    }

    /// A value of [`Self::in_unit`] in the unit of the role.
    pub fn in_si(&self, value: f64) -> f64 {
        self.size.of_value(value) + self.zero
    }
}

/// Refuses a channel that is the speed of two shafts: between them it has no slip. The speed of the car may be that of its wheels.
fn one_shaft_each(resolved: &[Resolved], log: &Log) -> Result<(), LogError> {
    let shafts: Vec<&Resolved> = resolved.iter().filter(|one| one.entry.role.is_shaft_speed()).collect();
    for (i, one) in shafts.iter().enumerate() {
        for other in &shafts[i + 1..] {
            let Some(&both) = one.channels.iter().find(|channel| other.channels.contains(channel)) else { continue };
            let (name, one, other) = (error::shown(&log.channels()[both].name), one.entry.key(), other.entry.key());
            return Err(LogError::map(format!(
                "channel `{name}` is both {one} and {other}\n\
                 hint: these are speeds of two shafts; name the channel of each, and leave out the one that the log has not"
            )));
        }
    }
    Ok(())
}

/// What is wrong with the unit that a map gives, whatever the log is.
fn wrong_unit(entry: &Mapped, unit: &str, gearbox: &Gearbox) -> Option<String> {
    let (name, known) = (entry.names.first()?, Unit::parse(unit));
    if entry.role.quantity().is_none() {
        let unit = known.filter(|unit| unit.quantity != Quantity::Fraction)?;
        let key = entry.key();
        return Some(format!(
            "channel `{}` ({key}) is in {}, expected a number without a unit\nhint: leave `channel.{key}.unit` out",
            error::shown(name),
            unit.name
        ));
    }
    // The vehicle file has the radius of the wheels.
    let is_of_car = entry.role == Role::WheelSpeed && known.is_some_and(|unit| unit.quantity == Quantity::Velocity);
    if is_of_car { None } else { conversion(entry, unit, name, gearbox).err() }
}

/// Name, size and zero of the unit of a role.
fn conversion(entry: &Mapped, text: &str, channel: &str, gearbox: &Gearbox) -> Result<(String, f64, f64), String> {
    let (role, name) = (entry.role, entry.key());
    let Some(wanted) = role.quantity() else { return Ok((String::new(), 1.0, 0.0)) };
    let channel = error::shown(channel);
    if text.trim().is_empty() && wanted != Quantity::Fraction {
        return Err(format!(
            "channel `{channel}` ({name}) has no unit in the log\nhint: give it, as in `--channel {name}=\"{channel} [{}]\"` or `channel.{name}.unit`",
            role.unit()
        ));
    }
    let unit = if text.trim().is_empty() { Unit::parse("1") } else { Unit::parse(text) };
    let Some(unit) = unit else {
        return Err(format!(
            "channel `{channel}` ({name}) has the unit `{}`, which is not known\nhint: the units are {}; set one in `channel.{name}.unit`, with `channel.{name}.scale` where none fits",
            error::shown(text),
            Unit::known()
        ));
    };
    let duty = matches!(role, Role::OncomingDuty | Role::OffgoingDuty | Role::ElementDuty);
    let (size, zero) = match (role, unit.quantity) {
        // A duty cycle is in % inside.
        _ if duty && unit.quantity == Quantity::Fraction => (100.0 * unit.size, 0.0),
        _ if unit.quantity == wanted => (unit.size, unit.zero),
        (Role::WheelSpeed, Quantity::Velocity) => match gearbox.wheel_radius_m {
            Some(radius_m) => (unit.size / radius_m, 0.0),
            None => {
                return Err(format!(
                    "channel `{channel}` ({name}) is in {}, and the radius of the wheels is not known\nhint: give `gearbox.wheel_radius_m` in the channel map",
                    unit.name
                ));
            }
        },
        _ => {
            return Err(format!(
                "channel `{channel}` ({name}) is in {}, expected a unit like {}\nhint: set `channel.{name}.unit` if the log is wrong",
                unit.name,
                role.unit()
            ));
        }
    };
    Ok((unit.name.to_owned(), size, zero))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_option_replaces_an_entry_and_may_have_a_unit() {
        let mut map = ChannelMap::default();
        map.set("engine_speed=N_Eng [rpm]").unwrap();
        map.set("engine_speed = N_Mot [1/min]").unwrap();
        assert_eq!(map.channels.len(), 1);
        assert_eq!((map.channels[0].names[0].as_str(), map.channels[0].unit.as_deref()), ("N_Mot", Some("1/min")));
        let error = map.set("speed=N").unwrap_err().to_string();
        assert!(
            error.starts_with("there is no signal `speed`\nhint: the signals are engine_speed, turbine_speed"),
            "{error}"
        );
        assert!(map.set("engine_speed").is_err() && map.set("engine_speed= ").is_err());
    }

    #[test]
    fn ratios_fall_and_are_told_apart() {
        assert!(check_ratios(&[4.7, 3.1, 1.0]).is_ok() && check_ratios(&[]).is_ok());
        assert_eq!(
            check_ratios(&[3.1, 4.7]).unwrap_err(),
            "3.1 is followed by 4.7, expected falling ratios, lowest gear first\nhint: 1st gear has the largest ratio, such as [4.70, 3.13, 2.10]"
        );
        assert!(check_ratios(&[f64::NAN]).is_err() && check_ratios(&[4.0, -1.0]).is_err());
    }
}
