//! The shifts of a log that a fit can use.

use std::path::Path;

use car::ShiftClutch;
use car::Vehicle;
use drivetrain::{ClutchValve, CommandKind};
use logs::{
    ChannelMap, Direction, Gearbox, Load, Log, LogError, Mapped, Quality, Reading, Readings, Role, Shift, ShiftFinder,
};
use trace::{ShownPath as _, Unit, signal};

use crate::drives::driven_car;
use crate::driving::{Driving, DrivingRecorder, RowState, turns_by};
use crate::{FitError, Given, Series, ShiftKinds, ShiftRecord};

/// Readings are kept from so long before the inertia phase on, s: the commands of the torque phase and of the fill.
const BEFORE_S: f64 = 2.0;
/// And until so long after it, s.
const AFTER_S: f64 = 1.5;

/// A log as a fit reads it: twice.
#[derive(Clone, Copy)]
pub struct LogSource<'a> {
    /// What messages call it.
    pub path: &'a Path,
    /// Its channels; none where they have the names of the program.
    pub map: &'a ChannelMap,
    /// Opens it at its begin.
    pub open: &'a dyn Fn() -> Result<Log, LogError>,
    /// Whether the reading is to end with an error.
    pub is_stopped: &'a dyn Fn() -> bool,
}

/// What was found in a log.
#[derive(Debug, Clone, Default)]
pub struct Collected {
    /// The shifts.
    pub shifts: Vec<ShiftRecord>,
    /// Driving between the shifts, of each log.
    pub driving: Vec<Driving>,
    /// Shifts that are not used, each with the reason.
    pub skipped: Vec<String>,
    /// How many of which kind there are.
    pub kinds: ShiftKinds,
    /// What is to be said about the log.
    pub notes: Vec<String>,
}

impl Collected {
    /// Adds what another log has. A shift tells what it has to tell once: copies are left out, and of a log that is a copy the driving too.
    pub fn add(&mut self, more: Self) {
        let before = self.shifts.len();
        let count = more.shifts.len();
        for record in more.shifts {
            match record.copied_from(&self.shifts) {
                Some(first) => self.skipped.push(format!("{}: the same readings as {}", record.name, first.name)),
                None => self.shifts.push(record),
            }
        }
        if count == 0 || self.shifts.len() > before {
            self.driving.extend(more.driving);
        }
        self.skipped.extend(more.skipped);
        self.kinds.add(more.kinds);
        self.notes.extend(more.notes);
    }
}

/// The map of a log whose channels have the names of the program: a role and a unit, such as `engine_speed_rad_s`.
///
/// # Errors
/// The log has ages of readings in columns.
pub fn own_names(log: &Log) -> Result<ChannelMap, FitError> {
    let mut map = ChannelMap::default();
    let names = || log.channels().iter().map(|channel| channel.name.as_str());
    if let Some(age) = names().find(|name| signal::AGES.iter().any(|(_, age)| age == name)) {
        return Err(FitError::input(format!(
            "{}: column `{age}` has ages of readings, which a fit does not read\n\
             hint: give a log in which each channel has its own times, with --map",
            log.path().shown()
        )));
    }
    for name in names() {
        // The engine torque that a controller reports is called so in tables of the program.
        let plain = name.strip_prefix("reported_").unwrap_or(name);
        let role = Role::all().filter(|role| plain.strip_prefix(role.name()).is_some_and(|rest| rest.starts_with('_')));
        let Some(role) = role.max_by_key(|role| role.name().len()) else { continue };
        let unit = Unit::of_name(name).map(|unit| unit.quantity);
        if unit.is_some() && unit == role.quantity() && !map.has(role) {
            map.channels.push(Mapped::new(role, name));
        }
    }
    Ok(map)
}

