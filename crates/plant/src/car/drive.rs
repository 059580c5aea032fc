//! A drive with all its shifts.

use std::collections::VecDeque;

use car::{Car, Drive, ShiftCommand, ShiftPlan, ShiftSchedule};

use super::controller::CarCalibration;
use super::faults::{self, Faults};
use super::follow::{Follower, SpeedError};
use super::integrate::CarError;
use super::model::CarModel;
use super::run::{CarRun, Driver};
use super::sample::CarSample;

/// Engine speed below which the engine has stalled, rad/s.
const STALLED_RAD_S: f64 = 30.0;
/// The gear below is taken at no more than this fraction of the speed at which the gear was reached: the hysteresis.
const HYSTERESIS: f64 = 0.85;
/// Times closer than this are the same instant, s.
const SAME_INSTANT_S: f64 = 1e-9;

/// What a drive came to.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CarDriveSummary {
    /// Its length, s.
    pub duration_s: f64,
    /// The way, forwards and backwards, m.
    pub distance_m: f64,
    /// What of it was driven backwards, m.
    pub backwards_m: f64,
    /// Shifts that were completed.
    pub shifts: usize,
    /// Highest speed, forwards or backwards, m/s.
    pub fastest_m_s: f64,
    /// How well the speed was followed, where the drive gives one.
    pub speed_error: Option<SpeedError>,
    /// Where the engine turned fastest, if that is beyond its torque map.
    pub over_speed: Option<OverSpeed>,
}

/// An engine that turns faster than its torque map is given: a shift was asked for that a gearbox controller refuses, or the car
/// pushes the engine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OverSpeed {
    /// When it turned fastest, s.
    pub time_s: f64,
    /// How fast, rad/s.
    pub engine_rad_s: f64,
    /// The end of the torque map, rad/s.
    pub map_rad_s: f64,
    /// The gear, and the gear that is asked for.
    pub gears: ShiftCommand,
}

/// Simulates a drive and shows every sample to `record`. `nominal` is the car of the shift controller's model.
///
/// # Errors
/// The drive asks for a gear or a shift that the gearbox does not have, the engine stalls, or the simulation fails.
pub fn simulate_car_drive(
    model: &CarModel,
    nominal: &Car,
    calibration: CarCalibration,
    drive: &Drive,
    mut record: impl FnMut(&CarSample),
) -> Result<CarDriveSummary, CarError> {
    simulate_car_drive_while(model, nominal, calibration, drive, |sample| {
        record(sample);
        true
    })
}

/// As [`simulate_car_drive`], as long as `record` says true.
///
/// # Errors
/// As there.
pub fn simulate_car_drive_while(
    model: &CarModel,
    nominal: &Car,
    calibration: CarCalibration,
    drive: &Drive,
    mut record: impl FnMut(&CarSample) -> bool,
) -> Result<CarDriveSummary, CarError> {
    let mut road = Road::new(drive)?;
    let mut shifting = Shifting::new(&model.car, drive)?;
    let driver = road.at_start();
    let state = model.in_gear(shifting.gear, None, drive.start_m_s, driver.throttle)?;
    let start = (driver, drive.sample_time_s);
    let changed = faults::changed(model, &drive.faults)?;
    let mut changes = changed.iter().peekable();
    let run = CarRun::new(model, nominal, calibration, shifting.gear, state, start)?;
    let mut run = run.with_faults(Faults::of(&model.car, &drive.faults)?);
    if shifting.starts_in_neutral {
        run.start_in_neutral()?;
    }
    let duration_s = drive.duration_s();
    let mut summary = CarDriveSummary { duration_s, ..CarDriveSummary::default() };
    let mut goes_on = true;
    while goes_on && run.time_s() < duration_s - SAME_INSTANT_S {
        let now_s = run.time_s();
        while let Some((_, changed)) = changes.next_if(|(from_s, _)| now_s >= *from_s) {
            run.go_on_as(changed);
        }
        let driver = road.at(now_s, &run);
        let [engine_rad_s, ..] = model.speeds(run.state());
        if engine_rad_s < STALLED_RAD_S {
            let message = format!(
                "the engine stalls at {now_s:.2} s ({engine_rad_s:.0} rad/s): the load is too large\nhint: reduce grade, brake or mass, open the throttle more, or begin in a lower gear"
            );
            return Err(CarError::Request(message));
        }
        let map_rad_s = model.engine_map_rad_s();
        if engine_rad_s > summary.over_speed.map_or(map_rad_s, |over| over.engine_rad_s) {
            let gear = run.controller().gear();
            let gears = ShiftCommand::between(gear, run.controller().shift().map_or(gear, |shift| shift.to));
            summary.over_speed = Some(OverSpeed { time_s: now_s, engine_rad_s, map_rad_s, gears });
        }
        shifting.step(&mut run, &driver)?;
        run.advance(driver, |_| {}, |sample| goes_on &= record(sample))?;
        let vehicle_m_s = run.state().vehicle_m_s;
        let dt_s = run.time_s() - now_s;
        summary.distance_m += vehicle_m_s.abs() * dt_s;
        summary.backwards_m += (-vehicle_m_s).max(0.0) * dt_s;
        summary.fastest_m_s = summary.fastest_m_s.max(vehicle_m_s.abs());
    }
    summary.shifts = run.controller().completed();
    summary.speed_error = road.follower.map(|follower| follower.error());
    Ok(summary)
}

