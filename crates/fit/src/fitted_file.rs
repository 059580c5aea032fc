//! The vehicle file of a fit: the text of the given one with other values.

use car::Vehicle;
use drivetrain::Real;

use crate::budget::{self, BUDGET_COMMENT, BUDGET_SIDES, CONVERTER_FRACTION_MIN};
use crate::car::Car;
use crate::driving::backlash;
use crate::parameters::HYSTERESIS_UNIT_PA;
use crate::vehicle_text::{FITTED, Step, VehicleText, headed, keys, number, shaft_inertia};
use crate::verdict::SIDES;
use crate::{FillFit, Fit, FitError, Given, Map, Parameter, ReadingAges, Verdict};

impl Fit {
    /// The text of the vehicle file with the fitted values. Every value that changes has a comment on the line above with its interval; the
    /// error budget follows from the intervals; everything else is as in the file. `logs` are named at the head of the file.
    ///
    /// # Errors
    /// The file has a value at another place than the program writes them.
    pub fn vehicle_text(&self, given: &Given, logs: &str) -> Result<String, FitError> {
        let Given { vehicle, shafts, text: file } = given;
        let mut text = VehicleText::new(file)?;
        let oncoming = oncoming_name(file)?;
        let fitted = Car::of_file(vehicle, ReadingAges::default()).with(shafts, &self.priors, &self.unknowns);
        for prior in &self.priors {
            self.write(&mut text, &fitted, &oncoming, prior.parameter)?;
        }
        self.write_fill(&mut text, vehicle, &oncoming)?;
        if let Some(backlash) = self.backlash.as_ref().ok().filter(|backlash| backlash.is_identifiable()) {
            text.put(&["driveline"], "backlash_rad", backlash.rad, &backlash.comment())?;
            let max_rad = (backlash.rad + BUDGET_SIDES * backlash.sd_rad).min(backlash::MAX_RAD);
            text.put(&["design", "error_bounds"], "backlash_rad", max_rad, BUDGET_COMMENT)?;
        }
        self.write_budget(&mut text, vehicle)?;
        let logs = logs.replace(char::is_control, " ");
        let head = format!("values below lines like this one come from {} shifts of {logs}", self.shifts);
        Ok(headed(&head, &text.finish()))
    }

    fn write(&self, text: &mut VehicleText, fitted: &Car, clutch: &str, parameter: Parameter) -> Result<(), FitError> {
        let Some(value) = self.value(parameter) else { return Ok(()) };
        let words = self.comment(parameter);
        let comment = Some(words.as_str());
        let times = |text: &mut VehicleText, path: &[&str]| text.map(&keys(path), |number| value * number, comment);
        match parameter {
            Parameter::Capacity => {
                let capacity = &fitted.converter.capacity_n_m_s2;
                text.set(&keys(&["converter", "capacity_n_m_s2"]), capacity.values(), comment)
            }
            Parameter::TorqueRatio => {
                text.map(&keys(&["converter", "torque_ratio"]), |t| 1.0 + value * (t - 1.0), comment)
            }
            Parameter::Friction | Parameter::Spring | Parameter::CommandDelay | Parameter::Hysteresis => {
                write_clutch(text, fitted, clutch, (parameter, value), &words)
            }
            Parameter::Gain | Parameter::Lag => write_valve(text, fitted, clutch, (parameter, value), &words),
            Parameter::Inertia(shaft) => text.map(&shaft_inertia(shaft), |inertia| value * inertia, comment),
            Parameter::Stiffness => times(text, &["driveline", "shaft_stiffness_n_m_rad"]),
            Parameter::Damping => times(text, &["driveline", "shaft_damping_n_m_s_rad"]),
            Parameter::Tyre => times(text, &["tyre", "slip_scale"]),
            Parameter::Mass => times(text, &["vehicle", "mass_kg"]),
            Parameter::Rolling | Parameter::Air if self.verdict(parameter) == Verdict::NotIdentifiable => Ok(()),
            Parameter::Rolling => times(text, &["vehicle", "rolling_moment_n_m"]),
            Parameter::Air => times(text, &["vehicle", "drag_coefficient"]),
            Parameter::EngineInertia => times(text, &["engine", "inertia_kg_m2"]),
            // The shape goes in with the friction. That of the offgoing clutch is fitted only to what is left of its torque when it slips.
            _ => Ok(()),
        }
    }

