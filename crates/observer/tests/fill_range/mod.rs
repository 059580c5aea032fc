//! The range of the pressure against cylinders that were not made from its equations: thousands of shifts with random
//! parameters and commands, by two plants of different structure. No sample may be outside; each deliberate defect of
//! the budget must be found.

mod cars;
mod cylinders;
mod shifts;

use cars::Car;
use cylinders::{Cylinder, Exact, Wandering};
use drivetrain::Real;
use observer::{Budget, FillBudget, PressureRange, Reading};
use shifts::{COMMAND_MAX_A, Log, Row};

/// A small random generator, SplitMix64.
struct Random(u64);

impl Random {
    fn fraction(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);

        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn within(&mut self, [low, high]: [f64; 2]) -> f64 {
        low + self.fraction() * (high - low)
    }

    fn chance(&mut self, fraction: f64) -> bool {
        self.fraction() < fraction
    }

    fn count(&mut self, low: usize, high: usize) -> usize {
        low + (self.fraction() * (high + 1 - low) as f64) as usize
    }
}

/// Rounding of a pressure of 1.25 MPa over a chain of a few operations; the recursions contract.
fn rounding_pa<T: Real>() -> f64 {
    16.0 * 1.25e6 * T::epsilon().to_f64_exact()
}

/// What a run of a range over a log gave.
#[derive(Debug, Default, Clone, Copy)]
struct Outcome {
    samples: usize,
    outside: usize,
    worst_pa: f64,
    width_pa: f64,
}

fn outcome<T: Real>(budget: &Budget<f64>, rows: &[Row], truth_pa: &[f64]) -> Outcome {
    let (budget, maximum) = (budget.cast::<T>(), T::of(COMMAND_MAX_A));
    let mut range = PressureRange::unknown(&budget, maximum);
    let mut outcome = Outcome::default();
    for row in rows {
        let command = row.command_a.map(|command| Reading { value: T::of(command), age_s: T::of(row.age_s) });
        range.step(&budget, T::of(row.dt_s), command, maximum);
        let Some(step) = row.step else { continue };
        let [low, high] = range.pressure_pa(&budget).map(Real::to_f64_exact);
        let beyond = (low - truth_pa[step]).max(truth_pa[step] - high);
        outcome.samples += 1;
        outcome.outside += usize::from(beyond > rounding_pa::<T>());
        outcome.worst_pa = outcome.worst_pa.max(beyond);
        outcome.width_pa += high - low;
    }
    outcome
}

/// How the rows of a log lie to the controller's ticks.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Sampling {
    /// At the ticks; some rows and some commands are missing.
    Synchronous,
    /// Anywhere beside them.
    Asynchronous,
    /// At the ticks, but each reading reaches the observer later, in steps of another rate.
    Late,
}

/// Runs over cars of these tolerances (1: a quarter of the fill volume) and counts; `changed` is the budget that the range is
/// given in place of the one that holds.
fn runs<P: Cylinder>(
    seeds: std::ops::Range<u64>,
    tolerance: impl Fn(u64) -> f64,
    sampling: Sampling,
    changed: impl Fn(&mut Budget<f64>),
) -> [(usize, Outcome); 2] {
    let mut sums = [(0, Outcome::default()); 2];
    for seed in seeds {
        let mut random = Random(seed.wrapping_mul(0x1234_5678_9abc_def1));
        let car = Car::random(&mut random, tolerance(seed));
        let log = Log::random(&mut random, &car, sampling);
        let truth_pa = cylinders::simulate::<P>(&mut random, &car, &log);
        let mut budget = car.budget(sampling);
        changed(&mut budget);
        let outcomes = [outcome::<f64>(&budget, &log.rows, &truth_pa), outcome::<f32>(&budget, &log.rows, &truth_pa)];
        for ((broken, sum), outcome) in sums.iter_mut().zip(outcomes) {
            *broken += usize::from(outcome.outside > 0);
            sum.samples += outcome.samples;
            sum.outside += outcome.outside;
            sum.worst_pa = sum.worst_pa.max(outcome.worst_pa);
            sum.width_pa += outcome.width_pa;
        }
    }
    sums
}

fn mixed(seed: u64) -> f64 {
    [1.0, 0.3, 0.1][(seed % 3) as usize]
}

fn assert_holds<P: Cylinder>(sampling: Sampling, max_width_pa: f64) {
    for (broken, sum) in runs::<P>(0..500, mixed, sampling, |_| ()) {
        let mean_width = sum.width_pa / sum.samples as f64;
        assert_eq!((broken, sum.outside), (0, 0), "{sum:?}");
        assert!(sum.samples > 30_000 && mean_width < max_width_pa, "{sum:?}, mean width {mean_width}");
    }
}

#[test]
fn no_sample_of_a_cylinder_with_constant_parameters_is_outside() {
    assert_holds::<Exact>(Sampling::Synchronous, 0.35e6);
}

#[test]
fn no_sample_of_a_cylinder_whose_parameters_wander_is_outside() {
    assert_holds::<Wandering>(Sampling::Synchronous, 0.35e6);
}

#[test]
fn no_sample_beside_the_controllers_ticks_is_outside() {
    assert_holds::<Exact>(Sampling::Asynchronous, 0.35e6);
    assert_holds::<Wandering>(Sampling::Asynchronous, 0.35e6);
}

#[test]
fn no_sample_is_outside_where_the_command_is_read_late() {
    // Late by up to two periods, which are long for these valves: in most steps any command may act.
    assert_holds::<Exact>(Sampling::Late, 0.7e6);
    assert_holds::<Wandering>(Sampling::Late, 0.7e6);
}

type Defect = (&'static str, f64, Sampling, fn(&mut Budget<f64>));

fn fill(budget: &mut Budget<f64>) -> &mut FillBudget<f64> {
    budget.fill.as_mut().unwrap()
}

/// What is wrong, the tolerance of the cars, the sampling, and the budget that is wrong.
const DEFECTS: [Defect; 9] = [
    ("no stroke", 0.3, Sampling::Synchronous, |budget| budget.fill = None),
    ("filled at 70 %", 0.3, Sampling::Synchronous, |budget| fill(budget).volume_m3[1] *= 0.7),
    ("emptied at 150 %", 0.3, Sampling::Synchronous, |budget| fill(budget).volume_m3[0] *= 1.5),
    ("no plateau on the way out", 0.3, Sampling::Synchronous, |budget| {
        fill(budget).exhaust[1] = fill(budget).exhaust[1].with_resistance_factor(0.05);
    }),
    ("no hold in the band", 0.3, Sampling::Synchronous, |budget| {
        fill(budget).preload_pressure_pa = [fill(budget).kiss_pressure_pa[1]; 2];
    }),
    ("flow", 1.0, Sampling::Synchronous, |budget| fill(budget).supply[1] = fill(budget).supply[0]),
    ("delay", 1.0, Sampling::Synchronous, |budget| budget.delay_s[1] *= 0.3),
    ("hysteresis", 0.3, Sampling::Synchronous, |budget| budget.hysteresis_pa *= 0.3),
    ("age of the command", 0.3, Sampling::Asynchronous, |budget| budget.command_age_s = 0.0),
];

#[test]
fn each_defect_of_the_budget_is_caught() {
    let caught = DEFECTS.map(|(name, tolerance, sampling, defect)| {
        let [(broken, _), _] = runs::<Exact>(0..60, |_| tolerance, sampling, defect);
        (name, broken)
    });
    // Of 60 shifts.
    assert!(caught.iter().all(|(_, broken)| *broken > 0), "{caught:?}");
    assert!(caught[0].1 > 40, "{caught:?}");
}
