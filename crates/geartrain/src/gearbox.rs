//! A checked gearbox: its gears and its shifts, from whatever is known of it.

use drivetrain::{Clutch, ReducedShift};

use crate::capacity::{self, Capacity};
use crate::description::{Description, ElementKind, EngagedGear, Given, Ratios, Shares, ShiftMass, StickDiagram};
use crate::finding::{Fault, Finding, Findings, Part};
use crate::inertia;
use crate::resolve::{element_names, engaged, names, place, positive, train};
use crate::shift::{Change, Shift, change};
use crate::train::{GearTrain, NoGear, ZERO};
use crate::unusual;

/// Ratios closer than this share are one.
const SAME_RATIO: f64 = 1e-6;

/// An element of a gearbox.
#[derive(Debug, Clone, PartialEq)]
pub struct GearboxElement {
    /// Its name.
    pub name: String,
    /// What it is.
    pub kind: ElementKind,
    /// Its friction plates and piston.
    pub pack: Option<Clutch<f64>>,
}

/// The torque of an engaged element.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Holding {
    /// The element.
    pub element: usize,
    /// Its static torque per turbine torque; positive drives its output side. Its reciprocal is `alpha` of a shift.
    pub per_turbine_torque: f64,
}

/// A gear.
#[derive(Debug, Clone, PartialEq)]
pub struct Gear {
    /// Its name.
    pub name: String,
    /// Turbine speed over output speed; negative in reverse.
    pub ratio: f64,
    /// The engaged elements with their torques; empty where only the ratio is known.
    pub holding: Vec<Holding>,
    /// Whether the torques are the only possible ones; if not, they are the smallest.
    pub holding_is_unique: bool,
    /// Speed of each shaft per turbine speed, `None` where the gear leaves it open; empty without a stick diagram.
    pub shaft_speeds: Vec<Option<f64>>,
    /// Largest turbine torque, N m.
    pub turbine_max_n_m: Option<f64>,
}

/// A checked gearbox.
#[derive(Debug, Clone, PartialEq)]
pub struct Gearbox {
    /// Name for people.
    pub name: String,
    /// The elements; empty where only ratios are known.
    pub elements: Vec<GearboxElement>,
    /// The gears, in the order of the description.
    pub gears: Vec<Gear>,
    /// The shifts between any two gears, in the order of the gears. Where only ratios are known, those between neighbours.
    pub shifts: Vec<Shift>,
    /// The elements whose capacity could be checked.
    pub capacities: Vec<Capacity>,
    /// The stick diagram, where it is known.
    pub train: Option<GearTrain>,
    /// What is unusual.
    pub warnings: Vec<Finding>,
}

impl Gearbox {
    /// Checks a description and derives gears and shifts.
    ///
    /// # Errors
    /// The first thing that is wrong, with its place and what to do about it.
    pub fn new(description: &Description) -> Result<Self, Finding> {
        Self::checked(description).map_err(|mut findings| findings.swap_remove(0))
    }

    /// The same, with all that is wrong: what follows from something else that is wrong is none of it.
    ///
    /// # Errors
    /// At least one finding, in the order in which the parts are checked.
    pub fn checked(description: &Description) -> Result<Self, Vec<Finding>> {
        let mut findings = Findings::default();
        match Self::with(description, &mut findings) {
            Some(gearbox) if findings.are_none() => Ok(gearbox),
            _ => Err(findings.0),
        }
    }

    /// A gearbox, with the findings of a wrong one; none where parts of it are missing.
    fn with(description: &Description, findings: &mut Findings) -> Option<Self> {
        let mut gearbox = match &description.given {
            Given::StickDiagram(diagram) => from_stick_diagram(diagram, findings),
            Given::Shares(shares) => from_shares(shares, findings),
            Given::Ratios(ratios) => from_ratios(ratios, findings),
        }?;
        gearbox.name.clone_from(&description.name);
        if gearbox.gears.iter().all(|gear| gear.ratio < 0.0) {
            findings.0.push(Finding { part: Part::Gearbox, key: "gear", fault: Fault::NoForward });
        }
        gearbox.check_one_way(findings);
        if let Some(line_pressure_pa) = description.line_pressure_pa {
            findings.keep(positive(Part::Gearbox, "line_pressure_pa", line_pressure_pa))?;
        }
        gearbox.capacities = capacity::check(&gearbox.elements, &gearbox.gears, description.line_pressure_pa, findings);
        gearbox.warnings.extend(unusual::find(&gearbox));
        Some(gearbox)
    }

