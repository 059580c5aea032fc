//! The drive of the demo: what the report claims about it, and a replay from measured signals alone.

use car::Vehicle;
use config::{ExperimentFile, VehicleFile};
use design::rigid_observer;
use observer::{Estimate, Estimator, Phase};
use study::{Comparison, ObserverRun, RunColumns, compare, run};
use trace::{read_csv, signal, write_csv};

fn comparison() -> (Vehicle, Comparison) {
    let (vehicle, experiment) = (VehicleFile::built_in().unwrap().vehicle, ExperimentFile::e1().unwrap().experiment);
    let comparison = compare(&vehicle, &experiment).unwrap();
    (vehicle, comparison)
}

fn estimates(columns: &RunColumns<'_>, observer: &impl Estimator<f64>) -> Vec<Estimate<f64>> {
    let mut estimates = Vec::new();
    let mut state = observer.start();
    let Ok(()) = run(
        columns.samples(),
        |input| observer.step(&mut state, input),
        |(), estimate| {
            estimates.push(estimate);
            Ok(())
        },
    );
    estimates
}

#[test]
fn a_replay_of_measurable_signals_gives_the_very_same_estimate() {
    let (vehicle, comparison) = comparison();
    let path = std::env::temp_dir().join(format!("wetclutch-replay-{}.csv", std::process::id()));
    write_csv(&path, &comparison.trace.filtered(|name| signal::MEASURABLE.contains(&name))).unwrap();
    let log = read_csv(&path).unwrap();
    std::fs::remove_file(&path).unwrap();
    assert!(log.get(signal::ONCOMING_PRESSURE).is_none());
    let columns = RunColumns::of(&log, &vehicle).unwrap();
    let estimates = estimates(&columns, &rigid_observer(&vehicle, comparison.rigid.gains()));
    let values = |estimates: &[Estimate<f64>]| -> Vec<_> {
        estimates.iter().map(|e| (e.pressure_pa, e.clutch_torque_n_m, e.phase, e.channels)).collect()
    };
    assert_eq!(values(&estimates), values(&comparison.runs[0].estimates));
}

#[test]
fn output_speed_serves_where_the_slip_was_not_recorded() {
    let (vehicle, comparison) = comparison();
    let without = comparison.trace.filtered(|name| name != signal::ONCOMING_SLIP);
    let columns = RunColumns::of(&without, &vehicle).unwrap();
    let estimates = estimates(&columns, &rigid_observer(&vehicle, comparison.rigid.gains()));
    assert_eq!(estimates.len(), comparison.runs[0].estimates.len());
    for (a, b) in estimates.iter().zip(&comparison.runs[0].estimates) {
        assert!((a.pressure_pa - b.pressure_pa).abs() < 1.0);
    }
}

#[test]
fn the_supervisor_finds_the_true_phases_within_a_few_hundredths_of_a_second() {
    let (_, comparison) = comparison();
    let start = |phases: &[Phase], phase: Phase| {
        let at = phases.iter().position(|&at| at == phase).unwrap();
        comparison.trace.time_s[at]
    };
    let seen: Vec<Phase> = comparison.runs[0].estimates.iter().map(|estimate| estimate.phase).collect();
    for phase in [Phase::InertiaPhase, Phase::AfterShift] {
        let late = start(&seen, phase) - start(&comparison.phases, phase);
        assert!((-0.02..0.04).contains(&late), "{phase:?} is seen {late} s late");
    }
}

#[test]
fn the_observer_halves_the_inertia_phase_error_and_stays_inside_its_bound() {
    let (_, comparison) = comparison();
    let rms = |run: &ObserverRun| run.pressure_in(Phase::InertiaPhase).unwrap().rms;
    let (rigid, open_loop) = (rms(&comparison.runs[0]), rms(comparison.open_loop().unwrap()));
    assert!(rigid < 0.6 * open_loop, "{rigid} {open_loop}");
    assert_eq!(comparison.bound_coverage(Phase::InertiaPhase).unwrap().0, 1.0);
    let bounded = comparison.runs[0].estimates.iter().zip(&comparison.bound_pa);
    let held = bounded.filter(|(estimate, bound)| estimate.phase == Phase::InertiaPhase && bound.is_some()).count();
    // The phase lasts more than 0.3 s, in samples of 1 ms.
    assert!(held > 300, "{held} samples");
}

#[test]
fn a_log_without_a_needed_signal_is_refused_by_name() {
    let (vehicle, comparison) = comparison();
    let without = comparison.trace.filtered(|name| name != signal::ONCOMING_CURRENT);
    let error = RunColumns::of(&without, &vehicle).unwrap_err().to_string();
    assert!(error.contains("`oncoming_current_a`"), "{error}");
}
