//! The page of `wetclutch bench`: errors of all scenarios, the ranking, every scenario.

use config::{ExperimentFile, VehicleFile};
use observer::Phase;
use report::figure::{Axis, Figure, Panel, Series};
use report::palette::observer_strokes;
use report::sheet::{Content, Part, Sheet};
use report::tables::{capital, coverage, number, phase_name};
use study::Bench;
use study::bench::{BenchCell, BenchConsistency, BenchSummary};
use study::campaign::PHASES;
use trace::quantity;
use trace::units::mpa;

/// The page of a bench of this experiment on this vehicle.
pub(super) fn sheet<'a>(bench: &Bench, vehicle: &'a VehicleFile, experiment: &'a ExperimentFile) -> Sheet<'a> {
    let seed = experiment.sensors.map_or(String::new(), |sensors| format!(" \u{b7} seed {}", sensors.seed));
    let mut parts = vec![part(
        "Errors",
        Content::Figure(errors(bench, experiment)),
        "RMS error of the pressure in each scenario, by its number in the tables below.",
    )];
    if !bench.ranking.is_empty() {
        parts.push(part(
            "Ranking",
            ranking(&bench.ranking),
            "Observers are ranked by the first column. Shift, torque phase, inertia phase: RMS error of the pressure over that of the open loop in the same scenario; a ratio \
             below 1 is better than the open loop, which is the valve model alone. Worst: the largest over the scenarios. Chatter: variation of the estimate beyond that of the true pressure. Contains \
             the truth: the lowest fraction, over scenarios and phases, of the samples at which pressure and clutch torque lay within their guaranteed ranges. Relative width: mean width of the range \
             of the pressure, divided by the width that would contain 95 % of normally distributed errors with the observer\u{2019}s RMS error over all scenarios. Time of a step: on the machine that \
             made this page.",
        ));
    }
    if let Some(filter) = &bench.consistency {
        parts.push(part(
            &format!("Consistency of {}", filter.observer),
            consistency(filter),
            "Over torque and inertia phase of one sample of the noise in each scenario. With a mean square over variance of 1 the stated variances are right; below 1 they are too \
             large, because an error budget is wider than any one car.",
        ));
    }
    parts.extend(PHASES.into_iter().map(|phase| {
        let heading = format!("Scenarios, {}", phase_name(phase));
        part(
            &heading,
            scenarios(bench, phase),
            "RMS error of the pressure in MPa; * marks the lowest of each scenario.",
        )
    }));
    Sheet {
        name: &experiment.title,
        title: "bench",
        lead: format!("{} \u{b7} {} scenarios{seed}", vehicle.name, bench.rows.len()),
        sentences: sentences(bench),
        parts,
        sources: vec![&vehicle.source, &experiment.source],
    }
}

fn part(heading: &str, content: Content, caption: &str) -> Part {
    Part { heading: Some(capital(heading)), content, caption: caption.to_owned() }
}

fn rms_pa(cell: &BenchCell, phase: Phase) -> f64 {
    match phase {
        Phase::InertiaPhase => cell.inertia_phase_rms_pa,
        _ => cell.torque_phase_rms_pa,
    }
}

/// The errors of all observers over the scenarios.
fn errors(bench: &Bench, experiment: &ExperimentFile) -> Figure {
    /// What the axis holds, in medians of all errors: a diverged estimate has any error.
    const REACH: f64 = 6.0;
    let names = experiment.observers.iter().map(|entry| &entry.name);
    let strokes: Vec<_> = names.zip(observer_strokes(experiment.observers.iter())).collect();
    let completed = || bench.rows.iter().enumerate().filter(|(_, row)| row.completed);
    let panels = PHASES.into_iter().map(|phase| {
        let series = strokes.iter().map(|(name, stroke)| Series {
            label: (*name).clone(),
            stroke: *stroke,
            points: completed()
                .filter_map(|(at, row)| {
                    let cell = row.cells.iter().find(|cell| cell.observer == **name)?;
                    Some((at as f64 + 1.0, mpa(rms_pa(cell, phase)))).filter(|(_, rms)| rms.is_finite())
                })
                .collect(),
        });
        let series: Vec<Series> = series.collect();
        let mut values: Vec<f64> = series.iter().flat_map(|series| &series.points).map(|(_, rms)| *rms).collect();
        values.sort_by(f64::total_cmp);
        let axis = values.get(values.len() / 2).map_or(Axis::All, |median| Axis::Within(0.0, REACH * median));
        let y_label = format!("{}, RMS error (MPa)", phase_name(phase));
        Panel { y_label, height: 190.0, series, bands: Vec::new(), axis }
    });
    Figure {
        x_label: "number of the scenario".into(),
        x_range: (1.0, (bench.rows.len() as f64).max(2.0)),
        spans: Vec::new(),
        panels: panels.collect(),
    }
}

fn ranking(ranking: &[BenchSummary]) -> Content {
    let titles = [
        "observer",
        "shift, median",
        "torque phase, median",
        "worst",
        "inertia phase, median",
        "worst",
        "chatter, median MPa",
        "shaft torque, median N m",
        "worst N m",
        "contains the truth",
        "relative width",
        "step ns",
        "with range ns",
    ];
    let optional = |value: Option<f64>, decimals| number(value.unwrap_or(f64::NAN), decimals);
    let row = |s: &BenchSummary| {
        vec![
            s.observer.clone(),
            number(s.shift_median_ratio, 2),
            number(s.torque_phase_median_ratio, 2),
            number(s.torque_phase_worst_ratio, 2),
            number(s.inertia_phase_median_ratio, 2),
            number(s.inertia_phase_worst_ratio, 2),
            number(mpa(s.chatter_median_pa), 3),
            optional(s.shaft_median_rms_n_m, 0),
            optional(s.shaft_worst_rms_n_m, 0),
            s.range_least_coverage.map_or_else(|| "\u{2013}".to_owned(), coverage),
            optional(s.range_over_errors, 1),
            number(s.step_ns, 0),
            number(s.step_with_range_ns, 0),
        ]
    };
    Content::Table(titles.map(str::to_owned).to_vec(), ranking.iter().map(row).collect())
}

