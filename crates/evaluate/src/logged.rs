//! The filter of a car with any gearbox on its way through a log, and what it says of the shifts.

use car::{Car, Sensors};
use car::{ErrorBudget, Gear, ShiftCommand};
use observer::gearbox::{ClutchEstimate, GearboxFilter, GearboxState, Learnt, MAX_ELEMENTS, ShiftEstimate, ShiftPhase};
use observer::{Health, Reading};
use observer::{ShiftTables, gearbox_filter};
use plant::car::{BeyondGears, CarShiftQuality};

use crate::LogStep;
use crate::checks::CameSpeed;
use crate::checks::Unusable;
use crate::checks::WrongScale;
use crate::checks::command_delay::CommandDelay;
use crate::checks::contradictions::CommandCheck;
use crate::checks::converter_check::ConverterCheck;
use crate::checks::held_commands::HeldCommands;
use crate::checks::in_gear::{InGear, InGearRow};
use crate::checks::lock_up_check::LockUpCheck;
use crate::checks::log_beside::{CarriedPressures, DoubtedPressures, ShiftJerk, not_of_their_gears};
use crate::checks::still_commands::StillCommands;
use crate::drive::{DriveState, PassingShifts, ScoredDrive, ScoredShift, slips_rad_s};
use crate::felt_shift::{FeltShift, Motion};
use crate::learning_count::LearningCount;
use crate::score::within;
use crate::shift_comfort::AccelerationSource;
use crate::{ClutchRow, EvaluateError, ROUNDING_N_M, ROUNDING_PA, ShiftScoreRow};

/// Slip below which a true clutch sticks, rad/s.
const STICKS_RAD_S: f64 = 0.05;

/// Rows further apart, and three times as far as usual, are a hole in the recording, s \[chosen\]: a phase of a shift may pass in it.
const HOLE_S: f64 = 0.5;

/// The filter of a car on its way through a log.
pub struct LoggedDrive<'c> {
    car: &'c Car,
    tables: &'c ShiftTables<f64>,
    filter: GearboxFilter<'c, f64>,
    state: GearboxState<f64>,
    learning: LearningCount,
    passing: PassingShifts,
    /// Newest speeds of engine, turbine and output, rad/s: as they came, with the time, and those that the filter did not refuse.
    came: [CameSpeed; 3],
    speeds_rad_s: [f64; 3],
    begun_s: f64,
    /// Where the turbine is in it.
    beyond: BeyondGears,
    in_gear: InGear<'c>,
    /// The gear of the row before, and changes of the gear which no target gear announced.
    gear: Option<Gear>,
    unannounced: u64,
    commands: CommandCheck<'c>,
    delay: CommandDelay<'c>,
    converter: ConverterCheck,
    lock_up: LockUpCheck,
    still: StillCommands,
    held: HeldCommands,
    holes: Holes,
    carried: CarriedPressures,
    doubted: DoubtedPressures,
    jerk: ShiftJerk,
    felt: FeltShift,
    /// Newest temperature of the oil, degC; that of the vehicle file where the log has none.
    oil_degc: f64,
}

/// Holes of the recording within shifts.
struct Holes {
    count: u64,
    /// The shift that the last one cut, as long as the log goes on in it: the rest is no other shift.
    cut: Option<ShiftCommand>,
    /// The last times between rows, s; the oldest is at `at`.
    steps_s: [f64; 31],
    at: usize,
}

impl Default for Holes {
    fn default() -> Self {
        // What is not a number sorts behind the numbers: half of the times must be known.
        Self { count: 0, cut: None, steps_s: [f64::NAN; 31], at: 0 }
    }
}

