//! A first channel map from names and units.

mod words;

use std::fmt::Write as _;

use trace::{Quantity, Unit};

use self::words::{ACTUAL, CLUTCH, CURRENT, TABLE, TARGET, Words};
use crate::{Channel, Role, error};

/// The words of a name: divided at signs, before capitals and at the ends of numbers, in small letters.
fn words(name: &str) -> Vec<String> {
    let plain = name
        .replace('ä', "ae")
        .replace('ö', "oe")
        .replace('ü', "ue")
        .replace('Ä', "Ae")
        .replace('Ö', "Oe")
        .replace('Ü', "Ue")
        .replace('ß', "ss");
    let mut words = vec![String::new()];
    let mut before = ' ';
    for c in plain.chars() {
        let starts = c.is_uppercase() && before.is_lowercase() || c.is_ascii_digit() != before.is_ascii_digit();
        if (starts || !c.is_alphanumeric()) && words.last().is_some_and(|word| !word.is_empty()) {
            words.push(String::new());
        }
        if c.is_alphanumeric()
            && let Some(word) = words.last_mut()
        {
            word.extend(c.to_lowercase());
        }
        before = c;
    }
    words.retain(|word| !word.is_empty());
    words
}

fn met(list: &[&str], words: &[String]) -> bool {
    list.iter().any(|wanted| match wanted.strip_suffix('*') {
        Some(start) => words.iter().any(|word| word.starts_with(start)),
        None => words.iter().any(|word| word == wanted),
    })
}

/// How well a channel fits a role; none if not at all.
fn fit(entry: &Words, channel: &Channel) -> Option<Fit> {
    let words = words(&channel.name);
    let joined = words.concat();
    let is_one_of = |names: &[&str]| names.iter().any(|name| name.replace('_', "") == joined);
    let (exact, vague) = (is_one_of(entry.exact), is_one_of(entry.vague));
    if met(entry.none, &words) || !(exact || vague || entry.all.iter().all(|list| met(list, &words))) {
        return None;
    }
    let unit = Unit::parse(&channel.unit).filter(|_| !channel.unit.trim().is_empty());
    // A short name is the speed of a car only by its unit: `v` may be a voltage.
    if entry.role == Role::VehicleSpeed && vague && !exact && unit.is_none() {
        return None;
    }
    // A percentage by its name, where the log does not say the unit.
    let is_fraction = unit.is_none() && met(&["percent", "pct", "prozent"], &words);
    let unit_fits = match (entry.role.quantity(), unit) {
        (None, None) => 2,
        (None, Some(unit)) if unit.quantity == Quantity::Fraction => 2,
        (Some(wanted), Some(unit)) if wanted == unit.quantity => 4,
        (Some(Quantity::Rotation), Some(unit))
            if entry.role == Role::WheelSpeed && unit.quantity == Quantity::Velocity =>
        {
            3
        }
        (Some(Quantity::Torque), None) if is_fraction => return Some(Fit::Fraction),
        (Some(_), None) => 1,
        // Per cent of a torque that the name does not tell.
        (Some(Quantity::Torque), Some(unit)) if unit.quantity == Quantity::Fraction => return Some(Fit::Fraction),
        _ => return None,
    };
    let score = match (exact, vague) {
        (true, _) => unit_fits + 4,
        (_, true) => unit_fits - 1,
        _ => unit_fits + 1,
    };
    Some(Fit::Score(score + u32::from(!vague && words.len() <= 3)))
}

/// How a channel fits a role.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Fit {
    /// It is per cent of a torque that the log does not tell: it cannot be used as it is.
    Fraction,
    /// By name and unit, the better the more.
    Score(u32),
}

/// From so many commands of elements on they are those of a whole gearbox.
const WHOLE_GEARBOX: usize = 3;

/// Most letters of the name of an element; a solenoid has its number besides.
const LONGEST_ELEMENT: usize = 3;

