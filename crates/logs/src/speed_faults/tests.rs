use super::*;

const ROLES: [Role; WATCHED] = [Role::EngineSpeed, Role::TurbineSpeed, Role::OutputSpeed, Role::WheelSpeed];

/// The speeds of a car that accelerates in a gear of ratio 1.6, with a slipping converter and a final ratio of 3.5.
fn in_gear(time_s: f64) -> [f64; WATCHED] {
    let output = 100.0 + 8.0 * time_s;
    [1.7 * output, 1.6 * output, output, output / 3.5]
}

/// Times of the rows in which a speed is a fault, by speed, of six seconds with this time between rows.
fn faults(step_s: f64, speeds: impl Fn(f64) -> [f64; WATCHED]) -> [Vec<f64>; WATCHED] {
    let mut watch = SpeedFaults::new();
    let mut rows: [Vec<f64>; WATCHED] = Default::default();
    for row in (0_u32..).take_while(|row| f64::from(*row) * step_s < 6.0) {
        let time_s = f64::from(row) * step_s;
        for (at, speed) in speeds(time_s).into_iter().enumerate() {
            if watch.is_fault(ROLES[at], [speed, time_s], || Fit::None) {
                rows[at].push(time_s);
            }
        }
    }
    rows
}

#[test]
fn a_speed_that_reads_zero_while_the_car_drives_is_a_fault_until_it_is_back() {
    for step_s in [0.001, 0.01, 0.02, 0.05, 0.1] {
        for (at, length_s) in (0..WATCHED).flat_map(|at| [0.1, 0.5, 2.0].map(|length_s| (at, length_s))) {
            let is_out = |time_s: f64| time_s > 1.0 && time_s < 1.0 + length_s;
            for zero in [0.0, 0.5, -0.3] {
                let found = faults(step_s, |time_s| {
                    let mut speeds = in_gear(time_s);
                    if is_out(time_s) {
                        speeds[at] = zero;
                    }
                    speeds
                });
                for (other, rows) in found.iter().enumerate() {
                    assert!(
                        rows.iter().all(|time_s| other == at && is_out(*time_s)),
                        "{at} {other} {step_s}: {rows:?}"
                    );
                }
                let all = (0..).map(|i| step_s * f64::from(i)).take_while(|time_s| *time_s < 6.0);
                let all = all.filter(|time_s| is_out(*time_s)).count();
                assert_eq!(found[at].len(), all, "{at} {step_s} {length_s}");
            }
        }
    }
}

#[test]
fn a_sensor_that_is_dead_from_a_standstill_on_is_a_fault_once_the_car_drives() {
    for at in 0..WATCHED {
        for step_s in [0.01, 0.05] {
            let found = faults(step_s, |time_s| {
                // From rest, after half a second of idling.
                let output = 40.0 * (time_s - 0.5).max(0.0);
                let mut speeds = [80.0_f64.max(1.7 * output), 1.6 * output, output, output / 3.5];
                speeds[at] = 0.0;
                speeds
            });
            let first_s = found[at].first().copied().unwrap_or(f64::INFINITY);
            assert!(first_s < 3.0, "{at} {step_s}: {first_s}");
            // And from then on without a gap.
            let count = found[at].len() as f64;
            assert!((count * step_s - (6.0 - first_s)).abs() < 2.0 * step_s, "{at} {step_s}: {count}");
            assert!((0..WATCHED).all(|speed| speed == at || found[speed].is_empty()), "{at}: {found:?}");
        }
    }
}

#[test]
fn a_speed_that_was_zero_is_believed_again_in_the_direct_gear() {
    for at in [TURBINE, OUTPUT] {
        let found = faults(0.01, |time_s| {
            let mut speeds = in_gear(time_s);
            if time_s > 2.0 {
                speeds[TURBINE] = speeds[OUTPUT];
            }
            if time_s > 1.0 && time_s < 2.5 {
                speeds[at] = 0.0;
            }
            speeds
        });
        assert!(found[at].len() >= 149 && found[at].iter().all(|time_s| *time_s < 2.5), "{at}: {:?}", found[at].last());
    }
}

