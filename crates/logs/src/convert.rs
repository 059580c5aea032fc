//! The channels of a log as columns of one table: decoded, and by a channel map in SI.
//!
//! A row has the values of one time; a channel that has none there is empty. Samples that are not good, such as repeated ones, are left out.

use std::fmt::Write as _;

use trace::{Unit, toml_string};

use crate::map::Resolved;
use crate::samples::Quality;
use crate::{ChannelMap, Combine, Log, LogError, Role, Sample, Samples};

/// A column of the table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ConvertedColumn {
    /// Its name: that of the channel, or that of the role with its unit.
    pub name: String,
    /// Its unit; may be empty.
    pub unit: String,
}

impl ConvertedColumn {
    /// Its title, from which readers of tables take name and unit.
    pub fn title(&self) -> String {
        match self.unit.as_str() {
            // What stands in brackets at the end of a name is no unit.
            "" if self.name.ends_with([')', ']']) => format!("{} []", self.name),
            "" => self.name.clone(),
            unit if Unit::of_name(&self.name).is_some_and(|of_name| of_name.name == unit) => self.name.clone(),
            unit => format!("{} [{unit}]", self.name),
        }
    }
}

/// What a column is made of.
struct Source {
    resolved: Option<Resolved>,
    /// Values of its channels at the time of the row.
    parts: Vec<Option<f64>>,
}

impl Source {
    /// Its value; not a number where a part is missing.
    fn value(&self) -> f64 {
        let known: Vec<f64> = self.parts.iter().flatten().copied().collect();
        let (false, Some(first)) = (known.len() < self.parts.len(), known.first()) else { return f64::NAN };
        let Some(resolved) = &self.resolved else { return *first };
        let divisor = if resolved.entry.combine == Combine::Mean { known.len() as f64 } else { 1.0 };
        let value = if known.len() == 1 { *first } else { known.iter().sum::<f64>() / divisor };
        resolved.in_si(resolved.in_unit(value))
    }
}

/// The rows of a log while it is read.
pub struct Converted<'a> {
    samples: Samples<'a>,
    columns: Vec<ConvertedColumn>,
    sources: Vec<Source>,
    /// Column and part of each channel; a channel may serve several.
    users: Vec<Vec<(usize, usize)>>,
    /// The first sample of the next row.
    next: Option<Sample>,
    row: Vec<f64>,
    left_out: u64,
}

impl<'a> Converted<'a> {
    /// All channels of a log, in its units.
    ///
    /// # Errors
    /// The log cannot be read.
    pub fn of_log(log: &'a mut Log) -> Result<Self, LogError> {
        let columns = distinct_names(log).into_iter().zip(log.channels());
        let columns = columns.map(|(name, channel)| ConvertedColumn { name, unit: channel.unit.clone() }).collect();
        let sources = log.channels().iter().map(|_| Source { resolved: None, parts: vec![None] }).collect();
        let users = (0..log.channels().len()).map(|channel| vec![(channel, 0)]).collect();
        Self::new(log, columns, sources, users)
    }

    /// The channels of a map in the units of their roles. What the map says beyond scale and unit is in [`map_of_converted`].
    ///
    /// # Errors
    /// The map does not fit the log, or the log cannot be read.
    pub fn by_map(log: &'a mut Log, map: &ChannelMap) -> Result<Self, LogError> {
        let resolved = map.resolve(log)?;
        let mut users = vec![Vec::new(); log.channels().len()];
        for (column, resolved) in resolved.iter().enumerate() {
            for (part, channel) in resolved.channels.iter().enumerate() {
                users[*channel].push((column, part));
            }
        }
        let columns = resolved.iter().map(|resolved| ConvertedColumn {
            name: column_name(&resolved.entry.key(), resolved.entry.role),
            unit: resolved.entry.role.unit().to_owned(),
        });
        let columns = columns.collect();
        let source =
            |resolved: Resolved| Source { parts: vec![None; resolved.channels.len()], resolved: Some(resolved) };
        let sources = resolved.into_iter().map(source).collect();
        Self::new(log, columns, sources, users)
    }

    fn new(
        log: &'a mut Log,
        columns: Vec<ConvertedColumn>,
        sources: Vec<Source>,
        users: Vec<Vec<(usize, usize)>>,
    ) -> Result<Self, LogError> {
        let wanted: Vec<usize> = (0..users.len()).filter(|&channel| !users[channel].is_empty()).collect();
        let row = vec![f64::NAN; columns.len()];
        Ok(Self { samples: log.samples(&wanted)?, columns, sources, users, next: None, row, left_out: 0 })
    }

    /// The columns behind the time.
    pub fn columns(&self) -> &[ConvertedColumn] {
        &self.columns
    }

    /// Samples so far that are not good and were left out.
    pub fn left_out(&self) -> u64 {
        self.left_out
    }

    /// What is to be said about the log, complete after the last row.
    pub fn notes(&self) -> &[String] {
        self.samples.notes()
    }

