//! Estimates as columns of a table.

use observer::Estimate;
use trace::{Cell, ColumnKind, Trace, signal};

/// A column of numbers: its name, and its value where there is one.
type Number = (&'static str, fn(&Estimate<f64>) -> Option<f64>);

const ALWAYS: [Number; 2] =
    [(signal::PRESSURE_ESTIMATE, |e| Some(e.pressure_pa)), (signal::TORQUE_ESTIMATE, |e| Some(e.clutch_torque_n_m))];
const SHAFT: [Number; 1] = [(signal::SHAFT_ESTIMATE, |e| e.shaft_torque_n_m)];
const RANGE: [Number; 4] = [
    (signal::PRESSURE_MIN, |e| Some(e.bounds?.pressure_pa[0])),
    (signal::PRESSURE_MAX, |e| Some(e.bounds?.pressure_pa[1])),
    (signal::TORQUE_MIN, |e| Some(e.bounds?.clutch_torque_n_m[0])),
    (signal::TORQUE_MAX, |e| Some(e.bounds?.clutch_torque_n_m[1])),
];
const SHAFT_RANGE: [Number; 2] = [
    (signal::SHAFT_MIN, |e| Some(e.bounds?.shaft_torque_n_m?[0])),
    (signal::SHAFT_MAX, |e| Some(e.bounds?.shaft_torque_n_m?[1])),
];

/// Which columns estimates have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EstimateColumns {
    /// Whether the observer estimates the drive-shaft torque.
    pub shaft: bool,
    /// Whether there are guaranteed ranges.
    pub range: bool,
    /// Whether there is one of the drive-shaft torque.
    pub shaft_range: bool,
}

impl EstimateColumns {
    /// Those that any of these estimates fills.
    pub fn of(estimates: &[Estimate<f64>]) -> Self {
        let filled = |column: &Number| estimates.iter().any(|estimate| column.1(estimate).is_some());
        Self { shaft: filled(&SHAFT[0]), range: filled(&RANGE[0]), shaft_range: filled(&SHAFT_RANGE[0]) }
    }

    fn numbers(self) -> impl Iterator<Item = &'static Number> {
        let or_none = |there: bool, columns: &'static [Number]| if there { columns } else { &[] };
        (ALWAYS.iter())
            .chain(or_none(self.shaft, &SHAFT))
            .chain(or_none(self.range, &RANGE))
            .chain(or_none(self.shaft_range, &SHAFT_RANGE))
    }

    /// The columns, without the time.
    pub fn columns(self) -> Vec<OutputColumn> {
        let numbers = self.numbers().map(|&(name, value)| OutputColumn { name, content: Content::Number(value) });
        let words = [(signal::PHASE, Content::Phase), (signal::HEALTH, Content::Health)].into_iter();
        let readings = signal::READINGS.into_iter().enumerate().map(|(at, name)| (name, Content::Reading(at)));
        numbers.chain(words.chain(readings).map(|(name, content)| OutputColumn { name, content })).collect()
    }
}

/// A column of a table of estimates.
#[derive(Debug, Clone, Copy)]
pub struct OutputColumn {
    /// Its name.
    pub name: &'static str,
    content: Content,
}

#[derive(Debug, Clone, Copy)]
enum Content {
    Number(fn(&Estimate<f64>) -> Option<f64>),
    Phase,
    Health,
    /// What became of the reading of a channel, by its place in [`signal::READINGS`].
    Reading(usize),
}

impl OutputColumn {
    /// Numbers or words.
    #[inline]
    pub fn kind(&self) -> ColumnKind {
        if matches!(self.content, Content::Number(_)) { ColumnKind::Number } else { ColumnKind::Word }
    }

    /// The number that an estimate writes into it, NaN where it has none; none in a column of words.
    #[inline]
    pub fn number(&self, estimate: &Estimate<f64>) -> Option<f64> {
        match self.content {
            Content::Number(value) => Some(value(estimate).unwrap_or(f64::NAN)),
            Content::Phase | Content::Health | Content::Reading(_) => None,
        }
    }

    /// What an estimate writes into it.
    #[inline]
    pub fn cell(&self, estimate: &Estimate<f64>) -> Cell<'static> {
        match self.content {
            Content::Number(value) => Cell::Number(value(estimate).unwrap_or(f64::NAN)),
            Content::Phase => Cell::Word(estimate.phase.name()),
            Content::Health => Cell::Word(estimate.health.name()),
            Content::Reading(at) => Cell::Word(estimate.channels.each()[at].name()),
        }
    }
}

/// Estimates as a trace of their own.
pub fn estimates_trace(time_s: &[f64], estimates: &[Estimate<f64>]) -> Trace {
    let mut trace = Trace { path: None, time_s: time_s.to_vec(), columns: Vec::new() };
    for (name, value) in EstimateColumns::of(estimates).numbers() {
        trace.add(name, estimates.iter().map(|estimate| value(estimate).unwrap_or(f64::NAN)).collect());
    }
    trace.add_words(signal::PHASE, estimates.iter().map(|e| e.phase.name().into()).collect());
    trace.add_words(signal::HEALTH, estimates.iter().map(|e| e.health.name().into()).collect());
    for (at, name) in signal::READINGS.into_iter().enumerate() {
        trace.add_words(name, estimates.iter().map(|e| e.channels.each()[at].name().into()).collect());
    }
    trace
}
