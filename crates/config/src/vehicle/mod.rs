//! The vehicle file, checked.

mod gear_train;
mod raw;

use std::path::Path;

use drivetrain::{
    Clutch, Converter, Driveline, Engine, ReducedShift, RoadLoad, Table2, TableError, Tyre, Valve, ValveMaps,
};
use observer::{InputLimits, Supervisor};

use toml::Spanned;

use crate::check::{Check, Numbers};
use crate::{ConfigError, Source};
use raw::{
    RawClutch, RawCompliantRequirement, RawEngineMap, RawErrorBounds, RawFilter, RawObserver, RawRequirement,
    RawUncertainty, RawValve, RawVehicleFile,
};

/// A shift clutch with the valve that fills it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShiftClutch {
    /// Geometry and friction.
    pub clutch: Clutch<f64>,
    /// The real valve: lag, gain and delay over the operating point.
    pub valve: ValveMaps<f64>,
}

/// Ranges of what varies in the observer's model; their corners span the polytope of Eq. (2.46).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Uncertainty {
    /// Friction coefficient of the oncoming clutch, least and greatest.
    pub friction: (f64, f64),
    /// Time constant of a proportional valve, s, least and greatest.
    pub time_constant_s: Option<(f64, f64)>,
    /// Duty cycle of a pulse-width valve, %, least and greatest.
    pub command: Option<(f64, f64)>,
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

/// Largest errors of what the observers are told about the car.
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
    /// Least and greatest factor on the friction of the oncoming clutch.
    pub friction_factor: [f64; 2],
    /// Error of a reading of the valve's current, A.
    pub current_a: f64,
    /// Error of a reading of the slip, rad/s, its age included.
    pub slip_rad_s: f64,
    /// Highest pressure that the supply can give, Pa.
    pub pressure_max_pa: f64,
}

/// What the Kalman filter is told beside the error bounds: how the unknown torques behave.
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
    /// The driven tyres.
    pub tyre: Tyre<f64>,
    /// Vehicle body and road.
    pub road: RoadLoad<f64>,
    /// The oncoming clutch's valve as the observers are told.
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
    /// Largest errors of what the observers are told.
    pub error_bounds: ErrorBounds,
    /// What the Kalman filter is told.
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
    /// of a vehicle file, such as what `wetclutch error-bound` writes.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn read_with(path: &Path, overlay: &Path) -> Result<Self, ConfigError> {
        let source = Source::read(path)?;
        let over = Source::read(overlay)?;
        let mut table: toml::Table = source.parse()?;
        merge(&mut table, over.parse()?);
        let joint = format!("{} with {}", source.path.display(), over.path.display());
        Self::from_source(Source { path: joint.into(), text: table.to_string() })
    }

    /// Checks the text of a vehicle file.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn from_source(source: Source) -> Result<Self, ConfigError> {
        let raw: RawVehicleFile = source.parse()?;
        let check = Check { source: &source };
        let gear = gear_train::check(&check, &raw)?;
        let (offgoing, oncoming) = (clutch(&check, &gear.offgoing, &raw)?, clutch(&check, &gear.oncoming, &raw)?);
        let driveline = Driveline {
            final_ratio: check.number("driveline.final_ratio", &raw.driveline.final_ratio, 0.5..=10.0)?,
            shaft_stiffness_n_m_rad: check.number(
                "driveline.shaft_stiffness_n_m_rad",
                &raw.driveline.shaft_stiffness_n_m_rad,
                500.0..=200e3,
            )?,
            shaft_damping_n_m_s_rad: check.number(
                "driveline.shaft_damping_n_m_s_rad",
                &raw.driveline.shaft_damping_n_m_s_rad,
                0.0..=2e3,
            )?,
            wheel_inertia_kg_m2: check.number(
                "driveline.wheel_inertia_kg_m2",
                &raw.driveline.wheel_inertia_kg_m2,
                0.2..=50.0,
            )?,
        };
        let tyre = Tyre {
            max_force_n: check.number("tyre.max_force_n", &raw.tyre.max_force_n, 1e3..=200e3)?,
            slip_scale: check.number("tyre.slip_scale", &raw.tyre.slip_scale, 0.01..=0.5)?,
            floor_m_s: check.number("tyre.floor_m_s", &raw.tyre.floor_m_s, 0.1..=10.0)?,
        };
        let kiss_pressure_pa = oncoming.clutch.kiss_pressure();
        let supervisor = supervisor(&check, &raw.observer, kiss_pressure_pa)?;
        Ok(Self {
            name: raw.name.clone(),
            engine: Engine {
                inertia_kg_m2: check.number("engine.inertia_kg_m2", &raw.engine.inertia_kg_m2, 0.01..=5.0)?,
                drag_n_m_s: check.number("engine.drag_n_m_s", &raw.engine.drag_n_m_s, 0.0..=1.0)?,
                torque_n_m: engine_map(&check, &raw.engine.torque)?,
            },
            converter: converter(&check, &raw)?,
            shift: gear.reduced,
            output_inertia_kg_m2: gear.output_inertia_kg_m2,
            offgoing,
            oncoming,
            driveline,
            tyre,
            road: road(&check, &raw)?,
            observer_valve: observer_valve(&check, &raw.observer.valve)?,
            uncertainty: uncertainty(&check, &raw.observer.uncertainty)?,
            supervisor,
            limits: InputLimits {
                speed_max_rad_s: check.number(
                    "observer.speed_max_rad_s",
                    &raw.observer.speed_max_rad_s,
                    100.0..=5e3,
                )?,
                command_max: check.number("observer.command_max", &raw.observer.command_max, 0.1..=100.0)?,
            },
            torque_phase: requirement(&check, "design.torque_phase", &raw.design.torque_phase)?,
            inertia_phase: requirement(&check, "design.inertia_phase", &raw.design.inertia_phase)?,
            compliant_torque_phase: compliant(&check, "torque_phase", &raw.design.compliant.torque_phase)?,
            compliant_inertia_phase: compliant(&check, "inertia_phase", &raw.design.compliant.inertia_phase)?,
            error_bounds: error_bounds(&check, &raw.design.error_bounds)?,
            filter: filter(&check, &raw.observer.filter)?,
            shaft_settling_s: check.number("observer.shaft_settling_s", &raw.observer.shaft_settling_s, 0.01..=10.0)?,
            source,
        })
    }
}

