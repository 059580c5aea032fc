//! The torque balances of car and engine along stretches of driving.

use drivetrain::Real;
use drivetrain::road::GRAVITY_M_S2;
use nalgebra::{DMatrix, DVector};

use super::car::{CAPACITIES, DrivenCar};
use super::stretch::{Driving, FINE_S, HalfStep, STEP_S, Stretch, means};
use super::whitening::{Passing, Step, Whitening};
use super::{DELAY_STEP, DRAG_SD_N_M, DRAG_UNIT_N_M, INPUT_SD_FRACTION, Places, Term};
use crate::parameters::DELAY_UNIT_S;
use crate::weights::{ChannelWeights, HUBER};

/// Standard deviation of the grade, rad, and the way over which it changes, m \[chosen: roads of hilly land; after twice that way 0.4 of a
/// grade is left\].
const GRADE_RAD: f64 = 0.03;
const GRADE_M: f64 = 100.0;
/// Minimum noise of a mean speed, rad/s: a reading has a quantum.
const READING_MIN_RAD_S: f64 = 0.01;
/// Time over which the error of a torque lasts, s \[chosen, as in the filter\].
const TORQUE_S: f64 = 3.0;
/// Error of the reported engine torque beside its scale, N m and as a fraction \[chosen\].
const REPORTED_N_M: f64 = 3.0;
const REPORTED_FRACTION: f64 = 0.04;

/// Factors on the time over which the error of a torque changes: from the errors themselves.
const LASTING: [f64; 6] = [1.0, 3.0, 10.0, 30.0, 100.0, 300.0];

/// How the errors of a balance are weighed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct DrivingWeights {
    pub(crate) channel: ChannelWeights,
    /// How much longer than usual the error of a torque lasts.
    lasting: f64,
}

impl DrivingWeights {
    pub(crate) const START: Self = Self { channel: ChannelWeights::usual(0.0, 1.0), lasting: LASTING[0] };
}

/// A torque balance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Balance {
    /// Of the car, seen at the gearbox output.
    Car,
    /// Of the engine in front of a converter.
    Engine,
}

impl Balance {
    pub(crate) const ALL: [Self; 2] = [Self::Car, Self::Engine];
}

/// Driving with what does not change during a fit.
pub(crate) struct DrivingModel<'a> {
    driving: &'a Driving,
    car: &'a DrivenCar,
    /// The balances that are used.
    uses: [bool; 2],
    /// Standard deviation of the mean speed of a step, rad/s.
    reading_rad_s: [f64; 2],
    /// Of the mean torques at the gearbox input and at the engine, N m.
    noise_n_m: [f64; 2],
}

/// Driving about unknowns.
#[derive(Clone)]
pub(crate) struct Evaluated {
    /// Half the gradient by the unknowns, with the sign of a step.
    pub(crate) score: DVector<f64>,
    pub(crate) information: DMatrix<f64>,
    pub(crate) cost: f64,
    /// Independent errors of each balance, in the standard deviations that they are expected to have.
    pub(crate) errors: [Vec<f64>; 2],
    /// The gradients of each gear and balance.
    pub(crate) groups: Vec<((Balance, usize), DVector<f64>)>,
}

/// A stretch about unknowns, before its errors are made independent.
struct Lines {
    reading: Vec<f64>,
    /// Predicted rate of the speed by halves of the steps, rad/s^2.
    rate: Vec<f64>,
    /// Its derivatives.
    by_parameter: Vec<(usize, Vec<f64>)>,
    /// Of grade and torque, rad/s^2.
    sd_rad_s2: [Vec<f64>; 2],
    /// Of noise of the torques in a step, rad/s^2.
    white_rad_s2: f64,
}

impl Lines {
    /// Errors of the speed since the begin of the stretch and their derivatives by the unknowns at these places: a column for each step.
    fn integrated(&self, places: &[usize]) -> DMatrix<f64> {
        let mut rows = DMatrix::zeros(1 + places.len(), self.reading.len());
        let mut integrate = |row: usize, sign: f64, rates: &[f64]| {
            let mut sum = 0.0;
            for step in 1..self.reading.len() {
                sum += sign * 0.5 * STEP_S * (rates[2 * step - 1] + rates[2 * step]);
                rows[(row, step)] = sum;
            }
        };
        integrate(0, -1.0, &self.rate);
        for (place, rates) in &self.by_parameter {
            if let Ok(at) = places.binary_search(place) {
                integrate(1 + at, 1.0, rates);
            }
        }
        for (step, reading) in self.reading.iter().enumerate() {
            rows[(0, step)] += reading - self.reading[0];
        }
        rows
    }
}

