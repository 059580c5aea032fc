//! The valves of a vehicle file: the valves of the clutches, and the valve model of the observers.

use std::ops::RangeInclusive;

use car::{ShiftClutch, Uncertainty, ValveUncertainty};
use drivetrain::{ClutchValve, CommandKind, PulseWidth, Valve, ValveMaps};
use toml::Spanned;

use super::raw::{RawClutchValve, RawErrorBounds, RawUncertainty, RawValve, RawValveKind};
use crate::ConfigError;
use crate::check::{Check, Key, Number, Numbers};

/// Time constants of a proportional valve, s.
const TIME_CONSTANTS_S: RangeInclusive<f64> = 0.001..=2.0;
/// Gains of a proportional valve, Pa/A.
const GAINS_PA_A: RangeInclusive<f64> = 1e4..=20e6;
/// Flow constants of a pulse-width valve, sqrt(Pa)/s: from an empty cylinder to 1 MPa in 20 s to 2 ms.
const FLOWS: RangeInclusive<f64> = 100.0..=1e6;
/// Line pressures, Pa.
const LINE_PRESSURES_PA: RangeInclusive<f64> = 1e5..=10e6;
/// Duty cycles, %.
pub(super) const DUTY_CYCLES: RangeInclusive<f64> = 0.0..=100.0;

/// Refuses keys that belong to another kind of valve than that of their table.
fn refuse_foreign(check: &Check<'_>, table: &str, foreign: &[Option<usize>], hint: &str) -> Result<(), ConfigError> {
    match foreign.iter().flatten().next() {
        None => Ok(()),
        Some(&at) => {
            let message = "has a key of another kind of valve".to_owned();
            Err(check.meaning(table, at, message, Some(hint.to_owned())))
        }
    }
}

fn place<T>(value: &Option<Spanned<T>>) -> Option<usize> {
    value.as_ref().map(|value| value.span().start)
}

/// The valve of a clutch, from a table of the file.
pub(super) fn clutch_valve(
    check: &Check<'_>,
    table: &str,
    spanned: &Spanned<RawClutchValve>,
) -> Result<ClutchValve<f64>, ConfigError> {
    let (at, raw) = (spanned.span().start, spanned.get_ref());
    let key = |name: &'static str| Key { table, name };
    let (delay_at, delay) = (raw.delay.span().start, raw.delay.get_ref());
    let delays = |axis: &str, points: &Option<Numbers>, range| {
        let points = check.required(key("delay"), delay_at, axis, points.as_ref())?;
        check.table(
            (format_args!("{table}.delay.{axis}"), points, range),
            (key("delay.delay_s"), &delay.delay_s, 0.0..=0.5),
        )
    };
    let hint = "proportional: lag, gain, delay over current_a; pulse-width: flow_sqrt_pa_s, line_pressure_pa, delay \
                over duty_percent";
    match raw.kind {
        RawValveKind::Proportional => {
            let foreign = [place(&raw.flow_sqrt_pa_s), place(&raw.line_pressure_pa), place(&delay.duty_percent)];
            refuse_foreign(check, table, &foreign, hint)?;
            let lag = check.required(table, at, "lag", raw.lag.as_ref())?.get_ref();
            let gain = check.required(table, at, "gain", raw.gain.as_ref())?.get_ref();
            let maps = ValveMaps {
                time_constant_s: check.table(
                    (key("lag.pressure_pa"), &lag.pressure_pa, 0.0..=10e6),
                    (key("lag.time_constant_s"), &lag.time_constant_s, TIME_CONSTANTS_S),
                )?,
                gain_pa_a: check.table(
                    (key("gain.current_a"), &gain.current_a, 0.0..=10.0),
                    (key("gain.gain_pa_a"), &gain.gain_pa_a, GAINS_PA_A),
                )?,
                delay_s: delays("current_a", &delay.current_a, 0.0..=10.0)?,
            };
            let Some(zero) = &raw.zero_pressure_a else { return Ok(ClutchValve::Proportional(maps)) };
            let zero_pressure_a = check.number(key("zero_pressure_a"), zero, 0.01..=10.0)?;
            Ok(ClutchValve::NormallyHigh { maps, zero_pressure_a })
        }
        RawValveKind::PulseWidth => {
            let foreign = [place(&raw.lag), place(&raw.gain), place(&delay.current_a), place(&raw.zero_pressure_a)];
            refuse_foreign(check, table, &foreign, hint)?;
            let law = pulse_width(check, table, at, &raw.flow_sqrt_pa_s, &raw.line_pressure_pa)?;
            Ok(ClutchValve::PulseWidth { law, delay_s: delays("duty_percent", &delay.duty_percent, DUTY_CYCLES)? })
        }
    }
}

