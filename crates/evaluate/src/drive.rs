//! A whole drive: what the filter says of every shift of it, beside the truth and the valve model alone.

use car::{Car, Sensors};
use car::{ErrorBudget, ShiftCommand};
use drivetrain::ShiftKind;
use observer::Health;
use observer::gearbox::{GearboxFilter, GearboxState, ShiftInput};
use observer::{ShiftTables, gearbox_filter};
use plant::car::{CarModel, CarSample, CarShiftQuality, CarShiftRating};

use crate::checks::is_of_its_gears;
use crate::felt_shift::{FeltShift, Motion};
use crate::plate_temperature::PlateTemperatures;
use crate::recording::Recording;
use crate::score::{row, true_row};
pub use crate::scored_shift::{DriveState, ScoredShift};
use crate::shift_comfort::{AccelerationSource, ShiftComfort};
use crate::shift_summary::ShiftSummary;
use crate::thinned::thinned;
use crate::worth_a_look::chosen;
use crate::{EvaluateError, ShiftScoreRow};

/// States that a drive keeps, unless more than half of them lie around its shifts: more than an hour every [`crate::SAMPLE_S`].
pub const MAX_STATES: u32 = 400_000;

/// A drive with its shifts.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ScoredDrive {
    /// Every [`crate::SAMPLE_S`], unless they are left out; of a drive of more than [`MAX_STATES`] those that are kept: fewer where nothing happens.
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
}

/// Shifts that begin and end while a drive goes by.
#[derive(Debug, Default)]
pub(crate) struct PassingShifts {
    pub(crate) drive: ScoredDrive,
    pub(crate) open: Option<ScoredShift>,
    plates: PlateTemperatures,
    /// Whether no states are kept.
    is_stateless: bool,
    /// States that were left when some were left out the last time.
    left: usize,
    /// Shifts that are drawn, by their places, as far as it is decided; and how many shifts it is decided of.
    drawn: Vec<usize>,
    decided: usize,
    /// Shifts that are wanted among these, and whether the truth is known of any.
    wanted: usize,
    has_truth: bool,
}

impl PassingShifts {
    /// Keeps no states from here on.
    pub(crate) fn keep_no_states(&mut self) {
        self.is_stateless = true;
    }

    /// Takes the next state of the drive.
    pub(crate) fn state(&mut self, state: DriveState) {
        if self.is_stateless {
            return;
        }
        let states = &mut self.drive.states;
        states.push(state);
        if states.len() >= (MAX_STATES as usize).max(2 * self.left) {
            let under_way = self.open.as_ref().map(|open| [open.time_s[0], f64::INFINITY]);
            let drawn = self.drive.shifts.iter().filter(|shift| shift.is_drawn);
            let shifts_s = drawn.map(|shift| shift.time_s).chain(under_way);
            *states = thinned(states, shifts_s, MAX_STATES / 4);
            self.left = states.len();
        }
    }

    /// Whether a shift ends with the first row that is in a gear or in this other shift. A change of mind begins another shift.
    pub(crate) fn ends(&self, gears: Option<ShiftCommand>) -> bool {
        self.open.as_ref().is_some_and(|open| gears != Some(open.gears))
    }

    /// Gives its jerk to the shift that ended last, m/s^3, where it is known.
    pub(crate) fn take_jerk(&mut self, jerk_m_s3: Option<f64>) {
        if let Some((jerk_m_s3, shift)) = jerk_m_s3.zip(self.drive.shifts.last_mut()) {
            shift.quality.jerk_m_s3 = jerk_m_s3;
        }
    }

    /// Gives what was felt to the shift that ended last, where it is known.
    pub(crate) fn take_comfort(&mut self, comfort: Option<ShiftComfort>) {
        if let Some((comfort, shift)) = comfort.zip(self.drive.shifts.last_mut()).filter(|(_, shift)| !shift.is_garage)
        {
            shift.comfort = Some(comfort);
        }
    }

