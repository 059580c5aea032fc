//! The filter for any shift, over the shifts of the shipped gearboxes, behind toothed wheels, in cars whose clutches, valves
//! and converters are not those it knows.

#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a test may")]

mod attacks;
mod cars;
mod learning;

use std::collections::BTreeMap;

use cars::{Random, cars, sensors, shifts, usual};
use config::Car;
use drivetrain::{ClutchValve, ShiftKind, Table1};
use observer::Health;
use study::any_shift::{ShiftDraw, ShiftScoreRow, SquaredErrors, TruePhase, score_shift};

/// Shifts are pooled by kind, phase, whether the clutch is the one that controls, and class of `1/|i_off - i_on|`.
type Pool = BTreeMap<(String, TruePhase, bool, usize), SquaredErrors>;

fn class(gain: f64) -> usize {
    usize::from(gain >= 2.0) + usize::from(gain >= 5.0)
}

/// The clutch that drives the inertia phase.
pub(crate) fn controlling(kind: ShiftKind) -> usize {
    match kind {
        ShiftKind::PowerOnUp | ShiftKind::CoastDown => 1,
        ShiftKind::PowerOnDown | ShiftKind::PowerOffUp => 0,
    }
}

/// Where the open loop errs by less than this over a shift there is nothing to gain, N m.
const NOTHING_N_M: f64 = 2.0;

struct Matrix {
    pool: Pool,
    /// Runs, and those in which the filter is worse than the open loop by more than 1 N m.
    runs: [u32; 2],
    /// Rows, those in which a pressure or torque is outside its guaranteed range, and those that say that an element slips.
    rows: [u32; 3],
    /// Pressures and torques without a range.
    unranged: usize,
}

fn matrix(draws: u64, verbose: bool) -> Matrix {
    let mut matrix = Matrix { pool: Pool::new(), runs: [0; 2], rows: [0; 3], unranged: 0 };
    let sensors = sensors();
    for car in cars() {
        for (from, to, throttle) in shifts(&car) {
            let gears = &car.gearbox.gears;
            let kind = ShiftKind::of(throttle - 0.01, gears[from].ratio, gears[to].ratio).unwrap();
            let gain = (gears[from].ratio - gears[to].ratio).abs().recip();
            let mut sums = BTreeMap::<(TruePhase, usize), SquaredErrors>::new();
            for seed in 1..=draws {
                let mut random = Random(seed * 1000 + from as u64 * 37 + to as u64);
                let errors = design::ShiftErrors::STANDARD;
                let mut truth = ShiftDraw::within(&car, &errors, || random.uniform()).car(&car);
                leave_out(&mut truth);
                let rows = score_shift(&car, &truth, &usual(&car, from, to, throttle), &sensors, seed).unwrap();
                matrix.rows[0] += 2 * rows.len() as u32;
                matrix.rows[1] +=
                    rows.iter().flat_map(|row| row.clutches).filter(|clutch| !clutch.in_range).count() as u32;
                let clutches = rows.iter().flat_map(|row| row.clutches);
                matrix.unranged += clutches.filter(|clutch| clutch.torque_range_n_m.is_none()).count();
                matrix.rows[2] += rows.iter().filter(|row| row.health == Health::HeldClutchSlips).count() as u32;
                for row in rows.iter().filter(|row| row.clutches.iter().any(|clutch| !clutch.in_range)) {
                    println!("  outside its range: {} {from} {to} {throttle} {seed} {row:?}", car.gearbox.name);
                }
                for phase in [TruePhase::Torque, TruePhase::Inertia] {
                    for c in 0..2 {
                        let sum = SquaredErrors::of(&rows, phase, c);
                        sums.entry((phase, c)).or_default().add(&sum);
                        let [estimate, open_loop] = sum.rms_n_m();
                        if sum.rows >= 3.0 && c == controlling(kind) {
                            matrix.runs[0] += 1;
                            let worse = estimate > open_loop + 1.0;
                            matrix.runs[1] += u32::from(worse);
                            if verbose && worse {
                                println!("  worse: seed {seed} {phase:?} {estimate:.1} / {open_loop:.1}");
                            }
                        }
                    }
                }
            }
            let main = controlling(kind);
            if verbose {
                let show = |phase, c| match sums.get(&(phase, c)) {
                    Some(sum) if sum.rows > 0.0 => {
                        let [a, b] = sum.rms_n_m();
                        let (torque, time) = (sum.torque / sum.rows, sum.rows * 10.0 / draws as f64);
                        format!("{:5.2} ({torque:5.1}; {a:5.1}/{b:5.1}, {time:3.0} ms)", a / b)
                    }
                    _ => "-".to_owned(),
                };
                println!(
                    "{:18} {:>2}-{:<2} {kind:?} g {gain:.2}: torque {} inertia {} other {}",
                    car.gearbox.name,
                    gears[from].name,
                    gears[to].name,
                    show(TruePhase::Torque, main),
                    show(TruePhase::Inertia, main),
                    show(TruePhase::Inertia, 1 - main)
                );
            }
            for ((phase, c), sum) in sums {
                if sum.rows > 0.0 && sum.rms_n_m()[1] > NOTHING_N_M {
                    matrix.pool.entry((format!("{kind:?}"), phase, c == main, class(gain))).or_default().add(&sum);
                }
            }
        }
    }
    matrix
}

