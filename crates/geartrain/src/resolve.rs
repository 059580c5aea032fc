//! From names to places in lists, and the checks of single parts.

use crate::description::{Element, ElementKind, GearPair, HOUSING, PlanetarySet, StickDiagram};
use crate::finding::{Fault, Finding, Part};
use crate::teeth;
use crate::train::{Connection, GearTrain, Member, TrainElement};

/// More parts of a kind than this are a mistake; the work grows with the cube of their number.
const MAXIMUM: usize = 32;

/// Numbers of teeth.
const TEETH: std::ops::RangeInclusive<u32> = 1..=10_000;

/// Refuses an empty list, one that is too long, and names that are empty, reserved or repeated.
pub(crate) fn names<'n>(
    list: (Part, &'static str),
    part: fn(usize) -> Part,
    names: impl ExactSizeIterator<Item = &'n str> + Clone,
) -> Result<(), Finding> {
    let count = names.len();
    let about = |fault| Err(Finding { part: list.0, key: list.1, fault });
    match count {
        0 => return about(Fault::None),
        _ if count > MAXIMUM => return about(Fault::TooMany { count, maximum: MAXIMUM }),
        _ => (),
    }
    for (at, name) in names.clone().enumerate() {
        let wrong = |fault| Err(Finding { part: part(at), key: "name", fault });
        if name == HOUSING {
            return wrong(Fault::HousingAsName);
        }
        if names.clone().take(at).any(|earlier| earlier == name) {
            return wrong(Fault::Repeated(name.to_owned()));
        }
    }
    Ok(())
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

/// The places of the engaged elements of a gear.
pub(crate) fn engaged<'n, 'e>(
    gear: usize,
    engaged: impl Iterator<Item = &'n str>,
    elements: impl Iterator<Item = &'e str> + Clone,
) -> Result<Vec<usize>, Finding> {
    let mut places = Vec::new();
    for name in engaged {
        let at = place((Part::Gear(gear), "engaged"), "element", name, elements.clone())?;
        if places.contains(&at) {
            return Err(Finding { part: Part::Gear(gear), key: "engaged", fault: Fault::Repeated(name.to_owned()) });
        }
        places.push(at);
    }
    Ok(places)
}

/// The gear train of a stick diagram, and what is unusual about it.
pub(crate) fn train(diagram: &StickDiagram) -> Result<(GearTrain, Vec<Finding>), Finding> {
    let shaft_names = || diagram.shafts.iter().map(|shaft| shaft.name.as_str());
    names((Part::Gearbox, "shaft"), Part::Shaft, shaft_names())?;
    for (at, shaft) in diagram.shafts.iter().enumerate() {
        let valid = shaft.inertia_kg_m2.is_finite() && shaft.inertia_kg_m2 > 0.0;
        if !valid {
            let fault = Fault::Number { value: shaft.inertia_kg_m2, expected: "a finite inertia above 0" };
            return Err(Finding { part: Part::Shaft(at), key: "inertia_kg_m2", fault });
        }
    }
    let shaft = |part: Part, key: &'static str, name: &str| place((part, key), "shaft", name, shaft_names());
    let member = |part: Part, key: &'static str, name: &str| match name {
        HOUSING => Ok(Member::Housing),
        _ => shaft(part, key, name).map(Member::Shaft),
    };
    for (list, count) in [("planetary_set", diagram.sets.len()), ("gear_pair", diagram.pairs.len())] {
        if count > MAXIMUM {
            return Err(Finding { part: Part::Gearbox, key: list, fault: Fault::TooMany { count, maximum: MAXIMUM } });
        }
    }
    let (sets, unusual) = sets(diagram, member)?;
    let pairs = pairs(diagram, shaft)?;
    let elements = elements(diagram, member)?;
    let (input, output) =
        (shaft(Part::Gearbox, "input", &diagram.input)?, shaft(Part::Gearbox, "output", &diagram.output)?);
    if input == output {
        let fault = Fault::InputIsOutput(diagram.input.clone());
        return Err(Finding { part: Part::Gearbox, key: "output", fault });
    }
    let train = GearTrain::new(diagram.shafts.clone(), [input, output], sets, pairs, elements);
    let key = if diagram.sets.is_empty() { "gear_pair" } else { "planetary_set" };
    let train = train.ok_or(Finding { part: Part::Gearbox, key, fault: Fault::DependentSets })?;
    connected(&train)?;
    let freedom = train.degrees_of_freedom();
    if freedom < 2 {
        return Err(Finding { part: Part::Gearbox, key: "shaft", fault: Fault::Freedom(freedom) });
    }
    match train.gear(&[]) {
        Ok(motion) => Err(Finding { part: Part::Gearbox, key: "output", fault: Fault::NoNeutral(motion.ratio) }),
        Err(_) => Ok((train, unusual)),
    }
}

