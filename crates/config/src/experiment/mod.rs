//! The experiment file, checked.

mod observers;
mod raw;

use std::path::{Path, PathBuf};

use drivetrain::Table1;

use crate::check::{Check, Number};
use crate::{ConfigError, Source, Vehicle};
use raw::{RawExperiment, RawOffNominal, RawScenario, RawShift};

pub use observers::{CurrentSensor, GainMethod, GivenGains, ObserverEntry, ObserverKind, Sensors, SpeedSensor};

/// A signal over time, linear between its points, held outside them.
pub type Profile = Table1<f64>;

/// In what the simulated car differs from the one the observers were designed for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OffNominal {
    /// Factor on the engine's torque.
    pub engine_torque_factor: f64,
    /// Factor on the converter's capacity.
    pub converter_capacity_factor: f64,
    /// Factor on the friction of the oncoming clutch.
    pub friction_factor: f64,
    /// Factor on the lag of both valves.
    pub valve_lag_factor: f64,
    /// Factor on the gain of both valves.
    pub valve_gain_factor: f64,
    /// Constant delay of both valves, s, if not the vehicle file's map.
    pub valve_delay_s: Option<f64>,
    /// Mass, kg, if not the vehicle file's.
    pub mass_kg: Option<f64>,
    /// Grade, rad, if not the vehicle file's.
    pub grade_rad: Option<f64>,
}

/// A variation of an experiment, for the bench.
#[derive(Debug, Clone, PartialEq)]
pub struct Scenario {
    /// Its name in tables.
    pub name: String,
    /// The driver's throttle, in place of the profile's last position.
    pub throttle: Option<f64>,
    /// Age of the speed readings, s, in place of the sensors' own.
    pub sensor_delay_s: Option<f64>,
    /// Factor on the noise of all sensors.
    pub sensor_noise_factor: f64,
    /// Tooth periods of a reading of the wheels, in place of the sensor's own. The observers are told: it is how the sensor
    /// is made.
    pub wheel_periods: Option<f64>,
    /// The same of the output.
    pub output_periods: Option<f64>,
    /// In what the car differs from the nominal one.
    pub off_nominal: OffNominal,
}

/// Calibration of the shift controller.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShiftCalibration {
    /// Time of the shift request, s.
    pub request_s: f64,
    /// Period of the controller, s.
    pub control_period_s: f64,
    /// Line pressure, to which a clutch is applied outside the shift, Pa.
    pub line_pressure_pa: f64,
    /// Turbine torque over what the converter's maps say, as the controller has learnt it.
    pub torque_factor: f64,
    /// How far ahead trajectories are read, s, for the dead time of the valves.
    pub lead_s: f64,
    /// Pressure commanded at first to fill the oncoming clutch, Pa.
    pub boost_pressure_pa: f64,
    /// How long, s.
    pub boost_s: f64,
    /// Time at the kiss point before the torque phase, s.
    pub settle_s: f64,
    /// Offgoing pressure over what the gear needs, during the fill.
    pub fill_holding_margin: f64,
    /// Time of the load transfer, s.
    pub torque_phase_s: f64,
    /// Offgoing pressure over what the gear needs, during the load transfer.
    pub transfer_holding_margin: f64,
    /// Offgoing slip that ends the torque phase, rad/s.
    pub release_slip_rad_s: f64,
    /// Time in which the slip reference falls to zero, s.
    pub inertia_phase_s: f64,
    /// Slip controller: torque per slip error, N m s/rad.
    pub proportional_n_m_s_rad: f64,
    /// Slip controller: torque per integral of slip error, N m/rad.
    pub integral_n_m_rad: f64,
    /// Throttle during the inertia phase over the driver's.
    pub throttle_factor: f64,
    /// Time in which the throttle goes there and back, s.
    pub throttle_ramp_s: f64,
    /// Oncoming slip below which the throttle comes back, rad/s.
    pub throttle_return_slip_rad_s: f64,
    /// Oncoming slip that counts as locked, rad/s.
    pub lock_slip_rad_s: f64,
    /// Time in which the locked clutch is brought to line pressure, s.
    pub lock_ramp_s: f64,
}