    fn of(elements: Vec<GearboxElement>, gears: Vec<Gear>) -> Self {
        let (name, shifts, capacities, warnings) = (String::new(), Vec::new(), Vec::new(), Vec::new());
        Self { name, elements, gears, shifts, capacities, train: None, warnings }
    }

    /// Whether its ratios alone are known: it has no elements, and torques of its clutches are those that the turbine feels.
    pub fn has_ratios_alone(&self) -> bool {
        self.elements.is_empty()
    }

    /// The clutches and brakes with plates.
    pub fn with_plates(&self) -> impl Iterator<Item = &GearboxElement> {
        self.elements.iter().filter(|element| element.kind.has_plates())
    }

    /// Turbine over output speed in each gear, negative in reverse.
    pub fn ratios(&self) -> Vec<f64> {
        self.gears.iter().map(|gear| gear.ratio).collect()
    }

    /// The forward gears from the largest ratio to the smallest. Of gears with one ratio, as one for engine braking, that of a
    /// one-way clutch, or the first of the table.
    pub fn forward_gears(&self) -> Vec<usize> {
        let mut forward: Vec<usize> = (0..self.gears.len()).filter(|&gear| self.gears[gear].ratio > 0.0).collect();
        forward.sort_by(|&a, &b| self.gears[b].ratio.total_cmp(&self.gears[a].ratio));
        forward.dedup_by(|later, first| {
            let is_same = self.is_same_ratio(*first, *later);
            if is_same && self.one_way_clutch_of(*first).is_none() && self.one_way_clutch_of(*later).is_some() {
                *first = *later;
            }
            is_same
        });
        forward
    }

    /// Whether two gears have one ratio: the elements of one hold in the other direction too, as for engine braking.
    pub fn is_same_ratio(&self, a: usize, b: usize) -> bool {
        let ratio = |gear: usize| self.gears[gear].ratio;
        (ratio(a) - ratio(b)).abs() < SAME_RATIO * ratio(a).abs()
    }

    /// Whether an element is a one-way clutch.
    pub fn is_one_way(&self, element: usize) -> bool {
        self.elements.get(element).is_some_and(|element| element.kind == ElementKind::OneWayClutch)
    }

    /// Whether an element is a dog.
    pub fn is_dog(&self, element: usize) -> bool {
        self.elements.get(element).is_some_and(|element| element.kind == ElementKind::Dog)
    }

    /// The one-way clutch that holds a gear: one that is engaged without torque, as behind an open brake, holds none.
    pub fn one_way_clutch_of(&self, gear: usize) -> Option<usize> {
        let holds = |holding: &&Holding| self.is_one_way(holding.element) && holding.per_turbine_torque > ZERO;
        self.gears.get(gear)?.holding.iter().find(holds).map(|holding| holding.element)
    }

    /// Whether only dogs change between its forward gears, as behind one clutch: no clutch takes the load over from another.
    pub fn only_dogs_change(&self) -> bool {
        let is_forward = |gear: usize| self.gears[gear].ratio > 0.0;
        let mut forward = self.shifts.iter().filter(|shift| is_forward(shift.from) && is_forward(shift.to)).peekable();
        forward.peek().is_some() && forward.all(|shift| matches!(shift.change, Change::Interrupted { .. }))
    }

    /// The shift between two gears.
    pub fn shift(&self, from: usize, to: usize) -> Option<&Shift> {
        self.shifts.iter().find(|shift| (shift.from, shift.to) == (from, to))
    }

    /// The gear of this name.
    pub fn gear(&self, name: &str) -> Option<usize> {
        self.gears.iter().position(|gear| gear.name == name)
    }

    /// A one-way clutch carries only a positive torque.
    fn check_one_way(&self, findings: &mut Findings) {
        for (at, gear) in self.gears.iter().enumerate() {
            let mut about = |fault| findings.0.push(Finding { part: Part::Gear(at), key: "engaged", fault });
            let backwards = |holding: &&Holding| {
                self.elements[holding.element].kind == ElementKind::OneWayClutch && holding.per_turbine_torque < -ZERO
            };
            if let Some(holding) = gear.holding.iter().find(backwards) {
                let element = self.elements[holding.element].name.clone();
                about(Fault::OneWay { element, gear: gear.name.clone() });
            } else if let Some(element) = self.train.as_ref().and_then(|train| self.blocking(train, gear)) {
                let element = self.elements[element].name.clone();
                about(Fault::OneWayBlocks { element, gear: gear.name.clone() });
            }
        }
    }

