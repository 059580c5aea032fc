//! Experiment files.

use config::{ExperimentFile, Source, VehicleFile};

use super::{EXPERIMENT, VEHICLE, line_of};

fn experiment_error(from: &str, to: &str) -> String {
    assert!(EXPERIMENT.contains(from), "{from}");
    ExperimentFile::from_source(Source::built_in("e.toml", &EXPERIMENT.replacen(from, to, 1))).unwrap_err().to_string()
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
fn forward_euler_beyond_the_time_constant_of_the_valve_is_refused() {
    let euler = EXPERIMENT
        .replace("kind = \"open-loop\"\nsample_time_s = 0.001", "kind = \"open-loop\"\ndiscretisation = \"euler\"");
    let experiment = ExperimentFile::from_source(Source::built_in("e.toml", &euler)).unwrap();
    let told = |time_constant_s: &str| {
        let text = VEHICLE.replace("time_constant_s = 0.04 ", &format!("time_constant_s = {time_constant_s} "));
        experiment.check_observers(&VehicleFile::from_source(Source::built_in("v.toml", &text)).unwrap())
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
    let experiment = ExperimentFile::from_source(Source::built_in("e.toml", &text)).unwrap();
    let error = experiment.check_observers(&VehicleFile::built_in().unwrap()).unwrap_err().to_string();
    assert!(
        error.contains("`observer \"rigid ISS\"`: a sample time of 0.001 s is shorter than the 0.002 s"),
        "{error}"
    );
}

#[test]
fn the_experiments_that_ship_go_with_the_vehicle_that_ships() {
    let vehicle = VehicleFile::built_in().unwrap();
    for experiment in ExperimentFile::built_in().unwrap().iter().chain([&ExperimentFile::bench().unwrap()]) {
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
        assert_eq!(ExperimentFile::from_source(Source::built_in("e.toml", &text)).unwrap().name, name);
    }
}

#[test]
fn the_files_of_the_field_ship_and_are_right() {
    let experiments = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../experiments");
    let field = ExperimentFile::read(&experiments.join("field.toml")).unwrap();
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
    assert_eq!(field.sensors, ExperimentFile::bench().unwrap().sensors);
    let combined = config::Study::read(&experiments.join("combined.toml")).unwrap();
    assert_eq!((combined.runs, combined.record_before_s), (2000, 7.0));
}

#[test]
fn what_the_observers_do_not_know_changes_the_simulated_car_alone() {
    let with = |differences: &str| {
        let text = EXPERIMENT.replacen("[shift]", &format!("[off_nominal]\n{differences}\n\n[shift]"), 1);
        ExperimentFile::from_source(Source::built_in("e.toml", &text)).unwrap()
    };
    let nominal = VehicleFile::built_in().unwrap();
    assert_eq!(with("").simulated_vehicle(&nominal), nominal.vehicle);
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
        ExperimentFile::from_source(Source::built_in("e.toml", &text))
    };
    let (own, tipped) =
        (ExperimentFile::e1().unwrap().driver_throttle(), with("[0.5, 1.5]").unwrap().driver_throttle());
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
