//! Scale and delays of the channels, and the stiffness of the drive shafts.

use std::ops::ControlFlow::Continue;

use car::{Car, ShiftCommand};
use config::CarFile;
use fit::gearbox::{Driving, GearboxFit, Quantity, Recorder, fit};
use fit::{Known, MapChange, MapKey, ReadingAges, Verdict};
use observer::Reading;
use observer::gearbox::ShiftInput;

use super::drawn::{Case, Drawn, FittedFile as _, car, city, hilly, with_tip_ins};

fn drawn(seed: u64) -> Drawn {
    Drawn::of(car("eight_speed.toml"), seed, Case::Usual).with_channels()
}

fn fitted(drawn: &Drawn, drive: &car::Drive) -> GearboxFit {
    let (recorded, _) = drawn.driven(&hilly(drive, drawn.seed));
    fit(&drawn.file, &drawn.tables(), &recorded.shifts, &recorded.driving, &mut |_| Continue(())).unwrap()
}

fn holds(known: &Known, truth: f64) -> bool {
    (known.value - truth).abs() <= 2.0 * known.sd
}

fn written(drawn: &Drawn, fit: &GearboxFit) -> CarFile {
    fit.vehicle_file(&drawn.file, &drawn.file.source.path, "a drive", None).unwrap()
}

fn stiffness(car: &Car) -> f64 {
    car.driveline.shaft_stiffness_n_m_rad
}

#[test]
fn scale_and_delay_of_the_wheel_speed_and_the_stiffness_lie_in_their_intervals() {
    let drawn = drawn(31).with_backlash().without_hysteresis();
    let fit = fitted(&drawn, &with_tip_ins(2));
    let found = fit.wheel.clone().unwrap();
    let channels = drawn.channels;
    let late_s = channels.late_s[3] - channels.late_s[2];
    assert!(holds(&found.scale, channels.wheel_scale) && found.scale.sd < 2e-4, "{found:?} {channels:?}");
    assert!(holds(&found.late_s, late_s) && found.late_s.sd < 5e-4, "{found:?} {channels:?}");
    let truth = (stiffness(&drawn.truth) / stiffness(&drawn.file)).ln();
    assert!(holds(&found.stiffness, truth) && found.stiffness.verdict() == Verdict::Partly, "{found:?} {truth}");
    // Output and engine speed against the turbine speed.
    let output = fit.channels.output.clone().unwrap();
    assert!(holds(&output.late_s, channels.late_s[2]) && output.late_s.sd < 5e-4, "{output:?} {channels:?}");
    assert!(output.scale.value.abs() < 1e-3 && fit.channels.engine.as_ref().is_some_and(Result::is_err), "{output:?}");
    let engine = fit.engine_late_s().unwrap();
    assert!(holds(&engine, channels.late_s[0]) && engine.verdict() == Verdict::Measured, "{engine:?} {channels:?}");
    // The same as changes of the channel map: the wheel speed is late against the turbine speed by both delays.
    let changes = fit.map_changes();
    let change = |signal: &str, key: MapKey| {
        let is_it = |change: &&MapChange| change.channel.name() == signal && change.key == key;
        changes.iter().find(is_it).map_or(0.0, |change| change.value)
    };
    let delay = |signal: &str| change(signal, MapKey::Delay) + change(signal, MapKey::Late);
    assert_eq!([delay("output_speed"), delay("engine_speed")], [output.late_s.value, engine.value], "{changes:?}");
    assert!((delay("wheel_speed") - output.late_s.value - found.late_s.value).abs() < 1e-9, "{changes:?}");
    assert_eq!(change("wheel_speed", MapKey::Scale), 1.0 + found.scale.value);
    let file = written(&drawn, &fit);
    assert!((stiffness(&file) / stiffness(&drawn.file) / found.stiffness.value.exp() - 1.0).abs() < 1e-3);
    let fraction = file.error_bounds.shaft_stiffness_share.unwrap();
    assert!((fraction / (3.0_f64.sqrt() * found.stiffness.sd) - 1.0).abs() < 1e-3, "{fraction}");
    let said = fit.statements().join("\n");
    for words in [
        format!("multiply `scale` of its channel in the channel map by {:.4}", 1.0 + found.scale.value),
        format!("wheel_speed is {:+.1} +- ", 1e3 * found.late_s.value),
        format!("output_speed is {:+.1} +- ", 1e3 * output.late_s.value),
        format!("engine_speed is {:+.1} +- ", 1e3 * engine.value),
        "the fit used these delays of output and engine speed".to_owned(),
        "the speeds show only the product".to_owned(),
        "stiffness of the drive shafts: x ".to_owned(),
    ] {
        assert!(said.contains(&words), "{words}: {said}");
    }
}

