//! Study files.

use config::{ExperimentFile, VehicleFile};

use super::{EXPERIMENT, Folder, VEHICLE};

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
fn a_factor_by_chance_has_a_fraction_of_the_runs_and_a_value_for_the_others() {
    assert_eq!(factor_error("chance-good", "chance = 0.5\notherwise = 1.0\n"), "good");
    let error = factor_error("chance-alone", "chance = 0.5\n");
    assert!(error.starts_with("s.toml:9: ") && error.contains("hint: add the value that changes nothing"), "{error}");
    let error = factor_error("otherwise-alone", "otherwise = 1.0\n");
    assert!(error.starts_with("s.toml:9: ") && error.contains("hint: add the fraction of the runs"), "{error}");
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
    let study_of = |key: &str, values: &str| {
        let text = format!(
            "name = \"s\"\ntitle = \"S\"\nexperiment = \"e.toml\"\nplan = \"full-factorial\"\n\
             [[factor]]\nkey = \"{key}\"\nvalues = {values}\n"
        );
        config::Study::read(&folder.with("s.toml", &text))
    };
    let study = |values: &str| study_of("experiment.off_nominal.piston_stroke", values);
    let both = study("[0, 1]").unwrap();
    let stroke = |value: f64| both.varied(&[value]).unwrap().experiment.off_nominal.piston_stroke;
    assert_eq!((stroke(0.0), stroke(1.0)), (Some(false), Some(true)));
    let error = study("[0, 0.5]").unwrap_err().to_string();
    assert!(error.contains("a switch is 0 (off) or 1 (on)\nhint: use `change"), "{error}");
    let error = study_of("vehicle.converter.torque_ratio", "[1.0, 2.0]").unwrap_err().to_string();
    assert!(error.contains("a list cannot be set to a number\nhint: use `change = \"scale\"`"), "{error}");
}

/// One study for all four experiments: the shift controller's values go into each, those of the sensors into E2 and E4.
#[test]
fn a_study_changes_other_experiments_as_far_as_they_have_what_it_varies() {
    let study = config::Study::plausible().unwrap();
    let values: Vec<f64> = study.factors.iter().map(|factor| factor.values.ends()[0]).collect();
    let value = |name: &str| values[study.factors.iter().position(|factor| factor.name == name).unwrap()];
    for experiment in ExperimentFile::built_in().unwrap() {
        let varied = study.varied_experiment(&experiment, &values).unwrap();
        assert_eq!(*varied.throttle.values().last().unwrap(), value("throttle"), "{}", experiment.name);
        assert_eq!(varied.shift.lead_s, value("lead_s"));
        assert_eq!(varied.sensors.map(|sensors| sensors.seed), experiment.sensors.map(|sensors| sensors.seed));
        if let Some(sensors) = varied.sensors {
            assert_eq!(sensors.wheel.noise_rad_s, value("wheel_noise_rad_s"));
        }
        // What makes it this experiment stays.
        assert_eq!((&varied.name, varied.off_nominal), (&experiment.name, experiment.off_nominal));
        assert_eq!((&varied.observers, varied.sensors_given), (&experiment.observers, experiment.sensors_given));
    }
    let [e1, ..] = ExperimentFile::built_in().unwrap();
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
    let (vehicle, [e1, ..]) = (VehicleFile::built_in().unwrap(), ExperimentFile::built_in().unwrap());
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
