//! What coasting down in neutral would tell of rolling resistance and air drag: prints the errors over many roads.
//!
//! The two-speed car rolls from 110 to 15 km/h. Its mass is taken as known, so these are the errors of both forces over the mass. The road has a mean
//! grade and one that changes over 100 m, and there is a wind along it, each with the standard deviation that is printed. The speed is
//! read at 100 Hz with 0.02 rad/s of noise at the wheels. Least squares on the changes of the speed over 0.5 s, one way and both ways.
//!
//! `cargo run --release -p fit --example coast_down`
#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a measurement may panic, and this one prints a table")]

use config::VehicleFile;
use drivetrain::RoadLoad;
use drivetrain::road::GRAVITY_M_S2;
use nalgebra::{Matrix2, Vector2};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

const ROADS: u32 = 200;
const SPEEDS_M_S: [f64; 2] = [30.0, 4.0];
const GRADE_M: f64 = 100.0;
/// Mean grade and changing grade, rad, and wind, m/s: a straight in the country that is believed to be level, the same without one of them, and a test track.
const ROADS_OF: [[f64; 3]; 4] = [[0.003, 0.005, 2.0], [0.003, 0.0, 2.0], [0.003, 0.005, 0.0], [0.0005, 0.001, 1.0]];
const NOISE_RAD_S: f64 = 0.02;
const STEP_S: f64 = 0.01;
/// Readings in a change of the speed.
const READINGS: usize = 50;

/// Grade along a road, rad, at every metre.
fn road([mean_rad, changing_rad]: [f64; 2], random: &mut Pcg64Mcg) -> Vec<f64> {
    let mut normal = || -> f64 { StandardNormal.sample(&mut *random) };
    let (mean, stays) = (mean_rad * normal(), (-1.0 / GRADE_M).exp());
    let mut slowly = changing_rad * normal();
    let next = |_| {
        slowly = stays * slowly + changing_rad * (1.0 - stays * stays).sqrt() * normal();
        mean + slowly
    };
    (0..4000).map(next).collect()
}

/// Speeds of a car that coasts down a road, m/s, from its begin or backwards from its end, against a wind.
fn coasted(load: &RoadLoad<f64>, grades: &[f64], is_back: bool, wind_m_s: f64, random: &mut Pcg64Mcg) -> Vec<f64> {
    let (mut speed, mut way_m, mut read) = (SPEEDS_M_S[0], 0.0_f64, Vec::new());
    while speed > SPEEDS_M_S[1] {
        let noise: f64 = StandardNormal.sample(random);
        read.push(speed + load.wheel_radius_m * NOISE_RAD_S * noise);
        let at = (way_m as usize).min(grades.len() - 1);
        let grade = if is_back { -grades[grades.len() - 1 - at] } else { grades[at] };
        let force = load.rolling_moment_n_m / load.wheel_radius_m + load.drag_force(speed + wind_m_s);
        speed -= STEP_S * (force / load.mass_kg + GRAVITY_M_S2 * grade.sin());
        way_m += STEP_S * speed;
    }
    read
}

/// Rolling resistance and air drag over the true ones, less 1, by the changes of these speeds.
fn fitted(load: &RoadLoad<f64>, drives: &[Vec<f64>]) -> Vector2<f64> {
    let (mut matrix, mut right) = (Matrix2::zeros(), Vector2::zeros());
    for speeds in drives {
        for part in speeds.windows(READINGS + 1).step_by(READINGS) {
            let mean = part.iter().sum::<f64>() / part.len() as f64;
            let by = [load.rolling_moment_n_m / load.wheel_radius_m, load.drag_force(mean)];
            let row = Vector2::from(by.map(|force| force / load.mass_kg));
            matrix += row * row.transpose();
            right += row * (part[0] - part[READINGS]) / (READINGS as f64 * STEP_S);
        }
    }
    matrix.try_inverse().unwrap() * right - Vector2::new(1.0, 1.0)
}

/// RMS errors over roads, one way or two.
fn errors(load: &RoadLoad<f64>, is_other: Option<bool>, of: [f64; 3], random: &mut Pcg64Mcg) -> [f64; 2] {
    let [mean_rad, changing_rad, wind_m_s] = of;
    let mut squares = [0.0; 2];
    for _ in 0..ROADS {
        let grades = road([mean_rad, changing_rad], random);
        let wind = wind_m_s * Distribution::<f64>::sample(&StandardNormal, random);
        let mut drives = vec![coasted(load, &grades, false, wind, random)];
        if let Some(is_back) = is_other {
            // Back over the same part of the road.
            let way_m: f64 = drives[0].iter().map(|speed| STEP_S * speed).sum();
            let part = &grades[..(way_m as usize).clamp(1, grades.len())];
            drives.push(coasted(load, part, is_back, if is_back { -wind } else { wind }, random));
        }
        let error = fitted(load, &drives);
        squares.iter_mut().zip(error.iter()).for_each(|(sum, error)| *sum += error * error);
    }
    squares.map(|sum| (sum / f64::from(ROADS)).sqrt())
}

fn main() {
    let load = VehicleFile::built_in().unwrap().road;
    let mut random = Pcg64Mcg::new(0xcafe_f00d_d15e_a5e5);
    for of in ROADS_OF {
        let [mean_rad, changing_rad, wind_m_s] = of;
        println!("mean grade {mean_rad} rad, changing grade {changing_rad} rad, wind {wind_m_s} m/s");
        for (case, is_other) in [("one way", None), ("twice the same way", Some(false)), ("both ways", Some(true))] {
            let [rolling, air] = errors(&load, is_other, of, &mut random).map(|error| 100.0 * error);
            println!("  {case}: rolling resistance {rolling:.1} %, air drag {air:.1} % RMS error");
        }
    }
    let weight = load.mass_kg * GRAVITY_M_S2 * load.wheel_radius_m;
    println!("rolling resistance {:.4} of the weight; known before: 29 % and 17 %", load.rolling_moment_n_m / weight);
}
