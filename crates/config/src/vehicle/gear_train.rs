//! The gear train of a vehicle file: names turned into shafts, then reduced to the shift.

use drivetrain::ReducedShift;
use geartrain::{Connection, ElementKind, GearTrain, HOUSING, Member, PlanetarySet, Planets, Shaft, TrainElement};

use super::raw::{RawPlanetarySet, RawShaft, RawVehicleFile};
use crate::ConfigError;
use crate::check::{Check, Word};
use crate::gearbox::teeth;

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
    let held = held.map(|held| shafts.element("gear_train.held", &held.input, &held.output));
    let held = held.collect::<Result<Vec<_>, _>>()?;
    let clutch = |key: &str, name: &Word| {
        let raw = raw.clutch.get(name.get_ref()).ok_or_else(|| {
            let known: Vec<_> = raw.clutch.keys().map(String::as_str).collect();
            let message = format!("there is no [clutch.{}]", name.get_ref());
            check.meaning(key, name.span().start, message, Some(format!("the clutches are {}", known.join(", "))))
        })?;
        shafts.element(&format!("clutch.{}", name.get_ref()), &raw.input, &raw.output)
    };
    let offgoing = clutch("gear_train.offgoing", &train.offgoing)?;
    let oncoming = clutch("gear_train.oncoming", &train.oncoming)?;
    let input = shafts.shaft("gear_train.input", &train.input)?;
    let output = shafts.shaft("gear_train.output", &train.output)?;
    let output_inertia_kg_m2 = shafts.shafts[output].inertia_kg_m2;
    let reduced = reduced(shafts.shafts, [input, output], sets, held, [offgoing, oncoming])
        .map_err(|message| check.meaning("gear_train", train.shaft.span().start, message, None))?;
    let (before, after) = (reduced.ratio_offgoing(), reduced.ratio_oncoming());
    if !(before.is_finite() && after.is_finite() && before > after && after > 0.0) {
        let message = format!("the ratio changes from {before:.3} to {after:.3}, but an upshift decreases the ratio");
        let hint = "swap `offgoing` and `oncoming`, or check `input` and `output` of the clutches".to_owned();
        return Err(check.meaning("gear_train.oncoming", train.oncoming.span().start, message, Some(hint)));
    }
    Ok(CheckedGearTrain {
        reduced,
        output_inertia_kg_m2,
        offgoing: train.offgoing.get_ref().clone(),
        oncoming: train.oncoming.get_ref().clone(),
    })
}

/// The shift between two elements while others are held. The error says why there is none.
fn reduced(
    shafts: Vec<Shaft>,
    ends: [usize; 2],
    sets: Vec<PlanetarySet<Member>>,
    held: Vec<TrainElement>,
    shift: [TrainElement; 2],
) -> Result<ReducedShift<f64>, String> {
    let freedoms = shafts.len().checked_sub(sets.len() + held.len());
    if freedoms != Some(2) {
        let freedoms = freedoms.map_or_else(|| "no".to_owned(), |freedoms| freedoms.to_string());
        return Err(format!(
            "the planetary sets and the held clutches leave {freedoms} degrees of freedom, but a shift needs exactly 2\nhint: degrees of freedom are shafts less planetary sets less held clutches"
        ));
    }
    let held_count = held.len();
    let held_places: Vec<usize> = (0..held_count).collect();
    let elements = held.into_iter().chain(shift).collect();
    GearTrain::new(shafts, ends, sets, vec![], elements)
        .filter(|train| train.speeds_in_shift(&held_places).is_some())
        .ok_or("turbine and output speed do not determine the speed of every shaft")?
        .reduce(&held_places, held_count, held_count + 1)
        .ok_or_else(|| "the slip of each shift clutch must depend on turbine and output speed".to_owned())
}

/// The shafts of a vehicle file.
struct Shafts<'c> {
    check: &'c Check<'c>,
    shafts: Vec<Shaft>,
}

