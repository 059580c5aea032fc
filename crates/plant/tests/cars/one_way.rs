//! A gear that a one-way clutch holds: shifts from it and to it, coasting, a change of mind, engine braking.

use drivetrain::PeakJerk;
use plant::car::{CarCalibration, CarModel, CarRun, CarSample, CarShift, CarShiftQuality, Driver, simulate_car_shift};

use super::{HeldGear, one_way, with_stroke};

/// Simulates a shift; each sample with the slip of the one-way clutch, rad/s, and its torque, N m.
fn shift(model: &CarModel, names: [&str; 2], throttle: f64) -> (CarShiftQuality, Vec<(CarSample, [f64; 2])>) {
    let gearbox = &model.car.gearbox;
    let [from, to] = names.map(|name| gearbox.gear(name).unwrap());
    let one_way = gearbox.one_way_clutch_of(gearbox.gear("1").unwrap()).unwrap();
    let shift = CarShift::usual(&model.car, from, to, throttle);
    let (mut samples, mut held) = (Vec::new(), HeldGear::default());
    let quality = simulate_car_shift(model, &model.car, CarCalibration::STANDARD, &shift, |sample| {
        held.check(&model.car, sample, &format!("{names:?}, throttle {throttle}"));
        samples.push((*sample, [sample.slips_rad_s[one_way], sample.torques.elements_n_m[one_way]]));
    });
    (quality.unwrap(), samples)
}

fn driver(throttle: f64) -> Driver {
    Driver { throttle, brake: 0.0, grade_rad: 0.0 }
}

/// A car that has coasted in 1st gear for two seconds.
fn coasting(model: &CarModel, vehicle_m_s: f64) -> CarRun<'_> {
    let first = model.car.gearbox.gear("1").unwrap();
    let state = model.in_gear(first, None, vehicle_m_s, 0.0).unwrap();
    let start = (driver(0.0), 0.01);
    let mut run = CarRun::new(model, &model.car, CarCalibration::STANDARD, first, state, start).unwrap();
    while run.time_s() < 2.0 {
        run.advance(driver(0.0), |_| {}, |_| {}).unwrap();
    }
    run
}

/// All shifts of the one-way clutch and of the brake beside it, in the limits of the shifts of other gearboxes.
#[test]
fn every_shift_of_a_one_way_clutch_is_good_with_any_friction() {
    let pairs = [["1", "2"], ["2", "1"], ["1", "3"], ["3", "1"], ["1", "L"], ["L", "1"], ["L", "2"], ["2", "L"]];
    let mut worst = CarShiftQuality::default();
    let mut longest_s: f64 = 0.0;
    for nominal in [one_way(), with_stroke(one_way())] {
        for friction in [0.85, 1.0, 1.15] {
            let model = CarModel::new(nominal.clone().with_friction(friction)).unwrap();
            for (pair, throttle) in
                pairs.iter().flat_map(|pair| [0.0, 0.1, 0.2, 0.4, 0.7].map(|throttle| (pair, throttle)))
            {
                let (q, _) = shift(&model, *pair, throttle);
                let label = format!("{pair:?}, friction {friction}, throttle {throttle}: {q:?}");
                longest_s = longest_s.max(q.complete_s.unwrap_or_else(|| panic!("{label}")));
                assert!(q.flare_rad_s < 5.0 && q.past_synchronous_rad_s < 10.0 && q.tie_up_n_m < 50.0, "{label}");
                assert!(q.held_slip_rad_s < 0.1 && q.jerk_m_s3 < 25.0, "{label}");
                worst.flare_rad_s = worst.flare_rad_s.max(q.flare_rad_s);
                worst.past_synchronous_rad_s = worst.past_synchronous_rad_s.max(q.past_synchronous_rad_s);
                worst.tie_up_n_m = worst.tie_up_n_m.max(q.tie_up_n_m);
                worst.jerk_m_s3 = worst.jerk_m_s3.max(q.jerk_m_s3);
            }
        }
    }
    println!("shifts of a one-way clutch: longest {longest_s:.2} s, worst {worst:?}");
    assert!(longest_s < 1.8);
}

#[test]
fn under_power_the_one_way_clutch_lets_go_by_itself_and_catches_at_synchronous_speed() {
    let model = CarModel::new(one_way()).unwrap();
    for throttle in [0.1, 0.4] {
        for names in [["1", "2"], ["2", "1"]] {
            let (_, samples) = shift(&model, names, throttle);
            // It never slips in the direction in which it holds, and never pulls.
            assert!(samples.iter().all(|(_, [slip, torque])| *slip < 1e-6 && *torque > -1e-6), "{names:?} {throttle}");
            let (holds, overruns) = if names[0] == "1" { (0.5, 3.9) } else { (3.9, 0.5) };
            let at = |time_s: f64| samples.iter().find(|(sample, _)| sample.time_s >= time_s).unwrap().1;
            assert!(at(holds)[0].abs() < 1e-6 && at(holds)[1] > 50.0, "{names:?} {throttle}: {:?}", at(holds));
            assert!(at(overruns)[0] < -50.0 && at(overruns)[1] == 0.0, "{names:?} {throttle}: {:?}", at(overruns));
        }
    }
}