/// The unknowns, by term.
struct At<'a> {
    place: Places<'a>,
    at: &'a [f64],
}

impl At<'_> {
    fn of(&self, term: Term) -> f64 {
        (self.place)(term).map_or(0.0, |place| self.at[place])
    }

    fn factor(&self, term: Term) -> f64 {
        Real::exp(self.of(term))
    }

    /// Columns of the terms that the fit has.
    fn columns(&self, all: impl IntoIterator<Item = (Term, Vec<f64>)>) -> Vec<(usize, Vec<f64>)> {
        all.into_iter().filter_map(|(term, column)| Some(((self.place)(term)?, column))).collect()
    }
}

impl<'a> DrivingModel<'a> {
    pub(crate) fn new(car: &'a DrivenCar, driving: &'a Driving, uses: [bool; 2]) -> Self {
        let noise = |of: &dyn Fn(&Stretch) -> Vec<f64>| noise(&driving.stretches, of);
        let of_steps = |of: fn(&HalfStep) -> f64| noise(&|stretch| means(&stretch.fine, of));
        let reading_rad_s = [of_steps(|half| half.output_rad_s), of_steps(|half| half.engine_rad_s)];
        let reported_n_m = noise(&|stretch| means(&stretch.reported_n_m(&stretch.fine, FINE_S, 0.0), |torque| *torque));
        let at_input_n_m = if car.converter.is_some() { of_steps(|half| half.turbine_n_m) } else { reported_n_m };
        // Over a step noise averages out.
        let longer = (FINE_S / STEP_S).sqrt();
        let noise_n_m = [longer * at_input_n_m, longer * Real::hypot(reported_n_m, of_steps(|half| half.pump_n_m))];
        let reading_rad_s = reading_rad_s.map(|noise| (longer * noise).max(READING_MIN_RAD_S));
        Self { driving, car, uses, reading_rad_s, noise_n_m }
    }

    /// The balances at unknowns.
    pub(crate) fn evaluated(&self, place: Places<'_>, at: &[f64], weights: [DrivingWeights; 2]) -> Evaluated {
        let mut all = Evaluated {
            score: DVector::zeros(at.len()),
            information: DMatrix::zeros(at.len(), at.len()),
            cost: 0.0,
            errors: [Vec::new(), Vec::new()],
            groups: Vec::new(),
        };
        for balance in Balance::ALL.into_iter().filter(|balance| self.uses[*balance as usize]) {
            let lines = self.lines(balance, &At { place, at });
            let mut places: Vec<usize> =
                lines.iter().flat_map(|(_, lines)| lines.by_parameter.iter().map(|(place, _)| *place)).collect();
            places.sort_unstable();
            places.dedup();
            let weights = weights[balance as usize];
            self.each_whitened(balance, &lines, weights.lasting, &places, |gear, rows| {
                all.add((balance, gear), &places, rows, weights.channel);
            });
        }
        all
    }

    /// Weights that the errors ask for.
    pub(crate) fn following(&self, place: Places<'_>, at: &[f64]) -> [DrivingWeights; 2] {
        Balance::ALL.map(|balance| {
            if !self.uses[balance as usize] {
                return DrivingWeights::START;
            }
            let lines = self.lines(balance, &At { place, at });
            let found = LASTING.map(|lasting| {
                let mut errors = Vec::new();
                let take = |_: usize, rows: &DMatrix<f64>| errors.extend(rows.row(0).iter().copied());
                let log_variance = self.each_whitened(balance, &lines, lasting, &[], take);
                (unlikely(&errors, log_variance), lasting, errors)
            });
            let best = found.iter().min_by(|one, other| one.0.total_cmp(&other.0));
            best.map_or(DrivingWeights::START, |(_, lasting, errors)| DrivingWeights {
                lasting: *lasting,
                // Smaller errors than expected say nothing of the next road.
                channel: ChannelWeights::of_independent(errors, scale_of(errors).max(1.0)),
            })
        })
    }

