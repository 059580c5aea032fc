//! A log as the observers read it, with the shifts that were found in it.

use std::collections::VecDeque;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use car::Vehicle;
use drivetrain::{ClutchValve, CommandKind};
use logs::plausibility::Seen;
use logs::{ChannelMap, Gearbox, GearsOfShift, Log, OnChange, Reading, Readings, Role, Shift, ShiftFinder, Steps};
use observer::{ChannelHealth, Input, Reading as Measurement};
use study::gearbox::pressure_command::command_of_valve;
use study::log::{Beside, FIRST_LOOK, LogRow, Truth};
use trace::{CsvRows, ShownPath as _, signal};

use crate::estimate::input::LogInput;
use crate::estimate::log_checks::{check_dbc, check_step, report_readings, sent_on_change};
use crate::estimate::watched::{WatchedColumn, WatchedColumns};
use crate::{Error, Notes, grouped};

/// Steps of a followed log that are looked at before the first estimate.
const FOLLOWED_LOOK: usize = 50;

/// A log with its shifts.
pub(crate) struct Measured<'a> {
    source: Source<'a>,
    /// The step that [`Self::advance`] went on to.
    pub(crate) step: Step,
    finder: ShiftFinder,
    /// Ratios of the gears that the finder numbers, 1st first.
    pub(crate) ratios: Vec<f64>,
    resets: u32,
    /// The gears of the vehicle's shift among those of the gearbox; none if it has no more.
    gears: Option<GearsOfShift>,
    /// Time since the last step in them, s.
    waited_s: f64,
    looked_at: LookedAt,
    /// Of the oncoming and of the offgoing clutch, and whether the log shows that they are sent on change.
    commands: [(OnChange, bool); 2],
}

/// What came in the steps before the first estimate.
#[derive(Default)]
struct LookedAt {
    steps: u64,
    has_engine: bool,
    has_wheel: bool,
}

impl LookedAt {
    fn of<'i>(inputs: impl Iterator<Item = &'i Input<f64>>) -> Self {
        let mut seen = Self::default();
        for input in inputs {
            seen.steps += 1;
            seen.has_engine |= input.engine_rad_s.is_some();
            seen.has_wheel |= input.wheel_rad_s.is_some();
        }
        seen
    }
}

/// Rows of signals with the names of the program, or channels with clocks of their own.
enum Source<'a> {
    Rows(Box<Rows>),
    Channels(Box<Channels<'a>>),
}

struct Rows {
    log: study::log::Log,
    /// What came along with the input of the newest row.
    row: LogRow,
    /// Values of the signals in their columns, to tell wrong units.
    watched: WatchedColumns,
    /// Rows that were looked at before the first estimate and not read since.
    ahead: u64,
}

/// Steps of mapped channels. The first are looked at before the first estimate, as those of a table are.
struct Channels<'a> {
    steps: Steps<'a>,
    /// The valve for whose command the pressure that is asked of it stands, and its maximum pressure, Pa, where the map has no other
    /// command.
    asked_of: Option<(ClutchValve<f64>, f64)>,
    looked_at: VecDeque<(Step, Vec<Reading>)>,
    median_step_s: f64,
}

/// What is known at one time.
pub(crate) struct Step {
    /// Time of the step, s.
    pub(crate) time_s: f64,
    /// What the observer is given.
    pub(crate) input: Input<f64>,
    /// The truth, in a simulated log.
    pub(crate) truth: Option<Truth>,
    resets: u32,
    /// Whether the car is in another gear than those of the vehicle file's shift: its observer is not valid there.
    pub(crate) is_other_gear: bool,
    /// Measured pressure of the oncoming clutch, Pa.
    pub(crate) pressure_pa: Option<Measurement<f64>>,
    /// Measured torque of the oncoming clutch, N m.
    pub(crate) torque_n_m: Option<Measurement<f64>>,
    /// Shifts that ended some seconds ago, and are known now.
    pub(crate) shifts: Vec<Shift>,
}

impl Step {
    fn new(time_s: f64, input: Input<f64>, resets: u32) -> Self {
        let (truth, pressure_pa, torque_n_m, shifts) = (None, None, None, Vec::new());
        Self { time_s, input, truth, resets, is_other_gear: false, pressure_pa, torque_n_m, shifts }
    }

    /// Before the first step.
    fn none() -> Self {
        Self::new(f64::NAN, Input::none(0.0), 0)
    }

