//! Names of channels in logs of several kinds.

use super::*;

fn channel(name: &str, unit: &str) -> Channel {
    Channel { name: name.to_owned(), unit: unit.to_owned(), group: String::new() }
}

/// The channel that is suggested for each role.
fn suggested(channels: &[Channel]) -> Vec<(String, String)> {
    let text = suggest(channels, &[], None);
    let table: toml::Table = text.parse().unwrap();
    let channels = table.get("channel").and_then(|value| value.as_table()).cloned().unwrap_or_default();
    channels.into_iter().map(|(role, entry)| (role, entry["name"].as_str().unwrap().to_owned())).collect()
}

#[test]
fn a_short_name_with_a_unit_of_velocity_is_the_speed_of_the_car() {
    for (name, unit) in [
        ("v_kmh", "km/h"),
        ("speed_kmh", "km/h"),
        ("speed_mph", "mph"),
        ("speed", "km/h"),
        ("v", "m/s"),
        ("GPS_Speed", "km/h"),
        ("vehspd", ""),
    ] {
        let found = suggested(&[channel("N_Eng", "rpm"), channel(name, unit)]);
        assert!(found.contains(&("vehicle_speed".to_owned(), name.to_owned())), "{name}: {found:?}");
    }
    // Of another unit, or of none, it may be anything, and a name that says more comes first.
    for (name, unit) in [("v", "V"), ("v", ""), ("speed", ""), ("speed", "rpm")] {
        assert!(!suggested(&[channel(name, unit)]).iter().any(|(role, _)| role == "vehicle_speed"), "{name} {unit}");
    }
    let both = suggested(&[channel("speed_kmh", "km/h"), channel("VehicleSpeed", "km/h")]);
    assert_eq!(both, [("vehicle_speed".to_owned(), "VehicleSpeed".to_owned())]);
}

#[test]
fn usual_names_in_two_languages_are_found() {
    let logs: [&[(&str, &str, &str)]; 8] = [
        &[
            ("N_Eng", "rpm", "engine_speed"),
            ("N_Turb", "rpm", "turbine_speed"),
            ("N_Out", "rpm", "output_speed"),
            ("GearCurrent", "", "gear"),
        ],
        &[
            ("Motordrehzahl", "1/min", "engine_speed"),
            ("Turbinendrehzahl", "1/min", "turbine_speed"),
            ("Abtriebsdrehzahl", "1/min", "output_speed"),
            ("Zielgang", "", "target_gear"),
            ("Ventilstrom_Kupplung_B", "mA", "oncoming_current"),
        ],
        &[
            ("EngineSpeed", "rpm", "engine_speed"),
            ("TurbineSpeed", "rpm", "turbine_speed"),
            ("VehicleSpeed", "km/h", "vehicle_speed"),
            ("TargetGear", "", "target_gear"),
            ("CurrentGear", "", "gear"),
            ("EngineTorque", "Nm", "engine_torque"),
            ("OilTemperature", "degC", "oil_temperature"),
        ],
        &[
            ("engine_speed_rad_s", "rad/s", "engine_speed"),
            ("turbine_speed_rad_s", "rad/s", "turbine_speed"),
            ("output_speed_rad_s", "rad/s", "output_speed"),
            ("wheel_speed_rad_s", "rad/s", "wheel_speed"),
            ("oncoming_current_a", "A", "oncoming_current"),
            ("offgoing_current_a", "A", "offgoing_current"),
            ("throttle", "", "throttle"),
        ],
        &[("I_ClA", "mA", "oncoming_current"), ("I_ClA_off", "mA", "offgoing_current"), ("APP", "%", "throttle")],
        &[
            ("SolCurr_A", "mA", "element_a_current"),
            ("SolCurr_B", "mA", "element_b_current"),
            ("SolCurr_C", "mA", "element_c_current"),
            ("Gear_Tgt", "", "target_gear"),
            ("AccPed", "%", "throttle"),
            ("BrkPed", "%", ""),
        ],
        &[
            ("element_a_current_a", "A", "element_a_current"),
            ("element_b_duty_percent", "%", "element_b_duty"),
            ("element_35r_current_ma", "mA", "element_35r_current"),
            ("lock_up_applied", "", "lock_up_applied"),
            ("oncoming_current_a", "A", "oncoming_current"),
        ],
        &[
            ("I_ClA", "mA", "element_a_current"),
            ("Solenoid_B1_Current_A", "A", "element_b1_current"),
            ("Kupplung_E_Strom_Ist", "mA", "element_e_current"),
            ("TCC_State", "", "lock_up_applied"),
            ("TCC_Sol_Current", "mA", ""),
            ("Lockup_on_time", "s", ""),
        ],
    ];
    for log in logs {
        let found = suggested(&log.iter().map(|(name, unit, _)| channel(name, unit)).collect::<Vec<_>>());
        for (name, _, role) in log.iter().filter(|(.., role)| !role.is_empty()) {
            assert!(found.contains(&((*role).to_owned(), (*name).to_owned())), "{name}: {found:?}");
        }
        assert_eq!(found.len(), log.iter().filter(|(.., role)| !role.is_empty()).count(), "{found:?}");
    }
}

