//! Vehicle files with a gearbox file, and drive files.

use car::{Car, CarSize, ControllerCalibration, ErrorBudget, ShiftPlan};
use config::gearbox::SHIPPED;
use config::vehicle::short::{CarFacts, short_car_file, sized_gearbox};
use config::{CarFile, DriveFile, GearboxFile, Source, VehicleFile};

const GEARBOX: &str = include_str!("../../../gearboxes/8hp.toml");

fn car(text: &str) -> Result<CarFile, String> {
    let text = format!("name = \"car\"\ngearbox = \"8hp.toml\"\n{text}");
    let (source, gearbox) = (Source::built_in("car.toml", &text), Source::built_in("8hp.toml", GEARBOX));
    CarFile::from_sources(source, gearbox).map_err(|error| error.to_string())
}

fn drive(text: &str) -> Result<DriveFile, String> {
    DriveFile::from_source(Source::built_in("drive.toml", text)).map_err(|error| error.to_string())
}

#[test]
fn a_drive_names_the_calibration_of_its_shift_controller() {
    let of = |line: &str| drive(&format!("name = \"d\"\n{line}\n[[segment]]\nduration_s = 3\nthrottle = 0.1\n"));
    let read = |line: &str| of(line).unwrap().drive.controller;
    assert_eq!(read(""), ControllerCalibration::Bench);
    for calibration in ControllerCalibration::ALL {
        assert_eq!(read(&format!("controller = \"{}\"", calibration.name())), calibration);
    }
    let error = of("controller = \"sport\"").unwrap_err();
    assert!(error.contains("drive.toml:2") && error.contains("`bench` or `comfort`"), "{error}");
    assert!(of("controller = 1").is_err());
}

#[test]
fn a_name_and_a_gearbox_are_a_complete_vehicle_file() {
    let (short, whole) = (car("").unwrap(), CarFile::eight_speed().unwrap());
    assert_eq!(short.clutches, whole.clutches);
    assert_eq!((short.engine, short.converter, short.road), (whole.engine, whole.converter, whole.road));
    let named = |key: &str| short.defaults_taken.iter().any(|taken| taken.key == key);
    assert!(
        short.defaults_taken.len() > 30 && named("valve.gain.gain_pa_a") && named("vehicle.mass_kg") && !named("name")
    );
    assert!(whole.defaults_taken.is_empty(), "{:?}", whole.defaults_taken);
}

#[test]
fn the_maximum_engine_torque_scales_what_depends_on_the_size_of_a_car() {
    let shipped = CarFile::eight_speed().unwrap();
    let same = car("[engine]\nmax_torque_n_m = 190\n").unwrap();
    assert_eq!((same.engine, same.converter, same.driveline), (shipped.engine, shipped.converter, shipped.driveline));
    assert_eq!((same.road, same.tyre, &same.clutches), (shipped.road, shipped.tyre, &shipped.clutches));
    let numbers = "[engine]\nmax_torque_n_m = 380\n[driveline]\nfinal_ratio = 1.5\n[vehicle]\nmass_kg = 3000\nwheel_radius_m = 0.6\n";
    let large = car(numbers).unwrap();
    let close = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-4, "{a} {b}");
    close(large.engine.torque(500.0, 1.0), 2.0 * shipped.engine.torque(500.0, 1.0));
    close(large.engine.inertia_kg_m2, 2.0 * shipped.engine.inertia_kg_m2);
    let capacity = |car: &CarFile| car.converter.unwrap().capacity_n_m_s2.at(0.5);
    close(capacity(&large), 2.0 * capacity(&shipped));
    // Twice the torque through half the ratio.
    close(large.driveline.shaft_stiffness_n_m_rad, shipped.driveline.shaft_stiffness_n_m_rad);
    close(large.driveline.wheel_inertia_kg_m2, 8.0 * shipped.driveline.wheel_inertia_kg_m2);
    close(large.tyre.max_force_n, 2.0 * shipped.tyre.max_force_n);
    close(large.road.rolling_moment_n_m, 4.0 * shipped.road.rolling_moment_n_m);
    // What the file has is as it has it.
    let own = car(&format!("{numbers}[tyre]\nmax_force_n = 9000\n")).unwrap();
    assert_eq!(own.tyre.max_force_n, 9000.0);
    for wrong in ["1e9", "-3", "nan", "\"much\"", "[400]"] {
        let message = car(&format!("[engine]\nmax_torque_n_m = {wrong}\n")).unwrap_err();
        assert!(message.contains("car.toml:4"), "{wrong}: {message}");
    }
}