    /// Takes what came along with the input in a row of a table with the names of the program.
    fn take_row(&mut self, row: &LogRow, resets: u32) {
        let now = |value: f64| Some(Measurement::now(value)).filter(|_| value.is_finite());
        (self.time_s, self.truth, self.resets) = (row.time_s, row.truth, resets);
        (self.pressure_pa, self.torque_n_m) = (now(row.beside.pressure_pa), now(row.beside.torque_n_m));
    }

    /// A step of channels with these readings.
    fn of_channels(time_s: f64, input: Input<f64>, resets: u32, readings: &[Reading]) -> Self {
        let newest = |role: Role| {
            let reading = readings.iter().rev().find(|reading| reading.role == role)?;
            Some(Measurement { value: reading.value, age_s: (time_s - reading.time_s).max(0.0) })
        };
        Self {
            pressure_pa: newest(Role::OncomingPressure),
            torque_n_m: newest(Role::OncomingTorque),
            ..Self::new(time_s, input, resets)
        }
    }
}

/// Gives the readings of a row of a table with the names of the program to the shift finder.
fn each_reading(input: &Input<f64>, row: &LogRow, mut see: impl FnMut(&Reading)) {
    let stamp_s = row.time_s;
    let mut see = |role: Role, value: f64, age_s: f64| {
        see(&Reading { role, time_s: stamp_s - age_s, stamp_s, value });
    };
    let speeds = [
        (Role::EngineSpeed, input.engine_rad_s),
        (Role::TurbineSpeed, input.turbine_rad_s),
        (Role::WheelSpeed, input.wheel_rad_s),
        (Role::OutputSpeed, input.output_rad_s),
    ];
    for (role, reading) in speeds {
        if let Some(Measurement { value, age_s }) = reading {
            see(role, value, age_s);
        }
    }
    let Beside { pressure_pa, torque_n_m, engine_n_m, throttle, vehicle_m_s, vehicle_m_s2 } = row.beside;
    for (role, value) in [
        (Role::OncomingPressure, pressure_pa),
        (Role::OncomingTorque, torque_n_m),
        (Role::EngineTorque, engine_n_m),
        (Role::Throttle, throttle),
        (Role::VehicleSpeed, vehicle_m_s),
        (Role::VehicleAcceleration, vehicle_m_s2),
    ] {
        if value.is_finite() {
            see(role, value, 0.0);
        }
    }
}

impl<'a> Measured<'a> {
    /// A table with the names of the program. `stop` ends one that is followed.
    pub(crate) fn rows(input: LogInput<'_>, vehicle: &Vehicle, stop: Option<&Arc<AtomicBool>>) -> Result<Self, Error> {
        let path = input.path;
        if input.needs_map()? {
            check_dbc(path, &input.open(stop, 1)?)?;
            return Err(Error::Input(format!(
                "{}: this log needs a channel map\nhint: `wetclutch inspect` with --suggest writes a first one, for --map",
                path.shown()
            )));
        }
        let look = if stop.is_some() { FOLLOWED_LOOK } else { FIRST_LOOK };
        let rows = input.rows(stop)?;
        let mut watched = watched(&rows, vehicle, look);
        let open = if stop.is_some() { study::log::Log::following } else { study::log::Log::of };
        let log = open(rows, vehicle, look)?;
        log.looked_at().for_each(|(input, _)| watched.push(values(input)));
        check_step(path, log.median_step_s(), false)?;
        watched.check(Seen::Beginning)?;
        let gearbox = of_vehicle(vehicle);
        // Turbine and output speed are there, and tell shifts.
        let finder = ShiftFinder::new(&gearbox, |role| has(&log, role))?;
        let ahead = watched.rows();
        let looked_at = LookedAt::of(log.looked_at().map(|(input, _)| input));
        let source = Source::Rows(Box::new(Rows { log, row: LogRow::NONE, watched, ahead }));
        Ok(Self::of(source, finder, gearbox.ratios, None, looked_at, [OnChange::default(); 2]))
    }

