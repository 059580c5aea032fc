//! The guaranteed ranges hold for every bound that a file may state: over files with sampled bounds, and cars sampled within them.

use car::ErrorBudget;
use car::{Car, CarErrorBounds, CurrentSensor, ElementErrorBounds, Sensors};
use drivetrain::{ClutchValve, Table1, ValveMaps};
use observer::Health;
use observer::{ShiftTables, gearbox_filter};
use plant::car::{CarCalibration, CarModel, CarRun, CarSample, CarShift, Driver};
use study::gearbox::{RECORD_S, ShiftDraw, ShiftScoreRow, inputs, score_samples, simulated};

use super::cars::{Random, cars, cars_with_strokes, sensors, shifts};

/// Cars of the test; each makes two shifts.
const CARS: u64 = 300;

/// A range around 1 with an end on either side, or on one side alone.
fn factors(random: &mut Random, below: f64, above: f64) -> [f64; 2] {
    let side = random.uniform();
    let [low, high] = [below * random.uniform(), above * random.uniform()];
    if side < 0.25 {
        [1.0, 1.0 + high]
    } else if side < 0.5 {
        [1.0 - low, 1.0]
    } else {
        [1.0 - low, 1.0 + high]
    }
}

/// A file whose valves have a delay and a hysteresis of their own, and whose elements state some of their bounds.
fn file_with_bounds(car: &Car, random: &mut Random) -> Car {
    let mut car = car.clone();
    let mut elements = vec![ElementErrorBounds::default(); car.clutches.len()];
    for (own, clutch) in elements.iter_mut().zip(&mut car.clutches) {
        let Some(clutch) = clutch else { continue };
        if random.uniform() < 0.5 {
            let delay_s = 0.1 * random.uniform();
            clutch.valve = clutch.valve.changed(1.0, 1.0, Some(delay_s));
        }
        clutch.hysteresis_pa = 100e3 * random.uniform() * f64::from(u8::from(random.uniform() < 0.5));
        let mut stated = || random.uniform() < 0.7;
        let [friction, gain, lag, delay, hysteresis, command] = [(); 6].map(|()| stated());
        let [shortest_s, longest_s] = clutch.valve.delay_range();
        *own = ElementErrorBounds {
            friction_factor: friction.then(|| factors(random, 0.4, 0.5)),
            valve_gain_factor: gain.then(|| factors(random, 0.3, 0.35)),
            valve_lag_factor: lag.then(|| factors(random, 0.7, 1.5)),
            valve_delay_s: delay.then(|| {
                let [less, more] = [random.uniform(), random.uniform()];
                [(1.0 - less) * shortest_s, longest_s + 0.06 * more]
            }),
            valve_hysteresis_pa: hysteresis.then(|| clutch.hysteresis_pa + 30e3 * random.uniform()),
            command: command.then(|| 0.03 * random.uniform()),
        };
    }
    let converter_share = (random.uniform() < 0.5).then(|| 0.3 * random.uniform());
    car.error_bounds = CarErrorBounds { converter_share, elements, ..CarErrorBounds::default() };
    car
}

/// A map whose values are those of another times factors within this range, each its own.
fn reshaped(map: &Table1<f64>, [low, high]: [f64; 2], random: &mut Random) -> Table1<f64> {
    let values: Vec<f64> = map.values().iter().map(|value| value * (low + (high - low) * random.uniform())).collect();
    Table1::new(map.axis(), &values).unwrap()
}

