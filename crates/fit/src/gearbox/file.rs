//! The vehicle file of a fit: the text of the given one with other values.

use std::path::Path;

use car::Car;
use drivetrain::{ClutchValve, Real, Table1};
use trace::toml_string;

use super::fitting::GearboxFit;
use super::quantities::{DELAY_UNIT_S, KISS_UNIT_PA, Quantity};
use super::validation::HeldOut;
use crate::driving::DRAG_UNIT_N_M;
use crate::fitted_file::fill_comment;
use crate::moved::moved;
use crate::vehicle_text::{FITTED, Step, VehicleText, headed, keys, number};
use crate::verdict::SIDES;
use crate::{FitError, Verdict};

/// A clutch that sticks holds at least so much more than it carries as it begins to slip, as a factor.
const STATIC_OVER_SLIDING: f64 = 1.0001;

/// The vehicle file that is given.
#[derive(Debug, Clone, Copy)]
pub struct GivenFile<'a> {
    /// Where it stands.
    pub path: &'a Path,
    /// Its text.
    pub text: &'a str,
    /// Where the gearbox file that it names stands.
    pub gearbox: &'a Path,
}

impl GearboxFit {
    /// The text of the vehicle file with the fitted values, as it is to stand at `path`. Elements and pairs of gears without a fitted
    /// shift stay as they are. What is not identified singly changes too: its ratio to the others may be identified. Every value that changes has a
    /// comment with its interval. An inertia that the logs do not tell and draw far off stays too. `logs` are named at the head of the
    /// file. Where shifts were held out, `checked` says how far the filter of `estimate` may trust the valves.
    ///
    /// # Errors
    /// The file has a value at another place than the program writes them, or names no gearbox file.
    pub fn vehicle_text(
        &self,
        car: &Car,
        file: GivenFile<'_>,
        path: &Path,
        logs: &str,
        checked: Option<&HeldOut>,
    ) -> Result<String, FitError> {
        let mut text = Written::new(file.text)?;
        self.write_converter(&mut text, car)?;
        self.write_drag(&mut text, car)?;
        self.write_vehicle(&mut text, car)?;
        for (place, name) in self.quantities.elements.iter().enumerate() {
            let element = car.gearbox.elements.iter().position(|element| element.name == *name);
            if let Some(element) = element.filter(|_| self.elements_seen[place]) {
                self.write_element(&mut text, car, element, place)?;
            }
        }
        for (at, pair) in self.quantities.pairs.iter().enumerate() {
            let shift = car.gearbox.shift(pair[0], pair[1]).or_else(|| car.gearbox.shift(pair[1], pair[0]));
            let Some(reduced) = shift.and_then(|shift| shift.reduced.as_ref()) else { continue };
            if self.is_seen(Quantity::Inertia(at)) && !self.drawn_off.iter().any(|(pair, _)| *pair == at) {
                let on_input_kg_m2 = if car.converter.is_some() { 0.0 } else { car.engine.inertia_kg_m2 };
                let all_kg_m2 = reduced.mass_kg_m2[0][0] + on_input_kg_m2;
                let value = all_kg_m2 * Real::exp(self.unknown(Quantity::Inertia(at))) - on_input_kg_m2;
                let comment = self.comment(Quantity::Inertia(at));
                text.put(&["turbine_inertia_kg_m2"], &self.quantities.pair_names[at], &number(value), &comment)?;
            }
        }
        self.write_budget(&mut text, car, checked)?;
        let logs = logs.replace(char::is_control, " ");
        text.at(file, path)?;
        Ok(headed(
            &format!("values below lines like this one come from {} shifts of {logs}", self.shifts),
            &text.finish(),
        ))
    }

    fn write_converter(&self, text: &mut Written, car: &Car) -> Result<(), FitError> {
        let Some(converter) = &car.converter else { return Ok(()) };
        let capacity = converter.capacity_n_m_s2.scaled(Real::exp(self.unknown(Quantity::Input)));
        let ratio = Real::exp(self.unknown(Quantity::TorqueRatio));
        let ratios: Vec<f64> = converter.torque_ratio.values().iter().map(|t| 1.0 + ratio * (t - 1.0)).collect();
        text.put(&["converter"], "capacity_n_m_s2", &list(capacity.values()), &self.comment(Quantity::Input))?;
        text.put(&["converter"], "torque_ratio", &list(&ratios), &self.comment(Quantity::TorqueRatio))
    }

