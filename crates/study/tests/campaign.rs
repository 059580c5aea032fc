//! Plans, sensitivity, model errors and worst cases on real studies.

#![expect(clippy::unwrap_used, reason = "a test may")]

use std::path::{Path, PathBuf};

use config::{Study, Vehicle};
use study::campaign::{Metric, PHASES, factor_values};
use study::{Campaign, StudyError, Summary, Target, error_bound, execute, worst_case};

fn experiments() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../experiments")
}

/// The study of this file with some lines replaced.
fn study_of(file: &str, changes: &[(&str, &str)]) -> Study {
    let mut text = std::fs::read_to_string(experiments().join(file)).unwrap();
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    for experiment in ["bench.toml", "e1.toml"] {
        let whole = experiments().join(experiment);
        text = text.replace(&format!("experiment = \"{experiment}\""), &format!("experiment = '{}'", whole.display()));
    }
    let path = std::env::temp_dir().join(format!("wetclutch-campaign-{}-{}", std::process::id(), text.len()));
    std::fs::write(&path, text).unwrap();
    let study = Study::read(&path);
    std::fs::remove_file(path).unwrap();
    study.unwrap()
}

fn summary(study: Study) -> Summary {
    let campaign = Campaign::new(study).unwrap();
    let mut summary = Summary::new(&campaign.study);
    execute::<StudyError>(&campaign, 0..campaign.study.runs, 2, |row| {
        summary.push(row);
        Ok(())
    })
    .unwrap();
    summary
}

#[test]
fn every_plan_fills_the_ranges_of_its_factors() {
    for plan in ["sobol", "latin-hypercube", "random", "saltelli"] {
        let plan_line = format!("plan = \"{plan}\"");
        let study = study_of("settings.toml", &[("plan = \"sobol\"", &plan_line), ("runs = 2000", "runs = 240")]);
        for (i, factor) in study.factors.iter().enumerate() {
            let values: Vec<f64> = (0..240).map(|run| factor_values(&study, run)[i]).collect();
            let [low, high] = factor.values.ends();
            assert!(values.iter().all(|value| (low..=high).contains(value)), "{plan}: {}", factor.name);
            let share = |from: f64, to: f64| {
                let place = |value: &f64| match factor.values {
                    config::Values::LogUniform(..) => (value / low).ln() / (high / low).ln(),
                    _ => (value - low) / (high - low),
                };
                values.iter().filter(|value| (from..to).contains(&place(value))).count()
            };
            // Of 240 runs 60 belong in each quarter; four standard deviations for the random ones.
            for quarter in 0..4 {
                let count = share(0.25 * f64::from(quarter), 0.25 * f64::from(quarter + 1) + 1e-12);
                assert!((33..=87).contains(&count), "{plan}: {} has {count} in quarter {quarter}", factor.name);
            }
        }
    }
}

#[test]
fn a_full_factorial_plan_makes_every_combination_once() {
    let levels = [("plan = \"sobol\"\nruns = 2000", "plan = \"full-factorial\"")];
    let study = study_of("settings.toml", &levels);
    assert_eq!(study.runs, 3_u64.pow(10));
    let mut first: Vec<String> = (0..729).map(|run| format!("{:?}", factor_values(&study, run))).collect();
    assert_eq!(factor_values(&study, 0)[9], 0.03);
    assert!((factor_values(&study, 2)[9] - 0.3).abs() < 1e-12);
    first.sort();
    first.dedup();
    assert_eq!(first.len(), 729);
}

