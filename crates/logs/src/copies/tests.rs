//! Copies of speeds in made-up readings with the noise of sensors.

use super::*;

/// The rows in which a speed is withdrawn, of engine and turbine every 10 ms.
fn found(speeds: impl Fn(u32) -> [f64; 2]) -> Vec<(u32, Role, f64)> {
    found_every(0.01, speeds)
}

/// The same in rows so far apart, s.
fn found_every(step_s: f64, speeds: impl Fn(u32) -> [f64; 2]) -> Vec<(u32, Role, f64)> {
    let mut copies = Copies::new();
    let mut all = Vec::new();
    for row in 0..600 {
        let (time_s, [engine, turbine]) = (step_s * f64::from(row), speeds(row));
        assert_eq!(copies.push(Role::EngineSpeed, [engine, time_s], false), [None; 2]);
        let copy = copies.push(Role::TurbineSpeed, [turbine, time_s], false);
        all.extend(copy.into_iter().flatten().map(|(role, [right, _])| (row, role, right)));
    }
    all
}

/// With noise of two sensors, 12 rad/s apart.
fn apart(row: u32) -> [f64; 2] {
    let noise = |factor: f64| 0.1 * (factor * f64::from(row)).sin();
    [200.0 + 0.1 * f64::from(row) + noise(7.3), 188.0 + 0.1 * f64::from(row) + noise(5.1)]
}

#[test]
fn a_channel_that_shows_the_speed_next_to_it_is_found_by_its_digits() {
    for (which, role) in [(0, Role::EngineSpeed), (1, Role::TurbineSpeed)] {
        let rows = found(|row| {
            let mut speeds = apart(row);
            if (200..300).contains(&row) {
                speeds[which] = speeds[1 - which];
            }
            speeds
        });
        assert_eq!(rows.iter().map(|(row, ..)| *row).collect::<Vec<_>>(), (202..300).collect::<Vec<_>>());
        assert!(rows.iter().all(|(_, found, right)| *found == role && *right == apart(199)[which]), "{rows:?}");
    }
}

/// Times that are products, or are read from a file, are up to a rounding more than 50 ms apart.
#[test]
fn rows_at_20_hz_are_close_enough_whatever_the_last_digits_of_their_times_are() {
    for from in 200..240 {
        let rows = found_every(0.05, |row| {
            let [engine, turbine] = apart(row);
            [if (from..from + 40).contains(&row) { turbine } else { engine }, turbine]
        });
        assert!(rows.len() >= 38 && rows.iter().all(|(_, role, _)| *role == Role::EngineSpeed), "{from}: {rows:?}");
    }
}

#[test]
fn of_two_speeds_that_rise_fast_the_copy_is_the_one_that_leaves_its_line() {
    // Both rise by 2.5 rad/s a row: the engine that shows the turbine falls by as much as that rises.
    let rises = |row: u32| apart(row).map(|speed| speed + 2.5 * f64::from(row.max(150) - 150));
    let rows = found(|row| {
        let [engine, turbine] = rises(row);
        let [engine, turbine] = [engine - 7.0, turbine];
        [if (200..300).contains(&row) { turbine } else { engine }, turbine]
    });
    assert!(rows.iter().all(|(_, role, _)| *role == Role::EngineSpeed) && rows.len() >= 98, "{rows:?}");
}

