//! Where the time of a run of a study goes.

use std::fmt::Write as _;
use std::hint::black_box;
use std::time::Instant;

use plant::{Powertrain, Simulation};
use study::campaign::{factor_values, run_seed, scored_shift};
use study::comparison::observers;
use study::observers::ranges;
use study::sampling::through_sensors;
use study::{Campaign, RunColumns};
use trace::Trace;

use crate::bars::{self, Bar};
use crate::shared::SAMPLE_TIME_S;
use crate::{Figure, time};

/// The parts of a run in their order.
const STAGES: [&str; 7] = [
    "files with the factors in place",
    "launch until the record begins",
    "shift, its record and its rating",
    "sensors",
    "ranges, once for all observers",
    "observers",
    "scores and the rest",
];

/// Runs whose stages are timed.
const RUNS: u64 = 200;
/// Passes; each stage counts with its fastest.
const PASSES: usize = 5;

/// The stages of a run, each made by itself, with their fractions of the whole.
pub(crate) fn of_a_run(page: &mut String, campaign: &Campaign) -> Figure {
    let mut best = [f64::INFINITY; STAGES.len()];
    for _ in 0..PASSES {
        let pass = timed(campaign);
        for (best, seconds) in best.iter_mut().zip(pass) {
            *best = best.min(seconds);
        }
    }
    // The shift was simulated with its launch, and the last is the whole run: differences of the fastest times.
    best[2] = (best[2] - best[1]).max(0.0);
    let others: f64 = best[..6].iter().sum();
    best[6] = (best[6] - others).max(0.0);
    let whole: f64 = best.iter().sum();
    let _ = write!(
        page,
        "\n### Stages of a run\n\nObservers: {}. Each stage by itself, over {RUNS} runs.\n\n\
         ![Time of each stage of a run](../figures/stages.svg)\n\n| stage | time per run | share |\n|---|---|---|\n",
        campaign.layout.observers.join(", ")
    );
    for (name, seconds) in STAGES.iter().zip(best) {
        let _ = writeln!(page, "| {name} | {} | {:.0} % |", time(seconds), 100.0 * seconds / whole);
    }
    let bar = |(name, seconds): (&&str, f64)| Bar { label: (*name).to_owned(), parts: vec![1e6 * seconds] };
    let bars: Vec<Bar> = STAGES.iter().zip(best).map(bar).collect();
    ("stages.svg", bars::svg("time per run, µs", &[], &bars))
}

/// Mean times of the stages, s: the shift with its launch, and in the last place the whole run.
fn timed(campaign: &Campaign) -> [f64; STAGES.len()] {
    let study = &campaign.study;
    let mut sums = [0.0; STAGES.len()];
    let ready = observers(&study.vehicle, &study.experiment).unwrap();
    let mut spare = Trace::default();
    for run in 0..RUNS {
        let mut clock = Instant::now();
        let mut stage = |at: usize| {
            sums[at] += clock.elapsed().as_secs_f64();
            clock = Instant::now();
        };
        let mut varied = study.varied(&factor_values(study, run)).unwrap();
        stage(0);
        let experiment = &mut varied.experiment;
        experiment.adapt_controller();
        let mut sensors = experiment.sensors.unwrap();
        sensors.seed = run_seed(study, run);
        let begin_s = experiment.shift.request_s - study.record_before_s;
        let powertrain = Powertrain::new(experiment.simulated_vehicle(&varied.car));
        let mut launch = Simulation::new(&powertrain, &varied.vehicle, experiment).unwrap();
        // A study records nothing of it.
        launch.record_from(begin_s);
        launch.advance_to(begin_s, |_| {}).unwrap();
        stage(1);
        let (car, vehicle) = (&varied.car, &varied.vehicle);
        let shift = scored_shift(std::mem::take(&mut spare), car, vehicle, experiment, study.record_before_s).unwrap();
        stage(2);
        let seen = through_sensors(&shift.trace, SAMPLE_TIME_S, &sensors, vehicle);
        stage(3);
        let columns = RunColumns::of(&seen, vehicle).unwrap();
        black_box(ranges(vehicle, &columns));
        stage(4);
        for observer in &ready {
            black_box(observer.run_alone(&columns));
        }
        stage(5);
        black_box(campaign.row(run).unwrap());
        stage(6);
        spare = shift.trace;
    }
    sums.map(|sum| sum / RUNS as f64)
}