/// One simulated drive.
#[derive(Debug, Clone, PartialEq)]
pub struct Experiment {
    /// The file.
    pub source: Source,
    /// Short name, used for file names.
    pub name: String,
    /// Title for people.
    pub title: String,
    /// The vehicle file, as the experiment names it, relative to itself.
    pub vehicle: PathBuf,
    /// Length of the drive, s.
    pub duration_s: f64,
    /// Sample time of the recorded signals, s.
    pub sample_time_s: f64,
    /// Engine speed at the start, rad/s.
    pub initial_engine_rad_s: f64,
    /// Vehicle speed at the start, m/s.
    pub initial_vehicle_m_s: f64,
    /// The driver's throttle over time.
    pub throttle: Profile,
    /// Differences between the simulated and the nominal car.
    pub off_nominal: OffNominal,
    /// The shift controller's calibration.
    pub shift: ShiftCalibration,
    /// The car's sensors, if the experiment describes them.
    pub sensors: Option<Sensors>,
    /// The sensors as the observers are told: those of the file, whatever a scenario or study makes of them.
    pub sensors_told: Option<Sensors>,
    /// The observers to be run.
    pub observers: Vec<ObserverEntry>,
    /// Variations for the bench.
    pub scenarios: Vec<Scenario>,
}

impl Experiment {
    /// Experiments E1 to E4, as they ship with the program.
    ///
    /// # Errors
    /// None in a released program; the tests read these files.
    pub fn built_in() -> Result<[Self; 4], ConfigError> {
        let read = |path, text| Self::from_source(Source::built_in(path, text));
        Ok([
            read("experiments/e1.toml", include_str!("../../../../experiments/e1.toml"))?,
            read("experiments/e2.toml", include_str!("../../../../experiments/e2.toml"))?,
            read("experiments/e3.toml", include_str!("../../../../experiments/e3.toml"))?,
            read("experiments/e4.toml", include_str!("../../../../experiments/e4.toml"))?,
        ])
    }

    /// The bench, as it ships with the program.
    ///
    /// # Errors
    /// As [`Self::built_in`].
    pub fn bench() -> Result<Self, ConfigError> {
        let text = include_str!("../../../../experiments/bench.toml");
        Self::from_source(Source::built_in("experiments/bench.toml", text))
    }

    /// Experiment E1, as it ships with the program.
    ///
    /// # Errors
    /// As [`Self::built_in`].
    pub fn e1() -> Result<Self, ConfigError> {
        Self::built_in().map(|[e1, ..]| e1)
    }

    /// Reads and checks an experiment file.
    ///
    /// # Errors
    /// The file cannot be read, is not an experiment file, or holds a value that cannot be right.
    pub fn read(path: &Path) -> Result<Self, ConfigError> {
        Self::from_source(Source::read(path)?)
    }

