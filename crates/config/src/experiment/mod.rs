//! Checked experiment files.

mod observers;
mod off_nominal;
pub(crate) mod raw;
pub(crate) mod sensors;

use std::path::{Path, PathBuf};

use car::{Discretisation, Experiment, FastFill, SAMPLE_TIMES_S, Scenario, Sensors, ShiftCalibration, Vehicle};

use crate::check::{Check, Number};
use crate::tree::Tree;
use crate::{ConfigError, Kind, Source, VehicleFile, file_of};
use off_nominal::off_nominal;
use raw::{RawExperiment, RawFill, RawScenario, RawShift};

pub use sensors::{read_sensors, sensors_of, simulated_sensors_of};

/// Most samples of a drive whose signals are held in memory.
const MAX_SAMPLES: f64 = 5e6;

/// An experiment file.
#[derive(Debug, Clone, PartialEq)]
pub struct ExperimentFile {
    /// What it describes.
    pub experiment: Experiment,
    /// The file.
    pub source: Source,
    /// The vehicle file, as the experiment names it, relative to itself.
    pub vehicle: PathBuf,
}

file_of!(ExperimentFile, experiment: Experiment);

impl ExperimentFile {
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
        let raw: RawExperiment = source.parse_as(Kind::Experiment)?;
        let experiment = checked(&Check::of(&source), &raw)?;
        Ok(Self { experiment, vehicle: PathBuf::from(raw.vehicle.get_ref()), source })
    }

    /// The experiment of a file some of whose values may have been changed.
    pub(crate) fn from_tree(source: &Source, tree: &Tree) -> Result<Self, ConfigError> {
        let raw: RawExperiment = tree.read(source)?;
        let experiment = checked(&Check::of(source), &raw)?;
        Ok(Self { experiment, vehicle: PathBuf::from(raw.vehicle.get_ref()), source: source.clone() })
    }

    /// The path of the vehicle file.
    pub fn vehicle_path(&self) -> PathBuf {
        self.source.path.parent().map_or_else(|| self.vehicle.clone(), |folder| folder.join(&self.vehicle))
    }

    /// Reads the vehicle file, and checks that its observers can run with the vehicle.
    ///
    /// # Errors
    /// The vehicle file cannot be read or is wrong, or as [`Self::check_observers`].
    pub fn read_vehicle(&self) -> Result<VehicleFile, ConfigError> {
        let vehicle = VehicleFile::read(&self.vehicle_path()).map_err(|error| {
            error.named_by(&self.source, "vehicle", self.place(|raw| Some(raw.vehicle.span().start)))
        })?;
        self.check_observers(&vehicle)?;
        Ok(vehicle)
    }

    /// Checks the sample time of every observer against the recorded signals and the valve of this vehicle.
    ///
    /// Forward Euler multiplies an error of the pressure by `1 + A22 T`. This factor is zero for `T = tau` and
    /// negative for a larger `T`; from `2 tau` on the error grows. With `T` up to `tau`, the error does not grow in a
    /// lost sample, which doubles `T`.
    ///
    /// # Errors
    /// The sample time of an observer with forward Euler is longer than the time constant of its valve model; or the
    /// sample time is shorter than that of the recorded signals.
    pub fn check_observers(&self, vehicle: &Vehicle) -> Result<(), ConfigError> {
        let fastest_s = -1.0 / vehicle.settings.valve.linear(0.0, 0.0).a22_per_s;
        for (entry, sample_time_s) in self.observers.iter().flat_map(|entry| self.sample_times_s(entry)) {
            let (message, hint) = if entry.discretisation == Discretisation::Euler && sample_time_s > fastest_s {
                let message = format!(
                    "a sample time of {sample_time_s} s is longer than the valve's time constant of {fastest_s:.4} s: forward \
                     Euler multiplies an error of the pressure by {:.3} in each sample",
                    1.0 - sample_time_s / fastest_s
                );
                let shorter = format!("use discretisation = \"exact\", or a sample time of at most {fastest_s:.4} s");
                (message, shorter)
            } else if sample_time_s < self.sample_time_s * (1.0 - 1e-9) {
                let message = format!(
                    "a sample time of {sample_time_s} s is shorter than the {} s of the recorded signals",
                    self.sample_time_s
                );
                (message, "use a longer sample time, or a shorter `sample_time_s` of the experiment".to_owned())
            } else {
                continue;
            };
            let at = self.place(|raw| {
                let of_it = raw.observer.iter().find(|other| *other.get_ref().name.get_ref() == entry.name)?;
                let time = of_it.get_ref().sample_time_s.as_ref().map(|time| time.span().start);
                Some(time.unwrap_or(of_it.span().start))
            });
            let key = format!("observer \"{}\"", entry.name);
            return Err(Check::of(&self.source).meaning(&key, at, message, Some(hint)));
        }
        Ok(())
    }

    /// Checks that the signals of the whole drive fit into memory, for work that needs all of them.
    ///
    /// # Errors
    /// The signals do not fit into memory.
    pub fn check_size(&self) -> Result<(), ConfigError> {
        let (duration_s, sample_time_s) = (self.duration_s, self.sample_time_s);
        if duration_s / sample_time_s <= MAX_SAMPLES {
            return Ok(());
        }
        let at = self.place(|raw| Some(raw.sample_time_s.span().start));
        let message =
            format!("{duration_s} s with a sample time of {sample_time_s} s are more than {MAX_SAMPLES} samples");
        let hint = "use a longer sample time; `wetclutch simulate` has no such limit".to_owned();
        Err(Check::of(&self.source).meaning("sample_time_s", at, message, Some(hint)))
    }

    /// The place of something in the file, read once more for an error.
    fn place(&self, of: impl Fn(&RawExperiment) -> Option<usize>) -> usize {
        self.source.parse().ok().as_ref().and_then(of).unwrap_or(0)
    }
}

