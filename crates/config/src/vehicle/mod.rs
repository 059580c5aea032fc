//! Checked vehicle files.

mod budget;
mod car;
mod car_bounds;
mod clutch;
mod fill;
mod fill_bounds;
mod gear_train;
mod plausible;
mod raw;
pub mod short;
mod slipping;
mod valves;

use std::path::Path;

use ::car::{
    CompliantRequirement, DesignRequirement, FilterSettings, OIL_TEMPERATURES_DEGC, ObserverSettings, PhaseSlips,
    Requirements, Shaft, Vehicle,
};
use drivetrain::{Converter, Driveline, Engine, RoadLoad, Table2, TableError, Tyre};

use drivetrain::oil::WARM_OIL_DEGC;
use drivetrain::table::{MAX_COLUMNS, MAX_POINTS};
use toml::Spanned;

use crate::check::{Check, Number, Numbers, significant};
use crate::source::Layers;
use crate::tree::Change;
use crate::tree::Tree;
use crate::{ConfigError, Kind, Source, file_of};
pub use car::CarFile;
pub(crate) use clutch::{FRICTION_FACES, HYSTERESES_PA, PISTON_AREAS_M2, PLATE_RADII_M, RETURN_SPRINGS_N};
use raw::{
    RawCompliantRequirement, RawConverter, RawDriveline, RawEngine, RawEngineMap, RawFilter, RawObserver, RawOil,
    RawRequirement, RawRoad, RawTyre, RawVehicleFile,
};
pub use short::DefaultTaken;
use short::{Short, of_default, refuse_facts};

/// Masses of vehicles, kg.
const MASSES_KG: std::ops::RangeInclusive<f64> = 200.0..=60e3;
/// Rolling radii of wheels, m.
const WHEEL_RADII_M: std::ops::RangeInclusive<f64> = 0.1..=1.0;
/// Ratios from gearbox to wheels.
const FINAL_RATIOS: std::ops::RangeInclusive<f64> = 0.5..=10.0;
/// Backlash of the driveline at the wheel, rad.
pub(crate) const BACKLASHES_RAD: std::ops::RangeInclusive<f64> = 0.0..=0.5;

/// A vehicle file of one shift.
#[derive(Debug, Clone, PartialEq)]
pub struct VehicleFile {
    /// What it describes.
    pub vehicle: Vehicle,
    /// The file.
    pub source: Source,
    /// What the file leaves out.
    pub defaults_taken: Vec<DefaultTaken>,
}

file_of!(VehicleFile, vehicle: Vehicle);

impl VehicleFile {
    /// The car of one shift that a command takes where it is given no vehicle file: that of `vehicles/two_speed_at.toml`.
    ///
    /// # Errors
    /// None in a released program; the tests read this file.
    pub fn built_in() -> Result<Self, ConfigError> {
        Self::from_source(Source::built_in(
            "vehicles/two_speed_at.toml",
            include_str!("../../../../vehicles/two_speed_at.toml"),
        ))
    }

    /// Reads and checks a vehicle file.
    ///
    /// # Errors
    /// The file cannot be read, is not a vehicle file, or holds a value that cannot be right.
    pub fn read(path: &Path) -> Result<Self, ConfigError> {
        Self::from_source(Source::read(path)?)
    }

