//! `--open`: the page in the browser of the desktop.

use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;
use std::process::{Command, Output};
use std::time::{Duration, Instant};

use crate::support::{BENCH, Folder, ROOT, VEHICLE, printed, refused, said, stderr, wetclutch};

/// Runs a command with a program that stands for the desktop's, on a desktop or without one.
fn opening(folder: &Folder, arguments: &[&str], has_desktop: bool) -> Output {
    let opener = folder.write("xdg-open", format!("#!/bin/sh\necho \"$1\" > '{}'\n", folder.path("opened")));
    std::fs::set_permissions(&opener, std::fs::Permissions::from_mode(0o755)).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_wetclutch"));
    command.args(arguments).args(["--open", "-o", &folder.path("out")]);
    let path = Path::new(&opener).parent().unwrap().to_str().unwrap();
    command.env("PATH", format!("{path}:/usr/bin:/bin")).env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY");
    if has_desktop {
        command.env("DISPLAY", ":0");
    }
    command.output().unwrap()
}

/// A study of two runs.
fn small_study(folder: &Folder) -> String {
    let study = "name = \"s\"\ntitle = \"S\"\nplan = \"latin-hypercube\"\nruns = 2\nseed = 1\nobservers = [\"open loop\"]\n[[factor]]\nkey = \"car.vehicle.mass_kg\"\nrange = [1300, 2000]\n";
    folder.write("study.toml", format!("experiment = '{BENCH}'\n{study}"))
}

#[test]
fn on_a_desktop_the_page_is_opened() {
    for (name, page) in [("demo", "report.html"), ("sensitivity", "sensitivity.html"), ("study", "study.html")] {
        let folder = Folder::new("opened");
        let study = small_study(&folder);
        let command = if name == "study" { vec![name, &study] } else { vec![name] };
        let output = opening(&folder, &command, true);
        assert!(output.status.success() && !stderr(&output).contains("--open"), "{name}: {}", stderr(&output));
        let until = Instant::now() + Duration::from_secs(10);
        let opened = loop {
            let opened = std::fs::read_to_string(folder.path("opened")).unwrap_or_default();
            if !opened.is_empty() || Instant::now() > until {
                break opened;
            }
            std::thread::yield_now();
        };
        assert_eq!(Path::new(opened.trim()), std::fs::canonicalize(folder.path("out")).unwrap().join(page));
    }
}

#[test]
fn every_command_that_writes_a_page_opens_it() {
    let help = |command: &str| printed(&wetclutch(&[command, "--help"]));
    for command in [
        "bench",
        "check",
        "compare",
        "demo",
        "design",
        "error-bound",
        "estimate",
        "fit",
        "inspect",
        "merge",
        "reproduce",
        "sensitivity",
        "study",
        "worst-case",
    ] {
        assert!(help(command).contains("--open"), "{command}");
    }
    for command in ["convert", "export", "init", "simulate"] {
        assert!(!help(command).contains("--open"), "{command}");
    }
}

#[test]
fn without_a_desktop_the_place_of_the_page_is_printed() {
    let folder = Folder::new("unopened");
    let output = opening(&folder, &["demo"], false);
    assert!(output.status.success());
    let message = stderr(&output);
    assert!(
        message.contains("--open: there is no desktop to open the page on\nhint: open ")
            && message.contains("out/report.html in a browser"),
        "{message}"
    );
    assert!(!Path::new(&folder.path("opened")).exists());
}

#[test]
fn an_option_to_open_a_page_that_is_not_written_has_no_effect() {
    let folder = Folder::new("without_page");
    let (study, out) = (small_study(&folder), folder.path("none"));
    let car = folder.write(
        "cars.toml",
        format!(
            "name = \"s\"\ntitle = \"S\"\nvehicle = '{ROOT}vehicles/eight_speed.toml'\nshifts = [\"1-2\"]\nruns = 1\n"
        ),
    );
    for (arguments, why) in [
        (&["study", &study, "--shard", "1/3", "-o", &out, "--open"][..], "there is no page without a run"),
        (&["study", &car, "--shard", "1/2", "-o", &folder.path("cars"), "--open"], "there is no page without a run"),
        (
            &["error-bound", &study, "-o", "/dev/stdout", "--open"],
            "the bounds go to a device or a pipe, and there is no page",
        ),
    ] {
        let message = said(&wetclutch(arguments));
        assert!(message.contains(&format!("warning: --open has no effect: {why}\nhint: leave it out")), "{message}");
    }
}

#[test]
fn there_is_no_page_of_an_estimate_without_a_file() {
    let folder = Folder::new("no_page");
    let log = folder.write("log.csv", "time_s\n");
    let without_file = refused(&wetclutch(&["estimate", &log, "--vehicle", VEHICLE, "--open"]));
    assert!(without_file.contains("--output"), "{without_file}");
    let several = ["estimate", &log, &log, "--vehicle", VEHICLE, "-o", &folder.path("out"), "--open"];
    assert!(stderr(&wetclutch(&several)).contains("--open takes one log"));
    for command in ["bench", "sensitivity"] {
        assert!(refused(&wetclutch(&[command, "--open"])).contains("--output"), "{command}");
    }
}
