//! Mass, road load and the reported engine torque from driving between shifts.

use car::ShiftCommand;
use std::ops::ControlFlow::Continue;

use fit::gearbox::{Driving, GearboxFit, Quantity, Recorded, Recorder, fit};
use fit::{ReadingAges, Verdict};
use observer::Reading;
use observer::gearbox::ShiftInput;

use super::drawn::{self, Case, Drawn, FittedFile as _, car, city, hilly};

/// Of a car drawn by this seed, with a reported engine torque.
fn drawn_with_reported(seed: u64) -> Drawn {
    Drawn::of(car("eight_speed.toml"), seed, Case::Usual).with_reported(Case::Usual)
}

/// A row of a log.
#[derive(Clone, Copy)]
struct Row {
    time_s: f64,
    input: ShiftInput<f64>,
    reported: Option<Reading<f64>>,
}

/// Some minutes in town on a road with hills.
fn rows(drawn: &Drawn) -> Vec<Row> {
    let mut rows = Vec::new();
    drawn.each_reported(
        &hilly(&city(1), drawn.seed),
        |_| (),
        |time_s, input, reported| rows.push(Row { time_s, input: *input, reported }),
    );
    rows
}

fn recorded(drawn: &Drawn, rows: &[Row]) -> Recorded {
    let tables = drawn.tables();
    let mut recorder = Recorder::new(&drawn.file, &tables, ReadingAges::of(&drawn::sensors()));
    for row in rows {
        recorder.push_reported(row.reported);
        recorder.push(row.time_s, &row.input);
    }
    recorder.finish()
}

fn fitted(drawn: &Drawn, recorded: &Recorded) -> GearboxFit {
    fit(&drawn.file, &drawn.tables(), &recorded.shifts, &recorded.driving, &mut |_| Continue(())).unwrap()
}

/// The fit of rows after a change of each of them, and what it says.
fn changed(drawn: &Drawn, rows: &[Row], change: impl Fn(usize, &mut Row)) -> (GearboxFit, String) {
    let mut rows = rows.to_vec();
    rows.iter_mut().enumerate().for_each(|(at, row)| change(at, row));
    let fit = fitted(drawn, &recorded(drawn, &rows));
    let said = fit.statements().join("\n");
    (fit, said)
}

/// Standard deviation of the common factor of all torques, known within `before`, with at least half of what another quantity tells of it:
/// one that is known within
/// `anchor` with its ratio to that factor. It does not tell all, because each of the other torques has a part in the factor.
fn with_half_of(anchor: f64, before: f64) -> f64 {
    (before.powi(-2) + 0.5 * anchor.powi(-2)).sqrt().recip()
}

#[test]
fn mass_and_the_scale_of_the_reported_torque_lie_in_their_intervals() {
    for seed in [21, 22] {
        let drawn = drawn_with_reported(seed);
        let tables = drawn.tables();
        let (recorded, _) = drawn.driven(&hilly(&city(2), seed));
        assert!(recorded.driving.time_s() > 150.0, "{}", recorded.driving.time_s());
        let (without, with) = (
            fit(&drawn.file, &tables, &recorded.shifts, &Driving::default(), &mut |_| Continue(())).unwrap(),
            fitted(&drawn, &recorded),
        );
        let of_driving = [Quantity::Mass, Quantity::ReportedScale, Quantity::EngineInertia, Quantity::ReportedDelay];
        for quantity in of_driving.into_iter().chain([Quantity::Input, Quantity::Rolling, Quantity::Air]) {
            let error = with.unknown(quantity) - drawn.true_unknown(&tables, &with.quantities, quantity);
            let sd = with.sd(quantity);
            assert!(error.abs() <= 2.0 * sd, "{seed} {quantity:?}: {error} {sd}");
        }
        assert_ne!(with.verdict(Quantity::Mass), Verdict::NotIdentifiable, "{seed}");
        // Not what verdicts call "not identified".
        let before = with.quantities.sd_before(with.quantities.place(Quantity::Mass).unwrap());
        assert!(with.sd_beside_scale(Quantity::Mass) < 0.7 * before, "{}", with.sd_beside_scale(Quantity::Mass));
        // More is known of the common factor of all torques.
        let place = with.quantities.place(Quantity::ReportedScale).unwrap();
        let anchor = with.quantities.sd_before(place).hypot(with.sd_beside_scale(Quantity::ReportedScale));
        let maximum = with_half_of(anchor, without.torque_scale_sd());
        assert!(with.torque_scale_sd() < maximum && with.is_converged, "{} {maximum}", with.torque_scale_sd());
        assert!(without.report().iter().all(|row| row.name != "mass") && without.unknown(Quantity::Mass) == 0.0);
        let file = with.vehicle_file(&drawn.file, &drawn.file.source.path, "a drive", None).unwrap();
        let factor = with.unknown(Quantity::Mass).exp();
        assert!((file.road.mass_kg / drawn.file.road.mass_kg / factor - 1.0).abs() < 1e-3);
        assert!(file.error_bounds.mass_share.is_some_and(|fraction| fraction < 0.25), "{:?}", file.error_bounds);
        // What is not identified stays as it is in the text.
        for (quantity, key) in
            [(Quantity::EngineInertia, "inertia_kg_m2 = "), (Quantity::Rolling, "rolling_moment_n_m")]
        {
            assert_eq!(with.verdict(quantity), Verdict::NotIdentifiable, "{quantity:?}");
            let given = drawn.file.source.text.lines().find(|line| line.starts_with(key)).unwrap();
            assert!(file.source.text.lines().any(|line| line == given), "{given}");
        }
    }
}