    /// Ends the open shift of a car with oil of this temperature, degC.
    pub(crate) fn end(&mut self, car: &Car, oil_degc: f64, mut quality: CarShiftQuality) {
        let Some(shift) = self.open.take() else { return };
        if shift.is_garage {
            (quality.flare_rad_s, quality.past_synchronous_rad_s) = (f64::NAN, f64::NAN);
        }
        let mut summary = ShiftSummary::of(&shift.rows, shift.kind);
        let [begin_s, end_s] = shift.time_s;
        if !is_of_its_gears(shift.kind, &quality, end_s - begin_s) {
            summary.friction_work_j = [None; 2];
        }
        let [_, plates_degc] = [0, 1].map(|clutch| {
            let (element, [work_j, ..]) = shift.elements[clutch].zip(summary.friction_work_j[clutch])?;
            self.plates.heated(car, element, work_j, end_s, oil_degc)
        });
        self.drive.shifts.push(ScoredShift { quality, summary, plates_degc, ..shift });
    }

    /// Keeps what figures need of at most so many of the shifts that are wanted: those with the largest errors, of equal ones the first; where
    /// the truth is not known, those that are worth a look ([`crate::worth_a_look`]). In the end they are the same ones however often it is called.
    pub(crate) fn draw_at_most(&mut self, maximum: usize, is_wanted: impl Fn(&ScoredShift) -> bool) {
        let shifts = &mut self.drive.shifts;
        for at in self.decided..shifts.len() {
            if is_wanted(&shifts[at]) {
                self.drawn.push(at);
            } else {
                shifts[at].leave_undrawn();
            }
            self.has_truth |= shifts[at].has_truth();
            self.wanted += usize::from(self.drawn.last() == Some(&at));
            if self.wanted > maximum && maximum > 0 && !self.has_truth {
                let kept = chosen(shifts, &self.drawn);
                let left = self.drawn.iter().filter(|place| !kept.contains(place));
                left.for_each(|place| shifts[*place].leave_undrawn());
                self.drawn = kept;
            }
            if self.drawn.len() > maximum {
                let error = |place: &usize| shifts[self.drawn[*place]].worst_error_n_m();
                // The first of equal ones is the last of these, which is left out.
                let minimum = (0..self.drawn.len()).rev().min_by(|a, b| error(a).total_cmp(&error(b)));
                if let Some(place) = minimum {
                    shifts[self.drawn.remove(place)].leave_undrawn();
                }
            }
        }
        self.decided = shifts.len();
    }

    /// Begins a shift. The turbine torque tells its kind.
    pub(crate) fn begin(
        &mut self,
        car: &Car,
        gears: ShiftCommand,
        elements: [Option<usize>; 2],
        (time_s, turbine_n_m): (f64, f64),
    ) {
        let [from, to] = [gears.from, gears.to].map(|gear| car.ratio(gear).unwrap_or(f64::NAN));
        self.open = Some(ScoredShift {
            number: self.drive.shifts.len() + 1,
            gears,
            kind: ShiftKind::of(turbine_n_m, from, to),
            is_garage: !same_direction(from, to),
            elements,
            time_s: [time_s; 2],
            quality: CarShiftQuality::default(),
            comfort: None,
            plates_degc: None,
            rows: Vec::new(),
            summary: ShiftSummary::default(),
            is_drawn: true,
        });
    }
}

/// Slips of these gears at these speeds of turbine and output, rad/s at the turbine; not a number of neutral.
pub(crate) fn slips_rad_s(car: &Car, gears: ShiftCommand, [turbine, output]: [f64; 2]) -> [f64; 2] {
    [gears.from, gears.to].map(|gear| turbine - car.ratio(gear).unwrap_or(f64::NAN) * output)
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
) -> Result<ScoredDrive, EvaluateError> {
    let budget = ErrorBudget::of_car(known).read_by(known, Some(sensors));
    let tables = ShiftTables::of_car(known, &budget).map_err(EvaluateError::TooManyElements)?;
    let filter = gearbox_filter(known, &tables, &budget, Some(sensors));
    let mut scorer = DriveScorer::new(known, model, &tables, &filter);
    for (sample, input) in recording.samples.iter().zip(recording.inputs(known, &tables, sensors, seed)) {
        scorer.push(sample, &input);
    }
    Ok(scorer.finish())
}