#[test]
fn short_names_and_those_of_a_bus_for_lorries_are_found() {
    let short = [
        ("NMot", "1/min", "engine_speed"),
        ("nTurb", "1/min", "turbine_speed"),
        ("nAb", "1/min", "output_speed"),
        ("TqEng", "Nm", "engine_torque"),
        ("Tq", "Nm", ""),
        ("Thr", "%", "throttle"),
        ("GearAct", "", "gear"),
        ("TGear", "", "target_gear"),
        ("TOT", "degC", "oil_temperature"),
        ("I_A", "mA", "element_a_current"),
        ("I_B", "mA", "element_b_current"),
        ("I_K1", "mA", "element_k1_current"),
    ];
    let others = [
        ("EngTrq", "Nm", "engine_torque"),
        ("ThrPos", "%", "throttle"),
        ("GearTgt", "", "target_gear"),
        ("I_SolA", "A", "element_a_current"),
        ("I_SolB", "A", "element_b_current"),
        ("I_SolC", "A", "element_c_current"),
        ("Getriebeöltemperatur", "°C", "oil_temperature"),
        ("Fahrzeuggeschwindigkeit", "km/h", "vehicle_speed"),
        ("Getriebeeingangsdrehzahl", "1/min", "turbine_speed"),
    ];
    let bus = [
        ("EngineSpeed", "rpm", "engine_speed"),
        ("InputShaftSpeed", "rpm", "turbine_speed"),
        ("TransOutShaftSpeed", "rpm", "output_speed"),
        ("WheelBasedVehSpeed", "km/h", "vehicle_speed"),
        ("Accelerator Pedal Position 1", "%", "throttle"),
        ("TransCurrentGear", "", "gear"),
        ("TransSelectedGear", "", "target_gear"),
        ("TransShiftInProcess", "", "shift_active"),
        ("TransTorqueConverterLockupEngaged", "", "lock_up_applied"),
        ("TransOilTemp1", "degC", "oil_temperature"),
        ("ActualEngPercentTorque", "%", ""),
        ("DriversDemandEngPercentTorque", "%", ""),
        ("EngOilTemp1", "degC", ""),
        ("EngTurbocharger1Speed", "rpm", ""),
    ];
    for log in [&short[..], &others, &bus] {
        let mut found = suggested(&log.iter().map(|(name, unit, _)| channel(name, unit)).collect::<Vec<_>>());
        let named = log.iter().filter(|(.., role)| !role.is_empty());
        let mut expected: Vec<_> = named.map(|(name, _, role)| ((*role).to_owned(), (*name).to_owned())).collect();
        found.sort();
        expected.sort();
        assert_eq!(found, expected);
    }
    // Where nothing else is an engine torque, a name that says no more than torque may be it.
    assert_eq!(suggested(&[channel("Tq", "Nm")]), [("engine_torque".to_owned(), "Tq".to_owned())]);
}

#[test]
fn names_that_look_alike_are_not_taken() {
    let alike = [
        ("EngOilTemp1", "degC"),
        ("T_Oil_Axle", "degC"),
        ("GearRatio", ""),
        ("KnockThr", ""),
        ("SlipThr", "rpm"),
        ("BrkPedPos", "%"),
        ("FanSpeed", "rpm"),
        ("EngRequestedSpeed", "rpm"),
        ("TqWhl", "Nm"),
        ("EngTorqueMode", ""),
        ("AccelPedal1LowIdleSwitch", ""),
        ("FrontAxleSpeed", "rpm"),
        ("RelativeSpeedRearAxle1LeftWheel", "km/h"),
        ("I_Bat", "A"),
        ("I_Line", "A"),
        ("I_TCC", "A"),
        ("I_A", "degC"),
    ];
    for (name, unit) in alike {
        assert_eq!(suggested(&[channel(name, unit)]), [], "{name}");
    }
    let role = |name: &str, unit: &str| suggested(&[channel(name, unit)]).pop().map(|(role, _)| role);
    // The acceleration of the car is no pedal, and the lever no gear.
    assert_eq!(role("ax", "m/s^2").as_deref(), Some("longitudinal_acceleration"));
    assert_eq!(role("LongAccel", "m/s^2").as_deref(), Some("longitudinal_acceleration"));
    assert_eq!(role("VehicleAccel", "m/s^2").as_deref(), Some("vehicle_acceleration"));
    assert_eq!(role("GearLever", "").as_deref(), Some("selector"));
    assert_eq!(role("Gear_Sel", "").as_deref(), Some("selector"));
}

