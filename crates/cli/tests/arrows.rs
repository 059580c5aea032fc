//! Which crates of the project may depend on which.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

/// The crates that each may depend on, besides those of others.
const ALLOWED: [(&str, &[&str]); 23] = [
    ("drivetrain", &[]),
    ("lapack-nalgebra", &[]),
    ("trace", &[]),
    ("geartrain", &["drivetrain"]),
    ("car", &["drivetrain", "geartrain"]),
    ("observer", &["car", "drivetrain", "geartrain"]),
    ("plant", &["car", "drivetrain", "geartrain"]),
    // A tool that makes the C of what a controller links.
    ("c99", &[]),
    // What a controller links.
    ("ecu", &["car", "drivetrain", "observer"]),
    ("export", &["car", "config", "drivetrain", "ecu", "evaluate", "observer", "plant", "trace"]),
    // No files, no clock, no threads.
    ("evaluate", &["car", "drivetrain", "observer", "plant"]),
    // Its estimators are what a gain is for.
    ("design", &["car", "drivetrain", "geartrain", "lapack-nalgebra", "observer"]),
    ("logs", &["car", "drivetrain", "trace"]),
    // A file of what a filter has learnt has the numbers of the filter.
    ("config", &["car", "drivetrain", "geartrain", "observer", "trace"]),
    ("fit", &["car", "drivetrain", "geartrain", "logs", "observer", "trace"]),
    ("study", &["car", "config", "design", "drivetrain", "evaluate", "logs", "observer", "plant", "trace"]),
    ("report", &["car", "config", "design", "drivetrain", "fit", "geartrain", "logs", "observer", "study", "trace"]),
    ("fuzz", &["car", "config", "design", "drivetrain", "logs", "observer", "plant", "report", "study", "trace"]),
    // The library: nothing here parses arguments or prints.
    (
        "wetclutch",
        &[
            "car",
            "config",
            "design",
            "drivetrain",
            "evaluate",
            "export",
            "fit",
            "geartrain",
            "logs",
            "observer",
            "plant",
            "report",
            "study",
            "trace",
        ],
    ),
    (
        "wetclutch-cli",
        &[
            "car",
            "config",
            "design",
            "drivetrain",
            "evaluate",
            "fit",
            "geartrain",
            "logs",
            "observer",
            "plant",
            "report",
            "study",
            "trace",
            "wetclutch",
        ],
    ),
    ("wetclutch-car-fmu", &["car", "config", "plant"]),
    ("wetclutch-python", &["logs", "wetclutch"]),
    ("wetclutch-web", &["config", "logs", "report", "wetclutch"]),
];

/// Of each crate of the project, those of the project that it depends on outside of its tests.
fn dependencies() -> BTreeMap<String, BTreeSet<String>> {
    let manifest = concat!(env!("CARGO_MANIFEST_DIR"), "/../../Cargo.toml");
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["metadata", "--format-version", "1", "--no-deps", "--offline", "--manifest-path", manifest]);
    let output = cargo.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let packages = metadata["packages"].as_array().unwrap();
    let name = |package: &serde_json::Value| package["name"].as_str().unwrap().to_owned();
    let own: BTreeSet<String> = packages.iter().map(name).collect();
    let of = |package: &serde_json::Value| {
        let dependencies = package["dependencies"].as_array().unwrap().iter();
        let normal = dependencies.filter(|dependency| dependency["kind"].is_null());
        (name(package), normal.map(name).filter(|name| own.contains(name)).collect())
    };
    packages.iter().map(of).collect()
}

#[test]
fn no_crate_depends_on_one_that_it_may_not_know() {
    let found = dependencies();
    let known: BTreeSet<&str> = ALLOWED.iter().map(|(name, _)| *name).collect();
    let unknown: Vec<&String> = found.keys().filter(|name| !known.contains(name.as_str())).collect();
    assert!(unknown.is_empty(), "say in this test what {unknown:?} may depend on");
    for (name, allowed) in ALLOWED {
        let other: Vec<&String> = found[name].iter().filter(|other| !allowed.contains(&other.as_str())).collect();
        assert!(other.is_empty(), "{name} depends on {other:?}");
    }
}

/// What an allowed arrow may never lead to, not even by way of another crate.
#[test]
fn no_path_leads_from_estimates_to_the_truth_or_from_physics_to_the_parser() {
    let found = dependencies();
    let reached = |from: &str| {
        let mut reached = BTreeSet::new();
        let mut open = vec![from.to_owned()];
        while let Some(next) = open.pop() {
            for other in &found[&next] {
                if reached.insert(other.clone()) {
                    open.push(other.clone());
                }
            }
        }
        reached
    };
    for (from, to) in [
        ("observer", "plant"),
        ("logs", "plant"),
        ("logs", "observer"),
        ("plant", "observer"),
        ("car", "config"),
        ("drivetrain", "config"),
        ("geartrain", "config"),
        ("observer", "config"),
        ("ecu", "config"),
        ("ecu", "plant"),
        ("plant", "config"),
        ("design", "config"),
        ("fit", "config"),
        ("fit", "design"),
        ("evaluate", "config"),
        ("evaluate", "design"),
    ] {
        assert!(!reached(from).contains(to), "{from} depends on {to}");
    }
}
