//! Vehicle files with a whole gearbox: a car that shifts through all of its gears.
//!
//! The gearbox is a file of its own. What a vehicle file leaves out it takes from `vehicles/eight_speed.toml`, key by key; scaled to
//! the size of the car, if the file has `engine.max_torque_n_m`.

use std::collections::BTreeMap;
use std::path::Path;

use ::car::{Car, CarErrorBounds, ElementErrorBounds, LockUp, ShiftClutch, ratios_alone};
use drivetrain::{Clutch, ClutchValve, Table1};
use geartrain::{Gearbox, GearboxElement};
use serde::Deserialize;
use toml::Spanned;

use super::car_bounds::{self, RawCarErrorBounds, RawElementErrorBounds};
use super::fill::{self, RawFill};
use super::raw::{RawClutchValve, RawConverter, RawDriveline, RawEngine, RawFriction, RawOil, RawRoad, RawTyre};
use super::short::{car_defaults, car_defaults_taken, of_default};
use super::{
    DefaultTaken, HYSTERESES_PA, RETURN_SPRINGS_N, backlash, converter, driveline, engine, oil_temperature, road, tyre,
    valves,
};
use crate::check::{Check, Number, Word};
use crate::source::Layers;
use crate::{ConfigError, GearboxFile, Kind, Source, file_of};

/// What a vehicle file leaves out.
const DEFAULTS: (&str, &str) = ("vehicles/eight_speed.toml", include_str!("../../../../vehicles/eight_speed.toml"));
const GEARBOX: (&str, &str) = ("gearboxes/8hp.toml", include_str!("../../../../gearboxes/8hp.toml"));

/// Mass of the steel plates of a pack, kg: one plate of 60 g, to the packs of a truck.
const STEEL_MASSES_KG: std::ops::RangeInclusive<f64> = 0.05..=20.0;

/// What to do about a `[valve]` of which a part is missing.
const WHOLE_VALVE: &str =
    "a [valve] of your own is given whole, as in vehicles/eight_speed.toml: all of its keys, or none";
/// The same of the valve of one element.
const WHOLE_CLUTCH_VALVE: &str = "the valve of one element is given whole, with all keys that [valve] has in \
                                  vehicles/eight_speed.toml; without [clutch.NAME.valve] it is as [valve]";
/// The same of `[lock_up]`.
const WHOLE_LOCK_UP: &str = "[lock_up] has `capacity_n_m`, `first_gear`, `on_input_rad_s`, `off_input_rad_s` and `ramp_s`, and \
                             may have `slip_rad_s`: vehicles/eight_speed.toml explains them";

/// A vehicle file with a gearbox file.
#[derive(Debug, Clone, PartialEq)]
pub struct CarFile {
    /// What they describe.
    pub car: Car,
    /// The vehicle file.
    pub source: Source,
    /// The gearbox file that it names.
    pub gearbox_source: Source,
    /// What the file leaves out, so that it is as in `vehicles/eight_speed.toml`, scaled if the file has `engine.max_torque_n_m`.
    pub defaults_taken: Vec<DefaultTaken>,
}

file_of!(CarFile, car: Car);

impl CarFile {
    /// The eight-speed automatic that ships with the program.
    ///
    /// # Errors
    /// None in a released program; the tests read this file.
    pub fn eight_speed() -> Result<Self, ConfigError> {
        Self::from_sources(Source::built_in(DEFAULTS.0, DEFAULTS.1), Source::built_in(GEARBOX.0, GEARBOX.1))
    }

    /// Reads and checks a vehicle file and the gearbox file that it names.
    ///
    /// # Errors
    /// A file cannot be read, is of another kind, or holds a value that cannot be right.
    pub fn read(path: &Path) -> Result<Self, ConfigError> {
        Self::from_source(Source::read(path)?)
    }

