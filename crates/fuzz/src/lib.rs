//! Broken files for every reader, and broken samples for every observer.
//!
//! A case is a target and a number; its input follows from them alone, so that it can be made again on any machine.
//! A reader may refuse an input; an accepted input is used as the commands would use it. A panic is a finding.
//!
//! `cargo test` makes the first few hundred cases of each target. `cargo run --release -p fuzz -- --seconds 600` goes on
//! for longer; it prints each finding and writes its input, which `--replay` takes.
//!
//! `corpus/` has a folder for each target that the project's own files do not serve: small files that its reader takes, with an ending in
//! their names, and inputs that were findings, without one. The test tries each of those files as it is, and mutates them too. `cargo run -p
//! fuzz --example corpus` makes those that are not written by hand.

pub mod files;
pub mod measured;
pub mod mutate;
pub mod samples;

use std::error::Error;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::{env, fs, panic};

use car::GainMethod;
use config::{CarFile, Study, VehicleFile};
use logs::{CanKind, Format};
use rand_pcg::Pcg64Mcg;
use study::AnyObserver;
use study::campaign::{Layout, Row, Status};

/// What an input is given to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Target {
    /// The reader of vehicle files.
    Vehicle,
    /// The reader of experiment files.
    Experiment,
    /// The reader of study files.
    Study,
    /// The reader of logs.
    Log,
    /// The readers of a study's table, finished or not, and its conversion to Parquet.
    Table,
    /// The `step` of every observer.
    Step,
    /// The reader of tables as text, and what reads from a measured log.
    Csv,
    /// The same of Parquet.
    Parquet,
    /// The same of MDF 4.
    Mdf,
    /// The same of candump's text.
    Candump,
    /// The same of Vector's text.
    Asc,
    /// The same of Vector's objects.
    Blf,
    /// The same of PCAN traces.
    Trc,
    /// The same of tables of frames of SavvyCAN.
    Savvy,
    /// The same of tables of frames of python-can.
    PythonCan,
    /// The same of tables with a reading in each row.
    Readings,
    /// The reader of channel maps.
    Map,
    /// The reader of the messages and signals of a bus.
    Dbc,
    /// The reader of gearbox files, and the diagrams of a gearbox.
    Gearbox,
    /// The reader of what was learnt of a car.
    Learnt,
}

impl Target {
    /// All of them.
    pub const ALL: [Self; 20] = [
        Self::Vehicle,
        Self::Experiment,
        Self::Study,
        Self::Log,
        Self::Table,
        Self::Step,
        Self::Csv,
        Self::Parquet,
        Self::Mdf,
        Self::Candump,
        Self::Asc,
        Self::Blf,
        Self::Trc,
        Self::Savvy,
        Self::PythonCan,
        Self::Readings,
        Self::Map,
        Self::Dbc,
        Self::Gearbox,
        Self::Learnt,
    ];

    /// Its name on the command line, and the folder of its corpus.
    pub fn name(self) -> &'static str {
        match self {
            Self::Vehicle => "vehicle",
            Self::Experiment => "experiment",
            Self::Study => "study",
            Self::Log => "log",
            Self::Table => "table",
            Self::Step => "step",
            Self::Csv => "csv",
            Self::Parquet => "parquet",
            Self::Mdf => "mdf",
            Self::Candump => "candump",
            Self::Asc => "asc",
            Self::Blf => "blf",
            Self::Trc => "trc",
            Self::Savvy => "savvy",
            Self::PythonCan => "python_can",
            Self::Readings => "readings",
            Self::Map => "map",
            Self::Dbc => "dbc",
            Self::Gearbox => "gearbox",
            Self::Learnt => "learnt",
        }
    }

    /// The format of the measured logs that a target takes; none of other targets.
    pub fn format(self) -> Option<Format> {
        Some(match self {
            Self::Csv => Format::Csv,
            Self::Parquet => Format::Parquet,
            Self::Mdf => Format::Mdf,
            Self::Candump => Format::Can(CanKind::Candump),
            Self::Asc => Format::Can(CanKind::Asc),
            Self::Blf => Format::Can(CanKind::Blf),
            Self::Trc => Format::Can(CanKind::Trc),
            Self::Savvy => Format::Can(CanKind::Savvy),
            Self::PythonCan => Format::Can(CanKind::PythonCan),
            Self::Readings => Format::Readings,
            _ => return None,
        })
    }
}