    /// Channels of a log by a map.
    pub(crate) fn channels(
        path: &Path,
        log: &'a mut Log,
        map: &ChannelMap,
        vehicle: &Vehicle,
        is_followed: bool,
    ) -> Result<Self, Error> {
        let command = match vehicle.settings.valve.command_kind() {
            CommandKind::Current => Role::OncomingCurrent,
            CommandKind::DutyCycle => Role::OncomingDuty,
        };
        let asked = Role::OncomingPressureCommand;
        let command = if !map.has(command) && map.has(asked) { asked } else { command };
        if !map.has(command) {
            return Err(Error::Input(format!(
                "the channel map has no {0}, the command of this vehicle's valve: without it no pressure can be estimated\n\
                 hint: add `[channel.{0}]` or --channel {0}=NAME if the log has it, or {1} if it has the pressure that is asked of the clutch",
                command.name(),
                asked.name()
            )));
        }
        let needed = [Role::TurbineSpeed, Role::OutputSpeed, command];
        if let Some(missing) = needed.into_iter().find(|role| !map.has(*role)) {
            return Err(Error::Input(format!(
                "the channel map has no {}\nhint: an estimate needs {}; add `[channel.{}]` or --channel {0}=NAME",
                missing.name(),
                needed.map(Role::name).join(", "),
                missing.name(),
            )));
        }
        // Another kind of command is no reading of this valve.
        let mut map = map.clone();
        let commands = [Role::OncomingCurrent, Role::OncomingDuty, asked];
        map.channels.retain(|entry| entry.role == command || !commands.contains(&entry.role));
        let own = of_vehicle(vehicle);
        let gearbox = Gearbox {
            ratios: if map.gearbox.ratios.len() >= 2 { map.gearbox.ratios.clone() } else { own.ratios },
            output_rad_per_m: map.gearbox.output_rad_per_m.or(own.output_rad_per_m),
            wheel_radius_m: map.gearbox.wheel_radius_m,
        };
        let finder = ShiftFinder::new(&gearbox, |role| map.has(role))?;
        let look = if is_followed { FOLLOWED_LOOK } else { FIRST_LOOK };
        let mut channels = Channels {
            steps: Steps::new(Readings::new(log, &map)?.of_gearbox(&map.gearbox.ratios)),
            asked_of: (command == asked).then_some((vehicle.oncoming.valve, vehicle.error_bounds.pressure_max_pa)),
            looked_at: VecDeque::new(),
            median_step_s: f64::NAN,
        };
        while channels.looked_at.len() < look
            && let Some(step) = channels.read()
        {
            channels.looked_at.push_back(step?);
        }
        // Wrong units are an error before the first estimate.
        channels.steps.readings().check_first_units()?;
        let steps_s = channels.looked_at.iter().skip(1).map(|(step, _)| step.input.dt_s);
        channels.median_step_s = trace::median_step_s(steps_s.collect());
        check_step(path, channels.median_step_s, true)?;
        let shift = [vehicle.shift.ratio_offgoing(), vehicle.shift.ratio_oncoming()];
        let gears = GearsOfShift::new(&gearbox, shift);
        let looked_at = LookedAt::of(channels.looked_at.iter().map(|(step, _)| &step.input));
        let source = Source::Channels(Box::new(channels));
        let on_change = |roles: [Role; 2]| {
            let mut mapped = map.channels.iter().filter(|mapped| mapped.sent_on_change);
            mapped
                .find(|mapped| roles.contains(&mapped.role))
                .map_or_else(OnChange::default, |mapped| OnChange::by_map(mapped.delay_s))
        };
        let commands = [on_change([command; 2]), on_change([Role::OffgoingCurrent, Role::OffgoingDuty])];
        Ok(Self::of(source, finder, gearbox.ratios, gears, looked_at, commands))
    }

    fn of(
        source: Source<'a>,
        finder: ShiftFinder,
        ratios: Vec<f64>,
        gears: Option<GearsOfShift>,
        looked_at: LookedAt,
        mut commands: [OnChange; 2],
    ) -> Self {
        let mut look = |input: &Input<f64>| {
            for (command, reading) in commands.iter_mut().zip([input.command, input.offgoing_command]) {
                command.look(input.dt_s, reading.map(|reading| reading.value));
            }
        };
        match &source {
            Source::Rows(rows) => rows.log.looked_at().for_each(|(input, _)| look(input)),
            Source::Channels(channels) => channels.looked_at.iter().for_each(|(step, _)| look(&step.input)),
        }
        let commands = commands.map(|mut command| {
            let is_shown = command.is_shown();
            (command, is_shown)
        });
        Self { source, step: Step::none(), finder, ratios, resets: 0, gears, waited_s: 0.0, looked_at, commands }
    }

    /// Whether a reading of the wheel speed came before the first estimate.
    pub(crate) fn has_wheel_speed(&self) -> bool {
        self.looked_at.has_wheel
    }

    /// The same of the engine speed.
    pub(crate) fn has_engine_speed(&self) -> bool {
        self.looked_at.has_engine
    }

