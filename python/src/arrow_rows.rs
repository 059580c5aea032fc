//! Arrow data as the rows of a log, read where they stand.

use std::ops::Range;

use arrow_array::cast::AsArray;
use arrow_array::types::{
    Decimal128Type, Float16Type, Float32Type, Float64Type, Int8Type, Int16Type, Int32Type, Int64Type, UInt8Type,
    UInt16Type, UInt32Type, UInt64Type,
};
use arrow_array::{
    Array, ArrayRef, ArrowPrimitiveType, BooleanArray, LargeStringArray, PrimitiveArray, StringArray, StringViewArray,
};
use arrow_buffer::NullBuffer;
use arrow_schema::{DataType, Field, TimeUnit};
use pyo3::PyErr;
use pyo3::exceptions::PyTypeError;
use wetclutch::{Cell, Codes, Column, Table, TableRows, Values};

/// Columns of Arrow data in batches.
#[derive(Debug)]
pub(crate) struct ArrowRows {
    /// Places of the columns that are read.
    places: Vec<usize>,
    names: Vec<String>,
    /// The others, with their kinds.
    left_out: Vec<String>,
    /// Whether each has words.
    is_words: Vec<bool>,
    /// The columns of each batch.
    batches: Vec<Vec<Cells>>,
    /// The row behind each batch.
    ends: Vec<usize>,
}

impl ArrowRows {
    /// Columns without a batch.
    pub(crate) fn of_fields<'a>(fields: impl Iterator<Item = &'a Field>) -> Self {
        let mut rows = Self {
            places: Vec::new(),
            names: Vec::new(),
            left_out: Vec::new(),
            is_words: Vec::new(),
            batches: Vec::new(),
            ends: Vec::new(),
        };
        for (place, field) in fields.enumerate() {
            let kind = field.data_type();
            if is_words(kind) || is_numbers(kind) {
                rows.places.push(place);
                rows.names.push(field.name().clone());
                rows.is_words.push(is_words(kind));
            } else {
                rows.left_out.push(format!("{} ({kind})", field.name()));
            }
        }
        rows
    }

    /// Columns that are neither of numbers, times nor words, with their kinds.
    pub(crate) fn left_out(&self) -> &[String] {
        &self.left_out
    }

    /// Takes the next batch.
    ///
    /// # Errors
    /// A column is of another kind than its field.
    pub(crate) fn push(&mut self, columns: &[ArrayRef], rows: usize) -> Result<(), PyErr> {
        let cells = self.places.iter().zip(&self.names).map(|(place, name)| {
            let cells = columns.get(*place).and_then(Cells::of);
            cells.ok_or_else(|| PyTypeError::new_err(format!("column `{name}` cannot be read")))
        });
        self.batches.push(cells.collect::<Result<_, _>>()?);
        self.ends.push(self.rows() + rows);
        Ok(())
    }

    /// The same as a table that owns its columns.
    pub(crate) fn to_table(&self) -> Table {
        let column = |at: usize| Column { name: self.names[at].clone(), values: self.values(at) };
        Table { columns: (0..self.names.len()).map(column).collect() }
    }

    fn values(&self, column: usize) -> Values {
        let mut numbers = Vec::new();
        if self.numbers(0..self.rows(), column, &mut numbers) {
            return Values::Numbers(numbers);
        }
        let cells = (0..self.rows()).map(|row| self.cell(row, column));
        Values::Words(cells.map(|cell| if let Cell::Word(word) = cell { word } else { "" }).collect())
    }

    /// The batch of a row, and its first row.
    fn batch_of(&self, row: usize) -> (usize, usize) {
        // Of most tables there is one alone.
        if self.ends.first().is_some_and(|end| row < *end) {
            return (0, 0);
        }
        let batch = self.ends.partition_point(|end| *end <= row);
        (batch, batch.checked_sub(1).map_or(0, |before| self.ends[before]))
    }
}

impl TableRows for ArrowRows {
    fn names(&self) -> Vec<&str> {
        self.names.iter().map(String::as_str).collect()
    }

    fn rows(&self) -> usize {
        self.ends.last().copied().unwrap_or(0)
    }

