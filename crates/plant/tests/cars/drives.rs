//! Whole drives.

use car::{Car, Drive};
use config::{CarFile, DriveFile, Source};
use plant::car::{CarCalibration, CarError, CarModel, CarSample, Driver, simulate_car_drive};

fn drive(text: &str) -> Drive {
    DriveFile::from_source(Source::built_in("drive.toml", text)).unwrap().drive
}

fn samples(car: &Car, drive: &Drive) -> Result<Vec<CarSample>, CarError> {
    samples_with(CarCalibration::STANDARD, car, drive)
}

fn samples_with(calibration: CarCalibration, car: &Car, drive: &Drive) -> Result<Vec<CarSample>, CarError> {
    let model = CarModel::new(car.clone())?;
    let mut samples = Vec::new();
    simulate_car_drive(&model, car, calibration, drive, |sample| samples.push(*sample))?;
    Ok(samples)
}

#[test]
fn an_hour_in_town_uses_the_gears_and_shifts_more_than_200_times() {
    let drive = drive(include_str!("../../../../drives/city.toml"));
    for (calibration, car) in
        super::calibrated(super::runs(super::cars().into_iter().filter(|car| car.gearbox.gears.len() > 3)))
    {
        let model = CarModel::new(car.clone()).unwrap();
        let (mut count, mut used) = (0, vec![false; car.gearbox.gears.len()]);
        let begin = std::time::Instant::now();
        let summary = simulate_car_drive(&model, &car, calibration, &drive, |sample| {
            count += 1;
            used[sample.gear] = true;
            assert!(sample.vehicle_m_s.is_finite() && sample.torques.engine_rad_s > 60.0, "{}", sample.time_s);
        })
        .unwrap();
        println!("{}: {summary:?} in {:.2} s", car.gearbox.name, begin.elapsed().as_secs_f64());
        assert_eq!(count, 360_000);
        assert!(summary.shifts >= 200, "{summary:?}");
        // The highest gear of the ten-speed box is for motorways.
        let gears = car.gearbox.forward_gears();
        assert!(gears[..gears.len().min(9)].iter().all(|&gear| used[gear]), "{used:?}");
    }
}

#[test]
fn the_same_drive_gives_the_same_samples() {
    let car = super::cars().swap_remove(0);
    let drive = drive("name = \"d\"\n[[segment]]\nduration_s = 20\nthrottle = [0.0, 0.5]\n");
    assert_eq!(samples(&car, &drive).unwrap(), samples(&car, &drive).unwrap());
}

#[test]
fn listed_shifts_are_made_at_their_times() {
    let car = super::cars().swap_remove(0);
    let text = "name = \"d\"\nstart = { gear = \"2\", vehicle_m_s = 8.0 }\n\
                shift = [{ time_s = 2.0, gear = \"3\" }, { time_s = 5.0, gear = \"2\" }]\n\
                [[segment]]\nduration_s = 8\nthrottle = 0.15\n";
    let samples = samples(&car, &drive(text)).unwrap();
    let gear_at = |time_s: f64| {
        let sample = samples.iter().find(|sample| sample.time_s >= time_s).unwrap();
        car.gearbox.gears[sample.gear].name.clone()
    };
    assert_eq!([1.9, 4.9, 7.9].map(gear_at), ["2", "3", "2"]);
    let begun = samples.iter().find(|sample| sample.shift.is_some()).unwrap();
    assert!((begun.time_s - 2.0).abs() < 1e-6, "{}", begun.time_s);
}

#[test]
fn a_car_that_is_braked_on_a_hill_stands() {
    let car = super::cars().swap_remove(0);
    let last = |brake: f64| {
        let text =
            format!("name = \"d\"\n[[segment]]\nduration_s = 30\nthrottle = 0.0\nbrake = {brake}\ngrade_rad = 0.3\n");
        *samples(&car, &drive(&text)).unwrap().last().unwrap()
    };
    // Idling in 1st gear does not hold the car on this hill; the brake does, by a creep of tyre and brake.
    let (free, braked) = (last(0.0), last(0.9));
    assert!(free.vehicle_m_s < -1.0, "{}", free.vehicle_m_s);
    assert!(braked.vehicle_m_s.abs() < 0.05, "{}", braked.vehicle_m_s);
    assert!((60.0..100.0).contains(&braked.torques.engine_rad_s), "idle at {}", braked.torques.engine_rad_s);
}

#[test]
fn a_dual_clutch_launches_shifts_up_comes_to_rest_and_launches_again() {
    for (calibration, car) in super::calibrated([super::dual_clutch()]) {
        launch_and_stop(calibration, &car);
    }
}