    /// What a fitted value says of itself.
    fn comment(&self, parameter: Parameter) -> String {
        let (value, sd) = (self.value(parameter).unwrap_or(1.0), self.sd(parameter).unwrap_or(0.0));
        let verdict = self.verdict(parameter).name();
        if parameter.is_delay() {
            let half_ms = 1e3 * SIDES * crate::parameters::DELAY_UNIT_S * sd;
            return format!("{:+.1} ms, 95 % +- {half_ms:.1} ms, {verdict}", 1e3 * value);
        }
        if parameter == Parameter::Hysteresis {
            return format!("95 % +- {:.1} kPa, {verdict}", 1e-3 * SIDES * HYSTERESIS_UNIT_PA * sd);
        }
        let (minimum, maximum) = (value * Real::exp(-SIDES * sd), value * Real::exp(SIDES * sd));
        format!("x {value:.3}, 95 % {minimum:.3} to {maximum:.3}, {verdict}")
    }

    /// The error budget: what the fit leaves open of each parameter.
    fn write_budget(&self, text: &mut VehicleText, vehicle: &Vehicle) -> Result<(), FitError> {
        let bound = |key: &str| keys(&["design", "error_bounds", key]);
        let sd = |parameters: &[Parameter]| {
            parameters.iter().map(|p| Real::powi(self.sd(*p).unwrap_or(0.0), 2)).sum::<f64>().sqrt()
        };
        let half = |parameters: &[Parameter]| BUDGET_SIDES * sd(parameters);
        let factors = |parameters: &[Parameter], given: [f64; 2]| {
            budget::factors(sd(parameters), self.value(parameters[0]).unwrap_or(1.0), given)
        };
        let mut set = |path: Vec<Step>, values: &[f64]| {
            // Keys that the file leaves at their defaults stay there.
            if text.has(&path) { text.set(&path, values, Some(BUDGET_COMMENT)) } else { Ok(()) }
        };
        let given = &vehicle.error_bounds;
        // The finer shape of the converter's maps is not fitted.
        let capacity = self.value(Parameter::Capacity).unwrap_or(1.0);
        let converter = [
            Parameter::Capacity,
            Parameter::TorqueRatio,
            Parameter::Shape(Map::Capacity, 0),
            Parameter::Shape(Map::Capacity, 1),
        ];
        let fraction = budget::fraction(sd(&converter), capacity, given.turbine_torque_share, CONVERTER_FRACTION_MIN);
        set(bound("turbine_torque_share"), &[fraction])?;
        set(
            bound("turbine_torque_n_m"),
            &[given.turbine_torque_n_m * fraction / given.turbine_torque_share.max(fraction)],
        )?;
        use Parameter as P;
        let with_shape = |map: Map, some: &[P]| [some, &map.parameters()].concat();
        let friction = with_shape(Map::Friction, &[P::Friction, P::FrictionAtRest, P::FrictionSlope]);
        set(bound("friction_factor"), &factors(&friction, given.friction_factor))?;
        set(bound("valve_gain_factor"), &factors(&with_shape(Map::Gain, &[P::Gain]), given.valve_gain_factor))?;
        set(bound("valve_lag_factor"), &factors(&with_shape(Map::Lag, &[P::Lag]), given.valve_lag_factor))?;
        set(bound("shaft_stiffness_factor"), &factors(&[Parameter::Stiffness], given.shaft_stiffness_factor))?;
        let mass = self.value(Parameter::Mass).unwrap_or(1.0) * vehicle.road.mass_kg;
        let known_kg = given.mass_kg + (mass - vehicle.road.mass_kg).abs();
        set(bound("mass_kg"), &[(half(&[Parameter::Mass]) * mass).min(known_kg)])?;
        if let Some(hysteresis_pa) = self.value(P::Hysteresis) {
            let max_pa = hysteresis_pa + HYSTERESIS_UNIT_PA * half(&[P::Hysteresis]);
            set(bound("valve_hysteresis_pa"), &[max_pa.min(given.valve_hysteresis_pa.max(hysteresis_pa))])?;
        }
        if let Some(delay_s) = self.value(Parameter::CommandDelay) {
            let half_s = crate::parameters::DELAY_UNIT_S * half(&[Parameter::CommandDelay]);
            let of_file = vehicle.oncoming.valve.delay_range().map(|own_s| (own_s + delay_s).max(0.0));
            set(bound("valve_delay_s"), &budget::delays(of_file, half_s))?;
        }
        self.write_fill_budget(text, vehicle)
    }

