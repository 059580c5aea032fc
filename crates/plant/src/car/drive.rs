//! A drive with all its shifts.

use config::{Car, Drive, ShiftPlan};

use super::controller::CarCalibration;
use super::integrate::CarError;
use super::model::CarModel;
use super::run::{CarRun, Driver};
use super::sample::CarSample;
use super::start::idle_throttle;

/// Engine speed below which the engine has stalled, rad/s.
const STALLED_RAD_S: f64 = 30.0;
/// The gear below is taken at no more than this share of the speed at which the gear was reached: the hysteresis.
const HYSTERESIS: f64 = 0.85;
/// Times closer than this are the same instant, s.
const SAME_INSTANT_S: f64 = 1e-9;

/// What a drive came to.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CarDriveSummary {
    /// Its length, s.
    pub duration_s: f64,
    /// The way, m.
    pub distance_m: f64,
    /// Shifts that were completed.
    pub shifts: usize,
    /// Highest speed, m/s.
    pub fastest_m_s: f64,
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
    if drive.segments.is_empty() || drive.segments.iter().any(|segment| segment.duration_s.max(0.0) < 1e-3) {
        return Err(CarError::Request("a drive needs segments of 1 ms or more".to_owned()));
    }
    let mut road = Road::new(drive);
    let mut shifting = Shifting::new(&model.car, drive)?;
    let driver = road.at(0.0);
    let state = model.in_gear(shifting.gear, None, drive.start_m_s, driver.throttle)?;
    let start = (driver, drive.sample_time_s);
    let mut run = CarRun::new(model, nominal, calibration, shifting.gear, state, start)?;
    let duration_s = drive.duration_s();
    let mut summary = CarDriveSummary { duration_s, ..CarDriveSummary::default() };
    while run.time_s() < duration_s - SAME_INSTANT_S {
        let now_s = run.time_s();
        let mut driver = road.at(now_s);
        let [engine_rad_s, ..] = model.speeds(run.state());
        if engine_rad_s < STALLED_RAD_S {
            return Err(stalled(model, now_s, engine_rad_s));
        }
        shifting.step(&mut run, &driver)?;
        driver.throttle = driver.throttle.max(idle_throttle(engine_rad_s));
        run.advance(driver, |_| {}, &mut record)?;
        let vehicle_m_s = run.state().vehicle_m_s;
        summary.distance_m += vehicle_m_s * (run.time_s() - now_s);
        summary.fastest_m_s = summary.fastest_m_s.max(vehicle_m_s);
    }
    summary.shifts = shifting.completed;
    Ok(summary)
}

fn stalled(model: &CarModel, now_s: f64, engine_rad_s: f64) -> CarError {
    let why = match model.car.converter {
        Some(_) => "the load is too large for the engine",
        None => "without a converter a launch is not simulated: begin at a speed in a gear, and do not stop",
    };
    CarError::Request(format!("the engine stalls at {now_s:.2} s ({engine_rad_s:.0} rad/s): {why}"))
}

/// What driver and road do over time, piece by piece.
struct Road<'d> {
    drive: &'d Drive,
    segment: usize,
    begun_s: f64,
}

impl<'d> Road<'d> {
    fn new(drive: &'d Drive) -> Self {
        Self { drive, segment: 0, begun_s: 0.0 }
    }

    /// At a time that does not fall from call to call.
    fn at(&mut self, time_s: f64) -> Driver {
        let segments = &self.drive.segments;
        while time_s >= self.begun_s + segments[self.segment].duration_s - SAME_INSTANT_S {
            self.begun_s += segments[self.segment].duration_s;
            self.segment = (self.segment + 1) % segments.len();
        }
        let segment = &segments[self.segment];
        let share = ((time_s - self.begun_s) / segment.duration_s).clamp(0.0, 1.0);
        let at = |[from, to]: [f64; 2]| from + share * (to - from);
        Driver { throttle: at(segment.throttle), brake: at(segment.brake), grade_rad: at(segment.grade_rad) }
    }
}

