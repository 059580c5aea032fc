//! What is said about the estimates of a log.

use car::{ObserverKind, Vehicle};
use evaluate::checks::held_commands::{CommandTimes, warnings_of};
use logs::Role;
use observer::{ChannelHealth, Estimate as Sample, Health};
use report::tables::{health_meaning, phase_name};
use study::log::FIRST_LOOK;
use study::{ErrorScore, Passages};
use trace::quantity;
use trace::units;

use super::measured::{Measured, Step};
use super::observer::is_open_loop;
use super::ratios::Ratios;

use crate::estimate::input::{said_of_origin, shown_from_s};
use crate::estimate::watched::is_looked_at;
use crate::{Error, grouped};

/// Summary of the estimates for the user, updated with each estimate.
pub(crate) struct Findings {
    ratios: Ratios,
    rows: u64,
    other_gear: u64,
    first_s: f64,
    last_s: f64,
    /// The last step in the gears of the vehicle file's shift, s.
    in_gears_s: f64,
    passages: Passages,
    /// Samples of each health that was seen.
    health: Vec<(Health, u64)>,
    /// None if a row has no true value.
    errors: Option<ErrorScore>,
    /// Samples without a command of the valve that can be used.
    without_command: u64,
    /// Of the oncoming clutch, and of the offgoing one.
    commands: [CommandTimes; 2],
    /// Readings that came, and those of them that were taken, of each channel.
    came: [u64; CHANNELS],
    taken: [u64; CHANNELS],
}

/// A gear is known from the ratio of the speeds after a moment; until then a drive counts as in the gears of the shift, s.
const UNKNOWN_S: f64 = 0.2;
/// From fewer rows nothing is said of most of them \[chosen\]: one second at 100 Hz.
const ENOUGH_ROWS: u64 = 100;
/// The channels of an observer, and the role of each.
const CHANNELS: usize = 7;
/// The command of the offgoing clutch among them: an estimate does without it.
const OFFGOING_COMMAND: usize = 5;

impl Findings {
    pub(crate) fn new(vehicle: &Vehicle) -> Self {
        Self {
            ratios: Ratios::new(vehicle),
            rows: 0,
            other_gear: 0,
            first_s: f64::NAN,
            last_s: f64::NAN,
            in_gears_s: f64::NAN,
            passages: Passages::default(),
            health: Vec::new(),
            errors: Some(ErrorScore::new(0.0)),
            without_command: 0,
            commands: Default::default(),
            came: [0; CHANNELS],
            taken: [0; CHANNELS],
        }
    }

    /// Takes a step in a gear that the vehicle file does not describe.
    pub(crate) fn push_other_gear(&mut self, time_s: f64) {
        self.other_gear += 1;
        self.pass(time_s);
    }

    fn pass(&mut self, time_s: f64) {
        if self.first_s.is_nan() {
            self.first_s = time_s;
        }
        self.last_s = time_s;
    }

    pub(crate) fn push(&mut self, row: &Step, estimate: &Sample<f64>) {
        self.pass(row.time_s);
        self.in_gears_s = row.time_s;
        self.rows += 1;
        self.ratios.push(row.time_s, &row.input, is_looked_at(self.rows, FIRST_LOOK));
        let input = &row.input;
        for (times, reading) in self.commands.iter_mut().zip([input.command, input.offgoing_command]) {
            times.push(row.time_s, reading);
        }
        let readings = [
            input.engine_rad_s,
            input.turbine_rad_s,
            input.output_rad_s,
            input.wheel_rad_s,
            input.command,
            input.offgoing_command,
            input.engine_torque_n_m,
        ];
        for (at, (reading, health)) in readings.iter().zip(estimate.channels.each()).enumerate() {
            // An observer that does without a channel refuses none of its readings.
            let taken = matches!(health, ChannelHealth::Good | ChannelHealth::Unused);
            // One without a value is of a sensor that fails, and tells nothing of the channel.
            let came = reading.is_some_and(|reading| reading.value.is_finite());
            self.came[at] += u64::from(came);
            self.taken[at] += u64::from(came && taken);
        }
        let is_lost = matches!(estimate.channels.command, ChannelHealth::Lost | ChannelHealth::Refused);
        self.without_command += u64::from(is_lost);
        self.passages.push(row.time_s, estimate.phase);
        match self.health.iter_mut().find(|(health, _)| *health == estimate.health) {
            Some((_, count)) => *count += 1,
            None => self.health.push((estimate.health, 1)),
        }
        match (&mut self.errors, row.truth) {
            (Some(errors), Some(truth)) => {
                errors.push(row.time_s, truth.phase, truth.pressure_pa, estimate.pressure_pa);
            }
            (_, None) => self.errors = None,
            (None, _) => {}
        }
    }

