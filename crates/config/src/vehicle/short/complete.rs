//! A short file and its defaults as one text, and which defaults those are.

use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::check::Check;
use crate::{ConfigError, Source};

/// A value that a file leaves out.
#[derive(Debug, Clone, PartialEq)]
pub struct DefaultTaken {
    /// Its key with its tables.
    pub key: String,
    /// The value as it stands in a file.
    pub value: String,
    /// The value as numbers: one, or those of a list.
    pub numbers: Vec<f64>,
}

/// Keys of short files only.
const FACTS: [&str; 2] = ["gear_train.ratios", "engine.max_torque_n_m"];

/// Lists that are of one length: who gives one gives all. `*` is any name.
const TOGETHER: [(&str, &[&str]); 6] = [
    ("engine.torque", &["throttle", "speed_rad_s", "torque_n_m"]),
    ("converter", &["speed_ratio", "capacity_n_m_s2", "torque_ratio"]),
    ("clutch.*.friction", &["slip_rad_s", "coefficient"]),
    ("clutch.*.valve.lag", &["pressure_pa", "time_constant_s"]),
    ("clutch.*.valve.gain", &["current_a", "gain_pa_a"]),
    ("clutch.*.valve.delay", &["delay_s"]),
];

/// A value with its key and its place in the text.
pub(super) struct Leaf<'t, 'd> {
    pub(super) key: String,
    pub(super) place: Range<usize>,
    pub(super) value: &'t DeValue<'d>,
}

/// The value at a path of tables.
pub(super) fn find<'t, 'd>(table: &'t DeTable<'d>, path: &[&str]) -> Option<&'t DeValue<'d>> {
    let (first, rest) = path.split_first()?;
    let value = table.get(*first)?.get_ref();
    match (rest, value) {
        ([], value) => Some(value),
        (rest, DeValue::Table(table)) => find(table, rest),
        _ => None,
    }
}

/// The number that a value is.
pub(super) fn number_of(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Float(number) => number.as_str().parse().ok(),
        DeValue::Integer(number) => i32::from_str_radix(number.as_str(), number.radix()).ok().map(f64::from),
        _ => None,
    }
}

/// Refuses a list without those that belong to it, and a gear train beside its ratios.
pub(super) fn check_lists(source: &Source) -> Result<(), ConfigError> {
    let (table, check) = (source.table()?, Check::of(source));
    let given = leaves(table.get_ref());
    for leaf in &given {
        let in_train = leaf.key.strip_prefix("gear_train.").filter(|key| *key != "ratios");
        if let Some(key) = in_train {
            let message = format!("`gear_train.ratios` replaces the whole gear train, and `{key}` is a part of one");
            let hint = "`wetclutch init --complete` writes a file with a gear train to change".to_owned();
            return Err(check.meaning(&leaf.key, leaf.place.start, message, Some(hint)));
        }
        let (parent, name) = leaf.key.rsplit_once('.').unwrap_or(("", &leaf.key));
        let group = TOGETHER.iter().find(|(table, names)| is_like(table, parent) && names.contains(&name));
        let lacks = |other: &&&str| !given.iter().any(|leaf| leaf.key == format!("{parent}.{other}"));
        if let Some(missing) = group.and_then(|(_, names)| names.iter().find(lacks)) {
            let message = format!("belongs to `{missing}`, which this file leaves out");
            let hint = format!("give all of them in [{parent}], or none");
            return Err(check.meaning(&leaf.key, leaf.place.start, message, Some(hint)));
        }
    }
    Ok(())
}

/// Whether a table's name is that of a pattern.
fn is_like(pattern: &str, table: &str) -> bool {
    let (pattern, table) = (pattern.split('.'), table.split('.'));
    pattern.clone().count() == table.clone().count() && pattern.zip(table).all(|(p, t)| p == "*" || p == t)
}

