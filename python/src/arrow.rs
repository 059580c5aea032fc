//! Tables by the PyCapsule interface of Arrow, in and out.

use std::collections::HashMap;
use std::ffi::CStr;
use std::sync::Arc;

use arrow_array::cast::AsArray;
use arrow_array::ffi::{FFI_ArrowArray, FFI_ArrowSchema, from_ffi};
use arrow_array::ffi_stream::{FFI_ArrowArrayStream, RecordBatchStreamReader};
use arrow_array::types::{
    Float16Type, Float32Type, Float64Type, Int8Type, Int16Type, Int32Type, Int64Type, UInt8Type, UInt16Type,
    UInt32Type, UInt64Type,
};
use arrow_array::{
    Array, ArrayRef, DictionaryArray, Float64Array, PrimitiveArray, RecordBatch, RecordBatchIterator, StringArray,
    StructArray, UInt32Array,
};
use arrow_schema::{ArrowError, DataType, Field, Schema, TimeUnit};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyCapsule, PyCapsuleMethods};
use wetclutch::{Column, Table, Values, Words};

const STREAM: &CStr = c"arrow_array_stream";
const ARRAY: &CStr = c"arrow_array";
const SCHEMA: &CStr = c"arrow_schema";

fn value_error(error: &ArrowError) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// The table as a stream of one batch. Its numbers are copied once, into memory that Arrow owns.
pub(crate) fn exported<'py>(py: Python<'py>, table: &Table) -> PyResult<Bound<'py, PyCapsule>> {
    let (mut fields, mut arrays): (Vec<Field>, Vec<ArrayRef>) = (Vec::new(), Vec::new());
    for column in &table.columns {
        let (array, kind): (ArrayRef, DataType) = match &column.values {
            Values::Numbers(numbers) => (Arc::new(Float64Array::from(numbers.clone())), DataType::Float64),
            Values::Words(words) => {
                let array = dictionary(words).map_err(|error| value_error(&error))?;
                let kind = array.data_type().clone();
                (Arc::new(array), kind)
            }
        };
        let unit = column.unit().map(|unit| HashMap::from([("unit".to_owned(), unit.to_owned())]));
        fields.push(Field::new(&column.name, kind, true).with_metadata(unit.unwrap_or_default()));
        arrays.push(array);
    }
    let schema = Arc::new(Schema::new(fields));
    let options = arrow_array::RecordBatchOptions::new().with_row_count(Some(table.len()));
    let batch = RecordBatch::try_new_with_options(Arc::clone(&schema), arrays, &options);
    let batches = RecordBatchIterator::new([batch], schema);
    PyCapsule::new_with_value(py, FFI_ArrowArrayStream::new(Box::new(batches)), STREAM)
}

fn dictionary(words: &Words) -> Result<DictionaryArray<UInt32Type>, ArrowError> {
    let values = StringArray::from_iter_values(&words.words);
    DictionaryArray::try_new(UInt32Array::from(words.codes.clone()), Arc::new(values))
}

/// A table of an object with Arrow data. Numbers of every width, booleans, times and words are taken.
pub(crate) fn imported(object: &Bound<'_, PyAny>) -> PyResult<Table> {
    if object.hasattr("__arrow_c_stream__")? {
        let capsule = object.call_method0("__arrow_c_stream__")?.cast_into::<PyCapsule>()?;
        let pointer = capsule.pointer_checked(Some(STREAM))?.cast::<FFI_ArrowArrayStream>();
        // SAFETY: a capsule of this name has a stream; the reader takes it out and leaves one that is released.
        #[expect(unsafe_code, reason = "the interface is one of pointers")]
        let reader = unsafe { RecordBatchStreamReader::from_raw(pointer.as_ptr()) };
        let reader = reader.map_err(|error| value_error(&error))?;
        let schema = arrow_array::RecordBatchReader::schema(&reader);
        let mut columns: Vec<Growing> = schema.fields().iter().map(|field| Growing::new(field)).collect();
        for batch in reader {
            let batch = batch.map_err(|error| value_error(&error))?;
            for (column, array) in columns.iter_mut().zip(batch.columns()) {
                column.take(array)?;
            }
        }
        return Ok(Table { columns: columns.into_iter().map(Growing::finish).collect() });
    }
    let pair = object.call_method0("__arrow_c_array__")?;
    let (schema, array): (Bound<'_, PyCapsule>, Bound<'_, PyCapsule>) = pair.extract()?;
    let schema = schema.pointer_checked(Some(SCHEMA))?.cast::<FFI_ArrowSchema>();
    let array = array.pointer_checked(Some(ARRAY))?.cast::<FFI_ArrowArray>();
    // SAFETY: capsules of these names have a schema and its array; the array is taken out and a released one left.
    #[expect(unsafe_code, reason = "the interface is one of pointers")]
    let data = unsafe { from_ffi(FFI_ArrowArray::from_raw(array.as_ptr()), schema.as_ref()) };
    let data = data.map_err(|error| value_error(&error))?;
    if !matches!(data.data_type(), DataType::Struct(_)) {
        return Err(PyTypeError::new_err("expected a table, got a single column of Arrow"));
    }
    let rows = StructArray::from(data);
    let mut columns: Vec<Growing> = rows.fields().iter().map(|field| Growing::new(field)).collect();
    for (column, array) in columns.iter_mut().zip(rows.columns()) {
        column.take(array)?;
    }
    Ok(Table { columns: columns.into_iter().map(Growing::finish).collect() })
}

