//! Cars with whole gearboxes.

#![expect(clippy::print_stdout, reason = "a test may")]

use car::Car;
use config::Source;
use plant::car::{CarCalibration, CarSample};

/// A vehicle file of two or three lines with a gearbox that ships with the program.
macro_rules! car {
    ($gearbox:literal, $more:literal) => {
        config::CarFile::from_sources(
            Source::built_in("car.toml", concat!("name = \"car\"\ngearbox = \"", $gearbox, "\"\n", $more)),
            Source::built_in($gearbox, include_str!(concat!("../../../../", $gearbox))),
        )
        .unwrap()
        .car
    };
}

mod dogs;
mod drives;
mod energy;
mod faults;
mod garage;
mod one_way;
mod sequences;
mod series;
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

/// A car for every gearbox of cars on the road, and one whose pistons have a stroke.
fn road_cars() -> Vec<Car> {
    vec![
        car!("gearboxes/8hp45.toml", ""),
        car!("gearboxes/a8lr1.toml", ""),
        car!("gearboxes/722_6.toml", ""),
        car!("gearboxes/ravigneaux_4.toml", ""),
        car!("gearboxes/4l60e.toml", ""),
        car!("gearboxes/fn4a.toml", ""),
        car!("gearboxes/ravigneaux_4_one_way.toml", ""),
        car!("gearboxes/a340e.toml", ""),
        car!("gearboxes/9g_tronic.toml", ""),
        car!("gearboxes/9hp48.toml", ""),
        car!("gearboxes/lepelletier_6.toml", ""),
        car!("gearboxes/tf80sc.toml", ""),
        car!("gearboxes/10_speed.toml", ""),
        car!("gearboxes/c6.toml", ""),
        car!("gearboxes/th400.toml", ""),
        dual_clutch(),
        with_stroke(car!("gearboxes/8hp.toml", "")),
    ]
}

/// The car with pistons that have a stroke.
fn with_stroke(mut car: Car) -> Car {
    car.clutches.iter_mut().flatten().for_each(|clutch| clutch.has_stroke = true);
    car
}

/// Both calibrations of the shift controller.
const CALIBRATIONS: [CarCalibration; 2] = [CarCalibration::STANDARD, CarCalibration::COMFORT];

/// Each of these with both calibrations.
fn calibrated<T: Clone>(all: impl IntoIterator<Item = T>) -> impl Iterator<Item = (CarCalibration, T)> {
    all.into_iter().flat_map(|one| CALIBRATIONS.map(|calibration| (calibration, one.clone())))
}

/// Of many runs all in an optimised build, every fifth one in a debug build, which is too slow for them.
fn runs<T>(all: impl IntoIterator<Item = T>) -> impl Iterator<Item = T> {
    all.into_iter().step_by(if cfg!(debug_assertions) { 5 } else { 1 })
}

/// Where no shift is under way, the elements of the gear are commanded to line pressure, and no other command rises. Without a
/// converter the clutch of the gear opens at low speed.
#[derive(Default)]
struct HeldGear {
    /// Pressures at which the valves settled in the sample before, Pa.
    before_pa: Option<Vec<f64>>,
    /// Whether the clutch of a car without a converter was opened, until it is closed again.
    is_opened: bool,
}

impl HeldGear {
    fn check(&mut self, car: &Car, sample: &CarSample, label: &str) {
        let settled = |(at, clutch): (usize, &Option<car::ShiftClutch>)| {
            clutch.map_or(0.0, |clutch| clutch.valve.settled_pressure(sample.commands[at]))
        };
        let settled_pa: Vec<f64> = car.clutches.iter().enumerate().map(settled).collect();
        let before_pa = self.before_pa.replace(settled_pa.clone()).unwrap_or_else(|| settled_pa.clone());
        if sample.shift.is_some() || sample.is_neutral {
            return;
        }
        let gear = &car.gearbox.gears[sample.gear];
        let input_rad_s = gear.ratio * car.driveline.final_ratio * sample.wheel_rad_s;
        // The gearbox output swings about the speed of the wheels by a few per cent.
        let opens_rad_s = CarCalibration::STANDARD.launch_open_rad_s;
        self.is_opened |= gear.ratio * sample.torques.output_rad_s < opens_rad_s;
        let may_open = car.converter.is_none() && (self.is_opened || input_rad_s < 1.1 * opens_rad_s);
        let is_closed = |holding: &geartrain::Holding| settled_pa[holding.element] > 0.999 * car.line_pressure_pa;
        self.is_opened &= !gear.holding.iter().any(is_closed);
        for (at, element) in car.gearbox.elements.iter().enumerate() {
            let holds = gear.holding.iter().any(|holding| holding.element == at);
            if car.clutches[at].is_none() || (holds && may_open) {
                continue;
            }
            let is_kept =
                if holds { settled_pa[at] > 0.999 * car.line_pressure_pa } else { settled_pa[at] <= before_pa[at] };
            let (name, time_s, gear, now_pa, before_pa) =
                (&element.name, sample.time_s, &gear.name, settled_pa[at], before_pa[at]);
            assert!(is_kept, "{label}, {time_s:.2} s: {name} in gear {gear} from {before_pa:.0} to {now_pa:.0} Pa");
        }
    }
}

/// Neighbouring gears in both directions.
fn neighbours(car: &Car) -> Vec<(usize, usize)> {
    let forward = car.gearbox.forward_gears();
    forward.windows(2).flat_map(|pair| [(pair[0], pair[1]), (pair[1], pair[0])]).collect()
}
