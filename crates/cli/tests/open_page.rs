//! `--open`: the page in the browser of the desktop.

use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;
use std::process::{Command, Output};
use std::time::{Duration, Instant};

use crate::support::{Folder, VEHICLE, stderr};

/// Runs the demo with a program that stands for the desktop's, on a desktop or without one.
fn demo(folder: &Folder, has_desktop: bool) -> Output {
    let opener = folder.write("xdg-open", format!("#!/bin/sh\necho \"$1\" > '{}'\n", folder.path("opened")));
    std::fs::set_permissions(&opener, std::fs::Permissions::from_mode(0o755)).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_wetclutch"));
    command.args(["demo", "--open", "-o", &folder.path("out")]);
    let path = Path::new(&opener).parent().unwrap().to_str().unwrap();
    command.env("PATH", format!("{path}:/usr/bin:/bin")).env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY");
    if has_desktop {
        command.env("DISPLAY", ":0");
    }
    command.output().unwrap()
}

#[test]
fn on_a_desktop_the_page_is_opened() {
    let folder = Folder::new("opened");
    let output = demo(&folder, true);
    assert!(output.status.success() && !stderr(&output).contains("--open"), "{}", stderr(&output));
    let until = Instant::now() + Duration::from_secs(10);
    let opened = loop {
        let opened = std::fs::read_to_string(folder.path("opened")).unwrap_or_default();
        if !opened.is_empty() || Instant::now() > until {
            break opened;
        }
        std::thread::yield_now();
    };
    assert_eq!(Path::new(opened.trim()), std::fs::canonicalize(folder.path("out/report.html")).unwrap());
}

#[test]
fn without_a_desktop_the_place_of_the_page_is_printed() {
    let folder = Folder::new("unopened");
    let output = demo(&folder, false);
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
fn there_is_no_page_of_an_estimate_without_a_file() {
    let folder = Folder::new("no_page");
    let log = folder.write("log.csv", "time_s\n");
    let refused = crate::support::wetclutch(&["estimate", &log, "--vehicle", VEHICLE, "--open"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).contains("--output"), "{}", stderr(&refused));
    let several = ["estimate", &log, &log, "--vehicle", VEHICLE, "-o", &folder.path("out"), "--open"];
    assert!(stderr(&crate::support::wetclutch(&several)).contains("--open takes one log"));
}
