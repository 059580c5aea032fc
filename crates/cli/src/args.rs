//! The command line.

use std::fmt;
use std::ops::{Range, RangeInclusive};
use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, Parser, Subcommand, ValueEnum};
use config::vehicle::short::ValveKind;
use config::{GainMethod, SAMPLE_TIMES_S};
use design::Quantity;
use trace::TableFormat;

const EXAMPLES: &str = "\
Examples:
  wetclutch demo                                     simulation, design, estimation and report for the built-in car
  wetclutch demo --vehicle vehicles/eight_speed.toml  a drive through all gears of any car, every shift with its estimate
  wetclutch reproduce                                the source chapter's experiments, statement by statement
  wetclutch bench                                    all observers on many drives, ranked
  wetclutch bench --vehicle vehicles/eight_speed.toml   every shift of a gearbox, in every kind
  wetclutch study experiments/settings.toml -o out   two thousand shifts: errors and sensitivities
  wetclutch simulate experiments/e1.toml -o out      a drive as CSV
  wetclutch design vehicles/two_speed_at.toml        gains with their certificate
  wetclutch inspect drive.mf4                        channels, units, rates and gaps of a log
  wetclutch estimate log.csv --vehicle my_car.toml   pressure from measured signals
  wetclutch fit log.csv --vehicle my_car.toml -o fitted.toml   a vehicle file that fits the car

All files use SI units, which are part of keys and column names. Column names of measured files may also
end in _rpm, _bar, _mpa, _ma, _ms, _km_h; these columns are converted when they are read.
Exit codes: 0 done, 1 the work failed (infeasible, diverged), 2 wrong usage or input.";

