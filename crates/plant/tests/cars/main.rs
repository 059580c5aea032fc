//! Cars with whole gearboxes.

#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a test may")]

use config::{Car, Source};

/// A vehicle file of two or three lines with a gearbox that ships with the program.
macro_rules! car {
    ($gearbox:literal, $more:literal) => {
        Car::from_sources(
            Source::built_in("car.toml", concat!("name = \"car\"\ngearbox = \"", $gearbox, "\"\n", $more)),
            Source::built_in($gearbox, include_str!(concat!("../../../../", $gearbox))),
        )
        .unwrap()
    };
}

mod drives;
mod energy;
mod garage;
mod one_way;
mod sequences;
mod shifts;
mod two_speed;

fn two_speed() -> Car {
    car!("gearboxes/two_speed.toml", "[hydraulics]\nline_pressure_pa = 1.0e6\n")
}

fn dual_clutch() -> Car {
    car!("gearboxes/dual_clutch_7.toml", "launch = \"clutch\"\n[driveline]\nfinal_ratio = 1.0\n")
}

/// The four-speed gearbox whose 1st gear a one-way clutch holds.
fn one_way() -> Car {
    car!("gearboxes/ravigneaux_4_one_way.toml", "")
}

/// A car for every gearbox that ships with the program, but for that with a one-way clutch.
fn cars() -> Vec<Car> {
    vec![
        car!("gearboxes/8hp.toml", ""),
        car!("gearboxes/lepelletier_6.toml", ""),
        car!("gearboxes/ravigneaux_4.toml", ""),
        car!("gearboxes/10_speed.toml", ""),
        two_speed(),
        dual_clutch(),
    ]
}

/// The car with pistons that have a stroke.
fn with_stroke(mut car: Car) -> Car {
    car.clutches.iter_mut().flatten().for_each(|clutch| clutch.has_stroke = true);
    car
}

/// Of many runs all in an optimised build, every fifth one in a debug build, which is too slow for them.
fn runs<T>(all: impl IntoIterator<Item = T>) -> impl Iterator<Item = T> {
    all.into_iter().step_by(if cfg!(debug_assertions) { 5 } else { 1 })
}

/// Neighbouring gears in both directions.
fn neighbours(car: &Car) -> Vec<(usize, usize)> {
    let forward = car.gearbox.forward_gears();
    forward.windows(2).flat_map(|pair| [(pair[0], pair[1]), (pair[1], pair[0])]).collect()
}
