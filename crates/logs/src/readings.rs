//! Readings: samples of mapped channels in SI, with what cannot be a reading taken out by stated rules and counted.
//!
//! Besides the rules for time stamps (see [`crate::samples`]):
//!
//! - a value outside `valid_range` of the map is not used;
//! - several channels of one signal count where all of them have the same time stamp;
//! - a speed that stands still while it cannot is not used until it changes, see [`crate::frozen`]; of a log that is not followed,
//!   from when it began to stand, see [`crate::look_ahead`];
//! - a speed that no shaft can have, as a zero while the car drives, is not used, see [`crate::speed_faults`];
//! - the friction torque of the engine, where it is mapped, is taken off the engine torque.

use crate::in_order::InOrder;
use crate::look_ahead::{LOOK_AHEAD_S, LookAhead};
use crate::map::Resolved;
use crate::plausibility::{Extremes, Finding, Likely, Seen};
use crate::samples::{Quality, QualityCounts};
use crate::speed_watch::{SpeedReading, SpeedWatch, Withdrawn};
use crate::{ChannelMap, Combine, Log, LogError, Role, Samples, plausibility};

/// A value of a signal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// What it is.
    pub role: Role,
    /// When it was measured, s: its time stamp less the delay of the map.
    pub time_s: f64,
    /// Its time stamp less `late_s` of the map, s; rising for each role.
    pub stamp_s: f64,
    /// The value in the unit of the role.
    pub value: f64,
}

impl Reading {
    /// Whether its value cannot be used.
    pub fn is_refused(&self) -> bool {
        self.value.is_nan()
    }
}

/// What came of the samples of a role.
#[derive(Debug, Clone, PartialEq)]
pub struct RoleSummary {
    /// The role.
    pub role: Role,
    /// Its name in a channel map.
    pub name: String,
    /// Samples of each quality.
    pub counts: QualityCounts,
    /// Extremes and middle of the good ones, in the unit of the role.
    pub extremes: Extremes,
    /// The unit in which the log has it.
    pub unit_name: String,
    /// At which fraction of the time so far the last good sample came, 0 to 1.
    pub until: f64,
}

impl RoleSummary {
    /// Whether it ended, or its sensor failed, in the first half of the time so far: what it gave before says little of the rest.
    pub fn ended_early(&self) -> bool {
        self.until < 0.5
    }
}

/// The channels of one role while they are read.
struct Channels {
    resolved: Resolved,
    /// Values of the parts at one time, and the time.
    parts: Vec<Option<f64>>,
    parts_s: f64,
    counts: QualityCounts,
    extremes: Extremes,
    /// Time of the last good sample, s.
    good_s: f64,
}

/// A reading that waits, with the place of its entry in the map, the time of its sample, s, and the resets of clocks until then.
struct Read {
    entry: usize,
    reading: Reading,
    sample_s: f64,
    resets: u32,
}

/// The readings of a log in the order of their time stamps.
pub struct Readings<'a> {
    samples: Samples<'a>,
    roles: Vec<Channels>,
    /// Role and part of each channel; a channel may serve several roles.
    users: Vec<Vec<(usize, usize)>>,
    /// Roles that the last sample still has to be given to.
    pending: Vec<(usize, usize)>,
    sample: Option<crate::Sample>,
    /// What is held back until it is known whether it is right.
    ahead: LookAhead<Read, LogError>,
    /// Time of the newest sample that was not held back any more, s, and resets of clocks until then.
    newest_s: f64,
    resets: u32,
    /// What is held back where stamps are moved.
    in_order: Option<InOrder>,
    /// Place of the last reading's entry in the map.
    entry: usize,
    speeds: SpeedWatch,
    /// What the last speed that was judged shows of those before it.
    withdrawn: Vec<Withdrawn>,
    /// Whether the newest gear is a negative number: reverse.
    is_reverse: bool,
    /// Newest friction torque of the engine, N m; zero where it is not mapped, none before its first value.
    friction_n_m: Option<f64>,
    /// Times of the first and of the last sample, s.
    span_s: [f64; 2],
}

