//! Faults on a drive: what the plates get and do, while the commands stay those of a sound car.

use car::{Car, Drive, Fault, FaultKind};
use config::{DriveFile, Source};
use plant::car::{CarCalibration, CarError, CarModel, CarSample, simulate_car_drive};

/// In 3rd gear for five seconds, then in 4th.
const DRIVE: &str = "name = \"d\"\nstart = { gear = \"3\", vehicle_m_s = 12.0 }\nshift = [{ time_s = 5.0, gear = \"4\" }]\n\
                     [[segment]]\nduration_s = 10\nthrottle = 0.4\n";

fn drive(faults: &[Fault]) -> Drive {
    let drive = DriveFile::from_source(Source::built_in("drive.toml", DRIVE)).unwrap().drive;
    Drive { faults: faults.to_vec(), ..drive }
}

fn samples(car: &Car, faults: &[Fault]) -> Result<Vec<CarSample>, CarError> {
    let model = CarModel::new(car.clone()).unwrap();
    let mut samples = Vec::new();
    simulate_car_drive(&model, car, CarCalibration::STANDARD, &drive(faults), |sample| samples.push(*sample))?;
    Ok(samples)
}

fn element(car: &Car, name: &str) -> usize {
    car.gearbox.elements.iter().position(|element| element.name == name).unwrap()
}

fn at(samples: &[CarSample], time_s: f64) -> &CarSample {
    samples.iter().find(|sample| sample.time_s >= time_s).unwrap()
}

#[test]
fn a_weak_clutch_slips_in_its_gears_from_then_on_and_the_commands_stay() {
    let car = super::cars().swap_remove(0);
    let weak = |factor| Fault { kind: FaultKind::Friction { element: Some("C".to_owned()), factor }, from_s: 2.0 };
    let (sound, faulty) = (samples(&car, &[]).unwrap(), samples(&car, &[weak(0.15)]).unwrap());
    let c = element(&car, "C");
    assert_eq!(at(&sound, 1.9), at(&faulty, 1.9));
    assert!(at(&sound, 4.5).slips_rad_s[c].abs() < 1e-6 && at(&faulty, 4.5).slips_rad_s[c].abs() > 20.0);
    assert_eq!(at(&sound, 4.5).commands[c], at(&faulty, 4.5).commands[c]);
    assert_eq!(at(&sound, 4.5).pressures_pa[c], at(&faulty, 4.5).pressures_pa[c]);
    // Wrong oil is all elements together.
    let all = Fault { kind: FaultKind::Friction { element: None, factor: 0.05 }, from_s: 2.0 };
    let faulty = samples(&car, &[all]).unwrap();
    let slips =
        |sample: &CarSample| ["B", "C", "E"].iter().any(|name| sample.slips_rad_s[element(&car, name)].abs() > 5.0);
    assert!(!slips(at(&sound, 4.5)) && slips(at(&faulty, 4.5)));
}

#[test]
fn valves_that_stick_or_are_swapped_give_other_pressures_than_commanded() {
    let car = super::cars().swap_remove(0);
    let [c, e] = ["C", "E"].map(|name| element(&car, name));
    let stuck = |command| Fault { kind: FaultKind::StuckSolenoid { element: "C".to_owned(), command }, from_s: 2.0 };
    let open = car.clutches[c].unwrap().valve.command_for(0.0);
    let off = samples(&car, &[stuck(Some(open))]).unwrap();
    assert!(at(&off, 1.9).pressures_pa[c] > 1e6 && at(&off, 4.0).pressures_pa[c] < 1e4);
    assert_eq!(at(&off, 4.0).commands[c], at(&off, 1.9).commands[c]);
    // Stuck as it is, it holds on where 4th gear opens it.
    let frozen = samples(&car, &[stuck(None)]).unwrap();
    assert!(at(&frozen, 9.9).pressures_pa[c] > 1e6);
    let swapped = Fault { kind: FaultKind::SwappedSolenoids(["C".to_owned(), "D".to_owned()]), from_s: 2.0 };
    let swapped = samples(&car, &[swapped]).unwrap();
    let d = element(&car, "D");
    assert!(at(&swapped, 4.0).pressures_pa[c] < 1e4 && at(&swapped, 4.0).pressures_pa[d] > 1e6);
    assert!(at(&swapped, 4.0).pressures_pa[e] > 1e6);
}

