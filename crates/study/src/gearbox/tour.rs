//! A drive through all gears of any car: up under power, down coasting, up without power, down under power.

use car::Car;
use car::ErrorBudget;
use observer::ShiftTables;
use plant::car::{CarCalibration, CarError, CarModel, CarRun, CarSample, CarShift, Driver, idle_throttle};

use super::matrix::neighbouring_shifts;
use super::{EvaluateError, RECORD_S};

/// Throttle at which the car accelerates to the speed of a shift, the one of a car that does not reach it so, and brake at which it
/// slows down to it \[chosen\].
const ACCELERATE: f64 = 0.5;
const FULL: f64 = 1.0;
const SLOW_DOWN: f64 = 0.08;
/// Throttle of the shifts under power \[chosen\].
const POWER_ON: f64 = 0.15;
/// Time with the throttle of a shift before its request, and after its end, s \[chosen\].
const SETTLE_S: f64 = 1.0;
const AFTER_S: f64 = 0.6;
/// Time in which the driver moves the pedal, s.
const PEDAL_S: f64 = 0.3;
/// How near the speed of a shift must be, m/s.
const NEAR_M_S: f64 = 0.3;
/// Longest time to reach the speed of a shift, and longest shift, s.
const LONGEST_APPROACH_S: f64 = 90.0;
/// Fraction of that time after which the throttle opens fully.
const PATIENCE: f64 = 0.7;
/// A car that is too weak for the speed of a shift makes it at its highest speed, if that is at least this fraction \[chosen\].
const SLOWEST: f64 = 0.6;
const LONGEST_SHIFT_S: f64 = 6.0;
/// Speed at the start of a car without a converter, over that of its first shift: a launch is not simulated.
const START: f64 = 0.6;

/// A shift of the drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Leg {
    /// The gear before.
    pub from: usize,
    /// The gear after.
    pub to: usize,
    /// Throttle during the shift, 0 to 1.
    pub throttle: f64,
}

/// The shifts of a drive through all forward gears. A gear to which no shift between two clutches leads from the one below is passed
/// over; so is the lowest gear, if more gears are reached from the next one.
pub fn legs(car: &Car, tables: &ShiftTables<f64>) -> Vec<Leg> {
    let is_single = |from: usize, to: usize| tables.tables().shift(from, to).is_some();
    let gears = car.gearbox.forward_gears();
    let from_gear = |first: usize| -> Vec<[usize; 2]> {
        let mut gear = gears[first];
        let mut up = Vec::new();
        for &next in &gears[first + 1..] {
            if is_single(gear, next) && is_single(next, gear) {
                up.push([gear, next]);
                gear = next;
            }
        }
        up
    };
    let longer = |one: Vec<[usize; 2]>, other: Vec<[usize; 2]>| if other.len() > one.len() { other } else { one };
    let up = (0..gears.len()).map(from_gear).fold(Vec::new(), longer);
    let leg = |throttle: f64| move |&[from, to]: &[usize; 2]| Leg { from, to, throttle };
    let down: Vec<[usize; 2]> = up.iter().rev().map(|&[from, to]| [to, from]).collect();
    let first = up.iter().map(leg(POWER_ON)).chain(down.iter().map(leg(0.0)));
    first.chain(up.iter().map(leg(0.0))).chain(down.iter().map(leg(POWER_ON))).collect()
}

/// The shifts between neighbouring forward gears of a car that are neither simulated nor estimated.
///
/// # Errors
/// The gearbox has more clutches than the filter has room for.
pub fn not_driven(car: &Car) -> Result<Vec<[usize; 2]>, EvaluateError> {
    let tables = ShiftTables::of_car(car, &ErrorBudget::of_car(car)).map_err(EvaluateError::TooManyElements)?;
    Ok(neighbouring_shifts(car, &tables).1)
}

/// A driver on the way through the legs.
struct TourDriver<'m> {
    model: &'m CarModel,
    run: CarRun<'m>,
    throttle: f64,
}

