//! The table of the estimates of one observer.

use drivetrain::CommandKind;
use observer::{ChannelHealth, Channels, Estimate, Health, Input, Phase, Reading};
use study::{EstimateColumns, LogSample, OutputColumn};
use trace::{Cell, ColumnKind, signal};

use crate::estimate::no_column::no_column;
use crate::estimate::output::{Destination, Output};
use crate::{Error, Table};

/// A measured channel: its column, and its reading in a step.
type Channel = (&'static str, fn(&Input<f64>) -> Option<Reading<f64>>);

/// The speeds and the torque that an estimate may have too.
const MEASURED: [Channel; 5] = [
    (signal::ENGINE_SPEED, |input| input.engine_rad_s),
    (signal::TURBINE_SPEED, |input| input.turbine_rad_s),
    (signal::OUTPUT_SPEED, |input| input.output_rad_s),
    (signal::WHEEL_SPEED, |input| input.wheel_rad_s),
    (signal::REPORTED_ENGINE_TORQUE, |input| input.engine_torque_n_m),
];

/// The commands of both clutches, by what their valves are commanded with.
fn commands(kind: CommandKind) -> [Channel; 2] {
    let [oncoming, offgoing] = match kind {
        CommandKind::Current => [signal::ONCOMING_CURRENT, signal::OFFGOING_CURRENT],
        CommandKind::DutyCycle => [signal::ONCOMING_DUTY, signal::OFFGOING_DUTY],
    };
    [(oncoming, |input| input.command), (offgoing, |input| input.offgoing_command)]
}

/// A column of the table.
#[derive(Clone, Copy)]
pub(crate) enum Column {
    /// What the observer gives.
    Estimated(OutputColumn),
    /// A reading as it came.
    Measured(Channel),
}

impl Column {
    fn name(&self) -> &'static str {
        match self {
            Self::Estimated(column) => column.name,
            Self::Measured((name, _)) => name,
        }
    }

    fn kind(&self) -> ColumnKind {
        match self {
            Self::Estimated(column) => column.kind(),
            Self::Measured(_) => ColumnKind::Number,
        }
    }

    /// The number of a step, NaN where there is none; none in a column of words.
    fn number(&self, input: &Input<f64>, estimate: &Estimate<f64>) -> Option<f64> {
        match self {
            Self::Estimated(column) => column.number(estimate),
            Self::Measured((_, reading)) => Some(reading(input).map_or(f64::NAN, |reading| reading.value)),
        }
    }

    fn cell(&self, input: &Input<f64>, estimate: &Estimate<f64>) -> Cell<'static> {
        match self {
            Self::Estimated(column) => column.cell(estimate),
            Self::Measured(_) => Cell::Number(self.number(input, estimate).unwrap_or(f64::NAN)),
        }
    }
}

/// The columns of these names, also those of readings. Without names all, those of readings only with `with_measured`.
pub(crate) fn chosen(
    estimates: EstimateColumns,
    valve: CommandKind,
    (names, with_measured): (&[String], bool),
) -> Result<Vec<Column>, Error> {
    let estimated = estimates.columns().into_iter().map(Column::Estimated);
    if names.is_empty() && !with_measured {
        return Ok(estimated.collect());
    }
    let measured = MEASURED.into_iter().chain(commands(valve)).map(Column::Measured);
    let mut all: Vec<Column> = estimated.chain(measured).collect();
    if names.is_empty() {
        return Ok(all);
    }
    let mut chosen = Vec::new();
    for name in names.iter().map(|name| name.trim()).filter(|name| *name != signal::TIME) {
        let Some(at) = all.iter().position(|column| column.name() == name) else {
            let known: Vec<&str> = all.iter().map(Column::name).collect();
            return Err(no_column(name, &known, chosen.iter().any(|column: &Column| column.name() == name)));
        };
        chosen.push(all.remove(at));
    }
    Ok(chosen)
}

/// The table of the estimates of one observer.
pub(crate) struct EstimateTable<'p> {
    output: Output<'p>,
    columns: Vec<Column>,
    /// Whether all columns of numbers stand before all columns of words, of which there are some.
    is_in_order: bool,
    /// The numbers of a row.
    numbers: Vec<f64>,
    /// What the words of the row before say, which are mostly the same; none without an estimate.
    said: Option<(Phase, Health, Channels<ChannelHealth>)>,
}

impl<'p> EstimateTable<'p> {
    /// Begins it.
    pub(crate) fn create(destination: Destination<'p>, columns: Vec<Column>) -> Result<Self, Error> {
        let output = Output::named(destination, columns.iter().map(|column| (column.name(), column.kind())))?;
        let is_word = |column: &Column| column.kind() == ColumnKind::Word;
        let is_in_order = columns.is_sorted_by_key(is_word) && columns.last().is_some_and(is_word);
        Ok(Self { output, columns, is_in_order, numbers: Vec::new(), said: None })
    }

    /// Writes the row of a step.
    pub(crate) fn row(&mut self, sample: &LogSample) -> Result<(), Error> {
        let LogSample { time_s, input, estimate, .. } = sample;
        let says = sample.is_estimated().then_some((estimate.phase, estimate.health, estimate.channels));
        let is_same = std::mem::replace(&mut self.said, says) == says && says.is_some();
        if is_same && self.is_in_order {
            self.numbers.clear();
            self.numbers.extend(self.columns.iter().map_while(|column| column.number(input, estimate)));
            return self.output.numbers(*time_s, &self.numbers);
        }
        let cells = self.columns.iter().map(|column| match column.kind() {
            ColumnKind::Word if is_same => Cell::SameWord,
            ColumnKind::Word if says.is_none() => Cell::Word(""),
            _ => column.cell(input, estimate),
        });
        self.output.cells(*time_s, cells)
    }

    /// Hands the rows so far to their reader.
    pub(crate) fn flush(&mut self) -> Result<(), Error> {
        self.output.flush()
    }

    /// Completes the table, and returns it if it is in memory.
    pub(crate) fn finish(self) -> Result<Option<Table>, Error> {
        self.output.finish()
    }
}
