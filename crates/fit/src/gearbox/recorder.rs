//! From the steps of a log to its shifts.

use std::ops::RangeInclusive;

use car::{Car, Gear, ShiftCommand};
use observer::Reading;
use observer::ShiftTables;
use observer::gearbox::{MAX_ELEMENTS, ShiftInput, ShiftRow};

use super::shift_log::{ShiftLog, is_fitted};
use crate::driving::{DrivenCar, Driving, DrivingRecorder, RowState};
use crate::{ReadingAges, Series};

/// What is kept from before a shift at least, s: after this time a valve has forgotten where it was.
const BEFORE_S: f64 = 2.0;
/// What is kept from after it, s: a gear signal may change before the ratio does.
const AFTER_S: f64 = 0.5;
/// Longest shift, s.
const LONGEST_S: f64 = 5.0;
/// Temperatures that an oil can have, degC: kelvin are none.
const OIL_DEGC: RangeInclusive<f64> = -60.0..=200.0;
/// Readings of a channel above which old ones are dropped.
const READINGS_KEPT: usize = 4000;
/// Output speed from which on the ratio of a gear is compared with the speeds, rad/s, and fraction by which they may differ.
const RATIO_FROM_RAD_S: f64 = 20.0;
const RATIO_FRACTION: f64 = 0.1;

/// The shifts of a log, and the driving between them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Recorded {
    /// Shifts that can be fitted.
    pub shifts: Vec<ShiftLog>,
    /// Shifts that cannot, each with the reason.
    pub skipped: Vec<String>,
    /// Driving in a gear between them.
    pub driving: Driving,
    /// Rows in a gear at speed, and those whose speeds do not fit its ratio.
    pub in_gear: [u64; 2],
}

impl Recorded {
    /// Adds the shifts of another log. A shift tells what it has to tell once: copies are left out.
    pub fn add(&mut self, more: Self) {
        self.skipped.extend(more.skipped);
        self.driving.add(more.driving);
        for shift in more.shifts {
            let same = |other: &&ShiftLog| other.turbine.value == shift.turbine.value && other.engine == shift.engine;
            match self.shifts.iter().find(same) {
                Some(first) => self.skipped.push(format!("{}: the same readings as {}", shift.name, first.name)),
                None => self.shifts.push(shift),
            }
        }
        for (sum, count) in self.in_gear.iter_mut().zip(more.in_gear) {
            *sum += count;
        }
    }
}

/// A shift that is under way, or has just ended.
#[derive(Debug, Clone, Copy)]
struct Open {
    gears: ShiftCommand,
    begun_s: f64,
    ended_s: Option<f64>,
    lock_up: bool,
}

/// Takes the steps of a log one after the other.
pub struct Recorder<'a> {
    car: &'a Car,
    tables: &'a ShiftTables<f64>,
    ages: ReadingAges,
    engine: Series,
    turbine: Series,
    output: Series,
    engine_torque: Series,
    commands: [Series; MAX_ELEMENTS],
    /// Of the shift that is open.
    pressure: [Series; 2],
    /// Of each element, whatever it does.
    pressures: [Series; MAX_ELEMENTS],
    driving: DrivingRecorder,
    /// Longest time in which a piston of the car goes back, s; zero where none has a stroke.
    emptied_s: f64,
    /// Last measured temperature of the oil, degC.
    oil_degc: Option<f64>,
    /// Of the next step, what the filter of `estimate` is not shown.
    reported: Option<Reading<f64>>,
    open: Option<Open>,
    last_output: f64,
    found: Recorded,
}

impl<'a> Recorder<'a> {
    /// For a car with these tables and readings of these ages.
    pub fn new(car: &'a Car, tables: &'a ShiftTables<f64>, ages: ReadingAges) -> Self {
        let none = Series::default;
        Self {
            car,
            tables,
            ages,
            engine: none(),
            turbine: none(),
            output: none(),
            engine_torque: none(),
            commands: std::array::from_fn(|_| none()),
            pressure: [none(), none()],
            pressures: std::array::from_fn(|_| none()),
            driving: DrivingRecorder::new(DrivenCar::with_gearbox(car, tables, &|_, _| None)),
            emptied_s: emptied_s(car),
            oil_degc: None,
            reported: None,
            open: None,
            last_output: f64::NAN,
            found: Recorded::default(),
        }
    }

    /// Takes of the next step what the filter of `estimate` is not shown beside a converter: the reported engine torque, N m.
    pub fn push_reported(&mut self, reported_n_m: Option<Reading<f64>>) {
        self.reported = reported_n_m;
    }

    /// Takes the temperature of the oil at the next step, degC, where the log has it.
    pub fn push_oil_temperature(&mut self, oil_degc: Option<f64>) {
        self.oil_degc = oil_degc.filter(|degc| OIL_DEGC.contains(degc)).or(self.oil_degc);
    }