    /// The drag of the elements of which the logs tell it.
    fn write_drag(&self, text: &mut Written, car: &Car) -> Result<(), FitError> {
        for (place, name) in self.quantities.elements.iter().enumerate() {
            let element = car.gearbox.elements.iter().position(|element| element.name == *name);
            let known = element.and_then(|at| car.clutches[at].as_ref());
            let drag = Quantity::Drag(place);
            if let (Some(known), true) = (known, self.is_identifiable(drag)) {
                let value = (known.drag_n_m + DRAG_UNIT_N_M * self.unknown(drag)).max(0.0);
                text.put(&["clutch", name], "drag_n_m", &number(value), &self.comment(drag))?;
            }
        }
        Ok(())
    }

    /// Mass, road load and engine, where driving between shifts tells them: no ratio between torques in shifts depends on them.
    fn write_vehicle(&self, text: &mut Written, car: &Car) -> Result<(), FitError> {
        let values = [
            (Quantity::Mass, "vehicle", "mass_kg", car.road.mass_kg),
            (Quantity::Rolling, "vehicle", "rolling_moment_n_m", car.road.rolling_moment_n_m),
            (Quantity::Air, "vehicle", "drag_coefficient", car.road.drag_coefficient),
            (Quantity::EngineInertia, "engine", "inertia_kg_m2", car.engine.inertia_kg_m2),
        ];
        for (quantity, table, key, given) in values {
            if self.is_identifiable(quantity) {
                let value = number(given * Real::exp(self.unknown(quantity)));
                text.put(&[table], key, &value, &self.comment(quantity))?;
            }
        }
        if let Some(backlash) = self.backlash.as_ref().ok().filter(|backlash| backlash.is_identifiable()) {
            text.put(&["driveline"], "backlash_rad", &number(backlash.rad), &backlash.comment())?;
        }
        if let Some(wheel) = self.wheel.as_ref().ok().filter(|wheel| wheel.tells_stiffness()) {
            let value = number(car.driveline.shaft_stiffness_n_m_rad * wheel.stiffness_factor());
            let comment = factor_comment(wheel.stiffness_factor(), wheel.stiffness.sd, wheel.stiffness.verdict());
            text.put(&["driveline"], "shaft_stiffness_n_m_rad", &value, &comment)?;
        }
        Ok(())
    }

    /// Whether the logs say something of a quantity.
    pub(super) fn is_identifiable(&self, quantity: Quantity) -> bool {
        self.verdict(quantity) != Verdict::NotIdentifiable
    }

    fn write_element(&self, text: &mut Written, car: &Car, element: usize, place: usize) -> Result<(), FitError> {
        let Some(Some(known)) = car.clutches.get(element) else { return Ok(()) };
        let name = car.gearbox.elements[element].name.as_str();
        let table = ["clutch", name];
        let factor = self.friction_factor(place);
        let friction = known.clutch.friction.scaled(factor);
        let comment = match self.quantities.measured[place] {
            true => factor_comment(factor, self.friction_sd(place), self.friction_verdict(place)),
            false => self.comment(Quantity::Torque(place)),
        };
        text.put_map(&table, "friction", ["slip_rad_s", "coefficient"], &friction, &comment)?;
        let held = (factor * known.clutch.static_friction).max(STATIC_OVER_SLIDING * friction.at(0.0));
        let comment = "keeps its ratio to the fitted friction, and is not below it";
        text.put(&table, "static_friction", &number(held), comment)?;
        let kiss_pa = known.clutch.kiss_pressure() + KISS_UNIT_PA * self.unknown(Quantity::Kiss(place));
        let spring_n = (kiss_pa * self.gain_factor(place) * known.clutch.piston_area_m2).max(0.0);
        text.put(&table, "return_spring_n", &number(spring_n), &self.comment(Quantity::Kiss(place)))?;
        self.write_fill(text, name, known, place, spring_n)?;
        self.write_valve(text, name, known, place)
    }

