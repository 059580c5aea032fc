//! The source chapter's experiments as a whole.

#![expect(clippy::unwrap_used, reason = "a test may")]

use std::sync::LazyLock;

use config::{Experiment, Vehicle};
use observer::Phase;
use study::{Chapter, Comparison, reproduce};

fn chapter() -> Chapter {
    reproduce(&Vehicle::two_speed_at().unwrap(), &Experiment::built_in().unwrap()).unwrap()
}

fn chatter(comparison: &Comparison, name: &str) -> f64 {
    comparison.run(name).unwrap().pressure_in(Phase::InertiaPhase).unwrap().chatter
}

fn rms(comparison: &Comparison, name: &str, phase: Phase) -> f64 {
    comparison.run(name).unwrap().pressure_in(phase).unwrap().rms
}

#[test]
fn every_statement_has_a_figure_and_the_same_run_gives_the_same_rows() {
    let (first, second) = (chapter(), chapter());
    assert_eq!(first.statements, second.statements);
    for statement in &first.statements {
        assert!(!statement.ours.contains("NaN") && !statement.because.contains("NaN"), "{statement:?}");
    }
    for experiment in ["E1", "E2", "E3", "E4"] {
        assert!(first.statements.iter().any(|statement| statement.experiment == experiment));
    }
}

#[test]
fn every_experiment_completes_its_shift_without_flare_or_tie_up() {
    for comparison in &chapter().experiments {
        let quality = comparison.quality.unwrap();
        let name = &comparison.experiment.name;
        assert!((0.2..0.3).contains(&(quality.inertia_phase_start_s - quality.torque_phase_start_s)), "{name}");
        assert!((0.3..0.4).contains(&(quality.lock_up_s - quality.inertia_phase_start_s)), "{name}");
        assert!(quality.flare_rad_s < 3.0 && quality.least_shaft_torque_n_m > 0.0, "{name}");
        // Rated comfortable below about 10 m/s^3; E2 has half again the torque.
        assert!(quality.jerk_peak_m_s3 < 12.0, "{name}: {}", quality.jerk_peak_m_s3);
    }
}

#[test]
fn sliding_chatters_more_the_larger_its_gains() {
    let [_, _, e3, _] = &chapter().experiments;
    let [small, large, continuous] =
        ["Sliding 2 (small)", "Sliding 1 (large)", "Sliding, continuous gains"].map(|name| chatter(e3, name));
    assert!(small < large && large < continuous, "{small} {large} {continuous}");
    assert!(chatter(e3, "ISS, exact") < 0.2 * small);
}

#[test]
fn the_chapters_compliant_gains_do_as_well_as_ours() {
    let [_, _, _, e4] = &chapter().experiments;
    for phase in [Phase::TorquePhase, Phase::InertiaPhase] {
        let (ours, theirs) = (rms(e4, "compliant", phase), rms(e4, "compliant, chapter's gains", phase));
        assert!((ours / theirs - 1.0).abs() < 0.1, "{phase:?}: {ours} {theirs}");
    }
}

#[test]
fn sensors_change_the_estimate_and_their_seed_changes_the_noise() {
    let vehicle = Vehicle::two_speed_at().unwrap();
    let [_, _, _, mut e4] = Experiment::built_in().unwrap();
    let name = "compliant, 100 Hz, sensors";
    let first = study::compare(&vehicle, &e4).unwrap();
    e4.sensors.as_mut().unwrap().seed += 1;
    let second = study::compare(&vehicle, &e4).unwrap();
    assert!(first.run(name).unwrap().estimates != second.run(name).unwrap().estimates);
    assert_eq!(first.run("compliant").unwrap().estimates, second.run("compliant").unwrap().estimates);
}