    /// Takes a step.
    pub fn push(&mut self, time_s: f64, input: &ShiftInput<f64>) {
        if let Some(open) = self.open
            && (open.ended_s.is_some_and(|ended_s| time_s > ended_s + AFTER_S) || time_s < open.begun_s)
        {
            self.close(open);
        }
        self.take(time_s, input);
        let gears = input.gear;
        let is_shift = !gears.is_steady();
        match &mut self.open {
            Some(open) if is_shift && open.gears == gears && open.ended_s.is_none() => {
                open.lock_up |= input.lock_up_applied;
            }
            Some(open) if is_shift => {
                let open = *open;
                self.close(Open { ended_s: open.ended_s.or(Some(time_s)), ..open });
                self.begin(time_s, gears, input.lock_up_applied);
            }
            Some(open) => open.ended_s = open.ended_s.or(Some(time_s)),
            None if is_shift => self.begin(time_s, gears, input.lock_up_applied),
            None => self.compare_ratio(gears.from, input),
        }
        self.forget(time_s);
    }

    /// Takes measured pressures of the offgoing and the oncoming element of the shift of the step before, Pa, where there are any.
    pub fn push_pressure(&mut self, time_s: f64, pressure_pa: [Option<Reading<f64>>; 2]) {
        if self.open.is_some_and(|open| open.ended_s.is_none()) {
            let both = self.pressure.iter_mut().zip(pressure_pa);
            for (series, reading) in both.filter_map(|(series, reading)| Some((series, reading?))) {
                if reading.value.is_finite() {
                    series.push(time_s - reading.age_s, reading.value);
                }
            }
        }
    }

    /// Takes measured pressures of the elements by their places in the tables, Pa, where there are any: with those from before and after a shift,
    /// in which a valve rests, the zero offset of the sensor is found.
    pub fn push_element_pressures(&mut self, time_s: f64, pressures_pa: &[Option<Reading<f64>>; MAX_ELEMENTS]) {
        for (series, reading) in self.pressures.iter_mut().zip(pressures_pa) {
            if let Some(reading) = reading.filter(|reading| reading.value.is_finite()) {
                series.push(time_s - reading.age_s, reading.value);
            }
        }
    }

    /// The shifts.
    pub fn finish(mut self) -> Recorded {
        if let Some(open) = self.open {
            self.close(open);
        }
        self.found.driving = self.driving.finish();
        self.found
    }

    fn take(&mut self, time_s: f64, input: &ShiftInput<f64>) {
        // What cannot be a reading is none.
        let dated = |reading: Option<Reading<f64>>, turned_rad: f64| {
            let Reading { value, age_s } = reading.filter(|reading| reading.value.is_finite())?;
            let turning_s = if value.abs() > 1.0 { turned_rad / value.abs() } else { 0.0 };
            Some((time_s - age_s - turning_s, value))
        };
        let ages = self.ages;
        let speeds = [
            dated(input.engine_rad_s, ages.engine_rad),
            dated(input.turbine_rad_s, ages.turbine_rad),
            dated(input.output_rad_s, ages.output_rad),
        ];
        let wheel = dated(input.wheel_rad_s, ages.wheel_rad);
        let torque = dated(input.engine_n_m, 0.0);
        let readings = speeds.into_iter().chain([torque]).chain(input.commands.map(|reading| dated(reading, 0.0)));
        let series = [&mut self.engine, &mut self.turbine, &mut self.output, &mut self.engine_torque];
        for (series, reading) in series.into_iter().chain(&mut self.commands).zip(readings) {
            if let Some((time_s, value)) = reading {
                series.push(time_s, value);
            }
        }
        let gear = input.gear.from.place().filter(|_| input.gear.is_steady());
        let state = RowState { gear, lock_up: input.lock_up_applied };
        let reported = dated(self.reported.take(), 0.0).or(torque);
        let [engine, turbine, output] = speeds;
        self.driving.push(time_s, [engine, turbine, output, wheel], reported, state);
    }

    fn begin(&mut self, time_s: f64, gears: ShiftCommand, lock_up: bool) {
        self.pressure = Default::default();
        self.open = Some(Open { gears, begun_s: time_s, ended_s: None, lock_up });
    }

    fn compare_ratio(&mut self, gear: Gear, input: &ShiftInput<f64>) {
        self.last_output = input.output_rad_s.map_or(self.last_output, |reading| reading.value);
        let (Some(turbine), Some(ratio)) = (input.turbine_rad_s, self.car.ratio(gear)) else { return };
        if self.last_output > RATIO_FROM_RAD_S {
            let by_output = ratio * self.last_output;
            self.found.in_gear[0] += 1;
            self.found.in_gear[1] += u64::from((turbine.value - by_output).abs() > RATIO_FRACTION * by_output.abs());
        }
    }

    /// Drops readings that no shift needs.
    fn forget(&mut self, time_s: f64) {
        if self.open.is_some() || self.turbine.len().max(self.commands[0].len()) < READINGS_KEPT {
            return;
        }
        let before_s = self.before_s();
        let speeds = [&mut self.engine, &mut self.turbine, &mut self.output, &mut self.engine_torque];
        for series in speeds.into_iter().chain(&mut self.commands).chain(&mut self.pressures) {
            *series = series.part([time_s - before_s, f64::INFINITY]);
        }
    }