/// The text of the defaults with the values of the file in place of its own, and the defaults that are left.
pub(super) fn complete(defaults: &Source, own: &Source) -> Result<(String, Vec<DefaultTaken>), ConfigError> {
    let (below, above) = (defaults.table()?, own.table()?);
    let (below, above) = (leaves(below.get_ref()), leaves(above.get_ref()));
    let mut edits: Vec<(Range<usize>, String)> = Vec::new();
    let mut added: Vec<(String, String)> = Vec::new();
    for leaf in above.iter().filter(|leaf| !FACTS.contains(&leaf.key.as_str())) {
        let text = own.text[leaf.place.clone()].to_owned();
        match below.iter().find(|default| default.key == leaf.key) {
            Some(default) => edits.push((default.place.clone(), text)),
            None => {
                let (table, name) = leaf.key.rsplit_once('.').unwrap_or(("", &leaf.key));
                let line = format!("{name} = {text}\n");
                match defaults.text.find(&format!("\n[{table}]\n")) {
                    Some(header) => {
                        let at = header + table.len() + "\n[]\n".len();
                        edits.push((at..at, line));
                    }
                    None => match added.iter_mut().find(|(there, _)| there == table) {
                        Some((_, lines)) => *lines += &line,
                        None => added.push((table.to_owned(), line)),
                    },
                }
            }
        }
    }
    edits.sort_by_key(|(place, _)| std::cmp::Reverse(place.start));
    let mut text = defaults.text.clone();
    for (place, value) in edits {
        text.replace_range(place, &value);
    }
    for (table, lines) in added {
        text += &format!("\n[{table}]\n{lines}");
    }
    let is_given = |default: &Leaf<'_, '_>| above.iter().any(|leaf| leaf.key == default.key);
    let taken =
        below.iter().filter(|default| !is_given(default) && !default.key.starts_with("gear_train.planetary_set"));
    Ok((text, taken.filter_map(|leaf| taken_of(leaf, &defaults.text)).collect()))
}

/// A default with numbers; none where it is a name.
pub(super) fn taken_of(leaf: &Leaf<'_, '_>, text: &str) -> Option<DefaultTaken> {
    let numbers = match leaf.value {
        DeValue::Array(rows) => {
            rows.iter().map(|row| number_of(row.get_ref())).collect::<Option<_>>().unwrap_or_default()
        }
        value => vec![number_of(value)?],
    };
    let value = text[leaf.place.clone()].split_whitespace().collect::<Vec<_>>().join(" ");
    Some(DefaultTaken { key: leaf.key.clone(), value, numbers })
}

/// All values that are no tables; an item of a list of tables is called by its name, or counted.
pub(super) fn leaves<'t, 'd>(table: &'t DeTable<'d>) -> Vec<Leaf<'t, 'd>> {
    let mut found = Vec::new();
    collect(table, "", &mut found);
    found
}

fn collect<'t, 'd>(table: &'t DeTable<'d>, above: &str, found: &mut Vec<Leaf<'t, 'd>>) {
    for (name, value) in table {
        take(value, format!("{above}{}", name.get_ref()), found);
    }
}

fn take<'t, 'd>(value: &'t Spanned<DeValue<'d>>, key: String, found: &mut Vec<Leaf<'t, 'd>>) {
    match value.get_ref() {
        DeValue::Table(inner) => collect(inner, &format!("{key}."), found),
        DeValue::Array(items) if items.iter().any(|item| item.get_ref().is_table()) => {
            for (i, item) in items.iter().enumerate() {
                let name = match item.get_ref() {
                    DeValue::Table(inner) => match inner.get("name").map(Spanned::get_ref) {
                        Some(DeValue::String(name)) => name.to_string(),
                        _ => i.to_string(),
                    },
                    _ => i.to_string(),
                };
                take(item, format!("{key}.{name}"), found);
            }
        }
        other => found.push(Leaf { key, place: value.span(), value: other }),
    }
}
