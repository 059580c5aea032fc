//! The ranges of a vehicle: once for all observers, around estimates, and through the fill of a clutch.

use car::Vehicle;
use config::{Source, VehicleFile};
use design::{bounded, design_rigid, inversion, kalman_filter, range, rigid_observer};
use observer::{Bounds, ChannelHealth, Channels, Estimate, Estimator, Health, Input, Phase, Reading};

const STROKE: &str = include_str!("../../../vehicles/two_speed_stroke.toml");
const DT_S: f64 = 0.01;

fn with_stroke() -> Vehicle {
    VehicleFile::from_source(Source::built_in("two_speed_stroke.toml", STROKE)).unwrap().vehicle
}

/// A car that rolls in first gear, with this command of the oncoming clutch.
fn rolling(vehicle: &Vehicle, command: f64) -> Input<f64> {
    let turbine_rad_s = 200.0;
    let output = turbine_rad_s / 2.5;
    Input {
        engine_rad_s: Some(Reading::now(250.0)),
        turbine_rad_s: Some(Reading::now(turbine_rad_s)),
        output_rad_s: Some(Reading::now(output)),
        wheel_rad_s: Some(Reading::now(output / vehicle.driveline.final_ratio)),
        command: Some(Reading::now(command)),
        ..Input::none(DT_S)
    }
}

/// Ranges at the end of each part of a drive: time, s, and pressure that the command asks for, Pa.
fn ranges(vehicle: &Vehicle, parts: &[(f64, f64)]) -> Vec<Bounds<f64>> {
    let (estimator, valve) = (range(vehicle), &vehicle.oncoming.valve);
    let mut state = estimator.start();
    let part = |&(length_s, pressure_pa): &(f64, f64)| {
        let input = rolling(vehicle, valve.command_for(pressure_pa));
        let samples = (length_s / DT_S).round() as usize;
        (0..samples).map(|_| estimator.step(&mut state, &input)).last().unwrap()
    };
    parts.iter().map(part).collect()
}

/// Rolling with changing commands, and with readings that are late, lost or impossible.
fn with_faults(vehicle: &Vehicle, k: u32) -> Input<f64> {
    let mut input = rolling(vehicle, 0.3 * f64::from(k % 100) / 100.0);
    let age_s = 0.001 * f64::from(k % 7);
    input.output_rad_s = input.output_rad_s.filter(|_| k % 5 != 3).map(|reading| Reading { age_s, ..reading });
    match k {
        120..=125 => input.turbine_rad_s = None,
        140 => input.dt_s = f64::NAN,
        160 => input.dt_s = 0.3,
        180 => input.engine_rad_s = Some(Reading::now(1e9)),
        200..=240 => input.wheel_rad_s = None,
        _ => (),
    }
    input
}

/// Whether both say the same; fields without a value are not equal to themselves.
fn same(a: &Estimate<f64>, b: &Estimate<f64>) -> bool {
    format!("{a:?}") == format!("{b:?}")
}

#[test]
fn an_observer_with_its_ranges_is_that_observer_and_those_ranges() {
    fn check<O: Estimator<f64>>(vehicle: &Vehicle, observer: &O) {
        let (ranges, both) = (range(vehicle), bounded(vehicle, observer));
        let (mut own, mut alone, mut together) = (observer.start(), ranges.start(), both.start());
        for k in 0..300 {
            let input = with_faults(vehicle, k);
            let apart = ranges.step(&mut alone, &input).clip(observer.step(&mut own, &input));
            let found = both.step(&mut together, &input);
            assert!(same(&found, &apart), "{k}: {found:?} {apart:?}");
        }
    }
    let vehicle = with_stroke();
    check(&vehicle, &rigid_observer(&vehicle, design_rigid(&vehicle).unwrap().gains()));
    check(&vehicle, &inversion(&vehicle));
    check(&vehicle, &kalman_filter(&vehicle, None));
}

#[test]
fn the_guaranteed_ranges_are_the_same_without_the_expected_one() {
    let vehicle = with_stroke();
    let (all, guaranteed) = (range(&vehicle), range(&vehicle).guaranteed());
    let (mut with, mut without) = (all.start(), guaranteed.start());
    let mut expected = 0;
    for k in 0..300 {
        let input = with_faults(&vehicle, k);
        let (with, without) = (all.step(&mut with, &input), guaranteed.step(&mut without, &input));
        expected += usize::from(with.shaft_torque_n_m.is_some());
        assert_eq!(without, Bounds { shaft_torque_n_m: None, ..with }, "{k}");
    }
    assert!(expected > 100, "{expected}");
}

