//! The filter of a car with any gearbox on its way through a log.

use car::{Car, ErrorBudget, Sensors};
use observer::gearbox::{BeyondBounds, GearboxFilter, GearboxState, Learnt, MAX_ELEMENTS, ShiftEstimate};
use observer::{ShiftTables, gearbox_filter};

use crate::drive::ScoredDrive;
use crate::learning_count::LearningCount;
use crate::logged_shifts::LoggedShifts;
use crate::{EvaluateError, LogStep, late_speeds, ratio_errors};

/// A log on its way through the filter, and what it says of its shifts. Both take each row in turn, and the filter needs nothing of the shifts: it may be
/// rows ahead of them.
pub struct LoggedDrive<'c> {
    /// The filter.
    pub filter: LoggedFilter<'c>,
    /// The shifts, and what the readings contradict.
    pub shifts: LoggedShifts<'c>,
}

/// The error budget of a car whose log was recorded with these sensors.
fn logged_budget(car: &Car, sensors: Option<&Sensors>) -> ErrorBudget {
    ErrorBudget::of_logged_car(car).read_by(car, sensors)
}

impl<'c> LoggedDrive<'c> {
    /// The filter of a car with these tables, which are [`Self::tables`] with the same sensors, for readings of these sensors, and with what
    /// was learnt in an earlier log.
    pub fn new(
        car: &'c Car,
        tables: &'c ShiftTables<f64>,
        sensors: Option<&Sensors>,
        learnt: Option<&Learnt<f64>>,
    ) -> Self {
        let budget = logged_budget(car, sensors);
        let filter = gearbox_filter(car, tables, &budget, sensors);
        let state = learnt.map_or_else(|| filter.start(), |learnt| filter.start_with(learnt));
        Self {
            filter: LoggedFilter { filter, state, learning: LearningCount::of(state.learnt()) },
            shifts: LoggedShifts::new(car, tables, &budget),
        }
    }

    /// The same where engine, turbine, output and wheel speed and the longitudinal acceleration come later by these times, s, than their sensors
    /// do.
    #[must_use]
    pub fn with_delays(mut self, delays_s: [f64; 5]) -> Self {
        let [engine, of_gearbox @ .., acceleration] = delays_s;
        let filter = &mut self.filter.filter;
        filter.engine.0.delay_s += engine;
        for (reading, delay_s) in filter.readings.iter_mut().zip(of_gearbox) {
            reading.delay_s += delay_s;
        }
        filter.acceleration.delay_s += acceleration;
        self
    }

    /// The same without the states of the drive, which need memory and which a page alone draws.
    #[must_use]
    pub fn without_states(mut self) -> Self {
        self.shifts.keep_no_states();
        self
    }

    /// The tables of a car behind these sensors.
    ///
    /// # Errors
    /// The gearbox has more clutches than the filter has room for.
    pub fn tables(car: &Car, sensors: Option<&Sensors>) -> Result<ShiftTables<f64>, EvaluateError> {
        ShiftTables::of_car(car, &logged_budget(car, sensors)).map_err(EvaluateError::TooManyElements)
    }

    /// Takes a row and returns the estimate for it.
    pub fn push(&mut self, step: &LogStep) -> ShiftEstimate<f64> {
        let mut filtered = self.filter.step(step);
        self.shifts.push(step, &mut filtered);
        filtered.estimate
    }

    /// The drive.
    pub fn finish(self) -> ScoredDrive {
        let found = self.filter.not_as_stated(&self.shifts);
        self.shifts.finish(found)
    }
}

/// The filter of a car with its state, and what it learns.
pub struct LoggedFilter<'c> {
    filter: GearboxFilter<'c, f64>,
    state: GearboxState<f64>,
    learning: LearningCount,
}

/// What the filter makes of a row.
#[derive(Debug, Clone, Copy)]
pub struct Filtered {
    /// The estimate.
    pub estimate: ShiftEstimate<f64>,
    /// Guaranteed range of the pressure of each element, Pa, by its place in the filter's tables.
    pub pressure_ranges_pa: [Option<[f64; 2]>; MAX_ELEMENTS],
    /// A quantity that the shifts up to now show beyond the bound of its error.
    pub beyond_bounds: Option<BeyondBounds<f64>>,
}

impl<'c> LoggedFilter<'c> {
    /// Takes a row.
    pub fn step(&mut self, step: &LogStep) -> Filtered {
        if let Some(degc) = step.oil_degc {
            self.state.take_oil_temperature(degc);
        }
        let estimate = self.filter.step(&mut self.state, &step.input);
        self.learning.push(self.state.learnt());
        Filtered {
            estimate,
            pressure_ranges_pa: core::array::from_fn(|at| self.filter.pressure_range_pa(&self.state, at)),
            beyond_bounds: self.filter.beyond_bounds(&self.state),
        }
    }

    /// The filter, what it has learnt up to now, and from how many shifts of the log.
    pub fn learnt(&self) -> (&GearboxFilter<'c, f64>, &Learnt<f64>, LearningCount) {
        (&self.filter, self.state.learnt(), self.learning)
    }

    /// Readings that are not as is stated, in sentences: late ones, and speeds that do not have the ratios of the gears.
    fn not_as_stated(&self, shifts: &LoggedShifts<'_>) -> Vec<String> {
        // In a gear that slips the speeds have no ratio.
        let gears = shifts.car().gearbox.gears.iter().enumerate().filter(|(place, _)| !shifts.slips_in(*place));
        let ratios = gears.filter_map(|(place, gear)| Some((gear.name.as_str(), self.state.ratio_error(place)?)));
        let speeds = late_speeds::warnings(self.state.speeds_late_s(), self.filter.longest_found_s());
        let acceleration = late_speeds::acceleration_warning(self.state.acceleration_late_s());
        speeds.chain(acceleration).chain(ratio_errors::warning(ratios)).collect()
    }
}
