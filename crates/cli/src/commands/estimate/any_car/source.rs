//! Where the steps of a drive come from: a table with the names of the program, or mapped channels.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use config::Car;
use design::ShiftTables;
use logs::{ChannelMap, Log, LogError, Role};
use study::any_shift::car_log::{CarLog, LogStep};
use study::any_shift::channels::{CarChannels, own_map};
use trace::{CsvRows, Following, shown_path};

use super::super::Messages;
use super::super::measured::{other_delimiter, report_readings};
use super::checks::Columns;
use crate::failure::Failure;

/// How a log of a car is read.
#[derive(Clone, Copy)]
pub(in crate::commands) struct CarReading<'a> {
    pub(in crate::commands) car: &'a Car,
    pub(in crate::commands) tables: &'a ShiftTables<f64>,
    pub(in crate::commands) map: &'a ChannelMap,
    /// Set when a log that is followed is to end; none for one that is not followed.
    pub(in crate::commands) stop: Option<&'a Arc<AtomicBool>>,
    /// How many threads read it.
    pub(in crate::commands) threads: usize,
}

/// The steps of a log.
pub(in crate::commands) enum CarSource<'a> {
    Rows(Box<CarLog<'a>>),
    Channels(Box<CarChannels<'a>>),
}

impl<'a> CarSource<'a> {
    /// Opens a log; `opened` holds it where it has channels.
    pub(in crate::commands) fn open(
        reading: CarReading<'a>,
        path: &Path,
        opened: &'a mut Option<Log>,
    ) -> Result<Self, Failure> {
        let CarReading { car, tables, map, stop, threads } = reading;
        let stop = stop.map(Arc::clone);
        let is_pipe = path == Path::new("-");
        if map.channels.is_empty() && (is_pipe || !logs::needs_map(path)?) {
            let opening = |source| LogError::Io { path: path.to_owned(), source };
            let input: Box<dyn Read> = match stop {
                Some(stop) => Box::new(Following::open(path, stop).map_err(opening)?),
                None if is_pipe => Box::new(io::stdin()),
                None => Box::new(File::open(path).map_err(opening)?),
            };
            let rows = CsvRows::of_log(path, input).map_err(|error| other_delimiter(path, error))?;
            return Ok(Self::Rows(Box::new(CarLog::of(rows, car, tables)?)));
        }
        let log = match stop {
            Some(stop) => Log::follow(path, &map.open, stop)?,
            None => Log::open(path, &map.open)?.on_threads(threads),
        };
        let own;
        let map = if map.channels.is_empty() {
            own = own_map(&log, car).ok_or_else(|| {
                Failure::Input(format!(
                    "{}: this log needs a channel map, because its channels have other names than those of `wetclutch simulate`\n\
                     hint: `wetclutch inspect` with --suggest writes a first one, for --map",
                    shown_path(path)
                ))
            })?;
            &own
        } else {
            map
        };
        let channels = CarChannels::of(opened.insert(log), map, car, tables)?;
        Ok(Self::Channels(Box::new(channels)))
    }

    /// What watches the columns of a table; mapped channels are watched by their readings.
    pub(super) fn columns(&self, car: &Car, tables: &ShiftTables<f64>) -> Option<Columns> {
        match self {
            Self::Rows(rows) => Some(Columns::of(rows, car, tables)),
            Self::Channels(_) => None,
        }
    }

    pub(in crate::commands) fn next_step(&mut self) -> Result<Option<LogStep>, Failure> {
        Ok(match self {
            Self::Rows(rows) => rows.next_step()?,
            Self::Channels(channels) => channels.next_step()?,
        })
    }

    /// Says what was met in the log, after its last step.
    pub(in crate::commands) fn finish(&self, say: &mut Messages) -> Result<(), Failure> {
        match self {
            Self::Rows(rows) => {
                rows.check_readings()?.iter().for_each(|note| say.note(&format!("warning: {note}")));
                Ok(())
            }
            Self::Channels(channels) => {
                let gears = channels.check_gears()?;
                gears.iter().for_each(|note| say.note(&format!("warning: {note}")));
                report_readings(channels.readings(), &[Role::EngineSpeed, Role::WheelSpeed], say)
            }
        }
    }
}
