//! Wrong use gives a status word and the last good estimate, and never anything undefined.

use ecu::{Estimate, Input, OwnedObserver, Reading, image, status};
use export::Image;

use crate::readings::{filter_of, sampled_shifts};

fn image_of(car: &str) -> Vec<u32> {
    Image::of(&filter_of(car)).unwrap().words
}

fn refused(words: &[u32]) -> u32 {
    OwnedObserver::new(words).unwrap_err()
}

#[test]
fn a_wrong_image_is_refused_with_its_reason() {
    let words = image_of("four_speed.toml");
    let changed = |at: usize, to: u32| {
        let mut other = words.clone();
        other[at] = to;
        other
    };
    assert_eq!(refused(&[]), status::IMAGE_SIZE);
    assert_eq!(refused(&words[..words.len() - 1]), status::IMAGE_SIZE);
    assert_eq!(refused(&[words.clone(), vec![0]].concat()), status::IMAGE_SIZE);
    assert_eq!(refused(&changed(0, 0)), status::IMAGE_MAGIC);
    assert_eq!(refused(&words.iter().map(|word| word.swap_bytes()).collect::<Vec<_>>()), status::IMAGE_MAGIC);
    assert_eq!(refused(&changed(1, ecu::FORMAT_VERSION + 1)), status::IMAGE_VERSION);
    for (at, word) in words.iter().enumerate().skip(3) {
        assert_eq!(refused(&changed(at, word ^ (1 << (at % 32)))), status::IMAGE_CHECKSUM, "{at}");
    }
}

#[test]
fn a_sealed_image_of_any_words_is_refused_or_steps_without_a_panic() {
    let filter = filter_of("four_speed.toml");
    let words = Image::of(&filter).unwrap().words;
    let inputs = sampled_shifts(&filter, 1);
    let mut refused = 0;
    for at in 4..words.len() {
        for word in [0, 1, u32::MAX, f32::NAN.to_bits(), f32::INFINITY.to_bits(), (-1e30_f32).to_bits(), 600] {
            let mut other = words.clone();
            other[at] = word;
            assert!(image::seal(&mut other));
            match OwnedObserver::new(&other) {
                Ok(mut observer) => {
                    let mut observer = observer.get().unwrap();
                    for input in inputs.iter().skip(97).take(8) {
                        observer.step(&Input::of(input));
                    }
                }
                Err(status) => {
                    assert!(status == status::IMAGE_CONTENT, "{at}: {status:#x}");
                    refused += 1;
                }
            }
        }
    }
    assert!(refused > words.len(), "{refused}");
}

#[test]
fn a_tuned_value_needs_the_seal() {
    let image = Image::of(&filter_of("four_speed.toml")).unwrap();
    let tuned = image.entries.iter().find(|entry| entry.name() == "driveline_shaft_stiffness_n_m_rad").unwrap();
    let mut words = image.words.clone();
    words[tuned.offset / 4] = 1.1e4_f32.to_bits();
    assert_eq!(refused(&words), status::IMAGE_CHECKSUM);
    assert!(image::seal(&mut words) && OwnedObserver::new(&words).is_ok());
    assert!(!image::seal(&mut words[..2]));
}

/// An observer in the middle of a shift, and its next input.
fn in_a_shift() -> (OwnedObserver, Input) {
    let filter = filter_of("eight_speed.toml");
    let inputs: Vec<Input> = sampled_shifts(&filter, 1).iter().map(Input::of).collect();
    let mut owned = OwnedObserver::new(&Image::of(&filter).unwrap().words).unwrap();
    let mut observer = owned.get().unwrap();
    for input in &inputs[..140] {
        observer.step(input);
    }
    assert!(observer.estimate().given & ecu::given::CLUTCHES != 0);
    (owned, inputs[140])
}

fn step(owned: &mut OwnedObserver, input: &Input) -> Estimate {
    *owned.get().unwrap().step(input)
}

