//! The observer of an image has the bits of the filter that the image is made from.

use ecu::{Estimate, Input, OwnedObserver};
use export::{ExportedFilter, Image};
use observer::gearbox::ShiftInput;

use crate::readings::{city, filter_of, sampled_shifts};

fn compare(filter: &ExportedFilter, inputs: &[ShiftInput<f32>]) {
    let image = Image::of(filter).unwrap();
    let mut observer = OwnedObserver::new(&image.words).unwrap();
    let mut observer = observer.get().unwrap();
    let filter = filter.filter();
    let mut state = filter.start();
    let mut with_clutches = 0;
    for (at, input) in inputs.iter().enumerate() {
        let expected = filter.step(&mut state, input);
        let ranges = std::array::from_fn(|element| filter.pressure_range_pa(&state, element));
        let found = observer.step(&Input::of(input));
        with_clutches += usize::from(expected.clutches.is_some());
        let expected = Estimate { status: found.status, ..Estimate::of(&expected, &ranges) };
        assert_eq!(found.words(), expected.words(), "step {at}");
    }
    assert!(with_clutches > inputs.len() / 20, "{with_clutches} of {}", inputs.len());
}

#[test]
fn an_image_has_the_bits_of_its_filter_in_sampled_shifts_of_every_kind_of_gearbox() {
    for car in ["eight_speed.toml", "dual_clutch.toml", "four_speed_one_way.toml", "eight_speed_stroke.toml"] {
        let filter = filter_of(car);
        compare(&filter, &sampled_shifts(&filter, 12));
    }
}

#[test]
fn an_image_has_the_bits_of_its_filter_over_a_drive() {
    let filter = filter_of("eight_speed.toml");
    compare(&filter, &city(&filter));
}