    /// The next row: its time, s, and the value of each column; not a number where it has none. None behind the last row.
    ///
    /// # Errors
    /// The log cannot be read.
    pub fn next_row(&mut self) -> Result<Option<(f64, &[f64])>, LogError> {
        self.clear_row();
        let mut time_s = None;
        let mut has_value = false;
        loop {
            let sample = match self.next.take() {
                Some(sample) => sample,
                None => match self.samples.next().transpose()? {
                    Some(sample) if sample.quality == Quality::Good => sample,
                    Some(_) => {
                        self.left_out += 1;
                        continue;
                    }
                    None if has_value => break,
                    None => return Ok(None),
                },
            };
            if time_s.is_some_and(|time_s| time_s != sample.time_s) {
                if has_value {
                    self.next = Some(sample);
                    break;
                }
                self.clear_row();
            }
            time_s = Some(sample.time_s);
            for &(column, part) in &self.users[sample.channel] {
                self.sources[column].parts[part] = Some(sample.value);
                self.row[column] = self.sources[column].value();
                has_value |= !self.row[column].is_nan();
            }
        }
        Ok(time_s.map(|time_s| (time_s, self.row.as_slice())))
    }

    fn clear_row(&mut self) {
        self.row.fill(f64::NAN);
        self.sources.iter_mut().for_each(|source| source.parts.fill(None));
    }
}

/// Names of the channels that are all different, and none that of the time.
fn distinct_names(log: &Log) -> Vec<String> {
    let mut taken = std::collections::HashSet::from([trace::signal::TIME.to_owned()]);
    let mut of_channel = |channel: &crate::Channel| {
        let several = log.channels().iter().filter(|other| other.name == channel.name).nth(1).is_some();
        let plain = match several && !channel.group.is_empty() {
            true => format!("{}.{}", channel.group, channel.name),
            false => channel.name.clone(),
        };
        let numbered = (2..).map(|number| format!("{plain}_{number}"));
        let name =
            std::iter::once(plain.clone()).chain(numbered).find(|name| !taken.contains(name)).unwrap_or(plain.clone());
        taken.insert(name.clone());
        name
    };
    log.channels().iter().map(&mut of_channel).collect()
}

/// The name of the column of a role: `engine_speed_rad_s`.
fn column_name(key: &str, role: Role) -> String {
    let ending = match role.unit() {
        "rad/s" => "_rad_s",
        "m/s" => "_m_s",
        "m/s^2" => "_m_s2",
        "A" => "_a",
        "%" => "_percent",
        "Pa" => "_pa",
        "N m" => "_n_m",
        "degC" => "_degc",
        _ => "",
    };
    format!("{key}{ending}")
}

/// A number with all its digits, as TOML has it.
fn exact(value: f64) -> String {
    format!("{value:?}").replace("NaN", "nan")
}

/// The channel map of a table that [`Converted::by_map`] gave: by it the table is read as the log is by `map`, which fits the log.
///
/// # Errors
/// The map does not fit the log.
pub fn map_of_converted(log: &Log, map: &ChannelMap) -> Result<String, LogError> {
    let mut text = String::new();
    for resolved in map.resolve(log)? {
        let (entry, key) = (&resolved.entry, resolved.entry.key());
        let is_bare = key.chars().all(|c| c.is_ascii_alphanumeric() || "_-".contains(c));
        let table = if is_bare { key.clone() } else { toml_string(&key) };
        let mut line = |key: &str, value: String| {
            // A string takes everything.
            let _ = writeln!(text, "{key}{value}");
        };
        line("[channel.", format!("{table}]"));
        line("name = ", toml_string(&column_name(&key, entry.role)));
        if !entry.role.unit().is_empty() {
            line("unit = ", toml_string(entry.role.unit()));
        }
        if entry.delay_s != 0.0 {
            line("delay_s = ", exact(entry.delay_s));
        }
        if entry.late_s != 0.0 {
            line("late_s = ", exact(entry.late_s));
        }
        if entry.sent_on_change {
            line("sent_on_change = ", "true".to_owned());
        }
        if let Some(range) = entry.valid_range {
            let [minimum, maximum] = range.map(|value| exact(resolved.in_si(value)));
            line("valid_range = ", format!("[{minimum}, {maximum}]"));
        }
        line("", String::new());
    }
    let gearbox = &map.gearbox;
    let numbers = [("output_rad_per_m", gearbox.output_rad_per_m), ("wheel_radius_m", gearbox.wheel_radius_m)];
    let numbers: Vec<(&str, f64)> = numbers.into_iter().filter_map(|(key, value)| Some((key, value?))).collect();
    if !gearbox.ratios.is_empty() || !numbers.is_empty() {
        text += "[gearbox]\n";
    }
    if !gearbox.ratios.is_empty() {
        let ratios: Vec<String> = gearbox.ratios.iter().map(|ratio| exact(*ratio)).collect();
        let _ = writeln!(text, "ratios = [{}]", ratios.join(", "));
    }
    for (key, value) in numbers {
        let _ = writeln!(text, "{key} = {}", exact(value));
    }
    Ok(text)
}