/// Scores the estimates of a drive row by row.
pub struct DriveScorer<'a> {
    tables: &'a ShiftTables<f64>,
    filter: &'a GearboxFilter<'a, f64>,
    state: GearboxState<f64>,
    shifts: SimulatedShifts<'a>,
}

impl<'a> DriveScorer<'a> {
    /// Of the filter of the car `known`, on a drive of the car `model`.
    pub fn new(
        known: &'a Car,
        model: &'a CarModel,
        tables: &'a ShiftTables<f64>,
        filter: &'a GearboxFilter<'a, f64>,
    ) -> Self {
        Self { tables, filter, state: filter.start(), shifts: SimulatedShifts::new(known, model) }
    }

    /// Takes the next sample and what the filter is shown of it.
    pub fn push(&mut self, sample: &CarSample, input: &ShiftInput<f64>) {
        let estimate = self.filter.step(&mut self.state, input);
        self.shifts.passing.state(state_of(sample, estimate.health));
        self.shifts.push_with(sample, || row(self.tables, sample, &estimate));
    }

    /// The drive.
    pub fn finish(self) -> ScoredDrive {
        self.shifts.finished().drive
    }
}

/// The shifts of a simulated drive as they pass: how each went and what the occupants feel of it.
pub struct SimulatedShifts<'a> {
    car: &'a Car,
    model: &'a CarModel,
    passing: PassingShifts,
    rating: Option<CarShiftRating>,
    felt: FeltShift,
    last: Option<CarSample>,
}

impl<'a> SimulatedShifts<'a> {
    /// Of a drive of the car `model`, with gears and plates of `car`.
    pub fn new(car: &'a Car, model: &'a CarModel) -> Self {
        let felt = FeltShift::of(AccelerationSource::Vehicle);
        Self { car, model, passing: PassingShifts::default(), rating: None, felt, last: None }
    }

    /// Takes the next sample. Friction work is that of the true torques; there are no estimates.
    pub fn push(&mut self, sample: &CarSample) {
        self.push_with(sample, || true_row(sample));
        self.passing.draw_at_most(0, |_| false);
    }

    /// The shifts.
    pub fn finish(self) -> Vec<ScoredShift> {
        let mut passing = self.finished();
        passing.draw_at_most(0, |_| false);
        passing.drive.shifts
    }

    fn push_with(&mut self, sample: &CarSample, row: impl FnOnce() -> Option<ShiftScoreRow>) {
        let Self { car, passing, rating, felt, .. } = self;
        self.last = Some(*sample);
        let shown = sample.gears();
        let gears = Some(shown).filter(|shown| !shown.is_steady());
        if passing.ends(gears) {
            end(car, passing, rating, sample);
            let complete = passing.drive.shifts.last().filter(|shift| shift.quality.complete_s.is_some());
            felt.end(complete.map(|_| sample.time_s));
        }
        if passing.open.is_none() && gears.is_some() {
            passing.take_comfort(felt.begin(sample.time_s));
        }
        felt.push(Motion {
            time_s: sample.time_s,
            value: sample.vehicle_m_s2,
            slips_rad_s: slips_rad_s(car, shown, [sample.torques.turbine_rad_s, sample.torques.output_rad_s]),
        });
        passing.take_comfort(felt.ended(sample.time_s));
        if gears.is_none() {
            return;
        }
        if passing.open.is_none() {
            let elements = sample.shift.as_ref().map_or([None; 2], |under_way| {
                let offgoing = (!under_way.is_from_neutral).then_some(under_way.offgoing.element);
                [offgoing, Some(under_way.oncoming.element)]
            });
            passing.begin(car, shown, elements, (sample.time_s, sample.turbine_n_m));
            *rating = Some(CarShiftRating::new(self.model, shown, sample.time_s));
        }
        if let (Some(shift), Some(rating)) = (&mut passing.open, rating) {
            rating.push(sample);
            shift.time_s[1] = sample.time_s;
            shift.rows.extend(row());
        }
    }

    /// The drive with its last shift.
    fn finished(mut self) -> PassingShifts {
        let comfort = self.felt.finish();
        self.passing.take_comfort(comfort);
        if let Some(last) = &self.last {
            end(self.car, &mut self.passing, &mut self.rating, last);
        }
        self.passing
    }
}