/// A virtual pressure sensor for the wet clutches of automatic transmissions.
///
/// Estimates the hydraulic pressure in an engaging clutch from the speeds and the valve command that
/// a car already has, with a bound on the error.
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
    ///   trace.csv      every simulated signal, true values included
    ///   measured.csv   only the signals that a car measures
    ///   estimate.csv   the output of `estimate measured.csv`
    ///
    /// With the vehicle file of a car with a gearbox: drives through all of its gears, up under power, down coasting, up
    /// without power, down under power, or through a drive file. The car differs from the vehicle file. The filter for any
    /// shift sees it through toothed wheels and estimates pressure and torque of both clutches. Prints every shift with its
    /// quality and the errors of filter and open loop, and writes:
    ///
    ///   report.html    the drive, the shifts, each shift drawn
    ///   shifts.csv     the shifts as numbers
    ///   drive.csv, drive_measured.csv    the signals, as `simulate` writes them
    ///
    ///   wetclutch demo --vehicle vehicles/eight_speed.toml -o out
    ///   wetclutch demo --vehicle vehicles/ten_speed.toml --drive drives/city.toml -o out
    #[command(verbatim_doc_comment)]
    Demo(Demo),
    /// Simulate an experiment and write its signals as CSV
    ///
    /// Simulates an experiment and writes two files: NAME.csv with every signal, true values included, and
    /// NAME_measured.csv with only the signals that a car measures. The same experiment gives the same bytes. Rows are
    /// written during the simulation; the size is printed first if it is more than 1 GB. If the experiment has scenarios,
    /// the drive is simulated without them, or with the scenario given by --scenario. With a [sensors] table NAME_measured.csv
    /// has what the sensors read.
    ///
    /// A drive file (with segments) is driven with all its shifts: throttle, brake and grade over time, a shift schedule or
    /// listed shifts, and a vehicle file with a gearbox. The columns of the offgoing and oncoming clutch are empty between
    /// shifts.
    ///
    ///   wetclutch simulate drives/city.toml -o out
    ///   wetclutch simulate drives/city.toml --vehicle vehicles/ten_speed.toml -o out
    #[command(verbatim_doc_comment)]
    Simulate(Simulate),
    /// Design observer gains and print them with their certificate
    ///
    /// Designs the gains of an observer by the five-step procedure: the decay rate follows from the settling
    /// time; the gain is the smallest one with this decay rate at every vertex of the polytope; kappa1 is
    /// increased until the bound on the remaining error is small enough. Requirements come from the vehicle
    /// file; options replace them. If no gain meets a requirement, the best certified gain is printed, with
    /// its error bound and the settling time that would meet the requirement; the exit code is then 1.
    ///
    /// To use bounds on the model errors that were found by simulation:
    ///   wetclutch error-bound experiments/error_bound.toml -o bounds.toml
    ///   wetclutch design vehicles/two_speed_at.toml --bounds bounds.toml
    #[command(verbatim_doc_comment)]
    Design(Design),
    /// List what is in a log, suggest a channel map, find the shifts
    ///
    /// Reads a log of any format: CSV (any delimiter, decimal comma, units in names or in a row), Parquet, ASAM MDF 4,
    /// CAN logs (candump, ASC, BLF) with a DBC. `-` is standard input. Lists channels, units, groups, samples, rates, spans,
    /// values, gaps, and samples that cannot be used.
    ///
    ///   wetclutch inspect drive.mf4
    ///   wetclutch inspect drive.blf --dbc bus.dbc --suggest > map.toml
    ///   wetclutch inspect drive.blf --map map.toml --shifts -o drive.html
    #[command(verbatim_doc_comment)]
    Inspect(Inspect),
    /// Estimate pressure and torque from a file of measured signals
    ///
    /// Runs an observer over a file of measured signals. The file needs the columns
    ///
    ///   time_s, engine_speed_rad_s, turbine_speed_rad_s,
    ///   oncoming_current_a, or oncoming_duty_percent for pulse-width-modulated valves,
    ///   oncoming_slip_rad_s or output_speed_rad_s,
    ///   and for some observers wheel_speed_rad_s
    ///
    /// in any order and in the units rad/s or rpm, A or mA, s or ms. An empty cell or `nan` is a reading that did
    /// not come. If the file also contains the true pressure (a simulated drive), the error is reported.
    ///
    /// A log with other names, or of another format (Parquet, MDF 4, CAN with a DBC), needs a channel map, see `inspect
    /// --suggest`; every reading then comes with its own time.
    ///
    /// Every shift of the log is found by the gears that the speeds show, and by gear signals where a channel map has
    /// them. For the shifts of the vehicle file the summary gives pressure, torque and friction work with their range, the
    /// lowest shaft torque, and the error where pressure or torque was measured. With -o OUT.csv there are also
    ///
    ///   OUT_report.html   the drive and each shift as figures; opens from disk
    ///   OUT_shifts.csv, OUT_shifts.json   the shifts as numbers
    ///
    /// if there is a shift. --shift and --shifts choose shifts; the estimate then has only their rows.
    ///
    /// With the vehicle file of a car with a gearbox, both clutches of every shift are estimated from a log with the
    /// columns that `simulate` writes for a drive, or by a channel map with the commands of all elements:
    ///
    ///   wetclutch estimate city_measured.csv --vehicle vehicles/eight_speed.toml -o out.csv
    ///
    /// Rows are read and written one by one: a log may have any length, or be a pipe. Methods that design
    /// gains for a sample time use the median time step of the first 10,000 rows. A file given with -o
    /// appears when it contains all rows; it may be the log itself. A log of which a signal is unusable in most samples,
    /// or in another unit by all appearances, is an error.
    #[command(verbatim_doc_comment)]
    Estimate(Estimate),
    /// Fit a vehicle file to logs of measured shifts
    ///
    /// Finds the power-on upshifts of the vehicle's gears in the logs and fits converter, clutch, valve, inertias, shafts, tyres,
    /// mass and delays to them. Prints each value with its interval, what these logs cannot tell, and which measurement would. Writes
    /// the vehicle file with the fitted values; comments and all other keys stay, and the error budget follows from the fit.
    ///
    /// Needs engine, turbine and output speed and the command of the oncoming clutch's valve. Used where the log has them:
    /// wheel speed, command of the offgoing clutch's valve, engine torque, pressure of the oncoming clutch. Columns with
    /// the names of `estimate` need no channel map. The last fifth of the shifts is held out to check the result.
    ///
    ///   wetclutch fit drive1.mf4 drive2.mf4 --map map.toml --vehicle car.toml -o fitted.toml
    #[command(verbatim_doc_comment)]
    Fit(Fit),
    /// Write a first vehicle file for a car from a few numbers
    ///
    /// Writes a short vehicle file for one upshift. What is not in it is a default, scaled to the car where it depends on its size.
    /// What an estimate uses and somebody may know stands in it as comments. `check` lists the defaults, and says which of them matter
    /// most for the estimate; `fit` finds the values from logs. With --complete, the file has every key, and each says where its value is from.
    ///
    ///   wetclutch init --mass-kg 1650 --wheel-radius-m 0.32 --ratios 4.17,2.34 --final-ratio 3.2 --engine-torque-n-m 250 -o car.toml
    #[command(verbatim_doc_comment)]
    Init(Init),
    /// Run the source chapter's experiments and compare the results with its statements
    ///
    /// Runs experiments E1 to E4 of the source chapter on the built-in car, and again in the settings that the
    /// chapter leaves open (experiments/plausible.toml). Writes
    ///
    ///   reproduction.html   statements, figures, scores; opens from disk
    ///   reproduction.md     statements and scores as Markdown
    ///   reproduction.json   statements as numbers
    ///   e1.svg ... e4.svg, map_*.svg    the figures
    #[command(verbatim_doc_comment)]
    Reproduce(Reproduce),
    /// Run all observers over many scenarios and rank them against the open loop
    ///
    /// Runs every observer of an experiment file on every scenario of the file. All observers get the same drives; the
    /// built-in bench runs them at 100 Hz with real sensors. Prints the RMS error of each observer in each phase, and its
    /// ratio to the RMS error of the open loop; with -o, also writes them as a page. experiments/field.toml is a bench of
    /// errors of the readings: scale, delays, outliers, lost readings, channels with clocks of their own.
    ///
    /// With the vehicle file of a car with a gearbox: every shift between neighbouring gears, up and down, with power and
    /// without, each in --draws cars, estimated by the filter for any shift and by the open loop. Prints the RMS errors of the
    /// clutch torques (N m) by phase and their ratio, by shift and by kind; with -o, also writes bench.html and bench.csv.
    ///
    ///   wetclutch bench --vehicle vehicles/eight_speed.toml --draws 10 -o out
    #[command(verbatim_doc_comment)]
    Bench(Bench),
    /// Run thousands of shifts with varied parameters
    ///
    /// Runs a study file: an experiment in which any numbers of car, drive, controller, valves and sensors vary; or a drive, or
    /// shifts, of many cars with a gearbox, which differ in friction, valves and converter (no page and figures). Writes
    ///
    ///   runs.csv, runs.parquet    one row for each run: factors, seed, status, shift quality, scores
    ///   study.html                distributions, sensitivity of the error, worst runs; opens from disk
    ///   figures/                  its figures
    ///
    /// In runs.csv `inf` means that an estimate was not finite. The same study gives the same bytes on any number of
    /// threads, in one run or resumed, whole or in shards. One process at a time writes to a folder (wetclutch.lock).
    #[command(verbatim_doc_comment)]
    Study(StudyOptions),
    /// Merge the shards of a study
    ///
    /// Merges the results of `study --shard 1/N` to `study --shard N/N`. The result has the same bytes as the study
    /// in one run.
    #[command(verbatim_doc_comment)]
    Merge(Merge),
    /// Find bounds on the errors of the observers' models by simulation
    ///
    /// Runs a study and computes, at every instant of its shifts, the difference between the accelerations of the
    /// simulated car and those of the rigid and the compliant model. The result is |w| and H, which the gain design
    /// needs, and the part of each cause.
    #[command(verbatim_doc_comment)]
    ErrorBound(ErrorBoundOptions),
    /// Search a study's factors for the run with the largest error of an observer
    ///
    /// Makes the runs of a study, then continues from the worst of them with the simplex method of Nelder and Mead.
    #[command(verbatim_doc_comment)]
    WorstCase(WorstCaseOptions),
    /// Show the effect of the pressure, and of each error, on the speeds
    ///
    /// Reads the error bounds of a vehicle file. For each phase it prints the equivalent pressure error of each of them,
    /// and whether an observer can distinguish the error from a pressure.
    #[command(verbatim_doc_comment)]
    Sensitivity(SensitivityOptions),
    /// Check a vehicle, gearbox, experiment or study file
    ///
    /// Checks a vehicle, gearbox, experiment or study file, and the files that it names, and prints a summary. Also checks a
    /// bounds file for `design --bounds` and a sensors file for `estimate --sensors`. Warns of given gains that are
    /// unstable at a vertex.
    ///
    /// Of a vehicle file it lists what the file leaves to defaults, and which of them matter most: the RMS change of the estimated
    /// pressure and clutch torque in the torque and inertia phase of a simulated upshift, where each default is off by as much as the
    /// error budget or a stated share allows. --all shows every one.
    ///
    /// Of a gearbox file it prints the gears with ratios and holding torques, the capacity of the elements, and the
    /// shifts with their elements. With -o it draws them:
    ///
    ///   train.svg      shafts, planetary sets, gear pairs and elements
    ///   gear_NAME.svg  the same in a gear: engaged elements, shaft speeds, levers of the sets
    #[command(verbatim_doc_comment)]
    Check(Check),
}