    /// Checks the text of a vehicle file, and the gearbox file that it names from its folder.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn from_source(source: Source) -> Result<Self, ConfigError> {
        let defaults = Source::built_in(DEFAULTS.0, DEFAULTS.1);
        let layers = Layers { source: &defaults, over: Some(&source) };
        let raw: RawCar = layers
            .parse()
            .map_err(|error| source.unless_other(Kind::Car, incomplete_table(&source).unwrap_or(error)))?;
        let own = source.table()?.get_ref().contains_key("gearbox");
        if !own {
            let hint = "gearbox = \"../gearboxes/8hp.toml\", a path from the folder of this file".to_owned();
            let check = Check::of(&source);
            return Err(check.meaning("gearbox", 0, "names no gearbox file".to_owned(), Some(hint)));
        }
        let folder = source.path.parent().unwrap_or(Path::new("")).to_owned();
        let named_at = raw.gearbox.span().start.saturating_sub(defaults.text.len());
        let gearbox = Source::read(&folder.join(raw.gearbox.get_ref()))
            .map_err(|error| error.named_by(&source, "gearbox", named_at))?;
        Self::from_sources(source, gearbox)
    }

    /// Checks the text of a vehicle file with that of its gearbox file.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn from_sources(source: Source, gearbox: Source) -> Result<Self, ConfigError> {
        let gearbox = GearboxFile::from_source(gearbox)?;
        let defaults = car_defaults(&source, Source::built_in(DEFAULTS.0, DEFAULTS.1), &gearbox.gearbox)?;
        Self::over(&defaults, source.clone(), gearbox).map_err(|error| of_default(error, &defaults, &source))
    }

    /// The car of a file over these defaults.
    fn over(defaults: &Source, source: Source, gearbox: GearboxFile) -> Result<Self, ConfigError> {
        let GearboxFile { source: gearbox_source, mut gearbox, .. } = gearbox;
        let raw: RawCar = Layers { source: defaults, over: Some(&source) }
            .parse()
            .map_err(|error| incomplete_table(&source).unwrap_or(error))?;
        let check = Check { layers: Layers { source: defaults, over: Some(&source) } };
        let engine = engine(&check, &raw.engine)?;
        let assumed = gearbox.has_ratios_alone().then(|| ratios_alone::assume_masses(&mut gearbox, &engine)).flatten();
        turbine_inertias(&check, &raw, &mut gearbox)?;
        let line_pressure_pa =
            check.number("hydraulics.line_pressure_pa", &raw.hydraulics.line_pressure_pa, 1e5..=10e6)?;
        let oil_temperature_degc = oil_temperature(&check, &raw.oil)?;
        // A valve of one's own has nothing of the shipped one, which may be of another kind.
        let own: RawOwnValve = source.parse().map_err(|error| error.with_hint(WHOLE_VALVE))?;
        let own_check = Check::of(&source);
        let valve = own.valve.as_ref().map_or((&check, &raw.valve), |valve| (&own_check, valve));
        let clutches = clutches(&check, &raw, valve, &gearbox, line_pressure_pa, oil_temperature_degc)?;
        let mut error_bounds = error_bounds(&check, &raw, &gearbox, &clutches)?;
        error_bounds.inertia_share = error_bounds.inertia_share.or(assumed);
        let car = Car {
            error_bounds,
            name: check.title("name", &raw.name)?,
            clutches,
            line_pressure_pa,
            engine,
            converter: match raw.launch {
                RawLaunch::Converter => Some(converter(&check, &raw.converter)?),
                RawLaunch::Clutch => None,
            },
            lock_up: raw
                .lock_up
                .as_ref()
                .map(|raw_lock_up| lock_up(&check, raw_lock_up, &raw, &gearbox))
                .transpose()?,
            gearbox,
            driveline: driveline(&check, &raw.driveline)?,
            backlash_rad: backlash(&check, &raw.driveline)?,
            tyre: tyre(&check, &raw.tyre)?,
            road: road(&check, &raw.vehicle)?,
            oil_temperature_degc,
        };
        let defaults_taken = car_defaults_taken(&source, defaults, matches!(raw.launch, RawLaunch::Converter))?;
        Ok(Self { car, source, gearbox_source, defaults_taken })
    }
}

/// The keys of a vehicle file with a gearbox file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct RawCar {
    name: Word,
    gearbox: Word,
    launch: RawLaunch,
    engine: RawEngine,
    converter: RawConverter,
    hydraulics: RawHydraulics,
    friction: RawShape,
    valve: Spanned<RawClutchValve>,
    fill: Option<RawFill>,
    lock_up: Option<RawLockUp>,
    #[serde(default)]
    clutch: BTreeMap<Spanned<String>, RawElementClutch>,
    #[serde(default)]
    turbine_inertia_kg_m2: BTreeMap<Spanned<String>, Number>,
    driveline: RawDriveline,
    tyre: RawTyre,
    vehicle: RawRoad,
    #[serde(default)]
    oil: RawOil,
    #[serde(default)]
    error_bounds: RawCarErrorBounds,
}

