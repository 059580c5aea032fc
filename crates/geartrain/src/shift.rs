//! From one gear to another: which elements change.

use drivetrain::{ReducedShift, ShiftKind};

use crate::description::ElementKind;
use crate::gearbox::{Gear, Gearbox, GearboxElement, Holding};
use crate::train::ZERO;

/// A change of gear.
#[derive(Debug, Clone, PartialEq)]
pub struct Shift {
    /// The gear before.
    pub from: usize,
    /// The gear after.
    pub to: usize,
    /// The elements that change.
    pub change: Change,
    /// The shift reduced to turbine and output speed; torques are those of the elements, or referred to the turbine where
    /// only ratios are known. `None` where the inertia is not known, for changes of more elements, and where turbine and
    /// output speed do not determine the others.
    pub reduced: Option<ReducedShift<f64>>,
}

/// The elements that change in a shift, by their places in the list of elements.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Change {
    /// One element off, one on: a clutch-to-clutch shift.
    Single {
        /// The element that opens.
        offgoing: usize,
        /// The element that closes.
        oncoming: usize,
        /// The elements that stay engaged. The dogs of both gears of a dual clutch are among them, and a clutch or brake that
        /// holds in one of the gears what a one-way clutch beside it holds in the other.
        held: Vec<usize>,
    },
    /// Several elements change at once: a double or triple transition.
    Several {
        /// The elements that open.
        offgoing: Vec<usize>,
        /// The elements that close.
        oncoming: Vec<usize>,
    },
    /// Only dogs change: the flow of power is interrupted, or the shift goes through a gear of the other clutch.
    Interrupted {
        /// The dogs that open.
        offgoing: Vec<usize>,
        /// The dogs that close.
        oncoming: Vec<usize>,
    },
    /// The elements are not known.
    Unknown,
}

impl Shift {
    /// Power-on or power-off, up or down, at this turbine torque.
    pub fn kind(&self, gears: &[Gear], turbine_n_m: f64) -> Option<ShiftKind> {
        ShiftKind::of(turbine_n_m, gears[self.from].ratio, gears[self.to].ratio)
    }

    /// Whether a dog that takes or gives up the load does so with an engine that drives, between gears of one direction: it is taken out without load
    /// at the end of the torque phase of an upshift, and put in at the synchronous speed of a downshift, up to which the offgoing clutch
    /// has held the turbine. True where no dog changes.
    pub fn changes_dog_under_power(&self, gearbox: &Gearbox) -> bool {
        let Change::Single { offgoing, oncoming, .. } = &self.change else { return true };
        let [from, to] = [self.from, self.to].map(|gear| gearbox.gears[gear].ratio);
        let fits = |element: usize, is_fit: bool| !gearbox.is_dog(element) || (is_fit && from * to > ZERO);
        fits(*offgoing, from.abs() > to.abs()) && fits(*oncoming, from.abs() < to.abs())
    }

    /// Whether an element that changes holds the turbine in one direction alone: a one-way clutch that is engaged in both gears, as the sprag
    /// behind a brake, holds the gear of this element too. While it overruns, this element carries nothing.
    pub fn is_one_sided(&self, gearbox: &Gearbox, element: usize) -> bool {
        let Change::Single { offgoing, oncoming, held } = &self.change else { return false };
        let gear = match element {
            _ if element == *offgoing => self.from,
            _ if element == *oncoming => self.to,
            _ => return false,
        };
        let holds =
            |of: &Holding| held.contains(&of.element) && gearbox.is_one_way(of.element) && of.per_turbine_torque > ZERO;
        gearbox.gears.get(gear).is_some_and(|gear| gear.holding.iter().any(holds))
    }
}

impl Change {
    /// The element that opens and the one that closes, of a shift from one clutch to another.
    pub fn single(&self) -> Option<[usize; 2]> {
        match self {
            Self::Single { offgoing, oncoming, .. } => Some([*offgoing, *oncoming]),
            _ => None,
        }
    }

    /// What the trade calls it.
    pub fn name(&self) -> String {
        match self {
            Self::Single { .. } => "single".to_owned(),
            Self::Several { offgoing, oncoming } => match (offgoing.len(), oncoming.len()) {
                (2, 2) => "double".to_owned(),
                (3, 3) => "triple".to_owned(),
                (off, on) => format!("{off} off, {on} on"),
            },
            Self::Interrupted { .. } => "interrupted".to_owned(),
            Self::Unknown => "unknown".to_owned(),
        }
    }
}

/// The change between two gears. `possible` says whether two elements can change while others are held, `beside` whether
/// two elements connect the same.
pub(crate) fn change(
    elements: &[GearboxElement],
    from: &[usize],
    to: &[usize],
    possible: impl Fn(usize, usize, &[usize]) -> bool,
    beside: impl Fn(usize, usize) -> bool,
) -> Change {
    let only = |of: &[usize], other: &[usize]| -> Vec<usize> {
        of.iter().copied().filter(|element| !other.contains(element)).collect()
    };
    let is_dog = |element: usize| elements[element].kind == ElementKind::Dog;
    let (off, on) = (only(from, to), only(to, from));
    let common: Vec<usize> = from.iter().copied().filter(|element| to.contains(element)).collect();
    // The dogs of both gears are in while two clutches hand over.
    if let ([offgoing], [oncoming]) = (&*without_dogs(&off, is_dog), &*without_dogs(&on, is_dog)) {
        let dogs = off.iter().chain(&on).copied().filter(|&element| is_dog(element));
        let held: Vec<usize> = common.iter().copied().chain(dogs).collect();
        if held.len() == common.len() || possible(*offgoing, *oncoming, &held) {
            return Change::Single { offgoing: *offgoing, oncoming: *oncoming, held };
        }
    }
    // A clutch or brake may hold through the shift what the one-way clutch beside it holds in one of the gears.
    let is_one_way = |element: usize| elements[element].kind == ElementKind::OneWayClutch;
    let partner = |element: usize, others: &[usize]| {
        others.iter().copied().find(|&other| is_one_way(element) != is_one_way(other) && beside(element, other))
    };
    let changing = |of: &[usize], others: &[usize]| -> Vec<usize> {
        of.iter().copied().filter(|&element| partner(element, others).is_none()).collect()
    };
    if let ([offgoing], [oncoming]) = (&*changing(&off, &on), &*changing(&on, &off)) {
        let stays = off.iter().filter_map(|&element| {
            let other = partner(element, &on)?;
            Some(if is_one_way(element) { other } else { element })
        });
        let held: Vec<usize> = common.iter().copied().chain(stays).collect();
        if held.len() > common.len() && possible(*offgoing, *oncoming, &held) {
            return Change::Single { offgoing: *offgoing, oncoming: *oncoming, held };
        }
    }
    match (&*off, &*on) {
        _ if off.iter().chain(&on).all(|&element| is_dog(element)) => {
            Change::Interrupted { offgoing: off, oncoming: on }
        }
        (&[offgoing], &[oncoming]) => Change::Single { offgoing, oncoming, held: common },
        _ => Change::Several { offgoing: off, oncoming: on },
    }
}

fn without_dogs(elements: &[usize], is_dog: impl Fn(usize) -> bool) -> Vec<usize> {
    elements.iter().copied().filter(|&element| !is_dog(element)).collect()
}
