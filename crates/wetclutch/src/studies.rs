//! Studies: any part of their runs, on any machine, and what follows from all of them.
//!
//! Study and number determine a run, so that rows made in parts, in any order and place, are those of a whole study.

use std::ops::Range;
use std::path::{Path, PathBuf};

use config::{CarStudy, CarStudyRuns, ExperimentFile, Kind, Source, Study};
use report::StudyPage;
use study::campaign::{BLOCK, in_blocks};
use study::gearbox::campaign::{CarCampaign, CarRow};
use study::{Campaign, Row, StudyError, Summary};
use trace::Cell;

use crate::{Column, Error, Table, Values, Words, shell_quoted};

/// Rows after which a table in a file is flushed: a killed program loses fewer rows than that.
const FLUSH_EVERY: u64 = 64;

/// Runs that study and number determine, and their rows.
pub trait Runs: Sync {
    /// A row.
    type Row: Send;

    /// The name of the study.
    fn name(&self) -> &str;
    /// The files that determine the rows, by their roles.
    fn sources(&self) -> Vec<(&'static str, &Source)>;
    /// SHA-256 of everything that determines the rows.
    fn fingerprint(&self) -> String;
    /// How many runs there are.
    fn count(&self) -> u64;
    /// Names of the columns.
    fn header(&self) -> Vec<String>;
    /// Makes a run.
    ///
    /// # Errors
    /// None that a study file can cause.
    fn make(&self, run: u64) -> Result<Self::Row, StudyError>;
    /// A row as a line of the table.
    fn line(&self, row: &Self::Row) -> String;
    /// The row of a line.
    ///
    /// # Errors
    /// What is wrong with the line.
    fn row_of_line(&self, run: u64, line: &str) -> Result<Self::Row, String>;
    /// Runs that a thread takes at once, and rows after which the table is flushed: few where a run takes long.
    fn at_once(&self) -> [u64; 2] {
        [BLOCK, FLUSH_EVERY]
    }
}

impl Runs for Campaign {
    type Row = Row;

    fn name(&self) -> &str {
        &self.study.name
    }

    fn sources(&self) -> Vec<(&'static str, &Source)> {
        let study = &self.study;
        vec![("study", &study.source), ("experiment", &study.experiment.source), ("vehicle", &study.vehicle.source)]
    }

    fn fingerprint(&self) -> String {
        self.study.fingerprint()
    }

    fn count(&self) -> u64 {
        self.study.runs
    }

    fn header(&self) -> Vec<String> {
        self.layout.header()
    }

    fn make(&self, run: u64) -> Result<Row, StudyError> {
        self.row(run)
    }

    fn line(&self, row: &Row) -> String {
        row.line(&self.layout)
    }

    fn row_of_line(&self, run: u64, line: &str) -> Result<Row, String> {
        Self::row_of_line(self, run, line)
    }
}

impl Runs for CarCampaign {
    type Row = CarRow;

    fn name(&self) -> &str {
        &self.study.name
    }

    fn sources(&self) -> Vec<(&'static str, &Source)> {
        let study = &self.study;
        let mut sources = vec![("study", &study.source), ("vehicle", &study.car.source)];
        if let CarStudyRuns::Drive(drive) = &study.what {
            sources.push(("drive", &drive.source));
        }
        sources
    }

    fn fingerprint(&self) -> String {
        self.study.fingerprint()
    }

    fn count(&self) -> u64 {
        self.study.runs
    }

    fn header(&self) -> Vec<String> {
        Self::header(self)
    }

    fn make(&self, run: u64) -> Result<CarRow, StudyError> {
        self.row(run)
    }

    fn line(&self, row: &CarRow) -> String {
        row.line()
    }

    fn row_of_line(&self, run: u64, line: &str) -> Result<CarRow, String> {
        Self::row_of_line(self, run, line)
    }

    fn at_once(&self) -> [u64; 2] {
        [1, 1]
    }
}

/// A study that is ready to run.
#[derive(Debug)]
pub enum StudyRuns {
    /// Of one shift with varied parameters.
    OneShift(Box<Campaign>),
    /// Of cars with a gearbox, sampled within error bounds.
    Cars(Box<CarCampaign>),
}

/// Does the same with either kind of study.
macro_rules! each {
    ($study:expr, $runs:ident => $does:expr) => {
        match $study {
            StudyRuns::OneShift($runs) => {
                let $runs = $runs.as_ref();
                $does
            }
            StudyRuns::Cars($runs) => {
                let $runs = $runs.as_ref();
                $does
            }
        }
    };
}

impl StudyRuns {
    /// Reads a study file with all files that it names, and makes it ready.
    ///
    /// ```
    /// use wetclutch::StudyRuns;
    ///
    /// let study = StudyRuns::read("../../experiments/combined.toml".as_ref())?;
    /// let parts = [study.rows(0..2, 1, &|| false)?, study.rows(2..3, 1, &|| false)?];
    /// assert_eq!(parts.concat(), study.rows(0..3, 2, &|| false)?);
    /// # Ok::<(), wetclutch::Error>(())
    /// ```
    ///
    /// # Errors
    /// A file cannot be read, something in it is wrong, or there are no gains for the vehicle.
    pub fn read(path: &Path) -> Result<Self, Error> {
        Self::from_source(Source::read(path)?)
    }

    /// The same with the text of the study file; the files that it names are in the folder of `path`.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn from_text(path: &Path, text: &str) -> Result<Self, Error> {
        Self::from_source(Source { path: path.to_owned(), text: text.to_owned() })
    }

