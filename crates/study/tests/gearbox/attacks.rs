//! What a real car does to the filter: lost readings, other throttles, other inertias, an element that slips, single
//! precision, and input without sense.

use car::ErrorBudget;
use car::{Car, Gear, ShiftCommand};
use drivetrain::ShiftKind;
use observer::gearbox::{MAX_ELEMENTS, ShiftInput};
use observer::{ChannelHealth, Health, Reading};
use observer::{ShiftTables, gearbox_filter};
use plant::car::{CarCalibration, CarModel, CarRun, CarSample, CarShift, Driver};
use study::gearbox::{RECORD_S, ShiftDraw, ShiftScoreRow, SquaredErrors, TruePhase, inputs, score_samples, simulated};
use study::shift_learning::tables_with_inertia;

use super::cars::{Random, cars, sensors, shifts};
use super::controlling;

fn draw(car: &Car, seed: u64) -> Car {
    let mut random = Random(seed);
    ShiftDraw::within(car, &ErrorBudget::of_car(car), || random.uniform()).car(car)
}

/// A shift with a throttle that is moved a time after the request.
fn moved_throttle(known: &Car, truth: &Car, shift: &CarShift, after_s: f64, throttle: f64) -> Vec<CarSample> {
    let model = CarModel::new(truth.clone()).unwrap();
    let state = model.in_gear(shift.from, Some(shift.to), shift.vehicle_m_s, shift.throttle).unwrap();
    let driver = |throttle: f64| Driver { throttle, brake: 0.0, grade_rad: 0.0 };
    let start = (driver(shift.throttle), RECORD_S);
    let mut run = CarRun::new(&model, known, CarCalibration::STANDARD, shift.from, state, start).unwrap();
    run.preselect(Some(shift.to));
    let mut samples = Vec::new();
    let mut requested = false;
    while run.time_s() < shift.duration_s - 1e-9 {
        if !requested && run.time_s() >= shift.request_s - 1e-9 {
            run.request(shift.to).unwrap();
            requested = true;
        }
        // Over 0.1 s.
        let moved = ((run.time_s() - shift.request_s - after_s) / 0.1).clamp(0.0, 1.0);
        let now = driver(shift.throttle + moved * (throttle - shift.throttle));
        run.advance(now, |_| {}, |sample| samples.push(*sample)).unwrap();
    }
    samples
}

fn rows(known: &Car, samples: &[CarSample], seed: u64, change: impl Fn(&mut ShiftInput<f64>)) -> Vec<ShiftScoreRow> {
    let tables = ShiftTables::of_car(known, &ErrorBudget::of_car(known)).unwrap();
    let sensors = sensors();
    let filter = gearbox_filter(known, &tables, &ErrorBudget::of_car(known), Some(&sensors));
    let mut inputs = inputs(known, &tables, samples, &sensors, seed);
    inputs.iter_mut().for_each(|(_, input)| change(input));
    score_samples(&tables, &filter, samples, &inputs)
}

/// Ratio of the errors to the open loop's, of both clutches while both slip, over some shifts of the first car.
fn pooled(mut rows_of: impl FnMut(&Car, &CarShift, ShiftKind) -> Vec<ShiftScoreRow>) -> [f64; 4] {
    let car = &cars()[0];
    let mut sums = [SquaredErrors::default(); 4];
    for (from, to, throttle) in shifts(car) {
        let gears = &car.gearbox.gears;
        let kind = ShiftKind::of(throttle - 0.01, gears[from].ratio, gears[to].ratio).unwrap();
        let shift = CarShift::usual(car, from, to, throttle);
        let rows = rows_of(car, &shift, kind);
        let at = ShiftKind::ALL.iter().position(|&other| other == kind).unwrap();
        sums[at].add(&SquaredErrors::of(&rows, TruePhase::Inertia, controlling(kind)));
    }
    sums.map(|sum| {
        let [estimate, open_loop] = sum.rms_n_m();
        estimate / open_loop
    })
}

fn seed_of(shift: &CarShift) -> u64 {
    1000 + 37 * shift.from as u64 + shift.to as u64
}

