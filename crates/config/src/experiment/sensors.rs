//! Checked sensors of an experiment file, and what goes wrong with their readings.

use std::ops::RangeInclusive;
use std::path::Path;

use car::{AccelerationSensor, CurrentSensor, OUTLIER_A, ReadingErrors, Sensors, SpeedSensor};
use toml::Spanned;

use super::raw::{RawAccelerationSensor, RawCurrentSensor, RawSensors, RawSensorsFile, RawSpeedSensor};
use crate::check::{Check, Key, Number};
use crate::{ConfigError, Source};

/// Size of an outlier of a speed, rad/s, if the file does not say [chosen].
const OUTLIER_RAD_S: f64 = 5.0;
/// Longest time between two readings, age and offset of a reading, s.
const LONGEST_S: f64 = 0.2;

/// Reads the `[sensors]` table of any file; `None` without one. The errors of the readings are left out: nobody
/// knows those of a log.
///
/// # Errors
/// The file cannot be read, or a value cannot be right.
pub fn read_sensors(path: &Path) -> Result<Option<Sensors>, ConfigError> {
    sensors_of(&Source::read(path)?)
}

/// The same of the text of a file.
///
/// # Errors
/// A value cannot be right.
pub fn sensors_of(source: &Source) -> Result<Option<Sensors>, ConfigError> {
    Ok(simulated_sensors_of(source)?.map(Sensors::without_errors))
}

/// The same with the errors of the readings, which a simulation makes.
///
/// # Errors
/// A value cannot be right.
pub fn simulated_sensors_of(source: &Source) -> Result<Option<Sensors>, ConfigError> {
    let raw: RawSensorsFile = source.parse()?;
    raw.sensors.as_ref().map(|raw| sensors(&Check::of(source), "sensors", raw, None)).transpose()
}

/// The numbers of one table. What the table leaves out is as in the sensors that it changes.
struct Keys<'a> {
    check: &'a Check<'a>,
    table: String,
    at: usize,
}

impl Keys<'_> {
    /// A number, or `base` without one; without either, the file is incomplete.
    fn number(
        &self,
        key: &str,
        value: &Option<Number>,
        base: Option<f64>,
        range: RangeInclusive<f64>,
    ) -> Result<f64, ConfigError> {
        match (value, base) {
            (Some(value), _) => self.check.number(self.key(key), value, range),
            (None, Some(base)) => Ok(base),
            (None, None) => Err(self.missing(key)),
        }
    }

    /// The same of a whole number.
    fn count(
        &self,
        key: &str,
        value: &Option<Number>,
        base: Option<f64>,
        range: RangeInclusive<f64>,
    ) -> Result<f64, ConfigError> {
        match value {
            Some(value) => self.check.count(self.key(key), value, range),
            None => self.number(key, value, base, range),
        }
    }

    /// The errors of a channel's readings; `missing_share` is that of all channels.
    fn errors(
        &self,
        [scale, missing, burst, frozen, outliers]: [&Option<Number>; 5],
        base: Option<ReadingErrors>,
        missing_share: Option<f64>,
    ) -> Result<ReadingErrors, ConfigError> {
        let base = base.unwrap_or(ReadingErrors::NONE);
        let fraction = missing_share.unwrap_or(base.missing_share);
        Ok(ReadingErrors {
            scale: self.number("scale", scale, Some(base.scale), SCALES)?,
            missing_share: self.number("missing_share", missing, Some(fraction), FRACTIONS)?,
            burst_s: self.number("burst_s", burst, Some(base.burst_s), SPANS_S)?,
            frozen_s: self.number("frozen_s", frozen, Some(base.frozen_s), SPANS_S)?,
            outliers: self.count("outliers", outliers, Some(base.outliers), COUNTS)?,
        })
    }

    fn key<'k>(&'k self, name: &'k str) -> Key<'k> {
        Key { table: &self.table, name }
    }

    fn missing(&self, key: &str) -> ConfigError {
        self.check.meaning(&self.table, self.at, format!("missing `{key}`"), None)
    }
}