/// In the direct gear a clutch with weak plates slips longer than the controller waits; then its command rises, and it sticks within one row. Both
/// shafts go to each other.
#[test]
fn a_clutch_that_sticks_at_once_makes_no_copy() {
    // Turbine and output of simulated cars before and after it, rad/s.
    let sticks: [&[[f64; 2]]; 2] = [
        &[
            [163.8368, 157.6499],
            [163.0874, 157.6742],
            [162.5043, 157.7948],
            [162.0618, 157.9808],
            [161.7259, 158.1603],
            [161.4539, 158.2738],
            [161.2307, 158.3258],
            [161.0896, 158.3866],
            [161.1050, 158.4626],
            [161.2141, 158.6414],
            [159.9700, 159.9700],
            [159.7080, 159.7080],
        ],
        &[
            [181.2462, 176.4095],
            [180.9522, 176.4659],
            [180.6818, 176.5235],
            [180.4274, 176.5788],
            [180.1890, 176.6334],
            [179.9663, 176.6916],
            [179.7560, 176.7540],
            [179.5328, 176.8054],
            [179.2483, 176.8171],
            [179.0166, 176.8310],
            [178.8499, 176.9358],
            [177.5936, 177.5936],
        ],
    ];
    for last in sticks {
        let [turbine, output] = last[0];
        let speeds = |row: u32| match row.checked_sub(400) {
            None => [turbine + 0.3 * f64::from(400 - row), output - 0.05 * f64::from(400 - row)],
            Some(later) => last.get(later as usize).copied().unwrap_or_else(|| {
                let [shaft, _] = last[last.len() - 1];
                [shaft + 0.2 * f64::from(later); 2]
            }),
        };
        let mut copies = Copies::new();
        for row in 0..600 {
            let time_s = 0.01 * f64::from(row);
            for (role, value) in [Role::TurbineSpeed, Role::OutputSpeed].into_iter().zip(speeds(row)) {
                assert_eq!(copies.push(role, [value, time_s], false), [None; 2], "{row} {last:?}");
            }
        }
    }
}

#[test]
fn shafts_that_come_together_are_no_copies() {
    // A lock-up clutch closes in 0.2 s and opens at once; both are then one shaft.
    let locks = |row: u32| {
        let [engine, _] = apart(row);
        let slip = if row < 400 { (12.0 - 0.6 * f64::from(row.max(200) - 200)).max(0.0) } else { 12.0 };
        [engine, engine - slip]
    };
    assert_eq!(found(locks), []);
    // Whole revolutions a minute, 1 rpm a row; and the speeds of a car that stands.
    assert_eq!(found(|row| [900.0, f64::from(600 + row.min(300))]), []);
    assert_eq!(found(|row| if row < 200 { apart(row) } else { [0.0, 0.0] }), []);
    // One jump of both, as where a recording goes on elsewhere.
    assert_eq!(found(|row| if row < 200 { apart(row) } else { [120.0, 120.0 + f64::from(row % 2)] }), []);
}

#[test]
fn a_copy_in_an_inertia_phase_is_found() {
    // The turbine falls by 3 rad/s a row, ever faster, away from the engine.
    let shifts = |row: u32| {
        let (time, [engine, turbine]) = (f64::from(row.max(200) - 200), apart(row));
        [engine, turbine - (3.0 * time + 0.02 * time * time).min(80.0)]
    };
    let rows = found(|row| {
        let [engine, turbine] = shifts(row);
        [engine, if (206..226).contains(&row) { engine } else { turbine }]
    });
    assert_eq!(rows.iter().map(|(row, ..)| *row).collect::<Vec<_>>(), (208..226).collect::<Vec<_>>());
    assert_eq!(found(shifts), []);
}

#[test]
fn a_clutch_that_grips_hard_makes_no_copy() {
    // The slip falls ever faster, and ends within a row.
    for per_row in [5.0, 9.0, 17.0] {
        let grips = |row: u32| {
            let [engine, _] = apart(row);
            let time = f64::from(row.max(200) - 200);
            [engine, engine - (100.0 - per_row * time - 0.3 * time * time).max(0.0)]
        };
        assert_eq!(found(grips), [], "{per_row}");
    }
}

#[test]
fn coarse_readings_of_two_noisy_speeds_agree_by_chance() {
    let noise = |row: u32, factor: u32| f64::from(row * row % 1009 * factor % 1009) / 1009.0 - 0.5;
    for resolution in [0.026, 0.1, 0.5] {
        let coarse = |speed: f64| (speed / resolution).round() * resolution;
        let speeds = |row: u32| {
            // They come together and part every 40 rows.
            let slip = if (row / 40).is_multiple_of(2) { 0.0 } else { 6.0 };
            let engine = 200.0 + 0.02 * f64::from(row) + noise(row, 7);
            [coarse(engine), coarse(200.0 - slip + 0.02 * f64::from(row) + noise(row, 11))]
        };
        assert!(found(speeds).len() <= 3, "{resolution}: {:?}", found(speeds));
    }
}

