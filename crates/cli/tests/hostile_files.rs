//! Files that are no regular files, too large, or with names that a terminal would obey.

use std::process::{Command, Output};

use crate::support::{
    EXPERIMENT, Folder, ROOT, VEHICLE, printed, refused, said, stderr, stdout, wetclutch, without_excerpts,
};

const CAR: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../vehicles/eight_speed.toml");
const DRIVE: &str = "name = \"d\"\nvehicle = \"car.toml\"\n[[segment]]\nduration_s = 3\nthrottle = 0.2\n";

/// Everything that takes a text file: the arguments, and the file that is wrong, by its place in them or in another file.
fn readers(folder: &Folder, wrong: &str) -> Vec<(&'static str, Output)> {
    let quoted = format!("\"{wrong}\"");
    let text = |name: &str| std::fs::read_to_string(format!("{ROOT}{name}")).unwrap();
    let with = |name: &str, text: &str| folder.write(name, text);
    let log = with("log.csv", "time_s,turbine_speed_rad_s\n0,1\n1,2\n");
    let of_car = with("of_car.csv", "time_s,engine_speed_rad_s,gear\n0,1,1\n0.01,1,1\n");
    let facts = ["--mass-kg", "1500", "--wheel-radius-m", "0.3", "--final-ratio", "3", "--engine-torque-n-m", "250"];
    let frames = with("bus.log", "(0.1) can0 001#0011223344556677\n(0.2) can0 001#0011223344556677\n");
    let car = with("bad_car.toml", &format!("name = \"c\"\ngearbox = {quoted}\n"));
    with("car.toml", &text("vehicles/eight_speed.toml").replace("../gearboxes", &format!("{ROOT}gearboxes")));
    let drive = with("drive.toml", &DRIVE.replace("\"car.toml\"", &quoted));
    let trace = with("trace.toml", &format!("name = \"d\"\nvehicle = \"car.toml\"\n[trace]\nfile = {quoted}\n"));
    let experiment = with("e.toml", &text("experiments/e1.toml").replace("\"../vehicles/two_speed_at.toml\"", &quoted));
    let study = text("experiments/settings.toml").replace("\"bench.toml\"", &quoted);
    let study = with("s.toml", &study);
    let map = with("map.toml", &format!("dbc = {quoted}\n[channel.turbine_speed]\nname = \"S\"\n"));
    let out = folder.path("out");
    let merged = folder.path("merged");
    let cases: Vec<(&str, Vec<&str>)> = vec![
        ("check", vec!["check", wrong]),
        ("gearbox of a car", vec!["check", &car]),
        ("vehicle of a drive", vec!["simulate", &drive, "-o", &out]),
        ("speed cycle of a drive", vec!["simulate", &trace, "-o", &out]),
        ("vehicle of an experiment", vec!["simulate", &experiment, "-o", &out]),
        ("experiment of a study", vec!["study", &study, "-o", &out]),
        ("simulate", vec!["simulate", wrong, "-o", &out]),
        ("bench", vec!["bench", wrong, "-o", &out]),
        ("study", vec!["study", wrong, "-o", &out]),
        ("merge", vec!["merge", wrong, &out, "-o", &merged]),
        ("error-bound", vec!["error-bound", wrong]),
        ("worst-case", vec!["worst-case", wrong, "-o", &out]),
        ("design", vec!["design", wrong]),
        ("bounds", vec!["design", VEHICLE, "--bounds", wrong]),
        ("vehicle of an estimate", vec!["estimate", &log, "--vehicle", wrong]),
        ("sensors", vec!["estimate", &of_car, "--vehicle", CAR, "--sensors", wrong]),
        ("sensors of a fit", vec!["fit", &log, "--vehicle", VEHICLE, "--sensors", wrong, "-o", &out]),
        ("sensors of a check", vec!["check", CAR, "--sensors", wrong]),
        ("learnt", vec!["estimate", &of_car, "--vehicle", CAR, "--learnt", wrong]),
        ("map", vec!["inspect", &log, "--map", wrong]),
        ("dbc", vec!["inspect", &frames, "--dbc", wrong]),
        ("dbc of a map", vec!["inspect", &frames, "--map", &map]),
        ("fit", vec!["fit", &log, "--vehicle", wrong, "-o", &out]),
        ("sensitivity", vec!["sensitivity", wrong]),
        ("demo", vec!["demo", "--vehicle", wrong, "-o", &out]),
        ("drive of a demo", vec!["demo", "--vehicle", CAR, "--drive", wrong, "-o", &out]),
        ("init", [&["init", "--gearbox", wrong, "-o", &merged], &facts[..]].concat()),
    ];
    cases.into_iter().map(|(name, arguments)| (name, wetclutch(&arguments))).collect()
}

