//! Results have the same bits whatever instructions the processor has.

use std::process::Command;

use crate::support::{Folder, ROOT, VEHICLE, printed};

const DRIVE: &str = "name = \"Short\"\n[[segment]]\nduration_s = 15\nthrottle = [0.1, 0.4]\n";

/// Simulated readings, their estimate and designed gains, as a processor with these of its instructions gives them to the C library.
/// The mathematical functions of glibc round otherwise with fused multiplication; other systems ignore the variable.
fn results(name: &str, instructions: &str) -> [String; 3] {
    let folder = Folder::new(name);
    let run = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_wetclutch"));
        printed(&command.args(arguments).env("GLIBC_TUNABLES", instructions).output().unwrap())
    };
    let vehicle = format!("{ROOT}vehicles/six_speed.toml");
    let drive = folder.write("drive.toml", DRIVE);
    run(&["simulate", &drive, "--vehicle", &vehicle, "-o", &folder.path("out")]);
    let (log, estimate) = (folder.path("out/short_measured.csv"), folder.path("estimate.csv"));
    run(&["estimate", &log, "--vehicle", &vehicle, "-o", &estimate]);
    [folder.read("out/short.csv"), folder.read("estimate.csv"), run(&["design", VEHICLE])]
}

#[test]
fn drives_estimates_and_gains_do_not_depend_on_instructions_of_the_processor() {
    let all = results("all-instructions", "");
    let few = results("few-instructions", "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F,-AVX2_Usable,-FMA_Usable");
    assert!(all.iter().all(|text| text.lines().count() > 5));
    for (name, (all, few)) in ["drive", "estimate", "gains"].iter().zip(all.iter().zip(few)) {
        assert!(*all == few, "{name} differs");
    }
}
