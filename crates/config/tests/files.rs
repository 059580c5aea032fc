//! The files that ship, and files that are wrong.

#![expect(clippy::unwrap_used, reason = "a test may")]

use config::{Experiment, Kind, ReadingErrors, Source, Vehicle};

const VEHICLE: &str = include_str!("../../../vehicles/two_speed_at.toml");
const EXPERIMENT: &str = include_str!("../../../experiments/e1.toml");
/// An experiment with sensors and scenarios.
const BENCH: &str = include_str!("../../../experiments/bench.toml");

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
    let drivetrain::ClutchValve::Proportional(maps) = v.oncoming.valve else { panic!() };
    assert_eq!(maps.time_constant_s.range(), (0.02, 0.20));
    assert_eq!(maps.delay_s.range(), (0.0, 0.03));
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
    assert!(
        short.contains("`engine.torque.torque_n_m[0]`: the row has 8 torques, but `throttle` has 9 positions"),
        "{short}"
    );
    let falling = vehicle_error("throttle = [0.0, 0.05, 0.10", "throttle = [0.0, 0.10, 0.05");
    assert!(falling.contains("breakpoint 3 is not above the breakpoint before it"), "{falling}");
    let creating = vehicle_error(
        "2.00, 1.88, 1.77, 1.66, 1.55, 1.43, 1.32, 1.21, 1.10,",
        "2.00, 1.88, 1.77, 1.66, 1.55, 1.43, 1.32, 1.21, 1.60,",
    );
    assert!(creating.contains("at a speed ratio of 0.8 the turbine power is larger"), "{creating}");
}

#[test]
fn a_gear_train_that_is_none_is_refused_with_the_reason() {
    let unknown = vehicle_error("carrier = \"carrier\"", "carrier = \"planets\"");
    assert!(
        unknown.contains("there is no shaft \"planets\"\nhint: the shafts are turbine, ring, carrier"),
        "{unknown}"
    );
    let downshift = vehicle_error("offgoing = \"a\"\noncoming = \"b\"", "offgoing = \"b\"\noncoming = \"a\"");
    assert!(
        downshift.contains("the ratio changes from 1.000 to 2.500, but an upshift decreases the ratio"),
        "{downshift}"
    );
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
    assert!(
        error.contains("`clutch.b.static_friction`: is 0.11, less than the value of `friction` at zero slip, 0.12"),
        "{error}"
    );
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
    assert!(error.contains("has a `method`, but no gains are designed for it\nhint: remove `method`"), "{error}");
    let unknown = experiment_error("method = \"peak-to-peak\"", "method = \"peak\"");
    assert!(unknown.contains("unknown variant `peak`") && unknown.contains("interval"), "{unknown}");
}

#[test]
fn every_number_of_given_gains_lies_in_a_range_and_is_named() {
    let with = |gains: &str| {
        let entry = format!("kind = \"rigid\"\nsample_time_s = 0.001\ngains = {gains}");
        let error = experiment_error("kind = \"rigid\"\nsample_time_s = 0.001", &entry);
        let line = line_of(EXPERIMENT, "kind = \"rigid\"") + 2;
        assert!(error.starts_with(&format!("e.toml:{line}: ")), "{error}");
        error
    };
    for bad in ["nan", "inf", "1e300"] {
        let error = with(&format!("{{ torque_phase_pa_s_rad = {bad}, inertia_phase_pa_s_rad = [1, 2] }}"));
        assert!(error.contains("`observer.gains.torque_phase_pa_s_rad` is") && error.contains("expected"), "{error}");
        let error = with(&format!("{{ torque_phase_pa_s_rad = 1, inertia_phase_pa_s_rad = [1, {bad}] }}"));
        assert!(error.contains("`observer.gains.inertia_phase_pa_s_rad[1]` is"), "{error}");
    }
    assert!(with("{ torque_phase_pa_s_rad = 1 }").contains("missing `inertia_phase_pa_s_rad`"));
    assert!(with("{ torque_phase_pa_s_rad = 1, inertia_phase_pa_s_rad = [1] }").contains("has 1 numbers, expected 2"));
    assert!(with("{ torque_speed_rad_s2 = 1 }").contains("has gains of another kind"));
}

#[test]
fn a_valve_whose_told_numbers_are_wrong_is_named_with_its_line() {
    let line = line_of(VEHICLE, "gain_pa_a = 1.0e6");
    let error = vehicle_error("gain_pa_a = 1.0e6", "gain_pa_a = nan  ");
    assert!(error.starts_with(&format!("vehicle.toml:{line}: `observer.valve.gain_pa_a` is NaN")), "{error}");
    let foreign = vehicle_error("gain_pa_a = 1.0e6", "gain_pa_a = 1.0e6\nflow_sqrt_pa_s = 1");
    assert!(foreign.contains("has a key of another kind of valve\nhint: proportional: time_constant_s"), "{foreign}");
}

