//! Checked vehicle files.

mod car;
mod clutch;
mod fill;
mod fill_bounds;
mod gear_train;
mod raw;
mod valves;

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use drivetrain::{Converter, Driveline, Engine, ReducedShift, RoadLoad, Table2, TableError, Tyre, Valve};
use observer::{FillBudget, InputLimits, Supervisor};

use drivetrain::oil::WARM_OIL_DEGC;
use drivetrain::table::{MAX_COLUMNS, MAX_POINTS};
use toml::Spanned;

use crate::check::{Check, Number, Numbers, significant};
use crate::source::Layers;
use crate::tree::Tree;
use crate::{ConfigError, Kind, Source};
pub use car::{Car, LockUp};
pub(crate) use clutch::HYSTERESES_PA;
pub use clutch::ShiftClutch;
use raw::{
    RawCompliantRequirement, RawConverter, RawDriveline, RawEngine, RawEngineMap, RawErrorBounds, RawFilter,
    RawObserver, RawOil, RawRequirement, RawRoad, RawTyre, RawVehicleFile,
};

/// Largest drive-shaft torque over what the tyres can pass to the road [chosen]: wheels that spin up take more for a moment.
const SHAFT_OVER_TYRES: f64 = 2.0;

/// Temperatures of transmission oil, degC.
pub(crate) const OIL_TEMPERATURES_DEGC: std::ops::RangeInclusive<f64> = -40.0..=150.0;
/// Backlash of the driveline at the wheel, rad.
pub(crate) const BACKLASHES_RAD: std::ops::RangeInclusive<f64> = 0.0..=0.5;

/// Half-width of a valve's hysteresis where the file says nothing, Pa [chosen]: trade data sheets of proportional pressure
/// reducers give 2 to 4 % of full scale for the whole width.
const VALVE_HYSTERESIS_PA: f64 = 10e3;

/// Age of a command where the file says nothing, s [chosen]: one time step of any log at 20 Hz or more.
const COMMAND_AGE_S: f64 = 0.05;

/// Ranges of what varies in the observer's model; their corners span the polytope of Eq. (2.46).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Uncertainty {
    /// Friction coefficient of the oncoming clutch, least and greatest.
    pub friction: (f64, f64),
    /// What varies in the valve.
    pub valve: ValveUncertainty,
}

/// What varies in the observers' valve model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ValveUncertainty {
    /// Nothing.
    None,
    /// The time constant of a proportional valve, s, least and greatest.
    TimeConstant((f64, f64)),
    /// The operating points of a pulse-width valve, at which it is linearised: size of the pressure drop between its
    /// settled pressure and the cylinder, Pa, lower and upper limit.
    PressureDrop((f64, f64)),
}

/// What the gain design must reach in one phase.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DesignRequirement {
    /// Time in which an initial error must be gone, s: `4 / kappa2`.
    pub settling_time_s: f64,
    /// `kappa1`, 1/s, if it is given and not to be found by the design.
    pub kappa1_per_s: Option<f64>,
    /// Bound on the model error `|w|`, rad/s^2.
    pub model_error_max_rad_s2: f64,
    /// Largest acceptable offset of the pressure estimate, Pa.
    pub offset_max_pa: f64,
}

/// What the gain design of the compliant observer must reach in one phase.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CompliantRequirement {
    /// Time in which an initial error must be gone, s: `4 / kappa2`.
    pub settling_time_s: f64,
    /// `kappa1`, 1/s, if it is given and not to be found by the design.
    pub kappa1_per_s: Option<f64>,
    /// Largest acceptable offset of the pressure estimate, Pa.
    pub offset_max_pa: f64,
    /// `H` for `|w| <= 1`, normalised, if it is given and not to follow from the error bounds: a row for each output
    /// of the phase; what is beyond them is zero.
    pub error_matrix: Option<[[f64; 3]; 3]>,
}