/// Ratios of the kinds in their order, for a car of the budget.
fn as_usual() -> [f64; 4] {
    pooled(|car, shift, _| {
        let samples = simulated(car, &draw(car, seed_of(shift)), shift).unwrap();
        rows(car, &samples, 1, |_| {})
    })
}

#[test]
fn lost_readings_cost_little() {
    let usual = as_usual();
    let lost = pooled(|car, shift, _| {
        let samples = simulated(car, &draw(car, seed_of(shift)), shift).unwrap();
        let random = std::cell::RefCell::new(Random(seed_of(shift)));
        rows(car, &samples, 1, |input| {
            let lost = || random.borrow_mut().uniform() < 0.05;
            for reading in
                [&mut input.engine_rad_s, &mut input.turbine_rad_s, &mut input.output_rad_s, &mut input.wheel_rad_s]
            {
                if lost() {
                    *reading = None;
                }
            }
        })
    });
    println!("usual {usual:.2?}, 5 % of the readings lost {lost:.2?}");
    assert!(usual.iter().zip(&lost).all(|(usual, lost)| lost - usual < 0.15), "{usual:?} {lost:?}");
}

#[test]
fn single_outliers_cost_little() {
    let usual = as_usual();
    let wrong = pooled(|car, shift, _| {
        let samples = simulated(car, &draw(car, seed_of(shift)), shift).unwrap();
        let random = std::cell::RefCell::new(Random(seed_of(shift)));
        rows(car, &samples, 1, |input| {
            let mut random = random.borrow_mut();
            for reading in [&mut input.turbine_rad_s, &mut input.output_rad_s, &mut input.wheel_rad_s] {
                if random.uniform() < 0.01
                    && let Some(reading) = reading
                {
                    reading.value += 5.0;
                }
            }
        })
    });
    println!("usual {usual:.2?}, 1 % outliers of 5 rad/s {wrong:.2?}");
    assert!(usual.iter().zip(&wrong).all(|(usual, wrong)| wrong - usual < 0.3), "{usual:?} {wrong:?}");
}

/// How many cars make each shift with a throttle that moves: one, or for the documentation `THROTTLE_DRAWS=10`.
fn throttle_draws() -> u64 {
    std::env::var("THROTTLE_DRAWS").ok().map_or(1, |draws| draws.parse().unwrap())
}

/// The errors while both slip of the clutch that controls at that time, which is the other one after the turbine torque has
/// changed its sign; by kind. Each shift is made by some cars, which have a seed of their own.
fn of_the_controlling(mut rows_of: impl FnMut(&Car, &CarShift, u64) -> Vec<ShiftScoreRow>) -> [SquaredErrors; 4] {
    let car = &cars()[0];
    let mut sums = [SquaredErrors::default(); 4];
    for (from, to, throttle) in shifts(car) {
        let [off, on] = [from, to].map(|gear| car.gearbox.gears[gear].ratio);
        let kind = ShiftKind::of(throttle - 0.01, off, on).unwrap();
        let at = ShiftKind::ALL.iter().position(|&other| other == kind).unwrap();
        let shift = CarShift::usual(car, from, to, throttle);
        for seed in (0..throttle_draws()).map(|draw| seed_of(&shift) + 10_000 * draw) {
            for row in rows_of(car, &shift, seed) {
                let controls = usize::from(row.turbine_n_m[0] * (off - on) > 0.0);
                sums[at].add(&SquaredErrors::of(&[row], TruePhase::Inertia, controls));
            }
        }
    }
    sums
}