fn width([low, high]: [f64; 2]) -> f64 {
    high - low
}

#[test]
fn one_range_is_that_of_every_observer() {
    let vehicle = with_stroke();
    let (alone, kalman, inverted) =
        (range(&vehicle), bounded(&vehicle, kalman_filter(&vehicle, None)), bounded(&vehicle, inversion(&vehicle)));
    let (mut own, mut first, mut second) = (alone.start(), kalman.start(), inverted.start());
    for k in 0..400 {
        let hostile = [(50, f64::NAN), (51, -1.0), (90, 1e9)].iter().find(|(at, _)| *at == k);
        let mut input = rolling(&vehicle, hostile.map_or(0.3 * f64::from(k % 100) / 100.0, |(_, command)| *command));
        match k {
            120 => input.turbine_rad_s = None,
            140 => input.dt_s = f64::NAN,
            160 => input.dt_s = 0.3,
            200..=210 => input.wheel_rad_s = None,
            _ => (),
        }
        let bounds = alone.step(&mut own, &input);
        assert_eq!(kalman.step(&mut first, &input).bounds, Some(bounds), "{k}");
        assert_eq!(inverted.step(&mut second, &input).bounds, Some(bounds), "{k}");
        assert_eq!(
            bounds.shaft_torque_n_m.is_none(),
            [0, 120, 121, 140, 141].contains(&k) || (200..=211).contains(&k),
            "{k}"
        );
    }
}

#[test]
fn a_clutch_carries_no_torque_before_its_piston_can_have_arrived_and_some_once_it_must_have() {
    let vehicle = with_stroke();
    let (kiss, asked) = (vehicle.oncoming.clutch.kiss_pressure(), 0.21e6);
    let [empty, soon, later] = ranges(&vehicle, &[(4.0, 0.0), (0.04, asked), (1.0, asked)])[..] else { panic!() };
    assert_eq!(empty.clutch_torque_n_m, [0.0, 0.0]);
    assert!(empty.pressure_pa[1] < vehicle.oncoming.cylinder.preload_pa, "{empty:?}");
    // Within 40 ms at most a third of the oil can have come in: on the plateau, without torque.
    assert_eq!((soon.clutch_torque_n_m, soon.pressure_pa[1]), ([0.0, 0.0], 1.1 * kiss));
    assert!(later.pressure_pa[0] > 1.1 * kiss && later.clutch_torque_n_m[0] > 0.0, "{later:?}");
    // Without a stroke the same 40 ms are pressure and torque.
    let chapter = VehicleFile::built_in().unwrap().vehicle;
    let at = ranges(&chapter, &[(4.0, 0.0), (0.04, asked)])[1];
    assert!(at.pressure_pa[1] > 2.0 * kiss && at.clutch_torque_n_m[1] > 0.0, "{at:?}");
}

#[test]
fn a_stroke_pressure_within_the_hysteresis_of_the_kiss_point_may_never_fill() {
    let vehicle = with_stroke();
    let held = ranges(&vehicle, &[(4.0, 0.0), (0.1, 0.21e6), (20.0, 0.07e6)])[2];
    assert!(held.pressure_pa[0] <= vehicle.oncoming.clutch.kiss_pressure(), "{held:?}");
}

#[test]
fn the_range_is_narrow_in_gear_and_wide_while_the_piston_may_stroke() {
    let vehicle = with_stroke();
    let parts = [(4.0, 0.0), (0.15, 0.21e6), (0.15, 0.075e6), (0.25, 0.25e6), (1.0, 0.25e6), (2.0, 0.9e6)];
    let widths = ranges(&vehicle, &parts).into_iter().map(|bounds| width(bounds.pressure_pa) / 1e3);
    // kPa: empty, end of the fast fill, stroke pressure, on the way to 0.25 MPa, settled there, in gear at 0.9 MPa.
    assert_eq!(widths.map(f64::round).collect::<Vec<_>>(), [18.0, 201.0, 110.0, 247.0, 82.0, 215.0]);
}