/// The template stands in the crate `car` as numbers and in `vehicles/eight_speed.toml` as the file that its sources explain.
#[test]
fn a_car_made_of_types_is_that_of_a_short_file_with_the_same_numbers() {
    let gearbox = || Source::built_in("8hp.toml", include_str!("../../../gearboxes/8hp.toml"));
    let description = || GearboxFile::from_source(gearbox()).unwrap().gearbox;
    let file = |text: &str| {
        let text = format!("name = \"car\"\ngearbox = \"8hp.toml\"\n{text}");
        CarFile::from_sources(Source::built_in("car.toml", &text), gearbox()).unwrap().car
    };
    let (own, other) = (Car::template(description(), 1500.0).unwrap(), file(""));
    // The ratio of the lowest gear is computed: what depends on it has another last digit.
    let driveline = other.driveline;
    assert!((own.driveline.shaft_stiffness_n_m_rad / driveline.shaft_stiffness_n_m_rad - 1.0).abs() < 1e-12);
    assert!((own.driveline.shaft_damping_n_m_s_rad / driveline.shaft_damping_n_m_s_rad - 1.0).abs() < 1e-12);
    assert_eq!(Car { name: other.name.clone(), driveline, ..own }, other);
    let size = CarSize { mass_kg: 1900.0, engine_torque_n_m: 400.0, wheel_radius_m: 0.33, final_ratio: 2.8 };
    let own = Car::of_size(description(), &size).unwrap();
    let other = file(
        "[engine]\nmax_torque_n_m = 400\n[driveline]\nfinal_ratio = 2.8\n[vehicle]\nmass_kg = 1900\nwheel_radius_m = 0.33\n",
    );
    let numbers = |car: &Car| {
        let (line, road, converter) = (&car.driveline, &car.road, car.converter.unwrap());
        [
            car.engine.inertia_kg_m2,
            car.engine.largest_torque(),
            converter.capacity_n_m_s2.at(0.5),
            line.final_ratio,
            line.shaft_stiffness_n_m_rad,
            line.shaft_damping_n_m_s_rad,
            line.wheel_inertia_kg_m2,
            car.tyre.max_force_n,
            road.mass_kg,
            road.wheel_radius_m,
            road.rolling_moment_n_m,
        ]
    };
    // A file has five digits.
    for (own, other) in numbers(&own).into_iter().zip(numbers(&other)) {
        assert!((own / other - 1.0).abs() < 5e-5, "{own} {other}");
    }
    assert_eq!((own.clutches, own.error_bounds), (other.clutches, other.error_bounds));
}

#[test]
fn a_default_that_cannot_be_right_names_the_file_and_the_numbers_that_it_follows_from() {
    let numbers = "[engine]\nmax_torque_n_m = 2000\n[vehicle]\nmass_kg = 60e3\nwheel_radius_m = 1.0\n";
    let message = car(numbers).map(|_| "a car").unwrap_err();
    assert!(message.starts_with("car.toml:4: `driveline.wheel_inertia_kg_m2`: its default"), "{message}");
    assert!(message.contains("hint: check the maximum engine torque"), "{message}");
    assert!(car(&format!("{numbers}[driveline]\nwheel_inertia_kg_m2 = 900\n")).is_ok());
}

#[test]
fn a_valve_of_ones_own_that_is_not_whole_is_told_so() {
    let message = car("[valve]\nzero_pressure_a = 1.0\n").unwrap_err();
    assert!(
        message.contains("missing key") && message.contains("hint: a [valve] of your own is given whole"),
        "{message}"
    );
}

