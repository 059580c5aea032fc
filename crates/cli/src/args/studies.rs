//! Options of the commands that run observers many times.

use std::fmt;
use std::ops::Range;
use std::path::PathBuf;
use std::str::FromStr;

use car::ObserverKind;
use clap::{Args, ValueEnum};

use super::{Open, OpenOutput, PhaseChoice, whole};

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ObserverChoice {
    /// gearbox; kalman with --sensors and wheel_speed_rad_s; open-loop-maps without an engine speed
    Best,
    /// Reduced-order, rigid driveline, certified gains by `--method`
    Rigid,
    /// Reduced-order with elastic drive shafts, certified gains by `--method`; needs wheel_speed_rad_s, also estimates
    /// the shaft torque
    Compliant,
    /// Full-order sliding mode, gains from the sliding condition
    Sliding,
    /// Kalman filter of both clutches, as for cars with a gearbox; also estimates the shaft torque
    Gearbox,
    /// Kalman filter with unknown torques, scale and delays of the readings as states; needs wheel_speed_rad_s, also
    /// estimates the shaft torque
    Kalman,
    /// Extended Kalman filter on six states in its textbook form, without sensor lag
    Extended,
    /// Unscented Kalman filter on the same six states
    Unscented,
    /// Super-twisting, implicit discretisation; gains from the valve's error bound
    SuperTwisting,
    /// Pressure that follows from the last change of the speeds; needs wheel_speed_rad_s
    Inversion,
    /// The valve model alone
    OpenLoop,
    /// The valve's maps alone, with the middle of the delay budget
    OpenLoopMaps,
}

impl ObserverChoice {
    /// The kind; none for the best.
    pub(crate) fn kind(self) -> Option<ObserverKind> {
        Some(match self {
            Self::Best => return None,
            Self::Rigid => ObserverKind::Rigid,
            Self::Compliant => ObserverKind::Compliant,
            Self::Sliding => ObserverKind::Sliding,
            Self::Gearbox => ObserverKind::Gearbox,
            Self::Kalman => ObserverKind::Kalman,
            Self::Extended => ObserverKind::Extended,
            Self::Unscented => ObserverKind::Unscented,
            Self::SuperTwisting => ObserverKind::SuperTwisting,
            Self::Inversion => ObserverKind::Inversion,
            Self::OpenLoop => ObserverKind::OpenLoop,
            Self::OpenLoopMaps => ObserverKind::OpenLoopMaps,
        })
    }
}

#[derive(Debug, Args)]
pub(crate) struct Reproduce {
    /// Folder for page and figures
    #[arg(short, long, value_name = "DIR", default_value = "wetclutch-reproduction")]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) open: Open,
    /// Print the rows as JSON
    #[arg(long)]
    pub(crate) json: bool,
    /// Number of settings in which the statements are tested; default and maximum: all of experiments/plausible.toml
    #[arg(long, value_name = "N")]
    pub(crate) settings: Option<u32>,
    #[command(flatten)]
    pub(crate) threads: Threads,
}

#[derive(Debug, Args)]
pub(crate) struct Bench {
    /// Experiment file with scenario tables; default: the built-in experiments/bench.toml
    #[arg(conflicts_with = "vehicle")]
    pub(crate) experiment: Option<PathBuf>,
    /// Vehicle file with a gearbox: every shift between neighbouring gears, of every kind
    #[arg(long, value_name = "FILE")]
    pub(crate) vehicle: Option<PathBuf>,
    /// Number of cars sampled for each shift; friction, valve gains, converter and piston strokes differ from the vehicle file
    #[arg(long, value_name = "N", default_value_t = 10, allow_negative_numbers = true)]
    #[arg(value_parser = whole(1..=100_000_u32), requires = "vehicle")]
    pub(crate) draws: u32,
    /// Seed of the first car; the next cars have the next seeds
    #[arg(long, value_name = "N", default_value_t = 1, requires = "vehicle")]
    pub(crate) seed: u64,
    /// File whose table `sensors` describes the sensors; default: those of experiments/bench.toml
    #[arg(long, value_name = "SENSORS.toml", requires = "vehicle")]
    pub(crate) sensors: Option<PathBuf>,
    /// Folder for the page, and for the table of shifts (bench.csv)
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) open: OpenOutput,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) threads: Threads,
}

