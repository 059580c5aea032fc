//! The powertrain in one segment of a shift, with the measured engine speed as its input.
//!
//! States: turbine and output speed, twist of the shafts, speed of the car, and the engine speed where its torque is known.
//! The wheel speed is not a state: the tyre makes it a fast one. Its slip follows from the force of the tyre, and the inertia
//! of the wheels takes the acceleration that the slip has without it. Fourth-order Runge-Kutta; within a segment nothing sticks or lets go, so the result is a smooth function of every parameter.

use drivetrain::ShiftTorques;

use crate::car::Car;
use crate::record::SegmentKind;

/// Time step, s: a quarter of the time in which the fastest oscillation of the shafts turns by one radian.
pub(crate) const STEP_S: f64 = 0.004;

/// Inputs at every half step.
#[derive(Debug, Clone, Default)]
pub(crate) struct Inputs {
    pub(crate) engine_rad_s: Vec<f64>,
    pub(crate) oncoming_pa: Vec<f64>,
    pub(crate) offgoing_pa: Vec<f64>,
    /// Empty without a signal.
    pub(crate) engine_n_m: Vec<f64>,
}

/// What differs from shift to shift and not within it.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Circumstances {
    /// Mass over that of the car, less 1.
    pub(crate) mass_share: f64,
    /// Force against the motion, N: grade, wind, rolling resistance.
    pub(crate) load_n: f64,
    /// Engine torque over its signal, less 1.
    pub(crate) engine_torque_share: f64,
    /// Signs of the slips of the oncoming and the offgoing clutch, which they keep while the clutch slips.
    pub(crate) directions: [f64; 2],
}

/// State of the powertrain.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct State {
    pub(crate) turbine_rad_s: f64,
    pub(crate) output_rad_s: f64,
    pub(crate) twist_rad: f64,
    pub(crate) vehicle_m_s: f64,
    pub(crate) engine_rad_s: f64,
}

impl State {
    fn plus(self, rate: &Self, dt_s: f64) -> Self {
        Self {
            turbine_rad_s: self.turbine_rad_s + dt_s * rate.turbine_rad_s,
            output_rad_s: self.output_rad_s + dt_s * rate.output_rad_s,
            twist_rad: self.twist_rad + dt_s * rate.twist_rad,
            vehicle_m_s: self.vehicle_m_s + dt_s * rate.vehicle_m_s,
            engine_rad_s: self.engine_rad_s + dt_s * rate.engine_rad_s,
        }
    }
}

/// Speeds at the steps of a segment, each with its rate.
#[derive(Debug, Clone, Default)]
pub(crate) struct Motion {
    begin_s: f64,
    turbine: Vec<(f64, f64)>,
    output: Vec<(f64, f64)>,
    engine: Vec<(f64, f64)>,
    wheel: Vec<f64>,
}

/// A part of the inputs' grid: the time of its first step, and the number of steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Part {
    pub(crate) begin_s: f64,
    /// Place of its beginning among the half steps.
    pub(crate) first: usize,
    pub(crate) steps: usize,
}

impl Motion {
    /// Runs a segment from a state.
    pub(crate) fn run(
        car: &Car,
        kind: SegmentKind,
        of: &Circumstances,
        inputs: &Inputs,
        part: Part,
        start: State,
    ) -> Self {
        let mut motion = Self { begin_s: part.begin_s, ..Self::default() };
        for series in [&mut motion.turbine, &mut motion.output, &mut motion.engine] {
            series.reserve(part.steps + 1);
        }
        motion.wheel.reserve(part.steps + 1);
        let field = Field::new(car, kind, of, inputs);
        let mut state = start;
        for step in 0..=part.steps {
            let at = part.first + 2 * step;
            let (k1, wheel) = field.rates(&state, at);
            motion.turbine.push((state.turbine_rad_s, k1.turbine_rad_s));
            motion.output.push((state.output_rad_s, k1.output_rad_s));
            motion.engine.push((state.engine_rad_s, k1.engine_rad_s));
            motion.wheel.push(wheel);
            if step < part.steps {
                let (k2, _) = field.rates(&state.plus(&k1, 0.5 * STEP_S), at + 1);
                let (k3, _) = field.rates(&state.plus(&k2, 0.5 * STEP_S), at + 1);
                let (k4, _) = field.rates(&state.plus(&k3, STEP_S), at + 2);
                state = state
                    .plus(&k1, STEP_S / 6.0)
                    .plus(&k2, STEP_S / 3.0)
                    .plus(&k3, STEP_S / 3.0)
                    .plus(&k4, STEP_S / 6.0);
            }
        }
        motion
    }

    pub(crate) fn turbine_at(&self, time_s: f64) -> f64 {
        self.hermite(&self.turbine, time_s)
    }

    pub(crate) fn output_at(&self, time_s: f64) -> f64 {
        self.hermite(&self.output, time_s)
    }

