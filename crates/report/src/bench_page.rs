//! The page of the bench: the ranking, and every scenario.

use config::{Experiment, Vehicle};
use minijinja::context;
use study::Bench;
use trace::units::mpa;

use crate::page::{PageError, origin, templates};

/// The page of a bench of this experiment on this vehicle; it needs nothing but itself.
///
/// # Errors
/// None in a released program; the tests render the template.
pub fn bench_page(bench: &Bench, vehicle: &Vehicle, experiment: &Experiment) -> Result<String, PageError> {
    let pressure = |pascal: f64| format!("{:.3}", mpa(pascal));
    let ratio = |value: f64| format!("{value:.2}");
    let ranking = bench.ranking.iter().map(|s| {
        context! {
            observer => &s.observer,
            shift => ratio(s.shift_median_ratio),
            torque => [s.torque_phase_median_ratio, s.torque_phase_worst_ratio].map(ratio),
            inertia => [s.inertia_phase_median_ratio, s.inertia_phase_worst_ratio].map(ratio),
            chatter => pressure(s.chatter_median_pa),
            shaft => [s.shaft_median_rms_n_m, s.shaft_worst_rms_n_m]
                .map(|value| value.map_or_else(|| "–".to_owned(), |n_m| format!("{n_m:.0}"))),
            coverage => s.range_least_coverage.map_or_else(|| "–".to_owned(), |share| format!("{:.0} %", 100.0 * share)),
            over_errors => s.range_over_errors.map_or_else(|| "–".to_owned(), |over| format!("{over:.1}")),
            step => [s.step_ns, s.step_with_range_ns].map(|ns| format!("{ns:.0}")),
        }
    });
    let rows = bench.rows.iter().map(|row| {
        let least =
            |value: fn(&study::bench::BenchCell) -> f64| row.cells.iter().map(value).fold(f64::INFINITY, f64::min);
        let (torque, inertia) = (least(|c| c.torque_phase_rms_pa), least(|c| c.inertia_phase_rms_pa));
        context! {
            scenario => &row.scenario,
            completed => row.completed,
            cells => row.cells.iter().map(|c| context! {
                torque => pressure(c.torque_phase_rms_pa),
                inertia => pressure(c.inertia_phase_rms_pa),
                torque_best => c.torque_phase_rms_pa <= torque,
                inertia_best => c.inertia_phase_rms_pa <= inertia,
            }).collect::<Vec<_>>(),
        }
    });
    let first = bench.ranking.first();
    let widths = first.and_then(|s| {
        Some([
            pressure(s.range_median_width_pa?),
            format!("{:.0}", s.torque_range_median_width_n_m?),
            format!("{:.0}", s.shaft_range_median_width_n_m?),
        ])
    });
    Ok(templates()?.get_template("bench.html")?.render(context! {
        name => &experiment.name,
        title => &experiment.title,
        vehicle_name => &vehicle.name,
        version => env!("CARGO_PKG_VERSION"),
        seed => experiment.sensors.map(|sensors| sensors.seed),
        observers => bench.ranking.iter().map(|s| s.observer.clone()).collect::<Vec<_>>(),
        ranking => ranking.collect::<Vec<_>>(),
        rows => rows.collect::<Vec<_>>(),
        widths,
        inputs => origin(&[&vehicle.source, &experiment.source]),
    })?)
}
