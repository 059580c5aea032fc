//! The powertrain in one segment of a shift, with the measured engine speed as its input.
//!
//! States: turbine and output speed, twist of the shafts, speed of the car, and the engine speed where its torque is known.
//! The wheel speed is not a state: the tyre makes it a fast one. Its slip follows from the force of the tyre, and the inertia
//! of the wheels takes the acceleration that the slip has without it. Fourth-order Runge-Kutta; within a segment nothing sticks or lets go, so the result is a smooth function of every parameter.

use drivetrain::{AccelerationRow, Real};

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

/// What makes a motion in a segment.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Run<'a> {
    pub(crate) car: &'a Car,
    pub(crate) of: Circumstances,
    pub(crate) inputs: &'a Inputs,
    pub(crate) start: State,
}

/// Motions that are computed side by side. Every operation of a step waits for the one before it: a processor computes four motions in little
/// more time than one.
const LANES: usize = 4;

/// A number of each of some motions.
type Lanes<const N: usize> = [f64; N];

/// A number of each motion.
#[inline]
fn each<const N: usize>(number: impl FnMut(usize) -> f64) -> Lanes<N> {
    std::array::from_fn(number)
}

/// States of some motions.
#[derive(Clone, Copy)]
struct States<const N: usize> {
    turbine_rad_s: Lanes<N>,
    output_rad_s: Lanes<N>,
    twist_rad: Lanes<N>,
    vehicle_m_s: Lanes<N>,
    engine_rad_s: Lanes<N>,
}

impl<const N: usize> States<N> {
    fn of(states: [State; N]) -> Self {
        Self {
            turbine_rad_s: states.map(|state| state.turbine_rad_s),
            output_rad_s: states.map(|state| state.output_rad_s),
            twist_rad: states.map(|state| state.twist_rad),
            vehicle_m_s: states.map(|state| state.vehicle_m_s),
            engine_rad_s: states.map(|state| state.engine_rad_s),
        }
    }

    #[inline]
    fn plus(&self, rates: &Self, dt_s: f64) -> Self {
        let after = |value: &Lanes<N>, rate: &Lanes<N>| each(|i| value[i] + dt_s * rate[i]);
        Self {
            turbine_rad_s: after(&self.turbine_rad_s, &rates.turbine_rad_s),
            output_rad_s: after(&self.output_rad_s, &rates.output_rad_s),
            twist_rad: after(&self.twist_rad, &rates.twist_rad),
            vehicle_m_s: after(&self.vehicle_m_s, &rates.vehicle_m_s),
            engine_rad_s: after(&self.engine_rad_s, &rates.engine_rad_s),
        }
    }
}

