//! What is wrong with a description, where, and what to do about it.

use crate::description::HOUSING;

/// A part of a description, by its place in its list.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// The gearbox as a whole.
    Gearbox,
    /// A shaft.
    Shaft(usize),
    /// A planetary set.
    Set(usize),
    /// A gear pair.
    Pair(usize),
    /// An element.
    Element(usize),
    /// A gear.
    Gear(usize),
    /// The inertia of a shift.
    Mass(usize),
}

/// An error, or a warning, about one key of one part.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{fault}")]
pub struct Finding {
    /// The part.
    pub part: Part,
    /// The key.
    pub key: &'static str,
    /// What is wrong.
    #[source]
    pub fault: Fault,
}

/// What is wrong with a description, in the order in which it is checked: what does not follow from something else that is wrong.
#[derive(Debug, Default)]
pub(crate) struct Findings(pub(crate) Vec<Finding>);

impl Findings {
    /// What a check gives, or none and its finding among the others.
    pub(crate) fn keep<T>(&mut self, checked: Result<T, Finding>) -> Option<T> {
        checked.map_err(|finding| self.0.push(finding)).ok()
    }

    /// The same of the parts of a list; none unless each is right.
    pub(crate) fn keep_all<T>(&mut self, checked: impl Iterator<Item = Result<T, Finding>>) -> Option<Vec<T>> {
        // Each is checked, also behind a wrong one.
        let parts: Vec<Option<T>> = checked.map(|part| self.keep(part)).collect();
        parts.into_iter().collect()
    }

    pub(crate) fn are_none(&self) -> bool {
        self.0.is_empty()
    }
}

