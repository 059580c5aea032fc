//! Cars on the road: the drive of `drives/city.toml` in each, simulated and estimated.

use std::path::Path;

use config::{CarFile, DriveFile};
use observer::Health;
use plant::car::{CarCalibration, CarModel, simulate_car_drive};
use study::gearbox::RECORD_S;
use study::gearbox::drive::score_drive;
use study::gearbox::recording::Recording;

use super::cars::sensors;

/// The vehicle files with a gearbox that is on the road, but for those that other tests drive.
const CARS: [&str; 11] = [
    "five_speed_722_6",
    "three_speed_c6",
    "three_speed_th400",
    "four_speed_4l60e",
    "eight_speed_8hp45",
    "eight_speed_a8lr1",
    "four_speed_fn4a",
    "four_speed_simpson",
    "nine_speed_9g",
    "nine_speed_9hp",
    "six_speed_tf80sc",
];

#[test]
fn a_city_drive_of_every_car_on_the_road_is_simulated_and_estimated() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut drive = DriveFile::read(&root.join("drives/city.toml")).unwrap().drive;
    (drive.repetitions, drive.sample_time_s) = (1, RECORD_S);
    for name in CARS {
        let mut car = CarFile::read(&root.join(format!("vehicles/{name}.toml"))).unwrap().car;
        car.clutches.iter_mut().flatten().for_each(|clutch| clutch.steel_mass_kg = Some(0.6));
        let model = CarModel::new(car.clone()).unwrap();
        let mut recording = Recording::default();
        let calibration = CarCalibration::of(drive.controller);
        let summary = simulate_car_drive(&model, &car, calibration, &drive, |sample| recording.push(sample)).unwrap();
        assert!(summary.over_speed.is_none() && summary.shifts >= 4, "{name}: {summary:?}");
        let scored = score_drive(&car, &model, &recording, &sensors(), 1).unwrap();
        let restarts = scored.states.iter().skip(100).filter(|state| state.health == Health::Restarted).count();
        assert_eq!(restarts, 0, "{name}");
        for shift in &scored.shifts {
            let label = format!("{name} {} {:?}", shift.number, shift.gears);
            // A change of mind ends a shift, and so does the end of the drive.
            let ends_s = scored.shifts.iter().map(|next| next.time_s[0]).chain([drive.duration_s()]);
            let is_cut = ends_s.into_iter().any(|next_s| (shift.time_s[1]..shift.time_s[1] + 0.1).contains(&next_s));
            assert!(is_cut || shift.quality.complete_s.is_some_and(|time_s| time_s < 2.0), "{label}");
            let is_rated = shift.comfort.and_then(|comfort| comfort.rating(&shift.quality));
            assert!(is_cut || is_rated.is_some_and(|rating| (1.0..=10.0).contains(&rating)), "{label}: {is_rated:?}");
            let is_hot = shift.plates_degc.is_none_or(|degc| (car.oil_temperature_degc..300.0).contains(&degc));
            assert!(is_hot, "{label}: {:?}", shift.plates_degc);
            assert!(shift.inside().is_none_or(|inside| inside == 1.0), "{label}");
        }
        assert!(scored.shifts.iter().filter(|shift| shift.plates_degc.is_some()).count() >= 2, "{name}");
    }
}
