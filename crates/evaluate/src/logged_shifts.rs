//! What the rows of a log and their estimates say of the shifts and of the car.

use car::{Car, ErrorBudget, Gear, LOST_S, ShiftCommand};
use drivetrain::clutch::drag_torque;
use observer::gearbox::{ClutchEstimate, ShiftEstimate, ShiftInput, ShiftPhase};
use observer::{ChannelHealth, Health, Reading, ShiftTables};
use plant::car::{BeyondGears, CarShiftQuality};

use crate::LogStep;
use crate::car_beyond_bounds::CarBeyondBounds;
use crate::carried_pressures::CarriedPressures;
use crate::checks::{CameSpeed, CheckedRow, Checks, EndedShift, GearSpeeds, RefusedCommand, Unusable, WrongScale};
use crate::drive::{DriveState, PassingShifts, ScoredDrive, ScoredShift, slips_rad_s};
use crate::felt_shift::{FeltBySpeeds, Motion};
use crate::logged::Filtered;
use crate::score::within;
use crate::shift_comfort::AccelerationSource;
use crate::shift_jerk::ShiftJerk;
use crate::{ClutchRow, ROUNDING_N_M, ROUNDING_PA, ShiftScoreRow};

/// Slip below which a true clutch sticks, rad/s.
const STICKS_RAD_S: f64 = 0.05;

/// Without turbine or output speed for so long, s, the slips are not known \[chosen\]: a shift is found over a speed that is refused for so long.
const UNREAD_S: f64 = 3.0;
/// A speed that has not come for so long says little of a slip, s \[chosen\]: that of a shift changes by a fifth. Slower readings are seldom.
const OLD_S: f64 = 0.1;
/// By how much the turbine may be outside the speeds of both gears in a shift, as a fraction and beside it, rad/s \[chosen\].
const OUTSIDE: f64 = 0.1;
const OUTSIDE_RAD_S: f64 = 5.0;

/// The shifts of a log, and what its readings contradict.
pub struct LoggedShifts<'c> {
    car: &'c Car,
    tables: &'c ShiftTables<f64>,
    passing: PassingShifts,
    /// Newest speeds of engine, turbine and output, rad/s: as they came, with the time, and those that the filter did not refuse.
    came: [CameSpeed; 3],
    speeds_rad_s: [f64; 3],
    /// When these came, s.
    read_s: [f64; 3],
    begun_s: f64,
    /// Whether turbine or output speed was lost in the shift that goes on.
    is_unread: bool,
    /// Where the turbine is in it.
    beyond: BeyondGears,
    gear_speeds: GearSpeeds<'c>,
    checks: Checks<'c>,
    beyond_bounds: CarBeyondBounds,
    carried: CarriedPressures,
    jerk: ShiftJerk,
    felt: FeltBySpeeds,
    /// Newest temperature of the oil, degC; that of the vehicle file where the log has none.
    oil_degc: f64,
}

impl<'c> LoggedShifts<'c> {
    pub(crate) fn new(car: &'c Car, tables: &'c ShiftTables<f64>, budget: &ErrorBudget) -> Self {
        Self {
            car,
            tables,
            passing: PassingShifts::default(),
            came: [CameSpeed::default(); 3],
            speeds_rad_s: [f64::NAN; 3],
            read_s: [f64::NEG_INFINITY; 3],
            begun_s: f64::NAN,
            is_unread: false,
            beyond: BeyondGears::new(car, ShiftCommand::NEUTRAL, [f64::NAN; 2]),
            gear_speeds: GearSpeeds::new(car),
            checks: Checks::new(car, tables, budget),
            beyond_bounds: CarBeyondBounds::default(),
            carried: CarriedPressures::default(),
            jerk: ShiftJerk::default(),
            felt: FeltBySpeeds::new(),
            oil_degc: car.oil_temperature_degc,
        }
    }

    /// Keeps no states of the drive, for an estimate of which no page is made.
    pub(crate) fn keep_no_states(&mut self) {
        self.passing.keep_no_states();
    }