/// What can be wrong.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the message of each variant says what it is")]
pub enum Fault {
    #[error("there are none")]
    None,
    #[error("there are {count}, at most {maximum} are possible")]
    TooMany { count: usize, maximum: usize },
    #[error("two entries have the name \"{0}\"")]
    Repeated(String),
    #[error("\"{HOUSING}\" is the gearbox housing, which does not rotate")]
    HousingAsName,
    #[error("there is no {what} \"{name}\"")]
    Unknown { what: &'static str, name: String, known: Vec<String> },
    #[error("is {value}, expected {expected}")]
    Number { value: f64, expected: &'static str },
    #[error("input and output are the same shaft \"{0}\"")]
    InputIsOutput(String),
    #[error("\"{0}\" is connected to nothing")]
    Loose(String),
    #[error("{0} are the same: the set cannot turn in itself")]
    SameMembers(&'static str),
    #[error("both sides are \"{0}\"")]
    SameSides(String),
    #[error("a brake has the housing on one side")]
    BrakeWithoutHousing,
    #[error("a clutch connects two shafts, but one side is the housing")]
    ClutchToHousing,
    #[error("the planetary sets and gear pairs are not independent: one of them follows from the others")]
    DependentSets,
    #[error("the sets leave {0} degrees of freedom; a gearbox with gears needs at least 2")]
    Freedom(usize),
    #[error("input and output turn in the ratio {0:.4} with all elements open: there are no gears")]
    NoNeutral(f64),
    #[error("\"{gear}\" engages {engaged}: input and output cannot turn")]
    Locked { gear: String, engaged: String, count: usize, wanted: Option<usize> },
    #[error("\"{gear}\" engages {engaged}: the ratio of input to output is not determined")]
    Open { gear: String, engaged: String, count: usize, wanted: Option<usize> },
    #[error("\"{gear}\" engages {engaged}: the {held} is held")]
    Held { gear: String, engaged: String, held: &'static str },
    #[error("the ratio of \"{gear}\" is {found:.4}, but {stated} is stated")]
    StatedRatio { gear: String, found: f64, stated: f64 },
    #[error("the ring has {ring} teeth, the sun inside it {sun}")]
    RingInSun { ring: u32, sun: u32 },
    #[error("a planet between a sun of {sun} and a ring of {ring} teeth has {planet} teeth")]
    SmallPlanet { ring: u32, sun: u32, planet: u32 },
    #[error("has {found} numbers, expected {wanted}: teeth of a planet, from the sun outwards")]
    PlanetTeeth { found: usize, wanted: usize },
    #[error("sun, planets and ring do not mesh: {0}")]
    Coaxial(String),
    #[error("ring less sun is {0} teeth, which is odd: planets of half of it do not exist")]
    Odd(u32),
    #[error("{count} planets cannot stand at equal distances: {sum} teeth are not divisible by {count}")]
    Assembly { count: u32, sum: u32 },
    #[error("{count} planets of {planet} teeth touch each other")]
    Crowded { count: u32, planet: u32 },
    #[error("\"{element}\" slips in \"{gear}\": it holds {capacity_n_m:.0} N m, {wanted_n_m:.0} N m are required")]
    Capacity { element: String, gear: String, capacity_n_m: f64, wanted_n_m: f64, line_pressure_pa: f64 },
    #[error("the one-way clutch \"{element}\" would have to drive its input side in \"{gear}\"")]
    OneWay { element: String, gear: String },
    #[error("the one-way clutch \"{element}\" would turn in \"{gear}\" in the direction in which it holds")]
    OneWayBlocks { element: String, gear: String },
    #[error("there is no forward gear: all ratios are negative")]
    NoForward,
    #[error("no gear engages \"{0}\"")]
    Unused(String),
    #[error("\"{gear}\" engages the same elements as \"{other}\"")]
    SameElements { gear: String, other: String },
    #[error("the ratio of \"{gear}\" is {ratio:.4}, larger than {before_ratio:.4} of \"{before}\" before it")]
    Order { gear: String, ratio: f64, before: String, before_ratio: f64 },
    #[error("is {value} kg m2; what turns with it usually has {} to {} kg m2", two_digits(range[0]), two_digits(range[1]))]
    Inertia { value: f64, range: [f64; 2], unit: Option<(&'static str, f64)> },
    #[error("is missing")]
    Missing(&'static str),
    #[error("the mass of the shift between \"{0}\" and \"{1}\" is not positive definite")]
    Mass(String, String),
}

impl Fault {
    /// What to do, where it is known.
    pub fn hint(&self) -> Option<String> {
        let hint = match self {
            Self::Unknown { what, known, .. } if known.is_empty() => format!("the file describes no {what}"),
            Self::Unknown { what, known, .. } => format!("the {what}s are {}", known.join(", ")),
            Self::Repeated(_) => "give each its own name".to_owned(),
            Self::HousingAsName => format!("choose another name; members and sides that are at rest are \"{HOUSING}\""),
            Self::Loose(_) => "name the shaft as a member of a set, in a gear pair or as a side of an element, or leave it out".to_owned(),
            Self::SameMembers(_) => "a set connects three different shafts, at most one of them may be the housing".to_owned(),
            Self::SameSides(_) => "an element connects two different shafts, or a shaft and the housing".to_owned(),
            Self::BrakeWithoutHousing => {
                format!("give `input = \"{HOUSING}\"`, or `kind = \"clutch\"` for an element between two shafts")
            }
            Self::ClutchToHousing => "an element between housing and shaft is `kind = \"brake\"`".to_owned(),
            Self::DependentSets => "check the members of the sets: two sets with the same three shafts fix all speeds".to_owned(),
            Self::Freedom(_) => "degrees of freedom are shafts less sets less gear pairs without a dog: add the missing shaft, or give a member the housing".to_owned(),
            Self::NoNeutral(_) => "a set or gear pair joins them for good: check its members, or give the gear pair a dog".to_owned(),
            Self::Locked { count, wanted: Some(wanted), .. } if count > wanted => {
                format!("{wanted} engaged elements are enough for a gear of this gearbox: remove {}", count - wanted)
            }
            Self::Locked { .. } | Self::Held { .. } => {
                "check the sides of these elements, and whether the gear engages them".to_owned()
            }
            Self::Open { count, wanted: Some(wanted), .. } if count < wanted => {
                format!("a gear of this gearbox engages {wanted} elements: add {}", wanted - count)
            }
            Self::Open { wanted: None, .. } => "engage the elements that connect input and output: a clutch and a dog".to_owned(),
            Self::Open { .. } => "two of these elements do the same: check their sides, and whether the gear engages them".to_owned(),
            Self::StatedRatio { found, stated, .. } if (found + stated).abs() < 0.02 * stated.abs() => {
                "the sign differs: a single-planet set in place of a double-planet one, or an idler, turns the output".to_owned()
            }
            Self::StatedRatio { .. } => "check teeth, `planets` and the engaged elements; leave `stated_ratio` out if it is not known".to_owned(),
            Self::RingInSun { .. } => "a ring has more teeth than the sun inside it".to_owned(),
            Self::SmallPlanet { .. } => "check the teeth of sun and ring".to_owned(),
            Self::PlanetTeeth { .. } => "one number for `planets = \"single\"`, two for \"double\"".to_owned(),
            Self::Coaxial(_) => "check the teeth of planet, sun and ring".to_owned(),
            Self::Odd(odd) => format!("this needs planets of {} or {} teeth with profile shift; check the teeth", odd / 2, odd / 2 + 1),
            Self::Assembly { .. } => "the planets stand at unequal distances, or the number of planets or of teeth is wrong".to_owned(),
            Self::Crowded { .. } => "check `planet_count`".to_owned(),
            Self::Capacity { element, capacity_n_m, wanted_n_m, line_pressure_pa, .. } => format!(
                "with {:.1} times the friction faces or the piston area \"{element}\" would hold at {:.2} MPa; or decrease `turbine_max_n_m`",
                wanted_n_m / capacity_n_m,
                1e-6 * line_pressure_pa
            ),
            Self::OneWay { .. } => "swap its `input` and `output`, or engage a brake or clutch in its place".to_owned(),
            Self::OneWayBlocks { .. } => "swap its `input` and `output`: it overruns in the gears that do not engage it".to_owned(),
            Self::NoForward => "a gear pair turns the direction round: `idler = true` keeps it, and so does a second pair, as that to the output or of the \
                                differential; in a table of ratios those of forward gears are positive"
                .to_owned(),
            Self::Unused(_) => "engage it in a gear, or leave it out: it is open in all of them".to_owned(),
            Self::SameElements { .. } => "two names of one gear: check `engaged` of both".to_owned(),
            Self::Order { .. } => "gears are listed from the largest ratio to the smallest, each ratio turbine over output speed".to_owned(),
            Self::Inertia { value, unit: Some((unit, kg_m2)), .. } => format!("{value} {unit} is {} kg m2: check the unit", two_digits(*kg_m2)),
            Self::Inertia { .. } => "it is the sum of m r2 of sun, ring, carrier and clutch drums on this shaft: 1 kg at a radius of 70 mm has 0.0049 kg m2; \
                                     radii in m, not diameters"
                .to_owned(),
            Self::Missing(why) => (*why).to_owned(),
            Self::Mass(..) => "`turbine_kg_m2` and `output_kg_m2` are positive and their product is larger than the square of `coupling_kg_m2`".to_owned(),
            Self::None | Self::TooMany { .. } | Self::Number { .. } | Self::InputIsOutput(_) => return None,
        };
        Some(hint)
    }
}

/// A number with two digits that count.
fn two_digits(value: f64) -> f64 {
    format!("{value:.1e}").parse().unwrap_or(value)
}
