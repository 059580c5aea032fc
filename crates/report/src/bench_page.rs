//! The page of the bench: the ranking, and every scenario.

use config::{ExperimentFile, VehicleFile};
use minijinja::{Value, context};
use observer::Phase;
use study::Bench;
use study::bench::{BenchCell, BenchConsistency, BenchSummary};
use study::campaign::PHASES;
use trace::units::mpa;

use crate::page::{PageError, origin, render};
use crate::tables::{coverage, number, phase_name};

/// The page of a bench of this experiment on this vehicle; it needs nothing but itself.
///
/// # Errors
/// None in a released program; the tests render the template.
pub fn bench_page(bench: &Bench, vehicle: &VehicleFile, experiment: &ExperimentFile) -> Result<String, PageError> {
    // The order of the ranking; without one, that of the experiment.
    let observers: Vec<String> =
        bench.rows.first().map_or_else(Vec::new, |row| row.cells.iter().map(|cell| cell.observer.clone()).collect());
    let first = bench.ranking.first();
    let widths = first.and_then(|s| {
        Some([
            pressure(s.range_median_width_pa?),
            number(s.torque_range_median_width_n_m?, 0),
            number(s.shaft_range_median_width_n_m?, 0),
        ])
    });
    render(
        "bench.html",
        context! {
            name => &experiment.name,
            title => &experiment.title,
            vehicle_name => &vehicle.name,
            version => env!("CARGO_PKG_VERSION"),
            seed => experiment.sensors.map(|sensors| sensors.seed),
            observers,
            ranking => bench.ranking.iter().map(ranked).collect::<Vec<_>>(),
            phases => PHASES.map(|phase| scenarios(bench, phase)),
            rows => bench.rows.len(),
            widths,
            consistency => bench.consistency.as_ref().map(consistency),
            inputs => origin(&[&vehicle.source, &experiment.source]),
        },
    )
}

fn pressure(pascal: f64) -> String {
    number(mpa(pascal), 3)
}

fn ratio(value: f64) -> String {
    number(value, 2)
}

/// A row of the ranking.
fn ranked(s: &BenchSummary) -> Value {
    let optional = |value: Option<f64>, decimals| number(value.unwrap_or(f64::NAN), decimals);
    context! {
        observer => &s.observer,
        diverged => s.diverged,
        shift => ratio(s.shift_median_ratio),
        torque => [s.torque_phase_median_ratio, s.torque_phase_worst_ratio].map(ratio),
        inertia => [s.inertia_phase_median_ratio, s.inertia_phase_worst_ratio].map(ratio),
        chatter => pressure(s.chatter_median_pa),
        shaft => [s.shaft_median_rms_n_m, s.shaft_worst_rms_n_m].map(|n_m| optional(n_m, 0)),
        coverage => s.range_least_coverage.map_or_else(|| "–".to_owned(), coverage),
        over_errors => optional(s.range_over_errors, 1),
        step => [s.step_ns, s.step_with_range_ns].map(|ns| number(ns, 0)),
    }
}

/// The errors of all observers in a phase, scenario by scenario.
fn scenarios(bench: &Bench, phase: Phase) -> Value {
    let rms = |cell: &BenchCell| match phase {
        Phase::InertiaPhase => cell.inertia_phase_rms_pa,
        _ => cell.torque_phase_rms_pa,
    };
    let rows = bench.rows.iter().map(|row| {
        let lowest = row.cells.iter().map(rms).fold(f64::INFINITY, f64::min);
        let cells = row.cells.iter().filter(|_| row.completed);
        let cells: Vec<Value> =
            cells.map(|c| context! { rms => pressure(rms(c)), best => !c.diverged && rms(c) <= lowest }).collect();
        context! { scenario => &row.scenario, cells }
    });
    context! { name => phase_name(phase), rows => rows.collect::<Vec<_>>() }
}

/// How sure the filter is.
fn consistency(filter: &BenchConsistency) -> Value {
    let (all, (scenario, minimum)) = (&filter.all, &filter.minimum);
    context! {
        observer => &filter.observer,
        inside => coverage(all.inside_fraction()),
        minimum => coverage(*minimum),
        scenario,
        nees => ratio(all.nees()),
        nis => all.nis().map(ratio),
        same => coverage(all.same_fraction()),
        largest_kpa => number(1e-3 * all.largest_pa, 2),
        excess_percent => number(100.0 * all.excess_in_single(), 2),
        restarts => all.restarts,
    }
}
