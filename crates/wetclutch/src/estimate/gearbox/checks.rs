//! Whether a table can be a drive of its vehicle.

use std::path::Path;

use car::columns::{element_commands, element_pressures, pressure_command_column};
use car::{Car, Gear};
use drivetrain::{ClutchValve, CommandKind};
use evaluate::checks::Unusable;
use logs::Role;
use logs::plausibility::Seen;
use observer::ShiftTables;
use observer::gearbox::MAX_ELEMENTS;
use observer::{Health, Reading};
use report::tables::health_meaning;
use study::gearbox::car_log::{CarLog, LogStep};

use study::log::FIRST_LOOK;
use trace::{ShownPath as _, signal};

use crate::estimate::log_checks::{check_span, check_step};
use crate::estimate::watched::{WatchedColumn, WatchedColumns};
use crate::{Error, grouped};

/// The times of the rows of a log.
#[derive(Default)]
pub(crate) struct RowTimes {
    /// Between the first rows, s.
    steps_s: Vec<f64>,
    /// Of the first and the last row, s.
    ends_s: Option<[f64; 2]>,
}

impl RowTimes {
    pub(crate) fn push(&mut self, step: &LogStep) {
        if self.steps_s.len() < FIRST_LOOK {
            self.steps_s.push(step.input.dt_s);
        }
        self.ends_s = Some([self.ends_s.map_or(step.time_s, |[first_s, _]| first_s), step.time_s]);
    }

    /// The time of the first row, s; zero without one.
    pub(crate) fn first_s(&self) -> f64 {
        self.ends_s.map_or(0.0, |[first_s, _]| first_s)
    }

    /// The middle time between two rows, s.
    ///
    /// # Errors
    /// The time is in another unit by all appearances.
    pub(crate) fn check(self, path: &Path, is_mapped: bool) -> Result<f64, Error> {
        let median_s = trace::median_step_s(self.steps_s);
        check_step(path, median_s, is_mapped)?;
        check_span(path, median_s, self.ends_s.map_or(f64::NAN, |[first_s, last_s]| last_s - first_s))?;
        Ok(median_s)
    }
}

/// Why a log is no drive of this car: the filter could use no row in a gear.
pub(crate) fn refused(unusable: Unusable, path: &Path) -> Error {
    let Unusable { rows, health } = unusable;
    let hint = match health {
        Health::CommandRejected => {
            "check the units of the commands of the elements, and that each is the command of this element's valve"
        }
        _ => {
            "check the units and scales of turbine_speed and output_speed, the gear, and whether this is the vehicle file of the car; `wetclutch \
             inspect` shows minimum and maximum values, and with --shifts whether the ratios fit the gears"
        }
    };
    Error::Input(format!(
        "{}: in none of {} rows in a gear, with the car moving, can the estimate be used; most of them have {} (`{}`)\nhint: {hint}",
        path.shown(),
        grouped(rows),
        health_meaning(health),
        health.name()
    ))
}

/// Of which elements a command came.
#[derive(Default)]
pub(crate) struct HeardCommands([bool; MAX_ELEMENTS]);

impl HeardCommands {
    pub(crate) fn push(&mut self, step: &LogStep) {
        for (heard, command) in self.0.iter_mut().zip(&step.input.commands) {
            *heard |= command.is_some();
        }
    }

    /// Says of which elements none came.
    pub(crate) fn warning(&self, car: &Car, tables: &ShiftTables<f64>) -> Option<String> {
        let unheard = element_commands(car).into_iter().filter_map(|(element, _)| {
            let heard = self.0.get(tables.place(element)?)?;
            (!heard).then(|| car.gearbox.elements[element].name.as_str())
        });
        let names: Vec<&str> = unheard.collect();
        (!names.is_empty()).then(|| {
            format!(
                "warning: the log has no command of {}: torques there are by the speeds alone, pressures by the torques, and ranges are wide\nhint: add \
                 the commands of their valves if the log has them, `element_NAME_current_a` in a table or `[channel.element_NAME_current]` in a channel map",
                names.join(", ")
            )
        })
    }
}

