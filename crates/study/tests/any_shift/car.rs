//! A car with the two clutches of one shift, apart from the program's own plant: reduced shift, converter, elastic shafts,
//! valves, toothed wheels. Contacts are solved at the level of speeds: an impulse of a clutch is at most its capacity
//! times the step.

use drivetrain::{Clutch, Converter, Driveline, Engine, ReducedShift, RoadLoad, ValveMaps};

/// Step, s.
const STEP_S: f64 = 1e-4;
/// Steps of a control and sampling period.
pub const STEPS: usize = 100;
/// Control and sampling period, s.
pub const PERIOD_S: f64 = 0.01;

/// What the car is made of.
#[derive(Clone, Copy)]
pub struct Car {
    pub engine: Engine<f64>,
    pub converter: Converter<f64>,
    pub shift: ReducedShift<f64>,
    pub clutches: [Clutch<f64>; 2],
    pub valves: [ValveMaps<f64>; 2],
    pub driveline: Driveline<f64>,
    pub road: RoadLoad<f64>,
}

/// Its state.
#[derive(Clone, Copy, Debug)]
pub struct State {
    pub engine: f64,
    pub turbine: f64,
    pub output: f64,
    pub wheel: f64,
    pub twist: f64,
    pub pressure: [f64; 2],
    /// Torques of the clutches, of the last step.
    pub torque: [f64; 2],
    pub turbine_n_m: f64,
    pub throttle: f64,
    pub engine_n_m: f64,
}

impl Car {
    pub fn slip(&self, s: &State, c: usize) -> f64 {
        let row = [self.shift.slip_offgoing, self.shift.slip_oncoming][c];
        row[0] * s.turbine + row[1] * s.output
    }

    /// In the gear before the shift, engine and converter in balance.
    pub fn in_gear(&self, turbine: f64, throttle: f64, pressure: [f64; 2]) -> State {
        let ratio = self.shift.ratio_offgoing();
        let mut engine = turbine.max(90.0);
        for _ in 0..20_000 {
            let pump = self.converter.torques(engine, turbine).pump_n_m;
            engine += 1e-3 * self.engine.acceleration(engine, self.engine.torque(engine, throttle), pump);
        }
        let output = turbine / ratio;
        let turbine_n_m = self.converter.torques(engine, turbine).turbine_n_m;
        let shaft = turbine_n_m * ratio * self.driveline.final_ratio;
        let twist = shaft / self.driveline.shaft_stiffness_n_m_rad;
        let wheel = output / self.driveline.final_ratio;
        State {
            engine,
            turbine,
            output,
            wheel,
            twist,
            pressure,
            torque: [0.0; 2],
            turbine_n_m,
            throttle,
            engine_n_m: 0.0,
        }
    }

    /// One step under these currents at the valves.
    pub fn step(&self, s: &mut State, currents: [f64; 2]) {
        let h = STEP_S;
        for c in 0..2 {
            let settled = self.valves[c].settled_pressure(currents[c]);
            s.pressure[c] += h * self.valves[c].pressure_rate(s.pressure[c], settled);
        }
        let torques = self.converter.torques(s.engine, s.turbine);
        s.turbine_n_m = torques.turbine_n_m;
        s.engine_n_m = self.engine.torque(s.engine, s.throttle) - self.engine.drag_n_m_s * s.engine;
        s.engine += h * (s.engine_n_m - torques.pump_n_m) / self.engine.inertia_kg_m2;
        let line = &self.driveline;
        let shaft = line.shaft_torque(s.twist, line.twist_rate(s.output, s.wheel));
        let force = [torques.turbine_n_m, -shaft / line.final_ratio];
        let [[a, b], [_, d]] = self.shift.mass_kg_m2;
        let per = 1.0 / (a * d - b * b);
        let solve = |f: [f64; 2]| [per * (d * f[0] - b * f[1]), per * (a * f[1] - b * f[0])];
        let k = [self.shift.slip_offgoing, self.shift.slip_oncoming];
        let by = k.map(solve);
        let dot = |x: [f64; 2], y: [f64; 2]| x[0] * y[0] + x[1] * y[1];
        let free = solve(force);
        let speeds = [s.turbine + h * free[0], s.output + h * free[1]];
        let caps = [0, 1].map(|c| h * self.clutches[c].torque_capacity(s.pressure[c], self.slip(s, c)));
        let mut impulse = s.torque.map(|torque| torque * h);
        for _ in 0..40 {
            for c in 0..2 {
                let slip = dot(k[c], speeds) - impulse[0] * dot(k[c], by[0]) - impulse[1] * dot(k[c], by[1]);
                impulse[c] = (impulse[c] + slip / dot(k[c], by[c])).clamp(-caps[c], caps[c]);
            }
        }
        s.turbine = speeds[0] - impulse[0] * by[0][0] - impulse[1] * by[1][0];
        s.output = speeds[1] - impulse[0] * by[0][1] - impulse[1] * by[1][1];
        s.torque = impulse.map(|impulse| impulse / h);
        s.twist += h * line.twist_rate(s.output, s.wheel);
        let wheels = self.road.inertia_at_wheel() + line.wheel_inertia_kg_m2;
        s.wheel += h * (shaft - self.road.wheel_torque(s.wheel)) / wheels;
    }
}

/// A toothed wheel whose speed is read from whole teeth.
pub struct Teeth {
    pitch_rad: f64,
    periods: usize,
    noise_rad_s: f64,
    angle_rad: f64,
    /// Times of the last teeth, s.
    passed_s: Vec<f64>,
}

impl Teeth {
    pub fn new(teeth: f64, periods: usize, noise_rad_s: f64) -> Self {
        let pitch_rad = std::f64::consts::TAU / teeth;
        Self { pitch_rad, periods, noise_rad_s, angle_rad: 0.3 * pitch_rad, passed_s: Vec::new() }
    }

    pub fn turn(&mut self, time_s: f64, speed_rad_s: f64) {
        self.angle_rad += speed_rad_s * STEP_S;
        while self.angle_rad >= self.pitch_rad {
            self.angle_rad -= self.pitch_rad;
            self.passed_s.push(time_s - self.angle_rad / speed_rad_s);
        }
    }

    pub fn read(&self, random: &mut Random) -> Option<f64> {
        let last = self.passed_s.len().checked_sub(1)?;
        let first = last.checked_sub(self.periods)?;
        let span = self.passed_s[last] - self.passed_s[first];
        Some(self.periods as f64 * self.pitch_rad / span + self.noise_rad_s * random.normal())
    }
}

/// Random numbers (SplitMix64).
pub struct Random(pub u64);

impl Random {
    /// From 0 to 1.
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Within a share of one.
    pub fn factor(&mut self, share: f64) -> f64 {
        1.0 + share * (2.0 * self.uniform() - 1.0)
    }

    /// Normal, by the sum of twelve uniform numbers.
    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}
