//! The table of the estimates of one observer.

use observer::{ChannelHealth, Channels, Estimate, Health, Phase};
use study::{EstimateColumns, OutputColumn};
use trace::{Cell, ColumnKind};

use crate::estimate::output::{Destination, Output};
use crate::{Error, Table};

/// The columns of these names, or all.
pub(crate) fn chosen(columns: EstimateColumns, names: &[String]) -> Result<Vec<OutputColumn>, Error> {
    let all = columns.columns();
    if names.is_empty() {
        return Ok(all);
    }
    let mut chosen: Vec<OutputColumn> = Vec::new();
    for name in names.iter().map(|name| name.trim()).filter(|name| *name != trace::signal::TIME) {
        let Some(column) = all.iter().find(|column| column.name == name) else {
            let known: Vec<&str> = all.iter().map(|column| column.name).collect();
            return Err(Error::Input(format!(
                "--columns: there is no column `{}` with this observer\nhint: the columns are {}; time_s is always there",
                name.escape_debug(),
                known.join(", ")
            )));
        };
        if chosen.iter().any(|earlier| earlier.name == name) {
            return Err(Error::Input(format!("--columns: `{name}` is there twice\nhint: name each column once")));
        }
        chosen.push(*column);
    }
    Ok(chosen)
}

/// The table of the estimates of one observer.
pub(crate) struct EstimateTable {
    output: Output,
    columns: Vec<OutputColumn>,
    /// Whether all columns of numbers stand before all columns of words, of which there are some.
    is_in_order: bool,
    /// The numbers of a row.
    numbers: Vec<f64>,
    /// What the words of the row before say: they are mostly the same.
    said: Option<(Phase, Health, Channels<ChannelHealth>)>,
}

impl EstimateTable {
    /// Begins it.
    pub(crate) fn create(destination: Destination<'_>, columns: Vec<OutputColumn>) -> Result<Self, Error> {
        let output = Output::named(destination, columns.iter().map(|column| (column.name, column.kind())))?;
        let is_word = |column: &OutputColumn| column.kind() == ColumnKind::Word;
        let is_in_order = columns.is_sorted_by_key(is_word) && columns.last().is_some_and(is_word);
        Ok(Self { output, columns, is_in_order, numbers: Vec::new(), said: None })
    }

    pub(crate) fn row(&mut self, time_s: f64, estimate: &Estimate<f64>) -> Result<(), Error> {
        let says = Some((estimate.phase, estimate.health, estimate.channels));
        let is_same = std::mem::replace(&mut self.said, says) == says;
        if is_same && self.is_in_order {
            self.numbers.clear();
            self.numbers.extend(self.columns.iter().map_while(|column| column.number(estimate)));
            return self.output.numbers(time_s, &self.numbers);
        }
        let cells = self.columns.iter().map(|column| match column.kind() {
            ColumnKind::Word if is_same => Cell::SameWord,
            _ => column.cell(estimate),
        });
        self.output.cells(time_s, cells)
    }

    /// A row without an estimate.
    pub(crate) fn empty_row(&mut self, time_s: f64) -> Result<(), Error> {
        self.said = None;
        let cells = self.columns.iter().map(|column| match column.kind() {
            ColumnKind::Word => Cell::Word(""),
            ColumnKind::Number | ColumnKind::Whole => Cell::Number(f64::NAN),
        });
        self.output.cells(time_s, cells)
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
