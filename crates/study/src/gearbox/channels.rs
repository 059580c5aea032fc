//! A log of a drive of a car with any gearbox, of any format, by a channel map: each channel with a clock of its own.
//!
//! Turbine and output speed, gear and target gear are needed, without a converter the engine torque too; an element without a command has the torque that
//! the speeds show. With a converter the estimate is the open loop where there is no engine speed. Gears are numbers: 1 is the first forward gear, 0 none, and a negative number reverse.

use car::Car;
use car::columns::{element_column, element_commands, element_pressures, pressure_command_column};
use drivetrain::CommandKind;
use logs::{ChannelMap, Log, LogError, Mapped, OnChange, Places, Reading, Readings, Role, Steps};
use observer::Reading as Measured;
use observer::ShiftTables;
use observer::gearbox::{LONGEST_DELAY_S, MAX_ELEMENTS, ShiftInput};

use super::car_log::LogStep;
use super::gear_numbers::GearNumbers;
use super::gear_signal::Gears;
use super::pressure_command::command_for;

/// The channels whose delay by the map the filter takes off.
const DELAYED: [Role; 5] =
    [Role::EngineSpeed, Role::TurbineSpeed, Role::OutputSpeed, Role::WheelSpeed, Role::LongitudinalAcceleration];

/// The newest reading of each entry of a map since the step before.
#[derive(Debug, Clone)]
pub struct Newest(Vec<Option<Reading>>);

/// A step of a log: its time, the time since the one before, and the readings by the entries of the map.
#[derive(Debug, Clone)]
pub struct ChannelStep {
    time_s: f64,
    dt_s: f64,
    readings: Vec<Option<Reading>>,
}

impl Places for Newest {
    type Step = ChannelStep;

    fn emptied(&self) -> Self {
        Self(vec![None; self.0.len()])
    }

    fn place(&mut self, entry: usize, _role: Role) -> Option<&mut Option<Reading>> {
        self.0.get_mut(entry)
    }

    fn close(&self, time_s: f64, dt_s: f64) -> ChannelStep {
        ChannelStep { time_s, dt_s, readings: self.0.clone() }
    }
}

/// An entry of the map.
#[derive(Debug, Clone, Copy)]
struct Entry {
    role: Role,
    /// The element that it is the command of, in the gearbox and in the filter's tables.
    element: Option<(usize, Option<usize>)>,
}

/// A log by its channel map, step by step.
pub struct CarChannels<'a> {
    car: &'a Car,
    numbers: GearNumbers,
    tables: &'a ShiftTables<f64>,
    steps: Steps<'a, Newest>,
    entries: Vec<Entry>,
    /// Commands of which the map says that they are sent on change, by their places in the filter's tables.
    on_change: [OnChange; MAX_ELEMENTS],
    /// Delays by the map, s, in the order of [`DELAYED`].
    delays_s: [f64; 5],
    gears: Gears,
    lock_up_applied: bool,
    pedal: f64,
    vehicle_m_s: Option<f64>,
    oil_degc: Option<f64>,
}

impl<'a> CarChannels<'a> {
    /// Finds the channels.
    ///
    /// # Errors
    /// The map lacks one that is needed, has one of no element, or does not fit the log.
    pub fn of(
        log: &'a mut Log,
        map: &ChannelMap,
        car: &'a Car,
        tables: &'a ShiftTables<f64>,
    ) -> Result<Self, LogError> {
        let entries = map.channels.iter().map(|entry| entry_of(entry, car, tables)).collect::<Result<Vec<_>, _>>()?;
        require(map, car, tables)?;
        let mut on_change = [OnChange::default(); MAX_ELEMENTS];
        for (mapped, entry) in map.channels.iter().zip(&entries).filter(|(mapped, _)| mapped.sent_on_change) {
            if let Some((_, Some(place))) = entry.element {
                on_change[place] = OnChange::by_map(mapped.delay_s);
            }
        }
        let delays_s = DELAYED
            .map(|role| map.channels.iter().find(|mapped| mapped.role == role).map_or(0.0, |mapped| mapped.delay_s));
        let readings = Readings::new(log, map)?.of_gearbox(&car.gearbox.ratios());
        let steps = Steps::into(Newest(vec![None; entries.len()]), readings);
        let gears = Gears::new([Role::Gear, Role::TargetGear].map(Role::name));
        let (lock_up_applied, pedal, vehicle_m_s, oil_degc) = (false, f64::NAN, None, None);
        Ok(Self {
            car,
            numbers: GearNumbers::of(car),
            tables,
            steps,
            entries,
            on_change,
            delays_s,
            gears,
            lock_up_applied,
            pedal,
            vehicle_m_s,
            oil_degc,
        })
    }

