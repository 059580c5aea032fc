//! A measured log, read row by row.

use std::collections::VecDeque;
use std::path::Path;

use config::Vehicle;
use logs::{Clock, FrozenSpeed, Role, Speeds};
use observer::{Input, Phase, Reading};
use trace::{CsvRows, TraceError, signal};

use crate::Signals;

/// Rows that are looked at before the first estimate: gains are designed for the median time between them.
pub const FIRST_LOOK: usize = 10_000;

/// The samples of a log. However long it is, only its first rows are held in memory, until they have been used.
pub struct Log {
    rows: CsvRows,
    signals: Signals<usize>,
    truth: Option<TruthColumns>,
    /// Places of the columns of [`Beside`]; none if the log has none of them.
    beside: Option<[Option<usize>; BESIDE.len()]>,
    last_s: Option<f64>,
    clock: Clock,
    rows_read: u64,
    repeated: u64,
    backward: u64,
    frozen: Frozen,
    looked_at: VecDeque<(Input<f64>, LogRow)>,
    median_step_s: f64,
}

/// Places of what only a simulated log has.
#[derive(Debug, Clone, Copy)]
struct TruthColumns {
    phase: usize,
    pressure: usize,
}

/// What comes along with a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LogRow {
    /// Time, s.
    pub time_s: f64,
    /// The true values, if the log has them.
    pub truth: Option<Truth>,
    /// What else the row holds.
    pub beside: Beside,
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
    pub const NONE: Self = Self {
        pressure_pa: f64::NAN,
        torque_n_m: f64::NAN,
        engine_n_m: f64::NAN,
        throttle: f64::NAN,
        vehicle_m_s: f64::NAN,
        vehicle_m_s2: f64::NAN,
    };
}

/// The speeds of the rows, of which frozen ones are taken out by the rules of [`logs::frozen`].
struct Frozen {
    watched: [FrozenSpeed; WATCHED.len()],
    newest: Speeds,
    /// The time at which the newest reading of each was measured, s, and whether it is frozen.
    newest_s: [(f64, bool); WATCHED.len()],
    /// Readings of each, and how many of them were frozen.
    counts: [(u64, u64); WATCHED.len()],
}

const WATCHED: [Role; 4] = [Role::EngineSpeed, Role::TurbineSpeed, Role::OutputSpeed, Role::WheelSpeed];

impl Frozen {
    fn new() -> Self {
        Self {
            watched: WATCHED.map(FrozenSpeed::new),
            newest: Speeds::default(),
            newest_s: [(f64::NEG_INFINITY, false); WATCHED.len()],
            counts: [(0, 0); WATCHED.len()],
        }
    }

    /// Takes the readings out of a row that are frozen.
    fn take_out(&mut self, input: &mut Input<f64>, time_s: f64) {
        let speeds =
            [&mut input.engine_rad_s, &mut input.turbine_rad_s, &mut input.output_rad_s, &mut input.wheel_rad_s];
        for (i, speed) in speeds.into_iter().enumerate() {
            let Some(Reading { value, age_s }) = *speed else { continue };
            let measured_s = time_s - age_s;
            let (newest_s, was_frozen) = self.newest_s[i];
            // A reading that a table holds until the next one comes is one reading.
            let is_held = age_s > 0.0 && (measured_s - newest_s).abs() <= SAME_S;
            let frozen = if is_held { was_frozen } else { self.watched[i].is_frozen(value, measured_s, &self.newest) };
            self.newest_s[i] = (measured_s, frozen);
            self.counts[i].0 += 1;
            if frozen {
                self.counts[i].1 += 1;
                *speed = None;
            } else {
                self.newest[WATCHED[i] as usize] = Some(value);
            }
        }
    }
}