/// `/dev/zero` never ends, and a pipe without a writer never begins.
#[cfg(unix)]
#[test]
fn a_device_or_a_pipe_is_no_text_file_wherever_one_is_named() {
    let folder = Folder::new("devices");
    let pipe = folder.path("pipe");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    for wrong in ["/dev/zero", "/dev/full", &pipe] {
        for (name, output) in readers(&folder, wrong) {
            let error = without_excerpts(&refused(&output));
            let what =
                format!("{wrong}: this is a device or a pipe, expected a file\nhint: write the text to a file first");
            assert!(error.contains(&what), "{name}: {error}");
        }
    }
}

#[test]
fn a_text_file_of_many_megabytes_is_refused_by_its_size() {
    let folder = Folder::new("large");
    let large = folder.path("large.toml");
    // Nearly all of it is a hole. Larger than any text file may be.
    std::fs::File::create(&large).unwrap().set_len(40 << 20).unwrap();
    for (name, output) in readers(&folder, &large) {
        let error = refused(&output);
        assert!(error.contains(&format!("{large}: the file is larger than ")), "{name}: {error}");
    }
}

#[test]
fn tables_and_lists_within_each_other_do_not_overflow_the_stack() {
    let folder = Folder::new("nested");
    let many = |part: &str| part.repeat(300_000);
    for deep in [
        format!("a={}{}", many("["), many("]")),
        format!("a={}1{}", many("{a="), many("}")),
        format!("a={{{}a=1}}", many("a.")),
        format!("{}a=1", many("a.")),
        format!("[{}a]", many("a.")),
        format!("[[{}a]]", many("a.")),
        many("["),
        many("a={"),
    ] {
        let error = refused(&wetclutch(&["check", &folder.write("deep.toml", &deep)]));
        assert!(error.contains("deep.toml:1: "), "{}: {error}", &deep[..20]);
    }
}

/// A terminal would clear its screen, and the line break would begin a line that looks like the program's own.
const HOSTILE: &str = "a\u{1b}[2Jb\nhint: c\u{9b}1m";
/// The same as messages show it.
const ESCAPED: &str = "a\\u{1b}[2Jb\\nhint: c\\u{9b}1m";

/// What the program writes to a terminal: nothing is stripped.
fn on_terminal(arguments: &[&str]) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_wetclutch"));
    let output = command.args(arguments).env("CLICOLOR_FORCE", "1").env_remove("NO_COLOR").output().unwrap();
    stdout(&output) + &stderr(&output)
}

#[cfg(unix)]
#[test]
fn a_name_of_a_file_that_controls_a_terminal_is_escaped_wherever_it_is_printed() {
    let folder = Folder::new("names");
    let text = |name: &str| std::fs::read_to_string(format!("{ROOT}{name}")).unwrap();
    let name = |ending: &str| format!("{HOSTILE}{ending}");
    let hostile = folder.path(&name(".toml"));
    let missing = folder.path(&name("missing.toml"));
    folder.write(&name(".toml"), text("experiments/e1.toml").replace("../vehicles/two_speed_at.toml", VEHICLE));
    let wrong = folder.write(&name("wrong.toml"), "name = 3\n[[gear]]\n");
    let sensors = folder.write(
        &name("sensors.toml"),
        &text("experiments/bench.toml")[text("experiments/bench.toml").find("[sensors").unwrap()..],
    );
    let out = folder.path(&name("out"));
    let log = printed(&wetclutch(&["simulate", EXPERIMENT, "-o", &folder.path("sim")]));
    let log = folder.write(&name(".csv"), std::fs::read(log.lines().nth(1).unwrap()).unwrap());
    let estimate = format!("{out}.csv");
    let cases: [&[&str]; 16] = [
        &["check", VEHICLE, &hostile],
        &["check", "--all", &wrong, &missing],
        &["check", &wrong],
        &["check", &missing],
        &["check", &sensors],
        &["check", &log],
        &["simulate", &hostile, "-o", &out],
        &["simulate", EXPERIMENT, "-o", &hostile],
        &["estimate", &log, "--vehicle", VEHICLE, "-o", &estimate],
        &["estimate", &missing, "--vehicle", VEHICLE],
        &["estimate", &log, "--vehicle", VEHICLE, "-o", &log],
        &["inspect", &log],
        &["inspect", &log, "--map", &wrong],
        &["fit", &log, "--vehicle", VEHICLE, "-o", &folder.path(&name("fitted.toml"))],
        &["sensitivity", "-o", &out],
        &["study", &missing, "-o", &out],
    ];
    for arguments in cases {
        let said = on_terminal(arguments);
        assert!(said.contains(ESCAPED), "{arguments:?}: {said:?}");
        assert!(!said.contains("\u{1b}[2J") && !said.contains('\u{9b}'), "{arguments:?}: {said:?}");
        assert!(!said.lines().any(|line| line.starts_with("hint: c")), "{arguments:?}: {said:?}");
    }
    // The names of logs are in the first line of the file, which is read again.
    let fitted = folder.path(&name("fitted.toml"));
    assert!(printed(&wetclutch(&["check", &fitted])).contains("vehicle"));
}