/// How sure the filter is.
fn consistency(filter: &BenchConsistency) -> Content {
    let (all, (scenario, minimum)) = (&filter.all, &filter.minimum);
    let [turbine, output, wheel] = all.nis().map(|value| number(value, 2));
    let titles = [
        "true pressure in its own 95 % band".to_owned(),
        format!("lowest, in {scenario}"),
        "error of the pressure, mean square over variance".to_owned(),
        "innovations of turbine, mean square over variance".to_owned(),
        "output".to_owned(),
        "wheel".to_owned(),
    ];
    let row = vec![coverage(all.inside_fraction()), coverage(*minimum), number(all.nees(), 2), turbine, output, wheel];
    Content::Table(titles.to_vec(), vec![row])
}

/// The errors of all observers in a phase, scenario by scenario.
fn scenarios(bench: &Bench, phase: Phase) -> Content {
    let observers = bench.rows.iter().take(1).flat_map(|row| row.cells.iter().map(|cell| cell.observer.clone()));
    let titles = ["#", "scenario"].map(str::to_owned).into_iter().chain(observers);
    let rows = bench.rows.iter().enumerate().map(|(at, row)| {
        let lowest = row.cells.iter().map(|cell| rms_pa(cell, phase)).fold(f64::INFINITY, f64::min);
        let cells = row.cells.iter().map(|cell| {
            let rms = rms_pa(cell, phase);
            let mark = if !cell.diverged && rms <= lowest { " *" } else { "" };
            if row.completed { format!("{}{mark}", number(mpa(rms), 3)) } else { "no shift".to_owned() }
        });
        [(at + 1).to_string(), row.scenario.clone()].into_iter().chain(cells).collect()
    });
    Content::Table(titles.collect(), rows.collect())
}

fn sentences(bench: &Bench) -> Vec<String> {
    let mut sentences = Vec::new();
    if bench.ranking.is_empty() {
        sentences.push("There is no ranking, because no scenario has a completed shift.".to_owned());
    }
    let diverged = bench.ranking.iter().filter(|s| s.diverged > 0);
    sentences.extend(diverged.map(|s| {
        format!("The estimate of {} diverged in {} scenarios. These count as infinite errors.", s.observer, s.diverged)
    }));
    let widths = bench.ranking.first().and_then(|s| {
        Some([
            quantity(mpa(s.range_median_width_pa?), "MPa", 3),
            quantity(s.torque_range_median_width_n_m?, "N m", 0),
            quantity(s.shaft_range_median_width_n_m?, "N m", 0),
        ])
    });
    sentences.extend(widths.map(|[pressure, torque, shaft]| {
        format!(
            "The guaranteed range of pressure and clutch torque and the expected range of the shaft torque follow from the command, the speeds and the error budget. They are the same for every \
             observer. The median width is {pressure} of pressure, {torque} of clutch torque and {shaft} of shaft torque."
        )
    }));
    sentences.extend(bench.consistency.as_ref().map(|filter| {
        let all = &filter.all;
        format!(
            "In single precision the pressure of {} is within {} of that in double precision at {} of the samples, after the shift too, and differs by {} at most; the RMS error \
             changes by {} %; it restarted {} times where double precision did not.",
            filter.observer,
            quantity(1.0, "kPa", 0),
            coverage(all.same_fraction()),
            quantity(1e-3 * all.largest_pa, "kPa", 2),
            number(100.0 * all.excess_in_single(), 2),
            all.restarts,
        )
    }));
    sentences
}

#[cfg(test)]
mod tests {
    use study::bench::BenchRow;

    use super::*;

    #[test]
    fn the_page_has_a_column_for_each_observer_even_without_a_ranking() {
        let (vehicle, experiment) = (VehicleFile::built_in().unwrap(), ExperimentFile::bench().unwrap());
        let cell = |name: &str| BenchCell {
            observer: name.to_owned(),
            torque_phase_rms_pa: 1e4,
            inertia_phase_rms_pa: f64::NAN,
            shift_rms_pa: 1e4,
            chatter_pa: 0.0,
            diverged: false,
            shaft_rms_n_m: None,
            range_coverage: None,
            shaft_range_coverage: None,
            range_width_pa: None,
            torque_range_width_n_m: None,
            shaft_range_width_n_m: None,
        };
        let row = |name: &str, completed| BenchRow {
            scenario: name.to_owned(),
            completed,
            cells: vec![cell("first"), cell("second")],
        };
        let bench =
            Bench { rows: vec![row("nominal", true), row("stalled", false)], ranking: Vec::new(), consistency: None };
        let html = sheet(&bench, &vehicle, &experiment).html().unwrap();
        let shown = html.split("<main>").nth(1).unwrap().split("</main>").next().unwrap();
        assert!(shown.contains("<th scope=\"col\">first</th><th scope=\"col\">second</th>"));
        assert!(shown.contains("<td>0.010 *</td>") && shown.contains("<td>no shift</td>"));
        assert!(shown.contains("There is no ranking") && !shown.contains("NaN"), "{shown}");
    }
}
