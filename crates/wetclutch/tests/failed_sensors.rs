//! Speed sensors that fail for good, and plates that are glazed: the estimate goes on, and says what has failed and since when.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use car::{FailedReading, FailedSensor, Fault, FaultKind};
use wetclutch::{EstimateOptions, Estimates, LogInput, VehicleFile, estimate, simulate};

const FROM_S: f64 = 60.0;

/// The estimate of a drive with this fault.
fn estimated(vehicle: &str, kind: Option<FaultKind>, repetitions: u32) -> Estimates {
    let root: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let vehicle = VehicleFile::read(&root.join(vehicle)).unwrap();
    let mut drive = wetclutch::read_drive(&root.join("drives/city.toml"), None).unwrap();
    drive.repetitions = repetitions;
    drive.faults = kind.into_iter().map(|kind| Fault { kind, from_s: FROM_S }).collect();
    let run = simulate(vehicle.car().unwrap(), &drive).unwrap();
    // The truth is that of a sound sensor.
    assert!(run.truth.numbers("turbine_speed_rad_s").unwrap().iter().all(|speed| speed.is_finite()));
    let log = Arc::new(run.measured);
    estimate(&vehicle, LogInput::of_table("a drive", &log), &EstimateOptions::default()).unwrap()
}

fn failed(found: &Estimates) -> Vec<&str> {
    found.notes.iter().map(String::as_str).filter(|note| note.contains("has no usable reading")).collect()
}

#[test]
fn a_speed_that_fails_for_good_is_named_with_its_time() {
    for (sensor, name) in [
        (FailedSensor::Engine, "engine_speed"),
        (FailedSensor::Turbine, "turbine_speed"),
        (FailedSensor::Output, "output_speed"),
        (FailedSensor::Wheel, "wheel_speed"),
    ] {
        for reading in [FailedReading::Zero, FailedReading::Frozen, FailedReading::None] {
            let found = estimated("vehicles/eight_speed.toml", Some(FaultKind::SpeedSensor { sensor, reading }), 1);
            let [note] = failed(&found)[..] else { panic!("{name} {reading:?}: {:?}", found.notes) };
            assert!(note.starts_with(&format!("warning: {name} has no usable reading from ")), "{note}");
            let since_s: f64 = note.split(" s to the end").next().unwrap().rsplit(' ').next().unwrap().parse().unwrap();
            // In the city the car may stand at that time.
            assert!((since_s - FROM_S).abs() < 10.0, "{reading:?} {note}");
        }
    }
    for vehicle in ["vehicles/eight_speed.toml", "vehicles/dual_clutch.toml", "vehicles/four_speed_4l60e.toml"] {
        assert_eq!(failed(&estimated(vehicle, None, 1)), [""; 0], "{vehicle}");
    }
}

#[test]
fn glazed_plates_are_a_clutch_that_transmits_less() {
    let kind = FaultKind::GlazedPlates { element: "C".to_owned(), friction_factor: 0.3 };
    let found = estimated("vehicles/eight_speed.toml", Some(kind), 3);
    let notes: Vec<_> = found.notes.iter().filter(|note| note.contains("transmit less torque")).collect();
    assert!(notes.len() == 1 && notes[0].contains(": C "), "{:?}", found.notes);
}
