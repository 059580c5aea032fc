//! Errors of the index of messages that no other test provokes: each with its cause, and what is printed.

use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use crate::support::{BENCH, EXPERIMENT, Folder, ROOT, VEHICLE, refused, said, shown, stderr, wetclutch};

/// Runs a command that is wrong; its message has these words and a hint.
fn provokes(arguments: &[&str], words: &str) {
    let text = refused(&wetclutch(arguments));
    assert!(text.starts_with("error: ") && text.contains(words) && text.contains("\nhint: "), "{arguments:?}: {text}");
}

/// Runs a command that is wrong; its message has these words, and says by them what is expected.
fn names(arguments: &[&str], words: &str) {
    let text = refused(&wetclutch(arguments));
    assert!(text.starts_with("error: ") && text.contains(words), "{arguments:?}: {text}");
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
fn a_clutch_that_fills_too_slowly_and_is_too_weak_is_named_by_its_shift() {
    let folder = Folder::new("endless-shift");
    let slow = folder.write(
        "slow.toml",
        format!(
            "name = \"slow\"\ngearbox = \"{ROOT}gearboxes/8hp.toml\"\n[fill]\nflow_max_m3_s = 1e-6\n[hydraulics]\nline_pressure_pa = 0.4e6\n"
        ),
    );
    let run = wetclutch(&["demo", "--vehicle", &slow, "-o", &folder.path("out")]);
    let text = stderr(&run);
    assert!(
        !run.status.success()
            && text.contains("error: the shift 1-2 does not end within 6 s\nhint: its oncoming clutch"),
        "{text}"
    );
}

#[test]
fn channels_and_maps_that_do_not_fit_the_command_are_named() {
    let folder = Folder::new("no-map");
    let log = folder.write("log.csv", "time_s,turbine_speed_rad_s,output_speed_rad_s\n0,1,2\n0.01,2,3\n0.02,2,3\n");
    let other = folder.write("other.csv", "time_s,nT,nO\n0,1,2\n0.01,2,3\n0.02,2,3\n");
    provokes(&["inspect", &other, "--shifts"], "--shifts needs the channels of the signals");
    provokes(&["inspect", &log, "--channel", "engine"], "`engine` is not SIGNAL=NAME");
    let map = folder.write("map.toml", "dbc = \"no.dbc\"\n[channel.engine_speed]\nname = \"N\"\n");
    provokes(&["inspect", &log, "--map", &map], "`dbc` names ");
    let semicolons = folder.write("semicolons.csv", std::fs::read_to_string(&log).unwrap().replace(',', ";"));
    provokes(&["estimate", &semicolons, "--vehicle", &car()], "the columns are separated by `;`");
    let duty = "time_s,engine_speed_rad_s,turbine_speed_rad_s,output_speed_rad_s,oncoming_duty_percent\n0,1,1,1,1\n";
    let duty = folder.write("duty.csv", duty);
    provokes(
        &["estimate", &duty, "--vehicle", VEHICLE],
        "the log has `oncoming_duty_percent`, but the command of the vehicle's valve is",
    );
    let channels = ["turbine_speed", "output_speed"].map(|role| format!("{role}={role}_rad_s"));
    let mapped = ["--channel", &channels[0], "--channel", &channels[1]];
    let text = ["init", "--from-log", &log, "--mass-kg", "1500", "-o", &folder.path("car.toml")];
    assert!(refused(&wetclutch(&[&text[..], &mapped].concat())).contains("the log does not show this: "));
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
    provokes(
        &["export", &car, "--c", &city, "-o", &out],
        "not the C of the observer: it does not define HEAP, STACK_BYTES and IMAGE_VERSION",
    );
    provokes(&["export", &car, "--c", program, "-o", &out], "not the C of the observer: it is not text");
    let cut = folder.write("cut.c", "#define IMAGE_VERSION 1u\n#define HEAP 80u\n#define STACK_BYTES 64u\n");
    provokes(&["export", &car, "--c", &cut, "-o", &out], "cut.c: not the C of the observer: it is not whole");
    let old = "#define IMAGE_VERSION 1u\n#define HEAP 80u\n#define STACK_BYTES 64u\n/* The end of wetclutch.c. */\n";
    let old = folder.write("wetclutch.c", old);
    provokes(&["export", &car, "--c", &old, "-o", &out], "not the C of the observer: it takes images of version 1");
    provokes(&["export", &car, "--c", &folder.path(""), "-o", &out], "no wetclutch.c: it is a regular file");
    let library = ["export", &car, "--shift", "1-2", "--fmu", program, "-o", &out];
    provokes(&library, "not a shared library of a model: it lacks the functions of FMI 2.0 and 3.0");
    provokes(&["design", &car, "--observer", "sliding"], "`--observer sliding` has no certificate");
    let of_pipe = ["estimate", "-", "--vehicle", &car, "--learnt", "-"];
    provokes(&of_pipe, "--learnt -: what was learnt is read from a file and written to it");
    let log = folder.write("log.csv", "time_s\n0\n");
    let two = [&log, &log, "--vehicle", &car, "--follow", "-o", &out];
    provokes(&[&["estimate"][..], &two].concat(), "--follow takes one log");
    names(
        &["estimate", EXPERIMENT, "--vehicle", VEHICLE, "--shifts", "1"],
        "expected two gears by their names, such as 1-2",
    );
    names(&["study", EXPERIMENT, "--shard", "3/2", "-o", &out], "expected I/N with I from 1 to N, such as 2/4");
}

#[test]
fn formats_that_need_a_whole_file_are_named_where_they_come_through_a_pipe() {
    let log = std::fs::File::open(format!("{ROOT}crates/logs/tests/data/plain_410.mf4")).unwrap();
    let mut inspect = Command::new(env!("CARGO_BIN_EXE_wetclutch"));
    let output = inspect.args(["inspect", "-"]).stdin(Stdio::from(log)).output().unwrap();
    assert!(refused(&output).contains("MDF and Parquet files cannot be read from a pipe\nhint: give the file itself"));
}

/// The eight-speed car with an engine that does not even turn the pump of its converter.
fn weak_car(folder: &Folder) -> String {
    let text = std::fs::read_to_string(car()).unwrap().replace("../gearboxes", &format!("{ROOT}gearboxes"));
    let (begin, end) = (text.find("[engine.torque]").unwrap(), text.find("[converter]").unwrap());
    let map = "[engine.torque]\nthrottle = [0, 1]\nspeed_rad_s = [80, 700]\ntorque_n_m = [[-2, 12], [-16, 17]]\n";
    let text = [&text[..begin], map, &text[end..]].concat().replace("drag_n_m_s = 0.047", "drag_n_m_s = 0.5");
    folder.write("weak.toml", text)
}

/// The gearbox file of two gears with these engaged elements, and these shafts, each with one brake or two.
fn braked_gearbox(engaged: [&str; 2], brakes: &[(&str, usize)]) -> String {
    const PACK: &str = "pack = { friction_faces = 4, mean_radius_m = 0.14, piston_area_m2 = 0.012, return_spring_n = 600, friction_coefficient = 0.13 }";
    let mut text = "name = \"braked\"\nlevel = \"stick-diagram\"\ninput = \"turbine\"\noutput = \"carrier\"\nline_pressure_pa = 1e6\n\
        planetary_set = [{ sun = \"turbine\", carrier = \"carrier\", ring = \"ring\", sun_teeth = 40, ring_teeth = 60 }]\n"
        .to_owned();
    for (name, engaged) in ["1", "2"].iter().zip(engaged) {
        text += &format!("[[gear]]\nname = \"{name}\"\nengaged = [{engaged}]\n");
    }
    for shaft in ["turbine", "ring", "carrier"].iter().chain(brakes.iter().map(|(shaft, _)| shaft)) {
        text += &format!("[[shaft]]\nname = \"{shaft}\"\ninertia_kg_m2 = 0.02\n");
    }
    let mut element = |name: &str, kind: &str, input: &str, output: &str| {
        text += &format!(
            "[[element]]\nname = \"{name}\"\nkind = \"{kind}\"\ninput = \"{input}\"\noutput = \"{output}\"\n{PACK}\n"
        );
    };
    element("A", "brake", "housing", "ring");
    element("B", "clutch", "turbine", "ring");
    for (shaft, count) in brakes {
        (0..*count).for_each(|at| element(&format!("{shaft}{at}"), "brake", "housing", shaft));
    }
    text
}

#[test]
fn gearboxes_that_cannot_be_driven_are_named_with_what_to_do() {
    let folder = Folder::new("undriven-gearboxes");
    let shafts: Vec<String> = (0..6).map(|at| format!("x{at}")).collect();
    let brakes: Vec<(&str, usize)> = shafts.iter().map(|shaft| (shaft.as_str(), 1)).collect();
    let engaged = |first: &str| {
        format!("\"{first}\", ") + &shafts.iter().map(|s| format!("\"{s}0\"")).collect::<Vec<_>>().join(", ")
    };
    let large = braked_gearbox([&engaged("A"), &engaged("B")], &brakes);
    // Both elements change between the gears.
    let double = braked_gearbox(["\"A\", \"x0\"", "\"B\", \"x1\""], &[("x", 2)]);
    let drive = |car: &str, more: &str| {
        let text = format!("name = \"d\"\nvehicle = \"{car}\"\n{more}[[segment]]\nduration_s = 4\nthrottle = 0.1\n");
        folder.write("d.toml", text)
    };
    for (gearbox, launch, words) in [
        (large, "converter", "the train has more than 8 degrees of freedom"),
        (double, "clutch", "gear 1 has no clutch that could slip"),
    ] {
        folder.write("gearbox.toml", gearbox);
        folder.write("car.toml", format!("name = \"c\"\ngearbox = \"gearbox.toml\"\nlaunch = \"{launch}\"\n"));
        let text = stderr(&wetclutch(&["simulate", &drive("car.toml", ""), "-o", &folder.path("out")]));
        assert!(text.contains(words) && text.contains("\nhint: "), "{text}");
    }
    let more = "[start]\ngear = \"N\"\n[[shift]]\ntime_s = 2\ngear = \"3\"\n";
    let text = stderr(&wetclutch(&["simulate", &drive(&car(), more), "-o", &folder.path("out")]));
    assert!(
        text.contains("gear 3 does not follow from neutral by one clutch\nhint: these gears do: R, 1, 2, "),
        "{text}"
    );
}

#[test]
fn drives_that_no_car_can_make_are_named_and_leave_nothing() {
    let folder = Folder::new("impossible-drives");
    let weak = weak_car(&folder);
    for (car, start, words) in [
        (&car(), "gear = \"1\"\nvehicle_m_s = 60", "in gear 1 at 60 m/s the gearbox input would turn at "),
        (&weak, "vehicle_m_s = 0", "the engine stalls at "),
    ] {
        let drive = "sample_time_s = 0.01\n[[segment]]\nduration_s = 5\nthrottle = 0.0\n";
        let drive = folder.write("drive.toml", format!("vehicle = '{car}'\nname = \"d\"\n{drive}[start]\n{start}\n"));
        let output = wetclutch(&["simulate", &drive, "-o", &folder.path("new/out")]);
        assert!(!output.status.success() && stderr(&output).contains(words), "{words}: {}", stderr(&output));
        assert!(!Path::new(&folder.path("new")).exists(), "{words}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn shared_libraries_of_other_models_and_processors_are_named() {
    let folder = Folder::new("libraries");
    let export = |library: &str| {
        ["export", &car(), "--shift", "1-2", "--fmu", library, "-o", &folder.path("out")].map(str::to_owned)
    };
    let library = |name: &str, functions: &[&str]| {
        let source: String = functions.iter().map(|function| format!("void {function}(void) {{}}\n")).collect();
        let (source, library) = (folder.write(&format!("{name}.c"), source), folder.path(&format!("{name}.so")));
        assert!(Command::new("cc").args(["-shared", "-fPIC", "-o", &library, &source]).status().unwrap().success());
        library
    };
    let refused = |library: &str, words: &str| provokes(&export(library).each_ref().map(String::as_str), words);
    refused(&library("other", &["fmi2DoStep", "fmi3DoStep"]), "it is not wetclutch_fmu, but that of another model");
    // The same for a processor of another kind: in the head of the file stands its number.
    let own = library("own", &["fmi2DoStep", "fmi3DoStep", "wetclutch_fmu"]);
    let mut bytes = std::fs::read(own).unwrap();
    bytes[18..20].copy_from_slice(&[0x16, 0]);
    refused(&folder.write("foreign.so", bytes), "not a shared library of a model: it is for S390x");
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
    // A shard that has lost a row, and no part of a row.
    said(&wetclutch(&["study", &study, "--shard", "2/2", "-o", &folder.path("rest")]));
    let rows = folder.read("rest/runs.csv");
    folder.write("rest/runs.csv", format!("{}\n", rows.lines().next().unwrap()));
    provokes(&["merge", &study, &part, &folder.path("rest"), "-o", &merged], "contains 0 of 1 runs");
}

/// Estimates the rows of a simulated log that lie in these times, with another current.
fn estimate_of(folder: &Folder, times_s: [f64; 2], current: impl Fn(usize, &str) -> String, more: &[&str]) -> Output {
    if !Path::new(&folder.path("drive")).exists() {
        said(&wetclutch(&["simulate", EXPERIMENT, "-o", &folder.path("drive")]));
    }
    let text = folder.read("drive/e1_measured.csv");
    let names = text.lines().next().unwrap();
    let place = names.split(',').position(|name| name == "oncoming_current_a").unwrap();
    let mut log = format!("{names}\n");
    for (at, line) in text.lines().skip(1).step_by(10).enumerate() {
        let mut cells: Vec<&str> = line.split(',').collect();
        if (times_s[0]..times_s[1]).contains(&cells[0].parse().unwrap()) {
            let current = current(at, cells[place]);
            cells[place] = &current;
            writeln!(log, "{}", cells.join(",")).unwrap();
        }
    }
    let log = folder.write("log.csv", log);
    wetclutch(&[&["estimate", &log, "--vehicle", VEHICLE, "-o", &folder.path("out.csv")], more].concat())
}

#[test]
fn logs_of_another_car_are_named() {
    let folder = Folder::new("other-car");
    let (all, given) = ([0.0, 20.0], |_: usize, current: &str| current.to_owned());
    // Always in a gear above those of the file.
    let channels = [("engine_speed", ""), ("turbine_speed", "scale = 1.6"), ("output_speed", "")];
    let channels =
        channels.map(|(role, scale)| format!("[channel.{role}]\nname = \"{role}_rad_s\"\n{scale}\n")).concat();
    let command = "[channel.oncoming_current]\nname = \"oncoming_current_a\"\n";
    let map = folder.write("map.toml", format!("[gearbox]\nratios = [4.0, 2.5, 1.0]\n{channels}{command}"));
    for (output, words) in [
        (
            estimate_of(&folder, [1.0, 7.0], given, &["--map", &map]),
            "the log is never in the gears of the vehicle file's shift",
        ),
        (estimate_of(&folder, [1.0, 7.0], given, &["--shifts", "1-2"]), "--shifts 1-2: no shift was found in the log"),
        (
            estimate_of(&folder, all, |_, _| "0.6".to_owned(), &["--observer", "rigid"]),
            "estimates are impossible for this car, most of them `limited_to_range`",
        ),
        (
            estimate_of(&folder, all, |at, current| [current, "3", "-1"][at % 3].to_owned(), &[]),
            "readings of oncoming_current were refused: they are impossible for this car",
        ),
    ] {
        let text = refused(&output);
        assert!(text.contains(words) && text.contains("\nhint: "), "{words}: {text}");
    }
}

#[test]
fn changed_rows_of_studies_of_cars_are_named() {
    let folder = Folder::new("car-rows");
    let study = format!("name = \"s\"\ntitle = \"S\"\nvehicle = '{}'\nshifts = [\"1-2\"]\nruns = 2\n", car());
    let study = folder.write("study.toml", study);
    let [first, second, merged] = ["first", "second", "merged"].map(|name| folder.path(name));
    said(&wetclutch(&["study", &study, "--shard", "1/2", "-o", &first]));
    said(&wetclutch(&["study", &study, "--shard", "2/2", "-o", &second]));
    let rows = folder.read("second/runs.csv");
    for (old, new, words) in [
        ("\n1,", "\n7,", "expected run 1, found `7`"),
        (",ok,", ",good,", "there is no status `good`"),
        (",ok,", ",ok,1,", "the row has another number of cells"),
    ] {
        assert!(rows.contains(old), "{rows}");
        folder.write("second/runs.csv", rows.replace(old, new));
        provokes(&["merge", &study, &first, &second, "-o", &merged], words);
    }
}

#[test]
fn studies_without_a_complete_shift_are_named() {
    let folder = Folder::new("no-shift");
    let bench = std::fs::read_to_string(BENCH).unwrap();
    let vehicle = format!("vehicle = '{VEHICLE}'");
    let lines = bench.lines().map(|line| match line.split(" =").next() {
        Some("vehicle") => vehicle.as_str(),
        Some("duration_s") if line.ends_with("= 9.5") => "duration_s = 7.6",
        _ => line,
    });
    folder.write("short.toml", lines.collect::<Vec<_>>().join("\n"));
    let study = "name = \"s\"\ntitle = \"S\"\nexperiment = \"short.toml\"\nplan = \"latin-hypercube\"\nruns = 2\nseed = 1\nobservers = [\"open loop\"]\n[[factor]]\nkey = \"car.vehicle.mass_kg\"\nrange = [1300, 2000]\n";
    let study = folder.write("study.toml", study);
    let out = folder.path("out");
    for (arguments, words) in [
        (&["error-bound", &study, "-o", &out][..], "no run has a complete shift: there is no model error to compute"),
        (
            &["worst-case", &study, "--observer", "open loop", "-o", &out],
            "no run of the study has a complete shift to start from",
        ),
    ] {
        let output = wetclutch(arguments);
        assert!(output.status.code() == Some(1) && stderr(&output).contains(words), "{words}: {}", stderr(&output));
    }
}

#[test]
fn a_car_without_a_stick_diagram_is_not_simulated() {
    let folder = Folder::new("no-diagram");
    let shares = std::fs::read_to_string(format!("{ROOT}crates/config/tests/gearboxes/shares.toml")).unwrap();
    let pack = "pack = { friction_faces = 4, mean_radius_m = 0.14, piston_area_m2 = 0.012, return_spring_n = 600, friction_coefficient = 0.13 }";
    folder.write("shares.toml", shares.replace("kind = \"clutch\"", &format!("kind = \"clutch\"\n{pack}")));
    let car = folder.write("car.toml", "name = \"s\"\ngearbox = \"shares.toml\"\n");
    let words = "the car cannot be simulated: the gearbox has no stick diagram";
    provokes(&["sensitivity", &car], words);
    let output = wetclutch(&["export", &car, "-o", &folder.path("out")]);
    let text = format!("the shift 1-2 of the self-test cannot be simulated: {words}");
    assert!(output.status.code() == Some(1) && stderr(&output).contains(&text), "{}", stderr(&output));
}

#[test]
fn commands_that_come_late_keep_the_given_file() {
    let folder = Folder::new("late");
    let city = std::fs::read_to_string(format!("{ROOT}drives/city.toml")).unwrap();
    let city = city.replace("../vehicles", &format!("{ROOT}vehicles")).replace("repetitions = 20", "repetitions = 3");
    said(&wetclutch(&["simulate", &folder.write("drive.toml", city), "-o", &folder.path("drive")]));
    let text = folder.read("drive/city_measured.csv");
    let mut lines = text.lines();
    let names = lines.next().unwrap();
    let currents: Vec<bool> = names.split(',').map(|name| name.ends_with("_current_a")).collect();
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    let mut log = format!("{names}\n");
    for (at, row) in rows.iter().enumerate() {
        // The currents of 80 ms before.
        let before = &rows[at.saturating_sub(8)];
        let cells = currents.iter().enumerate().map(|(at, is_current)| if *is_current { before[at] } else { row[at] });
        writeln!(log, "{}", cells.collect::<Vec<_>>().join(",")).unwrap();
    }
    let log = folder.write("late.csv", log);
    let text = shown(&wetclutch(&["fit", &log, "--vehicle", &car(), "-o", &folder.path("fitted.toml")]));
    assert!(text.contains("warning: the commands of these logs are 8"), "{text}");
    assert!(text.contains("Then fit again. The values above are those with corrected times of the commands"), "{text}");
}

#[test]
fn cars_that_are_not_as_their_file_says_are_warned_of() {
    let folder = Folder::new("other-than-file");
    let simulated = |drive: &str| {
        let drive = folder.write("drive.toml", drive.replace("../vehicles", &format!("{ROOT}vehicles")));
        said(&wetclutch(&["simulate", &drive, "-o", &folder.path("drive"), "--force"]));
    };
    let warned = |log: &str, words: &str| {
        let log = folder.path(log);
        let text = said(&wetclutch(&["estimate", &log, "--vehicle", &car(), "-o", &folder.path("out.csv"), "--force"]));
        assert!(text.contains(words), "{words}: {text}");
    };
    let faults = std::fs::read_to_string(format!("{ROOT}drives/faults.toml")).unwrap();
    simulated(&faults);
    warned("drive/faults_measured.csv", "warning: one of C, D slips in gear 5, 7 since ");
    // Two weak elements.
    let weak = |element: &str| {
        format!("[[fault]]\nkind = \"weak-clutch\"\nelement = \"{element}\"\nfriction_factor = 0.06\nfrom_s = 20\n")
    };
    let drive = faults.split("[[fault]]").next().unwrap();
    simulated(&format!("{drive}{}{}", weak("A"), weak("C")));
    warned("drive/faults_measured.csv", "in all: no single element explains it\nhint: check the line pressure");
    simulated(&faults.replace(
        "element = \"C\"\nfriction_factor = 0.1\nfrom_s = 60",
        "element = \"E\"\nfriction_factor = 0.03\nfrom_s = 20",
    ));
    warned("drive/faults_measured.csv", "in all: it is engaged there and has held no more torque since");
    // All currents are 50 mA too high.
    simulated(
        &std::fs::read_to_string(format!("{ROOT}drives/city.toml"))
            .unwrap()
            .replace("repetitions = 20", "repetitions = 1"),
    );
    let text = folder.read("drive/city_measured.csv");
    let is_current = |name: &str| name.starts_with("element_") && name.ends_with("_current_a");
    let currents: Vec<bool> = text.lines().next().unwrap().split(',').map(is_current).collect();
    let higher = |(cell, is_current): (&str, &bool)| match cell.parse::<f64>() {
        Ok(current) if *is_current => (current + 0.05).to_string(),
        _ => cell.to_owned(),
    };
    let row = |line: &str| line.split(',').zip(&currents).map(higher).collect::<Vec<_>>().join(",") + "\n";
    folder.write("higher.csv", text.lines().map(row).collect::<String>());
    warned("higher.csv", "warning: by the shifts the car is outside its error budget, from ");
}

#[test]
fn a_vehicle_file_does_not_take_the_place_of_its_gearbox_file() {
    let folder = Folder::new("one-name");
    let numbers =
        ["--mass-kg", "1900", "--wheel-radius-m", "0.33", "--final-ratio", "2.8", "--engine-torque-n-m", "400"];
    let car = folder.path("8hp.toml");
    let refusal = refused(&wetclutch(&[&["init", "--gearbox", "8hp", "-o", &car], &numbers[..]].concat()));
    assert!(refusal.contains("the gearbox file has this name") && refusal.contains("car.toml`"), "{refusal}");
    assert!(!std::path::Path::new(&car).exists());
}
