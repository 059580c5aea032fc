//! Skip shifts, requests that are withdrawn, and the throttle moved in mid-shift.

use car::Car;
use plant::car::{CarCalibration, CarModel, CarRun, CarSample, CarShift, Driver};

use super::{HeldGear, calibrated, cars, neighbours, runs, with_stroke};

/// Time of the request, s.
const REQUEST_S: f64 = 1.0;
/// Speed of the gearbox input in the lower gear of [`CarShift::usual`], and the minimum in the higher one, rad/s.
const INPUT_RAD_S: f64 = 230.0;
const MIN_INPUT_RAD_S: f64 = 120.0;
/// The same where the car coasts before it is driven, rad/s.
const COASTING_INPUT_RAD_S: f64 = 160.0;
/// Time in which the driver moves the pedal, s.
const PEDAL_S: f64 = 0.15;

/// What came of a run of shifts.
struct Run {
    /// When the last gear was engaged, s after the request.
    complete_s: Option<f64>,
    /// Largest slip outside all gears that were asked for, rad/s at the turbine.
    outside_rad_s: f64,
    /// Largest change of acceleration in 10 ms, m/s^3.
    jerk_m_s3: f64,
}

/// Simulates the shift, where `asked` says which gear is wanted at a time after the request, and `throttle` how far the pedal
/// is pressed.
fn run(
    (model, calibration): (&CarModel, CarCalibration),
    shift: &CarShift,
    asked: impl Fn(f64) -> usize,
    throttle: impl Fn(f64) -> f64,
) -> Run {
    let car = &model.car;
    let driver = |time_s: f64| Driver { throttle: throttle(time_s - REQUEST_S), brake: 0.0, grade_rad: 0.0 };
    let state = model.in_gear(shift.from, Some(shift.to), shift.vehicle_m_s, shift.throttle).unwrap();
    let start = (driver(0.0), 0.01);
    let mut run = CarRun::new(model, car, calibration, shift.from, state, start).unwrap();
    run.preselect(Some(shift.to));
    let ratios = [shift.from, shift.to].map(|gear| car.gearbox.gears[gear].ratio);
    let (low, high) = (ratios[0].min(ratios[1]), ratios[0].max(ratios[1]));
    let (mut active_s, mut held) = (REQUEST_S, HeldGear::default());
    let (mut result, mut before) = (Run { complete_s: None, outside_rad_s: 0.0, jerk_m_s3: 0.0 }, None);
    while run.time_s() < 6.0 {
        let now_s = run.time_s();
        let after_s = now_s - REQUEST_S;
        if after_s > -1e-9 {
            run.request(asked(after_s)).unwrap();
        }
        // Rated while a shift is under way and half a second after it.
        let is_rated = now_s < active_s + 0.5;
        run.advance(
            driver(now_s),
            |_| {},
            |sample| {
                held.check(car, sample, "");
                if !is_rated {
                    return;
                }
                let (turbine, output) = (sample.torques.turbine_rad_s, sample.torques.output_rad_s);
                result.outside_rad_s = result.outside_rad_s.max(turbine - high * output).max(low * output - turbine);
                if let Some(before) = before.replace(sample.vehicle_m_s2)
                    && after_s > 0.0
                {
                    result.jerk_m_s3 = result.jerk_m_s3.max((sample.vehicle_m_s2 - before).abs() / 0.01);
                }
            },
        )
        .unwrap();
        if run.controller().shift().is_some() {
            active_s = run.time_s();
        }
        let is_there = run.controller().shift().is_none() && run.controller().gear() == asked(f64::INFINITY);
        match (is_there, after_s > 0.05) {
            (true, true) => result.complete_s = result.complete_s.or(Some(run.time_s() - REQUEST_S)),
            _ => result.complete_s = None,
        }
    }
    result
}

/// The worst of many runs.
#[derive(Default)]
struct Worst {
    runs: usize,
    longest: (f64, String),
    outside: (f64, String),
    jerk: (f64, String),
}