    /// The commands by their places in the filter's tables, with those of which the map says that they are sent on change.
    pub fn commands_on_change(&self) -> [OnChange; MAX_ELEMENTS] {
        self.on_change
    }

    /// Delays by the map of engine, turbine, output and wheel speed and of the longitudinal acceleration, s, each up to [`LONGEST_DELAY_S`]. They are not in the ages of the readings: the filter takes them
    /// off ([`evaluate::logged::LoggedDrive::with_delays`]).
    pub fn delays_s(&self) -> [f64; 5] {
        self.delays_s.map(|delay_s| delay_s.min(LONGEST_DELAY_S))
    }

    /// Whether the map has a longitudinal acceleration.
    pub fn has_acceleration(&self) -> bool {
        self.entries.iter().any(|entry| entry.role == Role::LongitudinalAcceleration)
    }

    /// The readings, with their summary and notes.
    pub fn readings(&self) -> &Readings<'a> {
        self.steps.readings()
    }

    /// What was met in the gears, in sentences.
    ///
    /// # Errors
    /// Most samples of a gear are no gear of the gearbox.
    pub fn check_gears(&self) -> Result<Vec<String>, LogError> {
        let hint = format!(
            "gears are numbers from 1 to {}, 0 for none, and negative for reverse; use `scale` and `offset` of the channel map",
            self.numbers.highest()
        );
        self.gears.notes(&hint).map_err(LogError::map)
    }

    /// The next step; `None` at the end.
    ///
    /// # Errors
    /// The log cannot be read.
    pub fn next_step(&mut self) -> Result<Option<LogStep>, LogError> {
        let Some(step) = self.steps.next() else { return Ok(None) };
        let ChannelStep { time_s, dt_s, readings } = step?;
        let (mut commands, mut pressures) = ([None; MAX_ELEMENTS], [None; MAX_ELEMENTS]);
        let (mut of_role, mut of_car, mut oncoming) = ([None; 6], None, [None; 2]);
        let mut changed_gear = [None; 2];
        for (Entry { role, element }, reading) in self.entries.iter().zip(&readings) {
            let Some(reading) = reading else { continue };
            let age_s = match DELAYED.iter().position(|delayed| delayed == role) {
                Some(at) => (time_s - reading.stamp_s).max(0.0) + (self.delays_s[at] - LONGEST_DELAY_S).max(0.0),
                None => (time_s - reading.time_s).max(0.0),
            };
            let measured = Measured { value: reading.value, age_s };
            match role {
                Role::EngineSpeed => of_role[0] = Some(measured),
                Role::TurbineSpeed => of_role[1] = Some(measured),
                Role::OutputSpeed => of_role[2] = Some(measured),
                Role::WheelSpeed => of_role[3] = Some(measured),
                Role::EngineTorque => of_role[4] = Some(measured),
                Role::LongitudinalAcceleration => of_role[5] = Some(measured),
                Role::Gear => changed_gear[0] = Some(measured.value),
                Role::TargetGear => changed_gear[1] = Some(measured.value),
                Role::LockUpApplied => self.lock_up_applied = measured.value > 0.5,
                Role::Throttle => self.pedal = measured.value,
                Role::VehicleSpeed => {
                    self.vehicle_m_s = Some(measured.value);
                    of_car = Some(measured);
                }
                Role::OilTemperature => self.oil_degc = Some(measured.value),
                Role::OncomingPressure => oncoming[0] = Some(measured),
                Role::OncomingTorque => oncoming[1] = Some(measured),
                Role::ElementPressure => {
                    if let Some((_, Some(place))) = *element {
                        pressures[place] = Some(measured);
                    }
                }
                _ => {
                    if let Some((element, Some(place))) = *element {
                        let is_pressure = *role == Role::ElementPressureCommand;
                        let value =
                            if is_pressure { command_for(self.car, element, measured.value) } else { measured.value };
                        commands[place] = Some(Measured { value, ..measured });
                    }
                }
            }
        }
        for (which, number) in changed_gear.into_iter().enumerate() {
            let Some(number) = number else { continue };
            self.gears.take(which, self.numbers.gear(number), || format!("{number}"));
        }
        let [engine_rad_s, turbine_rad_s, output_rad_s, wheel_rad_s, engine_n_m, acceleration_m_s2] = of_role;
        let by_wheels = wheel_rad_s.map_or(f64::NAN, |wheel| wheel.value * self.car.road.wheel_radius_m);
        let input = ShiftInput {
            dt_s,
            engine_rad_s,
            turbine_rad_s,
            output_rad_s,
            wheel_rad_s,
            engine_n_m,
            acceleration_m_s2,
            lock_up_applied: self.lock_up_applied,
            commands,
            gear: self.gears.row(self.car, [turbine_rad_s, output_rad_s]),
        };
        let place = self.tables.tables().commanded(input.gear).and_then(|row| row.clutches[1].element.place());
        if let Some(pressure) = place.and_then(|place| pressures.get_mut(place)) {
            *pressure = pressure.or(oncoming[0]);
        }
        let oncoming_n_m = oncoming[1].map_or(f64::NAN, |torque| torque.value);
        Ok(Some(LogStep {
            time_s,
            input,
            pedals: [self.pedal, f64::NAN],
            vehicle_m_s: self.vehicle_m_s.unwrap_or(by_wheels),
            oil_degc: self.oil_degc,
            reported_n_m: engine_n_m,
            speed_m_s: of_car,
            pressures,
            truth: [[f64::NAN; 3], [f64::NAN, oncoming_n_m, f64::NAN]],
        }))
    }
}