    /// How the cylinder of an element fills, as a table of its own: one has nothing of the common one.
    fn write_fill(
        &self,
        text: &mut Written,
        name: &str,
        known: &car::ShiftClutch,
        place: usize,
        spring_n: f64,
    ) -> Result<(), FitError> {
        let (cylinder, Some(fill)) = (&known.cylinder, self.fills[place]) else { return Ok(()) };
        let factor = fill.factor();
        let preload_n = cylinder.preload_pa / cylinder.kiss_pa.max(f64::MIN_POSITIVE) * spring_n;
        let same = "as in the given file";
        let values = [
            ("stroke_m", factor * cylinder.stroke_m3 / known.clutch.piston_area_m2, fill_comment(&fill)),
            ("preload_n", preload_n.min(spring_n), "keeps its ratio to the fitted return spring".to_owned()),
            ("home_capacity_m3_pa", cylinder.home_capacity_m3_pa, same.to_owned()),
            ("capacity_m3_pa", cylinder.capacity_m3_pa, same.to_owned()),
            ("laminar_pa_s2_m5", cylinder.supply.laminar_pa_s2_m5, same.to_owned()),
            ("orifice_pa_s2_m6", cylinder.supply.orifice_pa_s2_m6, same.to_owned()),
            ("exhaust_factor", cylinder.exhaust.laminar_pa_s2_m5 / cylinder.supply.laminar_pa_s2_m5, same.to_owned()),
            ("flow_max_m3_s", cylinder.flow_max_m3_s, same.to_owned()),
            ("leak_m3_s_pa", cylinder.leak_m3_s_pa, same.to_owned()),
        ];
        let table = ["clutch", name, "fill"];
        values.iter().try_for_each(|(key, value, comment)| text.put(&table, key, &number(*value), comment))
    }

    /// The valve of an element as a table of its own.
    fn write_valve(
        &self,
        text: &mut Written,
        name: &str,
        known: &car::ShiftClutch,
        place: usize,
    ) -> Result<(), FitError> {
        let valve = known.valve.changed(Real::exp(self.unknown(Quantity::Lag(place))), self.gain_factor(place), None);
        let late_s = DELAY_UNIT_S * self.unknown(Quantity::Delay(place));
        let later = |delay: &Table1<f64>| {
            let values: Vec<f64> = delay.values().iter().map(|delay_s| (delay_s + late_s).max(0.0)).collect();
            Table1::new(delay.axis(), &values).unwrap_or(*delay)
        };
        let (lag, delay) = (self.comment(Quantity::Lag(place)), self.comment(Quantity::Delay(place)));
        let table = ["clutch", name, "valve"];
        // A valve of its own has nothing of the common one.
        let same = "as in the given file";
        let gain = self.comment(Quantity::Gain(place));
        let gain = if self.quantities.measured[place] { gain.as_str() } else { same };
        match &valve {
            ClutchValve::Proportional(maps) | ClutchValve::NormallyHigh { maps, .. } => {
                text.put_map(&table, "lag", ["pressure_pa", "time_constant_s"], &maps.time_constant_s, &lag)?;
                text.put_map(&table, "gain", ["current_a", "gain_pa_a"], &maps.gain_pa_a, gain)?;
                text.put_map(&table, "delay", ["current_a", "delay_s"], &later(&maps.delay_s), &delay)?;
                if let ClutchValve::NormallyHigh { zero_pressure_a, .. } = &valve {
                    text.put(&table, "zero_pressure_a", &number(*zero_pressure_a), same)?;
                }
            }
            ClutchValve::PulseWidth { law, delay_s } => {
                text.put(&table, "kind", "\"pulse-width\"", same)?;
                text.put(&table, "flow_sqrt_pa_s", &number(law.flow_sqrt_pa_s), &lag)?;
                text.put(&table, "line_pressure_pa", &number(law.line_pressure_pa), gain)?;
                text.put_map(&table, "delay", ["duty_percent", "delay_s"], &later(delay_s), &delay)?;
            }
        }
        if known.hysteresis_pa > 0.0 {
            text.put(&table, "hysteresis_pa", &number(known.hysteresis_pa), same)?;
        }
        Ok(())
    }

    /// What a fitted value says of itself.
    pub(crate) fn comment(&self, quantity: Quantity) -> String {
        let (value, half) = (self.unknown(quantity), SIDES * self.sd(quantity));
        let verdict = self.verdict(quantity).name();
        match quantity {
            Quantity::Delay(_) | Quantity::InputDelay | Quantity::EngineDelay | Quantity::ReportedDelay => {
                let ms = 1e3 * DELAY_UNIT_S;
                format!("delays {:+.1} ms, 95 % within {:.1} ms, {verdict}", ms * value, ms * half)
            }
            Quantity::Kiss(_) => {
                let kpa = 1e-3 * KISS_UNIT_PA;
                format!(
                    "kiss point {:+.1} kPa, 95 % within {:.1} kPa, {verdict}; of pressures that are as in the valve's maps",
                    kpa * value,
                    kpa * half
                )
            }
            Quantity::Drag(_) => {
                let n_m = DRAG_UNIT_N_M;
                format!("drag {:+.2} N m, 95 % within {:.2} N m, {verdict}", n_m * value, n_m * half)
            }
            _ => {
                let more = match quantity {
                    Quantity::Torque(_) => {
                        "; friction and valve gain act as one factor, which is written here as friction"
                    }
                    Quantity::Rolling => "; a mean grade of the drive acts like it",
                    _ => "",
                };
                factor_comment(Real::exp(value), self.sd(quantity), self.verdict(quantity)) + more
            }
        }
    }
}