/// The experiment that these values describe.
fn checked(check: &Check<'_>, raw: &RawExperiment) -> Result<Experiment, ConfigError> {
    let name = check.file_name("name", &raw.name)?.to_owned();
    let duration_s = check.number("duration_s", &raw.duration_s, 0.1..=600.0)?;
    let sample_time_s = check.number("sample_time_s", &raw.sample_time_s, 1e-5..=0.1)?;
    let throttle = check.table(
        ("throttle.time_s", &raw.throttle.time_s, 0.0..=600.0),
        ("throttle.position", &raw.throttle.position, 0.0..=1.0),
    )?;
    let has_sensors = raw.sensors.is_some();
    let observers = raw.observer.iter().map(|entry| observers::observer(check, entry, has_sensors));
    let observers = observers.collect::<Result<Vec<_>, _>>()?;
    observers::distinct(check, &raw.observer, &observers)?;
    let sensors = raw.sensors.as_ref().map(|raw| sensors::sensors(check, "sensors", raw, None)).transpose()?;
    Ok(Experiment {
        sensors,
        sensors_given: sensors.map(Sensors::without_errors),
        observers,
        scenarios: scenarios(check, &raw.scenario, sensors.as_ref(), sample_time_s, throttle.axis().len())?,
        draws: draws(check, raw.draws.as_ref())?,
        duration_s,
        sample_time_s,
        initial_engine_rad_s: check.number("initial.engine_rad_s", &raw.initial.engine_rad_s, 0.0..=1e3)?,
        initial_vehicle_m_s: check.number("initial.vehicle_m_s", &raw.initial.vehicle_m_s, 0.0..=100.0)?,
        throttle,
        off_nominal: off_nominal(check, &raw.off_nominal, throttle.axis().len())?,
        shift: shift(check, &raw.shift, duration_s)?,
        name,
        title: check.title("title", &raw.title)?,
    })
}

/// Draws of the sensors' random numbers, if the file does not say.
const DRAWS: u64 = 5;

fn draws(check: &Check<'_>, raw: Option<&Number>) -> Result<u64, ConfigError> {
    let Some(draws) = raw else { return Ok(DRAWS) };
    check.count("draws", draws, 1.0..=1000.0).map(|count| count as u64)
}