#[test]
fn a_channel_that_shows_the_speed_of_any_other_shaft_is_found() {
    let mut copies = Copies::new();
    let mut rows = Vec::new();
    for row in 0..300_u32 {
        let (time_s, [engine, turbine]) = (0.01 * f64::from(row), apart(row));
        let wheel = 0.1 * turbine + 0.01 * (2.1 * f64::from(row)).sin();
        let shown = if (200..250).contains(&row) { wheel } else { engine };
        let speeds = [shown, turbine, 0.4 * turbine, wheel];
        for (role, speed) in Role::SPEEDS.into_iter().zip(speeds) {
            let copied = copies.push(role, [speed, time_s], false);
            rows.extend(copied.into_iter().flatten().map(|(role, _)| (row, role)));
        }
    }
    assert_eq!(rows, (202..250).map(|row| (row, Role::EngineSpeed)).collect::<Vec<_>>());
}

/// The rows in which turbine or output speed is withdrawn; both turn together until the turbine falls by 1 rad/s a row from row 320 on.
fn found_in_direct_gear(shown: impl Fn(u32, [f64; 3]) -> [f64; 3]) -> Vec<(u32, Role)> {
    let mut copies = Copies::new();
    let mut all = Vec::new();
    for row in 0..500_u32 {
        let noise = |factor: f64| 0.1 * (factor * f64::from(row)).sin();
        let output = 150.0 + 0.02 * f64::from(row);
        let turbine = output - f64::from(row.clamp(320, 370) - 320);
        let speeds = shown(row, [turbine + noise(7.3), output + noise(5.1), 0.3 * output + noise(3.7)]);
        let roles = [Role::TurbineSpeed, Role::OutputSpeed, Role::WheelSpeed];
        for (role, speed) in roles.into_iter().zip(speeds) {
            let copied = copies.push(role, [speed, 0.01 * f64::from(row)], false);
            all.extend(copied.into_iter().flatten().map(|(role, _)| (row, role)));
        }
    }
    all
}

#[test]
fn wheels_tell_which_of_two_equal_speeds_is_a_copy_in_the_direct_gear() {
    let fails = |row: u32| (300..400).contains(&row);
    assert_eq!(found_in_direct_gear(|_, right| right), []);
    // The turbine shows the output: found at the fifth equal reading.
    let rows = found_in_direct_gear(|row, [t, o, w]| [if fails(row) { o } else { t }, o, w]);
    assert_eq!(rows, (304..400).map(|row| (row, Role::TurbineSpeed)).collect::<Vec<_>>());
    // The output shows the turbine: which of both it is shows when they leave the wheels by more than tyres slip.
    let rows = found_in_direct_gear(|row, [t, o, w]| [t, if fails(row) { t } else { o }, w]);
    let output = rows.iter().filter(|(_, role)| *role == Role::OutputSpeed).map(|(row, _)| *row).collect::<Vec<_>>();
    assert_eq!(output, (output[0]..400).collect::<Vec<_>>());
    assert!((322..332).contains(&output[0]), "{}", output[0]);
}

/// The rows in which engine or turbine speed is withdrawn, with a gear of 1.5 until row 340, and of 1.2 from row 380 on: meanwhile the lock-up
/// clutch is open, and the engine 20 rad/s faster.
fn found_behind_lock_up(shown: impl Fn(u32, [f64; 2]) -> [f64; 2]) -> Vec<(u32, Role)> {
    let mut copies = Copies::new();
    let mut all = Vec::new();
    for row in 0..500_u32 {
        let noise = |factor: f64| 0.1 * (factor * f64::from(row)).sin();
        let shifted = f64::from(row.clamp(340, 380) - 340) / 40.0;
        let output = 100.0 + 0.02 * f64::from(row);
        let turbine = (1.5 - 0.3 * shifted) * output;
        let engine = turbine + f64::from(row.clamp(320, 330) - 320) * 2.0;
        let [engine, turbine] = shown(row, [engine + noise(7.3), turbine + noise(5.1)]);
        let roles = [Role::EngineSpeed, Role::TurbineSpeed, Role::OutputSpeed];
        for (role, speed) in roles.into_iter().zip([engine, turbine, output + noise(3.7)]) {
            let copied = copies.push(role, [speed, 0.01 * f64::from(row)], false);
            all.extend(copied.into_iter().flatten().map(|(role, _)| (row, role)));
        }
    }
    all
}