#[test]
fn a_throttle_that_moves_in_the_shift_swaps_the_roles_of_the_clutches() {
    let usual = as_usual();
    let mut all = [[0.0; 4]; 3];
    for (ratios, after_s) in all.iter_mut().zip([0.3, 0.45, 0.6]) {
        *ratios = pooled(|car, shift, _| {
            let throttle = if shift.throttle > 0.0 { 0.0 } else { 0.2 };
            let samples = moved_throttle(car, &draw(car, seed_of(shift)), shift, after_s, throttle);
            rows(car, &samples, 1, |_| {})
        });
    }
    let mut still = [0.0; 4];
    for after_s in [None, Some(0.3), Some(0.45), Some(0.6)] {
        let sums = of_the_controlling(|car, shift, seed| {
            let (truth, moved) = (draw(car, seed), if shift.throttle > 0.0 { 0.0 } else { 0.2 });
            let samples = match after_s {
                None => simulated(car, &truth, shift).unwrap(),
                Some(after_s) => moved_throttle(car, &truth, shift, after_s, moved),
            };
            rows(car, &samples, seed, |_| {})
        });
        let shown = sums.map(|sum| {
            let [estimate, open_loop] = sum.rms_n_m();
            format!("{:.2} ({estimate:.1} / {open_loop:.1} N m)", estimate / open_loop)
        });
        println!("moved {after_s:?}, the clutch that controls at the time: {}", shown.join(", "));
        let ratios = sums.map(|sum| sum.ratio().unwrap());
        if after_s.is_none() {
            still = ratios;
        }
        // Asked for is 0.1. One car for each shift says it no better than this.
        let maximum = if throttle_draws() >= 10 { 0.1 } else { 0.2 };
        assert!(
            ratios.iter().zip(&still).all(|(moved, still)| moved - still < maximum),
            "{after_s:?}: {ratios:?} {still:?}"
        );
    }
    println!("usual {usual:.2?}, throttle moved 0.3, 0.45, 0.6 s after the request {all:.2?}");
    assert!(all.iter().flatten().all(|&ratio| ratio < 1.0), "{all:?}");
}

#[test]
fn an_inertia_that_is_wrong_by_a_fifth_costs_little() {
    let [low, high] = [0.8, 1.2].map(|factor| {
        pooled(|car, shift, _| {
            let samples = simulated(car, &draw(car, seed_of(shift)), shift).unwrap();
            let tables = tables_with_inertia(car, factor).unwrap();
            let sensors = sensors();
            let filter = gearbox_filter(car, &tables, &ErrorBudget::of_car(car), Some(&sensors));
            let inputs = inputs(car, &tables, &samples, &sensors, 1);
            score_samples(&tables, &filter, &samples, &inputs)
        })
    });
    println!("M11 20 % low {low:.2?}, high {high:.2?}");
    assert!(low.iter().chain(&high).all(|&ratio| ratio < 0.65), "{low:?} {high:?}");
}

#[test]
fn an_element_of_the_gear_that_slips_is_said() {
    let car = &cars()[0];
    let gear = |name: &str| car.gearbox.gear(name).unwrap();
    let shift = CarShift::usual(car, gear("2"), gear("3"), 0.3);
    // B is held from 2nd to 3rd gear.
    let held = car.gearbox.elements.iter().position(|element| element.name == "B").unwrap();
    let said = |factor: f64| {
        let mut truth = car.clone();
        if let Some(clutch) = &mut truth.clutches[held] {
            clutch.clutch.friction = clutch.clutch.friction.scaled(factor);
            clutch.clutch.static_friction *= factor;
        }
        let samples = simulated(car, &truth, &shift).unwrap();
        let slips = samples.iter().filter(|sample| sample.slips_rad_s[held].abs() > 5.0).count();
        let rows = rows(car, &samples, 1, |_| {});
        (slips, rows.iter().filter(|row| row.health == Health::HeldClutchSlips).count())
    };
    let (sound, slipping) = (said(1.0), said(0.1));
    println!(
        "samples with slip and rows that say so: sound {sound:?}, friction of a held brake at a tenth {slipping:?}"
    );
    assert_eq!(sound.0, 0);
    assert!(slipping.0 > 50, "the brake does not slip");
    assert!(sound.1 <= 2 && slipping.1 > 20, "{sound:?} {slipping:?}");
}

