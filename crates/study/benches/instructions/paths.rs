//! The paths in which the program spends its time.

use std::hint::black_box;
use std::io;
use std::path::Path;

use car::{Experiment, GainMethod, ObserverKind, Vehicle};
use config::ExperimentFile;
use design::rigid::design_phase;
use design::{design_rigid, kalman_filter, range, requirement, rigid_observer};
use observer::{Estimator, Phase, one_shift_filter};
use plant::{Contact, Direction, Inputs, Mode, Powertrain, Simulation, State};
use study::{AnyObserver, Log, LogRow};
use trace::{CsvRows, CsvWriter};

use crate::drive;
use crate::shared::{SAMPLE_TIME_S, THREE, campaign, samples, vehicle, write_log};

/// A path, with what it does prepared outside of the count.
pub(crate) struct HotPath {
    pub(crate) name: &'static str,
    /// Counts are given for one of so many.
    pub(crate) units: u64,
    pub(crate) prepare: fn() -> Box<dyn FnMut()>,
}

/// All of them.
pub(crate) const PATHS: &[HotPath] = &[
    HotPath { name: "right-hand side of the plant", units: 1000, prepare: right_hand_side },
    HotPath { name: "shift of 1.5 s from a warm state", units: 1, prepare: warm_shift },
    HotPath { name: "launch and shift of 9.5 s, recorded every 1 ms", units: 1, prepare: launch_and_shift },
    HotPath { name: "step of the Kalman filter", units: 200, prepare: kalman_step },
    HotPath { name: "step of the gearbox filter, car of one shift", units: 200, prepare: one_shift_step },
    HotPath { name: "step of the rigid observer", units: 200, prepare: rigid_step },
    HotPath { name: "step of the range", units: 200, prepare: range_step },
    HotPath { name: "step of the gearbox filter", units: drive::SHIFT_STEPS, prepare: drive::shift },
    HotPath { name: "step of the gearbox filter, over a drive", units: drive::DRIVE_STEPS, prepare: drive::drive },
    HotPath {
        name: "step of its valve models alone, over a drive",
        units: drive::DRIVE_STEPS,
        prepare: drive::open_loop,
    },
    HotPath { name: "gain design of one phase", units: 1, prepare: gain_design },
    HotPath { name: "run of a study with three observers", units: 4, prepare: study_runs },
    HotPath { name: "estimate of 10,000 rows of CSV, with range", units: 1, prepare: estimate_rows },
];

fn right_hand_side() -> Box<dyn FnMut()> {
    let powertrain = Powertrain::new(vehicle());
    let mode = Mode { offgoing: Contact::Stuck, oncoming: Contact::Slipping(Direction::Forward) };
    let inputs = Inputs { throttle: 0.22, offgoing_settled_pa: 1e6, oncoming_settled_pa: 0.0 };
    let x = State { engine_rad_s: 250.0, turbine_rad_s: 225.0, output_rad_s: 90.0, wheel_rad_s: 30.0, ..State::ZERO };
    Box::new(move || {
        for _ in 0..1000 {
            black_box(powertrain.derivative(mode, black_box(&x.to_array()), &inputs));
        }
    })
}

fn warm_shift() -> Box<dyn FnMut()> {
    let experiment: &Experiment =
        Box::leak(Box::new(Experiment { sample_time_s: 0.01, ..ExperimentFile::e1().unwrap().experiment }));
    let powertrain: &Powertrain = Box::leak(Box::new(Powertrain::new(vehicle())));
    let request_s = experiment.shift.request_s;
    let mut shift = Simulation::new(powertrain, &vehicle(), experiment).unwrap();
    shift.advance(request_s, |_| {}).unwrap();
    Box::new(move || {
        shift
            .advance(request_s + 1.5, |sample| {
                black_box(sample);
            })
            .unwrap();
    })
}