/// How much is tried with each input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Depth {
    /// What takes milliseconds without optimisation.
    Short,
    /// All gains are designed, and the drive of an experiment is simulated.
    Long,
}

/// Everything that the targets need.
#[derive(Debug)]
pub struct Fuzzer {
    depth: Depth,
    /// A folder of its own, with the project's vehicle and experiment files in it.
    folder: PathBuf,
    vehicle: VehicleFile,
    car: CarFile,
    observers: Vec<AnyObserver>,
    layout: Layout,
}

impl Fuzzer {
    /// Makes the observers ready, and a folder for the inputs.
    ///
    /// # Errors
    /// The project's own files are not as they should be, or the folder cannot be written.
    pub fn new(depth: Depth) -> Result<Self, Box<dyn Error>> {
        static MADE: AtomicUsize = AtomicUsize::new(0);
        let number = MADE.fetch_add(1, Ordering::Relaxed);
        let folder = env::temp_dir().join(format!("wetclutch-fuzz-{}-{number}", std::process::id()));
        for name in ["vehicles", "experiments", "gearboxes"] {
            fs::create_dir_all(folder.join(name))?;
            for entry in fs::read_dir(project().join(name))? {
                let path = entry?.path();
                fs::copy(&path, folder.join(name).join(path.file_name().unwrap_or_default()))?;
            }
        }
        let vehicle = VehicleFile::built_in()?;
        let methods = if depth == Depth::Long { &GainMethod::ALL[..] } else { &[GainMethod::Iss] };
        let observers = samples::observers(&vehicle, methods)?;
        let layout = Layout::of(&Study::read(&folder.join("experiments/settings.toml"))?);
        Ok(Self { depth, folder, vehicle, car: CarFile::eight_speed()?, observers, layout })
    }

    /// The input of a case.
    pub fn input(&self, target: Target, case: u64) -> Vec<u8> {
        let mut random = mutate::Random::new(Pcg64Mcg::new(u128::from(case) << 64 | (target as u128) << 1 | 1));
        if target == Target::Step {
            return samples::input(&mut random);
        }
        let seeds = self.seeds(target);
        let seed = &seeds[random.below(seeds.len())];
        mutate::mutated(seed, &mut random)
    }

    /// Gives an input to a target.
    ///
    /// # Panics
    /// On a defect of the project.
    pub fn run(&self, target: Target, input: &[u8]) {
        match target {
            Target::Vehicle => files::vehicle(self, input),
            Target::Experiment => files::experiment(self, input),
            Target::Study => files::study(self, input),
            Target::Log => files::log(self, input),
            Target::Table => files::table(self, input),
            Target::Step => samples::step_all(&self.vehicle, &self.observers, input),
            Target::Csv
            | Target::Parquet
            | Target::Mdf
            | Target::Candump
            | Target::Asc
            | Target::Blf
            | Target::Trc
            | Target::Savvy
            | Target::PythonCan
            | Target::Readings => {
                // A file of another format is a case of another target.
                if target.format() == Some(Format::of(input)) {
                    measured::log(self, input);
                }
            }
            Target::Map => measured::map(self, input),
            Target::Dbc => measured::dbc(self, input),
            Target::Gearbox => files::gearbox(self, input),
            Target::Learnt => files::learnt(&self.car, input),
        }
    }

    /// Gives an input to a target; `false` if it panicked.
    pub fn survives(&self, target: Target, input: &[u8]) -> bool {
        panic::catch_unwind(panic::AssertUnwindSafe(|| self.run(target, input))).is_ok()
    }

