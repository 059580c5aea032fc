//! Random commands of a controller, and the log of them.

use super::cars::Car;
use super::{Random, Sampling};

/// A small step of the plants, s. It is below the time constant of the cylinder, so that Euler's steps do not overshoot.
pub(crate) const STEP_S: f64 = 0.25e-3;
/// Largest command, A.
pub(crate) const COMMAND_MAX_A: f64 = 1.2;
/// Length of a run, small steps.
const STEPS: usize = 6400;

/// How a run begins.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Start {
    /// After a long time under this command.
    AtRest { command_a: f64 },
    /// Anywhere.
    Unknown,
}

/// A row of the log.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Row {
    pub(crate) dt_s: f64,
    /// The reading, if it is not missing.
    pub(crate) command_a: Option<f64>,
    /// Age of the reading.
    pub(crate) age_s: f64,
    /// The small step at whose end it is; none before the run.
    pub(crate) step: Option<usize>,
}

/// What the controller sent, and what was logged of it.
#[derive(Debug, Clone)]
pub(crate) struct Log {
    pub(crate) start: Start,
    /// The command in force in each small step.
    pub(crate) sent_a: Vec<f64>,
    pub(crate) rows: Vec<Row>,
}

impl Log {
    pub(crate) fn random(random: &mut Random, car: &Car, sampling: Sampling) -> Self {
        let start = match random.count(0, 3) {
            0 => Start::Unknown,
            1 => Start::AtRest { command_a: car.valve.current_for(random.within([0.2e6, 0.9e6])) },
            _ => Start::AtRest { command_a: 0.0 },
        };
        // Small steps from one tick of the controller to the next: 10 ms, sometimes 50 ms.
        let tick = if random.chance(0.8) { 40 } else { 200 };
        let sent_a = sent(random, car, start, tick);
        let (first, every) = match sampling {
            Sampling::Synchronous | Sampling::Late => (0, tick),
            Sampling::Asynchronous => {
                let every = tick - random.count(1, tick / 3);
                (random.count(1, every), every)
            }
        };
        let mut rows = Vec::new();
        let mut last: Option<usize> = None;
        let (mut at, mut kept) = (first, 0);
        while at < STEPS {
            // A row is lost, or several; what one row hid is between its neighbours.
            let hidden = |n: usize| at + (n + 1) * every < STEPS && n > 0;
            let lose = if kept > 3 && random.chance(0.02) { random.count(1, 8) } else { 0 };
            let between = within(
                sent_a[at.min(STEPS - 1)],
                last.map_or(sent_a[0], |l| sent_a[l]),
                sent_a[(at + every).min(STEPS - 1)],
            );
            if hidden(lose) && (lose > 1 || between) && sampling != Sampling::Asynchronous {
                (at, kept) = (at + lose * every, 0);
            }
            let missing = random.chance(0.01);
            let reading = (sent_a[at] + car.reading_error_a(random)).max(0.0);
            let dt_s = match last {
                Some(last) => (at - last) as f64 * STEP_S,
                None => every as f64 * STEP_S,
            };
            // The pressure at the sample is that before its command acts: at the end of the step before.
            let step = at.checked_sub(1);
            rows.push(Row { dt_s, command_a: (!missing).then_some(reading), age_s: 0.0, step });
            (last, at, kept) = (Some(at), at + every, kept + 1);
        }
        if sampling == Sampling::Late {
            rows = late(random, &rows, every);
        }
        let mut all = rest(start, every as f64 * STEP_S);
        if let (true, Some(first)) = (all.is_empty(), rows.first_mut()) {
            first.dt_s = 0.0;
        }
        all.append(&mut rows);
        Self { start, sent_a, rows: all }
    }
}

/// The same readings, each later by one time, in rows of a rate of their own.
fn late(random: &mut Random, rows: &[Row], every: usize) -> Vec<Row> {
    let (lag, grid) = (random.count(0, 2 * every), random.count(every / 8, every));
    let at = |row: &Row| row.step.map_or(0, |step| step + 1);
    let mut readings = rows.iter().filter(|row| row.command_a.is_some()).peekable();
    (0..STEPS)
        .step_by(grid)
        .map(|now| {
            let reading = readings.next_if(|row| at(row) + lag <= now);
            Row {
                dt_s: if now == 0 { every } else { grid } as f64 * STEP_S,
                command_a: reading.and_then(|row| row.command_a),
                age_s: reading.map_or(0.0, |row| (now - at(row)) as f64 * STEP_S),
                step: now.checked_sub(1),
            }
        })
        .collect()
}

fn within(x: f64, a: f64, b: f64) -> bool {
    a.min(b) <= x && x <= a.max(b)
}

/// Rows of a long rest.
fn rest(start: Start, dt_s: f64) -> Vec<Row> {
    match start {
        Start::Unknown => Vec::new(),
        Start::AtRest { command_a } => {
            vec![Row { dt_s, command_a: Some(command_a), age_s: 0.0, step: None }; (3.0 / dt_s) as usize]
        }
    }
}

/// Fast fills, stroke pressures, ramps, holds, aborts and re-applies.
fn sent(random: &mut Random, car: &Car, start: Start, tick: usize) -> Vec<f64> {
    let mut pressure_pa = match start {
        Start::AtRest { command_a } => car.valve.settled_pressure(command_a),
        Start::Unknown => random.within([0.0, 0.8e6]),
    };
    let mut sent_a = Vec::with_capacity(STEPS);
    let hold = |sent_a: &mut Vec<f64>, pressure_pa: f64| {
        let command = car.valve.current_for(pressure_pa.max(0.0));
        sent_a.extend(std::iter::repeat_n(command, tick));
    };
    while sent_a.len() < STEPS {
        let ticks = |random: &mut Random, max_s: f64| random.count(1, (max_s / (tick as f64 * STEP_S)) as usize);
        match random.count(0, 5) {
            0 => {
                pressure_pa = 0.06e6 + random.within([0.05e6, 0.25e6]);
                (0..ticks(random, 0.3)).for_each(|_| hold(&mut sent_a, pressure_pa));
            }
            1 => {
                pressure_pa = 0.06e6 + random.within([-0.03e6, 0.08e6]);
                (0..ticks(random, 0.3)).for_each(|_| hold(&mut sent_a, pressure_pa));
            }
            2 | 3 => {
                let (from, to, n) = (pressure_pa, random.within([0.1e6, 0.9e6]), ticks(random, 0.4));
                for i in 1..=n {
                    pressure_pa = from + (to - from) * i as f64 / n as f64;
                    hold(&mut sent_a, pressure_pa);
                }
            }
            4 => (0..ticks(random, 0.2)).for_each(|_| hold(&mut sent_a, pressure_pa)),
            _ => {
                pressure_pa = random.within([-0.06e6, 0.06e6]).max(0.0);
                (0..ticks(random, 0.8)).for_each(|_| hold(&mut sent_a, pressure_pa));
            }
        }
    }
    sent_a.truncate(STEPS);
    sent_a
}
