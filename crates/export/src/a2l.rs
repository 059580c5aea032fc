//! The description of parameters and estimates for calibration tools: ASAP2 1.61.
//!
//! Tools differ in what they read: there are no type definitions, no interface data and no names that change. Every object has the symbol of the C code
//! and its offset in it (`SYMBOL_LINK`); [`crate::elf`] fills the addresses.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use observer::Health;

use crate::estimate_members::{Kind, Member, members};
use crate::parameters::{Entry, Values};
use crate::{ExportedFilter, Image};

/// Where the symbols of a program are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Addresses {
    /// Of the parameters; zero if it is not known.
    pub parameters: u64,
    /// Of the estimate.
    pub estimate: u64,
    /// Whether the highest byte of a word comes first.
    pub is_big_endian: bool,
}

/// What belongs together in the description.
struct Group {
    name: String,
    long: String,
    objects: Vec<String>,
}

/// The description of a car's parameters and estimates.
pub fn a2l(filter: &ExportedFilter, image: &Image, addresses: &Addresses) -> String {
    let (mut objects, mut groups, mut units) = (String::new(), Vec::<Group>::new(), BTreeSet::new());
    let symbol = format!("wetclutch_{}_parameters", filter.name);
    let mut entries = image.entries.iter();
    while let Some(entry) = entries.next() {
        let place = Place { symbol: &symbol, address: addresses.parameters, offset: entry.offset };
        let text = match &entry.values {
            Values::Whole(_) if entry.is_map() => {
                let (Some(axis), Some(values)) = (entries.next(), entries.next()) else { break };
                units.extend([axis.unit(), values.unit()]);
                curve(entry, [axis, values], &place)
            }
            // Counts, places and kinds belong to the structure of the image.
            Values::Whole(_) => continue,
            Values::Reals(values) => {
                units.insert(entry.unit());
                value(entry, values, &place)
            }
        };
        objects += &text;
        let [name, long] = filter.group_of(entry);
        if groups.last().is_none_or(|group| group.name != name) {
            groups.push(Group { name, long, objects: Vec::new() });
        }
        if let Some(group) = groups.last_mut() {
            group.objects.push(entry.object());
        }
    }
    let symbol = format!("wetclutch_{}_estimate", filter.name);
    let mut estimates = Vec::new();
    for member in members() {
        let place = Place { symbol: &symbol, address: addresses.estimate, offset: member.offset };
        units.insert(member.unit);
        objects += &measurement(&member, &place);
        estimates.push(format!("estimate.{}", member.name));
    }
    let root = |name: &str, long: &str, of: &str| {
        format!("    /begin GROUP {name} \"{long}\"\n      ROOT\n{of}    /end GROUP\n")
    };
    let names: Vec<&str> = groups.iter().map(|group| group.name.as_str()).collect();
    let mut text = root("Parameters", "parameters of the observer", &list("SUB_GROUP", &names));
    for Group { name, long, objects } in &groups {
        let objects: Vec<&str> = objects.iter().map(String::as_str).collect();
        let _ = write!(
            text,
            "    /begin GROUP {name} \"{}\"\n{}    /end GROUP\n",
            quoted(long),
            list("REF_CHARACTERISTIC", &objects)
        );
    }
    let estimates: Vec<&str> = estimates.iter().map(String::as_str).collect();
    text += &root("Estimates", "estimates of the observer", &list("REF_MEASUREMENT", &estimates));
    let methods: String = units.into_iter().map(method).collect();
    include_str!("frame.a2l")
        .replace("@CAR@", &filter.name)
        .replace("@NAME@", &quoted(&filter.car.name))
        .replace("@SHA256@", &filter.vehicle_sha256)
        .replace("@BYTE_ORDER@", if addresses.is_big_endian { "MSB_FIRST" } else { "MSB_LAST" })
        .replace("@METHODS@", &(methods + &words()))
        .replace("@OBJECTS@", &objects)
        .replace("@GROUPS@", &text)
}

/// A place in a program.
struct Place<'a> {
    symbol: &'a str,
    /// Of the symbol; zero if it is not known.
    address: u64,
    offset: usize,
}

impl Place<'_> {
    fn address(&self) -> String {
        let known = self.address != 0;
        format!("0x{:08X}", if known { self.address + self.offset as u64 } else { 0 })
    }

    fn link(&self) -> String {
        format!("SYMBOL_LINK \"{}\" {}", self.symbol, self.offset)
    }
}

impl Entry {
    /// Whether it is the number of points of a map, which axis and values follow.
    fn is_map(&self) -> bool {
        self.path.last().is_some_and(|name| name == "points")
    }

    /// Its name in the description: that of a map for its points.
    fn object(&self) -> String {
        if self.is_map() { self.path[..self.path.len() - 1].join("_") } else { self.name() }
    }
}

impl ExportedFilter {
    /// Name and meaning of the group of a parameter.
    fn group_of(&self, entry: &Entry) -> [String; 2] {
        match entry.part() {
            Some(part) => [part.join("_"), self.words_for(part)],
            // A number that is in no part is in no group of its name.
            None if entry.path.len() == 1 => ["car", "parameters of the car"].map(str::to_owned),
            None => [entry.path[0].as_str(), "parameters of the car"].map(str::to_owned),
        }
    }
}