impl<'a> Readings<'a> {
    /// The readings of a log by a map.
    ///
    /// # Errors
    /// The map does not fit the log, or the log cannot be read.
    pub fn new(log: &'a mut Log, map: &ChannelMap) -> Result<Self, LogError> {
        let resolved = map.resolve(log)?;
        let look_ahead_s = if log.is_followed() { 0.0 } else { LOOK_AHEAD_S };
        let mut users = vec![Vec::new(); log.channels().len()];
        for (i, resolved) in resolved.iter().enumerate() {
            for (part, &channel) in resolved.channels.iter().enumerate() {
                users[channel].push((i, part));
            }
        }
        let wanted: Vec<usize> = (0..users.len()).filter(|&i| !users[i].is_empty()).collect();
        let in_order = InOrder::of(&resolved);
        let roles = resolved.into_iter().map(|resolved| Channels {
            parts: vec![None; resolved.channels.len()],
            parts_s: f64::NAN,
            resolved,
            counts: QualityCounts::default(),
            extremes: Extremes::default(),
            good_s: f64::NAN,
        });
        let roles = roles.collect();
        Ok(Self {
            samples: log.samples(&wanted)?,
            roles,
            users,
            pending: Vec::new(),
            sample: None,
            ahead: LookAhead::new(look_ahead_s),
            newest_s: f64::NEG_INFINITY,
            resets: 0,
            in_order,
            entry: 0,
            speeds: SpeedWatch::new(),
            withdrawn: Vec::new(),
            is_reverse: false,
            friction_n_m: (!map.has(Role::EngineFrictionTorque)).then_some(0.0),
            span_s: [f64::INFINITY, f64::NEG_INFINITY],
        })
    }

    /// Readings of a gearbox with gears of these ratios, turbine over output speed; without any they are not known.
    #[must_use]
    pub fn of_gearbox(self, ratios: &[f64]) -> Self {
        Self { speeds: SpeedWatch::of_gearbox(ratios), ..self }
    }

    /// What came of the samples so far.
    pub fn summary(&self) -> Vec<RoleSummary> {
        let summary = |channels: &Channels| RoleSummary {
            role: channels.resolved.entry.role,
            name: channels.resolved.entry.key(),
            counts: channels.counts,
            extremes: channels.extremes,
            unit_name: channels.resolved.unit_name.clone(),
            until: self.until(channels.good_s),
        };
        self.roles.iter().map(summary).collect()
    }

    /// The fraction of the time so far at which a sample came; all of it before two times are known.
    fn until(&self, time_s: f64) -> f64 {
        let [first_s, last_s] = self.span_s;
        if last_s > first_s { ((time_s - first_s) / (last_s - first_s)).max(0.0) } else { 1.0 }
    }

    /// The place in the map of the entry that gave the last reading.
    pub fn entry(&self) -> usize {
        self.entry
    }

    /// What is to be said about the log, complete after the last reading.
    pub fn notes(&self) -> &[String] {
        self.samples.notes()
    }

    /// Resets of clocks so far.
    pub fn resets(&self) -> u32 {
        self.resets
    }

    /// Checks units against what the first values can be.
    ///
    /// # Errors
    /// A unit is wrong by all appearances.
    pub fn check_first_units(&self) -> Result<(), LogError> {
        self.check_units(Seen::Beginning)
    }

    fn check_units(&self, seen: Seen) -> Result<(), LogError> {
        match plausibility::findings(&self.summary(), seen).into_iter().next() {
            Some(Finding { name, message, likely, .. }) => Err(LogError::map(match likely {
                Likely::Unit(_) => {
                    format!("{message}\nhint: set `channel.{name}.unit`, or use `--channel {name}=\"NAME [UNIT]\"`")
                }
                Likely::OtherChannel => format!(
                    "{message}\nhint: check that `channel.{name}.name` is this signal and that its sensor works; `wetclutch inspect` shows minimum and maximum values"
                ),
                Likely::OtherSign => format!("{message}\nhint: set `channel.{name}.scale` to a negative number"),
            })),
            None => Ok(()),
        }
    }