/// Takes out of the true car what the filter has no model of, to see what it costs: `WITHOUT="drag delay"`.
fn leave_out(truth: &mut Car) {
    let Ok(what) = std::env::var("WITHOUT") else { return };
    for clutch in truth.clutches.iter_mut().flatten() {
        if what.contains("drag") {
            clutch.drag_n_m = 0.0;
        }
        if what.contains("delay")
            && let ClutchValve::Proportional(maps) = &mut clutch.valve
        {
            // The middle of the budget, as the filter takes it.
            maps.delay_s = Table1::constant(0.015);
        }
    }
}

fn print(matrix: &Matrix) {
    for ((kind, phase, main, class), sum) in &matrix.pool {
        let [a, b] = sum.rms_n_m();
        let which = if *main { "controlling" } else { "other" };
        let torque = sum.torque / sum.rows;
        println!("{kind:12} {phase:?} {which:11} class {class}: {:.2} ({torque:.0} N m; {a:.1} / {b:.1})", a / b);
    }
    println!("worse than the open loop by more than 1 N m: {} of {} runs", matrix.runs[1], matrix.runs[0]);
    println!("outside the guaranteed range: {} of {}", matrix.rows[1], matrix.rows[0]);
    println!("rows that say that an element slips: {}", matrix.rows[2]);
}

/// The numbers of the documentation: `MATRIX_DRAWS=10 cargo test --release -p study --test any_shift matrix -- --nocapture`.
#[test]
fn matrix_of_shifts_and_kinds() {
    let draws = std::env::var("MATRIX_DRAWS").ok().map_or(1, |draws| draws.parse().unwrap());
    let matrix = matrix(draws, std::env::var("MATRIX_VERBOSE").is_ok());
    print(&matrix);
    assert_eq!(matrix.rows[1], 0, "guaranteed");
    assert_eq!(matrix.unranged, 0, "every pressure and torque has a range");
    // The bars are for ten draws and by class; over all classes one draw already says this.
    for (kind, bar) in [("PowerOnUp", 0.45), ("PowerOnDown", 0.6), ("PowerOffUp", 0.8), ("CoastDown", 0.55)] {
        let mut all = SquaredErrors::default();
        let inertia = |key: &&(String, TruePhase, bool, usize)| key.0 == kind && key.1 == TruePhase::Inertia && key.2;
        matrix.pool.keys().filter(inertia).for_each(|key| all.add(&matrix.pool[key]));
        let [estimate, open_loop] = all.rms_n_m();
        println!("{kind}, inertia phase, all classes: {:.2}", estimate / open_loop);
        assert!(estimate < bar * open_loop, "{kind}: {estimate} / {open_loop}");
    }
}

/// One shift, row by row: `SHIFT="8hp 1 2 0.15 7"` is gearbox, gears, throttle and seed.
#[test]
fn one_shift() {
    let Ok(name) = std::env::var("SHIFT") else { return };
    let parts: Vec<&str> = name.split(' ').collect();
    let car = cars().into_iter().find(|car| car.source.text.contains(parts[0])).unwrap();
    let gear = |name: &str| car.gearbox.gear(name).unwrap();
    let shift = usual(&car, gear(parts[1]), gear(parts[2]), parts[3].parse().unwrap());
    let seed: u64 = parts[4].parse().unwrap();
    let mut random = Random(seed * 1000 + shift.from as u64 * 37 + shift.to as u64);
    let errors = design::ShiftErrors::STANDARD;
    let draw = if seed == 0 { ShiftDraw::none(&car) } else { ShiftDraw::within(&car, &errors, || random.uniform()) };
    println!("{draw:?}");
    let rows: Vec<ShiftScoreRow> = score_shift(&car, &draw.car(&car), &shift, &sensors(), seed).unwrap();
    for row in rows {
        let [off, on] = row.clutches;
        let torque = |clutch: &study::any_shift::ClutchRow| {
            let [truth, estimate, open_loop] = clutch.torque_n_m;
            format!(
                "{}{truth:7.1} {estimate:7.1} {open_loop:7.1} p {:.3} {:.3}",
                if clutch.sticks { "*" } else { " " },
                clutch.pressure_pa[0] / 1e6,
                clutch.pressure_pa[2] / 1e6
            )
        };
        println!(
            "{:.2} {:<15} off {}  on {}  Tt {:.3} {:.1} {} {:?}",
            row.time_s,
            row.phase,
            torque(&off),
            torque(&on),
            row.turbine_n_m[0],
            row.turbine_n_m[1],
            row.health.name(),
            row.speeds_rad_s
        );
    }
}