    /// As [`Self::read`], with the values of a second file in place of those in the first; it holds any of the keys
    /// of a vehicle file, such as what `wetclutch error-bound` writes. An error names the file that its value is from.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn read_with(path: &Path, overlay: &Path) -> Result<Self, ConfigError> {
        // Of a short file, the values go over its defaults too.
        let Self { source, defaults_taken, .. } = Self::read(path)?;
        let (vehicle, source) = Self::laid_over(source, &Source::read(overlay)?)?;
        Ok(Self { vehicle, source, defaults_taken })
    }

    fn laid_over(source: Source, over: &Source) -> Result<(Vehicle, Source), ConfigError> {
        let layers = Layers { source: &source, over: Some(over) };
        let vehicle = of_file(&Check { layers }, &layers.parse()?)?;
        let path = format!("{} with {}", source.path.to_string_lossy(), over.path.to_string_lossy());
        Ok((vehicle, Source { path: path.into(), text: source.text + &over.text }))
    }

    /// Checks a file of values for a vehicle file by laying it over the built-in vehicle. Where its values do not go with
    /// that car's, they may go with another's, and nothing is wrong with the file.
    ///
    /// # Errors
    /// The file is no TOML, or holds a key or a value that no vehicle file may have.
    pub fn check_overlay(over: &Source) -> Result<(), ConfigError> {
        match Self::laid_over(Self::built_in()?.source, over) {
            Err(error) if error.path() == over.path => Err(error),
            _ => Ok(()),
        }
    }

    /// Checks the text of a vehicle file.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn from_source(source: Source) -> Result<Self, ConfigError> {
        if source.kind().is_ok_and(|kind| kind == Kind::Car) {
            let message = "is a vehicle with a whole gearbox, not one with a single shift".to_owned();
            let hint = "`simulate`, `demo`, `bench`, `estimate`, `fit`, `design` and `check` take it; what searches one shift needs a file with [gear_train]";
            return Err(Check::of(&source).meaning("gearbox", 0, message, Some(hint.to_owned())));
        }
        if let Some(short) = Short::of(&source)? {
            let layers = short.layers(&source);
            let vehicle = of_file(&Check { layers }, &layers.parse()?)
                .map_err(|error| of_default(error, &short.defaults, &source))?;
            let (source, defaults_taken) = short.complete(&source)?;
            return Ok(Self { vehicle, source, defaults_taken });
        }
        let vehicle = of_file(&Check::of(&source), &source.parse_as(Kind::Vehicle)?)?;
        Ok(Self { vehicle, defaults_taken: short::left_out(&source)?, source })
    }

    /// The vehicle with another value at a key: `change` of what stands there by `value`. Names of a list's items are keys.
    ///
    /// # Errors
    /// There is no such value, or the changed one is not one that a vehicle file may have.
    pub fn changed(&self, key: &str, change: Change, value: f64) -> Result<Vehicle, ConfigError> {
        self.changed_at(&key.split('.').collect::<Vec<_>>(), change, value)
    }

    /// The same at a path of keys.
    fn changed_at(&self, path: &[&str], change: Change, value: f64) -> Result<Vehicle, ConfigError> {
        let mut tree = Tree::of(&self.source)?;
        let keys: Vec<String> = path.iter().map(|key| (*key).to_owned()).collect();
        let wrong = |message| Check::of(&self.source).meaning(path.join("."), 0, message, None);
        tree.change(&keys, change, value).map_err(wrong)?;
        of_tree(&self.source, &tree)
    }

    /// The shafts of the gear train, each with what twice its inertia adds to the mass matrix of the shift.
    ///
    /// # Errors
    /// A shaft with twice its inertia is not one that a vehicle file may have.
    pub fn shafts(&self) -> Result<Vec<Shaft>, ConfigError> {
        let raw: RawVehicleFile = self.source.parse_as(Kind::Vehicle)?;
        let shaft = |name: &str| {
            let path = ["gear_train", "shaft", name, "inertia_kg_m2"];
            let mut mass_kg_m2 = self.changed_at(&path, Change::Scale, 2.0)?.shift.mass_kg_m2;
            for (row, base) in mass_kg_m2.iter_mut().zip(self.shift.mass_kg_m2) {
                row.iter_mut().zip(base).for_each(|(cell, base)| *cell -= base);
            }
            Ok(Shaft { name: name.to_owned(), mass_kg_m2 })
        };
        raw.gear_train.shaft.get_ref().iter().map(|raw| shaft(raw.name.get_ref())).collect()
    }

    /// The same of a file with these values in place of its own.
    pub(crate) fn from_tree(source: &Source, tree: &Tree) -> Result<Self, ConfigError> {
        let vehicle = of_tree(source, tree)?;
        Ok(Self { vehicle, source: source.clone(), defaults_taken: Vec::new() })
    }
}