    /// Checks, after the last reading, that most samples of each role could be used, and the units.
    ///
    /// # Errors
    /// Most samples are unusable, or a unit is wrong by all appearances.
    pub fn check(&self) -> Result<(), LogError> {
        self.check_without(&[])
    }

    /// As [`Self::check`], where channels of these roles may have no sample at all.
    ///
    /// # Errors
    /// Those of [`Self::check`].
    pub fn check_without(&self, may_be_empty: &[Role]) -> Result<(), LogError> {
        let summary = self.summary();
        for (role, channels) in summary.iter().zip(&self.roles) {
            let name = channels.resolved.entry.key();
            // A held sample could be used, were it not the one before.
            let (good, total) = (role.counts.of(Quality::Good) + role.counts.of(Quality::Held), role.counts.total());
            if total == 0 && may_be_empty.contains(&role.role) {
                continue;
            }
            if total == 0 {
                return Err(LogError::map(format!(
                    "the channel of {name} has no samples\nhint: check it with `wetclutch inspect`, or leave `channel.{name}` out"
                )));
            }
            // A request that is rarely made is rightly absent.
            // A sensor that fails in the drive leaves what it gave before.
            let total = total - role.counts.of(Quality::Impossible) - role.counts.of(Quality::Frozen);
            if 2 * good < total && role.role != Role::TorqueReductionRequest {
                return Err(LogError::map(format!(
                    "{} of {total} samples of {name} cannot be used: {}\nhint: check the channel with `wetclutch inspect`, and its entry in the channel map",
                    total - good,
                    role.counts.faults()
                )));
            }
        }
        self.check_units(Seen::All)
    }

    /// Gives the sample to a role; a reading if it is one, and one without a value where the sensor gave none of its shaft.
    fn take(&mut self, (role, part): (usize, usize), sample: &crate::Sample) -> Option<Reading> {
        let channels = &mut self.roles[role];
        let entry = &channels.resolved.entry;
        let mut quality = sample.quality;
        let mut value = sample.value;
        // The letter of a gear in a CSV table needs no unit, and is within every range.
        let is_gear = matches!(entry.role, Role::Gear | Role::TargetGear) && channels.parts.len() == 1;
        let letter = Some(value).filter(|value| is_gear && quality == Quality::Missing && value.is_finite());
        if channels.parts.len() > 1 {
            if sample.time_s != channels.parts_s {
                if channels.parts.iter().any(Option::is_some) {
                    channels.counts.push(Quality::Missing);
                }
                channels.parts.fill(None);
                channels.parts_s = sample.time_s;
            }
            if quality == Quality::Good {
                channels.parts[part] = Some(value);
            }
            let known: Vec<f64> = channels.parts.iter().flatten().copied().collect();
            if known.len() < channels.parts.len() {
                return None;
            }
            channels.parts.fill(None);
            let divisor = if entry.combine == Combine::Mean { known.len() as f64 } else { 1.0 };
            value = known.iter().sum::<f64>() / divisor;
        }
        let value = channels.resolved.in_unit(value);
        if quality == Quality::Good
            && entry.valid_range.is_some_and(|[minimum, maximum]| !(minimum..=maximum).contains(&value))
        {
            quality = Quality::OutOfRange;
        }
        let mut value = channels.resolved.in_si(value);
        let kind = entry.role;
        if kind == Role::EngineTorque {
            value -= self.friction_n_m.unwrap_or(f64::NAN);
        }
        if quality == Quality::Good && !value.is_finite() {
            quality = Quality::Missing;
        }
        if let Some(number) = letter {
            (quality, value) = (Quality::Good, number);
        }
        if quality == Quality::Good && kind == Role::EngineFrictionTorque {
            self.friction_n_m = Some(value);
        }
        let stamp_s = sample.time_s - entry.late_s;
        let time_s = stamp_s - entry.delay_s;
        if quality == Quality::Good && kind.is_speed() {
            let reading = SpeedReading { role: kind, value, time_s: sample.time_s, may_be_held: true };
            let (judged, withdrawn) = self.speeds.judge(reading);
            quality = judged;
            self.withdrawn.extend(withdrawn.into_iter().flatten());
        }
        channels.counts.push(quality);
        let [first_s, last_s] = self.span_s;
        self.span_s = [first_s.min(sample.time_s), last_s.max(sample.time_s)];
        match quality {
            Quality::Good => {}
            Quality::Frozen | Quality::Impossible => {
                return Some(Reading { role: kind, time_s, stamp_s, value: f64::NAN });
            }
            _ => return None,
        }
        if kind == Role::Gear {
            self.is_reverse = value < 0.0;
        }
        // In reverse the car goes backwards: the sign of these speeds says nothing.
        let is_backwards = self.is_reverse && matches!(kind, Role::OutputSpeed | Role::WheelSpeed);
        channels.good_s = sample.time_s;
        channels.extremes.push(if is_backwards { value.abs() } else { value });
        Some(Reading { role: kind, time_s, stamp_s, value })
    }
}

