//! A whole drive: what the filter says of every shift of it, beside the truth and the valve model alone.

use config::{Car, Sensors};
use design::{ShiftErrors, ShiftTables, any_shift_filter};
use drivetrain::ShiftKind;
use observer::Health;
use observer::any_shift::{AnyShiftFilter, AnyShiftState, ShiftInput};
use plant::car::{CarModel, CarSample, CarShift, CarShiftQuality, CarShiftRating, NO_GEAR};

use super::matrix::{ErrorsByPhase, Matrix, MatrixRow, MatrixShift, controlling_of, counts, errors_by_phase};
use super::recording::Recording;
use super::thinned::thinned;
use super::{AnyShiftError, ClutchRow, ShiftScoreRow, TruePhase, row};

/// The place of no element among those of the gearbox.
pub(super) const NO_ELEMENT: usize = usize::MAX;

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
    /// Direction and power at the request; `None` without torque, and of a garage shift.
    pub kind: Option<ShiftKind>,
    /// Whether it is a garage shift: from or to neutral, or from one direction to the other. It has no old and new speed of the turbine.
    pub is_garage: bool,
    /// Places of the offgoing and the oncoming element in the gearbox; that of no element where there is none.
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
    pub fn length_s(&self, phase: TruePhase) -> f64 {
        self.spans_s(phase).iter().fold(0.0, |length_s, [from_s, to_s]| length_s + (to_s - from_s))
    }

    /// Begin and end of every piece of a phase, s.
    pub fn spans_s(&self, phase: TruePhase) -> Vec<[f64; 2]> {
        // A row lasts until the next one; the last one, and one behind which rows are missing, as long as is usual.
        const MISSING: f64 = 2.5;
        let steps_s = self.rows.windows(2).map(|pair| pair[1].time_s - pair[0].time_s).collect();
        let usual_s =
            Some(trace::median_step_s(steps_s)).filter(|step_s| step_s.is_finite()).unwrap_or(super::SAMPLE_S);
        let end_s = |at: usize| {
            let next = self.rows.get(at + 1).map(|next| next.time_s);
            next.filter(|next| *next <= self.rows[at].time_s + MISSING * usual_s)
                .unwrap_or(self.rows[at].time_s + usual_s)
        };
        let mut spans: Vec<[f64; 2]> = Vec::new();
        for (at, row) in self.rows.iter().enumerate().filter(|(_, row)| row.phase() == Some(phase)) {
            match spans.last_mut().filter(|[_, to_s]| *to_s == row.time_s) {
                Some(span) => span[1] = end_s(at),
                None => spans.push([row.time_s, end_s(at)]),
            }
        }
        spans
    }

    /// Share of the pressures and torques of both clutches that lie within their guaranteed ranges; `None` without rows.
    #[expect(clippy::cast_precision_loss, reason = "fewer rows than a double has integers")]
    pub fn inside(&self) -> Option<f64> {
        let clutches = || self.rows.iter().flat_map(|row| &row.clutches);
        let inside = clutches().filter(|clutch| clutch.in_range).count();
        (!self.rows.is_empty()).then(|| inside as f64 / clutches().count() as f64)
    }

    /// Share of the rows of both phases in which the speeds show nothing of the controlling clutch's torque while it slips; `None`
    /// where there are none.
    #[expect(clippy::cast_precision_loss, reason = "fewer rows than a double has integers")]
    pub fn hidden(&self) -> Option<f64> {
        let clutch = controlling_of(&self.rows, self.kind?);
        let rows = self.rows.iter().filter(|row| row.phase().is_some()).map(|row| &row.clutches[clutch]);
        let slipping: Vec<bool> = rows.filter(|clutch| !clutch.sticks).map(|clutch| clutch.hidden).collect();
        let hidden = slipping.iter().filter(|hidden| **hidden).count();
        (!slipping.is_empty()).then(|| hidden as f64 / slipping.len() as f64)
    }

    /// Whether the true pressures and torques are known, as in a simulation.
    pub fn has_truth(&self) -> bool {
        self.rows.iter().any(|row| row.clutches[0].torque_n_m[0].is_finite())
    }

    /// Mean estimate of the inertia phase, and of the ends of its range: pressure of the offgoing (0) or oncoming (1) clutch, Pa.
    pub fn mean_pressure_pa(&self, clutch: usize) -> Option<[f64; 3]> {
        self.mean(clutch, |clutch| (clutch.pressure_pa[1], clutch.pressure_range_pa))
    }

    /// The same of its torque, N m.
    pub fn mean_torque_n_m(&self, clutch: usize) -> Option<[f64; 3]> {
        self.mean(clutch, |clutch| (clutch.torque_n_m[1], clutch.torque_range_n_m))
    }

    #[expect(clippy::cast_precision_loss, reason = "fewer rows than a double has integers")]
    fn mean(&self, clutch: usize, of: impl Fn(&ClutchRow) -> (f64, Option<[f64; 2]>)) -> Option<[f64; 3]> {
        let (mut sum, mut count) = ([0.0; 3], 0_usize);
        for row in self.rows.iter().filter(|row| row.phase() == Some(TruePhase::Inertia)) {
            let (value, range) = of(&row.clutches[clutch.min(1)]);
            let [low, high] = range.unwrap_or([f64::NAN; 2]);
            [value, low, high].iter().zip(&mut sum).for_each(|(value, sum)| *sum += value);
            count += 1;
        }
        (count > 0).then(|| sum.map(|sum| sum / count as f64))
    }

    /// The worst health and its share of the rows; `None` without rows.
    #[expect(clippy::cast_precision_loss, reason = "fewer rows than a double has integers")]
    pub fn worst_health(&self) -> Option<(Health, f64)> {
        let worst = self.rows.iter().map(|row| row.health).max()?;
        let share = self.rows.iter().filter(|row| row.health == worst).count() as f64 / self.rows.len() as f64;
        Some((worst, share))
    }
}