    /// The stretches that a balance uses, about unknowns.
    fn lines(&self, balance: Balance, at: &At<'_>) -> Vec<(&Stretch, Lines)> {
        let stretches = self.driving.stretches.iter();
        let used = stretches.filter(|stretch| match balance {
            Balance::Car => true,
            Balance::Engine => stretch.has_reported(),
        });
        used.map(|stretch| match balance {
            Balance::Car => (stretch, self.of_car(stretch, at)),
            Balance::Engine => (stretch, self.of_engine(stretch, at)),
        })
        .collect()
    }

    /// Hands gear and independent errors of each stretch, with their derivatives by the unknowns at these places, to `take`; the sum of the
    /// logarithms of the variances that the errors had.
    fn each_whitened(
        &self,
        balance: Balance,
        lines: &[(&Stretch, Lines)],
        lasting: f64,
        places: &[usize],
        mut take: impl FnMut(usize, &DMatrix<f64>),
    ) -> f64 {
        let which = balance as usize;
        let mut whitening = Whitening::new(1 + places.len(), self.reading_rad_s[which]);
        let mut before: Option<HalfStep> = None;
        for (stretch, lines) in lines {
            let halves = &stretch.halves;
            let gap_s = before.zip(halves.first()).map(|(last, first)| first.time_s - last.time_s);
            whitening.begin(gap_s.filter(|gap_s| *gap_s > 0.0).map_or(Passing::ALL, |gap_s| {
                self.passing(before.map_or(0.0, |last| last.output_rad_s), gap_s, lasting)
            }));
            before = halves.last().copied();
            let mut rows = lines.integrated(places);
            for (step, mut row) in rows.column_iter_mut().enumerate() {
                if step > 0 {
                    whitening.step(Step {
                        step_s: STEP_S,
                        sd_rad_s2: [0, 1].map(|which: usize| lines.sd_rad_s2[which][2 * step]),
                        white_rad_s2: lines.white_rad_s2,
                        passing: self.passing(halves[2 * step].output_rad_s, STEP_S, lasting),
                    });
                }
                whitening.take(row.as_mut_slice());
            }
            take(stretch.gear, &rows);
        }
        whitening.log_variance()
    }

    /// What passes of grade and error of a torque in a time at an output speed.
    fn passing(&self, output_rad_s: f64, time_s: f64, lasting: f64) -> Passing {
        let way_m = output_rad_s.abs() / self.car.driveline.final_ratio * self.car.road.wheel_radius_m * time_s;
        let Passing { grade: maximum, .. } = Passing::ALL;
        Passing { grade: (way_m / GRADE_M).min(maximum), torque: (time_s / (lasting * TORQUE_S)).min(maximum) }
    }

