//! `wetclutch bench`.

use std::path::Path;

use config::{ExperimentFile, VehicleFile};
use report::tables::{coverage, number};
use study::Bench;
use study::bench::{BenchConsistency, BenchRow, open_loop};
use trace::quantity;
use trace::{ShownPath as _, units};

use super::bench_page::sheet;
use crate::args;
use crate::browser;
use crate::commands::{progress, replaceable, warn_without_effect, write_text};
use crate::failure::Failure;
use crate::output;

pub(crate) fn bench(options: &args::Bench) -> Result<(), Failure> {
    if let Some(vehicle) = &options.vehicle {
        return super::matrix::bench(options, vehicle);
    }
    let (vehicle, experiment) = match &options.experiment {
        Some(path) => {
            let experiment = ExperimentFile::read(path)?;
            (experiment.read_vehicle()?, experiment)
        }
        None => (VehicleFile::built_in()?, ExperimentFile::bench()?),
    };
    if options.threads.is_given() {
        warn_without_effect(
            "--threads",
            "the scenarios of an experiment are run one after the other, as their steps are timed",
        );
    }
    experiment.check_size()?;
    open_loop(&experiment)?;
    options.output.as_deref().map(|folder| replaceable(folder, &["bench.html"])).transpose()?;
    let all = experiment.scenarios.len();
    output::note(&format!("running {} observers on {all} scenarios", experiment.observers.len()));
    let bar = progress(all as u64, 0);
    let result = study::bench(&vehicle, &experiment, |_| bar.inc(1))?;
    bar.finish_and_clear();
    let page = options.output.as_ref().map(|folder| folder.join("bench.html"));
    if let Some(page) = &page {
        write_text(page, &sheet(&result, &vehicle, &experiment).html()?)?;
    }
    if options.json { output::json(&result) } else { print(&result, page.as_deref()) }?;
    page.iter().for_each(|page| browser::open_if(options.open.is_wanted, page));
    Ok(())
}

fn print(result: &Bench, page: Option<&Path>) -> Result<(), Failure> {
    errors(result)?;
    ranking(result)?;
    ranges(result)?;
    if let Some(consistency) = &result.consistency {
        output::line(&consistent(consistency))?;
    }
    failures(result)?;
    if let Some(page) = page {
        output::line(&format!("\npage: {}", page.shown()))?;
    }
    Ok(())
}

fn errors(result: &Bench) -> Result<(), Failure> {
    output::line("RMS error of the pressure in the torque phase / in the inertia phase\n")?;
    let names =
        result.rows.iter().take(1).flat_map(|row| row.cells.iter().map(|cell| format!("{} MPa", cell.observer)));
    let titles = std::iter::once("scenario".to_owned()).chain(names).collect();
    output::table(1, titles, result.rows.iter().map(cells).collect())?;
    Ok(())
}

fn ranking(result: &Bench) -> Result<(), Failure> {
    output::line(
        "\nRMS error relative to that of the open loop, median and worst scenario; ranked by the median over the whole shift\n",
    )?;
    let head = [
        "observer",
        "shift",
        "torque phase",
        "worst",
        "inertia phase",
        "worst",
        "chatter MPa",
        "shaft torque N m",
        "worst N m",
        "step ns",
    ];
    let rows = result.ranking.iter().map(|s| {
        let ratio = |value: f64| number(value, 2);
        let torque = |value: Option<f64>| value.map_or_else(String::new, |n_m| number(n_m, 0));
        vec![
            s.observer.clone(),
            ratio(s.shift_median_ratio),
            ratio(s.torque_phase_median_ratio),
            ratio(s.torque_phase_worst_ratio),
            ratio(s.inertia_phase_median_ratio),
            ratio(s.inertia_phase_worst_ratio),
            number(units::mpa(s.chatter_median_pa), 3),
            torque(s.shaft_median_rms_n_m),
            torque(s.shaft_worst_rms_n_m),
            format!("{:.0}", s.step_ns),
        ]
    });
    output::table(1, head.map(str::to_owned).to_vec(), rows.collect())?;
    Ok(())
}

/// Coverage, width and cost of the guaranteed range.
fn ranges(result: &Bench) -> Result<(), Failure> {
    if let Some(first) = result.ranking.first().filter(|s| s.range_least_coverage.is_some()) {
        let width = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |n_m| quantity(n_m, "N m", 0));
        output::line(&format!(
            "\nguaranteed range of pressure and clutch torque, the same for every observer: contains the truth at {} of\n\
             the samples, in the worst scenario; expected range of the shaft torque: at {}\n\
             median width: pressure {}, clutch torque {}, shaft torque {}\n\
             mean width, relative to the width that contains 95 % of the errors of {}: {:.1}\n\
             time that the range adds to a step: {:.0} ns",
            coverage(first.range_least_coverage.unwrap_or(f64::NAN)),
            coverage(first.shaft_range_least_coverage.unwrap_or(f64::NAN)),
            quantity(units::mpa(first.range_median_width_pa.unwrap_or(f64::NAN)), "MPa", 3),
            width(first.torque_range_median_width_n_m),
            width(first.shaft_range_median_width_n_m),
            first.observer,
            first.range_over_errors.unwrap_or(f64::NAN),
            first.step_with_range_ns - first.step_ns,
        ))?;
    }
    Ok(())
}

/// Observers that diverged, and scenarios without a completed shift.
fn failures(result: &Bench) -> Result<(), Failure> {
    let diverged = result.ranking.iter().filter(|s| s.diverged > 0);
    let diverged: Vec<String> =
        diverged.map(|s| format!("{} in {} of {} scenarios", s.observer, s.diverged, result.completed())).collect();
    if !diverged.is_empty() {
        output::line(&format!("\ndiverged: {}", diverged.join(", ")))?;
    }
    let missing: Vec<&str> = result.rows.iter().filter(|row| !row.completed).map(|row| row.scenario.as_str()).collect();
    if !missing.is_empty() {
        output::note(&format!(
            "shift not completed within the simulated time, scenario not ranked: {}",
            missing.join(", ")
        ));
    }
    Ok(())
}

/// How sure the filter is, and what single precision costs it.
fn consistent(filter: &BenchConsistency) -> String {
    let (all, (scenario, minimum)) = (&filter.all, &filter.minimum);
    let [turbine, output, wheel] = all.nis();
    format!(
        "\n{}: the true pressure is in its own 95 % band at {} of the samples of the shifts, lowest in `{scenario}` with {}\n\
         mean square over variance: error of the pressure {:.2}; innovations of turbine {turbine:.2}, output {output:.2}, \
         wheel {wheel:.2}\n\
         in single precision: within {} of double precision at {} of the samples, at most {}; RMS error {:+.2} %; \
         {} restarts",
        filter.observer,
        coverage(all.inside_fraction()),
        coverage(*minimum),
        all.nees(),
        quantity(1.0, "kPa", 0),
        coverage(all.same_fraction()),
        quantity(1e-3 * all.largest_pa, "kPa", 2),
        100.0 * all.excess_in_single(),
        all.restarts,
    )
}

fn cells(row: &BenchRow) -> Vec<String> {
    let cell =
        |torque: f64, inertia: f64| format!("{} / {}", number(units::mpa(torque), 3), number(units::mpa(inertia), 3));
    let scores = row.cells.iter().map(|c| {
        if row.completed { cell(c.torque_phase_rms_pa, c.inertia_phase_rms_pa) } else { "no shift".to_owned() }
    });
    std::iter::once(row.scenario.clone()).chain(scores).collect()
}