#[test]
fn per_cent_of_a_torque_and_single_currents_stand_as_comments() {
    for unit in ["%", ""] {
        let text = suggest(&[channel("ActualEngPercentTorque", unit)], &[], None);
        let block = "# [channel.engine_torque]\n# name = \"ActualEngPercentTorque\"\n# unit = \"N m\"";
        assert!(text.contains(block) && text.contains("\n# scale =\n"), "{text}");
    }
    let text = suggest(&[channel("I_A", "mA"), channel("I_B", "mA")], &[], None);
    assert!(text.contains("# Perhaps commands of clutches, which an estimate needs: I_A, I_B\n"), "{text}");
    assert_eq!(suggested(&[channel("I_A", "mA"), channel("I_B", "mA")]), []);
}

#[test]
fn the_input_of_a_gearbox_is_found_and_unused_channels_are_named() {
    let text = suggest(&[channel("N_In", "1/min"), channel("I_K1", "mA"), channel("Wiper", "")], &[], None);
    assert!(text.contains("[channel.turbine_speed]\nname = \"N_In\""), "{text}");
    assert!(text.ends_with("# Channels that are not used: I_K1, Wiper\n"), "{text}");
    let many: Vec<Channel> = (0..30).map(|at| channel(&format!("Signal{at}"), "")).collect();
    assert!(suggest(&many, &[], None).ends_with("Signal19, ...\n"));
}

#[test]
fn a_name_with_quotation_marks_stays_a_name() {
    let found = suggested(&[channel("Engine \"speed\" \\ n", "rpm")]);
    assert_eq!(found, [("engine_speed".to_owned(), "Engine \"speed\" \\ n".to_owned())]);
}

#[test]
fn pressures_that_are_asked_of_elements_are_commands_of_a_gearbox() {
    let named = [
        ("P_cmd_B", "bar", "element_b_pressure_command"),
        ("pressure_command_C", "kPa", "element_c_pressure_command"),
        ("Druck_Soll_K1", "mbar", "element_k1_pressure_command"),
        ("Druck_Soll_E", "bar", "element_e_pressure_command"),
        ("element_d_pressure_command_bar", "bar", "element_d_pressure_command"),
        ("P_act_B", "bar", "element_b_pressure"),
        ("P_C", "bar", "element_c_pressure"),
        ("P_C_raw", "bar", ""),
        ("P_F", "bar", ""),
        ("P_amb", "kPa", ""),
        ("line_pressure_cmd", "bar", ""),
        ("P_cmd_A", "bar", ""),
        ("I_A", "mA", "element_a_current"),
    ];
    let channels: Vec<Channel> = named.iter().map(|(name, unit, _)| channel(name, unit)).collect();
    let mut wanted: Vec<(String, String)> = named
        .iter()
        .filter(|(.., role)| !role.is_empty())
        .map(|(name, _, role)| ((*role).to_owned(), (*name).to_owned()))
        .collect();
    wanted.sort();
    let found = suggested(&channels).into_iter().filter(|(role, _)| role.starts_with("element_"));
    assert_eq!(found.collect::<Vec<_>>(), wanted);
}

#[test]
fn solenoids_by_the_letter_of_their_element_or_their_number_are_commands() {
    let keys = |names: &[&str]| {
        let channels: Vec<Channel> = names.iter().map(|name| channel(name, "mA")).collect();
        suggested(&channels).into_iter().map(|(role, _)| role).collect::<Vec<_>>()
    };
    let lettered = ["I_EDS_A", "I_EDS_B", "I_EDS_C", "I_EDS_D", "I_EDS_E"];
    assert_eq!(keys(&lettered), ["a", "b", "c", "d", "e"].map(|name| format!("element_{name}_current")));
    assert_eq!(keys(&["MV1", "MV2", "DR2"]), ["dr2", "mv1", "mv2"].map(|name| format!("element_{name}_current")));
    let numbered = [["EDS1_I", "EDS2_I", "EDS3_I"], ["EDS_1", "EDS_2", "EDS_3"]];
    for names in numbered {
        assert_eq!(keys(&names), ["1", "2", "3"].map(|number| format!("element_eds{number}_current")));
    }
    assert_eq!(keys(&["Y1", "Y2", "Y3"]), ["1", "2", "3"].map(|number| format!("element_y{number}_current")));
    let long = ["Druckregler_1_Strom", "Druckregler_2_Strom", "Druckregler_3_Strom"];
    assert_eq!(keys(&long), ["1", "2", "3"].map(|number| format!("element_{number}_current")));
    assert_eq!(keys(&["EDS_Line", "MV_TCC", "DR_Main"]), [""; 0]);
}