/// Finds the shifts of the vehicle in a log. Without channels in the map, the log has the names of the program.
///
/// # Errors
/// The log cannot be read, lacks a channel that a fit needs, or the reading was stopped.
pub fn collect(source: LogSource<'_>, given: &Given) -> Result<Collected, FitError> {
    let vehicle = &given.vehicle;
    let LogSource { path, map, .. } = source;
    if path == Path::new("-") {
        return Err(FitError::input("a fit reads a log twice\nhint: give a file instead of standard input"));
    }
    let ratios = vec![vehicle.shift.ratio_offgoing(), vehicle.shift.ratio_oncoming()];
    let mut log = (source.open)()?;
    let mut map =
        if map.channels.is_empty() { ChannelMap { open: map.open.clone(), ..own_names(&log)? } } else { map.clone() };
    map.gearbox = Gearbox { ratios, ..map.gearbox };
    let commands = commands(vehicle);
    needed(path, &map, commands[0])?;
    let (shifts, mut notes) = find(&mut log, &map, source.is_stopped)?;
    let mut collected = Collected::default();
    let mut between = BetweenShifts::new(given, &shifts);
    let mut usable = Vec::new();
    for shift in shifts {
        match reason_against(&shift) {
            None => usable.push(shift),
            Some(reason) => {
                collected.kinds.count(shift.direction, shift.load, false);
                collected.skipped.push(format!("{}: {reason}", name(path, shift.start_s())));
            }
        }
    }
    collected.notes.append(&mut notes);
    for (mut record, shift) in read(source, &map, commands, &usable, &mut between)?.into_iter().zip(&usable) {
        let found = record.find_segments(&vehicle.shift);
        collected.kinds.count(shift.direction, shift.load, found.is_ok());
        match found {
            Ok(()) => collected.shifts.push(record),
            Err(reason) => collected.skipped.push(format!("{}: {reason}", record.name)),
        }
    }
    collected.driving.push(Driving { log: path.shown().to_string(), ..between.recorder.finish() });
    Ok(collected)
}

/// Roles of the commands of both valves.
fn commands(vehicle: &Vehicle) -> [Role; 2] {
    match vehicle.oncoming.valve.command_kind() {
        CommandKind::Current => [Role::OncomingCurrent, Role::OffgoingCurrent],
        CommandKind::DutyCycle => [Role::OncomingDuty, Role::OffgoingDuty],
    }
}

fn needed(path: &Path, map: &ChannelMap, command: Role) -> Result<(), FitError> {
    let needed = [Role::EngineSpeed, Role::TurbineSpeed, Role::OutputSpeed, command];
    match needed.into_iter().find(|role| !map.has(*role)) {
        None => Ok(()),
        Some(missing) => Err(FitError::input(format!(
            "{}: there is no {role}, and a fit needs {}\n\
             hint: name its channel with --map or `--channel {role}=NAME`; `wetclutch inspect` lists the channels",
            path.shown(),
            needed.map(Role::name).join(", "),
            role = missing.name(),
        ))),
    }
}

/// Why a shift cannot be used, if so.
fn reason_against(shift: &Shift) -> Option<&'static str> {
    match shift {
        Shift { direction: Direction::Down, .. } => Some("a downshift"),
        Shift { load: Load::PowerOff, .. } => Some("a power-off shift"),
        Shift { inertia_s: None, .. } => Some("the speeds do not show its inertia phase"),
        _ => None,
    }
}

fn name(path: &Path, time_s: f64) -> String {
    format!("{} at {time_s:.2} s", path.shown())
}

/// The shifts of a log, and what is to be said about its channels.
fn find(log: &mut Log, map: &ChannelMap, is_stopped: &dyn Fn() -> bool) -> Result<(Vec<Shift>, Vec<String>), FitError> {
    let mut finder = ShiftFinder::new(&map.gearbox, |role| map.has(role))?;
    let mut readings = Readings::new(log, map)?.of_gearbox(&map.gearbox.ratios);
    let mut resets = 0;
    while let Some(reading) = readings.next_or_refused() {
        let reading = reading?;
        if is_stopped() {
            return Err(FitError::Stopped);
        }
        if readings.resets() > resets {
            resets = readings.resets();
            finder.restart();
        }
        finder.push(&reading);
    }
    readings.check()?;
    let mut notes = readings.notes().to_vec();
    for summary in readings.summary() {
        let (good, total) = (summary.counts.of(Quality::Good), summary.counts.total());
        if good < total {
            let (role, faults) = (summary.role.name(), summary.counts.faults());
            notes.push(format!("{} of {total} samples of {role} are not used: {faults}", total - good));
        }
    }
    Ok((finder.finish(), notes))
}

