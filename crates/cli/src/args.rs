//! The command line.

use std::fmt;
use std::ops::Range;
use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, Parser, Subcommand, ValueEnum};
use config::GainMethod;
use design::Quantity;

const EXAMPLES: &str = "\
Examples:
  wetclutch demo                                     the whole job on the built-in car
  wetclutch reproduce                                the source chapter's experiments, row by row
  wetclutch bench                                    all observers on many drives, ranked
  wetclutch study experiments/settings.toml -o out   two thousand shifts, their errors and what moves them
  wetclutch simulate experiments/e1.toml -o out      a drive as CSV
  wetclutch design vehicles/two_speed_at.toml        gains with their certificate
  wetclutch estimate log.csv --vehicle my_car.toml   pressure from measured signals

Files are SI throughout and say so in their keys and column names; measured files may also use
_rpm, _bar, _mpa, _ma, _ms, _km_h, which are converted when read.
Exit codes: 0 done, 1 the work failed (infeasible, diverged), 2 wrong usage or input.";

/// A virtual pressure sensor for the wet clutches of automatic transmissions.
///
/// Estimates the hydraulic pressure in an engaging clutch from the speeds and the valve current that
/// a car already measures, with a bound on the error.
#[derive(Debug, Parser)]
#[command(version, about, after_help = EXAMPLES, arg_required_else_help = true)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Simulate a shift, design the observer, estimate the pressure, write the report
    ///
    /// Simulates a launch from rest and a power-on 1st to 2nd upshift of the built-in two-speed automatic,
    /// designs the observer's gains for it, runs the observer and the open loop on the same samples, prints
    /// their errors, and writes:
    ///
    ///   report.html    the report; opens from disk, needs no network
    ///   shift.svg, drive.svg    its figures
    ///   trace.csv      every simulated signal, the truth included
    ///   measured.csv   only what a car measures
    ///   estimate.csv   what the observer makes of it
    #[command(verbatim_doc_comment)]
    Demo(Demo),
    /// Simulate an experiment and write its signals as CSV
    ///
    /// Simulates an experiment and writes two files: NAME.csv with every signal, the truth included, and
    /// NAME_measured.csv with only what a car measures. The same experiment gives the same bytes.
    #[command(verbatim_doc_comment)]
    Simulate(Simulate),
    /// Design observer gains and print them with their certificate
    ///
    /// Designs the gains of an observer by the five-step procedure: decay from the settling time,
    /// then the smallest gain that reaches it at every vertex of the polytope, with kappa1 raised until the
    /// bound on the remaining error is small enough. Requirements come from the vehicle file; options
    /// replace them.
    #[command(verbatim_doc_comment)]
    Design(Design),
    /// Estimate pressure and torque from a file of measured signals
    ///
    /// Runs an observer over a file of measured signals. The file needs the columns
    ///
    ///   time_s, engine_speed_rad_s, turbine_speed_rad_s, oncoming_current_a,
    ///   oncoming_slip_rad_s or output_speed_rad_s,
    ///   and for the compliant observer wheel_speed_rad_s
    ///
    /// in any order and in the units rad/s or rpm, A or mA, s or ms. An empty cell is a lost sample. Where
    /// the file also holds the true pressure (a simulated trace), the error is reported.
    #[command(verbatim_doc_comment)]
    Estimate(Estimate),
    /// Run the source chapter's experiments and set its statements beside what was measured
    ///
    /// Runs experiments E1 to E4 of the source chapter on the built-in car, and writes:
    ///
    ///   reproduction.html   statements, figures, scores; opens from disk
    ///   reproduction.md     statements and scores as Markdown
    ///   e1.svg ... e4.svg, map_*.svg    the figures
    #[command(verbatim_doc_comment)]
    Reproduce(Reproduce),
    /// Run all observers over many scenarios and rank them against the open loop
    ///
    /// Runs every observer of an experiment file on every scenario table in it: at 100 Hz, behind real sensors, on the
    /// same drives. Prints the RMS error of each in each phase, and its ratio to the open loop's; with -o, writes the same
    /// as a page.
    #[command(verbatim_doc_comment)]
    Bench(Bench),
    /// Run thousands of shifts with varied parameters
    ///
    /// Runs a study file: an experiment in which any numbers of car, drive, controller, valves and sensors vary. Writes
    ///
    ///   runs.csv, runs.parquet    one row for each run: factors, seed, how it ended, shift quality, scores
    ///   study.html                distributions, what moves the error, the worst runs; opens from disk
    ///   figures/                  its figures
    ///
    /// The same study gives the same bytes on any number of threads, in one go or resumed, whole or in shards.
    #[command(verbatim_doc_comment)]
    Study(StudyOptions),
    /// Put the shards of a study together
    ///
    /// Puts together what `study --shard 1/N` to `study --shard N/N` wrote, to the same bytes as the study in one go.
    #[command(verbatim_doc_comment)]
    Merge(Merge),
    /// Find by simulation how wrong the observers' models are
    ///
    /// Runs a study and measures, at every instant of its shifts, what the rigid and the compliant model cannot explain of
    /// the accelerations: the |w| and the H that the gain designs ask for, and what they are made of.
    #[command(verbatim_doc_comment)]
    ErrorBound(ErrorBoundOptions),
    /// Search a study's factors for the run that hurts an observer most
    ///
    /// Makes the runs of a study, then goes on from the worst of them with the simplex method of Nelder and Mead.
    #[command(verbatim_doc_comment)]
    WorstCase(WorstCaseOptions),
    /// Show what the speeds can tell about the pressure, and what each error does to it
    ///
    /// Takes the error bounds of a vehicle file and shows, phase by phase, what pressure each of them looks like and whether any
    /// observer could tell it from one.
    #[command(verbatim_doc_comment)]
    Sensitivity(SensitivityOptions),
    /// Check a vehicle, experiment or study file
    ///
    /// Checks a vehicle, experiment or study file and says what it describes. The files that it names are checked
    /// too.
    #[command(verbatim_doc_comment)]
    Check(Check),
}