#[derive(Debug, Args)]
pub(crate) struct StudyOptions {
    /// Study file
    pub(crate) study: PathBuf,
    /// Folder for rows and page
    #[arg(short, long, value_name = "DIR", default_value = "wetclutch-study")]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) open: Open,
    /// Complete the unfinished study in the folder
    #[arg(long)]
    pub(crate) resume: bool,
    /// Run only the Ith of N equal parts
    #[arg(long, value_name = "I/N")]
    pub(crate) shard: Option<Shard>,
    #[command(flatten)]
    pub(crate) threads: Threads,
    /// Repeat only this run, and write all its signals and its figure
    #[arg(long, value_name = "RUN", allow_negative_numbers = true, conflicts_with_all = ["resume", "shard", "open"])]
    pub(crate) run: Option<u64>,
    /// Print files and errors as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Threads {
    /// Number of threads; default: as many as the machine has
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = whole(1..=1024_u16))]
    threads: Option<u16>,
}

impl Threads {
    /// As many as the machine has.
    pub(crate) const ALL: Self = Self { threads: None };

    /// Whether a number was given.
    pub(crate) fn is_given(&self) -> bool {
        self.threads.is_some()
    }

    /// The number of threads.
    pub(crate) fn count(&self) -> usize {
        self.threads.map_or_else(wetclutch::available_threads, usize::from)
    }
}

#[derive(Debug, Args)]
pub(crate) struct ErrorBoundOptions {
    /// Study file
    pub(crate) study: PathBuf,
    /// File for the bounds, which `design --bounds` reads; a page is written alongside. Default: standard output
    #[arg(short, long, value_name = "BOUNDS.toml")]
    pub(crate) output: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) open: OpenOutput,
    #[command(flatten)]
    pub(crate) threads: Threads,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct SensitivityOptions {
    /// Vehicle file; default: the built-in car
    pub(crate) vehicle: Option<PathBuf>,
    /// File whose table `sensors` describes the sensors of a car with a gearbox; default: those of experiments/bench.toml
    #[arg(long, value_name = "SENSORS.toml")]
    pub(crate) sensors: Option<PathBuf>,
    /// Folder for the page
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) open: OpenOutput,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct WorstCaseOptions {
    /// Study file
    pub(crate) study: PathBuf,
    /// Name of the observer to search against; default: the first of the study
    #[arg(long)]
    pub(crate) observer: Option<String>,
    /// Phase whose RMS error is maximised
    #[arg(long, value_enum, default_value_t = PhaseChoice::Both)]
    pub(crate) phase: PhaseChoice,
    /// Number of worst runs of the study to start searches from
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 4)]
    #[arg(value_parser = whole(1..=1000_u16))]
    pub(crate) starts: u16,
    /// Maximum number of steps of each search
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 200)]
    #[arg(value_parser = whole(1..=1_000_000_u64))]
    pub(crate) iterations: u64,
    /// Folder for the page, and for each worst case a study file and a figure
    #[arg(short, long, value_name = "DIR", default_value = "wetclutch-worst-case")]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) open: Open,
    #[command(flatten)]
    pub(crate) threads: Threads,
    /// Print the worst cases as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// One of equal parts of a study.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Shard {
    /// Which, from 1.
    pub(crate) index: u64,
    /// Of how many.
    pub(crate) count: u64,
}

impl Shard {
    /// The runs of this part.
    pub(crate) fn of(self, runs: u64) -> Range<u64> {
        let edge =
            |part: u64| u64::try_from(u128::from(runs) * u128::from(part) / u128::from(self.count)).unwrap_or(runs);
        edge(self.index - 1)..edge(self.index)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        match parts {
            Some((index, count)) if (1..=count).contains(&index) => Ok(Self { index, count }),
            _ => Err("expected I/N with I from 1 to N, such as 2/4".to_owned()),
        }
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

#[derive(Debug, Args)]
pub(crate) struct Merge {
    /// Study file
    pub(crate) study: PathBuf,
    /// Folders of all shards
    #[arg(required = true)]
    pub(crate) shards: Vec<PathBuf>,
    /// Folder for the merged study
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) open: Open,
    /// Print files and errors as JSON
    #[arg(long)]
    pub(crate) json: bool,
}