    /// A one-way clutch that would turn in the direction in which it holds.
    fn blocking(&self, train: &GearTrain, gear: &Gear) -> Option<usize> {
        let speeds: Vec<f64> = gear.shaft_speeds.iter().copied().collect::<Option<_>>()?;
        let slip =
            |element: usize| train.slip_row(element).iter().zip(&speeds).map(|(k, speed)| k * speed).sum::<f64>();
        (0..self.elements.len()).find(|&element| self.is_one_way(element) && slip(element) > ZERO)
    }

    /// Slip of each element per turbine and output speed in a shift, zero of those that are held. `None` of ratios alone, and where the shift
    /// is none between two elements.
    pub fn slips_in_shift(&self, shift: &Shift) -> Option<Vec<[f64; 2]>> {
        let Change::Single { held, .. } = &shift.change else { return None };
        let train = self.train.as_ref()?;
        let speeds = train.speeds_in_shift(held)?;
        let slip = |element: usize| {
            let slip = train.slip_row(element) * &speeds;
            [slip[0], slip[1]]
        };
        let elements = 0..self.elements.len();
        Some(elements.map(|element| if held.contains(&element) { [0.0; 2] } else { slip(element) }).collect())
    }

    /// Adds the shift between any two gears.
    fn add_shifts(
        &mut self,
        possible: impl Fn(usize, usize, &[usize]) -> bool,
        beside: impl Fn(usize, usize) -> bool,
        reduced: impl Fn(usize, usize, &Change) -> Option<ReducedShift<f64>>,
    ) {
        let engaged = |gear: usize| self.gears[gear].holding.iter().map(|holding| holding.element).collect::<Vec<_>>();
        let count = self.gears.len();
        let pairs = (0..count).flat_map(|from| (0..count).filter(move |&to| to != from).map(move |to| (from, to)));
        self.shifts = pairs
            .map(|(from, to)| {
                let change = change(&self.elements, &engaged(from), &engaged(to), &possible, &beside);
                Shift { from, to, reduced: reduced(from, to, &change), change }
            })
            .collect();
    }
}

fn from_stick_diagram(diagram: &StickDiagram, findings: &mut Findings) -> Option<Gearbox> {
    let train = train(diagram, findings);
    let has_teeth = findings.are_none();
    let gear_names = diagram.gears.iter().map(|gear| gear.name.as_str());
    names((Part::Gearbox, "gear"), Part::Gear, gear_names, findings);
    let of_gear = |(at, gear): (usize, &EngagedGear)| {
        let names = gear.engaged.iter().map(String::as_str);
        let engaged = engaged(at, names, element_names(diagram), findings);
        if let Some(torque) = gear.turbine_max_n_m {
            findings.keep(positive(Part::Gear(at), "turbine_max_n_m", torque));
        }
        let engaged = engaged?;
        match &train {
            Some((train, _)) => findings.keep(in_train(train, (at, gear), &engaged, has_teeth)),
            None => findings.keep(enough_engaged(diagram, (at, gear))).and(None),
        }
    };
    let gears: Vec<Option<Gear>> = diagram.gears.iter().enumerate().map(of_gear).collect();
    let (train, warnings) = train?;
    let gears: Vec<Gear> = gears.into_iter().collect::<Option<_>>()?;
    if !findings.are_none() {
        return None;
    }
    let elements = (train.elements.iter())
        .map(|element| GearboxElement { name: element.name.clone(), kind: element.kind, pack: element.pack })
        .collect();
    let mut gearbox = Gearbox::of(elements, gears);
    gearbox.warnings = warnings;
    gearbox.warnings.extend(inertia::check(diagram, &train));
    gearbox.add_shifts(
        |offgoing, oncoming, held| train.reduce(held, offgoing, oncoming).is_some(),
        |a, b| train.is_beside(a, b),
        |_, _, change| match change {
            Change::Single { offgoing, oncoming, held } => train.reduce(held, *offgoing, *oncoming),
            _ => None,
        },
    );
    gearbox.train = Some(train);
    Some(gearbox)
}

/// Refuses a gear that engages too few elements, by the numbers of shafts and sets alone: those of another gear are enough.
fn enough_engaged(diagram: &StickDiagram, (at, gear): (usize, &EngagedGear)) -> Result<(), Finding> {
    let wanted = diagram.shafts.len().checked_sub(diagram.sets.len() + diagram.pairs.len() + 1);
    let has_dogs = diagram.pairs.iter().any(|pair| pair.dog.is_some());
    let is_open =
        |wanted: usize| gear.engaged.len() < wanted && diagram.gears.iter().any(|other| other.engaged.len() == wanted);
    match wanted.filter(|&wanted| !has_dogs && is_open(wanted)) {
        None => Ok(()),
        wanted => {
            let fault = no_gear_fault(NoGear::Open, &gear.name, &gear.engaged, wanted);
            Err(Finding { part: Part::Gear(at), key: "engaged", fault })
        }
    }
}

