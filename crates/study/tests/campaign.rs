//! Plans, sensitivity, model errors and worst cases on real studies.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use car::{GivenGains, ObserverKind};
use config::{ExperimentFile, Study, Values, VehicleFile};
use observer::Phase;
use study::campaign::{Metric, PHASES, factor_values, scored_shift};
use study::{Campaign, ShiftQuality, StudyError, Summary, Target, error_bound, execute, simulate_shift, worst_case};
use trace::Trace;

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
    for experiment in ["bench.toml", "combined_drive.toml", "e1.toml", "field.toml"] {
        let whole = experiments().join(experiment);
        text = text.replace(&format!("experiment = \"{experiment}\""), &format!("experiment = '{}'", whole.display()));
    }
    // The tests of one process run at the same time: each file needs a name of its own.
    static FILES: AtomicU32 = AtomicU32::new(0);
    let number = FILES.fetch_add(1, Ordering::Relaxed);
    let path = std::env::temp_dir().join(format!("wetclutch-campaign-{}-{number}.toml", std::process::id()));
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
            let fraction = |from: f64, to: f64| {
                let place = |value: &f64| match factor.values {
                    config::Values::LogUniform(..) => (value / low).ln() / (high / low).ln(),
                    _ => (value - low) / (high - low),
                };
                values.iter().filter(|value| (from..to).contains(&place(value))).count()
            };
            // Of 240 runs 60 belong in each quarter; four standard deviations for the random ones.
            for quarter in 0..4 {
                let count = fraction(0.25 * f64::from(quarter), 0.25 * f64::from(quarter + 1) + 1e-12);
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
fn a_factor_by_chance_is_in_its_fraction_of_the_runs_and_neutral_in_the_rest() {
    for plan in ["sobol", "latin-hypercube", "random"] {
        let study = study_of("combined.toml", &[("plan = \"sobol\"", &format!("plan = \"{plan}\""))]);
        let runs: Vec<Vec<f64>> = (0..2000).map(|run| factor_values(&study, run)).collect();
        for (i, factor) in study.factors.iter().enumerate() {
            let Values::Sometimes(sometimes) = &factor.values else { continue };
            let here: Vec<f64> = runs.iter().map(|run| run[i]).filter(|value| *value != sometimes.otherwise).collect();
            // Five standard deviations of a binomial count: 1000 with a variance of 500.
            assert!(here.len().abs_diff(1000) < 5 * 23, "{plan}: {} in {}", factor.name, here.len());
            let [low, high] = sometimes.values.ends();
            assert!(here.iter().all(|value| (low..=high).contains(value)));
            let upper = here.iter().filter(|value| **value > 0.5 * (low + high)).count();
            // A range of values is filled evenly; of 1, 2, 3 one third is above the middle, and of one value none.
            let fraction = match factor.name.as_str() {
                "missing_share" | "piston_stroke" => 0.0,
                "outliers" => 1.0 / 3.0,
                _ => 0.5,
            };
            assert!((upper as f64 / here.len() as f64 - fraction).abs() < 5.0 * 0.5 / 1000.0_f64.sqrt());
        }
        // Two of them are together in a quarter of the runs.
        let at = |name: &str| study.factors.iter().position(|factor| factor.name == name).unwrap();
        let both = runs.iter().filter(|run| run[at("wheel_scale")] != 1.0 && run[at("wheel_delay_s")] != 0.0).count();
        assert!(both.abs_diff(500) < 5 * 20, "{plan}: {both}");
    }
}

#[test]
fn a_factor_by_chance_has_its_neutral_value_as_one_more_level() {
    let scale = "range = [0.98, 1.02]\nchance = 0.5\notherwise = 1.0";
    let chance = format!("change = \"scale\"\nname = \"shaft_stiffness_factor\"\n{scale}");
    let levels = [
        ("change = \"scale\"\nname = \"shaft_stiffness_factor\"\nrange = [0.8, 1.2]", chance.as_str()),
        ("plan = \"sobol\"\nruns = 2000", "plan = \"full-factorial\""),
    ];
    let study = study_of("settings.toml", &levels);
    assert_eq!(study.runs, 4 * 3_u64.pow(9));
    let mut seen: Vec<f64> = (0..12).map(|run| factor_values(&study, run)[8]).collect();
    seen.dedup();
    assert_eq!(seen, [1.0, 0.98, 1.0, 1.02]);
}

#[test]
fn runs_with_errors_of_the_sensors_are_the_same_on_any_number_of_threads() {
    let study = || study_of("combined.toml", &[("runs = 2000", "runs = 24"), ("record_before_s = 7.0", "")]);
    let lines = |threads| {
        let campaign = Campaign::new(study()).unwrap();
        let mut lines = Vec::new();
        execute::<StudyError>(&campaign, 0..24, threads, |row| {
            lines.push(row.line(&campaign.layout));
            Ok(())
        })
        .unwrap();
        lines
    };
    assert_eq!(lines(1), lines(3));
}

#[test]
fn the_errors_over_those_of_the_open_loop_are_of_runs_and_of_quantiles() {
    let two =
        ("observers = [\"Kalman\", \"open loop, maps\", \"open loop\"]", "observers = [\"Kalman\", \"open loop\"]");
    let campaign = Campaign::new(study_of("combined.toml", &[two, ("runs = 2000", "runs = 200")])).unwrap();
    let mut summary = Summary::new(&campaign.study);
    // The open loop's error is the number of the run; the first observer's is half of it, but for the last ten runs.
    for run in 0..200 {
        let mut row = made_up(&campaign, run, [1.0; 2]);
        let reference = (run + 1) as f64;
        let factor = if run < 190 { 0.5 } else { 3.0 };
        for (metric, fraction) in [(Metric::PressureRms, factor), (Metric::TorqueRms, 2.0 * factor)] {
            row.numbers[campaign.layout.score(0, 0, metric)] = fraction * reference;
            row.numbers[campaign.layout.score(1, 0, metric)] = reference;
        }
        summary.push(&row);
    }
    // Quantiles are good to half a per cent, and a ratio of two of them to one.
    let near = |value: f64, expected: f64| assert!((value / expected - 1.0).abs() < 0.011, "{value} {expected}");
    for (compared, fraction) in [(0, 1.0), (1, 2.0)] {
        let relative = summary.relative(compared, 0, 0).unwrap();
        near(relative.median, 0.5 * fraction);
        near(relative.high, 0.5 * fraction);
        near(relative.largest, 3.0 * fraction);
        // Of the 200 errors the ten largest are those of the last runs: 95 % of them are below half of 190.
        near(relative.high_over_high, 0.5 * fraction);
        near(relative.worst_over_worst, 3.0 * fraction);
    }
    assert!((summary.relative(0, 0, 0).unwrap().better - 0.95).abs() < 1e-12);
    assert_eq!(summary.relative(1, 0, 0).unwrap().better, 0.0);
    assert!(summary.relative(0, 1, 0).is_none(), "the open loop is not compared with itself");
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
    let vehicle = VehicleFile::read_with(&experiments().join("../vehicles/two_speed_at.toml"), &path);
    std::fs::remove_file(path).unwrap();
    let vehicle = vehicle.unwrap();
    assert!((vehicle.requirements.inertia_phase.model_error_max_rad_s2 - inertia.rigid.largest).abs() < 0.1);
    let h = vehicle.requirements.compliant_inertia_phase.error_matrix.unwrap();
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
    // The largest score so far does not fall, and is that of the worst case in the end.
    assert_eq!(found.progress.len(), 2);
    assert!(found.progress.iter().flat_map(|of| of.windows(2)).all(|pair| pair[0] <= pair[1]));
    let last = found.progress.iter().filter_map(|of| of.last()).copied().fold(0.0, f64::max);
    assert!(last >= score(&found.row), "{last} {}", score(&found.row));
    let inside = |(factor, value): (&config::Factor, &f64)| {
        let [low, high] = factor.values.ends();
        (low..=high).contains(value)
    };
    assert!(campaign.study.factors.iter().zip(&found.row.numbers).all(inside));
}

#[test]
fn a_sobol_plan_goes_on_where_its_sequence_would_begin_anew() {
    let study = study_of("settings.toml", &[("runs = 2000", "runs = 200000")]);
    let first: Vec<Vec<f64>> = (0..64).map(|run| factor_values(&study, run)).collect();
    for run in 65536..65600 {
        assert!(!first.contains(&factor_values(&study, run)), "run {run} repeats another");
    }
}

/// Every correction by such a gain is more than the supply can give, so that none is taken.
#[test]
fn an_observer_whose_gain_is_absurd_is_the_open_loop() {
    let few = r#"observers = ["open loop"]"#;
    let all = r#"observers = ["Kalman", "peak-to-peak", "rigid", "compliant", "open loop"]"#;
    let mut study = study_of("settings.toml", &[(all, few), ("runs = 2000", "runs = 12")]);
    let mut experiment = ExperimentFile::clone(&study.experiment);
    let mut entry = experiment.observers[0].clone();
    let gains = GivenGains::Rigid { torque_phase_pa_s_rad: 1e200, inertia_phase_pa_s_rad: [1e200; 2] };
    (entry.name, entry.kind, entry.gains) = ("wild".to_owned(), ObserverKind::Rigid, Some(gains));
    experiment.observers.insert(0, entry);
    study.experiment = Arc::new(experiment);
    let summary = summary(study);
    for phase in 0..PHASES.len() {
        assert_eq!((summary.rms(0, phase).count(), summary.rms(0, phase).diverged()), (12, 0));
        assert_eq!(summary.ratio(0, phase).largest(), 1.0);
    }
}

/// A row is made of no more of a run than it scores.
#[test]
fn a_row_has_the_scores_of_the_whole_run() {
    let errors = [("runs = 2000", "runs = 12"), ("seed = 1", "seed = 5")];
    let campaign = Campaign::new(study_of("settings.toml", &errors)).unwrap();
    for run in 0..campaign.study.runs {
        let (row, whole) = (campaign.row(run).unwrap(), campaign.run_in_full(run).unwrap());
        assert!(row.status.is_scored() && whole.quality.is_some());
        for (at, observer) in whole.observers.iter().enumerate() {
            for (place, phase) in PHASES.into_iter().enumerate() {
                let number = |metric| row.numbers[campaign.layout.score(at, place, metric)];
                let of_run = observer.pressure_in(phase).unwrap();
                let range = observer.ranges.iter().find(|range| range.phase == phase).unwrap();
                assert_eq!(number(Metric::PressureRms), of_run.rms, "run {run}, {}", observer.entry.name);
                assert_eq!(number(Metric::Chatter), of_run.chatter);
                assert_eq!(number(Metric::RangeWidth), range.width_pa);
                assert_eq!(number(Metric::Coverage), range.inside());
            }
        }
    }
}

/// A row of this campaign, made up: the first observer has these RMS errors in the two phases.
fn made_up(campaign: &Campaign, run: u64, rms: [f64; 2]) -> study::Row {
    let mut numbers = factor_values(&campaign.study, run);
    numbers.resize(campaign.layout.width(), 1.0);
    for (phase, rms) in rms.into_iter().enumerate() {
        numbers[campaign.layout.score(0, phase, Metric::PressureRms)] = rms;
    }
    study::Row { run, seed: study::campaign::run_seed(&campaign.study, run), status: study::Status::Ok, numbers }
}

#[test]
fn a_row_whose_scores_do_not_go_with_its_status_is_refused() {
    let campaign = Campaign::new(study_of("settings.toml", &[("runs = 2000", "runs = 12")])).unwrap();
    let refused = |row: study::Row| campaign.row_of_line(row.run, &row.line(&campaign.layout)).is_err();
    let row = made_up(&campaign, 3, [1.0; 2]);
    assert!(!refused(row.clone()));
    assert!(refused(study::Row { status: study::Status::Diverged, ..row }));
    assert!(refused(made_up(&campaign, 3, [-1.0, 1.0])));
}

#[test]
fn an_observer_that_diverges_is_worse_than_all_others() {
    let campaign = Campaign::new(study_of("settings.toml", &[("runs = 2000", "runs = 12")])).unwrap();
    let row = |run| made_up(&campaign, run, [f64::INFINITY; 2]);
    // The row says it, and is read back as it was written.
    let line = row(3).line(&campaign.layout);
    assert_eq!(campaign.row_of_line(3, &line).unwrap().line(&campaign.layout), line);
    // Its runs are counted, above all others.
    let mut summary = Summary::new(&campaign.study);
    (0..12).for_each(|run| summary.push(&row(run)));
    for phase in 0..PHASES.len() {
        let (wild, sound) = (summary.rms(0, phase), summary.rms(1, phase));
        assert_eq!((wild.count(), wild.diverged(), sound.diverged()), (12, 12, 0));
        assert_eq!((wild.quantile(0.5), wild.largest()), (f64::INFINITY, f64::INFINITY));
        assert_eq!(
            (summary.ratio(0, phase).largest(), summary.ratio(0, phase).fraction_below(1.0)),
            (f64::INFINITY, 0.0)
        );
        assert!(sound.quantile(0.95).is_finite() && summary.effects(1, phase)[0].means.iter().any(|x| x.is_finite()));
    }
}

#[test]
fn a_run_that_diverged_comes_first_among_the_worst() {
    let study = study_of("settings.toml", &[("runs = 2000", "runs = 12")]);
    let campaign = Campaign::new(study).unwrap();
    let mut summary = Summary::new(&campaign.study);
    let scores = [[1.0, 2.0], [9.0, 1.0], [f64::INFINITY, 1.0], [f64::NAN, 5.0], [1.0, f64::INFINITY]];
    (0..).zip(scores).for_each(|(run, rms)| summary.push(&made_up(&campaign, run, rms)));
    assert_eq!(summary.worst.iter().map(|row| row.run).collect::<Vec<_>>(), [2, 4, 1, 3, 0]);
    assert_eq!((summary.rms(0, 0).count(), summary.rms(0, 0).diverged()), (4, 1));
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

#[test]
fn a_shift_recorded_for_its_row_is_the_shift_recorded_whole() {
    for (file, run) in [("settings.toml", 3), ("settings.toml", 8), ("combined.toml", 5)] {
        let study = study_of(file, &[]);
        let varied = study.varied(&factor_values(&study, run)).unwrap();
        let (car, nominal) = (&varied.car, &varied.vehicle);
        let whole = simulate_shift(car, nominal, &varied.experiment, study.record_before_s).unwrap();
        // The memory of another trace leaves nothing behind.
        let scored = scored_shift(whole.clone(), car, nominal, &varied.experiment, study.record_before_s).unwrap();
        let fresh = scored_shift(Trace::default(), car, nominal, &varied.experiment, study.record_before_s).unwrap();
        assert_eq!(scored.quality, ShiftQuality::of(&whole, &nominal.shift));
        assert!(scored.quality.is_some());
        let (phases, rows) = (study::true_phases(&whole).unwrap(), scored.trace.len());
        assert_eq!(rows, 1 + phases.iter().rposition(|phase| PHASES.contains(phase)).unwrap());
        assert_eq!(scored.trace.time_s, whole.time_s[..rows]);
        assert_eq!(study::true_phases(&scored.trace).unwrap(), phases[..rows]);
        for column in scored.trace.columns.iter().filter(|column| column.name != trace::signal::TRUE_PHASE) {
            let (recorded, all) = (scored.trace.get(&column.name).unwrap(), whole.get(&column.name).unwrap());
            let again = fresh.trace.get(&column.name).unwrap();
            for (at, value) in recorded.iter().enumerate() {
                let not_scored = value.is_nan() && phases[at] == Phase::AfterShift;
                assert!(not_scored || value.to_bits() == all[at].to_bits(), "{} in row {at}", column.name);
                assert_eq!(value.to_bits(), again[at].to_bits());
            }
        }
    }
}