fn pulse_width(
    check: &Check<'_>,
    table: &str,
    at: usize,
    flow_sqrt_pa_s: &Option<Number>,
    line_pressure_pa: &Option<Number>,
) -> Result<PulseWidth<f64>, ConfigError> {
    let number = |name: &str, value: &Option<Number>, range| {
        check.number(format_args!("{table}.{name}"), check.required(table, at, name, value.as_ref())?, range)
    };
    Ok(PulseWidth {
        flow_sqrt_pa_s: number("flow_sqrt_pa_s", flow_sqrt_pa_s, FLOWS)?,
        line_pressure_pa: number("line_pressure_pa", line_pressure_pa, LINE_PRESSURES_PA)?,
    })
}

/// Refuses a gain map whose settled pressure `K(i) i` falls while the current rises, up to a current that can be
/// commanded: a guaranteed range would turn round, and no current would give a pressure. Between breakpoints the gain
/// is `K0 + s (i - i0)` and the slope of `K(i) i` linear, so that it is least at an end.
pub(super) fn settled_pressure_rises(
    check: &Check<'_>,
    table: &str,
    valve: &ClutchValve<f64>,
    raw: &Spanned<RawClutchValve>,
    max_a: f64,
) -> Result<(), ConfigError> {
    let (Some(maps), Some(raw)) = (valve.maps(), &raw.get_ref().gain) else { return Ok(()) };
    let (currents, gains) = (maps.gain_pa_a.axis(), maps.gain_pa_a.values());
    for (i, k) in currents.windows(2).zip(gains.windows(2)).filter(|(i, _)| i[0] < max_a) {
        let slope = (k[1] - k[0]) / (i[1] - i[0]);
        let end = i[1].min(max_a);
        if k[0] + slope * (2.0 * i[0].max(0.0) - i[0]) >= 0.0 && k[0] + slope * (2.0 * end - i[0]) >= 0.0 {
            continue;
        }
        // K(i) i is largest where its slope is zero.
        let top = (0.5 * (i[0] - k[0] / slope)).clamp(i[0], end);
        let message = format!(
            "the steady-state pressure (gain times current) falls from {:.4} MPa at {top:.3} A to {:.4} MPa at {end:.3} A",
            1e-6 * maps.settled_pressure(top),
            1e-6 * maps.settled_pressure(end),
        );
        let hint = format!(
            "the pressure must increase with the current: between {} A and {} A the gain falls from {} Pa/A to {} Pa/A",
            i[0], i[1], k[0], k[1]
        );
        let key = format!("{table}.gain.gain_pa_a");
        return Err(check.meaning(&key, raw.get_ref().gain_pa_a.span().start, message, Some(hint)));
    }
    Ok(())
}

/// Refuses limits with which the oncoming clutch never carries a torque: usually a wrong unit.
pub(super) fn clutch_can_engage(
    check: &Check<'_>,
    oncoming: &ShiftClutch,
    (command_max, pressure_max_pa): (f64, f64),
    at: usize,
) -> Result<(), ConfigError> {
    let kiss_pa = oncoming.clutch.kiss_pressure();
    let max_pa = oncoming.valve.settled_pressure(command_max);
    if max_pa.min(pressure_max_pa) > kiss_pa {
        return Ok(());
    }
    let (unit, full) = match oncoming.valve.command_kind() {
        CommandKind::Current => ("A", "the largest current of the valve"),
        CommandKind::DutyCycle => ("%", "100 for a duty cycle"),
    };
    let message = format!(
        "at {} {unit} the settled pressure is {:.4} MPa, `pressure_max_pa` is {:.4} MPa, and the kiss point is {:.4} MPa",
        command_max,
        1e-6 * max_pa,
        1e-6 * pressure_max_pa,
        1e-6 * kiss_pa
    );
    Err(check.meaning("observer.command_max", at, message, Some(format!("`command_max` is {full}"))))
}

