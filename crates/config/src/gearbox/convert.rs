//! From the keys of a gearbox file to its description.

use std::collections::BTreeMap;

use drivetrain::{Clutch, Table1};
use geartrain::{
    Description, Element, ElementKind, EngagedGear, GearPair, Given, PlanetarySet, Planets, Ratio, Ratios, Shaft,
    SharedGear, Shares, ShiftMass, StatedRatio, StickDiagram,
};
use toml::Spanned;

use super::raw::{
    RawEngagedGear, RawGearPair, RawKind, RawPack, RawPlanetarySet, RawPlanets, RawRatios, RawShares, RawShiftMass,
    RawStickDiagram,
};
use crate::ConfigError;
use crate::check::{Check, Number, Word};
use crate::vehicle::{FRICTION_FACES, PISTON_AREAS_M2, PLATE_RADII_M, RETURN_SPRINGS_N};
use car::columns::element_column;

/// Slips of a friction element.
const SLIPS_RAD_S: [f64; 2] = [0.0, 2e3];

/// What a file says, and where.
pub(super) struct Read {
    pub(super) description: Description,
    pub(super) spans: Spans,
}

/// Where lists and their entries begin in the file.
#[derive(Default)]
pub(super) struct Spans {
    keys: BTreeMap<&'static str, usize>,
    /// Beginning and name of each entry; sets, gear pairs and masses have no names.
    parts: BTreeMap<&'static str, Vec<(usize, Option<String>)>>,
}

impl Spans {
    /// Where the value of a key of the file begins; zero if the key is missing.
    pub(super) fn of(&self, key: &str) -> usize {
        self.keys.get(key).copied().unwrap_or(0)
    }

    /// Where an entry of a list begins, and its key.
    pub(super) fn part(&self, list: &str, at: usize) -> (usize, String) {
        match self.parts.get(list).and_then(|entries| entries.get(at)) {
            Some((start, Some(name))) => (*start, format!("{list}.{name}")),
            Some((start, None)) => (*start, list.to_owned()),
            None => (self.of(list), list.to_owned()),
        }
    }

    fn named<'w>(&mut self, key: &'static str, names: impl Iterator<Item = &'w Word>) {
        self.list(key, names.map(|name| (start(name), Some(name.get_ref().clone()))));
    }

    fn unnamed<'w, T: 'w>(&mut self, key: &'static str, entries: impl Iterator<Item = &'w Spanned<T>>) {
        self.list(key, entries.map(|entry| (start(entry), None)));
    }

    fn list(&mut self, key: &'static str, entries: impl Iterator<Item = (usize, Option<String>)>) {
        let entries: Vec<_> = entries.collect();
        if let Some((first, _)) = entries.first() {
            self.keys.entry(key).or_insert(*first);
        }
        self.parts.insert(key, entries);
    }
}

fn start<T>(spanned: &Spanned<T>) -> usize {
    spanned.span().start
}

pub(super) fn stick_diagram(check: &Check<'_>, raw: &RawStickDiagram) -> Result<Read, ConfigError> {
    let mut spans = Spans::default();
    for (key, at) in [
        ("input", start(&raw.input)),
        ("output", start(&raw.output)),
        ("shaft", start(&raw.shaft)),
        ("gear", start(&raw.gear)),
    ] {
        spans.keys.insert(key, at);
    }
    spans.named("shaft", raw.shaft.get_ref().iter().map(|entry| &entry.name));
    spans.unnamed("planetary_set", raw.planetary_set.iter());
    spans.unnamed("gear_pair", raw.gear_pair.iter());
    spans.named("element", raw.element.iter().map(|entry| &entry.name));
    spans.named("gear", raw.gear.get_ref().iter().map(|entry| &entry.name));

    let shafts = raw.shaft.get_ref().iter().map(|shaft| {
        let name = name(check, "shaft.name", &shaft.name)?;
        let inertia_kg_m2 =
            check.number(format_args!("shaft.{name}.inertia_kg_m2"), &shaft.inertia_kg_m2, 1e-5..=50.0)?;
        Ok(Shaft { name, inertia_kg_m2 })
    });
    let dogs = raw.gear_pair.iter().filter_map(|pair| pair.get_ref().dog.as_ref());
    let named = raw.element.iter().map(|entry| ("element.name", &entry.name));
    columns_differ(check, named.chain(dogs.map(|dog| ("gear_pair.dog", dog))))?;
    let elements = raw.element.iter().map(|element| {
        let name = name(check, "element.name", &element.name)?;
        Ok(Element {
            kind: kind(element.kind),
            input: element.input.get_ref().clone(),
            output: element.output.get_ref().clone(),
            pack: element.pack.as_ref().map(|raw| pack(check, &name, raw)).transpose()?,
            name,
        })
    });
    let diagram = StickDiagram {
        input: raw.input.get_ref().clone(),
        output: raw.output.get_ref().clone(),
        shafts: shafts.collect::<Result<_, ConfigError>>()?,
        sets: raw.planetary_set.iter().map(|set| planetary_set(check, set.get_ref())).collect::<Result<_, _>>()?,
        pairs: raw.gear_pair.iter().map(|pair| gear_pair(check, pair.get_ref())).collect::<Result<_, _>>()?,
        elements: elements.collect::<Result<_, ConfigError>>()?,
        gears: raw.gear.get_ref().iter().map(|gear| engaged_gear(check, gear)).collect::<Result<_, _>>()?,
    };
    read(check, &raw.name, raw.line_pressure_pa.as_ref(), Given::StickDiagram(diagram), spans)
}