    /// Writes the stroke of the oncoming clutch's piston, and the preload of its spring, which moves with the fitted kiss point.
    fn write_fill(&self, text: &mut VehicleText, vehicle: &Vehicle, clutch: &str) -> Result<(), FitError> {
        let table = ["clutch", clutch, "fill"];
        let spring = self.value(Parameter::Spring).unwrap_or(1.0);
        let Some(fill) = self.fill.filter(|fill| fill.verdict() != Verdict::NotIdentifiable) else {
            let preload = keys(&["clutch", clutch, "fill", "preload_n"]);
            let words = Some("keeps its ratio to the fitted return spring");
            return if text.has(&preload) { text.map(&preload, |force| spring * force, words) } else { Ok(()) };
        };
        let (cylinder, area_m2) = (&vehicle.oncoming.cylinder, vehicle.oncoming.clutch.piston_area_m2);
        let stroke_m = fill.factor() * cylinder.stroke_m3 / area_m2;
        let preload_pa = spring * self.preload_factor(vehicle) * cylinder.preload_pa;
        let values = [
            ("stroke_m", stroke_m, fill_comment(&fill)),
            ("preload_n", preload_pa * area_m2, "goes with the fitted return spring and fill volume".to_owned()),
        ];
        if text.has(&keys(&table)) {
            return values.iter().try_for_each(|(key, value, words)| text.put(&table, key, *value, words));
        }
        let line = |(key, value, words): &(&str, f64, String)| {
            format!("{FITTED}{words}; the file had none\n{key} = {}\n", number(*value))
        };
        text.add_table(&keys(&table), &values.iter().map(line).collect::<String>());
        Ok(())
    }

    /// Factor on the preload beside the kiss point.
    fn preload_factor(&self, vehicle: &Vehicle) -> f64 {
        /// Most of the force at the kiss point that it may become \[chosen: the limits of the error budget, 10 % to each side, stay below those of
        /// the kiss point\].
        const MAXIMUM: f64 = 0.9;
        let cylinder = &vehicle.oncoming.cylinder;
        let maximum = MAXIMUM * cylinder.kiss_pa / cylinder.preload_pa;
        self.fill.map_or(1.0, |fill| fill.preload_factor()).min(maximum.max(1.0))
    }

    /// The limits of the piston's stroke: pressures move with the spring, the volume has what the fit leaves open of it.
    fn write_fill_budget(&self, text: &mut VehicleText, vehicle: &Vehicle) -> Result<(), FitError> {
        let Some(given) = &vehicle.error_bounds.fill else { return Ok(()) };
        let bound = |key: &str| keys(&["design", "error_bounds", "fill", key]);
        let spring = self.value(Parameter::Spring).unwrap_or(1.0);
        let preload = self.preload_factor(vehicle);
        let [kiss_pa, preload_pa] =
            [given.kiss_pressure_pa, given.preload_pressure_pa].map(|limits| limits.map(|pa| spring * pa));
        // The spring is longer with the piston on its stop than at the kiss point.
        let preload_pa = [0, 1].map(|i| (preload * preload_pa[i]).min(kiss_pa[i]));
        for (key, limits_pa) in [("kiss_pressure_pa", kiss_pa), ("preload_pressure_pa", preload_pa)] {
            if text.has(&bound(key)) {
                text.set(&bound(key), &limits_pa, Some("moves with the fitted return spring"))?;
            }
        }
        if let Some(fill) = self.fill.filter(|fill| fill.verdict() != Verdict::NotIdentifiable) {
            let given = given.volume_m3.map(|volume_m3| volume_m3 / vehicle.oncoming.cylinder.stroke_m3);
            let factors = budget::factors(fill.sd[0], fill.factor(), given);
            if text.has(&bound("volume_factor")) {
                text.set(&bound("volume_factor"), &factors, Some(BUDGET_COMMENT))?;
            }
        }
        Ok(())
    }
}

