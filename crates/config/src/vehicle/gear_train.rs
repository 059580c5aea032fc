//! The gear train of a vehicle file: names turned into shafts, then reduced to the shift.

use drivetrain::{GearTrain, Member, PlanetarySet, ReducedShift};

use super::raw::{RawPlanetarySet, RawShaft, RawVehicleFile};
use crate::ConfigError;
use crate::check::{Check, Word};

/// Name of the gearbox housing in a vehicle file.
const HOUSING: &str = "housing";

pub(super) struct CheckedGearTrain {
    pub(super) reduced: ReducedShift<f64>,
    pub(super) output_inertia_kg_m2: f64,
    pub(super) offgoing: String,
    pub(super) oncoming: String,
}

pub(super) fn check(check: &Check<'_>, raw: &RawVehicleFile) -> Result<CheckedGearTrain, ConfigError> {
    let train = &raw.gear_train;
    let shafts = Shafts::of(check, train.shaft.get_ref())?;
    let sets = train.planetary_set.iter().map(|set| shafts.set(set)).collect::<Result<Vec<_>, _>>()?;
    let held = train.held.iter();
    let held = held.map(|held| shafts.sides("gear_train.held", &held.input, &held.output));
    let held = held.collect::<Result<Vec<_>, _>>()?;
    let clutch = |key: &str, name: &Word| {
        let raw = raw.clutch.get(name.get_ref()).ok_or_else(|| {
            let known: Vec<_> = raw.clutch.keys().map(String::as_str).collect();
            let message = format!("there is no [clutch.{}]", name.get_ref());
            check.meaning(key, name.span().start, message, Some(format!("the clutches are {}", known.join(", "))))
        })?;
        shafts.sides(&format!("clutch.{}", name.get_ref()), &raw.input, &raw.output)
    };
    let offgoing = clutch("gear_train.offgoing", &train.offgoing)?;
    let oncoming = clutch("gear_train.oncoming", &train.oncoming)?;
    let input = shafts.shaft("gear_train.input", &train.input)?;
    let output = shafts.shaft("gear_train.output", &train.output)?;
    let inertias_kg_m2 = &shafts.inertias_kg_m2;
    let reduced = GearTrain { inertias_kg_m2, sets: &sets, held: &held, input, output }
        .reduce(offgoing, oncoming)
        .map_err(|error| check.meaning("gear_train", train.shaft.span().start, error.to_string(), None))?;
    let (before, after) = (reduced.ratio_offgoing(), reduced.ratio_oncoming());
    if !(before.is_finite() && after.is_finite() && before > after && after > 0.0) {
        let message = format!("the ratio changes from {before:.3} to {after:.3}, but an upshift decreases the ratio");
        let hint = "swap `offgoing` and `oncoming`, or check `input` and `output` of the clutches".to_owned();
        return Err(check.meaning("gear_train.oncoming", train.oncoming.span().start, message, Some(hint)));
    }
    Ok(CheckedGearTrain {
        reduced,
        output_inertia_kg_m2: inertias_kg_m2[output],
        offgoing: train.offgoing.get_ref().clone(),
        oncoming: train.oncoming.get_ref().clone(),
    })
}

/// The shafts by their names, and their inertias.
struct Shafts<'c> {
    check: &'c Check<'c>,
    names: Vec<String>,
    inertias_kg_m2: Vec<f64>,
}

impl<'c> Shafts<'c> {
    fn of(check: &'c Check<'c>, shafts: &[RawShaft]) -> Result<Self, ConfigError> {
        let name = |shaft: &RawShaft| {
            let name = check.name("gear_train.shaft.name", shaft.name.get_ref(), shaft.name.span().start)?;
            if name == HOUSING {
                let message = format!("\"{HOUSING}\" is the gearbox housing, which does not rotate");
                return Err(check.meaning("gear_train.shaft.name", shaft.name.span().start, message, None));
            }
            Ok(name)
        };
        let inertia = |shaft: &RawShaft| {
            let key = format!("gear_train.shaft.{}.inertia_kg_m2", shaft.name.get_ref());
            check.number(&key, &shaft.inertia_kg_m2, 1e-4..=50.0)
        };
        let names = shafts.iter().map(name).collect::<Result<_, _>>()?;
        check.distinct("gear_train.shaft.name", shafts.iter().map(|shaft| &shaft.name))?;
        let inertias_kg_m2 = shafts.iter().map(inertia).collect::<Result<_, _>>()?;
        Ok(Self { check, names, inertias_kg_m2 })
    }

    /// Place of a shaft.
    fn shaft(&self, key: &str, name: &Word) -> Result<usize, ConfigError> {
        self.names.iter().position(|known| known == name.get_ref()).ok_or_else(|| {
            let message = format!("there is no shaft \"{}\"", name.get_ref());
            let hint = format!("the shafts are {}", self.names.join(", "));
            self.check.meaning(key, name.span().start, message, Some(hint))
        })
    }

    /// What a clutch joins: shafts or the housing.
    fn sides(&self, table: &str, input: &Word, output: &Word) -> Result<(Member, Member), ConfigError> {
        let member = |field: &str, name: &Word| match name.get_ref().as_str() {
            HOUSING => Ok(Member::Housing),
            _ => self.shaft(&format!("{table}.{field}"), name).map(Member::Shaft),
        };
        Ok((member("input", input)?, member("output", output)?))
    }

    fn set(&self, set: &RawPlanetarySet) -> Result<PlanetarySet, ConfigError> {
        let shaft = |field: &str, name: &Word| self.shaft(&format!("gear_train.planetary_set.{field}"), name);
        let (sun_teeth, ring_teeth) = teeth(self.check, set)?;
        Ok(PlanetarySet {
            sun: shaft("sun", &set.sun)?,
            ring: shaft("ring", &set.ring)?,
            carrier: shaft("carrier", &set.carrier)?,
            sun_teeth,
            ring_teeth,
        })
    }
}

/// Teeth of sun and ring. Between them there must be room for the planets: `Z_r = Z_s + 2 Z_p`.
fn teeth(check: &Check<'_>, set: &RawPlanetarySet) -> Result<(f64, f64), ConfigError> {
    let sun = check.count("gear_train.planetary_set.sun_teeth", &set.sun_teeth, 5.0..=500.0)?;
    let ring = check.count("gear_train.planetary_set.ring_teeth", &set.ring_teeth, 5.0..=500.0)?;
    if ring > sun {
        return Ok((sun, ring));
    }
    let message = format!("is {ring}, but the sun inside the ring has {sun} teeth");
    let hint = "in a set with single planets the ring has more teeth than the sun".to_owned();
    Err(check.meaning("gear_train.planetary_set.ring_teeth", set.ring_teeth.span().start, message, Some(hint)))
}