#[test]
fn a_gain_map_whose_pressure_falls_with_the_current_is_refused() {
    let gains = "gain_pa_a = [0.70e6, 0.80e6, 0.88e6, 0.94e6, 1.00e6, 1.05e6, 1.10e6]";
    let falling = vehicle_error(gains, &gains.replace("1.00e6", "0.10e6"));
    assert!(falling.contains("`clutch.a.valve.gain.gain_pa_a`: the steady-state pressure (gain times current) falls from 0.2820 MPa at 0.300 A to 0.0500 MPa at 0.500 A"), "{falling}");
    // Equal pressures at both ends, and a parabola between them that rises and falls.
    let equal = gains.replace("0.94e6, 1.00e6", "0.94e6, 0.564e6");
    let between = vehicle_error(gains, &equal);
    assert!(between.contains("falls from 0.3008 MPa at 0.400 A to 0.2820 MPa at 0.500 A"), "{between}");
    // Beyond the largest command nobody goes: at 5 A this one falls.
    let map = "gain = { current_a = [0.0, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0], ";
    let far =
        VEHICLE.replace(map, &map.replace("0.7, 1.0", "0.7, 5.0")).replace(gains, &gains.replace("1.10e6", "0.9e6"));
    Vehicle::from_source(Source::built_in("vehicle.toml", &far)).unwrap();
}

#[test]
fn a_planetary_set_without_room_for_planets_is_refused() {
    let line = line_of(VEHICLE, "ring_teeth = 60");
    let error = vehicle_error("sun_teeth = 40", "sun_teeth = 80");
    assert!(
        error.starts_with(&format!("vehicle.toml:{line}: `gear_train.planetary_set.ring_teeth`: is 60")),
        "{error}"
    );
    assert!(vehicle_error("sun_teeth = 40", "sun_teeth = 40.5").contains("expected an integer"));
    let twice = vehicle_error("name = \"ring\"", "name = \"carrier\"");
    assert!(twice.contains("two entries have the name \"carrier\""), "{twice}");
}

#[test]
fn a_wrong_breakpoint_is_blamed_on_its_own_axis() {
    let line = line_of(VEHICLE, "speed_rad_s = [83.78");
    let speed = vehicle_error("speed_rad_s = [83.78, 136.14", "speed_rad_s = [136.14, 83.78");
    assert!(speed.starts_with(&format!("vehicle.toml:{line}: `engine.torque.speed_rad_s`: breakpoint 2")), "{speed}");
    let ratio = vehicle_error("speed_ratio = [0.0, 0.10", "speed_ratio = [0.10, 0.0");
    assert!(ratio.contains("`converter.speed_ratio`: breakpoint 2"), "{ratio}");
    let near = vehicle_error("current_a = [0.0, 0.1,", "current_a = [0.0, 1e-308,");
    assert!(near.contains("`clutch.a.valve.gain.current_a`: breakpoint 2 is less than 0.00001 above"), "{near}");
}

#[test]
fn a_converter_creates_no_power_between_its_breakpoints_and_none_in_overrun() {
    // 1.98 times 0.5 and 1 times 1 are below 1 and 1; halfway between, 1.49 times 0.75 is not.
    let table = "[converter]\nspeed_ratio = [0.0, 0.5, 1.0, 1.5]\ncapacity_n_m_s2 = [4e-3, 3e-3, 0.0, -2e-3]\n\
                 torque_ratio = [2.0, 1.98, 1.0, 1.0]\n\n";
    let (from, to) = (VEHICLE.find("[converter]").unwrap(), VEHICLE.find("[gear_train]").unwrap());
    let error = vehicle_error(&VEHICLE[from..to], table);
    assert!(error.contains("the turbine power is larger than the pump power"), "{error}");
    let short =
        table.replace(", 1.0, 1.5]", ", 0.9, 0.95]").replace("0.0, -2e-3]", "2e-3, 1e-3]").replace("1.98", "1.5");
    let error = vehicle_error(&VEHICLE[from..to], &short);
    assert!(
        error.contains("is 0.001 at the last speed ratio, 0.95, and would have this value in overrun too"),
        "{error}"
    );
}

#[test]
fn a_budget_that_leaves_out_its_own_car_is_refused() {
    let error = vehicle_error("valve_gain_factor = [0.9, 1.1]", "valve_gain_factor = [0.1, 0.2]");
    assert!(error.contains("0.1 to 0.2 does not contain 1") && error.contains("hint:"), "{error}");
}

/// The built-in vehicle with these keys in place of `command_age_s`, and with this table of its stroke's limits.
fn with_budget(keys: &str, fill: &str) -> Result<Vehicle, String> {
    let from = VEHICLE.find("command_age_s").unwrap();
    let to = from + VEHICLE[from..].find("float32_rounding").unwrap();
    let text = format!("{}{keys}\n{}\n[design.error_bounds.fill]\n{fill}\n", &VEHICLE[..from], &VEHICLE[to..]);
    Vehicle::from_source(Source::built_in("vehicle.toml", &text)).map_err(|error| error.to_string())
}