impl Iterator for Readings<'_> {
    type Item = Result<Reading, LogError>;

    fn next(&mut self) -> Option<Self::Item> {
        let is_one = |next: &Self::Item| next.as_ref().map_or(true, |reading| !reading.is_refused());
        std::iter::from_fn(|| self.next_or_refused()).find(is_one)
    }
}

impl Readings<'_> {
    /// The next reading, also one that is refused: a frozen or an impossible speed. Its value is not a number, so that an observer
    /// reports its channel as refused.
    pub fn next_or_refused(&mut self) -> Option<Result<Reading, LogError>> {
        loop {
            if let Some((entry, reading)) = self.in_order.as_mut().and_then(|waiting| waiting.next(self.newest_s)) {
                self.entry = entry;
                return Some(Ok(reading));
            }
            match self.ahead.ready() {
                None => self.read_ahead(),
                Some(Err(error)) => return Some(Err(error)),
                Some(Ok(None)) => {
                    let (entry, reading) = self.in_order.as_mut()?.next(f64::INFINITY)?;
                    self.entry = entry;
                    return Some(Ok(reading));
                }
                Some(Ok(Some(Read { entry, reading, sample_s, resets }))) => {
                    (self.newest_s, self.resets) = (sample_s, resets);
                    match &mut self.in_order {
                        Some(waiting) => waiting.push(entry, reading),
                        None => {
                            self.entry = entry;
                            return Some(Ok(reading));
                        }
                    }
                }
            }
        }
    }

    /// Reads one more reading, and refuses those before it that it shows to be wrong.
    fn read_ahead(&mut self) {
        while let (Some(user), Some(sample)) = (self.pending.pop(), self.sample) {
            let reading = self.take(user, &sample);
            let is_one = reading.is_some();
            if let Some(reading) = reading {
                let resets = self.samples.resets();
                self.ahead.push(sample.time_s, Read { entry: user.0, reading, sample_s: sample.time_s, resets });
            }
            while let Some(withdrawn) = self.withdrawn.pop() {
                self.withdraw(withdrawn);
            }
            if is_one {
                return;
            }
        }
        match self.samples.next() {
            None => self.ahead.end(None),
            Some(Err(error)) => self.ahead.end(Some(error)),
            Some(Ok(sample)) => {
                self.pending.extend_from_slice(&self.users[sample.channel]);
                self.sample = Some(sample);
            }
        }
    }

    fn withdraw(&mut self, withdrawn: Withdrawn) {
        for Read { entry, reading, sample_s, .. } in self.ahead.waiting() {
            if reading.role == withdrawn.role && *sample_s > withdrawn.after_s && !reading.is_refused() {
                reading.value = f64::NAN;
                self.roles[*entry].counts.withdraw(withdrawn.quality);
            }
        }
    }
}