/// A gear with its engaged elements in a train; its ratio is not compared unless the teeth are right.
fn in_train(
    train: &GearTrain,
    (at, gear): (usize, &EngagedGear),
    engaged: &[usize],
    has_teeth: bool,
) -> Result<Gear, Finding> {
    let about = |key, fault| Finding { part: Part::Gear(at), key, fault };
    // With dogs the idle shafts of a gear are free or not: there is no one number.
    let has_dogs = train.pairs.iter().any(|pair| pair.dog.is_some());
    let wanted = (!has_dogs).then(|| train.degrees_of_freedom() - 1);
    let wrong = |no_gear| about("engaged", no_gear_fault(no_gear, &gear.name, &gear.engaged, wanted));
    let motion = train.gear(engaged).map_err(wrong)?;
    let torques = train.holding_torques(engaged, motion.ratio);
    // A gear that turns has torques that hold it: both follow from the same rows.
    let (torques, holding_is_unique) = torques.ok_or_else(|| wrong(NoGear::Open))?;
    if let Some(stated) = gear.stated_ratio.filter(|stated| has_teeth && !stated.prints(motion.ratio)) {
        let fault = Fault::StatedRatio { gear: gear.name.clone(), found: motion.ratio, stated: stated.value };
        return Err(about("stated_ratio", fault));
    }
    let holding =
        engaged.iter().zip(torques).map(|(&element, per_turbine_torque)| Holding { element, per_turbine_torque });
    Ok(Gear {
        name: gear.name.clone(),
        ratio: motion.ratio,
        holding: holding.collect(),
        holding_is_unique,
        shaft_speeds: motion.speeds,
        turbine_max_n_m: gear.turbine_max_n_m,
    })
}

fn no_gear_fault(no_gear: NoGear, gear: &str, engaged: &[String], wanted: Option<usize>) -> Fault {
    let (gear, count) = (gear.to_owned(), engaged.len());
    let engaged = if engaged.is_empty() { "no element".to_owned() } else { engaged.join(", ") };
    match no_gear {
        NoGear::Locked => Fault::Locked { gear, engaged, count, wanted },
        NoGear::Open => Fault::Open { gear, engaged, count, wanted },
        NoGear::InputHeld => Fault::Held { gear, engaged, held: "input" },
        NoGear::OutputHeld => Fault::Held { gear, engaged, held: "output" },
    }
}

/// A ratio must be finite and not zero.
fn check_ratio(gear: usize, ratio: f64) -> Result<(), Finding> {
    let valid = ratio.is_finite() && ratio != 0.0;
    let fault = Fault::Number { value: ratio, expected: "turbine speed over output speed, negative in reverse" };
    if valid { Ok(()) } else { Err(Finding { part: Part::Gear(gear), key: "ratio", fault }) }
}

fn from_shares(shares: &Shares, findings: &mut Findings) -> Option<Gearbox> {
    let element_names = || shares.elements.iter().map(|element| element.0.as_str());
    names((Part::Gearbox, "element"), Part::Element, element_names(), findings);
    names((Part::Gearbox, "gear"), Part::Gear, shares.gears.iter().map(|gear| gear.name.as_str()), findings);
    let mut gears = Vec::new();
    for (at, gear) in shares.gears.iter().enumerate() {
        findings.keep(check_ratio(at, gear.ratio));
        let names = gear.shares.iter().map(|share| share.0.as_str());
        let places = engaged(at, names, element_names(), findings).unwrap_or_default();
        if let Some((_, value)) = gear.shares.iter().find(|share| !share.1.is_finite()) {
            let fault = Fault::Number { value: *value, expected: "torque of the element per turbine torque" };
            findings.0.push(Finding { part: Part::Gear(at), key: "shares", fault });
        }
        if let Some(torque) = gear.turbine_max_n_m {
            findings.keep(positive(Part::Gear(at), "turbine_max_n_m", torque));
        }
        let holding =
            places.iter().zip(&gear.shares).map(|(&element, share)| Holding { element, per_turbine_torque: share.1 });
        gears.push(Gear {
            holding: holding.collect(),
            turbine_max_n_m: gear.turbine_max_n_m,
            ..ratio_only(&gear.name, gear.ratio)
        });
    }
    let masses = masses(&shares.masses, &gears, findings);
    if !findings.are_none() {
        return None;
    }
    let elements = shares.elements.iter().map(|(name, kind, pack)| GearboxElement {
        name: name.clone(),
        kind: *kind,
        pack: *pack,
    });
    let mut gearbox = Gearbox::of(elements.collect(), gears);
    let gears = gearbox.gears.clone();
    let slip = |gear: usize, element: usize| {
        let share = gears[gear].holding.iter().find(|holding| holding.element == element)?.per_turbine_torque;
        (share != 0.0).then(|| [1.0 / share, -gears[gear].ratio / share])
    };
    gearbox.add_shifts(
        |_, _, _| true,
        |_, _| false,
        |from, to, change| match *change {
            Change::Single { offgoing, oncoming, .. } => Some(ReducedShift {
                mass_kg_m2: mass_of(&masses, from, to)?,
                slip_offgoing: slip(from, offgoing)?,
                slip_oncoming: slip(to, oncoming)?,
            }),
            _ => None,
        },
    );
    Some(gearbox)
}