/// The vehicle of a file some of whose values may have been changed.
fn of_tree(source: &Source, tree: &Tree) -> Result<Vehicle, ConfigError> {
    checked(&Check::of(source), &tree.read(source)?)
}

/// The vehicle of a file as it was written, which is within its own error bounds.
fn of_file(check: &Check<'_>, raw: &RawVehicleFile) -> Result<Vehicle, ConfigError> {
    let vehicle = checked(check, raw)?;
    let stated = raw.design.error_bounds.get_ref();
    budget::contain_vehicle(check, stated, &vehicle)?;
    Ok(vehicle)
}

/// The vehicle that these values describe.
fn checked(check: &Check<'_>, raw: &RawVehicleFile) -> Result<Vehicle, ConfigError> {
    refuse_facts(check, raw)?;
    let gear = gear_train::check(check, raw)?;
    let oil_temperature_degc = oil_temperature(check, &raw.oil)?;
    let clutch = |name: &str| clutch::check(check, name, raw, oil_temperature_degc);
    // A clutch that this shift leaves alone is checked like the others.
    for name in raw.clutch.keys() {
        clutch(name)?;
    }
    let (offgoing, oncoming) = (clutch(&gear.offgoing)?, clutch(&gear.oncoming)?);
    let (driveline, tyre) = (driveline(check, &raw.driveline)?, tyre(check, &raw.tyre)?);
    let error_bounds =
        budget::error_bounds(check, &raw.design.error_bounds, &oncoming, oil_temperature(check, &raw.oil)?)?;
    let road = road(check, &raw.vehicle)?;
    let speed_max_rad_s = check.number("observer.speed_max_rad_s", &raw.observer.speed_max_rad_s, 100.0..=5e3)?;
    let command_max = check.number("observer.command_max", &raw.observer.command_max, 0.1..=100.0)?;
    let commanded = (command_max, error_bounds.pressure_max_pa);
    valves::clutch_can_engage(check, &oncoming, commanded, raw.observer.command_max.span().start)?;
    for (name, clutch) in [(&gear.offgoing, &offgoing), (&gear.oncoming, &oncoming)] {
        valves::settled_pressure_rises(
            check,
            &format!("clutch.{name}.valve"),
            &clutch.valve,
            &raw.clutch[name].valve,
            command_max + error_bounds.command,
        )?;
    }
    let observer_valve = valves::observer_valve(check, &raw.observer.valve, &oncoming.valve)?;
    let command_kind = observer_valve.command_kind();
    let phase_slips = phase_slips(check, &raw.observer)?;
    Ok(Vehicle {
        name: check.title("name", &raw.name)?,
        engine: engine(check, &raw.engine)?,
        converter: converter(check, &raw.converter)?,
        shift: gear.reduced,
        output_inertia_kg_m2: gear.output_inertia_kg_m2,
        offgoing,
        oncoming,
        driveline,
        backlash_rad: backlash(check, &raw.driveline)?,
        oil_temperature_degc,
        tyre,
        road,
        settings: ObserverSettings {
            valve: observer_valve,
            uncertainty: valves::uncertainty(check, &raw.observer.uncertainty, command_kind)?,
            phase_slips,
            speed_max_rad_s,
            command_max,
            filter: filter(check, &raw.observer.filter)?,
            shaft_settling_s: check.number("observer.shaft_settling_s", &raw.observer.shaft_settling_s, 0.01..=10.0)?,
        },
        requirements: Requirements {
            torque_phase: requirement(check, "design.torque_phase", &raw.design.torque_phase)?,
            inertia_phase: requirement(check, "design.inertia_phase", &raw.design.inertia_phase)?,
            compliant_torque_phase: compliant(check, "torque_phase", &raw.design.compliant.torque_phase)?,
            compliant_inertia_phase: compliant(check, "inertia_phase", &raw.design.compliant.inertia_phase)?,
        },
        error_bounds,
    })
}

fn engine(check: &Check<'_>, raw: &RawEngine) -> Result<Engine<f64>, ConfigError> {
    Ok(Engine {
        inertia_kg_m2: check.number("engine.inertia_kg_m2", &raw.inertia_kg_m2, 0.01..=5.0)?,
        drag_n_m_s: check.number("engine.drag_n_m_s", &raw.drag_n_m_s, 0.0..=1.0)?,
        torque_n_m: engine_map(check, &raw.torque)?,
    })
}