#[test]
fn a_turbine_that_showed_the_output_is_believed_where_it_turns_with_the_engine() {
    let found = faults(0.01, |time_s| {
        let [_, turbine, output, wheel] = in_gear(time_s);
        // The converter is locked, or there is none.
        [turbine, if time_s > 1.0 && time_s < 1.5 { output } else { turbine }, output, wheel]
    });
    assert!((48..=50).contains(&found[TURBINE].len()), "{:?}", found[TURBINE].last());
}

#[test]
fn a_fall_over_some_rows_is_a_fault_as_a_fall_at_once() {
    for at in 0..WATCHED {
        let found = faults(0.01, |time_s| {
            let mut speeds = in_gear(time_s);
            let rows = ((time_s - 1.0) / 0.01).round();
            speeds[at] *= match rows {
                0.0 => 0.5,
                1.0 => 0.2,
                rows if (2.0..100.0).contains(&rows) => 0.0,
                _ => 1.0,
            };
            speeds
        });
        assert!(found[at].len() >= 100, "{at}: {}", found[at].len());
    }
}

#[test]
fn a_channel_that_shows_the_speed_next_to_it_is_a_fault() {
    for (at, other) in [(ENGINE, OUTPUT), (TURBINE, OUTPUT), (OUTPUT, TURBINE), (OUTPUT, WHEEL), (WHEEL, OUTPUT)] {
        for step_s in [0.001, 0.01, 0.02] {
            let found = faults(step_s, |time_s| {
                let mut speeds = in_gear(time_s);
                if time_s > 1.0 && time_s < 2.5 {
                    speeds[at] = speeds[other];
                }
                speeds
            });
            let rows = 1.5 / step_s;
            let count = found[at].len() as f64;
            assert!(count >= rows - 2.0 && count <= rows, "{at} {other} {step_s}: {count}");
            assert!((0..WATCHED).all(|speed| speed == at || found[speed].is_empty()), "{at} {other}: {found:?}");
        }
    }
}

#[test]
fn a_turbine_that_shows_the_output_is_believed_once_a_shift_into_the_direct_gear_may_have_brought_it_there() {
    let shift = |begin_s: f64, end_s: f64| {
        faults(0.01, |time_s| {
            let [_, _, output, wheel] = in_gear(time_s);
            let slips = 1.0 - ((time_s - begin_s) / (end_s - begin_s)).clamp(0.0, 1.0);
            let turbine = output * (1.0 + 1.5 * slips);
            let is_wrong = time_s > 2.0 && time_s < 2.5;
            [turbine + 30.0, if is_wrong { output } else { turbine }, output, wheel]
        })
    };
    // The shift ends while the turbine is wrong: what it reads at the end and afterwards is right.
    let [engine, turbine, output, wheel] = shift(1.9, 2.3);
    assert!(engine.is_empty() && output.is_empty() && wheel.is_empty());
    assert!(turbine.len() >= 30 && turbine.iter().all(|time_s| *time_s < 2.51 + GONE_S), "{turbine:?}");
    // No shift: the engine does not go along.
    let [_, turbine, ..] = shift(5.0, 5.5);
    assert!((48..=50).contains(&turbine.len()), "{turbine:?}");
}

#[test]
fn a_turbine_that_shows_the_output_in_a_shift_is_believed_again_only_where_the_shift_goes_to_the_direct_gear() {
    // The engine goes along, and the shift is over before the turbine is right again.
    let rows = |ratios: &[f64], [before, after]: [f64; 2]| {
        let mut watch = SpeedFaults::of_gearbox(ratios);
        let is_fault = |row: u32| {
            let time_s = 0.01 * f64::from(row);
            let output = 100.0 + 5.0 * time_s;
            let shifted = ((time_s - 1.0) / 0.5).clamp(0.0, 1.0);
            let turbine = output * (before + (after - before) * shifted);
            let shown = if time_s > 1.05 && time_s < 3.0 { output } else { turbine };
            let speeds = ROLES.into_iter().zip([turbine + 20.0, shown, output, output / 3.5]);
            speeds.filter(|(role, speed)| watch.is_fault(*role, [*speed, time_s], || Fit::None)).count()
        };
        (0..500).map(is_fault).sum::<usize>()
    };
    let (without, with) = ([4.17, 2.34, 1.52, 1.14, 0.87, 0.69], [4.7, 3.13, 2.1, 1.67, 1.28, 1.0, 0.84, 0.67]);
    assert_eq!(rows(&without, [2.34, 1.52]), 194);
    assert_eq!(rows(&with, [2.1, 1.67]), 194);
    assert!(rows(&with, [1.28, 1.0]) < 60);
    assert!(rows(&[], [2.34, 1.52]) < 194);
}

