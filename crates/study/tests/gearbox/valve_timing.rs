//! Lag and delay of the valves, which the filter learns, against a filter that is told both.

use car::Car;
use car::ErrorBudget;
use study::gearbox::{ShiftDraw, ValveTiming};

use super::cars::{Random, cars};
use super::learning::{Drive, Errors, SHIFTS, draws};

/// How sure a filter is that is told lag and delay: fraction of the lag, and s.
const SURE: (f64, f64) = (0.02, 0.001);

/// Factor on the lag of a valve, and its delay, s; none as in the known car.
type Timing = (f64, Option<f64>);

/// The car whose elements have this timing, and what a filter is that is told of it.
fn timed(car: &Car, timing: impl Fn(usize) -> Timing + Copy) -> [Car; 2] {
    let mut truth = car.clone();
    for (at, clutch) in truth.clutches.iter_mut().enumerate() {
        let Some(clutch) = clutch else { continue };
        let (lag, delay_s) = timing(at);
        clutch.valve = clutch.valve.changed(lag, 1.0, delay_s);
    }
    [truth, told(car, timing)]
}

/// The car `car` with this lag and delay of the valves, and sure of them.
fn told(car: &Car, timing: impl Fn(usize) -> Timing) -> Car {
    let mut told = car.clone();
    told.error_bounds.elements.resize(car.clutches.len(), Default::default());
    for (at, (clutch, own)) in told.clutches.iter_mut().zip(&mut told.error_bounds.elements).enumerate() {
        let Some(clutch) = clutch else { continue };
        let (lag, delay_s) = timing(at);
        clutch.valve = clutch.valve.changed(lag, 1.0, delay_s);
        own.valve_lag_factor = Some([1.0 - SURE.0, 1.0 + SURE.0]);
        own.valve_delay_s = delay_s.map(|delay_s| [(delay_s - SURE.1).max(0.0), delay_s + SURE.1]);
    }
    told
}

/// Errors of a filter that is told nothing and of one that is told the timing, unlearnt and after thirty shifts.
#[derive(Default)]
struct Found([[Errors; 2]; 2]);

impl Found {
    fn add(&mut self, car: &Car, [truth, told]: &[Car; 2], seed: u64) {
        let drive = Drive::of(car, truth, seed);
        for (sums, drive) in self.0.iter_mut().zip([&drive, &drive.told(told)]) {
            for (sum, count) in sums.iter_mut().zip([0, SHIFTS]) {
                sum.add(&drive.after(count, 1.0, 10 * seed).1);
            }
        }
    }

    /// Errors after thirty shifts, N m: of a filter that is told nothing, and of one that is told the timing.
    fn print(&self, name: &str) -> [f64; 2] {
        let of = |count: usize| self.0.each_ref().map(|sums| sums[count].all()[0]);
        let ([before, before_given], [after, after_given]) = (of(0), of(1));
        let less = |told: f64, unknown: f64| 100.0 * (1.0 - told / unknown);
        println!(
            "{name}: unlearnt {before:.2}, told {before_given:.2} ({:.1} % less); after {SHIFTS} shifts {after:.2}, told {after_given:.2} ({:.1} % less)",
            less(before_given, before),
            less(after_given, after)
        );
        for (who, sums) in ["told nothing", "told"].iter().zip(&self.0) {
            println!("    {who}: {}", sums[1].show());
        }
        [after, after_given]
    }
}

/// Cars with these lags and delays of all valves, and of one valve each.
fn print_given(car: &Car) {
    let timings: [(&str, Timing); 7] = [
        ("as known", (1.0, None)),
        ("lag times 0.7", (0.7, None)),
        ("lag times 1.4", (1.4, None)),
        ("delay 0", (1.0, Some(0.0))),
        ("delay 30 ms", (1.0, Some(0.03))),
        ("lag times 0.7, delay 0", (0.7, Some(0.0))),
        ("lag times 1.4, delay 30 ms", (1.4, Some(0.03))),
    ];
    for (name, timing) in timings {
        let mut found = Found::default();
        (1..=draws()).for_each(|seed| found.add(car, &timed(car, |_| timing), seed));
        found.print(&format!("all valves, {name}"));
    }
    for (name, timing) in &timings[1..5] {
        let mut found = Found::default();
        for (at, seed) in (0..car.clutches.len()).filter(|&at| car.clutches[at].is_some()).zip(1..) {
            found.add(car, &timed(car, |element| if element == at { *timing } else { (1.0, None) }), seed);
        }
        found.print(&format!("one valve, {name}"));
    }
}

/// The numbers of the documentation: `LEARNING_DRAWS=4 cargo test --release -p study --test tests valve_timing -- --nocapture`.
#[test]
fn in_thirty_shifts_lag_and_delay_are_learnt() {
    let car = cars().remove(0);
    if draws() > 2 {
        print_given(&car);
    }
    let mut found = Found::default();
    for seed in 1..=2 * draws() {
        let mut random = Random(seed * 77);
        let draw = ShiftDraw::within(&car, &ErrorBudget::of_car(&car), || random.uniform());
        let draw = draw.with_timing(&ErrorBudget::of_car(&car), || random.uniform());
        let truth = draw.car(&car);
        let timing =
            |at: usize| draw.timing[at].map_or((1.0, None), |ValveTiming { lag, delay_s, .. }| (lag, Some(delay_s)));
        found.add(&car, &[truth, told(&car, timing)], seed);
    }
    let [after, after_given] = found.print("cars of the whole budget");
    let before = found.0[0][0].all()[0];
    assert!(after < 0.7 * before && after < 1.4 * after_given, "{before} {after} {after_given}");
}
