//! Errors of the index of messages that no other test provokes: each with its cause, and what is printed.

use crate::support::{BENCH, EXPERIMENT, Folder, ROOT, VEHICLE, refused, said, wetclutch};

/// Runs a command that is wrong; its message has these words and a hint.
fn provokes(arguments: &[&str], words: &str) {
    let text = refused(&wetclutch(arguments));
    assert!(text.starts_with("error: ") && text.contains(words) && text.contains("\nhint: "), "{arguments:?}: {text}");
}

fn car() -> String {
    format!("{ROOT}vehicles/eight_speed.toml")
}

#[test]
fn files_that_are_no_logs_are_named() {
    let folder = Folder::new("no-logs");
    let rest = "a".repeat(40);
    let cases: [(&[u8], &str); 5] = [
        (b"7z\xbc\xaf\x27\x1c\0\x04", "this is a 7z archive"),
        (b"Rar!\x1a\x07\x01\0", "this is a RAR archive"),
        (b"ARROW1\0\0", "this is an Arrow or Feather file"),
        (b"TDSm\x0e\0\0\0", "this is a TDMS file"),
        (b"  can0  123   [1]  01\n  can0  123   [1]  02\n", "frames as candump prints them, without time stamps"),
    ];
    for (bytes, words) in cases {
        let log = folder.write("log", [bytes, rest.as_bytes()].concat());
        provokes(&["inspect", &log], words);
    }
}

#[test]
fn channels_and_maps_that_do_not_fit_the_command_are_named() {
    let folder = Folder::new("no-map");
    let log = folder.write("log.csv", "time_s,turbine_speed_rad_s,output_speed_rad_s\n0,1,2\n0.01,2,3\n0.02,2,3\n");
    provokes(&["inspect", &log, "--shifts"], "--shifts needs the channels of the signals");
    provokes(&["inspect", &log, "--channel", "engine"], "`engine` is not ROLE=NAME");
    let map = folder.write("map.toml", "dbc = \"no.dbc\"\n[channel.engine_speed]\nname = \"N\"\n");
    provokes(&["inspect", &log, "--map", &map], "`dbc` leads to ");
    let semicolons = folder.write("semicolons.csv", std::fs::read_to_string(&log).unwrap().replace(',', ";"));
    provokes(&["estimate", &semicolons, "--vehicle", &car()], "the columns are separated by `;`");
    let channels = ["turbine_speed", "output_speed"].map(|role| format!("{role}={role}_rad_s"));
    let mapped = ["--channel", &channels[0], "--channel", &channels[1]];
    let text = ["init", "--from-log", &log, "--mass-kg", "1500", "-o", &folder.path("car.toml")];
    assert!(refused(&wetclutch(&[&text[..], &mapped].concat())).contains("hint: "));
    // A bus log whose stamps are the times between frames.
    let deltas: String = (0..50).map(|i| format!("(0.0{:02}) can0 100#01E803\n", 50 - i)).collect();
    let dbc =
        folder.write("bus.dbc", "VERSION \"\"\n\nBU_: A\n\nBO_ 256 X: 8 A\n SG_ S : 0|16@1+ (1,0) [0|0] \"rpm\" A\n");
    let text = said(&wetclutch(&["inspect", &folder.write("d.log", deltas), "--dbc", &dbc]));
    assert!(text.contains("warning: the time stamps do not rise") && text.contains("\nhint: log with"), "{text}");
}

#[test]
fn options_for_other_files_are_named() {
    let folder = Folder::new("other-files");
    let (car, out) = (car(), folder.path("out"));
    let city = format!("{ROOT}drives/city.toml");
    let gearbox = format!("{ROOT}gearboxes/8hp.toml");
    provokes(&["simulate", EXPERIMENT, "--vehicle", &car, "-o", &out], "an experiment names its vehicle file");
    provokes(&["simulate", &city, "--scenario", "x", "-o", &out], "a drive has no scenarios");
    provokes(&["design", &car, "--page", &folder.path("p.html")], "--page is for the gains of one shift");
    provokes(&["check", &gearbox, &gearbox, "-o", &out], "-o takes the diagrams of one gearbox");
    provokes(&["check", VEHICLE, VEHICLE, "--page", &folder.path("p.html")], "--page takes one file");
    let drive = format!(
        "vehicle = '{car}'\nname = \"d\"\nsample_time_s = 0.01\n[[segment]]\nduration_s = 3\nthrottle = 0.2\n[[shift]]\ntime_s = 1\ngear = \"12\"\n"
    );
    provokes(&["simulate", &folder.write("drive.toml", drive), "-o", &out], "the gearbox has no gear \"12\"");
    provokes(&["export", &car, "--check-elf", &city, "-o", &out], "not a program that can be read");
    provokes(&["export", &car, "--check-elf", &folder.path(""), "-o", &out], "no linked program: it is a regular file");
    let program = env!("CARGO_BIN_EXE_wetclutch");
    provokes(&["export", &car, "--check-elf", program, "-o", &out], "is not in the program");
    provokes(&["fit", "-", "--vehicle", VEHICLE, "-o", &folder.path("f.toml")], "a fit reads a log twice");
}

#[test]
fn studies_that_do_not_fit_their_folder_are_named() {
    let folder = Folder::new("study-folders");
    let study = "name = \"s\"\ntitle = \"S\"\nplan = \"latin-hypercube\"\nruns = 2\nseed = 1\nobservers = [\"open loop\"]\n[[factor]]\nkey = \"car.vehicle.mass_kg\"\nrange = [1300, 2000]\n";
    let study = folder.write("study.toml", format!("experiment = '{BENCH}'\n{study}"));
    let [whole, part, merged] = ["whole", "part", "merged"].map(|name| folder.path(name));
    said(&wetclutch(&["study", &study, "-o", &whole]));
    provokes(&["study", &study, "-o", &whole], "the study is complete");
    said(&wetclutch(&["study", &study, "--shard", "1/2", "-o", &part]));
    provokes(&["study", &study, "--shard", "2/2", "-o", &part], "this is shard 1/2, expected shard 2/2");
    provokes(&["merge", &study, &part, "-o", &merged], "shard 2/2 is missing");
    provokes(&["merge", &study, &whole, "-o", &merged], "this is a whole study, expected a shard");
    provokes(&["worst-case", &study, "--observer", "nobody", "-o", &merged], "the study has no observer `nobody`");
}