/// The valve model of the observers. Its kind of command is that of the clutch's valve.
pub(super) fn observer_valve(
    check: &Check<'_>,
    spanned: &Spanned<RawValve>,
    oncoming: &ClutchValve<f64>,
) -> Result<Valve<f64>, ConfigError> {
    let table = "observer.valve";
    let (at, raw) = (spanned.span().start, spanned.get_ref());
    let number = |name: &str, value: &Option<Number>, range| {
        check.number(format_args!("{table}.{name}"), check.required(table, at, name, value.as_ref())?, range)
    };
    let hint = "proportional: time_constant_s, gain_pa_a; pulse-width: flow_sqrt_pa_s, line_pressure_pa";
    let valve = match raw.kind {
        RawValveKind::Proportional => {
            refuse_foreign(check, table, &[place(&raw.flow_sqrt_pa_s), place(&raw.line_pressure_pa)], hint)?;
            Valve::Proportional {
                time_constant_s: number("time_constant_s", &raw.time_constant_s, TIME_CONSTANTS_S)?,
                gain_pa_a: number("gain_pa_a", &raw.gain_pa_a, GAINS_PA_A)?,
            }
        }
        RawValveKind::PulseWidth => {
            refuse_foreign(check, table, &[place(&raw.time_constant_s), place(&raw.gain_pa_a)], hint)?;
            Valve::PulseWidth(pulse_width(check, table, at, &raw.flow_sqrt_pa_s, &raw.line_pressure_pa)?)
        }
    };
    if valve.command_kind() == oncoming.command_kind() {
        return Ok(valve);
    }
    let message = "is of another kind than the valve of the oncoming clutch".to_owned();
    let hint = "give both the same `kind`: the observers use the command of the clutch's valve".to_owned();
    Err(check.meaning(table, at, message, Some(hint)))
}

/// What varies in the observers' model.
pub(super) fn uncertainty(
    check: &Check<'_>,
    spanned: &Spanned<RawUncertainty>,
    kind: CommandKind,
) -> Result<Uncertainty, ConfigError> {
    let table = "observer.uncertainty";
    let (at, raw) = (spanned.span().start, spanned.get_ref());
    let pair = |key: &str, numbers: &Numbers, range| {
        check.pair(format_args!("{table}.{key}"), numbers, range).map(<(f64, f64)>::from)
    };
    let hint = "proportional: time_constant_s; pulse-width: pressure_drop_pa";
    let valve = match kind {
        CommandKind::Current => {
            refuse_foreign(check, table, &[place(&raw.pressure_drop_pa)], hint)?;
            match &raw.time_constant_s {
                None => ValveUncertainty::None,
                Some(range) => ValveUncertainty::TimeConstant(pair("time_constant_s", range, TIME_CONSTANTS_S)?),
            }
        }
        CommandKind::DutyCycle => {
            refuse_foreign(check, table, &[place(&raw.time_constant_s)], hint)?;
            let key = "pressure_drop_pa";
            let drops = check.required(table, at, key, raw.pressure_drop_pa.as_ref())?;
            ValveUncertainty::PressureDrop(pair(key, drops, 0.0..=10e6)?)
        }
    };
    Ok(Uncertainty { friction: pair("friction", &raw.friction, 0.02..=0.5)?, valve })
}

/// Error of a reading of the valve's command, A or %.
pub(super) fn command_error(
    check: &Check<'_>,
    at: usize,
    raw: &RawErrorBounds,
    kind: CommandKind,
) -> Result<f64, ConfigError> {
    let table = "design.error_bounds";
    let hint = "proportional: current_a; pulse-width: duty_percent";
    let (key, value, foreign, range) = match kind {
        CommandKind::Current => ("current_a", &raw.current_a, &raw.duty_percent, 0.0..=1.0),
        CommandKind::DutyCycle => ("duty_percent", &raw.duty_percent, &raw.current_a, DUTY_CYCLES),
    };
    refuse_foreign(check, table, &[place(foreign)], hint)?;
    check.number(format_args!("{table}.{key}"), check.required(table, at, key, value.as_ref())?, range)
}