/// The valve as the file itself has it.
#[derive(Deserialize)]
struct RawOwnValve {
    valve: Option<Spanned<RawClutchValve>>,
}

/// The valves of single elements as the file itself has them.
#[derive(Deserialize)]
struct RawOwnClutches {
    #[serde(default, rename = "clutch")]
    _clutch: BTreeMap<String, RawOwnValve>,
}

/// The lock-up clutch as the file itself has it.
#[derive(Deserialize)]
struct RawOwnLockUp {
    #[serde(rename = "lock_up")]
    _lock_up: Option<RawLockUp>,
}

/// The error of a table without defaults that the file gives in part, with what to do about it.
fn incomplete_table(source: &Source) -> Option<ConfigError> {
    let of_valve = source.parse::<RawOwnClutches>().err().map(|error| (error, WHOLE_CLUTCH_VALVE));
    let of_lock_up = source.parse::<RawOwnLockUp>().err().map(|error| (error, WHOLE_LOCK_UP));
    let is_missing = |error: &ConfigError| error.what().starts_with("missing key");
    let (error, hint) = [of_valve, of_lock_up].into_iter().flatten().find(|(error, _)| is_missing(error))?;
    Some(error.with_hint(hint))
}

/// What connects the engine with the gearbox.
#[derive(Deserialize, Clone, Copy)]
#[serde(rename_all = "kebab-case")]
enum RawLaunch {
    Converter,
    Clutch,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct RawHydraulics {
    line_pressure_pa: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct RawLockUp {
    capacity_n_m: Number,
    first_gear: Word,
    on_input_rad_s: Number,
    off_input_rad_s: Number,
    ramp_s: Number,
    slip_rad_s: Option<Number>,
}

/// Course of the friction over slip, and drag, of all clutches.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct RawShape {
    slip_rad_s: crate::check::Numbers,
    factor: crate::check::Numbers,
    static_factor: Number,
    drag_n_m: Number,
}

/// What one element has of its own.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct RawElementClutch {
    friction: Option<RawFriction>,
    static_friction: Option<Number>,
    drag_n_m: Option<Number>,
    steel_mass_kg: Option<Number>,
    return_spring_n: Option<Number>,
    valve: Option<Spanned<RawClutchValve>>,
    fill: Option<RawFill>,
    error_bounds: Option<RawElementErrorBounds>,
}

/// What the file has of the errors of the car and of its elements.
fn error_bounds(
    check: &Check<'_>,
    raw: &RawCar,
    gearbox: &Gearbox,
    clutches: &[Option<ShiftClutch>],
) -> Result<CarErrorBounds, ConfigError> {
    let elements = gearbox.elements.iter().zip(clutches).map(|(element, clutch)| {
        let own = raw.clutch.get(element.name.as_str()).and_then(|own| own.error_bounds.as_ref());
        let Some((own, clutch)) = own.zip(clutch.as_ref()) else { return Ok(ElementErrorBounds::default()) };
        let table = format!("clutch.{}.error_bounds", element.name);
        car_bounds::of_element(check, &table, own, clutch)
    });
    car_bounds::of_car(check, &raw.error_bounds, elements.collect::<Result<_, _>>()?)
}

fn lock_up(check: &Check<'_>, raw: &RawLockUp, car: &RawCar, gearbox: &Gearbox) -> Result<LockUp, ConfigError> {
    let number = |key: &str, value, range| check.number(format_args!("lock_up.{key}"), value, range);
    let at = raw.first_gear.span().start;
    if matches!(car.launch, RawLaunch::Clutch) {
        let message = "the car has no converter".to_owned();
        return Err(check.meaning("lock_up", at, message, Some("leave [lock_up] out".to_owned())));
    }
    let name = raw.first_gear.get_ref();
    let Some(first_gear) = gearbox.gear(name) else {
        let names = gearbox.gears.iter().map(|gear| gear.name.as_str()).collect::<Vec<_>>().join(", ");
        let message = format!("the gearbox has no gear \"{name}\"");
        return Err(check.meaning("lock_up.first_gear", at, message, Some(format!("its gears are {names}"))));
    };
    let on_rad_s = number("on_input_rad_s", &raw.on_input_rad_s, 20.0..=1e3)?;
    let off_rad_s = number("off_input_rad_s", &raw.off_input_rad_s, 10.0..=1e3)?;
    if off_rad_s >= on_rad_s {
        let message = format!("is {off_rad_s}, not below `on_input_rad_s`, {on_rad_s}");
        let hint = Some("the lock-up clutch opens at a lower speed than that at which it closes".to_owned());
        return Err(check.meaning("lock_up.off_input_rad_s", raw.off_input_rad_s.span().start, message, hint));
    }
    Ok(LockUp {
        capacity_n_m: number("capacity_n_m", &raw.capacity_n_m, 1.0..=1e4)?,
        first_gear,
        on_rad_s,
        off_rad_s,
        ramp_s: number("ramp_s", &raw.ramp_s, 0.05..=10.0)?,
        slip_rad_s: raw.slip_rad_s.as_ref().map_or(Ok(0.0), |slip| number("slip_rad_s", slip, 0.0..=30.0))?,
    })
}

