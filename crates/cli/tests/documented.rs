//! Every command block of the documentation does its work. That of one's own log is in `log_to_fit`, those with libraries for controllers and simulations in `.ci/run`.

use std::path::Path;
use std::process::Command;

use crate::support::{Folder, ROOT, printed, said, shown, wetclutch};

/// What other tests run, or needs a bus or a library that is built.
const ELSEWHERE: [&str; 5] = ["candump ", "--check-elf", "--fmu", "--car-fmu", "--c target"];
/// Pages whose commands are run here.
const PAGES: [&str; 8] = [
    "how-to/describe-a-gearbox",
    "how-to/estimate-logs",
    "how-to/install",
    "how-to/map-channels",
    "how-to/put-on-a-controller",
    "how-to/read-ranges-and-certificates",
    "how-to/run-studies",
    "tutorial/2-run-it",
];
/// Pages whose commands `log_to_fit` runs; those of the README are among them.
const OF_ONE_LOG: [&str; 2] = ["how-to/fit", "tutorial/3-your-own-log"];

/// The commands of the program in the blocks of a page.
fn commands(page: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(page).unwrap();
    let blocks = text.split("```").skip(1).step_by(2).filter_map(|block| block.split_once('\n'));
    let shell = blocks.filter(|(language, _)| ["", "sh"].contains(language)).flat_map(|(_, block)| block.lines());
    let is_ours = |line: &&str| line.starts_with("wetclutch ") || line.contains("| wetclutch ");
    shell.filter(is_ours).map(str::to_owned).collect()
}

/// Copies the files of a folder of the repository, with a replacement in their text.
fn copied(folder: &Folder, name: &str, replaced: &[(&str, &str)]) {
    std::fs::create_dir_all(folder.path(name)).unwrap();
    for entry in std::fs::read_dir(format!("{ROOT}{name}")).unwrap().map(|entry| entry.unwrap().path()) {
        let file = format!("{name}/{}", entry.file_name().unwrap().to_str().unwrap());
        let mut text = std::fs::read_to_string(&entry).unwrap();
        for (old, new) in replaced {
            text = text.replace(old, new);
        }
        folder.write(&file, text);
    }
}

/// A folder as the clone of the reader, with less to compute.
fn clone() -> Folder {
    let folder = Folder::new("documented");
    for name in ["vehicles", "gearboxes", "maps"] {
        copied(&folder, name, &[]);
    }
    copied(&folder, "drives", &[("repetitions = 20", "repetitions = 1")]);
    let fewer = [("runs = 2000", "runs = 8"), ("runs = 40", "runs = 1"), ("runs = 20", "runs = 1")];
    copied(&folder, "experiments", &fewer);
    folder
}

/// The files that pages take as given: a car, its log under several names, its channel map.
fn with_logs(folder: &Folder) {
    let car = folder.path("car.toml");
    let numbers =
        ["--mass-kg", "1900", "--wheel-radius-m", "0.33", "--final-ratio", "2.8", "--engine-torque-n-m", "400"];
    said(&wetclutch(&[&["init", "--gearbox", "8hp", "-o", &car], &numbers[..]].concat()));
    let drive = folder.path("drives/city.toml");
    said(&wetclutch(&["simulate", &drive, "--vehicle", &car, "-o", &folder.path("given")]));
    let log = folder.read("given/city_measured.csv");
    std::fs::create_dir_all(folder.path("day")).unwrap();
    for name in ["drive.mf4", "drive.csv", "drive1.mf4", "drive2.mf4", "day/1.csv", "day/2.csv"] {
        folder.write(name, &log);
    }
    folder.write("map.toml", printed(&wetclutch(&["inspect", &folder.path("drive.csv"), "--suggest"])));
}

/// Runs the commands of a page one after the other.
fn run(folder: &Folder, page: &str) {
    let program = Path::new(env!("CARGO_BIN_EXE_wetclutch")).parent().unwrap();
    let path = format!("{}:{}", program.display(), std::env::var("PATH").unwrap());
    let shell = |command: &str| {
        let shell = Command::new("sh").args(["-c", command]).env("PATH", &path).current_dir(folder.path("")).output();
        let output = shell.unwrap();
        assert!(output.status.success(), "{page}: {command}: {}", String::from_utf8_lossy(&output.stderr));
    };
    let commands = commands(Path::new(&format!("{ROOT}docs/{page}.md")));
    assert!(!commands.is_empty(), "{page}");
    for command in commands.iter().filter(|command| !ELSEWHERE.iter().any(|part| command.contains(part))) {
        if command.starts_with("wetclutch merge") {
            // "and so on"
            for shard in ["3", "4"] {
                shell(&format!("wetclutch study experiments/combined.toml --shard {shard}/4 -o part{shard}"));
            }
        }
        shell(command);
    }
}

#[test]
fn the_commands_of_pages_about_logs_do_their_work() {
    for page in ["how-to/estimate-logs", "how-to/map-channels"] {
        let folder = clone();
        with_logs(&folder);
        run(&folder, page);
    }
}

#[test]
fn the_commands_of_the_page_about_a_gearbox_do_their_work() {
    let folder = clone();
    with_logs(&folder);
    std::fs::remove_file(folder.path("car.toml")).unwrap();
    run(&folder, "how-to/describe-a-gearbox");
}

