//! A shift of a drive: truth and estimates of it, and what they say together.

use car::{Gear, ShiftCommand};
use drivetrain::ShiftKind;
use observer::Health;
use plant::car::CarShiftQuality;

use crate::errors::ErrorsByPhase;
use crate::shift_comfort::ShiftComfort;
use crate::shift_summary::{ShiftSummary, spans_s};
use crate::{ShiftScoreRow, TruePhase};

/// The drive at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriveState {
    /// Time, s.
    pub time_s: f64,
    /// Gear; during a shift the one that is left.
    pub gear: Gear,
    /// Throttle and brake, 0 to 1.
    pub pedals: [f64; 2],
    /// Vehicle speed, m/s.
    pub vehicle_m_s: f64,
    /// True speeds of engine, turbine and output, rad/s.
    pub speeds_rad_s: [f64; 3],
    /// What the filter says of itself.
    pub health: Health,
}

/// A shift of a drive.
#[derive(Debug, Clone, PartialEq)]
pub struct ScoredShift {
    /// Its number, from 1.
    pub number: usize,
    /// The gear before and the gear after.
    pub gears: ShiftCommand,
    /// Direction and power at the request; `None` without torque, and of a garage shift.
    pub kind: Option<ShiftKind>,
    /// Whether it is a garage shift: from or to neutral, or from one direction to the other. It has no old and new speed of the turbine.
    pub is_garage: bool,
    /// Places of the offgoing and the oncoming element in the gearbox, where there is one.
    pub elements: [Option<usize>; 2],
    /// Time of the request, and of the last row, s.
    pub time_s: [f64; 2],
    /// How it went.
    pub quality: CarShiftQuality,
    /// What the occupants feel of it; `None` of a garage shift, of one that was not completed, and without a speed or acceleration around it.
    pub comfort: Option<ShiftComfort>,
    /// Temperature of the steel plates of the oncoming clutch after it, degC, where their mass and the friction work are known.
    pub plates_degc: Option<f64>,
    /// Truth and estimates; empty where the filter has no tables, and where [`Self::is_drawn`] is false.
    pub rows: Vec<ShiftScoreRow>,
    /// What the rows say together.
    pub summary: ShiftSummary,
    /// Whether what a figure of it needs is kept: its rows, and the states of the drive around it.
    pub is_drawn: bool,
}

impl ScoredShift {
    /// One that is none: its cells have the titles of a table without shifts.
    pub fn none() -> Self {
        Self {
            number: 0,
            gears: ShiftCommand::NEUTRAL,
            kind: None,
            is_garage: false,
            elements: [None; 2],
            time_s: [0.0; 2],
            quality: CarShiftQuality::default(),
            comfort: None,
            plates_degc: None,
            rows: Vec::new(),
            summary: ShiftSummary::default(),
            is_drawn: false,
        }
    }

    /// Leaves out what only its figure needs.
    pub(crate) fn leave_undrawn(&mut self) {
        (self.rows, self.is_drawn) = (Vec::new(), false);
    }

    /// Errors by phase of the controlling and the other clutch; none where the shift has no kind.
    pub fn errors(&self) -> Option<ErrorsByPhase> {
        self.summary.errors
    }

    /// The largest RMS error of the controlling clutch's torque in a phase, N m; zero where the truth is not known.
    pub fn worst_error_n_m(&self) -> f64 {
        let errors = self.errors().unwrap_or_default();
        errors.iter().map(|phase| phase[0].torque.rms_n_m()[0]).fold(0.0, f64::max)
    }

    /// How long a true phase lasts, s.
    pub fn length_s(&self, phase: TruePhase) -> f64 {
        self.summary.lengths_s[usize::from(phase == TruePhase::Inertia)]
    }

    /// Begin and end of every piece of a phase, s; none of a shift that has lost its rows.
    pub fn spans_s(&self, phase: TruePhase) -> Vec<[f64; 2]> {
        spans_s(&self.rows, phase)
    }

    /// Whether the filter has tables for this shift, so that there are estimates.
    pub fn is_estimated(&self) -> bool {
        self.summary.counts.rows > 0
    }

    /// Fraction of the pressures and torques of both clutches that lie within their guaranteed ranges; `None` without estimates.
    pub fn inside(&self) -> Option<f64> {
        let [all, inside] = self.summary.clutches();
        self.is_estimated().then(|| inside as f64 / all as f64)
    }

    /// Fraction of the rows of both phases in which the speeds show nothing of the controlling clutch's torque while it slips; `None`
    /// where there are none.
    pub fn hidden(&self) -> Option<f64> {
        let [slipping, hidden] = self.summary.hidden;
        (slipping > 0).then(|| hidden as f64 / slipping as f64)
    }

    /// Whether the true pressures and torques are known, as in a simulation.
    pub fn has_truth(&self) -> bool {
        self.summary.has_truth
    }

    /// Mean estimate of the inertia phase, and of the ends of its range: pressure of the offgoing (0) or oncoming (1) clutch, Pa.
    pub fn mean_pressure_pa(&self, clutch: usize) -> Option<[f64; 3]> {
        self.summary.mean_pressure_pa[clutch.min(1)]
    }

    /// The same of its torque, N m.
    pub fn mean_torque_n_m(&self, clutch: usize) -> Option<[f64; 3]> {
        self.summary.mean_torque_n_m[clutch.min(1)]
    }

    /// Of a gearbox by its ratios alone: mean torque of the clutches at the turbine in the inertia phase, and the mean of its standard
    /// deviation, N m.
    pub fn mean_at_turbine_n_m(&self) -> Option<[f64; 2]> {
        self.summary.mean_at_turbine_n_m
    }

    /// The worst health and its fraction of the rows; `None` without estimates.
    pub fn worst_health(&self) -> Option<(Health, f64)> {
        let worst = Health::ALL.into_iter().filter(|health| self.summary.rows_with(*health) > 0).max()?;
        Some((worst, self.summary.rows_with(worst) as f64 / self.summary.counts.rows as f64))
    }
}