/// An entry with the element that it is the command of.
fn entry_of(entry: &Mapped, car: &Car, tables: &ShiftTables<f64>) -> Result<Entry, LogError> {
    let Some(element) = &entry.element else { return Ok(Entry { role: entry.role, element: None }) };
    let column = format!("element_{element}");
    let at = car.gearbox.elements.iter().position(|known| element_column(&known.name) == column);
    let clutch = at.and_then(|at| car.clutches.get(at)?.as_ref());
    let is_measured = entry.role == Role::ElementPressure;
    let Some((at, clutch)) = at.zip(clutch) else {
        // Ratios alone have no elements: a map with commands fits, and they are not used.
        if car.gearbox.has_ratios_alone() {
            return Ok(Entry { role: entry.role, element: None });
        }
        let commands = || element_commands(car).into_iter().map(|(_, name)| name).collect::<Vec<_>>();
        let (what, names) = if is_measured {
            ("pressures", element_pressures(car).map(|(_, name)| name).collect())
        } else {
            ("commands", commands())
        };
        let names = names.iter().map(|name| key_of(name)).collect::<Vec<_>>().join(", ");
        return Err(LogError::map(format!(
            "the channel map has {}, which is no clutch or brake of this gearbox\nhint: rename `[channel.{}]` to the key of its element; the {what} are {names}",
            entry.key(),
            entry.key()
        )));
    };
    if is_measured {
        return Ok(Entry { role: entry.role, element: Some((at, tables.place(at))) });
    }
    let wanted = match clutch.valve.command_kind() {
        CommandKind::Current => Role::ElementCurrent,
        CommandKind::DutyCycle => Role::ElementDuty,
    };
    if entry.role != wanted && entry.role != Role::ElementPressureCommand {
        let hint = match wanted {
            Role::ElementDuty => format!("element_{element}_duty, in %"),
            _ => format!("element_{element}_current, in A"),
        };
        return Err(LogError::map(format!(
            "the channel map has {}, and the command of this valve is another\nhint: it is {hint}, or element_{element}_pressure_command",
            entry.key()
        )));
    }
    Ok(Entry { role: entry.role, element: Some((at, tables.place(at))) })
}

/// The name in a map of the command whose column in a table is called so.
fn key_of(column: &str) -> String {
    column.rsplit_once('_').map_or(column, |(key, _unit)| key).to_owned()
}

/// Refuses a map that lacks a channel that is needed.
fn require(map: &ChannelMap, car: &Car, tables: &ShiftTables<f64>) -> Result<(), LogError> {
    let mut needed = vec![Role::TurbineSpeed, Role::OutputSpeed, Role::Gear, Role::TargetGear];
    needed.extend(car.converter.is_none().then_some(Role::EngineTorque));
    let commands = element_commands(car).into_iter().filter(|(at, _)| tables.place(*at).is_some());
    let has = |key: &str| map.channels.iter().any(|entry| entry.key() == key);
    let pressure_of = |key: &str| {
        Role::of_element(key).map(|(_, element)| Role::ElementPressureCommand.name().replace("NAME", element))
    };
    let both = commands.map(|(_, name)| key_of(&name)).find_map(|key| {
        let pressure = pressure_of(&key).filter(|pressure| has(&key) && has(pressure))?;
        Some((key, pressure))
    });
    if let Some((key, pressure)) = both {
        return Err(LogError::map(format!(
            "the channel map has {key} and {pressure}, which are commands of one valve\nhint: leave {pressure} out: the command of the valve itself is better"
        )));
    }
    let keys: Vec<&str> = needed.iter().map(|role| role.name()).collect();
    let missing: Vec<&str> = keys.iter().copied().filter(|key| !has(key)).collect();
    if missing.is_empty() {
        return Ok(());
    }
    Err(LogError::map(format!(
        "the channel map has no {}\nhint: an estimate of this car needs {}; add `[channel.{}]` or --channel {2}=NAME",
        missing.join(", "),
        keys.join(", "),
        missing[0]
    )))
}