/// Friction 15 % low, as the budget has it, and 40 % low, so that the offgoing clutch flares; no held one slips.
#[test]
fn a_flare_is_said_and_no_held_clutch_is_accused() {
    let car = &cars()[0];
    // Rows: all, truly with a flare of more than 3 rad/s, of these said, said without any, said that a held one slips.
    let [low, lower] = [0.85, 0.6].map(|factor| {
        let mut draw = ShiftDraw::none(car);
        draw.friction.iter_mut().for_each(|friction| *friction = factor);
        let truth = draw.car(car);
        let mut counts = [0_u32; 5];
        for (from, to, throttle) in shifts(car) {
            let ratios = [from, to].map(|gear| car.gearbox.gears[gear].ratio);
            let samples = simulated(car, &truth, &CarShift::usual(car, from, to, throttle)).unwrap();
            for row in rows(car, &samples, 1, |_| {}) {
                let [_, turbine, output, _] = row.speeds_rad_s;
                let flare = (turbine - ratios[0] * output) * (ratios[0] - ratios[1]).signum();
                let said = row.flare_rad_s > 0.0;
                counts[0] += 1;
                counts[1] += u32::from(flare > 3.0);
                counts[2] += u32::from(flare > 3.0 && said);
                counts[3] += u32::from(flare < 0.1 && said);
                counts[4] += u32::from(row.health == Health::HeldClutchSlips);
            }
        }
        counts
    });
    println!("rows, with a flare, said, said without one, held slips said: -15 % {low:?}, -40 % {lower:?}");
    let [rows, _, _, wrong, held] = low;
    assert!(200 * wrong < rows && 100 * held < rows);
    let [_, flares, said, ..] = lower;
    assert!(flares > 20 && 10 * said > 8 * flares);
}

/// Valves anywhere in the budget, also in lag, delay and hysteresis; one speed sensor is lost in the shift, or all readings are.
#[test]
fn the_range_is_guaranteed_whatever_is_lost() {
    type Loss = fn(&mut ShiftInput<f64>);
    let losses: [(&str, Loss); 4] = [
        ("nothing", |_| {}),
        ("turbine", |input| input.turbine_rad_s = None),
        ("output", |input| input.output_rad_s = None),
        ("all speeds", |input| {
            (input.turbine_rad_s, input.output_rad_s, input.wheel_rad_s, input.engine_rad_s) = (None, None, None, None);
        }),
    ];
    let car = &cars()[0];
    let mut random = Random(11);
    for (name, loss) in losses {
        let [mut clutches, mut ranges, mut outside] = [0_u32; 3];
        for (from, to, throttle) in shifts(car).into_iter().step_by(3) {
            let draw = ShiftDraw::within(car, &ErrorBudget::of_car(car), || random.uniform());
            let truth = draw.with_timing(&ErrorBudget::of_car(car), || random.uniform()).car(car);
            let samples = simulated(car, &truth, &CarShift::usual(car, from, to, throttle)).unwrap();
            let steps = std::cell::Cell::new(0);
            let rows = rows(car, &samples, 1, |input| {
                steps.set(steps.get() + 1);
                // From 0.3 s after the request on.
                if steps.get() > 130 {
                    loss(input);
                }
            });
            for clutch in rows.iter().flat_map(|row| row.clutches) {
                clutches += 1;
                ranges += u32::from(clutch.torque_range_n_m.is_some());
                outside += u32::from(!clutch.in_range);
            }
        }
        println!("lost {name}: {clutches} pressures and torques, {ranges} with a range, {outside} outside");
        assert!(ranges == clutches && clutches > 1000 && outside == 0, "{name}: {clutches} {ranges} {outside}");
    }
}

/// A gap that is too long to be predicted begins the filter anew, and does not carry it off.
#[test]
fn a_long_gap_in_a_shift_leaves_possible_numbers() {
    let car = &cars()[0];
    let tables = ShiftTables::of_car(car, &ErrorBudget::of_car(car)).unwrap();
    let sensors = sensors();
    let filter = gearbox_filter(car, &tables, &ErrorBudget::of_car(car), Some(&sensors));
    let (from, to, throttle) = shifts(car)[0];
    let samples = simulated(car, car, &CarShift::usual(car, from, to, throttle)).unwrap();
    let inputs = inputs(car, &tables, &samples, &sensors, 1);
    for gap_s in [0.3, 0.5, 2.0, 100.0] {
        let mut state = filter.start();
        for (at, (_, input)) in inputs.iter().enumerate() {
            let dt_s = if at == 140 { gap_s } else { input.dt_s };
            let estimate = filter.step(&mut state, &ShiftInput { dt_s, ..*input });
            let shaft = estimate.shaft_n_m.unwrap_or(0.0);
            assert!(shaft.abs() < 3000.0, "{gap_s} s, {at}: {shaft} N m");
            assert!(estimate.clutches.iter().flatten().all(|clutch| clutch.torque_n_m.abs() < 1000.0));
            if at == 140 {
                assert_ne!(estimate.health, Health::Good);
            }
        }
    }
}