/// Writes what is of the oncoming clutch itself.
fn write_clutch(
    text: &mut VehicleText,
    fitted: &Car,
    clutch: &str,
    (parameter, value): (Parameter, f64),
    words: &str,
) -> Result<(), FitError> {
    let comment = Some(words);
    let of_clutch = |key: &[&str]| keys(&[&["clutch", clutch], key].concat());
    match parameter {
        Parameter::Friction => {
            let friction = &fitted.clutch.friction;
            set_axis(text, &of_clutch(&["friction", "slip_rad_s"]), friction.axis())?;
            text.set(&of_clutch(&["friction", "coefficient"]), friction.values(), comment)?;
            // A clutch that sticks holds at least what it carries as it begins to slip.
            let at_rest = friction.values().first().copied().unwrap_or(0.0);
            let more = "keeps its ratio to the fitted friction, and is not below it";
            text.map(&of_clutch(&["static_friction"]), |mu| (value * mu).max(1.0001 * at_rest), Some(more))
        }
        Parameter::Spring => text.map(&of_clutch(&["return_spring_n"]), |force| value * force, comment),
        Parameter::CommandDelay => {
            text.map(&of_clutch(&["valve", "delay", "delay_s"]), |delay_s| (delay_s + value).max(0.0), comment)
        }
        _ => {
            let own = of_clutch(&["valve", "hysteresis_pa"]);
            match text.has(&own) {
                true => text.set(&own, &[value], comment),
                false if value == 0.0 => Ok(()),
                false => text.add_beside(&of_clutch(&["valve", "gain"]), "hysteresis_pa", value, words),
            }
        }
    }
}

/// What a fitted fill volume says of itself.
pub(crate) fn fill_comment(fill: &FillFit) -> String {
    let [minimum, value, maximum] = [-SIDES, 0.0, SIDES].map(|sides| Real::exp(fill.log_volume + sides * fill.sd[0]));
    match fill.verdict() {
        Verdict::NotIdentifiable => format!("as in the given file: {}", Verdict::NotIdentifiable.name()),
        verdict => format!(
            "fill volume x {value:.3}, 95 % {minimum:.3} to {maximum:.3}, {}; by the flow of the passages of this file",
            verdict.name()
        ),
    }
}

/// Writes gain or lag of its valve, and of the observer's.
fn write_valve(
    text: &mut VehicleText,
    fitted: &Car,
    clutch: &str,
    (parameter, value): (Parameter, f64),
    words: &str,
) -> Result<(), FitError> {
    let comment = Some(words);
    let of_valve = |key: &[&str]| keys(&[&["clutch", clutch, "valve"], key].concat());
    let of_observer = |key: &str| keys(&["observer", "valve", key]);
    let (map, axis, [table, axis_key, values_key], common) = match (parameter, fitted.hydraulics.valve.maps()) {
        (Parameter::Gain, Some(maps)) => {
            (maps.gain_pa_a.values(), maps.gain_pa_a.axis(), ["gain", "current_a", "gain_pa_a"], "gain_pa_a")
        }
        (_, Some(maps)) => {
            let lag = &maps.time_constant_s;
            (lag.values(), lag.axis(), ["lag", "pressure_pa", "time_constant_s"], "time_constant_s")
        }
        (_, None) => {
            let (key, factor) = match parameter {
                Parameter::Gain => ("line_pressure_pa", value),
                _ => ("flow_sqrt_pa_s", value.recip()),
            };
            text.map(&of_valve(&[key]), |number| factor * number, comment)?;
            return text.map(&of_observer(key), |number| factor * number, comment);
        }
    };
    set_axis(text, &of_valve(&[table, axis_key]), axis)?;
    text.set(&of_valve(&[table, values_key]), map, comment)?;
    text.map(&of_observer(common), |number| value * number, comment)
}

/// Puts in the axis of a map that has more points than in the file; any other stays as it is written.
fn set_axis(text: &mut VehicleText, path: &[Step], axis: &[f64]) -> Result<(), FitError> {
    if text.numbers(path)?.len() == axis.len() { Ok(()) } else { text.set(path, axis, None) }
}

/// Name of the oncoming clutch.
fn oncoming_name(text: &str) -> Result<String, FitError> {
    let table: toml::Table = text.parse().map_err(|error: toml::de::Error| FitError::input(error.to_string()))?;
    let name = table.get("gear_train").and_then(|train| train.get("oncoming")).and_then(toml::Value::as_str);
    name.map(str::to_owned).ok_or_else(|| FitError::input("the vehicle file has no `gear_train.oncoming`"))
}