/// Puts inertias of the file in place of those of the gear train, for both shifts between two neighbouring gears.
fn turbine_inertias(check: &Check<'_>, raw: &RawCar, gearbox: &mut Gearbox) -> Result<(), ConfigError> {
    for (name, value) in &raw.turbine_inertia_kg_m2 {
        let key = format!("turbine_inertia_kg_m2.{}", name.get_ref());
        let inertia_kg_m2 = check.number(&key, value, 1e-4..=10.0)?;
        let pair = name.get_ref().split_once('-').and_then(|(low, high)| gearbox.gear(low).zip(gearbox.gear(high)));
        let is_of_pair =
            |from: usize, to: usize| pair.is_some_and(|(a, b)| a != b && [[a, b], [b, a]].contains(&[from, to]));
        let shifts = gearbox.shifts.iter_mut().filter(|shift| is_of_pair(shift.from, shift.to));
        let mut reduced: Vec<_> = shifts.filter_map(|shift| shift.reduced.as_mut()).collect();
        if reduced.is_empty() {
            let message = "names no shift of the gearbox from one clutch to another".to_owned();
            let hint = "two gears with a hyphen between them, as \"1-2\"".to_owned();
            return Err(check.meaning(&key, name.span().start, message, Some(hint)));
        }
        for shift in &mut reduced {
            let [[_, mixed], [_, output]] = shift.mass_kg_m2;
            if inertia_kg_m2 * output <= mixed * mixed {
                let message = format!("is {inertia_kg_m2} kg m2, with which speeds could change without energy");
                let hint = format!("more than {:.4} kg m2", mixed * mixed / output);
                return Err(check.meaning(&key, value.span().start, message, Some(hint)));
            }
            shift.mass_kg_m2[0][0] = inertia_kg_m2;
        }
    }
    Ok(())
}