/// A mass that is known to a percent makes the common factor of all torques known better. The reversals of the torque in town tell the backlash.
#[test]
fn a_weighed_car_tells_the_common_factor_of_all_torques_and_reversals_the_backlash() {
    let drawn = Drawn::of(car("eight_speed.toml"), 23, Case::Usual).with_backlash();
    let (recorded, _) = drawn.driven(&hilly(&city(2), 23));
    let usual = fitted(&drawn, &recorded);
    let backlash = usual.backlash.clone().unwrap();
    let error = backlash.rad - drawn.truth.backlash_rad;
    assert!(error.abs() < 2.0 * backlash.sd_rad && backlash.sd_rad < 0.006, "{error} {backlash:?}");
    let file = usual.vehicle_file(&drawn.file, &drawn.file.source.path, "a drive", None).unwrap();
    assert!((file.backlash_rad - backlash.rad).abs() < 1e-4, "{}", file.backlash_rad);
    let drawn = drawn.weighed();
    let fits = [usual, fitted(&drawn, &recorded)];
    // A normal distribution of mass and factor given a mass: by their covariance in the first fit the factor follows the mass, and the rest stays.
    let [scale, weighed] = fits.each_ref().map(|fit| fit.torque_scale_sd());
    let (mass, beside) = (fits[0].sd(Quantity::Mass), fits[0].sd_beside_scale(Quantity::Mass));
    let covariance = 0.5 * (mass * mass + scale * scale - beside * beside);
    let known = fits[1].sd(Quantity::Mass);
    let follows = covariance / (mass * mass);
    let expected = (scale * scale - follows * covariance + (follows * known).powi(2)).sqrt();
    // What is stated has floors beside, 1.5 % of the mass among them.
    assert!((weighed / expected - 1.0).abs() < 0.1 && expected < 0.85 * scale, "{scale} {weighed} {expected}");
    let error = fits.each_ref().map(|fit| {
        fit.unknown(Quantity::Input) - drawn.true_unknown(&drawn.tables(), &fit.quantities, Quantity::Input)
    });
    assert!(error[1].abs() <= 2.0 * fits[1].sd(Quantity::Input), "{error:?}");
}

#[test]
fn a_reported_torque_that_is_none_is_left_out_and_said() {
    let drawn = drawn_with_reported(24);
    let rows = rows(&drawn);
    let (without, said) = changed(&drawn, &rows, |_, row| row.reported = None);
    assert!(said.contains("no reported engine torque is used: the logs have no reported"), "{said}");
    let torque = |row: &mut Row, change: &dyn Fn(f64) -> f64| {
        row.reported = row.reported.map(|reading| Reading { value: change(reading.value), ..reading });
    };
    for (case, words, change) in [
        ("frozen", "it is frozen", (|_| 80.0) as fn(f64) -> f64),
        ("wrong sign", "does not follow the converter", |torque| -torque),
        ("ten times too large", "does not follow the converter", |torque| 10.0 * torque),
        ("not a number", "the logs have no reported", |_| f64::NAN),
    ] {
        let (fit, said) = changed(&drawn, &rows, |_, row| torque(row, &change));
        assert!(said.contains(words), "{case}: {said}");
        // Nothing of it is in the other values.
        assert_eq!(fit.unknowns, without.unknowns, "{case}");
    }
    let (fit, said) = changed(&drawn, &rows, |_, _| ());
    assert!(said.contains("the reported engine torque is used in "), "{said}");
    assert!(fit.at_limit.is_empty() && fit.is_converged, "{:?}", fit.at_limit);
}

