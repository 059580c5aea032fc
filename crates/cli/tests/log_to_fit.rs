//! The commands of `docs/tutorial/3-your-own-log.md` and `docs/how-to/fit.md`, from a log to an estimate with a fitted file, as they stand there.

use std::path::Path;
use std::process::Command;

use config::VehicleFile;
use trace::{Cell, ColumnKind, TableWriter};

use crate::fit::common::{Logs, TestCar};
use crate::support::{Folder, ROOT, said, wetclutch};

const SHIFTS: u64 = 5;

/// The log of a car that differs from its file in everything, as MDF with the names of the program.
fn write_log(path: &Path, car: &mut TestCar) {
    let logs: Vec<trace::Trace> =
        (0..SHIFTS).map(|number| car.logs(number, Logs::SpeedsAndCurrent)[0].clone()).collect();
    let names: Vec<String> = logs[0].columns.iter().map(|column| column.name.clone()).collect();
    let columns = names.iter().map(|name| (name.as_str(), ColumnKind::Number));
    let mut writer = TableWriter::create(path, columns).unwrap();
    let mut begin_s = 0.0;
    for log in &logs {
        for (i, time_s) in log.time_s.iter().enumerate() {
            let cells = names.iter().map(|name| Cell::Number(log.get(name).unwrap()[i]));
            writer.row(begin_s + time_s, cells).unwrap();
        }
        // The recorder was off for some seconds.
        begin_s += log.time_s.last().unwrap() + 4.0;
    }
    writer.finish().unwrap();
}

/// Runs the commands of the first block after `heading` of a page in a folder; `after` gets each with what it said on standard error.
fn run_page(folder: &Folder, page: &str, heading: &str, mut after: impl FnMut(&str, &str)) {
    let page = std::fs::read_to_string(format!("{ROOT}docs/{page}")).unwrap();
    let block = page.split_once(heading).unwrap().1.split("```").nth(1).unwrap();
    let commands: Vec<&str> = block.lines().filter(|line| !line.is_empty()).collect();
    assert!(commands.len() >= 4 && commands.iter().all(|command| command.starts_with("wetclutch ")), "{commands:?}");
    let program = Path::new(env!("CARGO_BIN_EXE_wetclutch")).parent().unwrap();
    let path = format!("{}:{}", program.display(), std::env::var("PATH").unwrap());
    for command in commands {
        let shell =
            Command::new("sh").args(["-c", command]).env("PATH", &path).current_dir(folder.path("")).output().unwrap();
        let said = String::from_utf8(shell.stderr).unwrap();
        assert!(shell.status.success(), "{command}: {said}");
        after(command, &said);
    }
}

#[test]
fn the_commands_for_a_car_with_a_gearbox_do_what_the_tutorial_says() {
    let folder = Folder::new("gearbox-to-fit");
    run_page(&folder, "tutorial/3-your-own-log.md", "## From a log to an estimate", |command, _| {
        if command.starts_with("wetclutch init") {
            // Three minutes of town.
            let drive = std::fs::read_to_string(format!("{ROOT}drives/city.toml")).unwrap();
            let drive = drive.replace("repetitions = 20", "repetitions = 1").replace("vehicle = ", "# vehicle = ");
            let (drive, car) = (folder.write("town.toml", drive), folder.path("car.toml"));
            said(&wetclutch(&["simulate", &drive, "--vehicle", &car, "-o", &folder.path("")]));
            // The first bytes of a log tell its format.
            folder.write("drive.mf4", folder.read("city_measured.csv"));
        }
    });
    assert!(folder.read("map.toml").contains("element_a_current"));
    // The car is that of the given file.
    assert!(folder.read("fitted.toml").starts_with("# fit: all values are those of the given file"));
    assert!(folder.read("fitted_shifts.csv").lines().count() > 15);
}

#[test]
fn the_commands_from_a_log_to_a_fitted_file_do_what_the_page_says() {
    let folder = Folder::new("log-to-fit");
    run_page(&folder, "how-to/fit.md", "## One shift", |command, said| {
        if command.starts_with("wetclutch init") {
            let mut car = TestCar::of(VehicleFile::read(Path::new(&folder.path("car.toml"))).unwrap(), 4);
            write_log(Path::new(&folder.path("drive.mf4")), &mut car);
        }
        if command.starts_with("wetclutch estimate") {
            assert!(said.contains(&format!("shifts: {SHIFTS} (")), "{said}");
        }
    });
    let fitted = folder.read("fitted.toml");
    assert!(
        fitted.contains("# fit: x ") && fitted.contains("the interval of the fit, 4 standard deviations"),
        "{fitted}"
    );
    assert!(Path::new(&folder.path("estimate_report.html")).exists());
}