/// The friction elements: plates of the gearbox file, friction over slip, drag and valve of the vehicle file.
fn clutches(
    check: &Check<'_>,
    raw: &RawCar,
    common_valve: (&Check<'_>, &Spanned<RawClutchValve>),
    gearbox: &Gearbox,
    line_pressure_pa: f64,
    oil_degc: f64,
) -> Result<Vec<Option<ShiftClutch>>, ConfigError> {
    known_clutches(check, raw, gearbox)?;
    let common = CommonClutch {
        check,
        raw,
        shape: FrictionShape::of(check, &raw.friction)?,
        valve: common_valve,
        line_pressure_pa,
        oil_degc,
    };
    let of = |element: &GearboxElement| element.kind.has_plates().then(|| common.clutch(element)).transpose();
    gearbox.elements.iter().map(of).collect()
}

/// Refuses a table of an element that the gearbox does not have.
fn known_clutches(check: &Check<'_>, raw: &RawCar, gearbox: &Gearbox) -> Result<(), ConfigError> {
    let unknown = raw.clutch.keys().find(|name| gearbox.with_plates().all(|element| element.name != *name.get_ref()));
    let Some(name) = unknown else { return Ok(()) };
    let names = gearbox.with_plates().map(|element| element.name.as_str()).collect::<Vec<_>>().join(", ");
    let message = format!("the gearbox has no clutch or brake \"{}\"", name.get_ref());
    let hint = match gearbox.has_ratios_alone() {
        true => "its file has ratios alone; with level = \"shares\" or \"stick-diagram\" it has elements".to_owned(),
        false => format!("its clutches and brakes are {names}"),
    };
    Err(check.meaning("clutch", name.span().start, message, Some(hint)))
}

/// Friction over slip, over that of the gearbox file, and the drag of an open clutch.
struct FrictionShape {
    factor: Table1<f64>,
    static_factor: f64,
    drag_n_m: f64,
}

impl FrictionShape {
    fn of(check: &Check<'_>, raw: &RawShape) -> Result<Self, ConfigError> {
        let factor = check
            .table(("friction.slip_rad_s", &raw.slip_rad_s, 0.0..=2e3), ("friction.factor", &raw.factor, 0.2..=5.0))?;
        let static_factor = check.number("friction.static_factor", &raw.static_factor, 0.2..=5.0)?;
        if static_factor < factor.at(0.0) {
            let message = format!("is {static_factor}, less than `factor` at zero slip, {}", factor.at(0.0));
            let hint = "with a smaller static friction a clutch could neither stick nor slip".to_owned();
            return Err(check.meaning("friction.static_factor", raw.static_factor.span().start, message, Some(hint)));
        }
        let drag_n_m = check.number("friction.drag_n_m", &raw.drag_n_m, 0.0..=100.0)?;
        Ok(Self { factor, static_factor, drag_n_m })
    }
}

/// What the clutches of a car have in common, unless a table of their own says otherwise.
struct CommonClutch<'c> {
    check: &'c Check<'c>,
    raw: &'c RawCar,
    shape: FrictionShape,
    valve: (&'c Check<'c>, &'c Spanned<RawClutchValve>),
    line_pressure_pa: f64,
    oil_degc: f64,
}

impl CommonClutch<'_> {
    fn clutch(&self, element: &GearboxElement) -> Result<ShiftClutch, ConfigError> {
        let Self { check, raw, oil_degc, .. } = *self;
        let name = element.name.as_str();
        let Some(pack) = element.pack else {
            let message = format!("element {name} of \"{}\" has no `pack`", raw.gearbox.get_ref());
            let hint = "a simulated clutch needs faces, radius, friction, piston and spring".to_owned();
            return Err(check.meaning("gearbox", raw.gearbox.span().start, message, Some(hint)));
        };
        let own = raw.clutch.get(name);
        let key = |field: &str| format!("clutch.{name}.{field}");
        let clutch = self.plates(name, pack, own)?;
        let drag_n_m = match own.and_then(|own| own.drag_n_m.as_ref()) {
            Some(drag) => check.number(key("drag_n_m"), drag, 0.0..=100.0)?,
            None => self.shape.drag_n_m,
        };
        let (valve, hysteresis_pa) = self.valve(name, own)?;
        self.can_slip(name, &clutch)?;
        let (table, fills) = match own.and_then(|own| own.fill.as_ref()) {
            Some(own) => (key("fill"), Some(own)),
            None => ("fill".to_owned(), raw.fill.as_ref()),
        };
        let (cylinder, has_stroke) = fill::cylinder(check, &table, fills, &clutch, oil_degc)?;
        let has_stroke = has_stroke && fills.is_some();
        let mass = own.and_then(|own| own.steel_mass_kg.as_ref());
        let steel_mass_kg = mass.map(|mass| check.number(key("steel_mass_kg"), mass, STEEL_MASSES_KG)).transpose()?;
        Ok(ShiftClutch { clutch, valve, hysteresis_pa, cylinder, has_stroke, drag_n_m, steel_mass_kg })
    }

    /// Plates and piston with their friction.
    fn plates(
        &self,
        name: &str,
        pack: Clutch<f64>,
        own: Option<&RawElementClutch>,
    ) -> Result<Clutch<f64>, ConfigError> {
        let (check, shape) = (self.check, &self.shape);
        let key = |field: &str| format!("clutch.{name}.{field}");
        let mut clutch = Clutch {
            friction: shape.factor.scaled(pack.static_friction),
            static_friction: shape.static_factor * pack.static_friction,
            ..pack
        };
        if let Some(value) = own.and_then(|own| own.return_spring_n.as_ref()) {
            clutch.return_spring_n = check.number(key("return_spring_n"), value, RETURN_SPRINGS_N)?;
        }
        if let Some(friction) = own.and_then(|own| own.friction.as_ref()) {
            clutch.friction = own_friction(check, &key("friction"), friction)?;
            clutch.static_friction = clutch.static_friction.max(clutch.friction.at(0.0));
        }
        if let Some(value) = own.and_then(|own| own.static_friction.as_ref()) {
            clutch.static_friction = check.number(key("static_friction"), value, 0.02..=0.5)?;
            let sliding = clutch.friction.at(0.0);
            if clutch.static_friction < sliding {
                let message = format!("is {}, less than the friction at zero slip, {sliding}", clutch.static_friction);
                let hint = Some(
                    "static friction is the largest friction of a clutch without slip: leave it out, or raise it"
                        .to_owned(),
                );
                return Err(check.meaning(key("static_friction"), value.span().start, message, hint));
            }
        }
        Ok(clutch)
    }

    /// The valve and the half-width of its hysteresis, Pa.
    fn valve(&self, name: &str, own: Option<&RawElementClutch>) -> Result<(ClutchValve<f64>, f64), ConfigError> {
        let (table, (check, spanned)) = match own.and_then(|own| own.valve.as_ref()) {
            Some(valve) => (format!("clutch.{name}.valve"), (self.check, valve)),
            None => ("valve".to_owned(), self.valve),
        };
        let valve = valves::clutch_valve(check, &table, spanned)?;
        reaches(check, &table, &valve, spanned, self.line_pressure_pa)?;
        let hysteresis_pa = match &spanned.get_ref().hysteresis_pa {
            Some(half_width) => check.number(format_args!("{table}.hysteresis_pa"), half_width, HYSTERESES_PA)?,
            None => 0.0,
        };
        Ok((valve, hysteresis_pa))
    }

    /// Refuses a return spring that the line pressure does not overcome.
    fn can_slip(&self, name: &str, clutch: &Clutch<f64>) -> Result<(), ConfigError> {
        if clutch.kiss_pressure() < self.line_pressure_pa {
            return Ok(());
        }
        let message = format!(
            "is {} Pa, and the return spring of {name} holds up to {:.0} Pa",
            self.line_pressure_pa,
            clutch.kiss_pressure()
        );
        let at = self.raw.hydraulics.line_pressure_pa.span().start;
        let hint = Some("the clutch can never carry torque: check the unit of the line pressure, `return_spring_n` and `piston_area_m2`".to_owned());
        Err(self.check.meaning("hydraulics.line_pressure_pa", at, message, hint))
    }
}