impl Holes {
    /// Takes a time between two rows, s: whether it is a hole. In a log whose rows are always so far apart it is none.
    fn is_hole(&mut self, dt_s: f64) -> bool {
        const TIMES: f64 = 3.0;
        let mut before_s = self.steps_s;
        self.steps_s[self.at] = dt_s;
        self.at = (self.at + 1) % self.steps_s.len();
        if dt_s <= HOLE_S {
            return false;
        }
        before_s.sort_by(f64::total_cmp);
        dt_s > TIMES * before_s[before_s.len() / 2]
    }
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
            car,
            tables,
            filter,
            state,
            learning: LearningCount::of(state.learnt()),
            passing: PassingShifts::default(),
            came: [CameSpeed::default(); 3],
            speeds_rad_s: [f64::NAN; 3],
            begun_s: f64::NAN,
            beyond: BeyondGears::new(car, ShiftCommand::NEUTRAL, [f64::NAN; 2]),
            in_gear: InGear::new(car),
            gear: None,
            unannounced: 0,
            commands: CommandCheck::new(car, tables, &budget),
            delay: CommandDelay::new(tables, &budget),
            converter: ConverterCheck::default(),
            lock_up: LockUpCheck::default(),
            still: StillCommands::default(),
            held: HeldCommands::default(),
            holes: Holes::default(),
            carried: CarriedPressures::default(),
            doubted: DoubtedPressures::default(),
            jerk: ShiftJerk::default(),
            felt: FeltShift::of(AccelerationSource::OutputSpeed),
            oil_degc: car.oil_temperature_degc,
        }
    }

    /// The same where engine, turbine, output and wheel speed come later by these times, s, than their sensors do.
    #[must_use]
    pub fn with_speed_delays(mut self, delays_s: [f64; 4]) -> Self {
        let [engine, of_gearbox @ ..] = delays_s;
        self.filter.engine.0.delay_s += engine;
        for (reading, delay_s) in self.filter.readings.iter_mut().zip(of_gearbox) {
            reading.delay_s += delay_s;
        }
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
        let input = &step.input;
        if let Some(degc) = step.oil_degc {
            self.state.take_oil_temperature(degc);
            self.oil_degc = degc;
        }
        let mut estimate = self.filter.step(&mut self.state, input);
        if self.delay.is_found() {
            estimate.health = estimate.health.max(Health::CommandsMistimed);
        }
        self.learning.push(self.state.learnt());
        let readings = [input.engine_rad_s, input.turbine_rad_s, input.output_rad_s];
        let channels = [estimate.channels.engine, estimate.channels.turbine, estimate.channels.output];
        for (at, (reading, health)) in readings.into_iter().zip(channels).enumerate() {
            let Some(Reading { value, .. }) = reading.filter(|reading| reading.value.is_finite()) else { continue };
            self.came[at].push(step.time_s, value);
            if !health.is_refused() {
                self.speeds_rad_s[at] = value;
            }
        }
        self.carried.push(step.time_s, &estimate.valve_pa);
        self.jerk.push(step);
        let from = input.gear.from;
        self.passing.state(DriveState {
            time_s: step.time_s,
            gear: from,
            pedals: step.pedals,
            vehicle_m_s: step.vehicle_m_s,
            speeds_rad_s: self.speeds_rad_s,
            health: estimate.health,
        });
        let gears = Some(input.gear).filter(|gear| !gear.is_steady());
        if gears != self.holes.cut {
            self.holes.cut = None;
        }
        let is_hole = self.holes.is_hole(input.dt_s);
        let came_rad_s = self.came.each_ref().map(|came| came.at(step.time_s));
        if let Some(open) = self.passing.open.as_ref().filter(|_| is_hole) {
            self.holes.count += 1;
            self.holes.cut = gears.filter(|gears| *gears == open.gears);
            self.end(None);
        } else if self.passing.ends(gears) {
            self.end(Some((step.time_s, from)));
        }
        let is_same = self.gear.is_none_or(|before| before == from || before.is_neutral() || from.is_neutral());
        match gears {
            Some(_) if self.holes.cut.is_some() => {}
            Some(_) => self.during(step, &estimate),
            None => {
                // Without a converter dogs change while the clutch is open: this is no shift.
                let is_open = matches!(estimate.health, Health::ClutchOpen | Health::TooSlow);
                let are_dogs = self.car.converter.is_none() && is_open;
                // What happens in a hole is not seen.
                self.unannounced += u64::from(!is_same && !is_hole && !are_dogs);
                self.in_gear.push(&InGearRow {
                    gear: from,
                    dt_s: input.dt_s,
                    time_s: step.time_s,
                    came_rad_s,
                    has_ended: self.has_ended(&came_rad_s),
                    output: input.output_rad_s,
                    wheel: input.wheel_rad_s,
                    health: estimate.health,
                });
            }
        }
        // In a shift the gear may be the new one already.
        self.gear = gears.map_or(Some(from), |_| None);
        let [engine, turbine, output] = came_rad_s;
        if gears.is_none() {
            self.converter.push(self.car, step, [engine, turbine]);
            self.lock_up.push(self.car, step, [engine, turbine]);
        }
        self.commands.push(step.time_s, gears.is_none().then_some(from), [turbine, output], &estimate.valve_pa);
        self.still.push(&input.commands);
        self.held.push(step.time_s, &input.commands);
        let jerk_m_s3 = self.jerk.ended(step.time_s);
        self.passing.take_jerk(jerk_m_s3);
        let [_, turbine, output] = self.speeds_rad_s;
        if let Some(reading) = input.output_rad_s.filter(|_| !estimate.channels.output.is_refused()) {
            self.felt.push(Motion {
                time_s: step.time_s - reading.age_s,
                value: reading.value / self.car.driveline.final_ratio * self.car.road.wheel_radius_m,
                slips_rad_s: slips_rad_s(self.car, input.gear, [turbine, output]),
            });
        }
        let comfort = self.felt.ended(step.time_s);
        self.passing.take_comfort(comfort);
        self.delay.push(step, &estimate, [turbine, output]);
        estimate
    }

    /// Guaranteed range of the pressure of each element after the last row, Pa, by its place in the filter's tables.
    pub fn pressure_ranges_pa(&self) -> [Option<[f64; 2]>; MAX_ELEMENTS] {
        core::array::from_fn(|at| self.filter.pressure_range_pa(&self.state, at))
    }

    /// The filter, what it has learnt up to now, and from how many shifts of the log.
    pub fn learnt(&self) -> (&GearboxFilter<'c, f64>, &Learnt<f64>, LearningCount) {
        (&self.filter, self.state.learnt(), self.learning)
    }

    /// Rows in a gear at speed, and those whose turbine and output speed do not fit the ratio of that gear.
    pub fn rows_in_gear(&self) -> [u64; 2] {
        self.in_gear.rows()
    }

    /// The rows in a gear while the car moves, if there are enough of them and the filter could use the readings of none. Without an engine
    /// speed it is rightly the open loop.
    pub fn unusable(&self) -> Option<Unusable> {
        self.in_gear.unusable().filter(|_| !self.is_open_loop())
    }

    /// Whether a speed of the engine, turbine or output came before, and comes no more.
    fn has_ended(&self, came_rad_s: &[f64; 3]) -> bool {
        self.came.iter().zip(came_rad_s).any(|(came, now)| came.has_come() && now.is_nan())
    }

    /// Whether the engine speed, which the filter needs in front of a converter, has never come.
    fn is_open_loop(&self) -> bool {
        self.car.converter.is_some() && !self.car.gearbox.has_ratios_alone() && !self.came[0].has_come()
    }

    /// Output over wheel speed in a gear at speed, in the middle; not a number where too few rows have both.
    pub fn output_over_wheel(&self) -> f64 {
        self.in_gear.output_over_wheel()
    }

    /// What contradicts the channels of engine and turbine speed, in a sentence.
    pub fn swapped_speeds(&self) -> Option<String> {
        self.in_gear.swapped_speeds()
    }

    /// A speed whose scale is wrong by the ratios in the gears.
    pub fn wrong_scale(&self) -> Option<WrongScale> {
        self.in_gear.wrong_scale()
    }

    fn during(&mut self, step: &LogStep, estimate: &ShiftEstimate<f64>) {
        let gears = step.input.gear;
        let row = self.tables.tables().commanded(gears).copied();
        let elements = row.map(|row| row.clutches.map(|clutch| clutch.element));
        if self.passing.open.is_none() {
            let elements =
                elements.and_then(|_| self.car.single_shift(gears)).map_or([None; 2], |elements| elements.map(Some));
            let turbine_n_m = estimate.turbine_n_m.unwrap_or(f64::NAN);
            self.passing.begin(self.car, gears, elements, (step.time_s, turbine_n_m));
            self.begun_s = step.time_s;
            let jerk_m_s3 = self.jerk.begin(step.time_s);
            self.passing.take_jerk(jerk_m_s3);
            let comfort = self.felt.begin(step.time_s);
            self.passing.take_comfort(comfort);
            self.still.begin();
            let ratios = [gears.from, gears.to].map(|gear| self.car.ratio(gear).unwrap_or(f64::NAN));
            self.beyond = BeyondGears::new(self.car, gears, ratios);
        }
        let Some(shift) = &mut self.passing.open else { return };
        shift.time_s[1] = step.time_s;
        let [_, turbine, output] = self.speeds_rad_s;
        self.beyond.push(&mut shift.quality, [turbine, output]);
        let found = estimate.clutches.filter(|found| Some(found.map(|clutch| clutch.element)) == elements);
        let at_turbine_n_m = estimate.at_turbine.map(|clutches| [clutches.torque_n_m, clutches.std_dev_n_m]);
        let clutches = match (found.zip(row), self.car.gearbox.has_ratios_alone()) {
            (Some((found, row)), _) => {
                let pressures_pa = self.carried.pressures_pa(step, self.tables);
                [0, 1].map(|c| {
                    let [_, torque_n_m, slip_rad_s] = step.truth[c];
                    let by_speeds = row.clutches[c].alpha * (turbine - row.clutches[c].ratio * output);
                    let slips = [slip_rad_s, by_speeds];
                    ClutchRow {
                        alpha: row.clutches[c].alpha,
                        ..clutch_row(&found[c], [pressures_pa[c], torque_n_m], slips)
                    }
                })
            }
            // A shift past a gear has no inertias.
            (None, true) if estimate.health == Health::ShiftNotModelled => return,
            (None, true) => {
                let holds = [ShiftPhase::OffgoingHolds, ShiftPhase::OncomingHolds];
                holds.map(|holds| ClutchRow::unknown(estimate.phase == Some(holds)))
            }
            (None, false) => return,
        };
        let row = ShiftScoreRow {
            time_s: step.time_s,
            clutches,
            turbine_n_m: [f64::NAN, estimate.turbine_n_m.unwrap_or(f64::NAN)],
            at_turbine_n_m,
            speeds_rad_s: [self.speeds_rad_s[0], turbine, output, f64::NAN],
            phase: estimate.phase.map_or("-", |phase| phase.name()),
            health: estimate.health,
            flare_rad_s: estimate.flare_rad_s,
        };
        self.doubted.push(shift.elements, &row);
        shift.rows.push(row);
    }

    /// Ends the open shift: at the time, s, of the first row after it, and in its gear; `None` where the log does not have it.
    fn end(&mut self, at: Option<(f64, Gear)>) {
        let Some(shift) = &self.passing.open else { return };
        let completed_s = at.filter(|(_, gear)| *gear == shift.gears.to).map(|(time_s, _)| time_s);
        if let Some((row, time_s)) = self.tables.tables().commanded(shift.gears).zip(completed_s) {
            self.still.end(row.clutches.map(|clutch| clutch.element));
            self.delay.end(shift.gears, [self.begun_s, time_s]);
        }
        let complete_s = completed_s.map(|time_s| time_s - self.begun_s);
        // A log has no slip of the held elements.
        let unknown =
            CarShiftQuality { jerk_m_s3: f64::NAN, held_slip_rad_s: f64::NAN, tie_up_n_m: f64::NAN, ..shift.quality };
        self.passing.end(self.car, self.oil_degc, CarShiftQuality { complete_s, ..unknown });
        self.jerk.end(at.map(|(time_s, _)| time_s));
        self.felt.end(completed_s);
    }

    /// Keeps what figures need of at most so many of the shifts up to now that are wanted, those with the largest errors, or without truth those
    /// worth a look: called after each row, it bounds what is held of a long drive.
    pub fn draw_at_most(&mut self, maximum: usize, is_wanted: impl Fn(&ScoredShift) -> bool) {
        self.passing.draw_at_most(maximum, is_wanted);
    }

    /// The drive.
    pub fn finish(mut self) -> ScoredDrive {
        let jerk_m_s3 = self.jerk.ended(f64::INFINITY);
        self.passing.take_jerk(jerk_m_s3);
        let comfort = self.felt.finish();
        self.passing.take_comfort(comfort);
        // A shift that the log cuts off is not complete.
        self.end(None);
        let swapped = self.in_gear.swapped_speeds().map(|swapped| format!("warning: {swapped}"));
        let mut warnings: Vec<String> = swapped.into_iter().chain(self.commands.warnings()).collect();
        let ended = self.in_gear.ended();
        if ended > 0 {
            warnings.push(format!(
                "warning: engine, turbine or output speed came no more, or was refused, in {ended} rows in a gear with the car moving: pressures and torques \
                 there are those of the valve models alone (open loop)"
            ));
        }
        if self.is_open_loop() {
            warnings.push(
                "warning: there is no engine speed, which gives the turbine torque: pressures and torques are those of the valve models alone (open loop)"
                    .to_owned(),
            );
        }
        warnings.extend(self.doubted.warning(self.car));
        warnings.extend(self.delay.warning());
        warnings.extend(self.converter.warning(self.car));
        warnings.extend(self.lock_up.warning());
        warnings.extend(self.still.warnings(self.car, self.tables));
        warnings.extend(self.held.warnings(self.car, self.tables));
        if self.holes.count > 0 {
            warnings.push(format!(
                "warning: {} shifts have a hole of more than {HOLE_S} s in the recording: they end with it and count as not completed",
                self.holes.count
            ));
        }
        warnings.extend(not_of_their_gears(&self.passing.drive.shifts));
        if self.unannounced > 0 {
            warnings.push(format!(
                "warning: gear changes without a target_gear that says so before (so often: {}): these shifts are not estimated. target_gear has to \
                 change when a shift is requested, gear when it is done",
                self.unannounced
            ));
        }
        let final_ratio = self.car.driveline.final_ratio;
        let (off, bound) = (self.output_over_wheel() / final_ratio - 1.0, ErrorBudget::of_car(self.car).wheel_scale);
        let wrong = self.wrong_scale();
        warnings.extend(wrong.iter().map(|wrong| format!("warning: {}", wrong.text)));
        if off.abs() > bound && wrong.is_none_or(|wrong| !wrong.is_output) {
            warnings.push(format!(
                "warning: output_speed over wheel_speed is {:.3} in the middle, {:+.1} % from the final ratio {final_ratio:.3}: the filter learns the \
                 scale of wheel_speed within {:.1} % and refuses what is further off. Correct the scale of wheel_speed or `driveline.final_ratio`, or \
                 give its bound as `error_bounds.wheel_scale_share`",
                self.output_over_wheel(),
                100.0 * off,
                100.0 * bound
            ));
        }
        ScoredDrive { warnings, ..self.passing.drive }
    }
}

/// The row of a clutch beside the pressure and torque that are known, with its true slip and that by the readings.
fn clutch_row(
    found: &ClutchEstimate<f64>,
    [pressure_pa, torque_n_m]: [f64; 2],
    [slip_rad_s, by_speeds]: [f64; 2],
) -> ClutchRow {
    ClutchRow {
        slip_rad_s: if slip_rad_s.is_nan() { by_speeds } else { slip_rad_s },
        alpha: f64::NAN,
        torque_n_m: [torque_n_m, found.torque_n_m, found.open_loop_n_m],
        torque_std_dev_n_m: found.std_dev_n_m,
        pressure_std_dev_pa: found.pressure_std_dev_pa,
        pressure_pa: [pressure_pa, found.pressure_pa, found.valve_pa],
        sticks: if slip_rad_s.is_nan() { found.holds } else { slip_rad_s.abs() < STICKS_RAD_S },
        torque_range_n_m: found.torque_range_n_m,
        pressure_range_pa: found.pressure_range_pa,
        hidden: found.hidden,
        is_one_way: found.element.is_one_way(),
        in_range: within(found.pressure_range_pa, pressure_pa, ROUNDING_PA)
            && within(found.torque_range_n_m, torque_n_m, ROUNDING_N_M),
    }
}