#[test]
fn a_valve_of_one_element_and_a_lock_up_clutch_that_are_not_whole_are_told_so() {
    let lock_up = "[lock_up]\ncapacity_n_m = 300\nfirst_gear = \"3\"\non_input_rad_s = 140\noff_input_rad_s = 110\n";
    for (text, field, hint) in [
        ("[clutch.C.valve]\nzero_pressure_a = 1.2\n", "`delay`", "hint: the valve of one element is given whole"),
        (lock_up, "`ramp_s`", "hint: [lock_up] has `capacity_n_m`, `first_gear`"),
        ("[lock_up]\n", "`capacity_n_m`", "hint: [lock_up] has "),
    ] {
        let message = car(text).unwrap_err();
        assert!(message.contains(&format!("car.toml:3: missing key {field}\n{hint}")), "{message}");
    }
    // What is not missing has no such hint.
    let message = car(&format!("{lock_up}ramp_s = 0.5\nramp = 1\n")).unwrap_err();
    assert!(
        message.contains("car.toml:9: unknown key `ramp`") && !message.contains("hint: [lock_up] has"),
        "{message}"
    );
}

#[test]
fn the_lock_up_clutch_in_the_comments_of_the_shipped_file_is_right_and_has_every_key() {
    let shipped = include_str!("../../../vehicles/eight_speed.toml");
    let begin = shipped.find("# [lock_up]").unwrap();
    let block = shipped[begin..].lines().take_while(|line| line.starts_with("# ")).map(|line| &line[2..]);
    let lock_up = car(&block.collect::<Vec<_>>().join("\n")).unwrap().lock_up.unwrap();
    let car::LockUp { capacity_n_m, first_gear, on_rad_s, off_rad_s, ramp_s, slip_rad_s } = lock_up;
    assert_eq!((capacity_n_m, first_gear, on_rad_s, off_rad_s, ramp_s, slip_rad_s), (300.0, 3, 140.0, 110.0, 0.5, 4.0));
}

#[test]
fn a_first_file_of_every_shipped_gearbox_is_short_and_a_car_of_its_numbers() {
    for (name, text) in SHIPPED {
        for engine_torque_n_m in [20.0, 190.0, 2000.0] {
            let sized = sized_gearbox(&Source::built_in("g.toml", text), engine_torque_n_m).unwrap();
            let gearbox = Source::built_in("g.toml", &sized);
            let facts = CarFacts {
                name: "car \"x\"".to_owned(),
                gearbox: "g.toml".to_owned(),
                has_converter: name != "dual_clutch_7",
                converter: None,
                has_stroke: engine_torque_n_m > 1000.0,
                mass_kg: 5.0 * engine_torque_n_m + 500.0,
                wheel_radius_m: 0.35,
                final_ratio: if name == "dual_clutch_7" { 1.0 } else { 2.9 },
                engine_torque_n_m,
            };
            let twice = CarFacts { final_ratio: 10.0, ..facts.clone() };
            let lowest = GearboxFile::from_source(gearbox.clone()).unwrap().gearbox;
            let lowest = lowest.gears[lowest.forward_gears()[0]].ratio;
            if twice.final_ratio * lowest > 40.0 {
                let message = short_car_file(&twice, &gearbox).unwrap_err().to_string();
                assert!(message.contains("may contain the final ratio"), "{message}");
            }
            let file = short_car_file(&facts, &gearbox).unwrap();
            let keys = file.lines().filter(|line| line.contains(" = ")).count();
            assert!((15..=30).contains(&keys), "{name}: {keys}");
            let made = CarFile::from_sources(Source::built_in("car.toml", &file), gearbox.clone()).unwrap();
            assert_eq!((made.name.as_str(), made.road.mass_kg), ("car \"x\"", facts.mass_kg));
            assert_eq!(made.converter.is_some(), facts.has_converter);
            // The comments hold the defaults: with all of them as keys it is the same car.
            let given = file.replace("\n# [valve]", "\n[valve]").replace("\n# ", "\n");
            let given: String = given
                .lines()
                .filter(|line| line.contains(" = ") || line.starts_with('['))
                .map(|line| format!("{line}\n"))
                .collect();
            let given = CarFile::from_sources(Source::built_in("car.toml", &given), gearbox.clone()).unwrap();
            assert!(given.defaults_taken.len() + 10 < made.defaults_taken.len());
            assert_eq!(given.car, made.car, "{name}");
            // Pistons are as large as the engine is strong, and touch at the same pressure.
            let shipped = CarFile::from_sources(
                Source::built_in("car.toml", "name = \"x\"\ngearbox = \"g.toml\"\n"),
                Source::built_in("g.toml", text),
            )
            .unwrap();
            // So is what turns with the turbine: a shift takes as long.
            for (made, shipped) in made.gearbox.shifts.iter().zip(&shipped.gearbox.shifts) {
                let (Some(made), Some(shipped)) = (made.reduced, shipped.reduced) else { continue };
                let ratio = made.mass_kg_m2[0][0] / shipped.mass_kg_m2[0][0];
                assert!((ratio / (engine_torque_n_m / 190.0) - 1.0).abs() < 1e-3, "{name}: {ratio}");
            }
            for (made, shipped) in made.clutches.iter().flatten().zip(shipped.clutches.iter().flatten()) {
                let ratio = made.clutch.static_capacity(1e6) / shipped.clutch.static_capacity(1e6);
                assert!((ratio / (engine_torque_n_m / 190.0) - 1.0).abs() < 2e-4, "{name}: {ratio}");
                assert!((made.clutch.kiss_pressure() / shipped.clutch.kiss_pressure() - 1.0).abs() < 2e-4);
            }
        }
    }
}