#[test]
fn both_ways_to_sensitivity_agree_on_what_moves_the_open_loop() {
    let all = r#"observers = ["Kalman", "peak-to-peak", "rigid", "compliant", "open loop"]"#;
    let few = (all, "observers = [\"open loop\"]");
    let sobol = summary(study_of("settings.toml", &[few, ("runs = 2000", "runs = 600")]));
    let plan = ("plan = \"sobol\"\nruns = 2000", "plan = \"saltelli\"\nruns = 1200");
    let saltelli = summary(study_of("settings.toml", &[few, plan]));
    for phase in 0..PHASES.len() {
        let strongest = |summary: &Summary| {
            let effects = summary.effects(0, phase);
            let strongest = effects.iter().max_by(|a, b| a.first_order.total_cmp(&b.first_order)).unwrap().clone();
            (strongest.factor, strongest.first_order, strongest.total)
        };
        let (by_bins, by_pairs) = (strongest(&sobol), strongest(&saltelli));
        assert_eq!(by_bins.0, by_pairs.0);
        assert!((by_bins.1 - by_pairs.1).abs() < 0.15, "{by_bins:?} {by_pairs:?}");
        assert!(by_pairs.2.unwrap() > by_pairs.1 - 0.1);
    }
}

#[test]
fn the_model_error_is_of_the_chapters_order_and_a_design_reads_it() {
    let study = study_of("error_bound.toml", &[("runs = 1000", "runs = 200")]);
    let found = error_bound(&study, 2, || ()).unwrap();
    let [torque, inertia] = &found.phases[..] else { panic!("two phases") };
    // The chapter has 1600 rad/s^2, from simulations of its own car.
    assert!((800.0..3200.0).contains(&inertia.rigid.largest), "{}", inertia.rigid.largest);
    // Nearly all of it is the turbine torque in the inertia phase, and the output side in the torque phase.
    assert!(inertia.rigid_parts[0].largest > 0.8 * inertia.rigid.largest);
    assert!(torque.rigid_parts[3].largest > 0.8 * torque.rigid.largest);
    assert_eq!(torque.rigid_parts[1].largest, 0.0);

    let path = std::env::temp_dir().join(format!("wetclutch-bounds-{}.toml", std::process::id()));
    std::fs::write(&path, found.toml(&study)).unwrap();
    let vehicle = Vehicle::read_with(&experiments().join("../vehicles/two_speed_at.toml"), &path);
    std::fs::remove_file(path).unwrap();
    let vehicle = vehicle.unwrap();
    assert!((vehicle.inertia_phase.model_error_max_rad_s2 - inertia.rigid.largest).abs() < 0.1);
    let h = vehicle.compliant_inertia_phase.error_matrix.unwrap();
    assert!((h[0][0] - inertia.compliant_matrix.as_ref().unwrap()[0][0]).abs() < 1e-3);
}

#[test]
fn the_search_finds_a_case_at_least_as_bad_as_the_worst_run() {
    let study = study_of("settings.toml", &[("runs = 2000", "runs = 60")]);
    let campaign = Campaign::new(study).unwrap();
    let target = Target { observer: 1, phase: 1, metric: Metric::PressureRms };
    let found = worst_case(&campaign, target, 2, 40, 2, || ()).unwrap().unwrap();
    let score = |row: &study::Row| row.numbers[campaign.layout.score(1, 1, Metric::PressureRms)];
    assert!(score(&found.row) > score(&found.study_worst) && found.evaluations > 40);
    let inside = |(factor, value): (&config::Factor, &f64)| {
        let [low, high] = factor.values.ends();
        (low..=high).contains(value)
    };
    assert!(campaign.study.factors.iter().zip(&found.row.numbers).all(inside));
}

#[test]
fn the_guaranteed_range_holds_over_the_whole_budget_and_not_beyond_it() {
    // The range is the same around every observer; the open loop is the quickest.
    let alone = ("observers = [\"Kalman\", \"peak-to-peak\", \"open loop\"]", "observers = [\"open loop\"]");
    let covered = |changes: &[(&str, &str)]| {
        let summary = summary(study_of("budget.toml", &[&[alone], changes].concat()));
        (0..PHASES.len()).map(|phase| summary.covered(0, phase)).collect::<Vec<_>>()
    };
    assert_eq!(covered(&[("runs = 5000", "runs = 2000")]), [(2000, 2000), (2000, 2000)]);
    // A valve with a third more gain than the budget allows leaves the range.
    let beyond = covered(&[("runs = 5000", "runs = 8"), ("range = [0.9, 1.1]", "range = [1.45, 1.5]")]);
    assert!(beyond.iter().any(|(covered, all)| covered < all), "{beyond:?}");
}
