//! The shipped gearboxes as cars, their shifts, and the sensors.

use config::{Car, Sensors, Source};
use plant::car::CarShift;
use std::path::Path;

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

pub(crate) fn cars() -> Vec<Car> {
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
pub(crate) fn shifts(car: &Car) -> Vec<(usize, usize, f64)> {
    let forward = car.gearbox.forward_gears();
    let up = forward.windows(2).map(|pair| (pair[0], pair[1]));
    let both = up.flat_map(|(low, high)| [(low, high), (high, low)]);
    both.flat_map(|(from, to)| [(from, to, 0.15), (from, to, 0.0)]).collect()
}

pub(crate) fn usual(car: &Car, from: usize, to: usize, throttle: f64) -> CarShift {
    CarShift::usual(car, from, to, throttle)
}

/// Those of the bench.
pub(crate) fn sensors() -> Sensors {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../experiments/bench.toml");
    Sensors::read(&path).unwrap().unwrap()
}

/// Random numbers (SplitMix64).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    /// From 0 to 1.
    pub(crate) fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}
