//! A CAN bus through a pipe, as `candump -L can0 | wetclutch estimate -` has it.

use std::fmt::Write as _;
use std::io::Write as _;
use std::process::{Command, Stdio};

use crate::support::{EXPERIMENT, Folder, VEHICLE, printed, said, wetclutch};

const DBC: &str = "VERSION \"\"\n\nBU_: TCU\n\nBO_ 256 Speeds: 8 TCU\n SG_ N_Eng : 0|16@1+ (0.01,0) [0|655] \"rad/s\" TCU\n SG_ N_Turb : 16|16@1+ (0.01,0) [0|655] \"rad/s\" TCU\n SG_ N_Out : 32|16@1+ (0.01,0) [0|655] \"rad/s\" TCU\n SG_ N_Wheel : 48|16@1+ (0.01,0) [0|655] \"rad/s\" TCU\n\nBO_ 257 Valve: 2 TCU\n SG_ I_On : 0|16@1+ (0.1,0) [0|6553] \"mA\" TCU\n";
const MAP: &str = "dbc = \"bus.dbc\"\n[channel.engine_speed]\nname = \"N_Eng\"\n[channel.turbine_speed]\nname = \"N_Turb\"\n[channel.output_speed]\nname = \"N_Out\"\n[channel.wheel_speed]\nname = \"N_Wheel\"\n[channel.oncoming_current]\nname = \"I_On\"\n";
/// The columns of the frames, with the steps of their bits.
const SPEEDS: [&str; 4] = ["engine_speed_rad_s", "turbine_speed_rad_s", "output_speed_rad_s", "wheel_speed_rad_s"];
const SPEED_STEP_RAD_S: f64 = 0.01;
const CURRENT_STEP_A: f64 = 1e-4;

/// A table as `candump -L` writes the frames of a bus.
fn frames(table: &str) -> String {
    let mut lines = table.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let mut log = String::new();
    for line in lines.step_by(10) {
        let cells: Vec<&str> = line.split(',').collect();
        let number = |name: &str| cells[names.iter().position(|of| *of == name).unwrap()].parse::<f64>().unwrap();
        let bits = |name: &str, step: f64| ((number(name) / step).round() as u16).swap_bytes();
        let time_s = 1.7e9 + number("time_s");
        write!(log, "({time_s:.6}) can0 100#").unwrap();
        SPEEDS.iter().for_each(|name| write!(log, "{:04X}", bits(name, SPEED_STEP_RAD_S)).unwrap());
        writeln!(log, "\n({time_s:.6}) can0 101#{:04X}", bits("oncoming_current_a", CURRENT_STEP_A)).unwrap();
    }
    log
}

#[test]
fn a_bus_is_estimated_through_a_pipe_as_from_its_file() {
    let folder = Folder::new("piped-bus");
    said(&wetclutch(&["simulate", EXPERIMENT, "-o", &folder.path("drive")]));
    let log = folder.write("bus.log", frames(&folder.read("drive/e1.csv")));
    folder.write("bus.dbc", DBC);
    let map = folder.write("map.toml", MAP);
    let estimate = ["--map", &map, "--vehicle", VEHICLE];
    said(&wetclutch(&[&["estimate", &log, "-o", &folder.path("file.csv")][..], &estimate].concat()));
    let of_file = folder.read("file.csv");
    for more in [&[][..], &["--follow"]] {
        let mut child = Command::new(env!("CARGO_BIN_EXE_wetclutch"))
            .args([&["estimate", "-"][..], more, &estimate].concat())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let (mut candump, frames) = (child.stdin.take().unwrap(), folder.read("bus.log"));
        let sends = std::thread::spawn(move || candump.write_all(frames.as_bytes()));
        let output = child.wait_with_output().unwrap();
        sends.join().unwrap().unwrap();
        assert!(printed(&output) == of_file, "{more:?}");
    }
    let pressures = of_file.lines().skip(1).map(|row| row.split(',').nth(1).unwrap().parse::<f64>().unwrap());
    let highest_pa = pressures.fold(0.0, f64::max);
    assert!((0.3e6..3e6).contains(&highest_pa) && of_file.lines().count() > 900, "{highest_pa}");
}