/// The element whose valve has this command, or whose pressure is measured here, and the role; none if the channel is neither.
fn element(channel: &Channel) -> Option<(Role, String)> {
    const ELEMENT: &[&str] = &["element", "brake", "bremse", "elem"];
    const PRESSURE: &[&str] = &["pressure", "druck", "p", "prs", "press"];
    const COMMAND: &[&str] =
        &["command", "cmd", "commanded", "set", "setpoint", "des", "desired", "soll", "target", "req"];
    const UNITS: [&str; 7] = ["a", "ma", "pa", "kpa", "mpa", "bar", "psi"];
    let name = channel.name.to_lowercase();
    let own = name.strip_prefix("element_").and_then(|rest| {
        let current = ["_current_a", "_current_ma"].into_iter().find_map(|ending| rest.strip_suffix(ending));
        let duty = || Some((Role::ElementDuty, rest.strip_suffix("_duty_percent")?));
        let asked = || Some((Role::ElementPressureCommand, rest.split_once("_pressure_command")?.0));
        let measured = || Some((Role::ElementPressure, rest.split_once("_pressure")?.0));
        current.map(|name| (Role::ElementCurrent, name)).or_else(duty).or_else(asked).or_else(measured)
    });
    if let Some((role, name)) = own {
        return Some((role, name.to_owned()));
    }
    let words = words(&channel.name);
    let is_about = |list: &[&str]| met(list, &words);
    let role = match Unit::parse(&channel.unit)?.quantity {
        Quantity::Current => Role::ElementCurrent,
        Quantity::Pressure if is_about(COMMAND) => Role::ElementPressureCommand,
        Quantity::Pressure => Role::ElementPressure,
        _ => return None,
    };
    // `I_A`, `I_K1`: a current and a letter, with or without a number.
    let is_lettered = match &words[..] {
        [i, letter, number @ ..] => {
            let is_numbered = number.iter().all(|word| word.chars().all(|c| c.is_ascii_digit()));
            i == "i" && letter.len() == 1 && number.len() <= 1 && is_numbered
        }
        _ => false,
    };
    let is_of_element = match role {
        Role::ElementCurrent => {
            is_lettered || is_about(BANK) || is_about(CURRENT) && (is_about(CLUTCH) || is_about(ELEMENT))
        }
        _ => is_about(PRESSURE),
    };
    const OTHERS: &[&str] = &[
        "line", "tcc", "lockup", "battery", "off", "offgoing", "oncoming", "main", "sys", "system", "oil", "fuel",
        "rail", "boost", "air",
    ];
    if !is_of_element || is_about(OTHERS) {
        return None;
    }
    let is_name = |word: &&String| {
        let word = std::slice::from_ref(*word);
        ![CURRENT, CLUTCH, ELEMENT, TARGET, ACTUAL, PRESSURE, COMMAND].iter().any(|list| met(list, word))
    };
    let mut named: Vec<&str> = words.iter().filter(is_name).map(String::as_str).collect();
    // The letter alone is the element; a number is one of its bank.
    let is_letter = |word: &&str| word.len() == 1 && word.starts_with(char::is_alphabetic) && !BANK.contains(word);
    if named.len() > 1 && named.iter().any(is_letter) {
        named.retain(|word| !BANK.contains(word));
    }
    if named.len() > 1 && named.last().is_some_and(|word| UNITS.contains(word)) {
        named.pop();
    }
    // `Druckregler_1`: a long word is the kind of all of them.
    if named.len() > 1 {
        named.retain(|word| word.len() <= LONGEST_ELEMENT || !BANK.contains(word));
    }
    let name = named.concat();
    let longest = if named.iter().any(|word| BANK.contains(word)) { LONGEST_ELEMENT + 2 } else { LONGEST_ELEMENT };
    (1..=longest).contains(&name.len()).then_some((role, name))
}

/// Words for the solenoids of elements: `I_EDS_A`, `MV1`.
const BANK: &[&str] = &["eds", "edc", "mv", "dr", "pcs", "ssv", "vbs", "nfs", "y", "druckregler", "regelventil"];