#[test]
fn a_key_of_the_file_replaces_that_of_the_eight_speed_car() {
    let car = car("[vehicle]\nmass_kg = 2000\n[clutch.C]\ndrag_n_m = 3.0\n").unwrap();
    assert_eq!((car.road.mass_kg, car.road.wheel_radius_m), (2000.0, 0.3));
    let drags: Vec<f64> = car.clutches.iter().flatten().map(|clutch| clutch.drag_n_m).collect();
    assert_eq!(drags, [1.1, 1.1, 3.0, 1.1, 1.1]);
}

#[test]
fn the_mass_of_the_steel_plates_is_that_of_one_element_or_not_known() {
    let masses = |text: &str| -> Vec<_> {
        car(text).unwrap().clutches.iter().flatten().map(|clutch| clutch.steel_mass_kg).collect()
    };
    assert_eq!(masses(""), [None; 5]);
    assert_eq!(masses("[clutch.C]\nsteel_mass_kg = 0.6\n"), [None, None, Some(0.6), None, None]);
    let error = car("[clutch.C]\nsteel_mass_kg = 600\n").unwrap_err();
    assert!(error.contains("car.toml:4: `clutch.C.steel_mass_kg` is 600, expected 0.05 to 20"), "{error}");
}

#[test]
fn a_table_fill_gives_the_pistons_a_stroke() {
    let strokes = |text: &str| -> Vec<Option<f64>> {
        let mm = |clutch: &car::ShiftClutch| 1e3 * clutch.cylinder.stroke_m3 / clutch.clutch.piston_area_m2;
        let car = car(text).unwrap();
        car.clutches.iter().flatten().map(|clutch| clutch.has_stroke.then(|| mm(clutch))).collect()
    };
    assert_eq!(strokes(""), [None; 5]);
    let close = |a: Option<f64>, b: f64| (a.unwrap() - b).abs() < 1e-9;
    assert!(strokes("[fill]\n").into_iter().all(|stroke| close(stroke, 1.2)));
    let own = strokes("[fill]\nstroke_m = 1e-3\n[clutch.C.fill]\nstroke_m = 2e-3\n[clutch.D.fill]\nenabled = false\n");
    assert!(close(own[0], 1.0) && close(own[2], 2.0) && own[3].is_none(), "{own:?}");
    let cold = car("[fill]\n[oil]\ntemperature_degc = 5\n").unwrap();
    assert!(cold.clutches[0].unwrap().cylinder.viscosity_m2_s > 1e-4);
    let shipped =
        CarFile::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../vehicles/eight_speed_stroke.toml").as_ref());
    assert_eq!(shipped.unwrap().clutches, car("[fill]\n").unwrap().clutches);
}