impl Worst {
    fn push(&mut self, label: &str, run: &Run) {
        let complete_s = run.complete_s.unwrap_or_else(|| panic!("{label} is not completed"));
        self.runs += 1;
        for (worst, number) in
            [(&mut self.longest, complete_s), (&mut self.outside, run.outside_rad_s), (&mut self.jerk, run.jerk_m_s3)]
        {
            if number > worst.0 {
                *worst = (number, label.to_owned());
            }
        }
    }

    fn print(&self, title: &str) {
        println!("{title}: {} runs", self.runs);
        println!("  longest {:.2} s ({})", self.longest.0, self.longest.1);
        println!("  outside {:.1} rad/s ({})", self.outside.0, self.outside.1);
        println!("  jerk {:.0} m/s^3 ({})", self.jerk.0, self.jerk.1);
    }
}

/// Speed of the gearbox input in the higher of two gears at the usual speed of a shift, rad/s.
fn slowest_rad_s(car: &Car, (from, to): (usize, usize)) -> f64 {
    let ratios = [from, to].map(|gear| car.gearbox.gears[gear].ratio);
    INPUT_RAD_S * ratios[0].min(ratios[1]) / ratios[0].max(ratios[1])
}

/// Every forward gear to those two and three further on, in both directions.
fn skips(car: &Car) -> Vec<(usize, usize)> {
    let forward = car.gearbox.forward_gears();
    let pairs = |apart: usize| forward.windows(apart + 1).map(|gears| (gears[0], gears[gears.len() - 1]));
    pairs(2).chain(pairs(3)).flat_map(|(a, b)| [(a, b), (b, a)]).collect()
}

fn label(car: &Car, (from, to): (usize, usize), more: &str) -> String {
    let name = |gear: usize| &car.gearbox.gears[gear].name;
    format!("{} {}-{}, {more}", car.gearbox.name, name(from), name(to))
}

#[test]
fn skip_shifts_run_through_gears_between_and_end_well() {
    let mut worst = Worst::default();
    for (calibration, car) in calibrated(cars().into_iter().chain(cars().into_iter().map(with_stroke))) {
        let model = CarModel::new(car).unwrap();
        for pair in runs(skips(&model.car)) {
            for throttle in [0.0, 0.2, 0.5] {
                let mut shift = CarShift::usual(&model.car, pair.0, pair.1, throttle);
                // Without a converter fast enough for the engine in both gears.
                if model.car.converter.is_none() {
                    shift.vehicle_m_s *= (MIN_INPUT_RAD_S / slowest_rad_s(&model.car, pair)).max(1.0);
                }
                let run = run((&model, calibration), &shift, |_| pair.1, |_| throttle);
                worst.push(&label(&model.car, pair, &format!("throttle {throttle}")), &run);
            }
        }
    }
    worst.print("skip shifts");
    assert!(worst.longest.0 < 4.5 && worst.outside.0 < 10.0 && worst.jerk.0 < 80.0);
}

#[test]
fn a_request_that_is_withdrawn_ends_in_the_old_gear() {
    for (title, with) in [("withdrawn", None), ("withdrawn, with stroke", Some(with_stroke as fn(Car) -> Car))] {
        let mut worst = Worst::default();
        for (calibration, car) in calibrated(cars()) {
            let model = CarModel::new(with.map_or(car.clone(), |with| with(car))).unwrap();
            for pair in runs(neighbours(&model.car)) {
                for throttle in [0.0, 0.25] {
                    for after_s in [0.05, 0.15, 0.25, 0.35, 0.45, 0.55, 0.7] {
                        let shift = CarShift::usual(&model.car, pair.0, pair.1, throttle);
                        let asked = |time_s: f64| if time_s < after_s { pair.1 } else { pair.0 };
                        let run = run((&model, calibration), &shift, asked, |_| throttle);
                        let more = format!("throttle {throttle}, after {after_s} s");
                        worst.push(&label(&model.car, pair, &more), &run);
                    }
                }
            }
        }
        worst.print(title);
        assert!(worst.longest.0 < 3.0 && worst.outside.0 < 15.0 && worst.jerk.0 < 90.0);
    }
}

