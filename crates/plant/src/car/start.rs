//! A car that runs in a gear, as a shift or a drive begins.

use geartrain::Holding;

use super::integrate::CarError;
use super::model::{CarModel, CarState, MAX_PACKS};

/// Engine speeds among which the steady one is sought, rad/s.
const SPEEDS_RAD_S: (f64, f64) = (20.0, 700.0);
/// Idle speed of the engine, rad/s \[chosen\].
pub(super) const IDLE_RAD_S: f64 = 85.0;
/// Throttle of the idle control per speed below idle, s/rad, and the most that the idle control gives.
const IDLE_GAIN: f64 = 0.02;
const IDLE_MAX: f64 = 0.3;

/// Throttle that the idle control gives at least, 0 to 1.
pub fn idle_throttle(engine_rad_s: f64) -> f64 {
    (IDLE_GAIN * (IDLE_RAD_S - engine_rad_s)).clamp(0.0, IDLE_MAX)
}

/// Steps of the search from above.
const SEARCH: u32 = 340;

impl CarModel {
    /// At this vehicle speed in a gear, with the engine at its steady speed under this throttle. In a box with dogs the shafts
    /// turn as they do where both gears of the shift are in. Without a converter the clutch of the gear is open where the
    /// engine would turn slower than idle.
    ///
    /// # Errors
    /// There is no such gear, or the engine would turn too fast.
    pub fn in_gear(
        &self,
        gear: usize,
        next: Option<usize>,
        vehicle_m_s: f64,
        throttle: f64,
    ) -> Result<CarState, CarError> {
        let car = &self.car;
        let wrong = |message: String| Err(CarError::Request(message));
        let (Some(of_gear), Some(train)) = (car.gearbox.gears.get(gear), car.gearbox.train.as_ref()) else {
            return wrong(format!("the gearbox has no gear number {gear}\nhint: gears count from 0"));
        };
        if !vehicle_m_s.is_finite() || !throttle.is_finite() {
            return wrong(format!(
                "a car cannot start at {vehicle_m_s} m/s with throttle {throttle}\nhint: both must be finite numbers"
            ));
        }
        let wheel_rad_s = vehicle_m_s / car.road.wheel_radius_m;
        let output = wheel_rad_s * car.driveline.final_ratio;
        let turbine = of_gear.ratio * output;
        if turbine.abs() > SPEEDS_RAD_S.1 {
            return wrong(format!(
                "in gear {} at {vehicle_m_s} m/s the gearbox input would turn at {turbine:.0} rad/s, expected at most {} rad/s\nhint: start slower, or in a higher gear",
                of_gear.name, SPEEDS_RAD_S.1
            ));
        }
        let idles = car.converter.is_none() && turbine.abs() < IDLE_RAD_S;
        let singles = |to: &usize| matches!(car.gearbox.shift(gear, *to), Some(shift) if shift.reduced.is_some());
        let next = next.or_else(|| (0..car.gearbox.gears.len()).find(singles).filter(|_| idles));
        let held = next.and_then(|next| car.gearbox.shift(gear, next)).and_then(|shift| match &shift.change {
            geartrain::Change::Single { held, .. } => train.speeds_in_shift(held),
            _ => None,
        });
        let input = if idles { IDLE_RAD_S } else { turbine };
        let shafts: Vec<f64> = match held {
            Some(speeds) => speeds.row_iter().map(|row| row[0] * input + row[1] * output).collect(),
            None if idles => {
                let why = car.why_not_driven();
                return wrong(why.unwrap_or_else(|| {
                    format!(
                        "gear {} has no clutch that could slip\nhint: without a converter a car starts on a clutch that a shift by one clutch \
                         releases; `wetclutch check` of the gearbox file lists the shifts",
                        of_gear.name
                    )
                }));
            }
            None => of_gear.shaft_speeds.iter().map(|speed| speed.unwrap_or(0.0) * turbine).collect(),
        };
        let engine_rad_s = self.steady_engine(input, throttle);
        let Some(motion) = self.motion_of(&shafts, engine_rad_s) else {
            return Err(crate::TrainError::NoDiagram.into());
        };
        let turbine_n_m = match &car.converter {
            Some(converter) => converter.torques(engine_rad_s, turbine).turbine_n_m,
            None if idles => 0.0,
            None => car.engine.torque(turbine, throttle) - car.engine.drag_n_m_s * turbine,
        };
        // A standing car has been held by its brake.
        let shaft_n_m = turbine_n_m * of_gear.ratio * car.driveline.final_ratio;
        let [valves_pa, volumes_m3] = self.cylinders(if idles { &[] } else { &of_gear.holding });
        let twist_rad = shaft_n_m / car.driveline.shaft_stiffness_n_m_rad + 0.5 * car.backlash_rad * shaft_n_m.signum();
        Ok(CarState { twist_rad, wheel_rad_s, vehicle_m_s, motion, valves_pa, volumes_m3 })
    }

    /// Pressures, Pa, and volumes, m^3, of the cylinders where these elements are held with the line pressure.
    fn cylinders(&self, held: &[Holding]) -> [[f64; MAX_PACKS]; 2] {
        let [mut valves_pa, mut volumes_m3] = [[0.0; MAX_PACKS]; 2];
        for (slot, _) in held.iter().filter_map(|holding| self.friction(holding.element)) {
            valves_pa[slot] = self.car.line_pressure_pa;
        }
        for (slot, clutch) in (0..self.lock_up()).filter_map(|element| self.friction(element)) {
            volumes_m3[slot] = clutch.cylinder.volume(valves_pa[slot]);
        }
        [valves_pa, volumes_m3]
    }

    /// The highest speed at which engine and pump are in balance, rad/s, at least idle speed; without a converter that of the gearbox input.
    fn steady_engine(&self, turbine_rad_s: f64, throttle: f64) -> f64 {
        let (car, (lowest, highest)) = (&self.car, SPEEDS_RAD_S);
        let Some(converter) = &car.converter else { return turbine_rad_s };
        let surplus = |speed: f64| {
            car.engine.torque(speed, throttle)
                - car.engine.drag_n_m_s * speed
                - converter.torques(speed, turbine_rad_s).pump_n_m
        };
        let step = (highest - lowest) / f64::from(SEARCH);
        let speed = |n: u32| highest - step * f64::from(n);
        let steady = match (1..=SEARCH).find(|&n| surplus(speed(n)) > 0.0) {
            // Between the two the surplus is linear enough for a start.
            Some(n) => {
                let (above, below) = (surplus(speed(n - 1)), surplus(speed(n)));
                speed(n) + step * below / (below - above)
            }
            None => IDLE_RAD_S,
        };
        steady.max(IDLE_RAD_S)
    }
}