#[test]
fn without_power_the_turbine_falls_to_idle_in_first_gear_and_the_brake_beside_brakes() {
    let model = CarModel::new(one_way()).unwrap();
    let end = |names: [&str; 2]| shift(&model, names, 0.0).1.last().unwrap().0;
    let (free, braked) = (end(["2", "1"]), end(["2", "L"]));
    // Nothing but the road slows the car that runs free; with the brake the engine is dragged along.
    assert!(free.torques.turbine_rad_s < 100.0 && free.output_n_m.abs() < 10.0, "{free:?}");
    assert!(braked.torques.turbine_rad_s > 150.0 && braked.output_n_m < -40.0, "{braked:?}");
    // From there the brake of 2nd gear takes the turbine along, and 1st gear lets it go.
    let (second, again) = (end(["1", "2"]), end(["L", "1"]));
    let slip = second.torques.turbine_rad_s - model.car.gearbox.gears[second.gear].ratio * second.torques.output_rad_s;
    assert!(slip.abs() < 1e-6, "{slip}");
    assert!(again.torques.turbine_rad_s < 100.0 && again.output_n_m.abs() < 10.0, "{again:?}");
}

#[test]
fn a_pedal_that_is_pressed_after_coasting_is_answered_without_a_jolt() {
    let model = CarModel::new(one_way()).unwrap();
    let mut worst: f64 = 0.0;
    for (vehicle_m_s, throttle) in [4.0, 8.0, 12.0].into_iter().flat_map(|v| [0.1, 0.3, 1.0].map(|t| (v, t))) {
        let mut run = coasting(&model, vehicle_m_s);
        let (mut jerk, mut last, mut fell) = (PeakJerk::default(), None, 0.0_f64);
        while run.time_s() < 5.0 {
            let record = |sample: &CarSample| {
                jerk.acceleration(sample.time_s, sample.vehicle_m_s2);
                fell = fell.min(sample.slips_rad_s[5]);
                last = Some(*sample);
            };
            run.advance(driver(throttle), |_| {}, record).unwrap();
        }
        let last = last.unwrap();
        assert!(last.slips_rad_s[5].abs() < 1e-6 && last.torques.elements_n_m[5] > 20.0, "{vehicle_m_s} {throttle}");
        assert!(fell < -10.0 || vehicle_m_s < 5.0, "it had overrun: {fell}");
        worst = worst.max(jerk.peak_m_s3().unwrap());
    }
    println!("pedal after coasting: jerk {worst:.1} m/s^3");
    assert!(worst < 25.0);
}

/// Back to the gear before at any time of the shift, with power and without.
#[test]
fn a_change_of_mind_at_any_time_ends_well() {
    let model = CarModel::new(one_way()).unwrap();
    let gear = |name: &str| model.car.gearbox.gear(name).unwrap();
    let mut worst: (f64, String) = (0.0, String::new());
    for (from, to) in [("1", "2"), ("2", "1"), ("1", "L"), ("L", "1")] {
        for (throttle, back_s) in
            [0.0, 0.2, 0.5].into_iter().flat_map(|t| [0.1, 0.3, 0.4, 0.5, 0.7, 0.9].map(|s| (t, s)))
        {
            let label = format!("{from}-{to}-{from} after {back_s} s, throttle {throttle}");
            let shift = CarShift::usual(&model.car, gear(from), gear(to), throttle);
            let state = model.in_gear(gear(from), None, shift.vehicle_m_s, throttle).unwrap();
            let start = (driver(throttle), 0.01);
            let mut run = CarRun::new(&model, &model.car, CarCalibration::STANDARD, gear(from), state, start).unwrap();
            let (mut jerk, mut held) = (PeakJerk::default(), HeldGear::default());
            while run.time_s() < 5.0 {
                if run.time_s() > 1.0 {
                    run.request(gear(if run.time_s() < 1.0 + back_s { to } else { from })).unwrap();
                }
                let record = |sample: &CarSample| {
                    held.check(&model.car, sample, &label);
                    if sample.time_s > 1.0 {
                        jerk.acceleration(sample.time_s, sample.vehicle_m_s2)
                    }
                };
                run.advance(driver(throttle), |_| {}, record).unwrap();
            }
            assert!(run.controller().shift().is_none() && run.controller().gear() == gear(from), "{label}");
            let peak = jerk.peak_m_s3().unwrap();
            assert!(peak < 25.0, "{label}: {peak}");
            if peak > worst.0 {
                worst = (peak, label);
            }
        }
    }
    println!("a change of mind: jerk {:.1} m/s^3 ({})", worst.0, worst.1);
}