/// The error budget: bounds on the errors of the observers' model of the car.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorBounds {
    /// Turbine torque from the converter's maps, N m.
    pub turbine_torque_n_m: f64,
    /// The same as a share of the torque.
    pub turbine_torque_share: f64,
    /// Pressure from the valve model alone, Pa.
    pub pressure_pa: f64,
    /// Mass of the vehicle, kg.
    pub mass_kg: f64,
    /// Grade, rad.
    pub grade_rad: f64,
    /// Largest drive-shaft torque of a shift, N m: a mass error acts in its proportion.
    pub shaft_torque_n_m: f64,
    /// Torque at the gearbox output that the rigid model leaves out (torsion, tyre slip, grade), N m.
    pub output_torque_n_m: f64,
    /// Torque left in the offgoing clutch when it has let go, N m.
    pub offgoing_torque_n_m: f64,
    /// Time from its first slip until no more than that is left, s.
    pub offgoing_drain_s: f64,
    /// Error of the change of the turbine speed from one sample to the next, rad/s.
    pub turbine_quantum_rad_s: f64,
    /// Error of the change of the output speed from one sample to the next, rad/s.
    pub output_quantum_rad_s: f64,
    /// Error of the change of the slip from one sample to the next, rad/s.
    pub slip_quantum_rad_s: f64,
    /// Error of the change of the wheel speed from one sample to the next, rad/s.
    pub wheel_quantum_rad_s: f64,
    /// Greatest age of a reading, s.
    pub sampling_delay_s: f64,
    /// Rounding of one operation in single precision, as a share.
    pub float32_rounding: f64,
    /// Pressure above the kiss point in a shift, at which errors of gain and friction are weighed, Pa.
    pub shift_pressure_pa: f64,
    /// Rate of the pressure in a shift, at which errors of lag and delay are weighed, Pa/s.
    pub shift_ramp_pa_s: f64,
    /// Least and greatest factor on the lag of the oncoming clutch's valve.
    pub valve_lag_factor: [f64; 2],
    /// Least and greatest factor on its gain.
    pub valve_gain_factor: [f64; 2],
    /// Its least and greatest delay, s.
    pub valve_delay_s: [f64; 2],
    /// Greatest half-width of its hysteresis, Pa.
    pub valve_hysteresis_pa: f64,
    /// Greatest time between a command and the sample that first shows it, s.
    pub command_age_s: f64,
    /// Least and greatest line pressure, Pa.
    pub line_pressure_pa: [f64; 2],
    /// Limits of the oncoming clutch's piston stroke, if it is part of the budget.
    pub fill: Option<FillBudget<f64>>,
    /// Least and greatest factor on the friction of the oncoming clutch.
    pub friction_factor: [f64; 2],
    /// Error of a reading of the valve's command, A or %.
    pub command: f64,
    /// Error of a reading of the slip, rad/s, its age included.
    pub slip_rad_s: f64,
    /// Highest pressure that the supply can give, Pa.
    pub pressure_max_pa: f64,
    /// Error of the scale of the wheel speed, as a share: tyres that are worn, or of another size.
    pub wheel_scale: f64,
    /// Largest delay of the wheel speed, s.
    pub wheel_delay_s: f64,
    /// Largest delay of the turbine speed and of the output speed, each against the other, s.
    pub channel_skew_s: f64,
    /// Error of the torque that the engine controller reports, as a share.
    pub engine_torque_share: f64,
    /// Least and greatest factor on the stiffness of the drive shafts.
    pub shaft_stiffness_factor: [f64; 2],
    /// Twist over which the driveline carries no torque, rad at the wheels.
    pub backlash_rad: f64,
}

/// The Kalman filter's model of the unknown torques, in addition to the error bounds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FilterSettings {
    /// Standard deviation of the turbine torque, as a share.
    pub turbine_share: f64,
    /// Time after which that share is another during a shift, s.
    pub turbine_share_s: f64,
    /// Standard deviation of the rate of twist outside a shift, rad/s: how far the readings of output and wheel disagree.
    pub twist_rate_rad_s: f64,
    /// Time for which an error of the valve model persists, s.
    pub valve_rate_s: f64,
    /// How fast the torque of the offgoing clutch changes while it holds, N m per root second.
    pub offgoing_n_m: f64,
    /// Time constant with which it goes once the clutch has let go, s.
    pub offgoing_release_s: f64,
    /// Output speed below which readings of toothed wheels are too old to be used, rad/s.
    pub output_least_rad_s: f64,
}