    pub(crate) fn engine_at(&self, time_s: f64) -> f64 {
        self.hermite(&self.engine, time_s)
    }

    /// By a line between the steps, and the first or last of these lines outside.
    pub(crate) fn wheel_at(&self, time_s: f64) -> f64 {
        let (i, share) = self.place(self.wheel.len(), time_s);
        self.wheel[i] + share * (self.wheel[i + 1] - self.wheel[i])
    }

    /// The step that a time lies in, and how far in it, in steps.
    fn place(&self, points: usize, time_s: f64) -> (usize, f64) {
        let steps = (time_s - self.begin_s) / STEP_S;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "limited to the points")]
        let i = (steps.max(0.0) as usize).min(points.saturating_sub(2));
        (i, steps - i as f64)
    }

    /// By the cubic through values and rates of two steps; outside, by the line of the end.
    fn hermite(&self, points: &[(f64, f64)], time_s: f64) -> f64 {
        let (i, u) = self.place(points.len(), time_s);
        let ((x0, d0), (x1, d1)) = (points[i], points[i + 1]);
        if u < 0.0 {
            return x0 + u * STEP_S * d0;
        }
        if u > 1.0 {
            return x1 + (u - 1.0) * STEP_S * d1;
        }
        let (d0, d1) = (STEP_S * d0, STEP_S * d1);
        let v = 1.0 - u;
        x0 * (1.0 + 2.0 * u) * v * v + x1 * u * u * (3.0 - 2.0 * u) + d0 * u * v * v - d1 * u * u * v
    }
}

/// The rates of the states in a segment.
struct Field<'a> {
    car: &'a Car,
    kind: SegmentKind,
    inputs: &'a Inputs,
    mass_kg: f64,
    /// Mass with the wheels.
    moved_kg: f64,
    load_n: f64,
    engine_torque_factor: f64,
    directions: [f64; 2],
}

impl<'a> Field<'a> {
    fn new(car: &'a Car, kind: SegmentKind, of: &Circumstances, inputs: &'a Inputs) -> Self {
        let radius = car.road.wheel_radius_m;
        let mass_kg = car.road.mass_kg * (1.0 + of.mass_share);
        Self {
            car,
            kind,
            inputs,
            mass_kg,
            moved_kg: mass_kg + car.driveline.wheel_inertia_kg_m2 / (radius * radius),
            load_n: of.load_n + car.road.grade_force() * (1.0 + of.mass_share),
            engine_torque_factor: car.engine_torque_scale.recip() * (1.0 + of.engine_torque_share),
            directions: of.directions,
        }
    }

    /// Rates, and the speed of the wheels.
    #[inline]
    fn rates(&self, state: &State, at: usize) -> (State, f64) {
        let car = self.car;
        let engine_rad_s = self.inputs.engine_rad_s[at];
        let converter = car.converter.torques(engine_rad_s, state.turbine_rad_s);
        let Wheels { shaft_n_m, wheel_rad_s, vehicle_m_s2 } = self.wheels(state);
        let (offgoing_n_m, oncoming_n_m) = match self.kind {
            SegmentKind::Locked => (0.0, 0.0),
            SegmentKind::Held => (0.0, self.oncoming(state, at)),
            SegmentKind::Slipping => (self.offgoing(state, at), self.oncoming(state, at)),
        };
        let torques = ShiftTorques {
            turbine_n_m: converter.turbine_n_m,
            offgoing_n_m,
            oncoming_n_m,
            output_n_m: shaft_n_m / car.driveline.final_ratio,
        };
        let rows = car.coefficients(self.kind);
        let engine = self.inputs.engine_n_m.get(at).map_or(0.0, |engine_n_m| {
            let torque_n_m = self.engine_torque_factor * engine_n_m;
            (torque_n_m - car.engine_drag_n_m_s * engine_rad_s - converter.pump_n_m) / car.engine_inertia_kg_m2
        });
        let rates = State {
            turbine_rad_s: rows.turbine.at(&torques),
            output_rad_s: rows.output.at(&torques),
            twist_rad: car.driveline.twist_rate(state.output_rad_s, wheel_rad_s),
            vehicle_m_s: vehicle_m_s2,
            engine_rad_s: engine,
        };
        (rates, wheel_rad_s)
    }

    /// A slip that would turn around keeps its direction and has the friction at rest: in a segment in which the clutch slips, a torque that
    /// changed its sign would have no derivative.
    fn oncoming(&self, state: &State, at: usize) -> f64 {
        let direction = self.directions[0];
        let slip = direction * self.car.shift.oncoming_slip(state.turbine_rad_s, state.output_rad_s);
        direction * self.car.clutch.torque_capacity(self.inputs.oncoming_pa[at], slip.max(0.0))
    }