    /// Takes a row with what the filter made of it, whose health it makes worse where the commands are those of another time.
    pub fn push(&mut self, step: &LogStep, filtered: &mut Filtered) {
        let (input, Filtered { estimate, beyond_bounds, .. }) = (&step.input, filtered);
        if let Some(degc) = step.oil_degc {
            self.oil_degc = degc;
        }
        if self.checks.delay.is_found() {
            estimate.health = estimate.health.max(Health::CommandsMistimed);
        }
        self.beyond_bounds.push(step.time_s, *beyond_bounds);
        let readings = [input.engine_rad_s, input.turbine_rad_s, input.output_rad_s];
        let channels = [estimate.channels.engine, estimate.channels.turbine, estimate.channels.output];
        for (at, (reading, health)) in readings.into_iter().zip(channels).enumerate() {
            let Some(Reading { value, .. }) = reading.filter(|reading| reading.value.is_finite()) else { continue };
            self.came[at].push(step.time_s, value);
            if !health.is_refused() {
                (self.speeds_rad_s[at], self.read_s[at]) = (value, step.time_s);
            }
        }
        self.carried.push(step.time_s, &estimate.valve_pa);
        let speeds_m_s = self.speeds_of_car(input, estimate);
        let [(_, by_wheels), _] = speeds_m_s;
        self.jerk.push(step, [step.speed_m_s, by_wheels]);
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
        let holes = &mut self.checks.holes;
        if gears != holes.cut {
            holes.cut = None;
        }
        let is_hole = holes.is_hole(input.dt_s);
        if let Some(open) = self.passing.open.as_ref().filter(|_| is_hole) {
            holes.count += 1;
            holes.cut = gears.filter(|gears| *gears == open.gears);
            self.end(None);
        } else if self.passing.ends(gears) {
            self.end(Some((step.time_s, from)));
        }
        if gears.is_some() && self.checks.holes.cut.is_none() {
            self.during(step, estimate);
        }
        let came_rad_s = self.came.each_ref().map(|came| came.at(step.time_s));
        let row = CheckedRow {
            step,
            estimate,
            came_rad_s,
            used_rad_s: self.speeds_rad_s,
            in_gear: self.gear_speeds.row(step, came_rad_s, estimate.health),
            has_ended: self.has_ended(&came_rad_s),
            is_hole,
        };
        self.checks.each().into_iter().for_each(|check| check.row(&row));
        let jerk_m_s3 = self.jerk.ended(step.time_s);
        self.passing.take_jerk(jerk_m_s3);
        let [_, turbine, output] = self.speeds_rad_s;
        for (source, speed) in speeds_m_s {
            let Some(Reading { value, age_s }) = speed else { continue };
            let slips_rad_s = slips_rad_s(self.car, input.gear, [turbine, output]);
            self.felt.push(source, Motion { time_s: step.time_s - age_s, value, slips_rad_s });
        }
        let comfort = self.felt.ended(step.time_s);
        self.passing.take_comfort(comfort);
    }

    /// The speed of the car by the readings of the wheels and of the output that the filter did not refuse, m/s. Of the wheels the slip of the tyres under
    /// the estimated torque of the shafts is taken off: where that torque steps, the wheels do.
    fn speeds_of_car(
        &self,
        input: &ShiftInput<f64>,
        estimate: &ShiftEstimate<f64>,
    ) -> [(AccelerationSource, Option<Reading<f64>>); 2] {
        let channels = &estimate.channels;
        let of = |reading: Option<Reading<f64>>, health: ChannelHealth, radius_m: f64| {
            let Reading { value, age_s } = reading.filter(|of| of.value.is_finite() && !health.is_refused())?;
            Some(Reading { value: radius_m * value, age_s })
        };
        let radius_m = self.car.road.wheel_radius_m;
        let without_slip = |rim: Reading<f64>| {
            let force_n = estimate.shaft_n_m.filter(|n_m| n_m.is_finite()).unwrap_or(0.0) / radius_m;
            Reading { value: self.car.tyre.vehicle_speed(rim.value, force_n), ..rim }
        };
        let output_radius_m = radius_m / self.car.driveline.final_ratio;
        [
            (AccelerationSource::WheelSpeed, of(input.wheel_rad_s, channels.wheel, radius_m).map(without_slip)),
            (AccelerationSource::OutputSpeed, of(input.output_rad_s, channels.output, output_radius_m)),
        ]
    }

    /// Rows in a gear at speed, and those whose turbine and output speed do not fit the ratio of that gear.
    pub fn rows_in_gear(&self) -> [u64; 2] {
        self.checks.in_gear.rows()
    }

    /// The rows in a gear while the car moves, if there are enough of them and the filter could use the readings of none. Without an engine
    /// speed it is rightly the open loop.
    pub fn unusable(&self) -> Option<Unusable> {
        self.checks.in_gear.unusable().filter(|_| !self.checks.open_loop.is_open_loop())
    }

    /// Whether a speed of the engine, turbine or output came before, and comes no more.
    fn has_ended(&self, came_rad_s: &[f64; 3]) -> bool {
        self.came.iter().zip(came_rad_s).any(|(came, now)| came.has_come() && now.is_nan())
    }

