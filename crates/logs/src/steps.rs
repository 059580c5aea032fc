//! Inputs of an observer from readings.
//!
//! Nothing is thinned or resampled: a step takes the readings that came since the one before, and ends before a channel would
//! give a second one. So every reading reaches the observer once, with its age; the channel with the highest rate sets the steps. Rows
//! of a table, in which all channels share a time, make one step each.

use car::{Input, Reading as Measured};

use crate::samples::BEHIND_S;
use crate::{LogError, Reading, Readings, Role};

/// An input of an observer and its time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Time of the step: the newest time stamp in it, s.
    pub time_s: f64,
    /// The newest reading of each channel since the step before.
    pub input: Input<f64>,
}

/// What a step takes readings into.
pub trait Places {
    /// What becomes of it.
    type Step;

    /// The same without readings.
    #[must_use]
    fn emptied(&self) -> Self;

    /// Where a reading of an entry of the map belongs; none if nothing reads it.
    fn place(&mut self, entry: usize, role: Role) -> Option<&mut Option<Reading>>;

    /// The step at this time, `dt_s` after the one before.
    fn close(&self, time_s: f64, dt_s: f64) -> Self::Step;
}

/// The steps of a log, by default those of the observer of one shift.
pub struct Steps<'a, P: Places = OfOneShift> {
    readings: Readings<'a>,
    places: P,
    open: Option<Open<P>>,
    last_s: Option<f64>,
    ended: bool,
}

/// A step that still takes readings.
#[derive(Debug, Clone, Copy)]
struct Open<P> {
    time_s: f64,
    places: P,
}

/// What the observer of one shift reads.
#[derive(Debug, Clone, Copy, Default)]
pub struct OfOneShift {
    engine: Option<Reading>,
    turbine: Option<Reading>,
    output: Option<Reading>,
    wheel: Option<Reading>,
    command: Option<Reading>,
    offgoing_command: Option<Reading>,
    engine_torque: Option<Reading>,
}

impl Places for OfOneShift {
    type Step = Step;

    fn emptied(&self) -> Self {
        Self::default()
    }

    fn place(&mut self, _entry: usize, role: Role) -> Option<&mut Option<Reading>> {
        match role {
            Role::EngineSpeed => Some(&mut self.engine),
            Role::TurbineSpeed => Some(&mut self.turbine),
            Role::OutputSpeed => Some(&mut self.output),
            Role::WheelSpeed => Some(&mut self.wheel),
            Role::OncomingCurrent | Role::OncomingDuty | Role::OncomingPressureCommand => Some(&mut self.command),
            Role::OffgoingCurrent | Role::OffgoingDuty => Some(&mut self.offgoing_command),
            Role::EngineTorque => Some(&mut self.engine_torque),
            _ => None,
        }
    }

    fn close(&self, time_s: f64, dt_s: f64) -> Step {
        let measured = |reading: Option<Reading>| {
            reading.map(|reading| Measured { value: reading.value, age_s: time_s - reading.time_s })
        };
        Step {
            time_s,
            input: Input {
                dt_s,
                engine_rad_s: measured(self.engine),
                turbine_rad_s: measured(self.turbine),
                output_rad_s: measured(self.output),
                wheel_rad_s: measured(self.wheel),
                command: measured(self.command),
                offgoing_command: measured(self.offgoing_command),
                engine_torque_n_m: measured(self.engine_torque),
            },
        }
    }
}

impl<'a> Steps<'a> {
    /// The steps of these readings.
    pub fn new(readings: Readings<'a>) -> Self {
        Self::into(OfOneShift::default(), readings)
    }
}

impl<'a, P: Places> Steps<'a, P> {
    /// The steps of these readings, taken into places.
    pub fn into(places: P, readings: Readings<'a>) -> Self {
        Self { readings, places, open: None, last_s: None, ended: false }
    }

    /// The readings, with their summary and notes.
    pub fn readings(&self) -> &Readings<'a> {
        &self.readings
    }

    fn opened(&self, time_s: f64) -> Open<P> {
        Open { time_s, places: self.places.emptied() }
    }

    fn close(&mut self, open: &Open<P>) -> P::Step {
        let dt_s = self.last_s.map_or(0.0, |last_s| open.time_s - last_s);
        self.last_s = Some(open.time_s);
        open.places.close(open.time_s, dt_s)
    }

    /// The next step; `seen` takes every reading that was met on the way, also those that are refused or that no observer reads. A reading that
    /// begins the step after is among them.
    pub fn next_seeing(&mut self, mut seen: impl FnMut(Reading)) -> Option<Result<P::Step, LogError>> {
        while !self.ended {
            let reading = match self.readings.next_or_refused() {
                None => {
                    self.ended = true;
                    break;
                }
                Some(Err(error)) => {
                    self.ended = true;
                    return Some(Err(error));
                }
                Some(Ok(reading)) => reading,
            };
            seen(reading);
            let entry = self.readings.entry();
            let before = self.open.take();
            let is_first = before.is_none();
            let mut open = before.unwrap_or_else(|| self.opened(reading.stamp_s));
            let Some(place) = open.places.place(entry, reading.role) else {
                self.open = (!is_first).then_some(open);
                continue;
            };
            if place.is_some() {
                let mut next = self.opened(reading.stamp_s);
                next.places.place(entry, reading.role).map(|place| place.replace(reading));
                let step = self.close(&open);
                if open.time_s - next.time_s > BEHIND_S {
                    // The step had a stamp that was far too late: what comes now follows the step before it.
                    self.last_s = None;
                } else {
                    // A reading that came late on the bus has a stamp before the step: the step is of the newest stamp.
                    next.time_s = next.time_s.max(open.time_s);
                }
                self.open = Some(next);
                return Some(Ok(step));
            }
            *place = Some(reading);
            open.time_s = open.time_s.max(reading.stamp_s);
            self.open = Some(open);
        }
        self.open.take().map(|open| Ok(self.close(&open)))
    }
}

impl<P: Places> Iterator for Steps<'_, P> {
    type Item = Result<P::Step, LogError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.next_seeing(drop)
    }
}