    fn from_source(source: Source) -> Result<Self, Error> {
        if source.kind()? == Kind::CarStudy {
            let study = CarStudy::from_source(source)?;
            return Ok(Self::Cars(Box::new(CarCampaign::new(study, &bench_sensors()?)?)));
        }
        Ok(Self::OneShift(Box::new(Campaign::new(Study::from_source(source)?)?)))
    }

    /// The name of the study.
    pub fn name(&self) -> &str {
        each!(self, runs => runs.name())
    }

    /// How many runs it has.
    pub fn count(&self) -> u64 {
        each!(self, runs => Runs::count(runs))
    }

    /// SHA-256 of everything that determines its rows.
    pub fn fingerprint(&self) -> String {
        each!(self, runs => runs.fingerprint())
    }

    /// The first line of its table.
    pub fn header(&self) -> String {
        each!(self, runs => Runs::header(runs)).join(",")
    }

    /// Runs that a thread takes at once: few where a run takes long.
    pub fn runs_at_once(&self) -> u64 {
        each!(self, runs => runs.at_once())[0]
    }

    /// The texts of all files that it is read from, with their paths; the study file is the first.
    ///
    /// # Errors
    /// The table of speeds of a drive cannot be read again.
    pub fn files(&self) -> Result<Vec<(PathBuf, String)>, Error> {
        let named = each!(self, runs => runs.sources());
        let mut files: Vec<&Source> = named.into_iter().map(|(_, source)| source).collect();
        let mut speeds = None;
        if let Self::Cars(cars) = self {
            files.push(&cars.study.car.gearbox_source);
            if let CarStudyRuns::Drive(drive) = &cars.study.what {
                speeds = drive.speeds.as_deref().map(Source::read).transpose()?;
            }
        }
        let files = files.into_iter().chain(speeds.as_ref());
        Ok(files.map(|file| (file.path.clone(), file.text.clone())).collect())
    }

    /// Makes these runs on so many threads: the lines of the table, each with its end.
    ///
    /// # Errors
    /// A defect of the program, or it was stopped.
    pub fn rows(&self, runs: Range<u64>, threads: usize, is_stopped: &dyn Fn() -> bool) -> Result<String, Error> {
        each!(self, of => rows_of(of, runs, threads, is_stopped))
    }

    /// The table of all runs from its lines, which are checked. The seeds are words: a number would not be exact.
    ///
    /// # Errors
    /// A line is not of its run, or a run is missing.
    pub fn table(&self, lines: &str) -> Result<Table, Error> {
        each!(self, runs => table_of(runs, lines))
    }

    /// The page of all runs, as HTML, from the lines of the table; none of a study of cars with a gearbox. `file` is the study file as the page
    /// names it.
    ///
    /// # Errors
    /// A line is not of its run, or the page cannot be made.
    pub fn page(&self, lines: &str, file: &Path) -> Result<Option<String>, Error> {
        let Self::OneShift(campaign) = self else { return Ok(None) };
        let mut summary = Summary::new(&campaign.study);
        for (run, line) in (0..).zip(lines.lines()) {
            summary.push(&campaign.row_of_line(run, line).map_err(|error| wrong_line(run, &error))?);
        }
        let worst = summary.worst.iter().map(|row| campaign.run_in_full(row.run)).collect::<Result<Vec<_>, _>>()?;
        let command = format!("wetclutch study {}", shell_quoted(file));
        Ok(Some(StudyPage::of(&summary, &campaign.study, &worst, &command)?.html))
    }
}

fn rows_of<R: Runs>(
    study: &R,
    runs: Range<u64>,
    threads: usize,
    is_stopped: &dyn Fn() -> bool,
) -> Result<String, Error> {
    let [block, _] = study.at_once();
    let last = runs.end.min(study.count());
    let mut lines = String::new();
    in_blocks::<_, Error>(
        block,
        runs.start.min(last)..last,
        threads,
        |run| study.make(run),
        |row| {
            if is_stopped() {
                return Err(Error::interrupted());
            }
            lines += &study.line(&row?);
            lines.push('\n');
            Ok(())
        },
    )?;
    Ok(lines)
}

fn table_of<R: Runs>(study: &R, lines: &str) -> Result<Table, Error> {
    let mut columns: Vec<Column> = study.header().into_iter().map(empty_column).collect();
    let mut count = 0;
    for line in lines.lines() {
        study.row_of_line(count, line).map_err(|error| wrong_line(count, &error))?;
        for (column, cell) in columns.iter_mut().zip(line.split(',')) {
            column.values.push(match column.values {
                Values::Words(_) => Cell::Word(cell),
                Values::Numbers(_) => Cell::Number(cell.parse().unwrap_or(f64::NAN)),
            });
        }
        count += 1;
    }
    if count != study.count() {
        return Err(Error::Input(format!("there are {count} of {} runs", study.count())));
    }
    Ok(Table { columns })
}

fn empty_column(name: String) -> Column {
    let values = match name.as_str() {
        "seed" | "status" => Values::Words(Words::default()),
        _ => Values::Numbers(Vec::new()),
    };
    Column { name, values }
}

fn wrong_line(run: u64, error: &str) -> Error {
    Error::Input(format!("run {run}: {error}\nhint: the table has been changed since it was made; make its runs again"))
}

/// The sensors of the bench that the program has: those of studies of cars which name none.
///
/// # Errors
/// None in a released program.
pub fn bench_sensors() -> Result<car::Sensors, Error> {
    let sensors = ExperimentFile::bench()?.sensors;
    sensors.ok_or_else(|| Error::Work("the built-in bench has no sensors".to_owned()))
}
