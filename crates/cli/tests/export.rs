//! `export`: the observer of a car for a controller.

use std::path::Path;

use crate::support::{Folder, ROOT, VEHICLE, printed, refused, wetclutch};

fn car() -> String {
    format!("{ROOT}vehicles/eight_speed.toml")
}

#[test]
fn export_writes_all_files_of_a_car_and_lists_them() {
    let folder = Folder::new("export");
    let out = folder.path("out");
    let listed = printed(&wetclutch(&["export", &car(), "--shift", "1-2", "-o", &out]));
    let names = [
        "wetclutch.h",
        "wetclutch_eight_speed.h",
        "wetclutch_eight_speed_parameters.c",
        "wetclutch_eight_speed_parameters.bin",
        "wetclutch_eight_speed_selftest.c",
        "wetclutch_eight_speed.a2l",
        "example.c",
        "certificate.md",
        "report.md",
        "README.md",
    ];
    for name in names {
        assert!(listed.contains(name), "{listed}");
        assert!(std::fs::metadata(Path::new(&out).join(name)).unwrap().len() > 0, "{name}");
    }
    assert_eq!(std::fs::read_dir(&out).unwrap().count(), names.len());
    let certificate = std::fs::read_to_string(Path::new(&out).join("certificate.md")).unwrap();
    assert!(certificate.contains("Shifts: 1-2.") && certificate.contains("0x1"), "{certificate}");
}

#[test]
fn export_names_what_is_wrong_and_writes_nothing() {
    let folder = Folder::new("export-wrong");
    let out = folder.path("out");
    let wrong = |arguments: &[&str]| refused(&wetclutch(&[&["export"], arguments, &["-o", &out]].concat()));
    let said = wrong(&[VEHICLE]);
    assert!(said.contains("vehicle file of one shift") && said.contains("hint: "), "{said}");
    let said = wrong(&[&car(), "--shift", "1-9"]);
    assert!(said.contains("eight_speed.toml") && said.contains("1-9"), "{said}");
    let said = wrong(&[&car(), "--shift", "1-2", "--all"]);
    assert!(said.contains("cannot be used with"), "{said}");
    let said = wrong(&[&car(), "--sensors", VEHICLE]);
    assert!(said.contains("[sensors]"), "{said}");
    let said = wrong(&[&car(), "--check-elf", VEHICLE]);
    assert!(said.contains("not a program") && said.contains("ELF"), "{said}");
    for endless in ["/dev/zero", ROOT] {
        let said = wrong(&[&car(), "--check-elf", endless]);
        assert!(said.contains("no linked program") && said.contains("hint: "), "{said}");
        let said = wrong(&[&car(), "--fmu", endless]);
        assert!(said.contains("no linked shared library") && said.contains("embedded/fmu"), "{said}");
    }
    let said = wrong(&[&car(), "--fmu", VEHICLE]);
    assert!(said.contains("not a shared library of a model") && said.contains("embedded/fmu"), "{said}");
    let said = wrong(&[&car(), "--fmu", "there-is-none.so"]);
    assert!(said.contains("there-is-none.so") && said.contains("embedded/fmu"), "{said}");
    assert!(!Path::new(&out).exists());
}