/// The columns of a table of a drive, to tell wrong units and empty columns.
pub(crate) struct Columns {
    /// Of the four speeds, the engine torque, each command and then each measured pressure.
    watched: WatchedColumns,
    /// Places of the commands in the filter's tables, and the valve where the column has the pressure that is asked of it.
    places: Vec<(usize, Option<ClutchValve<f64>>)>,
    /// Places of the measured pressures in the filter's tables.
    pressures: Vec<usize>,
    /// Whether each gear is a forward one.
    is_forward: Vec<bool>,
}

impl Columns {
    pub(crate) fn of(log: &CarLog<'_>, car: &Car, tables: &ShiftTables<f64>) -> Self {
        let has_converter = car.converter.is_some();
        let others = [
            // Without it the estimate is the open loop.
            (Role::EngineSpeed, signal::ENGINE_SPEED, false),
            (Role::TurbineSpeed, signal::TURBINE_SPEED, true),
            (Role::OutputSpeed, signal::OUTPUT_SPEED, true),
            (Role::WheelSpeed, signal::WHEEL_SPEED, false),
            (Role::EngineTorque, signal::REPORTED_ENGINE_TORQUE, !has_converter),
        ];
        let others = others.map(|(role, column, is_needed)| WatchedColumn {
            role,
            name: role.name().to_owned(),
            is_in_si: log.is_in_si(column),
            is_needed,
        });
        let commands = element_commands(car).into_iter().filter_map(|(element, column)| {
            let valve = car.clutches[element].as_ref()?.valve;
            let (role, column) = match valve.command_kind() {
                _ if log.has_pressure_command(element) => {
                    (Role::ElementPressureCommand, pressure_command_column(&car.gearbox.elements[element].name))
                }
                CommandKind::Current => (Role::ElementCurrent, column),
                CommandKind::DutyCycle => (Role::ElementDuty, column),
            };
            let name = column.rsplit_once('_').map_or(column.as_str(), |(name, _)| name).to_owned();
            let watched = WatchedColumn { role, name, is_in_si: log.is_in_si(&column), is_needed: false };
            let pressure_of = (role == Role::ElementPressureCommand).then_some(valve);
            Some(((tables.place(element)?, pressure_of), watched))
        });
        let (places, commands): (Vec<_>, Vec<_>) = commands.unzip();
        let pressures = element_pressures(car).filter_map(|(element, column)| {
            let name = column.rsplit_once('_').map_or(column.as_str(), |(name, _)| name).to_owned();
            let (role, is_in_si) = (Role::ElementPressure, log.is_in_si(&column));
            Some((tables.place(element)?, WatchedColumn { role, name, is_in_si, is_needed: false }))
        });
        let (pressures, measured): (Vec<_>, Vec<_>) = pressures.unzip();
        let is_forward = car.gearbox.gears.iter().map(|gear| gear.ratio > 0.0).collect();
        let watched = WatchedColumns::new(FIRST_LOOK, others.into_iter().chain(commands).chain(measured));
        Self { watched, places, pressures, is_forward }
    }

    pub(crate) fn push(&mut self, step: &LogStep) {
        let input = &step.input;
        let value = |reading: Option<Reading<f64>>| reading.map(|reading| reading.value);
        // Only in a forward gear the sign of these speeds tells whether it is right: in reverse the car goes backwards.
        let is_forward = |gear: Gear| gear.place().and_then(|place| self.is_forward.get(place)) == Some(&true);
        let is_forward = [input.gear.from, input.gear.to].into_iter().all(is_forward);
        let [output, wheel] = [input.output_rad_s, input.wheel_rad_s]
            .map(|reading| value(reading).map(|speed| if is_forward { speed } else { speed.abs() }));
        let others = [value(input.engine_rad_s), value(input.turbine_rad_s), output, wheel, value(input.engine_n_m)];
        let command = |(place, pressure_of): &(usize, Option<ClutchValve<f64>>)| {
            let command = value(input.commands[*place])?;
            Some(pressure_of.as_ref().map_or(command, |valve| valve.settled_pressure(command)))
        };
        let commands = self.places.iter().map(command);
        let pressures = self.pressures.iter().map(|place| value(step.pressures[*place]));
        self.watched.push(others.into_iter().chain(commands).chain(pressures));
    }

    /// Refuses a table in which a column that is needed has no value, or whose unit cannot be right.
    pub(crate) fn check(&self) -> Result<(), Error> {
        self.watched.check(Seen::All)
    }
}
