//! The files that ship, and files that are wrong.

#![expect(clippy::unwrap_used, reason = "a test may")]

use config::{Experiment, Kind, Source, Vehicle};

const VEHICLE: &str = include_str!("../../../vehicles/two_speed_at.toml");
const EXPERIMENT: &str = include_str!("../../../experiments/e1.toml");

/// The error for the built-in vehicle with one piece of its text replaced.
fn vehicle_error(from: &str, to: &str) -> String {
    assert!(VEHICLE.contains(from), "{from}");
    Vehicle::from_source(Source::built_in("vehicle.toml", &VEHICLE.replacen(from, to, 1))).unwrap_err().to_string()
}

fn experiment_error(from: &str, to: &str) -> String {
    assert!(EXPERIMENT.contains(from), "{from}");
    Experiment::from_source(Source::built_in("e.toml", &EXPERIMENT.replacen(from, to, 1))).unwrap_err().to_string()
}

fn line_of(text: &str, part: &str) -> usize {
    1 + text[..text.find(part).unwrap()].matches('\n').count()
}

#[test]
fn chapter_parameters_of_table_2_1_are_those_of_the_built_in_vehicle() {
    let v = Vehicle::two_speed_at().unwrap();
    assert_eq!((v.road.mass_kg, v.road.wheel_radius_m, v.road.front_area_m2), (1500.0, 0.3, 2.0));
    assert_eq!((v.engine.inertia_kg_m2, v.engine.drag_n_m_s), (0.17, 0.047));
    assert_eq!((v.driveline.final_ratio, v.driveline.shaft_stiffness_n_m_rad), (3.0, 13e3));
    assert_eq!((v.tyre.max_force_n, v.tyre.slip_scale), (13.2e3, 0.1));
    let b = &v.oncoming.clutch;
    assert!((b.lever() * b.piston_area_m2 - 0.0039).abs() < 1e-12);
    assert_eq!(b.return_spring_n, 600.0);
    let (least, greatest) = b.friction.range();
    assert!(least >= 0.10 && greatest <= 0.16);
    assert_eq!(v.oncoming.valve.time_constant_s.range(), (0.02, 0.20));
    assert_eq!(v.oncoming.valve.delay_s.range(), (0.0, 0.03));
}

#[test]
fn a_value_in_the_wrong_unit_gets_file_line_key_range_and_hint() {
    let line = line_of(VEHICLE, "piston_area_m2 = 0.01 ");
    assert_eq!(
        vehicle_error("piston_area_m2 = 0.01 ", "piston_area_m2 = 117 "),
        format!(
            "vehicle.toml:{line}: `clutch.b.piston_area_m2` is 117, expected 0.001 to 0.05\n\
             hint: 117 cm2 is 0.0117 m2"
        )
    );
}

#[test]
fn an_unknown_key_a_missing_key_and_a_wrong_type_are_named() {
    let unknown = vehicle_error("slip_scale = 0.1", "slip_scale = 0.1\nslip_scal = 0.1");
    assert!(unknown.contains("unknown field `slip_scal`"), "{unknown}");
    let missing = vehicle_error("slip_scale = 0.1", "");
    assert!(missing.contains("missing field `slip_scale`"), "{missing}");
    let line = line_of(VEHICLE, "slip_scale");
    let wrong = vehicle_error("slip_scale = 0.1", "slip_scale = \"0.1\"");
    assert!(wrong.starts_with(&format!("vehicle.toml:{line}:")) && wrong.contains("string"), "{wrong}");
    let broken = vehicle_error("[tyre]", "[tyre");
    assert!(broken.starts_with(&format!("vehicle.toml:{}:", line_of(VEHICLE, "[tyre]"))), "{broken}");
}

