//! Drives: what the driver and the road do, and when the gearbox shifts.

use drivetrain::Table1;

use crate::{Fault, Sensors, SpeedTrace};

/// A piece of a drive. Each value changes linearly from the first to the second number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriveSegment {
    /// Its length, s.
    pub duration_s: f64,
    /// Throttle, 0 to 1.
    pub throttle: [f64; 2],
    /// Brake, 0 to 1: fraction of the largest force of the tyres.
    pub brake: [f64; 2],
    /// Grade, rad, positive uphill.
    pub grade_rad: [f64; 2],
}

/// When the gearbox shifts.
#[derive(Debug, Clone, PartialEq)]
pub enum ShiftPlan {
    /// By throttle and speed of the gearbox input.
    Schedule(Box<ShiftSchedule>),
    /// At given times, in rising order: time, s, and name of the gear.
    Listed(Vec<(f64, String)>),
}

/// Lines of a shift schedule.
#[derive(Debug, Clone, PartialEq)]
pub struct ShiftSchedule {
    /// Input speed above which the next gear is taken, over throttle, rad/s.
    pub up_rad_s: Table1<f64>,
    /// Input speed below which the gear below is taken, over throttle, rad/s.
    pub down_rad_s: Table1<f64>,
    /// Minimum time in a gear, s.
    pub time_in_gear_s: f64,
}

/// Calibration of the shift controller of a simulated car.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ControllerCalibration {
    /// Short shifts, one set of numbers for all of them: that of all documented estimates.
    Bench,
    /// For the comfort of the occupants.
    Comfort,
}

impl ControllerCalibration {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Bench, Self::Comfort];

    /// Its name in a drive file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bench => "bench",
            Self::Comfort => "comfort",
        }
    }
}

/// A drive.
#[derive(Debug, Clone, PartialEq)]
pub struct Drive {
    /// Its name, also that of its results.
    pub name: String,
    /// Time between two rows of the results, s.
    pub sample_time_s: f64,
    /// Gear at the start; the first of the gearbox if the file names none.
    pub start_gear: Option<String>,
    /// Vehicle speed at the start, m/s.
    pub start_m_s: f64,
    /// The pieces; none where the speed is given.
    pub segments: Vec<DriveSegment>,
    /// The speed that a driver model follows.
    pub trace: Option<SpeedTrace>,
    /// How often they, or the speeds, are driven.
    pub repetitions: u32,
    /// When the gearbox shifts.
    pub shifts: ShiftPlan,
    /// How it shifts.
    pub controller: ControllerCalibration,
    /// What breaks on the way.
    pub faults: Vec<Fault>,
    /// The sensors that the measured signals go through; without them a car measures exactly.
    pub sensors: Option<Sensors>,
}

impl Drive {
    /// Length of the drive, s.
    pub fn duration_s(&self) -> f64 {
        let once_s = match &self.trace {
            Some(trace) => trace.duration_s(),
            None => self.segments.iter().map(|segment| segment.duration_s).sum(),
        };
        f64::from(self.repetitions) * once_s
    }
}
