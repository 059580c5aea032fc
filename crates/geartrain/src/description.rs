//! What a gearbox file says, before it is checked.

use drivetrain::{Clutch, Real};

/// Name of the gearbox housing as a member of a set or a side of an element.
pub const HOUSING: &str = "housing";

/// A gearbox.
#[derive(Debug, Clone, PartialEq)]
pub struct Description {
    /// Name for people.
    pub name: String,
    /// Largest pressure that the elements can be given, Pa; needed for the check of their capacity.
    pub line_pressure_pa: Option<f64>,
    /// What is known of it.
    pub given: Given,
}

/// The three levels on which a gearbox can be described.
#[derive(Debug, Clone, PartialEq)]
pub enum Given {
    /// Shafts, planetary sets, gear pairs and elements: everything follows.
    StickDiagram(StickDiagram),
    /// Ratios and holding torques: everything but the inertia follows.
    Shares(Shares),
    /// Ratios alone: torques are known at the turbine only.
    Ratios(Ratios),
}

/// A gearbox as its maker draws it.
#[derive(Debug, Clone, PartialEq)]
pub struct StickDiagram {
    /// Shaft of the turbine, or of the engine side of a dual clutch.
    pub input: String,
    /// Shaft of the gearbox output.
    pub output: String,
    /// The shafts.
    pub shafts: Vec<Shaft>,
    /// The planetary sets.
    pub sets: Vec<PlanetarySet<String>>,
    /// The gear pairs.
    pub pairs: Vec<GearPair<String>>,
    /// Clutches, brakes, one-way clutches and dogs; the dogs of gear pairs are not listed here.
    pub elements: Vec<Element>,
    /// The gears.
    pub gears: Vec<EngagedGear>,
}

/// A shaft with what turns with it.
#[derive(Debug, Clone, PartialEq)]
pub struct Shaft {
    /// Its name.
    pub name: String,
    /// Moment of inertia, kg m^2.
    pub inertia_kg_m2: f64,
}

/// Planets between sun and ring.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Planets {
    /// Each planet meshes with sun and ring.
    Single,
    /// Pairs of planets: one meshes with the sun, the other with the ring.
    Double,
}

/// A planetary set whose members are given as `M`.
///
/// Single planets: `w_s Z_s + w_r Z_r = w_c (Z_s + Z_r)`, Eq. (2.5). Pairs of planets: the same with `-Z_s` for `Z_s`. A
/// Ravigneaux set is two sets with the same ring and carrier.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanetarySet<M> {
    /// The sun.
    pub sun: M,
    /// The carrier.
    pub carrier: M,
    /// The ring.
    pub ring: M,
    /// Teeth of the sun.
    pub sun_teeth: u32,
    /// Teeth of the ring.
    pub ring_teeth: u32,
    /// What is between them.
    pub planets: Planets,
    /// Number of planets, or of pairs of planets.
    pub planet_count: Option<u32>,
    /// Teeth of a planet, from the sun outwards.
    pub planet_teeth: Vec<u32>,
}

/// Two gears on parallel shafts given as `M`: `w_a Z_a + w_b Z_b = 0`, with an idler between them `w_a Z_a = w_b Z_b`.
#[derive(Debug, Clone, PartialEq)]
pub struct GearPair<M> {
    /// Shaft on the side of the input.
    pub driver: M,
    /// Shaft on the side of the output.
    pub driven: M,
    /// Teeth on the driver.
    pub driver_teeth: u32,
    /// Teeth on the driven shaft.
    pub driven_teeth: u32,
    /// Whether an idler is between them.
    pub idler: bool,
    /// Name of the dog clutch that connects the gear with its shaft; without one the pair is always in mesh.
    pub dog: Option<String>,
}

/// What an element is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ElementKind {
    /// Friction clutch between two shafts.
    Clutch,
    /// Friction clutch between housing and shaft.
    Brake,
    /// Carries torque in one direction only.
    OneWayClutch,
    /// Positive engagement without friction.
    Dog,
}

impl ElementKind {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Clutch => "clutch",
            Self::Brake => "brake",
            Self::OneWayClutch => "one-way clutch",
            Self::Dog => "dog",
        }
    }

    /// Whether it carries its torque by plates.
    pub fn has_plates(self) -> bool {
        matches!(self, Self::Clutch | Self::Brake)
    }
}

/// An element of a stick diagram.
#[derive(Debug, Clone, PartialEq)]
pub struct Element {
    /// Its name.
    pub name: String,
    /// What it is.
    pub kind: ElementKind,
    /// Shaft of its input side, or the housing.
    pub input: String,
    /// Shaft of its output side.
    pub output: String,
    /// Its friction plates and piston.
    pub pack: Option<Clutch<f64>>,
}

/// The ratio that a maker prints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StatedRatio {
    /// The number.
    pub value: f64,
    /// Digits after the point. Some makers round the last one, others truncate.
    pub decimals: i32,
}

impl StatedRatio {
    /// Whether this ratio can be printed so, rounded or truncated.
    pub fn prints(&self, ratio: f64) -> bool {
        let unit = Real::powi(10.0, -self.decimals);
        // A little more for the rounding of the numbers themselves.
        let truncated = (ratio.abs() - self.value.abs() + 1e-9 * unit) / unit;
        ratio * self.value > 0.0 && (-0.5..1.0).contains(&truncated)
    }
}

/// A gear of a stick diagram.
#[derive(Debug, Clone, PartialEq)]
pub struct EngagedGear {
    /// Its name.
    pub name: String,
    /// The engaged elements.
    pub engaged: Vec<String>,
    /// The ratio it should have.
    pub stated_ratio: Option<StatedRatio>,
    /// Largest turbine torque in this gear, N m; the engaged elements must hold it.
    pub turbine_max_n_m: Option<f64>,
}

/// A gearbox by the ratios of its gears and the holding torques of its elements.
#[derive(Debug, Clone, PartialEq)]
pub struct Shares {
    /// The elements: name, kind, plates.
    pub elements: Vec<(String, ElementKind, Option<Clutch<f64>>)>,
    /// The gears.
    pub gears: Vec<SharedGear>,
    /// Inertia of the shifts.
    pub masses: Vec<ShiftMass>,
}

/// A gear with the holding torques of its engaged elements.
#[derive(Debug, Clone, PartialEq)]
pub struct SharedGear {
    /// Its name.
    pub name: String,
    /// Turbine speed over output speed.
    pub ratio: f64,
    /// Holding torque of each engaged element per turbine torque.
    pub shares: Vec<(String, f64)>,
    /// Largest turbine torque in this gear, N m.
    pub turbine_max_n_m: Option<f64>,
}

/// The inertia of a shift between two gears in either direction, `1/2 (w_t, w_0) M (w_t, w_0)'` of kinetic energy.
#[derive(Debug, Clone, PartialEq)]
pub struct ShiftMass {
    /// The two gears.
    pub gears: [String; 2],
    /// `M11`, kg m^2.
    pub turbine_kg_m2: f64,
    /// `M12`, kg m^2; of either sign.
    pub coupling_kg_m2: f64,
    /// `M22`, kg m^2.
    pub output_kg_m2: f64,
}

/// A gearbox by its ratios alone.
#[derive(Debug, Clone, PartialEq)]
pub struct Ratios {
    /// The gears.
    pub gears: Vec<Ratio>,
    /// Inertia of the shifts.
    pub masses: Vec<ShiftMass>,
}

/// A gear of which only the ratio is known.
#[derive(Debug, Clone, PartialEq)]
pub struct Ratio {
    /// Its name.
    pub name: String,
    /// Turbine speed over output speed.
    pub ratio: f64,
}