fn own_friction(check: &Check<'_>, key: &str, raw: &RawFriction) -> Result<Table1<f64>, ConfigError> {
    check.table(
        (&format!("{key}.slip_rad_s"), &raw.slip_rad_s, 0.0..=2e3),
        (&format!("{key}.coefficient"), &raw.coefficient, 0.02..=0.5),
    )
}

/// Refuses a valve whose pressure does not rise up to line pressure.
fn reaches(
    check: &Check<'_>,
    table: &str,
    valve: &ClutchValve<f64>,
    raw: &Spanned<RawClutchValve>,
    line_pressure_pa: f64,
) -> Result<(), ConfigError> {
    match valve {
        ClutchValve::Proportional(maps) => {
            valves::settled_pressure_rises(check, table, valve, raw, maps.current_for(line_pressure_pa))
        }
        ClutchValve::NormallyHigh { maps, zero_pressure_a } => {
            valves::settled_pressure_rises(check, table, valve, raw, *zero_pressure_a)?;
            let max_pa = maps.settled_pressure(*zero_pressure_a);
            if max_pa >= line_pressure_pa {
                return Ok(());
            }
            let message = format!(
                "is {zero_pressure_a} A: without current the pressure is {:.3} MPa, less than `hydraulics.line_pressure_pa`, {:.3} MPa",
                1e-6 * max_pa,
                1e-6 * line_pressure_pa
            );
            let hint = format!(
                "line pressure needs {:.3} A; the maps of a normally-high valve are over `zero_pressure_a` less the current",
                maps.current_for(line_pressure_pa)
            );
            let at = raw.get_ref().zero_pressure_a.as_ref().map_or(raw.span().start, |zero| zero.span().start);
            Err(check.meaning(format!("{table}.zero_pressure_a"), at, message, Some(hint)))
        }
        ClutchValve::PulseWidth { law, .. } if law.line_pressure_pa < line_pressure_pa => {
            let message = format!(
                "its line pressure is {} Pa, less than `hydraulics.line_pressure_pa`, {line_pressure_pa} Pa",
                law.line_pressure_pa
            );
            let hint = Some("give both the same line pressure".to_owned());
            Err(check.meaning(table, raw.span().start, message, hint))
        }
        ClutchValve::PulseWidth { .. } => Ok(()),
    }
}