#[derive(Debug, Args)]
pub(crate) struct Demo {
    /// Vehicle file with a gearbox: a drive through all of its gears
    #[arg(long, value_name = "FILE")]
    pub(crate) vehicle: Option<PathBuf>,
    /// Drive file in place of the drive through all gears
    #[arg(long, value_name = "FILE", requires = "vehicle")]
    pub(crate) drive: Option<PathBuf>,
    /// Seed of the driven car, whose friction, valve gains and converter differ from those of the vehicle file, and of the noise
    #[arg(long, value_name = "N", default_value_t = 1, requires = "vehicle")]
    pub(crate) seed: u64,
    /// Folder for the report
    #[arg(short, long, value_name = "DIR", default_value = "wetclutch-demo")]
    pub(crate) output: PathBuf,
}

#[derive(Debug, Args)]
pub(crate) struct Simulate {
    /// Experiment file, or drive file
    pub(crate) experiment: PathBuf,
    /// Vehicle file with a gearbox, for a drive file; it replaces the one that the drive file names
    #[arg(long, value_name = "FILE")]
    pub(crate) vehicle: Option<PathBuf>,
    /// Scenario of the experiment to simulate; the files are then called NAME_SCENARIO
    #[arg(long, value_name = "NAME")]
    pub(crate) scenario: Option<String>,
    /// Folder for the signals
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
}