/// What driver and road do over time: piece by piece, or as the speed wants it.
struct Road<'d> {
    drive: &'d Drive,
    segment: usize,
    begun_s: f64,
    follower: Option<Follower<'d>>,
}

impl<'d> Road<'d> {
    fn new(drive: &'d Drive) -> Result<Self, CarError> {
        let is_short = drive.segments.iter().any(|segment| segment.duration_s.max(0.0) < 1e-3);
        if drive.trace.is_none() && (drive.segments.is_empty() || is_short) {
            return Err(CarError::Request(
                "a drive needs segments of 1 ms or more\nhint: give each [[segment]] a longer `duration_s`".to_owned(),
            ));
        }
        Ok(Self { drive, segment: 0, begun_s: 0.0, follower: drive.trace.as_ref().map(Follower::new) })
    }

    fn at_start(&mut self) -> Driver {
        match &self.drive.trace {
            Some(trace) => Driver { throttle: 0.0, brake: 0.0, grade_rad: trace.grade_rad },
            None => self.piece(0.0),
        }
    }

    /// At a time that does not fall from call to call.
    fn at(&mut self, time_s: f64, run: &CarRun<'_>) -> Driver {
        match &mut self.follower {
            Some(follower) => follower.step(run.model(), run.state(), run.controller().gear(), time_s, run.period_s()),
            None => self.piece(time_s),
        }
    }

    fn piece(&mut self, time_s: f64) -> Driver {
        let segments = &self.drive.segments;
        while time_s >= self.begun_s + segments[self.segment].duration_s - SAME_INSTANT_S {
            self.begun_s += segments[self.segment].duration_s;
            self.segment = (self.segment + 1) % segments.len();
        }
        let segment = &segments[self.segment];
        let fraction = ((time_s - self.begun_s) / segment.duration_s).clamp(0.0, 1.0);
        let at = |[from, to]: [f64; 2]| from + fraction * (to - from);
        Driver { throttle: at(segment.throttle), brake: at(segment.brake), grade_rad: at(segment.grade_rad) }
    }
}

/// What is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Wanted {
    Neutral,
    Gear(usize),
}

/// Name of neutral in a drive file.
const NEUTRAL: &str = "N";

/// Which gear a drive wants when.
#[derive(Debug, Clone)]
pub struct Shifting<'d> {
    plan: &'d ShiftPlan,
    /// The forward gears from the lowest to the highest, each with its ratio.
    gears: Vec<(usize, f64)>,
    final_ratio: f64,
    gear: usize,
    starts_in_neutral: bool,
    since_s: f64,
    listed: VecDeque<(f64, Wanted)>,
}

impl<'d> Shifting<'d> {
    /// At the start of a drive.
    ///
    /// # Errors
    /// The gearbox has no gear of such a name, or no forward gear.
    pub fn new(car: &Car, drive: &'d Drive) -> Result<Self, CarError> {
        let named = |name: &str| {
            let names = || car.gearbox.gears.iter().map(|gear| gear.name.as_str()).collect::<Vec<_>>().join(", ");
            let message = || format!("the gearbox has no gear \"{name}\"\nhint: its gears are {}", names());
            match car.gearbox.gear(name) {
                Some(gear) => Ok(Wanted::Gear(gear)),
                None if name == NEUTRAL => Ok(Wanted::Neutral),
                None => Err(CarError::Request(message())),
            }
        };
        let gears: Vec<(usize, f64)> =
            car.gearbox.forward_gears().into_iter().map(|gear| (gear, car.gearbox.gears[gear].ratio)).collect();
        let no_gear = || {
            CarError::Request("the gearbox has no forward gear\nhint: a forward gear has a positive ratio".to_owned())
        };
        let lowest = gears.first().map(|&(gear, _)| gear).ok_or_else(no_gear)?;
        let start = drive.start_gear.as_deref().map_or(Ok(Wanted::Gear(lowest)), named)?;
        let (gear, starts_in_neutral) = match start {
            Wanted::Gear(gear) => (gear, false),
            Wanted::Neutral => (lowest, true),
        };
        let listed = match &drive.shifts {
            ShiftPlan::Listed(list) => list
                .iter()
                .map(|(time_s, name)| named(name).map(|wanted| (*time_s, wanted)))
                .collect::<Result<_, _>>()?,
            ShiftPlan::Schedule(_) => VecDeque::new(),
        };
        let final_ratio = car.driveline.final_ratio;
        let (plan, since_s) = (&drive.shifts, 0.0);
        Ok(Self { plan, gears, final_ratio, gear, starts_in_neutral, since_s, listed })
    }