#[test]
fn what_the_wheel_speed_does_not_tell_stays_as_in_the_file_and_is_said() {
    // In town the accelerator is not pressed often enough in a gear; the wheel speed of the second car is right.
    let in_town = Drawn::of(car("eight_speed.toml"), 32, Case::Usual);
    let (recorded, _) = in_town.driven(&city(1));
    let of = |driving: &Driving| {
        fit(&in_town.file, &in_town.tables(), &recorded.shifts, driving, &mut |_| Continue(())).unwrap()
    };
    let usual = of(&recorded.driving);
    let said = usual.statements().join("\n");
    assert!(said.contains("stiffness of the drive shafts: not identified by these logs"), "{said}");
    assert!(said.contains("its scale and the final ratio fit together") && said.contains("they belong together"));
    let none = of(&Driving::default());
    let said = none.statements().join("\n");
    assert!(
        said.contains("wheel speed and drive shafts: not identified: 0 s of driving in a gear with a wheel speed"),
        "{said}"
    );
    for fit in [&usual, &none] {
        let file = written(&in_town, fit);
        // The text of the file is not that of the drawn one.
        assert_eq!(stiffness(&file), stiffness(&car("eight_speed.toml")));
        assert_eq!(file.error_bounds.shaft_stiffness_share, None);
    }
}

/// Speeds that go up and down in two gears, with the lock-up clutch closed: an output speed that is early and has another scale, an engine speed that is late.
fn locked(drawn: &Drawn, output_s: f64, output_scale: f64, engine_s: f64) -> Driving {
    let tables = drawn.tables();
    let mut recorder = Recorder::new(&drawn.file, &tables, ReadingAges::default());
    for at in 0..6000 {
        let time_s = 0.01 * f64::from(at);
        let gear = if at / 700 % 2 == 0 { 3 } else { 4 };
        let ratio = drawn.file.gearbox.gears[gear].ratio;
        let noise = |channel: i32| 0.1 * (1.7 * f64::from((at * at + 13 * channel * at) % 101)).sin();
        let output = |late_s: f64| 120.0 + 30.0 * (0.7 * (time_s - late_s)).sin();
        let reading = |value: f64| Some(Reading::now(value));
        let input = ShiftInput {
            dt_s: 0.01,
            engine_rad_s: reading(ratio * output(engine_s) + noise(1)),
            turbine_rad_s: reading(ratio * output(0.0) + noise(2)),
            output_rad_s: reading(output(output_s) / output_scale + noise(3)),
            wheel_rad_s: None,
            engine_n_m: None,
            acceleration_m_s2: None,
            lock_up_applied: true,
            commands: [None; 8],
            gear: ShiftCommand::between(gear, gear),
        };
        recorder.push(time_s, &input);
    }
    recorder.finish().driving
}

