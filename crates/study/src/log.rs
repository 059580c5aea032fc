//! A measured log, read row by row.

use std::collections::VecDeque;
use std::convert::Infallible;
use std::path::Path;

use car::Vehicle;
use logs::{LOOK_AHEAD_S, LookAhead};
use observer::{Input, Phase};
use trace::{CsvRows, TraceError, signal};

use crate::Signals;
use crate::frozen_rows::{FrozenRows, SpeedReadings};
use crate::row_clock::{RowClock, RowTime};
use crate::row_samples::{RowSamples, refuse_misnamed_engine};

/// The input of an observer, and what comes along with it.
type InputRow = (Input<f64>, LogRow);

/// Rows that are looked at before the first estimate: gains are designed for the median time between them.
pub const FIRST_LOOK: usize = 10_000;

/// The samples of a log. However long it is, only its first rows are held in memory, until they have been used.
pub struct Log {
    rows: CsvRows,
    signals: Signals<usize>,
    truth: Option<TruthColumns>,
    /// Places of the columns of [`Beside`]; none if the log has none of them.
    beside: Option<[Option<usize>; BESIDE.len()]>,
    clock: RowClock,
    frozen: FrozenRows,
    samples: RowSamples,
    /// Rows that may still be shown to have a wrong speed.
    ahead: LookAhead<InputRow, TraceError>,
    looked_at: VecDeque<InputRow>,
    median_step_s: f64,
}

/// Places of what only a simulated log has.
#[derive(Debug, Clone, Copy)]
struct TruthColumns {
    phase: usize,
    pressure: usize,
}

impl TruthColumns {
    /// The truth in this row; none where its phase has no name.
    fn of(self, rows: &CsvRows) -> Result<Option<Truth>, TraceError> {
        let word = rows.text(self.phase);
        let Some(phase) = Phase::ALL.into_iter().find(|phase| phase.name() == word) else { return Ok(None) };
        Ok(Some(Truth { phase, pressure_pa: rows.number(self.pressure)? }))
    }
}

/// What comes along with a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LogRow {
    /// Time, s.
    pub time_s: f64,
    /// How often the clock had begun anew until then, or went on after stamps that were far too late.
    pub resets: u32,
    /// The true values, if the log has them.
    pub truth: Option<Truth>,
    /// What else the row holds.
    pub beside: Beside,
}

impl LogRow {
    /// Before the first row.
    pub const NONE: Self = Self { time_s: f64::NAN, resets: 0, truth: None, beside: Beside::NONE };
}

/// Signals that no observer reads; NaN where the log has none. They tell how a shift was and how far an estimate is off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Beside {
    /// Pressure of the oncoming clutch, Pa.
    pub pressure_pa: f64,
    /// Torque of the oncoming clutch, N m.
    pub torque_n_m: f64,
    /// Engine torque, N m.
    pub engine_n_m: f64,
    /// Throttle, 0 to 1.
    pub throttle: f64,
    /// Speed of the car, m/s.
    pub vehicle_m_s: f64,
    /// Acceleration of the car, m/s^2.
    pub vehicle_m_s2: f64,
}

impl Beside {
    /// Of a log that has none of these signals.
    const NONE: Self = Self {
        pressure_pa: f64::NAN,
        torque_n_m: f64::NAN,
        engine_n_m: f64::NAN,
        throttle: f64::NAN,
        vehicle_m_s: f64::NAN,
        vehicle_m_s2: f64::NAN,
    };
}

/// The columns of [`Beside`].
const BESIDE: [&str; 6] = [
    signal::ONCOMING_PRESSURE,
    signal::ONCOMING_TORQUE,
    signal::ENGINE_TORQUE,
    signal::THROTTLE,
    signal::VEHICLE_SPEED,
    signal::VEHICLE_ACCELERATION,
];

/// The truth at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Truth {
    /// Phase of the shift.
    pub phase: Phase,
    /// Pressure of the oncoming clutch, Pa.
    pub pressure_pa: f64,
}

impl Log {
    /// Opens a log, finds the columns and looks at the first rows.
    ///
    /// # Errors
    /// The file cannot be read, lacks a signal, or one of its first rows is wrong.
    pub fn open(path: &Path, vehicle: &Vehicle) -> Result<Self, TraceError> {
        Self::of(CsvRows::open(path)?, vehicle, FIRST_LOOK)
    }

    /// The same of rows from anywhere; looks at the first `look` of them.
    ///
    /// # Errors
    /// A signal is missing, or one of the first rows is wrong.
    pub fn of(rows: CsvRows, vehicle: &Vehicle, look: usize) -> Result<Self, TraceError> {
        Self::with_look_ahead(rows, vehicle, look, LOOK_AHEAD_S)
    }

    /// The same of rows that are still being written: none waits for those after it.
    ///
    /// # Errors
    /// Those of [`Self::of`].
    pub fn following(rows: CsvRows, vehicle: &Vehicle, look: usize) -> Result<Self, TraceError> {
        Self::with_look_ahead(rows, vehicle, look, 0.0)
    }