/// The planetary sets, and what is unusual about their teeth.
fn sets(
    diagram: &StickDiagram,
    member: impl Fn(Part, &'static str, &str) -> Result<Member, Finding>,
) -> Result<(Vec<PlanetarySet<Member>>, Vec<Finding>), Finding> {
    let (mut sets, mut unusual) = (Vec::new(), Vec::new());
    for (at, set) in diagram.sets.iter().enumerate() {
        let part = Part::Set(at);
        let of = |key: &'static str, name: &str| member(part, key, name);
        let members = [of("sun", &set.sun)?, of("carrier", &set.carrier)?, of("ring", &set.ring)?];
        sets.push(checked_set(set, part, members)?);
        let findings = teeth::check(set).map_err(|(key, fault)| Finding { part, key, fault })?;
        unusual.extend(findings.into_iter().map(|(key, fault)| Finding { part, key, fault }));
    }
    Ok((sets, unusual))
}

/// The gear pairs.
fn pairs(
    diagram: &StickDiagram,
    shaft: impl Fn(Part, &'static str, &str) -> Result<usize, Finding>,
) -> Result<Vec<GearPair<usize>>, Finding> {
    let pair = |(at, pair): (usize, &GearPair<String>)| {
        let part = Part::Pair(at);
        let (driver, driven) = (shaft(part, "driver", &pair.driver)?, shaft(part, "driven", &pair.driven)?);
        teeth_in_range(part, "driver_teeth", pair.driver_teeth)?;
        teeth_in_range(part, "driven_teeth", pair.driven_teeth)?;
        if driver == driven {
            return Err(Finding { part, key: "driven", fault: Fault::SameSides(pair.driven.clone()) });
        }
        Ok(GearPair {
            driver,
            driven,
            driver_teeth: pair.driver_teeth,
            driven_teeth: pair.driven_teeth,
            idler: pair.idler,
            dog: pair.dog.clone(),
        })
    };
    diagram.pairs.iter().enumerate().map(pair).collect()
}

fn teeth_in_range(part: Part, key: &'static str, teeth: u32) -> Result<(), Finding> {
    let fault = Fault::Number { value: f64::from(teeth), expected: "1 to 10000 teeth" };
    if TEETH.contains(&teeth) { Ok(()) } else { Err(Finding { part, key, fault }) }
}

fn checked_set(
    set: &PlanetarySet<String>,
    part: Part,
    [sun, carrier, ring]: [Member; 3],
) -> Result<PlanetarySet<Member>, Finding> {
    teeth_in_range(part, "sun_teeth", set.sun_teeth)?;
    teeth_in_range(part, "ring_teeth", set.ring_teeth)?;
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

/// The elements of the list, then the dogs of the gear pairs.
fn elements(
    diagram: &StickDiagram,
    member: impl Fn(Part, &'static str, &str) -> Result<Member, Finding>,
) -> Result<Vec<TrainElement>, Finding> {
    let dogs = diagram.pairs.iter().enumerate().filter_map(|(at, pair)| Some((at, pair.dog.as_deref()?)));
    let names_of: Vec<&str> =
        diagram.elements.iter().map(|element| &*element.name).chain(dogs.clone().map(|dog| dog.1)).collect();
    for (nth, (at, dog)) in dogs.clone().enumerate() {
        if dog == HOUSING || names_of.iter().take(diagram.elements.len() + nth).any(|&name| name == dog) {
            return Err(Finding { part: Part::Pair(at), key: "dog", fault: Fault::Repeated(dog.to_owned()) });
        }
    }
    names((Part::Gearbox, "element"), Part::Element, names_of.iter().copied())?;
    let between = diagram.elements.iter().enumerate().map(|(at, element)| {
        let part = Part::Element(at);
        let sides = (member(part, "input", &element.input)?, member(part, "output", &element.output)?);
        check_sides(element, part, sides)?;
        let connection = Connection::Sides(sides.0, sides.1);
        Ok(TrainElement { name: element.name.clone(), kind: element.kind, connection, pack: element.pack })
    });
    let of_pairs = dogs.map(|(at, dog)| {
        Ok(TrainElement { name: dog.to_owned(), kind: ElementKind::Dog, connection: Connection::Pair(at), pack: None })
    });
    between.chain(of_pairs).collect()
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

/// Every shaft is a member of something.
fn connected(train: &GearTrain) -> Result<(), Finding> {
    let sets = train.sets.iter().flat_map(|set| [set.sun, set.carrier, set.ring]);
    let pairs = train.pairs.iter().flat_map(|pair| [pair.driver, pair.driven].map(Member::Shaft));
    let sides = train.elements.iter().flat_map(|element| match element.connection {
        Connection::Sides(input, output) => vec![input, output],
        Connection::Pair(_) => Vec::new(),
    });
    let named: Vec<Member> = sets.chain(pairs).chain(sides).collect();
    match (0..train.shafts.len()).find(|&shaft| !named.contains(&Member::Shaft(shaft))) {
        None => Ok(()),
        Some(shaft) => {
            let fault = Fault::Loose(train.shafts[shaft].name.clone());
            Err(Finding { part: Part::Shaft(shaft), key: "name", fault })
        }
    }
}