    /// The gear that was engaged last.
    pub fn gear(&self) -> usize {
        self.gear
    }

    /// Asks for another gear where the plan wants it.
    ///
    /// # Errors
    /// The gear cannot be reached.
    pub fn step(&mut self, run: &mut CarRun<'_>, driver: &Driver) -> Result<(), CarError> {
        let now_s = run.time_s();
        if run.controller().gear() != self.gear {
            self.gear = run.controller().gear();
            self.since_s = now_s;
        }
        match self.plan {
            ShiftPlan::Listed(_) => self.listed(run, now_s),
            ShiftPlan::Schedule(schedule) => self.scheduled(run, driver, schedule),
        }
    }

    fn listed(&mut self, run: &mut CarRun<'_>, now_s: f64) -> Result<(), CarError> {
        let Some(&(time_s, wanted)) = self.listed.front() else { return Ok(()) };
        if now_s < time_s - SAME_INSTANT_S {
            if let Wanted::Gear(gear) = wanted
                && run.controller().shift().is_none()
            {
                run.preselect(Some(gear));
            }
            return Ok(());
        }
        self.listed.pop_front();
        match wanted {
            Wanted::Gear(gear) => run.request(gear),
            Wanted::Neutral => run.request_neutral(),
        }
    }

    fn scheduled(&self, run: &mut CarRun<'_>, driver: &Driver, schedule: &ShiftSchedule) -> Result<(), CarError> {
        let place = |gear: usize| self.gears.iter().position(|&(other, _)| other == gear);
        if run.controller().is_neutral() {
            return Ok(());
        }
        let Some(at) = place(self.gear) else { return Ok(()) };
        let output_rad_s = run.state().wheel_rad_s * self.final_ratio;
        if let Some(shift) = run.controller().shift() {
            // The driver has changed his mind: back, or further on.
            let (Some(from), Some(to)) = (place(shift.from), place(shift.to)) else { return Ok(()) };
            let wanted = self.wanted(schedule, driver, output_rad_s, to);
            let is_back = if to > from { wanted <= from } else { wanted >= from };
            let is_further = if to > from { wanted > to } else { wanted < to };
            return match (is_back, is_further) {
                (true, _) => run.request(shift.from),
                (_, true) => run.request(self.gears[wanted].0),
                _ => Ok(()),
            };
        }
        let (_, ratio) = self.gears[at];
        let (up, down) = self.lines(schedule, driver, at);
        let (above, below) = (self.gears.get(at + 1), at.checked_sub(1).map(|below| &self.gears[below]));
        let nearer_above = ratio * output_rad_s - down > up - ratio * output_rad_s;
        let expected = if nearer_above { above.or(below) } else { below.or(above) };
        run.preselect(expected.map(|&(gear, _)| gear));
        if run.time_s() < self.since_s + schedule.time_in_gear_s {
            return Ok(());
        }
        let wanted = self.wanted(schedule, driver, output_rad_s, at);
        if wanted == at { Ok(()) } else { run.request(self.gears[wanted].0) }
    }

    /// Speeds of the gearbox input in the gear at this place above and below which another gear is wanted, rad/s.
    fn lines(&self, schedule: &ShiftSchedule, driver: &Driver, at: usize) -> (f64, f64) {
        let (up, down) = (schedule.up_rad_s.at(driver.throttle), schedule.down_rad_s.at(driver.throttle));
        let below = at.checked_sub(1).map(|below| self.gears[below].1);
        (up, below.map_or(0.0, |lower| down.min(HYSTERESIS * up * self.gears[at].1 / lower)))
    }

    /// Place of the gear that the schedule wants at this speed of the output, from the gear at a place.
    fn wanted(&self, schedule: &ShiftSchedule, driver: &Driver, output_rad_s: f64, from: usize) -> usize {
        let mut at = from;
        while at + 1 < self.gears.len() && self.gears[at].1 * output_rad_s > self.lines(schedule, driver, at).0 {
            at += 1;
        }
        if at != from {
            return at;
        }
        while at > 0 && self.gears[at].1 * output_rad_s < self.lines(schedule, driver, at).1 {
            at -= 1;
        }
        at
    }
}