fn engine_map(check: &Check<'_>, raw: &RawEngineMap) -> Result<Table2<f64>, ConfigError> {
    let throttle = check.numbers("engine.torque.throttle", &raw.throttle, 0.0..=1.0)?;
    let speed = check.numbers("engine.torque.speed_rad_s", &raw.speed_rad_s, 0.0..=2e3)?;
    let key = "engine.torque.torque_n_m";
    let rows = raw.torque_n_m.get_ref();
    for (i, row) in rows.iter().enumerate() {
        check.numbers(&format!("{key}[{i}]"), row, -2e3..=3e3)?;
        if row.get_ref().len() != throttle.len() {
            let message = format!("row has {} torques, `throttle` {} positions", row.get_ref().len(), throttle.len());
            return Err(check.meaning(&format!("{key}[{i}]"), row.span().start, message, None));
        }
    }
    let rows: Vec<&[f64]> = rows.iter().map(|row| row.get_ref().as_slice()).collect();
    Table2::new(speed, throttle, &rows).map_err(|error| {
        let message = match error {
            TableError::LengthMismatch(speeds, rows) => format!("{rows} rows of torque for {speeds} speeds"),
            other => other.to_string(),
        };
        check.meaning(key, raw.torque_n_m.span().start, message, None)
    })
}

fn converter(check: &Check<'_>, raw: &RawVehicleFile) -> Result<Converter<f64>, ConfigError> {
    let raw = &raw.converter;
    let axis = || ("converter.speed_ratio", &raw.speed_ratio, 0.0..=10.0);
    let converter = Converter {
        capacity_n_m_s2: check.table(axis(), ("converter.capacity_n_m_s2", &raw.capacity_n_m_s2, -0.1..=0.1))?,
        torque_ratio: check.table(axis(), ("converter.torque_ratio", &raw.torque_ratio, 0.5..=5.0))?,
    };
    let creates = |&ratio: &f64| {
        let capacity = converter.capacity_n_m_s2.at(ratio);
        capacity * (1.0 - converter.torque_ratio.at(ratio) * ratio) < -1e-9
    };
    if let Some(ratio) = raw.speed_ratio.get_ref().iter().find(|ratio| creates(ratio)) {
        let message = format!("at a speed ratio of {ratio} the turbine gives more power than the pump takes");
        let hint = "torque ratio times speed ratio stays below 1 in drive; in overrun the capacity is negative".into();
        let at = raw.capacity_n_m_s2.span().start;
        return Err(check.meaning("converter.capacity_n_m_s2", at, message, Some(hint)));
    }
    Ok(converter)
}

