//! Cars whose pistons have a stroke, with other volumes, return springs, passages and oil than those that the filter knows.

use design::{ShiftErrors, ShiftTables};
use observer::any_shift::Learnt;
use study::any_shift::ShiftDraw;
use study::shift_learning::{filter, tables_with_inertia};

use crate::cars::{Random, cars_with_strokes, sensors};
use crate::learning::{Drive, Errors, SHIFTS};
use crate::{draws, is_not_worse_than_the_open_loop, print, rows};

/// The numbers of the documentation: `MATRIX_DRAWS=40 cargo test --release -p study --test any_shift strokes -- --nocapture`.
#[test]
fn matrix_of_cars_with_strokes() {
    for timing in [false, true] {
        let rows = rows(&cars_with_strokes(), draws(), timing);
        println!("strokes{}:", if timing { ", and lag, delay and hysteresis of the valves" } else { "" });
        print(&rows);
        is_not_worse_than_the_open_loop(&rows);
    }
}

/// Errors of the kiss points of all elements, by the valve model's pressure, that are left with what is learnt; and without, Pa.
fn kiss_errors_pa(known: &config::Car, truth: &config::Car, draw: &ShiftDraw, learnt: &Learnt<f64>) -> [f64; 2] {
    let tables = tables_with_inertia(known, 1.0).unwrap();
    let (sensors, mut sums) = (sensors(), [0.0; 2]);
    let filter = filter(known, &tables, &sensors);
    for (element, clutches) in known.clutches.iter().zip(&truth.clutches).enumerate() {
        let (Some(place), (Some(known), Some(truth))) = (tables.place(element), clutches) else { continue };
        let kiss_pa = |clutch: &config::ShiftClutch| clutch.clutch.kiss_pressure();
        let error_pa = kiss_pa(truth) / draw.valve_gain[element] - kiss_pa(known);
        let found_pa = filter.learnt_element(learnt, place).unwrap().kiss_pa[0];
        sums[0] += (error_pa - found_pa).powi(2);
        sums[1] += error_pa.powi(2);
    }
    sums
}

/// A fill that ends early or late is not learnt as another kiss point: what is learnt of it is nearer to the truth than nothing.
#[test]
fn kiss_points_are_learnt_in_cars_with_strokes() {
    let car = cars_with_strokes().remove(0);
    assert!(ShiftTables::of_car(&car, &ShiftErrors::STANDARD).unwrap().tables().elements[0].piston.is_some());
    let (mut sums, mut kiss) = ([Errors::default(), Errors::default()], [0.0; 2]);
    for seed in 1..=2 * crate::learning::draws() {
        let mut random = Random(seed * 77);
        let draw = ShiftDraw::within(&car, &ShiftErrors::STANDARD, || random.uniform());
        let draw = draw.with_strokes(&car, || random.uniform());
        let truth = draw.car(&car);
        let drive = Drive::of(&car, &truth, seed);
        sums[0].add(&drive.after(0, 1.0, seed).1);
        let (learnt, errors) = drive.after(SHIFTS, 1.0, seed);
        sums[1].add(&errors);
        let of_car = kiss_errors_pa(&car, &truth, &draw, &learnt);
        println!("car {seed}: kiss points {:.1} of {:.1} kPa", of_car[0].sqrt() / 1e3, of_car[1].sqrt() / 1e3);
        kiss = [kiss[0] + of_car[0], kiss[1] + of_car[1]];
    }
    println!("unlearnt {}\n  after {SHIFTS} shifts {}", sums[0].show(), sums[1].show());
    let [before, learnt] = sums.map(|sum| sum.all()[0]);
    assert!(learnt < before, "{learnt} {before}");
    assert!(kiss[0] < kiss[1], "{kiss:?}");
}