#[derive(Debug, Args)]
pub(crate) struct Design {
    /// Vehicle file
    pub(crate) vehicle: PathBuf,
    /// File with values that replace those of the vehicle file, such as the output of `error-bound`
    #[arg(long, value_name = "BOUNDS.toml")]
    pub(crate) bounds: Option<PathBuf>,
    /// Observer to design for
    #[arg(long, value_enum, default_value_t = DesignChoice::Rigid)]
    pub(crate) observer: DesignChoice,
    /// Design method of the gains
    #[arg(long, value_enum, default_value_t = MethodChoice::Iss)]
    pub(crate) method: MethodChoice,
    /// Quantity of the error bound in the discrete-time methods [default: clutch-torque]
    #[arg(long, value_enum, value_name = "QUANTITY")]
    pub(crate) bound_on: Option<QuantityChoice>,
    /// Phase to design for
    #[arg(long, value_enum, default_value_t = PhaseChoice::Both)]
    pub(crate) phase: PhaseChoice,
    /// kappa1 in 1/s; if it is neither here nor in the file, it is increased step by step
    #[arg(long, value_name = "PER_S", allow_negative_numbers = true, value_parser = within(0.01..=1e4))]
    pub(crate) kappa1: Option<f64>,
    /// kappa2 in 1/s: decay rate of the error; the settling time is 4/kappa2
    #[arg(long, value_name = "PER_S", allow_negative_numbers = true, value_parser = within(0.4..=800.0))]
    pub(crate) kappa2: Option<f64>,
    /// Bound on the model error |w|: in rad/s^2 for the rigid observer, normalised for the compliant one
    #[arg(long, value_name = "BOUND", allow_negative_numbers = true, value_parser = within(0.0..=1e6))]
    pub(crate) error_bound: Option<f64>,
    /// Largest acceptable offset of the estimate in Pa
    #[arg(long, value_name = "PA", allow_negative_numbers = true, value_parser = within(1e3..=10e6))]
    pub(crate) offset_max: Option<f64>,
    /// Sample time in s, for the discrete-time methods [default: 0.01]
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = within(SAMPLE_TIMES_S))]
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
    /// The chapter's method, in continuous time: the smallest gain with the required decay
    Iss,
    /// The same for a sample time, with every error of the budget in the bound; this method and the following ones use the
    /// open loop where no gain reduces the bound
    IssDiscrete,
    /// The gain with the smallest error bound for a sample time, with every error of the budget
    PeakToPeak,
    /// The same, with a gain that depends on the friction coefficient
    Scheduled,
    /// The gain with the narrowest range that is computed together with the estimate
    Interval,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum QuantityChoice {
    /// The clutch torque, on which the speeds depend directly
    ClutchTorque,
    /// The pressure, which follows from the speeds only with the friction coefficient
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

/// Which channels of a log are which signals.
#[derive(Debug, Args)]
pub(crate) struct Mapping {
    /// Messages and signals of a CAN log; replaces `dbc` of the map
    #[arg(long, value_name = "FILE.dbc")]
    pub(crate) dbc: Option<PathBuf>,
    /// Channel map
    #[arg(long, value_name = "MAP.toml")]
    pub(crate) map: Option<PathBuf>,
    /// Channel of a signal, such as `engine_speed="N_Eng [rpm]"`; replaces that of the map. May be given several times
    #[arg(long, value_name = "ROLE=NAME")]
    pub(crate) channel: Vec<String>,
}

impl Mapping {
    /// The files that it names.
    pub(crate) fn files(&self) -> impl Iterator<Item = &PathBuf> {
        self.dbc.iter().chain(&self.map)
    }
}

#[derive(Debug, Args)]
pub(crate) struct Inspect {
    /// Log
    pub(crate) log: PathBuf,
    #[command(flatten)]
    pub(crate) mapping: Mapping,
    /// Print a first channel map from names and units
    #[arg(long, conflicts_with_all = ["shifts", "map", "channel"])]
    pub(crate) suggest: bool,
    /// List the shifts; needs --map or --channel
    #[arg(long)]
    pub(crate) shifts: bool,
    /// With --shifts: a page of the drive, with its shifts, the converter, engine torque and the torque at the turbine
    #[arg(short, long, value_name = "PAGE.html", requires = "shifts")]
    pub(crate) output: Option<PathBuf>,
    /// Ratios of the forward gears, 1st first; they replace those of the map
    #[arg(long, value_name = "R1,R2,...", value_delimiter = ',', requires = "shifts")]
    pub(crate) ratios: Vec<f64>,
}

#[derive(Debug, Args)]
pub(crate) struct Estimate {
    /// Logs; `-` is standard input. Several are estimated at a time, each into a file of its own
    #[arg(required = true, value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) mapping: Mapping,
    /// Vehicle file
    #[arg(long)]
    pub(crate) vehicle: PathBuf,
    /// Observer
    #[arg(long, value_enum, default_value_t = ObserverChoice::Best)]
    pub(crate) observer: ObserverChoice,
    /// Design method of the gains, for `--observer` rigid and compliant [default: iss]
    #[arg(long, value_enum)]
    pub(crate) method: Option<MethodChoice>,
    /// File whose table `sensors` describes the sensors of the log, such as an experiment file. The Kalman filters use
    /// their noise and lag; without the file they assume the noise of the error budget and no lag
    #[arg(long, value_name = "SENSORS.toml")]
    pub(crate) sensors: Option<PathBuf>,
    /// File for the estimate, by its ending CSV, .parquet or .mf4, or an existing folder; of several logs the folder for their files. Default:
    /// standard output, as CSV
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: Option<PathBuf>,
    /// Columns of the estimate, in this order; time_s is always the first
    #[arg(long, value_name = "A,B,...", value_delimiter = ',')]
    pub(crate) columns: Vec<String>,
    /// Only the Nth shift of the log: its estimates, quality and figure
    #[arg(long, value_name = "N", conflicts_with = "shifts", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) shift: Option<u32>,
    /// Only shifts between these gears, such as 1-2,2-3
    #[arg(long, value_name = "FROM-TO,...", value_delimiter = ',')]
    pub(crate) shifts: Vec<GearPair>,
    /// Estimate a log while it is written, until Ctrl-C or the end of the pipe: CSV, candump or ASC, a file or `-`
    #[arg(long)]
    pub(crate) follow: bool,
    /// Format of files in a folder [default: csv]; the ending of a file after -o says its format
    #[arg(long, value_enum)]
    pub(crate) format: Option<FormatChoice>,
    #[command(flatten)]
    pub(crate) threads: Threads,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum FormatChoice {
    /// Comma-separated text
    Csv,
    /// Parquet
    Parquet,
    /// ASAM MDF 4.10
    Mf4,
}

impl From<FormatChoice> for TableFormat {
    fn from(choice: FormatChoice) -> Self {
        match choice {
            FormatChoice::Csv => Self::Csv,
            FormatChoice::Parquet => Self::Parquet,
            FormatChoice::Mf4 => Self::Mdf,
        }
    }
}

impl FormatChoice {
    /// The ending of its files.
    pub(crate) fn ending(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Parquet => "parquet",
            Self::Mf4 => "mf4",
        }
    }
}

/// The gears of a shift.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct GearPair {
    /// The gear before, from 1.
    pub(crate) from: u32,
    /// The gear after.
    pub(crate) to: u32,
}