/// Whether a channel without a unit has the name of a solenoid and its number: `MV1`, `Y3`.
fn is_solenoid_without_unit(channel: &Channel) -> bool {
    let words = words(&channel.name);
    let [bank, number] = &words[..] else { return false };
    channel.unit.trim().is_empty() && BANK.contains(&bank.as_str()) && number.bytes().all(|c| c.is_ascii_digit())
}

/// The commands of the elements of a whole gearbox, and what is measured of their pressures: keys in a map, and channels. None if there are
/// but a few commands, or two with one key.
fn elements(channels: &[Channel]) -> Vec<(String, usize)> {
    let (measured, commands): (Vec<_>, Vec<_>) = channels
        .iter()
        .enumerate()
        .filter_map(|(at, channel)| element(channel).map(|(role, name)| (role, name, at)))
        .partition(|(role, ..)| *role == Role::ElementPressure);
    // The command of the valve itself is better than the pressure that is asked for.
    let is_best = |(role, name, _): &&(Role, String, usize)| {
        let is_other = |(other, of, _): &(Role, String, usize)| *other != Role::ElementPressureCommand && of == name;
        *role != Role::ElementPressureCommand || !commands.iter().any(is_other)
    };
    let key = |(role, name, at): &(Role, String, usize)| (role.name().replace("NAME", name), *at);
    let mut found: Vec<(String, usize)> = commands.iter().filter(is_best).map(key).collect();
    let keys: std::collections::BTreeSet<&str> = found.iter().map(|(key, _)| key.as_str()).collect();
    if keys.len() != found.len() || found.len() < WHOLE_GEARBOX {
        return Vec::new();
    }
    // Of an element that has a command, the first one.
    for one in measured.iter().filter(|(_, name, _)| commands.iter().any(|(_, of, _)| of == name)) {
        let one = key(one);
        if found.iter().all(|(known, _)| *known != one.0) {
            found.push(one);
        }
    }
    found
}

/// The channel with the fraction of the values of another one, whose name it has with another end: `v` and `v_frac`, `v_int` and `v_fract`.
fn fraction_of(whole: usize, channels: &[Channel]) -> Option<usize> {
    const FRACTION: &[&str] = &["frac", "fraction", "fract", "nachkomma", "nk", "dec", "decimal", "decimals", "fine"];
    // A unit, or what says that there are no decimals.
    const ENDS: &[&str] = &["int", "integer", "vorkomma", "kmh", "kph", "mph", "rpm", "km", "h"];
    let channel = &channels[whole];
    let without_ends = |mut words: Vec<String>| {
        while words.len() > 1 && words.last().is_some_and(|last| ENDS.contains(&&**last)) {
            words.pop();
        }
        words
    };
    let of_whole = without_ends(words(&channel.name));
    let is_fraction = |other: &Channel| {
        let mut of_other = without_ends(words(&other.name));
        let last = of_other.pop();
        let has_unit = other.unit == channel.unit || other.unit.trim().is_empty();
        last.is_some_and(|last| FRACTION.contains(&&*last))
            && without_ends(of_other) == of_whole
            && has_unit
            && other.group == channel.group
    };
    channels.iter().position(is_fraction)
}

/// Unused channels that are named at most; a bus has hundreds.
const UNUSED: usize = 20;

/// Minimum and maximum of the values of a channel, in its unit; none where they are not known.
type Range = Option<[f64; 2]>;

/// Signals that every estimate needs: of a channel of them without values it has to be said.
const NEEDED: [Role; 4] = [Role::TurbineSpeed, Role::OutputSpeed, Role::Gear, Role::TargetGear];

