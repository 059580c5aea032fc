//! Files with one thing wrong in them: each is refused with its reason or accepted, and none stops the program.

use crate::common::{EXPERIMENT, FILL, STROKE, STUDY, VEHICLE, mutations};
use config::{CarFile, ConfigError, DriveFile, ExperimentFile, GearboxFile, Source, Study, VehicleFile};

/// Every error but those of reading names a line of the file.
fn has_its_place(error: &ConfigError, path: &str, lines: usize, mutation: &str) {
    let text = error.to_string();
    let place = text.strip_prefix(path).and_then(|rest| rest.strip_prefix(':')).and_then(|rest| rest.split(':').next());
    let line: usize = place.and_then(|line| line.parse().ok()).unwrap_or_else(|| panic!("{mutation}: {text}"));
    assert!((1..=lines + 1).contains(&line), "{mutation}: {text}");
}

#[test]
fn every_mutation_of_a_vehicle_file_is_refused_with_its_place_or_accepted() {
    let mut accepted = 0;
    let all = mutations(VEHICLE);
    for (n, (name, text)) in all.iter().enumerate() {
        match VehicleFile::from_source(Source::built_in("v.toml", text)) {
            Ok(_) => accepted += 1,
            Err(error) => has_its_place(&error, "v.toml", text.lines().count(), name),
        }
        let over = Source::built_in("over.toml", text);
        let _ = over.kind();
        if n % 8 == 0 {
            let checked = VehicleFile::check_overlay(&over);
            checked.unwrap_or_else(|error| has_its_place(&error, "over.toml", text.lines().count(), name));
        }
    }
    assert!(accepted > 100 && accepted < all.len() / 2, "{accepted} of {}", all.len());
}

#[test]
fn every_mutation_of_a_gearbox_file_is_refused_with_its_place_or_accepted() {
    let files = [
        include_str!("../../../gearboxes/8hp.toml"),
        include_str!("../../../gearboxes/dual_clutch_7.toml"),
        include_str!("gearboxes/shares.toml"),
        include_str!("gearboxes/ratios.toml"),
    ];
    for file in files {
        let mut accepted = 0;
        let all = mutations(file);
        for (name, text) in &all {
            match GearboxFile::from_source(Source::built_in("g.toml", text)) {
                Ok(_) => accepted += 1,
                Err(error) => has_its_place(&error, "g.toml", text.lines().count(), name),
            }
        }
        assert!(accepted > 5 && accepted < all.len() / 2, "{accepted} of {}", all.len());
    }
}

#[test]
fn every_mutation_of_a_vehicle_file_with_a_gearbox_is_refused_with_its_place_or_accepted() {
    let file = include_str!("../../../vehicles/eight_speed.toml");
    let mut accepted = 0;
    let all = mutations(file);
    for (name, text) in &all {
        let gearbox = Source::built_in("g.toml", include_str!("../../../gearboxes/8hp.toml"));
        match CarFile::from_sources(Source::built_in("c.toml", text), gearbox) {
            Ok(_) => accepted += 1,
            // A list may not fit the one that is taken from the shipped file.
            Err(error) if error.path().ends_with("eight_speed.toml") => (),
            Err(error) => has_its_place(&error, "c.toml", text.lines().count(), name),
        }
    }
    assert!(accepted > 50 && accepted < all.len() / 2, "{accepted} of {}", all.len());
}

#[test]
fn every_mutation_of_a_drive_file_is_refused_with_its_place_or_accepted() {
    let mut accepted = 0;
    let all = mutations(include_str!("../../../drives/city.toml"));
    for (name, text) in &all {
        match DriveFile::from_source(Source::built_in("d.toml", text)) {
            Ok(drive) => {
                assert!(drive.duration_s().is_finite());
                accepted += 1;
            }
            Err(error) => has_its_place(&error, "d.toml", text.lines().count(), name),
        }
    }
    assert!(accepted > 20 && accepted < all.len() / 2, "{accepted} of {}", all.len());
}

#[test]
fn every_mutation_of_an_experiment_file_is_refused_with_its_place_or_accepted() {
    let vehicle = VehicleFile::built_in().unwrap();
    let mut accepted = 0;
    let all = mutations(EXPERIMENT);
    for (name, text) in &all {
        let source = Source::built_in("e.toml", text);
        let _ = source.kind();
        let checked = ExperimentFile::from_source(source).and_then(|e| e.check_observers(&vehicle).map(|()| e));
        match checked {
            Ok(experiment) => {
                accepted += 1;
                for scenario in &experiment.scenarios {
                    let _ = experiment.with_scenario(scenario).simulated_vehicle(&vehicle);
                }
            }
            Err(error) => has_its_place(&error, "e.toml", text.lines().count(), name),
        }
    }
    assert!(accepted > 50 && accepted < all.len() / 2, "{accepted} of {}", all.len());
}

/// The mutations in the lines between two pieces of a text.
fn mutations_between(text: &str, from: &str, to: &str) -> Vec<(String, String)> {
    let line = |part: &str| 1 + text[..text.find(part).unwrap()].matches('\n').count();
    let lines = line(from)..line(to);
    let inside = |name: &str| {
        let number = name.trim_start_matches("line ").split(':').next().unwrap();
        lines.contains(&number.parse::<usize>().unwrap())
    };
    mutations(text).into_iter().filter(|(name, _)| inside(name)).collect()
}

#[test]
fn every_mutation_of_cylinders_hysteresis_and_backlash_is_refused_with_its_place_or_accepted() {
    let text = STROKE
        .replace("\n# How the cylinder fills.", "hysteresis_pa = 0.01e6\n\n# How the cylinder fills.")
        .replace("wheel_inertia_kg_m2 = ", "backlash_rad = 0.03\nwheel_inertia_kg_m2 = ");
    let all = mutations_between(&text, "hysteresis_pa = ", "wheel_inertia_kg_m2 = ");
    let mut accepted = 0;
    for (name, text) in &all {
        match VehicleFile::from_source(Source::built_in("v.toml", text)) {
            Ok(vehicle) => {
                accepted += 1;
                let cylinder = vehicle.oncoming.cylinder;
                assert!(cylinder.volume(0.3e6).is_finite() && cylinder.flow(0.1e6) > 0.0, "{name}");
            }
            Err(error) => has_its_place(&error, "v.toml", text.lines().count(), name),
        }
    }
    assert!(accepted > 20 && accepted < all.len() / 2, "{accepted} of {}", all.len());
}

#[test]
fn every_mutation_of_a_fast_fill_is_refused_with_its_place_or_accepted() {
    let all = mutations_between(FILL, "[shift.fill]", "[shift.torque_phase]");
    let mut accepted = 0;
    for (name, text) in &all {
        match ExperimentFile::from_source(Source::built_in("e.toml", text)) {
            Ok(_) => accepted += 1,
            Err(error) => has_its_place(&error, "e.toml", text.lines().count(), name),
        }
    }
    assert!(accepted > 10 && accepted < all.len() / 2, "{accepted} of {}", all.len());
}

#[test]
fn every_mutation_of_a_study_file_is_refused_or_accepted() {
    let folder = std::env::temp_dir().join(format!("wetclutch-mutations-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("study.toml");
    for (name, text) in mutations(STUDY) {
        std::fs::write(&path, &text).unwrap();
        if let Ok(study) = Study::read(&path) {
            let ends: Vec<f64> = study.factors.iter().map(|factor| factor.values.ends()[1]).collect();
            assert!(ends.iter().all(|end| end.is_finite()), "{name}");
        }
        let _ = config::read_sensors(&path);
    }
    std::fs::remove_dir_all(&folder).unwrap();
}