/// Where both ratios are close to each other the speeds show nothing of the torque phase, and the filter says so.
#[test]
fn a_torque_that_the_speeds_do_not_show_is_said_to_be_hidden() {
    // By class of `1/|i_off - i_on|` below 2 and above 5: rows, hidden ones, squared errors there.
    let mut classes = [(0.0, 0.0, SquaredErrors::default()); 2];
    for car in &cars()[..4] {
        for (from, to, throttle) in shifts(car) {
            let gain = (car.gearbox.gears[from].ratio - car.gearbox.gears[to].ratio).abs().recip();
            let Some(class) = [gain < 2.0, gain > 5.0].iter().position(|&is| is) else { continue };
            let shift = CarShift::usual(car, from, to, throttle);
            let samples = simulated(car, &draw(car, seed_of(&shift)), &shift).unwrap();
            for row in rows(car, &samples, 1, |_| {}) {
                let Some(clutch) = (row.phase() == Some(TruePhase::Torque))
                    .then(|| row.clutches.iter().find(|clutch| !clutch.sticks))
                    .flatten()
                else {
                    continue;
                };
                classes[class].0 += 1.0;
                classes[class].1 += f64::from(u8::from(clutch.hidden));
                let [truth, estimate, open_loop] = clutch.torque_n_m;
                classes[class].2.estimate += (truth - estimate).powi(2);
                classes[class].2.open_loop += (truth - open_loop).powi(2);
                classes[class].2.rows += 1.0;
            }
        }
    }
    let shown = classes.map(|(rows, hidden, errors)| {
        let [estimate, open_loop] = errors.rms_n_m();
        (rows, hidden / rows, estimate / open_loop)
    });
    println!(
        "torque phase, gain below 2 and above 5: rows, share said to be hidden, ratio to the open loop: {shown:.2?}"
    );
    assert!(shown[1].1 > shown[0].1 && shown[1].2 < 1.05, "{shown:?}");
}

#[test]
fn single_precision_estimates_the_same() {
    let mut largest = 0.0_f64;
    let mut square = [0.0, 0.0];
    let (mut input_clutches, mut of_input_clutch) = (0, 0.0_f64);
    let (mut steps, mut time_s) = (0.0, 0.0);
    for car in cars() {
        let tables = ShiftTables::of_car(&car, &ErrorBudget::of_car(&car)).unwrap();
        let single_tables = tables.cast::<f32>();
        let sensors = sensors();
        let filter = gearbox_filter(&car, &tables, &ErrorBudget::of_car(&car), Some(&sensors));
        let single = filter.cast(single_tables.tables());
        for (from, to, throttle) in shifts(&car).into_iter().step_by(3) {
            let shift = CarShift::usual(&car, from, to, throttle);
            let samples = simulated(&car, &draw(&car, seed_of(&shift)), &shift).unwrap();
            let mut single_state = single.start();
            let inputs = inputs(&car, &tables, &samples, &sensors, 1);
            let mut estimates = Vec::with_capacity(inputs.len());
            // A machine that does other things too is left alone in one of ten times.
            time_s += (0..10).fold(f64::INFINITY, |fastest_s, _| {
                let (mut state, begun) = (filter.start(), std::time::Instant::now());
                estimates.clear();
                estimates.extend(inputs.iter().map(|(_, input)| filter.step(&mut state, input)));
                fastest_s.min(begun.elapsed().as_secs_f64())
            });
            steps += inputs.len() as f64;
            for ((_, input), estimate) in inputs.iter().zip(estimates) {
                let rounded = single.step(&mut single_state, &input.cast());
                if let (Some(clutch), Some(other)) = (estimate.input_clutch, rounded.input_clutch) {
                    input_clutches += 1;
                    of_input_clutch = of_input_clutch.max((clutch.torque_n_m - f64::from(other.torque_n_m)).abs());
                }
                if let (Some(clutches), Some(others)) = (estimate.clutches, rounded.clutches) {
                    for (clutch, other) in clutches.iter().zip(&others) {
                        let difference = clutch.torque_n_m - f64::from(other.torque_n_m);
                        largest = largest.max(difference.abs());
                        square[0] += difference * difference;
                        square[1] += 1.0;
                    }
                }
            }
        }
    }
    let rms = (square[0] / square[1]).sqrt();
    println!("{:.2} us for a step with ranges, each shift the fastest of ten times", 1e6 * time_s / steps);
    println!("single from double precision: RMS {rms:.3} N m, largest {largest:.2} N m");
    assert!(rms < 0.5, "{rms} {largest}");
    println!("clutch between engine and gearbox: largest {of_input_clutch:.3} N m of {input_clutches} steps");
    // Torques of some 100 N m in numbers of seven digits.
    assert!(input_clutches > 100 && of_input_clutch < 0.1, "{input_clutches} {of_input_clutch}");
}