impl FromStr for GearPair {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let gears = text.trim().split_once('-').and_then(|(from, to)| Some((from.parse().ok()?, to.parse().ok()?)));
        match gears {
            Some((from, to)) if from != to && from > 0 && to > 0 => Ok(Self { from, to }),
            _ => Err("expected two gears from 1, such as 1-2".to_owned()),
        }
    }
}

impl fmt::Display for GearPair {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}-{}", self.from, self.to)
    }
}

#[derive(Debug, Args)]
pub(crate) struct Init {
    /// Name of the car
    #[arg(long, default_value = "my car")]
    pub(crate) name: String,
    /// Mass with driver, kg
    #[arg(long, value_name = "KG", value_parser = within(200.0..=60e3))]
    pub(crate) mass_kg: f64,
    /// Rolling radius of the driven wheels, m
    #[arg(long, value_name = "M", value_parser = within(0.1..=1.0))]
    pub(crate) wheel_radius_m: f64,
    /// Ratios of the gears before and after the shift, such as 4.17,2.34
    #[arg(long, required = true, value_name = "BEFORE,AFTER", value_delimiter = ',', num_args = 1, value_parser = within(0.6..=20.0))]
    pub(crate) ratios: Vec<f64>,
    /// Ratio from gearbox output to wheels
    #[arg(long, value_name = "RATIO", value_parser = within(0.5..=10.0))]
    pub(crate) final_ratio: f64,
    /// Greatest engine torque, N m
    #[arg(long, value_name = "N_M", value_parser = within(20.0..=2000.0))]
    pub(crate) engine_torque_n_m: f64,
    /// Kind of the clutches' valves
    #[arg(long, value_enum, default_value_t)]
    pub(crate) valve: ValveChoice,
    /// The pistons of the clutches have a stroke: the fill takes time
    #[arg(long)]
    pub(crate) stroke: bool,
    /// Write every key, with where its value is from, in place of a short file
    #[arg(long)]
    pub(crate) complete: bool,
    /// The vehicle file
    #[arg(short, long, value_name = "CAR.toml")]
    pub(crate) output: PathBuf,
}