fn launch_and_stop(calibration: CarCalibration, car: &Car) {
    let text = "name = \"d\"\nrepetitions = 2\n[[segment]]\nduration_s = 1\nthrottle = 0.0\nbrake = 0.15\n\
                [[segment]]\nduration_s = 1\nthrottle = 0.0\nbrake = [0.15, 0.0]\n\
                [[segment]]\nduration_s = 1\nthrottle = [0.0, 0.1]\n\
                [[segment]]\nduration_s = 24\nthrottle = [0.1, 0.4]\n\
                [[segment]]\nduration_s = 1\nthrottle = [0.4, 0.0]\n\
                [[segment]]\nduration_s = 19\nthrottle = 0.0\nbrake = [0.0, 0.3]\n";
    let driven = samples_with(calibration, car, &drive(text)).unwrap();
    let minimum = driven.iter().map(|sample| sample.torques.engine_rad_s).fold(f64::INFINITY, f64::min);
    let jerk = driven.windows(2).map(|pair| (pair[1].vehicle_m_s2 - pair[0].vehicle_m_s2).abs() / 0.01);
    let jerk = jerk
        .zip(&driven)
        .map(|(jerk, sample)| (jerk, sample.time_s, sample.gear))
        .fold((0.0, 0.0, 0), |a, b| if b.0 > a.0 { b } else { a });
    let at = |time_s: f64| driven.iter().find(|sample| sample.time_s >= time_s).unwrap();
    println!("dual clutch: slowest engine {minimum:.0} rad/s, change of acceleration in 10 ms {jerk:.1?} m/s^3");
    assert!(at(0.9).vehicle_m_s.abs() < 0.05 && at(46.9).vehicle_m_s.abs() < 0.05);
    assert!(at(26.9).gear > 3 && at(26.9).vehicle_m_s > 12.0 && at(73.9).gear > 3, "{}", at(26.9).vehicle_m_s);
    // In the first second of a launch the clutch slips, and the engine turns faster than idle.
    assert!(at(3.0).slips_rad_s[0] > 20.0 && at(3.0).torques.engine_rad_s > 90.0);
    assert!(minimum > 60.0 && jerk.0 < 70.0);
}

/// A launch clutch whose piston has a stroke is filled before it takes torque: the car moves as soon as without a stroke, but for
/// the time of the fill.
#[test]
fn a_launch_clutch_with_a_stroke_is_filled() {
    let text = "name = \"d\"\n[[segment]]\nduration_s = 2\nthrottle = 0.0\nbrake = 0.15\n\
                [[segment]]\nduration_s = 0.1\nthrottle = [0.0, 0.2]\n[[segment]]\nduration_s = 4\nthrottle = 0.2\n";
    let launch = |car: &Car| {
        let driven = samples(car, &drive(text)).unwrap();
        let jerk = driven.windows(2).map(|pair| (pair[1].vehicle_m_s2 - pair[0].vehicle_m_s2).abs() / 0.01);
        let carries = driven.iter().find(|sample| sample.time_s > 2.0 && sample.vehicle_m_s > 0.1).unwrap();
        (carries.time_s - 2.0, jerk.fold(0.0, f64::max), driven.last().unwrap().vehicle_m_s)
    };
    let (without, with) = (launch(&super::dual_clutch()), launch(&super::with_stroke(super::dual_clutch())));
    println!(
        "launch: moves after {:.2} s, with stroke {:.2} s; jerk {:.0}, {:.0} m/s^3",
        without.0, with.0, without.1, with.1
    );
    assert!(with.0 < without.0 + 0.35 && with.1 < 70.0, "{without:?} {with:?}");
    assert!((with.2 - without.2).abs() < 0.5, "{without:?} {with:?}");
}

#[test]
fn a_dual_clutch_creeps_without_throttle_and_stands_with_the_brake() {
    let car = super::dual_clutch();
    let text = "name = \"d\"\n[[segment]]\nduration_s = 15\nthrottle = 0.0\n\
                [[segment]]\nduration_s = 5\nthrottle = 0.0\nbrake = 0.1\n";
    let creeping = samples(&car, &drive(text)).unwrap();
    let at = |time_s: f64| creeping.iter().find(|sample| sample.time_s >= time_s).unwrap();
    assert!((0.7..2.5).contains(&at(14.9).vehicle_m_s), "{}", at(14.9).vehicle_m_s);
    assert!(at(19.9).vehicle_m_s.abs() < 0.05, "{}", at(19.9).vehicle_m_s);
    assert!(creeping.iter().all(|sample| sample.torques.engine_rad_s > 60.0));
}