fn clutch(check: &Check<'_>, name: &str, raw: &RawVehicleFile) -> Result<ShiftClutch, ConfigError> {
    let raw: &RawClutch = &raw.clutch[name];
    let key = |field: &str| format!("clutch.{name}.{field}");
    let table = |axis: &str, axis_raw: &Numbers, axis_max: f64, values: &str, raw: &Numbers, range| {
        check.table((&key(axis), axis_raw, 0.0..=axis_max), (&key(values), raw, range))
    };
    let checked = ShiftClutch {
        clutch: Clutch {
            mean_radius_m: check.number(&key("mean_radius_m"), &raw.mean_radius_m, 0.02..=0.5)?,
            friction_faces: check.number(&key("friction_faces"), &raw.friction_faces, 1.0..=30.0)?,
            piston_area_m2: check.number(&key("piston_area_m2"), &raw.piston_area_m2, 0.001..=0.05)?,
            return_spring_n: check.number(&key("return_spring_n"), &raw.return_spring_n, 0.0..=10e3)?,
            static_friction: check.number(&key("static_friction"), &raw.static_friction, 0.02..=0.5)?,
            friction: table(
                "friction.slip_rad_s",
                &raw.friction.slip_rad_s,
                2e3,
                "friction.coefficient",
                &raw.friction.coefficient,
                0.02..=0.5,
            )?,
        },
        valve: ValveMaps {
            time_constant_s: table(
                "valve.lag.pressure_pa",
                &raw.valve.lag.pressure_pa,
                10e6,
                "valve.lag.time_constant_s",
                &raw.valve.lag.time_constant_s,
                0.001..=2.0,
            )?,
            gain_pa_a: table(
                "valve.gain.current_a",
                &raw.valve.gain.current_a,
                10.0,
                "valve.gain.gain_pa_a",
                &raw.valve.gain.gain_pa_a,
                1e4..=20e6,
            )?,
            delay_s: table(
                "valve.delay.current_a",
                &raw.valve.delay.current_a,
                10.0,
                "valve.delay.delay_s",
                &raw.valve.delay.delay_s,
                0.0..=0.5,
            )?,
        },
    };
    let (holding, sliding) = (checked.clutch.static_friction, checked.clutch.friction.at(0.0));
    if holding < sliding {
        let message = format!("is {holding}, less than the {sliding} of `friction` at zero slip");
        let hint = "a clutch that holds less than it drags would neither stick nor slip".to_owned();
        return Err(check.meaning(&key("static_friction"), raw.static_friction.span().start, message, Some(hint)));
    }
    Ok(checked)
}

