//! Puts the commit into `--version` of a release.
//!
//! A debug build has none: each commit would cost a compilation. `WETCLUTCH_COMMIT` replaces it, for a source without its history.

use std::path::Path;
use std::process::Command;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-env-changed=WETCLUTCH_COMMIT");
    let is_release = std::env::var("PROFILE").is_ok_and(|profile| profile == "release");
    let given = std::env::var("WETCLUTCH_COMMIT").ok().filter(|commit| !commit.is_empty());
    let commit = given.or_else(|| is_release.then(commit_of_history).flatten());
    let shown = commit.map_or(String::new(), |commit| format!(" ({commit})"));
    println!("cargo::rustc-env=WETCLUTCH_OF_COMMIT={shown}");
}

/// Commit and day, such as `1315e69c3a 2026-11-26`; none without git or its history.
fn commit_of_history() -> Option<String> {
    // It grows with each commit and change of the branch.
    let log = git(&["rev-parse", "--git-path", "logs/HEAD"])?;
    if Path::new(&log).exists() {
        println!("cargo::rerun-if-changed={log}");
    }
    git(&["log", "-1", "--abbrev=10", "--format=%h %cs"])
}

/// The line that git prints.
fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok().filter(|output| output.status.success())?;
    let line = String::from_utf8(output.stdout).ok()?.trim().to_owned();
    (!line.is_empty()).then_some(line)
}