    fn cell(&self, row: usize, column: usize) -> Cell<'_> {
        let (batch, begin) = self.batch_of(row);
        self.batches[batch][column].get(row - begin)
    }

    fn numbers(&self, rows: Range<usize>, column: usize, numbers: &mut Vec<f64>) -> bool {
        if self.is_words[column] {
            return false;
        }
        let Range { mut start, end } = rows;
        while start < end {
            let (batch, begin) = self.batch_of(start);
            let to = end.min(self.ends[batch]);
            self.batches[batch][column].append(start - begin..to - begin, numbers);
            start = to;
        }
        true
    }
}

fn is_words(kind: &DataType) -> bool {
    match kind {
        DataType::Utf8 | DataType::LargeUtf8 | DataType::Utf8View => true,
        DataType::Dictionary(_, values) => is_words(values),
        _ => false,
    }
}

fn is_numbers(kind: &DataType) -> bool {
    match kind {
        DataType::Boolean
        | DataType::Null
        | DataType::Decimal128(..)
        | DataType::Timestamp(..)
        | DataType::Duration(_) => true,
        DataType::Dictionary(_, values) => is_numbers(values),
        kind => kind.is_integer() || kind.is_floating(),
    }
}

/// The cells of a column in a batch.
#[derive(Debug)]
enum Cells {
    Float64(PrimitiveArray<Float64Type>),
    Float32(PrimitiveArray<Float32Type>),
    Float16(PrimitiveArray<Float16Type>),
    Int8(PrimitiveArray<Int8Type>),
    Int16(PrimitiveArray<Int16Type>),
    Int32(PrimitiveArray<Int32Type>),
    Int64(PrimitiveArray<Int64Type>),
    UInt8(PrimitiveArray<UInt8Type>),
    UInt16(PrimitiveArray<UInt16Type>),
    UInt32(PrimitiveArray<UInt32Type>),
    UInt64(PrimitiveArray<UInt64Type>),
    Boolean(BooleanArray),
    /// Times in ticks, and how many of them make a second.
    Ticks(PrimitiveArray<Int64Type>, f64),
    /// Decimals, and how many of their last digits make one.
    Decimal(PrimitiveArray<Decimal128Type>, f64),
    Null,
    Utf8(StringArray),
    LargeUtf8(LargeStringArray),
    Utf8View(StringViewArray),
    /// Values of a dictionary: the place of each in it, and which there are.
    Dictionary(Codes, Option<NullBuffer>, Box<Cells>),
}

impl Cells {
    /// The cells of an array; none of a kind that has neither numbers, times nor words.
    fn of(array: &ArrayRef) -> Option<Self> {
        Some(match array.data_type() {
            DataType::Float64 => Self::Float64(array.as_primitive_opt()?.clone()),
            DataType::Float32 => Self::Float32(array.as_primitive_opt()?.clone()),
            DataType::Float16 => Self::Float16(array.as_primitive_opt()?.clone()),
            DataType::Int8 => Self::Int8(array.as_primitive_opt()?.clone()),
            DataType::Int16 => Self::Int16(array.as_primitive_opt()?.clone()),
            DataType::Int32 => Self::Int32(array.as_primitive_opt()?.clone()),
            DataType::Int64 => Self::Int64(array.as_primitive_opt()?.clone()),
            DataType::UInt8 => Self::UInt8(array.as_primitive_opt()?.clone()),
            DataType::UInt16 => Self::UInt16(array.as_primitive_opt()?.clone()),
            DataType::UInt32 => Self::UInt32(array.as_primitive_opt()?.clone()),
            DataType::UInt64 => Self::UInt64(array.as_primitive_opt()?.clone()),
            DataType::Boolean => Self::Boolean(array.as_boolean_opt()?.clone()),
            DataType::Timestamp(unit, _) | DataType::Duration(unit) => {
                let ticks = array.to_data().into_builder().data_type(DataType::Int64).build().ok()?;
                Self::Ticks(ticks.into(), ticks_per_s(*unit))
            }
            DataType::Decimal128(_, scale) => {
                Self::Decimal(array.as_primitive_opt()?.clone(), format!("1e{scale}").parse().ok()?)
            }
            DataType::Null => Self::Null,
            DataType::Utf8 => Self::Utf8(array.as_string_opt()?.clone()),
            DataType::LargeUtf8 => Self::LargeUtf8(array.as_string_opt()?.clone()),
            DataType::Utf8View => Self::Utf8View(array.as_string_view_opt()?.clone()),
            DataType::Dictionary(..) => {
                let values = array.as_any_dictionary_opt()?.values();
                Self::Dictionary(places(array), array.nulls().cloned(), Box::new(Self::of(values)?))
            }
            _ => return None,
        })
    }

