//! Whether a table can be a drive of its vehicle.

use config::Car;
use design::ShiftTables;
use drivetrain::CommandKind;
use logs::plausibility::{Extremes, Likely, Seen, findings};
use logs::{QualityCounts, Role, RoleSummary};
use study::any_shift::logged::{LogStep, element_commands};
use trace::signal;

use crate::failure::Failure;
use crate::output;

/// The values of a table's columns, to tell wrong units and empty columns.
pub(super) struct Columns {
    rows: u64,
    /// Of the four speeds, the engine torque and then each command.
    watched: Vec<Watched>,
}

struct Watched {
    /// Place of a command in the filter's tables.
    place: Option<usize>,
    is_needed: bool,
    values: u64,
    summary: RoleSummary,
}

impl Columns {
    /// `is_in_si` tells whether a signal is there in its SI unit.
    pub(super) fn of(car: &Car, tables: &ShiftTables<f64>, is_in_si: impl Fn(&str) -> bool) -> Self {
        let has_converter = car.converter.is_some();
        let watched = |role: Role, column: &str, place: Option<usize>, is_needed: bool| Watched {
            place,
            is_needed,
            values: 0,
            summary: RoleSummary {
                role,
                name: column
                    .rsplit_once('_')
                    .filter(|_| place.is_some())
                    .map_or(role.name(), |(name, _)| name)
                    .to_owned(),
                counts: QualityCounts::default(),
                extremes: Extremes::default(),
                unit_name: match role {
                    _ if is_in_si(column) => role.unit(),
                    Role::ElementCurrent => "mA",
                    _ => "rpm",
                }
                .to_owned(),
            },
        };
        let others = [
            (Role::EngineSpeed, signal::ENGINE_SPEED, has_converter),
            (Role::TurbineSpeed, signal::TURBINE_SPEED, true),
            (Role::OutputSpeed, signal::OUTPUT_SPEED, true),
            (Role::WheelSpeed, signal::WHEEL_SPEED, false),
            (Role::EngineTorque, signal::REPORTED_ENGINE_TORQUE, !has_converter),
        ];
        let commands = element_commands(car).into_iter().filter_map(|(element, column)| {
            let role = match car.clutches[element].as_ref()?.valve.command_kind() {
                CommandKind::Current => Role::ElementCurrent,
                CommandKind::DutyCycle => Role::ElementDuty,
            };
            Some(watched(role, &column, Some(tables.place(element)?), true))
        });
        let commands: Vec<_> = commands.collect();
        let others = others.into_iter().map(|(role, column, is_needed)| watched(role, column, None, is_needed));
        Self { rows: 0, watched: others.chain(commands).collect() }
    }

    pub(super) fn push(&mut self, step: &LogStep) {
        /// Rows at the beginning of which all are looked at, and later one of so many.
        const FIRST: u64 = 10_000;
        const EVERY: u64 = 32;
        self.rows += 1;
        let is_looked_at = self.rows <= FIRST || self.rows.is_multiple_of(EVERY);
        let input = &step.input;
        let others = [input.engine_rad_s, input.turbine_rad_s, input.output_rad_s, input.wheel_rad_s, input.engine_n_m];
        for (at, entry) in self.watched.iter_mut().enumerate() {
            let reading = entry.place.map_or_else(|| others[at], |place| input.commands[place]);
            if let Some(reading) = reading.filter(|reading| reading.value.is_finite()) {
                entry.values += 1;
                if is_looked_at {
                    entry.summary.extremes.push(reading.value);
                }
            }
        }
    }

    /// Refuses a table in which a column that is needed has no value, or whose unit cannot be right.
    pub(super) fn check(&self) -> Result<(), Failure> {
        let empty = self.watched.iter().find(|entry| entry.is_needed && entry.values == 0 && self.rows > 0);
        if let Some(entry) = empty {
            return Err(Failure::Input(format!(
                "{} has no value in any of {} rows\nhint: an estimate of this car needs it; look at the log with `wetclutch inspect`",
                entry.summary.name,
                output::grouped(self.rows)
            )));
        }
        let summaries: Vec<RoleSummary> = self.watched.iter().map(|entry| entry.summary.clone()).collect();
        let Some(finding) = findings(&summaries, Seen::All).into_iter().next() else { return Ok(()) };
        let hint = match finding.likely {
            Likely::Unit(_) => {
                "the end of a column's name says its unit, such as _rpm, _rad_s, _ma or _a; a channel map can give unit and scale"
            }
            Likely::OtherChannel => "another signal may stand in this column, or its sensor has failed",
            Likely::OtherSign => "in a channel map the channel can have `scale = -1`",
        };
        Err(Failure::Input(format!("{}\nhint: {hint}", finding.message)))
    }
}
