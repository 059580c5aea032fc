//! The signals of a drive that its page is made of.

use logs::{Reading, Role};

use crate::Series;

/// Readings that are closer together are left out, s: the page shows no more.
const CLOSEST_S: f64 = 0.008;
/// Readings of a signal that are kept: five hours at 100 Hz in 30 MB.
const MAXIMUM: usize = 1_800_000;
/// Time between two moments, s.
const STEP_S: f64 = 0.02;
/// A moment needs readings this close around it, s.
const APART_S: f64 = 0.3;
/// Half the time over which a line gives the rate of a speed, s.
const RATE_HALF_S: f64 = 0.1;
/// The converter does not slip where both speeds are this close, rad/s, ...
const NO_SLIP_RAD_S: f64 = 2.0;
/// ... for so long, s.
const NO_SLIP_S: f64 = 0.3;
/// Below this engine speed nothing is said, rad/s.
const ENGINE_MIN_RAD_S: f64 = 60.0;

/// The signals of a drive. A drive that is longer than about five hours keeps its beginning.
#[derive(Debug, Clone, Default)]
pub struct DriveRecord {
    /// Engine speed, rad/s.
    pub engine: Series,
    /// Turbine speed, rad/s.
    pub turbine: Series,
    /// Gearbox output speed, rad/s.
    pub output: Series,
    /// Speed of the car, m/s.
    pub vehicle: Series,
    /// Engine torque at the flywheel, N m.
    pub engine_torque: Series,
    /// Friction torque of the engine, N m.
    pub friction_torque: Series,
    /// Engine torque that the gearbox asks for, friction included, N m.
    pub torque_request: Series,
    /// Engaged gear.
    pub gear: Series,
    /// Commanded gear.
    pub target_gear: Series,
    /// Whether the output speed follows from the speed of the car.
    pub output_is_of_car: bool,
    /// Whether a signal was longer than what is kept.
    pub is_cut: bool,
}

/// Engine and turbine at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    /// Time, s.
    pub time_s: f64,
    /// Engine speed, rad/s.
    pub engine_rad_s: f64,
    /// Turbine speed, rad/s.
    pub turbine_rad_s: f64,
    /// Rate of the engine speed, rad/s^2.
    pub engine_rad_s2: f64,
    /// Rate of the turbine speed, rad/s^2.
    pub turbine_rad_s2: f64,
    /// The converter does not slip: its lock-up clutch is closed, or it carries nothing.
    pub no_slip: bool,
}

impl Moment {
    /// Turbine over engine speed.
    pub fn speed_ratio(&self) -> f64 {
        self.turbine_rad_s / self.engine_rad_s
    }
}

impl DriveRecord {
    /// Takes a reading.
    pub fn push(&mut self, reading: &Reading) {
        let Reading { role, time_s, value, .. } = *reading;
        let series = match role {
            Role::EngineSpeed => &mut self.engine,
            Role::TurbineSpeed => &mut self.turbine,
            Role::OutputSpeed => &mut self.output,
            Role::VehicleSpeed => &mut self.vehicle,
            Role::EngineTorque => &mut self.engine_torque,
            Role::EngineFrictionTorque => &mut self.friction_torque,
            Role::TorqueReductionRequest => &mut self.torque_request,
            Role::Gear => &mut self.gear,
            Role::TargetGear => &mut self.target_gear,
            _ => return,
        };
        if series.len() == MAXIMUM {
            self.is_cut = true;
        } else if series.time_s.last().is_none_or(|last_s| time_s - last_s >= CLOSEST_S) {
            series.push(time_s, value);
        }
    }

    /// Without an output speed, that which follows from the speed of the car.
    pub fn complete(&mut self, output_rad_per_m: Option<f64>) {
        if let (true, Some(rad_per_m)) = (self.output.is_empty(), output_rad_per_m) {
            self.output_is_of_car = true;
            self.output = self.vehicle.clone();
            self.output.value.iter_mut().for_each(|value| *value *= rad_per_m);
        }
    }

    /// Engine and turbine every 20 ms, where both are known. Only times around readings are looked at: a clock may jump by years.
    pub fn moments(&self) -> Vec<Moment> {
        let (Some(first_s), Some(last_s)) = (self.engine.time_s.first(), self.engine.time_s.last()) else {
            return Vec::new();
        };
        let step = |time_s: f64| ((time_s - first_s) / STEP_S) as u64;
        let (mut moments, mut next) = (Vec::new(), 0);
        for span in self.engine.time_s.chunk_by(|before_s, after_s| after_s - before_s <= APART_S) {
            let from = step(span[0] - 0.5 * APART_S).max(next);
            next = step(span[span.len() - 1] + 0.5 * APART_S).saturating_add(1).min(step(*last_s));
            let times = (from..next).map(|i| first_s + i as f64 * STEP_S);
            moments.extend(times.filter_map(|time_s| self.moment(time_s)));
        }
        mark_no_slip(&mut moments);
        moments
    }

    fn moment(&self, time_s: f64) -> Option<Moment> {
        let around = [time_s - 0.5 * APART_S, time_s + 0.5 * APART_S];
        let known = |series: &Series| series.between(around).next().is_some();
        let moment = Moment {
            time_s,
            engine_rad_s: self.engine.at(time_s),
            turbine_rad_s: self.turbine.at(time_s),
            engine_rad_s2: rate(&self.engine, time_s)?,
            turbine_rad_s2: rate(&self.turbine, time_s)?,
            no_slip: false,
        };
        (known(&self.engine) && known(&self.turbine) && moment.engine_rad_s > ENGINE_MIN_RAD_S).then_some(moment)
    }
}

/// Slope of the line with the least squares of distances around a time.
fn rate(series: &Series, time_s: f64) -> Option<f64> {
    let points = || series.between([time_s - RATE_HALF_S, time_s + RATE_HALF_S]).map(|(t, value)| (t - time_s, value));
    let (count, t, y) = points().fold((0.0, 0.0, 0.0), |(n, t, y), (dt, value)| (n + 1.0, t + dt, y + value));
    let (t, y) = (t / count, y / count);
    let (tt, ty) = points().fold((0.0, 0.0), |(tt, ty), (dt, v)| (tt + (dt - t) * (dt - t), ty + (dt - t) * (v - y)));
    (count >= 3.0 && tt > 0.0).then(|| ty / tt)
}

/// Marks the spans in which both speeds are together for long.
fn mark_no_slip(moments: &mut [Moment]) {
    let is_close = |moment: &Moment| (moment.engine_rad_s - moment.turbine_rad_s).abs() < NO_SLIP_RAD_S;
    for span in moments.chunk_by_mut(|a, b| is_close(a) == is_close(b) && b.time_s - a.time_s < APART_S) {
        let length_s = span.last().map_or(0.0, |last| last.time_s) - span.first().map_or(0.0, |first| first.time_s);
        if is_close(&span[0]) && length_s >= NO_SLIP_S {
            span.iter_mut().for_each(|moment| moment.no_slip = true);
        }
    }
}