fn driveline(check: &Check<'_>, raw: &RawDriveline) -> Result<Driveline<f64>, ConfigError> {
    let number = |key: &str, value: &Number, range| check.number(format_args!("driveline.{key}"), value, range);
    Ok(Driveline {
        final_ratio: number("final_ratio", &raw.final_ratio, FINAL_RATIOS)?,
        shaft_stiffness_n_m_rad: number("shaft_stiffness_n_m_rad", &raw.shaft_stiffness_n_m_rad, 100.0..=2e6)?,
        shaft_damping_n_m_s_rad: number("shaft_damping_n_m_s_rad", &raw.shaft_damping_n_m_s_rad, 0.0..=10e3)?,
        wheel_inertia_kg_m2: number("wheel_inertia_kg_m2", &raw.wheel_inertia_kg_m2, 0.05..=1e3)?,
    })
}

fn backlash(check: &Check<'_>, raw: &RawDriveline) -> Result<f64, ConfigError> {
    match &raw.backlash_rad {
        Some(backlash) => check.number("driveline.backlash_rad", backlash, BACKLASHES_RAD),
        None => Ok(0.0),
    }
}

fn tyre(check: &Check<'_>, raw: &RawTyre) -> Result<Tyre<f64>, ConfigError> {
    Ok(Tyre {
        max_force_n: check.number("tyre.max_force_n", &raw.max_force_n, 1e3..=600e3)?,
        slip_scale: check.number("tyre.slip_scale", &raw.slip_scale, 0.01..=0.5)?,
        floor_m_s: check.number("tyre.floor_m_s", &raw.floor_m_s, 0.1..=10.0)?,
    })
}

fn engine_map(check: &Check<'_>, raw: &RawEngineMap) -> Result<Table2<f64>, ConfigError> {
    let throttle = check.axis("engine.torque.throttle", &raw.throttle, 0.0..=1.0, MAX_COLUMNS)?;
    let speed = check.axis("engine.torque.speed_rad_s", &raw.speed_rad_s, 0.0..=2e3, MAX_POINTS)?;
    let key = "engine.torque.torque_n_m";
    let rows = raw.torque_n_m.get_ref();
    for (i, row) in rows.iter().enumerate() {
        check.numbers(format_args!("{key}[{i}]"), row, -2e3..=3e3)?;
        if row.get_ref().len() != throttle.len() {
            let message =
                format!("the row has {} torques, but `throttle` has {} positions", row.get_ref().len(), throttle.len());
            let hint = Some("a row has one torque for each throttle position".to_owned());
            return Err(check.meaning(format!("{key}[{i}]"), row.span().start, message, hint));
        }
    }
    let values: Vec<&[f64]> = rows.iter().map(|row| row.get_ref().as_slice()).collect();
    if !values.is_empty() && values.iter().all(|row| row.iter().all(|torque| *torque <= 0.0)) {
        let message = "no torque of the map is above zero".to_owned();
        let hint =
            "rows are speeds, columns are throttle positions; the last column is that of open throttle, N m".to_owned();
        return Err(check.meaning(key, raw.torque_n_m.span().start, message, Some(hint)));
    }
    Table2::new(speed, throttle, &values).map_err(|error| {
        // Axes and rows are as they must be: what is left is the number of rows.
        let message = match error {
            TableError::LengthMismatch(speeds, rows) => format!("{rows} rows of torque for {speeds} speeds"),
            other => other.to_string(),
        };
        let hint = Some("the map has one row for each speed".to_owned());
        check.meaning(key, raw.torque_n_m.span().start, message, hint)
    })
}