fn road(check: &Check<'_>, raw: &RawVehicleFile) -> Result<RoadLoad<f64>, ConfigError> {
    let raw = &raw.vehicle;
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

fn observer_valve(check: &Check<'_>, raw: &RawValve) -> Result<Valve<f64>, ConfigError> {
    // A tagged enum loses the places of its values, so an error points at the table.
    let offset = check.source.text.find("[observer.valve]").unwrap_or(0);
    let number = |key: &str, value: f64, range| {
        check.number(&format!("observer.valve.{key}"), &toml::Spanned::new(offset..offset, value), range)
    };
    Ok(match *raw {
        RawValve::Proportional { time_constant_s, gain_pa_a } => Valve::Proportional {
            time_constant_s: number("time_constant_s", time_constant_s, 0.001..=2.0)?,
            gain_pa_a: number("gain_pa_a", gain_pa_a, 1e4..=20e6)?,
        },
        RawValve::PulseWidth { flow_sqrt_pa_s, line_pressure_pa, operating_pressure_pa } => Valve::PulseWidth {
            flow_sqrt_pa_s: number("flow_sqrt_pa_s", flow_sqrt_pa_s, 1.0..=1e6)?,
            line_pressure_pa: number("line_pressure_pa", line_pressure_pa, 1e5..=10e6)?,
            operating_pressure_pa: number("operating_pressure_pa", operating_pressure_pa, 0.0..=10e6)?,
        },
    })
}

fn uncertainty(check: &Check<'_>, raw: &RawUncertainty) -> Result<Uncertainty, ConfigError> {
    let pair = |key: &str, numbers: &Numbers, range| -> Result<(f64, f64), ConfigError> {
        let key = format!("observer.uncertainty.{key}");
        match *check.numbers(&key, numbers, range)? {
            [least, greatest] if least <= greatest => Ok((least, greatest)),
            _ => {
                let message = "expected [least, greatest]".to_owned();
                Err(check.meaning(&key, numbers.span().start, message, None))
            }
        }
    };
    let optional = |key: &str, numbers: &Option<Numbers>, range| {
        numbers.as_ref().map(|numbers| pair(key, numbers, range)).transpose()
    };
    Ok(Uncertainty {
        friction: pair("friction", &raw.friction, 0.02..=0.5)?,
        time_constant_s: optional("time_constant_s", &raw.time_constant_s, 0.001..=2.0)?,
        command: optional("command", &raw.command, 0.0..=100.0)?,
    })
}

fn supervisor(check: &Check<'_>, raw: &RawObserver, kiss_pressure_pa: f64) -> Result<Supervisor<f64>, ConfigError> {
    let raw = &raw.supervisor;
    let number = |key: &str, value, range| check.number(&format!("observer.supervisor.{key}"), value, range);
    Ok(Supervisor {
        kiss_pressure_pa,
        release_slip_rad_s: number("release_slip_rad_s", &raw.release_slip_rad_s, 0.1..=100.0)?,
        lock_slip_rad_s: number("lock_slip_rad_s", &raw.lock_slip_rad_s, 0.1..=100.0)?,
        lock_hold_s: number("lock_hold_s", &raw.lock_hold_s, 0.0..=1.0)?,
    })
}

fn requirement(check: &Check<'_>, table: &str, raw: &RawRequirement) -> Result<DesignRequirement, ConfigError> {
    let number = |key: &str, value, range| check.number(&format!("{table}.{key}"), value, range);
    Ok(DesignRequirement {
        settling_time_s: number("settling_time_s", &raw.settling_time_s, 0.005..=10.0)?,
        kappa1_per_s: raw.kappa1_per_s.as_ref().map(|value| number("kappa1_per_s", value, 0.01..=1e4)).transpose()?,
        model_error_max_rad_s2: number("model_error_max_rad_s2", &raw.model_error_max_rad_s2, 0.0..=1e6)?,
        offset_max_pa: number("offset_max_pa", &raw.offset_max_pa, 1e3..=10e6)?,
    })
}

/// Puts the values of one table in place of those of another, table by table.
fn merge(table: &mut toml::Table, over: toml::Table) {
    for (key, value) in over {
        match (table.get_mut(&key), value) {
            (Some(toml::Value::Table(below)), toml::Value::Table(above)) => merge(below, above),
            (_, value) => {
                table.insert(key, value);
            }
        }
    }
}

fn compliant(
    check: &Check<'_>,
    phase: &str,
    raw: &RawCompliantRequirement,
) -> Result<CompliantRequirement, ConfigError> {
    let number = |key: &str, value, range| check.number(&format!("design.compliant.{phase}.{key}"), value, range);
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
    let number = |key: &str, value, range| check.number(&format!("observer.filter.{key}"), value, range);
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

fn error_bounds(check: &Check<'_>, raw: &RawErrorBounds) -> Result<ErrorBounds, ConfigError> {
    let number = |key: &str, value, range| check.number(&format!("design.error_bounds.{key}"), value, range);
    let range = |key: &str, values: &Numbers, allowed| {
        let key = format!("design.error_bounds.{key}");
        match *check.numbers(&key, values, allowed)? {
            [least, greatest] if least <= greatest => Ok([least, greatest]),
            _ => Err(check.meaning(&key, values.span().start, "expected [least, greatest]".to_owned(), None)),
        }
    };
    Ok(ErrorBounds {
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
        valve_lag_factor: range("valve_lag_factor", &raw.valve_lag_factor, 0.01..=100.0)?,
        valve_gain_factor: range("valve_gain_factor", &raw.valve_gain_factor, 0.1..=10.0)?,
        valve_delay_s: range("valve_delay_s", &raw.valve_delay_s, 0.0..=0.5)?,
        friction_factor: range("friction_factor", &raw.friction_factor, 0.1..=10.0)?,
        current_a: number("current_a", &raw.current_a, 0.0..=1.0)?,
        slip_rad_s: number("slip_rad_s", &raw.slip_rad_s, 0.0..=200.0)?,
        pressure_max_pa: number("pressure_max_pa", &raw.pressure_max_pa, 1e5..=10e6)?,
    })
}