#[test]
fn a_valve_of_another_kind_replaces_the_shipped_one() {
    let valve = "[valve]\nkind = \"pulse-width\"\nflow_sqrt_pa_s = 2e4\nline_pressure_pa = 1.6e6\n\
                 delay = { duty_percent = [0.0, 100.0], delay_s = [0.01, 0.01] }\n";
    let kinds: Vec<_> =
        car(valve).unwrap().clutches.iter().flatten().map(|clutch| clutch.valve.command_kind()).collect();
    assert_eq!(kinds, [drivetrain::CommandKind::DutyCycle; 5]);
    let weak = car(&valve.replace("1.6e6", "1.2e6")).unwrap_err();
    assert!(weak.contains("car.toml:3") && weak.contains("less than `hydraulics.line_pressure_pa`"), "{weak}");
}

const VALVE: &str = "lag = { pressure_pa = [0, 1e6], time_constant_s = [0.1, 0.02] }\n\
                     gain = { current_a = [0, 1], gain_pa_a = [1.2e6, 1.6e6] }\n\
                     delay = { current_a = [0, 1], delay_s = [0.03, 0.01] }\n";

#[test]
fn a_valve_with_a_current_of_zero_pressure_is_normally_high() {
    let car = |more: &str| car(&format!("[clutch.C.valve]\n{VALVE}{more}"));
    let high = car("zero_pressure_a = 1.1\n").unwrap();
    let falls: Vec<bool> = high.clutches.iter().flatten().map(|clutch| clutch.valve.falls()).collect();
    assert_eq!(falls, [false, false, true, false, false]);
    let valve = high.clutches[2].unwrap().valve;
    assert!((valve.settled_pressure(0.1) - 1.6e6).abs() < 1.0 && valve.settled_pressure(1.1) == 0.0);
    let weak = car("zero_pressure_a = 0.9\n").unwrap_err();
    assert!(weak.contains("car.toml:7") && weak.contains("without current the pressure is 1.404 MPa"), "{weak}");
    assert!(weak.contains("line pressure needs 1.000 A"), "{weak}");
    let pulse = "[valve]\nkind = \"pulse-width\"\nflow_sqrt_pa_s = 2e4\nline_pressure_pa = 1.6e6\nzero_pressure_a = 1\n\
                 delay = { duty_percent = [0.0, 100.0], delay_s = [0.01, 0.01] }\n";
    assert!(self::car(pulse).unwrap_err().contains("another kind of valve"));
    let single = include_str!("../../../vehicles/two_speed_at.toml")
        .replace("[clutch.b.valve]\n", "[clutch.b.valve]\nzero_pressure_a = 1.1\n");
    let error = config::VehicleFile::from_source(Source::built_in("v.toml", &single)).unwrap_err().to_string();
    assert!(
        error.contains("clutch.b.valve.zero_pressure_a") && error.contains("for cars with a gearbox file"),
        "{error}"
    );
}

#[test]
fn the_shipped_vehicle_files_are_right() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../vehicles/");
    for (name, elements) in [
        ("eight_speed", 5),
        ("eight_speed_stroke", 5),
        ("ten_speed", 6),
        ("six_speed", 5),
        ("four_speed", 5),
        ("four_speed_one_way", 5),
        ("three_speed_c6", 4),
        ("three_speed_th400", 4),
        ("four_speed_4l60e", 5),
        ("five_speed_722_6", 6),
        ("four_speed_fn4a", 5),
        ("four_speed_simpson", 6),
        ("six_speed_tf80sc", 5),
        ("eight_speed_8hp45", 5),
        ("eight_speed_a8lr1", 6),
        ("nine_speed_9g", 6),
        ("nine_speed_9hp", 4),
        ("dual_clutch", 2),
    ] {
        let path = format!("{folder}{name}.toml");
        let car = CarFile::read(path.as_ref()).unwrap();
        assert_eq!(car.clutches.iter().flatten().count(), elements, "{name}");
        assert_eq!(Source::read(path.as_ref()).unwrap().kind().unwrap(), config::Kind::Car);
        assert_eq!(car.slipping_elements(), None, "{name}");
    }
}

