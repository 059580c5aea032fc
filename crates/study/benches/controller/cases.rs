//! The observers that are counted, and the readings that they are counted over.

use std::path::Path;
use std::process::Command;

use car::Vehicle;
use config::{ExperimentFile, VehicleFile};
use design::{design_rigid, kalman_filter, range, rigid_observer};
use observer::{Bounded, Estimator, Input};
use serde::Serialize;
use study::sampling::through_sensors;
use study::{RunColumns, simulate_shift};

use crate::{root, said};

/// Time in gear before the shift, s: scale and delays of the sensors are learnt in it.
const BEFORE_S: f64 = 3.0;
/// Sample time, s.
const SAMPLE_TIME_S: f64 = 0.01;

/// An observer with its range on a car.
pub(crate) struct Case {
    pub(crate) name: String,
    /// What the program on the controller reads.
    bytes: Vec<u8>,
    /// Pressures by the same code here, Pa.
    expected_pa: Vec<f32>,
}

/// Instructions of the steps of a part.
pub(crate) struct Steps {
    pub(crate) mean: u64,
    pub(crate) worst: u64,
}

/// What a run on the controller said.
pub(crate) struct Run {
    /// Instructions of a loop, and how many were counted.
    pub(crate) check_loop: [u64; 2],
    /// Bytes of the parameters, and of the state.
    pub(crate) bytes: [u64; 2],
    pub(crate) parts: Vec<(String, Steps)>,
    /// Largest difference of an estimate from that of the same code here, Pa.
    pub(crate) difference_pa: f32,
}

/// All of them.
pub(crate) fn cases() -> Vec<Case> {
    let car = |file: &str| VehicleFile::read(&root().join("vehicles").join(file)).unwrap().vehicle;
    let mut cases = Vec::new();
    for (note, vehicle) in [("", car("two_speed_at.toml")), (", piston stroke", car("two_speed_stroke.toml"))] {
        let told = ExperimentFile::bench().unwrap().experiment.sensors_given;
        let range = range(&vehicle);
        let (readings, filter) = (readings(&vehicle), kalman_filter(&vehicle, told.as_ref()));
        let rigid = rigid_observer(&vehicle, design_rigid(&vehicle).unwrap().gains());
        let (filter, rigid) = (filter.cast(), rigid.cast());
        cases.push(Case::of(format!("kalman{note}"), 0, &Bounded { observer: filter, range: range.cast() }, &readings));
        cases.push(Case::of(format!("rigid{note}"), 1, &Bounded { observer: rigid, range: range.cast() }, &readings));
    }
    cases
}

/// The readings of a shift of the bench, through its sensors.
fn readings(vehicle: &Vehicle) -> Vec<Input<f32>> {
    let bench = ExperimentFile::bench().unwrap().experiment;
    let shift = simulate_shift(vehicle, vehicle, &bench, BEFORE_S).unwrap();
    let seen = through_sensors(&shift, SAMPLE_TIME_S, &bench.sensors.unwrap(), vehicle);
    let columns = RunColumns::of(&seen, vehicle).unwrap();
    columns.samples().map(|sample| sample.unwrap().0.cast()).collect()
}

impl Case {
    fn of<O: Estimator<f32> + Serialize>(
        name: String,
        kind: u8,
        observer: &Bounded<f32, O>,
        readings: &[Input<f32>],
    ) -> Self {
        let mut bytes = vec![kind];
        bytes = postcard::to_extend(observer, bytes).unwrap();
        bytes = postcard::to_extend(&u32::try_from(readings.len()).unwrap(), bytes).unwrap();
        for reading in readings {
            bytes = postcard::to_extend(reading, bytes).unwrap();
        }
        let mut state = observer.start();
        let expected_pa = readings.iter().map(|input| observer.step(&mut state, input).pressure_pa).collect();
        Self { name, bytes, expected_pa }
    }

    /// Number of the readings.
    pub(crate) fn len(&self) -> usize {
        self.expected_pa.len()
    }

    /// Runs it on the controller.
    pub(crate) fn run(&self, program: &Path) -> Result<Run, String> {
        let folder = root().join("target/controller");
        let file = folder.join(self.name.replace([' ', ','], "_")).with_extension("bin");
        let written = std::fs::create_dir_all(&folder).and_then(|()| std::fs::write(&file, &self.bytes));
        written.map_err(|error| format!("{}: {error}", file.display()))?;
        let said = said(
            Command::new("qemu-system-arm")
                .args(["-machine", "mps2-an386", "-icount", "shift=6", "-nographic", "-monitor", "none"])
                .args(["-serial", "none", "-semihosting-config", "enable=on,target=native"])
                .arg("-device")
                .arg(format!("loader,file={},addr=0x21000000,force-raw=on", file.display()))
                .arg("-kernel")
                .arg(program),
        )?;
        self.read(&said).ok_or_else(|| format!("the program on the controller said:\n{said}"))
    }

    /// Reads what the program prints.
    fn read(&self, said: &str) -> Option<Run> {
        let lines: Vec<Vec<&str>> = said.lines().map(|line| line.split(' ').collect()).collect();
        let pair = |name: &str| {
            let line = lines.iter().find(|line| line[0] == name)?;
            Some([line.get(1)?.parse().ok()?, line.get(2)?.parse().ok()?])
        };
        let (mut parts, mut difference_pa) = (Vec::new(), 0.0_f32);
        for part in ["observer", "range", "both", "guaranteed", "with-guaranteed"] {
            let steps: Vec<[u32; 2]> = (lines.iter().filter(|line| line[0] == part))
                .map(|line| Some([line.get(1)?.parse().ok()?, line.get(2)?.parse().ok()?]))
                .collect::<Option<_>>()?;
            if steps.len() != self.len() {
                return None;
            }
            let sum: u64 = steps.iter().map(|step| u64::from(step[0])).sum();
            let worst = steps.iter().map(|step| u64::from(step[0])).max()?;
            parts.push((part.to_owned(), Steps { mean: sum / steps.len() as u64, worst }));
            if part == "both" {
                let pressures = steps.iter().map(|step| f32::from_bits(step[1]));
                let differences = pressures.zip(&self.expected_pa).map(|(there, here)| (there - here).abs());
                // A number that is none is no small difference.
                difference_pa = differences.fold(0.0, |maximum, x| if x <= maximum { maximum } else { x });
            }
        }
        Some(Run { check_loop: pair("loop")?, bytes: pair("bytes")?, parts, difference_pa })
    }
}