/// The bench with this seed for the sensors' noise and the better ones of its observers.
fn bench_with(seed: u64) -> study::Bench {
    let mut experiment = Experiment::bench().unwrap();
    experiment.sensors.as_mut().unwrap().seed = seed;
    let kept = ["Kalman", "extended Kalman", "unscented", "inversion", "peak-to-peak", "open loop"];
    experiment.observers.retain(|entry| kept.contains(&entry.name.as_str()));
    study::bench(&Vehicle::two_speed_at().unwrap(), &experiment, |_| ()).unwrap()
}

/// The one with seed 1, which two tests look at.
static FIRST: LazyLock<study::Bench> = LazyLock::new(|| bench_with(1));

fn summary<'a>(bench: &'a study::Bench, name: &str) -> &'a study::bench::BenchSummary {
    bench.ranking.iter().find(|s| s.observer == name).unwrap()
}

#[test]
fn another_seed_gives_other_numbers_and_the_same_ranking() {
    let (first, second) = (&*FIRST, bench_with(2));
    assert!(first.rows.iter().all(|row| row.completed));
    assert!(first.rows != second.rows, "other noise, other numbers");
    let names = |bench: &study::Bench| bench.ranking.iter().map(|s| s.observer.clone()).collect::<Vec<_>>();
    assert_eq!(names(first), names(&second));
}

#[test]
fn the_best_observer_keeps_what_the_guide_says_of_it() {
    let bench = bench_with(2014);
    let best = summary(&bench, "Kalman");
    assert!(best.torque_phase_worst_ratio <= 1.05 && best.torque_phase_median_ratio <= 0.6, "{best:?}");
    assert!(best.inertia_phase_median_ratio <= 0.5, "{best:?}");
    for rival in bench.ranking.iter().filter(|s| s.observer != "Kalman") {
        assert!(best.inertia_phase_median_ratio < rival.inertia_phase_median_ratio, "{}", rival.observer);
    }
    let cell = |scenario: &str, observer: &str| {
        let row = bench.rows.iter().find(|row| row.scenario == scenario).unwrap();
        row.cells.iter().find(|cell| cell.observer == observer).unwrap().clone()
    };
    let nominal = cell("nominal", "Kalman");
    assert!(nominal.inertia_phase_rms_pa <= 0.010e6 && nominal.shaft_rms_n_m.unwrap() <= 50.0, "{nominal:?}");
    assert!(cell("E2", "Kalman").inertia_phase_rms_pa <= 0.015e6);
    // Where the lags of output and wheel do not happen to cancel, knowing them pays.
    for scenario in ["slow wheel sensor", "slow output sensor"] {
        let (told, textbook) = (cell(scenario, "Kalman"), cell(scenario, "extended Kalman"));
        assert!(told.shift_rms_pa < 0.8 * textbook.shift_rms_pa, "{scenario}: {told:?} {textbook:?}");
        assert!(told.shaft_rms_n_m < textbook.shaft_rms_n_m, "{scenario}");
    }
    assert!(bench.ranking.iter().all(|s| s.range_least_coverage == Some(1.0)));
    assert!(best.range_over_errors.unwrap() <= 3.0, "{best:?}");
}

#[test]
fn peak_to_peak_is_hardly_worse_than_open_loop_where_it_uses_it() {
    let bench = &*FIRST;
    let summary = bench.ranking.iter().find(|s| s.observer == "peak-to-peak").unwrap();
    // Its torque phase is the open loop's but for samples in which the phase is seen late or early, most of them
    // where the sensors have three times their noise: that scenario, which has its own row on the page, is left out.
    for row in bench.rows.iter().filter(|row| row.scenario != "sensor noise x 3") {
        let rms = |name| row.cells.iter().find(|cell| cell.observer == name).unwrap().torque_phase_rms_pa;
        assert!(rms("peak-to-peak") < 1.05 * rms("open loop"), "{}", row.scenario);
    }
    assert!(summary.inertia_phase_median_ratio < 0.6, "{}", summary.inertia_phase_median_ratio);
}
