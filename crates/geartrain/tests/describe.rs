//! Descriptions of small gearboxes.

use drivetrain::{Clutch, Table1};
use geartrain::{
    Description, Element, ElementKind, EngagedGear, Given, HOUSING, PlanetarySet, Planets, Shaft, StickDiagram,
};

pub(crate) fn shaft(name: &str, inertia_kg_m2: f64) -> Shaft {
    Shaft { name: name.to_owned(), inertia_kg_m2 }
}

pub(crate) fn set([sun, carrier, ring]: [&str; 3], sun_teeth: u32, ring_teeth: u32) -> PlanetarySet<String> {
    let [sun, carrier, ring] = [sun, carrier, ring].map(str::to_owned);
    PlanetarySet {
        sun,
        carrier,
        ring,
        sun_teeth,
        ring_teeth,
        planets: Planets::Single,
        planet_count: None,
        planet_teeth: vec![],
    }
}

pub(crate) fn element(name: &str, input: &str, output: &str) -> Element {
    let kind = if input == HOUSING { ElementKind::Brake } else { ElementKind::Clutch };
    Element { name: name.to_owned(), kind, input: input.to_owned(), output: output.to_owned(), pack: None }
}

pub(crate) fn gear(name: &str, engaged: &[&str]) -> EngagedGear {
    let engaged = engaged.iter().map(|&name| name.to_owned()).collect();
    EngagedGear { name: name.to_owned(), engaged, stated_ratio: None, turbine_max_n_m: None }
}

/// A clutch that holds 0.12 x 0.1 m x 4 x (0.01 m^2 x p - 500 N).
pub(crate) fn pack() -> Clutch<f64> {
    Clutch {
        mean_radius_m: 0.1,
        friction_faces: 4.0,
        piston_area_m2: 0.01,
        return_spring_n: 500.0,
        friction: Table1::new(&[0.0, 1000.0], &[0.12, 0.12]).unwrap(),
        static_friction: 0.12,
    }
}

/// The chapter's two-speed gearbox.
pub(crate) fn two_speed() -> StickDiagram {
    StickDiagram {
        input: "turbine".to_owned(),
        output: "carrier".to_owned(),
        shafts: vec![shaft("turbine", 0.06), shaft("ring", 0.01), shaft("carrier", 0.15)],
        sets: vec![set(["turbine", "carrier", "ring"], 40, 60)],
        pairs: vec![],
        elements: vec![element("A", HOUSING, "ring"), element("B", "turbine", "ring")],
        gears: vec![gear("1", &["A"]), gear("2", &["B"])],
    }
}

pub(crate) fn described(diagram: StickDiagram) -> Description {
    Description { name: "test".to_owned(), line_pressure_pa: None, given: Given::StickDiagram(diagram) }
}
