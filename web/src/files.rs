//! The files of a run: what the page sets, as vehicle and drive files that the program reads too.

use config::{CarFile, toml_number, toml_string};
use toml::{Table, Value};
use wetclutch::Error;

use crate::Settings;
use crate::cars::{DEFAULTS, ShippedCar};
use crate::settings::Fault;

/// Time before the request of a single shift, and the length of its drive, s.
const REQUEST_S: f64 = 0.8;
const LENGTH_S: f64 = 3.6;

/// The files of a run.
pub(crate) struct Files {
    /// The car that filter and shift controller know.
    pub(crate) known: CarFile,
    /// The car that is driven.
    pub(crate) driven: String,
    /// The drive.
    pub(crate) drive: String,
}

impl Files {
    /// The files of these settings.
    ///
    /// # Errors
    /// There is no such car or gear, or a value cannot be right.
    pub(crate) fn of(settings: &Settings, car: &ShippedCar) -> Result<Self, Error> {
        let known = car.read("known.toml", &known(settings, car)?)?;
        Ok(Self { driven: driven(settings, &known.source.text)?, drive: drive(settings, &known)?, known })
    }
}

/// The shipped file, with what the filter knows of the settings.
fn known(settings: &Settings, car: &ShippedCar) -> Result<String, Error> {
    if !settings.has_stroke && settings.oil_degc.is_none() {
        return Ok(car.text.to_owned());
    }
    let mut table = parsed(car.text)?;
    if settings.has_stroke {
        table.entry("fill").or_insert_with(|| Value::Table(Table::new()));
    }
    if let Some(degc) = settings.oil_degc {
        set(&mut table, ["oil", "temperature_degc"], degc);
    }
    Ok(table.to_string())
}

/// The known car with the defaults that it takes, and what the settings change.
fn driven(settings: &Settings, known: &str) -> Result<String, Error> {
    let mut table = parsed(DEFAULTS)?;
    merge(&mut table, parsed(known)?);
    let Settings { friction_factor, valve_gain_factor, valve_delay_s, .. } = *settings;
    for key in ["factor", "static_factor"] {
        change(&mut table, &["friction", key], &|value| value * friction_factor);
    }
    change(&mut table, &["valve", "gain", "gain_pa_a"], &|value| value * valve_gain_factor);
    change(&mut table, &["valve", "delay", "delay_s"], &|value| (value + valve_delay_s).max(0.0));
    if let Some(mass_kg) = settings.mass_kg {
        set(&mut table, ["vehicle", "mass_kg"], mass_kg);
    }
    Ok(table.to_string())
}

fn parsed(text: &str) -> Result<Table, Error> {
    text.parse().map_err(|error| Error::Input(format!("the vehicle file: {error}")))
}

/// Puts the values of `above` over those of a table, key by key.
fn merge(table: &mut Table, above: Table) {
    for (key, value) in above {
        match (table.get_mut(&key), value) {
            (Some(Value::Table(own)), Value::Table(above)) => merge(own, above),
            (_, value) => {
                table.insert(key, value);
            }
        }
    }
}

fn set(table: &mut Table, [name, key]: [&str; 2], value: f64) {
    let inner = table.entry(name).or_insert_with(|| Value::Table(Table::new()));
    if let Value::Table(inner) = inner {
        inner.insert(key.to_owned(), Value::Float(value));
    }
}

/// Changes a number, or each number of a list, if it is there.
fn change(table: &mut Table, path: &[&str], to: &dyn Fn(f64) -> f64) {
    let [key, rest @ ..] = path else { return };
    match table.get_mut(*key) {
        Some(Value::Table(inner)) => change(inner, rest, to),
        Some(value) => change_value(value, to),
        None => {}
    }
}

fn change_value(value: &mut Value, to: &dyn Fn(f64) -> f64) {
    match value {
        Value::Array(items) => items.iter_mut().for_each(|item| change_value(item, to)),
        Value::Float(number) => *number = to(*number),
        Value::Integer(number) => *value = Value::Float(to(*number as f64)),
        _ => {}
    }
}

/// The drive file.
fn drive(settings: &Settings, car: &CarFile) -> Result<String, Error> {
    let Settings { throttle, grade_rad, .. } = settings;
    let [throttle, grade] = [*throttle, *grade_rad].map(toml_number);
    let begin = "name = \"live\"\nsample_time_s = 0.01\n";
    let drive = match settings.shift.as_str() {
        "all" => format!(
            "{begin}\n[[segment]]\nduration_s = 1\nthrottle = 0.0\nbrake = 0.1\ngrade_rad = {grade}\n\n\
             [[segment]]\nduration_s = 20\nthrottle = {throttle}\ngrade_rad = {grade}\n\n\
             [[segment]]\nduration_s = 14\nthrottle = 0.0\nbrake = [0.02, 0.12]\ngrade_rad = {grade}\n"
        ),
        gears => {
            let [from, to] = gears_of(gears, car)?;
            let [start, length, request] = [start_m_s(settings, car, from), LENGTH_S, REQUEST_S].map(toml_number);
            let [from, to] = [from, to].map(|gear| toml_string(&car.gearbox.gears[gear].name));
            format!(
                "{begin}\n[start]\ngear = {from}\nvehicle_m_s = {start}\n\n[[shift]]\ntime_s = {request}\ngear = {to}\n\n\
                 [[segment]]\nduration_s = {length}\nthrottle = {throttle}\ngrade_rad = {grade}\n"
            )
        }
    };
    Ok(drive + &sensors(settings))
}

