//! Scale and delays of the channels, and the stiffness of the drive shafts.

use config::Car;
use fit::gearbox::{Driving, GearboxFit, fit};
use fit::{Known, Verdict};

use crate::drawn::{Case, Drawn, car, city, hilly, with_tip_ins};

fn drawn(seed: u64) -> Drawn {
    Drawn::of(car("eight_speed.toml"), seed, Case::Usual).with_channels()
}

fn fitted(drawn: &Drawn, drive: &config::Drive) -> GearboxFit {
    let (recorded, _) = drawn.driven(&hilly(drive, drawn.seed));
    fit(&drawn.file, &drawn.tables(), &recorded.shifts, &recorded.driving, &mut |_| ()).unwrap()
}

fn holds(known: &Known, truth: f64) -> bool {
    (known.value - truth).abs() <= 2.0 * known.sd
}

fn written(drawn: &Drawn, fit: &GearboxFit) -> Car {
    fit.vehicle_file(&drawn.file, &drawn.file.source.path, "a drive", None).unwrap()
}

fn stiffness(car: &Car) -> f64 {
    car.driveline.shaft_stiffness_n_m_rad
}

#[test]
fn scale_and_delay_of_the_wheel_speed_and_the_stiffness_lie_in_their_intervals() {
    let drawn = drawn(31).with_backlash();
    let fit = fitted(&drawn, &with_tip_ins(2));
    let found = fit.wheel.clone().unwrap();
    let channels = drawn.channels;
    let late_s = channels.late_s[3] - channels.late_s[2];
    assert!(holds(&found.scale, channels.wheel_scale) && found.scale.sd < 2e-4, "{found:?} {channels:?}");
    assert!(holds(&found.late_s, late_s) && found.late_s.sd < 5e-4, "{found:?} {channels:?}");
    let truth = (stiffness(&drawn.truth) / stiffness(&drawn.file)).ln();
    assert!(holds(&found.stiffness, truth) && found.stiffness.verdict() == Verdict::Partly, "{found:?} {truth}");
    let file = written(&drawn, &fit);
    assert!((stiffness(&file) / stiffness(&drawn.file) / found.stiffness.value.exp() - 1.0).abs() < 1e-3);
    let share = file.error_bounds.shaft_stiffness_share.unwrap();
    assert!((share / (3.0_f64.sqrt() * found.stiffness.sd) - 1.0).abs() < 1e-3, "{share}");
    let said = fit.statements().join("\n");
    for words in [
        format!("multiply `scale` of its channel in the channel map by {:.4}", 1.0 + found.scale.value),
        format!("wheel_speed is {:+.1} +- ", 1e3 * found.late_s.value),
        "the speeds tell the product alone".to_owned(),
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
    let of = |driving: &Driving| fit(&in_town.file, &in_town.tables(), &recorded.shifts, driving, &mut |_| ()).unwrap();
    let usual = of(&recorded.driving);
    let said = usual.statements().join("\n");
    assert!(said.contains("stiffness of the drive shafts: not told by these logs"), "{said}");
    assert!(said.contains("its scale and the final ratio fit together") && said.contains("they belong together"));
    let none = of(&Driving::default());
    let said = none.statements().join("\n");
    assert!(
        said.contains("wheel speed and drive shafts: not told: 0 s of driving in a gear with a wheel speed"),
        "{said}"
    );
    for fit in [&usual, &none] {
        let file = written(&in_town, fit);
        // The text of the file is not that of the drawn one.
        assert_eq!(stiffness(&file), stiffness(&car("eight_speed.toml")));
        assert_eq!(file.error_bounds.shaft_stiffness_share, None);
    }
}