#[test]
fn a_closed_lock_up_clutch_tells_the_delay_of_the_engine_speed_and_the_ratio_a_wrong_scale() {
    let drawn = Drawn::of(car("eight_speed.toml"), 33, Case::Usual);
    let (recorded, _) = drawn.driven(&city(1));
    let driving = locked(&drawn, -0.006, 1.004, 0.008);
    let fit = fit(&drawn.file, &drawn.tables(), &recorded.shifts, &driving, &mut |_| Continue(())).unwrap();
    let (output, engine) = (fit.channels.output.clone().unwrap(), fit.channels.engine.clone().unwrap().unwrap());
    assert!(holds(&output.late_s, -0.006) && output.late_s.sd < 1e-3, "{output:?}");
    assert!(holds(&output.scale, 0.004) && output.scale.sd < 3e-4, "{output:?}");
    assert!(holds(&engine.late_s, 0.008) && holds(&engine.scale, 0.0), "{engine:?}");
    let said = fit.statements().join("\n");
    for words in [
        "engine_speed with the lock-up clutch closed is +8.",
        "`scale` of one of both channels, or a ratio, is wrong",
        "ahead of it: take 0.00",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
}

/// With the lock-up clutch applied the engine of such a car is faster than the turbine: that is no wrong scale.
#[test]
fn a_slip_controlled_lock_up_clutch_tells_nothing_of_the_engine_speed() {
    let mut drawn = Drawn::of(car("eight_speed.toml"), 33, Case::Usual);
    drawn.file.lock_up = Some(car::LockUp {
        capacity_n_m: 300.0,
        first_gear: 3,
        on_rad_s: 140.0,
        off_rad_s: 110.0,
        ramp_s: 0.5,
        slip_rad_s: 4.0,
    });
    let (recorded, _) = drawn.driven(&city(1));
    let driving = locked(&drawn, 0.0, 1.0, 0.008);
    let fit = fit(&drawn.file, &drawn.tables(), &recorded.shifts, &driving, &mut |_| Continue(())).unwrap();
    assert!(fit.channels.output.is_ok() && fit.channels.engine.as_ref().is_some_and(Result::is_err));
    let said = fit.statements().join("\n");
    assert!(!said.contains("with the lock-up clutch closed"), "{said}");
}

#[test]
fn commands_that_are_stored_late_or_early_are_noticed_and_the_given_values_are_kept() {
    let found = |commands_s: f64| {
        let mut drawn = Drawn::of(car("eight_speed.toml"), 34, Case::Usual);
        drawn.channels.commands_s = commands_s;
        fitted(&drawn, &city(1))
    };
    let usual = found(0.0);
    assert_eq!((usual.commands_late_s(), usual.reason_against(None)), (None, None));
    for (commands_s, words) in [
        (0.12, ["too late against the speeds: add ", " to `late_s` of the channel of each command"]),
        (-0.1, ["too early against the speeds: add ", " to `late_s` of the channel of each command"]),
    ] {
        let late = found(commands_s);
        let Known { value: late_s, sd, .. } = late.commands_late_s().unwrap();
        assert!((late_s - commands_s).abs() < 0.01_f64.min(3.0 * sd) && sd < 0.01, "{late_s} {sd}");
        let [size_ms, half_ms] = [late_s.abs(), 2.0 * sd].map(|time_s| 1e3 * time_s);
        let words = format!("are {size_ms:.0} +- {half_ms:.0} ms {}{late_s:.3}{}", words[0], words[1]);
        assert!(late.statements().iter().any(|line| line.starts_with("warning: ") && line.contains(&words)), "{words}");
        assert!(late.reason_against(None).is_some_and(|reason| reason.contains(&words)));
        // The values are those of commands in time.
        assert!((late.torque_scale_sd() / usual.torque_scale_sd() - 1.0).abs() < 0.2);
        for quantity in [Quantity::Input, Quantity::Torque(0), Quantity::Torque(2)] {
            let change = late.unknown(quantity) - usual.unknown(quantity);
            assert!(change.abs() < 0.5 * usual.sd(quantity), "{quantity:?} {change}");
        }
    }
}
