//! `wetclutch bench`.

use config::{Experiment, Vehicle};
use report::bench_page;
use study::bench::BenchRow;
use trace::units;

use crate::args::Bench;
use crate::commands::{progress, write_text};
use crate::failure::Failure;
use crate::output;

pub(crate) fn bench(options: &Bench) -> Result<(), Failure> {
    let (vehicle, experiment) = match &options.experiment {
        Some(path) => {
            let experiment = Experiment::read(path)?;
            (Vehicle::read(&experiment.vehicle_path())?, experiment)
        }
        None => (Vehicle::two_speed_at()?, Experiment::bench()?),
    };
    let all = experiment.scenarios.len();
    if all == 0 {
        let path = experiment.source.path.display();
        return Err(Failure::Input(format!(
            "{path}: there is no [[scenario]] to run\nhint: see experiments/bench.toml"
        )));
    }
    output::note(&format!("running {} observers on {all} scenarios", experiment.observers.len()));
    let bar = progress(all as u64, 0);
    let result = study::bench(&vehicle, &experiment, |_| bar.inc(1))?;
    bar.finish_and_clear();
    if let Some(folder) = &options.output {
        write_text(&folder.join("bench.html"), &bench_page(&result, &vehicle, &experiment)?)?;
    }
    if options.json {
        output::line(&serde_json::to_string_pretty(&result)?)?;
        return Ok(());
    }

    output::line("RMS error of the pressure, MPa: torque phase / inertia phase\n")?;
    let names = result.ranking.iter().map(|s| s.observer.clone());
    let mut rows = vec![std::iter::once("scenario".to_owned()).chain(names).collect()];
    rows.extend(result.rows.iter().map(cells));
    output::table(1, &rows)?;

    output::line("\nover the open loop's; ranked by the median over the whole shift\n")?;
    let head = [
        "observer",
        "shift",
        "torque phase",
        "worst",
        "inertia phase",
        "worst",
        "chatter MPa",
        "shaft N m",
        "worst",
        "step ns",
    ];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    rows.extend(result.ranking.iter().map(|s| {
        let ratio = |value: f64| format!("{value:.2}");
        let torque = |value: Option<f64>| value.map_or_else(String::new, |n_m| format!("{n_m:.0}"));
        vec![
            s.observer.clone(),
            ratio(s.shift_median_ratio),
            ratio(s.torque_phase_median_ratio),
            ratio(s.torque_phase_worst_ratio),
            ratio(s.inertia_phase_median_ratio),
            ratio(s.inertia_phase_worst_ratio),
            format!("{:.3}", units::mpa(s.chatter_median_pa)),
            torque(s.shaft_median_rms_n_m),
            torque(s.shaft_worst_rms_n_m),
            format!("{:.0}", s.step_ns),
        ]
    }));
    output::table(1, &rows)?;

    if let Some(first) = result.ranking.first().filter(|s| s.range_least_coverage.is_some()) {
        let width = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |n_m| format!("{n_m:.0} N m"));
        output::line(&format!(
            "\nguaranteed range, the same around every observer: holds at {:.1} % of the samples\n\
             median width: pressure {:.3} MPa, clutch torque {}, shaft torque {}\n\
             mean width over the width that holds 95 % of {}'s errors on this bench: {:.1}; the range adds {:.0} ns to a step",
            100.0 * first.range_least_coverage.unwrap_or(f64::NAN),
            units::mpa(first.range_median_width_pa.unwrap_or(f64::NAN)),
            width(first.torque_range_median_width_n_m),
            width(first.shaft_range_median_width_n_m),
            first.observer,
            first.range_over_errors.unwrap_or(f64::NAN),
            first.step_with_range_ns - first.step_ns,
        ))?;
    }
    let missing: Vec<&str> = result.rows.iter().filter(|row| !row.completed).map(|row| row.scenario.as_str()).collect();
    if !missing.is_empty() {
        output::note(&format!("not completed within the simulated time, and not ranked: {}", missing.join(", ")));
    }
    if let Some(folder) = &options.output {
        output::line(&format!("\npage: {}", folder.join("bench.html").display()))?;
    }
    Ok(())
}

fn cells(row: &BenchRow) -> Vec<String> {
    let cell = |torque: f64, inertia: f64| format!("{:.3} / {:.3}", units::mpa(torque), units::mpa(inertia));
    let scores = row.cells.iter().map(|c| {
        if row.completed { cell(c.torque_phase_rms_pa, c.inertia_phase_rms_pa) } else { "no shift".to_owned() }
    });
    std::iter::once(row.scenario.clone()).chain(scores).collect()
}