#[test]
fn of_two_equal_speeds_behind_a_lock_up_clutch_none_is_believed_beyond_the_gear() {
    let fails = |row: u32| (300..400).contains(&row);
    let rows_of = |rows: &[(u32, Role)], of: Role| -> Vec<u32> {
        rows.iter().filter(|(_, role)| *role == of).map(|(row, _)| *row).collect()
    };
    assert_eq!(found_behind_lock_up(|_, right| right), []);
    // The engine shows the turbine: as long as that turns with the output it is right, and in the shift it may be the engine's.
    let rows = found_behind_lock_up(|row, [e, t]| [if fails(row) { t } else { e }, t]);
    assert_eq!(rows_of(&rows, Role::EngineSpeed), (304..400).collect::<Vec<_>>());
    let turbine = rows_of(&rows, Role::TurbineSpeed);
    assert!((341..345).contains(&turbine[0]) && turbine.ends_with(&[399]), "{turbine:?}");
    // The turbine shows the engine: it is not believed once the lock-up clutch opens.
    let rows = found_behind_lock_up(|row, [e, t]| [e, if fails(row) { e } else { t }]);
    assert_eq!(rows_of(&rows, Role::EngineSpeed), (304..400).collect::<Vec<_>>());
    let turbine = rows_of(&rows, Role::TurbineSpeed);
    assert!((321..323).contains(&turbine[0]) && turbine.ends_with(&[399]), "{turbine:?}");
}

#[test]
fn a_control_unit_may_send_one_value_behind_a_lock_up_clutch() {
    // The slip of 12 rad/s ends within 50 to 400 ms, ever faster.
    for rows in [5, 10, 20, 40] {
        let closes = |row: u32| {
            let passed = f64::from(row.max(200) - 200) / f64::from(rows);
            12.0 * (1.0 - 0.7 * passed - 0.3 * passed * passed).max(0.0)
        };
        let one = |row: u32, [e, t]: [f64; 2]| if closes(row) > 0.0 { [e + closes(row), t] } else { [e, e] };
        assert_eq!(found_behind_lock_up(one), [], "{rows}");
    }
    // From the row on in which the slip that it controls ends.
    let one = |row: u32, [e, t]: [f64; 2]| if row < 200 { [e + 2.0, t] } else { [e, e] };
    assert_eq!(found_behind_lock_up(one), []);
    // As coarse as the noise.
    let coarse = |_, right: [f64; 2]| right.map(|speed| (speed / 0.1).round() * 0.1);
    assert_eq!(found_behind_lock_up(coarse), []);
}

#[test]
fn a_control_unit_may_send_one_value_in_the_direct_gear() {
    // From the first row in the gear on: what comes before it is a passage.
    let one = |row: u32, [t, o, w]: [f64; 3]| if row < 60 { [t - 0.5 * f64::from(60 - row), o, w] } else { [o, o, w] };
    assert_eq!(found_in_direct_gear(one), []);
    // Without a wheel speed nothing tells which of both is wrong.
    let copies = |row: u32, [t, o, _]: [f64; 3]| [if row < 300 { t } else { o }, o, f64::NAN];
    assert_eq!(found_in_direct_gear(copies), []);
}

#[test]
fn a_copy_is_believed_in_the_end() {
    let rows = found(|row| if row < 200 { apart(row) } else { [apart(row)[0]; 2] });
    let last = rows.last().map(|(row, ..)| 0.01 * f64::from(*row - 200)).unwrap_or_default();
    assert!((LONGEST_S - 0.03..=LONGEST_S).contains(&last), "{last}");
}