/// The car with valve maps of another shape than those of the file, within its bounds. A gain map whose pressure would not rise with the
/// current is scaled as a whole.
fn with_other_maps(mut car: Car, known: &Car, budget: &ErrorBudget, random: &mut Random) -> Car {
    for (element, clutch) in car.clutches.iter_mut().enumerate() {
        let (Some(clutch), Some(Some(of_file)), Some(errors)) =
            (clutch, known.clutches.get(element), budget.element(element))
        else {
            continue;
        };
        let ClutchValve::Proportional(maps) = &of_file.valve else { continue };
        let mut gain = reshaped(&maps.gain_pa_a, errors.valve_gain_factor, random);
        let rises = |gain: &Table1<f64>| {
            let pressures = (0..=200).map(|at| 0.01 * f64::from(at)).map(|current| gain.at(current) * current);
            pressures.collect::<Vec<_>>().windows(2).all(|pair| pair[1] > pair[0])
        };
        if !rises(&gain) {
            let factor = errors.valve_gain_factor[usize::from(random.uniform() < 0.5)];
            gain = maps.gain_pa_a.scaled(factor);
        }
        let [shortest_s, longest_s] = errors.valve_delay_s;
        let delays = [(); 3].map(|()| shortest_s + (longest_s - shortest_s) * random.uniform());
        clutch.valve = ClutchValve::Proportional(ValveMaps {
            time_constant_s: reshaped(&maps.time_constant_s, errors.valve_lag_factor, random),
            gain_pa_a: gain,
            delay_s: Table1::new(&[0.0, 0.4, 1.0], &delays).unwrap(),
        });
    }
    car
}

/// Sensors whose current has an error within that of all elements; a filter that knows them has them in its budget, however large it is.
fn sensors_within(budget: &ErrorBudget, is_known: bool, random: &mut Random) -> Sensors {
    let of_elements = budget.elements.iter().flatten().map(|element| element.command).fold(f64::INFINITY, f64::min);
    let smallest_a = if is_known { 0.12 } else { of_elements };
    let noise_a = 0.1 * smallest_a * random.uniform();
    let resolution_a = 0.2 * smallest_a * random.uniform();
    let rest_a = smallest_a - 5.0 * noise_a - 0.5 * resolution_a;
    let offset_a = rest_a * (2.0 * random.uniform() - 1.0);
    Sensors { current: Some(CurrentSensor { noise_a, offset_a, resolution_a, ..CurrentSensor::EXACT }), ..sensors() }
}

/// The rows of a shift by a filter that does not know the sensor of the current where `knows` is false.
fn scored(
    known: &Car,
    truth: &Car,
    controller: &Car,
    shift: &CarShift,
    sensors: &Sensors,
    knows: bool,
    seed: u64,
) -> Vec<ShiftScoreRow> {
    let of_filter = Sensors { current: sensors.current.filter(|_| knows), ..*sensors };
    let budget = ErrorBudget::of_car(known).read_by(known, Some(&of_filter));
    let tables = ShiftTables::of_car(known, &budget).unwrap();
    let filter = gearbox_filter(known, &tables, &budget, Some(&of_filter));
    let samples = simulated(controller, truth, shift).unwrap();
    let mut inputs = inputs(known, &tables, &samples, sensors, seed);
    if let Some(current) = &sensors.current {
        let mut random = Random(seed);
        for reading in inputs.iter_mut().flat_map(|(_, input)| input.commands.iter_mut().flatten()) {
            // Of twelve uniform numbers the sum is nearly normal, and within six standard deviations.
            let normal = (0..12).map(|_| random.uniform()).sum::<f64>() - 6.0;
            let read_a = reading.value + current.offset_a + current.noise_a * normal;
            reading.value = (read_a / current.resolution_a).round() * current.resolution_a;
        }
    }
    score_samples(&tables, &filter, &samples, &inputs)
}