    /// Ends a shift: keeps it, or says why not.
    fn close(&mut self, open: Open) {
        self.open = None;
        let Open { gears, begun_s, lock_up, .. } = open;
        let name = format!("{} at {begun_s:.2} s", self.car.shift_name(gears));
        let mut log = match self.cut(open, &name) {
            Ok(log) => log,
            Err(reason) => return self.found.skipped.push(format!("{name}: {reason}")),
        };
        let rows = self.tables.tables();
        let Some(row) = rows.commanded(gears) else { return };
        let found = log.find_slip(row).and_then(|()| match (&self.car.converter, lock_up) {
            _ if self.begins_within(&log, row) => {
                Err("its commands begin too late to know the oil volume of its pistons")
            }
            (Some(_), true) => Err("the lock-up clutch of the converter was applied"),
            (Some(_), false) if log.engine.between(log.slip_s).count() < 2 => Err("the engine speed is missing"),
            (None, _) if log.engine_torque.between(log.slip_s).count() < 2 => Err("the engine torque is missing"),
            _ => Ok(()),
        });
        match found {
            Ok(()) => self.found.shifts.push(log),
            Err(reason) => self.found.skipped.push(format!("{name}: {reason}")),
        }
    }

    /// How long before a shift readings are kept, s.
    fn before_s(&self) -> f64 {
        BEFORE_S.max(self.emptied_s)
    }

    /// Whether the commands of a shift of pistons with a stroke begin so late that the pistons may have moved before.
    fn begins_within(&self, log: &ShiftLog, row: &ShiftRow<f64>) -> bool {
        let is_late =
            |commands: &Series| commands.time_s.first().is_none_or(|first_s| *first_s > log.slip_s[0] - self.emptied_s);
        self.emptied_s > 0.0 && log.transmitted(row).any(is_late)
    }

    /// The readings of a shift.
    fn cut(&self, open: Open, name: &str) -> Result<ShiftLog, &'static str> {
        let gears = open.gears;
        let ended_s = open.ended_s.ok_or("the log ends within it")?;
        if ended_s - open.begun_s > LONGEST_S {
            return Err("it takes longer than any shift");
        }
        let forward = |gear: Gear| gear.place().filter(|_| self.car.ratio(gear).is_some_and(|ratio| ratio > 0.0));
        let [Some(from), Some(to)] = [gears.from, gears.to].map(forward) else {
            return Err("it is not between forward gears");
        };
        let rows = self.tables.tables();
        let row = rows.commanded(gears).ok_or("it is not from one clutch to another")?;
        if row.clutches.iter().any(|clutch| clutch.element.is_dog()) {
            return Err("one of its elements is a dog");
        }
        if !is_fitted(row) {
            return Err("one-way clutches overrun while its elements slip, and none transmits torque");
        }
        let span = [open.begun_s - 0.1, ended_s + AFTER_S];
        let commands = row.clutches.map(|clutch| {
            let all = clutch.element.place().and_then(|place| self.commands.get(place));
            all.map(|all| all.part([open.begun_s - self.before_s(), span[1]])).unwrap_or_default()
        });
        let pressure = [0, 1].map(|which| {
            let place = row.clutches[which].element.place();
            let all = place.and_then(|place| self.pressures.get(place));
            with_rest(&self.pressure[which], all, [open.begun_s - AFTER_S, span[1]])
        });
        Ok(ShiftLog {
            name: name.to_owned(),
            gears: [from, to],
            command_s: [open.begun_s, ended_s],
            engine: self.engine.part(span),
            turbine: self.turbine.part(span),
            output: self.output.part(span),
            engine_torque: self.engine_torque.part(span),
            commands,
            pressure,
            slip_s: [f64::NAN; 2],
            lock_up: open.lock_up,
            oil_degc: self.oil_degc,
        })
    }
}

/// The pressure of a clutch in a shift, with the readings of its element around it where they are of the same sensor.
fn with_rest(in_shift: &Series, element: Option<&Series>, span_s: [f64; 2]) -> Series {
    let around =
        element.zip(in_shift.time_s.first().zip(in_shift.time_s.last())).and_then(|(element, (from_s, to_s))| {
            let is_same = element.part([*from_s, *to_s]).value == in_shift.value;
            is_same.then(|| element.part(span_s))
        });
    around.unwrap_or_else(|| in_shift.clone())
}

/// Longest time in which a piston of a car goes back to its stop under no pressure of its valve, s.
fn emptied_s(car: &Car) -> f64 {
    /// A piston with hardly any preload takes longer; its shifts would have no beginning \[chosen\].
    const LONGEST_S: f64 = 5.0;
    let strokes = car.clutches.iter().flatten().filter(|clutch| clutch.has_stroke).map(|clutch| clutch.cylinder);
    // The slowest is the flow at the end, by the preload alone.
    strokes
        .map(|cylinder| cylinder.stroke_m3 / cylinder.flow(-cylinder.preload_pa).abs())
        .fold(0.0, f64::max)
        .min(LONGEST_S)
}
