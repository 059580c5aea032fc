//! From names to places in lists, and the checks of single parts.

use crate::description::{Element, ElementKind, GearPair, HOUSING, PlanetarySet, StickDiagram};
use crate::finding::{Fault, Finding, Findings, Part};
use crate::teeth;
use crate::train::{Connection, GearTrain, Member, TrainElement};

/// More parts of a kind than this are a mistake; the work grows with the cube of their number.
const MAXIMUM: usize = 32;

/// Numbers of teeth.
const TEETH: std::ops::RangeInclusive<u32> = 1..=10_000;

/// Refuses an empty list, one that is too long, and names that are empty, reserved or repeated; whether all are right.
pub(crate) fn names<'n>(
    list: (Part, &'static str),
    part: fn(usize) -> Part,
    names: impl ExactSizeIterator<Item = &'n str> + Clone,
    findings: &mut Findings,
) -> Option<()> {
    let count = names.len();
    let about = |fault| Err(Finding { part: list.0, key: list.1, fault });
    findings.keep(match count {
        0 => about(Fault::None),
        _ if count > MAXIMUM => about(Fault::TooMany { count, maximum: MAXIMUM }),
        _ => Ok(()),
    })?;
    let checked = names.clone().enumerate().map(|(at, name)| {
        let wrong = |fault| Err(Finding { part: part(at), key: "name", fault });
        if name == HOUSING {
            return wrong(Fault::HousingAsName);
        }
        if names.clone().take(at).any(|earlier| earlier == name) {
            return wrong(Fault::Repeated(name.to_owned()));
        }
        Ok(())
    });
    findings.keep_all(checked).map(drop)
}

/// The place of a name.
pub(crate) fn place<'n>(
    (part, key): (Part, &'static str),
    what: &'static str,
    name: &str,
    mut known: impl Iterator<Item = &'n str> + Clone,
) -> Result<usize, Finding> {
    known.clone().position(|other| other == name).ok_or_else(|| {
        let known = known.by_ref().map(str::to_owned).collect();
        Finding { part, key, fault: Fault::Unknown { what, name: name.to_owned(), known } }
    })
}

/// A number that must be finite and above zero.
pub(crate) fn positive(part: Part, key: &'static str, value: f64) -> Result<(), Finding> {
    let valid = value.is_finite() && value > 0.0;
    let fault = Fault::Number { value, expected: "a finite number above 0" };
    if valid { Ok(()) } else { Err(Finding { part, key, fault }) }
}

/// The places of the engaged elements of a gear; none if one of them does not exist, or is named twice.
pub(crate) fn engaged<'n, 'e>(
    gear: usize,
    engaged: impl Iterator<Item = &'n str>,
    elements: impl Iterator<Item = &'e str> + Clone,
    findings: &mut Findings,
) -> Option<Vec<usize>> {
    let mut named = Vec::new();
    findings.keep_all(engaged.map(|name| {
        let at = place((Part::Gear(gear), "engaged"), "element", name, elements.clone())?;
        if named.contains(&at) {
            return Err(Finding { part: Part::Gear(gear), key: "engaged", fault: Fault::Repeated(name.to_owned()) });
        }
        named.push(at);
        Ok(at)
    }))
}

/// The gear train of a stick diagram, and what is unusual about it; none if its parts do not make one. Its numbers of teeth may be among the findings.
pub(crate) fn train(diagram: &StickDiagram, findings: &mut Findings) -> Option<(GearTrain, Vec<Finding>)> {
    let shaft_names = || diagram.shafts.iter().map(|shaft| shaft.name.as_str());
    let named = names((Part::Gearbox, "shaft"), Part::Shaft, shaft_names(), findings);
    for (at, shaft) in diagram.shafts.iter().enumerate() {
        let valid = shaft.inertia_kg_m2.is_finite() && shaft.inertia_kg_m2 > 0.0;
        if !valid {
            let fault = Fault::Number { value: shaft.inertia_kg_m2, expected: "a finite inertia above 0" };
            findings.0.push(Finding { part: Part::Shaft(at), key: "inertia_kg_m2", fault });
        }
    }
    let shaft = |part: Part, key: &'static str, name: &str| place((part, key), "shaft", name, shaft_names());
    let member = |part: Part, key: &'static str, name: &str| match name {
        HOUSING => Ok(Member::Housing),
        _ => shaft(part, key, name).map(Member::Shaft),
    };
    for (list, count) in [("planetary_set", diagram.sets.len()), ("gear_pair", diagram.pairs.len())] {
        if count > MAXIMUM {
            findings.0.push(Finding {
                part: Part::Gearbox,
                key: list,
                fault: Fault::TooMany { count, maximum: MAXIMUM },
            });
            return None;
        }
    }
    let sets = sets(diagram, member, findings);
    let pairs = pairs(diagram, shaft, findings);
    let elements = elements(diagram, member, findings);
    let ends = [("input", &diagram.input), ("output", &diagram.output)];
    let ends = findings.keep_all(ends.into_iter().map(|(key, name)| shaft(Part::Gearbox, key, name)));
    if diagram.input == diagram.output {
        let fault = Fault::InputIsOutput(diagram.input.clone());
        findings.0.push(Finding { part: Part::Gearbox, key: "output", fault });
        return None;
    }
    named?;
    let ((sets, unusual), pairs, elements, ends) = (sets?, pairs?, elements?, ends?);
    let train = GearTrain::new(diagram.shafts.clone(), [ends[0], ends[1]], sets, pairs, elements);
    let key = if diagram.sets.is_empty() { "gear_pair" } else { "planetary_set" };
    let train = findings.keep(train.ok_or(Finding { part: Part::Gearbox, key, fault: Fault::DependentSets }))?;
    findings.keep_all(loose(&train).map(Err::<(), _>))?;
    let freedom = train.degrees_of_freedom();
    if freedom < 2 {
        findings.0.push(Finding { part: Part::Gearbox, key: "shaft", fault: Fault::Freedom(freedom) });
        return None;
    }
    if let Ok(motion) = train.gear(&[]) {
        findings.0.push(Finding { part: Part::Gearbox, key: "output", fault: Fault::NoNeutral(motion.ratio) });
        return None;
    }
    Some((train, unusual))
}

