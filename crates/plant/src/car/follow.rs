//! A driver who follows a speed: with the road load and the wanted acceleration the torque at the wheels is known, from it the
//! throttle or the brake.

use car::SpeedTrace;
use drivetrain::Real;

use super::model::{CarModel, CarState};
use super::run::{BRAKE_OVER_TYRES, Driver};

/// How far ahead the driver sees, s \[chosen\].
const AHEAD_S: f64 = 0.6;
/// Gain of the speed error, 1/s, and of its integral, 1/s^2 \[chosen\].
const PER_S: f64 = 1.0;
const PER_S2: f64 = 0.15;
/// Most that the integral adds, m/s^2.
const INTEGRAL_MAX_M_S2: f64 = 0.6;
/// How fast pedals move, 1/s \[chosen\].
const PEDAL_PER_S: f64 = 3.0;
/// Speed below which a car that is to stand is held, m/s, and the brake that holds it.
const STANDING_M_S: f64 = 0.1;
const HOLDING_BRAKE: f64 = 0.15;
/// Halvings in search of the throttle.
const HALVINGS: u32 = 12;
/// Tolerance of speed and of time by which a drive is judged, as of UN GTR No. 15.
const TOLERANCE_M_S: f64 = 2.0 / 3.6;
const TOLERANCE_S: f64 = 1.0;

/// How well a speed was followed.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SpeedError {
    /// Root mean square of the error, m/s.
    pub rms_m_s: f64,
    /// Largest error, m/s.
    pub largest_m_s: f64,
    /// Fraction of the time in which the speed is further than 2 km/h from all speeds within 1 s before and after.
    pub beyond: f64,
}

/// The driver.
#[derive(Debug, Clone)]
pub(super) struct Follower<'d> {
    trace: &'d SpeedTrace,
    /// Integral of the speed error, m.
    integral_m: f64,
    throttle: f64,
    brake: f64,
    squares: f64,
    largest_m_s: f64,
    beyond: u64,
    periods: u64,
}

impl<'d> Follower<'d> {
    pub(super) fn new(trace: &'d SpeedTrace) -> Self {
        let (squares, largest_m_s) = (0.0, 0.0);
        Self {
            trace,
            integral_m: 0.0,
            throttle: 0.0,
            brake: HOLDING_BRAKE,
            squares,
            largest_m_s,
            beyond: 0,
            periods: 0,
        }
    }

    /// What the driver does in the period that begins at `time_s`, in this gear.
    pub(super) fn step(
        &mut self,
        model: &CarModel,
        state: &CarState,
        gear: usize,
        time_s: f64,
        period_s: f64,
    ) -> Driver {
        let time_s = time_s % self.trace.duration_s();
        let (wanted, ahead) = (self.trace.at_m_s(time_s), self.trace.at_m_s(time_s + AHEAD_S));
        let error = wanted - state.vehicle_m_s;
        self.judge(state, error, time_s);
        let grade_rad = self.trace.grade_rad;
        let stands = wanted.max(ahead) < STANDING_M_S;
        let (throttle, brake) = if stands {
            self.integral_m = 0.0;
            (0.0, if state.vehicle_m_s < 5.0 * STANDING_M_S { HOLDING_BRAKE } else { self.brake })
        } else {
            let maximum = INTEGRAL_MAX_M_S2 / PER_S2;
            self.integral_m = (self.integral_m + error * period_s).clamp(-maximum, maximum);
            let m_s2 = (ahead - wanted) / AHEAD_S + PER_S * error + PER_S2 * self.integral_m;
            pedals(model, state, gear, m_s2, grade_rad)
        };
        let step = PEDAL_PER_S * period_s;
        self.throttle += (throttle - self.throttle).clamp(-step, step);
        self.brake += (brake - self.brake).clamp(-step, step);
        Driver { throttle: self.throttle, brake: self.brake, grade_rad }
    }

    fn judge(&mut self, state: &CarState, error: f64, time_s: f64) {
        let [low, high] = self.trace.range_m_s(time_s, TOLERANCE_S);
        let is_beyond = state.vehicle_m_s < low - TOLERANCE_M_S || state.vehicle_m_s > high + TOLERANCE_M_S;
        self.squares += error * error;
        self.largest_m_s = self.largest_m_s.max(error.abs());
        self.beyond += u64::from(is_beyond);
        self.periods += 1;
    }

    /// How well the speed was followed.
    pub(super) fn error(&self) -> SpeedError {
        let periods = self.periods.max(1) as f64;
        let rms_m_s = (self.squares / periods).sqrt();
        SpeedError { rms_m_s, largest_m_s: self.largest_m_s, beyond: self.beyond as f64 / periods }
    }
}

/// Throttle and brake that give this acceleration, as a driver knows his car.
fn pedals(model: &CarModel, state: &CarState, gear: usize, m_s2: f64, grade_rad: f64) -> (f64, f64) {
    let (car, road) = (&model.car, &model.car.road);
    let [engine_rad_s, turbine_rad_s, _] = model.speeds(state);
    let per_turbine = car.gearbox.gears[gear].ratio * car.driveline.final_ratio;
    let wheels_kg = car.driveline.wheel_inertia_kg_m2 / (road.wheel_radius_m * road.wheel_radius_m);
    let climbing_n = road.mass_kg * drivetrain::road::GRAVITY_M_S2 * Real::sin(grade_rad);
    let force_n = (road.mass_kg + wheels_kg) * m_s2 + road.drag_force(state.vehicle_m_s) + climbing_n;
    let wheel_n_m = force_n * road.wheel_radius_m + road.rolling_moment(state.wheel_rad_s);
    let turbine_n_m = wheel_n_m / per_turbine;
    let net = |throttle: f64| car.engine.torque(engine_rad_s, throttle) - car.engine.drag_n_m_s * engine_rad_s;
    let (idle_n_m, multiplied) = match &car.converter {
        Some(converter) => {
            let torques = converter.torques(engine_rad_s, turbine_rad_s);
            let is_driving = torques.pump_n_m > 1.0;
            (torques.turbine_n_m, if is_driving { torques.turbine_n_m / torques.pump_n_m } else { 1.0 })
        }
        None => (net(0.0), 1.0),
    };
    let engine_n_m = turbine_n_m / multiplied;
    if turbine_n_m > 0.0 && engine_n_m > net(0.0) {
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if net(middle) < engine_n_m { low = middle } else { high = middle }
        }
        return (high, 0.0);
    }
    let too_much_n_m = idle_n_m * per_turbine - wheel_n_m;
    (0.0, (too_much_n_m / (BRAKE_OVER_TYRES * car.tyre.max_force_n * road.wheel_radius_m)).clamp(0.0, 1.0))
}