/// The readings around each of these shifts, and between all.
fn read(
    source: LogSource<'_>,
    map: &ChannelMap,
    commands: [Role; 2],
    shifts: &[Shift],
    between: &mut BetweenShifts,
) -> Result<Vec<ShiftRecord>, FitError> {
    let mut log = (source.open)()?;
    let record = |shift: &Shift| {
        let [begin_s, end_s] = inertia_s(shift);
        ShiftRecord { name: name(source.path, begin_s), lock_s: end_s - begin_s, ..ShiftRecord::default() }
    };
    let mut records: Vec<ShiftRecord> = shifts.iter().map(record).collect();
    let windows = Windows::of(shifts);
    for reading in Readings::new(&mut log, map)?.of_gearbox(&map.gearbox.ratios) {
        let reading = reading?;
        if (source.is_stopped)() {
            return Err(FitError::Stopped);
        }
        between.take(&reading, commands);
        for at in windows.around(reading.time_s) {
            if let Some(series) = place(&mut records[at], reading.role, commands) {
                series.push(reading.time_s - inertia_s(&shifts[at])[0], reading.value);
            }
        }
    }
    Ok(records)
}

/// Times around shifts whose readings belong to them.
struct Windows {
    /// Begin and end of each, s.
    spans_s: Vec<[f64; 2]>,
    /// Whether both never fall: the clock of a log may go back.
    is_sorted: bool,
}

impl Windows {
    fn of(shifts: &[Shift]) -> Self {
        let around = |shift: &Shift| {
            let [begin_s, end_s] = inertia_s(shift);
            [begin_s - BEFORE_S, end_s + AFTER_S]
        };
        let spans_s: Vec<[f64; 2]> = shifts.iter().map(around).collect();
        let is_sorted = spans_s.windows(2).all(|pair| pair[0][0] <= pair[1][0] && pair[0][1] <= pair[1][1]);
        Self { spans_s, is_sorted }
    }

    /// The places of the shifts to which a time belongs.
    fn around(&self, time_s: f64) -> impl Iterator<Item = usize> + '_ {
        let ended = |span: &[f64; 2]| span[1] < time_s;
        let first = if self.is_sorted { self.spans_s.partition_point(ended) } else { 0 };
        let last =
            if self.is_sorted { self.spans_s.partition_point(|span| span[0] <= time_s) } else { self.spans_s.len() };
        (first..last).filter(move |at| (self.spans_s[*at][0]..=self.spans_s[*at][1]).contains(&time_s))
    }
}

fn inertia_s(shift: &Shift) -> [f64; 2] {
    shift.inertia_s.unwrap_or([shift.start_s(), shift.end_s()])
}

/// Driving in the gears before and after the shift of the vehicle.
struct BetweenShifts {
    recorder: DrivingRecorder,
    ratios: [f64; 2],
    /// The clutch that is open in each gear: its valve, and its kiss point, Pa.
    open: [(ClutchValve<f64>, f64); 2],
    /// Readings that belong to shifts: none tells what it has to tell twice.
    shifts: Windows,
    /// Newest readings of turbine and output speed and of the commands of the oncoming and the offgoing clutch.
    speeds: [f64; 2],
    commands: [f64; 2],
    lock_up: bool,
}

impl BetweenShifts {
    fn new(Given { vehicle, shafts, .. }: &Given, shifts: &[Shift]) -> Self {
        let open = |clutch: &ShiftClutch| (clutch.valve, clutch.clutch.kiss_pressure());
        Self {
            recorder: DrivingRecorder::new(driven_car(vehicle, shafts)),
            ratios: [vehicle.shift.ratio_offgoing(), vehicle.shift.ratio_oncoming()],
            open: [open(&vehicle.oncoming), open(&vehicle.offgoing)],
            shifts: Windows::of(shifts),
            speeds: [f64::NAN; 2],
            commands: [f64::NAN; 2],
            lock_up: false,
        }
    }