/// A channel map for a log, as the text of a TOML file. Channels in doubt stand beside it as comments. `ranges` are those of the values of the channels; it
/// is empty where they are not known.
pub fn suggest(channels: &[Channel], ranges: &[Range], dbc: Option<&str>) -> String {
    let range = |at: usize| ranges.get(at).copied().flatten();
    let is_empty = |at: usize| ranges.get(at).is_some_and(Option::is_none);
    let source = if ranges.is_empty() { "names and units" } else { "names, units and values" };
    let mut text = format!("# A first channel map, from {source} alone: check every line.\n");
    if let Some(dbc) = dbc {
        let _ = writeln!(text, "dbc = {}", quoted(dbc));
    }
    let mut missing = Vec::new();
    let mut taken = vec![false; channels.len()];
    let elements = elements(channels);
    elements.iter().for_each(|(_, at)| taken[*at] = true);
    let named: Vec<Option<usize>> = (0..channels.len()).map(|at| fraction_of(at, channels)).collect();
    let is_fraction = |at: &usize| range(*at).is_none_or(|[low, high]| -1.0 <= low && high <= 1.0);
    let fractions: Vec<Option<usize>> = named.iter().map(|at| at.filter(is_fraction)).collect();
    named.iter().flatten().for_each(|at| taken[*at] = true);
    for entry in TABLE {
        let mut found: Vec<(Fit, usize)> = channels
            .iter()
            .enumerate()
            .filter(|(i, _)| !taken[*i])
            .filter_map(|(i, channel)| fit(entry, channel).map(|fit| (fit, i)))
            .collect();
        // Of channels without a value one that fits well says less than one with values.
        found.sort_by_key(|(fit, i)| (is_empty(*i) && *fit != Fit::Fraction, std::cmp::Reverse(*fit), *i));
        let Some(&(best_fit, best)) = found.first() else {
            if elements.is_empty() || !entry.role.is_command() {
                missing.push(entry.role.name());
            }
            continue;
        };
        taken[best] = true;
        let table = match fractions[best] {
            Some(fraction) => sum_of([best, fraction], entry.role, channels),
            None => table_of(entry.role.name(), entry.role, best, channels, range(best)),
        };
        text += &match best_fit {
            Fit::Fraction => of_fraction(&table),
            _ if is_empty(best) && !NEEDED.contains(&entry.role) => of_empty(&table),
            _ => table,
        };
        if let Some((at, [low, high])) =
            named[best].and_then(|at| Some((at, range(at)?))).filter(|(at, _)| !is_fraction(at))
        {
            let name = error::shown(&channels[at].name);
            let _ =
                writeln!(text, "# {name} has values of {low} to {high}: more than a fraction has, and is not added");
        }
        let others = found.iter().skip(1).filter(|(fit, _)| (*fit == Fit::Fraction) == (best_fit == Fit::Fraction));
        let others: Vec<String> = others.take(4).map(|(_, i)| error::shown(&channels[*i].name)).collect();
        if !others.is_empty() {
            let _ = writeln!(text, "# also fits: {}", others.join(", "));
        }
    }
    if !elements.is_empty() {
        text.push_str(
            "\n# Commands and measured pressures of the elements of a whole gearbox: check that these are the names of the gearbox file.\n",
        );
    }
    for (key, at) in &elements {
        let role = Role::of_element(key).map_or(Role::ElementCurrent, |(role, _)| role);
        let table = table_of(key, role, *at, channels, range(*at));
        text += &if is_empty(*at) { of_empty(&table) } else { table };
    }
    let may_be_command = |channel: &Channel| {
        is_solenoid_without_unit(channel) || element(channel).is_some_and(|(role, _)| role != Role::ElementPressure)
    };
    let perhaps = channels.iter().zip(&taken).filter(|(channel, taken)| !**taken && may_be_command(channel));
    let perhaps: Vec<String> = perhaps.take(UNUSED).map(|(channel, _)| error::shown(&channel.name)).collect();
    if !perhaps.is_empty() {
        let _ = writeln!(text, "\n# Perhaps commands of clutches, which an estimate needs: {}", perhaps.join(", "));
    }
    if !missing.is_empty() {
        let _ = writeln!(text, "\n# No channel was found for: {}", missing.join(", "));
    }
    let unused: Vec<String> = channels
        .iter()
        .zip(&taken)
        .filter(|(_, taken)| !**taken)
        .map(|(channel, _)| error::shown(&channel.name))
        .collect();
    if !unused.is_empty() {
        let more = if unused.len() > UNUSED { ", ..." } else { "" };
        let _ = writeln!(text, "# Channels that are not used: {}{more}", unused[..unused.len().min(UNUSED)].join(", "));
    }
    text
}

