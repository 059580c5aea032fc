//! What is possible in a gearbox and seldom meant: elements without a gear, gears with the same elements, ratios out of order.

use crate::finding::{Fault, Finding, Part};
use crate::gearbox::Gearbox;

/// What is unusual about the gears of a gearbox.
pub(crate) fn find(gearbox: &Gearbox) -> Vec<Finding> {
    let mut found = Vec::new();
    for (at, element) in gearbox.elements.iter().enumerate() {
        let is_used = gearbox.gears.iter().any(|gear| gear.holding.iter().any(|holding| holding.element == at));
        if !is_used {
            let fault = Fault::Unused(element.name.clone());
            found.push(Finding { part: Part::Element(at), key: "name", fault });
        }
    }
    let engaged = |at: usize| {
        let mut elements: Vec<usize> = gearbox.gears[at].holding.iter().map(|holding| holding.element).collect();
        elements.sort_unstable();
        elements
    };
    for (at, gear) in gearbox.gears.iter().enumerate() {
        if let Some(other) = (0..at).find(|&other| !engaged(at).is_empty() && engaged(other) == engaged(at)) {
            let fault = Fault::SameElements { gear: gear.name.clone(), other: gearbox.gears[other].name.clone() };
            found.push(Finding { part: Part::Gear(at), key: "engaged", fault });
        }
    }
    // Of gears in the opposite order one is enough to say so.
    let forward: Vec<usize> = (0..gearbox.gears.len()).filter(|&at| gearbox.gears[at].ratio > 0.0).collect();
    let rises = |pair: &&[usize]| gearbox.gears[pair[0]].ratio < gearbox.gears[pair[1]].ratio;
    if let Some(&[before, at]) = forward.windows(2).find(rises) {
        let (before, gear) = (&gearbox.gears[before], &gearbox.gears[at]);
        let fault = Fault::Order {
            gear: gear.name.clone(),
            ratio: gear.ratio,
            before: before.name.clone(),
            before_ratio: before.ratio,
        };
        found.push(Finding { part: Part::Gear(at), key: "name", fault });
    }
    found
}
