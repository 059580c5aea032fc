//! Tables by the PyCapsule interface of Arrow, in and out.

use std::collections::HashMap;
use std::ffi::CStr;
use std::ptr::NonNull;
use std::sync::Arc;

use arrow_array::ffi::{FFI_ArrowArray, FFI_ArrowSchema, from_ffi};
use arrow_array::ffi_stream::{FFI_ArrowArrayStream, RecordBatchStreamReader};
use arrow_array::{
    Array, ArrayRef, DictionaryArray, Float64Array, RecordBatch, RecordBatchIterator, StringArray, StructArray,
    UInt8Array, UInt32Array,
};
use arrow_buffer::{Buffer, ScalarBuffer};
use arrow_schema::{ArrowError, DataType, Field, Schema};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyCapsule, PyCapsuleMethods};
use wetclutch::{Codes, Table, Values, Words};

use crate::arrow_rows::ArrowRows;

const STREAM: &CStr = c"arrow_array_stream";
const ARRAY: &CStr = c"arrow_array";
const SCHEMA: &CStr = c"arrow_schema";

fn value_error(error: &ArrowError) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// The table as a stream of one batch. Its numbers stay where they are, and live as long as one of the two does.
pub(crate) fn exported<'py>(py: Python<'py>, table: &Arc<Table>) -> PyResult<Bound<'py, PyCapsule>> {
    let (mut fields, mut arrays): (Vec<Field>, Vec<ArrayRef>) = (Vec::new(), Vec::new());
    for column in &table.columns {
        let (array, kind): (ArrayRef, DataType) = match &column.values {
            Values::Numbers(numbers) => {
                let numbers = ScalarBuffer::from(lent(numbers, table));
                (Arc::new(Float64Array::new(numbers, None)), DataType::Float64)
            }
            Values::Words(words) => {
                let array = dictionary(words, table).map_err(|error| value_error(&error))?;
                let kind = array.data_type().clone();
                (array, kind)
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

fn dictionary(words: &Words, table: &Arc<Table>) -> Result<ArrayRef, ArrowError> {
    let values = Arc::new(StringArray::from_iter_values(&words.words));
    Ok(match &words.codes {
        Codes::Bytes(codes) => {
            let codes = UInt8Array::new(ScalarBuffer::from(lent(codes, table)), None);
            Arc::new(DictionaryArray::try_new(codes, values)?)
        }
        Codes::Wide(codes) => {
            let codes = UInt32Array::new(ScalarBuffer::from(lent(codes, table)), None);
            Arc::new(DictionaryArray::try_new(codes, values)?)
        }
    })
}

/// Values of a column of a table, in a buffer that keeps the table.
fn lent<T>(values: &[T], table: &Arc<Table>) -> Buffer {
    let begin = NonNull::from(values).cast::<u8>();
    // SAFETY: the values are in a column of the table, which nobody changes while the buffer keeps it.
    #[expect(unsafe_code, reason = "Arrow does not see who owns the values")]
    unsafe {
        Buffer::from_custom_allocation(begin, size_of_val(values), Arc::clone(table) as _)
    }
}

/// The rows of an object with Arrow data. Numbers of every width, booleans, times and words are taken, and stay where they are.
pub(crate) fn imported(object: &Bound<'_, PyAny>) -> PyResult<ArrowRows> {
    if object.hasattr("__arrow_c_stream__")? {
        let capsule = object.call_method0("__arrow_c_stream__")?.cast_into::<PyCapsule>()?;
        let pointer = capsule.pointer_checked(Some(STREAM))?.cast::<FFI_ArrowArrayStream>();
        // SAFETY: a capsule of this name has a stream; the reader takes it out and leaves one that is released.
        #[expect(unsafe_code, reason = "the interface is one of pointers")]
        let reader = unsafe { RecordBatchStreamReader::from_raw(pointer.as_ptr()) };
        let reader = reader.map_err(|error| value_error(&error))?;
        let schema = arrow_array::RecordBatchReader::schema(&reader);
        let mut rows = ArrowRows::of_fields(schema.fields().iter().map(AsRef::as_ref));
        for batch in reader {
            let batch = batch.map_err(|error| value_error(&error))?;
            rows.push(batch.columns(), batch.num_rows())?;
        }
        return Ok(rows);
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
    let batch = StructArray::from(data);
    let mut rows = ArrowRows::of_fields(batch.fields().iter().map(AsRef::as_ref));
    rows.push(batch.columns(), batch.len())?;
    Ok(rows)
}
