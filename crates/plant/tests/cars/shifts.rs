//! Every shift between neighbouring gears of every gearbox that ships with the program, in all four kinds.

use plant::car::{CarCalibration, CarModel, CarShift, CarShiftQuality, simulate_car_shift};

use crate::{cars, neighbours};

/// Neighbouring gears in both directions, without power, with some, and with much.
fn kinds(car: &config::Car) -> Vec<((usize, usize), f64)> {
    neighbours(car).into_iter().flat_map(|pair| [0.0, 0.1, 0.2, 0.4, 0.7].map(|throttle| (pair, throttle))).collect()
}

fn table(friction: f64) -> Vec<(String, CarShiftQuality)> {
    let mut rows = Vec::new();
    for nominal in cars() {
        let model = CarModel::new(nominal.clone().with_friction(friction)).unwrap();
        for ((from, to), throttle) in kinds(&nominal) {
            let shift = CarShift::usual(&nominal, from, to, throttle);
            let names = [from, to].map(|gear| nominal.gearbox.gears[gear].name.clone());
            let label = format!("{} {}-{} {}", nominal.gearbox.name, names[0], names[1], throttle);
            let quality = simulate_car_shift(&model, &nominal, CarCalibration::STANDARD, &shift, |_| {});
            let quality = quality.unwrap_or_else(|error| panic!("{label}: {error}"));
            println!(
                "{friction} {label:40} T {:6.1} time {:5.2} flare {:5.1} past {:5.1} tie-up {:5.1} held {:4.1} jerk {:6.1}",
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

#[test]
fn with_friction_low() {
    for (label, quality) in table(0.85) {
        assert!(quality.complete_s.is_some(), "{label}");
    }
}

#[test]
fn with_friction_high() {
    for (label, quality) in table(1.15) {
        assert!(quality.complete_s.is_some(), "{label}");
    }
}

#[test]
fn dbg_trace() {
    let Ok(which) = std::env::var("TRACE") else { return };
    let parts: Vec<&str> = which.split(',').collect();
    let nominal = cars().swap_remove(parts[0].parse().unwrap());
    let friction: f64 = parts.get(4).map_or(1.0, |f| f.parse().unwrap());
    let model = CarModel::new(nominal.clone().with_friction(friction)).unwrap();
    let g = |n: &str| nominal.gearbox.gear(n).unwrap();
    let (from, to) = (g(parts[1]), g(parts[2]));
    let shift = CarShift { sample_time_s: 0.02, ..CarShift::usual(&nominal, from, to, parts[3].parse().unwrap()) };
    let r = nominal.gearbox.shift(from, to).unwrap().reduced.unwrap();
    simulate_car_shift(&model, &nominal, CarCalibration::STANDARD, &shift, |s| {
        if let Some(sh) = &s.shift {
            let (t, o) = (s.torques.turbine_rad_s, s.torques.output_rad_s);
            println!(
                "{:.2} {:12} T {:6.1} y {:7.2} z {:7.2} zw {:7.2} Uoff {:7.1} Uon {:7.1} poff {:.3} pon {:.3} ioff {:.3} ion {:.3} share {:.2} a {:.2}",
                s.time_s, format!("{:?}", sh.stage), s.turbine_n_m, t - r.ratio_offgoing() * o, t - r.ratio_oncoming() * o,
                t - r.ratio_oncoming() * s.wheel_rad_s * nominal.driveline.final_ratio,
                r.slip_offgoing[0] * sh.offgoing.torque_n_m, r.slip_oncoming[0] * sh.oncoming.torque_n_m,
                1e-6 * sh.offgoing.pressure_pa, 1e-6 * sh.oncoming.pressure_pa, sh.offgoing.command, sh.oncoming.command, s.engine_share, s.vehicle_m_s2
            );
        }
    })
    .unwrap();
}