/// Ends the open shift with the first sample after it.
fn end(car: &Car, passing: &mut PassingShifts, rating: &mut Option<CarShiftRating>, after: &CarSample) {
    if let Some(mut rating) = rating.take() {
        rating.push(after);
        passing.end(car, car.oil_temperature_degc, rating.quality());
    }
}

fn state_of(sample: &CarSample, health: Health) -> DriveState {
    let torques = &sample.torques;
    DriveState {
        time_s: sample.time_s,
        gear: sample.gears().from,
        pedals: [sample.driver.throttle, sample.driver.brake],
        vehicle_m_s: sample.vehicle_m_s,
        speeds_rad_s: [torques.engine_rad_s, torques.turbine_rad_s, torques.output_rad_s],
        health,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ClutchRow, ShiftScoreRow, TruePhase};

    /// Ten rows of an inertia phase, then ten in which one clutch holds; the torque is wrong by this.
    fn rows(error_n_m: f64) -> Vec<ShiftScoreRow> {
        let clutch = |sticks: bool, truth_n_m: f64| ClutchRow {
            torque_n_m: [truth_n_m, truth_n_m + error_n_m, truth_n_m],
            torque_std_dev_n_m: 5.0,
            pressure_std_dev_pa: 2e4,
            pressure_pa: [3e5, 3.1e5, 3e5],
            sticks,
            slip_rad_s: if sticks { 0.0 } else { 20.0 },
            slip_range_rad_s: None,
            alpha: 1.0,
            drag_n_m: 0.0,
            has_pressure: true,
            torque_range_n_m: Some([0.0, 200.0]),
            pressure_range_pa: Some([2e5, 4e5]),
            hidden: truth_n_m > 105.0,
            in_range: truth_n_m < 108.0,
        };
        let row = |at: u32| ShiftScoreRow {
            time_s: 5.0 + 0.01 * f64::from(at),
            clutches: [clutch(at > 9, 50.0), clutch(false, 100.0 + f64::from(at))],
            turbine_n_m: [90.0; 2],
            at_turbine_n_m: None,
            speeds_rad_s: [200.0, 190.0, 100.0, 30.0],
            flare_rad_s: 0.0,
            phase: "-",
            health: if at == 3 { Health::Flare } else { Health::Good },
        };
        (0..20).map(row).collect()
    }

    fn shift(number: usize, error_n_m: f64) -> ScoredShift {
        let (rows, kind) = (rows(error_n_m), Some(ShiftKind::PowerOnUp));
        ScoredShift {
            number,
            gears: ShiftCommand::between(1, 2),
            kind,
            is_garage: false,
            elements: [Some(0), Some(1)],
            time_s: [5.0, 5.2],
            quality: CarShiftQuality::default(),
            comfort: None,
            plates_degc: None,
            summary: ShiftSummary::of(&rows, kind),
            rows,
            is_drawn: true,
        }
    }

    #[test]
    fn the_worst_shifts_stay_drawn_however_often_the_others_are_left_out() {
        let errors = [3.0, 1.0, 4.0, 1.0, 5.0, 9.0, 2.0, 6.0, 5.0, 3.0, 5.0];
        let is_wanted = |shift: &ScoredShift| shift.number != 6;
        let drawn = |each: bool, maximum: usize| {
            let mut passing = PassingShifts::default();
            for (at, error_n_m) in errors.into_iter().enumerate() {
                passing.drive.shifts.push(shift(at + 1, error_n_m));
                if each {
                    passing.draw_at_most(maximum, is_wanted);
                }
            }
            passing.draw_at_most(maximum, is_wanted);
            let shifts = &passing.drive.shifts;
            assert!(shifts.iter().all(|shift| shift.is_drawn != shift.rows.is_empty() && shift.is_estimated()));
            shifts.iter().filter(|shift| shift.is_drawn).map(|shift| shift.number).collect::<Vec<_>>()
        };
        // The sixth is the worst and not wanted; of three with 5 N m the first two.
        assert_eq!(drawn(true, 3), [5, 8, 9]);
        assert_eq!(drawn(false, 3), [5, 8, 9]);
        // Of both with 3 N m the first.
        assert_eq!(drawn(true, 6), [1, 3, 5, 8, 9, 11]);
        assert_eq!(drawn(true, 0), [0; 0]);
        assert_eq!(drawn(true, 60), [1, 2, 3, 4, 5, 7, 8, 9, 10, 11]);
    }

    /// Rows without truth whose estimate is so far from the valve model, of this health.
    fn unknown(number: usize, (away_n_m, width_n_m, health): (f64, f64, Health), kind: ShiftKind) -> ScoredShift {
        let mut rows = rows(0.0);
        for row in &mut rows {
            for clutch in &mut row.clutches {
                clutch.torque_n_m = [f64::NAN, 50.0 + away_n_m, 50.0];
                clutch.torque_range_n_m = Some([0.0, width_n_m]);
            }
            row.health = health;
        }
        ScoredShift { summary: ShiftSummary::of(&rows, Some(kind)), rows, kind: Some(kind), ..shift(number, 0.0) }
    }

    #[test]
    fn of_a_drive_without_truth_the_shifts_with_the_most_to_see_stay_drawn() {
        let usual = (1.0, 10.0, Health::Good);
        let with = |number: usize| match number {
            71 => unknown(71, (30.0, 10.0, Health::Good), ShiftKind::PowerOnUp),
            83 => unknown(83, (1.0, 80.0, Health::Good), ShiftKind::PowerOnUp),
            90 => unknown(90, (1.0, 10.0, Health::Flare), ShiftKind::PowerOnUp),
            95 | 96 => unknown(number, usual, ShiftKind::CoastDown),
            _ => unknown(number, usual, ShiftKind::PowerOnUp),
        };
        let drawn = |each: bool, count: usize| {
            let mut passing = PassingShifts::default();
            for number in 1..=count {
                passing.drive.shifts.push(with(number));
                if each {
                    passing.draw_at_most(60, |_| true);
                }
            }
            passing.draw_at_most(60, |_| true);
            let shifts = passing.drive.shifts.iter();
            shifts.filter(|shift| shift.is_drawn).map(|shift| shift.number).collect::<Vec<_>>()
        };
        assert_eq!(drawn(true, 60), (1..=60).collect::<Vec<_>>());
        // The widest and the furthest with 17 usual ones each, the remarked one, and the first coasting one.
        let maximum: Vec<usize> = (1..=17).chain([71, 83, 90, 95]).collect();
        assert_eq!(drawn(true, 100), maximum);
        assert_eq!(drawn(false, 100), maximum);
    }

    #[test]
    fn a_shift_that_has_lost_its_rows_says_the_same_in_the_table() {
        let whole = shift(1, 7.0);
        let mut left = whole.clone();
        left.leave_undrawn();
        let said = |shift: &ScoredShift| {
            let phases = [TruePhase::Torque, TruePhase::Inertia].map(|phase| shift.length_s(phase));
            let means = (shift.mean_pressure_pa(1), shift.mean_torque_n_m(0));
            (shift.errors(), phases, shift.inside(), shift.hidden(), shift.has_truth(), means, shift.worst_health())
        };
        assert_eq!(said(&left), said(&whole));
        assert!((whole.worst_error_n_m() - 7.0).abs() < 1e-9);
        let [torque_s, inertia_s] = [TruePhase::Torque, TruePhase::Inertia].map(|phase| whole.length_s(phase));
        assert!((torque_s - 0.1).abs() < 1e-9 && (inertia_s - 0.1).abs() < 1e-9);
        // Both clutches of the first eight rows, and one of the others; hidden from the seventh on.
        assert_eq!((whole.inside(), whole.hidden()), (Some(28.0 / 40.0), Some(14.0 / 20.0)));
        assert_eq!(whole.worst_health(), Some((Health::Flare, 0.05)));
        let drive = ScoredDrive { shifts: vec![left], ..ScoredDrive::default() };
        let other = ScoredDrive { shifts: vec![whole], ..ScoredDrive::default() };
        assert!(drive.has_truth() && other.has_truth());
    }
}
