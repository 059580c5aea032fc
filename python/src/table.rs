//! Tables between Python and the library.

use std::ffi::{CStr, c_int, c_void};
use std::sync::{Arc, OnceLock};

use pyo3::exceptions::{PyBufferError, PyKeyError, PyTypeError, PyValueError};
use pyo3::ffi;
use pyo3::prelude::*;
use pyo3::types::{PyCapsule, PyDict, PyList, PyTuple};
use wetclutch::{Column, TableRows, Values, Words};

use crate::arrow;
use crate::arrow_rows::ArrowRows;

/// Columns of the same length.
#[pyclass(module = "wetclutch._wetclutch", frozen)]
pub(crate) struct Table {
    rows: Rows,
}

/// Where the rows of a table stand.
enum Rows {
    Own(Arc<wetclutch::Table>),
    /// With Arrow, and as columns of our own once one of them was asked for.
    Arrow(Arc<ArrowRows>, OnceLock<Arc<wetclutch::Table>>),
}

impl From<wetclutch::Table> for Table {
    fn from(table: wetclutch::Table) -> Self {
        Self { rows: Rows::Own(Arc::new(table)) }
    }
}

#[pymethods]
impl Table {
    /// From an object with Arrow data: one that has `__arrow_c_stream__` or `__arrow_c_array__`.
    #[staticmethod]
    fn from_arrow(object: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self { rows: Rows::Arrow(Arc::new(arrow::imported(object)?), OnceLock::new()) })
    }

    /// From columns by their names: buffers of 64-bit floats, or lists of numbers and `None`, or of words and `None`.
    #[staticmethod]
    fn from_columns(columns: &Bound<'_, PyDict>) -> PyResult<Self> {
        let mut table = wetclutch::Table::default();
        for (name, values) in columns {
            let name: String =
                name.extract().map_err(|_| PyTypeError::new_err("names of columns have to be strings"))?;
            let values = values_of(&name, &values)?;
            if let Some(first) = table.columns.first().filter(|first| first.values.len() != values.len()) {
                return Err(PyValueError::new_err(format!(
                    "column `{name}` has {} values, and `{}` has {}",
                    values.len(),
                    first.name,
                    first.values.len()
                )));
            }
            table.columns.push(Column { name, values });
        }
        Ok(table.into())
    }

    /// Names of the columns.
    #[getter]
    fn names(&self) -> Vec<&str> {
        match &self.rows {
            Rows::Own(table) => table.names(),
            Rows::Arrow(rows, _) => rows.names(),
        }
    }

    /// Units of the columns, `None` of words and of numbers without one.
    #[getter]
    fn units(&self) -> Vec<Option<&'static str>> {
        self.table().columns.iter().map(Column::unit).collect()
    }

    /// Columns of Arrow data that are neither of numbers, times nor words, with their kinds.
    #[getter]
    fn left_out(&self) -> &[String] {
        match &self.rows {
            Rows::Own(_) => &[],
            Rows::Arrow(rows, _) => rows.left_out(),
        }
    }

    fn __len__(&self) -> usize {
        self.rows().rows()
    }

    /// The numbers of a column as a buffer of 64-bit floats, without a copy; `None` of words.
    fn numbers(&self, name: &str) -> PyResult<Option<Numbers>> {
        let column = self.place(name)?;
        let table = self.table();
        let is_numbers = matches!(table.columns[column].values, Values::Numbers(_));
        Ok(is_numbers.then(|| Numbers { table: Arc::clone(table), column }))
    }

    /// The words of a column.
    fn words<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyList>> {
        match &self.table().columns[self.place(name)?].values {
            Values::Words(words) => {
                PyList::new(py, (0..words.codes.len()).map(|row| words.get(row).unwrap_or_default()))
            }
            Values::Numbers(_) => Err(PyTypeError::new_err(format!("column `{name}` has numbers"))),
        }
    }

    #[pyo3(signature = (requested_schema=None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        // The request is a wish, which may be left unfulfilled.
        drop(requested_schema);
        arrow::exported(py, self.table())
    }
}

impl Table {
    /// Its rows, to be read one after the other.
    pub(crate) fn rows(&self) -> Arc<dyn TableRows> {
        match &self.rows {
            Rows::Own(table) => Arc::clone(table) as _,
            Rows::Arrow(rows, _) => Arc::clone(rows) as _,
        }
    }

    /// Its columns.
    fn table(&self) -> &Arc<wetclutch::Table> {
        match &self.rows {
            Rows::Own(table) => table,
            Rows::Arrow(rows, table) => table.get_or_init(|| Arc::new(rows.to_table())),
        }
    }