#[test]
fn leaks_a_low_line_pressure_and_air_change_the_pressures() {
    let car = super::cars().swap_remove(0);
    let c = element(&car, "C");
    let of = |kind| samples(&car, &[Fault { kind, from_s: 2.0 }]).unwrap();
    let sound = samples(&car, &[]).unwrap();
    let line_pa = at(&sound, 4.0).pressures_pa[c];
    let leaks = of(FaultKind::LeakingPiston { element: "C".to_owned(), pressure_fraction: 0.6 });
    assert!((at(&leaks, 4.0).pressures_pa[c] / line_pa - 0.6).abs() < 1e-3);
    let line = of(FaultKind::LinePressure { pressure_pa: 0.5e6 });
    let pressures = at(&line, 4.0).pressures_pa;
    assert!(pressures.iter().all(|pa| *pa < 0.501e6) && pressures[c] > 0.499e6);
    // In the shift the pressures come later.
    let air = of(FaultKind::Aeration { lag_factor: 3.0 });
    assert_eq!(at(&air, 1.9), at(&sound, 1.9));
    let apart = |time_s| (at(&air, time_s).pressures_pa[c] - at(&sound, time_s).pressures_pa[c]).abs();
    assert!((500..560).map(|at| f64::from(at) * 0.01).map(apart).fold(0.0, f64::max) > 5e4);
}

#[test]
fn a_fault_of_an_element_that_the_gearbox_does_not_have_is_refused_with_the_names_that_it_has() {
    let car = super::cars().swap_remove(0);
    let fault =
        Fault { kind: FaultKind::LeakingPiston { element: "K1".to_owned(), pressure_fraction: 0.5 }, from_s: 0.0 };
    let error = samples(&car, &[fault]).unwrap_err().to_string();
    assert!(error.contains("\"K1\"") && error.contains("hint: it has A, B, C, D, E"), "{error}");
}

#[test]
fn a_solenoid_stuck_on_or_off_lets_every_car_go_on_in_every_gear() {
    let city = Source::built_in("city.toml", include_str!("../../../../drives/city.toml"));
    let city = Drive { repetitions: 1, ..DriveFile::from_source(city).unwrap().drive };
    let mut drives = Vec::new();
    for car in super::road_cars() {
        let model = CarModel::new(car.clone()).unwrap();
        for (element, clutch) in car.gearbox.elements.iter().zip(&car.clutches).filter(|(_, clutch)| clutch.is_some()) {
            let clutch = clutch.unwrap();
            let commands = [0.0, car.line_pressure_pa].map(|pressure_pa| clutch.valve.command_for(pressure_pa));
            // Each is within a gear or a shift; the car is driven to its halt with what is broken.
            for from_s in [0.0, 20.0, 47.0, 75.0, 110.0, 150.0] {
                drives.extend(commands.map(|command| (model.clone(), element.name.clone(), command, from_s)));
            }
        }
    }
    let mut wrong = Vec::new();
    for (model, name, command, from_s) in super::runs(drives) {
        let kind = FaultKind::StuckSolenoid { element: name.clone(), command: Some(command) };
        let drive = Drive { faults: vec![Fault { kind, from_s }], ..city.clone() };
        match simulate_car_drive(&model, &model.car, CarCalibration::STANDARD, &drive, |_| {}) {
            // The limiter holds an engine that nothing loads; in a wrong low gear the car may turn it faster.
            Ok(summary) => {
                let over = summary.over_speed.map_or(0.0, |over| over.engine_rad_s / model.engine_map_rad_s());
                if over > 1.5 {
                    wrong.push(format!(
                        "{} {name} {command} from {from_s} s: {over:.2} of the map",
                        model.car.gearbox.name
                    ));
                }
            }
            // A clutch that does not open stalls the engine of a car without a converter.
            Err(CarError::Request(message)) if model.car.converter.is_none() && message.contains("stalls") => (),
            Err(error) => wrong.push(format!("{} {name} {command} from {from_s} s: {error}", model.car.gearbox.name)),
        }
    }
    assert!(wrong.is_empty(), "{}\n{}", wrong.len(), wrong.join("\n"));
}

#[test]
fn neutral_asked_for_while_the_engine_pulls_lets_the_elements_of_every_first_gear_slip() {
    for car in super::road_cars().into_iter().filter(|car| car.converter.is_some()) {
        // Behind a dog that stays in the engine speeds up shafts, whose reaction the output carries.
        let has_dog = (0..car.gearbox.elements.len()).any(|element| car.gearbox.is_dog(element));
        let most_n_m = if has_dog { 100.0 } else { 50.0 };
        for throttle in [0.0, 0.1, 0.3, 0.5] {
            let file = format!(
                "name = \"n\"\nstart = {{ gear = \"1\", vehicle_m_s = 5.0 }}\nshift = [{{ time_s = 3.0, gear = \"N\" }}]\n\
                 [[segment]]\nduration_s = 6\nthrottle = {throttle}\n"
            );
            let drive = DriveFile::from_source(Source::built_in("drive.toml", &file)).unwrap().drive;
            let model = CarModel::new(car.clone()).unwrap();
            let mut samples = Vec::new();
            let run = simulate_car_drive(&model, &car, CarCalibration::STANDARD, &drive, |s| samples.push(*s));
            let name = &car.gearbox.name;
            assert!(run.is_ok(), "{name}, throttle {throttle}: {run:?}");
            // The engine is free of the road.
            let shaft_n_m = at(&samples, 5.5).torques.shaft_n_m;
            assert!(shaft_n_m.abs() < most_n_m, "{name}, throttle {throttle}: {shaft_n_m} N m");
        }
    }
}