    /// Checks the text of an experiment file.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn from_source(source: Source) -> Result<Self, ConfigError> {
        let raw: RawExperiment = source.parse()?;
        let check = Check { source: &source };
        let duration_s = check.number("duration_s", &raw.duration_s, 0.1..=600.0)?;
        let throttle = check.table(
            ("throttle.time_s", &raw.throttle.time_s, 0.0..=600.0),
            ("throttle.position", &raw.throttle.position, 0.0..=1.0),
        )?;
        let has_sensors = raw.sensors.is_some();
        let observers = raw.observer.iter().map(|entry| observers::observer(&check, entry, has_sensors));
        let sensors = raw.sensors.as_ref().map(|sensors| observers::sensors(&check, sensors)).transpose()?;
        Ok(Self {
            vehicle: PathBuf::from(raw.vehicle.get_ref()),
            sensors,
            sensors_told: sensors,
            observers: observers.collect::<Result<_, _>>()?,
            scenarios: raw.scenario.iter().map(|raw| scenario(&check, raw)).collect::<Result<_, _>>()?,
            duration_s,
            sample_time_s: check.number("sample_time_s", &raw.sample_time_s, 1e-5..=0.1)?,
            initial_engine_rad_s: check.number("initial.engine_rad_s", &raw.initial.engine_rad_s, 0.0..=1e3)?,
            initial_vehicle_m_s: check.number("initial.vehicle_m_s", &raw.initial.vehicle_m_s, 0.0..=100.0)?,
            throttle,
            off_nominal: off_nominal(&check, &raw.off_nominal)?,
            shift: shift(&check, &raw.shift, duration_s)?,
            name: raw.name,
            title: raw.title,
            source,
        })
    }

    /// Where the vehicle file is, seen from the program.
    pub fn vehicle_path(&self) -> PathBuf {
        self.source.path.parent().map_or_else(|| self.vehicle.clone(), |folder| folder.join(&self.vehicle))
    }

    /// This experiment with the variations of a scenario, and a shift controller that has adapted to them.
    #[must_use]
    pub fn with_scenario(&self, scenario: &Scenario) -> Self {
        let mut varied = self.clone();
        varied.off_nominal = scenario.off_nominal;
        varied.adapt_controller();
        if let Some(throttle) = scenario.throttle {
            let (times, mut positions) = (self.throttle.axis(), self.throttle.values().to_vec());
            if let Some(last) = positions.last_mut() {
                *last = throttle;
            }
            // The times are those of a table that was checked.
            varied.throttle = Table1::new(times, &positions).unwrap_or(self.throttle);
        }
        for sensors in [&mut varied.sensors, &mut varied.sensors_told].into_iter().flatten() {
            sensors.wheel.periods = scenario.wheel_periods.unwrap_or(sensors.wheel.periods);
            sensors.output.periods = scenario.output_periods.unwrap_or(sensors.output.periods);
        }
        if let Some(sensors) = &mut varied.sensors {
            for sensor in [&mut sensors.engine, &mut sensors.turbine, &mut sensors.output, &mut sensors.wheel] {
                sensor.delay_s = scenario.sensor_delay_s.unwrap_or(sensor.delay_s);
                sensor.noise_rad_s *= scenario.sensor_noise_factor;
            }
            sensors.current.noise_a *= scenario.sensor_noise_factor;
        }
        varied
    }

    /// Lets the shift controller know the turbine torque of the simulated car, as one that adapts would.
    pub fn adapt_controller(&mut self) {
        self.shift.torque_factor *= self.off_nominal.converter_capacity_factor;
    }

    /// The car that is simulated: the nominal one with the differences applied.
    pub fn simulated_vehicle(&self, nominal: &Vehicle) -> Vehicle {
        let mut vehicle = nominal.clone();
        let change = &self.off_nominal;
        vehicle.engine.torque_n_m = vehicle.engine.torque_n_m.scaled(change.engine_torque_factor);
        vehicle.converter.capacity_n_m_s2 = vehicle.converter.capacity_n_m_s2.scaled(change.converter_capacity_factor);
        let oncoming = &mut vehicle.oncoming.clutch;
        oncoming.friction = oncoming.friction.scaled(change.friction_factor);
        oncoming.static_friction *= change.friction_factor;
        for valve in [&mut vehicle.offgoing.valve, &mut vehicle.oncoming.valve] {
            valve.time_constant_s = valve.time_constant_s.scaled(change.valve_lag_factor);
            valve.gain_pa_a = valve.gain_pa_a.scaled(change.valve_gain_factor);
            valve.delay_s = change.valve_delay_s.map_or(valve.delay_s, Table1::constant);
        }
        vehicle.road.mass_kg = change.mass_kg.unwrap_or(vehicle.road.mass_kg);
        vehicle.road.grade_rad = change.grade_rad.unwrap_or(vehicle.road.grade_rad);
        vehicle
    }
}

fn off_nominal(check: &Check<'_>, raw: &RawOffNominal) -> Result<OffNominal, ConfigError> {
    let optional = |key: &str, value: &Option<Number>, range| {
        value.as_ref().map(|value| check.number(&format!("off_nominal.{key}"), value, range)).transpose()
    };
    let factor = |key: &str, value| Ok(optional(key, value, 0.1..=10.0)?.unwrap_or(1.0));
    Ok(OffNominal {
        engine_torque_factor: factor("engine_torque_factor", &raw.engine_torque_factor)?,
        converter_capacity_factor: factor("converter_capacity_factor", &raw.converter_capacity_factor)?,
        friction_factor: factor("friction_factor", &raw.friction_factor)?,
        valve_lag_factor: factor("valve_lag_factor", &raw.valve_lag_factor)?,
        valve_gain_factor: factor("valve_gain_factor", &raw.valve_gain_factor)?,
        valve_delay_s: optional("valve_delay_s", &raw.valve_delay_s, 0.0..=0.5)?,
        mass_kg: optional("mass_kg", &raw.mass_kg, 200.0..=60e3)?,
        grade_rad: optional("grade_rad", &raw.grade_rad, -0.4..=0.4)?,
    })
}

