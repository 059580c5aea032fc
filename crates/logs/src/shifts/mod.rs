//! The shifts of a drive, from the gear signals and from the ratio of turbine and output speed.
//!
//! Either is enough; with both, the signals say when a shift was commanded and the ratio says when it happened. Without a
//! turbine speed the engine speed stands for it, which shows a shift where the converter is locked.
//!
//! Readings go in one by one; some seconds of them are held in memory.

mod contradiction;
mod gears;
mod held;
mod inside;
mod quality;
mod ratio;
mod track;
mod unfit;
mod wheel;

use drivetrain::ShiftKind;
use trace::Quantity;

use self::wheel::Wheel;
use crate::map::check_ratios;
use crate::{Gearbox, LogError, Reading, Role};
use contradiction::SeenRatios;
use gears::{Change, Steady};
pub use held::Held;
pub use inside::GearsOfShift;
use ratio::RatioWatch;
use track::Track;

/// Up or down.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// To a smaller ratio.
    Up,
    /// To a larger ratio.
    Down,
}

/// Who drives whom when the shift begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Load {
    /// The engine drives the car.
    PowerOn,
    /// The car drives the engine.
    PowerOff,
    /// Neither engine speed nor torque nor throttle tells.
    Unknown,
}

/// Quality of a shift, as far as the channels tell it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ShiftQuality {
    /// Turbine speed above that of the old gear before an upshift's inertia phase, or above that of the new gear after a
    /// downshift's, rad/s; not below zero.
    pub flare_rad_s: Option<f64>,
    /// Half of the interval of 95 % of the flare, rad/s.
    pub flare_half_rad_s: Option<f64>,
    /// The same of begin and end of the inertia phase, s.
    pub inertia_half_s: Option<f64>,
    /// Jerk of the car, m/s^3, as [`drivetrain::jerk`] defines it.
    pub jerk_m_s3: Option<f64>,
    /// Half of its interval of 95 %, m/s^3.
    pub jerk_half_m_s3: Option<f64>,
}

/// A shift between two forward gears.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shift {
    /// The gear before, from 1.
    pub from: u32,
    /// The gear after.
    pub to: u32,
    /// Up or down.
    pub direction: Direction,
    /// Power-on or power-off.
    pub load: Load,
    /// When it was commanded, where a target gear or a shift flag says it, s.
    pub command_s: Option<f64>,
    /// Inertia phase: the ratio goes from 5 to 95 % of its way, s.
    pub inertia_s: Option<[f64; 2]>,
    /// When the gear signal changed, s.
    pub gear_s: Option<f64>,
    /// How good it was.
    pub quality: ShiftQuality,
}