/// The text of a given vehicle file, as it is to stand at `path`, with the reason why its values are kept in a line at its head.
///
/// # Errors
/// The file names no gearbox file.
pub fn kept_text(file: GivenFile<'_>, path: &Path, reason: &str) -> Result<String, FitError> {
    let mut text = Written::new(file.text)?;
    text.at(file, path)?;
    Ok(crate::kept_text(&text.finish(), reason))
}

/// What a fitted factor says of itself.
fn factor_comment(factor: f64, sd: f64, verdict: Verdict) -> String {
    let [minimum, maximum] = [-SIDES * sd, SIDES * sd].map(|half| factor * Real::exp(half));
    format!("x {factor:.3}, 95 % {minimum:.3} to {maximum:.3}, {}", verdict.name())
}

/// The text of a vehicle file on its way to another: values that it has are replaced, others are added.
pub(super) struct Written {
    text: VehicleText,
    /// Tables that the file does not have, with their lines.
    added: Vec<(String, Vec<String>)>,
}

impl Written {
    fn new(text: &str) -> Result<Self, FitError> {
        Ok(Self { text: VehicleText::new(text)?, added: Vec::new() })
    }

    /// Puts a value in TOML into a table.
    pub(super) fn put(&mut self, table: &[&str], key: &str, value: &str, comment: &str) -> Result<(), FitError> {
        let path = keys(&[table, &[key]].concat());
        if self.text.has(&path) {
            return self.text.set_text(&path, value, comment);
        }
        let lines = format!("{FITTED}{comment}; the file had none\n{} = {value}\n", bare_or_quoted(key));
        if self.text.add_to_table(&keys(table), &lines)? {
            return Ok(());
        }
        let name = table.iter().map(|key| bare_or_quoted(key)).collect::<Vec<_>>().join(".");
        match self.added.iter_mut().find(|(other, _)| *other == name) {
            Some((_, all)) => all.push(lines),
            None => self.added.push((name, vec![lines])),
        }
        Ok(())
    }

    /// The same with a map of two lists.
    fn put_map(
        &mut self,
        table: &[&str],
        key: &str,
        [axis, values]: [&str; 2],
        map: &Table1<f64>,
        comment: &str,
    ) -> Result<(), FitError> {
        let path = |last: &str| keys(&[table, &[key, last]].concat());
        if self.text.has(&path(values)) && self.text.has(&path(axis)) {
            self.text.set_text(&path(values), &list(map.values()), comment)?;
            return Ok(());
        }
        let inline = format!("{{ {axis} = {}, {values} = {} }}", list(map.axis()), list(map.values()));
        self.put(table, key, &inline, comment)
    }

    /// Keeps the gearbox file where it is when the vehicle file `from` moves to another folder.
    fn at(&mut self, from: GivenFile<'_>, to: &Path) -> Result<(), FitError> {
        let Some(moved) = moved(from.gearbox, from.path, to) else { return Ok(()) };
        self.text.set_text(&[Step::Key("gearbox".to_owned())], &moved, "a path from the folder of this file")
    }

    fn finish(self) -> String {
        let mut text = self.text.finish();
        for (name, lines) in self.added {
            if !text.ends_with('\n') {
                text.push('\n');
            }
            text += &format!("\n[{name}]\n{}", lines.concat());
        }
        text
    }
}

/// A key as it stands in a file.
fn bare_or_quoted(key: &str) -> String {
    let is_bare = !key.is_empty() && key.chars().all(|c| c.is_ascii_alphanumeric() || "_-".contains(c));
    if is_bare { key.to_owned() } else { toml_string(key) }
}

pub(super) fn list(values: &[f64]) -> String {
    format!("[{}]", values.iter().map(|value| number(*value)).collect::<Vec<_>>().join(", "))
}