    /// The balance of the car.
    fn of_car(&self, stretch: &Stretch, at: &At<'_>) -> Lines {
        let (car, line) = (self.car, &self.car.driveline);
        let gear = &car.gears[stretch.gear];
        let ratio = gear.ratio;
        let [body, wheels] = [car.road.inertia_at_wheel(), line.wheel_inertia_kg_m2]
            .map(|inertia| inertia / (line.final_ratio * line.final_ratio));
        let more = |(term, part): &(Term, f64)| part * (at.factor(*term) - 1.0);
        let of_parts = gear.parts.iter().map(more).sum::<f64>();
        let mass = at.factor(Term::Mass) * body;
        let inertia = mass + wheels + gear.inertia_kg_m2 + of_parts;
        let [scale, above] = [Term::Input, Term::TorqueRatio].map(|term| at.factor(term));
        let [rolling, air] = [Term::Rolling, Term::Air].map(|term| at.factor(term));
        let by_step = |of: &dyn Fn(usize) -> f64| (0..stretch.halves.len()).map(of).collect::<Vec<f64>>();
        let steps = &stretch.halves;
        let (torque, later) = self.input_n_m(stretch, at.of(Term::InputDelay));
        let changes: [f64; CAPACITIES] = std::array::from_fn(|number| at.of(Term::Capacity(number)));
        let shape = |k: usize| changes.iter().zip(steps[k].by_capacity_n_m).map(|(x, by)| x * by).sum::<f64>();
        let input = by_step(&|k| scale * (torque[k] + (above - 1.0) * steps[k].above_one_n_m + shape(k)));
        let drag = |k: usize| {
            let more = car
                .elements
                .iter()
                .map(|(at_car, place)| at.of(Term::Drag(*place)) * DRAG_UNIT_N_M * steps[k].drag_of_one_n_m[*at_car]);
            steps[k].drag_n_m + more.sum::<f64>()
        };
        let roll = rolling * car.road.rolling_moment_n_m / line.final_ratio;
        let wind = by_step(&|k| {
            let rim_m_s = car.road.wheel_radius_m * steps[k].output_rad_s / line.final_ratio;
            air * car.road.drag_force(rim_m_s) * car.road.wheel_radius_m / line.final_ratio
        });
        let rate = by_step(&|k| (ratio * (input[k] + drag(k)) - roll - wind[k]) / inertia);
        let mut by_parameter = at.columns([
            (Term::Input, by_step(&|k| ratio * input[k] / inertia)),
            (Term::TorqueRatio, by_step(&|k| ratio * scale * above * steps[k].above_one_n_m / inertia)),
            (Term::InputDelay, by_step(&|k| ratio * scale * (later[k] - torque[k]) / (DELAY_STEP * inertia))),
            (Term::Mass, by_step(&|k| -rate[k] * mass / inertia)),
            (Term::Rolling, by_step(&|_| -roll / inertia)),
            (Term::Air, by_step(&|k| -wind[k] / inertia)),
        ]);
        let of_drag = car.elements.iter().map(|(at_car, place)| {
            let by_drag = by_step(&|k| ratio * DRAG_UNIT_N_M * steps[k].drag_of_one_n_m[*at_car] / inertia);
            (Term::Drag(*place), by_drag)
        });
        let of_parts = gear.parts.iter().map(|(term, part)| {
            let now = part + more(&(*term, *part));
            (*term, by_step(&|k| -rate[k] * now / inertia))
        });
        let of_shape = (0..CAPACITIES).map(|number| {
            (Term::Capacity(number), by_step(&|k| ratio * scale * steps[k].by_capacity_n_m[number] / inertia))
        });
        by_parameter.extend(at.columns(of_drag.chain(of_parts).chain(of_shape)));
        let weight = GRAVITY_M_S2 * line.final_ratio / car.road.wheel_radius_m * body / inertia;
        Lines {
            reading: self.body_speed(stretch, ratio, &torque, [body, wheels].map(|part| part / inertia)),
            sd_rad_s2: [
                by_step(&|_| GRADE_RAD * weight),
                by_step(&|k| ratio * Real::hypot(DRAG_SD_N_M, INPUT_SD_FRACTION * input[k]) / inertia),
            ],
            white_rad_s2: ratio * self.noise_n_m[0] / inertia,
            rate,
            by_parameter,
        }
    }

    /// Torque at the input by the file with this unknown of its delay, and with a step more, N m.
    fn input_n_m(&self, stretch: &Stretch, late: f64) -> (Vec<f64>, Vec<f64>) {
        if self.car.converter.is_some() {
            let torque: Vec<f64> = stretch.halves.iter().map(|half| half.turbine_n_m).collect();
            return (torque.clone(), torque);
        }
        let reported = |late: f64| stretch.reported_n_m(&stretch.halves, STEP_S, DELAY_UNIT_S * late);
        (reported(late), reported(late + DELAY_STEP))
    }

    /// Output speed that all inertias would have together: the wheels lag behind the output by the twist of the shafts, and the car
    /// behind the wheels by the slip of the tyres; both are quasi-static and of the file.
    fn body_speed(&self, stretch: &Stretch, ratio: f64, torque: &[f64], [body, wheels]: [f64; 2]) -> Vec<f64> {
        let (car, line) = (self.car, &self.car.driveline);
        let at_wheel = means(torque, |torque| line.final_ratio * ratio * torque);
        let output = means(&stretch.halves, |half| half.output_rad_s);
        let last = at_wheel.len() - 1;
        let corrected = |k: usize| {
            let (before, after) = (k.saturating_sub(1), (k + 1).min(last));
            let apart_s = STEP_S * (after - before).max(1) as f64;
            let twist_rate = (at_wheel[after] - at_wheel[before]) / (apart_s * line.shaft_stiffness_n_m_rad);
            let force_n = at_wheel[k] / car.road.wheel_radius_m;
            let slip = 0.5 * car.tyre.slip_scale * force_n / car.tyre.max_force_n;
            let by_twist = line.final_ratio * twist_rate;
            output[k] * (1.0 - body * slip) - (body + wheels) * by_twist
        };
        (0..output.len()).map(corrected).collect()
    }