    fn with_look_ahead(rows: CsvRows, vehicle: &Vehicle, look: usize, look_ahead_s: f64) -> Result<Self, TraceError> {
        let rows = rows.with_wheel_radius(vehicle.road.wheel_radius_m)?;
        refuse_misnamed_engine(&rows)?;
        let signals = Signals::choose(vehicle, |name| rows.find(name), |name| rows.require(name))?;
        let truth = rows.find(signal::TRUE_PHASE).zip(rows.find(signal::ONCOMING_PRESSURE));
        let truth = truth.map(|(phase, pressure)| TruthColumns { phase, pressure });
        let beside = Some(BESIDE.map(|name| rows.find(name))).filter(|columns| columns.iter().any(Option::is_some));
        let looked_at = VecDeque::with_capacity(look);
        let mut log = Self {
            samples: RowSamples::new(&rows),
            rows,
            signals,
            truth,
            beside,
            clock: RowClock::default(),
            frozen: FrozenRows::new(),
            ahead: LookAhead::new(look_ahead_s),
            looked_at,
            median_step_s: f64::NAN,
        };
        let (mut input, mut row) = (Input::none(0.0), LogRow::NONE);
        while log.looked_at.len() < look && log.read(&mut input, &mut row)? {
            log.looked_at.push_back((input, row));
        }
        let steps = log.looked_at.iter().skip(1).map(|(input, _)| input.dt_s);
        log.median_step_s = trace::median_step_s(steps.collect());
        Ok(log)
    }

    /// The first rows, which wait to be used.
    pub fn looked_at(&self) -> impl Iterator<Item = &(Input<f64>, LogRow)> {
        self.looked_at.iter()
    }

    /// Which of the signals in [`Beside`] there are, by their names.
    pub fn has_beside(&self, name: &str) -> bool {
        BESIDE.iter().zip(self.beside.iter().flatten()).any(|(known, column)| *known == name && column.is_some())
    }

    /// Where the signals are.
    pub fn signals(&self) -> &Signals<usize> {
        &self.signals
    }

    /// Refuses a log without a column of this name.
    ///
    /// # Errors
    /// It has none.
    pub fn require(&self, name: &str) -> Result<(), TraceError> {
        self.rows.require(name).map(drop)
    }

    /// Median time between two of the first [`FIRST_LOOK`] samples, s.
    pub fn median_step_s(&self) -> f64 {
        self.median_step_s
    }

    /// What was met in the time stamps, the samples and of frozen speeds, in sentences.
    ///
    /// # Errors
    /// Most rows, or most samples of a column, could not be used.
    pub fn check_readings(&self) -> Result<Vec<String>, TraceError> {
        let mut notes = self.clock.notes(&self.rows)?;
        notes.extend(self.samples.notes(&self.rows)?);
        self.frozen.check().map_err(|message| self.rows.refused(message))?;
        notes.extend(self.frozen.notes());
        Ok(notes)
    }

    /// Goes on to the next row, and puts its input and what came along there; false at the end.
    ///
    /// # Errors
    /// The file cannot be read, or the row is wrong.
    #[inline]
    pub fn advance(&mut self, input: &mut Input<f64>, row: &mut LogRow) -> Result<bool, TraceError> {
        match self.looked_at.pop_front() {
            Some(looked_at) => {
                (*input, *row) = looked_at;
                Ok(true)
            }
            None => self.read(input, row),
        }
    }

    /// The next row, without the readings that rows after it show to be wrong; false at the end.
    fn read(&mut self, input: &mut Input<f64>, row: &mut LogRow) -> Result<bool, TraceError> {
        loop {
            if let Some(next) = self.ahead.ready() {
                return next.map(|next| next.map(|next| (*input, *row) = next).is_some());
            }
            match self.read_row() {
                Ok(Some(next)) => {
                    self.ahead.push(next.1.time_s, next);
                    for withdrawn in self.frozen.withdrawn() {
                        for (input, row) in self.ahead.waiting() {
                            self.frozen.withdraw(withdrawn, speeds(input), row.time_s);
                        }
                    }
                }
                Ok(None) => self.ahead.end(None),
                Err(error) => self.ahead.end(Some(error)),
            }
        }
    }

    /// The next row of the file; `None` at its end.
    fn read_row(&mut self) -> Result<Option<InputRow>, TraceError> {
        let Some(RowTime { time_s, dt_s }) = self.clock.advance(&mut self.rows)? else { return Ok(None) };
        let rows = &self.rows;
        let Ok(mut input) = self.signals.input(dt_s, |column| Ok::<f64, Infallible>(self.samples.number(rows, column)));
        let truth = self.truth.map(|columns| columns.of(rows)).transpose()?.flatten();
        // A word in a signal that is not needed is no error.
        let beside = self.beside.map_or(Beside::NONE, |columns| {
            let [pressure_pa, torque_n_m, engine_n_m, throttle, vehicle_m_s, vehicle_m_s2] =
                columns.map(|column| column.and_then(|column| rows.number(column).ok()).unwrap_or(f64::NAN));
            Beside { pressure_pa, torque_n_m, engine_n_m, throttle, vehicle_m_s, vehicle_m_s2 }
        });
        self.frozen.take_out(speeds(&mut input), time_s);
        Ok(Some((input, LogRow { time_s, resets: self.clock.resets(), truth, beside })))
    }
}

fn speeds(input: &mut Input<f64>) -> SpeedReadings<'_> {
    let Input { engine_rad_s, turbine_rad_s, output_rad_s, wheel_rad_s, .. } = input;
    [engine_rad_s, turbine_rad_s, output_rad_s, wheel_rad_s]
}

impl Iterator for Log {
    type Item = Result<(Input<f64>, LogRow), TraceError>;

    fn next(&mut self) -> Option<Self::Item> {
        let (mut input, mut row) = (Input::none(0.0), LogRow::NONE);
        self.advance(&mut input, &mut row).map(|is_there| is_there.then_some((input, row))).transpose()
    }
}
