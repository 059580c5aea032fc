//! Images and files.

use ecu::crc32;
use export::{ExportOptions, ExportedFilter, Image, export};

use crate::readings::{car_file, filter_of};

/// The layout of version 5. Another number is another layout: then the version of the format changes too.
const NAMES_OF_VERSION_5: u32 = 1_542_960_035;

#[test]
fn a_version_of_the_format_is_a_layout() {
    let image = Image::of(&filter_of("eight_speed_stroke.toml")).unwrap();
    let names: String = image.entries.iter().map(|entry| format!("{} {};", entry.name(), entry.offset)).collect();
    let words = names.bytes().map(u32::from);
    assert_eq!((ecu::FORMAT_VERSION, crc32(words)), (5, NAMES_OF_VERSION_5));
}

#[test]
fn every_vehicle_with_a_gearbox_has_an_image_that_a_controller_takes() {
    for name in [
        "eight_speed",
        "eight_speed_stroke",
        "ten_speed",
        "six_speed",
        "four_speed",
        "four_speed_one_way",
        "nine_speed_9hp",
        "dual_clutch",
    ] {
        let image = Image::of(&filter_of(&format!("{name}.toml"))).unwrap();
        assert!(ecu::OwnedObserver::new(&image.words).is_ok(), "{name}");
        assert_eq!(image.header().unwrap().size_bytes as usize, image.bytes().len());
    }
}

#[test]
fn one_shift_is_a_smaller_image_and_another_shift_is_none() {
    let file = car_file("eight_speed.toml");
    let of = |shift: &str| {
        ExportedFilter::new(&file, &ExportOptions { shift: Some(shift.to_owned()), ..ExportOptions::default() })
    };
    let one = Image::of(&of("1-2").unwrap()).unwrap();
    assert_eq!(one.header().unwrap().shifts, 1);
    assert!(one.words.len() < Image::of(&filter_of("eight_speed.toml")).unwrap().words.len());
    assert!(of("1-9").unwrap_err().to_string().contains("1-9"));
    assert!(of("").is_err() && of("1-1").is_err() && of("--").is_err());
}

#[test]
fn the_same_car_gives_the_same_bytes() {
    let file = car_file("six_speed.toml");
    let files = || export(&file, &ExportOptions { shift: Some("2-3".to_owned()), ..ExportOptions::default() }).unwrap();
    let first = files();
    assert_eq!(first, files());
    let names: Vec<&str> = first.iter().map(|file| file.name.as_str()).collect();
    for name in
        ["wetclutch.h", "wetclutch_six_speed.h", "wetclutch_six_speed_parameters.bin", "certificate.md", "README.md"]
    {
        assert!(names.contains(&name), "{names:?}");
    }
    let is_filled = |text: &str| !text.is_empty() && !text.contains('@');
    assert!(first.iter().filter_map(|file| std::str::from_utf8(&file.bytes).ok()).all(is_filled));
}