/// The scenarios, each with files of its own.
fn scenarios(
    check: &Check<'_>,
    raw: &[RawScenario],
    sensors: Option<&Sensors>,
    recorded_s: f64,
    throttle_points: usize,
) -> Result<Vec<Scenario>, ConfigError> {
    let scenario = |raw| scenario(check, raw, sensors, recorded_s, throttle_points);
    let scenarios = raw.iter().map(scenario).collect::<Result<Vec<_>, _>>()?;
    let same = |i: usize| scenarios[..i].iter().find(|other| other.file_name() == scenarios[i].file_name());
    match (0..scenarios.len()).find_map(|i| Some((i, same(i)?))) {
        None => Ok(scenarios),
        Some((i, other)) => {
            let message = format!("\"{}\" and \"{}\" would have the same files", other.name, scenarios[i].name);
            let hint = "give one of the scenarios another `name`".to_owned();
            Err(check.meaning("scenario.name", raw[i].name.span().start, message, Some(hint)))
        }
    }
}

fn scenario(
    check: &Check<'_>,
    raw: &RawScenario,
    sensors: Option<&Sensors>,
    recorded_s: f64,
    throttle_points: usize,
) -> Result<Scenario, ConfigError> {
    let optional = |key: &str, value: &Option<Number>, range| {
        value.as_ref().map(|value| check.number(format_args!("scenario.{key}"), value, range)).transpose()
    };
    let periods = |key: &str, value: &Option<Number>| {
        value.as_ref().map(|value| check.count(format_args!("scenario.{key}"), value, 1.0..=100.0)).transpose()
    };
    Ok(Scenario {
        name: check.name("scenario.name", raw.name.get_ref(), raw.name.span().start)?,
        throttle: optional("throttle", &raw.throttle, 0.0..=1.0)?,
        sensor_delay_s: optional("sensor_delay_s", &raw.sensor_delay_s, 0.0..=0.2)?,
        sensor_noise_factor: optional("sensor_noise_factor", &raw.sensor_noise_factor, 0.0..=100.0)?.unwrap_or(1.0),
        wheel_periods: periods("wheel_periods", &raw.wheel_periods)?,
        output_periods: periods("output_periods", &raw.output_periods)?,
        sensors: raw.sensors.as_ref().map(|raw| sensors::changed(check, raw, sensors)).transpose()?,
        row_time_s: optional("row_time_s", &raw.row_time_s, recorded_s..=*SAMPLE_TIMES_S.end())?,
        off_nominal: off_nominal(check, &raw.off_nominal, throttle_points)?,
    })
}

fn shift(check: &Check<'_>, raw: &RawShift, duration_s: f64) -> Result<ShiftCalibration, ConfigError> {
    let number = |key: &str, value, range| check.number(format_args!("shift.{key}"), value, range);
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
        fast_fill: fast_fill(check, fill)?,
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

/// Where the file says nothing, as a production controller does [chosen].
fn fast_fill(check: &Check<'_>, raw: &RawFill) -> Result<FastFill, ConfigError> {
    let number = |key: &str, value: &Option<Number>, default: f64, range| match value {
        Some(value) => check.number(format_args!("shift.fill.{key}"), value, range),
        None => Ok(default),
    };
    let usual = FastFill::STANDARD;
    Ok(FastFill {
        over_kiss_pa: number("fast_fill_over_kiss_pa", &raw.fast_fill_over_kiss_pa, usual.over_kiss_pa, 1e3..=2e6)?,
        offset_s: number("fast_fill_offset_s", &raw.fast_fill_offset_s, usual.offset_s, -0.2..=0.2)?,
        ramp_s: number("ramp_s", &raw.ramp_s, usual.ramp_s, 0.0..=1.0)?,
        stroke_over_kiss_pa: number(
            "stroke_over_kiss_pa",
            &raw.stroke_over_kiss_pa,
            usual.stroke_over_kiss_pa,
            0.0..=0.5e6,
        )?,
        hold_s: number("hold_s", &raw.hold_s, usual.hold_s, 0.0..=2.0)?,
    })
}