impl TourDriver<'_> {
    /// Goes on by one control period towards this throttle.
    fn advance(&mut self, throttle: f64, brake: f64, record: &mut impl FnMut(&CarSample)) -> Result<(), EvaluateError> {
        let before_s = self.run.time_s();
        let [engine_rad_s, ..] = self.model.speeds(self.run.state());
        if engine_rad_s <= 0.0 {
            return Err(
                CarError::Request(format!("the engine stalls at {before_s:.2} s: the load is too large\nhint: check engine torque, mass and ratios of the vehicle file")).into()
            );
        }
        let throttle_now = self.throttle.max(idle_throttle(engine_rad_s));
        let driver = Driver { throttle: throttle_now, brake, grade_rad: 0.0 };
        self.run.advance(driver, |_| {}, record)?;
        let maximum = (self.run.time_s() - before_s) / PEDAL_S;
        self.throttle += (throttle - self.throttle).clamp(-maximum, maximum);
        Ok(())
    }

    /// Holds a throttle for a time.
    fn hold(&mut self, throttle: f64, time_s: f64, record: &mut impl FnMut(&CarSample)) -> Result<(), EvaluateError> {
        let until_s = self.run.time_s() + time_s;
        while self.run.time_s() < until_s {
            self.advance(throttle, 0.0, record)?;
        }
        Ok(())
    }

    /// Makes a shift at the speed that the car has.
    fn shift<'n>(
        &mut self,
        leg: &Leg,
        name: impl Fn(usize) -> &'n str,
        record: &mut impl FnMut(&CarSample),
    ) -> Result<(), EvaluateError> {
        self.hold(leg.throttle, SETTLE_S, record)?;
        self.run.request(leg.to)?;
        let until_s = self.run.time_s() + LONGEST_SHIFT_S;
        // The request becomes a shift in the next control period.
        self.advance(leg.throttle, 0.0, record)?;
        while self.run.controller().shift().is_some() {
            if self.run.time_s() > until_s {
                let (from, to) = (name(leg.from), name(leg.to));
                let message = format!(
                    "the shift {from}-{to} does not end within {LONGEST_SHIFT_S} s\nhint: its oncoming clutch fills too slowly or is too weak: check `fill`, `valve` and \
                     `hydraulics.line_pressure_pa` of the vehicle file"
                );
                return Err(CarError::Request(message).into());
            }
            self.advance(leg.throttle, 0.0, record)?;
        }
        self.hold(leg.throttle, AFTER_S, record)
    }

    /// Brings the car to a speed, or near it; false if it does not get there in time.
    fn reach(&mut self, vehicle_m_s: f64, record: &mut impl FnMut(&CarSample)) -> Result<bool, EvaluateError> {
        let until_s = self.run.time_s() + LONGEST_APPROACH_S;
        let full_from_s = self.run.time_s() + PATIENCE * LONGEST_APPROACH_S;
        loop {
            let missing = vehicle_m_s - self.run.state().vehicle_m_s;
            if missing.abs() <= NEAR_M_S {
                return Ok(true);
            }
            if self.run.time_s() > until_s {
                return Ok(false);
            }
            let accelerate = if self.run.time_s() < full_from_s { ACCELERATE } else { FULL };
            let (throttle, brake) = if missing > 0.0 { (accelerate, 0.0) } else { (0.0, SLOW_DOWN) };
            self.advance(throttle, brake, record)?;
        }
    }
}

/// A shift that the car is too slow for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeftOut {
    /// The shift.
    pub leg: Leg,
    /// Speed of the shift, m/s, and the highest that the car reaches in the gear before; `None` where it does not get into that gear.
    pub speeds_m_s: Option<[f64; 2]>,
}

/// Drives the car `model`, whose controller knows the car `known`, through the legs and shows every sample to `record`, one every
/// [`RECORD_S`]. `done` is called after each leg. A shift whose speed the car does not get near, and those that need the gear behind it,
/// are left out; they are what is returned.
///
/// # Errors
/// The gearbox has no shift between two clutches, the car is too slow for all of them, a shift does not end, or the simulation fails.
pub fn drive_tour(
    model: &CarModel,
    known: &Car,
    mut record: impl FnMut(&CarSample),
    mut done: impl FnMut(),
) -> Result<Vec<LeftOut>, EvaluateError> {
    let tables = ShiftTables::of_car(known, &ErrorBudget::of_car(known)).map_err(EvaluateError::TooManyElements)?;
    let legs = legs(known, &tables);
    let Some(first) = legs.first() else {
        let message = "the gearbox has no shift from one clutch to another\nhint: `wetclutch check` lists its shifts";
        return Err(CarError::Request(known.why_not_driven().unwrap_or_else(|| message.to_owned())).into());
    };
    let speed_m_s = |leg: &Leg| CarShift::usual(known, leg.from, leg.to, leg.throttle).vehicle_m_s;
    let start_m_s = if known.converter.is_some() { 0.0 } else { START * speed_m_s(first) };
    let start = Driver { throttle: POWER_ON, brake: 0.0, grade_rad: 0.0 };
    let state = model.in_gear(first.from, Some(first.to), start_m_s, start.throttle)?;
    let run = CarRun::new(model, known, CarCalibration::STANDARD, first.from, state, (start, RECORD_S))?;
    let mut driver = TourDriver { model, run, throttle: start.throttle };
    let name = |gear: usize| known.gearbox.gears[gear].name.as_str();
    let (mut gear, mut left_out) = (first.from, Vec::<LeftOut>::new());
    for &leg in &legs {
        let tried = left_out.iter().find(|before| [before.leg.from, before.leg.to] == [leg.from, leg.to]);
        let speeds_m_s = match tried {
            Some(before) => before.speeds_m_s,
            None if leg.from != gear => None,
            None => {
                driver.run.preselect(Some(leg.to));
                let wanted_m_s = speed_m_s(&leg);
                let reached = driver.reach(wanted_m_s, &mut record)?;
                let now_m_s = driver.run.state().vehicle_m_s;
                if reached || now_m_s >= SLOWEST * wanted_m_s {
                    driver.shift(&leg, name, &mut record)?;
                    gear = leg.to;
                    done();
                    continue;
                }
                Some([wanted_m_s, now_m_s])
            }
        };
        left_out.push(LeftOut { leg, speeds_m_s });
    }
    if left_out.len() == legs.len() {
        let [wanted, reached] = left_out[0].speeds_m_s.unwrap_or_default().map(|m_s| 3.6 * m_s);
        return Err(CarError::Request(format!(
            "the car reaches {reached:.0} km/h in gear {}, and its first shift needs {wanted:.0} km/h\nhint: check mass, ratios, wheel radius, resistance and engine torque; `demo --drive` and `bench --vehicle` need no such speed",
            name(first.from)
        ))
        .into());
    }
    Ok(left_out)
}
