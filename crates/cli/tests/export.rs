//! `export`: the observer of a car for a controller.

use std::path::Path;

use crate::support::{Folder, ROOT, VEHICLE, printed, refused, said, wetclutch};

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
        "wetclutch_eight_speed_sfunction.c",
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

/// The file is written beside the others, the header has memory for it, and it is not replaced where it is read from.
#[test]
fn export_puts_the_c_of_the_observer_beside_the_other_files() {
    let folder = Folder::new("export-c");
    let out = folder.path("out");
    let memory = |arguments: &[&str]| {
        printed(&wetclutch(&[&["export", &car(), "--shift", "1-2", "-o", &out], arguments].concat()));
        let header = std::fs::read_to_string(Path::new(&out).join("wetclutch_eight_speed.h")).unwrap();
        let line = header.lines().find_map(|line| line.strip_prefix("#define WETCLUTCH_EIGHT_SPEED_MEMORY_BYTES "));
        line.unwrap().trim_end_matches('u').parse::<u32>().unwrap()
    };
    let of_library = memory(&[]);
    let image = std::fs::read(Path::new(&out).join("wetclutch_eight_speed_parameters.bin")).unwrap();
    let source = format!(
        "/* The observer of wetclutch. */\n#define IMAGE_VERSION {}u\n#define HEAP 500000u\n#define STACK_BYTES 400000u\n/* The end of wetclutch.c. */\n",
        image[4]
    );
    let source = folder.write("wetclutch.c", source);
    assert!(!Path::new(&out).join("wetclutch.c").exists());
    let of_c = memory(&["--c", &source]);
    assert!(of_c > of_library + 500_000 && of_c.is_multiple_of(8), "{of_library} {of_c}");
    assert_eq!(std::fs::read(Path::new(&out).join("wetclutch.c")).unwrap(), std::fs::read(&source).unwrap());
    let again = wetclutch(&["export", &car(), "--shift", "1-2", "-o", &out]);
    assert!(said(&again).contains("wetclutch.c in the folder is of an earlier export"), "{again:?}");
    let wrong = refused(&wetclutch(&["export", &car(), "--c", &source, "-o", &folder.path("")]));
    assert!(wrong.contains("the output would replace this input"), "{wrong}");
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
