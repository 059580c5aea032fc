//! C programs with the library: built as their user builds them, and compared to the last bit.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use ecu::{Input, OwnedObserver};
use export::{CSource, ExportOptions, Image, export};
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

/// `wetclutch.c`, made anew; none where Rust cannot compile for WebAssembly, unless in CI.
fn portable() -> Option<&'static Path> {
    static MADE: OnceLock<Option<PathBuf>> = OnceLock::new();
    let made = MADE.get_or_init(|| {
        let target = "wasm32-unknown-unknown";
        let libraries = run(Command::new("rustc").args(["--print", "target-libdir", "--target", target]));
        let is_there = Path::new(libraries.trim()).is_dir();
        assert!(is_there || std::env::var_os("CI").is_none(), "rustup target add {target}");
        is_there.then(|| {
            run(&mut Command::new(root().join("embedded/portable/build")));
            root().join("target/portable/wetclutch.c")
        })
    });
    made.as_deref()
}

/// The code of the observer that a C program is built with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Code {
    /// `libwetclutch.a`.
    Library,
    /// `wetclutch.c`, beside the other files.
    Portable,
}

/// Both, or the library alone where there is no other.
fn codes() -> Vec<Code> {
    let all = [Code::Library, Code::Portable];
    all.into_iter().filter(|code| *code == Code::Library || portable().is_some()).collect()
}

/// Compilers that are there; `cc` is one of the others where there is one.
fn compilers() -> Vec<&'static str> {
    let is_there =
        |name: &&str| Command::new(name).arg("--version").output().is_ok_and(|output| output.status.success());
    let named: Vec<_> = ["gcc", "clang"].into_iter().filter(is_there).collect();
    if named.is_empty() { vec!["cc"] } else { named }
}

pub(crate) fn build(folder: &Path, code: Code, compiler: &str, options: &[&str], main: &str, car: &str) {
    let observer = match code {
        Code::Library => library(),
        Code::Portable => folder.join("wetclutch.c"),
    };
    let sources = [main.to_owned(), format!("wetclutch_{car}_parameters.c"), format!("wetclutch_{car}_selftest.c")];
    run(Command::new(compiler)
        .args(["-std=c99", "-ffp-contract=off"])
        .args(["-Wall", "-Wextra", "-Wconversion", "-Wdouble-promotion", "-pedantic", "-Werror"])
        .args(options)
        .args(sources)
        .arg(observer)
        .args(["-Wl,--gc-sections", "-o", "program"])
        .current_dir(folder));
}