/// Kind of a clutch's valve.
#[derive(Debug, Clone, Copy, Default, ValueEnum)]
pub(crate) enum ValveChoice {
    /// The pressure follows a current
    #[default]
    Proportional,
    /// The pressure follows a duty cycle
    PulseWidth,
}

impl From<ValveChoice> for ValveKind {
    fn from(choice: ValveChoice) -> Self {
        match choice {
            ValveChoice::Proportional => Self::Proportional,
            ValveChoice::PulseWidth => Self::PulseWidth,
        }
    }
}

#[derive(Debug, Args)]
pub(crate) struct Fit {
    /// Logs of drives with upshifts
    #[arg(required = true)]
    pub(crate) logs: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) mapping: Mapping,
    /// Vehicle file to start from; its error budget says how far off its values may be
    #[arg(long)]
    pub(crate) vehicle: PathBuf,
    /// File whose table `sensors` describes the teeth of the speed sensors, such as an experiment file
    #[arg(long, value_name = "SENSORS.toml")]
    pub(crate) sensors: Option<PathBuf>,
    /// The fitted vehicle file
    #[arg(short, long, value_name = "FITTED.toml")]
    pub(crate) output: PathBuf,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ObserverChoice {
    /// kalman if the log has wheel_speed_rad_s, otherwise rigid with peak-to-peak gains
    Best,
    /// Reduced-order, rigid driveline, certified gains by `--method`
    Rigid,
    /// Reduced-order with elastic drive shafts, certified gains by `--method`; needs wheel_speed_rad_s, also estimates
    /// the shaft torque
    Compliant,
    /// Full-order sliding mode, gains from the sliding condition
    Sliding,
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

#[derive(Debug, Args)]
pub(crate) struct Reproduce {
    /// Folder for page and figures
    #[arg(short, long, value_name = "DIR", default_value = "wetclutch-reproduction")]
    pub(crate) output: PathBuf,
    /// Print the rows as JSON
    #[arg(long)]
    pub(crate) json: bool,
    /// Number of settings in which the statements are tested; default and most: all of experiments/plausible.toml
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
    /// Vehicle file with a gearbox: every shift between its neighbouring gears, in every kind
    #[arg(long, value_name = "FILE")]
    pub(crate) vehicle: Option<PathBuf>,
    /// Cars drawn for each shift, whose friction, valve gains and converter differ from those of the vehicle file
    #[arg(long, value_name = "N", default_value_t = 10, allow_negative_numbers = true)]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=100_000), requires = "vehicle")]
    pub(crate) draws: u32,
    /// Seed of the first car; each next one has the next seed
    #[arg(long, value_name = "N", default_value_t = 1, requires = "vehicle")]
    pub(crate) seed: u64,
    /// File whose table `sensors` describes how the speeds are read; default: those of experiments/bench.toml
    #[arg(long, value_name = "SENSORS.toml", requires = "vehicle")]
    pub(crate) sensors: Option<PathBuf>,
    /// Folder for the page, and for the table of shifts (bench.csv)
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
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
    /// Complete the unfinished study in the folder
    #[arg(long)]
    pub(crate) resume: bool,
    /// Make only the Ith of N equal parts
    #[arg(long, value_name = "I/N")]
    pub(crate) shard: Option<Shard>,
    #[command(flatten)]
    pub(crate) threads: Threads,
    /// Make only this run again, and write all its signals and its figure
    #[arg(long, value_name = "RUN", allow_negative_numbers = true, conflicts_with_all = ["resume", "shard"])]
    pub(crate) run: Option<u64>,
}

#[derive(Debug, Args)]
pub(crate) struct Threads {
    /// Number of threads; default: as many as the machine has
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u16).range(1..=1024))]
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
    /// File for the bounds, which `design --bounds` reads; a page is written beside it. Default: standard output
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
    /// Vehicle file; default: the built-in car
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
    /// Name of the observer to search against; default: the first of the study
    #[arg(long)]
    pub(crate) observer: Option<String>,
    /// Phase whose RMS error is maximised
    #[arg(long, value_enum, default_value_t = PhaseChoice::Both)]
    pub(crate) phase: PhaseChoice,
    /// Number of worst runs of the study to start searches from
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 4)]
    #[arg(value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub(crate) starts: u16,
    /// Maximum number of steps of each search
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 200)]
    #[arg(value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    pub(crate) iterations: u64,
    /// Folder for the worst case (a study file) and its figure
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
    /// Folder for the merged study
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: PathBuf,
}

#[derive(Debug, Args)]
pub(crate) struct Check {
    /// Vehicle, experiment, study, bounds or sensors file
    pub(crate) file: PathBuf,
    /// Folder for the diagrams of a gearbox file
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
    /// Show every default of a vehicle file
    #[arg(long)]
    pub(crate) all: bool,
}

/// A number in this range, as a vehicle file has it.
fn within(range: RangeInclusive<f64>) -> impl Fn(&str) -> Result<f64, String> + Clone {
    move |text| match text.parse::<f64>() {
        Ok(value) if range.contains(&value) => Ok(value),
        _ => Err(format!("expected a number from {} to {}", range.start(), range.end())),
    }
}