    /// What is said of commands that are recorded too rarely.
    pub(crate) fn warnings_of_commands(&self) -> Vec<String> {
        let [oncoming, offgoing] = &self.commands;
        warnings_of(&[("oncoming clutch", oncoming), ("offgoing clutch", offgoing)])
    }

    /// From the first step to the last, s.
    pub(crate) fn span_s(&self) -> f64 {
        self.last_s - self.first_s
    }

    /// From which time on the times of the log are shown, s.
    pub(crate) fn origin_s(&self) -> f64 {
        if self.first_s.is_nan() { 0.0 } else { shown_from_s(self.first_s) }
    }

    /// Refuses a log of which a channel is unusable in most samples, or that does not belong to the vehicle.
    ///
    /// # Errors
    /// More than half of the readings of a channel were refused, or none came; or most estimates are outside their range.
    pub(crate) fn check(&self, commands: [Role; 2], log: &Measured<'_>, observer: ObserverKind) -> Result<(), Error> {
        let needs_wheel = log.has_wheel_speed() && observer != ObserverKind::Rigid && !is_open_loop(observer);
        let is_in_gears = self.in_gears_s - self.first_s > UNKNOWN_S;
        if !is_in_gears && self.other_gear > 0 {
            return Err(Error::Input(
                "the log is never in the gears of the vehicle file's shift\nhint: check `gearbox.ratios` of the channel map and the \
                 gear train of the vehicle file; `wetclutch inspect --shifts` lists the shifts"
                    .to_owned(),
            ));
        }
        let speeds = [Role::EngineSpeed, Role::TurbineSpeed, Role::OutputSpeed, Role::WheelSpeed];
        let roles = speeds.into_iter().chain(commands).chain([Role::EngineTorque]);
        for (at, role) in roles.enumerate() {
            let (came, taken, name) = (self.came[at], self.taken[at], role.name());
            let is_needed = match role {
                Role::WheelSpeed => needs_wheel,
                Role::EngineSpeed => !is_open_loop(observer),
                Role::OffgoingCurrent | Role::OffgoingDuty | Role::EngineTorque => false,
                _ => true,
            };
            if came == 0 && is_needed {
                return Err(Error::Input(format!(
                    "{name} has no value in any of {} samples\nhint: check the log with `wetclutch inspect`",
                    grouped(self.rows)
                )));
            }
            if 2 * taken < came && at != OFFGOING_COMMAND {
                return Err(Error::Input(format!(
                    "{} of {} readings of {name} were refused: they are impossible for this car, or contradict the other \
                     signals\nhint: check the unit, scale and sign of {name}, and whether the vehicle file is of this car; \
                     `wetclutch inspect` shows minimum and maximum values",
                    grouped(came - taken),
                    grouped(came)
                )));
            }
        }
        self.ratios.check()?;
        self.check_estimates()
    }

