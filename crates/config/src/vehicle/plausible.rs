//! Values that a vehicle file may have and cars seldom have: most often a slip of the unit.
//!
//! A range that no car leaves makes a value an error; the usual ranges here are narrower, and relative to the size of the car.

use car::ShiftClutch;
use drivetrain::road::GRAVITY_M_S2;
use drivetrain::{ClutchValve, Converter, Driveline, Engine, RoadLoad, Tyre};

use super::{CarFile, VehicleFile};
use crate::{GearboxFile, Source};

/// What a car is judged by.
struct Parts<'v> {
    engine: &'v Engine<f64>,
    converter: Option<&'v Converter<f64>>,
    driveline: &'v Driveline<f64>,
    tyre: &'v Tyre<f64>,
    road: &'v RoadLoad<f64>,
    /// Largest ratio of the gearbox.
    ratio: f64,
    /// Names and parts of the clutches.
    clutches: Vec<(String, &'v ShiftClutch)>,
    /// Highest pressure in a clutch, Pa.
    pressure_max_pa: f64,
}

/// A number that follows from values of the file, and where it usually is \[chosen\].
struct Judged {
    /// The key that is most likely wrong.
    key: String,
    /// What the number is, with its unit.
    what: &'static str,
    value: f64,
    usual: [f64; 2],
    /// What else it follows from, and what to look at.
    hint: &'static str,
}

impl VehicleFile {
    /// What is unusual about the values, each with its key, the usual range and a hint.
    pub fn implausible(&self) -> Vec<String> {
        let clutches = [("offgoing", &self.offgoing), ("oncoming", &self.oncoming)];
        Parts {
            engine: &self.engine,
            converter: Some(&self.converter),
            driveline: &self.driveline,
            tyre: &self.tyre,
            road: &self.road,
            ratio: self.shift.ratio_offgoing().abs().max(self.shift.ratio_oncoming().abs()),
            clutches: clutches.map(|(name, clutch)| (format!("the {name} clutch"), clutch)).into(),
            pressure_max_pa: self.error_bounds.pressure_max_pa,
        }
        .implausible()
        .into_iter()
        .chain(self.of_pressures().iter().filter_map(Judged::sentence))
        .collect()
    }

    fn of_pressures(&self) -> [Judged; 2] {
        let (valve, [_, gain]) = (&self.oncoming.valve, self.error_bounds.valve_gain_factor);
        let hysteresis_pa = self.error_bounds.valve_hysteresis_pa;
        [
            Judged {
                key: "design.error_bounds.pressure_max_pa".to_owned(),
                what: "over the pressure of the valve at the end of its maps, with the largest `valve_gain_factor`",
                value: self.error_bounds.pressure_max_pa / (gain * valve.settled_pressure(full_command(valve))),
                // A fit moves gain and bounds by less.
                usual: [0.95, 10.0],
                hint: "it is the largest pressure of the supply, in Pa, at which all ranges end, whatever the gain; 1 MPa is 1e6 Pa",
            },
            Judged {
                key: "design.error_bounds.valve_hysteresis_pa".to_owned(),
                what: "half-width of the hysteresis, Pa",
                // A valve without one.
                value: if hysteresis_pa == 0.0 { 1e4 } else { hysteresis_pa },
                usual: [50.0, 0.3e6],
                hint: "1 kPa is 1e3 Pa, 1 MPa is 1e6 Pa",
            },
        ]
    }
}

/// The command with which a valve gives its highest pressure.
pub(super) fn full_command(valve: &ClutchValve<f64>) -> f64 {
    match valve {
        ClutchValve::Proportional(maps) => maps.gain_pa_a.axis().last().copied().unwrap_or(0.0),
        ClutchValve::NormallyHigh { .. } => 0.0,
        ClutchValve::PulseWidth { .. } => 100.0,
    }
}

impl CarFile {
    /// What is unusual about the values, each with its key, the usual range and a hint.
    pub fn implausible(&self) -> Vec<String> {
        let named = self.gearbox.elements.iter().zip(&self.clutches);
        let named = named.filter_map(|(element, clutch)| Some((element.name.clone(), clutch.as_ref()?)));
        Parts {
            engine: &self.engine,
            converter: self.converter.as_ref(),
            driveline: &self.driveline,
            tyre: &self.tyre,
            road: &self.road,
            ratio: self.gearbox.gears.iter().map(|gear| gear.ratio.abs()).fold(0.0, f64::max),
            clutches: named.collect(),
            pressure_max_pa: self.line_pressure_pa,
        }
        .implausible()
        .into_iter()
        .chain(self.slipping_elements())
        .chain(of_gearbox(&self.gearbox_source))
        .collect()
    }
}

