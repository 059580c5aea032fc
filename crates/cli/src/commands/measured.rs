//! A log as the observers read it.

use std::collections::VecDeque;
use std::path::Path;

use config::Vehicle;
use drivetrain::CommandKind;
use logs::{ChannelMap, Log, LogError, Quality, Readings, Role, Step, Steps};
use observer::Input;
use study::log::{FIRST_LOOK, LogRow};

use crate::failure::Failure;
use crate::output;

/// Rows of signals with the names of the program, or channels with clocks of their own.
pub(super) enum Measured<'a> {
    Rows(Box<study::log::Log>),
    Channels(Box<Channels<'a>>),
}

/// Steps of mapped channels. The first are looked at before the first estimate, as those of a table are.
pub(super) struct Channels<'a> {
    steps: Steps<'a>,
    looked_at: VecDeque<Step>,
    median_step_s: f64,
    has_wheel_speed: bool,
}

impl<'a> Measured<'a> {
    /// A table with the names of the program.
    pub(super) fn rows(path: &Path, vehicle: &Vehicle) -> Result<Self, Failure> {
        if logs::needs_map(path)? {
            return Err(Failure::Input(format!(
                "{}: this log needs a channel map\nhint: `wetclutch inspect` with --suggest writes a first one, for --map",
                path.display()
            )));
        }
        Ok(Self::Rows(Box::new(study::log::Log::open(path, vehicle)?)))
    }

    /// Channels of a log by a map.
    pub(super) fn channels(log: &'a mut Log, map: &ChannelMap, vehicle: &Vehicle) -> Result<Self, Failure> {
        let command = match vehicle.observer_valve.command_kind() {
            CommandKind::Current => Role::OncomingCurrent,
            CommandKind::DutyCycle => Role::OncomingDuty,
        };
        if !map.has(command) {
            return Err(Failure::Input(format!(
                "the channel map has no {0}, the command of this vehicle's valve: without it no pressure can be estimated\n\
                 hint: add `[channel.{0}]` or --channel {0}=NAME if the log has it",
                command.name()
            )));
        }
        let needed = [Role::EngineSpeed, Role::TurbineSpeed, Role::OutputSpeed, command];
        if let Some(missing) = needed.into_iter().find(|role| !map.has(*role)) {
            return Err(Failure::Input(format!(
                "the channel map has no {}\nhint: an estimate needs {}; add `[channel.{}]` or --channel {0}=NAME",
                missing.name(),
                needed.map(Role::name).join(", "),
                missing.name(),
            )));
        }
        // The other kind of command is no reading of this valve.
        let mut map = map.clone();
        map.channels
            .retain(|entry| entry.role == command || !matches!(entry.role, Role::OncomingCurrent | Role::OncomingDuty));
        let mut steps = Steps::new(Readings::new(log, &map)?);
        let looked_at = steps.by_ref().take(FIRST_LOOK).collect::<Result<VecDeque<_>, LogError>>()?;
        // Wrong units are an error before the first estimate.
        steps.readings().check_units()?;
        let median_step_s = trace::median_step_s(looked_at.iter().skip(1).map(|step| step.input.dt_s).collect());
        let has_wheel_speed = map.has(Role::WheelSpeed);
        Ok(Self::Channels(Box::new(Channels { steps, looked_at, median_step_s, has_wheel_speed })))
    }

    pub(super) fn has_wheel_speed(&self) -> bool {
        match self {
            Self::Rows(log) => log.signals().has_wheel_speed(),
            Self::Channels(channels) => channels.has_wheel_speed,
        }
    }

    /// Refuses a log without the wheel speed.
    pub(super) fn require_wheel_speed(&self) -> Result<(), Failure> {
        match self {
            Self::Rows(log) => Ok(log.require_wheel_speed()?),
            Self::Channels(channels) if channels.has_wheel_speed => Ok(()),
            Self::Channels(_) => Err(Failure::Input(
                "the channel map has no wheel_speed, which this observer needs\nhint: add `[channel.wheel_speed]`, or use `--observer rigid`"
                    .to_owned(),
            )),
        }
    }

    pub(super) fn median_step_s(&self) -> f64 {
        match self {
            Self::Rows(log) => log.median_step_s(),
            Self::Channels(channels) => channels.median_step_s,
        }
    }

    /// Says what was met in the log, after its last step.
    pub(super) fn finish(&self) -> Result<(), Failure> {
        let Self::Channels(channels) = self else { return Ok(()) };
        let readings = channels.steps.readings();
        for role in readings.summary() {
            let (good, total) = (role.counts.of(Quality::Good), role.counts.total());
            if good < total {
                output::note(&format!(
                    "{} of {} samples of {} are not used: {}",
                    output::grouped(total - good),
                    output::grouped(total),
                    role.role.name(),
                    role.counts.faults()
                ));
            }
        }
        for note in readings.notes() {
            output::note(&format!("warning: {note}"));
        }
        Ok(readings.check()?)
    }
}

impl Iterator for Measured<'_> {
    type Item = Result<(Input<f64>, LogRow), Failure>;

    fn next(&mut self) -> Option<Self::Item> {
        match self {
            Self::Rows(log) => log.next().map(|row| row.map_err(Failure::from)),
            Self::Channels(channels) => {
                let step = match channels.looked_at.pop_front() {
                    Some(step) => Ok(step),
                    None => channels.steps.next()?,
                };
                let row = step.map(|step| (step.input, LogRow { time_s: step.time_s, truth: None }));
                Some(row.map_err(Failure::from))
            }
        }
    }
}