impl Shift {
    /// Its kind in words, as far as the load is known: `power-on upshift`, or `upshift`.
    pub fn kind_name(&self) -> &'static str {
        let (on, off) = match self.direction {
            Direction::Up => (ShiftKind::PowerOnUp, ShiftKind::PowerOffUp),
            Direction::Down => (ShiftKind::PowerOnDown, ShiftKind::CoastDown),
        };
        match (self.load, self.direction) {
            (Load::PowerOn, _) => on.name(),
            (Load::PowerOff, _) => off.name(),
            (Load::Unknown, Direction::Up) => "upshift",
            (Load::Unknown, Direction::Down) => "downshift",
        }
    }

    /// When it began, s: with its command, else with the inertia phase, else with the gear signal.
    pub fn start_s(&self) -> f64 {
        let first = self.command_s.or(self.inertia_s.map(|inertia_s| inertia_s[0]));
        first.or(self.gear_s).unwrap_or(f64::NAN)
    }

    /// The same shift on a clock that began at this time of the log's, s.
    pub fn earlier_by(&self, origin_s: f64) -> Self {
        let time = |time_s: Option<f64>| time_s.map(|time_s| time_s - origin_s);
        Self {
            command_s: time(self.command_s),
            inertia_s: self.inertia_s.map(|inertia_s| inertia_s.map(|time_s| time_s - origin_s)),
            gear_s: time(self.gear_s),
            ..*self
        }
    }

    /// When it ended, s: with the inertia phase, else with the gear signal.
    pub fn end_s(&self) -> f64 {
        self.inertia_s.map(|inertia_s| inertia_s[1]).or(self.gear_s).unwrap_or(f64::NAN)
    }

    /// The phases, as far as the times are known, each from one time to another, s.
    ///
    /// In power-on upshifts and coast downshifts the torque phase comes before the inertia phase, otherwise after it. The filling of
    /// the oncoming clutch cannot be told from a torque phase that follows it, nor the torque phase at the end from what the
    /// control unit does until it reports the gear.
    pub fn phases(&self) -> Vec<(ShiftPhase, [f64; 2])> {
        let Some([begin_s, end_s]) = self.inertia_s else { return Vec::new() };
        let (before, after) = match (self.load, self.direction) {
            (Load::PowerOn, Direction::Up) | (Load::PowerOff, Direction::Down) => {
                (ShiftPhase::FillAndTorque, ShiftPhase::LockUp)
            }
            (Load::Unknown, _) => (ShiftPhase::Before, ShiftPhase::After),
            _ => (ShiftPhase::Fill, ShiftPhase::TorqueAndLockUp),
        };
        let before =
            self.command_s.filter(|command_s| *command_s < begin_s).map(|command_s| (before, [command_s, begin_s]));
        let after = self.gear_s.filter(|gear_s| *gear_s > end_s).map(|gear_s| (after, [end_s, gear_s]));
        before.into_iter().chain([(ShiftPhase::Inertia, [begin_s, end_s])]).chain(after).collect()
    }
}

/// A phase of a shift as a log tells it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ShiftPhase {
    /// From the command on: the oncoming clutch fills, then takes the load.
    FillAndTorque,
    /// From the command on: the oncoming clutch fills.
    Fill,
    /// From the command on, where the load is not known.
    Before,
    /// The ratio changes.
    Inertia,
    /// Until the gear is reported: the oncoming clutch is closed.
    LockUp,
    /// Until the gear is reported: the oncoming clutch takes the load and is closed.
    TorqueAndLockUp,
    /// Until the gear is reported, where the load is not known.
    After,
}

impl ShiftPhase {
    /// A word for tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::FillAndTorque => "fill and torque",
            Self::Fill => "fill",
            Self::Before => "before",
            Self::Inertia => "inertia",
            Self::LockUp => "lock-up",
            Self::TorqueAndLockUp => "torque and lock-up",
            Self::After => "after",
        }
    }
}

/// Readings that are held, s.
const HELD_S: f64 = 12.0;
/// After the last change of a shift so much is waited for before its quality is found, s.
const AFTER_S: f64 = 0.6;
/// A command belongs to a change of the gear at most so much later, s.
const COMMAND_S: f64 = 5.0;
/// A change of the gear signal and one of the ratio are one shift if they are at most so far apart, s.
const SAME_S: f64 = 3.0;
/// Nothing that comes so much later changes a shift, s: a gear signal may come three seconds before a change of the ratio, and
/// that may take three seconds.
pub const SETTLED_S: f64 = SAME_S + ratio::LONGEST_S + AFTER_S;
/// A shift begins at most so much before its end, s.
pub const LONGEST_S: f64 = COMMAND_S + ratio::LONGEST_S;

/// Whether a car can have this value. A speed in a wrong unit can pass.
fn is_of_a_car(role: Role, value: f64) -> bool {
    let maximum = match role.quantity() {
        Some(Quantity::Rotation) => 1e5,
        Some(Quantity::Velocity | Quantity::Acceleration) => 1e3,
        Some(Quantity::Torque) => 1e6,
        _ => return true,
    };
    value.abs() <= maximum
}