    fn place(&self, name: &str) -> PyResult<usize> {
        let place = self.names().iter().position(|column| *column == name);
        place.ok_or_else(|| PyKeyError::new_err(name.to_owned()))
    }
}

/// The values of a column that Python gives.
fn values_of(name: &str, values: &Bound<'_, PyAny>) -> PyResult<Values> {
    if let Ok(buffer) = pyo3::buffer::PyBuffer::<f64>::get(values)
        && buffer.dimensions() == 1
    {
        return Ok(Values::Numbers(buffer.to_vec(values.py())?));
    }
    if let Ok(buffer) = pyo3::buffer::PyBuffer::<f32>::get(values)
        && buffer.dimensions() == 1
    {
        return Ok(Values::Numbers(buffer.to_vec(values.py())?.into_iter().map(f64::from).collect()));
    }
    let items: Vec<Bound<'_, PyAny>> = values.try_iter()?.collect::<PyResult<_>>()?;
    let is_word = |item: &Bound<'_, PyAny>| item.extract::<&str>().is_ok() || item.extract::<String>().is_ok();
    // A tuple is one of words, of which there may be none.
    if values.is_instance_of::<PyTuple>() || items.iter().any(is_word) {
        let words = items.iter().map(|item| match (item.is_none(), item.extract::<String>()) {
            (true, _) => Ok(String::new()),
            (false, Ok(word)) => Ok(word),
            (false, Err(_)) => Ok(item.str()?.to_string()),
        });
        let words: Vec<String> = words.collect::<PyResult<_>>()?;
        return Ok(Values::Words(words.iter().map(String::as_str).collect::<Words>()));
    }
    let number = |item: &Bound<'_, PyAny>| match item.is_none() {
        true => Ok(f64::NAN),
        false => item.extract::<f64>().map_err(|_| {
            let kind = item.get_type().name().map_or_else(|_| "?".to_owned(), |name| name.to_string());
            PyTypeError::new_err(format!("column `{name}`: a {kind} is neither a number nor a word"))
        }),
    };
    Ok(Values::Numbers(items.iter().map(number).collect::<PyResult<_>>()?))
}

/// The numbers of a column, as a read-only buffer.
#[pyclass(module = "wetclutch._wetclutch", frozen)]
pub(crate) struct Numbers {
    table: Arc<wetclutch::Table>,
    column: usize,
}

/// 64-bit floats in the language of Python's buffers.
const FORMAT: &CStr = c"d";

#[pymethods]
impl Numbers {
    fn __len__(&self) -> usize {
        self.table.len()
    }

    #[expect(unsafe_code, reason = "the buffer protocol of Python is one of pointers")]
    unsafe fn __getbuffer__(slf: Bound<'_, Self>, view: *mut ffi::Py_buffer, flags: c_int) -> PyResult<()> {
        if view.is_null() {
            return Err(PyBufferError::new_err("there is no view"));
        }
        if flags & ffi::PyBUF_WRITABLE == ffi::PyBUF_WRITABLE {
            return Err(PyBufferError::new_err("the column cannot be written to"));
        }
        let this = slf.get();
        let Values::Numbers(numbers) = &this.table.columns[this.column].values else {
            return Err(PyBufferError::new_err("the column has words"));
        };
        let (pointer, length) = (numbers.as_ptr(), numbers.len());
        let lengths = Box::new([isize::try_from(length).unwrap_or(0), 8_isize]);
        let lengths = Box::into_raw(lengths);
        // SAFETY: `view` is one that Python gives, and is not null. The numbers live as long as this object, which the view keeps; `lengths`
        // is freed when the view is released.
        unsafe {
            (*view).buf = pointer.cast_mut().cast::<c_void>();
            (*view).len = isize::try_from(8 * length).unwrap_or(0);
            (*view).readonly = 1;
            (*view).itemsize = 8;
            (*view).ndim = 1;
            (*view).format = if flags & ffi::PyBUF_FORMAT == ffi::PyBUF_FORMAT {
                FORMAT.as_ptr().cast_mut()
            } else {
                std::ptr::null_mut()
            };
            (*view).shape = &raw mut (*lengths)[0];
            (*view).strides = &raw mut (*lengths)[1];
            (*view).suboffsets = std::ptr::null_mut();
            (*view).internal = lengths.cast::<c_void>();
            (*view).obj = slf.into_any().into_ptr();
        }
        Ok(())
    }

    #[expect(unsafe_code, reason = "the buffer protocol of Python is one of pointers")]
    unsafe fn __releasebuffer__(&self, view: *mut ffi::Py_buffer) {
        // SAFETY: `internal` was made by `__getbuffer__` of this object, and is released once.
        unsafe { drop(Box::from_raw((*view).internal.cast::<[isize; 2]>())) };
    }
}