/// A vehicle: everything the plant, the observers and the design need to know.
#[derive(Debug, Clone, PartialEq)]
pub struct Vehicle {
    /// The file.
    pub source: Source,
    /// Its name for people.
    pub name: String,
    /// The engine.
    pub engine: Engine<f64>,
    /// The torque converter.
    pub converter: Converter<f64>,
    /// The bare gear train, reduced to the shift.
    pub shift: ReducedShift<f64>,
    /// Inertia `I_o` of the output shaft in [`Self::shift`], kg m^2.
    pub output_inertia_kg_m2: f64,
    /// The clutch that lets go.
    pub offgoing: ShiftClutch,
    /// The clutch that engages, whose pressure is estimated.
    pub oncoming: ShiftClutch,
    /// Differential, drive shafts, wheels.
    pub driveline: Driveline<f64>,
    /// Backlash between gearbox and wheels, rad at the wheel. Observers do not know it.
    pub backlash_rad: f64,
    /// Temperature of the oil, degC.
    pub oil_temperature_degc: f64,
    /// The driven tyres.
    pub tyre: Tyre<f64>,
    /// Vehicle body and road.
    pub road: RoadLoad<f64>,
    /// The observers' model of the oncoming clutch's valve.
    pub observer_valve: Valve<f64>,
    /// What varies in the observers' model.
    pub uncertainty: Uncertainty,
    /// Thresholds of the phase supervisor.
    pub supervisor: Supervisor<f64>,
    /// What counts as a measurement.
    pub limits: InputLimits<f64>,
    /// Requirement in the torque phase.
    pub torque_phase: DesignRequirement,
    /// Requirement in the inertia phase.
    pub inertia_phase: DesignRequirement,
    /// Requirement on the compliant observer in the torque phase.
    pub compliant_torque_phase: CompliantRequirement,
    /// Requirement on the compliant observer in the inertia phase.
    pub compliant_inertia_phase: CompliantRequirement,
    /// The error budget.
    pub error_bounds: ErrorBounds,
    /// The Kalman filter's model of the unknown torques.
    pub filter: FilterSettings,
    /// Time in which the estimated shaft torque leans towards its steady value outside the shift, s.
    pub shaft_settling_s: f64,
}

impl Vehicle {
    /// The two-speed transmission that ships with the program.
    ///
    /// # Errors
    /// None in a released program; the tests read this file.
    pub fn two_speed_at() -> Result<Self, ConfigError> {
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
        Self::laid_over(Source::read(path)?, &Source::read(overlay)?)
    }

    fn laid_over(source: Source, over: &Source) -> Result<Self, ConfigError> {
        let layers = Layers { source: &source, over: Some(over) };
        let vehicle = Self::checked(&Check { layers }, &layers.parse()?)?;
        let path = format!("{} with {}", source.path.display(), over.path.display());
        Ok(Self { source: Source { path: path.into(), text: source.text + &over.text }, ..vehicle })
    }

    /// Checks a file of values for a vehicle file by laying it over the built-in vehicle. Where its values do not go with
    /// that car's, they may go with another's, and nothing is wrong with the file.
    ///
    /// # Errors
    /// The file is no TOML, or holds a key or a value that no vehicle file may have.
    pub fn check_overlay(over: &Source) -> Result<(), ConfigError> {
        match Self::laid_over(Self::two_speed_at()?.source, over) {
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
            let hint = "`simulate`, `demo`, `bench`, `estimate` and `check` take it; designs, studies and fits need a file with [gear_train]";
            return Err(Check::of(&source).meaning("gearbox", 0, message, Some(hint.to_owned())));
        }
        let vehicle = Self::checked(&Check::of(&source), &source.parse()?)?;
        Ok(Self { source, ..vehicle })
    }

    /// The vehicle of a file some of whose values may have been changed.
    pub(crate) fn from_tree(source: &Source, tree: &Tree) -> Result<Self, ConfigError> {
        let vehicle = Self::checked(&Check::of(source), &tree.read(source)?)?;
        Ok(Self { source: source.clone(), ..vehicle })
    }

