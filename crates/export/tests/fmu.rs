//! Models for co-simulation: their functions, called as a program for simulation calls them, and their files.

use std::path::PathBuf;

use ecu::{ESTIMATE_WORDS, Estimate, INPUT_WORDS, Input, OwnedObserver};
use export::{ExportError, ExportOptions, ExportedFile, Image, export};
use object::Object as _;

use crate::c_program::{Folder, built_with_cargo, input_bytes, run_in};
use crate::readings::{car_file, city, filter_of};

fn library() -> PathBuf {
    built_with_cargo("embedded/fmu/Cargo.toml").join(format!(
        "{}wetclutch_fmu{}",
        std::env::consts::DLL_PREFIX,
        std::env::consts::DLL_SUFFIX
    ))
}

fn models(libraries: Vec<Vec<u8>>) -> Result<Vec<ExportedFile>, ExportError> {
    let options = ExportOptions { shift: Some("1-2".into()), fmu_libraries: libraries, ..ExportOptions::default() };
    let files = export(&car_file("eight_speed.toml"), &options)?;
    Ok(files.into_iter().filter(|file| file.name.ends_with(".fmu")).collect())
}

/// A letter for each word: real or whole.
fn kinds(count: usize, is_real: fn(usize) -> bool) -> String {
    (0..count).map(|at| if is_real(at) { 'r' } else { 'w' }).collect()
}

#[test]
fn a_model_has_the_bits_of_the_observer_over_a_drive_and_refuses_wrong_use() {
    let filter = filter_of("eight_speed.toml");
    let image = Image::of(&filter).unwrap();
    // The place of the resources has characters that a location writes as others.
    let folder = Folder::new("fmu drive");
    let inputs: Vec<Input> = city(&filter).iter().map(Input::of).collect();
    let mut observer = OwnedObserver::new(&image.words).unwrap();
    let mut observer = observer.get().unwrap();
    let expected: Vec<u8> =
        inputs.iter().flat_map(|input| *observer.step(input).words()).flat_map(u32::to_ne_bytes).collect();
    let program = include_str!("fmu.c")
        .replace("@INPUT_WORDS@", &INPUT_WORDS.to_string())
        .replace("@ESTIMATE_WORDS@", &ESTIMATE_WORDS.to_string())
        .replace("@INPUT_KINDS@", &kinds(INPUT_WORDS, Input::is_real))
        .replace("@ESTIMATE_KINDS@", &kinds(ESTIMATE_WORDS, Estimate::is_real));
    for (name, bytes) in [
        ("fmu.c", program.into_bytes()),
        ("parameters.bin", image.bytes()),
        ("inputs", inputs.iter().flat_map(input_bytes).collect()),
    ] {
        std::fs::write(folder.0.join(name), bytes).unwrap();
    }
    run_in(&folder.0, "cc", &["-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "fmu.c", "-ldl", "-o", "fmu"]);
    let token = format!("{{{:08x}-0}}", image.header().unwrap().checksum);
    let (library, place) = (library(), folder.0.display().to_string());
    run_in(&folder.0, "./fmu", &[&library.display().to_string(), &place, &token, "inputs", "estimates2", "estimates3"]);
    for estimates in ["estimates2", "estimates3"] {
        assert!(std::fs::read(folder.0.join(estimates)).unwrap() == expected, "{estimates}");
    }
}

/// The functions of co-simulation of both versions of the standard.
const FUNCTIONS: &str = include_str!("fmi_functions.txt");

#[test]
fn every_function_of_the_standard_is_there_and_no_new_system_is_needed() {
    let bytes = std::fs::read(library()).unwrap();
    let file = object::File::parse(&*bytes).unwrap();
    let exported: Vec<_> = file.exports().unwrap();
    for function in FUNCTIONS.split_whitespace() {
        assert!(exported.iter().any(|of| of.name() == function.as_bytes()), "{function}");
    }
    assert_eq!(FUNCTIONS.split_whitespace().count(), 119);
    assert!(bytes.len() < 400_000, "{}", bytes.len());
    let text = String::from_utf8_lossy(&bytes);
    let versions = text.match_indices("GLIBC_2.").filter_map(|(at, found)| {
        let digits = text[at + found.len()..].split(|c: char| !c.is_ascii_digit()).next()?;
        digits.parse::<u32>().ok()
    });
    assert!(versions.max().is_none_or(|newest| newest <= 17));
}

#[test]
fn a_model_of_each_version_has_description_library_and_parameters() {
    let bytes = std::fs::read(library()).unwrap();
    let models = models(vec![bytes]).unwrap();
    let names: Vec<&str> = models.iter().map(|model| model.name.as_str()).collect();
    assert_eq!(names, ["wetclutch_eight_speed_fmi2.fmu", "wetclutch_eight_speed_fmi3.fmu"]);
    for model in &models {
        assert!(model.bytes.starts_with(b"PK\x03\x04"));
        let text = String::from_utf8_lossy(&model.bytes);
        for part in [
            "modelDescription.xml",
            "wetclutch_fmu.so",
            "resources/parameters.bin",
            "estimate.oncoming_pressure_pa",
            "command_0.value",
            "unit=\"A\"",
        ] {
            assert!(text.contains(part), "{part}");
        }
        // The car has fewer elements than the observer has room for.
        assert!(!text.contains("estimate.element_pa_7"));
    }
}

#[test]
fn what_is_no_library_of_a_model_is_refused() {
    let bytes = std::fs::read(library()).unwrap();
    let twice = models(vec![bytes.clone(), bytes.clone()]).unwrap_err().to_string();
    assert!(twice.contains("x86_64-linux") || twice.contains("two shared libraries"), "{twice}");
    let of_car = ExportOptions { car_fmu_libraries: vec![bytes.clone()], ..ExportOptions::default() };
    let other = export(&car_file("eight_speed.toml"), &of_car).unwrap_err().to_string();
    assert!(other.contains("not wetclutch_car_fmu") && other.contains("embedded/car_fmu"), "{other}");
    let own = std::fs::read(std::env::current_exe().unwrap()).unwrap();
    for wrong in [Vec::new(), b"\x7fELF".to_vec(), bytes[..2000].to_vec(), own] {
        let said = models(vec![wrong]).unwrap_err().to_string();
        assert!(said.contains("not a shared library of a model") && said.contains("hint: "), "{said}");
    }
}