/// Finds the shifts of a drive.
pub struct ShiftFinder {
    ratios: Vec<f64>,
    output_rad_per_m: Option<f64>,
    /// Whether the turbine speed comes from the engine.
    by_engine: bool,
    /// Shifts by the engine speed that the gear signal contradicts.
    left_out: usize,
    /// Whether speeds are there that can show shifts.
    has_speeds: bool,
    tracks: [Track; ROLES],
    ratio: RatioWatch,
    wheel: Wheel,
    gear: Steady,
    target: Steady,
    active: Steady,
    seen_ratios: SeenRatios,
    /// Commands so far: time and gear.
    commands: Vec<(f64, Option<u32>)>,
    waiting: Vec<Shift>,
    found: Vec<Shift>,
    by_signal: Vec<Shift>,
}

/// Roles whose readings are held, by their place: all before those of single elements, of which there are several channels.
const ROLES: usize = Role::LockUpApplied as usize + 1;

impl ShiftFinder {
    /// A finder for a gearbox and a log with these roles.
    ///
    /// # Errors
    /// The ratios are wrong, or there is nothing that tells a shift.
    pub fn new(gearbox: &Gearbox, has: impl Fn(Role) -> bool) -> Result<Self, LogError> {
        check_ratios(&gearbox.ratios).map_err(|message| LogError::map(format!("ratios: {message}")))?;
        let output_rad_per_m = gearbox.output_rad_per_m;
        let output = has(Role::OutputSpeed) || has(Role::VehicleSpeed) && output_rad_per_m.is_some();
        let speeds = gearbox.ratios.len() >= 2 && output && (has(Role::TurbineSpeed) || has(Role::EngineSpeed));
        if !speeds && !has(Role::Gear) && !has(Role::TargetGear) {
            return Err(LogError::map(
                "no channel of the map shows a shift\n\
                 hint: map `gear` or `target_gear`, or map `turbine_speed` and `output_speed` (or `vehicle_speed`, with \
                 `gearbox.output_rad_per_m`) and give the ratios of the gears",
            ));
        }
        Ok(Self {
            output_rad_per_m,
            by_engine: !has(Role::TurbineSpeed),
            left_out: 0,
            has_speeds: speeds,
            tracks: std::array::from_fn(|_| Track::new(HELD_S)),
            ratio: RatioWatch::new(&gearbox.ratios, HELD_S),
            wheel: Wheel::default(),
            gear: Steady::default(),
            target: Steady::default(),
            active: Steady::default(),
            seen_ratios: SeenRatios::default(),
            commands: Vec::new(),
            waiting: Vec::new(),
            found: Vec::new(),
            by_signal: Vec::new(),
            ratios: gearbox.ratios.clone(),
        })
    }

    /// Takes a reading. Readings of each role come in the order of time.
    pub fn push(&mut self, reading: &Reading) {
        let Reading { role, time_s, value, .. } = *reading;
        if reading.is_refused() {
            if matches!(role, Role::TurbineSpeed | Role::OutputSpeed) {
                self.ratio.goes_on(time_s);
            }
            return;
        }
        if !is_of_a_car(role, value) {
            return;
        }
        if let Some(track) = self.tracks.get_mut(role as usize) {
            track.push(time_s, value);
        }
        match role {
            Role::Gear => {
                let number = self.gear_number(value);
                if let Some(change) = self.gear.push(time_s, number) {
                    self.gear_changed(change);
                }
                if let Some(gear) = self.gear.value() {
                    self.seen_ratios.gear(time_s, gear);
                }
            }
            Role::TargetGear => {
                if let Some(change) = self.target.push(time_s, self.gear_number(value)) {
                    self.commands.push((change.time_s, change.to));
                }
            }
            Role::ShiftActive => {
                if let Some(change) = self.active.push(time_s, Some(u32::from(value > 0.5)))
                    && change.to == Some(1)
                {
                    self.commands.push((change.time_s, None));
                }
            }
            Role::TurbineSpeed => self.ratio.turbine(time_s, value),
            Role::EngineSpeed if self.by_engine => self.ratio.turbine(time_s, value),
            Role::OutputSpeed => {
                self.ratio.output(time_s, value);
                self.wheel.output(time_s, value);
            }
            Role::WheelSpeed => {
                if let Some(output_rad_s) = self.wheel.wheel(time_s, value) {
                    self.ratio.output(time_s, output_rad_s);
                }
            }
            Role::VehicleSpeed => {
                if let (Some(rad_per_m), true) =
                    (self.output_rad_per_m, self.tracks[Role::OutputSpeed as usize].is_empty())
                {
                    self.ratio.output(time_s, value * rad_per_m);
                }
            }
            _ => {}
        }
        while let Some(change) = self.ratio.next_change() {
            let command_s = self.command(change.to, change.inertia_s[0] - COMMAND_S, change.inertia_s[1]);
            self.wait(change.from, change.to, command_s, Some(change.inertia_s), None);
        }
        if self.seen_ratios.has_gear()
            && let Some(point) = self.ratio.newest().filter(|_| !self.by_engine)
        {
            self.seen_ratios.ratio(point.time_s, point.ratio);
        }
        if !self.waiting.is_empty() {
            // The gear signal may change later than an engine that stands for the turbine.
            self.settle(time_s - if self.by_engine { SAME_S } else { AFTER_S });
        }
    }