    /// The vehicle that these values describe, whose source is left to be filled in.
    fn checked(check: &Check<'_>, raw: &RawVehicleFile) -> Result<Self, ConfigError> {
        let gear = gear_train::check(check, raw)?;
        let oil_temperature_degc = oil_temperature(check, &raw.oil)?;
        let clutch = |name: &str| clutch::check(check, name, raw, oil_temperature_degc);
        // A clutch that this shift leaves alone is checked like the others.
        for name in raw.clutch.keys() {
            clutch(name)?;
        }
        let (offgoing, oncoming) = (clutch(&gear.offgoing)?, clutch(&gear.oncoming)?);
        let (driveline, tyre) = (driveline(check, &raw.driveline)?, tyre(check, &raw.tyre)?);
        let error_bounds = error_bounds(check, &raw.design.error_bounds, &oncoming, oil_temperature(check, &raw.oil)?)?;
        let road = road(check, &raw.vehicle)?;
        let kiss_pressure_pa = oncoming.clutch.kiss_pressure();
        let limits = InputLimits {
            speed_max_rad_s: check.number("observer.speed_max_rad_s", &raw.observer.speed_max_rad_s, 100.0..=5e3)?,
            command_max: check.number("observer.command_max", &raw.observer.command_max, 0.1..=100.0)?,
            pressure_max_pa: error_bounds.pressure_max_pa,
            shaft_torque_max_n_m: SHAFT_OVER_TYRES * tyre.max_force_n * road.wheel_radius_m,
        };
        let command_max = limits.command_max + error_bounds.command;
        valves::clutch_can_engage(check, &oncoming, &limits, raw.observer.command_max.span().start)?;
        for (name, clutch) in [(&gear.offgoing, &offgoing), (&gear.oncoming, &oncoming)] {
            valves::settled_pressure_rises(
                check,
                &format!("clutch.{name}.valve"),
                &clutch.valve,
                &raw.clutch[name].valve,
                command_max,
            )?;
        }
        let observer_valve = valves::observer_valve(check, &raw.observer.valve, &oncoming.valve)?;
        let command_kind = observer_valve.command_kind();
        let supervisor = supervisor(check, &raw.observer, kiss_pressure_pa)?;
        Ok(Self {
            name: raw.name.clone(),
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
            observer_valve,
            uncertainty: valves::uncertainty(check, &raw.observer.uncertainty, command_kind)?,
            supervisor,
            limits,
            torque_phase: requirement(check, "design.torque_phase", &raw.design.torque_phase)?,
            inertia_phase: requirement(check, "design.inertia_phase", &raw.design.inertia_phase)?,
            compliant_torque_phase: compliant(check, "torque_phase", &raw.design.compliant.torque_phase)?,
            compliant_inertia_phase: compliant(check, "inertia_phase", &raw.design.compliant.inertia_phase)?,
            error_bounds,
            filter: filter(check, &raw.observer.filter)?,
            shaft_settling_s: check.number("observer.shaft_settling_s", &raw.observer.shaft_settling_s, 0.01..=10.0)?,
            source: Source { path: PathBuf::new(), text: String::new() },
        })
    }
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
        final_ratio: number("final_ratio", &raw.final_ratio, 0.5..=10.0)?,
        shaft_stiffness_n_m_rad: number("shaft_stiffness_n_m_rad", &raw.shaft_stiffness_n_m_rad, 500.0..=200e3)?,
        shaft_damping_n_m_s_rad: number("shaft_damping_n_m_s_rad", &raw.shaft_damping_n_m_s_rad, 0.0..=2e3)?,
        wheel_inertia_kg_m2: number("wheel_inertia_kg_m2", &raw.wheel_inertia_kg_m2, 0.2..=50.0)?,
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
        max_force_n: check.number("tyre.max_force_n", &raw.max_force_n, 1e3..=200e3)?,
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
            return Err(check.meaning(format!("{key}[{i}]"), row.span().start, message, None));
        }
    }
    let values: Vec<&[f64]> = rows.iter().map(|row| row.get_ref().as_slice()).collect();
    Table2::new(speed, throttle, &values).map_err(|error| {
        // Axes and rows are as they must be: what is left is the number of rows.
        let message = match error {
            TableError::LengthMismatch(speeds, rows) => format!("{rows} rows of torque for {speeds} speeds"),
            other => other.to_string(),
        };
        check.meaning(key, raw.torque_n_m.span().start, message, None)
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
        mass_kg: check.number("vehicle.mass_kg", &raw.mass_kg, 200.0..=60e3)?,
        wheel_radius_m: check.number("vehicle.wheel_radius_m", &raw.wheel_radius_m, 0.1..=1.0)?,
        front_area_m2: check.number("vehicle.front_area_m2", &raw.front_area_m2, 0.5..=15.0)?,
        drag_coefficient: check.number("vehicle.drag_coefficient", &raw.drag_coefficient, 0.05..=2.0)?,
        air_density_kg_m3: check.number("vehicle.air_density_kg_m3", &raw.air_density_kg_m3, 0.5..=2.0)?,
        rolling_moment_n_m: check.number("vehicle.rolling_moment_n_m", &raw.rolling_moment_n_m, 0.0..=5e3)?,
        grade_rad: check.number("vehicle.grade_rad", &raw.grade_rad, -0.4..=0.4)?,
    })
}