#[test]
fn in_reverse_the_car_goes_backwards() {
    let car = super::cars().swap_remove(0);
    let text = "name = \"d\"\nstart = { gear = \"R\" }\n[[segment]]\nduration_s = 5\nthrottle = 0.08\n";
    let samples = samples(&car, &drive(text)).unwrap();
    let last = samples.last().unwrap();
    assert!(last.vehicle_m_s < -1.0 && last.torques.turbine_rad_s > 10.0, "{}", last.vehicle_m_s);
    let ratio = car.gearbox.gears[last.gear].ratio;
    assert!((last.torques.turbine_rad_s - ratio * last.torques.output_rad_s).abs() < 1e-6);
}

/// The four-speed box with a one-way clutch that holds 1st gear in place of the brake LR.
#[test]
fn a_one_way_clutch_drives_and_freewheels() {
    let text = include_str!("../../../../gearboxes/ravigneaux_4.toml");
    let gear = "name = \"1\", engaged = [\"FWD\", \"LR\"]";
    assert!(text.contains(gear));
    let text = text.replace(gear, "name = \"1\", engaged = [\"FWD\", \"OWC\"]")
        + "\n[[element]]\nname = \"OWC\"\nkind = \"one-way-clutch\"\ninput = \"housing\"\noutput = \"car\"\n";
    let source = Source::built_in("car.toml", "name = \"car\"\ngearbox = \"g.toml\"\n");
    let car = CarFile::from_sources(source, Source::built_in("g.toml", &text)).unwrap().car;
    let text = "name = \"d\"\nstart = { gear = \"1\", vehicle_m_s = 6.0 }\nshift = []\n\
                segment = [{ duration_s = 2, throttle = 0.2 }, { duration_s = 3, throttle = 0.0 }, \
                { duration_s = 2, throttle = 0.3 }]\n";
    let samples = samples(&car, &drive(text)).unwrap();
    let slip_at = |time_s: f64| {
        let sample = samples.iter().find(|sample| sample.time_s >= time_s).unwrap();
        sample.torques.turbine_rad_s - car.gearbox.gears[sample.gear].ratio * sample.torques.output_rad_s
    };
    assert!(slip_at(1.9).abs() < 1e-6, "it drives: {}", slip_at(1.9));
    assert!(slip_at(4.9) < -30.0, "the turbine falls behind: {}", slip_at(4.9));
    assert!(slip_at(6.9).abs() < 1e-6, "it drives again: {}", slip_at(6.9));
}

#[test]
fn the_lock_up_clutch_closes_in_its_gears_and_opens_for_shifts() {
    let gearbox = include_str!("../../../../gearboxes/8hp.toml");
    let text = "name = \"car\"\ngearbox = \"g.toml\"\n[lock_up]\ncapacity_n_m = 300\nfirst_gear = \"3\"\n\
                on_input_rad_s = 140\noff_input_rad_s = 110\nramp_s = 0.6\n";
    let car =
        CarFile::from_sources(Source::built_in("car.toml", text), Source::built_in("g.toml", gearbox)).unwrap().car;
    let samples = samples(&car, &drive("name = \"d\"\n[[segment]]\nduration_s = 25\nthrottle = 0.2\n")).unwrap();
    let lock_up = car.gearbox.elements.len();
    let slip = |sample: &CarSample| sample.torques.engine_rad_s - sample.torques.turbine_rad_s;
    let locked = |sample: &&CarSample| sample.torques.elements_n_m[lock_up] != 0.0 && slip(sample).abs() < 1e-6;
    let gear = |sample: &CarSample| car.gearbox.gears[sample.gear].name.clone();
    assert!(samples.iter().filter(|sample| *gear(sample) < *"3").all(|sample| !locked(&sample)));
    for name in ["3", "4", "5"] {
        assert!(samples.iter().filter(|sample| gear(sample) == name).filter(locked).count() > 50, "gear {name}");
    }
    let late =
        |sample: &&CarSample| sample.shift.is_some_and(|shift| !matches!(shift.stage, plant::car::ShiftStage::Fill));
    assert!(samples.iter().filter(late).all(|sample| !locked(&sample)));
}