#[test]
fn a_name_in_a_file_is_one_line_and_no_markup() {
    let folder = Folder::new("names-inside");
    let text = |name: &str| std::fs::read_to_string(format!("{ROOT}{name}")).unwrap();
    let quoted = "\"a\\u001b[2Jb\\nhint: c\\u009b1m\"";
    let with = |name: &str, line: &str, to: &str| {
        let text = text(name);
        let at = text.find(line).unwrap();
        let end = at + text[at..].find('\n').unwrap();
        folder.write("x.toml", format!("{}{to}{}", &text[..at], &text[end..]))
    };
    let cases = [
        ("vehicles/two_speed_at.toml", "name = ", format!("name = {quoted}"), "`name`: a title must not"),
        ("vehicles/eight_speed.toml", "gearbox = ", format!("gearbox = {quoted}"), ESCAPED),
        ("vehicles/eight_speed.toml", "gearbox = ", format!("gearbox = \"g.toml\"\n{quoted} = 1"), ESCAPED),
        (
            "gearboxes/8hp.toml",
            "  { name = \"1\"",
            format!("{{ name = {quoted}, engaged = [\"A\"] }},"),
            "a name must not",
        ),
        ("gearboxes/8hp.toml", "  { name = \"1\"", format!("{{ name = \"1\", engaged = [{quoted}] }},"), ESCAPED),
    ];
    for (file, line, to, expected) in cases {
        let said = on_terminal(&["check", &with(file, line, &to)]);
        assert!(said.contains(expected), "{to}: {said:?}");
        assert!(!said.contains("\u{1b}[2J") && !said.contains('\u{9b}'), "{to}: {said:?}");
        assert!(!said.lines().any(|line| line.starts_with("hint: c")), "{to}: {said:?}");
    }
    let vehicle = with("vehicles/two_speed_at.toml", "name = ", "name = '<script>alert(\"&\")</script>'");
    printed(&wetclutch(&["sensitivity", &vehicle, "-o", &folder.path("page")]));
    let page = folder.read("page/sensitivity.html");
    assert!(page.contains("&lt;script&gt;alert(") && !page.contains("<script>alert("));
}

