//! Studies: runs per second, and how much a second thread helps.

use std::fmt::Write as _;
use std::hint::black_box;
use std::time::Instant;

use study::{Campaign, StudyError, execute};

use crate::shared::{THREE, campaign};
use crate::{Figure, LONG, fastest, one, stages, threads, time};

fn make(campaign: &Campaign, threads: usize) {
    execute::<StudyError>(campaign, 0..campaign.study.runs, threads, |row| {
        black_box(row);
        Ok(())
    })
    .unwrap();
}

fn seconds(job: impl FnOnce()) -> f64 {
    let began = Instant::now();
    job();
    began.elapsed().as_secs_f64()
}

/// Studies of several sizes, how much a second thread helps, and the stages of a run with their figure.
pub(crate) fn studies(page: &mut String) -> Figure {
    page.push_str(
        "\n## Studies\n\nRuns of `experiments/settings.toml`: files checked with the factors in place, launch, shift, sensors, observers, \
         scores.\n\n| runs | observers | threads | time | runs per second |\n|---|---|---|---|---|\n",
    );
    let mut row = |campaign: &Campaign, threads: usize, seconds: f64| {
        let (runs, rate) = (campaign.study.runs, campaign.study.runs as f64 / seconds);
        let names = campaign.layout.observers.join(", ");
        let _ = writeln!(page, "| {runs} | {names} | {threads} | {} | {rate:.0} |", time(seconds));
    };
    let small = [
        campaign(500, |name| name == "open loop"),
        campaign(500, |name| name == "Kalman"),
        campaign(500, |name| THREE.contains(&name)),
        campaign(500, |_| true),
    ];
    let mut jobs: Vec<Box<dyn FnMut() + '_>> = Vec::new();
    for campaign in &small {
        jobs.push(Box::new(|| make(campaign, 1)));
    }
    let times = fastest(3 * LONG, &mut jobs);
    drop(jobs);
    for (campaign, seconds) in small.iter().zip(times) {
        row(campaign, 1, seconds);
    }
    let most = threads();
    let long = campaign(10_000, |name| THREE.contains(&name));
    row(&long, most, one(|| make(&long, most)));
    page.push_str("\nThe aim is 10,000 runs with three observers in 10 s on two cores.\n");
    page.push_str(&speed_up(&small[3]));
    stages::of_a_run(page, &small[2])
}

/// Pairs of which each gives a ratio.
const PAIRS: usize = 9;

/// How much faster two threads are than one, in a sentence.
fn speed_up(campaign: &Campaign) -> String {
    const THREADS: usize = 2;
    let mut ratios: Vec<f64> = (0..PAIRS)
        .map(|_| {
            // In this order a steady change of the machine's speed cancels.
            let [a, b, c, d] = [1, THREADS, THREADS, 1].map(|threads| seconds(|| make(campaign, threads)));
            (a + d) / (b + c)
        })
        .collect();
    ratios.sort_by(f64::total_cmp);
    let most = THREADS as f64;
    // Two threads cannot be more than twice as fast: what is beyond is noise.
    let beyond = ratios.iter().filter(|ratio| **ratio > most).count();
    let [minimum, median, maximum] = [ratios[0], ratios[PAIRS / 2], ratios[PAIRS - 1]].map(|ratio| ratio.min(most));
    let noise = if beyond > 0 { format!("; {beyond} of them above {most}, which is noise") } else { String::new() };
    format!(
        "\nTwo threads are {median:.2} times as fast as one: the median of {PAIRS} ratios measured in turns, from {minimum:.2} to \
         {maximum:.2}{noise}\n({} runs; aim 1.8).\n",
        campaign.study.runs,
    )
}
