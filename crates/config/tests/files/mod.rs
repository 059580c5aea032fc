//! The files that ship, and files that are wrong.

mod all_errors;
mod cylinders;
mod experiments;
mod sensors;
mod studies;
mod vehicles;

use config::{ExperimentFile, Kind, Source, VehicleFile};

const VEHICLE: &str = include_str!("../../../../vehicles/two_speed_at.toml");
const EXPERIMENT: &str = include_str!("../../../../experiments/e1.toml");
/// An experiment with sensors and scenarios.
const BENCH: &str = include_str!("../../../../experiments/bench.toml");

fn line_of(text: &str, part: &str) -> usize {
    1 + text[..text.find(part).unwrap()].matches('\n').count()
}

/// A folder that goes away with the test.
struct Folder(std::path::PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("wetclutch-files-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn with(&self, name: &str, text: &str) -> std::path::PathBuf {
        std::fs::write(self.0.join(name), text).unwrap();
        self.0.join(name)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

#[test]
fn an_error_of_two_files_names_the_one_that_the_value_is_from() {
    let folder = Folder::new("overlay");
    let good = folder.with("v.toml", VEHICLE);
    let over = folder.with("b.toml", "# found\n[design.torque_phase]\nmodel_error_max_rad_s2 = -5\n");
    let error = VehicleFile::read_with(&good, &over).unwrap_err().to_string();
    assert_eq!(
        error,
        format!("{}:3: `design.torque_phase.model_error_max_rad_s2` is -5, expected 0 to 1000000", over.display())
    );
    let bad = folder.with("bad.toml", &VEHICLE.replace("mass_kg = 1500", "mass_kg = 1"));
    let fine = folder.with("fine.toml", "[design.torque_phase]\nmodel_error_max_rad_s2 = 5\n");
    let error = VehicleFile::read_with(&bad, &fine).unwrap_err().to_string();
    let line = line_of(VEHICLE, "mass_kg = 1500");
    assert!(error.starts_with(&format!("{}:{line}: `vehicle.mass_kg` is 1", bad.display())), "{error}");
    let unknown = folder.with("unknown.toml", "[design.torque_phase]\n\nmodel_eror = 5\n");
    let error = VehicleFile::read_with(&good, &unknown).unwrap_err().to_string();
    assert!(error.starts_with(&format!("{}:3: unknown key `model_eror`", unknown.display())), "{error}");
    let broken = folder.with("broken.toml", "[design.torque_phase]\nmodel_error_max_rad_s2 =\n");
    let error = VehicleFile::read_with(&good, &broken).unwrap_err().to_string();
    assert!(error.starts_with(&format!("{}:2: ", broken.display())), "{error}");
    let vehicle = VehicleFile::read_with(&good, &fine).unwrap();
    assert_eq!((vehicle.requirements.torque_phase.model_error_max_rad_s2, vehicle.road.mass_kg), (5.0, 1500.0));
}

#[test]
fn values_for_a_vehicle_file_are_checked_by_themselves() {
    let of = |text: &str| Source::built_in("b.toml", text);
    let good = of("[design.torque_phase]\nmodel_error_max_rad_s2 = 5\n");
    assert_eq!(good.kind().unwrap(), Kind::Overlay);
    VehicleFile::check_overlay(&good).unwrap();
    let error =
        VehicleFile::check_overlay(&of("[design.torque_phase]\nsettling_time_s = 0\n")).unwrap_err().to_string();
    assert!(error.starts_with("b.toml:2: `design.torque_phase.settling_time_s` is 0"), "{error}");
}

#[test]
fn a_missing_file_is_reported_where_it_is_named() {
    let folder = Folder::new("missing");
    let named = folder.with("e.toml", &EXPERIMENT.replace("../vehicles/two_speed_at.toml", "none.toml"));
    let line = line_of(EXPERIMENT, "vehicle = \"");
    let error = ExperimentFile::read(&named).unwrap().read_vehicle().unwrap_err().to_string();
    let missing = folder.0.join("none.toml");
    assert!(error.starts_with(&format!("{}:{line}: `vehicle`: {}: ", named.display(), missing.display())), "{error}");
    let study = "name = \"s\"\ntitle = \"S\"\nexperiment = \"gone.toml\"\nplan = \"sobol\"\nfactor = []\n";
    let study = folder.with("s.toml", study);
    let error = config::Study::read(&study).unwrap_err().to_string();
    assert!(error.starts_with(&format!("{}:3: `experiment`: ", study.display())), "{error}");
}

#[test]
fn files_are_told_apart_by_what_they_describe() {
    assert_eq!(Source::built_in("s", "[sensors]\nseed = 1").kind().unwrap(), Kind::Sensors);
    assert_eq!(Source::built_in("v", VEHICLE).kind().unwrap(), Kind::Vehicle);
    assert_eq!(Source::built_in("e", EXPERIMENT).kind().unwrap(), Kind::Experiment);
    assert!(Source::built_in("x", "a = 1").kind().is_err());
}