#[test]
fn a_turbine_without_a_converter_that_shows_a_slow_output_is_a_fault_and_so_are_no_right_readings() {
    let noise = |factor: f64, time_s: f64| 0.3 * (factor * time_s).sin();
    let found = faults(0.01, |time_s| {
        let [engine, turbine, output] = [731.0, 517.0, 977.0].map(|factor| noise(factor, time_s));
        let shown = if time_s > 1.0 && time_s < 1.2 { 21.0 + output } else { 97.0 + turbine };
        [97.0 + engine, shown, 21.0 + output, 21.0 / 3.5]
    });
    assert!((18..=20).contains(&found[TURBINE].len()), "{:?}", found[TURBINE]);
    assert!([ENGINE, OUTPUT, WHEEL].iter().all(|at| found[*at].is_empty()), "{found:?}");
}

#[test]
fn a_zero_without_end_is_a_fault_while_the_other_speeds_contradict_it() {
    for at in [TURBINE, OUTPUT, WHEEL] {
        let found = faults(0.01, |time_s| {
            let mut speeds = in_gear(time_s);
            if time_s > 1.0 {
                speeds[at] = 0.0;
            }
            speeds
        });
        assert!(found[at].len() >= 498, "{at}: {}", found[at].len());
    }
}

#[test]
fn a_car_that_stops_an_engine_that_stalls_and_a_hard_shift_are_no_faults() {
    let stops = |time_s: f64| {
        // 11 m/s^2 on the wheels of 0.3 m; sensors read zero below 2 rad/s of the wheel.
        let wheel = (70.0 - 37.0 * time_s).max(0.0);
        let wheel = if wheel < 2.0 { 0.0 } else { wheel };
        let turbine = 3.5 * 4.7 * wheel;
        [turbine.max(80.0), turbine, 3.5 * wheel, wheel]
    };
    let stalls = |time_s: f64| {
        let engine = (90.0 - 900.0 * (time_s - 1.0).max(0.0)).max(0.0);
        [engine, 0.0, 0.0, 0.0]
    };
    // Down in 60 ms, with slip zero in one row.
    let grips = |time_s: f64| {
        let output = 100.0 + 5.0 * time_s;
        let slip = (1.6 * output - output) * (1.0 - (time_s - 1.0).clamp(0.0, 0.06) / 0.06);
        [1.7 * output, output + slip, output, output / 3.5]
    };
    let locks = |time_s: f64| {
        let locked = (time_s - 1.0).clamp(0.0, 0.07) / 0.07;
        let wheel = if time_s < 2.0 { 60.0 * (1.0 - locked) } else { 60.0 };
        [200.0, 200.0, 3.5 * wheel, wheel]
    };
    let neutral = |time_s: f64| [80.0, if time_s > 1.0 { 80.0 } else { 0.0_f64.max(80.0 * time_s) }, 0.0, 0.0];
    for step_s in [0.001, 0.005, 0.01, 0.02] {
        assert!(faults(step_s, stops).iter().all(Vec::is_empty), "stops {step_s}");
        assert!(faults(step_s, stalls).iter().all(Vec::is_empty), "stalls {step_s}");
        assert!(faults(step_s, grips).iter().all(Vec::is_empty), "grips {step_s}");
        assert!(faults(step_s, neutral).iter().all(Vec::is_empty), "neutral {step_s}");
        let [engine, turbine, ..] = faults(step_s, locks);
        assert!(engine.is_empty() && turbine.is_empty(), "locks {step_s}");
    }
}

