//! The numbers of a car that its defaults are scaled to.

use toml::Spanned;
use toml::de::DeValue;

use super::super::raw::RawVehicleFile;
use super::super::{FINAL_RATIOS, MASSES_KG, WHEEL_RADII_M};
use super::complete::{find, number_of};
use crate::check::{Check, Numbers};
use crate::{ConfigError, Source};

/// What is known of a car without a measurement.
#[derive(Debug, Clone, PartialEq)]
pub struct Facts {
    /// Its name.
    pub name: String,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Rolling radius of the driven wheels, m.
    pub wheel_radius_m: f64,
    /// Ratio of the gear before the shift.
    pub ratio_before: f64,
    /// Ratio of the gear after the shift.
    pub ratio_after: f64,
    /// Ratio of the differential, with any ratio between it and the gearbox output.
    pub final_ratio: f64,
    /// Maximum engine torque, N m.
    pub engine_torque_n_m: f64,
    /// The kind of the valves.
    pub valve: ValveKind,
}

/// The kinds of valves that there are defaults for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ValveKind {
    /// The pressure follows a current.
    #[default]
    Proportional,
    /// The pressure follows a duty cycle.
    PulseWidth,
}

/// Maximum torque of an engine, N m.
pub const ENGINE_TORQUES_N_M: std::ops::RangeInclusive<f64> = 20.0..=2000.0;
/// Ratios of gears.
const RATIOS: std::ops::RangeInclusive<f64> = 0.6..=20.0;
/// A shift changes the ratio by more than this factor.
const MIN_STEP: f64 = 1.02;

/// The built-in vehicle's valve [chosen]; its comments have the reasons.
const PROPORTIONAL: [(&str, &str); 9] = [
    (
        "clutch_valve",
        "lag = { pressure_pa = [0.0, 0.05e6, 0.1e6, 0.2e6, 0.4e6, 0.7e6, 1.0e6], time_constant_s = [0.20, 0.12, 0.08, 0.05, 0.035, 0.025, 0.02] }\n\
         gain = { current_a = [0.0, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0], gain_pa_a = [0.70e6, 0.80e6, 0.88e6, 0.94e6, 1.00e6, 1.05e6, 1.10e6] }\n\
         delay = { current_a = [0.0, 0.2, 0.5, 1.0], delay_s = [0.030, 0.022, 0.012, 0.0] }",
    ),
    ("command_max", "1.2"),
    ("observer_valve", "kind = \"proportional\"\ntime_constant_s = 0.04\ngain_pa_a = 1.0e6"),
    ("uncertainty", ""),
    ("command_error", "current_a = 0.01"),
    ("torque_phase_s", "0.15"),
    ("inertia_phase_s", "0.10"),
    ("compliant_torque_phase_s", "0.10"),
    ("compliant_inertia_phase_s", "0.10"),
];

/// That of `vehicles/two_speed_pwm.toml`.
const PULSE_WIDTH: [(&str, &str); 10] = [
    (
        "clutch_valve",
        "kind = \"pulse-width\"\nflow_sqrt_pa_s = 6000\nline_pressure_pa = 1.0e6\n\
         delay = { duty_percent = [0.0, 100.0], delay_s = [0.016, 0.016] }",
    ),
    ("command_max", "100"),
    ("observer_valve", "kind = \"pulse-width\"\nflow_sqrt_pa_s = 6000\nline_pressure_pa = 1.0e6"),
    ("uncertainty", "pressure_drop_pa = [0, 40e3]\n"),
    ("command_error", "duty_percent = 0.5"),
    ("torque_phase_s", "0.25"),
    ("inertia_phase_s", "0.18"),
    ("compliant_torque_phase_s", "0.17"),
    ("compliant_inertia_phase_s", "0.13"),
    ("valve_hysteresis_pa", "0"),
];

impl ValveKind {
    /// The word for it in a vehicle file.
    pub fn word(self) -> &'static str {
        match self {
            Self::Proportional => "proportional",
            Self::PulseWidth => "pulse-width",
        }
    }

    /// What the defaults say of such valves.
    pub(super) fn fields(self) -> &'static [(&'static str, &'static str)] {
        match self {
            Self::Proportional => &PROPORTIONAL,
            Self::PulseWidth => &PULSE_WIDTH,
        }
    }
}

