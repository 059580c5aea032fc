//! Every shift between neighbouring gears of every gearbox that ships with the program, in all four kinds.

#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a test may")]

use config::{Car, Source};
use plant::car::{CarCalibration, CarModel, CarShift, CarShiftQuality, simulate_car_shift};

/// A vehicle file of two or three lines with a gearbox that ships with the program.
macro_rules! car {
    ($gearbox:literal, $more:literal) => {
        Car::from_sources(
            Source::built_in("car.toml", concat!("name = \"car\"\ngearbox = \"", $gearbox, "\"\n", $more)),
            Source::built_in($gearbox, include_str!(concat!("../../../", $gearbox))),
        )
        .unwrap()
    };
}

fn cars() -> Vec<Car> {
    vec![
        car!("gearboxes/8hp.toml", ""),
        car!("gearboxes/lepelletier_6.toml", ""),
        car!("gearboxes/ravigneaux_4.toml", ""),
        car!("gearboxes/10_speed.toml", ""),
        car!("gearboxes/two_speed.toml", "[hydraulics]\nline_pressure_pa = 1.0e6\n"),
        car!("gearboxes/dual_clutch_7.toml", "launch = \"clutch\"\n[driveline]\nfinal_ratio = 1.0\n"),
    ]
}

/// Neighbouring gears in both directions, with and without power.
fn shifts(car: &Car) -> Vec<(usize, usize, f64)> {
    let forward = car.gearbox.forward_gears();
    let up = forward.windows(2).map(|pair| (pair[0], pair[1]));
    let both = up.flat_map(|(low, high)| [(low, high), (high, low)]);
    both.flat_map(|(from, to)| [(from, to, 0.15), (from, to, 0.0)]).collect()
}

fn table(friction: f64) -> Vec<(String, CarShiftQuality)> {
    let mut rows = Vec::new();
    for nominal in cars() {
        let model = CarModel::new(nominal.clone().with_friction(friction)).unwrap();
        for (from, to, throttle) in shifts(&nominal) {
            let shift = CarShift::usual(&nominal, from, to, throttle);
            let names = [from, to].map(|gear| nominal.gearbox.gears[gear].name.clone());
            let label = format!(
                "{} {}-{} {}",
                nominal.gearbox.name,
                names[0],
                names[1],
                if throttle > 0.0 { "on" } else { "off" }
            );
            let quality = simulate_car_shift(&model, &nominal, CarCalibration::STANDARD, &shift, |_| {});
            let quality = quality.unwrap_or_else(|error| panic!("{label}: {error}"));
            println!(
                "{label:40} T {:6.1} time {:5.2} flare {:5.1} past {:5.1} tie-up {:5.1} held {:4.1} jerk {:6.1}",
                quality.turbine_n_m,
                quality.complete_s.unwrap_or(f64::NAN),
                quality.flare_rad_s,
                quality.past_synchronous_rad_s,
                quality.tie_up_n_m,
                quality.held_slip_rad_s,
                quality.jerk_m_s3
            );
            rows.push((label, quality));
        }
    }
    rows
}

#[test]
fn every_shift_of_every_gearbox_is_completed() {
    for (label, quality) in table(1.0) {
        assert!(quality.complete_s.is_some(), "{label}");
    }
}
