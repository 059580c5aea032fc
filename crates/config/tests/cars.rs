//! Vehicle files with a gearbox file, and drive files.

use config::{Car, Drive, ShiftPlan, Source};

const GEARBOX: &str = include_str!("../../../gearboxes/8hp.toml");

fn car(text: &str) -> Result<Car, String> {
    let text = format!("name = \"car\"\ngearbox = \"8hp.toml\"\n{text}");
    let (source, gearbox) = (Source::built_in("car.toml", &text), Source::built_in("8hp.toml", GEARBOX));
    Car::from_sources(source, gearbox).map_err(|error| error.to_string())
}

fn drive(text: &str) -> Result<Drive, String> {
    Drive::from_source(Source::built_in("drive.toml", text)).map_err(|error| error.to_string())
}

#[test]
fn a_name_and_a_gearbox_are_a_complete_vehicle_file() {
    let (short, whole) = (car("").unwrap(), Car::eight_speed().unwrap());
    assert_eq!(short.clutches, whole.clutches);
    assert_eq!((short.engine, short.converter, short.road), (whole.engine, whole.converter, whole.road));
    assert_eq!(short.defaults_taken.len(), 10);
    assert!(whole.defaults_taken.is_empty(), "{:?}", whole.defaults_taken);
}

#[test]
fn a_key_of_the_file_replaces_that_of_the_eight_speed_car() {
    let car = car("[vehicle]\nmass_kg = 2000\n[clutch.C]\ndrag_n_m = 3.0\n").unwrap();
    assert_eq!((car.road.mass_kg, car.road.wheel_radius_m), (2000.0, 0.3));
    let drags: Vec<f64> = car.clutches.iter().flatten().map(|clutch| clutch.drag_n_m).collect();
    assert_eq!(drags, [1.1, 1.1, 3.0, 1.1, 1.1]);
}

#[test]
fn a_table_fill_gives_the_pistons_a_stroke() {
    let strokes = |text: &str| -> Vec<Option<f64>> {
        let mm = |clutch: &config::ShiftClutch| 1e3 * clutch.cylinder.stroke_m3 / clutch.clutch.piston_area_m2;
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
    let shipped = Car::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../vehicles/eight_speed_stroke.toml").as_ref());
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
    assert!(crate::car(pulse).unwrap_err().contains("another kind of valve"));
    let single = include_str!("../../../vehicles/two_speed_at.toml")
        .replace("[clutch.b.valve]\n", "[clutch.b.valve]\nzero_pressure_a = 1.1\n");
    let error = config::Vehicle::from_source(Source::built_in("v.toml", &single)).unwrap_err().to_string();
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
        ("dual_clutch", 2),
    ] {
        let path = format!("{folder}{name}.toml");
        let car = Car::read(path.as_ref()).unwrap();
        assert_eq!(car.clutches.iter().flatten().count(), elements, "{name}");
        assert_eq!(Source::read(path.as_ref()).unwrap().kind().unwrap(), config::Kind::Car);
    }
}

#[test]
fn wrong_vehicle_files_get_their_line_and_a_hint() {
    for (text, parts) in [
        ("[vehicle]\nmass_kg = nan\n", ["car.toml:4", "vehicle.mass_kg", "expected 200 to 60000"]),
        ("[hydraulics]\nline_pressure_pa = 16.0\n", ["car.toml:4", "is 16", "16 bar is 1600000 Pa"]),
        ("[hydraulics]\nline_pressure_pa = 1.05e5\n", ["car.toml:4", "return spring of B", ""]),
        ("[clutch.K1]\ndrag_n_m = 1.0\n", ["car.toml:3", "no clutch or brake \"K1\"", "hint: it has A, B, C, D, E"]),
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
        ("[clutch.B.fill]\nleak = 1\n", ["car.toml:4", "unknown field `leak`", ""]),
        ("launch = \"turbo\"\n", ["car.toml:3", "turbo", ""]),
        ("mass = 3\n", ["car.toml:3", "unknown field `mass`", ""]),
        (
            "[valve]\ngain = { current_a = [0, 1], gain_pa_a = [1e6, 1e6] }\n",
            ["car.toml:3", "missing field `delay`", ""],
        ),
    ] {
        let error = car(text).unwrap_err();
        assert!(parts.iter().all(|part| error.contains(part)), "{text}: {error}");
    }
}

#[test]
fn a_gearbox_without_stick_diagram_or_plates_is_refused() {
    let of = |gearbox: &str| {
        let source = Source::built_in("car.toml", "name = \"car\"\ngearbox = \"g.toml\"\n");
        Car::from_sources(source, Source::built_in("g.toml", gearbox)).unwrap_err().to_string()
    };
    let ratios =
        "name = \"g\"\nlevel = \"ratios\"\ngear = [{ name = \"1\", ratio = 3.0 }, { name = \"2\", ratio = 2.0 }]\n";
    assert!(of(ratios).contains("no stick diagram\nhint: a simulated car needs"));
    let at = GEARBOX.find("pack = {").unwrap();
    let end = at + GEARBOX[at..].find('}').unwrap() + 1;
    let bare = format!("{}{}", &GEARBOX[..at], &GEARBOX[end..]);
    assert!(of(&bare).contains("element A of \"g.toml\" has no `pack`"), "{}", of(&bare));
}

#[test]
fn a_vehicle_with_a_gearbox_is_not_one_with_a_single_shift() {
    let text = include_str!("../../../vehicles/eight_speed.toml");
    let error = config::Vehicle::from_source(Source::built_in("v.toml", text)).unwrap_err().to_string();
    assert!(error.contains("v.toml:1: `gearbox`: is a vehicle with a whole gearbox"), "{error}");
}

#[test]
fn a_file_that_names_no_gearbox_is_told_so() {
    let folder = std::env::temp_dir();
    let path = folder.join(format!("wetclutch_no_gearbox_{}.toml", std::process::id()));
    std::fs::write(&path, "name = \"car\"\n").unwrap();
    let error = Car::read(&path).unwrap_err().to_string();
    std::fs::write(&path, "name = \"car\"\ngearbox = \"nowhere.toml\"\n").unwrap();
    let missing = Car::read(&path).unwrap_err().to_string();
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
