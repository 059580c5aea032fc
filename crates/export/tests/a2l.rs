//! The description for calibration tools, and its addresses from a program.

use std::collections::BTreeSet;

use export::{Addresses, ExportError, ExportOptions, ExportedFilter, Image, a2l, addresses};

use crate::c_program::{Code, Folder, build, exported, run_in};
use crate::readings::{car_file, filter_of};

/// Lines with this keyword, as their words after it.
fn objects<'t>(text: &'t str, keyword: &str) -> Vec<Vec<&'t str>> {
    let begin = format!("/begin {keyword} ");
    text.lines().filter_map(|line| line.trim().strip_prefix(&begin)).map(|rest| rest.split(' ').collect()).collect()
}

#[test]
fn every_number_of_the_image_and_every_word_of_the_estimate_is_described_once() {
    let filter = filter_of("eight_speed_stroke.toml");
    let image = Image::of(&filter).unwrap();
    let text = a2l(&filter, &image, &Addresses::default());
    assert_eq!(text.matches("/begin ").count(), text.matches("/end ").count());
    assert!(text.is_ascii() && !text.contains('@'));
    let parameters = objects(&text, "CHARACTERISTIC");
    let names: BTreeSet<&str> = parameters.iter().map(|object| object[0]).collect();
    assert_eq!(names.len(), parameters.len());
    let maps = image.entries.iter().filter(|entry| entry.name().ends_with("_points")).count();
    let numbers = image.entries.iter().filter(|entry| matches!(entry.values, export::Values::Reals(_))).count();
    assert_eq!(parameters.len(), numbers - maps);
    assert!(maps > 20 && names.contains("elements_0_clutch_friction") && names.contains("driveline_final_ratio"));
    let estimates: BTreeSet<&str> = objects(&text, "MEASUREMENT").iter().map(|object| object[0]).collect();
    assert!(estimates.contains("estimate.oncoming_pressure_pa"));
    for conversion in parameters.iter().flatten().filter(|word| word.starts_with("CM_")) {
        assert!(text.contains(&format!("/begin COMPU_METHOD {conversion} ")), "{conversion}");
    }
    // Each object is in a group once.
    for name in names {
        assert_eq!(text.lines().filter(|line| line.trim() == name).count(), 1, "{name}");
    }
    // Values are within their limits.
    for entry in &image.entries {
        let export::Values::Reals(values) = &entry.values else { continue };
        let Some(object) = parameters.iter().find(|object| object[0] == entry.name()) else { continue };
        let [low, high] = [1, 0].map(|back| object[object.len() - 1 - back].parse::<f32>().unwrap());
        let finite = values.iter().filter(|value| value.is_finite());
        assert!(finite.clone().all(|value| (low..=high).contains(value)), "{} {values:?}", entry.name());
    }
}

const MAIN: &str = "#include \"wetclutch_six_speed.h\"\nwetclutch_estimate wetclutch_six_speed_estimate;\nint main(void) {\n  \
                    return wetclutch_six_speed_parameters.header_magic == 0u || wetclutch_six_speed_estimate.status != 0u;\n}\n";

#[test]
fn addresses_are_those_of_the_program_and_another_car_is_named() {
    let folder = Folder::new("elf");
    exported(&folder, "six_speed.toml");
    std::fs::write(folder.0.join("main.c"), MAIN).unwrap();
    build(&folder.0, Code::Library, "cc", &["-O1", "-no-pie"], "main.c", "six_speed");
    let program = std::fs::read(folder.0.join("program")).unwrap();
    let filter = filter_of("six_speed.toml");
    let image = Image::of(&filter).unwrap();
    let found = addresses(&program, &filter, &image).unwrap();
    let names = run_in(&folder.0, "nm", &["program"]);
    let address = |name: &str| {
        let line = names.lines().find(|line| line.ends_with(&format!(" {name}"))).unwrap();
        u64::from_str_radix(line.split(' ').next().unwrap(), 16).unwrap()
    };
    let expected = Addresses {
        parameters: address("wetclutch_six_speed_parameters"),
        estimate: address("wetclutch_six_speed_estimate"),
        is_big_endian: false,
    };
    assert_eq!(found, expected);
    let text = a2l(&filter, &image, &found);
    let entry = image.entries.iter().find(|entry| entry.name() == "driveline_final_ratio").unwrap();
    let place = format!("VALUE 0x{:08X} Float", found.parameters + entry.offset as u64);
    assert!(text.lines().any(|line| line.contains("driveline_final_ratio") && line.contains(&place)), "{place}");

    // Without names the parameters are found by their content.
    run_in(&folder.0, "strip", &["program"]);
    let stripped = std::fs::read(folder.0.join("program")).unwrap();
    assert_eq!(addresses(&stripped, &filter, &image).unwrap().parameters, expected.parameters);

    let other = ExportedFilter::new(
        &car_file("six_speed.toml"),
        &ExportOptions { shift: Some("1-2".into()), ..ExportOptions::default() },
    );
    let other = other.unwrap();
    let error = addresses(&program, &other, &Image::of(&other).unwrap()).unwrap_err();
    assert!(matches!(&error, ExportError::OtherParameters(_, first) if first == "header_size_bytes"), "{error}");
    assert!(matches!(addresses(&stripped, &other, &Image::of(&other).unwrap()), Err(ExportError::NotInProgram(_))));
    assert!(matches!(addresses(b"no program", &filter, &image), Err(ExportError::Program(_))));
    assert!(addresses(&program[..200], &filter, &image).is_err());
}
