//! A whole drive: what the filter says of every shift of it, beside the truth and the valve model alone.

use config::{Car, Sensors};
use design::{ShiftErrors, ShiftTables, any_shift_filter};
use drivetrain::ShiftKind;
use observer::Health;
use plant::car::{CarModel, CarSample, CarShift, CarShiftQuality, CarShiftRating};

use super::matrix::{ErrorsByPhase, Matrix, MatrixRow, MatrixShift, counts, errors_by_phase};
use super::recording::Recording;
use super::{AnyShiftError, SAMPLE_S, ShiftScoreRow, TruePhase, row};

/// The drive at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriveState {
    /// Time, s.
    pub time_s: f64,
    /// Gear; during a shift the one that is left.
    pub gear: usize,
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
    /// The gear before.
    pub from: usize,
    /// The gear after.
    pub to: usize,
    /// Direction and power at the request; `None` without torque.
    pub kind: Option<ShiftKind>,
    /// Places of the offgoing and the oncoming element in the gearbox.
    pub elements: [usize; 2],
    /// Time of the request, and of the last row, s.
    pub time_s: [f64; 2],
    /// How it went.
    pub quality: CarShiftQuality,
    /// Truth and estimates; empty where the filter has no tables.
    pub rows: Vec<ShiftScoreRow>,
}

impl ScoredShift {
    /// Errors by phase of the controlling and the other clutch; none where the shift has no kind.
    pub fn errors(&self) -> Option<ErrorsByPhase> {
        self.kind.map(|kind| errors_by_phase(&self.rows, kind))
    }

    /// How long a true phase lasts, s.
    #[expect(clippy::cast_precision_loss, reason = "fewer rows than a double has integers")]
    pub fn length_s(&self, phase: TruePhase) -> f64 {
        self.rows.iter().filter(|row| row.phase() == Some(phase)).count() as f64 * SAMPLE_S
    }

    /// Begin and end of a true phase, s; `None` where it does not occur. A phase may be interrupted.
    pub fn span_s(&self, phase: TruePhase) -> Option<[f64; 2]> {
        let mut times = self.rows.iter().filter(|row| row.phase() == Some(phase)).map(|row| row.time_s);
        let first_s = times.next()?;
        Some([first_s, times.last().unwrap_or(first_s) + SAMPLE_S])
    }

    /// Share of the pressures and torques of both clutches that lie within their guaranteed ranges; `None` without rows.
    #[expect(clippy::cast_precision_loss, reason = "fewer rows than a double has integers")]
    pub fn inside(&self) -> Option<f64> {
        let clutches = || self.rows.iter().flat_map(|row| &row.clutches);
        let inside = clutches().filter(|clutch| clutch.in_range).count();
        (!self.rows.is_empty()).then(|| inside as f64 / clutches().count() as f64)
    }

    /// The worst health and its share of the rows; `None` without rows.
    #[expect(clippy::cast_precision_loss, reason = "fewer rows than a double has integers")]
    pub fn worst_health(&self) -> Option<(Health, f64)> {
        let worst = self.rows.iter().map(|row| row.health).max()?;
        let share = self.rows.iter().filter(|row| row.health == worst).count() as f64 / self.rows.len() as f64;
        Some((worst, share))
    }
}

/// A drive with its shifts.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ScoredDrive {
    /// Every [`SAMPLE_S`].
    pub states: Vec<DriveState>,
    /// Its shifts.
    pub shifts: Vec<ScoredShift>,
}

impl ScoredDrive {
    /// The shifts as rows of a matrix; those without a kind are left out.
    pub fn matrix(&self, car: &Car) -> Matrix {
        let row = |shift: &ScoredShift| {
            let (from, to, kind) = (shift.from, shift.to, shift.kind?);
            let [i_off, i_on] = [from, to].map(|gear| car.gearbox.gears.get(gear).map_or(f64::NAN, |gear| gear.ratio));
            let errors = errors_by_phase(&shift.rows, kind);
            Some(MatrixRow {
                shift: MatrixShift { from, to, kind, gain: (i_off - i_on).abs().recip() },
                counts: counts(&shift.rows, &errors),
                errors,
                failure: None,
            })
        };
        Matrix { rows: self.shifts.iter().filter_map(row).collect(), without_tables: Vec::new(), draws: 1 }
    }
}

/// A shift that is under way.
struct Open {
    shift: ScoredShift,
    rating: CarShiftRating,
}

impl Open {
    fn new(model: &CarModel, number: usize, sample: &CarSample) -> Option<Self> {
        let under_way = sample.shift.as_ref()?;
        let (from, to) = (under_way.from, under_way.to);
        let ratio = |gear: usize| model.car.gearbox.gears.get(gear).map_or(f64::NAN, |gear| gear.ratio);
        let begun = CarShift { request_s: sample.time_s, ..CarShift::usual(&model.car, from, to, 0.0) };
        let shift = ScoredShift {
            number,
            from,
            to,
            kind: ShiftKind::of(sample.turbine_n_m, ratio(from), ratio(to)),
            elements: [under_way.offgoing.element, under_way.oncoming.element],
            time_s: [sample.time_s; 2],
            quality: CarShiftQuality::default(),
            rows: Vec::new(),
        };
        Some(Self { shift, rating: CarShiftRating::new(model, &begun) })
    }

    /// With the first sample after it.
    fn end(mut self, after: &CarSample) -> ScoredShift {
        self.rating.push(after);
        self.shift.quality = self.rating.quality();
        self.shift
    }
}

/// Lets the filter, which knows the car `known`, estimate a recorded drive of the car `model` through these sensors. One filter serves
/// the whole drive.
///
/// # Errors
/// The gearbox has more clutches than the filter has room for.
pub fn score_drive(
    known: &Car,
    model: &CarModel,
    recording: &Recording,
    sensors: &Sensors,
    seed: u64,
) -> Result<ScoredDrive, AnyShiftError> {
    let errors = ShiftErrors::STANDARD;
    let tables = ShiftTables::of_car(known, &errors).map_err(AnyShiftError::TooManyElements)?;
    let filter = any_shift_filter(known, &tables, &errors, Some(sensors));
    let mut state = filter.start();
    let mut drive = ScoredDrive::default();
    let mut open: Option<Open> = None;
    for (sample, input) in recording.samples.iter().zip(recording.inputs(known, &tables, sensors, seed)) {
        let estimate = filter.step(&mut state, &input);
        let torques = &sample.torques;
        drive.states.push(DriveState {
            time_s: sample.time_s,
            gear: sample.gear,
            pedals: [sample.driver.throttle, sample.driver.brake],
            vehicle_m_s: sample.vehicle_m_s,
            speeds_rad_s: [torques.engine_rad_s, torques.turbine_rad_s, torques.output_rad_s],
            health: estimate.health,
        });
        let goes_on = |open: &mut Open| {
            sample.shift.as_ref().is_some_and(|shift| (shift.from, shift.to) == (open.shift.from, open.shift.to))
        };
        // A change of mind begins another shift.
        if let Some(ended) = open.take_if(|open| !goes_on(open)) {
            drive.shifts.push(ended.end(sample));
        }
        if open.is_none() {
            open = Open::new(model, drive.shifts.len() + 1, sample);
        }
        if let Some(Open { shift, rating }) = &mut open {
            rating.push(sample);
            shift.time_s[1] = sample.time_s;
            shift.rows.extend(row(&tables, sample, &estimate));
        }
    }
    if let (Some(open), Some(last)) = (open, recording.samples.last()) {
        drive.shifts.push(open.end(last));
    }
    Ok(drive)
}