    /// Takes back a reading of this time: load and quality of a shift do without it. The ratio of the speeds is the middle one of several
    /// in any case.
    pub fn take_back(&mut self, role: Role, time_s: f64) {
        if let Some(track) = self.tracks.get_mut(role as usize) {
            track.take_back(time_s);
        }
    }

    /// The gears whose given ratio is not that of the speeds while the gear signal says them, in a sentence with a hint.
    pub fn contradiction(&self) -> Option<String> {
        self.seen_ratios.contradiction(&self.ratios)
    }

    /// What is to be said of the shifts and of those that are missing, in sentences, some with a hint; complete after [`Self::restart`].
    pub fn notes(&self) -> Vec<String> {
        let mut notes: Vec<String> = self.contradiction().into_iter().collect();
        let by_engine = self.has_speeds && self.by_engine;
        // While the converter slips, the engine is rightly in no gear.
        let unfit = self.ratio.unfit();
        if self.has_speeds && (!self.by_engine || !unfit.engaged) {
            notes.extend(unfit.reason(&self.ratios, if self.by_engine { "engine" } else { "turbine" }));
        }
        if by_engine {
            notes.push(
                "no turbine speed is mapped: the engine speed replaces it, which shows a shift only while the converter is locked; inertia phase \
                 and flare are wrong where it slips"
                    .to_owned(),
            );
        }
        if self.left_out > 0 {
            notes.push(format!(
                "{} changes of the ratio of engine and output speed are left out: the gear signal has no such shift",
                self.left_out
            ));
        }
        notes
    }

    /// Forgets what came before, as after a reset of the clock. The shifts so far stay.
    pub fn restart(&mut self) {
        self.settle(f64::INFINITY);
        self.tracks.iter_mut().for_each(Track::clear);
        self.ratio.restart(&self.ratios, HELD_S);
        (self.gear, self.target, self.active) = Default::default();
        self.commands.clear();
    }

    /// Takes out the shifts that nothing after `now_s` can change, in the order of their beginning; each is given once.
    pub fn take_settled(&mut self, now_s: f64) -> Vec<Shift> {
        // Mostly there is none.
        if self.found.is_empty() && self.by_signal.is_empty() {
            return Vec::new();
        }
        let is_open = |shift: &Shift| shift.end_s() + SETTLED_S >= now_s;
        let are_open = |shifts: &[Shift]| shifts.iter().all(is_open);
        if are_open(&self.found) && are_open(&self.by_signal) {
            return Vec::new();
        }
        self.join_signals();
        if are_open(&self.found) && are_open(&self.by_signal) {
            return Vec::new();
        }
        let (open, mut settled): (Vec<_>, Vec<_>) = std::mem::take(&mut self.found).into_iter().partition(is_open);
        self.found = open;
        let (open, alone): (Vec<_>, Vec<_>) = std::mem::take(&mut self.by_signal).into_iter().partition(is_open);
        self.by_signal = open;
        settled.extend(alone);
        settled.sort_by(|one, other| one.start_s().total_cmp(&other.start_s()));
        settled
    }

