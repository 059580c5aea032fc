//! A stretch of driving in one gear, reduced to steps.

use drivetrain::clutch::drag_torque;
use observer::gearbox::MAX_ELEMENTS;

use super::car::{CAPACITIES, DrivenCar, OpenElement};
use super::skew::Pair;
use super::twist::Cell;
use crate::Series;

/// Length of a step, s: over some periods of the oscillation of the drive shafts, which the model leaves out and which acts back on the torque of
/// the converter. Noise of a reported engine torque, which would make it look as if it did less (errors in variables), averages out too.
///
/// Between two steps a mean speed changes by the integral of its rate with weights that rise over the first step and fall over the
/// second one. So a step has two means of each torque, with falling and with rising weights.
pub(crate) const STEP_S: f64 = 0.4;
/// Length of the steps from which the noise of the readings is found, and time between the points of a mean, s.
pub(crate) const FINE_S: f64 = 0.1;
const POINT_S: f64 = 0.01;
/// Fewest steps of a stretch.
const STEPS_MIN: usize = 3;

/// Driving in a gear, between shifts.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Driving {
    /// Stretches in their order.
    pub(crate) stretches: Vec<Stretch>,
    /// Stretches in a gear with a wheel speed.
    pub(crate) twists: Vec<Vec<Cell>>,
    /// Output speed against the turbine speed in a gear, and engine speed with the lock-up clutch closed.
    pub(crate) outputs: Vec<Vec<Pair>>,
    pub(crate) engines: Vec<Vec<Pair>>,
    /// Whether the log was longer than what is kept.
    pub(crate) is_cut: bool,
    /// What messages call the log; of several logs together nothing.
    pub(crate) log: String,
}

impl Driving {
    /// Whether another log has the same driving.
    pub(crate) fn is_same(&self, other: &Self) -> bool {
        let Self { stretches, twists, outputs, engines, is_cut, log: _ } = self;
        (stretches, twists, is_cut) == (&other.stretches, &other.twists, &other.is_cut)
            && (outputs, engines) == (&other.outputs, &other.engines)
    }

    /// What messages call the log, before a reason against it.
    pub(crate) fn shown(&self) -> String {
        if self.log.is_empty() { String::new() } else { format!("{}: ", self.log) }
    }

    /// Adds the driving of another log.
    pub(crate) fn add(&mut self, more: Self) {
        // The same drive says what it has to say once.
        let new = more.stretches.into_iter().filter(|stretch| !self.stretches.contains(stretch)).collect::<Vec<_>>();
        self.stretches.extend(new);
        let new = more.twists.into_iter().filter(|twist| !self.twists.contains(twist)).collect::<Vec<_>>();
        self.twists.extend(new);
        for (all, more) in [(&mut self.outputs, more.outputs), (&mut self.engines, more.engines)] {
            let new = more.into_iter().filter(|pairs| !all.contains(pairs)).collect::<Vec<_>>();
            all.extend(new);
        }
        self.is_cut |= more.is_cut;
    }

    /// Time in gear with a pulling engine, s.
    pub fn time_s(&self) -> f64 {
        STEP_S * self.stretches.iter().map(Stretch::count).sum::<usize>() as f64
    }

    /// The same with a reported engine torque.
    pub fn reported_s(&self) -> f64 {
        let with = self.stretches.iter().filter(|stretch| stretch.has_reported());
        STEP_S * with.map(Stretch::count).sum::<usize>() as f64
    }
}

/// Readings of a stretch, at the times that they belong to.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct StretchReadings {
    pub(crate) engine: Series,
    pub(crate) turbine: Series,
    pub(crate) output: Series,
    pub(crate) reported: Series,
}

/// A stretch in one gear.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Stretch {
    pub(crate) gear: usize,
    /// Two for each step: with falling and with rising weights.
    pub(crate) halves: Vec<HalfStep>,
    /// The same for fine steps.
    pub(crate) fine: Vec<HalfStep>,
    /// Reported engine torque, N m.
    reported: Series,
}

/// Means over a step with weights.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct HalfStep {
    /// Middle of the step, s.
    pub(crate) time_s: f64,
    pub(crate) engine_rad_s: f64,
    pub(crate) output_rad_s: f64,
    /// By the converter of the file, N m: torque at the turbine, the part of it by the torque ratio above 1, and torque of the pump.
    pub(crate) turbine_n_m: f64,
    pub(crate) above_one_n_m: f64,
    pub(crate) pump_n_m: f64,
    /// By how much the torque at the turbine changes with the numbers of the shape of the capacity, N m.
    pub(crate) by_capacity_n_m: [f64; CAPACITIES],
    /// Torque at the turbine by the drag of the open elements: by the file, and by each with a peak of 1 N m.
    pub(crate) drag_n_m: f64,
    pub(crate) drag_of_one_n_m: [f64; MAX_ELEMENTS],
}

