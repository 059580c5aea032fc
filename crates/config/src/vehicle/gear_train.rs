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

pub(super) fn check<'r>(check: &Check<'_>, raw: &'r RawVehicleFile) -> Result<CheckedGearTrain, ConfigError> {
    let train = &raw.gear_train;
    let shafts = train.shaft.get_ref();
    let name = |shaft: &'r RawShaft| {
        let name = check.name("gear_train.shaft.name", shaft.name.get_ref(), shaft.name.span().start)?;
        if name == HOUSING {
            let message = format!("\"{HOUSING}\" is the gearbox housing, which does not rotate");
            return Err(check.meaning("gear_train.shaft.name", shaft.name.span().start, message, None));
        }
        Ok(name)
    };
    let names = shafts.iter().map(name).collect::<Result<Vec<String>, _>>()?;
    check.distinct("gear_train.shaft.name", shafts.iter().map(|shaft| &shaft.name))?;
    let inertias = (shafts.iter())
        .map(|shaft| {
            let key = format!("gear_train.shaft.{}.inertia_kg_m2", shaft.name.get_ref());
            check.number(&key, &shaft.inertia_kg_m2, 1e-4..=50.0)
        })
        .collect::<Result<Vec<_>, _>>()?;
    let shaft = |key: &str, name: &Word| {
        names.iter().position(|known| known == name.get_ref()).ok_or_else(|| {
            let message = format!("there is no shaft \"{}\"", name.get_ref());
            check.meaning(key, name.span().start, message, Some(format!("the shafts are {}", names.join(", "))))
        })
    };
    let member = |key: &str, name: &Word| {
        if name.get_ref() == HOUSING { Ok(Member::Housing) } else { shaft(key, name).map(Member::Shaft) }
    };

    let sets = (train.planetary_set.iter())
        .map(|set| {
            let key = |field: &str| format!("gear_train.planetary_set.{field}");
            let (sun_teeth, ring_teeth) = teeth(check, set)?;
            Ok(PlanetarySet {
                sun: shaft(&key("sun"), &set.sun)?,
                ring: shaft(&key("ring"), &set.ring)?,
                carrier: shaft(&key("carrier"), &set.carrier)?,
                sun_teeth,
                ring_teeth,
            })
        })
        .collect::<Result<Vec<_>, ConfigError>>()?;
    let held = (train.held.iter())
        .map(|held| {
            Ok((member("gear_train.held.input", &held.input)?, member("gear_train.held.output", &held.output)?))
        })
        .collect::<Result<Vec<_>, ConfigError>>()?;
    let clutch = |key: &str, name: &Word| {
        let raw = raw.clutch.get(name.get_ref()).ok_or_else(|| {
            let known: Vec<_> = raw.clutch.keys().map(String::as_str).collect();
            let message = format!("there is no [clutch.{}]", name.get_ref());
            check.meaning(key, name.span().start, message, Some(format!("the clutches are {}", known.join(", "))))
        })?;
        let field = |field: &str| format!("clutch.{}.{field}", name.get_ref());
        Ok((member(&field("input"), &raw.input)?, member(&field("output"), &raw.output)?))
    };
    let offgoing = clutch("gear_train.offgoing", &train.offgoing)?;
    let oncoming = clutch("gear_train.oncoming", &train.oncoming)?;
    let (input, output) = (shaft("gear_train.input", &train.input)?, shaft("gear_train.output", &train.output)?);

    let reduced = GearTrain { inertias_kg_m2: &inertias, sets: &sets, held: &held, input, output }
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
        output_inertia_kg_m2: inertias[output],
        offgoing: train.offgoing.get_ref().clone(),
        oncoming: train.oncoming.get_ref().clone(),
    })
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