    /// The shifts that were not taken out yet, in the order of their beginning.
    pub fn finish(mut self) -> Vec<Shift> {
        self.settle(f64::INFINITY);
        self.take_settled(f64::INFINITY)
    }

    /// Gives each shift that the ratio showed the gear signal that belongs to it.
    fn join_signals(&mut self) {
        let found = &mut self.found;
        self.by_signal.retain(|by_signal| {
            let same = |shift: &&mut Shift| {
                let near = |gear_s: f64| (shift.start_s() - SAME_S..=shift.end_s() + SAME_S).contains(&gear_s);
                shift.gear_s.is_none()
                    && (shift.from, shift.to) == (by_signal.from, by_signal.to)
                    && by_signal.gear_s.is_some_and(near)
            };
            let Some(shift) = found.iter_mut().find(same) else { return true };
            shift.gear_s = by_signal.gear_s;
            shift.command_s = shift.command_s.or(by_signal.command_s);
            false
        });
    }

    /// A forward gear; none for neutral, reverse and what stands for no gear.
    fn gear_number(&self, value: f64) -> Option<u32> {
        const MAXIMUM: f64 = 12.0;
        let maximum = if self.ratios.is_empty() {
            MAXIMUM
        } else {
            f64::from(u32::try_from(self.ratios.len()).unwrap_or(u32::MAX))
        };
        (value.fract() == 0.0 && (1.0..=maximum).contains(&value)).then_some(value as u32)
    }

    fn gear_changed(&mut self, change: Change) {
        if let (Some(from), Some(to)) = (change.from, change.to) {
            let command_s = self.command(to, change.time_s - COMMAND_S, change.time_s);
            self.wait(from, to, command_s, None, Some(change.time_s));
        }
    }

    /// The last command of a gear in this time; the last shift flag if no target gear is known.
    fn command(&self, to: u32, from_s: f64, to_s: f64) -> Option<f64> {
        let within = |time_s: f64| (from_s..=to_s).contains(&time_s);
        let commands = || self.commands.iter().rev().filter(|(time_s, _)| within(*time_s));
        let target = commands().find(|(_, gear)| *gear == Some(to));
        target.or_else(|| commands().find(|(_, gear)| gear.is_none())).map(|(time_s, _)| *time_s)
    }

    fn wait(&mut self, from: u32, to: u32, command_s: Option<f64>, inertia_s: Option<[f64; 2]>, gear_s: Option<f64>) {
        let direction = if to > from { Direction::Up } else { Direction::Down };
        let quality = ShiftQuality::default();
        self.waiting.push(Shift { from, to, direction, load: Load::Unknown, command_s, inertia_s, gear_s, quality });
    }

    /// Whether the gear signal was in forward gears around a shift, and not in both of its gears.
    fn gear_signal_contradicts(&self, shift: &Shift) -> bool {
        let around = self.tracks[Role::Gear as usize].between(shift.start_s() - SAME_S, shift.end_s() + SAME_S);
        let (mut any, mut both) = (false, [false; 2]);
        for gear in around.filter_map(|(_, value)| self.gear_number(value)) {
            any = true;
            both = [both[0] || gear == shift.from, both[1] || gear == shift.to];
        }
        any && both != [true; 2]
    }

    /// Finds load and quality of the shifts that ended before a time.
    fn settle(&mut self, before_s: f64) {
        while let Some(at) = self.waiting.iter().position(|shift| shift.end_s() < before_s) {
            let mut shift = self.waiting.swap_remove(at);
            if self.by_engine && shift.inertia_s.is_some() && self.gear_signal_contradicts(&shift) {
                self.left_out += 1;
                continue;
            }
            shift.load = quality::load(&shift, &self.tracks);
            shift.quality = quality::quality(&shift, &self.ratios, &self.tracks, &self.ratio, self.output_rad_per_m);
            match shift.inertia_s {
                Some(_) => self.found.push(shift),
                None => self.by_signal.push(shift),
            }
        }
    }
}