/// States that a drive keeps, unless more than half of them lie around its shifts: more than an hour every [`super::SAMPLE_S`].
pub const MOST_STATES: u32 = 400_000;

/// A drive with its shifts.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ScoredDrive {
    /// Every [`super::SAMPLE_S`]; of a drive of more than [`MOST_STATES`] those that are kept: fewer where nothing happens.
    pub states: Vec<DriveState>,
    /// Its shifts.
    pub shifts: Vec<ScoredShift>,
    /// What in a log contradicts its channels or makes a shift incomplete, in sentences.
    pub warnings: Vec<String>,
}

impl ScoredDrive {
    /// Whether the true pressures and torques are known, as in a simulation.
    pub fn has_truth(&self) -> bool {
        self.shifts.iter().any(ScoredShift::has_truth)
    }

    /// The same drive on a clock that began at this time of the log's, s.
    pub fn earlier_by(mut self, origin_s: f64) -> Self {
        self.states.iter_mut().for_each(|state| state.time_s -= origin_s);
        for shift in &mut self.shifts {
            shift.time_s.iter_mut().for_each(|time_s| *time_s -= origin_s);
            shift.rows.iter_mut().for_each(|row| row.time_s -= origin_s);
        }
        self
    }

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

/// Shifts that begin and end while a drive goes by.
#[derive(Debug, Default)]
pub(super) struct PassingShifts {
    pub(super) drive: ScoredDrive,
    pub(super) open: Option<ScoredShift>,
    /// States that were left when some were left out the last time.
    left: usize,
}

impl PassingShifts {
    /// Takes the next state of the drive.
    pub(super) fn state(&mut self, state: DriveState) {
        let states = &mut self.drive.states;
        states.push(state);
        if states.len() >= (MOST_STATES as usize).max(2 * self.left) {
            let under_way = self.open.as_ref().map(|open| [open.time_s[0], f64::INFINITY]);
            let shifts_s = self.drive.shifts.iter().map(|shift| shift.time_s).chain(under_way);
            *states = thinned(states, shifts_s, MOST_STATES / 4);
            self.left = states.len();
        }
    }

    /// Whether a shift ends with the first row that is in a gear or in this other shift. A change of mind begins another shift.
    pub(super) fn ends(&self, gears: Option<[usize; 2]>) -> bool {
        self.open.as_ref().is_some_and(|open| gears != Some([open.from, open.to]))
    }

    pub(super) fn end(&mut self, mut quality: CarShiftQuality) {
        if self.open.as_ref().is_some_and(|open| open.is_garage) {
            (quality.flare_rad_s, quality.past_synchronous_rad_s) = (f64::NAN, f64::NAN);
        }
        self.drive.shifts.extend(self.open.take().map(|shift| ScoredShift { quality, ..shift }));
    }