#[test]
fn a_log_without_driving_says_that_mass_is_not_identified() {
    let drawn = Drawn::of(car("eight_speed.toml"), 25, Case::Usual);
    let rows = rows(&drawn);
    let (usual, said) = changed(&drawn, &rows, |_, _| ());
    assert!(said.contains("mass and road load from ") && said.contains("no reported engine torque is used"), "{said}");
    let alone =
        fit(&drawn.file, &drawn.tables(), &recorded(&drawn, &rows).shifts, &Driving::default(), &mut |_| Continue(()))
            .unwrap();
    let said = alone.statements().join("\n");
    assert!(said.contains("mass and road load are not identified by these logs: 0 s of driving"), "{said}");
    assert_eq!(alone.quantities.place(Quantity::Mass), None);
    assert!(alone.report().iter().all(|row| row.name != "mass"));
    // A wheel speed that is off is not used.
    let (wheel, _) = changed(&drawn, &rows, |_, row| {
        let off = |reading: Reading<f64>| Reading { value: 1.01 * reading.value, ..reading };
        row.input.wheel_rad_s = row.input.wheel_rad_s.map(off);
    });
    assert_eq!(wheel.unknowns, usual.unknowns);
}

/// At constant speed nothing changes that could tell mass and grade apart.
#[test]
fn constant_speed_in_one_gear_tells_no_mass() {
    let drawn = Drawn::of(car("eight_speed.toml"), 26, Case::Usual);
    let shifts = recorded(&drawn, &rows(&drawn)).shifts;
    let tables = drawn.tables();
    let gear = drawn.file.gearbox.gear("4").unwrap();
    let ratio = drawn.file.gearbox.gears[gear].ratio;
    let driving = |count: usize, output: f64| {
        let mut recorder = Recorder::new(&drawn.file, &tables, ReadingAges::default());
        for at in 0..count {
            // A noise that any reading has.
            let noise = 0.1 * (1.7 * (at * at % 101) as f64).sin();
            let reading = |value: f64| Some(Reading::now(value + noise));
            let input = ShiftInput {
                dt_s: 0.01,
                engine_rad_s: reading(ratio * output / 0.9),
                turbine_rad_s: reading(ratio * output),
                output_rad_s: reading(output),
                wheel_rad_s: None,
                engine_n_m: None,
                acceleration_m_s2: None,
                lock_up_applied: false,
                commands: [None; 8],
                gear: ShiftCommand::between(gear, gear),
            };
            recorder.push(0.01 * at as f64, &input);
        }
        recorder.finish().driving
    };
    let constant = driving(6000, 100.0);
    assert!(constant.time_s() > 55.0, "{}", constant.time_s());
    let fit = fit(&drawn.file, &tables, &shifts, &constant, &mut |_| Continue(())).unwrap();
    assert_eq!(fit.verdict(Quantity::Mass), Verdict::NotIdentifiable, "{}", fit.sd(Quantity::Mass));
    assert!(fit.unknown(Quantity::Mass).abs() < 0.05, "{}", fit.unknown(Quantity::Mass));
    // Standing with the engine above idle, and one row.
    for (count, output) in [(6000, 0.0), (1, 100.0), (0, 100.0)] {
        assert_eq!(driving(count, output).time_s(), 0.0, "{count} {output}");
    }
}

/// Times that go back or stand still, gears of no gearbox and speeds without sense are no panic and no driving.
#[test]
fn what_no_car_does_is_no_driving() {
    let drawn = drawn_with_reported(27);
    let rows = rows(&drawn);
    let usual_s = recorded(&drawn, &rows).driving.time_s();
    let driving = |change: &dyn Fn(usize, &mut Row)| {
        let mut rows = rows.clone();
        rows.iter_mut().enumerate().for_each(|(at, row)| change(at, row));
        recorded(&drawn, &rows).driving.time_s()
    };
    assert_eq!(driving(&|_, row| row.time_s = 1.0), 0.0);
    assert_eq!(driving(&|_, row| row.input.gear = ShiftCommand::NEUTRAL), 0.0);
    assert_eq!(driving(&|_, row| row.input.turbine_rad_s = Some(Reading::now(1e300))), 0.0);
    assert_eq!(driving(&|_, row| row.input.lock_up_applied = true), 0.0);
    assert_eq!(driving(&|_, row| row.input.engine_rad_s = None), 0.0);
    // A recorder that was stopped for a minute or a day while the engine pulled, a clock that was set, and one time of another clock.
    for hole_s in [60.0, 86_400.0, 1.7e9] {
        let later_s = driving(&|at, row| row.time_s += if at >= rows.len() / 2 { hole_s } else { 0.0 });
        assert!(later_s <= usual_s && later_s > 0.8 * usual_s, "{hole_s}: {later_s} of {usual_s}");
    }
    for hole_s in [60.0, 86_400.0, 1.7e9, 1e300] {
        let one_s = driving(&|at, row| row.time_s = if at == rows.len() / 2 { hole_s } else { row.time_s });
        assert!(one_s <= usual_s && one_s > 0.8 * usual_s, "{hole_s}: {one_s} of {usual_s}");
    }
    // A hole of a second now and then ends a stretch.
    let holes_s = driving(&|at, row| {
        if at % 1000 < 100 {
            (row.input.turbine_rad_s, row.input.output_rad_s) = (None, None);
        }
    });
    assert!(holes_s < usual_s && holes_s > 0.3 * usual_s, "{holes_s} {usual_s}");
}