#[test]
fn what_a_budget_leaves_out_of_valve_and_stroke_has_defaults_and_what_it_holds_is_checked() {
    assert!(Vehicle::two_speed_at().unwrap().error_bounds.fill.is_none());
    let bounds = with_budget("", "").unwrap().error_bounds;
    assert_eq!((bounds.valve_hysteresis_pa, bounds.command_age_s), (10e3, 0.05));
    assert_eq!(bounds.line_pressure_pa, [bounds.pressure_max_pa; 2]);
    let fill = bounds.fill.unwrap();
    assert!(fill.volume_m3.iter().zip([9e-6, 15e-6]).all(|(x, y)| (x - y).abs() < 1e-12), "{fill:?}");
    assert!(fill.kiss_pressure_pa[0] < 60e3 && fill.kiss_pressure_pa[1] > 60e3);
    assert!(fill.viscosity_m2_s[0] < fill.viscosity_m2_s[1]);

    let given =
        with_budget("command_age_s = 0\nline_pressure_pa = [0.6e6, 1.1e6]", "volume_factor = [0.9, 1.2]").unwrap();
    assert_eq!((given.error_bounds.command_age_s, given.error_bounds.line_pressure_pa), (0.0, [0.6e6, 1.1e6]));
    assert!((given.error_bounds.fill.unwrap().volume_m3[1] - 14.4e-6).abs() < 1e-12);

    let line = with_budget("line_pressure_pa = [0.6e6, 1.3e6]", "").unwrap_err();
    assert!(line.contains("`design.error_bounds.line_pressure_pa[1]` is 1300000, expected 0 to 1250000"), "{line}");
    for (fill, expected) in [
        (
            "volume_factor = [1.1, 1.2]",
            "`design.error_bounds.fill.volume_factor`: 1.1 to 1.2 does not contain 1: the car",
        ),
        ("kiss_pressure_pa = [0.07e6, 0.08e6]", "fill.kiss_pressure_pa`: 70000 to 80000 does not contain 60000"),
        ("oil_temperature_degc = [20, 40]", "fill.oil_temperature_degc`: 20 to 40 does not contain 80"),
        (
            "preload_pressure_pa = [40e3, 70e3]",
            "is above `kiss_pressure_pa`, [54000.0, 66000.0] Pa\nhint: the return spring",
        ),
        ("leak_m3_s_pa = 1e-12", "fill.leak_m3_s_pa` is 0.000000000001, expected 0.000000000002 to"),
        ("volume_m3 = [1, 2]", "unknown field `volume_m3`"),
    ] {
        let error = with_budget("", fill).unwrap_err();
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn a_clutch_that_the_shift_leaves_alone_is_checked_too() {
    let (from, to) = (VEHICLE.find("[clutch.b]").unwrap(), VEHICLE.find("[driveline]").unwrap());
    let third =
        VEHICLE[from..to].replace("clutch.b", "clutch.c").replace("static_friction = 0.13", "static_friction = 13");
    let error = vehicle_error("[driveline]", &format!("{third}\n[driveline]"));
    assert!(error.contains("`clutch.c.static_friction` is 13"), "{error}");
}

#[test]
fn forward_euler_beyond_the_time_constant_of_the_valve_is_refused() {
    let euler = EXPERIMENT
        .replace("kind = \"open-loop\"\nsample_time_s = 0.001", "kind = \"open-loop\"\ndiscretisation = \"euler\"");
    let experiment = Experiment::from_source(Source::built_in("e.toml", &euler)).unwrap();
    let told = |time_constant_s: &str| {
        let text = VEHICLE.replace("time_constant_s = 0.04 ", &format!("time_constant_s = {time_constant_s} "));
        experiment.check_observers(&Vehicle::from_source(Source::built_in("v.toml", &text)).unwrap())
    };
    told("0.04").unwrap();
    told("0.01").unwrap();
    let line = line_of(&euler, "[[observer]]\nname = \"open loop\"");
    let error = told("0.004").unwrap_err().to_string();
    assert!(error.starts_with(&format!("e.toml:{line}: `observer \"open loop\"`: a sample time of 0.01 s is longer than the valve's time constant of 0.0040 s")), "{error}");
    assert!(error.contains("by -1.500 in each sample\nhint: use discretisation = \"exact\""), "{error}");
}

#[test]
fn an_observer_cannot_be_faster_than_the_signals() {
    let text = EXPERIMENT.replace("sample_time_s = 0.001 # of the", "sample_time_s = 0.002 # of the");
    let experiment = Experiment::from_source(Source::built_in("e.toml", &text)).unwrap();
    let error = experiment.check_observers(&Vehicle::two_speed_at().unwrap()).unwrap_err().to_string();
    assert!(
        error.contains("`observer \"rigid ISS\"`: a sample time of 0.001 s is shorter than the 0.002 s"),
        "{error}"
    );
}

#[test]
fn the_experiments_that_ship_go_with_the_vehicle_that_ships() {
    let vehicle = Vehicle::two_speed_at().unwrap();
    for experiment in Experiment::built_in().unwrap().iter().chain([&Experiment::bench().unwrap()]) {
        experiment.check_observers(&vehicle).unwrap();
    }
}

#[test]
fn names_are_distinct_and_stay_in_their_folder() {
    let escaped = experiment_error("name = \"E1\"", "name = \"../../E1\"");
    assert!(escaped.contains("cannot be the name of a file\nhint: use letters"), "{escaped}");
    assert!(experiment_error("name = \"E1\"", "name = \"\"").contains("cannot be the name of a file"));
    let twice = experiment_error("name = \"sliding\"", "name = \"compliant\"");
    assert!(twice.contains("`observer.name`: two observers are called \"compliant\""), "{twice}");
}

/// The bench with lines added to the table of its wheel sensor.
fn with_wheel(lines: &str) -> Result<Experiment, config::ConfigError> {
    let text = BENCH.replacen("noise_rad_s = 0.02\n", &format!("noise_rad_s = 0.02\n{lines}\n"), 1);
    assert!(text != BENCH);
    Experiment::from_source(Source::built_in("e.toml", &text))
}

fn bench_error(from: &str, to: &str) -> String {
    assert!(BENCH.contains(from), "{from}");
    Experiment::from_source(Source::built_in("e.toml", &BENCH.replacen(from, to, 1))).unwrap_err().to_string()
}

#[test]
fn observers_are_never_told_the_errors_of_a_sensor() {
    let errors = "scale = 1.02\nmissing_share = 0.03\nburst_s = 0.05\nfrozen_s = 0.05\noutliers = 2";
    let experiment = with_wheel(errors).unwrap();
    let (real, told) = (experiment.sensors.unwrap(), experiment.sensors_told.unwrap());
    assert_eq!((real.wheel.errors.scale, real.wheel.errors.outliers), (1.02, 2.0));
    assert_eq!(told, Experiment::bench().unwrap().sensors_told.unwrap());
    assert_eq!(told.wheel.errors, ReadingErrors::NONE);
}

#[test]
fn a_sensor_without_error_keys_has_no_errors() {
    let sensors = Experiment::bench().unwrap().sensors.unwrap();
    assert_eq!(sensors, sensors.without_errors());
    assert_eq!((sensors.wheel.offset_s, sensors.row_offset_s, sensors.outliers), (0.0, 0.0, 0.0));
}

#[test]
fn a_scenario_changes_what_it_names_of_the_sensors_and_nothing_that_observers_are_told() {
    let scenario = "[[scenario]]\nname = \"worn\"\nrow_time_s = 0.005\nsensors.missing_share = 0.03\n\
                    sensors.turbine.missing_share = 0.0\nsensors.wheel.scale = 1.01\nsensors.wheel.delay_s = 0.02\n";
    let text = [BENCH, scenario].concat();
    let experiment = Experiment::from_source(Source::built_in("e.toml", &text)).unwrap();
    let varied = experiment.with_scenario(experiment.scenarios.last().unwrap());
    let (before, after) = (experiment.sensors.unwrap(), varied.sensors.unwrap());
    assert_eq!((after.wheel.errors.scale, after.wheel.delay_s, after.wheel.teeth), (1.01, 0.02, before.wheel.teeth));
    let share = |sensor: &config::SpeedSensor| sensor.errors.missing_share;
    assert_eq!([&after.engine, &after.turbine, &after.output, &after.wheel].map(share), [0.03, 0.0, 0.03, 0.03]);
    assert_eq!(after.current.unwrap().errors.missing_share, 0.03);
    assert_eq!(varied.sensors_told, experiment.sensors_told);
    for (entry, before) in varied.observers.iter().zip(&experiment.observers) {
        assert_eq!(entry.sample_time_s, if entry.real_sensors { 0.005 } else { before.sample_time_s });
    }
}

#[test]
fn a_wrong_error_of_a_sensor_is_named_with_its_place() {
    let wrong = |lines: &str| with_wheel(lines).unwrap_err().to_string();
    let line = line_of(BENCH, "noise_rad_s = 0.02\n") + 1;
    assert_eq!(wrong("scale = 3"), format!("e.toml:{line}: `sensors.wheel.scale` is 3, expected 0.5 to 2"));
    assert!(wrong("missing_share = 5").ends_with("expected 0 to 1\nhint: 5 % is 0.05 as a fraction"));
    assert!(wrong("burst_s = 50").ends_with("expected 0 to 10\nhint: 50 ms is 0.05 s"));
    assert!(wrong("outliers = 1.5").contains("`sensors.wheel.outliers`: is 1.5, expected an integer"));
    assert!(wrong("scael = 1").contains("unknown field `scael`"));
    let missing = bench_error("teeth = 48\n", "");
    let line = line_of(BENCH, "[sensors.wheel]");
    assert_eq!(missing, format!("e.toml:{line}: `sensors.wheel`: missing `teeth`"));
    let (from, to) = (BENCH.find("[sensors.wheel]").unwrap(), BENCH.find("noise_rad_s = 0.02\n").unwrap());
    let missing = bench_error(&BENCH[from..to + "noise_rad_s = 0.02\n".len()], "");
    assert!(missing.starts_with(&format!("e.toml:{}: `sensors`: missing `wheel`", line_of(BENCH, "[sensors]"))));
    let clock = bench_error("resolution_a = 0.001", "resolution_a = 0.001, offset_s = 0.001");
    assert!(
        clock.contains("`sensors.current.offset_s`: has no clock of its own") && clock.contains("hint:"),
        "{clock}"
    );
}

#[test]
fn a_wrong_scenario_of_the_sensors_is_named_with_its_place() {
    let wrong = |experiment: &str, lines: &str| {
        let text = [experiment, "[[scenario]]\nname = \"x\"\n", lines, "\n"].concat();
        let error = Experiment::from_source(Source::built_in("e.toml", &text)).unwrap_err().to_string();
        let line = text.lines().count();
        assert!(error.starts_with(&format!("e.toml:{line}: ")), "{error}");
        error
    };
    let scale = wrong(BENCH, "sensors.wheel.scale = 101");
    assert!(scale.contains("`scenario.sensors.wheel.scale` is 101, expected 0.5 to 2"), "{scale}");
    assert!(wrong(BENCH, "sensors.seed = 3").contains("hint: remove `seed`"));
    let fast = wrong(BENCH, "row_time_s = 0.0001");
    assert!(fast.contains("`scenario.row_time_s` is 0.0001, expected 0.001 to 0.2"), "{fast}");
    let draws = bench_error("duration_s = ", "draws = 0\nduration_s = ");
    assert!(draws.contains("`draws` is 0, expected 1 to 1000"), "{draws}");
    let (from, to) = (BENCH.find("[sensors]").unwrap(), BENCH.find("[[observer]]").unwrap());
    let ideal = [&BENCH[..from], &BENCH[to..]].concat().replace("sensors = \"real\"", "");
    assert!(wrong(&ideal, "sensors.outliers = 1").contains("the file has no [sensors] table\nhint: add"));
}

#[test]
fn rows_of_a_scenario_that_forward_euler_cannot_carry_are_refused() {
    let rows = "[[scenario]]\nname = \"slow rows\"\nrow_time_s = 0.1\n";
    let text = [BENCH, rows].concat();
    let euler = text.replacen("sensors = \"real\"", "sensors = \"real\"\ndiscretisation = \"euler\"", 1);
    assert!(euler != text);
    let vehicle = Vehicle::two_speed_at().unwrap();
    let checked =
        |text: &str| Experiment::from_source(Source::built_in("e.toml", text)).unwrap().check_observers(&vehicle);
    checked(&text).unwrap();
    assert!(checked(&euler).unwrap_err().to_string().contains("a sample time of 0.1 s is longer than"));
}

/// A folder that goes away with the test.
struct Folder(std::path::PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("wetclutch-files-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn with(&self, name: &str, text: &str) -> std::path::PathBuf {
        std::fs::write(self.0.join(name), text).unwrap();
        self.0.join(name)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

#[test]
fn an_error_of_two_files_names_the_one_that_the_value_is_from() {
    let folder = Folder::new("overlay");
    let good = folder.with("v.toml", VEHICLE);
    let over = folder.with("b.toml", "# found\n[design.torque_phase]\nmodel_error_max_rad_s2 = -5\n");
    let error = Vehicle::read_with(&good, &over).unwrap_err().to_string();
    assert_eq!(
        error,
        format!("{}:3: `design.torque_phase.model_error_max_rad_s2` is -5, expected 0 to 1000000", over.display())
    );
    let bad = folder.with("bad.toml", &VEHICLE.replace("mass_kg = 1500", "mass_kg = 1"));
    let fine = folder.with("fine.toml", "[design.torque_phase]\nmodel_error_max_rad_s2 = 5\n");
    let error = Vehicle::read_with(&bad, &fine).unwrap_err().to_string();
    let line = line_of(VEHICLE, "mass_kg = 1500");
    assert!(error.starts_with(&format!("{}:{line}: `vehicle.mass_kg` is 1", bad.display())), "{error}");
    let unknown = folder.with("unknown.toml", "[design.torque_phase]\n\nmodel_eror = 5\n");
    let error = Vehicle::read_with(&good, &unknown).unwrap_err().to_string();
    assert!(error.starts_with(&format!("{}:3: unknown field `model_eror`", unknown.display())), "{error}");
    let broken = folder.with("broken.toml", "[design.torque_phase]\nmodel_error_max_rad_s2 =\n");
    let error = Vehicle::read_with(&good, &broken).unwrap_err().to_string();
    assert!(error.starts_with(&format!("{}:2: ", broken.display())), "{error}");
    let vehicle = Vehicle::read_with(&good, &fine).unwrap();
    assert_eq!((vehicle.torque_phase.model_error_max_rad_s2, vehicle.road.mass_kg), (5.0, 1500.0));
}

#[test]
fn values_for_a_vehicle_file_are_checked_by_themselves() {
    let of = |text: &str| Source::built_in("b.toml", text);
    let good = of("[design.torque_phase]\nmodel_error_max_rad_s2 = 5\n");
    assert_eq!(good.kind().unwrap(), Kind::Overlay);
    Vehicle::check_overlay(&good).unwrap();
    let error = Vehicle::check_overlay(&of("[design.torque_phase]\nsettling_time_s = 0\n")).unwrap_err().to_string();
    assert!(error.starts_with("b.toml:2: `design.torque_phase.settling_time_s` is 0"), "{error}");
}

#[test]
fn a_missing_file_is_reported_where_it_is_named() {
    let folder = Folder::new("missing");
    let named = folder.with("e.toml", &EXPERIMENT.replace("../vehicles/two_speed_at.toml", "none.toml"));
    let line = line_of(EXPERIMENT, "vehicle = \"");
    let error = Experiment::read(&named).unwrap().read_vehicle().unwrap_err().to_string();
    let missing = folder.0.join("none.toml");
    assert!(error.starts_with(&format!("{}:{line}: `vehicle`: {}: ", named.display(), missing.display())), "{error}");
    let study = "name = \"s\"\ntitle = \"S\"\nexperiment = \"gone.toml\"\nplan = \"sobol\"\nfactor = []\n";
    let study = folder.with("s.toml", study);
    let error = config::Study::read(&study).unwrap_err().to_string();
    assert!(error.starts_with(&format!("{}:3: `experiment`: ", study.display())), "{error}");
}

#[test]
fn files_are_told_apart_by_what_they_describe() {
    assert_eq!(Source::built_in("s", "[sensors]\nseed = 1").kind().unwrap(), Kind::Sensors);
    assert_eq!(Source::built_in("v", VEHICLE).kind().unwrap(), Kind::Vehicle);
    assert_eq!(Source::built_in("e", EXPERIMENT).kind().unwrap(), Kind::Experiment);
    assert!(Source::built_in("x", "a = 1").kind().is_err());
}

#[test]
fn an_experiments_name_must_be_one_of_a_file() {
    let line = line_of(EXPERIMENT, "name = \"E1\"");
    for name in ["../../x", "/x", "a/b", "", ".", "..", ".x", "x.", " x", "x:y", "a\\b", "a\tb", &"n".repeat(81)] {
        let error = experiment_error("name = \"E1\"", &format!("name = {name:?}"));
        assert!(error.starts_with(&format!("e.toml:{line}: `name`: `")), "{error}");
        assert!(error.contains("cannot be the name of a file\nhint: use letters, digits"), "{error}");
    }
    for name in ["E1", "E1 on a grade", "Übung_2-b.1", &"n".repeat(80)] {
        let text = EXPERIMENT.replacen("name = \"E1\"", &format!("name = {name:?}"), 1);
        assert_eq!(Experiment::from_source(Source::built_in("e.toml", &text)).unwrap().name, name);
    }
}

/// What is said of a study of the bench with one factor, with these lines.
fn factor_error(name: &str, lines: &str) -> String {
    let folder = Folder::new(name);
    let experiment = concat!(env!("CARGO_MANIFEST_DIR"), "/../../experiments/bench.toml");
    let head = format!("name = \"s\"\ntitle = \"S\"\nexperiment = '{experiment}'\nplan = \"sobol\"\nruns = 8\n");
    let factor = "[[factor]]\nkey = \"experiment.sensors.wheel.scale\"\nrange = [0.98, 1.02]\n";
    let study = folder.with("s.toml", &[&head, factor, lines].concat());
    let read = config::Study::read(&study);
    read.map_or_else(|error| error.to_string().replace(study.to_str().unwrap(), "s.toml"), |_| "good".to_owned())
}

#[test]
fn a_factor_by_chance_has_a_share_of_the_runs_and_a_value_for_the_others() {
    assert_eq!(factor_error("chance-good", "chance = 0.5\notherwise = 1.0\n"), "good");
    let error = factor_error("chance-alone", "chance = 0.5\n");
    assert!(error.starts_with("s.toml:9: ") && error.contains("hint: add the value that changes nothing"), "{error}");
    let error = factor_error("otherwise-alone", "otherwise = 1.0\n");
    assert!(error.starts_with("s.toml:9: ") && error.contains("hint: add the share of the runs"), "{error}");
    for (name, chance) in [("chance-0", "0"), ("chance-1", "1.0")] {
        let error = factor_error(name, &format!("chance = {chance}\notherwise = 1.0\n"));
        assert!(error.starts_with("s.toml:9: ") && error.contains("must be between 0 and 1"), "{error}");
    }
    let error = factor_error("chance-50", "chance = 50\notherwise = 1.0\n");
    assert!(error.contains("`chance` is 50, expected 0 to 1"), "{error}");
    // The value of the other runs is tried like all others.
    let error = factor_error("otherwise-0", "chance = 0.5\notherwise = 0.0\n");
    assert!(error.contains("the value 0 of the factor is refused") && error.contains("expected 0.5 to 2"), "{error}");
}

#[test]
fn the_files_of_the_field_ship_and_are_right() {
    let experiments = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../experiments");
    let field = Experiment::read(&experiments.join("field.toml")).unwrap();
    field.read_vehicle().unwrap();
    assert_eq!(field.draws, 10);
    // Every scenario but the nominal one changes the sensors, and nothing else.
    let nominal = field.with_scenario(&field.scenarios[0]);
    for scenario in &field.scenarios[1..] {
        let varied = field.with_scenario(scenario);
        assert!(varied.sensors != nominal.sensors, "{}", scenario.name);
        assert_eq!(varied.off_nominal, nominal.off_nominal, "{}", scenario.name);
    }
    // Its sensors are those of the bench.
    assert_eq!(field.sensors, Experiment::bench().unwrap().sensors);
    let combined = config::Study::read(&experiments.join("combined.toml")).unwrap();
    assert_eq!((combined.runs, combined.record_before_s), (2000, 7.0));
}

const STROKE: &str = include_str!("../../../vehicles/two_speed_stroke.toml");

fn stroke_vehicle(text: &str) -> Vehicle {
    Vehicle::from_source(Source::built_in("vehicle.toml", text)).unwrap()
}

#[test]
fn the_car_with_a_stroke_differs_from_the_built_in_one_in_nothing_else() {
    let (built_in, mut stroke) = (Vehicle::two_speed_at().unwrap(), stroke_vehicle(STROKE));
    assert!(stroke.offgoing.has_stroke && stroke.oncoming.has_stroke);
    assert!(!built_in.offgoing.has_stroke && !built_in.oncoming.has_stroke);
    (stroke.source, stroke.name) = (built_in.source.clone(), built_in.name.clone());
    (stroke.offgoing.has_stroke, stroke.oncoming.has_stroke) = (false, false);
    assert!(stroke.error_bounds.fill.is_some() && built_in.error_bounds.fill.is_none());
    stroke.error_bounds.fill = None;
    assert_eq!(stroke, built_in);
}

#[test]
fn a_file_that_says_nothing_of_the_cylinders_has_a_stroke_and_the_values_of_the_file_that_says_all() {
    let all = stroke_vehicle(STROKE);
    let (from, to) = (STROKE.find("[clutch.b.fill]").unwrap(), STROKE.find("[driveline]").unwrap());
    let silent =
        stroke_vehicle(&[&STROKE[..from], &STROKE[to..]].concat().replace("[clutch.a.fill]\nenabled = true", ""));
    assert_eq!((all.offgoing, all.oncoming), (silent.offgoing, silent.oncoming));
    assert_eq!(
        (
            [silent.offgoing.hysteresis_pa, silent.oncoming.hysteresis_pa],
            silent.backlash_rad,
            silent.oil_temperature_degc
        ),
        ([0.0; 2], 0.0, 80.0)
    );
}

#[test]
fn wrong_values_of_a_cylinder_are_named_with_their_line() {
    let error = |from: &str, to: &str| {
        assert!(STROKE.contains(from), "{from}");
        let text = STROKE.replacen(from, to, 1);
        Vehicle::from_source(Source::built_in("v.toml", &text)).unwrap_err().to_string()
    };
    let line = line_of(STROKE, "stroke_m = ");
    assert_eq!(
        error("stroke_m = 1.2e-3", "stroke_m = 1.2   "),
        format!("v.toml:{line}: `clutch.b.fill.stroke_m` is 1.2, expected 0.00001 to 0.02\nhint: 1.2 mm is 0.0012 m")
    );
    // A spring cannot press harder on its stop than at the kiss point.
    assert!(error("preload_n = 450", "preload_n = 700").contains("is 700, expected 0 to 600"));
    assert!(error("temperature_degc = 80", "temperature_degc = 353").contains("expected -40 to 150"));
    assert!(error("exhaust_factor = 1.0", "exhaust = 1.0").contains("unknown field `exhaust`"));
    assert!(error("enabled = true\nstroke_m", "enabled = 1\nstroke_m").contains("boolean"));
}

#[test]
fn what_the_observers_do_not_know_changes_the_simulated_car_alone() {
    let with = |differences: &str| {
        let text = EXPERIMENT.replacen("[shift]", &format!("[off_nominal]\n{differences}\n\n[shift]"), 1);
        Experiment::from_source(Source::built_in("e.toml", &text)).unwrap()
    };
    let nominal = Vehicle::two_speed_at().unwrap();
    assert_eq!(with("").simulated_vehicle(&nominal), nominal);
    let car = |differences: &str| with(differences).simulated_vehicle(&nominal);
    let shafts = car("shaft_stiffness_factor = 0.8\nbacklash_rad = 0.03");
    assert_eq!((shafts.driveline.shaft_stiffness_n_m_rad, shafts.backlash_rad), (0.8 * 13e3, 0.03));
    let valves = car("valve_hysteresis_pa = 0.02e6\nclutch_drag_n_m = 8");
    assert_eq!(
        (
            [valves.offgoing.hysteresis_pa, valves.oncoming.hysteresis_pa],
            valves.offgoing.drag_n_m,
            valves.oncoming.drag_n_m
        ),
        ([0.02e6; 2], 8.0, 8.0)
    );
    let filled =
        car("piston_stroke = true\nfill_volume_factor = 1.25\nstarved_flow_factor = 0.5\noil_temperature_degc = 5");
    assert!(filled.offgoing.has_stroke && filled.oncoming.has_stroke);
    let (own, was) = (filled.oncoming.cylinder, nominal.oncoming.cylinder.with_oil(5.0));
    assert_eq!(own.stroke_m3, 1.25 * was.stroke_m3);
    assert!((own.flow(0.1e6) / was.flow(0.1e6) - 0.5).abs() < 1e-12 && own.flow(-0.1e6) == was.flow(-0.1e6));
    assert_eq!((filled.offgoing.cylinder, filled.oil_temperature_degc), (nominal.offgoing.cylinder.with_oil(5.0), 5.0));
}

#[test]
fn a_tip_out_closes_the_throttle_and_leaves_the_rest_of_the_profile() {
    let with = |times: &str| {
        let text = EXPERIMENT.replacen("[shift]", &format!("[off_nominal]\ntip_out_s = {times}\n\n[shift]"), 1);
        Experiment::from_source(Source::built_in("e.toml", &text))
    };
    let (own, tipped) = (Experiment::e1().unwrap().driver_throttle(), with("[0.5, 1.5]").unwrap().driver_throttle());
    for time in [0.0, 0.2, 0.4, 0.5, 1.6, 2.0, 9.0] {
        assert!((tipped.at(time) - own.at(time)).abs() < 1e-15, "{time}");
    }
    assert_eq!([0.6, 0.9, 1.5].map(|time| tipped.at(time)), [0.0; 3]);
    assert!(tipped.at(0.55) > 0.0 && tipped.at(1.55) > 0.0);
    let line = line_of(EXPERIMENT, "[shift]") + 1;
    for (times, message) in [
        (
            "[6.0, 6.1]",
            "the accelerator is released at 6 s and pressed at 6.1 s\nhint: expected [release, press] at least 0.2 s apart",
        ),
        ("[6.0]", "has 1 numbers, expected 2"),
        ("[6.0, 6000]", "expected 0 to 600"),
    ] {
        let error = with(times).unwrap_err().to_string();
        assert!(error.starts_with(&format!("e.toml:{line}: ")) && error.contains(message), "{error}");
    }
}

#[test]
fn a_study_switches_the_stroke_with_0_and_1() {
    let folder = Folder::new("switch");
    folder.with("two_speed_at.toml", VEHICLE);
    folder.with(
        "e.toml",
        &EXPERIMENT.replace("../vehicles/", "").replacen(
            "[shift]",
            "[off_nominal]\npiston_stroke = false\n\n[shift]",
            1,
        ),
    );
    let study = |values: &str| {
        let text = format!(
            "name = \"s\"\ntitle = \"S\"\nexperiment = \"e.toml\"\nplan = \"full-factorial\"\n\
             [[factor]]\nkey = \"experiment.off_nominal.piston_stroke\"\nvalues = {values}\n"
        );
        config::Study::read(&folder.with("s.toml", &text))
    };
    let both = study("[0, 1]").unwrap();
    let stroke = |value: f64| both.varied(&[value]).unwrap().experiment.off_nominal.piston_stroke;
    assert_eq!((stroke(0.0), stroke(1.0)), (Some(false), Some(true)));
    let error = study("[0, 0.5]").unwrap_err().to_string();
    assert!(error.contains("a switch is 0 (off) or 1 (on)"), "{error}");
}

/// One study for all four experiments: the shift controller's values go into each, those of the sensors into E2 and E4.
#[test]
fn a_study_changes_other_experiments_as_far_as_they_have_what_it_varies() {
    let study = config::Study::plausible().unwrap();
    let values: Vec<f64> = study.factors.iter().map(|factor| factor.values.ends()[0]).collect();
    let value = |name: &str| values[study.factors.iter().position(|factor| factor.name == name).unwrap()];
    for experiment in Experiment::built_in().unwrap() {
        let varied = study.varied_experiment(&experiment, &values).unwrap();
        assert_eq!(*varied.throttle.values().last().unwrap(), value("throttle"), "{}", experiment.name);
        assert_eq!(varied.shift.lead_s, value("lead_s"));
        assert_eq!(varied.sensors.map(|sensors| sensors.seed), experiment.sensors.map(|sensors| sensors.seed));
        if let Some(sensors) = varied.sensors {
            assert_eq!(sensors.wheel.noise_rad_s, value("wheel_noise_rad_s"));
        }
        // What makes it this experiment stays.
        assert_eq!((&varied.name, varied.off_nominal), (&experiment.name, experiment.off_nominal));
        assert_eq!((varied.observers, varied.sensors_told), (experiment.observers, experiment.sensors_told));
    }
    let [e1, ..] = Experiment::built_in().unwrap();
    let at = study.factors.iter().position(|factor| factor.name == "throttle").unwrap();
    let mut wrong = values.clone();
    wrong[at] = 1.5;
    let error = study.varied_experiment(&e1, &wrong).unwrap_err().to_string();
    assert!(error.contains("throttle.position") && error.contains("1.5"), "{error}");
}

/// The study is one of readings: each list has the value of the vehicle file, each range contains it.
#[test]
fn the_plausible_settings_contain_that_of_the_files() {
    let study = config::Study::plausible().unwrap();
    let (vehicle, [e1, ..]) = (Vehicle::two_speed_at().unwrap(), Experiment::built_in().unwrap());
    let road = &vehicle.road;
    for (name, nominal) in [
        ("inertia_kg_m2", vehicle.engine.inertia_kg_m2),
        ("return_spring_b_n", vehicle.oncoming.clutch.return_spring_n),
        ("rolling_moment_n_m", road.rolling_moment_n_m),
        ("throttle", *e1.throttle.values().last().unwrap()),
        ("torque_phase_duration_s", e1.shift.torque_phase_s),
        ("inertia_phase_duration_s", e1.shift.inertia_phase_s),
        ("lead_s", e1.shift.lead_s),
    ] {
        let factor = study.factors.iter().find(|factor| factor.name == name).unwrap();
        let [low, high] = factor.values.ends();
        assert!(low <= nominal && nominal <= high, "{name}: {nominal}");
        if let config::study::Values::List(list) = &factor.values {
            assert!(list.contains(&nominal), "{name}: {nominal}");
        }
    }
    for factor in study.factors.iter().filter(|factor| factor.change_name() == "scale") {
        let [low, high] = factor.values.ends();
        assert!(low < 1.0 && 1.0 < high, "{}", factor.name);
    }
}