#[test]
fn an_output_does_not_replace_what_it_is_made_from_or_another_kind_of_file() {
    let folder = Folder::new("kept");
    let text = |name: &str| std::fs::read_to_string(format!("{ROOT}{name}")).unwrap();
    let of_folder = |text: String| text.replace("../vehicles", &format!("{ROOT}vehicles"));
    let speeds = "time_s,speed_km_h\n0,0\n5,20\n";
    let drive = format!("name = \"cycle\"\nvehicle = \"{CAR}\"\n[trace]\nfile = \"cycle.csv\"\n");
    let city = text("drives/city.toml");
    let schedule = city[city.find("[schedule]").unwrap()..].split("\n[[").next().unwrap();
    let drive = folder.write("d.toml", format!("{drive}{schedule}"));
    folder.write("cycle.csv", speeds);
    let error = refused(&wetclutch(&["simulate", &drive, "-o", &folder.path("")]));
    assert!(error.contains("cycle.csv: the output would replace this input"), "{error}");
    folder.write("drive.csv", speeds);
    let named = folder.read("d.toml").replace("cycle.csv", "drive.csv");
    let named = folder.write("named.toml", named);
    let error = refused(&wetclutch(&["demo", "--vehicle", CAR, "--drive", &named, "-o", &folder.path("")]));
    assert!(error.contains("drive.csv: the output would replace this input"), "{error}");
    assert_eq!((folder.read("cycle.csv"), folder.read("drive.csv")), (speeds.to_owned(), speeds.to_owned()));

    folder.write("bench.toml", of_folder(text("experiments/bench.toml")));
    let study = folder.write("worst_torque_phase.toml", text("experiments/settings.toml"));
    let error = refused(&wetclutch(&["worst-case", &study, "-o", &folder.path("")]));
    assert!(error.contains("worst_torque_phase.toml: the output would replace this input"), "{error}");
    let vehicle = folder.write("vehicle.toml", text("vehicles/two_speed_at.toml"));
    let experiment = folder.path("bench.toml");
    for kept in [&vehicle, &experiment] {
        let before = std::fs::read(kept).unwrap();
        let error = refused(&wetclutch(&["error-bound", &study, "-o", kept]));
        assert!(
            error.contains("the output would replace this input") || error.contains("is no file of bounds"),
            "{error}"
        );
        assert!(std::fs::read(kept).unwrap() == before);
    }
    // What was learnt names a gearbox, and is no vehicle file.
    let learnt = "gearbox = \"g\"\nelements = [\"A\"]\nshifts = 3\nrefused = 0\nmean = [0.0]\ncovariance = [[1.0]]\n";
    let learnt = folder.write("learnt.toml", learnt);
    let error = refused(&wetclutch(&["fit", "log.csv", "--vehicle", VEHICLE, "-o", &learnt]));
    assert!(error.contains("learnt.toml: exists and is no vehicle file"), "{error}");
    let shown = printed(&wetclutch(&["check", &learnt]));
    assert!(shown.contains("use: wetclutch estimate LOG --vehicle VEHICLE --learnt"), "{shown}");
}

#[test]
fn an_output_that_cannot_be_written_is_found_before_the_work_and_leaves_nothing() {
    let folder = Folder::new("unwritable");
    let inside = folder.write("file", "kept") + "/sub/x";
    let protected = folder.write("protected.toml", std::fs::read(VEHICLE).unwrap());
    let mut permissions = std::fs::metadata(&protected).unwrap().permissions();
    permissions.set_readonly(true);
    std::fs::set_permissions(&protected, permissions).unwrap();
    let [csv, toml] = [".csv", ".toml"].map(|ending| format!("{inside}{ending}"));
    // The log is missing: it is not looked for, because the output is wrong.
    let cases: [&[&str]; 7] = [
        &["estimate", "nowhere.csv", "--vehicle", VEHICLE, "-o", &csv],
        &["fit", "nowhere.csv", "--vehicle", VEHICLE, "-o", &toml],
        &["simulate", EXPERIMENT, "-o", &inside],
        &["demo", "-o", &inside],
        &["reproduce", "-o", &inside],
        &["check", &format!("{ROOT}gearboxes/8hp.toml"), "-o", &inside],
        &["sensitivity", "-o", &inside],
    ];
    for arguments in cases {
        let output = wetclutch(arguments);
        let error = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{error}");
        assert!(error.contains("file is a file, expected a folder\nhint: choose another name after -o"), "{error}");
    }
    let error = stderr(&wetclutch(&["fit", "nowhere.csv", "--vehicle", VEHICLE, "-o", &protected]));
    assert!(error.contains("protected.toml: the file is write-protected\nhint: "), "{error}");
    assert_eq!(
        (folder.names(), folder.read("file")),
        (vec!["file".to_owned(), "protected.toml".to_owned()], "kept".to_owned())
    );
}

#[test]
fn an_unfinished_file_of_a_killed_run_under_another_name_is_named() {
    let folder = Folder::new("left");
    folder.write("earlier.csv.1.partial", "time_s\n");
    let text = said(&wetclutch(&["simulate", EXPERIMENT, "-o", &folder.path("")]));
    assert!(text.contains("earlier.csv.1.partial: an unfinished file of a run that was killed\nhint: "), "{text}");
    assert!(folder.names().contains(&"earlier.csv.1.partial".to_owned()));
    std::fs::remove_file(folder.path("earlier.csv.1.partial")).unwrap();
    let text = said(&wetclutch(&["simulate", EXPERIMENT, "-o", &folder.path("")]));
    assert!(!text.contains("partial"), "{text}");
}