/// The map of a log whose channels have the names of the program, as it writes them itself.
///
/// # Errors
/// Names of channels that every estimate needs, and that are missing or hold no numbers.
pub fn own_map(log: &Log, car: &Car) -> Result<ChannelMap, Vec<&'static str>> {
    use trace::{Unit, signal, units};
    let named = [
        (Role::EngineSpeed, signal::ENGINE_SPEED),
        (Role::TurbineSpeed, signal::TURBINE_SPEED),
        (Role::OutputSpeed, signal::OUTPUT_SPEED),
        (Role::WheelSpeed, signal::WHEEL_SPEED),
        (Role::EngineTorque, signal::REPORTED_ENGINE_TORQUE),
        (Role::LockUpApplied, signal::LOCK_UP_APPLIED),
        (Role::Gear, signal::GEAR),
        (Role::TargetGear, signal::TARGET_GEAR),
        (Role::Throttle, signal::THROTTLE),
        (Role::VehicleSpeed, signal::VEHICLE_SPEED),
        (Role::OilTemperature, signal::OIL_TEMPERATURE),
        (Role::LongitudinalAcceleration, signal::LONGITUDINAL_ACCELERATION),
        (Role::OncomingPressure, signal::ONCOMING_PRESSURE),
        (Role::OncomingTorque, signal::ONCOMING_TORQUE),
    ];
    // The channel of a signal, with its unit: that of the role, or another one that ends its name.
    let channel_of = |role: Role, name: &str| -> Option<(String, String)> {
        let mut channels = log.channels().iter();
        if channels.any(|channel| channel.name == name) {
            return Some((name.to_owned(), role.unit().to_owned()));
        }
        let other = log.channels().iter().find(|channel| units::to_si(&channel.name).0 == name)?;
        Some((other.name.clone(), Unit::of_name(&other.name).map_or(role.unit(), |unit| unit.name).to_owned()))
    };
    let of = |role: Role, element: Option<String>, name: &str| {
        let (name, unit) = channel_of(role, name)?;
        Some(Mapped { unit: Some(unit).filter(|unit| !unit.is_empty()), element, ..Mapped::new(role, &name) })
    };
    let mut map = ChannelMap::default();
    map.gearbox.wheel_radius_m = Some(car.road.wheel_radius_m);
    map.channels.extend(named.into_iter().filter_map(|(role, name)| of(role, None, name)));
    if !map.has(Role::WheelSpeed) {
        map.channels.extend(of(Role::WheelSpeed, None, signal::WHEEL_TREAD_SPEED));
    }
    let pressures = element_pressures(car).map(|(_, name)| name);
    for name in pressures.filter(|name| channel_of(Role::ElementPressure, name).is_some()) {
        let key = key_of(&name);
        let Some((role, element)) = Role::of_element(&key) else { continue };
        map.channels.extend(of(role, Some(element.to_owned()), &name));
    }
    for (at, name) in element_commands(car) {
        let key = key_of(&name);
        let Some((role, element)) = Role::of_element(&key).map(|(role, element)| (role, element.to_owned())) else {
            continue;
        };
        let command = of(role, Some(element.clone()), &name);
        let pressure = || {
            of(Role::ElementPressureCommand, Some(element), &pressure_command_column(&car.gearbox.elements[at].name))
        };
        map.channels.extend(command.or_else(pressure));
    }
    let needed = [
        (Role::TurbineSpeed, signal::TURBINE_SPEED),
        (Role::Gear, signal::GEAR),
        (Role::TargetGear, signal::TARGET_GEAR),
    ];
    let missing: Vec<&str> = needed.into_iter().filter(|(role, _)| !map.has(*role)).map(|(_, name)| name).collect();
    if missing.is_empty() { Ok(map) } else { Err(missing) }
}