impl Parts<'_> {
    fn implausible(&self) -> Vec<String> {
        let torque_n_m = self.engine.largest_torque();
        let mut judged = self.of_car(torque_n_m);
        judged.extend(self.of_converter(torque_n_m));
        judged.extend(self.clutches.iter().flat_map(|(name, clutch)| self.of_clutch(name, clutch, torque_n_m)));
        let mut said: Vec<String> = judged.iter().filter_map(Judged::sentence).collect();
        said.extend(self.rising_torque_ratio());
        said
    }

    fn of_car(&self, torque_n_m: f64) -> Vec<Judged> {
        let (line, road) = (self.driveline, self.road);
        let multiplied = self.converter.map_or(1.0, |converter| converter.torque_ratio.range().1);
        let weight_n = road.mass_kg * GRAVITY_M_S2;
        let judged = |key: &str, what, value, usual, hint| Judged { key: key.to_owned(), what, value, usual, hint };
        vec![
            judged(
                "engine.torque.torque_n_m",
                "its largest torque for each tonne of the car, N m",
                torque_n_m / (1e-3 * road.mass_kg),
                [25.0, 1000.0],
                "check the unit of the engine's map (N m), and `vehicle.mass_kg`",
            ),
            judged(
                "engine.inertia_kg_m2",
                "for each 100 N m of the largest engine torque, kg m^2",
                100.0 * self.engine.inertia_kg_m2 / torque_n_m,
                [0.01, 0.6],
                "crank, flywheel and pump of a 2.0 L engine have 0.17 kg m^2",
            ),
            judged(
                "driveline.shaft_stiffness_n_m_rad",
                "twist of the drive shafts at the largest torque in the lowest gear, rad",
                torque_n_m * multiplied * self.ratio * line.final_ratio / line.shaft_stiffness_n_m_rad,
                [0.015, 1.5],
                "the stiffness is that of all driven shafts together at the wheels, in N m/rad; 1 N m/degree is 57.3 N m/rad",
            ),
            judged(
                "driveline.wheel_inertia_kg_m2",
                "over that of the car's mass at the wheels",
                line.wheel_inertia_kg_m2 / road.inertia_at_wheel(),
                [0.002, 0.3],
                "two driven wheels of a mid-size car have 2.4 kg m^2 together",
            ),
            judged(
                "vehicle.rolling_moment_n_m",
                "rolling resistance over the weight",
                road.rolling_moment_n_m / (weight_n * road.wheel_radius_m),
                [0.003, 0.06],
                "the moment at the wheels is 0.01 to 0.02 of mass, 9.81 m/s^2 and wheel radius",
            ),
            judged(
                "tyre.max_force_n",
                "largest force of the driven tyres over the weight",
                self.tyre.max_force_n / weight_n,
                [0.25, 2.5],
                "it is friction times the load of the driven axles; check `vehicle.mass_kg` too",
            ),
        ]
    }

    fn of_converter(&self, torque_n_m: f64) -> Vec<Judged> {
        let Some(converter) = self.converter else { return Vec::new() };
        vec![
            Judged {
                key: "converter.capacity_n_m_s2".to_owned(),
                what: "speed of the engine at its largest torque with the turbine at rest, rad/s",
                value: (torque_n_m / converter.capacity_n_m_s2.at(0.0)).sqrt(),
                usual: [80.0, 600.0],
                hint: "the capacity is pump torque over the square of the pump speed in rad/s: (30/(pi K))^2 with a K factor in rpm/sqrt(N m)",
            },
            Judged {
                key: "converter.torque_ratio".to_owned(),
                what: "turbine over pump torque with the turbine at rest",
                value: converter.torque_ratio.at(0.0),
                usual: [1.2, 4.0],
                hint: "the first column is the speed ratio turbine over pump, from 0",
            },
        ]
    }

    fn of_clutch(&self, name: &str, clutch: &ShiftClutch, torque_n_m: f64) -> [Judged; 2] {
        [
            Judged {
                key: format!("return spring and piston area of {name}"),
                what: "pressure at which the plates touch, Pa",
                value: clutch.clutch.kiss_pressure(),
                usual: [5e3, 0.5e6],
                hint: "it is spring force over piston area; 1 kN is 1000 N, 1 cm2 is 1e-4 m2",
            },
            Judged {
                key: format!("plates and piston of {name}"),
                what: "torque that it holds at the highest pressure, over the largest engine torque",
                value: clutch.clutch.static_capacity(self.pressure_max_pa) / torque_n_m,
                usual: [0.2, 60.0],
                hint: "check faces, mean radius, piston area, friction and the engine's map",
            },
        ]
    }

    /// The torque ratio of a converter falls from standstill to the coupling point.
    fn rising_torque_ratio(&self) -> Option<String> {
        let table = &self.converter?.torque_ratio;
        let (axis, values) = (table.axis(), table.values());
        let rises = (1..axis.len().min(values.len())).find(|&i| axis[i] <= 1.0 && values[i] > values[i - 1])?;
        Some(format!(
            "`converter.torque_ratio` rises from {} to {} at a speed ratio of {}; it usually falls from about 2 at standstill to 1\n\
             hint: check the order of the values, and that `speed_ratio` is turbine over pump",
            short(values[rises - 1]),
            short(values[rises]),
            short(axis[rises])
        ))
    }
}

