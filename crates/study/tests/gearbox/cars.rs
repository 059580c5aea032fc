//! The shipped gearboxes as cars, their shifts, and the sensors.

use car::ErrorBudget;
use car::{Car, Sensors};
use config::{CarFile, Source};
use observer::ShiftTables;
use std::path::Path;
use study::gearbox::matrix::neighbouring_shifts;

pub(crate) use study::gearbox::matrix::Random;

/// A vehicle file of two or three lines with a gearbox that ships with the program.
macro_rules! car {
    ($gearbox:literal, $more:literal) => {
        CarFile::from_sources(
            Source::built_in("car.toml", concat!("name = \"car\"\ngearbox = \"", $gearbox, "\"\n", $more)),
            Source::built_in($gearbox, include_str!(concat!("../../../../", $gearbox))),
        )
        .unwrap()
    };
}

pub(crate) fn cars() -> Vec<Car> {
    car_files().into_iter().map(|file| file.car).collect()
}

/// The same with their vehicle files.
pub(crate) fn car_files() -> Vec<CarFile> {
    vec![
        car!("gearboxes/8hp.toml", ""),
        car!("gearboxes/lepelletier_6.toml", ""),
        car!("gearboxes/ravigneaux_4.toml", ""),
        car!("gearboxes/10_speed.toml", ""),
        car!("gearboxes/two_speed.toml", "[hydraulics]\nline_pressure_pa = 1.0e6\n"),
        car!("gearboxes/dual_clutch_7.toml", "launch = \"clutch\"\n[driveline]\nfinal_ratio = 1.0\n"),
    ]
}

/// The four-speed gearbox whose 1st gear a one-way clutch holds.
pub(crate) fn one_way() -> Car {
    car!("gearboxes/ravigneaux_4_one_way.toml", "").car
}

/// The gearboxes of [`cars`] with pistons that have a stroke.
pub(crate) fn cars_with_strokes() -> Vec<Car> {
    let files = [
        car!("gearboxes/8hp.toml", "[fill]\n"),
        car!("gearboxes/lepelletier_6.toml", "[fill]\n"),
        car!("gearboxes/ravigneaux_4.toml", "[fill]\n"),
        car!("gearboxes/10_speed.toml", "[fill]\n"),
        car!("gearboxes/dual_clutch_7.toml", "launch = \"clutch\"\n[fill]\n[driveline]\nfinal_ratio = 1.0\n"),
    ];
    files.into_iter().map(|file| file.car).collect()
}

/// Neighbouring gears in both directions, with and without power.
pub(crate) fn shifts(car: &Car) -> Vec<(usize, usize, f64)> {
    let tables = ShiftTables::of_car(car, &ErrorBudget::of_car(car)).unwrap();
    let (shifts, without_tables) = neighbouring_shifts(car, &tables);
    assert_eq!(without_tables, Vec::<[usize; 2]>::new());
    shifts.iter().map(|shift| (shift.from, shift.to, shift.throttle())).collect()
}

/// Those of the bench.
pub(crate) fn sensors() -> Sensors {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../experiments/bench.toml");
    config::read_sensors(&path).unwrap().unwrap()
}
