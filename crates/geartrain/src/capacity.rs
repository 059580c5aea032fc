//! What the engaged elements hold, and what is asked of them.

use crate::finding::{Fault, Finding, Findings, Part};
use crate::gearbox::{Gear, GearboxElement};

/// Capacity of an element beside the largest torque that it must hold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Capacity {
    /// The element.
    pub element: usize,
    /// The gear in which it holds most.
    pub gear: usize,
    /// Torque that it holds at line pressure, N m.
    pub capacity_n_m: f64,
    /// Torque that it must hold in this gear, N m.
    pub wanted_n_m: f64,
}

impl Capacity {
    /// An element that holds `capacity_n_m`, in the gear that asks most of it; of gears that ask the same in the first one.
    /// `turbine_n_m` is the largest turbine torque in a gear, N m, where it is known. `None` where no gear asks anything.
    pub fn where_most_is_asked(
        element: usize,
        capacity_n_m: f64,
        gears: &[Gear],
        turbine_n_m: impl Fn(usize) -> Option<f64>,
    ) -> Option<Self> {
        let asked = gears.iter().enumerate().filter_map(|(gear, of)| {
            let holding = of.holding.iter().find(|holding| holding.element == element)?;
            Some((gear, holding.per_turbine_torque.abs() * turbine_n_m(gear)?))
        });
        let (gear, wanted_n_m) = asked.rev().max_by(|a, b| a.1.total_cmp(&b.1))?;
        (wanted_n_m > 0.0).then_some(Self { element, gear, capacity_n_m, wanted_n_m })
    }

    /// Capacity over the torque asked.
    pub fn ratio(&self) -> f64 {
        self.capacity_n_m / self.wanted_n_m
    }

    /// Whether the element holds.
    pub fn holds(&self) -> bool {
        self.capacity_n_m >= self.wanted_n_m
    }
}

/// The element's capacity, where its plates, the line pressure and the torque asked are known.
fn of_element(element: &GearboxElement, at: usize, gears: &[Gear], line_pressure_pa: f64) -> Option<Capacity> {
    let capacity_n_m = element.pack?.static_capacity(line_pressure_pa);
    Capacity::where_most_is_asked(at, capacity_n_m, gears, |gear| gears[gear].turbine_max_n_m)
}

/// The capacity of every element for which it is known, with a finding for each that slips.
pub(crate) fn check(
    elements: &[GearboxElement],
    gears: &[Gear],
    line_pressure_pa: Option<f64>,
    findings: &mut Findings,
) -> Vec<Capacity> {
    let needed = elements.iter().any(|element| element.pack.is_some())
        && gears.iter().any(|gear| gear.turbine_max_n_m.is_some());
    let Some(line_pressure_pa) = line_pressure_pa else {
        let why = "the capacity of the elements is checked at this pressure; 1.0e6 to 2.0e6 are usual";
        if needed {
            findings.0.push(Finding { part: Part::Gearbox, key: "line_pressure_pa", fault: Fault::Missing(why) });
        }
        return Vec::new();
    };
    let of = |(at, element)| of_element(element, at, gears, line_pressure_pa);
    let capacities: Vec<Capacity> = elements.iter().enumerate().filter_map(of).collect();
    findings.0.extend(capacities.iter().filter(|capacity| !capacity.holds()).map(|capacity| {
        let &Capacity { element, gear, capacity_n_m, wanted_n_m } = capacity;
        let (name, gear) = (elements[element].name.clone(), gears[gear].name.clone());
        let fault = Fault::Capacity { element: name, gear, capacity_n_m, wanted_n_m, line_pressure_pa };
        Finding { part: Part::Element(element), key: "pack", fault }
    }));
    capacities
}