#[test]
fn ranges_hold_in_cars_within_the_bounds_that_their_file_states() {
    let cars = [cars(), cars_with_strokes()].concat();
    let (mut values, mut refused, mut outside) = (0_u64, 0_u64, Vec::new());
    for number in 0..CARS {
        let mut random = Random(number.wrapping_mul(0x9e37_79b9) + 17);
        let at = usize::try_from(number).unwrap() % cars.len();
        let known = file_with_bounds(&cars[at], &mut random);
        let budget = ErrorBudget::of_car(&known);
        let draw = ShiftDraw::within(&known, &budget, || random.uniform());
        let draw = draw.with_timing(&budget, || random.uniform()).with_strokes(&known, || random.uniform());
        let mut truth = draw.car(&known);
        match number % 4 {
            // The car is that of its file.
            0 => truth = known.clone(),
            2 => {}
            _ => truth = with_other_maps(truth, &known, &budget, &mut random),
        }
        let all = shifts(&known);
        for _ in 0..2 {
            let (from, to, throttle) = all[(random.uniform() * all.len() as f64) as usize];
            let [controller_knows, filter_knows] = [random.uniform() < 0.5, random.uniform() < 0.5];
            let sensors = sensors_within(&budget, filter_knows, &mut random);
            let controller = if controller_knows { &truth } else { &known };
            let shift = CarShift::usual(&known, from, to, throttle);
            for row in scored(&known, &truth, controller, &shift, &sensors, filter_knows, number) {
                refused += u64::from(row.health == Health::CommandRejected);
                for (c, clutch) in row.clutches.iter().enumerate() {
                    values += 1;
                    if !clutch.in_range {
                        outside.push(format!(
                            "{} car {number} {from}-{to} clutch {c} at {:.3} s: {:.0} Pa {:?}, {:.1} N m {:?}",
                            known.gearbox.name,
                            row.time_s,
                            clutch.pressure_pa[0],
                            clutch.pressure_range_pa,
                            clutch.torque_n_m[0],
                            clutch.torque_range_n_m
                        ));
                    }
                }
            }
        }
    }
    println!("{} of {values} pressures and torques outside", outside.len());
    outside.iter().take(30).for_each(|line| println!("{line}"));
    println!("{refused} rows with a refused command");
    assert!(outside.is_empty() && refused == 0 && values > 50_000, "{} of {values}, {refused} refused", outside.len());
}

/// Valves so weak, within what the file states, that an element which is engaged in both gears slips: the slips of the clutches are then not
/// those of the speeds.
#[test]
fn ranges_hold_where_an_element_that_stays_engaged_may_slip() {
    let (mut values, mut slipped, mut outside) = (0_u64, 0_u64, Vec::new());
    for (number, known) in cars().iter().cycle().take(48).enumerate() {
        let mut random = Random(number as u64 + 3);
        let mut known = known.clone();
        let factor = 2.0 + 8.0 * random.uniform();
        let wide =
            ElementErrorBounds { valve_gain_factor: Some([factor.recip(), factor]), ..ElementErrorBounds::default() };
        known.error_bounds.elements = vec![wide; known.clutches.len()];
        let budget = ErrorBudget::of_car(&known);
        let truth = ShiftDraw::within(&known, &budget, || random.uniform()).car(&known);
        let all = shifts(&known);
        for _ in 0..3 {
            let (from, to, throttle) = all[(random.uniform() * all.len() as f64) as usize];
            let shift = CarShift::usual(&known, from, to, throttle);
            for row in scored(&known, &truth, &known, &shift, &sensors(), true, number as u64) {
                let [off, on] = row.clutches;
                // Both cannot stick between the gears.
                let [turbine, output] = [row.speeds_rad_s[1], row.speeds_rad_s[2]];
                let between = known.gearbox.gears[from].ratio.mul_add(-output, turbine).abs() > 5.0;
                slipped += u64::from(off.sticks && between);
                for (c, clutch) in [off, on].into_iter().enumerate() {
                    values += 1;
                    if !clutch.in_range {
                        outside.push(format!(
                            "{} car {number} {from}-{to} clutch {c} at {:.3} s: {:.1} N m {:?}",
                            known.gearbox.name, row.time_s, clutch.torque_n_m[0], clutch.torque_range_n_m
                        ));
                    }
                }
            }
        }
    }
    println!(
        "{} of {values} pressures and torques outside; {slipped} rows with an engaged element that slips",
        outside.len()
    );
    outside.iter().take(30).for_each(|line| println!("{line}"));
    assert!(outside.is_empty() && values > 10_000 && slipped > 20, "{} of {values}, {slipped} slip", outside.len());
}