fn converter(check: &Check<'_>, raw: &RawConverter) -> Result<Converter<f64>, ConfigError> {
    let axis = || ("converter.speed_ratio", &raw.speed_ratio, 0.0..=10.0);
    let converter = Converter {
        capacity_n_m_s2: check.table(axis(), ("converter.capacity_n_m_s2", &raw.capacity_n_m_s2, -0.1..=0.1))?,
        torque_ratio: check.table(axis(), ("converter.torque_ratio", &raw.torque_ratio, 0.5..=5.0))?,
    };
    if let Some(ratio) = creating_power(&converter) {
        let message =
            format!("at a speed ratio of {} the turbine power is larger than the pump power", significant(ratio));
        let hint =
            "torque ratio times speed ratio must be below 1 in drive; in overrun the capacity must be negative".into();
        let at = raw.capacity_n_m_s2.span().start;
        return Err(check.meaning("converter.capacity_n_m_s2", at, message, Some(hint)));
    }
    let (Some(&last), Some(&capacity)) =
        (converter.capacity_n_m_s2.axis().last(), converter.capacity_n_m_s2.values().last())
    else {
        return Ok(converter);
    };
    if capacity > 0.0 {
        let message =
            format!("is {capacity} at the last speed ratio, {last}, and would have this value in overrun too");
        let hint = "extend the map to a speed ratio of 1 or more, with a capacity of zero or less".to_owned();
        let at = raw.capacity_n_m_s2.span().start;
        return Err(check.meaning("converter.capacity_n_m_s2", at, message, Some(hint)));
    }
    Ok(converter)
}

/// Places between two breakpoints at which the power of the converter is looked at.
const LOOKED_AT: u32 = 16;

/// A speed ratio at which the turbine gives more power than the pump takes, `C(lambda) (1 - t(lambda) lambda) < 0`.
/// Between breakpoints that is a cubic polynomial, which can dip below zero where both ends are above it.
fn creating_power(converter: &Converter<f64>) -> Option<f64> {
    let creates = |ratio: f64| {
        let capacity = converter.capacity_n_m_s2.at(ratio);
        capacity * (1.0 - converter.torque_ratio.at(ratio) * ratio) < -1e-9
    };
    let between = |ends: &[f64]| {
        let (from, step) = (ends[0], (ends[1] - ends[0]) / f64::from(LOOKED_AT));
        (0..=LOOKED_AT).map(move |i| from + step * f64::from(i)).collect::<Vec<f64>>()
    };
    let axis = converter.capacity_n_m_s2.axis();
    axis.iter().copied().chain([0.0]).chain(axis.windows(2).flat_map(between)).find(|&ratio| creates(ratio))
}

fn oil_temperature(check: &Check<'_>, raw: &RawOil) -> Result<f64, ConfigError> {
    match &raw.temperature_degc {
        Some(temperature) => check.number("oil.temperature_degc", temperature, OIL_TEMPERATURES_DEGC),
        None => Ok(WARM_OIL_DEGC),
    }
}

fn road(check: &Check<'_>, raw: &RawRoad) -> Result<RoadLoad<f64>, ConfigError> {
    Ok(RoadLoad {
        mass_kg: check.number("vehicle.mass_kg", &raw.mass_kg, MASSES_KG)?,
        wheel_radius_m: check.number("vehicle.wheel_radius_m", &raw.wheel_radius_m, WHEEL_RADII_M)?,
        front_area_m2: check.number("vehicle.front_area_m2", &raw.front_area_m2, 0.5..=15.0)?,
        drag_coefficient: check.number("vehicle.drag_coefficient", &raw.drag_coefficient, 0.05..=2.0)?,
        air_density_kg_m3: check.number("vehicle.air_density_kg_m3", &raw.air_density_kg_m3, 0.5..=2.0)?,
        rolling_moment_n_m: check.number("vehicle.rolling_moment_n_m", &raw.rolling_moment_n_m, 0.0..=20e3)?,
        grade_rad: check.number("vehicle.grade_rad", &raw.grade_rad, -0.4..=0.4)?,
    })
}