/// A gear that the tables do not have is said to be none the filter can use, and no element is accused of slip; a command
/// that stays away is said of its element.
#[test]
fn an_unknown_gear_and_a_lost_command_are_said() {
    let car = &cars()[0];
    let tables = ShiftTables::of_car(car, &ErrorBudget::of_car(car)).unwrap();
    let sensors = sensors();
    let filter = gearbox_filter(car, &tables, &ErrorBudget::of_car(car), Some(&sensors));
    let gear = |name: &str| car.gearbox.gear(name).unwrap();
    let samples = simulated(car, car, &CarShift::usual(car, gear("2"), gear("3"), 0.15)).unwrap();
    let inputs = inputs(car, &tables, &samples, &sensors, 1);
    let said = |change: fn(&mut ShiftInput<f64>)| {
        let mut state = filter.start();
        let estimates = inputs.iter().take(80).enumerate().map(|(at, (_, input))| {
            let mut input = *input;
            if at >= 20 {
                change(&mut input);
            }
            filter.step(&mut state, &input)
        });
        estimates.last().unwrap()
    };
    assert_eq!(said(|_| ()).health, Health::Good);
    let unknown = said(|input| input.gear = ShiftCommand::between(63, 63));
    assert_eq!((unknown.health, unknown.gear), (Health::SpeedsRejected, None));
    // From and to neutral there are no equations.
    let not_modelled = said(|input| input.gear = ShiftCommand { from: Gear::Neutral, to: Gear::at(3) });
    assert_eq!((not_modelled.health, not_modelled.gear), (Health::ShiftNotModelled, None));
    let blind = said(|input| {
        input.gear = ShiftCommand { from: Gear::Neutral, to: Gear::at(3) };
        input.turbine_rad_s = Some(Reading::now(f64::NAN));
    });
    assert_eq!(blind.health, Health::SpeedsRejected);
    let lost = said(|input| input.commands[2] = None);
    assert_eq!((lost.commands[1], lost.commands[2]), (ChannelHealth::Good, ChannelHealth::Lost));
    // The converter's maps do without it; what makes no sense is refused.
    assert_eq!(said(|_| ()).channels.engine_torque, ChannelHealth::Unused);
    let torque = |value: f64| move |input: &mut ShiftInput<f64>| input.engine_n_m = Some(Reading::now(value));
    let mut state = filter.start();
    let mut with = |value: f64| {
        let mut input = inputs[0].1;
        torque(value)(&mut input);
        filter.step(&mut state, &input).channels.engine_torque
    };
    assert_eq!(
        [with(100.0), with(f64::NAN), with(1e9)],
        [ChannelHealth::Good, ChannelHealth::Refused, ChannelHealth::Refused]
    );
}