/// What the file states of one element is nothing about the others.
#[test]
fn wide_bounds_of_one_clutch_leave_shifts_of_other_clutches_as_they_are() {
    let mut compared = 0;
    for known in [cars(), cars_with_strokes()].concat().into_iter().step_by(3) {
        let [(from, to, throttle), ..] = shifts(&known)[..] else { continue };
        let shifting = known.gearbox.shift(from, to).unwrap().change.single().unwrap();
        let mut wide = known.clone();
        wide.error_bounds.elements = vec![ElementErrorBounds::default(); known.clutches.len()];
        for (at, element) in wide.error_bounds.elements.iter_mut().enumerate() {
            if !shifting.contains(&at) {
                // Only upwards: then elements that stay engaged hold as before.
                element.friction_factor = Some([0.85, 1.6]);
                element.valve_lag_factor = Some([0.3, 2.5]);
            }
        }
        let shift = CarShift::usual(&known, from, to, throttle);
        let [usual, wide] = [&known, &wide].map(|car| scored(car, &known, &known, &shift, &sensors(), true, 3));
        for (usual, wide) in usual.iter().zip(&wide) {
            for (usual, wide) in usual.clutches.iter().zip(&wide.clutches) {
                assert_eq!((usual.torque_n_m, usual.pressure_pa), (wide.torque_n_m, wide.pressure_pa));
                compared += 1;
            }
        }
    }
    assert!(compared > 500, "{compared}");
}

/// A dual clutch that leaves a gear two steps below at once: the oncoming clutch of the second shift has just been the offgoing one of the
/// first, and its shaft turns at the ratio of the old gear until the dog of the new one is in.
#[test]
fn ranges_hold_while_a_dog_is_not_in_yet() {
    let mut known = cars().pop().unwrap();
    // Valves so slow that the clutch still carries torque when its shaft is to turn at the other ratio.
    let slow = ElementErrorBounds { valve_lag_factor: Some([0.8, 4.0]), ..ElementErrorBounds::default() };
    known.error_bounds.elements = vec![slow; known.clutches.len()];
    let budget = ErrorBudget::of_car(&known);
    let tables = ShiftTables::of_car(&known, &budget).unwrap();
    let sensors = sensors();
    let filter = gearbox_filter(&known, &tables, &budget, Some(&sensors));
    let forward = known.gearbox.forward_gears();
    let (mut values, mut outside) = (0_u64, Vec::new());
    for (number, gears) in forward.windows(3).rev().cycle().take(30).enumerate() {
        let mut random = Random(number as u64 + 5);
        let draw = ShiftDraw::within(&known, &budget, || random.uniform());
        let truth = draw.with_timing(&budget, || random.uniform()).car(&known);
        // Every other one coasts.
        let throttle = 0.6 * random.uniform() * (number % 2) as f64;
        let shift = CarShift::usual(&known, gears[2], gears[1], throttle);
        let samples = two_shifts(&known, &truth, &shift, gears[0]);
        let inputs = inputs(&known, &tables, &samples, &sensors, number as u64);
        for row in score_samples(&tables, &filter, &samples, &inputs) {
            for (c, clutch) in row.clutches.iter().enumerate() {
                values += 1;
                if !clutch.in_range {
                    outside.push(format!(
                        "{gears:?} clutch {c} at {:.3} s: {:.1} N m {:?}",
                        row.time_s, clutch.torque_n_m[0], clutch.torque_range_n_m
                    ));
                }
            }
        }
    }
    println!("{} of {values} pressures and torques outside", outside.len());
    outside.iter().take(30).for_each(|line| println!("{line}"));
    assert!(outside.is_empty() && values > 2_000, "{} of {values}", outside.len());
}

/// A shift, and at its request one further, which the controller makes when the first is complete.
fn two_shifts(known: &Car, truth: &Car, shift: &CarShift, last: usize) -> Vec<CarSample> {
    let model = CarModel::new(truth.clone()).unwrap();
    let state = model.in_gear(shift.from, Some(shift.to), shift.vehicle_m_s, shift.throttle).unwrap();
    let driver = Driver { throttle: shift.throttle, brake: 0.0, grade_rad: 0.0 };
    let mut run = CarRun::new(&model, known, CarCalibration::STANDARD, shift.from, state, (driver, RECORD_S)).unwrap();
    run.preselect(Some(shift.to));
    let (mut samples, mut requested) = (Vec::new(), false);
    while run.time_s() < shift.duration_s + 2.0 {
        if !requested && run.time_s() >= shift.request_s - 1e-9 {
            run.request(last).unwrap();
            requested = true;
        }
        run.advance(driver, |_| {}, |sample| samples.push(*sample)).unwrap();
    }
    samples
}