#[test]
fn wrong_vehicle_files_get_their_line_and_a_hint() {
    for (text, parts) in [
        ("[vehicle]\nmass_kg = nan\n", ["car.toml:4", "vehicle.mass_kg", "expected 200 to 60000"]),
        ("[hydraulics]\nline_pressure_pa = 16.0\n", ["car.toml:4", "is 16", "16 bar is 1600000 Pa"]),
        ("[hydraulics]\nline_pressure_pa = 1.05e5\n", ["car.toml:4", "return spring of B", ""]),
        (
            "[clutch.K1]\ndrag_n_m = 1.0\n",
            ["car.toml:3", "no clutch or brake \"K1\"", "hint: its clutches and brakes are A, B, C, D, E"],
        ),
        ("[friction]\nstatic_factor = 0.9\n", ["car.toml:4", "is 0.9, less than", "neither stick nor slip"]),
        ("[friction]\nfactor = [1.0]\n", ["car.toml:4", "friction.factor", "5 breakpoints"]),
        (
            "[lock_up]\ncapacity_n_m = 300\nfirst_gear = \"9\"\non_input_rad_s = 140\noff_input_rad_s = 110\nramp_s = 0.5\n",
            ["car.toml:5", "no gear \"9\"", "its gears are R, 1"],
        ),
        (
            "[lock_up]\ncapacity_n_m = 300\nfirst_gear = \"3\"\non_input_rad_s = 100\noff_input_rad_s = 110\nramp_s = 0.5\n",
            ["car.toml:7", "is 110, not below", ""],
        ),
        ("[fill]\nstroke_m = 1.2\n", ["car.toml:4", "fill.stroke_m", "expected 0.00001 to 0.02"]),
        ("[clutch.B.fill]\nleak = 1\n", ["car.toml:4", "unknown key `leak`", ""]),
        ("launch = \"turbo\"\n", ["car.toml:3", "turbo", ""]),
        ("mass = 3\n", ["car.toml:3", "unknown key `mass`", ""]),
        ("[valve]\ngain = { current_a = [0, 1], gain_pa_a = [1e6, 1e6] }\n", ["car.toml:3", "missing key `delay`", ""]),
    ] {
        let error = car(text).unwrap_err();
        assert!(parts.iter().all(|part| error.contains(part)), "{text}: {error}");
    }
}

#[test]
fn a_gearbox_with_elements_without_plates_is_refused() {
    let of = |gearbox: &str| {
        let source = Source::built_in("car.toml", "name = \"car\"\ngearbox = \"g.toml\"\n");
        CarFile::from_sources(source, Source::built_in("g.toml", gearbox)).unwrap_err().to_string()
    };
    let at = GEARBOX.find("pack = {").unwrap();
    let end = at + GEARBOX[at..].find('}').unwrap() + 1;
    let bare = format!("{}{}", &GEARBOX[..at], &GEARBOX[end..]);
    assert!(of(&bare).contains("element A of \"g.toml\" has no `pack`"), "{}", of(&bare));
}

#[test]
fn a_vehicle_with_a_gearbox_is_not_one_with_a_single_shift() {
    let text = include_str!("../../../vehicles/eight_speed.toml");
    let error = config::VehicleFile::from_source(Source::built_in("v.toml", text)).unwrap_err().to_string();
    assert!(error.contains("v.toml:1: `gearbox`: is a vehicle with a whole gearbox"), "{error}");
}

#[test]
fn a_file_that_names_no_gearbox_is_told_so() {
    let folder = std::env::temp_dir();
    let path = folder.join(format!("wetclutch_no_gearbox_{}.toml", std::process::id()));
    std::fs::write(&path, "name = \"car\"\n").unwrap();
    let error = CarFile::read(&path).unwrap_err().to_string();
    std::fs::write(&path, "name = \"car\"\ngearbox = \"nowhere.toml\"\n").unwrap();
    let missing = CarFile::read(&path).unwrap_err().to_string();
    std::fs::remove_file(&path).unwrap();
    assert!(error.contains("names no gearbox file\nhint: gearbox = "), "{error}");
    assert!(missing.contains(":2: `gearbox`") && missing.contains("nowhere.toml"), "{missing}");
}

