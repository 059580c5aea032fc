//! Speed sensors that fail for good, and plates that are glazed: the estimate goes on, and says what has failed and since when.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use car::{FailedReading, FailedSensor, Fault, FaultKind};
use wetclutch::{EstimateOptions, Estimates, LogInput, Values, VehicleFile, estimate, simulate};

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

/// The last fault of a sensor holds, in whatever order the file has them; one that is frozen from the begin has its first reading.
#[test]
fn the_last_fault_of_a_sensor_holds() {
    let root: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let vehicle = VehicleFile::read(&root.join("vehicles/eight_speed.toml")).unwrap();
    let mut drive = wetclutch::read_drive(&root.join("drives/city.toml"), None).unwrap();
    drive.repetitions = 1;
    drive.segments.truncate(3);
    let fault = |reading: FailedReading, from_s: f64| {
        let sensor = FailedSensor::Turbine;
        Fault { kind: FaultKind::SpeedSensor { sensor, reading }, from_s }
    };
    drive.faults =
        vec![fault(FailedReading::Zero, 20.0), fault(FailedReading::None, 15.0), fault(FailedReading::Frozen, 0.0)];
    let run = simulate(vehicle.car().unwrap(), &drive).unwrap();
    let [time_s, read] = ["time_s", "turbine_speed_rad_s"].map(|name| run.measured.numbers(name).unwrap());
    let first = run.truth.numbers("turbine_speed_rad_s").unwrap()[0];
    for (time_s, read) in time_s.iter().zip(read) {
        match *time_s {
            ..14.99 => assert_eq!(*read, first),
            15.01..19.99 => assert!(read.is_nan()),
            20.01.. => assert_eq!(*read, 0.0),
            _ => (),
        }
    }
}

/// Speeds that come in every second row, and a car that stands at the end, are no failure.
#[test]
fn a_shaft_that_stands_with_slow_readings_has_not_failed() {
    let root: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let vehicle = VehicleFile::read(&root.join("vehicles/eight_speed.toml")).unwrap();
    let mut drive = wetclutch::read_drive(&root.join("drives/city.toml"), None).unwrap();
    drive.repetitions = 1;
    let mut rest = drive.segments[0];
    rest.duration_s = 30.0;
    drive.segments.push(rest);
    let mut log = simulate(vehicle.car().unwrap(), &drive).unwrap().measured;
    for column in &mut log.columns {
        if let (Values::Numbers(numbers), true) = (&mut column.values, column.name.ends_with("l_speed_rad_s")) {
            numbers.iter_mut().skip(1).step_by(2).for_each(|speed| *speed = f64::NAN);
        }
    }
    let found = estimate(&vehicle, LogInput::of_table("a drive", &Arc::new(log)), &EstimateOptions::default()).unwrap();
    assert_eq!(failed(&found), [""; 0]);
}