/// The unit of values without one: that of the program, or the usual one of those that no car has in that unit.
fn unit_by_values(role: Role, range: Range) -> &'static str {
    let is_above = |maximum: f64| range.is_some_and(|[_, high]| high > maximum);
    match role.quantity() {
        // 7600 rpm, 250 km/h, 20 A and 150 % \[chosen\].
        Some(Quantity::Rotation) if is_above(800.0) => "rpm",
        Some(Quantity::Velocity) if is_above(70.0) => "km/h",
        Some(Quantity::Current) if is_above(20.0) => "mA",
        Some(Quantity::Fraction) if is_above(1.5) => "%",
        _ => role.unit(),
    }
}

/// The table of a channel in a map.
fn table_of(key: &str, role: Role, at: usize, channels: &[Channel], range: Range) -> String {
    let channel = &channels[at];
    let mut text = format!("\n[channel.{key}]\nname = {}\n", quoted(&channel.name));
    if channels.iter().filter(|other| other.name == channel.name).count() > 1 {
        let _ = writeln!(text, "group = {}", quoted(&channel.group));
    }
    match Unit::parse(&channel.unit) {
        Some(Unit { quantity: Quantity::Fraction, .. }) if role.quantity() == Some(Quantity::Torque) => {
            text += "unit = \"N m\"\n";
        }
        Some(_) if !channel.unit.trim().is_empty() => {
            let _ = writeln!(text, "# unit of the log: {}", error::shown(&channel.unit));
        }
        _ if role.quantity().is_some() => {
            let unit = unit_by_values(role, range);
            let reason = if unit == role.unit() { "" } else { ", by its values" };
            let _ = writeln!(text, "unit = {} # not in the log{reason}: check", quoted(unit));
        }
        _ => {}
    }
    text
}

/// The table of a signal in two channels, whose sum it is.
fn sum_of([whole, fraction]: [usize; 2], role: Role, channels: &[Channel]) -> String {
    let name = |at: usize| quoted(&channels[at].name);
    let both = format!("names = [{}, {}]\ncombine = \"sum\"\n", name(whole), name(fraction));
    let table =
        table_of(role.name(), role, whole, channels, None).replacen(&format!("name = {}\n", name(whole)), &both, 1);
    let (unit, other) = (&channels[whole].unit, &channels[fraction].unit);
    if unit == other {
        return table;
    }
    // One without a unit has that of the other.
    table.replace(&format!("# unit of the log: {}", error::shown(unit)), &format!("unit = {}", quoted(unit)))
}

/// The table of a channel that is per cent of a torque, as a comment: without a scale it would be wrong by a factor.
fn of_fraction(table: &str) -> String {
    let lines = commented(table);
    format!(
        "\n# In per cent of a torque that is not in the log. To use it, remove the number signs and write how many N m one per cent is.\n\
         {lines}# scale =\n"
    )
}

/// The table of a channel without a value in the log, as a comment: with it the log would be refused.
fn of_empty(table: &str) -> String {
    format!("\n# Without a value in this log. For logs that have some, remove the number signs.\n{}", commented(table))
}

fn commented(table: &str) -> String {
    table.lines().filter(|line| !line.is_empty()).map(|line| format!("# {line}\n")).collect()
}

/// A text as TOML writes it.
fn quoted(text: &str) -> String {
    match text.chars().any(trace::is_unprintable) {
        // The text goes to a terminal.
        true => trace::toml_string(text),
        false => toml::Value::String(text.to_owned()).to_string(),
    }
}

#[cfg(test)]
mod tests;
