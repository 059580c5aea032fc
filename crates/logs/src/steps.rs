//! Inputs of an observer from readings.
//!
//! Nothing is thinned or resampled: a step takes the readings that came since the one before, and ends before a channel would
//! give a second one. So every reading reaches the observer once, with its age; the channel with the highest rate sets the steps. Rows
//! of a table, in which all channels share a time, make one step each.

use observer::{Input, Reading as Measured};

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

/// The steps of a log.
pub struct Steps<'a> {
    readings: Readings<'a>,
    open: Option<Open>,
    last_s: Option<f64>,
    ended: bool,
}

/// A step that still takes readings.
#[derive(Debug, Clone, Copy)]
struct Open {
    time_s: f64,
    engine: Option<Reading>,
    turbine: Option<Reading>,
    output: Option<Reading>,
    wheel: Option<Reading>,
    command: Option<Reading>,
    offgoing_command: Option<Reading>,
    engine_torque: Option<Reading>,
}

impl Open {
    fn new(time_s: f64) -> Self {
        Self {
            time_s,
            engine: None,
            turbine: None,
            output: None,
            wheel: None,
            command: None,
            offgoing_command: None,
            engine_torque: None,
        }
    }

    /// Where a reading belongs; none if no observer reads it.
    fn place(&mut self, role: Role) -> Option<&mut Option<Reading>> {
        match role {
            Role::EngineSpeed => Some(&mut self.engine),
            Role::TurbineSpeed => Some(&mut self.turbine),
            Role::OutputSpeed => Some(&mut self.output),
            Role::WheelSpeed => Some(&mut self.wheel),
            Role::OncomingCurrent | Role::OncomingDuty => Some(&mut self.command),
            Role::OffgoingCurrent | Role::OffgoingDuty => Some(&mut self.offgoing_command),
            Role::EngineTorque => Some(&mut self.engine_torque),
            _ => None,
        }
    }

    fn close(&self, last_s: Option<f64>) -> Step {
        let measured = |reading: Option<Reading>| {
            reading.map(|reading| Measured { value: reading.value, age_s: self.time_s - reading.time_s })
        };
        Step {
            time_s: self.time_s,
            input: Input {
                dt_s: last_s.map_or(0.0, |last_s| self.time_s - last_s),
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
        Self { readings, open: None, last_s: None, ended: false }
    }

    /// The readings, with their summary and notes.
    pub fn readings(&self) -> &Readings<'a> {
        &self.readings
    }

    fn close(&mut self, open: Open) -> Step {
        let step = open.close(self.last_s);
        self.last_s = Some(open.time_s);
        step
    }
}

impl Steps<'_> {
    /// The next step; `seen` takes every reading that was met on the way, also those that no observer reads. A reading that
    /// begins the step after is among them.
    pub fn next_seeing(&mut self, mut seen: impl FnMut(Reading)) -> Option<Result<Step, LogError>> {
        while !self.ended {
            let reading = match self.readings.next() {
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
            let mut open = self.open.unwrap_or(Open::new(reading.stamp_s));
            let Some(place) = open.place(reading.role) else { continue };
            if place.is_some() {
                let mut next = Open::new(reading.stamp_s);
                next.place(reading.role).map(|place| place.replace(reading));
                let step = self.close(open);
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
        self.open.take().map(|open| Ok(self.close(open)))
    }
}

impl Iterator for Steps<'_> {
    type Item = Result<Step, LogError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.next_seeing(drop)
    }
}