    /// A command that its valve cannot have in most of its readings.
    pub fn refused_command(&self) -> Option<RefusedCommand<'_>> {
        self.checks.refused.mostly()
    }

    /// Whether an element slips where it should hold, or holds without its command: then the speeds are those of the car.
    pub fn has_slipping_element(&self) -> bool {
        self.checks.slipping.is_found()
    }

    /// Whether a gear, by its place in the gearbox, slips, or its speeds are those of another one.
    pub(crate) fn slips_in(&self, gear: usize) -> bool {
        self.checks.slipping.is_found_in(gear)
    }

    /// Output over wheel speed in a gear at speed, in the middle; not a number where too few rows have both.
    pub fn output_over_wheel(&self) -> f64 {
        self.checks.scales.output_over_wheel()
    }

    /// What contradicts the channels of engine and turbine speed, in a sentence.
    pub fn swapped_speeds(&self) -> Option<String> {
        self.checks.swapped.contradiction()
    }

    /// A speed whose scale is wrong by the ratios in the gears.
    pub fn wrong_scale(&self) -> Option<WrongScale> {
        self.checks.scales.wrong_scale()
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
            self.checks.each().into_iter().for_each(|check| check.begin());
            let ratios = [gears.from, gears.to].map(|gear| self.car.ratio(gear).unwrap_or(f64::NAN));
            self.beyond = BeyondGears::new(self.car, gears, ratios);
            self.is_unread = false;
        }
        let [_, fresh @ ..] = self.speeds_at(step.time_s, LOST_S);
        self.is_unread |= fresh.iter().any(|speed| speed.is_nan());
        let [engine, turbine, output] = self.speeds_at(step.time_s, UNREAD_S);
        let [_, recent @ ..] = self.speeds_at(step.time_s, OLD_S);
        let ratios = [gears.from, gears.to].map(|gear| self.car.ratio(gear).unwrap_or(f64::NAN));
        let Some(shift) = &mut self.passing.open else { return };
        shift.time_s[1] = step.time_s;
        self.beyond.push(&mut shift.quality, fresh);
        let found = estimate.clutches.filter(|found| Some(found.map(|clutch| clutch.element)) == elements);
        let at_turbine_n_m = estimate.at_turbine.map(|clutches| [clutches.torque_n_m, clutches.std_dev_n_m]);
        let clutches = match (found.zip(row), self.car.gearbox.has_ratios_alone()) {
            (Some((found, row)), _) => {
                let pressures_pa = self.carried.pressures_pa(step, self.tables);
                let ends = speeds_without(recent, [turbine, output], ratios);
                [0, 1].map(|c| {
                    let [_, torque_n_m, slip_rad_s] = step.truth[c];
                    let by_speeds = row.clutches[c].alpha * (turbine - row.clutches[c].ratio * output);
                    let slips = [slip_rad_s, by_speeds];
                    let element = found[c].element.place().and_then(|place| self.tables.element_at(place));
                    let peak_n_m = element.and_then(|at| self.car.clutches[at].as_ref()).map_or(0.0, |of| of.drag_n_m);
                    let drag_n_m = drag_torque(peak_n_m, by_speeds);
                    ClutchRow {
                        alpha: row.clutches[c].alpha,
                        drag_n_m: if found[c].holds || drag_n_m.is_nan() { 0.0 } else { drag_n_m },
                        slip_range_rad_s: ends.map(|ends| {
                            let slips = ends.map(|[turbine, output]| {
                                row.clutches[c].alpha * (turbine - row.clutches[c].ratio * output)
                            });
                            [slips[0].min(slips[1]), slips[0].max(slips[1])]
                        }),
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
            speeds_rad_s: [engine, turbine, output, f64::NAN],
            phase: estimate.phase.map_or("-", |phase| phase.name()),
            health: estimate.health,
            flare_rad_s: estimate.flare_rad_s,
        };
        self.checks.each().into_iter().for_each(|check| check.shift_row(shift.elements, &row));
        shift.rows.push(row);
    }

    /// The newest speeds of engine, turbine and output that the filter used, rad/s; not a number of one that came longer ago than this, s.
    fn speeds_at(&self, time_s: f64, longest_s: f64) -> [f64; 3] {
        core::array::from_fn(|at| if time_s - self.read_s[at] <= longest_s { self.speeds_rad_s[at] } else { f64::NAN })
    }

    /// Ends the open shift: at the time, s, of the first row after it, and in its gear; `None` where the log does not have it.
    fn end(&mut self, at: Option<(f64, Gear)>) {
        let Some(shift) = &self.passing.open else { return };
        let completed_s = at.filter(|(_, gear)| *gear == shift.gears.to).map(|(time_s, _)| time_s);
        let row = self.tables.tables().commanded(shift.gears).copied();
        let completed = row.zip(completed_s).map(|(row, end_s)| {
            let elements = row.clutches.map(|clutch| clutch.element);
            (elements, [self.begun_s, end_s])
        });
        let complete_s = completed_s.map(|time_s| time_s - self.begun_s);
        // A log has no slip of the held elements.
        let mut unknown =
            CarShiftQuality { jerk_m_s3: f64::NAN, held_slip_rad_s: f64::NAN, tie_up_n_m: f64::NAN, ..shift.quality };
        if self.is_unread {
            (unknown.flare_rad_s, unknown.past_synchronous_rad_s) = (f64::NAN, f64::NAN);
        }
        self.passing.end(self.car, self.oil_degc, CarShiftQuality { complete_s, ..unknown });
        if let Some(shift) = self.passing.drive.shifts.last() {
            let ended = EndedShift { shift, completed };
            self.checks.each().into_iter().for_each(|check| check.end(&ended));
        }
        self.jerk.end(at.map(|(time_s, _)| time_s));
        self.felt.end(completed_s);
    }

    /// Keeps what figures need of at most so many of the shifts up to now that are wanted, those with the largest errors, or without truth those
    /// worth a look: called after each row, it bounds what is held of a long drive.
    pub fn draw_at_most(&mut self, maximum: usize, is_wanted: impl Fn(&ScoredShift) -> bool) {
        self.passing.draw_at_most(maximum, is_wanted);
    }

    pub(crate) fn car(&self) -> &'c Car {
        self.car
    }

    /// The drive behind its last row, with what the filter found of the readings.
    pub(crate) fn finish(mut self, of_readings: Vec<String>) -> ScoredDrive {
        let jerk_m_s3 = self.jerk.ended(f64::INFINITY);
        self.passing.take_jerk(jerk_m_s3);
        let comfort = self.felt.finish();
        self.passing.take_comfort(comfort);
        // A shift that the log cuts off is not complete.
        self.end(None);
        // What slips in its gears, or holds without a command, changes the torques of the others in shifts.
        if self.checks.slipping.is_found() {
            self.checks.torques.leave_out();
        }
        if self.checks.converter.has_other_sign() {
            self.checks.lock_up.leave_out();
        }
        let of_car = self.beyond_bounds.warning(self.car, self.tables);
        let warnings = self.checks.each().into_iter().flat_map(|check| check.warnings());
        let warnings = warnings.chain(of_readings).chain(of_car).collect();
        ScoredDrive { warnings, ..self.passing.drive }
    }
}

/// Turbine and output speed at both ends of what they can be in a shift between gears of these ratios, by the recent ones and the last ones, rad/s; none
/// where both are recent, and not numbers where one has not come for long.
fn speeds_without(recent: [f64; 2], last: [f64; 2], ratios: [f64; 2]) -> Option<[[f64; 2]; 2]> {
    let ends = match recent.map(f64::is_nan) {
        [false, false] => return None,
        _ if last.iter().any(|speed| speed.is_nan()) => return Some([[f64::NAN; 2]; 2]),
        [false, true] => ratios.map(|ratio| [recent[0], recent[0] / ratio]),
        _ => ratios.map(|ratio| [ratio * last[1], last[1]]),
    };
    let [lower, higher] = if ends[0][0] / ends[0][1] <= ends[1][0] / ends[1][1] { ends } else { [ends[1], ends[0]] };
    let outside =
        |[turbine, output]: [f64; 2], sign: f64| [turbine + sign * (OUTSIDE * turbine.abs() + OUTSIDE_RAD_S), output];
    Some([outside(lower, -1.0), outside(higher, 1.0)])
}

/// The row of a clutch beside the pressure and torque that are known, with its true slip and that by the readings.
fn clutch_row(
    found: &ClutchEstimate<f64>,
    [pressure_pa, torque_n_m]: [f64; 2],
    [slip_rad_s, by_speeds]: [f64; 2],
) -> ClutchRow {
    ClutchRow {
        slip_rad_s: if slip_rad_s.is_nan() { by_speeds } else { slip_rad_s },
        slip_range_rad_s: None,
        alpha: f64::NAN,
        drag_n_m: 0.0,
        torque_n_m: [torque_n_m, found.torque_n_m, found.open_loop_n_m],
        torque_std_dev_n_m: found.std_dev_n_m,
        pressure_std_dev_pa: found.pressure_std_dev_pa,
        pressure_pa: [pressure_pa, found.pressure_pa, found.valve_pa],
        sticks: if slip_rad_s.is_nan() { found.holds } else { slip_rad_s.abs() < STICKS_RAD_S },
        torque_range_n_m: found.torque_range_n_m,
        pressure_range_pa: found.pressure_range_pa,
        hidden: found.hidden,
        has_pressure: found.element.has_pressure(),
        in_range: within(found.pressure_range_pa, pressure_pa, ROUNDING_PA)
            && within(found.torque_range_n_m, torque_n_m, ROUNDING_N_M),
    }
}