pub(super) fn shares(check: &Check<'_>, raw: &RawShares) -> Result<Read, ConfigError> {
    let mut spans = Spans::default();
    spans.keys.insert("gear", start(&raw.gear));
    spans.named("element", raw.element.iter().map(|entry| &entry.name));
    spans.named("gear", raw.gear.get_ref().iter().map(|entry| &entry.name));
    spans.unnamed("shift_mass", raw.shift_mass.iter());
    columns_differ(check, raw.element.iter().map(|entry| ("element.name", &entry.name)))?;
    let elements = raw.element.iter().map(|element| {
        let name = name(check, "element.name", &element.name)?;
        let pack = element.pack.as_ref().map(|raw| pack(check, &name, raw)).transpose()?;
        Ok((name, kind(element.kind), pack))
    });
    let gears = raw.gear.get_ref().iter().map(|gear| {
        let name = gear_name(check, &gear.name)?;
        Ok(SharedGear {
            ratio: ratio(check, &name, &gear.ratio)?,
            shares: gear.shares.iter().map(|(element, share)| (element.clone(), *share)).collect(),
            turbine_max_n_m: turbine_max(check, &name, gear.turbine_max_n_m.as_ref())?,
            name,
        })
    });
    let shares = Shares {
        elements: elements.collect::<Result<_, ConfigError>>()?,
        gears: gears.collect::<Result<_, ConfigError>>()?,
        masses: raw.shift_mass.iter().map(|mass| shift_mass(check, mass)).collect::<Result<_, _>>()?,
    };
    read(check, &raw.name, raw.line_pressure_pa.as_ref(), Given::Shares(shares), spans)
}

pub(super) fn ratios(check: &Check<'_>, raw: &RawRatios) -> Result<Read, ConfigError> {
    let mut spans = Spans::default();
    spans.keys.insert("gear", start(&raw.gear));
    spans.named("gear", raw.gear.get_ref().iter().map(|entry| &entry.name));
    spans.unnamed("shift_mass", raw.shift_mass.iter());
    let gears = raw.gear.get_ref().iter().map(|gear| {
        let name = gear_name(check, &gear.name)?;
        Ok(Ratio { ratio: ratio(check, &name, &gear.ratio)?, name })
    });
    let ratios = Ratios {
        gears: gears.collect::<Result<_, ConfigError>>()?,
        masses: raw.shift_mass.iter().map(|mass| shift_mass(check, mass)).collect::<Result<_, _>>()?,
    };
    read(check, &raw.name, None, Given::Ratios(ratios), spans)
}

fn read(
    check: &Check<'_>,
    title: &Word,
    line_pressure_pa: Option<&Number>,
    given: Given,
    mut spans: Spans,
) -> Result<Read, ConfigError> {
    let pressure = |value: &Number| check.number("line_pressure_pa", value, 1e5..=10e6);
    let line_pressure_pa = line_pressure_pa
        .map(|value| {
            spans.keys.insert("line_pressure_pa", start(value));
            pressure(value)
        })
        .transpose()?;
    Ok(Read { description: Description { name: check.title("name", title)?, line_pressure_pa, given }, spans })
}