/// The sensors that a table describes, or `base` with what the table changes.
pub(crate) fn sensors(
    check: &Check<'_>,
    table: &str,
    raw: &Spanned<RawSensors>,
    base: Option<&Sensors>,
) -> Result<Sensors, ConfigError> {
    let keys = Keys { check, table: table.to_owned(), at: raw.span().start };
    let raw = raw.get_ref();
    let seed = raw.seed.as_ref().map(|seed| *seed.get_ref()).or(base.map(|base| base.seed));
    let missing_share =
        raw.missing_share.as_ref().map(|fraction| check.number(keys.key("missing_share"), fraction, FRACTIONS));
    let missing_share = missing_share.transpose()?;
    let speed = |name: &str, raw: &Option<Spanned<RawSpeedSensor>>, base: Option<&SpeedSensor>| {
        let mut base = base.copied();
        if let (Some(base), Some(fraction)) = (&mut base, missing_share) {
            base.errors.missing_share = fraction;
        }
        match raw {
            Some(raw) => speed_sensor(check, keys.key(name).to_string(), raw, base, missing_share),
            None => base.ok_or_else(|| keys.missing(name)),
        }
    };
    let mut current = base.and_then(|base| base.current);
    if let (Some(current), Some(fraction)) = (&mut current, missing_share) {
        current.errors.missing_share = fraction;
    }
    if let Some(raw) = &raw.current {
        // What a scenario changes where the file has no sensor, it changes in an exact one.
        let base = current.or(base.map(|_| CurrentSensor::EXACT));
        current = Some(current_sensor(check, keys.key("current").to_string(), raw, base, missing_share)?);
    }
    let mut acceleration = base.and_then(|base| base.acceleration);
    if let (Some(acceleration), Some(fraction)) = (&mut acceleration, missing_share) {
        acceleration.errors.missing_share = fraction;
    }
    if let Some(raw) = &raw.acceleration {
        acceleration =
            Some(acceleration_sensor(check, keys.key("acceleration").to_string(), raw, acceleration, missing_share)?);
    }
    Ok(Sensors {
        seed: seed.ok_or_else(|| keys.missing("seed"))?,
        row_offset_s: keys.number(
            "row_offset_s",
            &raw.row_offset_s,
            Some(base.map_or(0.0, |base| base.row_offset_s)),
            0.0..=LONGEST_S,
        )?,
        outliers: keys.count("outliers", &raw.outliers, Some(base.map_or(0.0, |base| base.outliers)), COUNTS)?,
        engine: speed("engine", &raw.engine, base.map(|base| &base.engine))?,
        turbine: speed("turbine", &raw.turbine, base.map(|base| &base.turbine))?,
        output: speed("output", &raw.output, base.map(|base| &base.output))?,
        wheel: speed("wheel", &raw.wheel, base.map(|base| &base.wheel))?,
        current,
        acceleration,
    })
}

/// The sensors of a file with the changes of a scenario.
pub(super) fn changed(
    check: &Check<'_>,
    raw: &Spanned<RawSensors>,
    of_file: Option<&Sensors>,
) -> Result<Sensors, ConfigError> {
    let table = "scenario.sensors";
    let Some(of_file) = of_file else {
        let message = "changes sensors, but the file has no [sensors] table".to_owned();
        return Err(check.meaning(table, raw.span().start, message, Some("add a [sensors] table".to_owned())));
    };
    if let Some(seed) = &raw.get_ref().seed {
        let message = "every scenario draws from the seed of the [sensors] table".to_owned();
        let key = "scenario.sensors.seed";
        return Err(check.meaning(key, seed.span().start, message, Some("remove `seed`".to_owned())));
    }
    sensors(check, table, raw, Some(of_file))
}

/// Fractions of the readings.
const FRACTIONS: RangeInclusive<f64> = 0.0..=1.0;
/// Numbers of outliers.
const COUNTS: RangeInclusive<f64> = 0.0..=1000.0;
/// Factors on a reading.
const SCALES: RangeInclusive<f64> = 0.5..=2.0;
/// Lengths of a dropout or a frozen signal, s.
const SPANS_S: RangeInclusive<f64> = 0.0..=10.0;

fn speed_sensor(
    check: &Check<'_>,
    table: String,
    raw: &Spanned<RawSpeedSensor>,
    base: Option<SpeedSensor>,
    missing_share: Option<f64>,
) -> Result<SpeedSensor, ConfigError> {
    let keys = Keys { check, table, at: raw.span().start };
    let raw = raw.get_ref();
    let base_of = |value: fn(&SpeedSensor) -> f64| base.as_ref().map(value);
    let or = |value: fn(&SpeedSensor) -> f64, default: f64| Some(base_of(value).unwrap_or(default));
    Ok(SpeedSensor {
        teeth: keys.count("teeth", &raw.teeth, base_of(|s| s.teeth), 1.0..=1000.0)?,
        timer_s: keys.number("timer_s", &raw.timer_s, base_of(|s| s.timer_s), 0.0..=1e-3)?,
        periods: keys.count("periods", &raw.periods, base_of(|s| s.periods), 1.0..=100.0)?,
        sample_time_s: keys.number(
            "sample_time_s",
            &raw.sample_time_s,
            base_of(|s| s.sample_time_s),
            1e-4..=LONGEST_S,
        )?,
        offset_s: keys.number("offset_s", &raw.offset_s, or(|s| s.offset_s, 0.0), 0.0..=LONGEST_S)?,
        delay_s: keys.number("delay_s", &raw.delay_s, base_of(|s| s.delay_s), 0.0..=LONGEST_S)?,
        noise_rad_s: keys.number("noise_rad_s", &raw.noise_rad_s, base_of(|s| s.noise_rad_s), 0.0..=50.0)?,
        errors: keys.errors(
            [&raw.scale, &raw.missing_share, &raw.burst_s, &raw.frozen_s, &raw.outliers],
            base.map(|base| base.errors),
            missing_share,
        )?,
        outlier_rad_s: keys.number(
            "outlier_rad_s",
            &raw.outlier_rad_s,
            or(|s| s.outlier_rad_s, OUTLIER_RAD_S),
            0.0..=1000.0,
        )?,
    })
}

