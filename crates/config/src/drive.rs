//! Drive files: what the driver and the road do, and when the gearbox shifts.

use std::path::{Path, PathBuf};

use car::{Car, ControllerCalibration, Drive, DriveSegment, ShiftPlan, ShiftSchedule, SpeedTrace};
use drivetrain::Table1;
use serde::Deserialize;
use toml::Spanned;

use crate::check::{Check, Number, Numbers, Word};
use crate::experiment::raw::RawSensors;
use crate::experiment::sensors::sensors;
use crate::faults::RawFault;
use crate::{CarFile, ConfigError, Kind, Source, file_of, speed_trace};

/// Most repetitions of the segments.
const MAX_REPETITIONS: f64 = 1e6;
/// Where a schedule says nothing \[chosen\]: throttle, and speed of the gearbox input at which the gear above and the gear below
/// are taken, rad/s.
const SCHEDULE: [[f64; 5]; 3] =
    [[0.0, 0.1, 0.3, 0.6, 1.0], [190.0, 200.0, 260.0, 380.0, 560.0], [105.0, 110.0, 140.0, 230.0, 330.0]];
/// The name of no gear.
const NEUTRAL: &str = "N";
/// Minimum time in a gear where a schedule says nothing, s.
const MIN_TIME_IN_GEAR_S: f64 = 1.0;

/// A drive file.
#[derive(Debug, Clone, PartialEq)]
pub struct DriveFile {
    /// What it describes.
    pub drive: Drive,
    /// The file.
    pub source: Source,
    /// The vehicle file, from the folder of the drive file.
    pub vehicle: Option<PathBuf>,
    /// The file of the speeds that a driver follows.
    pub speeds: Option<PathBuf>,
}

file_of!(DriveFile, drive: Drive);

impl DriveFile {
    /// Reads and checks a drive file.
    ///
    /// # Errors
    /// The file cannot be read, or something in it is wrong.
    pub fn read(path: &Path) -> Result<Self, ConfigError> {
        Self::from_source(Source::read(path)?)
    }

    /// Reads the vehicle file that the drive file names.
    ///
    /// # Errors
    /// It names none, or the vehicle file is wrong.
    pub fn read_vehicle(&self) -> Result<CarFile, ConfigError> {
        let Some(vehicle) = &self.vehicle else {
            let hint = "vehicle = \"../vehicles/eight_speed.toml\", or the option --vehicle".to_owned();
            return Err(Check::of(&self.source).meaning("vehicle", 0, "names no vehicle file".to_owned(), Some(hint)));
        };
        let folder = self.source.path.parent().unwrap_or(Path::new(""));
        let named_at = self.source.place_of("", "vehicle").unwrap_or(0);
        let car = CarFile::read(&folder.join(vehicle));
        let car = car.map_err(|error| error.named_by(&self.source, "vehicle", named_at))?;
        self.check_names(&car.car)?;
        Ok(car)
    }

    /// Checks that a car has the gears, clutches and brakes that the drive names.
    ///
    /// # Errors
    /// It has no such gear, clutch or brake.
    pub fn check_names(&self, car: &Car) -> Result<(), ConfigError> {
        let raw: RawDrive = self.source.parse_as(Kind::Drive)?;
        let check = Check::of(&self.source);
        let gear = |key: &str, name: &Word| {
            let gears = &car.gearbox.gears;
            if name.get_ref() == NEUTRAL || car.gearbox.gear(name.get_ref()).is_some() {
                return Ok(());
            }
            let names = gears.iter().map(|gear| gear.name.as_str()).collect::<Vec<_>>().join(", ");
            let message = format!("the gearbox has no gear \"{}\"", name.get_ref());
            Err(check.meaning(key, name.span().start, message, Some(format!("its gears are {names}"))))
        };
        raw.start.gear.iter().try_for_each(|name| gear("start.gear", name))?;
        let listed = raw.shift.iter().flat_map(|shifts| shifts.get_ref());
        listed.map(|shift| &shift.gear).try_for_each(|name| gear("shift.gear", name))?;
        raw.fault.iter().try_for_each(|fault| fault.check_elements(&check, &car.gearbox))
    }