impl Stretch {
    /// The stretch of these readings in a gear; none if it is too short.
    pub(crate) fn of(
        car: &DrivenCar,
        gear: usize,
        readings: StretchReadings,
        [begin_s, end_s]: [f64; 2],
    ) -> Option<Self> {
        let open = &car.gears.get(gear)?.open;
        let count = |step_s: f64| ((end_s - begin_s).max(0.0) / step_s) as usize;
        let [halves, fine] = [STEP_S, FINE_S].map(|step_s| {
            let span = |at: usize| [begin_s + step_s * at as f64, step_s];
            let of_step = |at: usize| WEIGHTS.map(|weight| half(car, open, &readings, span(at), weight));
            (0..count(step_s)).flat_map(of_step).collect()
        });
        (count(STEP_S) >= STEPS_MIN).then_some(Self { gear, halves, fine, reported: readings.reported })
    }

    /// How many steps there are.
    fn count(&self) -> usize {
        self.halves.len() / 2
    }

    /// Whether the engine torque is reported all the time.
    pub(crate) fn has_reported(&self) -> bool {
        let ends = [self.halves.first(), self.halves.last()].map(|half| half.map_or(0.0, |half| half.time_s));
        self.reported.len() > 1 && self.reported.longest_gap_s(ends) <= 2.0 * FINE_S
    }

    /// The same means of the reported engine torque over these steps, `late_s` after its signal, N m.
    pub(crate) fn reported_n_m(&self, halves: &[HalfStep], step_s: f64, late_s: f64) -> Vec<f64> {
        let mean = |(half, weight): (&HalfStep, Weight)| {
            points([half.time_s - 0.5 * step_s, step_s], weight)
                .map(|(time_s, fraction)| fraction * self.reported.at(time_s - late_s))
                .sum::<f64>()
        };
        halves.iter().zip(WEIGHTS.into_iter().cycle()).map(mean).collect()
    }
}

/// Means over steps of a value of their halves.
pub(crate) fn means<T>(halves: &[T], of: impl Fn(&T) -> f64) -> Vec<f64> {
    halves.chunks_exact(2).map(|halves| 0.5 * (of(&halves[0]) + of(&halves[1]))).collect()
}

/// How a mean is weighed over a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Weight {
    Falling,
    Rising,
}

const WEIGHTS: [Weight; 2] = [Weight::Falling, Weight::Rising];

/// Times in a step with this begin and length, and their fractions in its mean.
fn points([begin_s, step_s]: [f64; 2], weight: Weight) -> impl Iterator<Item = (f64, f64)> {
    let points = (step_s / POINT_S).round() as u32;
    (0..points).map(move |point| {
        let passed = (f64::from(point) + 0.5) / f64::from(points);
        let fraction = if weight == Weight::Rising { passed } else { 1.0 - passed };
        (begin_s + step_s * passed, 2.0 * fraction / f64::from(points))
    })
}

fn half(car: &DrivenCar, open: &[OpenElement], readings: &StretchReadings, span: [f64; 2], weight: Weight) -> HalfStep {
    let mut mean = HalfStep { time_s: span[0] + 0.5 * span[1], ..HalfStep::default() };
    for (time_s, fraction) in points(span, weight) {
        let [engine, turbine, output] =
            [&readings.engine, &readings.turbine, &readings.output].map(|series| series.at(time_s));
        mean.engine_rad_s += fraction * engine;
        mean.output_rad_s += fraction * output;
        if let Some(converter) = &car.converter {
            let torques = converter.torques(engine, turbine);
            mean.turbine_n_m += fraction * torques.turbine_n_m;
            mean.pump_n_m += fraction * torques.pump_n_m;
            mean.above_one_n_m += fraction * (torques.turbine_n_m - torques.pump_n_m);
            let changes = car.capacity_changes(turbine / engine);
            for (sum, change) in mean.by_capacity_n_m.iter_mut().zip(changes) {
                *sum += fraction * change * torques.turbine_n_m;
            }
        }
        for OpenElement { at, slip, drag_n_m } in open {
            let of_one = -slip * drag_torque(1.0, slip * turbine);
            mean.drag_n_m += fraction * drag_n_m * of_one;
            mean.drag_of_one_n_m[*at] += fraction * of_one;
        }
    }
    mean
}