    /// Begins a shift. The turbine torque tells its kind.
    pub(super) fn begin(
        &mut self,
        car: &Car,
        [from, to]: [usize; 2],
        elements: [usize; 2],
        (time_s, turbine_n_m): (f64, f64),
    ) {
        let ratio = |gear: usize| car.gearbox.gears.get(gear).map_or(f64::NAN, |gear| gear.ratio);
        self.open = Some(ScoredShift {
            number: self.drive.shifts.len() + 1,
            from,
            to,
            kind: ShiftKind::of(turbine_n_m, ratio(from), ratio(to)),
            is_garage: !same_direction(ratio(from), ratio(to)),
            elements,
            time_s: [time_s; 2],
            quality: CarShiftQuality::default(),
            rows: Vec::new(),
        });
    }
}

/// Whether two ratios are of gears in one direction; neutral has no number.
fn same_direction(one: f64, other: f64) -> bool {
    one * other > 0.0
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
    let mut scorer = DriveScorer::new(known, model, &tables, &filter);
    for (sample, input) in recording.samples.iter().zip(recording.inputs(known, &tables, sensors, seed)) {
        scorer.push(sample, &input);
    }
    Ok(scorer.finish())
}

/// Scores the estimates of a drive row by row.
pub struct DriveScorer<'a> {
    known: &'a Car,
    model: &'a CarModel,
    tables: &'a ShiftTables<f64>,
    filter: &'a AnyShiftFilter<'a, f64>,
    state: AnyShiftState<f64>,
    passing: PassingShifts,
    rating: Option<CarShiftRating>,
    last: Option<CarSample>,
}

impl<'a> DriveScorer<'a> {
    /// Of the filter of the car `known`, on a drive of the car `model`.
    pub fn new(
        known: &'a Car,
        model: &'a CarModel,
        tables: &'a ShiftTables<f64>,
        filter: &'a AnyShiftFilter<'a, f64>,
    ) -> Self {
        let (state, passing) = (filter.start(), PassingShifts::default());
        Self { known, model, tables, filter, state, passing, rating: None, last: None }
    }

    /// Takes the next sample and what the filter is shown of it.
    pub fn push(&mut self, sample: &CarSample, input: &ShiftInput<f64>) {
        let Self { known, passing, rating, .. } = self;
        let estimate = self.filter.step(&mut self.state, input);
        passing.state(state_of(sample, estimate.health));
        self.last = Some(*sample);
        let [from, to] = sample.gears().map(|gear| gear.unwrap_or(NO_GEAR));
        let gears = (from != to).then_some([from, to]);
        if passing.ends(gears) {
            end(passing, rating, sample);
        }
        if gears.is_none() {
            return;
        }
        if passing.open.is_none() {
            let elements = sample.shift.as_ref().map_or([NO_ELEMENT; 2], |under_way| {
                let offgoing = if under_way.is_from_neutral { NO_ELEMENT } else { under_way.offgoing.element };
                [offgoing, under_way.oncoming.element]
            });
            passing.begin(known, [from, to], elements, (sample.time_s, sample.turbine_n_m));
            let begun = CarShift { request_s: sample.time_s, ..CarShift::usual(known, from, to, 0.0) };
            *rating = Some(CarShiftRating::new(self.model, &begun));
        }
        if let (Some(shift), Some(rating)) = (&mut passing.open, rating) {
            rating.push(sample);
            shift.time_s[1] = sample.time_s;
            shift.rows.extend(row(self.tables, sample, &estimate));
        }
    }

    /// The drive.
    pub fn finish(mut self) -> ScoredDrive {
        if let Some(last) = &self.last {
            end(&mut self.passing, &mut self.rating, last);
        }
        self.passing.drive
    }
}

/// Ends the open shift with the first sample after it.
fn end(passing: &mut PassingShifts, rating: &mut Option<CarShiftRating>, after: &CarSample) {
    if let Some(mut rating) = rating.take() {
        rating.push(after);
        passing.end(rating.quality());
    }
}

fn state_of(sample: &CarSample, health: Health) -> DriveState {
    let torques = &sample.torques;
    DriveState {
        time_s: sample.time_s,
        gear: sample.gears()[0].unwrap_or(NO_GEAR),
        pedals: [sample.driver.throttle, sample.driver.brake],
        vehicle_m_s: sample.vehicle_m_s,
        speeds_rad_s: [torques.engine_rad_s, torques.turbine_rad_s, torques.output_rad_s],
        health,
    }
}
