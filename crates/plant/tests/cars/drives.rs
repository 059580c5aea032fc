//! Whole drives.

use config::{Drive, Source};
use plant::car::{CarCalibration, CarModel, simulate_car_drive};

fn city() -> Drive {
    let text = include_str!("../../../../drives/city.toml");
    Drive::from_source(Source::built_in("drives/city.toml", text)).unwrap()
}

#[test]
fn an_hour_in_town() {
    let drive = city();
    let car = crate::cars().swap_remove(0);
    let model = CarModel::new(car.clone()).unwrap();
    let begin = std::time::Instant::now();
    let mut samples = 0_u64;
    let mut last = (usize::MAX, 0.0);
    let summary = simulate_car_drive(&model, &car, CarCalibration::STANDARD, &drive, |sample| {
        samples += 1;
        if sample.gear != last.0 && sample.time_s < 185.0 {
            println!(
                "{:7.2} s gear {} {:5.1} m/s input {:5.1} engine {:5.1}",
                sample.time_s,
                car.gearbox.gears[sample.gear].name,
                sample.vehicle_m_s,
                sample.torques.turbine_rad_s,
                sample.torques.engine_rad_s
            );
            last.0 = sample.gear;
        }
        if sample.time_s >= last.1 && sample.time_s < 180.0 {
            println!(
                "{:7.2} s gear {} {:5.1} m/s input {:5.1} engine {:5.1} thr {:.2}",
                sample.time_s,
                car.gearbox.gears[sample.gear].name,
                sample.vehicle_m_s,
                sample.torques.turbine_rad_s,
                sample.torques.engine_rad_s,
                sample.driver.throttle
            );
            last.1 += 5.0;
        }
    });
    println!("{summary:?} {samples} samples in {:.3} s", begin.elapsed().as_secs_f64());
    summary.unwrap();
}