fn current_sensor(
    check: &Check<'_>,
    table: String,
    raw: &Spanned<RawCurrentSensor>,
    base: Option<CurrentSensor>,
    missing_share: Option<f64>,
) -> Result<CurrentSensor, ConfigError> {
    let keys = Keys { check, table, at: raw.span().start };
    let raw = raw.get_ref();
    let base_of = |value: fn(&CurrentSensor) -> f64| base.as_ref().map(value);
    let or = |value: fn(&CurrentSensor) -> f64, default: f64| Some(base_of(value).unwrap_or(default));
    let sample_time_s = match &raw.sample_time_s {
        Some(value) => Some(check.number(keys.key("sample_time_s"), value, 1e-4..=LONGEST_S)?),
        None => base.and_then(|base| base.sample_time_s),
    };
    if let (Some(offset), None) = (&raw.offset_s, sample_time_s) {
        let message = "has no separate clock without a `sample_time_s`".to_owned();
        let hint = "add `sample_time_s`, or remove `offset_s`".to_owned();
        return Err(check.meaning(keys.key("offset_s"), offset.span().start, message, Some(hint)));
    }
    Ok(CurrentSensor {
        noise_a: keys.number("noise_a", &raw.noise_a, base_of(|s| s.noise_a), 0.0..=1.0)?,
        offset_a: keys.number("offset_a", &raw.offset_a, base_of(|s| s.offset_a), -1.0..=1.0)?,
        resolution_a: keys.number("resolution_a", &raw.resolution_a, base_of(|s| s.resolution_a), 0.0..=0.5)?,
        sample_time_s,
        offset_s: keys.number("offset_s", &raw.offset_s, or(|s| s.offset_s, 0.0), 0.0..=LONGEST_S)?,
        delay_s: keys.number("delay_s", &raw.delay_s, or(|s| s.delay_s, 0.0), 0.0..=LONGEST_S)?,
        errors: keys.errors(
            [&raw.scale, &raw.missing_share, &raw.burst_s, &raw.frozen_s, &raw.outliers],
            base.map(|base| base.errors),
            missing_share,
        )?,
        outlier_a: keys.number("outlier_a", &raw.outlier_a, or(|s| s.outlier_a, OUTLIER_A), 0.0..=2.0)?,
    })
}

/// An accelerometer; what neither the table nor `base` says is as of a usual one.
fn acceleration_sensor(
    check: &Check<'_>,
    table: String,
    raw: &Spanned<RawAccelerationSensor>,
    base: Option<AccelerationSensor>,
    missing_share: Option<f64>,
) -> Result<AccelerationSensor, ConfigError> {
    let keys = Keys { check, table, at: raw.span().start };
    let raw = raw.get_ref();
    let usual = base.unwrap_or(AccelerationSensor::USUAL);
    Ok(AccelerationSensor {
        noise_m_s2: keys.number("noise_m_s2", &raw.noise_m_s2, Some(usual.noise_m_s2), 0.0..=5.0)?,
        bias_m_s2: keys.number("bias_m_s2", &raw.bias_m_s2, Some(usual.bias_m_s2), -5.0..=5.0)?,
        resolution_m_s2: keys.number(
            "resolution_m_s2",
            &raw.resolution_m_s2,
            Some(usual.resolution_m_s2),
            0.0..=1.0,
        )?,
        sample_time_s: keys.number("sample_time_s", &raw.sample_time_s, Some(usual.sample_time_s), 1e-4..=LONGEST_S)?,
        offset_s: keys.number("offset_s", &raw.offset_s, Some(usual.offset_s), 0.0..=LONGEST_S)?,
        delay_s: keys.number("delay_s", &raw.delay_s, Some(usual.delay_s), 0.0..=LONGEST_S)?,
        errors: keys.errors(
            [&raw.scale, &raw.missing_share, &raw.burst_s, &raw.frozen_s, &raw.outliers],
            Some(usual.errors),
            missing_share,
        )?,
        outlier_m_s2: keys.number("outlier_m_s2", &raw.outlier_m_s2, Some(usual.outlier_m_s2), 0.0..=100.0)?,
    })
}