/// The places of both gears in the gearbox.
fn gears_of(names: &str, car: &CarFile) -> Result<[usize; 2], Error> {
    let gears = &car.gearbox.gears;
    let place = |name: &str| gears.iter().position(|gear| gear.name == name);
    let found = names.split_once('-').and_then(|(from, to)| Some([place(from)?, place(to)?]));
    found.ok_or_else(|| {
        let known: Vec<&str> = gears.iter().map(|gear| gear.name.as_str()).collect();
        Error::Input(format!(
            "shift: `{}` names no two gears\nhint: expected two of {} with a - between them, or `all`",
            names.escape_debug(),
            known.join(", ")
        ))
    })
}

/// The speed of the car in a gear, m/s.
fn start_m_s(settings: &Settings, car: &CarFile, gear: usize) -> f64 {
    let ratio = car.gearbox.gears[gear].ratio * car.driveline.final_ratio;
    settings.turbine_rad_s / ratio * car.road.wheel_radius_m
}

/// Toothed wheels with timers on a bus of 100 Hz, as in the shipped bench.
fn sensors(settings: &Settings) -> String {
    let Settings { noise_rad_s, delay_s, fault, seed, .. } = settings;
    let [noise, delay] = [*noise_rad_s, *delay_s].map(toml_number);
    let channel = |name: &str, teeth: u32, periods: u32, noise: &str| {
        let error = match (fault, name) {
            (Fault::TurbineLost, "turbine") => "burst_s = 0.2\n",
            (Fault::TurbineFrozen, "turbine") => "frozen_s = 0.2\n",
            (Fault::TurbineOutliers, "turbine") => "outliers = 6\noutlier_rad_s = 30\n",
            (Fault::WheelScale, "wheel") => "scale = 1.03\n",
            (Fault::ReadingsLost, _) => "missing_share = 0.3\n",
            _ => "",
        };
        format!(
            "\n[sensors.{name}]\nteeth = {teeth}\ntimer_s = 1e-6\nperiods = {periods}\nsample_time_s = 0.01\ndelay_s = {delay}\n\
             noise_rad_s = {noise}\n{error}"
        )
    };
    [
        format!("\n[sensors]\nseed = {seed}\n"),
        channel("engine", 58, 10, &noise),
        channel("turbine", 60, 10, &noise),
        channel("output", 60, 5, &noise),
        channel("wheel", 48, 2, "0.02"),
    ]
    .concat()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cars::CARS;

    fn files(settings: &Settings) -> [CarFile; 2] {
        let car = ShippedCar::named(&settings.car).unwrap();
        let files = Files::of(settings, car).unwrap();
        [files.known, car.read("car.toml", &files.driven).unwrap()]
    }

    #[test]
    fn without_a_change_the_driven_car_is_the_known_one() {
        for car in CARS {
            for (has_stroke, oil_degc) in [(false, None), (true, Some(20.0))] {
                let settings = Settings { car: car.name.to_owned(), has_stroke, oil_degc, ..Settings::default() };
                let [known, driven] = files(&settings);
                assert_eq!(known.car, driven.car, "{}", car.name);
            }
        }
    }

    #[test]
    fn changes_are_those_of_the_driven_car_alone() {
        let nominal = files(&Settings::default());
        let settings = Settings {
            friction_factor: 1.1,
            valve_gain_factor: 0.9,
            valve_delay_s: 0.01,
            mass_kg: Some(2000.0),
            ..Settings::default()
        };
        let [known, driven] = files(&settings);
        assert_eq!(known.car, nominal[0].car);
        assert_eq!(driven.car.road.mass_kg, 2000.0);
        let pairs = driven.car.clutches.iter().zip(&known.car.clutches);
        for (driven, known) in pairs.filter_map(|(driven, known)| driven.as_ref().zip(known.as_ref())) {
            let [friction, nominal] = [driven, known].map(|clutch| clutch.clutch.friction.at(10.0));
            assert!((friction / nominal - 1.1).abs() < 1e-9, "{friction} {nominal}");
            let [settled, nominal] = [driven, known].map(|clutch| clutch.valve.settled_pressure(0.4));
            assert!((settled / nominal - 0.9).abs() < 1e-9, "{settled} {nominal}");
        }
    }

    #[test]
    fn every_neighbouring_shift_of_every_car_has_a_drive() {
        for car in CARS {
            let file = car.read("car.toml", car.text).unwrap();
            let gears = file.car.gearbox.forward_gears();
            for pair in gears.windows(2) {
                let [from, to] = [pair[0], pair[1]].map(|gear| file.car.gearbox.gears[gear].name.as_str());
                for shift in [format!("{from}-{to}"), format!("{to}-{from}"), "all".to_owned()] {
                    let settings = Settings { car: car.name.to_owned(), shift, ..Settings::default() };
                    let text = drive(&settings, &file).unwrap();
                    config::DriveFile::from_source(config::Source::built_in("drive.toml", &text)).unwrap();
                }
            }
        }
    }

    #[test]
    fn each_fault_is_a_key_of_the_drive_file() {
        let car = ShippedCar::named("eight_speed").unwrap();
        let file = car.read("car.toml", car.text).unwrap();
        for (fault, key) in [
            (Fault::TurbineLost, "burst_s"),
            (Fault::TurbineFrozen, "frozen_s"),
            (Fault::TurbineOutliers, "outliers"),
            (Fault::ReadingsLost, "missing_share"),
            (Fault::WheelScale, "scale"),
        ] {
            let text = drive(&Settings { fault, ..Settings::default() }, &file).unwrap();
            assert!(text.contains(key), "{text}");
            config::DriveFile::from_source(config::Source::built_in("drive.toml", &text)).unwrap();
        }
    }
}