#[test]
fn the_shipped_drive_is_an_hour() {
    let drive = drive(include_str!("../../../drives/city.toml")).unwrap();
    assert_eq!(drive.duration_s(), 3600.0);
    assert!(matches!(drive.shifts, ShiftPlan::Schedule(_)));
}

#[test]
fn wrong_drive_files_get_their_line_and_a_hint() {
    let good = "[[segment]]\nduration_s = 3\nthrottle = 0.2\n";
    assert!(drive(&format!("name = \"d\"\n{good}")).is_ok());
    for (text, parts) in [
        ("name = \"d\"\nsegment = []\n".to_owned(), ["drive.toml:2", "no segment"]),
        ("name = \"d\"\n[[segment]]\nduration_s = 3\nthrottle = 20\n".to_owned(), ["drive.toml:4", "20 % is 0.2"]),
        ("name = \"d\"\n[[segment]]\nduration_s = 3\nthrottle = [0.0, nan]\n".to_owned(), ["drive.toml:4", "NaN"]),
        ("name = \"d\"\n[[segment]]\nduration_s = -3\nthrottle = 0.1\n".to_owned(), ["drive.toml:3", "is -3"]),
        ("name = \"d\"\n[[segment]]\nduration_s = 3\nthrottle = [0.1]\n".to_owned(), ["drive.toml:4", "[from, to]"]),
        (format!("name = \"d\"\nrepetitions = 1e9\n{good}"), ["drive.toml:2", "repetitions"]),
        (format!("name = \"../d\"\n{good}"), ["drive.toml:1", "cannot be the name of a file"]),
        (
            format!("name = \"d\"\nshift = [{{ time_s = 2, gear = \"2\" }}, {{ time_s = 1, gear = \"3\" }}]\n{good}"),
            ["drive.toml:2", "not after the shift before it"],
        ),
        (
            format!(
                "name = \"d\"\nschedule = {{ throttle = [0, 1], up_input_rad_s = [100, 200], down_input_rad_s = [50, 250] }}\n{good}"
            ),
            ["drive.toml:2", "not below `up_input_rad_s`"],
        ),
    ] {
        let error = drive(&text).unwrap_err();
        assert!(parts.iter().all(|part| error.contains(part)), "{text}: {error}");
    }
}

#[test]
fn the_budget_of_an_element_contains_the_valve_of_the_file() {
    let slow = "[valve]\nkind = \"proportional\"\nhysteresis_pa = 50e3\nlag = { pressure_pa = [0.0, 1e6], time_constant_s = [0.05, 0.04] }\ngain = { current_a = [0.0, 1.0], gain_pa_a = [1e6, 1e6] }\ndelay = { current_a = [0.0, 1.0], delay_s = [0.08, 0.06] }\n";
    let slow = car(slow).unwrap();
    let budget = ErrorBudget::of_car(&slow);
    let element = budget.elements.iter().flatten().next().unwrap();
    assert_eq!(element.valve_hysteresis_pa, 50e3);
    let [shortest_s, longest_s] = element.valve_delay_s;
    assert!((shortest_s - 0.045).abs() < 1e-12 && (longest_s - 0.095).abs() < 1e-12, "{:?}", element.valve_delay_s);
    // A shorter one is within the usual bounds.
    let usual = ErrorBudget::of_car(&car("").unwrap());
    assert_eq!(usual.elements.iter().flatten().next().unwrap().valve_delay_s, [0.0, 0.03]);
}