fn from_ratios(ratios: &Ratios, findings: &mut Findings) -> Option<Gearbox> {
    names((Part::Gearbox, "gear"), Part::Gear, ratios.gears.iter().map(|gear| gear.name.as_str()), findings);
    findings.keep_all(ratios.gears.iter().enumerate().map(|(at, gear)| check_ratio(at, gear.ratio)));
    let gears: Vec<Gear> = ratios.gears.iter().map(|gear| ratio_only(&gear.name, gear.ratio)).collect();
    let masses = masses(&ratios.masses, &gears, findings);
    if !findings.are_none() {
        return None;
    }
    let mut gearbox = Gearbox::of(Vec::new(), gears);
    let forward = gearbox.forward_gears();
    let up = forward.windows(2).map(|pair| (pair[0], pair[1]));
    let both_ways = up.flat_map(|(low, high)| [(low, high), (high, low)]);
    // Torques at the turbine: `alpha` is 1.
    let slip = |gear: usize| [1.0, -gearbox.gears[gear].ratio];
    let shifts = both_ways.map(|(from, to)| {
        let mass = mass_of(&masses, from, to);
        let reduced =
            mass.map(|mass_kg_m2| ReducedShift { mass_kg_m2, slip_offgoing: slip(from), slip_oncoming: slip(to) });
        Shift { from, to, change: Change::Unknown, reduced }
    });
    gearbox.shifts = shifts.collect();
    Some(gearbox)
}

fn ratio_only(name: &str, ratio: f64) -> Gear {
    Gear {
        name: name.to_owned(),
        ratio,
        holding: Vec::new(),
        holding_is_unique: true,
        shaft_speeds: Vec::new(),
        turbine_max_n_m: None,
    }
}

/// Two gears and the mass of the shift between them.
type Mass = ([usize; 2], [[f64; 2]; 2]);

fn masses(masses: &[ShiftMass], gears: &[Gear], findings: &mut Findings) -> Vec<Mass> {
    let mut checked: Vec<Mass> = Vec::new();
    for (at, mass) in masses.iter().enumerate() {
        let about = |key, fault| Finding { part: Part::Mass(at), key, fault };
        let gear =
            |name: &String| place((Part::Mass(at), "gears"), "gear", name, gears.iter().map(|gear| gear.name.as_str()));
        let [a, b] = &mass.gears;
        let between = findings.keep_all(mass.gears.iter().map(gear)).map(|between| [between[0], between[1]]);
        let is_between = |other: &Mass| between.is_some_and(|[a, b]| other.0 == [a, b] || other.0 == [b, a]);
        if between.is_some_and(|[a, b]| a == b) || checked.iter().any(is_between) {
            findings.0.push(about("gears", Fault::Repeated(format!("{a}, {b}"))));
        }
        let diagonal = [("turbine_kg_m2", mass.turbine_kg_m2), ("output_kg_m2", mass.output_kg_m2)];
        let diagonal = diagonal.into_iter().map(|(key, mass)| positive(Part::Mass(at), key, mass));
        let is_positive = findings.keep_all(diagonal).is_some();
        let coupling = mass.coupling_kg_m2;
        let is_definite = mass.turbine_kg_m2 * mass.output_kg_m2 > coupling * coupling;
        if is_positive && !is_definite {
            findings.0.push(about("coupling_kg_m2", Fault::Mass(a.clone(), b.clone())));
        }
        let matrix = [[mass.turbine_kg_m2, coupling], [coupling, mass.output_kg_m2]];
        checked.extend(between.map(|between| (between, matrix)));
    }
    checked
}

fn mass_of(masses: &[Mass], from: usize, to: usize) -> Option<[[f64; 2]; 2]> {
    masses.iter().find(|(gears, _)| *gears == [from, to] || *gears == [to, from]).map(|(_, mass)| *mass)
}