fn quoted(text: &str) -> String {
    text.replace(['"', '\\'], "'").replace(|c: char| c.is_control() || !c.is_ascii(), " ")
}

fn list(keyword: &str, names: &[&str]) -> String {
    let names: String = names.iter().map(|name| format!("        {name}\n")).collect();
    format!("      /begin {keyword}\n{names}      /end {keyword}\n")
}

/// Name of the conversion of a unit.
fn method_name(unit: &str) -> String {
    let plain: String = unit.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    format!("CM_{plain}")
}

fn method(unit: &str) -> String {
    format!(
        "    /begin COMPU_METHOD {} \"\" IDENTICAL \"%12.6\" \"{unit}\"\n    /end COMPU_METHOD\n",
        method_name(unit)
    )
}

/// A number or an array of numbers.
fn value(entry: &Entry, values: &[f32], place: &Place<'_>) -> String {
    let (kind, size) = match values.len() {
        1 => ("VALUE", String::new()),
        several => ("VAL_BLK", format!("      MATRIX_DIM {several} 1 1\n")),
    };
    let [low, high] = limits_of(entry.unit());
    format!(
        "    /begin CHARACTERISTIC {name} \"{name}\" {kind} {address} Float 0 {method} {low} {high}\n{size}      {link}\n    /end CHARACTERISTIC\n",
        name = entry.object(),
        address = place.address(),
        method = method_name(entry.unit()),
        link = place.link(),
    )
}

/// A map over one quantity: number of points, axis, values.
fn curve(points: &Entry, [axis, values]: [&Entry; 2], place: &Place<'_>) -> String {
    let count = match &axis.values {
        Values::Reals(axis) => axis.len(),
        Values::Whole(_) => 0,
    };
    let ([low, high], [first, last]) = (limits_of(values.unit()), limits_of(axis.unit()));
    format!(
        "    /begin CHARACTERISTIC {name} \"{name}\" CURVE {address} Curve 0 {method} {low} {high}\n      \
         /begin AXIS_DESCR STD_AXIS NO_INPUT_QUANTITY {axis_method} {count} {first} {last}\n      /end AXIS_DESCR\n      {link}\n    /end CHARACTERISTIC\n",
        name = points.object(),
        address = place.address(),
        method = method_name(values.unit()),
        axis_method = method_name(axis.unit()),
        link = place.link(),
    )
}

fn measurement(member: &Member, place: &Place<'_>) -> String {
    let (kind, method, [low, high]) = match member.kind {
        Kind::Float => {
            ("FLOAT32_IEEE", method_name(member.unit), limits_of(member.unit).map(|limit| format!("{limit}")))
        }
        Kind::Signed => ("SLONG", method_name("1"), ["-1".to_owned(), "511".to_owned()]),
        Kind::Unsigned => ("ULONG", method_name("1"), ["0".to_owned(), "4294967295".to_owned()]),
        Kind::Phase => ("SLONG", "CM_phase".to_owned(), ["-1".to_owned(), "3".to_owned()]),
        Kind::Health => ("ULONG", "CM_health".to_owned(), ["0".to_owned(), "16".to_owned()]),
        Kind::Channel => ("ULONG", "CM_channel".to_owned(), ["0".to_owned(), "4".to_owned()]),
    };
    format!(
        "    /begin MEASUREMENT estimate.{name} \"{meaning}\" {kind} {method} 0 0 {low} {high}\n      ECU_ADDRESS {address}\n      {link}\n    /end MEASUREMENT\n",
        name = member.name,
        meaning = member.meaning,
        address = place.address(),
        link = place.link(),
    )
}

/// Lowest and highest value that a calibration tool lets a quantity have.
fn limits_of(unit: &str) -> [f32; 2] {
    match unit {
        "Pa" => [0.0, 1e7],
        "s" => [0.0, 1e4],
        "A" => [0.0, 100.0],
        "rad/s" => [-5e3, 5e3],
        "N m" => [-1e5, 1e5],
        "1" => [-1e3, 1e3],
        "N m s^2" => [-1e3, 1e3],
        _ => [-1e15, 1e15],
    }
}

/// Conversions of numbers to words.
fn words() -> String {
    let health: Vec<(i32, &str)> = Health::ALL.iter().map(|of| (*of as i32, of.name())).collect();
    let phases = [(-1, "none"), (0, "in_gear"), (1, "offgoing_holds"), (2, "both_slip"), (3, "oncoming_holds")];
    let channels = [(0, "unused"), (1, "good"), (2, "absent"), (3, "refused"), (4, "lost")];
    let one = |name: &str, words: &[(i32, &str)]| {
        let rows: String = words.iter().map(|(number, word)| format!("      {number} \"{word}\"\n")).collect();
        format!(
            "    /begin COMPU_METHOD CM_{name} \"\" TAB_VERB \"%3.0\" \"\"\n      COMPU_TAB_REF CT_{name}\n    /end COMPU_METHOD\n    \
             /begin COMPU_VTAB CT_{name} \"\" TAB_VERB {}\n{rows}    /end COMPU_VTAB\n",
            words.len()
        )
    };
    [one("phase", &phases), one("health", &health), one("channel", &channels)].concat()
}