fn launch_and_shift() -> Box<dyn FnMut()> {
    let (vehicle, experiment) =
        (vehicle(), Experiment { sample_time_s: 0.001, ..ExperimentFile::e1().unwrap().experiment });
    Box::new(move || {
        let record = |sample: &_| {
            black_box(sample);
        };
        plant::simulate(&vehicle, &experiment, record).unwrap();
    })
}

/// How many samples of a shift are stepped over.
const STEPS: usize = 200;

/// An observer over the first samples of a real shift.
fn steps(observer: impl Estimator<f64, State: 'static> + 'static) -> Box<dyn FnMut()> {
    let samples = samples();
    let mut state = observer.start();
    Box::new(move || {
        for sample in &samples[..STEPS] {
            black_box(observer.step(&mut state, black_box(sample)));
        }
    })
}

fn kalman_step() -> Box<dyn FnMut()> {
    let sensors = ExperimentFile::bench().unwrap().experiment.sensors_given;
    steps(kalman_filter(&vehicle(), sensors.as_ref()))
}

fn one_shift_step() -> Box<dyn FnMut()> {
    let sensors = ExperimentFile::bench().unwrap().experiment.sensors_given;
    steps(one_shift_filter(&vehicle(), sensors.as_ref()))
}

fn rigid_step() -> Box<dyn FnMut()> {
    steps(rigid_observer(&vehicle(), design_rigid(&vehicle()).unwrap().gains()))
}

fn range_step() -> Box<dyn FnMut()> {
    let (range, samples) = (range(&vehicle()), samples());
    let mut state = range.start();
    Box::new(move || {
        for sample in &samples[..STEPS] {
            black_box(range.step(&mut state, black_box(sample)));
        }
    })
}

fn gain_design() -> Box<dyn FnMut()> {
    let vehicle = vehicle();
    let required = requirement(&vehicle, Phase::InertiaPhase).into();
    Box::new(move || {
        black_box(design_phase(black_box(&vehicle), Phase::InertiaPhase, &required).unwrap());
    })
}

fn study_runs() -> Box<dyn FnMut()> {
    let campaign = campaign(5, |name| THREE.contains(&name));
    // The first run makes the memory for the others.
    campaign.row(0).unwrap();
    Box::new(move || {
        for run in 1..5 {
            black_box(campaign.row(run).unwrap());
        }
    })
}

/// Reads rows, runs the Kalman filter with its range, and writes rows, as `wetclutch estimate` does.
fn estimate_rows() -> Box<dyn FnMut()> {
    let (vehicle, observer, log) = (vehicle(), observer(ObserverKind::Kalman), write_log(Vec::new(), 10_000));
    Box::new(move || estimate(&observer, &vehicle, &log))
}

/// An observer for such a log.
fn observer(kind: ObserverKind) -> AnyObserver {
    let sensors = ExperimentFile::bench().unwrap().experiment.sensors_given;
    AnyObserver::designed(&vehicle(), kind, GainMethod::Iss, SAMPLE_TIME_S, sensors.as_ref()).unwrap()
}

/// Reads such a log, runs an observer with its range, and writes all columns of its estimates as CSV.
fn estimate(observer: &AnyObserver, vehicle: &Vehicle, log: &[u8]) {
    let rows = CsvRows::of_log(Path::new("log.csv"), Box::new(io::Cursor::new(log.to_vec()))).unwrap();
    let log = Log::of(rows, vehicle, 1).unwrap();
    let columns = observer.columns(log.signals().has_wheel_speed()).columns();
    let mut writer = CsvWriter::new(io::sink(), columns.iter().map(|column| column.name)).unwrap();
    let samples = log.map(|sample| sample.map_err(|error| error.to_string()));
    let write = |row: LogRow, estimate| {
        let cells = columns.iter().map(|column| column.cell(&estimate));
        writer.row(row.time_s, cells).map_err(|error| error.to_string())
    };
    observer.run_over(Some(vehicle), samples, write).unwrap();
}