    /// Refuses a log without engine or wheel speed.
    pub(crate) fn require(&self, role: Role) -> Result<(), Error> {
        let (comes, column, hint) = match role {
            Role::WheelSpeed => (self.has_wheel_speed(), signal::WHEEL_SPEED, "rigid"),
            _ => (self.has_engine_speed(), signal::ENGINE_SPEED, "open-loop"),
        };
        if comes {
            return Ok(());
        }
        let name = role.name();
        match &self.source {
            Source::Rows(rows) => rows.log.require(column)?,
            Source::Channels(channels) if channels.maps(role) => {}
            Source::Channels(_) => {
                return Err(Error::Input(format!(
                    "the channel map has no {name}, which this observer needs\nhint: add `[channel.{name}]`, or use `--observer {hint}`"
                )));
            }
        }
        Err(Error::Input(format!(
            "{name} has no value in any of the first {} samples, and this observer needs it\nhint: use `--observer {hint}`, or check the log with `wetclutch inspect`",
            grouped(self.looked_at.steps)
        )))
    }

    pub(crate) fn median_step_s(&self) -> f64 {
        match &self.source {
            Source::Rows(rows) => rows.log.median_step_s(),
            Source::Channels(channels) => channels.median_step_s,
        }
    }

    /// Takes the readings of the step that the observer refused back from the shift finder, before a shift is known that has them.
    pub(crate) fn take_back(&mut self, channels: &observer::Channels<ChannelHealth>) {
        let Input { engine_rad_s, turbine_rad_s, output_rad_s, .. } = &self.step.input;
        for (role, reading, health) in [
            (Role::EngineSpeed, engine_rad_s, channels.engine),
            (Role::TurbineSpeed, turbine_rad_s, channels.turbine),
            (Role::OutputSpeed, output_rad_s, channels.output),
        ] {
            if let Some(Measurement { age_s, .. }) = reading.filter(|_| health.is_refused()) {
                self.finder.take_back(role, self.step.time_s - age_s);
            }
        }
    }

    /// Hands out the step that [`Self::advance`] went on to.
    pub(crate) fn take_step(&mut self) -> Step {
        std::mem::replace(&mut self.step, Step::none())
    }

    /// The shifts that were not given with a step, after the last step.
    pub(crate) fn last_shifts(&mut self) -> Vec<Shift> {
        self.finder.restart();
        self.finder.take_settled(f64::INFINITY)
    }

    /// Says what was met in the log, after its last step.
    ///
    /// # Errors
    /// Most samples of a channel could not be used, or a unit is wrong by all appearances.
    pub(crate) fn finish(&self, say: Notes<'_>) -> Result<(), Error> {
        let shown = self.commands.iter().zip(["oncoming", "offgoing"]).filter(|((_, is_shown), _)| *is_shown);
        let shown: Vec<&str> = shown.map(|(_, name)| name).collect();
        if !shown.is_empty() {
            say(&sent_on_change(&shown.join(", ")));
        }
        let channels = match &self.source {
            Source::Rows(rows) => {
                for note in rows.log.check_readings()? {
                    say(&format!("warning: {note}"));
                }
                return rows.watched.check(Seen::All);
            }
            Source::Channels(channels) => channels,
        };
        // An observer that needs one of them was not chosen, or has refused the log.
        let may_be_empty = [Role::EngineSpeed, Role::WheelSpeed];
        if let Some(contradiction) = self.finder.contradiction() {
            say(&format!("warning: {contradiction}"));
        }
        report_readings(channels.steps.readings(), &may_be_empty, say)
    }
}

/// What the vehicle file says about the gearbox.
fn of_vehicle(vehicle: &Vehicle) -> Gearbox {
    Gearbox {
        ratios: vec![vehicle.shift.ratio_offgoing(), vehicle.shift.ratio_oncoming()],
        output_rad_per_m: Some(vehicle.driveline.final_ratio / vehicle.road.wheel_radius_m),
        wheel_radius_m: None,
    }
}

/// Whether a table with the names of the program has a role that the shift finder reads.
fn has(log: &study::log::Log, role: Role) -> bool {
    match role {
        Role::EngineSpeed | Role::TurbineSpeed | Role::OutputSpeed => true,
        Role::EngineTorque => log.has_beside(signal::ENGINE_TORQUE),
        Role::Throttle => log.has_beside(signal::THROTTLE),
        Role::VehicleSpeed => log.has_beside(signal::VEHICLE_SPEED),
        Role::VehicleAcceleration => log.has_beside(signal::VEHICLE_ACCELERATION),
        _ => false,
    }
}