#[test]
fn the_commands_of_the_page_about_studies_do_their_work() {
    run(&clone(), "how-to/run-studies");
}

#[test]
fn the_commands_of_all_other_pages_do_their_work() {
    let folder = clone();
    for page in
        ["how-to/install", "tutorial/2-run-it", "how-to/read-ranges-and-certificates", "how-to/put-on-a-controller"]
    {
        run(&folder, page);
    }
}

#[test]
fn no_page_has_commands_that_no_test_runs() {
    let known = [&PAGES[..], &OF_ONE_LOG].concat();
    let mut met = Vec::new();
    for room in ["", "how-to", "tutorial", "explanation", "reference"] {
        for path in std::fs::read_dir(format!("{ROOT}docs/{room}")).unwrap().map(|entry| entry.unwrap().path()) {
            let name = format!("{room}/{}", path.file_stem().unwrap().to_str().unwrap());
            let is_page = path.extension().is_some_and(|end| end == "md");
            // The program writes the page of its help.
            if is_page && name != "reference/commands" && !commands(&path).is_empty() {
                assert!(known.contains(&name.as_str()), "{name}");
                met.push(name);
            }
        }
    }
    assert_eq!(met.len(), known.len());
    let tutorial = commands(Path::new(&format!("{ROOT}docs/tutorial/3-your-own-log.md")));
    let plain = |command: &str| command.split(" #").next().unwrap().trim_end().to_owned();
    let readme = commands(Path::new(&format!("{ROOT}README.md")));
    let tutorial: Vec<String> = tutorial.iter().map(|command| plain(command)).collect();
    assert!(readme.len() > 4 && readme.iter().all(|command| tutorial.contains(&plain(command))), "{readme:?}");
}

#[test]
fn pages_quote_what_the_program_prints() {
    let page = |name: &str| std::fs::read_to_string(format!("{ROOT}docs/{name}.md")).unwrap();
    let folder = Folder::new("quoted");

    let (drive, car) = (format!("{ROOT}drives/city.toml"), format!("{ROOT}vehicles/eight_speed.toml"));
    said(&wetclutch(&["simulate", &drive, "-o", &folder.path("out")]));
    let (log, learnt) = (folder.path("out/city_measured.csv"), folder.path("learnt.toml"));
    let rows = folder.path("estimate.csv");
    let estimate = wetclutch(&["estimate", &log, "--vehicle", &car, "-o", &rows, "--learnt", &learnt]);
    let estimate = shown(&estimate).replace(&learnt, "learnt.toml");
    let of_page = page("how-to/estimate-logs");
    let quoted: Vec<&str> = of_page.lines().filter(|line| line.starts_with("learnt")).collect();
    assert_eq!(quoted.len(), 8);
    for line in quoted {
        assert!(estimate.lines().any(|printed| printed == line), "{line}\nis not in\n{estimate}");
    }

    let one_shift = printed(&wetclutch(&["demo", "-o", &folder.path("demo")]));
    let gears = printed(&wetclutch(&["demo", "--vehicle", &car, "-o", &folder.path("gears")]));
    let tutorial = page("tutorial/2-run-it");
    let rms = |observer: &str| {
        let line = one_shift.lines().find(|line| line.starts_with("torque phase") && line.contains(observer)).unwrap();
        line.split_whitespace().rev().nth(2).unwrap().to_owned()
    };
    for (observer, words) in
        [("open loop", "the open loop errs by"), ("rigid ISS", "the chapter by"), ("Kalman", "Kalman filter by")]
    {
        let quoted = format!("{words} {} MPa", rms(observer));
        assert!(tutorial.contains(&quoted), "{quoted}");
    }
    assert!(gears.contains("10148 of 10148 pressures") && tutorial.contains("all 10,148 pressures"), "{gears}");
    assert!(gears.contains("28 of 28 shifts") && tutorial.contains("28 shifts"), "{gears}");
    let hardest = gears.lines().find(|line| line.contains("6-5") && line.contains("coast downshift")).unwrap();
    assert!(hardest.contains("10.3 / 10.9") && tutorial.contains("10.3 N m in the torque phase"), "{hardest}");

    let two_speed = format!("{ROOT}vehicles/two_speed_at.toml");
    let method = |name| ["design", &two_speed, "--method", name, "--sample-time", "0.01"].map(str::to_owned);
    let design = |name| printed(&wetclutch(&method(name).each_ref().map(String::as_str)));
    let peak_to_peak = design("peak-to-peak");
    for (name, line) in [
        ("how-to/choose-an-observer", "the gain is the open loop: no gain reduces the bound"),
        ("how-to/read-ranges-and-certificates", "the gain is the open loop: no gain reduces the bound"),
        ("how-to/read-ranges-and-certificates", "corrects over steps of at most"),
    ] {
        assert!(page(name).contains(line) && peak_to_peak.contains(line), "{line}\n{peak_to_peak}");
    }
    for name in ["iss-discrete", "interval", "peak-to-peak", "scheduled"] {
        let printed = design(name);
        let bound = printed.split("steady-state bound on the error of the clutch torque: ").nth(2).unwrap();
        let row = format!("| {} /", bound.split(" N m").next().unwrap());
        let choose = page("how-to/choose-an-observer");
        let of_page = choose.lines().find(|line| line.starts_with(&format!("| `{name}` |"))).unwrap();
        assert!(of_page.contains(&row), "{row}\n{of_page}");
    }
}