/// The planetary sets, and what is unusual about their teeth; none if they connect what does not exist, or nothing.
fn sets(
    diagram: &StickDiagram,
    member: impl Fn(Part, &'static str, &str) -> Result<Member, Finding>,
    findings: &mut Findings,
) -> Option<(Vec<PlanetarySet<Member>>, Vec<Finding>)> {
    let mut unusual = Vec::new();
    let sets: Vec<Option<PlanetarySet<Member>>> = diagram
        .sets
        .iter()
        .enumerate()
        .map(|(at, set)| {
            let part = Part::Set(at);
            let members = [("sun", &set.sun), ("carrier", &set.carrier), ("ring", &set.ring)];
            let members = findings.keep_all(members.into_iter().map(|(key, name)| member(part, key, name)));
            let teeth = [("sun_teeth", set.sun_teeth), ("ring_teeth", set.ring_teeth)];
            let in_range = findings.keep_all(teeth.into_iter().map(|(key, teeth)| teeth_in_range(part, key, teeth)));
            if in_range.is_some() {
                let teeth = teeth::check(set).map_err(|(key, fault)| Finding { part, key, fault });
                let of_set = findings.keep(teeth).unwrap_or_default().into_iter();
                unusual.extend(of_set.map(|(key, fault)| Finding { part, key, fault }));
            }
            in_range?;
            let members = members?;
            findings.keep(differing(set, part, [members[0], members[1], members[2]]))
        })
        .collect();
    Some((sets.into_iter().collect::<Option<_>>()?, unusual))
}

/// The gear pairs.
fn pairs(
    diagram: &StickDiagram,
    shaft: impl Fn(Part, &'static str, &str) -> Result<usize, Finding>,
    findings: &mut Findings,
) -> Option<Vec<GearPair<usize>>> {
    let mut pair = |(at, pair): (usize, &GearPair<String>)| {
        let part = Part::Pair(at);
        let shafts = [("driver", &pair.driver), ("driven", &pair.driven)];
        let shafts = findings.keep_all(shafts.into_iter().map(|(key, name)| shaft(part, key, name)));
        let teeth = [("driver_teeth", pair.driver_teeth), ("driven_teeth", pair.driven_teeth)];
        let in_range = findings.keep_all(teeth.into_iter().map(|(key, teeth)| teeth_in_range(part, key, teeth)));
        let (driver, driven) = shafts.map(|shafts| (shafts[0], shafts[1]))?;
        if driver == driven {
            findings.0.push(Finding { part, key: "driven", fault: Fault::SameSides(pair.driven.clone()) });
            return None;
        }
        in_range?;
        Some(GearPair {
            driver,
            driven,
            driver_teeth: pair.driver_teeth,
            driven_teeth: pair.driven_teeth,
            idler: pair.idler,
            dog: pair.dog.clone(),
        })
    };
    let pairs: Vec<Option<GearPair<usize>>> = diagram.pairs.iter().enumerate().map(&mut pair).collect();
    pairs.into_iter().collect()
}

fn teeth_in_range(part: Part, key: &'static str, teeth: u32) -> Result<(), Finding> {
    let fault = Fault::Number { value: f64::from(teeth), expected: "1 to 10000 teeth" };
    if TEETH.contains(&teeth) { Ok(()) } else { Err(Finding { part, key, fault }) }
}

/// A set with its members, each of them another one.
fn differing(
    set: &PlanetarySet<String>,
    part: Part,
    [sun, carrier, ring]: [Member; 3],
) -> Result<PlanetarySet<Member>, Finding> {
    let same = [
        (sun == carrier, "carrier", "sun and carrier"),
        (sun == ring, "ring", "sun and ring"),
        (carrier == ring, "ring", "carrier and ring"),
    ];
    if let Some(&(_, key, which)) = same.iter().find(|same| same.0) {
        return Err(Finding { part, key, fault: Fault::SameMembers(which) });
    }
    let (planet_teeth, planet_count) = (set.planet_teeth.clone(), set.planet_count);
    Ok(PlanetarySet {
        sun,
        carrier,
        ring,
        planet_teeth,
        planet_count,
        planets: set.planets,
        sun_teeth: set.sun_teeth,
        ring_teeth: set.ring_teeth,
    })
}

/// The elements of the list, then the dogs of the gear pairs; none if one of them is wrong.
fn elements(
    diagram: &StickDiagram,
    member: impl Fn(Part, &'static str, &str) -> Result<Member, Finding>,
    findings: &mut Findings,
) -> Option<Vec<TrainElement>> {
    let dogs = diagram.pairs.iter().enumerate().filter_map(|(at, pair)| Some((at, pair.dog.as_deref()?)));
    let names_of: Vec<&str> = element_names(diagram).collect();
    let dog = |(nth, (at, dog)): (usize, (usize, &str))| {
        let is_taken = names_of.iter().take(diagram.elements.len() + nth).any(|&name| name == dog);
        if dog == HOUSING || is_taken {
            return Err(Finding { part: Part::Pair(at), key: "dog", fault: Fault::Repeated(dog.to_owned()) });
        }
        Ok(())
    };
    let dogs_named = findings.keep_all(dogs.clone().enumerate().map(dog));
    // A dog with the name of an element is one finding.
    let named =
        dogs_named.and_then(|_| names((Part::Gearbox, "element"), Part::Element, names_of.iter().copied(), findings));
    let between: Vec<Option<TrainElement>> = diagram
        .elements
        .iter()
        .enumerate()
        .map(|(at, element)| {
            let part = Part::Element(at);
            let sides = [("input", &element.input), ("output", &element.output)];
            let sides = findings.keep_all(sides.into_iter().map(|(key, name)| member(part, key, name)))?;
            findings.keep(check_sides(element, part, (sides[0], sides[1])))?;
            let connection = Connection::Sides(sides[0], sides[1]);
            Some(TrainElement { name: element.name.clone(), kind: element.kind, connection, pack: element.pack })
        })
        .collect();
    named?;
    let of_pairs = dogs.map(|(at, dog)| {
        Some(TrainElement {
            name: dog.to_owned(),
            kind: ElementKind::Dog,
            connection: Connection::Pair(at),
            pack: None,
        })
    });
    between.into_iter().chain(of_pairs).collect()
}

/// Names of the elements of the list, then of the dogs of the gear pairs.
pub(crate) fn element_names(diagram: &StickDiagram) -> impl Iterator<Item = &str> + Clone {
    let dogs = diagram.pairs.iter().filter_map(|pair| pair.dog.as_deref());
    diagram.elements.iter().map(|element| &*element.name).chain(dogs)
}

fn check_sides(element: &Element, part: Part, (input, output): (Member, Member)) -> Result<(), Finding> {
    if input == output {
        return Err(Finding { part, key: "output", fault: Fault::SameSides(element.output.clone()) });
    }
    let to_housing = input == Member::Housing || output == Member::Housing;
    match element.kind {
        ElementKind::Brake if !to_housing => Err(Finding { part, key: "input", fault: Fault::BrakeWithoutHousing }),
        ElementKind::Clutch if to_housing => Err(Finding { part, key: "kind", fault: Fault::ClutchToHousing }),
        _ => Ok(()),
    }
}

/// The shafts that are a member of nothing.
fn loose(train: &GearTrain) -> impl Iterator<Item = Finding> {
    let sets = train.sets.iter().flat_map(|set| [set.sun, set.carrier, set.ring]);
    let pairs = train.pairs.iter().flat_map(|pair| [pair.driver, pair.driven].map(Member::Shaft));
    let sides = train.elements.iter().flat_map(|element| match element.connection {
        Connection::Sides(input, output) => vec![input, output],
        Connection::Pair(_) => Vec::new(),
    });
    let named: Vec<Member> = sets.chain(pairs).chain(sides).collect();
    (0..train.shafts.len()).filter(move |&shaft| !named.contains(&Member::Shaft(shaft))).map(|shaft| {
        let fault = Fault::Loose(train.shafts[shaft].name.clone());
        Finding { part: Part::Shaft(shaft), key: "name", fault }
    })
}
