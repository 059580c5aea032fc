//! Studies: any part of their runs, and what follows from all of them.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use wetclutch::{Error, StudyRuns};

use crate::error::exception;
use crate::table::Table;
use crate::work;

/// The study that was read last: its runs are made in many calls.
static LAST: Mutex<Option<(PathBuf, Arc<StudyRuns>)>> = Mutex::new(None);

/// Files with their texts, name, fingerprint, number of runs, header of the table, and runs that a thread takes at once.
type Described = (Vec<(PathBuf, String)>, String, String, u64, String, u64);

/// The files of a study, and what it is.
#[pyfunction]
pub(crate) fn study_files(py: Python<'_>, path: PathBuf, text: Option<String>) -> PyResult<Described> {
    work::done(py, None, move |_| {
        let study = match text {
            None => StudyRuns::read(&path)?,
            Some(text) => StudyRuns::from_text(&path, &text)?,
        };
        let name = study.name().to_owned();
        Ok((study.files()?, name, study.fingerprint(), study.count(), study.header(), study.runs_at_once()))
    })
}

/// Makes runs of the study that this file describes, from `first` to before `end`: the lines of the table.
#[pyfunction]
pub(crate) fn study_rows(
    py: Python<'_>,
    path: PathBuf,
    first: u64,
    end: u64,
    threads: usize,
) -> PyResult<Bound<'_, PyBytes>> {
    let lines = work::done(py, None, move |work| ready(&path)?.rows(first..end, threads, &|| work.is_stopped()))?;
    Ok(PyBytes::new(py, lines.as_bytes()))
}

/// The table and the page of all lines; `shown` is what the page calls the study file, if a page is wanted.
#[pyfunction]
pub(crate) fn study_table(
    py: Python<'_>,
    path: PathBuf,
    lines: &[u8],
    shown: Option<PathBuf>,
) -> PyResult<(Table, Option<String>)> {
    let lines = str::from_utf8(lines).map_err(|error| exception(py, &Error::Input(error.to_string())))?.to_owned();
    let (table, page) = work::done(py, None, move |_| {
        let study = ready(&path)?;
        let table = study.table(&lines)?;
        let page = shown.map(|shown| study.page(&lines, &shown)).transpose()?;
        Ok((table, page.flatten()))
    })?;
    Ok((table.into(), page))
}

/// The study of a file, read once.
fn ready(path: &Path) -> Result<Arc<StudyRuns>, Error> {
    let last = || LAST.lock().unwrap_or_else(PoisonError::into_inner);
    let found = last().as_ref().filter(|(of, _)| of == path).map(|(_, study)| Arc::clone(study));
    if let Some(study) = found {
        return Ok(study);
    }
    let study = Arc::new(StudyRuns::read(path)?);
    *last() = Some((path.to_owned(), Arc::clone(&study)));
    Ok(study)
}