/// Which gear is wanted when.
struct Shifting<'d> {
    plan: &'d ShiftPlan,
    /// The forward gears from the lowest to the highest, each with its ratio.
    gears: Vec<(usize, f64)>,
    final_ratio: f64,
    gear: usize,
    since_s: f64,
    listed: usize,
    listed_gears: Vec<(f64, usize)>,
    completed: usize,
}

impl<'d> Shifting<'d> {
    fn new(car: &Car, drive: &'d Drive) -> Result<Self, CarError> {
        let named = |name: &str| {
            let names = || car.gearbox.gears.iter().map(|gear| gear.name.as_str()).collect::<Vec<_>>().join(", ");
            let message = || format!("the gearbox has no gear \"{name}\"\nhint: its gears are {}", names());
            car.gearbox.gear(name).ok_or_else(|| CarError::Request(message()))
        };
        let gears: Vec<(usize, f64)> =
            car.gearbox.forward_gears().into_iter().map(|gear| (gear, car.gearbox.gears[gear].ratio)).collect();
        let lowest = gears.first().map(|&(gear, _)| gear);
        let no_gear = || CarError::Request("the gearbox has no forward gear".to_owned());
        let gear = match &drive.start_gear {
            Some(name) => named(name)?,
            None => lowest.ok_or_else(no_gear)?,
        };
        let listed_gears = match &drive.shifts {
            ShiftPlan::Listed(list) => {
                list.iter().map(|(time_s, name)| named(name).map(|gear| (*time_s, gear))).collect::<Result<_, _>>()?
            }
            ShiftPlan::Schedule(_) => Vec::new(),
        };
        let final_ratio = car.driveline.final_ratio;
        let (plan, since_s) = (&drive.shifts, 0.0);
        Ok(Self { plan, gears, final_ratio, gear, since_s, listed: 0, listed_gears, completed: 0 })
    }

    /// Asks for another gear where the plan wants it.
    fn step(&mut self, run: &mut CarRun<'_>, driver: &Driver) -> Result<(), CarError> {
        let now_s = run.time_s();
        if run.controller().gear() != self.gear {
            self.gear = run.controller().gear();
            self.since_s = now_s;
            self.completed += 1;
        }
        if run.controller().shift().is_some() {
            return Ok(());
        }
        match self.plan {
            ShiftPlan::Listed(_) => match self.listed_gears.get(self.listed) {
                Some(&(time_s, gear)) if now_s >= time_s - SAME_INSTANT_S => {
                    self.listed += 1;
                    run.request(gear)
                }
                next => {
                    run.preselect(next.map(|&(_, gear)| gear));
                    Ok(())
                }
            },
            ShiftPlan::Schedule(schedule) => {
                let Some(at) = self.gears.iter().position(|&(gear, _)| gear == self.gear) else { return Ok(()) };
                let ratio = self.gears[at].1;
                let input_rad_s = run.state().wheel_rad_s * self.final_ratio * ratio;
                let (up, down) = (schedule.up_rad_s.at(driver.throttle), schedule.down_rad_s.at(driver.throttle));
                let above = self.gears.get(at + 1);
                let below = at.checked_sub(1).map(|below| self.gears[below]);
                let down = below.map_or(0.0, |(_, lower)| down.min(HYSTERESIS * up * ratio / lower));
                let nearer_above = input_rad_s - down > up - input_rad_s;
                let expected = if nearer_above { above.copied().or(below) } else { below.or(above.copied()) };
                run.preselect(expected.map(|(gear, _)| gear));
                if now_s < self.since_s + schedule.time_in_gear_s {
                    return Ok(());
                }
                match (above, below) {
                    (Some(&(gear, _)), _) if input_rad_s > up => run.request(gear),
                    (_, Some((gear, _))) if input_rad_s < down => run.request(gear),
                    _ => Ok(()),
                }
            }
        }
    }
}