impl Facts {
    /// The numbers of a short file.
    pub(super) fn of_file(source: &Source) -> Result<Self, ConfigError> {
        let check = Check::of(source);
        let table = source.table()?;
        let value = |path: &[&str]| find(table.get_ref(), path);
        let number = |path: &[&str], range| {
            let key = path.join(".");
            let missing = || {
                let hint = "a file with `gear_train.ratios` needs it: its defaults are scaled to it".to_owned();
                check.meaning(&key, 0, "is missing".to_owned(), Some(hint))
            };
            let (at, value) = located(table.get_ref(), path).ok_or_else(missing)?;
            let value = number_of(value).ok_or_else(|| {
                check.meaning(
                    &key,
                    at,
                    "is not a number".to_owned(),
                    Some("write a number without quotes, such as 1650.0".to_owned()),
                )
            })?;
            check.number(&key, &Spanned::new(at..at, value), range)
        };
        let (ratio_before, ratio_after) = ratios(&check, located(table.get_ref(), &["gear_train", "ratios"]))?;
        let is_pulse_width =
            [&["clutch", "a", "valve", "kind"][..], &["clutch", "b", "valve", "kind"], &["observer", "valve", "kind"]]
                .into_iter()
                .any(|path| matches!(value(path), Some(DeValue::String(kind)) if kind == ValveKind::PulseWidth.word()));
        Ok(Self {
            name: match value(&["name"]) {
                Some(DeValue::String(name)) => name.to_string(),
                _ => String::new(),
            },
            mass_kg: number(&["vehicle", "mass_kg"], MASSES_KG)?,
            wheel_radius_m: number(&["vehicle", "wheel_radius_m"], WHEEL_RADII_M)?,
            ratio_before,
            ratio_after,
            final_ratio: number(&["driveline", "final_ratio"], FINAL_RATIOS)?,
            engine_torque_n_m: number(&["engine", "max_torque_n_m"], ENGINE_TORQUES_N_M)?,
            valve: if is_pulse_width { ValveKind::PulseWidth } else { ValveKind::Proportional },
        })
    }

    /// An error of the ratios.
    pub(super) fn wrong_ratios(&self, message: String) -> ConfigError {
        let source = Source::built_in("the vehicle file", "");
        Check::of(&source).meaning("gear_train.ratios", 0, message, Some(train_hint()))
    }
}

fn train_hint() -> String {
    "near 1 only direct drive, 1, has a gear train: give 1, or a ratio below 0.96 or above 1.04".to_owned()
}

/// A value with its place.
pub(super) fn located<'t, 'd>(table: &'t toml::de::DeTable<'d>, path: &[&str]) -> Option<(usize, &'t DeValue<'d>)> {
    let (last, above) = path.split_last()?;
    let table = match find(table, above) {
        Some(DeValue::Table(table)) => table,
        _ => return None,
    };
    table.get(*last).map(|value| (value.span().start, value.get_ref()))
}

fn ratios(check: &Check<'_>, value: Option<(usize, &DeValue<'_>)>) -> Result<(f64, f64), ConfigError> {
    let key = "gear_train.ratios";
    let (at, value) = value.unwrap_or((0, &DeValue::Boolean(false)));
    let list = match value {
        DeValue::Array(list) => list.iter().map(|item| number_of(item.get_ref())).collect::<Option<Vec<f64>>>(),
        _ => None,
    };
    let list: Numbers = Spanned::new(at..at, list.unwrap_or_default());
    check.numbers(key, &list, RATIOS)?;
    match **list.get_ref() {
        [before, after] if before > MIN_STEP * after => Ok((before, after)),
        [before, after] => {
            let message = format!("the ratio before the shift is {before} and after it {after}, which is no upshift");
            let hint = "the ratio is turbine over output speed, such as 4.17 in 1st gear and 2.34 in 2nd".to_owned();
            Err(check.meaning(key, at, message, Some(hint)))
        }
        _ => {
            let hint = Some("the ratios of the gears before and after the upshift, such as [4.17, 2.34]".to_owned());
            Err(check.meaning(key, at, "expected [before, after]".to_owned(), hint))
        }
    }
}

/// Refuses the keys of short files in a file that is not short.
pub(in super::super) fn refuse_facts(check: &Check<'_>, raw: &RawVehicleFile) -> Result<(), ConfigError> {
    match &raw.engine.max_torque_n_m {
        Some(value) if raw.gear_train.ratios.is_none() => {
            let message = "scales the defaults of a file with `gear_train.ratios`, which this file is not".to_owned();
            let hint = Some("remove it, or give `gear_train.ratios` instead of the gear train".to_owned());
            Err(check.meaning("engine.max_torque_n_m", value.span().start, message, hint))
        }
        _ => Ok(()),
    }
}