    /// The inputs that are kept for a target.
    pub fn corpus(target: Target) -> Vec<Vec<u8>> {
        texts(&[project().join("crates/fuzz/corpus").join(target.name())])
    }

    /// The inputs that the cases of a target are made from: its corpus and the project's own files.
    fn seeds(&self, target: Target) -> Vec<Vec<u8>> {
        let mut seeds = Self::corpus(target);
        let experiments = self.folder.join("experiments");
        match target {
            Target::Vehicle => {
                seeds.extend(texts(&[self.folder.join("vehicles")]));
                // A short file is the shortest of them, and most of its lines are read: as many seeds as of the others.
                seeds.extend(std::iter::repeat_n(SHORT_FILE.to_vec(), seeds.len()));
            }
            Target::Experiment => {
                seeds.extend(["bench", "e1", "e4"].map(|name| text(&experiments.join(name).with_extension("toml"))));
            }
            Target::Study => seeds.extend(
                ["settings", "budget", "error_bound"].map(|name| text(&experiments.join(name).with_extension("toml"))),
            ),
            Target::Gearbox => seeds.extend(texts(&[self.folder.join("gearboxes")])),
            Target::Csv
            | Target::Parquet
            | Target::Mdf
            | Target::Candump
            | Target::Asc
            | Target::Blf
            | Target::Trc
            | Target::Savvy
            | Target::PythonCan
            | Target::Readings => {
                let logs = measured::logs().into_iter().filter(|log| target.format() == Some(Format::of(log)));
                seeds.extend(logs);
            }
            Target::Map => seeds.push(text(&project().join("maps/genesis_at8.toml"))),
            Target::Dbc => seeds.extend([text(&measured::bus()), text(&project().join("maps/genesis_at8.dbc"))]),
            Target::Log | Target::Step | Target::Table | Target::Learnt => {}
        }
        seeds
    }

    /// A small table of a study's runs.
    pub fn table(&self) -> Vec<u8> {
        let mut text = self.layout.header().join(",");
        for (run, status) in [(0, Status::Ok), (1, Status::NoLockUp), (2, Status::TieUp)] {
            let numbers = vec![if status.is_scored() { 0.25 } else { f64::NAN }; self.layout.width()];
            text.push('\n');
            text += &Row { run, seed: 7 + run, status, numbers }.line(&self.layout);
        }
        text.push('\n');
        text.into_bytes()
    }
}

impl Drop for Fuzzer {
    fn drop(&mut self) {
        // A folder that stays behind harms nothing.
        let _ = fs::remove_dir_all(&self.folder);
    }
}

/// A short vehicle file with some of the keys that it may have.
const SHORT_FILE: &[u8] = b"\
name = \"short\"
[gear_train]
ratios = [4.17, 2.34]
[engine]
max_torque_n_m = 250
[clutch.b]
piston_area_m2 = 0.02
friction = { slip_rad_s = [0.0, 100.0], coefficient = [0.12, 0.14] }
[clutch.b.valve]
hysteresis_pa = 5e3
[clutch.b.fill]
enabled = true
stroke_m = 1e-3
[driveline]
final_ratio = 3.2
backlash_rad = 0.01
[vehicle]
mass_kg = 1650
wheel_radius_m = 0.32
[oil]
temperature_degc = 60
[design.error_bounds]
mass_kg = 100
[design.error_bounds.fill]
volume_factor = [0.8, 1.2]
";

fn project() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn text(path: &std::path::Path) -> Vec<u8> {
    fs::read(path).unwrap_or_default()
}

/// The files in these folders, in the order of their names; none in a folder that is not there.
fn texts(folders: &[PathBuf]) -> Vec<Vec<u8>> {
    let entries = folders.iter().filter_map(|folder| fs::read_dir(folder).ok()).flatten().flatten();
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    paths.sort();
    paths.iter().map(|path| text(path)).collect()
}