#[derive(Debug, Args)]
pub(crate) struct Demo {
    /// Folder for the report
    #[arg(short, long, value_name = "DIR", default_value = "wetclutch-demo")]
    pub(crate) output: PathBuf,
}

#[derive(Debug, Args)]
pub(crate) struct Simulate {
    /// Experiment file
    pub(crate) experiment: PathBuf,
    /// Folder for the signals
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
}

#[derive(Debug, Args)]
pub(crate) struct Design {
    /// Vehicle file
    pub(crate) vehicle: PathBuf,
    /// File whose values stand in place of the vehicle file's, such as what `error-bound` writes
    #[arg(long, value_name = "BOUNDS.toml")]
    pub(crate) bounds: Option<PathBuf>,
    /// Observer to design for
    #[arg(long, value_enum, default_value_t = DesignChoice::Rigid)]
    pub(crate) observer: DesignChoice,
    /// How the gains are chosen
    #[arg(long, value_enum, default_value_t = MethodChoice::Iss)]
    pub(crate) method: MethodChoice,
    /// What the bound of the discrete-time methods is on [default: clutch-torque]
    #[arg(long, value_enum, value_name = "QUANTITY")]
    pub(crate) bound_on: Option<QuantityChoice>,
    /// Phase to design for
    #[arg(long, value_enum, default_value_t = PhaseChoice::Both)]
    pub(crate) phase: PhaseChoice,
    /// kappa1 in 1/s; without it (here or in the file) it is raised step by step
    #[arg(long, value_name = "PER_S", value_parser = positive)]
    pub(crate) kappa1: Option<f64>,
    /// kappa2 in 1/s: the decay of the error; 4/kappa2 is the settling time
    #[arg(long, value_name = "PER_S", value_parser = positive)]
    pub(crate) kappa2: Option<f64>,
    /// Bound on the model error |w|: in rad/s^2 for the rigid observer, normalised for the compliant one
    #[arg(long, value_name = "BOUND", value_parser = positive)]
    pub(crate) error_bound: Option<f64>,
    /// Largest acceptable offset of the estimate in Pa
    #[arg(long, value_name = "PA", value_parser = positive)]
    pub(crate) offset_max: Option<f64>,
    /// Sample time in s, for the discrete-time methods [default: 0.01]
    #[arg(long, value_name = "S", value_parser = positive)]
    pub(crate) sample_time: Option<f64>,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum DesignChoice {
    /// Reduced-order, rigid driveline, by the chapter's five steps
    Rigid,
    /// Reduced-order with elastic drive shafts
    Compliant,
    /// Full-order sliding mode: gains from the sliding condition, without a certificate
    Sliding,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum MethodChoice {
    /// The chapter's, in continuous time: the smallest gain that decays as required
    Iss,
    /// The same for a sample time, every error of the budget in the bound; this and the next are the open loop where no gain
    /// beats that
    IssDiscrete,
    /// The smallest bound on the error for a sample time, every error of the budget included
    PeakToPeak,
    /// The same with a gain that follows the friction coefficient
    Scheduled,
    /// The narrowest range that is carried along with the estimate
    Interval,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum QuantityChoice {
    /// The clutch torque, which the speeds tell whatever the friction is
    ClutchTorque,
    /// The pressure, which a friction that is not known spoils
    Pressure,
}

impl From<QuantityChoice> for Quantity {
    fn from(choice: QuantityChoice) -> Self {
        match choice {
            QuantityChoice::ClutchTorque => Self::ClutchTorque,
            QuantityChoice::Pressure => Self::Pressure,
        }
    }
}

impl From<MethodChoice> for GainMethod {
    fn from(choice: MethodChoice) -> Self {
        match choice {
            MethodChoice::Iss => Self::Iss,
            MethodChoice::IssDiscrete => Self::IssDiscrete,
            MethodChoice::PeakToPeak => Self::PeakToPeak,
            MethodChoice::Scheduled => Self::Scheduled,
            MethodChoice::Interval => Self::Interval,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum PhaseChoice {
    /// Torque phase and inertia phase
    Both,
    /// Load moves from the offgoing to the oncoming clutch
    Torque,
    /// Both clutches slip
    Inertia,
}

#[derive(Debug, Args)]
pub(crate) struct Estimate {
    /// File of measured signals
    pub(crate) log: PathBuf,
    /// Vehicle file
    #[arg(long)]
    pub(crate) vehicle: PathBuf,
    /// Observer
    #[arg(long, value_enum, default_value_t = ObserverChoice::Best)]
    pub(crate) observer: ObserverChoice,
    /// How the gains of the rigid and the compliant observer are chosen [default: iss]
    #[arg(long, value_enum)]
    pub(crate) method: Option<MethodChoice>,
    /// File whose table `sensors` describes those of the log, such as an experiment file: the Kalman filters are told
    /// their noise and lag, and take readings as nearly exact and of the moment without
    #[arg(long, value_name = "SENSORS.toml")]
    pub(crate) sensors: Option<PathBuf>,
    /// File for the estimate; standard output if left out
    #[arg(short, long, value_name = "OUT.csv")]
    pub(crate) output: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ObserverChoice {
    /// The Kalman filter where the log has wheel_speed_rad_s, else rigid with peak-to-peak gains
    Best,
    /// Reduced-order, rigid driveline, certified gains by `--method`
    Rigid,
    /// Reduced-order with elastic drive shafts, certified gains by `--method`; needs wheel_speed_rad_s, gives shaft
    /// torque too
    Compliant,
    /// Full-order sliding mode, gains from the sliding condition
    Sliding,
    /// Kalman filter with unknown torques as states, told how old readings are; needs wheel_speed_rad_s, gives shaft
    /// torque too
    Kalman,
    /// The same as textbooks have it, every reading of the moment
    Extended,
    /// Unscented Kalman filter on the same states
    Unscented,
    /// Super-twisting, implicit; gains from the valve's error bound
    SuperTwisting,
    /// The pressure that explains the last change of the speeds; needs wheel_speed_rad_s
    Inversion,
    /// The valve model alone
    OpenLoop,
}

#[derive(Debug, Args)]
pub(crate) struct Reproduce {
    /// Folder for page and figures
    #[arg(short, long, value_name = "DIR", default_value = "wetclutch-reproduction")]
    pub(crate) output: PathBuf,
    /// Print the rows as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Bench {
    /// Experiment file with scenario tables; the built-in experiments/bench.toml if left out
    pub(crate) experiment: Option<PathBuf>,
    /// Folder for the page
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct StudyOptions {
    /// Study file
    pub(crate) study: PathBuf,
    /// Folder for rows and page
    #[arg(short, long, value_name = "DIR", default_value = "wetclutch-study")]
    pub(crate) output: PathBuf,
    /// Complete what is in the folder already
    #[arg(long)]
    pub(crate) resume: bool,
    /// Make only the Ith of N equal parts
    #[arg(long, value_name = "I/N")]
    pub(crate) shard: Option<Shard>,
    #[command(flatten)]
    pub(crate) threads: Threads,
    /// Make this one run again, with all its signals and its figure
    #[arg(long, value_name = "RUN", conflicts_with_all = ["resume", "shard"])]
    pub(crate) run: Option<u64>,
}

#[derive(Debug, Args)]
pub(crate) struct Threads {
    /// Number of threads; as many as the machine has if left out
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
}

impl Threads {
    /// The number of threads.
    pub(crate) fn count(&self) -> usize {
        let available = || std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        self.threads.map_or_else(available, usize::from)
    }
}

#[derive(Debug, Args)]
pub(crate) struct ErrorBoundOptions {
    /// Study file
    pub(crate) study: PathBuf,
    /// File for the bounds, which `design --bounds` reads, with a page beside it; standard output if left out
    #[arg(short, long, value_name = "BOUNDS.toml")]
    pub(crate) output: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) threads: Threads,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct SensitivityOptions {
    /// Vehicle file; the built-in car if left out
    pub(crate) vehicle: Option<PathBuf>,
    /// Folder for the page
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct WorstCaseOptions {
    /// Study file
    pub(crate) study: PathBuf,
    /// Name of the observer to hurt; the study's first if left out
    #[arg(long)]
    pub(crate) observer: Option<String>,
    /// Phase in which
    #[arg(long, value_enum, default_value_t = PhaseChoice::Both)]
    pub(crate) phase: PhaseChoice,
    /// How many of the study's worst runs to search from
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub(crate) starts: u16,
    /// Most steps of each search
    #[arg(long, value_name = "N", default_value_t = 200)]
    pub(crate) iterations: u64,
    /// Folder for the case as a study file and its figure
    #[arg(short, long, value_name = "DIR", default_value = "wetclutch-worst-case")]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) threads: Threads,
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
    /// Folders of all shards, in their order
    #[arg(required = true)]
    pub(crate) shards: Vec<PathBuf>,
    /// Folder for the whole
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
}

#[derive(Debug, Args)]
pub(crate) struct Check {
    /// Vehicle, experiment or study file
    pub(crate) file: PathBuf,
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err("expected a number above 0".to_owned()),
    }
}