#[test]
fn two_recordings_that_are_joined_go_on_after_the_longest_fault() {
    let joined = |time_s: f64| if time_s < 1.0 { in_gear(time_s) } else { [80.0, 0.0, 0.0, 0.0] };
    for (at, rows) in faults(0.01, joined).iter().enumerate() {
        assert!(rows.last().is_none_or(|last_s| *last_s < 1.0 + LONGEST_S + 0.02), "{at}: {:?}", rows.last());
    }
    // A clock that begins anew is another log.
    let mut watch = SpeedFaults::new();
    assert!(!watch.is_fault(Role::OutputSpeed, [100.0, 10.0], || Fit::None));
    assert!(!watch.is_fault(Role::OutputSpeed, [0.0, 0.0], || Fit::None));
}

#[test]
fn what_is_no_speed_is_left_to_others_and_believed_by_none() {
    let mut watch = SpeedFaults::new();
    for (row, value) in (0_u32..).zip([16_383.75, f64::NAN, f64::INFINITY, 100.0, 100.5, 16_383.75, 101.0]) {
        assert!(!watch.is_fault(Role::TurbineSpeed, [value, 0.01 * f64::from(row)], || Fit::None), "{value}");
    }
    assert!(
        !watch.is_fault(Role::VehicleSpeed, [0.0, 0.1], || Fit::None)
            && !watch.is_fault(Role::Gear, [5.0, 0.1], || Fit::None)
    );
}

#[test]
fn a_speed_that_jumps_is_a_fault_until_it_jumps_back() {
    let jumps = [[80.0, 250.0, -100.0], [80.0, 250.0, -100.0], [30.0, 60.0, -60.0], [25.0, 40.0, -24.0]];
    for (at, by) in (0..WATCHED).flat_map(|at| jumps[at].map(|by| (at, by))) {
        for (step_s, length_s) in
            [0.001, 0.01, 0.02].into_iter().flat_map(|step_s| [0.1, 0.5, 2.0].map(|l| (step_s, l)))
        {
            let is_out = |time_s: f64| time_s > 1.0 && time_s < 1.0 + length_s;
            // The factor 0 is a change of sign.
            for factor in [0.0, 1.0] {
                let found = faults(step_s, |time_s| {
                    let mut speeds = in_gear(time_s);
                    if is_out(time_s) {
                        speeds[at] = if factor == 0.0 { -speeds[at] } else { speeds[at] + by };
                    }
                    speeds
                });
                let name = format!("{at} {by} {step_s} {length_s} {factor}");
                assert!((0..WATCHED).all(|other| other == at || found[other].is_empty()), "{name}: {found:?}");
                assert!(found[at].iter().all(|time_s| is_out(*time_s)), "{name}: {:?}", found[at].last());
                let all = (0..).map(|i| step_s * f64::from(i)).take_while(|time_s| *time_s < 6.0);
                assert_eq!(found[at].len(), all.filter(|time_s| is_out(*time_s)).count(), "{name}");
            }
        }
    }
}

#[test]
fn a_recording_that_goes_on_elsewhere_is_believed_soon() {
    for moves in [[-90.0, -110.0, -60.0, -20.0], [150.0, 140.0, 90.0, 25.0], [-60.0, -90.0, 0.0, 0.0]] {
        let found = faults(0.01, |time_s| {
            let mut speeds = in_gear(time_s);
            for (speed, by) in speeds.iter_mut().zip(moves).filter(|_| time_s > 1.0) {
                *speed += by;
            }
            speeds
        });
        for (at, rows) in found.iter().enumerate() {
            assert!(rows.iter().all(|time_s| *time_s < 1.01 + FRESH_S), "{moves:?} {at}: {:?}", rows.last());
        }
    }
}

#[test]
fn a_jump_that_lasts_is_believed_at_last_and_so_is_the_way_back() {
    let found = faults(0.01, |time_s| {
        let [engine, turbine, output, wheel] = in_gear(time_s);
        [engine, turbine + if time_s > 1.0 && time_s < 4.5 { 100.0 } else { 0.0 }, output, wheel]
    });
    let (first, then): (Vec<f64>, Vec<f64>) = found[TURBINE].iter().partition(|time_s| **time_s < 4.0);
    assert!(first.len() >= 249 && first.iter().all(|time_s| *time_s < 1.0 + LONGEST_S + 0.03), "{first:?}");
    assert!(then.len() <= 5, "{then:?}");
}
