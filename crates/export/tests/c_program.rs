//! C programs with the library: built as their user builds them, and compared to the last bit.

use std::path::{Path, PathBuf};
use std::process::Command;

use ecu::{Input, OwnedObserver};
use export::{ExportOptions, Image, export};
use observer::gearbox::ShiftInput;

use crate::readings::{car_file, city, filter_of, root, sampled_shifts};

/// A folder that goes away with the test.
pub(crate) struct Folder(pub(crate) PathBuf);

impl Folder {
    pub(crate) fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("wetclutch-export-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        drop(std::fs::remove_dir_all(&self.0));
    }
}

fn run(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let text = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
    assert!(output.status.success(), "{command:?}:\n{}", &text[..text.len().min(1500)]);
    text
}

/// What a program says in a folder.
pub(crate) fn run_in(folder: &Path, program: &str, arguments: &[&str]) -> String {
    run(Command::new(program).args(arguments).current_dir(folder))
}

/// Builds the library for this machine; a panic that can be reached would let the C programs not link.
fn library() -> PathBuf {
    built_with_cargo("embedded/library/Cargo.toml").join("libwetclutch.a")
}

/// Builds what is not of the workspace, for this machine. Returns the folder with it.
pub(crate) fn built_with_cargo(manifest: &str) -> PathBuf {
    let target = root().join("target/library");
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    run(Command::new(cargo)
        .args(["build", "--release", "--locked", "--manifest-path"])
        .arg(root().join(manifest))
        .arg("--target-dir")
        .arg(&target));
    target.join("release")
}

/// Compilers that are there.
fn compilers() -> Vec<&'static str> {
    let is_there =
        |name: &&str| Command::new(name).arg("--version").output().is_ok_and(|output| output.status.success());
    ["gcc", "clang", "cc"].into_iter().filter(is_there).take(2).collect()
}

pub(crate) fn build(folder: &Path, compiler: &str, options: &[&str], main: &str, car: &str) {
    let sources = [main.to_owned(), format!("wetclutch_{car}_parameters.c"), format!("wetclutch_{car}_selftest.c")];
    run(Command::new(compiler)
        .args(["-std=c99", "-Wall", "-Wextra", "-Wconversion", "-Wdouble-promotion", "-pedantic", "-Werror"])
        .args(options)
        .args(sources)
        .arg(library())
        .args(["-Wl,--gc-sections", "-o", "program"])
        .current_dir(folder));
}

pub(crate) fn exported(folder: &Folder, vehicle: &str) {
    for file in export(&car_file(vehicle), &ExportOptions::default()).unwrap() {
        std::fs::write(folder.0.join(file.name), file.bytes).unwrap();
    }
}

/// Every word of an input.
pub(crate) fn input_bytes(input: &Input) -> Vec<u8> {
    let Input { dt_s, lock_up_applied, gear_from, gear_to, .. } = *input;
    let reading = |of: &ecu::Reading| [of.value.to_bits(), of.age_s.to_bits(), of.came];
    let speeds = [
        &input.engine_rad_s,
        &input.turbine_rad_s,
        &input.output_rad_s,
        &input.wheel_rad_s,
        &input.engine_n_m,
        &input.acceleration_m_s2,
        &input.oil_degc,
    ];
    let words = [dt_s.to_bits()].into_iter().chain(speeds.into_iter().flat_map(reading));
    let words = words.chain([lock_up_applied, gear_from.cast_unsigned(), gear_to.cast_unsigned()]);
    words.chain(input.commands.iter().flat_map(reading)).flat_map(u32::to_ne_bytes).collect()
}

fn c_has_the_bits(vehicle: &str, name: &str, inputs: &[ShiftInput<f32>]) {
    let folder = Folder::new(name);
    exported(&folder, vehicle);
    let harness = include_str!("harness.c").replace("@CAR@", name).replace("@CAR_UPPER@", &name.to_uppercase());
    std::fs::write(folder.0.join("harness.c"), harness).unwrap();
    let inputs: Vec<Input> = inputs.iter().map(Input::of).collect();
    std::fs::write(folder.0.join("inputs"), inputs.iter().flat_map(input_bytes).collect::<Vec<u8>>()).unwrap();
    let mut observer = OwnedObserver::new(&Image::of(&filter_of(vehicle)).unwrap().words).unwrap();
    let mut observer = observer.get().unwrap();
    let expected: Vec<u8> =
        inputs.iter().flat_map(|input| *observer.step(input).words()).flat_map(u32::to_ne_bytes).collect();
    for compiler in compilers() {
        for level in ["-O0", "-O2", "-O3"] {
            build(&folder.0, compiler, &[level], "harness.c", name);
            run(Command::new("./program").args(["inputs", "estimates"]).current_dir(&folder.0));
            assert!(std::fs::read(folder.0.join("estimates")).unwrap() == expected, "{compiler} {level}");
        }
    }
}

#[test]
fn c_has_the_bits_of_the_filter_over_a_drive_and_sampled_shifts() {
    let filter = filter_of("eight_speed.toml");
    let inputs = [city(&filter), sampled_shifts(&filter, 36)].concat();
    c_has_the_bits("eight_speed.toml", "eight_speed", &inputs);
}

#[test]
fn the_example_of_every_gearbox_compiles_and_runs() {
    for name in ["dual_clutch", "four_speed_one_way", "ten_speed"] {
        let folder = Folder::new(name);
        exported(&folder, &format!("{name}.toml"));
        build(&folder.0, "cc", &["-O2"], "example.c", name);
        let said = run(Command::new("./program").current_dir(&folder.0));
        assert!(said.starts_with("self-test 0, init 0x0\n"), "{name}: {said}");
    }
}

#[test]
fn the_image_of_the_c_source_has_the_bytes_of_the_binary_one() {
    let folder = Folder::new("image");
    exported(&folder, "six_speed.toml");
    let main = "#include <stdio.h>\n#include \"wetclutch_six_speed.h\"\nint main(void) {\n  return fwrite(&wetclutch_six_speed_parameters, \
                sizeof wetclutch_six_speed_parameters, 1, fopen(\"image\", \"wb\")) == 1 ? 0 : 1;\n}\n";
    std::fs::write(folder.0.join("main.c"), main).unwrap();
    build(&folder.0, "cc", &[], "main.c", "six_speed");
    run(Command::new("./program").current_dir(&folder.0));
    let [c, binary] =
        ["image", "wetclutch_six_speed_parameters.bin"].map(|name| std::fs::read(folder.0.join(name)).unwrap());
    assert!(c == binary);
}