fn name(check: &Check<'_>, key: &str, name: &Word) -> Result<String, ConfigError> {
    check.name(key, name.get_ref(), start(name))
}

/// The name of a gear: none that stands for no gear in a log.
fn gear_name(check: &Check<'_>, word: &Word) -> Result<String, ConfigError> {
    let name = name(check, "gear.name", word)?;
    let is_none = |number: f64| number == 0.0 || !number.is_finite();
    if ["N", "P"].contains(&name.as_str()) || name.parse().is_ok_and(is_none) {
        let message = format!("\"{name}\" stands for no gear in a log");
        let hint = "give the gear a name such as \"1\" or \"R\"";
        return Err(check.meaning("gear.name", start(word), message, Some(hint.to_owned())));
    }
    Ok(name)
}

/// Refuses elements whose columns in a table would have the same name. The same name twice is an error of the gearbox itself.
fn columns_differ<'w>(
    check: &Check<'_>,
    elements: impl Iterator<Item = (&'static str, &'w Word)>,
) -> Result<(), ConfigError> {
    let mut known: BTreeMap<String, &str> = BTreeMap::new();
    for (key, word) in elements {
        let column = element_column(word.get_ref());
        let Some(first) = known.get(&column).filter(|first| **first != word.get_ref()) else {
            known.insert(column, word.get_ref());
            continue;
        };
        let message = format!("\"{first}\" and \"{}\" have the same columns in a table: {column}_...", word.get_ref());
        let hint = "names of elements differ in more than capital letters, spaces and signs: rename one of them, in the gears too";
        return Err(check.meaning(key, start(word), message, Some(hint.to_owned())));
    }
    Ok(())
}

fn kind(raw: RawKind) -> ElementKind {
    match raw {
        RawKind::Clutch => ElementKind::Clutch,
        RawKind::Brake => ElementKind::Brake,
        RawKind::OneWayClutch => ElementKind::OneWayClutch,
        RawKind::Dog => ElementKind::Dog,
    }
}

/// A whole number of teeth or planets.
fn whole(
    check: &Check<'_>,
    key: &str,
    value: &Number,
    range: std::ops::RangeInclusive<f64>,
) -> Result<u32, ConfigError> {
    check.count(key, value, range).map(|count| count as u32)
}

pub(crate) fn teeth(check: &Check<'_>, key: &str, value: &Number) -> Result<u32, ConfigError> {
    whole(check, key, value, 5.0..=500.0)
}

fn planetary_set(check: &Check<'_>, raw: &RawPlanetarySet) -> Result<PlanetarySet<String>, ConfigError> {
    let planet_teeth = match &raw.planet_teeth {
        None => Vec::new(),
        Some(numbers) => {
            let one = |&value: &f64| teeth(check, "planetary_set.planet_teeth", &Spanned::new(numbers.span(), value));
            numbers.get_ref().iter().map(one).collect::<Result<_, _>>()?
        }
    };
    let count = |value| whole(check, "planetary_set.planet_count", value, 1.0..=20.0);
    Ok(PlanetarySet {
        sun: raw.sun.get_ref().clone(),
        carrier: raw.carrier.get_ref().clone(),
        ring: raw.ring.get_ref().clone(),
        sun_teeth: teeth(check, "planetary_set.sun_teeth", &raw.sun_teeth)?,
        ring_teeth: teeth(check, "planetary_set.ring_teeth", &raw.ring_teeth)?,
        planets: match raw.planets {
            RawPlanets::Single => Planets::Single,
            RawPlanets::Double => Planets::Double,
        },
        planet_count: raw.planet_count.as_ref().map(count).transpose()?,
        planet_teeth,
    })
}

fn gear_pair(check: &Check<'_>, raw: &RawGearPair) -> Result<GearPair<String>, ConfigError> {
    Ok(GearPair {
        driver: raw.driver.get_ref().clone(),
        driven: raw.driven.get_ref().clone(),
        driver_teeth: teeth(check, "gear_pair.driver_teeth", &raw.driver_teeth)?,
        driven_teeth: teeth(check, "gear_pair.driven_teeth", &raw.driven_teeth)?,
        idler: raw.idler,
        dog: raw.dog.as_ref().map(|dog| name(check, "gear_pair.dog", dog)).transpose()?,
    })
}