/// Forty seconds of driving off through several gears: one filter without a new start.
#[test]
fn one_filter_serves_a_whole_drive() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../drives/city.toml");
    let mut drive = config::DriveFile::read(&path).unwrap().drive;
    drive.segments.truncate(4);
    (drive.repetitions, drive.sample_time_s) = (1, RECORD_S);
    let car = &cars()[0];
    let model = CarModel::new(draw(car, 3)).unwrap();
    let mut samples = Vec::new();
    let summary =
        plant::car::simulate_car_drive(&model, car, CarCalibration::STANDARD, &drive, |sample| samples.push(*sample))
            .unwrap();
    let rows = rows(car, &samples, 1, |_| {});
    let restarts = rows.iter().filter(|row| row.health == Health::Restarted).count();
    let slips = rows.iter().filter(|row| row.health == Health::HeldClutchSlips).count();
    let mut sums = [SquaredErrors::default(); 2];
    for (c, sum) in sums.iter_mut().enumerate() {
        sum.add(&SquaredErrors::of(&rows, TruePhase::Inertia, c));
    }
    let ratios = sums.map(|sum| {
        let [estimate, open_loop] = sum.rms_n_m();
        estimate / open_loop
    });
    println!(
        "{} shifts, {} rows, new starts {restarts}, slip said {slips}, both slip: offgoing {:.2}, oncoming {:.2}",
        summary.shifts,
        rows.len(),
        ratios[0],
        ratios[1]
    );
    assert!(summary.shifts >= 3);
    assert_eq!(restarts, 0);
    // A clutch that grips hard may look so for a few samples.
    assert!(100 * slips <= rows.len(), "{slips} of {}", rows.len());
    assert!(ratios[1] < 0.8, "{ratios:?}");
}

/// Whatever comes in, what comes out are numbers within limits; and after it the filter works again.
#[test]
fn input_without_sense_gives_numbers_and_a_word() {
    let car = &cars()[0];
    let tables = ShiftTables::of_car(car, &ErrorBudget::of_car(car)).unwrap();
    let sensors = sensors();
    let filter = gearbox_filter(car, &tables, &ErrorBudget::of_car(car), Some(&sensors));
    let gear = |name: &str| car.gearbox.gear(name).unwrap();
    let shift = CarShift::usual(car, gear("2"), gear("3"), 0.15);
    let samples = simulated(car, car, &shift).unwrap();
    let clean = inputs(car, &tables, &samples, &sensors, 1);
    let mut random = Random(5);
    let odd = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -1.0, 1e300, -1e300, 1e-300, 1e9, -500.0];
    for _ in 0..200 {
        let mut state = filter.start();
        for (at, (_, input)) in clean.iter().enumerate() {
            let mut input = *input;
            if at < 250 && random.uniform() < 0.2 {
                let value = odd[(random.uniform() * odd.len() as f64) as usize];
                let reading = Some(Reading { value, age_s: if random.uniform() < 0.5 { 0.0 } else { value } });
                match (random.uniform() * 9.0) as usize {
                    0 => input.dt_s = value,
                    1 => input.engine_rad_s = reading,
                    2 => input.turbine_rad_s = reading,
                    3 => input.output_rad_s = reading,
                    4 => input.wheel_rad_s = reading,
                    5 => input.engine_n_m = reading,
                    6 => input.commands = [reading; MAX_ELEMENTS],
                    7 => input.lock_up_applied = true,
                    _ => {
                        let any = |random: &mut Random| (random.uniform() * 12.0) as usize;
                        input.gear = ShiftCommand::between(any(&mut random), any(&mut random));
                    }
                }
            }
            let estimate = filter.step(&mut state, &input);
            for clutch in estimate.clutches.iter().flatten() {
                let limits = &filter.limits;
                assert!((0.0..=limits.pressure_max_pa).contains(&clutch.pressure_pa), "{clutch:?}");
                assert!(clutch.torque_n_m.is_finite() && clutch.std_dev_n_m >= 0.0, "{clutch:?}");
            }
            assert!(estimate.shaft_n_m.is_none_or(f64::is_finite), "{estimate:?}");
            assert!(estimate.turbine_n_m.is_none_or(f64::is_finite), "{estimate:?}");
            if at == clean.len() - 1 {
                assert_eq!(estimate.health, Health::Good, "after half a second of clean input");
            }
        }
    }
}