#[test]
fn maps_that_do_not_fit_are_refused() {
    let short = vehicle_error("[-13.3, 45, 90,", "[-13.3, 45,");
    assert!(short.contains("`engine.torque.torque_n_m[0]`: row has 8 torques, `throttle` 9 positions"), "{short}");
    let falling = vehicle_error("throttle = [0.0, 0.05, 0.10", "throttle = [0.0, 0.10, 0.05");
    assert!(falling.contains("breakpoint 3 is not above the one before it"), "{falling}");
    let creating = vehicle_error(
        "2.00, 1.88, 1.77, 1.66, 1.55, 1.43, 1.32, 1.21, 1.10,",
        "2.00, 1.88, 1.77, 1.66, 1.55, 1.43, 1.32, 1.21, 1.60,",
    );
    assert!(creating.contains("at a speed ratio of 0.8 the turbine gives more power"), "{creating}");
}

#[test]
fn a_gear_train_that_is_none_is_refused_with_the_reason() {
    let unknown = vehicle_error("carrier = \"carrier\"", "carrier = \"planets\"");
    assert!(
        unknown.contains("there is no shaft \"planets\"\nhint: the shafts are turbine, ring, carrier"),
        "{unknown}"
    );
    let downshift = vehicle_error("offgoing = \"a\"\noncoming = \"b\"", "offgoing = \"b\"\noncoming = \"a\"");
    assert!(downshift.contains("the ratio goes from 1.000 to 2.500, and an upshift lowers it"), "{downshift}");
    let free = vehicle_error(
        "[[gear_train.planetary_set]]\nsun = \"turbine\"\nring = \"ring\"\ncarrier = \"carrier\"\nsun_teeth = 40  # [chapter]\nring_teeth = 60 # [chapter]\n",
        "",
    );
    assert!(free.contains("leave 3 degrees of freedom"), "{free}");
    let clutch = vehicle_error("oncoming = \"b\"", "oncoming = \"c\"");
    assert!(clutch.contains("there is no [clutch.c]\nhint: the clutches are a, b"), "{clutch}");
}

#[test]
fn a_clutch_that_holds_less_than_it_drags_is_refused() {
    let error = vehicle_error("static_friction = 0.13 #", "static_friction = 0.11 #");
    assert!(error.contains("`clutch.b.static_friction`: is 0.11, less than the 0.12"), "{error}");
}

#[test]
fn an_experiment_with_degrees_or_percent_is_told_so() {
    let line = line_of(EXPERIMENT, "[throttle]") + 2;
    let percent = experiment_error("position = [0.05, 0.05, 0.22]", "position = [0.05, 0.05, 22]");
    assert_eq!(
        percent,
        format!("e.toml:{line}: `throttle.position[2]` is 22, expected 0 to 1\nhint: 22 % is 0.22 as a fraction")
    );
    let grade = experiment_error("[shift]", "[off_nominal]\ngrade_rad = 5\n\n[shift]");
    assert!(grade.contains("hint: 5 degrees is 0.0872665 rad"), "{grade}");
    let late = experiment_error("request_s = ", "request_s = 1");
    assert!(late.contains("expected 0 to 9.5"), "{late}");
}

#[test]
fn a_method_goes_with_gains_that_are_designed() {
    let error = experiment_error("kind = \"kalman\"", "kind = \"kalman\"\nmethod = \"scheduled\"");
    assert!(error.contains("has a method and no gains to design\nhint: leave `method` out"), "{error}");
    let unknown = experiment_error("method = \"peak-to-peak\"", "method = \"peak\"");
    assert!(unknown.contains("unknown variant `peak`") && unknown.contains("interval"), "{unknown}");
}

#[test]
fn files_are_told_apart_by_what_they_describe() {
    assert_eq!(Source::built_in("v", VEHICLE).kind().unwrap(), Kind::Vehicle);
    assert_eq!(Source::built_in("e", EXPERIMENT).kind().unwrap(), Kind::Experiment);
    assert!(Source::built_in("x", "a = 1").kind().is_err());
}