#[test]
fn a_wrong_time_step_holds_the_last_estimate() {
    let (before, input) = in_a_shift();
    let last = *before.clone().get().unwrap().estimate();
    for (dt_s, expected) in [
        (0.0, status::TIME_REFUSED | status::HELD),
        (-0.01, status::TIME_REFUSED | status::HELD),
        (f32::NAN, status::TIME_REFUSED | status::HELD),
        (f32::INFINITY, status::TIME_REFUSED | status::HELD),
    ] {
        let mut owned = before.clone();
        let held = step(&mut owned, &Input { dt_s, ..input });
        assert_eq!(held.status, expected, "{dt_s}");
        assert_eq!(
            [held.oncoming.pressure_pa, held.offgoing.torque_n_m],
            [last.oncoming.pressure_pa, last.offgoing.torque_n_m]
        );
        assert_eq!(step(&mut owned, &input).status & (status::TIME_REFUSED | status::HELD), 0);
    }
    for dt_s in [0.3, 1e9, f32::MAX] {
        assert_eq!(
            step(&mut before.clone(), &Input { dt_s, ..input }).status & status::TIME_GAP,
            status::TIME_GAP,
            "{dt_s}"
        );
    }
}

#[test]
fn a_gear_in_no_table_leaves_the_last_one() {
    let (before, input) = in_a_shift();
    let expected = step(&mut before.clone(), &input);
    for (gear_from, gear_to) in [(99, 1), (0, -2), (i32::MIN, i32::MAX), (8, 9)] {
        let mut owned = before.clone();
        let found = step(&mut owned, &Input { gear_from, gear_to, ..input });
        assert_eq!(found.status & status::GEAR_REFUSED, status::GEAR_REFUSED, "{gear_from} {gear_to}");
        assert_eq!(found.oncoming, expected.oncoming);
    }
}

#[test]
fn a_reading_that_is_no_number_is_refused_and_the_estimate_stays_one() {
    let (before, input) = in_a_shift();
    for value in [f32::NAN, f32::INFINITY, -f32::INFINITY, 1e30] {
        let wrong = Reading { value, age_s: 0.0, came: 1 };
        let old = Reading { value: 100.0, age_s: value, came: 1 };
        for reading in [wrong, old] {
            let all = Input {
                engine_rad_s: reading,
                turbine_rad_s: reading,
                output_rad_s: reading,
                wheel_rad_s: reading,
                engine_n_m: reading,
                acceleration_m_s2: reading,
                oil_degc: reading,
                commands: [reading; 8],
                ..input
            };
            let mut owned = before.clone();
            let found = step(&mut owned, &all);
            assert_eq!(found.status & status::READING_REFUSED, status::READING_REFUSED, "{reading:?}");
            for clutch in [found.offgoing, found.oncoming] {
                assert!(clutch.pressure_pa.is_finite() && clutch.torque_n_m.is_finite(), "{reading:?} {clutch:?}");
            }
        }
    }
}

#[test]
fn what_was_learnt_is_taken_by_the_same_gearbox_alone() {
    let (mut owned, input) = in_a_shift();
    let mut learnt = [0; ecu::LEARNT_WORDS];
    owned.get().unwrap().learnt(&mut learnt);
    assert_eq!(owned.get().unwrap().start_with(&learnt), Ok(()));
    let mut other = OwnedObserver::new(&image_of("four_speed.toml")).unwrap();
    assert_eq!(other.get().unwrap().start_with(&learnt), Err(status::LEARNT_REFUSED));
    for at in [0, 1, 2, 3, 6, 57, 500, ecu::LEARNT_WORDS - 1] {
        let mut wrong = learnt;
        wrong[at] ^= 1 << 30;
        assert_eq!(owned.get().unwrap().start_with(&wrong), Err(status::LEARNT_REFUSED), "{at}");
    }
    step(&mut owned, &input);
    owned.get().unwrap().reset();
    let again = &mut [0; ecu::LEARNT_WORDS];
    owned.get().unwrap().learnt(again);
    assert_eq!(owned.get().unwrap().estimate(), &Estimate::default());
}