    /// Appends the numbers of some rows, NaN where there is none.
    fn append(&self, rows: Range<usize>, numbers: &mut Vec<f64>) {
        match self {
            Self::Float64(array) if array.null_count() == 0 => numbers.extend_from_slice(&array.values()[rows]),
            _ => numbers.extend(rows.map(|row| match self.get(row) {
                Cell::Number(number) => number,
                _ => f64::NAN,
            })),
        }
    }

    /// The cell of a row: an empty word or no number where there is none.
    fn get(&self, row: usize) -> Cell<'_> {
        match self {
            Self::Float64(array) => number(array, row, |value| value),
            Self::Float32(array) => number(array, row, f64::from),
            Self::Float16(array) => number(array, row, f64::from),
            Self::Int8(array) => number(array, row, f64::from),
            Self::Int16(array) => number(array, row, f64::from),
            Self::Int32(array) => number(array, row, f64::from),
            Self::Int64(array) => number(array, row, |value| value as f64),
            Self::UInt8(array) => number(array, row, f64::from),
            Self::UInt16(array) => number(array, row, f64::from),
            Self::UInt32(array) => number(array, row, f64::from),
            Self::UInt64(array) => number(array, row, |value| value as f64),
            Self::Boolean(array) if array.is_null(row) => Cell::Number(f64::NAN),
            Self::Boolean(array) => Cell::Number(f64::from(u8::from(array.value(row)))),
            Self::Ticks(array, per_s) => number(array, row, |ticks| ticks as f64 / per_s),
            Self::Decimal(array, per_one) => number(array, row, |digits| digits as f64 / per_one),
            Self::Null => Cell::Number(f64::NAN),
            Self::Utf8(array) => Cell::Word(if array.is_null(row) { "" } else { array.value(row) }),
            Self::LargeUtf8(array) => Cell::Word(if array.is_null(row) { "" } else { array.value(row) }),
            Self::Utf8View(array) => Cell::Word(if array.is_null(row) { "" } else { array.value(row) }),
            Self::Dictionary(_, Some(nulls), values) if nulls.is_null(row) => values.missing(),
            Self::Dictionary(places, _, values) => places.get(row).map_or(values.missing(), |place| values.get(place)),
        }
    }

    /// A cell without a value.
    fn missing(&self) -> Cell<'_> {
        match self {
            Self::Utf8(_) | Self::LargeUtf8(_) | Self::Utf8View(_) => Cell::Word(""),
            _ => Cell::Number(f64::NAN),
        }
    }
}

/// Keys of a dictionary that are made places at once, as they are wide.
const KEYS: usize = 4096;

/// The places of the words of a dictionary; none where it has no word.
fn places(array: &ArrayRef) -> Codes {
    let all = (0..array.len()).step_by(KEYS).flat_map(|begin| {
        let some = array.slice(begin, KEYS.min(array.len() - begin));
        let some = some.as_any_dictionary_opt().filter(|some| !some.values().is_empty());
        some.map_or_else(Vec::new, |some| some.normalized_keys())
    });
    all.collect()
}

fn number<T: ArrowPrimitiveType>(array: &PrimitiveArray<T>, row: usize, to: impl Fn(T::Native) -> f64) -> Cell<'_> {
    Cell::Number(if array.is_null(row) { f64::NAN } else { to(array.value(row)) })
}

fn ticks_per_s(unit: TimeUnit) -> f64 {
    match unit {
        TimeUnit::Second => 1.0,
        TimeUnit::Millisecond => 1e3,
        TimeUnit::Microsecond => 1e6,
        TimeUnit::Nanosecond => 1e9,
    }
}