/// It goes back to line pressure from where it is, and not from the pressure at which a clutch closes.
#[test]
fn a_request_that_is_withdrawn_in_the_fill_lets_no_command_of_the_old_gear_drop() {
    for (calibration, car) in calibrated(cars()) {
        let model = CarModel::new(car).unwrap();
        let line_pa = model.car.line_pressure_pa;
        for (from, to) in runs(neighbours(&model.car)) {
            for (throttle, after_s) in [0.0, 0.25].into_iter().flat_map(|t| [0.02, 0.05, 0.1, 0.15].map(|s| (t, s))) {
                let shift = CarShift::usual(&model.car, from, to, throttle);
                let driver = Driver { throttle, brake: 0.0, grade_rad: 0.0 };
                let state = model.in_gear(from, Some(to), shift.vehicle_m_s, throttle).unwrap();
                let mut run = CarRun::new(&model, &model.car, calibration, from, state, (driver, 0.01)).unwrap();
                // Pressures at which the valves of the old gear's elements settle, Pa.
                let mut before: Option<Vec<f64>> = None;
                while run.time_s() < REQUEST_S + after_s + 0.4 {
                    if run.time_s() > REQUEST_S - 1e-9 {
                        run.request(if run.time_s() < REQUEST_S + after_s - 1e-9 { to } else { from }).unwrap();
                    }
                    let settled = |sample: &CarSample| {
                        let held = model.car.gearbox.gears[from].holding.iter().map(|holding| holding.element);
                        let settled = |at: usize| {
                            model.car.clutches[at].map(|clutch| clutch.valve.settled_pressure(sample.commands[at]))
                        };
                        held.filter_map(settled).collect::<Vec<_>>()
                    };
                    let mut now = Vec::new();
                    run.advance(driver, |_| {}, |sample| now = settled(sample)).unwrap();
                    if run.time_s() > REQUEST_S + after_s + 0.005 {
                        for (now, before) in now.iter().zip(before.iter().flatten()) {
                            let more = format!("throttle {throttle}, after {after_s} s, at {:.2} s", run.time_s());
                            let label = label(&model.car, (from, to), &more);
                            // The torque that the clutch must hold changes by some N m in 10 ms.
                            assert!(*now > before - 0.01 * line_pa, "{label}: {before:.0} to {now:.0} Pa");
                        }
                    }
                    before = Some(now);
                }
            }
        }
    }
}

#[test]
fn a_change_of_throttle_in_mid_shift_ends_well() {
    for (title, with) in
        [("throttle moved", None), ("throttle moved, with stroke", Some(with_stroke as fn(Car) -> Car))]
    {
        let mut worst = Worst::default();
        for (calibration, car) in calibrated(cars()) {
            let model = CarModel::new(with.map_or(car.clone(), |with| with(car))).unwrap();
            for pair in runs(neighbours(&model.car)) {
                for [before, after] in [[0.0, 0.25], [0.25, 0.0]] {
                    for after_s in [0.1, 0.3, 0.45, 0.6] {
                        let mut shift = CarShift::usual(&model.car, pair.0, pair.1, before);
                        if model.car.converter.is_none() {
                            // The car coasts for 1.6 s before the pedal moves: its clutch is not to open.
                            shift.vehicle_m_s *= (COASTING_INPUT_RAD_S / slowest_rad_s(&model.car, pair)).max(1.0);
                        }
                        let pedal =
                            |time_s: f64| before + (after - before) * ((time_s - after_s) / PEDAL_S).clamp(0.0, 1.0);
                        let run = run((&model, calibration), &shift, |_| pair.1, pedal);
                        let more = format!("throttle {before} to {after} after {after_s} s");
                        worst.push(&label(&model.car, pair, &more), &run);
                    }
                }
            }
        }
        worst.print(title);
        // A flare that is caught: the delays of valve and controller, 50 ms, at some 400 rad/s^2.
        assert!(worst.longest.0 < 3.0 && worst.outside.0 < 25.0, "{title}");
    }
}