    /// Most estimates have to be possible.
    fn check_estimates(&self) -> Result<(), Error> {
        // Where the speeds fit no phase, the estimate is less certain or that of the valve maps, with a warning.
        let impossible = [Health::OutsideRange, Health::LimitedToRange, Health::Flare];
        let of = |health: &Health| self.health.iter().find(|(other, _)| other == health).map_or(0, |(_, count)| *count);
        let lost = self.without_command;
        if 2 * lost > self.rows && self.rows >= ENOUGH_ROWS {
            return Err(Error::Input(format!(
                "{} of {} samples have no command of the valve that can be used\nhint: if it is sent on change, set `sent_on_change = true` \
                 in a channel map; else check its channel with `wetclutch inspect`. A log of another car, or of one with a whole gearbox, may have \
                 it in its shifts alone, and that needs the vehicle file of that car",
                grouped(lost),
                grouped(self.rows)
            )));
        }
        let count: u64 = impossible.iter().map(of).sum();
        if 2 * count <= self.rows || self.rows < ENOUGH_ROWS {
            return Ok(());
        }
        let worst = impossible.iter().max_by_key(|health| of(health)).map_or("", |health| health.name());
        Err(Error::Input(format!(
            "{} of {} estimates are impossible for this car, most of them `{worst}`\nhint: a channel with a wrong scale does this, \
             another car than that of the vehicle file, and a log of other gears; `wetclutch inspect` shows minimum and maximum values, \
             and a channel map with `gearbox.ratios` distinguishes the gears",
            grouped(count),
            grouped(self.rows)
        )))
    }

    /// What was found, in sentences.
    pub(crate) fn sentences(&self) -> Vec<String> {
        let mut said: Vec<String> =
            self.ratios.contradiction().map(|said| format!("warning: {said}")).into_iter().collect();
        for (health, count) in &self.health {
            // A few are normal while the cylinder fills: there the observers' valve model is faster than the valve maps.
            let few = matches!(health, Health::OutsideRange | Health::LimitedToRange) && 100 * count <= self.rows;
            if *health == Health::Good || few {
                continue;
            }
            let meaning = health_meaning(*health);
            said.push(format!("{} of {} samples have {meaning}", grouped(*count), grouped(self.rows)));
            if *health == Health::HeldClutchSlips && 10 * count > self.rows {
                said.push(
                    "warning: turbine and output speed contradict the ratios of the vehicle file in more than a tenth of the samples: there the \
                     estimate is less certain, or that of the valve maps\nhint: check the scale of both speeds and the ratios; `--observer kalman` does not need them as exact"
                        .to_owned(),
                );
            }
        }
        let (came, taken) = (self.came[OFFGOING_COMMAND], self.taken[OFFGOING_COMMAND]);
        if 100 * (came - taken) > came {
            said.push(format!(
                "warning: {} of {} commands of the offgoing clutch were not used: they are impossible, or contradict the speeds: the clutch holds \
                 where they ask for no pressure, or slips where they ask for much\nhint: check the channel of this command with `wetclutch inspect`",
                grouped(came - taken),
                grouped(came)
            ));
        }
        let scores = self.errors.as_ref().map(ErrorScore::finish).unwrap_or_default();
        for score in scores.iter().filter(|score| score.samples > 0) {
            said.push(format!(
                "error against the true pressure, {}: peak {}, RMS {}",
                phase_name(score.phase),
                quantity(units::mpa(score.peak), "MPa", 4),
                quantity(units::mpa(score.rms), "MPa", 4),
            ));
        }
        let rows = grouped(self.rows + self.other_gear);
        if self.other_gear > 0 {
            said.push(format!(
                "{} of {rows} samples are in gears that the vehicle file does not describe: they have no estimate",
                grouped(self.other_gear)
            ));
        }
        let origin_s = self.origin_s();
        said.extend(said_of_origin(origin_s));
        said.push(format!("rows: {rows}, from {:.3} to {:.3} s", self.first_s - origin_s, self.last_s - origin_s));
        said.push(format!("shifts: {}", self.shifts(origin_s)));
        let fraction = |count: u64| 100.0 * count as f64 / self.rows as f64;
        let fractions =
            self.health.iter().map(|(health, count)| format!("{} {:.1} %", health.name(), fraction(*count)));
        said.push(format!("health: {}", fractions.collect::<Vec<_>>().join(", ")));
        said
    }

    fn shifts(&self, origin_s: f64) -> String {
        let Passages { count, first_s, .. } = &self.passages;
        let times =
            first_s.iter().map(|[from_s, to_s]| format!("{:.3} to {:.3} s", from_s - origin_s, to_s - origin_s));
        let mut parts: Vec<String> = times.collect();
        match count - parts.len() as u64 {
            0 => {}
            more => parts.push(format!("and {} more", grouped(more))),
        }
        if parts.is_empty() { "none".to_owned() } else { format!("{} ({})", grouped(*count), parts.join(", ")) }
    }
}
