//! Where the steps of a drive come from: a table with the names of the program, or mapped channels.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use car::Car;
use logs::{Log, OnChange, Role};
use observer::ShiftTables;
use observer::gearbox::MAX_ELEMENTS;
use study::gearbox::car_log::{CarLog, LogStep};
use study::gearbox::channels::{CarChannels, own_map};
use study::log::FIRST_LOOK;
use trace::{ShownPath as _, signal};

use super::checks::Columns;
use crate::estimate::input::LogInput;
use crate::estimate::log_checks::{check_dbc, report_readings, sent_on_change, warn_of_dbc};
use crate::{Error, Notes};

/// How a log of a car is read.
#[derive(Clone, Copy)]
pub struct CarReading<'a> {
    /// The car.
    pub car: &'a Car,
    /// The tables of its filter.
    pub tables: &'a ShiftTables<f64>,
    /// The log.
    pub log: LogInput<'a>,
    /// Set when a log that is followed is to end; none for one that is not followed.
    pub stop: Option<&'a Arc<AtomicBool>>,
    /// How many threads read it.
    pub threads: usize,
}

/// The steps of a log.
pub struct CarSource<'a> {
    kind: SourceKind<'a>,
    /// The first steps, which are looked at before the first is used.
    looked_at: VecDeque<LogStep>,
    /// The commands of the elements, by their places in the filter's tables.
    commands: [OnChange; MAX_ELEMENTS],
    /// Elements whose commands are sent on change, as the log shows.
    on_change: Vec<String>,
}

enum SourceKind<'a> {
    Rows(Box<CarLog<'a>>),
    Channels(Box<CarChannels<'a>>),
}

impl SourceKind<'_> {
    fn next_step(&mut self) -> Result<Option<LogStep>, Error> {
        Ok(match self {
            Self::Rows(rows) => rows.next_step()?,
            Self::Channels(channels) => channels.next_step()?,
        })
    }
}

impl<'a> CarSource<'a> {
    /// Opens a log; `opened` holds it where it has channels.
    ///
    /// # Errors
    /// It cannot be read, or has not the channels that an estimate needs.
    pub fn open(reading: CarReading<'a>, opened: &'a mut Option<Log>, say: Notes<'_>) -> Result<Self, Error> {
        let CarReading { car, tables, log, stop, threads } = reading;
        let LogInput { path, map, .. } = log;
        let is_followed = stop.is_some();
        if map.channels.is_empty() && !log.needs_map()? {
            warn_of_dbc(map, say);
            let rows = CarLog::of(log.rows(stop)?, car, tables)?;
            let kind = SourceKind::Rows(Box::new(if is_followed { rows.following() } else { rows }));
            return Self::looking_ahead(kind, [OnChange::default(); MAX_ELEMENTS], reading, is_followed);
        }
        let log = log.open(stop, threads)?;
        let own;
        let map = if map.channels.is_empty() {
            own = own_map(&log, car).or_else(|missing| {
                check_dbc(path, &log)?;
                let is_gear = |name: &&str| [signal::GEAR, signal::TARGET_GEAR].contains(name);
                let has = |name: &str| log.channels().iter().any(|channel| channel.name == name);
                let gear = if missing.iter().any(|name| is_gear(name) && has(name)) {
                    "; text that is no number is not read from this format: write `gear` and `target_gear` as numbers, 0 for none and -1 for reverse"
                } else {
                    ""
                };
                Err(Error::Input(format!(
                    "{}: this log needs a channel map, because its channels have other names than those of `wetclutch simulate`: none with \
                     numbers is `{}`\n\
                     hint: `wetclutch inspect` names the channels that hold none; with --suggest it writes a first map, for --map{gear}",
                    path.shown(),
                    missing.join("` or `")
                )))
            })?;
            &own
        } else {
            map
        };
        let channels = CarChannels::of(opened.insert(log), map, car, tables)?;
        let commands = channels.commands_on_change();
        Self::looking_ahead(SourceKind::Channels(Box::new(channels)), commands, reading, is_followed)
    }

    /// Looks at the first steps: which commands are sent on change. A log that is followed is not waited for.
    fn looking_ahead(
        mut kind: SourceKind<'a>,
        mut commands: [OnChange; MAX_ELEMENTS],
        CarReading { car, tables, .. }: CarReading<'a>,
        is_followed: bool,
    ) -> Result<Self, Error> {
        let mut looked_at = VecDeque::new();
        while !is_followed && looked_at.len() < FIRST_LOOK {
            let Some(step) = kind.next_step()? else { break };
            for (command, reading) in commands.iter_mut().zip(&step.input.commands) {
                command.look(step.input.dt_s, reading.map(|reading| reading.value));
            }
            looked_at.push_back(step);
        }
        let shown = commands.each_mut().map(OnChange::is_shown);
        let elements = car.gearbox.elements.iter().enumerate();
        let on_change = elements.filter(|(at, _)| tables.place(*at).is_some_and(|place| shown[place]));
        let on_change = on_change.map(|(_, element)| element.name.clone()).collect();
        Ok(Self { kind, looked_at, commands, on_change })
    }

    /// Delays by the channel map of engine, turbine, output and wheel speed and of the longitudinal acceleration, s.
    pub fn delays_s(&self) -> [f64; 5] {
        match &self.kind {
            SourceKind::Rows(_) => [0.0; 5],
            SourceKind::Channels(channels) => channels.delays_s(),
        }
    }

    /// Whether the log has a longitudinal acceleration.
    pub fn has_acceleration(&self) -> bool {
        match &self.kind {
            SourceKind::Rows(rows) => rows.has_acceleration(),
            SourceKind::Channels(channels) => channels.has_acceleration(),
        }
    }

    /// What watches the columns of a table; mapped channels are watched by their readings.
    pub(crate) fn columns(&self, car: &Car, tables: &ShiftTables<f64>) -> Option<Columns> {
        match &self.kind {
            SourceKind::Rows(rows) => Some(Columns::of(rows, car, tables)),
            SourceKind::Channels(_) => None,
        }
    }

    /// The next step; `None` after the last.
    ///
    /// # Errors
    /// The log cannot be read.
    pub fn next_step(&mut self) -> Result<Option<LogStep>, Error> {
        let mut next = match self.looked_at.pop_front() {
            Some(step) => Some(step),
            None => self.kind.next_step()?,
        };
        // In place: steps are large.
        if let Some(step) = &mut next {
            for (command, reading) in self.commands.iter_mut().zip(&mut step.input.commands) {
                command.stand(reading);
            }
        }
        Ok(next)
    }

    /// Refuses a table most of whose rows have no time of their own: the time between the others says nothing.
    pub(crate) fn check_times(&self) -> Result<(), Error> {
        match &self.kind {
            SourceKind::Rows(rows) => Ok(rows.check_times()?),
            SourceKind::Channels(_) => Ok(()),
        }
    }

    /// Says what was met in the log, after its last step.
    ///
    /// # Errors
    /// Most samples of a channel could not be used.
    pub fn finish(&self, say: Notes<'_>) -> Result<(), Error> {
        if !self.on_change.is_empty() {
            say(&sent_on_change(&self.on_change.join(", ")));
        }
        match &self.kind {
            SourceKind::Rows(rows) => {
                rows.check_readings()?.iter().for_each(|note| say(&format!("warning: {note}")));
                Ok(())
            }
            SourceKind::Channels(channels) => {
                let gears = channels.check_gears()?;
                gears.iter().for_each(|note| say(&format!("warning: {note}")));
                report_readings(channels.readings(), &[Role::EngineSpeed, Role::WheelSpeed], say)
            }
        }
    }
}