/// The signals that observers read, in the columns of a table.
fn watched(rows: &CsvRows, vehicle: &Vehicle, look: usize) -> WatchedColumns {
    let command = match vehicle.settings.valve.command_kind() {
        CommandKind::Current => (Role::OncomingCurrent, signal::ONCOMING_CURRENT),
        CommandKind::DutyCycle => (Role::OncomingDuty, signal::ONCOMING_DUTY),
    };
    let columns = [
        (Role::EngineSpeed, signal::ENGINE_SPEED),
        (Role::TurbineSpeed, signal::TURBINE_SPEED),
        (Role::OutputSpeed, signal::OUTPUT_SPEED),
        (Role::WheelSpeed, signal::WHEEL_SPEED),
        command,
    ];
    let columns = columns.map(|(role, column)| WatchedColumn {
        role,
        name: role.name().to_owned(),
        is_in_si: rows.find(column).is_none_or(|column| rows.factor(column) == 1.0),
        // A signal without values shows in the health of the estimate.
        is_needed: false,
    });
    WatchedColumns::new(look, columns)
}

/// The values of a row in the columns of [`watched`].
fn values(input: &Input<f64>) -> [Option<f64>; 5] {
    let readings = [input.engine_rad_s, input.turbine_rad_s, input.output_rad_s, input.wheel_rad_s, input.command];
    readings.map(|reading| reading.map(|reading| reading.value))
}

impl Rows {
    /// Reads the next step; `see` gets its readings, with the resets of the clock so far. False at the end.
    fn read(&mut self, step: &mut Step, mut see: impl FnMut(u32, &Reading)) -> Result<bool, Error> {
        let Self { log, row, .. } = self;
        if !log.advance(&mut step.input, row)? {
            return Ok(false);
        }
        match self.ahead.checked_sub(1) {
            Some(ahead) => self.ahead = ahead,
            None => self.watched.push(values(&step.input)),
        }
        let resets = self.row.resets;
        each_reading(&step.input, &self.row, |reading| see(resets, reading));
        step.take_row(&self.row, resets);
        Ok(true)
    }
}

impl Channels<'_> {
    /// Whether the map has a channel for a role.
    fn maps(&self, role: Role) -> bool {
        self.steps.readings().summary().iter().any(|entry| entry.role == role)
    }

    fn read(&mut self) -> Option<Result<(Step, Vec<Reading>), Error>> {
        let mut readings = Vec::new();
        let step = self.steps.next_seeing(|reading| readings.push(reading))?;
        let resets = self.steps.readings().resets();
        Some(step.map_err(Error::from).map(|mut step| {
            if let (Some((valve, max_pa)), Some(command)) = (&self.asked_of, &mut step.input.command) {
                command.value = command_of_valve(valve, *max_pa, command.value);
            }
            let step = Step::of_channels(step.time_s, step.input, resets, &readings);
            (step, readings)
        }))
    }
}

impl Measured<'_> {
    /// Goes on to the next step; false at the end.
    ///
    /// # Errors
    /// The log cannot be read.
    pub(crate) fn advance(&mut self) -> Result<bool, Error> {
        let Self { source, step, finder, resets, gears, .. } = self;
        // A clock that begins anew begins a new log for the finder, before the first reading of it.
        let mut see = |log_resets: u32, reading: &Reading| {
            if log_resets > *resets {
                *resets = log_resets;
                finder.restart();
            }
            finder.push(reading);
            if let Some(gears) = gears.as_mut() {
                gears.push(reading);
            }
        };
        match source {
            Source::Rows(rows) => {
                if !rows.read(step, see)? {
                    return Ok(false);
                }
            }
            Source::Channels(channels) => {
                let next = match channels.looked_at.pop_front() {
                    Some(next) => next,
                    None => match channels.read() {
                        Some(next) => next?,
                        None => return Ok(false),
                    },
                };
                next.1.iter().for_each(|reading| see(next.0.resets, reading));
                *step = next.0;
            }
        }
        if step.resets > self.resets {
            // It had no reading.
            self.resets = step.resets;
            self.finder.restart();
        }
        step.is_other_gear = self.gears.as_ref().is_some_and(|gears| !gears.is_inside());
        if step.is_other_gear {
            self.waited_s += step.input.dt_s;
        } else {
            step.input.dt_s += std::mem::take(&mut self.waited_s);
        }
        step.shifts = self.finder.take_settled(step.time_s);
        let [(oncoming, _), (offgoing, _)] = &mut self.commands;
        oncoming.stand(&mut step.input.command);
        offgoing.stand(&mut step.input.offgoing_command);
        Ok(true)
    }
}