pub(crate) fn exported(folder: &Folder, vehicle: &str) {
    let c_source = portable().map(|path| CSource::new(std::fs::read(path).unwrap()).unwrap());
    for file in export(&car_file(vehicle), &ExportOptions { c_source, ..ExportOptions::default() }).unwrap() {
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
    write_for(&folder, "harness.c", include_str!("harness.c"), name);
    let inputs: Vec<Input> = inputs.iter().map(Input::of).collect();
    std::fs::write(folder.0.join("inputs"), inputs.iter().flat_map(input_bytes).collect::<Vec<u8>>()).unwrap();
    let mut observer = OwnedObserver::new(&Image::of(&filter_of(vehicle)).unwrap().words).unwrap();
    let mut observer = observer.get().unwrap();
    let expected: Vec<u8> =
        inputs.iter().flat_map(|input| *observer.step(input).words()).flat_map(u32::to_ne_bytes).collect();
    for compiler in compilers() {
        for code in codes() {
            for level in ["-O0", "-O2", "-O3"] {
                build(&folder.0, code, compiler, &[level], "harness.c", name);
                run(Command::new("./program").args(["inputs", "estimates"]).current_dir(&folder.0));
                let estimates = std::fs::read(folder.0.join("estimates")).unwrap();
                assert!(estimates == expected, "{code:?} {compiler} {level}");
            }
        }
    }
}

fn write_for(folder: &Folder, file: &str, text: &str, car: &str) {
    let text = text.replace("@CAR@", car).replace("@CAR_UPPER@", &car.to_uppercase());
    std::fs::write(folder.0.join(file), text).unwrap();
}

/// The C checks itself while it runs: addresses, shifts, conversions, overflows.
#[test]
fn every_call_returns_the_same_from_the_library_and_from_c() {
    let folder = Folder::new("calls");
    exported(&folder, "six_speed.toml");
    write_for(&folder, "calls.c", include_str!("calls.c"), "six_speed");
    let said = codes().into_iter().map(|code| {
        let checked = ["-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"];
        let options = if code == Code::Portable { &checked[..] } else { &checked[..1] };
        build(&folder.0, code, "cc", options, "calls.c", "six_speed");
        run(Command::new("./program").current_dir(&folder.0))
    });
    let said: Vec<String> = said.collect();
    let lines: Vec<&str> = said[0].lines().collect();
    for line in [
        "memory is enough 0x1",
        "memory of a short image 0x0",
        "step before init 0x1",
        "gears -1 -1, phase -1",
        "init in no memory 0x2",
        "init off by four bytes 0x2",
        "init in little memory 0x80",
        "init of seven bytes 0x10",
        "init of a changed image 0x20",
        "init of another version 0x8",
        "init of no image at all 0x4",
        "init with 99 elements 0x40",
        "init with a value that is no number 0x40",
        "step after it 0x1",
        "is the one of the file 0x1",
        "init 0x0",
        "step of nothing 0x2002",
        "set what is damaged 0x4000",
    ] {
        assert!(lines.contains(&line), "{line}:\n{}", said[0]);
    }
    let sums = |what: &str| lines.iter().find_map(|line| line.strip_prefix(what)).unwrap_or_default().to_owned();
    assert_eq!(sums("run after a reset "), sums("the same, moved "));
    assert_ne!(sums("run on "), sums("run anew "));
    if let [library, c] = said.as_slice() {
        assert_eq!(library, c);
    }
}

#[test]
fn c_has_the_bits_of_the_filter_over_a_drive_and_sampled_shifts() {
    let filter = filter_of("eight_speed.toml");
    let inputs = [city(&filter), sampled_shifts(&filter, 36)].concat();
    c_has_the_bits("eight_speed.toml", "eight_speed", &inputs);
}

/// Simulink is not there: a stand-in of its header has what the block calls.
#[test]
fn the_block_of_simulink_has_the_estimates_of_the_step() {
    let folder = Folder::new("simulink");
    exported(&folder, "eight_speed.toml");
    let filter = filter_of("eight_speed.toml");
    let inputs: Vec<Input> = sampled_shifts(&filter, 4).iter().map(Input::of).collect();
    std::fs::write(folder.0.join("inputs"), inputs.iter().flat_map(input_bytes).collect::<Vec<u8>>()).unwrap();
    for (name, text) in [
        ("simstruc.h", include_str!("simulink/simstruc.h")),
        ("cg_sfun.h", include_str!("simulink/cg_sfun.h")),
        ("main.c", include_str!("simulink/main.c")),
    ] {
        write_for(&folder, name, text, "eight_speed");
    }
    build(&folder.0, Code::Library, "cc", &["-O1"], "main.c", "eight_speed");
    let said = run(Command::new("./program").arg("inputs").current_dir(&folder.0));
    let numbers: Vec<usize> =
        said.split(|c: char| !c.is_ascii_digit()).filter_map(|number| number.parse().ok()).collect();
    let [steps, clutches, ranges, different] = numbers[..] else { panic!("{said}") };
    assert!(steps == inputs.len() && clutches > steps / 20 && ranges > clutches / 2 && different == 0, "{said}");
}

#[test]
fn the_example_of_every_gearbox_compiles_and_runs() {
    for name in ["dual_clutch", "four_speed_one_way", "ten_speed"] {
        let folder = Folder::new(name);
        exported(&folder, &format!("{name}.toml"));
        for code in codes() {
            build(&folder.0, code, "cc", &["-O1"], "example.c", name);
            let said = run(Command::new("./program").current_dir(&folder.0));
            assert!(said.starts_with("self-test 0, init 0x0\n"), "{name}, {code:?}: {said}");
        }
    }
}

#[test]
fn the_image_of_the_c_source_has_the_bytes_of_the_binary_one() {
    let folder = Folder::new("image");
    exported(&folder, "six_speed.toml");
    let main = "#include <stdio.h>\n#include \"wetclutch_six_speed.h\"\nint main(void) {\n  return fwrite(&wetclutch_six_speed_parameters, \
                sizeof wetclutch_six_speed_parameters, 1, fopen(\"image\", \"wb\")) == 1 ? 0 : 1;\n}\n";
    std::fs::write(folder.0.join("main.c"), main).unwrap();
    build(&folder.0, Code::Library, "cc", &[], "main.c", "six_speed");
    run(Command::new("./program").current_dir(&folder.0));
    let [c, binary] =
        ["image", "wetclutch_six_speed_parameters.bin"].map(|name| std::fs::read(folder.0.join(name)).unwrap());
    assert!(c == binary);
}