impl<'c> Shafts<'c> {
    fn of(check: &'c Check<'c>, shafts: &[RawShaft]) -> Result<Self, ConfigError> {
        let name = |shaft: &RawShaft| {
            let name = check.name("gear_train.shaft.name", shaft.name.get_ref(), shaft.name.span().start)?;
            if name == HOUSING {
                let message = format!("\"{HOUSING}\" is the gearbox housing, which does not rotate");
                let hint = Some("remove this shaft; sets and clutches may name the housing without it".to_owned());
                return Err(check.meaning("gear_train.shaft.name", shaft.name.span().start, message, hint));
            }
            Ok(name)
        };
        let inertia = |shaft: &RawShaft| {
            let key = format!("gear_train.shaft.{}.inertia_kg_m2", shaft.name.get_ref());
            check.number(&key, &shaft.inertia_kg_m2, 1e-4..=50.0)
        };
        let names = shafts.iter().map(name).collect::<Result<Vec<_>, _>>()?;
        check.distinct("gear_train.shaft.name", shafts.iter().map(|shaft| &shaft.name))?;
        let shaft = |(shaft, name)| Ok(Shaft { name, inertia_kg_m2: inertia(shaft)? });
        Ok(Self { check, shafts: shafts.iter().zip(names).map(shaft).collect::<Result<_, ConfigError>>()? })
    }

    /// Place of a shaft.
    fn shaft(&self, key: &str, name: &Word) -> Result<usize, ConfigError> {
        self.shafts.iter().position(|shaft| shaft.name == *name.get_ref()).ok_or_else(|| {
            let message = format!("there is no shaft \"{}\"", name.get_ref());
            let names: Vec<_> = self.shafts.iter().map(|shaft| shaft.name.as_str()).collect();
            let hint = format!("the shafts are {}", names.join(", "));
            self.check.meaning(key, name.span().start, message, Some(hint))
        })
    }

    /// A clutch between shafts or a shaft and the housing.
    fn element(&self, table: &str, input: &Word, output: &Word) -> Result<TrainElement, ConfigError> {
        let member = |field: &str, name: &Word| match name.get_ref().as_str() {
            HOUSING => Ok(Member::Housing),
            _ => self.shaft(&format!("{table}.{field}"), name).map(Member::Shaft),
        };
        Ok(TrainElement {
            name: table.to_owned(),
            kind: ElementKind::Clutch,
            connection: Connection::Sides(member("input", input)?, member("output", output)?),
            pack: None,
        })
    }

    fn set(&self, set: &RawPlanetarySet) -> Result<PlanetarySet<Member>, ConfigError> {
        let shaft = |field: &str, name: &Word| {
            self.shaft(&format!("gear_train.planetary_set.{field}"), name).map(Member::Shaft)
        };
        let (sun_teeth, ring_teeth) = teeth_of(self.check, set)?;
        Ok(PlanetarySet {
            sun: shaft("sun", &set.sun)?,
            ring: shaft("ring", &set.ring)?,
            carrier: shaft("carrier", &set.carrier)?,
            sun_teeth,
            ring_teeth,
            planets: Planets::Single,
            planet_count: None,
            planet_teeth: vec![],
        })
    }
}

/// Teeth of sun and ring. Between them there must be room for the planets: `Z_r = Z_s + 2 Z_p`.
fn teeth_of(check: &Check<'_>, set: &RawPlanetarySet) -> Result<(u32, u32), ConfigError> {
    let sun = teeth(check, "gear_train.planetary_set.sun_teeth", &set.sun_teeth)?;
    let ring = teeth(check, "gear_train.planetary_set.ring_teeth", &set.ring_teeth)?;
    if ring > sun {
        return Ok((sun, ring));
    }
    let message = format!("is {ring}, but the sun inside the ring has {sun} teeth");
    let hint = "in a set with single planets the ring has more teeth than the sun".to_owned();
    Err(check.meaning("gear_train.planetary_set.ring_teeth", set.ring_teeth.span().start, message, Some(hint)))
}