/// A column that is imported batch by batch.
struct Growing {
    name: String,
    numbers: Vec<f64>,
    words: Vec<String>,
    is_words: bool,
}

impl Growing {
    fn new(field: &Field) -> Self {
        Self {
            name: field.name().clone(),
            numbers: Vec::new(),
            words: Vec::new(),
            is_words: is_words(field.data_type()),
        }
    }

    fn take(&mut self, array: &ArrayRef) -> PyResult<()> {
        if self.is_words {
            return words(array, &mut self.words).ok_or_else(|| self.refused(array));
        }
        numbers(array, &mut self.numbers).ok_or_else(|| self.refused(array))
    }

    fn refused(&self, array: &ArrayRef) -> PyErr {
        PyTypeError::new_err(format!(
            "column `{}` is of Arrow's type {}, expected numbers, times or text",
            self.name,
            array.data_type()
        ))
    }

    fn finish(self) -> Column {
        let values = match self.is_words {
            true => Values::Words(self.words.iter().map(String::as_str).collect::<Words>()),
            false => Values::Numbers(self.numbers),
        };
        Column { name: self.name, values }
    }
}

fn is_words(kind: &DataType) -> bool {
    match kind {
        DataType::Utf8 | DataType::LargeUtf8 | DataType::Utf8View => true,
        DataType::Dictionary(_, values) => is_words(values),
        _ => false,
    }
}

fn words(array: &ArrayRef, into: &mut Vec<String>) -> Option<()> {
    let rows = 0..array.len();
    // An empty word where there is none, as an empty cell.
    let mut push = |row: usize, word: &str| into.push(if array.is_null(row) { String::new() } else { word.to_owned() });
    match array.data_type() {
        DataType::Utf8 => rows.for_each(|row| push(row, array.as_string::<i32>().value(row))),
        DataType::LargeUtf8 => rows.for_each(|row| push(row, array.as_string::<i64>().value(row))),
        DataType::Utf8View => rows.for_each(|row| push(row, array.as_string_view().value(row))),
        DataType::Dictionary(..) => {
            let dictionary = array.as_any_dictionary_opt()?;
            let mut values = Vec::new();
            words(dictionary.values(), &mut values)?;
            let keys = if values.is_empty() { vec![0; array.len()] } else { dictionary.normalized_keys() };
            rows.for_each(|row| push(row, values.get(keys[row]).map_or("", String::as_str)));
        }
        _ => return None,
    }
    Some(())
}

fn numbers(array: &ArrayRef, into: &mut Vec<f64>) -> Option<()> {
    /// Numbers of this width.
    macro_rules! of {
        ($kind:ty) => {
            push(array.as_primitive_opt::<$kind>()?, into, |value| value as f64)
        };
    }
    match array.data_type() {
        DataType::Float64 => push(array.as_primitive_opt::<Float64Type>()?, into, |value| value),
        DataType::Float32 => push(array.as_primitive_opt::<Float32Type>()?, into, f64::from),
        DataType::Float16 => push(array.as_primitive_opt::<Float16Type>()?, into, f64::from),
        DataType::Int8 => of!(Int8Type),
        DataType::Int16 => of!(Int16Type),
        DataType::Int32 => of!(Int32Type),
        DataType::Int64 => of!(Int64Type),
        DataType::UInt8 => of!(UInt8Type),
        DataType::UInt16 => of!(UInt16Type),
        DataType::UInt32 => of!(UInt32Type),
        DataType::UInt64 => of!(UInt64Type),
        DataType::Null => into.extend(std::iter::repeat_n(f64::NAN, array.len())),
        DataType::Boolean => {
            let flags = array.as_boolean_opt()?;
            into.extend(flags.iter().map(|flag| flag.map_or(f64::NAN, |flag| f64::from(u8::from(flag)))));
        }
        DataType::Timestamp(unit, _) | DataType::Duration(unit) => {
            let ticks = array.to_data();
            let ticks =
                PrimitiveArray::<Int64Type>::from(ticks.into_builder().data_type(DataType::Int64).build().ok()?);
            let per_s = match unit {
                TimeUnit::Second => 1.0,
                TimeUnit::Millisecond => 1e3,
                TimeUnit::Microsecond => 1e6,
                TimeUnit::Nanosecond => 1e9,
            };
            push(&ticks, into, |ticks| ticks as f64 / per_s);
        }
        _ => return None,
    }
    Some(())
}

/// Appends numbers; not a number where there is none.
fn push<T: arrow_array::ArrowPrimitiveType>(
    array: &PrimitiveArray<T>,
    into: &mut Vec<f64>,
    to: impl Fn(T::Native) -> f64,
) {
    into.extend(array.iter().map(|value| value.map_or(f64::NAN, &to)));
}