#[test]
fn a_lock_up_clutch_with_slip_control_keeps_its_slip() {
    let gearbox = include_str!("../../../../gearboxes/8hp.toml");
    let text = "name = \"car\"\ngearbox = \"g.toml\"\n[lock_up]\ncapacity_n_m = 300\nfirst_gear = \"3\"\n\
                on_input_rad_s = 140\noff_input_rad_s = 110\nramp_s = 0.6\nslip_rad_s = 4.0\n";
    let car =
        CarFile::from_sources(Source::built_in("car.toml", text), Source::built_in("g.toml", gearbox)).unwrap().car;
    // The throttle moves; the car of the controller's model and one whose engine gives a tenth less.
    let mut weak = car.clone();
    weak.engine.torque_n_m = weak.engine.torque_n_m.scaled(0.9);
    for truth in [car.clone(), weak] {
        let model = CarModel::new(truth).unwrap();
        let text = "name = \"d\"\nstart = { gear = \"5\", vehicle_m_s = 20.0 }\nshift = []\n[[segment]]\nduration_s = 12\n\
                    throttle = [0.1, 0.2]\n[[segment]]\nduration_s = 3\nthrottle = [0.2, 0.12]\n";
        let mut slips = Vec::new();
        simulate_car_drive(&model, &car, CarCalibration::STANDARD, &drive(text), |sample| {
            if sample.time_s > 5.0 {
                slips.push(sample.torques.engine_rad_s - sample.torques.turbine_rad_s);
            }
        })
        .unwrap();
        let (low, high) =
            slips.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), &slip| (low.min(slip), high.max(slip)));
        println!("lock-up slip {low:.1} to {high:.1} rad/s for 4.0");
        assert!(low > 2.0 && high < 6.0, "{low} to {high}");
    }
}

#[test]
fn wrong_requests_get_clear_errors() {
    let car = super::cars().swap_remove(0);
    let error = |head: &str| {
        let text = format!("name = \"d\"\n{head}\n[[segment]]\nduration_s = 3\nthrottle = 0.2\n");
        samples(&car, &drive(&text)).unwrap_err().to_string()
    };
    assert!(error("start = { gear = \"9\" }").contains("no gear \"9\"\nhint: its gears are R, 1, 2"));
    assert!(error("start = { gear = \"1\", vehicle_m_s = 90.0 }").contains("expected at most 700 rad/s"));
    let into_reverse = error("start = { vehicle_m_s = 5.0 }\nshift = [{ time_s = 1.0, gear = \"R\" }]");
    assert!(into_reverse.contains("gear R can be engaged only at rest"), "{into_reverse}");

    let model = CarModel::new(car.clone()).unwrap();
    let nan = model.in_gear(1, None, f64::NAN, 0.1).unwrap_err();
    assert!(nan.to_string().contains("cannot start at NaN m/s"), "{nan}");
    let state = model.in_gear(1, None, 5.0, 0.1).unwrap();
    let driver = Driver { throttle: 0.1, brake: 0.0, grade_rad: 0.0 };
    let calibration = CarCalibration::STANDARD;
    assert!(plant::car::CarRun::new(&model, &car, calibration, 1, state, (driver, 0.0)).is_err());
    let other = super::two_speed();
    let error = plant::car::CarRun::new(&model, &other, calibration, 1, state, (driver, 0.01)).unwrap_err();
    assert!(error.to_string().contains("another gearbox"), "{error}");
    let mut empty = drive("name = \"d\"\n[[segment]]\nduration_s = 3\nthrottle = 0.2\n");
    empty.segments.clear();
    assert!(samples(&car, &empty).unwrap_err().to_string().contains("segments of 1 ms"));
    let mut infinite = state;
    infinite.wheel_rad_s = f64::INFINITY;
    assert!(plant::car::CarRun::new(&model, &car, calibration, 1, infinite, (driver, 0.01)).is_err());
}

/// The published cycles: their sums and lengths, and every car within the tolerance nearly always.
#[test]
fn a_driver_follows_the_published_cycles() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../drives/");
    for (name, duration_s, distance_m) in [("wltc_3b", 1800.0, 23_266.0), ("ftp_75", 1874.0, 17_769.0)] {
        let drive = DriveFile::read(format!("{folder}{name}.toml").as_ref()).unwrap().drive;
        assert_eq!(drive.duration_s(), duration_s);
        for car in super::runs(super::cars().into_iter().filter(|car| car.gearbox.gears.len() > 3)) {
            let model = CarModel::new(car.clone()).unwrap();
            let summary = simulate_car_drive(&model, &car, CarCalibration::STANDARD, &drive, |_| {}).unwrap();
            let error = summary.speed_error.unwrap();
            println!("{name}, {}: {summary:?}", car.gearbox.name);
            assert!((summary.distance_m / distance_m - 1.0).abs() < 0.01, "{summary:?}");
            assert!(error.beyond < 0.02 && error.rms_m_s < 0.5, "{error:?}");
        }
    }
}