fn phase_slips(check: &Check<'_>, raw: &RawObserver) -> Result<PhaseSlips, ConfigError> {
    let raw = &raw.supervisor;
    let number = |key: &str, value: &crate::check::Number, range| {
        check.number(format_args!("observer.supervisor.{key}"), value, range)
    };
    Ok(PhaseSlips {
        release_slip_rad_s: number("release_slip_rad_s", &raw.release_slip_rad_s, 0.1..=100.0)?,
        lock_slip_rad_s: number("lock_slip_rad_s", &raw.lock_slip_rad_s, 0.1..=100.0)?,
        lock_hold_s: number("lock_hold_s", &raw.lock_hold_s, 0.0..=1.0)?,
    })
}

fn requirement(check: &Check<'_>, table: &str, raw: &RawRequirement) -> Result<DesignRequirement, ConfigError> {
    let number = |key: &str, value, range| check.number(format_args!("{table}.{key}"), value, range);
    Ok(DesignRequirement {
        settling_time_s: number("settling_time_s", &raw.settling_time_s, 0.005..=10.0)?,
        kappa1_per_s: raw.kappa1_per_s.as_ref().map(|value| number("kappa1_per_s", value, 0.01..=1e4)).transpose()?,
        model_error_max_rad_s2: number("model_error_max_rad_s2", &raw.model_error_max_rad_s2, 0.0..=1e6)?,
        offset_max_pa: number("offset_max_pa", &raw.offset_max_pa, 1e3..=10e6)?,
    })
}

fn compliant(
    check: &Check<'_>,
    phase: &str,
    raw: &RawCompliantRequirement,
) -> Result<CompliantRequirement, ConfigError> {
    let number = |key: &str, value, range| check.number(format_args!("design.compliant.{phase}.{key}"), value, range);
    Ok(CompliantRequirement {
        settling_time_s: number("settling_time_s", &raw.settling_time_s, 0.005..=10.0)?,
        kappa1_per_s: raw.kappa1_per_s.as_ref().map(|value| number("kappa1_per_s", value, 0.01..=1e4)).transpose()?,
        offset_max_pa: number("offset_max_pa", &raw.offset_max_pa, 1e3..=10e6)?,
        error_matrix: raw.error_matrix.as_ref().map(|rows| error_matrix(check, phase, rows)).transpose()?,
    })
}

fn error_matrix(check: &Check<'_>, phase: &str, rows: &Spanned<Vec<Numbers>>) -> Result<[[f64; 3]; 3], ConfigError> {
    let key = format!("design.compliant.{phase}.error_matrix");
    let outputs = if phase == "inertia_phase" { 3 } else { 2 };
    let mut matrix = [[0.0; 3]; 3];
    let wrong = |place: usize| {
        let hint = Some("`wetclutch error-bound` writes this matrix".to_owned());
        check.meaning(&key, place, format!("expected {outputs} rows of up to 3 numbers, one row for each output"), hint)
    };
    if rows.get_ref().len() != outputs {
        return Err(wrong(rows.span().start));
    }
    for (row, given) in matrix.iter_mut().zip(rows.get_ref()) {
        let values = check.numbers(&key, given, -1e6..=1e6)?;
        if values.is_empty() || values.len() > 3 {
            return Err(wrong(given.span().start));
        }
        row[..values.len()].copy_from_slice(values);
    }
    Ok(matrix)
}

fn filter(check: &Check<'_>, raw: &RawFilter) -> Result<FilterSettings, ConfigError> {
    let number = |key: &str, value, range| check.number(format_args!("observer.filter.{key}"), value, range);
    Ok(FilterSettings {
        turbine_share: number("turbine_share", &raw.turbine_share, 1e-4..=1.0)?,
        turbine_share_s: number("turbine_share_s", &raw.turbine_share_s, 0.01..=1e3)?,
        twist_rate_rad_s: number("twist_rate_rad_s", &raw.twist_rate_rad_s, 0.0..=10.0)?,
        valve_rate_s: number("valve_rate_s", &raw.valve_rate_s, 1e-3..=10.0)?,
        offgoing_n_m: number("offgoing_n_m", &raw.offgoing_n_m, 0.1..=1e5)?,
        offgoing_release_s: number("offgoing_release_s", &raw.offgoing_release_s, 1e-3..=10.0)?,
        output_least_rad_s: number("output_least_rad_s", &raw.output_least_rad_s, 0.1..=500.0)?,
    })
}