/// What is left undriven: neither of the two elements has a valve.
#[test]
fn a_shift_without_a_clutch_that_opens_or_closes_is_refused_with_a_hint() {
    let text = include_str!("../../../../gearboxes/ravigneaux_4_one_way.toml");
    let brake = "name = \"INT\"\nkind = \"brake\"";
    assert!(text.contains(brake));
    let text = text.replace(brake, "name = \"INT\"\nkind = \"dog\"");
    let source = config::Source::built_in("car.toml", "name = \"car\"\ngearbox = \"g.toml\"\n");
    let car = config::CarFile::from_sources(source, config::Source::built_in("g.toml", &text)).unwrap().car;
    let model = CarModel::new(car).unwrap();
    let mut run = coasting(&model, 8.0);
    let error = run.request(model.car.gearbox.gear("2").unwrap()).unwrap_err().to_string();
    assert!(error.contains("there is no way from gear 1 to gear 2"), "{error}");
    assert!(
        error.contains("hint: gear 1 is held by the one-way clutch F1: a shift from or to it is driven where"),
        "{error}"
    );
}

/// Other gearboxes with a one-way clutch beside the brake of 1st gear, given by the members that it connects.
fn others() -> Vec<car::Car> {
    let files = [
        (include_str!("../../../../gearboxes/fn4a.toml"), "LR", "frc"),
        (include_str!("../../../../gearboxes/a340e.toml"), "B3", "rcar"),
    ];
    let car = |(text, brake, output): (&str, &str, &str)| {
        let first = text.lines().find(|line| line.contains("name = \"1\"")).unwrap();
        let on_one_way = first.replace(&format!("\"{brake}\""), "\"F\"");
        assert_ne!(first, on_one_way);
        let text = text.replace(first, &on_one_way)
            + &format!(
                "\n[[element]]\nname = \"F\"\nkind = \"one-way-clutch\"\ninput = \"housing\"\noutput = \"{output}\"\n"
            );
        let source = config::Source::built_in("car.toml", "name = \"car\"\ngearbox = \"g.toml\"\n");
        config::CarFile::from_sources(source, config::Source::built_in("g.toml", &text)).unwrap().car
    };
    files.map(car).into()
}

/// The brake beside it holds while a gear is engaged from neutral and from reverse, and then leaves the one-way clutch its load.
#[test]
fn the_brake_beside_it_leaves_its_load_to_the_one_way_clutch_whatever_the_load() {
    for car in others().into_iter().chain([one_way()]) {
        let model = CarModel::new(car).unwrap();
        let [first, second, reverse] = ["1", "2", "R"].map(|name| model.car.gearbox.gear(name).unwrap());
        let element = model.car.gearbox.one_way_clutch_of(first).unwrap();
        for (brake, throttle) in [(0.6, 0.0), (0.3, 0.0), (0.3, 0.2), (0.0, 0.0), (0.05, 0.0)] {
            let label = format!("{} brake {brake} throttle {throttle}", model.car.gearbox.name);
            let driver = Driver { throttle, brake, grade_rad: 0.0 };
            let state = model.in_gear(first, None, 0.0, 0.0).unwrap();
            let mut run =
                CarRun::new(&model, &model.car, CarCalibration::STANDARD, first, state, (driver, 0.01)).unwrap();
            run.start_in_neutral().unwrap();
            let mut torque_n_m = 0.0;
            while run.time_s() < 14.0 {
                let wanted = match run.time_s() {
                    0.5..4.0 => Some(first),
                    4.0..7.0 => Some(reverse),
                    7.0..11.0 => Some(first),
                    11.0.. => Some(second),
                    _ => None,
                };
                // Reverse can be engaged only at rest.
                if let Some(wanted) = wanted.filter(|&gear| gear != reverse || (brake >= 0.3 && throttle == 0.0)) {
                    run.request(wanted).unwrap_or_else(|error| panic!("{label}: {error}"));
                }
                let time_s = run.time_s();
                let record = |sample: &CarSample| {
                    if time_s < 11.0 && sample.shift.is_none() {
                        torque_n_m = sample.torques.elements_n_m[element];
                    }
                };
                run.advance(driver, |_| {}, record).unwrap_or_else(|error| panic!("{label}: {error}"));
            }
            assert_eq!(run.controller().gear(), second, "{label}");
            assert!(torque_n_m > 5.0, "{label}: {torque_n_m}");
        }
    }
}
