//! Vehicle files.

use config::{Source, VehicleFile};

use super::{VEHICLE, line_of};

/// The error for the built-in vehicle with one piece of its text replaced.
fn vehicle_error(from: &str, to: &str) -> String {
    assert!(VEHICLE.contains(from), "{from}");
    VehicleFile::from_source(Source::built_in("vehicle.toml", &VEHICLE.replacen(from, to, 1))).unwrap_err().to_string()
}

#[test]
fn chapter_parameters_of_table_2_1_are_those_of_the_built_in_vehicle() {
    let v = VehicleFile::built_in().unwrap();
    assert_eq!((v.road.mass_kg, v.road.wheel_radius_m, v.road.front_area_m2), (1500.0, 0.3, 2.0));
    assert_eq!((v.engine.inertia_kg_m2, v.engine.drag_n_m_s), (0.17, 0.047));
    assert_eq!((v.driveline.final_ratio, v.driveline.shaft_stiffness_n_m_rad), (3.0, 13e3));
    assert_eq!((v.tyre.max_force_n, v.tyre.slip_scale), (13.2e3, 0.1));
    let b = &v.oncoming.clutch;
    assert!((b.lever() * b.piston_area_m2 - 0.0039).abs() < 1e-12);
    assert_eq!(b.return_spring_n, 600.0);
    let (minimum, maximum) = b.friction.range();
    assert!(minimum >= 0.10 && maximum <= 0.16);
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
            "vehicle.toml:{line}: `clutch.b.piston_area_m2` is 117, expected 0.0001 to 0.2\n\
             hint: 117 cm2 is 0.0117 m2"
        )
    );
}

#[test]
fn an_unknown_key_a_missing_key_and_a_wrong_type_are_named() {
    let unknown = vehicle_error("slip_scale = 0.1", "slip_scale = 0.1\nslip_scal = 0.1");
    assert!(unknown.contains("unknown key `slip_scal`"), "{unknown}");
    let missing = vehicle_error("slip_scale = 0.1", "");
    assert!(missing.contains("missing key `slip_scale`"), "{missing}");
    let line = line_of(VEHICLE, "slip_scale");
    let wrong = vehicle_error("slip_scale = 0.1", "slip_scale = \"0.1\"");
    assert!(
        wrong.starts_with(&format!("vehicle.toml:{line}:")) && wrong.contains("the text \"0.1\", expected a number"),
        "{wrong}"
    );
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
    let same = vehicle_error("oncoming = \"b\"", "oncoming = \"a\"");
    assert!(same.contains("the ratio changes from 2.500 to 2.500"), "{same}");
    let idle = vehicle_error("input = \"turbine\"\noutput = \"ring\"", "input = \"housing\"\noutput = \"housing\"");
    assert!(idle.contains("the slip of each shift clutch must depend on turbine and output speed"), "{idle}");
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
fn a_valve_whose_told_numbers_are_wrong_is_named_with_its_line() {
    let line = line_of(VEHICLE, "gain_pa_a = 1.0e6");
    let error = vehicle_error("gain_pa_a = 1.0e6", "gain_pa_a = nan  ");
    assert!(error.starts_with(&format!("vehicle.toml:{line}: `observer.valve.gain_pa_a` is NaN")), "{error}");
    let foreign = vehicle_error("gain_pa_a = 1.0e6", "gain_pa_a = 1.0e6\nflow_sqrt_pa_s = 1");
    assert!(foreign.contains("has a key of another kind of valve\nhint: proportional: time_constant_s"), "{foreign}");
}

#[test]
fn pressures_that_the_valve_of_the_file_exceeds_are_refused() {
    let line = line_of(VEHICLE, "pressure_max_pa = 1.25e6");
    let low = vehicle_error("pressure_max_pa = 1.25e6", "pressure_max_pa = 0.5e6 ");
    let expected =
        format!("vehicle.toml:{line}: `design.error_bounds.pressure_max_pa`: 500000 Pa is less than the 1100000 Pa");
    // Ranges end at the pressure of the supply, also where the largest gain would give more: `check` tells it.
    let text = VEHICLE.replace("valve_gain_factor = [0.9, 1.1]", "valve_gain_factor = [0.7, 1.3]");
    let warnings = VehicleFile::from_source(Source::built_in("v.toml", &text)).unwrap().implausible();
    assert!(
        warnings.len() == 1 && warnings[0].contains("pressure_max_pa") && warnings[0].contains("whatever the gain"),
        "{warnings:?}"
    );
    assert!(low.starts_with(&expected) && low.contains("\nhint: 1210000 with the largest gain"), "{low}");
    let path = format!("{}/../../vehicles/two_speed_pwm.toml", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(path).unwrap().replacen(
        "[design.error_bounds]\n",
        "[design.error_bounds]\nline_pressure_pa = [1.1e6, 1.2e6]\n",
        1,
    );
    let error = VehicleFile::from_source(Source::built_in("pwm.toml", &text)).map(drop).unwrap_err().to_string();
    assert!(
        error.contains("1100000 to 1200000 does not contain the line pressure of the valve in this file, 1000000 Pa"),
        "{error}"
    );
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
    VehicleFile::from_source(Source::built_in("vehicle.toml", &far)).unwrap();
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
fn with_budget(keys: &str, fill: &str) -> Result<VehicleFile, String> {
    let from = VEHICLE.find("command_age_s").unwrap();
    let to = from + VEHICLE[from..].find("float32_rounding").unwrap();
    let text = format!("{}{keys}\n{}\n[design.error_bounds.fill]\n{fill}\n", &VEHICLE[..from], &VEHICLE[to..]);
    VehicleFile::from_source(Source::built_in("vehicle.toml", &text)).map_err(|error| error.to_string())
}

#[test]
fn what_a_budget_leaves_out_of_valve_and_stroke_has_defaults_and_what_it_holds_is_checked() {
    assert!(VehicleFile::built_in().unwrap().error_bounds.fill.is_none());
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
        ("leak_m3_s_pa = 1e-12", "fill.leak_m3_s_pa` is 1e-12, expected 2e-12 to"),
        ("volume_m3 = [1, 2]", "unknown key `volume_m3`"),
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