    /// Takes a reading of the log.
    fn take(&mut self, reading: &Reading, commands: [Role; 2]) {
        let mut dated = [None; 4];
        match reading.role {
            Role::EngineSpeed => dated[0] = Some((reading.time_s, reading.value)),
            Role::TurbineSpeed => (dated[1], self.speeds[0]) = (Some((reading.time_s, reading.value)), reading.value),
            Role::OutputSpeed => (dated[2], self.speeds[1]) = (Some((reading.time_s, reading.value)), reading.value),
            Role::WheelSpeed => dated[3] = Some((reading.time_s, reading.value)),
            Role::LockUpApplied => self.lock_up = reading.value > 0.5,
            role => {
                let which = commands.iter().position(|command| *command == role);
                return which.into_iter().for_each(|which| self.commands[which] = reading.value);
            }
        }
        let state = RowState { gear: self.gear(reading.time_s), lock_up: self.lock_up };
        self.recorder.push(reading.time_s, dated, None, state);
    }

    /// The gear by the ratio of the speeds; none in a shift, or where the clutch of the other gear may carry torque.
    fn gear(&self, time_s: f64) -> Option<usize> {
        let [turbine, output] = self.speeds;
        let gear = self.ratios.iter().position(|ratio| turns_by(*ratio, turbine, output))?;
        let is_shift = self.shifts.around(time_s).next().is_some();
        let (valve, kiss_pa) = self.open[gear];
        // A command that is not logged says nothing against it.
        let command = Some(self.commands[gear]).filter(|command| command.is_finite());
        let is_open = command.is_none_or(|command| valve.settled_pressure(command) < kiss_pa);
        (!is_shift && is_open).then_some(gear)
    }
}

/// Where the readings of a role belong; none if a fit does not use them.
fn place(record: &mut ShiftRecord, role: Role, [oncoming, offgoing]: [Role; 2]) -> Option<&mut Series> {
    match role {
        Role::EngineSpeed => Some(&mut record.engine),
        Role::TurbineSpeed => Some(&mut record.turbine),
        Role::OutputSpeed => Some(&mut record.output),
        Role::WheelSpeed => Some(&mut record.wheel),
        Role::OncomingPressure => Some(&mut record.pressure),
        Role::EngineTorque => Some(&mut record.engine_torque),
        _ if role == oncoming => Some(&mut record.oncoming),
        _ if role == offgoing => Some(&mut record.offgoing),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use config::VehicleFile;
    use logs::ShiftQuality;

    use super::*;

    #[test]
    fn a_time_is_in_the_same_windows_whether_they_are_sorted_or_not() {
        let spans_s: Vec<[f64; 2]> = (0..40_u8).map(|i| 2.5 * f64::from(i)).map(|at_s| [at_s, at_s + 4.0]).collect();
        let sorted = Windows { spans_s: spans_s.clone(), is_sorted: true };
        let any = Windows { spans_s, is_sorted: false };
        for k in -20..1_100_i16 {
            let time_s = 0.1 * f64::from(k);
            let [one, other] = [&sorted, &any].map(|windows| windows.around(time_s).collect::<Vec<_>>());
            assert_eq!(one, other, "{time_s}");
        }
        assert!(sorted.around(f64::NAN).next().is_none() && sorted.around(3.0).count() == 2);
    }

    /// What a shift has told is not used again, and a clutch that may carry torque makes no gear.
    #[test]
    fn a_gear_is_one_outside_of_shifts_with_the_other_clutch_open() {
        let file = VehicleFile::built_in().unwrap();
        let given = Given { shafts: file.shafts().unwrap(), vehicle: file.vehicle, text: file.source.text };
        let shift = Shift {
            from: 1,
            to: 2,
            direction: Direction::Up,
            load: Load::PowerOn,
            command_s: None,
            inertia_s: Some([20.0, 20.5]),
            gear_s: None,
            quality: ShiftQuality::default(),
        };
        let mut between = BetweenShifts::new(&given, &[shift]);
        assert_eq!(between.gear(0.0), None);
        between.speeds = [between.ratios[0] * 60.0, 60.0];
        assert_eq!([17.9, 18.1, 21.9, 22.1].map(|time_s| between.gear(time_s)), [Some(0), None, None, Some(0)]);
        between.speeds = [between.ratios[1] * 60.0, 60.0];
        assert_eq!(between.gear(30.0), Some(1));
        between.commands = [1.0, f64::NAN];
        assert_eq!(between.gear(30.0), Some(1));
        between.speeds = [between.ratios[0] * 60.0, 60.0];
        assert_eq!(between.gear(30.0), None);
        between.commands = [0.0, 1.0];
        assert_eq!(between.gear(30.0), Some(0));
    }
}
