//! The sensors of an experiment and of its scenarios.

use car::ReadingErrors;
use config::{ExperimentFile, Source, VehicleFile};

use super::{BENCH, line_of};

/// The bench with lines added to the table of its wheel sensor.
fn with_wheel(lines: &str) -> Result<ExperimentFile, config::ConfigError> {
    let text = BENCH.replacen("noise_rad_s = 0.02\n", &format!("noise_rad_s = 0.02\n{lines}\n"), 1);
    assert!(text != BENCH);
    ExperimentFile::from_source(Source::built_in("e.toml", &text))
}

fn bench_error(from: &str, to: &str) -> String {
    assert!(BENCH.contains(from), "{from}");
    ExperimentFile::from_source(Source::built_in("e.toml", &BENCH.replacen(from, to, 1))).unwrap_err().to_string()
}

#[test]
fn observers_are_never_told_the_errors_of_a_sensor() {
    let errors = "scale = 1.02\nmissing_share = 0.03\nburst_s = 0.05\nfrozen_s = 0.05\noutliers = 2";
    let experiment = with_wheel(errors).unwrap();
    let (real, told) = (experiment.sensors.unwrap(), experiment.sensors_given.unwrap());
    assert_eq!((real.wheel.errors.scale, real.wheel.errors.outliers), (1.02, 2.0));
    assert_eq!(told, ExperimentFile::bench().unwrap().sensors_given.unwrap());
    assert_eq!(told.wheel.errors, ReadingErrors::NONE);
}

#[test]
fn a_sensor_without_error_keys_has_no_errors() {
    let sensors = ExperimentFile::bench().unwrap().sensors.unwrap();
    assert_eq!(sensors, sensors.without_errors());
    assert_eq!((sensors.wheel.offset_s, sensors.row_offset_s, sensors.outliers), (0.0, 0.0, 0.0));
}

#[test]
fn a_scenario_changes_what_it_names_of_the_sensors_and_nothing_that_observers_are_told() {
    let scenario = "[[scenario]]\nname = \"worn\"\nrow_time_s = 0.005\nsensors.missing_share = 0.03\n\
                    sensors.turbine.missing_share = 0.0\nsensors.wheel.scale = 1.01\nsensors.wheel.delay_s = 0.02\n";
    let text = [BENCH, scenario].concat();
    let experiment = ExperimentFile::from_source(Source::built_in("e.toml", &text)).unwrap();
    let varied = experiment.with_scenario(experiment.scenarios.last().unwrap());
    let (before, after) = (experiment.sensors.unwrap(), varied.sensors.unwrap());
    assert_eq!((after.wheel.errors.scale, after.wheel.delay_s, after.wheel.teeth), (1.01, 0.02, before.wheel.teeth));
    let fraction = |sensor: &car::SpeedSensor| sensor.errors.missing_share;
    assert_eq!([&after.engine, &after.turbine, &after.output, &after.wheel].map(fraction), [0.03, 0.0, 0.03, 0.03]);
    assert_eq!(after.current.unwrap().errors.missing_share, 0.03);
    assert_eq!(varied.sensors_given, experiment.sensors_given);
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
    assert!(wrong("scael = 1").contains("unknown key `scael`"));
    let missing = bench_error("teeth = 48\n", "");
    let line = line_of(BENCH, "[sensors.wheel]");
    assert_eq!(missing, format!("e.toml:{line}: `sensors.wheel`: missing `teeth`"));
    let (from, to) = (BENCH.find("[sensors.wheel]").unwrap(), BENCH.find("noise_rad_s = 0.02\n").unwrap());
    let missing = bench_error(&BENCH[from..to + "noise_rad_s = 0.02\n".len()], "");
    assert!(missing.starts_with(&format!("e.toml:{}: `sensors`: missing `wheel`", line_of(BENCH, "[sensors]"))));
    let clock = bench_error("resolution_a = 0.001", "resolution_a = 0.001, offset_s = 0.001");
    assert!(clock.contains("`sensors.current.offset_s`: has no separate clock") && clock.contains("hint:"), "{clock}");
}

#[test]
fn a_wrong_scenario_of_the_sensors_is_named_with_its_place() {
    let wrong = |experiment: &str, lines: &str| {
        let text = [experiment, "[[scenario]]\nname = \"x\"\n", lines, "\n"].concat();
        let error = ExperimentFile::from_source(Source::built_in("e.toml", &text)).unwrap_err().to_string();
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
    let vehicle = VehicleFile::built_in().unwrap();
    let checked =
        |text: &str| ExperimentFile::from_source(Source::built_in("e.toml", text)).unwrap().check_observers(&vehicle);
    checked(&text).unwrap();
    assert!(checked(&euler).unwrap_err().to_string().contains("a sample time of 0.1 s is longer than"));
}
