//! Keys of a gearbox file.

use std::collections::BTreeMap;

use serde::Deserialize;
use toml::Spanned;

use crate::check::{Number, Numbers, Word};

/// What every gearbox file has; the rest depends on the level.
#[derive(Deserialize)]
pub(super) struct RawHead {
    pub(super) level: Option<Spanned<toml::Value>>,
}

/// `level = "stick-diagram"`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawStickDiagram {
    pub(super) name: Word,
    #[serde(rename = "level")]
    pub(super) _level: Word,
    pub(super) line_pressure_pa: Option<Number>,
    pub(super) input: Word,
    pub(super) output: Word,
    pub(super) shaft: Spanned<Vec<RawShaft>>,
    #[serde(default)]
    pub(super) planetary_set: Vec<Spanned<RawPlanetarySet>>,
    #[serde(default)]
    pub(super) gear_pair: Vec<Spanned<RawGearPair>>,
    #[serde(default)]
    pub(super) element: Vec<RawElement>,
    pub(super) gear: Spanned<Vec<RawEngagedGear>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawShaft {
    pub(super) name: Word,
    pub(super) inertia_kg_m2: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawPlanetarySet {
    pub(super) sun: Word,
    pub(super) carrier: Word,
    pub(super) ring: Word,
    pub(super) sun_teeth: Number,
    pub(super) ring_teeth: Number,
    #[serde(default)]
    pub(super) planets: RawPlanets,
    pub(super) planet_count: Option<Number>,
    pub(super) planet_teeth: Option<Numbers>,
}

#[derive(Deserialize, Default, Clone, Copy)]
#[serde(rename_all = "kebab-case")]
pub(super) enum RawPlanets {
    #[default]
    Single,
    Double,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawGearPair {
    pub(super) driver: Word,
    pub(super) driven: Word,
    pub(super) driver_teeth: Number,
    pub(super) driven_teeth: Number,
    #[serde(default)]
    pub(super) idler: bool,
    pub(super) dog: Option<Word>,
}

#[derive(Deserialize, Clone, Copy)]
#[serde(rename_all = "kebab-case")]
pub(super) enum RawKind {
    Clutch,
    Brake,
    OneWayClutch,
    Dog,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawElement {
    pub(super) name: Word,
    pub(super) kind: RawKind,
    pub(super) input: Word,
    pub(super) output: Word,
    pub(super) pack: Option<RawPack>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawPack {
    pub(super) friction_faces: Number,
    pub(super) mean_radius_m: Number,
    pub(super) friction_coefficient: Number,
    pub(super) piston_area_m2: Number,
    pub(super) return_spring_n: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawEngagedGear {
    pub(super) name: Word,
    pub(super) engaged: Vec<String>,
    pub(super) stated_ratio: Option<Number>,
    pub(super) turbine_max_n_m: Option<Number>,
}

/// `level = "shares"`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawShares {
    pub(super) name: Word,
    #[serde(rename = "level")]
    pub(super) _level: Word,
    pub(super) line_pressure_pa: Option<Number>,
    pub(super) element: Vec<RawSharedElement>,
    pub(super) gear: Spanned<Vec<RawSharedGear>>,
    #[serde(default)]
    pub(super) shift_mass: Vec<Spanned<RawShiftMass>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawSharedElement {
    pub(super) name: Word,
    pub(super) kind: RawKind,
    pub(super) pack: Option<RawPack>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawSharedGear {
    pub(super) name: Word,
    pub(super) ratio: Number,
    pub(super) shares: BTreeMap<String, f64>,
    pub(super) turbine_max_n_m: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawShiftMass {
    pub(super) gears: Vec<String>,
    pub(super) turbine_kg_m2: Number,
    pub(super) coupling_kg_m2: Number,
    pub(super) output_kg_m2: Number,
}

/// `level = "ratios"`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawRatios {
    pub(super) name: Word,
    #[serde(rename = "level")]
    pub(super) _level: Word,
    pub(super) gear: Spanned<Vec<RawRatio>>,
    #[serde(default)]
    pub(super) shift_mass: Vec<Spanned<RawShiftMass>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RawRatio {
    pub(super) name: Word,
    pub(super) ratio: Number,
}
