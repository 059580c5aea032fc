//! The source chapter's experiments as a whole.

use std::sync::LazyLock;

use config::{ExperimentFile, Study, VehicleFile};
use observer::Phase;
use study::statements::Case;
use study::{Chapter, Comparison, Statement, reproduce};

/// The experiments, and the statements in so many settings besides.
fn chapter_in(settings: u64, threads: usize) -> Chapter {
    let (vehicle, study) = (VehicleFile::built_in().unwrap().vehicle, Study::plausible().unwrap());
    reproduce(&vehicle, &ExperimentFile::built_in().unwrap(), &study, settings, threads, || ()).unwrap()
}

/// The experiments without further settings.
static CHAPTER: LazyLock<Chapter> = LazyLock::new(|| chapter_in(0, 1));

fn statement(chapter: &Chapter, id: &str, case: Option<Case>) -> Statement {
    chapter.statements.iter().find(|row| row.id == id && row.case == case).unwrap().clone()
}

fn chatter(comparison: &Comparison, name: &str) -> f64 {
    comparison.run(name).unwrap().pressure_in(Phase::InertiaPhase).unwrap().chatter
}

fn rms(comparison: &Comparison, name: &str, phase: Phase) -> f64 {
    comparison.run(name).unwrap().pressure_in(phase).unwrap().rms
}

#[test]
fn every_statement_has_numbers_and_any_number_of_threads_gives_the_same_rows() {
    let (first, second) = (chapter_in(3, 1), chapter_in(3, 2));
    assert_eq!((&first.statements, first.settings), (&second.statements, second.settings));
    assert_eq!((first.settings.drawn, first.settings.whole), (3, 3));
    for row in &first.statements {
        assert!(row.ours.is_finite() && row.figures.iter().all(|figure| figure.value.is_finite()), "{row:?}");
        assert!(!row.claim.is_empty() && !row.criterion.is_empty() && !row.because.contains("NaN"), "{row:?}");
        assert!(row.agrees.is_some() || row.bound.is_some(), "a row says something: {row:?}");
        let fractions = row.share_of_settings.unwrap();
        assert_eq!(fractions.agrees.is_some(), row.agrees.is_some(), "{row:?}");
        assert_eq!(fractions.holds_at_start.is_some(), row.bound.is_some(), "{row:?}");
    }
    for experiment in ["E1", "E2", "E3", "E4"] {
        assert!(first.statements.iter().any(|row| row.experiment == experiment));
    }
}