    /// Checks the text of a drive file.
    ///
    /// # Errors
    /// What is wrong, with its line and a hint.
    pub fn from_source(source: Source) -> Result<Self, ConfigError> {
        let raw: RawDrive = source.parse_as(Kind::Drive)?;
        let check = Check::of(&source);
        let (segments, trace) = match (&raw.segment, &raw.trace) {
            (Some(segments), None) => (check_segments(&check, segments)?, None),
            (None, Some(trace)) => (Vec::new(), Some(read_trace(&check, &source, trace)?)),
            (both, _) => {
                let at = both.as_ref().map_or(0, |segments| segments.span().start);
                let message = "expected either [[segment]] or [trace]".to_owned();
                let hint = "[trace] names a file of speeds; [[segment]] gives throttle and brake".to_owned();
                return Err(check.meaning("segment", at, message, Some(hint)));
            }
        };
        let repetitions = match &raw.repetitions {
            Some(count) => check.count("repetitions", count, 1.0..=MAX_REPETITIONS)? as u32,
            None => 1,
        };
        let shifts = plan(&check, &raw)?;
        let optional = |key: &str, value: &Option<Number>, range, default| match value {
            Some(value) => check.number(key, value, range),
            None => Ok(default),
        };
        let speeds = trace.as_ref().map(|(path, _)| PathBuf::clone(path));
        let vehicle = raw.vehicle.as_ref().map(|vehicle| PathBuf::from(vehicle.get_ref()));
        let drive = Drive {
            name: check.file_name("name", &raw.name)?,
            sample_time_s: optional("sample_time_s", &raw.sample_time_s, 1e-4..=10.0, 0.01)?,
            start_m_s: optional("start.vehicle_m_s", &raw.start.vehicle_m_s, 0.0..=100.0, 0.0)?,
            start_gear: raw.start.gear.map(Spanned::into_inner),
            sensors: raw.sensors.as_ref().map(|raw| sensors(&check, "sensors", raw, None)).transpose()?,
            segments,
            trace: trace.map(|(_, trace)| trace),
            repetitions,
            shifts,
            controller: raw.controller.into(),
            faults: raw.fault.iter().map(|raw| raw.checked(&check)).collect::<Result<_, _>>()?,
        };
        Ok(Self { drive, vehicle, speeds, source })
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct RawDrive {
    name: Word,
    vehicle: Option<Word>,
    sample_time_s: Option<Number>,
    repetitions: Option<Number>,
    #[serde(default)]
    start: RawStart,
    #[serde(default)]
    controller: RawController,
    schedule: Option<RawSchedule>,
    shift: Option<Spanned<Vec<RawShift>>>,
    segment: Option<Spanned<Vec<RawSegment>>>,
    trace: Option<RawTrace>,
    #[serde(default)]
    fault: Vec<RawFault>,
    sensors: Option<Spanned<RawSensors>>,
}

#[derive(Deserialize, Clone, Copy, Default)]
#[serde(rename_all = "lowercase")]
enum RawController {
    #[default]
    Bench,
    Comfort,
}

impl From<RawController> for ControllerCalibration {
    fn from(raw: RawController) -> Self {
        match raw {
            RawController::Bench => Self::Bench,
            RawController::Comfort => Self::Comfort,
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct RawTrace {
    file: Word,
    grade_rad: Option<Number>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct RawStart {
    gear: Option<Word>,
    vehicle_m_s: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct RawSchedule {
    throttle: Numbers,
    up_input_rad_s: Numbers,
    down_input_rad_s: Numbers,
    time_in_gear_s: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct RawShift {
    time_s: Number,
    gear: Word,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a table")]
struct RawSegment {
    duration_s: Number,
    throttle: Spanned<FromTo>,
    brake: Option<Spanned<FromTo>>,
    grade_rad: Option<Spanned<FromTo>>,
}

/// One number, or the number at the start and that at the end.
#[derive(Deserialize)]
#[serde(untagged, expecting = "invalid type, expected a number or [from, to]")]
enum FromTo {
    Constant(f64),
    Ramp([f64; 2]),
}

fn check_segments(check: &Check<'_>, raw: &Spanned<Vec<RawSegment>>) -> Result<Vec<DriveSegment>, ConfigError> {
    if raw.get_ref().is_empty() {
        return Err(check.meaning(
            "segment",
            raw.span().start,
            "the drive has no segment".to_owned(),
            Some("add a table [[segment]] with duration_s and throttle".to_owned()),
        ));
    }
    raw.get_ref().iter().map(|segment| check_segment(check, segment)).collect()
}

fn read_trace(check: &Check<'_>, source: &Source, raw: &RawTrace) -> Result<(PathBuf, SpeedTrace), ConfigError> {
    let folder = source.path.parent().unwrap_or(Path::new(""));
    let grade_rad = match &raw.grade_rad {
        Some(grade) => check.number("trace.grade_rad", grade, -0.4..=0.4)?,
        None => 0.0,
    };
    let file = Source::read_list(&folder.join(raw.file.get_ref()));
    let file = file.map_err(|error| error.named_by(source, "trace.file", raw.file.span().start))?;
    let trace = speed_trace::of_source(&file, grade_rad)?;
    Ok((file.path, trace))
}

fn check_segment(check: &Check<'_>, raw: &RawSegment) -> Result<DriveSegment, ConfigError> {
    let ends = |name: &str, value: &Spanned<FromTo>, range: std::ops::RangeInclusive<f64>| {
        let ends = match *value.get_ref() {
            FromTo::Constant(value) => [value; 2],
            FromTo::Ramp(ends) => ends,
        };
        for end in ends {
            check.number(format_args!("segment.{name}"), &Spanned::new(value.span(), end), range.clone())?;
        }
        Ok(ends)
    };
    Ok(DriveSegment {
        duration_s: check.number("segment.duration_s", &raw.duration_s, 0.01..=1e6)?,
        throttle: ends("throttle", &raw.throttle, 0.0..=1.0)?,
        brake: raw.brake.as_ref().map_or(Ok([0.0; 2]), |brake| ends("brake", brake, 0.0..=1.0))?,
        grade_rad: raw.grade_rad.as_ref().map_or(Ok([0.0; 2]), |grade| ends("grade_rad", grade, -0.4..=0.4))?,
    })
}

fn plan(check: &Check<'_>, raw: &RawDrive) -> Result<ShiftPlan, ConfigError> {
    if let Some(shifts) = &raw.shift {
        if raw.schedule.is_some() {
            let message = "the drive has both [schedule] and [[shift]]".to_owned();
            let hint = "leave one of them out".to_owned();
            return Err(check.meaning("shift", shifts.span().start, message, Some(hint)));
        }
        let mut listed: Vec<(f64, String)> = Vec::new();
        for shift in shifts.get_ref() {
            let time_s = check.number("shift.time_s", &shift.time_s, 0.0..=1e9)?;
            if listed.last().is_some_and(|&(before, _)| time_s <= before) {
                let message = format!("is {time_s}, not after the shift before it");
                let hint = Some("list the shifts in the order of their times".to_owned());
                return Err(check.meaning("shift.time_s", shift.time_s.span().start, message, hint));
            }
            listed.push((time_s, shift.gear.get_ref().clone()));
        }
        return Ok(ShiftPlan::Listed(listed));
    }
    let Some(schedule) = &raw.schedule else {
        let [throttle, up, down] = SCHEDULE;
        let table = |values: &[f64]| {
            Table1::new(&throttle, values).map_err(|error| check.meaning("schedule", 0, error.to_string(), None))
        };
        let time_in_gear_s = MIN_TIME_IN_GEAR_S;
        let schedule = ShiftSchedule { up_rad_s: table(&up)?, down_rad_s: table(&down)?, time_in_gear_s };
        return Ok(ShiftPlan::Schedule(Box::new(schedule)));
    };
    let axis = || ("schedule.throttle", &schedule.throttle, 0.0..=1.0);
    let up = ("schedule.up_input_rad_s", &schedule.up_input_rad_s, 20.0..=1e3);
    let down = ("schedule.down_input_rad_s", &schedule.down_input_rad_s, 0.0..=1e3);
    let (up_rad_s, down_rad_s) = (check.table(axis(), up)?, check.table(axis(), down)?);
    let crossed = up_rad_s.values().iter().zip(down_rad_s.values()).any(|(up, down)| up <= down);
    if crossed {
        let message = "is not below `up_input_rad_s` everywhere".to_owned();
        let at = schedule.down_input_rad_s.span().start;
        let hint = Some(
            "at each throttle the downshift comes at a lower speed of the gearbox input than the upshift".to_owned(),
        );
        return Err(check.meaning("schedule.down_input_rad_s", at, message, hint));
    }
    let time_in_gear_s = match &schedule.time_in_gear_s {
        Some(time) => check.number("schedule.time_in_gear_s", time, 0.0..=100.0)?,
        None => MIN_TIME_IN_GEAR_S,
    };
    Ok(ShiftPlan::Schedule(Box::new(ShiftSchedule { up_rad_s, down_rad_s, time_in_gear_s })))
}