fn supervisor(check: &Check<'_>, raw: &RawObserver, kiss_pressure_pa: f64) -> Result<Supervisor<f64>, ConfigError> {
    let raw = &raw.supervisor;
    let number = |key: &str, value: &crate::check::Number, range| {
        check.number(format_args!("observer.supervisor.{key}"), value, range)
    };
    Ok(Supervisor {
        kiss_pressure_pa,
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
        check.meaning(&key, place, format!("expected {outputs} rows of up to 3 numbers, one row for each output"), None)
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

/// Tyres: size, wear and pressure.
const WHEEL_SCALE: f64 = 0.02;
/// Filter and bus of the brakes' controller.
const WHEEL_DELAY_S: f64 = 0.03;
/// Error of a reported engine torque [chosen].
const ENGINE_TORQUE_SHARE: f64 = 0.08;
/// One cycle of a bus.
const CHANNEL_SKEW_S: f64 = 0.01;
const SHAFT_STIFFNESS_FACTOR: [f64; 2] = [0.8, 1.2];
const BACKLASH_RAD: f64 = 0.03;

fn error_bounds(
    check: &Check<'_>,
    spanned: &Spanned<RawErrorBounds>,
    oncoming: &ShiftClutch,
    oil_degc: f64,
) -> Result<ErrorBounds, ConfigError> {
    let (at, raw) = (spanned.span().start, spanned.get_ref());
    let number =
        |key: &str, value: &Number, range| check.number(format_args!("design.error_bounds.{key}"), value, range);
    let range =
        |key: &str, values: &Numbers, allowed| check.pair(format_args!("design.error_bounds.{key}"), values, allowed);
    let factor = |key: &str, values: &Numbers, allowed| {
        let factors = range(key, values, allowed)?;
        if (factors[0]..=factors[1]).contains(&1.0) {
            return Ok(factors);
        }
        let key = format!("design.error_bounds.{key}");
        let [least, greatest] = factors;
        let message = format!(
            "{least} to {greatest} does not contain 1: the car of this file would be outside its own error budget"
        );
        Err(check.meaning(&key, values.span().start, message, Some("an error of 10 % is [0.9, 1.1]".to_owned())))
    };
    let optional = |key: &str, value: &Option<Number>, range: RangeInclusive<f64>, default: f64| match value {
        Some(value) => number(key, value, range),
        None => Ok(default),
    };
    let pressure_max_pa = number("pressure_max_pa", &raw.pressure_max_pa, 1e5..=10e6)?;
    let line = raw.line_pressure_pa.as_ref();
    let line_pressure_pa = line.map(|line| range("line_pressure_pa", line, 0.0..=pressure_max_pa)).transpose()?;
    Ok(ErrorBounds {
        wheel_scale: optional("wheel_scale", &raw.wheel_scale, 0.0..=0.2, WHEEL_SCALE)?,
        wheel_delay_s: optional("wheel_delay_s", &raw.wheel_delay_s, 0.0..=0.2, WHEEL_DELAY_S)?,
        channel_skew_s: optional("channel_skew_s", &raw.channel_skew_s, 0.0..=0.1, CHANNEL_SKEW_S)?,
        engine_torque_share: optional("engine_torque_share", &raw.engine_torque_share, 0.0..=1.0, ENGINE_TORQUE_SHARE)?,
        shaft_stiffness_factor: match &raw.shaft_stiffness_factor {
            Some(factors) => factor("shaft_stiffness_factor", factors, 0.2..=5.0)?,
            None => SHAFT_STIFFNESS_FACTOR,
        },
        backlash_rad: optional("backlash_rad", &raw.backlash_rad, 0.0..=0.2, BACKLASH_RAD)?,
        turbine_torque_n_m: number("turbine_torque_n_m", &raw.turbine_torque_n_m, 0.0..=1e3)?,
        pressure_pa: number("pressure_pa", &raw.pressure_pa, 0.0..=2e6)?,
        mass_kg: number("mass_kg", &raw.mass_kg, 0.0..=20e3)?,
        grade_rad: number("grade_rad", &raw.grade_rad, 0.0..=0.4)?,
        shaft_torque_n_m: number("shaft_torque_n_m", &raw.shaft_torque_n_m, 0.0..=50e3)?,
        output_torque_n_m: number("output_torque_n_m", &raw.output_torque_n_m, 0.0..=50e3)?,
        offgoing_torque_n_m: number("offgoing_torque_n_m", &raw.offgoing_torque_n_m, 0.0..=1e4)?,
        offgoing_drain_s: number("offgoing_drain_s", &raw.offgoing_drain_s, 0.0..=2.0)?,
        turbine_torque_share: number("turbine_torque_share", &raw.turbine_torque_share, 0.0..=0.9)?,
        turbine_quantum_rad_s: number("turbine_quantum_rad_s", &raw.turbine_quantum_rad_s, 0.0..=50.0)?,
        output_quantum_rad_s: number("output_quantum_rad_s", &raw.output_quantum_rad_s, 0.0..=50.0)?,
        slip_quantum_rad_s: number("slip_quantum_rad_s", &raw.slip_quantum_rad_s, 0.0..=50.0)?,
        wheel_quantum_rad_s: number("wheel_quantum_rad_s", &raw.wheel_quantum_rad_s, 0.0..=50.0)?,
        sampling_delay_s: number("sampling_delay_s", &raw.sampling_delay_s, 0.0..=0.2)?,
        float32_rounding: number("float32_rounding", &raw.float32_rounding, 0.0..=1e-3)?,
        shift_pressure_pa: number("shift_pressure_pa", &raw.shift_pressure_pa, 0.0..=2e6)?,
        shift_ramp_pa_s: number("shift_ramp_pa_s", &raw.shift_ramp_pa_s, 0.0..=1e8)?,
        valve_lag_factor: factor("valve_lag_factor", &raw.valve_lag_factor, 0.01..=100.0)?,
        valve_gain_factor: factor("valve_gain_factor", &raw.valve_gain_factor, 0.1..=10.0)?,
        valve_delay_s: range("valve_delay_s", &raw.valve_delay_s, 0.0..=0.5)?,
        valve_hysteresis_pa: match &raw.valve_hysteresis_pa {
            Some(half_width) => {
                number("valve_hysteresis_pa", half_width, oncoming.hysteresis_pa..=*HYSTERESES_PA.end())?
            }
            None => VALVE_HYSTERESIS_PA.max(oncoming.hysteresis_pa),
        },
        command_age_s: match &raw.command_age_s {
            Some(age) => number("command_age_s", age, 0.0..=1.0)?,
            None => COMMAND_AGE_S,
        },
        line_pressure_pa: line_pressure_pa.unwrap_or([pressure_max_pa; 2]),
        fill: fill_bounds::bounds(check, raw.fill.as_ref(), oncoming, oil_degc)?,
        friction_factor: factor("friction_factor", &raw.friction_factor, 0.1..=10.0)?,
        command: valves::command_error(check, at, raw, oncoming.valve.command_kind())?,
        slip_rad_s: number("slip_rad_s", &raw.slip_rad_s, 0.0..=200.0)?,
        pressure_max_pa,
    })
}