    /// The balance of the engine.
    fn of_engine(&self, stretch: &Stretch, at: &At<'_>) -> Lines {
        let steps = &stretch.halves;
        let by_step = |of: &dyn Fn(usize) -> f64| (0..steps.len()).map(of).collect::<Vec<f64>>();
        let inertia = self.car.engine_inertia_kg_m2 * at.factor(Term::EngineInertia);
        let [scale, capacity] = [Term::ReportedScale, Term::Input].map(|term| at.factor(term));
        let late = at.of(Term::ReportedDelay);
        let [torque, later] =
            [late, late + DELAY_STEP].map(|late| stretch.reported_n_m(&stretch.halves, STEP_S, DELAY_UNIT_S * late));
        let pump = by_step(&|k| capacity * steps[k].pump_n_m);
        let rate = by_step(&|k| (scale * torque[k] - pump[k]) / inertia);
        let error_n_m = |k: usize| {
            Real::hypot(Real::hypot(REPORTED_N_M, REPORTED_FRACTION * torque[k]), INPUT_SD_FRACTION * pump[k]) / inertia
        };
        Lines {
            reading: means(&stretch.halves, |half| half.engine_rad_s),
            white_rad_s2: self.noise_n_m[1] / inertia,
            sd_rad_s2: [by_step(&|_| 0.0), by_step(&error_n_m)],
            by_parameter: at.columns([
                (Term::Input, by_step(&|k| -pump[k] / inertia)),
                (Term::ReportedScale, by_step(&|k| scale * torque[k] / inertia)),
                (Term::ReportedDelay, by_step(&|k| scale * (later[k] - torque[k]) / (DELAY_STEP * inertia))),
                (Term::EngineInertia, by_step(&|k| -rate[k])),
            ]),
            rate,
        }
    }
}

/// Noise of means over fine steps: robust standard deviation of their third differences, which a smooth course does not have.
fn noise(stretches: &[Stretch], means: &dyn Fn(&Stretch) -> Vec<f64>) -> f64 {
    let differences = stretches.iter().flat_map(|stretch| {
        let means = means(stretch);
        means.windows(4).map(|v| v[3] - v[0] - 3.0 * (v[2] - v[1])).collect::<Vec<_>>()
    });
    // The squares of 1, 3, 3, 1 are 20 together.
    scale_of(&differences.collect::<Vec<_>>()) / 20.0_f64.sqrt()
}

impl Evaluated {
    /// Adds a stretch: errors and their derivatives by the unknowns at these places, in columns.
    fn add(&mut self, group: (Balance, usize), places: &[usize], rows: &DMatrix<f64>, weights: ChannelWeights) {
        let by_parameter = rows.rows(1, places.len()) / weights.scale;
        let in_scales: DVector<f64> = rows.row(0).transpose() / weights.scale;
        let mut weighed = by_parameter.clone();
        for (step, error) in in_scales.iter().enumerate() {
            weighed.column_mut(step).scale_mut(weights.weight(*error));
        }
        let (some, information) = (&weighed * &in_scales, &weighed * by_parameter.transpose());
        let mut score = DVector::zeros(self.score.len());
        for (i, place) in places.iter().enumerate() {
            score[*place] = some[i];
            for (j, other) in places.iter().enumerate() {
                self.information[(*place, *other)] += information[(i, j)];
            }
        }
        self.cost += weights.cost(in_scales.as_slice());
        self.errors[group.0 as usize].extend(rows.row(0).iter());
        self.score += &score;
        match self.groups.iter_mut().find(|(other, _)| *other == group) {
            Some((_, sum)) => *sum += score,
            None => self.groups.push((group, score)),
        }
    }

    /// Scale of the errors of each balance: 1 where they are as large as expected.
    pub(crate) fn scales(&self) -> [f64; 2] {
        self.errors.each_ref().map(|errors| scale_of(errors))
    }
}

/// Twice the negative logarithm of the likelihood of errors, of which single large ones count little, but for a constant.
fn unlikely(errors: &[f64], log_variance: f64) -> f64 {
    let (count, scale) = (errors.len() as f64, scale_of(errors).max(f64::MIN_POSITIVE));
    let squares = errors.iter().map(|error| Real::powi((error / scale).abs().min(3.0 * HUBER), 2)).sum::<f64>();
    log_variance + count * Real::ln(scale * scale * squares / count)
}

/// Robust standard deviation.
fn scale_of(errors: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = errors.iter().map(|error| error.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    1.4826 * sizes.get(sizes.len() / 2).copied().unwrap_or(0.0)
}