fn scenario(check: &Check<'_>, raw: &RawScenario) -> Result<Scenario, ConfigError> {
    let optional = |key: &str, value: &Option<Number>, range| {
        value.as_ref().map(|value| check.number(&format!("scenario.{key}"), value, range)).transpose()
    };
    Ok(Scenario {
        name: raw.name.clone(),
        throttle: optional("throttle", &raw.throttle, 0.0..=1.0)?,
        sensor_delay_s: optional("sensor_delay_s", &raw.sensor_delay_s, 0.0..=0.2)?,
        sensor_noise_factor: optional("sensor_noise_factor", &raw.sensor_noise_factor, 0.0..=100.0)?.unwrap_or(1.0),
        wheel_periods: optional("wheel_periods", &raw.wheel_periods, 1.0..=100.0)?,
        output_periods: optional("output_periods", &raw.output_periods, 1.0..=100.0)?,
        off_nominal: off_nominal(check, &raw.off_nominal)?,
    })
}

fn shift(check: &Check<'_>, raw: &RawShift, duration_s: f64) -> Result<ShiftCalibration, ConfigError> {
    let number = |key: &str, value, range| check.number(&format!("shift.{key}"), value, range);
    let (fill, torque, inertia) = (&raw.fill, &raw.torque_phase, &raw.inertia_phase);
    Ok(ShiftCalibration {
        request_s: number("request_s", &raw.request_s, 0.0..=duration_s)?,
        control_period_s: number("control_period_s", &raw.control_period_s, 1e-4..=0.1)?,
        line_pressure_pa: number("line_pressure_pa", &raw.line_pressure_pa, 1e5..=10e6)?,
        torque_factor: match &raw.torque_factor {
            Some(factor) => number("torque_factor", factor, 0.1..=10.0)?,
            None => 1.0,
        },
        lead_s: number("lead_s", &raw.lead_s, 0.0..=0.5)?,
        boost_pressure_pa: number("fill.boost_pressure_pa", &fill.boost_pressure_pa, 0.0..=10e6)?,
        boost_s: number("fill.boost_s", &fill.boost_s, 0.0..=2.0)?,
        settle_s: number("fill.settle_s", &fill.settle_s, 0.0..=2.0)?,
        fill_holding_margin: number("fill.holding_margin", &fill.holding_margin, 1.0..=5.0)?,
        torque_phase_s: number("torque_phase.duration_s", &torque.duration_s, 0.01..=5.0)?,
        transfer_holding_margin: number("torque_phase.holding_margin", &torque.holding_margin, 0.5..=5.0)?,
        release_slip_rad_s: number("torque_phase.release_slip_rad_s", &torque.release_slip_rad_s, 0.1..=100.0)?,
        inertia_phase_s: number("inertia_phase.duration_s", &inertia.duration_s, 0.05..=5.0)?,
        proportional_n_m_s_rad: number(
            "inertia_phase.proportional_n_m_s_rad",
            &inertia.proportional_n_m_s_rad,
            0.0..=100.0,
        )?,
        integral_n_m_rad: number("inertia_phase.integral_n_m_rad", &inertia.integral_n_m_rad, 0.0..=1e3)?,
        throttle_factor: number("inertia_phase.throttle_factor", &inertia.throttle_factor, 0.0..=1.0)?,
        throttle_ramp_s: number("inertia_phase.throttle_ramp_s", &inertia.throttle_ramp_s, 0.001..=2.0)?,
        throttle_return_slip_rad_s: number(
            "inertia_phase.throttle_return_slip_rad_s",
            &inertia.throttle_return_slip_rad_s,
            0.0..=500.0,
        )?,
        lock_slip_rad_s: number("lock.slip_rad_s", &raw.lock.slip_rad_s, 0.1..=100.0)?,
        lock_ramp_s: number("lock.ramp_s", &raw.lock.ramp_s, 0.001..=5.0)?,
    })
}