#[test]
fn a_speed_in_two_channels_is_their_sum() {
    let channels = [channel("VehicleSpeed_frac", "km/h"), channel("VehicleSpeed", "km/h"), channel("N_Eng", "rpm")];
    let text = suggest(&channels, &[], None);
    let both = "[channel.vehicle_speed]\nnames = [\"VehicleSpeed\", \"VehicleSpeed_frac\"]\ncombine = \"sum\"\n# unit of the log: km/h\n";
    assert!(text.contains(both) && !text.contains("not used"), "{text}");
    for (whole, fraction, unit) in [
        ("Vehicle_Speed", "Vehicle_Speed_Fraction", ""),
        ("Vehicle Speed (km/h)", "Vehicle Speed (fraction)", "km/h"),
        ("VehSpd_Int", "VehSpd_Fract", "km/h"),
        ("VSS_kmh", "VSS_decimal", ""),
    ] {
        let text = suggest(&[channel(whole, "km/h"), channel(fraction, unit)], &[], None);
        assert!(text.contains(&format!("names = [\"{whole}\", \"{fraction}\"]\ncombine = \"sum\"")), "{text}");
        assert!(text.contains(if unit.is_empty() { "\nunit = \"km/h\"" } else { "# unit of the log: km/h" }), "{text}");
    }
    // Of another unit it is another signal.
    let other = suggest(&[channel("VehicleSpeed_frac", "m/s"), channel("VehicleSpeed", "km/h")], &[], None);
    assert!(!other.contains("sum"), "{other}");
}

/// A unit that no car has these values in, and a fraction that is none.
#[test]
fn values_tell_a_unit_and_a_fraction() {
    let channels = [
        channel("EngineSpeed", ""),
        channel("TurbineSpeed", ""),
        channel("VehicleSpeed", "km/h"),
        channel("VehicleSpeed_frac", ""),
        channel("MV1", ""),
        channel("Y3", ""),
        channel("Y", ""),
    ];
    let ranges =
        [[0.0, 2615.0], [0.0, 510.0], [0.0, 160.0], [0.0, 255.0], [0.0, 1.0], [0.0, 1.0], [0.0, 1.0]].map(Some);
    let text = suggest(&channels, &ranges, None);
    assert!(text.contains("unit = \"rpm\" # not in the log, by its values: check"), "{text}");
    assert!(text.contains("unit = \"rad/s\" # not in the log: check"), "{text}");
    assert!(text.contains("name = \"VehicleSpeed\"") && !text.contains("combine"), "{text}");
    assert!(text.contains("# VehicleSpeed_frac has values of 0 to 255"), "{text}");
    assert!(text.contains("Perhaps commands of clutches, which an estimate needs: MV1, Y3\n"), "{text}");
    let fraction = [Some([0.0, 2615.0]), None, Some([0.0, 160.0]), Some([0.0, 0.99])];
    assert!(suggest(&channels, &fraction, None).contains("combine = \"sum\""));
}

/// A map with them would be refused; of a speed that every estimate needs the log has to be looked at.
#[test]
fn channels_without_a_value_stand_as_comments() {
    let speeds = [("TurbineSpeed", "rpm"), ("WheelSpeed", "rpm"), ("Throttle", "")];
    let speeds = speeds.map(|(name, unit)| channel(name, unit));
    let commands = ["a", "b", "c", "d"].map(|name| channel(&format!("element_{name}_current_a"), "A"));
    let used = Some([0.0, 0.8]);
    let ranges = [None, None, Some([0.0, 80.0]), None, used, used, used];
    let text = suggest(&[&speeds[..], &commands[..]].concat(), &ranges, None);
    let table: toml::Table = text.parse().unwrap();
    let found = table["channel"].as_table().unwrap();
    assert!(found.contains_key("turbine_speed") && found["throttle"]["unit"].as_str() == Some("%"), "{text}");
    for key in ["wheel_speed", "element_a_current"] {
        let comment = "# Without a value in this log. For logs that have some, remove the number signs.\n";
        assert!(!found.contains_key(key) && text.contains(&format!("{comment}# [channel.{key}]\n")), "{key}: {text}");
    }
    assert!(found.contains_key("element_b_current"), "{text}");
}