fn estimate(pressure_pa: f64, clutch_torque_n_m: f64, shaft_torque_n_m: Option<f64>, health: Health) -> Estimate<f64> {
    let (phase, channels) = (Phase::TorquePhase, Channels::all(ChannelHealth::Good));
    Estimate { pressure_pa, clutch_torque_n_m, shaft_torque_n_m, phase, health, channels, bounds: None }
}

#[test]
fn a_clipped_estimate_is_in_the_guaranteed_ranges_and_says_that_it_was_not() {
    let bounds =
        Bounds { pressure_pa: [1e5, 2e5], clutch_torque_n_m: [10.0, 20.0], shaft_torque_n_m: Some([300.0, 400.0]) };
    let clipped = |estimate| bounds.clip(estimate);
    let inside = estimate(1.5e5, 15.0, Some(350.0), Health::Good);
    assert_eq!(clipped(inside), Estimate { bounds: Some(bounds), ..inside });
    let high = clipped(estimate(3e5, 15.0, None, Health::Good));
    assert_eq!((high.pressure_pa, high.health), (2e5, Health::LimitedToRange));
    let low = clipped(estimate(1.5e5, 5.0, None, Health::Good));
    assert_eq!((low.clutch_torque_n_m, low.health), (10.0, Health::LimitedToRange));
    // The range of the shaft torque is expected only: its estimate stays.
    let shaft = clipped(estimate(1.5e5, 15.0, Some(500.0), Health::Good));
    assert_eq!((shaft.shaft_torque_n_m, shaft.health), (Some(500.0), Health::OutsideRange));
    assert_eq!(clipped(estimate(3e5, 15.0, None, Health::Restarted)).health, Health::Restarted);
}

#[test]
fn the_range_grows_from_a_new_command_to_the_next() {
    let vehicle = with_stroke();
    let (estimator, mut state) = (range(&vehicle), range(&vehicle).start());
    let input = rolling(&vehicle, vehicle.oncoming.valve.command_for(0.9e6));
    let at = |age_ms: u32| Input { dt_s: 1e-3, command: input.command.filter(|_| age_ms == 0), ..input };
    let widths = (0..2009).map(|ms| width(estimator.step(&mut state, &at(ms % 10)).pressure_pa) / 1e3);
    // kPa, in gear at 0.9 MPa: in the step with the new command, 3 ms and 8 ms after it.
    let last: Vec<f64> = widths.skip(2000).map(f64::round).collect();
    assert_eq!([last[0], last[3], last[8]], [225.0, 457.0, 700.0]);
}

/// The true torque is the middle of the range of right readings.
#[test]
fn one_wrong_speed_does_not_turn_the_range_of_the_torque_around() {
    let vehicle = with_stroke();
    let estimator = range(&vehicle);
    let slipping =
        Input { output_rad_s: Some(Reading::now(70.0)), ..rolling(&vehicle, vehicle.oncoming.valve.command_for(3e5)) };
    let add = |reading: Reading<f64>, by: f64| Reading { value: reading.value + by, ..reading };
    // Turbine and output speed in each row, or in turns.
    for in_turns in [false, true] {
        let (mut right, mut wrong) = (estimator.start(), estimator.start());
        for k in 0..400 {
            let mut input = slipping;
            if in_turns {
                input.turbine_rad_s = input.turbine_rad_s.filter(|_| k % 2 == 0);
                input.output_rad_s = input.output_rad_s.filter(|_| k % 2 == 1);
            }
            let [minimum, maximum] = estimator.step(&mut right, &input).clutch_torque_n_m;
            match k {
                300 | 340 => input.turbine_rad_s = input.turbine_rad_s.map(|reading| add(reading, -150.0)),
                320 => input.turbine_rad_s = input.turbine_rad_s.map(|reading| add(reading, 1e3)),
                361 => input.output_rad_s = input.output_rad_s.map(|reading| add(reading, 150.0)),
                381 => input.output_rad_s = input.output_rad_s.map(|reading| add(reading, -60.0)),
                _ => (),
            }
            let found = estimator.step(&mut wrong, &input).clutch_torque_n_m;
            if k >= 200 {
                assert!(minimum > 50.0, "{in_turns} {k}: {minimum} {maximum}");
                let middle = 0.5 * (minimum + maximum);
                assert!((found[0]..=found[1]).contains(&middle), "{in_turns} {k}: {found:?} {middle}");
            }
        }
    }
}