fn pack(check: &Check<'_>, element: &str, raw: &RawPack) -> Result<Clutch<f64>, ConfigError> {
    let key = |field: &str| format!("element.{element}.pack.{field}");
    let number = |field: &str, value, range| check.number(key(field), value, range);
    let friction = number("friction_coefficient", &raw.friction_coefficient, 0.02..=0.5)?;
    let flat = Table1::new(&SLIPS_RAD_S, &[friction; 2]).map_err(|error| {
        check.meaning(key("friction_coefficient"), start(&raw.friction_coefficient), error.to_string(), None)
    })?;
    Ok(Clutch {
        mean_radius_m: number("mean_radius_m", &raw.mean_radius_m, PLATE_RADII_M)?,
        friction_faces: check.count(key("friction_faces"), &raw.friction_faces, FRICTION_FACES)?,
        piston_area_m2: number("piston_area_m2", &raw.piston_area_m2, PISTON_AREAS_M2)?,
        return_spring_n: number("return_spring_n", &raw.return_spring_n, RETURN_SPRINGS_N)?,
        static_friction: friction,
        friction: flat,
    })
}

fn ratio(check: &Check<'_>, gear: &str, value: &Number) -> Result<f64, ConfigError> {
    check.number(format_args!("gear.{gear}.ratio"), value, -50.0..=50.0)
}

fn turbine_max(check: &Check<'_>, gear: &str, value: Option<&Number>) -> Result<Option<f64>, ConfigError> {
    value.map(|value| check.number(format_args!("gear.{gear}.turbine_max_n_m"), value, 1.0..=1e4)).transpose()
}

fn engaged_gear(check: &Check<'_>, raw: &RawEngagedGear) -> Result<EngagedGear, ConfigError> {
    let name = gear_name(check, &raw.name)?;
    let stated = |value: &Number| -> Result<StatedRatio, ConfigError> {
        let number = check.number(format_args!("gear.{name}.stated_ratio"), value, -50.0..=50.0)?;
        Ok(StatedRatio { value: number, decimals: decimals(check.text(value.span())) })
    };
    Ok(EngagedGear {
        engaged: raw.engaged.clone(),
        stated_ratio: raw.stated_ratio.as_ref().map(stated).transpose()?,
        turbine_max_n_m: turbine_max(check, &name, raw.turbine_max_n_m.as_ref())?,
        name,
    })
}

/// Digits after the point of a number as it is written.
fn decimals(text: &str) -> i32 {
    let (mantissa, exponent) = text.split_once(['e', 'E']).unwrap_or((text, "0"));
    let digits = mantissa.split_once('.').map_or(0, |(_, digits)| digits.chars().filter(char::is_ascii_digit).count());
    let exponent: i32 = exponent.parse().unwrap_or(0);
    i32::try_from(digits).unwrap_or(0).saturating_sub(exponent).clamp(0, 9)
}

fn shift_mass(check: &Check<'_>, raw: &Spanned<RawShiftMass>) -> Result<ShiftMass, ConfigError> {
    let mass = raw.get_ref();
    let number = |key: &str, value, range| check.number(format_args!("shift_mass.{key}"), value, range);
    let gears: &[String; 2] = mass.gears.as_slice().try_into().map_err(|_| {
        let message = format!("has {} names, expected the two gears of a shift", mass.gears.len());
        check.meaning("shift_mass.gears", start(raw), message, Some("such as gears = [\"1\", \"2\"]".to_owned()))
    })?;
    Ok(ShiftMass {
        gears: gears.clone(),
        turbine_kg_m2: number("turbine_kg_m2", &mass.turbine_kg_m2, 1e-4..=50.0)?,
        coupling_kg_m2: number("coupling_kg_m2", &mass.coupling_kg_m2, -50.0..=50.0)?,
        output_kg_m2: number("output_kg_m2", &mass.output_kg_m2, 1e-4..=50.0)?,
    })
}

#[cfg(test)]
mod tests {
    use super::decimals;

    #[test]
    fn decimals_are_those_that_are_written() {
        for (text, digits) in
            [("4.70", 2), ("1", 0), ("-3.403", 3), ("47.0e-1", 2), ("1e2", 0), ("4_0.2_5", 2), ("", 0)]
        {
            assert_eq!(decimals(text), digits, "{text}");
        }
    }
}
