//! The gear train of a vehicle file: names turned into shafts, then reduced to the shift.

use drivetrain::{GearTrain, Member, PlanetarySet, ReducedShift};
use toml::Spanned;

use super::raw::RawVehicleFile;
use crate::ConfigError;
use crate::check::Check;

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
    let names: Vec<&str> = train.shaft.get_ref().iter().map(|shaft| shaft.name.as_str()).collect();
    let inertias = (train.shaft.get_ref().iter())
        .map(|shaft| {
            let key = format!("gear_train.shaft.{}.inertia_kg_m2", shaft.name);
            check.number(&key, &shaft.inertia_kg_m2, 1e-4..=50.0)
        })
        .collect::<Result<Vec<_>, _>>()?;
    let shaft = |key: &str, name: &Spanned<String>| {
        names.iter().position(|known| known == name.get_ref()).ok_or_else(|| {
            let message = format!("there is no shaft \"{}\"", name.get_ref());
            check.meaning(key, name.span().start, message, Some(format!("the shafts are {}", names.join(", "))))
        })
    };
    let member = |key: &str, name: &Spanned<String>| {
        if name.get_ref() == HOUSING { Ok(Member::Housing) } else { shaft(key, name).map(Member::Shaft) }
    };

    let sets = (train.planetary_set.iter())
        .map(|set| {
            let key = |field: &str| format!("gear_train.planetary_set.{field}");
            Ok(PlanetarySet {
                sun: shaft(&key("sun"), &set.sun)?,
                ring: shaft(&key("ring"), &set.ring)?,
                carrier: shaft(&key("carrier"), &set.carrier)?,
                sun_teeth: check.number(&key("sun_teeth"), &set.sun_teeth, 5.0..=500.0)?,
                ring_teeth: check.number(&key("ring_teeth"), &set.ring_teeth, 5.0..=500.0)?,
            })
        })
        .collect::<Result<Vec<_>, ConfigError>>()?;
    let held = (train.held.iter())
        .map(|held| {
            Ok((member("gear_train.held.input", &held.input)?, member("gear_train.held.output", &held.output)?))
        })
        .collect::<Result<Vec<_>, ConfigError>>()?;
    let clutch = |key: &str, name: &Spanned<String>| {
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
        let message = format!("the ratio goes from {before:.3} to {after:.3}, and an upshift lowers it");
        let hint = "swap `offgoing` and `oncoming`, or look at the sides of the clutches".to_owned();
        return Err(check.meaning("gear_train.oncoming", train.oncoming.span().start, message, Some(hint)));
    }
    Ok(CheckedGearTrain {
        reduced,
        output_inertia_kg_m2: inertias[output],
        offgoing: train.offgoing.get_ref().clone(),
        oncoming: train.oncoming.get_ref().clone(),
    })
}