#[test]
fn bounds_that_do_not_contain_the_valve_of_the_file_are_refused() {
    let message = car("[clutch.B.error_bounds]\nvalve_delay_s = [0.1, 0.2]\n").unwrap_err();
    assert!(
        message.contains("car.toml:4: `clutch.B.error_bounds.valve_delay_s`: 0.1 to 0.2 does not contain"),
        "{message}"
    );
    assert!(message.contains("hint: [0.0") || message.contains("hint: [0"), "{message}");
    assert!(car("[clutch.B.error_bounds]\nvalve_delay_s = [0.0, 0.2]\n").is_ok());
    let message = car("[clutch.B.error_bounds]\nduty_percent = 2.0\n").unwrap_err();
    assert!(message.contains("`clutch.B.error_bounds.duty_percent`") && message.contains("`current_a`"), "{message}");
    // The file of one shift has the same rule.
    let text = include_str!("../../../vehicles/two_speed_at.toml");
    let late = text.replacen("valve_delay_s = [", "valve_delay_s = [0.1, 0.2] # [", 1);
    assert_ne!(late, text);
    let message = VehicleFile::from_source(Source::built_in("v.toml", &late)).unwrap_err().to_string();
    assert!(message.contains("`design.error_bounds.valve_delay_s`: 0.1 to 0.2 does not contain"), "{message}");
}

#[test]
fn one_pulse_width_valve_changes_no_limit_of_the_others() {
    let pulse_width = "[clutch.B.valve]\nkind = \"pulse-width\"\nflow_sqrt_pa_s = 6000\nline_pressure_pa = 1.6e6\ndelay = { duty_percent = [0.0, 100.0], delay_s = [0.016, 0.016] }\n";
    let (alone, mixed) = (car("").unwrap(), car(pulse_width).unwrap());
    let [alone, mixed] = [&alone.car, &mixed.car].map(ErrorBudget::of_car);
    let mut others = 0;
    for (alone, mixed) in alone.elements.iter().flatten().zip(mixed.elements.iter().flatten()) {
        if mixed.command_max == 100.0 {
            assert_eq!(mixed.command, 1.0);
        } else {
            assert_eq!(alone, mixed);
            assert!(mixed.command_max < 3.0 && mixed.command < 0.03, "{mixed:?}");
            others += 1;
        }
    }
    assert_eq!(others, 4);
}

#[test]
fn weak_valves_within_the_bounds_have_their_commands() {
    let bounds: String = ["A", "B", "C", "D", "E"]
        .map(|name| format!("[clutch.{name}.error_bounds]\nvalve_gain_factor = [0.75, 1.25]\ncurrent_a = 0.02\n"))
        .concat();
    let car = car(&bounds).unwrap();
    for (clutch, element) in car.clutches.iter().zip(&ErrorBudget::of_car(&car).elements) {
        let (Some(clutch), Some(element)) = (clutch, element) else { continue };
        assert_eq!((element.pressure_max_pa, element.command), (1.25 * car.line_pressure_pa, 0.02));
        let weak = clutch.valve.changed(1.0, 0.75, None);
        assert!(element.command_max > weak.command_for(car.line_pressure_pa));
    }
}

#[test]
fn a_typo_in_the_key_that_tells_the_kind_of_a_file_is_named_with_its_line() {
    for (text, words) in [
        ("name = \"x\"\ngerbox = \"8hp.toml\"\n", "x.toml:2: unknown key `gerbox`\nhint: did you mean `gearbox`?"),
        (
            "name = \"x\"\n\n[[segmnt]]\nduration_s = 3\n",
            "x.toml:3: unknown key `segmnt`\nhint: did you mean `segment`?",
        ),
        (
            "[[sgement]]\nduration_s = 3\n[[shift]]\ntime_s = 1\n",
            "x.toml:1: unknown key `sgement`\nhint: did you mean `segment`?",
        ),
        ("[desing]\n", "x.toml:1: unknown key `desing`\nhint: did you mean `design`?"),
        ("nonsense = 3\n", "x.toml:1: expected a vehicle file"),
    ] {
        let error = Source::built_in("x.toml", text).kind().unwrap_err().to_string();
        assert!(error.starts_with(words), "{error}");
        assert_eq!(error.contains("hint: did you mean `"), words.contains("unknown"), "{error}");
    }
}