/// A study that changes nothing must find what the files give: each fraction is none or all.
#[test]
fn the_setting_of_the_files_gives_the_verdicts_of_the_files() {
    let folder = std::env::temp_dir().join(format!("wetclutch-same-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("same.toml");
    let experiment = concat!(env!("CARGO_MANIFEST_DIR"), "/../../experiments/e4.toml");
    let text = format!(
        "name = \"same\"\ntitle = \"Nothing varies\"\nexperiment = '{experiment}'\nplan = \"sobol\"\nruns = 1\n\
         [[factor]]\nkey = \"vehicle.vehicle.mass_kg\"\nvalues = [1500]\n\
         [[factor]]\nkey = \"experiment.sensors.wheel.noise_rad_s\"\nvalues = [0.02]\n"
    );
    std::fs::write(&path, text).unwrap();
    let study = Study::read(&path).unwrap();
    std::fs::remove_dir_all(&folder).unwrap();
    let vehicle = VehicleFile::built_in().unwrap().vehicle;
    let chapter = reproduce(&vehicle, &ExperimentFile::built_in().unwrap(), &study, 1, 1, || ()).unwrap();
    let fraction = |verdict: Option<bool>| verdict.map(|yes| f64::from(u8::from(yes)));
    for row in &chapter.statements {
        let fractions = row.share_of_settings.unwrap();
        assert_eq!(fractions.agrees, fraction(row.agrees), "{row:?}");
        let bound = row.bound.as_ref();
        assert_eq!(fractions.holds, bound.and_then(|bound| fraction(bound.holds)), "{row:?}");
        assert_eq!(fractions.holds_at_start, bound.and_then(|bound| fraction(Some(bound.holds_at_start))), "{row:?}");
    }
}

/// The chapter's figure: at most 0.05 MPa, with the chapter's H.
#[test]
fn chapter_offsets_are_ours_and_hold_in_the_inertia_phase_once_the_initial_error_has_decayed() {
    for (id, case) in
        [("offset_rigid_inertia_phase", None), ("offset_compliant_torque_phase", Some(Case::ChapterErrors))]
    {
        assert_eq!(statement(&CHAPTER, id, case).agrees, Some(true), "{id}");
    }
    for id in ["offset_rigid_inertia_phase", "offset_compliant_inertia_phase"] {
        let rows: Vec<_> = CHAPTER.statements.iter().filter(|row| row.id == id).collect();
        assert_eq!(rows.len(), 2);
        for row in rows {
            let bound = row.bound.unwrap();
            assert_eq!(bound.holds, Some(true), "{row:?}");
            // What remains is far below the offset; what the phase begins with is not.
            assert!(bound.largest_after_decay_pa < 0.6 * bound.bound_pa, "{row:?}");
            assert!(bound.largest_from_start_pa > 0.9 * bound.bound_pa, "{row:?}");
        }
    }
}

#[test]
fn chapter_torque_phase_gains_make_the_rigid_observer_worse_the_larger_they_are() {
    let peaks = Case::GAINS.map(|gain| statement(&CHAPTER, "rigid_torque_phase_peak", Some(gain)).ours);
    assert!(peaks[0] < peaks[1] && peaks[1] < peaks[2], "{peaks:?}");
    // The compliant observer, off-nominal, is better than the rigid one with one of the readings only.
    let better = Case::GAINS.map(|gain| statement(&CHAPTER, "off_nominal_compliant_over_rigid", Some(gain)).agrees);
    assert_eq!(better, [Some(false), Some(false), Some(true)]);
}

#[test]
fn every_experiment_completes_its_shift_without_flare_or_tie_up() {
    for comparison in &CHAPTER.experiments {
        let quality = comparison.quality.unwrap();
        let name = &comparison.experiment.name;
        assert!((0.2..0.3).contains(&(quality.inertia_phase_start_s - quality.torque_phase_start_s)), "{name}");
        assert!((0.3..0.4).contains(&(quality.lock_up_s - quality.inertia_phase_start_s)), "{name}");
        assert!(quality.flare_rad_s < 3.0 && quality.least_shaft_torque_n_m > 0.0, "{name}");
        // Rated comfortable below about 10 m/s^3 over 20 ms, where E2 with half again the torque has 10.0; over 0.3 s it has 5.3. The limit is
        // that of 12 over 20 ms in this proportion.
        assert!(quality.jerk_peak_m_s3 < 6.4, "{name}: {}", quality.jerk_peak_m_s3);
    }
}

#[test]
fn sliding_chatters_more_the_larger_its_gains() {
    let [_, _, e3, _] = &CHAPTER.experiments;
    let [small, large, continuous] =
        ["Sliding 2 (small)", "Sliding 1 (large)", "Sliding, continuous gains"].map(|name| chatter(e3, name));
    assert!(small < large && large < continuous, "{small} {large} {continuous}");
    assert!(chatter(e3, "ISS, exact") < 0.2 * small);
}

#[test]
fn the_chapters_compliant_gains_do_as_well_as_ours() {
    let [_, _, _, e4] = &CHAPTER.experiments;
    for phase in [Phase::TorquePhase, Phase::InertiaPhase] {
        let (ours, theirs) = (rms(e4, "compliant", phase), rms(e4, "compliant, chapter's gains", phase));
        assert!((ours / theirs - 1.0).abs() < 0.1, "{phase:?}: {ours} {theirs}");
    }
}

#[test]
fn sensors_change_the_estimate_and_their_seed_changes_the_noise() {
    let vehicle = VehicleFile::built_in().unwrap().vehicle;
    let [_, _, _, mut e4] = ExperimentFile::built_in().unwrap();
    let name = "compliant, 100 Hz, sensors";
    let first = study::compare(&vehicle, &e4).unwrap();
    e4.sensors.as_mut().unwrap().seed += 1;
    let second = study::compare(&vehicle, &e4).unwrap();
    assert!(first.run(name).unwrap().estimates != second.run(name).unwrap().estimates);
    assert_eq!(first.run("compliant").unwrap().estimates, second.run("compliant").unwrap().estimates);
}

/// The bench with this seed for the sensors' noise and the better ones of its observers.
fn bench_with(seed: u64) -> study::Bench {
    let mut experiment = ExperimentFile::bench().unwrap();
    experiment.sensors.as_mut().unwrap().seed = seed;
    let kept = ["Kalman", "extended Kalman", "unscented", "inversion", "peak-to-peak", "open loop"];
    experiment.observers.retain(|entry| kept.contains(&entry.name.as_str()));
    study::bench(&VehicleFile::built_in().unwrap().vehicle, &experiment, |_| ()).unwrap()
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
    assert_eq!(bench.ranking.len(), 6);
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
    // The range is the valve's; relative to the errors it is the wider the smaller they are.
    assert!(best.range_median_width_pa.unwrap() <= 0.14e6, "{best:?}");
}

#[test]
fn peak_to_peak_is_hardly_worse_than_open_loop_where_it_uses_it() {
    let bench = &*FIRST;
    let summary = bench.ranking.iter().find(|s| s.observer == "peak-to-peak").unwrap();
    // Its torque phase is the open loop's but for samples in which the phase is seen late or early, most of them
    // where the sensors have three times their noise: that scenario, which has its own row on the page, is left out.
    assert_eq!(bench.rows.len(), 30);
    for row in bench.rows.iter().filter(|row| row.scenario != "sensor noise x 3") {
        let rms = |name| row.cells.iter().find(|cell| cell.observer == name).unwrap().torque_phase_rms_pa;
        assert!(rms("peak-to-peak") < 1.05 * rms("open loop"), "{}", row.scenario);
    }
    assert!(summary.inertia_phase_median_ratio < 0.6, "{}", summary.inertia_phase_median_ratio);
}