impl Judged {
    /// What to say of it; nothing where it is usual.
    fn sentence(&self) -> Option<String> {
        let Self { key, what, value, usual: [minimum, maximum], hint } = self;
        if (*minimum..=*maximum).contains(value) {
            return None;
        }
        let key = if key.contains('.') { format!("`{key}`") } else { key.clone() };
        Some(format!(
            "{key}: {what}: {}; usual are {} to {}\nhint: {hint}",
            short(*value),
            short(*minimum),
            short(*maximum)
        ))
    }
}

/// The warnings of a gearbox file, each at its line.
fn of_gearbox(source: &Source) -> Vec<String> {
    GearboxFile::from_source(source.clone()).map(|file| file.warnings).unwrap_or_default()
}

/// A number with three digits that count.
fn short(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Source;
    use crate::vehicle::short::{Facts, ValveKind, short_file};

    fn said(of: &str, to: &str) -> String {
        let text = include_str!("../../../../vehicles/two_speed_at.toml");
        assert!(text.contains(of), "{of}");
        let source = Source::built_in("x.toml", &text.replacen(of, to, 1));
        VehicleFile::from_source(source).unwrap().implausible().join("\n")
    }

    #[test]
    fn nothing_is_said_of_shipped_files_and_of_first_files_of_small_and_large_cars() {
        let vehicles = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../vehicles");
        for entry in std::fs::read_dir(vehicles).unwrap() {
            let path = entry.unwrap().path();
            let mut said = match Source::read(&path).unwrap().kind().unwrap() {
                crate::Kind::Car => CarFile::read(&path).unwrap().implausible(),
                _ => VehicleFile::read(&path).unwrap().implausible(),
            };
            // Teeth of real gearboxes.
            said.retain(|said| !said.contains("ring less sun is"));
            assert_eq!(said, Vec::<String>::new(), "{}", path.display());
        }
        for (mass_kg, engine_torque_n_m, wheel_radius_m, final_ratio) in
            [(500.0, 50.0, 0.25, 4.3), (1500.0, 190.0, 0.3, 3.0), (2200.0, 900.0, 0.35, 2.8), (40e3, 2000.0, 0.5, 4.0)]
        {
            let facts = Facts {
                name: "car".to_owned(),
                mass_kg,
                wheel_radius_m,
                ratio_before: 3.5,
                ratio_after: 2.1,
                final_ratio,
                engine_torque_n_m,
                valve: ValveKind::Proportional,
            };
            let text = short_file(&facts, true).unwrap();
            let said = VehicleFile::from_source(Source::built_in("x.toml", &text)).unwrap().implausible();
            assert_eq!(said, Vec::<String>::new(), "{mass_kg} kg");
        }
    }

    #[test]
    fn a_slip_of_the_unit_that_is_no_error_is_said_with_the_usual_range() {
        for (of, to, expected) in [
            ("mass_kg = 1500", "mass_kg = 15000", "`engine.torque.torque_n_m`: its largest torque for each tonne"),
            ("inertia_kg_m2 = 0.17", "inertia_kg_m2 = 1.7", "`engine.inertia_kg_m2`"),
            (
                "rad = 13000",
                "rad = 227",
                "twist of the drive shafts at the largest torque in the lowest gear, rad: 12.6; usual are 0.015 to 1.5",
            ),
            ("wheel_inertia_kg_m2 = 2.4", "wheel_inertia_kg_m2 = 240", "`driveline.wheel_inertia_kg_m2`"),
            ("rolling_moment_n_m = 100", "rolling_moment_n_m = 10000", "`vehicle.rolling_moment_n_m`"),
            ("max_force_n = 13200", "max_force_n = 1320", "`tyre.max_force_n`"),
            ("return_spring_n = 600", "return_spring_n = 6", "return spring and piston area of the offgoing clutch"),
            ("piston_area_m2 = 0.012", "piston_area_m2 = 0.0004", "plates and piston of the offgoing clutch"),
            ("  4.3976e-3", "  4.3976e-4", "speed of the engine at its largest torque with the turbine at rest"),
            ("hysteresis_pa = 10e3 ", "hysteresis_pa = 0.01 ", "`design.error_bounds.valve_hysteresis_pa`"),
            ("  2.00, 1.88", "  1.00, 1.88", "`converter.torque_ratio` rises from 1 to 1.88 at a speed ratio of 0.1"),
        ] {
            let said = said(of, to);
            assert!(said.contains(expected) && said.contains("hint: "), "{to}: {said}");
        }
    }
}