    fn offgoing(&self, state: &State, at: usize) -> f64 {
        let Some(pressure_pa) = self.inputs.offgoing_pa.get(at) else { return 0.0 };
        let direction = self.directions[1];
        let slip = direction * self.car.shift.offgoing_slip(state.turbine_rad_s, state.output_rad_s);
        direction * self.car.offgoing.torque_capacity(*pressure_pa, slip.max(0.0))
    }

    /// Shafts, wheels and car at a state.
    ///
    /// The damping of the shafts needs the speed of the wheels, and the slip of the tyres the torque of the shafts. Each pass leaves about
    /// a fiftieth of the error. The torque's rate is that of the spring.
    #[inline]
    fn wheels(&self, state: &State) -> Wheels {
        let (driveline, road, tyre) = (&self.car.driveline, &self.car.road, &self.car.tyre);
        let radius = road.wheel_radius_m;
        let rolling_n_m = road.rolling_moment(state.vehicle_m_s / radius);
        let against_n = road.drag_force(state.vehicle_m_s) + self.load_n;
        let spring_n_m = driveline.shaft_stiffness_n_m_rad * state.twist_rad;
        let per_n_m = 0.5 * tyre.slip_scale * state.vehicle_m_s / (radius * radius * tyre.max_force_n);
        let mut wheel_rad_s = state.vehicle_m_s / radius + per_n_m * (spring_n_m - rolling_n_m);
        let (mut shaft_n_m, mut vehicle_m_s2) = (spring_n_m, 0.0);
        for _ in 0..2 {
            let rate_rad_s = driveline.twist_rate(state.output_rad_s, wheel_rad_s);
            shaft_n_m = spring_n_m + driveline.shaft_damping_n_m_s_rad * rate_rad_s;
            let slip_rad_s2 = per_n_m * driveline.shaft_stiffness_n_m_rad * rate_rad_s;
            let free_n_m = shaft_n_m - rolling_n_m - driveline.wheel_inertia_kg_m2 * slip_rad_s2;
            vehicle_m_s2 = (free_n_m / radius - against_n) / self.moved_kg;
            let force_n = self.mass_kg * vehicle_m_s2 + against_n;
            let slip = 0.5 * tyre.slip_scale * inverse_tanh(force_n / tyre.max_force_n);
            let rim_m_s = if slip > 0.0 { state.vehicle_m_s / (1.0 - slip) } else { state.vehicle_m_s * (1.0 + slip) };
            wheel_rad_s = rim_m_s / radius;
        }
        Wheels { shaft_n_m, wheel_rad_s, vehicle_m_s2 }
    }
}

/// What follows from a state beyond the gearbox.
struct Wheels {
    shaft_n_m: f64,
    wheel_rad_s: f64,
    vehicle_m_s2: f64,
}

/// `atanh`, by its series where that is exact to 1e-6: most of the time of a fit would be spent here. At the tyre's limit it
/// ends at a finite slip.
#[inline]
fn inverse_tanh(x: f64) -> f64 {
    let xx = x * x;
    if xx < 0.06 { x * (1.0 + xx * (1.0 / 3.0 + xx * (0.2 + xx / 7.0))) } else { x.clamp(-0.999, 0.999).atanh() }
}

#[cfg(test)]
mod tests {
    use config::Vehicle;

    use super::*;
    use crate::ReadingAges;

    /// A torque that changes its sign with the slip would hold the slip near zero, step by step to and fro: such a motion is a rough function of
    /// the parameters, and a fit gets stuck in it.
    #[test]
    fn a_torque_keeps_its_sign_where_the_slip_would_turn_around() {
        let car = Car::of_file(&Vehicle::built_in().unwrap(), ReadingAges::default());
        let part = Part { begin_s: 0.0, first: 0, steps: 10 };
        let points = 2 * part.steps + 1;
        let inputs = Inputs {
            engine_rad_s: vec![200.0; points],
            oncoming_pa: vec![0.7e6; points],
            offgoing_pa: Vec::new(),
            engine_n_m: Vec::new(),
        };
        let of = Circumstances { directions: [1.0, -1.0], ..Circumstances::default() };
        let output_rad_s = 60.0;
        let start = State {
            turbine_rad_s: car.shift.ratio_oncoming() * output_rad_s + 20.0,
            output_rad_s,
            vehicle_m_s: output_rad_s / car.driveline.final_ratio * car.road.wheel_radius_m,
            ..State::default()
        };
        let motion = Motion::run(&car, SegmentKind::Slipping, &of, &inputs, part, start);
        let slips: Vec<f64> = (motion.turbine.iter().zip(&motion.output))
            .map(|(turbine, output)| car.shift.oncoming_slip(turbine.0, output.0))
            .collect();
        assert!(slips[0] > 0.0 && *slips.last().unwrap() < 0.0, "{slips:?}");
        assert!(slips.windows(2).all(|pair| pair[1] < pair[0]), "{slips:?}");
    }
}