/// Speeds at the steps of a segment, each with its rate.
#[derive(Debug, Clone, Default, PartialEq)]
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
    /// Runs a segment.
    pub(crate) fn run(kind: SegmentKind, part: Part, run: &Run<'_>) -> Self {
        let [motion] = Self::side_by_side(kind, part, [run]);
        motion
    }

    /// Runs a segment many times.
    pub(crate) fn run_all(kind: SegmentKind, part: Part, runs: &[Run<'_>]) -> Vec<Self> {
        let mut motions = Vec::with_capacity(runs.len());
        for some in runs.chunks(LANES) {
            // Where fewer are left, the last one fills the rest.
            let lanes: [&Run<'_>; LANES] = std::array::from_fn(|i| &some[i.min(some.len() - 1)]);
            motions.extend(Self::side_by_side(kind, part, lanes).into_iter().take(some.len()));
        }
        motions
    }

    fn side_by_side<const N: usize>(kind: SegmentKind, part: Part, runs: [&Run<'_>; N]) -> [Self; N] {
        let mut motions: [Self; N] = std::array::from_fn(|_| Self::resting(part));
        let field = Field::new(kind, runs);
        let mut states = States::of(runs.map(|run| run.start));
        for step in 0..=part.steps {
            let at = part.first + 2 * step;
            let (k1, wheel) = field.rates(&states, at);
            for (i, motion) in motions.iter_mut().enumerate() {
                motion.turbine[step] = (states.turbine_rad_s[i], k1.turbine_rad_s[i]);
                motion.output[step] = (states.output_rad_s[i], k1.output_rad_s[i]);
                motion.engine[step] = (states.engine_rad_s[i], k1.engine_rad_s[i]);
                motion.wheel[step] = wheel[i];
            }
            if step < part.steps {
                let (k2, _) = field.rates(&states.plus(&k1, 0.5 * STEP_S), at + 1);
                let (k3, _) = field.rates(&states.plus(&k2, 0.5 * STEP_S), at + 1);
                let (k4, _) = field.rates(&states.plus(&k3, STEP_S), at + 2);
                states = states
                    .plus(&k1, STEP_S / 6.0)
                    .plus(&k2, STEP_S / 3.0)
                    .plus(&k3, STEP_S / 3.0)
                    .plus(&k4, STEP_S / 6.0);
            }
        }
        motions
    }

    /// All speeds zero.
    fn resting(part: Part) -> Self {
        let points = part.steps + 1;
        let zero = vec![(0.0, 0.0); points];
        Self {
            begin_s: part.begin_s,
            turbine: zero.clone(),
            output: zero.clone(),
            engine: zero,
            wheel: vec![0.0; points],
        }
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
        let (i, fraction) = self.place(self.wheel.len(), time_s);
        self.wheel[i] + fraction * (self.wheel[i + 1] - self.wheel[i])
    }

    /// The step that a time lies in, and how far in it, in steps.
    fn place(&self, points: usize, time_s: f64) -> (usize, f64) {
        let steps = (time_s - self.begin_s) / STEP_S;
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

/// The rates of the states of some motions in a segment. What does not change within it is divided once.
struct Field<'a, const N: usize> {
    kind: SegmentKind,
    runs: [&'a Run<'a>; N],
    turbine: Row<N>,
    output: Row<N>,
    per_final_ratio: Lanes<N>,
    stiffness_n_m_rad: Lanes<N>,
    damping_n_m_s_rad: Lanes<N>,
    wheel_inertia_kg_m2: Lanes<N>,
    per_radius: Lanes<N>,
    rolling_n_m: Lanes<N>,
    drag_kg_m: Lanes<N>,
    load_n: Lanes<N>,
    mass_kg: Lanes<N>,
    /// One over the mass with the wheels.
    per_moved_kg: Lanes<N>,
    per_max_force_n: Lanes<N>,
    /// Half the slip of the tyres' scale.
    half_slip: Lanes<N>,
    /// Difference of the wheels' speed to that of the car per torque and speed of the car, for small slips.
    slip_per_n_m: Lanes<N>,
}

/// Acceleration per torque of each motion.
struct Row<const N: usize> {
    per_turbine_torque: Lanes<N>,
    per_offgoing_torque: Lanes<N>,
    per_oncoming_torque: Lanes<N>,
    per_output_torque: Lanes<N>,
}

impl<const N: usize> Row<N> {
    fn of(rows: [&AccelerationRow<f64>; N]) -> Self {
        Self {
            per_turbine_torque: rows.map(|row| row.per_turbine_torque),
            per_offgoing_torque: rows.map(|row| row.per_offgoing_torque),
            per_oncoming_torque: rows.map(|row| row.per_oncoming_torque),
            per_output_torque: rows.map(|row| row.per_output_torque),
        }
    }

    #[inline]
    fn at(&self, turbine: &Lanes<N>, offgoing: &Lanes<N>, oncoming: &Lanes<N>, output: &Lanes<N>) -> Lanes<N> {
        each(|i| {
            self.per_turbine_torque[i] * turbine[i]
                + self.per_offgoing_torque[i] * offgoing[i]
                + self.per_oncoming_torque[i] * oncoming[i]
                + self.per_output_torque[i] * output[i]
        })
    }
}

impl<'a, const N: usize> Field<'a, N> {
    fn new(kind: SegmentKind, runs: [&'a Run<'a>; N]) -> Self {
        let of = |number: &dyn Fn(&Run<'_>) -> f64| runs.map(number);
        let mass_kg = |run: &Run<'_>| run.car.road.mass_kg * (1.0 + run.of.mass_share);
        let moved_kg = |run: &Run<'_>| {
            mass_kg(run) + run.car.driveline.wheel_inertia_kg_m2 / Real::powi(run.car.road.wheel_radius_m, 2)
        };
        let slip_per_n_m = |run: &Run<'_>| {
            0.5 * run.car.tyre.slip_scale / (Real::powi(run.car.road.wheel_radius_m, 2) * run.car.tyre.max_force_n)
        };
        Self {
            kind,
            turbine: Row::of(runs.map(|run| &run.car.coefficients(kind).turbine)),
            output: Row::of(runs.map(|run| &run.car.coefficients(kind).output)),
            per_final_ratio: of(&|run| run.car.driveline.final_ratio.recip()),
            stiffness_n_m_rad: of(&|run| run.car.driveline.shaft_stiffness_n_m_rad),
            damping_n_m_s_rad: of(&|run| run.car.driveline.shaft_damping_n_m_s_rad),
            wheel_inertia_kg_m2: of(&|run| run.car.driveline.wheel_inertia_kg_m2),
            per_radius: of(&|run| run.car.road.wheel_radius_m.recip()),
            rolling_n_m: of(&|run| run.car.road.rolling_moment_n_m),
            drag_kg_m: of(&|run| run.car.road.drag_factor()),
            load_n: of(&|run| run.of.load_n + run.car.road.grade_force() * (1.0 + run.of.mass_share)),
            mass_kg: of(&mass_kg),
            per_moved_kg: of(&|run| moved_kg(run).recip()),
            per_max_force_n: of(&|run| run.car.tyre.max_force_n.recip()),
            half_slip: of(&|run| 0.5 * run.car.tyre.slip_scale),
            slip_per_n_m: of(&slip_per_n_m),
            runs,
        }
    }

    /// Rates, and the speed of the wheels.
    #[inline]
    fn rates(&self, states: &States<N>, at: usize) -> (States<N>, Lanes<N>) {
        let Wheels { shaft_n_m, wheel_rad_s, vehicle_m_s2 } = self.wheels(states);
        let (mut turbine_n_m, mut engine_rad_s2) = ([0.0; N], [0.0; N]);
        for i in 0..N {
            (turbine_n_m[i], engine_rad_s2[i]) = self.converter(i, states.turbine_rad_s[i], at);
        }
        let speeds = |i: usize| (states.turbine_rad_s[i], states.output_rad_s[i]);
        let (offgoing_n_m, oncoming_n_m) = match self.kind {
            SegmentKind::Locked => ([0.0; N], [0.0; N]),
            SegmentKind::Held => ([0.0; N], each(|i| self.oncoming(i, speeds(i), at))),
            SegmentKind::Slipping => {
                (each(|i| self.offgoing(i, speeds(i), at)), each(|i| self.oncoming(i, speeds(i), at)))
            }
        };
        let output_n_m: Lanes<N> = each(|i| shaft_n_m[i] * self.per_final_ratio[i]);
        let rates = States {
            turbine_rad_s: self.turbine.at(&turbine_n_m, &offgoing_n_m, &oncoming_n_m, &output_n_m),
            output_rad_s: self.output.at(&turbine_n_m, &offgoing_n_m, &oncoming_n_m, &output_n_m),
            twist_rad: each(|i| states.output_rad_s[i] * self.per_final_ratio[i] - wheel_rad_s[i]),
            vehicle_m_s: vehicle_m_s2,
            engine_rad_s: engine_rad_s2,
        };
        (rates, wheel_rad_s)
    }

    /// Turbine torque of a motion, and the acceleration of its engine, zero where its torque is not known.
    #[inline]
    fn converter(&self, i: usize, turbine_rad_s: f64, at: usize) -> (f64, f64) {
        let Run { car, of, inputs, .. } = self.runs[i];
        let engine_rad_s = inputs.engine_rad_s[at];
        let torques = car.converter.torques(engine_rad_s, turbine_rad_s);
        let engine_rad_s2 = inputs.engine_n_m.get(at).map_or(0.0, |engine_n_m| {
            let torque_n_m = engine_n_m / car.engine_torque_scale * (1.0 + of.engine_torque_share);
            (torque_n_m - car.engine_drag_n_m_s * engine_rad_s - torques.pump_n_m) / car.engine_inertia_kg_m2
        });
        (torques.turbine_n_m, engine_rad_s2)
    }

    /// Torque of the oncoming clutch of a motion at its turbine and output speed.
    ///
    /// A slip that would turn around keeps its direction and has the friction at rest: in a segment in which the clutch slips, a torque that
    /// changed its sign would have no derivative.
    #[inline]
    fn oncoming(&self, i: usize, (turbine_rad_s, output_rad_s): (f64, f64), at: usize) -> f64 {
        let Run { car, of, inputs, .. } = self.runs[i];
        let direction = of.directions[0];
        let slip = direction * car.shift.oncoming_slip(turbine_rad_s, output_rad_s);
        direction * car.clutch.torque_capacity(inputs.oncoming_pa[at], slip.at_least(0.0))
    }

    #[inline]
    fn offgoing(&self, i: usize, (turbine_rad_s, output_rad_s): (f64, f64), at: usize) -> f64 {
        let Run { car, of, inputs, .. } = self.runs[i];
        let Some(pressure_pa) = inputs.offgoing_pa.get(at) else { return 0.0 };
        let direction = of.directions[1];
        let slip = direction * car.shift.offgoing_slip(turbine_rad_s, output_rad_s);
        direction * car.offgoing.torque_capacity(*pressure_pa, slip.at_least(0.0))
    }

    /// Rolling moment of each car at the speeds of its wheels.
    #[inline]
    fn rolling(&self, wheel_rad_s: &Lanes<N>) -> Lanes<N> {
        /// Where it does not depend on the speed any more, for sure.
        const MOVING_RAD_S: f64 = 20.0;
        if wheel_rad_s.iter().all(|speed| *speed > MOVING_RAD_S) {
            return self.rolling_n_m;
        }
        each(|i| self.runs[i].car.road.rolling_moment(wheel_rad_s[i]))
    }

    /// Shafts, wheels and car at a state.
    ///
    /// The damping of the shafts needs the speed of the wheels, and the slip of the tyres the torque of the shafts. Each pass leaves about
    /// a fiftieth of the error. The torque's rate is that of the spring.
    #[inline]
    fn wheels(&self, states: &States<N>) -> Wheels<N> {
        let vehicle_m_s = &states.vehicle_m_s;
        let free_rad_s: Lanes<N> = each(|i| vehicle_m_s[i] * self.per_radius[i]);
        let rolling_n_m = self.rolling(&free_rad_s);
        let against_n: Lanes<N> = each(|i| self.drag_kg_m[i] * vehicle_m_s[i] * vehicle_m_s[i].abs() + self.load_n[i]);
        let spring_n_m: Lanes<N> = each(|i| self.stiffness_n_m_rad[i] * states.twist_rad[i]);
        let per_n_m: Lanes<N> = each(|i| self.slip_per_n_m[i] * vehicle_m_s[i]);
        let mut wheel_rad_s: Lanes<N> = each(|i| free_rad_s[i] + per_n_m[i] * (spring_n_m[i] - rolling_n_m[i]));
        let (mut shaft_n_m, mut vehicle_m_s2) = (spring_n_m, [0.0; N]);
        for _ in 0..2 {
            let rate_rad_s: Lanes<N> = each(|i| states.output_rad_s[i] * self.per_final_ratio[i] - wheel_rad_s[i]);
            shaft_n_m = each(|i| spring_n_m[i] + self.damping_n_m_s_rad[i] * rate_rad_s[i]);
            vehicle_m_s2 = each(|i| {
                let slip_rad_s2 = per_n_m[i] * self.stiffness_n_m_rad[i] * rate_rad_s[i];
                let free_n_m = shaft_n_m[i] - rolling_n_m[i] - self.wheel_inertia_kg_m2[i] * slip_rad_s2;
                (free_n_m * self.per_radius[i] - against_n[i]) * self.per_moved_kg[i]
            });
            let used: Lanes<N> = each(|i| (self.mass_kg[i] * vehicle_m_s2[i] + against_n[i]) * self.per_max_force_n[i]);
            let reached: Lanes<N> = inverse_tanh(used);
            wheel_rad_s = each(|i| {
                let slip = self.half_slip[i] * reached[i];
                free_rad_s[i] * (1.0 + slip.at_most(0.0)) / (1.0 - slip.at_least(0.0))
            });
        }
        Wheels { shaft_n_m, wheel_rad_s, vehicle_m_s2 }
    }
}

/// What follows from a state beyond the gearbox.
struct Wheels<const N: usize> {
    shaft_n_m: Lanes<N>,
    wheel_rad_s: Lanes<N>,
    vehicle_m_s2: Lanes<N>,
}

/// `atanh`, by a fraction where that is exact to 1e-6: much of the time of a fit would be spent here. At the tyre's limit it
/// ends at a finite slip.
#[inline]
fn inverse_tanh<const N: usize>(x: Lanes<N>) -> Lanes<N> {
    /// Square of the argument up to which it is used.
    const FRACTION_TO: f64 = 0.4;
    let squares: Lanes<N> = each(|i| x[i] * x[i]);
    // The seventh fraction of Lambert's continued fraction x/(1 - x^2/(3 - 4 x^2/(5 - 9 x^2/(7 - ...)))).
    let mut result: Lanes<N> = each(|i| {
        let xx = squares[i];
        let above = 1.0 - xx * (50.0 / 39.0 - xx * (283.0 / 715.0 - xx * (256.0 / 15015.0)));
        let below = 1.0 - xx * (21.0 / 13.0 - xx * (105.0 / 143.0 - xx * (35.0 / 429.0)));
        x[i] * above / below
    });
    if !squares.iter().all(|xx| *xx <= FRACTION_TO) {
        for i in (0..N).filter(|i| squares[*i] > FRACTION_TO) {
            result[i] = at_tyre_limit(x[i]);
        }
    }
    result
}

/// Not a part of the loops over the motions, which the compiler can then do for all of them at once.
#[cold]
#[inline(never)]
fn at_tyre_limit(x: f64) -> f64 {
    Real::atanh(x.clamp(-0.999, 0.999))
}

#[cfg(test)]
mod tests {
    use config::VehicleFile;

    use super::*;
    use crate::ReadingAges;

    /// A car in a segment in which both clutches slip, with the pressure of the oncoming one and the speed of the car.
    fn slipping(car: &Car, oncoming_pa: f64, output_rad_s: f64) -> (Inputs, Circumstances, State) {
        let points = 2 * PART.steps + 1;
        let inputs = Inputs {
            engine_rad_s: vec![200.0; points],
            oncoming_pa: vec![oncoming_pa; points],
            offgoing_pa: Vec::new(),
            engine_n_m: Vec::new(),
        };
        let start = State {
            turbine_rad_s: car.shift.ratio_oncoming() * output_rad_s + 20.0,
            output_rad_s,
            vehicle_m_s: output_rad_s / car.driveline.final_ratio * car.road.wheel_radius_m,
            ..State::default()
        };
        (inputs, Circumstances { directions: [1.0, -1.0], ..Circumstances::default() }, start)
    }

    const PART: Part = Part { begin_s: 0.0, first: 0, steps: 10 };

    /// A torque that changes its sign with the slip would hold the slip near zero, step by step to and fro: such a motion is a rough function of
    /// the parameters, and a fit gets stuck in it.
    #[test]
    fn a_torque_keeps_its_sign_where_the_slip_would_turn_around() {
        let car = Car::of_file(&VehicleFile::built_in().unwrap(), ReadingAges::default());
        let (inputs, of, start) = slipping(&car, 0.7e6, 60.0);
        let motion = Motion::run(SegmentKind::Slipping, PART, &Run { car: &car, of, inputs: &inputs, start });
        let slips: Vec<f64> = (motion.turbine.iter().zip(&motion.output))
            .map(|(turbine, output)| car.shift.oncoming_slip(turbine.0, output.0))
            .collect();
        assert!(slips[0] > 0.0 && *slips.last().unwrap() < 0.0, "{slips:?}");
        assert!(slips.windows(2).all(|pair| pair[1] < pair[0]), "{slips:?}");
    }

    /// Other cars, pressures, loads, speeds and tyre forces: none may act on the motion beside it, not even in the last digit, which would be a
    /// part of a derivative. One stands nearly, and one pulls at the limit of its tyres.
    #[test]
    fn motions_side_by_side_are_those_of_each_alone() {
        let file = Car::of_file(&VehicleFile::built_in().unwrap(), ReadingAges::default());
        let mut weak_tyres = file.clone();
        weak_tyres.tyre.max_force_n *= 0.05;
        let cars = [&file, &file, &weak_tyres, &file, &file, &weak_tyres];
        let [outputs, twists] = [[60.0, 70.0, 60.0, 1.0, 65.0, 66.0], [0.01, 0.02, 0.05, 0.0, 0.04, 0.06]];
        let all: Vec<(Inputs, Circumstances, State)> = (0..cars.len())
            .map(|i| {
                let (inputs, of, start) = slipping(cars[i], 0.1e6 * (i + 1) as f64, outputs[i]);
                (inputs, Circumstances { load_n: 100.0 * i as f64, ..of }, State { twist_rad: twists[i], ..start })
            })
            .collect();
        for kind in [SegmentKind::Held, SegmentKind::Slipping, SegmentKind::Locked] {
            let runs: Vec<Run<'_>> = (all.iter().zip(cars))
                .map(|((inputs, of, start), car)| Run { car, of: *of, inputs, start: *start })
                .collect();
            let motions = Motion::run_all(kind, PART, &runs);
            assert_eq!(motions.len(), runs.len());
            for (motion, run) in motions.iter().zip(&runs) {
                assert_eq!(*motion, Motion::run(kind, PART, run));
            }
            assert!(motions.windows(2).all(|pair| pair[0].turbine != pair[1].turbine));
        }
    }

    /// Over the whole range, with the end of the fraction and the limit of the tyre.
    #[test]
    fn the_inverse_of_the_tangent_is_exact_to_a_millionth() {
        for i in -998..=998 {
            let x = 1e-3 * f64::from(i);
            let [found, other] = inverse_tanh([x, 0.5]);
            assert!((found - Real::atanh(x)).abs() <= 1e-6 * Real::atanh(x.abs()), "{x}: {found}");
            assert_eq!([other], inverse_tanh([0.5]), "beside {x}");
        }
        assert_eq!(inverse_tanh([2.0, -2.0]), [Real::atanh(0.999), Real::atanh(-0.999)]);
    }
}