/// Times that differ by less are those of one reading, s: decimals of a table.
const SAME_S: f64 = 1e-6;

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
        let signals = Signals::choose(vehicle, |name| rows.find(name), |name| rows.require(name))?;
        let truth = rows.find(signal::TRUE_PHASE).zip(rows.find(signal::ONCOMING_PRESSURE));
        let truth = truth.map(|(phase, pressure)| TruthColumns { phase, pressure });
        let beside = Some(BESIDE.map(|name| rows.find(name))).filter(|columns| columns.iter().any(Option::is_some));
        let looked_at = VecDeque::with_capacity(look);
        let mut log = Self {
            rows,
            signals,
            truth,
            beside,
            last_s: None,
            clock: Clock::default(),
            rows_read: 0,
            repeated: 0,
            backward: 0,
            frozen: Frozen::new(),
            looked_at,
            median_step_s: f64::NAN,
        };
        while log.looked_at.len() < look
            && let Some(sample) = log.read()?
        {
            log.looked_at.push_back(sample);
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

    /// Refuses a log without the wheel speed.
    ///
    /// # Errors
    /// It has none.
    pub fn require_wheel_speed(&self) -> Result<(), TraceError> {
        self.rows.require(signal::WHEEL_SPEED).map(drop)
    }

    /// Median time between two of the first [`FIRST_LOOK`] samples, s.
    pub fn median_step_s(&self) -> f64 {
        self.median_step_s
    }

    /// How often the clock did not simply go on: resets, and stamps that were far too late.
    pub fn resets(&self) -> u32 {
        self.clock.resets() + self.clock.wrong_jumps()
    }

    /// What was met in the time stamps and of frozen speeds, in sentences.
    ///
    /// # Errors
    /// Most rows, or most readings of a speed, could not be used.
    pub fn check_readings(&self) -> Result<Vec<String>, TraceError> {
        let unused = self.repeated + self.backward;
        let count = |count: u64, what: &str| {
            (count > 0).then(|| format!("{count} of {} rows {what} and are not used", self.rows_read))
        };
        let notes = [
            count(self.repeated, "have the time of the row before"),
            count(self.backward, "have a time before that of the row before"),
        ];
        let notes: Vec<String> = notes.into_iter().flatten().collect();
        if 2 * unused > self.rows_read {
            return Err(self.rows.refused(format!(
                "{}\nhint: the time has too few digits, or is not in `{}`",
                notes.join(", "),
                signal::TIME
            )));
        }
        let mut notes: Vec<String> = notes.into_iter().chain(self.clock.notes()).collect();
        for (role, (readings, frozen)) in WATCHED.iter().zip(self.frozen.counts).filter(|(_, (_, frozen))| *frozen > 0)
        {
            let name = role.name();
            notes.push(format!(
                "{frozen} of {readings} readings of {name} stand still while the car does not, and are not used"
            ));
            if 2 * frozen > readings {
                return Err(self
                    .rows
                    .refused(format!("{}\nhint: check the sensor of {name} and its column", notes.join(", "))));
            }
        }
        Ok(notes)
    }

    /// Goes on to the next row whose time is after that of the row before, by the rules of [`Clock`]; its time.
    fn next_time(&mut self) -> Result<Option<f64>, TraceError> {
        while self.rows.advance_in_any_order()? {
            self.rows_read += 1;
            let wrong_jumps = self.clock.wrong_jumps();
            let time_s = self.clock.time(self.rows.time_s());
            if self.clock.wrong_jumps() > wrong_jumps {
                // The row before was the one with the wrong time.
                self.last_s = None;
            }
            match time_s {
                Some(time_s) if self.last_s.is_none_or(|last_s| time_s > last_s) => return Ok(Some(time_s)),
                Some(time_s) if self.last_s == Some(time_s) => self.repeated += 1,
                _ => self.backward += 1,
            }
        }
        Ok(None)
    }

    /// The next row of the file.
    fn read(&mut self) -> Result<Option<(Input<f64>, LogRow)>, TraceError> {
        let Some(time_s) = self.next_time()? else { return Ok(None) };
        let rows = &self.rows;
        let dt_s = self.last_s.replace(time_s).map_or(0.0, |last_s| time_s - last_s);
        let mut input = self.signals.input(dt_s, |column| rows.number(column))?;
        self.frozen.take_out(&mut input, time_s);
        let truth = self.truth.and_then(|columns| {
            let word = rows.text(columns.phase);
            let phase = Phase::ALL.into_iter().find(|phase| phase.name() == word)?;
            Some(rows.number(columns.pressure).map(|pressure_pa| Truth { phase, pressure_pa }))
        });
        // A word in a signal that is not needed is no error.
        let beside = self.beside.map_or(Beside::NONE, |columns| {
            let [pressure_pa, torque_n_m, engine_n_m, throttle, vehicle_m_s, vehicle_m_s2] =
                columns.map(|column| column.and_then(|column| rows.number(column).ok()).unwrap_or(f64::NAN));
            Beside { pressure_pa, torque_n_m, engine_n_m, throttle, vehicle_m_s, vehicle_m_s2 }
        });
        Ok(Some((input, LogRow { time_s, truth: truth.transpose()?, beside })))
    }
}

impl Iterator for Log {
    type Item = Result<(Input<f64>, LogRow), TraceError>;

    fn next(&mut self) -> Option<Self::Item> {
        match self.looked_at.pop_front() {
            Some(sample) => Some(Ok(sample)),
            None => self.read().transpose(),
        }
    }
}
